//! The Jacobians at many points, by the chain rule over the steps, and by dual numbers
//! over lanes, which serve to test the former.

use super::Composition;
use super::batch::{block_size, check_points, load};
use crate::error::Error;
use crate::phase::Direction;
use crate::scalar::{Dual, Kernel, Pack, WIDTH, on_independent_lanes};
use crate::work;
use rayon::prelude::*;

/// The entry of this index of the Jacobian of each point, a point in each lane.
#[inline(always)]
fn store_entry<V: Pack>(entry: V, dim: usize, index: usize, jacobians: &mut [f64]) {
    let mut lanes = [0.0; WIDTH];
    entry.store(&mut lanes[..V::LANES]);
    for (jacobian, value) in jacobians.chunks_exact_mut(dim * dim).zip(lanes) {
        jacobian[index] = value;
    }
}

/// The Jacobians at the points of a block, 2n × 2n row by row.
struct Jacobians<'a> {
    map: &'a Composition<f64>,
    points: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Jacobians<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Pack>(self) {
        /// Columns at a time: an oracle is compiled once, for any n.
        const N: usize = 4;
        let dim = 2 * self.map.dof();
        let mut start = vec![V::zero(); dim];
        let mut duals = vec![Dual::<V, N>::constant(V::zero()); dim];
        let mut scratch = duals.clone();
        let groups = self.points.chunks(V::LANES * dim);
        for (group, out) in groups.zip(self.out.chunks_mut(V::LANES * dim * dim)) {
            load(group, dim, &mut start);
            for first in (0..dim).step_by(N) {
                for (i, (dual, &value)) in duals.iter_mut().zip(&start).enumerate() {
                    // A direction before the first is none of these.
                    *dual = Dual::variable(value, i.wrapping_sub(first));
                }
                self.map.apply(Direction::Forward, &mut duals, &mut scratch);
                for (row, dual) in duals.iter().enumerate() {
                    for (k, derivative) in dual.eps.iter().take(dim - first).enumerate() {
                        store_entry(*derivative, dim, row * dim + first + k, out);
                    }
                }
            }
        }
    }
}

/// `out` ← ∂P/∂z at each point over dual numbers: 2n × 2n numbers a point, row by
/// row, with the same bits as [`jacobian`](crate::measure::jacobian). No step is
/// differentiated by hand, so that it is an independent test of [`map_jacobians`],
/// which it equals up to rounding.
///
/// Cost: n/2 evaluations, rounded up, each with four derivatives of all but tanh, which
/// they share.
///
/// Source: Griewank and Walther, Evaluating Derivatives, <https://doi.org/10.1137/1.9780898717761>,
/// chapter 3, the forward mode.
///
/// # Errors
/// When `points` is not a whole number of points, or `out` of another size.
pub fn map_jacobians_by_duals(
    map: &Composition<f64>,
    points: &[f64],
    out: &mut [f64],
) -> Result<(), Error> {
    each_block_of_jacobians(map, points, out, |points, out| {
        on_independent_lanes(Jacobians { map, points, out });
    })
}

/// The Jacobians at the points of a block by the chain rule.
struct ChainRule<'a> {
    map: &'a Composition<f64>,
    points: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for ChainRule<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Pack>(self) {
        let Self { map, points, out } = self;
        let dim = 2 * map.dof();
        let mut z = vec![V::zero(); dim];
        let mut columns = vec![V::zero(); dim * dim];
        let mut scratch = vec![V::zero(); dim + map.dof() * map.dof()];
        let groups = points.chunks(V::LANES * dim);
        for (group, out) in groups.zip(out.chunks_mut(V::LANES * dim * dim)) {
            load(group, dim, &mut z);
            columns.fill(V::zero());
            for i in 0..dim {
                columns[i * dim + i] = V::from_f64(1.0);
            }
            map.jvp(&mut z, &mut columns, &mut scratch);
            for (column, entries) in columns.chunks_exact(dim).enumerate() {
                for (row, entry) in entries.iter().enumerate() {
                    store_entry(*entry, dim, row * dim + column, out);
                }
            }
        }
    }
}

/// `out` ← ∂P/∂z at each point, exact up to rounding: 2n × 2n numbers a point,
/// row by row. It is the product of the Jacobians of the steps.
///
/// Nothing is allocated per point. The cost is that of an evaluation with its
/// tanh, plus 2n² products a step. The Jacobian at point k as a [`faer::MatRef`] is
/// `MatRef::from_row_major_slice(&out[k * d * d..(k + 1) * d * d], d, d)` with
/// d = 2n.
///
/// # Errors
/// When `points` is not a whole number of points, or `out` of another size.
pub fn map_jacobians(map: &Composition<f64>, points: &[f64], out: &mut [f64]) -> Result<(), Error> {
    each_block_of_jacobians(map, points, out, |points, out| {
        on_independent_lanes(ChainRule { map, points, out });
    })
}

/// Calls `f` for blocks of points and of their Jacobians, on all threads.
fn each_block_of_jacobians(
    map: &Composition<f64>,
    points: &[f64],
    out: &mut [f64],
    f: impl Fn(&[f64], &mut [f64]) + Sync,
) -> Result<(), Error> {
    let dim = 2 * map.dof();
    check_points(points, dim)?;
    Error::check_count("Jacobian entries", points.len() * dim, out.len())?;
    let block = block_size(points.len() / dim) * dim;
    points.par_chunks(block).zip(out.par_chunks_mut(block * dim)).for_each(|(points, out)| {
        work::count(work::Kind::Jacobian, points.len() / dim);
        f(points, out);
    });
    Ok(())
}
