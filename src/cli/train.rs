//! Training on pairs of one's own.

use super::Status;
use super::arguments::{OptimiserName, Train, UnitsOf, circle_action, option_of, positive};
use super::commands::{check_ending, guard_output, read_scene, use_threads};
use super::output::{json, out, width};
use super::progress::{Progress, line};
use gyroceptron::Error;
use gyroceptron::flow::{Condition, Pairs};
use gyroceptron::io::{
    PairsFile, Provenance, StoredModel, earlier_checkpoint, load_checkpoint, load_model,
    read_pairs, save_checkpoint, save_model,
};
use gyroceptron::layer::TorusAction;
use gyroceptron::network::{Architecture, Circles, LayerSizes, NetworkSpec};
use gyroceptron::scene::render::terminal;
use gyroceptron::scene::{
    Folder, ModelSpec, Note, Observer, OwnTraining, Reading, TrainingTimes, negative_epsilons,
    next_command,
};
use gyroceptron::train::{
    ActionFit, AdamOptions, Checkpoint, Control, LbfgsOptions, Leg, LevenbergMarquardtOptions,
    Loss, Optimiser, Place, Plateau, Preparation, Prepared, Progress as TrainingProgress, Starts,
    Stop, TrainingOptions, Watch, train_schedule,
};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

const EPSILON: f64 = 0.01;

/// The network and its training, as the scene has them.
fn of_scene(scene: Option<&str>) -> Result<(ModelSpec, TrainingOptions), Error> {
    let default = |name: &str| ModelSpec {
        name: name.into(),
        network: NetworkSpec::named("gyroceptron").expect("it has this name"),
        weights: ModelSpec::OWN_WEIGHTS,
        training: None,
        training_only: false,
        seeds: None,
    };
    let Some(name) = scene else {
        let loss = Loss::ByPlane { weights: None };
        return Ok((default("train"), TrainingOptions { loss, ..TrainingOptions::default() }));
    };
    let scene = read_scene(name)?;
    let mut spec = match &scene.setup.models[..] {
        [] => default(&scene.name),
        [spec] => ModelSpec { name: scene.name.clone(), ..spec.clone() },
        several => {
            let place = format!("{name}: models");
            return Err(Error::content(place, "one network to train", several.len()));
        }
    };
    let training = spec.training.take().unwrap_or(scene.setup.training);
    Ok((ModelSpec { seeds: None, ..spec }, training))
}

/// The network that the options ask for, or that of the scene.
fn network(
    arguments: &Train,
    action: &TorusAction,
    of_scene: NetworkSpec,
) -> Result<NetworkSpec, Error> {
    let mut network = match &arguments.architecture {
        None => of_scene,
        Some(name) => NetworkSpec::named(name)?,
    };
    if network.is_of_file() {
        return Err(Error::invalid("--scene", "a network of a file", "one to train"));
    }
    for (key, text) in arguments.sizes() {
        let option = option_of(key);
        let size = LayerSizes::parse(&option, text)?;
        network = network.with_size(key, size).map_err(|e| e.at(option))?;
    }
    (network.circle_action, network.action) = (None, None);
    if network.circles() == Circles::Several {
        network.action = Some(action.clone());
    }
    Ok(network)
}

/// What weights of the loss ask for.
fn loss_of(text: &str) -> Result<Loss, Error> {
    match text {
        "none" => Ok(Loss::MeanSquaredError),
        AUTO => Ok(Loss::ByPlane { weights: None }),
        _ => {
            let expected = "auto, none, or positive numbers such as 1,100";
            let number = |word: &str| {
                word.trim().parse().map_err(|_| Error::invalid("--loss-weights", text, expected))
            };
            let weights = text.split(',').map(number).collect::<Result<_, _>>()?;
            Ok(Loss::ByPlane { weights: Some(weights) })
        }
    }
}

