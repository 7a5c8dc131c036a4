//! What systems with a fast rotation have: its limit, invariants, averages, parts with exact flows.

use super::Hamiltonian;
use crate::layer::{CircleAction, TorusAction};
use crate::scalar::{Elementary, max_or_nan};

/// The functions of the actions that the closed form of an average takes as constants: see
/// [`NearlyPeriodic::average_constants`].
#[derive(Clone, Copy, Debug)]
pub struct AverageConstants<S = f64> {
    /// The constants of the first order of the average: at most four, others are 0.
    pub first: [S; 4],
    /// The coefficients of the second order, each with its derivative by the action: at most six, others are 0. None
    /// where the average is of first order.
    pub second: Option<[[S; 2]; 6]>,
}

impl<S: Elementary> AverageConstants<S> {
    /// Constants of first order that are all zero.
    pub fn zero() -> Self {
        Self { first: [S::zero(); 4], second: None }
    }
}

/// The parts of a closed average whose flows are exact: see [`NearlyPeriodic::average_split`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AveragePart {
    /// The part whose flow is taken first: where planes turn in the average, the one that turns them.
    A,
    /// All of the average but the parts A and Cross.
    B,
    /// Of second order what depends on the variables of both: see [`NearlyPeriodic::average_has_cross`].
    Cross,
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
    /// averaged flow conserves them, for an average of first or second order; all 0 where it takes none. None where it has
    /// no closed form.
    #[inline(always)]
    fn average_constants<S: Elementary>(
        &self,
        z: &[S],
        order: usize,
    ) -> Option<AverageConstants<S>> {
        let _ = (z, order);
        None
    }

    /// `out` ← the average, over the circle through z, of the vector field minus that of the limit, in closed form.
    /// It exists where [`NearlyPeriodic::average_constants`] does; elsewhere `out` is NaN.
    ///
    /// With constants of second order it is the vector field of ⟨H₁⟩ − ½⟨{S, H̃₁}⟩. H₁ is the Hamiltonian minus that of
    /// the limit, H̃₁ = H₁ − ⟨H₁⟩, and S is the integral of H̃₁ by the angle over ω₀, with average 0. Of a system that is
    /// not Hamiltonian it is ⟨f⟩ + ⟨Df·u⟩, with f and u of [`Averaged`](crate::flow::Averaged).
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

    /// Whether the average of second order has a [part](AveragePart::Cross) that joins A and B.
    fn average_has_cross(&self) -> bool {
        false
    }

    /// z ← the exact flow over `time` of a part of the average: of A without its turns, of B, or of Cross, which is
    /// exact but for terms of ε⁶ t³, and symmetric. The flow turns the circle through z too; that turn is left out, and
    /// its angle is returned. It exists where [`NearlyPeriodic::average_split`] does; elsewhere z and the angle are
    /// NaN.
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
