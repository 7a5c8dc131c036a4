//! The actions of a system's torus, and those that networks have learnt.

use super::over_seeds::{data_of_rollouts, rollouts_of_seeds, words_of_rollouts};
use super::shared::{Study, check_along};
use crate::error::Error;
use crate::flow::Trajectories;
use crate::layer::CircleAction;
use crate::measure::{
    timing::root_mean_square_distance,
    trajectories::{drifts, root_mean_square},
};
use crate::network::Rollout;
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::setup::Need;
use crate::system::{Hamiltonian, NearlyPeriodic, System};
use serde::{Deserialize, Serialize};
use serde_json::json;

const FIGURE: &str = "actions";

/// How the actions of the limit, and those of each network, change along trajectories of the reference, and along
/// the network's own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActionsOptions {
    /// The number of applications of each network.
    pub steps: usize,
    /// The number of applications between two states that are kept.
    pub every: usize,
    /// The initial points of the trajectories, 2n numbers each.
    pub initial: Vec<Vec<f64>>,
}

impl Study for ActionsOptions {
    fn name(&self) -> &'static str {
        "actions"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::System, Need::FlowTime, Need::Data, Need::Models]
    }

    fn is_of_invariants(&self) -> bool {
        true
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        check_along(scene, self.steps, self.every, &self.initial)
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![FIGURE]
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let (system, time, models) = (context.system()?, context.flow_time()?, context.models()?);
        let interval = self.every as f64 * time;
        let states = self.steps / self.every + 1;
        let reference = context.reference(system, &self.initial, interval, states)?;
        let along = &reference.trajectories;
        let request = Rollout { steps: self.steps, every: self.every };
        let rolled = context.rollouts(&self.initial, request)?;
        let (torus, _) = system.torus();
        let mut all = Vec::new();
        // Those of a torus are of its planes; the planes of one circle may be bent.
        if torus.circles().len() > 1 {
            for circle in torus.circles() {
                all.push(Action::new("the limit", circle, along, None, &|z| circle.invariant(z)));
            }
        }
        let (circle, action) = (system.circle_action(), |z: &[f64]| system.adiabatic_invariant(z));
        all.push(Action::new("the limit", &circle, along, None, &action));
        let mut distances = Vec::new();
        for (trained, own) in models.iter().zip(rolled.iter()) {
            let name = format!("`{}`", trained.spec.name);
            for (circle, invariant) in trained.model().invariants() {
                all.push(Action::new(&name, &circle, along, Some(own), &*invariant));
            }
            let dim = 2 * system.dof();
            let distance = root_mean_square_distance(own.values(), along.values(), dim);
            distances.push((name, distance));
        }
        let seeds = rollouts_of_seeds(context, &self.initial, request, along)?;
        let found = Results { interval, all, distances };
        let text = format!(
            "Along {} trajectories of time {}, {states} states of each: the root mean square over the trajectories of the \
             largest |𝔍 − 𝔍(0)|. An action of the limit is 𝔍 of its circle, that of a network 𝔍 of its circle in the \
             coordinates of its chart. Error of the reference at the end: {:.1e}.",
            self.initial.len(),
            self.steps as f64 * time,
            reference.error
        );
        let figures = match context.draws(FIGURE) {
            true => vec![found.figure()],
            false => Vec::new(),
        };
        let mut summary = vec![
            Block::Table(found.changes()),
            Block::Table(found.distances()),
            Block::Text(resonance(context.system()?)),
        ];
        let mut data = json!({ "actions": found.all, "distances": found.distances });
        if !seeds.is_empty() {
            summary.push(Block::Text(words_of_rollouts(&seeds)));
            data["seeds"] = data_of_rollouts(&seeds);
        }
        Ok(Findings {
            title: "Actions".into(),
            results: Section { summary, details: vec![Block::Text(text)], data },
            figures,
            ..Findings::default()
        })
    }
}

/// The largest |k₁| + |k₂| + … of a harmonic that is looked at.
const ORDER: i32 = 6;
/// A harmonic is slow that turns by less than so many times ε in unit time: it is as slow as what
/// the fast motion is averaged for.
const SLOW: f64 = 10.0;

