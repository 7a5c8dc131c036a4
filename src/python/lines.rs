//! Field lines of coils in Python.

use super::arrays::{Rows, array, points_of, points_of_width};
use super::interrupt::{by_parts, interruptible};
use super::orbits::{self, OrbitMap};
use super::outside::{box_of, survived};
use super::trained::warn;
use crate::error::Error;
use crate::flow::{LineRequest, LineSection};
use crate::io::{read_coils, write_section};
use crate::layer::Reversor;
use crate::measure::orbits::{Branch, SymmetryLine, lyapunov_exponent, smaller_alignment_index};
use crate::network::Pace;
use crate::phase::Direction;
use crate::scalar::{Dual, max_or_nan};
use crate::system::Torsatron;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::f64::consts::TAU;
use std::path::PathBuf;

/// Field lines of coils around the magnetic axis, and the map of a section phi = constant along them. Points are
/// (..., 2), R and Z in metres.
///
/// `coils` is a file of coils: text with a line for each Fourier mode, which holds the coefficients of sine and cosine
/// of x, of y and of z of one coil after another, in metres, or an .npz with points (C, N, 3), N points on each of C
/// coils. `currents` are the currents of these coils, in amperes, `field_periods` is the number of field periods of the
/// machine, and `stellarator_symmetric` says whether half a turn about the x axis is a symmetry too. The file holds the
/// coils of one field period, or of half of one with this symmetry: the others are turned images. Without a file the
/// machine is a torsatron of ten periods. `section` is the place of the section, in field periods, `periods` the number
/// of field periods in a map, `reach` the largest distance from the axis at which lines begin, in metres, `axis` a
/// guess of the axis, and `error` the largest error of a map, in metres. Raises Error when a file or a number is
/// unsound, and where there is no axis or a line is lost.
#[pyclass(frozen, module = "gyroceptron", name = "FieldLines")]
pub(super) struct FieldLines {
    section: LineSection,
}

impl FieldLines {
    /// Whether lines run backwards in the mirror S: Z -> -Z of the section, P(S P(z)) = S z, as a few have it.
    fn is_mirrored(&self) -> Result<bool, Error> {
        const LINES: usize = 8;
        /// So many times the error of a map, which is made twice.
        const ABOVE: f64 = 30.0;
        /// Of coordinates, which are rounded.
        const LEAST: f64 = 1e-12;
        let (starts, map) = (self.section.starts(LINES), self.section.map());
        let mirrored = |mut points: Vec<f64>| {
            points.iter_mut().skip(1).step_by(2).for_each(|z| *z = -*z);
            points
        };
        let back = map.trajectories(&mirrored(map.trajectories(&starts, 1)?), 1)?;
        let apart = back.iter().zip(mirrored(starts)).map(|(a, b)| (a - b).abs());
        Ok(apart.fold(0.0, max_or_nan) <= ABOVE * self.section.error() + LEAST)
    }
}

/// The machine that is there without a file.
fn torsatron() -> Torsatron {
    Torsatron::default()
}

impl OrbitMap for LineSection {
    fn dof(&self) -> usize {
        1
    }
    fn on_section(&self) -> bool {
        true
    }
    fn with_jacobian(&self, z: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let (image, jacobian) = self.map().with_jacobian([z[0], z[1]]);
        Ok((image.to_vec(), jacobian.concat()))
    }
    fn followed(
        &self,
        points: &[f64],
        maps: usize,
        pace: &mut Pace<'_>,
    ) -> Result<Vec<f64>, Error> {
        let mut states = points.to_vec();
        for done in 0..maps {
            let here = &states[done * points.len()..];
            states.extend(self.map().trajectories(here, 1)?);
            pace.pause("field lines", 1)?;
        }
        Ok(states.split_off(points.len()))
    }
}

