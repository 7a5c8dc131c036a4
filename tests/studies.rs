//! Studies of scenes, as a caller of the library runs them.

use gyroceptron::flow::{Pairs, ReferenceTrajectories, Window, sample_of};
use gyroceptron::io::{Provenance, StoredModel, export_weights, load_model, save_model};
use gyroceptron::layer::CircleAction;
use gyroceptron::measure::{
    AdiabaticOrbit, drift_exponent, near_identity_rms, settling_iterations,
};
use gyroceptron::network::{GyroceptronShape, HenonShape, InitialWeights, Model};
use gyroceptron::phase::{Map, Units};
use gyroceptron::random::Stream;
use gyroceptron::scalar::max_or_nan;
use gyroceptron::scene::{Event, Folder, Observer, Report, Scene, find, parse, render, run};
use gyroceptron::system::{FieldLines, FullOrbit, Hamiltonian, NearlyPeriodic, ParticleField};
use gyroceptron::{Error, flow};
use serde_json::Value;
use std::path::Path;

struct Quiet;

impl Observer for Quiet {
    fn event(&mut self, _: Event<'_>) {}
}

fn run_in(folder: &Path, scene: &Scene) -> Report {
    let folder = Folder::open(folder, false, false).expect("a folder");
    run(scene, &folder, &mut Quiet).expect("runs").expect("not interrupted")
}

/// What a run says that fails.
fn failed_in(folder: &Path, scene: &Scene) -> String {
    let folder = Folder::open(folder, false, false).expect("a folder");
    match run(scene, &folder, &mut Quiet) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("it runs"),
    }
}

fn temporary() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn refused(text: &str, words: &[&str]) {
    let error = parse("scene", text).and_then(|scene| scene.complete()).expect_err("refused");
    let error = error.to_string();
    for word in words {
        assert!(error.contains(word), "`{error}` does not name `{word}`");
    }
}

fn network(epsilon: f64) -> Model {
    let circle_action = CircleAction::new([1]);
    let shape = GyroceptronShape { circle_action, psi: vec![4; 2], near_identity: vec![3; 2] };
    let weights = InitialWeights::Normal { scale: 0.8 };
    shape.architecture(epsilon).initialise(weights, 2.4, 5).expect("valid")
}

const START: [f64; 2] = [0.9, 0.4];

/// N(ε) and D(N) by plain loops over the map in w, and that map by the one in z.
#[test]
fn orbits_of_the_invariant_are_their_definition() {
    let factors = [1.1, 1.5, 4.0];
    for epsilon in [0.2, 0.05, 1e-3] {
        let network = network(epsilon);
        let map = network.in_conjugated_coordinates();
        let action = &network.architecture().circles[0];
        let mut orbit = AdiabaticOrbit::new(&network, &START, &factors).expect("valid");
        orbit.advance(&map, action, 2500);
        let (psi, mut z) = (network.psi(), START);
        let mut w = z;
        psi.inverse(&mut w);
        let initial = action.invariant(&w);
        let settling = settling_iterations(epsilon).expect("positive");
        let (mut settled, mut largest) = (0.0, 0.0);
        let mut horizons = [None; 3];
        let mut drifts = Vec::new();
        for step in 1..=2500_u64 {
            map.forward(&mut w);
            let drift = (action.invariant(&w) - initial).abs();
            largest = max_or_nan(largest, drift);
            if step <= settling as u64 {
                settled = largest;
            } else {
                for (horizon, factor) in horizons.iter_mut().zip(factors) {
                    if horizon.is_none() && drift > factor * settled {
                        *horizon = Some(step);
                    }
                }
            }
            if [10, 100, 1000].contains(&step) {
                drifts.push((step, largest));
            }
            if step <= 100 {
                network.forward(&mut z);
                let mut back = w;
                psi.forward(&mut back);
                let distance = (back[0] - z[0]).hypot(back[1] - z[1]);
                assert!(distance < 1e-10, "step {step}: {distance:e}");
            }
        }
        assert_eq!(orbit.horizons(), horizons, "ε = {epsilon}");
        assert_eq!(orbit.drifts(), drifts, "ε = {epsilon}");
        assert_eq!((orbit.steps(), orbit.largest()), (2500, largest));
        // In pieces and through its text: the same.
        let mut pieces = AdiabaticOrbit::new(&network, &START, &factors).expect("valid");
        for steps in [7, 10, 10, 999, 1000, 1001, 2500] {
            pieces.advance(&map, action, steps);
            let text = serde_json::to_string(&pieces).expect("serialises");
            pieces = serde_json::from_str(&text).expect("reads back");
        }
        assert_eq!(pieces, orbit);
    }
    let still = AdiabaticOrbit::new(&network(0.0), &START, &factors).expect("valid");
    assert!(still.horizons().is_empty());
    assert!(AdiabaticOrbit::new(&network(0.1), &[0.0; 3], &factors).is_err());
    assert!(AdiabaticOrbit::new(&network(-0.1), &START, &factors).is_err());
}

#[test]
fn the_exponent_of_a_drift_is_that_of_its_growth() {
    let orbit = |value: fn(f64) -> f64| {
        let values = (0..=5000).map(|t| value(f64::from(t))).collect();
        flow::Trajectories::new(values, 1, 1).expect("numbers")
    };
    let exponent = |value| drift_exponent(&orbit(value), |v| v[0]);
    assert!((exponent(|t| 3.0 + 2e-3 * t) - 1.0).abs() < 1e-3);
    assert!((exponent(|t| 3.0 + 1e-3 * t.sqrt()) - 0.5).abs() < 1e-2);
    assert!(exponent(f64::sin).abs() < 0.01);
    assert!(exponent(|_| 1.0).is_nan());
    assert!(exponent(|t| if t > 4000.0 { f64::NAN } else { t }).is_nan());
}

#[test]
fn the_size_of_a_change_is_its_root_mean_square() {
    let network = network(0.1);
    let near = network.near_identity();
    let points: [f64; 6] = [0.3, -0.2, 1.0, 0.5, -0.7, 0.1];
    let mut squares: f64 = 0.0;
    for z in points.chunks_exact(2) {
        let mut moved = z.to_vec();
        near.forward(&mut moved);
        squares += (moved[0] - z[0]).powi(2) + (moved[1] - z[1]).powi(2);
    }
    let rms = near_identity_rms(&near, &points);
    assert!((rms - (squares / 6.0).sqrt()).abs() < 1e-15 && rms > 1e-3);
}

const HORIZON: &str = r#"
name = "horizon"
seed = 2
plots = ["adiabatic-horizon"]

[adiabatic_horizon]
epsilons = [1e-1, 1e-3]
factors = [1.1, 2.0]
seeds = 3
iterations = 200000
long = { epsilons = [1e-3], iterations = 2500000 }
network = { psi = { count = 1, width = 1 }, near_identity = { count = 1, width = 1 }, theta = 2.4, weights = { kind = "normal", scale = 0.8 }, initial = [0.9, 0.4] }
"#;

/// Interrupts at the first sign of progress.
struct Impatient {
    parts: usize,
}

impl Observer for Impatient {
    fn event(&mut self, event: Event<'_>) {
        if let Event::Progress { done, total, .. } = event {
            assert!(done <= total);
            self.parts += 1;
        }
    }

    fn interrupted(&self) -> bool {
        self.parts > 0
    }
}

