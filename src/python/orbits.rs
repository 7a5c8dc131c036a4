//! Properties of the orbits of a map, in Python.

use super::arrays::{Rows, array, point_of, points_of, read, rows_of};
use super::interrupt::{Stop, by_parts, interruptible, measured, stoppable};
use crate::error::Error;
use crate::flow::{Region, Trajectories};
use crate::io::{StoredModel, read_section};
use crate::layer::Reversor;
use crate::measure::orbits::{
    Branch, Follow, InvariantCircle, IslandSearch, PeriodicOrbit, SymmetryLine, WithJacobian,
    dynamic_aperture, manifold, periodic_orbit, periodic_orbits, rotation_numbers,
    spectral_lines as lines_of, symmetric_periodic_orbits, tunes as tunes_of,
};
use crate::network::{Pace, Rollout};
use crate::phase::Direction;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyList};
use std::cell::RefCell;
use std::path::PathBuf;

/// A map whose orbits are asked for, of points in units of the data.
pub(super) trait OrbitMap: Sync {
    fn dof(&self) -> usize;

    /// Whether points are those of a section, whose canonical position is the second of their numbers.
    fn on_section(&self) -> bool;

    /// The box of the pairs that the map is fitted to, where it is of pairs and is known.
    fn region(&self) -> Option<&Region> {
        None
    }

    /// The image of a point, and the Jacobian there.
    fn with_jacobian(&self, z: &[f64]) -> Result<ImageAndJacobian, Error>;

    /// The states of orbits after 1, …, `maps` maps.
    fn followed(&self, points: &[f64], maps: usize, pace: &mut Pace<'_>)
    -> Result<Vec<f64>, Error>;
}

impl OrbitMap for StoredModel {
    fn dof(&self) -> usize {
        self.model.composition().dof()
    }
    fn on_section(&self) -> bool {
        self.section.is_some()
    }
    fn region(&self) -> Option<&Region> {
        self.provenance.region.as_ref()
    }
    fn with_jacobian(&self, z: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let image = self.rollout(z, Rollout { steps: 1, every: 1 })?.split_off(z.len());
        Ok((image, self.jacobians(z)?))
    }
    fn followed(
        &self,
        points: &[f64],
        maps: usize,
        pace: &mut Pace<'_>,
    ) -> Result<Vec<f64>, Error> {
        self.followed_at_pace(points, maps, pace)
    }
}

/// The image of a point, and the Jacobian there, row by row.
type ImageAndJacobian = (Vec<f64>, Vec<f64>);

/// What gives the image of a point with the Jacobian, until it is to stop.
pub(super) fn until_stopped<'a>(
    map: &'a dyn OrbitMap,
    stop: &'a Stop,
) -> impl Fn(&[f64]) -> Result<ImageAndJacobian, Error> + 'a {
    move |z| {
        stop.check()?;
        map.with_jacobian(z)
    }
}

/// What `of` finds by following orbits of a map, until Ctrl-C.
pub(super) fn following<T: Send>(
    py: Python<'_>,
    map: &dyn OrbitMap,
    of: impl FnOnce(Follow<'_>) -> Result<T, Error> + Send,
) -> PyResult<T> {
    stoppable(py, |stop| {
        let mut go_on = || stop.go_on();
        let pace = RefCell::new(Pace::asking(&mut go_on));
        of(&|points: &[f64], maps: usize| map.followed(points, maps, &mut pace.borrow_mut()))
    })
}

pub(super) fn as_dict<'py>(
    py: Python<'py>,
    orbit: PeriodicOrbit,
    region: Option<&Region>,
) -> PyResult<Bound<'py, PyDict>> {
    let (period, dim) = (orbit.period(), orbit.points[0].len());
    let inside = region.map(|region| {
        let around = region.with_margin();
        orbit.points.iter().all(|z| around.first_outside(z).is_none())
    });
    let found = PyDict::new(py);
    found.set_item("trace", orbit.trace())?;
    found.set_item("residue", orbit.residue())?;
    found.set_item("missed", orbit.missed)?;
    found.set_item("inside", inside)?;
    found.set_item("points", array(py, orbit.points.concat(), vec![period, dim])?)?;
    found.set_item("multiplier", array(py, orbit.multiplier_matrix, vec![dim, dim])?)?;
    Ok(found)
}

/// The periodic orbits that are found from guesses, as `Model.periodic_orbits` returns them.
pub(super) fn periodic_orbits_of<'py>(
    py: Python<'py>,
    map: &dyn OrbitMap,
    guesses: &Rows<'_>,
    period: usize,
    apart: f64,
) -> PyResult<Bound<'py, PyList>> {
    let dof = map.dof();
    let guesses = rows_of("guesses", guesses, dof)?;
    let guesses: Vec<Vec<f64>> = guesses.chunks_exact(2 * dof).map(<[f64]>::to_vec).collect();
    let found =
        stoppable(py, |stop| periodic_orbits(&until_stopped(map, stop), &guesses, period, apart))?;
    as_list(py, found, map.region())
}

