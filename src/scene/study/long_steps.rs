//! Maps of several flow times beside integrators: where a surrogate overtakes them.

use super::rollout::RolloutOptions;
use super::shared::Study;
use super::work_precision::{
    IntegratorSteps, MOST_ROUNDS, Networks, Points, TOGETHER, WorkPrecisionOptions, citations,
};
use crate::error::Error;
use crate::flow::{Integrator, Trajectories};
use crate::measure::{
    timing::{Comparison, Spread, WorkPrecision, fastest},
    trajectories::drifts,
};
use crate::network::{Model, Rollout};
use crate::scalar::max_or_nan;
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Axis, Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::learning::learn_at;
use crate::scene::setup::{MOST, ModelSpec, Need, SeededTraining, Setup, check_points};
use crate::scene::target_flow::TargetFlow;
use crate::scene::trained::Trained;
use crate::system::NearlyPeriodic;
use crate::train::StageResult;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::rc::Rc;

const FIGURE: &str = "long-steps";

/// States along which an exact invariant is looked at.
const KEPT: usize = 100;

/// Maps of several flow times beside integrators.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LongStepsOptions {
    /// The flow times, ascending. At that of the scene its networks are taken as they are
    /// trained; at others they are trained as there.
    pub flow_times: Vec<f64>,
    /// Whether the weights of the flow time before are the first start of the next, in place of
    /// random ones and of what the ramp of their training and its fresh twists lead to.
    #[serde(default)]
    pub ramp: bool,
    /// The length of the trajectories.
    pub duration: f64,
    /// The time between two of their states that are compared with the reference.
    pub interval: f64,
    /// Their initial points.
    pub initial: Vec<Vec<f64>>,
    /// One step is judged at so many held-out pairs.
    pub points: usize,
    /// How often each time is taken.
    pub rounds: usize,
    /// Iterations of networks with an exact invariant, along which it is followed.
    pub invariant_steps: usize,
    /// What the networks are compared with.
    pub integrators: Vec<IntegratorStepSizes>,
}

/// An integrator with the steps it is tried with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IntegratorStepSizes {
    /// Which.
    pub integrator: Integrator,
    /// Its steps, as times: as many of each as come nearest to a flow time, and one at
    /// least.
    pub steps: Vec<f64>,
}

