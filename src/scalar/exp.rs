//! eˣ, and eˣ − 1 for small x, which tanh shares.

use super::lanewise::{BIAS, Lanewise, ROUND, each};
use std::f64::consts::LOG2_E;

/// (e^r − 1 − r)/r² on |r| ≤ ½ ln 2, the polynomial of degree 9 whose largest
/// error relative to (e^r − 1)/r² is least, 2.1e-17. Made with mpmath by Remez'
/// exchange, the error weighted by |r| + 0.02.
const EXPM1: [f64; 10] = [
    0.500_000_000_000_000_4,
    0.166_666_666_666_666_85,
    0.041_666_666_666_582_06,
    0.008_333_333_333_315_651,
    0.001_388_888_893_017_207_3,
    0.000_198_412_699_009_113_42,
    2.480_150_669_004_567_6e-5,
    2.755_722_971_123_856_3e-6,
    2.762_554_586_915_758e-7,
    2.511_395_390_026_9e-8,
];

/// ln 2 with 21 trailing zero bits, so that k·LN2_HIGH is exact for |k| < 2²⁰.
const LN2_HIGH: f64 = f64::from_bits(0x3fe6_2e42_fee0_0000);
/// The difference ln 2 − LN2_HIGH, rounded to a double.
const LN2_LOW: f64 = f64::from_bits(0x3dea_39ef_3579_3c76);

/// Below it eˣ rounds to 0, and above the other to infinity.
const LEAST: f64 = -746.0;
const MOST: f64 = 710.0;

/// e^(y − k ln 2) − 1 of K numbers, |y − k ln 2| ≤ ½ ln 2, in step.
#[inline(always)]
pub(super) fn expm1_of_rest<V: Lanewise, const K: usize>(y: [V; K], k: [V; K]) -> [V; K] {
    let c = V::from_f64;
    let r = each!(y, i => k[i].mul_add(c(-LN2_HIGH), y[i]));
    let r = each!(y, i => k[i].mul_add(c(-LN2_LOW), r[i]));
    let square = each!(y, i => r[i] * r[i]);
    let mut even = each!(y, i => square[i].mul_add(c(EXPM1[8]), c(EXPM1[6])));
    let mut odd = each!(y, i => square[i].mul_add(c(EXPM1[9]), c(EXPM1[7])));
    for j in [4, 2, 0] {
        even = each!(y, i => even[i].mul_add(square[i], c(EXPM1[j])));
        odd = each!(y, i => odd[i].mul_add(square[i], c(EXPM1[j + 1])));
    }
    let rest = each!(y, i => odd[i].mul_add(r[i], even[i]));
    each!(y, i => square[i].mul_add(rest[i], r[i]))
}

/// eˣ within 2 ulp; below the normal numbers within one of their steps. NaN gives
/// NaN, ±∞ give ∞ and 0.
#[inline(always)]
pub(super) fn exp<V: Lanewise>(x: V) -> V {
    let c = V::from_f64;
    let x = -((-x.at_most(MOST)).at_most(-LEAST));
    let k = x.mul_add(c(LOG2_E), c(ROUND)) - c(ROUND);
    let [p] = expm1_of_rest([x], [k]);
    // 2ᵏ is no normal number at either end: two factors are.
    let shifted = k.mul_add(c(0.5), c(ROUND + BIAS));
    let first = shifted - c(ROUND + BIAS);
    let second = (k - first) + c(ROUND + BIAS);
    (c(1.0) + p) * shifted.power_of_low_bits() * second.power_of_low_bits()
}
