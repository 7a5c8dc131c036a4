//! Running, listing and showing scenes.

use crate::helpers::{SCENE, folder, refuses, succeeds, text, two_parts, with_scene};
use gyroceptron::measure::timing::{AtError, WorkPrecision};
use serde_json::Value;
use std::path::Path;

/// What is checked before a scene begins holds of all that are built in, with a quarter of the pairs too.
#[test]
fn built_in_scenes_can_be_run_quickly() {
    let folder = folder();
    for entry in gyroceptron::scene::catalogue() {
        let plan = ["run", entry.name, "--plan", "--no-estimate", "--quick"];
        match entry.name {
            // Of a file that its authors published.
            "published-weights" => refuses(folder.path(), &plan, &["--weights"]),
            _ => drop(succeeds(folder.path(), &plan)),
        }
    }
}

#[test]
fn a_scene_runs_to_a_report() {
    let folder = with_scene("small.toml", SCENE);
    let output = succeeds(folder.path(), &["run", "small.toml"]);
    let summary = text(&output.stdout);
    assert!(summary.contains("holds: 25 laws") && !summary.contains("symplecticity"));
    let out = folder.path().join("gyroceptron-out/small");
    let report = std::fs::read_to_string(out.join("report.md")).expect("a report");
    for words in ["seed 3", "Structure certificate", "held-out mean squared error", "μ₀"] {
        assert!(report.contains(words), "the report lacks {words}");
    }
    for plot in ["loss", "portrait", "adiabatic-invariant", "rollout-error"] {
        let svg = std::fs::read_to_string(out.join(format!("{plot}.svg"))).expect("a plot");
        assert!(svg.starts_with("<svg") && svg.len() > 3000, "{plot}");
        assert!(report.contains(&format!("({plot}.csv)")), "{plot}");
    }
    // The table of the certificate comes last, accuracy first.
    let place = |words: &str| report.find(words).expect(words);
    assert!(place("## Training") < place("## Roll-out"));
    assert!(place("## Roll-out") < place("## Structure certificate"));
    assert!(place("## Timings on this machine") < place("## Appendix: Structure certificate"));
    assert!(place("## Appendix") < place("| headroom |"));
    // All points of a figure are in the file beside it, as they are in the report.
    let csv = std::fs::read_to_string(out.join("portrait.csv")).expect("data");
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines[0], "panel,series,x,y");
    let of_model = lines.iter().filter(|line| line.starts_with("\"gyroceptron\",\"q₂"));
    assert_eq!(of_model.count(), 2 * 11, "two orbits of eleven states");
    let json: Value =
        serde_json::from_slice(&std::fs::read(out.join("report.json")).expect("a report"))
            .expect("JSON");
    let studies = &json["studies"];
    assert_eq!(json["holds"], true);
    assert_eq!(studies["certificate"][0]["rows"][0]["verdict"], "holds");
    assert!(studies["pairs"]["reference_error"].as_f64().expect("a number") < 1e-13);
    let model = &studies["training"]["models"][0];
    let held_out = model["best"]["validation"].as_f64().expect("a number");
    let rotation = studies["pairs"]["rotation_error"].as_f64().expect("a number");
    assert!(held_out < rotation, "{held_out:e} against {rotation:e}");
    // What a scene does not name is not made.
    assert!(!out.join("checkpoint-gyroceptron").exists());
}

#[test]
fn the_same_scene_gives_the_same_bits_on_one_thread_and_on_two() {
    let folder = with_scene("small.toml", SCENE);
    for (threads, out) in [("1", "one"), ("2", "two")] {
        succeeds(folder.path(), &["small.toml", "--threads", threads, "--out", out]);
    }
    for file in ["report.json", "model.json", "portrait.svg"] {
        let read = |out: &str| std::fs::read(folder.path().join(out).join(file)).expect("there");
        assert!(read("one") == read("two"), "{file}");
    }
}

#[test]
fn a_scene_computes_only_what_it_names() {
    let start = SCENE.find("[certificate]").expect("in the scene");
    let bare =
        SCENE[..start].replace("\"portrait\", \"adiabatic-invariant\", \"rollout-error\"", "");
    let folder = with_scene("bare.toml", &bare);
    let output = succeeds(folder.path(), &["bare.toml", "--out", "out", "--json"]);
    let json: Value = serde_json::from_slice(&output.stdout).expect("one JSON document");
    let studies: Vec<_> = json["studies"].as_object().expect("studies").keys().collect();
    assert_eq!(studies, ["pairs", "training"]);
    assert!(!folder.path().join("out/portrait.svg").exists());
}

