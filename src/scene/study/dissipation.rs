//! Networks of a flow that is not Hamiltonian: volumes, and where trajectories come to.

use super::shared::{Study, check_along, finite};
use crate::error::Error;
use crate::flow::Trajectories;
use crate::measure::{
    ratios::symplecticity_defect,
    timing::root_mean_square_distance,
    trajectories::{mean_period, root_mean_square, simpson},
};
use crate::network::{Composition, Rollout, map_jacobians};
use crate::scalar::max_or_nan;
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::setup::{MOST, Need};
use crate::system::{Hamiltonian, NearlyPeriodic, System, divergence};
use faer::MatRef;
use serde::{Deserialize, Serialize};
use serde_json::json;

const FIGURE: &str = "dissipation";
/// The states of the first trajectory that are drawn over time.
const DRAWN: usize = 120;
/// Between two states of the reference that its divergence is summed over, in fast angles.
const FINE: f64 = 0.1;

/// How much each network and the flow change volumes, and how far the maps are from symplectic; also the action along
/// trajectories, which tends to the same values wherever they start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DissipationOptions {
    /// The number of held-out points at which volumes are compared.
    pub points: usize,
    /// The number of applications of each network.
    pub steps: usize,
    /// The number of applications between two states that are kept.
    pub every: usize,
    /// The initial points of the trajectories, 2n numbers each.
    pub initial: Vec<Vec<f64>>,
}

impl Study for DissipationOptions {
    fn name(&self) -> &'static str {
        "dissipation"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::System, Need::FlowTime, Need::Data, Need::Models]
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        Error::check_count_range("points", self.points, 1, MOST)?;
        // Its rate is followed within a flow time.
        scene.setup.check_autonomous()?;
        check_along(scene, self.steps, self.every, &self.initial)
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![FIGURE]
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let (system, time, models) = (context.system()?, context.flow_time()?, context.models()?);
        let points = self.points_of(context)?;
        let (growth, volume_error) = self.growth(context, system, &points, time)?;
        let mut volumes = Vec::new();
        for trained in models.iter() {
            let model = trained.model();
            let symplectic = model.architecture().is_symplectic();
            let (name, map) = (&trained.spec.name, model.composition());
            volumes.push(Volumes::new(name, symplectic, map, &points, &growth)?);
        }
        let interval = self.every as f64 * time;
        let states = self.steps / self.every + 1;
        let reference = context.reference(system, &self.initial, interval, states)?;
        let request = Rollout { steps: self.steps, every: self.every };
        let rolled = context.rollouts(&self.initial, request)?;
        let along = &reference.trajectories;
        let mut all = vec![Along::new("the reference", system, along, along, interval)];
        for (trained, own) in models.iter().zip(rolled.iter()) {
            let name = format!("`{}`", trained.spec.name);
            all.push(Along::new(&name, system, own, along, interval));
        }
        let found = Results { volumes, all };
        let text = format!(
            "log det J of the flow is the integral of its divergence along the reference, by Simpson's rule (which errs by \
             {volume_error:.1e}), at {} of the pairs' points. Trajectories of time {} from {} points, {states} states of each; error of \
             the reference at the end: {:.1e}. J is the action of the limit{}; its least, mean and largest \
             values are those of the second half, and its period is the mean time between two rises through the \
             mean.",
            points.len(),
            self.steps as f64 * time,
            self.initial.len(),
            reference.error,
            if system.dissipates() { ", which no law keeps" } else { "" }
        );
        let figures = match context.draws(FIGURE) {
            true => vec![self.figure(system, &found, along, &rolled, interval)],
            false => Vec::new(),
        };
        Ok(Findings {
            title: "Dissipation".into(),
            results: Section {
                summary: vec![
                    Block::Table(found.volumes()),
                    Block::Text(found.sentence(system)),
                    Block::Table(found.along()),
                ],
                details: vec![Block::Text(text)],
                data: json!({ "volumes": found.volumes, "along": found.all }),
            },
            figures,
            ..Findings::default()
        })
    }
}

impl DissipationOptions {
    /// Evenly chosen points of the pairs that networks are judged by, at most `points`.
    fn points_of(&self, context: &mut Context<'_>) -> Result<Vec<Vec<f64>>, RunError> {
        let data = context.data()?;
        let pairs = data.to_judge_by();
        let count = self.points.min(pairs.len());
        let dim = 2 * pairs.dof();
        let row = |k: usize| pairs.input().chunks_exact(dim).nth(k * pairs.len() / count);
        Ok((0..count).filter_map(row).map(<[f64]>::to_vec).collect())
    }

