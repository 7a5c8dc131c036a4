//! Running a scene: data, training, certificate, roll-out, report.

use super::declaration::{ModelSpec, Plot, RolloutSpec, Scene, parse};
use super::figures::figure;
use super::plot::draw;
use super::report::{ModelReport, Report, RolloutReport};
use super::results::{Timing, Timings, Trajectories, network_invariant};
use crate::error::Error;
use crate::flow::{Pairs, Reference, Window, sample};
use crate::io::{
    Provenance, StoredModel, load_checkpoint, save_checkpoint, save_model, write_atomically,
};
use crate::measure::{certify, component_errors, distance, drift, limiting_flow_error};
use crate::network::{Model, Rollout, Stream, rollout};
use crate::scalar::max_or_nan;
use crate::system::{Hamiltonian, System};
use crate::train::{Control, Progress, Stop, TrainingRecord, train};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What a run tells while it goes on.
#[derive(Debug)]
pub enum Event<'a> {
    /// A stage begins.
    Stage(&'a str),
    /// An iteration of training is done.
    Iteration {
        /// The network's name.
        model: &'a str,
        /// Its newest record.
        record: TrainingRecord,
        /// The most iterations there will be.
        iterations: u64,
    },
    /// A network is trained.
    Trained {
        /// The network's name.
        model: &'a str,
        /// Why training ended.
        stop: Stop,
        /// The record of the model that was kept.
        best: TrainingRecord,
    },
}

/// Listens to a run, and may stop it.
pub trait Observer {
    /// Something happened.
    fn event(&mut self, event: Event<'_>);

    /// True when the run should stop at the next iteration, with a checkpoint.
    fn interrupted(&self) -> bool {
        false
    }
}

/// The folder of a run.
#[derive(Clone, Debug)]
pub struct Folder {
    path: PathBuf,
    resume: bool,
}

/// The scene as it was run: what a folder is resumed and repeated from.
const AS_RUN: &str = "as-run.toml";
/// The files that mark a folder as one of a run.
const MARKS: [&str; 5] = ["report.json", "report.md", AS_RUN, "checkpoint", "model.json"];

impl Folder {
    /// Makes the folder and tests that it can be written.
    ///
    /// # Errors
    /// [`Error::OutputExists`] when it holds a run that is neither resumed nor
    /// overwritten; [`Error::Write`] when it cannot be written.
    pub fn open(path: &Path, resume: bool, overwrite: bool) -> Result<Self, Error> {
        let holds_run = MARKS.iter().any(|mark| path.join(mark).exists());
        if holds_run && !resume && !overwrite {
            return Err(Error::OutputExists { path: path.to_owned() });
        }
        if resume && !path.join(AS_RUN).exists() {
            return Err(Error::content(
                path.display(),
                format!("an earlier run to resume, with its {AS_RUN}"),
                "none",
            ));
        }
        std::fs::create_dir_all(path).map_err(|reason| Error::write(path, reason))?;
        let folder = Self { path: path.to_owned(), resume };
        tempfile::Builder::new()
            .prefix(".gyroceptron-")
            .tempfile_in(path)
            .map_err(|reason| Error::write(path, reason))?;
        if holds_run && !resume {
            folder.clear()?;
        }
        Ok(folder)
    }

    /// Removes the files of the run that the folder holds, by their names, and
    /// nothing else.
    fn clear(&self) -> Result<(), Error> {
        let mut names: Vec<String> = MARKS.iter().map(|mark| (*mark).to_owned()).collect();
        names.push("timings.json".into());
        names.extend(Plot::ALL.iter().map(|plot| plot.file().to_owned()));
        if let Ok(text) = std::fs::read_to_string(self.file(AS_RUN))
            && let Ok(earlier) = parse(AS_RUN, &text)
        {
            for spec in &earlier.models {
                names.push(format!("checkpoint-{}", spec.name));
                names.push(format!("model-{}.json", spec.name));
            }
        }
        for name in names {
            let path = self.file(&name);
            if path.is_file() {
                std::fs::remove_file(&path).map_err(|reason| Error::write(&path, reason))?;
            }
        }
        Ok(())
    }

