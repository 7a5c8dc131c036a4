//! Symplectic maps whose generating function is a polynomial of least squares.

use super::Pairs;
use super::lane_map::{self, LaneMap};
use super::polynomial_map::MOST_NUMBERS;
use super::product_basis::{DIM, Parity, ProductBasis, Run, even_terms, least_squares, terms};
use super::symmetries::Symmetries;
use super::symplectic_frame::{Frame, NAME, NEARLY, apply, reflected, rows_reflected};
use super::symplectic_start::Start;
use crate::error::Error;
use crate::layer::Reversor;
use crate::network::{Rollout, load_groups, store_groups};
use crate::phase::{Half, Map};
use crate::random::Stream;
use crate::scalar::{Kernel, Pack, Scalar, max_or_nan, on_independent_lanes};
use crate::stopping::is_stopped;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// A symplectic map whose generating function is a polynomial, fitted to pairs by linear least squares.
///
/// z′ = c′ + M·N(z − c), where M is a symplectic matrix near the linear part of the map, and N: u ↦ v is near the
/// identity, by Poincaré's generating function S of the midpoint:
///
/// v = u + Ω∇S(½(u + v)), Ω(q, p) = (p, −q).
///
/// S is a sum of products of Chebyshev polynomials of a total degree over the box of the midpoints of the pairs. A step
/// solves w = u + ½Ω∇S(w) for the midpoint w by Newton's method, from a polynomial that is near it, with a fixed number
/// of iterations, of which the last may keep the matrix of an earlier one. They bring all pairs to rounding, and points
/// among them where these have a midpoint; then v = 2w − u. The map is symplectic for every S, to the error of this
/// solution. Its inverse has −S for S, and a start and a number of iterations of its own.
///
/// Where a [`Reversor`] R conjugates the map to its inverse, z′ = c + L·N(L(z − c)) with L² in place of M, RLR = L⁻¹
/// and Rc = c, and S is even, S∘R = S: it has about half the coefficients, and RPR = P⁻¹ for all of them, to the error
/// of the solution. Where the map commutes with a reflection of some planes, (q_j, p_j) ↦ (−q_j, −p_j), S is even in
/// these, which halves the coefficients too, and the map has it to the error of the solution ([`Symmetries`]).
///
/// Source: Hairer, Lubich and Wanner, Geometric Numerical Integration, <https://doi.org/10.1007/3-540-30666-8>, §VI.5,
/// for the generating function; Erdélyi and Berz, <https://doi.org/10.1103/PhysRevLett.87.114302>, for maps of
/// accelerators that are made symplectic, and for how much depends on the choice of the generating function.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SymplecticPolynomial {
    dof: usize,
    symmetries: Symmetries,
    frame: Frame,
    /// The products of Chebyshev polynomials of the midpoint w, of which S is a sum.
    basis: ProductBasis,
    /// The coefficients of the generating function S in the basis, the constant first.
    coefficients: Vec<f64>,
    forward: Solution,
    /// How the inverse map finds the midpoint w.
    backward: Solution,
}

