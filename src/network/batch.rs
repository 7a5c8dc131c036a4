//! Many points at once: lanes, threads, and kernels chosen at run time.

use super::{Composition, NEURONS, Pace};
use crate::error::Error;
use crate::phase::Direction;
use crate::scalar::{Grid, Kernel, Pack, WIDTH, on_lanes};
use crate::work;
use rayon::prelude::*;

/// The most points that one task moves: they stay in cache.
const BLOCK: usize = 32 * WIDTH;

/// Groups of points that make each step together: while the last results of one
/// are awaited, the processor has the others.
pub(super) const TOGETHER: usize = 8;

/// Numbers that a block keeps before they are put in their place.
const SLAB: usize = 1 << 16;

/// Loads up to as many points as lanes; the lanes beyond the last point repeat
/// it, so that they compute nothing unusual.
#[inline(always)]
pub(crate) fn load<V: Pack>(points: &[f64], dim: usize, lanes: &mut [V]) {
    let count = points.len() / dim;
    let mut column = [0.0; WIDTH];
    for (component, lane) in lanes.iter_mut().enumerate() {
        for (k, value) in column[..V::LANES].iter_mut().enumerate() {
            *value = points[k.min(count - 1) * dim + component];
        }
        *lane = V::load(&column[..V::LANES]);
    }
}

#[inline(always)]
fn store<V: Pack>(lanes: &[V], dim: usize, points: &mut [f64]) {
    let mut column = [0.0; WIDTH];
    for (component, lane) in lanes.iter().enumerate() {
        lane.store(&mut column[..V::LANES]);
        for (point, value) in points.chunks_exact_mut(dim).zip(column) {
            point[component] = value;
        }
    }
}

/// Loads one group of points after another; returns how many numbers a lane they are.
#[inline(always)]
pub(crate) fn load_groups<V: Pack>(points: &[f64], dim: usize, lanes: &mut [V]) -> usize {
    let groups = points.chunks(V::LANES * dim);
    let count = groups.len();
    for (group, lanes) in groups.zip(lanes.chunks_exact_mut(dim)) {
        load(group, dim, lanes);
    }
    count * dim
}

#[inline(always)]
pub(crate) fn store_groups<V: Pack>(lanes: &[V], dim: usize, points: &mut [f64]) {
    for (group, lanes) in points.chunks_mut(V::LANES * dim).zip(lanes.chunks_exact(dim)) {
        store(lanes, dim, group);
    }
}

/// The map of each point of a block.
struct MapBlock<'a> {
    map: &'a Composition<f64>,
    direction: Direction,
    points: &'a mut [f64],
}

impl Kernel for MapBlock<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Pack>(self) {
        let Self { map, direction, points } = self;
        let dim = 2 * map.dof();
        let mut lanes = vec![V::zero(); TOGETHER * dim];
        let mut scratch = vec![V::zero(); dim];
        for groups in points.chunks_mut(TOGETHER * V::LANES * dim) {
            let size = load_groups(groups, dim, &mut lanes);
            let lanes = &mut lanes[..size];
            map.apply(direction, lanes, &mut scratch);
            store_groups(lanes, dim, groups);
        }
    }
}

/// The trajectories of a block of points, which end where they are to go on.
struct Trajectories<'a> {
    map: &'a Composition<f64>,
    every: usize,
    points: &'a mut [f64],
    /// The states kept, all points of the block after one another.
    kept: &'a mut [f64],
}

impl Kernel for Trajectories<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Pack>(self) {
        let Self { map, every, points, kept } = self;
        let (dim, size) = (2 * map.dof(), points.len());
        let mut lanes = vec![V::zero(); TOGETHER * dim];
        let mut scratch = vec![V::zero(); dim];
        let together = TOGETHER * V::LANES * dim;
        for (number, groups) in points.chunks_mut(together).enumerate() {
            let first = number * together;
            let count = load_groups(groups, dim, &mut lanes);
            let lanes = &mut lanes[..count];
            for state in kept.chunks_exact_mut(size) {
                for _ in 0..every {
                    map.apply(Direction::Forward, lanes, &mut scratch);
                }
                store_groups(lanes, dim, &mut state[first..first + groups.len()]);
            }
            store_groups(lanes, dim, groups);
        }
    }
}

/// The neurons of a layer are all that can go together of a single trajectory: one
/// in each of the lanes.
struct SingleTrajectory<'a> {
    map: &'a Composition<f64>,
    direction: Direction,
    every: usize,
    /// Where it starts, and where it ends.
    point: &'a mut [f64],
    kept: &'a mut [f64],
}

