//! Training of each kind of network.

use crate::helpers::{call, folder, last_numbers, refuses, succeeds, text};
use gyroceptron::flow::{Pairs, Window, sample};
use gyroceptron::io::{load_model, write_pairs, write_points};
use gyroceptron::network::{Rollout, rollout};
use gyroceptron::random::Stream;
use gyroceptron::system::Oscillators;
use serde_json::Value;
use std::io::Cursor;
use std::path::Path;
use zip::{ZipArchive, ZipWriter};

/// A normal form from pairs of one's own to trajectories that keep its action.
#[test]
fn a_normal_form_is_trained_and_keeps_its_action() {
    let folder = folder();
    let path = folder.path();
    let window = Window { low: vec![-1.0; 4], high: vec![1.0; 4], samples: 400 };
    let points = sample(&[window], 2, &mut Stream::new(1, "points")).expect("points");
    let (pairs, _) = Pairs::of_flow(&Oscillators { epsilon: 0.01 }, points, 20.0).expect("pairs");
    write_pairs(&path.join("pairs.npz"), &pairs).expect("written");
    let start = &pairs.input()[..12];
    write_points(&path.join("z.npy"), &[3, 4], start).expect("written");
    fn train<'a>(more: &[&'a str]) -> Vec<&'a str> {
        [&["train", "--data", "pairs.npz", "--output", "m.json"], more].concat()
    }
    let form = ["--circle-action", "1,0", "--architecture", "normal-form"];
    let small = ["--kicks", "3x4", "--twists", "4x2,4", "--optimiser", "lm", "--iterations", "25"];
    for twists in ["4x2,0", "4x2,", "4x2,4,2", "4x0", "x2"] {
        refuses(path, &train(&[&form[..], &["--twists", twists]].concat()), &["twist"]);
    }
    let paper = ["--circle-action", "1,0", "--recipe", "paper"];
    refuses(path, &train(&[&paper[..], &["--kicks", "3x4"]].concat()), &["--kicks", "3x4"]);
    let net = ["--circle-action", "1,0", "--architecture", "henon-net", "--flow-time", "5"];
    refuses(path, &train(&net), &["--flow-time"]);
    let two = ["--circle-action", "1,0/0,1", "--recipe", "paper"];
    refuses(path, &train(&two), &["2 circles"]);
    let shared = ["--circle-action", "1,0/1,3", "--architecture", "normal-form"];
    refuses(path, &train(&shared), &["plane 1", "an angle θ"]);
    let still = ["--epsilon", "0"];
    refuses(path, &train(&[&form[..], &still].concat()), &["--epsilon", "flow_time"]);
    refuses(path, &train(&["--circle-action", "1,0/0,a"]), &["1,0/0,a"]);
    let none = ["--circle-action", "0,0", "--architecture", "normal-form"];
    refuses(path, &train(&none), &["circle action", "other than 0"]);
    refuses(path, &train(&[&form[..], &["--near-identity", "2x2"]].concat()), &["2x2"]);
    refuses(path, &train(&[&form[..], &["--flow-time", "-1"]].concat()), &["--flow-time", "-1"]);
    refuses(path, &train(&[&form[..], &["--near-identity-penalty", "1"]].concat()), &["penalty"]);
    let output = succeeds(path, &train(&[&form[..], &small, &["--json"]].concat()));
    let json: Value = serde_json::from_slice(&output.stdout).expect("one JSON document");
    let error = json["best"]["validation"].as_f64().expect("a number");
    // The rotation alone leaves 5e-3; unscaled by the slow time, or from a wrong angle, so
    // short a training stays there.
    assert!(error < 5e-4, "{error:e}");
    assert_eq!(json["angles"].as_array().map(Vec::len), Some(1));
    let stored = load_model(&path.join("m.json")).expect("a model");
    let network = &stored.model;
    let time = network.architecture().flow_time;
    assert!((2.0..60.0).contains(&time), "{time}");

    let output = succeeds(path, &["verify", "--model", "m.json", "--samples", "20", "--json"]);
    let json: Value = serde_json::from_slice(&output.stdout).expect("one JSON document");
    let laws: Vec<_> = json["certificate"]["rows"].as_array().expect("rows").iter().collect();
    assert!(laws.iter().any(|row| row["law"] == "equivariance"), "{laws:?}");
    assert_eq!(json["holds"], true, "{json}");

    let predict = ["predict", "--model", "m.json", "--input", "z.npy", "--output", "t.npy"];
    // Nobody has stated how long it takes.
    let longer = [&predict[..], &["--steps", "2", "--flow-time", "40"]].concat();
    refuses(path, &longer, &["flow_time", "40", "given"]);
    succeeds(path, &[&predict[..], &["--steps", "20000", "--every", "5000"]].concat());
    let file = std::fs::read(path.join("t.npy")).expect("trajectories");
    let values: Vec<f64> = file[file.len() - 5 * 12 * 8..]
        .chunks_exact(8)
        .map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes")))
        .collect();
    assert_eq!(&values[..12], start);
    let own = stored.model.invariant().expect("an invariant");
    let invariant: Vec<f64> = values.chunks_exact(4).map(own).collect();
    for (state, invariants) in invariant.chunks_exact(3).enumerate() {
        for (m, value) in invariants.iter().enumerate() {
            let drift = (value - invariant[m]).abs();
            assert!(drift < 1e-12, "{state}, {m}: {drift:e}");
        }
    }
    // The map itself, step by step, agrees with what stayed in the coordinates.
    let request = Rollout { steps: 200, every: 100 };
    let inside = stored.model.rollout(start, request).expect("valid");
    let outside = rollout(stored.model.composition(), start, request).expect("valid");
    for (a, b) in inside.iter().zip(&outside) {
        assert!((a - b).abs() < 1e-10, "{a} {b}");
    }

    for weights in ["w.safetensors", "w.npz"] {
        succeeds(path, &["export", "--model", "m.json", "--output", weights]);
        let import = ["import", "--weights", weights, "--circle-action", "1,0"];
        let import = [&import[..], &["--epsilon", "0.01", "--output", "back.json"]].concat();
        let none = [&import[..], &["--flow-time", "0"]].concat();
        refuses(path, &none, &["--flow-time", "positive"]);
        let time = time.to_string();
        succeeds(path, &import);
        let other = ["import", "--weights", weights, "--circle-action", "0,1", "--epsilon", "0.01"];
        let other = [&other[..], &["--output", "other.json"]].concat();
        refuses(path, &other, &["--circle-action: expected 1,0", weights, "found 0,1"]);
        let others = [("--epsilon", "0.02"), ("--flow-time", "1.5")];
        for (option, value) in others {
            let alone = ["import", "--weights", weights, "--output", "other.json", option, value];
            refuses(path, &alone, &[option, "of which", weights, value]);
        }
        // The file says all.
        std::fs::remove_file(path.join("back.json")).expect("removed");
        succeeds(path, &["import", "--weights", weights, "--output", "back.json"]);
        if weights == "w.npz" {
            let back = load_model(&path.join("back.json")).expect("a model").model;
            assert_eq!(back.architecture(), stored.model.architecture());
            std::fs::remove_file(path.join("back.json")).expect("removed");
            // Arrays of other programs do not say what they are of.
            without_architecture(&path.join(weights));
            refuses(path, &import, &["--flow-time", weights]);
            succeeds(path, &[&import[..], &["--flow-time", &time]].concat());
        }
        let back = load_model(&path.join("back.json")).expect("a model").model;
        assert_eq!(back.architecture(), stored.model.architecture());
        assert_eq!(back.composition().parameters(), stored.model.composition().parameters());
        std::fs::remove_file(path.join("back.json")).expect("removed");
    }
}