/// How the midpoint w of a step is found: a start, and a number of Newton iterations.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Solution {
    start: Start,
    iterations: usize,
    /// The last so many of them solve with the matrix of the one before, and need no Hessian of their own.
    #[serde(default, skip_serializing_if = "is_zero")]
    frozen: usize,
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// A solution takes no more iterations.
const MOST_ITERATIONS: usize = 12;
/// A change by more than this, in units of half the box, says nothing of the error that is left.
const FAR_OFF: f64 = 0.1;
/// And no more of them in a row without a matrix of their own: each is as good as the first.
const MOST_FROZEN: usize = 2;
/// A share of half the box that is below rounding, and whose derivatives are.
const LEFT: f64 = 1e-18;
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
        Self::fit_symmetric(pairs, degree, &Symmetries::default())
    }

    /// The polynomial fitted to pairs of a map that this reflection conjugates to its inverse; the fit is so for all
    /// pairs, and errs where they are of another map.
    ///
    /// # Errors
    /// Those of [`SymplecticPolynomial::fit`]; when the linear part turns a plane by half a turn.
    pub fn fit_reversible(pairs: &Pairs, degree: usize, reversor: Reversor) -> Result<Self, Error> {
        let reversor = Some(reversor);
        Self::fit_symmetric(pairs, degree, &Symmetries { reversor, ..Symmetries::default() })
    }

    /// The polynomial fitted to pairs of a map with these symmetries, which the fit has for all pairs; it errs where
    /// they are of another map.
    ///
    /// # Errors
    /// Those of [`SymplecticPolynomial::fit_reversible`], and of [`Symmetries::check`].
    pub fn fit_symmetric(
        pairs: &Pairs,
        degree: usize,
        symmetries: &Symmetries,
    ) -> Result<Self, Error> {
        let (dof, dim) = (pairs.dof(), 2 * pairs.dof());
        Error::check_count_range("degree of a generating function", degree, 2, usize::MAX)?;
        let reversor = symmetries.reversor;
        if !Self::has_enough(pairs, degree, symmetries)? {
            let found = format!("{degree} for {} pairs of {dof} degrees of freedom", pairs.len());
            let expected = "fewer terms of it, or more pairs";
            return Err(Error::invalid("degree of a generating function", found, expected));
        }
        pairs.check_squares("pairs")?;
        let frame = Frame::of(pairs, symmetries)?;
        let before: Vec<f64> =
            pairs.input().chunks_exact(dim).flat_map(|z| frame.enter(z)).collect();
        let back = frame.inverse(dof);
        let after: Vec<f64> =
            pairs.output().chunks_exact(dim).flat_map(|z| back.enter(z)).collect();
        let middles: Vec<f64> = before.iter().zip(&after).map(|(u, v)| 0.5 * (u + v)).collect();
        // The frame of a reversible map has the coordinates that are reflected first.
        let reverse = |points: &[f64]| reflected(points, dim, Half::Position);
        let both = match reversor {
            None => middles.clone(),
            Some(_) => [&middles[..], &reverse(&middles)].concat(),
        };
        let both = symmetries.with_images(both, dof);
        let parity = Parity { even: symmetries.even(dof), odd: Vec::new() };
        let basis = ProductBasis::around(&both, dim, degree)?.with_parity(parity);
        let coefficients = generator(&basis, &middles, &before, &after).map_err(|error| {
            let different = pairs.different_inputs();
            let terms = Self::terms(dof, degree, symmetries).unwrap_or(usize::MAX);
            if different * dim >= terms.saturating_mul(NUMBERS_A_TERM) {
                return error;
            }
            let found = format!("{degree} for pairs of {different} different inputs");
            let expected = "fewer terms of it, or more pairs";
            Error::invalid("degree of a generating function", found, expected)
        })?;
        // Of the map's images by its symmetries they are pairs too, and the start and the iterations have to do for
        // them.
        let (before, after) = match reversor {
            None => (before, after),
            Some(_) => {
                ([&before[..], &reverse(&after)].concat(), [&after[..], &reverse(&before)].concat())
            }
        };
        let [before, after] = [before, after].map(|points| symmetries.with_images(points, dof));
        let none = Solution {
            start: Start::fit(&before, &both, symmetries, dof, 1)?,
            iterations: 0,
            frozen: 0,
        };
        let (forward, backward) = (none.clone(), none);
        let symmetries = symmetries.clone();
        let map = Self { dof, symmetries, frame, basis, coefficients, forward, backward };
        let map = map.with_solution(&before, &both)?.inverted();
        Ok(map.with_solution(&after, &both)?.inverted())
    }

    /// Whether there are enough pairs for a fit of this degree, and not more terms than a fit can have.
    ///
    /// # Errors
    /// When the pairs are of more than four degrees of freedom; those of [`Symmetries::check`].
    pub fn has_enough(
        pairs: &Pairs,
        degree: usize,
        symmetries: &Symmetries,
    ) -> Result<bool, Error> {
        let (dof, dim) = (pairs.dof(), 2 * pairs.dof());
        Error::check_count_range("degrees of freedom", dof, 1, DIM / 2)?;
        symmetries.check(dof)?;
        let numbers = pairs.len() * dim;
        let sound = |count: &usize| {
            // Its linear part is a polynomial of degree 1.
            count * NUMBERS_A_TERM <= numbers
                && 2 * (dim + 1) <= pairs.len()
                && count.checked_mul(numbers).is_some_and(|all| all <= MOST_NUMBERS)
        };
        Ok(Self::terms(dof, degree, symmetries).filter(sound).is_some())
    }

    /// How many terms a generating function of this degree has with these symmetries; None of too many.
    pub fn terms(dof: usize, degree: usize, symmetries: &Symmetries) -> Option<usize> {
        terms(2 * dof, degree).map(|_| even_terms(2 * dof, degree, symmetries.even(dof)))
    }

    /// The map with the start and the iterations that cost least, of those that find the midpoints of these points, and
    /// of points among them if these have any.
    fn with_solution(mut self, points: &[f64], middles: &[f64]) -> Result<Self, Error> {
        let (dim, degree) = (2 * self.dof, self.basis.degree);
        let symmetries = self.symmetries.clone();
        let among = among(&ProductBasis::around(points, dim, 1)?);
        let mut best: Option<(usize, Solution)> = None;
        let (mut bend, mut change) = (None, f64::NAN);
        for start in 1..=degree {
            let Some(all) = terms(dim, start).filter(|all| 2 * dim * all <= points.len()) else {
                break;
            };
            if all * points.len() / dim > MOST_NUMBERS {
                break;
            }
            self.forward.start = Start::fit(points, middles, &symmetries, self.dof, start)?;
            // In thirds of what a product of an iteration takes.
            let of_start = 2 * self.forward.start.products();
            // With an iteration, starts of higher degrees cost more than all of the best.
            let least = best.as_ref().map_or(usize::MAX, |(least, _)| *least);
            if of_start + 3 * self.products::<TABLES>() >= least {
                break;
            }
            let found = self.iterations_needed(points, &among, &mut bend, &mut change);
            let Some([own, frozen]) = found else { continue };
            let cost = of_start + self.cost(own, frozen);
            if cost < least {
                let start = self.forward.start.clone();
                best = Some((cost, Solution { start, iterations: own + frozen, frozen }));
            }
            if own + frozen == 1 {
                break;
            }
        }
        match best {
            Some((_, forward)) => Ok(Self { forward, ..self }),
            None => {
                let what = "the images of a generating function".to_owned();
                Err(Error::NoConvergence { what, iterations: MOST_ITERATIONS, change })
            }
        }
    }

    /// The iterations from the present start that cost least, with a matrix of their own and without: of those that
    /// find the midpoints of these points, and of points among them if these have any. `bend` is what is known of
    /// [`left`]'s, and `change` the last change.
    fn iterations_needed(
        &self,
        points: &[f64],
        among: &[f64],
        bend: &mut Option<f64>,
        change: &mut f64,
    ) -> Option<[usize; 2]> {
        let are_found = |own: usize, frozen: usize, points: &[f64], bend: Option<f64>| {
            left(self.changes(points, [own + frozen, frozen]), frozen, bend) <= LEFT
        };
        let have_midpoints = are_found(MOST_ITERATIONS, 0, among, *bend);
        let (mut before, mut best) = (None, None::<[usize; 2]>);
        for own in 1..=MOST_ITERATIONS {
            let [_, last] = self.changes(points, [own, 0]);
            *bend = bend_of(before, last, *bend);
            (before, *change) = (Some(last), last);
            let are_all_found = |frozen: &usize| {
                let of_points = match *frozen {
                    0 => left([last, last], 0, *bend) <= LEFT,
                    frozen => are_found(own, frozen, points, *bend),
                };
                of_points && (!have_midpoints || are_found(own, *frozen, among, *bend))
            };
            // From far off a matrix that is kept does not lead to rounding.
            let is_near = last < FAR_OFF;
            let most = if is_near { MOST_FROZEN.min(MOST_ITERATIONS - own) } else { 0 };
            let Some(frozen) = (0..=most).find(are_all_found) else { continue };
            if best.is_none_or(|[a, b]| self.cost(own, frozen) < self.cost(a, b)) {
                best = Some([own, frozen]);
            }
            if frozen == 0 {
                break;
            }
        }
        best
    }

    /// What so many iterations with a matrix of their own and without cost, in thirds of a product.
    fn cost(&self, own: usize, frozen: usize) -> usize {
        3 * (own * self.products::<TABLES>() + frozen * self.products::<2>())
    }

    /// The products of an iteration with derivatives of order below T: each term's along the last coordinate, and those
    /// of sums with the coordinates before it.
    fn products<const T: usize>(&self) -> usize {
        let dim = 2 * self.dof;
        let of_run = |closes| (closes..dim - 1).map(|axis| jet::<T>(dim - axis)).sum::<usize>();
        let folds: usize = self.basis.runs.iter().map(|run| of_run(run.closes)).sum();
        T * self.coefficients.len() + folds
    }

    /// The largest change at some of these points by the last iteration with a matrix of its own, and by the last of
    /// all, in units of half the box.
    fn changes(&self, points: &[f64], iterations: [usize; 2]) -> [f64; 2] {
        const BLOCK: usize = 256;
        let of = |points| on_independent_lanes(Changes { map: self, points, iterations });
        let changes = points.par_chunks(BLOCK * 2 * self.dof).map(of);
        changes.reduce(|| [0.0; 2], |a, b| [max_or_nan(a[0], b[0]), max_or_nan(a[1], b[1])])
    }

    /// Fails unless its parts are of one size, finite and symplectic; for maps that are read from files. Whether
    /// Newton's method converges, as it did for the pairs of a fit, is not looked at.
    ///
    /// # Errors
    /// With the part that is not as it should be.
    pub fn check(&self) -> Result<(), Error> {
        Error::check_count_range("dof", self.dof, 1, DIM / 2)?;
        let dim = 2 * self.dof;
        self.symmetries.check(self.dof)?;
        self.frame.check(dim)?;
        let check_parity = |basis: &ProductBasis, expected: Parity| {
            let found = basis.parity();
            let unlike = || {
                let expected = format!("{expected:?} of these symmetries");
                Error::invalid("coordinates that are even", format!("{found:?}"), expected)
            };
            (*found == expected).then_some(()).ok_or_else(unlike)
        };
        let even = self.symmetries.even(self.dof);
        check_parity(&self.basis, Parity { even, odd: Vec::new() })?;
        self.check_symmetries()?;
        let check = |place: &str, basis: &ProductBasis, coefficients: &[f64], each: usize| {
            Error::check_count("coordinates of a basis", dim, basis.dim)?;
            Error::check_count(place, each * basis.terms(), coefficients.len())?;
            coefficients.iter().try_for_each(|c| Error::check_finite(place, *c))
        };
        check("coefficients", &self.basis, &self.coefficients, 1)?;
        for Solution { start, iterations, frozen } in [&self.forward, &self.backward] {
            Error::check_count_range("iterations", *iterations, 1, MOST_ITERATIONS)?;
            // The first has none before it.
            Error::check_count_range("frozen iterations", *frozen, 0, iterations - 1)?;
            for (part, parity, outputs) in start.parts(&self.symmetries, self.dof) {
                // Each plane is mirrored or not, and a part of none has no polynomials.
                Error::check_count_range("start: coordinates", outputs.len(), 1, dim)?;
                for axis in parity.even.iter().chain(&parity.odd).flatten() {
                    if part.basis.centre().get(*axis).is_some_and(|centre| *centre != 0.0) {
                        let expected = "one about 0 along what is mirrored";
                        return Err(Error::invalid("start: box", "one that is not", expected));
                    }
                }
                check("start: coefficients", &part.basis, &part.coefficients, outputs.len())?;
                check_parity(&part.basis, parity)?;
                // The work space of a step is for the degree of S.
                let degree = part.basis.degree;
                Error::check_count_range("start: degree", degree, 0, self.basis.degree)?;
            }
        }
        Ok(())
    }

    /// Fails unless box and frame have the symmetries that S has.
    fn check_symmetries(&self) -> Result<(), Error> {
        let (dof, dim) = (self.dof, 2 * self.dof);
        let Self { symmetries, frame: Frame { from, entry, to, exit }, .. } = self;
        let fail = |found: &str| Err(Error::invalid("frame", found, "one with these symmetries"));
        for list in &self.basis.parity().even {
            if list.iter().any(|axis| self.basis.centre()[*axis] != 0.0) {
                return fail("a box that is not about 0");
            }
        }
        let turned = |k: usize| symmetries.is_mirrored(k, dof);
        if (0..dim).any(|k| turned(k) && (from[k] != 0.0 || to[k] != 0.0)) {
            return fail("a centre off the mirror");
        }
        for matrix in [entry, exit].into_iter().flatten() {
            let mixed = |k: usize| turned(k / dim) != turned(k % dim) && matrix[k] != 0.0;
            if (0..dim * dim).any(mixed) {
                return fail("a matrix that mixes planes on either side of the mirror");
            }
        }
        let Some(reversor) = symmetries.reversor else { return Ok(()) };
        if from != to || reflected(from, dim, reversor.half()) != *from {
            return fail("a centre off the reflection");
        }
        // R after the map and before it is R₀ about N, which has the first half of the coordinates.
        let one: Vec<f64> =
            (0..dim * dim).map(|k| f64::from(u8::from(k / dim == k % dim))).collect();
        let [entry, exit] = [entry, exit].map(|of| of.as_ref().unwrap_or(&one));
        let exit = rows_reflected(exit, dim, reversor.half());
        for k in 0..dim * dim {
            let (row, column) = (k / dim, k % dim);
            let products = || (0..dim).map(|i| entry[row * dim + i] * exit[i * dim + column]);
            let expected = match (row == column, row < dof) {
                (false, _) => 0.0,
                (true, true) => -1.0,
                (true, false) => 1.0,
            };
            let (found, size): (f64, f64) = (products().sum(), products().map(f64::abs).sum());
            if !((found - expected).abs() <= NEARLY * size.max(1.0)) {
                return fail("matrices that the reflection does not exchange");
            }
        }
        Ok(())
    }

    /// Draws points among the pairs: uniform in their box in the frame, shrunk by 1/√(2n) about its middle, and with
    /// images in that of the images.
    ///
    /// # Errors
    /// [`Error::CountOutOfRange`] of no points or too many; [`Error::Invalid`] when nearly no points have such images.
    pub fn sample(&self, count: usize, stream: &mut Stream) -> Result<Vec<f64>, Error> {
        /// So many are drawn for each that is wanted.
        const TRIES: usize = 100;
        Error::check_count_range("points", count, 1, 1 << 24)?;
        let (dim, box_of) = (2 * self.dof, &self.forward.start.basis);
        let leave = Frame { to: self.frame.from.clone(), ..self.frame.inverse(self.dof) };
        let back = self.frame.inverse(self.dof);
        let share = 1.0 / libm::sqrt(dim as f64);
        let mut out = Vec::with_capacity(count * dim);
        for _ in 0..count.saturating_mul(TRIES) {
            if is_stopped() {
                return Err(Error::Stopped { what: "samples".into() });
            }
            let u: Vec<f64> = (0..dim)
                .map(|k| box_of.centre()[k] + stream.uniform(-share, share) / box_of.factors[k])
                .collect();
            let mut z = match &leave.exit {
                Some(exit) => apply(exit, &u),
                None => u,
            };
            z.iter_mut().zip(&leave.to).for_each(|(z, c)| *z += c);
            let mut image = z.clone();
            self.step(&mut image);
            if self.backward.start.basis.is_inside(&back.enter(&image)) {
                out.extend(z);
            }
            if out.len() == count * dim {
                return Ok(out);
            }
        }
        let found = format!("{} of {count} points", out.len() / dim);
        Err(Error::invalid("images in the box of the pairs", found, "all of them"))
    }

    /// The inverse of the map, whose inverse is this one, bit for bit.
    pub fn inverted(&self) -> Self {
        Self {
            dof: self.dof,
            symmetries: self.symmetries.clone(),
            frame: self.frame.inverse(self.dof),
            basis: self.basis.clone(),
            coefficients: self.coefficients.iter().map(|c| -c).collect(),
            forward: self.backward.clone(),
            backward: self.forward.clone(),
        }
    }

    /// n, its degrees of freedom.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// The symmetries that it was fitted with.
    pub fn symmetries(&self) -> &Symmetries {
        &self.symmetries
    }

    /// The total degree of its generating function.
    pub fn degree(&self) -> usize {
        self.basis.degree
    }

    /// How many coefficients its generating function has, without the constant.
    pub fn parameters(&self) -> usize {
        self.coefficients.len() - 1
    }

    /// The coefficients of its generating function, without the constant.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients[1..]
    }

    /// How many iterations of Newton's method a step takes.
    pub fn iterations(&self) -> usize {
        self.forward.iterations
    }

    /// Replaces a point z by its image under the map.
    ///
    /// # Panics
    /// When z is not of 2n numbers.
    #[inline(always)]
    pub fn step<S: Scalar>(&self, z: &mut [S]) {
        lane_map::step(self, z);
    }

    /// The root mean square distance of its images from those of pairs.
    ///
    /// # Panics
    /// When the pairs are of other degrees of freedom.
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

    /// Points ← their images, all of them.
    pub(crate) fn move_all(&self, points: &mut [f64]) {
        lane_map::move_all(self, points).expect("whole points");
    }

    /// w of u at G points; and, of each component, the change by the last iteration with a matrix of its own, and that
    /// by the last of all.
    #[inline(always)]
    fn midpoint<S: Scalar, const D: usize, const G: usize>(
        &self,
        here: &[[S; G]; DIM],
        space: &mut [[S; G]],
        [iterations, frozen]: [usize; 2],
    ) -> ([[S; G]; DIM], [[[S; G]; DIM]; 2]) {
        let dim = if D > 0 { D } else { 2 * self.dof };
        let dof = dim / 2;
        let half = S::from_f64(0.5);
        let places = &self.basis.places;
        let mut middle = [[S::zero(); G]; DIM];
        let Start { basis, coefficients, mirrored } = &self.forward.start;
        match mirrored {
            None => basis.values(dim, dim, coefficients, here, space, &mut middle),
            Some(odd) => {
                let count = 2 * self.symmetries.mirrored.len();
                let mut own = [[S::zero(); G]; DIM];
                basis.values(dim, dim - count, coefficients, here, space, &mut own);
                let mut odd_ones = [[S::zero(); G]; DIM];
                odd.basis.values(dim, count, &odd.coefficients, here, space, &mut odd_ones);
                let (mut k, mut odd_k) = (0, 0);
                for axis in 0..dim {
                    if self.symmetries.is_mirrored(axis, dof) {
                        middle[axis] = odd_ones[odd_k];
                        odd_k += 1;
                    } else {
                        middle[axis] = own[k];
                        k += 1;
                    }
                }
            }
        }
        let (tables, rest) = space.split_at_mut(TABLES * dim * self.basis.count());
        let (sums, matrix) = rest.split_at_mut(jets_before::<TABLES>(dim, dim - 1));
        let matrix = &mut matrix[..dim * dim];
        let mut changes = [[[S::zero(); G]; DIM]; 2];
        for iteration in 0..iterations {
            for axis in 0..dim {
                // What the midpoint is in error by goes with the iteration.
                for g in 0..G {
                    middle[axis][g] = middle[axis][g].without_bound();
                }
            }
            let has_own = iteration + frozen < iterations;
            // (1 − ½ΩH) δ = w − u − ½Ω∇S
            if has_own {
                self.derivatives::<S, TABLES, G>(dim, &middle, tables, sums);
                for i in 0..dof {
                    for k in 0..dim {
                        let column = places[k];
                        let q = curvature(dim, places[i], column);
                        let p = curvature(dim, places[dof + i], column);
                        for g in 0..G {
                            matrix[i * dim + k][g] = -(half * sums[p][g]);
                            matrix[(dof + i) * dim + k][g] = half * sums[q][g];
                        }
                    }
                }
                for i in 0..dim {
                    for g in 0..G {
                        matrix[i * dim + i][g] += S::from_f64(1.0);
                    }
                }
                factorise(dim, matrix);
            } else {
                self.derivatives::<S, 2, G>(dim, &middle, tables, sums);
            }
            let mut rest = [[S::zero(); G]; DIM];
            for i in 0..dof {
                let (q, p) = (slope(places[i]), slope(places[dof + i]));
                for g in 0..G {
                    rest[i][g] = (middle[i][g] - here[i][g]) - half * sums[p][g];
                    rest[dof + i][g] =
                        half.mul_add(sums[q][g], middle[dof + i][g] - here[dof + i][g]);
                }
            }
            let change = solved(dim, matrix, rest);
            for i in 0..dim {
                for g in 0..G {
                    middle[i][g] -= change[i][g];
                }
            }
            changes = [if has_own { change } else { changes[0] }, change];
        }
        (middle, changes)
    }

    /// The sum over terms that differ in their degree in the last coordinate, of the term and of its first T − 1
    /// derivatives by it.
    #[inline(always)]
    fn along_last<S: Scalar, const T: usize, const G: usize>(
        &self,
        dim: usize,
        run: &Run,
        own: &[f64],
        tables: &[[S; G]],
    ) -> [[S; G]; T] {
        let count = self.basis.count();
        let tables = &tables[T * (dim - 1) * count..][..T * count];
        let mut out = [[S::zero(); G]; T];
        for (k, c) in own.iter().enumerate() {
            let c = S::from_f64(*c);
            let power = run.lowest + k * run.stride;
            for order in 0..T {
                for g in 0..G {
                    out[order][g] = tables[order * count + power][g].mul_add(c, out[order][g]);
                }
            }
        }
        out
    }

    /// The sums of the value of S and of its derivatives of order below T at w. Sums over the terms of like degrees in
    /// the first coordinates are made from the last coordinate to the first, so that each is multiplied once for all
    /// terms in it.
    #[inline(always)]
    fn derivatives<S: Scalar, const T: usize, const G: usize>(
        &self,
        dim: usize,
        middle: &[[S; G]; DIM],
        tables: &mut [[S; G]],
        sums: &mut [[S; G]],
    ) {
        let count = self.basis.count();
        for (place, table) in tables.chunks_exact_mut(T * count).take(dim).enumerate() {
            let axis = self.basis.order[place];
            self.basis.fill_with_derivatives(axis, &middle[axis], table);
        }
        let sums = &mut sums[..jets_before::<T>(dim, dim - 1)];
        for sum in sums.iter_mut() {
            *sum = [S::zero(); G];
        }
        let mut first = 0;
        for run in &self.basis.runs {
            let own = &self.coefficients[first..first + run.terms];
            first += own.len();
            let inner: [[S; G]; T] = self.along_last(dim, run, own, tables);
            let factor = entries_of(tables, count, dim - 2, run.degrees[dim - 2]);
            fold::<S, T, G>(1, factor, &inner, &mut sums[jets_before::<T>(dim, dim - 2)..]);
            for axis in (run.closes..dim - 2).rev() {
                let before = jets_before::<T>(dim, axis);
                let (own, inner) = sums[before..].split_at_mut(jet::<T>(dim - axis));
                let inner = &mut inner[..jet::<T>(dim - axis - 1)];
                let factor = entries_of(tables, count, axis, run.degrees[axis]);
                fold::<S, T, G>(dim - axis - 1, factor, inner, own);
                for sum in inner {
                    *sum = [S::zero(); G];
                }
            }
        }
    }
}

