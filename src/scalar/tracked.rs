//! A value with a bound on its accumulated rounding error.

use super::chebyshev::scales;
use super::{Elementary, Over, Real, Scalar, Series, assigning, over_itself};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number with a first-order bound on the rounding errors made so far, or since the last
/// [`Scalar::without_bound`], in units of u: Wilkinson's running error analysis.
///
/// |computed − exact| ≤ u·`bound` up to terms of order u². The bound assumes
/// the worst at every step: it is rigorous and pessimistic. `Dual<Tracked, N>`
/// bounds the errors of derivatives.
///
/// Source: Higham, Accuracy and Stability of Numerical Algorithms, section 3.3,
/// <https://doi.org/10.1137/1.9780898718027>.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracked {
    /// The value as `f64` computes it.
    pub value: f64,
    /// The bound, in units of u = 2⁻⁵³.
    pub bound: f64,
}

impl Tracked {
    /// A number that counts as exact: its bound is 0.
    #[inline]
    pub fn exact(value: f64) -> Self {
        Self { value, bound: 0.0 }
    }

    /// A result of one more rounding.
    #[inline]
    fn rounded(value: f64, inherited: f64) -> Self {
        Self { value, bound: inherited + value.abs() }
    }

    /// What a function of this slope passes on of the bound: nothing of an exact number,
    /// however steep.
    #[inline]
    fn share(self, slope: f64) -> f64 {
        if self.bound == 0.0 { 0.0 } else { slope.abs() * self.bound }
    }

    /// The bound as an absolute error.
    pub fn error(self) -> f64 {
        self.bound * f64::unit_roundoff()
    }
}

impl Neg for Tracked {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { value: -self.value, ..self }
    }
}

impl Add for Tracked {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self::rounded(self.value + other.value, self.bound + other.bound)
    }
}

impl Sub for Tracked {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Tracked {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        let inherited = self.value.abs() * other.bound + other.value.abs() * self.bound;
        Self::rounded(self.value * other.value, inherited)
    }
}

// Here and below: calls, since a kernel has hundreds of these, and the portable `fma` in most of them is a call
// already.
impl Div for Tracked {
    type Output = Self;
    #[inline(never)]
    fn div(self, other: Self) -> Self {
        let quotient = self.value / other.value;
        let inherited = (self.bound + quotient.abs() * other.bound) / other.value.abs();
        Self::rounded(quotient, inherited)
    }
}

impl Scalar for Tracked {
    fn from_f64(value: f64) -> Self {
        Self::exact(value)
    }
    #[inline(never)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        let inherited = self.value.abs() * a.bound + a.value.abs() * self.bound + b.bound;
        Self::rounded(self.value.mul_add(a.value, b.value), inherited)
    }
    /// tanh errs by 3 ulp ≤ 6u|t|, sech² by 5e-16 < 5u relative.
    fn tanh_sech2(self) -> (Self, Self) {
        let (t, s) = self.value.tanh_sech2();
        let tanh = Self { value: t, bound: s * self.bound + 6.0 * t.abs() };
        let sech2 = Self { value: s, bound: 2.0 * t.abs() * s * self.bound + 5.0 * s };
        (tanh, sech2)
    }
    /// s = 1/(1 + x²) errs by 3u relative, t = xs by 4u; |t′| ≤ s, |s′| = 2|t|s.
    fn lorentzian(self) -> (Self, Self) {
        let (t, s) = self.value.lorentzian();
        let first = Self { value: t, bound: s * self.bound + 4.0 * t.abs() };
        let slope = Self { value: s, bound: 2.0 * t.abs() * s * self.bound + 3.0 * s };
        (first, slope)
    }
    fn without_bound(self) -> Self {
        Self::exact(self.value)
    }
    fn abs(self) -> Self {
        Self { value: self.value.abs(), ..self }
    }
    fn is_zero(self) -> bool {
        self.value == 0.0 && self.bound == 0.0
    }
    fn unit_roundoff() -> f64 {
        f64::unit_roundoff()
    }
}

impl Elementary for Tracked {
    /// Both err by less than 2 ulp, 4u relative.
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = Elementary::sin_cos(self.value);
        let sin = Self { value: s, bound: c.abs() * self.bound + 4.0 * s.abs() };
        let cos = Self { value: c, bound: s.abs() * self.bound + 4.0 * c.abs() };
        (sin, cos)
    }
    /// It errs by less than 2 ulp, 4u relative.
    fn exp(self) -> Self {
        let value = Elementary::exp(self.value);
        Self { value, bound: value * self.bound + 4.0 * value }
    }
    fn zero_with(self, factor: Self) -> Self {
        if factor.is_zero() { Self::exact(0.0) } else { self }
    }
    fn sign(self) -> Self {
        Self::exact(self.value.sign())
    }
    /// The square root is rounded once: its own error is at most u relative.
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        Self::rounded(root, self.share(0.5 / root))
    }
    /// It errs by less than 1 ulp, 2u relative.
    fn ln(self) -> Self {
        let value = Elementary::ln(self.value);
        Self { value, bound: self.share(1.0 / self.value) + 2.0 * value.abs() }
    }
    /// It errs by less than 1 ulp, 2u relative.
    fn powf(self, exponent: f64) -> Self {
        let value = Elementary::powf(self.value, exponent);
        let slope = match exponent {
            0.0 => 0.0,
            _ => exponent * Elementary::powf(self.value, exponent - 1.0),
        };
        Self { value, bound: self.share(slope) + 2.0 * value.abs() }
    }
    /// It errs by less than 2 ulp, 4u relative.
    fn atan2(self, x: Self) -> Self {
        let value = Elementary::atan2(self.value, x.value);
        let square = self.value.mul_add(self.value, x.value * x.value);
        let inherited = self.share(x.value / square) + x.share(self.value / square);
        Self { value, bound: inherited + 4.0 * value.abs() }
    }
    /// The remainder is exact, but where a multiple is added to a negative one.
    fn rem_euclid(self, period: f64) -> Self {
        let value = self.value.rem_euclid(period);
        let inherited = self.bound;
        if self.value < 0.0 { Self::rounded(value, inherited) } else { Self { value, ..self } }
    }
}

impl Real for Tracked {
    fn value(self) -> f64 {
        self.value
    }
    fn inherits(self, known: Self) -> Self {
        let left = self.bound - known.bound;
        Self { bound: if left < 0.0 { 0.0 } else { left }, ..self }
    }
}

assigning!([] Tracked);
over_itself!([] Tracked);

/// The weights of a model count as exact.
impl Over<f64> for Tracked {
    fn embed(parameter: f64) -> Self {
        Self::exact(parameter)
    }
    #[inline(never)]
    fn mul_add_parameter(self, parameter: f64, addend: Self) -> Self {
        let inherited = parameter.abs() * self.bound + addend.bound;
        Self::rounded(self.value.mul_add(parameter, addend.value), inherited)
    }
    fn series_each<const K: usize>(s: [Self; K], series: Series<'_, f64>) -> [Self; K] {
        let [f, _] = Self::series_with_slopes(s, series);
        f
    }
    fn series_with_slopes<const K: usize>(s: [Self; K], series: Series<'_, f64>) -> [[Self; K]; 2] {
        let [f, slope, curvature] = f64::series_with_curvatures(s.map(|s| s.value), series);
        let mut out = [s; 2];
        for k in 0..K {
            let own = scales(s[k].value, series.from(k));
            out[0][k] = Self { value: f[k], bound: s[k].share(slope[k]) + own.value };
            out[1][k] = Self { value: slope[k], bound: s[k].share(curvature[k]) + own.slope };
        }
        out
    }
}
