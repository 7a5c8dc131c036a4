//! Proofs of circles in Python.

use super::interrupt::stoppable;
use super::model::Model;
use crate::error::Error;
use crate::io::{ProofFile, ProofRequest, Proofs};
use crate::measure::proof::{NobleNumber, Verdict};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

fn of_json<'py>(py: Python<'py>, value: &serde_json::Value) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.getattr("loads")?.call1((value.to_string(),))
}

/// Proves that a model of one degree of freedom has invariant circles, which no orbit crosses.
///
/// `frequencies` are rotation numbers in turns per map, clockwise and without whole turns: "golden", a continued
/// fraction that ends in ones such as "[0; 1, 2, (1)]", or a decimal as text, which stands for the number farthest from
/// fractions that rounds to it. Without them `circles` numbers are chosen, spread over those that the model has.
/// Circles are looked for on the ray from `start` (if None, the fixed point near 0) to `end`, in the coordinates of the
/// normal form. `output` is a file for what is proved, which `check_proof` verifies again.
///
/// Returns a dictionary: "circles", with a dictionary for each number that has its "verdict", "proved" or "not proved",
/// and the reason; "statements", what follows in words; and "fixed_point". The proof is about the map of real numbers
/// with these weights, not about rounded roll-outs. Raises Error of a model that the theorem is not about, of rational
/// numbers, and of an existing output.
#[pyfunction]
#[pyo3(signature = (model, frequencies=None, *, circles=8, start=None, end=[1.0, 0.0], output=None, overwrite=false))]
#[allow(clippy::too_many_arguments, reason = "keywords of Python")]
pub(super) fn prove<'py>(
    py: Python<'py>,
    model: &Model,
    frequencies: Option<Vec<String>>,
    circles: usize,
    start: Option<[f64; 2]>,
    end: [f64; 2],
    output: Option<PathBuf>,
    overwrite: bool,
) -> PyResult<Bound<'py, PyAny>> {
    Error::check_count_range("circles", circles, 1, 1000)?;
    let numbers = frequencies.unwrap_or_default();
    let numbers = numbers.iter().map(|text| text.parse()).collect::<Result<_, Error>>()?;
    if let Some(path) = output.as_ref().filter(|path| path.exists() && !overwrite) {
        return Err(Error::FileExists { path: path.clone() }.into());
    }
    let request = ProofRequest { numbers, circles, from: start, to: end };
    let stored = &model.stored;
    let proofs = stoppable(py, |stop| {
        let found = |_: &NobleNumber, _: &Verdict, file: &ProofFile| match &output {
            Some(path) if !file.circles.is_empty() => file.save(path),
            _ => Ok(()),
        };
        let asked = stop.clone();
        Proofs::of_model_unless_stopped(stored, &request, found, move || asked.go_on())
    })?;
    if let Some(path) = output.filter(|_| !proofs.file.circles.is_empty()) {
        proofs.file.save(&path)?;
    }
    of_json(py, &proofs.document())
}

/// Verifies a file of proofs of a model again, without any search. Returns a dictionary with the number of its
/// "circles" and, in words, what follows from them, "statements". Raises Error where anything does not hold, of another
/// model, and of an edited file.
#[pyfunction]
pub(super) fn check_proof<'py>(
    py: Python<'py>,
    model: &Model,
    path: PathBuf,
) -> PyResult<Bound<'py, PyDict>> {
    let file = stoppable(py, |stop| {
        let file = ProofFile::load(&path)?;
        let asked = stop.clone();
        file.check_unless_stopped(&model.stored, move || asked.go_on())
            .map_err(|error| error.with_place(path.display()))?;
        Ok(file)
    })?;
    let out = PyDict::new(py);
    out.set_item("circles", file.circles.len())?;
    out.set_item("statements", file.statements())?;
    Ok(out)
}
