//! Models of files and of training, side by side.

use crate::helpers::{failed_in, refused, run_in, temporary};
use crate::invariants::PROFILES;
use crate::surfaces::SURFACES;
use gyroceptron::flow::{Pairs, ReferenceTrajectories, Window, sample_of};
use gyroceptron::io::{Provenance, StoredModel, export_weights, load_model, save_model};
use gyroceptron::network::{HenonShape, Model};
use gyroceptron::phase::{Map, Units};
use gyroceptron::random::Stream;
use gyroceptron::scalar::max_or_nan;
use gyroceptron::scene::{Report, Scene, find, parse, render};
use gyroceptron::system::{FieldLines, Hamiltonian};
use gyroceptron::{Error, flow};
use serde_json::Value;
use std::path::Path;

const FILE: &str = r#"
name = "published-weights"
seed = 1
flow_time = 0.5
plots = ["adiabatic-invariant"]

[system]
kind = "oscillators"
epsilon = 0.01

[data]
validation = 0.5
windows = [{ low = [-1.6, -1.6, -1.6, -1.6], high = [1.6, 1.6, 1.6, 1.6], samples = 200 }]

[[models]]
name = "ours"
network = { kind = "gyroceptron", psi = { count = 2, width = 3 }, near_identity = { count = 2, width = 3 } }
weights = { kind = "normal", scale = 0.15 }

[[models]]
name = "published"
network = { kind = "file" }
weights = { kind = "glorot" }

[training]
iterations = 20

[rollout]
steps = 200
every = 1
initial = [[1.5, 0.15, 0.0, 0.0], [1.5, 1.0, 0.0, 0.0]]
"#;

/// Weights of a file are judged as those that are trained, and say that they were not.
#[test]
fn weights_of_a_file_stand_beside_trained_ones() {
    let scene = parse("file", FILE).expect("a scene");
    assert!(matches!(scene.complete(), Err(Error::Missing { .. })));
    let (first, second) = (temporary(), temporary());
    let alone = FILE.replace("[[models]]\nname = \"published\"\nnetwork = { kind = \"file\" }\nweights = { kind = \"glorot\" }\n", "");
    let trained = run_in(first.path(), &parse("alone", &alone).expect("a scene"));
    let model = load_model(&first.path().join("model.json")).expect("a model").model;
    let weights = first.path().join("weights.npz");
    export_weights(&weights, &model, None).expect("written");
    let gone = scene.clone().with_weights(Path::new("gone.npz")).0;
    let (scene, any) = scene.with_weights(&weights);
    assert!(any);
    let report = run_in(second.path(), &scene);
    let best = |report: &Report, k: usize| {
        let data = &report.study("training").expect("a study").results.data["models"][k];
        data["best"]["validation"].as_f64().expect("a number")
    };
    assert_eq!(best(&report, 1), best(&trained, 0));
    let stop = |k: usize| {
        report.study("training").expect("a study").results.data["models"][k]["stop"].clone()
    };
    assert_eq!((stop(0), stop(1)), ("iterations".into(), "not-trained".into()));
    // Both own an invariant; the same weights, the same numbers.
    let models = &report.study("rollout").expect("a study").results.data["models"];
    assert_eq!(models[0]["own_adiabatic"], models[1]["own_adiabatic"]);
    let text = std::fs::read_to_string(second.path().join("report.md")).expect("a report");
    assert!(text.contains("The invariant 𝔍₀∘ψ⁻¹ of `published` moves by up to"));
    assert!(gone.complete().is_ok());
    let said = gone.check_networks(second.path()).expect_err("no file").to_string();
    assert!(said.contains("models.published") && said.contains("gone.npz"), "{said}");

    // A second file is for none.
    assert!(!scene.with_weights(Path::new("gone.npz")).1);
}

