//! Stored models with controls: in coordinates of the data, whose chart may depend on the controls too.

use super::StoredModel;
use crate::error::Error;
use crate::measure::orbits::{AtControls, OrbitResponse, PeriodicOrbit, periodic_orbit};
use crate::network::{map_jacobians, map_points};
use crate::phase::{Direction, Map};

impl StoredModel {
    /// The model at these values of its controls, in the chart of its section there. The result has no controls, and
    /// its held-out error is not known.
    ///
    /// # Errors
    /// When there is not one finite value for each control. Whether the density of its section is positive there
    /// [`Section::check`](crate::phase::Section::check) says.
    pub fn at_controls(&self, values: &[f64]) -> Result<Self, Error> {
        values.iter().try_for_each(|value| Error::check_finite("control", *value))?;
        let model = self.model.at_controls(values)?;
        let section =
            self.section.as_ref().map(|section| section.at_controls(values)).transpose()?;
        let mut out = Self { model, section, ..self.clone() };
        out.provenance.validation = None;
        Ok(out)
    }

    /// The derivatives of the map by its controls at points of the data, at these values: 2n × controls numbers for
    /// each point, row by row.
    ///
    /// # Errors
    /// Those of [`StoredModel::at_controls`] and [`StoredModel::jacobians`].
    pub fn control_derivatives(&self, values: &[f64], points: &[f64]) -> Result<Vec<f64>, Error> {
        let at = self.at_controls(values)?;
        at.check_points("points", points)?;
        let (dim, count) = (2 * at.model.composition().dof(), values.len());
        let mut there = points.to_vec();
        at.to_network(&mut there);
        let mut out = AtControls::new(&self.model, values)?.derivatives(&there)?;
        if let Some(units) = &self.units {
            for (index, entry) in out.iter_mut().enumerate() {
                *entry *= units.factors()[index / count % dim];
            }
        }
        let (Some(section), Some(own)) = (&self.section, &at.section) else { return Ok(out) };
        // A point that stays where it is has another p; and so has its image.
        let jacobians = at.jacobians_in_chart(&there)?;
        let mut images = there;
        map_points(at.model.composition(), Direction::Forward, &mut images)?;
        at.to_data(&mut images);
        let rows = out.chunks_exact_mut(dim * count).zip(jacobians.chunks_exact(dim * dim));
        let ends = points.chunks_exact(dim).zip(images.chunks_exact(dim));
        for ((derivatives, jacobian), (from, to)) in rows.zip(ends) {
            for control in 0..count {
                let mut column: Vec<f64> =
                    (0..dim).map(|i| derivatives[i * count + control]).collect();
                for (k, moved) in section.by_control(control, from).into_iter().enumerate() {
                    (0..dim).for_each(|i| column[i] += jacobian[i * dim + k] * moved);
                }
                for (k, moved) in section.by_control(control, to).into_iter().enumerate() {
                    column[k] -= moved;
                }
                own.direction_to_data(&mut column, to);
                (0..dim).for_each(|i| derivatives[i * count + control] = column[i]);
            }
        }
        Ok(out)
    }

    /// The periodic orbit near a guess, for a model without controls, in the coordinates of the data.
    ///
    /// # Errors
    /// Those of [`periodic_orbit`], [`StoredModel::map_points`] and [`StoredModel::jacobians`].
    pub fn periodic_orbit(&self, guess: &[f64], period: usize) -> Result<PeriodicOrbit, Error> {
        let map = |z: &[f64]| {
            let mut image = z.to_vec();
            self.map_points(Direction::Forward, &mut image)?;
            Ok((image, self.jacobians(z)?))
        };
        periodic_orbit(&map, guess, period)
    }

    /// How a periodic orbit and its Tr M change with the controls, for the model at these values of them, in the
    /// coordinates of the data.
    ///
    /// # Errors
    /// Those of [`StoredModel::at_controls`] and [`AtControls::orbit_response`].
    pub fn orbit_response(
        &self,
        values: &[f64],
        orbit: &PeriodicOrbit,
    ) -> Result<OrbitResponse, Error> {
        let at = self.at_controls(values)?;
        let (start, count) = (&orbit.points[0], values.len());
        at.check_points("periodic orbit", start)?;
        let mut there = start.clone();
        at.to_network(&mut there);
        let dim = there.len();
        let map = at.model.composition();
        let in_network = |z: &[f64]| {
            let (mut image, mut matrix) = (z.to_vec(), vec![0.0; dim * dim]);
            map_jacobians(map, z, &mut matrix)?;
            map.forward(&mut image);
            Ok((image, matrix))
        };
        let own = periodic_orbit(&in_network, &there, orbit.period())?;
        let mut response = AtControls::new(&self.model, values)?.orbit_response(&own)?;
        for control in 0..count {
            let mut column: Vec<f64> =
                (0..dim).map(|i| response.moved[i * count + control]).collect();
            if let Some(units) = &self.units {
                column.iter_mut().zip(units.factors()).for_each(|(v, factor)| *v *= factor);
            }
            if let (Some(section), Some(own)) = (&self.section, &at.section) {
                for (v, moved) in column.iter_mut().zip(section.by_control(control, start)) {
                    *v -= moved;
                }
                own.direction_to_data(&mut column, start);
            }
            (0..dim).for_each(|i| response.moved[i * count + control] = column[i]);
        }
        Ok(response)
    }

    /// The turns per map of an orbit about a centre, for one degree of freedom and these values of the controls, and
    /// their derivatives by the controls while the first point stays fixed. Both points are in the coordinates of the
    /// data.
    ///
    /// # Errors
    /// Those of [`StoredModel::at_controls`] and [`AtControls::rotation_response`].
    pub fn rotation_response(
        &self,
        values: &[f64],
        start: [f64; 2],
        centre: [f64; 2],
        maps: usize,
    ) -> Result<(f64, Vec<f64>), Error> {
        let at = self.at_controls(values)?;
        Error::check_count("degrees of freedom", 1, at.model.composition().dof())?;
        let count = values.len();
        let mut points = [start, centre].concat();
        at.check_points("points", &points)?;
        at.to_network(&mut points);
        let mut moved = vec![0.0; 2 * count];
        for control in 0..count {
            let own = self.section.as_ref().map(|section| section.by_control(control, &start));
            let factors =
                self.units.as_ref().map_or([1.0; 2], |u| [u.factors()[0], u.factors()[1]]);
            for (k, change) in own.unwrap_or_default().into_iter().enumerate() {
                moved[k * count + control] = change / factors[k];
            }
        }
        let network = AtControls::new(&self.model, values)?;
        let ends = [[points[0], points[1]], [points[2], points[3]]];
        let (turns, changes) = network.rotation_response(ends[0], &moved, ends[1], maps)?;
        // (q, p) of a section is (y, x), which turn the other way.
        let sign = if self.section.is_some() { -1.0 } else { 1.0 };
        Ok((sign * turns, changes.into_iter().map(|change| sign * change).collect()))
    }
}
