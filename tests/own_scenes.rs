//! Scenes on pairs and trajectories of one's own, of a system that the crate need not know.

use gyroceptron::flow::{Pairs, ReferenceTrajectories, Trajectories, Window, sample};
use gyroceptron::io::{
    load_model, read_trajectories, write_pairs, write_points, write_trajectories,
};
use gyroceptron::network::Rollout;
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Elementary, constant, max_or_nan};
use gyroceptron::system::{Hamiltonian, Oscillators};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

const SCENE: &str = r#"
name = "own"
title = "Pairs of a file"
seed = 3
flow_time = 0.5
plots = ["loss", "prediction", "orbits", "portrait", "adiabatic-invariant", "rollout-error", "error-against-time"]

[data]
pairs = "pairs.npz"
trajectories = "t.npy"
circle_action = [1, 0]
epsilon = 0.01
validation = 0.2

[[models]]
name = "gyroceptron"
network = { kind = "gyroceptron", psi = { count = 3, width = 4 }, near_identity = { count = 3, width = 4 } }
weights = { kind = "normal", scale = 0.15 }

[[models]]
name = "normal-form"
network = { kind = "normal-form", kicks = { count = 4, width = 4 }, twists = { count = 4, width = 4 } }
weights = { kind = "normal", scale = 0.15 }
training = { iterations = 150, loss = { kind = "by-plane" }, optimiser = { kind = "levenberg-marquardt" }, starts = { count = 1, iterations = 40 } }

[training]
iterations = 150
loss = { kind = "mean-squared-error" }
optimiser = { kind = "levenberg-marquardt" }
starts = { count = 1, iterations = 40 }

[rollout]
steps = 100
every = 10

[work_precision]
points = 20
rounds = 1

[certificate]
samples = 10
radius = 1.6
"#;

/// The pairs and trajectories of the oscillators, `factor` times as large.
fn write_data(folder: &Path, factor: f64) -> Trajectories {
    let times = |values: &[f64]| values.iter().map(|v| factor * v).collect::<Vec<f64>>();
    let window = Window { low: vec![-1.6; 4], high: vec![1.6; 4], samples: 400 };
    let points = sample(&[window], 2, &mut Stream::new(1, "points")).expect("points");
    let system = Oscillators { epsilon: 0.01 };
    let (pairs, _) = Pairs::of_flow(&system, points, 0.5).expect("a flow");
    let pairs = Pairs::new("pairs", 2, times(pairs.input()), times(pairs.output()));
    write_pairs(&folder.join("pairs.npz"), &pairs.expect("finite")).expect("written");
    let mut states = vec![1.2, 0.3, 0.1, 0.0, 0.9, -0.5, 0.0, 0.2, 0.4, 0.4, 0.4, 0.4];
    for _ in 0..12 {
        let last = states[states.len() - 12..].to_vec();
        let (moved, _) = Pairs::of_flow(&system, last, 5.0).expect("a flow");
        states.extend_from_slice(moved.output());
    }
    let states = times(&states);
    write_points(&folder.join("t.npy"), &[13, 3, 4], &states).expect("written");
    Trajectories::new(states, 4, 3).expect("states of three")
}

fn run(folder: &Path, scene: &str, out: &str) -> Output {
    let program = env!("CARGO_BIN_EXE_gyroceptron");
    let arguments = ["run", scene, "--out", out, "--overwrite"];
    Command::new(program).current_dir(folder).args(arguments).output().expect("it starts")
}

fn report(folder: &Path) -> (String, Value) {
    let text = std::fs::read_to_string(folder.join("report.md")).expect("a report");
    let data = std::fs::read(folder.join("report.json")).expect("data");
    (text, serde_json::from_slice(&data).expect("one JSON document"))
}

