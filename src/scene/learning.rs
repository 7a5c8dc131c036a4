//! Training the networks of a scene, with checkpoints.

use super::context::{Context, Halt, RolloutRequest};
use super::data_sets::DataSets;
use super::event::Event;
use super::log::TrainingTimes;
use super::network_file::read_network;
use super::setup::{Attempt, ModelSpec};
use super::trained::{Trained, held_out_error, loss_of};
use crate::error::Error;
use crate::flow::Trajectories;
use crate::io::{Provenance, StoredModel, earlier_checkpoint, save_checkpoint, save_model};
use crate::network::{Model, Rollout};
use crate::train::{
    Checkpoint, Control, InitialModels, Objective, Outcome, Progress, RampStage, Scheduled,
    StageData, Stop, TrainingObserver, TrainingOptions, TrainingRecord, TrainingStage,
    train_schedule,
};
use std::path::PathBuf;
use std::rc::Rc;
use std::time::Instant;

impl Context<'_> {
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
}

/// Trains a network, from its checkpoint where the run goes on with one, and writes
/// its file.
fn learn(context: &mut Context<'_>, data: &DataSets, attempt: Attempt) -> Result<Trained, Halt> {
    let time = context.flow_time()?;
    learn_at(context, data, attempt, time, None)
}

/// [`learn`] at another flow time. The first of its starts has the weights of the same
/// network at an earlier flow time, if it is given with that time.
pub(super) fn learn_at(
    context: &mut Context<'_>,
    data: &DataSets,
    attempt: Attempt,
    time: f64,
    from: Option<(&Model, f64)>,
) -> Result<Trained, Halt> {
    let Attempt { spec, network, number } = attempt;
    let (scene, folder) = (context.scene, context.folder);
    let subject = context.subject()?;
    let mut options = scene.setup.training_of(&spec).clone();
    options.loss = loss_of(&options.loss, subject, data)?;
    // A ramp is up to the flow time that is wanted; weights of an earlier one come from there.
    let leads_up = |rung: &RampStage| {
        let other_epsilon = rung.epsilon.is_some_and(|epsilon| epsilon != subject.epsilon());
        rung.flow_time.is_none_or(|rung| rung < time || rung == time && other_epsilon)
    };
    options.ramp.retain(|rung| from.is_none() && leads_up(rung));
    // Weights of an earlier flow time come with twists of their own, and where no rung leads
    // up there is no chart to train fresh ones in.
    options.fresh_twists = options.fresh_twists.filter(|_| !options.ramp.is_empty());
    let options = &options;
    let seed = scene.seed.wrapping_add(number);
    let (action, epsilon) = (subject.circle_action(), subject.epsilon());
    if spec.network.is_of_file() {
        return of_file(context, data, spec);
    }
    let architecture = spec.network.architecture(&action.into(), epsilon, time)?;
    let theta = subject.angle(time, &data.training);
    // The check of the set-up has found them.
    let angles = subject.angles(&architecture, theta, &data.training);
    let angles = angles.unwrap_or_else(|| vec![theta; architecture.circles.len()]);
    let initial = InitialModels {
        architecture: &architecture,
        weights: spec.weights,
        angles: &angles,
        seed,
        from: from.map(|(model, earlier)| (model, time / earlier)),
    };
    let mut rungs = Vec::new();
    for rung in &options.ramp {
        let rung_epsilon = rung.epsilon.unwrap_or(epsilon);
        let rung_time = rung.flow_time.unwrap_or(time);
        rungs.push((rung, rung_epsilon, rung_time, context.data_at(rung_epsilon, rung_time)?));
    }
    let mut places: Vec<StageData<'_>> = rungs
        .iter()
        .map(|(rung, epsilon, rung_time, data)| StageData {
            epsilon: *epsilon,
            time: rung_time / time,
            pairs: &data.training,
            held_out: data.validation(),
            iterations: rung.iterations,
        })
        .collect();
    let (pairs, held_out, iterations) = (&data.training, data.validation(), options.iterations);
    places.push(StageData { epsilon, time: 1.0, pairs, held_out, iterations });
    let mut watch = SceneWatch::new(context, &spec, options);
    let result = train_schedule(&mut |number| initial.model(number), &places, options, &mut watch);
    let times = watch.times;
    context.add_training_times(times);
    let Scheduled { initial, legs, outcome } = result?;
    let (stop, best) = (outcome.stop, outcome.best);
    context.tell(Event::Trained { model: &spec.name, stop, best });
    if stop == Stop::Interrupted {
        return Err(Halt::Interrupted);
    }
    let provenance = Provenance {
        seed: Some(seed),
        data: Some(pairs.digest()),
        flow_time: Some(time),
        validation: best.validation,
        region: data.region(),
        ..Provenance::of(scene.name)
    };
    let stored =
        StoredModel { model: outcome.model.clone(), units: data.units.clone(), provenance };
    save_model(&folder.file_of_model(scene, "model", &spec, ".json"), &stored)?;
    let held_out_error = held_out_error(&outcome, &options.loss, data.validation())?;
    Ok(Trained { spec, network, initial, legs, outcome, held_out_error })
}

