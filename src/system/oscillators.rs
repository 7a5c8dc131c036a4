//! Two nonlinearly coupled oscillators, one fast and one slow.

use super::average::{self, Jet, POINTS, QUARTER};
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

impl Oscillators {
    /// −∂G/∂q₂ and ∂G/∂J of the part G(q₂, J) of the averaged Hamiltonian over ε.
    #[inline(always)]
    fn of_average<S: Elementary>(&self, z: &[S], constants: &AverageConstants<S>) -> (S, S) {
        let [c, slope, ..] = constants.first;
        let (q, double) = (z[1], z[1] + z[1]);
        let (sin, cos) = double.sin_cos();
        let (mut force, mut shift) = (-(c * (cos - double * sin)), slope * q * cos);
        if let Some([[a, a_slope], [b, b_slope], ..]) = constants.second {
            let (one, two, epsilon) =
                (S::from_f64(1.0), S::from_f64(2.0), S::from_f64(self.epsilon));
            let (sin_of_four, cos_of_four) = (two * sin * cos, one - two * sin * sin);
            let square = epsilon * q * q;
            let even = b.mul_add(cos_of_four, a);
            let four = S::from_f64(4.0);
            force += four * square * b * sin_of_four - epsilon * double * even;
            shift += square * b_slope.mul_add(cos_of_four, a_slope);
        }
        (force, shift)
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
    /// c = R J₁(2R) with R² = q₁² + p₁² and its derivative by ½R², 2J₀(2R): the mean of q₁ sin 2q₁ over the circle, and
    /// twice that of cos 2q₁; NaN for radii R above 5, and of second order above 3. Of second order −¼ of the
    /// derivatives by ½R² of the sum and the difference of the variance of q₁ sin 2q₁ and that of q₁ cos 2q₁.
    #[inline(always)]
    fn average_constants<S: Elementary>(
        &self,
        z: &[S],
        order: usize,
    ) -> Option<AverageConstants<S>> {
        let radius = average::radius(z[0], z[2]);
        let (mut even, mut odd) = ([Jet::zero(); POINTS], [Jet::zero(); POINTS]);
        let mut slope = Jet::zero();
        for i in 0..POINTS {
            let v = Jet::linear(QUARTER[i], radius);
            let (sin, cos) = v.times(2.0).sin_cos_of_linear();
            (even[i], odd[i]) = (v * sin, v * cos);
            slope = slope + cos;
        }
        let c = average::mean(&even);
        let slope = slope.times(2.0 / POINTS as f64);
        let most = if order == 1 { average::RESOLVED } else { average::PRODUCTS_RESOLVED };
        let resolved = average::zero_within(most, S::from_f64(2.0) * radius);
        let first = [c.value() + resolved, slope.value() + resolved, S::zero(), S::zero()];
        if order == 1 {
            return Some(AverageConstants { first, second: None });
        }
        let of_even = average::mean_of_product(&even, &even) - c * c;
        let of_odd = average::mean_of_product(&odd, &odd);
        let mut second = [[S::zero(); 2]; 6];
        second[0] = (of_even + of_odd).times(-0.25).slopes(radius);
        second[1] = (of_even - of_odd).times(-0.25).slopes(radius);
        Some(AverageConstants { first, second: Some(second) })
    }
    /// The vector field of H̄ = ½ε(q₂² + p₂²) + εc q₂ cos 2q₂, of second order + ε²q₂²(a + b cos 4q₂).
    #[inline(always)]
    fn averaged_field<S: Elementary>(
        &self,
        z: &[S],
        constants: &AverageConstants<S>,
        out: &mut [S],
    ) {
        let epsilon = S::from_f64(self.epsilon);
        let (force, shift) = self.of_average(z, constants);
        let shift = epsilon * shift;
        (out[0], out[2]) = (shift * z[2], -(shift * z[0]));
        out[1] = epsilon * z[3];
        out[3] = epsilon * (force - z[1]);
    }
    /// A: the slow oscillator. B: εc q₂ cos 2q₂, and what is of second order.
    fn average_split(&self) -> Option<Vec<f64>> {
        Some(vec![0.0, self.epsilon])
    }
    #[inline(always)]
    fn flow_of_average<S: Elementary>(
        &self,
        part: AveragePart,
        z: &mut [S],
        constants: &AverageConstants<S>,
        time: S,
    ) -> S {
        match part {
            AveragePart::A | AveragePart::Cross => S::zero(),
            AveragePart::B => {
                let kick = S::from_f64(self.epsilon) * time;
                let (force, shift) = self.of_average(z, constants);
                z[3] = kick.mul_add(force, z[3]);
                kick * shift
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
