//! Frequency maps: the tunes of orbits from a grid of points, and how much they change along each.

use super::shared::{Study, WIDER, beyond_pairs, check_slice, coordinate, positions};
use crate::error::Error;
use crate::flow::Trajectories;
use crate::measure::orbits::{Tunes, tunes};
use crate::network::{Composition, Model, Rollout, Structure};
use crate::phase::{Map, Units};
use crate::scalar::max_or_nan;
use crate::scene::bibliography::FREQUENCY_MAPS;
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::setup::{MOST, Need};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::f64::consts::TAU;

const FIGURE: &str = "frequency-map";

/// More than this is taken for a mistake.
const MOST_ORDER: u32 = 30;
const MOST_POINTS: usize = 1_000_000;
/// The fewest maps whose halves have tunes that do not change by 1e-7 on a torus.
const LEAST_MAPS: usize = 512;
/// States that are held at once.
const STATES: usize = 1 << 20;
/// Bounds of the classes of orbits, by the largest change of a tune.
const CLASSES: [f64; 3] = [1e-7, 1e-5, 1e-3];
/// m·ν is an integer to this on an orbit that is on a resonance.
const HELD: f64 = 1e-7;
/// Where one plane moves by less than this share of the other, its strongest line may be that of the other.
const SMALL_SHARE: f64 = 0.1;
/// A resonance with fewer orbits is not listed, and no more than so many are.
const LEAST_HELD: usize = 3;
const MOST_LISTED: usize = 8;

/// Tunes over a grid of points in two of the coordinates of a map of two degrees of freedom, and their changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrequencyMapOptions {
    /// The point that the grid is around: what its points have in the other two coordinates.
    #[serde(default)]
    pub centre: [f64; 4],
    /// The two coordinates in which the points differ, of q₁, q₂, p₁, p₂.
    #[serde(default = "positions")]
    pub along: [usize; 2],
    /// The smallest values of the two coordinates.
    pub low: [f64; 2],
    /// The largest values of the two coordinates.
    pub high: [f64; 2],
    /// The number of points along each.
    pub points: [usize; 2],
    /// The number of maps that each orbit is long.
    pub maps: usize,
    /// Resonances m₁ν₁ + m₂ν₂ = k are looked for up to |m₁| + |m₂| of this.
    #[serde(default = "usual_order")]
    pub order: u32,
}

fn usual_order() -> u32 {
    8
}

impl Study for FrequencyMapOptions {
    fn name(&self) -> &'static str {
        "frequency_map"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::TargetFlow, Need::Data, Need::Models]
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        check_slice(self.name(), scene, self.centre, self.along)?;
        for (low, high) in self.low.iter().zip(&self.high) {
            if !(low < high && low.is_finite() && high.is_finite()) {
                let found = format!("from {low} to {high}");
                return Err(Error::invalid("low and high", found, "the smaller number first"));
            }
        }
        for count in self.points {
            Error::check_count_range("points", count, 2, MOST)?;
        }
        let points = self.points[0].saturating_mul(self.points[1]);
        Error::check_count_range("points", points, 4, MOST_POINTS)?;
        Error::check_count_range("maps", self.maps, LEAST_MAPS, STATES)?;
        Error::check_count_range("order", self.order as usize, 1, MOST_ORDER as usize)
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![FIGURE]
    }

    fn cites(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![FREQUENCY_MAPS]
    }

    /// Every other point along each axis, and half as many maps.
    fn shorten(&mut self) {
        self.points = self.points.map(|count| count.div_ceil(2).max(2));
        self.maps = (self.maps / 2).max(LEAST_MAPS);
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let (models, data) = (context.models()?, context.data()?);
        let outside = beyond_pairs(&data);
        let mut found = Vec::new();
        for trained in models.iter() {
            let name = &trained.spec.name;
            let stage = format!("frequency map of {name}");
            let units = data.units.as_ref();
            let made = context.stage(&stage, |context| {
                self.of(name, trained.model(), units, &outside, &mut || context.interrupted())
            })?;
            found.push(made.ok_or(RunError::Interrupted)?);
        }
        let mut figures = Vec::new();
        if context.draws(FIGURE) {
            figures.push(self.figure(&found));
        }
        let mut summary = vec![Block::Table(table(&found))];
        summary.extend(found.iter().filter_map(|of| self.words_on_twists(of)).map(Block::Text));
        let resonances: Vec<String> = found.iter().map(|of| self.words_on_resonances(of)).collect();
        summary.push(Block::Text(resonances.concat()));
        Ok(Findings {
            title: "Frequency map".into(),
            results: Section {
                summary,
                details: vec![Block::Text(self.words())],
                data: json!(found),
            },
            figures,
            ..Findings::default()
        })
    }
}

