//! What the report of a training and the terminal show.

use crate::helpers::{
    SCENE, SMALL, command, folder, succeeds, text, with_model, with_scene, write_data,
    write_large_data,
};
use gyroceptron::flow::{Pairs, Window, sample};
use gyroceptron::io::{read_pairs, write_pairs};
use gyroceptron::random::Stream;
use gyroceptron::scene::findings::{Format, Table};
use gyroceptron::scene::render::terminal::table;
use gyroceptron::system::Oscillators;
use serde_json::{Value, json};

/// The first lines of a report and of what the terminal shows: the verdict, the error with its
/// plane, the command to try next.
#[test]
fn a_report_begins_with_verdict_error_and_next_command() {
    let folder = folder();
    let path = folder.path();
    write_data(path);
    let train = |output: &str, more: &[&str]| {
        let mut arguments = vec!["train", "--data", "pairs.npz", "--circle-action", "1,0"];
        arguments.extend(["--recipe", "paper", "--output", output]);
        arguments.extend(more);
        let said = text(&succeeds(path, &arguments).stdout);
        let folder = path.join(output.replace(".json", "-report"));
        let report = std::fs::read_to_string(folder.join("report.md")).expect("a report");
        let lines: Vec<_> = report.lines().filter(|line| !line.is_empty()).collect();
        // Name, title, heading.
        assert!(lines[2].starts_with("## "), "{report}");
        let shown: Vec<_> = said.lines().collect();
        assert_eq!(lines[3..7], shown[1..5], "{report}");
        assert!(lines[3].starts_with("**") && lines[5].starts_with("**Error**"), "{report}");
        let of_orbits = lines[4].starts_with("The error is that of one step; ");
        assert!(of_orbits && lines[4].contains("16 orbits of 1000 steps"), "{report}");
        let [_, command, _] = lines[6].split('`').collect::<Vec<_>>()[..] else {
            panic!("{}", lines[6]);
        };
        assert!(lines[6].starts_with("**Next**") && command.starts_with("gyroceptron "));
        (lines[5].to_owned(), command.split(' ').skip(1).map(str::to_owned).collect::<Vec<_>>())
    };
    let run = |command: &[String]| {
        succeeds(path, &command.iter().map(String::as_str).collect::<Vec<_>>());
    };
    // Stopped in the middle: it goes on, as the command says.
    let (error, next) = train("few.json", &["--iterations", "20"]);
    assert!(error.contains("plane 1 errs most") || error.contains("plane 2 errs most"), "{error}");
    assert!(error.contains("in units of the data"), "{error}");
    assert!(next.ends_with(&["--iterations", "40", "--resume"].map(str::to_owned)), "{next:?}");
    run(&next);
    // As many parameters as numbers: pairs are known by heart.
    let form = ["--architecture", "normal-form", "--optimiser", "lm", "--iterations", "60"];
    let (_, next) = train("heart.json", &form);
    assert!(next.contains(&"MORE-PAIRS.npz".to_owned()), "{next:?}");
    // A gyroceptron where the planes turn.
    let shape = ["--psi", "1x2", "--near-identity", "1x2", "--iterations", "80"];
    let (_, next) = train("default.json", &shape);
    let expected = ["--architecture", "normal-form", "--optimiser", "lm", "--overwrite"];
    assert!(next.ends_with(&expected.map(str::to_owned)), "{next:?}");
    assert!(!next.contains(&"--psi".to_owned()), "{next:?}");
}

/// Starts take more iterations than were asked for: to go on takes more than they did.
#[test]
fn to_go_on_is_to_do_more_than_the_starts_did() {
    let folder = folder();
    let path = folder.path();
    write_data(path);
    let files = ["train", "--data", "pairs.npz", "--circle-action", "1,0", "--output", "m.json"];
    let sizes = ["--kicks", "1x2", "--twists", "1x2", "--iterations", "5", "--starts", "2"];
    let said = text(&succeeds(path, &[&files[..], &sizes].concat()).stdout);
    assert!(said.contains("--iterations 80 --resume"), "{said}");
}

