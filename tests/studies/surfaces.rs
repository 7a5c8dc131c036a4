//! Surfaces of section.

use crate::helpers::{refused, run_in, temporary};
use gyroceptron::measure::timing::{AtError, WorkPrecision};
use gyroceptron::scene::{parse, render};
use serde_json::Value;

pub(crate) const SURFACES: &str = r#"
name = "lines"
seed = 1
flow_time = 6.283185307179586
plots = ["section", "surfaces-methods"]

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

[[surfaces.tables]]
kind = "polar-splines"
nodes = [33]

[[surfaces.tables]]
kind = "generating-function"
nodes = [33, 65]

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
    // The report says why.
    let reason = unsolved["failure"].as_str().expect("a reason");
    assert!(reason.contains("out of range") && exact.get("failure").is_none(), "{unsolved}");
    let text = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
    assert!(
        text.contains(&format!("- Gauss–Legendre, 6 stages, 1: {reason}")) && !text.contains("NaN")
    );
    // Tables: that of a generating function stays on the surface, and has the island.
    let (splines, _) = of("table of the step in (θ, ρ), cubic splines", Some(33));
    let generating = "table of a generating function, cubic splines";
    let (coarse, _) = of(generating, Some(33));
    let (fine, on) = of(generating, Some(65));
    assert!(
        number(&splines["early"]) < 1e-2 && number(&coarse["early"]) < 1e-2,
        "{splines} {coarse}"
    );
    assert!(number(&fine["early"]) < 0.3 * number(&coarse["early"]), "{coarse} {fine}");
    let [low, high] = ends(&fine["island"]);
    let width = (high - low) / (island[1] - island[0]);
    assert!(on < 1e-2 && (width - 1.0).abs() < 0.02, "{on} {width}");
    let (integrable, _) = of("integrable", None);
    assert!(integrable["island"].is_null() && number(&integrable["early"]) > 1e-2);
    let svg = std::fs::read_to_string(folder.path().join("section.svg")).expect("drawn");
    assert!(svg.contains("reference") && svg.contains("integrable"));
    let svg = std::fs::read_to_string(folder.path().join("surfaces-methods.svg")).expect("drawn");
    assert!(svg.contains("largest distance from the surface") && svg.contains("integrable"));
    let timings = std::fs::read(folder.path().join("timings.json")).expect("run times");
    let timings: Value = serde_json::from_slice(&timings).expect("one JSON document");
    worth_is_that_of_the_fastest_rival(&timings["studies"]["surfaces"], found);

    refused(&SURFACES.replace("[33, 65]", "[2]"), &["surfaces", "nodes"]);
    // A ring cannot reach the axis: the table's row says so, and the others stand.
    let of_axis = temporary();
    let near = parse("lines", &SURFACES.replace("[0.2,", "[0.005,")).expect("a scene");
    let axis = run_in(of_axis.path(), &near);
    let methods = render::json(&axis)["studies"]["surfaces"]["methods"].clone();
    let methods = methods.as_array().expect("methods");
    assert!(methods.iter().any(|m| m["name"] == generating && m["early"].is_null()), "{methods:?}");
    assert!(methods.iter().any(|m| m["name"] == exact["name"] && !m["early"].is_null()));
    let text = std::fs::read_to_string(of_axis.path().join("report.md")).expect("a report");
    assert!(text.contains("65 nodes along each axis: none, "), "{text}");
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
    let without = without.replace("plots = [\"section\", \"surfaces-methods\"]", "");
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
    // The reference alone: one integrator, which a scene has to have.
    let (head, rest) = SURFACES.split_once("[[surfaces.integrators]]").expect("integrators");
    let (_, models) = rest.split_once("[[models]]").expect("a model");
    let only = "[[surfaces.integrators]]\nintegrator = { kind = \"gauss-legendre\", stages = 1 }\n\
                steps = [30]\n[[models]]";
    let head = head.replace("plots = [\"section\", \"surfaces-methods\"]", "");
    let reference = format!("{head}{only}{models}");
    let one = reference.replace("epsilon = 4e-3", whole);
    let one = one.replace("island = 50", "island = 150");
    let three = reference
        .replace("flow_time = 6.283185307179586", "flow_time = 18.84955592153876")
        .replace("steps = 200", "steps = 100");
    let island = |scene: &str| -> f64 {
        let report = run_in(temporary().path(), &parse("lines", scene).expect("a scene"));
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

/// What a network is worth from the surfaces is read off the curves of its rivals by how far each is from them.
fn worth_is_that_of_the_fastest_rival(timed: &Value, found: &Value) {
    let methods: Vec<WorkPrecision> =
        serde_json::from_value(timed["methods"].clone()).expect("methods");
    let furthest = |of: &WorkPrecision| -> Option<f64> {
        let rows = found["methods"].as_array().expect("methods").iter();
        let mut rows = rows.filter(|row| row["steps"].as_f64() == of.setting);
        let lines = rows.find(|row| row["name"] == of.name[..])?["surfaces"].as_array()?;
        let each = lines.iter().map(|line| line[1].as_f64().unwrap_or(f64::NAN));
        Some(each.fold(0.0, gyroceptron::scalar::max_or_nan)).filter(|far| far.is_finite())
    };
    let surfaces: Vec<WorkPrecision> = methods
        .iter()
        .map(|method| WorkPrecision { error: furthest(method), ..method.clone() })
        .collect();
    let worth = &timed["worth"][0];
    assert_eq!(worth["network"], "integrable");
    let paid = worth["paid"].as_f64().expect("seconds");
    assert!(paid > 0.0, "{worth}");
    // So far off it has lost the lines, though the surfaces say how far it is.
    let one_by_one = &worth["one_by_one"];
    assert!(one_by_one["error"].is_null() && one_by_one["factor"].is_null(), "{worth}");
    let own = surfaces.iter().find(|method| method.setting.is_none()).expect("the network");
    let (error, seconds) = (own.error.expect("an error"), own.seconds.expect("seconds").median);
    let of = &worth["from_surfaces"];
    assert_eq!(of["error"], error);
    let rival = AtError::fastest(&surfaces, error).expect("a rival");
    let factor = rival.seconds / seconds;
    assert_eq!(of["factor"], factor);
    // The seconds are for unit time, and a map is of 2π.
    let gain = std::f64::consts::TAU * (rival.seconds - seconds);
    let maps = of["maps_that_pay"].as_f64();
    assert_eq!(maps.is_some(), factor > 1.0, "{of}");
    if let Some(maps) = maps {
        assert!((maps * gain / paid - 1.0).abs() < 1e-6, "{of} for {paid}");
    }
}

/// Several initial weights have a row of medians and worst cases, of what each of them comes to.
#[test]
fn surfaces_of_several_initial_weights_are_ranked() {
    let folder = temporary();
    let (before, rest) = SURFACES.split_once("[[surfaces.integrators]]").expect("integrators");
    let (_, models) = rest.split_once("[[models]]").expect("a network");
    let models = models.replace("name = \"integrable\"", "name = \"integrable\"\nseeds = 3");
    let before = before.replace("rounds = 1", "rounds = 1\nintegrators = []");
    let scene = parse("lines", &format!("{before}[[models]]{models}")).expect("a scene");
    let report = run_in(folder.path(), &scene);
    let found = render::json(&report)["studies"]["surfaces"].clone();
    let seeds = found["seeds"][0]["found"].as_array().expect("seeds");
    assert_eq!((seeds.len(), &seeds[0]), (3, &found["methods"][0]));
    let number = |value: &Value| value.as_f64().expect("a number");
    let mut early: Vec<f64> = seeds.iter().map(|one| number(&one["early"])).collect();
    early.sort_by(f64::total_cmp);
    assert!(early[0] < early[1] && early[1] < early[2], "{early:?}");
    let largest = |one: &Value| -> f64 {
        let lines = one["surfaces"].as_array().expect("lines").iter();
        lines.map(|line| number(&line[1])).fold(0.0, gyroceptron::scalar::max_or_nan)
    };
    let mut furthest: Vec<f64> = seeds.iter().map(largest).collect();
    furthest.sort_by(f64::total_cmp);
    let text = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
    // The first such row, of the training, has other columns.
    let of_network = |line: &&str| line.starts_with("| `integrable` | 3 |");
    let row = text.lines().rfind(of_network).expect("a row");
    // None of them has an island.
    let numbers = [early[1], early[2], furthest[1], furthest[2]].map(|v| format!("{v:.2e}"));
    assert_eq!(row, format!("| `integrable` | 3 | {} | 100 % | 100 % |", numbers.join(" | ")));
}
