//! A part of a section around the magnetic axis, and the lines of force through it.

use super::field_line::ORDER_8;
use super::{LineMap, Region};
use crate::error::Error;
use crate::network::Pace;
use crate::phase::{AreaDensity, Change, Section};
use crate::scalar::{Elementary, max_or_nan};
use crate::system::{Coil, CoilField};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// The section and the field lines that are requested.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineRequest {
    /// φ of the section, in radians.
    pub phi: f64,
    /// The toroidal angle of a map, in radians: a period of the field, or several.
    pub angle: f64,
    /// The largest distance from the axis at which lines begin, outwards along R, in metres.
    pub reach: f64,
    /// (R, Z) near the axis; without it the axis is searched for.
    pub guess: Option<[f64; 2]>,
    /// The largest error of the map that is tolerated, in metres.
    pub error: f64,
}

/// A section of the field of coils around its magnetic axis, with enough points along each coil and enough steps of the
/// map for the requested error.
#[derive(Clone, Debug)]
pub struct LineSection {
    field: CoilField,
    /// The number of points along each coil that the field is summed over.
    points: usize,
    request: LineRequest,
    steps: usize,
    axis: [f64; 2],
    error: f64,
}

/// The number of points along each coil that is tried first.
const FEWEST_POINTS: usize = 120;
/// The largest number of points along each coil, before rounding up to the symmetry of the map.
const MOST_POINTS: usize = 2000;
/// By how much more each time.
const GROWTH: f64 = 1.5;
/// So many angles of a map are whole turns to within this, …
const WHOLE: f64 = 1e-9;
/// … at most so many: of three periods of a machine that has ten, ten.
const MOST_PARTS: usize = 100;
/// A map errs by less than what it differs from one of half as many steps by over this, a fourth of 2⁸.
const STEPS_GAIN: f64 = 64.0;
/// Steps of a map that find the axis.
const COARSE: usize = 24;
/// Lines by which a map is judged.
const JUDGES: usize = 8;

impl LineSection {
    /// The section of the field of these coils, which are all coils of a machine.
    ///
    /// # Errors
    /// When the request is out of range, no axis is found, it is near a coil or B_φ changes its sign between it and the
    /// reach, or 1,024 steps of a map or 2,000 points along a coil are too few for the error.
    pub fn new(coils: &[Coil], request: LineRequest) -> Result<Self, Error> {
        Self::new_at_pace(coils, request, &mut Pace::unbroken())
    }

