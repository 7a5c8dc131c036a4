//! Pairs with noise and pairs with gaps: what each network makes of them, and what is said of it.

use super::over_seeds::MedianAndWorst;
use super::shared::{Study, check_along, finite};
use crate::error::Error;
use crate::flow::{Pairs, Trajectories};
use crate::layer::TorusAction;
use crate::measure::timing::root_mean_square_distance;
use crate::measure::trajectories::drifts;
use crate::network::{Rollout, map_points};
use crate::phase::Direction;
use crate::random::Stream;
use crate::scalar::max_or_nan;
use crate::scene::context::{Context, RunError};
use crate::scene::data_sets::DataSets;
use crate::scene::declared::Declared;
use crate::scene::figure::{Axis, Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::learning::BySeed;
use crate::scene::setup::{MOST, ModelSpec, Need, SeededTraining, Setup, StudyTraining};
use crate::scene::trained::Trained;
use crate::system::{Hamiltonian, NearlyPeriodic};
use crate::train::{Judgement, fit_rotation};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::rc::Rc;

const FIGURE: &str = "noise";

/// Networks of pairs with noise, and of pairs with gaps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseOptions {
    /// Standard deviations of normal noise on each component of inputs and outputs, training and held out.
    pub levels: Vec<f64>,
    /// Gaps, of one data set each: pairs with inputs in it are left out, of training and held out. These pairs have no
    /// noise.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gaps: Vec<Gap>,
    /// The number of applications of each network in a roll-out.
    pub steps: usize,
    /// The number of steps between two states that are compared with the reference.
    pub every: usize,
    /// The initial points of the roll-outs, 2n numbers each.
    pub initial: Vec<Vec<f64>>,
}

/// A slab of points without pairs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gap {
    /// The component that the gap is in, from 0 in the order q₁ … pₙ.
    pub component: usize,
    /// The lower end of the gap.
    pub low: f64,
    /// The upper end of the gap.
    pub high: f64,
}

impl Gap {
    fn holds(self, z: &[f64]) -> bool {
        self.low < z[self.component] && z[self.component] < self.high
    }
}

/// One way in which pairs are not what the flow has.
#[derive(Clone, Copy, Debug)]
enum Fault {
    None,
    Noise(f64),
    /// The gap of this number, from 1.
    Gap(usize, Gap),
}

impl Fault {
    /// As a part of the name of a file.
    fn suffix(self) -> String {
        match self {
            Self::None => String::new(),
            Self::Noise(level) => format!("noise-{level:e}").replace('.', "_"),
            Self::Gap(number, _) => format!("gap-{number}"),
        }
    }

    /// With all its numbers, whole.
    fn name(self) -> String {
        format!("{self:?}")
    }

    fn words(self) -> String {
        match self {
            Self::None => "none".into(),
            Self::Noise(level) => format!("noise {}", Format::Setting.number(level)),
            Self::Gap(_, Gap { component, low, high }) => {
                format!("no pairs with {low} < z[{component}] < {high}")
            }
        }
    }
}

