//! Steps forward and as many back, with plain numbers and on grids.

use super::shared::Study;
use super::work_precision::MOST_ROUNDS;
use crate::error::Error;
use crate::flow::Trajectories;
use crate::layer::CircleAction;
use crate::measure::timing::{Method, Spread, work_precision};
use crate::measure::trajectories::{drift, drift_exponent};
use crate::network::{
    Course, GridPoints, GyroceptronShape, InitialWeights, LayerSizes, Model, Pace, Rollout,
    grid_rollout,
};
use crate::phase::Direction;
use crate::random::Stream;
use crate::scalar::{Grid, GridNumbers, max_or_nan};
use crate::scene::bibliography::GRIDS;
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Axis, Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::setup::{MOST, Need};
use serde::{Deserialize, Serialize};
use serde_json::json;

const FIGURE: &str = "there-and-back";

/// Steps forward and as many back, with plain numbers and on grids.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThereAndBackOptions {
    /// The number of binary digits of the grids after the point.
    pub bits: u32,
    /// The number of steps forward, and of steps back.
    pub steps: usize,
    /// How often each time is taken.
    pub rounds: usize,
    /// The gyroceptrons with random weights that are iterated.
    pub networks: Vec<RandomGyroceptron>,
}

/// A gyroceptron with random weights, and where its orbits start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RandomGyroceptron {
    /// Its name in the report.
    pub name: String,
    /// The circle action Φ of the gyroceptron.
    pub circle_action: CircleAction,
    /// The number and the widths of the layers of ψ.
    pub psi: LayerSizes,
    /// The number and the widths of the layers of the near-identity map I_ε.
    pub near_identity: LayerSizes,
    /// The parameter ε of the gyroceptron.
    pub epsilon: f64,
    /// The angle θ, in radians.
    pub theta: f64,
    /// How its weights are drawn.
    pub weights: InitialWeights,
    /// The initial points, 2n numbers each.
    pub initial: Vec<Vec<f64>>,
}

impl RandomGyroceptron {
    fn model(&self, seed: u64) -> Result<Model, Error> {
        let shape = GyroceptronShape {
            circle_action: self.circle_action.clone(),
            psi: self.psi.widths(),
            near_identity: self.near_identity.widths(),
        };
        shape.architecture(self.epsilon).initialise(self.weights, self.theta, seed)
    }

    fn check(&self, grid: Grid) -> Result<(), Error> {
        let place = |e: Error| e.with_place(format!("networks: {}", self.name));
        self.model(0).map_err(place)?;
        Error::check_count_range("initial", self.initial.len(), 1, MOST).map_err(place)?;
        for z in &self.initial {
            let dim = 2 * self.circle_action.dof();
            Error::check_count("numbers of an initial point", dim, z.len()).map_err(place)?;
            grid.quantise(z).map_err(place)?;
        }
        Ok(())
    }
}

/// States kept on the way there.
const KEPT: usize = 1000;
/// Points that are timed, and their steps.
const TIMED: usize = 256;
const TIMED_STEPS: usize = 100;

