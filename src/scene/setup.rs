//! What a scene sets up: system, flow time, data, networks, training.

use crate::error::Error;
use crate::flow::{Integrator, Pairs, ReferenceTrajectories, Window, whole_periods};
use crate::io::{PairsFile, read_pairs};
use crate::layer::{CircleAction, TorusAction};
use crate::network::{InitialWeights, NetworkSpec};
use crate::scene::line_data::LineData;
use crate::scene::target_flow::{FileData, FoundAction, TargetFlow};
use crate::system::{Counted, Hamiltonian, System};
use crate::train::{Fit, RampStage, TrainingOptions};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// What the studies of a scene share.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Setup {
    /// The system whose flow map is learnt.
    pub system: Option<System>,
    /// The time of the flow map; 1 for pairs of a file unless it is given.
    pub flow_time: Option<f64>,
    /// Where the training pairs are.
    pub data: Option<Data>,
    /// The networks that are trained on the data.
    pub models: Vec<ModelSpec>,
    /// The training options of all networks that have none of their own.
    pub training: TrainingOptions,
}

/// The training and held-out pairs: from points in windows, which the system moves, or from a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Data {
    /// Boxes, each with its number of training points, or of orbits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub windows: Vec<Window>,
    /// The number of held-out points, or orbits, as a share of each window's training points; for a file, as a share of
    /// its pairs. A tenth unless given.
    #[serde(default = "held_out")]
    pub validation: f64,
    /// The number of pairs along the orbit of each point: the scene's flow map is applied this many times, and each
    /// pair begins where the one before ends. Unless given it is 1: pairs of independent points.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub orbit: usize,
    /// A file of pairs in place of windows and a system, as `gyroceptron train` takes them. A
    /// relative path is from the folder of the scene's file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pairs: Option<PathBuf>,
    /// Field lines of coils in place of windows and a system.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lines: Option<LineData>,
    /// An `.npy` file of (T, M, 2n) numbers, the trajectories that others are compared with: T states of M initial
    /// points, as far apart in time as the states that the roll-out keeps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trajectories: Option<PathBuf>,
    /// An `.npz` file of the section whose coordinates pairs and trajectories are in, as `gyroceptron train --section`
    /// takes it, where these are not canonical.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub section: Option<PathBuf>,
    /// Φ of the pairs of a file, or several circles. Unless given, or given as `"auto"`, it is found from them as
    /// `gyroceptron train` finds it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub circle_action: Option<PairsAction>,
    /// ε of the pairs of a file: 0.01 unless given. Where the file has the ε of each pair, that of the networks,
    /// which has to be given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epsilon: Option<f64>,
    /// The integrator that moves the points, and makes the trajectories that others are compared with. Unless given, it
    /// is the reference flow, which takes long over long times.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow: Option<FlowBy>,
    /// The values of ε of the flow maps that the pairs are of; unless given, the system's alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub epsilons: Vec<f64>,
    /// The flow times of these maps; unless given, the scene's alone. A network learns all maps at once, as functions
    /// of ε and the flow time. The points of the windows are shared out among the maps.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub flow_times: Vec<f64>,
    /// Whether the error of each of these maps counts in units of ε times its flow time
    /// ([`Pairs::relative`](crate::flow::Pairs::relative)), so that maps near their rotation are learnt as well as
    /// others.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub relative: bool,
    /// Φ of the pairs of a file, where it was found from them.
    #[serde(skip)]
    pub(super) found: Option<FoundAction>,
    /// Whether the flow time of the pairs of a file is given, and not 1 by default.
    #[serde(skip)]
    pub(super) is_time_given: bool,
}

/// The circle action of pairs, as a scene declares it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "weights such as [1, 0], several such lists, or \"auto\"")]
pub enum PairsAction {
    /// One circle, which all planes that turn share.
    Circle(CircleAction),
    /// Several circles, each with an angle of its own.
    Torus(TorusAction),
    /// The action that a search of short trainings finds in the pairs.
    Auto(AutoWord),
}

/// The word that asks for what the pairs show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum AutoWord {
    /// The word `"auto"` in place of weights.
    #[serde(rename = "auto")]
    Auto,
}

