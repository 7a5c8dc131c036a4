//! The edge of the field of coils: lines that are lost, chaotic ones, and the manifolds that they follow.

use super::rollout::orbit_color;
use super::section_maps::{Judge, NamedMap, OrbitFound, SectionMap};
use super::shared::finite;
use crate::error::Error;
use crate::flow::LineMap;
use crate::measure::orbits::{
    Branch, Follow, PeriodicOrbit, lyapunov_exponent, manifold, maps_survived, periodic_orbit,
    smaller_alignment_index,
};
use crate::network::Rollout;
use crate::scalar::median_or_nan;
use crate::scene::figure::{Axis, Figure, Panel, SameAxes, Series, Style};
use crate::scene::findings::{Block, Cell, Format, Table};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub(super) const EDGE: &str = "edge";
pub(super) const MANIFOLDS: &str = "manifolds";

const MOST_LINES: usize = 10_000;
const MOST_MAPS: usize = 10_000_000;
/// Below this alignment index after the maps of the exponents a line is chaotic: on a regular one it falls as 1/N².
const ALIGNED: f64 = 1e-10;
/// The distance from a corner at which its manifold begins, over the distance from the axis.
const BEGIN: f64 = 1e-4;
/// The spacing of the points of a manifold, over its length.
const SPACING: f64 = 2e-3;

/// Lines along the ray outwards from the axis, over the edge of the surfaces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EdgeOptions {
    /// The smallest distance of a line from the axis at its start, in metres.
    pub from: f64,
    /// The largest distance of a line from the axis at its start, in metres.
    pub to: f64,
    /// The number of lines between them.
    pub lines: usize,
    /// The number of maps over which lines are followed, unless they are lost.
    pub survival: usize,
    /// A line is lost where it is so far from the axis, in metres.
    pub wall: f64,
    /// The number of maps of Lyapunov exponents and alignment indices.
    pub exponents: usize,
    /// The length of each branch of the manifold of the corner of the lowest resonance, in metres; 0 follows none.
    #[serde(default)]
    pub manifold: f64,
}

impl EdgeOptions {
    pub(super) fn check(&self) -> Result<(), Error> {
        Error::check_range("edge.from", self.from, Error::LEAST_POSITIVE, f64::MAX)?;
        Error::check_range("edge.wall", self.wall, Error::LEAST_POSITIVE, f64::MAX)?;
        Error::check_range("edge.manifold", self.manifold, 0.0, f64::MAX)?;
        if !(self.from < self.to && self.to < self.wall) {
            let found = format!("from {} to {} with a wall at {}", self.from, self.to, self.wall);
            return Err(Error::invalid("edge", found, "from < to < wall"));
        }
        Error::check_count_range("edge.lines", self.lines, 2, MOST_LINES)?;
        // An exponent needs so many, and is of maps that are followed.
        const FEWEST: usize = 100;
        Error::check_count_range("edge.survival", self.survival, FEWEST, MOST_MAPS)?;
        Error::check_count_range("edge.exponents", self.exponents, FEWEST, self.survival)
    }

    pub(super) fn shorten(&mut self) {
        self.lines = (self.lines / 4).max(2);
        self.survival = (self.survival / 4).max(self.exponents);
    }

    fn distance(&self, number: usize) -> f64 {
        let share = number as f64 / (self.lines - 1) as f64;
        share.mul_add(self.to - self.from, self.from)
    }

    fn distances(&self) -> impl Iterator<Item = f64> {
        (0..self.lines).map(|number| self.distance(number))
    }

