//! An experiment: data, training, certificate, roll-out, comparison.

use super::comparison::Field;
use super::counted::Counted;
use super::declaration::{Data, ModelSpec, RolloutSpec, Scene};
use super::figures::{Results, figure};
use super::plot::draw;
use super::report::{Evaluations, Experiment, ModelReport, RolloutReport};
use super::results::{ReferenceRollout, Timing, Timings, Trajectories, network_invariant};
use super::run::{Event, Folder, Observer};
use crate::error::Error;
use crate::flow::{Pairs, Reference, Window, sample};
use crate::io::{Provenance, StoredModel, load_checkpoint, save_checkpoint, save_model};
use crate::measure::{certify, component_errors, distance, drift, limiting_flow_error};
use crate::network::{Model, Rollout, Stream, rollout};
use crate::scalar::max_or_nan;
use crate::system::{Hamiltonian, System};
use crate::train::{Control, Outcome, Progress, Stop, train};
use rayon::prelude::*;
use std::time::Instant;

/// Files drawn, with their captions.
pub(super) type Drawn = Vec<(String, String)>;

/// Runs an experiment; None when the observer interrupted its training.
pub(super) fn experiment(
    scene: &Scene,
    folder: &Folder,
    observer: &mut dyn Observer,
    timings: &mut Timings,
) -> Result<Option<(Experiment, Drawn)>, Error> {
    let (system, time, data) = scene.experiment()?;
    let counted = Counted::new(system);
    let mut evaluations = Evaluations::default();

    observer.event(Event::Stage("reference flow of the training and held-out points"));
    let start = Instant::now();
    let sets = Sets::of_flow(scene, &counted, time, data)?;
    timings.data_seconds = Some(start.elapsed().as_secs_f64());
    evaluations.of_data = counted.take();

    let mut trained = Vec::new();
    for spec in &scene.models {
        let Some(own) = learn(scene, folder, observer, timings, &sets, spec)? else {
            return Ok(None);
        };
        evaluations.of_training(&own.outcome, &sets.pairs, sets.held_out.as_ref());
        trained.push(own);
    }

    let reference: Option<ReferenceRollout<'_>> = match &scene.rollout {
        None => None,
        Some(request) => {
            observer.event(Event::Stage("reference trajectories"));
            let start = Instant::now();
            let result = reference_rollout(&counted, request, time)?;
            timings.reference_rollout_seconds = Some(start.elapsed().as_secs_f64());
            evaluations.of_reference_rollout = counted.take();
            Some((request, result))
        }
    };

    let mut models = Vec::new();
    let mut trajectories = Vec::new();
    for (own, timing) in trained.iter().zip(&mut timings.models) {
        let (name, model) = (&own.spec.name, &own.outcome.model);
        let certificate = scene.certificate.map(|options| {
            observer.event(Event::Stage(&format!("structure certificate of {name}")));
            certify(model, options)
        });
        if let Some(certificate) = &certificate {
            evaluations.certificate +=
                certificate.rows.iter().map(|r| r.samples as u64).sum::<u64>();
        }
        let rolled = match &reference {
            None => None,
            Some((request, (values, _))) => {
                observer.event(Event::Stage(&format!("roll-out of {name}")));
                let start = Instant::now();
                let moved = model_rollout(model, request)?;
                timing.rollout_seconds = Some(start.elapsed().as_secs_f64());
                evaluations.rollout += (request.steps * request.initial.len()) as u64;
                let report = compare(system, model, &moved, values);
                trajectories.push((name.clone(), model, moved));
                Some(report)
            }
        };
        let errors = match &sets.held_out {
            Some(held_out) => component_errors(model.composition(), held_out)?,
            None => Vec::new(),
        };
        models.push(own.report(scene, errors, certificate, rolled));
    }

    if let Some(spec) = &scene.work_precision {
        observer.event(Event::Stage("error against run time"));
        let field = Field {
            spec,
            system,
            time,
            pairs: sets.held_out.as_ref().unwrap_or(&sets.pairs),
            pairs_error: sets.reference_error,
            reference: reference.as_ref(),
            models: trained.iter().map(|own| (&own.spec.name[..], &own.outcome.model)).collect(),
        };
        timings.comparison = Some(field.compare()?);
        evaluations.jacobians = field.jacobian_count();
    }

    let report = Experiment {
        data_digest: sets.pairs.digest(),
        training_pairs: sets.pairs.len(),
        held_out_pairs: sets.held_out.as_ref().map_or(0, Pairs::len),
        reference_error: sets.reference_error,
        rotation_error: sets
            .held_out
            .as_ref()
            .map(|held_out| limiting_flow_error(system, held_out, time)),
        rollout_reference_error: reference.as_ref().map(|(_, (_, error))| *error),
        models,
        error_against_time: timings.comparison.as_ref().map(|own| own.without_times()),
        evaluations,
    };
    let results = Results {
        report: &report,
        system,
        time,
        timings,
        reference: reference.as_ref(),
        own: &trajectories,
    };
    let mut drawn = Vec::new();
    for plot in &scene.plots {
        if let Some((name, caption, panels)) = figure(*plot, &results) {
            draw(&folder.file(&name), &panels)?;
            drawn.push((name, caption));
        }
    }
    Ok(Some((report, drawn)))
}

