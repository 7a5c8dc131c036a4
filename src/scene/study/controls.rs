//! Maps of a section of a machine at values of its controls that were never traced, their derivatives by the controls,
//! and the search for values of a control.

use super::section_maps::SectionMap;
use super::shared::Study;
use crate::error::Error;
use crate::flow::{LineMap, LineSection, PolynomialFamily, Trajectories, turns_of_trace};
use crate::io::{Provenance, StoredModel};
use crate::measure::{
    orbits::{periodic_orbit, rotation_numbers},
    timing::root_mean_square_distance,
};
use crate::network::Rollout;
use crate::phase::Direction;
use crate::scalar::max_or_nan;
use crate::scene::bibliography::{BIRKHOFF_AVERAGES, RESIDUES};
use crate::scene::context::{Context, LINES, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Axis, Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Cell, Findings, Format, Section, Table};
use crate::scene::line_data::{LineData, TracedLines};
use crate::scene::setup::{MOST, Need};
use crate::system::CoilField;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::f64::consts::TAU;
use std::time::Instant;

const FIGURE: &str = "controls";

/// Maps of a machine at values of its controls.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControlsOptions {
    /// Values of all controls that no network was trained on: a row for each machine.
    pub unseen: Vec<Vec<f64>>,
    /// The number of lines, from the axis to the reach, that are judged.
    pub lines: usize,
    /// The number of maps over which they are judged.
    pub maps: usize,
    /// The step of the differences that derivatives are compared with, as a share of the range.
    pub difference: f64,
    /// The number of maps over which the turns of a line half-way to the reach are averaged.
    pub turning: usize,
    /// The degrees of rival maps: polynomials of least squares in R and Z whose coefficients are polynomials of the
    /// controls.
    #[serde(default)]
    pub polynomials: Vec<usize>,
    /// Changes of |ι| on the axis; for each, the value of the first control that makes it is looked for.
    #[serde(default)]
    pub aims: Vec<f64>,
}

/// Fewer maps determine no rotation.
const LEAST_TURNING: usize = 128;
/// No polynomial is of a higher degree.
const MOST_DEGREE: usize = 60;
/// The states of more do not fit into memory.
const MOST_MAPS: usize = 1_000_000;
/// Newton steps for an aim.
const STEPS: usize = 20;
/// An aim is met when |ι| is as near.
const MET: f64 = 1e-12;

