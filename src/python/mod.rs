//! Python: models, their use and their training. Glue only.

mod training;

use crate::error::Error;
use crate::flow::Region;
use crate::io::{StoredModel, load_model, save_model};
use crate::measure::{CertificateOptions, certify};
use crate::network::{Architecture, Rollout};
use crate::phase::Direction;
use numpy::{
    AllowTypeChange, IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayLike2, PyArrayMethods,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use rayon::prelude::*;
use std::path::PathBuf;

/// The exception, by the name that it has in Python.
mod exception {
    pyo3::create_exception!(
        gyroceptron,
        Error,
        pyo3::exceptions::PyValueError,
        "What can go wrong: the message has the values that explain it."
    );
}

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        exception::Error::new_err(error.to_string())
    }
}

/// An array of two dimensions, or what NumPy makes one of.
type Rows<'py> = PyArrayLike2<'py, f64, AllowTypeChange>;

/// The numbers of rows of 2n, row by row.
fn rows_of(name: &str, rows: &Rows<'_>, dof: usize) -> Result<Vec<f64>, Error> {
    let [count, columns] = [rows.shape()[0], rows.shape()[1]];
    Error::check_count(&format!("{name}: columns"), 2 * dof, columns)?;
    Error::check_count_range(&format!("{name}: rows"), count, 1, usize::MAX)?;
    let values: Vec<f64> = rows.as_array().iter().copied().collect();
    crate::flow::check_finite(name, &values, columns)?;
    Ok(values)
}

/// The measured structure of a model: of each law the largest ratio of an error to its rounding
/// bound.
#[pyclass(frozen, module = "gyroceptron", name = "Certificate")]
struct PyCertificate {
    inner: crate::measure::Certificate,
}

#[pymethods]
impl PyCertificate {
    /// No law is violated or vacuous.
    #[getter]
    fn holds(&self) -> bool {
        self.inner.holds()
    }

    /// One line: how many laws hold, by what headroom, or which do not.
    #[getter]
    fn summary(&self) -> String {
        self.inner.summary()
    }

    /// A dictionary for each law, as `gyroceptron verify --json` has them.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = serde_json::to_string(&self.inner.rows)
            .map_err(|reason| exception::Error::new_err(reason.to_string()))?;
        py.import("json")?.call_method1("loads", (text,))
    }

    fn __str__(&self) -> String {
        self.inner.to_string()
    }

    fn __repr__(&self) -> String {
        format!("<Certificate: {}>", self.inner.summary())
    }
}

/// A network with the units and the box of its training points.
#[pyclass(frozen, module = "gyroceptron")]
struct Model {
    stored: StoredModel,
}

impl Model {
    fn architecture(&self) -> Architecture {
        self.stored.model.architecture()
    }

    fn rows(&self, name: &str, points: &Rows<'_>) -> Result<Vec<f64>, Error> {
        rows_of(name, points, self.stored.model.composition().dof())
    }
}