/// The slowest harmonic of the frequencies of a torus.
fn resonance(system: &System) -> String {
    let (_, frequencies) = system.torus();
    if frequencies.len() < 2 {
        return "The limit turns along circles: no harmonic of several frequencies is slow.".into();
    }
    let side = 2 * ORDER + 1;
    let of = |number: i32| -> Vec<i32> {
        (0..frequencies.len()).map(|a| number / side.pow(a as u32) % side - ORDER).collect()
    };
    let rate =
        |k: &Vec<i32>| k.iter().zip(&frequencies).map(|(k, w)| f64::from(*k) * w).sum::<f64>();
    let order = |k: &Vec<i32>| k.iter().map(|k| k.abs()).sum::<i32>();
    let harmonics = (0..side.pow(frequencies.len() as u32)).map(of);
    let wanted = harmonics.filter(|k| {
        let first = k.iter().find(|k| **k != 0);
        let primitive = || CircleAction::new(k.as_slice()).common_factor() == 1;
        first.is_some_and(|first| *first > 0) && order(k) <= ORDER && primitive()
    });
    let slowest = wanted.min_by(|a, b| rate(a).abs().total_cmp(&rate(b).abs()));
    let Some(slowest) = slowest else { return String::new() };
    let names: Vec<String> = slowest.iter().map(i32::to_string).collect();
    let (rate, epsilon) = (rate(&slowest), system.epsilon());
    let of_several = slowest.iter().filter(|k| **k != 0).count() > 1;
    let what = match rate.abs() < SLOW * epsilon.abs() {
        _ if epsilon == 0.0 => format!("turns by {:.1e} in unit time, and ε is 0", rate.abs()),
        true if of_several => format!(
            "is as slow as the slow motion, {:.1} ε in unit time: it is no fast angle to average over. Along it actions \
             may be exchanged; what stays are combinations that the harmonic leaves alone, and a network that \
             keeps each action cannot follow",
            (rate / epsilon).abs()
        ),
        true => format!(
            "is as slow as the slow motion, {:.1} ε in unit time: that circle is no fast one, and its action may \
             change",
            (rate / epsilon).abs()
        ),
        false => format!(
            "turns by {:.0} ε in unit time: each action is an adiabatic invariant",
            (rate / epsilon).abs()
        ),
    };
    format!(
        "Of the harmonics k·ω up to order {ORDER} the slowest, k = ({}), {what}.",
        names.join(", ")
    )
}

/// An action of the limit or of a network, and its changes along trajectories.
#[derive(Serialize)]
struct Action {
    /// The name of what it is the action of.
    of: String,
    circle: CircleAction,
    /// The root mean square of its values at the start.
    size: f64,
    /// How it changes along the reference.
    reference: f64,
    /// How it changes along the network's own trajectories.
    own: Option<f64>,
    /// Along the first trajectory of the reference.
    #[serde(skip)]
    first: Vec<f64>,
}

impl Action {
    fn new(
        of: &str,
        circle: &CircleAction,
        reference: &Trajectories,
        own: Option<&Trajectories>,
        action: &dyn Fn(&[f64]) -> f64,
    ) -> Self {
        let change = |along: &Trajectories| {
            let largest: Vec<f64> = drifts(along, action).iter().map(|d| d.largest).collect();
            root_mean_square(&largest)
        };
        let starts: Vec<f64> =
            (0..reference.count()).map(|m| action(reference.state(0, m))).collect();
        Self {
            of: of.to_owned(),
            circle: circle.clone(),
            size: root_mean_square(&starts),
            reference: change(reference),
            own: own.map(change),
            first: reference.orbit(0).map(action).collect(),
        }
    }
}

struct Results {
    interval: f64,
    all: Vec<Action>,
    distances: Vec<(String, f64)>,
}

impl Results {
    fn changes(&self) -> Table {
        let mut table = Table::new([
            ("action of", Format::Exact),
            ("circle", Format::Exact),
            ("its size", Format::Magnitude),
            ("change along the reference", Format::Exponent(1)),
            ("of its size", Format::Percent),
            ("along its own trajectories", Format::Exponent(1)),
        ]);
        for one in &self.all {
            table.push([
                one.of.clone().into(),
                one.circle.to_string().into(),
                one.size.into(),
                one.reference.into(),
                (one.reference / one.size).into(),
                one.own.into(),
            ]);
        }
        table
    }

    fn distances(&self) -> Table {
        let mut table = Table::new([
            ("network", Format::Exact),
            ("distance from the reference, rms", Format::Exponent(2)),
        ]);
        for (name, distance) in &self.distances {
            table.push([name.clone().into(), (*distance).into()]);
        }
        table
    }

    /// A panel for each circle.
    fn figure(&self) -> Figure {
        // One colour for each, in all panels.
        let mut names: Vec<&str> = self.all.iter().map(|one| &one.of[..]).collect();
        names.dedup();
        let panel = |circle: &CircleAction| {
            let mut series = Vec::new();
            for one in self.all.iter().filter(|one| one.circle == *circle) {
                let at = |(k, value): (usize, &f64)| (k as f64 * self.interval, *value);
                series.push(Series {
                    name: one.of.replace('`', ""),
                    color: names.iter().position(|name| *name == one.of).unwrap_or(0),
                    style: Style::Line,
                    points: one.first.iter().enumerate().map(at).collect(),
                });
            }
            Panel {
                title: format!("circle {circle}"),
                x_label: "time".into(),
                y_label: "action".into(),
                series,
                ..Panel::default()
            }
        };
        let caption =
            "The actions of the limit and of networks along the first trajectory of the reference.";
        let mut circles: Vec<&CircleAction> = Vec::new();
        for one in &self.all {
            if !circles.contains(&&one.circle) {
                circles.push(&one.circle);
            }
        }
        Figure::in_a_row(FIGURE, caption, circles.into_iter().map(panel).collect())
    }
}
