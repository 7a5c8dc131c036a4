//! Error against run time.

use super::distance;
use crate::error::Error;
use crate::network::Composition;
use crate::phase::Map;
use crate::scalar::{DoubleDouble, Dual, Real, Scalar, max_or_nan};
use serde::{Deserialize, Serialize};
use std::hint::black_box;
use std::time::Instant;

/// Median and quartiles of repeated measurements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// The lower quartile.
    pub lower: f64,
    /// The median.
    pub median: f64,
    /// The upper quartile.
    pub upper: f64,
}

impl Spread {
    /// Of these measurements; None where there are none.
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let last = values.len().checked_sub(1)?;
        // Between two neighbours in proportion.
        let quantile = |share: f64| {
            let position = share * last as f64;
            let below = position as usize;
            let above = (below + 1).min(last);
            (values[above] - values[below]).mul_add(position - below as f64, values[below])
        };
        Some(Self { lower: quantile(0.25), median: quantile(0.5), upper: quantile(0.75) })
    }

    /// All three times a positive factor.
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            lower: self.lower * factor,
            median: self.median * factor,
            upper: self.upper * factor,
        }
    }
}

/// A way to a result, to be judged by its error and its run time.
pub struct Contestant<'a> {
    /// Its name; several with one name are points of one curve.
    pub name: String,
    /// What is varied along the curve, such as the number of steps.
    pub setting: Option<f64>,
    /// Computes the result.
    pub run: Box<dyn Fn() -> Result<Vec<f64>, Error> + Sync + 'a>,
}

/// What a contestant came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorkPrecision {
    /// The contestant's name.
    pub name: String,
    /// What is varied along the curve.
    pub setting: Option<f64>,
    /// The error; None where there is no result, or one that is not finite.
    pub error: Option<f64>,
    /// Seconds for a unit of work; None where there is no result.
    pub seconds: Option<Spread>,
    /// Why there is no result.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
}

/// Measurements shorter than this are of several runs.
const LEAST_SECONDS: f64 = 1e-3;
/// After so many seconds a contestant is not run more often than
/// [`FEWEST_ROUNDS`].
const MOST_SECONDS: f64 = 2.0;
const FEWEST_ROUNDS: usize = 3;

