//! `f64` and `f32` as scalars.

use super::lanewise::{Lanewise, functions_of_lanes};
use super::{Elementary, Over, Pack, Real, Scalar, over_itself, simd, tanh_sech2};

impl Scalar for f64 {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        f64::mul_add(self, a, b)
    }
    #[inline(always)]
    fn tanh_sech2(self) -> (Self, Self) {
        tanh_sech2(self)
    }
    #[inline(always)]
    fn lorentzian(self) -> (Self, Self) {
        simd::lorentzian(self)
    }
    #[inline(always)]
    fn as_plain(values: &mut [Self]) -> Option<&mut [f64]> {
        Some(values)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn is_zero(self) -> bool {
        self == 0.0
    }
    fn unit_roundoff() -> f64 {
        f64::EPSILON / 2.0
    }
}

impl Lanewise for f64 {
    #[inline(always)]
    fn negative_mul_add(self, a: Self, b: Self) -> Self {
        (-self).mul_add(a, b)
    }
    #[inline(always)]
    fn at_most(self, most: f64) -> Self {
        // `min` would swallow a NaN.
        if self > most { most } else { self }
    }
    #[inline(always)]
    fn power_of_low_bits(self) -> Self {
        f64::from_bits(self.to_bits() << 52)
    }
    #[inline(always)]
    fn bit_as_sign<const BIT: u32>(self) -> Self {
        f64::from_bits(self.to_bits() << (63 - BIT))
    }
    #[inline(always)]
    fn select_above(self, limit: f64, above: Self, otherwise: Self) -> Self {
        if self > limit { above } else { otherwise }
    }
    #[inline(always)]
    fn select_negative(self, negative: Self, otherwise: Self) -> Self {
        if self.is_sign_negative() { negative } else { otherwise }
    }
    #[inline(always)]
    fn any_above(self, limit: f64) -> bool {
        self > limit
    }
    #[inline(always)]
    fn all_negative(self) -> bool {
        self < 0.0
    }
    #[inline(always)]
    fn one_by_one(self, f: impl Fn(f64) -> (f64, f64)) -> (Self, Self) {
        f(self)
    }
    #[inline(always)]
    fn pair_by_pair(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        f(self, other)
    }
    #[inline(always)]
    fn with_sign_of(self, sign: Self) -> Self {
        self.copysign(sign)
    }
    #[inline(always)]
    fn negated_where(self, sign: Self) -> Self {
        f64::from_bits(self.to_bits() ^ (sign.to_bits() & (1 << 63)))
    }
    #[inline(always)]
    fn plus_bits(self, other: Self) -> Self {
        f64::from_bits(self.to_bits().wrapping_add(other.to_bits()))
    }
    #[inline(always)]
    fn minus_bits(self, other: Self) -> Self {
        f64::from_bits(self.to_bits().wrapping_sub(other.to_bits()))
    }
}

/// A pack of one lane, which is the number itself.
impl Pack for f64 {
    const LANES: usize = 1;
    #[inline(always)]
    fn load(values: &[f64]) -> Self {
        let [value] = values else { panic!("one number, not {}", values.len()) };
        *value
    }
    #[inline(always)]
    fn store(self, values: &mut [f64]) {
        let [value] = values else { panic!("one number, not {}", values.len()) };
        *value = self;
    }
}

impl Elementary for f64 {
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        simd::sin_cos(self)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        simd::exp(self)
    }
    #[inline(always)]
    fn zero_with(self, factor: Self) -> Self {
        if factor == 0.0 { 0.0 } else { self }
    }
    #[inline(always)]
    fn sign(self) -> Self {
        if self.is_sign_negative() { -1.0 } else { 1.0 }
    }
    functions_of_lanes!();
}

impl Real for f64 {
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
}

/// Single precision. The elementary functions are those of `f64`, rounded.
impl Scalar for f32 {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value as f32
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        f32::mul_add(self, a, b)
    }
    #[inline(always)]
    fn tanh_sech2(self) -> (Self, Self) {
        let (t, s) = tanh_sech2(f64::from(self));
        (t as f32, s as f32)
    }
    #[inline(always)]
    fn lorentzian(self) -> (Self, Self) {
        let (t, s) = simd::lorentzian(f64::from(self));
        (t as f32, s as f32)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f32::abs(self)
    }
    #[inline(always)]
    fn is_zero(self) -> bool {
        self == 0.0
    }
    fn unit_roundoff() -> f64 {
        f64::from(f32::EPSILON) / 2.0
    }
}

impl Elementary for f32 {
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = simd::sin_cos(f64::from(self));
        (s as f32, c as f32)
    }
    #[inline]
    fn exp(self) -> Self {
        simd::exp(f64::from(self)) as f32
    }
    #[inline]
    fn zero_with(self, factor: Self) -> Self {
        if factor == 0.0 { 0.0 } else { self }
    }
    #[inline(always)]
    fn sign(self) -> Self {
        if self.is_sign_negative() { -1.0 } else { 1.0 }
    }
    #[inline]
    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }
    #[inline]
    fn ln(self) -> Self {
        libm::log(f64::from(self)) as f32
    }
    #[inline]
    fn powf(self, exponent: f64) -> Self {
        libm::pow(f64::from(self), exponent) as f32
    }
    #[inline]
    fn atan2(self, x: Self) -> Self {
        libm::atan2(f64::from(self), f64::from(x)) as f32
    }
    #[inline]
    fn rem_euclid(self, period: f64) -> Self {
        self.rem_euclid(period as f32)
    }
}

impl Real for f32 {
    #[inline(always)]
    fn value(self) -> f64 {
        f64::from(self)
    }
}

over_itself!([] f64);
over_itself!([] f32);

/// Weights of a double-precision model, rounded to single precision.
impl Over<f64> for f32 {
    #[inline(always)]
    fn embed(parameter: f64) -> Self {
        parameter as f32
    }
    #[inline(always)]
    fn mul_add_parameter(self, parameter: f64, addend: Self) -> Self {
        f32::mul_add(self, parameter as f32, addend)
    }
}
