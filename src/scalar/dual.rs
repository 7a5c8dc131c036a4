//! Forward-mode dual numbers over any scalar.

use super::{Elementary, Over, Real, Scalar, Series, Task, assigning, over_itself};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// `re + Σ eps[k]·dₖ` with dₖdₗ = 0: a value and its derivatives in `N`
/// directions.
///
/// Every derivative is exact up to rounding; nothing is truncated. Duals nest
/// (`Dual<Dual<S, N>, M>` has second derivatives).
///
/// Source: Griewank and Walther, Evaluating Derivatives, <https://doi.org/10.1137/1.9780898717761>,
/// chapter 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<S, const N: usize> {
    /// The value of the number, without derivatives.
    pub re: S,
    /// The derivatives of the value in N directions.
    pub eps: [S; N],
}

/// Variables made so far by this process.
#[cfg(debug_assertions)]
static VARIABLES: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(0);

#[inline(always)]
fn count_variable() {
    #[cfg(debug_assertions)]
    VARIABLES.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
}

/// How many variables this process has made with [`Dual::variable`]: none where no
/// Jacobian is asked for. Counted in builds with debug assertions, None in others.
#[doc(hidden)]
pub fn dual_variables_made() -> Option<u64> {
    #[cfg(debug_assertions)]
    return Some(VARIABLES.load(std::sync::atomic::Ordering::Relaxed));
    #[cfg(not(debug_assertions))]
    None
}

impl<S: Scalar, const N: usize> Dual<S, N> {
    /// A constant: all derivatives zero.
    #[inline(always)]
    pub fn constant(re: S) -> Self {
        Self { re, eps: [S::zero(); N] }
    }

    /// The variable number `direction`: derivative one in that direction.
    /// A direction ≥ N gives a constant.
    #[inline(always)]
    pub fn variable(re: S, direction: usize) -> Self {
        count_variable();
        let mut out = Self::constant(re);
        if let Some(slot) = out.eps.get_mut(direction) {
            *slot = S::from_f64(1.0);
        }
        out
    }

    /// f(x) from f and f′ at the real part.
    #[inline(always)]
    fn chain(self, value: S, slope: S) -> Self {
        let mut eps = self.eps;
        for e in &mut eps {
            *e *= slope;
        }
        Self { re: value, eps }
    }

    #[inline(always)]
    fn zip(self, other: Self, re: S, f: impl Fn(S, S) -> S) -> Self {
        let mut eps = self.eps;
        for i in 0..N {
            eps[i] = f(eps[i], other.eps[i]);
        }
        Self { re, eps }
    }
}

/// From so many derivatives on an operation is a function of its own where debug assertions are on: a step of a layer
/// has hundreds of operations, and takes long to compile with all of them in it. In a release build it would take a
/// fifth longer to run.
const MANY: usize = if cfg!(debug_assertions) { 8 } else { usize::MAX };

/// An operation of two duals: in its place, and as a function of its own.
macro_rules! operator {
    ($Trait:ident, $operation:ident, $apart:ident, |$x:ident, $y:ident| $body:expr) => {
        impl<S: Scalar, const N: usize> $Trait for Dual<S, N> {
            type Output = Self;
            #[inline(always)]
            fn $operation(self, other: Self) -> Self {
                if const { N >= MANY } {
                    return $apart(self, other);
                }
                let ($x, $y) = (self, other);
                $body
            }
        }

        #[inline(never)]
        fn $apart<S: Scalar, const N: usize>($x: Dual<S, N>, $y: Dual<S, N>) -> Dual<S, N> {
            $body
        }
    };
}

operator!(Add, add, add_apart, |x, y| x.zip(y, x.re + y.re, |a, b| a + b));
operator!(Sub, sub, sub_apart, |x, y| x.zip(y, x.re - y.re, |a, b| a - b));
operator!(Mul, mul, mul_apart, |x, y| x.zip(y, x.re * y.re, |a, b| a.mul_add(y.re, x.re * b)));
operator!(Div, div, div_apart, |x, y| {
    let quotient = x.re / y.re;
    x.zip(y, quotient, |a, b| (-quotient).mul_add(b, a) / y.re)
});

