//! Training the networks of a scene, with checkpoints.

use super::context::{Context, RolloutRequest, RunError};
use super::data_sets::DataSets;
use super::event::Event;
use super::log::TrainingTimes;
use super::network_file::read_network;
use super::setup::{ModelSpec, SeededTraining};
use super::trained::{Trained, held_out_error, loss_of};
use crate::error::Error;
use crate::flow::Trajectories;
use crate::io::{Checkpoints, StoredModel, save_model};
use crate::network::{Model, Rollout};
use crate::train::{
    Checkpoint, Control, Earlier, Fit, Objective, Outcome, Prepared, Problem, Progress, RampStage,
    Scheduled, StagePairs, Stop, TrainingObserver, TrainingOptions, TrainingRecord, TrainingStage,
};
use std::rc::Rc;
use std::time::Instant;

impl Context<'_> {
    /// The networks that are to be studied, trained. One whose training is lost is not among them.
    ///
    /// # Errors
    /// [`Error::Diverged`] when all are lost.
    pub(super) fn models(&mut self) -> Result<Vec<Rc<Trained>>, RunError> {
        let all = self.all_models()?;
        let studied = all.into_iter().filter(|trained| !trained.spec.training_only);
        without_lost(studied.collect())
    }

    /// The networks, trained, with those that are here for their training only: from
    /// their checkpoints where the run goes on with one.
    pub(super) fn all_models(&mut self) -> Result<Vec<Rc<Trained>>, RunError> {
        let trainings: Vec<_> = self.scene.setup.trainings().collect();
        trainings.into_iter().map(|training| self.learn_own(training)).collect()
    }

    /// A training of the set-up, by the name of its files.
    pub(super) fn of_setup(&mut self, name: &str) -> Result<Rc<Trained>, RunError> {
        let mut trainings = self.scene.setup.trainings();
        let training = trainings.find(|training| training.spec.name == name);
        let unknown = || Error::invalid("training", name, "a network of the set-up");
        self.learn_own(training.ok_or_else(unknown)?)
    }

    fn learn_own(&mut self, training: SeededTraining) -> Result<Rc<Trained>, RunError> {
        if let Some(made) = self.learnt(&training.spec.name) {
            return Ok(made);
        }
        let (data, time) = (self.data()?, self.flow_time()?);
        self.learn(training, &data, time, None)
    }

    /// What a training, by the name of its files, has come to in this run.
    pub(super) fn learnt(&self, name: &str) -> Option<Rc<Trained>> {
        self.learnt.iter().find(|made| made.spec.name == name).map(Rc::clone)
    }

    /// Trains a network for a flow time, from its checkpoint where the run goes on with one, and writes its file. The
    /// first of its starts has the weights of the same network at an earlier flow time, if it is given with that time.
    pub(super) fn learn(
        &mut self,
        training: SeededTraining,
        data: &DataSets,
        time: f64,
        from: Option<(&Model, f64)>,
    ) -> Result<Rc<Trained>, RunError> {
        let name = format!("training {}", training.spec.name);
        let made = self.stage(&name, |context| learn_at(context, data, training, time, from))?;
        let made = Rc::new(made);
        self.learnt.push(Rc::clone(&made));
        Ok(made)
    }

    /// The pairs of the stages of a ramp that leads to a map: of the same points, or those among the pairs of a file.
    /// `own` are the ε and the flow time of the network.
    pub(super) fn stages(
        &mut self,
        ramp: &[RampStage],
        own: (f64, f64),
        of_last: &DataSets,
    ) -> Result<Vec<StagePairs>, RunError> {
        let is_of_file = self.scene.setup.is_of_file();
        let mut of = |stage: &RampStage| {
            if is_of_file {
                let (training, held_out) = (&of_last.training, of_last.validation());
                return Ok(StagePairs::among(stage, own, training, held_out)?);
            }
            let epsilon = stage.epsilon.unwrap_or(own.0);
            let time = stage.flow_time.unwrap_or(own.1);
            let data = self.data_at(epsilon, time)?;
            Ok(StagePairs {
                epsilon,
                time: time / own.1,
                training: data.training.clone(),
                held_out: data.validation().cloned(),
                iterations: stage.iterations,
            })
        };
        ramp.iter().map(&mut of).collect()
    }

    /// Each network that is not there for its training only, with the maps from all its initial weights.
    pub(super) fn by_network(&mut self) -> Result<Vec<BySeed>, RunError> {
        let all = self.all_models()?;
        let firsts = self.models()?;
        let of = |first: &Rc<Trained>| {
            let same = all.iter().filter(|one| one.network == first.network);
            BySeed { network: first.network.clone(), seeds: same.cloned().collect() }
        };
        Ok(firsts.iter().map(of).collect())
    }

    /// The trajectories of each network from these points, computed once for each request.
    pub(super) fn rollouts(
        &mut self,
        initial: &[Vec<f64>],
        request: Rollout,
    ) -> Result<Rc<Vec<Trajectories>>, RunError> {
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
}

