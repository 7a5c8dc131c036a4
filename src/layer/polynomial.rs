//! Potentials that are sums of polynomials.

use super::Potential;
use super::unrolled::for_polynomials;
use crate::scalar::{Over, Scalar, Series};

/// V(y) = ρ Σ_k P_k(s_k), s = Wᵀx: polynomials of linear forms of x, the coordinates y divided by
/// half the extent of a box; P_k′ = Σ_{m<d} c_{mk} T_m in Chebyshev polynomials.
///
/// With as many directions as there are monomials of a degree, such sums comprise all polynomials
/// of that degree. They are meant for |s_k| ≤ 1, the box; outside it V grows like s^d.
///
/// Coordinates are divided by the radius ρ of the box, x = y/ρ. The first arguments may be actions,
/// each with its interval: x = (𝔍 − centre)/(half its width). ∇V = ρ Σ_k P_k′(s_k) ∂s_k/∂y.
///
/// With one argument W would only rescale c: then there is no W, s is x, and the sum has one term.
///
/// Source: Dragt and Abell, "Symplectic maps and computation of orbits in particle accelerators",
/// in Fields Institute Communications 10 (1996), for kicks by polynomials along lines; Clenshaw,
/// <https://doi.org/10.1090/S0025-5718-1955-0071856-0>, for the evaluation.
#[derive(Clone, Copy, Debug)]
pub struct PolynomialPotential<'a, P> {
    dof: usize,
    radius: f64,
    actions: &'a [ActionInterval],
    /// n × h, row by row; empty where n is 1.
    w_in: &'a [P],
    /// d × h, row by row.
    coefficients: &'a [P],
    width: usize,
    degree: usize,
}

/// The interval of the values of an action in the box of radius ρ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActionInterval {
    /// The middle of the interval.
    pub centre: f64,
    /// 1 over half the width of the interval.
    pub inverse_half: f64,
}

/// How many parameters such a potential of so many arguments has: W and the coefficients.
/// Saturates instead of overflowing.
pub(super) fn polynomial_parameter_count(arguments: usize, width: usize, degree: usize) -> usize {
    let directions = if arguments > 1 { arguments } else { 0 };
    width.saturating_mul(directions.saturating_add(degree))
}

impl<'a, P: Copy> PolynomialPotential<'a, P> {
    /// A view of the parameters `[W (n × h, row by row; none where n is 1), c (d × h, row by row)]`
    /// of h polynomials of degree d, given as `[h, d]`, in n = `arguments` numbers. The first
    /// arguments are actions in the intervals `actions`.
    ///
    /// # Panics
    /// When the number of parameters is another one, or `arguments` is 1 and h is not.
    #[inline(always)]
    pub fn new(
        arguments: usize,
        [width, degree]: [usize; 2],
        radius: f64,
        actions: &'a [ActionInterval],
        parameters: &'a [P],
    ) -> Self {
        let directions = if arguments > 1 { arguments } else { 0 };
        assert!(arguments > 1 || width == 1);
        let (w_in, coefficients) = parameters.split_at(directions * width);
        assert!(coefficients.len() == degree * width);
        Self { dof: arguments, radius, actions, w_in, coefficients, width, degree }
    }

    /// h, the number of polynomials.
    #[inline(always)]
    pub fn width(&self) -> usize {
        self.width
    }

    #[inline(always)]
    pub(super) fn n(&self) -> usize {
        self.dof
    }

    /// W (n × h, row by row) and the coefficients of the derivatives (d × h, row by row).
    pub fn weights(&self) -> [&[P]; 2] {
        [self.w_in, self.coefficients]
    }

