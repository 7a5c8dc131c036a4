//! Surfaces of field lines over many turns: networks and integrators beside the reference.

use super::over_seeds::MedianAndWorst;
use super::rollout::orbit_color;
use super::shared::{Study, finite};
use super::step_tables::{MadeTable, TableCost, TableSizes, citations_of, make, named};
use super::work_precision::{Compared, HOW, MOST_ROUNDS, citations, work_precision_panel};
use crate::error::Error;
use crate::flow::{Integrator, Reference, Tableau, Trajectories};
use crate::measure::{
    timing::{AtError, Comparison, WorkPrecision, break_even, root_mean_square_distance},
    trajectories::{LockedInterval, distances_to_set, locked_interval, winding_numbers},
};
use crate::network::{Model, Rollout};
use crate::scalar::max_or_nan;
use crate::scene::bibliography::{FIELD_LINES, GAUSS_LEGENDRE};
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Figure, Panel, SameAxes, Series, Style};
use crate::scene::findings::{Block, Cell, Findings, Format, Section, Table};
use crate::scene::learning::BySeed;
use crate::scene::setup::{MOST, Need};
use crate::scene::trained::Trained;
use crate::system::{FieldLines, Hamiltonian, NearlyPeriodic, System};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::f64::consts::{PI, TAU};
use std::rc::Rc;

const SECTION: &str = "section";
const METHODS: &str = "surfaces-methods";
/// µs a turn from seconds for unit time.
const MICRO_A_TURN: f64 = TAU * 1e6;

/// Fewer maps lock nearly every line, …
const LEAST_ISLAND: usize = 50;
/// … and the states of more do not fit into memory.
const MOST_ISLAND: usize = 1_000_000;

/// Surfaces of field lines over many turns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfacesOptions {
    /// The radii r at which lines begin.
    pub radii: Vec<f64>,
    /// The angle θ at which all lines begin.
    pub theta: f64,
    /// The number of applications of the map along each line, at least 2.
    pub steps: usize,
    /// The number of applications up to which points are compared one by one.
    pub early: usize,
    /// The number of last points that are compared with the surfaces of the reference, and drawn.
    pub last: usize,
    /// The number of applications of the map that decide whether a line is in an island.
    pub island: usize,
    /// How often each time is taken.
    pub rounds: usize,
    /// What the networks are compared with.
    pub integrators: Vec<StepsInAMap>,
    /// Tables of the map, with which the networks are compared too.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tables: Vec<TableSizes>,
}

/// An integrator with the numbers of steps it is tried with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepsInAMap {
    /// The integrator that the networks are compared with.
    pub integrator: Integrator,
    /// Its steps in the flow time.
    pub steps: Vec<usize>,
}

