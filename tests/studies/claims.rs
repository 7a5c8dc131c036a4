//! The verdicts on what the paper claims.

use gyroceptron::measure::timing::{Spread, WorkPrecision};
use gyroceptron::scene::findings::{Findings, Section};
use gyroceptron::scene::internals::{
    self as claims, REPRODUCED, as_a_series, change, command, faster_than_integrators, ranked,
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
    // Points that stray tell no order.
    assert!(as_a_series([(1.0, 0.01), (2.0, 0.25)]).starts_with("not"));
    assert!(as_a_series([(1.0, f64::NAN), (2.0, 0.1)]).starts_with("not"));
    // Ranges that overlap tell nothing, whatever the medians are.
    let small = [1e-7, 2e-7, 3e-7, 1.5e-7, 2.5e-7];
    let overlapping = [1.2e-7, 4e-7, 5e-7, 6e-7, 7e-7];
    let large = [4e-7, 5e-7, 6e-7, 7e-7, 8e-7];
    assert!(ranked(&small, &large).starts_with(REPRODUCED), "{}", ranked(&small, &large));
    assert!(ranked(&small, &large).contains("p = 0.01"), "{}", ranked(&small, &large));
    assert!(ranked(&large, &small).starts_with("not: the other way round"));
    assert!(ranked(&small, &overlapping).starts_with("undecided: ranges overlap"));
    assert!(ranked(&small, &[]).starts_with("undecided"));
    // One set of weights has no range, two are too few.
    assert!(ranked(&small[..1], &large[..1]).starts_with("undecided (one set"));
    assert!(ranked(&small[..2], &large[..2]).starts_with("undecided: too few"));
    assert!(ranked(&small, &[1e-6, f64::NAN]).starts_with("undecided"));
    // Without orbits nothing is known.
    assert!(change(&Value::Null).is_nan());
}

/// The paper's order of run times, and whether networks are faster than integrators: of the times that are given.
#[test]
fn run_times_have_a_verdict_of_their_own() {
    let method = |name: &str, setting: Option<f64>, error: f64, seconds: f64| {
        let seconds = Some(Spread { lower: seconds, median: seconds, upper: seconds });
        let (name, error) = (name.to_owned(), Some(error));
        WorkPrecision { name, setting, error, seconds, alone: None, failure: None }
    };
    let beside = |rk4: f64, henon: f64, symp: f64, strang: f64| {
        faster_than_integrators(&[
            method("gyroceptron", None, 1e-2, 1.0),
            method("henon-net", None, 1e-2, henon),
            method("symp-net", None, 1e-2, symp),
            method("RK4", Some(16.0), 1e-3, rk4),
            method("Strang", Some(2.0), 5e-3, strang),
        ])
        .expect("all are there")
    };
    let of = |henon: f64, symp: f64, strang: f64| beside(40.0, henon, symp, strang);
    let found = of(0.5, 2.0, 0.1);
    assert!(
        found.contains(&format!("SympNet: {REPRODUCED};")) && found.contains("4.0 ×"),
        "{found}"
    );
    assert!(found.contains("third of that: not") && found.contains("40.0 ×"), "{found}");
    assert!(found.contains("Strang is the fastest there and takes 0.10 ×"), "{found}");
    assert!(found.ends_with("it is faster than the network."), "{found}");
    // A small share is no nought.
    assert!(of(0.5, 2.0, 0.034).contains("takes 0.03 ×"));
    assert!(of(0.5, 2.0, 0.0034).contains("takes 3.4e-3 ×"));
    // To be faster than all integrators is another claim than to be so by a factor of 1,200.
    let faster = of(0.5, 2.0, 3.0);
    assert!(faster.contains("third of that: not"), "{faster}");
    assert!(faster.ends_with("the network is faster than each."), "{faster}");
    assert!(beside(390.0, 0.5, 2.0, 0.1).contains("third of that: not"));
    assert!(beside(410.0, 0.5, 2.0, 0.1).contains(&format!("third of that: {REPRODUCED}")));
    assert!(beside(5000.0, 0.5, 2.0, 0.1).contains(&format!("third of that: {REPRODUCED}")));
    assert!(beside(f64::NAN, 0.5, 2.0, 0.1).contains("third of that: not"));
    assert!(of(1.5, 2.0, 3.0).contains("SympNet: not"));
    assert!(of(f64::NAN, 2.0, 3.0).contains("SympNet: not"));
    assert!(of(0.5, 2.0, f64::NAN).contains("over RK4"));
    assert!(faster_than_integrators(&[]).is_none());
}

