//! Networks: counts, inverses, pullbacks, batches.

use gyroceptron::Error;
use gyroceptron::flow::Pairs;
use gyroceptron::layer::{Activation, CircleAction, TorusAction};
use gyroceptron::measure::{certificate::Verdict, jacobian, jacobians_by_differences, laws};
use gyroceptron::network::{
    Composition, CouplingGyroceptronShape, GyroceptronShape, HenonShape, InitialWeights, Model,
    NormalFormShape, Pace, Part, Rollout, SympNetShape, map_jacobians, map_jacobians_by_duals,
    map_points, map_points_at_pace, rollout, rollout_at_pace,
};
use gyroceptron::phase::{Direction, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{
    Dual, Lanes, Real, Scalar, Simd, Tracked, WIDTH, max_or_nan, tanh_sech2, tanh_sech2_of_all,
};
use gyroceptron::train::{Loss, Objective};
use std::time::Duration;

fn shape(action: &[i32], psi: Vec<usize>, near_identity: Vec<usize>) -> GyroceptronShape {
    GyroceptronShape { circle_action: CircleAction::new(action), psi, near_identity }
}

fn gyroceptron(shape: GyroceptronShape, scale: f64, seed: u64) -> Model {
    let architecture = shape.architecture(0.01);
    let weights = InitialWeights::Normal { scale };
    architecture.initialise(weights, 0.7, seed).expect("a valid architecture")
}

fn point(dim: usize, seed: u64) -> Vec<f64> {
    let mut stream = Stream::new(seed, "point");
    (0..dim).map(|_| stream.uniform(-1.5, 1.5)).collect()
}

#[test]
fn parameter_counts_are_the_papers() {
    let count = |shape: GyroceptronShape| shape.architecture(0.01).parameter_count();
    assert_eq!(count(shape(&[1, 0], vec![8; 10], vec![6; 8])), 549);
    assert_eq!(count(shape(&[1, 0], vec![8; 10], vec![8; 10])), 681);
    assert_eq!(count(shape(&[0, 1, 2], vec![8; 12], vec![8; 12])), 1033);
    assert_eq!(HenonShape::uniform(2, 16, 10).parameter_count(), 672);
}

#[test]
fn a_wrong_number_of_parameters_is_an_error() {
    let shape = shape(&[1, 0], vec![8; 2], vec![6; 2]);
    let error =
        Model::at_epsilon(shape.architecture(0.01), 0.01, vec![0.0; 7]).unwrap_err().to_string();
    assert!(error.contains("121") && error.contains('7'), "{error}");
}

/// The derivative of c·P(z) in all parameters and in z, forward by duals.
fn by_duals<R>(network: &Model, z: &[f64], c: &[f64]) -> (Vec<R>, Vec<R>)
where
    R: Real,
{
    let parameters = network.composition().parameters();
    let total = parameters.len() + z.len();
    let mut out = Vec::new();
    for first in (0..total).step_by(8) {
        let lift = |index: usize, value: f64| {
            Dual::<R, 8>::variable(R::from_f64(value), index.wrapping_sub(first))
        };
        let lifted = parameters.iter().enumerate().map(|(i, &p)| lift(i, p)).collect();
        let epsilon = Dual::constant(R::from_f64(network.epsilon()));
        let dual =
            Model::at_epsilon(network.architecture().clone(), epsilon, lifted).expect("same shape");
        let mut w: Vec<_> =
            z.iter().enumerate().map(|(i, &v)| lift(parameters.len() + i, v)).collect();
        dual.forward(&mut w);
        for k in 0..8.min(total - first) {
            let mut sum = R::zero();
            for (value, &weight) in w.iter().zip(c) {
                sum = value.eps[k].mul_add(R::from_f64(weight), sum);
            }
            out.push(sum);
        }
    }
    let state = out.split_off(parameters.len());
    (out, state)
}

#[test]
fn pullback_agrees_with_duals_for_every_parameter() {
    let network = gyroceptron(shape(&[1, 0], vec![8; 10], vec![6; 8]), 0.3, 5);
    let network_tracked = network.lift::<Tracked>();
    for seed in 0..3 {
        let z = point(4, seed);
        let c = point(4, seed + 100);
        let tracked = |v: &[f64]| v.iter().map(|&v| Tracked::exact(v)).collect::<Vec<_>>();
        let map = network_tracked.composition();
        let mut recording = map.recording::<Tracked>();
        let mut moved = tracked(&z);
        map.forward_recorded(&mut moved, &mut recording);
        let mut state_bar = tracked(&c);
        let mut parameters_bar = tracked(&vec![0.0; 549]);
        map.vjp(&mut recording, &mut state_bar, &mut parameters_bar);

        let (parameters, state) = by_duals::<Tracked>(&network, &z, &c);
        assert_eq!((parameters.len(), state.len()), (549, 4));
        let mut largest = 0.0_f64;
        let mut tightest = f64::INFINITY;
        let pairs = parameters_bar.iter().chain(&state_bar).zip(parameters.iter().chain(&state));
        for (index, (reverse, forward)) in pairs.enumerate() {
            let bound = reverse.error() + forward.error();
            let ratio = (reverse.value - forward.value).abs() / bound;
            assert!(ratio <= 1.0, "parameter {index}: {ratio}");
            largest = max_or_nan(largest, ratio);
            if reverse.value != 0.0 {
                tightest = -max_or_nan(-tightest, -bound / reverse.value.abs());
            }
        }
        // The bound is tight enough to see a relative error of 1e-9 somewhere,
        // and rounding fills part of it.
        assert!(tightest < 1e-9, "{tightest:e}");
        assert!(largest > 1e-6, "{largest:e}");
    }
}

#[test]
fn pullback_agrees_with_duals_in_other_dimensions() {
    for (action, widths) in [
        (vec![1], vec![3, 2]),
        (vec![0, 1, 2], vec![4, 3]),
        (vec![1, -1, 0, 3], vec![2, 2]),
        (vec![0, 1, 2, 3, 4], vec![3]),
    ] {
        let network = gyroceptron(shape(&action, widths.clone(), widths), 0.4, 11);
        let dim = 2 * action.len();
        let (z, c) = (point(dim, 1), point(dim, 2));
        let map = network.composition();
        let mut recording = map.recording::<f64>();
        let mut moved = z.clone();
        map.forward_recorded(&mut moved, &mut recording);
        let mut state_bar = c.clone();
        let mut parameters_bar = vec![0.0; map.parameters().len()];
        map.vjp(&mut recording, &mut state_bar, &mut parameters_bar);
        let (parameters, state) = by_duals::<f64>(&network, &z, &c);
        for (a, b) in parameters_bar.iter().chain(&state_bar).zip(parameters.iter().chain(&state)) {
            assert!((a - b).abs() <= 1e-13 * (1.0 + b.abs()), "{action:?}: {a} for {b}");
        }
        let mut plain = z.clone();
        network.forward(&mut plain);
        assert_eq!(moved, plain);
    }
}

#[test]
fn the_gyroceptron_is_the_composition_of_its_parts() {
    let network = gyroceptron(shape(&[1, 0], vec![5; 3], vec![4; 3]), 0.4, 2);
    let z = point(4, 3);
    let mut by_parts = z.clone();
    network.psi().inverse(&mut by_parts);
    network.architecture().circles[0].turn_by(network.angles()[0]).apply(&mut by_parts, false);
    network.psi().forward(&mut by_parts);
    network.near_identity().forward(&mut by_parts);
    let mut whole = z.clone();
    network.forward(&mut whole);
    assert_eq!(whole, by_parts);
    // Layer by layer too.
    let psi = network.psi();
    let (mut by_layers, mut by_net) = (z.clone(), z);
    for layer in network.henon_layers(Part::Conjugation) {
        layer.forward(&mut by_layers);
    }
    psi.forward(&mut by_net);
    assert_eq!(by_layers, by_net);
}

#[test]
fn inverses_and_inverted_compositions_agree() {
    let network = gyroceptron(shape(&[1, 2], vec![5; 3], vec![4; 3]), 0.4, 2);
    let z = point(4, 4);
    let (mut by_method, mut by_composition) = (z.clone(), z.clone());
    network.inverse(&mut by_method);
    network.composition().inverted().forward(&mut by_composition);
    assert_eq!(by_method, by_composition);
    network.forward(&mut by_method);
    for (a, b) in by_method.iter().zip(&z) {
        assert!((a - b).abs() < 1e-14);
    }
}

#[test]
fn jacobians_agree_with_central_differences() {
    for action in [vec![1], vec![1, 0], vec![0, 1, 2], vec![0, 1, 2, 3, 4]] {
        let network = gyroceptron(shape(&action, vec![4; 2], vec![3; 2]), 0.4, 8);
        let dim = 2 * action.len();
        let z = point(dim, 5);
        let exact = jacobian(&network, &z);
        let step = 1e-6;
        for column in 0..dim {
            let shifted = |sign: f64| {
                let mut w = z.clone();
                w[column] += sign * step;
                network.forward(&mut w);
                w
            };
            let (up, down) = (shifted(1.0), shifted(-1.0));
            for row in 0..dim {
                let difference = (up[row] - down[row]) / (2.0 * step);
                assert!((exact[(row, column)] - difference).abs() < 1e-8);
            }
        }
    }
}

/// On all sets of vector instructions that this processor has. Other tests that
/// run meanwhile get the same bits.
fn on_each_simd(check: impl Fn(Simd)) {
    let sets: Vec<Simd> = Simd::ALL.into_iter().filter(|set| set.is_available()).collect();
    for &set in &sets {
        set.limit();
        assert!(Simd::current() == set);
        check(set);
    }
    Simd::Avx512.limit();
}

fn same_bits(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// The first plane fast, and of three and more a second circle.
fn normal_form(dof: usize) -> Model {
    let circle = |plane: usize, m: i32| {
        CircleAction::new(Vec::from_iter((0..dof).map(|j| if j == plane { m } else { 0 })))
    };
    let mut circles = vec![circle(0, 1)];
    if dof > 2 {
        circles.push(circle(1, 2));
    }
    let action = TorusAction::new(circles).expect("circles");
    let (psi, kicks) = (vec![3, 2], vec![5, 1, 4]);
    let shape = NormalFormShape {
        action,
        psi,
        kicks,
        twists: vec![5, 5, 0, 2],
        turned_twists: vec![],
        flow_time: 7.0,
        perturbation: None,
    };
    let count = shape.architecture(0.0).parameter_count();
    Model::at_epsilon(shape.architecture(0.1), 0.1, point(count, 8)).expect("valid")
}

/// Compositions of all kinds of step, in one to five degrees of freedom.
fn compositions() -> Vec<Composition<f64>> {
    let mut out = Vec::new();
    for dof in 1..=5 {
        let shape = HenonShape { dof, widths: vec![8, 7, 2, 1] };
        let net = shape.architecture(1.0);
        let net = net.initialise(InitialWeights::Glorot, 0.0, 3).expect("valid");
        let torus = TorusAction::of_planes(dof);
        let turn = Composition::of_turn(&torus, point(dof, 2)).expect("an angle a plane");
        out.push(turn.followed_by(net.composition(), Direction::Inverse).expect("of one size"));
        out.push(normal_form(dof).composition().clone());
        let shape = CouplingGyroceptronShape {
            circle_action: CircleAction::new(vec![1; dof]),
            psi: vec![5, 1],
            near_identity: vec![4, 7],
            flow_time: 2.0,
        };
        let parameters = point(shape.architecture(0.0).parameter_count(), 6);
        let net = Model::at_epsilon(shape.architecture(0.3), 0.3, parameters).expect("valid");
        out.push(net.composition().clone());
        for plain in [false, true] {
            let activation = Activation::Sigmoid;
            let shape = SympNetShape { dof, modules: 2, shears: 2, activation, plain };
            let net = Model::new(shape.architecture(), point(shape.parameter_count(), 1));
            out.push(net.expect("valid").composition().clone());
        }
    }
    out
}

/// One point as numbers go that have no vector registers: `Map<f64>` has a neuron in each lane, as
/// [`map_points`] of a point has.
fn plainly(map: &Composition<f64>, direction: Direction, z: &mut [f64]) {
    let mut lanes: Vec<Lanes<WIDTH>> = z.iter().map(|x| Lanes([*x; WIDTH])).collect();
    match direction {
        Direction::Forward => map.forward(&mut lanes),
        Direction::Inverse => map.inverse(&mut lanes),
    }
    z.iter_mut().zip(lanes).for_each(|(x, lanes)| *x = lanes.0[0]);
}

/// The limit is one for the process: what sets it is one test.
#[test]
fn batches_are_single_points_bit_for_bit_on_all_instruction_sets() {
    // Widths that leave neurons over in groups of eight, four and two.
    let network = gyroceptron(shape(&[1, 0], vec![5, 11, 8], vec![4, 1, 7]), 0.4, 2);
    // A ragged tail, and more points than one task moves.
    for count in [1, 7, 8, 9, 300, 515] {
        let points = point(4 * count, 9);
        for direction in [Direction::Forward, Direction::Inverse] {
            let mut singles = points.clone();
            for single in singles.chunks_exact_mut(4) {
                plainly(network.composition(), direction, single);
            }
            on_each_simd(|set| {
                let mut batch = points.clone();
                map_points(network.composition(), direction, &mut batch).expect("whole points");
                assert!(same_bits(&batch, &singles), "{set:?}, {count} points");
            });
        }
    }
    assert!(map_points(network.composition(), Direction::Forward, &mut [0.0; 5]).is_err());

    let one = HenonShape { dof: 1, widths: vec![8, 3, 17] };
    let wide = one.architecture(1.0);
    let wide = wide.initialise(InitialWeights::Glorot, 0.0, 3).expect("valid");
    for z in [[0.3, -0.7], [1e8, -1e-8], [f64::NAN, 0.0], [f64::INFINITY, 1.0]] {
        let mut single = z;
        plainly(wide.composition(), Direction::Forward, &mut single);
        on_each_simd(|set| {
            let mut across = z;
            map_points(wide.composition(), Direction::Forward, &mut across).expect("a point");
            let fits = |a: f64, b: f64| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
            assert!(across.iter().zip(single).all(|(a, b)| fits(*a, b)), "{set:?} {z:?}");
        });
    }

    // One point alone, of every number of dimensions that is compiled apart, and of every
    // kind of step; 9 points leave one over.
    for map in compositions() {
        let dim = 2 * map.dof();
        for count in [1, 9] {
            let points = point(dim * count, 6);
            let mut singles = points.clone();
            singles.chunks_exact_mut(dim).for_each(|z| plainly(&map, Direction::Forward, z));
            on_each_simd(|set| {
                let mut alone = points.clone();
                alone.chunks_exact_mut(dim).for_each(|z| map.forward(z));
                assert!(same_bits(&alone, &singles), "{set:?}, a point, {dim}-D");
                let mut batch = points.clone();
                map_points(&map, Direction::Forward, &mut batch).expect("whole points");
                assert!(same_bits(&batch, &singles), "{set:?}, {count} points, {dim}-D");
            });
        }
    }
    // Derivatives of every kind of step on registers: by the chain rule against duals, by
    // the adjoint against that of single points.
    for map in compositions() {
        let (dim, count) = (2 * map.dof(), map.parameters().len());
        let points = point(dim * 35, 7);
        let mut expected = vec![0.0; points.len() * dim];
        map_jacobians_by_duals(&map, &points, &mut expected).expect("whole points");
        let pairs = Pairs::new("points", map.dof(), points.clone(), vec![0.0; points.len()]);
        let pairs = pairs.expect("finite");
        let objective = Objective::new(&Loss::MeanSquaredError, &pairs).expect("weights");
        let mut pulled = vec![0.0; count];
        let mut recording = map.recording();
        for z in points.chunks_exact(dim) {
            let mut image = z.to_vec();
            map.forward_recorded(&mut image, &mut recording);
            let factor = 2.0 / points.len() as f64;
            let mut cotangent: Vec<f64> = image.iter().map(|v| factor * v).collect();
            map.vjp(&mut recording, &mut cotangent, &mut pulled);
        }
        let near = |found: &[f64], expected: &[f64]| {
            let scale = expected.iter().map(|v| v.abs()).fold(1e-3, max_or_nan);
            found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 1e-11 * scale)
        };
        on_each_simd(|set| {
            let mut out = vec![f64::NAN; points.len() * dim];
            map_jacobians(&map, &points, &mut out).expect("whole points");
            assert!(near(&out, &expected), "{set:?}, {dim}-D, {count} parameters");
            let mut gradient = vec![f64::NAN; count];
            objective.value_and_gradient(&map, &mut gradient);
            assert!(near(&gradient, &pulled), "{set:?}, {dim}-D, {count} parameters");
        });
    }
    // tanh and sech², ragged and at the ends of the range.
    let mut x = point(77, 8);
    x.extend([0.0, -0.0, 18.6, 18.7, -354.0, 355.0, 5e-324, f64::INFINITY, f64::NEG_INFINITY]);
    on_each_simd(|set| {
        let (mut t, mut s) = (vec![0.0; x.len()], vec![0.0; x.len()]);
        tanh_sech2_of_all(&x, &mut t, &mut s);
        let (a, b): (Vec<f64>, Vec<f64>) = x.iter().map(|&x| tanh_sech2(x)).unzip();
        assert!(same_bits(&t, &a) && same_bits(&s, &b), "{set:?}");
        tanh_sech2_of_all(&[f64::NAN], &mut t[..1], &mut s[..1]);
        assert!(t[0].is_nan() && s[0].is_nan(), "{set:?}");
    });

    // Jacobians, in as many directions as go at once and in more.
    for dof in [1, 2, 3, 5] {
        let shape = HenonShape { dof, widths: vec![6, 5] };
        let architecture = shape.architecture(1.0);
        let net = architecture.initialise(InitialWeights::Glorot, 0.0, 3).expect("valid");
        let dim = 2 * dof;
        let points = point(dim * 11, 5);
        let expected: Vec<f64> = points
            .chunks_exact(dim)
            .flat_map(|z| {
                let matrix = jacobian(net.composition(), z);
                (0..dim * dim).map(move |k| matrix[(k / dim, k % dim)])
            })
            .collect();
        on_each_simd(|set| {
            let mut out = vec![f64::NAN; points.len() * dim];
            map_jacobians_by_duals(net.composition(), &points, &mut out).expect("whole points");
            assert!(same_bits(&out, &expected), "{set:?}, {dof} degrees of freedom");
        });
        let mut narrow = vec![f64::NAN; points.len() * dim];
        Simd::Portable.limit();
        map_jacobians(net.composition(), &points, &mut narrow).expect("whole points");
        on_each_simd(|set| {
            let mut out = vec![f64::NAN; points.len() * dim];
            map_jacobians(net.composition(), &points, &mut out).expect("whole points");
            assert!(same_bits(&out, &narrow), "{set:?}, {dof} degrees of freedom, chain rule");
        });
        assert!(map_jacobians_by_duals(net.composition(), &points, &mut [0.0; 7]).is_err());
    }

    // Loss, gradient and curvature.
    let pairs = Pairs::new("pairs", 2, point(4 * 1100, 3), point(4 * 1100, 4)).expect("finite");
    let objective = Objective::new(&Loss::MeanSquaredError, &pairs).expect("weights");
    let all = || {
        let mut gradient = vec![0.0; network.composition().parameters().len()];
        let value = objective.value_and_gradient(network.composition(), &mut gradient);
        gradient.push(value);
        gradient.push(objective.value(network.composition()));
        gradient.extend(objective.curvature_diagonal(network.composition()));
        gradient
    };
    let expected = all();
    on_each_simd(|set| assert!(same_bits(&all(), &expected), "{set:?}"));
}

#[test]
fn a_rollout_keeps_what_was_asked_for() {
    let network = gyroceptron(shape(&[1, 0], vec![3; 2], vec![3; 2]), 0.3, 2);
    // One point, a few, and more than one task moves, kept for longer than one
    // task keeps them apart.
    for (count, steps, every) in [(1, 11, 4), (3, 11, 4), (257, 5, 1), (530, 67, 1)] {
        let initial = point(4 * count, 9);
        let request = Rollout { steps, every };
        let kept = rollout(network.composition(), &initial, request).expect("a valid request");
        assert_eq!(kept.len(), request.kept() * initial.len());
        let mut state = initial.clone();
        for t in 0..=steps {
            if t % every == 0 {
                let states = &kept[t / every * 4 * count..][..4 * count];
                assert!(same_bits(states, &state), "{count} points, step {t}");
            }
            for z in state.chunks_exact_mut(4) {
                plainly(network.composition(), Direction::Forward, z);
            }
        }
    }
    let request = Rollout { steps: 3, every: 1 };
    assert!(rollout(network.composition(), &[], request).expect("no point").is_empty());
    let none = Rollout { steps: 1, every: 0 };
    assert!(rollout(network.composition(), &point(4, 9), none).is_err());
    assert!(rollout(network.composition(), &[0.0; 5], request).is_err());
}

#[test]
fn the_generator_of_the_near_identity_network_is_the_known_one() {
    // ∂_ε I_ε at 0 is X_{G₁}, G₁ = −Σ[V(y) + V(−y−η) + V(−x) + V(x−η)].
    let shape = HenonShape { dof: 2, widths: vec![3, 4] };
    let mut stream = Stream::new(3, "weights");
    let weights = InitialWeights::Normal { scale: 0.6 };
    let parameters: Vec<f64> =
        shape.widths.iter().flat_map(|&h| weights.layer(2, h, &mut stream)).collect();
    let z = point(4, 12);

    type D = Dual<f64, 1>;
    let lifted = parameters.iter().map(|&p| D::constant(p)).collect();
    let net =
        Model::at_epsilon(shape.architecture(0.0), D::variable(0.0, 0), lifted).expect("fits");
    let mut moved: Vec<D> = z.iter().map(|&v| D::constant(v)).collect();
    net.forward(&mut moved);

    type E = Dual<f64, 4>;
    let w: Vec<E> = z.iter().enumerate().map(|(i, &v)| E::variable(v, i)).collect();
    let mut generator = E::zero();
    let mut start = 0;
    for &h in &shape.widths {
        let (w_in, rest) = parameters[start..].split_at(2 * h);
        let (b, rest) = rest.split_at(h);
        let (out, rest) = rest.split_at(h);
        let eta = &rest[..2];
        start += 4 * h + 2;
        let potential = |y: [E; 2]| {
            (0..h).fold(E::zero(), |sum, j| {
                let argument = E::constant(w_in[j]) * y[0]
                    + E::constant(w_in[h + j]) * y[1]
                    + E::constant(b[j]);
                sum + E::constant(out[j]) * argument.tanh()
            })
        };
        let shift = |v: [E; 2]| [v[0] - E::constant(eta[0]), v[1] - E::constant(eta[1])];
        let (x, y) = ([w[0], w[1]], [w[2], w[3]]);
        generator = generator
            - potential(y)
            - potential(shift([-y[0], -y[1]]))
            - potential([-x[0], -x[1]])
            - potential(shift(x));
    }
    // X_G = Ω∇G.
    let expected = [generator.eps[2], generator.eps[3], -generator.eps[0], -generator.eps[1]];
    for i in 0..4 {
        assert_eq!(moved[i].re, z[i]);
        assert!((moved[i].eps[0] - expected[i]).abs() < 1e-14, "component {i}");
        assert!(expected[i].abs() > 1e-3);
    }
}

#[test]
fn initial_weights_depend_on_the_seed_alone() {
    let architecture = shape(&[1, 0], vec![4; 2], vec![3; 2]).architecture(0.01);
    for weights in [InitialWeights::Glorot, InitialWeights::Normal { scale: 0.15 }] {
        let draw = |seed| {
            let model = architecture.initialise(weights, 0.05, seed).expect("valid");
            model.composition().parameters().to_vec()
        };
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1), draw(2));
        assert_eq!(*draw(1).last().expect("θ"), 0.05);
        // A wider ψ changes no weight of I_ε: streams have names.
        let wider = shape(&[1, 0], vec![9; 2], vec![3; 2]).architecture(0.01);
        let wide = wider.initialise(weights, 0.05, 1).expect("valid");
        let tail = draw(1).split_off(36);
        assert!(wide.composition().parameters().ends_with(&tail));
    }
    // Glorot's bound, reached but not passed.
    let model = architecture.initialise(InitialWeights::Glorot, 0.0, 3).expect("valid");
    let bound = (6.0_f64 / 6.0).sqrt();
    let inner = &model.composition().parameters()[..8];
    assert!(inner.iter().all(|w| w.abs() <= bound) && inner.iter().any(|w| w.abs() > 0.3));
}

