//! Adiabatic invariants along orbits: horizons, profiles, drifts.

use crate::helpers::{Quiet, network, refused, run_in, temporary};
use gyroceptron::flow;
use gyroceptron::layer::CircleAction;
use gyroceptron::measure::{
    adiabatic::{AdiabaticOrbit, SeriesInvariant, log_slope, settling_iterations},
    jacobian,
    ratios::near_identity_rms,
    trajectories::drift_exponent,
};
use gyroceptron::network::{GyroceptronShape, HenonShape, InitialWeights, Model, NormalFormShape};
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
long = { epsilons = [1e-3], iterations = 1200000 }
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
    assert_eq!((steps(0), steps(3), steps(4)), (200_000, 1_200_000, 200_000));
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

const THERE_AND_BACK: &str = r#"
name = "back"
title = "there and back"
seed = 1
plots = ["there-and-back"]

[there_and_back]
bits = 44
steps = 1000
rounds = 1

[[there_and_back.networks]]
name = "mild"
circle_action = [1, 0]
psi = { count = 3, width = 4 }
near_identity = { count = 2, width = 4 }
epsilon = 0.3
theta = 3.8832220774509327
weights = { kind = "normal", scale = 0.3 }
initial = [[1.0, 0.3, 0.0, 0.0], [0.5, -0.4, 0.2, 0.1]]

[[there_and_back.networks]]
name = "large"
circle_action = [1]
psi = { count = 3, width = 4 }
near_identity = { count = 2, width = 4 }
epsilon = 1.0
theta = 0.7
weights = { kind = "normal", scale = 12.0 }
initial = [[1.0, 0.3]]
"#;

