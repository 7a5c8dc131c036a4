//! What a run found.

use super::findings::{Findings, StudyFindings};
use super::log::{Stage, TrainingTimes};
use super::machine::Machine;
use super::registry::Scene;

/// The report of a run: what each study found, and how long it took.
#[derive(Clone, Debug)]
pub struct Report {
    /// The complete scene that was run.
    pub scene: Scene,
    /// The findings of each study, in the order of the scene.
    pub studies: Vec<StudyFindings>,
    /// The seconds of each network's training.
    pub training_times: Vec<TrainingTimes>,
    /// What was computed, and how long it took.
    pub stages: Vec<Stage>,
    /// The machine on which it was timed.
    pub machine: Machine,
    /// The command that repeats it, if it is not `run`.
    pub repeat: Option<String>,
    /// The reports of its parts.
    pub parts: Vec<Report>,
}

impl Report {
    /// Whether no verdict of the run, or of a part, says that something does not hold.
    pub fn holds(&self) -> bool {
        let fails = |study: &StudyFindings| study.findings.verdict == Some(false);
        !self.studies.iter().any(fails) && self.parts.iter().all(Self::holds)
    }

    /// The findings of the study of this name.
    pub fn study(&self, name: &str) -> Option<&Findings> {
        self.studies.iter().find(|study| study.name == name).map(|study| &study.findings)
    }
}
