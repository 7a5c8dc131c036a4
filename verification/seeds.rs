//! The fuzz targets' committed inputs, replayed.

#[path = "../fuzz/properties.rs"]
mod properties;

use properties::{Outcome, TARGETS};
use std::collections::BTreeMap;
use std::path::Path;

fn outcomes(target: &str) -> BTreeMap<String, Result<Outcome, String>> {
    let property = TARGETS.iter().find(|(name, _)| *name == target).expect("a target").1;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds").join(target);
    let mut out = BTreeMap::new();
    for entry in std::fs::read_dir(&folder).expect("seeds") {
        let path = entry.expect("an entry").path();
        let bytes = std::fs::read(&path).expect("a seed");
        out.insert(path.display().to_string(), property(&bytes));
    }
    out
}

#[test]
fn all_seeds_pass() {
    for (target, _) in TARGETS {
        for (path, outcome) in outcomes(target) {
            assert!(outcome.is_ok(), "{path}: {outcome:?}");
        }
    }
}

/// A corpus that is refused at the door, or ill-conditioned throughout, would
/// show nothing.
#[test]
fn the_seeds_reach_what_they_are_for() {
    for (target, _) in TARGETS {
        let outcomes = outcomes(target);
        let reached = |outcome: Outcome| outcomes.values().any(|found| *found == Ok(outcome));
        assert!(outcomes.len() >= 5, "{target}: {}", outcomes.len());
        match target {
            "model" | "scene" | "npz" | "safetensors" => {
                assert!(reached(Outcome::Accepted) && reached(Outcome::Refused), "{target}");
            }
            _ => assert!(reached(Outcome::Tested), "{target}"),
        }
    }
}

/// Each target is built, and has a binary, a seed folder and a property.
#[test]
fn every_target_is_declared() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz");
    let manifest = std::fs::read_to_string(root.join("Cargo.toml")).expect("a manifest");
    for (target, _) in TARGETS {
        assert!(manifest.contains(&format!("name = \"{target}\"")), "{target}");
        let source = std::fs::read_to_string(root.join(format!("targets/{target}.rs")));
        assert!(source.expect("a target").contains(&format!("properties::{target},")), "{target}");
    }
    let targets = std::fs::read_dir(root.join("targets")).expect("targets").count();
    // That for a map of one's own is compiled and run in `tests/own_maps.rs`.
    assert_eq!(targets, TARGETS.len() + 1);
}

/// A broken inverse is caught by what the targets assert.
#[test]
fn the_properties_can_fail() {
    use gyroceptron::measure::{Measurable, steps::MeasuredSteps};
    use gyroceptron::phase::Direction;
    use gyroceptron::phase::Map;
    struct Forgetful(gyroceptron::network::Model);
    impl Map<f64> for Forgetful {
        fn dof(&self) -> usize {
            2
        }
        fn forward(&self, z: &mut [f64]) {
            self.0.forward(z);
        }
        fn inverse(&self, _: &mut [f64]) {}
    }
    impl Measurable for Forgetful {
        fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
            match direction {
                Direction::Forward => self.0.measured_steps(direction),
                Direction::Inverse => Vec::new(),
            }
        }
    }
    let broken = Forgetful(crate::mutants::clean());
    assert!(properties::inverts(&broken, &[0.1, 0.2, 0.3, 0.4], true).is_err());
}