/// How many numbers the value of a function of so many coordinates and its derivatives of orders below T are.
const fn jet<const T: usize>(coordinates: usize) -> usize {
    if T < TABLES { coordinates + 1 } else { (coordinates + 1) * (coordinates + 2) / 2 }
}

/// Where in these the derivative by a coordinate is.
const fn slope(i: usize) -> usize {
    1 + i
}

/// Where the one by coordinates i and j is.
const fn curvature(coordinates: usize, i: usize, j: usize) -> usize {
    let (low, high) = if i < j { (i, j) } else { (j, i) };
    1 + coordinates + high * (high + 1) / 2 + low
}

/// The numbers of the sums over all coordinates, over all from the second on, and so on, before those from one on.
const fn jets_before<const T: usize>(dim: usize, axis: usize) -> usize {
    let (mut before, mut k) = (0, 0);
    while k < axis {
        before += jet::<T>(dim - k);
        k += 1;
    }
    before
}

/// A polynomial of one coordinate and its first T − 1 derivatives.
#[inline(always)]
fn entries_of<S: Scalar, const T: usize, const G: usize>(
    tables: &[[S; G]],
    count: usize,
    axis: usize,
    degree: usize,
) -> [[S; G]; T] {
    let mut out = [[S::zero(); G]; T];
    for order in 0..T {
        out[order] = tables[(T * axis + order) * count + degree];
    }
    out
}

