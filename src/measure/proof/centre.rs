//! The centres of balls: unevaluated sums of doubles, with bounds of the errors of their sums and products.

use super::rounded::{down, up};

/// 2⁻¹⁰³, more than the relative error of a sum or a product of double-doubles.
const ROUNDING_OF_TWO: f64 = 1.0 / ((1_u128 << 103) as f64);
/// 2⁻⁴⁹: sixteen roundings of a double.
const ROUNDINGS: f64 = 8.0 * f64::EPSILON;

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

/// An unevaluated sum of doubles, the larger ones first.
pub trait Centre: Copy + PartialEq + std::fmt::Debug + Send + Sync + 'static {
    /// The number of terms of the series of e^x to be summed for |x| ≤ ln 2/64, and a bound of twice the rest.
    const EXPONENTIAL: (usize, f64);
    /// The same for the series of sine and cosine with |x| ≤ 0.8.
    const TRIGONOMETRIC: (usize, f64);

    /// The number of doubles in the sum: two or three.
    const WORDS: usize;

    /// The sum that consists of one double, the others being 0.
    fn of(value: f64) -> Self;
    /// The sum of the first [`Centre::WORDS`] of these doubles.
    fn of_words(words: [f64; 3]) -> Self;
    /// The doubles, filled up with zeros.
    fn parts(self) -> [f64; 3];
    /// The first and largest double of the sum.
    fn first(self) -> f64;
    /// The sum with the opposite sign of each double.
    fn negated(self) -> Self;
    /// An upper bound of the modulus.
    fn magnitude(self) -> f64;
    /// A lower bound of the modulus of the sum.
    fn mignitude(self) -> f64;
    /// A bound of its distance from its first double.
    fn rest(self) -> f64;
    /// The sum, and a bound of its error.
    fn sum(self, other: Self) -> (Self, f64);
    /// The product, and a bound of its error.
    fn product(self, other: Self) -> (Self, f64);
}

/// Two doubles: some 31 digits.
///
/// Source: for the errors of sums (3·2⁻¹⁰⁶, relative) and products (7·2⁻¹⁰⁶) Joldes, Muller and Popescu,
/// <https://doi.org/10.1145/3121432>, algorithms 6 and 10; 2⁻¹⁰³ is allowed for either.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoWords {
    high: f64,
    low: f64,
}

impl TwoWords {
    pub(super) const fn from_parts(high: f64, low: f64) -> Self {
        Self { high, low }
    }

    #[inline(always)]
    fn rounding(high: f64) -> f64 {
        up(high.abs() * ROUNDING_OF_TWO)
    }
}

impl Centre for TwoWords {
    // 0.011¹⁴/14! < 10⁻³⁸.
    const EXPONENTIAL: (usize, f64) = (14, 2e-38);
    // 0.8³⁴/34! < 10⁻⁴¹.
    const TRIGONOMETRIC: (usize, f64) = (34, 1e-40);

    const WORDS: usize = 2;

    #[inline(always)]
    fn of(value: f64) -> Self {
        Self { high: value, low: 0.0 }
    }

    #[inline(always)]
    fn of_words([high, low, _]: [f64; 3]) -> Self {
        let (high, low) = two_sum(high, low);
        Self { high, low }
    }

    #[inline(always)]
    fn parts(self) -> [f64; 3] {
        [self.high, self.low, 0.0]
    }

    #[inline(always)]
    fn first(self) -> f64 {
        self.high
    }

    #[inline(always)]
    fn negated(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }

    #[inline(always)]
    fn magnitude(self) -> f64 {
        up(self.high.abs())
    }

    #[inline(always)]
    fn mignitude(self) -> f64 {
        down(self.high.abs())
    }

    #[inline(always)]
    fn rest(self) -> f64 {
        self.low.abs()
    }

    #[inline(always)]
    fn sum(self, other: Self) -> (Self, f64) {
        let (sum, error) = two_sum(self.high, other.high);
        let (low, rest) = two_sum(self.low, other.low);
        let (high, low) = fast_two_sum(sum, error + low);
        let (high, low) = fast_two_sum(high, rest + low);
        (Self { high, low }, Self::rounding(high))
    }

    #[inline(always)]
    fn product(self, other: Self) -> (Self, f64) {
        let (product, error) = two_product(self.high, other.high);
        let low = error + (self.high * other.low + self.low * other.high);
        let (high, low) = fast_two_sum(product, low);
        (Self { high, low }, Self::rounding(high))
    }
}

/// Three doubles: some 46 digits.
///
/// Sums and products are exact except for terms of third order, which are added up in doubles, and smaller terms,
/// which are left out. The bounds are computed from these terms themselves, so they hold even where the words
/// overlap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThreeWords([f64; 3]);

impl ThreeWords {
    /// The same sum with words that overlap less: nothing is lost.
    #[inline(always)]
    fn spread_out([a, b, c]: [f64; 3]) -> Self {
        let (a, b) = two_sum(a, b);
        let (b, c) = two_sum(b, c);
        let (a, b) = two_sum(a, b);
        Self([a, b, c])
    }

    pub(super) const fn from_parts(words: [f64; 3]) -> Self {
        Self(words)
    }
}

impl Centre for ThreeWords {
    // 0.011²⁰/20! < 3·10⁻⁵⁸.
    const EXPONENTIAL: (usize, f64) = (20, 1e-57);
    // 0.8⁴⁴/44! < 3·10⁻⁵⁹.
    const TRIGONOMETRIC: (usize, f64) = (44, 1e-58);

    const WORDS: usize = 3;

    #[inline(always)]
    fn of(value: f64) -> Self {
        Self([value, 0.0, 0.0])
    }

    #[inline(always)]
    fn of_words(words: [f64; 3]) -> Self {
        Self::spread_out(words)
    }

    #[inline(always)]
    fn parts(self) -> [f64; 3] {
        self.0
    }

    #[inline(always)]
    fn first(self) -> f64 {
        self.0[0]
    }

    #[inline(always)]
    fn negated(self) -> Self {
        Self(self.0.map(|word| -word))
    }

    #[inline(always)]
    fn magnitude(self) -> f64 {
        up(up(self.0[0].abs()) + self.rest())
    }

    #[inline(always)]
    fn mignitude(self) -> f64 {
        down(down(self.0[0].abs()) - self.rest())
    }

    #[inline(always)]
    fn rest(self) -> f64 {
        up(self.0[1].abs() + self.0[2].abs())
    }

    #[inline(always)]
    fn sum(self, other: Self) -> (Self, f64) {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        let (first, e) = two_sum(a, x);
        let (second, f) = two_sum(b, y);
        let (second, g) = two_sum(second, e);
        let third = (c + z) + (f + g);
        let added = up(up(c.abs() + z.abs()) + up(f.abs() + g.abs()));
        (Self::spread_out([first, second, third]), up(added * ROUNDINGS))
    }

    #[inline(always)]
    fn product(self, other: Self) -> (Self, f64) {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        let (first, e) = two_product(a, x);
        let ((ay, f), (bx, g)) = (two_product(a, y), two_product(b, x));
        let (second, h) = two_sum(ay, bx);
        let (second, i) = two_sum(second, e);
        let terms = [a * z, b * y, c * x, f, g, h, i];
        let (mut third, mut added) = (0.0, 0.0);
        for term in terms {
            third += term;
            added = up(added + term.abs());
        }
        let least = up(up(b.abs() * z.abs()) + up(c.abs() * up(y.abs() + z.abs())));
        (Self::spread_out([first, second, third]), up(least + up(added * ROUNDINGS)))
    }
}
