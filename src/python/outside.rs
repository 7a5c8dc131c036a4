//! Orbits that leave a box, in Python.

use super::arrays::Points;
use super::exception;
use super::orbits::{OrbitMap, following};
use super::trained::warn;
use crate::error::Error;
use crate::flow::Region;
use crate::measure::orbits::maps_survived;
use numpy::{PyArray1, PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;

/// What to do where a trajectory leaves the box that its map is known in.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Outside {
    Warn,
    Stop,
    Ignore,
}

impl Outside {
    /// From its name in Python.
    pub(super) fn of(name: &str) -> Result<Self, Error> {
        match name {
            "warn" => Ok(Self::Warn),
            "stop" => Ok(Self::Stop),
            "ignore" => Ok(Self::Ignore),
            _ => Err(Error::invalid("outside", name, "warn, stop or ignore")),
        }
    }

    /// Warns, or raises Error, of each sentence that is found.
    pub(super) fn report<const N: usize>(
        self,
        py: Python<'_>,
        found: impl FnOnce() -> [Option<String>; N] + Send,
    ) -> PyResult<()> {
        if self == Self::Ignore {
            return Ok(());
        }
        for sentence in py.detach(found).into_iter().flatten() {
            if self == Self::Stop {
                return Err(exception::Error::new_err(sentence));
            }
            warn(py, &sentence)?;
        }
        Ok(())
    }
}

/// The box from `low` to `high`, each of them that of the training points unless given.
pub(super) fn box_of(
    [low, high]: [Option<Vec<f64>>; 2],
    own: Option<&Region>,
    dof: usize,
) -> Result<Region, Error> {
    let unknown = || Error::invalid("survival", "no box", "low and high: the model has none");
    let corner = |given: Option<Vec<f64>>, own: Option<&Vec<f64>>| {
        given.or_else(|| own.cloned()).ok_or_else(unknown)
    };
    let low = corner(low, own.map(|own| &own.low))?;
    let high = corner(high, own.map(|own| &own.high))?;
    for (name, corner) in [("low", &low), ("high", &high)] {
        Error::check_count(name, 2 * dof, corner.len())?;
    }
    let region = Region { low, high };
    region.check("box", dof)?;
    Ok(region)
}

/// After how many steps each orbit is lost, one more than all for those that are not; integers in the shape of the
/// points.
pub(super) fn survived<'py>(
    py: Python<'py>,
    map: &dyn OrbitMap,
    points: &Points,
    steps: usize,
    region: &Region,
) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
    Error::check_count_range("steps", steps, 1, i64::MAX as usize - 1)?;
    let last = |lost: Option<usize>| lost.unwrap_or(steps + 1) as i64;
    let stays = |z: &[f64]| region.first_outside(z).is_none();
    let found = following(py, map, |follow| {
        maps_survived(follow, &points.values, 2 * map.dof(), steps, &stays)
    })?;
    let found: Vec<i64> = found.into_iter().map(last).collect();
    PyArray1::from_vec(py, found).reshape(points.shape(&[], &[]))
}
