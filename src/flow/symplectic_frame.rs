//! The coordinates in which a symplectic map is near the identity: the linear part of its pairs, made symplectic.

use super::product_basis::ProductBasis;
use super::symmetries::Symmetries;
use super::{Pairs, PolynomialMap};
use crate::error::Error;
use crate::phase::{Half, inverse_of_symplectic};
use crate::scalar::max_or_nan;
use faer::Mat;
use faer::linalg::solvers::DenseSolveCore;
use serde::{Deserialize, Serialize};

/// Of an iteration that converges as Newton's method does, a change by this share is the last but for rounding.
const LAST_CHANGE: f64 = 3e-9;
/// A matrix of a file is symplectic to this, over the sums of the sizes of the products that this compares.
pub(super) const NEARLY: f64 = 1e-10;
/// And what its inverse times it has on the diagonal is 1 to this.
const ON_DIAGONAL: f64 = 1e-6;
/// The name of what is fitted, in error messages.
pub(super) const NAME: &str = "a generating function";
const REVERSIBLE: &str = "the linear part of a reversible map";

/// u = K(z − c) and z′ = c′ + M·v.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Frame {
    /// The middle c of the points.
    pub(super) from: Vec<f64>,
    /// K, row by row; None of the identity.
    pub(super) entry: Option<Vec<f64>>,
    /// The middle c′ of their images.
    pub(super) to: Vec<f64>,
    /// M, row by row; None of the identity.
    pub(super) exit: Option<Vec<f64>>,
}

impl Frame {
    pub(super) fn of(pairs: &Pairs, symmetries: &Symmetries) -> Result<Self, Error> {
        let (dof, dim) = (pairs.dof(), 2 * pairs.dof());
        let reversor = symmetries.reversor;
        let affine = PolynomialMap::fit(pairs, 1)?;
        let points = match reversor {
            None => pairs.input().to_vec(),
            // Of the inverse they are pairs too.
            Some(reversor) => {
                let own = [pairs.input(), pairs.output()].concat();
                [&own[..], &reflected(&own, dim, reversor.half())].concat()
            }
        };
        let around = ProductBasis::around(&symmetries.with_images(points, dof), dim, 1)?;
        let from = around.centre().to_vec();
        // In units in which q and p of each plane are of one size, which are symplectic ones.
        let unit = |k: usize| libm::sqrt(around.factors[(k + dof) % dim] / around.factors[k]);
        let in_units = |matrix: &[f64], sign: f64| -> Vec<f64> {
            let factor = |k: usize| libm::pow(unit(k % dim) / unit(k / dim), sign);
            matrix.iter().enumerate().map(|(k, entry)| entry * factor(k)).collect()
        };
        let mut linear = affine.jacobian(&from);
        symmetries.clear(&mut linear, dof);
        let mut linear = in_units(&linear, 1.0);
        let sizes: Vec<f64> = (0..dof)
            .map(|j| 1.0 / libm::sqrt(around.factors[j] * around.factors[dof + j]))
            .collect();
        couple(&mut linear, &sizes);
        let linear = symplectic_factor(&linear, dof)?;
        let Some(reversor) = reversor else {
            let mut to = from.clone();
            affine.step(&mut to);
            for k in (0..dim).filter(|k| symmetries.is_mirrored(*k, dof)) {
                to[k] = 0.0;
            }
            let mut exit = in_units(&linear, -1.0);
            symmetries.clear(&mut exit, dof);
            return Ok(Self { from, entry: None, to, exit: Some(exit) });
        };
        let half = reversor.half();
        // Of a reversible M, RM is its own inverse.
        let unlike = || {
            let found = "one that the reflection does not turn into its inverse";
            Error::invalid(REVERSIBLE, found, "pairs of a reversible map")
        };
        let involution = sign(&rows_reflected(&linear, dim, half), dim).ok_or_else(unlike)?;
        let linear = rows_reflected(&involution, dim, half);
        let unlike = || {
            let found = "one with no square root";
            Error::invalid(REVERSIBLE, found, "one that turns no plane by half a turn")
        };
        let root = in_units(&square_root(&linear, dim).ok_or_else(unlike)?, -1.0);
        // Reflected coordinates come first: (q, p) ↦ (p, −q) where these are the momenta.
        let (mut entry, mut exit) = (root.clone(), root);
        if half == Half::Momentum {
            entry.rotate_left(dof * dim);
            entry[dof * dim..].iter_mut().for_each(|v| *v = -*v);
            for row in exit.chunks_exact_mut(dim) {
                row.rotate_left(dof);
                row[dof..].iter_mut().for_each(|v| *v = -*v);
            }
        }
        symmetries.clear(&mut entry, dof);
        symmetries.clear(&mut exit, dof);
        Ok(Self { to: from.clone(), from, entry: Some(entry), exit: Some(exit) })
    }

