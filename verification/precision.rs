//! One code with one set of weights at single, double and double-double precision: a
//! defect that comes from rounding shrinks with the unit roundoff, any other
//! is a bug.

use crate::{suite, tolerances};
use faer::Mat;
use gyroceptron::measure::ratios::{symplecticity_defect, symplecticity_scale};
use gyroceptron::measure::{
    Measurable,
    certificate::{Row, Tally},
    ratios::{Conditioned, RoundingPropagation},
};
use gyroceptron::network::{Composition, HenonShape, InitialWeights, Model};
use gyroceptron::phase::{Direction, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{DoubleDouble, Dual, Over, Real, Scalar, max_or_nan};
use std::fmt::Write;
use std::sync::OnceLock;

const SEEDS: u64 = 24;
/// Two slopes a network.
pub const STATED: usize = 2 * SEEDS as usize;
pub const DOF: usize = 2;
const POINTS: usize = 20;

/// Residual/(u·scale) of both laws at each level.
#[derive(Clone, Copy)]
struct Ratios {
    symplecticity: [f64; 3],
    inversion: [f64; 3],
}

pub struct Ladder {
    seeds: Vec<Ratios>,
}

const ROUNDOFFS: fn() -> [f64; 3] =
    || [f32::unit_roundoff(), f64::unit_roundoff(), DoubleDouble::unit_roundoff()];

/// Weights and points that single precision holds.
pub fn single(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    values.into_iter().map(|v| f64::from(v as f32)).collect()
}

fn network(seed: u64) -> Model {
    let shape = HenonShape::uniform(DOF, 3, 6);
    let mut stream = Stream::new(seed, "ladder weights");
    let weights = InitialWeights::Normal { scale: 0.6 };
    let parameters =
        shape.widths.iter().flat_map(|&h| weights.layer(DOF, h, &mut stream)).collect::<Vec<_>>();
    Model::at_epsilon(shape.architecture(1.0), 1.0, single(parameters)).expect("as many parameters")
}

fn points(seed: u64) -> Vec<f64> {
    let mut stream = Stream::new(seed, "ladder points");
    single((0..POINTS * 2 * DOF).map(|_| stream.uniform(-1.6, 1.6)))
}

/// The root mean square of |R|/T over entries and points, R formed in the
/// arithmetic of the level.
fn symplecticity<S: Over<f64> + Real>(map: &Composition<f64>, points: &[f64]) -> f64 {
    let steps = map.measured_steps(Direction::Forward);
    let (mut sum, mut count) = (0.0, 0);
    for z in points.chunks_exact(2 * DOF) {
        let mut w: Vec<Dual<S, 4>> =
            z.iter().enumerate().map(|(i, &v)| Dual::variable(S::from_f64(v), i)).collect();
        map.forward(&mut w);
        let jacobian = Mat::from_fn(2 * DOF, 2 * DOF, |row, column| w[row].eps[column]);
        let scale = symplecticity_scale(&RoundingPropagation::new(&steps, z));
        let defect = symplecticity_defect(jacobian.as_ref());
        for row in 0..2 * DOF {
            for column in 0..2 * DOF {
                let ratio = Real::value(defect[(row, column)]) / scale[(row, column)];
                sum += ratio * ratio;
                count += 1;
            }
        }
    }
    (sum / f64::from(count)).sqrt()
}

/// The root mean square of |Q(P(z)) − z| over its rounding scale.
fn inversion<S: Over<f64> + Real>(
    map: &Composition<f64>,
    back: &Composition<f64>,
    points: &[f64],
) -> f64 {
    let mut steps = map.measured_steps(Direction::Forward);
    steps.extend(back.measured_steps(Direction::Inverse));
    let (mut sum, mut count) = (0.0, 0);
    for z in points.chunks_exact(2 * DOF) {
        let mut w: Vec<S> = z.iter().map(|&v| S::from_f64(v)).collect();
        map.forward(&mut w);
        back.inverse(&mut w);
        let (scales, _) = RoundingPropagation::new(&steps, z).value_scales();
        for ((moved, start), scale) in w.iter().zip(z).zip(scales) {
            let ratio = (*moved - S::from_f64(*start)).value() / scale;
            sum += ratio * ratio;
            count += 1;
        }
    }
    (sum / f64::from(count)).sqrt()
}

fn ratios(seed: u64) -> Ratios {
    ratios_of(network(seed).composition(), &points(seed))
}

/// |slope − 1| of both laws over all levels, for a map of two degrees of freedom whose
/// parameters, and the points, single precision holds.
pub fn defects(map: &Composition<f64>, seed: u64) -> [f64; 2] {
    let ratios = ratios_of(map, &points(seed));
    [ratios.symplecticity, ratios.inversion].map(|r| (over_all(r) - 1.0).abs())
}

/// The second of [`defects`], of a map that is not symplectic.
pub fn inversion_defect(map: &Composition<f64>, seed: u64) -> f64 {
    (over_all(inversions_of(map, &points(seed))) - 1.0).abs()
}

fn ratios_of(map: &Composition<f64>, points: &[f64]) -> Ratios {
    let residuals = [
        symplecticity::<f32>(map, points),
        symplecticity::<f64>(map, points),
        symplecticity::<DoubleDouble>(map, points),
    ];
    Ratios { symplecticity: over_roundoffs(residuals), inversion: inversions_of(map, points) }
}

fn inversions_of(map: &Composition<f64>, points: &[f64]) -> [f64; 3] {
    over_roundoffs([
        inversion::<f32>(map, map, points),
        inversion::<f64>(map, map, points),
        inversion::<DoubleDouble>(map, map, points),
    ])
}

fn over_roundoffs(residuals: [f64; 3]) -> [f64; 3] {
    let u = ROUNDOFFS();
    [0, 1, 2].map(|level| residuals[level] / u[level])
}

/// Slope of log residual in log u between two levels.
fn between(ratios: [f64; 3], a: usize, b: usize) -> f64 {
    let u = ROUNDOFFS();
    1.0 + libm::log(ratios[a] / ratios[b]) / libm::log(u[a] / u[b])
}

/// The least-squares slope over all levels.
fn over_all(ratios: [f64; 3]) -> f64 {
    let u = ROUNDOFFS();
    let residuals: Vec<f64> = (0..3).map(|k| ratios[k] * u[k]).collect();
    gyroceptron::measure::adiabatic::log_slope(&u, &residuals)
}

pub fn ladder() -> &'static Ladder {
    static LADDER: OnceLock<Ladder> = OnceLock::new();
    LADDER.get_or_init(|| {
        let count = SEEDS * suite::times() as u64;
        Ladder { seeds: (0..count).map(|k| ratios(suite::seed() + k)).collect() }
    })
}

