//! Maps of several flow times beside integrators: where a surrogate overtakes them.

use super::rollout::RolloutOptions;
use super::seed_errors::{SeedErrors, SeedGains};
use super::shared::Study;
use super::step_tables::{MadeTable, TableCost, TableSizes, citations_of, make, named};
use super::work_precision::{
    HOW, IntegratorSteps, MOST_ROUNDS, Networks, Points, WorkPrecisionOptions, citations,
    work_precision_panel,
};
use crate::error::Error;
use crate::flow::{Integrator, Reference, Trajectories};
use crate::measure::{
    timing::{AtError, Comparison, WorkPrecision, break_even},
    trajectories::drifts,
};
use crate::network::{Model, Rollout};
use crate::scalar::max_or_nan;
use crate::scene::context::{Context, RunError};
use crate::scene::data_sets::DataSets;
use crate::scene::declared::Declared;
use crate::scene::figure::{Axis, Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::learning::without_lost;
use crate::scene::setup::{
    MOST, ModelSpec, Need, SeededTraining, Setup, StudyTraining, check_points,
};
use crate::scene::target_flow::TargetFlow;
use crate::scene::trained::Trained;
use crate::system::{Hamiltonian, NearlyPeriodic};
use crate::train::StageResult;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::rc::Rc;

const FIGURE: &str = "long-steps";
const METHODS: &str = "long-steps-methods";

/// States along which an exact invariant is looked at.
const KEPT: usize = 100;

/// Maps of several flow times beside integrators.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LongStepsOptions {
    /// The flow times of the maps, ascending. At the scene's flow time, its trained networks are taken; at the others,
    /// networks are trained in the same way.
    pub flow_times: Vec<f64>,
    /// Whether the first start of each training has the weights of the flow time before, instead of random weights and
    /// of what the training's ramp and fresh twists lead to.
    #[serde(default)]
    pub ramp: bool,
    /// The length of the trajectories.
    pub duration: f64,
    /// The time between two of their states that are compared with the reference.
    pub interval: f64,
    /// The initial points of the trajectories, 2n numbers each.
    pub initial: Vec<Vec<f64>>,
    /// The number of held-out pairs on which one step is judged.
    pub points: usize,
    /// How often each time is taken.
    pub rounds: usize,
    /// The number of iterations over which the invariant of a network that owns an exact one is followed.
    pub invariant_steps: usize,
    /// What the networks are compared with.
    pub integrators: Vec<IntegratorStepSizes>,
    /// Tables of the maps, with which the networks are compared too.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tables: Vec<TableSizes>,
}

/// An integrator with the steps it is tried with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IntegratorStepSizes {
    /// The integrator that the networks are compared with.
    pub integrator: Integrator,
    /// The steps that the integrator is tried with, as times. For each, the number of steps is the one that comes
    /// nearest to a flow time, and at least one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub steps: Vec<f64>,
    /// The largest step of a range, in place of a list of steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<f64>,
    /// The smallest step of that range.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<f64>,
    /// The ratio of each step of a range to the next smaller one.
    #[serde(default = "usual_factor", skip_serializing_if = "is_usual_factor")]
    pub factor: f64,
}

/// The factor that scenes do not name.
const FACTOR: f64 = 1.2;

fn usual_factor() -> f64 {
    FACTOR
}

fn is_usual_factor(factor: &f64) -> bool {
    *factor == FACTOR
}

impl IntegratorStepSizes {
    /// Fails unless there is a list of steps or a range, and each step is a positive time.
    fn check(&self, shortest: f64) -> Result<(), Error> {
        let step = |step: f64| {
            Error::check_range("integrators.steps", step, shortest, f64::MAX)?;
            Ok::<_, Error>(())
        };
        match (&self.steps[..], self.from, self.to) {
            ([], Some(from), Some(to)) => {
                step(from)?;
                step(to)?;
                Error::check_range("integrators.factor", self.factor, 1.01, f64::MAX)?;
                if !(to <= from) {
                    let found = format!("from {from} to {to}");
                    return Err(Error::invalid("integrators", found, "the larger step first"));
                }
                Error::check_count_range("integrators.steps", self.sizes().len(), 1, MOST)?;
                Ok(())
            }
            ([_, ..], None, None) => {
                Error::check_count_range("integrators.steps", self.steps.len(), 1, MOST)?;
                self.steps.iter().try_for_each(|&size| step(size))
            }
            (steps, from, to) => {
                let found = format!("steps = {steps:?}, from = {from:?}, to = {to:?}");
                Err(Error::invalid("integrators", found, "either steps, or both from and to"))
            }
        }
    }

