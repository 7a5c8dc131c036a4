//! What the studies of a scene share: made on first use, and once.

use super::declaration::Scene;
use super::folder::Folder;
use super::learning::{Trained, learn};
use super::log::{Log, Stage, TrainingTimes};
use super::report::Report;
use super::run::{Event, Observer};
use super::setup::{Data, FlowBy, Need};
use super::subject::{FileData, Subject};
use crate::error::Error;
use crate::flow::{Pairs, ReferenceTrajectories, Region, Trajectories, Window, sample_of};
use crate::io::read_pairs;
use crate::layer::TorusAction;
use crate::measure::{limiting_flow_error, root_mean_square, rotation_error};
use crate::network::Rollout;
use crate::phase::Units;
use crate::random::Stream;
use crate::scalar::max_or_nan;
use crate::system::{Counted, Hamiltonian, NearlyPeriodic, System};
use crate::train::{Preparation, Prepared};
use serde_json::json;
use std::rc::Rc;

/// Why a run ends before its report.
pub(super) enum Halt {
    /// The observer interrupted it.
    Interrupted,
    /// Something went wrong.
    Failed(Error),
}

impl From<Error> for Halt {
    fn from(error: Error) -> Self {
        Self::Failed(error)
    }
}

/// A scene under way, with all that its studies have asked for so far.
pub(super) struct Context<'a> {
    pub(super) scene: &'a Scene,
    pub(super) folder: &'a Folder,
    /// The reports of the scene's parts.
    pub(super) parts: &'a [Report],
    observer: &'a mut dyn Observer,
    log: Log,
    training_times: Vec<TrainingTimes>,
    /// Those of the run that is gone on with.
    earlier_times: Vec<TrainingTimes>,
    /// Training and held-out points of the windows and their orbits.
    points: Option<Rc<[Vec<f64>; 2]>>,
    data: Option<Rc<DataSets>>,
    /// At other ε and flow times.
    data_elsewhere: Vec<(f64, f64, Rc<DataSets>)>,
    models: Option<Vec<Rc<Trained>>>,
    references: Vec<(ReferenceRequest, Rc<ReferenceTrajectories>)>,
    rollouts: Vec<(RolloutRequest, Rc<Vec<Trajectories>>)>,
}

/// Trajectories of a system.
#[derive(Clone, PartialEq)]
struct ReferenceRequest {
    system: System,
    initial: Vec<Vec<f64>>,
    interval: f64,
    states: usize,
}

/// Trajectories of all networks.
#[derive(Clone, PartialEq)]
struct RolloutRequest {
    initial: Vec<Vec<f64>>,
    request: Rollout,
}