/// Models of any architecture are studied as they are, where they stand for the scene's map.
#[test]
fn models_of_files_are_studied_as_they_are() {
    let made = temporary();
    let others = r#"
[[models]]
name = "normal"
network = { kind = "normal-form", kicks = { count = 1, width = 2 }, twists = { count = 1, width = 2 } }
weights = { kind = "normal", scale = 0.15 }

[[models]]
name = "henon"
network = { kind = "henon-net", layers = { count = 1, width = 2 } }
weights = { kind = "normal", scale = 0.15 }
"#;
    let published = "[[models]]\nname = \"published\"\nnetwork = { kind = \"file\" }\nweights = { kind = \"glorot\" }\n";
    let alone = FILE.replace(published, others);
    assert!(alone != FILE);
    let trained = run_in(made.path(), &parse("alone", &alone).expect("a scene"));
    let kept = temporary();
    for name in ["ours", "normal", "henon"] {
        let file = made.path().join(format!("model-{name}.json"));
        std::fs::copy(file, kept.path().join(format!("{name}.json"))).expect("copied");
    }
    // Of weights that are not drawn, nothing need be said.
    let of_file = |name: &str| {
        let network = format!("{{ kind = \"file\", path = \"{name}.json\" }}");
        format!("[[models]]\nname = \"{name}\"\nnetwork = {network}\n")
    };
    let (head, _) = FILE.split_once("[[models]]").expect("a set-up");
    let (_, tail) = FILE.split_once("[training]").expect("a training");
    let models: String = ["ours", "normal", "henon"].map(of_file).concat();
    let text = format!("{head}{models}[training]{tail}");
    let scene =
        parse("again", &text).and_then(|s| s.with_files_from(kept.path())).expect("a scene");
    let out = temporary();
    let again = run_in(out.path(), &scene);
    let models = |report: &Report, study: &str| {
        report.study(study).expect("a study").results.data["models"].clone()
    };
    for k in 0..3 {
        let best = |report: &Report| models(report, "training")[k]["best"]["validation"].clone();
        assert!(best(&again).is_f64());
        assert_eq!(best(&again), best(&trained));
    }
    assert_eq!(models(&again, "rollout"), models(&trained, "rollout"));
    let model = |path: &Path| load_model(path).expect("a model");
    for name in ["ours", "normal", "henon"] {
        let copy = model(&out.path().join(format!("model-{name}.json")));
        let own = model(&kept.path().join(format!("{name}.json")));
        assert_eq!(copy.model.composition().parameters(), own.model.composition().parameters());
        // What is known of it stays known.
        assert_eq!(copy.provenance, own.provenance);
        assert!(own.provenance.region.is_some());
    }

    // Where it is not what the scene is of, before anything is computed.
    let with = |from: &str, to: &str, words: &[&str]| {
        let other = text.replace(from, to);
        assert!(text != other);
        let scene = parse("other", &other).and_then(|s| s.with_files_from(kept.path()));
        let said = failed_in(temporary().path(), &scene.expect("a scene"));
        assert!(said.contains("models.") && said.contains(".json"), "{said}");
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
    };
    with("epsilon = 0.01", "epsilon = 0.02", &["a model of ε = 0.02", "0.01"]);
    with("flow_time = 0.5", "flow_time = 0.25", &["a model of flow time 0.25", "0.5"]);
    with("ours.json", "none.json", &["none.json"]);
    let path = kept.path().join("henon.json");
    let in_units = Units::new(vec![0.0; 4], vec![2.0; 4]).expect("units");
    let in_units = StoredModel { units: Some(in_units), ..model(&path) };
    save_model(&path, &in_units).expect("written");
    with("normal.json", "ours.json", &["units of its own"]);
    let shape = HenonShape::uniform(3, 1, 2);
    let weights = vec![0.1; shape.parameter_count()];
    let wide = Model::new(shape.architecture(1.0), weights).expect("a network");
    let provenance = Provenance::of_scene("by hand");
    save_model(&path, &StoredModel { model: wide, units: None, section: None, provenance })
        .expect("written");
    with("normal.json", "ours.json", &["a model of 2 degrees of freedom", "3"]);
    // A run there would remove or replace it.
    let said = failed_in(kept.path(), &scene);
    assert!(said.contains("a file outside of"), "{said}");
    assert!(!kept.path().join("as-run.toml").exists());
}

/// The learnt invariant along both orbits, by the definition.
#[test]
fn the_learnt_invariant_is_followed_along_both_orbits() {
    let alone = FILE.replace("[[models]]\nname = \"published\"\nnetwork = { kind = \"file\" }\nweights = { kind = \"glorot\" }\n", "");
    let folder = temporary();
    let report = run_in(folder.path(), &parse("alone", &alone).expect("a scene"));
    let model = load_model(&folder.path().join("model.json")).expect("a model").model;
    let network = &model;
    let own = &report.study("rollout").expect("a study").results.data["models"][0]["own_adiabatic"];
    let number = |v: &Value| v.as_f64().expect("a number");
    let mut z: [f64; 4] = [1.5, 0.15, 0.0, 0.0];
    let initial: f64 = network.adiabatic_invariant(&z)[0];
    let mut largest = 0.0_f64;
    for _ in 0..200 {
        model.forward(&mut z);
        largest = max_or_nan(largest, (network.adiabatic_invariant(&z)[0] - initial).abs());
    }
    let along = &own["along_own_orbits"]["along"][0];
    assert_eq!(number(&along["initial"]), initial);
    assert!((number(&along["largest"]) - largest).abs() <= 1e-12);
    let reference = flow::Reference::new(&gyroceptron::system::Oscillators { epsilon: 0.01 }, &z);
    let mut z: [f64; 4] = [1.5, 0.15, 0.0, 0.0];
    let mut largest = 0.0_f64;
    for _ in 0..200 {
        let system = gyroceptron::system::Oscillators { epsilon: 0.01 };
        reference.flow(&system, &mut z, 0.5).expect("converges");
        largest = max_or_nan(largest, (network.adiabatic_invariant(&z)[0] - initial).abs());
    }
    let along = &own["along_the_reference"]["along"][0];
    assert!((number(&along["largest"]) - largest).abs() <= 1e-9);
}

