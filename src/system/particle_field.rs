//! A charged particle in the electromagnetic field that it generates.

use super::{AverageConstants, Hamiltonian, NearlyPeriodic, Splittable, turn};
use crate::error::Error;
use crate::layer::CircleAction;
use crate::scalar::Elementary;
use serde::{Deserialize, Serialize};

/// The displacement V_k of the momentum of a field mode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum FieldProfile {
    /// No displacement, V = 0.
    Zero,
    /// A sine, V = a sin(bQ).
    Sine {
        /// The amplitude a of the sine.
        amplitude: f64,
        /// The wavenumber b of the sine.
        wavenumber: f64,
    },
    /// V = a exp(−bQ²), b ≥ 0.
    Gaussian {
        /// The amplitude a of the Gaussian.
        amplitude: f64,
        /// The rate b of the decay.
        rate: f64,
    },
}

impl FieldProfile {
    /// Whether its numbers are finite and it is bounded.
    pub fn is_sound(self) -> bool {
        match self {
            Self::Zero => true,
            Self::Sine { amplitude, wavenumber } => amplitude.is_finite() && wavenumber.is_finite(),
            Self::Gaussian { amplitude, rate } => {
                amplitude.is_finite() && rate.is_finite() && rate >= 0.0
            }
        }
    }

    /// The profile and its slope, (V(Q), V′(Q)).
    #[inline(always)]
    pub fn value_and_slope<S: Elementary>(self, x: S) -> (S, S) {
        match self {
            Self::Zero => (S::zero(), S::zero()),
            Self::Sine { amplitude, wavenumber } => {
                let (a, b) = (S::from_f64(amplitude), S::from_f64(wavenumber));
                let (s, c) = (b * x).sin_cos();
                (a * s, a * b * c)
            }
            Self::Gaussian { amplitude, rate } => {
                let value = S::from_f64(amplitude) * (S::from_f64(-rate) * x * x).exp();
                // The exponential wins over any Q.
                (value, (S::from_f64(-2.0 * rate) * x * value).zero_with(value))
            }
        }
    }
}

/// H = ½ε(p − Σ sin(kq)Q_k)² + ½Σ k([P_k − V_k(Q_k)]² + Q_k²), k = 1 … K.
///
/// n = K + 1 and z = [q, Q₁, …, Q_K, p, P₁, …, P_K]. At ε = 0 the modes turn
/// with frequencies k in the coordinates (Q_k, Π_k), Π_k = P_k − V_k(Q_k).
///
/// Source: section "Charged Particle Interacting with its Self-Generated
/// Electromagnetic Field" of <https://doi.org/10.1038/s41598-023-34862-w>.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParticleField {
    /// The parameter ε of the system.
    pub epsilon: f64,
    /// V₁ … V_K; their number is K.
    pub profiles: Vec<FieldProfile>,
}

impl ParticleField {
    /// The paper's two modes, V₁ = ½ sin 2Q₁ and V₂ = ½ exp(−5Q₂²).
    pub fn two_modes(epsilon: f64) -> Self {
        Self {
            epsilon,
            profiles: vec![
                FieldProfile::Sine { amplitude: 0.5, wavenumber: 2.0 },
                FieldProfile::Gaussian { amplitude: 0.5, rate: 5.0 },
            ],
        }
    }

    /// The point of the slow manifold μ₀ = 0 over (q, p): Q_k = 0, P_k = V_k(0).
    pub fn on_slow_manifold(&self, q: f64, p: f64) -> Vec<f64> {
        let mut z = vec![0.0; 2 * (self.modes() + 1)];
        (z[0], z[self.modes() + 1]) = (q, p);
        self.shift_momenta(&mut z, 1.0);
        z
    }

    /// The same particle in the coordinates (q, Q, p, Π), Π_k = P_k − V_k(Q_k): the system with V = 0, whose limit
    /// turns coordinate planes. [`Splittable::enter`] is the symplectic map to these coordinates.
    pub fn without_profiles(&self) -> Self {
        Self { epsilon: self.epsilon, profiles: vec![FieldProfile::Zero; self.modes()] }
    }

    /// Fails unless there is at least one mode, and all are sound.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the profile.
    pub fn check(&self) -> Result<(), Error> {
        if self.profiles.is_empty() {
            return Err(Error::invalid("system.profiles", "none", "at least one field mode"));
        }
        if let Some(profile) = self.profiles.iter().find(|p| !p.is_sound()) {
            let expected = "finite numbers, the rate of a Gaussian not negative";
            return Err(Error::invalid("system.profiles", format!("{profile:?}"), expected));
        }
        Ok(())
    }

    fn modes(&self) -> usize {
        self.profiles.len()
    }

    /// The kinetic momentum p − Σ sin(kq)Q_k of the particle, whose velocity is ε times this.
    #[inline(always)]
    fn velocity<S: Elementary>(&self, z: &[S]) -> S {
        let mut v = z[self.modes() + 1];
        for k in 1..=self.modes() {
            let (s, _) = (S::from_f64(k as f64) * z[0]).sin_cos();
            v = (-s).mul_add(z[k], v);
        }
        v
    }

    #[inline(always)]
    fn shift_momenta<S: Elementary>(&self, z: &mut [S], sign: f64) {
        for (k, profile) in self.profiles.iter().enumerate() {
            let (value, _) = profile.value_and_slope(z[k + 1]);
            let index = self.modes() + 2 + k;
            z[index] = value.mul_add(S::from_f64(sign), z[index]);
        }
    }
}