/// An integrator in place of the reference flow. Its error is estimated with twice as many steps or, for an averaged
/// equation, with stroboscopic averaging of sixth order. Reports do not count its evaluations of the equations of
/// motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlowBy {
    /// The integrator that moves the points.
    pub integrator: Integrator,
    /// The largest time of a step.
    pub step: f64,
}

impl FlowBy {
    /// Its steps in a time.
    pub(super) fn steps(self, time: f64) -> Result<usize, Error> {
        let steps = (time / self.step).ceil();
        let place =
            |error: Error| error.with_place(format!("data.flow.step {} in {time}", self.step));
        Error::check_range("steps", steps, 1.0, MOST as f64).map_err(place)?;
        Ok(steps as usize)
    }

    /// The pairs of a time, with their error.
    pub(super) fn pairs(
        declared: Option<Self>,
        system: &Counted<'_, System>,
        points: Vec<f64>,
        time: f64,
    ) -> Result<(Pairs, f64), Error> {
        let Some(flow) = declared else { return Pairs::of_flow(system, points, time) };
        Pairs::of_integrator(system.inner(), points, time, flow.integrator, flow.steps(time)?)
    }

    /// Trajectories of so many states, an interval apart.
    pub(super) fn trajectories(
        declared: Option<Self>,
        system: &Counted<'_, System>,
        initial: &[f64],
        interval: f64,
        states: usize,
    ) -> Result<ReferenceTrajectories, Error> {
        let Some(flow) = declared else {
            return ReferenceTrajectories::of_flow(system, initial, interval, states);
        };
        let (system, steps) = (system.inner(), flow.steps(interval)?);
        let by = flow.integrator;
        ReferenceTrajectories::of_integrator(system, initial, interval, states, by, steps)
    }
}

/// A network of a scene, with its initial weights and its training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelSpec {
    /// Its name in tables and files.
    pub name: String,
    /// The kind and the sizes of the network.
    pub network: NetworkSpec,
    /// How its weights are drawn: after Glorot, unless given. Weights of a file are not drawn.
    #[serde(default = "glorot")]
    pub weights: InitialWeights,
    /// How it is trained, if not like the others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training: Option<TrainingOptions>,
    /// Whether it is here only to compare its training; other studies leave it out.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub training_only: bool,
    /// The number of initial weights from which it is trained, one after another; other studies take the first. It is 1
    /// unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seeds: Option<u64>,
}

/// A training: of a network, and from which of its initial weights.
#[derive(Clone, Debug)]
pub(super) struct SeededTraining {
    /// The network, by the name of its files.
    pub(super) spec: ModelSpec,
    /// The name that the scene gives it.
    pub(super) network: String,
    /// What is added to the scene's seed for its weights.
    pub(super) number: u64,
}

/// A training of a network that a study has beside those of the set-up.
#[derive(Clone, Debug)]
pub(super) struct StudyTraining {
    pub(super) training: SeededTraining,
    /// The flow time of its map.
    pub(super) flow_time: f64,
    /// The training, by the name of its files, whose weights it begins with.
    pub(super) from: Option<String>,
    /// What is done to its pairs, in words; nothing, where they are those of the flow map.
    pub(super) fault: String,
}

impl ModelSpec {
    /// The initial weights of a network for a user's own pairs.
    pub const OWN_WEIGHTS: InitialWeights = InitialWeights::Normal { scale: 0.15 };

    /// One for each of its seeds.
    pub(super) fn trainings(&self) -> impl Iterator<Item = SeededTraining> + '_ {
        (0..self.seeds.unwrap_or(1)).map(|number| {
            let mut spec = self.clone();
            if number > 0 {
                spec.name = format!("{}-seed-{}", self.name, number + 1);
                spec.training_only = true;
            }
            SeededTraining { spec, network: self.name.clone(), number }
        })
    }
}

/// More seeds are a mistake.
const MOST_SEEDS: u64 = 1000;
/// More samples, steps and the like are one too.
pub(super) const MOST: usize = 100_000_000;

/// Fails unless a name is of letters, digits, - and _: it becomes that of a file.
pub(super) fn check_name(name: &str) -> Result<(), Error> {
    let sane = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if name.is_empty() || !name.chars().all(sane) {
        return Err(Error::invalid("name", format!("`{name}`"), "letters, digits, - and _"));
    }
    Ok(())
}

