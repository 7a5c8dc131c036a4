//! Magnetic fields of coils by the law of Biot and Savart, and the field lines in them.

use crate::error::Error;
use crate::scalar::{Elementary, max_or_nan};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A closed line that carries a current: x(t) = Σ_k c_k cos 2πkt + s_k sin 2πkt, 0 ≤ t < 1, in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Coil {
    /// c_k of x, y and z, k from 0.
    pub cosines: Vec<[f64; 3]>,
    /// s_k, the same number; s₀ has no effect.
    pub sines: Vec<[f64; 3]>,
    /// Its current in the direction of growing t, in amperes.
    pub current: f64,
    /// The width w of the current, in metres: 0 for a filament. A current with a width, such as that of a plasma, is
    /// spread around the line: across a straight one as w²/π(s² + w²)² at a distance s.
    pub width: f64,
}

impl Coil {
    /// The trigonometric interpolation of points of a closed curve at equidistant values of a parameter. For a smooth
    /// curve its error falls faster than any power of the number of points.
    ///
    /// # Errors
    /// [`Error::CountOutOfRange`] of fewer than three points, [`Error::OutOfRange`] of a number that is not finite,
    /// [`Error::Invalid`] when the last point is the first one again, or points go to and fro.
    pub fn of_points(points: &[[f64; 3]], current: f64) -> Result<Self, Error> {
        let count = points.len();
        Error::check_count_range("points of a coil", count, 3, MOST_POINTS)?;
        for v in points.iter().flatten().chain([&current]) {
            Error::check_finite("coil", *v)?;
        }
        let distance = |a: usize, b: usize| {
            libm::sqrt((0..3).map(|axis| (points[a][axis] - points[b][axis]).powi(2)).sum::<f64>())
        };
        let length: f64 = (1..count).map(|k| distance(k - 1, k)).sum();
        if distance(0, count - 1) <= SAME_POINT * length / (count - 1) as f64 {
            let found = "a last point that is the first one again";
            let expected = "each point once: the curve closes by itself";
            return Err(Error::invalid("points of a coil", found, expected));
        }
        let modes = count / 2 + 1;
        let (mut cosines, mut sines) = (vec![[0.0; 3]; modes], vec![[0.0; 3]; modes]);
        for k in 0..modes {
            // The highest of an even number of points is its own mirror image.
            let share = if k == 0 || 2 * k == count { 1.0 } else { 2.0 } / count as f64;
            for (number, point) in points.iter().enumerate() {
                let (s, c) =
                    Elementary::sin_cos(TAU * ((k * number) % count) as f64 / count as f64);
                for axis in 0..3 {
                    cosines[k][axis] += share * c * point[axis];
                    sines[k][axis] += share * s * point[axis];
                }
            }
        }
        let out = Self { cosines, sines, current, width: 0.0 };
        // Not of the few points of a triangle or the like, whose highest mode is a low one.
        let share = out.highest_modes();
        if count >= SMOOTH_FROM && share > MOST_HIGHEST {
            let found = format!("a share of {share:.1e} that goes to and fro from point to point");
            let expected = format!(
                "{MOST_HIGHEST} at most: points along a smooth curve, in order, and more of them at corners"
            );
            return Err(Error::invalid("points of a coil", found, expected));
        }
        Ok(out)
    }

    /// The largest amplitude of its highest eighth of modes, as a share of the largest of all.
    fn highest_modes(&self) -> f64 {
        let amplitude = |k: usize| {
            let parts = self.cosines[k].iter().chain(&self.sines[k]);
            libm::sqrt(parts.map(|v| v * v).sum::<f64>())
        };
        let largest = |from: usize| (from..self.cosines.len()).map(amplitude).fold(0.0, max_or_nan);
        largest(self.cosines.len() * 7 / 8) / largest(1)
    }

