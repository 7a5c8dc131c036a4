//! Several points at once: SIMD lanes of `f64`.

use super::{Over, Scalar, tanh_sech2};
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
    /// The same number in every lane.
    #[inline(always)]
    pub fn splat(value: f64) -> Self {
        Self([value; L])
    }

    /// The sum of the lanes, from the first to the last.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        let mut total = 0.0;
        for value in self.0 {
            total += value;
        }
        total
    }
}

macro_rules! lanewise {
    ($trait:ident, $method:ident, $operator:tt) => {
        impl<const L: usize> $trait for Lanes<L> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let mut out = [0.0; L];
                for i in 0..L {
                    out[i] = self.0[i] $operator other.0[i];
                }
                Self(out)
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);
lanewise!(Div, div, /);

impl<const L: usize> Neg for Lanes<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let mut out = [0.0; L];
        for i in 0..L {
            out[i] = -self.0[i];
        }
        Self(out)
    }
}

impl<const L: usize> Scalar for Lanes<L> {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self::splat(value)
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        let mut out = [0.0; L];
        for i in 0..L {
            out[i] = self.0[i].mul_add(a.0[i], b.0[i]);
        }
        Self(out)
    }
    #[inline(always)]
    fn tanh_sech2(self) -> (Self, Self) {
        let mut t = [0.0; L];
        let mut s = [0.0; L];
        for i in 0..L {
            (t[i], s[i]) = tanh_sech2(self.0[i]);
        }
        (Self(t), Self(s))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        let mut out = [0.0; L];
        for i in 0..L {
            out[i] = self.0[i].abs();
        }
        Self(out)
    }
    #[inline(always)]
    fn is_zero(self) -> bool {
        self.0.iter().all(|value| *value == 0.0)
    }
    fn unit_roundoff() -> f64 {
        f64::unit_roundoff()
    }
}

impl<const L: usize> Over<f64> for Lanes<L> {
    #[inline(always)]
    fn embed(parameter: f64) -> Self {
        Self::splat(parameter)
    }
    #[inline(always)]
    fn mul_add_parameter(self, parameter: f64, addend: Self) -> Self {
        self.mul_add(Self::splat(parameter), addend)
    }
}
