//! Exact derivatives, by dual numbers, of a map, its periodic orbits and its rotation numbers with respect to
//! controls.

use super::periodic::PeriodicOrbit;
use super::rotation::birkhoff_average;
use crate::error::Error;
use crate::network::Model;
use crate::phase::Map;
use crate::scalar::Dual;
use crate::stopping::until_stopped;
use faer::Mat;
use faer::linalg::solvers::Solve;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// A number and its derivative by one variable.
type Once = Dual<f64, 1>;
/// A number, its derivative by one variable inside, by another outside, and by both.
type Twice = Dual<Once, 1>;

/// A number with these derivatives inside and outside.
fn twice(value: f64, inner: f64, outer: f64) -> Twice {
    Twice { re: Once { re: value, eps: [inner] }, eps: [Once::constant(outer)] }
}

/// A network with controls, at given values of the controls.
#[derive(Clone, Copy, Debug)]
pub struct AtControls<'a> {
    model: &'a Model,
    values: &'a [f64],
}

impl<'a> AtControls<'a> {
    /// The network at these values of its controls.
    ///
    /// # Errors
    /// When there is not one finite value for each control.
    pub fn new(model: &'a Model, values: &'a [f64]) -> Result<Self, Error> {
        let count = model.composition().controls().map_or(0, |controls| controls.ranges.len());
        Error::check_count_range("controls of the model", count, 1, usize::MAX)?;
        Error::check_count("values of controls", count, values.len())?;
        values.iter().try_for_each(|value| Error::check_finite("control", *value))?;
        Ok(Self { model, values })
    }

    fn dim(&self) -> usize {
        2 * self.model.composition().dof()
    }

    /// The network whose parameters have derivatives by this control.
    fn along(&self, control: usize) -> Result<Model<Once>, Error> {
        let slope = |number| if number == control { 1.0 } else { 0.0 };
        let numbers = self.values.iter().enumerate();
        let values: Vec<Once> =
            numbers.map(|(number, value)| Once { re: *value, eps: [slope(number)] }).collect();
        self.model.at_controls(&values)
    }

    /// ∂P/∂λ at each point of 2n numbers: a matrix of 2n × controls numbers for each point, row by row.
    ///
    /// # Errors
    /// [`Error::WrongCount`] of points that are no whole rows.
    pub fn derivatives(&self, points: &[f64]) -> Result<Vec<f64>, Error> {
        let (dim, count) = (self.dim(), self.values.len());
        Error::check_rows("points", points.len(), dim)?;
        let mut out = vec![0.0; points.len() * count];
        for control in 0..count {
            let map = self.along(control)?;
            out.par_chunks_mut(dim * count).zip(points.par_chunks(dim)).for_each(|(out, point)| {
                let mut z: Vec<Once> = point.iter().map(|v| Once::constant(*v)).collect();
                map.forward(&mut z);
                for (row, moved) in z.iter().enumerate() {
                    out[row * count + control] = moved.eps[0];
                }
            });
        }
        Ok(out)
    }

    /// The derivatives of a periodic orbit and of Tr M with respect to the controls. z* = Pᵏ(z*; λ) gives
    /// dz*/dλ = (1 − M)⁻¹ ∂Pᵏ/∂λ; and dTr M/dλ = Σ_j d/dλ ∂Pᵏ_j/∂z_j, where the point moves with the control by dz*/dλ.
    ///
    /// # Errors
    /// Where M has the eigenvalue 1: [`Error::Invalid`].
    pub fn orbit_response(&self, orbit: &PeriodicOrbit) -> Result<OrbitResponse, Error> {
        let (dim, count) = (self.dim(), self.values.len());
        let start = &orbit.points[0];
        Error::check_count("coordinates of an orbit", dim, start.len())?;
        let one = |i: usize, k: usize| if i == k { 1.0 } else { 0.0 };
        let matrix = &orbit.multiplier_matrix;
        let left = Mat::from_fn(dim, dim, |i, k| one(i, k) - matrix[i * dim + k]);
        let (mut moved, mut traces) = (vec![0.0; dim * count], Vec::with_capacity(count));
        for control in 0..count {
            let map = self.along(control)?;
            let mut image: Vec<Once> = start.iter().map(|v| Once::constant(*v)).collect();
            (0..orbit.period()).for_each(|_| map.forward(&mut image));
            let right = Mat::from_fn(dim, 1, |i, _| image[i].eps[0]);
            let step = left.partial_piv_lu().solve(&right);
            (0..dim).for_each(|i| moved[i * count + control] = step[(i, 0)]);
            // The inner variable is the control, with which the point moves; the outer one is z_j.
            let slope = |j: usize| {
                let mut z: Vec<Twice> =
                    (0..dim).map(|k| twice(start[k], step[(k, 0)], one(k, j))).collect();
                (0..orbit.period()).for_each(|_| map.forward(&mut z));
                z[j].eps[0].eps[0]
            };
            let trace: f64 = (0..dim).map(slope).sum();
            if !(trace.is_finite() && (0..dim).all(|i| step[(i, 0)].is_finite())) {
                let found = format!("an orbit through {start:?}");
                let expected = "one whose M has no eigenvalue 1: it moves with the controls";
                return Err(Error::invalid("periodic orbit", found, expected));
            }
            traces.push(trace);
        }
        Ok(OrbitResponse { moved, traces })
    }

