//! Field lines through tabulated planes: the field of coils, fitted where a method needs it.

use super::field_line::{LineMap, Lines, SectionMap, lose};
use super::request::Request;
use super::runge_kutta::Field;
use super::{Pairs, PolynomialMap, Region, Tableau};
use crate::error::Error;
use crate::network::Rollout;
use crate::scalar::{Elementary, on_independent_lanes};
use rayon::prelude::*;

/// The map of a section along field lines whose slopes dR/dφ and dZ/dφ are least-squares polynomials on each plane
/// φ = constant at which the order-8 method of Dormand and Prince evaluates them. Today's tracing codes likewise
/// tabulate the field of coils once.
///
/// It is valid near the lines to which the planes were fitted: points that leave their box on the section are lost.
///
/// Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, II.5,
/// <https://doi.org/10.1007/978-3-540-78862-1>, for the method.
#[derive(Clone, Debug)]
pub struct TabulatedLines {
    angle: f64,
    steps: usize,
    /// Angles of the planes beyond the section, growing.
    angles: Vec<f64>,
    /// The polynomials of (R, Z) that give the slopes dR/dφ and dZ/dφ on each plane.
    planes: Vec<PolynomialMap>,
    /// The box of the lines on the section, a little wider.
    region: Region,
}

impl TabulatedLines {
    /// The tabulated form of a map, with planes for its number of steps and polynomials of this total degree. They
    /// are fitted along the lines through these points, (R, Z) in rows, which should fill the part of interest.
    ///
    /// # Errors
    /// Those of [`PolynomialMap::fit`]; when a line is lost within the map.
    pub fn new(map: &LineMap<'_>, points: &[f64], degree: usize) -> Result<Self, Error> {
        /// By so much of its extent the box is wider than that of the points.
        const WIDER: f64 = 0.05;
        Error::check_rows("points of a section", points.len(), 2)?;
        let (steps, angle) = (map.steps(), map.angle());
        let h = angle / steps as f64;
        let none = || Error::invalid("points of a section", "none", "at least one");
        let region = Region::around(2, [points]).ok_or_else(none)?.widened(WIDER);
        let mut nodes: Vec<f64> =
            Tableau::DORMAND_PRINCE_8.stages.iter().map(|(node, _)| *node).collect();
        nodes.sort_by(f64::total_cmp);
        nodes.dedup();
        let (mut angles, mut samples) = (Vec::new(), Vec::new());
        let mut here = points.to_vec();
        let mut slope = map.slopes(&here, 0.0);
        for step in 0..steps {
            let start = step as f64 * h;
            let next = map.part(start, h).trajectories(&here, 1)?;
            if let Some(bad) = next.iter().position(|v| !v.is_finite()) {
                let (row, found) = (bad / 2, format!("({}, {})", here[bad & !1], here[bad | 1]));
                let expected = "lines that stay within the machine";
                return Err(Error::invalid(&format!("line {row}"), found, expected));
            }
            let slope_there = map.slopes(&next, start + h);
            for &node in nodes.iter().filter(|node| **node < 1.0 || step + 1 == steps) {
                // Near the lines is near enough: slopes are taken at these very places.
                let places: Vec<f64> = (0..here.len())
                    .map(|k| hermite(node, h, [here[k], next[k]], [slope[k], slope_there[k]]))
                    .collect();
                angles.push(start + node * h);
                samples.push(places);
            }
            (here, slope) = (next, slope_there);
        }
        let fit = |(angle, places): (&f64, Vec<f64>)| {
            let slopes = map.slopes(&places, *angle);
            PolynomialMap::fit(&Pairs::new("slopes of field lines", 1, places, slopes)?, degree)
        };
        let planes: Result<Vec<_>, Error> = angles.par_iter().zip(samples).map(fit).collect();
        Ok(Self { angle, steps, angles, planes: planes?, region })
    }

    /// How many planes there are.
    pub fn planes(&self) -> usize {
        self.planes.len()
    }

    /// The number of integration steps in one map.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// The size of its coefficients in bytes.
    pub fn bytes(&self) -> usize {
        self.planes.iter().map(|plane| size_of::<f64>() * plane.parameters()).sum()
    }

    /// Follows lines from points of the section, as [`LineMap::trajectories`] does.
    ///
    /// # Errors
    /// Those of [`LineMap::trajectories`].
    pub fn trajectories(&self, initial: &[f64], maps: usize) -> Result<Vec<f64>, Error> {
        Error::check_rows("points of a section", initial.len(), 2)?;
        if initial.is_empty() || maps == 0 {
            return Ok(Vec::new());
        }
        let request = Request { interval: self.angle, steps: self.steps, kept: maps };
        let mut states = request.run_blocks(2, initial, &|initial, states| {
            on_independent_lanes(Lines { map: self, kept: maps, initial, states });
            Ok(())
        })?;
        lose(&mut states, initial, |point| self.holds(&point));
        Ok(states)
    }

    /// The states of an orbit of each initial point, as a network's [`rollout`](crate::network::rollout) gives them.
    ///
    /// # Errors
    /// Those of [`TabulatedLines::trajectories`]; when `every` is 0.
    pub fn rollout(&self, initial: &[f64], request: Rollout) -> Result<Vec<f64>, Error> {
        Error::check_count_range("every", request.every, 1, usize::MAX)?;
        let mut out = initial.to_vec();
        for _ in 0..request.steps / request.every {
            let here = &out[out.len() - initial.len()..];
            let moved = self.trajectories(here, request.every)?;
            out.extend_from_slice(&moved[moved.len() - initial.len()..]);
        }
        Ok(out)
    }

    /// Whether a point of the section is in the box of its planes, out of which lines are lost.
    pub fn holds(&self, point: &[f64]) -> bool {
        self.region.first_outside(point).is_none()
    }

    /// The image of a place in the section and the Jacobian there, as [`LineMap::with_jacobian`] gives them.
    pub fn with_jacobian(&self, place: [f64; 2]) -> ([f64; 2], [[f64; 2]; 2]) {
        self.image_and_jacobian(place)
    }
}

impl SectionMap for TabulatedLines {
    #[inline(always)]
    fn take<S: Elementary>(&self, place: &mut [S]) {
        Tableau::DORMAND_PRINCE_8.of_field(self, place, self.angle, self.steps);
    }
}

impl Field for TabulatedLines {
    #[inline(always)]
    fn at<S: Elementary>(&self, x: &[S], time: f64, out: &mut [S]) {
        // Times are those of the planes but for rounding.
        let after = self.angles.partition_point(|angle| *angle < time).min(self.angles.len() - 1);
        let nearer = |k: usize| (self.angles[k] - time).abs();
        let before = after.saturating_sub(1);
        let plane = if nearer(before) < nearer(after) { before } else { after };
        out.copy_from_slice(x);
        self.planes[plane].step(out);
    }
}

/// The cubic through two values with these slopes, at a share of the way of length `h` between them.
fn hermite(share: f64, h: f64, [a, b]: [f64; 2], [slope_a, slope_b]: [f64; 2]) -> f64 {
    let (t, s) = (share, 1.0 - share);
    let bent = s * (slope_a * h - (b - a)) - t * (slope_b * h - (b - a));
    a + t * (b - a) + s * t * bent
}