/// The training options of the command line over those of the scene.
fn options(arguments: &Train, mut training: TrainingOptions) -> Result<TrainingOptions, Error> {
    if let Some(iterations) = arguments.iterations {
        training.iterations = positive("--iterations", iterations)? as u64;
    }
    if let Some(name) = arguments.optimiser {
        training.optimiser = match name {
            OptimiserName::Lm => {
                Optimiser::LevenbergMarquardt(LevenbergMarquardtOptions::default())
            }
            OptimiserName::Lbfgs => Optimiser::Lbfgs(LbfgsOptions::default()),
            OptimiserName::Adam => Optimiser::Adam(AdamOptions::default()),
        };
        if name == OptimiserName::Lm {
            training.plateau = training.plateau.or(Some(Plateau::default()));
        }
    }
    if let Some(iterations) = arguments.plateau {
        training.plateau = Plateau::over(iterations);
    }
    if let Some(penalty) = arguments.near_identity_penalty {
        training.near_identity_penalty = penalty;
    }
    if let Some(count) = arguments.starts {
        let count = positive("--starts", count)? as u64;
        // Whatever the iterations are: more of them may be asked for later.
        training.starts = (count > 1).then_some(Starts { count, iterations: Starts::TRIAL });
    }
    if let Some(text) = &arguments.loss_weights {
        training.loss = loss_of(text)?;
    }
    if !training.ramp.is_empty() {
        let expected = "no ramp: pairs are of one flow time and one ε";
        return Err(Error::invalid("training.ramp", training.ramp.len(), expected));
    }
    training.theta_fixed |= arguments.theta_fixed;
    training.theta_penalty = arguments.theta_penalty.unwrap_or(training.theta_penalty);
    training.patience = arguments.patience.unwrap_or(training.patience);
    training.target = arguments.target.unwrap_or(training.target);
    training.check()?;
    Ok(training)
}

/// The name of the model with an addition.
fn beside(model: &Path, addition: &str, ending: bool) -> PathBuf {
    let mut name =
        if ending { model.to_owned() } else { model.with_extension("") }.into_os_string();
    name.push(addition);
    name.into()
}

/// What does a training again: its command, scene and pairs.
fn command(
    arguments: &Train,
    architecture: &Architecture,
    flow_time: Option<f64>,
    theta: Option<f64>,
) -> String {
    let mut out = format!(
        "gyroceptron train --data {} --circle-action {} --validation {} --seed {}",
        arguments.data.display(),
        arguments.circle_action,
        arguments.validation,
        arguments.seed
    );
    if architecture.has_circle() {
        out.push_str(&format!(" --epsilon {}", architecture.epsilon));
    }
    if let Some(time) = flow_time {
        out.push_str(&format!(" --flow-time {time}"));
    }
    if let Some(theta) = theta {
        out.push_str(&format!(" --theta {theta}"));
    }
    if arguments.theta_fixed {
        out.push_str(" --theta-fixed");
    }
    if let Some(penalty) = arguments.theta_penalty {
        out.push_str(&format!(" --theta-penalty {penalty}"));
    }
    if arguments.units == UnitsOf::Data {
        out.push_str(" --units data");
    }
    format!(
        "`{out} --output MODEL.json --scene as-run.toml` with the file of that name beside this report, the same pairs"
    )
}

/// Saves checkpoints beside the model, and tells how it goes.
struct Training<'a> {
    checkpoint: PathBuf,
    resume: bool,
    options: &'a TrainingOptions,
    progress: &'a mut Progress,
    times: TrainingTimes,
    start: Instant,
    /// The newest checkpoint.
    written: Option<PathBuf>,
}

/// The checkpoint of a leg.
fn of_leg(checkpoint: &Path, leg: Leg) -> PathBuf {
    let mut name = checkpoint.as_os_str().to_owned();
    name.push(leg.suffix());
    name.into()
}

/// Removes the checkpoints of all legs, however many a training had.
fn remove_checkpoints(checkpoint: &Path) -> Result<(), Error> {
    let remove =
        |path: &Path| std::fs::remove_file(path).map_err(|reason| Error::write(path, reason));
    if checkpoint.exists() {
        remove(checkpoint)?;
    }
    let number = |number| of_leg(checkpoint, Leg::Start(number));
    (0..).map(number).take_while(|path| path.exists()).try_for_each(|path| remove(&path))
}

impl Watch for Training<'_> {
    fn earlier(&mut self, leg: Leg) -> Result<Option<Checkpoint>, Error> {
        earlier_checkpoint(&of_leg(&self.checkpoint, leg), self.resume)
    }

    fn observe(&mut self, leg: Leg, told: TrainingProgress<'_>) -> Result<Control, Error> {
        let iterations = leg.iterations(self.options);
        let name = if leg == Leg::Last { "training".to_owned() } else { leg.name() };
        if leg == Leg::Last {
            let seconds = self.start.elapsed().as_secs_f64();
            self.times.points.push((told.record.iteration, seconds));
        }
        if let Some(checkpoint) = told.checkpoint {
            let file = of_leg(&self.checkpoint, leg);
            save_checkpoint(&file, checkpoint)?;
            self.written = Some(file);
        }
        self.progress.iteration(&name, told.record, iterations);
        Ok(if self.progress.interrupted() { Control::Interrupt } else { Control::Continue })
    }
}

