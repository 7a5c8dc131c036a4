//! Gyroceptrons in normal form: every law of a composition, that they commute with the
//! conjugated action, and that their actions stay for ever, whatever the weights.

use crate::compositions::{Broken, measure_any, named, points};
use crate::mutants::Fault;
use crate::watched::watched;
use crate::{precision, suite, tolerances};
use gyroceptron::layer::{CircleAction, TorusAction};
use gyroceptron::measure::{
    Measurable, NormalFormed, OneStep,
    adiabatic::log_slope,
    certificate::{Row, Tally, Verdict, merged},
    laws::{self, Samples},
    ratios::{Adjoint, Conditioned},
    steps::{MeasuredSteps, turn_steps},
};
use gyroceptron::network::{Model, NormalFormShape, Rollout, rollout};
use gyroceptron::phase::{Direction, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Elementary, max_or_nan};
use proptest::prelude::*;
use proptest::sample::select;
use std::f64::consts::PI;
use std::sync::OnceLock;

pub const STATED: usize = 400;
const NAME: &str = " of normal forms";
/// ε of the drifts; 1 is as large as it can be.
const EPSILONS: [f64; 5] = [0.0, 1e-3, 1e-2, 0.1, 1.0];
/// Networks at each ε.
const NETWORKS: u64 = 4;
const HORIZONS: [usize; 4] = [1_000, 10_000, 100_000, 1_000_000];

/// A network, ψ with it, and where its points are.
#[derive(Clone, Debug)]
pub struct Case {
    /// Slow planes, and the weights of the fast ones.
    pub slow: usize,
    pub circles: Vec<Vec<i32>>,
    pub epsilon: f64,
    pub scale: f64,
    pub psi: bool,
    pub slow_map: SlowMap,
    pub radius: f64,
    pub seed: u64,
}

/// What T_ε is made of; twists where no plane is slow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SlowMap {
    Twists,
    TurnedTwists,
    Both,
}

impl Case {
    /// The shears of T_ε: the twists, and the turned ones.
    fn slow_map(&self) -> [Vec<usize>; 2] {
        match self.slow_map {
            _ if self.slow == 0 => [vec![3; 3], vec![]],
            SlowMap::Twists => [vec![3; 3], vec![]],
            SlowMap::TurnedTwists => [vec![], vec![3, 2]],
            SlowMap::Both => [vec![3; 2], vec![2]],
        }
    }

    fn network(&self) -> Model {
        self.network_with(None)
    }

    /// With such a perturbation.
    pub fn network_with(&self, perturbation: Option<Vec<usize>>) -> Model {
        let circle = |fast: &Vec<i32>| {
            let mut weights = vec![0; self.slow];
            weights.extend(fast);
            CircleAction::new(weights)
        };
        let circles: Vec<_> = self.circles.iter().map(circle).collect();
        let [twists, turned_twists] = self.slow_map();
        let shape = NormalFormShape {
            action: TorusAction::new(circles).expect("circles of one size"),
            psi: if self.psi { vec![3] } else { vec![] },
            kicks: vec![3, 2],
            twists,
            turned_twists,
            flow_time: 2.5,
            perturbation,
        };
        let mut stream = Stream::new(self.seed, "weights");
        let count = shape.architecture(0.0).parameter_count();
        let angles = shape.action.circles().len();
        let parameters = (0..count)
            .map(|i| match i < count - angles {
                true => self.scale * stream.normal(),
                false => stream.uniform(-PI, PI),
            })
            .collect();
        Model::at_epsilon(shape.architecture(self.epsilon), self.epsilon, parameters)
            .expect("a sound shape")
    }

    pub fn dof(&self) -> usize {
        self.slow + self.circles[0].len()
    }
}

fn actions() -> impl Strategy<Value = (usize, Vec<Vec<i32>>)> {
    select(vec![
        (0, vec![vec![1]]),
        (1, vec![vec![1]]),
        (1, vec![vec![-2]]),
        (2, vec![vec![1]]),
        (1, vec![vec![1, 2]]),
        (0, vec![vec![1, 0], vec![0, 1]]),
        (1, vec![vec![1, 0], vec![1, 3]]),
    ])
}

