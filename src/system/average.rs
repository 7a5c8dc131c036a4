//! Averages over a circle on registers, and what second order of averaging takes of them.

use crate::scalar::Elementary;
use std::ops::{Add, Mul, Sub};

/// The number of [`QUARTER`].
pub(super) const POINTS: usize = 8;

/// cos ((2i + 1)π/32): of 32 points of a circle those of the first quarter. Means over them are those over the circle
/// for functions of v = r cos ψ that are even in v, but for harmonics from the 32nd on.
pub(super) const QUARTER: [f64; POINTS] = [
    0.9951847266721969,
    0.9569403357322088,
    0.881921264348355,
    0.773010453362737,
    0.6343932841636455,
    0.4713967368259978,
    0.29028467725446233,
    0.09801714032956077,
];

/// The largest argument kr of sines and cosines whose means 32 points resolve to 1e-13.
pub(super) const RESOLVED: f64 = 10.0;

/// The largest argument of those whose products the points resolve, to 1e-10.
pub(super) const PRODUCTS_RESOLVED: f64 = 6.0;

/// The largest argument of those whose integrals the [harmonics](mean_with_integral) resolve, to 1e-9.
pub(super) const INTEGRALS_RESOLVED: f64 = 4.0;

/// 0 where an argument is at most this large, NaN beyond.
#[inline(always)]
pub(super) fn zero_within<S: Elementary>(most: f64, argument: S) -> S {
    let known = (S::from_f64(most) - argument).sqrt();
    S::zero() * known
}

/// A function of the radius r of a circle, with its first two derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Jet<S>([S; 3]);

impl<S: Elementary> Jet<S> {
    pub(super) fn zero() -> Self {
        Self([S::zero(); 3])
    }

    /// sr for a number s.
    #[inline(always)]
    pub(super) fn linear(s: f64, radius: S) -> Self {
        let s = S::from_f64(s);
        Self([s * radius, s, S::zero()])
    }

    #[inline(always)]
    pub(super) fn times(self, factor: f64) -> Self {
        let [f, first, second] = self.0;
        let factor = S::from_f64(factor);
        Self([factor * f, factor * first, factor * second])
    }

    /// (sin, cos) of a linear function.
    #[inline(always)]
    pub(super) fn sin_cos_of_linear(self) -> (Self, Self) {
        let [v, s, _] = self.0;
        let (sin, cos) = v.sin_cos();
        let square = s * s;
        (Self([sin, s * cos, -(square * sin)]), Self([cos, -(s * sin), -(square * cos)]))
    }

    /// The derivative by the action J = ½r².
    #[inline(always)]
    pub(super) fn by_action(self, radius: S) -> S {
        self.0[1] / radius
    }

    /// The function with its derivative by the action.
    #[inline(always)]
    pub(super) fn with_slope(self, radius: S) -> [S; 2] {
        [self.0[0], self.by_action(radius)]
    }

    /// The first and the second derivative by the action.
    #[inline(always)]
    pub(super) fn slopes(self, radius: S) -> [S; 2] {
        let first = self.by_action(radius);
        [first, (self.0[2] - first) / (radius * radius)]
    }

    pub(super) fn value(self) -> S {
        self.0[0]
    }
}

impl<S: Elementary> Add for Jet<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let ([a, b, c], [d, e, f]) = (self.0, other.0);
        Self([a + d, b + e, c + f])
    }
}

impl<S: Elementary> Sub for Jet<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let ([a, b, c], [d, e, f]) = (self.0, other.0);
        Self([a - d, b - e, c - f])
    }
}

impl<S: Elementary> Mul for Jet<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let ([a, b, c], [d, e, f]) = (self.0, other.0);
        let cross = b * e;
        Self([a * d, a.mul_add(e, b * d), a.mul_add(f, c * d) + cross + cross])
    }
}

/// The radius of the circle of a plane, √(q² + p²), moved off 0, since derivatives by the action are divided by it:
/// averages change by 1e-12 at most.
#[inline(always)]
pub(super) fn radius<S: Elementary>(q: S, p: S) -> S {
    q.mul_add(q, p.mul_add(p, S::from_f64(1e-12))).sqrt()
}

/// A function of v = r cos ψ at the points of a quarter of the circle.
pub(super) type OnQuarter<S> = [Jet<S>; POINTS];

/// The mean of the product of two functions of r cos ψ that are both even or both odd.
#[inline(always)]
pub(super) fn mean_of_product<S: Elementary>(a: &OnQuarter<S>, b: &OnQuarter<S>) -> Jet<S> {
    let mut sum = Jet::zero();
    for i in 0..POINTS {
        sum = sum + a[i] * b[i];
    }
    sum.times(1.0 / POINTS as f64)
}

/// The mean of an even function of r cos ψ.
#[inline(always)]
pub(super) fn mean<S: Elementary>(a: &OnQuarter<S>) -> Jet<S> {
    let mut sum = Jet::zero();
    for a in a {
        sum = sum + *a;
    }
    sum.times(1.0 / POINTS as f64)
}

/// The mean of a(r cos ψ)b(r sin ψ), both even.
#[inline(always)]
pub(super) fn mean_across<S: Elementary>(a: &OnQuarter<S>, b: &OnQuarter<S>) -> Jet<S> {
    let mut sum = Jet::zero();
    for i in 0..POINTS {
        sum = sum + a[i] * b[POINTS - 1 - i];
    }
    sum.times(1.0 / POINTS as f64)
}

/// The mean of a(r cos ψ) times the integral by ψ of b(r sin ψ), both odd.
///
/// With a = Σ a_m cos mψ and b(r cos ψ) = Σ b_m cos mψ, m odd, it is −½ Σ (−1)^((m−1)/2) a_m b_m/m.
#[inline(always)]
pub(super) fn mean_with_integral<S: Elementary>(a: &OnQuarter<S>, b: &OnQuarter<S>) -> Jet<S> {
    let mut sum = Jet::zero();
    for (number, cosines) in HARMONICS.iter().enumerate() {
        let (mut of_a, mut of_b) = (Jet::zero(), Jet::zero());
        for i in 0..POINTS {
            of_a = of_a + a[i].times(cosines[i]);
            of_b = of_b + b[i].times(cosines[i]);
        }
        let m = 2 * number + 1;
        let sign = if number % 2 == 0 { -1.0 } else { 1.0 };
        let scale = 4.0 / (POINTS * POINTS) as f64;
        sum = sum + (of_a * of_b).times(0.5 * sign * scale / m as f64);
    }
    sum
}

/// cos mψ at the points of the quarter, for m = 1, 3, 5, 7, 9: cos (m(2i + 1)π/32), with the sign of the quarter.
const HARMONICS: [[f64; POINTS]; 5] = harmonics();

const fn harmonics() -> [[f64; POINTS]; 5] {
    let mut out = [[0.0; POINTS]; 5];
    let mut number = 0;
    while number < 5 {
        let mut i = 0;
        while i < POINTS {
            // In units of π/32: an odd number, folded into the first quarter of 16.
            let angle = ((2 * number + 1) * (2 * i + 1)) % 64;
            let half = if angle > 32 { 64 - angle } else { angle };
            let (quarter, sign) = if half > 16 { (32 - half, -1.0) } else { (half, 1.0) };
            out[number][i] = sign * QUARTER[(quarter - 1) / 2];
            i += 1;
        }
        number += 1;
    }
    out
}
