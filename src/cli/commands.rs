//! The commands.

use super::arguments::{
    Arguments, CoilArguments, Command, Export, ExportFormat, Import, Run, Verify, circle_action,
    positive,
};
use super::controls::at_controls;
use super::fit::fit;
use super::guards::{check_ending, guard_output, use_threads};
use super::output::{json, out, status_of, typed_words, width, width_of_terminal};
use super::predict::predict;
use super::progress::{Progress, line};
use super::prove::{check_proof, prove};
use super::status::Status;
use super::train::train_pairs;
use super::{about, cite, jobs};
use clap::ValueEnum;
use gyroceptron::Error;
use gyroceptron::io::{
    Provenance, SourceCode, SourceLanguage, StoredMap, StoredModel, assemble_architecture,
    assemble_weights, export_weights, file_digest, load_map, load_model, read_architecture,
    read_tensors, save_model, take_units, write_atomically,
};
use gyroceptron::layer::CircleAction;
use gyroceptron::measure::certificate::{
    CertificateOptions, certify, certify_all, certify_polynomial,
};
use gyroceptron::network::{Architecture, GyroceptronShape, InitialWeights, Model};
use gyroceptron::phase::Section;
use gyroceptron::random::Stream;
use gyroceptron::scene::render::{self, terminal};
use gyroceptron::scene::{
    CoilFile, Coils, Folder, LineData, Note, Scene, bibtex, catalogue, certificate_table,
    command_line, default_scene, find, own_invariance_fault, run, without_page,
};
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
        Command::Fit(arguments) => fit(&arguments),
        Command::Predict(arguments) => predict(&arguments),
        Command::Import(arguments) => import(&arguments),
        Command::Export(arguments) => export(&arguments),
        Command::Completions(arguments) => about::completions(&arguments),
        Command::Manual(arguments) => about::manual(&arguments),
        Command::Cite { target } => {
            out(&cite::entries(target.as_deref())?)?;
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
    let alone = [("--section-at", section_at.as_slice()), ("--reach", reach.as_slice())];
    for (name, values) in
        [("--currents", &**currents), ("--axis", &arguments.axis)].into_iter().chain(alone)
    {
        if let Some(value) = values.iter().find(|value| !value.is_finite()) {
            return Err(Error::invalid(name, value, "finite numbers"));
        }
    }
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
    let why = "maps of this section are not reversible; those of the sections at 0 and 0.5 of coils with stellarator \
               symmetry are";
    left.left.iter().for_each(|what| line(&format!("{what} is left out: {why}")));
    for model in &left.plain {
        line(&format!("model {model} is trained without its reversor: {why}"));
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
        // The letters of a name and the space behind it.
        let width = rows.iter().map(|(name, _)| name.len() + 1).max().unwrap_or(0);
        for (name, title) in rows {
            // A line for each, where another program reads them.
            let letters = width_of_terminal().unwrap_or(usize::MAX).saturating_sub(width);
            let lines = wrapped(&title, letters);
            out(&format!("{name:width$}{}\n", lines.join(&format!("\n{:width$}", ""))))?;
        }
    }
    Ok(Status::Done)
}

