//! Models, and what people do with one.

use super::arrays::{Points, Rows, array, point_of, points_of};
use super::certificate::PyCertificate;
use super::interrupt::{by_parts, interruptible, measured};
use super::outside::{Outside, box_of, survived};
use super::trained::{Trained, TrainedParts, warn};
use super::{controls, exception, orbits};
use crate::error::Error;
use crate::flow::{Region, SectionExit};
use crate::io::{
    SourceCode, SourceLanguage, StoredModel, load_model, model_text, parse_model, save_model,
};
use crate::layer::Reversor;
use crate::measure::certificate::{CertificateOptions, certify};
use crate::measure::orbits::{Branch, SymmetryLine, lyapunov_exponent, smaller_alignment_index};
use crate::network::{Architecture, Course, Rollout};
use crate::phase::{Direction, Section};
use crate::scalar::{Grid, GridNumbers};
use crate::scene::{own_invariance_fault, render};
use numpy::{PyArray1, PyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use rayon::prelude::*;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;
use std::sync::Arc;

/// A network with the units and the box of its training points. It never changes: models are equal
/// when they are the same map, of one architecture with the same bits of parameters and units.
/// They can be copied and pickled.
#[pyclass(frozen, module = "gyroceptron")]
pub(super) struct Model {
    pub(super) stored: StoredModel,
    /// Of a model that was trained here.
    pub(super) trained: Option<Arc<Trained>>,
}

impl Model {
    fn architecture(&self) -> &Architecture {
        self.stored.model.architecture()
    }

    /// The map of its source code, with the other functions as its attributes.
    fn function_of<'py>(
        &self,
        py: Python<'py>,
        language: SourceLanguage,
    ) -> PyResult<Bound<'py, PyAny>> {
        let code = SourceCode::generate(&self.stored, language, "model", None)?;
        let (_, text) = &code.files[0];
        let builtins = py.import("builtins")?;
        let place = format!("<gyroceptron model {}>", self.stored.digest()?);
        let names = PyDict::new(py);
        // A module of its own: another model has a table of its own.
        names.set_item("__name__", "gyroceptron_model")?;
        let compiled = builtins.call_method1("compile", (text, place, "exec"))?;
        builtins.call_method1("exec", (compiled, &names))?;
        let out = names.as_any().get_item("map")?;
        for name in ["inverse", "iterate", "invariant"] {
            if let Some(function) = names.get_item(name)? {
                out.setattr(name, function)?;
            }
        }
        Ok(out)
    }

    fn points(&self, points: &Rows<'_>) -> PyResult<Points> {
        points_of("points", points, self.stored.model.composition().dof())
    }

    /// What equal models have in common.
    fn bits(&self) -> impl Iterator<Item = u64> {
        let units = self.stored.units.iter();
        let of_units = units.flat_map(|units| units.centre().iter().chain(units.factors()));
        let parameters = self.stored.model.composition().parameters();
        parameters.iter().chain(of_units).map(|number| number.to_bits())
    }
}