#[test]
fn a_scene_on_files_runs_to_a_report() {
    let folder = tempfile::tempdir().expect("a folder");
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).expect("made");
    let reference = write_data(&inner, 1.0);
    std::fs::write(inner.join("own.toml"), SCENE).expect("written");
    // Paths are from the folder of the scene's file.
    let output = run(folder.path(), "inner/own.toml", "out");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let out = folder.path().join("out");
    let (text, data) = report(&out);
    let first = text.split("## ").nth(1).expect("a section");
    assert!(first.starts_with("Whether to trust it"), "{text}");
    assert!(text.contains("rotation") && text.contains("not known"));
    assert!(!text.contains("NaN"), "{text}");
    // Where one loss has weights and the other has none, neither heads the column.
    assert!(text.contains("weights of the loss") && !text.contains("loss, weighted"), "{text}");
    for plot in ["loss", "portrait", "adiabatic-invariant", "rollout-error", "error-against-time"] {
        let svg = std::fs::read_to_string(out.join(format!("{plot}.svg"))).expect("a plot");
        assert!(svg.starts_with("<svg") && svg.len() > 3000, "{plot}");
    }
    let studies = &data["studies"];
    assert_eq!(studies["pairs"]["reference_error"], Value::Null);
    for (k, name) in ["gyroceptron", "normal-form"].into_iter().enumerate() {
        let stored = load_model(&out.join(format!("model-{name}.json"))).expect("a model");
        assert!(stored.provenance.region.is_some() && stored.units.is_none());
        assert_eq!(stored.provenance.flow_time, Some(0.5));
        let request = Rollout { steps: 100, every: 10 };
        let states = stored.rollout(&reference.values()[..12], request).expect("finite");
        let squares = |(a, b): (&f64, &f64)| (a - b) * (a - b);
        let squares: f64 = states.iter().zip(reference.values()).map(squares).sum();
        let rms = (squares / 33.0).sqrt();
        let model = &studies["rollout"]["models"][k];
        let said = model["rms_error"].as_f64().expect("a number");
        assert!((said / rms - 1.0).abs() < 1e-12 && rms < 0.5, "{name}: {said:e}, {rms:e}");
        assert_eq!(model["system_adiabatic"], Value::Null);
        assert!(model["own_adiabatic"]["along_own_orbits"]["largest_change"].is_number());
        let trust = &studies["trust"][k];
        assert_eq!(trust["name"], name);
        assert!(trust["share_beyond_rotation"].as_f64() < Some(0.5), "{trust}");
        let one_step = &studies["training"]["models"][k]["best"]["validation"];
        assert_eq!(one_step.as_f64(), stored.provenance.validation);
    }

    // As it was run, from another folder.
    let again = run(&inner, "../out/as-run.toml", "again");
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    let (_, of_again) = report(&inner.join("again"));
    assert_eq!(of_again["studies"]["rollout"], studies["rollout"]);

    // Of other units: the same networks, and errors in units of their own.
    write_data(&inner, 128.0);
    let output = run(folder.path(), "inner/own.toml", "large");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let large = folder.path().join("large");
    let (text, of_large) = report(&large);
    assert!(text.contains("1.2800e2"), "{text}");
    // Errors of components, portraits and orbits are in units of the data.
    let components = |data: &Value, of: &dyn Fn(&Value) -> Value| -> Vec<f64> {
        let values = of(&data["studies"]);
        let values = values.as_array().expect("numbers").iter();
        values.map(|value| value.as_f64().expect("a number")).collect()
    };
    let ofs: [&dyn Fn(&Value) -> Value; 2] =
        [&|studies| studies["training"]["models"][0]["component_errors"].clone(), &|studies| {
            studies["rollout"]["component_errors"][1]["rms"].clone()
        }];
    for of in ofs {
        let (small, large) = (components(&data, of), components(&of_large, of));
        let times: Vec<f64> = small.iter().map(|error| 128.0 * error).collect();
        assert!(small.len() == 4 && small.iter().all(|error| *error > 0.0));
        assert_eq!(times, large);
    }
    assert!(
        text.contains("Errors of `gyroceptron`") && text.contains("| q₁ (plane 1) |"),
        "{text}"
    );
    for name in ["portrait.csv", "prediction.csv", "orbits.csv"] {
        let widest = |folder: &Path| -> f64 {
            let text = std::fs::read_to_string(folder.join(name)).expect("numbers");
            let numbers = text.lines().skip(1).map(|line| line.rsplit(',').next().expect("y"));
            numbers.map(|y| y.parse::<f64>().expect("a number").abs()).fold(0.0, max_or_nan)
        };
        let ratio = widest(&large) / widest(&out);
        assert!((ratio / 128.0 - 1.0).abs() < 1e-12, "{name}: {ratio}");
    }
    assert_eq!(of_large["studies"]["rollout"]["models"], studies["rollout"]["models"]);
    let region = |folder: &Path| {
        let stored = load_model(&folder.join("model-gyroceptron.json")).expect("a model");
        let parameters = stored.model.composition().parameters().to_vec();
        (stored.provenance.region.expect("a box").high, parameters)
    };
    let ((high, parameters), (high_large, same)) = (region(&out), region(&large));
    assert_eq!(parameters, same);
    assert_eq!(high.iter().map(|v| 128.0 * v).collect::<Vec<_>>(), high_large);
}

