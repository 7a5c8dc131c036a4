//! Maps of a section of field lines, in metres: networks and their rivals, and what is asked of each.

use crate::error::Error;
use crate::flow::{LineMap, PolynomialMap, PolynomialOnSection, TabulatedLines, Trajectories};
use crate::io::StoredModel;
use crate::layer::Reversor;
use crate::measure::{
    orbits::{
        InvariantCircle, IslandSearch, PeriodicOrbit, RotationNumber, SymmetryLine,
        periodic_orbits, rotation_numbers, symmetric_periodic_orbits,
    },
    timing::root_mean_square_distance,
};
use crate::network::Rollout;
use crate::phase::AreaDensity;
use crate::scalar::max_or_nan;
use rayon::prelude::*;
use serde::Serialize;
use std::f64::consts::TAU;

/// A map of points (R, Z) in metres.
pub(super) enum SectionMap<'a> {
    /// A network in the chart of its section.
    Network(Box<StoredModel>),
    /// A polynomial map in R and Z, fitted by least squares.
    Polynomial(PolynomialMap),
    /// A polynomial generating function of least squares in the chart of the section.
    Generating(Box<PolynomialOnSection>),
    /// The map of field lines that are followed through tabulated planes.
    Tabulated(TabulatedLines),
    /// Lines in the field of the coils.
    Coils(LineMap<'a>),
}

impl SectionMap<'_> {
    /// States (steps/every + 1, M, 2) of the orbits of M points: from where a line is lost they are NaN.
    pub(super) fn rollout(&self, initial: &[f64], request: Rollout) -> Result<Vec<f64>, Error> {
        match self {
            Self::Network(model) => {
                Ok(or_line_by_line(initial, request, |z, request| model.rollout(z, request)))
            }
            Self::Polynomial(map) => map.rollout(initial, request),
            Self::Generating(map) => {
                Ok(or_line_by_line(initial, request, |z, request| map.rollout(z, request)))
            }
            Self::Tabulated(lines) => lines.rollout(initial, request),
            Self::Coils(map) => {
                let moved = map.trajectories(initial, request.steps)?;
                let states = moved.chunks_exact(initial.len());
                let kept = states.skip(request.every - 1).step_by(request.every);
                Ok([initial].into_iter().chain(kept).flatten().copied().collect())
            }
        }
    }

    /// The image of a point and the Jacobian there, row by row.
    pub(super) fn with_jacobian(&self, z: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let of_lines =
            |(image, jacobian): ([f64; 2], [[f64; 2]; 2])| (image.to_vec(), jacobian.concat());
        match self {
            Self::Network(model) => {
                let image = model.rollout(z, Rollout { steps: 1, every: 1 })?.split_off(z.len());
                Ok((image, model.jacobians(z)?))
            }
            Self::Polynomial(map) => {
                let mut image = z.to_vec();
                map.step(&mut image);
                Ok((image, map.jacobian(z)))
            }
            Self::Generating(map) => Ok(map.with_jacobian(z)),
            Self::Tabulated(lines) => Ok(of_lines(lines.with_jacobian([z[0], z[1]]))),
            Self::Coils(map) => Ok(of_lines(map.with_jacobian([z[0], z[1]]))),
        }
    }
}

impl SectionMap<'_> {
    /// All states of the orbits of M points over so many maps, as [`SectionMap::rollout`]; None where `stopped` says
    /// so, which is asked every few seconds.
    pub(super) fn followed(
        &self,
        initial: &[f64],
        maps: usize,
        stopped: &dyn Fn() -> bool,
    ) -> Result<Option<Vec<f64>>, Error> {
        let most = match self {
            Self::Coils(_) => 1,
            Self::Tabulated(_) => 50,
            Self::Network(_) | Self::Polynomial(_) | Self::Generating(..) => maps,
        };
        let (mut states, mut done) = (initial.to_vec(), 0);
        while done < maps {
            if stopped() {
                return Ok(None);
            }
            let steps = if done + most < maps { most } else { maps - done };
            let here = states[states.len() - initial.len()..].to_vec();
            let moved = self.rollout(&here, Rollout { steps, every: 1 })?;
            states.extend_from_slice(&moved[initial.len()..]);
            done += steps;
        }
        Ok(Some(states))
    }
}

