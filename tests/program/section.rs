//! Pairs of a surface of section whose area form is not dq∧dp: from a file of its density to predictions.

use crate::helpers::{call, folder, refuses, succeeds, text};
use gyroceptron::flow::{LineMap, Pairs};
use gyroceptron::io::{
    load_model, read_points, read_section, read_trajectories, write_pairs, write_points,
    write_section,
};
use gyroceptron::phase::AreaDensity;
use gyroceptron::scalar::{Elementary, max_or_nan};
use gyroceptron::system::{CoilField, Torsatron};
use std::f64::consts::TAU;
use std::path::Path;

/// R and Z of the box of the section.
const LOW: [f64; 2] = [3.8, -0.35];
const HIGH: [f64; 2] = [4.1, 0.35];

/// Pairs of field lines of a torsatron over a period in pairs.npz, B_φ on a grid in section.npz, a density that is
/// uniform in uniform.npz, and two points in z.npy.
fn write_files(folder: &Path) -> Pairs {
    let coils = Torsatron::default().coils().expect("sound").all().expect("coils");
    let field = CoilField::new(&coils, 60).expect("a field");
    let map = LineMap::new(&field, 0.0, TAU / 10.0, 16).expect("a map");
    let [r, z] = map.axis([3.95, 0.0]).expect("an axis");
    let lines = 8;
    let start: Vec<f64> = (1..=lines).flat_map(|k| [r + 0.008 * k as f64, z]).collect();
    let after = map.trajectories(&start, 50).expect("lines");
    let all = [start, after].concat();
    let row = 2 * lines;
    let pairs = Pairs::new("lines", 1, all[..50 * row].to_vec(), all[row..].to_vec());
    let pairs = pairs.expect("pairs");
    write_pairs(&folder.join("pairs.npz"), &pairs).expect("written");
    let grid = |axis: usize| -> Vec<f64> {
        let at = |k: usize| LOW[axis] + (HIGH[axis] - LOW[axis]) * k as f64 / 40.0;
        (0..=40).map(at).collect()
    };
    let (x, y) = (grid(0), grid(1));
    let at = |y: f64| x.iter().map(move |x| (*x, y)).collect::<Vec<_>>();
    let toroidal = |(x, y): (f64, f64)| field.cylindrical(x, 0.0, y)[1];
    let density: Vec<f64> = y.iter().flat_map(|y| at(*y)).map(toroidal).collect();
    let scale = density[density.len() / 2];
    write_section(&folder.join("section.npz"), &x, &y, &density, scale, &[]).expect("written");
    let ones = vec![1.0; density.len()];
    write_section(&folder.join("uniform.npz"), &x, &y, &ones, 1.0, &[]).expect("written");
    write_points(&folder.join("z.npy"), &[2, 2], &pairs.input()[..4]).expect("written");
    pairs
}

const TRAIN: [&str; 12] = [
    "train",
    "--data",
    "pairs.npz",
    "--circle-action",
    "1",
    "--kicks",
    "3x1^4",
    "--twists",
    "1x1^3",
    "--starts",
    "1",
    "--iterations=25",
];

fn train<'a>(more: &[&'a str]) -> Vec<&'a str> {
    TRAIN.iter().chain(more).copied().collect()
}

