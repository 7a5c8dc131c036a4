//! The search for a nearly invariant circle: from an orbit, refined by Newton's method.

use super::ball::Ball;
use super::curve::{Curve, Wave, phases, roots_of_unity, transform};
use super::noble_number::NobleNumber;
use super::number::{Jet, Number};
use super::plane_map::{PlaneMap, Prepared};
use super::rounded::Complex;
use super::theorem::{Candidate, MOST_POINTS, error_of};
use crate::error::Error;
use crate::measure::rotation::{birkhoff_average, birkhoff_weights};
use crate::stopping::is_stopped;
use std::f64::consts::TAU;

/// A ray on which circles of a map are searched: those that cross it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// The start: near the fixed point that the circles go around, or, on a cylinder, below all circles.
    pub from: [f64; 2],
    /// The end of the ray, up to which circles are searched.
    pub to: [f64; 2],
}

impl Ray {
    fn at(&self, part: f64) -> [f64; 2] {
        [0, 1].map(|k| self.from[k] + part * (self.to[k] - self.from[k]))
    }
}

/// The first and the last number of points.
const FIRST_POINTS: usize = 512;
const LAST_POINTS: usize = 8192;
/// −ln of what aliasing and truncation may leave.
const OF_ALIASING: f64 = 64.0;
const STATES: usize = 24_000;
const STATES_OF_TURNS: usize = 1_500;

/// Clockwise turns from one point to another around a third, from −½ to ½; on a cylinder the way along it.
fn turns_between(map: &Prepared<'_>, about: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    if map.cylinder() {
        return b[0] - a[0];
    }
    let angle = |z: [f64; 2]| libm::atan2(z[1] - about[1], z[0] - about[0]) / TAU;
    let turns = angle(a) - angle(b);
    turns - libm::round(turns)
}

/// The rotation number, in turns per map, of the orbit from `start` about a point, by weighted Birkhoff averages.
///
/// Source: Das, Saiki, Sander and Yorke, <https://doi.org/10.1088/1361-6544/aa84c2>.
pub fn turns_of_orbit(map: &PlaneMap, about: [f64; 2], start: [f64; 2]) -> f64 {
    turns_of(&map.prepared(), about, start)
}

fn turns_of(map: &Prepared<'_>, about: [f64; 2], start: [f64; 2]) -> f64 {
    let mut z = start;
    let mut growths = Vec::with_capacity(STATES_OF_TURNS);
    for _ in 0..STATES_OF_TURNS {
        let before = z;
        map.apply(&mut z);
        growths.push(turns_between(map, about, before, z));
    }
    // All within half a turn of where most of them are, whole turns left out.
    let (mut sines, mut cosines) = (0.0, 0.0);
    for turns in &growths {
        let (s, c) = libm::sincos(TAU * turns);
        (sines, cosines) = (sines + s, cosines + c);
    }
    let middle = libm::atan2(sines, cosines) / TAU;
    for turns in &mut growths {
        *turns -= libm::round(*turns - middle);
    }
    birkhoff_average(&growths)
}

/// The place on the ray whose orbit has the rotation number ω, modulo whole turns.
fn place_on_ray_of(map: &Prepared<'_>, ray: Ray, omega: f64) -> Option<[f64; 2]> {
    const PLACES: usize = 24;
    const HALVINGS: usize = 44;
    let off = |part: f64| {
        if is_stopped() {
            return f64::NAN;
        }
        let turns = turns_of(map, ray.from, ray.at(part)) - omega;
        turns - if map.cylinder() { 0.0 } else { libm::round(turns) }
    };
    let place = |k: usize| (k as f64 + 0.5) / PLACES as f64;
    let found: Vec<f64> = (0..PLACES).map(|k| off(place(k))).collect();
    // Not where the difference jumps from half a turn to its opposite.
    let crosses =
        |k: &usize| found[*k] * found[k + 1] <= 0.0 && (found[*k] - found[k + 1]).abs() < 0.3;
    let k = (0..PLACES - 1).find(crosses)?;
    let (mut low, mut high) = (place(k), place(k + 1));
    let mut of_low = found[k];
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        let of_middle = off(middle);
        if of_middle * of_low <= 0.0 {
            high = middle;
        } else {
            (low, of_low) = (middle, of_middle);
        }
    }
    Some(ray.at(0.5 * (low + high)))
}

