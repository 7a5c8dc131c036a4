//! Propagation of rounding errors through a map, shear by shear.

use super::coordinate::coordinate;
use super::{coordinate::Coordinate, defect::symplecticity_defect, measured_step::MeasuredStep};
use crate::phase::inverse_of_symplectic;
use crate::random::Stream;
use crate::scalar::{Dual, Scalar, max_or_nan};
use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, MatRef};

/// The points and Jacobians along a sequence of steps, with the scale of the
/// rounding error that each step makes.
///
/// Source: that errors of rounding are propagated by Jacobians, and are as if independent: Higham,
/// <https://doi.org/10.1137/1.9780898718027>, sections 2.8 and 3.
pub struct RoundingPropagation<'a> {
    steps: &'a [Box<dyn MeasuredStep + 'a>],
    dim: usize,
    /// Before the first step and after each.
    points: Vec<Vec<f64>>,
    /// 2n × 2n, row by row.
    jacobians: Vec<Vec<f64>>,
    /// e of each step, in units of u.
    jacobian_errors: Vec<Vec<f64>>,
    /// δ of each step, in units of u.
    value_errors: Vec<Vec<f64>>,
}

/// J⁻¹, row by row: of a symplectic J without a linear system, of any other by faer's LU decomposition; infinite
/// where that leaves no digit, and 0 where there is none: a map that flattens points has no way back, and no rounding
/// excuses one.
fn inverse(jacobian: &[f64], dof: usize, may_be_symplectic: bool) -> Vec<f64> {
    /// Of |J|². Above rounding, and below what the inverse of another matrix would be off by.
    const SYMPLECTIC: f64 = 1e-8;
    /// Of J·J⁻¹ − Id and J⁻¹·J − Id.
    const RESIDUAL: f64 = 1e-8;
    /// Of larger entries a determinant may cancel to 0.
    const MODERATE: f64 = 1e6;
    let dim = 2 * dof;
    let matrix = MatRef::from_row_major_slice(jacobian, dim, dim);
    let defect = symplecticity_defect(matrix).norm_max();
    // Its entries show what is not finite.
    let is_symplectic = may_be_symplectic && defect <= SYMPLECTIC * matrix.squared_norm_l2();
    if !matrix.is_all_finite() || is_symplectic {
        return inverse_of_symplectic(jacobian, dof);
    }
    if matrix.norm_max() <= MODERATE && matrix.determinant() == 0.0 {
        return vec![0.0; dim * dim];
    }
    let inverse = matrix.partial_piv_lu().inverse();
    let identity = Mat::<f64>::identity(dim, dim);
    let residuals = [&(matrix * &inverse), &(&inverse * matrix)];
    let sound = |product: &Mat<f64>| (product - &identity).norm_max() <= RESIDUAL;
    match residuals.into_iter().all(sound) {
        true => (0..dim * dim).map(|k| inverse[(k / dim, k % dim)]).collect(),
        false => vec![f64::INFINITY; dim * dim],
    }
}

/// `a`·`b`, `dim` × `dim` row by row.
pub(super) fn product(dim: usize, a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; dim * dim];
    for row in 0..dim {
        for inner in 0..dim {
            for column in 0..dim {
                out[row * dim + column] += a[row * dim + inner] * b[inner * dim + column];
            }
        }
    }
    out
}

/// √(a² + b²), NaN if either is: `hypot` would lose the NaN beside an infinity.
pub(super) fn hypot_or_nan(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { libm::hypot(a, b) }
}

/// An error of rounding is at least u times this, a few multiples of 2⁻¹⁰⁷⁴, to
/// which results below the normal numbers are rounded.
const UNDERFLOW: f64 = 4.0 * f64::MIN_POSITIVE;

/// The size of an entry of a Jacobian: what underflowed on the way to it may be
/// as large as the smallest normal number.
fn entry_size(entry: f64) -> f64 {
    entry.abs() + f64::MIN_POSITIVE
}

/// One step over duals that start as `directions` (row by row); `out` ← the
/// derivatives behind it, in the same form. Returns the point behind it.
pub(super) fn carry(
    step: &dyn MeasuredStep,
    z: &[f64],
    directions: &[f64],
    out: &mut [f64],
) -> Vec<f64> {
    let dim = z.len();
    let mut point = Vec::new();
    for first in (0..dim).step_by(8) {
        let columns = first..dim.min(first + 8);
        let mut w: Vec<Dual<f64, 8>> = z.iter().map(|&v| Dual::constant(v)).collect();
        for (row, value) in w.iter_mut().enumerate() {
            for column in columns.clone() {
                value.eps[column - first] = directions[row * dim + column];
            }
        }
        step.apply_tangent(&mut w);
        for (row, value) in w.iter().enumerate() {
            for column in columns.clone() {
                out[row * dim + column] = value.eps[column - first];
            }
        }
        point = w.iter().map(|value| value.re).collect();
    }
    point
}