    /// The step sizes of the list or of the range, as times.
    fn sizes(&self) -> Vec<f64> {
        let (Some(from), Some(to)) = (self.from, self.to) else { return self.steps.clone() };
        // But for rounding, the last is among them.
        let last = (libm::log(from / to) / libm::log(self.factor) + 1e-9) as i32;
        (0..=last).map(|k| from / libm::pow(self.factor, k.into())).collect()
    }

    /// Numbers of steps in a time, each once.
    fn counts(&self, time: f64) -> Vec<usize> {
        let count = |step: f64| ((time / step).round() as usize).max(1);
        let mut out: Vec<usize> = self.sizes().into_iter().map(count).collect();
        out.sort_unstable();
        out.dedup();
        out
    }

    /// Of a study cut short: every other step, or a range by a larger factor.
    fn shorten(&mut self) {
        self.steps = self.steps.iter().step_by(2).copied().collect();
        if self.from.is_some() {
            self.factor = self.factor.max(2.0);
        }
    }
}

/// A whole number of steps of one time in another, but for rounding.
fn whole_steps(name: &str, time: f64, step: f64) -> Result<usize, Error> {
    let count = (time / step).round();
    if !(count >= 1.0 && count <= MOST as f64 && (count * step - time).abs() <= 1e-9 * time) {
        let expected = format!("a whole number of steps of {step}");
        return Err(Error::invalid(name, time, expected));
    }
    Ok(count as usize)
}

