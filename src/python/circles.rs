//! The circle action, as it is given in Python.

use crate::error::Error;
use crate::layer::{CircleAction, TorusAction};
use pyo3::prelude::*;
use pyo3::types::PyString;

/// What it is called in errors.
const NAME: &str = "circle_action";
/// The circle action that is found.
const AUTO: &str = "auto";

/// One weight, those of one circle or of several, or "auto".
pub(super) enum Circles {
    Auto,
    Weights(Vec<Vec<i32>>),
}

/// A real number, if it is one.
fn number(given: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
    if given.is_instance_of::<PyString>() || given.hasattr("__len__")? && given.len().is_ok() {
        return Ok(None);
    }
    // NumPy would drop an imaginary part.
    if let Ok(imaginary) = given.getattr("imag").and_then(|part| part.extract::<f64>())
        && imaginary != 0.0
    {
        return Err(not_whole(given)?);
    }
    match given.extract::<f64>() {
        Ok(number) => Ok(Some(number)),
        Err(_) if given.try_iter().is_ok() => Ok(None),
        Err(_) => Err(not_whole(given)?),
    }
}

fn not_whole(given: &Bound<'_, PyAny>) -> PyResult<PyErr> {
    let found = given.str()?.to_string();
    Ok(Error::invalid(NAME, found, "whole numbers as weights").into())
}

fn weight(given: &Bound<'_, PyAny>) -> PyResult<i32> {
    let Some(number) = number(given)? else { return Err(not_whole(given)?) };
    let range = f64::from(i32::MIN)..=f64::from(i32::MAX);
    if number.fract() != 0.0 || !range.contains(&number) {
        return Err(not_whole(given)?);
    }
    Ok(number as i32)
}

/// The items of a sequence.
fn items<'py>(given: &Bound<'py, PyAny>) -> PyResult<Vec<Bound<'py, PyAny>>> {
    match given.try_iter() {
        Ok(items) => items.collect(),
        Err(_) => Err(not_whole(given)?),
    }
}

impl<'py> FromPyObject<'_, 'py> for Circles {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let given = &given.to_owned();
        if let Ok(text) = given.cast::<PyString>() {
            let text = text.to_string();
            if text == AUTO {
                return Ok(Self::Auto);
            }
            return Err(Error::invalid(NAME, text, "weights, or \"auto\"").into());
        }
        if number(given)?.is_some() {
            return Ok(Self::Weights(vec![vec![weight(given)?]]));
        }
        let all = items(given)?;
        let mut several = true;
        for item in &all {
            several &= number(item)?.is_none();
        }
        if !several || all.is_empty() {
            return Ok(Self::Weights(vec![all.iter().map(weight).collect::<PyResult<_>>()?]));
        }
        let circle = |circle: &Bound<'_, PyAny>| items(circle)?.iter().map(weight).collect();
        Ok(Self::Weights(all.iter().map(circle).collect::<PyResult<_>>()?))
    }
}

impl Circles {
    /// The action; None where it is to be found from the pairs.
    pub(super) fn given(self) -> Result<Option<TorusAction>, Error> {
        let Self::Weights(circles) = self else { return Ok(None) };
        let circles: Vec<_> = circles.into_iter().map(CircleAction::new).collect();
        TorusAction::new(circles).map(Some).map_err(|e| e.with_place(NAME))
    }
}