const COMPARISON: &str = r#"
[work_precision]
points = 32
rounds = 2
differences = [1e-1, 1e-2]
integrators = [
    { integrator = { kind = "runge-kutta-4" }, one_step = [2, 4], rollout = [8, 16] },
    { integrator = { kind = "aba-864" }, one_step = [1], rollout = [2, 4] },
    { integrator = { kind = "gauss-legendre", stages = 4 }, one_step = [1], rollout = [8] },
]

[tanh]
values = 512
largest = 20.0
rounds = 2
"#;

/// The scene with error against run time, and its plots.
fn comparing() -> String {
    SCENE.replace("\"rollout-error\"]", "\"error-against-time\", \"jacobians\", \"tanh\"]")
        + COMPARISON
}

#[test]
fn error_against_run_time_is_reported() {
    let folder = with_scene("small.toml", &comparing());
    for (threads, out) in [("1", "one"), ("2", "two")] {
        succeeds(folder.path(), &["small.toml", "--threads", threads, "--out", out]);
    }
    let read = |name: &str| std::fs::read(folder.path().join(name)).expect("there");
    // Errors are results, times are not.
    assert!(read("one/report.json") == read("two/report.json"));
    let json: Value = serde_json::from_slice(&read("one/report.json")).expect("JSON");
    let compared = &json["studies"]["work_precision"];
    let methods = compared["rollout"]["methods"].as_array().expect("methods");
    let of = |methods: &[Value], name: &str| -> Vec<f64> {
        let named = methods.iter().filter(|m| m["name"].as_str().expect("a name").contains(name));
        named.map(|m| m["error"].as_f64().expect("an error")).collect()
    };
    let rk4 = of(methods, "RK4");
    assert_eq!(of(methods, "gyroceptron").len(), 1);
    // Of order 4.
    assert!((rk4[0] / rk4[1] / 16.0 - 1.0).abs() < 0.2, "{rk4:?}");
    assert!(methods.iter().all(|m| m["seconds"].is_null()));
    let methods = compared["jacobians"][0]["methods"].as_array().expect("methods");
    assert!(of(methods, "duals")[0] < 1e-14 && of(methods, "chain rule")[0] < 1e-14);
    // Of order 2.
    let differences = of(methods, "differences");
    assert!((differences[0] / differences[1] / 100.0 - 1.0).abs() < 0.1, "{differences:?}");
    // Those of the C library are of the machine.
    let tanh = &json["studies"]["tanh"];
    assert_eq!(tanh.as_array().expect("methods").len(), 3);
    assert!(tanh[0]["tanh_ulps"].as_f64().expect("a number") < 3.0);

    let timings: Value = serde_json::from_slice(&read("one/timings.json")).expect("JSON");
    assert_eq!(timings["studies"]["tanh"].as_array().expect("methods").len(), 5);
    let compared = &timings["studies"]["work_precision"];
    // All together, and one alone, of every method.
    for timed in compared["one_step"]["methods"].as_array().expect("methods") {
        for timed in [&timed["seconds"], &timed["alone"]] {
            assert!(
                timed["lower"].as_f64() <= timed["upper"].as_f64() && timed["lower"].is_number()
            );
        }
    }
    assert!(compared["rollout"]["together"].as_u64() >= Some(64));
    let report = text(&read("one/report.md"));
    // The winner that the sentences name is the one that the figures show.
    for comparison in ["one_step", "rollout"] {
        let methods = compared[comparison]["methods"].as_array().expect("methods");
        let judged: Vec<WorkPrecision> =
            serde_json::from_value(methods.clone().into()).expect("as they are written");
        let network = judged.iter().find(|method| method.name == "gyroceptron");
        let error = network.and_then(|network| network.error).expect("an error");
        let best = AtError::fastest(&judged, error).expect("an integrator as accurate");
        let winner =
            format!("{} with {} step", best.method.name, best.method.setting.expect("some"));
        let said = report.lines().any(|line| {
            line.starts_with("- `gyroceptron` errs by") && line.contains(&format!(": {winner}"))
        });
        assert!(said, "{winner}");
    }
    for words in [
        "errs by",
        "one alone",
        "Fastest of all",
        "RK4 | 16 |",
        "ABA(8,6,4)",
        "duals err by",
        "libm, sech²",
        "What was computed",
        "| error against run time: Jacobians |",
    ] {
        assert!(report.contains(words), "the report lacks {words}");
    }
    for plot in ["error-against-time", "jacobians", "tanh"] {
        let svg = text(&read(&format!("one/{plot}.svg")));
        assert!(svg.contains("error against run time") || plot == "jacobians", "{plot}");
        assert!(svg.contains("µs a") || svg.contains("ns a"), "{plot} has no labelled axis");
    }
}