    #[inline(always)]
    fn series(&self, first: usize) -> Series<'a, P> {
        Series::new(self.coefficients, self.degree, self.width, first)
    }

    /// The one polynomial that it has of one coordinate, and 1/ρ.
    #[inline(always)]
    pub(super) fn of_one_coordinate(&self) -> Option<(Series<'a, P>, f64)> {
        let is_one = self.w_in.is_empty() && self.actions.is_empty();
        is_one.then(|| (self.series(0), self.inverse_half(0)))
    }

    /// The derivative ∂x_i/∂y_i, one over half the extent of the argument number i.
    #[inline(always)]
    fn inverse_half(&self, i: usize) -> f64 {
        if i < self.actions.len() { self.actions[i].inverse_half } else { 1.0 / self.radius }
    }

    /// The normalised argument x_i, which is in [−1, 1] inside the box.
    #[inline(always)]
    fn normalised<S: Scalar>(&self, i: usize, y: &[S]) -> S {
        let inverse_half = S::from_f64(self.inverse_half(i));
        if i < self.actions.len() {
            return (y[i] - S::from_f64(self.actions[i].centre)) * inverse_half;
        }
        y[i] * inverse_half
    }

    /// ρ∂x_i/∂y_i times a number: 1 of coordinates.
    #[inline(always)]
    fn weighed<S: Scalar>(&self, i: usize, x: S) -> S {
        if i < self.actions.len() {
            return x * S::from_f64(self.radius * self.actions[i].inverse_half);
        }
        x
    }

    #[inline(always)]
    fn directions<const K: usize>(&self, i: usize, first: usize) -> &'a [P; K] {
        let begin = i * self.width + first;
        self.w_in[begin..begin + K].first_chunk().expect("K of them")
    }

    /// s of K polynomials from number `first` on.
    #[inline(always)]
    fn ridges<S: Over<P>, const K: usize>(&self, first: usize, y: &[S]) -> [S; K] {
        let mut s = [self.normalised(0, y); K];
        if self.w_in.is_empty() {
            return s;
        }
        let w_in = self.directions::<K>(0, first);
        for k in 0..K {
            s[k] = s[k].times(w_in[k]);
        }
        for i in 1..self.dof {
            let (x, w_in) = (self.normalised(i, y), self.directions::<K>(i, first));
            for k in 0..K {
                s[k] = x.mul_add_parameter(w_in[k], s[k]);
            }
        }
        s
    }

    /// `out` += ρ Σ_k f_k ∂s_k/∂y for K polynomials, one after another: the same bits as of each by
    /// itself.
    #[inline(always)]
    fn accumulate<S: Over<P>, const K: usize>(&self, first: usize, f: [S; K], out: &mut [S]) {
        if self.w_in.is_empty() {
            for k in 0..K {
                out[0] += self.weighed(0, f[k]);
            }
            return;
        }
        for i in 0..self.dof {
            let w_in = self.directions::<K>(i, first);
            let mut sum = out[i];
            for k in 0..K {
                if i < self.actions.len() {
                    sum += self.weighed(i, f[k].times(w_in[k]));
                } else {
                    sum = f[k].mul_add_parameter(w_in[k], sum);
                }
            }
            out[i] = sum;
        }
    }

    /// The largest |s_k|: more than 1 outside the box.
    pub(super) fn reach(&self, y: &[f64]) -> f64
    where
        f64: Over<P>,
    {
        let mut reach = 0.0;
        for first in 0..self.width {
            let [s] = self.ridges::<f64, 1>(first, y);
            reach = crate::scalar::max_or_nan(reach, s.abs());
        }
        reach
    }

    /// `out` ← ∇V(y), filling `tape` with f and f′ of each polynomial for the pullback.
    #[inline(always)]
    pub(super) fn gradient_recording<S: Over<P>>(&self, y: &[S], out: &mut [S], tape: &mut [S]) {
        zero(&mut out[..self.dof]);
        // One at a time, as in all that training does: four would be compiled once more.
        for j in 0..self.width {
            let [f, slope] = S::series_with_slopes::<1>(self.ridges(j, y), self.series(j));
            (tape[2 * j], tape[2 * j + 1]) = (f[0], slope[0]);
            self.accumulate(j, f, out);
        }
    }

    /// `out` ← ∇V(y), `hessian` ← V″(y), n × n row by row.
    #[inline(always)]
    pub(super) fn gradient_and_hessian<S: Over<P>>(
        &self,
        y: &[S],
        out: &mut [S],
        hessian: &mut [S],
    ) {
        let n = self.dof;
        zero(&mut out[..n]);
        zero(&mut hessian[..n * n]);
        for j in 0..self.width {
            let [f, [slope]] = S::series_with_slopes::<1>(self.ridges(j, y), self.series(j));
            self.accumulate(j, f, out);
            for row in 0..n {
                for column in row..n {
                    let mut product = slope;
                    if !self.w_in.is_empty() {
                        product = product.times(self.directions::<1>(row, j)[0]);
                        product = product.times(self.directions::<1>(column, j)[0]);
                    }
                    let scale = S::from_f64(self.inverse_half(column));
                    let entry = &mut hessian[row * n + column];
                    *entry += self.weighed(row, product) * scale;
                }
            }
        }
        for row in 0..n {
            for column in 0..row {
                hessian[row * n + column] = hessian[column * n + row];
            }
        }
    }

    /// The adjoint of (y, parameters) ↦ ∇V(y): for the cotangent `u` of the gradient,
    /// `y_bar` ← V″(y)u and `parameters_bar` += ∂(u·∇V)/∂parameters.
    #[inline(always)]
    pub(super) fn vjp<S: Over<P>>(
        &self,
        y: &[S],
        tape: &[S],
        u: &[S],
        y_bar: &mut [S],
        parameters_bar: &mut [S],
    ) {
        let (n, h) = (self.dof, self.width);
        let (w_bar, c_bar) = parameters_bar.split_at_mut(self.w_in.len());
        zero(&mut y_bar[..n]);
        for j in 0..h {
            let (f, slope) = (tape[2 * j], tape[2 * j + 1]);
            let [s] = self.ridges::<S, 1>(j, y);
            // u·∇V = Σ_k r_k f_k(s_k).
            let mut r = self.weighed(0, u[0]);
            if !self.w_in.is_empty() {
                r = r.times(self.w_in[j]);
                for i in 1..n {
                    r = self.weighed(i, u[i]).mul_add_parameter(self.w_in[i * h + j], r);
                }
            }
            let s_bar = r * slope;
            // r T_m(s), which obey the recurrence of T_m.
            let (mut now, mut next) = (r, r * s);
            let double = s + s;
            for row in c_bar.chunks_exact_mut(h) {
                row[j] += now;
                (now, next) = (next, double.mul_add(next, -now));
            }
            for i in 0..n {
                let mut x_bar = s_bar;
                if !self.w_in.is_empty() {
                    let entry = &mut w_bar[i * h + j];
                    let own = self.weighed(i, u[i]) * f;
                    *entry += s_bar.mul_add(self.normalised(i, y), own);
                    x_bar = s_bar.times(self.w_in[i * h + j]);
                }
                y_bar[i] = x_bar.mul_add(S::from_f64(self.inverse_half(i)), y_bar[i]);
            }
        }
    }
}

