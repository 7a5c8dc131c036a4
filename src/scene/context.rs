//! What the studies of a scene share: made on first use, and once. Networks are `learning`'s.

use super::data_sets::DataSets;
use super::declared::Declared;
use super::event::{Event, Observer};
use super::folder::Folder;
use super::line_data::TracedLines;
use super::log::{Log, Stage, TrainingTimes};
use super::made_data::{Made, MadeData};
use super::part::Part;
use super::setup::{Data, FlowBy, Need};
use super::target_flow::TargetFlow;
use super::trained::Trained;
use crate::error::Error;
use crate::flow::{Pairs, ReferenceTrajectories, Trajectories, Window, orbits_of, sample_of};
use crate::layer::Reversor;
use crate::measure::trajectories::limiting_flow_error;
use crate::network::{NetworkSpec, Rollout};
use crate::random::Stream;
use crate::stopping::unless_stopped;
use crate::system::{Counted, Hamiltonian, NearlyPeriodic, System};
use crate::train::Control;
use serde_json::json;
use std::rc::Rc;
use std::sync::atomic::Ordering;

/// Why a run ends before its report.
pub(super) enum RunError {
    /// The observer interrupted the run.
    Interrupted,
    /// An error ended the run.
    Failed(Error),
}

impl From<Error> for RunError {
    fn from(error: Error) -> Self {
        Self::Failed(error)
    }
}

/// A scene under way, with all that its studies have asked for so far.
pub(super) struct Context<'a> {
    pub(super) scene: &'a Declared<'a>,
    pub(super) folder: &'a Folder,
    /// What the scene's parts have found.
    pub(super) parts: &'a [Part<'a>],
    observer: &'a mut dyn Observer,
    log: Log,
    training_times: Vec<TrainingTimes>,
    /// Those of the run that is gone on with.
    earlier_times: Vec<TrainingTimes>,
    /// Training and held-out points of the windows and their orbits.
    points: Option<Rc<[Vec<f64>; 2]>>,
    data: Option<Rc<DataSets>>,
    /// Field lines, where the data is of them.
    lines: Option<Rc<TracedLines>>,
    /// At other ε and flow times.
    data_elsewhere: Vec<(f64, f64, Rc<DataSets>)>,
    /// The networks that are trained so far.
    pub(super) learnt: Vec<Rc<Trained>>,
    references: Vec<(ReferenceRequest, Rc<ReferenceTrajectories>)>,
    /// The trajectories of all networks that were computed so far, each set with its request.
    pub(super) rollouts: Vec<(RolloutRequest, Rc<Vec<Trajectories>>)>,
}

/// A request for trajectories of a system, by which those that exist are found again.
#[derive(Clone, PartialEq)]
struct ReferenceRequest {
    system: System,
    initial: Vec<Vec<f64>>,
    interval: f64,
    states: usize,
}

/// A request for trajectories of all networks, by which those that exist are found again.
#[derive(Clone, PartialEq)]
pub(super) struct RolloutRequest {
    pub(super) initial: Vec<Vec<f64>>,
    pub(super) request: Rollout,
}

