//! The scene of field lines of coils: of built-in coils and of a file, its report, its model, and what it refuses.

use crate::helpers::{call, folder, refuses, succeeds, text};
use gyroceptron::flow::{LineRequest, LineSection};
use gyroceptron::io::{StoredModel, load_model, read_trajectories, write_points};
use gyroceptron::layer::Reversor;
use gyroceptron::measure::orbits::lyapunov_exponent;
use gyroceptron::network::Rollout;
use gyroceptron::scalar::max_or_nan;
use gyroceptron::scene::{Event, Folder, Observer, parse, run};
use gyroceptron::system::{Coil, CoilSet, Tokamak, Torsatron};
use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;

/// A scene of seconds.
fn scene(coils: &str) -> String {
    format!(
        r#"
name = "lines"
seed = 1
flow_time = 1.0
plots = ["poincare", "rotation", "off-surface", "edge", "manifolds"]
[data]
validation = 0.25
orbit = 48
lines = {{ coils = {coils}, lines = 24, reach = 0.05, error = 1e-6 }}
[training]
iterations = 40
ramp = [{{ degree = 3, iterations = 20 }}]
optimiser = {{ kind = "levenberg-marquardt" }}
[poincare]
lines = 3
early = 10
reference = 200
reference_planes = {{ degree = 10 }}
counts = [200, 2000]
last = 20
profile = 8
orbits = 20
rounds = 1
polynomials = [6]
symplectic_polynomials = [8]
reversible_polynomials = [9]
planes = [{{ fewer = 2, degree = 6 }}]
tracing = [2, 1]
[poincare.edge]
from = 0.02
to = 0.045
lines = 6
survival = 400
wall = 0.1
exponents = 200
manifold = 0.02
[[models]]
name = "jolts"
network = {{ kind = "normal-form", kicks = {{ count = 3, width = 1, degree = 6 }}, twists = {{ count = 1, width = 1, degree = 4 }}, perturbation = {{ count = 4, width = 1, degree = 6 }} }}
weights = {{ kind = "normal", scale = 0.15 }}
"#
    )
}

/// The scene without its study and figures.
fn training_alone(scene: &str) -> String {
    let (before, rest) = scene.split_once("[poincare]").expect("a study");
    let (_, models) = rest.split_once("[[models]]").expect("a network");
    let (head, training) = before.split_once("plots").expect("figures");
    let (_, training) = training.split_once('\n').expect("a line");
    format!("{head}{training}[[models]]{models}")
}

/// A model beside the others.
const REVERSIBLE: &str = r#"
[[models]]
name = "reversible"
network = { kind = "normal-form", reversor = "positions", kicks = { count = 3, width = 1, degree = 6 }, twists = { count = 1, width = 1, degree = 4 }, perturbation = { count = 0, width = 1 } }
weights = { kind = "normal", scale = 0.15 }
"#;

/// The coils of the torsatron whose images under turns by a period are all of them: a winding, whose image is the
/// other, and the rings.
fn of_a_period() -> Vec<Coil> {
    let mut coils = Torsatron::default().coils().expect("sound").coils;
    coils.remove(1);
    coils
}

/// These coils as a file has them.
fn write_coils(path: &Path) -> Vec<f64> {
    let coils = of_a_period();
    write_modes(path, &coils);
    coils.iter().map(|coil| coil.current).collect()
}

/// Coils as a file has them: a line for each mode.
fn write_modes(path: &Path, coils: &[Coil]) {
    let modes = coils.iter().map(|coil| coil.cosines.len()).max().expect("coils");
    let mut lines = String::from("# a torsatron\n");
    for k in 0..modes {
        for (number, coil) in coils.iter().enumerate() {
            let of = |all: &[[f64; 3]], axis: usize| all.get(k).map_or(0.0, |mode| mode[axis]);
            for axis in 0..3 {
                let (sine, cosine) = (of(&coil.sines, axis), of(&coil.cosines, axis));
                let comma = if number + axis == 0 { "" } else { ", " };
                write!(lines, "{comma}{sine:e}, {cosine:e}").expect("written");
            }
        }
        lines.push('\n');
    }
    std::fs::write(path, lines).expect("written");
}

