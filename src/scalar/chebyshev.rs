//! Sums of Chebyshev polynomials, and their derivatives.

use super::{Over, Scalar};

/// The coefficients of K adjacent series f_k(s) = Σ_m c_{mk} T_m(s).
#[derive(Clone, Copy, Debug)]
pub struct Series<'a, P> {
    /// All coefficients, those of one m after those of the one before.
    coefficients: &'a [P],
    /// How many series there are, and the first of those that are meant.
    row: usize,
    first: usize,
    /// How many coefficients each has.
    count: usize,
    /// All K are the same series.
    repeated: bool,
}

impl<'a, P> Series<'a, P> {
    /// The series from number `first` on, of `row` series with `count` coefficients each.
    ///
    /// # Panics
    /// When the number of coefficients is another one.
    #[inline(always)]
    pub fn new(coefficients: &'a [P], count: usize, row: usize, first: usize) -> Self {
        assert!(coefficients.len() == count * row);
        Self { coefficients, row, first, count, repeated: false }
    }

    /// The first of them K times: one series of K arguments.
    #[inline(always)]
    pub fn repeated(self) -> Self {
        Self { repeated: true, ..self }
    }

    /// Those from number `more` on of these.
    pub(super) fn from(self, more: usize) -> Self {
        Self { first: self.first + more, ..self }
    }

    /// How many coefficients each has.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether the series have no terms.
    pub fn is_empty(&self) -> bool {
        self.coefficients.is_empty()
    }

    /// Σ |c_m| |T_m″(s)| for s ≥ 1, no less than |f″| anywhere in [−s, s].
    pub(crate) fn largest_curvature(&self, s: f64) -> f64
    where
        P: Copy,
        f64: Over<P>,
    {
        let (mut t, mut d, mut e) = ([1.0, s], [0.0, 1.0], [0.0, 0.0]);
        let mut sum = 0.0;
        for m in 0..self.len() {
            sum += f64::embed(self.at::<1>(m)[0]).abs() * e[0];
            let next = [
                2.0 * s * t[1] - t[0],
                2.0 * (t[1] + s * d[1]) - d[0],
                2.0 * (2.0 * d[1] + s * e[1]) - e[0],
            ];
            (t, d, e) = ([t[1], next[0]], [d[1], next[1]], [e[1], next[2]]);
        }
        sum
    }

    #[inline(always)]
    fn at<const K: usize>(&self, m: usize) -> [P; K]
    where
        P: Copy,
    {
        let begin = m * self.row + self.first;
        if self.repeated {
            return [self.coefficients[begin]; K];
        }
        *self.coefficients[begin..begin + K].first_chunk().expect("K of them")
    }
}

/// Clenshaw's recurrences for the terms of even and of odd number, in t = T₂(s) = 2s² − 1:
///
/// Σ_k c_{2k} T_k(t) = b₀ − t b₁ and Σ_k c_{2k+1} V_k(t) = o₀ − o₁ with T_{2k+1}(s) = s V_k(t),
/// b_k = c + 2t b_{k+1} − b_{k+2}.
///
/// Neither chain waits for the other, so that a processor computes both in the time of one, which is half
/// as long as that of all terms. Each has its values and derivatives in t, `ORDER` together.
struct Chains<S, const K: usize, const ORDER: usize> {
    /// Of b_k and of o_k: the values and derivatives for the last k and the one before.
    even: [[[S; K]; 2]; ORDER],
    odd: [[[S; K]; 2]; ORDER],
}

