//! P⁻¹∘P = Id, measured in units of its rounding scale.

use super::coordinate::coordinate;
use super::{coordinate::Coordinate, measured_step::MeasuredSteps, rounding::RoundingPropagation};
use crate::scalar::{Scalar, max_or_nan};

/// The spacing of the subnormal numbers.
const SMALLEST: f64 = 5e-324;

/// A ratio, or the statement that no significant digit is left to test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Conditioned {
    /// The error over its rounding scale.
    Ratio(f64),
    /// Rounding alone may move the result by a tenth of its size, or a step is not
    /// linear over the rounding errors that reach it.
    IllConditioned,
}

/// The share of |z| beyond which rounding leaves no digit to test.
pub const ILL_CONDITIONED: f64 = 0.1;

/// The ratio ρ_I of an inversion: the distance from z after the steps `there` and then `back`, which should
/// be their inverse, divided by the rounding scale u·√(2Σᵢ(|Jᵢ⁻¹|δᵢ)² + z²) with
/// i over the steps there; the largest over the components.
///
/// Source: Higham and Mary, <https://doi.org/10.1137/18M1226312>, for errors that add up as
/// independent ones.
pub fn inversion_ratio(
    there: MeasuredSteps<'_>,
    back: MeasuredSteps<'_>,
    z: &[f64],
) -> Conditioned {
    ThereAndBack::new(there, back).ratio(z)
}

/// The steps of a map and of what should be its inverse, for many points.
pub struct ThereAndBack<'a> {
    steps: MeasuredSteps<'a>,
    there: usize,
    domain: Vec<Coordinate>,
}

impl<'a> ThereAndBack<'a> {
    /// The way there and the way back.
    pub fn new(there: MeasuredSteps<'a>, back: MeasuredSteps<'a>) -> Self {
        let count = there.len();
        let mut steps = there;
        steps.extend(back);
        Self { steps, there: count, domain: Vec::new() }
    }

    /// Measures differences of coordinates in the domain of the map: the shortest way on a circle.
    pub fn within(self, domain: Vec<Coordinate>) -> Self {
        Self { domain, ..self }
    }

    /// The ratio ρ_I at a point z, as [`inversion_ratio`] defines it.
    pub fn ratio(&self, z: &[f64]) -> Conditioned {
        let u = f64::unit_roundoff();
        let propagation = RoundingPropagation::new(&self.steps, z);
        let (squares, sums) = propagation.return_scales(self.there);
        let size = z.iter().map(|v| v.abs()).fold(0.0, max_or_nan);
        let reach = sums.into_iter().fold(0.0, max_or_nan);
        let point = propagation.end();
        if point.iter().any(|v| !v.is_finite()) {
            return Conditioned::Ratio(f64::NAN);
        }
        if !(u * reach <= ILL_CONDITIONED * size) || !propagation.is_linear_within(&self.domain) {
            return Conditioned::IllConditioned;
        }
        let mut largest = 0.0;
        for (i, ((moved, start), square)) in point.iter().zip(z).zip(&squares).enumerate() {
            // Each step may lose a product that underflows to nothing.
            let least = self.steps.len() as f64 * SMALLEST;
            // Where a component is next to nothing, errors are rounded too.
            let scale = u * libm::hypot(*square, *start) + u * u * reach + least;
            let error = coordinate(&self.domain, i).difference(moved - start).abs();
            let ratio = if error == 0.0 { 0.0 } else { error / scale };
            largest = max_or_nan(largest, ratio);
        }
        Conditioned::Ratio(largest)
    }
}