/// The product and sum x·y + z of dual numbers, by fused operations.
#[inline(always)]
fn fused<S: Scalar, const N: usize>(x: Dual<S, N>, y: Dual<S, N>, z: Dual<S, N>) -> Dual<S, N> {
    let mut eps = z.eps;
    for k in 0..N {
        eps[k] = x.eps[k].mul_add(y.re, x.re.mul_add(y.eps[k], eps[k]));
    }
    Dual { re: x.re.mul_add(y.re, z.re), eps }
}

#[inline(never)]
fn fused_apart<S: Scalar, const N: usize>(
    x: Dual<S, N>,
    y: Dual<S, N>,
    z: Dual<S, N>,
) -> Dual<S, N> {
    fused(x, y, z)
}

impl<S: Scalar, const N: usize> Neg for Dual<S, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let mut eps = self.eps;
        for e in &mut eps {
            *e = -*e;
        }
        Self { re: -self.re, eps }
    }
}

impl<S: Scalar, const N: usize> Scalar for Dual<S, N> {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self::constant(S::from_f64(value))
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        if const { N >= MANY } {
            return fused_apart(self, a, b);
        }
        fused(self, a, b)
    }
    #[inline(always)]
    fn outlined(task: impl Task) {
        S::outlined(task);
    }
    #[inline(always)]
    fn tanh_sech2(self) -> (Self, Self) {
        let ([t], [s]) = Self::tanh_sech2_each([self]);
        (t, s)
    }
    #[inline(always)]
    fn tanh_sech2_each<const K: usize>(x: [Self; K]) -> ([Self; K], [Self; K]) {
        let mut values = [S::zero(); K];
        for i in 0..K {
            values[i] = x[i].re;
        }
        let (t, s) = S::tanh_sech2_each(values);
        let (mut tanh, mut sech2) = (x, x);
        for i in 0..K {
            let slope = S::from_f64(-2.0) * t[i] * s[i];
            tanh[i] = x[i].chain(t[i], s[i]);
            sech2[i] = x[i].chain(s[i], slope);
        }
        (tanh, sech2)
    }
    #[inline(always)]
    fn lorentzian(self) -> (Self, Self) {
        let ([t], [s]) = Self::lorentzian_each([self]);
        (t, s)
    }
    /// s′ = −2ts and t′ = s − 2t² = s(2s − 1).
    #[inline(always)]
    fn lorentzian_each<const K: usize>(x: [Self; K]) -> ([Self; K], [Self; K]) {
        let mut values = [S::zero(); K];
        for i in 0..K {
            values[i] = x[i].re;
        }
        let (t, s) = S::lorentzian_each(values);
        let (mut first, mut slope) = (x, x);
        for i in 0..K {
            let twice = S::from_f64(2.0) * s[i];
            first[i] = x[i].chain(t[i], twice.mul_add(s[i], -s[i]));
            slope[i] = x[i].chain(s[i], -(twice * t[i]));
        }
        (first, slope)
    }
    #[inline(always)]
    fn without_bound(self) -> Self {
        let mut eps = self.eps;
        for k in 0..N {
            eps[k] = eps[k].without_bound();
        }
        Self { re: self.re.without_bound(), eps }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // |x| = x·(|x|/x): the derivative follows the sign of the real part.
        let magnitude = self.re.abs();
        let sign = if self.re.is_zero() { S::zero() } else { magnitude / self.re };
        self.chain(magnitude, sign)
    }
    #[inline(always)]
    fn is_zero(self) -> bool {
        self.re.is_zero() && self.eps.iter().all(|e| e.is_zero())
    }
    fn unit_roundoff() -> f64 {
        S::unit_roundoff()
    }
}

