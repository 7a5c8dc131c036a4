//! Magnetic field lines of a tokamak with a helical perturbation.

use super::{Hamiltonian, NaturalCoordinates, NearlyPeriodic};
use crate::error::Error;
use crate::layer::CircleAction;
use crate::scalar::Elementary;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Magnetic field lines around a circular axis, with the toroidal angle φ as time and
/// H = ι₀(r²/2 − r⁴/4)(1 + ε cos(mθ + nφ)). Lengths are in units of a, the minor radius where ι is 0.
///
/// At the minor radius r and the poloidal angle θ, the momentum of θ is p_θ = r²/2 − r³ cos θ/3A, with the aspect
/// ratio A = R₀/a and the field B₀ = 1 on the axis. So r is a root of a cubic, and no part of H has an explicit flow.
/// z = [q, p], q = √(2p_θ) sin θ, p = √(2p_θ) cos θ: dq∧dp = dθ∧dp_θ.
///
/// At ε = 0, r is conserved and θ − (r/A) sin θ advances at the rate ι(r) = ι₀(1 − r²): each
/// surface has a frequency of its own, and the motion has a single frequency only near the axis.
/// Where mι + n = 0 the perturbation opens a chain of islands. H is singular at the axis for m ≠ 0
/// and ε ≠ 0, and defined for r ≤ 1.
///
/// Source: the vector potential of Rath, Albert, Bischl and von Toussaint,
/// <https://doi.org/10.1063/5.0048129>, with the perturbation cos(mθ + nφ).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FieldLines {
    /// The strength ε of the perturbation.
    pub epsilon: f64,
    /// ι₀, the rotational transform on the axis: poloidal turns for each toroidal turn.
    #[serde(default = "FieldLines::iota")]
    pub iota: f64,
    /// The aspect ratio A of the torus.
    #[serde(default = "FieldLines::aspect_ratio")]
    pub aspect_ratio: f64,
    /// The poloidal mode number m of the perturbation.
    #[serde(default = "FieldLines::poloidal")]
    pub poloidal: i32,
    /// The toroidal mode number n of the perturbation.
    #[serde(default = "FieldLines::toroidal")]
    pub toroidal: i32,
}

/// Newton steps for r, and for θ of the unperturbed flow: each doubles the number of correct digits, two at the
/// start.
const NEWTON_STEPS: usize = 6;

impl FieldLines {
    /// A = 2, m = −3, n = 2, and ι₀ = 2/√5, near 0.9: no low multiple of ι₀ is a whole number of turns, and the
    /// islands, at ι = ⅔, are at a quarter of the area of the torus.
    pub fn new(epsilon: f64) -> Self {
        Self {
            epsilon,
            iota: Self::iota(),
            aspect_ratio: Self::aspect_ratio(),
            poloidal: Self::poloidal(),
            toroidal: Self::toroidal(),
        }
    }

    fn iota() -> f64 {
        2.0 / libm::sqrt(5.0)
    }

    fn aspect_ratio() -> f64 {
        2.0
    }

    fn poloidal() -> i32 {
        -3
    }

    fn toroidal() -> i32 {
        2
    }

    /// The rotational transform ι(r), poloidal turns for each toroidal turn, at the radius r of the unperturbed
    /// surface.
    pub fn iota_at(&self, radius: f64) -> f64 {
        self.iota * (1.0 - radius * radius)
    }

    /// The values of ι and r where mι + n = 0, if there are islands.
    pub fn resonance(&self) -> Option<(f64, f64)> {
        if self.epsilon == 0.0 || self.poloidal == 0 {
            return None;
        }
        let iota = -f64::from(self.toroidal) / f64::from(self.poloidal);
        let square = 1.0 - iota / self.iota;
        (0.0 < square && square < 1.0).then(|| (iota, libm::sqrt(square)))
    }

    /// The point at (r, θ).
    pub fn point(&self, radius: f64, theta: f64) -> [f64; 2] {
        let (s, c) = Elementary::sin_cos(theta);
        let length = radius * libm::sqrt(1.0 - 2.0 / 3.0 * radius / self.aspect_ratio * c);
        [length * s, length * c]
    }

    /// (r, θ) at a point.
    pub fn polar<S: Elementary>(&self, z: &[S]) -> (S, S) {
        let radius = (z[0] * z[0] + z[1] * z[1]).sqrt() * self.stretch(z[1]);
        (radius, z[0].atan2(z[1]))
    }

