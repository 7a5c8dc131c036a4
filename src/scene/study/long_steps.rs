//! Maps of several flow times beside integrators: where a surrogate overtakes them.

use super::long_steps_results::{AtTime, FIGURE, METHODS, OfNetwork, Results};
use super::rollout::RolloutOptions;
use super::seed_errors::SeedErrors;
use super::shared::Study;
use super::step_tables::{MadeTable, TableSizes, citations_of, make};
use super::work_precision::{
    HOW, IntegratorSteps, MOST_ROUNDS, Networks, Points, WorkPrecisionOptions, citations,
};
use crate::error::Error;
use crate::flow::{Integrator, Reference, Trajectories};
use crate::measure::trajectories::drifts;
use crate::network::{Model, Rollout};
use crate::scalar::max_or_nan;
use crate::scene::context::{Context, RunError};
use crate::scene::data_sets::DataSets;
use crate::scene::declared::Declared;
use crate::scene::findings::{Block, Findings, Section};
use crate::scene::learning::without_lost;
use crate::scene::setup::{
    MOST, ModelSpec, Need, SeededTraining, Setup, StudyTraining, check_points,
};
use crate::scene::target_flow::TargetFlow;
use crate::scene::trained::Trained;
use crate::system::{Hamiltonian, NearlyPeriodic};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::rc::Rc;

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
        self.others(setup).flat_map(|time| self.trainings_at(setup, time)).collect()
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
        let closed = self.integrators.iter().map(|entry| entry.integrator);
        let closed = closed.filter(|by| by.is_closed_average()).map(Integrator::name).collect();
        let found = Results { duration: self.duration, closed, times: results };
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
                .chain(found.gains_of_seeds())
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
    fn trainings_at(&self, setup: &Setup, time: f64) -> Vec<StudyTraining> {
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
        let trainings = self.trainings_at(setup, time);
        let all: Result<Vec<_>, RunError> =
            trainings.iter().map(|training| self.train(context, training)).collect();
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
