//! The report of a training on pairs of one's own.

use super::declaration::Scene;
use super::findings::Block;
use super::folder::Folder;
use super::learning::{Trained, held_out_error};
use super::log::TrainingTimes;
use super::machine::Machine;
use super::report::{Report, StudyFindings};
use super::run::write;
use super::setup::{ModelSpec, Setup};
use super::study::training::{Baseline, LOSS, TrainingResult, findings};
use super::trust::trust;
use crate::error::Error;
use crate::flow::Pairs;
use crate::layer::TorusAction;
use crate::measure::{
    PlaneMotion, component_errors, plane_motions, root_mean_square, rotation_errors,
};
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
    /// The action and the angles of the rotation nearest to the pairs: what it leaves of them
    /// the network has to improve upon.
    pub nearest: (&'a TorusAction, &'a [f64]),
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
        let judge = self.held_out.unwrap_or(self.pairs);
        let (action, angles) = self.nearest;
        let left = rotation_errors(action, angles, judge);
        let rotation_error = left.iter().sum::<f64>() / left.len() as f64;
        let size = root_mean_square(judge.output());
        let motions = plane_motions(action, angles, judge);
        // Of components that the rotation explains to rounding, what those of their plane are
        // compared with.
        let scale = |(c, left): (usize, &f64)| {
            let (motion, own) = (&motions[c % motions.len()], left.sqrt());
            if own <= PlaneMotion::ROUNDING * motion.scale { motion.scale } else { own }
        };
        let scales: Vec<f64> = left.iter().enumerate().map(scale).collect();
        let moves = motions.iter().any(|motion| !motion.explained);
        let baseline = Baseline { rotation_error: moves.then_some(rotation_error), size };
        let errors = match self.held_out {
            Some(held_out) => {
                component_errors(self.training.outcome.model.composition(), held_out)?
            }
            None => Vec::new(),
        };
        let network = self.spec.name.clone();
        let mut trust = trust(&self.training.outcome, self.pairs, self.held_out, self.nearest)?;
        let shares: Vec<f64> =
            errors.iter().zip(&scales).map(|(error, scale)| error / scale).collect();
        if let Some(units) = self.units {
            trust.results.details.push(Block::Text(format!(
                "- {}. Errors of each component are in units of the data, all others in those of \
                 the network.\n",
                units_told(units)
            )));
            trust.results.data["units"] = json!(units);
        }
        let Scheduled { initial, legs, outcome } = self.training;
        let held_out_error = held_out_error(&outcome, &self.options.loss, self.held_out)?;
        let spec = self.spec.clone();
        let trained = Trained { spec, network, initial, legs, outcome, held_out_error };
        let mut result = TrainingResult::new(&trained, errors, self.options).with_shares(shares);
        if let Some(units) = self.units {
            result = result.in_units(units.factors());
        }
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