impl<'a> Context<'a> {
    pub(super) fn new(
        scene: &'a Declared<'a>,
        folder: &'a Folder,
        parts: &'a [Part<'a>],
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
            lines: None,
            data_elsewhere: Vec::new(),
            learnt: Vec::new(),
            references: Vec::new(),
            rollouts: Vec::new(),
        }
    }

    pub(super) fn into_times(self) -> (Vec<TrainingTimes>, Vec<Stage>) {
        (self.training_times, self.log.into_stages())
    }

    /// Does some work as a stage of the run, reported to the observer.
    pub(super) fn stage<T, E>(
        &mut self,
        name: &str,
        work: impl FnOnce(&mut Self) -> Result<T, E>,
    ) -> Result<T, E> {
        self.report(Event::Stage(name));
        self.log.enter(name);
        let result = work(self);
        self.log.leave();
        result
    }

    pub(super) fn report(&mut self, event: Event<'_>) {
        self.observer.event(event);
    }

    pub(super) fn interrupted(&self) -> bool {
        self.observer.interrupted()
    }

    /// Makes something by flows, which end early where the run is interrupted.
    fn by_flows<T>(&self, make: impl FnOnce() -> Result<T, Error>) -> Result<T, RunError> {
        let Some(flag) = self.observer.interruption() else { return Ok(make()?) };
        let made = unless_stopped(move || !flag.load(Ordering::Relaxed), make);
        Ok(made.ok_or(RunError::Interrupted)??)
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
    pub(super) fn target(&self) -> Result<TargetFlow<'a>, Error> {
        self.scene.setup.target().ok_or_else(|| self.missing(Need::TargetFlow))
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
    pub(super) fn data(&mut self) -> Result<Rc<DataSets>, RunError> {
        if let Some(data) = &self.data {
            return Ok(Rc::clone(data));
        }
        let declared = self.scene.setup.data.as_ref().ok_or_else(|| self.missing(Need::Data))?;
        let (time, seed) = (self.flow_time()?, self.scene.seed);
        let models = self.scene.setup.models.iter();
        let reversors: Vec<Reversor> = models.filter_map(|model| model.network.reversor).collect();
        let reversors = &reversors[..];
        if let Some(file) = declared.file() {
            let name = format!("pairs of {}", file.pairs.display());
            let networks = self.scene.setup.models.iter().map(|model| &model.network);
            let networks: Vec<&NetworkSpec> =
                networks.filter(|network| !network.is_of_file()).collect();
            let made = self.stage(&name, |context| {
                let mut go_on = || {
                    Ok(match context.interrupted() {
                        true => Control::Interrupt,
                        false => Control::Continue,
                    })
                };
                let share = declared.validation;
                let own = context.scene.setup.read_pairs()?;
                match DataSets::of_file(file, own, time, share, &networks, seed, &mut go_on) {
                    Err(Error::Stopped { .. }) => Err(RunError::Interrupted),
                    made => Ok(made?),
                }
            })?;
            // What is wrong with a stage, or missing for the studies, is seen before the first of several trainings.
            let own = (file.epsilon, time);
            if made.of_own_map(file.epsilon).is_none() {
                let found = format!("ε = {} and flow time {time}", file.epsilon);
                let place = file.pairs.display();
                let expected = format!("those of some pairs of {place}");
                return Err(Error::invalid("data.epsilon and flow_time", found, expected).into());
            }
            for model in &self.scene.setup.models {
                self.stages(&self.scene.setup.training_of(model).ramp, own, &made)?;
            }
            return Ok(Rc::clone(self.data.insert(Rc::new(made))));
        }
        if declared.lines.is_some() {
            let (lines, target) = (self.lines()?, self.target()?);
            let made = DataSets::of_lines(&lines, target, time, reversors, seed)?;
            return Ok(Rc::clone(self.data.insert(Rc::new(made))));
        }
        if let Some(made) = self.made_pairs(None)? {
            return Ok(Rc::clone(self.data.insert(made)));
        }
        let system = self.system()?;
        let made = self.stage(OWN_PAIRS, |context| {
            let points = context.points(declared)?;
            let (counted, mut others) = (Counted::new(system), 0);
            let made = context.by_flows(|| match declared.is_family() {
                true => DataSets::of_family(declared, &counted, &points, time, &mut others),
                false => DataSets::of_flow(declared, &counted, &points, time),
            });
            context.log.vector_fields(counted.vector_fields() + others);
            made
        })?;
        Ok(Rc::clone(self.data.insert(Rc::new(made))))
    }

    /// The pairs of the set-up, or those at an ε and a flow time, where a job has made them.
    fn made_pairs(&mut self, at: Option<(f64, f64)>) -> Result<Option<Rc<DataSets>>, Error> {
        match self.folder.made_data(at)? {
            Some(MadeData { data: Made::Pairs(pairs), stages, .. }) => {
                self.log.add(stages);
                Ok(Some(Rc::new((*pairs).into())))
            }
            _ => Ok(None),
        }
    }

    /// The field lines of the set-up.
    pub(super) fn lines(&mut self) -> Result<Rc<TracedLines>, RunError> {
        if let Some(lines) = &self.lines {
            return Ok(Rc::clone(lines));
        }
        let declared = self.scene.setup.data.as_ref().ok_or_else(|| self.missing(Need::Data))?;
        let lines = declared.lines.as_ref().ok_or_else(|| {
            let place = format!("scene {}", self.scene.name);
            Error::Missing { place, key: "data.lines", needed_by: "a study".into() }
        })?;
        if let Some(MadeData { data: Made::Lines(made), stages, .. }) =
            self.folder.made_data(None)?
        {
            self.log.add(stages);
            let made =
                self.stage("the section of a job", |_| TracedLines::of_made(lines, *made))?;
            return Ok(Rc::clone(self.lines.insert(Rc::new(made))));
        }
        let made = self.stage(LINES, |context| {
            let stopped = || context.interrupted();
            TracedLines::new(lines, declared.orbit, declared.validation, &stopped)
        })?;
        let made = made.ok_or(RunError::Interrupted)?;
        Ok(Rc::clone(self.lines.insert(Rc::new(made))))
    }

    /// The pairs of the same points at another ε and flow time.
    pub(super) fn data_at(&mut self, epsilon: f64, time: f64) -> Result<Rc<DataSets>, RunError> {
        let family = self.scene.setup.data.as_ref().is_some_and(Data::is_family);
        if !family && (epsilon, time) == (self.target()?.epsilon(), self.flow_time()?) {
            return self.data();
        }
        let same = |made: &&(f64, f64, Rc<DataSets>)| (made.0, made.1) == (epsilon, time);
        if let Some((_, _, made)) = self.data_elsewhere.iter().find(same) {
            return Ok(Rc::clone(made));
        }
        let made = match self.made_pairs(Some((epsilon, time)))? {
            Some(made) => made,
            None => Rc::new(self.pairs_at(epsilon, time)?),
        };
        self.data_elsewhere.push((epsilon, time, Rc::clone(&made)));
        Ok(made)
    }

    fn pairs_at(&mut self, epsilon: f64, time: f64) -> Result<DataSets, RunError> {
        let declared = self.scene.setup.data.as_ref().ok_or_else(|| self.missing(Need::Data))?;
        let system = self.system()?.clone().with_epsilon(epsilon);
        let name = pairs_elsewhere(epsilon, time);
        self.stage(&name, |context| {
            let points = context.points(declared)?;
            let counted = Counted::new(&system);
            let made = context.by_flows(|| DataSets::of_flow(declared, &counted, &points, time));
            context.log.vector_fields(counted.vector_fields());
            made
        })
    }

    /// Training and held-out points: of the windows, and of the orbits from there under the map of the
    /// scene.
    fn points(&mut self, declared: &Data) -> Result<Rc<[Vec<f64>; 2]>, RunError> {
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
            let (states, flow) = (declared.orbit, declared.flow);
            let follow = |starts: &[f64]| {
                let found = FlowBy::trajectories(flow, &counted, starts, time, states);
                found.map(|found| found.trajectories)
            };
            let place = "data.orbit";
            let orbits = orbits_of(place, system, windows, points, states, &mut stream, &follow)?;
            let mut rows: Vec<&[f64]> = orbits.chunks_exact(2 * system.dof()).collect();
            // In any order, so that each part of the pairs is of all orbits.
            Stream::new(seed, &format!("{name}/orbits")).shuffle(&mut rows);
            Ok::<_, Error>(rows.concat())
        };
        let held_out = declared.held_out_windows();
        let both = self.by_flows(|| {
            Ok([points(&declared.windows, "data/training")?, points(&held_out, "data/held-out")?])
        })?;
        self.log.vector_fields(counted.vector_fields());
        Ok(Rc::clone(self.points.insert(Rc::new(both))))
    }

    /// The held-out pairs of the same points at another ε and flow time, and the mean
    /// squared error of the limiting rotation on them.
    pub(super) fn judge_at(&mut self, epsilon: f64, time: f64) -> Result<(Pairs, f64), RunError> {
        let declared = self.scene.setup.data.as_ref().ok_or_else(|| self.missing(Need::Data))?;
        let system = self.system()?.clone().with_epsilon(epsilon);
        let name = pairs_elsewhere(epsilon, time);
        self.stage(&name, |context| {
            let points = context.points(declared)?;
            let [training, held_out] = &*points;
            let points = if held_out.is_empty() { training } else { held_out };
            let counted = Counted::new(&system);
            let by = declared.flow;
            let (pairs, _) =
                context.by_flows(|| FlowBy::pairs(by, &counted, points.clone(), time))?;
            context.log.vector_fields(counted.vector_fields());
            let rotation = limiting_flow_error(&system, &pairs, time);
            Ok((pairs, rotation))
        })
    }

    /// The trajectories of the file, in the coordinates of the networks: this many states of
    /// each.
    pub(super) fn trajectories_of_file(
        &mut self,
        states: usize,
    ) -> Result<Rc<ReferenceTrajectories>, RunError> {
        let TargetFlow::File(file) = self.target()? else {
            return Err(self.missing(Need::TargetFlow).into());
        };
        let path = file.trajectories.ok_or_else(|| {
            let (place, key) = (format!("scene {}", self.scene.name), "data.trajectories");
            Error::Missing { place, key, needed_by: "rollout".into() }
        })?;
        let data = self.data()?;
        let mut values = file.read_trajectories(path, states)?;
        if let Some((section, _)) = &data.section {
            values = values.moved(|points| section.to_canonical(points));
        }
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
    ) -> Result<Rc<ReferenceTrajectories>, RunError> {
        let (system, initial) = (system.clone(), initial.to_vec());
        let request = ReferenceRequest { system, initial, interval, states };
        if let Some((_, made)) = self.references.iter().find(|(earlier, _)| *earlier == request) {
            return Ok(Rc::clone(made));
        }
        let made = self.stage("reference trajectories", |context| {
            let counted = Counted::new(&request.system);
            let initial = request.initial.concat();
            let flow = context.scene.setup.data.as_ref().and_then(|data| data.flow);
            let made = context
                .by_flows(|| FlowBy::trajectories(flow, &counted, &initial, interval, states));
            context.log.vector_fields(counted.vector_fields());
            made
        })?;
        let made = Rc::new(made);
        self.references.push((request, Rc::clone(&made)));
        Ok(made)
    }

    /// The times of a network in the run that is gone on with; none where they cannot be read.
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

    /// Seconds that the pairs at an ε and a flow time took, which were made in this run.
    pub(super) fn seconds_of_pairs(&self, epsilon: f64, time: f64) -> f64 {
        let setup = self.scene.setup;
        let own = setup.system.as_ref().is_some_and(|system| system.epsilon() == epsilon)
            && setup.flow_time == Some(time);
        let elsewhere = self.log.seconds_of(&pairs_elsewhere(epsilon, time));
        elsewhere + if own { self.log.seconds_of(OWN_PAIRS) } else { 0.0 }
    }

    /// Of the stages of this name.
    pub(super) fn seconds_of(&self, stage: &str) -> f64 {
        self.log.seconds_of(stage)
    }

    /// The seconds of each network's training, so far.
    pub(super) fn training_times(&self) -> &[TrainingTimes] {
        &self.training_times
    }

    pub(super) fn add_training_times(&mut self, times: TrainingTimes) {
        self.training_times.push(times);
    }
}

/// The stage in which field lines are traced.
pub(super) const LINES: &str = "field lines of the coils";

/// The stage in which the pairs of a scene are made.
const OWN_PAIRS: &str = "reference flow of the training and held-out points";

/// The stage in which those at another ε and flow time are.
fn pairs_elsewhere(epsilon: f64, time: f64) -> String {
    format!("reference flow for ε = {epsilon} and time {time}")
}

fn earlier_times(folder: &Folder) -> Option<Vec<TrainingTimes>> {
    serde_json::from_value(folder.earlier_timings()?.get("models")?.clone()).ok()
}
