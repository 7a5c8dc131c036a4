//! All systems of the crate behind one type.

use super::{
    AverageConstants, AveragePart, AveragedOscillator, CellularDrift, FieldLines, FullOrbit,
    Hamiltonian, NearlyPeriodic, Oscillators, ParticleField, ThreeOscillators, VanDerPol,
};
use crate::error::Error;
use crate::layer::{CircleAction, TorusAction};
use crate::scalar::{Elementary, Task};
use serde::{Deserialize, Serialize};

/// Any system of the crate, by its name in scenes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum System {
    /// The paper's two nonlinearly coupled oscillators.
    Oscillators(Oscillators),
    /// The paper's charged particle in its own field, of any number of modes.
    ParticleField(ParticleField),
    /// Magnetic field lines of a tokamak.
    FieldLines(FieldLines),
    /// A charged particle in a strong magnetic field.
    FullOrbit(FullOrbit),
    /// A charged particle that drifts through the cells of a potential.
    CellularDrift(CellularDrift),
    /// Two fast oscillators and a slow one.
    ThreeOscillators(ThreeOscillators),
    /// A self-excited oscillator with a slow one: not Hamiltonian.
    VanDerPol(VanDerPol),
}

/// Runs `$body` on the system behind the enum.
macro_rules! each_system {
    ($self:expr, $system:ident => $body:expr) => {
        match $self {
            $crate::system::System::Oscillators($system) => $body,
            $crate::system::System::ParticleField($system) => $body,
            $crate::system::System::FieldLines($system) => $body,
            $crate::system::System::FullOrbit($system) => $body,
            $crate::system::System::CellularDrift($system) => $body,
            $crate::system::System::ThreeOscillators($system) => $body,
            $crate::system::System::VanDerPol($system) => $body,
        }
    };
}
pub(crate) use each_system;

impl System {
    /// The name of the kind of system in scenes.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Oscillators(_) => "oscillators",
            Self::ParticleField(_) => "particle-field",
            Self::FieldLines(_) => "field-lines",
            Self::FullOrbit(_) => "full-orbit",
            Self::CellularDrift(_) => "cellular-drift",
            Self::ThreeOscillators(_) => "three-oscillators",
            Self::VanDerPol(_) => "van-der-pol",
        }
    }

    /// Whether it is not Hamiltonian: nothing is conserved, not even nearly.
    pub fn dissipates(&self) -> bool {
        matches!(self, Self::VanDerPol(_))
    }

    /// The system with another ε.
    pub fn with_epsilon(mut self, epsilon: f64) -> Self {
        match &mut self {
            Self::Oscillators(system) => system.epsilon = epsilon,
            Self::ParticleField(system) => system.epsilon = epsilon,
            Self::FieldLines(system) => system.epsilon = epsilon,
            Self::FullOrbit(system) => system.epsilon = epsilon,
            Self::CellularDrift(system) => system.epsilon = epsilon,
            Self::ThreeOscillators(system) => system.epsilon = epsilon,
            Self::VanDerPol(system) => system.epsilon = epsilon,
        }
        self
    }

    /// Fails unless the system is sound with each of these ε.
    ///
    /// # Errors
    /// Those of [`System::check`].
    pub fn check_with(&self, epsilons: &[f64]) -> Result<(), Error> {
        epsilons.iter().try_for_each(|epsilon| self.clone().with_epsilon(*epsilon).check())
    }

    /// Fails unless ε is finite and the system is sound.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] and [`Error::Invalid`] with the value.
    pub fn check(&self) -> Result<(), Error> {
        Error::check_finite("system.epsilon", self.epsilon())?;
        match self {
            Self::Oscillators(_) => Ok(()),
            Self::ParticleField(system) => system.check(),
            Self::FieldLines(system) => system.check(),
            Self::FullOrbit(system) => system.check(),
            Self::CellularDrift(system) => system.check(),
            Self::ThreeOscillators(system) => system.check(),
            Self::VanDerPol(system) => system.check(),
        }
    }
}

/// Properties of single systems that studies need; a new system is added here.
impl System {
    /// Whether its limit turns at the same frequency everywhere; false where each surface has a
    /// frequency of its own.
    pub fn turns_at_one_frequency(&self) -> bool {
        !matches!(self, Self::FieldLines(_))
    }

    /// Whether a portrait of the first plane that the limit does not turn is useful; for a particle
    /// in its own field the motion in it is a straight line.
    pub fn has_slow_portrait(&self) -> bool {
        !matches!(self, Self::ParticleField(_))
    }