impl Study for SurfacesOptions {
    fn name(&self) -> &'static str {
        "surfaces"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::System, Need::FlowTime, Need::Data, Need::Models]
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        Error::check_count_range("radii", self.radii.len(), 1, 1000)?;
        Error::check_finite("theta", self.theta)?;
        Error::check_count_range("steps", self.steps, 2, MOST)?;
        Error::check_count_range("early", self.early, 1, self.steps)?;
        Error::check_count_range("last", self.last, 1, self.steps)?;
        Error::check_count_range("rounds", self.rounds, 1, MOST_ROUNDS)?;
        for entry in &self.integrators {
            entry.integrator.check()?;
            for &steps in &entry.steps {
                Error::check_count_range("integrators.steps", steps, 1, MOST)?;
            }
        }
        self.tables.iter().try_for_each(|table| table.check(Some(1)))?;
        Error::check_count_range("island", self.island, LEAST_ISLAND, MOST_ISLAND)?;
        scene.setup.flow_time.map_or(Ok(()), |time| scene.setup.check_repeated(time))?;
        for (index, radius) in self.radii.iter().enumerate() {
            Error::check_range(&format!("radii[{index}]"), *radius, 0.0, 1.0)?;
        }
        let Some(any) = &scene.setup.system else { return Ok(()) };
        let system = lines(any)?;
        for (index, point) in self.initial(system).iter().enumerate() {
            system.check_point(point).map_err(|e| e.with_place(format!("radii[{index}]")))?;
        }
        self.integrators.iter().try_for_each(|entry| entry.integrator.check_for(any))
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![SECTION, METHODS]
    }

    fn cites(&self, _: &Declared<'_>) -> Vec<&'static str> {
        let mut out = citations(self.integrators.iter().map(|entry| entry.integrator));
        out.extend(citations_of(&self.tables));
        out.extend([GAUSS_LEGENDRE, FIELD_LINES]);
        out
    }

    /// Makes the study shorter: fewer maps, fewer rounds and only the smallest tables.
    fn shorten(&mut self) {
        self.steps = (self.steps / 20).max(self.early).max(self.last).max(2);
        self.island = (self.island / 4).max(LEAST_ISLAND);
        self.rounds = self.rounds.min(5);
        self.tables.iter_mut().for_each(TableSizes::shorten);
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let any = context.system()?;
        let (system, interval) = (lines(any)?, context.flow_time()?);
        let initial = self.initial(system);
        let request = Rollout { steps: self.steps, every: 1 };
        // What may fail, before anything is trained.
        let reference = context.reference(any, &initial, interval, request.kept())?;
        let judge = Judge { options: self, interval, system, reference: &reference.trajectories };
        let by_reference = |points: &[f64], steps: usize| repeated(system, points, interval, steps);
        let island =
            context.stage("the island of the reference", |_| judge.island(&by_reference))?;
        let models = context.models()?;
        let rolled = context.rollouts(&initial, request)?;
        let mut found = Vec::new();
        for (trained, orbits) in models.iter().zip(rolled.iter()) {
            let (name, model) = (&trained.spec.name, trained.model());
            found.push(match judge.island(&|points, steps| of_model(model, points, steps)) {
                Err(reason @ Error::Diverged { .. }) => judge.lost(name, None, reason.to_string()),
                island => judge.of(name, None, orbits, island?),
            });
            if context.interrupted() {
                return Err(RunError::Interrupted);
            }
        }
        let seeds = self.of_seeds(context, &judge, &found)?;
        for entry in &self.integrators {
            for &steps in &entry.steps {
                let name = entry.integrator.name();
                let by = |points: &[f64], kept: usize| -> Result<Trajectories, Error> {
                    let moved =
                        entry.integrator.trajectories(any, points, interval, steps, kept)?;
                    Trajectories::new([points, &moved].concat(), 2, points.len() / 2)
                };
                let stage = format!("surfaces of {name}, {steps} steps");
                let one = context.stage(&stage, |_| {
                    let orbits = by(&initial.concat(), self.steps)?;
                    Ok(judge.of(&name, Some(steps), &orbits, judge.island(&by)?))
                });
                found.push(match one {
                    // Steps that are too long for it say as much of a method as large errors do.
                    Err(reason @ (Error::Diverged { .. } | Error::NoConvergence { .. })) => {
                        judge.lost(&name, Some(steps), reason.to_string())
                    }
                    other => other?,
                });
                if context.interrupted() {
                    return Err(RunError::Interrupted);
                }
            }
        }
        let mut visited = reference.trajectories.values().to_vec();
        if let Some((_, radius)) = system.resonance() {
            // Where islands are looked for.
            for theta in [0.0, PI / f64::from(system.poloidal.unsigned_abs())] {
                let reach = reach_around(radius);
                visited.extend(system.point(radius - reach, theta));
                visited.extend(system.point(radius + reach, theta));
            }
        }
        let by_steps = |points: &[f64]| Ok(beyond(system, points, interval));
        let tables = make(context, &self.tables, interval, &visited, &by_steps)?;
        for table in &tables {
            let (name, nodes) = (table.kind().name(), table.nodes());
            let by = |points: &[f64], kept: usize| -> Result<Trajectories, Error> {
                let moved = table.trajectories(points, 1, kept)?;
                Trajectories::new([points, &moved].concat(), 2, points.len() / 2)
            };
            let stage = format!("surfaces of {name}, {nodes} nodes");
            found.push(context.stage(&stage, |_| match by(&initial.concat(), self.steps) {
                Ok(orbits) => Ok(judge.of(name, Some(nodes), &orbits, judge.island(&by)?)),
                Err(reason) => Ok::<_, Error>(judge.lost(name, Some(nodes), reason.to_string())),
            })?);
            if context.interrupted() {
                return Err(RunError::Interrupted);
            }
        }
        let comparison = context.stage("run times", |_| {
            let reference = (&reference.trajectories, reference.error);
            self.timed(any, interval, &models, &tables, reference)
        })?;
        let mut figures = Vec::new();
        if context.draws(SECTION) {
            figures.push(self.figure(system, &judge, &models, &rolled));
        }
        let surfaces = by_surface(&comparison, &found);
        if context.draws(METHODS) {
            figures.push(self.methods_figure(&comparison.methods, &surfaces));
        }
        let worth = |trained: &Rc<Trained>| {
            let name = &trained.spec.name;
            let paid = paid(context, name, any.epsilon(), interval);
            let of = |methods, lost| Gain::new(methods, name, lost, paid, interval);
            Worth {
                network: name.clone(),
                paid,
                one_by_one: of(&comparison.methods, comparison.lost()),
                from_surfaces: of(&surfaces, f64::MAX),
            }
        };
        let worth: Vec<Worth> = models.iter().map(worth).collect();
        let results = Results { options: self, island, found, seeds, reference: &judge };
        let words = results.words(reference.error);
        let data = json!({
            "island": island.map(|locked| [locked.low, locked.high]),
            "reference_error": reference.error,
            "reference_oscillation": results.reference.oscillation(&reference.trajectories),
            "methods": results.found,
            "seeds": results.seeds,
            "early": comparison.without_seconds(),
        });
        let mut summary = vec![Block::Text(words), Block::Table(results.table())];
        let failures = results.words_of_failures();
        if !failures.is_empty() {
            summary.push(Block::Text(failures));
        }
        if let Some(table) = results.table_of_seeds() {
            summary.push(Block::Text("Each network from several initial weights:".into()));
            summary.push(Block::Table(table));
        }
        let costs: Vec<TableCost> = tables.iter().map(MadeTable::cost).collect();
        let mut times = vec![Block::Text(results.words_of_times())];
        times.extend(TableCost::words(&costs));
        times.push(Block::Table(results.times(&comparison)));
        let lines: Vec<String> = worth.iter().map(|one| one.words(self)).collect();
        times.push(Block::Text(lines.join("\n")));
        let mut timed = json!(comparison);
        timed["worth"] = json!(worth);
        Ok(Findings {
            title: "Surfaces".into(),
            results: Section { summary, data, ..Section::default() },
            timings: Section { summary: times, data: timed, ..Section::default() },
            figures,
            ..Findings::default()
        })
    }
}

