//! Maps that are given implicitly, by equations to be solved.

use crate::phase::Map;
use crate::scalar::{Dual, Elementary, Real, Scalar, Tracked, max_or_nan};
use faer::linalg::solvers::DenseSolveCore;
use faer::{Col, Mat};

/// An implicit step z ↦ z′: x solves F(z, x) = 0, and z′ is a function of z and x.
///
/// [`Solved`] makes a [`Map`] of it. The implicit midpoint rule, with x = z′:
///
/// ```
/// use gyroceptron::measure::{Implicit, OneStep, Solved, certificate::{CertificateOptions, certify_map}};
/// use gyroceptron::scalar::{Elementary, constant};
///
/// /// Of the pendulum H = ½p² − cos q.
/// struct Midpoint(f64);
///
/// impl Implicit for Midpoint {
///     fn dof(&self) -> usize {
///         1
///     }
///     fn residual<S: Elementary>(&self, z: &[S], next: &[S], out: &mut [S]) {
///         let (h, half) = (constant::<S>(self.0), constant::<S>(0.5));
///         let (q, p) = ((z[0] + next[0]) * half, (z[1] + next[1]) * half);
///         out[0] = next[0] - z[0] - h * p;
///         out[1] = next[1] - z[1] + h * q.sin_cos().0;
///     }
/// }
///
/// certify_map(&OneStep(Solved(Midpoint(0.1))), CertificateOptions::default()).assert_holds();
/// ```
pub trait Implicit {
    /// The number of degrees of freedom n.
    fn dof(&self) -> usize;

    /// The number of components of x: 2n where x is z′, more for the stages of a method.
    fn unknowns(&self) -> usize {
        2 * self.dof()
    }

    /// `out` ← F(z, x), as many numbers as x has.
    fn residual<S: Elementary>(&self, z: &[S], x: &[S], out: &mut [S]);

    /// z ← z′, computed from z and x: the first 2n numbers of x, by default.
    fn end<S: Elementary>(&self, z: &mut [S], x: &[S]) {
        let dim = z.len();
        z.copy_from_slice(&x[..dim]);
    }

    /// Whether the map has an inverse, which is found by solving the same equations for z.
    fn has_inverse(&self) -> bool {
        true
    }

    /// z and `x` ← the initial guess of Newton's method for the inverse at z′ = `end`: by default
    /// z′ itself for z, and the [guess](Implicit::guess) from it for x.
    fn guess_back(&self, end: &[f64], z: &mut [f64], x: &mut [f64]) {
        z.copy_from_slice(end);
        self.guess(end, x);
    }

    /// `x` ← the initial guess of Newton's method: by default z, repeated as often as x has room for.
    fn guess(&self, z: &[f64], x: &mut [f64]) {
        for (x, z) in x.iter_mut().zip(z.iter().cycle()) {
            *x = *z;
        }
    }
}

/// An implicit step as a map over the number type; its inverse solves the same
/// equations for z.
///
/// The equations are solved in `f64` by Newton's method. Two more steps x ← x − A⁻¹F(z, x), with
/// A = ∂F/∂x at the solution, are done in the number type, so that derivatives are those of the
/// implicit function theorem and rounding errors those of the last step. A full Newton iteration
/// on numbers that carry error bounds would double the bounds in each step, and no certificate
/// could be based on them.
///
/// Do not reduce angles by `rem_euclid` here: its jump would stop the method. Declare them as
/// angles in the [domain](super::Coordinate::Angle) instead.
///
/// Where the method does not converge the result is NaN. Cost: about six inversions of a matrix
/// of the size of x; for the inverse of the map the size is larger by 2n.
///
/// Source: Griewank and Walther, Evaluating Derivatives, <https://doi.org/10.1137/1.9780898717761>,
/// chapter 15, for derivatives of iterations.
#[derive(Clone, Copy, Debug)]
pub struct Solved<M>(pub M);

/// F(given, x) = 0 of so many unknowns x.
trait Equations {
    fn count(&self) -> usize;
    fn residual<S: Elementary>(&self, given: &[S], x: &[S], out: &mut [S]);
}

/// The unknowns of the step from z.
struct Ahead<'a, M>(&'a M);

impl<M: Implicit> Equations for Ahead<'_, M> {
    fn count(&self) -> usize {
        self.0.unknowns()
    }
    fn residual<S: Elementary>(&self, given: &[S], x: &[S], out: &mut [S]) {
        self.0.residual(given, x, out);
    }
}

/// z and the unknowns of the step from it, for the z′ that is given.
struct Back<'a, M>(&'a M);

impl<M: Implicit> Equations for Back<'_, M> {
    fn count(&self) -> usize {
        2 * self.0.dof() + self.0.unknowns()
    }
    fn residual<S: Elementary>(&self, given: &[S], x: &[S], out: &mut [S]) {
        let (z, x) = x.split_at(2 * self.0.dof());
        let (end, rest) = out.split_at_mut(z.len());
        end.copy_from_slice(z);
        self.0.end(end, x);
        for (end, given) in end.iter_mut().zip(given) {
            *end -= *given;
        }
        self.0.residual(z, x, rest);
    }
}

/// ∂F/∂x at x, and F there.
fn derivative_and_residual(
    equations: &impl Equations,
    given: &[f64],
    x: &[f64],
) -> (Mat<f64>, Col<f64>) {
    let count = equations.count();
    let constants: Vec<Dual<f64, 8>> = given.iter().map(|&v| Dual::constant(v)).collect();
    let mut out = vec![Dual::constant(0.0); count];
    let mut matrix = Mat::zeros(count, count);
    for first in (0..count).step_by(8) {
        let columns = first..count.min(first + 8);
        let variables: Vec<Dual<f64, 8>> = x
            .iter()
            .enumerate()
            .map(|(i, &v)| match columns.contains(&i) {
                true => Dual::variable(v, i - first),
                false => Dual::constant(v),
            })
            .collect();
        equations.residual(&constants, &variables, &mut out);
        for (row, value) in out.iter().enumerate() {
            for column in columns.clone() {
                matrix[(row, column)] = value.eps[column - first];
            }
        }
    }
    (matrix, Col::from_fn(count, |i| out[i].re))
}

