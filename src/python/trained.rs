//! What a model keeps of the training that made it, beside what its file holds.

use crate::error::Error;
use crate::scene::NextStep;
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
    /// The call to try next.
    pub(super) next: String,
    pub(super) history: Vec<Record>,
    pub(super) notes: Vec<String>,
}

/// The parts of a pickled `Trained`: verdict, error, reasons, next call, history and notes.
pub(super) type TrainedParts = (String, String, Vec<String>, String, Vec<Record>, Vec<String>);

impl Trained {
    pub(super) fn of(
        fitted: &Fitted,
        notes: Vec<String>,
        next: impl Fn(NextStep) -> String,
    ) -> Result<Self, Error> {
        let record = |r: &crate::train::TrainingRecord| (r.iteration, r.loss, r.validation);
        let judgement = fitted.judgement()?;
        Ok(Self {
            trust: judgement.trust(),
            next: next(NextStep::after(fitted, &judgement)),
            history: fitted.outcome().history.iter().map(record).collect(),
            notes,
        })
    }

    pub(super) fn parts(&self) -> TrainedParts {
        let Self { trust, next, history, notes } = self.clone();
        (trust.verdict, trust.error, trust.reasons, next, history, notes)
    }

    pub(super) fn from_parts(
        (verdict, error, reasons, next, history, notes): TrainedParts,
    ) -> Self {
        Self { trust: Trust { verdict, error, reasons }, next, history, notes }
    }
}

/// Issues a `UserWarning` of Python with this text.
pub(super) fn warn(py: Python<'_>, text: &str) -> PyResult<()> {
    let message = CString::new(text)?;
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &message, 1)
}