/// The field lines of a scene.
fn lines(system: &System) -> Result<&FieldLines, Error> {
    system.field_lines().ok_or_else(|| Error::invalid("system", system.kind(), "field-lines"))
}

fn of_model(model: &Model, points: &[f64], steps: usize) -> Result<Trajectories, Error> {
    let states = model.rollout(points, Rollout { steps, every: 1 })?;
    Trajectories::new(states, 2, points.len() / 2)
}

/// How far from its resonance an island is looked for, within the torus.
fn reach_around(radius: f64) -> f64 {
    /// The widest island that is looked for.
    const REACH: f64 = 0.12;
    REACH.min(0.9 * radius).min(0.9 * (1.0 - radius))
}

/// The flow of points, also where they are beyond the torus, at which its formulas do not end: a ring of tables is
/// around 0 and not around the axis.
fn beyond(system: &FieldLines, points: &[f64], interval: f64) -> Vec<f64> {
    /// Errors of 1e-12 a turn.
    const STEPS_A_TURN: f64 = 48.0;
    let mut out = points.to_vec();
    let steps = (STEPS_A_TURN * interval / TAU).ceil() as usize;
    out.par_chunks_mut(2).for_each(|z| {
        Tableau::DORMAND_PRINCE_8.take(system, z, interval, steps);
    });
    out
}

