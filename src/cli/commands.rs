//! The commands.

use super::arguments::{
    Arguments, CoilArguments, Command, Export, ExportFormat, Import, Outside, Predict, Run, Verify,
    block, circle_action, positive,
};
use super::guards::{check_ending, guard_output, use_threads};
use super::output::{json, out, status_of, typed_words, width};
use super::progress::{Progress, line};
use super::prove::{check_proof, prove};
use super::train::train_pairs;
use super::{Status, about, cite, jobs};
use clap::ValueEnum;
use gyroceptron::Error;
use gyroceptron::flow::{PolynomialExit, Trajectories};
use gyroceptron::io::{
    Provenance, SourceCode, SourceLanguage, StoredModel, assemble_architecture, assemble_weights,
    export_weights, file_digest, load_model, read_architecture, read_points, read_tensors,
    read_trajectories, save_model, take_units, write_atomically, write_points,
};
use gyroceptron::layer::CircleAction;
use gyroceptron::measure::certificate::{CertificateOptions, certify, certify_all};
use gyroceptron::measure::timing::root_mean_square_distance;
use gyroceptron::network::{
    Architecture, Course, GyroceptronShape, InitialWeights, Model, Pace, Rollout,
};
use gyroceptron::phase::Direction;
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Grid, GridNumbers, max_or_nan};
use gyroceptron::scene::render::{self, terminal};
use gyroceptron::scene::{
    CoilFile, Coils, Folder, LineData, Note, Scene, bibtex, catalogue, certificate_table,
    command_line, default_scene, find, own_invariance_fault, run, without_page,
};
use rayon::prelude::*;
use serde::Serialize;
use serde_json::json;
use std::path::Path;

pub fn dispatch(arguments: Arguments) -> Result<Status, Error> {
    match arguments.command.unwrap_or(Command::Run(arguments.run)) {
        Command::Run(arguments) => run_scene(&arguments),
        Command::Scenes { json, show } => scenes(json, show.as_deref()),
        Command::Verify(arguments) => verify(&arguments),
        Command::Prove(arguments) => prove(&arguments),
        Command::CheckProof(arguments) => check_proof(&arguments),
        Command::Train(arguments) => train_pairs(&arguments),
        Command::Predict(arguments) => predict(&arguments),
        Command::Import(arguments) => import(&arguments),
        Command::Export(arguments) => export(&arguments),
        Command::Completions(arguments) => about::completions(&arguments),
        Command::Manual(arguments) => about::manual(&arguments),
        Command::Cite { target } => {
            out(&cite::of(target.as_deref())?)?;
            Ok(Status::Done)
        }
    }
}

fn run_scene(arguments: &Run) -> Result<Status, Error> {
    use_threads(&arguments.common)?;
    let mut scene = match &arguments.scene {
        Some(name) => Scene::read(name)?,
        None => default_scene().scene()?,
    };
    if let Some(seed) = arguments.seed {
        scene = scene.with_seed(seed);
    }
    if arguments.quick {
        scene = scene.quick();
    }
    if let Some(file) = &arguments.weights {
        let file = std::path::absolute(file).map_err(|reason| Error::read(file, reason))?;
        let (with, any) = scene.with_weights(&file);
        scene = with;
        if !any {
            let expected = "a scene with a network of kind \"file\" that names none";
            return Err(Error::invalid("--weights", &scene.name, expected));
        }
    }
    scene = with_coils(scene, &arguments.coils)?;
    let (with_files, lacking) = scene.without_parts_that_lack_files();
    scene = with_files;
    for part in lacking {
        line(&format!("part {part} is left out: it needs --weights FILE"));
    }
    scene.complete()?;
    let path =
        arguments.out.clone().unwrap_or_else(|| Path::new("gyroceptron-out").join(&scene.name));
    if arguments.plan {
        return jobs::plan(&scene, arguments, &path);
    }
    if let Some(id) = &arguments.job {
        return jobs::one(&scene, arguments, id, &path);
    }
    if arguments.merge {
        return jobs::merge_all(&scene, arguments, &path);
    }
    scene.check_networks(&path)?;
    let folder = Folder::open(&path, arguments.resume, arguments.overwrite)?;
    let mut progress = Progress::new();
    let result = run(&scene, &folder, &mut progress);
    progress.finish();
    let Some(report) = result? else {
        progress.note(&format!(
            "interrupted; the same command with --resume goes on from the checkpoint in {}",
            path.display()
        ));
        return Ok(Status::Interrupted);
    };
    jobs::show(&report, &path, arguments.common.json)
}

