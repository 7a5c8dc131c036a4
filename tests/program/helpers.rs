//! Calling the program in a folder, and what it is given there.

use gyroceptron::flow::{Pairs, Window, sample};
use gyroceptron::io::{read_pairs, write_pairs, write_points};
use gyroceptron::random::Stream;
use gyroceptron::system::Oscillators;
use std::path::Path;
use std::process::{Command, Output};

pub fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gyroceptron"));
    command.current_dir(folder).args(arguments);
    command
}

pub fn call(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().expect("the program starts")
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

pub fn succeeds(folder: &Path, arguments: &[&str]) -> Output {
    let output = call(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    output
}

/// Status 2, one line on standard error with these words, nothing on standard
/// output, and no file made or changed.
pub fn refuses(folder: &Path, arguments: &[&str], words: &[&str]) {
    let before = listing(folder);
    let output = call(folder, arguments);
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
    // Beside notes of stages that were passed, which end with an ellipsis.
    let lines: Vec<_> = error.lines().filter(|line| !line.ends_with('…')).collect();
    assert_eq!(lines.len(), 1, "{arguments:?}: {error}");
    for word in words {
        assert!(error.contains(word), "{arguments:?} does not name {word}: {error}");
    }
    assert!(output.stdout.is_empty(), "{arguments:?}");
    assert_eq!(listing(folder), before, "{arguments:?}");
}

/// Names and contents of all files below a folder.
pub fn listing(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut out = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(current) = folders.pop() {
        for entry in std::fs::read_dir(&current).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.display().to_string();
                out.push((name, std::fs::read(&path).expect("readable")));
            }
        }
    }
    out.sort();
    out
}

pub const SCENE: &str = r#"
name = "small"
title = "A small scene"
seed = 3
flow_time = 0.5
plots = ["loss", "portrait", "adiabatic-invariant", "rollout-error"]

[system]
kind = "oscillators"
epsilon = 0.01

[data]
validation = 0.5
windows = [{ low = [-1.6, -1.6, -1.6, -1.6], high = [1.6, 1.6, 1.6, 1.6], samples = 400 }]

[[models]]
name = "gyroceptron"
network = { kind = "gyroceptron", psi = { count = 3, width = 4 }, near_identity = { count = 3, width = 4 } }
weights = { kind = "normal", scale = 0.15 }

[training]
iterations = 60
checkpoint_every = 10

[certificate]
samples = 20
radius = 1.6

[rollout]
steps = 100
every = 10
initial = [[1.5, 0.15, 0.0, 0.0], [1.5, 1.0, 0.0, 0.0]]
"#;

/// One start of a small normal form, for tests of messages and files that no error decides.
pub const SMALL: [&str; 6] = ["--starts", "1", "--kicks", "2x3", "--twists", "2x3"];

pub fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

pub fn with_scene(name: &str, scene: &str) -> tempfile::TempDir {
    let folder = folder();
    std::fs::write(folder.path().join(name), scene).expect("written");
    folder
}

pub fn write_data(folder: &Path) {
    let window = Window { low: vec![-1.6; 4], high: vec![1.6; 4], samples: 300 };
    let points = sample(&[window], 2, &mut Stream::new(1, "points")).expect("valid");
    let system = Oscillators { epsilon: 0.01 };
    let (pairs, _) = Pairs::of_flow(&system, points, 0.5).expect("converges");
    write_pairs(&folder.join("pairs.npz"), &pairs).expect("written");
    let start: Vec<f64> = pairs.input()[..12].to_vec();
    write_points(&folder.join("z.npy"), &[3, 4], &start).expect("written");
}

/// 128 times each number, without rounding.
pub fn times(values: &[f64]) -> Vec<f64> {
    values.iter().map(|v| 128.0 * v).collect()
}

/// pairs.npz as pairs, and large.npz: the same pairs, all numbers 128 times as large.
pub fn write_large_data(folder: &Path) -> Pairs {
    write_data(folder);
    let pairs = read_pairs(&folder.join("pairs.npz")).expect("pairs").pairs;
    let large = Pairs::new("large", 2, times(pairs.input()), times(pairs.output()));
    write_pairs(&folder.join("large.npz"), &large.expect("finite")).expect("written");
    pairs
}

/// The last numbers of an .npy file of float64.
pub fn last_numbers(file: &Path, count: usize) -> Vec<f64> {
    let bytes = std::fs::read(file).expect("an array");
    let of = |b: &[u8]| f64::from_le_bytes(b.try_into().expect("eight bytes"));
    bytes[bytes.len() - count * 8..].chunks_exact(8).map(of).collect()
}

/// A folder with pairs.npz, z.npy and a trained model.json.
pub fn with_model() -> tempfile::TempDir {
    let folder = folder();
    write_data(folder.path());
    succeeds(
        folder.path(),
        &[
            "train",
            "--data",
            "pairs.npz",
            "--circle-action",
            "1,0",
            "--output",
            "model.json",
            "--recipe",
            "paper",
            "--iterations",
            "12",
        ],
    );
    folder
}

/// A scene of two parts.
pub fn two_parts() -> String {
    let start = SCENE.find("[certificate]").expect("in the scene");
    let part = |name: &str, iterations: &str| {
        SCENE[..start]
            .replace("name = \"small\"", &format!("[[parts]]\nname = \"{name}\""))
            .replace(
                "plots = [\"loss\", \"portrait\", \"adiabatic-invariant\", \"rollout-error\"]",
                "",
            )
            .replace("iterations = 60", iterations)
            .replace("\n[[models]]", "\n[[parts.models]]")
            .replace("\n[system]", "\n[parts.system]")
            .replace("\n[data]", "\n[parts.data]")
            .replace("\n[training]", "\n[parts.training]")
    };
    let (short, long) = ("iterations = 100", "iterations = 3000");
    format!("name = \"both\"\n{}{}", part("first", short), part("second", long))
}