fn as_list<'py>(
    py: Python<'py>,
    orbits: Vec<PeriodicOrbit>,
    region: Option<&Region>,
) -> PyResult<Bound<'py, PyList>> {
    let all = orbits.into_iter().map(|orbit| as_dict(py, orbit, region));
    PyList::new(py, all.collect::<PyResult<Vec<_>>>()?)
}

/// The periodic orbits that begin on a line of symmetry, as `Model.symmetric_orbits` returns them.
pub(super) fn symmetric_orbits_of<'py>(
    py: Python<'py>,
    map: &dyn OrbitMap,
    line: SymmetryLine,
    period: usize,
) -> PyResult<Bound<'py, PyList>> {
    of_a_plane(map)?;
    let reversor = match (line.reversor, map.on_section()) {
        (Reversor::Positions, true) => Reversor::Momenta,
        (Reversor::Momenta, true) => Reversor::Positions,
        (reversor, false) => reversor,
    };
    let line = SymmetryLine { reversor, ..line };
    let found =
        stoppable(py, |stop| symmetric_periodic_orbits(&until_stopped(map, stop), &line, period))?;
    as_list(py, found, map.region())
}

/// The island around an elliptic periodic orbit, as `Model.island` returns it.
pub(super) fn island_of<'py>(
    py: Python<'py>,
    map: &dyn OrbitMap,
    guess: &Rows<'_>,
    period: usize,
    around: &Rows<'_>,
    reach: f64,
) -> PyResult<Option<Bound<'py, PyDict>>> {
    of_a_plane(map)?;
    let (guess, around) = (point_of("guess", guess, 1)?, point_of("around", around, 1)?);
    let orbit = stoppable(py, |stop| {
        periodic_orbit(&until_stopped(map, stop), &guess, period)?.of_period(period)
    })?;
    let found = following(py, map, |follow| {
        IslandSearch::of_orbit(&orbit, ([around[0], around[1]], reach), follow)
    })?;
    let Some(island) = found else { return Ok(None) };
    let out = PyDict::new(py);
    out.set_item("low", island.interval.low)?;
    out.set_item("high", island.interval.high)?;
    out.set_item("width", island.interval.width())?;
    out.set_item("angle", island.angle)?;
    Ok(Some(out))
}

/// Fails of a map of more than a plane.
fn of_a_plane(map: &dyn OrbitMap) -> Result<(), Error> {
    Error::check_count("coordinates of a plane", 2, 2 * map.dof())
}

/// What is asked of one orbit of a map with its Jacobian.
type OfOrbit = fn(WithJacobian<'_>, &[f64], usize) -> Result<f64, Error>;

/// A quantity of the orbit from one point, for `Model.lyapunov_exponent` and `Model.alignment_index`.
pub(super) fn of_orbit(
    py: Python<'_>,
    map: &dyn OrbitMap,
    point: &Rows<'_>,
    steps: usize,
    of: OfOrbit,
) -> PyResult<f64> {
    let point = point_of("point", point, map.dof())?;
    stoppable(py, |stop| of(&until_stopped(map, stop), &point, steps))
}

/// See `Model.dynamic_aperture`.
pub(super) fn dynamic_aperture_of<'py>(
    py: Python<'py>,
    map: &dyn OrbitMap,
    (centre, directions): (&[f64], &Rows<'_>),
    radii: &[f64],
    steps: usize,
    region: &Region,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let directions = rows_of("directions", directions, map.dof())?;
    let directions: Vec<Vec<f64>> =
        directions.chunks_exact(2 * map.dof()).map(<[f64]>::to_vec).collect();
    let stays = |z: &[f64]| region.first_outside(z).is_none();
    let found = following(py, map, |follow| {
        dynamic_aperture(follow, centre, &directions, radii, steps, &stays)
    })?;
    array(py, found, vec![directions.len()])
}

/// What moves points of the data to their images or preimages.
type Mover<'a> = &'a (dyn Fn(Direction, &mut [f64]) -> Result<(), Error> + Sync);

/// A branch of the manifold of a periodic orbit, as `Model.manifold` returns it.
pub(super) fn manifold_of<'py>(
    py: Python<'py>,
    (map, mover): (&dyn OrbitMap, Mover<'_>),
    guess: &Rows<'_>,
    period: usize,
    stable: bool,
    branch: Branch,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let guess = point_of("point", guess, map.dof())?;
    Error::check_count("guess: numbers", 2, guess.len())?;
    let points = stoppable(py, |stop| {
        let mut orbit =
            periodic_orbit(&until_stopped(map, stop), &guess, period)?.of_period(period)?;
        let direction = if stable { Direction::Inverse } else { Direction::Forward };
        if stable {
            // The inverse goes round the other way, with the inverse of M, whose determinant is 1.
            orbit.points[1..].reverse();
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| orbit.multiplier_matrix[k]);
            orbit.multiplier_matrix = vec![d, -b, -c, a];
        }
        let moved = |z: &mut [f64]| stop.check().and_then(|()| mover(direction, z));
        manifold(&moved, &orbit, branch)
    })?;
    let count = points.len() / 2;
    array(py, points, vec![count, 2])
}