    /// [`LineSection::new`] in parts, between which `pace` decides whether to go on: the same bits.
    ///
    /// # Errors
    /// Those of [`LineSection::new`]; [`Error::Stopped`].
    pub fn new_at_pace(
        coils: &[Coil],
        request: LineRequest,
        pace: &mut Pace<'_>,
    ) -> Result<Self, Error> {
        let mut pause = || pace.pause("field lines", 1);
        const LEAST_ERROR: f64 = 1e-13;
        /// Further round an angle is not known to the error of a map.
        const MOST_PHI: f64 = 1e3;
        Error::check_range("phi", request.phi, -MOST_PHI, MOST_PHI)?;
        Error::check_range("angle", request.angle, Error::LEAST_POSITIVE, f64::MAX)?;
        Error::check_range("reach", request.reach, Error::LEAST_POSITIVE, f64::MAX)?;
        Error::check_range("error", request.error, LEAST_ERROR, 1.0)?;
        for v in request.guess.iter().flatten() {
            Error::check_finite("axis", *v)?;
        }
        let modes = coils.iter().map(|coil| coil.cosines.len()).max().unwrap_or(0);
        let LineRequest { phi, angle, .. } = request;
        // Turned by the angle of a map, coils have to be the same point by point: else the area form at the end
        // of the map is another one than at its beginning, and lines drift.
        let is_whole = |turns: f64| (turns - turns.round()).abs() <= WHOLE * turns;
        let parts = (1..=MOST_PARTS).find(|parts| is_whole(*parts as f64 * angle / TAU));
        let parts = parts.ok_or_else(|| {
            let expected = format!("turns that are whole after {MOST_PARTS} maps or fewer");
            Error::invalid("angle", format!("{} turns", angle / TAU), expected)
        })?;
        let symmetric = |points: usize| points.next_multiple_of(parts);
        let mut points = symmetric(FEWEST_POINTS.max(2 * modes));
        let mut field = CoilField::new(coils, points)?;
        let mut axis = axis_of(&field, coils, &request, &mut pause)?;
        let starts = |axis| starts(axis, request.reach, JUDGES);
        check_kept(&LineMap::new(&field, phi, angle, COARSE)?, axis, &starts(axis))?;
        let toroidal: f64 = field.cylindrical(axis[0], phi, axis[1])[1];
        // What no number of points along coils resolves, before steps are found for lines there.
        let finest = CoilField::new(coils, symmetric(MOST_POINTS))?;
        for place in starts(axis).chunks_exact(2) {
            finest
                .check_at([place[0], place[1]], phi, toroidal.signum())
                .map_err(|e| e.with_place("reach"))?;
        }
        // What steps half as long change is the error of the longer ones, by 2⁸ more than theirs.
        let change = request.error * STEPS_GAIN;
        pause()?;
        let (map, _) = LineMap::calibrated(&field, phi, angle, &starts(axis), change)?;
        let mut steps = map.steps();
        pause()?;
        let places = judged(&map, &starts(axis))?;
        pause()?;
        let mut images = |map: &LineMap<'_>| -> Result<Vec<f64>, Error> {
            let mut images = Vec::with_capacity(places.len());
            for part in places.chunks(4 * JUDGES) {
                images.extend(map.trajectories(part, 1)?);
                pause()?;
            }
            Ok(images)
        };
        let mut before = images(&map)?;
        loop {
            let more = symmetric((points as f64 * GROWTH) as usize);
            let finer = CoilField::new(coils, more)?;
            let map = LineMap::new(&finer, phi, angle, steps)?;
            let after = images(&map)?;
            let pairs = after.iter().zip(&before);
            let moved = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
            // Of so many more points the error is below what fewer had by far.
            if moved <= request.error {
                break;
            }
            if more > MOST_POINTS {
                let ends = places.chunks_exact(2).zip(after.chunks_exact(2));
                if let Some((place, _)) = { ends }.find(|(_, end)| !end[0].is_finite()) {
                    return Err(lost_from([place[0], place[1]], axis));
                }
                let what = "the field of coils".into();
                return Err(Error::NoConvergence { what, iterations: more, change: moved });
            }
            (points, before, field) = (more, after, finer);
        }
        axis = LineMap::new(&field, phi, angle, steps)?.axis(axis)?;
        pause()?;
        let all = starts(axis);
        // Also near enough to the coils for these lines.
        let (sin, cos) = Elementary::sin_cos(phi);
        let resolves = |field: &CoilField| {
            let places = all.chunks_exact(2).map(|z| [z[0] * cos, z[0] * sin, z[1]]);
            let mut distances = places.map(|place| field.distance(place));
            distances.all(|distance| distance >= field.resolved_from())
        };
        while !resolves(&field) && points < MOST_POINTS {
            let more = symmetric((points as f64 * GROWTH) as usize);
            points = if more < MOST_POINTS { more } else { symmetric(MOST_POINTS) };
            field = CoilField::new(coils, points)?;
            pause()?;
        }
        let (map, error) = LineMap::calibrated(&field, phi, angle, &all, change)?;
        steps = if map.steps() > steps { map.steps() } else { steps };
        let toroidal: f64 = field.cylindrical(axis[0], phi, axis[1])[1];
        for place in all.chunks_exact(2) {
            field.check_at([place[0], place[1]], phi, toroidal.signum())?;
        }
        Ok(Self { field, points, request, steps, axis, error })
    }

    /// The same section for other coils close to these, with the same numbers of points and steps. Their axis is found
    /// from this one, and the error of the map from half as many steps.
    ///
    /// # Errors
    /// Those of [`CoilField::new`], [`LineMap::axis`] and [`LineSection::new`].
    pub fn with_coils(&self, coils: &[Coil]) -> Result<Self, Error> {
        let field = CoilField::new(coils, self.points)?;
        let mut out = Self { field, ..self.clone() };
        out.axis = out.map().axis(self.axis)?;
        let all = starts(out.axis, self.request.reach, JUDGES);
        check_kept(&out.map(), out.axis, &all)?;
        let images = [self.steps, self.steps.div_ceil(2)]
            .map(|steps| out.map().with_steps(steps).trajectories(&all, 1));
        let [fine, coarse] = images;
        let pairs = fine?.into_iter().zip(coarse?);
        out.error = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan) / ORDER_8;
        let sign: f64 = out.field.cylindrical(out.axis[0], self.request.phi, out.axis[1])[1];
        for place in all.chunks_exact(2) {
            out.field.check_at([place[0], place[1]], self.request.phi, sign.signum())?;
        }
        Ok(out)
    }

    /// The number of maps of which one is searched for lines that come near coils: a search takes as long as following
    /// the lines.
    pub const LOOKED_AT: usize = 5;

    /// Whether each line from these points, (..., 2), stays over one map where the field is that of the coils: as far
    /// from them as points along them resolve. Of a line that is lost it is not so.
    ///
    /// # Errors
    /// Those of [`LineMap::nearest_to_coils`].
    pub fn are_resolved(&self, points: &[f64]) -> Result<Vec<bool>, Error> {
        let resolved = self.field.resolved_from();
        let nearest = self.map().nearest_to_coils(points, 1)?;
        Ok(nearest.into_iter().map(|near| near >= resolved).collect())
    }

    /// The magnetic field of the coils.
    pub fn field(&self) -> &CoilField {
        &self.field
    }

    /// The request that the section was made for.
    pub fn request(&self) -> &LineRequest {
        &self.request
    }

    /// The number of points along each coil that the field is summed over.
    pub fn points(&self) -> usize {
        self.points
    }

    /// The magnetic axis, (R, Z).
    pub fn axis(&self) -> [f64; 2] {
        self.axis
    }

    /// The number of turns about the axis that a nearby line makes in one map, in the mean over many maps, positive
    /// from R towards Z; NaN where the axis is hyperbolic. The Jacobian of the map has it up to whole turns, which are
    /// counted along the steps of the map: any nearby line turns by less than half a turn more or less in one map.
    pub fn turns(&self) -> f64 {
        let map = self.map();
        let (_, [[a, _], [c, d]]) = map.with_jacobian(self.axis);
        let turns = libm::acos(0.5 * (a + d)) / TAU;
        let turns = if c < 0.0 { -turns } else { turns };
        let step = map.angle() / map.steps() as f64;
        let (mut place, mut beside, mut angle) = (self.axis, [1.0, 0.0], 0.0);
        for number in 0..map.steps() {
            let (image, [[a, b], [c, d]]) =
                map.part(number as f64 * step, step).with_jacobian(place);
            let [x, y] = beside;
            beside = [a * x + b * y, c * x + d * y];
            let [u, v] = beside;
            angle += libm::atan2(x * v - y * u, x * u + y * v);
            place = image;
        }
        turns + (angle / TAU - turns).round()
    }

    /// The error of the map on lines between the axis and the reach, in metres.
    pub fn error(&self) -> f64 {
        self.error
    }

    /// The map of field lines from the section to its next image.
    pub fn map(&self) -> LineMap<'_> {
        let LineRequest { phi, angle, .. } = self.request;
        LineMap::new(&self.field, phi, angle, self.steps).expect("the request was checked")
    }

    /// The points at which lines begin, (R, Z) in rows: outwards from the axis to the reach, with equal areas between
    /// successive circles about the axis through them.
    pub fn starts(&self, lines: usize) -> Vec<f64> {
        starts(self.axis, self.request.reach, lines)
    }

    /// The canonical chart of a box slightly wider than these points, for the area density ρ = |B_φ| in tesla: x = R,
    /// y = Z. Its scale is the value on the axis.
    ///
    /// # Errors
    /// Those of [`AreaDensity::of_function`]: where B_φ vanishes in the box.
    pub fn chart(&self, points: &[f64]) -> Result<Section, Error> {
        Ok(Section::of_plane(self.density(points)?))
    }

    /// [`LineSection::chart`] for a field that depends on controls, whose values here are `origin`. Each entry of
    /// `controls` has the coils with the currents that one unit of the control adds, and the largest change of the
    /// control.
    ///
    /// # Errors
    /// Those of [`LineSection::chart`], [`CoilField::new`] and [`Section::of_controls`].
    pub fn chart_by_controls(
        &self,
        points: &[f64],
        controls: &[(Vec<Coil>, f64)],
        origin: &[f64],
    ) -> Result<Section, Error> {
        let [r, z] = self.axis;
        let sign = self.toroidal_field(r, z).signum();
        let field = |(coils, _): &(Vec<Coil>, f64)| CoilField::new(coils, self.points);
        let fields: Vec<CoilField> = controls.iter().map(field).collect::<Result<_, _>>()?;
        let densities: Vec<_> = fields
            .iter()
            .map(|field| move |r: f64, z: f64| sign * self.toroidal(field, r, z))
            .collect();
        let both = densities.iter().zip(controls);
        let changes: Vec<Change<'_>> = both
            .map(|(density, (_, furthest))| (density as &dyn Fn(f64, f64) -> f64, *furthest))
            .collect();
        Section::of_controls(vec![Some(self.density(points)?.with_changes(&changes)?)], origin)
    }

    /// B_φ at (R, Z) of the section, in tesla.
    pub fn toroidal_field(&self, r: f64, z: f64) -> f64 {
        self.toroidal(&self.field, r, z)
    }

    /// B_φ of a field on the section.
    fn toroidal(&self, field: &CoilField, r: f64, z: f64) -> f64 {
        field.cylindrical(r, self.request.phi, z)[1]
    }

    fn density(&self, points: &[f64]) -> Result<AreaDensity, Error> {
        /// By so much of its extent the box is wider than that of the points.
        const WIDER: f64 = 0.08;
        Error::check_rows("points of a section", points.len(), 2)?;
        let none = || Error::invalid("points of a section", "none", "at least one");
        let Region { low, high } = Region::around(2, [points]).ok_or_else(none)?.widened(WIDER);
        let at_axis = self.toroidal_field(self.axis[0], self.axis[1]);
        let density = |r: f64, z: f64| at_axis.signum() * self.toroidal_field(r, z);
        let (low, high) = ([low[0], low[1]], [high[0], high[1]]);
        AreaDensity::of_function(density, low, high, at_axis.abs())
    }
}

