//! Whatever one caller can, all can: the rows of tests/abilities.toml from Rust and by the program, to the
//! same bits and with the same notes. tests/python/test_abilities.py does them from Python.

use crate::helpers::{command, folder, succeeds, text};
use gyroceptron::Error;
use gyroceptron::flow::{Pairs, Window};
use gyroceptron::io::{Checkpoints, StoredModel, load_checkpoint, save_model, write_pairs};
use gyroceptron::layer::{Activation, CircleAction, Neuron, Reversor, TorusAction};
use gyroceptron::network::{
    Alternating, Block, LayerSizes, Layers, Modules, NamedArchitecture, NetworkSpec, Part,
};
use gyroceptron::scene::{Folder, OwnTraining, TrainingTimes, parse};
use gyroceptron::system::Oscillators;
use gyroceptron::train::{
    AdamOptions, Checkpoint, Control, FamilyPairs, Fit, FitNote, Fitted, LbfgsOptions,
    LevenbergMarquardtOptions, Loss, Optimiser, Plateau, Progress, RampStage, Starts, Stop,
    TrainingObserver, TrainingOptions, TrainingStage,
};
use serde::Deserialize;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Stdio;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Abilities {
    pairs: BTreeMap<String, PairsOf>,
    from: BTreeMap<String, Asked>,
    ability: Vec<Ability>,
    exceptions: BTreeMap<String, BTreeMap<String, String>>,
}

/// What is asked for, in options of the program and in keywords of Python.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Asked {
    program: toml::Table,
    #[expect(dead_code, reason = "read by the tests of Python")]
    python: toml::Table,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Ability {
    name: String,
    #[serde(default = "small")]
    from: String,
    #[serde(default = "plain")]
    pairs: String,
    program: toml::Table,
    python: toml::Table,
    /// The file own.toml.
    scene: Option<String>,
    note: Option<String>,
    #[serde(default)]
    effect: Effect,
}

fn small() -> String {
    "small".into()
}

fn plain() -> String {
    "plain".into()
}

/// What an ability changes beside the same training without it.
#[derive(Clone, Copy, Default, Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum Effect {
    #[default]
    Parameters,
    Model,
    Note,
    Stop,
    Report,
    Resume,
    Interrupt,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PairsOf {
    columns: Option<Vec<usize>>,
    #[serde(default = "one")]
    scale: f64,
    #[serde(default)]
    epsilons: Vec<f64>,
    #[serde(default)]
    times: Vec<f64>,
    /// Of each map.
    #[serde(default = "few")]
    count: usize,
}

fn one() -> f64 {
    1.0
}

const TABLE: &str = include_str!("../abilities.toml");
const STUB: &str = include_str!("../../src/python/gyroceptron/__init__.pyi");

/// Python's texts name all architectures and all their parts.
#[test]
fn texts_of_python_name_all_architectures() {
    let texts = [
        STUB,
        include_str!("../../src/python/training.rs"),
        include_str!("../../src/python/model.rs"),
    ];
    for named in NamedArchitecture::ALL {
        let name = format!("\"{}\"", named.name);
        assert!(texts.iter().all(|text| text.contains(&name)), "{name}");
        let is_word = |text: &str, key: &str| {
            let part = |c: char| c.is_alphanumeric() || c == '_';
            text.match_indices(key).any(|(at, _)| {
                let behind = &text[at + key.len()..];
                // An argument of a signature.
                !text[..at].ends_with(part)
                    && (behind.starts_with(": _Layers") || behind.starts_with("=None"))
            })
        };
        let has_all = |text: &&str| named.sizes.iter().all(|(key, _)| is_word(text, key));
        assert!(texts[..2].iter().all(has_all), "{name}");
    }
}

fn table() -> Abilities {
    toml::from_str(TABLE).expect("the table is whole")
}

fn circles(weights: &[[i32; 2]]) -> TorusAction {
    let circles: Vec<_> = weights.iter().map(|weights| CircleAction::new(*weights)).collect();
    TorusAction::new(circles).expect("circles")
}

