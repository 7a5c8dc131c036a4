//! Orbits of maps that are fitted to pairs without training, with several points in each step.

use super::Pairs;
use super::request::{TOGETHER, at_pace};
use crate::error::Error;
use crate::network::{Pace, Rollout, load_groups, store_groups};
use crate::scalar::{Dual, Kernel, Pack, Scalar, WIDTH, on_independent_lanes};
use rayon::prelude::*;

/// A map that moves several points at once.
pub(super) trait LaneMap: Sync {
    /// Whether two degrees of freedom are worth code of their own.
    const FOUR: bool;

    /// The numbers of a point.
    fn dim(&self) -> usize;

    /// How many numbers of each point it wants as space.
    fn space(&self) -> usize;

    /// z ← its image for each of G points, of D coordinates where that is known at compile time, and not 0; the same
    /// bits for each, whatever D and G are.
    fn move_together<S: Scalar, const D: usize, const G: usize>(
        &self,
        space: &mut [[S; G]],
        z: &mut [S],
    );
}

/// z ← its image, of 2n numbers.
#[inline(always)]
pub(super) fn step<S: Scalar>(map: &impl LaneMap, z: &mut [S]) {
    assert!(z.len() == map.dim());
    let mut space = vec![[S::zero()]; map.space()];
    map.move_together::<S, 0, 1>(&mut space, z);
}

/// The root mean square distance of images from those of pairs.
pub(super) fn error_on(map: &impl LaneMap, pairs: &Pairs) -> f64 {
    let dim = map.dim();
    assert!(2 * pairs.dof() == dim);
    let mut images = pairs.input().to_vec();
    move_all(map, &mut images).expect("whole points");
    distance(images.chunks_exact(dim), pairs)
}

/// The root mean square distance of these images from those of pairs.
pub(super) fn distance<'a>(images: impl Iterator<Item = &'a [f64]>, pairs: &Pairs) -> f64 {
    let square = |(image, expected): (&[f64], &[f64])| -> f64 {
        image.iter().zip(expected).map(|(a, b)| (a - b) * (a - b)).sum()
    };
    let squares: f64 = images.zip(pairs.output().chunks_exact(2 * pairs.dof())).map(square).sum();
    libm::sqrt(squares / pairs.len() as f64)
}

/// The Jacobian at a point: 2n × 2n numbers, row by row.
pub(super) fn jacobian(map: &impl LaneMap, z: &[f64]) -> Vec<f64> {
    assert!(z.len() == map.dim());
    on_independent_lanes(Derivatives { map, z })
}

/// The Jacobian at a point, by duals. It is a kernel so that fused multiply-adds are instructions of the
/// processor; it does not use the lanes.
struct Derivatives<'a, M> {
    map: &'a M,
    z: &'a [f64],
}

impl<M: LaneMap> Kernel for Derivatives<'_, M> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<V: Pack>(self) -> Vec<f64> {
        let Self { map, z } = self;
        let dim = map.dim();
        let mut out = vec![0.0; dim * dim];
        let mut lifted = vec![Dual::<f64, 1>::constant(0.0); dim];
        let mut space = vec![[Dual::constant(0.0)]; map.space()];
        for column in 0..dim {
            for k in 0..dim {
                lifted[k] = Dual::variable(z[k], usize::from(k != column));
            }
            map.move_together::<Dual<f64, 1>, 0, 1>(&mut space, &mut lifted);
            for row in 0..dim {
                out[row * dim + column] = lifted[row].eps[0];
            }
        }
        out
    }
}

/// Room for the states of a roll-out.
///
/// # Errors
/// When there is not, with as much beside it.
pub(super) fn room_for_states(initial: &[f64], request: Rollout) -> Result<Vec<f64>, Error> {
    let kept = (request.steps / request.every).saturating_add(1);
    let too_many = || {
        Error::invalid("states to keep", format!("{kept} of {} numbers", initial.len()), "fewer")
    };
    let size = kept.checked_mul(initial.len()).ok_or_else(too_many)?;
    let [mut out, mut beside] = [Vec::new(), Vec::new()];
    for room in [&mut out, &mut beside] {
        room.try_reserve_exact(size).map_err(|_| too_many())?;
    }
    Ok(out)
}

