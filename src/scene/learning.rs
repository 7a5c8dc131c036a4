//! Training the networks of a scene, with checkpoints.

use super::context::{Context, DataSets, Halt};
use super::log::TrainingTimes;
use super::run::Event;
use super::setup::{Attempt, ModelSpec};
use super::subject::Subject;
use crate::error::Error;
use crate::flow::Pairs;
use crate::io::{
    Provenance, StoredModel, earlier_checkpoint, file_digest, import_weights, load_model,
    save_checkpoint, save_model,
};
use crate::network::Model;
use crate::train::{
    Checkpoint, Control, InitialModels, Loss, Objective, Outcome, Progress, RampStage, Scheduled,
    StageData, StageResult, Stop, TrainingObserver, TrainingOptions, TrainingRecord, TrainingStage,
    fit_rotation, train_schedule,
};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A network before and after training.
pub(super) struct Trained {
    pub(super) spec: ModelSpec,
    /// The name that the scene gives the network, for any of its seeds.
    pub(super) network: String,
    pub(super) initial: Model,
    /// What led to the last leg of its training.
    pub(super) legs: Vec<StageResult>,
    pub(super) outcome: Outcome,
    /// The mean squared error on the held-out pairs, whatever the weights of the loss.
    pub(super) held_out_error: Option<f64>,
}

/// The mean squared error of what a training has kept on the held-out pairs.
pub(super) fn held_out_error(
    outcome: &Outcome,
    loss: &Loss,
    held_out: Option<&Pairs>,
) -> Result<Option<f64>, Error> {
    match held_out {
        Some(held_out) if !loss.is_plain_on_held_out() => {
            let objective = Objective::new(&Loss::MeanSquaredError, held_out)?;
            Ok(Some(objective.value(outcome.model.composition())))
        }
        _ => Ok(outcome.best.validation),
    }
}

impl Trained {
    /// After training.
    pub(super) fn model(&self) -> &Model {
        &self.outcome.model
    }
}

/// Trains a network, from its checkpoint where the run goes on with one, and writes
/// its file.
pub(super) fn learn(
    context: &mut Context<'_>,
    data: &DataSets,
    attempt: Attempt,
) -> Result<Trained, Halt> {
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
        ..Provenance::of(&scene.name)
    };
    let stored =
        StoredModel { model: outcome.model.clone(), units: data.units.clone(), provenance };
    save_model(&folder.file_of_model(scene, "model", &spec, ".json"), &stored)?;
    let held_out_error = held_out_error(&outcome, &options.loss, data.validation())?;
    Ok(Trained { spec, network, initial, legs, outcome, held_out_error })
}

/// The loss of a scene on its training pairs.
pub(super) fn loss_of(loss: &Loss, subject: Subject<'_>, data: &DataSets) -> Result<Loss, Error> {
    let action = subject.circle_action();
    let angle = fit_rotation(&data.training, &action);
    loss.for_pairs(&action.into(), &[angle], &data.training)
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

/// The network of a model's file, or of weights of a gyroceptron, which is to stand for a map of this
/// time of the subject.
///
/// # Errors
/// Those of [`load_model`] and [`import_weights`]; when the model is of other degrees of freedom,
/// another ε, flow time or action, or of units of its own.
pub(super) fn read_network(
    path: &Path,
    subject: Subject<'_>,
    time: f64,
) -> Result<StoredModel, Error> {
    if path.extension().is_none_or(|ending| ending != "json") {
        let action = subject.circle_action().into();
        let model = import_weights(path, &action, subject.epsilon(), None)?;
        let (data, flow_time) = (Some(file_digest(path)?), Some(time));
        let provenance = Provenance { data, flow_time, ..Provenance::of("import") };
        return Ok(StoredModel { model, units: None, provenance });
    }
    let stored = load_model(path)?;
    let place = path.display().to_string();
    let of_another = |expected: String, found: String| Err(Error::content(&place, expected, found));
    let architecture = stored.model.architecture();
    if architecture.dof != subject.dof() {
        let expected = format!("a model of {} degrees of freedom", subject.dof());
        return of_another(expected, architecture.dof.to_string());
    }
    if let Some(action) = architecture.action()
        && architecture.keeps_its_planes()
        && !subject.is_turned_by(&action)
    {
        let expected = "circles that turn the planes as those of the system do together";
        return of_another(expected.into(), format!("{:?}", action.circles()));
    }
    let own_time = architecture.has_flow_time().then_some(architecture.flow_time);
    if architecture.has_circle() && architecture.epsilon != subject.epsilon() {
        let expected = format!("a model of ε = {}", subject.epsilon());
        return of_another(expected, architecture.epsilon.to_string());
    }
    for own in own_time.into_iter().chain(stored.provenance.flow_time) {
        if own != time {
            return of_another(format!("a model of flow time {time}"), own.to_string());
        }
    }
    if stored.units.is_some() {
        let expected = "a model in the coordinates of the system";
        return of_another(expected.into(), "one with units of its own".into());
    }
    Ok(stored)
}