impl FieldLines {
    /// Of each line the first map, of those looked at, in which it comes too near to a coil.
    fn first_near_coils(
        &self,
        states: &[f64],
        maps: usize,
        pace: &mut Pace<'_>,
    ) -> Result<Vec<Option<usize>>, Error> {
        let row = states.len() / (maps + 1);
        let mut first = vec![None; row / 2];
        for map in (0..maps).step_by(LineSection::LOOKED_AT) {
            let (here, next) = states[map * row..][..2 * row].split_at(row);
            let resolved = self.section.are_resolved(here)?;
            for ((first, is_resolved), z) in first.iter_mut().zip(resolved).zip(next.chunks(2)) {
                // Lines that are lost are said by themselves.
                if first.is_none() && !is_resolved && z[0].is_finite() {
                    *first = Some(map);
                }
            }
            pace.pause("distances", 1)?;
        }
        Ok(first)
    }
}

#[pymethods]
impl FieldLines {
    #[new]
    #[pyo3(signature = (coils=None, currents=None, field_periods=None, *, stellarator_symmetric=true, section=0.0,
        periods=1, reach=0.1, axis=None, error=1e-10))]
    #[allow(clippy::too_many_arguments, reason = "keywords of Python")]
    fn new(
        py: Python<'_>,
        coils: Option<PathBuf>,
        currents: Option<Vec<f64>>,
        field_periods: Option<u32>,
        stellarator_symmetric: bool,
        section: f64,
        periods: u32,
        reach: f64,
        axis: Option<[f64; 2]>,
        error: f64,
    ) -> PyResult<Self> {
        let (set, of_machine, guess) = match coils {
            Some(path) => {
                let missing = |name: &str, needed: &str| Error::invalid(name, "None", needed);
                let needed = "a list with the current of each coil of the file";
                let currents = currents.ok_or_else(|| missing("currents", needed))?;
                let needed = "those of the machine that the coils of the file are of";
                let of_machine = field_periods.ok_or_else(|| missing("field_periods", needed))?;
                let set = read_coils(&path, &currents, of_machine, stellarator_symmetric)?;
                (set, of_machine, axis)
            }
            None => {
                if currents.is_some() || field_periods.is_some() {
                    let expected = "a file, since currents or field_periods are given";
                    return Err(Error::invalid("coils", "None", expected).into());
                }
                let own = torsatron();
                (own.coils()?, own.periods, axis.or(Some([own.major_radius, 0.0])))
            }
        };
        Error::check_count_range("periods", periods as usize, 1, 1000)?;
        Error::check_finite("section", section)?;
        let coils = py.detach(|| set.all())?;
        let of_machine = f64::from(of_machine);
        let (phi, angle) = (TAU * section / of_machine, TAU * f64::from(periods) / of_machine);
        let request = LineRequest { phi, angle, reach, guess, error };
        let section = interruptible(py, |pace| LineSection::new_at_pace(&coils, request, pace))?;
        Ok(Self { section })
    }

    /// R and Z of the magnetic axis, in metres.
    #[getter]
    fn axis(&self) -> [f64; 2] {
        self.section.axis()
    }

    /// The error of a map, in metres.
    #[getter]
    fn error(&self) -> f64 {
        self.section.error()
    }

    /// Turns about the axis per map of a line close to it, positive from R towards Z: whole turns are counted, so that
    /// a map of several periods has as many times those of one. NaN where lines leave the axis.
    #[getter]
    fn turns(&self) -> f64 {
        self.section.turns()
    }

    /// The points where lines begin, (lines, 2): from the axis outwards to the reach, with equal areas between them.
    fn starts<'py>(&self, py: Python<'py>, lines: usize) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        Error::check_count_range("lines", lines, 1, 1 << 24)?;
        array(py, self.section.starts(lines), vec![lines, 2])
    }

    /// The points of lines through `points`, (..., 2), map after map: (maps + 1, ..., 2). A line that is further from
    /// the middle of the machine than any coil is NaN from there on (UserWarning). Nearer to a coil than points along
    /// it resolve, the field is not that of the coil: unless `near_coils` is False, in the first map and in one of five
    /// it is looked at whether a line comes there (UserWarning), which takes as long as following it through these;
    /// `distance_to_coils` looks at all.
    #[pyo3(signature = (points, maps, *, near_coils=true))]
    fn trace<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
        maps: usize,
        near_coils: bool,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = points_of("points", &points, 1)?;
        Error::check_count_range("maps", maps, 1, 1 << 32)?;
        let mut states = points.values.clone();
        let traced = |pace: &mut Pace<'_>| self.section.followed(&points.values, maps, pace);
        states.extend(interruptible(py, traced)?);
        let row = points.values.len();
        let near = match near_coils {
            true => interruptible(py, |pace| self.first_near_coils(&states, maps, pace))?,
            false => Vec::new(),
        };
        if let Some((line, map)) = near.iter().enumerate().find_map(|(k, map)| Some((k, (*map)?))) {
            let here = &states[map * row + 2 * line..][..2];
            let count = near.iter().flatten().count();
            warn(
                py,
                &format!(
                    "{count} of {} lines come nearer to a coil than {:.3} m, where the field of points along it is not \
                     its own: the first is row {line} (counted from 0), after map {map}, at (R, Z) = ({:.4}, {:.4})",
                    row / 2,
                    self.section.field().resolved_from(),
                    here[0],
                    here[1]
                ),
            )?;
        }
        if let Some(index) = states.iter().position(|v| v.is_nan()) {
            let end = &states[maps * row..];
            let count = end.chunks_exact(2).filter(|z| z[0].is_nan()).count();
            let (line, map) = (index % row / 2, index / row);
            warn(
                py,
                &format!(
                    "{count} of {} lines leave the machine, and are NaN from there on: the first is row {line} \
                     (counted from 0), in map {map}",
                    row / 2
                ),
            )?;
        }
        array(py, states, points.shape(&[maps + 1], &[2]))
    }

    /// How near each line from `points`, (..., 2), comes to a coil in `maps` maps, in metres, after each step of the
    /// integration: (...). NaN where it is lost. Within about the distance between points along a coil the field is
    /// not that of the coil.
    #[pyo3(signature = (points, maps=1))]
    fn distance_to_coils<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
        maps: usize,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = points_of("points", &points, 1)?;
        Error::check_count_range("maps", maps, 1, 1 << 32)?;
        let map = self.section.map();
        let values = interruptible(py, |pace| {
            let mut here = points.values.clone();
            let mut nearest = vec![f64::INFINITY; here.len() / 2];
            for _ in 0..maps {
                for (nearest, found) in nearest.iter_mut().zip(map.nearest_to_coils(&here, 1)?) {
                    // A NaN stays.
                    *nearest = if nearest.is_nan() || found >= *nearest { *nearest } else { found };
                }
                here = map.trajectories(&here, 1)?;
                pace.pause("distances", 1)?;
            }
            Ok(nearest)
        })?;
        array(py, values, points.shape(&[], &[]))
    }

    /// The points from which lines come to `points`, (..., 2), in one map, followed backwards: an array of the same
    /// shape. It undoes a map up to the error of both; a line is lost as in `trace`.
    fn inverse<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = points_of("points", &points, 1)?;
        let back = self.section.map().backwards();
        let values =
            by_parts(py, "field lines", 2, &points.values, |part| back.trajectories(part, 1))?;
        array(py, values, points.shape(&[], &[2]))
    }

    /// The Jacobians of a map at `points`, (..., 2), by dual numbers: (..., 2, 2). NaN of lines that are lost, as in
    /// `trace`.
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = points_of("points", &points, 1)?;
        let map = self.section.map();
        let values = by_parts(py, "Jacobians", 2, &points.values, |part| {
            let images = map.trajectories(part, 1)?;
            let of = |(z, image): (&[f64], &[f64])| match image[0].is_nan() {
                true => [[f64::NAN; 2]; 2],
                false => map.with_jacobian([z[0], z[1]]).1,
            };
            Ok(part.chunks_exact(2).zip(images.chunks_exact(2)).flat_map(of).flatten().collect())
        })?;
        array(py, values, points.shape(&[], &[2, 2]))
    }

    /// The toroidal field |B_phi| at `points`, (..., 2), in tesla: (...).
    fn density<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = points_of("points", &points, 1)?;
        let values = by_parts(py, "field", 2, &points.values, |part| {
            Ok(part
                .chunks_exact(2)
                .map(|z| self.section.toroidal_field(z[0], z[1]).abs())
                .collect())
        })?;
        array(py, values, points.shape(&[], &[]))
    }

    /// The magnetic field of the coils at `places`, (..., 3), Cartesian x, y and z in metres, by the law of Biot and
    /// Savart: Bx, By and Bz in tesla, (..., 3).
    fn field<'py>(
        &self,
        py: Python<'py>,
        places: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let places = points_of_width("places", &places, 3)?;
        let field = self.section.field();
        let values = by_parts(py, "field", 3, &places.values, |part| {
            Ok(part.as_chunks().0.iter().flat_map(|place| field.magnetic_field(*place)).collect())
        })?;
        array(py, values, places.shape(&[], &[3]))
    }

    /// The derivatives of `field` at `places`, (..., 3), by dual numbers, in tesla per metre: (..., 3, 3), where [i, j]
    /// is that of component i along coordinate j.
    fn field_gradient<'py>(
        &self,
        py: Python<'py>,
        places: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let places = points_of_width("places", &places, 3)?;
        let field = self.section.field();
        let gradient = |[x, y, z]: &[f64; 3]| {
            let place: [Dual<f64, 3>; 3] =
                [Dual::variable(*x, 0), Dual::variable(*y, 1), Dual::variable(*z, 2)];
            field.magnetic_field(place).map(|component| component.eps)
        };
        let values = by_parts(py, "field", 3, &places.values, |part| {
            Ok(part.as_chunks().0.iter().flat_map(gradient).flatten().collect())
        })?;
        array(py, values, places.shape(&[], &[3, 3]))
    }

    /// Writes |B_phi| in tesla, with its value on the axis as `scale`, on a grid of a box a little wider than that of
    /// `points`, (..., 2): a file that `train` takes as its `section`. An existing file is kept unless `overwrite`.
    #[pyo3(signature = (path, points, overwrite=false))]
    fn write_section(
        &self,
        py: Python<'_>,
        path: PathBuf,
        points: Rows<'_>,
        overwrite: bool,
    ) -> PyResult<()> {
        /// Nodes of the grid along each axis: with them the density is known to some 1e-12.
        const NODES: usize = 65;
        let points = points_of("points", &points, 1)?;
        if path.exists() && !overwrite {
            return Err(Error::FileExists { path }.into());
        }
        interruptible(py, |_| {
            let chart = self.section.chart(&points.values)?;
            let Some(density) = chart.planes()[0].as_ref() else { return Ok(()) };
            let grid = |axis: usize| -> Vec<f64> {
                let (low, high) = (density.low()[axis], density.high()[axis]);
                (0..NODES).map(|k| low + (high - low) * k as f64 / (NODES - 1) as f64).collect()
            };
            let (x, y) = (grid(0), grid(1));
            let values: Vec<f64> =
                y.iter().flat_map(|y| x.iter().map(|x| density.density(*x, *y))).collect();
            write_section(&path, &x, &y, &values, density.scale(), &[])
        })
    }

    /// The distinct orbits of exactly `period` steps that Newton's method finds from `guesses`, (N, 2n), in metres: a
    /// dictionary each, as of `Model.periodic_orbits`. Lines that are lost are NaN.
    #[pyo3(signature = (guesses, period=1, apart=1e-6))]
    fn periodic_orbits<'py>(
        &self,
        py: Python<'py>,
        guesses: Rows<'py>,
        period: usize,
        apart: f64,
    ) -> PyResult<Bound<'py, PyList>> {
        orbits::periodic_orbits_of(py, &self.section, &guesses, period, apart)
    }

    /// The periodic orbits of exactly `period` steps that begin on the line of symmetry of a reversible map of a plane,
    /// from `low` to `high` on it, in metres, found without a guess: dictionaries, as of `Model.symmetric_orbits`. The
    /// line of a section with `reversor` "positions" is Z = 0. Raises Error of another reversor, and of a section that
    /// is no mirror plane of the machine: those at 0 and half a field period are, with stellarator symmetry.
    #[pyo3(signature = (reversor, low, high, period=1, *, samples=200))]
    fn symmetric_orbits<'py>(
        &self,
        py: Python<'py>,
        reversor: &str,
        low: f64,
        high: f64,
        period: usize,
        samples: usize,
    ) -> PyResult<Bound<'py, PyList>> {
        let reversor = Reversor::find(reversor)?;
        if reversor != Reversor::Positions || !self.is_mirrored()? {
            let expected = "positions, at a section that is a mirror plane: 0 or 0.5 with stellarator symmetry";
            let phi = self.section.request().phi;
            let found = format!("{} at phi = {phi:.6}", reversor.name());
            return Err(Error::invalid("reversor", found, expected).into());
        }
        let line = SymmetryLine { reversor, from: low, to: high, samples };
        orbits::symmetric_orbits_of(py, &self.section, line, period)
    }

    /// The island around the elliptic orbit of `period` steps near `guess`, of a map of a plane, on the ray from
    /// `around` through the first point of the orbit, in metres: low, high, width and angle, as of `Model.island`, or
    /// None.
    #[pyo3(signature = (guess, period=1, *, around, reach=0.15))]
    fn island<'py>(
        &self,
        py: Python<'py>,
        guess: Rows<'py>,
        period: usize,
        around: Rows<'py>,
        reach: f64,
    ) -> PyResult<Option<Bound<'py, PyDict>>> {
        orbits::island_of(py, &self.section, &guess, period, &around, reach)
    }

    /// A branch of the unstable or the stable manifold of the periodic orbit of `period` maps near `guess`, in metres:
    /// points (N, 2), as of `Model.manifold`. The stable one is followed backwards. Raises Error where points leave no
    /// such orbit, and where a line is lost.
    #[pyo3(signature = (guess, period=1, *, stable=false, forward=true, start=1e-6, spacing=1e-2, length=1.0))]
    #[allow(clippy::too_many_arguments, reason = "keywords of Python")]
    fn manifold<'py>(
        &self,
        py: Python<'py>,
        guess: Rows<'py>,
        period: usize,
        stable: bool,
        forward: bool,
        start: f64,
        spacing: f64,
        length: f64,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let branch = Branch { forward, start, spacing, length };
        let (map, back) = (self.section.map(), self.section.map().backwards());
        let mover = |direction, z: &mut [f64]| {
            let map = match direction {
                Direction::Forward => &map,
                Direction::Inverse => &back,
            };
            z.copy_from_slice(&map.trajectories(z, 1)?);
            Ok(())
        };
        orbits::manifold_of(py, (&self.section, &mover), &guess, period, stable, branch)
    }

    /// The number of maps after which each line from `points`, (..., 2), is outside of the box from `low` to `high`,
    /// two numbers each, in metres, for the first time, 0 if it begins outside, or `maps` + 1 if it stays inside:
    /// (...), integers.
    fn survival<'py>(
        &self,
        py: Python<'py>,
        points: Rows<'py>,
        maps: usize,
        low: Vec<f64>,
        high: Vec<f64>,
    ) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        let points = points_of("points", &points, 1)?;
        let region = box_of([Some(low), Some(high)], None, 1)?;
        survived(py, &self.section, &points, maps, &region)
    }

    /// The finite-time Lyapunov exponent of the orbit from `point` over `steps` maps, per map, for distances in metres.
    fn lyapunov_exponent(&self, py: Python<'_>, point: Rows<'_>, steps: usize) -> PyResult<f64> {
        orbits::of_orbit(py, &self.section, &point, steps, lyapunov_exponent)
    }

    /// The smaller alignment index of the orbit from `point` after `steps` steps, for distances in metres: 0 up to
    /// rounding in chaos.
    fn alignment_index(&self, py: Python<'_>, point: Rows<'_>, steps: usize) -> PyResult<f64> {
        orbits::of_orbit(py, &self.section, &point, steps, smaller_alignment_index)
    }

    fn __repr__(&self) -> String {
        let [radius, height] = self.section.axis();
        let request = self.section.request();
        format!(
            "<gyroceptron.FieldLines: phi {:.6}, axis at ({radius:.6}, {height:.6}), lines to {} m from it>",
            request.phi, request.reach
        )
    }
}