impl Study for LongStepsOptions {
    fn name(&self) -> &'static str {
        "long_steps"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::System, Need::FlowTime, Need::Data, Need::Models]
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        Error::check_count_range("flow_times", self.flow_times.len(), 1, MOST)?;
        Error::check_count_range("points", self.points, 1, MOST)?;
        Error::check_count_range("rounds", self.rounds, 1, MOST_ROUNDS)?;
        Error::check_count_range("invariant_steps", self.invariant_steps, KEPT, MOST)?;
        if !self.invariant_steps.is_multiple_of(KEPT) {
            let expected = format!("a multiple of {KEPT}");
            return Err(Error::invalid("invariant_steps", self.invariant_steps, expected));
        }
        for time in &self.flow_times {
            Error::check_range("flow_times", *time, Error::LEAST_POSITIVE, f64::MAX)?;
            whole_steps("interval", self.interval, *time)?;
            scene.setup.check_repeated(*time)?;
        }
        if let Some(pair) = self.flow_times.windows(2).find(|pair| !(pair[0] < pair[1])) {
            let found = format!("{} after {}", pair[1], pair[0]);
            return Err(Error::invalid("flow_times", found, "ascending ones"));
        }
        whole_steps("duration", self.duration, self.interval)?;
        let of_file = |model: &&ModelSpec| model.network.is_of_file();
        if let Some(model) = scene.setup.models.iter().find(of_file) {
            let expected = "networks to train: one of a file has one flow time";
            return Err(Error::invalid("models", &model.name, expected));
        }
        for entry in &self.integrators {
            match &scene.setup.system {
                Some(system) => entry.integrator.check_for(system)?,
                None => entry.integrator.check()?,
            }
            // As many steps at most as any count of a scene may be.
            entry.check(self.interval / MOST as f64)?;
        }
        let dof = scene.setup.system.as_ref().map(Hamiltonian::dof);
        self.tables.iter().try_for_each(|table| table.check(dof))?;
        match &scene.setup.system {
            Some(system) => check_points("initial", &self.initial, system),
            None => Ok(()),
        }
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![FIGURE, METHODS]
    }

    fn cites(&self, _: &Declared<'_>) -> Vec<&'static str> {
        let mut out = citations(self.integrators.iter().map(|entry| entry.integrator));
        out.extend(citations_of(&self.tables));
        out
    }

    /// A study of every other flow time and step of an integrator, timed less often.
    fn shorten(&mut self) {
        // The longest is among them.
        self.flow_times = self.flow_times.iter().rev().step_by(2).rev().copied().collect();
        self.integrators.iter_mut().for_each(IntegratorStepSizes::shorten);
        self.tables.iter_mut().for_each(TableSizes::shorten);
        self.rounds = self.rounds.min(3);
        self.invariant_steps = self.invariant_steps.min(100_000);
    }

    fn trainings(&self, setup: &Setup) -> Vec<StudyTraining> {
        self.others(setup).flat_map(|time| self.attempts(setup, time)).collect()
    }

    fn train_new(
        &self,
        context: &mut Context<'_>,
        training: &StudyTraining,
    ) -> Result<Rc<Trained>, RunError> {
        let before = match &training.from {
            None => None,
            Some(from) => {
                let setup = context.scene.setup;
                let own = self.trainings(setup).into_iter();
                let mut own = own.filter(|other| other.training.spec.name == *from);
                Some(match own.next() {
                    Some(earlier) => (self.train(context, &earlier)?, earlier.flow_time),
                    None => (context.of_setup(from)?, context.flow_time()?),
                })
            }
        };
        let data = context.data_at(context.system()?.epsilon(), training.flow_time)?;
        let before = before.filter(|(earlier, _)| earlier.lost.is_none());
        let from = before.as_ref().map(|(earlier, time)| (earlier.model(), *time));
        context.learn(training.training.clone(), &data, training.flow_time, from)
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let system = context.system()?;
        let states = whole_steps("duration", self.duration, self.interval)? + 1;
        let reference = context.reference(system, &self.initial, self.interval, states)?;
        let mut results = Vec::new();
        for &time in &self.flow_times {
            let trained = self.trained_at(context, time)?;
            let data = context.data_at(system.epsilon(), time)?;
            let points = Points::evenly(data.to_judge_by(), self.points);
            let models = trained.iter().map(|one| (network_name(one), one.model())).collect();
            let tables = self.tables_at(context, &data, time)?;
            let target = TargetFlow::System(system);
            let networks = Networks { models, target, time, tables: &tables };
            let every = whole_steps("interval", self.interval, time)?;
            let options = WorkPrecisionOptions {
                points: self.points,
                rounds: self.rounds,
                integrators: self
                    .integrators
                    .iter()
                    .map(|entry| IntegratorSteps {
                        integrator: entry.integrator,
                        one_step: entry.counts(time),
                        rollout: entry.counts(self.interval),
                    })
                    .collect(),
                differences: Vec::new(),
            };
            let steps = every * (states - 1);
            let initial = self.initial.clone();
            let request = RolloutOptions { steps, every, initial, plane: None };
            let name = format!("error against run time at flow time {time}: one step");
            let one_step = context.stage(&name, |_| options.one_step(&networks, &data, &points))?;
            let name = format!("error against run time at flow time {time}: trajectories");
            let long =
                context.stage(&name, |_| options.rollout(&networks, &request, &reference))?;
            let drifts = context.stage("drift of the invariants", |_| {
                trained.iter().map(|one| self.drift(one.model())).collect::<Result<Vec<_>, _>>()
            })?;
            let mut seeds = Vec::new();
            if context.scene.setup.flow_time == Some(time) {
                let states = &reference.trajectories;
                let along = (states.count(), request.request());
                for of in context.by_network()? {
                    seeds.extend(SeedErrors::new(&of, &points, states.values(), along)?);
                }
            }
            let paid = self.paid(context, &results, &trained, time)?;
            let rotation_error = data.rotation_error;
            let (flow_time, trajectories) = (time, long);
            let networks = trained.iter().zip(drifts).zip(paid);
            let networks = networks.map(|((one, drift), paid)| OfNetwork::new(one, drift, paid));
            let networks = networks.collect();
            let tables = tables.iter().map(MadeTable::cost).collect();
            results.push(AtTime {
                flow_time,
                rotation_error,
                networks,
                one_step,
                trajectories,
                seeds,
                tables,
            });
        }
        let found = Results { options: self, times: results };
        let mut figures = Vec::new();
        if context.draws(FIGURE) {
            figures.push(found.figure());
        }
        if context.draws(METHODS) {
            figures.push(found.methods_figure());
        }
        Ok(Findings {
            title: "Long steps".into(),
            results: Section {
                summary: [Block::Table(found.errors())].into_iter().chain(found.seeds()).collect(),
                details: vec![Block::Text(self.words(reference.error))],
                data: json!(found.times.iter().map(AtTime::data).collect::<Vec<_>>()),
            },
            timings: Section {
                summary: [
                    Block::Text(HOW.into()),
                    Block::Text(found.sentences()),
                    Block::Table(found.one_step()),
                    Block::Table(found.long()),
                ]
                .into_iter()
                .chain(found.gains_of_seeds().map(Block::Text))
                .collect(),
                details: found.all_rivals(),
                data: json!(found.times),
            },
            figures,
            ..Findings::default()
        })
    }
}

impl LongStepsOptions {
    /// The flow times at which networks are trained beside that of the scene.
    fn others(&self, setup: &Setup) -> impl Iterator<Item = f64> {
        let own = setup.flow_time;
        self.flow_times.iter().copied().filter(move |time| Some(*time) != own)
    }