impl<'a> Context<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        folder: &'a Folder,
        parts: &'a [Report],
        observer: &'a mut dyn Observer,
    ) -> Self {
        Self {
            scene,
            folder,
            parts,
            observer,
            log: Log::new(),
            training_times: Vec::new(),
            earlier_times: earlier_times(folder).unwrap_or_default(),
            points: None,
            data: None,
            data_elsewhere: Vec::new(),
            models: None,
            references: Vec::new(),
            rollouts: Vec::new(),
        }
    }

    pub(super) fn into_times(self) -> (Vec<TrainingTimes>, Vec<Stage>) {
        (self.training_times, self.log.into_stages())
    }

    /// Does some work as a stage of the run, told to the observer.
    pub(super) fn stage<T, E>(
        &mut self,
        name: &str,
        work: impl FnOnce(&mut Self) -> Result<T, E>,
    ) -> Result<T, E> {
        self.tell(Event::Stage(name));
        self.log.enter(name);
        let result = work(self);
        self.log.leave();
        result
    }

    pub(super) fn tell(&mut self, event: Event<'_>) {
        self.observer.event(event);
    }

    pub(super) fn interrupted(&self) -> bool {
        self.observer.interrupted()
    }

    /// Whether the scene wants this figure.
    pub(super) fn draws(&self, figure: &str) -> bool {
        self.scene.plots.iter().any(|plot| plot == figure)
    }

    /// The system of the set-up.
    pub(super) fn system(&self) -> Result<&'a System, Error> {
        self.scene.setup.system.as_ref().ok_or_else(|| self.missing(Need::System))
    }

    /// What the networks stand for.
    pub(super) fn subject(&self) -> Result<Subject<'a>, Error> {
        self.scene.setup.subject().ok_or_else(|| self.missing(Need::Subject))
    }

    /// The flow time of the set-up.
    pub(super) fn flow_time(&self) -> Result<f64, Error> {
        self.scene.setup.flow_time.ok_or_else(|| self.missing(Need::FlowTime))
    }

    fn missing(&self, need: Need) -> Error {
        let place = format!("scene {}", self.scene.name);
        Error::Missing { place, key: need.key(), needed_by: "a study".into() }
    }

    /// The training and held-out pairs.
    pub(super) fn data(&mut self) -> Result<Rc<DataSets>, Halt> {
        if let Some(data) = &self.data {
            return Ok(Rc::clone(data));
        }
        let declared = self.scene.setup.data.as_ref().ok_or_else(|| self.missing(Need::Data))?;
        let (time, seed) = (self.flow_time()?, self.scene.seed);
        if let Some(file) = declared.file() {
            let name = format!("pairs of {}", file.pairs.display());
            let made =
                self.stage(&name, |_| DataSets::of_file(file, time, declared.validation, seed))?;
            return Ok(Rc::clone(self.data.insert(Rc::new(made))));
        }
        let system = self.system()?;
        let made = self.stage("reference flow of the training and held-out points", |context| {
            let points = context.points(declared)?;
            let (counted, mut others) = (Counted::new(system), 0);
            let made = match declared.is_family() {
                true => DataSets::of_family(declared, &counted, &points, time, &mut others),
                false => DataSets::of_flow(declared, &counted, &points, time),
            };
            context.log.vector_fields(counted.vector_fields() + others);
            made
        })?;
        Ok(Rc::clone(self.data.insert(Rc::new(made))))
    }

    /// The pairs of the same points at another ε and flow time.
    pub(super) fn data_at(&mut self, epsilon: f64, time: f64) -> Result<Rc<DataSets>, Halt> {
        let family = self.scene.setup.data.as_ref().is_some_and(Data::is_family);
        if !family && (epsilon, time) == (self.system()?.epsilon(), self.flow_time()?) {
            return self.data();
        }
        let same = |made: &&(f64, f64, Rc<DataSets>)| (made.0, made.1) == (epsilon, time);
        if let Some((_, _, made)) = self.data_elsewhere.iter().find(same) {
            return Ok(Rc::clone(made));
        }
        let declared = self.scene.setup.data.as_ref().ok_or_else(|| self.missing(Need::Data))?;
        let system = self.system()?.clone().with_epsilon(epsilon);
        let name = format!("reference flow for ε = {epsilon} and time {time}");
        let made = self.stage(&name, |context| {
            let points = context.points(declared)?;
            let counted = Counted::new(&system);
            let made = DataSets::of_flow(declared, &counted, &points, time);
            context.log.vector_fields(counted.vector_fields());
            made
        })?;
        let made = Rc::new(made);
        self.data_elsewhere.push((epsilon, time, Rc::clone(&made)));
        Ok(made)
    }

    /// Training and held-out points: of the windows, and of the orbits from there under the map of the
    /// scene.
    fn points(&mut self, declared: &Data) -> Result<Rc<[Vec<f64>; 2]>, Error> {
        if let Some(points) = &self.points {
            return Ok(Rc::clone(points));
        }
        let (system, time, seed) = (self.system()?, self.flow_time()?, self.scene.seed);
        let counted = Counted::new(system);
        let points = |windows: &[Window], name: &str| {
            let mut stream = Stream::new(seed, name);
            let points = sample_of(system, windows, &mut stream)?;
            if declared.orbit == 1 || points.is_empty() {
                return Ok(points);
            }
            let orbits = orbits(declared, &counted, time, windows, points, &mut stream)?;
            let mut rows: Vec<&[f64]> = orbits.chunks_exact(2 * system.dof()).collect();
            // In any order, so that each part of the pairs is of all orbits.
            Stream::new(seed, &format!("{name}/orbits")).shuffle(&mut rows);
            Ok::<_, Error>(rows.concat())
        };
        let held_out = declared.held_out_windows();
        let both =
            [points(&declared.windows, "data/training")?, points(&held_out, "data/held-out")?];
        self.log.vector_fields(counted.vector_fields());
        Ok(Rc::clone(self.points.insert(Rc::new(both))))
    }

    /// The held-out pairs of the same points at another ε and flow time, and the mean
    /// squared error of the limiting rotation on them.
    pub(super) fn judge_at(&mut self, epsilon: f64, time: f64) -> Result<(Pairs, f64), Halt> {
        let declared = self.scene.setup.data.as_ref().ok_or_else(|| self.missing(Need::Data))?;
        let system = self.system()?.clone().with_epsilon(epsilon);
        let name = format!("reference flow for ε = {epsilon} and time {time}");
        self.stage(&name, |context| {
            let points = context.points(declared)?;
            let [training, held_out] = &*points;
            let points = if held_out.is_empty() { training } else { held_out };
            let counted = Counted::new(&system);
            let (pairs, _) = FlowBy::pairs(declared.flow, &counted, points.clone(), time)?;
            context.log.vector_fields(counted.vector_fields());
            let rotation = limiting_flow_error(&system, &pairs, time);
            Ok((pairs, rotation))
        })
    }

    /// The networks that are to be studied, trained.
    pub(super) fn models(&mut self) -> Result<Vec<Rc<Trained>>, Halt> {
        let all = self.all_models()?;
        Ok(all.into_iter().filter(|trained| !trained.spec.training_only).collect())
    }

    /// The networks, trained, with those that are here for their training only: from
    /// their checkpoints where the run goes on with one.
    pub(super) fn all_models(&mut self) -> Result<Vec<Rc<Trained>>, Halt> {
        if let Some(models) = &self.models {
            return Ok(models.clone());
        }
        let mut trained = Vec::new();
        for attempt in self.scene.setup.attempts() {
            let data = self.data()?;
            let name = format!("training {}", attempt.spec.name);
            let one = self.stage(&name, |context| learn(context, &data, attempt))?;
            trained.push(Rc::new(one));
        }
        Ok(self.models.insert(trained).clone())
    }

    /// The trajectories of the file, in the coordinates of the networks: this many states of
    /// each.
    pub(super) fn trajectories_of_file(
        &mut self,
        states: usize,
    ) -> Result<Rc<ReferenceTrajectories>, Halt> {
        let Subject::File(file) = self.subject()? else {
            return Err(self.missing(Need::Subject).into());
        };
        let path = file.trajectories.ok_or_else(|| {
            let (place, key) = (format!("scene {}", self.scene.name), "data.trajectories");
            Error::Missing { place, key, needed_by: "rollout".into() }
        })?;
        let data = self.data()?;
        let mut values = file.read_trajectories(path, states)?;
        if let Some(units) = &data.units {
            values = values.moved(|points| units.to_network(points));
        }
        Ok(Rc::new(ReferenceTrajectories { trajectories: values, error: f64::NAN }))
    }

    /// Trajectories of the reference flow of `system`: `states` states, `interval`
    /// apart, from each initial point.
    pub(super) fn reference(
        &mut self,
        system: &System,
        initial: &[Vec<f64>],
        interval: f64,
        states: usize,
    ) -> Result<Rc<ReferenceTrajectories>, Halt> {
        let (system, initial) = (system.clone(), initial.to_vec());
        let request = ReferenceRequest { system, initial, interval, states };
        if let Some((_, made)) = self.references.iter().find(|(earlier, _)| *earlier == request) {
            return Ok(Rc::clone(made));
        }
        let made = self.stage("reference trajectories", |context| {
            let counted = Counted::new(&request.system);
            let initial = request.initial.concat();
            let flow = context.scene.setup.data.as_ref().and_then(|data| data.flow);
            let made = FlowBy::trajectories(flow, &counted, &initial, interval, states);
            context.log.vector_fields(counted.vector_fields());
            made
        })?;
        let made = Rc::new(made);
        self.references.push((request, Rc::clone(&made)));
        Ok(made)
    }

    /// Trajectories of each network.
    pub(super) fn rollouts(
        &mut self,
        initial: &[Vec<f64>],
        request: Rollout,
    ) -> Result<Rc<Vec<Trajectories>>, Halt> {
        let wanted = RolloutRequest { initial: initial.to_vec(), request };
        if let Some((_, made)) = self.rollouts.iter().find(|(earlier, _)| *earlier == wanted) {
            return Ok(Rc::clone(made));
        }
        let mut made = Vec::new();
        for trained in self.models()?.iter() {
            let states = self.stage(&format!("roll-out of {}", trained.spec.name), |_| {
                trained.model().rollout(&initial.concat(), request)
            })?;
            let dim = 2 * trained.model().composition().dof();
            made.push(Trajectories::new(states, dim, initial.len())?);
        }
        let made = Rc::new(made);
        self.rollouts.push((wanted, Rc::clone(&made)));
        Ok(made)
    }

    /// The seconds of each network's training, so far.
    /// Those of a network in the run that is gone on with; none where they cannot be read.
    pub(super) fn earlier_times(&self, model: &str) -> TrainingTimes {
        let earlier = self.earlier_times.iter().find(|times| times.model == model);
        let none = || TrainingTimes { model: model.into(), ..TrainingTimes::default() };
        earlier.cloned().unwrap_or_else(none)
    }

    /// Writes the times so far, with those of the network that is trained, and the earlier ones
    /// of those whose turn is still to come.
    pub(super) fn save_training_times(&self, present: &TrainingTimes) -> Result<(), Error> {
        let mut all: Vec<_> = self.training_times.iter().chain([present]).collect();
        for earlier in &self.earlier_times {
            if all.iter().all(|times| times.model != earlier.model) {
                all.push(earlier);
            }
        }
        self.folder.save_timings(&json!({ "models": all }))
    }

    pub(super) fn training_times(&self) -> &[TrainingTimes] {
        &self.training_times
    }

    pub(super) fn add_training_times(&mut self, times: TrainingTimes) {
        self.training_times.push(times);
    }
}