/// The states of an orbit of each initial point, as a network's [`rollout`](crate::network::rollout) gives them:
/// (steps/every + 1, M, 2n), the first being the initial points. It ends between parts where the thread may be stopped.
pub(super) fn rollout(
    map: &impl LaneMap,
    initial: &[f64],
    request: Rollout,
) -> Result<Vec<f64>, Error> {
    check_rollout(map, initial, request)?;
    let (dim, row) = (map.dim(), initial.len());
    at_pace(|pace| {
        let together = TOGETHER * WIDTH * rayon::current_num_threads();
        let next = |pace: &Pace<'_>, left: usize| {
            let points = pace.part(request.steps).min(left / dim);
            (points.next_multiple_of(together) * dim).min(left)
        };
        let mut size = next(pace, row);
        if size == row {
            return Ok(unbroken(map, initial, request));
        }
        let states = request.steps / request.every + 1;
        let (mut out, mut first) = (vec![0.0; states * row], 0);
        while first < row {
            let part = unbroken(map, &initial[first..first + size], request);
            for (t, of_part) in part.chunks_exact(size).enumerate() {
                out[t * row + first..][..size].copy_from_slice(of_part);
            }
            pace.pause("roll-out", (size / dim).saturating_mul(request.steps))?;
            first += size;
            size = next(pace, row - first);
        }
        Ok(out)
    })
}

fn check_rollout(map: &impl LaneMap, initial: &[f64], request: Rollout) -> Result<(), Error> {
    Error::check_rows("initial points", initial.len(), map.dim())?;
    Error::check_count_range("every", request.every, 1, usize::MAX)?;
    // Each block has room for its own states, beside those of all.
    room_for_states(initial, request).map(drop)
}

/// [`rollout`] of what was checked, to its end.
fn unbroken(map: &impl LaneMap, initial: &[f64], request: Rollout) -> Vec<f64> {
    let states = request.steps / request.every + 1;
    let points = initial.len() / map.dim();
    let mut out = vec![0.0; states * initial.len()];
    let block = points.div_ceil(rayon::current_num_threads()).max(1) * map.dim();
    let blocks: Vec<Vec<f64>> = initial
        .par_chunks(block)
        .map(|initial| on_independent_lanes(Orbits { map, request, initial, states }))
        .collect();
    let mut first = 0;
    for of_block in blocks {
        let row = of_block.len() / states;
        for t in 0..states {
            out[t * initial.len() + first..][..row]
                .copy_from_slice(&of_block[t * row..(t + 1) * row]);
        }
        first += row;
    }
    out
}

/// z ← their images, to the end of them all.
pub(super) fn move_all(map: &impl LaneMap, points: &mut [f64]) -> Result<(), Error> {
    let request = Rollout { steps: 1, every: 1 };
    check_rollout(map, points, request)?;
    let moved = unbroken(map, points, request);
    points.copy_from_slice(&moved[points.len()..]);
    Ok(())
}

/// The orbits of a block of points: (T, M, 2n).
struct Orbits<'a, M> {
    map: &'a M,
    request: Rollout,
    initial: &'a [f64],
    states: usize,
}

impl<M: LaneMap> Kernel for Orbits<'_, M> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<V: Pack>(self) -> Vec<f64> {
        // Fewer lanes than eight are not in registers: one variant is enough.
        if const { V::LANES < WIDTH } {
            return self.together::<V, 0, 1>();
        }
        let few = self.initial.len() <= V::LANES * self.map.dim();
        match (self.map.dim(), few) {
            (2, false) => self.together::<V, 2, TOGETHER>(),
            (2, true) => self.together::<V, 2, 1>(),
            (4, false) if M::FOUR => self.together::<V, 4, TOGETHER>(),
            (4, true) if M::FOUR => self.together::<V, 4, 1>(),
            _ => self.together::<V, 0, 1>(),
        }
    }
}

impl<M: LaneMap> Orbits<'_, M> {
    /// The orbits of G groups at a time, of D coordinates where that is not 0.
    #[inline(always)]
    fn together<V: Pack, const D: usize, const G: usize>(self) -> Vec<f64> {
        let Self { map, request, initial, states } = self;
        let dim = map.dim();
        let mut out = vec![0.0; states * initial.len()];
        let mut space = vec![[V::zero(); G]; map.space()];
        let mut lanes = vec![V::zero(); G * dim];
        let mut shown = vec![0.0; G * V::LANES * dim];
        let together = G * V::LANES * dim;
        for (number, groups) in initial.chunks(together).enumerate() {
            let first = number * together;
            let size = load_groups(groups, dim, &mut lanes);
            for t in 0..states {
                if t > 0 {
                    for _ in 0..request.every {
                        map.move_together::<V, D, G>(&mut space, &mut lanes);
                    }
                }
                store_groups(&lanes[..size], dim, &mut shown[..groups.len()]);
                out[t * initial.len() + first..][..groups.len()]
                    .copy_from_slice(&shown[..groups.len()]);
            }
        }
        out
    }
}