impl Study for ThereAndBackOptions {
    fn name(&self) -> &'static str {
        "there_and_back"
    }

    fn needs(&self) -> &'static [Need] {
        &[]
    }

    fn check(&self, _: &Declared<'_>) -> Result<(), Error> {
        for numbers in GridNumbers::ALL {
            Grid::new(self.bits, numbers)?;
        }
        Error::check_count_range("steps", self.steps, KEPT, MOST)?;
        if !self.steps.is_multiple_of(KEPT) {
            return Err(Error::invalid("steps", self.steps, format!("a multiple of {KEPT}")));
        }
        Error::check_count_range("rounds", self.rounds, 1, MOST_ROUNDS)?;
        Error::check_count_range("networks", self.networks.len(), 1, MOST)?;
        let integers = Grid::new(self.bits, GridNumbers::Integers)?;
        self.networks.iter().try_for_each(|network| network.check(integers))
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![FIGURE]
    }

    /// A hundredth of the steps.
    fn shorten(&mut self) {
        self.steps = (self.steps / 100).next_multiple_of(KEPT).min(self.steps);
        self.rounds = self.rounds.min(3);
    }

    fn cites(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![GRIDS]
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let seed = context.scene.seed;
        let (mut ways, mut times) = (Vec::new(), Vec::new());
        for network in &self.networks {
            let model = network.model(seed)?;
            for by in self.ways()? {
                let name = format!("{}, {}", network.name, by.name());
                let way = context.stage(&name, |context| {
                    let mut go_on = || !context.interrupted();
                    let way = self.way(network, &model, by, &mut Pace::asking(&mut go_on));
                    match way {
                        Err(Error::Stopped { .. }) => Err(RunError::Interrupted),
                        way => Ok(way?),
                    }
                })?;
                ways.push(way);
            }
            let name = format!("{}, times", network.name);
            times.extend(context.stage(&name, |_| self.times(network, &model, seed))?);
        }
        let exact = ways.iter().all(|way| way.by.is_none() || way.is_undone());
        let figures = match context.draws(FIGURE) {
            true => vec![figure(&ways)],
            false => Vec::new(),
        };
        let data: Vec<_> = ways.iter().map(|way| way.data(self)).collect();
        Ok(Findings {
            title: "There and back on a grid".into(),
            verdict: Some(exact),
            results: Section {
                summary: vec![
                    Block::Text(self.words()),
                    Block::Table(table(&ways, self.bits)),
                    Block::Text(MEANING.into()),
                ],
                data: json!(data),
                ..Section::default()
            },
            timings: Section {
                summary: vec![Block::Text(HOW.into()), Block::Table(timings(&times))],
                data: json!(times),
                ..Section::default()
            },
            figures,
            ..Findings::default()
        })
    }
}

const MEANING: &str = "On a grid every shear adds an increment that is rounded to the grid, and its inverse \
    subtracts the same one: the way back ends at the first state, bit for bit, whatever the weights, however \
    long and however chaotic the orbit. 64-bit integers wrap; floats on the grid end where they leave their range, \
    which is no failure of theirs. μ is 𝔍∘ψ⁻¹: at ε = 0 it changes by rounding alone.";

const HOW: &str = "One thread; µs a step of one of 256 points, medians of repeated runs in turn, and their quartiles \
    in brackets; ratios are of the medians.";

/// With plain numbers, or on a grid of such numbers.
#[derive(Clone, Copy)]
struct By(Option<Grid>);

impl By {
    fn name(self) -> &'static str {
        self.0.map_or("plain f64", |grid| match grid.numbers() {
            GridNumbers::Integers => "integers",
            GridNumbers::Floats => "floats on the grid",
        })
    }

    fn course(self, direction: Direction) -> Course {
        Course { direction, grid: self.0 }
    }
}

/// One network, there and back by one kind of numbers.
struct Way<'a> {
    network: &'a RandomGyroceptron,
    numbers: By,
    by: Option<Grid>,
    /// None where the orbits left the range.
    found: Option<Found>,
}

struct Found {
    /// Whether it ended at its start to the last bit.
    is_undone: bool,
    /// The largest difference between a coordinate at the start and after the way back.
    error: f64,
    /// The largest coordinate of the states kept.
    largest: f64,
    /// The largest change of μ at any point.
    drift: f64,
    /// That of all points together, in the number of steps.
    exponent: f64,
    /// Largest change of μ up to so many steps.
    along: Vec<(f64, f64)>,
}

impl Way<'_> {
    /// Whether it ended at its start to the last bit, or has no end.
    fn is_undone(&self) -> bool {
        self.found.as_ref().is_none_or(|found| found.is_undone)
    }

    fn data(&self, options: &ThereAndBackOptions) -> serde_json::Value {
        let found = self.found.as_ref();
        json!({
            "network": self.network.name,
            "epsilon": self.network.epsilon,
            "by": self.numbers.name(),
            "steps": options.steps,
            "in_range": found.is_some(),
            "return_error": found.map(|found| found.error),
            "largest": found.map(|found| found.largest),
            "drift": found.map(|found| found.drift),
            "exponent": found.map(|found| found.exponent),
        })
    }
}