/// The networks whose training is not lost.
///
/// # Errors
/// [`Error::Diverged`] when all are.
pub(super) fn without_lost(all: Vec<Rc<Trained>>) -> Result<Vec<Rc<Trained>>, RunError> {
    if let Some(first) = all.first()
        && all.iter().all(|trained| trained.lost.is_some())
    {
        let what = format!("training of every network, the first {}", first.spec.name);
        let place = "the beginning of a stage".to_owned();
        return Err(Error::Diverged { what, place }.into());
    }
    Ok(all.into_iter().filter(|trained| trained.lost.is_none()).collect())
}

/// A network, with the maps from all its initial weights.
pub(super) struct BySeed {
    pub(super) network: String,
    pub(super) seeds: Vec<Rc<Trained>>,
}

/// Trains a network for a flow time: see [`Context::learn`].
fn learn_at(
    context: &mut Context<'_>,
    data: &DataSets,
    training: SeededTraining,
    time: f64,
    from: Option<(&Model, f64)>,
) -> Result<Trained, RunError> {
    let SeededTraining { spec, network, number } = training;
    let (scene, folder) = (context.scene, context.folder);
    let target = context.target()?;
    let mut options = scene.setup.training_of(&spec).clone();
    options.ramp = scene.setup.leading_up(&options, target.epsilon(), time, from.is_some());
    // Weights of an earlier flow time come with twists of their own, and where no stage leads
    // up there is no chart to train fresh ones in.
    options.fresh_twists = options.fresh_twists.filter(|_| !options.ramp.is_empty());
    let (action, epsilon) = (target.torus(), target.epsilon());
    if spec.network.is_of_file() {
        return of_file(context, data, spec);
    }
    let architecture = spec.network.architecture(&action, epsilon, time)?;
    let (nearest_action, nearest) = data.nearest_to(target);
    let theta = match (&data.nearest, &nearest[..]) {
        (Some(_), &[theta]) => theta,
        _ => target.angle(time, &data.training),
    };
    let own = || {
        let same = data.nearest.is_some() && architecture.action() == Some(nearest_action);
        same.then(|| nearest.clone())
    };
    // That of a system has been found by the check of the set-up.
    let angles = own().or_else(|| target.angles(&architecture, theta, &data.training));
    let angles = angles.unwrap_or_else(|| vec![theta; architecture.circles.len()]);
    let prepared = Prepared {
        pairs: data.training.clone(),
        held_out: data.validation().cloned(),
        units: data.units.clone(),
        region: data.region(),
        nearest,
        angles,
        flow_time: time,
    };
    let stages = context.stages(&options.ramp, (epsilon, time), data)?;
    let fit = Fit {
        place: format!("scene {}", scene.name),
        action: Some(action),
        network: Some(spec.network.clone()),
        weights: spec.weights,
        epsilon: Some(epsilon),
        training: options,
        section: data.section.as_ref().map(|(section, _)| section.clone()),
        seed: scene.seed.wrapping_add(number),
        ..Fit::default()
    };
    let problem = fit.of_prepared(prepared, data.controls.clone(), stages)?;
    let problem = Problem {
        digest: data.digest.clone().unwrap_or_else(|| data.training.digest()),
        from: from.map(|(model, earlier)| Earlier { model: model.clone(), time: time / earlier }),
        ..problem
    };
    let options = problem.training.clone();
    let (initial, has_held_out) = (problem.initial_model()?, problem.held_out.is_some());
    let mut observer = SceneObserver::new(context, &spec, &options);
    let result = problem.train(&mut observer);
    let times = observer.times;
    context.add_training_times(times);
    let fitted = match result {
        Err(reason @ Error::Diverged { .. }) => {
            let reason = reason.to_string();
            context.report(Event::Lost { model: &spec.name, reason: &reason });
            return Ok(Trained::lost(spec, network, initial, reason, has_held_out));
        }
        result => result?,
    };
    let (stop, best) = (fitted.outcome().stop, fitted.outcome().best);
    context.report(Event::Trained { model: &spec.name, stop, best });
    if stop == Stop::Interrupted {
        return Err(RunError::Interrupted);
    }
    if folder.writes(&spec.name) {
        let stored = StoredModel::of_fit(&fitted, scene.name);
        save_model(&folder.file_of_model(scene, "model", &spec, ".json"), &stored)?;
    }
    let Scheduled { initial, stages, outcome } = fitted.training;
    let held_out_error = held_out_error(&outcome, &options.loss, data.validation())?;
    Ok(Trained { spec, network, initial, stages, outcome, held_out_error, lost: None })
}

