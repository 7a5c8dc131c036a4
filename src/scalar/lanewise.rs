//! The operations that the elementary functions need besides arithmetic.

use super::Elementary;

/// The number of lanes that the batch kernels work on, on every processor.
///
/// It is fixed, so that sums over samples are taken in the same order
/// everywhere; a processor with narrower registers uses several of them.
pub const WIDTH: usize = 8;

/// A number whose lanes are `f64`. The elementary functions work on their bits, and
/// so are written once, for `f64` and for all registers.
pub trait Lanewise: Elementary {
    /// −self·a + b, rounded once.
    fn negative_mul_add(self, a: Self, b: Self) -> Self;

    /// The smaller of a lane and `most`; NaN stays.
    fn at_most(self, most: f64) -> Self;

    /// The number whose exponent field stands in the lowest bits of self.
    fn power_of_low_bits(self) -> Self;

    /// A number that is negative (−0 included) where this bit of self is set;
    /// bit 0 is the lowest.
    fn bit_as_sign<const BIT: u32>(self) -> Self;

    /// In each lane `above` where self > `limit`, else `otherwise`.
    fn select_above(self, limit: f64, above: Self, otherwise: Self) -> Self;

    /// In each lane `negative` where self has a minus sign, else `otherwise`.
    fn select_negative(self, negative: Self, otherwise: Self) -> Self;

    /// Whether any lane is above `limit`; a NaN is not.
    fn any_above(self, limit: f64) -> bool;

    /// Whether all lanes are below 0; a NaN is not.
    fn all_negative(self) -> bool;

    /// `f` applied to each lane in turn.
    fn one_by_one(self, f: impl Fn(f64) -> (f64, f64)) -> (Self, Self);

    /// `f` applied to each pair of lanes of self and `other` in turn.
    fn pair_by_pair(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self;

    /// The magnitude of self with the sign of `sign`.
    fn with_sign_of(self, sign: Self) -> Self;

    /// self, negated where `sign` has a minus sign.
    fn negated_where(self, sign: Self) -> Self;

    /// The sum of the bits of each lane, as integers that wrap.
    fn plus_bits(self, other: Self) -> Self;

    /// The difference of the bits of each lane, as integers that wrap.
    fn minus_bits(self, other: Self) -> Self;
}

/// `each!(x, i => value)`: an array like x whose i-th number is the value. A number of operations one after another,
/// each on all numbers before the next, goes in step: a processor that waits for one chain of results has the other
/// chains to go on with.
macro_rules! each {
    ($like:expr, $i:ident => $value:expr) => {{
        let mut out = $like;
        for $i in 0..out.len() {
            out[$i] = $value;
        }
        out
    }};
}
pub(super) use each;

/// Adding it rounds a number below 2⁵¹ to an integer, which is then in the low bits.
pub(super) const ROUND: f64 = 6_755_399_441_055_744.0;

/// The exponent field of 1.
pub(super) const BIAS: f64 = 1023.0;

/// The implementation of [`Elementary::zero_with`] for all types of lanes.
#[inline(always)]
pub(super) fn zero_lanes_with<V: Lanewise>(x: V, factor: V) -> V {
    const LEAST: f64 = f64::from_bits(1);
    (-factor.abs()).select_above(-LEAST, V::zero(), x)
}

/// The functions of [`Elementary`] that are taken lane by lane, those of [`libm`]: no
/// kernel waits for them.
macro_rules! functions_of_lanes {
    () => {
        #[inline(always)]
        fn sqrt(self) -> Self {
            self.pair_by_pair(self, |x, _| x.sqrt())
        }
        #[inline(always)]
        fn ln(self) -> Self {
            self.pair_by_pair(self, |x, _| libm::log(x))
        }
        #[inline(always)]
        fn powf(self, exponent: f64) -> Self {
            self.pair_by_pair(self, |x, _| libm::pow(x, exponent))
        }
        #[inline(always)]
        fn atan2(self, x: Self) -> Self {
            self.pair_by_pair(x, libm::atan2)
        }
        #[inline(always)]
        fn rem_euclid(self, period: f64) -> Self {
            self.pair_by_pair(self, |x, _| x.rem_euclid(period))
        }
    };
}
pub(super) use functions_of_lanes;
