//! Arrays from Python, with their shapes, and refusals of what no real number stands for.

use super::exception;
use crate::error::Error;
use numpy::{IntoPyArray, PyArrayMethods};
use numpy::{PyArrayDyn, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyInt, PyList, PyTuple};

/// An array, or what NumPy makes one of. It is read where its name is known.
pub(super) struct Rows<'py>(Bound<'py, PyAny>);

impl<'py> FromPyObject<'_, 'py> for Rows<'py> {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        Ok(Self(given.to_owned()))
    }
}

/// An array of points of 2n numbers each, with any leading dimensions.
pub(super) struct Points {
    /// The numbers of all points, one point after another.
    pub(super) values: Vec<f64>,
    /// The dimensions before the last: none of one point alone.
    pub(super) leading: Vec<usize>,
}

impl Points {
    /// The leading dimensions, with others before and after them.
    pub(super) fn shape(&self, before: &[usize], after: &[usize]) -> Vec<usize> {
        [before, &self.leading, after].concat()
    }
}

/// An array of this shape.
pub(super) fn array<'py>(
    py: Python<'py>,
    values: Vec<f64>,
    shape: Vec<usize>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    values.into_pyarray(py).reshape(shape)
}

/// Whether it is a masked array, or a list of lists with one: NumPy would drop the mask.
fn is_masked(given: &Bound<'_, PyAny>, masked: &Bound<'_, PyAny>, depth: usize) -> PyResult<bool> {
    /// NumPy has no more dimensions.
    const DEEPEST: usize = 64;
    if given.is_exact_instance_of::<PyFloat>() || given.is_exact_instance_of::<PyInt>() {
        return Ok(false);
    }
    if given.is_instance(masked)? {
        return Ok(true);
    }
    if depth == DEEPEST {
        return Ok(false);
    }
    if let Ok(list) = given.cast::<PyList>() {
        for item in list {
            if is_masked(&item, masked, depth + 1)? {
                return Ok(true);
            }
        }
    } else if let Ok(tuple) = given.cast::<PyTuple>() {
        for item in tuple {
            if is_masked(&item, masked, depth + 1)? {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

/// The numbers of an array and its shape.
pub(super) fn read(name: &str, rows: &Rows<'_>) -> PyResult<(Vec<f64>, Vec<usize>)> {
    let given = &rows.0;
    let numpy = given.py().import("numpy")?;
    let masked = numpy.getattr("ma")?.getattr("MaskedArray")?;
    if is_masked(given, &masked, 0)? {
        let expected = "an array without a mask (such as array.compressed() or array.filled())";
        return Err(Error::invalid(name, "a masked array", expected).into());
    }
    let array = numpy.call_method1("asarray", (given,)).map_err(|reason| {
        let py = given.py();
        if reason.is_instance_of::<PyValueError>(py) || reason.is_instance_of::<PyTypeError>(py) {
            return Error::invalid(name, reason.value(py), "an array of real numbers").into();
        }
        reason
    })?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if !["b", "i", "u", "f"].contains(&&*kind) {
        let found = format!("an array of dtype {}", array.getattr("dtype")?.str()?);
        return Err(Error::invalid(name, found, "real numbers").into());
    }
    let array = numpy.call_method1("require", (array, "float64", ["C", "A"]))?;
    let array: PyReadonlyArrayDyn<'_, f64> = array.extract()?;
    let values =
        array.as_slice().map_err(|reason| exception::Error::new_err(reason.to_string()))?;
    Ok((values.to_vec(), array.shape().to_vec()))
}

/// The numbers of an array of one dimension.
pub(super) fn numbers_of(name: &str, rows: &Rows<'_>) -> PyResult<Vec<f64>> {
    let (values, shape) = read(name, rows)?;
    match shape[..] {
        [_] => Ok(values),
        _ => {
            let found = format!("an array of shape {shape:?}");
            Err(Error::invalid(name, found, "an array of one dimension").into())
        }
    }
}

/// The points of an array of shape (…, 2n).
pub(super) fn points_of(name: &str, rows: &Rows<'_>, dof: usize) -> PyResult<Points> {
    points_of_width(name, rows, 2 * dof)
}

/// The points of an array of shape (…, width).
pub(super) fn points_of_width(name: &str, rows: &Rows<'_>, width: usize) -> PyResult<Points> {
    let (values, mut leading) = read(name, rows)?;
    let Some(columns) = leading.pop() else {
        let expected = format!("an array whose last dimension is {width}");
        return Err(Error::invalid(name, "a number alone", expected).into());
    };
    Error::check_count(&format!("{name}: columns"), width, columns)?;
    let count = values.len() / columns;
    Error::check_count_range(&format!("{name}: rows"), count, 1, usize::MAX)?;
    crate::flow::check_finite(name, &values, columns)?;
    Ok(Points { values, leading })
}

/// One point of 2n numbers.
pub(super) fn point_of(name: &str, point: &Rows<'_>, dof: usize) -> PyResult<Vec<f64>> {
    let point = points_of(name, point, dof)?;
    if !point.leading.is_empty() {
        let found = format!("an array of {} dimensions", point.leading.len() + 1);
        return Err(Error::invalid(name, found, "one point of 2n numbers").into());
    }
    Ok(point.values)
}

/// The numbers of an array of shape (N, 2n), row by row.
pub(super) fn rows_of(name: &str, rows: &Rows<'_>, dof: usize) -> PyResult<Vec<f64>> {
    let points = points_of(name, rows, dof)?;
    if points.leading.len() != 1 {
        let found = format!("an array of {} dimensions", points.leading.len() + 1);
        return Err(Error::invalid(name, found, "an array of shape (N, 2n)").into());
    }
    Ok(points.values)
}

/// n of an array of shape (N, 2n).
pub(super) fn dof_of(name: &str, rows: &Rows<'_>) -> PyResult<usize> {
    let (_, shape) = read(name, rows)?;
    match shape[..] {
        [_, columns] if columns > 0 && columns.is_multiple_of(2) => Ok(columns / 2),
        _ => {
            let found = format!("an array of shape {shape:?}");
            Err(Error::invalid(name, found, "an array of shape (N, 2n)").into())
        }
    }
}
