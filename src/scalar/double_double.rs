//! Double-double numbers: some 31 decimal digits as the unevaluated sum of two doubles.

use super::{Elementary, Over, Real, Scalar, assigning, over_itself};
use qd::Quad;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A double-double number: a defect that is due to rounding is 2⁵³ times
/// smaller than in `f64`.
///
/// Sums and products have errors of a few 2⁻¹⁰⁶ (the accurate sum of the `qd`
/// crate, not its `+`); `mul_add` is a product and a sum. tanh, sech², sine, cosine
/// and exponential are implemented here, to within 2⁻¹⁰² relative
/// (to `f64` accuracy beyond e⁷⁰⁹). The range is that of `f64`,
/// less some 16 digits at its lower end.
///
/// Source: Dekker, <https://doi.org/10.1007/BF01397083>; Joldes, Muller and Popescu,
/// <https://doi.org/10.1145/3121432>, for the errors of sums and products.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubleDouble(Quad);

/// Terms of the series of exp, sinh, cosh, sin and cos: 0.8³⁰/30! < 2⁻¹¹⁰.
const TERMS: u32 = 30;

/// ln 2 and π/2 to 159 bits, as sums of doubles.
const LN_2: [f64; 3] = [Quad::LN_2.0, Quad::LN_2.1, 5.707_708_438_416_212e-34];
const HALF_PI: [f64; 3] = [Quad::PI.0 / 2.0, Quad::PI.1 / 2.0, -1.497_384_904_859_17e-33];

impl DoubleDouble {
    const ONE: Self = Self(Quad::ONE);

    /// The sum of two doubles.
    pub fn new(high: f64, low: f64) -> Self {
        Self(Quad::from_f64(high).add_accurate(Quad::from_f64(low)))
    }

    /// The high and the low part.
    pub fn parts(self) -> (f64, f64) {
        (self.0.0, self.0.1)
    }

    fn scaled(self, factor: f64) -> Self {
        // Powers of two only: exact.
        Self(Quad(self.0.0 * factor, self.0.1 * factor))
    }

    /// Σ x^k/k! over k = first, first + 2, … with alternating signs or not.
    fn every_other_term(self, first: u32, alternating: bool) -> Self {
        let square = self * self;
        let square = if alternating { -square } else { square };
        let mut sum = Self::ONE;
        let mut k = first + TERMS;
        while k > first {
            let divisor = f64::from(k * (k - 1));
            sum = Self::ONE + square * sum / Self::from_f64(divisor);
            k -= 2;
        }
        if first == 1 { self * sum } else { sum }
    }

    /// x − k·(the sum of `period`) for the nearest integer k; (k, rest). The
    /// products with the first two parts are exact.
    fn reduced(self, period: [f64; 3]) -> (f64, Self) {
        let k = libm::round(self.0.0 / period[0]);
        let mut rest = self;
        for part in period {
            rest -= Self::from_f64(k) * Self::from_f64(part);
        }
        (k, rest)
    }
}

impl Neg for DoubleDouble {
    type Output = Self;
    fn neg(self) -> Self {
        Self(self.0.neg())
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0.add_accurate(other.0))
    }
}

impl Sub for DoubleDouble {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0.sub_accurate(other.0))
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self(self.0.mul(other.0))
    }
}

impl Div for DoubleDouble {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        Self(self.0.div(other.0))
    }
}

impl Scalar for DoubleDouble {
    fn from_f64(value: f64) -> Self {
        Self(Quad::from_f64(value))
    }

    fn mul_add(self, a: Self, b: Self) -> Self {
        self * a + b
    }

    /// By the series of sinh and cosh up to ½, by E = e^{−2|x|} beyond.
    fn tanh_sech2(self) -> (Self, Self) {
        let a = self.abs();
        let one = Self::ONE;
        if self.0.0.is_nan() {
            return (self, self);
        }
        let (t, s) = if a.0.0 <= 0.5 {
            let (sinh, cosh) = (a.every_other_term(1, false), a.every_other_term(0, false));
            (sinh / cosh, one / (cosh * cosh))
        } else {
            let e = (-a.scaled(2.0)).exp();
            let sum = one + e;
            ((one - e) / sum, e.scaled(4.0) / (sum * sum))
        };
        (if self.0.0.is_sign_negative() { -t } else { t }, s)
    }

    fn abs(self) -> Self {
        if self.0.0.is_sign_negative() { -self } else { self }
    }