impl Kernel for SingleTrajectory<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Pack>(self) {
        let Self { map, direction, every, point, kept } = self;
        let mut scratch = vec![0.0; point.len()];
        for state in kept.chunks_exact_mut(point.len()) {
            for _ in 0..every {
                map.apply_across::<V>(direction, point, &mut scratch);
            }
            state.copy_from_slice(point);
        }
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
    let dim = 2 * map.dof();
    check_points(points, dim)?;
    points.par_chunks_mut(block_size(points.len() / dim) * dim).for_each(|points| {
        work::count(work::Kind::Evaluation, points.len() / dim);
        if points.len() == dim {
            return map.move_point(direction, points);
        }
        on_lanes::<WIDTH, _>(MapBlock { map, direction, points });
    });
    Ok(())
}

/// [`map_points`] in parts, between which the pace decides whether to go on.
///
/// # Errors
/// Those of [`map_points`]; [`Error::Stopped`], after which some of the points have been moved.
pub fn map_points_at_pace(
    map: &Composition<f64>,
    direction: Direction,
    points: &mut [f64],
    pace: &mut Pace<'_>,
) -> Result<(), Error> {
    let dim = 2 * map.dof();
    check_points(points, dim)?;
    let mut rest = points;
    while !rest.is_empty() {
        let count = pace.part(1).min(rest.len() / dim);
        let (part, after) = rest.split_at_mut(count * dim);
        map_points(map, direction, part)?;
        pace.pause("map of points", count)?;
        rest = after;
    }
    Ok(())
}

pub(super) fn check_points(points: &[f64], dim: usize) -> Result<(), Error> {
    Error::check_rows("points", points.len(), dim)
}

/// Points a task: whole groups of lanes for every thread, no more than stay in
/// cache. Nothing that is computed depends on it.
pub(super) fn block_size(points: usize) -> usize {
    points.div_ceil(rayon::current_num_threads()).next_multiple_of(WIDTH).clamp(WIDTH, BLOCK)
}

/// The number of steps of a roll-out, and the states that it keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rollout {
    /// The number of applications of the map.
    pub steps: usize,
    /// The interval, in steps, between kept states; the first state is always kept.
    pub every: usize,
}

impl Rollout {
    /// The number of states kept: steps/every + 1.
    pub fn kept(&self) -> usize {
        (self.steps / self.every.max(1)).saturating_add(1)
    }
}

/// The mode of a roll-out: by the map or its inverse, with plain numbers or on a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Course {
    /// Whether steps are of the map or of its inverse.
    pub direction: Direction,
    /// The grid to which increments are rounded, so that the inverse is exact.
    pub grid: Option<Grid>,
}

impl Default for Course {
    /// By the map, with plain numbers.
    fn default() -> Self {
        Self { direction: Direction::Forward, grid: None }
    }
}

/// The trajectories of the map from each of the points in `initial`: an array
/// (T, M, 2n) with T = [`Rollout::kept`], the first entry being the input.
///
/// It needs memory for the result and, with more points than one task has, at most 64 Ki
/// numbers per task and no more than the result. The cost is steps × points evaluations. A single
/// point is moved with the neurons of each layer in the lanes, several points with one in each
/// lane, on all threads: the bits are the same.
///
/// # Errors
/// When `initial` is not a whole number of points, `every` is 0, or the states
/// do not fit into memory.
pub fn rollout(
    map: &Composition<f64>,
    initial: &[f64],
    request: Rollout,
) -> Result<Vec<f64>, Error> {
    rollout_at_pace(map, initial, request, &mut Pace::unbroken())
}

/// [`rollout`] in parts, between which the pace decides whether to go on: the same bits.
///
/// A part is some steps of all points, or one step of some points. Between parts the
/// states are stored and loaded again, which does not change the result.
///
/// # Errors
/// Those of [`rollout`]; [`Error::Stopped`].
pub fn rollout_at_pace(
    map: &Composition<f64>,
    initial: &[f64],
    request: Rollout,
    pace: &mut Pace<'_>,
) -> Result<Vec<f64>, Error> {
    let dim = 2 * map.dof();
    check_points(initial, dim)?;
    let mut state = initial.to_vec();
    let run = |points: &mut [f64], every: usize, kept: &mut [f64]| {
        if points.len() == dim {
            let direction = Direction::Forward;
            let single = SingleTrajectory { map, direction, every, point: points, kept };
            return on_lanes::<NEURONS, _>(single);
        }
        on_lanes::<WIDTH, _>(Trajectories { map, every, points, kept });
    };
    states_of(dim, initial, &mut state, request, pace, run)
}