fn named(name: &str, sizes: &[(&'static str, LayerSizes)]) -> Option<NetworkSpec> {
    let network = NetworkSpec::named(name).expect("a name");
    let with = |network: NetworkSpec, &(key, size): &(&'static str, LayerSizes)| {
        network.with_size(key, size).expect("a part that it has")
    };
    Some(sizes.iter().fold(network, with))
}

fn of(count: usize, width: usize) -> LayerSizes {
    LayerSizes::uniform(count, width)
}

fn of_degree(count: usize, width: usize, degree: usize) -> LayerSizes {
    LayerSizes { degree: Some(degree), ..of(count, width) }
}

fn of_arctan(count: usize, width: usize) -> LayerSizes {
    LayerSizes { activation: Some(Neuron::Arctan), ..of(count, width) }
}

fn by_turns(count: usize, widths: [usize; 2]) -> LayerSizes {
    LayerSizes { count, width: Alternating::Two(widths), degree: None, activation: None }
}

/// `from` of the table.
fn base(name: &str) -> Fit {
    let action = Some(circles(&[[1, 0]]));
    let with = |mut fit: Fit, iterations| {
        fit.training.starts = None;
        Fit { action: action.clone(), ..fit.with_iterations(iterations) }
    };
    let normal_form = |layers, width| {
        named("normal-form", &[("kicks", of(layers, width)), ("twists", of(layers, width))])
    };
    let adam = |mut fit: Fit| {
        fit.training.optimiser = Optimiser::Adam(AdamOptions::default());
        fit.training.plateau = None;
        fit
    };
    match name {
        "small" => with(Fit { network: normal_form(2, 2), ..Fit::default() }, 8),
        "turned" => {
            let (network, theta) = (normal_form(2, 2), Some(0.4));
            with(Fit { network, theta, ..Fit::default() }, 8)
        }
        "paper" => {
            let network = named("gyroceptron", &[("psi", of(1, 2)), ("near_identity", of(1, 2))]);
            with(Fit { network, theta: Some(0.5), ..Fit::paper() }, 8)
        }
        "restless" => adam(with(Fit { network: normal_form(2, 2), ..Fit::default() }, 40)),
        "endless" => {
            let (network, theta) = (normal_form(4, 6), Some(0.4));
            adam(with(Fit { network, theta, ..Fit::default() }, 40))
        }
        _ => panic!("no such options: {name}"),
    }
}

/// An ability in Rust.
type Case = (&'static str, fn(&mut Fit));

/// The abilities of the table in Rust.
const CASES: &[Case] = &[
    ("the circle action is found", |fit| fit.action = None),
    ("several circles", |fit| fit.action = Some(circles(&[[1, 0], [0, 1]]))),
    ("a family of epsilon", |_| ()),
    ("epsilon below 0", |_| ()),
    ("a family of flow times", |_| ()),
    ("a ramp of other flow times", |fit| {
        let flow_time = Some(0.5);
        fit.training.ramp = vec![RampStage {
            flow_time,
            epsilon: None,
            repeats: None,
            degree: None,
            iterations: 3,
        }];
    }),
    ("a ramp whose twists are repeated", |fit| {
        fit.network = named("normal-form", &[("kicks", of(2, 2)), ("twists", of(4, 2))]);
        let (flow_time, repeats) = (Some(0.5), Some(2));
        let stage = RampStage { flow_time, repeats, iterations: 3, ..RampStage::default() };
        fit.training.ramp = vec![stage];
    }),
    ("a ramp of another epsilon", |fit| {
        let stage = RampStage { epsilon: Some(0.1), iterations: 3, ..RampStage::default() };
        fit.training.ramp = vec![stage];
    }),
    ("another order of columns is a warning", |_| ()),
    ("units are fitted", |_| ()),
    ("units of the data", |fit| fit.units = false),
    ("several starts", |fit| {
        fit.training.starts = Some(Starts { count: 3, iterations: Starts::TRIAL });
    }),
    ("the recipe of the paper", |fit| {
        *fit = Fit { action: fit.action.take(), ..Fit::paper().with_iterations(8) };
    }),
    ("epsilon", |fit| fit.epsilon = Some(0.3)),
    ("a flow time", |fit| fit.flow_time = Some(2.5)),
    ("the network's own epsilon of a family", |fit| fit.epsilon = Some(0.3)),
    ("the network's own flow time of a family", |fit| fit.flow_time = Some(2.5)),
    ("an angle to start from", |fit| fit.theta = Some(0.4)),
    ("a fixed angle", |fit| fit.training.theta_fixed = true),
    ("a penalty on the angle", |fit| fit.training.theta_penalty = 5.0),
    ("a penalty on the near-identity map", |fit| fit.training.near_identity_penalty = 100.0),
    ("weights of planes in the loss", |fit| {
        fit.training.loss = Loss::ByPlane { weights: Some(vec![1.0, 3.0]) };
    }),
    ("a loss without weights", |fit| fit.training.loss = Loss::MeanSquaredError),
    ("weights by the motion of each plane", |fit| {
        fit.training.loss = Loss::ByPlane { weights: None };
    }),
    ("L-BFGS", |fit| {
        fit.training.optimiser = Optimiser::Lbfgs(LbfgsOptions::default());
        fit.training.plateau = None;
    }),
    ("Levenberg-Marquardt", |fit| {
        let options = LevenbergMarquardtOptions::default();
        fit.training.optimiser = Optimiser::LevenbergMarquardt(options);
        fit.training.plateau = Some(Plateau::default());
    }),
    ("Adam", |fit| {
        fit.training.optimiser = Optimiser::Adam(AdamOptions::default());
        fit.training.plateau = None;
    }),
    ("iterations", |fit| fit.training.iterations = 5),
    ("a target", |fit| fit.training.target = 0.5),
    ("patience", |fit| fit.training.patience = 1),
    ("a plateau", |fit| fit.training.plateau = Plateau::of_windows(10)),
    ("the share that is held out", |fit| fit.validation = 0.4),
    ("a seed", |fit| fit.seed = 7),
    ("an architecture", |fit| {
        fit.network = named("kicked-gyroceptron", &[("psi", of(1, 2)), ("kicks", of(2, 2))]);
    }),
    ("sizes of a gyroceptron", |fit| {
        fit.network = named("gyroceptron", &[("psi", of(1, 3)), ("near_identity", of(2, 2))]);
    }),
    ("sizes of a normal form", |fit| {
        let sizes = [("kicks", of(2, 3)), ("twists", by_turns(2, [2, 3]))];
        fit.network = named("normal-form", &sizes);
    }),
    ("turned twists of a normal form", |fit| {
        let sizes = [("kicks", of(2, 3)), ("turned_twists", of(2, 2))];
        fit.network = named("normal-form", &sizes);
    }),
    ("neurons of arctan", |fit| {
        let sizes = [("kicks", of_arctan(2, 3)), ("twists", of_arctan(2, 2))];
        fit.network = named("normal-form", &sizes);
    }),
    ("polynomials in their box", |fit| {
        let sizes = [("kicks", of_degree(2, 2, 3)), ("twists", of_degree(2, 2, 2))];
        let network = named("normal-form", &sizes).expect("a normal form");
        fit.network = network.with_radius(1.5).ok();
    }),
    ("a reversible map", |fit| {
        fit.network = fit.network.take().and_then(|of| of.reversible(Reversor::Momenta).ok());
    }),
    ("polynomials in the box of the pairs, in stages", |fit| {
        fit.network = named("normal-form", &[("kicks", of_degree(2, 2, 4)), ("twists", of(2, 2))]);
        fit.training.ramp = vec![RampStage {
            flow_time: None,
            epsilon: None,
            repeats: None,
            degree: Some(2),
            iterations: 3,
        }];
    }),
    ("two widths by turns of any part", |fit| {
        let sizes = [
            ("kicks", by_turns(2, [3, 1])),
            ("twists", by_turns(2, [2, 3])),
            ("psi", by_turns(2, [1, 2])),
            ("perturbation", by_turns(2, [1, 2])),
        ];
        fit.network = named("normal-form", &sizes);
    }),
    ("a perturbation", |fit| {
        let network = fit.network.take().expect("a normal form");
        fit.network = network.with_size("perturbation", of(1, 2)).ok();
    }),
    ("layers of a HénonNet", |fit| {
        fit.network = named("henon-net", &[("layers", of(2, 3))]);
    }),
    ("a list of blocks", |fit| {
        let (activation, plain) = (Activation::Tanh, false);
        let modules = Modules { modules: 2, shears: 2, activation, plain };
        let blocks = [
            Block::new(Part::Conjugation, Layers::SympNet(modules)),
            Block::new(Part::NearIdentity, Layers::TurnedKick(vec![2, 2])),
        ];
        fit.network = Some(NetworkSpec::of_blocks(blocks));
    }),
    ("a scene's network and training", |fit| {
        let table = table();
        let ability = table.ability.iter().find(|ability| ability.name.starts_with("a scene's"));
        let text = ability.and_then(|ability| ability.scene.as_deref()).expect("a scene");
        let of_scene = parse("own.toml", text).and_then(|scene| scene.fit()).expect("a scene");
        *fit = Fit { action: fit.action.take(), ..of_scene };
    }),
    ("a report", |_| ()),
    ("a checkpoint that is gone on with", |_| ()),
    ("an interruption", |_| ()),
];

fn few() -> usize {
    60
}

impl PairsOf {
    /// Pairs of each map in the usual order of columns and in units of order one, and the ε and the flow time of each.
    fn maps(&self) -> (Pairs, Option<[Vec<f64>; 2]>) {
        let or = |values: &[f64], usual: f64| {
            if values.is_empty() { vec![usual] } else { values.to_vec() }
        };
        let (epsilons, times) = (or(&self.epsilons, 0.05), or(&self.times, 0.7));
        let is_family = epsilons.len() * times.len() > 1;
        let (mut input, mut output) = (Vec::new(), Vec::new());
        let mut conditions = [Vec::new(), Vec::new()];
        let window = Window { low: vec![-1.0; 4], high: vec![1.0; 4], samples: self.count };
        for &epsilon in &epsilons {
            for &time in &times {
                let seed = conditions[0].len() as u64;
                let system = Oscillators { epsilon };
                let pairs = Pairs::of_windows(&system, std::slice::from_ref(&window), time, seed)
                    .expect("a flow");
                input.extend_from_slice(pairs.input());
                output.extend_from_slice(pairs.output());
                conditions[0].extend(vec![epsilon; self.count]);
                conditions[1].extend(vec![time; self.count]);
            }
        }
        let pairs = Pairs::new("pairs", 2, input, output).expect("finite");
        (pairs, is_family.then_some(conditions))
    }

    /// The pairs for Rust, and as they are written for the program.
    fn of(&self) -> (FamilyPairs, Pairs) {
        let (pairs, conditions) = self.maps();
        let scaled = |values: &[f64]| values.iter().map(|v| self.scale * v).collect::<Vec<_>>();
        let pairs = Pairs::new("pairs", 2, scaled(pairs.input()), scaled(pairs.output()));
        let mut pairs = pairs.expect("finite");
        if let Some(columns) = &self.columns {
            pairs = pairs.with_columns(columns);
        }
        let Some([epsilons, times]) = conditions else { return (pairs.clone().into(), pairs) };
        let written = pairs.clone().with_epsilons_and_times(&epsilons, &times).expect("a family");
        let family = FamilyPairs::new(pairs, Some(&epsilons), Some(&times), None);
        (family.expect("a family"), written)
    }

    /// The pairs of the same motion, of which nothing is known.
    fn bare(&self) -> FamilyPairs {
        self.maps().0.into()
    }
}

/// `--option value` for each of them.
fn words(options: &toml::Table) -> Vec<String> {
    let words = |(key, value): (&String, &toml::Value)| match value {
        toml::Value::Boolean(true) => vec![format!("--{key}")],
        toml::Value::Boolean(false) => Vec::new(),
        toml::Value::String(text) => vec![format!("--{key}"), text.clone()],
        other => panic!("{key}: a text or true: {other}"),
    };
    options.iter().flat_map(words).collect()
}

fn parameters(fitted: &Fitted) -> Vec<u64> {
    fitted.model().parameters().iter().map(|number| number.to_bits()).collect()
}

/// The file of a model.
fn bytes(fitted: &Fitted, name: &str) -> Vec<u8> {
    let folder = folder();
    let path = folder.path().join("model.json");
    save_model(&path, &StoredModel::of_fit(fitted, name)).expect("written");
    std::fs::read(path).expect("written")
}

fn notes(fitted: &Fitted) -> Vec<String> {
    fitted.problem.notes.iter().map(ToString::to_string).collect()
}

/// The line of the program for each note begins so.
fn line(place: &str, note: &FitNote) -> String {
    match note {
        FitNote::Recommended(_) => format!("recommended: {note}"),
        _ => format!("{place}: {note}"),
    }
}

/// What the program made of a call.
struct Called {
    model: Vec<u8>,
    /// Its notes.
    lines: Vec<String>,
    stop: Value,
}

/// An ability on its way through the callers.
struct Trial<'a> {
    ability: &'a Ability,
    fit: Fit,
    /// The same without it.
    without: Fit,
    program: toml::Table,
    data: FamilyPairs,
    /// The same pairs where nothing is known of them.
    bare: FamilyPairs,
    folder: &'a Path,
}

impl Trial<'_> {
    fn run(&self, fit: &Fit, observer: &mut StoppingObserver) -> Fitted {
        let name = &self.ability.name;
        let fitted = fit.run_observed(self.data.clone(), observer);
        fitted.unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// The arguments of the program, with others in place of some and without some.
    fn arguments(&self, output: &str, more: &[(&str, &str)], less: &[&str]) -> Vec<String> {
        let mut options = self.program.clone();
        less.iter().for_each(|key| drop(options.remove(*key)));
        options.insert("data".into(), format!("{}.npz", self.ability.pairs).into());
        options.insert("output".into(), output.into());
        for (key, value) in more {
            options.insert((*key).into(), (*value).into());
        }
        [vec!["train".to_owned()], words(&options)].concat()
    }

    /// The program's model file and its notes.
    fn program(&self, more: &[(&str, &str)], less: &[&str]) -> Called {
        let arguments = self.arguments("m.json", more, less);
        let mut arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        arguments.push("--json");
        let output = succeeds(self.folder, &arguments);
        let said = text(&output.stderr);
        let of_note = |line: &&str| {
            !(line.starts_with("training ") || line.contains(": iteration ") || line.ends_with('…'))
        };
        let lines = said.lines().filter(of_note).map(str::to_owned).collect();
        let json: Value = serde_json::from_slice(&output.stdout).expect("one JSON document");
        Called { model: self.model(), lines, stop: json["stop"].clone() }
    }

    /// The file of a model of Rust.
    fn bytes(&self, fitted: &Fitted) -> Vec<u8> {
        let scene = self.ability.scene.as_deref().map(|text| parse("own.toml", text));
        let scene = scene.map(|scene| scene.expect("a scene").name);
        bytes(fitted, scene.as_deref().unwrap_or("train"))
    }

    fn model(&self) -> Vec<u8> {
        std::fs::read(self.folder.join("m.json")).expect("a model")
    }

    /// Both callers give the same model and notes, and the ability changes something.
    fn check(&self) {
        let (name, effect) = (&self.ability.name, self.ability.effect);
        let fitted = self.run(&self.fit, &mut StoppingObserver::default());
        let without = match self.ability.program.is_empty() {
            true => self.without.run(self.bare.clone()).expect("trains"),
            false => self.run(&self.without, &mut StoppingObserver::default()),
        };
        match effect {
            Effect::Resume => return self.check_resume(&fitted),
            Effect::Interrupt => return self.check_interruption(&fitted),
            Effect::Parameters => {
                assert_ne!(parameters(&fitted), parameters(&without), "{name}: changes nothing");
            }
            Effect::Model => {
                assert_eq!(parameters(&fitted), parameters(&without), "{name}: say `parameters`");
                assert_ne!(self.bytes(&fitted), self.bytes(&without), "{name}: changes nothing");
            }
            Effect::Note => assert!(self.ability.note.is_some(), "{name}: which note?"),
            Effect::Stop => {
                let last = |fitted: &Fitted| fitted.outcome().history.last().map(|r| r.iteration);
                assert!(last(&fitted) < last(&without), "{name}: it does not stop");
                assert_ne!(fitted.outcome().stop, without.outcome().stop, "{name}");
            }
            Effect::Report => assert!(!self.folder.join("r").exists()),
        }
        if let Some(words) = &self.ability.note {
            let has = |fitted: &Fitted| notes(fitted).iter().any(|note| note.contains(words));
            assert!(has(&fitted), "{name}: {:?}", notes(&fitted));
            assert!(!has(&without), "{name}: the note is always there");
        }
        if effect == Effect::Parameters {
            assert!(fitted.outcome().best.iteration > 0, "{name}: learns nothing");
        }
        let Called { model, lines, stop } = self.program(&[], &[]);
        let expected = serde_json::to_value(fitted.outcome().stop).expect("a word");
        assert_eq!(stop, expected, "{name}");
        assert!(model == self.bytes(&fitted), "{name}: the program's model is another");
        let place = format!("{}.npz", self.ability.pairs);
        let expected: Vec<String> =
            fitted.problem.notes.iter().map(|note| line(&place, note)).collect();
        assert_eq!(lines.len(), expected.len(), "{name}: {lines:?}, {expected:?}");
        for (line, expected) in lines.iter().zip(&expected) {
            assert!(line.starts_with(expected), "{name}: {line} for {expected}");
        }
        if effect == Effect::Report {
            self.check_report(fitted);
        }
    }

    fn check_report(&self, fitted: Fitted) {
        let own = Folder::open_report(&self.folder.join("own"), false).expect("a folder");
        let times = TrainingTimes {
            model: "train".into(),
            points: vec![(1, 0.1), (8, 0.8)],
            ..TrainingTimes::default()
        };
        let (name, command) = ("train".into(), "the same call".into());
        let next = &|_| String::new();
        OwnTraining { name, fitted, times, command, next }.report(&own).expect("a report");
        let read = |folder: &str, file: &str| {
            std::fs::read_to_string(self.folder.join(folder).join(file)).expect("a report")
        };
        for file in ["as-run.toml", "report.json"] {
            assert_eq!(read("r", file), read("own", file), "{file}");
        }
        let sections = |text: String| -> Vec<String> {
            text.lines().filter(|line| line.starts_with('#')).map(str::to_owned).collect()
        };
        let [program, own] = ["r", "own"].map(|folder| sections(read(folder, "report.md")));
        assert_eq!(program, own);
    }

    /// The rest of a training from a checkpoint, of Rust and of the program, by either.
    fn check_resume(&self, whole: &Fitted) {
        let whole = self.bytes(whole);
        let short = self.fit.clone().with_iterations(4);
        let mut watch = StoppingObserver::new(self.folder.join("c"), false);
        assert_ne!(self.bytes(&self.run(&short, &mut watch)), whole, "it is short");
        let of_rust = std::fs::read(self.folder.join("c")).expect("a checkpoint");
        let mut watch = StoppingObserver::new(self.folder.join("c"), true);
        assert!(self.bytes(&self.run(&self.fit, &mut watch)) == whole, "another model");
        assert_eq!(watch.seen.first(), Some(&5));
        let all = self.arguments("m.json", &[], &[]);
        let refused = command(self.folder, &[]).args(&all).output().expect("the program starts");
        assert_eq!(refused.status.code(), Some(2), "there is no checkpoint");
        assert!(text(&refused.stderr).contains("m.json.checkpoint"));
        self.program(&[("iterations", "4")], &["resume"]);
        assert!(self.model() != whole, "it is short");
        assert!(self.program(&[], &[]).model == whole, "the program's model is another");
        std::fs::write(self.folder.join("m.json.checkpoint"), of_rust).expect("written");
        assert!(self.program(&[], &[]).model == whole, "from a checkpoint of Rust");
    }

    /// Stopped on the way, it leaves a checkpoint, from which it comes to the same bits.
    fn check_interruption(&self, whole: &Fitted) {
        let mut watch =
            StoppingObserver { stops_at: 4, ..StoppingObserver::new(self.folder.join("c"), false) };
        let stopped = self.run(&self.fit, &mut watch);
        assert_eq!(stopped.outcome().stop, Stop::Interrupted);
        assert_eq!(watch.seen.last(), Some(&4));
        let mut watch = StoppingObserver::new(self.folder.join("c"), true);
        assert!(self.bytes(&self.run(&self.fit, &mut watch)) == self.bytes(whole), "another model");
        assert_eq!(watch.seen.first(), Some(&5));
        #[cfg(unix)]
        {
            let endless = self.arguments("m.json", &[("iterations", "1000000000")], &[]);
            let mut child = command(self.folder, &[])
                .args(&endless)
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .expect("starts");
            let checkpoint = self.folder.join("m.json.checkpoint");
            while !checkpoint.exists() {
                assert!(child.try_wait().expect("a child").is_none(), "it goes on");
                std::thread::sleep(std::time::Duration::from_millis(1));
            }
            let id = child.id().to_string();
            let signal = std::process::Command::new("kill").args(["-INT", &id]).status();
            assert!(signal.expect("sent").success());
            assert_eq!(child.wait().expect("ends").code(), Some(130));
            assert!(!self.folder.join("m.json").exists());
            let reached = load_checkpoint(&checkpoint).expect("a checkpoint").last().iteration;
            let rest = reached + 3;
            let fit = self.fit.clone().with_iterations(rest);
            let whole = self.bytes(&self.run(&fit, &mut StoppingObserver::default()));
            let rest = self.arguments("m.json", &[("iterations", &rest.to_string())], &[]);
            let rest: Vec<&str> = rest.iter().map(String::as_str).collect();
            succeeds(self.folder, &[&rest[..], &["--resume"]].concat());
            assert!(self.model() == whole, "the program's model is another");
        }
    }
}

/// Saves checkpoints to the path that it is given, and stops at an iteration.
#[derive(Default)]
struct StoppingObserver {
    checkpoints: Option<Checkpoints>,
    /// 0 is never.
    stops_at: u64,
    seen: Vec<u64>,
}

impl StoppingObserver {
    fn new(file: impl Into<std::path::PathBuf>, resume: bool) -> Self {
        Self { checkpoints: Some(Checkpoints::new(file, resume)), ..Self::default() }
    }
}

impl TrainingObserver for StoppingObserver {
    fn earlier(&mut self, stage: TrainingStage) -> Result<Option<Checkpoint>, Error> {
        self.checkpoints.as_mut().map_or(Ok(None), |checkpoints| checkpoints.earlier(stage))
    }

    fn observe(&mut self, stage: TrainingStage, progress: Progress<'_>) -> Result<Control, Error> {
        if let Some(checkpoints) = &mut self.checkpoints {
            checkpoints.observe(stage, progress)?;
        }
        self.seen.push(progress.record.iteration);
        let stops = self.stops_at == progress.record.iteration;
        Ok(if stops { Control::Interrupt } else { Control::Continue })
    }
}

/// Each ability from Rust and by the program: the same model and notes, which are others without it.
#[test]
fn every_ability_is_one_of_rust_and_of_the_program() {
    let table = table();
    let names: Vec<&str> = table.ability.iter().map(|ability| &ability.name[..]).collect();
    let cases: Vec<&str> = CASES.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, cases, "the table and its cases in Rust");
    for (ability, (_, case)) in table.ability.iter().zip(CASES) {
        let folder = folder();
        let (data, written) = table.pairs[&ability.pairs].of();
        write_pairs(&folder.path().join(format!("{}.npz", ability.pairs)), &written)
            .expect("written");
        if let Some(scene) = &ability.scene {
            std::fs::write(folder.path().join("own.toml"), scene).expect("written");
        }
        let without = base(&ability.from);
        let mut fit = without.clone();
        case(&mut fit);
        let mut program = table.from[&ability.from].program.clone();
        program.extend(ability.program.clone());
        let bare = table.pairs[&ability.pairs].bare();
        Trial { ability, fit, without, program, data, bare, folder: folder.path() }.check();
    }
}

/// The names of the fields of a structure, and whether two values differ there. A new field does not compile
/// until it is listed.
macro_rules! fields {
    ($type:ident { $($field:ident),* $(,)? }, $one:expr, $other:expr) => {
        fields!("", $type { $($field),* }, $one, $other)
    };
    ($of:literal, $type:ident { $($field:ident),* $(,)? }, $one:expr, $other:expr) => {{
        let $type { $($field),* } = $one;
        [$((concat!($of, stringify!($field)), *$field != $other.$field)),*]
    }};
}

/// All fields of a fit, and which differ.
fn changed(one: &Fit, other: &Fit) -> BTreeMap<&'static str, bool> {
    let of_fit = fields!(
        Fit {
            place,
            action,
            network,
            weights,
            epsilon,
            flow_time,
            theta,
            training,
            section,
            controls,
            units,
            validation,
            seed,
        },
        one,
        other
    );
    let of_training = fields!(
        TrainingOptions {
            loss,
            near_identity_penalty,
            theta_fixed,
            theta_penalty,
            optimiser,
            iterations,
            validate_every,
            target,
            patience,
            plateau,
            gradient_tolerance,
            checkpoint_every,
            starts,
            ramp,
            fresh_twists,
        },
        &one.training,
        other.training
    );
    let stage = |of: &Fit| of.training.ramp.first().copied().unwrap_or_default();
    let of_stage = fields!(
        "ramp.",
        RampStage { flow_time, epsilon, repeats, degree, iterations },
        &stage(one),
        stage(other)
    );
    let starts =
        |of: &Fit| of.training.starts.unwrap_or(Starts { count: 1, iterations: Starts::TRIAL });
    let of_starts = fields!("starts.", Starts { count, iterations }, &starts(one), starts(other));
    of_fit.into_iter().chain(of_training).chain(of_stage).chain(of_starts).collect()
}

