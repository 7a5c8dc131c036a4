//! Ball arithmetic: intervals of real numbers around sums of two or three doubles.

use super::centre::{Centre, ThreeWords, TwoWords};
use super::number::{Constant, Function, Number};
use super::rough::Rough;
use super::rounded::{Complex, down, up};
use std::sync::LazyLock;

/// A ball: all real numbers within a radius of a centre. The centre is the unevaluated sum of two or three doubles, so
/// results are enclosed to some 30 or 45 digits.
///
/// The result of an operation contains the results for all numbers in its arguments; the rounding of the centre is
/// added to the radius. A result that is not finite, or a division by a ball that contains 0, has the radius ∞ or NaN,
/// which makes every comparison in a proof false.
///
/// Source: the arithmetic of two doubles of Joldes, Muller and Popescu, <https://doi.org/10.1145/3121432>.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BallOf<C> {
    centre: C,
    radius: f64,
}

/// A ball around a sum of two doubles.
pub type Ball = BallOf<TwoWords>;
/// A ball around a sum of three.
pub type FineBall = BallOf<ThreeWords>;

/// A kind of centres that balls are made around, with its constants.
#[doc(hidden)]
pub trait BallCentre: Centre {
    /// A ball that contains the number π.
    const PI: BallOf<Self>;
    /// A ball that contains the number 2π.
    const TAU: BallOf<Self>;
    /// A ball that contains the natural logarithm ln 2.
    const LN_2: BallOf<Self>;
    /// Constants from which the series and the argument reductions of balls are made.
    fn tables() -> &'static Tables<Self>;
    /// A constant, around this many doubles.
    fn constant(constant: Constant) -> BallOf<Self>;
}

/// What series and reductions are made of.
#[doc(hidden)]
pub struct Tables<C> {
    /// Balls that contain 1/k!, for k from 0 on.
    inverse_factorials: Vec<BallOf<C>>,
    /// Balls that contain 2^{j/32}, for j from 0 to 31.
    roots_of_two: Vec<BallOf<C>>,
}

impl<C: BallCentre> Tables<C> {
    fn new() -> Self {
        let mut inverse_factorials = vec![BallOf::of(1.0); 2];
        for k in 2..C::TRIGONOMETRIC.0 {
            inverse_factorials.push(inverse_factorials[k - 1].divided_by(BallOf::of(k as f64)));
        }
        let mut root = BallOf::of(2.0);
        for _ in 0..5 {
            root = root.sqrt();
        }
        let mut roots_of_two = vec![BallOf::of(1.0)];
        for j in 1..32 {
            roots_of_two.push(roots_of_two[j - 1].times(root));
        }
        Self { inverse_factorials, roots_of_two }
    }
}

static OF_TWO: LazyLock<Tables<TwoWords>> = LazyLock::new(Tables::new);
static OF_THREE: LazyLock<Tables<ThreeWords>> = LazyLock::new(Tables::new);

const PI: [f64; 3] =
    [std::f64::consts::PI, 1.224_646_799_147_353_2e-16, -2.994_769_809_718_339_7e-33];
const LN_2: [f64; 3] =
    [std::f64::consts::LN_2, 2.319_046_813_846_299_6e-17, 5.707_708_438_416_212e-34];

impl BallCentre for TwoWords {
    const PI: Ball = Ball { centre: Self::from_parts(PI[0], PI[1]), radius: 3.1e-33 };
    const TAU: Ball = Ball { centre: Self::from_parts(2.0 * PI[0], 2.0 * PI[1]), radius: 6.2e-33 };
    const LN_2: Ball = Ball { centre: Self::from_parts(LN_2[0], LN_2[1]), radius: 5.8e-34 };

    fn tables() -> &'static Tables<Self> {
        &OF_TWO
    }

    #[inline(always)]
    fn constant(constant: Constant) -> Ball {
        let Constant { high, low, radius, .. } = constant;
        Ball { centre: Self::from_parts(high, low), radius }
    }
}

