//! The verdicts on what the paper claims.

use gyroceptron::scene::findings::{Findings, Section};
use gyroceptron::scene::internals::{self as claims, REPRODUCED, as_good, change, command};
use gyroceptron::scene::{Machine, Report, StudyFindings, find};
use serde_json::{Value, json};

/// A part of this name whose study found this.
fn part(name: &'static str, study: &'static str, data: Value) -> Report {
    let scene = find(name).and_then(|entry| entry.scene()).expect("built in");
    let findings =
        Findings { results: Section { data, ..Section::default() }, ..Findings::default() };
    let studies = vec![StudyFindings { name: study, findings }];
    Report {
        scene,
        studies,
        training_times: Vec::new(),
        stages: Vec::new(),
        machine: Machine::this(),
        repeat: None,
        parts: Vec::new(),
    }
}

fn verdict(part: &Report) -> String {
    claims::verdict(part).expect("a row")
}

#[test]
fn verdicts_come_out_negative_too() {
    let profiles = |drifts: [f64; 3]| {
        let each = [1e-1, 1e-2, 1e-3].iter().zip(drifts);
        let data = each.map(|(e, d)| json!({ "epsilon": e, "drift": { "largest": d } }));
        verdict(&part("adiabatic-profiles", "adiabatic_profiles", data.collect()))
    };
    assert!(profiles([1e-2, 1e-3, 1e-4]).starts_with(REPRODUCED));
    assert!(profiles([0.1, 0.1, 0.1]).starts_with("not"));
    assert!(profiles([1e-2, 9e-3, 8e-3]).starts_with("not"));
    assert!(profiles([1e-2, f64::NAN, 1e-4]).starts_with("not"));

    let trajectories = |still: f64, far: f64| {
        let of = |excursion: f64| json!({ "epsilon": 0.1, "excursions": [[1.0, excursion]], "adiabatic": [{ "largest": 0.2 }] });
        verdict(&part("trajectories", "trajectories", json!([of(still), of(far)])))
    };
    assert!(trajectories(0.0, 1.0).starts_with(REPRODUCED));
    assert!(trajectories(1e-9, 1.0).starts_with("not"));
    assert!(trajectories(0.0, f64::NAN).starts_with("not"));

    let horizon = |large: Value, small: Value| {
        let orbit = |epsilon: f64, n: Value| json!({ "epsilon": epsilon, "iterations": 1000, "horizons": [n] });
        let orbits = [orbit(0.1, large), orbit(1e-3, small)];
        let data = json!({ "factors": [1.1], "orbits": orbits });
        verdict(&part("adiabatic-horizon", "adiabatic_horizon", data))
    };
    assert!(horizon(json!(20), json!(null)).starts_with(REPRODUCED));
    assert!(horizon(json!(20), json!(30)).starts_with("not"));
    assert!(horizon(json!(null), json!(20)).starts_with("not"));

    assert!(as_good(0.02, 0.01).starts_with(REPRODUCED));
    assert!(as_good(0.04, 0.01).starts_with("not"));
    assert!(as_good(f64::NAN, 0.01).starts_with("not"));
    // Without orbits nothing is known.
    assert!(change(&Value::Null).is_nan());
}

#[test]
fn the_command_is_the_one_that_was_run() {
    let scene = find("oscillators-short").and_then(|entry| entry.scene()).expect("built in");
    assert_eq!(command(&scene), "`gyroceptron run oscillators-short`");
    let seeded = scene.clone().with_seed(7);
    assert_eq!(command(&seeded), "`gyroceptron run oscillators-short --seed 7`");
    let quick = scene.clone().quick();
    assert_eq!(command(&quick), "`gyroceptron run oscillators-short --quick`");
    let mut changed = scene;
    changed.setup.training.iterations += 1;
    assert!(command(&changed).contains("as-run.toml"));
}
