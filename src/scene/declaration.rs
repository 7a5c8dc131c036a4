//! What a scene file holds.

use crate::error::Error;
use crate::flow::{Integrator, Window};
use crate::layer::CircleAction;
use crate::measure::CertificateOptions;
use crate::network::{Architecture, GyroceptronShape, HenonShape, InitialWeights};
use crate::system::{Hamiltonian, System};
use crate::train::TrainingOptions;
use serde::{Deserialize, Serialize};

/// A declared experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Its name: the default folder of a run.
    pub name: String,
    /// One line that says what it shows.
    #[serde(default)]
    pub title: String,
    /// The seed of all its random streams.
    #[serde(default)]
    pub seed: u64,
    /// The system whose flow map is learnt.
    pub system: Option<System>,
    /// The time of the flow map.
    pub flow_time: Option<f64>,
    /// Where the training pairs are.
    pub data: Option<Data>,
    /// The networks to train.
    #[serde(default)]
    pub models: Vec<ModelSpec>,
    /// How to train them.
    #[serde(default)]
    pub training: TrainingOptions,
    /// The structure certificate, if wanted.
    pub certificate: Option<CertificateOptions>,
    /// The roll-out against the reference, if wanted.
    pub rollout: Option<RolloutSpec>,
    /// Error against run time, of the networks and of integrators, if wanted.
    pub work_precision: Option<WorkPrecisionSpec>,
    /// Error against run time of tanh and sech², if wanted.
    pub tanh: Option<TanhSpec>,
    /// The plots to draw.
    #[serde(default)]
    pub plots: Vec<Plot>,
    /// Scenes that this one consists of, in place of a system of its own: each is
    /// run in a folder of its name, and one report sums them up.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<Scene>,
}

/// The training and held-out pairs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Data {
    /// Boxes with their numbers of training points.
    pub windows: Vec<Window>,
    /// Held-out points, as a share of each window's training points.
    pub validation: f64,
}

/// A network to train.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelSpec {
    /// Its name in tables and files.
    pub name: String,
    /// Which network.
    pub network: NetworkSpec,
    /// How its weights are drawn.
    pub weights: InitialWeights,
}

/// Which network, the degrees of freedom and ε being the system's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum NetworkSpec {
    /// A symplectic gyroceptron.
    Gyroceptron {
        /// ψ.
        psi: Layers,
        /// I_ε.
        near_identity: Layers,
        /// Φ; the system's, unless given.
        circle_action: Option<CircleAction>,
    },
    /// A HénonNet.
    HenonNet {
        /// Its layers.
        layers: Layers,
    },
}

/// So many layers of the same width.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layers {
    /// The number of layers.
    pub count: usize,
    /// The neurons of each.
    pub width: usize,
}

impl Layers {
    fn widths(self) -> Vec<usize> {
        vec![self.width; self.count]
    }
}

/// More layers are a slip of the pen.
const MOST_LAYERS: usize = 100_000;
/// The same for samples, steps kept and the like.
const MOST: usize = 100_000_000;

impl NetworkSpec {
    fn layers(&self) -> Vec<Layers> {
        match self {
            Self::Gyroceptron { psi, near_identity, .. } => vec![*psi, *near_identity],
            Self::HenonNet { layers } => vec![*layers],
        }
    }

    /// The architecture for this circle action and ε.
    pub fn architecture(&self, action: &CircleAction, epsilon: f64) -> Architecture {
        match self {
            Self::Gyroceptron { psi, near_identity, circle_action } => Architecture::Gyroceptron {
                shape: GyroceptronShape {
                    circle_action: circle_action.as_ref().unwrap_or(action).clone(),
                    psi: psi.widths(),
                    near_identity: near_identity.widths(),
                },
                epsilon,
            },
            Self::HenonNet { layers } => Architecture::HenonNet {
                shape: HenonShape { dof: action.dof(), widths: layers.widths() },
                epsilon: 1.0,
            },
        }
    }
}

/// Trajectories of the networks beside the reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RolloutSpec {
    /// Applications of the map.
    pub steps: usize,
    /// One state in so many is kept.
    pub every: usize,
    /// The initial points, 2n numbers each.
    pub initial: Vec<Vec<f64>>,
}

/// Error against run time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorkPrecisionSpec {
    /// One step is judged at so many held-out pairs (training pairs, where none
    /// are held out), evenly spaced.
    pub points: usize,
    /// How often each time is taken.
    pub rounds: usize,
    /// What the networks are compared with.
    #[serde(default)]
    pub integrators: Vec<IntegratorSteps>,
    /// The steps h of the central differences that the networks' Jacobians are
    /// compared with; without any, no Jacobian is computed.
    #[serde(default)]
    pub differences: Vec<f64>,
}