/// What was found of a network.
#[derive(Serialize)]
struct Found {
    name: String,
    orbits: Vec<Orbit>,
}

/// An orbit of the grid.
#[derive(Serialize)]
struct Orbit {
    /// The two coordinates in which starts differ.
    start: [f64; 2],
    /// The number of maps after which it is outside of the box of the pairs, [`WIDER`] times as wide.
    lost_after: Option<usize>,
    /// Turns a map in each plane; null where it is lost or does not turn.
    tunes: [f64; 2],
    /// The largest change of a tune from the first half of the orbit to the second.
    change: f64,
    /// Whether each plane moves by a share of the other that lets its own tune be distinguished from that of the other.
    #[serde(skip)]
    both_move: bool,
    /// The tunes of the map without its perturbation K_ε, by its twists alone; of nearly-integrable maps.
    #[serde(skip_serializing_if = "Option::is_none")]
    by_twists: Option<[f64; 2]>,
}

impl Orbit {
    /// Whether it has tunes, in its halves too.
    fn turns(&self) -> bool {
        self.tunes.iter().chain([&self.change]).all(|value| value.is_finite())
    }

    /// The number of its class of [`CLASSES`]; None where it has no tunes.
    fn class(&self) -> Option<usize> {
        let below = |bound: &&f64| !(self.change <= **bound);
        self.turns().then(|| CLASSES.iter().take_while(below).count())
    }
}

/// A resonance m₁ν₁ + m₂ν₂ = k.
#[derive(Clone, Copy, PartialEq)]
struct Resonance {
    m: [i32; 2],
}

impl Resonance {
    /// Those up to an order, the lowest first, each with m₁ > 0, or m₁ = 0 and m₂ > 0.
    fn up_to(order: u32) -> Vec<Self> {
        let of_order = |total: i32| {
            let of_first = move |m1: i32| {
                let m2 = total - m1;
                let both = [[m1, m2], [m1, -m2]];
                both.into_iter().take(if m1 == 0 || m2 == 0 { 1 } else { 2 }).map(|m| Self { m })
            };
            (0..=total).flat_map(of_first)
        };
        (1..=order as i32).flat_map(of_order).collect()
    }

    /// How far m·ν is from the nearest integer.
    fn distance(self, tunes: [f64; 2]) -> f64 {
        let sum = f64::from(self.m[0]) * tunes[0] + f64::from(self.m[1]) * tunes[1];
        (sum - sum.round()).abs()
    }

    /// The combination of tunes as text, such as `3ν₁ − 2ν₂`.
    fn name(self) -> String {
        let term = |m: i32, plane: char| match m.abs() {
            1 => format!("ν{plane}"),
            m => format!("{m}ν{plane}"),
        };
        match self.m {
            [m1, 0] => term(m1, '₁'),
            [0, m2] => term(m2, '₂'),
            [m1, m2] => {
                let sign = if m2 < 0 { '−' } else { '+' };
                format!("{} {sign} {}", term(m1, '₁'), term(m2, '₂'))
            }
        }
    }
}

/// The chart of a nearly-integrable map, and the map in it without its perturbation.
struct Integrable {
    chart: Composition<f64>,
    inner: Composition<f64>,
}

impl Integrable {
    /// None of maps that are not nearly integrable, or have slow planes; and of reversible ones, whose chart is
    /// near the identity and shares the work of their perturbation.
    fn of(model: &Model) -> Option<Self> {
        let architecture = model.architecture();
        let of_order_one = architecture.structure() == Structure::NearlyIntegrable
            && architecture.is_of_order_one()
            && architecture.reversor.is_none();
        if !of_order_one || architecture.circles.len() != model.composition().dof() {
            return None;
        }
        let [chart, inner] = model.with_epsilon(0.0).chart_and_inner_map();
        Some(Self { chart, inner })
    }

    /// What angles of each plane advance by in a map, in turns from −½ to ½, positive from p towards q.
    fn tunes(&self, z: &[f64]) -> [f64; 2] {
        let mut w = z.to_vec();
        Map::<f64>::inverse(&self.chart, &mut w);
        let before = w.clone();
        Map::<f64>::forward(&self.inner, &mut w);
        [0, 1].map(|plane| {
            let angle = |w: &[f64]| libm::atan2(w[plane], w[2 + plane]);
            let turns = (angle(&w) - angle(&before)) / TAU;
            turns - turns.round()
        })
    }
}

/// The largest distance of an orbit from its mean in a plane.
fn extent(states: &Trajectories, m: usize, plane: usize) -> f64 {
    let in_plane = || states.orbit(m).map(|z| [z[plane], z[2 + plane]]);
    let count = states.orbit(m).count() as f64;
    let sum = in_plane().fold([0.0; 2], |sum, z| [sum[0] + z[0], sum[1] + z[1]]);
    let distance = |z: [f64; 2]| libm::hypot(z[0] - sum[0] / count, z[1] - sum[1] / count);
    in_plane().map(distance).fold(0.0, max_or_nan)
}

