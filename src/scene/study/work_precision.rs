//! Error against run time: the networks beside integrators, for one step and for the
//! roll-out, and three methods to get the networks' Jacobians.

use super::rollout::RolloutOptions;
use super::shared::Study;
use super::step_tables::MadeTable;
use crate::error::Error;
use crate::flow::{Integrator, Pairs, ReferenceTrajectories};
use crate::measure::{
    jacobians_by_differences,
    timing::{
        AtError, Comparison, Method, Spread, TrajectoryMethods, WorkPrecision, most_accurate,
        precise_jacobians, relative_difference, work_precision,
    },
};
use crate::network::{
    Composition, Model, Rollout, map_jacobians, map_jacobians_by_duals, map_points,
};
use crate::phase::Direction;
use crate::scene::bibliography::GAUSS_LEGENDRE;
use crate::scene::context::{Context, RunError};
use crate::scene::data_sets::DataSets;
use crate::scene::declared::Declared;
use crate::scene::figure::{Axis, Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Cell, Findings, Format, Section, Table};
use crate::scene::setup::{MOST, Need};
use crate::scene::target_flow::TargetFlow;
use crate::system::System;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::fmt::Write;

const TRAJECTORIES: &str = "error-against-time";
const JACOBIANS: &str = "jacobians";

/// More rounds than this are taken for a mistake.
pub(super) const MOST_ROUNDS: usize = 10_000;

/// Error against run time: networks beside integrators, for one step and for the roll-out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorkPrecisionOptions {
    /// The number of evenly spaced held-out pairs (training pairs, if none are held out) on which
    /// one step is judged.
    pub points: usize,
    /// How often each time is taken.
    pub rounds: usize,
    /// What the networks are compared with.
    #[serde(default)]
    pub integrators: Vec<IntegratorSteps>,
    /// The steps h of the central differences that the networks' Jacobians are compared with; if
    /// empty, no Jacobian is computed.
    #[serde(default)]
    pub differences: Vec<f64>,
}

/// An integrator with the numbers of steps it is tried with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IntegratorSteps {
    /// The integrator that the networks are compared with.
    pub integrator: Integrator,
    /// The numbers of steps in the flow time.
    #[serde(default)]
    pub one_step: Vec<usize>,
    /// The numbers of steps between two states that the roll-out keeps.
    #[serde(default)]
    pub rollout: Vec<usize>,
}