/// A scene of built-in parts by their names, with the table of the paper's claims.
#[test]
fn parts_are_summed_up_in_one_table() {
    let paper = find("paper").and_then(|entry| entry.scene()).expect("a scene");
    let names: Vec<_> = paper.parts.iter().map(|part| &part.name[..]).collect();
    for name in ["trajectories", "oscillators-short", "oscillators-long", "particle-field"] {
        assert!(names.contains(&name), "{name}");
    }
    let (without, lacking) = paper.clone().without_parts_that_lack_files();
    assert_eq!(lacking, ["published-weights"]);
    without.complete().expect("complete");
    let quick = without.quick();
    let iterations = |scene: &Scene, name: &str| {
        let part = scene.parts.iter().find(|part| part.name == name).expect("a part");
        part.setup.training.iterations
    };
    assert!(iterations(&quick, "oscillators-short") < iterations(&paper, "oscillators-short"));
    quick.complete().expect("complete");

    let text = "name = \"two\"\nscenes = [\"trajectories\"]\n[claims]\n";
    let mut scene = parse("two", text).expect("a scene");
    let profiles = parse("profiles", PROFILES).expect("a scene");
    scene.parts.push(profiles);
    let folder = temporary();
    let report = run_in(folder.path(), &scene);
    let rows = &report.study("claims").expect("a study").results.data;
    assert_eq!(rows[0]["experiment"], "trajectories");
    assert!(rows[0]["verdict"].as_str().expect("words").starts_with("reproduced"));
    assert_eq!(rows[1]["experiment"], "adiabatic-profiles");
    let report = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
    let place = |words: &str| report.find(words).expect(words);
    assert!(place("what the paper claims") < place("## Parts"));
    assert!(place("`gyroceptron run trajectories`") < place("## Parts"));
    refused("name = \"x\"\nscenes = [\"nowhere\"]\n", &[":2: ", "nowhere", "quickstart"]);
    refused("name = \"x\"\nscenes = 3\n", &[":2: ", "scenes", "found 3"]);
    // Lines are those of the file, whatever the scenes are that it names.
    let named = "name = \"x\"\nscenes = [\n  \"trajectories\",\n  \"quickstart\",\n]\n";
    refused(&format!("{named}seed = \"one\"\n"), &[":6: "]);
    refused(&format!("{named}sed = 1\n"), &[":6: ", "sed", "seed"]);
    refused(&format!("{named}[claims]\nstray = 1\n"), &[":7: ", "stray"]);
    refused(&PROFILES.replace("plots", "[claims]\n#plots"), &["claims", "parts"]);
}