    /// The point x(t) of the coil and dx/dt, in metres.
    pub fn point_and_tangent(&self, t: f64) -> ([f64; 3], [f64; 3]) {
        let (mut point, mut tangent) = ([0.0; 3], [0.0; 3]);
        for (k, (cosine, sine)) in self.cosines.iter().zip(&self.sines).enumerate() {
            let turns = TAU * k as f64;
            let (s, c) = Elementary::sin_cos(turns * t);
            for axis in 0..3 {
                point[axis] += c * cosine[axis] + s * sine[axis];
                tangent[axis] += turns * (c * sine[axis] - s * cosine[axis]);
            }
        }
        (point, tangent)
    }

    /// The same coil, turned about the z axis by an angle; with `flipped`, half a turn about the x axis comes first,
    /// and the current runs the other way: the image under the symmetry of a stellarator.
    fn turned(&self, angle: f64, flipped: bool) -> Self {
        let (s, c) = Elementary::sin_cos(angle);
        let sign = if flipped { -1.0 } else { 1.0 };
        let turn = |modes: &[[f64; 3]]| -> Vec<[f64; 3]> {
            modes
                .iter()
                .map(|[x, y, z]| [c * x - s * sign * y, s * x + c * sign * y, sign * z])
                .collect()
        };
        Self {
            cosines: turn(&self.cosines),
            sines: turn(&self.sines),
            current: sign * self.current,
            width: self.width,
        }
    }

    /// A circle about the z axis.
    fn ring(radius: f64, height: f64, current: f64, width: f64) -> Self {
        Self {
            cosines: vec![[0.0, 0.0, height], [radius, 0.0, 0.0]],
            sines: vec![[0.0; 3], [0.0, radius, 0.0]],
            current,
            width,
        }
    }
}

/// That an image of a coil is another one that is given, too.
fn of_another((period, flipped): (usize, bool), first: usize, second: usize) -> Error {
    let (found, expected) = match (period, flipped) {
        (0, false) => (
            format!("coil {first} and coil {second} on one curve"),
            "each curve once, with the sum of its currents",
        ),
        _ => (
            format!("coil {first}, an image of which is coil {second}"),
            "the coils of one field period, or of half of one with stellarator symmetry: the others are their images \
             (a file of the whole machine has one period and no such symmetry)",
        ),
    };
    Error::invalid("coils", found, expected)
}

/// A coil and points along it, among which the place on it that is nearest to another point is looked for.
struct Outline<'a> {
    coil: &'a Coil,
    points: Vec<[f64; 3]>,
    /// How far another curve that is the same may be from it, in metres.
    near: f64,
}

impl<'a> Outline<'a> {
    fn of(coil: &'a Coil) -> Self {
        /// Points for each mode: from the nearest of them Newton's method finds the nearest place.
        const POINTS: usize = 16;
        const FEWEST: usize = 256;
        const MOST: usize = 4096;
        /// Of the size of the coil.
        const SAME: f64 = 1e-5;
        let count = (POINTS * coil.cosines.len()).clamp(FEWEST, MOST);
        let points: Vec<[f64; 3]> =
            (0..count).map(|k| coil.point_and_tangent(k as f64 / count as f64).0).collect();
        let spread = |axis: usize| {
            let of = |sign: f64| {
                let values = points.iter().map(|point| sign * point[axis]);
                values.fold(f64::NEG_INFINITY, max_or_nan)
            };
            of(1.0) + of(-1.0)
        };
        let size = (0..3).map(spread).fold(0.0, max_or_nan);
        Self { coil, points, near: SAME * size }
    }

    /// The direction of the coil where it is nearest to a point, and the distance.
    fn nearest(&self, point: [f64; 3]) -> ([f64; 3], f64) {
        const STEPS: usize = 6;
        let from = |place: [f64; 3]| [0, 1, 2].map(|axis| point[axis] - place[axis]);
        let product = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let square = |k: usize| product(from(self.points[k]), from(self.points[k]));
        let count = self.points.len();
        let first = (1..count).fold(0, |best, k| if square(k) < square(best) { k } else { best });
        let mut t = first as f64 / count as f64;
        let (mut place, mut tangent) = self.coil.point_and_tangent(t);
        for _ in 0..STEPS {
            let speed = product(tangent, tangent);
            t += if speed > 0.0 { product(from(place), tangent) / speed } else { 0.0 };
            (place, tangent) = self.coil.point_and_tangent(t);
        }
        (tangent, libm::sqrt(product(from(place), from(place))))
    }

