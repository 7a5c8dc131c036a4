//! 1/(1 + x²), without a division.

use super::lanewise::{Lanewise, each};

/// 1 + x² goes no further: the bits of the reciprocal's first guess are those of a number up to here.
const MOST: f64 = 1e300;

/// The square root √[`MOST`], at which |x| is cut off in the numerator of x/(1 + x²).
const FARTHEST: f64 = 1e150;

/// The bits of a positive number d subtracted from these are those of r ≈ 1/d, with |1 − dr| < 0.0506.
const GUESS: u64 = 0x7FDE_6238_DA3C_2118;

/// `(x/(1 + x²), 1/(1 + x²))` of K numbers: of arctan, the slope s and t = xs, so that s′ = −2ts.
///
/// The reciprocal r of d = 1 + x² begins with a guess by the bits of d. Two steps r ← r(1 + e)(1 + e²), e = 1 − dr,
/// leave e⁴ and then e¹⁶ < 1e-20 of its error, and so the rounding of d and of the last two operations: s errs by
/// 3u relative at most, u = 2⁻⁵³, and t by 4u, up to |x| = 1e150; from there on they are 1e-300 and ±1e-150. NaN
/// gives NaN.
///
/// On registers of eight it takes less time than a division. All operations are exact ones of IEEE 754, so that every
/// instruction set gives the same bits. The K go in step, as in
/// [`tanh_sech2_in_step`](super::tanh::tanh_sech2_in_step).
#[inline(always)]
pub(super) fn lorentzian_in_step<V: Lanewise, const K: usize>(x: [V; K]) -> ([V; K], [V; K]) {
    let c = V::from_f64;
    let one = c(1.0);
    let d = each!(x, i => x[i].mul_add(x[i], one).at_most(MOST));
    let mut r = each!(x, i => c(f64::from_bits(GUESS)).minus_bits(d[i]));
    for _ in 0..2 {
        let e = each!(x, i => d[i].negative_mul_add(r[i], one));
        let square = each!(x, i => e[i] * e[i]);
        let nearer = each!(x, i => r[i].mul_add(e[i], r[i]));
        r = each!(x, i => nearer[i].mul_add(square[i], nearer[i]));
    }
    let t = each!(x, i => (x[i].abs().at_most(FARTHEST) * r[i]).with_sign_of(x[i]));
    (t, r)
}
