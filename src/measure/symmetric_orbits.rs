//! Periodic orbits of reversible maps of a plane, found on the line that the reversor leaves in place.

use super::periodic::{PeriodicOrbit, WithJacobian, periodic_orbit};
use crate::error::Error;
use crate::layer::Reversor;
use crate::phase::Half;
use crate::scalar::max_or_nan;

/// A part of the line of points that a reversor of a plane leaves in place: q = 0 where it changes the sign of q, with
/// p along it, and p = 0 with q along it where it changes that of p.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SymmetryLine {
    /// The reversor S, with S∘P∘S = P⁻¹.
    pub reversor: Reversor,
    /// The end of the part with the smaller coordinate.
    pub from: f64,
    /// The end of the part with the larger coordinate.
    pub to: f64,
    /// The number of points at which the line is looked at, evenly spaced, with both ends, at most 2²⁰. Of two orbits
    /// between neighbouring points none may be found.
    pub samples: usize,
}

/// The most samples of a line, whose images are all kept.
const MOST_SAMPLES: usize = 1 << 20;
/// Halvings of an interval between two samples: to rounding.
const HALVINGS: usize = 60;
/// Points nearer to one another, over 1 + |z|, are the same.
const APART: f64 = 1e-7;

impl SymmetryLine {
    fn check(&self) -> Result<(), Error> {
        Error::check_finite("line: from", self.from)?;
        Error::check_finite("line: to", self.to)?;
        if !(self.from < self.to) {
            let found = format!("from {} to {}", self.from, self.to);
            return Err(Error::invalid("line", found, "ends in ascending order"));
        }
        Error::check_count_range("line: samples", self.samples, 2, MOST_SAMPLES)
    }

    /// The coordinate that is 0 on the line.
    fn across(&self) -> usize {
        match self.reversor.half() {
            Half::Position => 0,
            Half::Momentum => 1,
        }
    }

    fn point(&self, along: f64) -> Vec<f64> {
        let mut z = vec![along; 2];
        z[self.across()] = 0.0;
        z
    }

    fn at(&self, sample: usize) -> f64 {
        let share = sample as f64 / (self.samples - 1) as f64;
        (self.to - self.from).mul_add(share, self.from)
    }

    /// What is 0 where the orbit through a point of the line comes back after `period` maps: for an even period 2k the
    /// distance of Pᵏ(z) from the line. For an odd one, 2k + 1, the reflection takes Pᵏ(z) to Pᵏ⁺¹(z), and the sum of
    /// their distances is 0. None where the map has no image.
    fn gap(&self, map: WithJacobian<'_>, along: f64, period: usize) -> Option<f64> {
        let image =
            |z: &[f64]| map(z).ok().map(|(image, _)| image).filter(|image| image.len() == 2);
        let mut z = self.point(along);
        for _ in 0..period / 2 {
            z = image(&z)?;
        }
        let off = z[self.across()];
        let gap = match period.is_multiple_of(2) {
            true => off,
            false => off + image(&z)?[self.across()],
        };
        gap.is_finite().then_some(gap)
    }
}

/// Finds the periodic orbits of exactly this period that begin on the line of symmetry of a reversible map of a plane,
/// in the order of their beginnings along it. Between samples at which the half orbit is on different sides of the line
/// its crossing is bracketed, and Newton's method goes on from there; what leads to no orbit, or to one of a shorter
/// period, is left out, as is a part of the line on which the map has no images. No guess is needed. An orbit that
/// crosses the line at two samples' intervals is returned once. That the map is reversible is not tested: one that is
/// not has, as a rule, no such orbits.
///
/// Of an odd period every symmetric orbit has one point on the line. Of an even period it has two or none: those
/// without are on the line of the other reversor, P∘S.
///
/// Source: Greene, <https://doi.org/10.1063/1.524170>, section 3.
///
/// # Errors
/// [`Error::CountOutOfRange`] of a period of 0 or fewer than two samples; [`Error::NotFinite`] and [`Error::Invalid`]
/// of ends that are no part of a line; [`Error::WrongCount`] of a map of more than one degree of freedom; those of the
/// map at the first sample, where it has no image of any.
pub fn symmetric_periodic_orbits(
    map: WithJacobian<'_>,
    line: &SymmetryLine,
    period: usize,
) -> Result<Vec<PeriodicOrbit>, Error> {
    Error::check_count_range("period", period, 1, usize::MAX)?;
    line.check()?;
    let mut found: Vec<PeriodicOrbit> = Vec::new();
    let gaps: Vec<Option<f64>> =
        (0..line.samples).map(|k| line.gap(map, line.at(k), period)).collect();
    if gaps.iter().all(Option::is_none) {
        let (image, _) = map(&line.point(line.from))?;
        Error::check_count("coordinates of a plane", 2, image.len())?;
    }
    // A sample on an orbit is of the interval that ends there.
    let first = gaps.first().copied().flatten().filter(|gap| *gap == 0.0).map(|_| line.from);
    let between = (1..line.samples).filter_map(|k| {
        let (before, after) = (gaps[k - 1]?, gaps[k]?);
        let crosses = after == 0.0 || before * after < 0.0;
        crosses.then(|| bracketed(map, line, period, [line.at(k - 1), line.at(k)], before))
    });
    for along in first.into_iter().chain(between) {
        let Ok(orbit) = periodic_orbit(map, &line.point(along), period) else { continue };
        let size = 1.0 + orbit.points[0].iter().map(|v| v.abs()).fold(0.0, max_or_nan);
        let near = |point: &Vec<f64>, other: &[f64]| {
            let apart = point.iter().zip(other).map(|(a, b)| (a - b).abs());
            apart.fold(0.0, max_or_nan) <= APART * size
        };
        let is_symmetric = near(&orbit.points[0], &line.point(along));
        let known = found.iter().any(|one| one.points.iter().any(|p| near(p, &orbit.points[0])));
        if orbit.period() == period && is_symmetric && !known {
            found.push(orbit);
        }
    }
    Ok(found)
}

/// Where on the line the half orbit crosses it, by halving.
fn bracketed(
    map: WithJacobian<'_>,
    line: &SymmetryLine,
    period: usize,
    [mut low, mut high]: [f64; 2],
    below: f64,
) -> f64 {
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(low, high);
        match line.gap(map, middle, period) {
            Some(gap) if gap * below > 0.0 => low = middle,
            _ => high = middle,
        }
    }
    high
}
