//! Adam on batches: the recipe of the paper's published code, for comparison.

use super::minimise::{Minimise, OptimiserState, Problem, Resumed, Step, largest};
use super::record::{Stop, at_least_one};
use crate::error::Error;
use crate::random::Stream;
use serde::{Deserialize, Serialize};
use std::ops::{ControlFlow, Range};

/// Options of Adam; an iteration is an epoch.
///
/// The defaults are those of the code that the authors published with Duruisseaux, Burby and Tang,
/// <https://doi.org/10.1038/s41598-023-34862-w>: the rate is lowered when the loss stops falling,
/// and the gradient of each tensor is clipped. As there, loss and gradient are sums over a batch,
/// in units in which the largest weight of a component is 1.
///
/// Source: Kingma and Ba, <https://arxiv.org/abs/1412.6980>, the form at the end of
/// section 2, with β₁ = 0.9, β₂ = 0.999 and ε̂ = 1e-7.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AdamOptions {
    /// The learning rate of the first iterations.
    pub rate: f64,
    /// The largest norm of the gradient of a tensor (W, b, w, η of a layer, θ); a larger gradient
    /// is scaled to this norm. 0 scales none.
    pub clip: f64,
    /// The number of pairs in a batch.
    pub batch: usize,
    /// The factor on the rate when the loss of an epoch, the mean of the batches' sums, has not
    /// fallen by 1e-4 for `plateau` epochs.
    pub factor: f64,
    /// The number of epochs without progress after which the rate is lowered: see `factor`.
    pub plateau: u64,
    /// The seed of the order of the pairs.
    pub seed: u64,
}

impl Default for AdamOptions {
    fn default() -> Self {
        Self { rate: 0.1, clip: 0.1, batch: 512, factor: 0.8, plateau: 8, seed: 0 }
    }
}

/// The kind of its state in a checkpoint.
const KIND: &str = "adam";
const MOMENTUM: f64 = 0.9;
const SQUARES: f64 = 0.999;
const SMALL: f64 = 1e-7;
/// A smaller decrease of the loss does not count as progress.
const PROGRESS: f64 = 1e-4;

impl AdamOptions {
    pub(super) fn check(&self) -> Result<(), Error> {
        let name = |option: &str| format!("training.optimiser.{option}");
        Error::check_range(&name("rate"), self.rate, f64::MIN_POSITIVE, f64::MAX)?;
        Error::check_range(&name("clip"), self.clip, 0.0, f64::MAX)?;
        Error::check_count_range(&name("batch"), self.batch, 1, usize::MAX)?;
        Error::check_range(&name("factor"), self.factor, f64::MIN_POSITIVE, 1.0)?;
        at_least_one(&name("plateau"), self.plateau)
    }
}

/// The state of Adam between two epochs.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct AdamState {
    /// The moving mean of the gradient and of its squares.
    mean: Vec<f64>,
    squares: Vec<f64>,
    steps: u64,
    epochs: u64,
    rate: f64,
    /// The lowest loss of an epoch, and epochs since; none before the first.
    lowest: Option<f64>,
    waited: u64,
}

impl AdamState {
    /// Fails unless it is of so many parameters, after so many epochs.
    fn check(&self, place: &str, count: usize, epochs: u64) -> Result<(), Error> {
        let name = format!("{place}: optimiser: rate");
        Error::check_range(&name, self.rate, 0.0, f64::MAX)?;
        if self.epochs != epochs || self.steps < epochs {
            let (expected, found) = (format!("{epochs} epochs"), self.epochs);
            return Err(Error::content(format!("{place}: optimiser"), expected, found));
        }
        for (what, found) in [("mean", self.mean.len()), ("squares", self.squares.len())] {
            if found != count {
                return Err(Error::content(format!("{place}: {what}"), count, found));
            }
        }
        Ok(())
    }
}

pub(super) struct Adam<'a> {
    problem: Problem<'a>,
    options: AdamOptions,
    /// The parameters of each tensor.
    tensors: Vec<Range<usize>>,
    state: AdamState,
}

impl<'a> Adam<'a> {
    pub(super) fn new(problem: Problem<'a>, options: &AdamOptions) -> Self {
        let zeros = vec![0.0; problem.model.composition().parameters().len()];
        let state = AdamState {
            mean: zeros.clone(),
            squares: zeros,
            steps: 0,
            epochs: 0,
            rate: options.rate,
            lowest: None,
            waited: 0,
        };
        Self::at(problem, options, state)
    }

