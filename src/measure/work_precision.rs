//! Error against run time.

use super::accuracy::distance;
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
    /// The lower quartile of the values.
    pub lower: f64,
    /// The median of the values.
    pub median: f64,
    /// The upper quartile of the values.
    pub upper: f64,
}

impl Spread {
    /// The median and quartiles of these values; None where there are none.
    pub fn from_values(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let last = values.len().checked_sub(1)?;
        // Between two neighbours in proportion.
        let quantile = |share: f64| {
            let position = share * last as f64;
            let below = position as usize;
            let above = (below + 1).min(last);
            if position == below as f64 {
                return values[below];
            }
            (values[above] - values[below]).mul_add(position - below as f64, values[below])
        };
        Some(Self { lower: quantile(0.25), median: quantile(0.5), upper: quantile(0.75) })
    }

    /// All three values multiplied by a positive factor.
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            lower: self.lower * factor,
            median: self.median * factor,
            upper: self.upper * factor,
        }
    }
}

/// A computation that gives a result.
pub type Run<'a> = Box<dyn Fn() -> Result<Vec<f64>, Error> + Sync + 'a>;

/// A method that computes a result, to be judged by its error and its run time.
pub struct Method<'a> {
    /// Its name; methods of the same name are points of one curve.
    pub name: String,
    /// What is varied along the curve, such as the number of steps.
    pub setting: Option<f64>,
    /// The function that is timed; it computes the result.
    pub run: Run<'a>,
    /// Computes a part of the result without sharing vector lanes, with its units of work.
    pub alone: Option<(Run<'a>, f64)>,
}

impl<'a> Method<'a> {
    /// A method by what it computes.
    pub fn new(
        name: impl Into<String>,
        setting: Option<f64>,
        run: impl Fn() -> Result<Vec<f64>, Error> + Sync + 'a,
    ) -> Self {
        Self { name: name.into(), setting, run: Box::new(run), alone: None }
    }

    /// Adds a run of `units` units of work that share no vector lanes; it is timed too, but its error is not judged.
    pub fn beside_alone(
        self,
        units: f64,
        run: impl Fn() -> Result<Vec<f64>, Error> + Sync + 'a,
    ) -> Self {
        Self { alone: Some((Box::new(run), units)), ..self }
    }
}

/// The error and the run time of a method.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorkPrecision {
    /// The name of the method in tables.
    pub name: String,
    /// What is varied along the curve.
    pub setting: Option<f64>,
    /// The error; None where there is no result, or one that is not finite.
    pub error: Option<f64>,
    /// Seconds for a unit of work; None where there is no result.
    pub seconds: Option<Spread>,
    /// Seconds for a unit of work that shares no vector lanes; None where it is not timed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alone: Option<Spread>,
    /// Why the method has no result; None where it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
}

impl WorkPrecision {
    /// A copy without the run times: the part that does not depend on the machine.
    pub fn without_seconds(&self) -> Self {
        Self { seconds: None, alone: None, ..self.clone() }
    }
}

/// Measurements shorter than this are of several runs.
const LEAST_SECONDS: f64 = 1e-3;
/// Before a measurement that is shorter than so many seconds there is a run that is not timed: else the time that the
/// caches take to fill would be a part of it.
const SHORT: f64 = 0.1;
/// A measurement is of no more runs than this.
const MOST_RUNS: usize = 1 << 20;
/// After so many seconds a method is not run more often than [`FEWEST_ROUNDS`].
const MOST_SECONDS: f64 = 2.0;
const FEWEST_ROUNDS: usize = 3;

