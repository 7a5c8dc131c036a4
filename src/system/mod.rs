//! Nearly-periodic systems: Hamiltonian ones, and one that is not.

mod cellular_drift;
mod coils;
mod counted;
mod field_lines;
mod full_orbit;
mod oscillators;
mod particle_field;
mod three_oscillators;
mod van_der_pol;

pub use cellular_drift::CellularDrift;
pub use coils::{Coil, CoilField, CoilSet, Tokamak, Torsatron};
pub use counted::Counted;
pub use field_lines::FieldLines;
pub use full_orbit::FullOrbit;
pub use oscillators::{AveragedOscillator, Oscillators};
pub use particle_field::{FieldProfile, ParticleField};
pub use three_oscillators::ThreeOscillators;
pub use van_der_pol::VanDerPol;

use crate::error::Error;
use crate::layer::{CircleAction, TorusAction};
use crate::scalar::{Dual, Elementary, Task, max_or_nan};
use serde::{Deserialize, Serialize};

/// A Hamiltonian system on ℝ²ⁿ with the canonical form, defined by its energy alone. Friction and other forces that
/// do not derive from an energy are added: ż = Ω∇H(z, t) + D(z, t).
pub trait Hamiltonian {
    /// The degrees of freedom n.
    fn dof(&self) -> usize;

    /// H(z, t), which for most systems does not depend on the time. `#[inline(always)]` here and on all that it calls
    /// makes flows several times as fast: it is then compiled for the vector registers that they use.
    fn energy<S: Elementary>(&self, z: &[S], time: f64) -> S;

    /// `out` += D(z, t), which is not Hamiltonian; 0 by default. With it, flows are not symplectic.
    #[inline(always)]
    fn add_dissipation<S: Elementary>(&self, z: &[S], time: f64, out: &mut [S]) {
        let _ = (z, time, out);
    }

    /// `out` ← Ω∇H(z, t) + D(z, t), by default with dual numbers. Explicit equations of motion take a fraction of
    /// that time, and should be `#[inline(always)]` too.
    #[inline(always)]
    fn vector_field<S: Elementary>(&self, z: &[S], time: f64, out: &mut [S]) {
        symplectic_gradient(self, z, time, out);
        self.add_dissipation(z, time, out);
    }

    /// The period of H in time; None where H does not depend on it. Steps of a flow map begin at
    /// whole periods: over any other interval, the iterated map is not the flow.
    fn period(&self) -> Option<f64> {
        None
    }

    /// A rough angular frequency of the fastest motion near z: it sets the first step that a
    /// reference flow tries. By default it follows from the derivatives of the vector field.
    fn fastest_frequency(&self, z: &[f64]) -> f64 {
        let mut squares = 0.0;
        for direction in 0..z.len() {
            let along = |(i, &v)| Dual::<f64, 1>::variable(v, usize::from(i != direction));
            let z: Vec<_> = z.iter().enumerate().map(along).collect();
            let mut slope = z.clone();
            self.vector_field(&z, 0.0, &mut slope);
            squares += slope.iter().map(|v| v.eps[0] * v.eps[0]).sum::<f64>();
        }
        // For a plane that turns, this is the frequency of its rotation.
        let frequency = libm::sqrt(0.5 * squares);
        if frequency.is_finite() && frequency > 0.0 { frequency } else { 1.0 }
    }

    /// Fails unless the system is defined at z.
    ///
    /// # Errors
    /// With the point, and the condition that it does not meet.
    fn check_point(&self, z: &[f64]) -> Result<(), Error> {
        let _ = z;
        Ok(())
    }
}

/// `out` ← Ω∇H(z, t), with the gradient by dual numbers.
///
/// # Panics
/// When z and `out` do not both hold 2n numbers.
#[inline(always)]
pub fn symplectic_gradient<S: Elementary>(
    system: &(impl Hamiltonian + ?Sized),
    z: &[S],
    time: f64,
    out: &mut [S],
) {
    /// Small systems keep their working space on the stack.
    const STACK: usize = 16;
    let dim = z.len();
    assert!(out.len() == dim && dim.is_multiple_of(2), "{dim} and {} numbers", out.len());
    let mut stack = [Dual::constant(S::zero()); STACK];
    let mut heap;
    let lifted = if dim <= STACK {
        &mut stack[..dim]
    } else {
        heap = vec![Dual::constant(S::zero()); dim];
        &mut heap[..]
    };
    let dof = dim / 2;
    for k in 0..dof {
        for (lifted, &v) in lifted.iter_mut().zip(z) {
            *lifted = Dual::constant(v);
        }
        lifted[k] = Dual::variable(z[k], 0);
        lifted[dof + k] = Dual::variable(z[dof + k], 1);
        let [by_position, by_momentum] = system.energy(lifted, time).eps;
        out[k] = by_momentum;
        out[dof + k] = -by_position;
    }
}

/// The divergence Σ ∂żᵢ/∂zᵢ at z, by dual numbers: how fast volumes grow. It is 0 for a Hamiltonian
/// system.
pub fn divergence(system: &impl Hamiltonian, z: &[f64], time: f64) -> f64 {
    let mut sum = 0.0;
    for direction in 0..z.len() {
        let along = |(i, &v)| Dual::<f64, 1>::variable(v, usize::from(i != direction));
        let lifted: Vec<_> = z.iter().enumerate().map(along).collect();
        let mut field = lifted.clone();
        system.vector_field(&lifted, time, &mut field);
        sum += field[direction].eps[0];
    }
    sum
}

/// The functions of the actions that the closed form of an average takes as constants: at most four, others are 0. See
/// [`NearlyPeriodic::average_constants`].
pub type AverageConstants<S = f64> = [S; 4];

