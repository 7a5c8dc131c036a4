//! Exact Jacobians by forward-mode dual numbers, and differences to compare with.

use crate::error::Error;
use crate::network::{Composition, map_points};
use crate::phase::{Direction, Map};
use crate::scalar::Dual;
use faer::Mat;

/// A map whose Jacobian can be computed. Every map that is generic over the
/// number type implements it.
pub trait Differentiable:
    Map<f64> + Map<Dual<f64, 2>> + Map<Dual<f64, 4>> + Map<Dual<f64, 6>> + Map<Dual<f64, 8>>
{
}

impl<M> Differentiable for M where
    M: Map<f64> + Map<Dual<f64, 2>> + Map<Dual<f64, 4>> + Map<Dual<f64, 6>> + Map<Dual<f64, 8>>
{
}

/// ∂P/∂z at z, 2n × 2n, exact up to rounding. One evaluation over duals with
/// as many directions as the point has components, up to eight at a time.
///
/// Source: Griewank and Walther, Evaluating Derivatives, <https://doi.org/10.1137/1.9780898717761>,
/// chapter 3.
///
/// # Panics
/// When z is not of 2n numbers.
pub fn jacobian(map: &impl Differentiable, z: &[f64]) -> Mat<f64> {
    let dim = 2 * Map::<f64>::dof(map);
    assert!(z.len() == dim);
    let mut out = Mat::zeros(dim, dim);
    match dim {
        2 => columns::<2>(|w| map.forward(w), z, 0, &mut out),
        4 => columns::<4>(|w| map.forward(w), z, 0, &mut out),
        6 => columns::<6>(|w| map.forward(w), z, 0, &mut out),
        _ => {
            for first in (0..dim).step_by(8) {
                columns::<8>(|w| map.forward(w), z, first, &mut out);
            }
        }
    }
    out
}

fn columns<const N: usize>(
    forward: impl Fn(&mut [Dual<f64, N>]),
    z: &[f64],
    first: usize,
    out: &mut Mat<f64>,
) {
    let mut w: Vec<Dual<f64, N>> = z
        .iter()
        .enumerate()
        .map(|(i, &v)| match i.checked_sub(first) {
            Some(direction) => Dual::variable(v, direction),
            None => Dual::constant(v),
        })
        .collect();
    forward(&mut w);
    for (row, value) in w.iter().enumerate() {
        for (k, &derivative) in value.eps.iter().enumerate() {
            if first + k < z.len() {
                out[(row, first + k)] = derivative;
            }
        }
    }
}

/// `out` ← the central differences (P(z + hd) − P(z − hd))/2h at each point, d the
/// unit vectors. They approximate ∂P/∂z with errors O(h²) and O(u/h), while
/// [`map_jacobians`](crate::network::map_jacobians) is exact. Cost: 4n evaluations per point.
///
/// # Errors
/// When `points` is not a whole number of points, when `out` has another size, and when h is not positive and finite,
/// or does not move a coordinate.
pub fn jacobians_by_differences(
    map: &Composition<f64>,
    step: f64,
    points: &[f64],
    out: &mut [f64],
) -> Result<(), Error> {
    /// Points at a time: what they are moved to stays in cache.
    const BLOCK: usize = 256;
    let dim = 2 * map.dof();
    Error::check_rows("points", points.len(), dim)?;
    Error::check_count("Jacobian entries", points.len() * dim, out.len())?;
    let moves = |v: &f64| v + step != v - step;
    if !(step > 0.0 && step.is_finite() && points.iter().all(moves)) {
        return Err(Error::invalid("step", step, "positive, and large enough to move a point"));
    }
    let jacobians = points.chunks(BLOCK * dim).zip(out.chunks_mut(BLOCK * dim * dim));
    for (points, out) in jacobians {
        let mut moved = Vec::with_capacity(2 * dim * points.len());
        for point in points.chunks_exact(dim) {
            for direction in 0..2 * dim {
                moved.extend_from_slice(point);
                let first = moved.len() - dim;
                let sign = if direction % 2 == 0 { step } else { -step };
                moved[first + direction / 2] += sign;
            }
        }
        map_points(map, Direction::Forward, &mut moved)?;
        let jacobians = out.chunks_exact_mut(dim * dim);
        for ((point, moved), jacobian) in
            points.chunks_exact(dim).zip(moved.chunks_exact(2 * dim * dim)).zip(jacobians)
        {
            for (column, pair) in moved.chunks_exact(2 * dim).enumerate() {
                let (ahead, behind) = pair.split_at(dim);
                // The step that was taken, not the one that was asked for.
                let taken = (point[column] + step) - (point[column] - step);
                for row in 0..dim {
                    jacobian[row * dim + column] = (ahead[row] - behind[row]) / taken;
                }
            }
        }
    }
    Ok(())
}
