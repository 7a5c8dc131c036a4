//! From pairs to a model and what is done with it.

use crate::helpers::{
    SMALL, call, folder, last_numbers, refuses, succeeds, text, times, with_model, write_data,
    write_large_data,
};
use gyroceptron::flow::{Pairs, Window, sample};
use gyroceptron::io::{
    StoredModel, load_model, read_pairs, read_points, read_trajectories, write_pairs, write_points,
};
use gyroceptron::network::{Architecture, Part, Rollout, rollout};
use gyroceptron::random::Stream;
use gyroceptron::system::Oscillators;
use serde_json::Value;

#[test]
fn train_verify_predict_export_and_import() {
    let folder = with_model();
    let path = folder.path();
    let output = succeeds(path, &["verify", "--model", "model.json", "--json"]);
    let json: Value = serde_json::from_slice(&output.stdout).expect("one JSON document");
    assert_eq!(json["holds"], true);

    succeeds(
        path,
        &[
            "predict",
            "--model",
            "model.json",
            "--input",
            "z.npy",
            "--steps",
            "20",
            "--every",
            "5",
            "--output",
            "t.npy",
        ],
    );
    let stored = load_model(&path.join("model.json")).expect("a model");
    let start = read_points(&path.join("z.npy"), 2).expect("points").points;
    let expected = rollout(stored.model.composition(), &start, Rollout { steps: 20, every: 5 })
        .expect("valid");
    let file = std::fs::read(path.join("t.npy")).expect("trajectories");
    let header = String::from_utf8_lossy(&file[..128]);
    assert!(header.contains("(5, 3, 4)") || header.contains("(5, 3, 4, )"), "{header}");
    let values: Vec<f64> = file[file.len() - expected.len() * 8..]
        .chunks_exact(8)
        .map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes")))
        .collect();
    assert_eq!(values, expected);

    for weights in ["w.safetensors", "w.npz"] {
        succeeds(path, &["export", "--model", "model.json", "--output", weights]);
        succeeds(
            path,
            &[
                "import",
                "--weights",
                weights,
                "--circle-action",
                "1,0",
                "--epsilon",
                "0.01",
                "--output",
                "back.json",
            ],
        );
        let back = load_model(&path.join("back.json")).expect("a model");
        assert_eq!(back.model.composition().parameters(), stored.model.composition().parameters());
        std::fs::remove_file(path.join("back.json")).expect("removed");
    }
}

/// Interleaved columns, and a circle action of the wrong plane, are recognised by the rotation.
#[test]
fn columns_and_actions_that_do_not_fit_are_reported() {
    let folder = folder();
    let path = folder.path();
    write_data(path);
    let train = |data: &str, action: &str| {
        let mut arguments = vec!["train", "--data", data, "--circle-action", action];
        arguments.extend([
            "--recipe",
            "paper",
            "--iterations",
            "1",
            "--output",
            "m.json",
            "--overwrite",
        ]);
        text(&succeeds(path, &arguments).stderr)
    };
    assert!(!train("pairs.npz", "1,0").contains("better"));
    let said = train("pairs.npz", "0,1");
    assert!(said.contains("q1 q2 p1 p2") && said.contains("1,0"), "{said}");
    assert!(said.contains("whole turns") && said.contains("0.9 times this flow time"), "{said}");
    let pairs = read_pairs(&path.join("pairs.npz")).expect("pairs").pairs;
    // q₁ p₁ q₂ p₂.
    let interleaved = pairs.with_columns(&[0, 2, 1, 3]);
    write_pairs(&path.join("interleaved.npz"), &interleaved).expect("written");
    let said = train("interleaved.npz", "1,0");
    assert!(said.contains("q1 p1 q2 p2") && said.contains("1,0"), "{said}");
    assert_eq!(interleaved.with_columns(&[0, 2, 1, 3]).input(), pairs.input());
    // Momenta first turn the other way, and are as good.
    write_pairs(&path.join("p-first.npz"), &pairs.with_columns(&[2, 3, 0, 1])).expect("written");
    assert!(!train("p-first.npz", "1,0").contains("better"));
}

