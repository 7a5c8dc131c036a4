//! What a model keeps of the training that made it, beside what its file holds.

use crate::error::Error;
use crate::train::{Fitted, Trust};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use std::ffi::CString;

/// Iteration, loss and held-out error.
type Record = (u64, f64, Option<f64>);

/// The verdict on a model, the records of its training and the notes on its pairs.
#[derive(Clone)]
pub(super) struct Trained {
    pub(super) trust: Trust,
    pub(super) history: Vec<Record>,
    pub(super) notes: Vec<String>,
}

/// What is pickled.
pub(super) type TrainedParts = (String, Vec<String>, Vec<Record>, Vec<String>);

impl Trained {
    pub(super) fn of(fitted: &Fitted, notes: Vec<String>) -> Result<Self, Error> {
        let record = |r: &crate::train::TrainingRecord| (r.iteration, r.loss, r.validation);
        Ok(Self {
            trust: fitted.judgement()?.trust(),
            history: fitted.outcome().history.iter().map(record).collect(),
            notes,
        })
    }

    pub(super) fn parts(&self) -> TrainedParts {
        let Self { trust, history, notes } = self.clone();
        (trust.verdict, trust.reasons, history, notes)
    }

    pub(super) fn from_parts((verdict, reasons, history, notes): TrainedParts) -> Self {
        Self { trust: Trust { verdict, reasons }, history, notes }
    }
}

/// A UserWarning.
pub(super) fn warn(py: Python<'_>, text: &str) -> PyResult<()> {
    let message = CString::new(text)?;
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &message, 1)
}