/// The states of all lines, or, where that fails, of one line after another: from where a line is lost they are NaN.
fn or_line_by_line(
    initial: &[f64],
    request: Rollout,
    rollout: impl Fn(&[f64], Rollout) -> Result<Vec<f64>, Error>,
) -> Vec<f64> {
    if let Ok(states) = rollout(initial, request) {
        return states;
    }
    let mut out = vec![f64::NAN; request.kept() * initial.len()];
    for (m, start) in initial.chunks_exact(2).enumerate() {
        for (t, state) in until_lost(start, request, &rollout).chunks_exact(2).enumerate() {
            out[t * initial.len() + 2 * m..][..2].copy_from_slice(state);
        }
    }
    out
}

/// The states of a line that are kept, up to the last one before it is lost: it is followed over ever fewer maps at
/// once.
fn until_lost(
    start: &[f64],
    request: Rollout,
    rollout: &impl Fn(&[f64], Rollout) -> Result<Vec<f64>, Error>,
) -> Vec<f64> {
    let every = request.every;
    let mut states = start.to_vec();
    let mut left = request.kept() - 1;
    let mut part = left;
    while part > 0 && left > 0 {
        if part > left {
            part = left;
        }
        let here = &states[states.len() - 2..];
        match rollout(here, Rollout { steps: part * every, every }) {
            Ok(moved) => {
                states.extend_from_slice(&moved[2..]);
                left -= part;
            }
            Err(_) => part /= 2,
        }
    }
    states
}

/// Over so many maps lines are followed through planes, which takes seconds.
pub(super) const MOST_MAPS_OF_PLANES: usize = 10_000;

/// A map with its name.
pub(super) struct NamedMap<'a> {
    pub(super) name: String,
    /// A degree or a number of steps, where there are several of one kind.
    pub(super) setting: Option<usize>,
    /// Its numbers, where they are fitted to pairs.
    pub(super) parameters: Option<usize>,
    pub(super) map: SectionMap<'a>,
}

impl NamedMap<'_> {
    /// Whether a million maps are a moment's work.
    pub(super) fn is_fast(&self) -> bool {
        !matches!(self.map, SectionMap::Tabulated(_) | SectionMap::Coils(_))
    }

    /// Over how many maps the judged lines are followed at most.
    fn most_maps(&self) -> usize {
        match self.map {
            SectionMap::Coils(_) => 0,
            SectionMap::Tabulated(_) => MOST_MAPS_OF_PLANES,
            SectionMap::Network(_) | SectionMap::Polynomial(_) | SectionMap::Generating(_) => {
                usize::MAX
            }
        }
    }
}

/// What the reference knows of the lines.
pub(super) struct Judge<'a> {
    /// The axis about which angles are taken.
    pub(super) axis: [f64; 2],
    /// Held-out points and their images.
    pub(super) pairs: [&'a [f64]; 2],
    /// Where the judged lines begin, and so many of their points afterwards.
    pub(super) initial: Vec<f64>,
    pub(super) early: Trajectories,
    /// The curve that each line is on; none of a line that is on no smooth one.
    pub(super) circles: Vec<Option<InvariantCircle>>,
    /// The flux within each of these curves by this density, in webers.
    pub(super) flux: Vec<Option<f64>>,
    pub(super) density: Option<&'a AreaDensity>,
    /// The largest distance of a point of the reference, of those that the fits have not seen, from its curve.
    pub(super) curves: f64,
    /// What planes that the reference goes through err by in a map, root mean square on held-out lines.
    pub(super) planes: f64,
    /// Where the judged lines are after the maps of the reference.
    pub(super) after: Vec<f64>,
    /// Where the lines of the profile begin.
    pub(super) profile: Vec<f64>,
    /// Maps over which rotation is averaged.
    pub(super) maps: usize,
    /// Turns a map near the axis.
    pub(super) near: f64,
    /// The rotation of the reference.
    pub(super) rotation: Vec<RotationNumber>,
    /// The flux within the surfaces of the reference that lines of the profile are on; none of a line that is on no
    /// smooth one.
    pub(super) flux_of_profile: Vec<Option<f64>>,
    /// Numbers of maps, ascending, before each of which points are compared with the curves.
    pub(super) counts: &'a [usize],
    /// The number of points of each line that are compared with its curve before each count.
    pub(super) last: usize,
}

/// A number of maps, and a distance from its curve for each line that has one.
type OffCurves = (usize, Vec<Option<f64>>);

