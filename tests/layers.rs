//! Layers against their definitions.

use gyroceptron::layer::{
    CircleAction, ElementaryMap, FastPlanes, HenonLayer, HenonMap, NeuronPotential, TorusAction,
    Turn, Twist, TwistShears, layer_parameter_count,
};
use gyroceptron::network::InitialWeights;
use gyroceptron::phase::Map;
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Scalar, Tracked, max_or_nan};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

fn parameters(dof: usize, width: usize, scale: f64, seed: u64) -> Vec<f64> {
    let mut stream = Stream::new(seed, "layer");
    InitialWeights::Normal { scale }.layer(dof, width, &mut stream)
}

fn point(dof: usize, scale: f64, seed: u64) -> Vec<f64> {
    let mut stream = Stream::new(seed, "point");
    (0..2 * dof).map(|_| stream.uniform(-scale, scale)).collect()
}

fn tracked(values: &[f64]) -> Vec<Tracked> {
    values.iter().map(|&v| Tracked::exact(v)).collect()
}

/// Two computations of the same thing, each with its rounding scale.
fn largest_ratio(a: &[Tracked], b: &[Tracked]) -> f64 {
    let mut largest = 0.0;
    for (a, b) in a.iter().zip(b) {
        let ratio = (a.value - b.value).abs() / (a.error() + b.error());
        largest = max_or_nan(largest, ratio);
    }
    largest
}

#[test]
fn a_layer_has_as_many_parameters_as_the_paper_says() {
    assert_eq!(layer_parameter_count(2, 8), 34);
    assert_eq!(layer_parameter_count(2, 6), 26);
    assert_eq!(layer_parameter_count(2, 10), 42);
    assert_eq!(layer_parameter_count(3, 8), 43);
}

#[test]
fn four_henon_maps_are_the_layer() {
    let mut moved_ratio = 0.0_f64;
    for seed in 0..60 {
        for dof in 1..=4 {
            let epsilon = [1.0, 0.3, -0.01][seed as usize % 3];
            let weights = parameters(dof, 5, 0.5, seed);
            let layer = HenonLayer::new(dof, 5, epsilon, &weights);
            let z = point(dof, 2.0, seed);
            let (mut by_layer, mut by_maps) = (tracked(&z), tracked(&z));
            layer.forward(&mut by_layer);
            for _ in 0..4 {
                layer.map().forward(&mut by_maps);
            }
            let ratio = largest_ratio(&by_layer, &by_maps);
            assert!(ratio <= 1.0, "forward, dof {dof}, seed {seed}: {ratio}");
            moved_ratio = max_or_nan(moved_ratio, ratio);

            let (mut by_layer, mut by_maps) = (tracked(&z), tracked(&z));
            layer.inverse(&mut by_layer);
            for _ in 0..4 {
                layer.map().inverse(&mut by_maps);
            }
            let ratio = largest_ratio(&by_layer, &by_maps);
            assert!(ratio <= 1.0, "inverse, dof {dof}, seed {seed}: {ratio}");
        }
    }
    assert!(moved_ratio > 0.01, "the bound is vacuous: {moved_ratio}");
}

#[test]
fn the_bound_sees_a_layer_that_is_wrong_by_1e_12() {
    let weights = parameters(2, 5, 0.5, 0);
    let mut wrong = weights.clone();
    wrong[0] *= 1.0 + 1e-12;
    let z = point(2, 2.0, 0);
    let (mut right, mut moved) = (tracked(&z), tracked(&z));
    HenonLayer::new(2, 5, 1.0, &weights).forward(&mut right);
    HenonLayer::new(2, 5, 1.0, &wrong).forward(&mut moved);
    assert!(largest_ratio(&right, &moved) > 1.0);
}

#[test]
fn the_henon_map_is_the_papers() {
    let weights = parameters(2, 3, 0.7, 4);
    let (w_in, b_in, w_out, eta) = (&weights[..6], &weights[6..9], &weights[9..12], &weights[12..]);
    let map = HenonMap {
        potential: NeuronPotential::<f64>::new(2, 3, &weights[..12]),
        eta,
        epsilon: 1.0,
    };
    let z = point(2, 1.5, 4);
    // H(x, y) = (y + η, −x + ∇V(y)) with V = w·tanh(Wᵀy + b), by the libm tanh
    // and central differences of V itself.
    let potential = |y: [f64; 2]| -> f64 {
        (0..3)
            .map(|j| {
                let argument = b_in[j] + w_in[j] * y[0] + w_in[3 + j] * y[1];
                w_out[j] * libm::tanh(argument)
            })
            .sum()
    };
    let step = 1e-5;
    let y = [z[2], z[3]];
    let slope = |i: usize| {
        let (mut up, mut down) = (y, y);
        up[i] += step;
        down[i] -= step;
        (potential(up) - potential(down)) / (2.0 * step)
    };
    let mut moved = z.clone();
    map.forward(&mut moved);
    for i in 0..2 {
        assert_eq!(moved[i], z[2 + i] + eta[i]);
        let expected = -z[i] + slope(i);
        assert!((moved[2 + i] - expected).abs() < 1e-9, "{} for {expected}", moved[2 + i]);
    }
    // −x and not +x: blind in the fourth iterate, seen in the map itself.
    let mut back = moved.clone();
    map.inverse(&mut back);
    for (a, b) in back.iter().zip(&z) {
        assert!((a - b).abs() < 1e-15);
    }
}