/// Fails unless points are of 2n finite numbers at which the system is defined, and there is one.
pub(super) fn check_points(
    name: &str,
    points: &[Vec<f64>],
    system: &impl Hamiltonian,
) -> Result<(), Error> {
    let dof = system.dof();
    let expected = format!("points of {} finite numbers", 2 * dof);
    if points.is_empty() {
        return Err(Error::invalid(name, "none", expected));
    }
    let sound = |point: &&Vec<f64>| point.len() == 2 * dof && point.iter().all(|v| v.is_finite());
    match points.iter().find(|point| !sound(point)) {
        Some(bad) => Err(Error::invalid(name, format!("{bad:?}"), expected)),
        None => {
            points.iter().try_for_each(|z| system.check_point(z).map_err(|e| e.with_place(name)))
        }
    }
}

/// What a study may need of the set-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// The system whose flow map is learnt.
    System,
    /// A system or pairs of a file.
    TargetFlow,
    /// The flow time of the map.
    FlowTime,
    /// The training and held-out data.
    Data,
    /// At least one network that is not there for its training only.
    Models,
}

impl Need {
    /// Its key in a scene file.
    pub fn key(self) -> &'static str {
        match self {
            Self::System | Self::TargetFlow => "system",
            Self::FlowTime => "flow_time",
            Self::Data => "data",
            Self::Models => "models",
        }
    }
}

impl Setup {
    /// Fails unless a flow time is of whole periods of the system, so that repeating its map is the
    /// flow.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the time.
    pub(super) fn check_repeated(&self, time: f64) -> Result<(), Error> {
        match self.system.as_ref().and_then(System::period) {
            Some(period) => whole_periods(time, period).map_err(|e| e.with_place("flow_time")),
            None => Ok(()),
        }
    }

    /// Fails where the equations of motion change with time: the flow of a fraction of a period is none
    /// that can be repeated.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the system.
    pub(super) fn check_autonomous(&self) -> Result<(), Error> {
        match &self.system {
            Some(system) if system.period().is_some() => {
                let expected = "one whose equations of motion are the same at all times";
                Err(Error::invalid("system", system.kind(), expected))
            }
            _ => Ok(()),
        }
    }

    /// Whether a need is met.
    pub fn has(&self, need: Need) -> bool {
        match need {
            Need::System => self.system.is_some(),
            Need::TargetFlow => self.target().is_some() || self.is_of_file(),
            Need::FlowTime => self.flow_time.is_some(),
            Need::Data => self.data.is_some(),
            Need::Models => self.models.iter().any(|model| !model.training_only),
        }
    }

    /// The pairs of its file: of one map, or of several with the ε or the flow time of each.
    ///
    /// # Errors
    /// Those of [`read_pairs`]; when they depend on controls, which networks of a scene have for field lines only, or
    /// are of several maps while the ε or the flow time of the networks is not given, or a network is of one map.
    pub(super) fn read_pairs(&self) -> Result<PairsFile, Error> {
        let (data, key) = (self.data.as_ref(), "data.pairs");
        let path = data.and_then(|data| data.pairs.as_deref());
        let missing = || Error::Missing { place: "scene".into(), key, needed_by: "a study".into() };
        let (data, path) = data.zip(path).ok_or_else(missing)?;
        let (file, place) = (read_pairs(path)?, path.display());
        if file.controls > 0 {
            let expected = "no controls: networks of a scene have those of field lines only";
            let found = format!("{} of each pair", file.controls);
            return Err(Error::content(format!("{place}: lambda"), expected, found));
        }
        let open = [
            ("data.epsilon", "epsilon", file.has_epsilons && data.epsilon.is_none()),
            ("flow_time", "flow_time", file.has_times && !data.is_time_given),
        ];
        if let Some((key, array, _)) = open.into_iter().find(|(.., is_open)| *is_open) {
            let expected = format!("that of the networks: {place} has an array `{array}`");
            return Err(Error::invalid(key, "none", expected));
        }
        let of_one =
            |model: &&ModelSpec| !model.network.is_of_file() && !model.network.has_circle();
        if let Some(model) = self.models.iter().find(of_one)
            && (file.has_epsilons || file.has_times)
        {
            let found = format!("epsilon or flow_time in {place}");
            let key = format!("models.{}", model.name);
            return Err(Error::invalid(&key, found, "a gyroceptron to learn a family"));
        }
        Ok(file)
    }