/// Adds a function of one coordinate times a function of `others` coordinates that follow it, with their derivatives of
/// order below T, to a sum of such products.
#[inline(always)]
fn fold<S: Scalar, const T: usize, const G: usize>(
    others: usize,
    first: [[S; G]; T],
    inner: &[[S; G]],
    sums: &mut [[S; G]],
) {
    let all = others + 1;
    let [value, along, twice] = [0, slope(0), curvature(all, 0, 0)];
    for g in 0..G {
        for order in 0..T {
            let to = [value, along, twice][order];
            sums[to][g] = first[order][g].mul_add(inner[0][g], sums[to][g]);
        }
    }
    for i in 0..others {
        let own = slope(i + 1);
        for g in 0..G {
            sums[own][g] = first[0][g].mul_add(inner[slope(i)][g], sums[own][g]);
        }
        if T < TABLES {
            continue;
        }
        let mixed = curvature(all, i + 1, 0);
        for g in 0..G {
            sums[mixed][g] = first[1][g].mul_add(inner[slope(i)][g], sums[mixed][g]);
        }
        for j in 0..=i {
            let (from, to) = (curvature(others, i, j), curvature(all, i + 1, j + 1));
            for g in 0..G {
                sums[to][g] = first[0][g].mul_add(inner[from][g], sums[to][g]);
            }
        }
    }
}

