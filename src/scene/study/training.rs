//! The training of each network: where it ended, how it went, how long it took.

use super::over_seeds::MedianAndWorst;
use super::shared::{Study, finite};
use crate::layer::TorusAction;
use crate::measure::trajectories::{component_errors, milestones};
use crate::network::{Architecture, Layers};
use crate::scene::bibliography::{
    ADAM, CLENSHAW, COUPLINGS, HENON_NET, JOLTS, LBFGS, MARQUARDT, SYMP_NET,
};
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Axis, Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::log::TrainingTimes;
use crate::scene::predictions::{ByComponent, Judged, ORBITS, PREDICTION, coordinates_in_words};
use crate::scene::setup::Need;
use crate::scene::trained::{Trained, loss_of};
use crate::train::{Optimiser, StageResult, Stop, TrainingOptions, TrainingRecord, TrainingStage};
use serde::Serialize;
use serde_json::json;

pub(in crate::scene) const LOSS: &str = "loss";

/// In every scene that names networks.
pub(in crate::scene) struct TrainingStudy;

impl Study for TrainingStudy {
    fn name(&self) -> &'static str {
        "training"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::TargetFlow, Need::FlowTime, Need::Data, Need::Models]
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![LOSS, PREDICTION, ORBITS]
    }

    fn cites(&self, scene: &Declared<'_>) -> Vec<&'static str> {
        let setup = &scene.setup;
        let mut out = vec![HENON_NET];
        for model in &setup.models {
            if model.network.is_of_file() {
                continue;
            }
            let action = model.network.own_action().unwrap_or(TorusAction::of_planes(1));
            let blocks = model.network.architecture(&action, 0.0, 1.0).map(|of| of.blocks);
            for block in blocks.into_iter().flatten() {
                if block.ridges.is_polynomial() {
                    out.extend([JOLTS, CLENSHAW]);
                }
                match block.layers {
                    Layers::SympNet(_) => out.push(SYMP_NET),
                    Layers::TurnedCoupling(_) => out.push(COUPLINGS),
                    _ => {}
                }
            }
            out.push(match setup.training_of(model).optimiser {
                Optimiser::Lbfgs(_) => LBFGS,
                Optimiser::LevenbergMarquardt(_) => MARQUARDT,
                Optimiser::Adam(_) => ADAM,
            });
        }
        out
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let (data, models) = (context.data()?, context.all_models()?);
        let coordinates = coordinates_in_words(data.section.is_some());
        let (mut results, mut by_component) = (Vec::new(), Vec::new());
        for trained in models.iter() {
            let mut errors = match data.validation().filter(|_| trained.lost.is_none()) {
                None => Vec::new(),
                Some(held_out) => context.stage("held-out errors of each component", |_| {
                    component_errors(trained.model().composition(), held_out)
                })?,
            };
            let options = context.scene.setup.training_of(&trained.spec);
            let loss = loss_of(&options.loss, context.target()?, &data)?;
            let options = TrainingOptions { loss, ..options.clone() };
            let mut shares = Vec::new();
            if let (Some((action, angles)), Some(held_out), None) =
                (&data.nearest, data.validation(), &trained.lost)
            {
                let of = ByComponent::new(
                    errors,
                    (action, angles),
                    held_out,
                    data.units.as_ref(),
                    coordinates,
                );
                (errors, shares) = (of.errors.clone(), of.shares.clone());
                by_component.push(Block::Heading(format!("Errors of `{}`", trained.spec.name)));
                by_component.push(Block::Text(format!("Of the held-out pairs, {coordinates}.")));
                by_component.push(Block::Table(of.table()));
            }
            results.push(TrainingResult::new(trained, errors, &options).with_shares(shares));
        }
        let baseline = Baseline { rotation_error: data.rotation_error, size: data.size() };
        let draws = context.draws(LOSS);
        let mut found = findings(&results, baseline, context.training_times(), draws);
        found.results.details.append(&mut by_component);
        let studied: Vec<_> = models
            .iter()
            .filter(|trained| !trained.spec.training_only && trained.lost.is_none())
            .collect();
        let judged = Judged {
            models: studied.iter().map(|t| (&t.spec.name[..], t.model())).collect(),
            training: &data.training,
            held_out: data.held_out.as_ref(),
            units: data.units.as_ref(),
            coordinates,
        };
        if context.draws(PREDICTION) {
            found.figures.push(context.stage("predictions", |_| judged.prediction())?);
        }
        if context.draws(ORBITS) {
            found.figures.push(context.stage("orbits of the networks", |_| judged.orbits())?);
        }
        Ok(found)
    }
}

