//! Symplectic polynomials in the chart of a section.

use super::lane_map::{self, room_for_states};
use super::{Pairs, Region, Symmetries, SymplecticPolynomial, lose_rest};
use crate::error::Error;
use crate::network::{Pace, Rollout};
use crate::phase::Section;
use serde::{Deserialize, Serialize};

/// A [`SymplecticPolynomial`] in the chart of a [`Section`], if there is one: points are those of the data, (x, y)
/// where the area form of a plane is not dq∧dp.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolynomialOnSection {
    map: SymplecticPolynomial,
    section: Option<Section>,
    /// The box around the fitted pairs, in coordinates of the data, unless another box was set.
    region: Region,
}

/// A polynomial has no controls.
fn check_section(section: &Section, dof: usize) -> Result<(), Error> {
    match section.depends_on_controls() {
        false => section.check(dof),
        true => Err(Error::invalid("section", "a density that depends on controls", "one of none")),
    }
}

/// Of a roll-out, in errors.
const NAME: &str = "trajectories";

impl PolynomialOnSection {
    /// The fit to pairs of data, with these symmetries in the chart.
    ///
    /// # Errors
    /// Those of [`SymplecticPolynomial::fit_symmetric`]; when there are no pairs, the section is of other degrees of
    /// freedom, or a point is not on it.
    pub fn fit(
        pairs: &Pairs,
        degree: usize,
        symmetries: &Symmetries,
        section: Option<Section>,
    ) -> Result<Self, Error> {
        let region =
            pairs.region().ok_or_else(|| Error::invalid("pairs", "none", "at least one"))?;
        if let Some(section) = &section {
            check_section(section, pairs.dof())?;
            section.check_points("input", pairs.input())?;
            section.check_points("output", pairs.output())?;
        }
        let canonical = pairs.transformed("pairs", |_, points| {
            section.iter().for_each(|section| section.to_canonical(points));
            Ok(())
        })?;
        let map = SymplecticPolynomial::fit_symmetric(&canonical, degree, symmetries)?;
        Ok(Self { map, section, region })
    }

    /// Checks the map and its chart, as [`SymplecticPolynomial::check`] does a map without one.
    ///
    /// # Errors
    /// With the part that is not as it should be.
    pub fn check(&self) -> Result<(), Error> {
        self.map.check()?;
        self.region.check("region", self.map.dof())?;
        self.section.as_ref().map_or(Ok(()), |section| check_section(section, self.map.dof()))
    }

    /// The same map with this box, in place of that of the pairs that it was fitted to.
    ///
    /// # Errors
    /// When the box is of another dimension.
    pub fn with_region(self, region: Region) -> Result<Self, Error> {
        region.check("region", self.map.dof())?;
        Ok(Self { region, ..self })
    }

    /// The inverse of the map, whose inverse is this one, bit for bit.
    pub fn inverted(&self) -> Self {
        Self {
            map: self.map.inverted(),
            section: self.section.clone(),
            region: self.region.clone(),
        }
    }

    /// The box of the pairs.
    pub fn region(&self) -> &Region {
        &self.region
    }

    /// The section in whose chart it is, if it is in one.
    pub fn section(&self) -> Option<&Section> {
        self.section.as_ref()
    }

    /// Whether it is in the chart of a section.
    pub fn has_section(&self) -> bool {
        self.section.is_some()
    }

    /// The symplectic polynomial, which maps canonical coordinates of the section's chart.
    pub fn map(&self) -> &SymplecticPolynomial {
        &self.map
    }

    /// Fails at the first of these points that is not on the section.
    ///
    /// # Errors
    /// With the row and the point.
    pub fn check_points(&self, place: &str, points: &[f64]) -> Result<(), Error> {
        self.section.as_ref().map_or(Ok(()), |section| section.check_points(place, points))
    }

    /// The root mean square distance of its images from those of pairs of data; NaN where an image is not on the
    /// section.
    ///
    /// # Errors
    /// When the pairs are of other degrees of freedom, or a point of them is not on the section.
    pub fn error_on(&self, pairs: &Pairs) -> Result<f64, Error> {
        let dim = 2 * self.map.dof();
        Error::check_count("degrees of freedom", self.map.dof(), pairs.dof())?;
        self.check_points("input", pairs.input())?;
        self.check_points("output", pairs.output())?;
        let images = self.rollout(pairs.input(), Rollout { steps: 1, every: 1 })?;
        let images = images[pairs.input().len()..].chunks_exact(dim);
        Ok(lane_map::distance(images, pairs))
    }

    /// As [`SymplecticPolynomial::rollout`]; NaN from the first kept state on that is not on the section.
    ///
    /// # Errors
    /// Those of [`SymplecticPolynomial::rollout`].
    pub fn rollout(&self, initial: &[f64], request: Rollout) -> Result<Vec<f64>, Error> {
        self.rollout_at_pace(initial, request, &mut Pace::unbroken())
    }

    /// The roll-out of [`PolynomialOnSection::rollout`], which can be stopped between its parts: the same bits.
    ///
    /// # Errors
    /// Those of [`SymplecticPolynomial::rollout`]; [`Error::Stopped`].
    pub fn rollout_at_pace(
        &self,
        initial: &[f64],
        request: Rollout,
        pace: &mut Pace<'_>,
    ) -> Result<Vec<f64>, Error> {
        let every = request.every;
        Error::check_count_range("every", every, 1, usize::MAX)?;
        Error::check_rows("initial points", initial.len(), 2 * self.map.dof())?;
        let points = initial.len() / (2 * self.map.dof());
        let mut here = initial.to_vec();
        self.section.iter().for_each(|section| section.to_canonical(&mut here));
        let mut states = room_for_states(initial, request)?;
        states.extend_from_slice(&here);
        let mut kept = request.steps / every;
        while kept > 0 {
            let steps = pace.part(points);
            let whole = (steps / every).min(kept);
            if whole > 0 {
                let request = Rollout { steps: whole * every, every };
                states.extend_from_slice(&self.map.rollout(&here, request)?[here.len()..]);
                here.copy_from_slice(&states[states.len() - initial.len()..]);
                pace.pause(NAME, request.steps.saturating_mul(points))?;
                kept -= whole;
                continue;
            }
            let mut left = every;
            while left > 0 {
                let part = pace.part(points).min(left);
                let moved = self.map.rollout(&here, Rollout { steps: part, every: part })?;
                here.copy_from_slice(&moved[initial.len()..]);
                pace.pause(NAME, part.saturating_mul(points))?;
                left -= part;
            }
            states.extend_from_slice(&here);
            kept -= 1;
        }
        self.section.iter().for_each(|section| section.to_data(&mut states));
        lose_rest(&mut states, initial.len(), 2 * self.map.dof());
        states[..initial.len()].copy_from_slice(initial);
        Ok(states)
    }

    /// The image of a point, and the Jacobian there: 2n × 2n numbers, row by row.
    pub fn with_jacobian(&self, z: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut image = z.to_vec();
        self.section.iter().for_each(|section| section.to_canonical(&mut image));
        let mut jacobian = self.map.jacobian(&image);
        self.map.step(&mut image);
        if let Some(section) = &self.section {
            section.to_data(&mut image);
            section.jacobian_of_data(&mut jacobian, z, &image);
        }
        (image, jacobian)
    }
}