#[test]
fn a_section_is_charted_and_its_points_are_predicted() {
    let folder = folder();
    let folder = folder.path();
    let pairs = write_files(folder);
    let trained = succeeds(folder, &train(&["--section", "section.npz", "--output", "model.json"]));
    let said = text(&trained.stderr);
    assert!(said.contains("x1 … xn, y1 … yn of a section"), "{said}");
    assert!(!said.contains("do not keep"), "{said}");
    let report = std::fs::read_to_string(folder.join("model-report/report.md")).expect("a report");
    assert!(report.contains("--section section.npz"), "{report}");
    assert!(report.contains("of a section") && !report.contains("do not keep"), "{report}");
    let label = "in the canonical coordinates of the section";
    assert!(report.contains(label) && !report.contains("(rms, in units of the data)"), "{report}");

    let predict = ["predict", "--model", "model.json", "--input", "z.npy", "--steps", "3"];
    let both: Vec<&str> = predict.iter().chain(&["--output", "t.npy"]).copied().collect();
    succeeds(folder, &both);
    let states = read_trajectories(&folder.join("t.npy"), 1).expect("states");
    assert_eq!((states.states(), states.count()), (4, 2));
    // Two neighbouring lines, one state of all lines after another.
    let expected = |t: usize, m: usize| &pairs.output()[2 * (8 * (t - 1) + m)..][..2];
    let mut error = 0.0;
    for t in 1..4 {
        for m in 0..2 {
            let both = states.state(t, m).iter().zip(expected(t, m));
            error = both.map(|(a, b)| (a - b).abs()).fold(error, max_or_nan);
        }
    }
    assert!(error < 1e-3, "{error}");
    assert_eq!(
        states.state(0, 1),
        &read_points(&folder.join("z.npy"), 1).expect("read").points[2..]
    );
    let verified = succeeds(folder, &["verify", "--model", "model.json", "--samples", "20"]);
    let said = text(&verified.stderr);
    assert!(said.contains("areas are kept as well as its density is known"), "{said}");

    // A polynomial in the same chart, without training; without the chart it errs.
    let fit = ["fit", "--data", "pairs.npz", "--degree", "6", "--output"];
    let charted = [&fit[..], &["polynomial.json", "--section", "section.npz"]].concat();
    let said = text(&succeeds(folder, &charted).stderr);
    assert!(!said.contains("do not keep") && !said.contains("the network"), "{said}");
    let said = text(&succeeds(folder, &[&fit[..], &["plain.json"]].concat()).stderr);
    assert!(said.contains("do not keep dq∧dp"), "{said}");
    let error_of = |model: &str| {
        let words = ["predict", "--model", model, "--input", "z.npy", "--steps", "3"];
        succeeds(folder, &[&words[..], &["--output", "p.npy", "--overwrite"]].concat());
        let states = read_trajectories(&folder.join("p.npy"), 1).expect("states");
        let places = (1..4).flat_map(|t| [0, 1].map(|m| (t, m)));
        let both = places.flat_map(|(t, m)| {
            let (own, other) = (states.state(t, m).to_vec(), expected(t, m).to_vec());
            own.into_iter().zip(other).map(|(a, b)| (a - b).abs()).collect::<Vec<_>>()
        });
        both.fold(0.0, max_or_nan)
    };
    let [own, plain] = ["polynomial.json", "plain.json"].map(error_of);
    assert!(own < 1e-5 && plain > 10.0 * own, "{own:e} {plain:e}");
    let verified = succeeds(folder, &["verify", "--model", "polynomial.json"]);
    assert!(text(&verified.stdout).contains("canonical coordinates of its section"));

    // Of the model itself: there and back, exact derivatives, the flux.
    let stored = load_model(&folder.join("model.json")).expect("a model");
    let chart = stored.section.as_ref().expect("a section").planes()[0].as_ref().expect("a chart");
    let density = |z: &[f64]| chart.density(z[0], z[1]);
    let start = pairs.input()[4..6].to_vec();
    let mut z = start.clone();
    stored.map_points(gyroceptron::phase::Direction::Forward, &mut z).expect("an image");
    let jacobian = stored.jacobians(&start).expect("a Jacobian");
    let determinant = jacobian[0] * jacobian[3] - jacobian[1] * jacobian[2];
    let flux = determinant * density(&z) / density(&start);
    assert!((flux - 1.0).abs() < 1e-12, "{flux}");
    assert!((determinant - 1.0).abs() > 1e-5, "{determinant}");
    for k in 0..2 {
        let h = 1e-6;
        let moved = [h, -h].map(|h| {
            let mut z = start.clone();
            z[k] += h;
            stored.map_points(gyroceptron::phase::Direction::Forward, &mut z).expect("an image");
            z
        });
        for row in 0..2 {
            let slope = (moved[0][row] - moved[1][row]) / (2.0 * h);
            assert!((slope - jacobian[2 * row + k]).abs() < 1e-7, "{slope} {jacobian:?}");
        }
    }
    stored.map_points(gyroceptron::phase::Direction::Inverse, &mut z).expect("back");
    assert!(z.iter().zip(&start).all(|(a, b)| (a - b).abs() < 1e-12), "{z:?} {start:?}");
    assert!(stored.invariant().expect("one")(&start).is_finite());

    // A density that was edited, tensors without it, points beyond it.
    let file = std::fs::read_to_string(folder.join("model.json")).expect("read");
    let edited = file.replacen("\"scale\": 2.", "\"scale\": 3.", 1);
    assert_ne!(edited, file);
    std::fs::write(folder.join("edited.json"), edited).expect("written");
    let edited = [
        "predict",
        "--model",
        "edited.json",
        "--input",
        "z.npy",
        "--steps",
        "1",
        "--output",
        "u.npy",
    ];
    refuses(folder, &edited, &["edited.json", "digest"]);
    let export = ["export", "--model", "model.json", "--output", "weights.npz"];
    refuses(folder, &export, &["section"]);
    write_points(&folder.join("far.npy"), &[1, 2], &[5.0, 0.0]).expect("written");
    let far = [
        "predict",
        "--model",
        "model.json",
        "--input",
        "far.npy",
        "--steps",
        "1",
        "--output",
        "u.npy",
    ];
    refuses(folder, &far, &["(5, 0)", "points of the section"]);
}

