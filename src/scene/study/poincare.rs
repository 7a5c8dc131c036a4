//! Maps of a section of the field of coils: networks beside polynomials, tabulated planes and tracing.

use super::line_edge::{EDGE, EdgeOptions, MANIFOLDS, edge_of};
use super::poincare_figures::{ROTATION, SURFACES, rotation_figure, surfaces_figure};
use super::rollout::orbit_color;
use super::section_maps::{
    Chain, Judge, Judged, MOST_MAPS_OF_PLANES, NamedMap, OnSymmetryLine, OrbitFound, Resonance,
    SURE, SectionMap,
};
use super::section_orbits::{Fixed, OrbitsOf};
use super::shared::{Study, finite};
use super::work_precision::MOST_ROUNDS;
use crate::error::Error;
use crate::flow::{
    Integrator, PolynomialMap, PolynomialOnSection, Symmetries, TabulatedLines, Trajectories,
};
use crate::io::{Provenance, StoredModel};
use crate::layer::Reversor;
use crate::measure::{
    orbits::{InvariantCircle, RotationNumber, rotation_numbers},
    timing::{Comparison, Method, TrajectoryMethods, break_even, root_mean_square_distance},
};
use crate::network::Rollout;
use crate::scalar::max_or_nan;
use crate::scene::bibliography::{
    ALIGNMENT, BIRKHOFF_AVERAGES, EXPONENTS, INVARIANT_CURVES, MANIFOLDS_OF_MAPS, MAP_METHODS,
    RESIDUES, SYMPLECTIC_MAPS,
};
use crate::scene::context::{Context, LINES, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Figure, Panel, SameAxes, Series, Style};
use crate::scene::findings::{Block, Cell, Findings, Format, Section, Table};
use crate::scene::line_data::TracedLines;
use crate::scene::setup::{MOST, Need};
use crate::scene::trained::Trained;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::rc::Rc;

const POINCARE: &str = "poincare";

/// Fewer maps determine no rotation, and no curve.
const LEAST_MAPS: usize = 128;
/// The states of more do not fit into memory.
const MOST_MAPS: usize = 1_000_000;
/// No polynomial is of a higher degree.
const MOST_DEGREE: usize = 60;

/// Maps of a section of the field of coils.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoincareOptions {
    /// The number of lines, between axis and reach, that are judged point by point and on their curves.
    pub lines: usize,
    /// The number of maps over which their points are compared one by one.
    pub early: usize,
    /// The number of maps over which the reference follows lines, to know their curves and how fast they turn.
    pub reference: usize,
    /// The planes through which the reference follows lines. Unless given, it follows them in the field of the coils,
    /// which takes long.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_planes: Option<Planes>,
    /// The numbers of maps, ascending, up to which lines are followed. Before each, the distances of points of
    /// networks, of polynomials and, up to 10,000 maps, of planes from the curves of the reference are measured.
    pub counts: Vec<usize>,
    /// The number of such points of each line.
    pub last: usize,
    /// The number of lines in the profile of rotation.
    pub profile: usize,
    /// The highest period of the orbits that are looked for; 0 looks for none but the axis.
    pub orbits: usize,
    /// How often each time is taken.
    pub rounds: usize,
    /// Degrees of polynomials of least squares, as rivals.
    #[serde(default)]
    pub polynomials: Vec<usize>,
    /// Degrees of polynomial generating functions of least squares, as symplectic rivals.
    #[serde(default)]
    pub symplectic_polynomials: Vec<usize>,
    /// Degrees of even ones, for sections that the reflection of Z maps to themselves with lines that run backwards.
    #[serde(default)]
    pub reversible_polynomials: Vec<usize>,
    /// Tabulated planes that lines are followed through, as rivals of the networks.
    #[serde(default)]
    pub planes: Vec<Planes>,
    /// Tracing in the field of the coils, as a rival: each number divides the number of steps of the reference.
    #[serde(default)]
    pub tracing: Vec<usize>,
    /// Lines over the edge of the surfaces: which are lost, and which are chaotic.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edge: Option<EdgeOptions>,
}

/// Planes on which the field of coils is a polynomial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Planes {
    /// The number by which the steps of the reference in a map are divided.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub fewer: usize,
    /// The degree on each plane.
    pub degree: usize,
}

fn one() -> usize {
    1
}

fn is_one(count: &usize) -> bool {
    *count == 1
}

/// As many steps as the reference has, over a number.
fn steps_of(lines: &TracedLines, fewer: usize) -> usize {
    lines.section.map().steps().div_ceil(fewer)
}

impl Planes {
    fn check(&self, name: &str) -> Result<(), Error> {
        Error::check_count_range(&format!("{name}.fewer"), self.fewer, 1, 1024)?;
        Error::check_count_range(&format!("{name}.degree"), self.degree, 1, MOST_DEGREE)
    }
}

