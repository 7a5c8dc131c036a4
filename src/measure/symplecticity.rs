//! JᵀΩJ = Ω, measured in units of its rounding bound.

use super::Walk;
use crate::scalar::{Scalar, max_or_nan};

/// R = JᵀΩJ − Ω, 2n × 2n row by row, for a Jacobian given row by row.
pub fn symplecticity_defect(jacobian: &[f64], dof: usize) -> Vec<f64> {
    let dim = 2 * dof;
    let mut out = vec![0.0; dim * dim];
    for j in 0..dim {
        for k in 0..dim {
            let mut sum = 0.0;
            for i in 0..dof {
                let (qj, pj) = (jacobian[i * dim + j], jacobian[(dof + i) * dim + j]);
                let (qk, pk) = (jacobian[i * dim + k], jacobian[(dof + i) * dim + k]);
                sum += qj * pk - pj * qk;
            }
            let omega = if k == j + dof {
                1.0
            } else if j == k + dof {
                -1.0
            } else {
                0.0
            };
            out[j * dim + k] = sum - omega;
        }
    }
    out
}

/// ρ_S = max |R_jk|/(u T_jk), the symplecticity defect at a point over its
/// rounding bound; NaN when anything is not finite.
///
/// With Ĵᵢ = AᵢĴᵢ₋₁ + Eᵢ over the steps,
/// R = Σᵢ(ĴᵢᵀΩEᵢ + EᵢᵀΩĴᵢ − EᵢᵀΩEᵢ) exactly: later steps do not amplify earlier
/// errors. Hence T²_jk = Σᵢ(|Ĵᵢ|ᵀ|Ω|eᵢ + eᵢᵀ|Ω||Ĵᵢ|)²_jk + F²_jk + 1 with eᵢ the
/// scale of Eᵢ and F = |Ĵ_q|ᵀ|Ĵ_p| + its transpose, the error of forming R.
pub fn symplecticity_ratio(walk: &Walk) -> f64 {
    let dim = walk.dim();
    let dof = dim / 2;
    let mut squares = vec![1.0; dim * dim];
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
    for (jacobian, error) in walk.jacobian_steps() {
        if error.iter().all(|e| *e == 0.0) {
            continue;
        }
        for j in 0..dim {
            for k in 0..dim {
                let term = symmetric_product(jacobian, error, j, k);
                squares[j * dim + k] += term * term;
            }
        }
    }
    let end = walk.jacobian();
    let defect = symplecticity_defect(end, dof);
    let mut largest = 0.0;
    for j in 0..dim {
        for k in 0..dim {
            // F counts every product of J with itself once.
            let forming = 0.5 * symmetric_product(end, end, j, k);
            let bound = (squares[j * dim + k] + forming * forming).sqrt();
            // Over an infinite bound every defect would be small.
            let ratio = if bound.is_finite() {
                defect[j * dim + k].abs() / (f64::unit_roundoff() * bound)
            } else {
                f64::NAN
            };
            largest = max_or_nan(largest, ratio);
        }
    }
    let finite = end.iter().chain(walk.end()).all(|v| v.is_finite());
    if finite { largest } else { f64::NAN }
}
