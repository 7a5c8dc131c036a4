//! Taylor models: enclosures of analytic functions on a disc.

use super::number::{Constant, Function, Number};
use super::rough::Rough;
use super::rounded::{
    Complex, complex_sin_cos, complex_tanh, down, exp_above, expm1_above, off_the_slits,
    real_at_least, saturation, tanh_moves, up,
};

/// The degree of the polynomials.
pub const DEGREE: usize = 6;

/// 2⁻⁴⁷: more than what rounding adds to a sum of products of all coefficients, relative to the product of the sums of
/// their moduli. Each coefficient of a product is a sum of no more than 7 products of complex numbers, which errs
/// by (7 + √5)·2⁻⁵³ of the sum of their moduli; the rest is for the norms.
const ROUNDING: f64 = 64.0 * f64::EPSILON / 2.0;
/// From which |Re w| on tanh w is ±1 to the rounding of doubles.
const SATURATED: f64 = 19.0;

/// A polynomial in s on the disc |s| ≤ 1, and a bound of the distance of the function that it approximates.
///
/// The result of an operation contains the results for all analytic functions in its arguments. The remainder is ∞
/// where the operation has a pole in the range of its argument, or may have one.
///
/// Source: Makino and Berz, Taylor models and other validated functional inclusion methods, International
/// Journal of Pure and Applied Mathematics 4 (2003).
#[derive(Clone, Copy, Debug)]
pub struct Taylor {
    c: [Complex; DEGREE + 1],
    remainder: f64,
}

impl Taylor {
    /// A polynomial, and the remainder.
    pub fn new(c: [Complex; DEGREE + 1], remainder: f64) -> Self {
        Self { c, remainder }
    }

    /// A number, known to within `radius`.
    pub fn constant(value: Complex, radius: f64) -> Self {
        let mut c = [Complex::ZERO; DEGREE + 1];
        c[0] = value;
        Self { c, remainder: radius }
    }

    /// The same model with the remainder increased by `by`.
    pub fn widened(self, by: f64) -> Self {
        Self { remainder: up(self.remainder + by), ..self }
    }

    /// The sum of the moduli of the coefficients from `first` on, upwards.
    #[inline(always)]
    fn norm_from(&self, first: usize) -> f64 {
        let mut sum = 0.0;
        for k in first..=DEGREE {
            sum = up(sum + self.c[k].above());
        }
        sum
    }

    /// How far from its value in the centre it is at most.
    fn spread(&self) -> f64 {
        up(self.norm_from(1) + self.remainder)
    }

    /// An upper bound of its modulus.
    pub fn above(&self) -> f64 {
        up(self.norm_from(0) + self.remainder)
    }

    /// A lower bound of its modulus.
    pub fn below(&self) -> f64 {
        down(self.c[0].below() - self.spread())
    }

    /// The number multiplied by i.
    pub fn times_i(self) -> Self {
        Self { c: self.c.map(|c| Complex::new(-c.im, c.re)), ..self }
    }

    /// The value in the centre, of the polynomial.
    pub fn centre(&self) -> Complex {
        self.c[0]
    }

    /// The polynomial at a point of the disc, rounded.
    pub fn evaluate(&self, s: Complex) -> Complex {
        let start = Complex::ZERO;
        self.c.iter().rev().fold(start, |sum, c| sum.times(s).plus(*c))
    }

    /// The remainder: an upper bound of the distance of the function from the polynomial.
    pub fn remainder(&self) -> f64 {
        self.remainder
    }

    /// 1/f. The remainder is that of g for a polynomial g: 1/f − g = (1 − fg)/f.
    pub fn inverse(self) -> Self {
        let Complex { re, im } = self.c[0];
        let square = re * re + im * im;
        let first = Complex::new(re / square, -im / square);
        let mut g = Self::constant(first, 0.0);
        for k in 1..=DEGREE {
            let mut sum = Complex::ZERO;
            for j in 1..=k {
                sum = sum.plus(self.c[j].times(g.c[k - j]));
            }
            g.c[k] = sum.times(first).scaled(-1.0);
        }
        let missed = Self::of(1.0).minus(self.times(g)).above();
        Self { remainder: up(missed / self.below()), ..g }
    }