impl Study for PoincareOptions {
    fn name(&self) -> &'static str {
        "poincare"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::TargetFlow, Need::FlowTime, Need::Data, Need::Models]
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        Error::check_count_range("lines", self.lines, 1, 1000)?;
        Error::check_count_range("early", self.early, 1, MOST_MAPS)?;
        Error::check_count_range("reference", self.reference, LEAST_MAPS, MOST_MAPS)?;
        Error::check_count_range("counts", self.counts.len(), 1, 100)?;
        Error::check_count_range("last", self.last, 1, MOST_MAPS)?;
        Error::check_count_range("profile", self.profile, 2, 10_000)?;
        Error::check_count_range("orbits", self.orbits, 0, 1000)?;
        Error::check_count_range("rounds", self.rounds, 1, MOST_ROUNDS)?;
        for pair in self.counts.windows(2) {
            if pair[0] >= pair[1] {
                let found = format!("{} after {}", pair[1], pair[0]);
                return Err(Error::invalid("counts", found, "numbers that grow"));
            }
        }
        self.counts.iter().try_for_each(|&n| Error::check_count_range("counts", n, 1, MOST))?;
        for &degree in &self.polynomials {
            Error::check_count_range("polynomials", degree, 1, MOST_DEGREE)?;
        }
        for (name, degrees) in [
            ("symplectic_polynomials", &self.symplectic_polynomials),
            ("reversible_polynomials", &self.reversible_polynomials),
        ] {
            for &degree in degrees {
                Error::check_count_range(name, degree, 2, MOST_DEGREE)?;
            }
        }
        self.planes.iter().try_for_each(|planes| planes.check("planes"))?;
        self.reference_planes.iter().try_for_each(|planes| planes.check("reference_planes"))?;
        for &fewer in &self.tracing {
            Error::check_count_range("tracing", fewer, 1, 1024)?;
        }
        self.edge.iter().try_for_each(EdgeOptions::check)?;
        let data = scene.setup.data.as_ref();
        if let Some(lines) = data.and_then(|data| data.lines.as_ref())
            && !self.reversible_polynomials.is_empty()
        {
            let checked = lines.check_reversor(Reversor::Positions);
            checked.map_err(|error| error.with_place("reversible_polynomials"))?;
        }
        if let Some(data) = data
            && data.lines.is_none()
        {
            return Err(Error::invalid("data", "no data.lines", "field lines of coils"));
        }
        if let Some(controls) = data.and_then(|data| data.lines.as_ref()?.controls.as_ref()) {
            let names: Vec<&str> = controls.list.iter().map(|one| &*one.name).collect();
            let expected = "none: lines of several machines are those of the study `controls`";
            return Err(Error::invalid("data.lines.controls", names.join(", "), expected));
        }
        if let Some((data, lines)) = data.and_then(|data| Some((data, data.lines.as_ref()?))) {
            let kept = lines.lines as f64 * (1.0 - data.validation);
            let pairs = kept * data.orbit as f64;
            let of_planes = self.planes.iter().chain(&self.reference_planes);
            let symplectic = self.symplectic().map(|(degree, _)| degree);
            let polynomials = self.polynomials.iter().copied().chain(symplectic);
            let degrees = of_planes.map(|planes| planes.degree).chain(polynomials);
            for degree in degrees {
                let least = 2 * terms_of(degree);
                if pairs < least as f64 {
                    let found = format!("{degree} for {pairs:.0} pairs to train with");
                    let expected = format!("at least {least} pairs: more lines or longer ones");
                    return Err(Error::invalid("degree", found, expected));
                }
            }
        }
        if let Some(data) = data
            && !(data.validation > 0.0)
        {
            return Err(Error::invalid("data.validation", data.validation, "lines held out"));
        }
        Ok(())
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        let mut figures = vec![POINCARE, ROTATION, SURFACES];
        if let Some(edge) = &self.edge {
            figures.push(EDGE);
            figures.extend((edge.manifold > 0.0).then_some(MANIFOLDS));
        }
        figures
    }

    fn cites(&self, _: &Declared<'_>) -> Vec<&'static str> {
        let mut cited = Vec::from_iter(Integrator::DormandPrince8.bibtex());
        cited.extend([MAP_METHODS, BIRKHOFF_AVERAGES, INVARIANT_CURVES, RESIDUES]);
        cited.extend(self.symplectic().next().map(|_| SYMPLECTIC_MAPS));
        if let Some(edge) = &self.edge {
            cited.extend([EXPONENTS, ALIGNMENT]);
            cited.extend((edge.manifold > 0.0).then_some(MANIFOLDS_OF_MAPS));
        }
        cited
    }

    fn without_mirror(&mut self) -> Vec<String> {
        let degrees = std::mem::take(&mut self.reversible_polynomials);
        degrees.iter().map(|degree| format!("reversible polynomial of degree {degree}")).collect()
    }

    /// Makes the study shorter: lower degrees, fewer maps, fewer lines and fewer rounds.
    fn shorten(&mut self) {
        const LONGEST: usize = 10_000;
        // A quarter of the pairs does not determine more coefficients.
        const HIGHEST: usize = 25;
        for degrees in [&mut self.symplectic_polynomials, &mut self.reversible_polynomials] {
            degrees.retain(|degree| *degree <= HIGHEST);
        }
        self.counts.retain(|count| *count <= LONGEST);
        if self.counts.is_empty() {
            self.counts.push(LONGEST);
        }
        self.profile = (self.profile / 4).max(2);
        self.reference = (self.reference / 4).max(LEAST_MAPS);
        self.rounds = self.rounds.min(3);
        self.edge.iter_mut().for_each(EdgeOptions::shorten);
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let lines = context.lines()?;
        // What may fail, before anything is trained.
        let reference = context.stage("field of the reference", |_| self.reference(&lines))?;
        let held_out = lines.held_out.as_ref().unwrap_or(&lines.training);
        let judge = context.stage("lines of the reference", |context| {
            self.judge(&lines, &reference, &|| context.interrupted())
        })?;
        let (mut rivals, mut unsolved): (Vec<NamedMap<'_>>, Vec<String>) = Default::default();
        for &degree in &self.polynomials {
            let name = format!("polynomial of degree {degree}");
            let map = context.stage(&name, |_| PolynomialMap::fit(&lines.training, degree))?;
            let (parameters, setting) = (Some(map.parameters()), Some(degree));
            rivals.push(NamedMap { name, setting, parameters, map: SectionMap::Polynomial(map) });
        }
        for (degree, reversor) in self.symplectic() {
            let kind = if reversor.is_some() { "reversible" } else { "symplectic" };
            let name = format!("{kind} polynomial of degree {degree}");
            let found = context.stage(&name, |_| {
                let chart = Some(lines.chart.clone());
                let symmetries = Symmetries { reversor, ..Symmetries::default() };
                Ok::<_, RunError>(PolynomialOnSection::fit(
                    &lines.training,
                    degree,
                    &symmetries,
                    chart,
                ))
            })?;
            let map = match found {
                Ok(map) => map,
                // Of the other maps there is something to be said.
                Err(error @ (Error::NoConvergence { .. } | Error::Diverged { .. })) => {
                    unsolved.push(format!("{name} is left out: {error}."));
                    continue;
                }
                Err(error) => return Err(error.into()),
            };
            let (parameters, setting) = (Some(map.map().parameters()), Some(degree));
            let map = SectionMap::Generating(Box::new(map));
            rivals.push(NamedMap { name, setting, parameters, map });
        }
        for planes in &self.planes {
            let steps = steps_of(&lines, planes.fewer);
            let name = format!("planes of degree {}, {steps} steps", planes.degree);
            let map = context.stage(&name, |_| planes.of(&lines))?;
            let parameters = Some(map.bytes() / size_of::<f64>());
            let setting = Some(steps);
            rivals.push(NamedMap { name, setting, parameters, map: SectionMap::Tabulated(map) });
        }
        for &fewer in &self.tracing {
            let steps = steps_of(&lines, fewer);
            let map = SectionMap::Coils(lines.section.map().with_steps(steps));
            let name = format!("coils, {steps} steps");
            rivals.push(NamedMap { name, setting: Some(steps), parameters: None, map });
        }
        let models = context.models()?;
        let data = context.data()?;
        let stored = |trained: &Rc<Trained>| NamedMap {
            name: trained.spec.name.clone(),
            setting: None,
            parameters: Some(trained.model().composition().parameters().len()),
            map: SectionMap::Network(Box::new(StoredModel {
                model: trained.model().clone(),
                units: data.units.clone(),
                section: Some(lines.chart.clone()),
                provenance: Provenance::of_scene(context.scene.name),
            })),
        };
        let mut maps: Vec<NamedMap<'_>> = models.iter().map(stored).collect();
        let networks = maps.len();
        maps.append(&mut rivals);
        let mut found = Vec::new();
        for named in &maps {
            let stage = format!("lines of {}", named.name);
            let mut judged = context.stage(&stage, |_| judge.of(named))?;
            let steps = lines.section.map().steps();
            if matches!(named.map, SectionMap::Coils(_)) && named.setting == Some(steps) {
                // The reference itself: of it its estimate is known.
                (judged.one, judged.early) = ([lines.section.error(); 2], f64::NAN);
            }
            found.push(judged);
            if context.interrupted() {
                return Err(RunError::Interrupted);
            }
        }
        let fixed = context
            .stage("periodic orbits", |_| self.orbits_of(&lines, &judge, &maps, &reference))?;
        if context.interrupted() {
            return Err(RunError::Interrupted);
        }
        let edge = match &self.edge {
            None => Vec::new(),
            Some(options) => context.stage("edge", |_| {
                let fast = maps.iter().filter(|named| named.is_fast());
                let corners = fixed.found.iter().map(|of| of.chain.corner.as_ref());
                let (maps, own) = (fast.zip(corners).collect::<Vec<_>>(), &fixed.chain.corner);
                let field = lines.section.map();
                edge_of(options, &judge, (&reference, own.as_ref()), field, &maps)
            })?,
        };
        if context.interrupted() {
            return Err(RunError::Interrupted);
        }
        let timed = context.stage("run times", |_| {
            self.timed(&maps, &judge, [held_out.input(), held_out.output()])
        })?;
        let mut figures = Vec::new();
        if context.draws(POINCARE) {
            figures.push(self.portrait(&judge, &maps[..networks], &reference)?);
        }
        if context.draws(ROTATION) {
            figures.push(rotation_figure(&lines, &judge, &found));
        }
        if context.draws(SURFACES) {
            figures.push(surfaces_figure(&found));
        }
        if let Some(options) = self.edge.as_ref().filter(|_| context.draws(EDGE)) {
            figures.push(options.figure(&edge));
        }
        if context.draws(MANIFOLDS) {
            figures.push(EdgeOptions::manifolds(&edge));
        }
        let results = Results { options: self, lines: &lines, judge: &judge, found: &found };
        let mut summary = vec![
            Block::Text(results.words()),
            Block::Table(results.table()),
            Block::Text(results.words_of_surfaces()),
            Block::Table(results.off()),
            Block::Text(fixed.words(&lines)),
            Block::Table(fixed.table()),
        ];
        summary.extend(unsolved.into_iter().map(Block::Text));
        summary.extend(self.edge.iter().flat_map(|options| options.summary(&edge)));
        let paid = Paid {
            lines: context.seconds_of(LINES),
            training: context
                .training_times()
                .iter()
                .map(|times| (times.model.clone(), times.points.last().map_or(0.0, |p| p.1)))
                .collect(),
        };
        let times = vec![
            Block::Text(results.words_of_times(&timed, &paid)),
            Block::Table(results.times(&timed, &paid)),
        ];
        let circles = judge.circles.iter().zip(&judge.flux);
        let circles: Vec<_> = circles
            .map(|(circle, flux)| {
                circle.as_ref().map(|one| {
                    let (modes, area) = (one.modes(), one.area());
                    json!({
                        "modes": modes, "error": one.error, "turns": one.turns, "area": area, "flux": flux,
                    })
                })
            })
            .collect();
        let profile =
            judge.profile.chunks_exact(2).zip(&judge.rotation).zip(&judge.flux_of_profile);
        let profile: Vec<_> = profile
            .map(|((z, rotation), flux)| {
                let RotationNumber { turns, error } = rotation;
                json!({ "at": z, "turns": turns, "error": error, "flux": flux })
            })
            .collect();
        Ok(Findings {
            title: "Field lines of coils".into(),
            results: Section {
                summary,
                data: json!({
                    "axis": judge.axis,
                    "lost": lines.lost,
                    "reference_error": lines.section.error(),
                    "curves": circles,
                    "profile": profile,
                    "off_curves": judge.curves,
                    "methods": found,
                    "orbits": fixed,
                    "edge": edge,
                }),
                ..Section::default()
            },
            timings: Section { summary: times, data: json!(timed), ..Section::default() },
            figures,
            ..Findings::default()
        })
    }
}

/// Terms of a polynomial of two coordinates.
fn terms_of(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2
}

impl Planes {
    /// Fitted along the lines that a scene is trained with.
    fn of(&self, lines: &TracedLines) -> Result<TabulatedLines, Error> {
        /// Points for each term of a polynomial.
        const POINTS_A_TERM: usize = 4;
        let points = lines.training.thinned(POINTS_A_TERM * terms_of(self.degree));
        TabulatedLines::new(
            &lines.section.map().with_steps(steps_of(lines, self.fewer)),
            points.input(),
            self.degree,
        )
    }
}

impl PoincareOptions {
    /// The degrees of its symplectic polynomials; of those that are even, with the reflection of Z, the position of the
    /// chart.
    fn symplectic(&self) -> impl Iterator<Item = (usize, Option<Reversor>)> {
        let plain = self.symplectic_polynomials.iter().map(|degree| (*degree, None));
        let even = self.reversible_polynomials.iter();
        plain.chain(even.map(|degree| (*degree, Some(Reversor::Positions))))
    }

    /// What follows the lines of the reference over many maps.
    fn reference<'a>(&self, lines: &'a TracedLines) -> Result<SectionMap<'a>, Error> {
        match self.reference_planes {
            None => Ok(SectionMap::Coils(lines.section.map())),
            Some(planes) => Ok(SectionMap::Tabulated(planes.of(lines)?)),
        }
    }

    fn judge<'a>(
        &'a self,
        lines: &'a TracedLines,
        reference: &SectionMap<'_>,
        stopped: &dyn Fn() -> bool,
    ) -> Result<Judge<'a>, RunError> {
        let followed = |map: &SectionMap<'_>, initial: &[f64], maps: usize| {
            let states = map.followed(initial, maps, stopped)?.ok_or(RunError::Interrupted)?;
            Ok::<_, RunError>(Trajectories::new(states, 2, initial.len() / 2)?)
        };
        let (axis, reach) = (lines.section.axis(), lines.section.request().reach);
        // A line that is lost ends what is known.
        // no NaN: distances of places that lines were traced from
        let reach = lines.lost.iter().copied().fold(reach, f64::min);
        let along = |count: usize| -> Vec<f64> {
            let radius = |k: usize| reach * (k as f64 + 0.5) / count as f64;
            (0..count).flat_map(|k| [axis[0] + radius(k), axis[1]]).collect()
        };
        let initial = along(self.lines);
        let early = followed(&SectionMap::Coils(lines.section.map()), &initial, self.early)?;
        let near = lines.section.turns();
        let held_out = lines.held_out.as_ref().unwrap_or(&lines.training);
        let mut judge = Judge {
            axis,
            pairs: [held_out.input(), held_out.output()],
            initial,
            early,
            circles: Vec::new(),
            flux: Vec::new(),
            density: lines.chart.planes()[0].as_ref(),
            curves: 0.0,
            planes: f64::NAN,
            after: Vec::new(),
            profile: along(self.profile),
            maps: self.reference,
            near,
            rotation: Vec::new(),
            flux_of_profile: Vec::new(),
            counts: &self.counts,
            last: self.last,
        };
        let [input, output] = judge.pairs;
        if let SectionMap::Tabulated(planes) = reference {
            let image = planes.trajectories(input, 1)?;
            judge.planes = root_mean_square_distance(&image, output, 2);
        }
        let profile = followed(reference, &judge.profile, self.reference)?;
        judge.rotation = rotation_numbers(&profile, near, judge.angle());
        let flux_in =
            |circle: &Option<InvariantCircle>| circle.as_ref().and_then(|one| judge.flux_in(one));
        let flux_of_profile = judge.curves_of(&profile)?.iter().map(flux_in).collect();
        let orbits = followed(reference, &judge.initial, self.reference)?;
        let circles = judge.curves_of(&orbits)?;
        let flux = circles.iter().map(flux_in).collect();
        (judge.flux, judge.flux_of_profile) = (flux, flux_of_profile);
        judge.after = orbits.values()[2 * self.lines * self.reference..].to_vec();
        for (m, circle) in circles.iter().enumerate() {
            let Some(circle) = circle else { continue };
            let orbit: Vec<f64> = orbits.orbit(m).flatten().copied().collect();
            let unseen = &orbit[2 * (self.reference / 2)..];
            let off = circle.distances(unseen).into_iter().fold(0.0, max_or_nan);
            judge.curves = max_or_nan(judge.curves, off);
        }
        judge.circles = circles;
        Ok(judge)
    }

    /// The axis and the orbits of the lowest resonance in the field of the coils, and those of networks and
    /// polynomials. The reference leads to the orbits, and measures the width of the island.
    fn orbits_of(
        &self,
        lines: &TracedLines,
        judge: &Judge<'_>,
        maps: &[NamedMap<'_>],
        reference: &SectionMap<'_>,
    ) -> Result<Fixed, Error> {
        let coils = SectionMap::Coils(lines.section.map());
        let whole = Resonance { turns: 0, maps: 1 };
        let at_axis = |map: &SectionMap<'_>| {
            let found = judge.chain(map, whole, &[judge.axis.to_vec()]);
            found.map(|chain| chain.centre.or(chain.corner))
        };
        let found = Resonance::lowest(&judge.rotation, self.orbits);
        let found = found.and_then(|one| Some((one, judge.radius_of(one)?)));
        let mut of_reference = Chain::default();
        let mut guesses = Vec::new();
        if let Some((resonance, radius)) = found {
            guesses = judge.guesses(reference, resonance, radius)?;
            of_reference = judge.chain(reference, resonance, &guesses)?;
            // Derivatives through planes have some digits fewer than points: the field itself judges.
            let begin = |orbit: &OrbitFound| orbit.points[0].clone();
            let near: Vec<_> = [&of_reference.centre, &of_reference.corner]
                .into_iter()
                .flatten()
                .map(begin)
                .collect();
            if !near.is_empty() {
                of_reference = judge.chain(&coils, resonance, &near)?;
            }
        }
        let island = of_reference.centre.as_ref().and_then(|orbit| {
            Some((from_outermost(orbit, judge.axis), Judge::maps_of_island(orbit)?))
        });
        let width = |map: &SectionMap<'_>| match &island {
            Some((points, maps)) => judge.width(map, points, *maps),
            None => Ok(None),
        };
        of_reference.width = width(reference)?;
        // Found by one map, judged by another.
        let on_line = |map: &SectionMap<'_>, by: &SectionMap<'_>, chain: &Chain| match found {
            Some((resonance, radius)) if lines.is_mirrored => {
                let begins = judge.on_symmetry_line(map, resonance, radius)?;
                let again = match begins.is_empty() {
                    true => Chain::default(),
                    false => judge.chain(by, resonance, &begins)?,
                };
                Ok::<_, Error>(Some(OnSymmetryLine::of(begins.len(), &again, chain)))
            }
            _ => Ok(None),
        };
        let line_of_reference = on_line(reference, &coils, &of_reference)?;
        let mut all = Vec::new();
        for named in maps.iter().filter(|named| named.is_fast()) {
            let mut chain = Chain::default();
            if let Some((resonance, _)) = found
                && (of_reference.centre.is_some() || of_reference.corner.is_some())
            {
                chain = judge.chain(&named.map, resonance, &guesses)?;
                chain.width = width(&named.map)?;
            }
            let axis = at_axis(&named.map)?;
            let on_line = on_line(&named.map, &named.map, &chain)?;
            all.push(OrbitsOf { name: named.name.clone(), axis, chain, on_line });
        }
        let axis = at_axis(&coils)?;
        let resonance = found.map(|(resonance, _)| resonance);
        Ok(Fixed { resonance, axis, chain: of_reference, on_line: line_of_reference, found: all })
    }

    /// Networks and polynomials over as many maps as the reference, so that going in and out of a chart counts
    /// little; tracing, which takes long, over one map of held-out points.
    fn timed(
        &self,
        maps: &[NamedMap<'_>],
        judge: &Judge<'_>,
        [input, output]: [&[f64]; 2],
    ) -> Result<[Comparison; 2], Error> {
        /// A few rounds of seconds each.
        const SLOW_ROUNDS: usize = 3;
        let lines = || judge.initial.chunks_exact(2).zip(judge.after.chunks_exact(2));
        let kept = || lines().filter(|(_, after)| after[0].is_finite());
        let once: Vec<f64> = kept().flat_map(|(start, _)| start).copied().collect();
        let last: Vec<f64> = kept().flat_map(|(_, after)| after).copied().collect();
        let count = once.len() / 2;
        let copies = TrajectoryMethods::copies_of(count);
        let together = (2 * TrajectoryMethods::LEAST).min(input.len());
        let long = TimedLines { initial: once.repeat(copies), maps: self.reference };
        let short = TimedLines { initial: input[..together].to_vec(), maps: 1 };
        let (fast, slow): (Vec<_>, Vec<_>) = maps.iter().partition(|named| named.is_fast());
        let compare =
            |methods: &[&NamedMap<'_>], runs: &TimedLines, reference, lines, copies, rounds| {
                let all = TrajectoryMethods {
                    methods: methods.iter().map(|named| runs.method(named)).collect(),
                    reference,
                    reference_error: f64::NAN,
                    dim: 2,
                    trajectories: lines,
                    copies,
                    time: runs.maps as f64,
                };
                all.compare(rounds)
            };
        Ok([
            compare(&fast, &long, &last, count, copies, self.rounds)?,
            compare(
                &slow,
                &short,
                &output[..together],
                together / 2,
                1,
                if self.rounds < SLOW_ROUNDS { self.rounds } else { SLOW_ROUNDS },
            )?,
        ])
    }

    /// The last points of each line, of the reference and of networks after the most maps.
    fn portrait(
        &self,
        judge: &Judge<'_>,
        networks: &[NamedMap<'_>],
        reference: &SectionMap<'_>,
    ) -> Result<Figure, Error> {
        const POINTS: usize = 400;
        let row = judge.initial.len();
        let panel = |title: String, states: Vec<f64>| -> Result<Panel, Error> {
            let orbits = Trajectories::new(states, 2, self.lines)?;
            let series = (0..self.lines).map(|m| {
                let points = orbits.orbit(m).map(|z| (z[0], z[1])).collect();
                Series::unnamed(orbit_color(m), Style::Dots, points)
            });
            Ok(Panel {
                title,
                x_label: "R [m]".into(),
                y_label: "Z [m]".into(),
                square: true,
                series: series.collect(),
                ..Panel::default()
            })
        };
        let states = reference.rollout(&judge.initial, Rollout { steps: POINTS, every: 1 })?;
        let mut panels = vec![panel("reference".into(), states)?];
        let most = self.counts.last().copied().unwrap_or(1);
        for named in networks {
            let before = Rollout { steps: most, every: most };
            let here = named.map.rollout(&judge.initial, before)?.split_off(row);
            let states = named.map.rollout(&here, Rollout { steps: POINTS, every: 1 })?;
            panels.push(panel(format!("{}, after {most} maps", named.name), states)?);
        }
        let caption = "The section: points of each line, map after map.";
        let figure = Figure::in_a_row(POINCARE, caption, panels);
        Ok(Figure { columns: 2, same_axes: SameAxes::First, ..figure })
    }
}

/// Lines that are followed over so many maps, of which the last is kept.
struct TimedLines {
    initial: Vec<f64>,
    maps: usize,
}

impl TimedLines {
    /// Together, and the first alone.
    fn method<'b>(&'b self, named: &'b NamedMap<'_>) -> Method<'b> {
        let request = Rollout { steps: self.maps, every: self.maps };
        let from = move |initial: &[f64]| -> Result<Vec<f64>, Error> {
            Ok(named.map.rollout(initial, request)?.split_off(initial.len()))
        };
        let setting = named.setting.map(|setting| setting as f64);
        Method::new(&named.name, setting, move || from(&self.initial))
            .beside_alone(self.maps as f64, move || from(&self.initial[..2]))
    }
}