/// The turns k ± α of a map about a fixed point with this trace, 2cos 2πα = Tr M, that are nearest to `near`, and the
/// sign of α. NaN where lines leave it.
pub fn turns_of_trace(trace: f64, near: f64) -> (f64, f64) {
    let part = libm::acos(0.5 * trace) / TAU;
    let [plus, minus] = [1.0, -1.0].map(|sign| ((near - sign * part).round() + sign * part, sign));
    if (minus.0 - near).abs() < (plus.0 - near).abs() { minus } else { plus }
}

fn starts(axis: [f64; 2], reach: f64, lines: usize) -> Vec<f64> {
    let radius = |k: usize| reach * libm::sqrt(k as f64 / lines as f64);
    (1..=lines).flat_map(|k| [axis[0] + radius(k), axis[1]]).collect()
}

/// Fails where a line is lost within one map.
fn check_kept(map: &LineMap<'_>, axis: [f64; 2], starts: &[f64]) -> Result<(), Error> {
    let images = map.trajectories(starts, 1)?;
    let pairs = starts.chunks_exact(2).zip(images.chunks_exact(2));
    match pairs.into_iter().find(|(_, image)| !image[0].is_finite()) {
        None => Ok(()),
        Some((start, _)) => Err(lost_from([start[0], start[1]], axis)),
    }
}