#[pymethods]
impl Model {
    /// The structure that its blocks give it: "plain", "nearly-periodic", "normal-form", "nearly-integrable" or
    /// "mixed".
    #[getter]
    fn structure(&self) -> &'static str {
        self.architecture().structure().name()
    }

    /// Its blocks, a dictionary each: layer, widths, part, scale and name, as `train` takes them.
    #[getter]
    fn blocks<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = serde_json::to_string(&self.architecture().blocks)
            .map_err(|reason| exception::Error::new_err(reason.to_string()))?;
        py.import("json")?.call_method1("loads", (text,))
    }

    /// The name of its architecture, if it has one: "gyroceptron", "normal-form",
    /// "coupling-gyroceptron", "kicked-gyroceptron", "henon-net" or "symp-net"; else "blocks".
    #[getter]
    fn kind(&self) -> &'static str {
        self.architecture().name().unwrap_or("blocks")
    }

    /// The degrees of freedom n: points have 2n numbers.
    #[getter]
    fn dof(&self) -> usize {
        self.stored.model.composition().dof()
    }

    /// ε of its near-identity part.
    #[getter]
    fn epsilon(&self) -> f64 {
        self.architecture().epsilon
    }

    /// The time of the flow map that the model approximates, where it is known.
    #[getter]
    fn flow_time(&self) -> Option<f64> {
        self.stored.provenance.flow_time
    }

    /// The angles of its circles, in radians.
    #[getter]
    fn angles(&self) -> Vec<f64> {
        self.stored.model.angles().to_vec()
    }

    /// All parameters, (P,), in the order of its file: a copy that cannot be written to, since it would
    /// not change the model.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let out = PyArray1::from_slice(py, self.stored.model.composition().parameters());
        out.call_method1("setflags", (false,))?;
        Ok(out)
    }

    /// Whether to trust the model, as in the report of its training: {"verdict": ..., "error": ..., "reasons": [...],
    /// "next": ...}. The error is that of one step in the plane that decides, "next" is the call to try next. None for
    /// a model that was loaded.
    #[getter]
    fn trust<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(trained) = &self.trained else { return Ok(None) };
        let out = PyDict::new(py);
        out.set_item("verdict", &trained.trust.verdict)?;
        out.set_item("error", &trained.trust.error)?;
        out.set_item("reasons", &trained.trust.reasons)?;
        out.set_item("next", &trained.next)?;
        Ok(Some(out))
    }

    /// The training records of the last stage: a list of {"iteration": ..., "loss": ..., "held_out": ...}, mean squared
    /// errors in units of the network; "held_out" is None where it was not evaluated. None for a model that was loaded.
    #[getter]
    fn history<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyList>>> {
        let Some(trained) = &self.trained else { return Ok(None) };
        let out = PyList::empty(py);
        for (iteration, loss, held_out) in &trained.history {
            let record = PyDict::new(py);
            record.set_item("iteration", iteration)?;
            record.set_item("loss", loss)?;
            record.set_item("held_out", held_out)?;
            out.append(record)?;
        }
        Ok(Some(out))
    }

    /// Notes on its training: the circle action that "auto" found, the units that were fitted. Empty for a model that
    /// was loaded.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.trained.as_ref().map(|trained| trained.notes.clone()).unwrap_or_default()
    }

    /// The held-out mean squared error of its training, in units of the network, with the weights
    /// of its loss.
    #[getter]
    fn validation(&self) -> Option<f64> {
        self.stored.provenance.validation
    }

    /// The corners (low, high) of the box of its training points.
    #[getter]
    fn region(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let region = self.stored.provenance.region.as_ref();
        region.map(|Region { low, high }| (low.clone(), high.clone()))
    }

    /// (centre, factors) of the units of its data, if they differ from the network's: points are centre + factors * w,
    /// where w are the coordinates of the network.
    #[getter]
    fn units(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let units = self.stored.units.as_ref();
        units.map(|units| (units.centre().to_vec(), units.factors().to_vec()))
    }

    /// Trajectories from `points`, (..., 2n), in units of the data: an array (abs(steps) // every + 1, ..., 2n), the
    /// points themselves first. `outside` says what to do when a trajectory leaves the box of the training points by
    /// more than a hundredth of its width, or the box of the network's polynomials, if it has any: "warn"
    /// (UserWarning), "stop" (an Error) or "ignore". A trajectory that leaves the box of a section, or that
    /// polynomials send to infinity from outside of theirs, is NaN from there on.
    ///
    /// Negative `steps` apply the inverse map. With grid=B the first state and every increment are rounded to a grid of
    /// 2^-B in the coordinates of the network: as many steps back from the last state then lead to the first one, bit
    /// for bit (UserWarning where float64 is too coarse for that). `grid_numbers` is "integers", the default, which
    /// wrap around, or "floats", which raise Error where an orbit leaves their range. Networks with twists or couplings
    /// are not bijections of a grid: Error.
    ///
    /// Raises Error when points are no real, finite numbers, have a mask or another last dimension, or a
    /// state of a network without polynomials and section leaves the finite numbers. Ctrl-C stops it within a second, as the other methods.
    #[pyo3(signature = (points, steps=1, every=1, outside="warn", grid=None, grid_numbers=None))]
    #[allow(clippy::too_many_arguments)]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
        steps: isize,
        every: usize,
        outside: &str,
        grid: Option<i64>,
        grid_numbers: Option<&str>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let direction = if steps < 0 { Direction::Inverse } else { Direction::Forward };
        let steps = steps.unsigned_abs();
        Error::check_count_range("steps", steps, 1, usize::MAX)?;
        if let (None, Some(numbers)) = (grid, grid_numbers) {
            return Err(Error::invalid("grid_numbers", numbers, "an option of a grid").into());
        }
        let name = grid_numbers.unwrap_or(GridNumbers::Integers.name());
        let numbers = GridNumbers::ALL.into_iter().find(|numbers| numbers.name() == name);
        let numbers =
            numbers.ok_or_else(|| Error::invalid("grid_numbers", name, "integers or floats"))?;
        let expected = || format!("0 to {} bits", numbers.most_bits());
        let bits =
            |bits: i64| u32::try_from(bits).map_err(|_| Error::invalid("grid", bits, expected()));
        let grid = grid.map(|own| Grid::new(bits(own)?, numbers)).transpose()?;
        let course = Course { direction, grid };
        Error::check_count_range("every", every, 1, steps)?;
        let outside = Outside::of(outside)?;
        let has_polynomials = self.stored.model.architecture().has_polynomials();
        if outside == Outside::Stop && !has_polynomials && self.stored.provenance.region.is_none() {
            let expected = "a model that knows the box of its training points";
            return Err(Error::invalid("outside", "stop", expected).into());
        }
        let points = self.points(&points)?;
        let initial = &points.values;
        let request = Rollout { steps, every };
        let rolled = interruptible(py, |pace| {
            self.stored.rollout_until_lost(course, initial, request, pace)
        })?;
        let states = rolled.states;
        if grid.is_some() && !rolled.is_exact {
            warn(
                py,
                "a state at the end is rounded to float64, which is coarser than the grid there: \
                      steps back from it end near the first state, not at it",
            )?;
        }
        let (dim, region) = (2 * self.dof(), self.stored.provenance.region.as_ref());
        let count = initial.len() / dim;
        outside.report(py, || {
            let left =
                region.and_then(|region| Some((region.left_by(&states, count, every)?, region)));
            let left =
                left.map(|(left, region)| left.describe(region, self.stored.section.is_some()));
            let lost = SectionExit::in_states(&states, self.dof(), count, every);
            let beyond = self.stored.leaves_polynomials(&states, count, every);
            [
                left,
                lost.map(|lost| lost.describe(self.stored.section.is_some())),
                beyond.map(|beyond| beyond.describe()),
            ]
        })?;
        array(py, states, points.shape(&[request.kept()], &[dim]))
    }

    /// The preimages of `points`, (..., 2n), under one step: an array of the same shape, in units of the data; NaN
    /// where there is none. Raises Error of points that are not of finite numbers.
    fn inverse<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = self.points(&points)?;
        let dim = 2 * self.dof();
        let values = by_parts(py, "inverse", dim, &points.values, |part| {
            let mut part = part.to_vec();
            self.stored.map_points(Direction::Inverse, &mut part)?;
            Ok(part)
        })?;
        array(py, values, points.shape(&[], &[dim]))
    }

    /// The Jacobians of one step at `points`, (..., 2n), by the chain rule, in units of the data: (..., 2n, 2n), where
    /// [..., i, k] is the derivative of coordinate i by coordinate k; NaN where the point has no image. Raises Error of
    /// points that are not of finite numbers.
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = self.points(&points)?;
        let dim = 2 * self.dof();
        let of = |part: &[f64]| self.stored.jacobians(part);
        let values = by_parts(py, "Jacobians", dim, &points.values, of)?;
        array(py, values, points.shape(&[], &[dim, dim]))
    }

    /// The invariant of the network at `points`, (..., 2n), in units of an action of the data: (...). For a gyroceptron
    /// it is the adiabatic invariant, for a network in normal form the sum of the actions; NaN where it is no number.
    /// Raises Error of points that are not of finite numbers, and of networks that own no invariant.
    fn invariant<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = self.points(&points)?;
        let Some(invariant) = self.stored.invariant() else {
            let expected = "a symplectic gyroceptron, which has an invariant";
            return Err(Error::invalid("invariant", self.kind(), expected).into());
        };
        let dim = 2 * self.dof();
        let values = by_parts(py, "invariant", dim, &points.values, |part| {
            Ok(part.par_chunks_exact(dim).map(&invariant).collect())
        })?;
        array(py, values, points.shape(&[], &[]))
    }

    /// The number of steps after which each orbit from `points`, (..., 2n), is outside of a box for the first time, 0
    /// if it begins outside, or `steps` + 1 if it stays inside: (...), integers. The box from `low` to `high`, 2n
    /// numbers each, is that of the training points unless given. Raises Error as `predict`, but for orbits that are
    /// lost, and where no box is known.
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
        let own = self.stored.provenance.region.as_ref();
        let region = box_of([low, high], own, self.dof())?;
        survived(py, &self.stored, &points, steps, &region)
    }

    /// The dynamic aperture along rays from `centre`, 2n numbers: for each of `directions`, (M, 2n), the largest of
    /// `radii`, which ascend, up to which all points centre + radius * direction stay in a box for `steps` steps, or 0:
    /// (M,). The box is as in `survival`. Raises Error as `survival`.
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
        let centre = point_of("centre", &centre, self.dof())?;
        self.stored.check_points("centre", &centre)?;
        let own = self.stored.provenance.region.as_ref();
        let region = box_of([low, high], own, self.dof())?;
        let rays = (&*centre, &directions);
        orbits::dynamic_aperture_of(py, &self.stored, rays, &radii, steps, &region)
    }

    /// The distinct orbits of exactly `period` steps that Newton's method with exact Jacobians finds from `guesses`,
    /// (N, 2n), in units of the data. Each is a dictionary: points, (period, 2n); multiplier, the Jacobian of a whole
    /// period, (2n, 2n); its trace; residue, Greene's (2 - trace)/4; missed, by how much the orbit misses its
    /// beginning; and inside, whether all points are in the box of the training points, but for a hundredth of its
    /// width, None where no box is known. Outside of it an orbit may be none of the system. Orbits with points within
    /// `apart` count as one; guesses that lead to no orbit are skipped. Raises Error as `predict`.
    #[pyo3(signature = (guesses, period=1, apart=1e-6))]
    fn periodic_orbits<'py>(
        &self,
        py: Python<'py>,
        guesses: Rows<'py>,
        period: usize,
        apart: f64,
    ) -> PyResult<Bound<'py, PyList>> {
        orbits::periodic_orbits_of(py, &self.stored, &guesses, period, apart)
    }

    /// The periodic orbits of exactly `period` steps that begin on the line of symmetry of a reversible map of a plane,
    /// between `low` and `high` on that line: q = 0 for reversor="positions", p = 0 for "momenta", as in `train`. Of a
    /// section (R, Z) that is Z = 0 and R = 0. No guess is needed: the line is looked at in `samples` points.
    /// Dictionaries as of `periodic_orbits`, in the order of their beginnings, in units of the data. That the map is
    /// reversible is not tested. Raises Error where the map has no image anywhere on the line, and of a model of more
    /// than one degree of freedom.
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
        orbits::symmetric_orbits_of(py, &self.stored, line, period)
    }

    /// The island around the elliptic orbit of `period` steps near `guess`, 2 numbers, for a map of a plane, on the ray
    /// from the point `around`, such as the magnetic axis, through the orbit's first point: a dictionary of the
    /// distances from `around` between which orbits stay in it, low and high, their difference width, and the angle
    /// of the ray in radians; None where there is no island, or one beyond `reach`, a share of the distance from
    /// `around`. In units of the data. Raises Error as `predict`, and where the orbit is not elliptic.
    #[pyo3(signature = (guess, period=1, *, around, reach=0.15))]
    fn island<'py>(
        &self,
        py: Python<'py>,
        guess: Rows<'py>,
        period: usize,
        around: Rows<'py>,
        reach: f64,
    ) -> PyResult<Option<Bound<'py, PyDict>>> {
        orbits::island_of(py, &self.stored, &guess, period, &around, reach)
    }

    /// The finite-time Lyapunov exponent of the orbit from `point`, 2n numbers: ln of the growth per step of a small
    /// distance, over `steps` steps, in units of the data. Raises Error as `predict`.
    fn lyapunov_exponent(&self, py: Python<'_>, point: Rows<'_>, steps: usize) -> PyResult<f64> {
        orbits::of_orbit(py, &self.stored, &point, steps, lyapunov_exponent)
    }

    /// The smaller alignment index of the orbit from `point`, 2n numbers, after `steps` steps, in units of the data. It
    /// is 0 up to rounding in chaos, and about 1/steps^2 on an invariant curve of a map of a plane. Raises Error as
    /// `predict`.
    fn alignment_index(&self, py: Python<'_>, point: Rows<'_>, steps: usize) -> PyResult<f64> {
        orbits::of_orbit(py, &self.stored, &point, steps, smaller_alignment_index)
    }

    /// A branch of the unstable or the stable manifold of the periodic orbit of `period` steps near `guess`, for a map
    /// of a plane, in units of the data: points (N, 2), at most `spacing` apart, over a length `length`. The branch
    /// begins at the distance `start` from the orbit, along the eigenvector or, with forward=False, against it. Raises
    /// Error as `predict`, and where there is no orbit that points leave.
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
        let mover = |direction, z: &mut [f64]| self.stored.map_points(direction, z);
        orbits::manifold_of(py, (&self.stored, &mover), &guess, period, stable, branch)
    }

    /// Measures the structure of the network at seeded points, uniform in |z_i| <= radius in its
    /// own units. Raises Error when there are no samples or the radius is not positive.
    #[pyo3(signature = (samples=200, radius=1.6, seed=0))]
    fn verify(
        &self,
        py: Python<'_>,
        samples: usize,
        radius: f64,
        seed: u64,
    ) -> PyResult<PyCertificate> {
        let options = CertificateOptions { samples, radius, seed };
        options.check()?;
        measured(py, || {
            let inner = certify(&self.stored.model, options);
            let fault = own_invariance_fault(&self.stored, &options);
            let on_section = self.stored.section.as_ref().map(Section::note_on_laws);
            Ok(PyCertificate { inner, notes: fault.into_iter().chain(on_section).collect() })
        })
    }

    /// A model with the same weights at another epsilon or flow time, if it has learnt several, or at values of its
    /// controls by name, such as model.at(planar=0.02). A model at values of controls has no controls any more; those
    /// not given are in the middle of their ranges. Its trust, history and held-out error are not known. Warns
    /// (UserWarning) of an epsilon, flow time or control outside of what the model has learnt. Raises Error of
    /// networks without a circle action, for a flow time where that of the model is not known, and of controls that
    /// it does not have.
    #[pyo3(signature = (epsilon=None, flow_time=None, **controls))]
    fn at(
        &self,
        py: Python<'_>,
        epsilon: Option<f64>,
        flow_time: Option<f64>,
        controls: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let values = controls::values_of(&self.stored, controls)?;
        let (mut stored, mut trained) = (self.stored.clone(), self.trained.clone());
        if controls.is_some() {
            let (at, outside) = controls::at_controls(&stored, &values)?;
            outside.map_or(Ok(()), |note| warn(py, &note))?;
            (stored, trained) = (at, None);
        }
        if epsilon.is_some() || flow_time.is_some() {
            trained = None;
        }
        let stored = stored.member(epsilon, flow_time)?;
        stored.beyond_learnt().map_or(Ok(()), |note| warn(py, &note))?;
        Ok(Self { stored, trained })
    }

    /// The controls on which the model depends: a dictionary of the ranges (low, high) that it has learnt. The model is
    /// used in the middle of these ranges, unless `at` sets other values.
    #[getter]
    fn controls<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(py);
        let controls = self.stored.model.architecture().controls.iter();
        for range in controls.flat_map(|controls| &controls.ranges) {
            found.set_item(&range.name, (range.low, range.high))?;
        }
        Ok(found)
    }

    /// The exact derivatives of one step by the controls at `points`, (..., 2n), for these values of the controls, in
    /// units of the data: (..., 2n, controls). Raises Error as `at`, and of points outside of the section.
    #[pyo3(signature = (points, **controls))]
    fn control_derivatives<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
        controls: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let values = controls::checked(py, &self.stored, controls)?;
        controls::derivatives(py, &self.stored, &points, &values)
    }

    /// The periodic orbit near `guess`, 2n numbers, at these values of the controls: a dictionary as in
    /// `periodic_orbits`, with `moved`, (2n, controls), the derivatives of its first point by the controls, and
    /// `trace_by`, (controls,), the derivatives of its trace. Raises Error as `at`, and where there is no orbit.
    #[pyo3(signature = (guess, period=1, **controls))]
    fn orbit_response<'py>(
        &self,
        py: Python<'py>,
        guess: Rows<'py>,
        period: usize,
        controls: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let values = controls::checked(py, &self.stored, controls)?;
        controls::orbit_response(py, &self.stored, &guess, period, &values)
    }

    /// The rotation of the orbit from `start` about `centre`, two numbers each, for a map of a plane at these values of
    /// the controls: (turns, derivatives). The turns are per step, averaged over `steps` steps; their derivatives by
    /// the controls are (controls,). Raises Error as `at`, and of an orbit that leaves the finite numbers.
    #[pyo3(signature = (start, centre, steps=1000, **controls))]
    fn rotation_response<'py>(
        &self,
        py: Python<'py>,
        start: [f64; 2],
        centre: [f64; 2],
        steps: usize,
        controls: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<(f64, Bound<'py, PyArray1<f64>>)> {
        let values = controls::checked(py, &self.stored, controls)?;
        for (name, point) in [("start", start), ("centre", centre)] {
            point.iter().try_for_each(|v| Error::check_finite(name, *v))?;
        }
        Error::check_count_range("steps", steps, 4, usize::MAX)?;
        let of = || self.stored.rotation_response(&values, start, centre, steps);
        let (turns, changes) = measured(py, of)?;
        Ok((turns, PyArray1::from_vec(py, changes)))
    }

    /// Writes the model file, which the program and `load` read. Raises Error when there is a file of that
    /// name, unless `overwrite`, or it cannot be written.
    #[pyo3(signature = (path, overwrite=false))]
    fn save(&self, path: PathBuf, overwrite: bool) -> PyResult<()> {
        if path.exists() && !overwrite {
            return Err(Error::FileExists { path }.into());
        }
        Ok(save_model(&path, &self.stored)?)
    }

    /// Plots orbits of `steps` steps from `points`, (..., 2n), as dots in the plane (q, p) with the number `plane`,
    /// from 1 on, on the axes `ax` of matplotlib, or on those of the current figure. Returns the axes. Raises Error as
    /// `predict`, and ImportError where there is no matplotlib.
    #[pyo3(signature = (points, steps=1000, plane=1, ax=None))]
    fn plot_portrait<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
        steps: usize,
        plane: usize,
        ax: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        Error::check_count_range("steps", steps, 1, usize::MAX)?;
        Error::check_count_range("plane", plane, 1, self.dof())?;
        let ax = match ax {
            Some(ax) => ax,
            None => py.import("matplotlib.pyplot")?.call_method0("gca")?,
        };
        let points = self.points(&points)?;
        let (initial, dim) = (&points.values, 2 * self.dof());
        let request = Rollout { steps, every: 1 };
        let along = Course::default();
        let states = interruptible(py, |pace| {
            self.stored.rollout_until_lost(along, initial, request, pace)
        })?
        .states;
        let style = PyDict::new(py);
        style.set_item("markersize", 1)?;
        for orbit in 0..initial.len() / dim {
            let of = |column: usize| -> Vec<f64> {
                let begin = orbit * dim + column;
                states.iter().skip(begin).step_by(initial.len()).copied().collect()
            };
            let (q, p) = (of(plane - 1), of(self.dof() + plane - 1));
            ax.call_method("plot", (q, p, "."), Some(&style))?;
        }
        let names = match self.stored.section {
            None => [format!("$q_{{{plane}}}$"), format!("$p_{{{plane}}}$")],
            Some(_) => [format!("$x_{{{plane}}}$"), format!("$y_{{{plane}}}$")],
        };
        ax.call_method1("set_xlabel", (&names[0],))?;
        ax.call_method1("set_ylabel", (&names[1],))?;
        Ok(ax)
    }

    /// The map as source code, {file name: text}, in "c" (with a header and an interface for Fortran), "jax" or
    /// "torch". It has functions for the map, its inverse, its iterates and its invariant, in units of the data. In C,
    /// where their names begin with `name`, there are also the derivative and a test whether a point is inside the
    /// boxes. Raises Error when `name` is no name, or the model depends on controls: `at` takes their values, and
    /// another ε or flow time.
    #[pyo3(signature = (language, name="model"))]
    fn source_code<'py>(
        &self,
        py: Python<'py>,
        language: &str,
        name: &str,
    ) -> PyResult<Bound<'py, PyDict>> {
        let found = SourceLanguage::ALL.into_iter().find(|known| known.name() == language);
        let found = found.ok_or_else(|| {
            let names = SourceLanguage::ALL.map(SourceLanguage::name);
            Error::invalid("language", language, names.join(", "))
        })?;
        let code = SourceCode::generate(&self.stored, found, name, None)?;
        let out = PyDict::new(py);
        for (ending, text) in code.files {
            out.set_item(format!("{name}.{ending}"), text)?;
        }
        Ok(out)
    }

    /// The map as a function of JAX arrays (..., 2n), which can be differentiated and compiled. Its values are the same
    /// to rounding if JAX computes in double precision (a UserWarning says if not). Its attributes `inverse`, `iterate`
    /// (of points and a number of steps) and, where there is one, `invariant` are functions too. Raises Error as
    /// `source_code`, and ImportError where there is no JAX.
    fn to_jax<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let out = self.function_of(py, SourceLanguage::Jax)?;
        let config = py.import("jax")?.getattr("config")?;
        if !config.getattr("jax_enable_x64")?.is_truthy()? {
            warn(
                py,
                "JAX computes in single precision: jax.config.update(\"jax_enable_x64\", True) before it makes arrays",
            )?;
        }
        Ok(out)
    }

    /// The map as a function of PyTorch tensors (..., 2n), which can be differentiated; see `to_jax`. Raises Error as
    /// `source_code`, and ImportError where there is no PyTorch.
    fn to_torch<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.function_of(py, SourceLanguage::Torch)
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.architecture() == other.architecture()
            && self.stored.units.is_some() == other.stored.units.is_some()
            && self.stored.section == other.stored.section
            && self.bits().eq(other.bits())
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.bits().for_each(|bits| bits.hash(&mut hasher));
        hasher.finish()
    }

    fn __copy__(&self) -> Self {
        Self { stored: self.stored.clone(), trained: self.trained.clone() }
    }

    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.__copy__()
    }

    /// What makes it again: the text of its file, and what the file does not hold.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Pickled)> {
        let restore = py.import("gyroceptron._native")?.getattr("_restore")?;
        let trained = self.trained.as_ref().map(|trained| trained.parts());
        Ok((restore, (model_text(&self.stored)?, trained)))
    }

    fn __repr__(&self) -> String {
        let count = self.stored.model.composition().parameters().len();
        let plural = if self.dof() == 1 { "" } else { "s" };
        format!("<{}: {count} parameters, {} degree{plural} of freedom>", self.kind(), self.dof())
    }

    /// What it is as a table, in a notebook.
    fn _repr_html_(&self) -> PyResult<String> {
        let count = self.stored.model.composition().parameters().len();
        let mut facts = vec![
            ("parameters", count.to_string()),
            ("degrees of freedom", self.dof().to_string()),
            ("ε", self.epsilon().to_string()),
        ];
        facts.extend(self.flow_time().map(|time| ("flow time", time.to_string())));
        if let Some(controls) = &self.architecture().controls {
            let names: Vec<&str> = controls.ranges.iter().map(|range| &*range.name).collect();
            facts.push(("controls", names.join(", ")));
        }
        let held_out = self.validation();
        facts.extend(held_out.map(|error| ("held-out mean squared error", format!("{error:.3e}"))));
        if let Some(trained) = &self.trained {
            facts.push(("trust", trained.trust.verdict.to_string()));
            facts.extend(trained.trust.reasons.iter().map(|reason| ("", reason.clone())));
        }
        facts.push(("digest", self.stored.digest()?));
        Ok(render::html_facts(self.kind(), facts))
    }
}

/// The text of a model file, and what it does not hold.
type Pickled = (String, Option<TrainedParts>);

/// Reads a model file, as `Model.save` or the program writes it. Raises Error when it is missing,
/// corrupt, or of a newer format.
#[pyfunction]
pub(super) fn load(py: Python<'_>, path: PathBuf) -> PyResult<Model> {
    Ok(Model { stored: py.detach(|| load_model(&path))?, trained: None })
}

/// A model from its pickled parts.
#[pyfunction]
pub(super) fn _restore(text: &str, trained: Option<TrainedParts>) -> PyResult<Model> {
    let stored = parse_model("pickled model", text.as_bytes())?;
    Ok(Model { stored, trained: trained.map(Trained::from_parts).map(Arc::new) })
}