/// By the median of each network over its initial weights, which is named.
#[test]
fn the_slow_manifold_is_judged_by_all_maps() {
    let found = |shares: &[(&str, f64, f64)]| {
        let beside = shares.iter().map(|(network, share, off)| {
            let on = 0.001;
            json!({
                "network": network, "from_manifold": share, "from_learnt": on, "from_system": on, "off": off
            })
        });
        let slow = json!([{ "name": "gyroceptron", "largest_q_p_mu": [[0.1, 0.1, 0.0]] }]);
        let data =
            json!({ "slow": slow, "beside_reference": beside.collect::<Value>(), "off": [] });
        let of = |name: &'static str| verdict(&part(name, "slow_manifold", data.clone()));
        let both = ["particle-field", "slow-manifold"].map(of);
        // Off the manifold the second scene has sizes, and no verdict.
        let (on, off) = both[0].split_once("; off it: ").expect("both");
        assert_eq!(both[1], on);
        [on.to_owned(), off.to_owned()]
    };
    let of = |shares: &[(&str, f64)]| {
        let [on, _] = found(&shares.iter().map(|(name, on)| (*name, *on, 1.0)).collect::<Vec<_>>());
        on
    };
    let near =
        [("gyroceptron", 0.02), ("gyroceptron", 0.03), ("gyroceptron", 0.2), ("penalised", 0.2)];
    assert!(of(&near).starts_with("slow manifold: reproduced by `gyroceptron` ("), "{}", of(&near));
    let far = [("gyroceptron", 0.07), ("gyroceptron", 0.08), ("penalised", 0.01)];
    assert!(of(&far).starts_with("slow manifold: undecided"), "{}", of(&far));
    assert!(of(&far).ends_with("by one set of initial weights: `penalised`)"), "{}", of(&far));
    let two = [&far[..], &[("penalised", 0.02)]].concat();
    assert!(of(&two).starts_with("slow manifold: reproduced by `penalised` ("), "{}", of(&two));
    assert!(of(&far[..2]).starts_with("slow manifold: not"), "{}", of(&far[..2]));
    let lost = [("gyroceptron", f64::NAN), ("gyroceptron", f64::NAN)];
    assert!(of(&lost).starts_with("slow manifold: not"));
    assert!(of(&[]).starts_with("slow manifold: not"));

    // Off it: by the median of each network.
    let off = |shares: &[(&str, f64, f64)]| {
        let [_, off] = found(shares);
        off
    };
    let near = [("gyroceptron", 0.1, 0.3), ("gyroceptron", 0.1, 2.0), ("penalised", 0.1, 0.04)];
    assert_eq!(off(&near), "undecided (within 20 % by one set of initial weights: `penalised`)");
    let twice = [&near[..], &near[2..]].concat();
    assert_eq!(off(&twice), "reproduced by `penalised` (the median within 20 %)");
    let two = [("gyroceptron", 0.1, 0.1), ("gyroceptron", 0.1, 0.1), ("gyroceptron", 0.1, 3.0)];
    assert!(off(&two).contains("reproduced by `gyroceptron`"), "{}", off(&two));
    let lost = [("gyroceptron", 0.1, f64::NAN), ("gyroceptron", 0.1, f64::NAN)];
    assert!(off(&lost).starts_with("not"), "{}", off(&lost));
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
