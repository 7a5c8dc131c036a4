//! Invariant curves of maps of a plane: distances from them, winding numbers and locked intervals.

use crate::flow::Trajectories;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// The distance of each point from the nearest point of a set, `dim` numbers each: infinite for an
/// empty set, NaN where a number is NaN. Cost: the number of points times that of the set.
pub fn distances_to_set(points: &[f64], set: &[f64], dim: usize) -> Vec<f64> {
    let square =
        |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum() };
    points
        .par_chunks(dim)
        .map(|point| {
            let mut least = f64::INFINITY;
            for member in set.chunks_exact(dim) {
                let found = square(point, member);
                // A NaN stays.
                least = if least.is_nan() || found >= least { least } else { found };
            }
            libm::sqrt(least)
        })
        .collect()
}

/// The mean growth of an angle from one state to the next, in turns, for each trajectory. Each growth is
/// known up to whole turns only; the value within half a turn of `near` is taken.
///
/// Source: rotation numbers of maps: Meiss, <https://doi.org/10.1103/RevModPhys.64.795>, section II.
pub fn winding_numbers(
    orbits: &Trajectories,
    near: f64,
    angle: impl Fn(&[f64]) -> f64 + Sync,
) -> Vec<f64> {
    let of = |m: usize| {
        let mut before = None;
        let mut total = 0.0;
        for z in orbits.orbit(m) {
            let now = angle(z);
            if let Some(before) = before.replace(now) {
                total += libm::remainder(now - before - near * TAU, TAU);
            }
        }
        near + total / (TAU * (orbits.states() - 1).max(1) as f64)
    };
    (0..orbits.count()).into_par_iter().map(of).collect()
}

/// The interval of a line on which a map is locked to a resonance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LockedInterval {
    /// The lower end of the interval.
    pub low: f64,
    /// The upper end of the interval.
    pub high: f64,
}

impl LockedInterval {
    /// The width of the interval.
    pub fn width(self) -> f64 {
        self.high - self.low
    }
}

/// The interval around `centre`, within [`centre` − `reach`, `centre` + `reach`], on which
/// `is_locked` is true; it judges many points at once. None where the centre is not locked, or all
/// points up to one of the ends are. Each end is found by three rounds of 24 points between the last
/// locked point and the first that is not.
///
/// # Errors
/// Those of `is_locked`.
pub fn locked_interval<E>(
    centre: f64,
    reach: f64,
    mut is_locked: impl FnMut(&[f64]) -> Result<Vec<bool>, E>,
) -> Result<Option<LockedInterval>, E> {
    const POINTS: usize = 24;
    if !is_locked(&[centre])?.first().is_some_and(|locked| *locked) {
        return Ok(None);
    }
    let mut end = |sign: f64| -> Result<Option<f64>, E> {
        let (mut locked, mut free) = (0.0, reach);
        for _ in 0..3 {
            let at = |k: usize| locked + (free - locked) * k as f64 / POINTS as f64;
            let offsets: Vec<f64> = (1..=POINTS).map(at).collect();
            let places: Vec<f64> = offsets.iter().map(|offset| centre + sign * offset).collect();
            let found = is_locked(&places)?;
            let Some(first) = found.iter().position(|locked| !locked) else { return Ok(None) };
            free = offsets[first];
            locked = if first > 0 { offsets[first - 1] } else { locked };
        }
        Ok(Some(centre + sign * 0.5 * (locked + free)))
    };
    let (low, high) = (end(-1.0)?, end(1.0)?);
    Ok(low.zip(high).map(|(low, high)| LockedInterval { low, high }))
}