    /// What a map makes of the lines.
    fn of(
        &self,
        name: &str,
        map: &EdgeMap<'_>,
        judge: &Judge<'_>,
        corner: Option<&OrbitFound>,
    ) -> Result<EdgeFound, Error> {
        let axis = judge.axis;
        let starts: Vec<f64> =
            self.distances().flat_map(|distance| [axis[0] + distance, axis[1]]).collect();
        let stays = |z: &[f64]| libm::hypot(z[0] - axis[0], z[1] - axis[1]) < self.wall;
        let follow = |points: &[f64], maps: usize| map.follow(points, maps, &stays);
        let survived = maps_survived(&follow, &starts, 2, self.survival, &stays)?;
        let with_jacobian = |z: &[f64]| map.with_jacobian(z);
        let of_line = |(z, survived): (&[f64], &Option<usize>)| -> Result<_, Error> {
            if survived.is_some_and(|maps| maps <= self.exponents) {
                return Ok(None);
            }
            let exponent = lyapunov_exponent(&with_jacobian, z, self.exponents)?;
            let index = smaller_alignment_index(&with_jacobian, z, self.exponents)?;
            Ok(Some(LineExponents { exponent, index }))
        };
        let exponents = starts.par_chunks_exact(2).zip(&survived).map(of_line);
        let exponents = exponents.collect::<Result<Vec<_>, _>>()?;
        let followed = |corner: &OrbitFound| {
            let maps = corner.points.len();
            let orbit = periodic_orbit(&with_jacobian, &corner.points[0], maps)?;
            self.branches(&follow, &orbit, judge)
        };
        // Of a map whose manifold cannot be followed the rest is still said.
        let (branches, no_manifold) = match corner {
            _ if self.manifold == 0.0 => (Vec::new(), None),
            None => {
                let reason =
                    "of the lowest resonance no corner was found that differs from a curve";
                (Vec::new(), Some(reason.to_owned()))
            }
            Some(corner) => match followed(corner) {
                Ok(branches) => (branches, None),
                Err(reason) => (Vec::new(), Some(reason.to_string())),
            },
        };
        Ok(EdgeFound { name: name.to_owned(), survived, exponents, branches, no_manifold })
    }

    /// Both branches of the unstable manifold of the first point of an orbit.
    fn branches(
        &self,
        follow: Follow<'_>,
        orbit: &PeriodicOrbit,
        judge: &Judge<'_>,
    ) -> Result<Vec<Vec<f64>>, Error> {
        let step = |z: &mut [f64]| {
            z.copy_from_slice(&follow(z, 1)?);
            Ok(())
        };
        let first = &orbit.points[0];
        let reach = libm::hypot(first[0] - judge.axis[0], first[1] - judge.axis[1]);
        [true, false]
            .into_iter()
            .map(|forward| {
                let (start, length) = (BEGIN * reach, self.manifold);
                manifold(&step, orbit, Branch { forward, start, spacing: SPACING * length, length })
            })
            .collect()
    }

    /// How far from the axis the lines begin that stay, from the inside to the first that is lost; 0 if that is the
    /// first of all.
    fn edge(&self, found: &EdgeFound) -> f64 {
        let stay = found.survived.iter().take_while(|lost| lost.is_none()).count();
        stay.checked_sub(1).map_or(0.0, |last| self.distance(last))
    }

