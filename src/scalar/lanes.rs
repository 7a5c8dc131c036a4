//! Several points at once: SIMD lanes of `f64`.

use super::tanh::{Lanewise, functions_of_lanes};
use super::{Pack, Scalar, over_parameters};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// The number of lanes that the batch kernels work on, on every processor.
///
/// It is fixed, so that sums over samples are taken in the same order
/// everywhere; a processor with narrower registers uses several of them.
pub const WIDTH: usize = 8;

/// `L` numbers that go through the same arithmetic.
///
/// Each operation is a loop over a plain array, and becomes vector
/// instructions where the calling function is compiled for them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Lanes<const L: usize = WIDTH>(pub [f64; L]);

impl<const L: usize> Lanes<L> {
    #[inline(always)]
    fn each(self, f: impl Fn(f64) -> f64) -> Self {
        let mut out = self;
        for i in 0..L {
            out.0[i] = f(self.0[i]);
        }
        out
    }

    #[inline(always)]
    fn zip(self, a: Self, b: Self, f: impl Fn(f64, f64, f64) -> f64) -> Self {
        let mut out = self;
        for i in 0..L {
            out.0[i] = f(self.0[i], a.0[i], b.0[i]);
        }
        out
    }
}

macro_rules! lanewise {
    ($trait:ident, $method:ident) => {
        impl<const L: usize> $trait for Lanes<L> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, other, |a, b, _| a.$method(b))
            }
        }
    };
}
lanewise!(Add, add);
lanewise!(Sub, sub);
lanewise!(Mul, mul);
lanewise!(Div, div);

impl<const L: usize> Neg for Lanes<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.each(|x| -x)
    }
}

impl<const L: usize> Scalar for Lanes<L> {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self([value; L])
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        self.zip(a, b, f64::mul_add)
    }
    functions_of_lanes!();
    #[inline(always)]
    fn abs(self) -> Self {
        self.each(f64::abs)
    }
    #[inline(always)]
    fn is_zero(self) -> bool {
        self.0.iter().all(|value| *value == 0.0)
    }
}

over_parameters!([const L: usize] Lanes<L>);

impl<const L: usize> Lanewise for Lanes<L> {
    #[inline(always)]
    fn negative_mul_add(self, a: Self, b: Self) -> Self {
        self.zip(a, b, Lanewise::negative_mul_add)
    }
    #[inline(always)]
    fn at_most(self, most: f64) -> Self {
        self.each(|x| x.at_most(most))
    }
    #[inline(always)]
    fn power_of_low_bits(self) -> Self {
        self.each(Lanewise::power_of_low_bits)
    }
    #[inline(always)]
    fn times_four_powers(self, power: Self) -> Self {
        self.zip(power, power, |x, power, _| x.times_four_powers(power))
    }
    #[inline(always)]
    fn select_above(self, limit: f64, above: Self, otherwise: Self) -> Self {
        self.zip(above, otherwise, |x, above, otherwise| x.select_above(limit, above, otherwise))
    }
    #[inline(always)]
    fn with_sign_of(self, sign: Self) -> Self {
        self.zip(sign, sign, |x, sign, _| x.with_sign_of(sign))
    }
}

impl<const L: usize> Pack for Lanes<L> {
    const LANES: usize = L;
    #[inline(always)]
    fn load(values: &[f64]) -> Self {
        Self(values.try_into().expect("as many as lanes"))
    }
    #[inline(always)]
    fn store(self, values: &mut [f64]) {
        values.copy_from_slice(&self.0);
    }
}
