//! Products of Chebyshev polynomials of several coordinates, up to a total degree.

use super::Region;
use crate::error::Error;
use crate::scalar::{Scalar, max_or_nan};
use faer::Mat;
use faer::linalg::solvers::SolveLstsq;
use serde::{Deserialize, Serialize};

/// Products of Chebyshev polynomials over a box, of a total degree at most.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "Kept", into = "Kept")]
pub(super) struct ProductBasis {
    pub(super) dim: usize,
    pub(super) degree: usize,
    centre: Vec<f64>,
    /// One over half the extent of the box along each coordinate.
    pub(super) factors: Vec<f64>,
    /// The degrees in so many of the first coordinates have an even sum: all of them where it is 0.
    even_in: usize,
    /// Terms in the last coordinate from degree 0 on, run after run.
    pub(super) runs: Vec<Run>,
}

/// Terms that differ in their degree in the last coordinate alone.
#[derive(Clone, Debug)]
pub(super) struct Run {
    /// The degrees in all coordinates but the last.
    pub(super) degrees: Vec<usize>,
    /// The highest degree in the last one.
    pub(super) left: usize,
}

/// What files keep of a basis.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept {
    degree: usize,
    even_in: usize,
    centre: Vec<f64>,
    factors: Vec<f64>,
}

impl From<ProductBasis> for Kept {
    fn from(basis: ProductBasis) -> Self {
        let ProductBasis { degree, centre, factors, even_in, .. } = basis;
        Self { degree, even_in, centre, factors }
    }
}

impl TryFrom<Kept> for ProductBasis {
    type Error = Error;

    fn try_from(kept: Kept) -> Result<Self, Error> {
        let Kept { degree, even_in, centre, factors } = kept;
        let dim = centre.len();
        Error::check_count_range("coordinates", dim, 1, DIM)?;
        Error::check_count("factors", dim, factors.len())?;
        Error::check_count_range("even_in", even_in, 0, dim - 1)?;
        if terms(dim, degree).is_none() {
            let expected = format!("one of {MOST_TERMS} terms at most");
            return Err(Error::invalid("degree", degree, expected));
        }
        centre.iter().try_for_each(|c| Error::check_finite("centre", *c))?;
        factors
            .iter()
            .try_for_each(|f| Error::check_range("factor", *f, Error::LEAST_POSITIVE, f64::MAX))?;
        Ok(Self { dim, degree, centre, factors, even_in: 0, runs: runs(dim, degree) }.even(even_in))
    }
}

/// A basis has no more terms.
const MOST_TERMS: usize = 10_000;
/// A basis is of no more coordinates.
pub(super) const DIM: usize = 8;

/// How many products of a total degree of at most `degree` there are in so many coordinates; None of too many.
pub(super) fn terms(dim: usize, degree: usize) -> Option<usize> {
    let mut count = 1usize;
    for k in 1..=dim {
        count = count.checked_mul(degree.checked_add(k)?)? / k;
    }
    (count <= MOST_TERMS && dim <= DIM).then_some(count)
}

/// All runs that leave a degree of at least 0 for the last coordinate.
fn runs(dim: usize, degree: usize) -> Vec<Run> {
    let mut out = vec![Run { degrees: Vec::new(), left: degree }];
    for _ in 1..dim {
        let longer = |run: &Run| -> Vec<Run> {
            let of = |k: usize| Run {
                degrees: run.degrees.iter().copied().chain([k]).collect(),
                left: run.left - k,
            };
            (0..=run.left).map(of).collect()
        };
        out = out.iter().flat_map(longer).collect();
    }
    out
}

impl ProductBasis {
    /// Over the box around these points.
    ///
    /// # Errors
    /// When there are none, or a coordinate does not vary.
    pub(super) fn around(points: &[f64], dim: usize, degree: usize) -> Result<Self, Error> {
        let region = Region::around(dim, [points])
            .ok_or_else(|| Error::invalid("pairs", "none", "at least one"))?;
        let (mut centre, mut factors) = (Vec::new(), Vec::new());
        for (k, (low, high)) in region.low.iter().zip(&region.high).enumerate() {
            if !(low < high) {
                let found = format!("{low} in all pairs");
                return Err(Error::invalid(&format!("coordinate {k}"), found, "one that varies"));
            }
            centre.push(0.5 * (low + high));
            factors.push(2.0 / (high - low));
        }
        Ok(Self { dim, degree, centre, factors, even_in: 0, runs: runs(dim, degree) })
    }

    /// Without the terms whose degrees in the first `first` coordinates have an odd sum. At least one coordinate follows
    /// these.
    pub(super) fn even(mut self, first: usize) -> Self {
        assert!(first < self.dim);
        self.even_in = first;
        self.runs.retain(|run| run.degrees[..first].iter().sum::<usize>().is_multiple_of(2));
        self
    }

    /// How many terms there are.
    pub(super) fn terms(&self) -> usize {
        self.runs.iter().map(|run| run.left + 1).sum()
    }

    /// The middle of its box.
    pub(super) fn centre(&self) -> &[f64] {
        &self.centre
    }

    /// Whether a point is in the box.
    pub(super) fn is_inside(&self, z: &[f64]) -> bool {
        let sizes = z.iter().zip(&self.centre).zip(&self.factors).map(|((v, c), f)| (v - c) * f);
        sizes.fold(0.0, |largest: f64, size| max_or_nan(largest, size.abs())) <= 1.0
    }

    /// How many polynomials of one coordinate there are.
    pub(super) fn count(&self) -> usize {
        self.degree + 1
    }