impl Study for ControlsOptions {
    fn name(&self) -> &'static str {
        "controls"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::TargetFlow, Need::FlowTime, Need::Data, Need::Models]
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        Error::check_count_range("lines", self.lines, 2, 1000)?;
        Error::check_count_range("maps", self.maps, 1, MOST_MAPS)?;
        Error::check_count_range("turning", self.turning, LEAST_TURNING, MOST_MAPS)?;
        Error::check_count_range("unseen", self.unseen.len(), 1, MOST)?;
        Error::check_range("difference", self.difference, 1e-6, 0.25)?;
        for &degree in &self.polynomials {
            Error::check_count_range("polynomials", degree, 1, MOST_DEGREE)?;
        }
        self.aims.iter().try_for_each(|aim| Error::check_finite("aims", *aim))?;
        let Some(data) = scene.setup.data.as_ref() else { return Ok(()) };
        let controls = data.lines.as_ref().and_then(|lines| lines.controls.as_ref());
        let Some(controls) = controls else {
            return Err(Error::invalid("data", "no data.lines.controls", "controls of a machine"));
        };
        let ranges = controls.of_network()?;
        for row in &self.unseen {
            Error::check_count("unseen", controls.list.len(), row.len())?;
            row.iter().try_for_each(|value| Error::check_finite("unseen", *value))?;
            if controls.values.contains(row) || controls.held_out.contains(row) {
                return Err(Error::invalid("unseen", format!("{row:?}"), "values not learnt"));
            }
            if let Some((range, value)) = ranges.first_outside(row) {
                let expected =
                    format!("values of {} from {} to {}", range.name, range.low, range.high);
                return Err(Error::invalid("unseen", value, expected));
            }
        }
        Ok(())
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![FIGURE]
    }

    fn cites(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![BIRKHOFF_AVERAGES, RESIDUES]
    }

    fn shorten(&mut self) {
        self.unseen.truncate(2);
        self.aims.truncate(1);
        self.maps = self.maps.div_ceil(4);
        self.turning = (self.turning / 4).max(LEAST_TURNING);
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let lines = context.lines()?;
        let declared = context.scene.setup.data.as_ref().and_then(|data| data.lines.as_ref());
        let missing = || Error::invalid("data", "no data.lines.controls", "controls of a machine");
        let (declared, of) = declared.zip(lines.controls.as_ref()).ok_or_else(missing)?;
        let near = lines.section.turns();
        // Of a hyperbolic axis; others may have turns.
        let near = if near.is_nan() { 0.0 } else { near };
        let winding = Winding { maps_a_turn: lines.maps_a_turn(), near };
        let machine = Machine { declared, lines: &lines, winding };
        let held_out = declared.controls.as_ref().map_or(0, |controls| controls.held_out.len());
        let rows = declared.controls.iter().flat_map(|controls| &controls.values);
        let rows = rows.map(|row| (row, true)).chain(self.unseen.iter().map(|row| (row, false)));
        // What may fail, before anything is trained.
        let mut truths = Vec::new();
        for (values, learnt) in rows {
            let name = format!("lines at {values:?}");
            let made = context.stage(&name, |context| {
                machine.truth(self, values, learnt, &|| context.interrupted())
            })?;
            truths.push(made.ok_or(RunError::Interrupted)?);
        }
        let slopes = context.stage("derivatives of the field", |context| {
            machine.slopes(self, &|| context.interrupted())
        })?;
        let slopes = slopes.ok_or(RunError::Interrupted)?;
        let (models, data) = (context.models()?, context.data()?);
        let mut found = Vec::new();
        for trained in &models {
            let stored = StoredModel {
                model: trained.model().clone(),
                units: data.units.clone(),
                section: Some(lines.chart.clone()),
                provenance: Provenance::of_scene(context.scene.name),
            };
            let name = trained.spec.name.clone();
            let one = context.stage(&format!("controls of {name}"), |_| {
                let mut judged = Vec::new();
                for truth in &truths {
                    let at = Box::new(stored.at_controls(&truth.values)?);
                    judged.push(truth.judge(&SectionMap::Network(at), winding)?);
                }
                let derivatives = machine.derivatives(self, &stored, &truths[0])?;
                let aims = machine.aims(self, &stored, &slopes)?;
                Ok::<_, Error>(OfNetwork { name, judged, derivatives, aims })
            })?;
            found.push(one);
        }
        let mut rivals = Vec::new();
        for &degree in &self.polynomials {
            let name = format!("degree {degree}");
            let one = context.stage(&format!("polynomial of {name}"), |_| {
                let family = PolynomialFamily::fit(&lines.training, degree, of)?;
                let mut judged = Vec::new();
                for truth in &truths {
                    let map = SectionMap::Polynomial(family.at_controls(&truth.values)?);
                    judged.push(truth.judge(&map, winding)?);
                }
                Ok::<_, Error>(Rival {
                    name: name.clone(),
                    parameters: family.parameters(),
                    judged,
                })
            })?;
            rivals.push(one);
        }
        let (truths, found) = (&truths, &found);
        let results = Results { options: self, truths, slopes: &slopes, found, rivals: &rivals };
        let names: Vec<String> = of.ranges.iter().map(|range| range.name.clone()).collect();
        let mut summary = vec![
            Block::Text(results.words(&of.describe(), &machine)),
            Block::Table(results.at_values(&names, false)),
            Block::Text(
                "Derivatives by the controls, in the middle of their ranges: exact, by dual numbers through the network, \
                 and by differences of the network and of lines of the coils."
                    .into(),
            ),
            Block::Table(results.derivatives(&names)),
        ];
        if !self.aims.is_empty() {
            summary.push(Block::Text(format!(
                "{} for which |ι| on the axis changes by so much from the middle of the ranges, by Newton's method with \
                 the exact derivative; the coils say what comes of it.",
                names[0]
            )));
            summary.push(Block::Table(results.aims()));
        }
        let times = vec![
            Block::Text(format!(
                "Lines of {} machines took {:.1} s, before any training. To know the axis, ι there and its derivative at \
                 other values:",
                truths.len() - self.unseen.len() + held_out,
                context.seconds_of(LINES)
            )),
            Block::Table(results.times()),
        ];
        let mut figures = Vec::new();
        if context.draws(FIGURE) {
            figures.push(results.figure(&names));
        }
        let timed: Vec<_> = found.iter().map(|one| (&one.name, &one.aims.seconds)).collect();
        let details = vec![
            Block::Text("At values that were learnt:".into()),
            Block::Table(results.at_values(&names, true)),
        ];
        Ok(Findings {
            title: "Controls".into(),
            results: Section {
                summary,
                details,
                data: json!({
                    "controls": of,
                    "reference": truths.iter().map(Truth::data).collect::<Vec<_>>(),
                    "slopes": slopes,
                    "networks": found,
                    "rivals": rivals,
                }),
            },
            timings: Section { summary: times, data: json!(timed), ..Section::default() },
            figures,
            ..Findings::default()
        })
    }
}

