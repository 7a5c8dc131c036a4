//! Models and checkpoints as JSON.

use super::legacy::Named;
use super::{read_bytes, write_atomically};
use crate::digest;
use crate::error::Error;
use crate::flow::{Condition, OutsidePolynomials, PolynomialExit, Region, lose_rest};
use crate::measure::orbits::{dynamic_aperture, maps_survived};
use crate::network::{
    Architecture, Course, Invariant, Model, Pace, Rollout, map_jacobians, map_points,
};
use crate::phase::{Direction, Section, Units};
use crate::train::{Checkpoint, Fitted, Problem};
use rayon::prelude::*;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The newest model format that this version reads. From format 3 on an architecture is a list of blocks, and the
/// digest covers it; in formats 1 and 2 (with units) it has a name, and the digest covers parameters and units alone.
/// Format 4 adds a section, which the digest covers too, and format 5 an architecture with controls. A model without
/// controls is written in format 4 if it has a section, else in format 3.
pub const MODEL_VERSION: u64 = 5;
/// The format of a model with a section.
const SECTION_VERSION: u64 = 4;
/// The format of a model without a section, and the first whose architecture is a list of blocks.
const BLOCKS_VERSION: u64 = 3;
/// The newest checkpoint format that this version reads, and the one it writes.
const CHECKPOINT_VERSION: u64 = 1;

/// Where the parameters of a model come from: the training or the import that made them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Provenance {
    /// The scene it was trained by, or `import`.
    pub scene: String,
    /// The seed of the weights; of `train` and of polynomials, that of the held-out choice.
    pub seed: Option<u64>,
    /// SHA-256 of the training pairs, or of the imported file.
    pub data: Option<String>,
    /// SHA-256 of what decides its weights, [`Problem::training_digest`]; None where its training did not end by itself,
    /// but could go on with more iterations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub training: Option<String>,
    /// The time of the flow map that it stands for.
    pub flow_time: Option<f64>,
    /// The held-out mean squared error, in the network's units; with the weights of the loss where
    /// it is [by plane](crate::train::Loss::ByPlane).
    pub validation: Option<f64>,
    /// The box around its pairs, training and held out, in the coordinates of the data. Outside of it the model has not
    /// been tested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub region: Option<Region>,
    /// The values of ε and flow times of its pairs. At others the model has not been tested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub learnt: Option<Learnt>,
    /// The version of this crate.
    pub crate_version: String,
}

/// The ranges of ε and flow time that the pairs of a model cover.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Learnt {
    /// The least and the largest ε.
    pub epsilons: [f64; 2],
    /// The least and the largest flow time, where it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow_times: Option<[f64; 2]>,
}

impl Learnt {
    /// Those of a problem.
    fn of(problem: &Problem) -> Self {
        let conditions = problem.pairs.conditions();
        let range = |own: f64, of: &dyn Fn(&Condition) -> f64| {
            let start = conditions.first().map_or(own, of);
            let ends = |[low, high]: [f64; 2], v: f64| [low.min(v), high.max(v)];
            conditions.iter().map(of).fold([start; 2], ends)
        };
        let flow_times = problem.flow_time.map(|own| range(own, &|of| of.time * own));
        Self { epsilons: range(problem.architecture.epsilon, &|of| of.epsilon), flow_times }
    }
}

impl Provenance {
    /// The provenance of a model of this scene, with the version of this crate.
    pub fn of_scene(scene: &str) -> Self {
        Self {
            scene: scene.to_owned(),
            crate_version: env!("CARGO_PKG_VERSION").to_owned(),
            ..Self::default()
        }
    }
}

/// Trajectories in units of the data.
#[derive(Clone, Debug, PartialEq)]
pub struct RolledOut {
    /// The states kept, (T, M, 2n).
    pub states: Vec<f64>,
    /// Whether the last states, made on a grid, lead back exactly: whether each state, rounded to `f64` in these units,
    /// is still closest to the grid point that it stands for. False without a grid.
    pub is_exact: bool,
}