#[test]
fn scenes_on_files_that_cannot_be_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    write_data(path, 1.0);
    write_points(&path.join("few.npy"), &[2, 3, 4], &[0.5; 24]).expect("written");
    write_points(&path.join("flat.npy"), &[6, 4], &[0.5; 24]).expect("written");
    write_points(&path.join("wide.npy"), &[2, 2, 6], &[0.5; 24]).expect("written");
    let window =
        "windows = [{ low = [-1.0, -1.0, -1.0, -1.0], high = [1.0, 1.0, 1.0, 1.0], samples = 4 }]";
    let gyroceptron = SCENE.lines().find(|line| line.starts_with("network")).expect("a network");
    let pairs = "pairs = \"pairs.npz\"";
    let rollout = "every = 10\n";
    let system = "[system]\nkind = \"oscillators\"\nepsilon = 0.01\n\n[data]";
    let integrators =
        "rounds = 1\nintegrators = [{ integrator = { kind = \"strang\" }, one_step = [1] }]";
    let ramp = "[training]\niterations = 150\nramp = [{ flow_time = 0.1, iterations = 5 }]";
    for (number, (from, to, words)) in [
        (pairs, "pairs = \"none.npz\"", &["none.npz"][..]),
        (pairs, &format!("{pairs}\n{window}"), &["data.windows"]),
        (pairs, window, &["data.trajectories"]),
        (pairs, &format!("{pairs}\nsection = \"none.npz\""), &["none.npz"]),
        (pairs, &format!("{window}\nsection = \"s.npz\""), &["data.trajectories"]),
        (
            "circle_action = [1, 0]",
            "circle_action = [1, 0, 0]",
            &["pairs.npz", "circle action", "3 weights"],
        ),
        ("trajectories = \"t.npy\"\n", "", &["data.trajectories"]),
        ("t.npy", "few.npy", &["few.npy", "states", "found 2"]),
        ("t.npy", "flat.npy", &["flat.npy", "(states, trajectories, 2n)"]),
        ("t.npy", "wide.npy", &["wide.npy", "of 4 numbers"]),
        (rollout, "every = 10\ninitial = [[1.0, 0.0, 0.0, 0.0]]\n", &["initial"]),
        (rollout, "every = 10\nplane = 3\n", &["plane", "found 3"]),
        ("[data]", system, &["data.pairs", "system"]),
        ("rounds = 1", integrators, &["integrators"]),
        ("[training]\niterations = 150", ramp, &["ramp"]),
        ("flow_time = 0.5\n", "flow_time = 0.0\n", &["flow_time"]),
        ("validation = 0.2", "validation = 1.0", &["data.validation"]),
        (gyroceptron, "network = { kind = \"file\", path = \"w.npz\" }", &["networks to train"]),
    ]
    .into_iter()
    .enumerate()
    {
        let scene = SCENE.replacen(from, to, 1);
        assert!(scene != SCENE, "{from}");
        std::fs::write(path.join("bad.toml"), scene).expect("written");
        let out = format!("o{number}");
        let output = run(path, "bad.toml", &out);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{from}: {said}");
        // Before anything is trained, and before a folder is made.
        assert!(!said.contains("training gyroceptron"), "{from}: {said}");
        assert!(!words[0].ends_with(".npy") || !path.join(&out).exists(), "{from}");
        for word in words {
            assert!(said.contains(word), "{from} does not name {word}: {said}");
        }
    }
}

/// What `train` says of pairs before it trains, a scene on them says in its report.
#[test]
fn a_report_says_what_is_wrong_with_pairs() {
    let folder = tempfile::tempdir().expect("a folder");
    let window = Window { low: vec![-1.0; 2], high: vec![1.0; 2], samples: 150 };
    let points = sample(&[window], 1, &mut Stream::new(1, "points")).expect("points");
    let notes = |shrinks: f64, reversor: &str| {
        let (sine, cosine) = libm::sincos(0.8);
        let turned = |z: &[f64]| [cosine * z[0] + sine * z[1], cosine * z[1] - sine * z[0]];
        let bent = |[q, p]: [f64; 2]| [shrinks * q, shrinks * (p + 0.1 * q * q)];
        let output = points.chunks_exact(2).flat_map(|z| bent(turned(z))).collect();
        let pairs = Pairs::new("pairs", 1, points.clone(), output).expect("finite");
        write_pairs(&folder.path().join("pairs.npz"), &pairs).expect("written");
        let scene = format!(
            r#"
            name = "own"
            seed = 3
            flow_time = 1.0
            [data]
            pairs = "pairs.npz"
            circle_action = [1]
            epsilon = 0.1
            validation = 0.2
            [[models]]
            name = "one"
            network = {{ kind = "normal-form"{reversor}, kicks = {{ count = 2, width = 2 }}, twists = {{ count = 1, width = 2 }} }}
            weights = {{ kind = "normal", scale = 0.1 }}
            [training]
            iterations = 2
            "#
        );
        std::fs::write(folder.path().join("own.toml"), scene).expect("written");
        let output = run(folder.path(), "own.toml", "out");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let said = String::from_utf8(output.stdout).expect("text");
        let (text, data) = report(&folder.path().join("out"));
        std::fs::remove_dir_all(folder.path().join("out")).expect("removed");
        let notes = data["studies"]["pairs"]["notes"].as_array().cloned().unwrap_or_default();
        let notes: Vec<String> =
            notes.iter().map(|note| note.as_str().expect("a text").to_owned()).collect();
        for note in &notes {
            let begin = &note[..40.min(note.len())];
            assert!(text.contains(note) && said.contains(begin), "{note} in {text}");
        }
        // Also as a reason against long orbits.
        assert_eq!(text.contains("change areas by 2.0e-2 a step"), shrinks < 1.0, "{text}");
        notes
    };
    assert_eq!(notes(1.0, ""), Vec::<String>::new());
    let friction = notes(0.99, "");
    let [area] = &friction[..] else { panic!("{friction:?}") };
    assert!(area.contains("dq∧dp by 2.0e-2"), "{area}");
    let reversed = notes(1.0, ", reversor = \"positions\"");
    assert!(reversed.iter().any(|note| note.contains("reversible")), "{reversed:?}");
}