/// Points of the box of others, shrunk by 1/√(2n) about its middle.
fn among(box_of: &ProductBasis) -> Vec<f64> {
    const POINTS: usize = 512;
    let mut stream = Stream::new(0, "symplectic polynomial/among the pairs");
    let dim = box_of.factors.len();
    let share = 1.0 / libm::sqrt(dim as f64);
    let of = |k: usize| box_of.centre()[k] + stream.uniform(-share, share) / box_of.factors[k];
    (0..POINTS * dim).map(|k| k % dim).map(of).collect()
}

/// Of a polynomial of one coordinate: it and its first two derivatives.
const TABLES: usize = 3;
/// The largest changes for some u, as [`SymplecticPolynomial::changes`] has them.
struct Changes<'a> {
    map: &'a SymplecticPolynomial,
    points: &'a [f64],
    /// The number of iterations, and of those that are frozen.
    iterations: [usize; 2],
}

impl Kernel for Changes<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn run<V: Pack>(self) -> [f64; 2] {
        let Self { map, points, iterations } = self;
        let dim = 2 * map.dof;
        let mut lanes = vec![V::zero(); dim];
        let mut shown = vec![0.0; V::LANES * dim];
        let mut space = vec![[V::zero()]; map.space()];
        let mut here = [[V::zero()]; DIM];
        let mut largest = [0.0; 2];
        for group in points.chunks(V::LANES * dim) {
            load_groups(group, dim, &mut lanes);
            for k in 0..dim {
                here[k] = [lanes[k]];
            }
            let (_, changes) = map.midpoint::<V, 0, 1>(&here, &mut space, iterations);
            for (change, largest) in changes.iter().zip(&mut largest) {
                for k in 0..dim {
                    lanes[k] = change[k][0];
                }
                store_groups(&lanes, dim, &mut shown[..group.len()]);
                for (k, change) in shown[..group.len()].iter().enumerate() {
                    *largest = max_or_nan(*largest, (change * map.basis.factors[k % dim]).abs());
                }
            }
        }
        largest
    }
}

