//! A charged particle that drifts through the cells of an electric potential.

use super::average::{self, Jet, POINTS, QUARTER};
use super::{AverageConstants, AveragePart, Hamiltonian, NearlyPeriodic, Splittable, turn};
use crate::error::Error;
use crate::layer::CircleAction;
use crate::scalar::Elementary;
use serde::{Deserialize, Serialize};

/// H = ½(Π_x² + Π_y²) + ε sin ky cos kx in the plane, with a uniform magnetic field B = 1. Lengths are in gyroradii
/// at unit speed, times in radians of the gyration.
///
/// With the kinetic momenta Π and the guiding centre (X, Y) = (x + Π_y, y − Π_x), z = [Π_x, Y, Π_y, X] are canonical:
/// {Π_x, Π_y} = {Y, X} = 1. Then x = p₂ − p₁ and y = q₁ + q₂. At ε = 0 the velocity turns and the guiding centre
/// stands still. For small ε the guiding centre drifts along the contours of the potential, around cells between
/// separatrices. Averaged over the gyration, its Hamiltonian is [`CellularDrift::averaged`]: a product of a function
/// of Y and one of X, whereas those of [`Oscillators`](super::Oscillators) and of [`FullOrbit`](super::FullOrbit) are
/// sums of such functions, or nearly so.
///
/// Source: the cellular flow of Childress, <https://doi.org/10.1016/0031-9201(79)90039-6>, as an E × B drift.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellularDrift {
    /// The amplitude ε of the potential.
    pub epsilon: f64,
    /// The wavenumber k, in inverse gyroradii.
    #[serde(default = "CellularDrift::wavenumber")]
    pub wavenumber: f64,
}

impl CellularDrift {
    /// The system with the wavenumber k = 1.
    pub fn new(epsilon: f64) -> Self {
        Self { epsilon, wavenumber: Self::wavenumber() }
    }

    fn wavenumber() -> f64 {
        1.0
    }

    /// Fails unless k is positive.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] with the value.
    pub fn check(&self) -> Result<(), Error> {
        Error::check_range("system.wavenumber", self.wavenumber, Error::LEAST_POSITIVE, f64::MAX)
    }

    /// The average of ε sin ky cos kx over a gyration of radius ρ = √(2J) about the guiding centre (X, Y):
    /// εJ₀(√2 kρ) sin kY cos kX, J₀ the Bessel function.
    ///
    /// The potential is an eigenfunction of the Laplacian, so that its mean over a circle is its value at the centre
    /// times a factor that depends on the radius only.
    pub fn averaged(&self, z: &[f64; 4]) -> f64 {
        let [px, y, py, x] = *z;
        let k = self.wavenumber;
        let radius = libm::hypot(px, py);
        let bessel = libm::j0(self.argument(radius));
        self.epsilon * bessel * libm::sin(k * y) * libm::cos(k * x)
    }

    /// The argument √2 kρ of the Bessel functions, for a gyroradius ρ.
    fn argument(&self, radius: f64) -> f64 {
        std::f64::consts::SQRT_2 * self.wavenumber * radius
    }

    /// (sin, cos) of ky and of kx.
    #[inline(always)]
    fn waves<S: Elementary>(&self, z: &[S]) -> [(S, S); 2] {
        let k = S::from_f64(self.wavenumber);
        [(k * (z[0] + z[1])).sin_cos(), (k * (z[3] - z[2])).sin_cos()]
    }

    /// The slopes of the potential, ε(∂φ/∂x, ∂φ/∂y) with φ = sin ky cos kx.
    #[inline(always)]
    fn slopes<S: Elementary>(&self, z: &[S]) -> (S, S) {
        let [(sin_y, cos_y), (sin_x, cos_x)] = self.waves(z);
        let size = S::from_f64(self.epsilon * self.wavenumber);
        (-(size * sin_y * sin_x), size * cos_y * cos_x)
    }
}