/// A model with its units and provenance, as a file holds it.
#[derive(Clone, Debug)]
pub struct StoredModel {
    /// The network, in its own units.
    pub model: Model,
    /// The units of the data, if they differ from those of the network.
    pub units: Option<Units>,
    /// The charts of the data, if its columns are x₁ … xₙ, y₁ … yₙ, which are not canonical. The units are then those
    /// of the canonical coordinates.
    pub section: Option<Section>,
    /// What the network was trained on, and by which version.
    pub provenance: Provenance,
}

impl StoredModel {
    /// The digest of the file that it is written to: of architecture, weights, units and charts.
    ///
    /// # Errors
    /// When a number is not finite, which JSON cannot hold.
    pub fn digest(&self) -> Result<String, Error> {
        let (architecture, parameters) = (self.model.architecture(), self.model.parameters());
        digest_of(architecture, parameters, self.units.as_ref(), self.section.as_ref())
    }

    /// The model that a fit has made, with its units and provenance; `name` says what trained it.
    pub fn of_fit(fitted: &Fitted, name: &str) -> Self {
        let Fitted { problem, training } = fitted;
        let provenance = Provenance {
            seed: Some(problem.seed),
            data: Some(problem.digest.clone()),
            training: training.outcome.stop.is_final().then(|| problem.training_digest()),
            flow_time: problem.flow_time,
            validation: training.outcome.best.validation,
            region: problem.region.clone(),
            learnt: Some(Learnt::of(problem)).filter(|_| problem.architecture.has_circle()),
            ..Provenance::of_scene(name)
        };
        let (units, section) = (problem.units.clone(), problem.section.clone());
        Self { model: fitted.model().clone(), units, section, provenance }
    }

    /// Whether it was made by the training of this problem, or by one that differs in when it was to stop, and that
    /// training ended by itself.
    pub fn is_of(&self, problem: &Problem) -> bool {
        self.provenance.training == Some(problem.training_digest())
            && *self.model.architecture() == problem.architecture
            && (&self.units, &self.section) == (&problem.units, &problem.section)
    }

    /// [`Model::with_epsilon_and_time`], in the same units; its held-out error is not known.
    ///
    /// # Errors
    /// Those of [`Model::with_epsilon_and_time`].
    pub fn with_epsilon_and_time(&self, epsilon: f64, time: f64) -> Result<Self, Error> {
        let mut out =
            Self { model: self.model.with_epsilon_and_time(epsilon, time)?, ..self.clone() };
        out.provenance.flow_time = self.provenance.flow_time.map(|own| time * own);
        // Of the map that it was.
        out.provenance.validation = None;
        Ok(out)
    }

    /// The model at another ε and flow time, where they are given.
    ///
    /// # Errors
    /// [`Error::Invalid`] when the network is built on no circle, or a flow time is asked for and
    /// is not positive, or that of the model is not known; those of [`Model::with_epsilon_and_time`].
    pub fn member(self, epsilon: Option<f64>, flow_time: Option<f64>) -> Result<Self, Error> {
        let architecture = self.model.architecture();
        if epsilon.is_none() && flow_time.is_none() {
            return Ok(self);
        }
        for (name, value) in [("epsilon", epsilon), ("flow_time", flow_time)] {
            if let (Some(value), false) = (value, architecture.has_circle()) {
                return Err(Error::invalid(name, value, "none: it is of gyroceptrons only"));
            }
        }
        let time = match (flow_time, self.provenance.flow_time) {
            (None, _) => 1.0,
            (Some(time), Some(own)) if time > 0.0 && time.is_finite() => time / own,
            (Some(time), Some(_)) => {
                return Err(Error::invalid("flow_time", time, "a positive number"));
            }
            (Some(time), None) => {
                let expected = "a model whose training was given a flow time";
                return Err(Error::invalid("flow_time", time, expected));
            }
        };
        let epsilon = epsilon.unwrap_or(architecture.epsilon);
        self.with_epsilon_and_time(epsilon, time)
    }