/// The points of an orbit from that which is nearest to the direction outwards along R.
fn from_outermost(orbit: &OrbitFound, axis: [f64; 2]) -> Vec<Vec<f64>> {
    let off = |k: &usize| {
        let point = &orbit.points[*k];
        libm::atan2(point[1] - axis[1], point[0] - axis[0]).abs()
    };
    let nearest = (0..orbit.points.len()).min_by(|a, b| off(a).total_cmp(&off(b)));
    let mut points = orbit.points.clone();
    points.rotate_left(nearest.unwrap_or(0));
    points
}

/// Seconds before the first map.
struct Paid {
    lines: f64,
    training: Vec<(String, f64)>,
}

impl Paid {
    fn of(&self, network: &str) -> f64 {
        let own = self.training.iter().find(|(name, _)| name == network);
        self.lines + own.map_or(0.0, |(_, seconds)| *seconds)
    }
}

struct Results<'a> {
    options: &'a PoincareOptions,
    lines: &'a TracedLines,
    judge: &'a Judge<'a>,
    found: &'a [Judged],
}

impl Results<'_> {
    fn words(&self) -> String {
        let PoincareOptions { lines: count, early, reference, profile, last, .. } = self.options;
        let request = self.lines.section.request();
        let smooth: Vec<&InvariantCircle> = self.judge.circles.iter().flatten().collect();
        let worst = self.judge.curves;
        let mut sure: Vec<f64> = self
            .judge
            .rotation
            .iter()
            .filter(|found| found.error <= SURE)
            .map(|found| found.turns.abs() * self.lines.maps_a_turn())
            .collect();
        sure.sort_by(f64::total_cmp);
        let agree = format!("two halves of a line agree to {SURE:.0e} turns a map");
        let profile = match sure[..] {
            [] => format!("On none of {profile} lines {agree}: no value of |ι| is certain."),
            [low, .., high] => format!(
                "|ι| is from {low:.6} to {high:.6} on {} of {profile} lines, on which {agree}; by these halves it is \
                 known to {}.",
                sure.len(),
                self.known()
            ),
            [alone] => format!("|ι| is {alone:.6} on one of {profile} lines, on which {agree}."),
        };
        let through = match self.options.reference_planes {
            None => String::new(),
            Some(planes) => {
                format!(
                    " (through {} planes of degree {}, which err by {:.1e} m a map on held-out lines)",
                    planes_of(steps_of(self.lines, planes.fewer)),
                    planes.degree,
                    self.judge.planes
                )
            }
        };
        // no NaN: a flux is finite
        let flux = match self.judge.flux.iter().flatten().copied().reduce(f64::max) {
            None => String::new(),
            Some(flux) => format!(
                " The toroidal flux within the widest of these curves is {flux:.6} Wb; flux off by: the largest \
                 difference of the flux within curves through the points of a method, as a share; not measured of \
                 tracing, and empty where a line of the method is on no smooth curve."
            ),
        };
        let lost = self.lines.lost_in_words().map_or_else(String::new, |lost| format!(" {lost}."));
        format!(
            "The section φ = {:.6}, a map over {} of {} field periods, lines to {} m from the axis.{lost} A map of the \
             reference, {} steps in the field of {} points of coils, errs by {:.1e} m. A map: root mean square and \
             largest distance on held-out lines. Early: root mean square over {early} maps of {count} lines. The \
             reference is followed over {reference} maps{through}: {} of these lines are on smooth curves, off which \
             their later points are by {worst:.1e} m, and from which the last {last} points before each number of \
             maps are measured. {profile}{flux} Lengths are in metres.",
            request.phi,
            self.lines.periods,
            self.lines.of_machine,
            request.reach,
            self.lines.section.map().steps(),
            self.lines.section.field().points(),
            self.lines.section.error(),
            smooth.len(),
        )
    }

    /// What the averages over both halves of a line of the reference differ by in |ι|, where they agree.
    fn known(&self) -> String {
        let errors = self.judge.rotation.iter().map(|found| found.error);
        let per_turn = self.lines.maps_a_turn();
        let mut errors: Vec<f64> =
            errors.filter(|error| *error <= SURE).map(|error| error * per_turn).collect();
        errors.sort_by(f64::total_cmp);
        match errors[..] {
            [] => String::new(),
            [.., largest] => {
                let median = errors[errors.len() / 2];
                format!("{median:.1e} in the median and {largest:.1e} at most")
            }
        }
    }

    fn table(&self) -> Table {
        let mut table = Table::new([
            ("method", Format::Exact),
            ("numbers", Format::Exact),
            ("a map [m]", Format::Exponent(1)),
            ("largest", Format::Exponent(1)),
            ("early", Format::Exponent(1)),
            ("|Δι|, median", Format::Exponent(1)),
            ("largest", Format::Exponent(1)),
            ("flux off by", Format::Exponent(1)),
        ]);
        let per_turn = self.lines.maps_a_turn();
        for of in self.found {
            let mut row: Vec<Cell> = vec![
                of.name.clone().into(),
                of.parameters.into(),
                of.one[0].into(),
                of.one[1].into(),
                finite(of.early).into(),
            ];
            row.extend(of.turns.map(|turns| finite(turns * per_turn).into()));
            row.push(of.flux.and_then(finite).into());
            table.push(row);
        }
        table
    }

    fn words_of_surfaces(&self) -> String {
        let slow = match self.found.iter().any(|of| of.is_tracing) {
            true => format!(
                " Lines are followed through planes over {MOST_MAPS_OF_PLANES} maps at most, and in the field of the \
                 coils not at all: that takes long."
            ),
            false => String::new(),
        };
        format!("The furthest of all lines from its curve.{slow}")
    }

    /// The largest distance from the surfaces, by the number of maps.
    fn off(&self) -> Table {
        let counts = self.options.counts.iter();
        let heading = |n: &usize| (format!("after {n} maps [m]"), Format::Exponent(1));
        let method = std::iter::once(("method".to_owned(), Format::Exact));
        let mut table = Table::new(method.chain(counts.clone().map(heading)));
        for of in self.found.iter().filter(|of| !of.off.is_empty()) {
            let off = counts.clone().map(|n| match of.off_at(*n) {
                Some(off) if off.is_nan() => Cell::Text("lost".into()),
                off => off.into(),
            });
            table.push(std::iter::once(of.name.clone().into()).chain(off));
        }
        table
    }

    fn words_of_times(&self, timed: &[Comparison; 2], paid: &Paid) -> String {
        let mut out = format!(
            "One thread; medians of repeated runs in turn, and in brackets their quartiles: with {} lines or more \
             together, and with one alone. Networks and polynomials over {} maps, of which the last is kept; \
             in the field of the coils and through planes one map. The {} maps of the lines of the data took \
             {:.1} s (all threads).",
            timed[0].together, self.options.reference, self.lines.maps, paid.lines
        );
        out.push_str(
            " The fastest tracing is that of no larger error a map, in the field of the coils or through planes. A \
             network pays for its data and training after so many maps of one line in place of it.",
        );
        out
    }

    /// The fastest of some methods that errs no more in a map.
    fn fastest<'b>(
        &self,
        timed: &'b [Comparison; 2],
        error: f64,
        wanted: impl Fn(&Judged) -> bool,
    ) -> Option<(&'b str, f64)> {
        let methods = timed.iter().flat_map(|comparison| &comparison.methods);
        let as_good = methods.filter_map(|one| {
            let judged = self.found.iter().find(|judged| judged.name == one.name)?;
            let good = wanted(judged) && judged.one[0] <= error;
            good.then(|| Some((&one.name[..], one.seconds?.median)))?
        });
        as_good.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn times(&self, timed: &[Comparison; 2], paid: &Paid) -> Table {
        const MICRO: f64 = 1e6;
        let mut table = Table::new([
            ("method", Format::Exact),
            ("µs a map", Format::Magnitude),
            ("one alone", Format::Magnitude),
            ("in the field as long", Format::Factor),
            ("through planes", Format::Factor),
            ("pays after maps", Format::Exponent(1)),
            ("than planes", Format::Exponent(1)),
        ]);
        for method in timed.iter().flat_map(|comparison| &comparison.methods) {
            let Some(judged) = self.found.iter().find(|one| one.name == method.name) else {
                continue;
            };
            let own =
                method.seconds.map(|spread| spread.median).filter(|_| judged.parameters.is_some());
            let (network, error) = (judged.setting.is_none(), judged.one[0]);
            let coils = self.fastest(timed, error, |one| one.parameters.is_none());
            let planes =
                self.fastest(timed, error, |one| one.is_tracing && one.parameters.is_some());
            let factor = |rival: Option<(&str, f64)>| Some(rival?.1 / own?);
            let pays = |rival: Option<(&str, f64)>| {
                let (own, (_, seconds)) = (own.filter(|_| network)?, rival?);
                break_even(paid.of(&method.name), own, seconds)
            };
            table.push([
                method.name.clone().into(),
                method.seconds.map(|spread| spread.scaled(MICRO)).into(),
                method.alone.map(|spread| spread.scaled(MICRO)).into(),
                factor(coils).into(),
                factor(planes.filter(|_| !judged.is_tracing)).into(),
                pays(coils).into(),
                pays(planes).into(),
            ]);
        }
        table
    }
}

/// How many planes so many steps need.
fn planes_of(steps: usize) -> usize {
    /// Different nodes of a step but its end.
    const NODES: usize = 11;
    NODES * steps + 1
}