#[test]
fn an_interrupted_horizon_goes_on_to_the_same_numbers() {
    let scene = parse("horizon", HORIZON).expect("a scene");
    let (whole, pieces) = (temporary(), temporary());
    let report = run_in(whole.path(), &scene);
    let folder = Folder::open(pieces.path(), false, false).expect("a folder");
    let mut impatient = Impatient { parts: 0 };
    assert!(run(&scene, &folder, &mut impatient).expect("stops").is_none());
    let folder = Folder::open(pieces.path(), true, false).expect("a folder");
    let resumed = run(&scene, &folder, &mut Quiet).expect("runs").expect("to its end");
    assert_eq!(render::json(&resumed), render::json(&report));
    let data = &report.study("adiabatic_horizon").expect("a study").results.data;
    let orbits = data["orbits"].as_array().expect("orbits");
    // Two ε and rounding alone, three sets of weights each.
    assert_eq!(orbits.len(), 9);
    let steps = |k: usize| orbits[k]["iterations"].as_u64().expect("a count");
    assert_eq!((steps(0), steps(3), steps(4)), (200_000, 2_500_000, 200_000));
    let largest = |k: usize| orbits[k]["largest"].as_f64().expect("a number");
    assert!(largest(6) < 1e-11 && largest(3) > 1e-5);
    // Orbits that leave the numbers are stored too.
    let mut lost = AdiabaticOrbit::new(&network(1e-3), &[1e200, 0.0], &[1.1]).expect("finite");
    let map = network(1e-3).in_conjugated_coordinates();
    lost.advance(&map, &network(1e-3).architecture().circles[0], 20);
    let text = serde_json::to_string(&lost).expect("serialises");
    let read: AdiabaticOrbit = serde_json::from_str(&text).expect("reads back");
    assert_eq!((read.steps(), read.largest().to_bits()), (20, lost.largest().to_bits()));
    // A checkpoint of other options is not gone on with, nor is another scene.
    let other = parse("other", &HORIZON.replace("seeds = 3", "seeds = 2")).expect("a scene");
    let folder = Folder::open(pieces.path(), true, false).expect("a folder");
    assert!(run(&other, &folder, &mut Quiet).is_err());
    refused(&HORIZON.replace("[1.1, 2.0]", "[2.0, 1.1]"), &["factors", "ascending"]);
    refused(&HORIZON.replace("[1e-1, 1e-3]", "[0.0]"), &["epsilons"]);
    refused(&HORIZON.replace("{ epsilons = [1e-3]", "{ epsilons = [1e-4]"), &["long.epsilons"]);
    refused(&HORIZON.replace("seeds = 3", "seeds = 0"), &["seeds"]);
    refused(&HORIZON.replace("[1e-1, 1e-3]", "[1e-3, 1e-3]"), &["epsilons", "twice"]);
    refused(&HORIZON.replace("count = 1,", "count = 5000,"), &["count"]);
}

const PROFILES: &str = r#"
name = "adiabatic-profiles"
seed = 1
plots = ["adiabatic-profiles"]

[adiabatic_profiles]
epsilons = [1e-2, 1e-4, 1e-6]
iterations = 1000
network = { psi = { count = 2, width = 4 }, near_identity = { count = 2, width = 4 }, theta = 3.8832220774509327, weights = { kind = "glorot" }, initial = [1.0, 0.3] }
"#;

#[test]
fn profiles_shrink_with_epsilon() {
    let scene = parse("profiles", PROFILES).expect("a scene");
    let folder = temporary();
    let report = run_in(folder.path(), &scene);
    let data = &report.study("adiabatic_profiles").expect("a study").results.data;
    let number = |v: &Value| v.as_f64().expect("a number");
    let slopes: Vec<f64> = data
        .as_array()
        .expect("profiles")
        .iter()
        .map(|of| number(&of["drift"]["largest"]) / number(&of["epsilon"]))
        .collect();
    assert!(slopes.iter().all(|s| (s / slopes[2] - 1.0).abs() < 0.05), "{slopes:?}");
    let svg = std::fs::read_to_string(folder.path().join("adiabatic-profiles.svg")).expect("drawn");
    assert!(svg.contains("ε = 1e-6") && svg.contains("iterations"));
    refused(&PROFILES.replace("iterations = 1000", "iterations = 10"), &["iterations"]);
    refused(&PROFILES.replace("theta = 3.8832220774509327", "theta = nan"), &["theta"]);
    refused(&PROFILES.replace("width = 4", "width = 0"), &["layer"]);
}

#[test]
fn points_of_the_slow_manifold_have_no_action() {
    let system = ParticleField::two_modes(0.01);
    let z = system.on_slow_manifold(0.7, -0.3);
    assert_eq!(z, [0.7, 0.0, 0.0, -0.3, 0.0, 0.5]);
    assert_eq!(system.adiabatic_invariant(&z), 0.0);
}

const SLOW: &str = r#"
name = "particle-field"
seed = 1
flow_time = 0.5
plots = ["slow-manifold", "learnt-invariant"]

[system]
kind = "particle-field"
epsilon = 0.01
profiles = [
    { kind = "sine", amplitude = 0.5, wavenumber = 2.0 },
    { kind = "gaussian", amplitude = 0.5, rate = 5.0 },
]

[data]
validation = 0.2
windows = [
    { low = [-2.0, -0.5, -0.5, -1.0, -0.5, 0.0], high = [2.0, 0.5, 0.5, 1.0, 0.5, 1.0], samples = 600 },
]

[[models]]
name = "gyroceptron"
network = { kind = "gyroceptron", psi = { count = 2, width = 4 }, near_identity = { count = 2, width = 4 } }
weights = { kind = "normal", scale = 0.15 }
seeds = 3

[[models]]
name = "beside"
network = { kind = "henon-net", layers = { count = 2, width = 3 } }
weights = { kind = "normal", scale = 0.15 }
training = { iterations = 3, optimiser = { kind = "adam" } }
training_only = true

[training]
iterations = 12
optimiser = { kind = "levenberg-marquardt" }

[slow_manifold]
steps = 100
every = 2
on = [[-1.0, 0.5], [0.5, -0.6]]
off = [[0.0, 0.3, 0.0, 0.5, 0.1, 0.4]]
"#;

/// The reference stays at the slow manifold to order ε; networks are trained from each
/// of their weights, and those that are there for comparison go no further.
#[test]
fn the_slow_manifold_is_that_of_the_equations() {
    let scene = parse("slow", SLOW).expect("a scene");
    let folder = temporary();
    let report = run_in(folder.path(), &scene);
    let number = |v: &Value| v.as_f64().expect("a number");
    let data = &report.study("slow_manifold").expect("a study").results.data;
    let names: Vec<_> =
        data["slow"].as_array().expect("orbits").iter().map(|of| &of["name"]).collect();
    assert_eq!(names, ["reference", "gyroceptron"]);
    for largest in data["slow"][0]["largest_q_p_mu"].as_array().expect("two orbits") {
        let (q, p, mu) = (number(&largest[0]), number(&largest[1]), number(&largest[2]));
        assert!(q > 0.0 && q < 5.0 * 0.01 && p < 0.01 && mu < 5e-4, "{q} {p} {mu}");
    }
    let training = &report.study("training").expect("a study").results.data["models"];
    let trained: Vec<_> =
        training.as_array().expect("networks").iter().map(|m| &m["name"]).collect();
    let expected = ["gyroceptron", "gyroceptron-seed-2", "gyroceptron-seed-3", "beside"];
    assert_eq!(trained, expected);
    for name in expected {
        assert!(folder.path().join(format!("model-{name}.json")).exists(), "{name}");
    }
    let parameters = |name: &str| {
        let file = folder.path().join(format!("model-{name}.json"));
        load_model(&file).expect("a model").model.composition().parameters().to_vec()
    };
    assert_ne!(parameters("gyroceptron"), parameters("gyroceptron-seed-2"));
    let text = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
    for words in ["From several initial weights", "| `gyroceptron` | 3 |", "Adam", "Levenberg"] {
        assert!(text.contains(words), "the report lacks {words}");
    }
    assert!(text.contains("slow-manifold.csv") && text.contains("learnt-invariant.svg"));
    // Overwriting removes the files of all weights.
    let _ = Folder::open(folder.path(), false, true).expect("cleared");
    assert!(!folder.path().join("model-gyroceptron-seed-3.json").exists());
    assert!(!folder.path().join("slow-manifold.csv").exists());
    refused(&SLOW.replace("seeds = 3", "seeds = 0"), &["gyroceptron", "seeds"]);
    refused(&SLOW.replace("\"beside\"", "\"gyroceptron-seed-2\""), &["gyroceptron-seed-2"]);
    refused(&SLOW.replace("every = 2", "every = 101"), &["every"]);
    refused(&SLOW.replace("kind = \"adam\"", "kind = \"adam\", rate = -1.0"), &["beside", "rate"]);
    refused(&SLOW.replace("[[-1.0, 0.5]", "[[nan, 0.5]"), &["on"]);
}

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
    let told = gone.check_networks(second.path()).expect_err("no file").to_string();
    assert!(told.contains("models.published") && told.contains("gone.npz"), "{told}");

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
        let told = failed_in(temporary().path(), &scene.expect("a scene"));
        assert!(told.contains("models.") && told.contains(".json"), "{told}");
        assert!(words.iter().all(|word| told.contains(word)), "{told}");
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
    let provenance = Provenance::of("by hand");
    save_model(&path, &StoredModel { model: wide, units: None, provenance }).expect("written");
    with("normal.json", "ours.json", &["a model of 2 degrees of freedom", "3"]);
    // A run there would remove or replace it.
    let told = failed_in(kept.path(), &scene);
    assert!(told.contains("a file outside of"), "{told}");
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

