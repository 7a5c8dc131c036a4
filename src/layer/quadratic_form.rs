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

    /// `out` += ∇V(y) = Sy.
    #[inline(always)]
    pub(super) fn add_gradient<S: Over<P>>(&self, y: &[S], out: &mut [S]) {
        let mut entry = 0;
        for i in 0..self.n() {
            for j in i..self.n() {
                out[i] = y[j].mul_add_parameter(self.entries[entry], out[i]);
                if j != i {
                    out[j] = y[i].mul_add_parameter(self.entries[entry], out[j]);
                }
                entry += 1;
            }
        }
    }

    /// `hessian` += V″ = S, n × n row by row.
    #[inline(always)]
    pub(super) fn add_hessian<S: Over<P>>(&self, hessian: &mut [S]) {
        let (n, mut entry) = (self.n(), 0);
        for i in 0..n {
            for j in i..n {
                let more = S::embed(self.entries[entry]);
                hessian[i * n + j] += more;
                if j != i {
                    hessian[j * n + i] += more;
                }
                entry += 1;
            }
        }
    }

    /// The adjoint of (y, entries) ↦ ∇V(y): for the cotangent `u` of the gradient, `y_bar` +=
    /// Su and `entries_bar` += ∂(u·∇V)/∂entries.
    #[inline(always)]
    pub(super) fn vjp<S: Over<P>>(&self, y: &[S], u: &[S], y_bar: &mut [S], entries_bar: &mut [S]) {
        self.add_gradient(u, y_bar);
        let mut entry = 0;
        for i in 0..self.n() {
            for j in i..self.n() {
                entries_bar[entry] = u[i].mul_add(y[j], entries_bar[entry]);
                if j != i {
                    entries_bar[entry] = u[j].mul_add(y[i], entries_bar[entry]);
                }
                entry += 1;
            }
        }
    }
}