/// How well a map does.
#[derive(Clone, Serialize)]
pub(super) struct Judged {
    pub(super) name: String,
    pub(super) setting: Option<usize>,
    pub(super) parameters: Option<usize>,
    /// It follows lines from plane to plane.
    pub(super) is_tracing: bool,
    /// Of one map: root mean square and largest distance, in metres.
    pub(super) one: [f64; 2],
    /// Root mean square distance along the early points.
    pub(super) early: f64,
    /// Number of maps, and the largest distance from the curve of each line; none of a line that is on no smooth one.
    pub(super) off: Vec<OffCurves>,
    /// The largest difference of the flux within a curve of its own from that within the curve of the reference, as a
    /// share of the latter; none of tracing and where no line of the reference is on a smooth curve, NaN where one of
    /// the map's is on none or leaves the box of the density.
    pub(super) flux: Option<f64>,
    /// The rotation of each line of the profile, in turns a map, and its error.
    pub(super) rotation: Vec<RotationTurns>,
    /// Median and largest difference from those of the reference, where it is sure of them, in turns a map.
    pub(super) turns: [f64; 2],
}

/// The numbers of a [`RotationNumber`], in a form that can be serialised.
#[derive(Clone, Copy, Serialize)]
pub(super) struct RotationTurns {
    pub(super) turns: f64,
    pub(super) error: f64,
}

impl Judged {
    /// The largest distance of all lines after this number of maps; None if it was not measured, or if no line is on a
    /// smooth curve.
    pub(super) fn off_at(&self, count: usize) -> Option<f64> {
        let (_, off) = self.off.iter().find(|(maps, _)| *maps == count)?;
        off.iter().flatten().copied().reduce(max_or_nan)
    }
}

/// A curve that misses points of its own line by more is none, in metres.
const SMOOTH: f64 = 1e-6;

/// Rotation is sure where the averages over both halves differ by no more, in turns a map.
pub(super) const SURE: f64 = 1e-9;