/// The reference flow from each of these points, time after time.
fn repeated(
    system: &FieldLines,
    points: &[f64],
    interval: f64,
    steps: usize,
) -> Result<Trajectories, Error> {
    let flow = Reference::calibrated(system, points, interval)?;
    let moved = flow.trajectories(system, points, interval, steps)?;
    Trajectories::new([points, &moved].concat(), 2, points.len() / 2)
}

/// Seconds of pairs and of training that came before the first step of a network.
fn paid(context: &Context<'_>, name: &str, epsilon: f64, interval: f64) -> f64 {
    let own = context.training_times().iter().find(|times| times.model == name);
    let training = own.and_then(|times| times.points.last()).map_or(0.0, |(_, seconds)| *seconds);
    context.seconds_of_pairs(epsilon, interval) + training
}

/// Run times with the largest distance from the surfaces in place of the error one by one.
fn by_surface(comparison: &Comparison, found: &[Found]) -> Vec<WorkPrecision> {
    let of = |method: &WorkPrecision| {
        let same = |one: &&Found| {
            one.name == method.name && one.steps.map(|steps| steps as f64) == method.setting
        };
        let error = found.iter().find(same).and_then(|one| finite(one.largest()));
        WorkPrecision { error, ..method.clone() }
    };
    comparison.methods.iter().map(of).collect()
}

/// What a method came to.
#[derive(Clone, Serialize)]
struct Found {
    name: String,
    /// Steps of an integrator in the flow time, or nodes of a table along each axis.
    steps: Option<usize>,
    /// The root mean square distance from the reference over the early points.
    early: f64,
    /// The same of each line.
    early_of_lines: Vec<f64>,
    /// The median and the largest distance of the last points from the surface of the reference, for
    /// each line.
    surfaces: Vec<[f64; 2]>,
    /// The standard deviation of H over its mean, of each line.
    oscillation: Vec<f64>,
    island: Option<[f64; 2]>,
    /// Why the method has no orbits.
    #[serde(skip_serializing_if = "Option::is_none")]
    failure: Option<String>,
}

impl Found {
    fn largest(&self) -> f64 {
        self.surfaces.iter().map(|[_, largest]| *largest).fold(0.0, max_or_nan)
    }

    fn median(&self) -> f64 {
        let mut medians: Vec<f64> = self.surfaces.iter().map(|[median, _]| *median).collect();
        medians.sort_by(f64::total_cmp);
        // Of one line that has none there is none of all.
        if self.largest().is_nan() { f64::NAN } else { medians[medians.len() / 2] }
    }
}

/// The orbits of points, of so many steps.
type Orbits<'a> = dyn Fn(&[f64], usize) -> Result<Trajectories, Error> + 'a;

struct Judge<'a> {
    options: &'a SurfacesOptions,
    interval: f64,
    system: &'a FieldLines,
    reference: &'a Trajectories,
}