/// An integrator with the numbers of steps it is tried with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IntegratorSteps {
    /// Which.
    pub integrator: Integrator,
    /// Steps in the flow time.
    #[serde(default)]
    pub one_step: Vec<usize>,
    /// Steps between two states that the roll-out keeps.
    #[serde(default)]
    pub rollout: Vec<usize>,
}

/// Error against run time of tanh and sech².
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TanhSpec {
    /// The number of values.
    pub values: usize,
    /// They are uniform in |x| ≤ this.
    pub largest: f64,
    /// How often each time is taken.
    pub rounds: usize,
}

/// What can be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Plot {
    /// Loss and held-out error against iterations and against seconds.
    Loss,
    /// The slow plane of the roll-out beside the reference, with the level
    /// sets of the averaged Hamiltonian where they are known.
    Portrait,
    /// μ₀ along the roll-out.
    AdiabaticInvariant,
    /// The distance from the reference along the roll-out.
    RolloutError,
    /// The error of one step and of the roll-out against run time.
    ErrorAgainstTime,
    /// The error of Jacobians against run time.
    Jacobians,
    /// The error of tanh and sech² against run time.
    Tanh,
}

impl Plot {
    /// All plots.
    pub const ALL: [Self; 7] = [
        Self::Loss,
        Self::Portrait,
        Self::AdiabaticInvariant,
        Self::RolloutError,
        Self::ErrorAgainstTime,
        Self::Jacobians,
        Self::Tanh,
    ];

    /// The file it is written to.
    pub fn file(self) -> &'static str {
        match self {
            Self::Loss => "loss.svg",
            Self::Portrait => "portrait.svg",
            Self::AdiabaticInvariant => "adiabatic-invariant.svg",
            Self::RolloutError => "rollout-error.svg",
            Self::ErrorAgainstTime => "error-against-time.svg",
            Self::Jacobians => "jacobians.svg",
            Self::Tanh => "tanh.svg",
        }
    }
}

/// Reads a scene. `place` names the file in errors.
///
/// # Errors
/// When it is no TOML, a key is unknown (with the nearest known one), a value
/// is missing or out of range.
pub fn parse(place: &str, text: &str) -> Result<Scene, Error> {
    let scene: Scene = toml::from_str(text).map_err(|error| {
        let line = error.span().map(|span| text[..span.start].matches('\n').count() + 1);
        unknown_key(place, text, error.message()).unwrap_or_else(|| {
            let place = line.map_or(place.to_owned(), |line| format!("{place}:{line}"));
            Error::content(place, "a scene", error.message().replace('\n', " "))
        })
    })?;
    // Variants without fields let any key pass: what does not come back when
    // the scene is written again was not understood.
    let written = toml::Value::try_from(&scene).ok();
    let given = toml::from_str::<toml::Value>(text).ok();
    if let (Some(written), Some(given)) = (written, given)
        && let Some((key, known)) = stray_key(&given, &written)
    {
        return Err(unknown(place, text, &key, known.iter().map(String::as_str)));
    }
    scene.check(place)?;
    Ok(scene)
}

/// The first key that `given` has and `written` lacks, with its known
/// neighbours.
fn stray_key(given: &toml::Value, written: &toml::Value) -> Option<(String, Vec<String>)> {
    match (given, written) {
        (toml::Value::Table(given), toml::Value::Table(written)) => {
            given.iter().find_map(|(key, value)| match written.get(key) {
                Some(other) => stray_key(value, other),
                None => Some((key.clone(), written.keys().cloned().collect())),
            })
        }
        (toml::Value::Array(given), toml::Value::Array(written)) => {
            given.iter().zip(written).find_map(|(a, b)| stray_key(a, b))
        }
        _ => None,
    }
}

/// [`Error::UnknownKey`] with the line where the key stands and the nearest of
/// the known ones, if one is near.
fn unknown<'a>(place: &str, text: &str, key: &str, known: impl Iterator<Item = &'a str>) -> Error {
    const NEAR: f64 = 0.7;
    let line = text.lines().position(|line| {
        line.match_indices(key).any(|(at, _)| {
            let before = line[..at].chars().next_back();
            let after = line[at + key.len()..].trim_start();
            before.is_none_or(|c| !(c.is_alphanumeric() || c == '_' || c == '-'))
                && (after.starts_with('=') || after.starts_with(']') || after.starts_with('.'))
        })
    });
    let nearest = known
        .map(|name| (strsim::jaro_winkler(key, name), name))
        .filter(|(likeness, _)| *likeness >= NEAR)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name.to_owned());
    let place = line.map_or(place.to_owned(), |line| format!("{place}:{}", line + 1));
    Error::UnknownKey { place, key: key.to_owned(), nearest }
}

