//! The report of a training on your own pairs.

use super::findings::{Block, StudyFindings};
use super::folder::Folder;
use super::log::TrainingTimes;
use super::machine::Machine;
use super::predictions::{ByComponent, Judged, ORBITS, PREDICTION, coordinates_in_words};
use super::registry::Scene;
use super::report::Report;
use super::run::write;
use super::setup::{ModelSpec, Setup};
use super::study::training::{Baseline, LOSS, TrainingResult, findings};
use super::trained::{Trained, held_out_error};
use super::trust::trust;
use crate::error::Error;
use crate::flow::Pairs;
use crate::measure::trajectories::{
    component_errors, plane_motions, root_mean_square, rotation_errors,
};
use crate::network::{NetworkSpec, Structure};
use crate::scalar::max_or_nan;
use crate::train::{
    ActionTrial, Fit, FitNote, Fitted, Judgement, Limit, Optimiser, Outcome, Problem, Scheduled,
    Stop,
};
use serde::Serialize;
use serde_json::json;

/// What to try after a training.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NextStep {
    /// Use the model for predictions.
    Predict,
    /// Train a gyroceptron in normal form in place of the network.
    NormalForm,
    /// Train a gyroceptron of couplings, which need not keep areas, in place of the network.
    Couplings,
    /// Find the circle action from the pairs, in place of the one that was given.
    Action,
    /// Go on, up to this number of iterations.
    Iterations(u64),
    /// Hold pairs out, to judge by.
    HoldOut,
    /// Get more pairs than this number.
    Pairs(usize),
    /// Get pairs whose inputs do not repeat.
    DistinctPairs,
    /// Get pairs of more values of the controls than this number.
    Values(usize),
    /// Use Levenberg–Marquardt in place of the optimiser.
    Marquardt,
    /// Start from this number of initial weights.
    Starts(u64),
}

impl NextStep {
    /// What to try after a fit with this judgement.
    pub fn after(fitted: &Fitted, judgement: &Judgement) -> Self {
        let problem = &fitted.problem;
        let judge = problem.held_out.as_ref().unwrap_or(&problem.pairs);
        let (action, angles) = fitted.nearest();
        let left = rotation_errors(action, angles, judge);
        let rotation = (left.iter().sum::<f64>() / left.len() as f64).sqrt();
        let share = rotation / root_mean_square(judge.output());
        Self::by_judgement(problem, fitted.outcome(), judgement, share)
    }