/// The scene of the guide, as it stands there.
#[test]
fn the_guide_shows_a_scene() {
    let chapter = include_str!("../src/guide/program.md");
    let block = chapter.split("```toml").nth(1).expect("a scene").split("```").next();
    let block = block.expect("its end").lines().map(str::trim).collect::<Vec<_>>().join("\n");
    let folder = tempfile::tempdir().expect("a folder");
    write_data(folder.path(), 1.0);
    let scene =
        block.replace("steps = 100", "steps = 12").replace("iterations = 200", "iterations = 9");
    assert!(scene != block);
    std::fs::write(folder.path().join("own.toml"), scene).expect("written");
    let output = run(folder.path(), "own.toml", "out");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let portrait = std::fs::read_to_string(folder.path().join("out/portrait.svg")).expect("a plot");
    assert!(portrait.contains("trajectory 3"));
}

/// Numbers of three dimensions in either order of memory.
#[test]
fn trajectories_are_read_in_either_order() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("t.npy");
    let shape = [3, 2, 4];
    let value = |t: usize, m: usize, k: usize| (100 * t + 10 * m + k) as f64;
    let mut columns_first = Vec::new();
    for k in 0..shape[2] {
        for m in 0..shape[1] {
            for t in 0..shape[0] {
                columns_first.extend(value(t, m, k).to_le_bytes());
            }
        }
    }
    let header = "{'descr': '<f8', 'fortran_order': True, 'shape': (3, 2, 4), }";
    let header = format!("{header:<117}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(columns_first);
    std::fs::write(&file, bytes).expect("written");
    let found = read_trajectories(&file, 2).expect("trajectories");
    assert_eq!((found.states(), found.count(), found.dim()), (3, 2, 4));
    for t in 0..3 {
        for m in 0..2 {
            let expected: Vec<f64> = (0..4).map(|k| value(t, m, k)).collect();
            assert_eq!(found.state(t, m), expected);
        }
    }
}

