//! The judgement of a training on one's own pairs: by the worst plane, on enough held-out pairs,
//! against direct integration of two real systems (`tests/data/make_real.py` makes their pairs).
#![cfg(feature = "cli")]

use crate::helpers::{SMALL, call, text};
use gyroceptron::flow::{Pairs, Trajectories};
use gyroceptron::io::{load_model, read_pairs, read_trajectories, write_pairs};
use gyroceptron::layer::{CircleAction, TorusAction};
use gyroceptron::measure::internals::{monomials, power, powers};
use gyroceptron::measure::{
    adiabatic::{OwnInvariance, PlaneSwing},
    trajectories::plane_motions,
};
use gyroceptron::network::{HenonShape, InitialWeights, Rollout};
use gyroceptron::random::Stream;
use gyroceptron::scene::NextStep;
use gyroceptron::train::{ActionFit, Fit, Loss, Objective, Orbits, fit_rotation};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A training: the first section of its report, its data, and standard error.
fn train(folder: &Path, data: &str, action: &str, more: &[&str]) -> (String, Value, String) {
    let first = ["train", "--data", data, "--circle-action", action, "--output", "m.json"];
    let output = call(folder, &[&first[..], &["--overwrite"], more].concat());
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    let report = std::fs::read_to_string(folder.join("m-report/report.md")).expect("a report");
    let data = std::fs::read(folder.join("m-report/report.json")).expect("data");
    let first = report.split("## ").nth(1).expect("a section").to_owned();
    (first, serde_json::from_slice(&data).expect("one JSON document"), said)
}

fn real(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file)
}

/// What direct integration says of the model in `folder`: the share of each plane's motion by
/// which single steps err, and how many times as far as the system's its action swings.
fn truth(folder: &Path, check: &Pairs, orbits: &Trajectories) -> Vec<(f64, f64)> {
    let stored = load_model(&folder.join("m.json")).expect("a model");
    let (dim, count, states) = (orbits.dim(), orbits.count(), orbits.states());
    let network = |points: &[f64]| {
        let mut points = points.to_vec();
        stored.units.iter().for_each(|units| units.to_network(&mut points));
        points
    };
    let pairs = Pairs::new("check", dim / 2, network(check.input()), network(check.output()));
    let (pairs, values) = (pairs.expect("finite"), network(orbits.values()));
    let one = Rollout { steps: 1, every: 1 };
    let moved = stored.model.rollout(pairs.input(), one).expect("finite");
    let moved = &moved[pairs.input().len()..];
    let action = CircleAction::new([1, 0]);
    let angle = fit_rotation(&pairs, &action);
    let motions = plane_motions(&action.into(), &[angle], &pairs);
    let all = Rollout { steps: 10 * (states - 1), every: 10 };
    let own = stored.model.rollout(&values[..count * dim], all).expect("finite");
    let swing = |states: &[f64], m: usize, j: usize| {
        let action = |z: &[f64]| z[j] * z[j] + z[dim / 2 + j] * z[dim / 2 + j];
        let along = states.chunks_exact(dim).skip(m).step_by(count).map(action);
        let mut along: Vec<f64> = along.collect();
        along.sort_by(f64::total_cmp);
        along[along.len() - 1] - along[0]
    };
    let median = |states: &[f64], j: usize| {
        let mut swings: Vec<f64> = (0..count).map(|m| swing(states, m, j)).collect();
        swings.sort_by(f64::total_cmp);
        swings[count / 2]
    };
    let of_plane = |j: usize| {
        let squares: f64 = moved
            .chunks_exact(dim)
            .zip(pairs.output().chunks_exact(dim))
            .flat_map(|(a, b)| [a[j] - b[j], a[dim / 2 + j] - b[dim / 2 + j]])
            .map(|error| error * error)
            .sum();
        let error = (squares / (2 * pairs.len()) as f64).sqrt();
        (error / motions[j].scale, median(&own, j) / median(&values, j))
    };
    (0..dim / 2).map(of_plane).collect()
}