impl Ladder {
    fn all(&self) -> impl Iterator<Item = [f64; 3]> {
        self.seeds.iter().flat_map(|r| [r.symplecticity, r.inversion])
    }
    pub fn worst_two_rungs(&self) -> f64 {
        self.all()
            .flat_map(|r| [between(r, 0, 1), between(r, 1, 2)])
            .fold(0.0, |worst, slope| max_or_nan(worst, (slope - 1.0).abs()))
    }
    pub fn worst_three_rungs(&self) -> f64 {
        self.all().fold(0.0, |worst, r| max_or_nan(worst, (over_all(r) - 1.0).abs()))
    }
    fn median_slope(&self, of: fn(&Ratios) -> [f64; 3]) -> f64 {
        let medians = [0, 1, 2].map(|level| {
            let mut values: Vec<f64> = self.seeds.iter().map(|r| of(r)[level]).collect();
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        });
        over_all(medians)
    }
    pub fn median_defect(&self) -> f64 {
        let slopes = [self.median_slope(|r| r.symplecticity), self.median_slope(|r| r.inversion)];
        slopes.iter().fold(0.0, |worst, s| max_or_nan(worst, (s - 1.0).abs()))
    }
}

const LAW: (&str, &str) = ("precision ladder", "log residual ∝ log u, slope − 1");

fn row(values: impl Iterator<Item = f64>) -> Row {
    Tally::with_limit(LAW.0, LAW.1, tolerances::LADDER_THREE_RUNGS)
        .extend(values.map(Conditioned::Ratio))
        .row()
}

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| vec![row(ladder().all().map(|r| (over_all(r) - 1.0).abs()))])
}