/// Whether F(given, x) is zero up to the rounding of its evaluation and of x.
fn is_rounding(
    equations: &impl Equations,
    given: &[f64],
    x: &[f64],
    derivative: &Mat<f64>,
    residual: &Col<f64>,
) -> bool {
    const ROOM: f64 = 4.0;
    let exact = |values: &[f64]| values.iter().map(|&v| Tracked::exact(v)).collect::<Vec<_>>();
    let mut tracked = vec![Tracked::exact(0.0); x.len()];
    equations.residual(&exact(given), &exact(x), &mut tracked);
    tracked.iter().enumerate().all(|(i, value)| {
        let of_x: f64 = x.iter().enumerate().map(|(j, x)| (derivative[(i, j)] * x).abs()).sum();
        residual[i].abs() <= ROOM * f64::unit_roundoff() * (value.bound + of_x) + f64::MIN_POSITIVE
    })
}

/// x ← the solution; the inverse of ∂F/∂x there, none where no solution was found.
fn solve(equations: &impl Equations, given: &[f64], x: &mut [f64]) -> Option<Mat<f64>> {
    const MOST: usize = 60;
    const HALVINGS: u32 = 10;
    let mut before = f64::INFINITY;
    for _ in 0..MOST {
        let (derivative, residual) = derivative_and_residual(equations, given, x);
        let inverse = derivative.partial_piv_lu().inverse();
        let step = &inverse * &residual;
        let size = step.iter().fold(0.0, |m, v: &f64| max_or_nan(m, v.abs()));
        if !size.is_finite() {
            return None;
        }
        // Steps of the quadratic range shrink until rounding stops them.
        let stopped = size == 0.0 || !(size < 0.5 * before);
        if stopped && is_rounding(equations, given, x, &derivative, &residual) {
            return Some(inverse);
        }
        let stepped = |share: f64| -> Vec<f64> {
            x.iter().zip(step.iter()).map(|(x, step)| (-share).mul_add(*step, *x)).collect()
        };
        // Shorter steps where the whole one leads away from the solution.
        let closer = |next: &[f64]| {
            let mut residual = vec![0.0; next.len()];
            equations.residual(given, next, &mut residual);
            let left = &inverse * &Col::from_fn(next.len(), |i| residual[i]);
            left.iter().fold(0.0, |m, v: &f64| max_or_nan(m, v.abs())) < size
        };
        let shares = (0..=HALVINGS).map(|k| libm::exp2(-f64::from(k)));
        let next = shares.map(stepped).find(|next| closer(next)).unwrap_or_else(|| stepped(1.0));
        before = if next == stepped(1.0) { size } else { f64::INFINITY };
        x.copy_from_slice(&next);
    }
    None
}

/// x ← x − A⁻¹F(given, x).
fn newton_step<S: Real>(equations: &impl Equations, inverse: &Mat<f64>, given: &[S], x: &mut [S]) {
    let count = x.len();
    let mut residual = vec![S::zero(); count];
    equations.residual(given, x, &mut residual);
    for i in 0..count {
        let mut step = S::zero();
        for j in 0..count {
            step = S::from_f64(inverse[(i, j)]).mul_add(residual[j], step);
        }
        // What x was in error by is in F too, and goes with it.
        x[i] = x[i].inherits(x[i]) - step;
    }
}

/// The solution as numbers of this type, from where Newton's method is to begin.
fn solved<S: Real>(equations: &impl Equations, given: &[S], guess: Vec<f64>) -> Vec<S> {
    let mut x = guess;
    let values: Vec<f64> = given.iter().map(|v| v.value()).collect();
    let Some(inverse) = solve(equations, &values, &mut x) else {
        return vec![S::from_f64(f64::NAN); x.len()];
    };
    let first = |given: &[S]| {
        let mut out: Vec<S> = x.iter().map(|v| S::from_f64(*v)).collect();
        newton_step(equations, &inverse, given, &mut out);
        out
    };
    let exact: Vec<S> = given.iter().map(|v| v.inherits(*v)).collect();
    // Of the bounds of x those that it has from z, and none of its own rounding.
    let mut out: Vec<S> =
        first(given).into_iter().zip(first(&exact)).map(|(a, b)| a.inherits(b)).collect();
    newton_step(equations, &inverse, given, &mut out);
    out
}

impl<S: Real, M: Implicit> Map<S> for Solved<M> {
    fn dof(&self) -> usize {
        self.0.dof()
    }

    fn forward(&self, z: &mut [S]) {
        let values: Vec<f64> = z.iter().map(|v| v.value()).collect();
        let mut guess = vec![0.0; self.0.unknowns()];
        self.0.guess(&values, &mut guess);
        let x = solved(&Ahead(&self.0), z, guess);
        self.0.end(z, &x);
    }

    fn inverse(&self, z: &mut [S]) {
        let values: Vec<f64> = z.iter().map(|v| v.value()).collect();
        let dim = values.len();
        let mut guess = vec![0.0; dim + self.0.unknowns()];
        let (start, x) = guess.split_at_mut(dim);
        self.0.guess_back(&values, start, x);
        let solution = solved(&Back(&self.0), z, guess);
        z.copy_from_slice(&solution[..dim]);
    }

    fn has_inverse(&self) -> bool {
        self.0.has_inverse()
    }
}
