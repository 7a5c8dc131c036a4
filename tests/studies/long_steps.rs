//! Maps of long flow times.

use crate::helpers::{Quiet, part, refused, run_in, temporary};
use gyroceptron::io::load_model;
use gyroceptron::measure::timing::{AtError, WorkPrecision};
use gyroceptron::network::Model;
use gyroceptron::scalar::max_or_nan;
use gyroceptron::scene::{Folder, parse, render, run};
use serde_json::Value;

pub const LONG_STEPS: &str = r#"
name = "long"
seed = 2
flow_time = 10.0
plots = ["long-steps", "long-steps-methods"]
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
    { integrator = { kind = "aba-1064" }, from = 5.0, to = 2.5, factor = 2.0 },
]
tables = [{ kind = "splines", nodes = [5, 9] }]
"#;

/// The same with one rival and without tables, for what does not depend on them.
pub fn few_rivals() -> String {
    let rival = "{ integrator = { kind = \"aba-1064\" }, from = 5.0, to = 2.5, factor = 2.0 },";
    LONG_STEPS
        .replace("tables = [{ kind = \"splines\", nodes = [5, 9] }]", "")
        .replace(rival, "")
        .replace("invariant_steps = 20000", "invariant_steps = 2000")
        .replace("rounds = 3", "rounds = 1")
}

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
            let stages = network["stages"].as_array().expect("stages");
            assert!(stages.is_empty());
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
        assert_eq!(settings("trajectories", "ABA"), [20.0, 40.0]);
        // Of more nodes a table errs less, as it does over trajectories; it has a size.
        for comparison in ["one_step", "trajectories"] {
            assert_eq!(settings(comparison, "table of the step"), [5.0, 9.0]);
            let methods = at[comparison]["methods"].as_array().expect("methods").iter();
            let tables = methods.filter(|m| m["name"] == "table of the step, cubic splines");
            let errors: Vec<f64> = tables.map(|m| number(&m["error"])).collect();
            assert!(errors[1] < 0.5 * errors[0] && errors[1] > 1e-9, "{errors:?}");
        }
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
    for words in [
        "| `normal-form` |",
        "the network is faster by",
        "- `gyroceptron` ",
        "seconds of pairs and training",
        "rivals at the error of `normal-form`",
        "its least error, where it is larger",
        "- table of the step, cubic splines, 5 nodes along each axis: 0.0768 MB",
    ] {
        assert!(text.contains(words), "{words}");
    }
    // What was paid before the first step: of each flow time in turn, with what led up to it.
    let timings = std::fs::read(folder.path().join("timings.json")).expect("timings");
    let timings: Value = serde_json::from_slice(&timings).expect("JSON");
    let times = timings["studies"]["long_steps"].as_array().expect("flow times");
    let paid = |key: &str| -> Vec<f64> {
        times.iter().map(|at| number(&at["networks"][0][key])).collect()
    };
    for key in ["pairs_seconds", "training_seconds"] {
        let paid = paid(key);
        assert!(paid[0] > 0.0 && paid.windows(2).all(|pair| pair[0] < pair[1]), "{key}: {paid:?}");
    }
    let drawn = std::fs::read_to_string(folder.path().join("long-steps-methods.csv"));
    let drawn = drawn.expect("numbers");
    for curve in ["\"Strang\"", "\"normal-form\""] {
        assert!(drawn.contains(curve), "{curve} in {drawn}");
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

const AND_AVERAGED: &str = "integrators = [
    { integrator = { kind = \"averaged\", order = 2, angles = 8, closed = true }, from = 5.0, to = 0.6 },";

/// Each kind of rival has a row with its factors at the errors of the best, the median and the worst weights.
fn rows_of_kinds_are_of_the_times(timings: &Value, text: &str) {
    let at = &timings["studies"]["long_steps"][0];
    for (what, of) in [("one_step", "one step of 10"), ("trajectories", "time 200")] {
        let methods = at[what]["methods"].as_array().expect("methods").iter();
        let methods = methods.map(|of| serde_json::from_value(of.clone()).expect("a method"));
        let methods: Vec<WorkPrecision> = methods.collect();
        let own = methods.iter().find(|method| method.name == "normal-form").expect("the network");
        let own = own.seconds.expect("timed").median;
        let errors = at["seeds"][0][what].as_array().expect("errors").iter();
        let mut errors: Vec<f64> = errors.map(|error| error.as_f64().expect("finite")).collect();
        errors.sort_by(f64::total_cmp);
        let mut seen = 0;
        for (kind, part) in
            [("averages in closed form", "closed form"), ("tables of the step", "spline")]
        {
            let of_kind: Vec<WorkPrecision> =
                methods.iter().filter(|method| method.name.contains(part)).cloned().collect();
            assert!(!of_kind.is_empty(), "{kind}");
            let row = text.lines().find(|line| {
                line.contains("`normal-form`") && line.contains(of) && line.contains(kind)
            });
            let row = row.unwrap_or_else(|| panic!("{kind}, {of}: {text}"));
            let factors: Vec<&str> = row.split(" | ").skip(8).take(3).collect();
            for (error, said) in errors.iter().zip(factors) {
                let Some(rival) = AtError::fastest(&of_kind, *error) else {
                    assert_eq!(said, "–", "{row}");
                    continue;
                };
                let factor = rival.seconds / own;
                let found: f64 = said.trim_end_matches([' ', '×', '*']).parse().expect("a factor");
                // Printed with one digit behind the point, below 1 with two.
                let rounding = if factor < 0.995 { 0.0051 } else { 0.051 };
                assert!((found - factor).abs() < rounding, "{found} {factor}: {row}");
                seen += 1;
            }
        }
        assert!(seen > 0, "{what}: no rival errs as little: {text}");
    }
}

/// Errors of the first of several initial weights are those that are compared with rivals.
#[test]
fn other_initial_weights_have_errors_and_gains() {
    let scene = LONG_STEPS
        .replace("flow_times = [5.0, 10.0, 20.0]", "flow_times = [10.0]")
        .replace("ramp = true\n", "")
        .replace("{ name = \"normal-form\",", "{ name = \"normal-form\", seeds = 3,")
        .replace("integrators = [", AND_AVERAGED);
    assert!(scene.contains("seeds = 3") && scene.contains("flow_times = [10.0]"));
    assert!(scene.contains("closed = true"));
    let folder = temporary();
    let report = run_in(folder.path(), &parse("long", &scene).expect("a scene"));
    let data = render::json(&report);
    let at = &data["studies"]["long_steps"][0];
    let seeds = at["seeds"].as_array().expect("seeds");
    assert_eq!(seeds.len(), 1, "the other network has one");
    assert_eq!(seeds[0]["network"], "normal-form");
    for what in ["one_step", "trajectories"] {
        let errors: Vec<f64> = seeds[0][what]
            .as_array()
            .expect("errors")
            .iter()
            .map(|error| error.as_f64().expect("a number"))
            .collect();
        let first = &at[what]["methods"][0];
        assert_eq!(first["name"], "normal-form");
        assert_eq!(first["error"].as_f64(), Some(errors[0]), "{what}");
        assert!(
            errors.len() == 3 && errors[1] != errors[0] && errors[2] != errors[1],
            "{errors:?}"
        );
    }
    let timings = std::fs::read_to_string(folder.path().join("timings.json")).expect("timings");
    let text = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
    rows_of_kinds_are_of_the_times(&serde_json::from_str(&timings).expect("JSON"), &text);
    assert!(text.contains("(for one step, of the first of its initial weights)"), "{text}");
    assert!(text.contains("(for one step)"), "of the network of one set: {text}");
    for words in [
        "one step of 10, rms: median",
        "times as long: at the best",
        "averages in closed form",
        "all others",
        "steps that pay, at the median",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    // Untrained maps of large weights lose the trajectories, from each of their initial weights.
    let untrained = scene.replace("iterations = 20", "iterations = 1").replace("0.15", "2.0");
    let folder = temporary();
    let report = run_in(folder.path(), &parse("long", &untrained).expect("a scene"));
    let data = render::json(&report);
    let at = &data["studies"]["long_steps"][0];
    let size = at["trajectories"]["size"].as_f64().expect("a size");
    let errors = at["seeds"][0]["trajectories"].as_array().expect("errors");
    let lost = |error: &&Value| error.as_f64().is_none_or(|error| !(error <= 0.5 * size));
    assert_eq!(errors.iter().filter(lost).count(), 3, "{errors:?} {size}");
    let text = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
    let lost = text.lines().find(|line| line.contains("time 200") && line.contains("all others"));
    let lost = lost.expect("a row");
    assert!(lost.contains("time 200 | – | – | – |"), "{lost}");
    assert!(lost.contains("it has lost the points") && text.contains("| – | – | 3 |"), "{text}");
}

/// Only flow times to which the ramp leads up have twists that are trained alone.
#[test]
fn flow_times_beyond_the_ramp_have_fresh_twists() {
    let training = "[training]\nramp = [{ flow_time = 5.0, iterations = 10 }]\n\
                    fresh_twists = { count = 1, iterations = 10 }\n";
    let scene = few_rivals();
    let normal_form = scene.lines().filter(|line| !line.contains("\"gyroceptron\""));
    let scene = normal_form.collect::<Vec<_>>().join("\n");
    assert!(scene.contains("[training]\n") && scene.contains("ramp = true\n"));
    let scene = scene.replace("[training]\n", training).replace("ramp = true\n", "");
    let folder = temporary();
    let report = run_in(folder.path(), &parse("long", &scene).expect("a scene"));
    let data = render::json(&report);
    let times = data["studies"]["long_steps"].as_array().expect("flow times");
    let kinds = |at: &Value| -> Vec<String> {
        let stages = at["networks"][0]["stages"].as_array().expect("stages").iter();
        stages.map(|stage| stage["stage"]["kind"].as_str().expect("a kind").to_owned()).collect()
    };
    assert!(kinds(&times[0]).is_empty());
    assert_eq!(kinds(&times[1]), ["ramp", "twists", "twists"]);
    assert_eq!(kinds(&times[2]), ["ramp", "twists", "twists"]);
    // A run over it leaves none of its files behind.
    let left = |name: &str| folder.path().join(name).exists();
    assert!(left("checkpoint-normal-form-at-20-fresh-twists-1"));
    let again = parse("long", &scene.replace("20.0]", "25.0]")).expect("a scene");
    let open = Folder::open(folder.path(), false, true).expect("a folder");
    run(&again, &open, &mut Quiet).expect("runs").expect("not interrupted");
    assert!(!left("checkpoint-normal-form-at-20-fresh-twists-1"));
    assert!(left("checkpoint-normal-form-at-25-fresh-twists-1"));
    // Stages of the time that is wanted are of another ε, or are none.
    let stages = "ramp = [{ flow_time = 10.0, epsilon = 0.02, iterations = 10 }, \
                 { flow_time = 10.0, iterations = 10 }, { flow_time = 20.0, iterations = 10 }]";
    let scene = scene.replace("ramp = [{ flow_time = 5.0, iterations = 10 }]", stages);
    let other = temporary();
    let report = run_in(other.path(), &parse("long", &scene).expect("a scene"));
    let data = render::json(&report);
    let times = data["studies"]["long_steps"].as_array().expect("flow times");
    let stages = |at: &Value| kinds(at).iter().filter(|kind| *kind == "ramp").count();
    assert_eq!(times.iter().map(stages).collect::<Vec<_>>(), [0, 1, 2]);
    // A short form has one draw of them, and fewer iterations.
    let training = scene.replace("count = 1, iterations = 10 }", "count = 3, iterations = 100 }");
    let quick = parse("long", &training).expect("a scene").quick();
    let fresh = quick.setup.training.fresh_twists.expect("as in the scene");
    assert_eq!((fresh.count, fresh.iterations), (1, 25));
}

/// A step of 100 time units has no solution by fixed-point iteration; the other rivals are compared.
#[test]
fn a_rival_that_finds_no_solution_has_a_row_that_says_so() {
    let rival = "integrators = [\n    { integrator = { kind = \"gauss-legendre\", stages = 12 }, steps = [100.0] },";
    let scene = few_rivals()
        .replace("flow_times = [5.0, 10.0, 20.0]", "flow_times = [100.0]")
        .replace("ramp = true\n", "")
        .replace("integrators = [", rival);
    let folder = temporary();
    run_in(folder.path(), &parse("long", &scene).expect("a scene"));
    let timings = std::fs::read_to_string(folder.path().join("timings.json")).expect("timings");
    let timings: Value = serde_json::from_str(&timings).expect("JSON");
    let text = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
    let methods = &timings["studies"]["long_steps"][0]["one_step"]["methods"];
    let methods: Vec<WorkPrecision> = serde_json::from_value(methods.clone()).expect("methods");
    let failed: Vec<_> = methods.iter().filter(|method| method.failure.is_some()).collect();
    assert!(!failed.is_empty() && methods.len() > failed.len(), "{methods:?}");
    for method in failed {
        assert!(method.name.contains("Gauss"), "{method:?}");
        assert!(method.error.is_none() && method.seconds.is_none(), "{method:?}");
        let row = format!("| {}: {} |", method.name, method.failure.as_ref().expect("failed"));
        assert!(text.contains(&row), "{row}: {text}");
    }
}

/// The averaged equation is of one circle action.
#[test]
fn averaged_models_of_systems_without_their_circle_are_refused() {
    let of_three = |text: &str| {
        let six = |value: &str| format!("[{}]", [value; 6].join(", "));
        text.replace("[-1.0, -1.0, -1.0, -1.0]", &six("-1.0"))
            .replace("[1.0, 1.0, 1.0, 1.0]", &six("1.0"))
            .replace("[[0.7, 0.1, 0.0, 0.2], [0.2, 0.6, 0.0, 0.0]]", &format!("[{}]", six("0.2")))
            .replace("kind = \"oscillators\"", "kind = \"three-oscillators\"")
            .replace("kind = \"strang\"", "kind = \"averaged\", order = 1, angles = 8")
    };
    let models = few_rivals();
    let models: Vec<&str> =
        models.lines().filter(|line| !line.contains("name = \"gyroceptron\"")).collect();
    refused(&of_three(&models.join("\n")), &["averaged equation of order 1"]);
}

#[test]
fn flow_times_that_do_not_fit_are_refused() {
    let with = |from: &str, to: &str, words: &[&str]| {
        assert!(LONG_STEPS.contains(from), "{from}");
        refused(&LONG_STEPS.replace(from, to), words);
    };
    with("[5, 9]", "[5, 3]", &["long_steps", "nodes"]);
    with("[5, 9]", "[9, 5]", &["long_steps", "5 after 9", "ascending"]);
    with("[5, 9]", "[]", &["long_steps", "tables.nodes"]);
    with("[5, 9]", "[500]", &["long_steps", "500 nodes along each of 4 axes", "1 GiB"]);
    with("kind = \"splines\"", "kind = \"polar-splines\"", &["2 degrees of freedom", "one degree"]);
    with("kind = \"splines\"", "kind = \"steps\"", &["steps", "polar-splines"]);
    with("[5.0, 10.0, 20.0]", "[]", &["long_steps", "flow_times"]);
    with("[5.0, 10.0, 20.0]", "[5.0, 20.0, 10.0]", &["10 after 20", "ascending"]);
    with("[5.0, 10.0, 20.0]", "[5.0, 30.0]", &["interval", "steps of 30"]);
    with("duration = 200.0", "duration = 250.0", &["duration", "steps of 100"]);
    with("steps = [25.0, 5.0, 1.0]", "steps = [-1.0]", &["integrators.steps", "-1"]);
    with("[0.2, 0.6, 0.0, 0.0]", "[0.2, 0.6]", &["initial", "4 finite numbers"]);
    with("points = 50", "points = 0", &["points"]);
    with("rounds = 3", "rounds = 0", &["rounds"]);
    with("steps = [25.0, 5.0, 1.0]", "steps = [1e-300]", &["integrators.steps", "e-300"]);
    let range = "from = 5.0, to = 2.5, factor = 2.0";
    with(range, "from = 5.0", &["integrators", "both from and to"]);
    with(range, "steps = [5.0], from = 5.0, to = 2.5", &["integrators", "either steps"]);
    with(range, "steps = []", &["integrators", "either steps"]);
    with(range, "from = 2.5, to = 5.0", &["integrators", "from 2.5 to 5"]);
    with(range, "from = 5.0, to = 2.5, factor = 1.0", &["integrators.factor", "1"]);
    with(range, "from = nan, to = 2.5", &["integrators.steps", "NaN"]);
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

/// Seven minutes in a release build: `cargo test --release --test studies long_flow_times --
/// --ignored --nocapture` prints the errors.
#[test]
#[ignore = "takes minutes: run it with --ignored"]
fn long_flow_times_are_learnt() {
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