    /// What to try after a training: `rotation` is the root mean square of what the nearest
    /// rotation leaves over that of the data.
    fn by_judgement(
        problem: &Problem,
        outcome: &Outcome,
        judgement: &Judgement,
        rotation: f64,
    ) -> Self {
        let options = &problem.training;
        let marquardt = matches!(options.optimiser, Optimiser::LevenbergMarquardt(_));
        if judgement.is_yes() || judgement.is_limited_by_its_pairs() {
            return Self::Predict;
        }
        if judgement.too_few.is_some() && judgement.repeated > 0 {
            return Self::DistinctPairs;
        }
        if judgement.too_few.is_some() {
            let all = problem.pairs.len() + judgement.held_out.unwrap_or(0);
            let enough = Fit::HELD_OUT * all as f64 >= Judgement::FEWEST as f64;
            return if enough { Self::HoldOut } else { Self::Pairs(problem.pairs.len()) };
        }
        if judgement.limit == Limit::Areas && outcome.model.architecture().circles.len() <= 1 {
            return Self::Couplings;
        }
        if judgement.limit == Limit::Data {
            // Held-out pairs of a machine are those of values that the training has not seen.
            let conditions = problem.pairs.conditions();
            return match conditions.first() {
                Some(condition) if !condition.controls.is_empty() => Self::Values(conditions.len()),
                _ => Self::Pairs(problem.pairs.len()),
            };
        }
        let falling = judgement.limit == Limit::Iterations && outcome.stop == Stop::Iterations;
        // Starts may have taken more than were asked for.
        let taken = options.iterations.max(outcome.best.iteration);
        let more = Self::Iterations(taken.saturating_mul(2));
        if outcome.stop == Stop::Iterations && taken < Limit::FEW_ITERATIONS {
            return more;
        }
        let architecture = outcome.model.architecture();
        let normal_form = architecture.action().and_then(|action| {
            let spec = NetworkSpec::named("normal-form").ok()?;
            spec.architecture(&action, 0.01, 1.0).ok()
        });
        if architecture.structure() == Structure::NearlyPeriodic
            && rotation < Fit::TURNS
            && normal_form.is_some_and(|architecture| architecture.check().is_ok())
        {
            return Self::NormalForm;
        }
        let is_given = !problem.notes.iter().any(|note| matches!(note, FitNote::Action(_)));
        let pairs = problem.pairs.len() >= ActionTrial::FEWEST;
        let dof = problem.pairs.dof();
        let has_others = architecture.has_circle() && dof == ActionTrial::PLANES && pairs;
        if judgement.is_little_learnt() && is_given && has_others {
            return Self::Action;
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

    /// The reason for this step, in words.
    fn reason(self) -> String {
        match self {
            Self::Predict => "the model can be used among the inputs of the pairs".into(),
            Self::NormalForm => {
                "the circle action turns the planes of the data, where a normal form learns more \
                 and keeps its invariant exactly"
                    .into()
            }
            Self::Couplings => {
                "the pairs change areas, as with friction: the network keeps them, and couplings need not".into()
            }
            Self::Action => {
                "little is learnt with the circle action that was given; short trainings may find another"
                    .into()
            }
            Self::Iterations(_) => "the loss was still falling, or there were too few iterations to say".into(),
            Self::HoldOut => {
                format!("a verdict takes {} pairs that the training does not see", Judgement::FEWEST)
            }
            Self::Pairs(count) => format!(
                "{count} training pairs are too few to learn from and to judge by; some thousands are usual"
            ),
            Self::DistinctPairs => {
                "pairs whose inputs repeat say nothing of points between them".into()
            }
            Self::Values(count) => format!(
                "held-out pairs are of values of the controls that are not among the {count} trained on: more \
                 values, or a lower degree in the controls, tell more of those between than more pairs of the same"
            ),
            Self::Marquardt => "Levenberg–Marquardt gets further than other optimisers".into(),
            Self::Starts(_) => "other initial weights may end lower".into(),
        }
    }
}

/// A training on pairs, to be reported.
pub struct OwnTraining<'a> {
    /// What the network is called.
    pub name: String,
    /// The network and what it was trained on.
    pub fitted: Fitted,
    /// The seconds that the training took, by iterations.
    pub times: TrainingTimes,
    /// The command that repeats it, without the file of the scene.
    pub command: String,
    /// Gives the command, or the call, that asks for a next step.
    pub next: &'a dyn Fn(NextStep) -> String,
}

impl OwnTraining<'_> {
    /// Writes the report into a folder: text, data and the figures.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn report(self, folder: &Folder) -> Result<Report, Error> {
        let Self { name, fitted, times, command, next: asked } = self;
        let Fitted { problem, training } = fitted;
        let Problem { pairs, held_out, units, training: options, .. } = &problem;
        let (held_out, units) = (held_out.as_ref(), units.as_ref());
        let nearest = (&problem.action, &problem.nearest[..]);
        let judge = held_out.unwrap_or(pairs);
        let (action, angles) = nearest;
        let left = rotation_errors(action, angles, judge);
        let rotation_error = left.iter().sum::<f64>() / left.len() as f64;
        let size = root_mean_square(judge.output());
        let moves = plane_motions(action, angles, judge).iter().any(|motion| !motion.explained);
        let baseline = Baseline { rotation_error: moves.then_some(rotation_error), size };
        let found = component_errors(training.outcome.model.composition(), judge)?;
        let coordinates = coordinates_in_words(problem.section.is_some());
        let of = ByComponent::new(found, nearest, judge, units, coordinates);
        let network = name.clone();
        let judgement = Judgement::new(&training.outcome, pairs, held_out, nearest)?
            .with_area_defects(problem.area_defects());
        let mut trust = trust(&judgement);
        let rotation = rotation_error.sqrt() / baseline.size;
        let next = NextStep::by_judgement(&problem, &training.outcome, &judgement, rotation);
        trust.results.summary.push(Block::Text(format!("**Error**: {}.", of.describe())));
        trust.results.summary.push(Block::Text(format!(
            "**Next**: `{}`: {}.",
            asked(next),
            next.reason()
        )));
        if units.is_some() {
            trust.results.summary.push(Block::Text(
                "Losses, errors of planes and actions are in the units of the network, into which the data are \
                 scaled."
                    .into(),
            ));
        }
        trust.results.data["next"] = json!(next);
        trust.results.data["worst_plane"] = json!(of.worst_plane().map(|plane| plane + 1));
        if let Some(words) = FitNote::of_negative_epsilons(pairs, training.outcome.model.epsilon())
        {
            trust.results.details.push(Block::Text(format!("- {words}.\n")));
        }
        for note in &problem.notes {
            match note {
                FitNote::Section(section) => {
                    trust.results.data["section_error"] = json!(section.error());
                }
                FitNote::Form(defect, _) => {
                    trust.results.data["form_defect"] = json!(defect.median);
                }
                FitNote::Reversal(defect) => {
                    trust.results.data["reversal_defect"] = json!(defect.median);
                }
                _ => continue,
            }
            trust.results.details.push(Block::Text(format!("- {note}\n")));
        }
        if let Some(units) = units {
            trust.results.details.push(Block::Text(format!(
                "- {}. Errors of each component are {coordinates}.\n",
                units.describe()
            )));
            trust.results.data["units"] = json!(units);
        }
        if training.outcome.model.architecture().has_polynomials() {
            let all = [Some(pairs), held_out].into_iter().flatten();
            let points = all.flat_map(Pairs::points);
            let reaches = points.map(|points| training.outcome.model.largest_reach(points));
            let reach = reaches.fold(0.0, max_or_nan);
            trust.results.details.push(Block::Text(format!(
                "- Over all pairs the arguments of the network's polynomials reach {reach:.3} of their \
                 box, outside of which they grow without a bound.\n"
            )));
            trust.results.data["reach"] = json!(reach);
        }
        let judged = Judged {
            models: vec![(&network, &training.outcome.model)],
            training: pairs,
            held_out,
            units,
            coordinates,
        };
        let figures = [judged.prediction()?, judged.orbits()?];
        let Scheduled { initial, stages, outcome } = training;
        let held_out_error = held_out_error(&outcome, &options.loss, held_out)?;
        let spec = ModelSpec {
            name,
            network: problem.network.clone(),
            weights: problem.weights,
            training: None,
            training_only: false,
            seeds: None,
        };
        let models = vec![spec.clone()];
        let trained =
            Trained { spec, network, initial, stages, outcome, held_out_error, lost: None };
        // Those of pairs that it was trained on are no held-out errors.
        let if_held_out = |values: &[f64]| match held_out {
            Some(_) => values.to_vec(),
            None => Vec::new(),
        };
        let result = TrainingResult::new(&trained, if_held_out(&of.errors), options)
            .with_shares(if_held_out(&of.shares));
        let training_times = vec![times];
        let mut findings = findings(&[result], baseline, &training_times, true);
        findings.results.details.push(Block::Heading("Errors by component".into()));
        findings.results.details.push(Block::Text(format!(
            "Of {} pairs, {coordinates}.",
            if held_out.is_some() { "the held-out" } else { "the training" }
        )));
        findings.results.details.push(Block::Table(of.table()));
        findings.figures.extend(figures);
        let title = format!(
            "A network trained on {} pairs, {} held out",
            pairs.len(),
            held_out.map_or(0, Pairs::len)
        );
        let setup = Setup { models, training: options.clone(), ..Setup::default() };
        let scene = Scene {
            name: trained.spec.name,
            title,
            seed: problem.seed,
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
        let repeat = Some(command);
        let report = Report { scene, studies, training_times, stages, machine, repeat, parts };
        write(folder, &report)?;
        Ok(report)
    }
}
