//! What the jobs of a scene take on this machine: each kind of training is begun, on a part of its pairs.

use super::context::Context;
use super::event::{Event, Observer, Unobserved};
use super::folder::Folder;
use super::plan::{Job, Task};
use super::registry::Scene;
use super::setup::{Data, ModelSpec, SeededTraining};
use crate::train::{TrainingOptions, TrainingStage};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// Pairs of a trial, and lines of each machine.
const PAIRS: f64 = 512.0;
const LINES: usize = 8;
/// A trial of a training ends after so long, once an iteration is done.
const LONG_ENOUGH: Duration = Duration::from_millis(300);

impl Scene {
    /// Estimates the seconds that each of its jobs takes on this machine if it does all its iterations. For that, a
    /// part of the pairs is made and each network is trained on it for a moment. None for the report, where the
    /// estimate fails, and for all that was left when the observer interrupted; it hears of no events.
    pub fn estimate(&self, jobs: &[Job], observer: &dyn Observer) -> Vec<Option<f64>> {
        let mut out = vec![None; jobs.len()];
        let found = self.with_found_actions(&mut Unobserved).ok().flatten();
        let scene = found.as_ref().unwrap_or(self);
        let parts: Vec<(Option<&str>, &Self)> = match &scene.parts[..] {
            [] => vec![(None, scene)],
            parts => parts.iter().map(|part| (Some(&part.name[..]), part)).collect(),
        };
        for (name, part) in parts.into_iter().take_while(|_| !observer.interrupted()) {
            let own = |job: &Job| job.part.as_deref() == name && !matches!(job.task, Task::Merge);
            if !jobs.iter().any(own) {
                continue;
            }
            let Some(trial) = Trial::of(part, observer) else { continue };
            for (job, seconds) in jobs.iter().zip(&mut out).filter(|(job, _)| own(job)) {
                *seconds = trial.seconds(part, job).filter(|seconds| seconds.is_finite());
            }
        }
        out
    }

    /// The scene with fewer pairs and without the stages that lead up to a training, and the share of its pairs that it
    /// has.
    fn for_a_trial(&self) -> (Self, f64) {
        let mut short = self.clone();
        let mut share = 1.0;
        if let Some(data) = &mut short.setup.data {
            share = fewer(data);
        }
        let single = |training: &mut TrainingOptions| {
            (training.starts, training.fresh_twists, training.plateau) = (None, None, None);
            training.ramp.clear();
            training.checkpoint_every = u64::MAX;
        };
        single(&mut short.setup.training);
        for model in &mut short.setup.models {
            model.training.as_mut().map(single);
            model.seeds = None;
        }
        short.studies.clear();
        short.plots.clear();
        (short, share)
    }
}

/// Leaves a part of the pairs; which share it is.
fn fewer(data: &mut Data) -> f64 {
    if let Some(lines) = &mut data.lines {
        let all = lines.lines;
        lines.lines = all.min(LINES);
        return lines.lines as f64 / all as f64;
    }
    let orbit = data.orbit as f64;
    let pairs = |data: &Data| data.windows.iter().map(|w| orbit * w.samples as f64).sum::<f64>();
    let all = pairs(data);
    // A few of each map of a family, also of those that are held out.
    let maps = data.epsilons.len().max(1) * data.flow_times.len().max(1);
    let least = 4.0 * maps as f64 / if data.validation > 0.0 { data.validation } else { 1.0 };
    let kept = if least > PAIRS { least } else { PAIRS };
    if !(all > kept) {
        return 1.0;
    }
    for window in &mut data.windows {
        window.samples = (window.samples as f64 * kept / all).ceil() as usize;
    }
    pairs(data) / all
}

/// What a trial of a part has measured.
struct Trial {
    /// Seconds of the pairs of its set-up.
    data: Option<f64>,
    /// Seconds of an iteration on all of them, of each network.
    iterations: Vec<(String, f64)>,
}