/// The same archive with numbers only.
fn without_architecture(path: &Path) {
    let read = std::fs::read(path).expect("read");
    let mut archive = ZipArchive::new(Cursor::new(read)).expect("an archive");
    let mut kept = ZipWriter::new(Cursor::new(Vec::new()));
    for number in 0..archive.len() {
        let member = archive.by_index_raw(number).expect("a member");
        if member.name().is_ok_and(|name| name != "architecture.npy") {
            kept.raw_copy_file(member).expect("copied");
        }
    }
    std::fs::write(path, kept.finish().expect("finished").into_inner()).expect("written");
}

/// Pairs of several maps in one file, and the model at one that was not among them.
#[test]
fn a_family_is_trained_and_asked_for_another_member() {
    let folder = folder();
    let path = folder.path();
    let set = |epsilon: f64, time: f64, seed| {
        let window = Window { low: vec![-0.8; 4], high: vec![0.8; 4], samples: 150 };
        let points = sample(&[window], 2, &mut Stream::new(seed, "points")).expect("points");
        Pairs::of_flow(&Oscillators { epsilon }, points, time).expect("pairs").0
    };
    let maps = [(0.02, 2.0), (0.02, 10.0), (0.01, 10.0)];
    let sets = maps.map(|(e, t)| (e, t, set(e, t, 1)));
    write_pairs(&path.join("pairs.npz"), &Pairs::of_family(sets.to_vec()).expect("sets"))
        .expect("written");
    let train = ["train", "--data", "pairs.npz", "--output", "m.json", "--circle-action", "1,0"];
    let small = ["--kicks", "4x4", "--twists", "6x4", "--optimiser", "lm", "--iterations", "120"];
    let form = ["--architecture", "normal-form"];
    let net = [&train[..], &["--architecture", "henon-net"]].concat();
    refuses(path, &net, &["pairs.npz", "family"]);
    let output = succeeds(path, &[&train[..], &form, &small, &["--json"]].concat());
    let json: Value = serde_json::from_slice(&output.stdout).expect("one JSON document");
    let error = json["best"]["validation"].as_f64().expect("a number");
    assert!(error < 1e-4, "{error:e}");
    // Whole turns of the longer time are known from the shorter.
    let theta = json["theta"].as_f64().expect("a number");
    assert!((theta / 10.0 - 1.0).abs() < 0.02, "{theta}");
    let stored = load_model(&path.join("m.json")).expect("a model");
    assert_eq!(stored.model.architecture().epsilon, 0.02);
    assert_eq!(stored.provenance.flow_time, Some(10.0));

    let judge = set(0.015, 5.0, 2);
    let count = judge.len() as u64;
    write_points(&path.join("z.npy"), &[count, 4], judge.input()).expect("written");
    let predict = ["predict", "--model", "m.json", "--input", "z.npy", "--steps", "1"];
    let predicted = |more: &[&str]| -> f64 {
        let arguments = [&predict[..], &["--output", "t.npy", "--overwrite"], more].concat();
        succeeds(path, &arguments);
        let file = std::fs::read(path.join("t.npy")).expect("states");
        let last = &file[file.len() - judge.output().len() * 8..];
        let values = last.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().expect("eight")));
        let squares: f64 = values.zip(judge.output()).map(|(a, b)| (a - b) * (a - b)).sum();
        squares / judge.output().len() as f64
    };
    let there = predicted(&["--epsilon", "0.015", "--flow-time", "5"]);
    assert!(there < 1e-4, "{there:e}");
    let elsewhere = predicted(&["--epsilon", "0.015"]);
    assert!(elsewhere > 100.0 * there, "{elsewhere:e} {there:e}");
    let with = |more: &[&'static str]| [&predict[..], &["--output", "u.npy"], more].concat();
    refuses(path, &with(&["--flow-time", "0"]), &["flow_time", "0", "positive"]);
    refuses(path, &with(&["--epsilon", "nan"]), &["epsilon", "NaN"]);
    // What no pairs are of is said, or stops it.
    let beyond = ["--epsilon", "0.05", "--flow-time", "20"];
    let said = succeeds(path, &with(&beyond));
    let note = "ε = 0.05 is outside of what the model has learnt, 0.01 to 0.02; flow time = 20 is";
    assert!(text(&said.stderr).contains(note), "{}", text(&said.stderr));
    let stopped = call(path, &with(&[&beyond[..], &["--overwrite", "--outside", "stop"]].concat()));
    assert_eq!(stopped.status.code(), Some(1));
}