/// `train` says so of another density than that of the pairs, and of pairs without one.
#[test]
fn pairs_that_keep_no_area_are_reported() {
    let folder = folder();
    let folder = folder.path();
    write_files(folder);
    let quick = ["--iterations=1", "--overwrite", "--output", "model.json"];
    for (section, words) in [
        (&["--section", "uniform.npz"][..], "do not keep the area of the section"),
        (&[][..], "do not keep dq∧dp"),
    ] {
        let arguments: Vec<&str> =
            TRAIN[..11].iter().chain(section).chain(&quick).copied().collect();
        let said = text(&succeeds(folder, &arguments).stderr);
        assert!(said.contains(words), "{said}");
        let report = folder.join("model-report");
        let report = std::fs::read_to_string(report.join("report.md")).expect("a report");
        assert!(report.contains(words), "{report}");
    }
    // With weights that err little the verdict is on single steps.
    for (section, expected) in [
        ("uniform.npz", "for single steps among the inputs of the pairs, not for long orbits"),
        ("section.npz", "yes, among the inputs of the pairs"),
    ] {
        let more = ["--section", section, "--overwrite", "--output", "model.json"];
        let said = text(&succeeds(folder, &train(&more)).stdout);
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(said.contains(expected), "{said}");
        assert_eq!(said.contains("change areas by"), section == "uniform.npz", "{said}");
    }
}