    /// Whether another coil is the same curve with the same width; then whether it has the same direction.
    fn same_direction(&self, other: &Coil) -> Option<bool> {
        /// Parts of the golden section of a turn, which no mode has for a period.
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let tested = (2 * other.cosines.len() + 1).clamp(67, 257);
        let at = |k: usize| other.point_and_tangent((k as f64 * GOLDEN).fract());
        let is_on = |k: usize| self.nearest(at(k).0).1 <= self.near;
        if self.coil.width != other.width || !(0..tested).all(is_on) {
            return None;
        }
        let (point, along) = at(0);
        let (tangent, _) = self.nearest(point);
        Some((0..3).map(|axis| tangent[axis] * along[axis]).sum::<f64>() > 0.0)
    }
}

/// The distance of the last point of a coil from the first, over the mean distance of points, below which they are one.
const SAME_POINT: f64 = 1e-6;
/// Fewer points of a coil than this are not judged by how smooth they are.
const SMOOTH_FROM: usize = 16;
/// The largest share of the highest mode of points along a smooth curve.
const MOST_HIGHEST: f64 = 0.01;

/// A coil is of no more points or modes than this.
const MOST_POINTS: usize = 1 << 16;

/// The coils that generate a machine, and its symmetries.
#[derive(Clone, Debug, PartialEq)]
pub struct CoilSet {
    /// The coils that are given.
    pub coils: Vec<Coil>,
    /// The number N of field periods: a rotation by 2π/N is a symmetry of the machine.
    pub periods: u32,
    /// Whether half a turn about the x axis, with all currents reversed, is a symmetry of the machine.
    pub stellarator_symmetric: bool,
}

impl CoilSet {
    /// With these currents added, one for each coil that is given.
    ///
    /// # Errors
    /// [`Error::WrongCount`].
    pub fn with_more(mut self, currents: &[f64]) -> Result<Self, Error> {
        Error::check_count("currents", self.coils.len(), currents.len())?;
        for (coil, more) in self.coils.iter_mut().zip(currents) {
            coil.current += more;
        }
        Ok(self)
    }

    /// With these currents, one for each coil that is given.
    ///
    /// # Errors
    /// [`Error::WrongCount`].
    pub fn with_currents(mut self, currents: &[f64]) -> Result<Self, Error> {
        self.coils.iter_mut().for_each(|coil| coil.current = 0.0);
        self.with_more(currents)
    }

