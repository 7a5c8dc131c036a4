//! A self-excited oscillator and a slow one that holds it back: not Hamiltonian.

use super::{AverageConstants, Hamiltonian, NearlyPeriodic, Splittable, turn};
use crate::error::Error;
use crate::layer::CircleAction;
use crate::scalar::Elementary;
use serde::{Deserialize, Serialize};

/// Van der Pol's oscillator, whose intensity drives a slow damped oscillator that holds its excitation back,
///
/// q₁′ = p₁, p₁′ = −q₁ + ε(1 − q₁² − q₂)p₁, q₂′ = εp₂, p₂′ = −εq₂ − εγp₂ + ½εq₁²:
///
/// the sum of Ω∇H with H = ½(q₁² + p₁²) + ½ε(q₂² + p₂²) and of terms that excite and damp.
///
/// z = [q₁, q₂, p₁, p₂]. At ε = 0 the first oscillator turns with frequency 1 and the second stands still. Over times
/// of 1/ε the action J = ½(q₁² + p₁²) changes by its own size: to first order J′ = εJ(1 − ½J − q₂),
/// q₂″ + εγq₂′ + ε²q₂ = ½ε²J. For γ above ¼(√41 − 5) = 0.351 almost all trajectories converge to a circle with
/// J = 1. Below, the circle is unstable, and J swings on a torus; without damping the swing keeps growing.
///
/// Source: the averaged equations after Sanders, Verhulst and Murdock,
/// <https://doi.org/10.1007/978-0-387-48918-6>, section 2.2; the slow oscillator is ours.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VanDerPol {
    /// The size ε of excitation, damping and coupling.
    pub epsilon: f64,
    /// γ, the damping of the slow oscillator.
    #[serde(default = "VanDerPol::usual_damping")]
    pub damping: f64,
}

impl VanDerPol {
    /// The system with γ = 0.3, in which J swings between 0.13 and 2.7.
    pub fn new(epsilon: f64) -> Self {
        Self { epsilon, damping: Self::usual_damping() }
    }

    fn usual_damping() -> f64 {
        0.3
    }

    /// Fails unless γ lies between 0 and 1000.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] with the value.
    pub fn check(&self) -> Result<(), Error> {
        const MOST: f64 = 1000.0;
        Error::check_range("system.damping", self.damping, 0.0, MOST)
    }

    /// 1 − q₁² − q₂.
    #[inline(always)]
    fn excitation<S: Elementary>(z: &[S]) -> S {
        S::from_f64(1.0) - z[0].mul_add(z[0], z[1])
    }
}

impl Hamiltonian for VanDerPol {
    fn dof(&self) -> usize {
        2
    }
    /// ½(q₁² + p₁²) + ½ε(q₂² + p₂²), which is not conserved.
    #[inline(always)]
    fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
        let half = S::from_f64(0.5);
        let slow = half * z[1].mul_add(z[1], z[3] * z[3]);
        half * z[0].mul_add(z[0], z[2] * z[2]) + S::from_f64(self.epsilon) * slow
    }
    #[inline(always)]
    fn add_dissipation<S: Elementary>(&self, z: &[S], _: f64, out: &mut [S]) {
        let epsilon = S::from_f64(self.epsilon);
        out[2] += epsilon * Self::excitation(z) * z[2];
        let drive = S::from_f64(0.5) * z[0] * z[0];
        out[3] += epsilon * (drive - S::from_f64(self.damping) * z[3]);
    }
    #[inline(always)]
    fn vector_field<S: Elementary>(&self, z: &[S], time: f64, out: &mut [S]) {
        let epsilon = S::from_f64(self.epsilon);
        out[0] = z[2];
        out[1] = epsilon * z[3];
        out[2] = -z[0];
        out[3] = -(epsilon * z[1]);
        self.add_dissipation(z, time, out);
    }
    fn fastest_frequency(&self, _: &[f64]) -> f64 {
        self.limiting_fastest_frequency()
    }
}

impl NearlyPeriodic for VanDerPol {
    fn epsilon(&self) -> f64 {
        self.epsilon
    }
    fn circle_action(&self) -> CircleAction {
        CircleAction::new([1, 0])
    }
    fn limiting_frequency(&self) -> f64 {
        1.0
    }
    /// J = ½(q₁² + p₁²), which is invariant in the limit only.
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S {
        S::from_f64(0.5) * z[0].mul_add(z[0], z[2] * z[2])
    }
    /// The average is a polynomial: there is nothing to keep. Of second order `second` is there, all 0.
    #[inline(always)]
    fn average_constants<S: Elementary>(
        &self,
        _: &[S],
        order: usize,
    ) -> Option<AverageConstants<S>> {
        let second = (order == 2).then(|| [[S::zero(); 2]; 6]);
        Some(AverageConstants { second, ..AverageConstants::zero() })
    }
    /// With a = q₁ + ip₁, r = |a|² and s = 1 − q₂: a′ = εa(½s − ⅛r), p₂′ = −εq₂ − εγp₂ + ¼εr. The second order adds
    /// iε²a(⅛s² − 3/16 rs + 11/256 r²) to a′: for r = 4, q₂ = 0 the frequency falls by ε²/16, as that of van der Pol's
    /// oscillator does.
    #[inline(always)]
    fn averaged_field<S: Elementary>(
        &self,
        z: &[S],
        constants: &AverageConstants<S>,
        out: &mut [S],
    ) {
        let epsilon = S::from_f64(self.epsilon);
        let square = z[0].mul_add(z[0], z[2] * z[2]);
        let rest = S::from_f64(1.0) - z[1];
        let growth = epsilon * S::from_f64(0.5).mul_add(rest, S::from_f64(-0.125) * square);
        (out[0], out[2]) = (growth * z[0], growth * z[2]);
        out[1] = epsilon * z[3];
        let drive = S::from_f64(0.25).mul_add(square, -(S::from_f64(self.damping) * z[3]));
        out[3] = epsilon * (drive - z[1]);
        if constants.second.is_some() {
            let of_rest = S::from_f64(0.125).mul_add(rest, S::from_f64(-0.1875) * square);
            let of_square = S::from_f64(11.0 / 256.0) * (square * square);
            let turn = epsilon * epsilon * rest.mul_add(of_rest, of_square);
            out[0] -= turn * z[2];
            out[2] += turn * z[0];
        }
    }
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S) {
        turn(z, 0, 2, time);
    }
}

/// A: both oscillators turn, with frequencies 1 and ε. B: excitation, damping and drive at fixed
/// positions, p₁ ← e^{hε(1 − q₁² − q₂)}p₁, p₂ ← p₂ + (1 − e^{−hεγ})(½q₁²/γ − p₂).
impl Splittable for VanDerPol {
    fn frequencies(&self) -> Vec<f64> {
        vec![1.0, self.epsilon]
    }
    #[inline(always)]
    fn flow_b<S: Elementary>(&self, z: &mut [S], time: S) {
        let slow = S::from_f64(self.epsilon) * time;
        z[2] = (slow * Self::excitation(z)).exp() * z[2];
        let drive = S::from_f64(0.5) * z[0] * z[0];
        // e^{−x} − 1 = −2t/(1 + t) of t = tanh(x/2), with all its digits, and over γ where that is 0.
        if self.damping == 0.0 {
            z[3] = slow.mul_add(drive, z[3]);
        } else {
            let damping = S::from_f64(self.damping);
            let (t, _) = (S::from_f64(0.5) * slow * damping).tanh_sech2();
            let share = (t + t) / (S::from_f64(1.0) + t);
            z[3] = share.mul_add(drive / damping - z[3], z[3]);
        }
    }
}