/// The error that iterations leave, from the change by the last one with a matrix of its own and from the last change:
/// Newton's method leaves its square times a number, the bend, and a frozen iteration twice the product of both changes
/// times this number.
fn left([own, last]: [f64; 2], frozen: usize, bend: Option<f64>) -> f64 {
    /// The bend is larger elsewhere than where it was found, by this factor at most.
    const SAFETY: f64 = 4.0;
    let bend = bend.map_or(1.0, |bend| SAFETY * bend);
    bend * last * if frozen == 0 { last } else { 2.0 * own }
}

/// The largest ratio of a change to the square of the one before it, where Newton's method converges and rounding has
/// no part in it.
fn bend_of(before: Option<f64>, last: f64, known: Option<f64>) -> Option<f64> {
    const FAR_FROM_ROUNDING: f64 = 1e-12;
    match before {
        Some(before) if last > FAR_FROM_ROUNDING && last < before && before < FAR_OFF => {
            Some(max_or_nan(known.unwrap_or(0.0), last / (before * before)))
        }
        _ => known,
    }
}

impl<S: Scalar> Map<S> for SymplecticPolynomial {
    fn dof(&self) -> usize {
        self.dof
    }
    // Once for each number type: laws call it from many places.
    #[inline(never)]
    fn forward(&self, z: &mut [S]) {
        self.step(z);
    }
    fn inverse(&self, z: &mut [S]) {
        self.inverted().forward(z);
    }
}

