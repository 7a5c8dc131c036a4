//! The records of a training, and why it ended.

use crate::error::Error;
use serde::{Deserialize, Serialize};

/// Where training stands after an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainingRecord {
    /// The number of iterations that were done.
    pub iteration: u64,
    /// Evaluations of the loss, with its gradient or without; for Adam, passes over the training
    /// pairs.
    pub evaluations: u64,
    /// The loss on the training pairs; for Adam, the mean over the batches of the epoch, each
    /// before its step.
    pub loss: f64,
    /// The number of training pairs that the loss is taken over: fewer than all in an early phase
    /// of Levenberg–Marquardt.
    pub pairs: usize,
    /// The largest entry of its gradient in the parameters; for Adam, the mean of the batches'
    /// largest entries.
    pub gradient: f64,
    /// The mean squared error on the held-out pairs, where it was evaluated; for
    /// [`Loss::ByPlane`](super::Loss::ByPlane), with its weights.
    pub validation: Option<f64>,
}

/// The reason why a training ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stop {
    /// The largest number of iterations was reached.
    Iterations,
    /// The held-out error (loss, without held-out pairs) reached its target.
    Target,
    /// The held-out error did not improve for the given patience.
    Patience,
    /// The error was [at rest](super::TrainingOptions::plateau).
    Plateau,
    /// The gradient fell below its tolerance.
    Gradient,
    /// No step lowers the loss any more, not even with a fresh scaling (L-BFGS) or with any damping
    /// (Levenberg–Marquardt).
    Stalled,
    /// The loss is no longer finite.
    Diverged,
    /// No training took place: the weights come from a file.
    NotTrained,
    /// The caller asked for it.
    Interrupted,
}

impl Stop {
    /// Whether the training ended by itself: it was not interrupted, and more iterations would change nothing.
    pub fn is_final(self) -> bool {
        !matches!(self, Self::Iterations | Self::Interrupted | Self::NotTrained)
    }
}

/// Fails unless a number of iterations, or the like, is at least one.
pub(super) fn at_least_one(name: &str, found: u64) -> Result<(), Error> {
    let found = usize::try_from(found).unwrap_or(usize::MAX);
    Error::check_count_range(name, found, 1, usize::MAX)
}