#[pymethods]
impl Model {
    /// "gyroceptron", "normal-form", "coupling-gyroceptron", "henon-net" or "sympnet".
    #[getter]
    fn kind(&self) -> &'static str {
        match self.architecture() {
            Architecture::Gyroceptron { .. } => "gyroceptron",
            Architecture::NormalForm { .. } => "normal-form",
            Architecture::CouplingGyroceptron { .. } => "coupling-gyroceptron",
            Architecture::HenonNet { .. } => "henon-net",
            Architecture::SympNet { .. } => "sympnet",
        }
    }

    /// The degrees of freedom n: points have 2n numbers.
    #[getter]
    fn dof(&self) -> usize {
        self.stored.model.composition().dof()
    }

    /// ε of its near-identity part.
    #[getter]
    fn epsilon(&self) -> f64 {
        self.architecture().epsilon()
    }

    /// The time of the flow map that it stands for, where it is known.
    #[getter]
    fn flow_time(&self) -> Option<f64> {
        self.stored.provenance.flow_time
    }

    /// The angles of its circles, in radians.
    #[getter]
    fn angles(&self) -> Vec<f64> {
        self.stored.model.angles().to_vec()
    }

    /// All parameters, in the order of its file.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.stored.model.composition().parameters())
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

    /// (centre, factors) of the units of its data, where they are not its own: points are
    /// centre + factors * w of the w that the network acts on.
    #[getter]
    fn units(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let units = self.stored.units.as_ref();
        units.map(|units| (units.centre().to_vec(), units.factors().to_vec()))
    }

    /// Trajectories from the rows of `points`, (M, 2n): an array (steps // every + 1, M, 2n), the
    /// points themselves first. `outside` says what to do when one leaves the box of the
    /// training points by more than a hundredth of its width: "warn", "stop" (an Error) or "ignore".
    #[pyo3(signature = (points, steps=1, every=1, outside="warn"))]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
        steps: usize,
        every: usize,
        outside: &str,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        Error::check_count_range("steps", steps, 1, usize::MAX)?;
        Error::check_count_range("every", every, 1, steps)?;
        if !["warn", "stop", "ignore"].contains(&outside) {
            return Err(Error::invalid("outside", outside, "warn, stop or ignore").into());
        }
        if outside == "stop" && self.stored.provenance.region.is_none() {
            let expected = "a model that knows the box of its training points";
            return Err(Error::invalid("outside", outside, expected).into());
        }
        let initial = self.rows("points", &points)?;
        let request = Rollout { steps, every };
        let states = py.detach(|| self.stored.rollout(&initial, request))?;
        let (dim, region) = (2 * self.dof(), self.stored.provenance.region.as_ref());
        let count = initial.len() / dim;
        if let (Some(region), true) = (region, outside != "ignore")
            && let Some(left) = region.left_by(&states, count, every)
        {
            let told = left.told(region);
            if outside == "stop" {
                return Err(exception::Error::new_err(told));
            }
            let message = std::ffi::CString::new(told)?;
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &message, 1)?;
        }
        states.into_pyarray(py).reshape([request.kept(), count, dim])
    }

    /// The points that go to the rows of `points` in one step, (M, 2n).
    fn inverse<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let mut values = self.rows("points", &points)?;
        py.detach(|| self.stored.map_points(Direction::Inverse, &mut values))?;
        let dim = 2 * self.dof();
        let count = values.len() / dim;
        values.into_pyarray(py).reshape([count, dim])
    }

    /// The derivatives of one step at the rows of `points`, by the chain rule: (M, 2n, 2n),
    /// [m, i, k] that of coordinate i by coordinate k.
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let values = self.rows("points", &points)?;
        let jacobians = py.detach(|| self.stored.jacobians(&values))?;
        let dim = 2 * self.dof();
        jacobians.into_pyarray(py).reshape([values.len() / dim, dim, dim])
    }

    /// The invariant of the network at the rows of `points`, (M,): that which is adiabatic of a
    /// gyroceptron, the sum of the actions of one in normal form.
    fn invariant<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let values = self.rows("points", &points)?;
        let Some(invariant) = self.stored.invariant() else {
            let expected = "a symplectic gyroceptron, which has an invariant";
            return Err(Error::invalid("invariant", self.kind(), expected).into());
        };
        let dim = 2 * self.dof();
        let along: Vec<f64> = py.detach(|| values.par_chunks_exact(dim).map(&invariant).collect());
        Ok(along.into_pyarray(py))
    }

    /// Measures the structure of the network at seeded points, uniform in |z_i| <= radius in its
    /// own units.
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
        Ok(PyCertificate { inner: py.detach(|| certify(&self.stored.model, options)) })
    }

    /// The same weights at another epsilon or flow time, of a model that has learnt several.
    #[pyo3(signature = (epsilon=None, flow_time=None))]
    fn at(&self, epsilon: Option<f64>, flow_time: Option<f64>) -> PyResult<Self> {
        Ok(Self { stored: self.stored.clone().member(epsilon, flow_time)? })
    }

    /// Writes the model file, which the program and `load` read.
    #[pyo3(signature = (path, overwrite=false))]
    fn save(&self, path: PathBuf, overwrite: bool) -> PyResult<()> {
        if path.exists() && !overwrite {
            return Err(Error::FileExists { path }.into());
        }
        Ok(save_model(&path, &self.stored)?)
    }

    fn __repr__(&self) -> String {
        let count = self.stored.model.composition().parameters().len();
        let plural = if self.dof() == 1 { "" } else { "s" };
        format!("<{}: {count} parameters, {} degree{plural} of freedom>", self.kind(), self.dof())
    }
}

/// Reads a model file.
#[pyfunction]
fn load(py: Python<'_>, path: PathBuf) -> PyResult<Model> {
    Ok(Model { stored: py.detach(|| load_model(&path))? })
}

/// The module `gyroceptron._native`.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::training::train;
    #[pymodule_export]
    use super::{Model, PyCertificate, load};
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("Error", module.py().get_type::<super::exception::Error>())?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