/// Of 128 times the data the network is trained to the same bits, and every command undoes the
/// units; with the units of the data nothing is learnt.
#[test]
fn units_are_fitted_and_undone() {
    let folder = folder();
    let path = folder.path();
    write_large_data(path);
    let train = |data: &str, output: &str, more: &[&str]| {
        let mut arguments = vec!["train", "--data", data, "--circle-action", "1,0"];
        arguments.extend(["--recipe", "paper", "--iterations", "60", "--output", output]);
        arguments.extend(more);
        text(&succeeds(path, &arguments).stderr)
    };
    assert!(!train("pairs.npz", "plain.json", &[]).contains("units"));
    let said = train("large.npz", "large.json", &[]);
    assert!(said.contains("1.2800e2, 1.2800e2, 1.2800e2, 1.2800e2"), "{said}");
    assert!(!train("large.npz", "raw.json", &["--units", "data"]).contains("units"));
    let [plain, scaled, raw] = ["plain.json", "large.json", "raw.json"]
        .map(|name| load_model(&path.join(name)).expect("a model"));
    let bits = |stored: &StoredModel| stored.model.composition().parameters().to_vec();
    assert_eq!(bits(&scaled), bits(&plain));
    assert_eq!(scaled.provenance.validation, plain.provenance.validation);
    assert!(raw.units.is_none() && bits(&raw) != bits(&plain));
    let report = |name: &str| -> Value {
        let file = path.join(format!("{name}-report/report.json"));
        serde_json::from_slice(&std::fs::read(file).expect("data")).expect("one JSON document")
    };
    let [of_plain, of_scaled] = ["plain", "large"].map(report);
    assert_eq!(of_scaled["studies"]["trust"]["units"]["factors"][0], 128.0);
    let component = |report: &Value| {
        report["studies"]["training"]["models"][0]["component_errors"][2]
            .as_f64()
            .expect("a number")
    };
    assert_eq!(component(&of_scaled), 128.0 * component(&of_plain));
    let share = |report: &Value| report["studies"]["trust"]["share_beyond_rotation"].clone();
    assert_eq!(share(&of_scaled), share(&of_plain));

    let start = [0.3, 0.2, -0.1, 0.4];
    write_points(&path.join("z.npy"), &[1, 4], &start).expect("written");
    write_points(&path.join("large.npy"), &[1, 4], &times(&start)).expect("written");
    let predict = |model: &str, input: &str, output: &str| {
        let mut arguments = vec!["predict", "--model", model, "--input", input, "--output", output];
        arguments.extend(["--steps", "10", "--invariant", "mu.npy", "--overwrite"]);
        let said = text(&succeeds(path, &arguments).stderr);
        assert!(!said.contains("outside"), "{said}");
        let numbers = |file: &str, count: usize| last_numbers(&path.join(file), count);
        (numbers(output, 44), numbers("mu.npy", 11))
    };
    let (states, along) = predict("plain.json", "z.npy", "t.npy");
    let (of_large, along_large) = predict("large.json", "large.npy", "large-t.npy");
    assert_eq!(of_large, times(&states));
    assert_eq!(along_large, times(&times(&along)));

    let output = succeeds(path, &["verify", "--model", "large.json", "--samples", "20"]);
    assert!(text(&output.stdout).contains("units"));
    succeeds(path, &["export", "--model", "large.json", "--output", "w.npz"]);
    let import = ["import", "--weights", "w.npz", "--circle-action", "1,0", "--epsilon", "0.01"];
    succeeds(path, &[&import[..], &["--output", "back.json"]].concat());
    let back = load_model(&path.join("back.json")).expect("a model");
    assert_eq!((&back.units, bits(&back)), (&scaled.units, bits(&scaled)));
}