impl Hamiltonian for ParticleField {
    fn dof(&self) -> usize {
        self.modes() + 1
    }
    fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
        let half = S::from_f64(0.5);
        let v = self.velocity(z);
        half * S::from_f64(self.epsilon) * v * v + self.adiabatic_invariant(z)
    }
    #[inline(always)]
    fn vector_field<S: Elementary>(&self, z: &[S], _: f64, out: &mut [S]) {
        let n = self.dof();
        let drift = S::from_f64(self.epsilon) * self.velocity(z);
        out[0] = drift;
        let mut force = S::zero();
        for (index, profile) in self.profiles.iter().enumerate() {
            let (i, k) = (index + 1, S::from_f64((index + 1) as f64));
            let (s, c) = (k * z[0]).sin_cos();
            force = (k * c).mul_add(z[i], force);
            let (value, slope) = profile.value_and_slope(z[i]);
            let turning = k * (z[n + i] - value);
            out[i] = turning;
            out[n + i] = drift.mul_add(s, turning.mul_add(slope, -(k * z[i])));
        }
        out[n] = drift * force;
    }
    fn fastest_frequency(&self, _: &[f64]) -> f64 {
        self.limiting_fastest_frequency()
    }
}

impl NearlyPeriodic for ParticleField {
    fn epsilon(&self) -> f64 {
        self.epsilon
    }
    /// Weights 0, 1, …, K.
    fn circle_action(&self) -> CircleAction {
        CircleAction::new((0..=self.modes() as i32).collect::<Vec<_>>())
    }
    fn limiting_frequency(&self) -> f64 {
        1.0
    }
    /// μ₀ = ½Σ k([P_k − V_k(Q_k)]² + Q_k²).
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S {
        let n = self.dof();
        let mut total = S::zero();
        for (index, profile) in self.profiles.iter().enumerate() {
            let i = index + 1;
            let momentum = z[n + i] - profile.value_and_slope(z[i]).0;
            let square = momentum.mul_add(momentum, z[i] * z[i]);
            total = S::from_f64(0.5 * i as f64).mul_add(square, total);
        }
        total
    }
    /// Zeros, of first order. At second order modes in resonance exchange action, so that the actions are not conserved
    /// and there is no closed form.
    #[inline(always)]
    fn average_constants<S: Elementary>(
        &self,
        _: &[S],
        order: usize,
    ) -> Option<AverageConstants<S>> {
        (order == 1).then(AverageConstants::zero)
    }
    /// The vector field of H̄ = ½ε(p² + Σ sin²(kq) J_k), J_k = ½(Q_k² + Π_k²): in the square of Σ sin(kq)Q_k the
    /// products of two different modes average to 0, since their frequencies differ.
    #[inline(always)]
    fn averaged_field<S: Elementary>(&self, z: &[S], _: &AverageConstants<S>, out: &mut [S]) {
        let (n, half, epsilon) = (self.dof(), S::from_f64(0.5), S::from_f64(self.epsilon));
        out[0] = epsilon * z[n];
        out[n] = S::zero();
        for (index, profile) in self.profiles.iter().enumerate() {
            let (i, k) = (index + 1, S::from_f64((index + 1) as f64));
            let (s, c) = (k * z[0]).sin_cos();
            let (value, slope) = profile.value_and_slope(z[i]);
            let momentum = z[n + i] - value;
            let action = half * momentum.mul_add(momentum, z[i] * z[i]);
            out[n] -= epsilon * k * s * c * action;
            let frequency = half * epsilon * s * s;
            out[i] = frequency * momentum;
            out[n + i] = out[i].mul_add(slope, -(frequency * z[i]));
        }
    }
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S) {
        let n = self.dof();
        self.enter(z);
        for k in 1..=self.modes() {
            turn(z, k, n + k, S::from_f64(k as f64) * time);
        }
        self.leave(z);
    }
}

/// In the coordinates (q, Q, p, Π) the profiles drop out of the dynamics:
/// Λ₀⁻¹ is applied once before and Λ₀ once after an integration.
/// A: (Q_k, Π_k) turns with frequency k. B: the flow of ½εv², on which v and Q are
/// constant.
impl Splittable for ParticleField {
    #[inline(always)]
    fn enter<S: Elementary>(&self, z: &mut [S]) {
        self.shift_momenta(z, -1.0);
    }
    #[inline(always)]
    fn leave<S: Elementary>(&self, z: &mut [S]) {
        self.shift_momenta(z, 1.0);
    }
    fn frequencies(&self) -> Vec<f64> {
        (0..=self.modes()).map(|k| k as f64).collect()
    }
    /// With d = εvh/2 and m = q + d: q += 2d, p += 2ΣQ_k cos(km) sin(kd),
    /// Π_k += (2/k) sin(km) sin(kd).
    #[inline(always)]
    fn flow_b<S: Elementary>(&self, z: &mut [S], time: S) {
        let n = self.dof();
        let two = S::from_f64(2.0);
        let d = S::from_f64(0.5 * self.epsilon) * self.velocity(z) * time;
        let m = z[0] + d;
        z[0] = two.mul_add(d, z[0]);
        for index in 1..=self.modes() {
            let k = S::from_f64(index as f64);
            let (sm, cm) = (k * m).sin_cos();
            let (sd, _) = (k * d).sin_cos();
            z[n] = (two * z[index] * cm).mul_add(sd, z[n]);
            z[n + index] = (two / k * sm).mul_add(sd, z[n + index]);
        }
    }
}