/// The orbits from these points of the windows, one after another. Another point of the same
/// window is drawn in place of each whose orbit leaves what the system is defined on.
fn orbits(
    data: &Data,
    system: &Counted<'_, System>,
    time: f64,
    windows: &[Window],
    mut starts: Vec<f64>,
    stream: &mut Stream,
) -> Result<Vec<f64>, Error> {
    /// Draws in a row for an orbit: a window that has so few is in the wrong place.
    const MOST: usize = 100;
    let dim = 2 * system.dof();
    let of_window: Vec<&Window> =
        windows.iter().flat_map(|window| std::iter::repeat_n(window, window.samples)).collect();
    let mut out = vec![0.0; starts.len() * data.orbit];
    let mut drawn: Vec<usize> = (0..of_window.len()).collect();
    for draw in 1.. {
        let found =
            FlowBy::trajectories(data.flow, system, &starts, time, data.orbit)?.trajectories;
        let (mut left, mut reason) = (Vec::new(), None);
        for (m, &orbit) in drawn.iter().enumerate() {
            match found.of(m).try_for_each(|state| system.check_point(state)) {
                Ok(()) => {
                    let states = found.of(m).flatten().copied();
                    let place = &mut out[orbit * data.orbit * dim..][..data.orbit * dim];
                    place.iter_mut().zip(states).for_each(|(to, from)| *to = from);
                }
                Err(error) => {
                    left.push(orbit);
                    reason = Some(error);
                }
            }
        }
        match reason {
            None => break,
            Some(reason) if draw == MOST => return Err(reason.at("data.orbit")),
            Some(_) => {
                starts.clear();
                for &orbit in &left {
                    let window = [Window { samples: 1, ..of_window[orbit].clone() }];
                    starts.extend(sample_of(system, &window, stream)?);
                }
                drawn = left;
            }
        }
    }
    Ok(out)
}