/// Reads "unknown field `key`, expected one of `a`, `b`" back into an error
/// that names the nearest key.
fn unknown_key(place: &str, text: &str, message: &str) -> Option<Error> {
    let rest = message.strip_prefix("unknown field `")?;
    let (key, expected) = rest.split_once('`')?;
    Some(unknown(place, text, key, expected.split('`').skip(1).step_by(2)))
}

/// Beyond it sech² is taken for 0 or is less than what numbers can hold.
const LARGEST_TANH: f64 = 350.0;
/// Rounds beyond this are a slip of the pen.
const MOST_ROUNDS: usize = 10_000;

/// Fails unless a count is between 1 and `most`.
fn count(name: &str, value: usize, most: usize) -> Result<(), Error> {
    if value == 0 || value > most {
        return Err(Error::invalid(name, value, format!("1 to {most}")));
    }
    Ok(())
}

impl WorkPrecisionSpec {
    fn check(&self, rolls_out: bool) -> Result<(), Error> {
        count("points", self.points, MOST)?;
        count("rounds", self.rounds, MOST_ROUNDS)?;
        for entry in &self.integrators {
            entry.integrator.check()?;
            for &steps in entry.one_step.iter().chain(&entry.rollout) {
                count("integrators.steps", steps, MOST)?;
            }
            if !entry.rollout.is_empty() && !rolls_out {
                let name = entry.integrator.name();
                return Err(Error::invalid("integrators.rollout", name, "a scene with a roll-out"));
            }
        }
        match self.differences.iter().find(|h| !(**h > 0.0 && h.is_finite())) {
            Some(bad) => Err(Error::invalid("differences", bad, "positive numbers")),
            None => Ok(()),
        }
    }
}

