//! Predictions on a grid, forward and back.

use crate::helpers::{folder, last_numbers, refuses, succeeds, text, with_model, write_large_data};
use gyroceptron::io::{StoredModel, load_model, write_points};
use serde_json::Value;
use std::path::Path;

const PREDICT: [&str; 3] = ["predict", "--model", "model.json"];

fn predict(folder: &Path, input: &str, output: &str, more: &[&str]) -> Value {
    let mut arguments = PREDICT.to_vec();
    arguments.extend(["--input", input, "--output", output, "--every", "300", "--json"]);
    arguments.extend(more);
    let output = succeeds(folder, &arguments);
    serde_json::from_slice(&output.stdout).expect("one JSON document")
}

/// The first state and the last of three points in two degrees of freedom.
fn ends(file: &Path) -> [Vec<f64>; 2] {
    let both = last_numbers(file, 24);
    [both[..12].to_vec(), both[12..].to_vec()]
}

#[test]
fn steps_back_on_a_grid_lead_to_the_first_state() {
    let folder = with_model();
    let path = folder.path();
    for numbers in ["integers", "floats"] {
        let grid = ["--grid", "40", "--grid-numbers", numbers];
        let there = predict(path, "z.npy", "t.npy", &[&grid[..], &["--steps", "300"]].concat());
        assert_eq!(there["grid"]["numbers"], numbers);
        assert_eq!(there["grid"]["leads_back"], true);
        let [start, end] = ends(&path.join("t.npy"));
        write_points(&path.join("end.npy"), &[3, 4], &end).expect("written");
        predict(path, "end.npy", "b.npy", &[&grid[..], &["--steps=-300"]].concat());
        let [from, back] = ends(&path.join("b.npy"));
        assert_eq!((from, back), (end, start.clone()));
        let moved = last_numbers(&path.join("z.npy"), 12);
        let most = there["grid"]["first_state_moved_by"].as_f64().expect("a number");
        assert!(most > 0.0 && most <= 2_f64.powi(-41));
        assert!(start.iter().zip(&moved).all(|(a, b)| (a - b).abs() <= most));
        for file in ["t.npy", "b.npy"] {
            std::fs::remove_file(path.join(file)).expect("a file");
        }
    }
    // Without a grid the way back is near, and not exact.
    assert!(predict(path, "z.npy", "t.npy", &["--steps", "300"])["grid"].is_null());
    let [start, end] = ends(&path.join("t.npy"));
    write_points(&path.join("end.npy"), &[3, 4], &end).expect("written");
    predict(path, "end.npy", "b.npy", &["--steps=-300"]);
    let [_, back] = ends(&path.join("b.npy"));
    assert!(start.iter().zip(&back).all(|(a, b)| (a - b).abs() < 1e-9) && start != back);
}

#[test]
fn a_grid_that_does_not_do_is_refused() {
    let folder = with_model();
    let path = folder.path();
    let fixed = [&PREDICT[..], &["--input", "z.npy", "--output", "u.npy"]].concat();
    let refuse = |more: &[&str], words: &[&str]| {
        refuses(path, &[&fixed[..], more].concat(), words);
    };
    refuse(&["--steps", "1", "--grid", "70"], &["--grid", "at most 62", "70"]);
    refuse(&["--steps", "1", "--grid=-1"], &["--grid", "-1"]);
    let floats = ["--grid-numbers", "floats"];
    refuse(&[&["--steps", "1", "--grid", "51"], &floats[..]].concat(), &["at most 50", "51"]);
    write_points(&path.join("far.npy"), &[1, 4], &[0.1, -2.5, 0.0, 0.0]).expect("written");
    let far = [&PREDICT[..], &["--input", "far.npy", "--output", "u.npy", "--steps", "1"]].concat();
    let words = ["model.json", "point on a grid", "below 2 in magnitude", "50 bits"];
    refuses(path, &[&far[..], &["--grid", "50"], &floats[..]].concat(), &words);
    // The last states are kept where no orbit leaves the range.
    let long = ["--steps", "4000", "--every", "100", "--grid", "50"];
    write_points(&path.join("near.npy"), &[1, 4], &[1.99, 0.1, 0.3, 1.9]).expect("written");
    let near = [&PREDICT[..], &["--input", "near.npy", "--output", "u.npy"]].concat();
    let words = ["orbit on a grid of floats", "row 0 of the points", "below 2e0"];
    refuses(path, &[&near[..], &long[..], &floats[..]].concat(), &words);
}

/// The numbers of a file are coarser than a fine grid in units of large data.
#[test]
fn a_grid_that_is_finer_than_its_file_is_said() {
    let folder = folder();
    let path = folder.path();
    write_large_data(path);
    let train = ["train", "--data", "large.npz", "--circle-action", "1,0", "--output"];
    let more = ["model.json", "--recipe", "paper", "--iterations", "2"];
    succeeds(path, &[&train[..], &more[..]].concat());
    let StoredModel { units, .. } = load_model(&path.join("model.json")).expect("a model");
    assert!(units.is_some());
    write_points(&path.join("z.npy"), &[1, 4], &[30.1, -20.0, 10.0, 40.0]).expect("written");
    let fixed = [&PREDICT[..], &["--input", "z.npy", "--steps", "9", "--output"]].concat();
    let fine = succeeds(path, &[&fixed[..], &["f.npy", "--grid", "60"]].concat());
    let note = text(&fine.stderr);
    assert!(note.contains("a grid of 60 bits is finer") && note.contains("--steps -9"), "{note}");
    let coarse = succeeds(path, &[&fixed[..], &["c.npy", "--grid", "44"]].concat());
    assert!(!text(&coarse.stderr).contains("finer"));
}
