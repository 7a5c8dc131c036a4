//! Symplectic maps whose generating function is a polynomial of least squares.

use super::lane_map::{self, LaneMap};
use super::polynomial_map::MOST_NUMBERS;
use super::product_basis::{DIM, ProductBasis, Run, least_squares, terms};
use super::{Pairs, PolynomialMap};
use crate::error::Error;
use crate::network::Rollout;
use crate::phase::inverse_of_symplectic;
use crate::scalar::{Scalar, max_or_nan};
use faer::Mat;
use faer::linalg::solvers::DenseSolveCore;
use rayon::prelude::*;

/// A symplectic map whose generating function is a polynomial, fitted to pairs by linear least squares.
///
/// z′ = c′ + M·N(z − c), where M is a symplectic matrix near the linear part of the map, and N: (q, p) ↦ (Q, P) is near
/// the identity:
///
/// p = P + ∂F/∂q(q, P),  Q = q + ∂F/∂P(q, P).
///
/// F is a sum of products of Chebyshev polynomials of a total degree over the box of the pairs' (q, P). A step solves
/// the first equation for P by Newton's method, from a polynomial that is near it, with a fixed number of iterations,
/// which brings all pairs to rounding. The map is symplectic for every F, to the error of this solution.
///
/// Source: Goldstein, Poole and Safko, Classical Mechanics, 3rd edition, §9.1, for generating functions of mixed
/// variables; Erdélyi and Berz, <https://doi.org/10.1103/PhysRevLett.87.114302>, for maps of accelerators that are made
/// symplectic by them.
#[derive(Clone, Debug)]
pub struct SymplecticPolynomial {
    dof: usize,
    /// c.
    from: Vec<f64>,
    /// c′.
    to: Vec<f64>,
    /// M, row by row.
    linear: Vec<f64>,
    /// Of (q, P).
    basis: ProductBasis,
    /// Of F.
    coefficients: Vec<f64>,
    start: Start,
    iterations: usize,
}

/// Where Newton's method begins: P as polynomials of z − c.
#[derive(Clone, Debug)]
struct Start {
    basis: ProductBasis,
    coefficients: Vec<f64>,
}

/// A map is of no more degrees of freedom.
const DOF: usize = DIM / 2;
/// A solution takes no more iterations.
const MOST_ITERATIONS: usize = 12;
/// Of Newton's method, a change by this share is the last but for rounding, as errors are squared.
const LAST_CHANGE: f64 = 3e-9;
/// In errors.
const NAME: &str = "a generating function";
/// A fit has so many numbers for each coefficient, at least.
const NUMBERS_A_TERM: usize = 2;

