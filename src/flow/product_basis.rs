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
    /// Which terms there are, of those of the total degree.
    parity: Parity,
    /// The coordinates in the order of the degrees of a run: those in most lists of the parity first, so that runs are
    /// long.
    pub(super) order: Vec<usize>,
    /// The place of each coordinate in this order.
    pub(super) places: Vec<usize>,
    /// Terms in the last coordinate of the order, run after run.
    pub(super) runs: Vec<Run>,
}

/// Lists of coordinates, of each of which a term's degrees have an even or an odd sum.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Parity {
    pub(super) even: Vec<Vec<usize>>,
    pub(super) odd: Vec<Vec<usize>>,
}

/// Terms that differ in their degree in the last coordinate of the order alone.
#[derive(Clone, Debug)]
pub(super) struct Run {
    /// The degrees in all coordinates but the last of the order.
    pub(super) degrees: Vec<usize>,
    /// The lowest degree in the last one.
    pub(super) lowest: usize,
    /// By how much degrees in the last one differ.
    pub(super) stride: usize,
    /// The number of terms in the run.
    pub(super) terms: usize,
    /// The first coordinate of the order whose degree differs in the next run; 0 in the last run.
    pub(super) closes: usize,
}

/// What files keep of a basis.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept {
    degree: usize,
    even: Vec<Vec<usize>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    odd: Vec<Vec<usize>>,
    centre: Vec<f64>,
    factors: Vec<f64>,
    /// Nothing where it is that of the coordinates themselves, as in files that do not say it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    order: Vec<usize>,
}

impl From<ProductBasis> for Kept {
    fn from(basis: ProductBasis) -> Self {
        let ProductBasis { dim, degree, centre, factors, parity, mut order, .. } = basis;
        if order.iter().copied().eq(0..dim) {
            order.clear();
        }
        let Parity { even, odd } = parity;
        Self { degree, even, odd, centre, factors, order }
    }
}

impl TryFrom<Kept> for ProductBasis {
    type Error = Error;