/// µs a step by each kind of numbers.
#[derive(Serialize)]
struct Timed {
    network: String,
    parameters: usize,
    by: &'static str,
    seconds: Option<Spread>,
    over_plain: Option<f64>,
}

impl ThereAndBackOptions {
    /// Plain numbers, then the grids.
    fn ways(&self) -> Result<Vec<By>, Error> {
        let grids = GridNumbers::ALL.map(|numbers| Grid::new(self.bits, numbers).map(Some));
        std::iter::once(Ok(None)).chain(grids).map(|grid| grid.map(By)).collect()
    }

    fn words(&self) -> String {
        format!(
            "{} steps of gyroceptrons with random weights and as many steps back, from each of their initial points: \
             with plain numbers and on grids of 2^-{}.",
            self.steps, self.bits
        )
    }

    fn way<'a>(
        &self,
        network: &'a RandomGyroceptron,
        model: &Model,
        numbers: By,
        pace: &mut Pace<'_>,
    ) -> Result<Way<'a>, Error> {
        let (by, initial) = (numbers.0, network.initial.concat());
        let request = Rollout { steps: self.steps, every: self.steps / KEPT };
        let mut move_by = |direction, from: &[f64], every| {
            let request = Rollout { every, ..request };
            model.rollout_along(numbers.course(direction), from, request, pace)
        };
        let of_floats = by.is_some_and(|grid| grid.numbers() == GridNumbers::Floats);
        let out_of_range = |error: &Error| {
            of_floats && matches!(error, Error::Diverged { .. } | Error::Invalid { .. })
        };
        let states = match move_by(Direction::Forward, &initial, request.every) {
            Err(error) if out_of_range(&error) => {
                return Ok(Way { network, numbers, by, found: None });
            }
            states => states?,
        };
        // What a grid made of the initial points.
        let start = states[..initial.len()].to_vec();
        let (back, is_undone) = match by {
            None => {
                let end = &states[states.len() - initial.len()..];
                let back = move_by(Direction::Inverse, end, self.steps)?;
                (back[initial.len()..].to_vec(), back[initial.len()..] == start)
            }
            // From the places themselves: an f64 may be too coarse for one.
            Some(grid) => {
                let first = GridPoints::nearest(grid, &initial)?;
                let mut points = first.clone();
                let whole = Rollout { steps: self.steps, every: self.steps };
                for direction in [Direction::Forward, Direction::Inverse] {
                    grid_rollout(model.composition(), direction, &mut points, whole, pace)?;
                }
                (points.coordinates(), points == first)
            }
        };
        let difference = |(a, b): (&f64, &f64)| (a - b).abs();
        let error = back.iter().zip(&start).map(difference).fold(0.0, max_or_nan);
        let largest = states.iter().map(|value| value.abs()).fold(0.0, max_or_nan);
        let count = network.initial.len();
        let mu = Trajectories::new(model.adiabatic_invariant(&states), 1, count)?;
        let of_orbit = |m: usize| drift(mu.orbit(m).map(|mu| mu[0])).largest;
        let mut along = Vec::new();
        let mut most = 0.0;
        for t in 1..mu.states() {
            let change = |m: usize| (mu.state(t, m)[0] - mu.state(0, m)[0]).abs();
            most = (0..count).map(change).fold(most, max_or_nan);
            along.push(((t * request.every) as f64, most));
        }
        let found = Found {
            is_undone,
            error,
            largest,
            drift: (0..count).map(of_orbit).fold(0.0, max_or_nan),
            exponent: drift_exponent(&mu, |mu| mu[0]),
            along,
        };
        Ok(Way { network, numbers, by, found: Some(found) })
    }

    /// Steps of many points near the first initial one, where all kinds of numbers are in range.
    fn times(
        &self,
        network: &RandomGyroceptron,
        model: &Model,
        seed: u64,
    ) -> Result<Vec<Timed>, Error> {
        let mut stream = Stream::new(seed, "there-and-back/times");
        let dim = 2 * network.circle_action.dof();
        let points: Vec<f64> = (0..TIMED * dim).map(|_| stream.uniform(-1.0, 1.0)).collect();
        let (points, request) = (&points, Rollout { steps: TIMED_STEPS, every: TIMED_STEPS });
        let ways = self.ways()?;
        let methods: Vec<Method<'_>> = ways
            .iter()
            .map(|&by| {
                Method::new(by.name(), None, move || {
                    let course = by.course(Direction::Forward);
                    model.rollout_along(course, points, request, &mut Pace::unbroken())
                })
            })
            .collect();
        let units = (TIMED * TIMED_STEPS) as f64;
        let judged = work_precision(&methods, &|_| 0.0, units, self.rounds)?;
        let seconds: Vec<Option<Spread>> = judged.iter().map(|method| method.seconds).collect();
        let plain = seconds[0].map(|spread| spread.median);
        let timed = ways.iter().zip(seconds).map(|(by, seconds)| Timed {
            network: network.name.clone(),
            parameters: model.parameters().len(),
            by: by.name(),
            seconds,
            over_plain: seconds.and_then(|spread| Some(spread.median / plain?)),
        });
        Ok(timed.collect())
    }
}