    /// A file in the folder.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// `model.json`, or `model-NAME.json` where a scene has several.
    fn own(&self, scene: &Scene, stem: &str, spec: &ModelSpec, ending: &str) -> PathBuf {
        if scene.models.len() == 1 {
            self.file(&format!("{stem}{ending}"))
        } else {
            self.file(&format!("{stem}-{}{ending}", spec.name))
        }
    }
}

/// Runs a scene into a folder; None when the observer interrupted it, in which
/// case a checkpoint is there to resume from.
///
/// # Errors
/// When the scene is incomplete, a computation fails, a checkpoint does not
/// belong to the scene, or a file cannot be written.
pub fn run(
    scene: &Scene,
    folder: &Folder,
    observer: &mut dyn Observer,
) -> Result<Option<Report>, Error> {
    let (system, time, data) = scene.experiment()?;
    let action = system.circle_action();
    let text = toml::to_string_pretty(scene)
        .map_err(|reason| Error::write(&folder.file(AS_RUN), reason))?;
    let save_scene =
        || write_atomically(&folder.file(AS_RUN), |out| out.write_all(text.as_bytes()));
    // A resumed run that turns out to be another one must not leave its name.
    if !folder.resume {
        save_scene()?;
    }

    observer.event(Event::Stage("reference flow of the training and held-out points"));
    let start = Instant::now();
    let points =
        sample(&data.windows, system.dof(), &mut Stream::new(scene.seed, "data/training"))?;
    let held_out_windows: Vec<_> = data
        .windows
        .iter()
        .map(|window| Window {
            samples: (window.samples as f64 * data.validation).round() as usize,
            ..window.clone()
        })
        .collect();
    let held_out_points =
        sample(&held_out_windows, system.dof(), &mut Stream::new(scene.seed, "data/held-out"))?;
    let (pairs, mut reference_error) = Pairs::of_flow(system, points, time)?;
    let held_out = if held_out_points.is_empty() {
        None
    } else {
        let (held_out, error) = Pairs::of_flow(system, held_out_points, time)?;
        reference_error = reference_error.max(error);
        Some(held_out)
    };
    let mut timings = Timings { data_seconds: start.elapsed().as_secs_f64(), ..Timings::default() };
    let earlier: Timings = if folder.resume {
        std::fs::read(folder.file("timings.json"))
            .ok()
            .and_then(|bytes| serde_json::from_slice(&bytes).ok())
            .unwrap_or_default()
    } else {
        Timings::default()
    };

    let mut trained = Vec::new();
    for spec in &scene.models {
        observer.event(Event::Stage(&format!("training {}", spec.name)));
        let architecture = spec.network.architecture(&action, system.epsilon());
        let theta = system.limiting_frequency() * time;
        let model = architecture.initialise(spec.weights, theta, scene.seed)?;
        let checkpoint_file = folder.own(scene, "checkpoint", spec, "");
        let resume = if folder.resume && checkpoint_file.exists() {
            Some(load_checkpoint(&checkpoint_file)?)
        } else {
            None
        };
        let mut timing = earlier
            .models
            .iter()
            .find(|t| t.model == spec.name)
            .cloned()
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
                save_timings(folder, &all)?;
            }
            let iterations = scene.training.iterations;
            observer.event(Event::Iteration { model: &spec.name, record, iterations });
            Ok(if observer.interrupted() { Control::Interrupt } else { Control::Continue })
        };
        let outcome =
            train(&model, &pairs, held_out.as_ref(), &scene.training, resume, &mut observe)?;
        timings.models.push(timing);
        let (stop, best) = (outcome.stop, outcome.best);
        observer.event(Event::Trained { model: &spec.name, stop, best });
        if stop == Stop::Interrupted {
            return Ok(None);
        }
        let provenance = Provenance {
            seed: Some(scene.seed),
            data: Some(pairs.digest()),
            flow_time: Some(time),
            validation: best.validation,
            ..Provenance::of(&scene.name)
        };
        let stored = StoredModel { model: outcome.model.clone(), provenance };
        save_model(&folder.own(scene, "model", spec, ".json"), &stored)?;
        trained.push((spec, model, outcome));
    }

    let reference = match &scene.rollout {
        None => None,
        Some(request) => {
            observer.event(Event::Stage("reference trajectories"));
            let start = Instant::now();
            let result = reference_rollout(system, request, time)?;
            timings.reference_rollout_seconds = Some(start.elapsed().as_secs_f64());
            Some((request, result))
        }
    };

    let mut models = Vec::new();
    let mut trajectories = Vec::new();
    for ((spec, initial, outcome), timing) in trained.iter().zip(&mut timings.models) {
        let model = &outcome.model;
        let certificate = scene.certificate.map(|options| {
            observer.event(Event::Stage(&format!("structure certificate of {}", spec.name)));
            certify(model, options)
        });
        let rolled = match &reference {
            None => None,
            Some((request, (values, _))) => {
                observer.event(Event::Stage(&format!("roll-out of {}", spec.name)));
                let start = Instant::now();
                let own = model_rollout(model, request)?;
                timing.rollout_seconds = Some(start.elapsed().as_secs_f64());
                let report = compare(system, model, &own, values);
                trajectories.push((spec.name.clone(), model, own));
                Some(report)
            }
        };
        models.push(ModelReport {
            name: spec.name.clone(),
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
                        || (held_out.is_none() && r.iteration % scene.training.validate_every == 0)
                })
                .collect(),
            component_errors: match &held_out {
                Some(held_out) => component_errors(model.composition(), held_out)?,
                None => Vec::new(),
            },
            initial_theta: initial.gyroceptron().map(|g| g.theta()),
            theta: model.gyroceptron().map(|g| g.theta()),
            certificate,
            rollout: rolled,
        });
    }

    let report = Report {
        crate_version: env!("CARGO_PKG_VERSION").into(),
        scene: scene.clone(),
        data_digest: pairs.digest(),
        training_pairs: pairs.len(),
        held_out_pairs: held_out.as_ref().map_or(0, Pairs::len),
        reference_error,
        rotation_error: held_out.as_ref().map(|set| limiting_flow_error(system, set, time)),
        rollout_reference_error: reference.as_ref().map(|(_, (_, error))| *error),
        models,
    };
    observer.event(Event::Stage("report"));
    let mut figures = Vec::new();
    for plot in &scene.plots {
        let Some((name, caption, panels)) =
            figure(*plot, &report, system, time, &timings, reference.as_ref(), &trajectories)
        else {
            continue;
        };
        draw(&folder.file(&name), &panels)?;
        figures.push((name, caption));
    }
    save_scene()?;
    save_timings(folder, &timings)?;
    let markdown = report.markdown(&timings_markdown(&timings, &report), &figures);
    write_atomically(&folder.file("report.md"), |out| out.write_all(markdown.as_bytes()))?;
    write_atomically(&folder.file("report.json"), |out| {
        serde_json::to_writer_pretty(&mut *out, &report)?;
        writeln!(out)
    })?;
    Ok(Some(report))
}