impl LaneMap for SymplecticPolynomial {
    const FOUR: bool = true;

    fn dim(&self) -> usize {
        2 * self.dof
    }

    fn space(&self) -> usize {
        let dim = 2 * self.dof;
        TABLES * dim * self.basis.count() + jets_before::<TABLES>(dim, dim - 1) + dim * dim
    }

    #[inline(always)]
    fn move_together<S: Scalar, const D: usize, const G: usize>(
        &self,
        space: &mut [[S; G]],
        z: &mut [S],
    ) {
        let dim = if D > 0 { D } else { 2 * self.dof };
        let Frame { from, entry, to, exit } = &self.frame;
        let mut here = [[S::zero(); G]; DIM];
        for g in 0..G {
            for k in 0..dim {
                here[k][g] = z[g * dim + k] - S::from_f64(from[k]);
            }
        }
        if let Some(entry) = entry {
            let off = here;
            for row in 0..dim {
                here[row] = along_row(&entry[row * dim..][..dim], &off, 0.0);
            }
        }
        let Solution { iterations, frozen, .. } = self.forward;
        let (middle, _) = self.midpoint::<S, D, G>(&here, space, [iterations, frozen]);
        for i in 0..dim {
            for g in 0..G {
                here[i][g] = middle[i][g] + (middle[i][g] - here[i][g]);
            }
        }
        for row in 0..dim {
            let mut sum = here[row];
            match exit {
                Some(exit) => sum = along_row(&exit[row * dim..][..dim], &here, to[row]),
                None => {
                    for g in 0..G {
                        sum[g] += S::from_f64(to[row]);
                    }
                }
            }
            for g in 0..G {
                z[g * dim + row] = sum[g];
            }
        }
    }
}