/// Who gave a wrong action is sent to find another, and who has few pairs to more of them.
#[test]
fn a_wrong_action_and_few_pairs_have_a_next_step() {
    let folder = folder();
    let path = folder.path();
    write_data(path);
    let pairs = read_pairs(&path.join("pairs.npz")).expect("pairs").pairs;
    write_pairs(&path.join("few.npz"), &pairs.thinned(60)).expect("written");
    for (data, action, share, next) in [
        ("pairs.npz", "3,1", "0.1", json!("action")),
        ("few.npz", "1,0", "0.1", json!({ "pairs": 54 })),
        ("pairs.npz", "1,0", "0", json!("hold-out")),
        ("pairs.npz", "1,0", "0.001", json!("hold-out")),
    ] {
        let train = ["train", "--data", data, "--circle-action", action, "--output", "m.json"];
        let more = ["--iterations", "50", "--plateau", "0", "--validation", share, "--overwrite"];
        succeeds(path, &[&train[..], &SMALL, &more].concat());
        let report = std::fs::read(path.join("m-report/report.json")).expect("a report");
        let report: Value = serde_json::from_slice(&report).expect("JSON");
        assert_eq!(report["studies"]["trust"]["next"], next, "{data}");
        let text = std::fs::read_to_string(path.join("m-report/report.md")).expect("a report");
        let said = text.lines().find(|line| line.starts_with("**Next**")).expect("a next step");
        assert_eq!(said.contains("--validation 0.1 --overwrite"), next == "hold-out", "{said}");
        assert!(share != "0" || !text.contains("from held-out point"), "{text}");
        // What a normal form keeps whatever its weights is no evidence.
        assert!(text.contains("this is rounding"), "{text}");
    }
}

/// Predictions against the truth, orbits in each plane and errors by component, in units of the
/// data.
#[test]
fn a_report_shows_predictions_orbits_and_errors_by_component() {
    let folder = folder();
    let path = folder.path();
    write_large_data(path);
    let mut tables = Vec::new();
    for data in ["pairs", "large"] {
        let (file, model) = (format!("{data}.npz"), format!("{data}.json"));
        let files = ["train", "--data", &file, "--circle-action", "1,0", "--output", &model];
        succeeds(path, &[&files[..], &SMALL, &["--iterations", "60"]].concat());
        let report = path.join(format!("{data}-report"));
        let text = std::fs::read_to_string(report.join("report.md")).expect("a report");
        for name in ["prediction", "orbits"] {
            assert!(text.contains(&format!("({name}.svg)")), "{text}");
            let svg = std::fs::read_to_string(report.join(format!("{name}.svg"))).expect("a plot");
            assert!(svg.len() > 10_000 && !svg.contains("NaN"), "{name}");
        }
        let csv = |name: &str| std::fs::read_to_string(report.join(name)).expect("numbers");
        let rows = |text: &str, panel: &str| -> Vec<(f64, f64)> {
            let of_panel = text.lines().filter(|line| line.starts_with(&format!("\"{panel}\",2,")));
            of_panel
                .map(|line| {
                    let mut numbers = line.rsplit(',').map(|v| v.parse().expect("a number"));
                    let (y, x) = (numbers.next().expect("y"), numbers.next().expect("x"));
                    (x, y)
                })
                .collect()
        };
        // 30 of 300 pairs are held out; their truth is among the outputs of the file.
        let prediction = csv("prediction.csv");
        let read = read_pairs(&path.join(&file)).expect("pairs").pairs;
        let mut rms = Vec::new();
        for (k, panel) in ["q₁", "q₂", "p₁", "p₂"].into_iter().enumerate() {
            let points = rows(&prediction, panel);
            assert_eq!(points.len(), 30, "{panel}: {prediction}");
            let is_output = |x: f64| {
                let mut column = read.output().iter().skip(k).step_by(4);
                column.any(|v| (v - x).abs() <= 1e-14 * x.abs())
            };
            assert!(points.iter().all(|(x, _)| is_output(*x)), "{panel}");
            let squares: f64 = points.iter().map(|(x, y)| (x - y) * (x - y)).sum();
            rms.push((squares / 30.0).sqrt());
        }
        let data: Value =
            serde_json::from_slice(&std::fs::read(report.join("report.json")).expect("data"))
                .expect("one JSON document");
        let errors = &data["studies"]["training"]["models"][0]["component_errors"];
        for (k, rms) in rms.iter().enumerate() {
            let said = errors[k].as_f64().expect("a number");
            assert!((said / rms - 1.0).abs() < 1e-6, "{errors}: {rms:e}");
        }
        let orbits = csv("orbits.csv");
        for panel in ["plane 1", "plane 2"] {
            let of = |m: usize| orbits.matches(&format!("\"{panel}\",\"orbit {m}\"")).count();
            assert!((1..=8).all(|m| of(m) > 0 && of(m) <= 251), "{panel}");
            assert_eq!(orbits.matches(&format!("\"{panel}\",\"box of the pairs\"")).count(), 5);
        }
        let after = text.split("Errors by component").nth(1).expect("a table");
        let row = after.lines().find(|line| line.contains("q₂ (plane 2)")).expect("a row");
        tables.push((rms[1], row.split('|').nth(2).expect("a cell").trim().to_owned()));
        assert!(tables.last().is_some_and(|(rms, cell)| format!("{rms:.2e}") == *cell), "{row}");
    }
    assert!((tables[1].0 / tables[0].0 / 128.0 - 1.0).abs() < 1e-9);
}

