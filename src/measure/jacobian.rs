//! Exact Jacobians by forward-mode dual numbers.

use crate::phase::Map;
use crate::scalar::Dual;
use faer::Mat;

/// A map that the Jacobian can be taken of: one that is written over the
/// number type is it by itself.
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