/// The scene with the machine that is asked for.
fn with_coils(scene: Scene, arguments: &CoilArguments) -> Result<Scene, Error> {
    let CoilArguments { coils, currents, field_periods, asymmetric, section_at, reach, axis } =
        arguments;
    let axis = match axis[..] {
        [] => None,
        [radius, height] => Some([radius, height]),
        _ => return Err(Error::invalid("--axis", format!("{axis:?}"), "two numbers, R,Z")),
    };
    let coils = match (coils, field_periods) {
        (Some(file), Some(periods)) => Some(Coils::File(CoilFile {
            path: std::path::absolute(file).map_err(|reason| Error::read(file, reason))?,
            currents: currents.clone(),
            periods: *periods,
            stellarator_symmetric: !asymmetric,
        })),
        _ => None,
    };
    if coils.is_none() && section_at.is_none() && reach.is_none() && axis.is_none() {
        return Ok(scene);
    }
    let name = scene.name.clone();
    let (scene, any) = scene.with_lines(&|lines| LineData {
        coils: coils.clone().unwrap_or(lines.coils),
        section: section_at.unwrap_or(lines.section),
        reach: reach.unwrap_or(lines.reach),
        axis: axis.or(lines.axis),
        ..lines
    });
    if !any {
        let expected = "a scene of field lines of coils, such as coils";
        return Err(Error::invalid("--coils, --section-at, --reach or --axis", name, expected));
    }
    let (scene, left) = scene.without_models_that_need_a_mirror();
    for model in left {
        line(&format!(
            "model {model} is left out: it is reversible, and maps of this section are not; those of the sections at 0 \
             and 0.5 of coils with stellarator symmetry are"
        ));
    }
    Ok(scene)
}

fn scenes(as_json: bool, show: Option<&str>) -> Result<Status, Error> {
    if let Some(name) = show {
        out(find(name)?.text)?;
        return Ok(Status::Done);
    }
    let mut rows = Vec::new();
    for entry in catalogue() {
        rows.push((entry.name, entry.scene()?.title));
    }
    if as_json {
        let list: Vec<_> =
            rows.iter().map(|(name, title)| json!({ "name": name, "title": title })).collect();
        json(&list)?;
    } else {
        for (name, title) in rows {
            out(&format!("{name:20} {title}\n"))?;
        }
    }
    Ok(Status::Done)
}

/// More random networks than these, all held at once, are taken for a mistake.
const MOST_RANDOM: usize = 100_000;

/// The network of `verify --random` and of `train` without a scene: that of
/// the paper's time-5 map.
fn default_architecture(circle_action: CircleAction, epsilon: f64) -> Architecture {
    let (psi, near_identity) = (vec![8; 10], vec![8; 10]);
    GyroceptronShape { circle_action, psi, near_identity }.architecture(epsilon)
}