/// Whether the model is of this training, which has ended by itself and left no checkpoint.
fn is_finished(arguments: &Train, architecture: &Architecture, digest: &str) -> bool {
    load_model(&arguments.output).is_ok_and(|stored| {
        let Provenance { seed, data, .. } = &stored.provenance;
        *seed == Some(arguments.seed)
            && data.as_deref() == Some(digest)
            && stored.model.architecture() == architecture
    })
}

/// The model and the report of a training that is not gone on with stay as they are.
fn tell_finished(arguments: &Train, report_folder: &Path) -> Result<Status, Error> {
    let model = arguments.output.display();
    line(&format!(
        "{model}: this training has ended by itself and is not gone on with; --overwrite begins anew"
    ));
    let report = report_folder.join("report.md");
    if arguments.common.json {
        json(&json!({
            "model": model.to_string(),
            "report": report_folder.display().to_string(),
            "finished": true,
        }))?;
    } else {
        out(&format!("model: {model}\nreport: {}\n", report.display()))?;
    }
    Ok(Status::Done)
}

/// Where the network stands in the family that pairs may be of.
struct Family {
    epsilon: f64,
    /// Its flow time, where that is known.
    time: Option<f64>,
    has_epsilons: bool,
    has_times: bool,
}

impl Family {
    fn of(arguments: &Train, file: &PairsFile, has_time: bool) -> Result<Self, Error> {
        let &PairsFile { has_epsilons, has_times, .. } = file;
        if let Some(time) = arguments.flow_time
            && !(has_time || has_times)
        {
            let expected = "an option of gyroceptrons in normal form and of couplings, and of pairs with flow times";
            return Err(Error::invalid("--flow-time", time, expected));
        }
        let largest = |of: fn(&Condition) -> f64| {
            file.pairs.conditions().iter().map(of).max_by(|a, b| a.abs().total_cmp(&b.abs()))
        };
        let epsilon = largest(|condition| condition.epsilon).filter(|_| has_epsilons);
        let time = largest(|condition| condition.time).filter(|_| has_times);
        Ok(Self {
            epsilon: arguments.epsilon.or(epsilon).unwrap_or(EPSILON),
            time: arguments.flow_time.or(time),
            has_epsilons,
            has_times,
        })
    }

    /// ε of a condition and its time over the network's.
    fn place(&self, condition: Condition) -> (f64, f64) {
        let epsilon = if self.has_epsilons { condition.epsilon } else { self.epsilon };
        let time = match self.time {
            Some(own) if self.has_times => condition.time / own,
            _ => 1.0,
        };
        (epsilon, time)
    }
}

/// The weights of the circle action that the pairs themselves tell.
fn found_action(arguments: &Train) -> Result<String, Error> {
    let fit = ActionFit::of(&read_pairs(&arguments.data)?.pairs)?;
    if !fit.is_sure() {
        let found = format!("{AUTO}, which is not sure: {}", fit.told());
        let expected = "weights, or pairs of another flow time";
        return Err(Error::invalid("--circle-action", found, expected));
    }
    line(&format!("{}: {}", arguments.data.display(), Note::Action(&fit)));
    let weights: Vec<String> = fit.action().weights().iter().map(i32::to_string).collect();
    Ok(weights.join(","))
}

/// The circle action that is found.
const AUTO: &str = "auto";

