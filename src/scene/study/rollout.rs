//! The trajectories of each network beside the reference.

use super::{AnyStudy, Study};
use crate::error::Error;
use crate::flow::{ReferenceTrajectories, Trajectories};
use crate::measure::{Departure, Drift, departures, distances_along, drifts, level_set};
use crate::network::Rollout;
use crate::scalar::max_or_nan;
use crate::scene::bibliography::GAUSS_LEGENDRE;
use crate::scene::context::{Context, Halt};
use crate::scene::declaration::Scene;
use crate::scene::figure::{Axis, Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::learning::Trained;
use crate::scene::setup::{Need, check_points};
use crate::system::{Hamiltonian, Oscillators, System};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::rc::Rc;

const PORTRAIT: &str = "portrait";
const INVARIANT: &str = "adiabatic-invariant";
const ERROR: &str = "rollout-error";

/// Trajectories of the networks beside the reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RolloutOptions {
    /// Applications of the map.
    pub steps: usize,
    /// One state in so many is kept.
    pub every: usize,
    /// The initial points, 2n numbers each.
    pub initial: Vec<Vec<f64>>,
}

impl RolloutOptions {
    /// Those of the scene, if it has any: its trajectories may be asked for by other
    /// studies.
    pub(super) fn of(scene: &Scene) -> Option<&Self> {
        scene.studies.iter().find_map(|study| match study {
            AnyStudy::Rollout(options) => Some(options),
            _ => None,
        })
    }

    pub(super) fn request(&self) -> Rollout {
        Rollout { steps: self.steps, every: self.every }
    }

    /// The trajectories of the reference.
    pub(super) fn reference(
        &self,
        context: &mut Context<'_>,
    ) -> Result<Rc<ReferenceTrajectories>, Halt> {
        let (system, interval) = (context.system()?, self.interval(context.flow_time()?));
        context.reference(system, &self.initial, interval, self.request().kept())
    }

    /// The time between two states that are kept.
    pub(super) fn interval(&self, flow_time: f64) -> f64 {
        flow_time * self.every as f64
    }
}

impl Study for RolloutOptions {
    fn name(&self) -> &'static str {
        "rollout"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::System, Need::FlowTime]
    }

    fn check(&self, scene: &Scene) -> Result<(), Error> {
        for (key, value) in [("steps", self.steps), ("every", self.every)] {
            Error::check_count_range(key, value, 1, usize::MAX)?;
        }
        match &scene.setup.system {
            Some(system) => check_points("initial", &self.initial, system.dof()),
            None => Ok(()),
        }
    }

    /// The portrait is of the slow plane of the oscillators.
    fn figures(&self, scene: &Scene) -> Vec<&'static str> {
        match scene.setup.system {
            Some(System::Oscillators(_)) => vec![PORTRAIT, INVARIANT, ERROR],
            _ => vec![INVARIANT, ERROR],
        }
    }

    fn cites(&self) -> Vec<&'static str> {
        vec![GAUSS_LEGENDRE]
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, Halt> {
        let (system, flow_time) = (context.system()?, context.flow_time()?);
        let found = self.reference(context)?;
        let reference = &found.trajectories;
        let reference_adiabatic = drifts(reference, |z| system.adiabatic_invariant(z));
        let (mut models, mut moved) = (Vec::new(), Rc::default());
        if !context.scene.setup.models.is_empty() {
            models = context.models()?;
            moved = context.rollouts(&self.initial, self.request())?;
        }
        let networks: Vec<Network<'_>> = models
            .iter()
            .zip(moved.iter())
            .map(|(trained, trajectories)| Network::new(trained, trajectories, reference))
            .collect();

        let text = format!(
            "{} steps (time {}), one state in {} kept; the reference's own error at the end is {:.1e}.",
            self.steps,
            self.steps as f64 * flow_time,
            self.every,
            found.error
        );
        let mut details = vec![Block::Text(text)];
        if networks.is_empty() {
            details.push(Block::Table(self.table(None, &reference_adiabatic)));
        }
        for network in &networks {
            details.push(Block::Heading(format!("`{}`", network.name)));
            details.push(Block::Table(self.table(Some(network), &reference_adiabatic)));
        }
        let mut figures = Vec::new();
        if context.draws(PORTRAIT) {
            figures.push(self.portrait(reference, &networks));
        }
        let interval = self.interval(flow_time);
        if context.draws(INVARIANT) {
            figures.push(invariants(system, interval, reference, &networks));
        }
        if context.draws(ERROR) && !networks.is_empty() {
            figures.push(errors(interval, reference, &networks));
        }
        let summary = match networks.is_empty() {
            true => Vec::new(),
            false => vec![Block::Table(overview(&networks))],
        };
        let data = json!({
            "reference_error": found.error,
            "reference_adiabatic": reference_adiabatic,
            "models": networks.iter().map(Network::data).collect::<Vec<_>>(),
        });
        Ok(Findings {
            title: "Roll-out".into(),
            results: Section { summary, details, data },
            figures,
            ..Findings::default()
        })
    }
}