/// Measures the error and the run time of each method, on one thread.
///
/// `error` judges a result. The methods are timed in turn, `rounds` times around, so
/// that a busy moment of the machine affects all of them; each result takes `units` units
/// of work. The errors depend on the methods alone, the times on the machine.
///
/// Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, II.10,
/// <https://doi.org/10.1007/978-3-540-78862-1>, for diagrams of error against work.
///
/// # Errors
/// When `rounds` is 0 or no thread can be started. A method that fails has no error
/// and no time.
pub fn work_precision(
    methods: &[Method<'_>],
    error: &(dyn Fn(&[f64]) -> f64 + Sync),
    units: f64,
    rounds: usize,
) -> Result<Vec<WorkPrecision>, Error> {
    let start = Instant::now();
    work_precision_by(&|| start.elapsed().as_secs_f64(), methods, error, units, rounds)
}

/// [`work_precision`] with another clock: `clock` returns the seconds since a fixed moment.
///
/// # Errors
/// Those of [`work_precision`].
pub fn work_precision_by(
    clock: &(dyn Fn() -> f64 + Sync),
    methods: &[Method<'_>],
    error: &(dyn Fn(&[f64]) -> f64 + Sync),
    units: f64,
    rounds: usize,
) -> Result<Vec<WorkPrecision>, Error> {
    Error::check_count_range("rounds", rounds, 1, usize::MAX)?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .map_err(|reason| Error::invalid("threads", 1, reason))?;
    let seconds = |run: &Run<'_>, runs: usize| {
        let start = clock();
        for _ in 0..runs {
            let _ = black_box(run());
        }
        (clock() - start) / runs as f64
    };
    let begun = |run: &Run<'_>| {
        let (mut runs, mut one) = (1, seconds(run, 1));
        while one * (runs as f64) < LEAST_SECONDS && runs < MOST_RUNS {
            runs *= 2;
            one = seconds(run, runs);
        }
        Timed { runs, is_short: one * (runs as f64) < SHORT, seconds: Vec::new() }
    };
    pool.install(|| {
        let mut trials: Vec<Trial> = methods
            .iter()
            .map(|method| {
                let (error, failure) = match (method.run)() {
                    Err(reason) => (None, Some(reason.to_string())),
                    Ok(result) => match error(&result) {
                        error if error.is_finite() => (Some(error), None),
                        error => (None, Some(format!("its error is {error}"))),
                    },
                };
                let timed = |run: Option<&Run<'_>>| match error.and(run) {
                    Some(run) => begun(run),
                    None => Timed { runs: 0, is_short: false, seconds: Vec::new() },
                };
                let together = timed(Some(&method.run));
                let alone = timed(method.alone.as_ref().map(|(run, _)| run));
                Trial { error, failure, together, alone }
            })
            .collect();
        for round in 0..rounds {
            for (method, trial) in methods.iter().zip(&mut trials) {
                let alone = method.alone.as_ref().map(|(run, _)| run);
                let both = [(Some(&method.run), &mut trial.together), (alone, &mut trial.alone)];
                for (run, timed) in both {
                    let Some(run) = run else { continue };
                    let spent = timed.seconds.iter().sum::<f64>() * timed.runs as f64;
                    if timed.runs > 0 && (round < FEWEST_ROUNDS || spent <= MOST_SECONDS) {
                        // What ran before has left its own numbers and code in the caches.
                        if timed.is_short {
                            let _ = black_box(run());
                        }
                        timed.seconds.push(seconds(run, timed.runs));
                    }
                }
            }
        }
        let judged = methods.iter().zip(trials).map(|(method, trial)| WorkPrecision {
            name: method.name.clone(),
            setting: method.setting,
            error: trial.error,
            failure: trial.failure,
            seconds: trial.together.for_a_unit(units),
            alone: method.alone.as_ref().and_then(|(_, units)| trial.alone.for_a_unit(*units)),
        });
        Ok(judged.collect())
    })
}

struct Trial {
    error: Option<f64>,
    failure: Option<String>,
    together: Timed,
    alone: Timed,
}

struct Timed {
    /// Runs of one measurement; 0 where there is nothing to measure.
    runs: usize,
    /// Whether a measurement is shorter than [`SHORT`].
    is_short: bool,
    seconds: Vec<f64>,
}

impl Timed {
    fn for_a_unit(self, units: f64) -> Option<Spread> {
        Spread::from_values(self.seconds).map(|spread| spread.scaled(1.0 / units))
    }
}

/// The run time that a curve of methods of one name needs to reach an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtError<'a> {
    /// The point of the curve used, whose error is no larger than the one asked for.
    pub method: &'a WorkPrecision,
    /// Median seconds for a unit of work.
    pub seconds: f64,
    /// The seconds of one trajectory alone, which shares no vector lanes; None where that is not timed.
    pub alone: Option<f64>,
}

