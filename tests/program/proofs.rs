//! Theorems about a model file.

use crate::helpers::{call, folder, refuses, succeeds, text, with_model};
use gyroceptron::io::{ProofFile, Proofs, Provenance, StoredModel, load_model, save_model};
use gyroceptron::layer::{CircleAction, TorusAction};
use gyroceptron::measure::proof::{Failure, NobleNumber, Verdict};
use gyroceptron::network::{InitialWeights, NetworkSpec, NormalFormShape};
use serde_json::Value;
use std::path::Path;

/// A folder with nearly integrable maps of a plane, `m.json` and `other.json`.
pub fn with_maps() -> tempfile::TempDir {
    let folder = folder();
    for (name, seed) in [("m.json", 3), ("other.json", 4)] {
        let shape = NormalFormShape {
            action: TorusAction::from(CircleAction::new([1])),
            psi: Vec::new(),
            kicks: vec![3; 2],
            twists: vec![4],
            turned_twists: Vec::new(),
            flow_time: 1.0,
            perturbation: Some(vec![3; 3]),
        };
        let weights = InitialWeights::Normal { scale: 0.6 };
        let model = shape.architecture(0.01).initialise(weights, 2.3, seed).expect("a network");
        let provenance = Provenance::of_scene("test");
        let stored = StoredModel { model, units: None, section: None, provenance };
        save_model(&folder.path().join(name), &stored).expect("written");
    }
    folder
}

/// Turns of a period on two circles of `m.json` that are proved.
pub const TURNS: [&str; 2] = ["0.243511", "0.268557"];

fn prove(path: &Path, more: &[&str]) -> Value {
    let arguments = [&["prove", "--model", "m.json", "--json"], more].concat();
    let output = succeeds(path, &arguments);
    serde_json::from_slice(&output.stdout).expect("one JSON document")
}

#[test]
fn proofs_are_written_and_verified_again() {
    let folder = with_maps();
    let path = folder.path();
    let found = prove(path, &["--circles", "2", "--threads", "1"]);
    let circles = found["circles"].as_array().expect("circles");
    assert_eq!(circles.len(), 2);
    let mut turns = Vec::new();
    for circle in circles {
        assert_eq!(circle["verdict"], "proved");
        assert!(circle["constants"]["residual"].as_f64().expect("a number") < 1e-12);
        turns.push(format!("{:.6}", circle["turns"].as_f64().expect("a number")));
    }
    assert_eq!(found["statements"].as_array().expect("words").len(), 1);
    assert!(found["statements"][0].as_str().expect("words").contains("between the circles"));
    assert_eq!(found["fixed_point"]["elliptic"], true);
    let again = succeeds(path, &["check-proof", "m.proof.json", "--model", "m.json"]);
    let again = text(&again.stdout);
    assert!(again.contains("2 circles hold"));
    // With the constants of each.
    for circle in circles {
        let omega = circle["rotation_number"].as_str().expect("a number");
        let kappa = circle["constants"]["kappa"].as_f64().expect("a number");
        assert!(again.contains(omega) && again.contains(&format!("{kappa:.1e}")), "{again}");
        assert_eq!(circle["constants"]["words"], 2);
    }
    // What is cited is this file, and what its theorem rests on.
    let cited = text(&succeeds(path, &["cite", "m.proof.json"]).stdout);
    let file: Value =
        serde_json::from_slice(&std::fs::read(path.join("m.proof.json")).expect("a file"))
            .expect("one JSON document");
    for key in ["digest", "model"] {
        assert!(cited.contains(file[key].as_str().expect("a digest")), "{cited}");
    }
    let theory = "10.1007/s10208-016-9339-3";
    assert!(cited.contains(theory) && cited.contains("2 invariant circles"), "{cited}");
    refuses(path, &["cite", "m.json"], &["m.json", "gyroceptron-proof"]);
    // The same file on any number of threads, and by the same numbers as decimals.
    let first = std::fs::read(path.join("m.proof.json")).expect("a file");
    prove(path, &["--circles", "2", "--threads", "2", "--output", "two.json"]);
    assert!(first == std::fs::read(path.join("two.json")).expect("a file"));
    assert_eq!(turns, TURNS);
    let [one, other] = TURNS;
    let between = prove(path, &["--between", one, other, "--output", "three.json"]);
    assert_eq!(between["statements"], found["statements"]);

    // Edited, of another model, no proof at all.
    let file = text(&first);
    let digit = file.find("\"modes\"").expect("modes") + 40;
    let mut edited = file.clone().into_bytes();
    edited[digit] = if edited[digit] == b'3' { b'4' } else { b'3' };
    std::fs::write(path.join("edited.json"), &edited).expect("written");
    refuses(path, &["check-proof", "edited.json", "--model", "m.json"], &["edited.json", "digest"]);
    refuses(path, &["check-proof", "m.proof.json", "--model", "other.json"], &["this model"]);
    refuses(path, &["check-proof", "m.json", "--model", "m.json"], &["gyroceptron-proof"]);
    refuses(path, &["prove", "--model", "m.json"], &["m.proof.json", "--overwrite"]);
}

