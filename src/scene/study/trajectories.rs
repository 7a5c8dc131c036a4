//! Trajectories of the system as ε grows, by the reference flow alone.

use super::shared::Study;
use crate::error::Error;
use crate::flow::{ReferenceTrajectories, Trajectories};
use crate::measure::trajectories::{Drift, distance, drifts};
use crate::scalar::max_or_nan;
use crate::scene::bibliography::GAUSS_LEGENDRE;
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Figure, Panel, SameAxes, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::setup::{MOST, Need, check_points};
use crate::scene::words::initial_names;
use crate::system::{Hamiltonian, NearlyPeriodic, System};
use crate::words::subscript;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::rc::Rc;

const TRAJECTORIES: &str = "trajectories";

/// More cannot be distinguished in a figure.
const MOST_EPSILONS: usize = 64;

/// Trajectories for several ε, each from the same points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrajectoriesOptions {
    /// The values of ε, in place of the system's.
    pub epsilons: Vec<f64>,
    /// How many flow times each trajectory is long; the state is kept at each.
    pub steps: usize,
    /// The initial points, 2n numbers each.
    pub initial: Vec<Vec<f64>>,
}

impl Study for TrajectoriesOptions {
    fn name(&self) -> &'static str {
        "trajectories"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::System, Need::FlowTime]
    }

    fn is_of_invariants(&self) -> bool {
        true
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        Error::check_count_range("number of epsilons", self.epsilons.len(), 1, MOST_EPSILONS)?;
        if let Some(bad) = self.epsilons.iter().find(|epsilon| !epsilon.is_finite()) {
            return Err(Error::invalid("epsilons", bad, "finite numbers"));
        }
        Error::check_count_range("steps", self.steps, 1, MOST)?;
        scene.setup.flow_time.map_or(Ok(()), |time| scene.setup.check_repeated(time))?;
        match &scene.setup.system {
            Some(system) => {
                system.check_with(&self.epsilons).map_err(|e| e.with_place("epsilons"))?;
                check_points("initial", &self.initial, system)
            }
            None => Ok(()),
        }
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![TRAJECTORIES]
    }

    fn cites(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![GAUSS_LEGENDRE]
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let (system, interval) = (context.system()?, context.flow_time()?);
        let mut each = Vec::new();
        for &epsilon in &self.epsilons {
            let system = system.clone().with_epsilon(epsilon);
            let reference = context.reference(&system, &self.initial, interval, self.steps + 1)?;
            each.push(OfEpsilon::new(epsilon, &system, reference));
        }
        let figures = match context.draws(TRAJECTORIES) {
            true => vec![figure(&each, &initial_names(&self.initial))],
            false => Vec::new(),
        };
        let text = format!(
            "{} steps of time {interval} by the reference flow. The excursion of a plane (qⱼ, pⱼ) is \
             its largest distance from where it starts.",
            self.steps
        );
        Ok(Findings {
            title: "Trajectories".into(),
            results: Section {
                summary: vec![Block::Table(self.table(&each))],
                details: vec![Block::Text(text)],
                data: each.iter().map(OfEpsilon::data).collect(),
            },
            figures,
            ..Findings::default()
        })
    }
}

/// The trajectories for one ε, and what was measured along each.
struct OfEpsilon {
    epsilon: f64,
    reference: Rc<ReferenceTrajectories>,
    adiabatic: Vec<Drift>,
    energy: Vec<Drift>,
    /// The excursion of each plane, for each trajectory.
    excursions: Vec<Vec<f64>>,
}

impl OfEpsilon {
    fn new(epsilon: f64, system: &System, reference: Rc<ReferenceTrajectories>) -> Self {
        let states = &reference.trajectories;
        Self {
            epsilon,
            adiabatic: drifts(states, |z| system.adiabatic_invariant(z)),
            energy: drifts(states, |z| system.energy(z, 0.0)),
            excursions: (0..states.count()).map(|m| excursions(states, m)).collect(),
            reference,
        }
    }

    fn data(&self) -> serde_json::Value {
        json!({
            "epsilon": self.epsilon,
            "reference_error": self.reference.error,
            "adiabatic": self.adiabatic,
            "energy": self.energy,
            "excursions": self.excursions,
        })
    }

    /// A panel for each plane.
    fn panels(&self, names: &[String]) -> impl Iterator<Item = Panel> {
        let states = &self.reference.trajectories;
        let dof = states.dim() / 2;
        (0..dof).map(move |j| {
            let plane = |z: &[f64]| (z[j], z[dof + j]);
            let mut series = Vec::new();
            for m in 0..states.count() {
                let (name, points) = (names[m].clone(), states.orbit(m).map(plane).collect());
                series.push(Series { name, color: m, style: Style::Line, points });
            }
            // Where it starts: all there is to see of one that stands still.
            for m in 0..states.count() {
                series.push(Series::unnamed(m, Style::Marked, vec![plane(states.state(0, m))]));
            }
            let index = subscript(j + 1);
            Panel {
                title: format!("ε = {}, (q{index}, p{index})", self.epsilon),
                x_label: format!("q{index}"),
                y_label: format!("p{index}"),
                square: true,
                series,
                ..Panel::default()
            }
        })
    }
}

/// The largest distance of each plane (q_j, p_j) from where trajectory `m` starts.
fn excursions(states: &Trajectories, m: usize) -> Vec<f64> {
    let dof = states.dim() / 2;
    let start = states.state(0, m);
    let of_plane = |j: usize| {
        let away = |z: &[f64]| distance(&[z[j], z[dof + j]], &[start[j], start[dof + j]]);
        states.orbit(m).map(away).fold(0.0, max_or_nan)
    };
    (0..dof).map(of_plane).collect()
}

impl TrajectoriesOptions {
    fn table(&self, each: &[OfEpsilon]) -> Table {
        let dof = self.initial.first().map_or(0, |point| point.len() / 2);
        let mut columns = vec![
            ("ε".to_owned(), Format::Exact),
            ("from".to_owned(), Format::Exact),
            ("μ₀ at the start".to_owned(), Format::Fixed(4)),
            ("its largest change".to_owned(), Format::Exponent(2)),
        ];
        for j in 1..=dof {
            columns.push((format!("excursion of plane {j}"), Format::Magnitude));
        }
        columns.push(("largest change of H".to_owned(), Format::Exponent(1)));
        let mut table = Table::new(columns);
        for of in each {
            for (m, point) in self.initial.iter().enumerate() {
                let mut row = vec![
                    of.epsilon.into(),
                    format!("{point:?}").into(),
                    of.adiabatic[m].initial.into(),
                    of.adiabatic[m].largest.into(),
                ];
                row.extend(of.excursions[m].iter().map(|excursion| (*excursion).into()));
                row.push(of.energy[m].largest.into());
                table.push(row);
            }
        }
        table
    }
}

/// A row of panels for each ε, a column for each plane.
fn figure(each: &[OfEpsilon], names: &[String]) -> Figure {
    let panels: Vec<Panel> = each.iter().flat_map(|of| of.panels(names)).collect();
    Figure {
        name: TRAJECTORIES,
        caption: "Trajectories by the reference flow: a row for each ε, a column for each plane \
                  (qⱼ, pⱼ); marks where they start."
            .into(),
        columns: panels.len() / each.len().max(1),
        same_axes: SameAxes::No,
        panels,
    }
}
