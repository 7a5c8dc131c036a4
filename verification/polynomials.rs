//! Kicks, Hénon layers and twists of polynomials over a box, in the box.

use crate::compositions::{Broken, identity_at_zero, measure_any, named, points};
use crate::extremes::assert_digits;
use crate::mutants::Fault;
use crate::suite;
use crate::watched::watched;
use gyroceptron::layer::{CircleAction, Kick, PolynomialPotential, Potential};
use gyroceptron::measure::{
    Measurable,
    certificate::{Row, Tally, Verdict, merged},
    laws,
    ratios::{Conditioned, RoundingPropagation},
    steps::{MeasuredPotential, MeasuredSteps},
};
use gyroceptron::network::{Architecture, Block, InitialWeights, Layers, Model, Part, Scale};
use gyroceptron::phase::{Direction, Half, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{DoubleDouble, Over, Real, Scalar, max_or_nan};
use proptest::prelude::*;
use proptest::sample::select;
use std::sync::OnceLock;

pub const STATED: usize = 300;
const NAME: &str = " of polynomials";
const DIRECTIONS: [Direction; 2] = [Direction::Forward, Direction::Inverse];

#[derive(Clone, Debug)]
struct Case {
    action: Vec<i32>,
    /// Turned twists beside twists, where a plane is slow.
    turned: bool,
    /// A conjugation of Hénon layers.
    henon: bool,
    degree: usize,
    epsilon: f64,
    /// Of points over the radius of the box.
    share: f64,
    radius: f64,
    seed: u64,
}

impl Case {
    fn dof(&self) -> usize {
        self.action.len()
    }

    fn architecture(&self) -> Architecture {
        let slow = self.action.contains(&0);
        let polynomials = |part, layers, degree: usize| {
            Block::new(part, layers).of_polynomials(degree).in_box(self.radius)
        };
        // One polynomial of one number, more of several.
        let widths = |arguments: usize| if arguments == 1 { vec![1, 1] } else { vec![3, 1] };
        let (kicks, twists) = (widths(self.dof()), widths(if slow { 2 } else { 1 }));
        let conjugation = if self.henon { kicks.clone() } else { vec![] };
        let out = Architecture::new(self.dof())
            .on_circle(CircleAction::new(self.action.clone()))
            .at_epsilon(self.epsilon)
            .of_time(1.7)
            .with(polynomials(Part::Conjugation, Layers::Henon(conjugation), 3))
            .with(polynomials(Part::Chart, Layers::TurnedKick(kicks.clone()), self.degree))
            .with(polynomials(Part::SlowMap, Layers::Twist(twists), self.degree));
        match self.turned && slow {
            true => out.with(
                polynomials(Part::SlowMap, Layers::TurnedTwist(vec![2]), self.degree)
                    .named("turned"),
            ),
            false => {
                out.with(polynomials(Part::Perturbation, Layers::TurnedKick(kicks), self.degree))
            }
        }
    }

    /// Coefficients so small that points stay near the box.
    fn network(&self) -> Model {
        let weights = InitialWeights::Normal { scale: 0.1 * self.radius };
        self.architecture().initialise(weights, 0.9, self.seed).expect("a sound architecture")
    }

    fn points(&self, count: usize) -> Vec<f64> {
        points(self.seed, self.share * self.radius, self.dof(), count)
    }
}

fn cases() -> impl Strategy<Value = Case> {
    let actions = vec![vec![1], vec![1, 0], vec![0, -2], vec![0, 1, 0]];
    (
        (select(actions), any::<bool>(), any::<bool>()),
        select(vec![1, 2, 3, 5, 8, 16, 64]),
        select(vec![0.0, 1e-6, 0.01, -0.1]),
        select(vec![0.5, 0.5, 1e-6]),
        select(vec![1.0, 1e-3, 30.0]),
        any::<u64>(),
    )
        .prop_map(|((action, turned, henon), degree, epsilon, share, radius, seed)| Case {
            action,
            turned,
            henon,
            degree,
            epsilon,
            share,
            radius,
            seed,
        })
}

/// The gradient of V = ρ Σ_k ∫c_k, with the Chebyshev polynomials by their recurrence, and a fault.
#[derive(Clone, Copy, Debug)]
struct Literal<'a> {
    n: usize,
    radius: f64,
    parameters: &'a [f64],
    width: usize,
    fault: Option<Fault>,
}