    /// The rotation number about a centre of an orbit of a network of one degree of freedom, as by
    /// [`rotation_numbers`](super::orbits::rotation_numbers), and its derivative by each control. `start_moved` is the
    /// derivative of the first point by the controls, 2 × controls numbers row by row.
    ///
    /// The derivative is the weighted average of the growth of d(angle)/dλ from one state to the next, which converges
    /// as fast as that of the angle.
    ///
    /// # Errors
    /// When the network is of more degrees of freedom; [`Error::Diverged`] of an orbit that leaves the finite numbers.
    pub fn rotation_response(
        &self,
        start: [f64; 2],
        start_moved: &[f64],
        centre: [f64; 2],
        maps: usize,
    ) -> Result<(f64, Vec<f64>), Error> {
        Error::check_count("degrees of freedom", 1, self.model.composition().dof())?;
        Error::check_count_range("maps", maps, 4, usize::MAX)?;
        let count = self.values.len();
        Error::check_count("changes of the first point", 2 * count, start_moved.len())?;
        let follow = |control: usize| -> Result<(f64, f64), Error> {
            let map = self.along(control)?;
            let first = |k: usize| Once { re: start[k], eps: [start_moved[k * count + control]] };
            let mut z = [first(0), first(1)];
            let (mut growths, mut changes) = (Vec::new(), Vec::new());
            let mut before = angle_and_change(&z, centre);
            if !(before.0.is_finite() && before.1.is_finite()) {
                let expected = "another point than the centre, of finite numbers";
                return Err(Error::invalid("start", format!("{start:?}"), expected));
            }
            for number in until_stopped(0..maps) {
                map.forward(&mut z);
                let now = angle_and_change(&z, centre);
                if !(now.0.is_finite() && now.1.is_finite()) {
                    let place = format!("map {}", number + 1);
                    return Err(Error::Diverged { what: "an orbit".into(), place });
                }
                growths.push(libm::remainder(now.0 - before.0, TAU));
                changes.push(now.1 - before.1);
                before = now;
            }
            // Of growths near half a turn the sign is that of the first.
            let Some(near) = growths.first().copied() else {
                return Err(Error::Stopped { what: "rotation".into() });
            };
            let growths: Vec<f64> =
                growths.iter().map(|g| near + libm::remainder(g - near, TAU)).collect();
            Ok((birkhoff_average(&growths) / TAU, birkhoff_average(&changes) / TAU))
        };
        let all: Vec<(f64, f64)> = (0..count).map(follow).collect::<Result<_, _>>()?;
        let turns = all.first().map_or(f64::NAN, |(turns, _)| *turns);
        Ok((turns, all.into_iter().map(|(_, change)| change).collect()))
    }
}

/// The angle of a point about a centre, and its derivative.
fn angle_and_change(z: &[Once; 2], centre: [f64; 2]) -> (f64, f64) {
    let [x, y] = [0, 1].map(|k| z[k].re - centre[k]);
    let [dx, dy] = [0, 1].map(|k| z[k].eps[0]);
    (libm::atan2(y, x), (x * dy - y * dx) / (x * x + y * y))
}

/// The derivatives of a periodic orbit with respect to each control.
#[derive(Clone, Debug, PartialEq)]
pub struct OrbitResponse {
    /// How the orbit moves with the controls, dz*/dλ: 2n × controls numbers, row by row.
    pub moved: Vec<f64>,
    /// dTr M/dλ of each control.
    pub traces: Vec<f64>,
}