/// The place on the ray whose orbit has this rotation number; None where none is found.
pub fn place_on_ray(map: &PlaneMap, ray: Ray, omega: &NobleNumber) -> Option<[f64; 2]> {
    place_on_ray_of(&map.prepared(), ray, omega.value().centre())
}

/// The modes of the curve that an orbit is on, z_n = K(nω).
fn modes_of_orbit(map: &Prepared<'_>, start: [f64; 2], omega: f64, most: usize) -> Curve<f64> {
    let sum: f64 = birkhoff_weights(STATES).sum();
    let mut modes = vec![[Wave::<f64>::zero(); 2]; most + 1];
    let mut z = start;
    for (n, weight) in birkhoff_weights(STATES).enumerate() {
        let turns = n as f64 * omega;
        let turns = turns - libm::floor(turns);
        let value = if map.cylinder() { [z[0] - n as f64 * omega, z[1]] } else { z };
        let (s, c) = libm::sincos(TAU * turns);
        let (mut re, mut im) = (weight / sum, 0.0);
        for mode in &mut modes {
            for axis in 0..2 {
                mode[axis].re += value[axis] * re;
                mode[axis].im += value[axis] * im;
            }
            // e^{−2πiknω}.
            (re, im) = (re * c + im * s, im * c - re * s);
        }
        map.apply(&mut z);
    }
    for mode in modes[..1].iter_mut().flatten() {
        mode.im = 0.0;
    }
    Curve { modes, cylinder: map.cylinder() }
}

fn narrow(z: Wave<Ball>) -> Wave<f64> {
    Wave::new(z.re.centre(), z.im.centre())
}

/// ξ with ξ(φ) − ξ(φ + ω) = η(φ) − ⟨η⟩ of mean 0, from and to values; and ⟨η⟩.
fn solve(eta: &[f64], roots: &[Wave<f64>], phases: &[Wave<f64>]) -> (Vec<f64>, f64) {
    let count = eta.len();
    let mut z: Vec<Wave<f64>> = eta.iter().map(|x| Wave::new(*x, 0.0)).collect();
    transform(&mut z, roots, true);
    let mean = z[0].re / count as f64;
    z[0] = Wave::zero();
    z[count / 2] = Wave::zero();
    for k in 1..count / 2 {
        let d = Wave::new(1.0 - phases[k].re, -phases[k].im);
        let square = d.re * d.re + d.im * d.im;
        let inverse = Wave::new(d.re / square, -d.im / square);
        z[k] = z[k].times(inverse).scaled(1.0 / count as f64);
        z[count - k] = z[k].conjugate();
    }
    transform(&mut z, roots, false);
    (z.into_iter().map(|z| z.re).collect(), mean)
}

/// A step of Newton's method in doubles, from the coefficients of the error: Δ with F(K + Δ) nearer to (K + Δ)(· + ω).
fn correction(
    map: &Prepared<'_>,
    curve: &Curve<f64>,
    error: &Curve<f64>,
    phases: &[Wave<f64>],
    roots: &[Wave<f64>],
) -> Vec<[f64; 2]> {
    let count = roots.len();
    let points = curve.values(count, roots);
    let slope = curve.slope(TAU);
    let [mut slopes, mut next] =
        [slope.values(count, roots), slope.rotated(phases).values(count, roots)];
    let errors = error.values(count, roots);
    if curve.cylinder {
        for slope in slopes.iter_mut().chain(&mut next) {
            slope[0] += 1.0;
        }
    }
    let normal = |l: [f64; 2]| {
        let square = l[0] * l[0] + l[1] * l[1];
        [-l[1] / square, l[0] / square]
    };
    let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    let (mut torsion, mut along, mut across) =
        (vec![0.0; count], vec![0.0; count], vec![0.0; count]);
    for j in 0..count {
        let turns = if curve.cylinder { j as f64 / count as f64 } else { 0.0 };
        let start = [points[j][0] + turns, points[j][1]];
        let mut z = [0, 1].map(|axis| Jet::<f64, false>::start(start[axis], axis));
        map.apply(&mut z);
        let (n, n_next) = (normal(slopes[j]), normal(next[j]));
        let moved = z.map(|row| row.first[0] * n[0] + row.first[1] * n[1]);
        torsion[j] = cross(moved, n_next);
        // ξ − ξ₊ = −η.
        along[j] = -cross(errors[j], n_next);
        across[j] = -cross(next[j], errors[j]);
    }
    let (mut xi_n, _) = solve(&across, roots, phases);
    let mean = |f: &dyn Fn(usize) -> f64| (0..count).map(f).sum::<f64>() / count as f64;
    let shift = (mean(&|j| along[j]) - mean(&|j| torsion[j] * xi_n[j])) / mean(&|j| torsion[j]);
    for x in &mut xi_n {
        *x += shift;
    }
    let rest: Vec<f64> = (0..count).map(|j| along[j] - torsion[j] * xi_n[j]).collect();
    let (xi_l, _) = solve(&rest, roots, phases);
    (0..count)
        .map(|j| {
            let n = normal(slopes[j]);
            [0, 1].map(|axis| slopes[j][axis] * xi_l[j] + n[axis] * xi_n[j])
        })
        .collect()
}

