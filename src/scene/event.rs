//! What a run reports while it goes on, and who listens.

use crate::train::{Stop, TrainingRecord};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// What a run reports while it goes on.
#[derive(Debug)]
pub enum Event<'a> {
    /// A stage of the run begins; the text is its name.
    Stage(&'a str),
    /// An iteration of training is done.
    Iteration {
        /// The name of the network that is being trained.
        model: &'a str,
        /// The record of the newest iteration.
        record: TrainingRecord,
        /// The most iterations there will be.
        iterations: u64,
    },
    /// A part of something that takes long is done.
    Progress {
        /// The name of what is counted, such as `iterations`.
        what: &'a str,
        /// The number of counted things that are done so far.
        done: u64,
        /// How many there are to do.
        total: u64,
    },
    /// The training of a network has ended.
    Trained {
        /// The name of the network that was trained.
        model: &'a str,
        /// The reason why the training ended.
        stop: Stop,
        /// The record of the model that was kept.
        best: TrainingRecord,
    },
    /// The training of a network left the finite numbers at the beginning of a stage: it has no map, and the run goes
    /// on without it.
    Lost {
        /// The name of the network that is lost.
        model: &'a str,
        /// What is not finite, and in which stage.
        reason: &'a str,
    },
}

/// Listens to a run, and may stop it.
pub trait Observer {
    /// Called with each event of the run, when it happens.
    fn event(&mut self, event: Event<'_>);

    /// True when the run should stop at the next iteration, with a checkpoint.
    fn interrupted(&self) -> bool {
        false
    }

    /// The flag that [`Observer::interrupted`] reads, where another thread may set it: what takes long between two
    /// events reads it too. None leaves such work to its end.
    fn interruption(&self) -> Option<Arc<AtomicBool>> {
        None
    }
}

/// Ignores all events and never interrupts.
pub(super) struct Unobserved;

impl Observer for Unobserved {
    fn event(&mut self, _: Event<'_>) {}
}