/// What turns Tr M of an axis into |ι|: the maps of a turn, and about how many turns lines make in a map.
#[derive(Clone, Copy)]
struct Winding {
    maps_a_turn: f64,
    near: f64,
}

impl Winding {
    /// |ι| of an axis of this Tr M, NaN where lines leave it.
    fn iota(self, trace: f64) -> f64 {
        turns_of_trace(trace, self.near).0.abs() * self.maps_a_turn
    }

    /// The derivative of |ι| by Tr M.
    fn iota_by_trace(self, trace: f64) -> f64 {
        let (turns, sign) = turns_of_trace(trace, self.near);
        let by_part = -0.5 * self.maps_a_turn / (TAU * libm::sqrt(1.0 - 0.25 * trace * trace));
        turns.signum() * sign * by_part
    }
}

/// The axis of the coils, and Tr M there.
fn axis_of(section: &LineSection) -> ([f64; 2], f64) {
    let axis = section.axis();
    let (_, [[a, _], [_, d]]) = section.map().with_jacobian(axis);
    (axis, a + d)
}

/// The coils of a scene.
struct Machine<'a> {
    declared: &'a LineData,
    lines: &'a TracedLines,
    winding: Winding,
}

/// Lines at some values of the controls.
struct Truth {
    values: Vec<f64>,
    learnt: bool,
    axis: [f64; 2],
    trace: f64,
    /// The absolute rotational transform |ι| on the magnetic axis.
    iota: f64,
    /// What a map errs by.
    error: f64,
    starts: Vec<f64>,
    /// Inputs and outputs of all maps, without those of lines that are lost.
    pairs: [Vec<f64>; 2],
    /// The points (R, Z) of all lines after the last map, in metres; NaN of lost lines.
    end: Vec<f64>,
    maps: usize,
}

/// How a network does at some values.
#[derive(Serialize)]
struct AtValues {
    /// Root mean square of one map.
    one: f64,
    /// The furthest of all lines after all maps.
    after: f64,
    axis: f64,
    trace: f64,
    iota: f64,
}

/// Derivatives of the axis and of what lines do near it, by each control.
#[derive(Serialize)]
struct Slopes {
    /// Of the axis, (R, Z).
    axis: Vec<[f64; 2]>,
    trace: Vec<f64>,
    /// Of |ι| on the axis.
    iota: Vec<f64>,
    /// Of the turns of a line.
    turns: Vec<f64>,
}

#[derive(Serialize)]
struct Derivatives {
    exact: Slopes,
    differences: Slopes,
    /// The largest difference of ∂P/∂λ from differences over lines, over the largest of them, for each control.
    of_map: Vec<f64>,
}

/// A control that was looked for.
#[derive(Serialize)]
struct Aim {
    change: f64,
    value: f64,
    steps: usize,
    /// The network has it there.
    met: bool,
    /// What the coils make of it, beyond what was wanted.
    missed: f64,
    /// The value that the coils lead to by themselves, and how often they were asked.
    of_coils: Option<(f64, usize)>,
    /// It is not within the range of the control.
    outside: bool,
}

#[derive(Serialize)]
struct Aims {
    list: Vec<Aim>,
    /// Of a query of the network, and of the coils.
    #[serde(skip)]
    seconds: [f64; 2],
}