    /// The trainings of this study at a flow time, one for each network.
    fn attempts(&self, setup: &Setup, time: f64) -> Vec<StudyTraining> {
        // A name is that of a file.
        let name_at = |model: &ModelSpec, time: f64| {
            format!("{}-at-{}", model.name, time.to_string().replace('.', "_"))
        };
        let before = self.flow_times.iter().copied().take_while(|earlier| *earlier != time).last();
        let before = before.filter(|_| self.ramp);
        let models = setup.models.iter().filter(|model| !model.training_only);
        models
            .map(|model| {
                let mut spec = model.clone();
                spec.seeds = None;
                spec.name = name_at(model, time);
                let from = before.map(|earlier| match Some(earlier) == setup.flow_time {
                    true => model.name.clone(),
                    false => name_at(model, earlier),
                });
                let training = SeededTraining { spec, network: model.name.clone(), number: 0 };
                StudyTraining { training, flow_time: time, from, fault: String::new() }
            })
            .collect()
    }

    /// All networks at a flow time.
    fn trained_at(
        &self,
        context: &mut Context<'_>,
        time: f64,
    ) -> Result<Vec<Rc<Trained>>, RunError> {
        let setup = context.scene.setup;
        if self.others(setup).all(|other| other != time) {
            return context.models();
        }
        let attempts = self.attempts(setup, time);
        let all: Result<Vec<_>, RunError> =
            attempts.iter().map(|training| self.train(context, training)).collect();
        without_lost(all?)
    }

    /// The tables of the map of a flow time, around its pairs; what made these makes those.
    fn tables_at(
        &self,
        context: &mut Context<'_>,
        data: &DataSets,
        time: f64,
    ) -> Result<Vec<MadeTable>, RunError> {
        if self.tables.is_empty() {
            return Ok(Vec::new());
        }
        let system = context.system()?;
        let declared = context.scene.setup.data.as_ref().and_then(|data| data.flow);
        let both = [Some(&data.training), data.held_out.as_ref()].into_iter().flatten();
        let points: Vec<f64> =
            both.flat_map(|pairs| [pairs.input(), pairs.output()].concat()).collect();
        let flow = |points: &[f64]| match declared {
            Some(flow) => flow.integrator.trajectories(system, points, time, flow.steps(time)?, 1),
            None => {
                Reference::calibrated(system, points, time)?.trajectories(system, points, time, 1)
            }
        };
        make(context, &self.tables, time, &points, &flow)
    }

    /// What each network cost before its first step at a flow time: seconds of pairs, and of training. Where the
    /// weights of one flow time start the next, those of all before count too.
    fn paid(
        &self,
        context: &Context<'_>,
        before: &[AtTime],
        trained: &[Rc<Trained>],
        time: f64,
    ) -> Result<Vec<[f64; 2]>, Error> {
        let epsilon = context.system()?.epsilon();
        let setup = context.scene.setup;
        let earlier = if self.ramp { before } else { &[] };
        let of = |one: &Rc<Trained>| {
            let stages = one.stages.iter().any(|stage| stage.time != 1.0);
            let ramp = &setup.training_of(&one.spec).ramp[..];
            let mut maps: Vec<(f64, f64)> = ramp[..if stages { ramp.len() } else { 0 }]
                .iter()
                .map(|stage| (stage.epsilon.unwrap_or(epsilon), stage.flow_time.unwrap_or(time)))
                .filter(|(_, stage)| *stage < time)
                .chain(earlier.iter().map(|at| (epsilon, at.flow_time)))
                .chain([(epsilon, time)])
                .collect();
            maps.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
            maps.dedup();
            let pairs = maps.iter().map(|&(epsilon, time)| context.seconds_of_pairs(epsilon, time));
            let own = context.training_times().iter().find(|times| times.model == one.spec.name);
            let own = own.and_then(|times| times.points.last()).map_or(0.0, |(_, s)| *s);
            let same = earlier.iter().flat_map(|at| &at.networks);
            let mut same = same.filter(|network| network.name == one.network);
            let start = same.next_back().map_or(0.0, |network| network.training_seconds);
            [pairs.sum(), own + start]
        };
        Ok(trained.iter().map(of).collect())
    }

    /// The largest change of the invariant of a network that owns an exact one, along its own
    /// trajectories.
    fn drift(&self, model: &Model) -> Result<Option<f64>, Error> {
        let integrable = model.architecture().keeps_actions();
        let (true, Some(own)) = (integrable, model.invariant()) else {
            return Ok(None);
        };
        let every = self.invariant_steps / KEPT;
        let request = Rollout { steps: every * KEPT, every };
        let dim = 2 * model.composition().dof();
        let states = model.rollout(&self.initial.concat(), request)?;
        let states = Trajectories::new(states, dim, self.initial.len())?;
        let changes = drifts(&states, own);
        Ok(Some(changes.iter().map(|d| d.largest).fold(0.0, max_or_nan)))
    }