impl SymplecticPolynomial {
    /// The fit, with a generating function of this total degree, to pairs of one map in canonical coordinates.
    ///
    /// # Errors
    /// When the pairs are too few for so many terms, a coordinate of them does not vary, they are of several maps,
    /// or they are of a map whose linear part is not near a symplectic matrix; [`Error::NoConvergence`] when
    /// Newton's method does not find the images of all pairs.
    pub fn fit(pairs: &Pairs, degree: usize) -> Result<Self, Error> {
        let (dof, dim) = (pairs.dof(), 2 * pairs.dof());
        Error::check_count_range("degree of a generating function", degree, 2, usize::MAX)?;
        let numbers = pairs.len() * dim;
        let sound = |count: &usize| {
            count * NUMBERS_A_TERM <= numbers
                && count.checked_mul(numbers).is_some_and(|all| all <= MOST_NUMBERS)
        };
        if terms(dim, degree).filter(sound).is_none() {
            let found = format!("{degree} for {} pairs of {dof} degrees of freedom", pairs.len());
            let expected = "a lower one: there are two numbers for each term";
            return Err(Error::invalid("degree of a generating function", found, expected));
        }
        let affine = PolynomialMap::fit(pairs, 1)?;
        let around = ProductBasis::around(pairs.input(), dim, 1)?;
        let from = around.centre().to_vec();
        let mut to = from.clone();
        affine.step(&mut to);
        // In units in which q and p of each plane are of one size, which are symplectic ones.
        let unit = |k: usize| libm::sqrt(around.factors[(k + dof) % dim] / around.factors[k]);
        let in_units = |matrix: &[f64], sign: f64| -> Vec<f64> {
            let factor = |k: usize| libm::pow(unit(k % dim) / unit(k / dim), sign);
            matrix.iter().enumerate().map(|(k, entry)| entry * factor(k)).collect()
        };
        let linear = in_units(&affine.jacobian(&from), 1.0);
        let linear = in_units(&symplectic_factor(&linear, dof)?, -1.0);
        let back = inverse_of_symplectic(&linear, dof);
        let before: Vec<f64> = pairs
            .input()
            .chunks_exact(dim)
            .flat_map(|z| z.iter().zip(&from).map(|(z, c)| z - c))
            .collect();
        let after: Vec<f64> = pairs
            .output()
            .chunks_exact(dim)
            .flat_map(|z| {
                let off: Vec<f64> = z.iter().zip(&to).map(|(z, c)| z - c).collect();
                apply(&back, &off)
            })
            .collect();
        let rows = || before.chunks_exact(dim).zip(after.chunks_exact(dim));
        let mixed: Vec<f64> =
            rows().flat_map(|(u, v)| u[..dof].iter().chain(&v[dof..]).copied()).collect();
        let basis = ProductBasis::around(&mixed, dim, degree)?;
        let coefficients = generator(&basis, &mixed, &before, &after)?;
        let momenta: Vec<f64> = rows().flat_map(|(_, v)| v[dof..].iter().copied()).collect();
        let count = coefficients.len();
        let mut best: Option<(usize, Self)> = None;
        let mut change = f64::NAN;
        for start in 1..=degree {
            let Some(of_start) = terms(dim, start).filter(|count| 2 * count <= pairs.len()) else {
                break;
            };
            let start = Start::fit(&before, &momenta, dim, start)?;
            let mut fitted = Self {
                dof,
                from: from.clone(),
                to: to.clone(),
                linear: linear.clone(),
                basis: basis.clone(),
                coefficients: coefficients.clone(),
                start,
                iterations: 0,
            };
            let found = fitted.iterations_needed(&before);
            change = found.1;
            let Some(iterations) = found.0 else { continue };
            fitted.iterations = iterations;
            // In products of a coefficient: a term and its slope in each iteration, and a slope after them.
            let cost = dof * of_start + (2 * iterations + 1) * count;
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, fitted));
            }
            if iterations == 1 {
                break;
            }
        }
        match best {
            Some((_, fitted)) => Ok(fitted),
            None => {
                let what = "the images of a generating function".to_owned();
                Err(Error::NoConvergence { what, iterations: MOST_ITERATIONS, change })
            }
        }
    }

    /// The first number of iterations whose last change is one of rounding for all points; and the last change.
    fn iterations_needed(&self, before: &[f64]) -> (Option<usize>, f64) {
        let (dof, dim) = (self.dof, 2 * self.dof);
        let factors = &self.basis.factors[dof..];
        let mut largest = f64::NAN;
        for iterations in 1..=MOST_ITERATIONS {
            let changes = before.par_chunks_exact(dim).map(|u| {
                let mut here = [[0.0]; DIM];
                for (here, u) in here.iter_mut().zip(u) {
                    *here = [*u];
                }
                let mut space = vec![[0.0]; self.space()];
                let (_, change) = self.solve::<f64, 0, 1>(&here, &mut space, iterations);
                change.iter().zip(factors).map(|(c, f)| (c[0] * f).abs()).fold(0.0, max_or_nan)
            });
            largest = changes.reduce(|| 0.0, max_or_nan);
            if largest <= LAST_CHANGE {
                return (Some(iterations), largest);
            }
        }
        (None, largest)
    }

    /// The total degree of its generating function.
    pub fn degree(&self) -> usize {
        self.basis.degree
    }

    /// How many coefficients its generating function has, without the constant.
    pub fn parameters(&self) -> usize {
        self.coefficients.len() - 1
    }

    /// How many iterations of Newton's method a step takes.
    pub fn iterations(&self) -> usize {
        self.iterations
    }

    /// z ← its image.
    ///
    /// # Panics
    /// When z is not of 2n numbers.
    #[inline(always)]
    pub fn step<S: Scalar>(&self, z: &mut [S]) {
        lane_map::step(self, z);
    }

    /// The root mean square distance of its images from those of pairs.
    pub fn error_on(&self, pairs: &Pairs) -> f64 {
        lane_map::error_on(self, pairs)
    }

    /// Its Jacobian at a point: 2n × 2n numbers, row by row.
    pub fn jacobian(&self, z: &[f64]) -> Vec<f64> {
        lane_map::jacobian(self, z)
    }

    /// The states of an orbit of each initial point, as a network's [`rollout`](crate::network::rollout) gives them:
    /// (steps/every + 1, M, 2n), the first being the initial points.
    ///
    /// # Errors
    /// When there are no whole rows, or `every` is 0.
    pub fn rollout(&self, initial: &[f64], request: Rollout) -> Result<Vec<f64>, Error> {
        lane_map::rollout(self, initial, request)
    }

    /// P of (q, p) at G points, and the last change of each of its components. `space` then has the tables of q and
    /// those of P before this change.
    #[inline(always)]
    fn solve<S: Scalar, const D: usize, const G: usize>(
        &self,
        here: &[[S; G]; DIM],
        space: &mut [[S; G]],
        iterations: usize,
    ) -> ([[S; G]; DOF], [[S; G]; DOF]) {
        let dof = if D > 0 { D / 2 } else { self.dof };
        let count = self.basis.count();
        let mut begin = [[S::zero(); G]; DIM];
        let Start { basis, coefficients } = &self.start;
        basis.values(2 * dof, dof, coefficients, here, space, &mut begin);
        let mut momenta = [[S::zero(); G]; DOF];
        momenta[..dof].copy_from_slice(&begin[..dof]);
        let mut change = [[S::zero(); G]; DOF];
        for axis in 0..dof {
            let tables = &mut space[2 * axis * count..][..2 * count];
            self.basis.fill_with_slopes(axis, &here[axis], tables);
        }
        for _ in 0..iterations {
            self.fill_momenta(dof, &momenta, space);
            let (mut rest, mut matrix) = self.kicks(dof, space);
            for i in 0..dof {
                for g in 0..G {
                    rest[i][g] += momenta[i][g] - here[dof + i][g];
                    matrix[i][i][g] += S::from_f64(1.0);
                }
            }
            change = solved(dof, &mut matrix, rest);
            for i in 0..dof {
                for g in 0..G {
                    momenta[i][g] -= change[i][g];
                }
            }
        }
        (momenta, change)
    }

    #[inline(always)]
    fn fill_momenta<S: Scalar, const G: usize>(
        &self,
        dof: usize,
        momenta: &[[S; G]; DOF],
        space: &mut [[S; G]],
    ) {
        let count = self.basis.count();
        for axis in 0..dof {
            let tables = &mut space[2 * (dof + axis) * count..][..2 * count];
            self.basis.fill_with_slopes(dof + axis, &momenta[axis], tables);
        }
    }

    /// The sum over terms that differ in their degree in the last coordinate, of the term and of its derivative by it.
    #[inline(always)]
    fn along_last<S: Scalar, const G: usize>(
        &self,
        dof: usize,
        own: &[f64],
        space: &[[S; G]],
    ) -> [[S; G]; 2] {
        let count = self.basis.count();
        let tables = &space[2 * (2 * dof - 1) * count..][..2 * count];
        let mut out = [[S::zero(); G]; 2];
        for (k, c) in own.iter().enumerate() {
            let c = S::from_f64(*c);
            for g in 0..G {
                out[0][g] = tables[k][g].mul_add(c, out[0][g]);
                out[1][g] = tables[count + k][g].mul_add(c, out[1][g]);
            }
        }
        out
    }

    /// The product of a run's polynomials of all coordinates but the last, or of their derivatives along some.
    #[inline(always)]
    fn before_last<S: Scalar, const G: usize>(
        &self,
        run: &Run,
        along: [usize; 2],
        space: &[[S; G]],
    ) -> [S; G] {
        let count = self.basis.count();
        let mut out = [S::from_f64(1.0); G];
        for (axis, k) in run.degrees.iter().enumerate() {
            let slope = usize::from(along[0] == axis || along[1] == axis);
            let table = &space[(2 * axis + slope) * count..][..count];
            for g in 0..G {
                out[g] *= table[*k][g];
            }
        }
        out
    }

    /// ∂F/∂q, and ∂²F/∂q∂P row by row.
    #[inline(always)]
    fn kicks<S: Scalar, const G: usize>(
        &self,
        dof: usize,
        space: &[[S; G]],
    ) -> ([[S; G]; DOF], [[[S; G]; DOF]; DOF]) {
        let mut gradient = [[S::zero(); G]; DOF];
        let mut hessian = [[[S::zero(); G]; DOF]; DOF];
        let (last, mut first) = (dof - 1, 0);
        for run in &self.basis.runs {
            let own = &self.coefficients[first..=first + run.left];
            first += own.len();
            let [value, slope] = self.along_last(dof, own, space);
            for i in 0..dof {
                let factor = self.before_last(run, [i, NONE], space);
                for g in 0..G {
                    gradient[i][g] = factor[g].mul_add(value[g], gradient[i][g]);
                    hessian[i][last][g] = factor[g].mul_add(slope[g], hessian[i][last][g]);
                }
                for j in 0..last {
                    let factor = self.before_last(run, [i, dof + j], space);
                    for g in 0..G {
                        hessian[i][j][g] = factor[g].mul_add(value[g], hessian[i][j][g]);
                    }
                }
            }
        }
        (gradient, hessian)
    }

    /// ∂F/∂P.
    #[inline(always)]
    fn drifts<S: Scalar, const G: usize>(&self, dof: usize, space: &[[S; G]]) -> [[S; G]; DOF] {
        let mut out = [[S::zero(); G]; DOF];
        let (last, mut first) = (dof - 1, 0);
        for run in &self.basis.runs {
            let own = &self.coefficients[first..=first + run.left];
            first += own.len();
            let [value, slope] = self.along_last(dof, own, space);
            let factor = self.before_last(run, [NONE; 2], space);
            for g in 0..G {
                out[last][g] = factor[g].mul_add(slope[g], out[last][g]);
            }
            for j in 0..last {
                let factor = self.before_last(run, [dof + j, NONE], space);
                for g in 0..G {
                    out[j][g] = factor[g].mul_add(value[g], out[j][g]);
                }
            }
        }
        out
    }
}

