//! det J = 1, where the determinant of a rounded matrix has a significant digit.

use super::{inversion::Conditioned, rounding::RoundingPropagation};
use crate::scalar::Scalar;

/// The share of 1 beyond which the rounding of the decomposition leaves no
/// digit to test.
const NO_DIGIT: f64 = 0.1;

/// |det J − 1| over its rounding scale, det J from faer's LU decomposition with
/// partial pivoting.
///
/// The decomposition of a 2n × 2n matrix errs by 2n·u‖J‖², and the rounding of
/// J itself by the sum over the steps of u·|J⁻¹|e, here bounded by its trace.
///
/// Source: Higham, Accuracy and Stability of Numerical Algorithms, section 9.3,
/// <https://doi.org/10.1137/1.9780898718027>, for the decomposition.
pub fn determinant_ratio(propagation: &RoundingPropagation) -> Conditioned {
    let dim = propagation.dim();
    let jacobian = propagation.jacobian();
    if !jacobian.is_all_finite() {
        return Conditioned::Ratio(f64::NAN);
    }
    let norm = jacobian.norm_l2();
    let decomposition = dim as f64 * norm * norm;
    // d(log det) = tr(J⁻¹dJ), step by step.
    let mut of_rounding = 0.0;
    for ((_, inverse), (_, error)) in propagation.inverses().zip(propagation.jacobian_steps()) {
        for i in 0..dim {
            for k in 0..dim {
                of_rounding += inverse[i * dim + k].abs() * error[k * dim + i];
            }
        }
    }
    let bound = f64::unit_roundoff() * (decomposition + of_rounding + 1.0);
    if !(bound <= NO_DIGIT) {
        return Conditioned::IllConditioned;
    }
    Conditioned::Ratio((jacobian.determinant() - 1.0).abs() / bound)
}
