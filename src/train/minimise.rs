//! What all optimisers share: the problem, a step, and the state from which they resume.

use super::Objective;
use super::record::Stop;
use crate::error::Error;
use crate::network::Model;
use crate::scalar::max_or_nan;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::ops::ControlFlow;

/// The objective, and the models over which it is minimised.
#[derive(Clone, Copy)]
pub(super) struct Problem<'a> {
    pub(super) objective: &'a Objective<'a>,
    pub(super) model: &'a Model,
}

impl Problem<'_> {
    /// The loss at these parameters: infinite where they or the loss leave the finite
    /// numbers, so that no optimiser takes a NaN for progress.
    pub(super) fn loss(&self, objective: &Objective<'_>, parameters: &[f64]) -> f64 {
        match self.model.with_parameters(parameters.to_vec()) {
            Ok(model) => finite_or_rejected(objective.value(model.composition())),
            Err(_) => f64::INFINITY,
        }
    }
}

/// An infinite loss ends a search along a line without a step; a NaN it might take
/// for progress.
pub(super) fn finite_or_rejected(value: f64) -> f64 {
    if value.is_finite() { value } else { f64::INFINITY }
}

/// The result of an iteration: the numbers that go into its [`TrainingRecord`](super::TrainingRecord).
pub(super) struct Step {
    /// The loss after the iteration, as in [`TrainingRecord`](super::TrainingRecord).
    pub(super) loss: f64,
    pub(super) gradient: f64,
    pub(super) pairs: usize,
}

/// An optimiser, which lowers the loss one iteration after another.
pub(super) trait Minimise {
    /// Performs one iteration from these parameters, in place; `loss` is that of the previous one.
    /// When the training ends here, the parameters are unchanged.
    fn step(
        &mut self,
        parameters: &mut Vec<f64>,
        loss: f64,
    ) -> Result<ControlFlow<Stop, Step>, Error>;

    /// Evaluations of the loss so far.
    fn evaluations(&self) -> u64;

    /// The number of evaluations of the curvature so far: see [`Outcome::curvatures`](super::Outcome::curvatures).
    fn curvatures(&self) -> u64 {
        0
    }

    /// All that it resumes from, apart from the parameters.
    fn state(&self) -> OptimiserState;
}

/// All that an optimiser resumes from, apart from the parameters: an object of its own, with its
/// `kind`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct OptimiserState(Value);

impl OptimiserState {
    /// That of an optimiser of this kind.
    pub(super) fn of(kind: &str, state: &impl Serialize) -> Self {
        let mut state = serde_json::to_value(state).expect("numbers and lists of them");
        state["kind"] = kind.into();
        Self(state)
    }
}

/// The state of an optimiser in a checkpoint.
pub(super) struct Resumed {
    pub(super) state: OptimiserState,
    /// Where the checkpoint was read from, for errors.
    pub(super) place: String,
    /// The iterations that are done.
    pub(super) iteration: u64,
}

impl Resumed {
    /// The state as an optimiser of this kind wrote it.
    ///
    /// # Errors
    /// [`Error::Content`] when it is of another kind, or not what such an optimiser writes.
    pub(super) fn read<T: DeserializeOwned>(&self, kind: &str) -> Result<T, Error> {
        let place = format!("{}: optimiser", self.place);
        let OptimiserState(state) = &self.state;
        if state["kind"] != kind {
            return Err(Error::content(place, kind, &state["kind"]));
        }
        T::deserialize(state).map_err(|reason| Error::content(place, "its state", reason))
    }
}

/// The largest absolute value |v| of the numbers; NaN if one of them is.
pub(super) fn largest(values: &[f64]) -> f64 {
    values.iter().map(|v| v.abs()).fold(0.0, max_or_nan)
}