    fn try_from(kept: Kept) -> Result<Self, Error> {
        let Kept { degree, even, odd, centre, factors, mut order } = kept;
        let parity = Parity { even, odd };
        let dim = centre.len();
        Error::check_count_range("coordinates", dim, 1, DIM)?;
        Error::check_count("factors", dim, factors.len())?;
        for (name, lists) in [("even", &parity.even), ("odd", &parity.odd)] {
            Error::check_count_range(name, lists.len(), 0, dim)?;
            for list in lists {
                Error::check_count_range(
                    &format!("coordinates that are {name}"),
                    list.len(),
                    1,
                    dim,
                )?;
                list.iter()
                    .try_for_each(|axis| Error::check_count_range(name, *axis, 0, dim - 1))?;
            }
        }
        if order.is_empty() {
            order = (0..dim).collect();
        }
        if !(0..dim).all(|axis| order.contains(&axis)) || order.len() != dim {
            return Err(Error::invalid("order", format!("{order:?}"), "each coordinate once"));
        }
        if terms(dim, degree).is_none() {
            let expected = format!("one of {MOST_TERMS} terms at most");
            return Err(Error::invalid("degree", degree, expected));
        }
        centre.iter().try_for_each(|c| Error::check_finite("centre", *c))?;
        factors
            .iter()
            .try_for_each(|f| Error::check_range("factor", *f, Error::LEAST_POSITIVE, f64::MAX))?;
        let box_of = Self { centre, factors, ..Self::of(dim, degree) };
        Ok(box_of.ordered(parity, order))
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

/// How many of the terms of a total degree have even sums of degrees in these lists of coordinates.
pub(super) fn even_terms(dim: usize, degree: usize, even: Vec<Vec<usize>>) -> usize {
    let parity = Parity { even, odd: Vec::new() };
    let order = parity.order(dim);
    runs(degree, &parity, &order).iter().map(|run| run.terms).sum()
}

impl Parity {
    /// The coordinates, those in most lists first.
    fn order(&self, dim: usize) -> Vec<usize> {
        let lists = |axis: &usize| {
            let all = self.even.iter().chain(&self.odd);
            all.filter(|list| list.contains(axis)).count()
        };
        let mut order: Vec<usize> = (0..dim).collect();
        order.sort_by_key(|axis| std::cmp::Reverse(lists(axis)));
        order
    }

    /// Whether a term with these degrees in coordinates of this order has it.
    fn has(&self, order: &[usize], degree: impl Fn(usize) -> usize) -> bool {
        let sum = |list: &Vec<usize>| -> usize {
            let own = |(place, axis): (usize, &usize)| list.contains(axis).then(|| degree(place));
            order.iter().enumerate().filter_map(own).sum()
        };
        self.even.iter().all(|list| sum(list).is_multiple_of(2))
            && self.odd.iter().all(|list| !sum(list).is_multiple_of(2))
    }
}

/// All runs, of terms with this parity.
fn runs(degree: usize, parity: &Parity, order: &[usize]) -> Vec<Run> {
    let dim = order.len();
    let mut all = vec![Vec::new()];
    for _ in 1..dim {
        let longer = |degrees: &Vec<usize>| -> Vec<Vec<usize>> {
            let left = degree - degrees.iter().sum::<usize>();
            (0..=left).map(|k| degrees.iter().copied().chain([k]).collect()).collect()
        };
        all = all.iter().flat_map(longer).collect();
    }
    let last = dim - 1;
    let mut runs: Vec<Run> = all
        .into_iter()
        .filter_map(|degrees| {
            let left = degree - degrees.iter().sum::<usize>();
            let is_term = |k: &usize| {
                parity.has(order, |place| if place == last { *k } else { degrees[place] })
            };
            let own: Vec<usize> = (0..=left).filter(is_term).collect();
            // All of them, or those of one parity.
            let lowest = *own.first()?;
            let stride = own.get(1).map_or(1, |next| next - lowest);
            Some(Run { degrees, lowest, stride, terms: own.len(), closes: 0 })
        })
        .collect();
    for k in 1..runs.len() {
        let differs = runs[k - 1].degrees.iter().zip(&runs[k].degrees).position(|(a, b)| a != b);
        runs[k - 1].closes = differs.expect("runs differ in their degrees");
    }
    runs
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
        let box_of = Self { centre, factors, ..Self::of(dim, degree) };
        Ok(box_of.ordered(Parity::default(), (0..dim).collect()))
    }

    /// Without terms, over no box.
    fn of(dim: usize, degree: usize) -> Self {
        let [centre, factors] = [vec![0.0; dim], vec![1.0; dim]];
        let (parity, order, places, runs) = Default::default();
        Self { dim, degree, centre, factors, parity, order, places, runs }
    }

    /// With the terms of this parity alone.
    pub(super) fn with_parity(self, parity: Parity) -> Self {
        let order = parity.order(self.dim);
        self.ordered(parity, order)
    }

    fn ordered(self, parity: Parity, order: Vec<usize>) -> Self {
        let runs = runs(self.degree, &parity, &order);
        let place = |axis| order.iter().position(|other| *other == axis);
        let places = (0..self.dim).map(|axis| place(axis).expect("all coordinates")).collect();
        Self { parity, order, places, runs, ..self }
    }

    /// Which terms of its total degree it has.
    pub(super) fn parity(&self) -> &Parity {
        &self.parity
    }

    /// How many terms there are.
    pub(super) fn terms(&self) -> usize {
        self.runs.iter().map(|run| run.terms).sum()
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

    /// T_k of a coordinate of G points, and its derivatives of order 1, 2, … by that coordinate: one table of k up to
    /// the degree for each order, as many as `tables` holds.
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
        let of = |place: usize, k: usize| {
            let axis = self.order[place];
            tables[(2 * axis + usize::from(along == Some(axis))) * count + k][0]
        };
        let (last, mut out) = (self.dim - 1, Vec::new());
        for Run { degrees, lowest, stride, terms, .. } in &self.runs {
            let first: f64 = degrees.iter().enumerate().map(|(place, k)| of(place, *k)).product();
            out.extend((0..*terms).map(|k| first * of(last, lowest + k * stride)));
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
        for place in 0..dim {
            let axis = self.order[place];
            self.fill(axis, &z[axis], &mut tables[place * count..][..count]);
        }
        for k in 0..outputs {
            out[k] = [S::zero(); G];
        }
        let mut terms = coefficients.chunks_exact(outputs);
        for run in &self.runs {
            let mut inner = [[S::zero(); G]; DIM];
            let powers = tables[(dim - 1) * count + run.lowest..].iter().step_by(run.stride);
            for (power, term) in powers.take(run.terms).zip(&mut terms) {
                for k in 0..outputs {
                    let c = S::from_f64(term[k]);
                    for g in 0..G {
                        inner[k][g] = power[g].mul_add(c, inner[k][g]);
                    }
                }
            }
            let mut first = [S::from_f64(1.0); G];
            for (place, k) in run.degrees.iter().enumerate() {
                for g in 0..G {
                    first[g] *= tables[place * count + k][g];
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
    let mut matrix = Mat::from_fn(equations, terms, term);
    let right = Mat::from_fn(equations, outputs, value);
    // Columns of one size, by powers of two, which change no digit of the solution.
    let mut scales = Vec::with_capacity(terms);
    for k in 0..terms {
        let sizes = (0..equations).map(|i| matrix[(i, k)].abs());
        let largest = sizes.fold(0.0, max_or_nan);
        let scale = match largest.is_normal() {
            true => libm::scalbn(1.0, -libm::ilogb(largest)),
            false => 1.0,
        };
        (0..equations).for_each(|i| matrix[(i, k)] *= scale);
        scales.push(scale);
    }
    let solution = matrix.qr().solve_lstsq(&right);
    let coefficients: Vec<f64> = (0..terms * outputs)
        .map(|k| solution[(k / outputs, k % outputs)] * scales[k / outputs])
        .collect();
    if let Some(bad) = coefficients.iter().find(|c| !c.is_finite()) {
        return Err(Error::invalid(&format!("coefficient of {what}"), bad, "a finite number"));
    }
    Ok(coefficients)
}
