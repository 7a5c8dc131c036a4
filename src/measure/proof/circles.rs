//! Proofs of invariant circles of given rotation numbers, and of what proved circles enclose.

use super::ball::Ball;
use super::failure::Failure;
use super::noble_number::NobleNumber;
use super::number::{Jet, Number};
use super::plane_map::{PlaneMap, Prepared};
use super::rounded::up;
use super::search::{Ray, candidates, turns_of_orbit};
use super::theorem::{Candidate, Constants};
use super::winding::goes_around;
use crate::error::Error;
use crate::measure::periodic::periodic_orbit;
use crate::stopping::until_stopped;

/// From which κ|E| on no other strip is tried.
const HOPELESS: f64 = 1e5;

/// A curve for which it is proved that an invariant circle is near it.
#[derive(Clone, Debug, PartialEq)]
pub struct Circle {
    /// The approximate invariant curve, and the strips that the proof is in.
    pub candidate: Candidate,
    /// The constants of the theorem.
    pub constants: Constants,
}

/// The outcome of an attempt to prove a circle.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// The map has an invariant circle.
    Proved(Box<Circle>),
    /// A curve was found, but an inequality does not hold for it. A circle may exist nevertheless.
    NotProved(Failure),
    /// No curve was found, with the reason.
    NotFound(String),
}

/// Tries to prove that the map has an invariant circle of this rotation number that crosses the ray. It searches the
/// curve, the widths of the strips, and the numbers of modes and points.
///
/// Source: the scheme of de la Llave, González, Jorba and Villanueva, <https://doi.org/10.1088/0951-7715/18/2/020>, and
/// of Figueras, Haro and Luque, <https://doi.org/10.1007/s10208-016-9339-3>; the theorem is that of the guide's chapter
/// on proofs.
///
/// # Errors
/// [`Error::Invalid`] for a map that is not symplectic by the kinds of its steps.
pub fn prove_circle(map: &PlaneMap, ray: Ray, omega: &NobleNumber) -> Result<Verdict, Error> {
    map.check_symplectic()?;
    let found = match candidates(map, ray, omega) {
        Ok(found) => found,
        Err(reason) => return Ok(Verdict::NotFound(reason.to_string())),
    };
    let mut nearest: Option<Failure> = None;
    for candidate in until_stopped(found) {
        match candidate.prove(map)? {
            Ok(constants) => {
                return Ok(Verdict::Proved(Box::new(Circle { candidate, constants })));
            }
            Err(failure) => {
                // The one that came farthest, then by least.
                let farther = nearest.as_ref().is_none_or(|nearest| {
                    failure.inequality > nearest.inequality
                        || failure.inequality == nearest.inequality && failure.found < nearest.found
                });
                // From one strip to the next κ|E| changes by a hundred or so.
                let hopeless = failure.number() == "(6)" && failure.found > HOPELESS;
                if farther {
                    nearest = Some(failure);
                }
                if hopeless {
                    break;
                }
            }
        }
    }
    Ok(nearest.map_or_else(|| Verdict::NotFound("no candidate".into()), Verdict::NotProved))
}

/// Finds a fixed point from a guess by Newton's method; None where the method finds none.
pub fn fixed_point_near(map: &PlaneMap, guess: [f64; 2]) -> Option<[f64; 2]> {
    let map = map.prepared();
    let with_jacobian = |z: &[f64]| {
        let mut image = [0, 1].map(|axis| Jet::<f64, false>::start(z[axis], axis));
        map.apply(&mut image);
        let jacobian = image.iter().flat_map(|row| row.first).collect();
        Ok((image.map(|row| row.value).to_vec(), jacobian))
    };
    let found = periodic_orbit(&with_jacobian, &guess, 1).ok()?;
    Some([found.points[0][0], found.points[0][1]])
}

/// A proved fixed point: the only one in a box, with bounds of the trace of the derivative there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedPoint {
    /// The middle of the box.
    pub middle: [f64; 2],
    /// Half the side of the box.
    pub radius: f64,
    /// A lower and an upper bound of Tr DF in the box.
    pub trace: [f64; 2],
}

impl FixedPoint {
    /// Proves that a box around a point contains exactly one fixed point of the map, by Krawczyk's test: with
    /// G = F − id and C ≈ G′⁻¹, the box z + [−r, r]² does if −CG(z) + (1 − CG′(box))[−r, r]² is inside [−r, r]². None
    /// where the test fails for all radii tried.
    ///
    /// Source: Krawczyk, <https://doi.org/10.1007/BF02234767>.
    pub fn prove(map: &PlaneMap, middle: [f64; 2]) -> Option<Self> {
        let map = map.prepared();
        let derivative = |radius: f64| {
            let mut z = [0, 1].map(|axis| {
                Jet::<Ball, false>::start(Ball::of(middle[axis]).widened(radius), axis)
            });
            map.apply(&mut z);
            z.map(|row| row.first)
        };
        let mut image = middle.map(Ball::of);
        map.apply(&mut image);
        let off = [0, 1].map(|k| image[k].minus(Ball::of(middle[k])));
        let one = Ball::of(1.0);
        let less_one =
            |m: [[Ball; 2]; 2]| [[m[0][0].minus(one), m[0][1]], [m[1][0], m[1][1].minus(one)]];
        let [[a, b], [c, d]] = less_one(derivative(0.0)).map(|row| row.map(Ball::centre));
        let determinant = a * d - b * c;
        let inverse = [[d, -b], [-c, a]].map(|row| row.map(|x| x / determinant));
        for radius in [1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-5] {
            let m = derivative(radius);
            let g = less_one(m);
            let mut inside = true;
            for i in 0..2 {
                let moved = off[0].scaled(inverse[i][0]).plus(off[1].scaled(inverse[i][1]));
                let mut sum = moved.magnitude();
                for j in 0..2 {
                    let product = g[0][j].scaled(inverse[i][0]).plus(g[1][j].scaled(inverse[i][1]));
                    let own = Ball::of(if i == j { 1.0 } else { 0.0 });
                    sum = up(sum + up(own.minus(product).magnitude() * radius));
                }
                inside &= sum < radius;
            }
            if inside {
                let trace = m[0][0].plus(m[1][1]);
                return Some(Self { middle, radius, trace: [trace.lower(), trace.upper()] });
            }
        }
        None
    }