/// The two parts of a closed average whose flows are exact: see [`NearlyPeriodic::average_split`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AveragePart {
    /// The part whose flow is taken first: where planes turn in the average, the one that turns them.
    A,
    /// The rest of the average, apart from part A.
    B,
}

/// A nearly-periodic system.
///
/// Its flow at ε = 0 is ψ∘Φ_{ω₀t}∘ψ⁻¹ with the system's circle action Φ, a
/// constant frequency ω₀ and a symplectic map ψ (the identity where the action
/// is linear in the coordinates).
pub trait NearlyPeriodic: Hamiltonian {
    /// The parameter ε: at ε = 0 all orbits are periodic.
    fn epsilon(&self) -> f64;

    /// Φ, the circle action of the limit ε = 0, up to conjugation.
    fn circle_action(&self) -> CircleAction;

    /// ω₀, the angular frequency of the limit.
    fn limiting_frequency(&self) -> f64;

    /// The commuting circle actions of the limit, with the frequency of each. By default this is the one circle
    /// action; a limit whose orbits fill tori has several, each of which turns coordinate planes.
    fn torus(&self) -> (TorusAction, Vec<f64>) {
        (self.circle_action().into(), vec![self.limiting_frequency()])
    }

    /// μ₀(z), the adiabatic invariant to leading order; with dissipation, the action of the limit, which is then no
    /// invariant.
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S;

    /// Another approximate invariant, with its customary name; None by default.
    fn customary_invariant<S: Elementary>(&self, z: &[S]) -> Option<(&'static str, S)> {
        let _ = z;
        None
    }

    /// The functions of the actions at z that [`NearlyPeriodic::averaged_field`] takes as constants, since the
    /// averaged flow conserves them; None where the average has no closed form.
    fn average_constants(&self, z: &[f64]) -> Option<AverageConstants> {
        let _ = z;
        None
    }

    /// `out` ← the average, over the circle through z, of the vector field minus that of the limit, in closed form.
    /// It exists where [`NearlyPeriodic::average_constants`] does; elsewhere `out` is NaN.
    #[inline(always)]
    fn averaged_field<S: Elementary>(
        &self,
        z: &[S],
        constants: &AverageConstants<S>,
        out: &mut [S],
    ) {
        let _ = (z, constants);
        out.fill(S::from_f64(f64::NAN));
    }

    /// The frequencies at which part A of the [closed average](NearlyPeriodic::averaged_field) turns the planes, where
    /// the average is a sum A + B of two parts whose flows are exact; None where it is none.
    fn average_split(&self) -> Option<Vec<f64>> {
        None
    }

    /// z ← the exact flow over `time` of a part of the average: of A without its turns, or of B. The flow turns the
    /// circle through z too; that turn is left out, and its angle is returned. It exists where
    /// [`NearlyPeriodic::average_split`] does; elsewhere z and the angle are NaN.
    #[inline(always)]
    fn flow_of_average<S: Elementary>(
        &self,
        part: AveragePart,
        z: &mut [S],
        constants: &AverageConstants<S>,
        time: S,
    ) -> S {
        let _ = (part, constants, time);
        z.fill(S::from_f64(f64::NAN));
        S::from_f64(f64::NAN)
    }

    /// z ← the exact flow of the limit ε = 0 over `time`: the rotation that a
    /// surrogate has to improve upon.
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S);

    /// The frequency of the fastest plane of the limit.
    fn limiting_fastest_frequency(&self) -> f64 {
        let action = self.circle_action();
        let weights = action.weights().iter().map(|w| f64::from(w.abs()));
        weights.fold(1.0, max_or_nan) * self.limiting_frequency()
    }
}

/// A system with non-canonical coordinates in which its equations of motion are explicit or take less time: those
/// that one would integrate for the motion alone, without regard to the symplectic form.
pub trait NaturalCoordinates: Hamiltonian {
    /// z ← the natural coordinates of a point, 2n numbers.
    fn to_natural<S: Elementary>(&self, z: &mut [S]);

    /// x ← the canonical coordinates of a point in natural ones.
    fn to_canonical<S: Elementary>(&self, x: &mut [S]);

    /// Computes the vector field in these coordinates, `out` ← dx/dt.
    fn natural_field<S: Elementary>(&self, x: &[S], time: f64, out: &mut [S]);
}

/// A Hamiltonian H = H_A + H_B, or a vector field, with two parts that have exact flows, which a splitting composes.
/// H_A = ½Σ ω_j(q_j² + p_j²) turns planes.
pub trait Splittable: NearlyPeriodic {
    /// z ← the coordinates in which the parts are simple. Applied once before an integration. By
    /// default these are the system's own coordinates.
    #[inline(always)]
    fn enter<S: Elementary>(&self, z: &mut [S]) {
        let _ = z;
    }

    /// z ← the system's own coordinates: the inverse of [`Splittable::enter`].
    #[inline(always)]
    fn leave<S: Elementary>(&self, z: &mut [S]) {
        let _ = z;
    }

    /// ω_j of each plane (q_j, p_j).
    fn frequencies(&self) -> Vec<f64>;

    /// z ← the flow of the perturbation, of size ε, over `time`.
    fn flow_b<S: Elementary>(&self, z: &mut [S], time: S);
}

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
    fn average_constants(&self, z: &[f64]) -> Option<AverageConstants> {
        each_system!(self, s => s.average_constants(z))
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

/// Turns the plane (q, p) clockwise by `angle`.
fn turn<S: Elementary>(z: &mut [S], q: usize, p: usize, angle: S) {
    let (s, c) = angle.sin_cos();
    let (x, y) = (z[q], z[p]);
    z[q] = c.mul_add(x, s * y);
    z[p] = c.mul_add(y, -(s * x));
}