/// 9,000 pairs of one flow time and nothing else given. Two minutes in a release build:
/// `cargo test --release --test program pairs_of_one_time -- --ignored --nocapture` prints the
/// errors.
#[test]
#[ignore = "takes minutes: run it with --ignored"]
fn pairs_of_one_time_train_a_normal_form() {
    let folder = folder();
    let window = |low: [f64; 4], high: [f64; 4]| Window {
        low: low.to_vec(),
        high: high.to_vec(),
        samples: 3000,
    };
    let windows = [
        window([-1.6, -0.9, -1.6, -1.1], [1.6, 1.6, 1.6, 1.1]),
        window([-1.6, 0.6, -1.6, -0.5], [1.6, 1.5, 1.6, 0.5]),
        window([-1.6, -0.8, -1.6, -0.8], [1.6, 0.8, 1.6, 0.8]),
    ];
    let points = sample(&windows, 2, &mut Stream::new(1, "x")).expect("points");
    let system = Oscillators { epsilon: 0.01 };
    for (time, limit) in [(5.0, 3e-9), (50.0, 3e-7)] {
        let (pairs, _) = Pairs::of_flow(&system, points.clone(), time).expect("converges");
        let [data, model] = ["npz", "json"].map(|end| format!("time-{time}.{end}"));
        write_pairs(&folder.path().join(&data), &pairs).expect("written");
        let files = ["train", "--data", &data, "--circle-action", "1,0", "--output", &model];
        let how = ["--architecture", "normal-form", "--optimiser", "lm", "--iterations", "200"];
        let output = succeeds(folder.path(), &[&files[..], &how, &["--json"]].concat());
        let json: Value = serde_json::from_slice(&output.stdout).expect("one JSON document");
        let error = json["best"]["validation"].as_f64().expect("a number");
        println!("time {time}: held-out mean squared error {error:.2e}");
        assert!(error <= limit, "{error:e}");
    }
}

