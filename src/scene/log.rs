//! What a run computes, and how long it takes: of each stage.

use crate::work::Work;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// A stage of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    /// What is done in this part of a run, in words.
    pub stage: String,
    /// Seconds that it took on this machine.
    pub seconds: f64,
    /// What was computed in it, counted where it is done.
    #[serde(flatten)]
    pub work: Work,
}

/// Seconds of the training of one network, by iterations.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrainingTimes {
    /// The name of the network that was trained, which is that of its files.
    pub model: String,
    /// (iteration, seconds of training since its start), without the time between a killed run and
    /// the one that goes on with it. For a training in stages, the iterations are those of the last
    /// stage, and the seconds those of all stages.
    pub points: Vec<(u64, f64)>,
    /// The seconds of each stage before the last, by its name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stages: Vec<(String, f64)>,
}

impl TrainingTimes {
    /// The seconds of all stages before the last.
    pub fn before(&self) -> f64 {
        // Not `sum`, which is −0 of nothing.
        self.stages.iter().fold(0.0, |sum, (_, seconds)| sum + seconds)
    }

    /// The seconds at an iteration, if they were taken.
    pub fn seconds(&self, iteration: u64) -> Option<f64> {
        let at = self.points.iter().find(|(i, _)| *i == iteration);
        at.map(|(_, seconds)| *seconds).or_else(|| (iteration == 0).then(|| self.before()))
    }
}

/// The stages so far. What is done in a stage inside another is counted in the inner
/// one only.
pub(super) struct Log {
    stages: Vec<Stage>,
    /// Those that are under way, the innermost last.
    open: Vec<usize>,
    /// Up to where time and work are counted to a stage.
    time: Instant,
    work: Work,
}

impl Log {
    pub(super) fn new() -> Self {
        let (time, work) = (Instant::now(), Work::of_process());
        Self { stages: Vec::new(), open: Vec::new(), time, work }
    }

    /// Tells what was done since the last call to the innermost stage.
    fn settle(&mut self) {
        let (time, work) = (Instant::now(), Work::of_process());
        if let Some(&index) = self.open.last() {
            self.stages[index].seconds += (time - self.time).as_secs_f64();
            self.stages[index].work += work - self.work;
        }
        (self.time, self.work) = (time, work);
    }

    pub(super) fn enter(&mut self, stage: &str) {
        self.settle();
        self.open.push(self.stages.len());
        self.stages.push(Stage { stage: stage.into(), seconds: 0.0, work: Work::default() });
    }

    /// Adds stages of a job, which end before any that is under way here.
    pub(super) fn add(&mut self, stages: Vec<Stage>) {
        self.settle();
        let first = self.open.first().copied().unwrap_or(self.stages.len());
        let count = stages.len();
        self.stages.splice(first..first, stages);
        self.open.iter_mut().for_each(|index| *index += count);
    }

    pub(super) fn leave(&mut self) {
        self.settle();
        self.open.pop();
    }

    /// Adds evaluations of equations of motion, which no process counts, to the
    /// innermost stage.
    pub(super) fn vector_fields(&mut self, number: u64) {
        if let Some(&index) = self.open.last() {
            self.stages[index].work += Work { vector_fields: number, ..Work::default() };
        }
    }

    /// Seconds of all stages of a name that have ended.
    pub(super) fn seconds_of(&self, name: &str) -> f64 {
        let named = self.stages.iter().filter(|stage| stage.stage == name);
        // Not `sum`, which is −0 of nothing.
        named.fold(0.0, |sum, stage| sum + stage.seconds)
    }

    pub(super) fn into_stages(self) -> Vec<Stage> {
        self.stages
    }
}
