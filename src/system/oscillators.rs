//! Two nonlinearly coupled oscillators, one fast and one slow.

use super::{AverageConstants, AveragePart, Hamiltonian, NearlyPeriodic, Splittable, turn};
use crate::layer::CircleAction;
use crate::scalar::Elementary;
use serde::{Deserialize, Serialize};

/// H = ½(q₁² + p₁²) + ½ε(q₂² + p₂²) + εU(q₁, q₂),
/// U = q₁q₂ sin(2q₁ + 2q₂).
///
/// z = [q₁, q₂, p₁, p₂]. At ε = 0 the first oscillator turns with frequency 1
/// and the second stands still.
///
/// Source: section "Nonlinearly Coupled Oscillators" of
/// <https://doi.org/10.1038/s41598-023-34862-w>.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Oscillators {
    /// The strength ε of the coupling.
    pub epsilon: f64,
}

impl Oscillators {
    /// The coupling U(q₁, q₂) of the two oscillators.
    pub fn coupling<S: Elementary>(q1: S, q2: S) -> S {
        let two = S::from_f64(2.0);
        q1 * q2 * (two * (q1 + q2)).sin_cos().0
    }

    /// The gradient of the coupling, (∂U/∂q₁, ∂U/∂q₂).
    #[inline(always)]
    pub fn coupling_gradient<S: Elementary>(q1: S, q2: S) -> (S, S) {
        let two = S::from_f64(2.0);
        let (s, c) = (two * (q1 + q2)).sin_cos();
        let common = two * q1 * q2 * c;
        (q2.mul_add(s, common), q1.mul_add(s, common))
    }

    /// The averaged slow oscillator and its point (q₂, p₂) at z: the average is over the circle of
    /// the fast oscillator.
    pub fn averaged(z: &[f64; 4]) -> (AveragedOscillator, [f64; 2]) {
        (AveragedOscillator::new(libm::hypot(z[0], z[2])), [z[1], z[3]])
    }
}

impl Hamiltonian for Oscillators {
    fn dof(&self) -> usize {
        2
    }
    fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
        let half = S::from_f64(0.5);
        let slow = half * (z[1] * z[1] + z[3] * z[3]) + Self::coupling(z[0], z[1]);
        half * (z[0] * z[0] + z[2] * z[2]) + S::from_f64(self.epsilon) * slow
    }
    #[inline(always)]
    fn vector_field<S: Elementary>(&self, z: &[S], _: f64, out: &mut [S]) {
        let epsilon = S::from_f64(self.epsilon);
        let (u1, u2) = Self::coupling_gradient(z[0], z[1]);
        out[0] = z[2];
        out[1] = epsilon * z[3];
        out[2] = -(z[0] + epsilon * u1);
        out[3] = -(epsilon * (z[1] + u2));
    }
    fn fastest_frequency(&self, _: &[f64]) -> f64 {
        self.limiting_fastest_frequency()
    }
}

impl NearlyPeriodic for Oscillators {
    fn epsilon(&self) -> f64 {
        self.epsilon
    }
    fn circle_action(&self) -> CircleAction {
        CircleAction::new([1, 0])
    }
    fn limiting_frequency(&self) -> f64 {
        1.0
    }
    /// μ₀ = ½(q₁² + p₁²).
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S {
        S::from_f64(0.5) * z[0].mul_add(z[0], z[2] * z[2])
    }
    /// c = R J₁(2R) with R² = q₁² + p₁², and its derivative by ½R², 2J₀(2R).
    fn average_constants(&self, z: &[f64]) -> Option<AverageConstants> {
        let radius = libm::hypot(z[0], z[2]);
        Some([radius * libm::j1(2.0 * radius), 2.0 * libm::j0(2.0 * radius), 0.0, 0.0])
    }
    /// The vector field of H̄ = ½ε(q₂² + p₂²) + εc q₂ cos 2q₂.
    #[inline(always)]
    fn averaged_field<S: Elementary>(
        &self,
        z: &[S],
        [c, slope, ..]: &AverageConstants<S>,
        out: &mut [S],
    ) {
        let epsilon = S::from_f64(self.epsilon);
        let (sin, cos) = (z[1] + z[1]).sin_cos();
        let shift = epsilon * *slope * z[1] * cos;
        (out[0], out[2]) = (shift * z[2], -(shift * z[0]));
        out[1] = epsilon * z[3];
        out[3] = -(epsilon * (z[1] + *c * (cos - (z[1] + z[1]) * sin)));
    }
    /// A: the slow oscillator. B: εc q₂ cos 2q₂.
    fn average_split(&self) -> Option<Vec<f64>> {
        Some(vec![0.0, self.epsilon])
    }
    #[inline(always)]
    fn flow_of_average<S: Elementary>(
        &self,
        part: AveragePart,
        z: &mut [S],
        [c, slope, ..]: &AverageConstants<S>,
        time: S,
    ) -> S {
        match part {
            AveragePart::A => S::zero(),
            AveragePart::B => {
                let (double, kick) = (z[1] + z[1], S::from_f64(self.epsilon) * time);
                let (sin, cos) = double.sin_cos();
                z[3] -= kick * *c * (cos - double * sin);
                kick * *slope * z[1] * cos
            }
        }
    }
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S) {
        turn(z, 0, 2, time);
    }
}

/// A: both oscillators turn, with frequencies 1 and ε. B: p ← p − hε∇U.
impl Splittable for Oscillators {
    fn frequencies(&self) -> Vec<f64> {
        vec![1.0, self.epsilon]
    }
    #[inline(always)]
    fn flow_b<S: Elementary>(&self, z: &mut [S], time: S) {
        let kick = -(S::from_f64(self.epsilon) * time);
        let (u1, u2) = Self::coupling_gradient(z[0], z[1]);
        z[2] = kick.mul_add(u1, z[2]);
        z[3] = kick.mul_add(u2, z[3]);
    }
}

/// The averaged slow oscillator at fixed R² = q₁² + p₁²: one degree of freedom,
/// H̄ = ½(q² + p²) + q cos(2q) R J₁(2R), in the slow time εt.
///
/// Source: the averaged Hamiltonian of the section on the oscillators in
/// <https://doi.org/10.1038/s41598-023-34862-w>, without the common factor ε.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AveragedOscillator {
    /// The factor R J₁(2R) of its force.
    strength: f64,
}

impl AveragedOscillator {
    /// The average over the fast oscillator of amplitude R.
    pub fn new(radius: f64) -> Self {
        Self { strength: radius * libm::j1(2.0 * radius) }
    }
}

impl Hamiltonian for AveragedOscillator {
    fn dof(&self) -> usize {
        1
    }
    fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
        let two = S::from_f64(2.0);
        let (_, c) = (two * z[0]).sin_cos();
        let quadratic = S::from_f64(0.5) * z[0].mul_add(z[0], z[1] * z[1]);
        quadratic + S::from_f64(self.strength) * z[0] * c
    }
    fn vector_field<S: Elementary>(&self, z: &[S], _: f64, out: &mut [S]) {
        let two = S::from_f64(2.0);
        let (s, c) = (two * z[0]).sin_cos();
        out[0] = z[1];
        out[1] = -(z[0] + S::from_f64(self.strength) * (c - two * z[0] * s));
    }
    fn fastest_frequency(&self, _: &[f64]) -> f64 {
        1.0
    }
}
