//! Errors against data and reference, and drifts.

use super::drift::log_slope;
use crate::error::Error;
use crate::flow::{Condition, Pairs, Trajectories};
use crate::layer::{TorusAction, Turn};
use crate::network::{Composition, map_points};
use crate::phase::Direction;
use crate::scalar::max_or_nan;
use crate::system::NearlyPeriodic;
use serde::{Deserialize, Serialize};

/// The Euclidean distance of two points.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// The change of a quantity along a trajectory.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Drift {
    /// The value of the quantity in the first state.
    pub initial: f64,
    /// The largest |value − initial| afterwards.
    pub largest: f64,
}

/// The drift of a sequence of values; NaN when one of them is NaN.
pub fn drift(values: impl IntoIterator<Item = f64>) -> Drift {
    let mut values = values.into_iter();
    let initial = values.next().unwrap_or(f64::NAN);
    let largest = values.map(|v| (v - initial).abs()).fold(0.0, max_or_nan);
    Drift { initial, largest }
}

/// How far a trajectory is from its reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Departure {
    /// The largest distance of its states; NaN when one is NaN.
    pub largest: f64,
    /// The distance of the last state.
    pub last: f64,
}

/// The distance of each state of trajectory `m` from the reference's.
///
/// # Panics
/// When there is no such trajectory.
pub fn distances_along<'a>(
    trajectories: &'a Trajectories,
    reference: &'a Trajectories,
    m: usize,
) -> impl Iterator<Item = f64> + 'a {
    trajectories.orbit(m).zip(reference.orbit(m)).map(|(a, b)| distance(a, b))
}

/// The distance of each trajectory from its reference; NaN where the two differ in the
/// number of trajectories, states or coordinates.
pub fn departures(trajectories: &Trajectories, reference: &Trajectories) -> Vec<Departure> {
    let shape = |of: &Trajectories| (of.states(), of.count(), of.dim());
    if shape(trajectories) != shape(reference) {
        return vec![Departure { largest: f64::NAN, last: f64::NAN }; reference.count()];
    }
    (0..reference.count())
        .map(|m| {
            let mut departure = Departure { largest: 0.0, last: f64::NAN };
            for error in distances_along(trajectories, reference, m) {
                departure.largest = max_or_nan(departure.largest, error);
                departure.last = error;
            }
            departure
        })
        .collect()
}

/// The drift of a quantity along each trajectory.
pub fn drifts(trajectories: &Trajectories, quantity: impl Fn(&[f64]) -> f64) -> Vec<Drift> {
    (0..trajectories.count()).map(|m| drift(trajectories.orbit(m).map(&quantity))).collect()
}

/// The exponent a of D(t) ∝ t^a, where D(t) is the largest change of a quantity up to
/// time t over all trajectories. It is fitted over the last two decades of the states,
/// and NaN where there are too few states or the quantity never changes.
///
/// The exponent is 0 for a quantity that oscillates and 1 for one that drifts linearly.
pub fn drift_exponent(trajectories: &Trajectories, quantity: impl Fn(&[f64]) -> f64) -> f64 {
    const POINTS: u32 = 12;
    let last = trajectories.states() - 1;
    let initial: Vec<f64> =
        (0..trajectories.count()).map(|m| quantity(trajectories.state(0, m))).collect();
    let mut largest = 0.0;
    let mut running = vec![0.0];
    for t in 1..=last {
        for (m, initial) in initial.iter().enumerate() {
            let change = (quantity(trajectories.state(t, m)) - initial).abs();
            largest = max_or_nan(largest, change);
        }
        running.push(largest);
    }
    let time = |k: u32| {
        let share = libm::exp10(-2.0 * f64::from(POINTS - 1 - k) / f64::from(POINTS - 1));
        (last as f64 * share).round() as usize
    };
    let mut times: Vec<usize> = (0..POINTS).map(time).filter(|t| *t > 0).collect();
    times.dedup();
    let t: Vec<f64> = times.iter().map(|t| *t as f64).collect();
    let d: Vec<f64> = times.iter().map(|t| running[*t]).collect();
    log_slope(&t, &d)
}

/// A power of ten that a decreasing error has reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Milestone {
    /// The error as a power of ten.
    pub level: f64,
    /// The iteration at which the error was first seen at or below it.
    pub iteration: u64,
}

/// The powers of ten that an error reached, from a history of (iteration, error),
/// beginning with the one at or below the first error.
pub fn milestones(history: &[(u64, f64)]) -> Vec<Milestone> {
    const LEAST: i32 = -32;
    let Some((_, first)) = history.first() else {
        return Vec::new();
    };
    let mut exponent = libm::floor(libm::log10(*first)) as i32;
    let mut out = Vec::new();
    for &(iteration, error) in history {
        while error <= libm::exp10(f64::from(exponent)) && exponent > LEAST {
            out.push(Milestone { level: libm::exp10(f64::from(exponent)), iteration });
            exponent -= 1;
        }
    }
    out
}

/// The mean squared error, over all components, of the exact limiting flow of
/// `system` over `time`: the baseline for a surrogate.
pub fn limiting_flow_error(system: &impl NearlyPeriodic, pairs: &Pairs, time: f64) -> f64 {
    error_of(pairs, |z| system.limiting_flow(z, time))
}

/// The mean squared error, over all components, of the rotation by the torus action at
/// these angles. For pairs with several flow times the angles are in proportion to them.
pub fn rotation_error(action: &TorusAction, angles: &[f64], pairs: &Pairs) -> f64 {
    let mut total = 0.0;
    for (turn, input, output) in turns(action, angles, pairs) {
        total += squares_of(input, output, 2 * pairs.dof(), |z| turn.apply(z, false));
    }
    total / pairs.output().len() as f64
}