impl Study for NoiseOptions {
    fn name(&self) -> &'static str {
        "noise"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::System, Need::FlowTime, Need::Data, Need::Models]
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        Error::check_count_range("levels", self.levels.len(), 1, MOST)?;
        for level in &self.levels {
            Error::check_range("levels", *level, Error::LEAST_POSITIVE, f64::MAX)?;
        }
        for Gap { component, low, high } in &self.gaps {
            if !(low < high) {
                return Err(Error::invalid("gaps", format!("{low} … {high}"), "low below high"));
            }
            if let Some(system) = &scene.setup.system {
                Error::check_count_range("gaps.component", *component, 0, 2 * system.dof() - 1)?;
            }
        }
        for model in &scene.setup.models {
            let training = scene.setup.training_of(model);
            if !training.ramp.is_empty() || model.network.is_of_file() {
                let expected = "networks to train without a ramp, whose pairs would have no noise";
                return Err(Error::invalid("models", &model.name, expected));
            }
        }
        check_along(scene, self.steps, self.every, &self.initial)
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![FIGURE]
    }

    fn shorten(&mut self) {
        self.levels = self.levels.iter().step_by(2).copied().collect();
    }

    fn trainings(&self, setup: &Setup) -> Vec<StudyTraining> {
        self.faults().skip(1).flat_map(|fault| trainings_with(setup, fault)).collect()
    }

    fn train_new(
        &self,
        context: &mut Context<'_>,
        training: &StudyTraining,
    ) -> Result<Rc<Trained>, RunError> {
        let fault = self.faults().find(|fault| fault.name() == training.fault);
        let unknown = || Error::invalid(self.name(), &training.fault, "a fault of the study");
        let data = self.changed(context, fault.ok_or_else(unknown)?)?;
        let own = training.training.clone();
        context.learn(own, &data, training.flow_time, None)
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let (system, time) = (context.system()?, context.flow_time()?);
        let clean = context.data()?;
        let interval = time * self.every as f64;
        let request = Rollout { steps: self.steps, every: self.every };
        let reference = context.reference(system, &self.initial, interval, request.kept())?;
        let mut found = Vec::new();
        for fault in self.faults() {
            let data = self.changed(context, fault)?;
            let action = TorusAction::from(system.circle_action());
            let region = data.region();
            let angles = [fit_rotation(&data.training, &system.circle_action())];
            let networks = match fault {
                Fault::None => context.by_network()?,
                _ => {
                    let mut networks: Vec<BySeed> = Vec::new();
                    for training in trainings_with(context.scene.setup, fault) {
                        let trained = self.train(context, &training)?;
                        match networks.last_mut().filter(|of| of.network == trained.network) {
                            Some(of) => of.seeds.push(trained),
                            None => {
                                let network = trained.network.clone();
                                networks.push(BySeed { network, seeds: vec![trained] });
                            }
                        }
                    }
                    networks
                }
            };
            let one = |trained: &Rc<Trained>| {
                if let Some(reason) = &trained.lost {
                    return Ok(OfSeed::lost(reason));
                }
                let model = trained.model();
                let judge = clean.to_judge_by();
                let mut moved = judge.input().to_vec();
                map_points(model.composition(), Direction::Forward, &mut moved)?;
                let dim = 2 * judge.dof();
                let states = model.rollout(&self.initial.concat(), request)?;
                let states = Trajectories::new(states, dim, self.initial.len())?;
                let of_reference = reference.trajectories.values();
                let own = model.invariant().map(|own| {
                    let changes = drifts(&states, own);
                    changes.iter().map(|d| d.largest / d.initial.abs()).fold(0.0, max_or_nan)
                });
                let judgement = Judgement::new(
                    &trained.outcome,
                    &data.training,
                    data.held_out.as_ref(),
                    (&action, &angles),
                )?;
                let component = |moved: &[f64], output: &[f64]| {
                    let distance = root_mean_square_distance(moved, output, dim);
                    finite(distance / (dim as f64).sqrt())
                };
                let in_gap = match fault {
                    Fault::Gap(_, gap) => {
                        let rows = judge.input().chunks_exact(dim).zip(moved.chunks_exact(dim));
                        let rows = rows.zip(judge.output().chunks_exact(dim));
                        let within = rows.filter(|((z, _), _)| gap.holds(z));
                        let (own, truth): (Vec<&[f64]>, Vec<&[f64]>) =
                            within.map(|((_, own), truth)| (own, truth)).unzip();
                        component(&own.concat(), &truth.concat())
                    }
                    Fault::None | Fault::Noise(_) => None,
                };
                let has_no_pairs = |z: &[f64]| {
                    let is_in_gap = matches!(fault, Fault::Gap(_, gap) if gap.holds(z));
                    is_in_gap || region.as_ref().is_some_and(|box_| box_.first_outside(z).is_some())
                };
                let all = states.values().chunks_exact(dim);
                let count = all.len();
                let without_pairs = all.filter(|z| has_no_pairs(z)).count();
                Ok(OfSeed {
                    held_out: trained.held_out_error.map(f64::sqrt),
                    clean: component(&moved, judge.output()),
                    in_gap,
                    without_pairs: Some(without_pairs as f64 / count as f64),
                    rollout: finite(root_mean_square_distance(states.values(), of_reference, dim)),
                    own: own.and_then(finite),
                    verdict: judgement.verdict,
                    reasons: judgement.reasons().map(str::to_owned).collect(),
                })
            };
            for BySeed { network, seeds } in networks {
                found.push(Found {
                    fault: fault.words(),
                    level: match fault {
                        Fault::Noise(level) => Some(level),
                        Fault::None | Fault::Gap(..) => None,
                    },
                    network,
                    pairs: data.training.len(),
                    seeds: seeds.iter().map(one).collect::<Result<_, Error>>()?,
                });
            }
        }
        let figures = match context.draws(FIGURE) {
            true => vec![figure(&found)],
            false => Vec::new(),
        };
        Ok(Findings {
            title: "Noise and gaps".into(),
            results: Section {
                summary: vec![
                    Block::Text(self.words(of_several(&found))),
                    Block::Table(table(&found)),
                ],
                details: vec![Block::Text(reasons(&found))],
                data: json!(found),
            },
            figures,
            ..Findings::default()
        })
    }
}