impl Trial {
    /// None where no temporary folder can be made.
    fn of(scene: &Scene, observer: &dyn Observer) -> Option<Self> {
        let (short, share) = scene.for_a_trial();
        let declared = short.declared();
        let path = tempfile::tempdir().ok()?;
        let folder = Folder::open(path.path(), false, false).ok()?;
        let mut watch = TrialObserver::of(observer);
        let start = Instant::now();
        let mut context = Context::new(&declared, &folder, &[], &mut watch);
        let made = context.data().is_ok();
        let data = made.then(|| start.elapsed().as_secs_f64() / share);
        let pairs = context.data().map_or(0, |data| data.training.len());
        let mut of = |training: SeededTraining| {
            // It is interrupted, or over, or fails; what it took until then is watched.
            let ended = context.of_setup(&training.spec.name);
            drop(ended);
            let more = more_pairs_an_iteration(scene, &training.spec, pairs, share);
            (training.network, more)
        };
        let own = short.setup.trainings().filter(|training| !training.spec.network.is_of_file());
        let own = own.take_while(|_| !observer.interrupted());
        let networks: Vec<_> = if made { own.map(&mut of).collect() } else { Vec::new() };
        let seconds = |(network, more): (String, Option<f64>)| {
            let each = watch.seconds_an_iteration(&network)?;
            Some((network, each * more?))
        };
        let iterations = networks.into_iter().filter_map(seconds).collect();
        Some(Self { data, iterations })
    }

    fn seconds(&self, scene: &Scene, job: &Job) -> Option<f64> {
        let setup = &scene.setup;
        let (epsilon, time) = (setup.target()?.epsilon(), setup.flow_time?);
        let (training, of_time, from) = match &job.task {
            Task::Merge => return None,
            Task::Data(None) => return self.data,
            // As many oscillations more as the time is longer and ε smaller.
            Task::Data(Some((other, long))) => {
                return Some(self.data? * (long / time) * (epsilon / other));
            }
            Task::Own(training) => (training, time, false),
            Task::OfStudy(of) => (&of.training, of.flow_time, of.from.is_some()),
        };
        let (_, each) = self.iterations.iter().find(|(name, _)| *name == training.network)?;
        let options = setup.training_of(&training.spec);
        let ramp = setup.leading_up(options, epsilon, of_time, from);
        let options = TrainingOptions { ramp, ..options.clone() };
        let stages = TrainingStage::all(&options);
        let count = stages.into_iter().map(|stage| stage.iterations(&options)).sum::<u64>();
        Some(each * count as f64)
    }
}

/// How many times as many pairs an iteration of a training looks at as one of its trial, which has this share of them.
fn more_pairs_an_iteration(
    scene: &Scene,
    spec: &ModelSpec,
    pairs: usize,
    share: f64,
) -> Option<f64> {
    let (target, time) = (scene.setup.target()?, scene.setup.flow_time?);
    let action = target.torus();
    let architecture = spec.network.architecture(&action, target.epsilon(), time).ok()?;
    let optimiser = &scene.setup.training_of(spec).optimiser;
    let looks_at = |all: usize| optimiser.pairs_of_iteration(&architecture, all) as f64;
    Some(looks_at((pairs as f64 / share).round() as usize) / looks_at(pairs))
}

/// Takes the times of the iterations of each network, and ends each training after a moment.
struct TrialObserver<'a> {
    /// Who may interrupt it before.
    observer: &'a dyn Observer,
    /// When the stage under way began.
    start: Option<Instant>,
    /// The network, how many it has done, and the time since then.
    iterations: Vec<(String, u64, Duration)>,
    long_enough: bool,
}

impl<'a> TrialObserver<'a> {
    fn of(observer: &'a dyn Observer) -> Self {
        Self { observer, start: None, iterations: Vec::new(), long_enough: false }
    }

    fn seconds_an_iteration(&self, network: &str) -> Option<f64> {
        let mut of_network = self.iterations.iter().filter(|(model, _, _)| model == network);
        let (_, first, begun) = of_network.next()?;
        let seconds = match of_network.next_back() {
            // The first takes what it takes to begin, too.
            Some((_, last, ended)) => (*ended - *begun).as_secs_f64() / (last - first) as f64,
            None => begun.as_secs_f64(),
        };
        Some(seconds)
    }
}

impl Observer for TrialObserver<'_> {
    fn event(&mut self, event: Event<'_>) {
        match event {
            Event::Stage(_) => (self.start, self.long_enough) = (Some(Instant::now()), false),
            Event::Iteration { model, record, .. } => {
                let since = self.start.map(|start| start.elapsed()).unwrap_or_default();
                // An interrupted training ends with its last record once more.
                let known = |(of, done, _): &(String, u64, Duration)| {
                    of == model && *done == record.iteration
                };
                if !self.iterations.last().is_some_and(known) {
                    self.iterations.push((model.to_owned(), record.iteration, since));
                }
                self.long_enough = since >= LONG_ENOUGH;
            }
            Event::Progress { .. } | Event::Trained { .. } | Event::Lost { .. } => {}
        }
    }

    fn interrupted(&self) -> bool {
        self.long_enough || self.observer.interrupted()
    }

    fn interruption(&self) -> Option<Arc<AtomicBool>> {
        self.observer.interruption()
    }
}
