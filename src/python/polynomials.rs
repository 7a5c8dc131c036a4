//! Symplectic polynomials in Python.

use super::arrays::{Points, Rows, array, dof_of, point_of, points_of, rows_of};
use super::certificate::PyCertificate;
use super::interrupt::{abandonable, by_parts, interruptible, measured};
use super::orbits::{self, OrbitMap};
use super::outside::{Outside, box_of, survived};
use super::trained::warn;
use crate::error::Error;
use crate::flow::{Pairs, PolynomialOnSection, Region, SectionExit, Symmetries};
use crate::io::{
    Provenance, StoredPolynomial, load_polynomial, parse_polynomial, polynomial_text, read_section,
    save_polynomial,
};
use crate::layer::Reversor;
use crate::measure::certificate::{CertificateOptions, certify_polynomial};
use crate::measure::orbits::{Branch, SymmetryLine, lyapunov_exponent, smaller_alignment_index};
use crate::network::{Pace, Rollout};
use crate::phase::Direction;
use crate::train::{Control, PolynomialFit, PolynomialTrial};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::path::PathBuf;

/// A symplectic map whose generating function is a polynomial of total degree `degree`, fitted to pairs by linear
/// least squares: `input` and `output` are (N, 2n), q1 ... qn, p1 ... pn, of one map with up to four degrees of
/// freedom. It needs no training, and is symplectic whatever the pairs are; a step solves an implicit equation for the
/// midpoint. Without a degree, degrees are raised until the error on held-out pairs falls no more by a tenth: a share
/// `validation` of the pairs, 0.1 unless given, chosen by `seed`. With a degree none are held out unless `validation`
/// says so.
///
/// With `reversor`, "positions" or "momenta", it is also conjugated to its inverse by the reflection of these, and has
/// about half the parameters. So it has with `mirrored`, the planes, from 1 to n, whose reflection (q, p) -> (-q, -p),
/// of all of them together, commutes with the map; the vertical plane of a ring without skew fields is one. `section`
/// is that of `train`, a file of the density of the area form, without controls; reflections are then those of the
/// canonical coordinates, of which q is y.
///
/// Warns (UserWarning) where the pairs are of no symplectic map, or of another symmetry, where held-out pairs repeat
/// inputs, and of a density that is not known to 1e-6. Raises Error when the pairs are too few for the degree, of other
/// shapes, or of a map whose linear part is not near a symplectic one, and when the equation has no solution near some
/// pair. Ctrl-C ends it within a second; what computes the degree at hand goes on until that is done.
#[pyclass(frozen, module = "gyroceptron", name = "SymplecticPolynomial")]
pub(super) struct PySymplecticPolynomial {
    map: PolynomialOnSection,
    dof: usize,
    provenance: Provenance,
}

/// The share of the pairs that is held out where the degree is to be found.
const HELD_OUT: f64 = 0.1;
/// What the pairs are called in errors.
const PAIRS: &str = "pairs";

fn pairs_of(input: &Rows<'_>, output: &Rows<'_>, dof: usize) -> PyResult<Pairs> {
    let [input, output] = [rows_of("input", input, dof)?, rows_of("output", output, dof)?];
    Ok(Pairs::new(PAIRS, dof, input, output)?)
}

impl PySymplecticPolynomial {
    fn points(&self, points: &Rows<'_>) -> PyResult<Points> {
        let points = points_of("points", points, self.dof)?;
        self.map.check_points("points", &points.values)?;
        Ok(points)
    }
}

