//! The quality of a network's own invariant along the orbits of the network.

use super::{
    drift::{disturbing_resonance, invariant_drift, log_slope},
    near_identity::near_identity_rms,
};
use crate::network::{Model, Structure};
use crate::scalar::median_or_nan;

/// The change of a network's own invariant μ along its own orbits: medians over orbits.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnInvariance {
    /// Iterations of each orbit, N.
    pub iterations: usize,
    /// max |μ(Pᵏz) − μ(z)|/|μ(z)| over k ≤ N.
    pub drift: f64,
    /// The exponent of the drift in N over the last four octaves; 0 where μ does not change.
    pub exponent: f64,
    /// The root mean square of I_ε(z) − z, divided by |ε|, for a gyroceptron: its μ is invariant
    /// to order ε with this constant. None for other maps.
    pub moved: Option<f64>,
    /// The resonance next to its angle, where there is one within 2ε.
    pub resonance: Option<String>,
    /// Whether μ is an invariant at ε = 0 only, as for a nearly integrable map: its change by the
    /// perturbation is no fault of the map.
    pub unperturbed: bool,
}

/// In units of ε: a wider strip would hold most angles.
const NEAR: f64 = 2.0;

impl OwnInvariance {
    /// A change of the invariant above which it is of no use, and an exponent above which it
    /// drifts rather than oscillates, where the change is large enough to matter.
    const USELESS: f64 = 0.1;
    const DRIFTS: f64 = 0.3;
    const MATTERS: f64 = 0.01;

    /// The recommended number of orbits.
    pub const ORBITS: usize = 16;
    /// The recommended number of iterations of each orbit.
    pub const ITERATIONS: usize = 1000;

    /// Measures the invariant along the orbits from `starts`, 2n numbers each. None for networks
    /// without an invariant and where there are no points.
    ///
    /// Cost: `iterations` evaluations of the map and of μ for each point.
    pub fn measure(model: &Model, starts: &[f64], iterations: usize) -> Option<Self> {
        let own = model.invariant()?;
        let map = model.composition();
        let horizons: Vec<usize> = (0..5).rev().map(|k| (iterations >> k).max(1)).collect();
        let at: Vec<f64> = horizons.iter().map(|n| *n as f64).collect();
        let (mut drifts, mut exponents) = (Vec::new(), Vec::new());
        for z in starts.chunks_exact(2 * map.dof()) {
            let along = invariant_drift(map, &own, z, &horizons);
            drifts.push(along[along.len() - 1] / own(z).abs());
            let slope = log_slope(&at, &along);
            let still = along.iter().all(|drift| *drift == 0.0);
            exponents.push(if still { 0.0 } else { slope });
        }
        let (structure, epsilon) = (model.architecture().structure(), model.epsilon());
        let adiabatic = structure == Structure::NearlyPeriodic;
        let moved =
            adiabatic.then(|| near_identity_rms(&model.near_identity(), starts) / epsilon.abs());
        let circles = model.architecture().circles.iter().zip(model.angles());
        let resonance = circles.filter(|_| adiabatic).find_map(|(circle, theta)| {
            disturbing_resonance(circle, *theta, epsilon)
                .filter(|resonance| resonance.distance <= NEAR * epsilon.abs())
        });
        let unperturbed = structure == Structure::NearlyIntegrable;
        (!drifts.is_empty()).then(|| Self {
            unperturbed,
            iterations,
            drift: median_or_nan(drifts),
            exponent: median_or_nan(exponents),
            moved,
            resonance: resonance.map(|resonance| resonance.to_string()),
        })
    }

    /// A description of what is wrong, if anything is; None where μ is an invariant at ε = 0 only.
    pub fn fault(&self) -> Option<String> {
        let Self { drift, exponent, iterations, .. } = *self;
        let useless = !(drift <= Self::USELESS);
        let drifts = !(exponent <= Self::DRIFTS) && !(drift <= Self::MATTERS);
        let moved = self.moved.map(|moved| format!("; I_ε moves points by {moved:.1} ε (rms)"));
        let resonance = self.resonance.as_ref().map(|near| format!("; θ is next to {near}"));
        let rest = moved.unwrap_or_default() + &resonance.unwrap_or_default();
        (!self.unperturbed && (useless || drifts)).then(|| {
            format!(
                "its own invariant changes by {:.0} % over {iterations} steps (median), as the \
                 power {exponent:.2} of their number{rest}",
                100.0 * drift
            )
        })
    }
}