pub fn cases() -> impl Strategy<Value = Case> {
    let scales = select(vec![0.1, 0.3, 1.0]);
    let epsilons = select(vec![0.0, 1e-6, 0.01, 0.1, -0.1]);
    let radii = select(vec![1.6, 1.6, 1e-6, 30.0]);
    let slow_maps = select(vec![SlowMap::Twists, SlowMap::TurnedTwists, SlowMap::Both]);
    (actions(), epsilons, scales, any::<bool>(), slow_maps, radii, any::<u64>()).prop_map(
        |((slow, circles), epsilon, scale, psi, slow_map, radius, seed)| Case {
            slow,
            circles,
            epsilon,
            scale,
            psi,
            slow_map,
            radius,
            seed,
        },
    )
}

/// The defects of normal forms are rounding and nothing else, whatever their T_ε is made of: the same weights at
/// single, double and double-double precision.
#[test]
fn the_ladder_is_that_of_rounding() {
    let mut worst = 0.0;
    for slow_map in [SlowMap::Twists, SlowMap::TurnedTwists, SlowMap::Both] {
        for seed in 0..4 * suite::times() as u64 {
            let seed = suite::seed() + seed;
            let (circles, epsilon) = (vec![vec![1]], 0.5);
            let (scale, radius) = (0.4, 1.6);
            let case = Case { slow: 1, circles, epsilon, scale, psi: true, slow_map, radius, seed };
            assert_eq!(case.dof(), precision::DOF);
            let network = case.network();
            let weights = precision::single(network.composition().parameters().iter().copied());
            let map = network.composition().with_parameters(weights, epsilon).expect("as many");
            for defect in precision::defects(&map, seed) {
                worst = max_or_nan(worst, defect);
            }
        }
    }
    assert!(worst <= tolerances::LADDER_THREE_RUNGS, "{worst}");
}

/// The laws on the first two of the points; that of evaluation on all.
fn measure(
    map: &dyn Measurable,
    form: &dyn NormalFormed,
    adjoint: &dyn Adjoint,
    points: &[f64],
    seed: u64,
) -> Vec<Tally> {
    let dof = map.dof();
    let two = &points[..4 * dof];
    let samples = Samples::new(two.to_vec(), vec![[0.7, -1.9], [3.0, 5.1]]);
    let mut out = vec![laws::symplecticity_of("symplecticity", map, two)];
    out.extend(measure_any(map, adjoint, points, dof, seed));
    out.extend(laws::integrable(form, &samples));
    out
}

/// D(N), the root mean square over orbits of the largest change of an action up to each
/// of the horizons, by `states` (orbits, 2n) that follow one another.
fn drifts(
    action: &TorusAction,
    start: &[f64],
    mut advance: impl FnMut(&[f64], usize) -> Vec<f64>,
) -> Vec<f64> {
    /// States that are looked at between two horizons.
    const LOOKS: usize = 100;
    let dim = 2 * action.dof();
    let invariants = |points: &[f64]| -> Vec<f64> {
        let of = |z| action.circles().iter().map(move |circle| circle.invariant::<f64>(z));
        points.chunks_exact(dim).flat_map(of).collect()
    };
    let initial = invariants(start);
    let mut largest = vec![0.0; initial.len()];
    let (mut point, mut done, mut out) = (start.to_vec(), 0, Vec::new());
    for horizon in HORIZONS {
        let steps = (horizon - done) / LOOKS;
        for _ in 0..LOOKS {
            point = advance(&point, steps);
            for ((largest, now), then) in largest.iter_mut().zip(invariants(&point)).zip(&initial) {
                *largest = max_or_nan(*largest, (now - then).abs());
            }
        }
        done = horizon;
        let squares: f64 = largest.iter().map(|d| d * d).sum();
        out.push((squares / largest.len() as f64).sqrt());
    }
    out
}