    /// Says in words that ε or the flow time is outside of those of the pairs; None where it is not, or they are not
    /// known.
    pub fn beyond_learnt(&self) -> Option<String> {
        let learnt = self.provenance.learnt.as_ref()?;
        let time = self.provenance.flow_time.zip(learnt.flow_times);
        let all = [
            Some(("ε", self.model.architecture().epsilon, learnt.epsilons)),
            time.map(|(time, range)| ("flow time", time, range)),
        ];
        let is_outside = |(_, value, [low, high]): &(&str, f64, [f64; 2])| {
            // Flow times are products.
            let rounding = 4.0 * f64::EPSILON * value.abs();
            !(*value >= low - rounding && *value <= high + rounding)
        };
        // Without the rounding of products.
        let short = |v: f64| format!("{v:.12e}").parse::<f64>().unwrap_or(v).to_string();
        let words = all.into_iter().flatten().filter(is_outside).map(|(name, value, ends)| {
            let [low, high] = ends.map(short);
            let learnt = if low == high { low } else { format!("{low} to {high}") };
            format!("{name} = {} is outside of what the model has learnt, {learnt}", short(value))
        });
        words.reduce(|all, one| format!("{all}; {one}"))
    }

    /// [`Model::rollout`] from points in the coordinates of the data.
    ///
    /// # Errors
    /// Those of [`Model::rollout`]; [`Error::Diverged`] when a state is not of finite numbers.
    pub fn rollout(&self, initial: &[f64], request: Rollout) -> Result<Vec<f64>, Error> {
        self.rollout_at_pace(initial, request, &mut Pace::unbroken())
    }

    /// [`StoredModel::rollout`] in parts, between which `pace` decides whether to go on. The bits are the same.
    ///
    /// # Errors
    /// Those of [`StoredModel::rollout`]; [`Error::Stopped`].
    pub fn rollout_at_pace(
        &self,
        initial: &[f64],
        request: Rollout,
        pace: &mut Pace<'_>,
    ) -> Result<Vec<f64>, Error> {
        Ok(self.rollout_along(Course::default(), initial, request, pace)?.states)
    }

    /// [`Model::rollout_along`] from points in the coordinates of the data. A grid is one of the network's coordinates:
    /// the first state kept is then the grid point next to the initial one.
    ///
    /// # Errors
    /// Those of [`Model::rollout_along`]; [`Error::Diverged`] when a state is not of finite numbers.
    pub fn rollout_along(
        &self,
        course: Course,
        initial: &[f64],
        request: Rollout,
        pace: &mut Pace<'_>,
    ) -> Result<RolledOut, Error> {
        let rolled = self.rolled_out(course, initial, request, pace)?;
        let (dim, has_section) = (2 * self.model.composition().dof(), self.section.is_some());
        refuse_divergence(&rolled.states, initial.len(), dim, request.every, has_section)?;
        Ok(rolled)
    }

    /// [`StoredModel::rollout_along`] of orbits that may leave the box of a section, or that polynomials may send to
    /// infinity from outside of theirs: the state that is kept there and all later ones are NaN. Without either, or on a
    /// grid, it is the same.
    ///
    /// # Errors
    /// Those of [`StoredModel::rollout_along`], but for orbits that are lost in this way.
    pub fn rollout_until_lost(
        &self,
        course: Course,
        initial: &[f64],
        request: Rollout,
        pace: &mut Pace<'_>,
    ) -> Result<RolledOut, Error> {
        if self.section.is_none() && !self.model.architecture().has_polynomials() {
            return self.rollout_along(course, initial, request, pace);
        }
        let mut rolled = self.rolled_out(course, initial, request, pace)?;
        lose_rest(&mut rolled.states, initial.len(), 2 * self.model.composition().dof());
        Ok(rolled)
    }