fn verify(arguments: &Verify) -> Result<Status, Error> {
    use_threads(&arguments.common)?;
    let options = CertificateOptions {
        samples: positive("--samples", arguments.samples)?,
        radius: arguments.radius,
        seed: arguments.seed,
    };
    options.check()?;
    if let Some(page) = &arguments.report {
        check_ending("--report", page, "html")?;
        let models: Vec<&Path> = arguments.model.iter().map(AsRef::as_ref).collect();
        guard_output("--report", page, arguments.overwrite, &models)?;
    }
    let (mut own_units, mut notes) = (None, Vec::new());
    let (target, result) = match &arguments.model {
        Some(path) => {
            let (stored, told) = at_controls(load_model(path)?, &arguments.at)?;
            notes.extend(told.iter().map(ToString::to_string));
            own_units.clone_from(&stored.units);
            notes.extend(own_invariance_fault(&stored, &options).iter().map(ToString::to_string));
            notes.iter().for_each(|text| line(&format!("note: {text}")));
            (path.display().to_string(), certify(&stored.model, options))
        }
        None => {
            let count = positive("--random", arguments.random.unwrap_or(10))?;
            if count > MOST_RANDOM {
                let expected = format!("at most {MOST_RANDOM}");
                return Err(Error::invalid("--random", count, expected));
            }
            let mut angles = Stream::new(arguments.seed, "verify/theta");
            let models: Vec<Model> = (0..count as u64)
                .map(|k| {
                    let theta = angles.uniform(0.0, std::f64::consts::TAU);
                    default_architecture(CircleAction::new([1, 0]), 0.01).initialise(
                        InitialWeights::Glorot,
                        theta,
                        arguments.seed.wrapping_add(k),
                    )
                })
                .collect::<Result<_, Error>>()?;
            (
                format!("{count} gyroceptrons with random weights (Glorot, 681 parameters)"),
                certify_all(&models, options),
            )
        }
    };
    if let Some(page) = &arguments.report {
        let command = command_line(&without_page(&typed_words()));
        let text = render::html_certificate(&target, &result, &notes, &command, &bibtex(None));
        write_atomically(page, |file| file.write_all(text.as_bytes()))?;
    }
    if arguments.common.json {
        json(&json!({
            "target": target,
            "crate_version": env!("CARGO_PKG_VERSION"),
            "holds": result.holds(),
            "units": own_units,
            "certificate": result,
        }))?;
    } else {
        out(&format!(
            "{target}: {}\nsampled: {} points each, uniform in |z_i| ≤ {}, seed {}{}; other points are not tested\n{}",
            result.summary(),
            options.samples,
            result.options.radius,
            options.seed,
            if own_units.is_some() { ", z in the units of the network" } else { "" },
            terminal::table(&certificate_table(&result.rows), width()),
        ))?;
        for line in result.advice() {
            out(&format!("- {line}\n"))?;
        }
    }
    Ok(status_of(result.holds()))
}

/// What is said of the values of controls.
enum ControlsNote {
    /// None were given, and these are used.
    Nominal(String),
    /// One is outside of its range.
    Outside(String),
}

impl ControlsNote {
    fn is_outside(&self) -> bool {
        matches!(self, Self::Outside(_))
    }
}

impl std::fmt::Display for ControlsNote {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (Self::Nominal(text) | Self::Outside(text)) = self;
        f.write_str(text)
    }
}

/// A model at the values of its controls that an option has, and what is to be said of them.
fn at_controls(
    stored: StoredModel,
    given: &[String],
) -> Result<(StoredModel, Option<ControlsNote>), Error> {
    let Some(controls) = stored.model.architecture().controls.clone() else {
        return match given.first() {
            None => Ok((stored, None)),
            Some(found) => {
                let expected = "none: the model depends on no controls";
                Err(Error::invalid("--at", found, expected))
            }
        };
    };
    let pair = |text: &String| -> Result<(String, f64), Error> {
        let expected = "NAME=VALUE, such as planar=0.02";
        let wrong = || Error::invalid("--at", text, expected);
        let (name, value) = text.split_once('=').ok_or_else(wrong)?;
        Ok((name.trim().to_owned(), value.trim().parse().map_err(|_| wrong())?))
    };
    let pairs: Vec<(String, f64)> = given.iter().map(pair).collect::<Result<_, _>>()?;
    let values = controls.values(pairs.iter().map(|(name, value)| (&**name, *value)));
    let values = values.map_err(|e| e.with_place("--at"))?;
    let names = controls.ranges.iter().map(|range| &range.name);
    let words: Vec<String> =
        names.zip(&values).map(|(name, value)| format!("{name}={value}")).collect();
    let note = match controls.first_outside(&values) {
        Some((range, value)) => Some(ControlsNote::Outside(range.outside(value))),
        None if given.is_empty() => Some(ControlsNote::Nominal(format!(
            "at the middle of the controls, {}; --at takes others",
            words.join(", ")
        ))),
        None => None,
    };
    let at = stored.at_controls(&values)?;
    if let Some(section) = &at.section {
        section.check(section.dof()).map_err(|e| e.with_place("--at"))?;
    }
    Ok((at, note))
}