#[test]
fn impossible_architectures_are_refused() {
    let ok = shape(&[1, 0], vec![3], vec![3]);
    for (shape, epsilon) in [
        (ok.clone(), f64::NAN),
        (ok.clone(), f64::INFINITY),
        (shape(&[], vec![3], vec![3]), 0.01),
        (shape(&[0, 0], vec![3], vec![3]), 0.01),
        (shape(&[1, 0], vec![0], vec![3]), 0.01),
    ] {
        assert!(shape.architecture(epsilon).check().is_err());
    }
    let architecture = ok.architecture(0.01);
    let mut parameters = vec![0.0; architecture.parameter_count()];
    parameters[4] = f64::NAN;
    assert!(Model::new(architecture, parameters).is_err());
}

/// Three ways to a Jacobian that share no derivative: the duals', the product of
/// the steps' Hessians, and differences, which are wrong by O(h²).
#[test]
fn jacobians_by_three_ways_agree() {
    for action in [vec![1], vec![1, 0], vec![0, 1, 2], vec![1, 1, 2, 3, 5]] {
        let dim = 2 * action.len();
        let network = gyroceptron(shape(&action, vec![6, 7], vec![5, 4]), 0.6, 2);
        let map = network.composition();
        let points = point(dim * 21, 8);
        let all = |f: &dyn Fn(&mut [f64])| {
            let mut out = vec![f64::NAN; points.len() * dim];
            f(&mut out);
            out
        };
        let by_duals = all(&|out| map_jacobians_by_duals(map, &points, out).expect("whole points"));
        let by_hand = all(&|out| map_jacobians(map, &points, out).expect("whole points"));
        let difference =
            |a: &[f64]| a.iter().zip(&by_duals).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
        let size = by_duals.iter().map(|v| v.abs()).fold(0.0, max_or_nan);
        assert!(difference(&by_hand) < 1e-14 * size, "{:e}", difference(&by_hand));
        let errors: Vec<f64> = [2e-3, 1e-3]
            .iter()
            .map(|&step| {
                difference(&all(&|out| {
                    jacobians_by_differences(map, step, &points, out).expect("whole points");
                }))
            })
            .collect();
        let order = (errors[0] / errors[1]).log2();
        assert!((order - 2.0).abs() < 0.02, "{order}, {errors:?}");
        assert!(map_jacobians(map, &points, &mut [0.0; 7]).is_err());
        assert!(jacobians_by_differences(map, 1e-3, &points, &mut [0.0; 7]).is_err());
        let partial = &points[1..];
        let mut out = vec![0.0; partial.len() * dim];
        assert!(jacobians_by_differences(map, 1e-3, partial, &mut out).is_err());
    }
}