    /// The stages of a ramp that lead up to the map of an ε and a flow time: none, where weights of an earlier flow
    /// time are there to begin with. Where the pairs are of a file no stage is left out.
    pub(super) fn leading_up(
        &self,
        options: &TrainingOptions,
        epsilon: f64,
        time: f64,
        has_weights: bool,
    ) -> Vec<RampStage> {
        let leads_up = |stage: &&RampStage| {
            let other_epsilon = stage.epsilon.is_some_and(|stage| stage != epsilon);
            let is_before = |stage: f64| stage < time || stage == time && other_epsilon;
            self.is_of_file() || stage.flow_time.is_none_or(is_before)
        };
        match has_weights {
            true => Vec::new(),
            false => options.ramp.iter().filter(leads_up).copied().collect(),
        }
    }

    /// Whether its pairs are of a file.
    pub(super) fn is_of_file(&self) -> bool {
        self.data.as_ref().is_some_and(|data| data.pairs.is_some())
    }

    /// What the networks stand for; None for pairs of a file until their circle action is known.
    pub(super) fn target(&self) -> Option<TargetFlow<'_>> {
        let data = self.data.as_ref();
        let file = || data.and_then(Data::file).map(TargetFlow::File);
        let lines = || data.and_then(|data| data.lines.as_ref()).map(TargetFlow::Lines);
        self.system.as_ref().map(TargetFlow::System).or_else(file).or_else(lines)
    }

    /// All trainings of the set-up: each network from each of its sets of initial weights.
    pub(super) fn trainings(&self) -> impl Iterator<Item = SeededTraining> + '_ {
        self.models.iter().flat_map(ModelSpec::trainings)
    }

    /// How a network is trained.
    pub fn training_of<'a>(&'a self, model: &'a ModelSpec) -> &'a TrainingOptions {
        model.training.as_ref().unwrap_or(&self.training)
    }

    /// Fails unless what is named is in range and fits together.
    ///
    /// # Errors
    /// With the key and the value.
    pub(super) fn check(&self) -> Result<(), Error> {
        if let Some(time) = self.flow_time
            && !(time.is_finite() && time > 0.0)
        {
            return Err(Error::invalid("flow_time", time, "a positive number"));
        }
        for model in &self.models {
            check_name(&model.name).map_err(|e| e.with_place("models"))?;
            let place = || format!("models.{}.network", model.name);
            model.network.check().map_err(|e| e.with_place(place()))?;
            let lines = self.data.as_ref().and_then(|data| data.lines.as_ref());
            if let (Some(lines), Some(reversor)) = (lines, model.network.reversor) {
                lines.check_reversor(reversor).map_err(|e| e.with_place(place()))?;
            }
            if let Some(seeds) = model.seeds {
                let most = MOST_SEEDS as usize;
                let found = usize::try_from(seeds).unwrap_or(usize::MAX);
                Error::check_count_range("seeds", found, 1, most)
                    .map_err(|e| e.with_place(format!("models.{}", model.name)))?;
            }
            if model.network.is_of_file() && (model.seeds.is_some() || model.training.is_some()) {
                let expected = "neither seeds nor training for a network of a file";
                return Err(Error::invalid("models", &model.name, expected));
            }
        }
        self.training.check()?;
        for model in &self.models {
            let place = format!("models.{}", model.name);
            self.training_of(model).check().map_err(|e| e.with_place(place))?;
        }
        if let Some(data) = &self.data {
            data.check()?;
            if let (Some(flow), Some(time)) = (data.flow, self.flow_time) {
                flow.steps(time)?;
            }
            if let (true, Some(time)) = (data.orbit > 1, self.flow_time) {
                self.check_repeated(time).map_err(|e| e.with_place("data.orbit"))?;
            }
        }
        if let Some(system) = &self.system {
            system.check()?;
            if let Some(data) = &self.data {
                system.check_with(&data.epsilons).map_err(|e| e.with_place("data.epsilons"))?;
            }
            if let Some(flow) = self.data.as_ref().and_then(|data| data.flow) {
                flow.integrator.check_for(system).map_err(|e| e.with_place("data.flow"))?;
            }
        }
        if let Some(target) = self.target() {
            self.check_against(target)?;
        }
        let of_file = self.data.as_ref().is_some_and(Data::is_without_system);
        let of_lines = self.data.as_ref().is_some_and(|data| data.lines.is_some());
        let foreign = |model: &&ModelSpec| model.network.is_of_file();
        if let (true, Some(model)) = (of_file, self.models.iter().find(foreign)) {
            let expected = "networks to train, beside pairs of a file or of field lines";
            return Err(Error::invalid("models", &model.name, expected));
        }
        let mut trainings = self.models.iter().map(|model| self.training_of(model));
        if of_file && self.system.is_some() {
            return Err(Error::invalid(
                if of_lines { "data.lines" } else { "data.pairs" },
                "a system",
                "no system beside pairs of a file or field lines of coils",
            ));
        }
        if let (true, Some(training)) = (
            of_lines,
            trainings.find(|t| t.ramp.iter().any(|s| s.flow_time.is_some() || s.epsilon.is_some())),
        ) {
            let expected = "no ramp of flow times or ε: field lines are of one";
            return Err(Error::invalid("training.ramp", training.ramp.len(), expected));
        }
        Ok(())
    }

    /// Fails unless networks, data and loss are of the degrees of freedom of the target.
    fn check_against(&self, target: TargetFlow<'_>) -> Result<(), Error> {
        let action = target.circle_action();
        for model in &self.models {
            let key = format!("models.{}", model.name);
            let (epsilon, time) = (target.epsilon(), self.flow_time.unwrap_or(1.0));
            if model.network.is_of_file() {
                continue;
            }
            let architecture = model.network.architecture(&target.torus(), epsilon, time);
            let architecture = architecture.map_err(|e| e.with_place(&key))?;
            architecture.check().map_err(|e| e.with_place(&key))?;
            self.training_of(model).check_for(&architecture).map_err(|e| e.with_place(&key))?;
            if architecture.dof != target.dof() {
                let (found, expected) = (architecture.dof, format!("{} weights", target.dof()));
                return Err(Error::invalid("circle_action", found, expected).with_place(key));
            }
        }
        for model in &self.models {
            let Some(own) = model.network.action.clone() else { continue };
            if !target.is_turned_by(&own) {
                let found = format!("{:?}", own.circles());
                let expected = format!("circles that turn the planes as {action:?} does together");
                let key = format!("models.{}", model.name);
                return Err(Error::invalid("action", found, expected).with_place(key));
            }
        }
        for (index, window) in self.data.iter().flat_map(|d| d.windows.iter().enumerate()) {
            window.check(&format!("data.windows[{index}]"), target.dof())?;
        }
        for training in self.models.iter().map(|m| self.training_of(m)).chain([&self.training]) {
            training.loss.check(target.dof()).map_err(|e| e.with_place("training.loss"))?;
        }
        Ok(())
    }
}

