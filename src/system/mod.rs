//! Nearly-periodic Hamiltonian systems: one file each.

mod counted;
mod oscillators;
mod particle_field;

pub use counted::Counted;
pub use oscillators::{AveragedOscillator, Oscillators};
pub use particle_field::{FieldProfile, ParticleField};

use crate::error::Error;
use crate::layer::CircleAction;
use crate::scalar::Elementary;
use serde::{Deserialize, Serialize};

/// A nearly-periodic Hamiltonian system on ℝ²ⁿ with the canonical form.
///
/// Its flow at ε = 0 is ψ∘Φ_{ω₀t}∘ψ⁻¹ with the system's circle action Φ, a
/// constant frequency ω₀ and a symplectic map ψ (the identity where the action
/// is linear in the coordinates).
pub trait Hamiltonian {
    /// n.
    fn dof(&self) -> usize;

    /// ε.
    fn epsilon(&self) -> f64;

    /// H(z).
    fn energy<S: Elementary>(&self, z: &[S]) -> S;

    /// `out` ← Ω∇H(z), the equations of motion written out.
    fn vector_field<S: Elementary>(&self, z: &[S], out: &mut [S]);

    /// Φ, the circle action of the limit ε = 0, up to conjugation.
    fn circle_action(&self) -> CircleAction;

    /// ω₀, the angular frequency of the limit.
    fn limiting_frequency(&self) -> f64;

    /// μ₀(z), the adiabatic invariant to leading order.
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S;

    /// z ← the exact flow of the limit ε = 0 over `time`: the rotation that a
    /// surrogate has to improve upon.
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S);
}

/// A Hamiltonian H = H_A + H_B whose two parts have exact flows: what a
/// splitting composes. H_A = ½Σ ω_j(q_j² + p_j²) turns planes.
pub trait Splittable: Hamiltonian {
    /// z ← the coordinates in which the parts are simple. Applied once before
    /// an integration.
    fn enter<S: Elementary>(&self, z: &mut [S]);

    /// The inverse of [`Splittable::enter`].
    fn leave<S: Elementary>(&self, z: &mut [S]);

    /// ω_j of each plane (q_j, p_j).
    fn frequencies(&self) -> Vec<f64>;

    /// z ← the flow of the perturbation, of size ε, over `time`.
    fn flow_b<S: Elementary>(&self, z: &mut [S], time: S);
}

/// Any system of the crate, as scenes name it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum System {
    /// The paper's two nonlinearly coupled oscillators.
    Oscillators(Oscillators),
    /// The paper's charged particle in its own field, of any number of modes.
    ParticleField(ParticleField),
}

/// Runs `$body` on the system behind the enum.
macro_rules! each_system {
    ($self:expr, $system:ident => $body:expr) => {
        match $self {
            System::Oscillators($system) => $body,
            System::ParticleField($system) => $body,
        }
    };
}

impl System {
    /// The system with another ε.
    pub fn with_epsilon(mut self, epsilon: f64) -> Self {
        match &mut self {
            Self::Oscillators(system) => system.epsilon = epsilon,
            Self::ParticleField(system) => system.epsilon = epsilon,
        }
        self
    }

    /// Fails unless ε is finite and the system has a mode.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] and [`Error::Invalid`] with the value.
    pub fn check(&self) -> Result<(), Error> {
        Error::check_finite("system.epsilon", self.epsilon())?;
        if self.dof() < 2 {
            return Err(Error::invalid("system.profiles", "none", "at least one field mode"));
        }
        if let Self::ParticleField(system) = self
            && let Some(profile) = system.profiles.iter().find(|p| !p.is_sound())
        {
            let expected = "finite numbers, the rate of a Gaussian not negative";
            return Err(Error::invalid("system.profiles", format!("{profile:?}"), expected));
        }
        Ok(())
    }
}

impl Hamiltonian for System {
    fn dof(&self) -> usize {
        each_system!(self, s => s.dof())
    }
    fn epsilon(&self) -> f64 {
        each_system!(self, s => s.epsilon())
    }
    fn energy<S: Elementary>(&self, z: &[S]) -> S {
        each_system!(self, s => s.energy(z))
    }
    fn vector_field<S: Elementary>(&self, z: &[S], out: &mut [S]) {
        each_system!(self, s => s.vector_field(z, out))
    }
    fn circle_action(&self) -> CircleAction {
        each_system!(self, s => s.circle_action())
    }
    fn limiting_frequency(&self) -> f64 {
        each_system!(self, s => s.limiting_frequency())
    }
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S {
        each_system!(self, s => s.adiabatic_invariant(z))
    }
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S) {
        each_system!(self, s => s.limiting_flow(z, time))
    }
}

impl Splittable for System {
    fn enter<S: Elementary>(&self, z: &mut [S]) {
        each_system!(self, s => s.enter(z))
    }
    fn leave<S: Elementary>(&self, z: &mut [S]) {
        each_system!(self, s => s.leave(z))
    }
    fn frequencies(&self) -> Vec<f64> {
        each_system!(self, s => s.frequencies())
    }
    fn flow_b<S: Elementary>(&self, z: &mut [S], time: S) {
        each_system!(self, s => s.flow_b(z, time))
    }
}

/// Turns the plane (q, p) clockwise by `angle`.
fn turn<S: Elementary>(z: &mut [S], q: usize, p: usize, angle: S) {
    let (s, c) = angle.sin_cos();
    let (x, y) = (z[q], z[p]);
    z[q] = c.mul_add(x, s * y);
    z[p] = c.mul_add(y, -(s * x));
}
