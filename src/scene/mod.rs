//! Scenes: declared experiments, from data to report.
//!
//! A [`Scene`] names a system, a flow time, networks, data, training, and what
//! to measure and to draw. What it does not name is not computed.

mod catalogue;
mod comparison;
mod comparison_words;
mod counted;
mod declaration;
mod experiment;
mod figures;
mod plot;
mod report;
mod results;
mod run;
mod timings_words;

pub use catalogue::{CatalogueEntry, catalogue, default_scene, find};
pub use comparison::{Comparison, Contest, JacobianContest, TanhWay};
pub use declaration::{
    Data, IntegratorSteps, Layers, ModelSpec, NetworkSpec, Plot, RolloutSpec, Scene, TanhSpec,
    WorkPrecisionSpec, parse,
};
pub use report::{
    CERTIFICATE_HEADINGS, Evaluations, Experiment, ModelReport, Report, RolloutReport,
    certificate_cells, stop_words,
};
pub use run::{Event, Folder, Observer, run};