impl Judge<'_> {
    pub(super) fn angle(&self) -> impl Fn(&[f64]) -> f64 + Sync + use<> {
        let [radius, height] = self.axis;
        move |z| libm::atan2(z[1] - height, z[0] - radius)
    }

    pub(super) fn of(&self, named: &NamedMap<'_>) -> Result<Judged, Error> {
        let [input, output] = self.pairs;
        let one = Rollout { steps: 1, every: 1 };
        let image = named.map.rollout(input, one)?.split_off(input.len());
        let largest = image.chunks_exact(2).zip(output.chunks_exact(2));
        let largest =
            largest.map(|(a, b)| libm::hypot(a[0] - b[0], a[1] - b[1])).fold(0.0, max_or_nan);
        let steps = self.early.states() - 1;
        let orbit = named.map.rollout(&self.initial, Rollout { steps, every: 1 })?;
        let row = self.initial.len();
        let early = root_mean_square_distance(&orbit[row..], &self.early.values()[row..], 2);
        let off = self.off(named)?;
        let flux = match named.is_fast() {
            true => self.flux_of(&named.map)?,
            false => None,
        };
        let rotation = self.rotation_of(&named.map)?;
        let turns = self.differences(&rotation);
        Ok(Judged {
            name: named.name.clone(),
            setting: named.setting,
            parameters: named.parameters,
            is_tracing: !named.is_fast(),
            one: [root_mean_square_distance(&image, output, 2), largest],
            early,
            off,
            flux,
            rotation: rotation
                .iter()
                .map(|found| RotationTurns { turns: found.turns, error: found.error })
                .collect(),
            turns,
        })
    }

    fn flux_of(&self, map: &SectionMap<'_>) -> Result<Option<f64>, Error> {
        let states = map.rollout(&self.initial, Rollout { steps: self.maps, every: 1 })?;
        let orbits = Trajectories::new(states, 2, self.initial.len() / 2)?;
        let curves = self.curves_of(&orbits)?;
        let both = self.flux.iter().zip(curves);
        let off = both.filter_map(|(own, curve)| {
            let own = (*own)?;
            Some(
                curve
                    .and_then(|curve| self.flux_in(&curve))
                    .map_or(f64::NAN, |flux| (flux / own - 1.0).abs()),
            )
        });
        Ok(off.reduce(max_or_nan))
    }

    /// The flux within a curve, in webers; none of one that leaves the box of the density.
    pub(super) fn flux_in(&self, curve: &InvariantCircle) -> Option<f64> {
        Some(curve.flux(self.density?).abs()).filter(|flux| flux.is_finite())
    }

    /// The smooth curve that each line is on; none of a line that is on no such one.
    pub(super) fn curves_of(
        &self,
        orbits: &Trajectories,
    ) -> Result<Vec<Option<InvariantCircle>>, Error> {
        let turns = rotation_numbers(orbits, self.near, self.angle());
        let of = |(m, turns): (usize, &RotationNumber)| {
            let orbit: Vec<f64> = orbits.orbit(m).flatten().copied().collect();
            let circle = match orbit.iter().all(|v| v.is_finite()) {
                true => Some(InvariantCircle::of_orbit(&orbit, turns.turns)?),
                false => None,
            };
            Ok(circle.filter(|circle| circle.error <= SMOOTH))
        };
        turns.par_iter().enumerate().map(of).collect()
    }

    /// The rotation of the lines of the profile; none by coils, which take too long.
    fn rotation_of(&self, map: &SectionMap<'_>) -> Result<Vec<RotationNumber>, Error> {
        if matches!(map, SectionMap::Coils(_)) {
            return Ok(Vec::new());
        }
        let states = map.rollout(&self.profile, Rollout { steps: self.maps, every: 1 })?;
        let orbits = Trajectories::new(states, 2, self.profile.len() / 2)?;
        Ok(rotation_numbers(&orbits, self.near, self.angle()))
    }

    fn differences(&self, found: &[RotationNumber]) -> [f64; 2] {
        let pairs = found.iter().zip(&self.rotation).filter(|(_, own)| own.error <= SURE);
        let mut all: Vec<f64> = pairs.map(|(a, b)| (a.turns - b.turns).abs()).collect();
        if all.is_empty() {
            return [f64::NAN; 2];
        }
        all.sort_by(f64::total_cmp);
        [all[all.len() / 2], all.iter().copied().fold(0.0, max_or_nan)]
    }

    /// The largest distance of the last points before each count from the curve of their line.
    fn off(&self, named: &NamedMap<'_>) -> Result<Vec<OffCurves>, Error> {
        let (map, row, most) = (&named.map, self.initial.len(), named.most_maps());
        let (mut here, mut done, mut out) = (self.initial.clone(), 0, Vec::new());
        for &count in self.counts.iter().take_while(|count| **count <= most) {
            let first = count.saturating_sub(self.last).max(done);
            if first > done {
                let steps = first - done;
                here = map.rollout(&here, Rollout { steps, every: steps })?.split_off(row);
            }
            let states = map.rollout(&here, Rollout { steps: count - first, every: 1 })?;
            here = states[states.len() - row..].to_vec();
            let orbits = Trajectories::new(states, 2, row / 2)?;
            let each = self.circles.iter().enumerate().map(|(m, circle)| {
                let points: Vec<f64> = orbits.orbit(m).flatten().copied().collect();
                circle.as_ref()?.distances(&points).into_iter().reduce(max_or_nan)
            });
            out.push((count, each.collect()));
            done = count;
        }
        Ok(out)
    }
}

/// Periodic orbits of one rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Resonance {
    /// Turns about the axis …
    pub(super) turns: usize,
    /// … in so many maps.
    pub(super) maps: usize,
}

impl Resonance {
    /// The resonance of the fewest maps, at most `most`, whose rotation lies within those of a profile.
    pub(super) fn lowest(rotation: &[RotationNumber], most: usize) -> Option<Self> {
        let sure = rotation.iter().filter(|found| found.error <= SURE);
        let turns: Vec<f64> = sure.map(|found| found.turns.abs()).collect();
        let (mut low, mut high) = (f64::INFINITY, 0.0);
        for &value in &turns {
            // no NaN: its error would be one
            (low, high) = (f64::min(low, value), f64::max(high, value));
        }
        (1..=most).find_map(|maps| {
            let turns = (low * maps as f64).ceil() as usize;
            let found = turns as f64 / maps as f64;
            (turns > 0 && found > low && found < high).then_some(Self { turns, maps })
        })
    }

    pub(super) fn value(self) -> f64 {
        self.turns as f64 / self.maps as f64
    }
}