/// What the library writes for a Hamiltonian of one's own, the program takes.
#[test]
fn a_hamiltonian_of_ones_own_makes_a_scene() {
    struct Springy;
    impl Hamiltonian for Springy {
        fn dof(&self) -> usize {
            2
        }
        fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
            let (half, one) = (constant::<S>(0.5), constant::<S>(1.0));
            let slow = half * z[3] * z[3] - (one + z[0]) * z[1].sin_cos().1;
            half * (z[0] * z[0] + z[2] * z[2]) + constant::<S>(0.02) * slow
        }
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    let window = Window { low: vec![-1.0; 4], high: vec![1.0; 4], samples: 400 };
    let points = sample(&[window], 2, &mut Stream::new(1, "points")).expect("a window");
    let (pairs, error) = Pairs::of_flow(&Springy, points, 5.0).expect("converges");
    let initial = [0.8, 0.4, 0.0, 0.0];
    let orbit = ReferenceTrajectories::of_flow(&Springy, &initial, 5.0, 11).expect("converges");
    assert!(error < 1e-12 && orbit.error < 1e-12);
    write_pairs(&path.join("pairs.npz"), &pairs).expect("written");
    write_trajectories(&path.join("t.npy"), &orbit.trajectories).expect("written");
    let back = read_trajectories(&path.join("t.npy"), 2).expect("trajectories");
    assert_eq!(back, orbit.trajectories);
    let scene = r#"
name = "springy"
flow_time = 5.0

[data]
pairs = "pairs.npz"
trajectories = "t.npy"
circle_action = [1, 0]
epsilon = 0.02
validation = 0.1

[training]
iterations = 60
loss = { kind = "mean-squared-error" }
optimiser = { kind = "levenberg-marquardt" }

[rollout]
steps = 10
every = 1

[[models]]
name = "form"
network = { kind = "normal-form", kicks = { count = 6, width = 4 }, twists = { count = 6, width = 4 } }
weights = { kind = "normal", scale = 0.15 }
"#;
    std::fs::write(path.join("own.toml"), scene).expect("written");
    let output = run(path, "own.toml", "out");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report = std::fs::read_to_string(path.join("out/report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    let rolled = &report["studies"]["rollout"]["models"][0];
    let error = rolled["rms_error"].as_f64().expect("a number");
    assert!(error < 1e-3, "{rolled}");
}

/// A scene that names neither action nor ε nor a held-out share has those of `train`; what is found is in its report,
/// also when it is run again as it was run, and in jobs.
#[test]
fn a_scene_finds_the_circle_action_of_its_pairs() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    let window = Window { low: vec![-1.0; 4], high: vec![1.0; 4], samples: 400 };
    let points = sample(&[window], 2, &mut Stream::new(1, "points")).expect("points");
    let system = Oscillators { epsilon: 0.01 };
    // The plane that turns is the second.
    let order = [1, 0, 3, 2];
    let (pairs, _) = Pairs::of_flow(&system, points, 0.5).expect("a flow");
    write_pairs(&path.join("pairs.npz"), &pairs.with_columns(&order)).expect("written");
    let few = pairs.with_columns(&order).thinned(60);
    write_pairs(&path.join("few.npz"), &few).expect("written");
    let scene = r#"
name = "own"
seed = 3
flow_time = 0.5

[data]
pairs = "pairs.npz"

[training]
iterations = 30
loss = { kind = "by-plane" }
optimiser = { kind = "levenberg-marquardt" }
starts = { count = 1, iterations = 40 }

[certificate]
samples = 5
radius = 1.0

[[models]]
name = "one"
network = { kind = "normal-form", kicks = { count = 4, width = 4 }, twists = { count = 4, width = 4 } }
weights = { kind = "normal", scale = 0.15 }
"#;
    let write = |name: &str, text: &str| std::fs::write(path.join(name), text).expect("written");
    write("own.toml", scene);
    let output = run(path, "own.toml", "out");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    assert!(said.contains("looking for the circle action of"), "{said}");
    let (text, data) = report(&path.join("out"));
    assert!(text.contains("circle action 0,1: after") && text.contains("[0, 1], 0.01"), "{text}");
    assert_eq!(data["studies"]["pairs"]["held_out"], 40);

    // Given, it is the same scene but for the note.
    let given = "pairs = \"pairs.npz\"\ncircle_action = [0, 1]\nepsilon = 0.01\nvalidation = 0.1";
    write("given.toml", &scene.replace("pairs = \"pairs.npz\"", given));
    assert!(run(path, "given.toml", "given").status.success());
    let (_, of_given) = report(&path.join("given"));
    let trained = |data: &Value| data["studies"]["training"]["models"].clone();
    assert!(trained(&data).is_array() && trained(&data) == trained(&of_given));
    let notes = data["studies"]["pairs"]["notes"].as_array().expect("notes");
    assert!(notes.len() == 1 && of_given["studies"]["pairs"]["notes"].is_null());

    // What `[training]` does not say is as recommended, not as in other scenes.
    let bare = scene.replace(
        "loss = { kind = \"by-plane\" }\noptimiser = { kind = \"levenberg-marquardt\" }\nstarts = { count = 1, \
         iterations = 40 }\n",
        "",
    );
    assert!(bare != scene);
    write("bare.toml", &bare);
    assert!(run(path, "bare.toml", "bare").status.success());
    let (_, of_bare) = report(&path.join("bare"));
    assert!(trained(&of_bare) != trained(&data));
    let as_run = std::fs::read_to_string(path.join("bare/as-run.toml")).expect("a scene");
    assert!(as_run.contains("by-plane") && as_run.contains("plateau"), "{as_run}");
    let starts = |count: u32| format!("[training.starts]\ncount = {count}\niterations = 40\n");
    assert!(as_run.contains(&starts(3)), "{as_run}");
    // A short form has one set of weights, and says so.
    let arguments = ["run", "bare.toml", "--out", "quick", "--quick"];
    let program = env!("CARGO_BIN_EXE_gyroceptron");
    let output = Command::new(program).current_dir(path).args(arguments).output();
    assert!(output.expect("it starts").status.success());
    let as_run = std::fs::read_to_string(path.join("quick/as-run.toml")).expect("a scene");
    assert!(as_run.contains(&starts(1)), "{as_run}");
    let windows =
        "windows = [{ low = [-1.0, -1.0, -1.0, -1.0], high = [1.0, 1.0, 1.0, 1.0], samples = 40 }]";
    let of_system = bare.replace("pairs = \"pairs.npz\"", windows);
    let of_system = "[system]\nkind = \"oscillators\"\nepsilon = 0.01\n\n".to_owned()
        + &of_system.replace("name = \"own\"\nseed = 3\nflow_time = 0.5\n", "");
    write("system.toml", &format!("name = \"own\"\nseed = 3\nflow_time = 0.5\n{of_system}"));
    assert!(run(path, "system.toml", "system").status.success());
    let as_run = std::fs::read_to_string(path.join("system/as-run.toml")).expect("a scene");
    assert!(as_run.contains("mean-squared-error") && as_run.contains("l-bfgs"), "{as_run}");

    // As `train` has it.
    let train = "train --data pairs.npz --kicks 4x4 --twists 4x4 --iterations 30 --flow-time 0.5 --seed 3 \
                 --output model.json";
    let of = |name: &str| load_model(&path.join(name)).expect("a model").model;
    for (added, own) in [("", "bare"), ("--starts 1 --plateau 0 --overwrite", "out")] {
        let words = train.split_whitespace().chain(added.split_whitespace());
        let output = Command::new(program).current_dir(path).args(words).output();
        assert!(output.expect("it starts").status.success());
        let own = of(&format!("{own}/model.json"));
        assert_eq!(of("model.json").parameters(), own.parameters());
    }

    let bytes = |out: &str| std::fs::read(path.join(out).join("report.json")).expect("data");
    assert!(run(path, "out/as-run.toml", "again").status.success());
    assert_eq!(bytes("again"), bytes("out"));
    // Gone on with, it finds the same.
    let resumed = ["run", "own.toml", "--out", "again", "--resume"];
    let output = Command::new(program).current_dir(path).args(resumed).output();
    assert!(output.expect("it starts").status.success());
    assert_eq!(bytes("again"), bytes("out"));
    for added in [&["--job", "train-one"][..], &["--merge"]] {
        let arguments = [&["run", "own.toml", "--out", "jobs"], added].concat();
        let output = Command::new(program).current_dir(path).args(arguments).output();
        let output = output.expect("it starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    assert_eq!(bytes("jobs"), bytes("out"));

    // With few pairs nothing is sure: before anything is trained or a folder made.
    write("few.toml", &scene.replace("pairs.npz", "few.npz"));
    let output = run(path, "few.toml", "few");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    let last = said.lines().last().expect("an error");
    assert!(last.contains("data.circle_action of") && last.contains("few.npz"), "{said}");
    assert!(last.contains("fewer than 100 pairs"), "{said}");
    assert!(!said.contains("training one") && !path.join("few").exists(), "{said}");
    // What is found does not fit the network.
    let other =
        scene.replace("kind = \"normal-form\"", "kind = \"normal-form\", action = [[1, 0]]");
    write("other.toml", &other);
    let output = run(path, "other.toml", "other");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("models.one") && said.contains("action"), "{said}");
    assert!(!path.join("other").exists());
}

/// Pairs of several ε and flow times are learnt as `train` learns them, with a ramp over some; what no network of a
/// scene can learn from a file is refused before anything is trained.
#[test]
fn a_scene_learns_a_family_of_maps_as_train_does() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    let mut stream = Stream::new(1, "points");
    let mut runs = Vec::new();
    for (epsilon, time) in [(0.1, 1.0), (0.05, 1.0), (0.1, 0.5), (-0.05, 1.0)] {
        let window = Window { low: vec![-1.0; 4], high: vec![1.0; 4], samples: 60 };
        let points = sample(&[window], 2, &mut stream).expect("points");
        let (pairs, _) = Pairs::of_flow(&Oscillators { epsilon }, points, time).expect("a flow");
        runs.push((epsilon, time, pairs));
    }
    let ends = |of: fn(&Pairs) -> &[f64]| runs.iter().flat_map(|run| of(&run.2)).copied().collect();
    let all = Pairs::new("pairs", 2, ends(Pairs::input), ends(Pairs::output)).expect("finite");
    let of = |value: fn(&(f64, f64, Pairs)) -> f64| -> Vec<f64> {
        runs.iter().flat_map(|run| vec![value(run); run.2.len()]).collect()
    };
    let (epsilons, times) = (of(|run| run.0), of(|run| run.1));
    let family = all.clone().with_epsilons_and_times(&epsilons, &times).expect("a family");
    write_pairs(&path.join("family.npz"), &family).expect("written");
    write_pairs(&path.join("one.npz"), &all).expect("written");
    let ones = vec![1.0; all.len()];
    let controlled = all.under_controls(&ones, &ones, &epsilons).expect("controls");
    write_pairs(&path.join("lambda.npz"), &controlled).expect("written");

    let scene = "name = \"own\"\nseed = 3\nflow_time = 1.0\nplots = [\"loss\", \"prediction\", \"orbits\"]\n[data]\n\
                 pairs = \"family.npz\"\nepsilon = 0.1\ncircle_action = [1, 0]\n[training]\niterations = 20\n\
                 starts = { count = 1, iterations = 20 }\nramp = [{ flow_time = 0.5, iterations = 3 }]\n[[models]]\n\
                 name = \"one\"\nnetwork = { kind = \"normal-form\", kicks = { count = 2, width = 4 }, twists = \
                 { count = 2, width = 4 } }\nweights = { kind = \"normal\", scale = 0.15 }\n";
    std::fs::write(path.join("own.toml"), scene).expect("written");
    let output = run(path, "own.toml", "out");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let words = "train --data family.npz --circle-action 1,0 --kicks 2x4 --twists 2x4 --iterations 20 --starts 1 \
                 --ramp 0.5x3 --epsilon 0.1 --flow-time 1 --seed 3 --output model.json";
    let program = env!("CARGO_BIN_EXE_gyroceptron");
    let trained = Command::new(program).current_dir(path).args(words.split_whitespace()).output();
    let trained = trained.expect("it starts");
    assert!(trained.status.success(), "{}", String::from_utf8_lossy(&trained.stderr));
    let of = |name: &str| load_model(&path.join(name)).expect("a model");
    let (own, other) = (of("out/model.json"), of("model.json"));
    assert_eq!(own.model.parameters(), other.model.parameters());
    assert_eq!(own.provenance.data, other.provenance.data);
    assert_eq!(own.provenance.validation, other.provenance.validation);
    let (text, _) = report(&path.join("out"));
    assert!(text.contains("have ε below 0"), "{text}");
    let said = String::from_utf8_lossy(&trained.stderr);
    assert!(said.contains("have ε below 0"), "{said}");

    // A stage of the network's own flow time is of all its ε; in jobs, and gone on with, it is the same; and errors
    // of one step are those of the network's own map.
    let more = scene.replace(
        "ramp = [{ flow_time = 0.5, iterations = 3 }]",
        "ramp = [{ flow_time = 1.0, iterations = 3 }]",
    ) + "[work_precision]\npoints = 20\nrounds = 1\n";
    std::fs::write(path.join("more.toml"), more).expect("written");
    let output = run(path, "more.toml", "more");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let words = words.replace("0.5x3", "1x3") + " --overwrite";
    let trained = Command::new(program).current_dir(path).args(words.split_whitespace()).output();
    assert!(trained.expect("it starts").status.success());
    let parameters = of("model.json").model.parameters().to_vec();
    assert_eq!(of("more/model.json").model.parameters(), parameters);
    assert_ne!(own.model.parameters(), parameters);
    let bytes = |out: &str| std::fs::read(path.join(out).join("report.json")).expect("data");
    for added in [&["--job", "train-one"][..], &["--merge"]] {
        let arguments = [&["run", "more.toml", "--out", "jobs"], added].concat();
        let output = Command::new(program).current_dir(path).args(arguments).output();
        assert!(output.expect("it starts").status.success());
    }
    assert_eq!(bytes("jobs"), bytes("more"));
    let resumed = ["run", "more.toml", "--out", "more", "--resume"];
    let output = Command::new(program).current_dir(path).args(resumed).output();
    assert!(output.expect("it starts").status.success());
    assert_eq!(bytes("jobs"), bytes("more"));
    let (_, data) = report(&path.join("more"));
    let one_step = &data["studies"]["work_precision"]["one_step"];
    let methods = one_step["methods"].as_array().expect("methods");
    let error = methods[0]["error"].as_f64().expect("a number");
    // As of all pairs of the network's own map, and not of those of other times.
    let mut images = runs[0].2.input().to_vec();
    let step = Rollout { steps: 1, every: 1 };
    let network = of("more/model.json");
    images = network.rollout(&images, step).expect("finite").split_off(images.len());
    let squares = images.iter().zip(runs[0].2.output()).map(|(a, b)| (a - b) * (a - b));
    let rms = (squares.sum::<f64>() / runs[0].2.len() as f64).sqrt();
    assert!(error > 0.3 * rms && error < 3.0 * rms && rms < 0.1, "{error} {rms}");

    let refused = |name: &str, scene: &str, expected: &[&str]| {
        std::fs::write(path.join(name).with_extension("toml"), scene).expect("written");
        let output = run(path, &format!("{name}.toml"), name);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(expected.iter().all(|word| said.contains(word)), "{said}");
        assert!(!said.contains("training one") && !said.contains("looking for"), "{said}");
    };
    refused(
        "lambda",
        &scene.replace("family.npz", "lambda.npz"),
        &["lambda.npz: lambda", "1 of each pair"],
    );
    let unknown = scene.replace("epsilon = 0.1\n", "");
    refused("unknown", &unknown, &["data.epsilon: expected", "family.npz has an array"]);
    // Nothing is looked for before.
    let searched = unknown.replace("circle_action = [1, 0]\n", "");
    refused("searched", &searched, &["data.epsilon", "family.npz"]);
    let timeless = scene.replace("flow_time = 1.0\n", "");
    refused("timeless", &timeless, &["flow_time: expected", "family.npz has an array"]);
    let other = scene.replace("epsilon = 0.1\n", "epsilon = 0.2\n");
    refused("other", &other, &["data.epsilon and flow_time", "ε = 0.2", "family.npz"]);
    let stage = scene.replace("flow_time = 0.5, iter", "flow_time = 0.25, iter");
    refused("stage", &stage, &["training.ramp", "flow time 0.25"]);
    refused("one", &scene.replace("family.npz", "one.npz"), &["training.ramp", "flow time 0.5"]);
    let henon = scene
        .replace("normal-form", "henon-net")
        .replace("kicks = { count = 2, width = 4 }, twists", "layers");
    refused("henon", &henon, &["models.one", "family.npz", "a gyroceptron to learn a family"]);
}

/// Ctrl-C ends the search for an action, of a plan and of a run, which goes on with `--resume`.
#[cfg(unix)]
#[test]
fn the_search_for_an_action_can_be_interrupted() {
    use std::io::{BufRead, BufReader};
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    let window = Window { low: vec![-1.0; 4], high: vec![1.0; 4], samples: 6000 };
    let points = sample(&[window], 2, &mut Stream::new(1, "points")).expect("points");
    let (pairs, _) = Pairs::of_flow(&Oscillators { epsilon: 0.01 }, points, 0.5).expect("a flow");
    write_pairs(&path.join("pairs.npz"), &pairs).expect("written");
    let scene = "name = \"own\"\nseed = 3\nflow_time = 0.5\n[data]\npairs = \"pairs.npz\"\n[training]\niterations = 1\n\
                 starts = { count = 1, iterations = 1 }\n[[models]]\nname = \"one\"\nnetwork = { kind = \
                 \"normal-form\", kicks = { count = 1, width = 1 }, twists = { count = 1, width = 1 } }\n\
                 weights = { kind = \"normal\", scale = 0.15 }\n";
    std::fs::write(path.join("own.toml"), scene).expect("written");
    for arguments in [&["--out", "plan", "--plan", "--no-estimate"][..], &["--out", "out"]] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gyroceptron"));
        command.current_dir(path).args(["run", "own.toml"]).args(arguments);
        let mut child = command
            .stdout(std::process::Stdio::null())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .expect("it starts");
        let said = BufReader::new(child.stderr.take().expect("a pipe"));
        let mut said = said.lines().map(|line| line.expect("text"));
        assert!(said.any(|line| line.contains("looking for the circle action of")));
        let id = child.id().to_string();
        let signal = Command::new("kill").args(["-INT", &id]).status();
        assert!(signal.expect("sent").success());
        let rest: Vec<String> = said.collect();
        assert_eq!(child.wait().expect("ends").code(), Some(130), "{rest:?}");
        assert!(!path.join("out/model.json").exists() && !path.join("out/jobs").exists());
        let again: &[&str] = if arguments.contains(&"--plan") { &[] } else { &["--resume"] };
        let output = command.args(again).stderr(std::process::Stdio::null()).output();
        assert!(output.expect("it starts").status.success(), "{arguments:?}");
    }
}