/// ε below 0 among pairs is said.
#[test]
fn negative_epsilons_are_reported() {
    let folder = folder();
    let path = folder.path();
    let set = |epsilon: f64, samples: usize| {
        let window = Window { low: vec![-0.8; 4], high: vec![0.8; 4], samples };
        let points = sample(&[window], 2, &mut Stream::new(1, "points")).expect("points");
        (epsilon, 1.0, Pairs::of_flow(&Oscillators { epsilon }, points, 1.0).expect("pairs").0)
    };
    let train = |sets: Vec<(f64, f64, Pairs)>| {
        let pairs = Pairs::of_family(sets).expect("sets");
        write_pairs(&path.join("pairs.npz"), &pairs).expect("written");
        let files =
            ["train", "--data", "pairs.npz", "--circle-action", "1,0", "--output", "m.json"];
        let output =
            succeeds(path, &[&files[..], &SMALL, &["--iterations", "2", "--overwrite"]].concat());
        let report = std::fs::read_to_string(path.join("m-report/report.md")).expect("a report");
        (text(&output.stderr), report)
    };
    let (said, report) = train(vec![set(0.01, 60), set(-0.02, 40)]);
    assert!(said.contains("40 of 100 pairs have ε below 0"), "{said}");
    assert!(said.contains("network's own is -0.02"), "{said}");
    assert!(report.contains("pairs have ε below 0"), "{report}");
    let (said, report) = train(vec![set(0.01, 60), set(0.02, 40)]);
    assert!(!said.contains("below 0") && !report.contains("below 0"), "{said}");
}

/// No line of a table is longer than a line of the terminal.
#[test]
fn tables_fit_the_width_of_the_terminal() {
    let folder = with_model();
    let path = folder.path();
    let letters = |line: &str| line.chars().count();
    let files = ["train", "--data", "pairs.npz", "--circle-action", "1,0", "--output", "w.json"];
    let train = [&files[..], &SMALL, &["--iterations", "3", "--overwrite"]].concat();
    let verify = ["verify", "--model", "model.json", "--samples", "5"];
    let small = with_scene("small.toml", SCENE);
    let run = ["run", "small.toml", "--quick", "--overwrite"];
    for width in [80, 120] {
        for (folder, arguments) in
            [(path, &train[..]), (path, &verify[..]), (small.path(), &run[..])]
        {
            let mut command = command(folder, arguments);
            let output = command.env("COLUMNS", width.to_string()).output().expect("starts");
            let said = text(&output.stdout);
            assert!(said.contains('─'), "{said}");
            // Between the rules of a table.
            let mut rules = 0;
            for line in said.lines() {
                let rule = line.starts_with('─');
                rules += usize::from(rule);
                assert!(!rule || letters(line) <= width, "{width}: {said}");
                if line.starts_with(' ') {
                    assert!(letters(line) <= width, "{width}: {said}");
                }
            }
            assert!(rules >= 3, "{said}");
        }
    }
    // The list of scenes is no table, and fits as well.
    for width in [80, 120] {
        let mut command = command(path, &["scenes"]);
        let output = command.env("COLUMNS", width.to_string()).output().expect("starts");
        let listed = text(&output.stdout);
        assert!(listed.lines().all(|line| letters(line) <= width), "{width}: {listed}");
        assert!(listed.contains("Two fast frequencies: a torus of actions"), "{listed}");
    }
    let mut wide = Table::new([
        ("network", Format::Exact),
        ("the mean squared error of one step on held-out pairs", Format::Exponent(3)),
        ("share of the motion beyond the rotation", Format::Percent),
        ("a text", Format::Exact),
    ]);
    for name in ["first", "second"] {
        let text = "so many words that they are longer than a line of the terminal is wide";
        wide.push([name.into(), 1.25e-7.into(), 0.034.into(), text.into()]);
    }
    let whole = table(&wide, 500);
    assert_eq!(whole.lines().count(), 6, "{whole}");
    for width in [120, 80, 40, 30] {
        let drawn = table(&wide, width);
        assert!(drawn.lines().all(|line| letters(line) <= width), "{width}:\n{drawn}");
        for part in ["network", "first", "second", "1.250e-7", "3.4 %", "squared", "terminal"] {
            assert!(drawn.contains(part), "{width}: {part}\n{drawn}");
        }
    }
    // Four columns that cannot be broken stand in rows.
    let mut words = Table::new(["a", "b", "c", "d"].map(|of| (of.repeat(25), Format::Exact)));
    words.push([1_u64.into(), 2_u64.into(), 3_u64.into(), 4_u64.into()]);
    let drawn = table(&words, 80);
    assert!(drawn.lines().all(|line| letters(line) <= 80), "{drawn}");
    assert!(drawn.lines().any(|line| line.contains(&"d".repeat(25)) && line.contains('4')));
}
