//! The adiabatic invariant that a network owns: its order in ε, with the weights as they are.

use super::shared::{Study, check_along};
use crate::error::Error;
use crate::flow::Trajectories;
use crate::measure::adiabatic::{FittedLine, SeriesInvariant, disturbing_resonance, log_line};
use crate::network::{Model, Rollout};
use crate::scalar::max_or_nan;
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Axis, Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::setup::Need;
use serde::{Deserialize, Serialize};
use serde_json::json;

const FIGURE: &str = "own-invariant";

/// ε of a network over these, two decades.
const FACTORS: [f64; 5] = [1.0, 3.162_277_660_168_379_5, 10.0, 31.622_776_601_683_793, 100.0];

/// The angles on the circle through a point that μ₁ and μ₂ are computed from.
const ANGLES: usize = 64;

/// μ₂, which costs some thousand times as much as μ₁, is computed at one in so many of the states.
const SPARSE: usize = 5;

/// The adiabatic invariant that a network owns: its order in ε, with the weights as they are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OwnInvariantOptions {
    /// The number of applications of each network along an orbit.
    pub steps: usize,
    /// One state in so many is looked at.
    pub every: usize,
    /// The initial points of the orbits, 2n numbers each.
    pub initial: Vec<Vec<f64>>,
}

impl Study for OwnInvariantOptions {
    fn name(&self) -> &'static str {
        "own_invariant"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::System, Need::FlowTime, Need::Data, Need::Models]
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        check_along(scene, self.steps, self.every, &self.initial)
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![FIGURE]
    }

    fn shorten(&mut self) {
        self.steps = self.steps.min(20 * self.every);
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let models = context.models()?;
        let mut found = Vec::new();
        for trained in models.iter() {
            let name = &trained.spec.name;
            let stage = format!("own invariant of {name}");
            found.extend(context.stage(&stage, |_| self.of(name, trained.model()))?);
        }
        let figures = match context.draws(FIGURE) {
            true => vec![figure(&found)],
            false => Vec::new(),
        };
        let mut summary = vec![Block::Text(self.words())];
        summary.extend(found.iter().map(|of| Block::Text(of.words())));
        let mut table = Table::new([
            ("network", Format::Exact),
            ("ε", Format::Setting),
            ("largest change of μ₀ over μ₀", Format::Exponent(2)),
            ("of μ₀ + εμ₁", Format::Exponent(2)),
            ("of μ₀ + εμ₁ + ε²μ₂", Format::Exponent(2)),
        ]);
        for of in &found {
            for (number, epsilon) in of.epsilons.iter().enumerate() {
                let name = format!("`{}`", of.name);
                let [leading, next, second] = of.series().map(|(_, changes)| changes[number]);
                let changes = [leading.into(), next.into(), second.into()];
                table.push([name.into(), (*epsilon).into()].into_iter().chain(changes));
            }
        }
        summary.push(Block::Table(table));
        Ok(Findings {
            title: "The invariant that a network owns".into(),
            results: Section { summary, data: json!(found), ..Section::default() },
            figures,
            ..Findings::default()
        })
    }
}

/// What was found of a network.
#[derive(Serialize)]
struct Found {
    name: String,
    epsilons: Vec<f64>,
    /// Of each ε, the largest |μ − μ(0)|/|μ₀(0)| along all orbits, of μ = μ₀, μ₀ + εμ₁ and μ₀ + εμ₁ + ε²μ₂.
    leading: Vec<f64>,
    next: Vec<f64>,
    second: Vec<f64>,
    /// Exponents of ε in them, with their standard errors.
    leading_order: (f64, f64),
    next_order: (f64, f64),
    second_order: (f64, f64),
    /// The resonance that disturbs it at its own ε, if there is one.
    resonance: Option<String>,
}

impl OwnInvariantOptions {
    /// None of networks that own no adiabatic invariant.
    fn of(&self, name: &str, model: &Model) -> Result<Option<Found>, Error> {
        if SeriesInvariant::new(model, ANGLES).is_none() {
            return Ok(None);
        }
        let own = model.epsilon();
        let epsilons = FACTORS.map(|factor| own / factor);
        let (mut leading, mut next, mut second) = (Vec::new(), Vec::new(), Vec::new());
        for epsilon in epsilons {
            let [of_leading, of_next, of_second] = self.changes(&model.with_epsilon(epsilon))?;
            leading.push(of_leading);
            next.push(of_next);
            second.push(of_second);
        }
        let order = |changes: &[f64]| {
            let FittedLine { slope, slope_error, .. } = log_line(&epsilons, changes);
            (slope, slope_error)
        };
        let circles = model.architecture().circles.iter().zip(model.angles());
        let mut near =
            circles.filter_map(|(circle, theta)| disturbing_resonance(circle, *theta, own));
        Ok(Some(Found {
            name: name.to_owned(),
            leading_order: order(&leading),
            next_order: order(&next),
            second_order: order(&second),
            epsilons: epsilons.to_vec(),
            leading,
            next,
            second,
            resonance: near.next().map(|resonance| resonance.to_string()),
        }))
    }

