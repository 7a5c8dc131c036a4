//! The slow manifold.

use crate::helpers::{refused, run_in, temporary};
use gyroceptron::io::load_model;
use gyroceptron::scene::{Folder, parse};
use gyroceptron::system::{NearlyPeriodic, ParticleField};
use serde_json::Value;

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
    // All maps from all their weights, and the points that each has in place of those of the system.
    let beside = data["beside_reference"].as_array().expect("maps");
    let names: Vec<_> = beside.iter().map(|of| &of["name"]).collect();
    assert_eq!(names, ["gyroceptron", "gyroceptron-seed-2", "gyroceptron-seed-3"]);
    for of in beside {
        let [system, learnt, moved, own] =
            ["from_system", "from_learnt", "moved", "own"].map(|key| number(&of[key]));
        assert!(system > 0.0 && learnt > 0.0 && moved > 1e-6, "{of}");
        // The learnt invariant begins at 0 there.
        assert!(own < 0.05, "{of}");
        assert!(number(&of["off"]) > 0.0 && number(&of["from_manifold"]) > 0.0, "{of}");
    }
    // Off it, of the first weights, it is that of the orbits in the table.
    let first = &data["off"][0];
    let [difference, initial] =
        [&first["differences"][0], &first["system"][0]["initial"]].map(number);
    let off = number(&beside[0]["off"]);
    assert!((off - difference / initial.abs()).abs() < 1e-12 * off, "{off}");
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
    for words in [
        "From several initial weights",
        "| `gyroceptron` | 3 |",
        "from the learnt level set",
        "3 sets of initial weights: from μ₀ = 0",
        "Adam",
        "Levenberg",
    ] {
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