    /// All coils of the machine: those that are given and carry a current, and their images under its symmetries. A
    /// coil that is its own image, such as a ring about the z axis, is there once.
    ///
    /// # Errors
    /// When there is no coil with a current, or no or too many periods; [`Error::Invalid`] when the image of a coil is
    /// another one that is given, so that coils would be there several times, or a coil is given twice.
    pub fn all(&self) -> Result<Vec<Coil>, Error> {
        Error::check_count_range("periods", self.periods as usize, 1, 1000)?;
        let carry: Vec<(usize, &Coil)> =
            self.coils.iter().enumerate().filter(|(_, coil)| coil.current != 0.0).collect();
        let outlines: Vec<Outline<'_>> = carry.iter().map(|(_, coil)| Outline::of(coil)).collect();
        let periods = self.periods as usize;
        let flips = if self.stellarator_symmetric { &[false, true][..] } else { &[false] };
        let elements: Vec<(usize, bool)> =
            (0..periods).flat_map(|period| flips.iter().map(move |flip| (period, *flip))).collect();
        let mut all = Vec::new();
        for (own, (number, coil)) in carry.iter().enumerate() {
            let image = |&(period, flipped): &(usize, bool)| {
                coil.turned(TAU * period as f64 / periods as f64, flipped)
            };
            // The elements of the symmetry under which it is its own image.
            let mut fixed = Vec::new();
            for element in &elements {
                let image = image(element);
                for (other, outline) in outlines.iter().enumerate() {
                    let Some(same_direction) = outline.same_direction(&image) else { continue };
                    if other != own {
                        return Err(of_another(*element, number + 1, carry[other].0 + 1));
                    }
                    if same_direction != (coil.current * image.current > 0.0) {
                        let found = format!(
                            "coil {}, an image of which is itself against its current",
                            number + 1
                        );
                        let expected = "coils whose currents have the symmetry of the machine";
                        return Err(Error::invalid("coils", found, expected));
                    }
                    fixed.push(*element);
                }
            }
            // Of images that are the same curve the first.
            let mut made: Vec<(usize, bool)> = Vec::new();
            for &(period, flipped) in &elements {
                let is_known = made.iter().any(|&(earlier, turned)| {
                    // The element that takes the earlier image to this one, before both are made.
                    let by = match turned {
                        false => period + periods - earlier,
                        true => earlier + periods - period,
                    };
                    fixed.contains(&(by % periods, flipped != turned))
                });
                if !is_known {
                    made.push((period, flipped));
                    all.push(image(&(period, flipped)));
                }
            }
        }
        match all.is_empty() {
            true => Err(Error::invalid("coils", "no coil with a current", "at least one")),
            false => Ok(all),
        }
    }
}

/// The coils of a torsatron by formula: helical windings, and a pair of rings that cancel their vertical field.
///
/// At the toroidal angle φ, winding j of l is at θ = (N/l)φ + 2πj/l on the circle of radius a about R₀:
/// R = R₀ + a cos θ, Z = −a sin θ. The rings lie at equal heights above and below the midplane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Torsatron {
    /// l, the number of windings.
    pub windings: u32,
    /// The number N of field periods, a multiple of l.
    pub periods: u32,
    /// The major radius R₀ of the torus, in metres.
    pub major_radius: f64,
    /// The minor radius a of the torus, in metres.
    pub minor_radius: f64,
    /// The current of each winding, in amperes.
    pub current: f64,
    /// The radius of the rings, in metres.
    pub ring_radius: f64,
    /// The height of one ring above the midplane, in metres, and of the other below it.
    pub ring_height: f64,
    /// The current of a ring, as a share of that of a winding.
    pub ring_share: f64,
}

impl Default for Torsatron {
    /// l = 2, N = 10, with sizes near those of the Large Helical Device: its axis is at R = 3.958 m, with surfaces to
    /// some 0.19 m outside of it; |ι| is 0.61 beside it and grows outwards, to 0.73 at 0.16 m.
    fn default() -> Self {
        Self {
            windings: 2,
            periods: 10,
            major_radius: 3.9,
            minor_radius: 0.975,
            current: 5e6,
            ring_radius: 5.55,
            ring_height: 1.55,
            ring_share: -0.6,
        }
    }
}