/// θ is left as it is where it is known.
#[test]
fn a_known_angle_is_left() {
    let folder = folder();
    let path = folder.path();
    write_data(path);
    let train = |output: &str, more: &[&str]| {
        let mut arguments = vec!["train", "--data", "pairs.npz", "--circle-action", "1,0"];
        arguments.extend(["--recipe", "paper", "--iterations", "20"]);
        arguments.extend(["--theta", "0.5", "--output", output]);
        arguments.extend(more);
        succeeds(path, &arguments);
        load_model(&path.join(output)).expect("a model").model.angles().to_vec()
    };
    assert_eq!(train("fixed.json", &["--theta-fixed"]), [0.5]);
    assert_ne!(train("free.json", &[]), [0.5]);
    let held = train("held.json", &["--theta-penalty", "1e6"])[0];
    assert!(held != 0.5 && (held - 0.5).abs() < 1e-4, "{held}");
    let form = ["--theta-fixed", "--architecture", "normal-form", "--optimiser", "lm"];
    assert_eq!(train("form.json", &form), [0.5]);
    let net = ["train", "--data", "pairs.npz", "--circle-action", "1,0", "--output", "n.json"];
    let net = [&net[..], &["--architecture", "henon-net", "--theta-fixed"]].concat();
    refuses(path, &net, &["theta_fixed"]);
    let net =
        net.iter().map(|&word| if word == "--theta-fixed" { "--theta-penalty=1" } else { word });
    refuses(path, &net.collect::<Vec<_>>(), &["theta_penalty"]);
    let both = ["train", "--data", "pairs.npz", "--circle-action", "1,0", "--output", "n.json"];
    let both = [&both[..], &["--theta-fixed", "--theta-penalty=1"]].concat();
    refuses(path, &both, &["theta_penalty", "theta is fixed"]);
}

/// A normal form of order one, with a perturbation beside it or none.
#[test]
fn a_nearly_integrable_map_is_trained() {
    let folder = folder();
    let path = folder.path();
    write_data(path);
    let start = ["train", "--data", "pairs.npz", "--circle-action", "1,0", "--iterations", "5"];
    let train = |output: &str, perturbation: &str| {
        let form = ["--architecture", "normal-form", "--perturbation", perturbation];
        succeeds(path, &[&start[..], &SMALL, &form, &["--output", output]].concat());
        load_model(&path.join(output)).expect("a model").model.architecture().clone()
    };
    let widths = |of: Architecture| {
        let block = of.part(Part::Perturbation).next();
        block.map(|block| block.layers.widths().to_vec())
    };
    assert_eq!(widths(train("near.json", "2x3")), Some(vec![3, 3]));
    assert_eq!(widths(train("none.json", "0x3")), Some(vec![]));
    let weights = ["export", "--model", "near.json", "--output", "w.npz"];
    succeeds(path, &weights);
    let import = ["import", "--weights", "w.npz", "--circle-action", "1,0", "--epsilon", "0.01"];
    let back = [&import[..], &["--flow-time", "1", "--output", "back.json"]].concat();
    let said = text(&succeeds(path, &back).stdout);
    assert!(said.contains("perturbation 2 turned kicks"), "{said}");
    let back = load_model(&path.join("back.json")).expect("a model").model;
    assert_eq!(widths(back.architecture().clone()), Some(vec![3, 3]));
    // An integrable map of order one is not taken for one that ε scales.
    succeeds(path, &["export", "--model", "none.json", "--output", "none.npz"]);
    let import = ["import", "--weights", "none.npz", "--circle-action", "1,0", "--epsilon", "0.01"];
    succeeds(path, &[&import[..], &["--flow-time", "1", "--output", "none-back.json"]].concat());
    let [before, after] = ["none.json", "none-back.json"]
        .map(|file| load_model(&path.join(file)).expect("a model").model);
    assert_eq!(widths(after.architecture().clone()), Some(vec![]));
    assert_eq!(before.composition().parameters(), after.composition().parameters());
    // Of an unknown flow time the unit is a step, at ε = 0 too.
    let form = ["--architecture", "normal-form", "--perturbation", "2x3", "--epsilon", "0"];
    succeeds(path, &[&start[..], &SMALL, &form, &["--output", "zero.json"]].concat());
    let zero = load_model(&path.join("zero.json")).expect("a model").model;
    assert_eq!((zero.architecture().flow_time, zero.epsilon()), (1.0, 0.0));
    let net = [&start[..], &["--recipe", "paper", "--perturbation", "2x3", "--output", "x.json"]]
        .concat();
    refuses(path, &net, &["--perturbation", "psi, near_identity"]);
    let form = ["--architecture", "normal-form", "--perturbation", "2", "--output", "x.json"];
    refuses(path, &[&start[..], &form].concat(), &["--perturbation"]);
}

