//! Many points at once: lanes, threads, and kernels chosen at run time.

use super::{Composition, Direction, with_dof};
use crate::error::Error;
use crate::scalar::{Lanes, WIDTH};
use multiversion::multiversion;
use rayon::prelude::*;

/// Points that one task moves: a multiple of the lane width, small enough to
/// spread over threads and to stay in cache.
const BLOCK: usize = 32 * WIDTH;

/// Loads up to [`WIDTH`] points into lanes; the lanes beyond the last point
/// repeat it, so that they compute nothing unusual.
#[inline(always)]
pub(crate) fn load(points: &[f64], dim: usize, lanes: &mut [Lanes]) {
    let count = points.len() / dim;
    for (component, lane) in lanes.iter_mut().enumerate() {
        for k in 0..WIDTH {
            lane.0[k] = points[k.min(count - 1) * dim + component];
        }
    }
}

#[inline(always)]
fn store(lanes: &[Lanes], dim: usize, points: &mut [f64]) {
    for (k, point) in points.chunks_exact_mut(dim).enumerate() {
        for (value, lane) in point.iter_mut().zip(lanes) {
            *value = lane.0[k];
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+fma", "x86_64+avx2+fma"))]
fn map_block(map: &Composition<f64>, direction: Direction, times: usize, points: &mut [f64]) {
    let dim = 2 * map.dof();
    let mut lanes = vec![Lanes::splat(0.0); dim];
    let mut scratch = lanes.clone();
    for group in points.chunks_mut(WIDTH * dim) {
        load(group, dim, &mut lanes);
        for _ in 0..times {
            with_dof!(map.dof(), D => map.apply::<Lanes, D>(direction, &mut lanes, &mut scratch));
        }
        store(&lanes, dim, group);
    }
}

/// `points` ← the map (or its inverse) of each point, 2n numbers each.
///
/// The results are those of [`Map::forward`](crate::phase::Map::forward), bit
/// for bit, on any processor and any number of threads.
///
/// # Errors
/// When `points` is not a whole number of points.
pub fn map_points(
    map: &Composition<f64>,
    direction: Direction,
    points: &mut [f64],
) -> Result<(), Error> {
    iterate(map, direction, 1, points)
}

fn iterate(
    map: &Composition<f64>,
    direction: Direction,
    times: usize,
    points: &mut [f64],
) -> Result<(), Error> {
    let dim = 2 * map.dof();
    if !points.len().is_multiple_of(dim) {
        return Err(Error::invalid("points", points.len(), format!("a multiple of {dim} numbers")));
    }
    points.par_chunks_mut(BLOCK * dim).for_each(|block| map_block(map, direction, times, block));
    Ok(())
}

/// What a roll-out keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rollout {
    /// The number of applications of the map.
    pub steps: usize,
    /// One state in so many is kept, and the first.
    pub every: usize,
}

impl Rollout {
    /// The number of states kept: steps/every + 1.
    pub fn kept(&self) -> usize {
        (self.steps / self.every.max(1)).saturating_add(1)
    }
}

/// The trajectories of the map from each of the points in `initial`: an array
/// (T, M, 2n) with T = [`Rollout::kept`], the first entry being the input.
///
/// Memory is the result; cost is steps × points evaluations.
///
/// # Errors
/// When `initial` is not a whole number of points, `every` is 0, or the states
/// do not fit into memory.
pub fn rollout(
    map: &Composition<f64>,
    initial: &[f64],
    request: Rollout,
) -> Result<Vec<f64>, Error> {
    if request.every == 0 {
        return Err(Error::invalid("every", 0, "at least 1"));
    }
    let kept = request.kept();
    let too_many = || {
        Error::invalid("states to keep", format!("{kept} of {} numbers", initial.len()), "fewer")
    };
    let size = kept.checked_mul(initial.len()).ok_or_else(too_many)?;
    let mut out = Vec::new();
    out.try_reserve_exact(size).map_err(|_| too_many())?;
    out.extend_from_slice(initial);
    let mut state = initial.to_vec();
    for _ in 1..kept {
        iterate(map, Direction::Forward, request.every, &mut state)?;
        out.extend_from_slice(&state);
    }
    Ok(out)
}