    /// Whether the fixed point is elliptic, |Tr DF| < 2. None where the bounds of the trace do not decide it.
    pub fn is_elliptic(&self) -> Option<bool> {
        let [low, high] = self.trace;
        if low > -2.0 && high < 2.0 {
            Some(true)
        } else if low > 2.0 || high < -2.0 {
            Some(false)
        } else {
            None
        }
    }
}

/// At most `count` noble rotation numbers, spread over the range of those of orbits that start on the ray.
pub fn noble_numbers(map: &PlaneMap, ray: Ray, count: usize) -> Vec<NobleNumber> {
    const PLACES: usize = 48;
    let mut turns: Vec<f64> = Vec::new();
    for k in until_stopped(0..PLACES) {
        let part = (k as f64 + 0.5) / PLACES as f64;
        let place = [0, 1].map(|axis| ray.from[axis] + part * (ray.to[axis] - ray.from[axis]));
        let own = turns_of_orbit(map, ray.from, place);
        if !own.is_finite() {
            break;
        }
        // Whole turns are unknown: near the one before.
        let last = turns.last().copied().unwrap_or(own);
        turns.push(own - libm::round(own - last));
    }
    turns.sort_by(f64::total_cmp);
    let (Some(&low), Some(&high)) = (turns.first(), turns.last()) else { return Vec::new() };
    let width = (high - low) / count as f64;
    let mut out: Vec<NobleNumber> = Vec::new();
    for k in 0..count {
        let middle = low + (k as f64 + 0.5) * width;
        let part = middle - libm::floor(middle);
        if let Some(found) = NobleNumber::near(part, 0.45 * width)
            && !out.contains(&found)
        {
            out.push(found);
        }
    }
    out
}

impl Circle {
    /// The rotation number ω of the circle, in turns per step of the map.
    pub fn omega(&self) -> &NobleNumber {
        &self.candidate.omega
    }

    /// `count` points of the curve, two numbers each.
    pub fn points(&self, count: usize) -> Vec<f64> {
        let mut out = Vec::with_capacity(2 * count);
        for j in 0..count {
            let turns = j as f64 / count as f64;
            let mut z = [0.0; 2];
            for (k, mode) in self.candidate.modes.iter().enumerate() {
                let phase = k as f64 * turns;
                let (s, c) = libm::sincos(std::f64::consts::TAU * (phase - libm::round(phase)));
                let both = if k == 0 { 1.0 } else { 2.0 };
                for axis in 0..2 {
                    z[axis] += both * (mode[2 * axis][0] * c - mode[2 * axis + 1][0] * s);
                }
            }
            out.extend(z);
        }
        out
    }

    /// The area within the curve, to the rounding of doubles.
    pub fn area(&self) -> f64 {
        let of = |(k, [a, b, c, d]): (usize, &[[f64; 2]; 4])| {
            // π Σ k·2(x × y) of the complex coefficients x = a + ib, y = c + id.
            4.0 * std::f64::consts::PI * k as f64 * (b[0] * c[0] - a[0] * d[0])
        };
        self.candidate.modes.iter().enumerate().map(of).sum::<f64>().abs()
    }

    /// Proves that the circle goes once around every point within `around` of `point`.
    ///
    /// # Errors
    /// [`Failure`] with the inequality that does not hold; always for a circle around a cylinder, which goes around no
    /// point.
    pub fn goes_around(&self, point: [f64; 2], around: f64) -> Result<(), Failure> {
        goes_around(&self.candidate.curve(), self.constants.distance, point, around)
    }

    /// Proves that this circle encloses another one, so that no orbit leaves the region between them.
    ///
    /// # Errors
    /// [`Failure`].
    pub fn encloses(&self, inner: &Self) -> Result<(), Failure> {
        let [x, y] = inner.candidate.start();
        let centre = [x.centre(), y.centre()];
        let off = [x, y].map(|x| up(up(x.parts()[1].abs()) + x.radius()));
        let around = up(inner.constants.distance + up(off[0] + off[1]));
        self.goes_around(centre, around)
    }
}

impl Candidate {
    /// An enclosure of the point K(0) of the curve.
    fn start(&self) -> [Ball; 2] {
        let mut out = [Ball::of(0.0); 2];
        for (k, mode) in self.curve().modes.iter().enumerate() {
            let both = if k == 0 { 1.0 } else { 2.0 };
            for axis in 0..2 {
                out[axis] = out[axis].plus(mode[axis].re.scaled(both));
            }
        }
        out
    }
}

/// A bound of the rounding error of one step: the distance of the exact image of `point` from `rounded`, the image
/// computed in doubles.
pub fn rounding_of_a_step(map: &PlaneMap, point: [f64; 2], rounded: [f64; 2]) -> f64 {
    let map: Prepared<'_> = map.prepared();
    let mut z = point.map(Ball::of);
    map.apply(&mut z);
    let off = [0, 1].map(|k| z[k].minus(Ball::of(rounded[k])).magnitude());
    up(up(off[0] * off[0] + off[1] * off[1]).sqrt())
}