/// A tuple of two NumPy arrays.
type TwoArrays<'py> = (Bound<'py, PyArrayDyn<f64>>, Bound<'py, PyArrayDyn<f64>>);

/// The tunes of orbits, (T, 2n) or (T, M, 2n) with T states each, in every plane: (turns, changes), both (n,) or (M,
/// n). Turns are per step, from p towards q, between -1/2 and 1/2, by windowed frequency analysis. Changes are the
/// differences between the turns of the two halves of an orbit: small on an invariant torus, else a sign of chaos.
/// Both are NaN for orbits that have fewer than 32 states or are lost, and of motion that is too slow for the orbit,
/// or for a half of it (about one turn). Raises Error of arrays of other shapes.
#[pyfunction]
pub(super) fn tunes<'py>(py: Python<'py>, orbits: Rows<'py>) -> PyResult<TwoArrays<'py>> {
    let (values, shape) = read("orbits", &orbits)?;
    let (count, dim) = match shape[..] {
        [_, dim] => (1, dim),
        [_, count, dim] => (count, dim),
        _ => (0, 0),
    };
    if count == 0 || dim == 0 || !dim.is_multiple_of(2) {
        let found = format!("an array of shape {shape:?}");
        return Err(Error::invalid("orbits", found, "(T, 2n) or (T, M, 2n)").into());
    }
    let found = interruptible(py, |pace| {
        let (mut found, states) = (Vec::new(), values.len() / (count * dim));
        while found.len() < count {
            // A few hundred sums over the states of each.
            let first = found.len();
            let last = count.min(first + pace.part(states.saturating_mul(1000)));
            let rows = values.chunks_exact(count * dim);
            let part = rows.flat_map(|row| &row[first * dim..last * dim]).copied().collect();
            found.extend(tunes_of(&Trajectories::new(part, dim, last - first)?));
            pace.pause("tunes", states.saturating_mul(1000 * (last - first)))?;
        }
        Ok(found)
    })?;
    let of = |values: Vec<f64>| {
        let alone = shape.len() == 2;
        array(py, values, if alone { vec![dim / 2] } else { vec![count, dim / 2] })
    };
    let turns = found.iter().flat_map(|one| one.turns.clone()).collect();
    let changes = found.into_iter().flat_map(|one| one.changes).collect();
    Ok((of(turns)?, of(changes)?))
}

/// The strongest spectral lines of a signal (T, 2), the x and y of x + iy, at most `count` of them: (frequencies,
/// amplitudes), (K,) and (K, 2). A line is amplitude * exp(2 pi i frequency t), with the frequency in turns per sample,
/// between -1/2 and 1/2. A signal of fewer than 16 samples has none. Raises Error of arrays of other shapes.
#[pyfunction]
#[pyo3(signature = (signal, count=8))]
pub(super) fn spectral_lines<'py>(
    py: Python<'py>,
    signal: Rows<'py>,
    count: usize,
) -> PyResult<TwoArrays<'py>> {
    let (values, shape) = read("signal", &signal)?;
    if shape.len() != 2 || shape[1] != 2 {
        let found = format!("an array of shape {shape:?}");
        return Err(Error::invalid("signal", found, "(T, 2)").into());
    }
    let signal: Vec<[f64; 2]> = values.chunks_exact(2).map(|z| [z[0], z[1]]).collect();
    let found = measured(py, || Ok(lines_of(&signal, count)))?;
    let amplitudes = found.iter().flat_map(|line| line.amplitude).collect();
    let frequencies: Vec<f64> = found.iter().map(|line| line.frequency).collect();
    let lines = frequencies.len();
    Ok((array(py, frequencies, vec![lines])?, array(py, amplitudes, vec![lines, 2])?))
}

