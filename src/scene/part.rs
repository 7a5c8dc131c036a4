//! What studies see of the parts of a scene.

use super::findings::{Findings, StudyFindings};
use super::log::TrainingTimes;

/// A part of a scene, after its run.
pub(super) struct Part<'a> {
    pub(super) name: &'a str,
    pub(super) title: &'a str,
    /// ε of what it is of.
    pub(super) epsilon: Option<f64>,
    pub(super) studies: &'a [StudyFindings],
    pub(super) training_times: &'a [TrainingTimes],
    /// The command that runs it alone.
    pub(super) command: String,
}

impl Part<'_> {
    /// The findings of the study of this name.
    pub(super) fn study(&self, name: &str) -> Option<&Findings> {
        self.studies.iter().find(|study| study.name == name).map(|study| &study.findings)
    }
}
