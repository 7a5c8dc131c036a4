//! Least-squares polynomial maps, which are quickly fitted to pairs and preserve no structure.

use super::Pairs;
use super::lane_map::{self, LaneMap};
use super::product_basis::{DIM, ProductBasis, least_squares, terms};
use crate::error::Error;
use crate::network::{Controls, Rollout};
use crate::scalar::{Scalar, max_or_nan, median_or_nan};
use rayon::prelude::*;

/// A polynomial map of a total degree, fitted to pairs by least squares in products of Chebyshev polynomials over the
/// box of their inputs. It is not symplectic.
///
/// Source: Berz, Modern Map Methods in Particle Beam Physics, Academic Press (1999), for maps by polynomials and what
/// they are used for; Trefethen, Approximation Theory and Approximation Practice, SIAM (2013), for the basis.
#[derive(Clone, Debug)]
pub struct PolynomialMap {
    basis: ProductBasis,
    /// The coefficients of all terms, run after run, those of all outputs of a term together.
    coefficients: Vec<f64>,
}

/// A fit has so many pairs for each term, at least.
const PAIRS_A_TERM: usize = 2;
/// Numbers of a matrix of all terms at all pairs, at most: 1 GiB.
pub(super) const MOST_NUMBERS: usize = 1 << 27;

impl PolynomialMap {
    /// The fit of this total degree to pairs of one map.
    ///
    /// # Errors
    /// When there are fewer than two pairs a term, more than 10,000 terms, a coordinate of the pairs does not vary,
    /// or pairs are of several maps.
    pub fn fit(pairs: &Pairs, degree: usize) -> Result<Self, Error> {
        if !pairs.conditions().is_empty() {
            let found = "values of ε, of a flow time or of controls for each pair";
            return Err(Error::invalid("pairs", found, "pairs of one map, without them"));
        }
        let mut fitted = Self::nearest(pairs, degree, None)?;
        Ok(fitted.pop().expect("one map"))
    }

    /// The fit to pairs of a family whose coefficients are polynomials of controls: one map for each product of the
    /// controls. The map at some controls is the sum of these maps times the products.
    pub(super) fn nearest(
        pairs: &Pairs,
        degree: usize,
        controls: Option<&Controls>,
    ) -> Result<Vec<Self>, Error> {
        let dim = 2 * pairs.dof();
        let of_controls = controls.map_or(1, Controls::terms);
        let count = terms(dim, degree).and_then(|count| count.checked_mul(of_controls));
        let sound = |count: &usize| {
            count * PAIRS_A_TERM <= pairs.len()
                && count.checked_mul(pairs.len()).is_some_and(|all| all <= MOST_NUMBERS)
        };
        let Some(count) = count.filter(sound) else {
            let count = count.map_or("too many".to_owned(), |count| count.to_string());
            let found = format!("{degree}, {count} terms for {} pairs", pairs.len());
            let expected = "a lower one: there are two pairs for each term";
            return Err(Error::invalid("degree of a polynomial map", found, expected));
        };
        let basis = ProductBasis::around(pairs.input(), dim, degree)?;
        let of_row: Vec<Vec<f64>> = match controls {
            None => Vec::new(),
            Some(controls) => {
                let runs = pairs.conditions().iter();
                runs.flat_map(|run| {
                    std::iter::repeat_n(controls.products(&run.controls), run.pairs)
                })
                .collect()
            }
        };
        let rows: Vec<Vec<f64>> =
            pairs.input().par_chunks_exact(dim).map(|z| basis.products(z, None)).collect();
        let alone = count / of_controls;
        let factor = |i: usize, m: usize| of_row.get(i).map_or(1.0, |products| products[m]);
        let coefficients = least_squares(
            "a polynomial map",
            [pairs.len(), count, dim],
            |i, k| factor(i, k / alone) * rows[i][k % alone],
            |i, k| pairs.output()[i * dim + k],
        )?;
        let of = |own: &[f64]| Self { basis: basis.clone(), coefficients: own.to_vec() };
        Ok(coefficients.chunks_exact(alone * dim).map(of).collect())
    }

