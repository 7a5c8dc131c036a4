//! The trajectories of each network beside the reference.

use super::over_seeds::{data_of_rollouts, rollouts_of_seeds, words_of_rollouts};
use super::shared::{Study, finite};
use crate::error::Error;
use crate::flow::{ReferenceTrajectories, Trajectories};
use crate::measure::{
    adiabatic::level_set,
    ratios::near_identity_rms,
    trajectories::{Departure, Drift, departures, distance, drift_exponent, drifts},
};
use crate::network::{Rollout, Structure};
use crate::phase::Units;
use crate::scalar::max_or_nan;
use crate::scene::bibliography::GAUSS_LEGENDRE;
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Axis, Figure, Panel, SameAxes, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::predictions::coordinates_in_words;
use crate::scene::setup::{Need, Setup, check_points};
use crate::scene::target_flow::TargetFlow;
use crate::scene::trained::Trained;
use crate::scene::words::{coordinate, initial_names};
use crate::system::{AveragedOscillator, NearlyPeriodic, System};
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
    /// The number of applications of each network.
    pub steps: usize,
    /// One state in so many is kept.
    pub every: usize,
    /// The initial points, 2n numbers each; for pairs of a file, those of the trajectories beside it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub initial: Vec<Vec<f64>>,
    /// The plane (q_j, p_j) to draw, j from 1; unless given, the slow plane.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plane: Option<usize>,
}