/// The exponent of the drift in N over networks at each ε, and the largest drift.
fn drift_rows(of: &dyn Fn(f64, u64) -> Vec<f64>, epsilons: &[f64]) -> Vec<Tally> {
    let equation = "D(N) ∝ Nᵃ up to N = 10⁶: a";
    let mut exponents =
        Tally::with_limit("drift of the actions", equation, tolerances::EXACT_DRIFT_EXPONENT);
    let equation = "D(10⁶), all ε";
    let mut sizes = Tally::with_limit("drift of the actions", equation, tolerances::EXACT_DRIFT);
    for &epsilon in epsilons {
        // The mean of the logarithms over networks: that of one random walk scatters.
        let mut logarithms = [0.0; HORIZONS.len()];
        for seed in 0..NETWORKS {
            let drifts = of(epsilon, seed);
            sizes.push(Conditioned::Ratio(drifts[drifts.len() - 1]));
            for (sum, drift) in logarithms.iter_mut().zip(drifts) {
                *sum += drift.ln() / NETWORKS as f64;
            }
        }
        let exponent = log_slope(&HORIZONS.map(|n| n as f64), &logarithms.map(f64::exp));
        exponents.push(Conditioned::Ratio(exponent.abs()));
    }
    vec![exponents, sizes]
}

fn study() -> Vec<Tally> {
    let of = |epsilon: f64, seed: u64| {
        let circles = vec![vec![1]];
        let (slow, scale, psi, radius) = (1, 0.5, true, 1.6);
        let slow_map = match seed.is_multiple_of(2) {
            true => SlowMap::Twists,
            false => SlowMap::TurnedTwists,
        };
        let case = Case { slow, circles, epsilon, scale, psi, slow_map, radius, seed };
        let network = case.network();
        let [_, inner] = network.chart_and_inner_map();
        let advance = |point: &[f64], steps: usize| {
            let request = Rollout { steps, every: steps };
            rollout(&inner, point, request).expect("whole points").split_off(point.len())
        };
        drifts(&network.action(), &points(seed, radius, case.dof(), 8), advance)
    };
    drift_rows(&of, &EPSILONS)
}

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| {
        let mut rows = suite::run("normal_form", STATED / 2, cases(), |case| {
            let network = case.network();
            let map = watched("normal_form", &network);
            let points = points(case.seed, case.radius, case.dof(), 11);
            measure(&map, &network, network.composition(), &points, case.seed)
        });
        rows.extend(study().iter().map(Tally::row));
        named(rows, NAME)
    })
}

#[test]
fn holds() {
    let stated = |row: &&Row| !row.law.starts_with("drift");
    let rows: Vec<Row> = rows().iter().filter(stated).cloned().collect();
    suite::assert_holds(&rows, STATED);
}

#[test]
fn drifts_are_those_of_rounding() {
    let drifts: Vec<&Row> = rows().iter().filter(|row| row.law.starts_with("drift")).collect();
    assert_eq!(drifts.len(), 2);
    for row in drifts {
        assert_eq!(row.verdict, Verdict::Holds, "{row:?}");
    }
}

/// Two twist shears and a turned one after their literal definition, of two neurons each, the first with a quadratic
/// form, in two degrees of freedom with a fast first plane, and a turn.
#[derive(Clone, Copy, Debug)]
struct LiteralTwist {
    fault: Fault,
    epsilon: f64,
    theta: f64,
}

/// a, b, c and w of the neurons of the shears.
const NEURONS: [[[f64; 4]; 2]; 3] = [
    [[0.7, -0.4, 0.3, 0.5], [-0.3, 0.9, -0.6, -0.4]],
    [[-0.5, 0.6, 0.2, 0.8], [0.4, 0.3, -0.7, 0.6]],
    [[0.3, -0.8, -0.4, 0.7], [0.6, 0.5, 0.1, -0.5]],
];

/// φ of the third shear.
const ANGLE: f64 = 0.8;

/// Q of the first shear: of 𝔍², 𝔍p and p².
const FORM: [f64; 3] = [0.3, -0.5, 0.6];

impl LiteralTwist {
    /// By three shears: a matrix of rounded entries would let the radius drift.
    fn turn<S: Elementary>(z: &mut [S], angle: S) {
        Self::turn_plane(z, 0, angle);
    }