    fn words(&self, reference_error: f64) -> String {
        format!(
            "Trajectories of time {} from {} points, compared with the reference at every {}; \
             its own error at the end is {reference_error:.1e}. All methods go with a trajectory \
             in each lane of the vector registers, on one thread. The drift of the own invariant \
             is its largest change over {} steps. {}",
            self.duration,
            self.initial.len(),
            self.interval,
            self.invariant_steps,
            match self.ramp {
                true =>
                    "Weights of one flow time are a start of the next, but for that of the scene.",
                false =>
                    "Each flow time begins with random weights, and with the ramp of its training \
                     where that leads up to it.",
            }
        )
    }
}

/// That of the scene, at any flow time.
fn network_name(trained: &Trained) -> &str {
    &trained.network
}

/// What was found at one flow time.
#[derive(Serialize)]
struct AtTime {
    flow_time: f64,
    /// The held-out mean squared error of the limiting rotation alone.
    rotation_error: Option<f64>,
    networks: Vec<OfNetwork>,
    one_step: Comparison,
    trajectories: Comparison,
    /// Of networks with several initial weights, at the flow time of the scene.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    seeds: Vec<SeedErrors>,
    tables: Vec<TableCost>,
}

/// A network at one flow time.
#[derive(Serialize)]
struct OfNetwork {
    name: String,
    parameters: usize,
    /// The held-out mean squared error.
    error: Option<f64>,
    iterations: u64,
    stages: Vec<StageResult>,
    drift: Option<f64>,
    /// Of the pairs that it was trained on, and of its training, with all that led up to it.
    pairs_seconds: f64,
    training_seconds: f64,
}

impl OfNetwork {
    fn new(
        trained: &Trained,
        drift: Option<f64>,
        [pairs_seconds, training_seconds]: [f64; 2],
    ) -> Self {
        Self {
            name: trained.network.clone(),
            parameters: trained.model().composition().parameters().len(),
            error: trained.held_out_error,
            iterations: trained.outcome.history.last().map_or(0, |record| record.iteration),
            stages: trained.stages.clone(),
            drift,
            pairs_seconds,
            training_seconds,
        }
    }

    /// Seconds before its first step.
    fn paid(&self) -> f64 {
        self.pairs_seconds + self.training_seconds
    }
}

impl AtTime {
    /// What does not depend on the machine.
    fn data(&self) -> serde_json::Value {
        let networks: Vec<_> = self
            .networks
            .iter()
            .map(|network| {
                json!({
                    "name": network.name,
                    "parameters": network.parameters,
                    "error": network.error,
                    "iterations": network.iterations,
                    "stages": network.stages,
                    "drift": network.drift,
                })
            })
            .collect();
        let mut data = json!({
            "flow_time": self.flow_time,
            "rotation_error": self.rotation_error,
            "networks": networks,
            "one_step": self.one_step.without_seconds(),
            "trajectories": self.trajectories.without_seconds(),
        });
        if !self.seeds.is_empty() {
            data["seeds"] = json!(self.seeds);
        }
        data
    }
}

/// A network beside the integrators that err no more.
struct Against<'a> {
    comparison: &'a Comparison,
    error: f64,
    seconds: f64,
    alone: Option<f64>,
    best: Option<AtError<'a>>,
}

impl<'a> Against<'a> {
    /// None where it has lost the points.
    fn new(comparison: &'a Comparison, network: &str) -> Option<Self> {
        // Integrators are tried with so many steps each, networks are not.
        let network = |method: &&WorkPrecision| method.setting.is_none() && method.name == network;
        let of = comparison.methods.iter().find(network)?;
        let error = of.error.filter(|error| *error <= comparison.lost())?;
        let best = AtError::fastest(&comparison.methods, error);
        let alone = of.alone.map(|spread| spread.median);
        Some(Self { comparison, error, seconds: of.seconds?.median, alone, best })
    }

    /// How many times as long the fastest integrator takes.
    fn gain(&self) -> Option<f64> {
        self.best.map(|best| best.seconds / self.seconds)
    }

    /// The same of one trajectory alone, of an integrator.
    fn gain_alone(&self, rival: AtError<'_>) -> Option<f64> {
        Some(rival.alone? / self.alone?)
    }

    /// How many steps of a flow time pay for what was paid before, where each is faster than those of a rival.
    /// What a table cost is paid on the other side.
    fn pays_after(&self, rival: AtError<'_>, paid: f64, at: &AtTime) -> Option<f64> {
        let paid = (paid - TableCost::seconds_of(&at.tables, rival.method)).max(0.0);
        break_even(paid, self.seconds * at.flow_time, rival.seconds * at.flow_time)
    }

