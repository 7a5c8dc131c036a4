//! How to train, and the records of it.

use super::Loss;
use crate::error::Error;
use serde::{Deserialize, Serialize};

/// The variables that L-BFGS works in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Scaling {
    /// The parameters themselves.
    None,
    /// Scaled by the Gauss–Newton diagonal.
    GaussNewton {
        /// Iterations between renewals of the diagonal.
        renew: u64,
    },
}

/// How to train.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainingOptions {
    /// What is minimised.
    pub loss: Loss,
    /// The most iterations.
    pub iterations: u64,
    /// m, the pairs of the L-BFGS memory.
    pub memory: usize,
    /// The variables.
    pub scaling: Scaling,
    /// Iterations between evaluations of the held-out pairs.
    pub validate_every: u64,
    /// Stop when the held-out error is at most this (the loss, without
    /// held-out pairs); 0 never stops.
    pub target: f64,
    /// Stop when the held-out error has not improved for so many evaluations
    /// of it; 0 never stops.
    pub patience: u64,
    /// Stop when the largest entry of the gradient is at most this.
    pub gradient_tolerance: f64,
    /// Iterations between checkpoints.
    pub checkpoint_every: u64,
}

impl Default for TrainingOptions {
    fn default() -> Self {
        Self {
            loss: Loss::MeanSquaredError,
            iterations: 1000,
            memory: 30,
            scaling: Scaling::GaussNewton { renew: 200 },
            validate_every: 10,
            target: 0.0,
            patience: 0,
            gradient_tolerance: 0.0,
            checkpoint_every: 100,
        }
    }
}

impl TrainingOptions {
    /// Fails unless every option is in its range.
    ///
    /// # Errors
    /// [`Error::CountOutOfRange`] and [`Error::OutOfRange`] with the option and its value.
    pub fn check(&self) -> Result<(), Error> {
        let positive = [
            ("training.validate_every", self.validate_every),
            ("training.checkpoint_every", self.checkpoint_every),
        ];
        let at_least_one = |name, found| Error::check_count_range(name, found, 1, usize::MAX);
        for (name, value) in positive {
            at_least_one(name, usize::try_from(value).unwrap_or(usize::MAX))?;
        }
        Error::check_count_range("training.memory", self.memory, 1, LARGEST_MEMORY)?;
        if let Scaling::GaussNewton { renew } = self.scaling {
            at_least_one("training.scaling.renew", usize::try_from(renew).unwrap_or(usize::MAX))?;
        }
        for (name, value) in [
            ("training.target", self.target),
            ("training.gradient_tolerance", self.gradient_tolerance),
        ] {
            Error::check_range(name, value, 0.0, f64::MAX)?;
        }
        Ok(())
    }
}

/// More pairs than this serve no purpose and cost their square.
const LARGEST_MEMORY: usize = 10_000;

/// Where training stands after an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainingRecord {
    /// Iterations done.
    pub iteration: u64,
    /// Evaluations of loss and gradient.
    pub evaluations: u64,
    /// The loss on the training pairs.
    pub loss: f64,
    /// The largest entry of its gradient in the parameters.
    pub gradient: f64,
    /// The mean squared error on the held-out pairs, where it was evaluated.
    pub validation: Option<f64>,
}

/// Why training ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stop {
    /// The most iterations were done.
    Iterations,
    /// The target was reached.
    Target,
    /// The held-out error did not improve for the given patience.
    Patience,
    /// The gradient fell below its tolerance.
    Gradient,
    /// No step lowers the loss any more, with a fresh scaling either.
    Stalled,
    /// The caller asked for it.
    Interrupted,
}