const LONG_STEPS: &str = r#"
name = "long"
seed = 2
flow_time = 10.0
plots = ["long-steps"]
models = [
    { name = "normal-form", network = { kind = "normal-form", kicks = { count = 3, width = 4 }, twists = { count = 4, width = 4 } }, weights = { kind = "normal", scale = 0.15 } },
    { name = "gyroceptron", network = { kind = "gyroceptron", psi = { count = 1, width = 4 }, near_identity = { count = 2, width = 4 } }, weights = { kind = "normal", scale = 0.15 } },
]

[system]
kind = "oscillators"
epsilon = 0.01

[data]
validation = 0.5
windows = [{ low = [-1.0, -1.0, -1.0, -1.0], high = [1.0, 1.0, 1.0, 1.0], samples = 200 }]

[training]
iterations = 20
optimiser = { kind = "levenberg-marquardt" }

[long_steps]
flow_times = [5.0, 10.0, 20.0]
ramp = true
duration = 200.0
interval = 100.0
points = 50
rounds = 3
invariant_steps = 20000
initial = [[0.7, 0.1, 0.0, 0.2], [0.2, 0.6, 0.0, 0.0]]
integrators = [
    { integrator = { kind = "strang" }, steps = [25.0, 5.0, 1.0] },
    { integrator = { kind = "aba-1064" }, steps = [5.0, 2.5] },
]
"#;

#[test]
fn maps_of_several_flow_times_are_set_beside_integrators() {
    let folder = temporary();
    let scene = parse("long", LONG_STEPS).expect("a scene");
    let report = run_in(folder.path(), &scene);
    let data = render::json(&report);
    let times = data["studies"]["long_steps"].as_array().expect("flow times");
    assert_eq!(times.len(), 3);
    let number = |value: &Value| value.as_f64().expect("a number");
    for (at, time) in times.iter().zip([5.0, 10.0, 20.0]) {
        assert_eq!(number(&at["flow_time"]), time);
        let networks = at["networks"].as_array().expect("networks");
        assert_eq!(networks.len(), 2);
        assert!(number(&networks[0]["drift"]) < 1e-13, "{}", networks[0]["drift"]);
        assert!(networks[1]["drift"].is_null());
        let rotation = number(&at["rotation_error"]);
        for network in networks {
            assert!(number(&network["error"]) < 0.5 * rotation, "{network}");
            let legs = network["legs"].as_array().expect("legs");
            assert!(legs.is_empty());
        }
        // The steps nearest to those asked for, each number once.
        let settings = |comparison: &str, name: &str| -> Vec<f64> {
            let methods = at[comparison]["methods"].as_array().expect("methods").iter();
            let named = methods.filter(|m| m["name"].as_str().is_some_and(|n| n.starts_with(name)));
            named.filter_map(|method| method["setting"].as_f64()).collect()
        };
        let nearest = |time: f64| match time {
            5.0 => vec![1.0, 5.0],
            10.0 => vec![1.0, 2.0, 10.0],
            _ => vec![1.0, 4.0, 20.0],
        };
        assert_eq!(settings("one_step", "Strang"), nearest(time), "{at}");
        assert_eq!(settings("trajectories", "Strang"), [4.0, 20.0, 100.0]);
        // The error of a step is the root of 2n times that of a component.
        let methods = at["one_step"]["methods"].as_array().expect("methods");
        let step = number(&methods[0]["error"]);
        let component = number(&networks[0]["error"]).sqrt();
        assert!((step / (2.0 * component)).ln().abs() < 0.4, "{step} {component}");
    }
    // The weights of a flow time start the next, but for that of the scene.
    let model = |name: &str| load_model(&folder.path().join(name)).expect("a model").model;
    let first = model("model-normal-form-at-5.json");
    assert_eq!(first.architecture().flow_time, 5.0);
    let last = model("model-normal-form-at-20.json");
    assert_eq!(last.architecture().flow_time, 20.0);
    let middle = model("model-normal-form.json");
    let kicks = |model: &Model| model.composition().parameters()[..3].to_vec();
    let apart = |a: &[f64], b: &[f64]| -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan)
    };
    let (near, far) =
        (apart(&kicks(&last), &kicks(&middle)), apart(&kicks(&first), &kicks(&middle)));
    assert!(near < far, "{near} {far}");
    // What depends on the machine stands apart, in words too.
    let text = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
    for words in ["| `normal-form` |", "the network is faster by", "- `gyroceptron` "] {
        assert!(text.contains(words), "{words}");
    }
    assert!(!data.to_string().contains("lower"), "quartiles of seconds");
    let drawn = std::fs::read_to_string(folder.path().join("long-steps.csv")).expect("numbers");
    assert!(drawn.contains("\"error of a step\",\"normal-form\",2e1,"), "{drawn}");
    // A run over it leaves none of its files behind.
    let again = parse("long", &LONG_STEPS.replace("20.0]", "25.0]")).expect("a scene");
    let open = Folder::open(folder.path(), false, true).expect("a folder");
    run(&again, &open, &mut Quiet).expect("runs").expect("not interrupted");
    assert!(!folder.path().join("model-normal-form-at-20.json").exists());
    assert!(folder.path().join("model-normal-form-at-25.json").exists());
}

/// An integrator in place of the reference flow moves pairs and trajectories, and says how well.
#[test]
fn pairs_and_trajectories_are_those_of_the_flow_that_is_declared() {
    let alone = LONG_STEPS.replace("[5.0, 10.0, 20.0]", "[10.0]").replace("ramp = true\n", "");
    let by = |step: &str| {
        let flow = format!("flow = {{ integrator = {{ kind = \"strang\" }}, step = {step} }}\n");
        alone.replace("validation = 0.5\n", &format!("validation = 0.5\n{flow}"))
    };
    let studies = |scene: &str| {
        let folder = temporary();
        let report = run_in(folder.path(), &parse("long", scene).expect("a scene"));
        let text = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
        (render::json(&report)["studies"].clone(), text)
    };
    let number = |value: &Value| value.as_f64().expect("a number");
    let errors = |studies: &Value| {
        let long = &studies["long_steps"][0]["trajectories"]["reference_error"];
        [number(&studies["pairs"]["reference_error"]), number(long)]
    };
    let (exact, text) = studies(&alone);
    assert!(errors(&exact).iter().all(|error| *error < 1e-10), "{exact}");
    assert!(text.contains("Gauss–Legendre, 12 stages; largest difference of two resolutions"));
    let (coarse, text) = studies(&by("0.5"));
    let (fine, _) = studies(&by("0.125"));
    assert_ne!(coarse["pairs"]["digest"], exact["pairs"]["digest"]);
    assert!(text.contains("| reference flow | Strang, steps of 5e-1 at most;"), "{text}");
    for (coarse, fine) in errors(&coarse).iter().zip(errors(&fine)) {
        assert!((12.0..20.0).contains(&(coarse / fine)), "{coarse} {fine}");
    }
    // What is held out is of the same map: steps of 2.5 are far from the flow, and are learnt.
    let of = |studies: &Value| number(&studies["long_steps"][0]["networks"][0]["error"]);
    let (far, _) = studies(&by("2.5"));
    let from_flow = errors(&far)[0].powi(2);
    assert!(of(&far) < 0.1 * from_flow, "{} {from_flow} {}", of(&far), of(&exact));
    let with = |to: &str, words: &[&str]| {
        let scene = by("0.5").replace("kind = \"strang\" }, step = 0.5", to);
        assert!(scene != by("0.5"));
        refused(&scene, words);
    };
    with("kind = \"strang\" }, step = 0.0", &["data.flow.step"]);
    with("kind = \"strang\" }, step = nan", &["data.flow.step"]);
    with("kind = \"gauss-legendre\", stages = 0 }, step = 0.5", &["data.flow", "stages"]);
    with("kind = \"leap\" }, step = 0.5", &["leap"]);
    with("kind = \"strang\" }, step = 1e-9", &["data.flow.step", "in 10", "found 10000000000"]);
}