fn predict(arguments: &Predict) -> Result<Status, Error> {
    use_threads(&arguments.common)?;
    let direction = if arguments.steps < 0 { Direction::Inverse } else { Direction::Forward };
    let steps = usize::try_from(arguments.steps.unsigned_abs()).ok().filter(|steps| *steps > 0);
    let expected = "at least 1, or at most -1 for steps back";
    let steps = steps.ok_or_else(|| Error::invalid("--steps", arguments.steps, expected))?;
    let request = Rollout { steps, every: positive("--every", arguments.every)? };
    let grid = arguments.grid.map(|bits| {
        // What is no count is none of bits, and no grid has so many.
        let numbers = GridNumbers::from(arguments.grid_numbers);
        let expected = || format!("0 to {} bits", numbers.most_bits());
        let bits = u32::try_from(bits).map_err(|_| Error::invalid("--grid", bits, expected()))?;
        Grid::new(bits, numbers).map_err(|e| e.with_place("--grid"))
    });
    let course = Course { direction, grid: grid.transpose()? };
    if request.every > request.steps {
        let expected = format!("at most {} steps, so that one is taken", request.steps);
        return Err(Error::invalid("--every", request.every, expected));
    }
    let inputs = [arguments.model.as_path(), arguments.input.as_path()];
    check_ending("--output", &arguments.output, "npy")?;
    if let Some(invariant) = &arguments.invariant {
        check_ending("--invariant", invariant, "npy")?;
    }
    let loaded = load_model(&arguments.model)?;
    let (stored, of_controls) = at_controls(loaded, &arguments.at)?;
    let stored = stored.member(arguments.epsilon, arguments.flow_time)?;
    let asked = arguments.outside != Outside::Ignore;
    let of_controls = of_controls.filter(|note| asked || !note.is_outside());
    guard_output("--output", &arguments.output, arguments.overwrite, &inputs)?;
    if let Some(invariant) = &arguments.invariant {
        if stored.invariant().is_none() {
            let expected = "an option of symplectic gyroceptrons: other networks own no invariant";
            return Err(Error::invalid("--invariant", invariant.display(), expected));
        }
        let taken = [inputs[0], inputs[1], &arguments.output];
        guard_output("--invariant", invariant, arguments.overwrite, &taken)?;
        // Neither may exist yet.
        let place = |path: &Path| {
            let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
            let folder = std::fs::canonicalize(folder.unwrap_or(Path::new("."))).ok();
            folder.map(|folder| (folder, path.file_name().map(ToOwned::to_owned)))
        };
        if place(invariant) == place(&arguments.output) {
            let expected = "another file than --output";
            return Err(Error::invalid("--invariant", invariant.display(), expected));
        }
    }
    let has_polynomials = stored.model.architecture().has_polynomials();
    let has_box = has_polynomials || stored.provenance.region.is_some();
    if arguments.outside == Outside::Stop && !has_box {
        let expected = "a model that knows the box of its training points";
        return Err(Error::invalid("--outside", "stop", expected));
    }
    let dof = stored.model.composition().dof();
    let dim = 2 * dof;
    let file = read_points(&arguments.input, dof)?;
    if file.single_precision {
        line(&format!("{}: {}", arguments.input.display(), Note::SinglePrecision));
    }
    let mut initial = file.points;
    if let Some(block) = &arguments.block {
        let rows = self::block(block, initial.len() / dim)?;
        initial = initial[rows.start * dim..rows.end * dim].to_vec();
    }
    let points = initial.len() / dim;
    let others = arguments.compare.as_deref().map(|file| {
        let others = read_trajectories(file, dof)?;
        let counts = [
            ("states of each trajectory", request.kept(), others.states()),
            ("trajectories", points, others.count()),
        ];
        for (what, expected, found) in counts {
            if expected != found {
                let name = format!("{}: {what}", file.display());
                return Err(Error::WrongCount { name, expected, found });
            }
        }
        Ok::<_, Error>(others)
    });
    let others = others.transpose()?;
    let rolled = stored
        .rollout_along(course, &initial, request, &mut Pace::unbroken())
        .map_err(|e| e.with_place(arguments.model.display()))?;
    let values = rolled.states;
    // In units of the data.
    let apart = initial.iter().zip(&values).map(|(a, b)| (a - b).abs());
    let moved = apart.fold(0.0, max_or_nan);
    let rounded = course.grid.filter(|_| !rolled.is_exact).map(|grid| {
        format!(
            "a state at the end is rounded in the file, since a grid of {} bits is finer than its numbers are there: \
             --steps {}{} from the file ends near the first state, not at it",
            grid.bits(),
            if direction == Direction::Forward { "-" } else { "" },
            request.steps / request.every * request.every
        )
    });
    rounded.iter().for_each(|text| line(&format!("note: {text}")));
    let region = stored.provenance.region.as_ref().filter(|_| arguments.outside != Outside::Ignore);
    let left = region.and_then(|region| region.left_by(&values, points, request.every));
    let beyond = asked.then(|| stored.leaves_polynomials(&values, points, request.every)).flatten();
    let told = left.iter().zip(region).map(|(left, region)| left.describe(region));
    let told: Vec<String> = told.chain(beyond.iter().map(PolynomialExit::describe)).collect();
    told.iter().for_each(|text| line(&format!("note: {text}")));
    of_controls.iter().for_each(|text| line(&format!("note: {text}")));
    let beyond_range = of_controls.as_ref().is_some_and(ControlsNote::is_outside);
    if (beyond_range || !told.is_empty()) && arguments.outside == Outside::Stop {
        line("nothing is written");
        if arguments.common.json {
            let left = json!({
                "output": null,
                "outside": left,
                "outside_polynomials": beyond,
                "outside_controls": beyond_range,
            });
            json(&left)?;
        }
        return Ok(Status::CheckFailed);
    }
    let shape = [request.kept() as u64, points as u64, dim as u64];
    write_points(&arguments.output, &shape, &values)?;
    let apart = others.as_ref().map(|others| distances(&values, others, request.every));
    if let (Some(file), Some(invariant)) = (&arguments.invariant, stored.invariant()) {
        let along: Vec<f64> = values.par_chunks_exact(dim).map(invariant).collect();
        write_points(file, &shape[..2], &along)?;
    }
    if arguments.common.json {
        json(&json!({
            "output": arguments.output.display().to_string(),
            "shape": shape,
            "block": arguments.block,
            "compared": apart,
            "invariant": arguments.invariant.as_ref().map(|file| file.display().to_string()),
            "outside": left,
            "outside_polynomials": beyond,
            "outside_controls": beyond_range,
            "grid": course.grid.map(|grid| json!({
                "bits": grid.bits(),
                "numbers": grid.numbers().name(),
                "first_state_moved_by": moved,
                "leads_back": rolled.is_exact,
            })),
        }))?;
    } else {
        out(&format!(
            "{}: {} states of {points} trajectories of {dim} numbers\n",
            arguments.output.display(),
            request.kept()
        ))?;
        if let (Some(apart), Some(file)) = (&apart, &arguments.compare) {
            out(&format!("distance from {}:\n", file.display()))?;
            // The first steps, then each twice as far as the one before, and the last.
            let all = apart.len();
            for (index, at) in apart.iter().enumerate().skip(1) {
                if index.is_power_of_two() || index + 1 == all {
                    let Distance { steps, rms, largest } = at;
                    out(&format!(
                        "  after {steps} steps {rms:.2e} (rms), {largest:.2e} at most\n"
                    ))?;
                }
            }
        }
    }
    Ok(Status::Done)
}