/// The restricted three-body problem, whose slow plane is narrow, and the spring pendulum, whose
/// slow plane is wide: the verdict is what direct integration says, and the weights of the planes
/// let the narrow one be learnt.
#[test]
fn real_systems_are_judged_by_their_worst_plane() {
    let folder = tempfile::tempdir().expect("a folder");
    let network = ["--architecture", "normal-form", "--kicks", "4x8", "--twists", "6x8"];
    let more = [&network[..], &["--starts", "1", "--iterations", "60"]].concat();
    for (name, narrow) in [("three-body", 1), ("spring-pendulum", 0)] {
        let data = real(&format!("{name}.npz")).display().to_string();
        let orbits = read_trajectories(&real(&format!("{name}-orbits.npy")), 2).expect("orbits");
        let check = read_pairs(&real(&format!("{name}-check.npz"))).expect("pairs").pairs;
        let mut shares = Vec::new();
        for weights in ["none", "auto"] {
            let options = [&more[..], &["--loss-weights", weights]].concat();
            let (first, report, _) = train(folder.path(), &data, "1,0", &options);
            let trust = &report["studies"]["trust"];
            let truth = truth(folder.path(), &check, &orbits);
            eprintln!("{name}, {weights}: {truth:?}\n{first}");
            for (j, (share, _)) in truth.iter().enumerate() {
                let said = trust["planes"][j]["share"].as_f64().expect("a number");
                assert!((0.5..2.0).contains(&(said / share)), "{name}: {said:e}, {share:e}");
            }
            let worst = if truth[1].0 > truth[0].0 { 1 } else { 0 };
            assert_eq!(trust["plane"], worst + 1, "{name}");
            let named = format!("plane {} (q", worst + 1);
            assert!(first.contains(&named), "{name}: {first}");
            let yes = first.contains("**yes");
            assert!(!(yes && truth[worst].0 > 0.05), "{name}: {first}");
            // The report names a swing that the system does not have, and no other.
            for (j, (_, swing)) in truth.iter().enumerate() {
                let named = format!("the action of plane {} ", j + 1);
                if *swing > 8.0 {
                    assert!(!yes && first.contains(&named), "{name}: {swing}: {first}");
                } else if *swing < 2.0 {
                    assert!(!first.contains(&named), "{name}: {swing}: {first}");
                }
            }
            shares.push(truth[narrow].0);
        }
        assert!(shares[1] < 0.2 * shares[0], "{name}: {shares:?}");
    }
}

/// The weights of planes: by their motion, of mean 1, whatever is given.
#[test]
fn planes_weigh_by_their_motion() {
    let weights = |loss: &Loss| loss.component_weights(2).expect("valid");
    let given = |weights: &[f64]| Loss::ByPlane { weights: Some(weights.to_vec()) };
    let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-15);
    assert!(near(&weights(&given(&[1.0, 3.0])), &[0.125, 0.375, 0.125, 0.375]));
    assert!(near(&weights(&given(&[1.0, 2.0, 3.0, 4.0])), &[0.1, 0.2, 0.3, 0.4]));
    assert!(near(&weights(&given(&[1e300, 1e300])), &[0.25; 4]));
    for bad in [&[1.0][..], &[1.0; 3], &[1.0, 0.0], &[1.0, -1.0], &[1.0, f64::NAN], &[]] {
        assert!(given(bad).component_weights(2).is_err(), "{bad:?}");
    }
    let unknown = Loss::ByPlane { weights: None };
    assert!(unknown.component_weights(2).is_err());

    // Plane 1 turns by 0.5 and is sheared by 0.1, plane 2 moves by 0.001.
    let mut stream = Stream::new(1, "points");
    let input: Vec<f64> = (0..400).map(|_| stream.uniform(-1.0, 1.0)).collect();
    let moved = |z: &[f64], slow: f64| {
        let (s, c) = (0.5_f64.sin(), 0.5_f64.cos());
        let (q, p) = (c * z[0] + s * z[2], c * z[2] - s * z[0]);
        [q, z[1] + slow * z[3], p + 0.1 * q * q, z[3]]
    };
    let pairs = |slow: f64| {
        let output = input.chunks_exact(4).flat_map(|z| moved(z, slow)).collect();
        Pairs::new("pairs", 2, input.clone(), output).expect("finite")
    };
    let action = TorusAction::from(CircleAction::new([1, 0]));
    for (slow, explained) in [(0.001, false), (0.0, true)] {
        let pairs = pairs(slow);
        let angle = fit_rotation(&pairs, &action.circles()[0]);
        let motions = plane_motions(&action, &[angle], &pairs);
        assert_eq!([motions[0].explained, motions[1].explained], [false, explained]);
        // Half of the squares of 0.001 p₂, or of those of q₂ and p₂.
        let wide = motions[1].scale / if explained { 1.0 } else { 0.001 / 2.0_f64.sqrt() };
        assert!((0.5..0.65).contains(&wide), "{motions:?}");
        let loss = unknown.for_pairs(&action, &[angle], &pairs).expect("weights");
        let found = weights(&loss);
        let ratio = (motions[0].scale / motions[1].scale).powi(2);
        assert!((found[1] / found[0] / ratio - 1.0).abs() < 1e-12, "{found:?}");
        assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        // With equal weights it is the mean squared error.
        let [equal, plain] = [given(&[2.0, 2.0]), Loss::MeanSquaredError].map(|loss| {
            let shape = HenonShape::uniform(2, 1, 2);
            let model =
                shape.architecture(1.0).initialise(InitialWeights::Glorot, 0.0, 1).expect("valid");
            Objective::new(&loss, &pairs).expect("a loss").value(model.composition())
        });
        assert_eq!(equal, plain);
    }
}