impl BallCentre for ThreeWords {
    const PI: FineBall = FineBall { centre: Self::from_parts(PI), radius: 1.15e-49 };
    const TAU: FineBall = FineBall {
        centre: Self::from_parts([2.0 * PI[0], 2.0 * PI[1], 2.0 * PI[2]]),
        radius: 2.3e-49,
    };
    const LN_2: FineBall = FineBall { centre: Self::from_parts(LN_2), radius: 3.6e-50 };

    fn tables() -> &'static Tables<Self> {
        &OF_THREE
    }

    #[inline(always)]
    fn constant(constant: Constant) -> FineBall {
        let (words, radius) = constant.fine;
        FineBall { centre: Self::from_parts(words), radius }
    }
}

impl<C: BallCentre> BallOf<C> {
    /// A ball that contains the number π.
    pub const PI: Self = C::PI;
    /// A ball that contains the number 2π.
    pub const TAU: Self = C::TAU;

    /// A ball around the sum of the first doubles of `words`, as many as its centre has.
    pub fn around(words: [f64; 3], radius: f64) -> Self {
        Self { centre: C::of_words(words), radius }
    }

    /// The centre, rounded to a double.
    pub fn centre(self) -> f64 {
        self.centre.first()
    }

    /// The centre: the doubles that it is the sum of, the larger ones first.
    pub fn parts(self) -> [f64; 3] {
        self.centre.parts()
    }

    /// The radius of the ball, an upper bound of the distance from its centre.
    pub fn radius(self) -> f64 {
        self.radius
    }

    /// The centre as a ball of radius 0.
    pub fn exact(self) -> Self {
        Self { radius: 0.0, ..self }
    }

    /// An upper bound of the absolute values in it.
    #[inline(always)]
    pub fn magnitude(self) -> f64 {
        up(self.centre.magnitude() + self.radius)
    }

    /// A lower bound of the absolute values in it, 0 where 0 is in it.
    #[inline(always)]
    pub fn mignitude(self) -> f64 {
        down(self.centre.mignitude() - self.radius)
    }

    /// A lower bound of the numbers in it.
    pub fn lower(self) -> f64 {
        let low = self.centre() - up(self.centre.rest() + self.radius);
        low - low.abs() * f64::EPSILON - f64::MIN_POSITIVE
    }

    /// An upper bound of the numbers in it.
    pub fn upper(self) -> f64 {
        -self.negated().lower()
    }

    /// The ball of the opposite numbers −x.
    pub fn negated(self) -> Self {
        Self { centre: self.centre.negated(), ..self }
    }

    /// The same ball with the radius increased by `by`.
    pub fn widened(self, by: f64) -> Self {
        Self { radius: up(self.radius + by), ..self }
    }

    /// The quotient: q + (x − qy)/y with a rounded q, whose doubles are found one by one from the remainder.
    pub fn divided_by(self, y: Self) -> Self {
        let (mut words, mut rest) = ([0.0; 3], self.exact());
        words[0] = self.centre() / y.centre();
        for k in 1..C::WORDS {
            rest = rest.exact().minus(y.exact().scaled(words[k - 1]));
            words[k] = rest.centre() / y.centre();
        }
        let q = Self::around(words, 0.0);
        let missed = self.minus(q.times(y)).magnitude();
        Self { radius: up(missed / y.mignitude()), ..q }
    }

    /// The square root: q + (x − q²)/(√x + q) with a rounded q; NaN unless all numbers in the ball are positive.
    pub fn sqrt(self) -> Self {
        let mut words = [self.centre().sqrt(), 0.0, 0.0];
        for k in 1..C::WORDS {
            let q = Self::around(words, 0.0);
            words[k] = self.exact().minus(q.times(q)).centre() / (2.0 * words[0]);
        }
        let q = Self::around(words, 0.0);
        let missed = self.minus(q.times(q)).magnitude();
        let below = down(down(self.lower().sqrt()) + q.mignitude());
        Self { radius: if self.lower() > 0.0 { up(missed / below) } else { f64::NAN }, ..q }
    }

    /// Σ x^k/k! over k = first, first + step, … ≤ last.
    fn horner(self, first: usize, step: usize, alternating: bool, last: usize) -> Self {
        let inverse = &C::tables().inverse_factorials;
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
        let k = libm::round(self.centre() / period.centre());
        (k, self.exact().minus(period.scaled(k)))
    }