/// Pairs of a flow with friction: couplings learn them, in units of their own, and are certified, asked, sent to files
/// and read back; the command that the report gives trains them again.
#[test]
fn couplings_are_trained_on_pairs_with_friction() {
    let folder = folder();
    let path = folder.path();
    let mut stream = Stream::new(3, "points");
    let points: Vec<f64> = (0..2 * 600).map(|_| stream.uniform(-1.5, 1.5)).collect();
    // A damped oscillator over half a turn and a bit, about another point than 0.
    let damped = |z: &[f64]| {
        let (s, c) = 3.3_f64.sin_cos();
        [0.9 * (c * z[0] + s * z[1]), 0.9 * (c * z[1] - s * z[0])]
    };
    let output: Vec<f64> =
        points.chunks_exact(2).flat_map(damped).map(|v| 30.0 * v + 4.0).collect();
    let input: Vec<f64> = points.iter().map(|v| 30.0 * v + 4.0).collect();
    let pairs = Pairs::new("pairs", 1, input.clone(), output.clone()).expect("pairs");
    write_pairs(&path.join("pairs.npz"), &pairs).expect("written");
    let train = ["train", "--data", "pairs.npz", "--circle-action", "1", "--output", "m.json"];
    let of = ["--architecture", "coupling-gyroceptron", "--psi", "1x3", "--near-identity", "4x4"];
    let more = ["--epsilon", "0.05", "--flow-time", "3.3", "--iterations", "60"];
    let all = [&train[..], &of, &more, &["--optimiser", "lm", "--json"]].concat();
    let json: Value =
        serde_json::from_slice(&succeeds(path, &all).stdout).expect("one JSON document");
    let error = json["best"]["validation"].as_f64().expect("a number");
    assert!(error < 1e-8, "{error:e}");
    let stored = load_model(&path.join("m.json")).expect("a model");
    assert_eq!(stored.provenance.flow_time, Some(3.3));
    let architecture = stored.model.architecture();
    assert_eq!((architecture.flow_time, architecture.epsilon), (3.3, 0.05));
    // What is symplectic cannot learn that volumes shrink by a fifth.
    let symplectic = ["--output", "s.json", "--optimiser", "lm", "--json", "--iterations", "60"];
    let symplectic =
        [&train[..5], &symplectic, &["--psi", "1x3", "--near-identity", "4x4"]].concat();
    let json: Value =
        serde_json::from_slice(&succeeds(path, &symplectic).stdout).expect("one JSON document");
    assert!(json["best"]["validation"].as_f64().expect("a number") > 1e-3);

    let said = text(&succeeds(path, &["verify", "--model", "m.json", "--samples", "40"]).stdout);
    assert!(said.contains("holds") && said.contains("not claimed"), "{said}");
    write_points(&path.join("z.npy"), &[2, 2], &input[..4]).expect("written");
    let predict = ["predict", "--model", "m.json", "--input", "z.npy", "--steps", "1", "--output"];
    succeeds(path, &[&predict[..], &["t.npy"]].concat());
    for (found, expected) in last_numbers(&path.join("t.npy"), 4).iter().zip(&output[..4]) {
        assert!((found - expected).abs() < 0.05, "{found} {expected}");
    }
    let invariant = [&predict[..], &["u.npy", "--invariant", "mu.npy"]].concat();
    refuses(path, &invariant, &["--invariant", "symplectic"]);
    // Another member of the family: half the flow time.
    succeeds(path, &[&predict[..], &["half.npy", "--flow-time", "1.65"]].concat());
    assert_ne!(last_numbers(&path.join("half.npy"), 4), last_numbers(&path.join("t.npy"), 4));

    for weights in ["w.safetensors", "w.npz"] {
        let said =
            text(&succeeds(path, &["export", "--model", "m.json", "--output", weights]).stdout);
        assert!(said.contains("near_identity 4 couplings"), "{said}");
        let import = ["import", "--weights", weights, "--circle-action", "1", "--epsilon", "0.05"];
        let import = [&import[..], &["--output", "back.json"]].concat();
        if weights == "w.npz" {
            without_architecture(&path.join(weights));
            refuses(path, &import, &["--flow-time", "couplings"]);
            succeeds(path, &[&import[..], &["--flow-time", "3.3"]].concat());
        } else {
            succeeds(path, &import);
        }
        let back = load_model(&path.join("back.json")).expect("a model").model;
        assert_eq!(back.architecture(), stored.model.architecture());
        assert_eq!(back.composition().parameters(), stored.model.composition().parameters());
        std::fs::remove_file(path.join("back.json")).expect("removed");
    }

    let report = std::fs::read_to_string(path.join("m-report/report.md")).expect("a report");
    let command = report.lines().find_map(|line| line.strip_prefix("`gyroceptron "));
    let command = command.and_then(|rest| rest.split('`').next()).expect("a command");
    let scene = |word| if word == "as-run.toml" { "m-report/as-run.toml" } else { word };
    succeeds(path, &command.split(' ').map(scene).collect::<Vec<_>>());
    let back = load_model(&path.join("MODEL.json")).expect("a model").model;
    assert_eq!(back.composition().parameters(), stored.model.composition().parameters());

    let zero = [&train[..5], &of, &["--output", "x.json", "--epsilon", "0"]].concat();
    refuses(path, &zero, &["--epsilon", "flow_time"]);
    let kicks = [&train[..5], &of, &["--output", "x.json", "--kicks", "2x2"]].concat();
    refuses(path, &kicks, &["--kicks", "psi, near_identity"]);
    let layers = [&train[..5], &of, &["--output", "x.json", "--layers", "2x2"]].concat();
    refuses(path, &layers, &["--layers"]);
}