/// Two planes that turn with frequencies of their own: found in a part, `"auto"`, given, and beside a network of one
/// circle.
#[test]
fn a_scene_finds_several_circles() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    let window = Window { low: vec![-1.0; 4], high: vec![1.0; 4], samples: 300 };
    let points = sample(&[window], 2, &mut Stream::new(1, "points")).expect("points");
    let moved = |z: &[f64]| {
        let kick = |q: f64| 0.003 * q * q;
        let (z, mut out) = ([z[0], z[1], z[2] + kick(z[0]), z[3] - kick(z[1])], [0.0; 4]);
        for (j, angle) in [0.9f64, 2.3].into_iter().enumerate() {
            let (sin, cos) = libm::sincos(angle);
            out[j] = cos * z[j] + sin * z[2 + j];
            out[2 + j] = cos * z[2 + j] - sin * z[j];
        }
        out
    };
    let output = points.chunks_exact(4).flat_map(moved).collect();
    let pairs = Pairs::new("pairs", 2, points.clone(), output).expect("finite");
    write_pairs(&path.join("pairs.npz"), &pairs).expect("written");
    let scene = |action: &str| {
        format!(
            r#"
name = "turns"
[[parts]]
name = "own"
seed = 3
flow_time = 1.0
[parts.data]
pairs = "pairs.npz"
{action}
[parts.training]
iterations = 10
loss = {{ kind = "by-plane" }}
optimiser = {{ kind = "levenberg-marquardt" }}
starts = {{ count = 1, iterations = 40 }}
[[parts.models]]
name = "form"
network = {{ kind = "normal-form", kicks = {{ count = 2, width = 4 }}, twists = {{ count = 2, width = 4 }} }}
weights = {{ kind = "normal", scale = 0.15 }}
"#
        )
    };
    let of = |name: &str, action: &str| {
        // A scene that names no flow time has this one.
        let scene = scene(action)
            .replace("flow_time = 1.0\n", if name == "auto" { "" } else { "flow_time = 1.0\n" });
        std::fs::write(path.join("own.toml"), scene).expect("written");
        let output = run(path, "own.toml", name);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        assert_eq!(said.contains("looking for"), name != "given", "{said}");
        let folder = path.join(name).join("own");
        let (text, data) = report(&folder);
        let model = load_model(&folder.join("model.json")).expect("a model").model;
        (text, data["studies"]["pairs"].clone(), model)
    };
    let (text, pairs, model) = of("found", "");
    assert!(text.contains("circle action 1,0/0,1: after"), "{text}");
    assert!(text.contains("[[1, 0], [0, 1]], 0.01") && pairs["notes"].is_array(), "{text}");
    assert_eq!(pairs["circle_action"], serde_json::json!([[1, 0], [0, 1]]));
    assert_eq!(model.angles().len(), 2);
    let given = ["circle_action = \"auto\"", "circle_action = [[1, 0], [0, 1]]"];
    for (name, action) in ["auto", "given"].into_iter().zip(given) {
        let (_, data, same) = of(name, action);
        assert_eq!(same.parameters(), model.parameters(), "{name}");
        assert_eq!(data["circle_action"], pairs["circle_action"]);
        assert_eq!(data["notes"].is_array(), name == "auto");
    }
    let bad = scene("circle_action = \"find\"");
    std::fs::write(path.join("bad.toml"), bad).expect("written");
    let output = run(path, "bad.toml", "bad");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(2) && said.contains("[1, 0]"), "{said}");
    // A network of one circle: only single ones are looked for.
    let one = "network = { kind = \"gyroceptron\", psi = { count = 1, width = 2 }, near_identity = { count = 1, width = 2 } }\n";
    let text = scene("") + "\n[[parts.models]]\nname = \"one\"\n" + one;
    std::fs::write(path.join("one.toml"), text).expect("written");
    let output = run(path, "one.toml", "one");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    let (_, data) = report(&path.join("one/own"));
    let found = data["studies"]["pairs"]["circle_action"].as_array().expect("circles").len();
    assert_eq!(found, 1);
    // What a training comes to depends on it: other digests of its job.
    std::fs::write(path.join("own.toml"), scene("")).expect("written");
    let digest = |scene: &str| {
        let program = env!("CARGO_BIN_EXE_gyroceptron");
        let arguments = ["run", scene, "--out", "plan", "--plan", "--no-estimate"];
        let output = Command::new(program).current_dir(path).args(arguments).output();
        let lines = String::from_utf8(output.expect("it starts").stdout).expect("text");
        let jobs = lines.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
        let mut of_form = jobs.filter(|job| job["network"] == "form");
        of_form.next().expect("a training")["digest"].clone()
    };
    assert_ne!(digest("own.toml"), digest("one.toml"));
}