/// The error and the run time of each contestant, on one thread.
///
/// `error` judges a result. The contestants are timed in turn, `rounds` times
/// around, so that a busy moment of the machine meets them all; each result is of
/// `units` units of work. The errors depend on the contestants alone, the times on
/// the machine.
///
/// # Errors
/// When `rounds` is 0 or no thread can be started. A contestant that fails has no
/// error and no time.
pub fn work_precision(
    contestants: &[Contestant<'_>],
    error: &(dyn Fn(&[f64]) -> f64 + Sync),
    units: f64,
    rounds: usize,
) -> Result<Vec<WorkPrecision>, Error> {
    Error::check_count_range("rounds", rounds, 1, usize::MAX)?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .map_err(|reason| Error::invalid("threads", 1, reason))?;
    pool.install(|| {
        let mut trials: Vec<Trial> = contestants
            .iter()
            .map(|contestant| {
                let (error, failure) = match (contestant.run)() {
                    Err(reason) => (None, Some(reason.to_string())),
                    Ok(result) => match error(&result) {
                        error if error.is_finite() => (Some(error), None),
                        error => (None, Some(format!("its error is {error}"))),
                    },
                };
                let runs = error.map_or(0, |_| runs(contestant));
                Trial { error, failure, runs, seconds: Vec::new() }
            })
            .collect();
        for round in 0..rounds {
            for (contestant, trial) in contestants.iter().zip(&mut trials) {
                let spent = trial.seconds.iter().sum::<f64>() * trial.runs as f64;
                if trial.runs == 0 || (round >= FEWEST_ROUNDS && spent > MOST_SECONDS) {
                    continue;
                }
                trial.seconds.push(seconds(contestant, trial.runs));
            }
        }
        let judged = contestants.iter().zip(trials).map(|(contestant, trial)| WorkPrecision {
            name: contestant.name.clone(),
            setting: contestant.setting,
            error: trial.error,
            failure: trial.failure,
            seconds: Spread::of(trial.seconds).map(|spread| spread.scaled(1.0 / units)),
        });
        Ok(judged.collect())
    })
}

struct Trial {
    error: Option<f64>,
    failure: Option<String>,
    /// Runs of one measurement; 0 where there is nothing to measure.
    runs: usize,
    seconds: Vec<f64>,
}

/// Seconds a run, of so many.
fn seconds(contestant: &Contestant<'_>, runs: usize) -> f64 {
    let start = Instant::now();
    for _ in 0..runs {
        let _ = black_box((contestant.run)());
    }
    start.elapsed().as_secs_f64() / runs as f64
}

/// How many runs one measurement takes.
fn runs(contestant: &Contestant<'_>) -> usize {
    let mut runs = 1;
    loop {
        let taken = seconds(contestant, runs) * runs as f64;
        if taken >= LEAST_SECONDS || runs >= 1 << 20 {
            return runs;
        }
        runs *= 2;
    }
}

/// √(mean |row − row of the reference|²) over rows of `dim` numbers; NaN when a
/// number is, or the two are not of the same whole number of rows.
pub fn root_mean_square_distance(rows: &[f64], reference: &[f64], dim: usize) -> f64 {
    let whole = dim > 0 && rows.len().is_multiple_of(dim) && !rows.is_empty();
    if rows.len() != reference.len() || !whole {
        return f64::NAN;
    }
    let squares = rows
        .chunks_exact(dim)
        .zip(reference.chunks_exact(dim))
        .map(|(a, b)| distance(a, b).powi(2))
        .sum::<f64>();
    (squares / (rows.len() / dim) as f64).sqrt()
}

/// The Jacobians at points of 2n numbers in double-double precision, rounded: what
/// double precision is judged by. 2n × 2n numbers a point, row by row, as by
/// [`map_jacobians`](crate::network::map_jacobians).
///
/// # Panics
/// When `points` is not a whole number of points.
pub fn precise_jacobians(map: &Composition<f64>, points: &[f64]) -> Vec<f64> {
    let dim = 2 * map.dof();
    assert!(points.len().is_multiple_of(dim));
    let mut out = vec![0.0; points.len() * dim];
    for (point, jacobian) in points.chunks_exact(dim).zip(out.chunks_exact_mut(dim * dim)) {
        for column in 0..dim {
            let mut z: Vec<Dual<DoubleDouble, 1>> = point
                .iter()
                .enumerate()
                .map(|(i, &v)| {
                    let direction = if i == column { 0 } else { 1 };
                    Dual::variable(DoubleDouble::from_f64(v), direction)
                })
                .collect();
            map.forward(&mut z);
            for (row, value) in z.iter().enumerate() {
                jacobian[row * dim + column] = value.eps[0].value();
            }
        }
    }
    out
}

/// The largest |J − reference| over the largest |reference|, entries of all
/// points.
pub fn relative_difference(values: &[f64], reference: &[f64]) -> f64 {
    if values.len() != reference.len() {
        return f64::NAN;
    }
    let difference = values.iter().zip(reference).map(|(a, b)| (a - b).abs());
    let size = reference.iter().map(|v| v.abs()).fold(0.0, max_or_nan);
    difference.fold(0.0, max_or_nan) / size
}

/// The largest error of tanh in units in the last place, and of sech² relative to
/// it, of values `t` and `s` at the points x, against double-double precision; NaN
/// when the three are not of one length.
pub fn tanh_errors(x: &[f64], t: &[f64], s: &[f64]) -> (f64, f64) {
    if t.len() != x.len() || s.len() != x.len() {
        return (f64::NAN, f64::NAN);
    }
    let (mut ulps, mut relative) = (0.0, 0.0);
    for ((&x, &t), &s) in x.iter().zip(t).zip(s) {
        let (exact_t, exact_s) = DoubleDouble::from_f64(x).tanh_sech2();
        let size = exact_t.value().abs();
        let ulp = f64::from_bits(size.to_bits().max(1)) - f64::from_bits(size.to_bits().max(1) - 1);
        ulps = max_or_nan(ulps, (DoubleDouble::from_f64(t) - exact_t).value().abs() / ulp);
        let difference = (DoubleDouble::from_f64(s) - exact_s).value().abs();
        relative = max_or_nan(relative, difference / exact_s.value());
    }
    (ulps, relative)
}