    fn rolled_out(
        &self,
        course: Course,
        initial: &[f64],
        request: Rollout,
        pace: &mut Pace<'_>,
    ) -> Result<RolledOut, Error> {
        self.check_points("initial points", initial)?;
        let mut states = initial.to_vec();
        self.to_network(&mut states);
        let place = |e: Error| match (&e, self.has_own_coordinates()) {
            (Error::Invalid { .. }, false) => e.with_place("in the network's units"),
            _ => e,
        };
        states = self.model.rollout_along(course, &states, request, pace).map_err(place)?;
        let on_grid = states.split_off(states.len() - initial.len());
        states.extend_from_slice(&on_grid);
        self.to_data(&mut states);
        let is_exact = course.grid.is_some_and(|grid| {
            let mut back = states[states.len() - initial.len()..].to_vec();
            self.to_network(&mut back);
            let places = |of: &[f64]| grid.quantise(of).ok();
            // Beyond this not every place is an f64 itself.
            let most = grid.spacing() * (1_u64 << 53) as f64;
            on_grid.iter().all(|value| value.abs() < most) && places(&on_grid) == places(&back)
        });
        if course.grid.is_none() {
            states[..initial.len()].copy_from_slice(initial);
        }
        Ok(RolledOut { states, is_exact })
    }

    /// The number of maps after which each orbit from these points of the data is outside of a region for the first
    /// time, as in [`maps_survived`]. None for orbits that stay in the region for all `maps`.
    ///
    /// # Errors
    /// Those of [`StoredModel::rollout`], but for orbits that are lost; when the region is of another dimension.
    pub fn maps_survived(
        &self,
        points: &[f64],
        maps: usize,
        within: &Region,
    ) -> Result<Vec<Option<usize>>, Error> {
        let dim = 2 * self.model.composition().dof();
        Error::check_count("coordinates of the region", dim, within.low.len())?;
        self.check_points("points", points)?;
        let follow = |here: &[f64], maps: usize| self.followed(here, maps);
        let stays = |z: &[f64]| within.first_outside(z).is_none();
        maps_survived(&follow, points, dim, maps, &stays)
    }

    /// The dynamic aperture along rays from a point of the data, as in [`dynamic_aperture`]: for each direction, the
    /// largest of the radii up to which all points centre + radius·direction stay in a region for `maps` maps.
    ///
    /// # Errors
    /// Those of [`StoredModel::maps_survived`] and of [`dynamic_aperture`].
    pub fn dynamic_aperture(
        &self,
        centre: &[f64],
        directions: &[Vec<f64>],
        radii: &[f64],
        maps: usize,
        within: &Region,
    ) -> Result<Vec<f64>, Error> {
        let dim = 2 * self.model.composition().dof();
        Error::check_count("coordinates of the region", dim, within.low.len())?;
        Error::check_count("coordinates of the centre", dim, centre.len())?;
        self.check_points("centre", centre)?;
        let follow = |here: &[f64], maps: usize| self.followed(here, maps);
        let stays = |z: &[f64]| within.first_outside(z).is_none();
        dynamic_aperture(&follow, centre, directions, radii, maps, &stays)
    }

    /// The states of orbits from points of the data after 1, …, `maps` maps, whatever becomes of them.
    pub(crate) fn followed(&self, here: &[f64], maps: usize) -> Result<Vec<f64>, Error> {
        self.followed_at_pace(here, maps, &mut Pace::unbroken())
    }

    /// The orbits of [`StoredModel::followed`], asking the pace from time to time whether to continue.
    ///
    /// # Errors
    /// Those of [`StoredModel::followed`], and that of the pace where it says to stop.
    #[doc(hidden)]
    pub fn followed_at_pace(
        &self,
        here: &[f64],
        maps: usize,
        pace: &mut Pace<'_>,
    ) -> Result<Vec<f64>, Error> {
        let mut start = here.to_vec();
        self.to_network(&mut start);
        let request = Rollout { steps: maps, every: 1 };
        let mut states = self.model.rollout_at_pace(&start, request, pace)?;
        self.to_data(&mut states);
        Ok(states.split_off(here.len()))
    }

