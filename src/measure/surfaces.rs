//! Invariant curves of maps of a plane: how far points are from one, and how fast it turns.

use crate::flow::Trajectories;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// The distance of each of some points from the nearest of a set, `dim` numbers each: infinite from an
/// empty set, NaN where a number is. Cost: the product of their numbers.
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

/// The mean growth of an angle from one state of a trajectory to the next, in turns, for each trajectory:
/// of the growths that whole turns tell apart, those within half a turn of `near`.
pub fn winding_numbers(
    orbits: &Trajectories,
    near: f64,
    angle: impl Fn(&[f64]) -> f64 + Sync,
) -> Vec<f64> {
    let of = |m: usize| {
        let mut before = None;
        let mut total = 0.0;
        for z in orbits.of(m) {
            let now = angle(z);
            if let Some(before) = before.replace(now) {
                total += libm::remainder(now - before - near * TAU, TAU);
            }
        }
        near + total / (TAU * (orbits.states() - 1).max(1) as f64)
    };
    (0..orbits.count()).into_par_iter().map(of).collect()
}

/// The part of a line on which a map is locked to a resonance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Locked {
    /// From here …
    pub low: f64,
    /// … to here.
    pub high: f64,
}

impl Locked {
    /// Its width.
    pub fn width(self) -> f64 {
        self.high - self.low
    }
}

/// The ends of the part of [`centre` − `reach`, `centre` + `reach`] around its centre where
/// `is_locked`, which judges many points at once, says so; None where it does not at the centre, or
/// does up to an end. Each
/// end is told by 24 points between those that were and were not, three times over.
///
/// # Errors
/// Those of `is_locked`.
pub fn locked_interval<E>(
    centre: f64,
    reach: f64,
    mut is_locked: impl FnMut(&[f64]) -> Result<Vec<bool>, E>,
) -> Result<Option<Locked>, E> {
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
    Ok(low.zip(high).map(|(low, high)| Locked { low, high }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_to_the_nearest() {
        let set = [0.0, 0.0, 3.0, 4.0];
        assert_eq!(distances_to_set(&[0.0, 1.0, 3.0, 4.5], &set, 2), [1.0, 0.5]);
        assert!(distances_to_set(&[f64::NAN, 1.0], &set, 2)[0].is_nan());
        let hole = [1.0, 1.0, f64::NAN, 0.0, 30.0, 40.0];
        assert!(distances_to_set(&[1.0, 1.0], &hole, 2)[0].is_nan());
        assert_eq!(distances_to_set(&[1.0, 1.0], &[], 2), [f64::INFINITY]);
    }

    #[test]
    fn a_rotation_winds_as_it_turns() {
        let turns = [0.3, 0.71, -0.1, 1.02];
        let states: Vec<f64> = (0..101)
            .flat_map(|t| {
                turns.map(|turn| [t as f64 * turn * TAU].map(|a| [libm::sin(a), libm::cos(a)]))
            })
            .flatten()
            .flatten()
            .collect();
        let orbits = Trajectories::new(states, 2, turns.len()).expect("whole");
        for whole in [-1.0, 0.0, 3.0] {
            let found = winding_numbers(&orbits, 0.45 + whole, |z| libm::atan2(z[0], z[1]));
            for (found, turn) in found.iter().zip([0.3, 0.71, 0.9, 0.02]) {
                let expected = turn + whole;
                assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
            }
        }
    }

    #[test]
    fn an_interval_is_found_by_its_ends() {
        let judge = |places: &[f64]| -> Result<Vec<bool>, ()> {
            Ok(places.iter().map(|x| (0.47..0.58).contains(x)).collect())
        };
        let found = locked_interval(0.5, 0.2, judge).expect("judged").expect("locked");
        assert!((found.low - 0.47).abs() < 1e-5 && (found.high - 0.58).abs() < 1e-5, "{found:?}");
        assert!((found.width() - 0.11).abs() < 2e-5);
        assert!(locked_interval(0.3, 0.2, judge).expect("judged").is_none());
        assert!(locked_interval(0.5, 0.05, judge).expect("judged").is_none(), "cut off");
    }
}