/// The pairs of an experiment.
struct Sets {
    pairs: Pairs,
    held_out: Option<Pairs>,
    reference_error: f64,
}

impl Sets {
    fn of_flow(scene: &Scene, system: &Counted<'_>, time: f64, data: &Data) -> Result<Self, Error> {
        let points = |windows: &[Window], stream| {
            sample(windows, system.dof(), &mut Stream::new(scene.seed, stream))
        };
        let held_out_windows: Vec<_> = data
            .windows
            .iter()
            .map(|window| Window {
                samples: (window.samples as f64 * data.validation).round() as usize,
                ..window.clone()
            })
            .collect();
        let held_out_points = points(&held_out_windows, "data/held-out")?;
        let (pairs, mut reference_error) =
            Pairs::of_flow(system, points(&data.windows, "data/training")?, time)?;
        let held_out = if held_out_points.is_empty() {
            None
        } else {
            let (held_out, error) = Pairs::of_flow(system, held_out_points, time)?;
            reference_error = max_or_nan(reference_error, error);
            Some(held_out)
        };
        Ok(Self { pairs, held_out, reference_error })
    }
}

/// A network before and after training.
struct Trained<'a> {
    spec: &'a ModelSpec,
    initial: Model,
    outcome: Outcome,
}

/// Trains a network, from its checkpoint where the run goes on with one; None when
/// interrupted.
fn learn<'a>(
    scene: &Scene,
    folder: &Folder,
    observer: &mut dyn Observer,
    timings: &mut Timings,
    sets: &Sets,
    spec: &'a ModelSpec,
) -> Result<Option<Trained<'a>>, Error> {
    let (system, time, _) = scene.experiment()?;
    observer.event(Event::Stage(&format!("training {}", spec.name)));
    let architecture = spec.network.architecture(&system.circle_action(), system.epsilon());
    let theta = system.limiting_frequency() * time;
    let initial = architecture.initialise(spec.weights, theta, scene.seed)?;
    let checkpoint_file = folder.own(scene, "checkpoint", spec, "");
    let resume = if folder.resumes() && checkpoint_file.exists() {
        Some(load_checkpoint(&checkpoint_file)?)
    } else {
        None
    };
    let mut timing = folder
        .earlier_timings()
        .models
        .into_iter()
        .find(|t| t.model == spec.name)
        .unwrap_or_else(|| Timing { model: spec.name.clone(), ..Timing::default() });
    let resumed_at = resume.as_ref().map_or(0, |c| c.last().iteration);
    timing.points.retain(|(iteration, _)| *iteration <= resumed_at);
    let before = timing.points.last().map_or(0.0, |(_, seconds)| *seconds);
    let start = Instant::now();
    let mut observe = |progress: Progress<'_>| -> Result<Control, Error> {
        let record = progress.record;
        if record.validation.is_some() || progress.checkpoint.is_some() {
            let seconds = before + start.elapsed().as_secs_f64();
            timing.points.push((record.iteration, seconds));
        }
        if let Some(checkpoint) = progress.checkpoint {
            save_checkpoint(&checkpoint_file, checkpoint)?;
            let mut all = Timings { models: timings.models.clone(), ..Timings::default() };
            all.models.push(timing.clone());
            folder.save_timings(&all)?;
        }
        let iterations = scene.training.iterations;
        observer.event(Event::Iteration { model: &spec.name, record, iterations });
        Ok(if observer.interrupted() { Control::Interrupt } else { Control::Continue })
    };
    let held_out = sets.held_out.as_ref();
    let outcome = train(&initial, &sets.pairs, held_out, &scene.training, resume, &mut observe)?;
    timings.models.push(timing);
    let (stop, best) = (outcome.stop, outcome.best);
    observer.event(Event::Trained { model: &spec.name, stop, best });
    if stop == Stop::Interrupted {
        return Ok(None);
    }
    let provenance = Provenance {
        seed: Some(scene.seed),
        data: Some(sets.pairs.digest()),
        flow_time: Some(time),
        validation: best.validation,
        ..Provenance::of(&scene.name)
    };
    let stored = StoredModel { model: outcome.model.clone(), provenance };
    save_model(&folder.own(scene, "model", spec, ".json"), &stored)?;
    Ok(Some(Trained { spec, initial, outcome }))
}