impl IntegratorStepSizes {
    /// Numbers of steps in a time, each once.
    fn counts(&self, time: f64) -> Vec<usize> {
        let mut out: Vec<usize> =
            self.steps.iter().map(|step| ((time / step).round() as usize).max(1)).collect();
        out.sort_unstable();
        out.dedup();
        out
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
            Error::check_count_range("integrators.steps", entry.steps.len(), 1, MOST)?;
            // As many steps at most as any count of a scene may be.
            let shortest = self.interval / MOST as f64;
            for step in &entry.steps {
                Error::check_range("integrators.steps", *step, shortest, f64::MAX)?;
            }
        }
        match &scene.setup.system {
            Some(system) => check_points("initial", &self.initial, system),
            None => Ok(()),
        }
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![FIGURE]
    }

    fn cites(&self, _: &Declared<'_>) -> Vec<&'static str> {
        citations(self.integrators.iter().map(|entry| entry.integrator))
    }

    /// A study of every other flow time and step of an integrator, timed less often.
    fn shorten(&mut self) {
        // The longest is among them.
        self.flow_times = self.flow_times.iter().rev().step_by(2).rev().copied().collect();
        for entry in &mut self.integrators {
            entry.steps = entry.steps.iter().step_by(2).copied().collect();
        }
        self.rounds = self.rounds.min(3);
        self.invariant_steps = self.invariant_steps.min(100_000);
    }

    fn trainings(&self, setup: &Setup) -> Vec<SeededTraining> {
        self.others(setup).flat_map(|time| self.attempts(setup, time)).collect()
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let system = context.system()?;
        let states = whole_steps("duration", self.duration, self.interval)? + 1;
        let reference = context.reference(system, &self.initial, self.interval, states)?;
        let mut results = Vec::new();
        let mut before: Option<(Vec<Rc<Trained>>, f64)> = None;
        for &time in &self.flow_times {
            let trained = self.trained_at(context, time, before.as_ref())?;
            let data = context.data_at(system.epsilon(), time)?;
            let points = Points::evenly(data.to_judge_by(), self.points);
            let models = trained.iter().map(|one| (network_name(one), one.model())).collect();
            let networks = Networks { models, target: TargetFlow::System(system), time };
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
            let rotation = data.rotation_error;
            results.push(AtTime::new(time, rotation, &trained, one_step, long, drifts, context));
            before = Some((trained, time));
        }
        let found = Results { options: self, times: results };
        let figures = match context.draws(FIGURE) {
            true => vec![found.figure()],
            false => Vec::new(),
        };
        Ok(Findings {
            title: "Long steps".into(),
            results: Section {
                summary: vec![Block::Table(found.errors())],
                details: vec![Block::Text(self.words(reference.error))],
                data: json!(found.times.iter().map(AtTime::data).collect::<Vec<_>>()),
            },
            timings: Section {
                summary: vec![
                    Block::Text(found.sentences()),
                    Block::Table(found.one_step()),
                    Block::Table(found.long()),
                ],
                details: Vec::new(),
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

    /// The trainings of this study, for each flow time and network.
    fn attempts(&self, setup: &Setup, time: f64) -> Vec<SeededTraining> {
        let models = setup.models.iter().filter(|model| !model.training_only);
        models
            .map(|model| {
                let mut spec = model.clone();
                spec.seeds = None;
                // A name is that of a file.
                spec.name = format!("{}-at-{}", model.name, time.to_string().replace('.', "_"));
                SeededTraining { spec, network: model.name.clone(), number: 0 }
            })
            .collect()
    }

    /// All networks at a flow time.
    fn trained_at(
        &self,
        context: &mut Context<'_>,
        time: f64,
        before: Option<&(Vec<Rc<Trained>>, f64)>,
    ) -> Result<Vec<Rc<Trained>>, RunError> {
        let setup = context.scene.setup;
        if self.others(setup).all(|other| other != time) {
            return context.models();
        }
        let data = context.data_at(context.system()?.epsilon(), time)?;
        let mut out = Vec::new();
        for (number, attempt) in self.attempts(setup, time).into_iter().enumerate() {
            let from = before.filter(|_| self.ramp);
            let from = from.map(|(trained, earlier)| (trained[number].model(), *earlier));
            let name = format!("training {}", attempt.spec.name);
            let trained =
                context.stage(&name, |context| learn_at(context, &data, attempt, time, from))?;
            out.push(Rc::new(trained));
        }
        Ok(out)
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
    seconds: Option<f64>,
    drift: Option<f64>,
}

impl AtTime {
    fn new(
        flow_time: f64,
        rotation_error: Option<f64>,
        trained: &[Rc<Trained>],
        one_step: Comparison,
        trajectories: Comparison,
        drifts: Vec<Option<f64>>,
        context: &Context<'_>,
    ) -> Self {
        let networks = trained.iter().zip(drifts).map(|(one, drift)| {
            let times = context.training_times().iter().find(|t| t.model == one.spec.name);
            OfNetwork {
                name: one.network.clone(),
                parameters: one.model().composition().parameters().len(),
                error: one.held_out_error,
                iterations: one.outcome.history.last().map_or(0, |record| record.iteration),
                stages: one.stages.clone(),
                seconds: times.and_then(|times| Some(times.points.last()?.1)),
                drift,
            }
        });
        Self { flow_time, rotation_error, networks: networks.collect(), one_step, trajectories }
    }

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
        json!({
            "flow_time": self.flow_time,
            "rotation_error": self.rotation_error,
            "networks": networks,
            "one_step": self.one_step.without_seconds(),
            "trajectories": self.trajectories.without_seconds(),
        })
    }
}

/// A network beside the fastest integrator that errs no more.
struct Against<'a> {
    of: &'a WorkPrecision,
    seconds: Spread,
    best: Option<(&'a WorkPrecision, f64)>,
}

impl<'a> Against<'a> {
    fn new(comparison: &'a Comparison, network: &str) -> Option<Self> {
        let name = format!("{network}, {TOGETHER}");
        let of = comparison.methods.iter().find(|method| method.name == name)?;
        let error = of.error.filter(|error| *error <= comparison.lost())?;
        // Integrators are tried with so many steps each, networks are not.
        let integrators = comparison.methods.iter().filter(|method| method.setting.is_some());
        Some(Self { of, seconds: of.seconds?, best: fastest(integrators, error) })
    }

    /// How many times as long the integrator takes.
    fn gain(&self) -> Option<f64> {
        self.best.map(|(_, seconds)| seconds / self.seconds.median)
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
                let name = format!("{}, {TOGETHER}", network.name);
                let long = at.trajectories.methods.iter().find(|method| method.name == name);
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
            ("seconds of training".into(), Format::Fixed(0)),
            ("error".into(), Format::Exponent(2)),
            ("µs for unit time".into(), Format::Magnitude),
            ("an integrator no less accurate".into(), Format::Exact),
            ("its µs".into(), Format::Magnitude),
            ("the network is faster by".into(), Format::Factor),
        ]);
        for at in &self.times {
            for network in &at.networks {
                let comparison = of(at);
                let against = Against::new(comparison, &network.name);
                let best = against.as_ref().and_then(|against| against.best);
                let integrator = best.map(|(method, _)| {
                    format!("{}, {} steps", method.name, method.setting.unwrap_or(f64::NAN))
                });
                table.push([
                    at.flow_time.into(),
                    format!("`{}`", network.name).into(),
                    network.seconds.into(),
                    against.as_ref().and_then(|against| against.of.error).into(),
                    against.as_ref().map(|a| a.seconds.scaled(MICRO).median).into(),
                    match (&against, integrator) {
                        (None, _) => "it has lost the points".into(),
                        (Some(_), None) => "none tried".into(),
                        (Some(_), Some(name)) => name.into(),
                    },
                    best.map(|(_, seconds)| seconds * MICRO).into(),
                    against.as_ref().and_then(Against::gain).into(),
                ]);
            }
        }
        table
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
                        "is slower than the fastest integrator that errs no more at every flow \
                         time: by {} at {time}, where it comes nearest",
                        Format::Factor.number(1.0 / gain)
                    ),
                    (_, times, Some((time, gain))) => format!(
                        "overtakes the fastest integrator that errs no more at flow times {}, by up to {} at \
                         {time}",
                        times.join(", "),
                        Format::Factor.number(gain)
                    ),
                    (_, _, None) => "errs less than every integrator tried".to_owned(),
                };
                out.push_str(&format!("- `{}` {words} ({what}).\n", network.name));
            }
        }
        out
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
             right: how many times as long the fastest integrator takes that errs no more, for one step and over \
             long trajectories; above the dashed line the network wins. What has lost the \
             points, or errs less than every integrator tried, has no mark.",
            vec![
                panel("error of a step", "rms of a component", errors),
                panel("one step", "faster than integrators by", gains(|at| &at.one_step)),
                panel(
                    &format!("time {}", self.options.duration),
                    "faster than integrators by",
                    gains(|at| &at.trajectories),
                ),
            ],
        )
    }
}
