//! Pairs with noise, and with a gap.

use crate::helpers::{refused, run_in, temporary};
use gyroceptron::scene::{Folder, parse};
use serde_json::Value;

pub const NOISE: &str = r#"
name = "noisy"
seed = 2
flow_time = 0.8
plots = ["noise"]

[system]
kind = "oscillators"
epsilon = 0.05

[data]
validation = 0.3
windows = [{ low = [-1.0, -1.0, -1.0, -1.0], high = [1.0, 1.0, 1.0, 1.0], samples = 700 }]

[[models]]
name = "normal-form"
network = { kind = "normal-form", kicks = { count = 3, width = 4 }, twists = { count = 4, width = 4 } }
weights = { kind = "normal", scale = 0.15 }

[[models]]
name = "henon-net"
network = { kind = "henon-net", layers = { count = 4, width = 4 } }
weights = { kind = "normal", scale = 0.15 }

[training]
iterations = 100
optimiser = { kind = "levenberg-marquardt" }

[noise]
levels = [1e-3, 1e-2, 1.0]
gaps = [{ component = 1, low = 0.0, high = 2.0 }]
steps = 60
every = 2
initial = [[0.7, 0.1, 0.0, 0.2], [0.2, 0.6, 0.0, 0.0]]
"#;

#[test]
fn noise_and_gaps_are_reported() {
    let folder = temporary();
    let network = "network = { kind = \"henon-net\"";
    let scene = NOISE.replace(network, &format!("seeds = 2\n{network}"));
    let report = run_in(folder.path(), &parse("noisy", &scene).expect("a scene"));
    let found = &report.study("noise").expect("a study").results.data;
    let found = found.as_array().expect("rows");
    // None, three levels and a gap, of two networks each.
    assert_eq!(found.len(), 10);
    let number = |value: &Value| value.as_f64().expect("a number");
    for network in ["normal-form", "henon-net"] {
        let rows: Vec<&Value> = found.iter().filter(|of| of["network"] == network).collect();
        let of: Vec<&Value> = rows.iter().map(|row| &row["seeds"][0]).collect();
        let clean: Vec<f64> = of.iter().map(|of| number(&of["clean"])).collect();
        let held_out: Vec<f64> = of.iter().map(|of| number(&of["held_out"])).collect();
        // Without noise the two are the same pairs.
        assert!((clean[0] / held_out[0] - 1.0).abs() < 1e-12, "{network}: {clean:?} {held_out:?}");
        // Noise of both ends is what held-out pairs have at least; the flow is met better than that.
        for (k, level) in [(2, 1e-2), (3, 1.0)] {
            let floor = level * 2.0_f64.sqrt();
            assert!(held_out[k] > 0.9 * floor, "{network}: {held_out:?}");
            assert!(clean[k] < floor && clean[k] < held_out[k], "{network}: {clean:?}");
        }
        assert!(held_out[2] < 1.3e-2 * 2.0_f64.sqrt(), "{network}: {held_out:?}");
        assert!(clean[3] > 2.0 * clean[0] && clean[3] > 2.0 * clean[2], "{network}: {clean:?}");
        // Neither pairs to train with nor those that are held out are in the gap; all of the flow are judged too.
        assert!(number(&rows[4]["pairs"]) < 0.8 * number(&rows[0]["pairs"]));
        let in_gap = number(&of[4]["in_gap"]);
        assert!(clean[4] > 2.0 * clean[0], "{network}: {clean:?}");
        assert!(
            held_out[4] < 0.7 * clean[4] && clean[4] < in_gap,
            "{network}: {held_out:?} {in_gap}"
        );
        assert!(of[0]["in_gap"].is_null() && of[3]["in_gap"].is_null());
        // Orbits of both initial points swing through it.
        let without = number(&of[4]["without_pairs"]);
        assert!((0.2..0.8).contains(&without), "{network}: {without}");
        // More noise than signal.
        assert_eq!(of[3]["verdict"], "no", "{}", of[3]);
        assert!(of[3]["reasons"].as_array().is_some_and(|reasons| !reasons.is_empty()));
        assert_ne!(of[0]["verdict"], "no", "{}", of[0]);
    }
    // The invariant of the normal form is exact, whatever its pairs.
    for of in found.iter().filter(|of| of["network"] == "normal-form") {
        assert!(number(&of["seeds"][0]["own"]) < 1e-12, "{of}");
    }
    let text = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
    // The median of two is the mean, and the worst the larger one.
    for of in found.iter().filter(|of| of["network"] == "henon-net") {
        let seeds = of["seeds"].as_array().expect("seeds");
        let errors: Vec<f64> = seeds.iter().map(|seed| number(&seed["held_out"])).collect();
        let [first, second] = errors[..] else { panic!("{of}") };
        assert_ne!(first, second);
        let row = format!(
            "| {} | `henon-net` | {:.1e} | {:.1e} |",
            of["fault"].as_str().expect("words"),
            f64::midpoint(first, second),
            first.max(second)
        );
        assert!(text.contains(&row), "{row}\n{text}");
    }
    for words in [
        "| noise 1e-2 | `henon-net` |",
        "no pairs with 0 < z[1] < 2",
        "where no pairs are",
        "noise.svg",
    ] {
        assert!(text.contains(words), "{words}");
    }
    assert!(folder.path().join("model-normal-form-noise-1e-2.json").exists());
    let _ = Folder::open(folder.path(), false, true).expect("cleared");
    assert!(!folder.path().join("model-normal-form-noise-1e-2.json").exists());
}

#[test]
fn noise_that_cannot_be_is_refused() {
    let with = |from: &str, to: &str, words: &[&str]| {
        assert!(NOISE.contains(from), "{from}");
        refused(&NOISE.replace(from, to), words);
    };
    with("levels = [1e-3, 1e-2, 1.0]", "levels = []", &["noise", "levels"]);
    with("levels = [1e-3", "levels = [0.0", &["levels", "0"]);
    with("levels = [1e-3", "levels = [nan", &["levels", "NaN"]);
    with("low = 0.0, high = 2.0", "low = 2.0, high = 0.0", &["gaps", "2 … 0"]);
    with("component = 1", "component = 4", &["gaps.component", "4"]);
    with("every = 2", "every = 7", &["every", "divisor"]);
    let ramp = "iterations = 100\nramp = [{ flow_time = 0.4, iterations = 5 }]";
    with("iterations = 100", ramp, &["normal-form", "without a ramp"]);
}