    /// u = r/√(2p_θ), which is a function of p alone: u² − ⅔(p/A)u³ = 1.
    #[inline(always)]
    fn stretch<S: Elementary>(&self, p: S) -> S {
        let p = p * S::from_f64(1.0 / self.aspect_ratio);
        let (one, third) = (S::from_f64(1.0), S::from_f64(1.0 / 3.0));
        let two = S::from_f64(2.0);
        let mut u = one + p * third;
        for _ in 0..NEWTON_STEPS {
            let pu = p * u;
            let residual = u * u * (one - two * third * pu) - one;
            u -= residual / (two * u * (one - pu));
        }
        u
    }

    /// f(s) and f′(s) of f = ι₀(s/2 − s²/4), s = r².
    #[inline(always)]
    fn profile<S: Elementary>(&self, s: S) -> (S, S) {
        let half = S::from_f64(0.5 * self.iota);
        let bend = S::from_f64(0.25 * self.iota);
        (s * (half - bend * s), half - (bend + bend) * s)
    }

    /// cos and sin of mθ + nφ.
    #[inline(always)]
    fn phase<S: Elementary>(&self, z: &[S], time: f64) -> (S, S) {
        let length = (z[0] * z[0] + z[1] * z[1]).sqrt();
        self.phase_at([z[0] / length, z[1] / length], time)
    }

    /// cos and sin of mθ + nφ, from sin θ and cos θ.
    #[inline(always)]
    fn phase_at<S: Elementary>(&self, [s, c]: [S; 2], time: f64) -> (S, S) {
        let (sin, cos) = Elementary::sin_cos(f64::from(self.toroidal) * time);
        let (mut re, mut im) = (S::from_f64(cos), S::from_f64(sin));
        let s = if self.poloidal < 0 { -s } else { s };
        for _ in 0..self.poloidal.unsigned_abs() {
            (re, im) = (re * c - im * s, re * s + im * c);
        }
        (re, im)
    }

    /// Fails unless ι₀ is finite, A at least 1.25, and |m| and |n| at most 100.
    ///
    /// # Errors
    /// With the value.
    pub fn check(&self) -> Result<(), Error> {
        Error::check_finite("system.iota", self.iota)?;
        // The axis of the torus is outside of it, and r is a root: p/A < 1/√3.
        Error::check_range("system.aspect_ratio", self.aspect_ratio, 1.25, f64::MAX)?;
        // Each is a product of so many rotations.
        const MOST: i32 = 100;
        let most = MOST as f64;
        Error::check_range("system.poloidal", f64::from(self.poloidal), -most, most)?;
        Error::check_range("system.toroidal", f64::from(self.toroidal), -most, most)
    }
}

impl Hamiltonian for FieldLines {
    fn dof(&self) -> usize {
        1
    }
    fn energy<S: Elementary>(&self, z: &[S], time: f64) -> S {
        let u = self.stretch(z[1]);
        let (f, _) = self.profile((z[0] * z[0] + z[1] * z[1]) * u * u);
        if self.epsilon == 0.0 {
            return f;
        }
        let (cos, _) = self.phase(z, time);
        f * (S::from_f64(1.0) + S::from_f64(self.epsilon) * cos)
    }
    #[inline(always)]
    fn vector_field<S: Elementary>(&self, z: &[S], time: f64, out: &mut [S]) {
        let (one, two) = (S::from_f64(1.0), S::from_f64(2.0));
        let (q, p) = (z[0], z[1]);
        let u = self.stretch(p);
        let square = q * q + p * p;
        let uu = u * u;
        let (f, slope) = self.profile(square * uu);
        let aspect = S::from_f64(self.aspect_ratio);
        let bend = uu / (S::from_f64(3.0) * (aspect - p * u));
        let by_q = two * q * uu;
        let by_p = two * u * (p * u + square * bend);
        if self.epsilon == 0.0 {
            (out[0], out[1]) = (slope * by_p, -(slope * by_q));
            return;
        }
        let (cos, sin) = self.phase(z, time);
        let epsilon = S::from_f64(self.epsilon);
        let slope = slope * (one + epsilon * cos);
        // By θ, over 2p_θ.
        let torque = match self.poloidal {
            0 => S::zero(),
            m => -(epsilon * S::from_f64(f64::from(m)) * f * sin / square),
        };
        out[0] = slope * by_p - torque * q;
        out[1] = -(slope * by_q + torque * p);
    }
    fn period(&self) -> Option<f64> {
        let toroidal = f64::from(self.toroidal.unsigned_abs());
        (self.epsilon != 0.0 && toroidal > 0.0).then(|| TAU / toroidal)
    }
    fn fastest_frequency(&self, _: &[f64]) -> f64 {
        // θ̇ = ι/(1 − (r/A) cos θ).
        let about = self.iota.abs() / (1.0 - 0.5 / self.aspect_ratio);
        about.max(f64::from(self.toroidal.unsigned_abs()))
    }
    /// Fails outside of r ≤ 1, and on the axis where the perturbation is singular.
    fn check_point(&self, z: &[f64]) -> Result<(), Error> {
        let place = || format!("the point {z:?}");
        let (radius, _) = self.polar(z);
        let u = self.stretch(z[1]);
        let pu = z[1] * u / self.aspect_ratio;
        let change = u * u * (1.0 - 2.0 / 3.0 * pu) - 1.0;
        // The cubic has other roots, which are no radii: there p_θ falls with r.
        let is_radius = change.abs() < 1e-12 && u > 0.0 && pu < 1.0;
        if !is_radius {
            let (what, iterations) = (format!("r(p_θ, θ) at {}", place()), NEWTON_STEPS);
            return Err(Error::NoConvergence { what, iterations, change });
        }
        if !(radius <= 1.0) {
            let expected = "r ≤ 1, inside of the torus";
            return Err(Error::invalid("r", radius, expected).with_place(place()));
        }
        if radius == 0.0 && self.epsilon != 0.0 && self.poloidal != 0 {
            let expected = "another point: the perturbation is singular on the axis";
            return Err(Error::invalid("r", radius, expected).with_place(place()));
        }
        Ok(())
    }
}

