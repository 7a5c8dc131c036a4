//! Training on pairs of a file: what is asked for, as a `Fit`, and what becomes of it.

use super::arguments::{Train, UnitsOf, circle_action, option_of, positive, ramp, word_of};
use super::guards::{check_ending, guard_output, use_threads};
use super::output::{json, out, typed_words, width};
use super::progress::{Progress, line};
use super::status::Status;
use gyroceptron::Error;
use gyroceptron::flow::Pairs;
use gyroceptron::io::{Checkpoints, StoredModel, load_model, read_pairs, read_section, save_model};
use gyroceptron::layer::Reversor;
use gyroceptron::network::{Controls, LayerSizes};
use gyroceptron::scene::render::terminal;
use gyroceptron::scene::{
    Folder, NextStep, Note, Observer, OwnTraining, TrainingTimes, next_command, quoted, recipe_of,
};
use gyroceptron::train::{
    ActionTrial, Checkpoint, Control, ControlOptions, Fit, FitNote, FitOptions, Loss, Optimiser,
    Problem, Progress as TrainingProgress, Stop, TrainingObserver, TrainingOptions, TrainingStage,
    Trust,
};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The loss of a name, or of weights of its planes.
fn loss_of(text: &str) -> Result<Loss, Error> {
    if let Some(loss) = Loss::named(text) {
        return Ok(loss);
    }
    let expected = "auto, none, or positive numbers such as 1,100";
    let number = |word: &str| {
        word.trim().parse().map_err(|_| Error::invalid("--loss-weights", text, expected))
    };
    let weights = text.split(',').map(number).collect::<Result<_, _>>()?;
    Ok(Loss::ByPlane { weights: Some(weights) })
}

/// What the options ask for.
fn options(arguments: &Train) -> Result<FitOptions, Error> {
    let size = |(key, text)| Ok((key, LayerSizes::parse(&option_of(key), text)?));
    let reversor = arguments.reversor.as_deref().map(Reversor::find).transpose();
    let count = |name: &str, count: Option<i64>| {
        count.map(|count| Ok(positive(name, count)? as u64)).transpose()
    };
    Ok(FitOptions {
        architecture: arguments.architecture.clone(),
        blocks: None,
        sizes: arguments.sizes().map(size).collect::<Result<_, Error>>()?,
        radius: arguments.radius,
        reversor: reversor.map_err(|e| e.with_place(option_of("reversor")))?,
        optimiser: { arguments.optimiser }
            .map(|name| Optimiser::named(&word_of(name)))
            .transpose()?,
        iterations: count("--iterations", arguments.iterations)?,
        starts: count("--starts", arguments.starts)?,
        plateau: arguments.plateau,
        ramp: arguments.ramp.as_deref().map(|text| ramp("--ramp", text)).transpose()?,
        loss: arguments.loss_weights.as_deref().map(loss_of).transpose()?,
        near_identity_penalty: arguments.near_identity_penalty,
        theta_fixed: arguments.theta_fixed,
        theta_penalty: arguments.theta_penalty,
        patience: arguments.patience,
        target: arguments.target,
    })
}

/// The circle action that is found.
const AUTO: &str = "auto";

/// What the command asks for, and its name.
fn fit_of(arguments: &Train) -> Result<(String, Fit), Error> {
    let recipe = arguments.recipe.map(word_of);
    let (name, recipe) = recipe_of(recipe.as_deref(), arguments.scene.as_deref())?;
    let action = match arguments.circle_action.as_deref() {
        None | Some(AUTO) => None,
        Some(text) => Some(circle_action(text)?),
    };
    let base = options(arguments)?.apply_to(recipe)?;
    let fit = Fit {
        place: arguments.data.display().to_string(),
        action,
        epsilon: arguments.epsilon,
        flow_time: arguments.flow_time,
        theta: arguments.theta,
        controls: ControlOptions {
            names: arguments.controls.clone(),
            degree: { arguments.control_degree }
                .map(|degree| positive("--control-degree", degree))
                .transpose()?,
        },
        section: arguments.section.as_deref().map(read_section).transpose()?,
        units: arguments.units == UnitsOf::Fitted,
        validation: arguments.validation,
        seed: arguments.seed,
        ..base
    };
    fit.check()?;
    Ok((name, fit))
}