impl<S: Elementary, const N: usize> Elementary for Dual<S, N> {
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.re.sin_cos();
        (self.chain(s, c), self.chain(c, -s))
    }
    /// Where eˣ is zero its derivatives are, also those of an infinite x.
    #[inline(always)]
    fn exp(self) -> Self {
        let e = self.re.exp();
        let mut out = self.chain(e, e);
        for slope in &mut out.eps {
            *slope = slope.zero_with(e);
        }
        out
    }
    #[inline(always)]
    fn zero_with(self, factor: Self) -> Self {
        let mut out = self;
        out.re = self.re.zero_with(factor.re);
        for i in 0..N {
            // (factor·other)′ is 0 where the factor is, with its derivative.
            out.eps[i] = out.eps[i].zero_with(factor.re.abs() + factor.eps[i].abs());
        }
        out
    }
    #[inline(always)]
    fn sign(self) -> Self {
        Self { re: self.re.sign(), eps: [S::zero(); N] }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.re.sqrt();
        self.chain(root, S::from_f64(0.5) / root)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        self.chain(self.re.ln(), S::from_f64(1.0) / self.re)
    }
    /// With a slope of 0 for an exponent of 0, also at 0.
    #[inline(always)]
    fn powf(self, exponent: f64) -> Self {
        let slope = match exponent {
            0.0 => S::zero(),
            _ => S::from_f64(exponent) * self.re.powf(exponent - 1.0),
        };
        self.chain(self.re.powf(exponent), slope)
    }
    /// (x·y′ − y·x′)/(x² + y²).
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        let square = self.re.mul_add(self.re, x.re * x.re);
        let (across, along) = (x.re / square, -self.re / square);
        self.zip(x, self.re.atan2(x.re), |y, x| y.mul_add(across, x * along))
    }
    #[inline(always)]
    fn rem_euclid(self, period: f64) -> Self {
        Self { re: self.re.rem_euclid(period), ..self }
    }
}

impl<S: Real, const N: usize> Real for Dual<S, N> {
    #[inline(always)]
    fn value(self) -> f64 {
        self.re.value()
    }
    #[inline(always)]
    fn inherits(self, known: Self) -> Self {
        self.zip(known, self.re.inherits(known.re), S::inherits)
    }
}

assigning!([S: Scalar, const N: usize] Dual<S, N>);
over_itself!([S: Elementary, const N: usize] Dual<S, N>);

/// Constant weights: no derivative of theirs is formed.
impl<S: Over<f64>, const N: usize> Over<f64> for Dual<S, N> {
    #[inline(always)]
    fn embed(parameter: f64) -> Self {
        Self::constant(S::embed(parameter))
    }
    #[inline(always)]
    fn mul_add_parameter(self, parameter: f64, addend: Self) -> Self {
        self.zip(addend, self.re.mul_add_parameter(parameter, addend.re), |a, b| {
            a.mul_add_parameter(parameter, b)
        })
    }
    #[inline(always)]
    fn times(self, parameter: f64) -> Self {
        let mut eps = self.eps;
        for e in &mut eps {
            *e = e.times(parameter);
        }
        Self { re: self.re.times(parameter), eps }
    }
    #[inline(always)]
    fn series_each<const K: usize>(s: [Self; K], series: Series<'_, f64>) -> [Self; K] {
        let [f, slope] = S::series_with_slopes(values(s), series);
        chain_each(s, f, slope)
    }
    #[inline(always)]
    fn series_with_slopes<const K: usize>(s: [Self; K], series: Series<'_, f64>) -> [[Self; K]; 2] {
        let [f, slope, curvature] = S::series_with_curvatures(values(s), series);
        [chain_each(s, f, slope), chain_each(s, slope, curvature)]
    }
}

/// Weights with derivatives by variables that those of a point are not: of a control, say.
impl<S: Elementary, const M: usize, const N: usize> Over<Dual<S, M>> for Dual<Dual<S, M>, N> {
    #[inline(always)]
    fn embed(parameter: Dual<S, M>) -> Self {
        Self::constant(parameter)
    }
    #[inline(always)]
    fn mul_add_parameter(self, parameter: Dual<S, M>, addend: Self) -> Self {
        self.zip(addend, self.re.mul_add(parameter, addend.re), |a, b| a.mul_add(parameter, b))
    }
    #[inline(always)]
    fn times(self, parameter: Dual<S, M>) -> Self {
        let mut eps = self.eps;
        for e in &mut eps {
            *e *= parameter;
        }
        Self { re: self.re * parameter, eps }
    }
}

/// The real parts of K dual numbers.
#[inline(always)]
fn values<S: Scalar, const K: usize, const N: usize>(x: [Dual<S, N>; K]) -> [S; K] {
    let mut out = [S::zero(); K];
    for k in 0..K {
        out[k] = x[k].re;
    }
    out
}

/// f(x) of each from f and f′ at the real parts.
#[inline(always)]
fn chain_each<S: Scalar, const K: usize, const N: usize>(
    x: [Dual<S, N>; K],
    value: [S; K],
    slope: [S; K],
) -> [Dual<S, N>; K] {
    let mut out = x;
    for k in 0..K {
        out[k] = x[k].chain(value[k], slope[k]);
    }
    out
}