/// Along no coordinate.
const NONE: usize = usize::MAX;

impl LaneMap for SymplecticPolynomial {
    const FOUR: bool = false;

    fn dim(&self) -> usize {
        2 * self.dof
    }

    /// For two tables of each coordinate.
    fn space(&self) -> usize {
        4 * self.dof * self.basis.count()
    }

    #[inline(always)]
    fn move_together<S: Scalar, const D: usize, const G: usize>(
        &self,
        space: &mut [[S; G]],
        z: &mut [S],
    ) {
        let dof = if D > 0 { D / 2 } else { self.dof };
        let dim = 2 * dof;
        let mut here = [[S::zero(); G]; DIM];
        for g in 0..G {
            for k in 0..dim {
                here[k][g] = z[g * dim + k] - S::from_f64(self.from[k]);
            }
        }
        let (momenta, _) = self.solve::<S, D, G>(&here, space, self.iterations);
        self.fill_momenta(dof, &momenta, space);
        let drifts = self.drifts(dof, space);
        for i in 0..dof {
            for g in 0..G {
                here[i][g] += drifts[i][g];
            }
            here[dof + i] = momenta[i];
        }
        for g in 0..G {
            for row in 0..dim {
                let mut sum = S::from_f64(self.to[row]);
                for k in 0..dim {
                    sum = here[k][g].mul_add(S::from_f64(self.linear[row * dim + k]), sum);
                }
                z[g * dim + row] = sum;
            }
        }
    }
}

