//! Controls, in Python.

use super::arrays::{Rows, array, point_of, points_of};
use super::interrupt::{by_parts, stoppable};
use super::orbits::until_stopped;
use crate::error::Error;
use crate::io::StoredModel;
use crate::measure::orbits::periodic_orbit;
use crate::network::Controls;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The names of the columns of a dictionary of arrays (N,), and their numbers, row by row.
pub(super) fn columns_of(
    of: &Bound<'_, PyDict>,
    count: usize,
) -> PyResult<(Vec<String>, Vec<f64>)> {
    let (mut names, mut columns) = (Vec::new(), Vec::new());
    for (name, values) in of {
        let name: String = name.extract()?;
        let rows: Rows<'_> = values.extract()?;
        let place = format!("controls[{name:?}]");
        let (values, shape) = super::arrays::read(&place, &rows)?;
        if shape.len() != 1 {
            let found = format!("an array of shape {shape:?}");
            return Err(Error::invalid(&place, found, "an array of shape (N,)").into());
        }
        Error::check_count(&place, count, values.len())?;
        crate::flow::check_finite(&place, &values, 1)?;
        names.push(name);
        columns.push(values);
    }
    Error::check_count_range("controls", names.len(), 1, Controls::MOST)?;
    let rows = (0..count).flat_map(|row| columns.iter().map(move |column| column[row]));
    Ok((names, rows.collect()))
}

/// The values that keywords give, the others in the middle of their ranges.
pub(super) fn values_of(
    stored: &StoredModel,
    given: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<f64>> {
    let mut pairs: Vec<(String, f64)> = Vec::new();
    for (name, value) in given.into_iter().flatten() {
        pairs.push((name.extract()?, value.extract()?));
    }
    let Some(controls) = &stored.model.architecture().controls else {
        return match pairs.first() {
            None => Ok(Vec::new()),
            Some((name, _)) => {
                let expected = "none: the model depends on no controls";
                Err(Error::invalid("control", name, expected).into())
            }
        };
    };
    Ok(controls.values(pairs.iter().map(|(name, value)| (&**name, *value)))?)
}

/// The model at these values, with a note where one is outside of its range.
pub(super) fn at_controls(
    stored: &StoredModel,
    values: &[f64],
) -> PyResult<(StoredModel, Option<String>)> {
    let at = stored.at_controls(values)?;
    if let Some(section) = &at.section {
        section.check(section.dof())?;
    }
    let controls = stored.model.architecture().controls.as_ref();
    let outside = controls.and_then(|controls| controls.first_outside(values));
    let note = outside.map(|(range, value)| range.outside(value));
    Ok((at, note))
}

/// [`values_of`] keywords, at which the section has a chart; with a warning where one is outside of its range.
pub(super) fn checked(
    py: Python<'_>,
    stored: &StoredModel,
    given: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<f64>> {
    let values = values_of(stored, given)?;
    let (_, outside) = at_controls(stored, &values)?;
    outside.map_or(Ok(()), |note| super::trained::warn(py, &note))?;
    Ok(values)
}

/// The derivatives of a step by the controls, as `Model.control_derivatives` returns them.
pub(super) fn derivatives<'py>(
    py: Python<'py>,
    stored: &StoredModel,
    points: &Rows<'_>,
    values: &[f64],
) -> PyResult<Bound<'py, numpy::PyArrayDyn<f64>>> {
    let dof = stored.model.composition().dof();
    let points = points_of("points", points, dof)?;
    let found = by_parts(py, "derivatives", 2 * dof, &points.values, |part| {
        stored.control_derivatives(values, part)
    })?;
    array(py, found, points.shape(&[], &[2 * dof, values.len()]))
}

/// A periodic orbit and its derivatives by the controls, as `Model.orbit_response` returns them.
pub(super) fn orbit_response<'py>(
    py: Python<'py>,
    stored: &StoredModel,
    guess: &Rows<'_>,
    period: usize,
    values: &[f64],
) -> PyResult<Bound<'py, PyDict>> {
    let dof = stored.model.composition().dof();
    let guess = point_of("guess", guess, dof)?;
    let (orbit, response) = stoppable(py, |stop| {
        let at = stored.at_controls(values)?;
        let orbit = periodic_orbit(&until_stopped(&at, stop), &guess, period)?.of_period(period)?;
        let response = stored.orbit_response(values, &orbit)?;
        Ok::<_, Error>((orbit, response))
    })?;
    let found = super::orbits::as_dict(py, orbit, stored.provenance.region.as_ref())?;
    found.set_item("moved", array(py, response.moved, vec![2 * dof, values.len()])?)?;
    found.set_item("trace_by", array(py, response.traces, vec![values.len()])?)?;
    Ok(found)
}