/// What is found before strips are searched.
struct Found {
    curve: Curve<Ball>,
    points: usize,
}

/// The coefficients of F∘K − K(· + ω) in doubles.
fn narrow_error(
    map: &Prepared<'_>,
    curve: &Curve<f64>,
    phases: &[Wave<f64>],
    omega: f64,
    roots: &[Wave<f64>],
) -> Curve<f64> {
    let count = roots.len();
    let mut values = curve.values(count, roots);
    for (j, z) in values.iter_mut().enumerate() {
        let turns = if curve.cylinder { j as f64 / count as f64 } else { 0.0 };
        z[0] += turns;
        map.apply(z);
        z[0] -= turns;
    }
    let mut out = Curve::of_values(&values, roots, count / 2 - 1, curve.cylinder);
    for (mode, own) in out.modes.iter_mut().zip(&curve.rotated(phases).modes) {
        for axis in 0..2 {
            mode[axis] = mode[axis].minus(own[axis]);
        }
    }
    if curve.cylinder {
        out.modes[0][0].re -= omega;
    }
    out
}

/// The largest modulus of coefficients.
fn largest<T: Number>(modes: &[[Wave<T>; 2]], size: impl Fn(T) -> f64) -> f64 {
    let all = modes.iter().flatten().map(|c| size(c.re).abs() + size(c.im).abs());
    all.fold(0.0, crate::scalar::max_or_nan)
}

/// Newton's method in doubles, with as many points as the coefficients need to fall to their rounding; then with the
/// error to 30 digits, and more points until the coefficients fall to that.
fn refine(map: &Prepared<'_>, mut curve: Curve<f64>, omega: Ball) -> Option<Found> {
    const ROUNDS: usize = 12;
    let own = |x: f64| x;
    let mut points = FIRST_POINTS;
    loop {
        if is_stopped() {
            return None;
        }
        let most = points / 4;
        curve.modes.resize(most + 1, [Wave::zero(); 2]);
        let roots: Vec<_> = roots_of_unity(points).into_iter().map(narrow).collect();
        let phases: Vec<_> = phases(omega, points).into_iter().map(narrow).collect();
        let size = largest(&curve.modes[1..], own).max(1e-3);
        let mut before = f64::INFINITY;
        for _ in 0..ROUNDS {
            let error = narrow_error(map, &curve, &phases, omega.centre(), &roots);
            let found = largest(&error.modes[..most + 1], own);
            if is_stopped() || !(found < 0.5 * before) {
                break;
            }
            before = found;
            let delta = correction(map, &curve, &error, &phases, &roots);
            let delta = Curve::of_values(&delta, &roots, most, map.cylinder());
            for (mode, change) in curve.modes.iter_mut().zip(&delta.modes) {
                for axis in 0..2 {
                    mode[axis] = mode[axis].plus(change[axis]);
                }
            }
        }
        if !(before < 0.1 * size) {
            return None;
        }
        // They fall like a geometric sequence: three times as many as to 10⁻¹⁰ to 10⁻³⁰.
        let fallen = |k: &usize| largest(&curve.modes[*k..], own) < 1e-10 * size;
        let needed = 3 * (1..=most).find(fallen).unwrap_or(most);
        if needed <= most || points == LAST_POINTS {
            break;
        }
        points = (4 * needed).next_power_of_two().min(LAST_POINTS);
    }
    let wide = |c: Wave<f64>| Wave::new(Ball::of(c.re), Ball::of(c.im));
    let modes = curve.modes.iter().map(|mode| mode.map(wide)).collect();
    let mut curve = Curve { modes, cylinder: map.cylinder() };
    for mode in &mut curve.modes[0] {
        mode.im = Ball::of(0.0);
    }
    loop {
        if is_stopped() {
            return None;
        }
        let error = refine_in_balls(map, &mut curve, omega, points);
        let size = largest(&curve.modes[1..], Ball::centre);
        // Coefficients that are rounding alone would grow on strips.
        let noise = |k: &usize| largest(&curve.modes[*k..], Ball::centre) < 3e-30 * size;
        let needed = (2..curve.modes.len()).find(noise);
        // More modes are of use to a curve that is invariant but for what they would bring.
        let converged = error < 1e-24 * size;
        if needed.is_none() && converged && points < LAST_POINTS {
            points *= 2;
            curve.modes.resize(points / 4 + 1, [Wave::zero(); 2]);
            continue;
        }
        curve.modes.truncate(needed.unwrap_or(curve.modes.len()));
        return Some(Found { curve, points });
    }
}