/// Another family of maps, beside networks.
#[derive(Serialize)]
struct Rival {
    name: String,
    parameters: usize,
    judged: Vec<AtValues>,
}

#[derive(Serialize)]
struct OfNetwork {
    name: String,
    judged: Vec<AtValues>,
    derivatives: Derivatives,
    aims: Aims,
}

/// f′ from values at −2h, −h, h and 2h, to fourth order.
fn slope(values: [f64; 4], h: f64) -> f64 {
    (8.0 * (values[2] - values[1]) - (values[3] - values[0])) / (12.0 * h)
}

/// What slopes are taken of, at some values.
struct Known {
    axis: [f64; 2],
    trace: f64,
    turns: f64,
}

/// What is known at values of the controls; None where a run is stopped.
type AsksFor<'a> = &'a mut dyn FnMut(&[f64]) -> Result<Option<Known>, Error>;

impl Slopes {
    /// The quantities that derivatives are taken of, in the order of [`Slopes::by`].
    const ROWS: [&str; 5] = [
        "R of the axis [m]",
        "Z of the axis [m]",
        "its Tr M",
        "its |ι|",
        "turns of a line in a map",
    ];

    /// The derivatives of the quantities in `ROWS` by one control.
    fn by(&self, control: usize) -> [f64; 5] {
        let [r, z] = self.axis[control];
        [r, z, self.trace[control], self.iota[control], self.turns[control]]
    }

    /// By differences along each control, of what is known at values of them.
    fn by_differences(
        machine: &Machine<'_>,
        options: &ControlsOptions,
        known: AsksFor<'_>,
    ) -> Result<Option<Self>, Error> {
        let (nominal, steps) = machine.nominal_and_steps(options);
        let winding = machine.winding;
        let (axis, trace) = (Vec::new(), Vec::new());
        let mut out = Self { axis, trace, iota: Vec::new(), turns: Vec::new() };
        for (control, h) in steps.iter().enumerate() {
            let mut all = Vec::new();
            for step in [-2.0, -1.0, 1.0, 2.0] {
                let mut at = nominal.clone();
                at[control] += step * h;
                let Some(found) = known(&at)? else { return Ok(None) };
                all.push(found);
            }
            let of = |f: &dyn Fn(&Known) -> f64| slope([0, 1, 2, 3].map(|k| f(&all[k])), *h);
            out.axis.push([0, 1].map(|k| of(&|known| known.axis[k])));
            out.trace.push(of(&|known| known.trace));
            out.iota.push(of(&|known| winding.iota(known.trace)));
            out.turns.push(of(&|known| known.turns));
        }
        Ok(Some(out))
    }
}