    /// A coordinate of several points, from −1 to 1 in the box.
    #[inline(always)]
    fn scaled<S: Scalar, const G: usize>(&self, axis: usize, value: &[S; G]) -> [S; G] {
        let mut s = [S::zero(); G];
        for g in 0..G {
            s[g] = (value[g] - S::from_f64(self.centre[axis])) * S::from_f64(self.factors[axis]);
        }
        s
    }

    /// T_k of a coordinate of G points, k up to the degree.
    #[inline(always)]
    pub(super) fn fill<S: Scalar, const G: usize>(
        &self,
        axis: usize,
        value: &[S; G],
        table: &mut [[S; G]],
    ) {
        let s = self.scaled(axis, value);
        let mut terms = [[S::from_f64(1.0); G], s];
        for entry in table {
            *entry = terms[0];
            let mut next = s;
            for g in 0..G {
                next[g] = (s[g] + s[g]).mul_add(terms[1][g], -terms[0][g]);
            }
            terms = [terms[1], next];
        }
    }

    /// T_k of a coordinate of G points, and its derivatives of order 1, 2, … by that coordinate: one table of k up to the
    /// degree for each order, as many as `tables` holds.
    #[inline(always)]
    pub(super) fn fill_with_derivatives<S: Scalar, const G: usize>(
        &self,
        axis: usize,
        value: &[S; G],
        tables: &mut [[S; G]],
    ) {
        let count = self.count();
        self.fill(axis, value, &mut tables[..count]);
        let s = self.scaled(axis, value);
        // D^m T_{k+1} = 2m D^{m−1} T_k + 2 s D^m T_k − D^m T_{k−1}, in units of half the box.
        for order in 1..tables.len() / count {
            let factor = S::from_f64(order as f64 * self.factors[axis]);
            let (lower, higher) = tables[(order - 1) * count..].split_at_mut(count);
            let first = if order == 1 { factor } else { S::zero() };
            let mut last = [[S::zero(); G], [first; G]];
            for (k, entry) in higher[..count].iter_mut().enumerate() {
                *entry = last[0];
                let mut next = last[1];
                if k + 1 < count {
                    for g in 0..G {
                        let inner = lower[k + 1][g].mul_add(factor, s[g] * last[1][g]);
                        next[g] = inner + inner - last[0][g];
                    }
                }
                last = [last[1], next];
            }
        }
    }

    /// The value of each term; of its derivative along one coordinate where that is given.
    pub(super) fn products(&self, z: &[f64], along: Option<usize>) -> Vec<f64> {
        let count = self.count();
        let mut tables = vec![[0.0]; 2 * self.dim * count];
        for (axis, tables) in tables.chunks_exact_mut(2 * count).enumerate() {
            self.fill_with_derivatives(axis, &[z[axis]], tables);
        }
        let of = |axis: usize, k: usize| {
            tables[(2 * axis + usize::from(along == Some(axis))) * count + k][0]
        };
        let (last, mut out) = (self.dim - 1, Vec::new());
        for Run { degrees, left } in &self.runs {
            let first: f64 = degrees.iter().enumerate().map(|(axis, k)| of(axis, *k)).product();
            out.extend((0..=*left).map(|k| first * of(last, k)));
        }
        out
    }

    /// Sums of all terms at G points, times the coefficients of each output, which are together for a term: `dim`
    /// coordinates, that of the basis, and `outputs` outputs. `tables` are space for a table of each coordinate.
    #[inline(always)]
    pub(super) fn values<S: Scalar, const G: usize>(
        &self,
        dim: usize,
        outputs: usize,
        coefficients: &[f64],
        z: &[[S; G]; DIM],
        tables: &mut [[S; G]],
        out: &mut [[S; G]; DIM],
    ) {
        let count = self.count();
        for axis in 0..dim {
            self.fill(axis, &z[axis], &mut tables[axis * count..][..count]);
        }
        for k in 0..outputs {
            out[k] = [S::zero(); G];
        }
        let mut terms = coefficients.chunks_exact(outputs);
        for Run { degrees, left } in &self.runs {
            let mut inner = [[S::zero(); G]; DIM];
            for (power, term) in tables[(dim - 1) * count..][..=*left].iter().zip(&mut terms) {
                for k in 0..outputs {
                    let c = S::from_f64(term[k]);
                    for g in 0..G {
                        inner[k][g] = power[g].mul_add(c, inner[k][g]);
                    }
                }
            }
            let mut first = [S::from_f64(1.0); G];
            for (axis, k) in degrees.iter().enumerate() {
                for g in 0..G {
                    first[g] *= tables[axis * count + k][g];
                }
            }
            for k in 0..outputs {
                for g in 0..G {
                    out[k][g] = first[g].mul_add(inner[k][g], out[k][g]);
                }
            }
        }
    }
}

/// The coefficients that fit `outputs` values in each of so many equations best in the sense of least squares, those of
/// all outputs of a term together.
///
/// # Errors
/// When one of them is not finite; `what` names them.
pub(super) fn least_squares(
    what: &str,
    [equations, terms, outputs]: [usize; 3],
    term: impl Fn(usize, usize) -> f64,
    value: impl Fn(usize, usize) -> f64,
) -> Result<Vec<f64>, Error> {
    let matrix = Mat::from_fn(equations, terms, term);
    let right = Mat::from_fn(equations, outputs, value);
    let solution = matrix.qr().solve_lstsq(&right);
    let coefficients: Vec<f64> =
        (0..terms * outputs).map(|k| solution[(k / outputs, k % outputs)]).collect();
    if let Some(bad) = coefficients.iter().find(|c| !c.is_finite()) {
        return Err(Error::invalid(&format!("coefficient of {what}"), bad, "a finite number"));
    }
    Ok(coefficients)
}
