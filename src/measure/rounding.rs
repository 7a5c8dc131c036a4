//! Rounding errors followed through a map, shear by shear.

use crate::layer::{ElementaryStep, Potential};
use crate::scalar::Dual;

/// One step of a map, with the scale of the rounding errors that it makes.
///
/// Matrices are 2n × 2n, row by row.
pub trait MeasuredStep {
    /// z ← the step of z.
    fn apply(&self, z: &mut [f64]);

    /// The same with derivatives in eight directions.
    fn apply_tangent(&self, z: &mut [Dual<f64, 8>]);

    /// `e` ← the scale, in units of u, of the error that the step leaves in
    /// the running Jacobian, which is `before` at its input z and `after` at
    /// its output.
    fn jacobian_magnitude(&self, z: &[f64], before: &[f64], after: &[f64], e: &mut [f64]);

    /// `delta` ← the scale, in units of u, of the error that the step leaves
    /// in the point, which it moves from z to `after`.
    fn value_magnitude(&self, z: &[f64], after: &[f64], delta: &mut [f64]);
}

/// Steps in the order of application.
pub type MeasuredSteps<'a> = Vec<Box<dyn MeasuredStep + 'a>>;

impl<V> MeasuredStep for ElementaryStep<'_, f64, V>
where
    V: Potential<f64> + Potential<Dual<f64, 8>>,
{
    fn apply(&self, z: &mut [f64]) {
        ElementaryStep::apply(self, z, &mut vec![0.0; z.len()]);
    }
    fn apply_tangent(&self, z: &mut [Dual<f64, 8>]) {
        ElementaryStep::apply(self, z, &mut vec![Dual::constant(0.0); z.len()]);
    }
    fn jacobian_magnitude(&self, z: &[f64], before: &[f64], after: &[f64], e: &mut [f64]) {
        ElementaryStep::jacobian_magnitude(self, z, before, after, e);
    }
    fn value_magnitude(&self, z: &[f64], after: &[f64], delta: &mut [f64]) {
        ElementaryStep::value_magnitude(self, z, after, delta);
    }
}

/// The points and Jacobians along a sequence of shears, with the scale of the
/// rounding error that each of them makes.
///
/// Matrices are 2n × 2n, row by row.
#[derive(Clone, Debug)]
pub struct Walk {
    dim: usize,
    /// Before the first step and after each.
    points: Vec<Vec<f64>>,
    jacobians: Vec<Vec<f64>>,
    /// e of each step, in units of u.
    jacobian_errors: Vec<Vec<f64>>,
    /// δ of each step, in units of u.
    value_errors: Vec<Vec<f64>>,
}

/// J⁻¹ = −ΩJᵀΩ for a symplectic J: no linear system is solved.
pub fn inverse_of_symplectic(jacobian: &[f64], dof: usize) -> Vec<f64> {
    let dim = 2 * dof;
    let mut out = vec![0.0; dim * dim];
    // (Ωv)_i = v_{n+i}, (Ωv)_{n+i} = −v_i.
    let partner = |i: usize| if i < dof { (i + dof, 1.0) } else { (i - dof, -1.0) };
    for i in 0..dim {
        for k in 0..dim {
            let (pi, si) = partner(i);
            let (pk, sk) = partner(k);
            out[i * dim + k] = si * sk * jacobian[pk * dim + pi];
        }
    }
    out
}

impl Walk {
    /// Walks from z through the steps.
    pub fn new(steps: &[Box<dyn MeasuredStep + '_>], z: &[f64]) -> Self {
        let dim = z.len();
        let mut jacobians = vec![vec![0.0; dim * dim]; steps.len() + 1];
        let mut points = Vec::with_capacity(steps.len() + 1);
        for first in (0..dim).step_by(8) {
            let mut w: Vec<Dual<f64, 8>> = z
                .iter()
                .enumerate()
                .map(|(i, &v)| Dual::variable(v, i.wrapping_sub(first)))
                .collect();
            for k in 0..=steps.len() {
                if k > 0 {
                    steps[k - 1].apply_tangent(&mut w);
                }
                for (row, value) in w.iter().enumerate() {
                    for column in first..dim.min(first + 8) {
                        jacobians[k][row * dim + column] = value.eps[column - first];
                    }
                }
                if first == 0 {
                    points.push(w.iter().map(|v| v.re).collect::<Vec<f64>>());
                }
            }
        }
        let mut jacobian_errors = Vec::with_capacity(steps.len());
        let mut value_errors = Vec::with_capacity(steps.len());
        for (k, step) in steps.iter().enumerate() {
            let mut e = vec![0.0; dim * dim];
            step.jacobian_magnitude(&points[k], &jacobians[k], &jacobians[k + 1], &mut e);
            jacobian_errors.push(e);
            let mut delta = vec![0.0; dim];
            step.value_magnitude(&points[k], &points[k + 1], &mut delta);
            value_errors.push(delta);
        }
        Self { dim, points, jacobians, jacobian_errors, value_errors }
    }

    /// 2n.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// The point after all steps.
    pub fn end(&self) -> &[f64] {
        &self.points[self.points.len() - 1]
    }

    /// The Jacobian of all steps.
    pub fn jacobian(&self) -> &[f64] {
        &self.jacobians[self.jacobians.len() - 1]
    }

    /// After each step: (the running Jacobian Ĵ, its error scale e).
    pub(super) fn jacobian_steps(&self) -> impl Iterator<Item = (&[f64], &[f64])> {
        self.jacobians[1..]
            .iter()
            .zip(&self.jacobian_errors)
            .map(|(jacobian, error)| (&jacobian[..], &error[..]))
    }

    /// Bounds of the rounding error at the end, in units of u, for each
    /// component: the root of the sum of squares and the plain sum of
    /// |J_N Jᵢ⁻¹|δᵢ over the steps.
    pub fn value_bounds(&self) -> (Vec<f64>, Vec<f64>) {
        let dim = self.dim;
        let mut squares = vec![0.0; dim];
        let mut sums = vec![0.0; dim];
        let total = self.jacobian();
        for (jacobian, delta) in self.jacobians[1..].iter().zip(&self.value_errors) {
            if delta.iter().all(|d| *d == 0.0) {
                continue;
            }
            let inverse = inverse_of_symplectic(jacobian, dim / 2);
            for row in 0..dim {
                let mut reach = 0.0;
                for (column, d) in delta.iter().enumerate() {
                    let mut entry = 0.0;
                    for k in 0..dim {
                        entry += total[row * dim + k] * inverse[k * dim + column];
                    }
                    reach += entry.abs() * d;
                }
                squares[row] += reach * reach;
                sums[row] += reach;
            }
        }
        (squares.into_iter().map(f64::sqrt).collect(), sums)
    }
}