impl Machine<'_> {
    fn nominal_and_steps(&self, options: &ControlsOptions) -> (Vec<f64>, Vec<f64>) {
        let ranges = self.lines.controls.iter().flat_map(|controls| &controls.ranges);
        ranges.map(|range| (range.nominal(), options.difference * (range.high - range.low))).unzip()
    }

    /// None where `stopped` says so.
    fn truth(
        &self,
        options: &ControlsOptions,
        values: &[f64],
        learnt: bool,
        stopped: &dyn Fn() -> bool,
    ) -> Result<Option<Truth>, Error> {
        let section = self.declared.section_like(&self.lines.section, values)?;
        let (axis, trace) = axis_of(&section);
        let (count, maps) = (options.lines, options.maps);
        let Some(states) = LineData::traced(&section, count, maps, stopped)? else {
            return Ok(None);
        };
        let row = 2 * count;
        let (starts, end) = (states[..row].to_vec(), states[maps * row..].to_vec());
        let moves = states.chunks_exact(2).zip(states[row..].chunks_exact(2));
        let (mut input, mut output) = (Vec::new(), Vec::new());
        for (from, to) in moves.filter(|(_, to)| to.iter().all(|v| v.is_finite())) {
            input.extend_from_slice(from);
            output.extend_from_slice(to);
        }
        let (values, pairs, error) = (values.to_vec(), [input, output], section.error());
        let iota = self.winding.iota(trace);
        Ok(Some(Truth { values, learnt, axis, trace, iota, error, starts, pairs, end, maps }))
    }

    /// A point half-way to the reach, and the axis, in the middle of the ranges.
    fn line(&self) -> [[f64; 2]; 2] {
        let axis = self.lines.section.axis();
        [[axis[0] + 0.5 * self.lines.section.request().reach, axis[1]], axis]
    }

    /// Of the coils; None where `stopped` says so.
    fn slopes(
        &self,
        options: &ControlsOptions,
        stopped: &dyn Fn() -> bool,
    ) -> Result<Option<Slopes>, Error> {
        let [start, centre] = self.line();
        Slopes::by_differences(self, options, &mut |values| {
            let section = self.declared.section_like(&self.lines.section, values)?;
            let (axis, trace) = axis_of(&section);
            let map = SectionMap::Coils(section.map());
            let Some(states) = map.followed(&start, options.turning, stopped)? else {
                return Ok(None);
            };
            let turns = turns(states, section.turns(), centre)?;
            Ok(Some(Known { axis, trace, turns }))
        })
    }

    fn derivatives(
        &self,
        options: &ControlsOptions,
        stored: &StoredModel,
        truth: &Truth,
    ) -> Result<Derivatives, Error> {
        let (nominal, steps) = self.nominal_and_steps(options);
        let count = nominal.len();
        let winding = self.winding;
        let [start, centre] = self.line();
        let none = || Error::invalid("controls", "differences", "values of a network");
        let differences = Slopes::by_differences(self, options, &mut |values| {
            let at = stored.at_controls(values)?;
            let orbit = at.periodic_orbit(&centre, 1)?;
            let states = at.rollout(&start, Rollout { steps: options.turning, every: 1 })?;
            let axis = [orbit.points[0][0], orbit.points[0][1]];
            let turns = turns(states, winding.near, centre)?;
            Ok(Some(Known { axis, trace: orbit.trace(), turns }))
        })?;
        let at = stored.at_controls(&nominal)?;
        let orbit = at.periodic_orbit(&centre, 1)?;
        let response = stored.orbit_response(&nominal, &orbit)?;
        let (_, turning) = stored.rotation_response(&nominal, start, centre, options.turning)?;
        let by_trace = winding.iota_by_trace(orbit.trace());
        let exact = Slopes {
            axis: (0..count).map(|k| [response.moved[k], response.moved[count + k]]).collect(),
            iota: response.traces.iter().map(|trace| by_trace * trace).collect(),
            trace: response.traces,
            turns: turning,
        };
        // Points of lines that stay in the chart at all four values.
        let half = 2 * (truth.starts.len() / 4);
        let points = truth.starts[..half].to_vec();
        let derivatives = stored.control_derivatives(&nominal, &points)?;
        let mut of_map = Vec::new();
        for (control, h) in steps.iter().enumerate() {
            let mut images = Vec::new();
            for step in [-2.0, -1.0, 1.0, 2.0] {
                let mut values = nominal.clone();
                values[control] += step * h;
                let mut moved = points.clone();
                stored.at_controls(&values)?.map_points(Direction::Forward, &mut moved)?;
                images.push(moved);
            }
            let (mut size, mut apart) = (0.0, 0.0);
            for k in 0..points.len() {
                let by_differences = slope([0, 1, 2, 3].map(|i| images[i][k]), *h);
                let exact = derivatives[k * count + control];
                size = max_or_nan(size, exact.abs());
                apart = max_or_nan(apart, (exact - by_differences).abs());
            }
            of_map.push(apart / size);
        }
        Ok(Derivatives { exact, differences: differences.ok_or_else(none)?, of_map })
    }

    fn aims(
        &self,
        options: &ControlsOptions,
        stored: &StoredModel,
        slopes: &Slopes,
    ) -> Result<Aims, Error> {
        let (nominal, _) = self.nominal_and_steps(options);
        let winding = self.winding;
        let centre = self.lines.section.axis();
        let ranges: Vec<_> = self.lines.controls.iter().flat_map(|of| &of.ranges).collect();
        // |ι| on the axis and its derivative by the first control.
        let query = |value: f64, guess: &mut Vec<f64>| -> Result<(f64, f64), Error> {
            let mut values = nominal.clone();
            values[0] = value;
            let orbit = stored.at_controls(&values)?.periodic_orbit(guess, 1)?;
            let response = stored.orbit_response(&values, &orbit)?;
            guess.clone_from(&orbit.points[0]);
            let trace = orbit.trace();
            Ok((winding.iota(trace), winding.iota_by_trace(trace) * response.traces[0]))
        };
        let of_coils = |value: f64| -> Result<f64, Error> {
            let mut values = nominal.clone();
            values[0] = value;
            // No more than it takes: what the section was calibrated with.
            let section = &self.lines.section;
            let field = CoilField::new(&self.declared.coils_at(&values)?, section.points())?;
            let request = section.request();
            let map = LineMap::new(&field, request.phi, request.angle, section.map().steps())?;
            let (_, [[a, _], [_, d]]) = map.with_jacobian(map.axis(section.axis())?);
            Ok(winding.iota(a + d))
        };
        let mut seconds = [f64::INFINITY; 2];
        let mut timed = |number: usize, work: &mut dyn FnMut() -> Result<f64, Error>| {
            let start = Instant::now();
            let out = work();
            let spent = start.elapsed().as_secs_f64();
            if spent < seconds[number] {
                seconds[number] = spent;
            }
            out
        };
        let here = timed(0, &mut || Ok(query(nominal[0], &mut centre.to_vec())?.0))?;
        let coils_here = timed(1, &mut || of_coils(nominal[0]))?;
        let mut list = Vec::new();
        for &change in &options.aims {
            let (mut value, mut steps, mut guess) = (nominal[0], 0, centre.to_vec());
            let mut met = false;
            while steps < STEPS && ranges[0].contains(value) {
                let mut slope = f64::NAN;
                let found = timed(0, &mut || {
                    let (found, by_value) = query(value, &mut guess)?;
                    slope = by_value;
                    Ok(found)
                })?;
                steps += 1;
                let missed = here + change - found;
                met = missed.abs() <= MET;
                if met {
                    break;
                }
                value += missed / slope;
            }
            // One that is no number has led nowhere.
            let outside = value.is_finite() && !ranges[0].contains(value);
            let (mut missed, mut by_coils) = (f64::NAN, None);
            if met {
                missed = timed(1, &mut || of_coils(value))? - coils_here - change;
                let mut ask = |value: f64| Ok(timed(1, &mut || of_coils(value))? - coils_here);
                by_coils = secant(&mut ask, nominal[0], slopes.iota[0], change)?;
            }
            list.push(Aim { change, value, steps, met, missed, of_coils: by_coils, outside });
        }
        Ok(Aims { list, seconds })
    }
}