/// The pairs of a flow map, for training and held out.
pub(super) struct DataSets {
    pub(super) training: Pairs,
    pub(super) held_out: Option<Pairs>,
    /// The pairs that choose among the models of a training, where they are not those:
    /// of all maps of a family.
    validation: Option<Pairs>,
    /// The largest difference of the reference flow between two resolutions; NaN of pairs of a
    /// file, of which nothing is known.
    pub(super) reference_error: f64,
    /// The units of the file that the pairs are of, where they are not those of the pairs here.
    pub(super) units: Option<Units>,
    /// The mean squared error of the exact limiting rotation alone, on the pairs that choose
    /// among the models of a training.
    pub(super) rotation_error: Option<f64>,
    /// The rotation nearest to the pairs of a file, by its angle.
    pub(super) nearest: Option<(TorusAction, Vec<f64>)>,
}

impl DataSets {
    fn of_flow(
        data: &Data,
        system: &Counted<'_, System>,
        [training_points, held_out_points]: &[Vec<f64>; 2],
        time: f64,
    ) -> Result<Self, Error> {
        let flow = |points: &[f64]| FlowBy::pairs(data.flow, system, points.to_vec(), time);
        let (training, mut reference_error) = flow(training_points)?;
        let held_out = if held_out_points.is_empty() {
            None
        } else {
            let (held_out, error) = flow(held_out_points)?;
            reference_error = max_or_nan(reference_error, error);
            Some(held_out)
        };
        let rotation_error =
            held_out.as_ref().map(|held_out| limiting_flow_error(system, held_out, time));
        let (validation, units, nearest) = (None, None, None);
        Ok(Self { training, held_out, validation, reference_error, units, rotation_error, nearest })
    }