/// Pairs of orbits begin where others end, on the map of the scene also at other times, in any
/// order; those held out are of orbits of their own.
#[test]
fn pairs_are_along_orbits() {
    let scene = "name = \"orbits\"\nseed = 3\n".to_owned()
        + SURFACES.split("seed = 1\n").nth(1).expect("a set-up");
    let scene = scene
        .replace("samples = 200", "samples = 12")
        .replace("validation = 0.25", "validation = 0.25\norbit = 5")
        .replace("iterations = 3", "iterations = 3\nramp = [{ flow_time = 0.5, iterations = 1 }]");
    let folder = temporary();
    let report = run_in(folder.path(), &parse("orbits", &scene).expect("a scene"));
    let found = &render::json(&report)["studies"]["pairs"];
    assert_eq!((&found["training"], &found["held_out"]), (&60.into(), &15.into()));
    let text = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
    assert!(text.contains("60 for training, 5 along each of 12 orbits, 15 held out"), "{text}");

    let system = FieldLines::new(4e-3);
    let windows = [Window { low: vec![-1.04, -1.16], high: vec![1.04, 0.82], samples: 12 }];
    let starts = sample_of(&system, &windows, &mut Stream::new(3, "data/training"));
    let starts = starts.expect("points");
    let turn = std::f64::consts::TAU;
    let orbits = ReferenceTrajectories::of_flow(&system, &starts, turn, 5).expect("orbits");
    let mut points: Vec<Vec<f64>> = Vec::new();
    for (m, start) in starts.chunks_exact(2).enumerate() {
        // Step by step, each orbit alone.
        let mut z = start.to_vec();
        for state in orbits.trajectories.orbit(m) {
            assert!(z.iter().zip(state).all(|(a, b)| (a - b).abs() < 1e-9));
            points.push(state.to_vec());
            let (pair, error) = Pairs::of_flow(&system, z, turn).expect("a pair");
            assert!(error < 1e-10);
            z = pair.output().to_vec();
        }
    }
    let stored = load_model(&folder.path().join("model.json")).expect("a model");
    let region = stored.provenance.region.expect("a box");
    for (k, high) in region.high.iter().enumerate() {
        let of_orbits = points.iter().map(|z| z[k]).fold(f64::MIN, max_or_nan);
        assert!(*high >= of_orbits - 1e-9, "{high} {of_orbits}");
    }
    let mut unordered = points.clone();
    Stream::new(3, "data/training/orbits").shuffle(&mut points);
    assert_ne!(points, unordered);
    let digest = |points: &[Vec<f64>]| {
        let pairs = Pairs::of_flow(&system, points.concat(), turn);
        Value::from(pairs.expect("pairs").0.digest())
    };
    assert_eq!(found["digest"], digest(&points));
    unordered.sort_by(|a, b| a[0].total_cmp(&b[0]));
    assert_ne!(found["digest"], digest(&unordered));

    // Orbits that leave the torus make way for others.
    let strong = FieldLines::new(0.05);
    let edge = [Window { low: vec![-0.3, -1.16], high: vec![0.3, -1.0], samples: 40 }];
    let start = sample_of(&strong, &edge, &mut Stream::new(3, "data/training")).expect("points");
    let all =
        ReferenceTrajectories::of_flow(&strong, &start, turn, 20).expect("orbits").trajectories;
    let leaves = |m: usize| all.orbit(m).any(|state| strong.check_point(state).is_err());
    let left = (0..40).filter(|m| leaves(*m)).count();
    assert!((1..30).contains(&left), "{left}");
    let of_strong = scene
        .replace("epsilon = 4e-3", "epsilon = 0.05")
        .replace(
            "low = [-1.04, -1.16], high = [1.04, 0.82]",
            "low = [-0.3, -1.16], high = [0.3, -1.0]",
        )
        .replace("samples = 12", "samples = 40")
        .replace("orbit = 5", "orbit = 20")
        .replace("[0.2, 0.48]", "[0.2]");
    let folder = temporary();
    let report = run_in(folder.path(), &parse("strong", &of_strong).expect("a scene"));
    assert_eq!(render::json(&report)["studies"]["pairs"]["training"], 800);

    // Without orbits, nothing of it, as with other keys at their defaults.
    let spelt_out = scene.replace("[data]", "[data]\nrelative = false\nepsilons = []");
    assert_eq!(
        parse("orbits", &spelt_out).expect("a scene"),
        parse("orbits", &scene).expect("one")
    );
    let alone = parse("orbits", &scene.replace("orbit = 5", "orbit = 1")).expect("a scene");
    assert_eq!(alone, parse("orbits", &scene.replace("\norbit = 5", "")).expect("a scene"));
    let quick = parse("orbits", &scene).expect("a scene").quick();
    let data = quick.setup.data.expect("data");
    assert_eq!((data.orbit, data.windows[0].samples), (2, 12));
    for (orbit, words) in [
        ("orbit = 0", &["data.orbit"][..]),
        ("orbit = 100000000", &["data.windows.samples", "at most 1"]),
        ("orbit = 5\npairs = \"p.npz\"", &["data"]),
        ("orbit = 5\nepsilons = [4e-3, 2e-3]", &["data.orbit", "several maps"]),
    ] {
        refused(&scene.replace("orbit = 5", orbit), words);
    }
    let few = scene.replace("validation = 0.25", "validation = 0.01");
    refused(&few, &["data.validation", "holds out an orbit"]);
    // A roll-out from where r(p_θ, θ) has no solution is refused before anything is trained.
    let rollout = "[rollout]\nsteps = 4\nevery = 1\ninitial = [[0.1, 0.2], [0.1, 3.0]]\n[surfaces]";
    refused(&scene.replace("[surfaces]", rollout), &["initial", "[0.1, 3.0]"]);
    let (set_up, _) = scene.split_once("[surfaces]").expect("a set-up");
    let (_, models) = scene.split_once("[[models]]").expect("a model");
    let trained = format!(
        "{}[[models]]{models}",
        set_up.replace("plots = [\"section\", \"surfaces-methods\"]", "")
    );
    assert!(parse("orbits", &trained).and_then(|scene| scene.complete()).is_ok());
    let quarter =
        trained.replace("flow_time = 6.283185307179586", "flow_time = 1.5707963267948966");
    refused(&quarter, &["data.orbit", "a multiple of the period"]);
    let independent = quarter.replace("orbit = 5", "");
    assert!(parse("orbits", &independent).and_then(|scene| scene.complete()).is_ok());
}