/// What a map makes of a resonance.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Chain {
    /// The orbit about which lines turn, its residue, …
    pub(super) centre: Option<OrbitFound>,
    /// … and the one that they leave.
    pub(super) corner: Option<OrbitFound>,
    /// The width of the island through the centre, on the ray from the axis, in metres.
    pub(super) width: Option<f64>,
    /// The phase of the chain, in radians: the smallest angle between the direction of R and that from the axis to an
    /// island's centre.
    pub(super) phase: Option<f64>,
}

/// A periodic orbit, in a report.
#[derive(Clone, Debug, Serialize)]
pub(super) struct OrbitFound {
    pub(super) points: Vec<Vec<f64>>,
    pub(super) trace: f64,
    pub(super) residue: f64,
}

impl OrbitFound {
    fn of(orbit: &PeriodicOrbit) -> Self {
        let (trace, residue) = (orbit.trace(), orbit.residue());
        Self { points: orbit.points.clone(), trace, residue }
    }

    /// The largest distance of a point of the other orbit from the nearest of this one.
    pub(super) fn apart(&self, other: &Self) -> f64 {
        let from = |point: &Vec<f64>| {
            let of = |own: &Vec<f64>| libm::hypot(own[0] - point[0], own[1] - point[1]);
            // no NaN: Newton's method has found both
            self.points.iter().map(of).fold(f64::INFINITY, f64::min)
        };
        other.points.iter().map(from).fold(0.0, max_or_nan)
    }
}

/// The orbits of a resonance that are found on the line Z = 0, without a guess, in a section that is mirrored there.
#[derive(Clone, Debug, Serialize)]
pub(super) struct OnSymmetryLine {
    /// The number of orbits of this rotation that begin on the line.
    pub(super) orbits: usize,
    /// How far the centre of the chain that they lead to is from that of the chain, in metres, …
    pub(super) centre: Option<f64>,
    /// … and its corner; None where they do not lead to one.
    pub(super) corner: Option<f64>,
}

impl OnSymmetryLine {
    /// Of so many orbits that lead to a chain, beside the chain that guesses lead to.
    pub(super) fn of(orbits: usize, found: &Chain, chain: &Chain) -> Self {
        let apart = |found: &Option<OrbitFound>, own: &Option<OrbitFound>| {
            Some(own.as_ref()?.apart(found.as_ref()?))
        };
        let centre = apart(&found.centre, &chain.centre);
        Self { orbits, centre, corner: apart(&found.corner, &chain.corner) }
    }
}

/// Orbits nearer to one another, in metres, are one.
const APART: f64 = 1e-6;

/// Residues below are those of a curve whose points all come back but for rounding.
const LEAST_RESIDUE: f64 = 1e-9;