/// A network along its trajectories.
struct Network<'a> {
    name: &'a str,
    trajectories: &'a Trajectories,
    departures: Vec<Departure>,
    /// μ₀ = 𝔍₀∘ψ⁻¹ of each state, where the network has it.
    invariant: Option<Trajectories>,
}

impl<'a> Network<'a> {
    fn new(trained: &'a Trained, trajectories: &'a Trajectories, reference: &Trajectories) -> Self {
        let invariant = trained.model().gyroceptron().and_then(|network| {
            let values = network.adiabatic_invariant(trajectories.values());
            Trajectories::new(values, 1, trajectories.count()).ok()
        });
        let departures = departures(trajectories, reference);
        Self { name: &trained.spec.name, trajectories, departures, invariant }
    }

    fn drifts(&self) -> Option<Vec<Drift>> {
        Some(drifts(self.invariant.as_ref()?, |mu| mu[0]))
    }

    fn data(&self) -> serde_json::Value {
        json!({
            "name": self.name,
            "largest_errors": self.departures.iter().map(|d| d.largest).collect::<Vec<_>>(),
            "final_errors": self.departures.iter().map(|d| d.last).collect::<Vec<_>>(),
            "adiabatic": self.drifts(),
        })
    }
}

fn overview(networks: &[Network<'_>]) -> Table {
    let mut table = Table::new([
        ("network", Format::Exact),
        ("largest roll-out distance from the reference", Format::Exponent(3)),
        ("largest drift of its μ₀", Format::Exponent(3)),
    ]);
    for network in networks {
        let largest = |values: Vec<f64>| values.into_iter().fold(0.0, max_or_nan);
        let drift = network.drifts().map(|all| largest(all.iter().map(|d| d.largest).collect()));
        table.push([
            format!("`{}`", network.name).into(),
            largest(network.departures.iter().map(|d| d.largest).collect()).into(),
            drift.into(),
        ]);
    }
    table
}

impl RolloutOptions {
    fn table(&self, network: Option<&Network<'_>>, reference_adiabatic: &[Drift]) -> Table {
        let mut table = Table::new([
            ("from", Format::Exact),
            ("largest distance from the reference", Format::Exponent(2)),
            ("at the end", Format::Exponent(2)),
            ("μ₀ of the network at the start", Format::Fixed(6)),
            ("its largest drift", Format::Exponent(2)),
            ("μ₀ of the system at the start", Format::Fixed(6)),
            ("its largest drift", Format::Exponent(2)),
        ]);
        let drifts = network.and_then(Network::drifts);
        for (k, point) in self.initial.iter().enumerate() {
            let departure = network.map(|network| network.departures[k]);
            let drift = drifts.as_ref().map(|drifts| drifts[k]);
            table.push([
                format!("{point:?}").into(),
                departure.map(|d| d.largest).into(),
                departure.map(|d| d.last).into(),
                drift.map(|d| d.initial).into(),
                drift.map(|d| d.largest).into(),
                reference_adiabatic[k].initial.into(),
                reference_adiabatic[k].largest.into(),
            ]);
        }
        table
    }

    fn portrait(&self, reference: &Trajectories, networks: &[Network<'_>]) -> Figure {
        // (q₂, p₂).
        let (i, k) = (reference.dim() / 2 - 1, reference.dim() - 1);
        let panel = |title: &str, trajectories: &Trajectories| {
            let mut series: Vec<_> = self.initial.iter().filter_map(|z| averaged(z)).collect();
            for m in 0..trajectories.count() {
                let points = trajectories.of(m).map(|z| (z[i], z[k])).collect();
                series.push(Series::unnamed(m, Style::Dots, points));
            }
            Panel {
                title: title.into(),
                x_label: "q₂".into(),
                y_label: "p₂".into(),
                square: true,
                series,
                ..Panel::default()
            }
        };
        let mut panels = vec![panel("Reference", reference)];
        panels.extend(networks.iter().map(|network| panel(network.name, network.trajectories)));
        Figure::in_a_row(
            PORTRAIT,
            "The slow plane: reference trajectories over the level sets of the averaged \
             Hamiltonian through their initial points (grey), and the trajectories of each network.",
            panels,
        )
    }
}

/// The level set of the averaged Hamiltonian through an initial point, once around.
fn averaged(z: &[f64]) -> Option<Series> {
    const STEPS: usize = 600;
    const INTERVAL: f64 = 0.02;
    const GREY: usize = 6;
    let (averaged, start) = Oscillators::averaged(z.try_into().ok()?);
    let points = level_set(&averaged, start, INTERVAL, STEPS).ok()?;
    Some(Series::unnamed(GREY, Style::Faint, points))
}

fn invariants(
    system: &System,
    interval: f64,
    reference: &Trajectories,
    networks: &[Network<'_>],
) -> Figure {
    let panel = |title: String, of: &Trajectories, value: &dyn Fn(&[f64]) -> f64| {
        let change = |m: usize| {
            let initial = value(of.state(0, m));
            let points = of.of(m).enumerate();
            points.map(|(t, z)| (t as f64 * interval, value(z) - initial)).collect()
        };
        let series = (0..of.count()).map(|m| Series::unnamed(m, Style::Faint, change(m))).collect();
        Panel {
            title,
            x_label: "time".into(),
            y_label: "μ₀ − μ₀(0)".into(),
            series,
            ..Panel::default()
        }
    };
    let of_system = |z: &[f64]| system.adiabatic_invariant(z);
    let mut panels = vec![panel("μ₀ of the system, reference".into(), reference, &of_system)];
    for network in networks {
        if let Some(invariant) = &network.invariant {
            panels
                .push(panel(format!("μ₀ of {}, its own", network.name), invariant, &|mu| mu[0]));
        }
    }
    Figure::in_a_row(
        INVARIANT,
        "The change of the leading adiabatic invariant: of the system along the reference \
         trajectories, and of each network, μ₀ = 𝔍₀∘ψ⁻¹, along its own.",
        panels,
    )
}

fn errors(interval: f64, reference: &Trajectories, networks: &[Network<'_>]) -> Figure {
    let panel = |network: &Network<'_>| {
        let along = |m: usize| {
            let errors = distances_along(network.trajectories, reference, m).enumerate();
            errors.skip(1).map(|(t, error)| (t as f64 * interval, error)).collect()
        };
        let count = reference.count();
        Panel {
            title: format!("Distance from the reference: {}", network.name),
            x_label: "time".into(),
            y_label: "|z − reference|".into(),
            y: Axis::Log,
            series: (0..count).map(|m| Series::unnamed(m, Style::Line, along(m))).collect(),
            ..Panel::default()
        }
    };
    let panels = networks.iter().map(panel).collect();
    Figure::in_a_row(ERROR, "Distance of each trajectory from the reference.", panels)
}