/// What a network made of pairs.
#[derive(Serialize)]
struct Found {
    fault: String,
    level: Option<f64>,
    network: String,
    /// The pairs it was trained on.
    pairs: usize,
    /// From each of its initial weights.
    seeds: Vec<OfSeed>,
}

impl Found {
    fn over_seeds(&self, of: impl Fn(&OfSeed) -> Option<f64>) -> MedianAndWorst {
        MedianAndWorst::of(self.seeds.iter().map(of))
    }

    /// Each verdict, the commonest first where there are several: `yes (4), with care (1)`.
    fn verdicts(&self) -> String {
        let mut counts: Vec<(&str, usize)> = Vec::new();
        for OfSeed { verdict, .. } in &self.seeds {
            match counts.iter_mut().find(|(known, _)| known == verdict) {
                Some((_, count)) => *count += 1,
                None => counts.push((verdict, 1)),
            }
        }
        counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        match counts[..] {
            [(verdict, _)] => verdict.to_owned(),
            _ => {
                let words = counts.iter().map(|(verdict, count)| format!("{verdict} ({count})"));
                words.collect::<Vec<_>>().join(", ")
            }
        }
    }
}

/// What it made of them from one set of initial weights.
#[derive(Serialize)]
struct OfSeed {
    /// Root mean squares of a component: on held-out pairs as they are, and on those of the flow.
    held_out: Option<f64>,
    clean: Option<f64>,
    /// That on pairs of the flow in the gap; none of what has no gap, or where no held-out pair is in it.
    in_gap: Option<f64>,
    /// The share of the states of its orbits that are in the gap or outside of the box of all pairs.
    without_pairs: Option<f64>,
    /// The root mean square distance of its orbits from those of the reference.
    rollout: Option<f64>,
    /// The largest change of its own invariant along them, over its value.
    own: Option<f64>,
    verdict: &'static str,
    reasons: Vec<String>,
}

impl OfSeed {
    fn lost(reason: &str) -> Self {
        Self {
            held_out: None,
            clean: None,
            in_gap: None,
            without_pairs: None,
            rollout: None,
            own: None,
            verdict: "no",
            reasons: vec![reason.to_owned()],
        }
    }
}

/// The trainings on pairs with a fault.
fn trainings_with(setup: &Setup, fault: Fault) -> Vec<StudyTraining> {
    let models = setup.models.iter().filter(|model| !model.training_only);
    let of = |mut training: SeededTraining| {
        training.spec.seeds = None;
        training.spec.name = format!("{}-{}", training.spec.name, fault.suffix());
        // A scene without a flow time is not complete, and is not run.
        let flow_time = setup.flow_time.unwrap_or(f64::NAN);
        StudyTraining { training, flow_time, from: None, fault: fault.name() }
    };
    models.flat_map(ModelSpec::trainings).map(of).collect()
}

/// The pairs with a fault.
fn changed(pairs: &Pairs, fault: Fault, seed: u64, name: &str) -> Result<Pairs, Error> {
    match fault {
        Fault::None => Ok(pairs.clone()),
        Fault::Noise(level) => {
            // The same draw at every level.
            let mut stream = Stream::new(seed, &format!("noise/{name}"));
            let mut noisy =
                |rows: &[f64]| rows.iter().map(|v| level.mul_add(stream.normal(), *v)).collect();
            let (input, output) = (noisy(pairs.input()), noisy(pairs.output()));
            Pairs::new("noise", pairs.dof(), input, output)
        }
        Fault::Gap(_, gap) => {
            let rows = pairs.input().chunks_exact(2 * pairs.dof()).enumerate();
            let kept: Vec<usize> =
                rows.filter(|(_, z)| !gap.holds(z)).map(|(row, _)| row).collect();
            Error::check_count_range("pairs outside of the gap", kept.len(), 1, MOST)?;
            Ok(pairs.rows(kept))
        }
    }
}

impl NoiseOptions {
    /// The pairs of the scene with a fault.
    fn changed(&self, context: &mut Context<'_>, fault: Fault) -> Result<DataSets, RunError> {
        let (clean, seed) = (context.data()?, context.scene.seed);
        let (system, time) = (context.system()?, context.flow_time()?);
        Ok(clean.changed(&mut |name, pairs| changed(pairs, fault, seed, name), system, time)?)
    }