    /// The sum of maps over the same box, each times a factor.
    pub(super) fn total(maps: &[Self], factors: &[f64]) -> Self {
        let mut out = maps[0].clone();
        out.coefficients.fill(0.0);
        for (map, factor) in maps.iter().zip(factors) {
            for (sum, c) in out.coefficients.iter_mut().zip(&map.coefficients) {
                *sum = factor.mul_add(*c, *sum);
            }
        }
        out
    }

    /// The fit of the best of the degrees 1, 3, 5, … up to `most`, and its error: the root mean square distance on
    /// every fifth pair when fitted to the others. The degree with the least such error is then fitted to all pairs.
    ///
    /// # Errors
    /// Those of [`PolynomialMap::fit`] of degree 1.
    pub fn fit_best(pairs: &Pairs, most: usize) -> Result<(Self, f64), Error> {
        const PART: usize = 5;
        let part = |held: bool| (0..pairs.len()).filter(move |k| (k % PART == 0) == held);
        let (kept, held) = (pairs.rows(part(false)), pairs.rows(part(true)));
        let mut best: Option<(usize, f64)> = None;
        for degree in (1..=most).step_by(2) {
            let Ok(fitted) = Self::fit(&kept, degree) else { break };
            let error = fitted.error_on(&held);
            if best.is_none_or(|(_, least)| error < least) {
                best = Some((degree, error));
            }
        }
        let (degree, error) = best.unwrap_or((1, f64::NAN));
        Ok((Self::fit(pairs, degree)?, error))
    }

    /// The root mean square distance of its images from those of pairs.
    ///
    /// # Panics
    /// When the pairs are of other degrees of freedom.
    pub fn error_on(&self, pairs: &Pairs) -> f64 {
        lane_map::error_on(self, pairs)
    }

    /// The total degree of the polynomials.
    pub fn degree(&self) -> usize {
        self.basis.degree
    }

    /// The number of coefficients of all its components together.
    pub fn parameters(&self) -> usize {
        self.coefficients.len()
    }

    /// Replaces a point z by its image under the map.
    ///
    /// # Panics
    /// When z is not of 2n numbers.
    #[inline(always)]
    pub fn step<S: Scalar>(&self, z: &mut [S]) {
        lane_map::step(self, z);
    }

    /// Whether a point is in the box of the pairs.
    pub fn is_inside(&self, z: &[f64]) -> bool {
        self.basis.is_inside(z)
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
}

impl LaneMap for PolynomialMap {
    const FOUR: bool = true;

    fn dim(&self) -> usize {
        self.basis.dim
    }

    /// For a table of each coordinate.
    fn space(&self) -> usize {
        self.basis.dim * self.basis.count()
    }

    #[inline(always)]
    fn move_together<S: Scalar, const D: usize, const G: usize>(
        &self,
        space: &mut [[S; G]],
        z: &mut [S],
    ) {
        let dim = if D > 0 { D } else { self.basis.dim };
        let mut image = [[S::zero(); G]; DIM];
        for g in 0..G {
            for k in 0..dim {
                image[k][g] = z[g * dim + k];
            }
        }
        let here = image;
        self.basis.values(dim, dim, &self.coefficients, &here, space, &mut image);
        for g in 0..G {
            for k in 0..dim {
                z[g * dim + k] = image[k][g];
            }
        }
    }
}

/// The distance of pairs from those of a symplectic map, as seen by a polynomial fit to them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FormDefect {
    /// The median over points of the largest entry of |JᵀΩJ − Ω|, with J the Jacobian of the fit; for one degree of
    /// freedom this is |det J − 1|.
    pub median: f64,
    /// The same median for the difference of two fits, of this degree and of two less or more: it limits what is
    /// resolved.
    pub resolution: f64,
    /// The degree of the fit.
    pub degree: usize,
}