    /// Where trajectories leave the box of the network's polynomials. `values` is (T, M, 2n), with M = `points`
    /// trajectories and one state in `every` kept. None if no state is outside, or if the network has no polynomials.
    pub fn leaves_polynomials(
        &self,
        values: &[f64],
        points: usize,
        every: usize,
    ) -> Option<PolynomialExit> {
        if !self.model.architecture().has_polynomials() {
            return None;
        }
        let outside = |z: &[f64]| {
            if z.iter().any(|v| v.is_nan()) {
                return None;
            }
            let mut z = z.to_vec();
            self.to_network(&mut z);
            let first = || OutsidePolynomials { reach: self.model.reach(&z) };
            (!self.model.is_in_box(&z)).then(first)
        };
        let dim = 2 * self.model.composition().dof();
        let outside: Vec<_> = values.par_chunks_exact(dim).map(outside).collect();
        PolynomialExit::first_of(outside, points, every)
    }

    /// Applies P or P⁻¹ to points of the data, in place.
    ///
    /// # Errors
    /// Those of [`map_points`].
    pub fn map_points(&self, direction: Direction, points: &mut [f64]) -> Result<(), Error> {
        self.check_points("points", points)?;
        self.to_network(points);
        map_points(self.model.composition(), direction, points)?;
        self.to_data(points);
        Ok(())
    }

    /// ∂P/∂z at points of the data: 2n × 2n numbers each, row by row.
    ///
    /// # Errors
    /// Those of [`map_jacobians`].
    pub fn jacobians(&self, points: &[f64]) -> Result<Vec<f64>, Error> {
        let map = self.model.composition();
        let dim = 2 * map.dof();
        self.check_points("points", points)?;
        let mut there = points.to_vec();
        self.to_network(&mut there);
        let mut out = self.jacobians_in_chart(&there)?;
        if let Some(section) = &self.section {
            map_points(map, Direction::Forward, &mut there)?;
            self.to_data(&mut there);
            let both = points.chunks_exact(dim).zip(there.chunks_exact(dim));
            for (jacobian, (from, to)) in out.chunks_exact_mut(dim * dim).zip(both) {
                section.jacobian_of_data(jacobian, from, to);
            }
        }
        Ok(out)
    }

    /// ∂P/∂z in the canonical coordinates of the data at points of the network.
    pub(super) fn jacobians_in_chart(&self, there: &[f64]) -> Result<Vec<f64>, Error> {
        let map = self.model.composition();
        let dim = 2 * map.dof();
        let mut out = vec![0.0; there.len() * dim];
        map_jacobians(map, there, &mut out)?;
        if let Some(units) = &self.units {
            let factors = units.factors();
            for (index, entry) in out.iter_mut().enumerate() {
                *entry = *entry * factors[index / dim % dim] / factors[index % dim];
            }
        }
        Ok(out)
    }

    /// [`Model::invariant`] at points of the data, in units of their actions.
    pub fn invariant(&self) -> Option<Invariant<'_>> {
        let own = self.model.invariant()?;
        if self.has_own_coordinates() {
            return Some(own);
        }
        let area = self.units.as_ref().map_or(1.0, Units::area);
        Some(Box::new(move |z| {
            let mut point = z.to_vec();
            self.to_network(&mut point);
            area * own(&point)
        }))
    }

    /// Fails at a point outside of the section.
    pub(crate) fn check_points(&self, place: &str, points: &[f64]) -> Result<(), Error> {
        self.section.as_ref().map_or(Ok(()), |section| section.check_points(place, points))
    }

    /// Whether the data is in the coordinates of the network.
    fn has_own_coordinates(&self) -> bool {
        self.units.is_none() && self.section.is_none()
    }

    /// Points from the coordinates of the data to those of the network: NaN outside of a section.
    pub(crate) fn to_network(&self, points: &mut [f64]) {
        self.section.iter().for_each(|section| section.to_canonical(points));
        self.units.iter().for_each(|units| units.to_network(points));
    }

    /// Points from the coordinates of the network to those of the data: NaN outside of a section.
    pub(super) fn to_data(&self, points: &mut [f64]) {
        self.units.iter().for_each(|units| units.to_data(points));
        self.section.iter().for_each(|section| section.to_data(points));
    }
}