impl Judge<'_> {
    fn of(
        &self,
        name: &str,
        steps: Option<usize>,
        orbits: &Trajectories,
        island: Option<LockedInterval>,
    ) -> Found {
        let early = self.early(orbits.values(), orbits);
        let early_of_lines = (0..orbits.count()).map(|m| self.early_of(orbits, m)).collect();
        let surfaces = (0..orbits.count()).map(|m| self.surface(orbits, m)).collect();
        let island = island.map(|locked| [locked.low, locked.high]);
        let oscillation = self.oscillation(orbits);
        Found {
            name: name.to_owned(),
            steps,
            early,
            early_of_lines,
            surfaces,
            oscillation,
            island,
            failure: None,
        }
    }

    /// The findings on a method without orbits: NaN for each line, and no island.
    fn lost(&self, name: &str, steps: Option<usize>, reason: String) -> Found {
        let lines = self.reference.count();
        Found {
            name: name.to_owned(),
            steps,
            early: f64::NAN,
            early_of_lines: vec![f64::NAN; lines],
            surfaces: vec![[f64::NAN; 2]; lines],
            oscillation: vec![f64::NAN; lines],
            island: None,
            failure: Some(reason),
        }
    }

    fn early(&self, states: &[f64], orbits: &Trajectories) -> f64 {
        let row = 2 * orbits.count();
        let early = row..row * (self.options.early + 1);
        root_mean_square_distance(&states[early.clone()], &self.reference.values()[early], 2)
    }

    fn early_of(&self, orbits: &Trajectories, m: usize) -> f64 {
        let early = |of: &Trajectories| -> Vec<f64> {
            of.orbit(m).skip(1).take(self.options.early).flatten().copied().collect()
        };
        root_mean_square_distance(&early(orbits), &early(self.reference), 2)
    }

    /// The median and the largest distance of the last points of a line from the surface of the
    /// reference.
    fn surface(&self, orbits: &Trajectories, m: usize) -> [f64; 2] {
        let surface: Vec<f64> = self.reference.orbit(m).flatten().copied().collect();
        let first = orbits.states() - self.options.last;
        let points: Vec<f64> = orbits.orbit(m).skip(first).flatten().copied().collect();
        let mut distances = distances_to_set(&points, &surface, 2);
        distances.sort_by(f64::total_cmp);
        let largest = distances.iter().copied().fold(0.0, max_or_nan);
        let median = distances[distances.len() / 2];
        [if largest.is_nan() { f64::NAN } else { median }, largest]
    }

    /// The standard deviation of H over its mean along each line.
    fn oscillation(&self, orbits: &Trajectories) -> Vec<f64> {
        let of = |m: usize| {
            let energies: Vec<f64> = orbits.orbit(m).map(|z| self.system.energy(z, 0.0)).collect();
            let count = energies.len() as f64;
            let mean = energies.iter().sum::<f64>() / count;
            let square = energies.iter().map(|e| (e - mean) * (e - mean)).sum::<f64>() / count;
            libm::sqrt(square) / mean.abs()
        };
        (0..orbits.count()).into_par_iter().map(of).collect()
    }

    /// Where, on the line of symmetry through the middle of an island, a map is locked to the
    /// resonance of the perturbation.
    fn island(&self, map: &Orbits<'_>) -> Result<Option<LockedInterval>, Error> {
        let Some((iota, radius)) = self.system.resonance() else { return Ok(None) };
        let (steps, winding) = (self.options.island, iota * self.interval / TAU);
        let parts = f64::from(self.system.poloidal.unsigned_abs());
        let on = |theta: f64| {
            let locked = |radii: &[f64]| -> Result<Vec<bool>, Error> {
                let points: Vec<f64> =
                    radii.iter().flat_map(|radius| self.system.point(*radius, theta)).collect();
                let orbits = map(&points, steps)?;
                let found = winding_numbers(&orbits, winding, |z| self.system.polar(z).1);
                // Within an island of |m| parts the angle stays in one of them.
                let locked = |w: &f64| (w - winding).abs() * (steps as f64) < 1.0 / parts;
                Ok(found.iter().map(locked).collect())
            };
            locked_interval(radius, reach_around(radius), locked)
        };
        // Middles and corners of islands by turns.
        let [one, other] = [on(0.0)?, on(PI / parts)?];
        let width = |locked: Option<LockedInterval>| locked.map_or(0.0, LockedInterval::width);
        Ok(if width(one) >= width(other) { one } else { other })
    }
}

/// What a network came to from each of its initial weights.
#[derive(Serialize)]
struct OfSeeds {
    network: String,
    found: Vec<Found>,
}

impl SurfacesOptions {
    /// Networks that are trained more than once; `first` has what was found of the first weights of each.
    fn of_seeds(
        &self,
        context: &mut Context<'_>,
        judge: &Judge<'_>,
        first: &[Found],
    ) -> Result<Vec<OfSeeds>, RunError> {
        let initial = self.initial(judge.system).concat();
        let mut out = Vec::new();
        for (BySeed { network, seeds }, first) in context.by_network()?.into_iter().zip(first) {
            if seeds.len() < 2 {
                continue;
            }
            let mut found = vec![first.clone()];
            for trained in &seeds[1..] {
                let name = &trained.spec.name;
                if let Some(reason) = &trained.lost {
                    found.push(judge.lost(name, None, reason.clone()));
                    continue;
                }
                let by = |points: &[f64], steps: usize| of_model(trained.model(), points, steps);
                let one = context.stage(&format!("surfaces of {name}"), |_| {
                    let orbits = by(&initial, self.steps)?;
                    Ok(judge.of(name, None, &orbits, judge.island(&by)?))
                });
                found.push(match one {
                    Err(reason @ Error::Diverged { .. }) => {
                        judge.lost(name, None, reason.to_string())
                    }
                    other => other?,
                });
                if context.interrupted() {
                    return Err(RunError::Interrupted);
                }
            }
            out.push(OfSeeds { network, found });
        }
        Ok(out)
    }

