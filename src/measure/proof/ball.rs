//! Balls: intervals of real numbers around a double-double centre.

use super::number::{Constant, Function, Number};
use super::rough::Rough;
use super::rounded::{Complex, down, up};
use std::sync::LazyLock;

/// 2⁻¹⁰³, more than the relative error of a sum or a product of double-doubles.
const ROUNDING: f64 = 1.0 / ((1_u128 << 103) as f64);

#[inline(always)]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let t = s - a;
    (s, (a - (s - t)) + (b - t))
}

#[inline(always)]
fn fast_two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    (s, b - (s - a))
}

#[inline(always)]
fn split(a: f64) -> (f64, f64) {
    let c = 134_217_729.0 * a;
    let high = c - (c - a);
    (high, a - high)
}

/// a·b and its error, exact where neither overflows nor the error is below 2⁻¹⁰⁷⁴.
#[inline(always)]
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let p = a * b;
    let ((ah, al), (bh, bl)) = (split(a), split(b));
    (p, ((ah * bh - p) + ah * bl + al * bh) + al * bl)
}

/// All real numbers no further from a centre than a radius. The centre is the unevaluated sum of two doubles, so that
/// a result is enclosed to some 30 digits.
///
/// Each operation holds the results for all numbers in its arguments: the radius takes up what rounding does to
/// the centre. What is not finite, or a division by a ball with 0 in it, has the radius ∞ or NaN, with which no
/// comparison that a proof makes is true.
///
/// Source: for the errors of sums (3·2⁻¹⁰⁶, relative) and products (7·2⁻¹⁰⁶) of double-doubles Joldes, Muller and
/// Popescu, <https://doi.org/10.1145/3121432>, algorithms 6 and 10; 2⁻¹⁰³ is allowed for either.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    high: f64,
    low: f64,
    radius: f64,
}

/// 1/k!, for the series.
const TERMS: usize = 34;
static INVERSE_FACTORIALS: LazyLock<[Ball; TERMS]> = LazyLock::new(|| {
    let mut out = [Ball::of(1.0); TERMS];
    for k in 2..TERMS {
        out[k] = out[k - 1].over(Ball::of(k as f64));
    }
    out
});

/// 2^{j/32}: the squares of roots.
static ROOTS_OF_TWO: LazyLock<[Ball; 32]> = LazyLock::new(|| {
    let mut root = Ball::of(2.0);
    for _ in 0..5 {
        root = root.sqrt();
    }
    let mut out = [Ball::of(1.0); 32];
    for j in 1..32 {
        out[j] = out[j - 1].times(root);
    }
    out
});

impl Ball {
    /// π.
    pub const PI: Self =
        Self { high: std::f64::consts::PI, low: 1.224_646_799_147_353_2e-16, radius: 3.1e-33 };
    /// 2π.
    pub const TAU: Self =
        Self { high: std::f64::consts::TAU, low: 2.449_293_598_294_706_4e-16, radius: 6.2e-33 };
    const LN_2: Self =
        Self { high: std::f64::consts::LN_2, low: 2.319_046_813_846_299_6e-17, radius: 5.8e-34 };

    /// The sum of two doubles, with the radius.
    pub fn new(high: f64, low: f64, radius: f64) -> Self {
        let (high, low) = two_sum(high, low);
        Self { high, low, radius }
    }

    /// The centre, rounded to a double.
    pub fn centre(self) -> f64 {
        self.high
    }

    /// The centre: its high and its low part.
    pub fn parts(self) -> [f64; 2] {
        [self.high, self.low]
    }

    /// As a factor of other kinds of numbers.
    pub fn constant(self) -> Constant {
        Constant { high: self.high, low: self.low, radius: self.radius }
    }

    /// The radius.
    pub fn radius(self) -> f64 {
        self.radius
    }

    /// Its centre alone.
    pub fn exact(self) -> Self {
        Self { radius: 0.0, ..self }
    }

    /// An upper bound of the absolute values in it.
    #[inline(always)]
    pub fn magnitude(self) -> f64 {
        up(up(self.high.abs()) + self.radius)
    }

    /// A lower bound of the absolute values in it, 0 where 0 is in it.
    #[inline(always)]
    pub fn mignitude(self) -> f64 {
        down(down(self.high.abs()) - self.radius)
    }

    /// No number in it is below this one.
    pub fn lower(self) -> f64 {
        let low = self.high - up(self.high.abs() * f64::EPSILON + self.radius);
        low - low.abs() * f64::EPSILON - f64::MIN_POSITIVE
    }

    /// No number in it is above this one.
    pub fn upper(self) -> f64 {
        -self.negated().lower()
    }

    /// The opposite.
    pub fn negated(self) -> Self {
        Self { high: -self.high, low: -self.low, ..self }
    }

    /// With so much more around it.
    pub fn widened(self, by: f64) -> Self {
        Self { radius: up(self.radius + by), ..self }
    }

    /// The rounding of the centre that a result has come out at.
    #[inline(always)]
    fn rounding(high: f64) -> f64 {
        up(high.abs() * ROUNDING)
    }

    /// The quotient: q + (x − qy)/y with a rounded q.
    pub fn over(self, y: Self) -> Self {
        let first = self.high / y.high;
        let rest = self.exact().minus(y.exact().scaled(first));
        let q = Self::new(first, rest.high / y.high, 0.0);
        let missed = self.minus(q.times(y)).magnitude();
        Self { radius: up(missed / y.mignitude()), ..q }
    }