/// Where a function that is 0 at the start is `wanted`, and how often it was asked, by the secant method from the slope
/// at the start.
fn secant(
    ask: &mut dyn FnMut(f64) -> Result<f64, Error>,
    start: f64,
    slope: f64,
    wanted: f64,
) -> Result<Option<(f64, usize)>, Error> {
    /// As near as lines of the coils are.
    const NEAR: f64 = 1e-10;
    let (mut before, mut value) = ((start, 0.0), start + wanted / slope);
    for asked in 1..=STEPS {
        // Far from where it began there may be no axis.
        let Ok(found) = ask(value) else { return Ok(None) };
        if (found - wanted).abs() <= NEAR {
            return Ok(Some((value, asked)));
        }
        let slope = (found - before.1) / (value - before.0);
        (before, value) = ((value, found), value + (wanted - found) / slope);
    }
    Ok(None)
}

/// The turns of one line about a centre in a map.
fn turns(states: Vec<f64>, near: f64, centre: [f64; 2]) -> Result<f64, Error> {
    let orbit = Trajectories::new(states, 2, 1)?;
    let angle = |z: &[f64]| libm::atan2(z[1] - centre[1], z[0] - centre[0]);
    Ok(rotation_numbers(&orbit, near, angle)[0].turns)
}

impl Truth {
    fn judge(&self, map: &SectionMap<'_>, winding: Winding) -> Result<AtValues, Error> {
        let orbit = periodic_orbit(&|z: &[f64]| map.with_jacobian(z), &self.axis, 1).ok();
        let [input, output] = &self.pairs;
        let image = map.rollout(input, Rollout { steps: 1, every: 1 })?.split_off(input.len());
        let one = root_mean_square_distance(&image, output, 2);
        let end = map.rollout(&self.starts, Rollout { steps: self.maps, every: self.maps })?;
        let pairs = end[self.starts.len()..].chunks_exact(2).zip(self.end.chunks_exact(2));
        let kept = pairs.filter(|(_, truth)| truth.iter().all(|v| v.is_finite()));
        let after = kept.map(|(a, b)| libm::hypot(a[0] - b[0], a[1] - b[1])).fold(0.0, max_or_nan);
        let (mut axis, mut trace, mut by_iota) = (f64::NAN, f64::NAN, f64::NAN);
        if let Some(orbit) = orbit {
            let place = &orbit.points[0];
            axis = libm::hypot(place[0] - self.axis[0], place[1] - self.axis[1]);
            trace = orbit.trace() - self.trace;
            by_iota = winding.iota(orbit.trace()) - self.iota;
        }
        Ok(AtValues { one, after, axis, trace, iota: by_iota })
    }