impl Judge<'_> {
    /// Where the rotation of the reference crosses that of a resonance, outwards from the axis: a distance, in metres.
    pub(super) fn radius_of(&self, resonance: Resonance) -> Option<f64> {
        let value = resonance.value();
        let mut before: Option<(f64, f64)> = None;
        for (place, found) in self.profile.chunks_exact(2).zip(&self.rotation) {
            if !(found.error <= SURE) {
                continue;
            }
            let (radius, turns) = (place[0] - self.axis[0], found.turns.abs() - value);
            if let Some((other, of_other)) = before
                && of_other * turns <= 0.0
            {
                return Some(other + (radius - other) * of_other / (of_other - turns));
            }
            before = Some((radius, turns));
        }
        None
    }

    /// The orbits of a resonance that a map has, found from these guesses.
    pub(super) fn chain(
        &self,
        map: &SectionMap<'_>,
        resonance: Resonance,
        guesses: &[Vec<f64>],
    ) -> Result<Chain, Error> {
        let with_jacobian = |z: &[f64]| map.with_jacobian(z);
        let found = periodic_orbits(&with_jacobian, guesses, resonance.maps, APART)?;
        let resolved = |orbit: &&PeriodicOrbit| orbit.residue().abs() > LEAST_RESIDUE;
        let of = |centre: bool| {
            let mut orbits = found.iter().filter(resolved);
            orbits.find(|orbit| (orbit.residue() > 0.0) == centre).map(OrbitFound::of)
        };
        let [centre, corner] = [of(true), of(false)];
        let angle = |z: &Vec<f64>| libm::atan2(z[1] - self.axis[1], z[0] - self.axis[0]).abs();
        let phase = centre.as_ref().map(|orbit| {
            let angles = orbit.points.iter().map(angle);
            // no NaN: found by Newton's method
            angles.fold(f64::INFINITY, f64::min)
        });
        Ok(Chain { centre, corner, width: None, phase })
    }

    /// Where the orbits of a resonance begin that a map has on the line Z = 0, to half as far again on either side of
    /// the axis as the resonance is on one. A map that is not reversible has none.
    pub(super) fn on_symmetry_line(
        &self,
        map: &SectionMap<'_>,
        resonance: Resonance,
        radius: f64,
    ) -> Result<Vec<Vec<f64>>, Error> {
        /// How far out on either side, over the distance of the resonance from the axis on one.
        const WITHIN: f64 = 1.5;
        const SAMPLES: usize = 401;
        let line = SymmetryLine {
            reversor: Reversor::Momenta,
            from: self.axis[0] - WITHIN * radius,
            to: self.axis[0] + WITHIN * radius,
            samples: SAMPLES,
        };
        let with_jacobian = |z: &[f64]| map.with_jacobian(z);
        let mut found = symmetric_periodic_orbits(&with_jacobian, &line, resonance.maps)?;
        found.retain(|orbit| self.turns_of(&orbit.points) == Some(resonance.turns));
        Ok(found.into_iter().map(|mut orbit| orbit.points.swap_remove(0)).collect())
    }

    /// How often a periodic orbit goes round the axis, each map by less than half a turn.
    fn turns_of(&self, points: &[Vec<f64>]) -> Option<usize> {
        let angle = |z: &[f64]| libm::atan2(z[1] - self.axis[1], z[0] - self.axis[0]) / TAU;
        let next = points.iter().cycle().skip(1);
        let steps = points.iter().zip(next).map(|(from, to)| {
            let step = angle(to) - angle(from);
            step - step.round()
        });
        let turns = steps.sum::<f64>().abs().round();
        (turns >= 0.0 && turns <= points.len() as f64).then_some(turns as usize)
    }

    /// Points from which the orbits of a resonance are looked for: those of an orbit that begins where the rotation is
    /// that of the resonance, and points between them.
    pub(super) fn guesses(
        &self,
        map: &SectionMap<'_>,
        resonance: Resonance,
        radius: f64,
    ) -> Result<Vec<Vec<f64>>, Error> {
        let start = [self.axis[0] + radius, self.axis[1]];
        let request = Rollout { steps: resonance.maps - 1, every: 1 };
        let states = map.rollout(&start, request)?;
        let angle = self.angle();
        let mut points: Vec<Vec<f64>> = states.chunks_exact(2).map(<[f64]>::to_vec).collect();
        points.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
        let next = points.iter().cycle().skip(1);
        let between = points.iter().zip(next).map(|(a, b)| {
            let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
            // The chord is within the curve.
            let [off, height] = [middle[0] - self.axis[0], middle[1] - self.axis[1]];
            let of = |z: &[f64]| libm::hypot(z[0] - self.axis[0], z[1] - self.axis[1]);
            let wanted = 0.5 * (of(a) + of(b)) / libm::hypot(off, height);
            vec![wanted.mul_add(off, self.axis[0]), wanted.mul_add(height, self.axis[1])]
        });
        Ok([vec![start.to_vec()], between.take(1).collect(), points[..1].to_vec()].concat())
    }

    /// How many maps distinguish an island from a line that only turns about as fast. None if that is too many.
    pub(super) fn maps_of_island(centre: &OrbitFound) -> Option<usize> {
        const MOST: usize = 10_000;
        let maps = IslandSearch::maps_for(centre.points.len(), centre.residue.clamp(0.0, 1.0));
        maps.filter(|maps| *maps <= MOST)
    }

    /// The part of the ray from the axis through the first point of an orbit on which lines stay in its island for so
    /// many maps.
    pub(super) fn width(
        &self,
        map: &SectionMap<'_>,
        orbit: &[Vec<f64>],
        maps: usize,
    ) -> Result<Option<f64>, Error> {
        /// An island is looked for so far on either side, as a share of the distance from the axis.
        const REACH: f64 = 0.15;
        let search = IslandSearch { around: self.axis, reach: REACH, maps };
        let follow = |points: &[f64], steps: usize| {
            let states = map.rollout(points, Rollout { steps, every: 1 })?;
            Ok(states[points.len()..].to_vec())
        };
        Ok(search.find(orbit, &follow)?.map(|island| island.interval.width()))
    }
}