/// How far trajectories are from others after so many steps, in units of the data.
#[derive(Serialize)]
struct Distance {
    steps: usize,
    /// Over all trajectories.
    rms: f64,
    largest: f64,
}

fn distances(values: &[f64], others: &Trajectories, every: usize) -> Vec<Distance> {
    let (dim, row) = (others.dim(), others.dim() * others.count());
    let states = values.chunks_exact(row).zip(others.values().chunks_exact(row)).enumerate();
    let of = |(index, (own, other)): (usize, (&[f64], &[f64]))| {
        let both = own.chunks_exact(dim).zip(other.chunks_exact(dim));
        let largest = both.map(|(a, b)| root_mean_square_distance(a, b, dim)).fold(0.0, max_or_nan);
        Distance { steps: index * every, rms: root_mean_square_distance(own, other, dim), largest }
    };
    states.map(of).collect()
}

fn describe(model: &Model, path: &Path, as_json: bool) -> Result<Status, Error> {
    let count = model.composition().parameters().len();
    if as_json {
        json(&json!({
            "file": path.display().to_string(),
            "architecture": model.architecture(),
            "parameters": count,
            "theta": model.angle(),
            "angles": model.angles(),
        }))?;
    } else {
        let blocks = model.architecture().blocks.iter();
        let blocks = blocks.filter(|block| block.layers.count() > 0);
        let layers: Vec<String> = blocks
            .map(|block| {
                let (count, words) = (block.layers.count(), block.layers.words());
                format!("{} {count} {words}", block.name).trim_start().to_owned()
            })
            .collect();
        out(&format!("{}: {count} parameters, {}\n", path.display(), layers.join(", ")))?;
    }
    Ok(Status::Done)
}