/// Saves checkpoints, takes times, and tells how it goes.
struct SceneWatch<'w, 'a> {
    context: &'w mut Context<'a>,
    spec: &'w ModelSpec,
    options: &'w TrainingOptions,
    times: TrainingTimes,
    /// The leg under way, when it began, and the seconds before: of other legs, and of its own in
    /// the run that is gone on with.
    under_way: Option<(TrainingStage, Instant, f64, f64)>,
    earlier: TrainingTimes,
}

impl<'w, 'a> SceneWatch<'w, 'a> {
    fn new(
        context: &'w mut Context<'a>,
        spec: &'w ModelSpec,
        options: &'w TrainingOptions,
    ) -> Self {
        let earlier = context.earlier_times(&spec.name);
        let times = TrainingTimes { model: spec.name.clone(), ..TrainingTimes::default() };
        Self { context, spec, options, times, under_way: None, earlier }
    }

    fn file(&self, leg: TrainingStage) -> PathBuf {
        let (scene, folder) = (self.context.scene, self.context.folder);
        folder.file_of_model(scene, "checkpoint", self.spec, &leg.suffix())
    }
}

impl TrainingObserver for SceneWatch<'_, '_> {
    fn earlier(&mut self, leg: TrainingStage) -> Result<Option<Checkpoint>, Error> {
        let file = self.file(leg);
        let found = earlier_checkpoint(&file, self.context.folder.resumes())?;
        let before = self.times.before();
        let resumed_at = found.as_ref().map_or(0, |checkpoint| checkpoint.last().iteration);
        let of_leg = match leg {
            TrainingStage::Last => {
                self.times.points = std::mem::take(&mut self.earlier.points);
                self.times.points.retain(|(iteration, _)| *iteration <= resumed_at);
                self.times.points.last().map_or(0.0, |(_, seconds)| seconds - before)
            }
            _ => {
                let name = leg.name();
                let earlier = self.earlier.legs.iter().find(|(other, _)| *other == name);
                let seconds = match (&found, earlier) {
                    (Some(_), Some((_, seconds))) => *seconds,
                    _ => 0.0,
                };
                self.times.legs.push((name, seconds));
                seconds
            }
        };
        self.under_way = Some((leg, Instant::now(), before, of_leg));
        Ok(found)
    }

    fn observe(&mut self, leg: TrainingStage, progress: Progress<'_>) -> Result<Control, Error> {
        let record = progress.record;
        if let Some((_, start, before, of_leg)) = &self.under_way {
            let seconds = of_leg + start.elapsed().as_secs_f64();
            match leg {
                TrainingStage::Last
                    if record.validation.is_some() || progress.checkpoint.is_some() =>
                {
                    self.times.points.push((record.iteration, before + seconds));
                }
                TrainingStage::Last => {}
                _ => self.times.legs.last_mut().into_iter().for_each(|last| last.1 = seconds),
            }
        }
        if let Some(checkpoint) = progress.checkpoint {
            save_checkpoint(&self.file(leg), checkpoint)?;
            self.context.save_training_times(&self.times)?;
        }
        let iterations = leg.iterations(self.options);
        let model = match leg {
            TrainingStage::Last => self.spec.name.clone(),
            _ => format!("{}, {}", self.spec.name, leg.name()),
        };
        self.context.tell(Event::Iteration { model: &model, record, iterations });
        Ok(if self.context.interrupted() { Control::Interrupt } else { Control::Continue })
    }
}

/// A network that was trained elsewhere, judged by the pairs that choose among the models of a training.
fn of_file(context: &Context<'_>, data: &DataSets, spec: ModelSpec) -> Result<Trained, Halt> {
    let (scene, folder) = (context.scene, context.folder);
    let Some(path) = &spec.network.path else {
        let (place, key) = (format!("scene {}", scene.name), "models.network.path");
        return Err(Error::Missing { place, key, needed_by: spec.name }.into());
    };
    let mut stored = read_network(path, context.subject()?, context.flow_time()?)?;
    let model = stored.model.clone();
    let loss = loss_of(&scene.setup.training_of(&spec).loss, context.subject()?, data)?;
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
    let (network, legs) = (spec.name.clone(), Vec::new());
    Ok(Trained { network, spec, initial: model, legs, outcome, held_out_error })
}