/// What the errors are compared with.
#[derive(Clone, Copy)]
pub(in crate::scene) struct Baseline {
    /// The held-out mean squared error of the limiting rotation alone.
    pub(in crate::scene) rotation_error: Option<f64>,
    /// The root mean square of the components of the outputs.
    pub(in crate::scene) size: f64,
}

pub(in crate::scene) fn findings(
    results: &[TrainingResult],
    baseline: Baseline,
    times: &[TrainingTimes],
    draws: bool,
) -> Findings {
    let mut details = Vec::new();
    for result in results.iter().filter(|result| result.is_first()) {
        let heading = format!("`{}`: {} parameters", result.name, result.parameters);
        details.push(Block::Heading(heading));
        details.push(Block::Table(result.facts(baseline.rotation_error)));
    }
    let mut summary = vec![Block::Table(overview(results, baseline))];
    let seeds = over_seeds(results, baseline);
    if !seeds.is_empty() {
        summary.push(Block::Text("From several initial weights:".into()));
        summary.push(Block::Table(seeds));
    }
    let of_lost = |result: &TrainingResult| {
        let reason = result.lost.as_ref()?;
        Some(format!("- `{}` is lost: {reason}.\n", result.name))
    };
    let lost: String = results.iter().filter_map(of_lost).collect();
    if !lost.is_empty() {
        summary.push(Block::Text(lost));
    }
    Findings {
        title: "Training".into(),
        results: Section { summary, details, data: json!({ "models": results }) },
        timings: Section { details: pace(results, times), ..Section::default() },
        figures: if draws { vec![loss(results, times)] } else { Vec::new() },
        ..Findings::default()
    }
}

/// What became of one network.
#[derive(Serialize)]
pub(in crate::scene) struct TrainingResult {
    /// That of its files: the network's, and which of its initial weights.
    name: String,
    network: String,
    architecture: Architecture,
    parameters: usize,
    optimiser: &'static str,
    /// The reason why the training ended.
    stop: Stop,
    /// The record of the last iteration.
    last: TrainingRecord,
    /// The loss of the model that was kept, on all training pairs.
    loss: f64,
    /// The record of the iteration whose model was kept.
    best: TrainingRecord,
    /// The records at which the held-out pairs were evaluated.
    history: Vec<TrainingRecord>,
    /// The root-mean-square error of each component on the held-out pairs.
    component_errors: Vec<f64>,
    /// The mean squared error on the held-out pairs: that which chose the model, but for one
    /// with weights.
    #[serde(skip)]
    held_out_error: Option<f64>,
    /// The same, where it is not that which chose the model.
    #[serde(rename = "held_out_error", skip_serializing_if = "Option::is_none")]
    plain_error: Option<f64>,
    /// The weights of the components in the loss and in what chose the model, of mean 1, where
    /// they are not all the same.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    loss_weights: Vec<f64>,
    /// The same over what the nearest rotation leaves of the component.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    component_shares: Vec<f64>,
    /// What led to the last stage of its training.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    stages: Vec<StageResult>,
    initial_theta: Option<f64>,
    theta: Option<f64>,
    /// Why there is no trained network.
    #[serde(skip_serializing_if = "Option::is_none")]
    lost: Option<String>,
}