impl RolloutOptions {
    /// Those of the scene, if it has any: its trajectories may be asked for by other
    /// studies.
    pub(super) fn of<'a>(scene: &Declared<'a>) -> Option<&'a Self> {
        scene.options_of()
    }

    pub(super) fn request(&self) -> Rollout {
        Rollout { steps: self.steps, every: self.every }
    }

    /// The trajectories of the reference.
    pub(super) fn reference(
        &self,
        context: &mut Context<'_>,
    ) -> Result<Rc<ReferenceTrajectories>, RunError> {
        let (interval, kept) = (self.interval(context.flow_time()?), self.request().kept());
        match context.target()? {
            TargetFlow::System(system) => context.reference(system, &self.initial, interval, kept),
            TargetFlow::File(_) | TargetFlow::Lines(_) => context.trajectories_of_file(kept),
        }
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
        &[Need::TargetFlow, Need::FlowTime]
    }

    fn is_of_invariants(&self) -> bool {
        true
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        Error::check_count_range("steps", self.steps, 1, usize::MAX)?;
        Error::check_count_range("every", self.every, 1, self.steps)?;
        scene.setup.flow_time.map_or(Ok(()), |time| scene.setup.check_repeated(time))?;
        let Some(target) = scene.setup.target() else { return Ok(()) };
        if let Some(plane) = self.plane {
            Error::check_count_range("plane", plane, 1, target.dof())?;
        }
        match target {
            TargetFlow::System(system) => check_points("initial", &self.initial, system),
            TargetFlow::File(file) => {
                if !self.initial.is_empty() {
                    let expected = "none: those of data.trajectories are taken";
                    return Err(Error::invalid("initial", self.initial.len(), expected));
                }
                let trajectories = file.trajectories.map(|_| ());
                trajectories.ok_or_else(|| {
                    Error::invalid("rollout", "no data.trajectories", "it, to compare with")
                })
            }
            TargetFlow::Lines(_) => {
                Err(Error::invalid("rollout", "field lines of coils", "the study `poincare`"))
            }
        }
    }

    fn check_files(&self, setup: &Setup) -> Result<(), Error> {
        let file = setup.data.as_ref().and_then(|data| data.file());
        if let Some(file) = file
            && let Some(path) = file.trajectories
        {
            let found = file.read_trajectories(path, self.request().kept());
            // Where the pairs do not fit either, their error is the one reported.
            let error = found.err().filter(|_| file.fits_pairs());
            return error.map_or(Ok(()), Err);
        }
        Ok(())
    }

    /// The portrait is of the slow plane, or of the one that is asked for.
    fn figures(&self, scene: &Declared<'_>) -> Vec<&'static str> {
        match (&scene.setup.system, self.plane) {
            (Some(system), None) if !system.has_slow_portrait() => vec![INVARIANT, ERROR],
            _ => vec![PORTRAIT, INVARIANT, ERROR],
        }
    }

    fn cites(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![GAUSS_LEGENDRE]
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let (target, flow_time) = (context.target()?, context.flow_time()?);
        let system = target.system();
        let found = self.reference(context)?;
        let reference = &found.trajectories;
        let initial: Vec<Vec<f64>> =
            (0..reference.count()).map(|m| reference.state(0, m).to_vec()).collect();
        let (mut models, mut moved) = (Vec::new(), Rc::default());
        if !context.scene.setup.models.is_empty() {
            models = context.models()?;
            moved = context.rollouts(&initial, self.request())?;
        }
        let data = match target {
            TargetFlow::System(_) => None,
            TargetFlow::File(_) | TargetFlow::Lines(_) => Some(context.data()?),
        };
        let coordinates =
            coordinates_in_words(data.as_ref().is_some_and(|data| data.section.is_some()));
        let of_reference =
            system.map(|system| Change::of(reference, |z| system.adiabatic_invariant(z)));
        let networks: Vec<Network<'_>> = models
            .iter()
            .zip(moved.iter())
            .map(|(trained, trajectories)| Network::new(trained, system, trajectories, reference))
            .collect();
        let orbits = Orbits {
            target,
            plane: self.plane,
            interval: self.interval(flow_time),
            names: match target {
                TargetFlow::System(_) => initial_names(&initial),
                // Of numbers that nobody chose.
                TargetFlow::File(_) | TargetFlow::Lines(_) => {
                    (1..=initial.len()).map(|m| format!("trajectory {m}")).collect()
                }
            },
            reference,
            of_reference,
            units: data.as_ref().and_then(|data| data.units.as_ref()),
        };

        let text = format!(
            "{} steps (time {}), one state in {} kept; {}. {}. μ₀ is the leading \
             adiabatic invariant: of the system that of the limiting rotation, of a \
             gyroceptron 𝔍₀∘ψ⁻¹. A change of it is |μ₀ − μ₀(0)|/μ₀(0) at its largest; the exponent \
             is that of the largest change up to N steps, in N. At one ε the data do not separate θ and \
             I_ε, so that an accurate map may own another invariant than that of the data.",
            self.steps,
            self.interval(flow_time) * (self.request().kept() - 1) as f64,
            self.every,
            match found.error {
                error if error.is_nan() => "the error of the reference is not known".to_owned(),
                error => format!("the reference's own error at the end is {error:.1e}"),
            },
            match target {
                TargetFlow::File(_) | TargetFlow::Lines(_) => {
                    format!(
                        "The initial points are those of the file; portraits and the errors of each component are \
                         {coordinates}, and where units were fitted to the pairs, distances and invariants in these"
                    )
                }
                TargetFlow::System(_) => {
                    let points: Vec<_> = initial.iter().map(|z| format!("{z:?}")).collect();
                    format!(
                        "The initial points, and the coordinates in which they differ: {}",
                        points.join(", ")
                    )
                }
            },
        );
        let mut details = vec![Block::Text(text)];
        if networks.is_empty() {
            details.push(Block::Table(orbits.table(None)));
        }
        for network in &networks {
            details.push(Block::Heading(format!("`{}`", network.name)));
            details.push(Block::Table(orbits.table(Some(network))));
        }
        let of_components = match target {
            TargetFlow::System(_) => Vec::new(),
            TargetFlow::File(_) | TargetFlow::Lines(_) => orbits.component_errors(&networks),
        };
        if !of_components.is_empty() {
            details.push(Block::Heading(format!("Errors by component, {coordinates}")));
            details.push(Block::Table(orbits.component_table(&of_components)));
        }
        let mut figures = Vec::new();
        if context.draws(PORTRAIT) {
            figures.push(orbits.portrait(&initial, &networks));
        }
        if context.draws(INVARIANT) {
            figures.extend(orbits.invariants(&networks));
        }
        if context.draws(ERROR) && !networks.is_empty() {
            figures.push(orbits.errors(&networks));
        }
        let seeds = rollouts_of_seeds(context, &initial, self.request(), reference)?;
        let mut summary = Vec::new();
        if !networks.is_empty() {
            summary.push(Block::Table(orbits.overview(&networks)));
            summary.push(Block::Text(orbits.sentences(&networks)));
        }
        if !seeds.is_empty() {
            summary.push(Block::Text(words_of_rollouts(&seeds)));
        }
        let mut data = json!({
            "reference_error": found.error,
            "reference_adiabatic": orbits.of_reference.as_ref().map(Change::data),
            "models": networks.iter().map(Network::data).collect::<Vec<_>>(),
        });
        if !seeds.is_empty() {
            data["seeds"] = data_of_rollouts(&seeds);
        }
        if !of_components.is_empty() {
            let named = |(name, errors): &(&str, Vec<f64>)| json!({ "name": name, "rms": errors });
            data["component_errors"] = of_components.iter().map(named).collect();
        }
        Ok(Findings {
            title: "Roll-out".into(),
            results: Section { summary, details, data },
            figures,
            ..Findings::default()
        })
    }
}