impl<'a> AtError<'a> {
    /// The shortest time in which the curve of `name` reaches an error of at most `error`: that of a setting that
    /// does, or of a point between a setting that does and a neighbour that does not, with log t interpolated
    /// linearly in log error. None where no setting reaches the error.
    ///
    /// Interpolation stands for the settings between those tried, so the fastest curve depends little on the choice of
    /// settings. `judged` may hold other curves; methods without a setting have no curve.
    pub fn of_curve(
        judged: impl IntoIterator<Item = &'a WorkPrecision>,
        name: &str,
        error: f64,
    ) -> Option<Self> {
        let times = |one: &WorkPrecision| {
            Some([one.seconds?.median, one.alone.map_or(f64::NAN, |spread| spread.median)])
        };
        let mut curve: Vec<(f64, f64, [f64; 2], &WorkPrecision)> = judged
            .into_iter()
            .filter(|one| one.name == name)
            .filter_map(|one| Some((one.setting?, one.error?, times(one)?, one)))
            .collect();
        curve.sort_by(|a, b| a.0.total_cmp(&b.0));
        let enough = curve.iter().filter(|point| point.1 <= error);
        let settings = enough.map(|&(_, _, times, method)| (times, method));
        let between = curve.windows(2).filter_map(|pair| {
            let [one, other] = [pair[0], pair[1]];
            let (worse, better) = if one.1 > other.1 { (one, other) } else { (other, one) };
            if !(worse.1 > error && better.1 <= error && better.1 > 0.0 && error > 0.0) {
                return None;
            }
            let share = libm::log(worse.1 / error) / libm::log(worse.1 / better.1);
            let at = |k: usize| worse.2[k] * libm::pow(better.2[k] / worse.2[k], share);
            Some(([at(0), at(1)], better.3))
        });
        settings.chain(between).min_by(|a, b| a.0[0].total_cmp(&b.0[0])).map(
            |([seconds, alone], method)| Self {
                method,
                seconds,
                alone: alone.is_finite().then_some(alone),
            },
        )
    }

    /// The curve that reaches an error fastest, among the methods with settings.
    pub fn fastest(judged: &'a [WorkPrecision], error: f64) -> Option<Self> {
        let names = judged.iter().enumerate().filter(|(number, one)| {
            let earlier = judged[..*number].iter().any(|other| other.name == one.name);
            one.setting.is_some() && !earlier
        });
        names
            .filter_map(|(_, one)| Self::of_curve(judged, &one.name, error))
            .min_by(|a, b| a.seconds.total_cmp(&b.seconds))
    }
}

/// The fastest method with an error of at most `error`, and its median time in seconds.
pub fn fastest<'a>(
    judged: impl IntoIterator<Item = &'a WorkPrecision>,
    error: f64,
) -> Option<(&'a WorkPrecision, f64)> {
    judged
        .into_iter()
        .filter(|entry| entry.error.is_some_and(|e| e <= error))
        .filter_map(|entry| Some((entry, entry.seconds?.median)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

/// The number of steps after which an initial cost of `paid` seconds (such as training) is recovered, where a step
/// takes `own` seconds instead of `rival` seconds. None where it takes no less.
pub fn break_even(paid: f64, own: f64, rival: f64) -> Option<f64> {
    let gained = rival - own;
    (gained > 0.0 && paid >= 0.0).then(|| (paid / gained).ceil())
}

/// The method with the smallest error.
pub fn most_accurate<'a>(
    judged: impl IntoIterator<Item = &'a WorkPrecision>,
) -> Option<&'a WorkPrecision> {
    let errors = judged.into_iter().filter_map(|entry| Some((entry, entry.error?)));
    errors.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(entry, _)| entry)
}

/// Methods that compute the same trajectories, to be judged against a reference.
pub struct TrajectoryMethods<'a> {
    /// The methods that are compared. The result of each is the states at each time: all trajectories, repeated
    /// `copies` times.
    pub methods: Vec<Method<'a>>,
    /// The states that each should give, 2n numbers a state: (times, trajectories, 2n).
    pub reference: &'a [f64],
    /// The error of the reference.
    pub reference_error: f64,
    /// The number 2n of coordinates of a state.
    pub dim: usize,
    /// The number of different trajectories.
    pub trajectories: usize,
    /// How often a method repeats the set of trajectories: see [`TrajectoryMethods::copies_of`].
    pub copies: usize,
    /// The time that the orbits are followed for.
    pub time: f64,
}

