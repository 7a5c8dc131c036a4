//! Adiabatic invariants of a flow by averaging over its limiting circle action.

use crate::flow::integral_weights;
use crate::scalar::Dual;
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
    let leading = system.adiabatic_invariant(z);
    let perturbation = system.energy(z, 0.0) - frequency * leading;
    leading + (perturbation - average(system, z)) / frequency
}

/// The adiabatic invariant to second order, μ₀ + εμ₁ + ε²μ₂, at z. It changes by O(ε³) over times of order 1/ε.
///
/// Near-identity coordinates Z = z − u(z) + O(ε²), in which the Hamiltonian is
/// ωμ₀(Z) + ε⟨H₁⟩(Z) + ε²K₂(Z) + O(ε³) with K₂ = −½⟨{S, H̃₁}⟩, make μ₀(Z) an invariant to all orders. So it is
///
/// (H(z) − ε⟨H₁⟩(z − u(z)) − ε²K₂(z))/ω + O(ε³)/ω.
///
/// Here H̃₁ = H₁ − ⟨H₁⟩, S is its integral along the limiting flow with average 0, and u is the vector field of εS.
/// Cost: 128 vector fields and 256 limiting flows with dual numbers, 16,000 products of 2n numbers, and what
/// [`averaged_invariant`] takes. The vector field has to be Hamiltonian, in canonical coordinates, and the orbits
/// of the limiting flow circles, as for [`averaged_invariant`].
///
/// Source: Kruskal, <https://doi.org/10.1063/1.1724285>; by a Lie series: Cary,
/// <https://doi.org/10.1016/0370-1573(81)90175-7>.
pub fn second_averaged_invariant(system: &impl NearlyPeriodic, z: &[f64]) -> f64 {
    let (dim, frequency) = (z.len(), system.limiting_frequency());
    let mut fields = vec![0.0; POINTS * dim];
    for (k, field) in fields.chunks_exact_mut(dim).enumerate() {
        perturbation_along_circle(system, z, time_of(frequency, k), field);
    }
    for component in 0..dim {
        let mean = fields.iter().skip(component).step_by(dim).sum::<f64>() / POINTS as f64;
        fields.iter_mut().skip(component).step_by(dim).for_each(|v| *v -= mean);
    }
    let weights = integral_weights(POINTS);
    let displaced = |k: usize, sum: &mut [f64]| {
        sum.fill(0.0);
        for (j, field) in fields.chunks_exact(dim).enumerate() {
            let weight = weights[(j + POINTS - k) % POINTS] / frequency;
            sum.iter_mut().zip(field).for_each(|(sum, v)| *sum += weight * v);
        }
    };
    let mut moved = vec![0.0; dim];
    let mut second = 0.0;
    for (k, field) in fields.chunks_exact(dim).enumerate() {
        displaced(k, &mut moved);
        let (half, of) = (dim / 2, &moved);
        second += (0..half).map(|j| of[half + j] * field[j] - of[j] * field[half + j]).sum::<f64>();
    }
    displaced(0, &mut moved);
    let near: Vec<f64> = z.iter().zip(&moved).map(|(z, u)| z - u).collect();
    let of_second = 0.5 * second / POINTS as f64;
    (system.energy(z, 0.0) - average(system, &near) - of_second) / frequency
}

/// The time after which the limiting flow is at the point number k of a circle.
fn time_of(frequency: f64, k: usize) -> f64 {
    TAU / frequency * (k as f64 / POINTS as f64)
}

/// ε⟨H₁⟩, the average of H − ωμ₀ over the circle of the limiting flow through z.
fn average(system: &impl NearlyPeriodic, z: &[f64]) -> f64 {
    let frequency = system.limiting_frequency();
    let mut total = 0.0;
    for k in 0..POINTS {
        let mut turned = z.to_vec();
        system.limiting_flow(&mut turned, time_of(frequency, k));
        total += system.energy(&turned, 0.0) - frequency * system.adiabatic_invariant(&turned);
    }
    total / POINTS as f64
}

/// `out` ← the vector field minus that of the limit, at the point where the limiting flow is after `time`, taken back
/// along that flow to z.
fn perturbation_along_circle(system: &impl NearlyPeriodic, z: &[f64], time: f64, out: &mut [f64]) {
    // The limiting field is the derivative of the limiting flow by the time.
    let mut at: Vec<Dual<f64, 1>> = z.iter().map(|v| Dual::constant(*v)).collect();
    system.limiting_flow(&mut at, Dual::variable(time, 0));
    let turned: Vec<f64> = at.iter().map(|v| v.re).collect();
    system.vector_field(&turned, 0.0, out);
    for (at, v) in at.iter_mut().zip(&*out) {
        at.eps = [v - at.eps[0]];
    }
    system.limiting_flow(&mut at, Dual::constant(-time));
    out.iter_mut().zip(at).for_each(|(out, v)| *out = v.eps[0]);
}