    /// The pairs of a file, made ready as by `gyroceptron train`.
    fn of_file(file: FileData<'_>, time: f64, validation: f64, seed: u64) -> Result<Self, Error> {
        let place = file.pairs.display().to_string();
        let pairs = read_pairs(file.pairs)?.pairs;
        if !pairs.conditions().is_empty() {
            let found = "epsilon or flow_time of each pair";
            return Err(Error::content(place, "pairs of one map", found));
        }
        let action = TorusAction::from(file.circle_action.clone());
        let preparation = Preparation {
            place: &place,
            action: &action,
            epsilon: file.epsilon,
            flow_time: Some(time),
            of_order_one: false,
            theta: None,
            units: true,
            validation,
            seed,
        };
        let Prepared { pairs: training, held_out, units, nearest, .. } =
            preparation.prepare(pairs)?;
        let judge = held_out.as_ref().unwrap_or(&training);
        let rotation_error = Some(rotation_error(&action, &nearest, judge));
        let (validation, reference_error) = (None, f64::NAN);
        let nearest = Some((action, nearest));
        Ok(Self { training, held_out, validation, reference_error, units, rotation_error, nearest })
    }

    /// The pairs of a family of maps: of each ε and flow time a share of the points. What is held
    /// out to judge by is of one map, as without a family.
    fn of_family(
        data: &Data,
        system: &Counted<'_, System>,
        [training_points, held_out_points]: &[Vec<f64>; 2],
        time: f64,
        fields: &mut u64,
    ) -> Result<Self, Error> {
        let dim = 2 * system.dof();
        let (held_out, mut reference_error) =
            FlowBy::pairs(data.flow, system, held_out_points.clone(), time)?;
        let or = |values: &[f64], own: f64| match values {
            [] => vec![own],
            several => several.to_vec(),
        };
        let (epsilons, times) = (or(&data.epsilons, system.epsilon()), or(&data.flow_times, time));
        let maps: Vec<(f64, f64)> =
            epsilons.iter().flat_map(|&e| times.iter().map(move |&t| (e, t))).collect();
        let mut family = |points: &[f64]| -> Result<Pairs, Error> {
            let mut sets = Vec::new();
            for (number, &(epsilon, flow_time)) in maps.iter().enumerate() {
                let rows = points.chunks_exact(dim).skip(number).step_by(maps.len());
                let system = system.inner().clone().with_epsilon(epsilon);
                let counted = Counted::new(&system);
                let points = rows.flatten().copied().collect();
                let (set, error) = FlowBy::pairs(data.flow, &counted, points, flow_time)?;
                *fields += counted.vector_fields();
                reference_error = max_or_nan(reference_error, error);
                sets.push((epsilon, flow_time / time, set));
            }
            let family = Pairs::of_family(sets)?;
            if data.relative { family.relative() } else { Ok(family) }
        };
        let (training, validation) = (family(training_points)?, Some(family(held_out_points)?));
        let mut squares = 0.0;
        for (condition, input, output) in validation.iter().flat_map(Pairs::runs) {
            let condition = condition.expect("a set for each map");
            let system = system.inner().clone().with_epsilon(condition.epsilon);
            let of_map = Pairs::new("map", system.dof(), input.to_vec(), output.to_vec())?;
            let error = limiting_flow_error(&system, &of_map, condition.time * time);
            squares += condition.weight * error * of_map.len() as f64;
        }
        let rotation_error =
            validation.as_ref().map(|validation| squares / validation.len() as f64);
        let held_out = Some(held_out);
        let (units, nearest) = (None, None);
        Ok(Self { training, held_out, validation, reference_error, units, rotation_error, nearest })
    }

    /// The box around the pairs, training and held out, in units of the data.
    pub(super) fn region(&self) -> Option<Region> {
        let both = [Some(&self.training), self.held_out.as_ref()].into_iter().flatten();
        let ends = both.flat_map(|pairs| [pairs.input(), pairs.output()]);
        let mut region = Region::around(2 * self.training.dof(), ends)?;
        if let Some(units) = &self.units {
            units.to_data(&mut region.low);
            units.to_data(&mut region.high);
        }
        Some(region)
    }

    /// The pairs that choose among the models of a training.
    pub(super) fn validation(&self) -> Option<&Pairs> {
        self.validation.as_ref().or(self.held_out.as_ref())
    }

    /// The root mean square of the components of the outputs that a training is judged by.
    pub(super) fn size(&self) -> f64 {
        root_mean_square(self.validation().unwrap_or(&self.training).output())
    }

    /// The pairs to judge by: held out, where there are any.
    pub(super) fn to_judge_by(&self) -> &Pairs {
        self.held_out.as_ref().unwrap_or(&self.training)
    }
}

fn earlier_times(folder: &Folder) -> Option<Vec<TrainingTimes>> {
    serde_json::from_value(folder.earlier_timings()?.get("models")?.clone()).ok()
}
