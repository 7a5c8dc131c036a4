//! Adiabatic invariants along orbits: horizons, profiles, drifts.

use crate::helpers::{Quiet, network, refused, run_in, temporary};
use gyroceptron::flow;
use gyroceptron::measure::{
    AdiabaticOrbit, drift_exponent, near_identity_rms, settling_iterations,
};
use gyroceptron::phase::Map;
use gyroceptron::scalar::max_or_nan;
use gyroceptron::scene::{Event, Folder, Observer, parse, render, run};
use serde_json::Value;

const START: [f64; 2] = [0.9, 0.4];

/// N(ε) and D(N) by plain loops over the map in w, and that map by the one in z.
#[test]
fn orbits_of_the_invariant_are_their_definition() {
    let factors = [1.1, 1.5, 4.0];
    for epsilon in [0.2, 0.05, 1e-3] {
        let network = network(epsilon);
        let map = network.in_conjugated_coordinates();
        let action = &network.architecture().circles[0];
        let mut orbit = AdiabaticOrbit::new(&network, &START, &factors).expect("valid");
        orbit.advance(&map, action, 2500);
        let (psi, mut z) = (network.psi(), START);
        let mut w = z;
        psi.inverse(&mut w);
        let initial = action.invariant(&w);
        let settling = settling_iterations(epsilon).expect("positive");
        let (mut settled, mut largest) = (0.0, 0.0);
        let mut horizons = [None; 3];
        let mut drifts = Vec::new();
        for step in 1..=2500_u64 {
            map.forward(&mut w);
            let drift = (action.invariant(&w) - initial).abs();
            largest = max_or_nan(largest, drift);
            if step <= settling as u64 {
                settled = largest;
            } else {
                for (horizon, factor) in horizons.iter_mut().zip(factors) {
                    if horizon.is_none() && drift > factor * settled {
                        *horizon = Some(step);
                    }
                }
            }
            if [10, 100, 1000].contains(&step) {
                drifts.push((step, largest));
            }
            if step <= 100 {
                network.forward(&mut z);
                let mut back = w;
                psi.forward(&mut back);
                let distance = (back[0] - z[0]).hypot(back[1] - z[1]);
                assert!(distance < 1e-10, "step {step}: {distance:e}");
            }
        }
        assert_eq!(orbit.horizons(), horizons, "ε = {epsilon}");
        assert_eq!(orbit.drifts(), drifts, "ε = {epsilon}");
        assert_eq!((orbit.steps(), orbit.largest()), (2500, largest));
        // In pieces and through its text: the same.
        let mut pieces = AdiabaticOrbit::new(&network, &START, &factors).expect("valid");
        for steps in [7, 10, 10, 999, 1000, 1001, 2500] {
            pieces.advance(&map, action, steps);
            let text = serde_json::to_string(&pieces).expect("serialises");
            pieces = serde_json::from_str(&text).expect("reads back");
        }
        assert_eq!(pieces, orbit);
    }
    let still = AdiabaticOrbit::new(&network(0.0), &START, &factors).expect("valid");
    assert!(still.horizons().is_empty());
    assert!(AdiabaticOrbit::new(&network(0.1), &[0.0; 3], &factors).is_err());
    assert!(AdiabaticOrbit::new(&network(-0.1), &START, &factors).is_err());
}

#[test]
fn the_exponent_of_a_drift_is_that_of_its_growth() {
    let orbit = |value: fn(f64) -> f64| {
        let values = (0..=5000).map(|t| value(f64::from(t))).collect();
        flow::Trajectories::new(values, 1, 1).expect("numbers")
    };
    let exponent = |value| drift_exponent(&orbit(value), |v| v[0]);
    assert!((exponent(|t| 3.0 + 2e-3 * t) - 1.0).abs() < 1e-3);
    assert!((exponent(|t| 3.0 + 1e-3 * t.sqrt()) - 0.5).abs() < 1e-2);
    assert!(exponent(f64::sin).abs() < 0.01);
    assert!(exponent(|_| 1.0).is_nan());
    assert!(exponent(|t| if t > 4000.0 { f64::NAN } else { t }).is_nan());
}

#[test]
fn the_size_of_a_change_is_its_root_mean_square() {
    let network = network(0.1);
    let near = network.near_identity();
    let points: [f64; 6] = [0.3, -0.2, 1.0, 0.5, -0.7, 0.1];
    let mut squares: f64 = 0.0;
    for z in points.chunks_exact(2) {
        let mut moved = z.to_vec();
        near.forward(&mut moved);
        squares += (moved[0] - z[0]).powi(2) + (moved[1] - z[1]).powi(2);
    }
    let rms = near_identity_rms(&near, &points);
    assert!((rms - (squares / 6.0).sqrt()).abs() < 1e-15 && rms > 1e-3);
}

const HORIZON: &str = r#"
name = "horizon"
seed = 2
plots = ["adiabatic-horizon"]