/// One polynomial P of the argument s: V = ρP(s) + ….
pub(crate) struct OneRidge {
    /// The argument s of the polynomial at a point y.
    pub(crate) s: f64,
    /// What s is the sum of, in absolute values.
    pub(crate) size: f64,
    /// The derivatives ∂s/∂y of the argument by each of the n numbers of y.
    pub(crate) slopes: Vec<f64>,
}

impl PolynomialPotential<'_, f64> {
    /// Each of the polynomials at y, with its series.
    pub(crate) fn each_ridge(
        &self,
        y: &[f64],
    ) -> impl Iterator<Item = (OneRidge, Series<'_, f64>)> {
        (0..self.width).map(move |k| {
            let [s] = self.ridges::<f64, 1>(k, y);
            let weight = |i: usize| {
                if self.w_in.is_empty() { 1.0 } else { self.w_in[i * self.width + k] }
            };
            let slopes: Vec<f64> =
                (0..self.dof).map(|i| weight(i) * self.inverse_half(i)).collect();
            let centre = |i: usize| self.actions.get(i).map_or(0.0, |action| action.centre.abs());
            let size = (0..self.dof).map(|i| slopes[i].abs() * (y[i].abs() + centre(i))).sum();
            (OneRidge { s, size, slopes }, self.series(k))
        })
    }

    /// The radius ρ of the box, half its extent along each coordinate.
    pub(crate) fn radius(&self) -> f64 {
        self.radius
    }
}

#[inline(always)]
fn zero<S: Scalar>(values: &mut [S]) {
    for value in values.iter_mut() {
        *value = S::zero();
    }
}

impl<P: Copy, S: Over<P>> Potential<S> for PolynomialPotential<'_, P> {
    #[inline(always)]
    fn dof(&self) -> usize {
        self.dof
    }

    #[inline(always)]
    fn gradient(&self, y: &[S], out: &mut [S]) {
        zero(&mut out[..self.dof]);
        for_polynomials!(self.width, j, K => {
            let f = S::series_each::<K>(self.ridges(j, y), self.series(j));
            self.accumulate(j, f, out);
        });
    }
}
