//! Families of maps over ε and the flow time.

use crate::helpers::{part, refused, run_in, temporary};
use gyroceptron::flow;
use gyroceptron::scalar::max_or_nan;
use gyroceptron::scene::{parse, render};
use gyroceptron::system::FullOrbit;
use serde_json::Value;

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
    let several = FAMILY.replace("name = \"normal-form\",", "name = \"normal-form\", seeds = 2,");
    let scene = parse("kin", &several).expect("a scene");
    let report = run_in(folder.path(), &scene);
    let data = render::json(&report);
    let number = |value: &Value| value.as_f64().expect("a number");
    let family = &data["studies"]["family"];
    // Two initial weights lead to two maps, one initial weights is its own median and worst.
    for (found, worst, of) in
        [("errors", "worst_errors", "maps"), ("learnt", "worst_learnt", "invariants")]
    {
        for row in family[of].as_array().expect("rows") {
            assert!(number(&row[worst][0]) > number(&row[found][0]), "{row}");
            assert_eq!(row[worst][1], row[found][1], "{row}");
        }
    }
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
        assert!(averaged < 0.2 * leading && number(&at["averaged_twice"]) < 0.5 * averaged, "{at}");
        assert!(number(&at["learnt"][0]) < leading, "{at}");
        assert!(at["learnt"][1].is_null(), "{at}");
    }
    let orders = |of: &str| {
        let of = |k: usize| number(&invariants[k][of]);
        (of(0) / of(2)).log2()
    };
    assert!((orders("leading") - 1.0).abs() < 0.3 && (orders("averaged") - 2.0).abs() < 0.5);
    assert!((orders("averaged_twice") - 3.0).abs() < 0.7, "{invariants:?}");
    let text = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
    for words in ["Orders in ε of the changes along the reference: μ₀ ", "| 1.5e-2 | 7.5 | no |"]
    {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert!(folder.path().join("family.svg").exists());
}

/// Medians of five initial weights. An hour in a release build: `cargo test --release --test studies
/// learnt_invariants -- --ignored --nocapture` prints the numbers.
#[test]
#[ignore = "takes an hour: run it with --ignored"]
fn learnt_invariants_are_of_second_order() {
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
    let [[largest, _, at_largest], ..] = changes[..] else { panic!("several") };
    let [_, leading, learnt] =
        *changes.iter().find(|[epsilon, ..]| *epsilon == 0.01).expect("ε = 0.01");
    // Below, what is left is the error of the network.
    let order = (at_largest / learnt).ln() / (largest / 0.01).ln();
    println!("order {order:.2}");
    assert!(largest > 3.0 * 0.01 && order >= 2.0, "{largest} {order}");
    assert!(leading >= 50.0 * learnt, "{leading} {learnt}");
}

/// Medians of five initial weights. Twenty minutes in a release build: `cargo test --release --test studies no_sum --
/// --ignored --nocapture` prints the errors.
#[test]
#[ignore = "takes twenty minutes or more: run it with --ignored"]
fn averages_that_are_no_sum_are_learnt_by_turned_twists() {
    let folder = temporary();
    let report = run_in(folder.path(), &part("family", "cells"));
    let data = render::json(&report);
    let maps = data["studies"]["family"]["maps"].as_array().expect("maps");
    for map in maps {
        let of = |key: &str| map[key].as_f64().expect("a number");
        let error = |model: usize| map["errors"][model].as_f64().expect("a number").sqrt();
        let (epsilon, time, gain) = (of("epsilon"), of("flow_time"), error(1) / error(0));
        println!("ε = {epsilon}, time {time}: turned {:.1e}, rms, {gain:.1} times less", error(0));
        // Of those that were learnt, steps that are not long beside the slow motion.
        let short = epsilon * time <= 0.1 && map["seen"] == true;
        assert!(gain >= if short { 10.0 } else { 4.0 }, "{gain}");
    }
    assert!(maps.len() == 20);
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
