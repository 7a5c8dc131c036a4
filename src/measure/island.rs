//! Islands of maps of a plane: how wide they are, and where.

use super::periodic::PeriodicOrbit;
use super::surfaces::{LockedInterval, locked_interval, winding_numbers};
use super::survival::Follow;
use crate::error::Error;
use crate::flow::Trajectories;
use std::f64::consts::TAU;

/// An island of a chain around a centre: the part of the ray from the centre through a point of the chain's elliptic
/// orbit on which orbits stay in the island.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Island {
    /// The distances from the centre between which orbits are locked to the resonance, in the coordinates of the map.
    pub interval: LockedInterval,
    /// The phase of the island: the angle of the ray, in radians, from the first coordinate towards the second.
    pub angle: f64,
}

/// A search for the width of an island.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IslandSearch {
    /// The point that the chain goes around, such as the magnetic axis.
    pub around: [f64; 2],
    /// How far on either side of the orbit the ends are looked for, over the distance from that point.
    pub reach: f64,
    /// The number of maps after which an orbit of the island is still locked, and others are not; it is rounded up to
    /// whole periods of the orbit.
    pub maps: usize,
}

impl IslandSearch {
    /// The number of maps that distinguish an island from an orbit that only turns about as fast: three turns about
    /// the elliptic orbit, each of 2π/ω periods with Tr M = 2 cos ω. None for an orbit that is not elliptic.
    pub fn maps_for(period: usize, residue: f64) -> Option<usize> {
        const ROUND: f64 = 3.0;
        let omega = 2.0 * libm::asin(libm::sqrt(residue));
        let maps = libm::ceil(ROUND * period as f64 * TAU / omega);
        (0.0 < residue && residue < 1.0 && maps <= u32::MAX.into()).then_some(maps as usize)
    }

    /// The island around the first of the points of an elliptic orbit, for the map that `follow` applies. None where
    /// the map does not hold that point in an island, or holds all points within reach.
    ///
    /// An orbit in an island stays in it: after N maps it has gained as much as the elliptic orbit, up to the way from
    /// one island to the next. The number of islands is the period.
    ///
    /// Source: Cary and Hanson, <https://doi.org/10.1063/1.859829>, for islands around an elliptic orbit; their width
    /// is to leading order in its residue, this one by following orbits.
    ///
    /// # Errors
    /// Those of `follow`; [`Error::OutOfRange`] of a reach outside of 0 to 1; [`Error::CountOutOfRange`] of no map;
    /// [`Error::Invalid`] of an orbit that has the centre as a point, [`Error::WrongCount`] of points that are not of
    /// a plane.
    pub fn find(&self, points: &[Vec<f64>], follow: Follow<'_>) -> Result<Option<Island>, Error> {
        Error::check_range("reach", self.reach, Error::LEAST_POSITIVE, 1.0)?;
        Error::check_count_range("maps", self.maps, 1, usize::MAX)?;
        for point in points {
            Error::check_count("numbers of a point", 2, point.len())?;
        }
        let off = |z: &[f64]| [z[0] - self.around[0], z[1] - self.around[1]];
        let angle = |z: &[f64]| {
            let [across, along] = off(z);
            libm::atan2(along, across)
        };
        let radius = points.first().map_or(0.0, |first| {
            let [across, along] = off(first);
            libm::hypot(across, along)
        });
        if !(radius > 0.0) {
            let found = format!("{points:?} around {:?}", self.around);
            return Err(Error::invalid("island", found, "an orbit away from its centre"));
        }
        let ray = angle(&points[0]);
        let (sin, cos) = libm::sincos(ray);
        // By the angle about a point, islands of a chain are of unlike widths, and orbits advance unevenly from one to
        // the next. By the number of the island and the share of the way to the next one they are alike.
        let islands = points.len();
        let mut places: Vec<f64> = points.iter().map(|point| angle(point)).collect();
        places.sort_by(f64::total_cmp);
        let phase = |z: &[f64]| {
            let angle = angle(z);
            let after = places.partition_point(|place| *place <= angle);
            let from = if after > 0 { places[after - 1] } else { places[islands - 1] - TAU };
            let to = if after < islands { places[after] } else { places[0] + TAU };
            TAU * (after as f64 - 1.0 + (angle - from) / (to - from)) / islands as f64
        };
        let steps = (phase(&points[1 % islands]) - phase(&points[0])) / TAU;
        let winding = (steps * islands as f64).round() / islands as f64;
        let within = 1.0 / islands as f64;
        let maps = self.maps.next_multiple_of(islands);
        let locked = |radii: &[f64]| -> Result<Vec<bool>, Error> {
            let place = |r: &f64| [r.mul_add(cos, self.around[0]), r.mul_add(sin, self.around[1])];
            let initial: Vec<f64> = radii.iter().flat_map(place).collect();
            let moved = follow(&initial, maps)?;
            let orbits = Trajectories::new([initial, moved].concat(), 2, radii.len())?;
            let found = winding_numbers(&orbits, winding, phase);
            Ok(found.iter().map(|w| (w - winding).abs() * (maps as f64) < within).collect())
        };
        let found = locked_interval(radius, self.reach * radius, locked)?;
        Ok(found.map(|interval| Island { interval, angle: ray }))
    }

    /// The island about an elliptic orbit, whose residue says how many maps are needed; None where none is found.
    ///
    /// # Errors
    /// Those of [`IslandSearch::find`]; [`Error::Invalid`] of an orbit that is not elliptic, or so nearly parabolic
    /// that orbits do not turn about it within 100,000 maps.
    pub fn of_orbit(
        orbit: &PeriodicOrbit,
        (around, reach): ([f64; 2], f64),
        follow: Follow<'_>,
    ) -> Result<Option<Island>, Error> {
        /// States of so many maps, of all points that are looked at together, fit into memory.
        const MOST: usize = 100_000;
        let residue = orbit.residue();
        let maps = Self::maps_for(orbit.period(), residue).filter(|maps| *maps <= MOST);
        let Some(maps) = maps else {
            let expected = format!(
                "an elliptic orbit, of a residue between 0 and 1, about which orbits turn within {MOST} maps"
            );
            return Err(Error::invalid("orbit: residue", residue, expected));
        };
        Self { around, reach, maps }.find(&orbit.points, follow)
    }
}