/// A model file, whose architecture is a list of blocks or, in earlier formats, a named one.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ModelFile<A = Architecture> {
    format: String,
    version: u64,
    architecture: A,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    units: Option<Units>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    section: Option<Section>,
    provenance: Provenance,
    /// SHA-256 of the architecture, the bits of the parameters and of the units, and of the section, if there is
    /// one: a flipped digit is another model.
    digest: String,
    parameters: Vec<f64>,
}

/// See `digest` of a model file.
fn digest_of(
    architecture: &Architecture,
    parameters: &[f64],
    units: Option<&Units>,
    section: Option<&Section>,
) -> Result<String, Error> {
    let mut text = serde_json::to_string(architecture)
        .map_err(|reason| Error::invalid("architecture", reason, "numbers that JSON can hold"))?;
    if let Some(section) = section {
        text += &serde_json::to_string(section)
            .map_err(|reason| Error::invalid("section", reason, "numbers that JSON can hold"))?;
    }
    let numbers = digest_of_numbers(parameters, units);
    Ok(digest::of_bytes(format!("{text}\n{numbers}").as_bytes()))
}

/// The `digest` of earlier formats.
fn digest_of_numbers(parameters: &[f64], units: Option<&Units>) -> String {
    let of_units = units.iter().flat_map(|units| units.centre().iter().chain(units.factors()));
    digest::of_numbers(parameters.iter().chain(of_units))
}

impl ModelFile<Named> {
    /// The same with its list of blocks.
    fn into_blocks(self) -> ModelFile {
        let Self { format, version, architecture, units, section, provenance, digest, parameters } =
            self;
        let architecture = architecture.into();
        ModelFile { format, version, architecture, units, section, provenance, digest, parameters }
    }
}

const MODEL_FORMAT: &str = "gyroceptron-model";
const CHECKPOINT_FORMAT: &str = "gyroceptron-checkpoint";

/// Reads a document of this format, checking its name and version before
/// anything else, so that a newer one is called newer and not corrupt.
fn parse_document<T: DeserializeOwned>(
    place: &str,
    bytes: &[u8],
    format: &str,
    supported: u64,
) -> Result<T, Error> {
    let (_, value) = parse_header(place, bytes, format, supported)?;
    parse_content(place, value, format)
}

/// Fails at the first state that is not of finite numbers: `row` of them are kept for each time.
pub(super) fn refuse_divergence(
    states: &[f64],
    row: usize,
    dim: usize,
    every: usize,
    has_section: bool,
) -> Result<(), Error> {
    let Some(index) = states.iter().position(|v| !v.is_finite()) else { return Ok(()) };
    let what = if has_section { "roll-out, or left the box of its section" } else { "roll-out" };
    Err(Error::Diverged {
        what: what.into(),
        place: format!(
            "row {} of the input, at the latest after {} steps",
            index % row / dim,
            index / row * every
        ),
    })
}

/// What a file says that it is, if it is JSON and says it.
pub(super) fn format_of(bytes: &[u8]) -> Option<String> {
    #[derive(Deserialize)]
    struct Header {
        format: String,
    }
    serde_json::from_slice::<Header>(bytes).ok().map(|header| header.format)
}

