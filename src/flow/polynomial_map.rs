//! Least-squares polynomial maps, which are quickly fitted to pairs and preserve no structure.

use super::request::TOGETHER;
use super::{Pairs, Region};
use crate::error::Error;
use crate::network::{Controls, Rollout, load_groups, store_groups};
use crate::scalar::{Dual, Kernel, Pack, Scalar, max_or_nan, median_or_nan, on_independent_lanes};
use faer::Mat;
use faer::linalg::solvers::SolveLstsq;
use rayon::prelude::*;

/// A polynomial map of a total degree, fitted to pairs by least squares in products of Chebyshev polynomials over the
/// box of their inputs. It is not symplectic.
///
/// Source: Berz, Modern Map Methods in Particle Beam Physics, Academic Press (1999), for maps by polynomials and what
/// they are used for; Trefethen, Approximation Theory and Approximation Practice, SIAM (2013), for the basis.
#[derive(Clone, Debug)]
pub struct PolynomialMap {
    dim: usize,
    degree: usize,
    centre: Vec<f64>,
    /// One over half the extent of the box along each coordinate.
    factors: Vec<f64>,
    /// Terms in the last coordinate from degree 0 on, run after run.
    runs: Vec<Run>,
    /// The coefficients of all terms, run after run, those of all outputs of a term together.
    coefficients: Vec<f64>,
}

/// Terms that differ in their degree in the last coordinate alone.
#[derive(Clone, Debug)]
struct Run {
    /// The degrees in all coordinates but the last.
    degrees: Vec<usize>,
    /// The highest degree in the last one.
    left: usize,
}

/// A map has no more terms.
const MOST_TERMS: usize = 10_000;
/// A fit has so many pairs for each term, at least.
const PAIRS_A_TERM: usize = 2;
/// Numbers of a matrix of all terms at all pairs, at most: 1 GiB.
const MOST_NUMBERS: usize = 1 << 27;
/// A map is of no more coordinates.
const DIM: usize = 8;

/// How many products of a total degree of at most `degree` there are in so many coordinates; None of too many.
fn terms(dim: usize, degree: usize) -> Option<usize> {
    let mut count = 1usize;
    for k in 1..=dim {
        count = count.checked_mul(degree + k)? / k;
    }
    (count <= MOST_TERMS).then_some(count)
}

/// All that leave a degree of at least 0 for the last coordinate.
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

