//! JᵀΩJ = Ω, measured in units of its rounding scale.

use super::{defect::symplecticity_defect, rounding::RoundingPropagation};
use crate::scalar::{Scalar, max_or_nan};
use faer::Mat;

/// The scale T of R in units of u, 2n × 2n, for any number type.
///
/// With Ĵᵢ = AᵢĴᵢ₋₁ + Eᵢ over the steps,
/// R = Σᵢ(ĴᵢᵀΩEᵢ + EᵢᵀΩĴᵢ − EᵢᵀΩEᵢ) exactly: later steps do not amplify earlier
/// errors. Hence T²_jk = Σᵢ(|Ĵᵢ|ᵀ|Ω|eᵢ + eᵢᵀ|Ω||Ĵᵢ|)²_jk + F²_jk + 1 with eᵢ the
/// scale of Eᵢ and F = |Ĵ_q|ᵀ|Ĵ_p| + its transpose, the error of forming R.
///
/// Source: Higham and Mary, <https://doi.org/10.1137/18M1226312>, for errors that add up as
/// independent ones.
pub fn symplecticity_scale(propagation: &RoundingPropagation<'_>) -> Mat<f64> {
    let dim = propagation.dim();
    let dof = dim / 2;
    let mut scale = Mat::from_fn(dim, dim, |_, _| 1.0);
    // |A|ᵀ|Ω||B| + its transpose.
    let symmetric_product = |a: &[f64], b: &[f64], j: usize, k: usize| {
        let mut sum = 0.0;
        for i in 0..dof {
            let (q, p) = (i * dim, (dof + i) * dim);
            sum += a[q + j].abs() * b[p + k].abs() + a[p + j].abs() * b[q + k].abs();
            sum += b[q + j].abs() * a[p + k].abs() + b[p + j].abs() * a[q + k].abs();
        }
        sum
    };
    for (jacobian, error) in propagation.jacobian_steps() {
        if error.iter().all(|e| *e == 0.0) {
            continue;
        }
        for j in 0..dim {
            for k in 0..dim {
                let term = symmetric_product(jacobian, error, j, k);
                // Squares would overflow.
                scale[(j, k)] = libm::hypot(scale[(j, k)], term);
            }
        }
    }
    let end = propagation.last_jacobian();
    for j in 0..dim {
        for k in 0..dim {
            // F counts every product of J with itself once.
            let forming = 0.5 * symmetric_product(end, end, j, k);
            scale[(j, k)] = libm::hypot(scale[(j, k)], forming);
        }
    }
    scale
}

/// ρ_S = max |R_jk|/(u T_jk), the symplecticity defect at a point over its
/// rounding scale [`symplecticity_scale`]; NaN when anything is not finite.
///
/// Source: Hairer, Lubich and Wanner, Geometric Numerical Integration, VI.2,
/// <https://doi.org/10.1007/3-540-30666-8>, for the condition.
pub fn symplecticity_ratio(propagation: &RoundingPropagation<'_>) -> f64 {
    let end = propagation.jacobian();
    let (defect, scale) = (symplecticity_defect(end), symplecticity_scale(propagation));
    let mut largest = 0.0;
    for j in 0..propagation.dim() {
        for k in 0..propagation.dim() {
            let (defect, scale) = (defect[(j, k)], scale[(j, k)]);
            // Over an infinite scale every defect would be small.
            let ratio = if scale.is_finite() {
                defect.abs() / (f64::unit_roundoff() * scale)
            } else {
                f64::NAN
            };
            largest = max_or_nan(largest, ratio);
        }
    }
    let finite = end.is_all_finite() && propagation.end().iter().all(|v| v.is_finite());
    if finite { largest } else { f64::NAN }
}

/// u·max T over the largest of |J|² and 1: the defect, as a share of the terms of JᵀΩJ, that
/// has a ratio of 1.
pub(super) fn symplecticity_resolution(propagation: &RoundingPropagation<'_>) -> f64 {
    let (end, scale) = (propagation.jacobian(), symplecticity_scale(propagation));
    let (mut largest, mut size) = (0.0, 1.0);
    for j in 0..propagation.dim() {
        for k in 0..propagation.dim() {
            largest = max_or_nan(largest, f64::unit_roundoff() * scale[(j, k)]);
            size = max_or_nan(size, end[(j, k)] * end[(j, k)]);
        }
    }
    largest / size
}