impl<S: Over<f64>> Potential<S> for Literal<'_> {
    fn dof(&self) -> usize {
        self.n
    }
    fn gradient(&self, y: &[S], out: &mut [S]) {
        let (n, h) = (self.n, self.width);
        let (w_in, c) = self.parameters.split_at(if n > 1 { n * h } else { 0 });
        let weight = |i: usize, k: usize| if n > 1 { w_in[i * h + k] } else { 1.0 };
        out[..n].fill(S::zero());
        for k in 0..h {
            let mut s = S::zero();
            for i in 0..n {
                // The network multiplies by the rounded 1/ρ.
                s = (y[i] * S::from_f64(1.0 / self.radius)).mul_add_parameter(weight(i, k), s);
            }
            let (mut now, mut next) = (S::from_f64(1.0), s);
            let mut f = S::zero();
            let degree = c.len() / h;
            for m in 0..degree {
                let last = self.fault == Some(Fault::PolynomialCoefficient) && m + 1 == degree;
                let factor = if last { 1.0 + 1e-9 } else { 1.0 };
                f = now.mul_add_parameter(factor * c[m * h + k], f);
                (now, next) = (next, S::from_f64(2.0) * s * next - now);
            }
            for i in 0..n {
                let skew = self.fault == Some(Fault::PolynomialSkew) && i == 0;
                let outer = if skew { 1.0 + 1e-9 } else { 1.0 };
                out[i] = f.mul_add_parameter(outer * weight(i, k), out[i]);
            }
        }
    }
}

impl MeasuredPotential for Literal<'_> {}

/// A kick by polynomials of two numbers, or by a literal one with a fault.
struct Kicked<'a> {
    parameters: &'a [f64],
    width: usize,
    fault: Option<Fault>,
}

const RADIUS: f64 = 1.5;

impl Kicked<'_> {
    fn kick<V>(potential: V) -> Kick<'static, f64, V> {
        Kick { potential, scale: 0.4, reflect: false, shift: None, target: Half::Momentum }
    }
    fn literal(&self) -> Literal<'_> {
        let Self { parameters, width, fault } = *self;
        Literal { n: 2, radius: RADIUS, parameters, width, fault }
    }
    fn sound(&self) -> PolynomialPotential<'_, f64> {
        PolynomialPotential::new(
            2,
            [self.width, self.parameters.len() / self.width - 2],
            RADIUS,
            &[],
            self.parameters,
        )
    }
    /// What it is in double-double after the formula.
    fn exact(&self, direction: Direction, z: &[f64]) -> Vec<f64> {
        let mut exact: Vec<_> = z.iter().map(|v| DoubleDouble::from_f64(*v)).collect();
        let kick = Self::kick(Literal { fault: None, ..self.literal() });
        let kick = if direction == Direction::Inverse { kick.inverse() } else { kick };
        kick.apply(&mut exact, &mut [DoubleDouble::zero(); 4]);
        exact.into_iter().map(Real::value).collect()
    }
}

impl Map<f64> for Kicked<'_> {
    fn dof(&self) -> usize {
        2
    }
    fn forward(&self, z: &mut [f64]) {
        self.measured_steps(Direction::Forward).iter().for_each(|step| step.apply(z));
    }
    fn inverse(&self, z: &mut [f64]) {
        self.measured_steps(Direction::Inverse).iter().for_each(|step| step.apply(z));
    }
}

impl Measurable for Kicked<'_> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        let back = direction == Direction::Inverse;
        match self.fault {
            None => {
                let kick = Self::kick(self.sound());
                vec![PolynomialPotential::measured_kick(if back { kick.inverse() } else { kick })]
            }
            Some(_) => {
                let kick = Self::kick(self.literal());
                vec![Literal::measured_kick(if back { kick.inverse() } else { kick })]
            }
        }
    }
}

/// A kick against its formula in double-double, over the bound of its rounding.
fn literal_formula(kicked: &Kicked<'_>, points: &[f64]) -> Tally {
    let ratios = points.chunks_exact(4).map(|z| {
        let mut largest = 0.0;
        for direction in DIRECTIONS {
            let steps = kicked.measured_steps(direction);
            let propagation = RoundingPropagation::new(&steps, z);
            let (scales, _) = propagation.value_scales();
            for (i, exact) in kicked.exact(direction, z).into_iter().enumerate() {
                let error = (propagation.end()[i] - exact).abs();
                let ratio = error / (f64::unit_roundoff() * scales[i]);
                largest = max_or_nan(largest, if error == 0.0 { 0.0 } else { ratio });
            }
        }
        Conditioned::Ratio(largest)
    });
    Tally::of_ratios("formula", "∇V = W c(Wᵀx)").extend_at(points, 4, ratios)
}

