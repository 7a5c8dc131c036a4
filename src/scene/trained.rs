//! Trained networks.

use super::data_sets::DataSets;
use super::setup::ModelSpec;
use super::target_flow::TargetFlow;
use crate::error::Error;
use crate::flow::Pairs;
use crate::network::Model;
use crate::train::{Loss, Objective, Outcome, StageResult, fit_rotation};

/// A network before and after training.
pub(super) struct Trained {
    pub(super) spec: ModelSpec,
    /// The name that the scene gives the network, for any of its seeds.
    pub(super) network: String,
    pub(super) initial: Model,
    /// What led to the last stage of its training.
    pub(super) stages: Vec<StageResult>,
    pub(super) outcome: Outcome,
    /// The mean squared error on the held-out pairs, whatever the weights of the loss.
    pub(super) held_out_error: Option<f64>,
}

/// The mean squared error of what a training has kept on the held-out pairs.
pub(super) fn held_out_error(
    outcome: &Outcome,
    loss: &Loss,
    held_out: Option<&Pairs>,
) -> Result<Option<f64>, Error> {
    match held_out {
        Some(held_out) if !loss.is_plain_on_held_out() => {
            let objective = Objective::new(&Loss::MeanSquaredError, held_out)?;
            Ok(Some(objective.value(outcome.model.composition())))
        }
        _ => Ok(outcome.best.validation),
    }
}

impl Trained {
    /// The network after training, of the iteration that was kept.
    pub(super) fn model(&self) -> &Model {
        &self.outcome.model
    }
}

/// The loss of a scene on its training pairs.
pub(super) fn loss_of(loss: &Loss, target: TargetFlow<'_>, data: &DataSets) -> Result<Loss, Error> {
    let action = target.circle_action();
    let angle = fit_rotation(&data.training, &action);
    loss.for_pairs(&action.into(), &[angle], &data.training)
}