/// A circle action that nobody stated.
#[test]
fn a_circle_action_is_chosen() {
    let folder = folder();
    let path = folder.path();
    write_data(path);
    let auto = ["train", "--data", "pairs.npz", "--circle-action", "auto", "--iterations", "3"];
    let output = succeeds(path, &[&auto[..], &SMALL, &["--output", "model.json"]].concat());
    let said = text(&output.stderr);
    assert!(said.contains("circle action 1,0"), "{said}");
    let model = load_model(&path.join("model.json")).expect("a model").model;
    assert_eq!(model.architecture().circles[0].weights(), [1, 0]);
    let report = std::fs::read_to_string(path.join("model-report/report.md")).expect("a report");
    assert!(report.contains("--circle-action 1,0"), "what was chosen is what is repeated");
    // Pairs that stand still turn by no action.
    let mut stream = Stream::new(1, "still");
    let points: Vec<f64> = (0..80).map(|_| stream.uniform(-1.0, 1.0)).collect();
    let still = Pairs::new("still", 2, points.clone(), points).expect("whole");
    write_pairs(&path.join("still.npz"), &still).expect("written");
    let auto = ["train", "--data", "still.npz", "--circle-action", "auto", "--output", "x.json"];
    refuses(path, &auto, &["--circle-action", "none for sure", "the planes turn by"]);
}

/// The report says in its first lines whether to trust the model, and why not.
#[test]
fn a_report_says_whether_to_trust_the_model() {
    let folder = folder();
    let path = folder.path();
    write_data(path);
    let train = |output: &str, more: &[&str]| {
        let mut arguments = vec!["train", "--data", "pairs.npz", "--circle-action", "1,0"];
        arguments.extend(["--output", output]);
        arguments.extend(more);
        let said = text(&succeeds(path, &arguments).stdout);
        let folder = path.join(output.replace(".json", "-report"));
        let report = std::fs::read_to_string(folder.join("report.md")).expect("a report");
        let data = std::fs::read(folder.join("report.json")).expect("data");
        let data: Value = serde_json::from_slice(&data).expect("one JSON document");
        let first = report.split("## ").nth(1).expect("a section").to_owned();
        assert!(first.starts_with("Whether to trust it"), "{report}");
        assert!(said.contains("Whether to trust it"), "{said}");
        (first, data["studies"]["trust"].clone())
    };
    let (text, data) = train("none.json", &["--recipe", "paper", "--iterations", "1"]);
    assert!(text.contains("**no**") && text.contains("little is learnt"), "{text}");
    assert!(data["share_beyond_rotation"].as_f64().expect("a number") > 0.5);
    let report = std::fs::read(path.join("none-report/report.json")).expect("data");
    let report: Value = serde_json::from_slice(&report).expect("one JSON document");
    let model = &report["studies"]["training"]["models"][0];
    let numbers = |key: &str| -> Vec<f64> {
        let values = model[key].as_array().expect("numbers").iter();
        values.map(|value| value.as_f64().expect("a number")).collect()
    };
    // Squares of what the rotation leaves, weighed by the shares, are the error of all.
    let (errors, shares) = (numbers("component_errors"), numbers("component_shares"));
    let left: f64 = errors.iter().zip(&shares).map(|(error, share)| (error / share).powi(2)).sum();
    let all: f64 = errors.iter().map(|error| error * error).sum();
    let share = data["share_beyond_rotation"].as_f64().expect("a number");
    assert!(((all / left).sqrt() / share - 1.0).abs() < 1e-12, "{shares:?}, {share}");
    let more = ["--starts", "1", "--architecture", "normal-form", "--iterations"];
    let (text, data) = train("astray.json", &[&more[..], &["30"]].concat());
    // As many parameters as numbers: learnt by heart.
    assert!(text.contains("with care") && text.contains("box"), "{text}");
    assert!(data["astray"].as_u64() > Some(0) && data["limit"] == "data");
    let window = Window { low: vec![-1.0; 4], high: vec![1.0; 4], samples: 1500 };
    let points = sample(&[window], 2, &mut Stream::new(3, "points")).expect("points");
    let (pairs, _) = Pairs::of_flow(&Oscillators { epsilon: 0.01 }, points, 5.0).expect("a flow");
    write_pairs(&path.join("pairs.npz"), &pairs).expect("written");
    let sizes = ["60", "--kicks", "4x8", "--twists", "6x8"];
    let (text, data) = train("good.json", &[&more[..], &sizes].concat());
    assert!(!text.contains("**no**") && data["no"] == serde_json::json!([]), "{text}");
    assert!(data["astray"].as_u64() <= Some(1), "{data}");
    assert!(data["own_invariant_drift"].as_f64().expect("a number") < 1e-10);
    let (text, _) =
        train("all.json", &["--recipe", "paper", "--iterations", "30", "--validation", "0"]);
    assert!(text.contains("held out"), "{text}");
}

