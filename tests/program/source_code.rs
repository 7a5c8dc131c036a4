//! `export` of source code, as the guide shows it.

use crate::helpers::{last_numbers, refuses, succeeds, text, with_model};
use gyroceptron::io::write_points;
use std::process::Command;

/// The first block of this language in the guide's chapter.
fn block(language: &str) -> String {
    let chapter = include_str!("../../src/guide/source_code.md");
    let begin = format!("```{language}\n");
    let (_, rest) = chapter.split_once(&begin).expect("a block");
    rest.split("```").next().expect("its end").to_owned()
}

/// Runs a command of the guide, if its program is here.
fn run(folder: &std::path::Path, line: &str) -> Option<String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    if Command::new(words[0]).arg("--version").output().is_err() && !words[0].starts_with("./") {
        println!("no {} is here: its block of the guide is not run", words[0]);
        return None;
    }
    let program = match words[0].strip_prefix("./") {
        Some(own) => folder.join(own),
        None => words[0].into(),
    };
    let done = Command::new(program).current_dir(folder).args(&words[1..]).output();
    let done = done.expect("it runs");
    // The program says by its status whether the last state is inside.
    assert!(matches!(done.status.code(), Some(0 | 1)), "{line}: {}", text(&done.stderr));
    assert!(done.stderr.is_empty(), "{line}: {}", text(&done.stderr));
    Some(text(&done.stdout))
}

#[test]
fn the_guides_programs_move_a_point_as_predict_does() {
    let folder = with_model();
    let path = folder.path();
    let said = succeeds(path, &["export", "--model", "model.json", "--output", "ring.c"]);
    assert!(text(&said.stdout).starts_with("ring.c, ring.h, ring.f90"), "{}", text(&said.stdout));
    write_points(&path.join("z.npy"), &[1, 4], &[0.8, 0.3, 0.0, 0.0]).expect("written");
    let steps = ["--steps", "100000", "--every", "100000"];
    let predict = ["predict", "--model", "model.json", "--input", "z.npy", "--output", "t.npy"];
    succeeds(path, &[&predict[..], &steps].concat());
    let end = last_numbers(&path.join("t.npy"), 4);
    std::fs::write(path.join("main.c"), block("c")).expect("written");
    std::fs::write(path.join("main.f90"), block("fortran")).expect("written");
    let commands = block("text");
    let mut lines = commands.lines();
    for line in lines.by_ref() {
        if run(path, line).is_none() {
            return;
        }
    }
    let output = run(path, "./main").expect("it is here");
    let numbers: Vec<f64> = output
        .lines()
        .next()
        .expect("a line")
        .split(' ')
        .map(|v| v.parse().expect("a number"))
        .collect();
    assert_eq!(numbers, end[..2]);
    assert!(output.contains("the invariant moved by"), "{output}");
    let fortran = "gfortran ring.f90 main.f90 ring.o -o main -lm";
    assert!(include_str!("../../src/guide/source_code.md").contains(fortran));
    write_points(&path.join("z.npy"), &[1, 4], &[0.8, 0.0, 0.0, 0.0]).expect("written");
    succeeds(path, &[&predict[..], &steps, &["--overwrite"]].concat());
    let end = last_numbers(&path.join("t.npy"), 4);
    if run(path, fortran).is_none() {
        return;
    }
    let output = run(path, "./main").expect("it is here");
    let numbers: Vec<f64> =
        output.split_whitespace().map(|v| v.parse().expect("a number")).collect();
    assert_eq!(numbers[..4], end);
}

#[test]
fn bad_exports_write_nothing() {
    let folder = with_model();
    let path = folder.path();
    let export = |more: &[&'static str]| -> Vec<&'static str> {
        [&["export", "--model", "model.json"], more].concat()
    };
    let expect = |more: &[&'static str], words: &[&str]| refuses(path, &export(more), words);
    expect(&["--output", "a-b.c"], &["a-b", "letter"]);
    expect(&["--output", "m.py", "--format", "c"], &["--output", ".c"]);
    expect(&["--output", "m.npz", "--epsilon", "0.1"], &["--epsilon", "0.1"]);
    expect(&["--output", "m.h"], &["--output", ".c or .py"]);
    expect(&["--output", "jax.py"], &["jax", "hides no other module"]);
    expect(&["--output", "m.c", "--at", "k=1"], &["--at", "no controls"]);
    expect(&["--output", "m.c", "--flow-time", "-1"], &["flow_time", "-1"]);
    // A member says of which family it is.
    succeeds(path, &export(&["--output", "member.c", "--epsilon", "0.02"]));
    let member = std::fs::read_to_string(path.join("member.c")).expect("written");
    assert!(
        member.contains("It is a member (epsilon 0.02) of the model with the digest"),
        "{member}"
    );
    // The header is no file to replace.
    std::fs::write(path.join("m.h"), "mine").expect("written");
    expect(&["--output", "m.c"], &["m.h"]);
    succeeds(path, &export(&["--output", "m.c", "--overwrite"]));
    let json = succeeds(path, &export(&["--output", "n.py", "--json"]));
    let json: serde_json::Value = serde_json::from_slice(&json.stdout).expect("JSON");
    assert_eq!(json["files"][0], "n.py");
    assert_eq!(json["digest"].as_str().map(str::len), Some(64));
    let python = std::fs::read_to_string(path.join("n.py")).expect("written");
    assert!(python.contains("import jax"), "{python}");
    // A broken model is no map.
    let model = std::fs::read_to_string(path.join("model.json")).expect("a model");
    std::fs::write(path.join("broken.json"), &model[..model.len() / 2]).expect("written");
    refuses(path, &["export", "--model", "broken.json", "--output", "b.c"], &["broken.json"]);
}