fn import(arguments: &Import) -> Result<Status, Error> {
    check_ending("--output", &arguments.output, "json")?;
    let action = circle_action(&arguments.circle_action)?;
    let (mut tensors, place) = (read_tensors(&arguments.weights)?, arguments.weights.display());
    if tensors.values().any(|tensor| tensor.single_precision) {
        line(&format!("{place}: {}", Note::SinglePrecision));
    }
    let (place, epsilon, time) = (place.to_string(), arguments.epsilon, arguments.flow_time);
    if let Some(time) = time.filter(|time| !(time.is_finite() && *time > 0.0)) {
        return Err(Error::invalid("--flow-time", time, "a positive number"));
    }
    let units = take_units(&place, &mut tensors, action.dof())?;
    let model = match read_architecture(&arguments.weights)? {
        // A list of blocks of its own has no other description.
        Some(own) if own.circles == action.circles() => {
            if let (Some(time), false) = (time, own.has_flow_time()) {
                let expected = "none: no block of this network has a flow time";
                return Err(Error::invalid("--flow-time", time, expected));
            }
            let time = time.unwrap_or(own.flow_time);
            assemble_architecture(&place, tensors, own.at_epsilon(epsilon).of_time(time))?
        }
        _ => assemble_weights(&place, tensors, &action, epsilon, time).map_err(|e| match e {
            Error::Invalid { ref name, .. } if name == "flow_time" => e.with_place("--flow-time"),
            other => other,
        })?,
    };
    let architecture = model.architecture();
    let flow_time = architecture.has_flow_time().then_some(architecture.flow_time);
    guard_output("--output", &arguments.output, arguments.overwrite, &[&arguments.weights])?;
    let provenance = Provenance {
        data: Some(file_digest(&arguments.weights)?),
        flow_time: flow_time.or(arguments.flow_time),
        ..Provenance::of("import")
    };
    let stored = StoredModel { model: model.clone(), units, section: None, provenance };
    save_model(&arguments.output, &stored)?;
    describe(&model, &arguments.output, arguments.json)
}