/// The change of an adiabatic invariant along orbits.
struct Change {
    /// Its values, a number for each state of each orbit.
    values: Trajectories,
    drifts: Vec<Drift>,
    /// The exponent of its growth with the number N of steps.
    exponent: f64,
}

impl Change {
    fn of(orbits: &Trajectories, quantity: impl Fn(&[f64]) -> f64) -> Self {
        let values = orbits.quantity(quantity);
        let drifts = drifts(&values, |value| value[0]);
        let exponent = drift_exponent(&values, |value| value[0]);
        Self { values, drifts, exponent }
    }

    /// Of one orbit; None where it begins at 0.
    fn relative(&self, m: usize) -> Option<f64> {
        let Drift { initial, largest } = self.drifts[m];
        (initial != 0.0).then(|| largest / initial.abs())
    }

    /// The largest of all orbits; NaN where none has one.
    fn largest(&self) -> f64 {
        let all = (0..self.drifts.len()).filter_map(|m| self.relative(m));
        all.reduce(max_or_nan).unwrap_or(f64::NAN)
    }

    fn data(&self) -> serde_json::Value {
        json!({
            "along": self.drifts,
            "largest_change": self.largest(),
            "exponent": self.exponent,
        })
    }
}

/// A network along its orbits.
struct Network<'a> {
    name: &'a str,
    /// The mean squared error of one step on the held-out pairs, if there are any.
    one_step: Option<f64>,
    orbits: &'a Trajectories,
    departures: Vec<Departure>,
    /// Root mean square of the distance of all states from the reference's.
    rms: f64,
    /// μ₀ of the system along the network's orbits, where there is one.
    of_system: Option<Change>,
    /// What only a gyroceptron has.
    learnt: Option<Learnt>,
}

/// The invariant of a network itself: 𝔍₀∘ψ⁻¹ of a gyroceptron, 𝔍∘χ⁻¹ of one in normal form.
struct Learnt {
    /// The change of the invariant along the network's own orbits.
    along_own: Change,
    /// The change of the invariant along the trajectories of the reference.
    along_reference: Change,
    /// Root mean square of a gyroceptron's I_ε(z) − z over the states of the reference,
    /// and ε.
    near_identity: Option<(f64, f64)>,
}