/// Fails unless abilities and exceptions are, together and none twice, all that there is.
fn complete(what: &str, all: &BTreeSet<String>, named: &BTreeSet<String>, table: &Abilities) {
    let exceptions = &table.exceptions[what];
    for name in all {
        let excepted = exceptions.contains_key(name);
        assert!(named.contains(name) || excepted, "{what}: no ability has {name}");
        assert!(!(named.contains(name) && excepted), "{what}: {name} is no exception");
    }
    let unknown = named.iter().chain(exceptions.keys()).find(|name| !all.contains(*name));
    assert_eq!(unknown, None, "{what}: there is no such thing");
    let reasons = exceptions.values();
    assert!(reasons.into_iter().all(|reason| !reason.is_empty()), "{what}: reasons");
}

/// Each field of a fit, each option of the program and each keyword of Python is one of an ability, or is an
/// exception with a reason.
#[test]
fn no_ability_is_left_out() {
    let table = table();
    let named = |of: fn(&Ability) -> &toml::Table| -> BTreeSet<String> {
        table.ability.iter().flat_map(|ability| of(ability).keys().cloned()).collect()
    };
    let help = text(&succeeds(folder().path(), &["train", "--help"]).stdout);
    let option = |line: &str| {
        let rest = line.trim_start().split_once("--")?;
        let starts = rest.0.is_empty() || rest.0.len() == 4 && rest.0.ends_with(", ");
        let end = rest.1.find(|c: char| !(c.is_alphanumeric() || c == '-'));
        starts.then(|| rest.1[..end.unwrap_or(rest.1.len())].to_owned())
    };
    let options: BTreeSet<String> = help.lines().filter_map(option).collect();
    assert!(options.len() > 30, "{options:?}");
    complete("program", &options, &named(|ability| &ability.program), &table);

    let stub = STUB.split("\ndef train(").nth(1).and_then(|rest| rest.split(") -> Model").next());
    let keyword = |line: &str| {
        let (name, _) = line.strip_prefix("    ")?.split_once(':')?;
        name.starts_with(char::is_alphabetic).then(|| name.to_owned())
    };
    let keywords: BTreeSet<String> = stub.expect("train").lines().filter_map(keyword).collect();
    assert!(keywords.len() > 30, "{keywords:?}");
    complete("python", &keywords, &named(|ability| &ability.python), &table);

    let mut fields = BTreeMap::new();
    for (ability, (_, case)) in table.ability.iter().zip(CASES) {
        let without = base(&ability.from);
        let mut fit = without.clone();
        case(&mut fit);
        for (field, differs) in changed(&fit, &without) {
            *fields.entry(field.to_owned()).or_insert(false) |= differs;
        }
    }
    let all = fields.keys().cloned().collect();
    let named = fields.into_iter().filter(|(_, differs)| *differs).map(|(field, _)| field);
    complete("fit", &all, &named.collect(), &table);
}