impl Hamiltonian for CellularDrift {
    fn dof(&self) -> usize {
        2
    }
    #[inline(always)]
    fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
        let [(sin_y, _), (_, cos_x)] = self.waves(z);
        let potential = S::from_f64(self.epsilon) * sin_y * cos_x;
        S::from_f64(0.5).mul_add(z[0].mul_add(z[0], z[2] * z[2]), potential)
    }
    #[inline(always)]
    fn vector_field<S: Elementary>(&self, z: &[S], _: f64, out: &mut [S]) {
        let (by_x, by_y) = self.slopes(z);
        (out[0], out[1]) = (z[2] - by_x, by_x);
        (out[2], out[3]) = (-(z[0] + by_y), -by_y);
    }
    fn fastest_frequency(&self, _: &[f64]) -> f64 {
        self.limiting_fastest_frequency()
    }
}

impl NearlyPeriodic for CellularDrift {
    fn epsilon(&self) -> f64 {
        self.epsilon
    }
    fn circle_action(&self) -> CircleAction {
        CircleAction::new([1, 0])
    }
    fn limiting_frequency(&self) -> f64 {
        1.0
    }
    /// The adiabatic invariant to leading order, μ₀ = ½(Π_x² + Π_y²).
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S {
        S::from_f64(0.5) * z[0].mul_add(z[0], z[2] * z[2])
    }
    /// J₀(√2 kρ) with ρ² = Π_x² + Π_y², and its derivative by ½ρ², as means over the gyration; of second order, with U
    /// = Y + X and V = Y − X, the coefficients of 1, of cos 2kU + cos 2kV and of sin kU sin kV. NaN where √2 kρ is
    /// above 10, and of second order above 4.
    #[inline(always)]
    fn average_constants<S: Elementary>(
        &self,
        z: &[S],
        order: usize,
    ) -> Option<AverageConstants<S>> {
        let wavenumber = std::f64::consts::SQRT_2 * self.wavenumber;
        let radius = average::radius(z[0], z[2]);
        let (mut even, mut odd) = ([Jet::zero(); POINTS], [Jet::zero(); POINTS]);
        let mut slope = S::zero();
        for i in 0..POINTS {
            let v = Jet::linear(QUARTER[i] * wavenumber, radius);
            (odd[i], even[i]) = v.sin_cos_of_linear();
            let weight = 1.0 - QUARTER[i] * QUARTER[i];
            let share = wavenumber * wavenumber * weight / POINTS as f64;
            slope -= S::from_f64(share) * even[i].value();
        }
        let mean = average::mean(&even);
        let most = if order == 1 { average::RESOLVED } else { average::INTEGRALS_RESOLVED };
        let resolved = average::zero_within(most, S::from_f64(wavenumber) * radius);
        let first = [mean.value() + resolved, slope + resolved, S::zero(), S::zero()];
        if order == 1 {
            return Some(AverageConstants { first, second: None });
        }
        let of_even = average::mean_of_product(&even, &even) - mean * mean;
        let of_odd = average::mean_of_product(&odd, &odd);
        let across = average::mean_across(&even, &even) - mean * mean;
        let drift = average::mean_with_integral(&odd, &odd);
        let drift = drift.times(0.5 * self.wavenumber * self.wavenumber).with_slope(radius);
        let across = across.times(-0.25).slopes(radius);
        let mut second = [[S::zero(); 2]; 6];
        second[0] = (of_even + of_odd).times(-0.125).slopes(radius);
        second[1] = (of_odd - of_even).times(-0.0625).slopes(radius);
        second[2] = [across[0] + drift[0], across[1] + drift[1]];
        Some(AverageConstants { first, second: Some(second) })
    }
    /// The vector field of [`CellularDrift::averaged`], and of the second order of averaging.
    #[inline(always)]
    fn averaged_field<S: Elementary>(
        &self,
        z: &[S],
        constants: &AverageConstants<S>,
        out: &mut [S],
    ) {
        let [bessel, slope, ..] = constants.first;
        let (epsilon, k) = (S::from_f64(self.epsilon), S::from_f64(self.wavenumber));
        let ((sin_y, cos_y), (sin_x, cos_x)) = ((k * z[1]).sin_cos(), (k * z[3]).sin_cos());
        let mut shift = epsilon * slope * sin_y * cos_x;
        let size = epsilon * k * bessel;
        (out[1], out[3]) = (-(size * sin_y * sin_x), -(size * cos_y * cos_x));
        if let Some([[_, a0], [a1, b1], [a2, b2], ..]) = constants.second {
            let (one, two, half) = (S::from_f64(1.0), S::from_f64(2.0), S::from_f64(0.5));
            let square = S::from_f64(self.epsilon * self.epsilon);
            let (double_sx, double_cx) = (two * sin_x * cos_x, one - two * sin_x * sin_x);
            let (double_sy, double_cy) = (two * sin_y * cos_y, one - two * sin_y * sin_y);
            let size = two * k * square;
            out[1] -= size * double_sx * (two * a1 * double_cy + half * a2);
            out[3] += size * double_sy * (two * a1 * double_cx - half * a2);
            let waves = two * b1 * double_cy * double_cx + half * b2 * (double_cx - double_cy);
            shift += square * (a0 + waves);
        }
        (out[0], out[2]) = (shift * z[2], -(shift * z[0]));
    }
    /// sin ky cos kx = ½ sin k(y + x) + ½ sin k(y − x): A and B.
    fn average_split(&self) -> Option<Vec<f64>> {
        Some(vec![0.0; 2])
    }
    fn average_has_cross(&self) -> bool {
        true
    }
    #[inline(always)]
    fn flow_of_average<S: Elementary>(
        &self,
        part: AveragePart,
        z: &mut [S],
        constants: &AverageConstants<S>,
        time: S,
    ) -> S {
        let [bessel, slope, ..] = constants.first;
        let (one, two, half) = (S::from_f64(1.0), S::from_f64(2.0), S::from_f64(0.5));
        let k = S::from_f64(self.wavenumber);
        let square = S::from_f64(self.epsilon * self.epsilon) * time;
        let form = match part {
            AveragePart::A => z[1] + z[3],
            AveragePart::B => z[1] - z[3],
            // sin kU sin kV = ½(cos 2kX − cos 2kY).
            AveragePart::Cross => {
                let Some([_, _, [a2, b2], ..]) = constants.second else { return S::zero() };
                let of_wave = square * k * a2;
                // Symmetric: half of the wave of X, that of Y, the other half.
                let (sin, first_cos) = (two * k * z[3]).sin_cos();
                z[1] -= half * of_wave * sin;
                let (sin, cos_y) = (two * k * z[1]).sin_cos();
                z[3] -= of_wave * sin;
                let (sin, last_cos) = (two * k * z[3]).sin_cos();
                z[1] -= half * of_wave * sin;
                return half * square * b2 * (half * (first_cos + last_cos) - cos_y);
            }
        };
        let half_of = S::from_f64(0.5 * self.epsilon) * time;
        let (sin, cos) = (k * form).sin_cos();
        let mut change = half_of * k * bessel * cos;
        let mut angle = half_of * slope * sin;
        if let Some([[_, a0], [a1, b1], ..]) = constants.second {
            change -= square * k * two * two * a1 * sin * cos;
            angle += square * (half * a0 + b1 * (one - two * sin * sin));
        }
        match part {
            AveragePart::A => z[1] += change,
            _ => z[1] -= change,
        }
        z[3] -= change;
        angle
    }
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S) {
        turn(z, 0, 2, time);
    }
}

/// A: the gyration. B: the potential, which depends on the position alone, and moves neither x nor y.
impl Splittable for CellularDrift {
    fn frequencies(&self) -> Vec<f64> {
        vec![1.0, 0.0]
    }
    #[inline(always)]
    fn flow_b<S: Elementary>(&self, z: &mut [S], time: S) {
        let (by_x, by_y) = self.slopes(z);
        let (by_x, by_y) = (by_x * time, by_y * time);
        (z[0], z[1]) = (z[0] - by_x, z[1] + by_x);
        (z[2], z[3]) = (z[2] - by_y, z[3] - by_y);
    }
}