    fn turn_plane<S: Elementary>(z: &mut [S], plane: usize, angle: S) {
        let (s, c) = angle.sin_cos();
        // Half a turn first, where the angle is nearer to it: t would grow beyond all bounds.
        let sign = c.sign();
        let s = s * sign;
        let t = s / (S::from_f64(1.0) + c * sign);
        z[plane] += t * z[2 + plane];
        z[2 + plane] -= s * z[plane];
        z[plane] += t * z[2 + plane];
        (z[plane], z[2 + plane]) = (z[plane] * sign, z[2 + plane] * sign);
    }

    /// The third shear, in turned coordinates of the slow plane.
    fn turned_shear<S: Elementary>(&self, z: &mut [S], sign: f64) {
        let (there, back) = (S::from_f64(ANGLE), S::from_f64(-ANGLE));
        Self::turn_plane(z, 1, there);
        self.shear(2, z, sign);
        match self.fault {
            Fault::TurnedTwistBack => Self::turn_plane(z, 1, back * S::from_f64(1.0 + 1e-9)),
            // The momentum stays as it was turned.
            Fault::TurnedTwistPosition => {
                let momentum = z[3];
                Self::turn_plane(z, 1, back);
                z[3] = momentum;
            }
            _ => Self::turn_plane(z, 1, back),
        }
    }

    fn shear<S: Elementary>(&self, number: usize, z: &mut [S], sign: f64) {
        let (half, scale) = (S::from_f64(0.5), S::from_f64(sign * self.epsilon));
        let (target, source, way) = if number == 0 { (1, 3, 1.0) } else { (3, 1, -1.0) };
        let action = match self.fault {
            Fault::TwistSeesPlane => z[0],
            _ => half * (z[0] * z[0] + z[2] * z[2]),
        };
        let (mut angle, mut move_by) = (S::zero(), S::zero());
        for [a, b, c, w] in NEURONS[number] {
            let argument = S::from_f64(a) * action + S::from_f64(b) * z[source] + S::from_f64(c);
            let (_, slope) = argument.tanh_sech2();
            angle += S::from_f64(w * a) * slope;
            move_by += S::from_f64(w * b * way) * slope;
        }
        if number == 0 {
            let [of_action, mixed, of_momentum] = FORM.map(S::from_f64);
            let skew = if self.fault == Fault::TwistSkewForm { 1e-9 } else { 0.0 };
            angle = angle + of_action * action + mixed * z[source];
            move_by = move_by + (mixed + S::from_f64(skew)) * action + of_momentum * z[source];
        }
        z[target] += scale * move_by;
        match self.fault {
            Fault::TwistWithoutTurn => {}
            Fault::TwistWeight => Self::turn(z, scale * S::from_f64(2.0) * angle),
            // The kick of a potential that sees the position of the fast plane.
            Fault::TwistSeesPlane => z[2] -= scale * angle,
            _ => Self::turn(z, scale * angle),
        }
    }
}

impl<S: Elementary> Map<S> for LiteralTwist {
    fn dof(&self) -> usize {
        2
    }
    fn forward(&self, z: &mut [S]) {
        self.shear(0, z, 1.0);
        self.shear(1, z, 1.0);
        self.turned_shear(z, 1.0);
        Self::turn(z, S::from_f64(self.theta));
        if self.fault == Fault::TwistFriction {
            z[2] *= S::from_f64(1.0 - 1e-12);
        }
    }
    fn inverse(&self, z: &mut [S]) {
        if self.fault == Fault::TwistFriction {
            z[2] /= S::from_f64(1.0 - 1e-12);
        }
        Self::turn(z, S::from_f64(-self.theta));
        self.turned_shear(z, -1.0);
        self.shear(1, z, -1.0);
        self.shear(0, z, -1.0);
    }
}

/// The literal twist between the chart of a network and its inverse.
struct Literal {
    fault: Fault,
    sound: Model,
    /// Of the broken chart.
    other: Model,
    inner: OneStep<LiteralTwist>,
}