fn export(arguments: &Export) -> Result<Status, Error> {
    let ending = arguments.output.extension().and_then(|ending| ending.to_str());
    let mut formats = ExportFormat::value_variants().iter().copied();
    let format = arguments.format.or_else(|| formats.find(|of| Some(of.ending()) == ending));
    if let Some(format) = format {
        check_ending("--output", &arguments.output, format.ending())?;
    }
    let language = match format {
        Some(ExportFormat::C) => Some(SourceLanguage::C),
        Some(ExportFormat::Jax) => Some(SourceLanguage::Jax),
        Some(ExportFormat::Torch) => Some(SourceLanguage::Torch),
        Some(ExportFormat::Safetensors | ExportFormat::Npz) | None => None,
    };
    if let Some(language) = language {
        return export_code(arguments, language);
    }
    if format.is_none() {
        let expected = "a name that ends in .safetensors, .npz, .c or .py";
        return Err(Error::invalid("--output", arguments.output.display(), expected));
    }
    let of_code = [
        ("--epsilon", arguments.epsilon.map(|value| value.to_string())),
        ("--flow-time", arguments.flow_time.map(|value| value.to_string())),
        ("--at", arguments.at.first().cloned()),
    ];
    if let Some((option, Some(found))) = of_code.iter().find(|(_, found)| found.is_some()) {
        let expected = "none: weights are of all members of a family, source code is of one";
        return Err(Error::invalid(option, found, expected));
    }
    let stored = load_model(&arguments.model)?;
    if stored.section.is_some() {
        let expected =
            "one whose data has canonical columns: no tensor holds the charts of a section";
        return Err(Error::invalid("--model", arguments.model.display(), expected));
    }
    guard_output("--output", &arguments.output, arguments.overwrite, &[&arguments.model])?;
    export_weights(&arguments.output, &stored.model, stored.units.as_ref())?;
    describe(&stored.model, &arguments.output, arguments.json)
}

fn export_code(arguments: &Export, language: SourceLanguage) -> Result<Status, Error> {
    let loaded = load_model(&arguments.model)?;
    let (family, has_controls) =
        (loaded.digest()?, loaded.model.composition().controls().is_some());
    let (stored, of_controls) = at_controls(loaded, &arguments.at)?;
    let stored = stored.member(arguments.epsilon, arguments.flow_time)?;
    of_controls.iter().for_each(|text| line(&format!("note: {text}")));
    let at = match &arguments.at[..] {
        [] => "controls in the middle of their ranges".to_owned(),
        given => format!("controls {}", given.join(", ")),
    };
    let words: Vec<String> = [
        arguments.epsilon.map(|epsilon| format!("epsilon {epsilon}")),
        arguments.flow_time.map(|time| format!("flow time {time}")),
        has_controls.then_some(at),
    ]
    .into_iter()
    .flatten()
    .collect();
    let member = (!words.is_empty())
        .then(|| format!("a member ({}) of the model with the digest {family}", words.join(", ")));
    let name = arguments.output.file_stem().unwrap_or_default().to_string_lossy();
    let code = SourceCode::of(&stored, language, &name, member.as_deref())
        .map_err(|e| e.with_place("--output"))?;
    let paths = code.paths(&arguments.output);
    for path in &paths {
        guard_output("--output", path, arguments.overwrite, &[&arguments.model])?;
    }
    code.write(&arguments.output)?;
    let files: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    if arguments.json {
        json(&json!({ "files": files, "digest": stored.digest()? }))?;
    } else {
        out(&format!("{}: the map as source code\n", files.join(", ")))?;
    }
    Ok(Status::Done)
}