    pub(super) fn summary(&self, found: &[EdgeFound]) -> Vec<Block> {
        let Self { from, to, lines, survival, wall, exponents, .. } = self;
        let words = format!(
            "The edge: {lines} lines that begin {from} to {to} m from the axis are followed over {survival} maps; those \
             that come to {wall} m from it are lost. The edge is where the last line begins, from the inside, before \
             the first that is lost. Lines that stay for {exponents} maps are chaotic where the smaller alignment index \
             is below {ALIGNED:.0e} then; their Lyapunov exponents are by map. The share of lines on which a method and \
             the reference agree is of lines that are lost by both or neither, and of lines that are regular, chaotic \
             or lost early by both. Where the reference goes through planes it goes on in the field of the coils from \
             where a line leaves their box."
        );
        let mut table = Table::new([
            ("method", Format::Exact),
            ("edge [m]", Format::Fixed(4)),
            ("lines lost", Format::Exact),
            ("agree with the reference", Format::Percent),
            ("chaotic", Format::Exact),
            ("agree", Format::Percent),
            ("exponent, median of chaotic", Format::Magnitude),
        ]);
        let Some(reference) = found.first() else { return Vec::new() };
        for of in found {
            let chaotic: Vec<f64> = of.chaotic().map(|line| line.exponent).collect();
            let count = chaotic.len();
            let exponent = (count > 0).then(|| median_or_nan(chaotic)).and_then(finite);
            let row: [Cell; 7] = [
                of.name.clone().into(),
                self.edge(of).into(),
                of.survived.iter().flatten().count().into(),
                of.share(reference, |one, line| one.survived[line].is_some()).into(),
                count.into(),
                of.share(reference, |one, line| one.class(line)).into(),
                exponent.into(),
            ];
            table.push(row);
        }
        let mut blocks = vec![Block::Text(words), Block::Table(table)];
        let without = found.iter().filter_map(|of| Some((&of.name, of.no_manifold.as_ref()?)));
        let lines: Vec<String> = without
            .map(|(name, reason)| format!("- No manifold of `{name}` is followed: {reason}."))
            .collect();
        if !lines.is_empty() {
            blocks.push(Block::Text(lines.join("\n")));
        }
        blocks
    }

    /// Maps survived and exponents against the distance from the axis.
    pub(super) fn figure(&self, found: &[EdgeFound]) -> Figure {
        let x_label = "distance from the axis at the start [m]";
        let of = |value: &dyn Fn(&EdgeFound, usize) -> Option<f64>| -> Vec<Series> {
            let each = found.iter().enumerate().map(|(color, one)| {
                let points = self.distances().enumerate();
                let points = points.filter_map(|(line, r)| Some((r, value(one, line)?)));
                let name = one.name.clone();
                Series { name, color, style: Style::Marked, points: points.collect() }
            });
            each.collect()
        };
        let survived = of(&|one, line| one.survived[line].map(|maps| maps as f64));
        let exponents = of(&|one, line| one.exponents[line].map(|line| line.exponent));
        let panels = vec![
            Panel {
                title: "Lost lines".into(),
                x_label: x_label.into(),
                y_label: "maps until it is lost".into(),
                y: Axis::Log,
                series: survived,
                ..Panel::default()
            },
            Panel {
                title: format!("Lyapunov exponents over {} maps", self.exponents),
                x_label: x_label.into(),
                y_label: "by map".into(),
                series: exponents,
                ..Panel::default()
            },
        ];
        let caption = "The edge: after how many maps lines are lost, and how fast neighbours part.";
        Figure::in_a_row(EDGE, caption, panels)
    }

    /// The manifolds of the corner, of the reference and of each map.
    pub(super) fn manifolds(found: &[EdgeFound]) -> Figure {
        let panel = |of: &EdgeFound| {
            let series = of.branches.iter().enumerate().map(|(number, points)| {
                let points = points.chunks_exact(2).map(|z| (z[0], z[1])).collect();
                Series::unnamed(orbit_color(number), Style::Dots, points)
            });
            Panel {
                title: of.name.clone(),
                x_label: "R [m]".into(),
                y_label: "Z [m]".into(),
                square: true,
                series: series.collect(),
                ..Panel::default()
            }
        };
        let panels = found.iter().filter(|of| !of.branches.is_empty()).map(panel).collect();
        let caption = "The unstable manifold of the corner of an island chain, both branches.";
        let figure = Figure::in_a_row(MANIFOLDS, caption, panels);
        Figure { columns: 2, same_axes: SameAxes::First, ..figure }
    }
}

/// A map whose edge is looked for.
struct EdgeMap<'a> {
    map: &'a SectionMap<'a>,
    /// Of lines through planes, what goes on where a line leaves their box: else each such line would be lost.
    beyond: Option<SectionMap<'a>>,
}

impl<'a> EdgeMap<'a> {
    fn of(map: &'a SectionMap<'a>) -> Self {
        Self { map, beyond: None }
    }