    fn is_zero(self) -> bool {
        self.0.0 == 0.0
    }

    /// The unit roundoff of double-doubles, 2⁻¹⁰⁶.
    fn unit_roundoff() -> f64 {
        (f64::EPSILON / 2.0) * (f64::EPSILON / 2.0)
    }
}

impl Elementary for DoubleDouble {
    /// For |x| up to 2⁵⁰.
    fn sin_cos(self) -> (Self, Self) {
        let (k, rest) = self.reduced(HALF_PI);
        let (s, c) = (rest.every_other_term(1, true), rest.every_other_term(0, true));
        match k.rem_euclid(4.0) as u8 {
            0 => (s, c),
            1 => (c, -s),
            2 => (-s, -c),
            _ => (-c, s),
        }
    }

    fn exp(self) -> Self {
        if self.0.0 > 709.0 {
            return Self::from_f64(libm::exp(self.0.0));
        }
        if self.0.0 < -745.0 {
            return Self::from_f64(0.0);
        }
        let (k, rest) = self.reduced(LN_2);
        let mut sum = Self::ONE;
        for j in (1..=TERMS).rev() {
            sum = Self::ONE + rest * sum / Self::from_f64(f64::from(j));
        }
        let half = libm::trunc(k / 2.0);
        sum.scaled(libm::exp2(half)).scaled(libm::exp2(k - half))
    }

    fn zero_with(self, factor: Self) -> Self {
        if factor.is_zero() { Self::zero() } else { self }
    }

    fn sign(self) -> Self {
        Self::from_f64(self.0.0.sign())
    }

    /// By one step of Newton's method from that of the high part, as what follows.
    fn sqrt(self) -> Self {
        let root = Self::from_f64(self.0.0.sqrt());
        match root.0.0 {
            value if value > 0.0 && value.is_finite() => {
                root + (self - root * root) / root.scaled(2.0)
            }
            _ => root,
        }
    }

    /// By the series of 2 artanh((x − 1)/(x + 1)) next to 1.
    fn ln(self) -> Self {
        let x = self.0.0;
        if (0.7..1.4).contains(&x) {
            let s = (self - Self::ONE) / (self + Self::ONE);
            let square = s * s;
            let mut sum = Self::zero();
            for k in (0..TERMS).rev() {
                sum = square * sum + Self::ONE / Self::from_f64(f64::from(2 * k + 1));
            }
            return s.scaled(2.0) * sum;
        }
        let first = Self::from_f64(Elementary::ln(x));
        if !first.0.0.is_finite() {
            return first;
        }
        // In two factors, so that neither leaves the range.
        let half = (-first.scaled(0.5)).exp();
        first + (self * half * half - Self::ONE)
    }

    /// Integers by products; else e^(p ln x).
    fn powf(self, exponent: f64) -> Self {
        if exponent == exponent.trunc() && exponent.abs() <= f64::from(i32::MAX) {
            return self.powi(exponent as i32);
        }
        match self.0.0 {
            value if value > 0.0 && value.is_finite() => {
                (self.ln() * Self::from_f64(exponent)).exp()
            }
            value => Self::from_f64(Elementary::powf(value, exponent)),
        }
    }

    fn atan2(self, x: Self) -> Self {
        let first = Self::from_f64(libm::atan2(self.0.0, x.0.0));
        let radius = (self * self + x * x).sqrt();
        if radius.0.0 > 0.0 && radius.0.0.is_finite() {
            let (sin, cos) = first.sin_cos();
            first + (self * cos - x * sin) / radius
        } else {
            first
        }
    }

    fn rem_euclid(self, period: f64) -> Self {
        let (high, low) = self.parts();
        // The remainder of a double is exact.
        let rest = Self::new(high.rem_euclid(period), low);
        let size = Self::from_f64(period.abs());
        match rest.0.0 {
            value if value < 0.0 => rest + size,
            value if value >= period.abs() => rest - size,
            _ => rest,
        }
    }
}

impl Real for DoubleDouble {
    fn value(self) -> f64 {
        self.0.0 + self.0.1
    }
}

assigning!([] DoubleDouble);
over_itself!([] DoubleDouble);

/// Weights of a double-precision model, exactly.
impl Over<f64> for DoubleDouble {
    fn embed(parameter: f64) -> Self {
        Self::from_f64(parameter)
    }
    fn mul_add_parameter(self, parameter: f64, addend: Self) -> Self {
        self.mul_add(Self::from_f64(parameter), addend)
    }
}