impl TrainingResult {
    pub(in crate::scene) fn new(
        trained: &Trained,
        component_errors: Vec<f64>,
        options: &TrainingOptions,
    ) -> Self {
        let (outcome, model) = (&trained.outcome, trained.model());
        let held_out = !component_errors.is_empty();
        let dof = model.composition().dof();
        let loss_weights: Vec<f64> = match options.loss.is_plain_on_held_out() {
            true => Vec::new(),
            false => {
                let weights = options.loss.component_weights(dof).unwrap_or_default();
                weights.iter().map(|weight| 2.0 * dof as f64 * weight).collect()
            }
        };
        let kept = |r: &TrainingRecord| {
            r.validation.is_some()
                || (!held_out && r.iteration.is_multiple_of(options.validate_every))
        };
        Self {
            name: trained.spec.name.clone(),
            network: trained.network.clone(),
            architecture: model.architecture().clone(),
            parameters: model.composition().parameters().len(),
            optimiser: match outcome.stop {
                Stop::NotTrained => "trained elsewhere",
                _ => options.optimiser.name(),
            },
            stop: outcome.stop,
            last: outcome.history[outcome.history.len() - 1],
            loss: outcome.loss,
            best: outcome.best,
            history: outcome.history.iter().copied().filter(kept).collect(),
            component_errors,
            held_out_error: trained.held_out_error,
            plain_error: trained.held_out_error.filter(|_| !loss_weights.is_empty()),
            loss_weights,
            component_shares: Vec::new(),
            stages: trained.stages.clone(),
            initial_theta: trained.initial.angle(),
            theta: model.angle(),
            lost: trained.lost.clone(),
        }
    }

    /// With the errors of the components over what the nearest rotation leaves of each.
    pub(in crate::scene) fn with_shares(self, component_shares: Vec<f64>) -> Self {
        Self { component_shares, ..self }
    }

    /// Whether it is of the first of its network's initial weights.
    fn is_first(&self) -> bool {
        self.name == self.network
    }

    /// The held-out error over that of the limiting rotation, as roots.
    fn share(&self, rotation_error: Option<f64>) -> Option<f64> {
        finite((self.held_out_error? / rotation_error?).sqrt())
    }

    fn facts(&self, rotation_error: Option<f64>) -> Table {
        let mut facts = Table::of_facts();
        if let Some(reason) = &self.lost {
            facts.fact("training", format!("lost: {reason}; no study has this network"));
            return facts;
        }
        facts.fact(
            "training",
            format!(
                "{}: {} iterations, {} evaluations of the loss; ended: {}",
                self.optimiser,
                self.last.iteration,
                self.last.evaluations,
                stop_words(self.stop)
            ),
        );
        for stage in &self.stages {
            let error = match stage.best.validation {
                Some(error) => format!("held-out error {error:.2e}"),
                None => format!("loss {:.2e}", stage.best.loss),
            };
            let iteration = stage.best.iteration;
            let time = Format::Magnitude.number(stage.time);
            let place = match stage.stage {
                TrainingStage::Ramp(_) => {
                    format!(" at ε = {} and {time} of the flow time", stage.epsilon)
                }
                TrainingStage::Twists(_) => " alone, in the coordinates of the chart".to_owned(),
                TrainingStage::Start(_) | TrainingStage::Last => String::new(),
            };
            let went_on = match (stage.stage, stage.chosen) {
                (TrainingStage::Start(_) | TrainingStage::Twists(_), true) => ", which went on",
                _ => "",
            };
            facts.fact(
                &stage.stage.name(),
                format!("{error} after {iteration} iterations{place}{went_on}"),
            );
        }
        let (iteration, loss) = (self.best.iteration, self.loss);
        facts.fact("kept", format!("iteration {iteration}, loss {loss:.3e}"));
        if !self.loss_weights.is_empty() {
            let weights: Vec<_> = self.loss_weights.iter().map(|w| format!("{w:.2e}")).collect();
            facts.fact("weights of the components in the loss", weights.join(", "));
            if let Some(validation) = self.best.validation {
                facts.fact("held-out loss, which chose the model", format!("{validation:.3e}"));
            }
        }
        if let Some(validation) = self.held_out_error {
            let share = self.share(rotation_error).map(|share| {
                let share = Format::Percent.number(share);
                format!(", {share} of the motion beyond the rotation")
            });
            let (root, share) = (validation.sqrt(), share.unwrap_or_default());
            facts.fact(
                "held-out mean squared error",
                format!("{validation:.3e}: {root:.2e} rms{share}"),
            );
        }
        if !self.component_errors.is_empty() {
            let errors: Vec<_> = self.component_errors.iter().map(|e| format!("{e:.2e}")).collect();
            facts.fact("held-out RMS error of each component", errors.join(", "));
        }
        if !self.component_shares.is_empty() {
            let shares: Vec<_> =
                self.component_shares.iter().map(|share| Format::Percent.number(*share)).collect();
            let name = "of the motion of each that the nearest rotation leaves";
            facts.fact(name, shares.join(", "));
        }
        if let (Some(before), Some(after)) = (self.initial_theta, self.theta) {
            facts.fact("θ", format!("{before} before training, {after:.6} after"));
        }
        facts
    }