impl<'a> Network<'a> {
    fn new(
        trained: &'a Trained,
        system: Option<&System>,
        orbits: &'a Trajectories,
        reference: &Trajectories,
    ) -> Self {
        let model = trained.model();
        let learnt = model.invariant().map(|own| {
            let adiabatic = model.architecture().structure() == Structure::NearlyPeriodic;
            let near_identity = adiabatic.then(|| {
                let moved = near_identity_rms(&model.near_identity(), reference.values());
                (moved, model.epsilon())
            });
            Learnt {
                along_own: Change::of(orbits, &own),
                along_reference: Change::of(reference, &own),
                near_identity,
            }
        });
        let squares: f64 =
            orbits.values().iter().zip(reference.values()).map(|(a, b)| (a - b) * (a - b)).sum();
        Self {
            name: &trained.spec.name,
            one_step: trained.held_out_error,
            departures: departures(orbits, reference),
            rms: (squares / (orbits.values().len() / orbits.dim()) as f64).sqrt(),
            of_system: system.map(|system| Change::of(orbits, |z| system.adiabatic_invariant(z))),
            orbits,
            learnt,
        }
    }

    fn data(&self) -> serde_json::Value {
        json!({
            "name": self.name,
            "rms_error": self.rms,
            "largest_errors": self.departures.iter().map(|d| d.largest).collect::<Vec<_>>(),
            "final_errors": self.departures.iter().map(|d| d.last).collect::<Vec<_>>(),
            "system_adiabatic": self.of_system.as_ref().map(Change::data),
            "own_adiabatic": self.learnt.as_ref().map(|learnt| json!({
                "along_own_orbits": learnt.along_own.data(),
                "along_the_reference": learnt.along_reference.data(),
                "near_identity_rms": learnt.near_identity.map(|(moved, _)| moved),
            })),
        })
    }
}

/// What the orbits of all networks are compared with.
struct Orbits<'a> {
    target: TargetFlow<'a>,
    /// The one to draw, from 1.
    plane: Option<usize>,
    interval: f64,
    /// The names of the initial points: the coordinates in which they differ.
    names: Vec<String>,
    reference: &'a Trajectories,
    /// μ₀ of the system along the reference.
    of_reference: Option<Change>,
    /// The units of the data, where they are not those of the states here.
    units: Option<&'a Units>,
}

/// How much more an invariant that is learnt may move than that of the data.
const AS_GOOD: f64 = 3.0;