fn table(ways: &[Way<'_>], bits: u32) -> Table {
    let mut table = Table::new([
        ("network", Format::Exact),
        ("numbers", Format::Exact),
        ("largest coordinate", Format::Magnitude),
        ("back at the start to the last bit", Format::Exact),
        ("return error", Format::Exponent(1)),
        ("largest change of μ", Format::Exponent(1)),
        ("exponent in N", Format::Fixed(2)),
    ]);
    for way in ways {
        let head = [way.network.name.clone().into(), way.numbers.name().into()];
        let Some(found) = &way.found else {
            let none = || "–".into();
            let reason = format!("left |x| < 2^{}", 51 - i64::from(bits));
            table.push(head.into_iter().chain([none(), reason.into(), none(), none(), none()]));
            continue;
        };
        let word = if found.is_undone { "yes" } else { "no" };
        table.push(head.into_iter().chain([
            found.largest.into(),
            word.into(),
            found.error.into(),
            found.drift.into(),
            found.exponent.into(),
        ]));
    }
    table
}

const MICRO: f64 = 1e6;

fn timings(times: &[Timed]) -> Table {
    let mut table = Table::new([
        ("network", Format::Exact),
        ("parameters", Format::Exact),
        ("numbers", Format::Exact),
        ("µs a step", Format::Magnitude),
        ("over plain", Format::Fixed(2)),
    ]);
    for timed in times {
        table.push([
            timed.network.clone().into(),
            timed.parameters.into(),
            timed.by.into(),
            timed.seconds.map(|seconds| seconds.scaled(MICRO)).into(),
            timed.over_plain.into(),
        ]);
    }
    table
}

/// A panel for each network: the largest change of μ up to N steps.
fn figure(ways: &[Way<'_>]) -> Figure {
    let mut panels: Vec<Panel> = Vec::new();
    for way in ways {
        if panels.last().is_none_or(|panel| panel.title != way.network.name) {
            panels.push(Panel {
                title: way.network.name.clone(),
                x_label: "steps N".into(),
                y_label: "largest change of μ up to N".into(),
                x: Axis::Log,
                y: Axis::Log,
                ..Panel::default()
            });
        }
        let (Some(found), Some(panel)) = (&way.found, panels.last_mut()) else { continue };
        let number = panel.series.len();
        let style = [Style::Line, Style::Dashed, Style::Dots][number.min(2)];
        panel.series.push(Series {
            name: way.numbers.name().into(),
            color: number,
            style,
            points: found.along.clone(),
        });
    }
    let caption = "The largest change of μ = 𝔍∘ψ⁻¹ up to N steps, over all orbits of a network: with plain numbers, \
                   on a grid of 64-bit integers and of floats. At ε = 0 it is that of rounding.";
    let figure = Figure::in_a_row(FIGURE, caption, panels);
    Figure { columns: 2, ..figure }
}
