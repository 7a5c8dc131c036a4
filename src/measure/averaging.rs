//! Adiabatic invariants of a flow by averaging over its limiting circle action.

use crate::system::NearlyPeriodic;
use std::f64::consts::TAU;

/// Points on a circle that an average is taken over: the rule is exact for harmonics below
/// their number, and those of an analytic function fall off exponentially.
const POINTS: usize = 128;

/// The adiabatic invariant to first order, μ₀ + εμ₁ = μ₀ + ε(H₁ − ⟨H₁⟩)/ω, at z, with
/// εH₁ = H − ωμ₀ and ⟨·⟩ the average over the circle of the limiting flow through z. It changes
/// by O(ε²) over times of order 1/ε, where μ₀ changes by O(ε).
///
/// Since H and, to first order, ε⟨H₁⟩ are conserved, so is (H − ε⟨H₁⟩)/ω. Cost: 128 times
/// the limiting flow and the energy. The orbits of the limiting flow have to be circles; for a
/// torus ([`NearlyPeriodic::torus`]) the average along one orbit is not that over the torus.
///
/// Source: Kruskal, <https://doi.org/10.1063/1.1724285>, whose series this is the first order
/// of.
pub fn averaged_invariant(system: &impl NearlyPeriodic, z: &[f64]) -> f64 {
    let frequency = system.limiting_frequency();
    let perturbation =
        |z: &[f64]| system.energy(z, 0.0) - frequency * system.adiabatic_invariant(z);
    let mut total = 0.0;
    for k in 0..POINTS {
        let mut turned = z.to_vec();
        let time = TAU / frequency * (k as f64 / POINTS as f64);
        system.limiting_flow(&mut turned, time);
        total += perturbation(&turned);
    }
    let average = total / POINTS as f64;
    system.adiabatic_invariant(z) + (perturbation(z) - average) / frequency
}