/// Only flow times to which the ramp leads up have twists that are trained alone.
#[test]
fn flow_times_beyond_the_ramp_have_fresh_twists() {
    let training = "[training]\nramp = [{ flow_time = 5.0, iterations = 10 }]\n\
                    fresh_twists = { count = 1, iterations = 10 }\n";
    let normal_form = LONG_STEPS.lines().filter(|line| !line.contains("\"gyroceptron\""));
    let scene = normal_form.collect::<Vec<_>>().join("\n");
    assert!(scene.contains("[training]\n") && scene.contains("ramp = true\n"));
    let scene = scene.replace("[training]\n", training).replace("ramp = true\n", "");
    let folder = temporary();
    let report = run_in(folder.path(), &parse("long", &scene).expect("a scene"));
    let data = render::json(&report);
    let times = data["studies"]["long_steps"].as_array().expect("flow times");
    let kinds = |at: &Value| -> Vec<String> {
        let legs = at["networks"][0]["legs"].as_array().expect("legs").iter();
        legs.map(|leg| leg["leg"]["kind"].as_str().expect("a kind").to_owned()).collect()
    };
    assert!(kinds(&times[0]).is_empty());
    assert_eq!(kinds(&times[1]), ["rung", "twists", "twists"]);
    assert_eq!(kinds(&times[2]), ["rung", "twists", "twists"]);
    // A run over it leaves none of its files behind.
    let left = |name: &str| folder.path().join(name).exists();
    assert!(left("checkpoint-normal-form-at-20-fresh-twists-1"));
    let again = parse("long", &scene.replace("20.0]", "25.0]")).expect("a scene");
    let open = Folder::open(folder.path(), false, true).expect("a folder");
    run(&again, &open, &mut Quiet).expect("runs").expect("not interrupted");
    assert!(!left("checkpoint-normal-form-at-20-fresh-twists-1"));
    assert!(left("checkpoint-normal-form-at-25-fresh-twists-1"));
    // Rungs of the time that is wanted are of another ε, or are none.
    let rungs = "ramp = [{ flow_time = 10.0, epsilon = 0.02, iterations = 10 }, \
                 { flow_time = 10.0, iterations = 10 }, { flow_time = 20.0, iterations = 10 }]";
    let scene = scene.replace("ramp = [{ flow_time = 5.0, iterations = 10 }]", rungs);
    let other = temporary();
    let report = run_in(other.path(), &parse("long", &scene).expect("a scene"));
    let data = render::json(&report);
    let times = data["studies"]["long_steps"].as_array().expect("flow times");
    let legs = |at: &Value| kinds(at).iter().filter(|kind| *kind == "rung").count();
    assert_eq!(times.iter().map(legs).collect::<Vec<_>>(), [0, 1, 2]);
    // A short form has one draw of them, and fewer iterations.
    let training = scene.replace("count = 1, iterations = 10 }", "count = 3, iterations = 100 }");
    let quick = parse("long", &training).expect("a scene").quick();
    let fresh = quick.setup.training.fresh_twists.expect("as in the scene");
    assert_eq!((fresh.count, fresh.iterations), (1, 25));
}

#[test]
fn flow_times_that_do_not_fit_are_refused() {
    let with = |from: &str, to: &str, words: &[&str]| {
        assert!(LONG_STEPS.contains(from), "{from}");
        refused(&LONG_STEPS.replace(from, to), words);
    };
    with("[5.0, 10.0, 20.0]", "[]", &["long_steps", "flow_times"]);
    with("[5.0, 10.0, 20.0]", "[5.0, 20.0, 10.0]", &["10 after 20", "ascending"]);
    with("[5.0, 10.0, 20.0]", "[5.0, 30.0]", &["interval", "steps of 30"]);
    with("duration = 200.0", "duration = 250.0", &["duration", "steps of 100"]);
    with("steps = [5.0, 2.5]", "steps = [-1.0]", &["integrators.steps", "-1"]);
    with("[0.2, 0.6, 0.0, 0.0]", "[0.2, 0.6]", &["initial", "4 finite numbers"]);
    with("points = 50", "points = 0", &["points"]);
    with("rounds = 3", "rounds = 0", &["rounds"]);
    with("steps = [5.0, 2.5]", "steps = [1e-300]", &["integrators.steps", "e-300"]);
    let of_file = "network = { kind = \"file\" } }";
    let trained = "network = { kind = \"gyroceptron\", psi = { count = 1, width = 4 }, near_identity = { count = 2, width = 4 } }, weights = { kind = \"normal\", scale = 0.15 } }";
    with(
        trained,
        &format!("{}, weights = {{ kind = \"glorot\" }} }}", &of_file[..of_file.len() - 2]),
        &["models", "one flow time"],
    );
    with("invariant_steps = 20000", "invariant_steps = 0", &["invariant_steps"]);
    with(
        "invariant_steps = 20000",
        "invariant_steps = 150",
        &["invariant_steps", "multiple of 100"],
    );
}

const FAMILY: &str = r#"
name = "kin"
seed = 4
flow_time = 10.0
plots = ["family"]
models = [
    { name = "normal-form", network = { kind = "normal-form", kicks = { count = 4, width = 4 }, twists = { count = 6, width = 4 } }, weights = { kind = "normal", scale = 0.15 } },
    { name = "henon-net", network = { kind = "henon-net", layers = { count = 2, width = 4 } }, weights = { kind = "normal", scale = 0.15 } },
]

[system]
kind = "oscillators"
epsilon = 0.02

[data]
validation = 0.5
epsilons = [0.02, 0.01]
flow_times = [5.0, 10.0]
windows = [{ low = [-1.0, -1.0, -1.0, -1.0], high = [1.0, 1.0, 1.0, 1.0], samples = 600 }]

[training]
iterations = 60
optimiser = { kind = "levenberg-marquardt" }

[family]
epsilons = [0.02, 0.015, 0.01]
flow_times = [5.0, 7.5]
slow_time = 2.0
states = 200
initial = [[0.7, 0.3, 0.0, 0.2], [0.5, 0.6, 0.0, 0.0]]
"#;