    /// The coefficients, rounded, of (g, h) with g′ = aw′ and h′ = bw′; `rates` gives those of a and b from the
    /// coefficients of g and h up to a degree.
    fn solve(
        &self,
        start: [Complex; 2],
        mut rates: impl FnMut(&[[Complex; DEGREE + 1]; 2], usize) -> [Complex; 2],
    ) -> [[Complex; DEGREE + 1]; 2] {
        let mut out = [[Complex::ZERO; DEGREE + 1]; 2];
        let mut slopes = [[Complex::ZERO; DEGREE + 1]; 2];
        (out[0][0], out[1][0]) = (start[0], start[1]);
        for k in 1..=DEGREE {
            let rate = rates(&out, k - 1);
            for g in 0..2 {
                slopes[g][k - 1] = rate[g];
                let mut sum = Complex::ZERO;
                for j in 1..=k {
                    sum = sum.plus(self.c[j].times(slopes[g][k - j]).scaled(j as f64));
                }
                out[g][k] = sum.scaled(1.0 / k as f64);
            }
        }
        out
    }

    /// The derivative of the polynomial.
    fn slope(&self) -> Self {
        let mut out = Self::of(0.0);
        let mut sum = 0.0;
        for k in 1..=DEGREE {
            out.c[k - 1] = self.c[k].scaled(k as f64);
            sum = up(sum + out.c[k - 1].above());
        }
        out.remainder = up(sum * f64::EPSILON);
        out
    }

    /// The model of the polynomial alone, whose remainder is 0.
    fn polynomial(&self) -> Self {
        Self { remainder: 0.0, ..*self }
    }
}

impl Number for Taylor {
    fn of(value: f64) -> Self {
        Self::constant(Complex::new(value, 0.0), 0.0)
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        let mut out = self;
        let mut sum = 0.0;
        for k in 0..=DEGREE {
            out.c[k] = self.c[k].plus(other.c[k]);
            sum += out.c[k].re.abs() + out.c[k].im.abs();
        }
        out.remainder = up(up(self.remainder + other.remainder) + up(sum * (16.0 * f64::EPSILON)));
        out
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        let mut out = Self::of(0.0);
        let (a, b): ([f64; DEGREE + 1], [f64; DEGREE + 1]) =
            (self.c.map(Complex::above), other.c.map(Complex::above));
        let (mut norm_a, mut norm_b, mut beyond) = (0.0, 0.0, 0.0);
        for i in 0..=DEGREE {
            norm_a = up(norm_a + a[i]);
            norm_b = up(norm_b + b[i]);
            for j in 0..=DEGREE {
                if i + j <= DEGREE {
                    out.c[i + j] = out.c[i + j].plus(self.c[i].times(other.c[j]));
                } else {
                    beyond += a[i] * b[j];
                }
            }
        }
        let product = up(norm_a * norm_b);
        let rounding = up(up(product * ROUNDING) + up(beyond * (1.0 + 64.0 * f64::EPSILON)));
        let spread =
            up(up(norm_a * other.remainder) + up(up(norm_b + other.remainder) * self.remainder));
        out.remainder = up(spread + rounding);
        out
    }

    #[inline(always)]
    fn scaled(self, factor: f64) -> Self {
        let mut out = self;
        let mut sum = 0.0;
        for k in 0..=DEGREE {
            out.c[k] = self.c[k].scaled(factor);
            sum += out.c[k].re.abs() + out.c[k].im.abs();
        }
        out.remainder = up(up(self.remainder * factor.abs()) + up(sum * (16.0 * f64::EPSILON)));
        out
    }

    fn scaled_by(self, factor: Constant) -> Self {
        let off = factor.off();
        let more = up(self.above() * off);
        self.scaled(factor.high).widened(more)
    }