#[test]
fn a_circle_action_turns_clockwise_with_its_weights() {
    let action = CircleAction::new([1, 0, -2, 5]);
    let z = point(4, 1.0, 6);
    for theta in [0.3, 1.0, -2.5, 3.0, 0.785, 100.0] {
        let mut moved = z.clone();
        action.turn_by(theta).apply(&mut moved, false);
        for (j, &m) in [1.0, 0.0, -2.0, 5.0].iter().enumerate() {
            let (s, c) = libm::sincos(m * theta);
            let expected_q = c * z[j] + s * z[4 + j];
            let expected_p = -s * z[j] + c * z[4 + j];
            let slack = 1e-15 * (4.0 + (m * theta).abs());
            assert!((moved[j] - expected_q).abs() <= slack, "θ = {theta}, plane {j}");
            assert!((moved[4 + j] - expected_p).abs() <= slack, "θ = {theta}, plane {j}");
        }
    }
}

#[test]
fn right_angles_are_exact() {
    let action = CircleAction::new([1]);
    let turned = |theta: f64| {
        let mut z = vec![3.0, 4.0];
        action.turn_by(theta).apply(&mut z, false);
        z
    };
    for (theta, expected) in
        [(0.0, [3.0, 4.0]), (FRAC_PI_2, [4.0, -3.0]), (PI, [-3.0, -4.0]), (-FRAC_PI_2, [-4.0, 3.0])]
    {
        let z = turned(theta);
        // fl(π/2) is not π/2: the rest is a rotation by u.
        assert!((z[0] - expected[0]).abs() + (z[1] - expected[1]).abs() < 2e-15, "{theta}: {z:?}");
    }
    let mut z = vec![-0.0, f64::MIN_POSITIVE];
    let before: Vec<u64> = z.iter().map(|v: &f64| v.to_bits()).collect();
    action.turn_by(0.0).apply(&mut z, false);
    assert_eq!(z.iter().map(|v| v.to_bits()).collect::<Vec<_>>(), before);
}

#[test]
fn rotations_are_undone_to_an_ulp_in_every_quadrant() {
    let action = CircleAction::new([1, 3]);
    // Odd multiples of π/4 are where the quarter turns change over.
    for k in -80_i32..80 {
        let theta = if k % 2 == 0 { f64::from(k) * 0.085 * PI } else { f64::from(k) * PI / 4.0 };
        let z = point(2, 1.0, k.unsigned_abs().into());
        let mut moved = z.clone();
        action.turn_by(theta).apply(&mut moved, false);
        let mut by_negative_angle = moved.clone();
        action.turn_by(theta).apply(&mut moved, true);
        action.turn_by(-theta).apply(&mut by_negative_angle, false);
        for i in 0..4 {
            assert_eq!(moved[i].to_bits(), by_negative_angle[i].to_bits(), "θ = {theta}");
            assert!((moved[i] - z[i]).abs() <= 4.0 * f64::EPSILON, "θ = {theta}");
        }
    }
}

#[test]
fn the_invariant_drifts_as_rounding_and_not_as_the_matrix() {
    let action = CircleAction::new([1]);
    let mut stream = Stream::new(0, "drift");
    let (mut shears, mut matrix) = (0.0_f64, 0.0_f64);
    let (count, steps) = (32, 10_000);
    for _ in 0..count {
        let theta = stream.uniform(0.0, TAU);
        let rotation = action.turn_by(theta);
        let (s, c) = libm::sincos(theta);
        let mut z = vec![1.0, 0.0];
        let mut w = [1.0_f64, 0.0];
        for _ in 0..steps {
            rotation.apply(&mut z, false);
            w = [c * w[0] + s * w[1], c * w[1] - s * w[0]];
        }
        shears += (2.0 * action.invariant::<f64>(&z) - 1.0).powi(2);
        matrix += (w[0] * w[0] + w[1] * w[1] - 1.0_f64).powi(2);
    }
    let (shears, matrix) = ((shears / f64::from(count)).sqrt(), (matrix / f64::from(count)).sqrt());
    assert!(shears < 1e-13, "rms drift of the shears {shears:e}");
    assert!(matrix > 5.0 * shears, "matrix {matrix:e} against shears {shears:e}");
}

