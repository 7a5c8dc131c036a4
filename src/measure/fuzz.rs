//! The assertions of a fuzz target about a map, for one input of arbitrary bytes.
//!
//! A fuzz target for your own map calls [`check`]:
//!
//! ```
//! use gyroceptron::measure::{OneStep, fuzz};
//! use gyroceptron::phase::Map;
//! use gyroceptron::scalar::{Elementary, constant};
//!
//! struct StandardMap(f64); // p ← p + K sin q, q ← q + p
//!
//! impl<S: Elementary> Map<S> for StandardMap {
//!     fn dof(&self) -> usize {
//!         1
//!     }
//!     fn forward(&self, z: &mut [S]) {
//!         z[1] += z[0].sin_cos().0 * constant(self.0);
//!         z[0] += z[1];
//!     }
//!     fn inverse(&self, z: &mut [S]) {
//!         z[0] -= z[1];
//!         z[1] -= z[0].sin_cos().0 * constant(self.0);
//!     }
//! }
//!
//! fn target(data: &[u8]) {
//!     fuzz::check(&OneStep(StandardMap(1.2)), 1e6, data);
//! }
//! target(b"any bytes that a fuzzer comes up with");
//! ```

use super::coordinate::coordinate;
use super::inversion::{Conditioned, ThereAndBack};
use super::{
    measurable::Measurable, rounding::RoundingPropagation, symplecticity::symplecticity_ratio,
    tally::RATIO_LIMIT,
};
use crate::phase::Direction;

/// The outcome of one input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The ratio was measured, and is below the limit.
    Tested,
    /// The point is so ill-conditioned that rounding leaves no significant digit to test.
    IllConditioned,
    /// The numbers may leave the range of `f64`.
    OutOfRange,
}

/// Numbers at the limits of the arithmetic.
const SPECIAL: [f64; 24] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f64::MIN_POSITIVE,
    -f64::MIN_POSITIVE,
    5e-324,
    -5e-324,
    f64::MAX,
    f64::MIN,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::EPSILON,
    1e8,
    -1e8,
    1e-8,
    1e16,
    1e154,
    1e-300,
    std::f64::consts::PI,
    -std::f64::consts::FRAC_PI_2,
    std::f64::consts::FRAC_PI_4,
    19.0,
];

/// A number made from the bytes that `fill` supplies: of common size, of any size, special (NaN
/// and infinities included), or of arbitrary bits.
pub fn number(fill: &mut dyn FnMut(&mut [u8])) -> f64 {
    fn take<const N: usize>(fill: &mut dyn FnMut(&mut [u8])) -> [u8; N] {
        let mut out = [0; N];
        fill(&mut out);
        out
    }
    let byte = |fill: &mut dyn FnMut(&mut [u8])| f64::from(i8::from_le_bytes(take(fill)));
    let short = |fill: &mut dyn FnMut(&mut [u8])| f64::from(i16::from_le_bytes(take(fill)));
    match take::<1>(fill)[0] % 8 {
        0..=3 => short(fill) / 4096.0,
        4 => {
            let mantissa = short(fill) / 32768.0;
            mantissa * libm::exp2(byte(fill))
        }
        5 => SPECIAL[usize::from(take::<1>(fill)[0]) % SPECIAL.len()],
        6 => byte(fill) / 16.0,
        _ => f64::from_bits(u64::from_le_bytes(take(fill))),
    }
}

/// A point of 2n [numbers](number()) made from bytes, followed by zeros when they run out. Each
/// number is reduced into |zᵢ| ≤ `reach`, or into the [domain](Measurable::domain) of the map.
pub fn point(map: &dyn Measurable, reach: f64, data: &[u8]) -> Vec<f64> {
    let mut bytes = data.iter().copied().chain(std::iter::repeat(0));
    let mut fill = |out: &mut [u8]| {
        for (out, byte) in out.iter_mut().zip(&mut bytes) {
            *out = byte;
        }
    };
    let domain = map.domain();
    let within = |(low, high): (f64, f64), value: f64| {
        let value = if value.is_finite() { value } else { low };
        let inside = (low..=high).contains(&value);
        if inside { value } else { low + (value - low).rem_euclid(high - low) }
    };
    (0..2 * map.dof())
        .map(|i| within(coordinate(&domain, i).range(reach), number(&mut fill)))
        .collect()
}

