//! Controls: pairs with values of them in, a model that takes others out; and the scene of a machine whose currents
//! change.

use crate::helpers::{call, folder, refuses, succeeds, text};
use gyroceptron::flow::Pairs;
use gyroceptron::io::{
    StoredModel, load_model, read_trajectories, save_model, write_pairs, write_points,
};
use gyroceptron::layer::CircleAction;
use gyroceptron::network::{LayerSizes, NetworkSpec, Rollout};
use gyroceptron::random::Stream;
use gyroceptron::scalar::max_or_nan;
use gyroceptron::train::{
    ControlOptions, FamilyPairs, Fit, LevenbergMarquardtOptions, Optimiser, TrainingOptions,
};
use std::path::Path;

/// A turn by an angle that depends on a control, and a kick by a polynomial whose strength does.
fn map(value: f64, z: &mut [f64]) {
    let (sin, cos) = (0.6 + 0.05 * value).sin_cos();
    let p = z[1] - (0.1 + 0.02 * value) * z[0] * z[0];
    (z[0], z[1]) = (cos * z[0] + sin * p, -sin * z[0] + cos * p);
}

/// Pairs at these values of the control in pairs.npz, and two points in z.npy; the pairs and the values.
pub fn write_files(folder: &Path, at: &[f64]) -> (Pairs, Vec<f64>) {
    let mut stream = Stream::new(4, "points");
    let (mut input, mut output, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for value in at {
        for _ in 0..50 {
            let mut z = [stream.uniform(-0.5, 0.5), stream.uniform(-0.5, 0.5)];
            input.extend(z);
            map(*value, &mut z);
            output.extend(z);
            values.push(*value);
        }
    }
    let plain = Pairs::new("pairs", 1, input, output).expect("finite");
    let ones = vec![1.0; plain.len()];
    let pairs = plain.clone().under_controls(&ones, &ones, &values).expect("values");
    write_pairs(&folder.join("pairs.npz"), &pairs).expect("written");
    write_points(&folder.join("z.npy"), &[2, 2], &[0.3, 0.1, -0.2, 0.25]).expect("written");
    (plain, values)
}

const TRAIN: [&str; 18] = [
    "train",
    "--data",
    "pairs.npz",
    "--circle-action",
    "1",
    "--kicks",
    "4x1^4",
    "--twists",
    "1x1^3",
    "--perturbation",
    "4x1^4",
    "--starts",
    "1",
    "--iterations=40",
    "--controls",
    "coil",
    "--output",
    "model.json",
];

/// Of two iterations.
pub fn brief() -> Vec<&'static str> {
    TRAIN
        .iter()
        .map(|word| if *word == "--iterations=40" { "--iterations=2" } else { word })
        .collect()
}

/// Of the control.
pub const VALUES: [f64; 7] = [-1.0, -0.7, -0.4, 0.0, 0.3, 0.6, 1.0];

