//! What a run found.

use super::declaration::Scene;
use super::findings::Findings;
use super::log::{Stage, TrainingTimes};
use super::machine::Machine;

/// What a run found.
#[derive(Clone, Debug)]
pub struct Report {
    /// The scene, whole.
    pub scene: Scene,
    /// The findings of each study, in the order of the scene.
    pub studies: Vec<StudyFindings>,
    /// The seconds of each network's training.
    pub training_times: Vec<TrainingTimes>,
    /// What was computed, and how long it took.
    pub stages: Vec<Stage>,
    /// What it was timed on.
    pub machine: Machine,
    /// The command that does it again, where it is not `run`.
    pub repeat: Option<String>,
    /// The reports of its parts.
    pub parts: Vec<Report>,
}

/// The findings of a study, with its name.
#[derive(Clone, Debug)]
pub struct StudyFindings {
    /// Its key in the scene.
    pub name: &'static str,
    /// What it found.
    pub findings: Findings,
}

impl Report {
    /// No verdict of the run, or of a part, is that something does not hold.
    pub fn holds(&self) -> bool {
        let fails = |study: &StudyFindings| study.findings.verdict == Some(false);
        !self.studies.iter().any(fails) && self.parts.iter().all(Self::holds)
    }

    /// ε of what it is of, as data.
    pub(super) fn scene_epsilon(&self) -> Option<serde_json::Value> {
        self.scene.setup.subject().map(|subject| subject.epsilon().into())
    }

    /// The findings of the study of this name.
    pub fn study(&self, name: &str) -> Option<&Findings> {
        self.studies.iter().find(|study| study.name == name).map(|study| &study.findings)
    }
}