/// The states kept of a roll-out of points whose coordinates are `initial`: `run` moves some of `state`, so many
/// steps to each state that it keeps.
pub(super) fn states_of<T: Send>(
    dim: usize,
    initial: &[f64],
    state: &mut [T],
    request: Rollout,
    pace: &mut Pace<'_>,
    run: impl Fn(&mut [T], usize, &mut [f64]) + Sync,
) -> Result<Vec<f64>, Error> {
    Error::check_count_range("every", request.every, 1, usize::MAX)?;
    let kept = request.kept();
    let too_many = || {
        Error::invalid("states to keep", format!("{kept} of {} numbers", initial.len()), "fewer")
    };
    let size = kept.checked_mul(initial.len()).ok_or_else(too_many)?;
    let mut out = Vec::new();
    out.try_reserve_exact(size).map_err(|_| too_many())?;
    out.extend_from_slice(initial);
    out.resize(size, 0.0);
    let block = block_size(initial.len() / dim) * dim;
    let run = |points: &mut [T], every: usize, kept: &mut [f64]| {
        work::count(work::Kind::Evaluation, kept.len() / dim * every);
        run(points, every, kept);
    };
    let kept = &mut out[initial.len()..];
    if initial.is_empty() {
        return Ok(out);
    }
    if initial.len() <= block {
        let size = initial.len();
        in_parts(pace, request.every, kept.len() / size, size / dim, |part, pace| {
            run(state, part.steps, &mut kept[part.states(size)]);
            pace.pause(ROLLOUT, part.evaluations(size / dim))
        })?;
        return Ok(out);
    }
    // Each block keeps its states for a while, then all are put in place.
    let slab = SLAB.div_ceil(block).min(request.kept() - 1).max(1);
    let mut by_block = vec![0.0; slab * initial.len()];
    for kept in kept.chunks_mut(slab * initial.len()) {
        let times = kept.len() / initial.len();
        in_parts(pace, request.every, times, initial.len() / dim, |part, pace| {
            // Where one step of all points takes long, those of some blocks after another.
            let (mut points, mut kept) = (&mut state[..], &mut by_block[..]);
            while !points.is_empty() {
                let (enough, all) = (rayon::current_num_threads(), points.len().div_ceil(block));
                let blocks = pace.part(part.evaluations(block / dim)).max(enough).min(all);
                let (now, later) = points.split_at_mut((blocks * block).min(points.len()));
                let (now_kept, later_kept) = kept.split_at_mut(slab * now.len());
                let each = now.par_chunks_mut(block).zip(now_kept.par_chunks_mut(slab * block));
                each.for_each(|(points, kept)| {
                    let states = part.states(points.len());
                    run(points, part.steps, &mut kept[states]);
                });
                pace.pause(ROLLOUT, part.evaluations(now.len() / dim))?;
                (points, kept) = (later, later_kept);
            }
            Ok(())
        })?;
        for (number, together) in by_block.chunks(slab * block).enumerate() {
            let first = number * block;
            let size = block.min(initial.len() - first);
            for (states, state) in
                kept.chunks_exact_mut(initial.len()).zip(together.chunks_exact(size))
            {
                states[first..first + size].copy_from_slice(state);
            }
        }
    }
    Ok(out)
}

/// What a roll-out is called where it is stopped.
const ROLLOUT: &str = "roll-out";

/// Some of the steps of a roll-out: `count` kept states from number `first`, one in `steps`
/// steps.
struct Part {
    first: usize,
    count: usize,
    steps: usize,
}

impl Part {
    /// Where the kept states are, of so many numbers each.
    fn states(&self, size: usize) -> std::ops::Range<usize> {
        self.first * size..(self.first + self.count) * size
    }

    /// The number of evaluations of the map in this part, for this number of points.
    fn evaluations(&self, points: usize) -> usize {
        self.steps.saturating_mul(self.count).saturating_mul(points)
    }
}

/// Calls `run`, which pauses, for parts of a roll-out of so many points, of which one state in `every`
/// steps is kept, `states` in all. A part keeps some states, or it makes some of the steps to
/// the next kept one, and keeps the state between in its place.
fn in_parts(
    pace: &mut Pace<'_>,
    every: usize,
    states: usize,
    points: usize,
    mut run: impl FnMut(Part, &mut Pace<'_>) -> Result<(), Error>,
) -> Result<(), Error> {
    let (mut first, mut made) = (0, 0);
    while first < states {
        let steps = pace.part(points);
        let part = if made == 0 && steps >= every {
            Part { first, count: (steps / every).min(states - first), steps: every }
        } else {
            Part { first, count: 1, steps: steps.min(every - made) }
        };
        made += part.steps;
        let whole = made >= every;
        let count = part.count;
        run(part, pace)?;
        if whole {
            (first, made) = (first + count, 0);
        }
    }
    Ok(())
}
