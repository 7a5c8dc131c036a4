//! Symplectic polynomials: from pairs to predictions.

use crate::helpers::{call, folder, last_numbers, refuses, succeeds, text};
use gyroceptron::flow::Pairs;
use gyroceptron::io::{load_polynomial, write_pairs, write_points};
use gyroceptron::random::Stream;
use gyroceptron::scalar::max_or_nan;
use serde_json::Value;
use std::path::Path;

/// A kick that is odd in q, between two turns by half an angle, twice.
fn kicked(z: &mut [f64]) {
    let turned = |z: &mut [f64]| {
        let (s, c) = 0.2_f64.sin_cos();
        (z[0], z[1]) = (c * z[0] + s * z[1], c * z[1] - s * z[0]);
    };
    for _ in 0..2 {
        turned(z);
        z[1] -= 0.2 * z[0].sin();
        turned(z);
    }
}

/// Pairs of the map, and of one with friction; points, and their orbits of 20 steps, one in ten of which is kept.
fn write_files(folder: &Path) {
    let mut stream = Stream::new(5, "points");
    let input: Vec<f64> = (0..800).map(|_| stream.uniform(-0.6, 0.6)).collect();
    let mut output = input.clone();
    output.chunks_mut(2).for_each(kicked);
    let write = |name: &str, output: Vec<f64>| {
        let pairs = Pairs::new("pairs", 1, input.clone(), output).expect("pairs");
        write_pairs(&folder.join(name), &pairs).expect("written");
    };
    write("pairs.npz", output.clone());
    write("friction.npz", output.iter().map(|v| 0.99 * v).collect());
    let start = [0.3, 0.1, -0.2, 0.2, 0.1, 0.0];
    write_points(&folder.join("z.npy"), &[3, 2], &start).expect("written");
    let mut states = start.to_vec();
    for _ in 0..2 {
        let mut next = states[states.len() - 6..].to_vec();
        next.chunks_mut(2).for_each(|z| (0..10).for_each(|_| kicked(z)));
        states.extend(next);
    }
    write_points(&folder.join("truth.npy"), &[3, 3, 2], &states).expect("written");
}