#[test]
fn a_model_takes_values_of_its_controls() {
    let folder = folder();
    let path = folder.path();
    let (pairs, values) = write_files(path, &VALUES);
    let done = succeeds(path, &TRAIN);
    let said = text(&done.stderr);
    assert!(said.contains("coil from -1 to 1"), "{said}");
    assert!(said.contains("one value between the others are held out"), "{said}");
    let report = std::fs::read_to_string(path.join("model-report/report.md")).expect("a report");
    assert!(report.contains("--controls coil --control-degree 4"), "{report}");
    assert!(report.contains("--output TRAJECTORIES.npy --at coil=-0.5"), "{report}");
    // A library user comes to the same bits.
    let named = NetworkSpec::named("normal-form").expect("a name");
    let sizes = [("kicks", 4, 4), ("twists", 1, 3), ("perturbation", 4, 4)];
    let network = sizes.into_iter().fold(named, |spec, (key, count, degree)| {
        let size = LayerSizes { degree: Some(degree), ..LayerSizes::uniform(count, 1) };
        spec.with_size(key, size).expect("a part")
    });
    let fit = Fit {
        place: "pairs.npz".into(),
        action: Some(CircleAction::new([1]).into()),
        network: Some(network),
        controls: ControlOptions { names: vec!["coil".into()], degree: None },
        training: TrainingOptions {
            iterations: 40,
            starts: None,
            optimiser: Optimiser::LevenbergMarquardt(LevenbergMarquardtOptions::default()),
            ..Fit::default().training
        },
        ..Fit::default()
    };
    let data = FamilyPairs::new(pairs, None, None, Some(&values)).expect("values");
    let fitted = fit.run(data).expect("trains");
    save_model(&path.join("own.json"), &StoredModel::of_fit(&fitted, "train")).expect("written");
    let bytes = |name: &str| std::fs::read(path.join(name)).expect("a model");
    assert!(bytes("own.json") == bytes("model.json"));
    // At a value that no pair has.
    let predict = |at: &[&str], output: &str| {
        let fixed = ["predict", "--model", "model.json", "--input", "z.npy", "--steps", "3"];
        call(path, &[&fixed[..], &["--output", output], at].concat())
    };
    let done = predict(&["--at", "coil=0.45"], "a.npy");
    assert!(done.status.success() && done.stderr.is_empty(), "{}", text(&done.stderr));
    let found = read_trajectories(&path.join("a.npy"), 1).expect("trajectories");
    let stored = load_model(&path.join("model.json")).expect("a model");
    let at = stored.at_controls(&[0.45]).expect("one value");
    let own = at.rollout(&[0.3, 0.1, -0.2, 0.25], Rollout { steps: 3, every: 1 }).expect("finite");
    assert_eq!(found.values(), own);
    let error = |values: &[f64], value: f64| {
        let mut worst = 0.0;
        for start in [[0.3, 0.1], [-0.2, 0.25]] {
            let mut z = start;
            (0..3).for_each(|_| map(value, &mut z));
            let m = usize::from(start[0] < 0.0);
            let end = &values[12 + 2 * m..][..2];
            worst = max_or_nan(worst, (end[0] - z[0]).hypot(end[1] - z[1]));
        }
        worst
    };
    assert!(error(found.values(), 0.45) < 1e-3, "{:e}", error(found.values(), 0.45));
    assert!(error(found.values(), 0.0) > 1e-2);
    // Without a word it is in the middle, and says so; beyond the range it says that too, or stops.
    let said = text(&predict(&[], "b.npy").stderr);
    assert!(said.contains("coil=0; --at takes others"), "{said}");
    let said = text(&predict(&["--at", "coil=1.5"], "c.npy").stderr);
    assert!(
        said.contains("coil = 1.5 is outside of what the model has learnt, from -1 to 1"),
        "{said}"
    );
    let stopped = predict(&["--at", "coil=1.5", "--outside", "stop"], "d.npy");
    assert_eq!(stopped.status.code(), Some(1));
    assert!(!path.join("d.npy").exists());
    let said = text(&predict(&["--at", "coil=1.5", "--outside", "ignore"], "e.npy").stderr);
    assert!(said.is_empty(), "{said}");
    succeeds(path, &["verify", "--model", "model.json", "--at", "coil=-0.9", "--radius", "0.3"]);
    for (at, words) in [
        ("coil", "NAME=VALUE"),
        ("coil=x", "NAME=VALUE"),
        ("ring=1", "one of coil"),
        ("coil=nan", "coil"),
        ("coil=1,coil=0", "twice"),
    ] {
        let fixed = ["predict", "--model", "model.json", "--input", "z.npy", "--steps", "1"];
        refuses(path, &[&fixed[..], &["--output", "f.npy", "--at", at]].concat(), &["--at", words]);
    }
}