impl Torsatron {
    /// Makes the coils of the machine.
    ///
    /// # Errors
    /// When N is no multiple of l, or a size is not positive or a > R₀.
    pub fn coils(&self) -> Result<CoilSet, Error> {
        Error::check_count_range("coils.windings", self.windings as usize, 1, 10)?;
        Error::check_count_range("coils.periods", self.periods as usize, 1, 1000)?;
        if !self.periods.is_multiple_of(self.windings) {
            let expected = format!("a multiple of {} windings", self.windings);
            return Err(Error::invalid("coils.periods", self.periods, expected));
        }
        for (name, value, most) in [
            ("coils.major_radius", self.major_radius, f64::MAX),
            ("coils.minor_radius", self.minor_radius, self.major_radius),
            ("coils.ring_radius", self.ring_radius, f64::MAX),
        ] {
            Error::check_range(name, value, Error::LEAST_POSITIVE, most)?;
        }
        for (name, value) in [
            ("coils.current", self.current),
            ("coils.ring_height", self.ring_height),
            ("coils.ring_share", self.ring_share),
        ] {
            Error::check_finite(name, value)?;
        }
        let winds = f64::from(self.periods / self.windings);
        // Twice the highest mode, and more.
        let samples = 4 * (self.periods / self.windings) as usize + 8;
        let mut coils = Vec::new();
        for winding in 0..self.windings {
            let points: Vec<[f64; 3]> = (0..samples)
                .map(|k| {
                    let phi = TAU * k as f64 / samples as f64;
                    let shift = TAU * f64::from(winding) / f64::from(self.windings);
                    let (s, c) = Elementary::sin_cos(winds * phi + shift);
                    let radius = self.major_radius + self.minor_radius * c;
                    let (sin, cos) = Elementary::sin_cos(phi);
                    [radius * cos, radius * sin, -self.minor_radius * s]
                })
                .collect();
            coils.push(Coil::of_points(&points, self.current)?);
        }
        for height in [self.ring_height, -self.ring_height] {
            let current = self.ring_share * self.current;
            coils.push(Coil::ring(self.ring_radius, height, current, 0.0));
        }
        // Windings and rings are all there; turning by a period exchanges the windings.
        Ok(CoilSet { coils, periods: 1, stellarator_symmetric: false })
    }
}

/// The coils of a tokamak by formula: circular coils in poloidal planes, whose number makes the ripple of the toroidal
/// field, and the current of the plasma, a ring with a width.
///
/// Coil j of N is the circle R = R₀ + b cos t, Z = −b sin t at φ = 2πj/N; its current makes B_φ positive. The current I
/// of a plasma of radius R₁ and width w gives |ι| = μ₀I R₁/2πB(s² + w²) at a distance s from its middle, up to terms in
/// w/R₁.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Tokamak {
    /// N, the number of coils in poloidal planes.
    pub coils: u32,
    /// R₀, the distance of their middles from the z axis, in metres.
    pub major_radius: f64,
    /// b, their radius, in metres.
    pub minor_radius: f64,
    /// The current of each of them, in amperes.
    pub current: f64,
    /// R₁, the radius of the ring of the plasma's current, in metres.
    pub plasma_radius: f64,
    /// w, its width, in metres.
    pub plasma_width: f64,
    /// I, the current of the plasma, in amperes.
    pub plasma_current: f64,
}

impl Default for Tokamak {
    /// 18 coils, 3 T at R = 3 m, a plasma of 1 MA: its axis is at R = 3.125 m.
    fn default() -> Self {
        Self {
            coils: 18,
            major_radius: 3.2,
            minor_radius: 1.9,
            current: 2.5e6,
            plasma_radius: 3.0,
            plasma_width: 0.5,
            plasma_current: 1e6,
        }
    }
}

impl Tokamak {
    /// Its coils, the plasma last.
    ///
    /// # Errors
    /// When a number or a size is not positive, or coils reach beyond the z axis.
    pub fn coils(&self) -> Result<CoilSet, Error> {
        Error::check_count_range("coils.coils", self.coils as usize, 1, 1000)?;
        for (name, value, most) in [
            ("coils.major_radius", self.major_radius, f64::MAX),
            ("coils.minor_radius", self.minor_radius, self.major_radius),
            ("coils.plasma_radius", self.plasma_radius, f64::MAX),
            ("coils.plasma_width", self.plasma_width, f64::MAX),
        ] {
            Error::check_range(name, value, Error::LEAST_POSITIVE, most)?;
        }
        for (name, value) in
            [("coils.current", self.current), ("coils.plasma_current", self.plasma_current)]
        {
            Error::check_finite(name, value)?;
        }
        let upright = Coil {
            cosines: vec![[self.major_radius, 0.0, 0.0], [self.minor_radius, 0.0, 0.0]],
            sines: vec![[0.0; 3], [0.0, 0.0, -self.minor_radius]],
            current: self.current,
            width: 0.0,
        };
        let at = |number: u32| TAU * f64::from(number) / f64::from(self.coils);
        let mut coils: Vec<Coil> =
            (0..self.coils).map(|number| upright.turned(at(number), false)).collect();
        coils.push(Coil::ring(self.plasma_radius, 0.0, self.plasma_current, self.plasma_width));
        // All of them are there.
        Ok(CoilSet { coils, periods: 1, stellarator_symmetric: false })
    }
}

