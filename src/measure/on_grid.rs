//! Inversion on a grid: P⁻¹∘P = Id as an equality of whole numbers.

use super::inversion::Conditioned;
use super::measurable::OneStep;
use crate::network::{Composition, GridPoints, Model, Pace, Rollout, grid_rollout};
use crate::phase::{Direction, Map};
use crate::scalar::{FloatOnGrid, Grid, GridNumbers, GridPlace, IntegerOnGrid, OnGrid};

/// A map that moves the points of a [grid](Grid).
///
/// Networks are such maps, and so is [`OneStep`] of a map that is written over the number type and changes
/// its coordinates only by [`Over::increment`](crate::scalar::Over::increment), signs and exchanges:
///
/// ```
/// use gyroceptron::measure::{OneStep, laws};
/// use gyroceptron::phase::Map;
/// use gyroceptron::scalar::Over;
///
/// /// p ← p + K sin q, q ← q + p.
/// struct StandardMap(f64);
///
/// impl<S: Over<f64>> Map<S> for StandardMap {
///     fn dof(&self) -> usize {
///         1
///     }
///     fn forward(&self, z: &mut [S]) {
///         z[1] = z[1].increment(self.0, z[0].sin_cos().0);
///         z[0] = z[0].increment(1.0, z[1]);
///     }
///     fn inverse(&self, z: &mut [S]) {
///         z[0] = z[0].increment(-1.0, z[1]);
///         z[1] = z[1].increment(-self.0, z[0].sin_cos().0);
///     }
/// }
///
/// let points = [0.1, 0.2, -0.7, 2.5];
/// assert!(laws::inversion_on_grid(&OneStep(StandardMap(1.2)), &points).row().largest == Some(0.0));
/// ```
pub trait GridMap: Map<f64> {
    /// Moves a point of the grid, given by its 2n integer places, by P or P⁻¹ if the image is on the grid.
    fn move_places(&self, direction: Direction, grid: Grid, places: &mut [i64]) -> GridMove;
}

/// The outcome of moving a point of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GridMove {
    /// The image is a point of the grid, possibly the same.
    Moved,
    /// An increment was not finite, or beyond the range of floats.
    LeftRange,
    /// A coordinate was changed by something other than increments, signs and exchanges.
    NoIncrement,
}

impl GridMap for Composition<f64> {
    fn move_places(&self, direction: Direction, grid: Grid, places: &mut [i64]) -> GridMove {
        if self.check_on_grid().is_err() {
            return GridMove::NoIncrement;
        }
        let mut points = GridPoints::new(grid, places.to_vec());
        let (one, pace) = (Rollout { steps: 1, every: 1 }, &mut Pace::unbroken());
        let moved = grid_rollout(self, direction, &mut points, one, pace);
        places.copy_from_slice(points.places());
        if moved.is_ok() { GridMove::Moved } else { GridMove::LeftRange }
    }
}

impl GridMap for Model {
    fn move_places(&self, direction: Direction, grid: Grid, places: &mut [i64]) -> GridMove {
        self.composition().move_places(direction, grid, places)
    }
}

impl<M: Map<f64> + Map<IntegerOnGrid> + Map<FloatOnGrid>> GridMap for OneStep<M> {
    fn move_places(&self, direction: Direction, grid: Grid, places: &mut [i64]) -> GridMove {
        match grid.numbers() {
            GridNumbers::Integers => {
                move_numbers(|z: &mut [IntegerOnGrid]| self.0.run(direction, z), grid, places)
            }
            GridNumbers::Floats => {
                move_numbers(|z: &mut [FloatOnGrid]| self.0.run(direction, z), grid, places)
            }
        }
    }
}

fn move_numbers<G: GridPlace<f64>>(
    map: impl Fn(&mut [OnGrid<f64, G>]),
    grid: Grid,
    places: &mut [i64],
) -> GridMove {
    let mut z: Vec<_> =
        places.iter().map(|&place| OnGrid::from_place(place, grid.bits())).collect();
    map(&mut z);
    if z.iter().any(|z| z.is_of_no_increments()) {
        return GridMove::NoIncrement;
    }
    let moved: Option<Vec<i64>> = z.iter().map(|z| z.place()).collect();
    let Some(moved) = moved else { return GridMove::LeftRange };
    places.copy_from_slice(&moved);
    GridMove::Moved
}

/// The number of coordinates that a map and then its inverse change (the inverse first where `first` is
/// [`Direction::Inverse`]). All coordinates count where the map does not consist of increments, or leaves the range
/// of the grid on the way back only. None where it leaves the range on the way there.
pub fn differing_places(
    map: &dyn GridMap,
    first: Direction,
    grid: Grid,
    start: &[i64],
) -> Option<usize> {
    let mut places = start.to_vec();
    for direction in [first, first.reversed()] {
        match map.move_places(direction, grid, &mut places) {
            GridMove::Moved => {}
            GridMove::LeftRange if direction == first => return None,
            // What was in range there is so on the way back.
            GridMove::LeftRange | GridMove::NoIncrement => return Some(start.len()),
        }
    }
    Some(places.iter().zip(start).filter(|(a, b)| a != b).count())
}

/// The bits behind the point of the grids that the law is tested on.
const BITS: u32 = 44;

/// [`differing_places`] in both orders of the points next to z on grids of integers and of floats, and of the
/// points of integers half their range away, where they wrap.
pub(super) fn inversion_on_grids(map: &dyn GridMap, z: &[f64]) -> Conditioned {
    let mut counts = Vec::new();
    for numbers in GridNumbers::ALL {
        let Ok(grid) = Grid::new(BITS, numbers) else { continue };
        // Points beyond the range of floats are of integers alone.
        let Ok(places) = grid.quantise(z) else { continue };
        let mut starts = vec![places];
        if numbers == GridNumbers::Integers {
            let far = |place: &i64| place.wrapping_add(i64::MAX);
            starts.push(starts[0].iter().map(far).collect());
        }
        for start in &starts {
            for first in [Direction::Forward, Direction::Inverse] {
                counts.extend(differing_places(map, first, grid, start));
            }
        }
    }
    match counts.is_empty() {
        true => Conditioned::IllConditioned,
        false => Conditioned::Ratio(counts.iter().sum::<usize>() as f64),
    }
}

/// Whether the map moves a point of the grid at all.
pub(super) fn moves_on_grid(map: &dyn GridMap, z: &[f64]) -> bool {
    let Ok(grid) = Grid::new(BITS, GridNumbers::Integers) else { return false };
    let Ok(start) = grid.quantise(z) else { return false };
    let mut places = start.clone();
    map.move_places(Direction::Forward, grid, &mut places) != GridMove::Moved || places != start
}
