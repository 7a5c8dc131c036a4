//! Sine and cosine without a branch, for arguments that are not huge.

use super::lanewise::{Lanewise, ROUND};
use std::f64::consts::FRAC_2_PI;

/// Beyond it (some 10⁹) [`libm::sincos`] takes over: an angle whose neighbours are
/// 1e-7 apart.
pub(super) const FAR: f64 = 1_073_741_824.0;

/// π/2 in three parts. The product of the first with the integer k leaves an exact
/// difference; the second is rounded down, so that the third is positive and −0
/// stays −0.
const HALF_PI: [f64; 3] = [
    f64::from_bits(0x3ff9_21fb_5444_2d18),
    f64::from_bits(0x3c91_a626_3314_5c06),
    f64::from_bits(0x394c_1cd1_2902_4e09),
];

/// (sin r − r)/r³ and (cos r − 1 + ½r²)/r⁴ in powers of r², |r| ≤ ¼π: those of
/// fdlibm's `__kernel_sin` and `__kernel_cos`, whose errors are below 2⁻⁵⁸.
const SIN: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
const COS: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// `(sin x, cos x)`, each within 2 ulp. NaN and ±∞ give NaN.
#[inline(always)]
pub(super) fn sin_cos<V: Lanewise>(x: V) -> (V, V) {
    if x.abs().any_above(FAR) {
        return x.one_by_one(sin_cos_far);
    }
    sin_cos_near(x)
}

#[cold]
#[inline(never)]
fn sin_cos_far(x: f64) -> (f64, f64) {
    if x.abs() > FAR { libm::sincos(x) } else { sin_cos_near(x) }
}

#[inline(always)]
fn sin_cos_near<V: Lanewise>(x: V) -> (V, V) {
    let c = V::from_f64;
    // x = k·½π + r.
    let shifted = x.mul_add(c(FRAC_2_PI), c(ROUND));
    let k = shifted - c(ROUND);
    let mut r = x;
    for part in HALF_PI {
        r = k.negative_mul_add(c(part), r);
    }
    let square = r * r;
    let (mut sin, mut cos) = (c(SIN[5]), c(COS[5]));
    for j in (0..5).rev() {
        sin = sin.mul_add(square, c(SIN[j]));
        cos = cos.mul_add(square, c(COS[j]));
    }
    let sin = (r * square).mul_add(sin, r).with_sign_of(r);
    let cos = square.mul_add(square.mul_add(cos, c(-0.5)), c(1.0));
    // The quadrant is k mod 4: odd ones exchange the two.
    let odd = shifted.bit_as_sign::<0>();
    let sin_negative = shifted.bit_as_sign::<1>();
    let cos_negative = (shifted + c(1.0)).bit_as_sign::<1>();
    (
        odd.select_negative(cos, sin).negated_where(sin_negative),
        odd.select_negative(sin, cos).negated_where(cos_negative),
    )
}
