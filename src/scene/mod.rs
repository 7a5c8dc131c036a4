//! Scenes: declared experiments, from data to report.
//!
//! A [`Scene`] names a system, a flow time, networks, data, training, and what
//! to measure and to draw. What it does not name is not computed.

mod catalogue;
mod declaration;
mod figures;
mod plot;
mod report;
mod results;
mod run;

pub use catalogue::{CatalogueEntry, catalogue, default_scene, find};
pub use declaration::{Data, Layers, ModelSpec, NetworkSpec, Plot, RolloutSpec, Scene, parse};
pub use report::{
    CERTIFICATE_HEADINGS, ModelReport, Report, RolloutReport, certificate_cells, stop_words,
};
pub use run::{Event, Folder, Observer, run};