#[test]
fn a_polynomial_is_fitted_predicts_and_is_certified() {
    let folder = folder();
    let path = folder.path();
    write_files(path);
    let fitted = succeeds(path, &["fit", "--data", "pairs.npz", "--output", "map.json"]);
    let [said, shown] = [&fitted.stderr, &fitted.stdout].map(|bytes| text(bytes));
    assert!(said.starts_with("degree 2: 5 coefficients, a step errs by "), "{said}");
    assert!(said.contains("\"momenta\"") || said.contains("\"positions\""), "{said}");
    let command = "gyroceptron predict --model map.json --input POINTS.npy --steps 1000";
    assert!(
        shown.contains("a symplectic polynomial of degree ") && shown.contains(command),
        "{shown}"
    );
    assert!(shown.contains("40 held-out pairs"), "{shown}");
    let stored = load_polynomial(&path.join("map.json")).expect("read");
    let error = stored.provenance.validation.expect("held out").sqrt();
    assert!(error < 1e-15 && stored.provenance.data.is_some(), "{error:e}");
    // Other options give other maps, the same give the same file.
    let fit = |name: &str, more: &[&str]| -> Value {
        let words = ["fit", "--data", "pairs.npz", "--output", name, "--json"];
        let output = succeeds(path, &[&words[..], more].concat());
        serde_json::from_slice(&output.stdout).expect("one JSON document")
    };
    let again = fit("again.json", &["--threads", "1"]);
    let read = |name: &str| std::fs::read(path.join(name)).expect("a file");
    assert_eq!(read("again.json"), read("map.json"));
    assert_eq!(
        again["trials"].as_array().expect("trials").len(),
        said.matches(" coefficients").count() - usize::from(said.contains("half the coefficients"))
    );
    let whole = fit("whole.json", &["--degree", "6", "--validation", "0"]);
    assert_eq!((&whole["trials"][0]["parameters"], &whole["held_out"]), (&27.into(), &0.into()));
    assert!(whole["trials"][0]["held_out"].is_null());
    // A map that is odd, and reversible: terms of even degrees in both coordinates.
    let even = fit("even.json", &["--degree", "6", "--mirrored", "1"]);
    assert_eq!(even["trials"][0]["parameters"], 15);
    let other = fit("seed.json", &["--degree", "6", "--seed", "3"]);
    assert!(other["trials"][0]["held_out"] != again["trials"][4]["held_out"]);

    let predict = |input: &str, output: &str, more: &[&str]| {
        let words = ["predict", "--model", "map.json", "--input", input, "--output", output];
        succeeds(path, &[&words[..], more].concat())
    };
    let shown =
        predict("z.npy", "t.npy", &["--steps", "20", "--every", "10", "--compare", "truth.npy"]);
    assert!(text(&shown.stdout).contains("3 states of 3 trajectories"));
    let [states, truth] = ["t.npy", "truth.npy"].map(|name| last_numbers(&path.join(name), 18));
    let off = states.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
    assert!(off < 1e-13 && text(&shown.stdout).contains("after 20 steps"), "{off:e}");
    // The inverse leads back.
    write_points(&path.join("end.npy"), &[3, 2], &states[12..]).expect("written");
    predict("end.npy", "back.npy", &["--steps=-20", "--every", "20"]);
    let back = last_numbers(&path.join("back.npy"), 6);
    let off = back.iter().zip(&states).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
    assert!(off < 1e-13, "{off:e}");
    // A block is what a call for all gives there.
    predict("z.npy", "block.npy", &["--steps", "10", "--every", "10", "--block", "2/3"]);
    assert_eq!(last_numbers(&path.join("block.npy"), 2), states[8..10]);
    // Points outside of the box of the pairs are said, or stop it.
    write_points(&path.join("far.npy"), &[1, 2], &[0.75, 0.0]).expect("written");
    let warned = predict("far.npy", "far-out.npy", &["--steps", "2"]);
    assert!(text(&warned.stderr).contains("outside"), "{}", text(&warned.stderr));
    let words = ["predict", "--model", "map.json", "--input", "far.npy", "--output", "no.npy"];
    let stopped = call(path, &[&words[..], &["--steps", "2", "--outside", "stop"]].concat());
    assert!(stopped.status.code() == Some(1) && !path.join("no.npy").exists());
    // Far from them the polynomial has no image.
    write_points(&path.join("lost.npy"), &[2, 2], &[1e200, 0.0, 0.2, 0.1]).expect("written");
    let words = ["predict", "--model", "map.json", "--input", "lost.npy", "--output"];
    let lost = |more: &[&str]| call(path, &[&words[..], more, &["--steps", "5"]].concat());
    let said = lost(&["lost-5.npy"]);
    let note = text(&said.stderr);
    assert!(
        said.status.success() && note.contains("no finite image") && note.contains("row 0"),
        "{note}"
    );
    let states = last_numbers(&path.join("lost-5.npy"), 4);
    assert!(states[0].is_nan() && states[1].is_nan() && states[2..].iter().all(|v| v.is_finite()));
    assert_eq!(lost(&["no.npy", "--outside", "stop"]).status.code(), Some(1));
    assert!(!path.join("no.npy").exists());
    // What was lost elsewhere too is left out of a comparison, and nothing else.
    let same = lost(&["same.npy", "--compare", "lost-5.npy"]);
    assert!(text(&same.stdout).contains("0.00e0 at most, without 1 that are lost"), "{same:?}");
    write_points(&path.join("spoilt.npy"), &[2, 1, 2], &[f64::NAN, 0.0, 0.1, 0.1])
        .expect("written");
    let compare = ["predict", "--model", "map.json", "--input", "far.npy", "--output", "no.npy"];
    let compare = [&compare[..], &["--steps", "1", "--compare", "spoilt.npy"]].concat();
    refuses(path, &compare, &["spoilt.npy", "state 0 of trajectory 0"]);
    // More states than there is room for.
    let words = ["predict", "--model", "map.json", "--input", "z.npy", "--output", "huge.npy"];
    for steps in ["9000000000000000000", "40000000000000"] {
        refuses(path, &[&words[..], &["--steps", steps]].concat(), &["states to keep", "fewer"]);
    }

    let verified = succeeds(path, &["verify", "--model", "map.json", "--report", "page.html"]);
    let shown = text(&verified.stdout);
    assert!(shown.contains("map.json: holds: 4 laws") && shown.contains("] × ["), "{shown}");
    let page = std::fs::read_to_string(path.join("page.html")).expect("a page");
    assert!(page.contains("points each, within [-"), "{page}");
    let fit = ["fit", "--data", "pairs.npz", "--output", "r.json", "--reversor", "momenta"];
    succeeds(path, &[&fit[..], &["--degree", "8"]].concat());
    let verified = succeeds(path, &["verify", "--model", "r.json", "--json"]);
    let shown: Value = serde_json::from_slice(&verified.stdout).expect("one JSON document");
    assert_eq!(shown["certificate"]["rows"].as_array().expect("rows").len(), 6);
}