    /// The states of orbits after 1, …, `maps` maps: NaN after one at which an orbit does not stay, or from where it is
    /// lost.
    fn follow(
        &self,
        points: &[f64],
        maps: usize,
        stays: &dyn Fn(&[f64]) -> bool,
    ) -> Result<Vec<f64>, Error> {
        let one_by_one = Rollout { steps: maps, every: 1 };
        let mut states = self.map.rollout(points, one_by_one)?;
        let size = points.len();
        let Some(beyond) = &self.beyond else { return Ok(states.split_off(size)) };
        for before in 0..maps {
            let (known, next) = states[before * size..][..2 * size].split_at_mut(size);
            let left = known.chunks_exact(2).zip(next.chunks_exact_mut(2));
            let (from, to): (Vec<&[f64]>, Vec<&mut [f64]>) =
                left.filter(|(here, there)| stays(here) && there[0].is_nan()).unzip();
            if from.is_empty() {
                continue;
            }
            let images = beyond.rollout(&from.concat(), Rollout { steps: 1, every: 1 })?;
            let images = images[2 * from.len()..].chunks_exact(2);
            to.into_iter().zip(images).for_each(|(to, image)| to.copy_from_slice(image));
        }
        Ok(states.split_off(size))
    }

    fn with_jacobian(&self, z: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Error> {
        match (self.map, &self.beyond) {
            (SectionMap::Tabulated(lines), Some(beyond)) if !lines.holds(z) => {
                beyond.with_jacobian(z)
            }
            _ => self.map.with_jacobian(z),
        }
    }
}

/// How fast neighbours of a line part.
#[derive(Clone, Copy, Serialize)]
struct LineExponents {
    /// The Lyapunov exponent, by map.
    exponent: f64,
    /// The smaller alignment index (SALI) after the maps of the exponents.
    index: f64,
}

/// What a map makes of the lines at the edge.
#[derive(Serialize)]
pub(super) struct EdgeFound {
    name: String,
    /// The number of maps after which each line is lost; none of one that stays.
    survived: Vec<Option<usize>>,
    /// Of lines that stay long enough.
    exponents: Vec<Option<LineExponents>>,
    /// Points of each branch of the manifold of the corner.
    #[serde(skip)]
    branches: Vec<Vec<f64>>,
    /// Why there is none, where one was to be followed.
    #[serde(skip_serializing_if = "Option::is_none")]
    no_manifold: Option<String>,
}

impl EdgeFound {
    /// Whether a line is chaotic; none of one that is lost too early to tell.
    fn class(&self, line: usize) -> Option<bool> {
        // A NaN is no regular line.
        self.exponents[line].map(|line| !(line.index >= ALIGNED))
    }

    fn chaotic(&self) -> impl Iterator<Item = &LineExponents> {
        self.exponents.iter().flatten().filter(|line| !(line.index >= ALIGNED))
    }

    /// The share of lines of which something is the same as of another map.
    fn share<T: PartialEq>(&self, other: &Self, of: impl Fn(&Self, usize) -> T) -> f64 {
        let count = self.survived.len();
        let same = (0..count).filter(|line| of(self, *line) == of(other, *line)).count();
        same as f64 / count as f64
    }
}

/// The edge by the reference, first, and by all fast maps. Where the reference goes through planes, the map of the
/// field goes on from where lines leave their box.
pub(super) fn edge_of(
    options: &EdgeOptions,
    judge: &Judge<'_>,
    reference: (&SectionMap<'_>, Option<&OrbitFound>),
    field: LineMap<'_>,
    maps: &[(&NamedMap<'_>, Option<&OrbitFound>)],
) -> Result<Vec<EdgeFound>, Error> {
    let (map, corner) = reference;
    let beyond = matches!(map, SectionMap::Tabulated(_)).then(|| SectionMap::Coils(field));
    let mut found = vec![options.of("reference", &EdgeMap { map, beyond }, judge, corner)?];
    for (named, corner) in maps {
        found.push(options.of(&named.name, &EdgeMap::of(&named.map), judge, *corner)?);
    }
    Ok(found)
}
