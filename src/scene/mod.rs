//! Scenes: declared experiments, from data to report.
//!
//! A [`Scene`] is a set-up — a system, a flow time, data, networks, their training —
//! and studies of it, or consists of parts, which are scenes. What it does not name is
//! not computed.
//!
//! - `declaration`, [`Setup`], `parse`, `catalogue`: the scene as its file declares it.
//! - [`study`]: one file a study, with its options, its check, its run, what it finds and
//!   what it cites.
//! - `context`, `learning`, `log`: what studies share, made on first use and once, and
//!   how much was computed and how long it took.
//! - [`findings`], [`figure`]: tables, figures, a verdict, data: what a study gives back.
//! - [`render`]: the report as Markdown, as JSON and on a terminal, figures as SVG; it
//!   knows no study.
//! - `run`, `folder`, `report`: running it all into a folder.
//!
//! A new study is its file in `study`, its line in the registry there, and a scene in
//! the catalogue that names it.

mod bibliography;
mod catalogue;
mod context;
mod declaration;
pub mod figure;
pub mod findings;
mod folder;
mod learning;
mod log;
mod machine;
mod next_command;
mod notes;
mod own_pairs;
mod parse;
mod predictions;
pub mod render;
mod report;
mod run;
mod setup;
pub mod study;
mod subject;
mod trust;
mod words;

pub use catalogue::{CatalogueEntry, catalogue, default_scene, find};
pub use declaration::Scene;
pub use folder::Folder;
pub use log::{Stage, TrainingTimes};
pub use machine::Machine;
pub use next_command::next_command;
pub use notes::{Note, own_invariance_fault};
pub use own_pairs::{NextStep, OwnTraining};
pub use parse::parse;
pub use report::{Report, StudyFindings};
pub use run::{Event, Observer, run};
pub use setup::{Data, FlowBy, ModelSpec, Setup};
pub use study::AnyStudy;
pub use study::certificate::{CERTIFICATE_HEADINGS, certificate_cells, certificate_table};
pub use study::training::stop_words;

/// What the tests of this crate reach behind the public API: not a part of it.
#[doc(hidden)]
pub mod internals {
    pub use super::study::claims::{REPRODUCED, as_good, change, command, verdict};
}