impl Study for WorkPrecisionOptions {
    fn name(&self) -> &'static str {
        "work_precision"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::TargetFlow, Need::FlowTime, Need::Data]
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        let rollout = RolloutOptions::of(scene);
        Error::check_count_range("points", self.points, 1, MOST)?;
        Error::check_count_range("rounds", self.rounds, 1, MOST_ROUNDS)?;
        let target = scene.setup.target();
        if let (Some(TargetFlow::File(_) | TargetFlow::Lines(_)), Some(entry)) =
            (target, self.integrators.first())
        {
            let expected = "none beside pairs of a file or field lines of coils";
            return Err(Error::invalid("integrators", entry.integrator.name(), expected));
        }
        for entry in &self.integrators {
            match &scene.setup.system {
                Some(system) => entry.integrator.check_for(system)?,
                None => entry.integrator.check()?,
            }
            for &steps in entry.one_step.iter().chain(&entry.rollout) {
                Error::check_count_range("integrators.steps", steps, 1, MOST)?;
            }
            if !entry.rollout.is_empty() && rollout.is_none() {
                let name = entry.integrator.name();
                return Err(Error::invalid("integrators.rollout", name, "a scene with a roll-out"));
            }
        }
        if let Some(bad) = self.differences.iter().find(|h| !(**h > 0.0 && h.is_finite())) {
            return Err(Error::invalid("differences", bad, "positive numbers"));
        }
        match rollout {
            Some(rollout) if rollout.every > rollout.steps => {
                let expected = format!("at most {} steps, for a state to compare", rollout.steps);
                Err(Error::invalid("rollout.every", rollout.every, expected))
            }
            _ => Ok(()),
        }
    }

    fn figures(&self, scene: &Declared<'_>) -> Vec<&'static str> {
        match self.differences.is_empty() || scene.setup.models.is_empty() {
            true => vec![TRAJECTORIES],
            false => vec![TRAJECTORIES, JACOBIANS],
        }
    }

    fn cites(&self, _: &Declared<'_>) -> Vec<&'static str> {
        citations(self.integrators.iter().map(|entry| entry.integrator))
    }

    fn shorten(&mut self) {
        self.rounds = self.rounds.min(5);
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let trained = match context.scene.setup.models.is_empty() {
            true => None,
            false => Some(context.models()?),
        };
        let networks = Networks {
            models: trained
                .iter()
                .flat_map(|all| all.iter())
                .map(|one| (&one.spec.name[..], one.model()))
                .collect(),
            target: context.target()?,
            time: context.flow_time()?,
            tables: &[],
        };
        let data = context.data()?;
        let epsilon = networks.target.epsilon();
        let judge = data.of_own_map(epsilon).ok_or_else(|| {
            let found = format!("none of ε = {epsilon} and flow time {}", networks.time);
            Error::invalid("pairs to judge by", found, "some of the networks' own map")
        })?;
        let points = Points::evenly(&judge, self.points);
        let comparisons = Comparisons {
            one_step: context.stage("error against run time: one step", |_| {
                self.one_step(&networks, &data, &points)
            })?,
            rollout: match RolloutOptions::of(context.scene) {
                None => None,
                Some(options) => {
                    let reference = options.reference(context)?;
                    let name = "error against run time: roll-out";
                    Some(context.stage(name, |_| self.rollout(&networks, options, &reference))?)
                }
            },
            jacobians: match self.differences.is_empty() {
                true => Vec::new(),
                false => context.stage("error against run time: Jacobians", |_| {
                    let models = networks.models.iter();
                    models
                        .map(|(name, model)| self.jacobians(name, model, &points.input))
                        .collect::<Result<_, Error>>()
                })?,
            },
        };
        let mut figures = Vec::new();
        if context.draws(TRAJECTORIES) {
            figures.push(comparisons.trajectory_figure());
        }
        if context.draws(JACOBIANS) {
            figures.push(comparisons.jacobian_figure());
        }
        Ok(Findings {
            title: "Error against run time".into(),
            results: Section { data: json!(comparisons.without_seconds()), ..Section::default() },
            timings: Section {
                summary: comparisons.words(),
                details: comparisons.tables(),
                data: json!(comparisons),
            },
            figures,
            ..Findings::default()
        })
    }
}

/// BibTeX entries of the reference and of integrators.
pub(super) fn citations(integrators: impl Iterator<Item = Integrator>) -> Vec<&'static str> {
    let mut out = vec![GAUSS_LEGENDRE];
    out.extend(integrators.filter_map(Integrator::bibtex));
    out
}

/// What is compared with integrators.
pub(super) struct Networks<'a> {
    pub(super) models: Vec<(&'a str, &'a Model)>,
    pub(in crate::scene) target: TargetFlow<'a>,
    pub(super) time: f64,
    pub(super) tables: &'a [MadeTable],
}

/// Evenly chosen pairs: their inputs and outputs, 2n numbers each.
pub(super) struct Points {
    input: Vec<f64>,
    output: Vec<f64>,
}

impl Points {
    /// At most `most` rows, evenly spaced.
    pub(super) fn evenly(pairs: &Pairs, most: usize) -> Self {
        let (dim, len) = (2 * pairs.dof(), pairs.len());
        let count = len.min(most);
        let chosen = |rows: &[f64]| {
            let row = |k: usize| &rows[k * len / count * dim..][..dim];
            (0..count).flat_map(row).copied().collect()
        };
        Self { input: chosen(pairs.input()), output: chosen(pairs.output()) }
    }

    pub(super) fn input(&self) -> &[f64] {
        &self.input
    }

    pub(super) fn output(&self) -> &[f64] {
        &self.output
    }
}

/// The name of the method that computes Jacobians by dual numbers.
const DUALS: &str = "duals";
const BY_HAND: &str = "chain rule by hand";
const DIFFERENCES: &str = "central differences";

