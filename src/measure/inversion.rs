//! P⁻¹∘P = Id, measured in units of its rounding bound.

use super::{MeasuredStep, Walk};
use crate::scalar::{Scalar, max_or_nan};

/// A ratio, or the word that no digit is left to test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Conditioned {
    /// The error over its rounding bound.
    Ratio(f64),
    /// Rounding alone may move the result by a tenth of its size, or reaches a
    /// step with errors over which it is not linear.
    IllConditioned,
}

/// The share of |z| beyond which rounding leaves no digit to test.
pub(super) const ILL_CONDITIONED: f64 = 0.1;

/// ρ_I: how far the steps, which should compose to the identity, are from it
/// at z, over the rounding bound √(Σᵢ(|J_N Jᵢ⁻¹|δᵢ)² + z²)·u, the largest over
/// the components.
pub fn inversion_ratio(steps: &[Box<dyn MeasuredStep + '_>], z: &[f64]) -> Conditioned {
    let u = f64::unit_roundoff();
    let walk = Walk::new(steps, z);
    let (squares, sums) = walk.value_bounds();
    let size = z.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let reach = sums.into_iter().fold(0.0, max_or_nan);
    let point = walk.end();
    if point.iter().any(|v| !v.is_finite()) {
        return Conditioned::Ratio(f64::NAN);
    }
    if !(u * reach <= ILL_CONDITIONED * size) || !walk.is_linear() {
        return Conditioned::IllConditioned;
    }
    let mut largest = 0.0;
    for ((moved, start), square) in point.iter().zip(z).zip(&squares) {
        let bound = u * libm::hypot(*square, *start);
        let error = (moved - start).abs();
        let ratio = if error == 0.0 { 0.0 } else { error / bound };
        largest = max_or_nan(largest, ratio);
    }
    Conditioned::Ratio(largest)
}