    pub(super) fn resume(
        problem: Problem<'a>,
        options: &AdamOptions,
        from: &Resumed,
    ) -> Result<Self, Error> {
        let state: AdamState = from.read(KIND)?;
        let count = problem.model.composition().parameters().len();
        state.check(&from.place, count, from.iteration)?;
        Ok(Self::at(problem, options, state))
    }

    fn at(problem: Problem<'a>, options: &AdamOptions, state: AdamState) -> Self {
        let mut start = 0;
        let mut range = |[rows, columns]: [usize; 2]| {
            let range = start..start + rows * columns;
            start = range.end;
            range
        };
        let tensors = problem.model.architecture().tensors();
        let tensors = tensors.into_iter().map(|(_, shape)| range(shape)).collect();
        Self { problem, options: options.clone(), tensors, state }
    }

    /// Scales the gradient of each tensor down to the largest norm.
    fn clip(&self, gradient: &mut [f64]) {
        if self.options.clip == 0.0 {
            return;
        }
        for tensor in &self.tensors {
            let tensor = &mut gradient[tensor.clone()];
            let norm = tensor.iter().map(|g| g * g).sum::<f64>().sqrt();
            if norm > self.options.clip {
                tensor.iter_mut().for_each(|g| *g *= self.options.clip / norm);
            }
        }
    }

    /// Moves the parameters by one step of this gradient.
    fn update(&mut self, parameters: &mut [f64], gradient: &[f64]) {
        let state = &mut self.state;
        state.steps += 1;
        let steps = state.steps as f64;
        let mean_left = 1.0 - libm::pow(MOMENTUM, steps);
        let squares_left = 1.0 - libm::pow(SQUARES, steps);
        let rate = state.rate * squares_left.sqrt() / mean_left;
        for (k, p) in parameters.iter_mut().enumerate() {
            let g = gradient[k];
            state.mean[k] = MOMENTUM * state.mean[k] + (1.0 - MOMENTUM) * g;
            state.squares[k] = SQUARES * state.squares[k] + (1.0 - SQUARES) * g * g;
            *p -= rate * state.mean[k] / (state.squares[k].sqrt() + SMALL);
        }
    }

    /// Lowers the rate when the loss has not fallen for long.
    fn schedule(&mut self, loss: f64) {
        let state = &mut self.state;
        match state.lowest {
            Some(lowest) if !(loss < lowest - PROGRESS) => state.waited += 1,
            _ => (state.lowest, state.waited) = (Some(loss), 0),
        }
        if state.waited >= self.options.plateau {
            state.rate *= self.options.factor;
            state.waited = 0;
        }
    }
}

impl Minimise for Adam<'_> {
    fn step(
        &mut self,
        parameters: &mut Vec<f64>,
        _: f64,
    ) -> Result<ControlFlow<Stop, Step>, Error> {
        let objective = self.problem.objective;
        let count = objective.pairs().len();
        let mut order: Vec<usize> = (0..count).collect();
        let name = format!("adam/epoch-{}", self.state.epochs);
        Stream::new(self.options.seed, &name).shuffle(&mut order);
        let (mut total, mut slope, mut batches) = (0.0, 0.0, 0.0);
        let mut gradient = vec![0.0; parameters.len()];
        let mut moved = parameters.clone();
        let unit = 1.0 / objective.largest_weight();
        for rows in order.chunks(self.options.batch) {
            let Ok(model) = self.problem.model.with_parameters(moved.clone()) else {
                return Ok(ControlFlow::Break(Stop::Diverged));
            };
            let batch = objective.on(objective.pairs().rows(rows.iter().copied()));
            let loss = batch.value_and_gradient(model.composition(), &mut gradient);
            if !(loss.is_finite() && gradient.iter().all(|g| g.is_finite())) {
                return Ok(ControlFlow::Break(Stop::Diverged));
            }
            total += loss * rows.len() as f64;
            slope += largest(&gradient);
            batches += 1.0;
            let sum = rows.len() as f64 * unit;
            gradient.iter_mut().for_each(|g| *g *= sum);
            self.clip(&mut gradient);
            self.update(&mut moved, &gradient);
        }
        if !(total.is_finite() && moved.iter().all(|p| p.is_finite())) {
            return Ok(ControlFlow::Break(Stop::Diverged));
        }
        *parameters = moved;
        self.state.epochs += 1;
        let loss = total / count as f64;
        self.schedule(loss * self.options.batch.min(count) as f64 * unit);
        Ok(ControlFlow::Continue(Step { loss, gradient: slope / batches, pairs: count }))
    }

    fn evaluations(&self) -> u64 {
        self.state.epochs
    }

    fn state(&self) -> OptimiserState {
        OptimiserState::of(KIND, &self.state)
    }
}