/// A model of polynomials knows where their box ends, whatever points it was trained on.
#[test]
fn trajectories_that_leave_the_box_of_polynomials_are_reported() {
    let folder = with_model();
    let path = folder.path();
    let sizes = ["--kicks", "2x2^4", "--twists", "2x2^3", "--circle-action", "1,0"];
    let train = ["train", "--data", "pairs.npz", "--starts", "1", "--iterations", "4"];
    let output = call(path, &[&train[..], &sizes, &["--output", "poly.json"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let stored = load_model(&path.join("poly.json")).expect("a model");
    assert!(stored.model.architecture().has_polynomials());
    let report: Value = serde_json::from_slice(
        &std::fs::read(path.join("poly-report/report.json")).expect("a report"),
    )
    .expect("JSON");
    assert!(report.to_string().contains("\"reach\":"), "{report}");
    let said = std::fs::read_to_string(path.join("poly-report/report.md")).expect("a report");
    assert!(said.contains("of their box"), "{said}");
    let far = [0.1, 0.1, 0.1, 0.1, 0.1, 40.0, 0.1, 0.1];
    write_points(&path.join("far.npy"), &[2, 4], &far).expect("written");
    let predict = |output: &str, more: &[&str]| {
        let arguments = ["predict", "--model", "poly.json", "--input", "far.npy", "--steps", "1"];
        call(path, &[&arguments[..], &["--output", output], more].concat())
    };
    let output = predict("t.npy", &["--json"]);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(
        said.contains("the box of the model's polynomials") && said.contains("rows 1,"),
        "{said}"
    );
    let json: Value = serde_json::from_slice(&output.stdout).expect("one JSON document");
    let beyond = &json["outside_polynomials"];
    assert_eq!((beyond["row"].as_u64(), beyond["step"].as_u64()), (Some(1), Some(0)));
    let reach = beyond["reach"].as_f64().expect("a number");
    let mut z = far[4..].to_vec();
    stored.units.iter().for_each(|units| units.to_network(&mut z));
    assert!(reach > 1.0 && reach == stored.model.reach(&z), "{reach}");
    let output = predict("s.npy", &["--outside", "stop"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(!path.join("s.npy").exists());
    let output = predict("i.npy", &["--outside", "ignore"]);
    assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output.stderr));
    // An orbit that polynomials send to infinity takes no other with it.
    let far = [far[..4].to_vec(), vec![0.1, 1e200, 0.1, 0.1]].concat();
    write_points(&path.join("far.npy"), &[2, 4], &far).expect("written");
    for (file, outside) in [("w.npy", "warn"), ("i.npy", "ignore")] {
        let output = predict(file, &["--outside", outside, "--overwrite"]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{said}");
        assert_eq!(said.contains("rows 1,"), outside == "warn", "{said}");
        let states = last_numbers(&path.join(file), 8);
        assert!(states[..4].iter().all(|v| v.is_finite()), "{states:?}");
        assert!(states[4..].iter().all(|v| v.is_nan()), "{states:?}");
    }
    for (wrong, words) in [
        (["--kicks", "2x2^0"], ["degree", "0"]),
        (["--kicks", "2x2^65"], ["degree", "65"]),
        (["--radius", "1.0"], ["radius", "degree"]),
        (["--ramp", "^4x10"], ["degree", "polynomials"]),
        (["--ramp", "x10"], ["--ramp", "5/2x100"]),
        (["--ramp", "5//2x10"], ["--ramp", "5/2x100"]),
        (["--ramp", "5/2/2x10"], ["--ramp", "5/2x100"]),
        (["--ramp", "5@x10"], ["--ramp", "5/2x100"]),
        (["--ramp", "5^4^4x10"], ["--ramp", "5/2x100"]),
        (["--ramp", "5é@1x10"], ["--ramp", "5/2x100"]),
        (["--ramp", "@0.1/2^4"], ["--ramp", "5/2x100"]),
    ] {
        refuses(
            path,
            &[&train[..], &wrong, &["--circle-action", "1,0", "--output", "n.json"]].concat(),
            &words,
        );
    }
    let boxless = ["--kicks", "2x2^3", "--radius", "0"];
    refuses(path, &[&train[..], &boxless, &["--output", "n.json"]].concat(), &["radius", "0"]);
}

/// A model knows where it was trained: what leaves that box is reported, or stops the command.
#[test]
fn trajectories_that_leave_the_training_points_are_reported() {
    let folder = with_model();
    let path = folder.path();
    let stored = load_model(&path.join("model.json")).expect("a model");
    let region = stored.provenance.region.as_ref().expect("a box");
    assert!(region.low.len() == 4 && region.low.iter().zip(&region.high).all(|(a, b)| a < b));
    let inside: Vec<f64> =
        region.low.iter().zip(&region.high).map(|(a, b)| (a + b) / 2.0).collect();
    let mut outside = inside.clone();
    outside[3] = 2.0 * region.high[3];
    let points = [&inside[..], &outside, &inside].concat();
    write_points(&path.join("far.npy"), &[3, 4], &points).expect("written");
    // One step of none is no roll-out; what lies beside an output stays.
    let fewer = ["predict", "--model", "model.json", "--input", "far.npy", "--steps", "4"];
    let fewer = [&fewer[..], &["--every", "5", "--output", "t.npy"]].concat();
    refuses(path, &fewer, &["--every", "at most 4"]);
    std::fs::write(path.join("t.npy.probe"), "mine").expect("written");
    let predict = |output: &str, more: &[&str]| {
        let mut arguments = vec!["predict", "--model", "model.json", "--input", "far.npy"];
        arguments.extend(["--steps", "4", "--every", "2", "--output", output]);
        arguments.extend(more);
        call(path, &arguments)
    };
    let output = predict("t.npy", &["--json", "--invariant", "mu.npy"]);
    assert_eq!(std::fs::read(path.join("t.npy.probe")).expect("kept"), b"mine");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let said = text(&output.stderr);
    for words in ["of 9 kept states", "1 trajectory", "rows 1,", "row 1", "at the start: p2 = "] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let json: Value = serde_json::from_slice(&output.stdout).expect("one JSON document");
    assert_eq!(
        (json["outside"]["row"].as_u64(), json["outside"]["coordinate"].as_u64()),
        (Some(1), Some(3))
    );
    // The invariant of the network along them.
    let numbers = |file: &str, count: usize| last_numbers(&path.join(file), count);
    let (states, along) = (numbers("t.npy", 36), numbers("mu.npy", 9));
    let own = stored.model.invariant().expect("a gyroceptron");
    for (z, value) in states.chunks_exact(4).zip(&along) {
        assert_eq!(own(z).to_bits(), value.to_bits());
    }
    // Nothing is written where it is to stop, and nothing said where it is to be ignored.
    let output = predict("s.npy", &["--outside", "stop"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("nothing is written") && !path.join("s.npy").exists());
    let output = predict("s.npy", &["--outside", "stop", "--json"]);
    let json: Value = serde_json::from_slice(&output.stdout).expect("one JSON document");
    assert_eq!(output.status.code(), Some(1));
    assert!(
        json["output"].is_null() && json["outside"]["rows"] == serde_json::json!([1]),
        "{json}"
    );
    let output = predict("i.npy", &["--outside", "ignore", "--json"]);
    assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output.stderr));
    let refused = |arguments: &[&str], words: &[&str]| {
        let mut all = vec![
            "predict",
            "--model",
            "model.json",
            "--input",
            "far.npy",
            "--steps",
            "4",
            "--output",
            "n.npy",
        ];
        all.extend(arguments);
        refuses(path, &all, words);
    };
    refused(&["--invariant", "n.npy"], &["--invariant", "another file"]);
    refused(&["--invariant", "./n.npy"], &["--invariant", "another file"]);
    refused(&["--invariant", "far.npy", "--overwrite"], &["--invariant", "far.npy"]);
    refused(&["--outside", "perhaps"], &["--outside"]);
}

/// Each kind of network by each optimiser, with a report beside the model, which says how
/// to do it again, to the same bits.
#[test]
fn training_offers_networks_and_optimisers_and_reports() {
    let folder = folder();
    let path = folder.path();
    write_data(path);
    let base = ["train", "--data", "pairs.npz", "--circle-action", "1,0", "--iterations", "6"];
    let base = [&base[..], &["--recipe", "paper"]].concat();
    let with = |more: &[&str]| -> Vec<String> {
        [&base[..], more].concat().iter().map(|s| s.to_string()).collect()
    };
    let call = |arguments: Vec<String>| {
        succeeds(path, &arguments.iter().map(String::as_str).collect::<Vec<_>>())
    };
    for (number, (more, kind, parameters)) in [
        (
            &[
                "--optimiser",
                "lm",
                "--psi",
                "2x3",
                "--near-identity",
                "3x4",
                "--epsilon",
                "0.03",
                "--theta",
                "0.4",
                "--validation",
                "0.3",
                "--seed",
                "5",
            ][..],
            "gyroceptron",
            83,
        ),
        (
            &["--architecture", "henon-net", "--optimiser", "adam", "--layers", "3x4"],
            "henon-net",
            54,
        ),
        (
            &["--architecture", "sympnet", "--optimiser", "l-bfgs", "--layers", "3x2"],
            "symp-net",
            34,
        ),
    ]
    .into_iter()
    .enumerate()
    {
        let file = format!("m{number}.json");
        let output = call(with(&[more, &["--output", &file]].concat()));
        let words = text(&output.stdout);
        assert!(words.contains(&format!("m{number}-report/report.md")), "{words}");
        let model: Value =
            serde_json::from_slice(&std::fs::read(path.join(&file)).expect("a model"))
                .expect("JSON");
        let stored = load_model(&path.join(&file)).expect("a model");
        assert_eq!(stored.model.architecture().name(), Some(kind));
        assert_eq!(model["parameters"].as_array().expect("numbers").len(), parameters, "{kind}");
        let report = path.join(format!("m{number}-report"));
        for name in ["report.md", "report.json", "loss.svg", "loss.csv", "as-run.toml"] {
            assert!(report.join(name).exists(), "{name}");
        }
        let said = std::fs::read_to_string(report.join("report.md")).expect("a report");
        // The command that it tells does the same again.
        let line = said.lines().find(|line| line.starts_with("`gyroceptron train")).expect("said");
        let line = line.split('`').nth(1).expect("a command");
        let again = format!("again{number}.json");
        let line = line
            .replace("MODEL.json", &again)
            .replace("as-run.toml", &format!("m{number}-report/as-run.toml"));
        call(line.split(' ').skip(1).map(str::to_owned).collect());
        let again: Value =
            serde_json::from_slice(&std::fs::read(path.join(&again)).expect("a model"))
                .expect("JSON");
        assert_eq!(again["parameters"], model["parameters"], "{kind}");
        // Nothing is replaced unless asked.
        let second = with(
            &[more, &["--output", "other.json", "--report", &format!("m{number}-report")]].concat(),
        );
        refuses(path, &second.iter().map(String::as_str).collect::<Vec<_>>(), &["report"]);
    }
    let sizes = ["--optimiser", "lm", "--psi", "2x3", "--near-identity", "2x3"];
    let target = ["--target", "1", "--output", "target.json", "--json"];
    let stopped = call(with(&[&sizes[..], &target].concat()));
    let stopped: Value = serde_json::from_slice(&stopped.stdout).expect("JSON");
    assert_eq!(stopped["stop"], "target");
    for (more, words) in [
        (&["--psi", "2"][..], &["--psi", "10x8"][..]),
        (&["--psi", "0x8"], &["gyroceptron: psi: layers: expected", "(--psi)"]),
        (&["--architecture", "henon-net", "--psi", "2x2"], &["--psi", "a size of henon-net"]),
        (&["--layers", "2x2"], &["--layers", "a size of gyroceptron"]),
        (&["--near-identity-penalty", "-1"], &["near_identity_penalty"]),
        (&["--target", "nan"], &["gyroceptron: target: ", "(--target)"]),
        (&["--architecture", "henon-net", "--epsilon", "0.3"], &["--epsilon"]),
        (&["--architecture", "sympnet", "--theta", "1"], &["--theta"]),
        (&["--report", "."], &["--report"]),
        // Known before it is due.
        (&["--report", "pairs.npz"], &["pairs.npz"]),
        (&["--report", "pairs.npz/below"], &["pairs.npz"]),
        (&["--optimiser", "sgd"], &["sgd", "l-bfgs"]),
        (
            &["--architecture", "henon-net", "--layers", "2x2", "--near-identity-penalty", "1"],
            &["near_identity_penalty"],
        ),
    ] {
        let arguments = with(&[more, &["--output", "bad.json"]].concat());
        refuses(path, &arguments.iter().map(String::as_str).collect::<Vec<_>>(), words);
        assert!(!path.join("bad.json").exists());
    }
    // A report is put beside a model of somebody else's, and takes the place of its like, not of a run.
    std::fs::create_dir(path.join("theirs")).expect("made");
    std::fs::write(path.join("theirs/model.json"), "theirs").expect("written");
    let beside = |output: &str, more: &[&str]| {
        with(&[&["--output", output, "--report", "theirs"], more].concat())
    };
    let refused = |arguments: &[String], words: &[&str]| {
        refuses(path, &arguments.iter().map(String::as_str).collect::<Vec<_>>(), words);
    };
    refused(&beside("one.json", &[]), &["theirs"]);
    call(beside("one.json", &["--overwrite"]));
    let kept = || std::fs::read(path.join("theirs/model.json")).expect("kept");
    assert!(kept() == b"theirs" && path.join("theirs/report.md").exists());
    refused(&beside("two.json", &["--overwrite"]), &["theirs", "model.json"]);
    assert!(kept() == b"theirs" && path.join("theirs/report.md").exists());
    let again =
        |output: &str| call(with(&["--output", output, "--report", "again", "--overwrite"]));
    again("one.json");
    again("two.json");
    assert!(path.join("again/report.md").exists());
}

/// The error over many steps is what a user asks first.
#[test]
fn trajectories_are_compared_with_those_of_a_file() {
    let folder = with_model();
    let path = folder.path();
    let predict = |output: &str, added: &[&'static str]| {
        let words = [
            "predict",
            "--model",
            "model.json",
            "--input",
            "z.npy",
            "--steps",
            "40",
            "--every",
            "10",
        ];
        let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
        [
            words,
            vec!["--output".into(), output.into()],
            added.iter().map(|w| (*w).to_owned()).collect(),
        ]
        .concat()
    };
    let go =
        |words: Vec<String>| succeeds(path, &words.iter().map(String::as_str).collect::<Vec<_>>());
    go(predict("own.npy", &[]));
    let same = text(&go(predict("x.npy", &["--compare", "own.npy"])).stdout);
    assert!(
        same.contains("distance from own.npy:\n  after 10 steps 0.00e0 (rms), 0.00e0 at most"),
        "{same}"
    );
    assert!(same.contains("after 40 steps 0.00e0") && !same.contains("after 30 steps"), "{same}");
    // One of three trajectories is 0.3 and 0.4 off in two of its numbers, from step 20 on.
    let own = read_trajectories(&path.join("own.npy"), 2).expect("trajectories");
    let mut values = own.values().to_vec();
    for state in values.chunks_exact_mut(12).skip(2) {
        state[4] += 0.3;
        state[7] -= 0.4;
    }
    write_points(&path.join("off.npy"), &[5, 3, 4], &values).expect("written");
    let output = go(predict("y.npy", &["--compare", "off.npy", "--json"]));
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let rows = said["compared"].as_array().expect("rows");
    assert_eq!(rows.len(), 5);
    for (index, row) in rows.iter().enumerate() {
        let number = |key: &str| row[key].as_f64().expect("a number");
        let (rms, largest) = if index < 2 { (0.0, 0.0) } else { (0.5 / 3.0_f64.sqrt(), 0.5) };
        assert_eq!(number("steps"), 10.0 * index as f64);
        assert!(
            (number("rms") - rms).abs() < 1e-14 && (number("largest") - largest).abs() < 1e-14,
            "{row}"
        );
    }
    let refused = |added: &[&'static str], words: &[&str]| {
        let line = predict("z2.npy", added);
        refuses(path, &line.iter().map(String::as_str).collect::<Vec<_>>(), words);
    };
    refused(
        &["--compare", "own.npy", "--block", "1/2"],
        &["own.npy: trajectories: expected 1, found 3"],
    );
    refused(&["--compare", "z.npy"], &["z.npy"]);
    let short = [&predict("z3.npy", &["--compare", "own.npy"])[..6], &["20".into()]].concat();
    let rest = predict("z3.npy", &["--compare", "own.npy"])[7..].to_vec();
    let line = [short, rest].concat();
    refuses(
        path,
        &line.iter().map(String::as_str).collect::<Vec<_>>(),
        &["states", "expected 3, found 5"],
    );
}