[adiabatic_horizon]
epsilons = [1e-1, 1e-3]
factors = [1.1, 2.0]
seeds = 3
iterations = 200000
long = { epsilons = [1e-3], iterations = 2500000 }
network = { psi = { count = 1, width = 1 }, near_identity = { count = 1, width = 1 }, theta = 2.4, weights = { kind = "normal", scale = 0.8 }, initial = [0.9, 0.4] }
"#;

/// Interrupts at the first sign of progress.
struct Impatient {
    parts: usize,
}

impl Observer for Impatient {
    fn event(&mut self, event: Event<'_>) {
        if let Event::Progress { done, total, .. } = event {
            assert!(done <= total);
            self.parts += 1;
        }
    }

    fn interrupted(&self) -> bool {
        self.parts > 0
    }
}

#[test]
fn an_interrupted_horizon_goes_on_to_the_same_numbers() {
    let scene = parse("horizon", HORIZON).expect("a scene");
    let (whole, pieces) = (temporary(), temporary());
    let report = run_in(whole.path(), &scene);
    let folder = Folder::open(pieces.path(), false, false).expect("a folder");
    let mut impatient = Impatient { parts: 0 };
    assert!(run(&scene, &folder, &mut impatient).expect("stops").is_none());
    let folder = Folder::open(pieces.path(), true, false).expect("a folder");
    let resumed = run(&scene, &folder, &mut Quiet).expect("runs").expect("to its end");
    assert_eq!(render::json(&resumed), render::json(&report));
    let data = &report.study("adiabatic_horizon").expect("a study").results.data;
    let orbits = data["orbits"].as_array().expect("orbits");
    // Two ε and rounding alone, three sets of weights each.
    assert_eq!(orbits.len(), 9);
    let steps = |k: usize| orbits[k]["iterations"].as_u64().expect("a count");
    assert_eq!((steps(0), steps(3), steps(4)), (200_000, 2_500_000, 200_000));
    let largest = |k: usize| orbits[k]["largest"].as_f64().expect("a number");
    assert!(largest(6) < 1e-11 && largest(3) > 1e-5);
    // Orbits that leave the numbers are stored too.
    let mut lost = AdiabaticOrbit::new(&network(1e-3), &[1e200, 0.0], &[1.1]).expect("finite");
    let map = network(1e-3).in_conjugated_coordinates();
    lost.advance(&map, &network(1e-3).architecture().circles[0], 20);
    let text = serde_json::to_string(&lost).expect("serialises");
    let read: AdiabaticOrbit = serde_json::from_str(&text).expect("reads back");
    assert_eq!((read.steps(), read.largest().to_bits()), (20, lost.largest().to_bits()));
    // A checkpoint of other options is not gone on with, nor is another scene.
    let other = parse("other", &HORIZON.replace("seeds = 3", "seeds = 2")).expect("a scene");
    let folder = Folder::open(pieces.path(), true, false).expect("a folder");
    assert!(run(&other, &folder, &mut Quiet).is_err());
    refused(&HORIZON.replace("[1.1, 2.0]", "[2.0, 1.1]"), &["factors", "ascending"]);
    refused(&HORIZON.replace("[1e-1, 1e-3]", "[0.0]"), &["epsilons"]);
    refused(&HORIZON.replace("{ epsilons = [1e-3]", "{ epsilons = [1e-4]"), &["long.epsilons"]);
    refused(&HORIZON.replace("seeds = 3", "seeds = 0"), &["seeds"]);
    refused(&HORIZON.replace("[1e-1, 1e-3]", "[1e-3, 1e-3]"), &["epsilons", "twice"]);
    refused(&HORIZON.replace("count = 1,", "count = 5000,"), &["count"]);
}

pub(crate) const PROFILES: &str = r#"
name = "adiabatic-profiles"
seed = 1
plots = ["adiabatic-profiles"]

[adiabatic_profiles]
epsilons = [1e-2, 1e-4, 1e-6]
iterations = 1000
network = { psi = { count = 2, width = 4 }, near_identity = { count = 2, width = 4 }, theta = 3.8832220774509327, weights = { kind = "glorot" }, initial = [1.0, 0.3] }
"#;

#[test]
fn profiles_shrink_with_epsilon() {
    let scene = parse("profiles", PROFILES).expect("a scene");
    let folder = temporary();
    let report = run_in(folder.path(), &scene);
    let data = &report.study("adiabatic_profiles").expect("a study").results.data;
    let number = |v: &Value| v.as_f64().expect("a number");
    let slopes: Vec<f64> = data
        .as_array()
        .expect("profiles")
        .iter()
        .map(|of| number(&of["drift"]["largest"]) / number(&of["epsilon"]))
        .collect();
    assert!(slopes.iter().all(|s| (s / slopes[2] - 1.0).abs() < 0.05), "{slopes:?}");
    let svg = std::fs::read_to_string(folder.path().join("adiabatic-profiles.svg")).expect("drawn");
    assert!(svg.contains("ε = 1e-6") && svg.contains("iterations"));
    refused(&PROFILES.replace("iterations = 1000", "iterations = 10"), &["iterations"]);
    refused(&PROFILES.replace("theta = 3.8832220774509327", "theta = nan"), &["theta"]);
    refused(&PROFILES.replace("width = 4", "width = 0"), &["layer"]);
}