/// Newton's method with the error to 30 digits, of which each correction in doubles takes off some: the largest
/// coefficient of the error before the last one.
fn refine_in_balls(map: &Prepared<'_>, curve: &mut Curve<Ball>, omega: Ball, points: usize) -> f64 {
    const ROUNDS: usize = 6;
    const ROUNDED: f64 = 1e-29;
    let most = points / 4;
    let (roots, phases) = (roots_of_unity(points), phases(omega, points));
    let narrow_roots: Vec<_> = roots.iter().copied().map(narrow).collect();
    let narrow_phases: Vec<_> = phases.iter().copied().map(narrow).collect();
    let size = largest(&curve.modes[1..], Ball::centre);
    let mut before = f64::INFINITY;
    for _ in 0..ROUNDS {
        let error = error_of(map, curve, &phases, omega, points, &roots);
        let found = largest(&error.modes[..most + 1], Ball::centre);
        if is_stopped() || !(found < 0.1 * before) {
            break;
        }
        before = found;
        let all_narrow = |curve: &Curve<Ball>| Curve {
            modes: curve.modes.iter().map(|mode| mode.map(narrow)).collect(),
            cylinder: curve.cylinder,
        };
        let (narrow_curve, error) = (all_narrow(curve), all_narrow(&error));
        let delta = correction(map, &narrow_curve, &error, &narrow_phases, &narrow_roots);
        let delta = Curve::of_values(&delta, &narrow_roots, most, map.cylinder());
        for (mode, change) in curve.modes.iter_mut().zip(&delta.modes) {
            for axis in 0..2 {
                let [re, im] = [change[axis].re, change[axis].im].map(Ball::of);
                let sum = mode[axis].plus(Wave::new(re, im));
                mode[axis] = Wave::new(sum.re.exact(), sum.im.exact());
            }
        }
        for mode in &mut curve.modes[0] {
            mode.im = Ball::of(0.0);
        }
        if found < ROUNDED * size {
            break;
        }
    }
    before
}

/// The candidates for a circle of this rotation number that crosses the ray, the most promising first: curves that
/// Newton's method finds from the modes of an orbit.
///
/// Source: Figueras, Haro and Luque, <https://doi.org/10.1007/s10208-016-9339-3>.
///
/// # Errors
/// [`Error::Invalid`] where no orbit on the ray has the rotation number ω, or Newton's method finds no curve.
pub fn candidates(map: &PlaneMap, ray: Ray, omega: &NobleNumber) -> Result<Vec<Candidate>, Error> {
    let map = &map.prepared();
    let value = omega.value();
    let fail = |found: &str, expected: &str| {
        Err(Error::invalid("circle", format!("{omega}: {found}"), expected.to_owned()))
    };
    let Some(start) = place_on_ray_of(map, ray, value.centre()) else {
        return fail(
            "no orbit on the ray turns by it",
            "a rotation number between those of the ends of the ray",
        );
    };
    // Orbits go clockwise, φ as they go.
    let first = modes_of_orbit(map, start, value.centre(), FIRST_POINTS / 4);
    candidates_from(map, first, omega)
}

