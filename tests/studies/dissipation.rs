//! Flows that dissipate.

use crate::helpers::{refused, run_in, temporary};
use gyroceptron::measure::trajectories::{mean_period, simpson};
use gyroceptron::scene::{parse, render};
use serde_json::Value;

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

#[test]
fn a_period_is_that_between_rises() {
    let wave = |k: usize| 2.0 + (0.37 * k as f64 + 0.4).sin();
    let values: Vec<f64> = (0..400).map(wave).collect();
    let found = mean_period(&values, 0.5).expect("it swings");
    assert!((found - 0.5 * std::f64::consts::TAU / 0.37).abs() < 1e-2, "{found}");
    assert_eq!(mean_period(&[2.0, 2.01, 1.99, 2.01, 1.99, 2.01], 1.0), None);
    assert_eq!(mean_period(&[1.0, 2.0, 3.0], 1.0), None);
    assert_eq!(mean_period(&[1.0, f64::NAN, 3.0, 0.0, 5.0], 1.0), None);
}

#[test]
fn simpsons_rule_is_exact_for_cubes() {
    let values: Vec<f64> = (0..9).map(|k| f64::from(k * k * k) / 512.0).collect();
    assert!((simpson(&values, 0.125) - 0.25).abs() < 1e-15);
}
