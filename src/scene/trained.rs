//! Trained networks.

use super::data_sets::DataSets;
use super::setup::ModelSpec;
use super::target_flow::TargetFlow;
use crate::error::Error;
use crate::flow::Pairs;
use crate::network::Model;
use crate::train::{Loss, Objective, Outcome, StageResult, Stop, TrainingRecord};

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
    /// Why there is no trained network, where a stage of its training could not begin: `outcome` is then of the
    /// initial network.
    pub(super) lost: Option<String>,
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
    /// A network whose training left the finite numbers at the beginning of one of its stages.
    pub(super) fn lost(
        spec: ModelSpec,
        network: String,
        initial: Model,
        reason: String,
        has_held_out: bool,
    ) -> Self {
        let record = TrainingRecord {
            iteration: 0,
            evaluations: 1,
            loss: f64::INFINITY,
            pairs: 0,
            gradient: f64::INFINITY,
            validation: has_held_out.then_some(f64::INFINITY),
        };
        let outcome = Outcome {
            model: initial.clone(),
            loss: record.loss,
            best: record,
            history: vec![record],
            curvatures: 0,
            stop: Stop::Diverged,
        };
        let (held_out_error, lost) = (record.validation, Some(reason));
        Self { spec, network, initial, stages: Vec::new(), outcome, held_out_error, lost }
    }

    /// The network after training, of the iteration that was kept.
    pub(super) fn model(&self) -> &Model {
        &self.outcome.model
    }
}

/// The loss of a scene on its training pairs.
pub(super) fn loss_of(loss: &Loss, target: TargetFlow<'_>, data: &DataSets) -> Result<Loss, Error> {
    let (action, angles) = data.nearest_to(target);
    loss.for_pairs(&action, &angles, &data.training)
}