/// (r, θ), in which the equations are explicit: with p_θ = r²/2 − r³ cos θ/3A,
///
/// θ̇ = ∂H/∂r / ∂p_θ/∂r, ṙ = −∂H/∂θ / ∂p_θ/∂r, H being a function of (r, θ).
impl NaturalCoordinates for FieldLines {
    #[inline(always)]
    fn to_natural<S: Elementary>(&self, z: &mut [S]) {
        (z[0], z[1]) = self.polar(z);
    }
    #[inline(always)]
    fn to_canonical<S: Elementary>(&self, x: &mut [S]) {
        let (s, c) = x[1].sin_cos();
        let tilt = x[0] * S::from_f64(2.0 / (3.0 * self.aspect_ratio));
        let length = x[0] * (S::from_f64(1.0) - tilt * c).sqrt();
        (x[0], x[1]) = (length * s, length * c);
    }
    #[inline(always)]
    fn natural_field<S: Elementary>(&self, x: &[S], time: f64, out: &mut [S]) {
        let (r, (s, c)) = (x[0], x[1].sin_cos());
        let one = S::from_f64(1.0);
        let (f, slope) = self.profile(r * r);
        // ∂p_θ/∂r over r.
        let width = one - r * S::from_f64(1.0 / self.aspect_ratio) * c;
        let (cos, sin) = match self.epsilon == 0.0 {
            true => (one, S::zero()),
            false => self.phase_at([s, c], time),
        };
        let epsilon = S::from_f64(self.epsilon);
        let turn = (slope + slope) * (one + epsilon * cos) / width;
        let torque = epsilon * S::from_f64(f64::from(self.poloidal)) * f * sin;
        out[0] = torque / (r * width);
        out[1] = turn;
    }
}

/// The limit near the axis.
impl NearlyPeriodic for FieldLines {
    fn epsilon(&self) -> f64 {
        self.epsilon
    }
    fn circle_action(&self) -> CircleAction {
        CircleAction::new([1])
    }
    /// ι₀, that of the axis.
    fn limiting_frequency(&self) -> f64 {
        self.iota
    }
    /// r²/2, the toroidal flux inside of the surface over 2π.
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S {
        let u = self.stretch(z[1]);
        S::from_f64(0.5) * (z[0] * z[0] + z[1] * z[1]) * u * u
    }
    /// The flow at ε = 0, each surface at its own frequency.
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S) {
        let (r, theta) = self.polar(z);
        let tilt = r * S::from_f64(1.0 / self.aspect_ratio);
        let (_, slope) = self.profile(r * r);
        let angle = theta - tilt * theta.sin_cos().0 + (slope + slope) * time;
        let mut theta = angle + tilt * angle.sin_cos().0;
        for _ in 0..NEWTON_STEPS {
            let (s, c) = theta.sin_cos();
            theta -= (theta - tilt * s - angle) / (S::from_f64(1.0) - tilt * c);
        }
        let (s, c) = theta.sin_cos();
        let length = r * (S::from_f64(1.0) - S::from_f64(2.0 / 3.0) * tilt * c).sqrt();
        (z[0], z[1]) = (length * s, length * c);
    }
}
