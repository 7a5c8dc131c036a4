//! Maps of a surface of section by the field lines of coils.

use super::Tableau;
use super::request::{Request, TOGETHER, store_states};
use super::runge_kutta::Field;
use crate::error::Error;
use crate::network::load_groups;
use crate::scalar::{Dual, Elementary, Kernel, Pack, max_or_nan, on_independent_lanes};
use crate::system::CoilField;
use rayon::prelude::*;

/// The map of a section along field lines, by the order-8 method of Dormand and Prince: it takes (R, Z) in the
/// half-plane at φ to the point of the same field line after the toroidal angle of the map.
///
/// When this angle is one or more field periods, it preserves the form B_φ dR∧dZ of the section, which an
/// [`AreaDensity`](crate::phase::AreaDensity) turns into dp∧dq.
///
/// Source of the form: Cary and Littlejohn, <https://doi.org/10.1016/0003-4916(83)90313-5>; of the method:
/// [`Tableau::DORMAND_PRINCE_8`](super::Tableau::DORMAND_PRINCE_8).
#[derive(Clone, Copy, Debug)]
pub struct LineMap<'a> {
    field: &'a CoilField,
    /// The toroidal angle φ of the half-plane of the section, in radians.
    phi: f64,
    /// How far lines are followed.
    angle: f64,
    /// The number of integration steps in one map.
    steps: usize,
}

/// dR/dφ and dZ/dφ from a section on.
struct FromSection<'a>(LineMap<'a>);

impl Field for FromSection<'_> {
    #[inline(always)]
    fn at<S: Elementary>(&self, x: &[S], time: f64, out: &mut [S]) {
        self.0.field.line(x, self.0.phi + time, out);
    }
}

/// Steps that are tried first, and at most.
const FEWEST: usize = 8;
const MOST: usize = 1024;

impl<'a> LineMap<'a> {
    /// The map with `steps` steps.
    ///
    /// # Errors
    /// When φ or the angle is not finite, or there is no step.
    pub fn new(field: &'a CoilField, phi: f64, angle: f64, steps: usize) -> Result<Self, Error> {
        Error::check_finite("section.phi", phi)?;
        Error::check_range("angle of a map", angle, Error::LEAST_POSITIVE, f64::MAX)?;
        Error::check_count_range("steps", steps, 1, usize::MAX)?;
        Ok(Self { field, phi, angle, steps })
    }

    /// The map with its steps doubled until doubling changes the images of these points by at most `error` metres,
    /// and that change divided by 2⁸, which is the error of the map to leading order.
    ///
    /// # Errors
    /// Those of [`LineMap::new`]; when a line runs out of range, or more than 1,024 steps are too few.
    pub fn calibrated(
        field: &'a CoilField,
        phi: f64,
        angle: f64,
        points: &[f64],
        error: f64,
    ) -> Result<(Self, f64), Error> {
        let mut steps = FEWEST;
        let mut map = Self::new(field, phi, angle, steps)?;
        let mut before = map.trajectories(points, 1)?;
        let mut change = f64::NAN;
        while steps < MOST {
            steps *= 2;
            map = Self { steps, ..map };
            let found = map.trajectories(points, 1)?;
            let both = found.iter().zip(&before);
            change = both.map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
            if change <= error {
                return Ok((map, change / ORDER_8));
            }
            before = found;
        }
        Err(Error::NoConvergence { what: "field lines".into(), iterations: steps, change })
    }

    /// The map that follows lines the other way, from the end of this map to its beginning, with as many steps: it
    /// undoes this map up to the error of both.
    #[must_use]
    pub fn backwards(self) -> Self {
        Self { phi: self.phi + self.angle, angle: -self.angle, ..self }
    }

    /// The number of integration steps in one map.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// The same with another number of steps.
    #[must_use]
    pub fn with_steps(self, steps: usize) -> Self {
        Self { steps: steps.max(1), ..self }
    }

