//! A charged particle that drifts through the cells of an electric potential.

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
    /// J₀(√2 kρ) with ρ² = Π_x² + Π_y², and its derivative by ½ρ².
    fn average_constants(&self, z: &[f64]) -> Option<AverageConstants> {
        let radius = libm::hypot(z[0], z[2]);
        let (k, argument) = (self.wavenumber, self.argument(radius));
        // J₁(x)/x is ½ at 0.
        let ratio = if argument < 1e-8 { 0.5 } else { libm::j1(argument) / argument };
        Some([libm::j0(argument), -2.0 * k * k * ratio, 0.0, 0.0])
    }
    /// The vector field of [`CellularDrift::averaged`].
    #[inline(always)]
    fn averaged_field<S: Elementary>(
        &self,
        z: &[S],
        [bessel, slope, ..]: &AverageConstants<S>,
        out: &mut [S],
    ) {
        let (epsilon, k) = (S::from_f64(self.epsilon), S::from_f64(self.wavenumber));
        let ((sin_y, cos_y), (sin_x, cos_x)) = ((k * z[1]).sin_cos(), (k * z[3]).sin_cos());
        let shift = epsilon * *slope * sin_y * cos_x;
        (out[0], out[2]) = (shift * z[2], -(shift * z[0]));
        let size = epsilon * k * *bessel;
        (out[1], out[3]) = (-(size * sin_y * sin_x), -(size * cos_y * cos_x));
    }
    /// sin ky cos kx = ½ sin k(y + x) + ½ sin k(y − x): A and B.
    fn average_split(&self) -> Option<Vec<f64>> {
        Some(vec![0.0; 2])
    }
    #[inline(always)]
    fn flow_of_average<S: Elementary>(
        &self,
        part: AveragePart,
        z: &mut [S],
        [bessel, slope, ..]: &AverageConstants<S>,
        time: S,
    ) -> S {
        let k = S::from_f64(self.wavenumber);
        let half = S::from_f64(0.5 * self.epsilon) * time;
        let form = match part {
            AveragePart::A => z[1] + z[3],
            AveragePart::B => z[1] - z[3],
        };
        let (sin, cos) = (k * form).sin_cos();
        let change = half * k * *bessel * cos;
        match part {
            AveragePart::A => z[1] += change,
            AveragePart::B => z[1] -= change,
        }
        z[3] -= change;
        half * *slope * sin
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