const TRAJECTORIES: &str = r#"
name = "orbits"
flow_time = 0.2
plots = ["trajectories"]

[system]
kind = "oscillators"
epsilon = 0.0

[trajectories]
epsilons = [0.0, 0.02, 0.1]
steps = 400
initial = [[1.5, 0.3, 0.0, 0.0], [0.9, -0.8, 0.0, 0.0]]
"#;

#[test]
fn trajectories_are_drawn_and_measured() {
    let folder = with_scene("orbits.toml", TRAJECTORIES);
    let output = succeeds(folder.path(), &["orbits.toml", "--out", "out", "--json"]);
    let json: Value = serde_json::from_slice(&output.stdout).expect("one JSON document");
    let each = json["studies"]["trajectories"].as_array().expect("an entry for each ε");
    assert_eq!(each.len(), 3);
    let number = |value: &Value| value.as_f64().expect("a number");
    for of in each {
        let epsilon = number(&of["epsilon"]);
        assert!(number(&of["reference_error"]) < 1e-11);
        for m in 0..2 {
            assert!(number(&of["energy"][m]["largest"]) < 1e-12, "H is conserved");
            let (fast, slow) = (number(&of["excursions"][m][0]), number(&of["excursions"][m][1]));
            let drift = number(&of["adiabatic"][m]["largest"]);
            // The fast oscillator goes all around.
            let radius = (2.0 * number(&of["adiabatic"][m]["initial"])).sqrt();
            assert!((fast / (2.0 * radius) - 1.0).abs() < 0.01 + 3.0 * epsilon, "{fast}");
            if epsilon == 0.0 {
                // The slow one stands still, and μ₀ is conserved.
                assert!(slow == 0.0 && drift < 1e-12, "{slow:e} {drift:e}");
            } else {
                assert!(slow > 0.5, "{slow} at ε = {epsilon}");
                assert!(drift > 0.1 * epsilon && drift < 5.0 * epsilon, "{drift:e}");
            }
        }
    }
    let read = |name: &str| std::fs::read_to_string(folder.path().join("out").join(name));
    let svg = read("trajectories.svg").expect("a figure");
    // A row for each ε, a column for each plane.
    assert!(svg.contains("width=\"1301\" height=\"1380\""), "{}", &svg[..200]);
    for words in ["ε = 0.1, (q₁, p₁)", "ε = 0, (q₂, p₂)"] {
        assert!(svg.contains(words), "the figure lacks {words}");
    }
    for label in ["q₁", "p₁", "q₂", "p₂"] {
        let labels = svg.lines().filter(|line| line.trim() == label).count();
        assert_eq!(labels, 3, "{label} at each of its axes");
    }
    let report = read("report.md").expect("a report");
    assert!(report.contains("excursion of plane 2") && report.contains("(trajectories.svg)"));
    assert!(!folder.path().join("out/model.json").exists());
    for (from, to, word) in [
        ("epsilons = [0.0,", "epsilons = [nan,", "epsilons"),
        ("epsilons = [0.0, 0.02, 0.1]", "epsilons = []", "epsilons"),
        ("steps = 400", "steps = 0", "steps"),
        ("[0.9, -0.8, 0.0, 0.0]]", "[0.9, 1.2, 0.0]]", "initial"),
        ("plots = [\"trajectories\"]", "plots = [\"portrait\"]", "trajectories"),
        ("flow_time = 0.2\n", "", "flow_time"),
        ("steps = 400", "steps = 400\nstep = 1", "`step`"),
    ] {
        assert!(TRAJECTORIES.contains(from), "{from}");
        let folder = with_scene("bad.toml", &TRAJECTORIES.replacen(from, to, 1));
        refuses(folder.path(), &["run", "bad.toml", "--out", "o"], &[word]);
    }
}