/// A row of a matrix times the coordinates of G points, and a constant.
#[inline(always)]
fn along_row<S: Scalar, const G: usize>(row: &[f64], z: &[[S; G]; DIM], constant: f64) -> [S; G] {
    let mut sum = [S::from_f64(constant); G];
    for (k, entry) in row.iter().enumerate() {
        for g in 0..G {
            sum[g] = z[k][g].mul_add(S::from_f64(*entry), sum[g]);
        }
    }
    sum
}

/// A matrix A near the identity, row by row ← L and U of A = LU, and one over the diagonal of U in its place.
#[inline(always)]
fn factorise<S: Scalar, const G: usize>(dim: usize, matrix: &mut [[S; G]]) {
    for column in 0..dim {
        let above = column * dim;
        for g in 0..G {
            matrix[above + column][g] = S::from_f64(1.0) / matrix[above + column][g];
        }
        for row in column + 1..dim {
            let own = row * dim;
            for g in 0..G {
                let factor = matrix[own + column][g] * matrix[above + column][g];
                matrix[own + column][g] = factor;
                for k in column + 1..dim {
                    let known = matrix[above + k][g];
                    matrix[own + k][g] -= factor * known;
                }
            }
        }
    }
}

/// The solution of equations with a matrix that is [`factorise`]d.
#[inline(always)]
fn solved<S: Scalar, const G: usize>(
    dim: usize,
    matrix: &[[S; G]],
    mut right: [[S; G]; DIM],
) -> [[S; G]; DIM] {
    for row in 1..dim {
        for k in 0..row {
            for g in 0..G {
                let known = right[k][g];
                right[row][g] -= matrix[row * dim + k][g] * known;
            }
        }
    }
    for row in (0..dim).rev() {
        for k in row + 1..dim {
            for g in 0..G {
                let known = right[k][g];
                right[row][g] -= matrix[row * dim + k][g] * known;
            }
        }
        for g in 0..G {
            right[row][g] *= matrix[row * dim + row][g];
        }
    }
    right
}

/// The coefficients of S: from v − u at each midpoint its slopes, in units of the box.
fn generator(
    basis: &ProductBasis,
    middles: &[f64],
    before: &[f64],
    after: &[f64],
) -> Result<Vec<f64>, Error> {
    let dim = basis.dim;
    let dof = dim / 2;
    let pair = |k: usize| (k + dof) % dim;
    let scale = |axis: usize| basis.factors[pair(axis)];
    let number = middles.len();
    let row = |index: usize| (index / dim, index % dim);
    let rows: Vec<Vec<f64>> = (0..number)
        .into_par_iter()
        .map(|index| {
            let (point, axis) = row(index);
            basis.products(&middles[point * dim..][..dim], Some(axis))
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
