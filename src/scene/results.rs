//! What a run has computed, before it becomes report and figures.

use super::comparison::{Comparison, TanhWay};
use super::declaration::RolloutSpec;
use crate::network::Model;
use serde::{Deserialize, Serialize};

/// Seconds at iterations, of one network; kept apart from the results.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Timing {
    pub(super) model: String,
    /// (iteration, seconds of training since its start).
    pub(super) points: Vec<(u64, f64)>,
    pub(super) rollout_seconds: Option<f64>,
}

#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Timings {
    pub(super) models: Vec<Timing>,
    pub(super) data_seconds: Option<f64>,
    pub(super) reference_rollout_seconds: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) comparison: Option<Comparison>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) tanh: Vec<TanhWay>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) parts: Vec<Timings>,
}

/// The roll-out asked for, its reference trajectories and their error.
pub(super) type ReferenceRollout<'a> = (&'a RolloutSpec, (Trajectories, f64));

/// The points of a roll-out, (T, M, 2n).
pub(super) struct Trajectories {
    pub(super) values: Vec<f64>,
    pub(super) dim: usize,
    pub(super) count: usize,
}

impl Trajectories {
    /// State number `t` of trajectory `m`.
    pub(super) fn state(&self, t: usize, m: usize) -> &[f64] {
        let start = (t * self.count + m) * self.dim;
        &self.values[start..start + self.dim]
    }

    pub(super) fn len(&self) -> usize {
        self.values.len() / (self.dim * self.count)
    }
}

/// μ₀ of the network along its trajectories, in their order, if it has one.
pub(super) fn network_invariant(model: &Model, own: &Trajectories) -> Option<Vec<f64>> {
    Some(model.gyroceptron()?.adiabatic_invariant(&own.values))
}