    /// The Hamiltonian of the plane (q_j, p_j), j from 0, averaged over the fast motion, and the
    /// point of the plane at z; None where it is not known.
    pub fn averaged(&self, plane: usize, z: &[f64]) -> Option<(AveragedOscillator, [f64; 2])> {
        match (self, plane) {
            (Self::Oscillators(_), 1) => Some(Oscillators::averaged(z.try_into().ok()?)),
            _ => None,
        }
    }

    /// The point of the slow manifold, to order ε, over (q, p) of the slow plane; none where it is
    /// not known. Along it, to order ε, q = q(0) + εp(0)t and p = p(0).
    pub fn on_slow_manifold(&self, q: f64, p: f64) -> Option<Vec<f64>> {
        match self {
            Self::ParticleField(system) => Some(system.on_slow_manifold(q, p)),
            _ => None,
        }
    }

    /// The system of field lines, if it is one: it has the surfaces that they lie on.
    pub fn field_lines(&self) -> Option<&FieldLines> {
        match self {
            Self::FieldLines(system) => Some(system),
            _ => None,
        }
    }
}

/// Of one system, at a point.
struct VectorField<'a, H, S> {
    system: &'a H,
    z: &'a [S],
    time: f64,
    out: &'a mut [S],
}

impl<H: Hamiltonian, S: Elementary> Task for VectorField<'_, H, S> {
    #[inline(always)]
    fn run(self) {
        self.system.vector_field(self.z, self.time, self.out);
    }
}

impl Hamiltonian for System {
    fn dof(&self) -> usize {
        each_system!(self, s => s.dof())
    }
    fn energy<S: Elementary>(&self, z: &[S], time: f64) -> S {
        each_system!(self, s => s.energy(z, time))
    }
    #[inline(always)]
    fn add_dissipation<S: Elementary>(&self, z: &[S], time: f64, out: &mut [S]) {
        each_system!(self, s => s.add_dissipation(z, time, out))
    }
    /// The field of each system is a function of its own: otherwise every caller would contain all of them.
    #[inline(always)]
    fn vector_field<S: Elementary>(&self, z: &[S], time: f64, out: &mut [S]) {
        each_system!(self, system => S::outlined(VectorField { system, z, time, out }))
    }
    fn period(&self) -> Option<f64> {
        each_system!(self, s => s.period())
    }
    fn fastest_frequency(&self, z: &[f64]) -> f64 {
        each_system!(self, s => s.fastest_frequency(z))
    }
    fn check_point(&self, z: &[f64]) -> Result<(), Error> {
        each_system!(self, s => s.check_point(z))
    }
}

impl System {
    /// Whether the average over its circle has a closed form of an order.
    pub(crate) fn has_closed_average(&self, order: usize) -> bool {
        let point = vec![0.5; 2 * self.dof()];
        self.average_constants(&point, order).is_some()
    }
}

impl NearlyPeriodic for System {
    fn epsilon(&self) -> f64 {
        each_system!(self, s => s.epsilon())
    }
    fn circle_action(&self) -> CircleAction {
        each_system!(self, s => s.circle_action())
    }
    fn limiting_frequency(&self) -> f64 {
        each_system!(self, s => s.limiting_frequency())
    }
    fn torus(&self) -> (TorusAction, Vec<f64>) {
        each_system!(self, s => s.torus())
    }
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S {
        each_system!(self, s => s.adiabatic_invariant(z))
    }
    fn customary_invariant<S: Elementary>(&self, z: &[S]) -> Option<(&'static str, S)> {
        each_system!(self, s => s.customary_invariant(z))
    }
    #[inline(always)]
    fn average_constants<S: Elementary>(
        &self,
        z: &[S],
        order: usize,
    ) -> Option<AverageConstants<S>> {
        each_system!(self, s => s.average_constants(z, order))
    }
    #[inline(always)]
    fn averaged_field<S: Elementary>(
        &self,
        z: &[S],
        constants: &AverageConstants<S>,
        out: &mut [S],
    ) {
        each_system!(self, s => s.averaged_field(z, constants, out))
    }
    fn average_split(&self) -> Option<Vec<f64>> {
        each_system!(self, s => s.average_split())
    }
    fn average_has_cross(&self) -> bool {
        each_system!(self, s => s.average_has_cross())
    }
    #[inline(always)]
    fn flow_of_average<S: Elementary>(
        &self,
        part: AveragePart,
        z: &mut [S],
        constants: &AverageConstants<S>,
        time: S,
    ) -> S {
        each_system!(self, s => s.flow_of_average(part, z, constants, time))
    }
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S) {
        each_system!(self, s => s.limiting_flow(z, time))
    }
}
