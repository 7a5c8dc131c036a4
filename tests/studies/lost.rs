//! Networks whose training leaves the finite numbers at the beginning of a stage.

use crate::helpers::{failed_in, run_in, temporary};
use gyroceptron::scene::{Report, Scene, parse};
use serde_json::Value;

/// Polynomials of degree 10 in four shears, one after the other, taken from time 1 to time 100: the numbers of some weights overflow.
const LOST: &str = r#"
name = "lost"
seed = 17
flow_time = 100.0
plots = ["loss"]

[system]
kind = "oscillators"
epsilon = 0.05

[data]
validation = 0.3
windows = [{ low = [-1.0, -1.0, -1.0, -1.0], high = [1.0, 1.0, 1.0, 1.0], samples = 30 }]

[[models]]
name = "good"
network = { kind = "normal-form", kicks = { count = 3, width = 4 }, twists = { count = 4, width = 4 } }
weights = { kind = "normal", scale = 0.15 }

[[models]]
name = "some"
seeds = 2
network = { kind = "normal-form", kicks = { count = 2, width = 2 }, turned_twists = { count = 4, width = 2, degree = 10 } }
weights = { kind = "normal", scale = 0.15 }

[training]
iterations = 30
optimiser = { kind = "levenberg-marquardt" }
ramp = [{ flow_time = 1.0, iterations = 20 }]

[rollout]
steps = 1
every = 1
initial = [[0.7, 0.1, 0.0, 0.2]]
"#;

pub fn scene(seed: u64) -> Scene {
    let scene = LOST.replace("seed = 17", &format!("seed = {seed}"));
    parse("lost", &scene).expect("a scene")
}

fn trainings(report: &Report) -> Vec<Value> {
    let data = &report.study("training").expect("a study").results.data;
    data["models"].as_array().expect("trainings").clone()
}

fn names(of: &Value) -> Vec<String> {
    let of = of.as_array().expect("a list").iter();
    of.map(|one| one["name"].as_str().expect("a name").to_owned()).collect()
}

#[test]
fn weights_that_are_lost_do_not_end_a_scene() {
    let folder = temporary();
    let report = run_in(folder.path(), &scene(17));
    let found = trainings(&report);
    let lost: Vec<Option<&str>> = found.iter().map(|one| one["lost"].as_str()).collect();
    let [None, None, Some(reason)] = lost[..] else { panic!("{lost:?}") };
    assert!(reason.contains("loss") && reason.contains("initial parameters"), "{reason}");
    assert_eq!(found[2]["stop"], "diverged");
    assert!(found[2]["best"]["validation"].is_null() && found[2]["loss"].is_null());
    let rollout = &report.study("rollout").expect("a study").results.data;
    assert_eq!(names(&rollout["models"]), ["good", "some"]);
    let seeds = rollout["seeds"].as_array().expect("networks");
    assert_eq!(seeds.len(), 1, "{seeds:?}");
    let errors = seeds[0]["rms_errors"].as_array().expect("errors");
    assert!(errors[0].as_f64().is_some_and(|error| error > 0.0) && errors[1].is_null());
    let text = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
    assert!(text.contains(&format!("- `some-seed-2` is lost: {reason}.")), "{text}");
    let row = text.lines().find(|line| line.starts_with("| `some` | 2 |")).expect("a row");
    let cells: Vec<&str> = row.split('|').map(str::trim).collect();
    // The median of two is that of none where one is lost.
    assert_eq!((cells[3], cells[5], cells[7]), ("–", "–", "–"), "{row}");
    assert!(cells[4].parse::<f64>().is_ok_and(|best| best > 0.0), "{row}");
    let mut words = text.split_whitespace();
    assert!(!words.any(|word| ["inf", "-inf", "NaN"].contains(&word)), "{text}");
    assert!(folder.path().join("model-some.json").exists());
    assert!(!folder.path().join("model-some-seed-2.json").exists());
}

#[test]
fn a_network_that_is_lost_is_in_no_other_study() {
    let folder = temporary();
    let report = run_in(folder.path(), &scene(2));
    let found = trainings(&report);
    assert_eq!(found.iter().filter(|one| one["lost"].is_string()).count(), 2, "{found:?}");
    let rollout = &report.study("rollout").expect("a study").results.data;
    assert_eq!(names(&rollout["models"]), ["good"]);
    let text = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
    assert!(text.contains("| training | lost: loss: the numbers ran out of range"), "{text}");
}

#[test]
fn a_scene_whose_networks_are_all_lost_fails() {
    let mut scene = scene(2);
    scene.setup.models.remove(0);
    let error = failed_in(temporary().path(), &scene);
    for word in ["every network", "some", "out of range"] {
        assert!(error.contains(word), "`{error}` does not name `{word}`");
    }
}