fn save_timings(folder: &Folder, timings: &Timings) -> Result<(), Error> {
    write_atomically(&folder.file("timings.json"), |out| {
        serde_json::to_writer_pretty(out, timings)?;
        Ok(())
    })
}

fn timings_markdown(timings: &Timings, report: &Report) -> String {
    let mut out = format!("- reference flow of the pairs: {:.1} s\n", timings.data_seconds);
    for timing in &timings.models {
        if let Some((iterations, seconds)) = timing.points.last() {
            out.push_str(&format!(
                "- training of `{}`: {seconds:.1} s, {:.1} iterations a second\n",
                timing.model,
                *iterations as f64 / seconds
            ));
            let model = report.models.iter().find(|m| m.name == timing.model);
            for (level, iteration) in model.map(ModelReport::milestones).unwrap_or_default() {
                if let Some((_, seconds)) = timing.points.iter().find(|(i, _)| *i == iteration) {
                    out.push_str(&format!(
                        "  - held-out error ≤ {level:.0e} after {iteration} iterations, \
                         {seconds:.1} s\n"
                    ));
                }
            }
        }
        if let (Some(seconds), Some(rollout)) = (timing.rollout_seconds, &report.scene.rollout) {
            out.push_str(&format!(
                "- roll-out of `{}`: {seconds:.2} s for {} trajectories of {} steps\n",
                timing.model,
                rollout.initial.len(),
                rollout.steps
            ));
        }
    }
    if let Some(seconds) = timings.reference_rollout_seconds {
        out.push_str(&format!(
            "- the same trajectories by the reference flow, at two resolutions: {seconds:.2} s\n"
        ));
    }
    out
}

/// The reference trajectories and the largest difference of two resolutions at
/// their ends.
fn reference_rollout(
    system: &System,
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