impl Scene {
    /// Fails unless what is named is complete and in range.
    fn check(&self, place: &str) -> Result<(), Error> {
        let fail = |key: &str, expected: &str, found: &dyn std::fmt::Display| {
            Err(Error::content(format!("{place}: {key}"), expected, found))
        };
        let sane = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        for name in std::iter::once(&self.name).chain(self.models.iter().map(|m| &m.name)) {
            if name.is_empty() || !name.chars().all(sane) {
                return fail("name", "letters, digits, - and _", &format!("`{name}`"));
            }
        }
        let named = |key: &str, error: Error| {
            Error::content(format!("{place}: {key}"), "a valid value", error)
        };
        if i64::try_from(self.seed).is_err() {
            return fail("seed", &format!("at most {}", i64::MAX), &self.seed);
        }
        if let Some(system) = &self.system {
            system.check().map_err(|e| named("system", e))?;
            let action = system.circle_action();
            for model in &self.models {
                let architecture = model.network.architecture(&action, system.epsilon());
                let key = format!("models.{}", model.name);
                architecture.check().map_err(|e| named(&key, e))?;
                if architecture.dof() != system.dof() {
                    let key = format!("{key}.circle_action");
                    return fail(&key, &format!("{} weights", system.dof()), &architecture.dof());
                }
            }
            for (index, window) in self.data.iter().flat_map(|d| d.windows.iter().enumerate()) {
                window
                    .check(&format!("data.windows[{index}]"), system.dof())
                    .map_err(|e| named("data", e))?;
            }
            self.training
                .loss
                .component_weights(system.dof())
                .map_err(|e| named("training.loss", e))?;
        }
        for plot in &self.plots {
            let possible = match plot {
                Plot::Loss => !self.models.is_empty(),
                Plot::Portrait => {
                    self.rollout.is_some() && matches!(self.system, Some(System::Oscillators(_)))
                }
                Plot::AdiabaticInvariant | Plot::RolloutError => self.rollout.is_some(),
                Plot::ErrorAgainstTime => self.work_precision.is_some(),
                Plot::Jacobians => {
                    self.work_precision.as_ref().is_some_and(|w| !w.differences.is_empty())
                        && !self.models.is_empty()
                }
                Plot::Tanh => self.tanh.is_some(),
            };
            if !possible {
                let expected = "plots of what the scene computes (a portrait is of a roll-out \
                                of the oscillators, Jacobians are compared with differences)";
                return fail("plots", expected, &format!("{plot:?}"));
            }
        }
        if let Some(time) = self.flow_time
            && !(time.is_finite() && time > 0.0)
        {
            return fail("flow_time", "a positive number", &time);
        }
        for (index, model) in self.models.iter().enumerate() {
            for layers in model.network.layers() {
                if layers.count > MOST_LAYERS || layers.count == 0 {
                    let expected = format!("1 to {MOST_LAYERS} layers");
                    return fail("models.network", &expected, &layers.count);
                }
            }
            if self.models[..index].iter().any(|other| other.name == model.name) {
                return fail("models", "a name for each", &format!("`{}` twice", model.name));
            }
        }
        self.training.check().map_err(|e| named("training", e))?;
        if let Some(data) = &self.data {
            if !(0.0..=1.0).contains(&data.validation) {
                return fail("data.validation", "a share between 0 and 1", &data.validation);
            }
            if let Some(window) = data.windows.iter().find(|w| w.samples > MOST) {
                return fail("data.windows.samples", &format!("at most {MOST}"), &window.samples);
            }
            if data.windows.iter().all(|w| w.samples == 0) {
                return fail("data.windows", "at least one sample", &"none");
            }
        }
        if let Some(certificate) = &self.certificate {
            certificate.check().map_err(|e| Error::content(place, "a valid certificate", e))?;
        }
        if let Some(rollout) = &self.rollout {
            for (key, value) in [("rollout.steps", rollout.steps), ("rollout.every", rollout.every)]
            {
                if value == 0 {
                    return fail(key, "at least 1", &0);
                }
            }
            if rollout.initial.is_empty() {
                return fail("rollout.initial", "at least one point", &"none");
            }
            if let Some(system) = &self.system {
                for point in &rollout.initial {
                    if point.len() != 2 * system.dof() || point.iter().any(|v| !v.is_finite()) {
                        return fail(
                            "rollout.initial",
                            &format!("points of {} finite numbers", 2 * system.dof()),
                            &format!("{point:?}"),
                        );
                    }
                }
            }
        }
        if let Some(spec) = &self.work_precision {
            spec.check(self.rollout.is_some()).map_err(|e| named("work_precision", e))?;
            if let Some(rollout) = &self.rollout
                && rollout.every > rollout.steps
            {
                let expected = format!("at most {} steps, for a state to compare", rollout.steps);
                return fail("rollout.every", &expected, &rollout.every);
            }
        }
        if let Some(tanh) = &self.tanh {
            count("tanh.values", tanh.values, MOST).map_err(|e| named("tanh", e))?;
            count("tanh.rounds", tanh.rounds, MOST_ROUNDS).map_err(|e| named("tanh", e))?;
            if !(tanh.largest > 0.0 && tanh.largest <= LARGEST_TANH) {
                let expected = format!("a positive number of at most {LARGEST_TANH}");
                return fail("tanh.largest", &expected, &tanh.largest);
            }
        }
        if !self.parts.is_empty() && self.names_experiment() {
            return fail("parts", "either parts or a system of its own", &"both");
        }
        for (index, part) in self.parts.iter().enumerate() {
            if !part.parts.is_empty() {
                return fail("parts", "parts without parts", &part.name);
            }
            part.check(&format!("{place}: parts.{}", part.name))?;
            if self.parts[..index].iter().any(|other| other.name == part.name) {
                return fail("parts", "a name for each", &format!("`{}` twice", part.name));
            }
        }
        Ok(())
    }

    /// Fails unless the scene, and each of its parts, names all that a run needs.
    ///
    /// # Errors
    /// As [`Scene::experiment`].
    pub fn complete(&self) -> Result<(), Error> {
        for part in &self.parts {
            part.complete()?;
        }
        if self.is_experiment() { self.experiment().map(|_| ()) } else { Ok(()) }
    }

    /// Whether it is to learn a flow map, rather than to hold parts or to measure
    /// tanh alone.
    pub(super) fn is_experiment(&self) -> bool {
        self.parts.is_empty() && (self.tanh.is_none() || self.names_experiment())
    }

    fn names_experiment(&self) -> bool {
        self.system.is_some()
            || self.flow_time.is_some()
            || self.data.is_some()
            || !self.models.is_empty()
            || self.training != TrainingOptions::default()
            || self.rollout.is_some()
            || self.work_precision.is_some()
            || self.certificate.is_some()
    }

    /// The same scene with another seed, in all its parts.
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self.parts = self.parts.into_iter().map(|part| part.with_seed(seed)).collect();
        self
    }

    /// The system, flow time and data that a run needs.
    ///
    /// # Errors
    /// [`Error::Content`] naming what is missing.
    pub fn experiment(&self) -> Result<(&System, f64, &Data), Error> {
        let missing = |key: &str| {
            Error::content(format!("scene {}: {key}", self.name), "a value, to run it", "none")
        };
        Ok((
            self.system.as_ref().ok_or_else(|| missing("system"))?,
            self.flow_time.ok_or_else(|| missing("flow_time"))?,
            self.data.as_ref().ok_or_else(|| missing("data"))?,
        ))
    }
}
