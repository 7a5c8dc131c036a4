//! Checkpoints, from which an interrupted run is resumed.

use super::minimise::{OptimiserState, Resumed};
use super::options::{Plateau, TrainingOptions};
use super::record::{Stop, TrainingRecord};
use crate::digest;
use crate::error::Error;
use crate::flow::Pairs;
use crate::network::{Architecture, Model};
use serde::{Deserialize, Serialize};

/// The inputs that decide every bit of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct RunIdentity {
    architecture: Architecture,
    initial_parameters: String,
    pairs: String,
    validation: Option<String>,
    options: TrainingOptions,
}

impl RunIdentity {
    pub(super) fn of(
        model: &Model,
        pairs: &Pairs,
        validation: Option<&Pairs>,
        options: &TrainingOptions,
    ) -> Self {
        let options = options.clone().without_ends();
        Self {
            architecture: model.architecture().clone(),
            initial_parameters: digest::of_numbers(model.composition().parameters()),
            pairs: pairs.digest(),
            validation: validation.map(Pairs::digest),
            options,
        }
    }
}

/// The state of a training between two iterations; a run that resumes from it gives bit-identical
/// results. Serialising it keeps the bits of all numbers.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Checkpoint {
    run: RunIdentity,
    pub(super) parameters: Vec<f64>,
    pub(super) best_parameters: Vec<f64>,
    pub(super) best: TrainingRecord,
    best_score: f64,
    /// Scores since the best one.
    unimproved: u64,
    pub(super) history: Vec<TrainingRecord>,
    pub(super) optimiser: Option<OptimiserState>,
    /// Where it was read from, for errors.
    #[serde(skip)]
    source: Option<String>,
}

impl Checkpoint {
    pub(super) fn start(run: RunIdentity, parameters: Vec<f64>, record: TrainingRecord) -> Self {
        Self {
            run,
            best_parameters: parameters.clone(),
            parameters,
            best: record,
            best_score: record.validation.unwrap_or(record.loss),
            unimproved: 0,
            history: vec![record],
            optimiser: None,
            source: None,
        }
    }

    /// Records the name of the file that the checkpoint was read from, for errors.
    pub fn from_file(self, name: impl Into<String>) -> Self {
        Self { source: Some(name.into()), ..self }
    }

    fn place(&self) -> &str {
        self.source.as_deref().unwrap_or("checkpoint")
    }

    /// The state of the optimiser, which it checks itself, and where it is from.
    pub(super) fn take_optimiser(&mut self) -> Option<Resumed> {
        let state = self.optimiser.take()?;
        Some(Resumed { state, place: self.place().to_owned(), iteration: self.last().iteration })
    }

    /// The record of the newest iteration.
    pub fn last(&self) -> TrainingRecord {
        self.history.last().copied().unwrap_or(self.best)
    }

    /// The records of all iterations so far.
    pub fn history(&self) -> &[TrainingRecord] {
        &self.history
    }

    /// Adds a record; `score` is what the best model is chosen by, where it
    /// was evaluated.
    pub(super) fn push(&mut self, record: TrainingRecord, score: Option<f64>) {
        self.history.push(record);
        match score {
            Some(score) if score < self.best_score => {
                self.best_score = score;
                self.best = record;
                self.best_parameters.clone_from(&self.parameters);
                self.unimproved = 0;
            }
            Some(_) => self.unimproved += 1,
            None => {}
        }
    }

    /// Whether the error has hardly fallen in the window that ends here; `pairs` is the number of
    /// all training pairs. The records alone decide, so that a run that goes on ends
    /// where it would have ended.
    fn is_at_rest(&self, plateau: Plateau, pairs: usize) -> bool {
        let last = self.last();
        let windows = if last.pairs < pairs { 2 } else { 1 };
        let window = plateau.iterations.saturating_mul(windows);
        if !last.iteration.is_multiple_of(plateau.iterations) || last.iteration < window {
            return false;
        }
        let since = last.iteration - window;
        let mut in_window = self.history.iter().rev().take_while(|r| r.iteration >= since);
        if !in_window.all(|record| record.pairs == last.pairs) {
            return false;
        }
        let held_out = self.history.iter().any(|record| record.validation.is_some());
        let score = |record: &TrainingRecord| match held_out {
            true => record.validation,
            // Losses on more pairs and on fewer cannot be compared.
            false => (record.pairs == last.pairs).then_some(record.loss),
        };
        let lowest = |until: u64| {
            let records = self.history.iter().take_while(|record| record.iteration <= until);
            // no NaN: a score that is no number is not the lowest
            records.filter_map(score).fold(f64::INFINITY, f64::min)
        };
        !(lowest(last.iteration) < (1.0 - plateau.improvement) * lowest(since))
    }

    /// Why training is over; `pairs` is the number of all training pairs.
    pub(super) fn finished(&self, options: &TrainingOptions, pairs: usize) -> Option<Stop> {
        let last = self.last();
        if options.target > 0.0 && self.best_score <= options.target {
            Some(Stop::Target)
        } else if last.pairs >= pairs && last.gradient <= options.gradient_tolerance {
            Some(Stop::Gradient)
        } else if options.patience > 0 && self.unimproved >= options.patience {
            Some(Stop::Patience)
        } else if options.plateau.is_some_and(|plateau| self.is_at_rest(plateau, pairs)) {
            Some(Stop::Plateau)
        } else if self.last().iteration >= options.iterations {
            Some(Stop::Iterations)
        } else {
            None
        }
    }

    /// Fails unless the checkpoint belongs to this run and fits its model. The state of the optimiser has to be
    /// present, but is not checked here.
    pub(super) fn check(&self, run: &RunIdentity, model: &Model) -> Result<(), Error> {
        if self.run != *run {
            let differs = |same: bool, what: &'static str| (!same).then_some(what);
            let what: Vec<_> = [
                differs(self.run.architecture == run.architecture, "architecture"),
                differs(self.run.initial_parameters == run.initial_parameters, "initial weights"),
                differs(self.run.pairs == run.pairs, "training pairs"),
                differs(self.run.validation == run.validation, "held-out pairs"),
                differs(self.run.options == run.options, "training options"),
            ]
            .into_iter()
            .flatten()
            .collect();
            return Err(Error::content(
                self.place(),
                "a checkpoint of this run",
                format!("one with other {}", what.join(", ")),
            ));
        }
        let count = model.composition().parameters().len();
        for (what, found) in
            [("parameters", self.parameters.len()), ("best parameters", self.best_parameters.len())]
        {
            if found != count {
                return Err(Error::content(format!("{}: {what}", self.place()), count, found));
            }
        }
        let place = self.place();
        if self.history.is_empty() {
            let expected = "at least one record";
            return Err(Error::content(format!("{place}: history"), expected, "none"));
        }
        match &self.optimiser {
            Some(_) => Ok(()),
            None => Err(Error::content(format!("{place}: optimiser"), "its state", "none")),
        }
    }
}