    /// The faults of the pairs: first `Fault::None`, then each level of noise, then each gap.
    fn faults(&self) -> impl Iterator<Item = Fault> {
        let noise = self.levels.iter().map(|level| Fault::Noise(*level));
        let gaps = self.gaps.iter().enumerate().map(|(k, gap)| Fault::Gap(k + 1, *gap));
        [Fault::None].into_iter().chain(noise).chain(gaps)
    }

    fn words(&self, of_several: bool) -> String {
        let mut words = format!(
            "Normal noise is added to each component of inputs and outputs, training and held out. The table has the error on \
             held-out pairs with that noise, and on the same pairs without it, which a user does not have. Noise of σ leaves an \
             error of some σ√2 on the former, however good the map is. Roll-outs are of {} steps from {} points.",
            self.steps,
            self.initial.len()
        );
        if !self.gaps.is_empty() {
            words.push_str(
                " Pairs with a gap have none in it, training and held out; the errors without it are on all pairs that \
                 are held out, and on those in the gap.",
            );
        }
        if of_several {
            words.push_str(" Numbers are medians over the initial weights of a network.");
        }
        words
    }
}

/// Whether a network was trained from several initial weights.
fn of_several(found: &[Found]) -> bool {
    found.iter().any(|of| of.seeds.len() > 1)
}

/// A number of one set of initial weights.
type Number = fn(&OfSeed) -> Option<f64>;

fn table(found: &[Found]) -> Table {
    let of_several = of_several(found);
    let numbers: [(&str, Format, Number); 5] = [
        ("held-out error, rms of a component", Format::Exponent(1), |of| of.held_out),
        ("without the noise or the gap", Format::Exponent(1), |of| of.clean),
        ("in the gap", Format::Exponent(1), |of| of.in_gap),
        ("roll-out, rms distance", Format::Exponent(1), |of| of.rollout),
        ("own invariant changes by", Format::Percent, |of| of.own),
    ];
    let mut columns = vec![("pairs have", Format::Exact), ("network", Format::Exact)];
    for (name, format, _) in numbers {
        columns.push((name, format));
        columns.extend(of_several.then_some(("worst", format)));
    }
    columns.push(("verdict", Format::Exact));
    let mut table = Table::new(columns);
    for of in found {
        let mut row = vec![of.fault.clone().into(), format!("`{}`", of.network).into()];
        for (_, _, pick) in numbers {
            let MedianAndWorst { median, worst } = of.over_seeds(pick);
            row.push(median.into());
            row.extend(of_several.then(|| worst.into()));
        }
        row.push(of.verdicts().into());
        table.push(row);
    }
    table
}

fn reasons(found: &[Found]) -> String {
    let of = |of: &Found| {
        let first = of.seeds.first()?;
        let reasons = if first.reasons.is_empty() {
            "no reason against it".into()
        } else {
            first.reasons.join("; ")
        };
        let beyond = match first.without_pairs {
            None | Some(0.0) => String::new(),
            Some(share) => format!(
                " {} of the states of its roll-out are where no pairs are.",
                Format::Percent.number(share)
            ),
        };
        Some(format!("- {}, `{}`: {}: {reasons}.{beyond}", of.fault, of.network, first.verdict))
    };
    let lines = found.iter().filter_map(of).collect::<Vec<_>>().join("\n");
    match of_several(found) {
        true => format!("Reasons, for the first of the initial weights:\n\n{lines}"),
        false => lines,
    }
}

fn figure(found: &[Found]) -> Figure {
    let mut names: Vec<&str> = Vec::new();
    for of in found {
        if !names.contains(&&of.network[..]) {
            names.push(&of.network);
        }
    }
    let panel = |title: &str, pick: Number| {
        let series = names.iter().enumerate().map(|(color, name)| {
            let of = found.iter().filter(|of| of.network == *name);
            let points = of.filter_map(|of| Some((of.level?, of.over_seeds(pick).median?)));
            Series {
                name: (*name).to_owned(),
                color,
                style: Style::Marked,
                points: points.collect(),
            }
        });
        Panel {
            title: title.into(),
            x_label: "noise".into(),
            y_label: "rms".into(),
            x: Axis::Log,
            y: Axis::Log,
            series: series.collect(),
            ..Panel::default()
        }
    };
    Figure::in_a_row(
        FIGURE,
        "Against the noise of the pairs: the error of a step against the flow itself, and the distance \
         over the roll-out; medians, where there are several initial weights.",
        vec![panel("one step", |of| of.clean), panel("roll-out", |of| of.rollout)],
    )
}