impl PolynomialMap {
    /// The fit of this total degree to pairs of one map.
    ///
    /// # Errors
    /// When there are fewer than two pairs a term, more than 10,000 terms, a coordinate of the pairs does not vary,
    /// or pairs are of several maps.
    pub fn fit(pairs: &Pairs, degree: usize) -> Result<Self, Error> {
        if !pairs.conditions().is_empty() {
            let count = pairs.conditions().len();
            return Err(Error::invalid("pairs", format!("{count} maps"), "pairs of one map"));
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
        let count = terms(dim, degree).filter(|_| dim <= DIM);
        let count = count.and_then(|count| count.checked_mul(of_controls));
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
        let region = Region::around(dim, [pairs.input()])
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
        let runs = runs(dim, degree);
        let out = Self { dim, degree, centre, factors, runs, coefficients: Vec::new() };
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
            pairs.input().par_chunks_exact(dim).map(|z| out.products(z)).collect();
        let alone = count / of_controls;
        let factor = |i: usize, m: usize| of_row.get(i).map_or(1.0, |products| products[m]);
        let matrix =
            Mat::from_fn(pairs.len(), count, |i, k| factor(i, k / alone) * rows[i][k % alone]);
        let right = Mat::from_fn(pairs.len(), dim, |i, k| pairs.output()[i * dim + k]);
        let solution = matrix.qr().solve_lstsq(&right);
        let coefficients: Vec<f64> =
            (0..count * dim).map(|index| solution[(index / dim, index % dim)]).collect();
        if let Some(bad) = coefficients.iter().find(|c| !c.is_finite()) {
            return Err(Error::invalid("coefficient of a polynomial map", bad, "a finite number"));
        }
        let of = |own: &[f64]| Self { coefficients: own.to_vec(), ..out.clone() };
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
    pub fn error_on(&self, pairs: &Pairs) -> f64 {
        let rows =
            pairs.input().par_chunks_exact(self.dim).zip(pairs.output().par_chunks_exact(self.dim));
        let squares: Vec<f64> = rows
            .map(|(z, expected)| {
                let mut image = z.to_vec();
                self.step(&mut image);
                image.iter().zip(expected).map(|(a, b)| (a - b) * (a - b)).sum()
            })
            .collect();
        libm::sqrt(squares.iter().sum::<f64>() / pairs.len() as f64)
    }

    /// Its total degree.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// How many coefficients it has.
    pub fn parameters(&self) -> usize {
        self.coefficients.len()
    }

    /// The value of each term.
    fn products(&self, z: &[f64]) -> Vec<f64> {
        let mut tables = vec![[0.0]; self.dim * (self.degree + 1)];
        self.fill(z, &mut tables);
        let (last, mut out) = (self.dim - 1, Vec::new());
        let count = self.degree + 1;
        for Run { degrees, left } in &self.runs {
            let first: f64 =
                degrees.iter().enumerate().map(|(axis, k)| tables[axis * count + k][0]).product();
            out.extend((0..=*left).map(|k| first * tables[last * count + k][0]));
        }
        out
    }

    /// z ← its image.
    ///
    /// # Panics
    /// When z is not of 2n numbers.
    #[inline(always)]
    pub fn step<S: Scalar>(&self, z: &mut [S]) {
        assert!(z.len() == self.dim);
        let mut tables = vec![[S::zero()]; self.dim * (self.degree + 1)];
        self.move_together::<S, 0, 1>(&mut tables, z);
    }

    /// T_k of each coordinate of G points, k up to the degree.
    #[inline(always)]
    fn fill<S: Scalar, const G: usize>(&self, z: &[S], tables: &mut [[S; G]]) {
        for (axis, table) in tables.chunks_exact_mut(self.degree + 1).enumerate() {
            let mut s = [S::zero(); G];
            for (g, s) in s.iter_mut().enumerate() {
                let moved = z[g * self.dim + axis] - S::from_f64(self.centre[axis]);
                *s = moved * S::from_f64(self.factors[axis]);
            }
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
    }

    /// z ← its image for each of G points, of D coordinates where that is known at compile time, and not 0; the same
    /// bits for each, whatever D and G are. `tables` are space for 2n(d + 1) numbers of each.
    #[inline(always)]
    fn move_together<S: Scalar, const D: usize, const G: usize>(
        &self,
        tables: &mut [[S; G]],
        z: &mut [S],
    ) {
        let dim = if D > 0 { D } else { self.dim };
        let count = self.degree + 1;
        self.fill(z, tables);
        let mut image = [[S::zero(); G]; DIM];
        let mut terms = self.coefficients.chunks_exact(dim);
        for Run { degrees, left } in &self.runs {
            let mut inner = [[S::zero(); G]; DIM];
            for (power, term) in tables[(dim - 1) * count..][..=*left].iter().zip(&mut terms) {
                for k in 0..dim {
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
            for k in 0..dim {
                for g in 0..G {
                    image[k][g] = first[g].mul_add(inner[k][g], image[k][g]);
                }
            }
        }
        for g in 0..G {
            for k in 0..dim {
                z[g * dim + k] = image[k][g];
            }
        }
    }

    /// Whether a point is in the box of the pairs.
    pub fn is_inside(&self, z: &[f64]) -> bool {
        let sizes = z.iter().zip(&self.centre).zip(&self.factors).map(|((v, c), f)| (v - c) * f);
        sizes.fold(0.0, |largest: f64, size| max_or_nan(largest, size.abs())) <= 1.0
    }

    /// Its Jacobian at a point: 2n × 2n numbers, row by row.
    pub fn jacobian(&self, z: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.dim * self.dim];
        for column in 0..self.dim {
            let along = |(k, &v)| Dual::<f64, 1>::variable(v, usize::from(k != column));
            let mut lifted: Vec<Dual<f64, 1>> = z.iter().enumerate().map(along).collect();
            self.step(&mut lifted);
            for (row, value) in lifted.iter().enumerate() {
                out[row * self.dim + column] = value.eps[0];
            }
        }
        out
    }

    /// The states of an orbit of each initial point, as a network's [`rollout`](crate::network::rollout) gives them:
    /// (steps/every + 1, M, 2n), the first being the initial points.
    ///
    /// # Errors
    /// When there are no whole rows, or `every` is 0.
    pub fn rollout(&self, initial: &[f64], request: Rollout) -> Result<Vec<f64>, Error> {
        Error::check_rows("initial points", initial.len(), self.dim)?;
        Error::check_count_range("every", request.every, 1, usize::MAX)?;
        let states = request.steps / request.every + 1;
        let points = initial.len() / self.dim;
        let mut out = vec![0.0; states * initial.len()];
        let block = points.div_ceil(rayon::current_num_threads()).max(1) * self.dim;
        let blocks: Vec<Vec<f64>> = initial
            .par_chunks(block)
            .map(|initial| on_independent_lanes(Orbits { map: self, request, initial, states }))
            .collect();
        let mut first = 0;
        for of_block in blocks {
            let row = of_block.len() / states;
            for t in 0..states {
                out[t * initial.len() + first..][..row]
                    .copy_from_slice(&of_block[t * row..(t + 1) * row]);
            }
            first += row;
        }
        Ok(out)
    }
}

/// The orbits of a block of points: (T, M, 2n).
struct Orbits<'a> {
    map: &'a PolynomialMap,
    request: Rollout,
    initial: &'a [f64],
    states: usize,
}

impl Kernel for Orbits<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<V: Pack>(self) -> Vec<f64> {
        let few = self.initial.len() <= V::LANES * self.map.dim;
        match (self.map.dim, few) {
            (2, false) => self.together::<V, 2, TOGETHER>(),
            (2, true) => self.together::<V, 2, 1>(),
            (4, false) => self.together::<V, 4, TOGETHER>(),
            (4, true) => self.together::<V, 4, 1>(),
            _ => self.together::<V, 0, 1>(),
        }
    }
}

impl Orbits<'_> {
    /// The orbits of G groups at a time, of D coordinates where that is not 0.
    #[inline(always)]
    fn together<V: Pack, const D: usize, const G: usize>(self) -> Vec<f64> {
        let Self { map, request, initial, states } = self;
        let dim = map.dim;
        let mut out = vec![0.0; states * initial.len()];
        let mut tables = vec![[V::zero(); G]; dim * (map.degree + 1)];
        let mut lanes = vec![V::zero(); G * dim];
        let mut shown = vec![0.0; G * V::LANES * dim];
        let together = G * V::LANES * dim;
        for (number, groups) in initial.chunks(together).enumerate() {
            let first = number * together;
            let size = load_groups(groups, dim, &mut lanes);
            for t in 0..states {
                if t > 0 {
                    for _ in 0..request.every {
                        map.move_together::<V, D, G>(&mut tables, &mut lanes);
                    }
                }
                store_groups(&lanes[..size], dim, &mut shown[..groups.len()]);
                out[t * initial.len() + first..][..groups.len()]
                    .copy_from_slice(&shown[..groups.len()]);
            }
        }
        out
    }
}

/// The distance of pairs from those of a symplectic map, as seen by a polynomial fit to them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FormDefect {
    /// The median over points of the largest entry of |JᵀΩJ − Ω|, with J the Jacobian of the fit; for one degree of
    /// freedom this is |det J − 1|.
    pub median: f64,
    /// The same median for the difference of two fits, of this degree and of two less: it limits what is resolved.
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
    /// Of two degrees less.
    other: PolynomialMap,
}