/// Held-out pairs that repeat inputs, too few different ones, and errors that are no map are said.
#[test]
fn fits_say_what_their_error_is_worth() {
    let folder = folder();
    let path = folder.path();
    write_files(path);
    let mut stream = Stream::new(6, "points");
    let few: Vec<f64> = (0..60).map(|_| stream.uniform(-0.6, 0.6)).collect();
    let input = few.repeat(20);
    let mut output = input.clone();
    output.chunks_mut(2).for_each(kicked);
    let noisy: Vec<f64> = output.iter().map(|v| v + stream.uniform(-0.05, 0.05)).collect();
    for (name, output) in [("repeated.npz", output), ("noisy.npz", noisy)] {
        let pairs = Pairs::new("pairs", 1, input.clone(), output).expect("pairs");
        write_pairs(&path.join(name), &pairs).expect("written");
    }
    let words = ["fit", "--output", "map.json", "--overwrite", "--data"];
    let fitted = succeeds(path, &[&words[..], &["repeated.npz", "--degree", "4"]].concat());
    let said = text(&fitted.stderr);
    assert!(said.contains("60 of 60 held-out pairs have inputs that fitted pairs have"), "{said}");
    let refused = [&words[..], &["repeated.npz", "--degree", "12"]].concat();
    refuses(path, &refused, &["repeated.npz", "30 different inputs"]);
    let fitted = succeeds(path, &[&words[..], &["noisy.npz", "--degree", "3"]].concat());
    let shown = text(&fitted.stdout);
    assert!(
        shown.contains("the map is not fit to follow orbits") && !shown.contains("next:"),
        "{shown}"
    );
}

/// The file that a prediction is compared with is not written over, and may begin elsewhere.
#[test]
fn predictions_are_compared_with_files_that_stay() {
    let folder = folder();
    let path = folder.path();
    write_files(path);
    succeeds(path, &["fit", "--data", "pairs.npz", "--output", "map.json", "--degree", "6"]);
    let truth = std::fs::read(path.join("truth.npy")).expect("there");
    let words = ["predict", "--model", "map.json", "--input", "z.npy", "--steps", "20"];
    let words = [&words[..], &["--every", "10", "--overwrite", "--output"]].concat();
    let same = [&words[..], &["truth.npy", "--compare", "truth.npy"]].concat();
    refuses(path, &same, &["--output", "truth.npy", "another file"]);
    assert!(std::fs::read(path.join("truth.npy")).expect("there") == truth);
    let shown = succeeds(path, &[&words[..], &["t.npy", "--compare", "truth.npy"]].concat());
    assert!(!text(&shown.stdout).contains("after 0 steps"));
    let mut moved = last_numbers(&path.join("truth.npy"), 18);
    moved[0] += 0.25;
    write_points(&path.join("moved.npy"), &[3, 3, 2], &moved).expect("written");
    let shown = succeeds(path, &[&words[..], &["t.npy", "--compare", "moved.npy"]].concat());
    let (said, shown) = (text(&shown.stderr), text(&shown.stdout));
    assert!(said.contains("moved.npy: the other trajectories do not begin at"), "{said}");
    assert!(shown.contains("after 0 steps 1.44e-1 (rms), 2.50e-1 at most"), "{shown}");
}