    /// log det of the flow's Jacobian at each point, by Simpson's rule, with how far that is from the same on
    /// every other state.
    fn growth(
        &self,
        context: &mut Context<'_>,
        system: &System,
        points: &[Vec<f64>],
        time: f64,
    ) -> Result<(Vec<f64>, f64), RunError> {
        // A multiple of four, so that every other state is an even number of intervals too.
        let turns = time * system.limiting_fastest_frequency() / FINE;
        let intervals = (turns.ceil() as usize).clamp(4, MOST).next_multiple_of(4);
        let interval = time / intervals as f64;
        let fine = context.reference(system, points, interval, intervals + 1)?;
        let states = &fine.trajectories;
        let (mut out, mut error) = (Vec::new(), 0.0);
        for m in 0..states.count() {
            let rates: Vec<f64> = states.orbit(m).map(|z| divergence(system, z, 0.0)).collect();
            let every_other: Vec<f64> = rates.iter().step_by(2).copied().collect();
            let growth = simpson(&rates, interval);
            error = max_or_nan(error, (growth - simpson(&every_other, 2.0 * interval)).abs());
            out.push(growth);
        }
        Ok((out, error))
    }

    /// The action over time, and the planes that the limit leaves alone in the end.
    fn figure(
        &self,
        system: &System,
        found: &Results,
        reference: &Trajectories,
        rolled: &[Trajectories],
        interval: f64,
    ) -> Figure {
        let everyone = || std::iter::once(reference).chain(rolled);
        let mut over_time = Vec::new();
        for (color, (one, states)) in found.all.iter().zip(everyone()).enumerate() {
            let action = |(k, z)| (k as f64 * interval, system.adiabatic_invariant::<f64>(z));
            over_time.push(Series {
                name: one.of.replace('`', ""),
                color,
                style: if color == 0 { Style::Line } else { Style::Marked },
                points: states.orbit(0).take(DRAWN).enumerate().map(action).collect(),
            });
        }
        let mut panels = vec![Panel {
            title: "the first trajectory".into(),
            x_label: "time".into(),
            y_label: "action J".into(),
            series: over_time,
            ..Panel::default()
        }];
        let (action, dof) = (system.circle_action(), system.dof());
        let slow = action.weights().iter().position(|weight| *weight == 0);
        if let Some(plane) = slow {
            let points_of = |states: &Trajectories| -> Vec<(f64, f64)> {
                let half = states.states() / 2;
                let last = (0..states.count()).flat_map(|m| states.orbit(m).skip(half));
                last.map(|z| (z[plane], z[dof + plane])).collect()
            };
            let own = points_of(reference);
            // What leaves would make a dot of the attractor.
            let range = |at: fn(&(f64, f64)) -> f64| {
                let low = -own.iter().map(|point| -at(point)).fold(f64::NEG_INFINITY, max_or_nan);
                let high = own.iter().map(at).fold(f64::NEG_INFINITY, max_or_nan);
                let room = 0.5 * (high - low);
                low - room..high + room
            };
            let (across, along) = (range(|p| p.0), range(|p| p.1));
            let near = |p: &(f64, f64)| across.contains(&p.0) && along.contains(&p.1);
            let mut series = Vec::new();
            for (color, (one, states)) in found.all.iter().zip(everyone()).enumerate() {
                let points = points_of(states).into_iter().filter(near).collect();
                let name = one.of.replace('`', "");
                series.push(Series { name, color, style: Style::Dots, points });
            }
            panels.push(Panel {
                title: "all trajectories, second half".into(),
                x_label: format!("q{}", crate::words::subscript(plane + 1)),
                y_label: format!("p{}", crate::words::subscript(plane + 1)),
                series,
                ..Panel::default()
            });
        }
        let caption = "Left: the action of the limit along the first trajectory. Right: the plane that the limit leaves \
                       alone, in the second half of all trajectories; what lies farther from those of the reference than half their \
                       range is not drawn.";
        Figure::in_a_row(FIGURE, caption, panels)
    }
}

/// What one application does to volumes and to the canonical form.
#[derive(Serialize)]
struct Volumes {
    name: String,
    /// Whether it keeps them whatever its weights.
    symplectic: bool,
    /// The mean of log det J of the flow, and the share of the points where it is negative.
    mean_of_flow: f64,
    shrinking: f64,
    /// The root mean square of log det J of the flow.
    of_flow: f64,
    /// The root mean square of log |det J| of the network.
    own: f64,
    /// The root mean square of the difference of log |det J| between network and flow.
    error: f64,
    /// The root mean square of the largest entry of JᵀΩJ − Ω.
    defect: f64,
}