/// One point of the quadrature along a coil.
#[derive(Clone, Copy, Debug)]
struct Element {
    at: [f64; 3],
    /// μ₀I/4π dx/dt Δt, in tesla metres squared.
    current: [f64; 3],
    /// The square w² of the width of the current, in square metres.
    width: f64,
}

/// The magnetic field of coils, in tesla, by the trapezoidal rule along each coil. Its error falls
/// exponentially with the number of points, once they are closer to one another than the place is to the coil.
///
/// B(r) = μ₀/4π Σ I ∮ dx × (r − x)/(|r − x|² + w²)^{3/2}, the curl of A(r) = μ₀/4π Σ I ∮ dx/(|r − x|² + w²)^{1/2}.
///
/// Source of the error: Trefethen and Weideman, <https://doi.org/10.1137/130932132>.
#[derive(Clone, Debug)]
pub struct CoilField {
    elements: Vec<Element>,
    /// The longest distance of neighbouring points along a coil.
    spacing: f64,
}

impl CoilField {
    /// μ₀/4π in tesla metres per ampere: since 2019 it equals 10⁻⁷ to nine digits only.
    const MU_0_OVER_4_PI: f64 = 1e-7;

    /// The field of these coils, with this number of points along each.
    ///
    /// # Errors
    /// When there is no coil, the points are too few for the modes of one, a number is not finite, or coils carry no
    /// current.
    pub fn new(coils: &[Coil], points: usize) -> Result<Self, Error> {
        Error::check_count_range("points along a coil", points, 3, MOST_POINTS)?;
        let (mut elements, mut spacing) = (Vec::new(), 0.0);
        for (number, coil) in coils.iter().enumerate() {
            let place = || format!("coil {}", number + 1);
            Error::check_count("sines", coil.cosines.len(), coil.sines.len())
                .map_err(|e| e.with_place(place()))?;
            let order = coil.cosines.len().saturating_sub(1);
            if points <= 2 * order {
                let expected = format!("more than {}, twice the modes of {}", 2 * order, place());
                return Err(Error::invalid("points along a coil", points, expected));
            }
            let numbers = coil.cosines.iter().chain(&coil.sines).flatten();
            for v in numbers.chain([&coil.current, &coil.width]) {
                Error::check_finite("coil", *v).map_err(|e| e.with_place(place()))?;
            }
            if coil.current == 0.0 {
                continue;
            }
            for k in 0..points {
                let (at, tangent) = coil.point_and_tangent(k as f64 / points as f64);
                let share = Self::MU_0_OVER_4_PI * coil.current / points as f64;
                let length = libm::sqrt(tangent.iter().map(|v| v * v).sum());
                spacing = max_or_nan(spacing, length / points as f64);
                let width = coil.width * coil.width;
                elements.push(Element { at, current: tangent.map(|v| v * share), width });
            }
        }
        if elements.is_empty() {
            return Err(Error::invalid("coils", "no coil with a current", "at least one"));
        }
        Ok(Self { elements, spacing })
    }

    /// The largest distance of a point of a coil from the origin.
    pub fn extent(&self) -> f64 {
        let squares = self.elements.iter().map(|e| e.at.iter().map(|v| v * v).sum::<f64>());
        libm::sqrt(squares.fold(0.0, max_or_nan))
    }

    /// The distance from a coil, in metres, from which on its points act as a line.
    pub fn resolved_from(&self) -> f64 {
        NEAREST * self.spacing
    }