fn lost_from([r, z]: [f64; 2], axis: [f64; 2]) -> Error {
    let found = format!("a line from (R, Z) = ({r:.6}, {z:.6}) that is lost");
    let [radius, height] = axis;
    let expected =
        format!("a shorter one: about the axis at ({radius:.6}, {height:.6}) lines stay");
    Error::invalid("reach", found, expected)
}

/// Points along a few lines, where fields of more and fewer points are compared: they go round the section. Those of
/// lines that are lost in the next map, later than in the first one, which was calibrated, are none of them.
fn judged(map: &LineMap<'_>, starts: &[f64]) -> Result<Vec<f64>, Error> {
    const MAPS: usize = 9;
    let mut points = starts.to_vec();
    points.extend(map.trajectories(starts, MAPS)?);
    let next = points[starts.len()..].chunks_exact(2);
    let stay = points.chunks_exact(2).zip(next).filter(|(_, next)| next[0].is_finite());
    Ok(stay.flat_map(|(z, _)| z).copied().collect())
}

/// The axis near the guess, or the one nearest to the middle of the coils about which lines turn.
fn axis_of(
    field: &CoilField,
    coils: &[Coil],
    request: &LineRequest,
    pause: &mut dyn FnMut() -> Result<(), Error>,
) -> Result<[f64; 2], Error> {
    /// Places on either side of the middle.
    const PLACES: i32 = 12;
    let map = LineMap::new(field, request.phi, request.angle, COARSE)?;
    if let Some(guess) = request.guess {
        return map.axis(guess);
    }
    let (mut low, mut high) = (f64::INFINITY, 0.0f64);
    for coil in coils {
        for k in 0..FEWEST_POINTS {
            let (point, _) = coil.point_and_tangent(k as f64 / FEWEST_POINTS as f64);
            let radius = libm::hypot(point[0], point[1]);
            // no NaN: coils were checked by the field
            (low, high) = (f64::min(low, radius), f64::max(high, radius));
        }
    }
    let (middle, step) = (0.5 * (low + high), 0.5 * (high - low) / f64::from(PLACES + 1));
    let offsets = (0..=2 * PLACES).map(|k| if k % 2 == 0 { k / 2 } else { -(k + 1) / 2 });
    for offset in offsets {
        pause()?;
        let guess = [middle + step * f64::from(offset), 0.0];
        let Ok(place) = map.axis(guess) else { continue };
        let (_, [[a, _], [_, d]]) = map.with_jacobian(place);
        let within = place[0] > low && place[0] < high;
        if within && (a + d).abs() < 2.0 {
            return Ok(place);
        }
    }
    let found = format!("none at Z = 0 between R = {low:.4} and {high:.4} m");
    Err(Error::invalid("magnetic axis", found, "one about which lines turn, or a guess of it"))
}