    /// The square root: q + (x − q²)/(√x + q) with a rounded q; NaN of a ball with what is not positive in it.
    pub fn sqrt(self) -> Self {
        let first = self.high.sqrt();
        let rest = self.exact().minus(Self::of(first).times(Self::of(first)));
        let q = Self::new(first, rest.high / (2.0 * first), 0.0);
        let missed = self.minus(q.times(q)).magnitude();
        let below = down(down(self.lower().sqrt()) + q.mignitude());
        Self { radius: if self.lower() > 0.0 { up(missed / below) } else { f64::NAN }, ..q }
    }

    /// Σ x^k/k! over k = first, first + step, … ≤ last.
    fn horner(self, first: usize, step: usize, alternating: bool, last: usize) -> Self {
        let inverse = &*INVERSE_FACTORIALS;
        let mut power = if step == 2 { self.times(self) } else { self };
        if alternating {
            power = power.negated();
        }
        let mut k = first + (last - first) / step * step;
        let mut sum = inverse[k];
        while k > first {
            k -= step;
            sum = sum.times(power).plus(inverse[k]);
        }
        if first == 1 { sum.times(self) } else { sum }
    }

    /// k and x − k·period of the centre, for the nearest whole k.
    fn reduced(self, period: Self) -> (f64, Self) {
        let k = libm::round(self.high / period.high);
        (k, self.exact().minus(period.scaled(k)))
    }

    /// e^x = 2^k·2^{j/32}·e^r, |r| ≤ ln 2/64, for x ≤ 600; beyond it the radius is NaN.
    ///
    /// The factor of a radius ε is e^ε − 1 ≤ ε + ε² for ε ≤ 1.
    pub fn exp(self) -> Self {
        if self.high < -600.0 && self.radius <= 1.0 {
            return Self::of(0.0).widened(1e-258);
        }
        if !(self.high.abs() <= 600.0 && self.radius <= 1.0) {
            return Self { radius: f64::NAN, ..self };
        }
        let (n, rest) = self.reduced(Self::LN_2.scaled(1.0 / 32.0));
        let n = n as i32;
        // 0.011¹⁴/14! < 10⁻³⁸, the rest of the series less than twice that.
        let series = rest.horner(0, 1, false, 13).widened(2e-38);
        let root = ROOTS_OF_TWO[n.rem_euclid(32) as usize];
        let centre = series.times(root).scaled(libm::ldexp(1.0, n.div_euclid(32)));
        let r = self.radius;
        centre.widened(up(centre.magnitude() * up(r + up(r * r))))
    }

    /// tanh x = (1 − e)/(1 + e), e = exp(−2x), at the centre; its slope is at most 1.
    fn tanh_of_centre(self) -> Self {
        // 1 − tanh x < 2e^{−2x} < 1.03·10⁻¹³⁰.
        if self.high > 150.0 {
            return Self::of(1.0).widened(2e-130);
        }
        let one = Self::of(1.0);
        let e = self.exact().scaled(-2.0).exp();
        one.minus(e).over(one.plus(e))
    }
}

impl Number for Ball {
    fn of(value: f64) -> Self {
        Self { high: value, low: 0.0, radius: 0.0 }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        let (sum, error) = two_sum(self.high, other.high);
        let (low, rest) = two_sum(self.low, other.low);
        let (high, low) = fast_two_sum(sum, error + low);
        let (high, low) = fast_two_sum(high, rest + low);
        let radius = up(up(self.radius + other.radius) + Self::rounding(high));
        Self { high, low, radius }
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self.plus(other.negated())
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        let (product, error) = two_product(self.high, other.high);
        let low = error + (self.high * other.low + self.low * other.high);
        let (high, low) = fast_two_sum(product, low);
        let (a, b) = (up(self.high.abs()), up(other.high.abs()));
        let spread = up(up(a * other.radius) + up(up(b + other.radius) * self.radius));
        Self { high, low, radius: up(spread + Self::rounding(high)) }
    }

    #[inline(always)]
    fn scaled(self, factor: f64) -> Self {
        self.times(Self::of(factor))
    }

    fn scaled_by(self, factor: Constant) -> Self {
        self.times(Self { high: factor.high, low: factor.low, radius: factor.radius })
    }

    fn tanh(self) -> Self {
        let x = if self.high < 0.0 { self.negated() } else { self };
        let t = x.tanh_of_centre().widened(self.radius);
        if self.high < 0.0 { t.negated() } else { t }
    }

    /// Their slopes are at most 1.
    fn sin_cos(self) -> (Self, Self) {
        let half = Self::PI.scaled(0.5);
        let (k, rest) = self.reduced(half);
        if !(k.abs() <= 1e9) {
            let all = Self::of(0.0).widened(1.0);
            return (all, all);
        }
        // 0.8³⁴/34! < 10⁻⁴¹, the rest of either series less than twice that.
        let series = |first| rest.horner(first, 2, true, TERMS - 1).widened(1e-40);
        let (s, c) = (series(1), series(0));
        let (s, c) = match (k as i64).rem_euclid(4) {
            0 => (s, c),
            1 => (c, s.negated()),
            2 => (s.negated(), c.negated()),
            _ => (c.negated(), s),
        };
        (s.widened(self.radius), c.widened(self.radius))
    }

    /// f(x + e) is no further than |e| sup |f′| from f(x): bounds of the slopes are those of discs of doubles.
    fn through<const K: usize>(self, function: &impl Function) -> [Self; K] {
        let mut out: [Self; K] = function.derivatives(self.exact());
        if self.radius != 0.0 {
            let centre = Complex::new(self.high, 0.0);
            let rough = Rough::new(centre, up(self.low.abs() + self.radius));
            let [_, slopes @ ..]: [Rough; 4] = function.derivatives(rough);
            for k in 0..K {
                out[k] = out[k].widened(up(self.radius * slopes[k].magnitude()));
            }
        }
        out
    }
}