/// A line that leaves the box of the section is NaN from there on, and the others are as without it.
#[test]
fn lines_that_leave_the_section_are_nan() {
    let folder = folder();
    let folder = folder.path();
    let pairs = write_files(folder);
    succeeds(folder, &train(&["--section", "section.npz", "--output", "model.json"]));
    let fit = ["fit", "--data", "pairs.npz", "--section", "section.npz", "--degree", "7"];
    succeeds(folder, &[&fit[..], &["--output", "polynomial.json"]].concat());
    // Near the corner of the box, and by itself.
    let (inside, outside) = (&pairs.input()[..2], [HIGH[0] - 1e-3, HIGH[1] - 1e-3]);
    write_points(&folder.join("two.npy"), &[2, 2], &[inside, &outside].concat()).expect("written");
    write_points(&folder.join("one.npy"), &[1, 2], inside).expect("written");
    let predict = |model: &str, input: &str, more: &[&str]| {
        let words = ["predict", "--model", model, "--input", input, "--steps", "40"];
        let all = [&words[..], &["--output", "out.npy", "--overwrite"], more].concat();
        call(folder, &all)
    };
    for model in ["model.json", "polynomial.json"] {
        let found = predict(model, "one.npy", &[]);
        assert_eq!(found.status.code(), Some(0), "{}", text(&found.stderr));
        let alone = read_trajectories(&folder.join("out.npy"), 1).expect("finite");
        let found = predict(model, "two.npy", &[]);
        let said = text(&found.stderr);
        assert_eq!(found.status.code(), Some(0), "{model}: {said}");
        assert!(
            said.contains("outside the box of the section") && said.contains("rows 1"),
            "{said}"
        );
        let states = npy_values(&folder.join("out.npy"));
        assert_eq!(states.len(), 41 * 4);
        let mut lost = false;
        for t in 0..41 {
            let row = &states[4 * t..4 * t + 4];
            assert_eq!(&row[..2], alone.state(t, 0), "{model}, {t}");
            assert_eq!(row[2].is_nan(), row[3].is_nan());
            // Once lost it stays lost.
            assert!(!lost || row[2].is_nan(), "{model}, {t}");
            lost |= row[2].is_nan();
        }
        assert!(lost, "{model}");
        std::fs::remove_file(folder.join("out.npy")).expect("removed");
        let stopped = predict(model, "two.npy", &["--outside", "stop"]);
        assert_eq!(stopped.status.code(), Some(1), "{}", text(&stopped.stderr));
        assert!(!folder.join("out.npy").exists());
    }
}

/// The numbers of an array file, whatever they are.
fn npy_values(path: &Path) -> Vec<f64> {
    let bytes = std::fs::read(path).expect("a file");
    let size = bytes.len() as u64;
    gyroceptron::io::internals::read_array("out.npy", &mut &bytes[..], size)
        .expect("an array")
        .values
}

#[test]
fn bad_sections_are_refused() {
    let folder = folder();
    let folder = folder.path();
    let pairs = write_files(folder);
    let with = |file: &'static str| train(&["--section", file, "--output", "model.json"]);
    refuses(folder, &with("absent.npz"), &["absent.npz"]);
    refuses(folder, &with("pairs.npz"), &["pairs.npz: x", "input"]);
    let axis: Vec<f64> = (0..10).map(f64::from).collect();
    let mut density = vec![1.0; 100];
    write_section(&folder.join("elsewhere.npz"), &axis, &axis, &density, 1.0, &[])
        .expect("written");
    let z = pairs.input().chunks(2).find(|z| z[1] < 0.0).expect("below the middle");
    refuses(folder, &with("elsewhere.npz"), &["pairs.npz: input", &z[1].to_string()]);
    density[42] = 0.0;
    write_section(&folder.join("zero.npz"), &axis, &axis, &density, 1.0, &[]).expect("written");
    refuses(folder, &with("zero.npz"), &["zero.npz", "(2, 4)", "positive"]);
    write_section(&folder.join("scale.npz"), &axis, &axis, &[1.0; 100], -1.0, &[])
        .expect("written");
    refuses(folder, &with("scale.npz"), &["scale.npz", "scale"]);
}

/// ρ at a value of the control, linear in it.
fn density_at(control: f64, x: f64, y: f64) -> f64 {
    1.0 + 0.3 * x + 0.2 * y * y + control * (0.2 * x * y + 0.15 * y)
}

/// Turns in the chart of that density, faster outside: pairs of data and their images.
fn turns(control: f64, points: &[f64]) -> Vec<f64> {
    let chart = |x: f64, y: f64| density_at(control, x, y);
    let chart = AreaDensity::of_function(chart, [-1.0; 2], [1.0; 2], 1.0).expect("positive");
    let image = |z: &[f64]| {
        let [q, p] = chart.to_canonical([z[0], z[1]]);
        let angle = 1.4 + 0.1 * control + 0.3 * (q * q + p * p);
        let (s, c) = Elementary::sin_cos(angle);
        chart.to_data([c * q + s * p, c * p - s * q])
    };
    points.chunks_exact(2).flat_map(image).collect()
}