impl WorkPrecisionOptions {
    pub(super) fn one_step(
        &self,
        networks: &Networks<'_>,
        data: &DataSets,
        points: &Points,
    ) -> Result<Comparison, Error> {
        let (dim, time) = (2 * networks.target.dof(), networks.time);
        let judged = points.input.len() / dim;
        let copies = TrajectoryMethods::copies_of(judged);
        let input = points.input.repeat(copies);
        let input = &input[..];
        let single = &input[..input.len().min(TrajectoryMethods::LEAST * dim)];
        let units = (single.len() / dim) as f64 * time;
        let mut methods = Vec::new();
        for (name, model) in &networks.models {
            let map = model.composition();
            let together = move || {
                let mut moved = input.to_vec();
                map_points(map, Direction::Forward, &mut moved)?;
                Ok(moved)
            };
            let alone = move || {
                let mut moved = single.to_vec();
                for point in moved.chunks_exact_mut(dim) {
                    map_points(map, Direction::Forward, point)?;
                }
                Ok(moved)
            };
            methods.push(Method::new(*name, None, together).beside_alone(units, alone));
        }
        for (entry, system) in self.integrators_of(networks) {
            for &steps in &entry.one_step {
                let by = entry.integrator;
                let together = move || by.trajectories(system, input, time, steps, 1);
                let alone = move || {
                    let mut moved = Vec::with_capacity(single.len());
                    for point in single.chunks_exact(dim) {
                        moved.extend(by.trajectories(system, point, time, steps, 1)?);
                    }
                    Ok(moved)
                };
                let method = Method::new(by.name(), Some(steps as f64), together);
                methods.push(method.beside_alone(units, alone));
            }
        }
        for table in networks.tables {
            methods.push(table.method((input, single), (1, 1), units));
        }
        let all = TrajectoryMethods {
            methods,
            reference: &points.output,
            reference_error: data.reference_error,
            dim,
            trajectories: judged,
            copies,
            time,
        };
        all.compare(self.rounds)
    }

    pub(super) fn rollout(
        &self,
        networks: &Networks<'_>,
        options: &RolloutOptions,
        reference: &ReferenceTrajectories,
    ) -> Result<Comparison, Error> {
        let ReferenceTrajectories { trajectories, error: reference_error } = reference;
        let integrators = self.integrators_of(networks).flat_map(|(entry, system)| {
            entry.rollout.iter().map(move |&steps| (entry.integrator, system, steps))
        });
        Compared {
            models: &networks.models,
            integrators: integrators.collect(),
            tables: networks.tables,
            request: options.request(),
            interval: options.interval(networks.time),
            reference: trajectories.values(),
            count: trajectories.count(),
            dim: trajectories.dim(),
            reference_error: *reference_error,
        }
        .compare(self.rounds)
    }

    /// Those that are tried, each with the system.
    fn integrators_of<'a>(
        &'a self,
        networks: &Networks<'a>,
    ) -> impl Iterator<Item = (&'a IntegratorSteps, &'a System)> + use<'a> {
        let system = networks.target.system();
        self.integrators.iter().filter_map(move |entry| Some((entry, system?)))
    }

    fn jacobians(
        &self,
        name: &str,
        model: &Model,
        points: &[f64],
    ) -> Result<JacobianComparison, Error> {
        let map = model.composition();
        let dim = 2 * map.dof();
        let mut methods = vec![
            jacobian_method(DUALS, None, map, points, map_jacobians_by_duals),
            jacobian_method(BY_HAND, None, map, points, map_jacobians),
        ];
        methods.extend(self.differences.iter().map(|&step| {
            let differences = move |map: &Composition<f64>, points: &[f64], out: &mut [f64]| {
                jacobians_by_differences(map, step, points, out)
            };
            jacobian_method(DIFFERENCES, Some(step), map, points, differences)
        }));
        let exact = precise_jacobians(map, points);
        let judge = |out: &[f64]| relative_difference(out, &exact);
        let units = (points.len() / dim) as f64;
        let methods = work_precision(&methods, &judge, units, self.rounds)?;
        Ok(JacobianComparison { model: name.to_owned(), methods })
    }
}

