//! What a comparison of long steps found: its tables, words and figures.

use super::seed_errors::{MICRO, RivalKind, SeedErrors, SeedGains};
use super::step_tables::{TableCost, named};
use super::work_precision::work_precision_panel;
use crate::flow::TableKind;
use crate::measure::timing::{AtError, Comparison, WorkPrecision, break_even};
use crate::scene::figure::{Axis, Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Format, Table};
use crate::scene::trained::Trained;
use crate::train::StageResult;
use serde::Serialize;
use serde_json::json;

/// Figures of errors and gains, and of errors against run times.
pub(super) const FIGURE: &str = "long-steps";
pub(super) const METHODS: &str = "long-steps-methods";

/// What was found at one flow time.
#[derive(Serialize)]
pub(super) struct AtTime {
    pub(super) flow_time: f64,
    /// The held-out mean squared error of the limiting rotation alone.
    pub(super) rotation_error: Option<f64>,
    pub(super) networks: Vec<OfNetwork>,
    pub(super) one_step: Comparison,
    pub(super) trajectories: Comparison,
    /// Of networks with several initial weights, at the flow time of the scene.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) seeds: Vec<SeedErrors>,
    pub(super) tables: Vec<TableCost>,
}

/// A network at one flow time.
#[derive(Serialize)]
pub(super) struct OfNetwork {
    pub(super) name: String,
    pub(super) parameters: usize,
    /// The held-out mean squared error.
    pub(super) error: Option<f64>,
    pub(super) iterations: u64,
    pub(super) stages: Vec<StageResult>,
    pub(super) drift: Option<f64>,
    /// Of the pairs that it was trained on, and of its training, with all that led up to it.
    pub(super) pairs_seconds: f64,
    pub(super) training_seconds: f64,
}