    /// The points after 1, …, `maps` maps, rows (R, Z): all points after the first map, then all after the second, …
    /// A line that is further from the middle of the machine than any coil is lost: its points are NaN from there on.
    /// For lines that run into a coil see [`LineMap::nearest_to_coils`].
    ///
    /// # Errors
    /// When there are no whole rows, or the states do not fit into memory.
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
        let extent = self.field.extent();
        lose(&mut states, initial, |[radius, height]| {
            radius > 0.0 && libm::hypot(radius, height) <= extent
        });
        Ok(states)
    }

    /// How near each line comes to a point of a coil, in metres, over so many maps: the least of
    /// [`CoilField::distance`] after each step; NaN where it is lost.
    ///
    /// # Errors
    /// Those of [`LineMap::trajectories`].
    pub fn nearest_to_coils(&self, initial: &[f64], maps: usize) -> Result<Vec<f64>, Error> {
        let step = self.angle / self.steps as f64;
        let mut nearest = vec![f64::INFINITY; initial.len() / 2];
        let mut here = initial.to_vec();
        for _ in 0..maps {
            for number in 0..self.steps {
                here = self.part(number as f64 * step, step).trajectories(&here, 1)?;
                let (sin, cos) = Elementary::sin_cos(self.phi + (number + 1) as f64 * step);
                nearest.par_iter_mut().zip(here.par_chunks_exact(2)).for_each(
                    |(nearest, place)| {
                        let [radius, height] = [place[0], place[1]];
                        let found = self.field.distance([radius * cos, radius * sin, height]);
                        // A NaN stays.
                        *nearest =
                            if nearest.is_nan() || found >= *nearest { *nearest } else { found };
                    },
                );
            }
        }
        Ok(nearest)
    }

    /// dR/dφ and dZ/dφ at points of the half-plane `angle` beyond the section.
    pub(super) fn slopes(&self, points: &[f64], angle: f64) -> Vec<f64> {
        const BLOCK: usize = 64;
        let mut out = vec![0.0; points.len()];
        let blocks = points.par_chunks(BLOCK).zip(out.par_chunks_mut(BLOCK));
        blocks.for_each(|(points, out)| {
            on_independent_lanes(Slopes { field: self.field, phi: self.phi + angle, points, out });
        });
        out
    }

    /// The map over a part of this one, of one step, from an angle beyond the section on.
    pub(super) fn part(&self, from: f64, angle: f64) -> Self {
        Self { phi: self.phi + from, angle, steps: 1, ..*self }
    }

    /// The toroidal angle that lines are followed by, in radians: negative of a map [`LineMap::backwards`].
    pub fn angle(&self) -> f64 {
        self.angle
    }

    /// The image of a point and the Jacobian of the map there, by duals.
    pub fn with_jacobian(&self, place: [f64; 2]) -> ([f64; 2], [[f64; 2]; 2]) {
        self.image_and_jacobian(place)
    }

    /// The fixed point near a guess, by Newton's method: for a map over one period, the magnetic axis.
    ///
    /// # Errors
    /// [`Error::NoConvergence`] where it finds none; [`Error::Invalid`] where it ends at a coil, with the place.
    pub fn axis(&self, guess: [f64; 2]) -> Result<[f64; 2], Error> {
        /// The largest number of steps of Newton's method.
        const STEPS: usize = 20;
        let mut place = guess;
        let mut size = f64::NAN;
        for _ in 0..STEPS {
            let (image, [[a, b], [c, d]]) = self.with_jacobian(place);
            // (J − 1) δ = z − P(z).
            let (e, f) = (place[0] - image[0], place[1] - image[1]);
            let (a, d) = (a - 1.0, d - 1.0);
            let determinant = a * d - b * c;
            let step = [(e * d - b * f) / determinant, (a * f - c * e) / determinant];
            place = [place[0] + step[0], place[1] + step[1]];
            size = step.iter().map(|v| v.abs()).fold(0.0, max_or_nan);
            // In a coil steps are small too, since the field is not: there points do not stay.
            let misses = libm::hypot(e, f);
            if size <= 1e-13 * (1.0 + place[0].abs()) && misses <= 1e-9 * (1.0 + place[0].abs()) {
                return Ok(place);
            }
        }
        let what = format!("axis from (R, Z) = ({}, {})", guess[0], guess[1]);
        let (sin, cos) = Elementary::sin_cos(self.phi);
        let distance = self.field.distance([place[0] * cos, place[0] * sin, place[1]]);
        if distance < self.field.resolved_from() {
            let expected = format!(
                "a place off the coils: it is {distance:.3e} m from a coil, and the points along it stand for it \
                 from {:.3e} m on",
                self.field.resolved_from()
            );
            let found = format!("(R, Z) = ({:.6}, {:.6})", place[0], place[1]);
            return Err(Error::invalid("where the search ends", found, expected).with_place(what));
        }
        Err(Error::NoConvergence { what, iterations: STEPS, change: size })
    }
}