/// The lines of a text of which none has more letters, but for words that have.
fn wrapped(text: &str, letters: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= letters => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// More random networks than these, all held at once, are taken for a mistake.
const MOST_RANDOM: usize = 100_000;

/// The network of `verify --random`: the gyroceptron of the paper's time-5 map.
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
    let mut coordinates = "";
    let (target, result) = match &arguments.model {
        Some(path) => match load_map(path)? {
            StoredMap::Polynomial(stored) => {
                if let Some(found) = arguments.at.first() {
                    let expected = "none: the model depends on no controls";
                    return Err(Error::invalid("--at", found, expected));
                }
                if let Some(section) = stored.map.section() {
                    coordinates = ", z in the canonical coordinates of its section";
                    notes.push(section.note_on_laws());
                }
                (path.display().to_string(), certify_polynomial(stored.map.map(), options)?)
            }
            StoredMap::Network(stored) => {
                let (stored, outside) = at_controls(*stored, &arguments.at)?;
                notes.extend(outside.iter().map(ToString::to_string));
                own_units.clone_from(&stored.units);
                if own_units.is_some() {
                    coordinates = ", z in the units of the network";
                }
                notes.extend(stored.section.as_ref().map(Section::note_on_laws));
                notes.extend(
                    own_invariance_fault(&stored, &options).iter().map(ToString::to_string),
                );
                (path.display().to_string(), certify(&stored.model, options))
            }
        },
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
    notes.iter().for_each(|text| line(&format!("note: {text}")));
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
            "{target}: {}\nsampled: {} points each, {}, seed {}{}; other points are not tested\n{}",
            result.summary(),
            options.samples,
            result.sampled_box(),
            options.seed,
            coordinates,
            terminal::table(&certificate_table(&result.rows), width()),
        ))?;
        for line in result.advice() {
            out(&format!("- {line}\n"))?;
        }
    }
    Ok(status_of(result.holds()))
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
                let (count, words) = (block.layers.count(), block.layers.kind().plural());
                format!("{} {count} {words}", block.name).trim_start().to_owned()
            })
            .collect();
        out(&format!("{}: {count} parameters, {}\n", path.display(), layers.join(", ")))?;
    }
    Ok(Status::Done)
}

fn import(arguments: &Import) -> Result<Status, Error> {
    check_ending("--output", &arguments.output, "json")?;
    let action = arguments.circle_action.as_deref().map(circle_action).transpose()?;
    let (mut tensors, place) = (read_tensors(&arguments.weights)?, arguments.weights.display());
    if tensors.values().any(|tensor| tensor.single_precision) {
        line(&format!("{place}: {}", Note::SinglePrecision));
    }
    let (place, epsilon, time) = (place.to_string(), arguments.epsilon, arguments.flow_time);
    if let Some(time) = time.filter(|time| !(time.is_finite() && *time > 0.0)) {
        return Err(Error::invalid("--flow-time", time, "a positive number"));
    }
    let (model, units) = match read_architecture(&arguments.weights)? {
        Some(own) => {
            let said = format!("of which {place} says that its weights are, or none");
            let none = "none: the network has none";
            if action.is_some_and(|action| own.circles != action.circles()) {
                let circles = own.circles.iter().map(ToString::to_string).collect::<Vec<_>>();
                let expected = format!("{}, {said}", circles.join("/"));
                let expected = if circles.is_empty() { none.to_owned() } else { expected };
                let found = arguments.circle_action.clone().unwrap_or_default();
                return Err(Error::invalid("--circle-action", found, expected));
            }
            let numbers = [
                ("--epsilon", epsilon, own.has_circle().then_some(own.epsilon)),
                ("--flow-time", time, own.has_flow_time().then_some(own.flow_time)),
            ];
            for (option, given, own) in numbers {
                if let Some(given) = given.filter(|given| own != Some(*given)) {
                    let expected = own.map_or(none.to_owned(), |own| format!("{own}, {said}"));
                    return Err(Error::invalid(option, given, expected));
                }
            }
            let units = take_units(&place, &mut tensors, own.dof)?;
            (assemble_architecture(&place, tensors, own)?, units)
        }
        None => {
            let expected = || format!("a value: {place} does not say it");
            let none = |option: &str| Error::invalid(option, "none", expected());
            let action = action.ok_or_else(|| none("--circle-action"))?;
            let epsilon = epsilon.ok_or_else(|| none("--epsilon"))?;
            let units = take_units(&place, &mut tensors, action.dof())?;
            let model = assemble_weights(&place, tensors, &action, epsilon, time);
            let model = model.map_err(|e| match e {
                Error::Invalid { ref name, .. } if name == "flow_time" => {
                    e.with_place("--flow-time")
                }
                other => other,
            })?;
            (model, units)
        }
    };
    let architecture = model.architecture();
    let flow_time = architecture.has_flow_time().then_some(architecture.flow_time);
    guard_output("--output", &arguments.output, arguments.overwrite, &[&arguments.weights])?;
    let provenance = Provenance {
        data: Some(file_digest(&arguments.weights)?),
        flow_time: flow_time.or(arguments.flow_time),
        ..Provenance::of_scene("import")
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
    stored.beyond_learnt().iter().for_each(|text| line(&format!("note: {text}")));
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
    let code = SourceCode::generate(&stored, language, &name, member.as_deref())
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
