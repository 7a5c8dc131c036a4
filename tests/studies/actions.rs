//! Circle actions found by training, and several of them.

use crate::helpers::{failed_in, refused, run_in, temporary};
use gyroceptron::scene::{Event, Folder, Observer, parse, render, run};
use serde_json::Value;

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