    /// Fails unless its vectors and matrices are of `dim` numbers and rows, and the matrices symplectic.
    pub(super) fn check(&self, dim: usize) -> Result<(), Error> {
        for (place, numbers) in [("from", &self.from), ("to", &self.to)] {
            Error::check_count(place, dim, numbers.len())?;
            numbers.iter().try_for_each(|v| Error::check_finite(place, *v))?;
        }
        let both = [("entry", &self.entry), ("exit", &self.exit)];
        for (place, matrix) in
            both.into_iter().filter_map(|(place, of)| Some((place, of.as_ref()?)))
        {
            Error::check_count(place, dim * dim, matrix.len())?;
            let back = inverse_of_symplectic(matrix, dim / 2);
            for (i, row) in back.chunks_exact(dim).enumerate() {
                for k in 0..dim {
                    let products = || row.iter().zip(matrix[k..].iter().step_by(dim));
                    let found: f64 = products().map(|(a, b)| a * b).sum();
                    let size: f64 = products().map(|(a, b)| (a * b).abs()).sum();
                    let off = (found - if i == k { 1.0 } else { 0.0 }).abs();
                    // Of products that cancel, what is left on the diagonal is 1.
                    let most = if i == k { ON_DIAGONAL } else { f64::MAX };
                    if !(off <= most.min(NEARLY * size)) {
                        let found = format!("a matrix that is off by {off:e}");
                        return Err(Error::invalid(place, found, "a symplectic matrix"));
                    }
                }
            }
        }
        Ok(())
    }

    /// v = M⁻¹(z′ − c′) and z = c + K⁻¹·u.
    pub(super) fn inverse(&self, dof: usize) -> Self {
        let inverted = |matrix: &Option<Vec<f64>>| {
            matrix.as_ref().map(|matrix| inverse_of_symplectic(matrix, dof))
        };
        Self {
            from: self.to.clone(),
            entry: inverted(&self.exit),
            to: self.from.clone(),
            exit: inverted(&self.entry),
        }
    }