    /// The coefficients are those of t′ = (1 − t²)w′. For a polynomial g with the defect d = g′ − (1 − g²)w′ the
    /// error e = tanh w − g has e′ = −(tanh w + g)ew′ − d, so that on the disc |e| ≤ (|e(0)| + |d|) exp((|tanh w| +
    /// |g|)|w′|).
    ///
    /// w is to be off the slits of [`off_the_slits`]: where it is so on the edge of a strip there is no pole within.
    fn tanh(self) -> Self {
        let (t, margin) = complex_tanh(self.c[0]);
        if !off_the_slits(self.c[0], self.spread()) {
            return Self::constant(t, f64::INFINITY);
        }
        let beyond = real_at_least(self.c[0], self.spread());
        if beyond > SATURATED {
            let side = if self.c[0].re > 0.0 { 1.0 } else { -1.0 };
            return Self::constant(Complex::new(side, 0.0), saturation(beyond));
        }
        let [c, _] = self.solve([t, Complex::ZERO], |[t, _], k| {
            let mut square = Complex::ZERO;
            for j in 0..=k {
                square = square.plus(t[j].times(t[k - j]));
            }
            let one = if k == 0 { 1.0 } else { 0.0 };
            [Complex::new(one - square.re, -square.im), Complex::ZERO]
        });
        let g = Self { c, remainder: 0.0 };
        let w_slope = self.polynomial().slope();
        let rate = Self::of(1.0).minus(g.times(g)).times(w_slope);
        let defect = g.slope().minus(rate).above();
        let modulus = up(t.above() + margin);
        let bent = up(1.0 + up(modulus * modulus));
        let reached = up(modulus + tanh_moves(modulus, bent, self.norm_from(1)));
        let growth = up(up(reached + g.above()) * w_slope.above());
        let out = g.widened(up(up(margin + defect) * exp_above(growth)));
        // The remainder of the argument.
        let all = out.above();
        let bent = up(1.0 + up(all * all));
        let moved = tanh_moves(all, bent, self.remainder);
        out.widened(moved)
    }

    /// The coefficients are those of S′ = Cw′ and C′ = −Sw′; with the defects d of both the errors are at most
    /// (|e(0)| + |d|) exp |w′| together.
    fn sin_cos(self) -> (Self, Self) {
        let (s, c, margin) = complex_sin_cos(self.c[0]);
        let [sines, cosines] = self.solve([s, c], |[s, c], k| [c[k], s[k].scaled(-1.0)]);
        let (s, c) = (Self { c: sines, remainder: 0.0 }, Self { c: cosines, remainder: 0.0 });
        let slope = self.polynomial().slope();
        let defects =
            up(s.slope().minus(c.times(slope)).above() + c.slope().plus(s.times(slope)).above());
        let off = up(up(up(2.0 * margin) + defects) * exp_above(slope.above()));
        let (s, c) = (s.widened(off), c.widened(off));
        // |sin(w + e) − sin w| ≤ |sin w|(cosh |e| − 1) + |cos w| sinh |e|.
        let moved = up(up(s.above() + c.above()) * expm1_above(self.remainder));
        (s.widened(moved), c.widened(moved))
    }

    /// f(x + e) is no further than |e| sup |f′| from f(x), and |f′(x + e)| no further than |e| sup |f″| from that: the
    /// last bound is that of a disc of doubles.
    fn through<const K: usize>(self, function: &impl Function) -> [Self; K] {
        let r = self.remainder;
        let x = self.polynomial();
        let exact: [Self; 4] = if const { K > 1 } {
            function.derivatives(x)
        } else {
            let [f, slope] = function.derivatives(x);
            [f, slope, slope, slope]
        };
        let disc = Rough::new(self.c[0], self.spread());
        let rough: [Rough; 5] = function.derivatives(disc);
        let mut out = [x; K];
        for k in 0..K {
            let slope = up(exact[k + 1].above() + up(r * rough[k + 2].magnitude()));
            out[k] = exact[k].widened(up(r * slope));
        }
        out
    }
}