impl Trained<'_> {
    fn report(
        &self,
        scene: &Scene,
        component_errors: Vec<f64>,
        certificate: Option<crate::measure::Certificate>,
        rollout: Option<RolloutReport>,
    ) -> ModelReport {
        let (outcome, model) = (&self.outcome, &self.outcome.model);
        let held_out = !component_errors.is_empty();
        ModelReport {
            name: self.spec.name.clone(),
            architecture: model.architecture(),
            parameters: model.composition().parameters().len(),
            stop: outcome.stop,
            last: outcome.history[outcome.history.len() - 1],
            best: outcome.best,
            history: outcome
                .history
                .iter()
                .copied()
                .filter(|r| {
                    r.validation.is_some()
                        || (!held_out && r.iteration % scene.training.validate_every == 0)
                })
                .collect(),
            component_errors,
            initial_theta: self.initial.gyroceptron().map(|g| g.theta()),
            theta: model.gyroceptron().map(|g| g.theta()),
            certificate,
            rollout,
        }
    }
}

/// The reference trajectories and the largest difference of two resolutions at
/// their ends.
fn reference_rollout(
    system: &Counted<'_>,
    request: &RolloutSpec,
    time: f64,
) -> Result<(Trajectories, f64), Error> {
    let interval = time * request.every as f64;
    let reference = Reference::calibrated(system, &request.initial.concat(), interval)?;
    let kept = request.steps / request.every + 1;
    let each: Vec<(Vec<Vec<f64>>, f64)> = request
        .initial
        .par_iter()
        .map(|initial| {
            let (mut fine, mut coarse) = (initial.clone(), initial.clone());
            let mut states = vec![initial.clone()];
            for _ in 1..kept {
                fine = reference.flow_with_error(system, &fine, interval)?.point;
                reference.flow(system, &mut coarse, interval)?;
                states.push(fine.clone());
            }
            Ok((states, distance(&fine, &coarse)))
        })
        .collect::<Result<_, Error>>()?;
    let dim = 2 * system.dof();
    let mut values = Vec::with_capacity(kept * each.len() * dim);
    for t in 0..kept {
        for (states, _) in &each {
            values.extend_from_slice(&states[t]);
        }
    }
    let error = each.iter().map(|(_, e)| *e).fold(0.0, max_or_nan);
    Ok((Trajectories { values, dim, count: each.len() }, error))
}

fn model_rollout(model: &Model, request: &RolloutSpec) -> Result<Trajectories, Error> {
    let initial = request.initial.concat();
    let values = rollout(
        model.composition(),
        &initial,
        Rollout { steps: request.steps, every: request.every },
    )?;
    Ok(Trajectories { values, dim: 2 * model.composition().dof(), count: request.initial.len() })
}

fn compare(
    system: &System,
    model: &Model,
    own: &Trajectories,
    reference: &Trajectories,
) -> RolloutReport {
    let last = reference.len() - 1;
    let trajectories = 0..reference.count;
    let largest_errors = trajectories
        .clone()
        .map(|m| {
            let mut largest = 0.0;
            for t in 0..=last {
                let error = distance(own.state(t, m), reference.state(t, m));
                largest = max_or_nan(largest, error);
            }
            largest
        })
        .collect();
    let final_errors = trajectories
        .clone()
        .map(|m| distance(own.state(last, m), reference.state(last, m)))
        .collect();
    let adiabatic = network_invariant(model, own).map(|mu| {
        trajectories.clone().map(|m| drift((0..=last).map(|t| mu[t * own.count + m]))).collect()
    });
    let reference_adiabatic = trajectories
        .map(|m| drift((0..=last).map(|t| system.adiabatic_invariant(reference.state(t, m)))))
        .collect();
    RolloutReport { largest_errors, final_errors, adiabatic, reference_adiabatic }
}
