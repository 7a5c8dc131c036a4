//! The verdicts on what the paper claims.

use gyroceptron::scene::findings::{Findings, Section};
use gyroceptron::scene::internals::{
    self as claims, REPRODUCED, as_a_series, change, command, ranked,
};
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

    // A formal series, or a size at one ε: orders with their standard errors.
    assert!(as_a_series([(1.01, 0.02), (1.96, 0.05)]).starts_with(REPRODUCED));
    assert!(as_a_series([(0.97, 0.01), (1.05, 0.02)]).starts_with("not"));
    assert!(as_a_series([(0.2, 0.1), (2.0, 0.1)]).starts_with("not"));
    assert!(as_a_series([(1.0, 0.01), (f64::NAN, 0.01)]).starts_with("not"));
    assert!(as_a_series([(1.0, 0.01), (0.5, 5.0)]).starts_with("not"));
    // Ranges that overlap tell nothing, whatever the medians are.
    let small = [1e-7, 2e-7, 3e-7, 1.5e-7, 2.5e-7];
    let overlapping = [1.2e-7, 4e-7, 5e-7, 6e-7, 7e-7];
    let large = [4e-7, 5e-7, 6e-7, 7e-7, 8e-7];
    assert!(ranked(&small, &large).starts_with(REPRODUCED), "{}", ranked(&small, &large));
    assert!(ranked(&small, &large).contains("p = 0.01"), "{}", ranked(&small, &large));
    assert!(ranked(&large, &small).starts_with("not: the other way round"));
    assert!(ranked(&small, &overlapping).starts_with("not told: ranges overlap"));
    assert!(ranked(&small, &[]).starts_with("not told"));
    assert!(ranked(&small, &[1e-6, f64::NAN]).starts_with("not told"));
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