#[test]
fn scenes_that_compare_or_have_parts_are_checked() {
    let whole = comparing();
    for (from, to, word) in [
        ("points = 32", "points = 0", "points"),
        ("rounds = 2\ndifferences", "rounds = 0\ndifferences", "rounds"),
        ("one_step = [2, 4]", "one_step = [2, 0]", "steps"),
        ("stages = 4", "stages = 0", "stages"),
        ("stages = 4", "stages = 400", "stages"),
        ("differences = [1e-1,", "differences = [-1e-1,", "differences"),
        ("kind = \"aba-864\"", "kind = \"aba-865\"", "aba-865"),
        ("one_step = [1], rollout = [2, 4]", "one_stp = [1]", "one_step"),
        ("values = 512", "values = 0", "values"),
        ("largest = 20.0", "largest = nan", "largest"),
        ("largest = 20.0", "largest = 360.0", "largest"),
        ("steps = 100\nevery = 10\n", "steps = 100\nevery = 101\n", "every"),
        ("differences = [1e-1, 1e-2]", "", "jacobians"),
    ] {
        assert!(whole.contains(from), "{from}");
        let folder = with_scene("bad.toml", &whole.replacen(from, to, 1));
        refuses(folder.path(), &["run", "bad.toml", "--out", "o"], &[word]);
    }
    // A scene that measures tanh is an experiment too where it names a part of one.
    let system = "[system]\nkind = \"oscillators\"\nepsilon = 0.01\n";
    let lacking = whole.replacen(system, "", 1).replacen("\"portrait\", ", "", 1);
    let folder = with_scene("bad.toml", &lacking);
    refuses(folder.path(), &["run", "bad.toml", "--out", "o"], &["system"]);
    let both = two_parts();
    for (from, to, word) in [
        ("name = \"second\"", "name = \"first\"", "first"),
        ("name = \"second\"", "name = \"../second\"", "name"),
        ("name = \"both\"", "name = \"both\"\nflow_time = 1.0", "parts"),
        ("name = \"both\"", "name = \"both\"\n[training]\niterations = 3", "parts"),
        ("flow_time = 0.5\n", "", "flow_time"),
    ] {
        let folder = with_scene("bad.toml", &both.replacen(from, to, 1));
        refuses(folder.path(), &["run", "bad.toml", "--out", "o"], &[word]);
    }
}

#[test]
fn several_networks_share_a_scene() {
    let second = r#"
[[models]]
name = "henon-net"
network = { kind = "henon-net", layers = { count = 4, width = 4 } }
weights = { kind = "glorot" }

[training]
"#;
    let folder = with_scene("two.toml", &SCENE.replacen("[training]\n", second, 1));
    succeeds(folder.path(), &["two.toml", "--out", "out"]);
    for file in ["model-gyroceptron.json", "model-henon-net.json", "checkpoint-henon-net"] {
        assert!(folder.path().join("out").join(file).exists(), "{file}");
    }
}

/// The networks of all parts, in one table.
#[test]
fn parts_have_an_overview() {
    let part = |name: &str, more: &str| {
        let part = SCENE.replacen("small", name, 1).replace("\n[[", "\n[[parts.");
        let part = part.replace("\n[", "\n[parts.").replace("[parts.[parts.", "[[parts.");
        format!("[[parts]]{}", part.replace("steps = 100", more))
    };
    let scene = format!(
        "name = \"all\"\n[overview]\n{}\n{}",
        part("one", "steps = 100"),
        part("two", "steps = 50").replace("network =", "seeds = 2\nnetwork =")
    );
    let folder = with_scene("all.toml", &scene);
    succeeds(folder.path(), &["run", "all.toml", "--out", "o"]);
    let read = |file: &str| -> Value {
        let bytes = std::fs::read(folder.path().join("o").join(file)).expect("a report");
        serde_json::from_slice(&bytes).expect("one JSON document")
    };
    let (all, one) = (read("report.json"), read("one/report.json"));
    let rows = all["studies"]["overview"].as_array().expect("rows");
    assert_eq!(rows.len(), 2);
    assert_eq!((&rows[0]["part"], &rows[1]["part"]), (&"one".into(), &"two".into()));
    let model = &one["studies"]["training"]["models"][0];
    assert_eq!(rows[0]["held_out"], model["best"]["validation"]);
    assert_eq!((&rows[0]["parameters"], &rows[0]["pairs"]), (&model["parameters"], &400.into()));
    let along = &one["studies"]["rollout"]["models"][0];
    assert_eq!(rows[0]["rollout"], along["rms_error"]);
    let own = &along["own_adiabatic"];
    assert_eq!(rows[0]["own_change"], own["along_own_orbits"]["largest_change"]);
    let moved = own["near_identity_rms"].as_f64().expect("a number") / 0.01;
    assert_eq!(rows[0]["near_identity_over_epsilon"], moved);
    assert!(rows[0]["share"].as_f64() < Some(1.0) && rows[0]["theta_moved"].is_number());
    // The median of two initial weights is their mean.
    let two = read("two/report.json");
    let models = two["studies"]["training"]["models"].as_array().expect("models");
    let number = |value: &Value| value.as_f64().expect("a number");
    let [first, second] = [0, 1].map(|k| number(&models[k]["best"]["validation"]));
    assert_eq!((rows[1]["seeds"].as_u64(), models.len()), (Some(2), 2));
    assert!((number(&rows[1]["held_out"]) / f64::midpoint(first, second) - 1.0).abs() < 1e-12);
    assert_eq!(number(&rows[1]["worst_held_out"]), if first > second { first } else { second });
    let distances = &two["studies"]["rollout"]["seeds"][0]["rms_errors"];
    let [first, second] = [0, 1].map(|k| number(&distances[k]));
    assert!((number(&rows[1]["rollout"]) / f64::midpoint(first, second) - 1.0).abs() < 1e-12);
    let text = std::fs::read_to_string(folder.path().join("o/report.md")).expect("a report");
    assert!(text.contains("## All networks") && text.contains("Seconds of training"), "{text}");
    let bad = with_scene("bad.toml", &format!("{SCENE}\n[overview]\n"));
    refuses(bad.path(), &["run", "bad.toml"], &["overview"]);
}