impl FrequencyMapOptions {
    /// The grid, one row of points after another.
    fn starts(&self) -> Vec<[f64; 2]> {
        let [across, up] = self.points;
        let at = |axis: usize, index: usize| {
            let share = index as f64 / (self.points[axis] - 1) as f64;
            (1.0 - share) * self.low[axis] + share * self.high[axis]
        };
        (0..up).flat_map(|j| (0..across).map(move |i| [at(0, i), at(1, j)])).collect()
    }

    /// None where it was interrupted. Points are in units of the data.
    fn of(
        &self,
        name: &str,
        model: &Model,
        units: Option<&Units>,
        outside: &dyn Fn(&[f64]) -> bool,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Found>, Error> {
        let integrable = Integrable::of(model);
        let mut orbits = Vec::new();
        for starts in self.starts().chunks((STATES / self.maps).clamp(1, 256)) {
            if interrupted() {
                return Ok(None);
            }
            let mut points: Vec<[f64; 4]> = starts
                .iter()
                .map(|start| {
                    let mut z = self.centre;
                    for (coordinate, value) in self.along.into_iter().zip(start) {
                        z[coordinate] = *value;
                    }
                    z
                })
                .collect();
            if let Some(units) = units {
                units.to_network(points.as_flattened_mut());
            }
            let request = Rollout { steps: self.maps, every: 1 };
            let states = model.rollout(points.as_flattened(), request)?;
            let states = Trajectories::new(states, 4, starts.len())?;
            let all = tunes(&states);
            for (m, (start, Tunes { turns, changes })) in starts.iter().zip(all).enumerate() {
                let lost_after = states.orbit(m).position(outside);
                let kept = lost_after.is_none();
                let change = changes.into_iter().fold(0.0, max_or_nan);
                let extents = [0, 1].map(|plane| extent(&states, m, plane));
                let smaller = extents[0].min(extents[1]) / max_or_nan(extents[0], extents[1]);
                orbits.push(Orbit {
                    start: *start,
                    lost_after,
                    tunes: if kept { [turns[0], turns[1]] } else { [f64::NAN; 2] },
                    change: if kept { change } else { f64::NAN },
                    both_move: smaller >= SMALL_SHARE,
                    by_twists: integrable.as_ref().map(|map| map.tunes(&points[m])),
                });
            }
        }
        Ok(Some(Found { name: name.to_owned(), orbits }))
    }

    fn words(&self) -> String {
        let [across, up] = self.points;
        let names = self.along.map(coordinate);
        format!(
            "{across} × {up} orbits of {} maps each, from {} between {} and {} and {} between {} and {}, the other \
             coordinates as in {:?}. Tunes are by windowed frequency analysis of q + ip in each plane; their change is \
             that from the first half of an orbit to the second, of the plane in which it is larger. It is small where \
             an orbit stays on a torus; a large change is a sign of chaos. Where one plane moves by less than {} of \
             the other, its strongest line may be that of the other: such orbits are not drawn among the tunes, nor \
             counted for their range and for resonances. An orbit is lost where it leaves the box of the pairs, \
             {WIDER} times as wide.",
            self.maps,
            names[0],
            self.low[0],
            self.high[0],
            names[1],
            self.low[1],
            self.high[1],
            self.centre,
            Format::Percent.number(SMALL_SHARE),
        )
    }

    /// What the twists alone have for tunes.
    fn words_on_twists(&self, of: &Found) -> Option<String> {
        let apart = |orbit: &Orbit| {
            let by_twists = orbit.by_twists?;
            let of_planes = orbit.tunes.iter().zip(by_twists).map(|(a, b)| {
                let apart = a - b;
                (apart - apart.round()).abs()
            });
            orbit.turns().then(|| of_planes.fold(0.0, max_or_nan))
        };
        let mut all: Vec<f64> = of.orbits.iter().filter_map(apart).collect();
        all.sort_by(f64::total_cmp);
        let (median, largest) = (all.get(all.len() / 2)?, all.last()?);
        Some(format!(
            "- `{}`: its twists alone, without the perturbation K, have tunes that differ from those of the orbits by \
             {median:.1e} in the median and {largest:.1e} at most.\n",
            of.name
        ))
    }

    fn words_on_resonances(&self, of: &Found) -> String {
        // Multiples of what holds an orbit hold it too.
        let all = Resonance::up_to(self.order);
        let mut counts = vec![0; all.len()];
        let both_move = of.orbits.iter().filter(|orbit| orbit.turns() && orbit.both_move);
        for orbit in both_move {
            let holds = |resonance: &Resonance| resonance.distance(orbit.tunes) <= HELD;
            if let Some(lowest) = all.iter().position(holds) {
                counts[lowest] += 1;
            }
        }
        let mut all: Vec<(Resonance, usize)> = all.into_iter().zip(counts).collect();
        all.retain(|(_, count)| *count >= LEAST_HELD);
        all.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        let list: Vec<String> = all
            .iter()
            .take(MOST_LISTED)
            .map(|(resonance, count)| format!("{} ({count} orbits)", resonance.name()))
            .collect();
        match list.is_empty() {
            true => format!(
                "- `{}`: of the resonances up to order {} none was found to have {LEAST_HELD} orbits or more.\n",
                of.name, self.order
            ),
            false => format!(
                "- `{}`: orbits on resonances, where a sum of tunes is an integer to {HELD:e}: {}.\n",
                of.name,
                list.join(", ")
            ),
        }
    }

    /// For each network the starts and the tunes, by class.
    fn figure(&self, found: &[Found]) -> Figure {
        let [x, y] = self.along.map(coordinate);
        let names = [
            format!("change of tunes at most {:e}", CLASSES[0]),
            format!("{:e} to {:e}", CLASSES[0], CLASSES[1]),
            format!("{:e} to {:e}", CLASSES[1], CLASSES[2]),
            "more".to_owned(),
        ];
        let mut panels = Vec::new();
        for of in found {
            let by_class = |point: &dyn Fn(&Orbit) -> (f64, f64)| -> Vec<Series> {
                let of_class = |(color, name): (usize, &String)| Series {
                    name: name.clone(),
                    color,
                    style: Style::Dots,
                    points: of
                        .orbits
                        .iter()
                        .filter(|orbit| orbit.class() == Some(color))
                        .map(point)
                        .collect(),
                };
                names.iter().enumerate().map(of_class).collect()
            };
            panels.push(Panel {
                title: format!("{}: where orbits start", of.name),
                x_label: x.to_owned(),
                y_label: y.to_owned(),
                series: by_class(&|orbit| (orbit.start[0], orbit.start[1])),
                ..Panel::default()
            });
            panels.push(Panel {
                title: format!("{}: tunes", of.name),
                x_label: "ν₁, turns a map".into(),
                y_label: "ν₂".into(),
                series: by_class(&|orbit| match orbit.both_move {
                    true => (orbit.tunes[0], orbit.tunes[1]),
                    // Not drawn.
                    false => (f64::NAN, f64::NAN),
                }),
                ..Panel::default()
            });
        }
        Figure {
            columns: 2,
            ..Figure::in_a_row(
                FIGURE,
                "Left: where orbits start, by how much their tunes change from one half of the orbit to the other; no \
                 dot where an orbit is lost or does not turn. Right: their tunes. Resonances are lines there, along \
                 which dots gather or which they leave free.",
                panels,
            )
        }
    }
}

fn table(found: &[Found]) -> Table {
    let mut table = Table::new([
        ("network".to_owned(), Format::Exact),
        ("orbits".to_owned(), Format::Exact),
        ("lost".to_owned(), Format::Exact),
        ("no tunes".to_owned(), Format::Exact),
        (format!("tunes change by {:e} at most", CLASSES[0]), Format::Exact),
        (format!("by {:e} to {:e}", CLASSES[0], CLASSES[1]), Format::Exact),
        (format!("by {:e} to {:e}", CLASSES[1], CLASSES[2]), Format::Exact),
        ("by more".to_owned(), Format::Exact),
        ("ν₁ from".to_owned(), Format::Fixed(6)),
        ("to".to_owned(), Format::Fixed(6)),
        ("ν₂ from".to_owned(), Format::Fixed(6)),
        ("to".to_owned(), Format::Fixed(6)),
    ]);
    for of in found {
        let count = |class: usize| of.orbits.iter().filter(|o| o.class() == Some(class)).count();
        let ends = |plane: usize| {
            let turning = of.orbits.iter().filter(|orbit| orbit.turns() && orbit.both_move);
            let mut tunes: Vec<f64> = turning.map(|orbit| orbit.tunes[plane]).collect();
            tunes.sort_by(f64::total_cmp);
            [tunes.first().copied(), tunes.last().copied()]
        };
        let [one, other] = [ends(0), ends(1)];
        let lost = of.orbits.iter().filter(|orbit| orbit.lost_after.is_some()).count();
        table.push([
            format!("`{}`", of.name).into(),
            of.orbits.len().into(),
            lost.into(),
            (of.orbits.iter().filter(|orbit| !orbit.turns()).count() - lost).into(),
            count(0).into(),
            count(1).into(),
            count(2).into(),
            count(3).into(),
            one[0].into(),
            one[1].into(),
            other[0].into(),
            other[1].into(),
        ]);
    }
    table
}