impl<'a> RoundingPropagation<'a> {
    /// Evaluates the steps one after another, starting from z.
    pub fn new(steps: &'a [Box<dyn MeasuredStep + 'a>], z: &[f64]) -> Self {
        let dim = z.len();
        let mut jacobians = vec![vec![0.0; dim * dim]; steps.len() + 1];
        for i in 0..dim {
            jacobians[0][i * dim + i] = 1.0;
        }
        let mut points = vec![z.to_vec()];
        for (k, step) in steps.iter().enumerate() {
            let (done, rest) = jacobians.split_at_mut(k + 1);
            let tangent = carry(&**step, &points[k], &done[k], &mut rest[0]);
            let mut next = points[k].clone();
            step.apply(&mut next);
            // The derivative of another map certifies nothing of this one.
            if tangent.iter().zip(&next).any(|(a, b)| a.to_bits() != b.to_bits()) {
                next.fill(f64::NAN);
            }
            points.push(next);
        }
        let mut jacobian_errors = Vec::with_capacity(steps.len());
        let mut value_errors = Vec::with_capacity(steps.len());
        for (k, step) in steps.iter().enumerate() {
            let mut e = vec![0.0; dim * dim];
            step.jacobian_magnitude(&points[k], &jacobians[k], &jacobians[k + 1], &mut e);
            jacobian_errors.push(e);
            let mut delta = vec![0.0; dim];
            step.value_magnitude(&points[k], &points[k + 1], &mut delta);
            for d in delta.iter_mut().filter(|d| **d != 0.0) {
                *d += UNDERFLOW;
            }
            value_errors.push(delta);
        }
        Self { steps, dim, points, jacobians, jacobian_errors, value_errors }
    }

    /// The number 2n of coordinates.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// The point after all steps.
    pub fn end(&self) -> &[f64] {
        &self.points[self.points.len() - 1]
    }

    /// The Jacobian of all steps.
    pub fn jacobian(&self) -> MatRef<'_, f64> {
        MatRef::from_row_major_slice(self.last_jacobian(), self.dim, self.dim)
    }

    /// The Jacobian of all steps, row by row.
    pub(super) fn last_jacobian(&self) -> &[f64] {
        &self.jacobians[self.jacobians.len() - 1]
    }

    /// After each step: (the running Jacobian Ĵ, its error scale e).
    pub(super) fn jacobian_steps(&self) -> impl Iterator<Item = (&[f64], &[f64])> {
        self.jacobians[1..]
            .iter()
            .zip(&self.jacobian_errors)
            .map(|(jacobian, error)| (&jacobian[..], &error[..]))
    }

    /// Whether each step is nearly linear over the rounding errors that reach it,
    /// as every scale here assumes. Its nonlinear part has to be small compared
    /// with its linear response to these errors or with its own rounding error.
    /// The errors are found by evaluating the steps again with each result moved
    /// at random, up or down, by half to all of its rounding scale.
    pub fn is_linear(&self) -> bool {
        self.is_linear_within(&[])
    }

    /// [`RoundingPropagation::is_linear`] for steps between points of a
    /// [domain](super::Measurable::domain).
    pub(super) fn is_linear_within(&self, domain: &[Coordinate]) -> bool {
        /// A share of the error, as it is found by the probes, that grows to no
        /// more than its triple where it is ten times that.
        const SMALL: f64 = 0.3;
        const PROBES: usize = 2;
        let u = f64::unit_roundoff();
        // Not by one size, of which sums cancel, nor back to where it began.
        let moved = |value: f64, most: f64, draw: f64| {
            let by = most * (0.5 + (draw - 0.5).abs());
            let (to, next) = if draw < 0.5 {
                (value - by, value.next_down())
            } else {
                (value + by, value.next_up())
            };
            if to == value && by > 0.0 { next } else { to }
        };
        let mut stream = Stream::new(0, "rounding probe");
        let mut probes = vec![self.points[0].clone(); PROBES];
        let mut curvature = vec![0.0; self.dim];
        for (k, step) in self.steps.iter().enumerate() {
            let point = &self.points[k];
            let errors: Vec<[f64; 8]> = (0..self.dim)
                .map(|i| {
                    let error = |probe| {
                        let moved = |p: &Vec<f64>| p[i] - point[i];
                        coordinate(domain, i).difference(probes.get(probe).map_or(0.0, moved))
                    };
                    std::array::from_fn(error)
                })
                .collect();
            let largest =
                |errors: &[f64; 8]| errors.iter().fold(0.0, |m, e| max_or_nan(m, e.abs()));
            let spread: Vec<f64> = errors.iter().map(largest).collect();
            step.curvature_magnitude(point, &spread, &mut curvature);
            let mut response: Vec<Dual<f64, 8>> =
                point.iter().zip(errors).map(|(&re, eps)| Dual { re, eps }).collect();
            step.apply_tangent(&mut response);
            for i in 0..self.dim {
                let linear = max_or_nan(largest(&response[i].eps), u * self.value_errors[k][i]);
                if !(curvature[i] <= SMALL * linear && linear.is_finite()) {
                    return false;
                }
            }
            for probe in &mut probes {
                step.apply(probe);
                for (value, delta) in probe.iter_mut().zip(&self.value_errors[k]) {
                    *value = moved(*value, u * delta, stream.unit());
                }
            }
        }
        true
    }

    /// The running Jacobian after each step, with its inverse.
    pub(super) fn inverses(&self) -> impl Iterator<Item = (&[f64], Vec<f64>)> {
        let mut may_be_symplectic = true;
        self.jacobians[1..].iter().zip(self.steps).map(move |(jacobian, step)| {
            may_be_symplectic &= step.may_be_symplectic();
            (&jacobian[..], inverse(jacobian, self.dim / 2, may_be_symplectic))
        })
    }

    /// Two scales, in units of u, of the distance from the start after the first
    /// `count` steps and their exact inverse. The first is √2 times the root of the sum of
    /// squares of |Jᵢ⁻¹|δᵢ over these steps: the size of independent errors, and no bound. The
    /// second is twice their plain sum: the worst case. The factors √2 and 2 are there because
    /// the way back makes the same errors once more.
    ///
    /// The second scale is infinite where a Jacobian is not finite. The steps
    /// after the first `count` do not enter, so a wrong inverse cannot excuse itself.
    pub fn return_scales(&self, count: usize) -> (Vec<f64>, Vec<f64>) {
        let dim = self.dim;
        let mut squares = vec![0.0; dim];
        let mut sums = vec![0.0; dim];
        for ((jacobian, inverse), delta) in self.inverses().take(count).zip(&self.value_errors) {
            for row in 0..dim {
                let reach: f64 = (0..dim)
                    .filter(|column| delta[*column] != 0.0)
                    .map(|column| entry_size(inverse[row * dim + column]) * delta[column])
                    .sum();
                // Squares would under- and overflow.
                squares[row] = hypot_or_nan(squares[row], reach);
                sums[row] += reach;
            }
            if !jacobian.iter().all(|entry| entry.is_finite()) {
                sums.fill(f64::INFINITY);
            }
        }
        let twice = |v: Vec<f64>, factor: f64| v.into_iter().map(|x| factor * x).collect();
        (twice(squares, std::f64::consts::SQRT_2), twice(sums, 2.0))
    }

    /// Two scales of the rounding error at the end, in units of u, for each
    /// component: the root of the sum of squares (of independent errors) and the plain sum (the
    /// worst case) of |A_N ⋯ A_{i+1}|δᵢ over the steps, Aᵢ being their Jacobians.
    ///
    /// The product is formed from the last step backwards: J_N Jᵢ⁻¹ would lose all
    /// digits in a composition that returns to its start.
    pub fn value_scales(&self) -> (Vec<f64>, Vec<f64>) {
        let dim = self.dim;
        let mut squares = vec![0.0; dim];
        let mut sums = vec![0.0; dim];
        let mut identity = vec![0.0_f64; dim * dim];
        for i in 0..dim {
            identity[i * dim + i] = 1.0;
        }
        let mut behind = identity.clone();
        let mut of_step = identity.clone();
        for (k, delta) in self.value_errors.iter().enumerate().rev() {
            for row in 0..dim {
                let reach: f64 = (0..dim)
                    .filter(|column| delta[*column] != 0.0)
                    .map(|column| entry_size(behind[row * dim + column]) * delta[column])
                    .sum();
                // Squares would under- and overflow.
                squares[row] = hypot_or_nan(squares[row], reach);
                sums[row] += reach;
            }
            carry(&*self.steps[k], &self.points[k], &identity, &mut of_step);
            behind = product(dim, &behind, &of_step);
        }
        (squares, sums)
    }
}