impl OfNetwork {
    pub(super) fn new(
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
    /// How many steps pay for what was paid before, where each takes fewer seconds for unit time than a rival's.
    fn pays_after(&self, rival: AtError<'_>, paid: f64, seconds: f64) -> Option<f64> {
        let paid = (paid - TableCost::seconds_of(&self.tables, rival.method)).max(0.0);
        break_even(paid, seconds * self.flow_time, rival.seconds * self.flow_time)
    }

    /// What does not depend on the machine.
    pub(super) fn data(&self) -> serde_json::Value {
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
        at.pays_after(rival, paid, self.seconds)
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

pub(super) struct Results {
    /// The length of the trajectories.
    pub(super) duration: f64,
    /// The names of the averages in closed form among the rivals.
    pub(super) closed: Vec<String>,
    pub(super) times: Vec<AtTime>,
}

impl Results {
    pub(super) fn errors(&self) -> Table {
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
    pub(super) fn all_rivals(&self) -> Vec<Block> {
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
                        let named =
                            || against.comparison.methods.iter().filter(move |m| m.name == name);
                        let least = || named().filter_map(|m| m.error).min_by(f64::total_cmp);
                        // Of a rival that came to a result with other steps its least error says more.
                        let failed = named().all(|m| m.failure.is_some());
                        let failure = named().find_map(|m| m.failure.as_ref()).filter(|_| failed);
                        table.push([
                            match failure {
                                Some(reason) => format!("{name}: {reason}").into(),
                                None => name.into(),
                            },
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
    pub(super) fn seeds(&self) -> Option<Block> {
        let of_time = |at: &AtTime| [at.one_step.lost(), at.trajectories.lost()];
        let all: Vec<(&SeedErrors, [f64; 2])> = self
            .times
            .iter()
            .flat_map(|at| at.seeds.iter().map(move |seeds| (seeds, of_time(at))))
            .collect();
        let long = format!("time {}", self.duration);
        let time = self.times.iter().find(|at| !at.seeds.is_empty())?.flow_time;
        let one = format!("one step of {time}");
        Some(Block::Table(SeedErrors::table(&all, [&one, &long])))
    }

    /// What they leave of the gains, beside each kind of rival.
    pub(super) fn gains_of_seeds(&self) -> Vec<Block> {
        let mut table = SeedGains::table();
        for at in &self.times {
            let kind = |method: &WorkPrecision| {
                if self.closed.contains(&method.name) {
                    RivalKind::ClosedAverage
                } else if TableKind::is_named(&method.name) {
                    RivalKind::StepTable
                } else {
                    RivalKind::Other
                }
            };
            for of in &at.seeds {
                let own = at.networks.iter().find(|network| network.name == of.network);
                for (what, errors, comparison) in [
                    (format!("one step of {}", at.flow_time), &of.one_step, &at.one_step),
                    (format!("time {}", self.duration), &of.trajectories, &at.trajectories),
                ] {
                    let pays_after = |rival: AtError<'_>, seconds: f64| {
                        at.pays_after(rival, own?.paid(), seconds)
                    };
                    let gains = SeedGains {
                        network: &of.network,
                        what,
                        errors,
                        comparison,
                        kind: &kind,
                        pays_after: &pays_after,
                    };
                    gains.add_to(&mut table);
                }
            }
        }
        if table.is_empty() {
            return Vec::new();
        }
        let words = "How many times as long the fastest rival of each kind takes that errs no more, at the error from \
                     the best, the median and the worst initial weights; times and seconds of training are those of \
                     the first. Below 1 the rival is faster.";
        vec![Block::Text(words.into()), Block::Table(table)]
    }

    pub(super) fn one_step(&self) -> Table {
        self.comparison(&|at| &at.one_step, "one step")
    }

    pub(super) fn long(&self) -> Table {
        self.comparison(&|at| &at.trajectories, &format!("time {}", self.duration))
    }

    /// Where each network overtakes its rivals: at which error, by how much, and after how many steps that pays.
    pub(super) fn sentences(&self) -> String {
        let mut out = String::new();
        let names = self.times.first().map_or(&[][..], |at| &at.networks[..]);
        type Of = fn(&AtTime) -> &Comparison;
        let both: [(&str, Of); 2] =
            [("for one step", |at| &at.one_step), ("over trajectories", |at| &at.trajectories)];
        for network in names {
            let is_own = |of: &SeedErrors| of.network == network.name;
            let of_several = self.times.iter().any(|at| at.seeds.iter().any(is_own));
            let of_first = if of_several { ", of the first of its initial weights" } else { "" };
            for (what, of) in both {
                let judged: Vec<(&AtTime, Against<'_>)> = self
                    .times
                    .iter()
                    .filter_map(|at| Some((at, Against::new(of(at), &network.name)?)))
                    .collect();
                let wins = |(_, against): &&(&AtTime, Against<'_>)| {
                    against.gain().is_none_or(|gain| gain > 1.0)
                };
                let winning: Vec<String> =
                    judged.iter().filter(wins).map(|(at, _)| at.flow_time.to_string()).collect();
                let beside = judged.iter().filter_map(|(at, against)| {
                    Some((*at, against, against.best?, against.gain()?))
                });
                let largest = beside.max_by(|a, b| a.3.total_cmp(&b.3));
                let words = match (&winning[..], largest) {
                    _ if judged.is_empty() => "has lost the points at every flow time".to_owned(),
                    (_, None) => "errs less than every rival tried".to_owned(),
                    ([], Some((at, against, best, gain))) => format!(
                        "is slower than the fastest rival that errs no more at every flow time: by {} at {}, \
                         where it comes nearest and errs by {:.1e}; there the rival is {}",
                        Format::Factor.number(1.0 / gain),
                        at.flow_time,
                        against.error,
                        named(best.method),
                    ),
                    (times, Some((_, _, _, gain))) if gain <= 1.0 => format!(
                        "errs less than every rival tried at flow times {}; at all others the fastest rival that errs \
                         no more is faster",
                        times.join(", ")
                    ),
                    (times, Some((at, against, best, gain))) => {
                        let own = at.networks.iter().find(|own| own.name == network.name);
                        let pays = own.and_then(|own| against.pays_after(best, own.paid(), at));
                        let pays = pays.map_or_else(String::new, |steps| {
                            format!(
                                "; pairs and training are paid for after {} steps",
                                Format::Significant.number(steps)
                            )
                        });
                        format!(
                            "overtakes the fastest rival that errs no more at flow times {}, by up to {} at {}, \
                             where it errs by {:.1e} and the rival is {}{pays}",
                            times.join(", "),
                            Format::Factor.number(gain),
                            at.flow_time,
                            against.error,
                            named(best.method),
                        )
                    }
                };
                out.push_str(&format!("- `{}` {words} ({what}{of_first}).\n", network.name));
            }
        }
        out
    }

    /// Error against run time, a curve for each method; the networks of all flow times over trajectories, of the last
    /// in one step.
    pub(super) fn methods_figure(&self) -> Figure {
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
                panel(format!("trajectories of time {}", self.duration), &long),
            ],
        )
    }

    pub(super) fn figure(&self) -> Figure {
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
                    &format!("time {}", self.duration),
                    "faster than rivals by",
                    gains(|at| &at.trajectories),
                ),
            ],
        )
    }
}