/// The rotation, the inputs and the outputs of each map that pairs are of.
fn turns<'a>(
    action: &'a TorusAction,
    angles: &'a [f64],
    pairs: &'a Pairs,
) -> impl Iterator<Item = (Turn<f64>, &'a [f64], &'a [f64])> {
    pairs.runs().into_iter().map(move |(condition, input, output)| {
        let time = condition.map_or(1.0, |condition| condition.time);
        let angles: Vec<f64> = angles.iter().map(|angle| time * angle).collect();
        (action.turn_by(&angles), input, output)
    })
}

/// The mean squared error of each of the 2n components for the rotation by the torus action
/// at these angles: see [`rotation_error`].
pub fn rotation_errors(action: &TorusAction, angles: &[f64], pairs: &Pairs) -> Vec<f64> {
    let dim = 2 * pairs.dof();
    let mut squares = vec![0.0; dim];
    for (turn, input, output) in turns(action, angles, pairs) {
        for (input, output) in input.chunks_exact(dim).zip(output.chunks_exact(dim)) {
            let mut moved = input.to_vec();
            turn.apply(&mut moved, false);
            for ((sum, a), b) in squares.iter_mut().zip(&moved).zip(output) {
                *sum += (a - b) * (a - b);
            }
        }
    }
    squares.iter().map(|sum| sum / pairs.len() as f64).collect()
}

/// The motion of pairs in a plane (q_j, p_j) apart from a rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneMotion {
    /// The scale for errors in the plane: the root mean square over q and p of the error of the
    /// rotation. Where this is rounding only, it is the root mean square of the outputs in the
    /// plane; where these are 0, that of the outputs in all planes; where all are 0, it is 1.
    pub scale: f64,
    /// Whether the error of the rotation is rounding only: at most [`PlaneMotion::ROUNDING`]
    /// times the outputs.
    pub explained: bool,
}

impl PlaneMotion {
    /// The share of the outputs of the plane below which a motion is taken for rounding, either
    /// of the pairs, which an integrator made, or of the angle of the rotation.
    pub const ROUNDING: f64 = 1e-8;
}

/// The motion of pairs in each plane apart from the rotation by the action at these angles.
///
/// # Panics
/// When the action and the pairs differ in their degrees of freedom.
pub fn plane_motions(action: &TorusAction, angles: &[f64], pairs: &Pairs) -> Vec<PlaneMotion> {
    let dof = pairs.dof();
    let left = rotation_errors(action, angles, pairs);
    let size = |j: usize| {
        let rows = pairs.output().chunks_exact(2 * dof);
        let values: Vec<f64> = rows.flat_map(|z| [z[j], z[dof + j]]).collect();
        root_mean_square(&values)
    };
    let of_plane = |j: usize| {
        let (motion, size) = ((0.5 * (left[j] + left[dof + j])).sqrt(), size(j));
        let explained = motion <= PlaneMotion::ROUNDING * size;
        let scale = match explained {
            false => motion,
            true if size > 0.0 => size,
            true => Some(root_mean_square(pairs.output())).filter(|all| *all > 0.0).unwrap_or(1.0),
        };
        PlaneMotion { scale, explained }
    };
    (0..dof).map(of_plane).collect()
}

/// The mean squared error of `step` applied to the inputs.
fn error_of(pairs: &Pairs, step: impl Fn(&mut [f64])) -> f64 {
    let squares = squares_of(pairs.input(), pairs.output(), 2 * pairs.dof(), step);
    squares / pairs.output().len() as f64
}

fn squares_of(input: &[f64], output: &[f64], dim: usize, step: impl Fn(&mut [f64])) -> f64 {
    let mut total = 0.0;
    for (input, output) in input.chunks_exact(dim).zip(output.chunks_exact(dim)) {
        let mut moved = input.to_vec();
        step(&mut moved);
        for (a, b) in moved.iter().zip(output) {
            total += (a - b) * (a - b);
        }
    }
    total
}

/// The root of the mean square of some numbers.
pub fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// The root-mean-square error of each of the 2n components. Pairs under several
/// conditions are compared with the map at each condition.
///
/// # Errors
/// Those of [`map_points`].
pub fn component_errors(map: &Composition<f64>, pairs: &Pairs) -> Result<Vec<f64>, Error> {
    let dim = 2 * pairs.dof();
    let moved = predictions(map, pairs)?;
    let mut squares = vec![0.0; dim];
    for (found, target) in moved.chunks_exact(dim).zip(pairs.output().chunks_exact(dim)) {
        for c in 0..dim {
            squares[c] += (found[c] - target[c]) * (found[c] - target[c]);
        }
    }
    Ok(squares.into_iter().map(|s| (s / pairs.len() as f64).sqrt()).collect())
}

/// The images of the inputs under a map, in rows of 2n numbers. Pairs under several conditions
/// are mapped by the map at each condition.
///
/// # Errors
/// Those of [`map_points`].
pub fn predictions(map: &Composition<f64>, pairs: &Pairs) -> Result<Vec<f64>, Error> {
    let mut moved = Vec::with_capacity(pairs.input().len());
    for (condition, input, _) in pairs.runs() {
        let first = moved.len();
        moved.extend_from_slice(input);
        let member = |of: &Condition| map.member(of.epsilon, of.time, &of.controls);
        let at = condition.map(member).transpose()?;
        map_points(at.as_ref().unwrap_or(map), Direction::Forward, &mut moved[first..])?;
    }
    Ok(moved)
}