#[test]
fn scenes_are_listed_and_shown() {
    let folder = folder();
    let listed = text(&succeeds(folder.path(), &["scenes"]).stdout);
    for entry in gyroceptron::scene::catalogue() {
        assert!(listed.contains(entry.name));
        let shown = text(&succeeds(folder.path(), &["scenes", "--show", entry.name]).stdout);
        assert_eq!(shown, entry.text);
        let scene = entry.scene().expect("a valid scene");
        assert_eq!(scene.name, entry.name);
        let written = scene.to_toml().expect("a text");
        assert!(written.starts_with(&format!("name = \"{}\"\n", entry.name)), "{written}");
        assert_eq!(gyroceptron::scene::parse(entry.name, &written).expect("a scene"), scene);
        scene.clone().with_weights(Path::new("w.npz")).0.complete().expect("complete");
        let cited = text(&succeeds(folder.path(), &["cite", entry.name]).stdout);
        assert!(cited.contains("10.1038/s41598-023-34862-w"));
        // What is cited is what is used.
        let all: Vec<_> = std::iter::once(&scene).chain(&scene.parts).collect();
        let flows = all.iter().any(|scene| scene.setup.system.is_some());
        let count = |words: &str| cited.matches(words).count();
        let polynomials = entry.text.contains("degree =");
        assert_eq!(count("DragtAbell1996") + count("Clenshaw1955"), 2 * usize::from(polynomials));
        assert_eq!(count("HairerLubichWanner2006"), usize::from(flows), "{}", entry.name);
        let uses = |name: &str| {
            let trains = |scene: &&gyroceptron::scene::Scene| {
                let setup = &scene.setup;
                setup.models.iter().any(|m| setup.training_of(m).optimiser.name() == name)
            };
            usize::from(all.iter().any(trains))
        };
        for (name, key) in [
            ("L-BFGS", "LiuNocedal1989"),
            ("Levenberg–Marquardt", "Marquardt1963"),
            ("Adam", "KingmaBa2014"),
        ] {
            assert_eq!(count(key), uses(name), "{}: {name}", entry.name);
        }
    }
    assert_eq!(listed.lines().count(), gyroceptron::scene::catalogue().len());
    assert!(text(&succeeds(folder.path(), &["cite"]).stdout).contains("@article"));
    let splittings = "10.1016/j.apnum.2013.01.003";
    let cited = |scene| text(&succeeds(folder.path(), &["cite", scene]).stdout);
    assert!(cited("error-against-time").contains(splittings));
    assert!(!cited("quickstart").contains(splittings));
}

#[test]
fn the_parameter_counts_of_the_built_in_scenes_are_the_papers() {
    let count = |name: &str, model: usize| {
        let scene = gyroceptron::scene::find(name).and_then(|e| e.scene()).expect("a scene");
        use gyroceptron::system::NearlyPeriodic;
        let action = scene.setup.system.expect("a system").circle_action().into();
        scene.setup.models[model]
            .network
            .architecture(&action, 0.01, 5.0)
            .expect("a network to train")
            .parameter_count()
    };
    assert_eq!(count("oscillators-short", 0), 549);
    assert_eq!(count("oscillators-long", 0), 681);
    assert_eq!(count("oscillators-long", 1), 672);
    assert_eq!(count("oscillators-long", 2), 652);
    assert_eq!(count("particle-field", 0), 1033);
}