    /// e^x = 2^k·2^{j/32}·e^r, |r| ≤ ln 2/64, for x ≤ 600; beyond it the radius is NaN.
    ///
    /// The factor of a radius ε is e^ε − 1 ≤ ε + ε² for ε ≤ 1.
    pub fn exp(self) -> Self {
        if self.centre() < -600.0 && self.radius <= 1.0 {
            return Self::of(0.0).widened(1e-258);
        }
        if !(self.centre().abs() <= 600.0 && self.radius <= 1.0) {
            return Self { radius: f64::NAN, ..self };
        }
        let (n, rest) = self.reduced(C::LN_2.scaled(1.0 / 32.0));
        let n = n as i32;
        let (terms, rest_of_series) = C::EXPONENTIAL;
        let series = rest.horner(0, 1, false, terms - 1).widened(rest_of_series);
        let root = C::tables().roots_of_two[n.rem_euclid(32) as usize];
        let centre = series.times(root).scaled(libm::ldexp(1.0, n.div_euclid(32)));
        let r = self.radius;
        centre.widened(up(centre.magnitude() * up(r + up(r * r))))
    }

    /// tanh x = (1 − e)/(1 + e), e = exp(−2x), at the centre; its slope is at most 1.
    fn tanh_of_centre(self) -> Self {
        // 1 − tanh x < 2e^{−2x} < 1.03·10⁻¹³⁰.
        if self.centre() > 150.0 {
            return Self::of(1.0).widened(2e-130);
        }
        let one = Self::of(1.0);
        let e = self.exact().scaled(-2.0).exp();
        one.minus(e).divided_by(one.plus(e))
    }
}

impl Ball {
    /// The sum of two doubles, with the radius.
    pub fn new(high: f64, low: f64, radius: f64) -> Self {
        Self::around([high, low, 0.0], radius)
    }

    /// The number as a factor for other number types; `fine` contains the same number.
    pub fn constant(self, fine: FineBall) -> Constant {
        let [high, low, _] = self.parts();
        Constant { high, low, radius: self.radius, fine: (fine.parts(), fine.radius) }
    }
}

impl<C: BallCentre> Number for BallOf<C> {
    #[inline(always)]
    fn of(value: f64) -> Self {
        Self { centre: C::of(value), radius: 0.0 }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        let (centre, rounding) = self.centre.sum(other.centre);
        Self { centre, radius: up(up(self.radius + other.radius) + rounding) }
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self.plus(other.negated())
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        let (centre, rounding) = self.centre.product(other.centre);
        let (a, b) = (self.centre.magnitude(), other.centre.magnitude());
        let spread = up(up(a * other.radius) + up(up(b + other.radius) * self.radius));
        Self { centre, radius: up(spread + rounding) }
    }

    #[inline(always)]
    fn scaled(self, factor: f64) -> Self {
        self.times(Self::of(factor))
    }

    fn scaled_by(self, factor: Constant) -> Self {
        self.times(C::constant(factor))
    }

    fn tanh(self) -> Self {
        let x = if self.centre() < 0.0 { self.negated() } else { self };
        let t = x.tanh_of_centre().widened(self.radius);
        if self.centre() < 0.0 { t.negated() } else { t }
    }

    /// Their slopes are at most 1.
    fn sin_cos(self) -> (Self, Self) {
        let half = Self::PI.scaled(0.5);
        let (k, rest) = self.reduced(half);
        if !(k.abs() <= 1e9) {
            let no_number = self.centre().is_nan() || self.radius.is_nan();
            let all = Self::of(0.0).widened(if no_number { f64::NAN } else { 1.0 });
            return (all, all);
        }
        let (terms, rest_of_series) = C::TRIGONOMETRIC;
        let series = |first| rest.horner(first, 2, true, terms - 1).widened(rest_of_series);
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
            let first = Complex::new(self.centre(), 0.0);
            let rough = Rough::new(first, up(self.centre.rest() + self.radius));
            let [_, slopes @ ..]: [Rough; 4] = function.derivatives(rough);
            for k in 0..K {
                out[k] = out[k].widened(up(self.radius * slopes[k].magnitude()));
            }
        }
        out
    }
}