impl Orbits<'_> {
    fn overview(&self, networks: &[Network<'_>]) -> Table {
        let mut table = Table::new([
            ("network", Format::Exact),
            ("MSE of one step", Format::Exponent(2)),
            ("rms distance", Format::Exponent(2)),
            ("largest", Format::Exponent(2)),
            ("own μ₀, own orbits", Format::Percent),
            ("exponent", Format::Fixed(2)),
            ("own μ₀, reference", Format::Percent),
            ("system's μ₀, own orbits", Format::Percent),
            ("exponent", Format::Fixed(2)),
            ("system's μ₀, reference", Format::Percent),
        ]);
        for network in networks {
            let learnt = network.learnt.as_ref();
            let largest = network.departures.iter().map(|d| d.largest).fold(0.0, max_or_nan);
            table.push([
                format!("`{}`", network.name).into(),
                network.one_step.into(),
                network.rms.into(),
                largest.into(),
                learnt.map(|l| l.along_own.largest()).into(),
                learnt.and_then(|l| finite(l.along_own.exponent)).into(),
                learnt.map(|l| l.along_reference.largest()).into(),
                network.of_system.as_ref().map(Change::largest).into(),
                network.of_system.as_ref().and_then(|change| finite(change.exponent)).into(),
                self.of_reference.as_ref().map(Change::largest).into(),
            ]);
        }
        table
    }

    /// The root-mean-square error of each component over all states but the first, in units of
    /// the data, of each network.
    fn component_errors<'n>(&self, networks: &[Network<'n>]) -> Vec<(&'n str, Vec<f64>)> {
        let dim = self.reference.dim();
        let of = |network: &Network<'n>| {
            let states = |of: &'_ Trajectories| of.values()[dim * of.count()..].to_vec();
            let (found, truth) = (states(network.orbits), states(self.reference));
            let mut squares = vec![0.0; dim];
            for (a, b) in found.chunks_exact(dim).zip(truth.chunks_exact(dim)) {
                for k in 0..dim {
                    squares[k] += (a[k] - b[k]) * (a[k] - b[k]);
                }
            }
            let count = (truth.len() / dim) as f64;
            let factor = |k: usize| self.units.map_or(1.0, |units| units.factors()[k]);
            let errors = (0..dim).map(|k| factor(k) * (squares[k] / count).sqrt()).collect();
            (network.name, errors)
        };
        networks.iter().map(of).collect()
    }

    fn component_table(&self, errors: &[(&str, Vec<f64>)]) -> Table {
        let dim = self.reference.dim();
        let components = (0..dim).map(|k| (coordinate(k, dim), Format::Exponent(2)));
        let network = [("network".to_owned(), Format::Exact)];
        let mut table = Table::new(network.into_iter().chain(components));
        for (name, errors) in errors {
            let name = [format!("`{name}`").into()];
            table.push(name.into_iter().chain(errors.iter().map(|error| (*error).into())));
        }
        table
    }

    /// What became of the invariant of each gyroceptron.
    fn sentences(&self, networks: &[Network<'_>]) -> String {
        let percent = |value: f64| Format::Percent.number(value);
        let mut out = String::new();
        for network in networks {
            let Some(learnt) = &network.learnt else { continue };
            let own = learnt.along_own.largest();
            out.push_str(&format!(
                "- The invariant {} of `{}` moves by up to {} of its value along its own orbits \
                 and {} along the reference",
                if learnt.near_identity.is_some() { "𝔍₀∘ψ⁻¹" } else { "𝔍∘χ⁻¹" },
                network.name,
                percent(own),
                percent(learnt.along_reference.largest()),
            ));
            let of_data = self.of_reference.as_ref().map(Change::largest);
            if let (Some(of_system), Some(of_data)) = (&network.of_system, of_data) {
                let (along, of_data) = (percent(of_system.largest()), percent(of_data));
                out.push_str(&format!("; μ₀ of the system by {along} and {of_data}"));
            }
            out.push('.');
            if let Some((moved, epsilon)) = learnt.near_identity {
                let moved = moved / epsilon.abs();
                out.push_str(&format!(" I_ε moves points by {moved:.1} ε (rms)."));
            }
            if let Some(of_data) = of_data
                && !(own <= AS_GOOD * of_data)
            {
                out.push_str(&format!(
                    " It moves {} as much as that of the data: it is not the invariant of the data.",
                    Format::Factor.number(own / of_data)
                ));
            }
            out.push('\n');
        }
        out
    }

    fn table(&self, network: Option<&Network<'_>>) -> Table {
        let mut table = Table::new([
            ("from", Format::Exact),
            ("largest distance from the reference", Format::Exponent(2)),
            ("at the end", Format::Exponent(2)),
            ("own μ₀ at the start", Format::Fixed(4)),
            ("its change along own orbit", Format::Percent),
            ("along the reference", Format::Percent),
            ("μ₀ of the system at the start", Format::Fixed(4)),
            ("its change along the network's orbit", Format::Percent),
            ("along the reference", Format::Percent),
        ]);
        let learnt = network.and_then(|network| network.learnt.as_ref());
        for (m, name) in self.names.iter().enumerate() {
            table.push([
                name.clone().into(),
                network.map(|n| n.departures[m].largest).into(),
                network.map(|n| n.departures[m].last).into(),
                learnt.map(|l| l.along_own.drifts[m].initial).into(),
                learnt.and_then(|l| l.along_own.relative(m)).into(),
                learnt.and_then(|l| l.along_reference.relative(m)).into(),
                self.of_reference.as_ref().map(|of| of.drifts[m].initial).into(),
                network.and_then(|n| n.of_system.as_ref()?.relative(m)).into(),
                self.of_reference.as_ref().and_then(|of| of.relative(m)).into(),
            ]);
        }
        table
    }

    /// The coordinates of the plane to draw: the one that is asked for, or the first that does not
    /// turn, whose motion the paper shows.
    fn plane(&self) -> [usize; 2] {
        let action = self.target.circle_action();
        let slow = action.weights().iter().position(|weight| *weight == 0);
        let j = self.plane.map_or(slow.unwrap_or(0), |plane| plane - 1);
        [j, action.dof() + j]
    }

    /// A coordinate of a state, in units of the data.
    fn in_data(&self, z: &[f64], k: usize) -> f64 {
        self.units.map_or(z[k], |units| z[k].mul_add(units.factors()[k], units.centre()[k]))
    }

    fn plane_labels(&self) -> [String; 2] {
        self.plane().map(|k| coordinate(k, self.reference.dim()))
    }

    fn portrait(&self, initial: &[Vec<f64>], networks: &[Network<'_>]) -> Figure {
        let [i, k] = self.plane();
        let [x_label, y_label] = self.plane_labels();
        let averaged = |z: &Vec<f64>| self.target.system()?.averaged(i, z);
        let has_levels = initial.iter().any(|z| averaged(z).is_some());
        let panel = |title: &str, orbits: &Trajectories| {
            let levels = initial.iter().filter_map(|z| level_through(averaged(z)?));
            let mut series: Vec<_> = levels.collect();
            for (m, name) in self.names.iter().enumerate() {
                let points =
                    orbits.orbit(m).map(|z| (self.in_data(z, i), self.in_data(z, k))).collect();
                let (name, color) = (name.clone(), orbit_color(m));
                series.push(Series { name, color, style: Style::Dots, points });
            }
            Panel {
                title: title.into(),
                x_label: x_label.clone(),
                y_label: y_label.clone(),
                square: true,
                series,
                ..Panel::default()
            }
        };
        let mut panels = vec![panel("Reference", self.reference)];
        panels.extend(networks.iter().map(|network| panel(network.name, network.orbits)));
        let figure = Figure::in_a_row(
            PORTRAIT,
            match has_levels {
                true => {
                    "The slow plane: reference trajectories over the level sets of the averaged \
                     Hamiltonian through their initial points (grey), and the trajectories of each \
                     network."
                }
                false => "One plane of the reference trajectories and of those of each network.",
            },
            panels,
        );
        Figure { columns: columns(figure.panels.len()), same_axes: SameAxes::First, ..figure }
    }

    /// A panel of the change of an invariant: the upper and lower envelope for each
    /// orbit.
    fn envelopes(&self, title: String, change: &Change) -> Panel {
        let mut series = Vec::new();
        for (m, name) in self.names.iter().enumerate() {
            let initial = change.drifts[m].initial;
            let values: Vec<f64> =
                change.values.orbit(m).map(|v| (v[0] - initial) / initial.abs()).collect();
            let [lower, upper] = envelope(&values, self.interval);
            let (name, color) = (name.clone(), orbit_color(m));
            series.push(Series { name, color, style: Style::Line, points: upper });
            series.push(Series::unnamed(color, Style::Line, lower));
        }
        Panel {
            title,
            x_label: "time".into(),
            y_label: "(μ₀ − μ₀(0))/μ₀(0)".into(),
            series,
            ..Panel::default()
        }
    }

    /// None where nothing has an invariant.
    fn invariants(&self, networks: &[Network<'_>]) -> Option<Figure> {
        let title = "μ₀ of the system along the reference".to_owned();
        let of_reference = self.of_reference.iter();
        let mut panels: Vec<Panel> =
            of_reference.map(|change| self.envelopes(title.clone(), change)).collect();
        for network in networks {
            let name = network.name;
            if let Some(change) = &network.of_system {
                panels.push(self.envelopes(format!("μ₀ of the system along {name}"), change));
            }
            if let Some(learnt) = &network.learnt {
                let title = format!("own μ₀ of {name} along its orbits");
                panels.push(self.envelopes(title, &learnt.along_own));
                let title = format!("own μ₀ of {name} along the reference");
                panels.push(self.envelopes(title, &learnt.along_reference));
            }
        }
        let caption = "The relative change of the leading adiabatic invariant, its envelope for each \
                       orbit: of the system, and of each gyroceptron itself, μ₀ = 𝔍₀∘ψ⁻¹.";
        if panels.is_empty() {
            return None;
        }
        let figure = Figure::in_a_row(INVARIANT, caption, panels);
        let columns = columns(figure.panels.len());
        Some(Figure { columns, same_axes: SameAxes::Widest, ..figure })
    }

    fn errors(&self, networks: &[Network<'_>]) -> Figure {
        let [i, k] = self.plane();
        let [q, p] = self.plane_labels();
        let panel = |network: &Network<'_>| {
            let along = |(m, name): (usize, &String)| {
                let errors = network.orbits.orbit(m).zip(self.reference.orbit(m));
                let errors = errors.map(|(a, b)| distance(&[a[i], a[k]], &[b[i], b[k]]));
                let points = errors
                    .enumerate()
                    .skip(1)
                    .map(|(t, e)| (t as f64 * self.interval, e))
                    .collect();
                Series { name: name.clone(), color: orbit_color(m), style: Style::Line, points }
            };
            Panel {
                title: network.name.to_owned(),
                x_label: "time".into(),
                y_label: match self.units {
                    None => format!("distance of ({q}, {p}) from the reference"),
                    Some(_) => format!("distance of ({q}, {p}) in the network's units"),
                },
                y: Axis::Log,
                series: self.names.iter().enumerate().map(along).collect(),
                ..Panel::default()
            }
        };
        let panels = networks.iter().map(panel).collect();
        let caption = "Distance of each trajectory from the reference in the plane that is named.";
        let figure = Figure::in_a_row(ERROR, caption, panels);
        Figure { columns: columns(figure.panels.len()), same_axes: SameAxes::Widest, ..figure }
    }
}

/// The colour of level sets.
pub(super) const GREY: usize = 6;

/// The colour of an orbit: not that of level sets.
pub(super) fn orbit_color(m: usize) -> usize {
    if m < GREY { m } else { m + 2 }
}

/// Panels side by side: a square of panels, but two in a row.
pub(super) fn columns(panels: usize) -> usize {
    (panels as f64).sqrt().ceil() as usize
}

/// The level set of the averaged Hamiltonian through an initial point, once around.
fn level_through((averaged, start): (AveragedOscillator, [f64; 2])) -> Option<Series> {
    const STEPS: usize = 600;
    const INTERVAL: f64 = 0.02;
    let points = level_set(&averaged, start, INTERVAL, STEPS).ok()?;
    let name = "averaged Hamiltonian".into();
    Some(Series { name, color: GREY, style: Style::Faint, points })
}

/// The value of ε as text, such as `ε = 1e-3`.
pub(super) fn epsilon_name(epsilon: f64) -> String {
    format!("ε = {}", Format::Setting.number(epsilon))
}

/// The smallest and the largest of the values in each of some equal parts of the time;
/// the values themselves, where they are few.
pub(super) fn envelope(values: &[f64], interval: f64) -> [Vec<(f64, f64)>; 2] {
    const PARTS: usize = 120;
    let size = values.len().div_ceil(PARTS).max(1);
    let mut out = [Vec::new(), Vec::new()];
    // What is left at the end is too little to be one of them.
    let whole = values.len() / size * size;
    let values = if whole > 0 { &values[..whole] } else { values };
    for (part, values) in values.chunks(size).enumerate() {
        let time = (part * size) as f64 * interval + 0.5 * (values.len() - 1) as f64 * interval;
        let largest = values.iter().copied().fold(f64::NEG_INFINITY, max_or_nan);
        let smallest = -values.iter().map(|v| -v).fold(f64::NEG_INFINITY, max_or_nan);
        out[0].push((time, smallest));
        out[1].push((time, largest));
    }
    out
}