pub fn train_pairs(arguments: &Train) -> Result<Status, Error> {
    if arguments.circle_action == AUTO {
        check_ending("--output", &arguments.output, "json")?;
        let circle_action = found_action(arguments)?;
        return train_pairs(&Train { circle_action, ..arguments.clone() });
    }
    use_threads(&arguments.common)?;
    check_ending("--output", &arguments.output, "json")?;
    let action = circle_action(&arguments.circle_action)?;
    let (spec, training) = of_scene(arguments.scene.as_deref())?;
    let network = network(arguments, &action, spec.network.clone())?;
    let spec = ModelSpec { network, ..spec };
    let training = options(arguments, training)?;
    if !(0.0..1.0).contains(&arguments.validation) {
        let expected = "a share of at least 0 and less than 1";
        return Err(Error::invalid("--validation", arguments.validation, expected));
    }
    if let Some(theta) = arguments.theta.filter(|t| !t.is_finite()) {
        return Err(Error::invalid("--theta", theta, "a finite number"));
    }
    let architecture =
        |epsilon: f64, flow_time: f64| spec.network.architecture(&action, epsilon, flow_time);
    // Before any file is read: of any ε and flow time.
    let any = architecture(arguments.epsilon.unwrap_or(EPSILON), 1.0)
        .map_err(|e| e.at("--circle-action"))?;
    let (has_circle, has_time) = (any.has_circle(), any.has_flow_time());
    let of_order_one = any.is_of_order_one();
    for (name, value, fits, of) in [
        ("--epsilon", arguments.epsilon, has_circle, "gyroceptrons"),
        ("--theta", arguments.theta, has_circle, "gyroceptrons"),
    ] {
        if let (Some(value), false) = (value, fits) {
            return Err(Error::invalid(name, value, format!("an option of {of}")));
        }
    }
    if let Some(time) = arguments.flow_time.filter(|t| !(t.is_finite() && *t > 0.0)) {
        return Err(Error::invalid("--flow-time", time, "a positive number"));
    }
    any.check()?;
    training.check_for(&any)?;
    training.loss.check(action.dof()).map_err(|e| e.at("--loss-weights"))?;
    let checkpoint_file = beside(&arguments.output, ".checkpoint", true);
    let replace = arguments.overwrite || arguments.resume;
    let legs = Leg::all(&training).into_iter().map(|leg| of_leg(&checkpoint_file, leg));
    let checkpoints: Vec<PathBuf> = legs.collect();
    guard_output("--output", &arguments.output, replace, &[&arguments.data])?;
    for path in &checkpoints {
        guard_output("the checkpoint of --output", path, replace, &[&arguments.data])?;
    }

    let report_folder =
        arguments.report.clone().unwrap_or_else(|| beside(&arguments.output, "-report", false));
    // A report of another training is not replaced by one that goes on.
    let replaced = arguments.overwrite || arguments.resume && arguments.report.is_none();
    Folder::check_report(&report_folder, replaced)?;
    let real = |path: &Path| std::fs::canonicalize(path).ok();
    let beside_model = arguments.output.parent().filter(|p| !p.as_os_str().is_empty());
    let of_model = real(beside_model.unwrap_or(Path::new(".")));
    if real(&report_folder).is_some_and(|folder| Some(folder) == of_model) {
        let expected = "another folder than the model's";
        return Err(Error::invalid("--report", report_folder.display(), expected));
    }

    let mut progress = Progress::new();
    let file = read_pairs(&arguments.data)?;
    if file.single_precision {
        progress.note(&format!("{}: {}", arguments.data.display(), Note::SinglePrecision));
    }
    if !file.unused.is_empty() {
        progress.note(&format!("{}: {}", arguments.data.display(), Note::Unused(&file.unused)));
    }
    let digest = file.pairs.digest();
    let family = Family::of(arguments, &file, has_time)?;
    if !file.pairs.conditions().is_empty() && !has_circle {
        let found = format!("epsilon or flow_time in {}", arguments.data.display());
        return Err(Error::invalid("--architecture", found, "a gyroceptron to learn a family"));
    }
    let epsilon = family.epsilon;
    let pairs = file.pairs.with_conditions(|condition| family.place(condition));
    if let Some(told) = negative_epsilons(&pairs) {
        progress.note(&format!(
            "{}: {told}; the network's own is {epsilon}, and --epsilon of predict takes the sign",
            arguments.data.display()
        ));
    }
    if has_time && !of_order_one && epsilon == 0.0 && family.time.is_none() {
        return Err(Error::invalid("--epsilon", 0, "another number, or --flow-time"));
    }
    if let Some(reading) = Reading::better(&pairs, &action) {
        progress.note(&format!("{}: {}", arguments.data.display(), Note::Reading(&reading)));
    }
    let place = arguments.data.display().to_string();
    let preparation = Preparation {
        place: &place,
        action: &action,
        epsilon,
        flow_time: family.time,
        of_order_one,
        theta: arguments.theta,
        units: arguments.units == UnitsOf::Fitted,
        validation: arguments.validation,
        seed: arguments.seed,
    };
    let Prepared { pairs, held_out, units, region, nearest, angles, flow_time: time } =
        preparation.prepare(pairs)?;
    let loss = training.loss.for_pairs(&action, &nearest, &pairs)?;
    let training = TrainingOptions { loss, ..training };
    if let Some(units) = &units {
        progress.note(&format!("{place}: {}", Note::Units(units)));
    }
    let architecture = architecture(epsilon, time)?;
    progress.note(&format!(
        "training {} parameters on {} pairs, {} held out, θ from {angles:.6?}",
        architecture.parameter_count(),
        pairs.len(),
        held_out.as_ref().map_or(0, Pairs::len)
    ));
    let mut start = |number: u64| {
        let seed = Starts::seed(arguments.seed, number);
        architecture.initialise(spec.weights, 0.0, seed)?.with_angles(&angles)
    };
    let place = Place {
        epsilon,
        time: 1.0,
        pairs: &pairs,
        held_out: held_out.as_ref(),
        iterations: training.iterations,
    };
    let mut watch = Training {
        checkpoint: checkpoint_file.clone(),
        resume: arguments.resume,
        options: &training,
        progress: &mut progress,
        times: TrainingTimes { model: spec.name.clone(), ..TrainingTimes::default() },
        start: Instant::now(),
        written: None,
    };
    if arguments.overwrite {
        // Those of the training that is replaced are of no use to this one, which may have other
        // legs.
        remove_checkpoints(&checkpoint_file)?;
    }
    if arguments.resume && !checkpoints.iter().any(|path| path.exists()) {
        if is_finished(arguments, &architecture, &digest) {
            return tell_finished(arguments, &report_folder);
        }
        load_checkpoint(&checkpoint_file)?;
    }
    let result = train_schedule(&mut start, &[place], &training, &mut watch);
    let (mut times, written) = (watch.times, watch.written);
    progress.finish();
    let result = result?;
    let outcome = &result.outcome;
    if outcome.stop == Stop::Interrupted {
        progress.note(&format!(
            "interrupted; the same command with --resume goes on from {}",
            written.unwrap_or(checkpoint_file).display()
        ));
        return Ok(Status::Interrupted);
    }
    let provenance = Provenance {
        seed: Some(arguments.seed),
        data: Some(digest),
        flow_time: family.time,
        validation: outcome.best.validation,
        region,
        ..Provenance::of(&spec.name)
    };
    let stored = StoredModel { model: outcome.model.clone(), units: units.clone(), provenance };
    save_model(&arguments.output, &stored)?;
    // What was timed is not all of it.
    if arguments.resume {
        times.points.clear();
    }
    // Angles that were fitted are fitted again.
    let theta = arguments.theta.or(result.initial.angle());
    let command = command(arguments, &architecture, family.time, theta);
    let (stop, best) = (outcome.stop, outcome.best);
    let angles = outcome.model.angles().to_vec();
    let report = OwnTraining {
        spec,
        options: &training,
        seed: arguments.seed,
        nearest: (&action, &nearest),
        training: result,
        pairs: &pairs,
        held_out: held_out.as_ref(),
        units: units.as_ref(),
        times,
        command,
        next: &|step| {
            let typed: Vec<String> = std::env::args().skip(1).collect();
            next_command(&typed, step, &arguments.output)
        },
    }
    .report(&Folder::open_report(&report_folder, true)?)?;
    // Where the iterations were done, more of them may be asked for.
    if stop != Stop::Iterations {
        remove_checkpoints(&checkpoint_file)?;
    }
    if arguments.common.json {
        json(&json!({
            "model": arguments.output.display().to_string(),
            "report": report_folder.display().to_string(),
            "parameters": architecture.parameter_count(),
            "stop": stop,
            "best": best,
            "theta": match &angles[..] {
                [theta] => Some(theta),
                _ => None,
            },
            "angles": angles,
            "units": units,
        }))?;
    } else {
        out(&terminal::summary(&report, width()))?;
        let report = report_folder.join("report.md");
        out(&format!("model: {}\nreport: {}\n", arguments.output.display(), report.display()))?;
    }
    Ok(Status::Done)
}