/// Panics unless the map is symplectic at the [point] of these bytes, and its inverse, where it
/// has one, undoes it there.
///
/// The coordinates of points are at most `reach` in size, or in the range of their domain. The
/// map has to give finite numbers there.
///
/// # Panics
/// When a law does not hold: the message has the law, the ratio and the point.
pub fn check(map: &dyn Measurable, reach: f64, data: &[u8]) -> Outcome {
    let z = point(map, reach, data);
    let symplectic = symplectic(map, &z, true);
    let inverted = match map.has_inverse() {
        true => inverted(map, &z, true),
        false => symplectic.clone(),
    };
    match (symplectic, inverted) {
        (Ok(_), Ok(outcome)) => outcome,
        (Err(reason), _) | (_, Err(reason)) => panic!("{reason}"),
    }
}

/// Tests P⁻¹∘P = Id and P∘P⁻¹ = Id at z, and that [`Map`](crate::phase::Map), the steps one by
/// one and the evaluation of many points give the same bits. Where `in_range` is false, a result
/// that is not finite counts as out of range and not as a failure.
///
/// # Errors
/// The law that does not hold, with the ratio and the point.
pub fn inverted(map: &dyn Measurable, z: &[f64], in_range: bool) -> Result<Outcome, String> {
    let mut outcome = Outcome::IllConditioned;
    for first in [Direction::Forward, Direction::Inverse] {
        let both =
            ThereAndBack::new(map.measured_steps(first), map.measured_steps(first.reversed()));
        match both.within(map.domain()).ratio(z) {
            Conditioned::IllConditioned => {}
            Conditioned::Ratio(ratio) if ratio < RATIO_LIMIT => outcome = Outcome::Tested,
            Conditioned::Ratio(ratio) if in_range || ratio.is_finite() => {
                return Err(format!("{first:?}, then back: ratio {ratio:e} at {z:?}"));
            }
            Conditioned::Ratio(_) => outcome = Outcome::OutOfRange,
        }
    }
    for direction in [Direction::Forward, Direction::Inverse] {
        let mut walked = z.to_vec();
        for step in &map.measured_steps(direction) {
            step.apply(&mut walked);
        }
        let mut single = z.to_vec();
        map.run(direction, &mut single);
        let mut many = z.to_vec();
        map.move_points(direction, &mut many);
        let same = |a: &f64, b: &f64| {
            a.to_bits() == b.to_bits() || !(in_range || (a.is_finite() && b.is_finite()))
        };
        for other in [single, many] {
            if !walked.iter().zip(&other).all(|(a, b)| same(a, b)) {
                return Err(format!("{direction:?}: {walked:?} by steps, {other:?} at once"));
            }
        }
    }
    Ok(outcome)
}

/// Tests JᵀΩJ = Ω at z. Where `in_range` is false, a ratio that is not finite counts as out of range.
///
/// # Errors
/// The ratio and the point.
pub fn symplectic(map: &dyn Measurable, z: &[f64], in_range: bool) -> Result<Outcome, String> {
    let steps = map.measured_steps(Direction::Forward);
    match symplecticity_ratio(&RoundingPropagation::new(&steps, z)) {
        ratio if ratio < RATIO_LIMIT => Ok(Outcome::Tested),
        ratio if in_range || ratio.is_finite() => {
            Err(format!("JᵀΩJ = Ω: ratio {ratio:e} at {z:?}"))
        }
        _ => Ok(Outcome::OutOfRange),
    }
}
