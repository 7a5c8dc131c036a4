//! A family of maps: networks at ε and flow times that they were trained on or not, and how well
//! their invariants are conserved along the reference at each ε.

use super::over_seeds::MedianAndWorst;
use super::shared::{Study, finite};
use crate::error::Error;
use crate::flow::Trajectories;
use crate::measure::{
    adiabatic::{averaged_invariant, log_slope, second_averaged_invariant},
    timing::root_mean_square_distance,
    trajectories::{drifts, root_mean_square},
};
use crate::network::{Model, Rollout, map_points};
use crate::phase::Direction;
use crate::scene::bibliography::GAUSS_LEGENDRE;
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Axis, Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::learning::BySeed;
use crate::scene::setup::{MOST, Need, check_points};
use crate::scene::trained::Trained;
use crate::system::{Hamiltonian, NearlyPeriodic, System};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::rc::Rc;

const FIGURE: &str = "family";

/// Networks at several ε and flow times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FamilyOptions {
    /// The values of ε at which they are judged.
    pub epsilons: Vec<f64>,
    /// The flow times at which the networks are judged, all positive.
    pub flow_times: Vec<f64>,
    /// The slow time, ε times the length, over which invariants are followed along trajectories of
    /// the reference.
    pub slow_time: f64,
    /// The number of states on each trajectory.
    pub states: usize,
    /// The initial points of the trajectories.
    pub initial: Vec<Vec<f64>>,
}

impl Study for FamilyOptions {
    fn name(&self) -> &'static str {
        "family"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::System, Need::FlowTime, Need::Data, Need::Models]
    }

    fn is_of_invariants(&self) -> bool {
        true
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        Error::check_count_range("epsilons", self.epsilons.len(), 1, MOST)?;
        Error::check_count_range("flow_times", self.flow_times.len(), 1, MOST)?;
        Error::check_count_range("states", self.states, 2, MOST)?;
        Error::check_range("slow_time", self.slow_time, Error::LEAST_POSITIVE, f64::MAX)?;
        for (name, values) in [("epsilons", &self.epsilons), ("flow_times", &self.flow_times)] {
            for value in values {
                Error::check_range(name, *value, Error::LEAST_POSITIVE, f64::MAX)?;
            }
        }
        let steps = |epsilon: f64, time: f64| self.slow_time / (epsilon * time);
        let most = self.epsilons.iter().flat_map(|e| self.flow_times.iter().map(|t| steps(*e, *t)));
        if let Some(steps) = most.into_iter().find(|steps| !(*steps <= MOST as f64)) {
            let expected = format!("at most {MOST} steps of a map");
            return Err(Error::invalid("slow_time", format!("{steps:e} steps"), expected));
        }
        for epsilon in &self.epsilons {
            let interval = self.slow_time / epsilon / (self.states - 1) as f64;
            scene.setup.check_repeated(interval).map_err(|e| e.with_place("slow_time"))?;
        }
        match &scene.setup.system {
            Some(system) if system.torus().1.len() > 1 => {
                let expected = "a system whose limit turns along circles, for averages over them";
                Err(Error::invalid("system", system.kind(), expected))
            }
            // Each of its surfaces turns at a frequency of its own.
            Some(system) if !system.turns_at_one_frequency() => {
                let expected = "a system whose limit turns at one frequency, for averages over it";
                Err(Error::invalid("system", system.kind(), expected))
            }
            Some(system) => {
                system.check_with(&self.epsilons).map_err(|e| e.with_place("epsilons"))?;
                check_points("initial", &self.initial, system)
            }
            None => Ok(()),
        }
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![FIGURE]
    }

    fn cites(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![GAUSS_LEGENDRE]
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let (models, time) = (context.by_network()?, context.flow_time()?);
        let mut cases = Vec::new();
        for &epsilon in &self.epsilons {
            for &flow_time in &self.flow_times {
                cases.push(self.case(context, &models, epsilon, flow_time, time)?);
            }
        }
        let mut invariants = Vec::new();
        for &epsilon in &self.epsilons {
            invariants.push(self.invariants(context, &models, epsilon)?);
        }
        let names: Vec<String> = models.iter().map(|one| one.network.clone()).collect();
        let most = models.iter().map(|one| one.seeds.len()).max().unwrap_or(1);
        let customary = self.customary(context.system()?);
        let found = Results { names, most, customary, cases, invariants };
        let text = format!(
            "Errors are on points that no training has seen; a map is marked as seen where pairs \
             of its ε and flow time were among those of the training. The frequency is that of the fast \
             angle (of the first plane that turns) over the roll-outs of the network, against the \
             reference; none where the phase is lost. Invariants are followed over {} points of each of {} trajectories of \
             the reference, of time {}/ε; a change is the root mean square over the trajectories \
             of the largest |μ − μ(0)|. μ₀ + εμ₁ and μ₀ + εμ₁ + ε²μ₂ are averages to first and second order, by \
             quadrature.",
            self.states,
            self.initial.len(),
            self.slow_time
        ) + match most {
            1 => "",
            _ => {
                " Errors, frequencies and changes are medians over the initial weights of a network; one that leaves \
                 the finite numbers counts as the worst."
            }
        };
        let figures = match context.draws(FIGURE) {
            true => vec![found.figure()],
            false => Vec::new(),
        };
        Ok(Findings {
            title: "A family of maps".into(),
            results: Section {
                summary: vec![
                    Block::Table(found.errors()),
                    Block::Table(found.changes()),
                    Block::Text(found.words()),
                ],
                details: vec![Block::Text(text)],
                data: json!({ "maps": found.cases, "invariants": found.invariants }),
            },
            figures,
            ..Findings::default()
        })
    }
}

