//! The report of a training on pairs of one's own.

use super::declaration::Scene;
use super::findings::{Block, Format};
use super::folder::Folder;
use super::learning::{Trained, held_out_error};
use super::log::TrainingTimes;
use super::machine::Machine;
use super::predictions::{ByComponent, Judged, ORBITS, PREDICTION};
use super::report::{Report, StudyFindings};
use super::run::write;
use super::setup::{ModelSpec, Setup};
use super::study::training::{Baseline, LOSS, TrainingResult, findings};
use super::trust::trust;
use crate::error::Error;
use crate::flow::Pairs;
use crate::layer::TorusAction;
use crate::measure::{component_errors, plane_motions, root_mean_square, rotation_errors};
use crate::network::NetworkSpec;
use crate::phase::Units;
use crate::train::{Optimiser, Scheduled, Stop, TrainingOptions};
use serde::Serialize;
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

/// What is said of pairs with an ε below 0; None where there are none.
pub fn negative_epsilons(pairs: &Pairs) -> Option<String> {
    let below = pairs.conditions().iter().filter(|condition| condition.epsilon < 0.0);
    let count: usize = below.map(|condition| condition.pairs).sum();
    (count > 0).then(|| {
        format!(
            "{count} of {} pairs have ε below 0. ε keeps its sign: it multiplies what the network \
             adds to the rotation, and a prediction for these pairs needs the same sign",
            pairs.len()
        )
    })
}

/// What to try after a training.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NextStep {
    /// Use the model.
    Predict,
    /// A gyroceptron in normal form in place of the network.
    NormalForm,
    /// Go on, up to so many iterations.
    Iterations(u64),
    /// More pairs than so many.
    Pairs(usize),
    /// Levenberg–Marquardt in place of the optimiser.
    Marquardt,
    /// So many initial weights.
    Starts(u64),
}

impl NextStep {
    /// Of a rotation that leaves more than this share of the data, the planes are not those that turn.
    const TURNS: f64 = 0.5;
    /// Fewer iterations tell nothing of a network.
    const FEW: u64 = 50;

    /// What to try after a training: `data` are those of its trust, `rotation` the root mean square
    /// of what the nearest rotation leaves over that of the data.
    fn after(training: &OwnTraining<'_>, data: &serde_json::Value, rotation: f64) -> Self {
        let (outcome, options) = (&training.training.outcome, training.options);
        let limit = data["limit"].as_str().unwrap_or_default();
        let trusted = data["trust"].as_str().is_some_and(|word| word.starts_with("yes"));
        let marquardt = matches!(options.optimiser, Optimiser::LevenbergMarquardt(_));
        if trusted {
            return Self::Predict;
        }
        if limit == "data" {
            return Self::Pairs(training.pairs.len());
        }
        let falling = limit == "iterations" && outcome.stop == Stop::Iterations;
        let more = Self::Iterations(options.iterations.saturating_mul(2));
        if outcome.stop == Stop::Iterations && options.iterations < Self::FEW {
            return more;
        }
        let architecture = outcome.model.architecture();
        let normal_form = architecture.action().and_then(|action| {
            let spec = NetworkSpec::named("normal-form").ok()?;
            spec.architecture(&action, 0.01, 1.0).ok()
        });
        if architecture.name() == Some("gyroceptron")
            && rotation < Self::TURNS
            && normal_form.is_some_and(|architecture| architecture.check().is_ok())
        {
            return Self::NormalForm;
        }
        if falling {
            return more;
        }
        match (marquardt, options.starts) {
            (false, _) => Self::Marquardt,
            (true, None) => Self::Starts(4),
            (true, Some(starts)) => Self::Starts(starts.count.saturating_mul(2)),
        }
    }

    /// Why.
    fn reason(self) -> String {
        match self {
            Self::Predict => "the model can be used within the box of the pairs".into(),
            Self::NormalForm => {
                "the circle action turns the planes of the data, where a normal form learns more \
                 and keeps its invariant exactly"
                    .into()
            }
            Self::Iterations(_) => "the iterations were done before the loss was at rest".into(),
            Self::Pairs(count) => format!(
                "{count} training pairs are too few: the network knows them by heart; four times as \
                 many tell whether it is the data"
            ),
            Self::Marquardt => "Levenberg–Marquardt gets further than other optimisers".into(),
            Self::Starts(_) => "other initial weights may end lower".into(),
        }
    }
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
    /// How a next step is asked for: a command, or a call.
    pub next: &'a dyn Fn(NextStep) -> String,
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
        let moves = plane_motions(action, angles, judge).iter().any(|motion| !motion.explained);
        let baseline = Baseline { rotation_error: moves.then_some(rotation_error), size };
        let found = component_errors(self.training.outcome.model.composition(), judge)?;
        let error = root_mean_square(&found);
        let of = ByComponent::new(found, self.nearest, judge, self.units);
        let network = self.spec.name.clone();
        let mut trust = trust(&self.training.outcome, self.pairs, self.held_out, self.nearest)?;
        let rotation = rotation_error.sqrt() / baseline.size;
        let next = NextStep::after(&self, &trust.results.data, rotation);
        let share = match baseline.rotation_error {
            Some(left) => {
                let share = Format::Percent.number(error / left.sqrt());
                format!("{share} of the motion beyond the nearest rotation; ")
            }
            None => String::new(),
        };
        trust.results.summary.push(Block::Text(format!("**Error**: {share}{}.", of.told())));
        trust.results.summary.push(Block::Text(format!(
            "**Next**: `{}`: {}.",
            (self.next)(next),
            next.reason()
        )));
        trust.results.data["next"] = json!(next);
        trust.results.data["worst_plane"] = json!(of.worst_plane().map(|plane| plane + 1));
        if let Some(told) = negative_epsilons(self.pairs) {
            trust.results.details.push(Block::Text(format!("- {told}.\n")));
        }
        if let Some(units) = self.units {
            trust.results.details.push(Block::Text(format!(
                "- {}. Errors of each component are in units of the data, all others in those of \
                 the network.\n",
                units_told(units)
            )));
            trust.results.data["units"] = json!(units);
        }
        let judged = Judged {
            models: vec![(&network, &self.training.outcome.model)],
            training: self.pairs,
            held_out: self.held_out,
            units: self.units,
        };
        let figures = [judged.prediction()?, judged.orbits()?];
        let Scheduled { initial, legs, outcome } = self.training;
        let held_out_error = held_out_error(&outcome, &self.options.loss, self.held_out)?;
        let spec = self.spec.clone();
        let trained = Trained { spec, network, initial, legs, outcome, held_out_error };
        // Those of pairs that it was trained on are no held-out errors.
        let held_out = |values: &[f64]| match self.held_out {
            Some(_) => values.to_vec(),
            None => Vec::new(),
        };
        let result = TrainingResult::new(&trained, held_out(&of.errors), self.options)
            .with_shares(held_out(&of.shares));
        let training_times = vec![self.times];
        let mut findings = findings(&[result], baseline, &training_times, true);
        findings.results.details.push(Block::Heading("Errors by component".into()));
        findings.results.details.push(Block::Text(format!(
            "Of {} pairs, in units of the data.",
            if self.held_out.is_some() { "the held-out" } else { "the training" }
        )));
        findings.results.details.push(Block::Table(of.table()));
        findings.figures.extend(figures);
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
            plots: [LOSS, PREDICTION, ORBITS].map(str::to_owned).into(),
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
