//! Scenes: declared experiments, from data to report.
//!
//! A [`Scene`] is a set-up — a system, a flow time, data, networks, their training — and studies of
//! it, or consists of parts, which are scenes. Only what a scene names is computed.
//!
//! - [`Setup`], `target_flow`, `declared`: what studies know of their scene.
//! - [`findings`], [`figure`], `part`: tables, figures, a verdict, data: what a study gives back.
//! - `event`, `folder`, `log`: who listens to a run, its files, how much was computed and how
//!   long it took.
//! - `context`, `data_sets`, `learning`, `trained`: what studies share, made on first use and
//!   once.
//! - [`study`]: one file a study, with its options, its check, its run, what it finds and
//!   what it cites.
//! - `registry`, `declaration`, `catalogue`, `parse`, `found_action`: the studies, and the scene as its file declares
//!   it, with what is found from its pairs.
//! - [`render`]: the report as Markdown, as JSON and on a terminal, figures as SVG; it
//!   knows no study.
//! - `run`, `earlier_run`, `report`: running it all into a folder.
//! - `plan`, `job`, `job_folders`, `made_data`: the same in pieces, which other machines may do.
//!
//! A new study is its file in `study`, its line in `registry`, and a scene in the catalogue
//! that names it.

mod bibliography;
mod catalogue;
mod citation;
mod command;
mod context;
mod data_sets;
mod declaration;
mod declared;
mod earlier_run;
mod event;
pub mod figure;
pub mod findings;
mod folder;
mod found_action;
mod job;
mod job_folders;
mod learning;
mod line_data;
mod log;
mod machine;
mod made_data;
mod nearest;
mod network_file;
mod next_command;
mod notes;
mod own_fit;
mod own_pairs;
mod parse;
mod part;
mod plan;
mod predictions;
mod registry;
pub mod render;
mod report;
mod run;
mod setup;
pub mod study;
mod target_flow;
mod trained;
mod trial;
mod trust;
mod words;
mod written;

pub use catalogue::{CatalogueEntry, catalogue, default_scene, find};
pub use citation::bibtex;
pub use event::{Event, Observer};
pub use findings::StudyFindings;
pub use folder::Folder;
pub use job::{JobEnd, JobRequest, MergeEnd, check_merge, merge, run_job};
pub use line_data::{CoilFile, Coils, LineData};
pub use log::{Stage, TrainingTimes};
pub use machine::Machine;
pub use next_command::{command_line, job_command, next_command, quoted, without_page};
pub use notes::{Note, own_invariance_fault};
pub use own_fit::recipe_of;
pub use own_pairs::{NextStep, OwnTraining};
pub use parse::parse;
pub use plan::{Job, JobKind};
pub use registry::{AnyStudy, Scene};
pub use report::Report;
pub use run::run;
pub use setup::{AutoWord, Data, FlowBy, ModelSpec, PairsAction, Setup};
pub use study::certificate::{CERTIFICATE_HEADINGS, certificate_cells, certificate_table};
pub use study::training::stop_words;

/// Items for the tests of this crate; they are not part of the public API.
#[doc(hidden)]
pub mod internals {
    pub use super::command::{command, verdict};
    pub use super::render::svg::draw;
    pub use super::study::claims::{
        REPRODUCED, as_a_series, change, faster_than_integrators, ranked,
    };
}