/// The weights as options of the program and in a scene, and what is refused.
#[test]
fn weights_of_the_loss_are_options() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    let data = real("spring-pendulum.npz").display().to_string();
    let weights = |report: &Value| {
        let model = &report["studies"]["training"]["models"][0];
        let weights = model["loss_weights"].as_array().cloned().unwrap_or_default();
        weights.iter().map(|weight| weight.as_f64().expect("a number")).collect::<Vec<_>>()
    };
    let trained = |more: &[&str]| {
        let (_, report, _) =
            train(path, &data, "1,0", &[&["--iterations", "2"][..], more].concat());
        let model = load_model(&path.join("m.json")).expect("a model");
        (weights(&report), model.model.composition().parameters().to_vec(), report)
    };
    let small = |more: &[&str]| trained(&[&SMALL[..], more].concat());
    let (auto, of_auto, _) = small(&[]);
    assert!(auto.len() == 4 && auto[0] != auto[1] && auto[0] == auto[2], "{auto:?}");
    assert!((auto.iter().sum::<f64>() / 4.0 - 1.0).abs() < 1e-14, "{auto:?}");
    // The reported mean squared error is unweighted; the one that chose the model is weighted.
    let (weights_of_data, _, report) = small(&["--units", "data"]);
    let model = &report["studies"]["training"]["models"][0];
    let errors = model["component_errors"].as_array().expect("errors").iter();
    let squares: Vec<f64> = errors.map(|e| e.as_f64().expect("a number").powi(2)).collect();
    let weighted: f64 = squares.iter().zip(&weights_of_data).map(|(s, w)| s * w / 4.0).sum();
    for (said, found) in [
        (&model["held_out_error"], squares.iter().sum::<f64>() / 4.0),
        (&model["best"]["validation"], weighted),
    ] {
        assert!((said.as_f64().expect("a number") / found - 1.0).abs() < 1e-10, "{model}");
    }
    let (none, of_none, _) = small(&["--loss-weights", "none"]);
    assert!(none.is_empty() && of_none != of_auto);
    let (list, ..) = small(&["--loss-weights", "1,3"]);
    assert_eq!(list, [0.5, 1.5, 0.5, 1.5]);
    // A scene keeps its loss, and may say so.
    let scene = |text: &str| std::fs::write(path.join("s.toml"), text).expect("written");
    let head = "name = \"s\"\ntitle = \"s\"\n[training]\niterations = 2\n";
    scene(head);
    let paper = |weights| trained(&["--recipe", "paper", "--loss-weights", weights]).1;
    assert_eq!(trained(&["--scene", "s.toml"]).1, paper("none"));
    scene(&format!("{head}loss = {{ kind = \"by-plane\" }}\n"));
    let by_plane = trained(&["--scene", "s.toml"]).1;
    assert_eq!(paper("auto"), by_plane);
    assert_eq!(trained(&["--scene", "m-report/as-run.toml"]).1, by_plane);
    for (bad, word) in [("1,2,3", "3"), ("1,0", "0"), ("1,x", "1,x"), ("-1,1", "-1")] {
        let first = ["train", "--data", &data, "--circle-action", "1,0", "--output", "x.json"];
        let output = call(path, &[&first[..], &["--loss-weights", bad]].concat());
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{bad}: {said}");
        assert!(said.contains("loss") && said.contains(word), "{bad}: {said}");
    }
}