impl TwoFits {
    /// Of pairs of one map; None where there are too few of them for such a fit.
    pub fn of(pairs: &Pairs) -> Option<Self> {
        const MOST_DEGREE: usize = 24;
        const TERMS: usize = 800;
        let small =
            |degree: &usize| terms(2 * pairs.dof(), *degree).is_some_and(|count| count <= TERMS);
        let most = (1..=MOST_DEGREE).take_while(small).last()?;
        let pairs = pairs.thinned(PAIRS);
        let (best, _) = PolynomialMap::fit_best(&pairs, most).ok()?;
        let other = PolynomialMap::fit(&pairs, best.degree().checked_sub(2)?.max(1)).ok()?;
        Some(Self { best, other })
    }

    /// The fit of the least error, and one of two degrees less.
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
    /// Of pairs of one map; None where there are too few of them for such a fit.
    pub fn of(pairs: &Pairs) -> Option<Self> {
        Some(TwoFits::of(pairs)?.form_defect(pairs))
    }

    /// Whether the defect shows that no symplectic map has these pairs, where the form itself is known to a relative
    /// error of `known`. A defect of NaN counts as shown.
    pub fn is_seen(&self, known: f64) -> bool {
        /// What is seen stands so far above what two fits differ by.
        const ABOVE: f64 = 5.0;
        /// Rounding of a fit.
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