/// The name of the model with an addition.
fn beside(model: &Path, addition: &str, ending: bool) -> PathBuf {
    let mut name =
        if ending { model.to_owned() } else { model.with_extension("") }.into_os_string();
    name.push(addition);
    name.into()
}

/// What does a training again: its command, scene and pairs.
fn command(arguments: &Train, problem: &Problem, theta: Option<f64>) -> String {
    let mut out = format!(
        "gyroceptron train --data {} --circle-action {} --validation {} --seed {}",
        quoted(&arguments.data.display().to_string()),
        problem.action,
        arguments.validation,
        arguments.seed
    );
    if problem.architecture.has_circle() {
        out.push_str(&format!(" --epsilon {}", problem.architecture.epsilon));
    }
    if let Some(time) = problem.flow_time {
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
    if let Some(controls) = &problem.architecture.controls {
        let names: Vec<&str> = controls.ranges.iter().map(|range| &*range.name).collect();
        let degree = controls.degree;
        out.push_str(&format!(" --controls {} --control-degree {degree}", names.join(",")));
    }
    if arguments.units == UnitsOf::Data {
        out.push_str(" --units data");
    }
    if let Some(section) = &arguments.section {
        out.push_str(&format!(" --section {}", quoted(&section.display().to_string())));
    }
    format!(
        "`{out} --output MODEL.json --scene as-run.toml` with the file of that name beside this report, the same pairs"
    )
}

/// Saves checkpoints beside the model, and shows how it goes.
struct Training<'a> {
    checkpoints: Checkpoints,
    options: TrainingOptions,
    progress: &'a mut Progress,
    times: TrainingTimes,
    start: Instant,
}

impl TrainingObserver for Training<'_> {
    fn earlier(&mut self, stage: TrainingStage) -> Result<Option<Checkpoint>, Error> {
        self.checkpoints.earlier(stage)
    }

    fn observe(
        &mut self,
        stage: TrainingStage,
        progress: TrainingProgress<'_>,
    ) -> Result<Control, Error> {
        let iterations = stage.iterations(&self.options);
        let last = stage == TrainingStage::Last;
        let name = if last { "training".to_owned() } else { stage.name() };
        if last {
            let seconds = self.start.elapsed().as_secs_f64();
            self.times.points.push((progress.record.iteration, seconds));
        }
        self.checkpoints.observe(stage, progress)?;
        self.progress.iteration(&name, progress.record, iterations);
        Ok(if self.progress.interrupted() { Control::Interrupt } else { Control::Continue })
    }
}

/// The model and the report of a training that is not gone on with stay as they are.
fn tell_finished(arguments: &Train, report_folder: &Path) -> Result<Status, Error> {
    let model = arguments.output.display();
    line(&format!(
        "{model}: this training has ended and has no checkpoint to go on from (one that ends by itself leaves none); \
         --overwrite begins anew"
    ));
    let report = report_folder.join("report.md");
    if arguments.common.json {
        json(&json!({
            "model": model.to_string(),
            "report": report_folder.display().to_string(),
            "finished": true,
        }))?;
    } else {
        out(&format!("model: {model}\nreport: {} and report.html\n", report.display()))?;
    }
    Ok(Status::Done)
}