    fn data(&self) -> serde_json::Value {
        json!({
            "values": self.values,
            "learnt": self.learnt,
            "axis": self.axis,
            "trace": self.trace,
            "error": self.error,
        })
    }

    fn words(&self) -> String {
        let values: Vec<String> = self.values.iter().map(ToString::to_string).collect();
        values.join(", ")
    }
}

struct Results<'a> {
    options: &'a ControlsOptions,
    truths: &'a [Truth],
    slopes: &'a Slopes,
    found: &'a [OfNetwork],
    rivals: &'a [Rival],
}

impl Results<'_> {
    /// Networks and rivals, each with what it comes to at all values.
    fn all(&self) -> impl Iterator<Item = (&str, &[AtValues])> {
        let networks = self.found.iter().map(|one| (one.name.as_str(), &one.judged[..]));
        networks.chain(self.rivals.iter().map(|one| (one.name.as_str(), &one.judged[..])))
    }

    /// The worst error of a map of a method, at values that are learnt and at others.
    fn worst(&self, judged: &[AtValues], learnt: bool) -> f64 {
        let both = self.truths.iter().zip(judged);
        both.filter(|(truth, _)| truth.learnt == learnt).map(|(_, at)| at.one).fold(0.0, max_or_nan)
    }

    fn words(&self, described: &str, machine: &Machine<'_>) -> String {
        let of = |(name, judged): (&str, &[AtValues])| {
            format!(
                "{name} errs by {} m a map at most at values that it was fitted to, and by {} m at others between them",
                Format::Exponent(1).number(self.worst(judged, true)),
                Format::Exponent(1).number(self.worst(judged, false)),
            )
        };
        let networks: Vec<String> = self.all().map(of).collect();
        let error = self.truths.iter().map(|truth| truth.error).fold(0.0, max_or_nan);
        format!(
            "{described}: networks were trained with lines of {} machines, {} pairs of each in the mean. {} lines of each, \
             over {} maps, are compared here; maps of the reference err by {} m. {}. At values that none was fitted to: the \
             root mean square of one map, the furthest line after all, how far off the axis is, its |ι| and Tr M.",
            self.truths.iter().filter(|truth| truth.learnt).count(),
            machine.lines.training.len() / self.truths.iter().filter(|truth| truth.learnt).count(),
            self.options.lines,
            self.options.maps,
            Format::Exponent(1).number(error),
            networks.join("; ")
        )
    }

    /// At values that are learnt, or at others.
    fn at_values(&self, names: &[String], learnt: bool) -> Table {
        let after = format!("after {} [m]", self.options.maps);
        let mut table = Table::new([
            (names.join(", "), Format::Exact),
            ("method".into(), Format::Exact),
            ("rms [m]".into(), Format::Exponent(1)),
            (after, Format::Exponent(1)),
            ("axis [m]".into(), Format::Exponent(1)),
            ("its |ι|".into(), Format::Fixed(6)),
            ("off by".into(), Format::Exponent(1)),
            ("Tr M".into(), Format::Exponent(1)),
        ]);
        let truths = self.truths.iter().enumerate();
        for (number, truth) in truths.filter(|(_, truth)| truth.learnt == learnt) {
            for (name, judged) in self.all() {
                let at = &judged[number];
                table.push([
                    truth.words().into(),
                    name.into(),
                    at.one.into(),
                    at.after.into(),
                    at.axis.into(),
                    truth.iota.into(),
                    at.iota.into(),
                    at.trace.into(),
                ]);
            }
        }
        table
    }

    fn derivatives(&self, names: &[String]) -> Table {
        let mut table = Table::new([
            ("derivative", Format::Exact),
            ("network", Format::Exact),
            ("exact", Format::Exponent(8)),
            ("from differences by", Format::Exponent(1)),
            ("of the coils, by differences", Format::Exponent(8)),
            ("from these by", Format::Exponent(1)),
        ]);
        for (k, name) in names.iter().enumerate() {
            for (row, what) in Slopes::ROWS.into_iter().enumerate() {
                for network in self.found {
                    let Derivatives { exact, differences, .. } = &network.derivatives;
                    let (own, coils) = (exact.by(k)[row], self.slopes.by(k)[row]);
                    table.push([
                        format!("{what} by {name}").into(),
                        network.name.as_str().into(),
                        own.into(),
                        (own - differences.by(k)[row]).abs().into(),
                        coils.into(),
                        (own - coils).abs().into(),
                    ]);
                }
            }
            for network in self.found {
                table.push([
                    format!("images of points by {name}").into(),
                    network.name.as_str().into(),
                    Cell::Missing,
                    network.derivatives.of_map[k].into(),
                    Cell::Missing,
                    Cell::Missing,
                ]);
            }
        }
        table
    }

    fn aims(&self) -> Table {
        let mut table = Table::new([
            ("change of |ι|", Format::Setting),
            ("network", Format::Exact),
            ("value", Format::Fixed(9)),
            ("steps", Format::Exact),
            ("missed by, of the coils", Format::Exponent(1)),
            ("value of the coils", Format::Fixed(9)),
            ("asked", Format::Exact),
        ]);
        for (number, change) in self.options.aims.iter().enumerate() {
            for network in self.found {
                let aim = &network.aims.list[number];
                let (value, asked) = match aim.of_coils {
                    Some((value, asked)) => (value.into(), asked.into()),
                    None => (Cell::Missing, Cell::Missing),
                };
                table.push([
                    (*change).into(),
                    network.name.as_str().into(),
                    match (aim.met, aim.outside) {
                        (true, _) => aim.value.into(),
                        (false, true) => "outside of the range".into(),
                        (false, false) => "not found".into(),
                    },
                    aim.steps.into(),
                    aim.missed.into(),
                    value,
                    asked,
                ]);
            }
        }
        table
    }

    fn times(&self) -> Table {
        let mut table = Table::new([
            ("network", Format::Exact),
            ("network [ms]", Format::Significant),
            ("coils, without the derivative [ms]", Format::Significant),
            ("as fast", Format::Factor),
        ]);
        for network in self.found {
            let [own, coils] = network.aims.seconds;
            table.push([
                network.name.as_str().into(),
                (1e3 * own).into(),
                (1e3 * coils).into(),
                (coils / own).into(),
            ]);
        }
        table
    }

    /// Errors of a map against the first control.
    fn figure(&self, names: &[String]) -> Figure {
        let mut series = Vec::new();
        for (number, (name, judged)) in self.all().enumerate() {
            for (learnt, style) in [(true, Style::Dashed), (false, Style::Marked)] {
                let both = self.truths.iter().zip(judged);
                let of = both.filter(|(truth, _)| truth.learnt == learnt);
                let mut points: Vec<(f64, f64)> =
                    of.map(|(truth, at)| (truth.values[0], at.one)).collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                let words = if learnt { "learnt" } else { "others" };
                let name = format!("{name}, {words}");
                series.push(Series {
                    name,
                    color: 2 * number + usize::from(!learnt),
                    style,
                    points,
                });
            }
        }
        let panel = Panel {
            title: "Error of a map".into(),
            x_label: names[0].clone(),
            y_label: "rms over lines [m]".into(),
            y: Axis::Log,
            series,
            ..Panel::default()
        };
        Figure::in_a_row(FIGURE, "Maps of machines at values of their controls.", vec![panel])
    }
}