#[test]
fn a_family_is_judged_where_it_was_seen_and_where_not() {
    let folder = temporary();
    let scene = parse("kin", FAMILY).expect("a scene");
    let report = run_in(folder.path(), &scene);
    let data = render::json(&report);
    let number = |value: &Value| value.as_f64().expect("a number");
    let family = &data["studies"]["family"];
    let maps = family["maps"].as_array().expect("maps");
    assert_eq!(maps.len(), 6);
    for map in maps {
        let (epsilon, time) = (number(&map["epsilon"]), number(&map["flow_time"]));
        let seen = (epsilon == 0.02 || epsilon == 0.01) && time == 5.0;
        assert_eq!(map["seen"], seen, "{map}");
        let errors = map["errors"].as_array().expect("errors");
        // Those that were not seen lie between those that were.
        assert!(number(&errors[0]) < 0.02 * number(&map["rotation_error"]), "{map}");
        // A HénonNet is one map for all.
        assert!(number(&errors[1]) > 10.0 * number(&errors[0]), "{map}");
        // Of a phase of half a turn at most.
        let frequency = number(&map["frequency_errors"][0]);
        assert!(frequency < 0.1 * std::f64::consts::PI / (2.0 / epsilon), "{map}");
    }
    // The pairs are what the model says it was trained on.
    let pairs = &data["studies"]["pairs"];
    assert_eq!((&pairs["training"], &pairs["held_out"]), (&600.into(), &300.into()));
    let invariants = family["invariants"].as_array().expect("invariants");
    assert_eq!(invariants.len(), 3);
    for at in invariants {
        let (leading, averaged) = (number(&at["leading"]), number(&at["averaged"]));
        assert!(averaged < 0.2 * leading, "{at}");
        assert!(number(&at["learnt"][0]) < leading, "{at}");
        assert!(at["learnt"][1].is_null(), "{at}");
    }
    let orders = |of: &str| {
        let of = |k: usize| number(&invariants[k][of]);
        (of(0) / of(2)).log2()
    };
    assert!((orders("leading") - 1.0).abs() < 0.3 && (orders("averaged") - 2.0).abs() < 0.5);
    let text = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
    for words in ["Orders in ε of the changes along the reference: μ₀ ", "| 1.5e-2 | 7.5 | no |"]
    {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert!(folder.path().join("family.svg").exists());
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
        for state in orbits.trajectories.of(m) {
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
    let leaves = |m: usize| all.of(m).any(|state| strong.check_point(state).is_err());
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
    let trained = format!("{}[[models]]{models}", set_up.replace("plots = [\"section\"]", ""));
    assert!(parse("orbits", &trained).and_then(|scene| scene.complete()).is_ok());
    let quarter =
        trained.replace("flow_time = 6.283185307179586", "flow_time = 1.5707963267948966");
    refused(&quarter, &["data.orbit", "a multiple of the period"]);
    let independent = quarter.replace("orbit = 5", "");
    assert!(parse("orbits", &independent).and_then(|scene| scene.complete()).is_ok());
}

fn extensive() -> bool {
    std::env::var("GYROCEPTRON_EXTENSIVE").is_ok_and(|value| value == "1")
}

/// A part of a built-in scene.
fn part(scene: &str, name: &str) -> Scene {
    let scene = find(scene).expect("built in").scene().expect("a scene");
    scene.parts.into_iter().find(|part| part.name == name).expect("a part")
}

/// Three minutes in a release build: `GYROCEPTRON_EXTENSIVE=1 cargo test --release --test studies
/// learnt_invariants -- --nocapture` prints the numbers.
#[test]
fn learnt_invariants_are_of_second_order() {
    if !extensive() {
        return;
    }
    let folder = temporary();
    let report = run_in(folder.path(), &part("family", "invariant"));
    let data = render::json(&report);
    let changes: Vec<[f64; 3]> = data["studies"]["family"]["invariants"]
        .as_array()
        .expect("values of ε")
        .iter()
        .map(|at| {
            [&at["epsilon"], &at["leading"], &at["learnt"][0]].map(|v| v.as_f64().expect("number"))
        })
        .collect();
    for [epsilon, leading, learnt] in &changes {
        println!("ε = {epsilon}: μ₀ changes by {leading:.2e}, the learnt μ by {learnt:.2e}");
    }
    let [.., [least, _, at_least]] = changes[..] else { panic!("several") };
    let [[largest, _, at_largest], ..] = changes[..] else { panic!("several") };
    assert!(largest > 7.0 * least, "{largest} {least}");
    let order = (at_largest / at_least).ln() / (largest / least).ln();
    println!("order {order:.2}");
    assert!(order >= 2.0, "{order}");
    let [_, leading, learnt] =
        *changes.iter().find(|[epsilon, ..]| *epsilon == 0.01).expect("ε = 0.01");
    assert!(leading >= 50.0 * learnt, "{leading} {learnt}");
}

/// Seven minutes in a release build: `GYROCEPTRON_EXTENSIVE=1 cargo test --release --test studies
/// long_flow_times -- --nocapture` prints the errors.
#[test]
fn long_flow_times_are_learnt() {
    if !extensive() {
        return;
    }
    for (name, time, limit) in [
        ("oscillators", 50.0, 6e-9),
        ("oscillators-1e-2", 200.0, 4.5e-7),
        ("oscillators-1e-3", 2000.0, 1.5e-6),
        ("oscillators-1e-4", 20_000.0, 1e-6),
    ] {
        let mut scene = part("long-steps", name);
        scene.setup.models.retain(|model| model.name == "normal-form");
        scene.setup.models[0].seeds = None;
        scene.plots = Vec::new();
        scene.studies.clear();
        scene.setup.flow_time = Some(time);
        let folder = temporary();
        let report = run_in(folder.path(), &scene);
        let training = &render::json(&report)["studies"]["training"];
        let error = training["models"][0]["best"]["validation"].as_f64().expect("a number");
        println!("{name}, time {time}: held-out mean squared error {error:.2e}");
        assert!(error <= limit, "{error:e}");
    }
}

#[test]
fn families_that_do_not_fit_are_refused() {
    let with = |from: &str, to: &str, words: &[&str]| {
        assert!(FAMILY.contains(from), "{from}");
        refused(&FAMILY.replace(from, to), words);
    };
    with("epsilons = [0.02, 0.01]", "epsilons = [nan]", &["data.epsilons", "NaN"]);
    with("flow_times = [5.0, 10.0]", "flow_times = [0.0]", &["data.flow_times", "0"]);
    with("validation = 0.5", "validation = 0.0", &["data.validation", "held-out point"]);
    with("samples = 600", "samples = 3", &["samples", "4 maps"]);
    with("epsilons = [0.02, 0.015, 0.01]", "epsilons = []", &["family", "epsilons"]);
    with("flow_times = [5.0, 7.5]", "flow_times = [-1.0]", &["flow_times", "-1"]);
    with("slow_time = 2.0", "slow_time = 0.0", &["slow_time"]);
    with("slow_time = 2.0", "slow_time = 1e9", &["slow_time", "steps"]);
    with(
        "twists = { count = 6, width = 4 }",
        "twists = { count = 6, width = 4 }, action = [[0, 1]]",
        &["action", "together"],
    );
    with("validation = 0.5", "validation = 0.005", &["data.validation", "4 maps"]);
    with("states = 200", "states = 1", &["states"]);
    with("epsilons = [0.02, 0.01]", "relative = true\nepsilons = [0.0, 0.01]", &["relative"]);
    with("[0.5, 0.6, 0.0, 0.0]", "[0.5]", &["initial"]);
    // B vanishes somewhere at ε = ½, also of a member.
    let gyrating = FAMILY.replace("\"oscillators\"", "\"full-orbit\"");
    refused(&gyrating.replace("epsilon = 0.02", "epsilon = -0.5"), &["system.epsilon", "-0.5"]);
    let member = gyrating.replace("epsilons = [0.02, 0.01]", "epsilons = [0.02, 0.6]");
    refused(&member, &["data.epsilons", "0.6"]);
    let member = gyrating.replace("epsilons = [0.02, 0.015, 0.01]", "epsilons = [0.5]");
    refused(&member, &["epsilons", "0.5"]);
    // Each surface has a frequency of its own: there is no average over one.
    let lines = FAMILY
        .replace("\"oscillators\"", "\"field-lines\"")
        .replace(
            "low = [-1.0, -1.0, -1.0, -1.0], high = [1.0, 1.0, 1.0, 1.0]",
            "low = [0.1, 0.1], high = [0.3, 0.3]",
        )
        .replace("slow_time = 2.0", "slow_time = 6.283185307179586")
        .replace("states = 200", "states = 2")
        .replace("epsilons = [0.02, 0.015, 0.01]", "epsilons = [0.01]");
    refused(&lines, &["field-lines", "one frequency"]);
}

const SURFACES: &str = r#"
name = "lines"
seed = 1
flow_time = 6.283185307179586
plots = ["section"]

[system]
kind = "field-lines"
epsilon = 4e-3

[data]
validation = 0.25
windows = [{ low = [-1.04, -1.16], high = [1.04, 0.82], samples = 200 }]

[training]
iterations = 3

[surfaces]
radii = [0.2, 0.48]
theta = 0.0
steps = 200
early = 5
last = 100
island = 50
rounds = 1

[[surfaces.integrators]]
integrator = { kind = "runge-kutta-4" }
steps = [8]

[[surfaces.integrators]]
integrator = { kind = "gauss-legendre", stages = 1 }
steps = [10, 20]

[[surfaces.integrators]]
integrator = { kind = "gauss-legendre", stages = 6 }
steps = [10, 1]

[[models]]
name = "integrable"
network = { kind = "normal-form", kicks = { count = 2, width = 2 }, twists = { count = 1, width = 2 }, perturbation = { count = 0, width = 2 } }
weights = { kind = "normal", scale = 0.1 }
"#;

/// An integrator of small errors lies on the surfaces and has the island of the reference, others
/// are off by what they are; a map that is integrable has none.
#[test]
fn surfaces_tell_methods_apart() {
    let folder = temporary();
    let scene = parse("lines", SURFACES).expect("a scene");
    assert!(scene.citations().iter().any(|entry| entry.contains("RathEtAl2021")));
    let report = run_in(folder.path(), &scene);
    let data = render::json(&report);
    let found = &data["studies"]["surfaces"];
    let number = |value: &Value| value.as_f64().expect("a number");
    let ends = |value: &Value| [number(&value[0]), number(&value[1])];
    let island = ends(&found["island"]);
    // A pendulum in the action r²/2: 4√(εf/|dω/dJ|) wide, to first order.
    let (iota, square): (f64, f64) = (2.0 / 5_f64.sqrt(), 1.0 - 5_f64.sqrt() / 3.0);
    let f = iota * (square / 2.0 - square * square / 4.0);
    let action = (island[1].powi(2) - island[0].powi(2)) / 2.0;
    let expected = 4.0 * (4e-3 * f / (2.0 * iota)).sqrt();
    assert!((action / expected - 1.0).abs() < 0.2, "{action} for {expected}");
    let of = |name: &str, steps: Option<u64>| {
        let methods = found["methods"].as_array().expect("methods");
        let fits = |m: &&Value| m["name"] == name && m["steps"].as_u64() == steps;
        let method = methods.iter().find(fits).expect(name).clone();
        // The innermost line, far from resonances.
        let largest = number(&method["surfaces"][0][1]);
        (method, largest)
    };
    // All lines together err by the mean square of what each does.
    let methods = found["methods"].as_array().expect("methods").iter();
    for method in methods.filter(|method| !method["early"].is_null()) {
        let lines = method["early_of_lines"].as_array().expect("lines");
        let squares: f64 = lines.iter().map(|early| number(early).powi(2)).sum();
        let all = number(&method["early"]);
        assert!(lines.len() == 2 && (squares / 2.0 / (all * all) - 1.0).abs() < 1e-9, "{method}");
    }
    let (exact, on) = of("Gauss–Legendre, 6 stages", Some(10));
    assert!(on < 1e-9 && number(&exact["early"]) < 1e-10, "{exact}");
    assert_eq!(ends(&exact["island"]), island);
    let (coarse, off) = of("Gauss–Legendre, 1 stage", Some(10));
    let (fine, less) = of("Gauss–Legendre, 1 stage", Some(20));
    // Second order; on the surfaces the points of the reference are not dense.
    let ratio = number(&coarse["early"]) / number(&fine["early"]);
    assert!((ratio - 4.0).abs() < 0.8 && off > 1e-3 && less > 1e-4, "{coarse} {fine}");
    let [low, high] = ends(&fine["island"]);
    let width = (high - low) / (island[1] - island[0]);
    assert!((width - 1.0).abs() < 0.1 && low != island[0], "{width}");
    let (lost, far) = of("RK4", Some(8));
    assert!(far > 10.0 * less, "{lost}");
    // Steps that it has no solution for are no reason to lose all others.
    let unsolved = |m: &&Value| m["name"] == exact["name"] && m["steps"] == 1;
    let methods = found["methods"].as_array().expect("methods");
    let unsolved = methods.iter().find(unsolved).expect("a row");
    assert!(unsolved["early"].is_null() && unsolved["island"].is_null(), "{unsolved}");
    let (integrable, _) = of("integrable", None);
    assert!(integrable["island"].is_null() && number(&integrable["early"]) > 1e-2);
    let svg = std::fs::read_to_string(folder.path().join("section.svg")).expect("drawn");
    assert!(svg.contains("reference") && svg.contains("integrable"));

    refused(&SURFACES.replace("0.48]", "1.48]"), &["radii[1]"]);
    refused(&SURFACES.replace("runge-kutta-4", "strang"), &["no parts with exact flows"]);
    refused(&SURFACES.replace("last = 100", "last = 1000"), &["last"]);
    refused(&SURFACES.replace("steps = [8]", "steps = [0]"), &["steps"]);
    let half = SURFACES.replace("flow_time = 6.283185307179586", "flow_time = 1.5");
    refused(&half, &["flow_time", "a multiple of the period"]);
    refused(&SURFACES.replace("island = 50", "island = 8"), &["island"]);
    refused(&SURFACES.replace("radii = [0.2, 0.48]", "radii = [0.2, -0.48]"), &["radii[1]"]);
    // Where a flow time is repeated, and where something is split, in other studies too.
    let without = SURFACES.split("[surfaces]").next().expect("a set-up").to_owned()
        + "[[models]]"
        + SURFACES.split("[[models]]").nth(1).expect("a model");
    let without = without.replace("plots = [\"section\"]", "");
    let rolled = format!("{without}\n[rollout]\nsteps = 2\nevery = 2\ninitial = [[0.1, 0.3]]\n");
    assert!(parse("rolled", &rolled).is_ok());
    let quarter = rolled.replace("flow_time = 6.283185307179586", "flow_time = 1.5707963267948966");
    refused(&quarter, &["flow_time", "a multiple of the period"]);
    let split = "[data]\nflow = { integrator = { kind = \"strang\" }, step = 0.1 }";
    refused(&rolled.replace("[data]", split), &["data.flow", "no parts with exact flows"]);
    let ramp = "iterations = 3\nramp = [{ flow_time = 3.0, iterations = 2, repeats = 2 }]";
    let perturbed = rolled
        .replace("count = 0, width = 2", "count = 1, width = 2")
        .replace("twists = { count = 1", "twists = { count = 2")
        .replace("iterations = 3", ramp);
    refused(&perturbed, &["training.ramp.repeats", "powers of a perturbed map"]);
    let far = "epsilon = 4e-3\ntoroidal = -1000";
    refused(&SURFACES.replace("epsilon = 4e-3", far), &["system.toroidal"]);
    let far = "epsilon = 4e-3\npoloidal = 1000";
    refused(&SURFACES.replace("epsilon = 4e-3", far), &["system.poloidal"]);
    // What asks for states within a period, or between whole flow times, has no such flow.
    let of_lines = |study: &str| without.clone() + study;
    let trajectories = "\n[trajectories]\nepsilons = [1e-3]\nsteps = 3\ninitial = [[0.1, 0.3]]\n";
    assert!(parse("lines", &of_lines(trajectories)).is_ok());
    let quarter = of_lines(trajectories)
        .replace("flow_time = 6.283185307179586", "flow_time = 1.5707963267948966");
    refused(&quarter, &["trajectories", "flow_time", "a multiple of the period"]);
    let dissipation = "\n[dissipation]\npoints = 3\nsteps = 4\nevery = 1\ninitial = [[0.1, 0.3]]\n";
    refused(&of_lines(dissipation), &["dissipation", "field-lines", "at all times"]);
    let family = "\n[family]\nepsilons = [1e-3]\nflow_times = [6.283185307179586]\n\
                  slow_time = 1.0\nstates = 100\ninitial = [[0.1, 0.3]]\n";
    refused(&of_lines(family), &["family", "slow_time", "a multiple of the period"]);
}

/// An island in which lines come round as often as the torus is gone around is found as others are, and so
/// in maps of several turns in which they come round a whole number of times.
#[test]
fn islands_of_whole_turns_are_seen() {
    let whole = "epsilon = 4e-3\niota = 1.2\npoloidal = -1\ntoroidal = 1";
    let one = SURFACES.replace("epsilon = 4e-3", whole).replace("plots = [\"section\"]", "");
    let one = one.replace("island = 50", "island = 150");
    let three = SURFACES
        .replace("flow_time = 6.283185307179586", "flow_time = 18.84955592153876")
        .replace("plots = [\"section\"]", "")
        .replace("steps = 200", "steps = 100");
    let island = |scene: &str| -> f64 {
        let scene = scene.replace("steps = [8]", "steps = [24]");
        let scene = scene.replace("steps = [10, 20]", "steps = [30]");
        let scene = scene.replace("steps = [10, 1]", "steps = [30]");
        let report = run_in(temporary().path(), &parse("lines", &scene).expect("a scene"));
        let ends = &render::json(&report)["studies"]["surfaces"]["island"];
        let [low, high] = [0, 1].map(|k| ends[k].as_f64().unwrap_or_else(|| panic!("{ends}")));
        0.5 * (high * high - low * low)
    };
    // A pendulum in the action r²/2, as above.
    let width = |iota0: f64, iota: f64| {
        let square = 1.0 - iota / iota0;
        let f = iota0 * (square / 2.0 - square * square / 4.0);
        4.0 * (4e-3 * f / (2.0 * iota0)).sqrt()
    };
    let of_three = width(2.0 / 5_f64.sqrt(), 2.0 / 3.0);
    for (scene, expected) in [(one, width(1.2, 1.0)), (three, of_three)] {
        let action = island(&scene);
        assert!((action / expected - 1.0).abs() < 0.25, "{action} for {expected}");
    }
}

const WHICH: &str = r#"
name = "which"
seed = 1
flow_time = 0.8
plots = ["which-action"]

[system]
kind = "oscillators"
epsilon = 0.01

[data]
validation = 0.25
windows = [{ low = [-1.6, -1.6, -1.6, -1.6], high = [1.6, 1.6, 1.6, 1.6], samples = 400 }]

[which_action]
actions = [[1, 1], [1, 0], [1, -1]]
tries = 2
pairs = 200
network = { kind = "gyroceptron", psi = { count = 4, width = 4 }, near_identity = { count = 0, width = 4 } }
weights = { kind = "normal", scale = 0.15 }
training = { iterations = 20, optimiser = { kind = "levenberg-marquardt" } }
"#;

/// The network of the right action errs least, by far; what no data tell is refused.
#[test]
fn the_circle_action_is_found_by_training() {
    let folder = temporary();
    let scene = parse("which", WHICH).expect("a scene");
    let report = run_in(folder.path(), &scene);
    let found = &render::json(&report)["studies"]["which_action"];
    assert_eq!(found["right"], 1);
    for one in found["tries"].as_array().expect("tries") {
        let errors: Vec<f64> = one["errors"]
            .as_array()
            .expect("errors")
            .iter()
            .map(|error| error.as_f64().expect("a number"))
            .collect();
        assert!(errors[0] > 30.0 * errors[1] && errors[2] > 30.0 * errors[1], "{errors:?}");
        assert_eq!(one["linear"], serde_json::json!([1, 0]));
        assert_eq!(one["sure"], true);
    }
    let text = render::markdown(&report);
    assert!(text.contains("By training it is right in 2 of 2 tries and sure in 2"), "{text}");
    assert!(std::fs::read_to_string(folder.path().join("which-action.svg")).is_ok());
    // A run that was stopped in its second try goes on there.
    struct Second(bool);
    impl Observer for Second {
        fn event(&mut self, event: Event<'_>) {
            if let Event::Stage(stage) = event {
                self.0 |= stage.starts_with("try 2");
            }
        }
        fn interrupted(&self) -> bool {
            self.0
        }
    }
    let pieces = temporary();
    let opened = |resume| Folder::open(pieces.path(), resume, false).expect("a folder");
    assert!(run(&scene, &opened(false), &mut Second(false)).expect("stops").is_none());
    struct NotFirst;
    impl Observer for NotFirst {
        fn event(&mut self, event: Event<'_>) {
            assert!(!matches!(event, Event::Stage(stage) if stage.starts_with("try 1")));
        }
        fn interrupted(&self) -> bool {
            false
        }
    }
    let resumed = run(&scene, &opened(true), &mut NotFirst).expect("runs").expect("to its end");
    assert_eq!(render::json(&resumed), render::json(&report));

    // No other weights than those of an exchange of planes.
    let swapped = WHICH.replace("[1, -1]]", "[0, 1]]");
    refused(&swapped, &["actions[2]", "0,1", "exchange of planes"]);
    refused(&WHICH.replace("[1, 1], [1, 0], ", "[1, 1], "), &["actions", "1,0 among them"]);
    refused(&WHICH.replace("[1, -1]]", "[-1, 0]]"), &["actions[2]", "others than 1,0"]);
    refused(&WHICH.replace("[1, -1]]", "[2, -2]]"), &["actions[2]", "common factor"]);
    refused(&WHICH.replace("[1, -1]]", "[0, 0]]"), &["actions[2]", "common factor"]);
    refused(&WHICH.replace("[1, -1]]", "[1, -2000000000]]"), &["actions[2]", "-2000000000"]);
    refused(&WHICH.replace("psi = { count = 4,", "psi = { count = 1000000000000,"), &["layers"]);
    refused(
        &WHICH.replace("psi = { count = 4, width = 4 }", "psi = { count = 4, width = 0 }"),
        &["network"],
    );
    refused(
        &WHICH.replace("samples = 400 }]", "samples = 400 }]\nflow_times = [0.8, 1.6]"),
        &["pairs of one map"],
    );
    let torus = WHICH
        .replace("kind = \"oscillators\"", "kind = \"three-oscillators\"")
        .replace("-1.6, -1.6, -1.6, -1.6", "-1.0, -1.0, -1.0, -1.0, -1.0, -1.0")
        .replace("1.6, 1.6, 1.6, 1.6]", "1.0, 1.0, 1.0, 1.0, 1.0, 1.0]")
        .replace("[[1, 1], [1, 0], [1, -1]]", "[[1, 1, 0], [1, 2, 0]]");
    refused(&torus, &["three-oscillators", "along circles"]);
    refused(&WHICH.replace("[1, -1]]", "[1, -1, 0]]"), &["actions[2]"]);
    refused(&WHICH.replace("tries = 2", "tries = 0"), &["tries"]);
    refused(&WHICH.replace("pairs = 200", "pairs = 4"), &["pairs", "expected 5 to"]);
    let own = WHICH.replace(
        "near_identity = { count = 0, width = 4 }",
        "near_identity = { count = 0, width = 4 }, circle_action = [1, 0]",
    );
    refused(&own, &["network", "without a circle action"]);
    let starts = WHICH
        .replace("iterations = 20,", "iterations = 20, starts = { count = 2, iterations = 3 },");
    refused(&starts, &["training.starts"]);
    // What is known from the pairs only.
    let few = parse("few", &WHICH.replace("tries = 2", "tries = 3")).expect("a scene");
    let error = failed_in(temporary().path(), &few);
    assert!(error.contains("600") && error.contains("400"), "{error}");
    let alone = parse("alone", &WHICH.replace("validation = 0.25", "validation = 0.0"));
    let error = failed_in(temporary().path(), &alone.expect("a scene"));
    assert!(error.contains("data.validation"), "{error}");
}

const ACTIONS: &str = r#"
name = "actions"
seed = 1
flow_time = 5.0
plots = ["actions"]

[system]
kind = "three-oscillators"
epsilon = 0.01

[data]
validation = 0.25
windows = [{ low = [-1.0, -1.0, -1.0, -1.0, -1.0, -1.0], high = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0], samples = 600 }]

[[models]]
name = "torus"
network = { kind = "normal-form", kicks = { count = 6, width = 4 }, twists = { count = 4, width = 4 }, action = [[1, 0, 0], [0, 1, 0]] }
weights = { kind = "normal", scale = 0.1 }

[[models]]
name = "circle"
network = { kind = "gyroceptron", psi = { count = 2, width = 3 }, near_identity = { count = 2, width = 3 } }
weights = { kind = "normal", scale = 0.1 }

[training]
iterations = 40
optimiser = { kind = "levenberg-marquardt" }

[actions]
steps = 120
every = 2
initial = [[0.6, 0.4, 0.5, 0.0, 0.3, 0.0], [0.2, 0.7, 0.0, 0.3, 0.0, 0.6]]
"#;

/// A normal form of two circles starts at the frequencies of both, keeps both actions and finds some that stay
/// better than those of the limit; at a resonance these are exchanged, and the study says so.
#[test]
fn both_actions_of_a_torus_are_learnt() {
    let number = |value: &Value| value.as_f64().expect("a number");
    let golden = 0.5 * (1.0 + 5_f64.sqrt());
    let of = |frequency: f64| {
        let folder = temporary();
        let text = ACTIONS
            .replace("epsilon = 0.01", &format!("epsilon = 0.01\nfrequency = {frequency:?}"));
        let report = run_in(folder.path(), &parse("actions", &text).expect("a scene"));
        assert!(folder.path().join("actions.svg").exists());
        let found = render::json(&report)["studies"]["actions"].clone();
        let rows = found["actions"].as_array().expect("actions").clone();
        (render::markdown(&report), rows)
    };
    let (text, rows) = of(golden);
    assert!(text.contains("k = (3, -2), turns by 24 ε"), "{text}");
    let names: Vec<&str> = rows.iter().map(|row| row["of"].as_str().expect("a name")).collect();
    let limit = "the limit";
    assert_eq!(names, [limit, limit, limit, "`torus`", "`torus`", "`circle`"]);
    for (known, learnt) in rows[..2].iter().zip(&rows[3..5]) {
        assert_eq!(known["circle"], learnt["circle"]);
        let [before, after] = [known, learnt].map(|row| number(&row["reference"]));
        assert!(before > 2e-3 && after < 0.5 * before, "{before:e} {after:e}");
        assert!(known["own"].is_null() && number(&learnt["own"]) < 1e-13);
    }
    assert!(number(&rows[5]["own"]) > 1e-4);
    let (text, rows) = of(2.01);
    assert!(text.contains("k = (2, -1), is as slow as the slow motion, 1.0 ε"), "{text}");
    let [first, second, both] = [0, 1, 2].map(|k| number(&rows[k]["reference"]));
    assert!(both < 0.6 * second && second < first, "{first} {second} {both}");

    // Circles of other planes than the limit turns.
    refused(&ACTIONS.replace("[0, 1, 0]]", "[0, 0, 1]]"), &["models.torus", "action"]);
    refused(&ACTIONS.replace("every = 2", "every = 7"), &["every", "a divisor of steps"]);
    refused(&ACTIONS.replace("steps = 120", "steps = 0"), &["steps"]);
    refused(&ACTIONS.replace("0.0, 0.3, 0.0]", "0.0]"), &["initial"]);
    let unsound = ACTIONS.replace("epsilon = 0.01", "epsilon = 0.01\nfrequency = 0.0");
    refused(&unsound, &["system.frequency"]);
    // The action of one circle is that of planes that are bent: it stays to order ε.
    let bent = ACTIONS
        .replace("three-oscillators\"\nepsilon = 0.01", "particle-field\"\nepsilon = 1e-4\nprofiles = [{ kind = \"sine\", amplitude = 0.5, wavenumber = 2.0 }, { kind = \"zero\" }]")
        .replace("iterations = 40", "iterations = 1");
    let (torus, circle) = bent.split_once("[[models]]\nname = \"torus\"").expect("a network");
    let (_, circle) = circle.split_once("[[models]]").expect("another");
    let alone = parse("actions", &format!("{torus}[[models]]{circle}")).expect("a scene");
    let report = render::json(&run_in(temporary().path(), &alone));
    let limit = &report["studies"]["actions"]["actions"][0];
    assert!(number(&limit["reference"]) < 1e-2 * number(&limit["size"]), "{limit}");

    let family = "[family]\nepsilons = [0.01]\nflow_times = [5.0]\nslow_time = 1.0\nstates = 9\n";
    let averaged = ACTIONS
        .replace("plots = [\"actions\"]", "")
        .replace("[actions]\nsteps = 120\nevery = 2\n", family);
    refused(&averaged, &["three-oscillators", "along circles"]);
}

const MOMENT: &str = r#"
name = "moment"
seed = 1
flow_time = 0.8

[system]
kind = "full-orbit"
epsilon = 0.02

[data]
validation = 0.25
windows = [{ low = [-1.0, -0.8, -1.0, -1.6], high = [1.0, 2.6, 1.0, 1.6], samples = 60 }]

[[models]]
name = "normal-form"
network = { kind = "normal-form", kicks = { count = 2, width = 2 }, twists = { count = 2, width = 2 } }
weights = { kind = "normal", scale = 0.1 }

[training]
iterations = 2

[family]
epsilons = [0.04, 0.02]
flow_times = [0.8]
slow_time = 2.0
states = 200
initial = [[0.7, 0.4, 0.5, 0.6]]
"#;

/// The invariant that users of a system know stands beside the others, and is what the learnt one is
/// measured by; a system that has none has no column of it.
#[test]
fn a_family_names_the_invariant_that_users_know() {
    let folder = temporary();
    let report = run_in(folder.path(), &parse("moment", MOMENT).expect("a scene"));
    let found = render::json(&report)["studies"]["family"]["invariants"].clone();
    for at in found.as_array().expect("invariants") {
        let number = |key: &str| at[key].as_f64().expect(key);
        let system = FullOrbit::new(number("epsilon"));
        let (z, interval) = ([0.7, 0.4, 0.5, 0.6], 2.0 / system.epsilon / 199.0);
        let orbit = flow::ReferenceTrajectories::of_flow(&system, &z, interval, 200);
        let states = orbit.expect("moves").trajectories;
        let moment = |t: usize| system.magnetic_moment(states.state(t, 0));
        let largest = (0..200).map(|t| (moment(t) - moment(0)).abs()).fold(0.0, max_or_nan);
        assert!((number("customary") / largest - 1.0).abs() < 1e-6, "{at}");
        assert!(
            number("averaged") < number("customary") && number("customary") < number("leading")
        );
    }
    let text = render::markdown(&report);
    assert!(text.contains("of v²/2B") && text.contains("less than v²/2B by"), "{text}");
    let other = MOMENT
        .replace("full-orbit", "oscillators")
        .replace("-1.0, -0.8, -1.0, -1.6", "-1.0, -1.0, -1.0, -1.0")
        .replace("1.0, 2.6, 1.0, 1.6", "1.0, 1.0, 1.0, 1.0");
    let report = run_in(temporary().path(), &parse("moment", &other).expect("a scene"));
    let found = &render::json(&report)["studies"]["family"]["invariants"][0];
    assert!(found["customary"].is_null() && render::markdown(&report).contains("less than μ₀ by"));
}

const DISSIPATION: &str = r#"
name = "dissipation"
seed = 1
flow_time = 10.0
plots = ["dissipation"]

[system]
kind = "van-der-pol"
epsilon = 0.05

[data]
validation = 0.25
flow = { integrator = { kind = "aba-1064" }, step = 0.2 }
windows = [{ low = [-2.5, -1.7, -2.5, -2.3], high = [2.5, 2.7, 2.5, 2.4], samples = 1600 }]

[[models]]
name = "couplings"
network = { kind = "coupling-gyroceptron", psi = { count = 1, width = 4 }, near_identity = { count = 8, width = 6 } }
weights = { kind = "normal", scale = 0.15 }

[[models]]
name = "symplectic"
network = { kind = "gyroceptron", psi = { count = 2, width = 4 }, near_identity = { count = 4, width = 4 } }
weights = { kind = "normal", scale = 0.15 }

[training]
iterations = 60
optimiser = { kind = "levenberg-marquardt" }

[certificate]
samples = 20
radius = 1.6

[dissipation]
points = 8
steps = 400
every = 1
initial = [[1.0, 0.3, 0.0, 0.0], [0.3, 0.0, 0.2, 0.0]]
"#;

/// Couplings learn a flow that contracts volumes, and the torus that it comes to; what is symplectic cannot. What
/// studies Hamiltonian flows refuses it.
#[test]
fn a_flow_with_dissipation_is_learnt_with_its_attractor() {
    let number = |value: &Value| value.as_f64().expect("a number");
    let folder = temporary();
    let report = run_in(folder.path(), &parse("dissipation", DISSIPATION).expect("a scene"));
    assert!(folder.path().join("dissipation.svg").exists());
    let text = render::markdown(&report);
    assert!(text.contains("`symplectic` cannot follow"), "{text}");
    assert!(!text.contains("`couplings`, `symplectic`"), "{text}");
    assert!(text.contains("`couplings` holds"), "{text}");
    let found = render::json(&report)["studies"]["dissipation"].clone();
    let [couplings, symplectic] = [0, 1].map(|k| found["volumes"][k].clone());
    let of_flow = number(&couplings["of_flow"]);
    assert!(of_flow > 0.5 && number(&couplings["error"]) < 0.1 * of_flow, "{couplings}");
    assert!(number(&couplings["defect"]) > 0.1);
    assert!(number(&symplectic["own"]) < 1e-13 && number(&symplectic["defect"]) < 1e-12);
    assert!((number(&symplectic["error"]) - of_flow).abs() < 1e-9);
    let along = |k: usize, key: &str| number(&found["along"][k][key]);
    for key in ["mean", "largest", "period"] {
        let (reference, own) = (along(0, key), along(1, key));
        assert!((own - reference).abs() < 0.05 * reference, "{key}: {reference} {own}");
    }
    // That of the averaged equations, 5.91/ε.
    assert!((along(0, "period") - 5.91 / 0.05).abs() < 0.05 * 5.91 / 0.05);
    assert!(along(1, "distance") < 0.5 * along(2, "distance"), "{found}");

    // A Hamiltonian flow, nothing held out, a single state behind the first, from one point.
    let kept = DISSIPATION
        .replace("kind = \"van-der-pol\"", "kind = \"oscillators\"")
        .replace("iterations = 60", "iterations = 2")
        .replace("validation = 0.25", "validation = 0.0")
        .replace("steps = 400\nevery = 1", "steps = 5\nevery = 5")
        .replace("[[1.0, 0.3, 0.0, 0.0], [0.3, 0.0, 0.2, 0.0]]", "[[1.0, 0.3, 0.0, 0.0]]");
    let folder = temporary();
    let report = run_in(folder.path(), &parse("kept", &kept).expect("a scene"));
    let text = render::markdown(&report);
    assert!(text.contains("The flow is Hamiltonian: volumes are kept"), "{text}");
    let found = render::json(&report)["studies"]["dissipation"].clone();
    assert!(number(&found["volumes"][0]["of_flow"]).abs() < 1e-12);
    assert!(found["along"][0]["period"].is_null());

    refused(&DISSIPATION.replace("every = 1", "every = 7"), &["every", "a divisor of steps"]);
    refused(&DISSIPATION.replace("points = 8", "points = 0"), &["points"]);
    refused(&DISSIPATION.replace("0.2, 0.0]]", "0.2]]"), &["initial"]);
    refused(&DISSIPATION.replace("count = 8", "count = 0"), &["models.couplings", "layers"]);
    refused(&DISSIPATION.replace("width = 6", "width = 0"), &["couplings", "width 0"]);
    let unsound = DISSIPATION.replace("epsilon = 0.05", "epsilon = 0.05\ndamping = -0.1");
    refused(&unsound, &["system.damping", "-0.1"]);
    let of_invariants = [
        "[actions]\nsteps = 400\nevery = 1\ninitial",
        "[rollout]\nsteps = 400\nevery = 1\ninitial",
        "[trajectories]\nepsilons = [0.05]\nsteps = 400\ninitial",
        "[family]\nepsilons = [0.05]\nflow_times = [10.0]\nslow_time = 1.0\nstates = 9\ninitial",
    ];
    for study in of_invariants {
        let other = DISSIPATION
            .replace("plots = [\"dissipation\"]", "")
            .replace("[dissipation]\npoints = 8\nsteps = 400\nevery = 1\ninitial", study);
        refused(&other, &["van-der-pol", "without dissipation"]);
    }
}