    fn initial(&self, system: &FieldLines) -> Vec<Vec<f64>> {
        self.radii.iter().map(|radius| system.point(*radius, self.theta).to_vec()).collect()
    }

    /// All methods over the early points, on one thread.
    fn timed(
        &self,
        system: &System,
        interval: f64,
        models: &[Rc<Trained>],
        tables: &[MadeTable],
        (reference, reference_error): (&Trajectories, f64),
    ) -> Result<Comparison, Error> {
        let models: Vec<_> = models.iter().map(|one| (&one.spec.name[..], one.model())).collect();
        let integrators = self.integrators.iter().flat_map(|entry| {
            entry.steps.iter().map(move |&steps| (entry.integrator, system, steps))
        });
        let compared = Compared {
            models: &models,
            integrators: integrators.collect(),
            tables,
            request: Rollout { steps: self.early, every: 1 },
            interval,
            reference: &reference.values()[..2 * reference.count() * (self.early + 1)],
            count: reference.count(),
            dim: 2,
            reference_error,
        };
        compared.compare(self.rounds)
    }

    /// Error against run time, a curve for each method: one by one, and from the surfaces.
    fn methods_figure(&self, early: &[WorkPrecision], surfaces: &[WorkPrecision]) -> Figure {
        let panel = |title: String, y_label: &str, methods: &[WorkPrecision]| Panel {
            title,
            y_label: y_label.into(),
            ..work_precision_panel("µs a turn", methods, MICRO_A_TURN)
        };
        Figure::in_a_row(
            METHODS,
            "Error against run time on this machine, one thread, lines together: a point for each number of steps or \
             nodes, and one for each network; lines from quartile to quartile. Lower and further left is better.",
            vec![
                panel(
                    format!("one by one over {} maps", self.early),
                    "rms distance from the reference",
                    early,
                ),
                panel(
                    format!("after {} maps", self.steps),
                    "largest distance from the surface",
                    surfaces,
                ),
            ],
        )
    }

    /// r over θ of the last points of each line.
    fn figure(
        &self,
        system: &FieldLines,
        judge: &Judge<'_>,
        models: &[Rc<Trained>],
        rolled: &[Trajectories],
    ) -> Figure {
        let panel = |title: &str, orbits: &Trajectories| {
            let series = (0..orbits.count()).map(|m| {
                let last = orbits.orbit(m).skip(orbits.states() - self.last);
                let points = last.map(|z| {
                    let (radius, theta) = system.polar(z);
                    (theta / PI, radius)
                });
                Series::unnamed(orbit_color(m), Style::Dots, points.collect())
            });
            Panel {
                title: title.to_owned(),
                x_label: "θ/π".into(),
                y_label: "r".into(),
                series: series.collect(),
                ..Panel::default()
            }
        };
        let mut panels = vec![panel("reference", judge.reference)];
        panels.extend(models.iter().zip(rolled).map(|(m, orbits)| panel(&m.spec.name, orbits)));
        let caption = "The last points of each line, turn after turn, on its surface.";
        let columns = 2;
        let figure = Figure::in_a_row(SECTION, caption, panels);
        Figure { columns, same_axes: SameAxes::First, ..figure }
    }
}

struct Results<'a> {
    options: &'a SurfacesOptions,
    island: Option<LockedInterval>,
    found: Vec<Found>,
    seeds: Vec<OfSeeds>,
    reference: &'a Judge<'a>,
}