/// All networks on one of the maps.
#[derive(Serialize)]
struct Case {
    epsilon: f64,
    flow_time: f64,
    seen: bool,
    rotation_error: f64,
    /// The mean squared error of each network, the median of its initial weights.
    errors: Vec<Option<f64>>,
    /// That of the worst of them.
    worst_errors: Vec<Option<f64>>,
    /// The error of its frequency of the fast plane, in radians for unit time.
    frequency_errors: Vec<Option<f64>>,
}

/// What invariants do along the reference at one ε.
#[derive(Serialize)]
struct Invariants {
    epsilon: f64,
    leading: f64,
    /// Of that which the users of the system know.
    #[serde(skip_serializing_if = "Option::is_none")]
    customary: Option<f64>,
    averaged: f64,
    /// Of the average to second order.
    averaged_twice: f64,
    /// Of each network, the median of its initial weights; None where it owns none.
    learnt: Vec<Option<f64>>,
    /// That of the worst of them.
    worst_learnt: Vec<Option<f64>>,
}

/// The largest error of a phase, in radians, from which a frequency is taken.
const KNOWN_PHASE: f64 = 1.0;

impl FamilyOptions {
    /// The name of the invariant that users of the system know.
    fn customary(&self, system: &System) -> Option<&'static str> {
        Some(system.customary_invariant(self.initial.first()?)?.0)
    }

    fn case(
        &self,
        context: &mut Context<'_>,
        models: &[BySeed],
        epsilon: f64,
        flow_time: f64,
        own_time: f64,
    ) -> Result<Case, RunError> {
        let (judge, rotation_error) = context.judge_at(epsilon, flow_time)?;
        let (own, declared) = (context.system()?, &context.scene.setup.data);
        let is_seen = |among: &[f64], value: f64, own: f64| match among {
            [] => value == own,
            several => several.contains(&value),
        };
        let seen = declared.as_ref().is_some_and(|data| {
            is_seen(&data.epsilons, epsilon, own.epsilon())
                && is_seen(&data.flow_times, flow_time, own_time)
        });
        let system = own.clone().with_epsilon(epsilon);
        // As many steps as the slow time asks for, and one at least.
        let steps = (self.slow_time / (epsilon * flow_time)).round().max(1.0) as usize;
        let interval = steps as f64 * flow_time;
        let reference = context.reference(&system, &self.initial, interval, 2)?;
        let judged = |model: &Model| -> Result<(f64, Option<f64>), Error> {
            let mut moved = judge.input().to_vec();
            map_points(model.composition(), Direction::Forward, &mut moved)?;
            let dim = 2 * judge.dof();
            let distance = root_mean_square_distance(&moved, judge.output(), dim);
            let request = Rollout { steps, every: steps };
            let states = model.rollout(&self.initial.concat(), request)?;
            let ends = &states[self.initial.concat().len()..];
            let phases = phase_errors(&system, ends, reference.trajectories.values());
            let phase = root_mean_square(&phases);
            // Beyond that nobody knows how many turns it is off.
            let frequency = (phase < KNOWN_PHASE).then_some(phase / interval);
            Ok((distance * distance / dim as f64, frequency))
        };
        let (mut errors, mut worst_errors, mut frequency_errors) = (vec![], vec![], vec![]);
        for of in models {
            // A network that leaves the finite numbers there has no error.
            let at = |seed: &Rc<Trained>| match seed.lost {
                Some(_) => None,
                None => seed.model().with_epsilon_and_time(epsilon, flow_time / own_time).ok(),
            };
            let found =
                of.seeds.iter().map(|seed| at(seed).map(|model| judged(&model)).transpose());
            let found = found.collect::<Result<Vec<_>, Error>>()?;
            let steps = MedianAndWorst::of(found.iter().map(|seed| Some(seed.as_ref()?.0)));
            errors.push(steps.median);
            worst_errors.push(steps.worst);
            let frequencies = found.iter().map(|seed| seed.as_ref()?.1);
            frequency_errors.push(MedianAndWorst::of(frequencies).median);
        }
        Ok(Case {
            epsilon,
            flow_time,
            seen,
            rotation_error,
            errors,
            worst_errors,
            frequency_errors,
        })
    }

    fn invariants(
        &self,
        context: &mut Context<'_>,
        models: &[BySeed],
        epsilon: f64,
    ) -> Result<Invariants, RunError> {
        let system = context.system()?.clone().with_epsilon(epsilon);
        let interval = self.slow_time / epsilon / (self.states - 1) as f64;
        let reference = context.reference(&system, &self.initial, interval, self.states)?;
        let along = &reference.trajectories;
        context.stage("invariants along the reference", |_| {
            let leading = change(along, |z| system.adiabatic_invariant(z));
            let customary = self.customary(&system).map(|_| {
                change(along, |z| {
                    system.customary_invariant(z).map_or(f64::NAN, |(_, value)| value)
                })
            });
            let averaged = change(along, |z| averaged_invariant(&system, z));
            let averaged_twice = change(along, |z| second_averaged_invariant(&system, z));
            let of = |of: &BySeed| {
                let change = |seed: &Rc<Trained>| match seed.lost {
                    Some(_) => None,
                    None => learnt_change(seed.model(), epsilon, along),
                };
                MedianAndWorst::of(of.seeds.iter().map(change))
            };
            let changes: Vec<MedianAndWorst> = models.iter().map(of).collect();
            let learnt = changes.iter().map(|of| of.median).collect();
            let worst_learnt = changes.iter().map(|of| of.worst).collect();
            Ok(Invariants {
                epsilon,
                leading,
                customary,
                averaged,
                averaged_twice,
                learnt,
                worst_learnt,
            })
        })
    }
}