/// Trajectories of networks and of integrators from the same points, to be judged and timed.
pub(super) struct Compared<'a, 'm> {
    pub(super) models: &'a [(&'m str, &'m Model)],
    /// Each with its steps between two states.
    pub(super) integrators: Vec<(Integrator, &'a System, usize)>,
    /// Of the map that the networks stand for.
    pub(super) tables: &'a [MadeTable],
    pub(super) request: Rollout,
    /// The time between two states.
    pub(super) interval: f64,
    /// States of the reference from the first on: (times, trajectories, 2n).
    pub(super) reference: &'a [f64],
    /// The number of trajectories that are compared.
    pub(super) count: usize,
    /// The number 2n of coordinates.
    pub(super) dim: usize,
    pub(super) reference_error: f64,
}

impl Compared<'_, '_> {
    /// All together, and the first alone.
    pub(super) fn compare(&self, rounds: usize) -> Result<Comparison, Error> {
        let Self { reference: states, count, dim, request, interval, .. } = *self;
        let copies = TrajectoryMethods::copies_of(count);
        let initial = states[..count * dim].repeat(copies);
        let (initial, first) = (&initial[..], &states[..dim]);
        let kept = request.kept() - 1;
        let time = interval * kept as f64;
        let mut methods = Vec::new();
        for &(name, model) in self.models {
            let from = move |initial: &[f64]| {
                Ok(model.rollout(initial, request)?.split_off(initial.len()))
            };
            let method = Method::new(name, None, move || from(initial));
            methods.push(method.beside_alone(time, move || from(first)));
        }
        for &(by, system, steps) in &self.integrators {
            let from =
                move |initial: &[f64]| by.trajectories(system, initial, interval, steps, kept);
            let method = Method::new(by.name(), Some(steps as f64), move || from(initial));
            methods.push(method.beside_alone(time, move || from(first)));
        }
        for table in self.tables {
            methods.push(table.method((initial, first), (request.every, kept), time));
        }
        let all = TrajectoryMethods {
            methods,
            reference: &states[count * dim..],
            reference_error: self.reference_error,
            dim,
            trajectories: count,
            copies,
            time,
        };
        all.compare(rounds)
    }
}

fn jacobian_method<'a>(
    name: &str,
    setting: Option<f64>,
    map: &'a Composition<f64>,
    points: &'a [f64],
    f: impl Fn(&Composition<f64>, &[f64], &mut [f64]) -> Result<(), Error> + Sync + 'a,
) -> Method<'a> {
    Method::new(name, setting, move || {
        let mut out = vec![0.0; points.len() * 2 * map.dof()];
        f(map, points, &mut out)?;
        Ok(out)
    })
}

/// All comparisons of a scene.
#[derive(Serialize)]
struct Comparisons {
    one_step: Comparison,
    rollout: Option<Comparison>,
    /// Of each network, seconds for one Jacobian.
    jacobians: Vec<JacobianComparison>,
}

/// Methods to get the Jacobians of one network.
#[derive(Serialize)]
struct JacobianComparison {
    model: String,
    methods: Vec<WorkPrecision>,
}

const TIME: &str = "µs a trajectory and unit time";

pub(super) const HOW: &str = "One thread; medians of repeated runs, in turn, and in brackets their \
                              quartiles. All are timed twice: with 64 trajectories or more together, \
                              which fill the lanes of vectors (fewer are taken several times over; \
                              those of Gauss–Legendre wait for one another where their stages take \
                              more iterations), and with one alone. Between two numbers of steps \
                              times are interpolated.";

/// Where what is paid before the first step is left out.
const NOT_COUNTED: &str = "Data and training are not counted.";

const DISTANCE: &str = "The error is the root mean square distance from the reference";

impl Comparisons {
    fn without_seconds(&self) -> Self {
        let jacobians = self.jacobians.iter().map(|all| JacobianComparison {
            model: all.model.clone(),
            methods: all.methods.iter().map(WorkPrecision::without_seconds).collect(),
        });
        Self {
            one_step: self.one_step.without_seconds(),
            rollout: self.rollout.as_ref().map(Comparison::without_seconds),
            jacobians: jacobians.collect(),
        }
    }

    /// Each comparison of trajectories, with what its settings count.
    fn of_trajectories(&self) -> impl Iterator<Item = (&'static str, &Comparison, &'static str)> {
        let one_step = [("One step", &self.one_step, "steps")];
        let rollout = self.rollout.iter().map(|c| ("Roll-out", c, "steps between two states"));
        one_step.into_iter().chain(rollout)
    }