impl Results<'_> {
    fn words(&self, error: f64) -> String {
        let options = self.options;
        let oscillation = self.reference.oscillation(self.reference.reference);
        let largest = oscillation.into_iter().fold(0.0, max_or_nan);
        let island = match self.island {
            Some(locked) => {
                format!(
                    "from r = {:.4} to {:.4}, {:.4} wide",
                    locked.low,
                    locked.high,
                    locked.width()
                )
            }
            None => "none".into(),
        };
        format!(
            "{} lines from r = {} to {} over {} maps; lengths are in units of the minor radius. One by \
             one: the root mean square distance from the reference over the first {}. From the \
             surface: of the last {} points of each line from the nearest of all those of the \
             reference, which itself errs by {error:.1e} at the end; below the spacing of these points a distance \
             ranks no methods. H of the reference oscillates \
             by up to {:.2} % on the section. The island of the reference: {island}, from \
             {} maps.",
            options.radii.len(),
            options.radii[0],
            options.radii[options.radii.len() - 1],
            options.steps,
            options.early,
            options.last,
            100.0 * largest,
            options.island
        )
    }

    /// Why methods have no orbits, a line each; empty where all have some.
    fn words_of_failures(&self) -> String {
        let line = |of: &Found| {
            let steps = of.steps.map_or(String::new(), |steps| format!(", {steps}"));
            of.failure.as_ref().map(|reason| format!("- {}{steps}: {reason}", of.name))
        };
        let lines: Vec<String> = self.found.iter().filter_map(line).collect();
        if lines.is_empty() {
            String::new()
        } else {
            format!("Without orbits:\n\n{}", lines.join("\n"))
        }
    }

    fn table(&self) -> Table {
        let mut table = Table::new([
            ("method", Format::Exact),
            ("steps in a map, or nodes", Format::Exact),
            ("one by one", Format::Exponent(2)),
            ("from the surface, median", Format::Exponent(2)),
            ("largest", Format::Exponent(2)),
            ("oscillation of H, largest", Format::Percent),
            ("width of the island", Format::Fixed(4)),
            ("differs by", Format::Percent),
        ]);
        for of in &self.found {
            let width = of.island.map(|[low, high]| high - low);
            let differs = self.island_differs(of);
            let name = if of.steps.is_some() { of.name.clone() } else { format!("`{}`", of.name) };
            table.push([
                name.into(),
                of.steps.into(),
                finite(of.early).into(),
                finite(of.median()).into(),
                finite(of.largest()).into(),
                finite(of.oscillation.iter().copied().fold(0.0, max_or_nan)).into(),
                width.map_or(Cell::Text("none".into()), Cell::Number),
                differs.into(),
            ]);
        }
        table
    }

    /// By how much the width of an island differs from that of the reference, as a share of that; 1 without one.
    fn island_differs(&self, of: &Found) -> Option<f64> {
        let width = of.island.map_or(0.0, |[low, high]| high - low);
        self.island.map(|own| (width / own.width() - 1.0).abs())
    }

    /// None where each network was trained once.
    fn table_of_seeds(&self) -> Option<Table> {
        let mut table = Table::new([
            ("network", Format::Exact),
            ("seeds", Format::Exact),
            ("one by one, median", Format::Exponent(2)),
            ("worst", Format::Exponent(2)),
            ("from the surface, furthest line, median", Format::Exponent(2)),
            ("worst", Format::Exponent(2)),
            ("island differs by, median", Format::Percent),
            ("worst", Format::Percent),
        ]);
        for OfSeeds { network, found } in &self.seeds {
            let mut row = vec![format!("`{network}`").into(), found.len().into()];
            let early = found.iter().map(|one| Some(one.early));
            let furthest = found.iter().map(|one| Some(one.largest()));
            let islands = found.iter().map(|one| self.island_differs(one));
            let all = [
                MedianAndWorst::of(early),
                MedianAndWorst::of(furthest),
                MedianAndWorst::of(islands),
            ];
            row.extend(all.iter().flat_map(|of| [of.median.into(), of.worst.into()]));
            table.push(row);
        }
        (!self.seeds.is_empty()).then_some(table)
    }

    fn words_of_times(&self) -> String {
        format!(
            "{HOW} Gauss–Legendre of one stage is the implicit midpoint rule. The fastest rival is that of \
             no larger error one by one."
        )
    }

    fn times(&self, comparison: &Comparison) -> Table {
        let mut table = Table::new([
            ("method", Format::Exact),
            ("steps in a map, or nodes", Format::Exact),
            ("µs a turn", Format::Magnitude),
            ("one alone", Format::Magnitude),
            ("one by one", Format::Exponent(2)),
            ("fastest rival as accurate", Format::Exact),
            ("takes as long", Format::Factor),
            ("one alone as long", Format::Factor),
        ]);
        for method in &comparison.methods {
            let best = method.error.filter(|_| method.setting.is_none());
            let best = best.and_then(|error| AtError::fastest(&comparison.methods, error));
            let ratio = best.zip(method.seconds).map(|(best, own)| best.seconds / own.median);
            let alone = best.and_then(|best| best.alone).zip(method.alone);
            let alone = alone.map(|(theirs, own)| theirs / own.median);
            table.push([
                method.name.clone().into(),
                method.setting.into(),
                method.seconds.map(|spread| spread.scaled(MICRO_A_TURN)).into(),
                method.alone.map(|spread| spread.scaled(MICRO_A_TURN)).into(),
                method.error.into(),
                best.map(|best| named(best.method)).into(),
                ratio.into(),
                alone.into(),
            ]);
        }
        table
    }
}