/// Least squares of more pairs take longer than a moment, and every training waits for them.
const PAIRS: usize = 3000;

/// Two polynomial maps fitted to the same pairs: where they agree, the map of the pairs is known.
#[derive(Clone, Debug)]
pub struct TwoFits {
    best: PolynomialMap,
    /// The second fit, one or two degrees lower or, where the best degree is below 4, two higher.
    other: PolynomialMap,
}

impl TwoFits {
    /// The two fits to pairs of one map; None where there are too few of them for such fits.
    pub fn fit(pairs: &Pairs) -> Option<Self> {
        const MOST_DEGREE: usize = 24;
        const TERMS: usize = 800;
        let small =
            |degree: &usize| terms(2 * pairs.dof(), *degree).is_some_and(|count| count <= TERMS);
        let most = (1..=MOST_DEGREE).take_while(small).last()?;
        let pairs = pairs.thinned(PAIRS);
        let (best, _) = PolynomialMap::fit_best(&pairs, most).ok()?;
        // Below a low degree that is that of the map there is nothing that is near it.
        const LOW: usize = 4;
        let degree = best.degree();
        let higher = (degree < LOW).then(|| PolynomialMap::fit(&pairs, degree + 2).ok()).flatten();
        let other = match higher {
            Some(other) => other,
            None => PolynomialMap::fit(&pairs, degree.checked_sub(2)?.max(1)).ok()?,
        };
        Some(Self { best, other })
    }

    /// The fit of the least error, and one of two degrees less, or of two more where its degree is below four and the
    /// pairs suffice.
    pub fn maps(&self) -> [&PolynomialMap; 2] {
        [&self.best, &self.other]
    }

    /// How far its pairs are from those of a symplectic map.
    pub fn form_defect(&self, pairs: &Pairs) -> FormDefect {
        const POINTS: usize = 256;
        let dim = 2 * pairs.dof();
        let sample = pairs.thinned(PAIRS).thinned(POINTS);
        let (mut defects, mut differences) = (Vec::new(), Vec::new());
        for z in sample.input().chunks_exact(dim) {
            let [one, two] = self.maps().map(|map| defect(&map.jacobian(z), dim));
            let pair = one.iter().zip(&two).map(|(a, b)| (a - b).abs());
            differences.push(pair.fold(0.0, max_or_nan));
            defects.push(one.into_iter().map(f64::abs).fold(0.0, max_or_nan));
        }
        FormDefect {
            median: median_or_nan(defects),
            resolution: median_or_nan(differences),
            degree: self.best.degree(),
        }
    }
}

impl FormDefect {
    /// The defect of the map that pairs are of; None where there are too few of them for such a fit.
    pub fn measure(pairs: &Pairs) -> Option<Self> {
        Some(TwoFits::fit(pairs)?.form_defect(pairs))
    }

    /// Whether the defect shows that no symplectic map has these pairs, where the form itself is known to a relative
    /// error of `known`. A defect of NaN counts as shown.
    pub fn is_seen(&self, known: f64) -> bool {
        /// What is seen stands so far above what two fits differ by.
        const ABOVE: f64 = 5.0;
        /// The largest defect that is put down to the rounding of a fit.
        const LEAST: f64 = 1e-11;
        !(self.median <= ABOVE * max_or_nan(self.resolution, known) || self.median <= LEAST)
    }
}

/// JᵀΩJ − Ω above the diagonal.
fn defect(jacobian: &[f64], dim: usize) -> Vec<f64> {
    let dof = dim / 2;
    let column = |k: usize, row: usize| jacobian[row * dim + k];
    let mut out = Vec::new();
    for i in 0..dim {
        for k in i + 1..dim {
            let form: f64 = (0..dof)
                .map(|j| column(i, j) * column(k, dof + j) - column(i, dof + j) * column(k, j))
                .sum();
            out.push(form - if k == i + dof { 1.0 } else { 0.0 });
        }
    }
    out
}