/// Saves checkpoints, takes times, and reports how it goes.
struct SceneObserver<'w, 'a> {
    context: &'w mut Context<'a>,
    spec: &'w ModelSpec,
    options: &'w TrainingOptions,
    checkpoints: Checkpoints,
    times: TrainingTimes,
    /// The stage under way, when it began, and the seconds before: of other stages, and of its own in
    /// the run that is gone on with.
    under_way: Option<(TrainingStage, Instant, f64, f64)>,
    earlier: TrainingTimes,
}

impl<'w, 'a> SceneObserver<'w, 'a> {
    fn new(
        context: &'w mut Context<'a>,
        spec: &'w ModelSpec,
        options: &'w TrainingOptions,
    ) -> Self {
        let earlier = context.earlier_times(&spec.name);
        let times = TrainingTimes { model: spec.name.clone(), ..TrainingTimes::default() };
        let (scene, folder) = (context.scene, context.folder);
        let file = folder.file_of_model(scene, "checkpoint", spec, "");
        let checkpoints = Checkpoints::new(file, folder.resumes());
        Self { context, spec, options, checkpoints, times, under_way: None, earlier }
    }
}

impl TrainingObserver for SceneObserver<'_, '_> {
    fn earlier(&mut self, stage: TrainingStage) -> Result<Option<Checkpoint>, Error> {
        let found = self.checkpoints.earlier(stage)?;
        let before = self.times.before();
        let resumed_at = found.as_ref().map_or(0, |checkpoint| checkpoint.last().iteration);
        let of_stage = match stage {
            TrainingStage::Last => {
                self.times.points = std::mem::take(&mut self.earlier.points);
                self.times.points.retain(|(iteration, _)| *iteration <= resumed_at);
                self.times.points.last().map_or(0.0, |(_, seconds)| seconds - before)
            }
            _ => {
                let name = stage.name();
                let earlier = self.earlier.stages.iter().find(|(other, _)| *other == name);
                let seconds = match (&found, earlier) {
                    (Some(_), Some((_, seconds))) => *seconds,
                    _ => 0.0,
                };
                self.times.stages.push((name, seconds));
                seconds
            }
        };
        self.under_way = Some((stage, Instant::now(), before, of_stage));
        Ok(found)
    }

    fn observe(&mut self, stage: TrainingStage, progress: Progress<'_>) -> Result<Control, Error> {
        let record = progress.record;
        if let Some((_, start, before, of_stage)) = &self.under_way {
            let seconds = of_stage + start.elapsed().as_secs_f64();
            match stage {
                TrainingStage::Last
                    if record.validation.is_some() || progress.checkpoint.is_some() =>
                {
                    self.times.points.push((record.iteration, before + seconds));
                }
                TrainingStage::Last => {}
                _ => self.times.stages.last_mut().into_iter().for_each(|last| last.1 = seconds),
            }
        }
        self.checkpoints.observe(stage, progress)?;
        if progress.checkpoint.is_some() {
            self.context.save_training_times(&self.times)?;
        }
        let iterations = stage.iterations(self.options);
        let model = match stage {
            TrainingStage::Last => self.spec.name.clone(),
            _ => format!("{}, {}", self.spec.name, stage.name()),
        };
        self.context.report(Event::Iteration { model: &model, record, iterations });
        Ok(if self.context.interrupted() { Control::Interrupt } else { Control::Continue })
    }
}

/// A network that was trained elsewhere, judged by the pairs that choose among the models of a training.
fn of_file(context: &Context<'_>, data: &DataSets, spec: ModelSpec) -> Result<Trained, RunError> {
    let (scene, folder) = (context.scene, context.folder);
    let Some(path) = &spec.network.path else {
        let (place, key) = (format!("scene {}", scene.name), "models.network.path");
        return Err(Error::Missing { place, key, needed_by: spec.name }.into());
    };
    let mut stored = read_network(path, context.target()?, context.flow_time()?)?;
    let model = stored.model.clone();
    let loss = loss_of(&scene.setup.training_of(&spec).loss, context.target()?, data)?;
    let objective = Objective::new(&loss, &data.training)?;
    let of_held_out = loss.of_held_out();
    let validation = data.validation().map(|pairs| Objective::new(&of_held_out, pairs));
    let record = TrainingRecord {
        iteration: 0,
        evaluations: 0,
        loss: objective.value(model.composition()),
        pairs: data.training.len(),
        gradient: f64::NAN,
        validation: validation.transpose()?.map(|held_out| held_out.value(model.composition())),
    };
    stored.provenance.validation = record.validation;
    save_model(&folder.file_of_model(scene, "model", &spec, ".json"), &stored)?;
    let outcome = Outcome {
        model: model.clone(),
        loss: record.loss,
        best: record,
        history: vec![record],
        curvatures: 0,
        stop: Stop::NotTrained,
    };
    let held_out_error = held_out_error(&outcome, &loss, data.validation())?;
    let (network, stages) = (spec.name.clone(), Vec::new());
    Ok(Trained { network, spec, initial: model, stages, outcome, held_out_error, lost: None })
}
