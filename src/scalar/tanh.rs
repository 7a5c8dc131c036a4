//! tanh and sech² from one exponential and one division, without a branch.

use super::Scalar;

/// What tanh asks of a number besides arithmetic: every lane is an `f64`, whose
/// bits it works on.
pub trait Lanewise: Scalar {
    /// −self·a + b, rounded once.
    fn negative_mul_add(self, a: Self, b: Self) -> Self;

    /// The smaller of a lane and `most`; NaN stays.
    fn at_most(self, most: f64) -> Self;

    /// The number whose exponent field stands in the lowest bits of self.
    fn power_of_low_bits(self) -> Self;

    /// self·4·`power`, for a power of two and a normal result: the exponents
    /// are added as integers.
    fn times_four_powers(self, power: Self) -> Self;

    /// In each lane `above` where self > `limit`, else `otherwise`.
    fn select_above(self, limit: f64, above: Self, otherwise: Self) -> Self;

    /// The magnitude of self with the sign of `sign`.
    fn with_sign_of(self, sign: Self) -> Self;
}

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
/// ln 2 − LN2_HIGH.
const LN2_LOW: f64 = f64::from_bits(0x3dea_39ef_3579_3c76);
/// Adding 1.5·2⁵² + 1022 rounds to an integer k, and leaves the exponent field of
/// 2ᵏ⁻¹ in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0 + 1022.0;
/// Beyond it tanh is 1 and sech² is taken for 0: it is less than 1.4e-307.
const SATURATED: f64 = 354.0;
/// Beyond it 1 − tanh is 2E to 7e-17 of itself; up to it it is found from tanh,
/// of which more than the rounded value is known.
const FAR: f64 = 18.65;

/// `(tanh x, sech² x)` of K numbers.
///
/// With y = −2|x| = k ln 2 + r and E = eʸ, tanh|x| = (1 − E)/(1 + E) and
/// sech² = W(2 − W) with W = 1 − tanh|x|. Numerator and denominator, both halved,
/// are carried with their rounding errors. tanh errs by less than 1 ulp
/// everywhere, sech² by less than 3e-16 relative up to |x| = 354, beyond which it
/// is 0. NaN gives NaN, ±∞ gives (±1, 0).
///
/// All fused operations are explicit, so that every instruction set gives the
/// same bits. The K go in step: each instruction is given for all of them before
/// the next, because a processor that waits for one chain of results has the other
/// chains to go on with.
#[inline(always)]
pub(crate) fn tanh_sech2_in_step<V: Lanewise, const K: usize>(x: [V; K]) -> ([V; K], [V; K]) {
    let c = V::from_f64;
    let one = c(1.0);
    macro_rules! each {
        ($i:ident => $value:expr) => {{
            let mut out = x;
            for $i in 0..K {
                out[$i] = $value;
            }
            out
        }};
    }

    let magnitude = each!(i => x[i].abs());
    let a = each!(i => magnitude[i].at_most(SATURATED));
    let shifted = each!(i => a[i].mul_add(c(-2.0 * std::f64::consts::LOG2_E), c(ROUND)));
    let k = each!(i => shifted[i] - c(ROUND));
    let r_exact = each!(i => k[i].mul_add(c(-LN2_HIGH), -(a[i] + a[i])));
    let r = each!(i => k[i].mul_add(c(-LN2_LOW), r_exact[i]));
    let r_low = each!(i => k[i].mul_add(c(-LN2_LOW), r_exact[i] - r[i]));

    let square = each!(i => r[i] * r[i]);
    let mut even = each!(i => square[i].mul_add(c(EXPM1[8]), c(EXPM1[6])));
    let mut odd = each!(i => square[i].mul_add(c(EXPM1[9]), c(EXPM1[7])));
    for j in [4, 2, 0] {
        even = each!(i => even[i].mul_add(square[i], c(EXPM1[j])));
        odd = each!(i => odd[i].mul_add(square[i], c(EXPM1[j + 1])));
    }
    let q = each!(i => odd[i].mul_add(r[i], even[i]));
    let rest = each!(i => square[i].mul_add(q[i], r_low[i]));
    // expm1(y − k ln 2) = p + p_low.
    let p = each!(i => r[i] + rest[i]);
    let p_low = each!(i => rest[i] - (p[i] - r[i]));

    // (E − 1)/2 = (2ᵏ⁻¹ − ½) + 2ᵏ⁻¹(p + p_low), as high + low. Below 2⁻⁵³ the
    // subtraction itself rounds.
    let power = each!(i => shifted[i].power_of_low_bits());
    let m = each!(i => power[i] - c(0.5));
    let m_low = each!(i => power[i] - (m[i] + c(0.5)));
    let high = each!(i => power[i].mul_add(p[i], m[i]));
    let partial = each!(i => power[i].mul_add(p[i], m[i] - high[i]));
    let low = each!(i => power[i].mul_add(p_low[i], partial[i] + m_low[i]));
    // (1 + E)/2, as d + d_low.
    let d = each!(i => high[i] + one);
    let d_low = each!(i => (high[i] - (d[i] - one)) + low[i]);

    let inverse = each!(i => one / d[i]);
    let quotient = each!(i => high[i] * inverse[i]);
    let remainder = each!(i => quotient[i].negative_mul_add(d[i], high[i]) + low[i]);
    let remainder = each!(i => quotient[i].negative_mul_add(d_low[i], remainder[i]));
    let correction = each!(i => remainder[i] * inverse[i]);
    let t = each!(i => quotient[i] + correction[i]);

    let near = each!(i => (one + quotient[i]) + correction[i]);
    let far = each!(i => (one + p[i]).times_four_powers(power[i]));
    let w = each!(i => magnitude[i].select_above(FAR, far[i], near[i]));
    let s = each!(i => w[i].negative_mul_add(w[i], w[i] + w[i]));
    let s = each!(i => magnitude[i].select_above(SATURATED, c(0.0), s[i]));
    (each!(i => t[i].with_sign_of(x[i])), s)
}