impl<S: Scalar, const K: usize, const ORDER: usize> Chains<S, K, ORDER> {
    #[inline(always)]
    fn of<P: Copy>(s: [S; K], series: Series<'_, P>) -> (Self, [S; K])
    where
        S: Over<P>,
    {
        let mut double = s;
        for k in 0..K {
            double[k] = (s[k] * S::from_f64(4.0)).mul_add(s[k], S::from_f64(-2.0));
        }
        let none = [[[S::zero(); K]; 2]; ORDER];
        let mut out = Self { even: none, odd: none };
        let count = series.len();
        if !count.is_multiple_of(2) {
            let top = series.at::<K>(count - 1);
            for k in 0..K {
                out.even[0][0][k] = S::embed(top[k]);
            }
        }
        for pair in (0..count / 2).rev() {
            step(&mut out.even, &double, &series.at(2 * pair));
            step(&mut out.odd, &double, &series.at(2 * pair + 1));
        }
        (out, double)
    }

    /// Σ_k c_{2k} T_k(t) and its derivatives in t.
    #[inline(always)]
    fn even_sum(&self, order: usize, k: usize, half: S) -> S {
        let [b, after] = self.even[order];
        let sum = (-half).mul_add(after[k], b[k]);
        match order {
            0 => sum,
            1 => sum - self.even[0][1][k],
            _ => (S::from_f64(-2.0)).mul_add(self.even[1][1][k], sum),
        }
    }

    /// Σ_k c_{2k+1} V_k(t) and its derivatives in t.
    #[inline(always)]
    fn odd_sum(&self, order: usize, k: usize) -> S {
        let [o, after] = self.odd[order];
        o[k] - after[k]
    }
}

/// The next of a chain. What does not wait for the last result is computed first.
#[inline(always)]
fn step<S: Over<P>, P: Copy, const K: usize, const ORDER: usize>(
    chain: &mut [[[S; K]; 2]; ORDER],
    double: &[S; K],
    coefficients: &[P; K],
) {
    for order in (0..ORDER).rev() {
        let mut next = *double;
        for k in 0..K {
            let [last, before] = [chain[order][0][k], chain[order][1][k]];
            let more = match order {
                0 => S::embed(coefficients[k]) - before,
                _ => S::from_f64(2.0 * order as f64).mul_add(chain[order - 1][0][k], -before),
            };
            next[k] = double[k].mul_add(last, more);
        }
        chain[order] = [next, chain[order][0]];
    }
}

/// The values f_k(s_k) of K series, each at its own argument.
#[inline(always)]
pub(super) fn values<S: Over<P>, P: Copy, const K: usize>(
    s: [S; K],
    series: Series<'_, P>,
) -> [S; K] {
    let (chains, double) = Chains::<S, K, 1>::of(s, series);
    let mut out = s;
    for k in 0..K {
        let half = double[k] * S::from_f64(0.5);
        out[k] = s[k].mul_add(chains.odd_sum(0, k), chains.even_sum(0, k, half));
    }
    out
}

/// f_k(s_k), the same bits as of [`values`], and f_k′(s_k) = O + 4s(Ė + sȮ), dots being
/// derivatives in t.
#[inline(always)]
pub(super) fn with_slopes<S: Over<P>, P: Copy, const K: usize>(
    s: [S; K],
    series: Series<'_, P>,
) -> [[S; K]; 2] {
    let (chains, double) = Chains::<S, K, 2>::of(s, series);
    let mut out = [s; 2];
    for k in 0..K {
        let half = double[k] * S::from_f64(0.5);
        let odd = chains.odd_sum(0, k);
        out[0][k] = s[k].mul_add(odd, chains.even_sum(0, k, half));
        let inner = s[k].mul_add(chains.odd_sum(1, k), chains.even_sum(1, k, half));
        out[1][k] = (s[k] * S::from_f64(4.0)).mul_add(inner, odd);
    }
    out
}

/// f_k(s_k), f_k′(s_k), the same bits as of [`with_slopes`], and
/// f_k″(s_k) = 4Ė + 12sȮ + 16s²(Ë + sÖ).
#[inline(always)]
pub(super) fn with_curvatures<S: Over<P>, P: Copy, const K: usize>(
    s: [S; K],
    series: Series<'_, P>,
) -> [[S; K]; 3] {
    let (chains, double) = Chains::<S, K, 3>::of(s, series);
    let mut out = [s; 3];
    for k in 0..K {
        let half = double[k] * S::from_f64(0.5);
        let four = s[k] * S::from_f64(4.0);
        let (odd, slope) = (chains.odd_sum(0, k), chains.odd_sum(1, k));
        let even_slope = chains.even_sum(1, k, half);
        out[0][k] = s[k].mul_add(odd, chains.even_sum(0, k, half));
        out[1][k] = four.mul_add(s[k].mul_add(slope, even_slope), odd);
        let first = (s[k] * S::from_f64(3.0)).mul_add(slope, even_slope);
        let second = s[k].mul_add(chains.odd_sum(2, k), chains.even_sum(2, k, half));
        out[2][k] = (four * four).mul_add(second, first * S::from_f64(4.0));
    }
    out
}

/// What rounding does to one series: the scales of the errors of f and f′, in units of u.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scales {
    pub(crate) value: f64,
    pub(crate) slope: f64,
}