impl TrajectoryMethods<'_> {
    /// The least number of trajectories that are timed together, which keeps all lanes of several vectors busy.
    pub const LEAST: usize = 64;

    /// The number of copies that make at least [`TrajectoryMethods::LEAST`] of so many trajectories.
    pub fn copies_of(trajectories: usize) -> usize {
        Self::LEAST.div_ceil(trajectories.max(1))
    }

    /// Judges the methods by the root mean square distance from the reference, and
    /// by seconds for a trajectory and unit time.
    ///
    /// # Errors
    /// Those of [`work_precision`].
    pub fn compare(&self, rounds: usize) -> Result<Comparison, Error> {
        let &Self { reference, dim, trajectories, copies, time, reference_error, .. } = self;
        let row = dim * trajectories;
        let judge = |states: &[f64]| {
            let once =
                states.chunks((row * copies).max(1)).flat_map(|all| &all[..row.min(all.len())]);
            root_mean_square_distance(&once.copied().collect::<Vec<_>>(), reference, dim)
        };
        let units = (trajectories * copies) as f64 * time;
        let methods = work_precision(&self.methods, &judge, units, rounds)?;
        let origin = vec![0.0; reference.len()];
        let size = root_mean_square_distance(reference, &origin, dim);
        let together = trajectories * copies;
        Ok(Comparison { trajectories, together, time, size, reference_error, methods })
    }
}

/// A comparison of methods that give the same trajectories.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// The number of trajectories whose errors are judged.
    pub trajectories: usize,
    /// How many trajectories are timed together.
    pub together: usize,
    /// The time that the orbits are followed for.
    pub time: f64,
    /// The root mean square of |z| along them.
    pub size: f64,
    /// The error of the reference that they are judged by.
    pub reference_error: f64,
    /// Each method, seconds for a trajectory and unit time.
    pub methods: Vec<WorkPrecision>,
}

/// The fastest method for errors of at most 10^`from` down to 10^`to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FastestWithin<'a> {
    /// The largest power of ten.
    pub from: i32,
    /// The smallest power of ten.
    pub to: i32,
    /// The name of the method.
    pub name: &'a str,
    /// Its median time in seconds at both ends, [interpolated](AtError::of_curve) where it has settings.
    pub seconds: [f64; 2],
}

impl Comparison {
    /// A copy without the run times: the part that does not depend on the machine.
    pub fn without_seconds(&self) -> Self {
        let methods = self.methods.iter().map(WorkPrecision::without_seconds).collect();
        Self { methods, ..*self }
    }

    /// Half the size of the points: a method with a larger error has lost the
    /// trajectories, and there is nothing to compare.
    pub fn lost(&self) -> f64 {
        0.5 * self.size
    }

    /// The fastest method for each power of ten of the error, from 1 down to the
    /// smallest that a method reaches and the reference can resolve. Methods that
    /// have lost the trajectories do not count.
    pub fn fastest_by_error(&self) -> Vec<FastestWithin<'_>> {
        const SMALLEST: i32 = -15;
        let mut out: Vec<FastestWithin<'_>> = Vec::new();
        for exponent in (SMALLEST..=0).rev() {
            let error = libm::exp10(exponent.into());
            if !(error >= self.reference_error) {
                break;
            }
            let error = if error < self.lost() { error } else { self.lost() };
            let curve = AtError::fastest(&self.methods, error);
            let single = fastest(self.methods.iter().filter(|one| one.setting.is_none()), error);
            let best = [curve.map(|at| (&at.method.name[..], at.seconds))]
                .into_iter()
                .chain([single.map(|(one, seconds)| (&one.name[..], seconds))])
                .flatten()
                .min_by(|a, b| a.1.total_cmp(&b.1));
            let Some((name, seconds)) = best else { break };
            match out.last_mut() {
                Some(last) if last.name == name => {
                    (last.to, last.seconds[1]) = (exponent, seconds);
                }
                _ => out.push(FastestWithin {
                    from: exponent,
                    to: exponent,
                    name,
                    seconds: [seconds; 2],
                }),
            }
        }
        out
    }
}

/// √(mean |row − row of the reference|²) over rows of `dim` numbers; NaN when a
/// number is NaN, or the two do not have the same whole number of rows.
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

/// The Jacobians at points of 2n numbers, computed in double-double precision and
/// rounded: a reference for double precision. 2n × 2n numbers for each point, row by
/// row, as by [`map_jacobians`](crate::network::map_jacobians).
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

/// The largest |value − reference| divided by the largest |reference|; NaN when the
/// lengths differ.
pub fn relative_difference(values: &[f64], reference: &[f64]) -> f64 {
    if values.len() != reference.len() {
        return f64::NAN;
    }
    let difference = values.iter().zip(reference).map(|(a, b)| (a - b).abs());
    let size = reference.iter().map(|v| v.abs()).fold(0.0, max_or_nan);
    difference.fold(0.0, max_or_nan) / size
}

/// The largest error of the values `t` of tanh, in units in the last place, and the
/// largest relative error of the values `s` of sech², at the points x, compared with
/// double-double precision; NaN when the three lengths differ.
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
