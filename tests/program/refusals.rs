//! Failed checks and bad input: status and message.

use crate::helpers::{
    SCENE, call, command, folder, refuses, succeeds, text, with_model, with_scene,
};
use gyroceptron::io::{StoredModel, load_model, save_model};
use serde_json::Value;
use std::process::Stdio;

/// A name that says another format than what it would hold is refused.
#[test]
fn names_that_say_another_format_are_refused() {
    let folder = with_model();
    let path = folder.path();
    let predict = ["predict", "--model", "model.json", "--input", "z.npy", "--steps", "4"];
    let refused = |more: &[&str], words: &[&str]| {
        refuses(path, &[&predict[..], more].concat(), words);
    };
    refused(&["--output", "t.csv"], &["--output", "t.csv", ".npy"]);
    refused(&["--output", "t"], &["--output", ".npy"]);
    refused(&["--output", "t.npy", "--invariant", "mu.csv"], &["--invariant", "mu.csv", ".npy"]);
    let train = ["train", "--data", "pairs.npz", "--circle-action", "1,0", "--output"];
    refuses(path, &[&train[..], &["m.npz"]].concat(), &["--output", "m.npz", ".json"]);
    std::fs::write(path.join("pairs.csv"), "1,2\n3,4\n").expect("written");
    let train = ["train", "--data", "pairs.csv", "--circle-action", "1,0", "--output", "m.json"];
    refuses(path, &train, &["pairs.csv"]);
    let input = ["predict", "--model", "model.json", "--input", "pairs.csv", "--steps", "4"];
    refuses(path, &[&input[..], &["--output", "t.npy"]].concat(), &["pairs.csv"]);
}