#[test]
fn what_controls_of_pairs_cannot_be_is_refused() {
    let folder = folder();
    let path = folder.path();
    write_files(path, &[0.5]);
    refuses(path, &TRAIN, &["pairs.npz", "coil", "from 0.5 to 0.5"]);
    write_files(path, &[0.0, 1.0]);
    let two = [&TRAIN[..], &["--controls", "ring"]].concat();
    refuses(path, &two, &["names of controls"]);
    refuses(path, &[&TRAIN[..], &["--control-degree", "0"]].concat(), &["--control-degree"]);
    refuses(path, &[&TRAIN[..], &["--control-degree", "99"]].concat(), &["controls: degree", "99"]);
    // Of fewer than five values none is held out, which is said.
    let said = text(&succeeds(path, &brief()).stderr);
    assert!(said.contains("of fewer than five none can be"), "{said}");
    // A model of none takes none; pairs of none have no names.
    let (pairs, _) = write_files(path, &[0.0]);
    write_pairs(&path.join("pairs.npz"), &pairs).expect("written");
    refuses(path, &[&TRAIN[..], &["--overwrite"]].concat(), &["controls", "lambda"]);
    let fixed: Vec<&str> =
        brief().into_iter().filter(|word| !["--controls", "coil"].contains(word)).collect();
    succeeds(path, &[&fixed[..], &["--overwrite"]].concat());
    let predict = ["predict", "--model", "model.json", "--input", "z.npy", "--steps", "1"];
    let at = ["--output", "a.npy", "--at", "coil=1"];
    refuses(path, &[&predict[..], &at].concat(), &["--at", "depends on no controls"]);
}

/// A scene of seconds: rings of a torsatron.
fn scene(unseen: &str, held_out: &str) -> String {
    format!(
        r#"
name = "rings"
seed = 1
flow_time = 1.0
plots = ["controls"]
[data]
validation = 0.25
orbit = 30
[data.lines]
coils = {{ kind = "torsatron" }}
lines = 6
reach = 0.04
error = 1e-6
[data.lines.controls]
list = [{{ name = "rings", currents = [0.0, 0.0, 5e6, 5e6] }}]
values = [[-0.002], [-0.001], [0.0], [0.001], [0.002]]
held_out = [{held_out}]
degree = 2
[training]
iterations = 60
optimiser = {{ kind = "levenberg-marquardt" }}
[controls]
unseen = [{unseen}]
lines = 3
maps = 6
difference = 0.02
turning = 128
polynomials = [4]
aims = [0.002, 1.0]
[[models]]
name = "jolts"
network = {{ kind = "normal-form", kicks = {{ count = 3, width = 1, degree = 6 }}, twists = {{ count = 1, width = 1, degree = 4 }}, perturbation = {{ count = 4, width = 1, degree = 6 }} }}
weights = {{ kind = "normal", scale = 0.15 }}
"#
    )
}