/// A study that says of each kind of numbers whether the way back is exact, and where orbits leave their range.
#[test]
fn ways_there_and_back_are_exact_on_grids_alone() {
    let scene = parse("back", THERE_AND_BACK).expect("a scene");
    let folder = temporary();
    let report = run_in(folder.path(), &scene);
    let findings = report.study("there_and_back").expect("a study");
    assert_eq!(findings.verdict, Some(true));
    let data = findings.results.data.as_array().expect("rows").clone();
    let of = |network: &str, by: &str| {
        let found = data.iter().find(|row| row["network"] == network && row["by"] == by);
        found.expect("a row").clone()
    };
    for by in ["integers", "floats on the grid"] {
        assert_eq!(of("mild", by)["return_error"], 0.0);
    }
    assert!(of("mild", "plain f64")["return_error"].as_f64().expect("a number") > 0.0);
    assert_eq!(of("large", "integers")["return_error"], 0.0);
    assert_eq!(of("large", "floats on the grid")["in_range"], false);
    // What a grid changes of μ is far below what ε does.
    let drift = |by| of("mild", by)["drift"].as_f64().expect("a number");
    assert!((drift("integers") - drift("plain f64")).abs() < 1e-3 * drift("plain f64"));
    let svg = std::fs::read_to_string(folder.path().join("there-and-back.svg")).expect("drawn");
    assert!(svg.contains("mild") && svg.contains("steps N"));
    for (from, to, word) in [
        ("bits = 44", "bits = 51", "at most 50"),
        ("steps = 1000", "steps = 1001", "a multiple of 1000"),
        ("initial = [[1.0, 0.3]]", "initial = [[1.0]]", "large"),
        ("initial = [[1.0, 0.3]]", "initial = []", "initial"),
        ("count = 3, width = 4", "count = 3, width = 0", "mild"),
    ] {
        assert!(THERE_AND_BACK.contains(from));
        refused(&THERE_AND_BACK.replacen(from, to, 1), &[word]);
    }
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

/// 2π over the golden mean: an angle far from all resonances.
const GOLDEN: f64 = 3.883_222_077_450_933;

fn gyroceptron_at(action: &[i32], epsilon: f64, theta: f64, seed: u64) -> Model {
    let (psi, near_identity) = (vec![8; 3], vec![8; 3]);
    let circle_action = CircleAction::new(action);
    let shape = GyroceptronShape { circle_action, psi, near_identity };
    shape.architecture(epsilon).initialise(InitialWeights::Glorot, theta, seed).expect("sound")
}

/// The largest changes of μ₀ and μ₀ + εμ₁ along an orbit of `model`, by the series of `of`.
fn changes(model: &Model, of: &Model, start: &[f64]) -> [f64; 2] {
    let series = SeriesInvariant::new(of, 64).expect("adiabatic");
    let mut z = start.to_vec();
    let (mut first, mut largest) = (None, [0.0; 2]);
    for step in 0..=4000 {
        if step % 40 == 0 {
            let (leading, next) = series.evaluate(&z).expect("a point");
            let now = [leading, leading + model.epsilon() * next];
            let first = first.get_or_insert(now);
            for k in 0..2 {
                largest[k] = max_or_nan(largest[k], (now[k] - first[k]).abs());
            }
        }
        model.forward(&mut z);
    }
    largest
}

/// μ₀ changes by O(ε), μ₀ + εμ₁ by O(ε²); with μ₁ of an angle 0.1 away, by O(ε).
#[test]
fn the_next_order_of_an_invariant_gains_an_order() {
    let epsilons = [1e-2, 5e-3, 2.5e-3, 1.25e-3, 6.25e-4];
    for (action, start) in [(&[1][..], &[0.6, 0.2][..]), (&[1, 0], &[0.6, 0.3, 0.2, -0.4])] {
        for seed in 0..3 {
            let slope = |theta: f64, which: usize| {
                let found = epsilons.map(|epsilon| {
                    let model = gyroceptron_at(action, epsilon, GOLDEN, seed);
                    let of = gyroceptron_at(action, epsilon, theta, seed);
                    changes(&model, &of, start)[which]
                });
                log_slope(&epsilons, &found)
            };
            let (leading, next) = (slope(GOLDEN, 0), slope(GOLDEN, 1));
            // In four dimensions slow motion goes through places that differ: the order, less sharply.
            let about = if action.len() == 1 { 0.05 } else { 0.25 };
            assert!((leading - 1.0).abs() < about, "seed {seed}: {leading}");
            assert!((next - 2.0).abs() < 2.0 * about, "seed {seed}: {next}");
            let wrong = slope(GOLDEN + 0.1, 1);
            assert!(wrong < 1.3, "seed {seed}: {wrong}");
        }
    }
}

/// A gyroceptron of smaller weights, whose harmonics fall off within 24 angles.
fn mild_gyroceptron_at(action: &[i32], epsilon: f64, theta: f64) -> Model {
    let model = gyroceptron_at(action, epsilon, theta, 1);
    let smaller = model.parameters().iter().map(|weight| 0.7 * weight).collect();
    model.with_parameters(smaller).and_then(|model| model.with_angles(&[theta])).expect("sound")
}

/// The largest change of μ₀ + εμ₁ + ε²μ₂ along an orbit of `model`, by the series of `of`.
fn change_at_second_order(model: &Model, of: &Model, start: &[f64]) -> f64 {
    let (series, epsilon) = (SeriesInvariant::new(of, 24).expect("adiabatic"), model.epsilon());
    let (mut z, mut first, mut largest) = (start.to_vec(), None, 0.0);
    for step in 0..=1500 {
        if step % 250 == 0 {
            let [leading, next, second] = series.terms(&z).expect("a point");
            let now = leading + epsilon * (next + epsilon * second);
            largest = max_or_nan(largest, (now - *first.get_or_insert(now)).abs());
        }
        model.forward(&mut z);
    }
    largest
}

/// The largest component of DP·R − R∘P at a point, R the roto-rate to an order.
fn roto_rate_defect(model: &Model, order: usize, z: &[f64]) -> f64 {
    let series = SeriesInvariant::new(model, 24).expect("adiabatic");
    let roto_rate = |z: &[f64]| series.roto_rate(z, model.epsilon(), order).expect("a point");
    let mut image = z.to_vec();
    model.forward(&mut image);
    let (slopes, here, there) = (jacobian(model.composition(), z), roto_rate(z), roto_rate(&image));
    let carried =
        |row: usize| here.iter().enumerate().map(|(k, rate)| slopes[(row, k)] * rate).sum::<f64>();
    let defects = there.iter().enumerate().map(|(row, rate)| (rate - carried(row)).abs());
    defects.fold(0.0, max_or_nan)
}

/// μ₀ + εμ₁ + ε²μ₂ changes by O(ε³), also where slow planes make the mean of μ₂ count, and by O(ε) with terms of an
/// angle 0.1 away. The roto-rates of orders 0, 1 and 2 commute with the map up to O(ε), O(ε²) and O(ε³).
#[test]
fn the_second_order_of_an_invariant_and_of_the_roto_rate_gain_orders() {
    let epsilons = [0.064, 0.032, 0.016];
    for (action, start) in [(&[1][..], &[0.6, 0.2][..]), (&[1, 0], &[0.2, 0.3, 0.1, -0.4])] {
        let at = |epsilon, theta| mild_gyroceptron_at(action, epsilon, theta);
        let slope = |theta: f64| {
            let found = epsilons.map(|epsilon| {
                change_at_second_order(&at(epsilon, GOLDEN), &at(epsilon, theta), start)
            });
            log_slope(&epsilons, &found)
        };
        let (found, wrong) = (slope(GOLDEN), slope(GOLDEN + 0.1));
        assert!((found - 3.0).abs() < 0.2, "{action:?}: {found}");
        assert!(wrong < 1.3, "{action:?}: {wrong}");
        for order in 0..=2 {
            let found =
                epsilons.map(|epsilon| roto_rate_defect(&at(epsilon, GOLDEN), order, start));
            let found = log_slope(&epsilons, &found);
            assert!((found - (order + 1) as f64).abs() < 0.2, "{action:?}, order {order}: {found}");
        }
    }
    let series =
        SeriesInvariant::new(&mild_gyroceptron_at(&[1], 0.01, GOLDEN), 24).expect("adiabatic");
    assert!(series.roto_rate(&[0.6, 0.2], 0.01, 3).is_err());
    assert!(series.terms(&[0.6, 0.2, 0.1]).is_err());
}

/// The flow of the roto-rate of first order, by RK4, is back after 2π up to O(ε²), in slow planes too; after a time
/// that is longer by a share ε, up to O(ε).
#[test]
fn the_flow_of_the_roto_rate_has_period_two_pi() {
    let (epsilons, start, steps) = ([0.256, 0.128, 0.064], [0.2, 0.3, 0.1, -0.4], 40);
    let gap = |epsilon: f64, longer: f64| {
        let model = mild_gyroceptron_at(&[1, 0], epsilon, GOLDEN);
        let series = SeriesInvariant::new(&model, 24).expect("adiabatic");
        let rate = |z: &[f64]| series.roto_rate(z, epsilon, 1).expect("a point");
        let (mut z, h) = (start.to_vec(), longer * std::f64::consts::TAU / f64::from(steps));
        for _ in 0..steps {
            let at = |slope: &[f64], share: f64| -> Vec<f64> {
                z.iter().zip(slope).map(|(z, slope)| z + share * h * slope).collect()
            };
            let first = rate(&z);
            let second = rate(&at(&first, 0.5));
            let third = rate(&at(&second, 0.5));
            let fourth = rate(&at(&third, 1.0));
            for (k, z) in z.iter_mut().enumerate() {
                *z += h / 6.0 * (first[k] + 2.0 * (second[k] + third[k]) + fourth[k]);
            }
        }
        let gaps = z.iter().zip(start).map(|(end, start)| (end - start).abs());
        gaps.fold(0.0, max_or_nan)
    };
    let back = log_slope(&epsilons, &epsilons.map(|epsilon| gap(epsilon, 1.0)));
    let late = log_slope(&epsilons, &epsilons.map(|epsilon| gap(epsilon, 1.0 + epsilon)));
    assert!((back - 2.0).abs() < 0.05, "{back}");
    assert!((late - 1.0).abs() < 0.2, "{late}");
}

/// μ₁∘Q − μ₁ = −g∘Q point by point, g by small steps of ε and Q by the composition.
#[test]
fn the_next_order_solves_its_equation() {
    let model = gyroceptron_at(&[1, -2], 0.01, GOLDEN, 7);
    let series = SeriesInvariant::new(&model, 96).expect("adiabatic");
    let action = &model.architecture().circles[0];
    let unperturbed = model.with_epsilon(0.0);
    let psi = model.psi();
    for z in [[0.6, 0.3, 0.2, -0.4], [-0.2, 0.7, 0.5, 0.1], [0.05, -0.3, -0.4, 0.9]] {
        let mut turned = z;
        unperturbed.forward(&mut turned);
        let (before, after) =
            (series.evaluate(&z).expect("a point").1, series.evaluate(&turned).expect("a point").1);
        let leading = |epsilon: f64| {
            let mut moved = turned;
            model.with_epsilon(epsilon).near_identity().forward(&mut moved);
            action.conjugated_invariant(&psi, &moved)
        };
        let slope = (leading(1e-5) - leading(-1e-5)) / 2e-5;
        assert!(slope.abs() > 1e-3, "vacuous: {slope:e}");
        let defect = after - before + slope;
        assert!(defect.abs() < 1e-8, "{defect:e} of {slope}");
    }
    let circle_action = CircleAction::new([1, 0]);
    let normal_form = NormalFormShape {
        action: circle_action.into(),
        psi: Vec::new(),
        kicks: vec![4; 2],
        twists: vec![4; 2],
        turned_twists: Vec::new(),
        flow_time: 1.0,
        perturbation: None,
    };
    let model = normal_form.architecture(0.01).initialise(InitialWeights::Glorot, 1.0, 1);
    assert!(SeriesInvariant::new(&model.expect("sound"), 64).is_none());
    let henon = HenonShape { dof: 1, widths: vec![4] }.architecture(1.0);
    let henon = henon.initialise(InitialWeights::Glorot, 0.0, 1).expect("sound");
    assert!(SeriesInvariant::new(&henon, 64).is_none());
}

const OWN: &str = r#"
name = "own"
seed = 3
flow_time = 0.7
plots = ["own-invariant"]

[system]
kind = "oscillators"
epsilon = 0.01

[data]
validation = 0.5
windows = [{ low = [-1.0, -1.0, -1.0, -1.0], high = [1.0, 1.0, 1.0, 1.0], samples = 200 }]

[[models]]
name = "gyroceptron"
network = { kind = "gyroceptron", psi = { count = 2, width = 4 }, near_identity = { count = 2, width = 4 } }
weights = { kind = "normal", scale = 0.15 }

[[models]]
name = "henon-net"
network = { kind = "henon-net", layers = { count = 2, width = 3 } }
weights = { kind = "normal", scale = 0.15 }

[training]
iterations = 10
optimiser = { kind = "levenberg-marquardt" }

[own_invariant]
steps = 400
every = 40
initial = [[0.7, 0.1, 0.0, 0.2], [0.2, 0.6, 0.0, 0.0]]
"#;

#[test]
fn own_invariants_are_recognised_by_their_orders() {
    let folder = temporary();
    let report = run_in(folder.path(), &parse("own", OWN).expect("a scene"));
    let found = &report.study("own_invariant").expect("a study").results.data;
    let found = found.as_array().expect("networks");
    // A HénonNet owns none.
    assert_eq!(found.len(), 1);
    assert_eq!(found[0]["name"], "gyroceptron");
    let number = |value: &Value| value.as_f64().expect("a number");
    let order = |of: &str| number(&found[0][of][0]);
    let orders = [order("leading_order"), order("next_order"), order("second_order")];
    let about = [0.2, 0.3, 0.3];
    for (k, (order, about)) in orders.iter().zip(about).enumerate() {
        assert!((order - (k + 1) as f64).abs() < about, "{orders:?}");
    }
    let sizes = found[0]["leading"].as_array().expect("sizes");
    assert!(sizes.len() == 5 && number(&sizes[0]) > 50.0 * number(&sizes[4]), "{sizes:?}");
    let text = std::fs::read_to_string(folder.path().join("report.md")).expect("a report");
    assert!(text.contains("μ₀ changes as ε to the power") && text.contains("own-invariant.svg"));
    refused(&OWN.replace("steps = 400", "steps = 0"), &["own_invariant", "steps"]);
    refused(&OWN.replace("every = 40", "every = 500"), &["own_invariant", "every"]);
    refused(&OWN.replace("[[0.7, 0.1, 0.0, 0.2]", "[[0.7, 0.1, 0.0]"), &["initial"]);
}

const CONFINEMENT: &str = r#"
name = "curves"
title = "curves that no orbit crosses"
seed = 1
flow_time = 6.283185307179586
plots = ["confinement"]

[system]
kind = "field-lines"
epsilon = 0.0

[data]
validation = 0.25
windows = [{ low = [-0.8, -0.8], high = [0.8, 0.8], samples = 60 }]

[training]
iterations = 12
optimiser = { kind = "levenberg-marquardt" }

[[models]]
name = "integrable"
network = { kind = "normal-form", kicks = { count = 2, width = 2 }, twists = { count = 1, width = 3 }, perturbation = { count = 0, width = 2 } }
weights = { kind = "normal", scale = 0.3 }

[confinement]
circles = 2
to = [0.7, 0.0]
orbits = 3
steps = 50
"#;

/// A study that proves curves of a trained model: those of an integrable one are all there.
#[test]
fn curves_of_a_trained_model_are_proved() {
    let scene = parse("curves", CONFINEMENT).expect("a scene");
    let folder = temporary();
    let report = run_in(folder.path(), &scene);
    let findings = report.study("confinement").expect("a study");
    let data = &findings.results.data[0];
    let verdicts = data["circles"].as_array().expect("circles");
    assert_eq!(verdicts.len(), 2);
    assert!(verdicts.iter().all(|circle| circle["verdict"] == "proved"), "{verdicts:?}");
    assert_eq!(data["nested"].as_array().expect("pairs").len(), 1);
    let share = data["enclosed_share"].as_f64().expect("a number");
    assert!(share > 0.5 && share < 1.0, "{share}");
    let svg = std::fs::read_to_string(folder.path().join("confinement.svg")).expect("drawn");
    assert!(svg.contains("proved"));
    refused(&CONFINEMENT.replace("circles = 2", "circles = 0"), &["circles"]);
    refused(&CONFINEMENT.replace("to = [0.7, 0.0]", "to = [nan, 0.0]"), &["to"]);
    refused(&CONFINEMENT.replace("steps = 50", "steps = 0"), &["steps"]);
}