/// A document and its version.
pub(super) fn parse_header(
    place: &str,
    bytes: &[u8],
    format: &str,
    supported: u64,
) -> Result<(u64, serde_json::Value), Error> {
    let expected = format!("a {format} file");
    let value: serde_json::Value = serde_json::from_slice(bytes)
        .map_err(|reason| Error::content(place, &expected, format!("corrupt JSON: {reason}")))?;
    match value.get("format").and_then(|v| v.as_str()) {
        Some(found) if found == format => {}
        Some(found) => return Err(Error::content(place, &expected, format!("a {found} file"))),
        None => return Err(Error::content(place, &expected, "no key `format`")),
    }
    let version = value
        .get("version")
        .and_then(serde_json::Value::as_u64)
        .ok_or_else(|| Error::content(place, "a version number", "none"))?;
    if version > supported {
        return Err(Error::NewerFormat { path: place.into(), found: version, supported });
    }
    Ok((version, value))
}

pub(super) fn parse_content<T: DeserializeOwned>(
    place: &str,
    value: serde_json::Value,
    format: &str,
) -> Result<T, Error> {
    let expected = format!("a {format} file");
    serde_json::from_value(value).map_err(|reason| Error::content(place, &expected, reason))
}

/// The text of a model file. Numbers are the shortest decimals that read back
/// as the same bits.
///
/// # Errors
/// When a number is not finite, which JSON cannot hold.
pub fn model_text(stored: &StoredModel) -> Result<String, Error> {
    let (architecture, parameters) = (stored.model.architecture(), stored.model.parameters());
    let file = ModelFile {
        format: MODEL_FORMAT.into(),
        version: match (&architecture.controls, &stored.section) {
            (Some(_), _) => MODEL_VERSION,
            (None, Some(_)) => SECTION_VERSION,
            (None, None) => BLOCKS_VERSION,
        },
        architecture: architecture.clone(),
        units: stored.units.clone(),
        section: stored.section.clone(),
        provenance: stored.provenance.clone(),
        digest: digest_of(
            architecture,
            parameters,
            stored.units.as_ref(),
            stored.section.as_ref(),
        )?,
        parameters: parameters.to_vec(),
    };
    let text = serde_json::to_string_pretty(&file)
        .map_err(|reason| Error::invalid("model", reason, "numbers that JSON can hold"))?;
    Ok(text + "\n")
}

/// Writes a model file, [`model_text`].
///
/// # Errors
/// [`Error::Write`], or as [`model_text`].
pub fn save_model(path: &Path, stored: &StoredModel) -> Result<(), Error> {
    let text = model_text(stored)?;
    write_atomically(path, |out| out.write_all(text.as_bytes()))
}

/// Reads a model file.
///
/// # Errors
/// When it is missing, corrupt, of a newer format, or does not hold a model.
pub fn load_model(path: &Path) -> Result<StoredModel, Error> {
    parse_model(&path.display().to_string(), &read_bytes(path)?)
}