#[test]
fn a_machine_is_known_between_the_currents_that_were_traced() {
    let folder = folder();
    let path = folder.path();
    std::fs::write(path.join("rings.toml"), scene("[-0.0015], [0.0004]", "[0.0015]"))
        .expect("written");
    let said = text(&succeeds(path, &["run", "rings.toml", "--out", "a"]).stdout);
    for words in ["rings from -0.002 to 0.002", "outside of the range", "of the coils"] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let report = std::fs::read_to_string(path.join("a/report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    let found = &report["studies"]["controls"];
    let network = &found["networks"][0];
    let judged = network["judged"].as_array().expect("machines");
    assert_eq!(judged.len(), 7);
    for (at, reference) in judged.iter().zip(found["reference"].as_array().expect("machines")) {
        let one = at["one"].as_f64().expect("an error");
        assert!(one > 0.0 && one < 1e-5, "{reference}: {at}");
    }
    let of = |slopes: &serde_json::Value, name: &str| slopes[name][0].as_f64().expect("a slope");
    let derivatives = &network["derivatives"];
    // Turns are averages over few maps, of angles in other coordinates.
    for (name, near) in [("trace", 1e-6), ("iota", 1e-6), ("turns", 1e-3)] {
        let exact = of(&derivatives["exact"], name);
        let differences = of(&derivatives["differences"], name);
        let coils = of(&found["slopes"], name);
        assert!((exact - differences).abs() < near * exact.abs(), "{name}: {exact} {differences}");
        assert!((exact - coils).abs() < 1e-2 * coils.abs(), "{name}: {exact} {coils}");
    }
    assert!(derivatives["of_map"][0].as_f64().expect("a share") < 1e-8, "{derivatives}");
    // What was looked for is there in the field of the coils; what is out of reach is said.
    let aims = network["aims"]["list"].as_array().expect("aims");
    assert!(aims[0]["missed"].as_f64().expect("a number").abs() < 2e-4, "{aims:?}");
    assert_eq!(
        (aims[0]["outside"].as_bool(), aims[1]["outside"].as_bool()),
        (Some(false), Some(true))
    );
    let (value, asked) = (&aims[0]["of_coils"][0], &aims[0]["of_coils"][1]);
    let apart = aims[0]["value"].as_f64().expect("a value") - value.as_f64().expect("a value");
    assert!(apart.abs() < 1e-4 && asked.as_u64().expect("a count") >= 2, "{aims:?}");
    assert!(path.join("a/controls.svg").is_file());
    write_points(&path.join("z.npy"), &[1, 2], &[3.97, 0.0]).expect("written");
    let fixed = ["predict", "--model", "a/model.json", "--input", "z.npy", "--steps", "5"];
    succeeds(path, &[&fixed[..], &["--at", "rings=0.0004", "--output", "z5.npy"]].concat());
}

/// With the study and without it, on two threads and on one.
#[test]
fn machines_are_learnt_to_the_same_bits() {
    let folder = folder();
    let path = folder.path();
    let mut brief = scene("[-0.0015]", "");
    for (long, short) in [
        ("plots = [\"controls\"]\n", ""),
        ("[-0.001], [0.0], [0.001]", "[0.0]"),
        ("held_out = []\n", ""),
        ("iterations = 60", "iterations = 10"),
        ("lines = 3\n", "lines = 2\n"),
        ("maps = 6\n", "maps = 2\n"),
        ("aims = [0.002, 1.0]\n", ""),
    ] {
        assert!(brief.contains(long), "{long}");
        brief = brief.replace(long, short);
    }
    let (head, rest) = brief.split_once("[controls]\n").expect("a study");
    let (_, models) = rest.split_once("[[models]]").expect("a model");
    let without = format!("{head}[[models]]{models}");
    let parameters = |text: &str, threads: &str| {
        std::fs::write(path.join("rings.toml"), text).expect("written");
        succeeds(path, &["run", "rings.toml", "--out", threads, "--threads", threads]);
        let model = load_model(&path.join(threads).join("model.json")).expect("a model");
        model.model.parameters().iter().map(|value| value.to_bits()).collect::<Vec<_>>()
    };
    assert!(parameters(&brief, "2") == parameters(&without, "1"));
}

#[test]
fn controls_of_a_machine_that_cannot_be_are_refused() {
    let folder = folder();
    let path = folder.path();
    let mut number = 0;
    let mut refused = |scene: String, words: &[&str]| {
        number += 1;
        let name = format!("{number}.toml");
        std::fs::write(path.join(&name), scene).expect("written");
        refuses(path, &["run", &name, "--out", "a"], words);
    };
    refused(scene("[0.001]", ""), &["unseen", "0.001", "not learnt"]);
    refused(scene("[0.01]", ""), &["unseen", "0.01", "-0.002"]);
    refused(scene("[0.0004]", "[0.001]"), &["held_out", "twice"]);
    refused(scene("[0.0004]", "[0.005]"), &["held_out", "0.005"]);
    refused(scene("[0.0004, 1.0]", ""), &["unseen", "expected 1"]);
    let few = scene("[0.0004]", "").replace("[0.0, 0.0, 5e6, 5e6]", "[0.0, 0.0, 5e6]");
    refused(few, &["controls.rings.currents", "expected 4"]);
    let none = scene("[0.0004]", "").replace("[0.0, 0.0, 5e6, 5e6]", "[0.0, 0.0, 0.0, 0.0]");
    refused(none, &["controls.rings.currents", "none"]);
    let one =
        scene("[0.0004]", "").replace("[[-0.002], [-0.001], [0.0], [0.001], [0.002]]", "[[0.0]]");
    refused(one, &["controls.values"]);
    let poincare = "[poincare]\nlines = 3\nearly = 10\nreference = 200\ncounts = [200]\nlast = 20\nprofile = 8\norbits = 0\nrounds = 1\n";
    refused(scene("[0.0004]", "") + poincare, &["controls", "rings"]);
}