/// The solution of n equations by elimination. The matrix is near the identity.
#[inline(always)]
fn solved<S: Scalar, const G: usize>(
    dof: usize,
    matrix: &mut [[[S; G]; DOF]; DOF],
    mut right: [[S; G]; DOF],
) -> [[S; G]; DOF] {
    for column in 0..dof {
        for row in column + 1..dof {
            for g in 0..G {
                let factor = matrix[row][column][g] / matrix[column][column][g];
                for k in column + 1..dof {
                    let above = matrix[column][k][g];
                    matrix[row][k][g] -= factor * above;
                }
                let above = right[column][g];
                right[row][g] -= factor * above;
            }
        }
    }
    for row in (0..dof).rev() {
        for g in 0..G {
            for k in row + 1..dof {
                let known = right[k][g];
                right[row][g] -= matrix[row][k][g] * known;
            }
            right[row][g] /= matrix[row][row][g];
        }
    }
    right
}

impl Start {
    fn fit(before: &[f64], momenta: &[f64], dim: usize, degree: usize) -> Result<Self, Error> {
        let basis = ProductBasis::around(before, dim, degree)?;
        let rows: Vec<Vec<f64>> =
            before.par_chunks_exact(dim).map(|u| basis.products(u, None)).collect();
        let dof = dim / 2;
        let coefficients = least_squares(
            NAME,
            [rows.len(), rows[0].len(), dof],
            |i, k| rows[i][k],
            |i, k| momenta[i * dof + k],
        )?;
        Ok(Self { basis, coefficients })
    }
}