impl Volumes {
    fn new(
        name: &str,
        symplectic: bool,
        map: &Composition<f64>,
        points: &[Vec<f64>],
        growth: &[f64],
    ) -> Result<Self, Error> {
        let dim = 2 * map.dof();
        let mut jacobians = vec![0.0; points.len() * dim * dim];
        map_jacobians(map, &points.concat(), &mut jacobians)?;
        let (mut own, mut error, mut defects) = (Vec::new(), Vec::new(), Vec::new());
        for (jacobian, growth) in jacobians.chunks_exact(dim * dim).zip(growth) {
            let jacobian = MatRef::from_row_major_slice(jacobian, dim, dim);
            let volume = libm::log(jacobian.determinant().abs());
            own.push(volume);
            error.push(volume - growth);
            let defect = symplecticity_defect(jacobian);
            let entries = (0..dim * dim).map(|k| defect[(k / dim, k % dim)].abs());
            defects.push(entries.fold(0.0, max_or_nan));
        }
        Ok(Self {
            name: name.to_owned(),
            symplectic,
            mean_of_flow: growth.iter().sum::<f64>() / growth.len() as f64,
            shrinking: growth.iter().filter(|v| **v < 0.0).count() as f64 / growth.len() as f64,
            of_flow: root_mean_square(growth),
            own: root_mean_square(&own),
            error: root_mean_square(&error),
            defect: root_mean_square(&defects),
        })
    }
}

/// Trajectories, and the action along them.
#[derive(Serialize)]
struct Along {
    of: String,
    /// The root mean square distance from the reference.
    distance: f64,
    /// Of the action in the second half.
    least: f64,
    mean: f64,
    largest: f64,
    /// The mean time between two rises of the action through its mean.
    period: Option<f64>,
}

impl Along {
    fn new(
        of: &str,
        system: &System,
        own: &Trajectories,
        reference: &Trajectories,
        interval: f64,
    ) -> Self {
        let half = own.states() / 2;
        let (mut least, mut largest, mut sum, mut count) = (0.0, 0.0, 0.0, 0);
        let mut periods = Vec::new();
        for m in 0..own.count() {
            let actions: Vec<f64> =
                own.orbit(m).skip(half).map(|z| system.adiabatic_invariant(z)).collect();
            for action in &actions {
                least = if count == 0 { *action } else { -max_or_nan(-least, -action) };
                largest = if count == 0 { *action } else { max_or_nan(largest, *action) };
                sum += action;
                count += 1;
            }
            periods.extend(mean_period(&actions, interval));
        }
        let all = periods.len() == own.count();
        let mean_period = periods.iter().sum::<f64>() / periods.len() as f64;
        Self {
            of: of.to_owned(),
            distance: root_mean_square_distance(own.values(), reference.values(), own.dim()),
            least,
            mean: sum / f64::from(count),
            largest,
            period: all.then_some(mean_period),
        }
    }
}

struct Results {
    volumes: Vec<Volumes>,
    all: Vec<Along>,
}

impl Results {
    fn volumes(&self) -> Table {
        let mut table = Table::new([
            ("network", Format::Exact),
            ("log det J of the flow, rms", Format::Exponent(2)),
            ("its own, rms", Format::Exponent(2)),
            ("difference, rms", Format::Exponent(1)),
            ("JᵀΩJ − Ω, largest entry, rms", Format::Exponent(1)),
        ]);
        for one in &self.volumes {
            table.push([
                format!("`{}`", one.name).into(),
                one.of_flow.into(),
                one.own.into(),
                finite(one.error).into(),
                finite(one.defect).into(),
            ]);
        }
        table
    }

    /// What the flow does to volumes, and which networks cannot follow.
    fn sentence(&self, system: &System) -> String {
        let Some(first) = self.volumes.first().filter(|_| system.dissipates()) else {
            return "The flow is Hamiltonian: volumes are kept.".into();
        };
        let mut out = format!(
            "The flow makes volumes smaller at {} of the points; the geometric mean of all is {} of what they were.",
            Format::Percent.number(first.shrinking),
            Format::Percent.number(libm::exp(first.mean_of_flow))
        );
        let keeping = self.volumes.iter().filter(|one| one.symplectic);
        let names: Vec<String> = keeping.map(|one| format!("`{}`", one.name)).collect();
        if !names.is_empty() && first.mean_of_flow < 0.0 {
            out.push_str(&format!(
                " {} cannot follow: what is symplectic for all weights keeps all volumes, and no trajectory of it comes to \
                 an attractor.",
                names.join(", ")
            ));
        }
        out
    }

    fn along(&self) -> Table {
        let mut table = Table::new([
            ("trajectories of", Format::Exact),
            ("distance from the reference, rms", Format::Exponent(2)),
            ("least J", Format::Fixed(4)),
            ("mean J", Format::Fixed(4)),
            ("largest J", Format::Fixed(4)),
            ("period of J", Format::Fixed(2)),
        ]);
        for (number, one) in self.all.iter().enumerate() {
            table.push([
                one.of.clone().into(),
                finite(one.distance).filter(|_| number > 0).into(),
                finite(one.least).into(),
                finite(one.mean).into(),
                finite(one.largest).into(),
                one.period.into(),
            ]);
        }
        table
    }
}