#[test]
fn what_cannot_be_fitted_or_predicted_is_refused() {
    let folder = folder();
    let path = folder.path();
    write_files(path);
    let words = ["fit", "--data", "pairs.npz", "--output", "map.json"];
    let fit = |more: &[&str], said: &[&str]| refuses(path, &[&words[..], more].concat(), said);
    for degree in ["1", "0", "-3", "40", "99999999999"] {
        fit(&["--degree", degree], &["degree", degree]);
    }
    fit(&["--mirrored", "2"], &["--mirrored", "mirrored plane", "2"]);
    fit(&["--mirrored", "0"], &["--mirrored"]);
    fit(&["--reversor", "both"], &["--reversor", "both", "positions"]);
    fit(&["--validation", "1"], &["validation", "--validation"]);
    fit(&["--validation", "0"], &["choose the degree"]);
    fit(&["--section", "missing.npz"], &["missing.npz"]);
    refuses(path, &["fit", "--data", "no.npz", "--output", "map.json"], &["no.npz"]);
    refuses(path, &["fit", "--data", "pairs.npz", "--output", "map.txt"], &["--output", ".json"]);
    refuses(path, &["fit", "--data", "pairs.npz"], &["--output"]);
    // Friction is no fault of the file: it is said, and the error with it.
    let words = ["fit", "--data", "friction.npz", "--output", "friction.json", "--degree", "6"];
    let fitted = succeeds(path, &words);
    let [said, shown] = [&fitted.stderr, &fitted.stdout].map(|bytes| text(bytes));
    assert!(said.contains("friction.npz: These pairs do not keep dq∧dp by 2.0e-2"), "{said}");
    assert!(shown.contains("errs by 4") || shown.contains("errs by 3"), "{shown}");
    refuses(path, &words, &["friction.json", "exists already"]);
    succeeds(path, &[&words[..], &["--overwrite"]].concat());
    let words = ["predict", "--model", "friction.json", "--input", "z.npy", "--output", "t.npy"];
    for (option, value) in
        [("--grid", "40"), ("--epsilon", "0.1"), ("--flow-time", "2"), ("--at", "planar=0.1")]
    {
        let more = [&words[..], &["--steps", "2", option, value]].concat();
        refuses(path, &more, &[option, "polynomial"]);
    }
    let more = [&words[..], &["--steps", "2", "--invariant", "i.npy"]].concat();
    refuses(path, &more, &["--invariant", "polynomial"]);
    let verify = ["verify", "--model", "friction.json", "--at", "planar=0.1"];
    refuses(path, &verify, &["--at", "no controls"]);
    // What is of networks alone says what it was given.
    let export = ["export", "--model", "friction.json", "--output", "map.c"];
    refuses(path, &export, &["friction.json", "gyroceptron-polynomial"]);
    let file = path.join("friction.json");
    let corrupt = std::fs::read_to_string(&file).expect("text").replacen("0.", "1.", 1);
    std::fs::write(&file, corrupt).expect("written");
    refuses(path, &[&words[..], &["--steps", "2"]].concat(), &["friction.json: digest"]);
}