    /// The held-out errors at their iterations.
    fn held_out(&self) -> Vec<(u64, f64)> {
        self.history.iter().filter_map(|r| Some((r.iteration, r.validation?))).collect()
    }
}

fn overview(results: &[TrainingResult], baseline: Baseline) -> Table {
    // With weights the loss is no mean squared error: what it is of held-out pairs stands beside it.
    let has_weights = |result: &TrainingResult| !result.loss_weights.is_empty();
    let firsts = || results.iter().filter(|result| result.is_first());
    let is_weighted = firsts().any(has_weights);
    let is_mixed = is_weighted && !firsts().all(has_weights);
    let held_out_loss = is_weighted.then_some(("held-out loss", Format::Exponent(3)));
    let weights = is_mixed.then_some(("weights of the loss", Format::Exact));
    let columns = [
        ("network", Format::Exact),
        ("parameters", Format::Exact),
        ("optimiser", Format::Exact),
        ("iterations", Format::Exact),
        (if is_weighted && !is_mixed { "loss, weighted" } else { "loss" }, Format::Exponent(3)),
    ];
    let errors = [
        ("held-out MSE", Format::Exponent(3)),
        ("rms", Format::Exponent(2)),
        ("relative to rms z", Format::Exponent(2)),
        ("share of the motion beyond the rotation", Format::Percent),
    ];
    let mut table =
        Table::new(columns.into_iter().chain(held_out_loss).chain(weights).chain(errors));
    for result in firsts() {
        let validation = result.held_out_error.and_then(finite);
        let mut row = vec![
            format!("`{}`", result.name).into(),
            result.parameters.into(),
            result.optimiser.into(),
            result.last.iteration.into(),
            finite(result.loss).into(),
        ];
        if is_weighted {
            row.push(result.best.validation.and_then(finite).into());
        }
        if is_mixed {
            row.push(if has_weights(result) { "by plane" } else { "none" }.into());
        }
        row.extend([
            validation.into(),
            validation.map(f64::sqrt).into(),
            validation.map(|error| error.sqrt() / baseline.size).into(),
            result.share(baseline.rotation_error).into(),
        ]);
        table.push(row);
    }
    table
}

/// A row for each network that was trained from several initial weights.
fn over_seeds(results: &[TrainingResult], baseline: Baseline) -> Table {
    let mut table = Table::new([
        ("network", Format::Exact),
        ("seeds", Format::Exact),
        ("held-out MSE: median", Format::Exponent(2)),
        ("best", Format::Exponent(2)),
        ("worst", Format::Exponent(2)),
        ("share of the motion beyond the rotation: median", Format::Percent),
        ("worst", Format::Percent),
    ]);
    for first in results.iter().filter(|result| result.is_first()) {
        let of_network = results.iter().filter(|result| result.network == first.network);
        let errors: Vec<f64> = of_network.filter_map(|r| r.held_out_error).collect();
        if errors.len() < 2 {
            continue;
        }
        let best = errors.iter().copied().min_by(f64::total_cmp).and_then(finite);
        let MedianAndWorst { median, worst } = MedianAndWorst::of(errors.iter().copied().map(Some));
        let share = |error: Option<f64>| Some((error? / baseline.rotation_error?).sqrt());
        table.push([
            format!("`{}`", first.network).into(),
            errors.len().into(),
            median.into(),
            best.into(),
            worst.into(),
            share(median).into(),
            share(worst).into(),
        ]);
    }
    table
}