/// The coefficients of F: from p − P at each (q, P) its slope along q, and from Q − q that along P, in units of the
/// box.
fn generator(
    basis: &ProductBasis,
    mixed: &[f64],
    before: &[f64],
    after: &[f64],
) -> Result<Vec<f64>, Error> {
    let dim = basis.dim;
    let dof = dim / 2;
    let pair = |k: usize| (k + dof) % dim;
    let scale = |axis: usize| basis.factors[pair(axis)];
    let number = mixed.len();
    let row = |index: usize| (index / dim, index % dim);
    let rows: Vec<Vec<f64>> = (0..number)
        .into_par_iter()
        .map(|index| {
            let (point, axis) = row(index);
            basis.products(&mixed[point * dim..][..dim], Some(axis))
        })
        .collect();
    let count = rows[0].len();
    // The constant has no slope.
    let coefficients = least_squares(
        NAME,
        [number, count - 1, 1],
        |index, k| rows[index][k + 1] * scale(row(index).1),
        |index, _| {
            let (point, axis) = row(index);
            let [u, v] = [before, after].map(|z| z[point * dim + pair(axis)]);
            (if axis < dof { u - v } else { v - u }) * scale(axis)
        },
    )?;
    Ok([0.0].into_iter().chain(coefficients).collect())
}

/// The matrix times a vector.
fn apply(matrix: &[f64], vector: &[f64]) -> Vec<f64> {
    let rows = matrix.chunks_exact(vector.len());
    rows.map(|row| row.iter().zip(vector).map(|(a, b)| a * b).sum()).collect()
}

/// The symplectic factor S of a matrix A = S·B, by A ← ½(A + ΩA⁻ᵀΩᵀ), which converges as Newton's method does.
///
/// Source: Higham, Mackey, Mackey and Tisseur, <https://doi.org/10.1137/S0895479803426644>, of such factors.
fn symplectic_factor(matrix: &[f64], dof: usize) -> Result<Vec<f64>, Error> {
    const ITERATIONS: usize = 50;
    let dim = 2 * dof;
    let mut here = matrix.to_vec();
    for _ in 0..ITERATIONS {
        let inverted = Mat::from_fn(dim, dim, |i, k| here[i * dim + k]).partial_piv_lu().inverse();
        let inverted: Vec<f64> = (0..dim * dim).map(|k| inverted[(k / dim, k % dim)]).collect();
        // Of a symplectic matrix the inverse of its inverse by the form is itself.
        let other = inverse_of_symplectic(&inverted, dof);
        let (mut change, mut size) = (0.0, 0.0);
        for (own, other) in here.iter_mut().zip(other) {
            let next = 0.5 * (*own + other);
            change = max_or_nan(change, (next - *own).abs());
            size = max_or_nan(size, next.abs());
            *own = next;
        }
        if change <= LAST_CHANGE * size {
            return Ok(here);
        }
    }
    let what = "the linear part of a map";
    Err(Error::invalid(what, "one far from symplectic", "one near a symplectic matrix"))
}