/// The weights of so many polynomials of two numbers.
fn weights_of_kick(degree: usize, width: usize, seed: u64) -> Vec<f64> {
    let mut stream = Stream::new(seed, "kick");
    let directions = (0..2 * width).map(|_| stream.uniform(-0.5, 0.5)).collect::<Vec<_>>();
    directions.into_iter().chain((0..degree * width).map(|_| stream.normal())).collect()
}

fn of_kick(kicked: &Kicked<'_>, points: &[f64]) -> Vec<Tally> {
    vec![
        laws::symplecticity_of("symplecticity of a kick", kicked, points),
        literal_formula(kicked, points),
    ]
}

fn measure(case: &Case) -> Vec<Tally> {
    let network = case.network();
    let map = watched("polynomials", &network);
    let (points, dof) = (case.points(11), case.dof());
    let mut out = vec![laws::symplecticity_of("symplecticity", &map, &points[..4 * dof])];
    out.extend(measure_any(&map, network.composition(), &points, dof, case.seed));
    out.push(identity_at_zero(&network.with_epsilon(0.0), &points));
    let parameters = weights_of_kick(case.degree, 3, case.seed);
    let kicked = Kicked { parameters: &parameters, width: 3, fault: None };
    out.extend(of_kick(&kicked, &crate::compositions::points(case.seed, RADIUS, 2, 2)));
    out
}

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| named(suite::run("polynomials", STATED / 2, cases(), measure), NAME))
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}

/// All laws of a network and of a kick with this fault.
pub fn rows_of_mutant(fault: Fault) -> Vec<Row> {
    let mut tallies = Vec::new();
    if matches!(fault, Fault::PolynomialSkew | Fault::PolynomialCoefficient | Fault::Friction) {
        let parameters = weights_of_kick(6, 3, 1);
        let fault = (fault != Fault::Friction).then_some(fault);
        let kicked = Kicked { parameters: &parameters, width: 3, fault };
        tallies.extend(of_kick(&kicked, &points(1, RADIUS, 2, 20)));
    }
    for henon in [false, true] {
        let case = Case {
            action: vec![1, 0],
            turned: true,
            henon,
            degree: 5,
            epsilon: 0.05,
            share: 0.5,
            radius: 1.5,
            seed: 1,
        };
        let (network, points) = (case.network(), case.points(11));
        let broken = Broken::new(fault, network.composition());
        tallies.push(laws::symplecticity_of("symplecticity", &broken, &points[..8]));
        tallies.extend(measure_any(&broken, &broken, &points, 2, case.seed));
        let epsilon = if fault == Fault::EpsilonIgnored { network.epsilon() } else { 0.0 };
        tallies.push(identity_at_zero(&network.with_epsilon(epsilon), &points));
    }
    named(merged(tallies).iter().map(Tally::row).collect(), NAME)
}

#[test]
fn sound_ones_are_not_rejected() {
    // A fault that is none of these maps.
    let rows = rows_of_mutant(Fault::Friction);
    assert!(rows.len() > 7);
    for row in &rows {
        assert_eq!(row.verdict, Verdict::Holds, "{row:?}");
    }
}

/// Degree 64 at the ends of the box and beyond them, a box of 1e-150 and one of 1e150. Oracle: the
/// same network in double-double.
#[test]
fn polynomials_keep_their_digits() {
    for (degree, radius, share) in [
        (64, 1.0, 0.7),
        (64, 1.0, 1.0),
        (64, 1.0, 1.02),
        (7, 1e-150, 0.9),
        (7, 1e150, 0.9),
        (16, 1.0, 1e-200),
    ] {
        let architecture = Architecture::new(1)
            .on_circle(CircleAction::new([1]))
            .with(
                Block::new(Part::Chart, Layers::TurnedKick(vec![1; 3]))
                    .scaled(Scale::None)
                    .of_polynomials(degree)
                    .in_box(radius),
            )
            .with(
                Block::new(Part::SlowMap, Layers::Twist(vec![1]))
                    .of_polynomials(degree.min(8))
                    .in_box(radius),
            );
        // Kicks that are small beside the point.
        let mut parameters = architecture
            .initialise(InitialWeights::Glorot, 0.4, 3)
            .expect("sound")
            .parameters()
            .to_vec();
        let mut stream = Stream::new(5, "digits");
        for (block, _, range) in architecture.layers() {
            if block.part == Part::Chart {
                let scale = 1e-8 * radius;
                parameters[range.start + 1..range.end]
                    .iter_mut()
                    .for_each(|c| *c = scale * stream.normal());
            }
        }
        let model = Model::new(architecture, parameters).expect("finite");
        let z = [0.9, -0.43].map(|v| v * radius * share);
        assert_digits(&model, &z, &format!("{degree} {radius:e} {share:e}"));
    }
}