fn glorot() -> InitialWeights {
    InitialWeights::Glorot
}

fn held_out() -> f64 {
    Fit::HELD_OUT
}

fn one() -> usize {
    1
}

fn is_one(count: &usize) -> bool {
    *count == 1
}

impl Data {
    /// How many pairs begin in these windows.
    fn pairs_of(&self, windows: &[Window]) -> usize {
        let each = |window: &Window| window.samples.saturating_mul(self.orbit);
        windows.iter().map(each).fold(0, usize::saturating_add)
    }

    /// The windows of the held-out points.
    pub(super) fn held_out_windows(&self) -> Vec<Window> {
        let of = |window: &Window| Window {
            samples: (window.samples as f64 * self.validation).round() as usize,
            ..window.clone()
        };
        self.windows.iter().map(of).collect()
    }

    /// Whether the pairs are of several maps.
    pub(super) fn is_family(&self) -> bool {
        !(self.epsilons.is_empty() && self.flow_times.is_empty())
    }

    /// Whether no system gives the pairs.
    fn is_without_system(&self) -> bool {
        self.pairs.is_some() || self.lines.is_some()
    }

    /// The files, where pairs are of one and their circle action is known.
    pub(super) fn file(&self) -> Option<FileData<'_>> {
        let found = self.found.as_ref();
        Some(FileData {
            pairs: self.pairs.as_deref()?,
            trajectories: self.trajectories.as_deref(),
            section: self.section.as_deref(),
            circle_action: match &self.circle_action {
                Some(PairsAction::Circle(circle)) => circle,
                _ => &found?.circle,
            },
            torus: found.map(|found| &found.torus),
            found: found.and_then(|found| found.words.as_deref()),
            epsilon: self.epsilon.unwrap_or(Fit::EPSILON),
        })
    }

    /// Fails where keys of files and of windows are mixed.
    fn check_source(&self) -> Result<(), Error> {
        let of_file = [
            ("trajectories", self.trajectories.is_some()),
            ("section", self.section.is_some()),
            ("circle_action", self.circle_action.is_some()),
            ("epsilon", self.epsilon.is_some()),
        ];
        let of_windows = [
            ("windows", !self.windows.is_empty()),
            ("flow", self.flow.is_some()),
            ("epsilons", !self.epsilons.is_empty()),
            ("flow_times", !self.flow_times.is_empty()),
            ("relative", self.relative),
        ];
        let refused = |keys: &[(&str, bool)], expected: &str| {
            let key = keys.iter().find(|(_, given)| *given).map(|(key, _)| format!("data.{key}"));
            key.map_or(Ok(()), |key| Err(Error::invalid("data", key, expected)))
        };
        if self.lines.is_some() {
            refused(&of_file, "it beside data.pairs, a file, only")?;
            refused(&[("pairs", self.pairs.is_some())], "field lines, or pairs of a file")?;
            return refused(&of_windows, "field lines of coils, or points of windows");
        }
        if self.pairs.is_none() {
            return refused(&of_file, "it beside data.pairs, a file, only");
        }
        refused(&of_windows, "pairs of a file, or of windows")?;
        refused(&[("orbit", self.orbit != 1)], "pairs of a file, or of windows")?;
        self.epsilon.iter().try_for_each(|epsilon| Error::check_finite("data.epsilon", *epsilon))
    }

    fn check(&self) -> Result<(), Error> {
        self.check_source()?;
        if !(0.0..=1.0).contains(&self.validation) {
            let expected = "a share between 0 and 1";
            return Err(Error::invalid("data.validation", self.validation, expected));
        }
        Error::check_count_range("data.orbit", self.orbit, 1, MOST)?;
        let most = MOST / self.orbit;
        if let Some(window) = self.windows.iter().find(|w| w.samples > most) {
            let expected = format!("at most {most}");
            return Err(Error::invalid("data.windows.samples", window.samples, expected));
        }
        if let Some(lines) = &self.lines {
            lines.check()?;
        }
        if self.is_without_system() {
            return match self.validation < 1.0 {
                true => Ok(()),
                false => {
                    let expected = "a share below 1 of the pairs of a file or of field lines";
                    Err(Error::invalid("data.validation", self.validation, expected))
                }
            };
        }
        if self.windows.iter().all(|w| w.samples == 0) {
            return Err(Error::invalid("data.windows", "none", "at least one sample"));
        }
        if let Some(flow) = self.flow {
            flow.integrator.check().map_err(|e| e.with_place("data.flow"))?;
            Error::check_range("data.flow.step", flow.step, Error::LEAST_POSITIVE, f64::MAX)?;
        }
        self.epsilons.iter().try_for_each(|v| Error::check_finite("data.epsilons", *v))?;
        for time in &self.flow_times {
            Error::check_range("data.flow_times", *time, Error::LEAST_POSITIVE, f64::MAX)?;
        }
        let samples = self.pairs_of(&self.windows);
        let maps = self.epsilons.len().max(1).saturating_mul(self.flow_times.len().max(1));
        if samples < maps {
            let expected = format!("a sample for each of {maps} maps");
            return Err(Error::invalid("data.windows.samples", samples, expected));
        }
        if self.relative && (!self.is_family() || self.epsilons.contains(&0.0)) {
            let expected = "false, but for several maps of ε other than 0";
            return Err(Error::invalid("data.relative", true, expected));
        }
        let held_out = self.pairs_of(&self.held_out_windows());
        if self.orbit > 1 && self.is_family() {
            let expected = "1 beside several maps: an orbit is of one";
            return Err(Error::invalid("data.orbit", self.orbit, expected));
        }
        if self.orbit > 1 && self.validation > 0.0 && held_out == 0 {
            let expected = "0, or a share that holds out an orbit";
            return Err(Error::invalid("data.validation", self.validation, expected));
        }
        if self.is_family() && held_out < maps {
            let expected = format!("a share that leaves a held-out point for each of {maps} maps");
            return Err(Error::invalid("data.validation", self.validation, expected));
        }
        Ok(())
    }
}