#[test]
fn what_is_not_proved_says_why() {
    let folder = with_maps();
    let path = folder.path();
    // Next to no turning: no orbit on the ray has it.
    let arguments = ["prove", "--model", "m.json", "--frequencies", "[0; 9000, (1)]"];
    let output = call(path, &arguments);
    assert_eq!(output.status.code(), Some(1));
    let said = text(&output.stdout);
    assert!(said.contains("(0)") && said.contains("no orbit on the ray"), "{said}");
    assert!(!path.join("m.proof.json").exists());
}

#[test]
fn a_circle_outside_the_box_of_polynomials_is_not_proved() {
    let folder = folder();
    let path = folder.path();
    let text_of = r#"{"kind": "normal-form", "radius": 1.0,
        "kicks": {"count": 2, "width": 1, "degree": 4}, "twists": {"count": 1, "width": 1, "degree": 4},
        "perturbation": {"count": 1, "width": 1, "degree": 3}}"#;
    let spec: NetworkSpec = serde_json::from_str(text_of).expect("a network");
    let action = TorusAction::from(CircleAction::new([1]));
    let architecture = spec.architecture(&action, 0.001, 1.0).expect("a network");
    let weights = InitialWeights::Normal { scale: 0.1 };
    let model = architecture.initialise(weights, 2.3, 3).expect("weights");
    let provenance = Provenance::of_scene("test");
    let stored = StoredModel { model, units: None, section: None, provenance };
    save_model(&path.join("m.json"), &stored).expect("written");
    let arguments = ["prove", "--model", "m.json", "--json", "--circles", "6", "--to", "2.4,0"];
    let output = call(path, &arguments);
    let found: Value = serde_json::from_slice(&output.stdout).expect("one JSON document");
    let circles = found["circles"].as_array().expect("circles");
    let outside = |circle: &&Value| {
        circle["reason"].as_str().is_some_and(|reason| reason.contains("of the box"))
    };
    // Those within are proved all the same.
    assert!(circles.iter().any(|circle| circle["verdict"] == "proved"), "{found}");
    let beyond = circles.iter().find(outside).unwrap_or_else(|| panic!("{found}"));
    assert_eq!((&beyond["verdict"], output.status.code()), (&"not proved".into(), Some(1)));
    // One that is asked for is refused with the reason.
    let omega = beyond["rotation_number"].as_str().expect("a number");
    let asked =
        ["prove", "--model", "m.json", "--to", "2.4,0", "--overwrite", "--frequencies", omega];
    let refused = call(path, &asked);
    let said = text(&refused.stderr);
    assert!(refused.status.code() == Some(2) && said.contains("of the box"), "{said}");
}

#[test]
fn an_inequality_that_fails_is_in_the_document() {
    let folder = with_maps();
    let stored = load_model(&folder.path().join("m.json")).expect("a model");
    let inequality = "(6) κ|E| < 1: the first step makes the error smaller";
    let failure = Failure { inequality, found: 27.0, needed: 1.0, strip: Some(0.0015) };
    assert!(failure.to_string().contains("ρ = 1.5e-3"), "{failure}");
    let omega: NobleNumber = "golden".parse().expect("a number");
    let proofs = Proofs {
        tried: vec![(omega, Verdict::NotProved(failure))],
        file: ProofFile::new(&stored, Vec::new()).expect("a digest"),
        fixed_point: None,
    };
    let document = proofs.document();
    let found = &document["circles"][0]["failure"];
    assert_eq!((&document["holds"], &found["found"]), (&false.into(), &27.0.into()));
    assert_eq!((&found["rho"], &found["inequality"]), (&0.0015.into(), &inequality.into()));
}

#[test]
fn what_no_theorem_is_about_is_refused() {
    let folder = with_maps();
    let path = folder.path();
    let of = |more: &[&'static str]| [&["prove", "--model", "m.json"], more].concat();
    refuses(path, &of(&["--frequencies", "2/3"]), &["2/3", "rational"]);
    refuses(path, &of(&["--frequencies", "golden,[0; 1, 2]"]), &["rational"]);
    refuses(path, &of(&["--frequencies", "1.5"]), &["whole turns"]);
    refuses(path, &of(&["--between", "golden", "golden"]), &["--between", "differ"]);
    refuses(path, &of(&["--to", "1"]), &["--to", "Q,P"]);
    refuses(path, &of(&["--circles", "0"]), &["--circles"]);
    refuses(path, &of(&["--output", "proof.txt"]), &["--output", ".json"]);
    let two = with_model();
    refuses(two.path(), &["prove", "--model", "model.json"], &["one degree of freedom"]);
}