/// A map of a section by its field lines.
pub(super) trait SectionMap: Sync {
    /// The image of a point, for any number type.
    fn take<S: Elementary>(&self, place: &mut [S]);

    /// The image of a point and the Jacobian of the map there, by duals.
    fn image_and_jacobian(&self, place: [f64; 2]) -> ([f64; 2], [[f64; 2]; 2])
    where
        Self: Sized,
    {
        on_independent_lanes(Derivative { map: self, place })
    }
}

/// A map and its Jacobian at one point. It is a kernel so that fused multiply-adds are instructions of the
/// processor; it does not use the lanes.
struct Derivative<'a, M> {
    map: &'a M,
    place: [f64; 2],
}

impl<M: SectionMap> Kernel for Derivative<'_, M> {
    type Output = ([f64; 2], [[f64; 2]; 2]);

    #[inline(always)]
    fn run<V: Pack>(self) -> Self::Output {
        let [first, second] = self.place;
        let mut z: [Dual<f64, 2>; 2] = [Dual::variable(first, 0), Dual::variable(second, 1)];
        self.map.take(&mut z);
        ([z[0].re, z[1].re], [z[0].eps, z[1].eps])
    }
}

impl SectionMap for LineMap<'_> {
    #[inline(always)]
    fn take<S: Elementary>(&self, place: &mut [S]) {
        Tableau::DORMAND_PRINCE_8.of_field(&FromSection(*self), place, self.angle, self.steps);
    }
}

/// States, (T, M, 2) from those of one map on, become NaN from the first on that is not within; all of a line whose
/// initial point is not.
pub(super) fn lose(states: &mut [f64], initial: &[f64], within: impl Fn([f64; 2]) -> bool) {
    let row = initial.len();
    for k in (0..states.len()).step_by(2) {
        let lost = match k.checked_sub(row) {
            Some(before) => states[before].is_nan(),
            None => !within([initial[k], initial[k + 1]]),
        };
        // NaN is within nothing.
        if lost || !within([states[k], states[k + 1]]) {
            states[k..k + 2].fill(f64::NAN);
        }
    }
}

/// By how much halving a step divides the error of a method of order 8.
pub(super) const ORDER_8: f64 = 256.0;

/// The lines through some points, on lanes.
pub(super) struct Lines<'a, M> {
    pub(super) map: &'a M,
    pub(super) kept: usize,
    pub(super) initial: &'a [f64],
    /// All states of one line after another.
    pub(super) states: &'a mut [f64],
}

/// Slopes of lines, on lanes.
struct Slopes<'a> {
    field: &'a CoilField,
    phi: f64,
    points: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Slopes<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Pack>(self) {
        let Self { field, phi, points, out } = self;
        let (mut z, mut slope) = ([V::zero(); 2], [V::zero(); 2]);
        for (points, out) in points.chunks(2 * V::LANES).zip(out.chunks_mut(2 * V::LANES)) {
            load_groups(points, 2, &mut z);
            field.line(&z, phi, &mut slope);
            store_states(&slope, out, 0, 1);
        }
    }
}

impl<M: SectionMap> Kernel for Lines<'_, M> {
    type Output = ();

    #[inline(always)]
    fn run<V: Pack>(self) {
        let Self { map, kept, initial, states } = self;
        let mut lanes = vec![V::zero(); 2 * TOGETHER];
        let together = 2 * TOGETHER * V::LANES;
        for (initial, states) in initial.chunks(together).zip(states.chunks_mut(together * kept)) {
            let size = load_groups(initial, 2, &mut lanes);
            for number in 0..kept {
                let groups = states.chunks_mut(2 * V::LANES * kept);
                for (z, states) in lanes[..size].chunks_exact_mut(2).zip(groups) {
                    map.take(z);
                    store_states(z, states, number, kept);
                }
            }
        }
    }
}