/// The first-order bound of the rounding errors of [`with_slopes`], an error δ of b_k being one
/// of the coefficient c_{2k}, which the sum takes up with T_k(t): a bound that runs through the
/// recurrence would take |2t| for 2t, and grow by 1 + √2 with each coefficient.
///
/// Source: Higham, <https://doi.org/10.1137/1.9780898718027>, section 5.2, for bounds of recurrences by
/// the errors of each step.
pub(crate) fn scales(s: f64, series: Series<'_, f64>) -> Scales {
    let count = series.len();
    let t2 = (4.0 * s).mul_add(s, -2.0);
    let of = |parity: usize| -> Vec<f64> {
        (parity..count).step_by(2).map(|m| series.at::<1>(m)[0]).collect()
    };
    // T_k and V_k at k = 0 and 1.
    let even = ChainScales::of(&of(0), t2, [1.0, 0.5 * t2], [0.0, 1.0]);
    let odd = ChainScales::of(&of(1), t2, [1.0, t2 - 1.0], [0.0, 2.0]);
    let size = s.abs();
    // t is rounded too.
    let moved = 0.5 * t2.abs() + 1.0;
    let inner = even.first.abs() + size * odd.first.abs();
    let bend = odd.first.abs() + 4.0 * size * (even.second.abs() + size * odd.second.abs());
    let value = even.value + size * odd.value + even.sum + size * odd.sum + moved * inner;
    let slope = odd.value
        + odd.sum
        + 4.0 * size * (even.slope + size * odd.slope + 3.0 * inner)
        + moved * bend;
    Scales { value, slope }
}

/// Of one chain: the bounds of its two sums, and the sums of magnitudes that they are computed from.
struct ChainScales {
    value: f64,
    slope: f64,
    sum: f64,
    first: f64,
    second: f64,
}

impl ChainScales {
    /// `polynomial` and `derivative` are what the coefficients of number 0 and 1 come with.
    fn of(c: &[f64], t2: f64, polynomial: [f64; 2], derivative: [f64; 2]) -> Self {
        let count = c.len();
        let (mut b, mut b1, mut b2) =
            (vec![0.0; count + 2], vec![0.0; count + 2], vec![0.0; count + 2]);
        for k in (0..count).rev() {
            b[k] = t2.mul_add(b[k + 1], c[k] - b[k + 2]);
            b1[k] = t2.mul_add(b1[k + 1], 2.0_f64.mul_add(b[k + 1], -b1[k + 2]));
            b2[k] = t2.mul_add(b2[k + 1], 4.0_f64.mul_add(b1[k + 1], -b2[k + 2]));
        }
        let (mut p, mut d) = (polynomial, derivative);
        let mut out = Self { value: 0.0, slope: 0.0, sum: 0.0, first: 0.0, second: 0.0 };
        for k in 0..count {
            let own = b[k].abs() + (c[k] - b[k + 2]).abs();
            let of_slope = b1[k].abs() + (2.0 * b[k + 1] - b1[k + 2]).abs();
            out.value += p[0].abs() * own;
            out.slope += d[0].abs() * own + p[0].abs() * of_slope;
            let next = [t2.mul_add(p[1], -p[0]), t2.mul_add(d[1], 2.0_f64.mul_add(p[1], -d[0]))];
            (p, d) = ([p[1], next[0]], [d[1], next[1]]);
        }
        if count > 0 {
            let half = 0.5 * t2.abs() + 1.0;
            out.sum = b[0].abs() + half * b[1].abs();
            out.first = b1[0].abs() + half * b1[1].abs() + b[1].abs();
            out.second = b2[0].abs() + half * b2[1].abs() + 2.0 * b1[1].abs();
        }
        out
    }
}
