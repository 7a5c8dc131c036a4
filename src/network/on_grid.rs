//! Maps on a grid: exact bijections, undone to the last bit.

use super::batch::{Rollout, TOGETHER, states_of};
use super::composition::Composition;
use super::pace::Pace;
use crate::error::Error;
use crate::phase::Direction;
use crate::scalar::{
    Floats, Grid, GridNumbers, GridPlace, Integers, Kernel, OnGrid, Pack, Scalar, WIDTH,
    on_independent_lanes,
};
use std::marker::PhantomData;

impl<P: Scalar> Composition<P> {
    /// Fails unless the map is an exact bijection of a grid: all of its steps have to be shears,
    /// exchanges and changes of sign.
    ///
    /// # Errors
    /// When it has a twist or a coupling, with the reason.
    pub fn check_on_grid(&self) -> Result<(), Error> {
        let reason = self.steps().iter().find_map(|step| step.kind.why_off_grid());
        match reason {
            Some(reason) => Err(Error::invalid(
                "map on a grid",
                reason,
                "steps that are shears, each of which is undone by the same rounded increment",
            )),
            None => Ok(()),
        }
    }
}

/// Points whose coordinates are on a [grid](Grid), 2n places each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GridPoints {
    grid: Grid,
    places: Vec<i64>,
}

impl GridPoints {
    /// The points of the grid nearest to these coordinates: each component differs by at most [`Grid::rounding`].
    ///
    /// # Errors
    /// Those of [`Grid::quantise`].
    pub fn nearest(grid: Grid, coordinates: &[f64]) -> Result<Self, Error> {
        Ok(Self { grid, places: grid.quantise(coordinates)? })
    }

    /// The points at these places.
    pub fn new(grid: Grid, places: Vec<i64>) -> Self {
        Self { grid, places }
    }

    /// The grid that states are rounded to.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// The whole numbers k of the coordinates k·2⁻ᴮ.
    pub fn places(&self) -> &[i64] {
        &self.places
    }

    /// The coordinates, rounded to `f64` where a place has more than 53 bits.
    pub fn coordinates(&self) -> Vec<f64> {
        self.places.iter().map(|&place| self.grid.value(place)).collect()
    }

    /// Whether all coordinates are `f64`, none of them rounded.
    pub fn are_exact(&self) -> bool {
        self.places.iter().all(|place| place.unsigned_abs() <= 1 << 53)
    }
}

/// Trajectories on a grid: the states kept are coordinates, NaN where a point has left the grid.
struct GridTrajectories<'a, G> {
    map: &'a Composition<f64>,
    direction: Direction,
    grid: Grid,
    every: usize,
    places: &'a mut [i64],
    kept: &'a mut [f64],
    kind: PhantomData<G>,
}

/// Which [`GridPlace`] a kernel has for its registers.
trait Places {
    type Of<V: Pack>: GridPlace<V>;
}

struct OfIntegers;
struct OfFloats;

impl Places for OfIntegers {
    type Of<V: Pack> = Integers<V>;
}

impl Places for OfFloats {
    type Of<V: Pack> = Floats<V>;
}

/// Places that go together; those beyond the last one repeat it.
#[inline(always)]
fn load<V: Pack, G: GridPlace<V>>(
    places: &[i64],
    dim: usize,
    bits: u32,
    lanes: &mut [OnGrid<V, G>],
) {
    let last = places.len() / dim - 1;
    let mut column = [0.0; WIDTH];
    for (component, lane) in lanes.iter_mut().enumerate() {
        for (k, value) in column[..V::LANES].iter_mut().enumerate() {
            *value = f64::from_bits(places[k.min(last) * dim + component] as u64);
        }
        *lane = OnGrid::from_lanes(V::load(&column[..V::LANES]), bits);
    }
}

/// Their coordinates, and their places where these are asked for.
#[inline(always)]
fn store<V: Pack, G: GridPlace<V>>(
    lanes: &[OnGrid<V, G>],
    dim: usize,
    grid: Grid,
    mut keep: impl FnMut(usize, i64, f64),
    count: usize,
) {
    let (mut places, mut on_grid) = ([0.0; WIDTH], [0.0; WIDTH]);
    for (component, lane) in lanes.iter().enumerate() {
        let (place, on) = lane.lanes();
        place.store(&mut places[..V::LANES]);
        on.store(&mut on_grid[..V::LANES]);
        for k in 0..count {
            let place = places[k].to_bits() as i64;
            let value = if on_grid[k].is_finite() { grid.value(place) } else { f64::NAN };
            keep(k * dim + component, place, value);
        }
    }
}

