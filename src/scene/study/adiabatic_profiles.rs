//! The adiabatic invariant of a random gyroceptron along its orbit, for several ε.

use super::random_network::RandomNetwork;
use super::rollout::{envelope, epsilon_name};
use super::shared::Study;
use crate::error::Error;
use crate::flow::Trajectories;
use crate::measure::trajectories::{Drift, drift, drift_exponent};
use crate::network::{Rollout, rollout};
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::setup::{MOST, Need};
use serde::{Deserialize, Serialize};
use serde_json::json;

const PROFILES: &str = "adiabatic-profiles";

/// The adiabatic invariant of a random gyroceptron along its orbit, for several ε.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdiabaticProfilesOptions {
    /// The values of ε, all positive.
    pub epsilons: Vec<f64>,
    /// The number of applications of the map along the orbit, at least 100.
    pub iterations: usize,
    /// The gyroceptron, apart from its ε and the seed of its weights.
    pub network: RandomNetwork,
}

impl Study for AdiabaticProfilesOptions {
    fn name(&self) -> &'static str {
        "adiabatic_profiles"
    }

    fn needs(&self) -> &'static [Need] {
        &[]
    }

    fn check(&self, _: &Declared<'_>) -> Result<(), Error> {
        Error::check_count_range("iterations", self.iterations, 100, MOST)?;
        Error::check_count_range("epsilons", self.epsilons.len(), 1, MOST)?;
        for epsilon in &self.epsilons {
            Error::check_range("epsilons", *epsilon, Error::LEAST_POSITIVE, f64::MAX)?;
        }
        self.network.check()
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![PROFILES]
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let seed = context.scene.seed;
        let request = Rollout { steps: self.iterations, every: 1 };
        let mut each = Vec::new();
        for &epsilon in &self.epsilons {
            let network = self.network.draw(epsilon, seed)?;
            let name = format!("μ at ε = {epsilon:e}");
            let states = context
                .stage(&name, |_| rollout(network.composition(), &self.network.initial, request))?;
            let values = Trajectories::new(network.adiabatic_invariant(&states), 1, 1)?;
            each.push(Profile {
                epsilon,
                drift: drift(values.orbit(0).map(|mu| mu[0])),
                exponent: drift_exponent(&values, |mu| mu[0]),
                values,
            });
        }
        let text = format!(
            "μ = 𝔍₀∘ψ⁻¹ along {} iterations of a gyroceptron with random weights. {}.",
            self.iterations,
            self.network.words()
        );
        let figures = match context.draws(PROFILES) {
            true => vec![figure(&each)],
            false => Vec::new(),
        };
        let data = each.iter().map(Profile::data).collect();
        Ok(Findings {
            title: "Profiles of the adiabatic invariant".into(),
            results: Section {
                summary: vec![Block::Text(text), Block::Table(table(&each))],
                data,
                ..Section::default()
            },
            figures,
            ..Findings::default()
        })
    }
}

/// μ along the orbit at one ε.
struct Profile {
    epsilon: f64,
    values: Trajectories,
    drift: Drift,
    exponent: f64,
}

impl Profile {
    fn data(&self) -> serde_json::Value {
        json!({ "epsilon": self.epsilon, "drift": self.drift, "exponent": self.exponent })
    }
}

fn table(each: &[Profile]) -> Table {
    let mut table = Table::new([
        ("ε", Format::Setting),
        ("μ at the start", Format::Fixed(6)),
        ("largest |μ − μ(0)|", Format::Exponent(2)),
        ("over ε", Format::Magnitude),
        ("exponent in N", Format::Fixed(2)),
    ]);
    for of in each {
        table.push([
            of.epsilon.into(),
            of.drift.initial.into(),
            of.drift.largest.into(),
            (of.drift.largest / of.epsilon).into(),
            of.exponent.into(),
        ]);
    }
    table
}

/// A panel for each ε, each with its own scale of μ − μ(0): they differ by powers of
/// ten.
fn figure(each: &[Profile]) -> Figure {
    let panel = |of: &Profile| {
        let values: Vec<f64> = of.values.orbit(0).map(|mu| mu[0] - of.drift.initial).collect();
        let [lower, upper] = envelope(&values, 1.0);
        let every = values.len().div_ceil(1000);
        let some = values.iter().enumerate().step_by(every).map(|(n, v)| (n as f64, *v)).collect();
        let name = |name: &str| name.to_owned();
        Panel {
            title: epsilon_name(of.epsilon),
            x_label: "iterations".into(),
            y_label: "μ − μ(0)".into(),
            series: vec![
                Series { name: name("μ − μ(0)"), color: 5, style: Style::Dots, points: some },
                Series { name: name("envelope"), color: 0, style: Style::Line, points: upper },
                Series::unnamed(0, Style::Line, lower),
            ],
            ..Panel::default()
        }
    };
    let panels: Vec<Panel> = each.iter().map(panel).collect();
    let caption = "The adiabatic invariant of a gyroceptron with random weights along its orbit, for \
                   each ε on a scale of its own.";
    let figure = Figure::in_a_row(PROFILES, caption, panels);
    Figure { columns: 2, ..figure }
}