/// A turn by two angles between a HénonNet and the inverse of a gyroceptron: what is
/// put together is what one after the other do, and its derivatives are right in all
/// parameters, the angles among them.
#[test]
fn compositions_are_put_together() {
    let action = TorusAction::new([CircleAction::new([1, 0, 2]), CircleAction::new([0, 3, -1])])
        .expect("two circles of three planes");
    let shape = shape(&[1, 0, 2], vec![4; 2], vec![3; 2]);
    let last = gyroceptron(shape, 0.4, 3);
    let widths = HenonShape::uniform(3, 2, 5);
    let architecture = widths.architecture(1.0);
    let first = architecture
        .initialise(InitialWeights::Normal { scale: 0.4 }, 0.0, 2)
        .expect("a valid architecture");
    let turn = Composition::of_turn(&action, vec![0.9, -2.3]).expect("two angles");
    let all = first
        .composition()
        .followed_by(&turn, Direction::Forward)
        .and_then(|both| both.followed_by(last.composition(), Direction::Inverse));
    // Both have steps scaled by their own ε, 1 and 0.01.
    assert!(all.is_err());
    let last = last.with_epsilon(1.0);
    let all = first
        .composition()
        .followed_by(&turn, Direction::Forward)
        .and_then(|both| both.followed_by(last.composition(), Direction::Inverse))
        .expect("one ε");

    let z = point(6, 5);
    let mut expected = z.clone();
    first.forward(&mut expected);
    turn.forward(&mut expected);
    last.inverse(&mut expected);
    let mut moved = z.clone();
    all.forward(&mut moved);
    assert_eq!(moved, expected);
    let mut inverted = expected.clone();
    all.inverted().forward(&mut inverted);
    all.inverse(&mut moved);
    assert_eq!(moved, inverted);
    for (a, b) in moved.iter().zip(&z) {
        assert!((a - b).abs() < 1e-12, "{a} {b}");
    }
    let tally = laws::pullback(&all, &point(12, 6), 3, 1);
    assert_eq!(tally.row().verdict, Verdict::Holds, "{:?}", tally.row());
    let narrow = Composition::of_turn(&CircleAction::new([1]).into(), vec![0.1]).expect("one");
    assert!(all.followed_by(&narrow, Direction::Forward).is_err());
    assert!(Composition::of_turn(&action, vec![0.1]).is_err());
}