#[test]
fn single_precision_runs_the_same_code() {
    let weights: Vec<f32> = parameters(2, 4, 0.5, 8).iter().map(|&v| v as f32).collect();
    let layer = HenonLayer::new(2, 4, 1.0_f32, &weights);
    let mut z = [0.5_f32, -0.3, 0.8, 0.1];
    let start = z;
    layer.forward(&mut z);
    let moved = z;
    layer.inverse(&mut z);
    for i in 0..4 {
        assert!((z[i] - start[i]).abs() <= 20.0 * f32::unit_roundoff() as f32);
        assert!((moved[i] - start[i]).abs() > 1e-3);
    }
}

/// A torus action turns each plane by the sum of what its circles turn it by, and its
/// angles keep their digits where they cancel.
#[test]
fn a_torus_action_is_the_product_of_its_circles() {
    let circles = [CircleAction::new([1, 0, 2]), CircleAction::new([-1, 3, 0])];
    let torus = TorusAction::new(circles.clone()).expect("two circles");
    let z = point(3, 1.5, 7);
    let angles = [0.8, 2.9];
    let (mut at_once, mut one_by_one) = (z.clone(), z.clone());
    torus.turn_by(&angles).forward(&mut at_once);
    for (circle, angle) in circles.iter().zip(angles) {
        circle.turn_by(angle).forward(&mut one_by_one);
    }
    for (a, b) in at_once.iter().zip(&one_by_one) {
        assert!((a - b).abs() < 8.0 * f64::EPSILON, "{a} {b}");
    }
    // θ₂ − θ₁ in the first plane, where both are large and near.
    let far = [1e8 + 0.25, 1e8 + 1.0];
    let mut moved = z.clone();
    torus.turn_by(&far).forward(&mut moved);
    let (s, c) = libm::sincos(-0.75);
    assert!((moved[0] - (c * z[0] + s * z[3])).abs() < 8.0 * f64::EPSILON, "{}", moved[0]);
    assert!(TorusAction::new([]).is_err());
    assert!(TorusAction::new([CircleAction::new([])]).is_err());
    let text = serde_json::to_string(&torus).expect("text");
    assert_eq!(serde_json::from_str::<TorusAction>(&text).expect("read"), torus);
    for bad in ["[]", "[[]]", "[[1], [1, 0]]"] {
        assert!(serde_json::from_str::<TorusAction>(bad).is_err(), "{bad}");
    }
    assert!(TorusAction::new([CircleAction::new([1]), CircleAction::new([1, 0])]).is_err());
    // Each plane by its own angle.
    let mut turned = z.clone();
    Turn::by_angles(&[0.3, 0.0, -1.0]).forward(&mut turned);
    let mut by_circles = z.clone();
    CircleAction::new([1, 0, 0]).turn_by(0.3).forward(&mut by_circles);
    CircleAction::new([0, 0, 1]).turn_by(-1.0).forward(&mut by_circles);
    assert_eq!(turned, by_circles);
}

/// Measures look between the parts: they are those of the map, to the last bit.
#[test]
fn the_parts_of_a_twist_make_it() {
    let one = TorusAction::from(CircleAction::new([1, 0, 2]));
    let two = [CircleAction::new([1, 0, 0]), CircleAction::new([0, 0, 2])];
    let mut stream = Stream::new(5, "twist");
    for action in [one, TorusAction::new(two.to_vec()).expect("two circles")] {
        let planes = FastPlanes::new(&action).expect("planes that turn");
        let alternating = TwistShears::new(planes.clone(), &[3, 1, 0, 4, 2]);
        let turned = TwistShears::turned(planes.clone(), &[3, 1, 4]);
        let turns: Vec<_> = [0.7, -2.0, 3.0].map(|angle| planes.slow_turn(&[angle])).into();
        for (shears, turns) in [(&alternating, &[][..]), (&turned, &turns)] {
            let count = shears.parameter_count();
            let parameters: &Vec<f64> = &(0..count).map(|_| stream.normal()).collect();
            for (inverse, scale) in [(false, 0.3), (true, 0.3), (true, 0.0)] {
                let twist: Twist<'_, f64> = Twist { shears, scale, parameters, inverse, turns };
                let mut point: Vec<f64> = (0..6).map(|_| stream.normal()).collect();
                let mut extended = point.clone();
                extended.resize(2 * planes.extended_dof(), 0.0);
                for part in 0..twist.parts() {
                    twist.apply_part(part, &mut extended);
                }
                twist.apply(&mut point, &mut [0.0; 6]);
                let bits = |z: &[f64]| z.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(&point), bits(&extended[..6]), "{inverse} {scale}");
            }
        }
    }
}