    /// The coordinates u = K(z − c) of a point z.
    pub(super) fn enter(&self, z: &[f64]) -> Vec<f64> {
        let off = difference(z, &self.from);
        self.entry.as_ref().map_or_else(|| off.clone(), |entry| apply(entry, &off))
    }
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Points with a half of their coordinates reflected.
pub(super) fn reflected(points: &[f64], dim: usize, half: Half) -> Vec<f64> {
    let is_own = |k: usize| (k % dim < dim / 2) == (half == Half::Position);
    points.iter().enumerate().map(|(k, v)| if is_own(k) { -*v } else { *v }).collect()
}

/// The product of the reflection R of one half of the coordinates and a matrix.
pub(super) fn rows_reflected(matrix: &[f64], dim: usize, half: Half) -> Vec<f64> {
    let is_own = |row: usize| (row < dim / 2) == (half == Half::Position);
    matrix.iter().enumerate().map(|(k, v)| if is_own(k / dim) { -*v } else { *v }).collect()
}

fn inverted(matrix: &[f64], dim: usize) -> Vec<f64> {
    let inverse = Mat::from_fn(dim, dim, |i, k| matrix[i * dim + k]).partial_piv_lu().inverse();
    (0..dim * dim).map(|k| inverse[(k / dim, k % dim)]).collect()
}

/// The matrix times a vector.
pub(super) fn apply(matrix: &[f64], vector: &[f64]) -> Vec<f64> {
    let rows = matrix.chunks_exact(vector.len());
    rows.map(|row| row.iter().zip(vector).map(|(a, b)| a * b).sum()).collect()
}

/// The limit of A ← ½(A + f(A)), if it comes to rest.
fn limit(matrix: &[f64], other: impl Fn(&[f64]) -> Vec<f64>) -> Option<Vec<f64>> {
    const ITERATIONS: usize = 50;
    let mut here = matrix.to_vec();
    for _ in 0..ITERATIONS {
        let (mut change, mut size) = (0.0, 0.0);
        let other = other(&here);
        for (own, other) in here.iter_mut().zip(other) {
            let next = 0.5 * (*own + other);
            change = max_or_nan(change, (next - *own).abs());
            size = max_or_nan(size, next.abs());
            *own = next;
        }
        if size.is_finite() && change <= LAST_CHANGE * size {
            return Some(here);
        }
    }
    None
}

/// Replaces what small planes do to far larger ones in a linear part, by what it is in a symplectic matrix of which the
/// rest is known. A fit knows the block from a small plane to a large one to as many digits as others, and these are
/// too few: a symplectic matrix has the same numbers in the block from the large plane to the small one.
fn couple(linear: &mut [f64], sizes: &[f64]) {
    /// Planes of sizes that differ by less are fitted as well as each other.
    const FAR: f64 = 3.0;
    type Block = [[f64; 2]; 2];
    let (dof, dim) = (sizes.len(), 2 * sizes.len());
    let product = |a: Block, b: Block| -> Block {
        [0, 1].map(|i| [0, 1].map(|k| a[i][0] * b[0][k] + a[i][1] * b[1][k]))
    };
    let transposed = |a: Block| -> Block { [[a[0][0], a[1][0]], [a[0][1], a[1][1]]] };
    const FORM: Block = [[0.0, 1.0], [-1.0, 0.0]];
    for (large, small) in (0..dof).flat_map(|i| (0..dof).map(move |j| (i, j))) {
        if !(sizes[large] > FAR * sizes[small]) {
            continue;
        }
        let place = |i: usize, j: usize, a: usize, b: usize| (i + a * dof) * dim + j + b * dof;
        let block = |i, j| -> Block { [0, 1].map(|a| [0, 1].map(|b| linear[place(i, j, a, b)])) };
        let own = block(large, large);
        let determinant = own[0][0] * own[1][1] - own[0][1] * own[1][0];
        // (M_iiᵀ)⁻¹
        let inverse: Block = [[own[1][1], -own[1][0]], [-own[0][1], own[0][0]]]
            .map(|row| row.map(|v| v / determinant));
        let known = product(product(transposed(block(small, large)), FORM), block(small, small));
        // M_iiᵀΩM_ij + M_jiᵀΩM_jj = 0
        let coupled = product(FORM, product(inverse, known));
        if coupled.iter().flatten().all(|v| v.is_finite()) {
            for (a, row) in coupled.iter().enumerate() {
                for (b, value) in row.iter().enumerate() {
                    linear[place(large, small, a, b)] = *value;
                }
            }
        }
    }
}

/// The symplectic factor S of a matrix A = S·B, by A ← ½(A + ΩA⁻ᵀΩᵀ), which converges as Newton's method does.
///
/// Source: Higham, Mackey, Mackey and Tisseur, <https://doi.org/10.1137/S0895479803426644>, of such factors.
fn symplectic_factor(matrix: &[f64], dof: usize) -> Result<Vec<f64>, Error> {
    // Of a symplectic matrix the inverse of its inverse by the form is itself.
    let other = |here: &[f64]| inverse_of_symplectic(&inverted(here, 2 * dof), dof);
    let what = "the linear part of a map";
    let unlike = || Error::invalid(what, "one far from symplectic", "one near a symplectic matrix");
    limit(matrix, other).ok_or_else(unlike)
}

/// The sign of a matrix, which is its own inverse, by A ← ½(A + A⁻¹).
///
/// Source: Higham, Functions of Matrices, <https://doi.org/10.1137/1.9780898717778>, chapter 5.
fn sign(matrix: &[f64], dim: usize) -> Option<Vec<f64>> {
    limit(matrix, |here| inverted(here, dim))
}

/// The square root of a matrix without negative real eigenvalues, from the sign of (0, A; 1, 0).
fn square_root(matrix: &[f64], dim: usize) -> Option<Vec<f64>> {
    let block = |row: usize, column: usize| match (row < dim, column < dim) {
        (true, false) => matrix[row * dim + column - dim],
        (false, true) if row - dim == column => 1.0,
        _ => 0.0,
    };
    let whole: Vec<f64> = (0..4 * dim * dim).map(|k| block(k / (2 * dim), k % (2 * dim))).collect();
    let sign = sign(&whole, 2 * dim)?;
    Some((0..dim).flat_map(|row| sign[row * 2 * dim + dim..][..dim].to_vec()).collect())
}