/// Kicks whose increment is −0, where products underflow, each alone: the others of its
/// layer would hide the sign.
#[test]
fn a_zero_keeps_its_sign_where_a_point_goes_alone() {
    let mut negative = 0;
    for width in 1..=9 {
        for sign in [1e-200, -1e-200] {
            // W, b, w and η.
            let parts = [(sign, width), (0.0, width), (-sign, width), (0.0, 1)];
            let parameters = parts.map(|(value, count)| vec![value; count]).concat();
            let shape = HenonShape { dof: 1, widths: vec![width] };
            let net = Model::new(shape.architecture(1.0), parameters).expect("a network");
            let kicks: Vec<_> = net.composition().step_by_step().collect();
            assert_eq!(kicks.len(), 4);
            for (form, map) in kicks.iter().enumerate() {
                let mut single = [-0.0, -0.0];
                let mut alone = single;
                plainly(map, Direction::Forward, &mut single);
                map_points(map, Direction::Forward, &mut alone).expect("a point");
                assert_eq!(alone.map(f64::to_bits), single.map(f64::to_bits), "{width} {form}");
                negative += usize::from(single.iter().all(|z| z.is_sign_negative()));
            }
        }
    }
    assert!(negative > 0);
}

/// Parts of steps, of points and of states that are kept.
#[test]
fn a_roll_out_in_parts_has_the_same_bits_and_stops() {
    let parameters: Vec<f64> = (0..10).map(|k| 0.3 * libm::sin(f64::from(k))).collect();
    let shape = HenonShape { dof: 1, widths: vec![3] };
    let net = Model::new(shape.architecture(1.0), parameters).expect("a network");
    let map = net.composition();
    for (points, steps, every) in
        [(1, 5000, 1), (1, 9000, 4000), (3, 3000, 2000), (600, 50, 7), (20_000, 5, 2)]
    {
        let initial: Vec<f64> = (0..2 * points).map(|k| libm::sin(f64::from(k as u32))).collect();
        let request = Rollout { steps, every };
        let whole = rollout(map, &initial, request).expect("a roll-out");
        let mut asked = 0;
        let mut go_on = || {
            asked += 1;
            true
        };
        let parts = rollout_at_pace(map, &initial, request, &mut Pace::asking(&mut go_on));
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&parts.expect("a roll-out")), bits(&whole), "{points} {every}");
        assert!(asked > 1, "{points} points: {asked}");
        let mut stops = || false;
        let stopped = rollout_at_pace(map, &initial, request, &mut Pace::asking(&mut stops));
        assert!(matches!(stopped, Err(Error::Stopped { .. })), "{stopped:?}");
        let mut moved = initial.clone();
        map_points(map, Direction::Inverse, &mut moved).expect("points");
        let mut go_on = || true;
        let mut in_parts = initial;
        let pace = &mut Pace::asking(&mut go_on);
        map_points_at_pace(map, Direction::Inverse, &mut in_parts, pace).expect("points");
        assert_eq!(bits(&in_parts), bits(&moved));
    }
}

#[test]
fn parts_grow_only_as_long_as_they_are_quick_and_whole() {
    let mut go_on = || true;
    let mut pace = Pace::asking(&mut go_on);
    assert_eq!((pace.part(1), pace.part(100), pace.part(5000)), (1024, 10, 1));
    for _ in 0..100 {
        pace.pause("a sum", 10).expect("goes on");
    }
    assert_eq!(pace.part(1), 1024);
    pace.pause("a sum", 1000).expect("goes on");
    assert_eq!(pace.part(1), 2048);
    std::thread::sleep(Duration::from_millis(320));
    pace.pause("a sum", 2048).expect("goes on");
    assert_eq!(pace.part(1), 1024);
    assert_eq!(Pace::unbroken().part(1), usize::MAX);
}