/// Fails where a file that the training writes may not be written; the folder of the report.
fn check_outputs(
    arguments: &Train,
    checkpoints: &Checkpoints,
    training: &TrainingOptions,
) -> Result<PathBuf, Error> {
    let replace = arguments.overwrite || arguments.resume;
    guard_output("--output", &arguments.output, replace, &[&arguments.data])?;
    for path in checkpoints.files(training) {
        guard_output("the checkpoint of --output", &path, replace, &[&arguments.data])?;
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
    Ok(report_folder)
}

pub fn train_pairs(arguments: &Train) -> Result<Status, Error> {
    use_threads(&arguments.common)?;
    check_ending("--output", &arguments.output, "json")?;
    let (name, fit) = fit_of(arguments)?;
    let checkpoints =
        Checkpoints::new(beside(&arguments.output, ".checkpoint", true), arguments.resume);
    let report_folder = check_outputs(arguments, &checkpoints, &fit.training)?;
    let mut progress = Progress::new();
    let file = read_pairs(&arguments.data)?;
    let place = arguments.data.display();
    if file.single_precision {
        progress.note(&format!("{place}: {}", Note::SinglePrecision));
    }
    if !file.unused.is_empty() {
        progress.note(&format!("{place}: {}", Note::Unused(&file.unused)));
    }
    if fit.action.is_none() && file.pairs.dof() == ActionTrial::PLANES {
        progress.note(&format!("{place}: looking for the circle action …"));
    }
    let mut go_on =
        || Ok(if progress.interrupted() { Control::Interrupt } else { Control::Continue });
    let problem = match fit.prepare_observed(file, &mut go_on) {
        Err(Error::Stopped { .. }) => {
            progress.note("interrupted");
            return Ok(Status::Interrupted);
        }
        problem => problem?,
    };
    for note in &problem.notes {
        progress.note(&match note {
            FitNote::NegativeEpsilons(..) => format!(
                "{place}: {note}; the network's own is {}, and --epsilon of predict takes the sign",
                problem.architecture.epsilon
            ),
            FitNote::Recommended(_) => {
                format!("recommended: {note} (--recipe paper is the paper's)")
            }
            _ => format!("{place}: {note}"),
        });
    }
    progress.note(&format!(
        "training {} parameters on {} pairs, {} held out, θ from {:.6?}",
        problem.architecture.parameter_count(),
        problem.pairs.len(),
        problem.held_out.as_ref().map_or(0, Pairs::len),
        problem.angles
    ));
    if arguments.overwrite {
        // Those of the training that is replaced are of no use to this one, which may have other
        // stages.
        checkpoints.remove()?;
    }
    let is_made = || load_model(&arguments.output).is_ok_and(|stored| stored.is_of(&problem));
    if arguments.resume && !checkpoints.exist(&problem.training) && is_made() {
        return tell_finished(arguments, &report_folder);
    }
    checkpoints.check(&problem.training)?;
    let mut training = Training {
        checkpoints,
        options: problem.training.clone(),
        progress: &mut progress,
        times: TrainingTimes { model: name.clone(), ..TrainingTimes::default() },
        start: Instant::now(),
    };
    let fitted = problem.train(&mut training);
    let Training { checkpoints, mut times, .. } = training;
    progress.finish();
    let fitted = fitted?;
    let (stop, best) = (fitted.outcome().stop, fitted.outcome().best);
    if stop == Stop::Interrupted {
        progress.note(&format!(
            "interrupted; the same command with --resume goes on from {}",
            checkpoints.newest().display()
        ));
        return Ok(Status::Interrupted);
    }
    save_model(&arguments.output, &StoredModel::of_fit(&fitted, &name))?;
    // What was timed is not all of it.
    if arguments.resume {
        times.points.clear();
    }
    // Angles of several circles are fitted again.
    let own = match (&fitted.problem.angles[..], fitted.problem.architecture.has_circle()) {
        (&[theta], true) => Some(theta),
        _ => None,
    };
    let theta = arguments.theta.or(own);
    let command = command(arguments, &fitted.problem, theta);
    let angles = fitted.model().angles().to_vec();
    let parameters = fitted.model().parameters().len();
    let units = fitted.problem.units.clone();
    let example = fitted.problem.architecture.controls.as_ref().map(Controls::example);
    let next = &|step: NextStep| {
        let typed = typed_words();
        let at = example.as_ref().filter(|_| step == NextStep::Predict);
        let at = at.map(|values| format!(" --at {values}")).unwrap_or_default();
        next_command(&typed, step, &arguments.output) + &at
    };
    let trust = match arguments.common.json {
        true => {
            let judgement = fitted.judgement()?;
            let (trust, next) = (judgement.trust(), next(NextStep::after(&fitted, &judgement)));
            let Trust { verdict, error, reasons } = trust;
            Some(json!({ "verdict": verdict, "error": error, "reasons": reasons, "next": next }))
        }
        false => None,
    };
    let report = OwnTraining { name, fitted, times, command, next }
        .report(&Folder::open_report(&report_folder, true)?)?;
    checkpoints.remove_after(stop)?;
    if arguments.common.json {
        json(&json!({
            "model": arguments.output.display().to_string(),
            "report": report_folder.display().to_string(),
            "parameters": parameters,
            "stop": stop,
            "best": best,
            "trust": trust,
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
        out(&format!(
            "model: {}\nreport: {} and report.html\n",
            arguments.output.display(),
            report.display()
        ))?;
    }
    Ok(Status::Done)
}