    /// Every integrator, where its curve comes to the error of the network.
    fn rivals(&self) -> Vec<(&'a str, Option<AtError<'a>>)> {
        let methods = &self.comparison.methods;
        let mut out: Vec<(&str, Option<AtError<'_>>)> = Vec::new();
        for method in methods.iter().filter(|method| method.setting.is_some()) {
            if out.iter().all(|(name, _)| *name != method.name) {
                out.push((&method.name, AtError::of_curve(methods, &method.name, self.error)));
            }
        }
        out.sort_by(|a, b| {
            let seconds = |at: Option<AtError<'_>>| at.map_or(f64::INFINITY, |at| at.seconds);
            seconds(a.1).total_cmp(&seconds(b.1))
        });
        out
    }
}

struct Results<'a> {
    options: &'a LongStepsOptions,
    times: Vec<AtTime>,
}

const MICRO: f64 = 1e6;

impl Results<'_> {
    fn errors(&self) -> Table {
        let mut table = Table::new([
            ("flow time", Format::Exact),
            ("network", Format::Exact),
            ("parameters", Format::Exact),
            ("held-out MSE", Format::Exponent(2)),
            ("share of the motion beyond the rotation", Format::Percent),
            ("distance over the trajectories, rms", Format::Exponent(2)),
            ("drift of the own invariant", Format::Exponent(1)),
        ]);
        for at in &self.times {
            for network in &at.networks {
                let share = || Some((network.error? / at.rotation_error?).sqrt());
                let named = |method: &&WorkPrecision| method.name == network.name;
                let long = at.trajectories.methods.iter().find(named);
                table.push([
                    at.flow_time.into(),
                    format!("`{}`", network.name).into(),
                    network.parameters.into(),
                    network.error.into(),
                    share().into(),
                    long.and_then(|method| method.error).into(),
                    network.drift.into(),
                ]);
            }
        }
        table
    }

    fn comparison(&self, of: &dyn Fn(&AtTime) -> &Comparison, what: &str) -> Table {
        let mut table = Table::new([
            (format!("{what}: flow time"), Format::Exact),
            ("network".into(), Format::Exact),
            ("error".into(), Format::Exponent(2)),
            ("µs for unit time".into(), Format::Significant),
            ("a rival no less accurate".into(), Format::Exact),
            ("its µs".into(), Format::Significant),
            ("the network is faster by".into(), Format::Factor),
            ("one alone by".into(), Format::Factor),
            ("seconds of pairs and training".into(), Format::Fixed(0)),
            ("steps that pay for them".into(), Format::Significant),
        ]);
        for at in &self.times {
            for network in &at.networks {
                let comparison = of(at);
                let against = Against::new(comparison, &network.name);
                let against = against.as_ref();
                let best = against.and_then(|against| against.best);
                let both = against.zip(best);
                table.push([
                    at.flow_time.into(),
                    format!("`{}`", network.name).into(),
                    against.map(|against| against.error).into(),
                    against.map(|against| against.seconds * MICRO).into(),
                    match (against, best) {
                        (None, _) => "it has lost the points".into(),
                        (Some(_), None) => "none that was tried".into(),
                        (Some(_), Some(best)) => named(best.method).into(),
                    },
                    best.map(|best| best.seconds * MICRO).into(),
                    against.and_then(Against::gain).into(),
                    both.and_then(|(against, best)| against.gain_alone(best)).into(),
                    network.paid().into(),
                    both.and_then(|(against, best)| against.pays_after(best, network.paid(), at))
                        .into(),
                ]);
            }
        }
        table
    }

    /// Every integrator at the error of each network.
    fn all_rivals(&self) -> Vec<Block> {
        let mut out = Vec::new();
        type Of = fn(&AtTime) -> &Comparison;
        let both: [(&str, Of); 2] =
            [("one step", |at| &at.one_step), ("trajectories", |at| &at.trajectories)];
        for at in &self.times {
            out.extend(TableCost::words(&at.tables));
            for (what, of) in both {
                for network in &at.networks {
                    let Some(against) = Against::new(of(at), &network.name) else { continue };
                    let mut table = Table::new([
                        ("rival", Format::Exact),
                        ("steps or nodes", Format::Setting),
                        ("µs for unit time", Format::Significant),
                        ("one alone", Format::Significant),
                        ("the network is faster by", Format::Factor),
                        ("one alone by", Format::Factor),
                        ("steps that pay for pairs and training", Format::Significant),
                        ("its least error, where it is larger", Format::Exponent(2)),
                    ]);
                    for (name, found) in against.rivals() {
                        let least = || {
                            let named = against.comparison.methods.iter();
                            let errors = named.filter(|m| m.name == name).filter_map(|m| m.error);
                            errors.min_by(f64::total_cmp)
                        };
                        table.push([
                            name.into(),
                            found.and_then(|found| found.method.setting).into(),
                            found.map(|found| found.seconds * MICRO).into(),
                            found.and_then(|found| Some(found.alone? * MICRO)).into(),
                            found.map(|found| found.seconds / against.seconds).into(),
                            found.and_then(|found| against.gain_alone(found)).into(),
                            found
                                .and_then(|found| against.pays_after(found, network.paid(), at))
                                .into(),
                            if found.is_some() { None } else { least() }.into(),
                        ]);
                    }
                    if table.is_empty() {
                        continue;
                    }
                    out.push(Block::Heading(format!(
                        "Flow time {}, {what}: rivals at the error of `{}`, {:.2e}",
                        at.flow_time, network.name, against.error
                    )));
                    out.push(Block::Text(format!(
                        "`{}` takes {} µs for unit time, {} one alone; {} s of pairs and {} s of training came \
                         before.",
                        network.name,
                        Format::Significant.number(against.seconds * MICRO),
                        against
                            .alone
                            .map_or("?".into(), |alone| Format::Significant.number(alone * MICRO)),
                        Format::Fixed(1).number(network.pairs_seconds),
                        Format::Fixed(1).number(network.training_seconds),
                    )));
                    out.push(Block::Table(table));
                }
            }
        }
        out
    }

    /// Errors from other initial weights, where there are some.
    fn seeds(&self) -> Option<Block> {
        let of_time = |at: &AtTime| [at.one_step.lost(), at.trajectories.lost()];
        let all: Vec<(&SeedErrors, [f64; 2])> = self
            .times
            .iter()
            .flat_map(|at| at.seeds.iter().map(move |seeds| (seeds, of_time(at))))
            .collect();
        let long = format!("time {}", self.options.duration);
        let time = self.times.iter().find(|at| !at.seeds.is_empty())?.flow_time;
        let one = format!("one step of {time}");
        Some(Block::Table(SeedErrors::table(&all, [&one, &long])))
    }

    /// What they leave of the gains.
    fn gains_of_seeds(&self) -> Option<String> {
        let mut out = String::new();
        for at in &self.times {
            for of in &at.seeds {
                for (what, errors, comparison) in [
                    ("for one step", &of.one_step, &at.one_step),
                    ("over trajectories", &of.trajectories, &at.trajectories),
                ] {
                    let Some(gains) = SeedGains::new(errors, &of.network, comparison) else {
                        continue;
                    };
                    out.push_str(&format!(
                        "- `{}` at flow time {}, trained from {} initial weights, {what}: {}.\n",
                        of.network,
                        at.flow_time,
                        errors.len(),
                        gains.words(),
                    ));
                }
            }
        }
        (!out.is_empty()).then_some(out)
    }

    fn one_step(&self) -> Table {
        self.comparison(&|at| &at.one_step, "one step")
    }

    fn long(&self) -> Table {
        self.comparison(&|at| &at.trajectories, &format!("time {}", self.options.duration))
    }

    /// Where each network overtakes the integrators, and by how much.
    fn sentences(&self) -> String {
        let mut out = String::new();
        let names = self.times.first().map_or(&[][..], |at| &at.networks[..]);
        type Of = fn(&AtTime) -> &Comparison;
        let both: [(&str, Of); 2] =
            [("for one step", |at| &at.one_step), ("over trajectories", |at| &at.trajectories)];
        for network in names {
            for (what, of) in both {
                // None where it has lost the points; a gain of None is one over all integrators.
                let judged: Vec<(f64, Option<Option<f64>>)> = self
                    .times
                    .iter()
                    .map(|at| {
                        let against = Against::new(of(at), &network.name);
                        (at.flow_time, against.map(|against| against.gain()))
                    })
                    .collect();
                let wins = |(_, gain): &&(f64, Option<Option<f64>>)| {
                    gain.is_some_and(|gain| gain.is_none_or(|gain| gain > 1.0))
                };
                let winning: Vec<String> =
                    judged.iter().filter(wins).map(|(time, _)| time.to_string()).collect();
                let gains: Vec<(f64, Option<f64>)> =
                    judged.iter().filter_map(|(time, gain)| Some((*time, (*gain)?))).collect();
                let largest = gains
                    .iter()
                    .filter_map(|(time, gain)| Some((*time, (*gain)?)))
                    .max_by(|a, b| a.1.total_cmp(&b.1));
                let words = match (gains.is_empty(), &winning[..], largest) {
                    (true, ..) => "has lost the points at every flow time".to_owned(),
                    (_, [], Some((time, gain))) => format!(
                        "is slower than the fastest rival that errs no more at every flow \
                         time: by {} at {time}, where it comes nearest",
                        Format::Factor.number(1.0 / gain)
                    ),
                    (_, times, Some((time, gain))) => format!(
                        "overtakes the fastest rival that errs no more at flow times {}, by up to {} at \
                         {time}",
                        times.join(", "),
                        Format::Factor.number(gain)
                    ),
                    (_, _, None) => "errs less than every rival tried".to_owned(),
                };
                out.push_str(&format!("- `{}` {words} ({what}).\n", network.name));
            }
        }
        out
    }

    /// Error against run time, a curve for each method; the networks of all flow times over trajectories, of the last
    /// in one step.
    fn methods_figure(&self) -> Figure {
        let Some(last) = self.times.last() else {
            return Figure::in_a_row(METHODS, "", Vec::new());
        };
        let panel = |title: String, methods: &[WorkPrecision]| Panel {
            title,
            y_label: "rms distance from the reference".into(),
            ..work_precision_panel("µs for unit time", methods, MICRO)
        };
        let is_network = |method: &&WorkPrecision| method.setting.is_none();
        // What has lost the points altogether would make all other curves flat.
        let drawn = |methods: Vec<&WorkPrecision>, lost: f64| -> Vec<WorkPrecision> {
            let near = |method: &&&WorkPrecision| method.error.is_none_or(|e| e <= 4.0 * lost);
            methods.iter().filter(near).copied().cloned().collect()
        };
        let long: Vec<&WorkPrecision> = self
            .times
            .iter()
            .flat_map(|at| at.trajectories.methods.iter().filter(is_network))
            .chain(last.trajectories.methods.iter().filter(|method| !is_network(method)))
            .collect();
        let long = drawn(long, last.trajectories.lost());
        let one_step = drawn(last.one_step.methods.iter().collect(), last.one_step.lost());
        Figure::in_a_row(
            METHODS,
            "Error against run time on this machine, one thread, trajectories together: a point for each number of \
             steps or nodes, and for each flow time of a network over the trajectories; lines from quartile to quartile. Lower \
             and further left is better. What is further off than twice the size of the points is not drawn.",
            vec![
                panel(format!("one step of time {}", last.flow_time), &one_step),
                panel(format!("trajectories of time {}", self.options.duration), &long),
            ],
        )
    }

    fn figure(&self) -> Figure {
        let names: Vec<&str> = self
            .times
            .first()
            .map_or(Vec::new(), |at| at.networks.iter().map(|n| &n.name[..]).collect());
        let series = |of: &dyn Fn(&AtTime, &str) -> Option<f64>| -> Vec<Series> {
            names
                .iter()
                .enumerate()
                .map(|(color, name)| Series {
                    name: (*name).to_owned(),
                    color,
                    style: Style::Marked,
                    points: self
                        .times
                        .iter()
                        .filter_map(|at| Some((at.flow_time, of(at, name)?)))
                        .collect(),
                })
                .collect()
        };
        let panel = |title: &str, y_label: &str, series| Panel {
            title: title.into(),
            x_label: "flow time".into(),
            y_label: y_label.into(),
            x: Axis::Log,
            y: Axis::Log,
            series,
            ..Panel::default()
        };
        let errors = series(&|at, name| {
            let network = at.networks.iter().find(|network| network.name == name)?;
            network.error.map(f64::sqrt)
        });
        let gains = |of: fn(&AtTime) -> &Comparison| {
            let mut all = series(&|at, name| Against::new(of(at), name)?.gain());
            let even = self.times.iter().map(|at| (at.flow_time, 1.0)).collect();
            all.insert(0, Series::unnamed(names.len(), Style::Dashed, even));
            all
        };
        Figure::in_a_row(
            FIGURE,
            "Left: the root of the held-out mean squared error of each network against its flow time. Middle and \
             right: how many times as long the fastest rival takes that errs no more, for one step and over \
             long trajectories; above the dashed line the network wins. What has lost the \
             points, or errs less than every rival tried, has no mark.",
            vec![
                panel("error of a step", "rms of a component", errors),
                panel("one step", "faster than rivals by", gains(|at| &at.one_step)),
                panel(
                    &format!("time {}", self.options.duration),
                    "faster than rivals by",
                    gains(|at| &at.trajectories),
                ),
            ],
        )
    }
}