    fn words(&self) -> Vec<Block> {
        let mut out = vec![Block::Text(format!("{HOW} {NOT_COUNTED}"))];
        for (title, comparison, steps) in self.of_trajectories() {
            let Comparison { trajectories, time, .. } = comparison;
            out.push(Block::Text(format!(
                "{title} of time {time}, {trajectories} trajectories, µs for one and unit time:"
            )));
            out.push(Block::Text(winners(comparison, steps)));
        }
        for comparison in &self.jacobians {
            out.push(Block::Text(comparison.words()));
        }
        out
    }

    fn tables(&self) -> Vec<Block> {
        let mut out = Vec::new();
        for (title, comparison, steps) in self.of_trajectories() {
            out.push(Block::Heading(format!("{title} of time {}", comparison.time)));
            let states =
                if comparison.time == self.one_step.time { "" } else { ", over all states kept" };
            out.push(Block::Text(format!("{DISTANCE}{states}.")));
            out.push(Block::Table(methods_table(&comparison.methods, steps, TIME)));
        }
        for comparison in &self.jacobians {
            out.push(Block::Heading(format!("Jacobians of `{}`", comparison.model)));
            out.push(Block::Text(
                "The error is the largest difference from double-double precision over the largest \
                 entry."
                    .into(),
            ));
            out.push(Block::Table(methods_table(&comparison.methods, "step h", "µs a Jacobian")));
        }
        out
    }

    fn trajectory_figure(&self) -> Figure {
        let panel = |(title, comparison, _): (&str, &Comparison, _)| Panel {
            title: format!("{title} of time {}: error against run time", comparison.time),
            y_label: "rms distance from the reference".into(),
            ..work_precision_panel(TIME, &comparison.methods, MICRO)
        };
        Figure::in_a_row(
            TRAJECTORIES,
            "Error against run time on this machine, one thread: medians, and lines from quartile \
             to quartile. Lower and further left is better.",
            self.of_trajectories().map(panel).collect(),
        )
    }

    fn jacobian_figure(&self) -> Figure {
        let panel = |comparison: &JacobianComparison| Panel {
            title: format!("Jacobians of {}", comparison.model),
            y_label: "relative error".into(),
            ..work_precision_panel("µs a Jacobian", &comparison.methods, MICRO)
        };
        Figure::in_a_row(
            JACOBIANS,
            "Jacobians of each network: error against run time on this machine, one thread.",
            self.jacobians.iter().map(panel).collect(),
        )
    }
}

pub(super) const MICRO: f64 = 1e6;

fn micro(seconds: f64) -> String {
    Format::Magnitude.number(seconds * MICRO)
}

/// The error of a method, or why it has none.
pub(super) fn error_cell(method: &WorkPrecision) -> Cell {
    match (method.error, &method.failure) {
        (Some(error), _) => error.into(),
        (None, Some(reason)) => format!("no result: {reason}").into(),
        (None, None) => "no result".into(),
    }
}

/// `setting` heads the column of what is varied.
fn methods_table(methods: &[WorkPrecision], setting: &str, time: &str) -> Table {
    let mut table = Table::new([
        ("method", Format::Exact),
        (setting, Format::Setting),
        ("error", Format::Exponent(2)),
        (time, Format::Magnitude),
        ("one alone", Format::Magnitude),
    ]);
    for method in methods {
        table.push([
            method.name.clone().into(),
            method.setting.into(),
            error_cell(method),
            method.seconds.map(|seconds| seconds.scaled(MICRO)).into(),
            method.alone.map(|seconds| seconds.scaled(MICRO)).into(),
        ]);
    }
    table
}

/// `steps` are what the setting counts.
fn with_setting(method: &WorkPrecision, steps: &str) -> String {
    match method.setting {
        Some(1.0) => format!("{} with 1 {}", method.name, steps.replacen("steps", "step", 1)),
        Some(count) => format!("{} with {count} {steps}", method.name),
        None => method.name.clone(),
    }
}

/// How many times faster the network is than the other.
fn ratio(network: f64, other: f64) -> String {
    if network <= other {
        format!("{:.1} times faster", other / network)
    } else {
        format!("{:.1} times slower", network / other)
    }
}

