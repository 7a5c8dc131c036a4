//! Data that a job has made, as its file holds it.

use super::data_sets::MadePairs;
use super::line_data::MadeLines;
use super::log::Stage;
use serde::{Deserialize, Serialize};

/// Data that a job has made, and what it took.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MadeData {
    /// The digest of the job that made the data.
    pub(super) digest: String,
    pub(super) data: Made,
    pub(super) stages: Vec<Stage>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Made {
    Pairs(Box<MadePairs>),
    Lines(Box<MadeLines>),
}