impl<G: Places> Kernel for GridTrajectories<'_, G> {
    type Output = ();

    #[inline(always)]
    fn run<V: Pack>(self) {
        let Self { map, direction, grid, every, places, kept, kind: _ } = self;
        let (dim, size) = (2 * map.dof(), places.len());
        let mut lanes: Vec<OnGrid<V, G::Of<V>>> =
            vec![OnGrid::from_lanes(V::zero(), grid.bits()); TOGETHER * dim];
        let mut scratch = lanes[..dim].to_vec();
        let (one, together) = (V::LANES * dim, TOGETHER * V::LANES * dim);
        for (number, groups) in places.chunks_mut(together).enumerate() {
            let first = number * together;
            let count = groups.chunks(one).len();
            for (group, lanes) in groups.chunks(one).zip(lanes.chunks_exact_mut(dim)) {
                load(group, dim, grid.bits(), lanes);
            }
            let lanes = &mut lanes[..count * dim];
            for state in kept.chunks_exact_mut(size) {
                for _ in 0..every {
                    map.apply_shears(direction, lanes, &mut scratch);
                }
                let state = &mut state[first..first + groups.len()];
                for (state, lanes) in state.chunks_mut(one).zip(lanes.chunks_exact(dim)) {
                    let points = state.len() / dim;
                    // What was lost on the way to this state stays so.
                    let keep = |k: usize, _, value| {
                        state[k] = if state[k].is_nan() { f64::NAN } else { value };
                    };
                    store(lanes, dim, grid, keep, points);
                }
            }
            for (group, lanes) in groups.chunks_mut(one).zip(lanes.chunks_exact(dim)) {
                let points = group.len() / dim;
                store(lanes, dim, grid, |k, place, _| group[k] = place, points);
            }
        }
    }
}

/// The trajectories of points on a grid under a map or its inverse, whose increments are rounded to the grid:
/// an array (T, M, 2n) of coordinates with T = [`Rollout::kept`], the first entry being the points. `points`
/// is left at the final states.
///
/// N steps forward and N steps back return to the same places, for all weights. Compared with the map in
/// `f64`, each increment differs by at most half the spacing of the grid. The bits are the same on any
/// processor and any number of threads.
///
/// # Errors
/// Those of [`Composition::check_on_grid`]; when the points are not whole, `every` is 0, or the states do not
/// fit into memory; [`Error::Diverged`] when an orbit leaves the range of a grid of floats, or an increment is no
/// finite number; [`Error::Stopped`].
pub fn grid_rollout(
    map: &Composition<f64>,
    direction: Direction,
    points: &mut GridPoints,
    request: Rollout,
    pace: &mut Pace<'_>,
) -> Result<Vec<f64>, Error> {
    map.check_on_grid()?;
    let (dim, grid) = (2 * map.dof(), points.grid);
    super::batch::check_points(&points.coordinates(), dim)?;
    let initial = points.coordinates();
    let run = |places: &mut [i64], every: usize, kept: &mut [f64]| {
        macro_rules! run {
            ($Places:ty) => {{
                let kind = PhantomData::<$Places>;
                on_independent_lanes(GridTrajectories {
                    map,
                    direction,
                    grid,
                    every,
                    places,
                    kept,
                    kind,
                })
            }};
        }
        match grid.numbers() {
            GridNumbers::Integers => run!(OfIntegers),
            GridNumbers::Floats => run!(OfFloats),
        }
    };
    let mut places = points.places.clone();
    let states = states_of(dim, &initial, &mut places, request, pace, run)?;
    if let Some(index) = states.iter().position(|value| value.is_nan()) {
        let (number, state) = (index % initial.len() / dim, index / initial.len());
        let range = match grid.numbers() {
            GridNumbers::Floats => format!("; it holds coordinates below {:e}", grid.limit()),
            GridNumbers::Integers => String::new(),
        };
        return Err(Error::Diverged {
            what: format!("orbit on a grid of {}", grid.numbers().name()),
            place: format!(
                "row {number} of the points, at the latest after {} steps{range}",
                state * request.every
            ),
        });
    }
    points.places = places;
    Ok(states)
}