#[test]
fn a_scene_of_coils_is_run_and_its_model_predicts_lines() {
    let folder = folder();
    let path = folder.path();
    std::fs::write(path.join("lines.toml"), scene(r#"{ kind = "torsatron" }"#)).expect("written");
    let said = text(&succeeds(path, &["run", "lines.toml", "--out", "a"]).stdout);
    for words in [
        "symplectic polynomial of degree 8",
        "reversible polynomial of degree 9",
        "polynomial of degree 6",
        "planes of degree 6",
        "coils, 8 steps",
        "magnetic axis",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let report = std::fs::read_to_string(path.join("a/report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    let found = &report["studies"]["poincare"];
    let axis = found["axis"][0].as_f64().expect("an axis");
    assert!((axis - 3.957_53).abs() < 1e-4, "{axis}");
    let methods = found["methods"].as_array().expect("methods");
    let error = |name: &str| {
        let of = methods.iter().find(|one| one["name"] == name).expect("a method");
        of["one"][0].as_f64().expect("an error")
    };
    assert!(error("jolts") < 1e-5 && error("polynomial of degree 6") < 1e-5, "{found}");
    // Half of the steps that the reference needs; that itself is known to its estimate.
    assert!(error("coils, 8 steps") > 1e-11 && error("coils, 16 steps") > 0.0, "{found}");
    // The map of jolts is on its surfaces after ten times as many periods; the polynomial, which errs less a period, is
    // ten times as far off.
    let off = |name: &str| {
        let of = methods.iter().find(|one| one["name"] == name).expect("a method");
        let largest = |count: usize| {
            let lines = of["off"][count][1].as_array().expect("lines");
            lines.iter().map(|v| v.as_f64().expect("a number")).fold(0.0, max_or_nan)
        };
        [largest(0), largest(1)]
    };
    let ([own, later], [other, drifted]) = (off("jolts"), off("polynomial of degree 6"));
    assert!(found["curves"].as_array().expect("curves").iter().all(|c| c.is_object()), "{found}");
    assert!(own > 0.0 && later < 1.5 * own && later < 1e-6, "{own} {later}");
    assert!(drifted > 5.0 * other && drifted > 10.0 * later, "{other} {drifted} {later}");
    // A symplectic polynomial is off by its error, and not by more as time goes on.
    let [first, last] = off("symplectic polynomial of degree 8");
    assert!(first > 0.0 && last < 1.5 * first && first < 1e-4, "{first} {last}");
    // So is one that is reversible, with fewer numbers.
    let [first, last] = off("reversible polynomial of degree 9");
    assert!(first > 0.0 && last < 1.5 * first && first < 1e-4, "{first} {last}");
    let numbers = |name: &str| {
        let of = methods.iter().find(|one| one["name"] == name).expect("a method");
        of["parameters"].as_u64().expect("a number")
    };
    let [whole, even] = ["symplectic polynomial of degree 8", "reversible polynomial of degree 9"];
    assert!((numbers(whole), numbers(even)) == (44, 29), "{found}");
    // Planes are followed too, lines in the field of the coils are not.
    let [first, last] = off("planes of degree 6, 8 steps");
    assert!(first > 0.0 && last > 0.0 && last < 1e-2, "{first} {last}");
    let coils = methods.iter().find(|one| one["name"] == "coils, 8 steps").expect("a method");
    assert_eq!(coils["off"].as_array().map(Vec::len), Some(0), "{coils}");
    // What the reference is known to stands beside it.
    assert!(error("planes of degree 6, 8 steps") > error("coils, 16 steps"), "{found}");
    for figure in ["poincare.svg", "rotation.csv", "off-surface.svg", "edge.svg", "manifolds.csv"] {
        assert!(path.join("a").join(figure).is_file(), "{figure}");
    }
    // The model is of R and Z in metres.
    let stored = load_model(&path.join("a/model.json")).expect("a model");
    let region = stored.provenance.region.as_ref().expect("a box");
    assert!(region.low[0] > 3.8 && region.high[0] < 4.1 && region.low[1] < 0.0, "{region:?}");
    check_edge(&found["edge"], &stored, [axis, found["axis"][1].as_f64().expect("an axis")]);
    write_points(&path.join("z.npy"), &[1, 2], &[axis, 0.0]).expect("written");
    let predict = [
        "predict",
        "--model",
        "a/model.json",
        "--input",
        "z.npy",
        "--steps",
        "1",
        "--output",
        "o.npy",
    ];
    succeeds(path, &predict);
    let moved = read_trajectories(&path.join("o.npy"), 1).expect("states");
    let image = moved.state(1, 0);
    assert!((image[0] - axis).abs() < 1e-4 && image[1].abs() < 1e-4, "{image:?}");

    // The same machine from a file, by options: the same lines. It is not said to be symmetric.
    let both = format!("{}{REVERSIBLE}", scene(r#"{ kind = "torsatron" }"#));
    std::fs::write(path.join("both.toml"), &both).expect("written");
    let currents = write_coils(&path.join("coils.dat"));
    let currents: Vec<String> = currents.iter().map(f64::to_string).collect();
    let currents = currents.join(",");
    let own = ["--coils", "coils.dat", "--currents", &currents, "--field-periods", "10"];
    // What is found of it before lines are lost:
    let run =
        ["run", "both.toml", "--out", "b", "--asymmetric", "--axis", "3.95,0", "--reach", "0.9"];
    refuses(path, &[&run[..], &own[..4]].concat(), &["--field-periods"]);
    // In a folder with anything else in it the scene stays, although nothing was computed.
    std::fs::create_dir(path.join("b")).expect("made");
    std::fs::write(path.join("b/notes.txt"), "mine").expect("written");
    let found = call(path, &[&run[..], &own].concat());
    let said = text(&found.stderr);
    assert!(said.contains("the axis at (3.9575"), "{said}");
    assert!(said.contains("model reversible is left out"), "{said}");
    let as_run = std::fs::read_to_string(path.join("b/as-run.toml")).expect("a scene");
    assert!(as_run.contains("coils.dat") && as_run.contains("stellarator_symmetric = false"));
    assert!(as_run.contains("jolts") && !as_run.contains("reversor"), "{as_run}");
    assert!(said.contains("reversible polynomial of degree 9 is left out"), "{said}");
    assert!(!as_run.contains("reversible_polynomials = [9]"), "{as_run}");

    // Of networks that are all reversible none would be left: they are trained without it.
    let only = scene(r#"{ kind = "torsatron" }"#).replacen(
        "kind = \"normal-form\", ",
        "kind = \"normal-form\", reversor = \"positions\", ",
        1,
    );
    std::fs::write(path.join("only.toml"), only).expect("written");
    let run = ["run", "only.toml", "--out", "d", "--section-at", "0.3", "--reach", "0.9"];
    std::fs::create_dir(path.join("d")).expect("made");
    std::fs::write(path.join("d/notes.txt"), "mine").expect("written");
    let said = text(&call(path, &run).stderr);
    assert!(said.contains("model jolts is trained without its reversor"), "{said}");
    let as_run = std::fs::read_to_string(path.join("d/as-run.toml")).expect("a scene");
    assert!(as_run.contains("jolts") && !as_run.contains("reversor"), "{as_run}");

    // In a scene of your own it is a mistake that is said.
    let between = both.replace("lines = 24,", "section = 0.25, lines = 24,");
    std::fs::write(path.join("between.toml"), between).expect("written");
    let run = ["run", "between.toml", "--out", "c"];
    refuses(path, &run, &["models.reversible.network", "positions", "half a field period"]);
    std::fs::write(path.join("momenta.toml"), both.replace("\"positions\"", "\"momenta\""))
        .expect("written");
    refuses(path, &["run", "momenta.toml", "--out", "c"], &["momenta", "the reflection of Z"]);
}

/// The lines over the wall are those of the reference, and of the map what its own states and Jacobians say.
fn check_edge(found: &Value, stored: &StoredModel, axis: [f64; 2]) {
    let of = |name: &str| {
        let all = found.as_array().expect("maps").iter();
        all.into_iter().find(|one| one["name"] == name).expect("a map")
    };
    let (reference, own) = (of("reference"), of("jolts"));
    assert_eq!(reference["survived"], own["survived"]);
    // Its lowest resonance has no corner that differs from a curve.
    for one in [reference, own] {
        assert!(one["no_manifold"].as_str().is_some_and(|why| why.contains("no corner")), "{one}");
    }
    let number = |value: &Value| value.as_f64().expect("a number");
    let mut lost = 0;
    for line in 0..6 {
        let start = [axis[0] + 0.02 + 0.005 * line as f64, axis[1]];
        let request = Rollout { steps: 400, every: 1 };
        let states = stored.rollout(&start, request).expect("states");
        let far = |z: &[f64]| (z[0] - axis[0]).hypot(z[1] - axis[1]) >= 0.1;
        let first = states.chunks_exact(2).position(far);
        assert_eq!(own["survived"][line].as_u64(), first.map(|maps| maps as u64), "line {line}");
        if first.is_some() {
            lost += 1;
            assert!(own["exponents"][line].is_null(), "line {line}");
            continue;
        }
        let mut vector = [0.5_f64.sqrt(); 2];
        for z in states.chunks_exact(2).take(200) {
            let m = stored.jacobians(z).expect("a Jacobian");
            vector = [0, 2].map(|row| m[row] * vector[0] + m[row + 1] * vector[1]);
        }
        let exponent = vector[0].hypot(vector[1]).ln() / 200.0;
        let [by_map, by_field] = [own, reference].map(|one| &one["exponents"][line]);
        assert!((number(&by_map["exponent"]) - exponent).abs() < 1e-9, "line {line}: {by_map}");
        let apart = number(&by_field["exponent"]) - exponent;
        assert!(exponent > 1e-3 && apart.abs() < 1e-6, "line {line}: {apart:e} of {exponent}");
        // No line is chaotic.
        assert!(number(&by_map["index"]) > 0.1 && number(&by_field["index"]) > 0.1, "{found}");
    }
    assert_eq!(lost, 1, "{found}");
}

/// What `run` reports of a scene with these changes to its text.
fn report_of(path: &Path, scene: &str, changes: &[(&str, &str)]) -> Value {
    let mut text = scene.to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}: {text}");
        text = text.replace(from, to);
    }
    std::fs::write(path.join("lines.toml"), text).expect("written");
    succeeds(path, &["run", "lines.toml", "--out", "a"]);
    let report = std::fs::read_to_string(path.join("a/report.json")).expect("a report");
    serde_json::from_str(&report).expect("JSON")
}

/// A line that leaves the box of the planes, which is that of the lines of the data, is not lost by the reference: it
/// goes on in the field.
#[test]
fn lines_beyond_the_planes_are_followed_in_the_field() {
    let folder = folder();
    let path = folder.path();
    let changes = [
        ("from = 0.02\nto = 0.045", "from = 0.047\nto = 0.072"),
        ("survival = 400\nwall = 0.1\n", "survival = 100\nwall = 0.16\n"),
        ("exponents = 200\nmanifold = 0.02", "exponents = 100\nmanifold = 0.0"),
        ("symplectic_polynomials = [8]\nreversible_polynomials = [9]\n", ""),
        ("\"edge\", \"manifolds\"", "\"edge\""),
        ("iterations = 40", "iterations = 5"),
        ("counts = [200, 2000]", "counts = [20, 40]"),
        ("reference = 200", "reference = 128"),
        ("orbits = 20", "orbits = 2"),
        ("profile = 8", "profile = 2"),
    ];
    let report = report_of(path, &scene(r#"{ kind = "torsatron" }"#), &changes);
    let [reference, own] = [0, 1].map(|k| &report["studies"]["poincare"]["edge"][k]);
    assert!(reference["name"] == "reference" && own["name"] == "jolts");
    let stored = load_model(&path.join("a/model.json")).expect("a model");
    let torsatron = Torsatron::default();
    let (coils, angle) = (torsatron.coils().expect("sound"), TAU / f64::from(torsatron.periods));
    let request = LineRequest { phi: 0.0, angle, reach: 0.05, guess: None, error: 1e-6 };
    let section = LineSection::new(&coils.all().expect("coils"), request).expect("a section");
    let (axis, map) = (section.axis(), section.map());
    let with_jacobian = |z: &[f64]| {
        let (image, jacobian) = map.with_jacobian([z[0], z[1]]);
        Ok((image.to_vec(), jacobian.concat()))
    };
    let far = |z: &[f64]| (z[0] - axis[0]).hypot(z[1] - axis[1]) >= 0.16;
    let (mut lost, mut own_lost) = (0, Vec::new());
    for line in 0..6 {
        let start = [axis[0] + 0.047 + 0.005 * f64::from(line), axis[1]];
        let states = map.trajectories(&start, 100).expect("states");
        let first = states.chunks_exact(2).position(far).map(|before| before as u64 + 1);
        let line = line as usize;
        assert_eq!(reference["survived"][line].as_u64(), first, "line {line}");
        lost += u32::from(first.is_some());
        // By the map, which may have no image so far out, map after map.
        let mut z = start.to_vec();
        let leaves = (1..=100).find(|_| {
            let image = stored.rollout(&z, Rollout { steps: 1, every: 1 });
            z = image.map_or_else(|_| vec![f64::NAN; 2], |states| states[2..].to_vec());
            z[0].is_nan() || far(&z)
        });
        assert_eq!(own["survived"][line].as_u64(), leaves, "line {line}");
        own_lost.extend(leaves);
        let exponents = &reference["exponents"][line];
        assert_eq!(exponents.is_null(), first.is_some(), "line {line}");
        if first.is_none() {
            let exponent = lyapunov_exponent(&with_jacobian, &start, 100).expect("a number");
            let found = exponents["exponent"].as_f64().expect("a number");
            assert!((found - exponent).abs() < 1e-5, "line {line}: {found} {exponent}");
        }
    }
    // Some are lost, and some stay that begin beyond the lines of the data.
    assert!(lost > 0 && lost < 4, "{lost}");
    // The map loses one not at once, and before it has gone on for as many maps as go together.
    assert!(own_lost.iter().any(|maps| (2..64).contains(maps)), "{own_lost:?}");
}

/// Fifteen islands on an elongated section: the chain of the field and of a reversible polynomial is found on the line
/// of symmetry as from guesses, and as wide by both; the network, which is hardly trained and not reversible, has none
/// there.
#[test]
#[ignore = "takes two minutes: run it with --ignored"]
fn a_chain_of_the_field_is_found_and_as_wide_by_a_map() {
    let folder = folder();
    let path = folder.path();
    let of_all = scene(r#"{ kind = "torsatron" }"#);
    let (study, rest) = of_all.split_once("[poincare.edge]").expect("an edge");
    let (_, models) = rest.split_once("[[models]]").expect("a network");
    let mut text = format!("{study}[[models]]{models}");
    let (rivals, _) = study.split_once("polynomials = [6]").expect("rivals");
    text.replace_range(rivals.len()..study.len(), "reversible_polynomials = [21]\n");
    let changes = [
        ("\"poincare\", \"rotation\", \"off-surface\", \"edge\", \"manifolds\"", ""),
        ("reach = 0.05, error = 1e-6", "reach = 0.15, error = 1e-8"),
        ("reference = 200\n", "reference = 1000\n"),
        ("degree = 10", "degree = 16"),
        ("[200, 2000]", "[200]"),
        ("profile = 8", "profile = 24"),
        ("orbits = 20", "orbits = 15"),
        ("iterations = 40", "iterations = 5"),
        ("iterations = 20", "iterations = 5"),
    ];
    let report = report_of(path, &text, &changes);
    let found = &report["studies"]["poincare"]["orbits"];
    assert!(found["resonance"]["maps"] == 15 && found["resonance"]["turns"] == 1, "{found}");
    let number = |value: &Value| value.as_f64().expect("a number");
    let maps = found["found"].as_array().expect("maps");
    let [network, polynomial] = [&maps[0], &maps[1]];
    for (of, apart) in [(found, 1e-9), (polynomial, 1e-11)] {
        let on_line = &of["on_line"];
        assert_eq!(on_line["orbits"], 2, "{on_line}");
        assert!(number(&on_line["centre"]) < apart && number(&on_line["corner"]) < apart);
    }
    assert_eq!(network["on_line"]["orbits"], 0, "{network}");
    let [width, own] = [found, polynomial].map(|of| number(&of["chain"]["width"]));
    // Of lines 0.01 mm apart those from −0.31 to 0.30 mm stay in it.
    assert!(width > 6.0e-4 && width < 6.4e-4, "{width}");
    assert!((own / width - 1.0).abs() < 0.01, "{own} {width}");
    // The centre is on the line of symmetry, outside of the axis: exactly of the polynomial, which is reversible, and up
    // to the error of tracing, 1e-8, over the small residue of the orbit.
    let [of_field, of_polynomial] = [found, polynomial].map(|of| number(&of["chain"]["phase"]));
    assert!(of_field < 1e-6 && of_polynomial < 1e-9, "{of_field:e} {of_polynomial:e}");
}

/// What the guide says of the torsatron, of the scene as it is: errors of a period and of ι, surfaces over a million
/// periods beside polynomials, Tr M of the axis, and the width of the islands.
#[test]
#[ignore = "takes six minutes: run it with --ignored"]
fn surfaces_of_coils_are_kept_over_a_million_periods() {
    let folder = folder();
    let path = folder.path();
    succeeds(path, &["run", "coils", "--out", "a", "--threads", "2"]);
    let report = std::fs::read_to_string(path.join("a/report.json")).expect("a report");
    let report: Value = serde_json::from_str(&report).expect("JSON");
    let found = &report["studies"]["poincare"];
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let methods = found["methods"].as_array().expect("methods");
    let method = |name: &str| {
        methods.iter().find(|method| method["name"] == name).unwrap_or_else(|| panic!("{name}"))
    };
    // The furthest line after each number of periods.
    let off = |name: &str| -> Vec<f64> {
        let rows = method(name)["off"].as_array().expect("distances").iter();
        let lines = rows.map(|row| row[1].as_array().expect("lines"));
        lines.map(|lines| lines.iter().map(number).fold(0.0, max_or_nan)).collect()
    };
    // The curves of the reference are known to this.
    let known = number(&found["off_curves"]);
    assert!(known < 2e-8, "{known:e}");
    let turns_of = |rows: &Value| -> Vec<[f64; 2]> {
        let rows = rows.as_array().expect("lines").iter();
        rows.map(|line| [number(&line["turns"]), number(&line["error"])]).collect()
    };
    let reference = turns_of(&found["profile"]);
    for name in ["reversible", "jolts"] {
        let one = number(&method(name)["one"][0]);
        assert!(one < 1e-9, "{name}: {one:e}");
        // No growth over 10³, 10⁴, 10⁵ and 10⁶ periods.
        let off = off(name);
        assert!(off.len() == 4 && off.iter().all(|off| *off < 1.5 * known), "{name}: {off:?}");
        let own = turns_of(&method(name)["rotation"]);
        let mut apart: Vec<f64> = own
            .iter()
            .zip(&reference)
            .filter(|(own, known)| own[1] < 1e-9 && known[1] < 1e-9)
            .map(|(own, known)| (own[0] - known[0]).abs() * 10.0)
            .collect();
        apart.sort_by(f64::total_cmp);
        let (median, largest) = (apart[apart.len() / 2], apart[apart.len() - 1]);
        assert!(apart.len() > 90, "{name}: {}", apart.len());
        assert!(median < 2e-9 && largest < 1e-7, "{name}: {median:e} {largest:e}");
    }
    // Polynomials of as much time leave their surfaces.
    let plain = off("polynomial of degree 28");
    assert!(plain[3] > 10.0 * off("jolts")[3] && plain[3] > 4.0 * plain[2], "{plain:?}");
    let orbits = &found["orbits"];
    let maps = orbits["found"].as_array().expect("maps");
    let of = |name: &str| maps.iter().find(|map| map["name"] == name).expect("a map");
    let by_field = number(&orbits["axis"]["trace"]);
    for (name, most) in [("reversible", 1e-8), ("reversible polynomial of degree 33", 5e-9)] {
        let own = number(&of(name)["axis"]["trace"]);
        assert!((own - by_field).abs() < most, "{name}: {own} {by_field}");
    }
    let width = number(&orbits["chain"]["width"]);
    let own = number(&of("reversible")["chain"]["width"]);
    assert!(width > 6.0e-4 && (own / width - 1.0).abs() < 0.01, "{own} {width}");
}

/// The map of the scene loses the lines that the field loses, and its manifold begins where that of the field does.
#[test]
#[ignore = "takes nine minutes: run it with --ignored"]
fn the_edge_of_a_map_is_that_of_the_field() {
    let folder = folder();
    let path = folder.path();
    succeeds(path, &["run", "edge", "--out", "a"]);
    let report = std::fs::read_to_string(path.join("a/report.json")).expect("a report");
    let report: Value = serde_json::from_str(&report).expect("JSON");
    let found = report["studies"]["poincare"]["edge"].as_array().expect("maps");
    let lost = |k: usize| -> Vec<bool> {
        let lines = found[k]["survived"].as_array().expect("lines");
        lines.iter().map(|maps| !maps.is_null()).collect()
    };
    assert!(found[0]["name"] == "reference" && found[1]["name"] == "reversible");
    assert_eq!(lost(0), lost(1));
    assert!(lost(0).iter().any(|lost| *lost) && lost(0).iter().any(|lost| !lost));
    let orbits = &report["studies"]["poincare"]["orbits"];
    let width = |of: &Value| of["chain"]["width"].as_f64().expect("an island");
    let (by_field, by_map) = (width(orbits), width(&orbits["found"][0]));
    // Of lines 0.05 mm apart those from −2.00 to 1.90 mm stay in it.
    assert!(by_field > 3.9e-3 && by_field < 4.0e-3, "{by_field}");
    assert!((by_map / by_field - 1.0).abs() < 0.01, "{by_map} {by_field}");
    let branches = std::fs::read_to_string(path.join("a/manifolds.csv")).expect("a table");
    for branch in ["1", "2"] {
        let points = |map: &str| -> Vec<[f64; 2]> {
            let rows = branches.lines().map(|row| row.split(',').collect::<Vec<&str>>());
            let rows = rows.filter(|row| row[0].trim_matches('"') == map && row[1] == branch);
            rows.map(|row| [2, 3].map(|k| row[k].parse().expect("a number"))).collect()
        };
        let (field, map) = (points("reference"), points("reversible"));
        assert!(field.len() > 500 && map.len() > 500, "{} {}", field.len(), map.len());
        for z in &map[..50] {
            let from = |of: &[f64; 2]| (of[0] - z[0]).hypot(of[1] - z[1]);
            let nearest = field.iter().map(from).min_by(f64::total_cmp).expect("points");
            assert!(nearest < 1e-4, "{z:?}: {nearest}");
        }
    }
}

/// Maps of a section that is mirrored are learnt as such: with half the numbers, none of which can break it.
#[test]
fn a_section_that_is_mirrored_has_a_reversible_map() {
    let folder = folder();
    let path = folder.path();
    let of_one = scene(r#"{ kind = "torsatron" }"#);
    let begin = of_one.find("[poincare]").expect("a study");
    let own = of_one[..begin].replace(
        "plots = [\"poincare\", \"rotation\", \"off-surface\", \"edge\", \"manifolds\"]",
        "",
    );
    std::fs::write(path.join("lines.toml"), format!("{own}{REVERSIBLE}")).expect("written");
    succeeds(path, &["run", "lines.toml", "--out", "a"]);
    let model = path.join("a/model.json");
    let stored = load_model(&model).expect("a model");
    assert_eq!(stored.model.architecture().reversor, Some(Reversor::Positions));
    let report = std::fs::read_to_string(path.join("a/report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    let error = report["studies"]["training"].to_string();
    assert!(error.contains("reversible"), "{error}");
    // Three maps there, mirrored, and three back.
    let start = [3.99, 0.02];
    let ends = |from: [f64; 2]| {
        write_points(&path.join("z.npy"), &[1, 2], &from).expect("written");
        let model = model.to_str().expect("text");
        let predict = ["predict", "--model", model, "--input", "z.npy", "--steps", "3"];
        succeeds(path, &[&predict[..], &["--output", "o.npy", "--overwrite"]].concat());
        let moved = read_trajectories(&path.join("o.npy"), 1).expect("states");
        let [r, z] = moved.state(3, 0) else { panic!("a point of two numbers") };
        [*r, -z]
    };
    let there = ends(start);
    assert!((there[0] - start[0]).abs() > 1e-3, "{there:?}");
    let back = ends(there);
    let apart = (back[0] - start[0]).hypot(back[1] - start[1]);
    assert!(apart < 1e-12, "{apart:e}");
    let said = text(&succeeds(path, &["verify", "--model", "a/model.json"]).stdout);
    assert!(said.contains("reversibility") && said.contains("S(q, p) = (−q, p)"), "{said}");
}

/// Lines that are on no smooth curve, here since too few maps tell one, are not 0 off: the report leaves them open.
#[test]
fn lines_without_a_curve_are_not_near_it() {
    let folder = folder();
    let changes = [
        ("reference_planes = { degree = 10 }", "reference_planes = { fewer = 16, degree = 2 }"),
        ("iterations = 40", "iterations = 5"),
        ("counts = [200, 2000]", "counts = [20, 40]"),
        ("orbits = 20", "orbits = 2"),
        ("profile = 8", "profile = 2"),
        ("survival = 400", "survival = 100"),
        ("exponents = 200\nmanifold = 0.02", "exponents = 100\nmanifold = 0.0"),
        ("\"edge\", \"manifolds\"", "\"edge\""),
    ];
    let report = report_of(folder.path(), &scene(r#"{ kind = "torsatron" }"#), &changes);
    let found = &report["studies"]["poincare"];
    assert!(found["curves"].as_array().expect("curves").iter().all(|c| c.is_null()), "{found}");
    for of in found["methods"].as_array().expect("methods") {
        for after in of["off"].as_array().expect("counts") {
            assert!(after[1].as_array().expect("lines").iter().all(|v| v.is_null()), "{after}");
        }
    }
    let text = std::fs::read_to_string(folder.path().join("a/report.md")).expect("a report");
    assert!(text.contains("| jolts | – | – |"), "{text}");
}

/// Stops a run once a stage has begun.
struct StopsIn {
    stage: &'static str,
    reached: bool,
}

impl Observer for StopsIn {
    fn event(&mut self, event: Event<'_>) {
        self.reached |= matches!(event, Event::Stage(name) if name == self.stage);
    }

    fn interrupted(&self) -> bool {
        self.reached
    }
}

/// A run that is stopped while lines are traced goes on to the bits of one that is not.
#[test]
fn tracing_can_be_stopped_and_gone_on_with() {
    let folder = folder();
    let mut brief = scene(r#"{ kind = "torsatron" }"#);
    for (long, short) in [
        ("counts = [200, 2000]", "counts = [100, 200]"),
        ("reference = 200", "reference = 128"),
        ("orbit = 48", "orbit = 24"),
        ("lines = 24", "lines = 12"),
    ] {
        assert!(brief.contains(long), "{long}");
        brief = brief.replace(long, short);
    }
    let scene = parse("lines.toml", &brief).expect("a scene");
    let start = |name: &str, resume: bool, stage: &'static str| {
        let path = folder.path().join(name);
        let out = Folder::open(&path, resume, false).expect("a folder");
        run(&scene, &out, &mut StopsIn { stage, reached: false }).expect("a run").is_some()
    };
    assert!(start("whole", false, "none"));
    assert!(!start("parts", false, "field lines of the coils"));
    assert!(!start("parts", true, "lines of the reference"));
    assert!(start("parts", true, "none"));
    let [whole, parts] = ["whole", "parts"]
        .map(|name| std::fs::read(folder.path().join(name).join("report.json")).expect("a report"));
    assert!(whole == parts);
}

/// A tokamak by its formula: its axis is in the middle of its plasma, and a map of a coil learns its lines.
#[test]
fn lines_of_a_tokamak_are_learnt() {
    let folder = folder();
    let path = folder.path();
    let whole = scene("{ kind = \"tokamak\", coils = 12 }");
    let tokamak = training_alone(&whole.replace("reach = 0.05", "reach = 0.3"));
    std::fs::write(path.join("t.toml"), tokamak).expect("written");
    succeeds(path, &["run", "t.toml", "--out", "o"]);
    let stored = load_model(&path.join("o/model.json")).expect("a model");
    let coils = Tokamak { coils: 12, ..Tokamak::default() }.coils().expect("sound");
    let request = LineRequest {
        phi: 0.0,
        angle: TAU / 12.0,
        reach: 0.3,
        guess: Some([3.0, 0.0]),
        error: 1e-8,
    };
    let section = LineSection::new(&coils.all().expect("coils"), request).expect("a section");
    let starts = section.starts(5);
    let traced = section.map().trajectories(&starts, 20).expect("lines");
    let request = Rollout { steps: 20, every: 1 };
    let learnt = stored.rollout(&starts, request).expect("orbits").split_off(starts.len());
    let off = learnt.iter().zip(&traced).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
    let moved = traced.iter().zip(starts.iter().cycle()).map(|(a, b)| (a - b).abs());
    assert!(off < 1e-3 && moved.fold(0.0, max_or_nan) > 0.3, "{off}");
    let refused = whole.replace("coils = 12", "coils = 12, plasma_width = -1.0");
    std::fs::write(path.join("bad.toml"), refused).expect("written");
    refuses(path, &["run", "bad.toml"], &["coils.plasma_width", "-1"]);
}

/// A run that fails removes the folder that it made, and nothing of anyone else; a map of nearly whole turns, whose
/// lines do not go round the section, is refused.
#[test]
fn folders_of_others_stay_where_a_run_fails() {
    let folder = folder();
    let path = folder.path();
    let turns = training_alone(&scene(r#"{ kind = "torsatron" }"#))
        .replace(
            "lines = 24, reach = 0.05, error = 1e-6",
            "lines = 8, periods = 17, reach = 0.05, error = 1e-4",
        )
        .replace("orbit = 48", "orbit = 8");
    std::fs::write(path.join("turns.toml"), turns).expect("written");
    std::fs::create_dir_all(path.join("mine/keep/deep")).expect("made");
    for out in ["mine", "new"] {
        let run = call(path, &["run", "turns.toml", "--out", out]);
        let said = text(&run.stderr);
        assert_eq!(run.status.code(), Some(2), "{said}");
        assert!(said.contains("data.orbit") && said.contains("maps at least"), "{said}");
    }
    assert!(path.join("mine/keep/deep").is_dir() && !path.join("mine/as-run.toml").exists());
    assert!(!path.join("new").exists());
}

/// Lines beyond the last surface are left out, and this is said with where the first of them begins.
#[test]
fn lost_lines_are_said() {
    let folder = folder();
    let path = folder.path();
    let far = training_alone(&scene(r#"{ kind = "torsatron" }"#))
        .replace("lines = 24, reach = 0.05, error = 1e-6", "lines = 12, reach = 0.22, error = 1e-4")
        .replace("orbit = 48", "orbit = 40")
        .replace("iterations = 40\n", "iterations = 2\n")
        .replace("ramp = [{ degree = 3, iterations = 20 }]\n", "");
    std::fs::write(path.join("far.toml"), far).expect("written");
    let run = succeeds(path, &["run", "far.toml", "--out", "a"]);
    // Beside the lines themselves, traced here.
    let coils = Torsatron::default().coils().expect("sound").all().expect("coils");
    let guess = Some([3.95, 0.0]);
    let request = LineRequest { phi: 0.0, angle: TAU / 10.0, reach: 0.22, guess, error: 1e-4 };
    let section = LineSection::new(&coils, request).expect("a section");
    let starts = section.starts(12);
    let states = section.map().trajectories(&starts, 40).expect("lines");
    let end = states[states.len() - starts.len()..].chunks_exact(2).zip(starts.chunks_exact(2));
    let lost: Vec<f64> =
        end.filter(|(z, _)| z[0].is_nan()).map(|(_, start)| start[0] - section.axis()[0]).collect();
    assert!((1..6).contains(&lost.len()), "{lost:?}");
    let words = format!(
        "{} lines are lost or run into a coil, and left out: the nearest to the axis begins {:.6} m",
        lost.len(),
        lost[0]
    );
    let report = std::fs::read_to_string(path.join("a/report.md")).expect("a report");
    assert!(report.contains(&words), "{words}: {report}");
    let said = text(&run.stdout).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains(&words), "{said}");
}

/// A small ring that carries next to no current, beside the outermost lines: they are where points of coils do not act
/// as a line, and no pairs are made of them.
#[test]
fn lines_that_come_too_near_a_coil_are_left_out() {
    let folder = folder();
    let path = folder.path();
    let mut coils = of_a_period();
    let whole = |coils: &[Coil]| {
        let set = CoilSet { coils: coils.to_vec(), periods: 10, stellarator_symmetric: false };
        set.all().expect("coils")
    };
    let request = LineRequest {
        phi: 0.0,
        angle: TAU / 10.0,
        reach: 0.05,
        guess: Some([3.95, 0.0]),
        error: 1e-4,
    };
    let without = LineSection::new(&whole(&coils), request).expect("a section");
    // On the other side of the axis than the points at which lines begin, which are checked by themselves.
    let beside = without.axis()[0] - without.field().resolved_from() - 0.028;
    coils.push(Coil {
        cosines: vec![[beside, 0.0, 0.0], [0.0, 0.005, 0.0]],
        sines: vec![[0.0; 3], [0.0, 0.0, 0.005]],
        current: 1e-3,
        width: 0.0,
    });
    write_modes(&path.join("coils.dat"), &coils);
    let section = LineSection::new(&whole(&coils), request).expect("a section");
    let nearest = section.map().nearest_to_coils(&section.starts(5), 24).expect("distances");
    let resolved = section.field().resolved_from();
    let kept = nearest.iter().filter(|near| **near >= resolved).count();
    assert!((1..4).contains(&kept), "{nearest:?} of {resolved}");
    let currents: Vec<String> = coils.iter().map(|coil| coil.current.to_string()).collect();
    let file = format!(
        r#"{{ kind = "file", path = "coils.dat", currents = [{}], periods = 10, stellarator_symmetric = false }}"#,
        currents.join(",")
    );
    let five = scene(&file)
        .replace("lines = 24", "lines = 5, axis = [3.95, 0.0]")
        .replace("error = 1e-6", "error = 1e-4")
        .replace("orbit = 48", "orbit = 24");
    std::fs::write(path.join("near.toml"), training_alone(&five)).expect("written");
    let refused = call(path, &["run", "near.toml", "--out", "a"]);
    let said = text(&refused.stderr);
    let words = "data.lines.reach: expected a reach within which lines stay in the machine, found ";
    let found = said.split_once(words).and_then(|(_, found)| found.split_once(" of 5 lines"));
    let found: usize = found.and_then(|(count, _)| count.parse().ok()).expect("a count");
    assert_eq!(refused.status.code(), Some(2), "{said}");
    // It looks at one map in five.
    assert!((kept..4).contains(&found), "{kept} and {found}");
}

#[test]
fn bad_machines_are_refused_before_anything_is_written() {
    let folder = folder();
    let path = folder.path();
    let refused = |toml: &str, more: &[&str], words: &[&str]| {
        std::fs::write(path.join("lines.toml"), toml).expect("written");
        refuses(path, &[&["run", "lines.toml", "--out", "a"], more].concat(), words);
    };
    let sound = scene(r#"{ kind = "torsatron" }"#);
    refused(&scene(r#"{ kind = "torsatron", periods = 5 }"#), &[], &["multiple of 2"]);
    refused(&scene(r#"{ kind = "torsatron", minor = 5 }"#), &[], &["minor"]);
    refused(&sound.replace("reach = 0.05", "reach = -1"), &[], &["reach"]);
    refused(&sound.replace("lines = 24", "lines = 2"), &[], &["lines"]);
    refused(&sound.replace("to = 0.045", "to = 0.01"), &[], &["edge", "from < to < wall"]);
    refused(&sound.replace("wall = 0.1", "wall = nan"), &[], &["edge.wall"]);
    refused(&sound.replace("exponents = 200", "exponents = 401"), &[], &["edge.exponents"]);
    refused(&sound.replace("manifold = 0.02", "manifold = -1.0"), &[], &["edge.manifold"]);
    refused(
        &sound.replace("validation = 0.25", "validation = 0"),
        &[],
        &["validation", "held out"],
    );
    refused(&sound.replace("counts = [200, 2000]", "counts = [200, 20]"), &[], &["counts"]);
    refused(&sound.replace("orbit = 48", "orbit = 10"), &["--quick"], &["degree"]);
    refused(&sound.replace("[6]", "[40]"), &[], &["degree", "pairs to train with"]);
    refused(&sound.replace("[8]", "[1]"), &[], &["symplectic_polynomials"]);
    refused(&sound.replace("[8]", "[40]"), &[], &["degree", "pairs to train with"]);
    refused(&sound.replace("[9]", "[1]"), &[], &["reversible_polynomials"]);
    let between = sound.replace("lines = 24,", "section = 0.25, lines = 24,");
    refused(&between, &[], &["reversible_polynomials", "mirrored"]);
    refused(&sound, &["--axis", "3.9"], &["--axis", "two numbers"]);
    for numbers in [["--axis", "nan,0"], ["--reach", "nan"], ["--section-at", "inf"]] {
        refused(&sound, &numbers, &[numbers[0], "finite"]);
    }
    let endless = ["--coils", "none.dat", "--currents", "1,nan", "--field-periods", "5"];
    refused(&sound, &endless, &["--currents", "finite", "NaN"]);
    refused(
        &sound,
        &["--coils", "none.dat", "--currents", "1", "--field-periods", "5"],
        &["none.dat"],
    );
    std::fs::write(path.join("short.dat"), "0,0,0,0,0,0\n1,1,1\n").expect("written");
    let short = ["--coils", "short.dat", "--currents", "1", "--field-periods", "5"];
    refused(&sound, &short, &["short.dat:2"]);
    let two = ["--coils", "short.dat", "--currents", "1,2", "--field-periods", "5"];
    std::fs::write(path.join("short.dat"), "0,0,0,0,0,0\n0,1,1,0,0,0\n").expect("written");
    refused(&sound, &two, &["currents"]);
    refuses(path, &["run", "jolts", "--reach", "0.1", "--out", "a"], &["field lines of coils"]);
    let with_system = format!("{sound}\n[system]\nkind = \"oscillators\"\nepsilon = 0.1\n");
    refused(&with_system, &[], &["no system beside"]);
    // What only tracing tells.
    std::fs::write(path.join("lines.toml"), sound).expect("written");
    let far = call(path, &["run", "lines.toml", "--out", "a", "--reach", "0.9"]);
    assert_eq!(far.status.code(), Some(2));
    let said = text(&far.stderr);
    assert!(said.contains("reach") && said.contains("(R, Z)"), "{said}");
    // Nothing was computed: the same command can be called again.
    assert!(!path.join("a").join("as-run.toml").exists());
    assert_eq!(
        call(path, &["run", "lines.toml", "--out", "a", "--reach", "0.9"]).stderr,
        far.stderr
    );
    // In a winding, where the field is that of the points along it, there is no axis.
    let winding = call(path, &["run", "lines.toml", "--out", "b", "--axis", "4.875,0"]);
    let said = String::from_utf8_lossy(&winding.stderr);
    assert!(!winding.status.success() && said.contains("axis from (R, Z) = (4.875, 0)"), "{said}");
    assert!(said.contains("from a coil"), "{said}");
    assert!(!path.join("a/report.json").exists());
}