/// A density at several values of a control, in one file: pairs at these values keep its area, and predictions between
/// them are right; a density that is the same at all values is found out.
#[test]
fn a_density_may_depend_on_controls() {
    let folder = folder();
    let folder = folder.path();
    let (values, count) = ([-1.0, -0.5, 0.0, 0.5, 1.0], 80);
    let mut stream = gyroceptron::random::Stream::new(1, "points");
    let mut draw = |count: usize| -> Vec<f64> {
        (0..2 * count).map(|_| stream.uniform(-0.45, 0.45)).collect()
    };
    let inputs: Vec<Vec<f64>> = values.iter().map(|_| draw(count)).collect();
    let both = values.iter().zip(&inputs);
    let outputs: Vec<f64> = both.flat_map(|(control, points)| turns(*control, points)).collect();
    let rows: Vec<f64> = values.iter().flat_map(|value| vec![*value; count]).collect();
    let ones = vec![1.0; rows.len()];
    let pairs = Pairs::new("turns", 1, inputs.concat(), outputs).expect("pairs");
    let pairs = pairs.under_controls(&ones, &ones, &rows).expect("values");
    write_pairs(&folder.join("pairs.npz"), &pairs).expect("written");

    let axis: Vec<f64> = (0..17).map(|k| f64::from(k) / 8.0 - 1.0).collect();
    let grid = |control: f64| -> Vec<f64> {
        let row = |y: f64| axis.iter().map(move |x| density_at(control, *x, y));
        axis.iter().flat_map(|y| row(*y)).collect()
    };
    let write = |name: &str, density: &[f64], controls: &[&[f64]]| {
        write_section(&folder.join(name), &axis, &axis, density, 1.0, controls).expect("written");
    };
    // Other values than those of the pairs, in no order.
    let table = [grid(1.0), grid(-0.2), grid(0.6)].concat();
    write("section.npz", &table, &[&[1.0], &[-0.2], &[0.6]]);
    write("one.npz", &grid(0.0), &[]);
    let read = read_section(&folder.join("section.npz")).expect("read");
    assert!(read.error() < 1e-13, "{}", read.error());
    let there = read.at_controls(&[-0.7]).expect("one control");
    let there = there.planes()[0].as_ref().expect("a chart");
    assert!((there.density(0.3, 0.8) - density_at(-0.7, 0.3, 0.8)).abs() < 1e-13);

    let named = |section: &'static str, model: &'static str| {
        let more = ["--controls", "a", "--section", section, "--output", model];
        text(&succeeds(folder, &train(&more)).stderr)
    };
    let said = named("section.npz", "model.json");
    assert!(said.contains("linear in the control") && !said.contains("do not keep"), "{said}");
    let said = named("one.npz", "one.json");
    assert!(said.contains("do not keep the area"), "{said}");

    let start = draw(20);
    write_points(&folder.join("start.npy"), &[20, 2], &start).expect("written");
    let mut expected = start.clone();
    (0..3).for_each(|_| expected = turns(0.25, &expected));
    let error_of = |model: &str| {
        let words = ["predict", "--model", model, "--at", "a=0.25", "--input", "start.npy"];
        let more = ["--steps", "3", "--output", "end.npy", "--overwrite"];
        succeeds(folder, &[&words[..], &more[..]].concat());
        let found = read_trajectories(&folder.join("end.npy"), 1).expect("states");
        let last = &found.values()[3 * 40..];
        last.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan)
    };
    // Without values a model is asked in the middle of the ranges, in the chart there.
    let stored = load_model(&folder.join("model.json")).expect("a model");
    let request = gyroceptron::network::Rollout { steps: 2, every: 1 };
    let middle = stored.at_controls(&[0.0]).expect("one control");
    assert_eq!(
        stored.rollout(&start, request).expect("states"),
        middle.rollout(&start, request).expect("states")
    );
    let [own, other] = ["model.json", "one.json"].map(error_of);
    assert!(own < 1e-5 && other > 100.0 * own, "{own:e} {other:e}");

    // The degree is that of the changes, not of the density between them, which is 1 here.
    let waves = |control: f64| -> Vec<f64> {
        let row = |_: &f64| axis.iter().map(move |x| 1.0 + 0.1 * control * (4.0 * x).cos());
        axis.iter().flat_map(row).collect()
    };
    write("waves.npz", &[waves(-1.0), waves(1.0)].concat(), &[&[-1.0], &[1.0]]);
    let read = read_section(&folder.join("waves.npz")).expect("read");
    let there =
        read.at_controls(&[0.5]).expect("one control").planes()[0].clone().expect("a chart");
    let expected = 1.0 + 0.05 * 1.2_f64.cos();
    assert!(read.error() < 1e-3, "{}", read.error());
    assert!((there.density(0.3, 0.8) - expected).abs() < 2.0 * read.error(), "{}", read.error());

    // What is wrong with a file of several densities is said.
    let with =
        |file: &'static str| train(&["--controls", "a", "--section", file, "--output", "no.json"]);
    write("same.npz", &[grid(0.5), grid(0.5)].concat(), &[&[0.5], &[0.5]]);
    refuses(folder, &with("same.npz"), &["same.npz", "lambda", "slope"]);
    write(
        "two.npz",
        &[grid(0.0), grid(1.0), grid(0.5)].concat(),
        &[&[0.0, 1.0], &[1.0, 0.0], &[0.5, 0.7]],
    );
    refuses(folder, &with("two.npz"), &["controls of a section", "2", "1"]);
    let mut bad = table.clone();
    bad[17 * 17 + 3] = -1.0;
    write("bad.npz", &bad, &[&[1.0], &[-0.2], &[0.6]]);
    refuses(
        folder,
        &with("bad.npz"),
        &["bad.npz", "(-0.625, -1)", "of grid 1 (counted from 0)", "positive"],
    );
    // A density of other pairs, which have no controls.
    let plain = Pairs::new("turns", 1, inputs[2].clone(), turns(0.0, &inputs[2])).expect("pairs");
    write_pairs(&folder.join("pairs.npz"), &plain).expect("written");
    let words = train(&["--section", "section.npz", "--output", "no.json"]);
    refuses(folder, &words, &["controls of a section", "1", "0"]);
    let none: [&[f64]; 1] = [&[]];
    assert!(write_section(&folder.join("no.npz"), &axis, &axis, &grid(0.0), 1.0, &none).is_err());
    assert!(!folder.join("no.json").exists());
}