/// The root mean square over trajectories of the largest change of a quantity.
fn change(along: &Trajectories, quantity: impl Fn(&[f64]) -> f64) -> f64 {
    let changes: Vec<f64> = drifts(along, quantity).iter().map(|drift| drift.largest).collect();
    root_mean_square(&changes)
}

fn learnt_change(model: &Model, epsilon: f64, along: &Trajectories) -> Option<f64> {
    let model = model.with_epsilon_and_time(epsilon, 1.0).ok()?;
    finite(change(along, model.invariant()?))
}

/// The angles, in the first plane that the system's circle action turns, between the last
/// states and those of the reference (initial and last), between −π and π.
fn phase_errors(system: &System, ends: &[f64], reference: &[f64]) -> Vec<f64> {
    let action = system.circle_action();
    let plane = action.weights().iter().position(|m| *m != 0).unwrap_or(0);
    let (dof, dim) = (system.dof(), 2 * system.dof());
    let angle = |z: &[f64]| libm::atan2(z[plane], z[dof + plane]);
    let expected = &reference[reference.len() - ends.len()..];
    ends.chunks_exact(dim)
        .zip(expected.chunks_exact(dim))
        .map(|(a, b)| libm::remainder(angle(a) - angle(b), std::f64::consts::TAU))
        .collect()
}

struct Results {
    names: Vec<String>,
    /// The most initial weights of a network.
    most: usize,
    customary: Option<&'static str>,
    cases: Vec<Case>,
    invariants: Vec<Invariants>,
}

impl Results {
    fn errors(&self) -> Table {
        let mut columns = vec![
            ("ε".to_owned(), Format::Setting),
            ("flow time".to_owned(), Format::Exact),
            ("seen".to_owned(), Format::Exact),
            ("rotation alone".to_owned(), Format::Exponent(2)),
        ];
        for name in &self.names {
            columns.push((format!("`{name}`: MSE"), Format::Exponent(2)));
            if self.most > 1 {
                columns.push(("worst".to_owned(), Format::Exponent(2)));
            }
            columns.push((format!("`{name}`: error of the frequency"), Format::Exponent(1)));
        }
        let mut table = Table::new(columns);
        for case in &self.cases {
            let mut row = vec![
                case.epsilon.into(),
                case.flow_time.into(),
                if case.seen { "yes" } else { "no" }.into(),
                case.rotation_error.into(),
            ];
            let of_each = case.errors.iter().zip(&case.worst_errors).zip(&case.frequency_errors);
            for ((error, worst), frequency) in of_each {
                row.push((*error).into());
                row.extend((self.most > 1).then(|| (*worst).into()));
                row.push((*frequency).into());
            }
            table.push(row);
        }
        table
    }

