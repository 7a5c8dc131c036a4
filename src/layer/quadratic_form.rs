//! Quadratic forms, and what their gradients and adjoints need.

use crate::scalar::{Over, Scalar};

/// n(n + 1)/2, the entries of a symmetric n × n matrix on and above the diagonal.
///
/// Saturates instead of overflowing.
pub(crate) const fn symmetric_len(dof: usize) -> usize {
    dof.saturating_mul(dof.saturating_add(1)) / 2
}

/// V(y) = ½yᵀSy, S symmetric, by the rows of its upper triangle. `D` fixes n at compile time
/// where the caller knows it; `D = 0` takes n from the arguments.
#[derive(Clone, Copy, Debug)]
pub(super) struct QuadraticForm<'a, P, const D: usize = 0> {
    dof: usize,
    entries: &'a [P],
}

impl<'a, P: Scalar, const D: usize> QuadraticForm<'a, P, D> {
    /// # Panics
    /// When `entries` are not [`symmetric_len`] numbers, or `D` is neither 0 nor `dof`.
    #[inline(always)]
    pub(super) fn new(dof: usize, entries: &'a [P]) -> Self {
        assert!((D == 0 || D == dof) && entries.len() == symmetric_len(dof));
        Self { dof, entries }
    }

    #[inline(always)]
    fn n(&self) -> usize {
        if D > 0 { D } else { self.dof }
    }

    /// The place of S_ij among the parameters.
    #[inline(always)]
    fn place(&self, i: usize, j: usize) -> usize {
        let (row, column) = if i < j { (i, j) } else { (j, i) };
        row * (2 * self.n() - row + 1) / 2 + column - row
    }

    /// `out` += ∇V(y) = Sy.
    #[inline(always)]
    pub(super) fn add_gradient<S: Over<P>>(&self, y: &[S], out: &mut [S]) {
        for i in 0..self.n() {
            for j in 0..self.n() {
                out[i] = y[j].mul_add_parameter(self.entries[self.place(i, j)], out[i]);
            }
        }
    }

    /// `hessian` += V″ = S, n × n row by row.
    #[inline(always)]
    pub(super) fn add_hessian<S: Over<P>>(&self, hessian: &mut [S]) {
        let n = self.n();
        for i in 0..n {
            for j in 0..n {
                let entry = S::embed(self.entries[self.place(i, j)]);
                hessian[i * n + j] = hessian[i * n + j] + entry;
            }
        }
    }

    /// The adjoint of (y, entries) ↦ ∇V(y): for the cotangent `u` of the gradient, `y_bar` +=
    /// Su and `entries_bar` += ∂(u·∇V)/∂entries.
    #[inline(always)]
    pub(super) fn pullback<S: Over<P>>(
        &self,
        y: &[S],
        u: &[S],
        y_bar: &mut [S],
        entries_bar: &mut [S],
    ) {
        self.add_gradient(u, y_bar);
        for i in 0..self.n() {
            for j in 0..self.n() {
                let entry = &mut entries_bar[self.place(i, j)];
                *entry = u[i].mul_add(y[j], *entry);
            }
        }
    }
}