/// Residuals of a network whose inverse has its weights wrong by `error`,
/// relative, which double-double alone can see below 1e-16.
fn wrong_by(error: f64) -> [f64; 3] {
    let network = network(suite::SEED);
    let (map, points) = (network.composition(), points(suite::SEED));
    let factor = DoubleDouble::new(1.0, error);
    let exact: Vec<DoubleDouble> =
        map.parameters().iter().map(|&v| DoubleDouble::from_f64(v) * factor).collect();
    let rounded = |values: &[DoubleDouble]| values.iter().map(|v| v.value()).collect::<Vec<_>>();
    let double = network.with_parameters(rounded(&exact)).expect("as many parameters");
    let back = double.composition();
    let u = ROUNDOFFS();
    let long =
        Model::at_epsilon(network.architecture().clone(), DoubleDouble::from_f64(1.0), exact)
            .expect("as many parameters");
    let mut steps = map.measured_steps(Direction::Forward);
    steps.extend(map.measured_steps(Direction::Inverse));
    let residual = |z: &[f64]| {
        let mut w: Vec<DoubleDouble> = z.iter().map(|&v| DoubleDouble::from_f64(v)).collect();
        map.forward(&mut w);
        long.composition().inverse(&mut w);
        let (scales, _) = RoundingPropagation::new(&steps, z).value_scales();
        let ratio = |i: usize| (w[i] - DoubleDouble::from_f64(z[i])).value() / scales[i];
        (0..z.len()).map(|i| ratio(i) * ratio(i)).sum::<f64>()
    };
    let sum: f64 = points.chunks_exact(2 * DOF).map(residual).sum();
    [
        inversion::<f32>(map, back, &points) / u[0],
        inversion::<f64>(map, back, &points) / u[1],
        (sum / points.len() as f64).sqrt() / u[2],
    ]
}

/// |slope − 1| over two levels, for the weights of the inverse wrong by `error`.
pub fn two_rungs_of_mutant(error: f64) -> f64 {
    (between(wrong_by(error), 1, 2) - 1.0).abs()
}

/// |slope − 1| over all levels, for the weights of the inverse wrong by `error`.
pub fn three_rungs_of_mutant(error: f64) -> f64 {
    (over_all(wrong_by(error)) - 1.0).abs()
}

/// An inverse whose weights are right to 1e-12, at every precision.
pub fn rows_of_mutant() -> Vec<Row> {
    vec![row([three_rungs_of_mutant(1e-12)].into_iter())]
}

#[test]
fn slopes_are_one() {
    let ladder = ladder();
    let (two, three) = (ladder.worst_two_rungs(), ladder.worst_three_rungs());
    assert!(two <= tolerances::LADDER_TWO_RUNGS, "{two}");
    assert!(three <= tolerances::LADDER_THREE_RUNGS, "{three}");
    let median = ladder.median_defect();
    assert!(median <= tolerances::LADDER_MEDIAN, "{median}");
    assert!(ladder.seeds.len() >= 20);
}

#[test]
fn the_ladder_is_as_cited() {
    if suite::seed() != suite::SEED || suite::extensive() {
        return;
    }
    let ladder = ladder();
    let mut text = format!(
        "{SEEDS} HénonNets 3×6, two degrees of freedom, normal weights 0.6, {POINTS} points each, \
         seeds {} …\nresidual/(u·scale), root mean square, at f32, f64 and double-double\n\n\
         seed  symplecticity                       slope    inversion                           slope\n",
        suite::SEED,
    );
    let figures = |r: [f64; 3]| r.map(|v| format!("{v:.3e}")).join("  ");
    for (index, r) in ladder.seeds.iter().enumerate() {
        writeln!(
            text,
            "{index:<5} {:<35} {:.4}   {:<35} {:.4}",
            figures(r.symplecticity),
            over_all(r.symplecticity),
            figures(r.inversion),
            over_all(r.inversion)
        )
        .expect("memory");
    }
    writeln!(
        text,
        "\nslopes of the medians: symplecticity {:.4}, inversion {:.4}; worst over two levels {:.4}, \
         over three {:.4}",
        ladder.median_slope(|r| r.symplecticity),
        ladder.median_slope(|r| r.inversion),
        1.0 + ladder.worst_two_rungs(),
        1.0 + ladder.worst_three_rungs(),
    )
    .expect("memory");
    insta::assert_snapshot!("precision_ladder", text);
}