/// Each network against the fastest integrator that is at least as accurate, then the
/// fastest of all for each power of ten.
fn winners(comparison: &Comparison, steps: &str) -> String {
    let mut out = String::new();
    let methods = &comparison.methods;
    let tried = methods.iter().any(|other| other.setting.is_some());
    for method in methods.iter().filter(|method| method.setting.is_none()) {
        let network = &method.name;
        let (Some(error), Some(together), Some(alone)) =
            (method.error, method.seconds, method.alone)
        else {
            let _ = writeln!(out, "- `{network}` left the finite numbers.");
            continue;
        };
        let (together, alone) = (together.median, alone.median);
        let _ = write!(
            out,
            "- `{network}` errs by {error:.1e} and takes {} µs, {} one alone: ",
            micro(together),
            micro(alone)
        );
        let sentence = match AtError::fastest(methods, error) {
            _ if !tried => "there is no integrator to compare with.".to_owned(),
            _ if error >= comparison.lost() => format!(
                "it has lost the trajectories, whose points are of size {:.1}, and there is \
                 nothing to compare.",
                comparison.size
            ),
            None => "no integrator tried is as accurate.".into(),
            Some(best) => format!(
                "{} or fewer is as accurate in {} µs; the network is {} with trajectories \
                 together, {} with one alone.",
                with_setting(best.method, steps),
                micro(best.seconds),
                ratio(together, best.seconds),
                ratio(alone, best.alone.unwrap_or(f64::NAN))
            ),
        };
        let _ = writeln!(out, "{sentence}");
    }
    let ranges = comparison.fastest_by_error();
    if !ranges.is_empty() {
        let _ = writeln!(
            out,
            "- Fastest of all for an error of at most (the reference itself errs by {:.0e}: \
             smaller differences are not seen)",
            comparison.reference_error
        );
    }
    let or_both = |one: String, other: String| match one == other {
        true => one,
        false => format!("{one} … {other}"),
    };
    for range in ranges {
        let errors = or_both(format!("1e{}", range.from), format!("1e{}", range.to));
        let seconds = or_both(micro(range.seconds[0]), micro(range.seconds[1]));
        let _ = writeln!(out, "  - {errors}: {}, {seconds} µs", range.name);
    }
    out
}

impl JacobianComparison {
    fn words(&self) -> String {
        let model = &self.model;
        let find = |name: &str| self.methods.iter().find(|method| method.name == name);
        let best = most_accurate(self.methods.iter().filter(|method| method.setting.is_some()));
        let figures = |method: Option<&WorkPrecision>| {
            method.and_then(|m| Some((m.error?, m.seconds?.median, m.setting)))
        };
        let (Some(duals), Some(hand), Some(differences)) =
            (figures(find(DUALS)), figures(find(BY_HAND)), figures(best))
        else {
            return format!("Jacobians of `{model}`: not all methods gave a result.");
        };
        format!(
            "Jacobians of `{model}`: duals err by {:.0e} in {} µs, the chain rule written out by \
             hand by {:.0e} in {} µs, {}; central differences at their best step, {:e}, err by \
             {:.0e} in {} µs, {:.1} times as long as duals.",
            duals.0,
            micro(duals.1),
            hand.0,
            micro(hand.1),
            ratio(hand.1, duals.1),
            differences.2.unwrap_or(f64::NAN),
            differences.0,
            micro(differences.1),
            differences.1 / duals.1
        )
    }
}

/// A panel with a curve for each name, and a line from quartile to quartile at each
/// point; title and label of the errors are the caller's.
pub(super) fn work_precision_panel(x_label: &str, methods: &[WorkPrecision], factor: f64) -> Panel {
    let mut curves: Vec<Series> = Vec::new();
    let mut bars = Vec::new();
    for method in methods {
        let (Some(error), Some(spread)) = (method.error, method.seconds) else { continue };
        let Spread { lower, median, upper } = spread.scaled(factor);
        let color = curves.iter().position(|curve| curve.name == method.name);
        let color = color.unwrap_or_else(|| {
            let (name, color) = (method.name.clone(), curves.len());
            curves.push(Series { name, color, style: Style::Marked, points: Vec::new() });
            color
        });
        curves[color].points.push((median, error));
        bars.push(Series::unnamed(color, Style::Line, vec![(lower, error), (upper, error)]));
    }
    Panel {
        x_label: x_label.into(),
        x: Axis::Log,
        y: Axis::Log,
        series: bars.into_iter().chain(curves).collect(),
        ..Panel::default()
    }
}