impl Literal {
    fn new(fault: Fault) -> Self {
        let (slow, circles, epsilon, scale) = (1, vec![vec![1]], 0.1, 0.3);
        let slow_map = SlowMap::TurnedTwists;
        let case =
            Case { slow, circles, epsilon, scale, psi: true, slow_map, radius: 1.6, seed: 1 };
        let sound = case.network();
        // The fast plane comes first here.
        let action: TorusAction = CircleAction::new([1, 0]).into();
        let architecture = sound.architecture().clone().on_torus(&action);
        let of = |factor: f64| {
            let weights = sound.composition().parameters().iter().map(|w| factor * w).collect();
            Model::new(architecture.clone(), weights).expect("as many")
        };
        let inner = OneStep(LiteralTwist { fault, epsilon: 0.3, theta: 0.9 });
        Self { fault, other: of(1.0 + 1e-9), sound: of(1.0), inner }
    }
}

impl Map<f64> for Literal {
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

impl Measurable for Literal {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        let chart = match self.fault {
            Fault::OtherChart => &self.other,
            _ => &self.sound,
        };
        // Boxed steps borrow from what lives as long as the map.
        let chart = chart.composition();
        let steps = chart.measured_steps(Direction::Forward);
        let inner = self.inner.measured_steps(direction);
        let count = chart_steps(&self.sound);
        let mut out: MeasuredSteps<'_> = steps.into_iter().take(count).collect();
        out.extend(inner);
        let steps = chart.measured_steps(Direction::Forward);
        let behind = steps.len() - count;
        out.extend(steps.into_iter().skip(behind));
        out
    }
}

/// How many of the measured steps of a network are χ⁻¹, and how many χ.
fn chart_steps(network: &Model) -> usize {
    let [chart, _] = network.chart_and_inner_map();
    chart.measured_steps(Direction::Forward).len()
}

impl NormalFormed for Literal {
    fn chart(&self) -> Box<dyn Measurable + '_> {
        self.sound.chart()
    }
    fn inner_map(&self) -> Box<dyn Measurable + '_> {
        Box::new(self.inner)
    }
    fn action(&self) -> TorusAction {
        self.sound.action()
    }
}

/// All laws of normal forms on one with this fault.
pub fn rows_of_mutant(fault: Fault) -> Vec<Row> {
    let literal = Literal::new(fault);
    let composition = literal.sound.composition();
    let samples = points(1, 1.6, 2, 11);
    let layers = literal.sound.architecture().layers();
    let turned = layers.iter().find(|(block, ..)| block.name == "turned_twist");
    let angle = turned.expect("a turned twist").2.start;
    let broken = Broken::with_angle(fault, composition, angle);
    let mut tallies = measure(&literal, &literal, &broken, &samples, 1);
    tallies.extend(measure(&broken, &literal, &broken, &samples, 1));
    // Ten thousand times fewer steps would do for what drifts by 1e-12 a step.
    let of = |_: f64, seed: u64| {
        let advance = |point: &[f64], steps: usize| {
            let mut out = point.to_vec();
            for z in out.chunks_exact_mut(4) {
                (0..steps).for_each(|_| literal.inner.forward(z));
            }
            out
        };
        drifts(&literal.action(), &points(seed, 1.6, 2, 1), advance)
    };
    tallies.extend(drift_rows(&of, &[1.0]));
    named(merged(tallies).iter().map(Tally::row).collect(), NAME)
}

#[test]
fn a_sound_one_is_not_rejected() {
    // A fault that is none of a normal form.
    for row in rows_of_mutant(Fault::Friction) {
        assert_eq!(row.verdict, Verdict::Holds, "{row:?}");
    }
}

/// A turn as measures see it moves a point as the action does.
#[test]
fn turns_are_those_of_the_action() {
    let action = TorusAction::new([CircleAction::new([1, 0]), CircleAction::new([2, -1])]);
    let action = action.expect("two circles");
    let turn = action.turn_by(&[0.7, -2.0]);
    let (mut a, mut b) = ([0.3, -0.4, 0.5, 0.6], [0.3, -0.4, 0.5, 0.6]);
    turn.apply(&mut a, false);
    turn_steps(&turn, Direction::Forward).iter().for_each(|step| step.apply(&mut b));
    assert_eq!(a, b);
}