/// A network beside the fastest rival that errs no more.
#[derive(Serialize)]
struct Gain {
    /// None where it has lost the lines.
    error: Option<f64>,
    /// None where no rival that was tried errs as little.
    rival: Option<String>,
    /// How many times as long the rival takes.
    factor: Option<f64>,
    /// After how many maps pairs and training are paid; none where the rival takes no longer.
    maps_that_pay: Option<f64>,
}

impl Gain {
    fn new(methods: &[WorkPrecision], network: &str, lost: f64, paid: f64, interval: f64) -> Self {
        let own = |method: &&WorkPrecision| method.setting.is_none() && method.name == network;
        let own = methods.iter().find(own);
        let known = own.and_then(|own| Some((own.error?, own.seconds?.median)));
        let known = known.filter(|(error, _)| *error <= lost);
        let against =
            known.and_then(|(error, seconds)| Some((AtError::fastest(methods, error)?, seconds)));
        Self {
            error: known.map(|(error, _)| error),
            rival: against.map(|(best, _)| named(best.method)),
            factor: against.map(|(best, seconds)| best.seconds / seconds),
            maps_that_pay: against.and_then(|(best, seconds)| {
                break_even(paid, seconds * interval, best.seconds * interval)
            }),
        }
    }

    fn words(&self) -> String {
        let Some(error) = self.error else { return "it has lost the lines".into() };
        let error = Format::Exponent(1).number(error);
        let Some((rival, factor)) = self.rival.as_ref().zip(self.factor) else {
            return format!("{error}, and no rival that was tried errs as little");
        };
        let factor = Format::Factor.number(factor);
        let after = match self.maps_that_pay {
            Some(maps) => {
                let maps = Format::Exponent(1).number(maps);
                format!("pairs and training pay after {maps} maps")
            }
            None => {
                "pairs and training pay at no length: at this error the system needs no surrogate"
                    .into()
            }
        };
        format!("{error}, where the fastest rival ({rival}) takes {factor} as long; {after}")
    }
}

/// What a network is worth beside its rivals.
#[derive(Serialize)]
struct Worth {
    network: String,
    /// Seconds of pairs and training.
    paid: f64,
    one_by_one: Gain,
    from_surfaces: Gain,
}

impl Worth {
    fn words(&self, options: &SurfacesOptions) -> String {
        format!(
            "- `{}`, {} s of pairs and training. One by one over {} maps: {}. From the surfaces after {} maps, at most: \
             {}.",
            self.network,
            Format::Fixed(0).number(self.paid),
            options.early,
            self.one_by_one.words(),
            options.steps,
            self.from_surfaces.words()
        )
    }
}