    fn changes(&self) -> Table {
        let mut columns = vec![
            ("ε".to_owned(), Format::Setting),
            ("change of μ₀".to_owned(), Format::Exponent(2)),
        ];
        columns.extend(self.customary.map(|name| (format!("of {name}"), Format::Exponent(2))));
        columns.push(("of μ₀ + εμ₁".to_owned(), Format::Exponent(2)));
        columns.push(("of μ₀ + εμ₁ + ε²μ₂".to_owned(), Format::Exponent(2)));
        for name in &self.names {
            columns.push((format!("of the invariant of `{name}`"), Format::Exponent(2)));
            if self.most > 1 {
                columns.push(("worst".to_owned(), Format::Exponent(2)));
            }
            let other = self.customary.unwrap_or("μ₀");
            columns.push((format!("less than {other} by"), Format::Factor));
        }
        let mut table = Table::new(columns);
        for at in &self.invariants {
            let mut row = vec![at.epsilon.into(), at.leading.into()];
            row.extend(at.customary.map(Into::into));
            row.push(at.averaged.into());
            row.push(at.averaged_twice.into());
            for (learnt, worst) in at.learnt.iter().zip(&at.worst_learnt) {
                let gain = learnt.map(|learnt| at.customary.unwrap_or(at.leading) / learnt);
                row.push((*learnt).into());
                row.extend((self.most > 1).then(|| (*worst).into()));
                row.push(gain.into());
            }
            table.push(row);
        }
        table
    }

    /// The order in ε of a change; None where it has no values at three ε.
    fn order(&self, of: impl Fn(&Invariants) -> Option<f64>) -> Option<f64> {
        let known = self.invariants.iter().filter_map(|at| Some((at.epsilon, of(at)?)));
        let (epsilons, changes): (Vec<f64>, Vec<f64>) = known.unzip();
        finite(log_slope(&epsilons, &changes))
    }

    fn words(&self) -> String {
        let order = |order: Option<f64>| order.map_or("none".into(), |order| format!("{order:.2}"));
        let mut out = format!(
            "Orders in ε of the changes along the reference: μ₀ {}, μ₀ + εμ₁ {}, μ₀ + εμ₁ + ε²μ₂ {}",
            order(self.order(|at| Some(at.leading))),
            order(self.order(|at| Some(at.averaged))),
            order(self.order(|at| Some(at.averaged_twice))),
        );
        if let Some(name) = self.customary {
            out.push_str(&format!(", {name} {}", order(self.order(|at| at.customary))));
        }
        for (number, name) in self.names.iter().enumerate() {
            if let Some(found) = self.order(|at| at.learnt[number]) {
                out.push_str(&format!(", the invariant of `{name}` {found:.2}"));
            }
        }
        out + "."
    }

    fn figure(&self) -> Figure {
        let mut times: Vec<f64> = self.cases.iter().map(|case| case.flow_time).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let mut errors = Vec::new();
        for (number, name) in self.names.iter().enumerate() {
            for (shade, time) in times.iter().enumerate() {
                let at = self.cases.iter().filter(|case| case.flow_time == *time);
                let points = at.filter_map(|case| Some((case.epsilon, case.errors[number]?)));
                let style = if shade == 0 { Style::Marked } else { Style::Line };
                let (name, points) = (format!("{name}, time {time}"), points.collect());
                errors.push(Series { name, color: number * times.len() + shade, style, points });
            }
        }
        let series = |name: &str, color, style, of: &dyn Fn(&Invariants) -> Option<f64>| {
            let points = self.invariants.iter().filter_map(|at| Some((at.epsilon, of(at)?)));
            Series { name: name.into(), color, style, points: points.collect() }
        };
        let mut changes = vec![
            series("μ₀", self.names.len(), Style::Marked, &|at| Some(at.leading)),
            series("μ₀ + εμ₁", self.names.len() + 1, Style::Marked, &|at| Some(at.averaged)),
            series("μ₀ + εμ₁ + ε²μ₂", self.names.len() + 2, Style::Marked, &|at| {
                Some(at.averaged_twice)
            }),
        ];
        if let Some(name) = self.customary {
            changes.push(series(name, self.names.len() + 3, Style::Marked, &|at| at.customary));
        }
        for (number, name) in self.names.iter().enumerate() {
            changes.push(series(name, number, Style::Marked, &|at| at.learnt[number]));
        }
        let panel = |title: &str, y_label: &str, series| Panel {
            title: title.into(),
            x_label: "ε".into(),
            y_label: y_label.into(),
            x: Axis::Log,
            y: Axis::Log,
            series,
            ..Panel::default()
        };
        Figure::in_a_row(
            FIGURE,
            "Left: the mean squared error of each network at every ε and flow time. Right: how much \
             invariants change along the reference, over the same slow time at each ε.",
            vec![
                panel("error of a step", "mean squared error", errors),
                panel("along the reference", "change of the invariant", changes),
            ],
        )
    }
}