/// The candidates near a curve that is given by its modes, in the form of [`Candidate::modes`].
///
/// # Errors
/// [`Error::Invalid`] where Newton's method finds no curve.
pub fn candidates_near(
    map: &PlaneMap,
    modes: &[[[f64; 2]; 4]],
    omega: &NobleNumber,
) -> Result<Vec<Candidate>, Error> {
    let wave = |re: [f64; 2], im: [f64; 2]| Wave::new(re[0] + re[1], im[0] + im[1]);
    let modes = modes.iter().map(|[a, b, c, d]| [wave(*a, *b), wave(*c, *d)]).collect();
    candidates_from(&map.prepared(), Curve { modes, cylinder: map.cylinder }, omega)
}

fn candidates_from(
    map: &Prepared<'_>,
    first: Curve<f64>,
    omega: &NobleNumber,
) -> Result<Vec<Candidate>, Error> {
    let Some(Found { curve, points }) = refine(map, first, omega.value()) else {
        let found = format!("{omega}: Newton's method finds no curve");
        return Err(Error::invalid("circle", found, "an orbit on a smooth curve"));
    };
    let parts = |x: Ball| [x.parts()[0], x.parts()[1]];
    let modes: Vec<[[f64; 2]; 4]> = curve
        .modes
        .iter()
        .map(|[x, y]| [parts(x.re), parts(x.im), parts(y.re), parts(y.im)])
        .collect();
    let widest = widest_strip(map, &curve);
    let mut out = Vec::new();
    for (shrunk, part) in [(1.0, 0.25), (1.0, 0.17), (0.8, 0.25), (0.8, 0.17), (0.6, 0.2)] {
        let rho_hat = widest * shrunk;
        let (omega, modes) = (omega.clone(), modes.clone());
        let (rho, cylinder) = (part * rho_hat, map.cylinder());
        // What aliasing and truncation leave is e^{−π(ρ̂ − ρ)n}.
        let needed = OF_ALIASING / (std::f64::consts::PI * (rho_hat - rho));
        let most = MOST_POINTS as f64;
        let needed = (if needed < most { needed } else { most }) as usize;
        let points = if needed > points { needed.next_power_of_two() } else { points };
        out.push(Candidate { omega, modes, rho, rho_hat, points, cylinder });
    }
    Ok(out)
}

/// An estimate of the widest strip on which F∘K is analytic and of the size that it is on the real line.
fn widest_strip(map: &Prepared<'_>, curve: &Curve<Ball>) -> f64 {
    const PLACES: usize = 256;
    let narrow = curve.modes.iter().map(|mode| mode.map(narrow));
    let modes: Vec<[Wave<f64>; 2]> = narrow.collect();
    let size = |rho: f64| {
        let mut largest = 0.0;
        for j in 0..PLACES {
            let turns = j as f64 / PLACES as f64;
            let mut z = [Wave::<f64>::zero(); 2];
            for (k, mode) in modes.iter().enumerate() {
                let (s, c) = libm::sincos(TAU * k as f64 * turns);
                let growth = libm::exp(TAU * k as f64 * rho);
                for axis in 0..2 {
                    let inward = mode[axis].times(Wave::new(c / growth, s / growth));
                    let outward = mode[axis].conjugate().times(Wave::new(c * growth, -s * growth));
                    z[axis] = z[axis].plus(inward);
                    if k > 0 {
                        z[axis] = z[axis].plus(outward);
                    }
                }
            }
            if curve.cylinder {
                z[0] = z[0].plus(Wave::new(turns, rho));
            }
            let mut image = z.map(|z| Complex::new(z.re, z.im));
            map.apply(&mut image);
            for axis in 0..2 {
                let shift = if curve.cylinder && axis == 0 { turns } else { 0.0 };
                let centre = modes[0][axis].re + shift;
                let off = libm::hypot(image[axis].re - centre, image[axis].im);
                largest = crate::scalar::max_or_nan(largest, off);
            }
        }
        largest
    };
    let real = size(0.0);
    let (mut rho, mut best) = (1e-3, 1e-3);
    for _ in 0..60 {
        if is_stopped() || !(size(rho) < 3.0 * real) {
            break;
        }
        best = rho;
        rho *= 1.12;
    }
    best
}