fn pace(results: &[TrainingResult], times: &[TrainingTimes]) -> Vec<Block> {
    let mut lines = String::new();
    for times in times {
        let Some((iterations, seconds)) = times.points.last() else { continue };
        lines.push_str(&format!(
            "- `{}`: {seconds:.1} s, {:.1} iterations a second\n",
            times.model,
            *iterations as f64 / (seconds - times.before())
        ));
        let held_out = results.iter().find(|r| r.name == times.model).map(TrainingResult::held_out);
        for passed in milestones(&held_out.unwrap_or_default()) {
            if let Some(seconds) = times.seconds(passed.iteration) {
                lines.push_str(&format!(
                    "  - held-out error ≤ {:.0e} after {} iterations, {seconds:.1} s\n",
                    passed.level, passed.iteration
                ));
            }
        }
    }
    if lines.is_empty() { Vec::new() } else { vec![Block::Text(lines)] }
}

fn loss(results: &[TrainingResult], times: &[TrainingTimes]) -> Figure {
    let mut against_iterations = Vec::new();
    let mut against_seconds = Vec::new();
    let mut networks: Vec<&str> = Vec::new();
    for result in results.iter().filter(|result| result.lost.is_none()) {
        let times = times.iter().find(|times| times.model == result.name);
        let color = networks.iter().position(|name| *name == result.network).unwrap_or_else(|| {
            networks.push(&result.network);
            networks.len() - 1
        });
        let held_out = result.history.iter().any(|r| r.validation.is_some());
        let value = |r: &TrainingRecord| if held_out { r.validation } else { Some(r.loss) };
        let known: Vec<_> =
            result.history.iter().filter_map(|r| Some((r.iteration, value(r)?))).collect();
        let points = known.iter().map(|(i, v)| (*i as f64, *v)).collect();
        let timed = known.iter().filter_map(|(i, v)| Some((times?.seconds(*i)?, *v))).collect();
        let (name, style) = match result.is_first() {
            true => (format!("{}, {}", result.name, result.optimiser), Style::Line),
            false => (String::new(), Style::Faint),
        };
        against_iterations.push(Series { name: name.clone(), color, style, points });
        against_seconds.push(Series { name, color, style, points: timed });
    }
    let weights = match results.iter().any(|result| !result.loss_weights.is_empty()) {
        true => " with the weights of the loss",
        false => "",
    };
    let panel = |x_label: &str, series| Panel {
        title: "Training".into(),
        x_label: x_label.into(),
        y_label: "mean squared error".into(),
        y: Axis::Log,
        series,
        ..Panel::default()
    };
    Figure::in_a_row(
        LOSS,
        &format!(
            "The held-out mean squared error{weights} (the loss, where nothing is held out) against \
             iterations and against seconds of training on this machine. Pale: other initial weights."
        ),
        vec![panel("iterations", against_iterations), panel("seconds", against_seconds)],
    )
}

/// Why training ended, in words.
pub fn stop_words(stop: Stop) -> &'static str {
    match stop {
        Stop::Iterations => "the iterations asked for were done",
        Stop::Target => "the target was reached",
        Stop::Patience => "the held-out error improved no more",
        Stop::Plateau => "the error was at rest: a plateau",
        Stop::Gradient => "the gradient reached its tolerance",
        Stop::Stalled => "no step lowered the loss any more",
        Stop::Diverged => "the loss left the finite numbers",
        Stop::NotTrained => "trained elsewhere",
        Stop::Interrupted => "interrupted",
    }
}