    /// The number of points of all coils together.
    pub fn points(&self) -> usize {
        self.elements.len()
    }

    /// B at (x, y, z), Cartesian.
    #[inline(always)]
    pub fn magnetic_field<S: Elementary>(&self, place: [S; 3]) -> [S; 3] {
        let mut field = [S::zero(); 3];
        for Element { at, current, width } in &self.elements {
            let x = place[0] - S::from_f64(at[0]);
            let y = place[1] - S::from_f64(at[1]);
            let z = place[2] - S::from_f64(at[2]);
            let [a, b, c] =
                [S::from_f64(current[0]), S::from_f64(current[1]), S::from_f64(current[2])];
            let square = x.mul_add(x, y.mul_add(y, z.mul_add(z, S::from_f64(*width))));
            let inverse = S::from_f64(1.0) / (square * square.sqrt());
            let cross = [b * z - c * y, c * x - a * z, a * y - b * x];
            for k in 0..3 {
                field[k] = cross[k].mul_add(inverse, field[k]);
            }
        }
        field
    }

    /// B_R, B_φ and B_Z at (R, φ, Z).
    #[inline(always)]
    pub fn cylindrical<S: Elementary>(&self, radius: S, phi: f64, height: S) -> [S; 3] {
        let (sin, cos) = Elementary::sin_cos(phi);
        let (s, c) = (S::from_f64(sin), S::from_f64(cos));
        let [x, y, z] = self.magnetic_field([radius * c, radius * s, height]);
        [x * c + y * s, y * c - x * s, z]
    }

    /// dR/dφ and dZ/dφ of the field line through (R, Z) at φ: R B_R/B_φ and R B_Z/B_φ.
    #[inline(always)]
    pub fn line<S: Elementary>(&self, place: &[S], phi: f64, out: &mut [S]) {
        let [by_radius, by_angle, by_height] = self.cylindrical(place[0], phi, place[1]);
        let share = place[0] / by_angle;
        (out[0], out[1]) = (share * by_radius, share * by_height);
    }

    /// Fails where (R, Z) at φ is so near a coil that its points do not act as a line, or where the toroidal field
    /// vanishes or has the opposite sign to `sign`.
    ///
    /// # Errors
    /// With the place.
    pub fn check_at(&self, [radius, height]: [f64; 2], phi: f64, sign: f64) -> Result<(), Error> {
        let place = || format!("(R, Z) = ({radius}, {height}) at φ = {phi}");
        let (s, c) = Elementary::sin_cos(phi);
        let point = [radius * c, radius * s, height];
        let distance = self.distance(point);
        if !(distance >= self.resolved_from()) {
            let expected = format!(
                "at least {NEAREST} times {:.3e} m, the distance of its points",
                self.spacing
            );
            let found = format!("{distance:.3e} m");
            return Err(Error::invalid("distance from a coil", found, expected).with_place(place()));
        }
        let [_, toroidal, _] = self.cylindrical(radius, phi, height);
        if !(toroidal * sign > 0.0) {
            let expected = "the sign that it has on the axis";
            return Err(
                Error::invalid("B_φ", format!("{toroidal:.3e} T"), expected).with_place(place())
            );
        }
        Ok(())
    }

    /// The distance d of a place from the nearest point of a coil; for a current with a width w it is √(d² + w²), over
    /// which its field varies.
    pub fn distance(&self, place: [f64; 3]) -> f64 {
        let mut least = f64::INFINITY;
        for Element { at, width, .. } in &self.elements {
            let square: f64 = at.iter().zip(place).map(|(a, b)| (a - b) * (a - b)).sum();
            let square = square + width;
            if square.is_nan() {
                return f64::NAN;
            }
            // no NaN: given back above
            least = f64::min(least, square);
        }
        libm::sqrt(least)
    }
}

/// The points of a coil act as a line from this many times their spacing on: there the trapezoidal rule errs by
/// e^{−2π·2}, some 10⁻⁵ of the field of that coil.
const NEAREST: f64 = 2.0;