/// Reads the text of a model file; `place` names it in errors.
///
/// # Errors
/// Those of [`load_model`].
pub fn parse_model(place: &str, bytes: &[u8]) -> Result<StoredModel, Error> {
    let (version, value) = parse_header(place, bytes, MODEL_FORMAT, MODEL_VERSION)?;
    let of_names = version < BLOCKS_VERSION;
    let file = match of_names {
        false => parse_content(place, value, MODEL_FORMAT)?,
        true => parse_content::<ModelFile<Named>>(place, value, MODEL_FORMAT)?.into_blocks(),
    };
    file.architecture.check().map_err(|e| Error::content(place, "a valid model", e))?;
    let expected = file.architecture.parameter_count();
    if file.parameters.len() != expected {
        return Err(Error::content(
            format!("{place}: parameters"),
            format!("{expected} numbers, {}", file.architecture.count_of_each()),
            file.parameters.len(),
        ));
    }
    let digest = match of_names {
        true => digest_of_numbers(&file.parameters, file.units.as_ref()),
        false => digest_of(
            &file.architecture,
            &file.parameters,
            file.units.as_ref(),
            file.section.as_ref(),
        )?,
    };
    if digest != file.digest {
        let covers = match of_names {
            true => "the parameters and the units",
            false => "the architecture, the units and the parameters",
        };
        return Err(Error::Edited { place: place.into(), covers });
    }
    let model = Model::new(file.architecture, file.parameters)
        .map_err(|e| Error::content(place, "a valid model", e))?;
    if let Some(region) = &file.provenance.region {
        region.check(&format!("{place}: region"), model.composition().dof())?;
    }
    if let Some(units) = &file.units {
        units.check(&format!("{place}: units"), model.composition().dof())?;
    }
    let nominal = model.composition().controls().map(|controls| controls.nominal());
    let of_network = |section: Section| {
        section.of_network(model.composition().dof(), &nominal.unwrap_or_default())
    };
    let section = file.section.map(of_network).transpose().map_err(|e| e.with_place(place))?;
    let units = file.units;
    Ok(StoredModel { model, units, section, provenance: file.provenance })
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CheckpointFile {
    format: String,
    version: u64,
    crate_version: String,
    /// SHA-256 of `state`: a flipped digit is not a different run.
    digest: String,
    state: String,
}

/// Writes a checkpoint.
///
/// # Errors
/// [`Error::Write`].
pub fn save_checkpoint(path: &Path, checkpoint: &Checkpoint) -> Result<(), Error> {
    let state = serde_json::to_string(checkpoint).map_err(|e| Error::write(path, e))?;
    let file = CheckpointFile {
        format: CHECKPOINT_FORMAT.into(),
        version: CHECKPOINT_VERSION,
        crate_version: env!("CARGO_PKG_VERSION").into(),
        digest: digest::of_bytes(state.as_bytes()),
        state,
    };
    write_atomically(path, |out| Ok(serde_json::to_writer(out, &file)?))
}

/// The checkpoint from which a resumed training goes on, if there is one. For a new training, the checkpoint that an
/// earlier one left is removed: otherwise a training that ends before it writes its own would seem to go on from that
/// one.
///
/// # Errors
/// Those of [`load_checkpoint`]; [`Error::Write`] when it cannot be removed.
pub fn earlier_checkpoint(path: &Path, resume: bool) -> Result<Option<Checkpoint>, Error> {
    match (path.exists(), resume) {
        (false, _) => Ok(None),
        (true, true) => load_checkpoint(path).map(Some),
        (true, false) => {
            std::fs::remove_file(path).map_err(|reason| Error::write(path, reason))?;
            Ok(None)
        }
    }
}

/// Reads a checkpoint.
///
/// # Errors
/// When it is missing, corrupt, or of another version of the crate, which may
/// take another path.
pub fn load_checkpoint(path: &Path) -> Result<Checkpoint, Error> {
    let place = &path.display().to_string();
    let bytes = read_bytes(path)?;
    let file: CheckpointFile =
        parse_document(place, &bytes, CHECKPOINT_FORMAT, CHECKPOINT_VERSION)?;
    if file.crate_version != env!("CARGO_PKG_VERSION") {
        return Err(Error::content(
            place,
            format!("a checkpoint of gyroceptron {}", env!("CARGO_PKG_VERSION")),
            format!("one of {}", file.crate_version),
        ));
    }
    if digest::of_bytes(file.state.as_bytes()) != file.digest {
        return Err(Error::Edited { place: place.into(), covers: "the state of the training" });
    }
    // By way of a value, as all that is read here: types are compiled for one reader.
    let state = serde_json::from_str::<serde_json::Value>(&file.state);
    let checkpoint: Checkpoint = state
        .and_then(serde_json::from_value)
        .map_err(|reason| Error::content(place, "the state of a run", reason))?;
    Ok(checkpoint.from_file(place.as_str()))
}
