//! Training the networks of a scene, with checkpoints.

use super::context::{Context, DataSets, Halt};
use super::log::TrainingTimes;
use super::run::Event;
use super::setup::{Attempt, ModelSpec, NetworkSpec};
use crate::error::Error;
use crate::io::{
    Provenance, StoredModel, file_digest, import_weights, load_checkpoint, save_checkpoint,
    save_model,
};
use crate::network::Model;
use crate::system::Hamiltonian;
use crate::train::{Control, Loss, Objective, Outcome, Progress, Stop, TrainingRecord, train};
use serde_json::json;
use std::time::Instant;

/// A network before and after training.
pub(super) struct Trained {
    pub(super) spec: ModelSpec,
    /// The name that the scene gives the network, for any of its seeds.
    pub(super) network: String,
    pub(super) initial: Model,
    pub(super) outcome: Outcome,
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
    let Attempt { spec, network, number } = attempt;
    let (scene, folder) = (context.scene, context.folder);
    let (system, time) = (context.system()?, context.flow_time()?);
    let options = scene.setup.training_of(&spec);
    let seed = scene.seed.wrapping_add(number);
    let (action, epsilon) = (system.circle_action(), system.epsilon());
    let Some(architecture) = spec.network.architecture(&action, epsilon, time) else {
        return of_file(context, data, spec);
    };
    let theta = system.limiting_frequency() * time;
    let initial = architecture.initialise(spec.weights, theta, seed)?;
    let checkpoint_file = folder.file_of_model(scene, "checkpoint", &spec, "");
    let resume = if folder.resumes() && checkpoint_file.exists() {
        Some(load_checkpoint(&checkpoint_file)?)
    } else {
        None
    };
    let resumed_at = resume.as_ref().map_or(0, |checkpoint| checkpoint.last().iteration);
    let mut times = earlier_times(context, &spec.name);
    times.points.retain(|(iteration, _)| *iteration <= resumed_at);
    let before = times.points.last().map_or(0.0, |(_, seconds)| *seconds);
    let start = Instant::now();
    let mut observe = |progress: Progress<'_>| -> Result<Control, Error> {
        let record = progress.record;
        if record.validation.is_some() || progress.checkpoint.is_some() {
            times.points.push((record.iteration, before + start.elapsed().as_secs_f64()));
        }
        if let Some(checkpoint) = progress.checkpoint {
            save_checkpoint(&checkpoint_file, checkpoint)?;
            let all: Vec<_> = context.training_times().iter().chain([&times]).collect();
            folder.save_timings(&json!({ "models": all }))?;
        }
        let iterations = options.iterations;
        context.tell(Event::Iteration { model: &spec.name, record, iterations });
        Ok(if context.interrupted() { Control::Interrupt } else { Control::Continue })
    };
    let (pairs, held_out) = (&data.training, data.held_out.as_ref());
    let outcome = train(&initial, pairs, held_out, options, resume, &mut observe)?;
    context.add_training_times(times);
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
        ..Provenance::of(&scene.name)
    };
    let stored = StoredModel { model: outcome.model.clone(), provenance };
    save_model(&folder.file_of_model(scene, "model", &spec, ".json"), &stored)?;
    Ok(Trained { spec, network, initial, outcome })
}

/// A network that was trained elsewhere, judged by the pairs.
fn of_file(context: &Context<'_>, data: &DataSets, spec: ModelSpec) -> Result<Trained, Halt> {
    let (scene, folder) = (context.scene, context.folder);
    let NetworkSpec::File { path: Some(path) } = &spec.network else {
        let (place, key) = (format!("scene {}", scene.name), "models.network.path");
        return Err(Error::Missing { place, key, needed_by: spec.name }.into());
    };
    let system = context.system()?;
    let model = import_weights(path, system.circle_action(), system.epsilon())?;
    let objective = Objective::new(&scene.setup.training_of(&spec).loss, &data.training)?;
    let held_out = data.held_out.as_ref();
    let validation = held_out.map(|pairs| Objective::new(&Loss::MeanSquaredError, pairs));
    let record = TrainingRecord {
        iteration: 0,
        evaluations: 0,
        loss: objective.value(model.composition()),
        pairs: data.training.len(),
        gradient: f64::NAN,
        validation: validation.transpose()?.map(|held_out| held_out.value(model.composition())),
    };
    let digest = Some(file_digest(path)?);
    let provenance = Provenance {
        data: digest,
        flow_time: Some(context.flow_time()?),
        validation: record.validation,
        ..Provenance::of(&scene.name)
    };
    let stored = StoredModel { model: model.clone(), provenance };
    save_model(&folder.file_of_model(scene, "model", &spec, ".json"), &stored)?;
    let outcome = Outcome {
        model: model.clone(),
        loss: record.loss,
        best: record,
        history: vec![record],
        curvatures: 0,
        stop: Stop::NotTrained,
    };
    Ok(Trained { network: spec.name.clone(), spec, initial: model, outcome })
}

/// The times of the run that is gone on with; none where they cannot be read.
fn earlier_times(context: &Context<'_>, model: &str) -> TrainingTimes {
    let read = || -> Option<Vec<TrainingTimes>> {
        let timings = context.folder.earlier_timings()?;
        serde_json::from_value(timings.get("models")?.clone()).ok()
    };
    read()
        .and_then(|all| all.into_iter().find(|times| times.model == model))
        .unwrap_or_else(|| TrainingTimes { model: model.into(), points: Vec::new() })
}
