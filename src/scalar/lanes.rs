//! Several points at once: SIMD lanes of `f64`.

use super::lanewise::{Lanewise, functions_of_lanes, zero_lanes_with};
use super::lorentzian::lorentzian_in_step;
use super::tanh::tanh_sech2_in_step;
use super::{Apart, Elementary, Pack, Scalar, Task, WIDTH, assigning, over_parameters, simd};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// `L` numbers that go through the same arithmetic.
///
/// Each operation is a loop over a plain array, and becomes vector
/// instructions where the calling function is compiled for them.
///
/// On x86-64 these lanes are for processors without AVX2, which have no fused
/// multiply-add: it is then a call for each lane, and all kernels are compiled
/// around calls, for size rather than speed. Operations are calls too: unrolled,
/// they took more build time than the kernels on registers.
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
            #[cfg_attr(target_arch = "x86_64", inline(never))]
            #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
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
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn neg(self) -> Self {
        self.each(|x| -x)
    }
}

impl<const L: usize> Scalar for Lanes<L> {
    const SPECIALISED: bool = !CALLS;

    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self([value; L])
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        fused(self, a, b)
    }
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn tanh_sech2(self) -> (Self, Self) {
        let ([t], [s]) = Self::tanh_sech2_each([self]);
        (t, s)
    }
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn tanh_sech2_each<const K: usize>(x: [Self; K]) -> ([Self; K], [Self; K]) {
        if !CALLS {
            return tanh_sech2_in_step(x);
        }
        let (mut t, mut s) = (x, x);
        for k in 0..K {
            (t[k], s[k]) = x[k].one_by_one(simd::tanh_sech2);
        }
        (t, s)
    }
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn lorentzian(self) -> (Self, Self) {
        let ([t], [s]) = Self::lorentzian_each([self]);
        (t, s)
    }
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn lorentzian_each<const K: usize>(x: [Self; K]) -> ([Self; K], [Self; K]) {
        if !CALLS {
            return lorentzian_in_step(x);
        }
        let (mut t, mut s) = (x, x);
        for k in 0..K {
            (t[k], s[k]) = x[k].one_by_one(simd::lorentzian);
        }
        (t, s)
    }
    #[inline(always)]
    fn outlined(task: impl Task) {
        if CALLS { task.run_apart() } else { task.run() }
    }
    fn unit_roundoff() -> f64 {
        f64::unit_roundoff()
    }
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn abs(self) -> Self {
        self.each(f64::abs)
    }
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn is_zero(self) -> bool {
        self.0.iter().all(|value| *value == 0.0)
    }
}

impl<const L: usize> Elementary for Lanes<L> {
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn sin_cos(self) -> (Self, Self) {
        if CALLS { self.one_by_one(simd::sin_cos) } else { super::sin_cos::sin_cos(self) }
    }
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn exp(self) -> Self {
        if CALLS { self.each(simd::exp) } else { super::exp::exp(self) }
    }
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn zero_with(self, factor: Self) -> Self {
        zero_lanes_with(self, factor)
    }
    #[inline(always)]
    fn sign(self) -> Self {
        Self::from_f64(1.0).with_sign_of(self)
    }
    functions_of_lanes!();
}

/// Whether kernels on [`Lanes`] are compiled around calls.
const CALLS: bool = cfg!(target_arch = "x86_64");

#[cfg_attr(target_arch = "x86_64", inline(never))]
#[cfg_attr(not(target_arch = "x86_64"), inline(always))]
fn fused<const L: usize>(x: Lanes<L>, a: Lanes<L>, b: Lanes<L>) -> Lanes<L> {
    x.zip(a, b, f64::mul_add)
}

assigning!([const L: usize] Lanes<L>);
over_parameters!([const L: usize] Lanes<L>);

impl<const L: usize> Lanewise for Lanes<L> {
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn negative_mul_add(self, a: Self, b: Self) -> Self {
        self.zip(a, b, Lanewise::negative_mul_add)
    }
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn at_most(self, most: f64) -> Self {
        self.each(|x| x.at_most(most))
    }
    #[inline(always)]
    fn power_of_low_bits(self) -> Self {
        self.each(Lanewise::power_of_low_bits)
    }
    #[inline(always)]
    fn bit_as_sign<const BIT: u32>(self) -> Self {
        self.each(Lanewise::bit_as_sign::<BIT>)
    }
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn select_above(self, limit: f64, above: Self, otherwise: Self) -> Self {
        self.zip(above, otherwise, |x, above, otherwise| x.select_above(limit, above, otherwise))
    }
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn select_negative(self, negative: Self, otherwise: Self) -> Self {
        self.zip(negative, otherwise, Lanewise::select_negative)
    }
    #[inline(always)]
    fn any_above(self, limit: f64) -> bool {
        self.0.iter().any(|lane| *lane > limit)
    }
    #[inline(always)]
    fn all_negative(self) -> bool {
        self.0.iter().all(|lane| *lane < 0.0)
    }
    #[inline(always)]
    fn one_by_one(self, f: impl Fn(f64) -> (f64, f64)) -> (Self, Self) {
        let mut out = (self, self);
        for i in 0..L {
            (out.0.0[i], out.1.0[i]) = f(self.0[i]);
        }
        out
    }
    #[inline(always)]
    fn pair_by_pair(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        self.zip(other, other, |a, b, _| f(a, b))
    }
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn with_sign_of(self, sign: Self) -> Self {
        self.zip(sign, sign, |x, sign, _| x.with_sign_of(sign))
    }
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn negated_where(self, sign: Self) -> Self {
        self.zip(sign, sign, |x, sign, _| x.negated_where(sign))
    }
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn plus_bits(self, other: Self) -> Self {
        self.zip(other, other, |x, other, _| x.plus_bits(other))
    }
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn minus_bits(self, other: Self) -> Self {
        self.zip(other, other, |x, other, _| x.minus_bits(other))
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
