//! What a run reports while it goes on, and who listens.

use crate::train::{Stop, TrainingRecord};

/// What a run reports while it goes on.
#[derive(Debug)]
pub enum Event<'a> {
    /// A stage begins.
    Stage(&'a str),
    /// An iteration of training is done.
    Iteration {
        /// The network's name.
        model: &'a str,
        /// Its newest record.
        record: TrainingRecord,
        /// The most iterations there will be.
        iterations: u64,
    },
    /// A part of something that takes long is done.
    Progress {
        /// What is counted.
        what: &'a str,
        /// How many are done.
        done: u64,
        /// How many there are to do.
        total: u64,
    },
    /// A network is trained.
    Trained {
        /// The network's name.
        model: &'a str,
        /// Why training ended.
        stop: Stop,
        /// The record of the model that was kept.
        best: TrainingRecord,
    },
}

/// Listens to a run, and may stop it.
pub trait Observer {
    /// Something happened.
    fn event(&mut self, event: Event<'_>);

    /// True when the run should stop at the next iteration, with a checkpoint.
    fn interrupted(&self) -> bool {
        false
    }
}
