//! Certificates.

use super::exception;
use crate::scene::render;
use pyo3::prelude::*;

/// The measured structure of a model: for each law the largest ratio of an error to its rounding
/// scale at the points where it was sampled.
#[pyclass(frozen, module = "gyroceptron", name = "Certificate")]
pub(super) struct PyCertificate {
    pub(super) inner: crate::measure::certificate::Certificate,
    /// On the model, beside the laws.
    pub(super) notes: Vec<String>,
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

    /// Notes beside the laws, such as that the network's own invariant changes much, or drifts.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    fn __str__(&self) -> String {
        self.inner.to_string()
    }

    fn __repr__(&self) -> String {
        format!("<Certificate: {}>", self.inner.summary())
    }

    /// The laws as a table, in a notebook.
    fn _repr_html_(&self) -> String {
        render::html_laws(&self.inner, &self.notes)
    }
}