    /// The largest changes over μ₀ of the series of one, two and three terms, along orbits from all initial points.
    fn changes(&self, model: &Model) -> Result<[f64; 3], Error> {
        let (dim, count) = (2 * model.composition().dof(), self.initial.len());
        let epsilon = model.epsilon();
        let request = Rollout { steps: self.steps, every: self.every };
        let states = model.rollout(&self.initial.concat(), request)?;
        let states = Trajectories::new(states, dim, count)?;
        let Some(series) = SeriesInvariant::new(model, ANGLES) else { return Ok([f64::NAN; 3]) };
        let mut largest = [0.0; 3];
        for m in 0..count {
            let mut at_start = Vec::new();
            for (number, z) in states.orbit(m).enumerate() {
                let mut sums = if number % SPARSE == 0 {
                    series.terms(z)?.to_vec()
                } else {
                    let (leading, next) = series.evaluate(z)?;
                    vec![leading, next]
                };
                let mut power = 1.0;
                for k in 1..sums.len() {
                    power *= epsilon;
                    sums[k] = sums[k - 1] + power * sums[k];
                }
                if number == 0 {
                    at_start.clone_from(&sums);
                }
                for ((largest, sum), start) in largest.iter_mut().zip(&sums).zip(&at_start) {
                    *largest = max_or_nan(*largest, (sum - start).abs() / at_start[0].abs());
                }
            }
        }
        Ok(largest)
    }

    fn words(&self) -> String {
        format!(
            "A gyroceptron owns a formal series μ₀ + εμ₁ + … for every weight: it shows in the order \
             in ε, not the \
             size at one. With the weights as they are and ε lowered over two decades, the changes along {} orbits of \
             {} steps, each looked at {} times, and {} times with μ₂. μ₁ and μ₂ solve the equations of first and \
             second order on the circle through a point, by {ANGLES} angles.",
            self.initial.len(),
            self.steps,
            self.steps / self.every + 1,
            self.steps / self.every / SPARSE + 1
        )
    }
}

impl Found {
    /// The changes of each partial sum of the series, by its name.
    fn series(&self) -> [(&'static str, &[f64]); 3] {
        [("μ₀", &self.leading), ("μ₀ + εμ₁", &self.next), ("μ₀ + εμ₁ + ε²μ₂", &self.second)]
    }

    fn words(&self) -> String {
        let size = |changes: &[f64]| changes.first().copied().unwrap_or(f64::NAN);
        let resonance = self.resonance.as_ref();
        let resonance = resonance
            .map(|near| format!(" Its angle is near a resonance, {near}, which adds to all."));
        format!(
            "- `{}`: μ₀ changes as ε to the power {:.2} ± {:.2}, μ₀ + εμ₁ as {:.2} ± {:.2}, with ε²μ₂ as {:.2} ± \
             {:.2}; at ε = {} by up to {}, {} and {}.{}",
            self.name,
            self.leading_order.0,
            self.leading_order.1,
            self.next_order.0,
            self.next_order.1,
            self.second_order.0,
            self.second_order.1,
            self.epsilons.first().copied().unwrap_or(f64::NAN),
            Format::Percent.number(size(&self.leading)),
            Format::Percent.number(size(&self.next)),
            Format::Percent.number(size(&self.second)),
            resonance.unwrap_or_default()
        )
    }
}

fn figure(found: &[Found]) -> Figure {
    let mut series = Vec::new();
    for (color, of) in found.iter().enumerate() {
        for (number, (what, changes)) in of.series().into_iter().enumerate() {
            let (name, color) = (format!("{}, {what}", of.name), 3 * color + number);
            let points = of.epsilons.iter().copied().zip(changes.iter().copied()).collect();
            series.push(Series { name, color, style: Style::Marked, points });
        }
    }
    let panel = Panel {
        title: "own invariant, weights as trained".into(),
        x_label: "ε".into(),
        y_label: "largest change over μ₀".into(),
        x: Axis::Log,
        y: Axis::Log,
        series,
        ..Panel::default()
    };
    Figure::in_a_row(
        FIGURE,
        "The largest change of the invariant that each network owns along its own orbits, against ε with \
         the weights as they are.",
        vec![panel],
    )
}
