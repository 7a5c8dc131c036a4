//! tanh and sech² from one exponential and one division, without a branch.

use super::exp::expm1_of_rest;
use super::lanewise::{BIAS, Lanewise, ROUND, each};
use std::f64::consts::LOG2_E;

/// From 354.38 up to here k is −1023, whose exponent field is that of 0: E is 0,
/// tanh 1 and sech², truly less than 6.3e-308, 0.
const SATURATED: f64 = 354.5;

/// `(tanh x, sech² x)` of K numbers.
///
/// With E = e^{−2|x|} = 2ᵏ(1 + p) and q = E/(1 + E), tanh|x| = (1 − E)/(1 + E) and
/// sech² = 4(q − q²), which is accurate for every q ≤ ½. tanh errs by less than
/// 3 ulp, sech² by less than 5e-16 relative up to |x| = 354; from 354.38 on it
/// is 0. NaN gives NaN, ±∞ gives (±1, 0).
///
/// The two share 1/(1 + E), each part of which is rounded once: where tanh is not
/// used, nothing of it is computed.
///
/// All fused operations are explicit, so that every instruction set gives the
/// same bits. The K go in step: each instruction is given for all of them before
/// the next, because a processor that waits for one chain of results has the other
/// chains to go on with.
#[inline(always)]
pub(super) fn tanh_sech2_in_step<V: Lanewise, const K: usize>(x: [V; K]) -> ([V; K], [V; K]) {
    let c = V::from_f64;
    let one = c(1.0);
    let a = each!(x, i => x[i].abs().at_most(SATURATED));
    let shifted = each!(x, i => a[i].mul_add(c(-2.0 * LOG2_E), c(ROUND + BIAS)));
    let k = each!(x, i => shifted[i] - c(ROUND + BIAS));
    let p = expm1_of_rest(each!(x, i => -(a[i] + a[i])), k);
    let power = each!(x, i => shifted[i].power_of_low_bits());

    let inverse = each!(x, i => one / power[i].mul_add(p[i], power[i] + one));
    let base = each!(x, i => power[i] * inverse[i]);
    let q = each!(x, i => p[i].mul_add(base[i], base[i]));
    let s = each!(x, i => c(4.0) * q[i].negative_mul_add(q[i], q[i]));

    let expm1 = each!(x, i => power[i].mul_add(p[i], power[i] - one));
    let t = each!(x, i => (expm1[i] * inverse[i]).with_sign_of(x[i]));
    (t, s)
}
