//! Three coupled oscillators: two fast ones with different frequencies, and a slow one.

use super::{Hamiltonian, NearlyPeriodic, Splittable, turn};
use crate::error::Error;
use crate::layer::{CircleAction, TorusAction};
use crate::scalar::Elementary;
use serde::{Deserialize, Serialize};

/// H = ½(q₁² + p₁²) + ½ω(q₂² + p₂²) + ½ε(q₃² + p₃²) + ε cos(q₁ + q₂ + q₃).
///
/// z = [q₁, q₂, q₃, p₁, p₂, p₃]. At ε = 0 two planes turn, with frequencies 1 and ω: orbits run along tori rather
/// than circles, unless ω is a ratio of small integers. The coupling contains every harmonic kω + l of the two
/// frequencies, so that both actions change by O(ε) if none of them is small, and are exchanged if one is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThreeOscillators {
    /// The strength ε of the coupling.
    pub epsilon: f64,
    /// The frequency ω of the second plane over that of the first.
    #[serde(default = "ThreeOscillators::golden_mean")]
    pub frequency: f64,
}

impl ThreeOscillators {
    /// The system at this ε, with ω = ½(1 + √5), the farthest from all ratios of small integers.
    pub fn new(epsilon: f64) -> Self {
        Self { epsilon, frequency: Self::golden_mean() }
    }

    fn golden_mean() -> f64 {
        0.5 * (1.0 + libm::sqrt(5.0))
    }

    /// Fails unless ω is positive, at most 1000.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] with the value.
    pub fn check(&self) -> Result<(), Error> {
        const MOST: f64 = 1000.0;
        Error::check_range("system.frequency", self.frequency, Error::LEAST_POSITIVE, MOST)
    }

    /// ½(q² + p²) of a plane.
    #[inline(always)]
    fn action<S: Elementary>(z: &[S], plane: usize) -> S {
        S::from_f64(0.5) * z[plane].mul_add(z[plane], z[3 + plane] * z[3 + plane])
    }

    /// The weight of the second plane in the circle action nearest to the torus.
    fn weight(&self) -> f64 {
        self.frequency.round().max(1.0)
    }
}

impl Hamiltonian for ThreeOscillators {
    fn dof(&self) -> usize {
        3
    }
    #[inline(always)]
    fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
        let fast = S::from_f64(self.frequency).mul_add(Self::action(z, 1), Self::action(z, 0));
        let (_, coupling) = (z[0] + z[1] + z[2]).sin_cos();
        S::from_f64(self.epsilon).mul_add(Self::action(z, 2) + coupling, fast)
    }
    #[inline(always)]
    fn vector_field<S: Elementary>(&self, z: &[S], _: f64, out: &mut [S]) {
        let (epsilon, frequency) = (S::from_f64(self.epsilon), S::from_f64(self.frequency));
        let force = epsilon * (z[0] + z[1] + z[2]).sin_cos().0;
        (out[0], out[1], out[2]) = (z[3], frequency * z[4], epsilon * z[5]);
        out[3] = force - z[0];
        out[4] = force - frequency * z[1];
        out[5] = force - epsilon * z[2];
    }
    fn fastest_frequency(&self, _: &[f64]) -> f64 {
        self.frequency.max(1.0)
    }
}

impl NearlyPeriodic for ThreeOscillators {
    fn epsilon(&self) -> f64 {
        self.epsilon
    }
    /// (1, ω rounded, 0): the circle nearest to the torus.
    fn circle_action(&self) -> CircleAction {
        CircleAction::new([1, self.weight() as i32, 0])
    }
    fn limiting_frequency(&self) -> f64 {
        1.0
    }
    fn torus(&self) -> (TorusAction, Vec<f64>) {
        (TorusAction::of_first_planes(2, 3), vec![1.0, self.frequency])
    }
    /// The action of the circle nearest to the torus.
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S {
        S::from_f64(self.weight()).mul_add(Self::action(z, 1), Self::action(z, 0))
    }
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S) {
        turn(z, 0, 3, time);
        turn(z, 1, 4, S::from_f64(self.frequency) * time);
    }
}

/// A: the oscillators turn, with frequencies 1, ω and ε. B: p ← p + hε sin(q₁ + q₂ + q₃).
impl Splittable for ThreeOscillators {
    fn frequencies(&self) -> Vec<f64> {
        vec![1.0, self.frequency, self.epsilon]
    }
    #[inline(always)]
    fn flow_b<S: Elementary>(&self, z: &mut [S], time: S) {
        let force = (z[0] + z[1] + z[2]).sin_cos().0;
        let kick = S::from_f64(self.epsilon) * time * force;
        for p in &mut z[3..6] {
            *p += kick;
        }
    }
}