impl OrbitMap for PolynomialOnSection {
    fn dof(&self) -> usize {
        self.map().dof()
    }
    fn on_section(&self) -> bool {
        self.has_section()
    }
    fn region(&self) -> Option<&Region> {
        Some(self.region())
    }
    fn with_jacobian(&self, z: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Error> {
        self.check_points("points", z)?;
        Ok(self.with_jacobian(z))
    }
    fn followed(
        &self,
        points: &[f64],
        maps: usize,
        pace: &mut Pace<'_>,
    ) -> Result<Vec<f64>, Error> {
        let request = Rollout { steps: maps, every: 1 };
        Ok(self.rollout_at_pace(points, request, pace)?.split_off(points.len()))
    }
}

#[pymethods]
impl PySymplecticPolynomial {
    #[new]
    #[pyo3(signature = (
        input, output, degree=None, reversor=None, section=None, mirrored=Vec::new(), validation=None, seed=0
    ))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        input: Rows<'_>,
        output: Rows<'_>,
        degree: Option<usize>,
        reversor: Option<&str>,
        section: Option<PathBuf>,
        mirrored: Vec<usize>,
        validation: Option<f64>,
        seed: u64,
    ) -> PyResult<Self> {
        let reversor = reversor.map(Reversor::find).transpose()?;
        let symmetries = Symmetries { reversor, mirrored };
        let dof = dof_of("input", &input)?;
        let pairs = pairs_of(&input, &output, dof)?;
        let section = section.as_deref().map(read_section).transpose()?;
        let validation = validation.unwrap_or(if degree.is_some() { 0.0 } else { HELD_OUT });
        let fit = PolynomialFit { degree, symmetries, section, validation, seed };
        let fitted = abandonable(py, move |stop| {
            fit.run(pairs, &mut |_: &PolynomialTrial| {
                Ok(if stop.go_on() { Control::Continue } else { Control::Interrupt })
            })
        })?;
        fitted.notes.iter().try_for_each(|note| warn(py, &note.to_string()))?;
        let StoredPolynomial { map, provenance } = StoredPolynomial::of_fit(&fitted, seed);
        Ok(Self { map, dof, provenance })
    }

    /// The polynomial of a file that `save` wrote. Raises Error when it is missing, corrupt, or of another kind.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let StoredPolynomial { map, provenance } = load_polynomial(&path)?;
        Ok(Self { dof: map.map().dof(), map, provenance })
    }

    /// Writes a file, which `load` reads. Raises Error when there is a file of that name, unless `overwrite`, or it
    /// cannot be written.
    #[pyo3(signature = (path, overwrite=false))]
    fn save(&self, path: PathBuf, overwrite: bool) -> PyResult<()> {
        if path.exists() && !overwrite {
            return Err(Error::FileExists { path }.into());
        }
        let provenance = self.provenance.clone();
        Ok(save_polynomial(&path, &StoredPolynomial { map: self.map.clone(), provenance })?)
    }

    /// The total degree of the generating function.
    #[getter]
    fn degree(&self) -> usize {
        self.map.map().degree()
    }

    /// The coefficients of the generating function, without the constant.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        array(py, self.map.map().coefficients().to_vec(), vec![self.map.map().parameters()])
    }

    /// The box of the pairs: the lowest and the highest of each coordinate.
    #[getter]
    fn region(&self) -> (Vec<f64>, Vec<f64>) {
        (self.map.region().low.clone(), self.map.region().high.clone())
    }

    /// The root mean square distance of the images of `input` from `output`, both (N, 2n).
    fn error(&self, py: Python<'_>, input: Rows<'_>, output: Rows<'_>) -> PyResult<f64> {
        let pairs = pairs_of(&input, &output, self.dof)?;
        let map = self.map.clone();
        abandonable(py, move |_| map.error_on(&pairs))
    }

    /// The states of the trajectories from `points`, (..., 2n), with one in `every` kept: (abs(steps) // every + 1,
    /// ..., 2n), the points themselves first. Negative `steps` apply the inverse map. `outside` says what to do when a
    /// trajectory leaves the box of the pairs by more than a hundredth of its width, beyond which polynomials grow
    /// without a bound: "warn" (UserWarning), "stop" (an Error) or "ignore". A trajectory that leaves the box of a
    /// section, or comes to where the map has no image, is NaN from there on.
    #[pyo3(signature = (points, steps=1, every=1, outside="warn"))]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
        steps: isize,
        every: usize,
        outside: &str,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = self.points(&points)?;
        let inverse = (steps < 0).then(|| self.map.inverted());
        let (map, steps) = (inverse.as_ref().unwrap_or(&self.map), steps.unsigned_abs());
        Error::check_count_range("steps", steps, 1, usize::MAX)?;
        Error::check_count_range("every", every, 1, steps)?;
        let outside = Outside::of(outside)?;
        let count = points.values.len() / (2 * self.dof);
        let request = Rollout { steps, every };
        let states = interruptible(py, |pace| map.rollout_at_pace(&points.values, request, pace))?;
        outside.report(py, || {
            let region = self.map.region();
            let left = region.left_by(&states, count, every);
            let has_section = self.map.has_section();
            let lost = SectionExit::in_states(&states, self.dof, count, every);
            let left = left.map(|left| left.describe(region, has_section));
            [left, lost.map(|lost| lost.describe(has_section))]
        })?;
        array(py, states, points.shape(&[steps / every + 1], &[2 * self.dof]))
    }

    /// The preimages of `points`, (..., 2n), under one step: an array of the same shape.
    fn inverse<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = self.points(&points)?;
        let (dim, back) = (2 * self.dof, self.map.inverted());
        let values = by_parts(py, "inverse", dim, &points.values, |part| {
            let request = Rollout { steps: 1, every: 1 };
            Ok(back.rollout(part, request)?.split_off(part.len()))
        })?;
        array(py, values, points.shape(&[], &[dim]))
    }

    /// The Jacobians at `points`, (..., 2n), by dual numbers: (..., 2n, 2n).
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = self.points(&points)?;
        let dim = 2 * self.dof;
        let values = by_parts(py, "Jacobians", dim, &points.values, |part| {
            Ok(part.chunks_exact(dim).flat_map(|z| self.map.with_jacobian(z).1).collect())
        })?;
        array(py, values, points.shape(&[], &[dim, dim]))
    }

    /// Tests at `samples` points in the middle of the box of the pairs whether the map is symplectic, undone by its
    /// inverse, and reversible where it was fitted so, each to rounding: a `Certificate`. Raises Error when there are
    /// no samples.
    #[pyo3(signature = (samples=200, seed=0))]
    fn verify(&self, py: Python<'_>, samples: usize, seed: u64) -> PyResult<PyCertificate> {
        let options = CertificateOptions { samples, seed, ..CertificateOptions::default() };
        options.check()?;
        let inner = measured(py, || certify_polynomial(self.map.map(), options))?;
        Ok(PyCertificate { inner, notes: Vec::new() })
    }

    /// As `Model.survival`: the number of steps after which each orbit from `points`, (..., 2n), is outside of the box
    /// from `low` to `high` for the first time, 0 if it begins outside, or `steps` + 1 if it stays inside: (...),
    /// integers.
    #[pyo3(signature = (points, steps, low=None, high=None))]
    fn survival<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
        steps: usize,
        low: Option<Vec<f64>>,
        high: Option<Vec<f64>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        let points = self.points(&points)?;
        let region = box_of([low, high], Some(self.map.region()), self.dof)?;
        survived(py, &self.map, &points, steps, &region)
    }

    /// The dynamic aperture along rays from `centre`, as of `Model.dynamic_aperture`, in units of the data: for each of
    /// `directions`, (M, 2n), the largest of `radii`, which ascend, up to which all points centre + radius * direction
    /// stay in a box for `steps` steps, or 0: (M,). The box is as in `survival`.
    #[pyo3(signature = (centre, directions, radii, steps, low=None, high=None))]
    #[allow(clippy::too_many_arguments, reason = "keywords of Python")]
    fn dynamic_aperture<'py>(
        &self,
        py: Python<'py>,
        centre: Rows<'py>,
        directions: Rows<'py>,
        radii: Vec<f64>,
        steps: usize,
        low: Option<Vec<f64>>,
        high: Option<Vec<f64>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let centre = point_of("centre", &centre, self.dof)?;
        self.map.check_points("centre", &centre)?;
        let region = box_of([low, high], Some(self.map.region()), self.dof)?;
        let rays = (&*centre, &directions);
        orbits::dynamic_aperture_of(py, &self.map, rays, &radii, steps, &region)
    }

    /// The distinct orbits of exactly `period` steps that Newton's method finds from `guesses`, (N, 2n), in units of
    /// the data: a dictionary each, as of `Model.periodic_orbits`. Raises Error of a point that is not on the section.
    #[pyo3(signature = (guesses, period=1, apart=1e-6))]
    fn periodic_orbits<'py>(
        &self,
        py: Python<'py>,
        guesses: Rows<'py>,
        period: usize,
        apart: f64,
    ) -> PyResult<Bound<'py, PyList>> {
        orbits::periodic_orbits_of(py, &self.map, &guesses, period, apart)
    }

    /// The periodic orbits of exactly `period` steps that begin on the line of symmetry of a reversible map of a plane,
    /// from `low` to `high` on it, in units of the data, found without a guess: dictionaries, as of
    /// `Model.symmetric_orbits`. The line of a section with `reversor` "positions" is Z = 0. That the map is reversible
    /// is not tested.
    #[pyo3(signature = (reversor, low, high, period=1, *, samples=200))]
    fn symmetric_orbits<'py>(
        &self,
        py: Python<'py>,
        reversor: &str,
        low: f64,
        high: f64,
        period: usize,
        samples: usize,
    ) -> PyResult<Bound<'py, PyList>> {
        let reversor = Reversor::find(reversor)?;
        let line = SymmetryLine { reversor, from: low, to: high, samples };
        orbits::symmetric_orbits_of(py, &self.map, line, period)
    }

    /// The island around the elliptic orbit of `period` steps near `guess`, of a map of a plane, on the ray from
    /// `around` through the first point of the orbit, in units of the data: low, high, width and angle, as of
    /// `Model.island`, or None.
    #[pyo3(signature = (guess, period=1, *, around, reach=0.15))]
    fn island<'py>(
        &self,
        py: Python<'py>,
        guess: Rows<'py>,
        period: usize,
        around: Rows<'py>,
        reach: f64,
    ) -> PyResult<Option<Bound<'py, PyDict>>> {
        orbits::island_of(py, &self.map, &guess, period, &around, reach)
    }

    /// The finite-time Lyapunov exponent of the orbit from `point` over `steps` steps, per step, in units of the data.
    fn lyapunov_exponent(&self, py: Python<'_>, point: Rows<'_>, steps: usize) -> PyResult<f64> {
        orbits::of_orbit(py, &self.map, &point, steps, lyapunov_exponent)
    }

    /// The smaller alignment index of the orbit from `point` after `steps` steps, in units of the data: 0 up to
    /// rounding in chaos.
    fn alignment_index(&self, py: Python<'_>, point: Rows<'_>, steps: usize) -> PyResult<f64> {
        orbits::of_orbit(py, &self.map, &point, steps, smaller_alignment_index)
    }

    /// A branch of the unstable or the stable manifold of the periodic orbit of `period` steps near `guess`, of a map
    /// of a plane, in units of the data: points (N, 2), as of `Model.manifold`. Raises Error where points leave no such
    /// orbit.
    #[pyo3(signature = (guess, period=1, *, stable=false, forward=true, start=1e-6, spacing=1e-2, length=1.0))]
    #[allow(clippy::too_many_arguments, reason = "keywords of Python")]
    fn manifold<'py>(
        &self,
        py: Python<'py>,
        guess: Rows<'py>,
        period: usize,
        stable: bool,
        forward: bool,
        start: f64,
        spacing: f64,
        length: f64,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let branch = Branch { forward, start, spacing, length };
        let back = self.map.inverted();
        let mover = |direction, z: &mut [f64]| {
            let map = match direction {
                Direction::Forward => &self.map,
                Direction::Inverse => &back,
            };
            let image = map.rollout(z, Rollout { steps: 1, every: 1 })?;
            z.copy_from_slice(&image[z.len()..]);
            Ok(())
        };
        orbits::manifold_of(py, (&self.map, &mover), &guess, period, stable, branch)
    }

    fn __copy__(&self) -> Self {
        Self { map: self.map.clone(), dof: self.dof, provenance: self.provenance.clone() }
    }

    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.__copy__()
    }

    /// What makes it again: the text of its file.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let restore = py.import("gyroceptron._native")?.getattr("_restore_polynomial")?;
        let provenance = self.provenance.clone();
        let text = polynomial_text(&StoredPolynomial { map: self.map.clone(), provenance })?;
        Ok((restore, (text,)))
    }

    fn __repr__(&self) -> String {
        format!(
            "<gyroceptron.SymplecticPolynomial: degree {}, {} parameters, {} degrees of freedom>",
            self.map.map().degree(),
            self.map.map().parameters(),
            self.dof
        )
    }
}

/// A polynomial from its pickled text.
#[pyfunction]
pub(super) fn _restore_polynomial(text: &str) -> PyResult<PySymplecticPolynomial> {
    let StoredPolynomial { map, provenance } =
        parse_polynomial("pickled polynomial", text.as_bytes())?;
    Ok(PySymplecticPolynomial { dof: map.map().dof(), map, provenance })
}