/// No verdict on nothing, nor on a few pairs.
#[test]
fn a_verdict_takes_held_out_pairs() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = real("spring-pendulum.npz").display().to_string();
    let verdict = |share: &str| {
        let more = [&SMALL[..], &["--iterations", "1", "--validation", share]].concat();
        let (first, report, _) = train(folder.path(), &data, "1,0", &more);
        (first.lines().nth(2).expect("a verdict").to_owned(), report["studies"]["trust"].clone())
    };
    let (none, trust) = verdict("0");
    assert!(none.starts_with("**no**: nothing was held out"), "{none}");
    assert_eq!(trust["held_out"], Value::Null);
    assert!(trust["limit"] == "iterations" || trust["limit"] == "unknown", "{trust}");
    let (one, _) = verdict("0.001");
    assert!(one.starts_with("**no**: only 1 pair was held out"), "{one}");
    let (few, _) = verdict("0.029");
    assert!(few.starts_with("**no**: only 29 pairs were held out"), "{few}");
    let (enough, trust) = verdict("0.03");
    assert!(!enough.contains("only") && trust["held_out"] == 30, "{enough}");
}

/// Held-out pairs that repeat those of the training, and images where no input is, say little.
#[test]
fn repeated_pairs_and_images_beyond_the_inputs_are_reported() {
    let mut stream = Stream::new(6, "points");
    let points = |count: usize, stream: &mut Stream| -> Vec<f64> {
        (0..2 * count).map(|_| stream.uniform(-1.5, 1.5)).collect()
    };
    // The standard map: with K = 3 most images are beyond the inputs.
    let standard = |strength: f64, z: &[f64]| -> Vec<f64> {
        let kicked = |z: &[f64]| {
            let p = z[1] - strength * z[0].sin();
            [0.2 * (z[0] + p), p]
        };
        z.chunks_exact(2).flat_map(kicked).collect()
    };
    let trained = |input: Vec<f64>, strength: f64| {
        let output = standard(strength, &input);
        let pairs = Pairs::new("standard", 1, input, output).expect("pairs");
        let action = Some(CircleAction::new([1]).into());
        let mut fit = Fit { action, ..Fit::default() }.with_iterations(20);
        fit.training.starts = None;
        let fitted = fit.run(pairs).expect("trains");
        let judgement = fitted.judgement().expect("a judgement");
        (fitted, judgement)
    };
    let judged = |input: Vec<f64>, strength: f64| {
        let (_, judgement) = trained(input, strength);
        (judgement.no.join("; "), judgement.care.join("; "))
    };
    let step = |input: Vec<f64>, strength: f64| {
        let (fitted, judgement) = trained(input, strength);
        NextStep::after(&fitted, &judgement)
    };
    assert_eq!(step(points(40, &mut stream).repeat(15), 0.3), NextStep::DistinctPairs);
    let (_, care) = judged(points(600, &mut stream), 3.0);
    assert!(care.contains("of the images are outside the box of the inputs"), "{care}");
    let (no, care) = judged(points(600, &mut stream), 0.3);
    assert!(
        !care.contains("outside the box of the inputs") && !no.contains("inputs"),
        "{no} {care}"
    );
    // Forty points, fifteen times each.
    let few = points(40, &mut stream).repeat(15);
    let (no, _) = judged(few, 0.3);
    assert!(
        no.contains("only 0 of 60 held-out pairs have inputs that no training pair has"),
        "{no}"
    );
    // Half of them twice: enough are left, and the others are said.
    let twice = [points(400, &mut stream).repeat(2), points(400, &mut stream)].concat();
    let (no, care) = judged(twice, 0.3);
    assert!(
        !no.contains("inputs") && care.contains("have the input of a training pair"),
        "{no} {care}"
    );
}

/// Where the fast plane comes round by whole turns, no other action is recommended.
#[test]
fn whole_turns_recommend_no_action() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut stream = Stream::new(1, "points");
    let input: Vec<f64> = (0..1600).map(|_| stream.uniform(-1.0, 1.0)).collect();
    let turned = |z: &[f64]| {
        let action = |j: usize| 0.5 * (z[j] * z[j] + z[2 + j] * z[2 + j]);
        // Three whole turns more are the same pairs.
        let angles = [0.3 + 0.02 * action(1), 1.2 + 0.05 * action(0)];
        let sines = angles.map(f64::sin_cos);
        let q = |j: usize| sines[j].1 * z[j] + sines[j].0 * z[2 + j];
        let p = |j: usize| sines[j].1 * z[2 + j] - sines[j].0 * z[j];
        [q(0), q(1), p(0), p(1)]
    };
    let output = input.chunks_exact(4).flat_map(turned).collect();
    let pairs = Pairs::new("pairs", 2, input, output).expect("finite");
    write_pairs(&folder.path().join("pairs.npz"), &pairs).expect("written");
    let fit = ActionFit::fit(&pairs).expect("a fit");
    assert!(!fit.is_sure() && fit.describe().contains("whole turns"), "{}", fit.describe());
    assert!(fit.describe().contains("0.9 times this flow time"), "{}", fit.describe());
    let (_, _, said) =
        train(folder.path(), "pairs.npz", "1,0", &[&SMALL[..], &["--iterations", "1"]].concat());
    assert!(!said.contains("better"), "{said}");
}