/// A scene on pairs of a section trains what `train --section` trains, and compares orbits in canonical coordinates.
#[test]
fn a_scene_is_on_pairs_of_a_section() {
    let folder = folder();
    let folder = folder.path();
    let pairs = write_files(folder);
    let lines = 8;
    let states = [&pairs.input()[..2 * lines], pairs.output()].concat();
    write_points(&folder.join("t.npy"), &[51, 8, 2], &states).expect("written");
    let scene = r#"
name = "own"
seed = 0
flow_time = 1.0
plots = ["portrait", "prediction"]

[data]
pairs = "pairs.npz"
section = "section.npz"
trajectories = "t.npy"

[training]
iterations = 25
loss = { kind = "by-plane" }
optimiser = { kind = "levenberg-marquardt" }
starts = { count = 1, iterations = 40 }

[rollout]
steps = 50
every = 1

[[models]]
name = "form"
network = { kind = "normal-form", kicks = { count = 3, width = 1, degree = 4 }, twists = { count = 1, width = 1, degree = 3 } }
weights = { kind = "normal", scale = 0.15 }
"#;
    std::fs::write(folder.join("own.toml"), scene).expect("written");
    succeeds(folder, &["run", "own.toml", "--out", "out"]);
    let report = std::fs::read_to_string(folder.join("out/report.md")).expect("a report");
    let label = "in the canonical coordinates of the section";
    assert!(report.contains(&format!("Errors by component, {label}")), "{report}");
    assert!(!report.contains("units of the data\n") && !report.contains("do not keep"), "{report}");
    let data = std::fs::read(folder.join("out/report.json")).expect("data");
    let data: serde_json::Value = serde_json::from_slice(&data).expect("JSON");

    let train = [&["--section", "section.npz", "--flow-time", "1", "--seed", "0"][..]].concat();
    let train = [&train[..], &["--plateau", "0", "--output", "model.json"]].concat();
    succeeds(folder, &self::train(&train));
    let [of_train, of_scene] = ["model.json", "out/model.json"]
        .map(|name| load_model(&folder.join(name)).expect("a model"));
    assert_eq!(of_train.model.parameters(), of_scene.model.parameters());
    assert_eq!(of_train.section, of_scene.section);
    assert_eq!(of_train.units, of_scene.units);
    assert_eq!(of_train.provenance.region, of_scene.provenance.region);

    // The orbits of the model, in the columns of the data, taken to the chart.
    let section = of_scene.section.as_ref().expect("a section");
    let request = gyroceptron::network::Rollout { steps: 50, every: 1 };
    let mut own = of_scene.rollout(&states[..2 * lines], request).expect("within the chart");
    let mut truth = states.clone();
    section.to_canonical(&mut own);
    section.to_canonical(&mut truth);
    for k in 0..2 {
        let errors = own.iter().zip(&truth).skip(2 * lines + k).step_by(2);
        let squares: f64 = errors.map(|(a, b)| (a - b) * (a - b)).sum();
        let rms = (squares / (50 * lines) as f64).sqrt();
        let said = data["studies"]["rollout"]["component_errors"][0]["rms"][k].as_f64();
        let said = said.expect("a number");
        assert!((said / rms - 1.0).abs() < 1e-9 && rms < 0.1, "{said:e} {rms:e}");
    }

    // Without the section the pairs keep no area, which counts against long orbits.
    std::fs::write(folder.join("plain.toml"), scene.replace("section = \"section.npz\"\n", ""))
        .expect("written");
    succeeds(folder, &["run", "plain.toml", "--out", "plain"]);
    let plain = std::fs::read_to_string(folder.join("plain/report.md")).expect("a report");
    assert!(plain.contains("do not keep dq∧dp"), "{plain}");
    // Orbits beyond the section, a density of controls, and studies of canonical coordinates.
    let mut far = states;
    far[0] = 9.0;
    write_points(&folder.join("far.npy"), &[51, 8, 2], &far).expect("written");
    std::fs::write(folder.join("far.toml"), scene.replace("t.npy", "far.npy")).expect("written");
    refuses(folder, &["run", "far.toml", "--out", "far"], &["far.npy"]);
    let axes = [LOW, HIGH]
        .map(|ends| (0..12).map(|k| ends[0] + (ends[1] - ends[0]) * f64::from(k) / 11.0).collect());
    let [x, y]: [Vec<f64>; 2] = axes;
    let density = vec![1.0; 2 * x.len() * y.len()];
    write_section(&folder.join("controls.npz"), &x, &y, &density, 1.0, &[&[0.0], &[1.0]])
        .expect("written");
    let of_controls = scene.replace("section.npz", "controls.npz");
    std::fs::write(folder.join("controls.toml"), of_controls).expect("written");
    refuses(folder, &["run", "controls.toml", "--out", "c"], &["controls.npz", "controls"]);
    let tunes = "[frequency_map]\nlow = [0.0, 0.0]\nhigh = [1.0, 1.0]\npoints = [4, 4]\nmaps = 100\n\n[[models]]";
    std::fs::write(folder.join("tunes.toml"), scene.replace("[[models]]", tunes)).expect("written");
    refuses(folder, &["run", "tunes.toml", "--out", "t"], &["frequency_map", "pairs of a section"]);
}