/// The message has the number and the name of the block, and nothing is written.
#[test]
fn lists_of_blocks_that_cannot_be_are_refused() {
    let folder = with_model();
    let path = folder.path();
    let one = "widths = { count = 1, width = 2 }";
    // What is no block at all has the line of the file; what cannot be one has number and name.
    let (line, place) = ("own.toml:16:", "block 1 (`");
    let cases = [
        (format!(r#"{{ part = "slow-map", layer = "henon", {one} }}"#), [place, "Hénon layers"]),
        (format!(r#"{{ part = "chart", layer = "no-such", {one} }}"#), [line, "no-such"]),
        (format!(r#"{{ part = "no-such", layer = "henon", {one} }}"#), [line, "no-such"]),
        (
            format!(r#"{{ part = "chart", layr = "henon", {one} }}"#),
            ["layr", "did you mean `layer`"],
        ),
        (r#"{ part = "chart", layer = "henon" }"#.into(), ["`chart`", "widths"]),
        (
            r#"{ part = "chart", layer = "henon", widths = [999999999999] }"#.into(),
            ["block 1 (`chart`)", "parameters"],
        ),
        (
            format!(r#"{{ part = "conjugation", layer = "henon", {one} }}"#),
            ["block 1 (`conjugation`)", "that of block 0"],
        ),
        (
            format!(r#"{{ part = "near-identity", layer = "henon", scale = "none", {one} }}"#),
            [place, "ε"],
        ),
        (format!(r#"{{ part = "chart", name = "a/b", layer = "henon", {one} }}"#), [place, "a/b"]),
        (r#"{ part = "chart", layer = "henon", widths = [2, 0] }"#.into(), [place, "width 0"]),
        (
            r#"{ part = "chart", layer = "henon", widths = { count = 1, width = 0 } }"#.into(),
            [place, "width 0"],
        ),
    ];
    for (block, words) in cases {
        let scene = format!(
            r#"
name = "own"
title = "Blocks"
seed = 1
flow_time = 0.5
[data]
pairs = "pairs.npz"
validation = 0.1
circle_action = [1, 0]
epsilon = 0.05
[[models]]
name = "own"
weights = {{ kind = "normal", scale = 0.1 }}
[models.network]
kind = "blocks"
blocks = [{{ part = "conjugation", layer = "henon", widths = {{ count = 1, width = 2 }} }}, {block}]
[training]
iterations = 2
optimiser = {{ kind = "levenberg-marquardt" }}
"#
        );
        std::fs::write(path.join("own.toml"), scene).expect("written");
        refuses(path, &["run", "own.toml", "--out", "out"], &["own.toml", words[0], words[1]]);
        let train = ["train", "--data", "pairs.npz", "--scene", "own.toml", "--output", "own.json"];
        refuses(path, &train, &["own.toml", words[0], words[1]]);
        assert!(!path.join("out").exists() && !path.join("own.json").exists());
    }
}

/// So it is in files of models, whose lines nobody reads.
#[test]
fn blocks_of_files_that_cannot_be_read_have_their_number() {
    let folder = with_model();
    let path = folder.path();
    let file = std::fs::read(path.join("model.json")).expect("a model");
    let whole: Value = serde_json::from_slice(&file).expect("JSON");
    for (key, value, words) in [("layer", "no-such", "no-such"), ("layr", "henon", "layr")] {
        let mut wrong = whole.clone();
        wrong["architecture"]["blocks"][1][key] = value.into();
        std::fs::write(path.join("wrong.json"), wrong.to_string()).expect("written");
        refuses(path, &["verify", "--model", "wrong.json"], &["wrong.json", "block 1: ", words]);
    }
}

/// What is not said has a name.
#[test]
fn a_model_has_a_name_of_its_own() {
    let folder = with_model();
    let path = folder.path();
    let train = ["train", "--data", "pairs.npz", "--circle-action", "1,0"];
    refuses(path, &train, &["model.json", "--overwrite"]);
}

#[test]
fn random_networks_are_certified() {
    let folder = folder();
    let output = succeeds(folder.path(), &["verify", "--random", "2", "--samples", "10", "--json"]);
    let json: Value = serde_json::from_slice(&output.stdout).expect("one JSON document");
    assert_eq!(json["holds"], true);
    assert_eq!(json["certificate"]["rows"][0]["samples"], 20);
    let again = succeeds(folder.path(), &["verify", "--random", "2", "--samples", "10", "--json"]);
    assert_eq!(output.stdout, again.stdout);
    refuses(folder.path(), &["verify", "--random", "1000000000000"], &["--random", "at most"]);
}

/// An invariant that drifts is reported, with the resonance that it is next to; one that stays
/// is not, wherever its angle is.
#[test]
fn an_invariant_that_does_not_stay_is_reported() {
    let folder = with_model();
    let path = folder.path().join("model.json");
    let stored = load_model(&path).expect("a model");
    let verify = ["verify", "--model", "model.json", "--samples", "5"];
    let count = stored.model.composition().parameters().len();
    let at = |theta: f64, size: f64| {
        let mut parameters = stored.model.composition().parameters().to_vec();
        for parameter in &mut parameters[count / 2..] {
            *parameter *= size;
        }
        *parameters.last_mut().expect("θ") = theta;
        let model = stored.model.with_parameters(parameters).expect("finite");
        save_model(&path, &StoredModel { model, ..stored.clone() }).expect("written");
        text(&call(folder.path(), &verify).stderr)
    };
    let resonant = at(0.005, 3.0);
    assert!(resonant.contains("invariant"), "{resonant}");
    assert!(resonant.contains("2π·0/1"), "{resonant}");
    // Next to 2π/3, and the golden mean, of a network that hardly moves points by I_ε.
    for theta in [2.1, 3.8832] {
        assert_eq!(at(theta, 0.1), "", "θ = {theta}");
    }
}

#[test]
fn a_failed_check_has_status_1() {
    // A network of zeros cannot fail its symplecticity test: vacuous.
    let folder = with_model();
    let path = folder.path().join("model.json");
    let mut stored = load_model(&path).expect("a model");
    let zeros = vec![0.0; stored.model.composition().parameters().len()];
    stored.model = stored.model.with_parameters(zeros).expect("finite");
    save_model(&path, &stored).expect("written");
    let output = call(folder.path(), &["verify", "--model", "model.json", "--samples", "5"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stdout).contains("VACUOUS"));
}

#[test]
fn missing_files_are_named() {
    let folder = folder();
    let path = folder.path();
    refuses(path, &["run", "gone.toml"], &["gone.toml"]);
    refuses(path, &["run", "gone"], &["gone", "quickstart"]);
    refuses(path, &["verify", "--model", "gone.json"], &["gone.json"]);
    refuses(
        path,
        &["train", "--data", "gone.npz", "--circle-action", "1,0", "--output", "m.json"],
        &["gone.npz"],
    );
    refuses(
        path,
        &[
            "predict",
            "--model",
            "gone.json",
            "--input",
            "z.npy",
            "--steps",
            "1",
            "--output",
            "t.npy",
        ],
        &["gone.json"],
    );
    refuses(
        path,
        &[
            "import",
            "--weights",
            "gone.npz",
            "--circle-action",
            "1,0",
            "--epsilon",
            "0.01",
            "--output",
            "m.json",
        ],
        &["gone.npz"],
    );
    refuses(path, &["export", "--model", "gone.json", "--output", "w.npz"], &["gone.json"]);
}

#[test]
fn bad_arguments_are_named() {
    let folder = with_model();
    let path = folder.path();
    let train = |more: &[&str], words: &[&str]| {
        let mut arguments = vec!["train", "--data", "pairs.npz", "--output", "new.json"];
        arguments.extend(more);
        refuses(path, &arguments, words);
    };
    train(&["--circle-action", "1,0,0"], &["circle action", "3 weights", "2 weights"]);
    train(&["--circle-action", "1,x"], &["--circle-action", "1,x"]);
    train(&["--circle-action", "0,0"], &["circle action"]);
    train(&["--circle-action", "1,0", "--epsilon", "NaN"], &["epsilon", "NaN"]);
    train(&["--circle-action", "1,0", "--epsilon", "inf"], &["epsilon"]);
    train(&["--circle-action", "1,0", "--iterations", "-3"], &["--iterations", "-3"]);
    train(&["--circle-action", "1,0", "--validation", "1.5"], &["--validation", "1.5"]);
    train(&["--circle-action", "1,0", "--theta", "nan"], &["--theta"]);
    train(&["--circle-action", "1,0", "--threads", "0"], &["--threads"]);
    refuses(
        path,
        &["train", "--data", "pairs.npz", "--circle-action", "1,0", "--output", "model.json"],
        &["model.json"],
    );
    for (steps, every) in [("0", "1"), ("-5", "0"), ("5", "0"), ("5", "-1")] {
        refuses(
            path,
            &[
                "predict",
                "--model",
                "model.json",
                "--input",
                "z.npy",
                "--steps",
                steps,
                "--every",
                every,
                "--output",
                "t.npy",
            ],
            &["at least 1"],
        );
    }
    // Nothing is replaced unasked, an input never.
    std::fs::write(path.join("t.npy"), "mine").expect("written");
    let predict = ["predict", "--model", "model.json", "--input", "z.npy", "--steps", "2"];
    refuses(path, &[&predict[..], &["--output", "t.npy"]].concat(), &["t.npy", "--overwrite"]);
    let arguments = [&predict[..], &["--output", "z.npy", "--overwrite"]].concat();
    refuses(path, &arguments, &["z.npy", "input"]);
    let huge = ["--steps", "9000000000000000000", "--output", "huge.npy"];
    refuses(path, &[&predict[..5], &huge].concat(), &["states"]);
    refuses(path, &["verify", "--random", "0"], &["--random"]);
    refuses(path, &["verify", "--samples", "-1"], &["--samples"]);
    refuses(path, &["verify", "--radius", "NaN"], &["radius", "NaN"]);
    refuses(path, &["frobnicate"], &["frobnicate"]);
    refuses(path, &["verify", "--frobnicate"], &["--frobnicate"]);
    refuses(path, &["export", "--model", "model.json", "--output", "w.txt"], &["w.txt", ".npz"]);
    refuses(
        path,
        &["export", "--model", "model.json", "--output", "no/such/w.npz"],
        &["no/such/w.npz"],
    );
}

#[test]
fn unknown_keys_are_named_with_the_nearest_known_one() {
    for (from, to, words) in [
        ("flow_time", "flow_tiem", ["flow_tiem", "flow_time"]),
        ("iterations", "iteration", ["`iteration`", "iterations"]),
        ("epsilon = 0.01", "epsilon = 0.01\nepsilom = 1", ["epsilom", "epsilon"]),
        ("validation", "validaton", ["validaton", "validation"]),
        ("every = 10\ninitial", "evry = 10\ninitial", ["evry", "every"]),
        ("every = 10\ninitial", "every = 10\nwhole = 3\ninitial", ["`whole`", "known here: steps"]),
    ] {
        let folder = with_scene("bad.toml", &SCENE.replacen(from, to, 1));
        refuses(folder.path(), &["run", "bad.toml"], &["bad.toml:", words[0], words[1]]);
    }
}

#[test]
fn scenes_with_bad_values_are_refused() {
    let nothing = with_scene("bad.toml", "name = \"nothing\"\n");
    refuses(nothing.path(), &["run", "bad.toml"], &["scene nothing", "something to run"]);
    for (from, to, word) in [
        ("epsilon = 0.01", "epsilon = nan", "epsilon"),
        ("flow_time = 0.5", "flow_time = -1.0", "flow_time"),
        ("steps = 100", "steps = 0", "steps"),
        ("steps = 100", "steps = -7", "-7"),
        ("samples = 400", "samples = 0", "sample"),
        ("low = [-1.6,", "low = [1.7,", "low"),
        ("low = [-1.6,", "low = [", "windows[0]"),
        ("[[1.5, 0.15, 0.0, 0.0]", "[[1.5, 0.15, 0.0]", "initial"),
        ("kind = \"oscillators\"", "kind = \"oscillator\"", "oscillator"),
        ("plots = [\"loss\"", "plots = [\"los\"", "los"),
        ("name = \"small\"", "name = \"../small\"", "name"),
        ("width = 4", "width = 0", "width"),
        ("flow_time = 0.5\n", "", "flow_time"),
        ("title = ", "title = = ", "bad.toml"),
    ] {
        let folder = with_scene("bad.toml", &SCENE.replacen(from, to, 1));
        refuses(folder.path(), &["run", "bad.toml", "--out", "o"], &[word]);
    }
}

#[test]
fn a_closed_pipe_is_no_error() {
    let folder = folder();
    let mut child =
        command(folder.path(), &["scenes"]).stdout(Stdio::piped()).spawn().expect("starts");
    drop(child.stdout.take());
    assert!(child.wait().expect("ends").success());
}

#[test]
fn weights_are_asked_for_where_a_scene_needs_them() {
    let folder = with_scene("small.toml", SCENE);
    let path = folder.path();
    refuses(path, &["run", "published-weights"], &["published", "--weights"]);
    refuses(path, &["run", "published-weights", "--weights", "gone.npz"], &["gone.npz"]);
    refuses(path, &["run", "small.toml", "--weights", "gone.npz"], &["--weights"]);
    std::fs::write(path.join("broken.npz"), "no archive").expect("written");
    refuses(path, &["run", "published-weights", "--weights", "broken.npz"], &["broken.npz"]);
    succeeds(path, &["run", "small.toml", "--quick"]);
    let scene = std::fs::read_to_string(path.join("gyroceptron-out/small/as-run.toml"));
    assert!(scene.expect("a scene").contains("iterations = 20"));
}

/// Commands, scenes and options that are misspelt are named with the nearest one.
#[test]
fn misspelt_words_are_answered_with_the_nearest_one() {
    let folder = folder();
    for (arguments, word) in [
        (&["quikstart"][..], "`quickstart`"),
        (&["trian"], "`train`"),
        (&["trian", "--data", "pairs.npz"], "`train`"),
        (&["verfy", "--model", "m.json"], "`verify`"),
        (&["run", "fieldlines"], "`field-lines`"),
        (&["fieldlines"], "`field-lines`"),
        (&["cite", "quikstart"], "`quickstart`"),
        (&["scenes", "--show", "stif"], "`stiff`"),
        (&["train", "--dat", "x"], "--data"),
        (&["run", "--resme"], "--resume"),
    ] {
        refuses(folder.path(), arguments, &[word]);
    }
    refuses(folder.path(), &["run", "fieldlines"], &["did you mean"]);
    let output = call(folder.path(), &["xyzzy"]);
    assert!(!text(&output.stderr).contains("did you mean"));
}