/// The rotation number of an orbit (T, 2) of a map of a plane about `centre`, or of M orbits (T, M, 2), in turns per
/// step, positive from the first coordinate towards the second (`tunes` has the other sign, from p towards q), by
/// weighted Birkhoff averages: (turns, error), two numbers or two arrays (M,). The error is the difference between the
/// averages over the two halves. The growth of the angle in a step is known only up to whole turns: the value within
/// half a turn of `near` is taken. Of several orbits those that are lost have NaN. Raises Error of arrays of other
/// shapes.
#[pyfunction]
#[pyo3(signature = (orbit, centre, near=0.0))]
pub(super) fn rotation_number<'py>(
    py: Python<'py>,
    orbit: Rows<'py>,
    centre: [f64; 2],
    near: f64,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let (values, shape) = read("orbit", &orbit)?;
    let count = match shape[..] {
        [_, 2] => 1,
        [_, count, 2] if count > 0 => count,
        _ => {
            let found = format!("an array of shape {shape:?}");
            return Err(Error::invalid("orbit", found, "(T, 2) or (T, M, 2)").into());
        }
    };
    if shape.len() == 2 {
        crate::flow::check_finite("orbit", &values, 2)?;
    }
    Error::check_finite("near", near)?;
    centre.iter().try_for_each(|v| Error::check_finite("centre", *v))?;
    let angle = |z: &[f64]| match [z[0] - centre[0], z[1] - centre[1]] {
        // The centre is at no angle.
        [0.0, 0.0] => f64::NAN,
        [x, y] => libm::atan2(y, x),
    };
    let found = py.detach(|| {
        Ok::<_, Error>(rotation_numbers(&Trajectories::new(values, 2, count)?, near, angle))
    })?;
    if shape.len() == 2 {
        let alone = |value: f64| PyFloat::new(py, value).into_any();
        return Ok((alone(found[0].turns), alone(found[0].error)));
    }
    let turns = found.iter().map(|one| one.turns).collect();
    let errors = found.iter().map(|one| one.error).collect();
    Ok((array(py, turns, vec![count])?.into_any(), array(py, errors, vec![count])?.into_any()))
}

/// The closed curve on which an orbit (T, 2) of a map of a plane lies, as a Fourier series fitted to its first half.
/// `turns` is an estimate of the rotation number, in turns per step. Raises Error of fewer than 64 states.
#[pyclass(frozen, module = "gyroceptron", name = "InvariantCircle")]
pub(super) struct PyInvariantCircle(InvariantCircle);

#[pymethods]
impl PyInvariantCircle {
    #[new]
    fn new(py: Python<'_>, orbit: Rows<'_>, turns: f64) -> PyResult<Self> {
        let orbit = rows_of("orbit", &orbit, 1)?;
        Ok(Self(measured(py, || InvariantCircle::of_orbit(&orbit, turns))?))
    }

    /// The rotation number of the curve, in turns per step.
    #[getter]
    fn turns(&self) -> f64 {
        self.0.turns
    }

    /// The largest distance of the second half of the orbit, which the fit has not seen, from the points that the curve
    /// predicts: large on islands and in chaos.
    #[getter]
    fn error(&self) -> f64 {
        self.0.error
    }

    /// The area inside the curve, with the sign of its direction.
    #[getter]
    fn area(&self) -> f64 {
        self.0.area()
    }

    /// The integral of rho over the inside of the curve, with the sign of its direction; `section` is a file of rho, as
    /// for train, and `controls` are the values of the controls, in the order of its lambda, where it has any. Of
    /// points R, Z in metres and rho = B_phi in tesla it is the toroidal flux in webers. It is NaN where the curve
    /// leaves the box of the file.
    #[pyo3(signature = (section, controls=None))]
    fn flux(&self, section: PathBuf, controls: Option<Vec<f64>>) -> PyResult<f64> {
        let section = read_section(&section)?;
        if let (Some(values), false) = (&controls, section.depends_on_controls()) {
            let expected = "None: the density depends on no controls";
            return Err(Error::invalid("controls", format!("{values:?}"), expected).into());
        }
        let there = section.at_controls(&controls.unwrap_or_default())?;
        there.check(1)?;
        let density = there.planes()[0].as_ref();
        Ok(density.map_or(f64::NAN, |density| self.0.flux(density)))
    }

    /// `count` points of the curve at equal distances of the angle: (count, 2).
    fn points<'py>(&self, py: Python<'py>, count: usize) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        Error::check_count_range("count", count, 1, 1 << 24)?;
        array(py, self.0.points(count), vec![count, 2])
    }

    /// The distances of `points`, (..., 2), from the curve: (...).
    fn distances<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = points_of("points", &points, 1)?;
        let distances =
            by_parts(py, "distances", 2, &points.values, |part| Ok(self.0.distances(part)))?;
        array(py, distances, points.shape(&[], &[]))
    }

    fn __repr__(&self) -> String {
        let circle = &self.0;
        format!(
            "<gyroceptron.InvariantCircle: {} modes, {:.12} turns a step, error {:.1e}>",
            circle.modes(),
            circle.turns,
            circle.error
        )
    }
}
