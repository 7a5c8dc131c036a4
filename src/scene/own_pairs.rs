//! The report of a training on pairs of one's own.

use super::declaration::Scene;
use super::findings::Block;
use super::folder::Folder;
use super::learning::Trained;
use super::log::TrainingTimes;
use super::machine::Machine;
use super::report::{Report, StudyFindings};
use super::run::write;
use super::setup::{ModelSpec, Setup};
use super::study::training::{Baseline, LOSS, TrainingResult, findings};
use super::trust::trust;
use crate::error::Error;
use crate::flow::Pairs;
use crate::measure::{component_errors, root_mean_square};
use crate::phase::Units;
use crate::train::{Scheduled, TrainingOptions};
use serde_json::json;

/// What is said of units that are not the data's.
pub fn units_told(units: &Units) -> String {
    let numbers = |values: &[f64]| {
        let texts: Vec<String> = values.iter().map(|value| format!("{value:.4e}")).collect();
        texts.join(", ")
    };
    let centre = match units.centre().iter().any(|c| *c != 0.0) {
        true => format!(" about {}", numbers(units.centre())),
        false => String::new(),
    };
    format!(
        "The network is trained in units of {}{centre} (q1 … qn, p1 … pn), in which the \
         widest plane of the pairs is of order one",
        numbers(units.factors())
    )
}

/// A training on pairs of one's own.
pub struct OwnTraining<'a> {
    /// The network.
    pub spec: ModelSpec,
    /// How it was trained.
    pub options: &'a TrainingOptions,
    /// The seed of its weights.
    pub seed: u64,
    /// What came of it.
    pub training: Scheduled,
    /// The training pairs.
    pub pairs: &'a Pairs,
    /// The held-out pairs.
    pub held_out: Option<&'a Pairs>,
    /// The mean squared error of each component, on the pairs to judge by, of the rotation
    /// nearest to the data: what the network has to improve upon.
    pub rotation_errors: Vec<f64>,
    /// The units of the data, where they are not those of the pairs here and of the network.
    pub units: Option<&'a Units>,
    /// The seconds of training.
    pub times: TrainingTimes,
    /// The command that does it again, but for the file of the scene.
    pub command: String,
}

impl OwnTraining<'_> {
    /// Writes the report into a folder: text, data and the figure of the losses.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn report(self, folder: &Folder) -> Result<Report, Error> {
        let output = self.held_out.unwrap_or(self.pairs).output();
        let rotation_error =
            self.rotation_errors.iter().sum::<f64>() / self.rotation_errors.len() as f64;
        let baseline =
            Baseline { rotation_error: Some(rotation_error), size: root_mean_square(output) };
        let mut errors = match self.held_out {
            Some(held_out) => {
                component_errors(self.training.outcome.model.composition(), held_out)?
            }
            None => Vec::new(),
        };
        let network = self.spec.name.clone();
        let mut trust = trust(&self.training.outcome, self.pairs, self.held_out, rotation_error)?;
        let shares: Vec<f64> =
            errors.iter().zip(&self.rotation_errors).map(|(a, b)| a / b.sqrt()).collect();
        if let Some(units) = self.units {
            errors.iter_mut().zip(units.factors()).for_each(|(error, factor)| *error *= factor);
            trust.results.details.push(Block::Text(format!(
                "- {}. Errors of each component are in units of the data, all others in those of \
                 the network.\n",
                units_told(units)
            )));
            trust.results.data["units"] = json!(units);
        }
        let Scheduled { initial, legs, outcome } = self.training;
        let trained = Trained { spec: self.spec.clone(), network, initial, legs, outcome };
        let result = TrainingResult::new(&trained, errors, self.options).with_shares(shares);
        let training_times = vec![self.times];
        let findings = findings(&[result], baseline, &training_times, true);
        let title = format!(
            "A network trained on {} pairs, {} held out",
            self.pairs.len(),
            self.held_out.map_or(0, Pairs::len)
        );
        let setup =
            Setup { models: vec![self.spec], training: self.options.clone(), ..Setup::default() };
        let scene = Scene {
            name: trained.spec.name,
            title,
            seed: self.seed,
            setup,
            studies: Vec::new(),
            plots: vec![LOSS.into()],
            parts: Vec::new(),
        };
        let studies = vec![
            StudyFindings { name: "trust", findings: trust },
            StudyFindings { name: "training", findings },
        ];
        let (machine, stages, parts) = (Machine::this(), Vec::new(), Vec::new());
        let repeat = Some(self.command);
        let report = Report { scene, studies, training_times, stages, machine, repeat, parts };
        write(folder, &report)?;
        Ok(report)
    }
}