/// The action of a nearly integrable map is an invariant at ε = 0 only: that it moves is reported,
/// and is no fault.
#[test]
fn a_perturbed_map_may_move_its_action() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut stream = Stream::new(1, "points");
    let input: Vec<f64> = (0..800).map(|_| stream.uniform(-1.0, 1.0)).collect();
    let kicked = |z: &[f64]| {
        let (s, c) = 1.3_f64.sin_cos();
        let p = z[1] + 0.3 * (3.0 * z[0]).sin();
        [c * z[0] + s * p, c * p - s * z[0]]
    };
    let output = input.chunks_exact(2).flat_map(kicked).collect();
    let pairs = Pairs::new("pairs", 1, input.clone(), output).expect("finite");
    write_pairs(&folder.path().join("pairs.npz"), &pairs).expect("written");
    let network = ["--architecture", "normal-form", "--kicks", "4x6", "--twists", "4x6"];
    let perturbed = ["--perturbation", "2x8", "--epsilon", "0.5", "--optimiser", "lm"];
    let more = [&network[..], &perturbed, &["--iterations", "80"]].concat();
    let (first, report, _) = train(folder.path(), "pairs.npz", "1", &more);
    let trust = &report["studies"]["trust"];
    assert!(trust["own_invariant_drift"].as_f64() > Some(0.1), "{trust}");
    assert!(!trust["care"].to_string().contains("invariant"), "{trust}");
    assert!(first.contains("ε = 0 only"), "{first}");
    let model = load_model(&folder.path().join("m.json")).expect("a model").model;
    let own = OwnInvariance::measure(&model, &input[..20], 200).expect("an invariant");
    assert!(own.unperturbed && own.fault().is_none() && own.drift > 0.1, "{own:?}");
}

/// Swings of the actions: those of a fast rotation are computed from its steps, those of a slow
/// motion are not, and none is too wide along orbits of the system itself.
#[test]
fn swings_of_actions_are_compared_with_steps() {
    for (name, said) in [("three-body", true), ("spring-pendulum", false)] {
        let orbits = read_trajectories(&real(&format!("{name}-orbits.npy")), 2).expect("orbits");
        let (values, count) = (orbits.values(), orbits.count());
        let pairs = read_pairs(&real(&format!("{name}.npz"))).expect("pairs").pairs;
        let action = CircleAction::new([1, 0]);
        let angles = [fit_rotation(&pairs, &action)];
        let of = |states: &[f64]| {
            PlaneSwing::measure(&[&pairs], &action.clone().into(), &angles, states, count)
        };
        let swings = of(values);
        eprintln!("{name}: {swings:?}");
        assert!(swings.iter().all(|swing| swing.beyond == 0 && !swing.is_too_wide()));
        assert!(swings[0].allowed.is_some() && swings[1].allowed.is_some() == said, "{swings:?}");
        // A drift of the slow plane's action by a half of its range.
        let mut drifting = values.to_vec();
        for (k, z) in drifting.chunks_exact_mut(4).enumerate() {
            let grown = 1.0 - 0.4 * (k / count) as f64 / 100.0;
            (z[1], z[3]) = (grown * z[1], grown * z[3]);
        }
        assert_eq!(of(&drifting)[1].is_too_wide(), said, "{swings:?}");
        drifting[5] = f64::NAN;
        assert!(of(&drifting)[1].beyond > 0);
    }
}

/// Orbits that leave the box of the pairs: a quarter of them is too many.
#[test]
fn a_quarter_of_the_orbits_is_too_many() {
    for (astray, expected) in [(0, false), (3, false), (4, true), (16, true)] {
        let first = (astray > 0).then_some((0, 1));
        assert_eq!(Orbits { count: 16, astray, first }.leave_often(), expected, "{astray}");
    }
}

/// The polynomials to which the slow part of an action is fitted.
#[test]
fn monomials_are_counted() {
    for (variables, degree) in [(1, 4), (3, 2), (4, 4)] {
        let values = vec![1.0; variables];
        assert_eq!(powers(&values, degree).len(), monomials(variables, degree));
    }
    assert_eq!(powers(&[2.0, 3.0], 2), [1.0, 2.0, 3.0, 4.0, 6.0, 9.0]);
    assert_eq!(power(1.0, 2.0, 3), (-11.0, -2.0));
}
