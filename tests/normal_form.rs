//! Twists, turned kicks, and the gyroceptrons in normal form that they make.

use gyroceptron::flow::GaussLegendre;
use gyroceptron::layer::{
    CircleAction, ElementaryMap, FastPlanes, NeuronPotential, TorusAction, TurnedKick, Twist,
    TwistShears,
};
use gyroceptron::measure::{
    adiabatic::log_slope,
    certificate::{CertificateOptions, certify, certify_normal_form},
};
use gyroceptron::network::{
    Architecture, Block, InitialWeights, Layers, Model, NormalFormShape, Part, Rollout,
};
use gyroceptron::phase::Map;
use gyroceptron::random::Stream;
use gyroceptron::scalar::{
    DoubleDouble, Dual, Elementary, Over, Real, Scalar, Tracked, max_or_nan,
};
use gyroceptron::system::Hamiltonian;
use std::ops::Range;

type D = Dual<f64, 1>;

/// The neurons of three shears, of which the first and the third have a quadratic form.
const WIDTHS: [usize; 3] = [3, 2, 0];

/// Where the parameters of a shear are: W, b, w and, of the first and the third, the upper
/// triangle of Q.
fn place(d: usize, shear: usize) -> Range<usize> {
    let of = |shear: usize| {
        let form = if shear.is_multiple_of(2) { d * (d + 1) / 2 } else { 0 };
        WIDTHS[shear] * (d + 2) + form
    };
    let begin = (0..shear).map(of).sum();
    begin..begin + of(shear)
}

/// Actions with slow planes and without, resonant and with several circles.
fn actions() -> Vec<TorusAction> {
    let torus = |circles: &[&[i32]]| {
        let circles: Vec<_> = circles.iter().map(|m| CircleAction::new(*m)).collect();
        TorusAction::new(circles).expect("circles of one size")
    };
    vec![
        torus(&[&[1]]),
        torus(&[&[1, 0]]),
        torus(&[&[0, 1, -2]]),
        torus(&[&[1, 0, 0, 2], &[0, 0, 1, -1]]),
    ]
}

struct Case {
    action: TorusAction,
    shears: TwistShears,
    parameters: Vec<f64>,
    z: Vec<f64>,
}

fn cases() -> Vec<Case> {
    let case = |(number, action): (usize, TorusAction)| {
        let planes = FastPlanes::new(&action).expect("few circles");
        let mut stream = Stream::new(number as u64, "twist");
        let count = place(planes.arguments(), 2).end;
        let shears = TwistShears::new(planes, &WIDTHS);
        assert_eq!(shears.parameter_count(), count);
        let parameters = (0..count).map(|_| stream.uniform(-1.0, 1.0)).collect();
        let z = (0..2 * action.dof()).map(|_| stream.uniform(-1.5, 1.5)).collect();
        Case { action, shears, parameters, z }
    };
    actions().into_iter().enumerate().map(case).collect()
}

impl Case {
    fn with<'a, P: Scalar>(&'a self, scale: P, parameters: &'a [P]) -> Twist<'a, P> {
        Twist { shears: &self.shears, scale, parameters, inverse: false, turns: &[] }
    }

    fn twist(&self, scale: f64) -> Twist<'_, f64> {
        self.with(scale, &self.parameters)
    }

    /// The twist on another number, or its inverse.
    fn image<S: Over<f64>>(&self, scale: f64, z: &[S], inverse: bool) -> Vec<S> {
        let twist = self.twist(scale);
        let twist = if inverse { ElementaryMap::inverse(twist) } else { twist };
        let (mut z, mut scratch) = (z.to_vec(), vec![S::zero(); z.len()]);
        twist.apply(&mut z, &mut scratch);
        z
    }

    /// G_l at z by its definition, of whose flow the l-th shear is made.
    fn generator(&self, layer: usize, z: &[D]) -> D {
        let (n, d) = (self.action.dof(), self.shears.planes().arguments());
        let circles = self.action.circles();
        let mut y: Vec<D> = circles.iter().map(|circle| circle.invariant(z)).collect();
        let slow = (0..n).filter(|&j| circles.iter().all(|circle| circle.weights()[j] == 0));
        // The positions change first, so that y are the momenta.
        y.extend(slow.map(|j| if layer.is_multiple_of(2) { z[n + j] } else { z[j] }));
        let (weights, width) = (&self.parameters[place(d, layer)], WIDTHS[layer]);
        let mut total = D::zero();
        for k in 0..width {
            let mut argument = D::constant(weights[d * width + k]);
            for i in 0..d {
                argument += D::constant(weights[i * width + k]) * y[i];
            }
            total += D::constant(weights[(d + 1) * width + k]) * argument.tanh();
        }
        let triangle = (0..d).flat_map(|i| (i..d).map(move |k| (i, k)));
        for ((i, k), &entry) in triangle.zip(&weights[width * (d + 2)..]) {
            let half = if i == k { 0.5 } else { 1.0 };
            total += D::constant(half * entry) * y[i] * y[k];
        }
        total
    }

    /// Hamilton's equations of G_l.
    fn field(&self, layer: usize, z: &[f64]) -> Vec<f64> {
        let slope = |index: usize| {
            let lifted = |(i, &v): (usize, &f64)| D::variable(v, if i == index { 0 } else { 1 });
            let z: Vec<D> = z.iter().enumerate().map(lifted).collect();
            self.generator(layer, &z).eps[0]
        };
        let n = self.action.dof();
        (0..2 * n).map(|i| if i < n { slope(n + i) } else { -slope(i - n) }).collect()
    }
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan)
}

/// G(𝔍, y cos φ + x sin φ) of a turned twist by its definition, of the actions and the slow planes.
struct TurnedGenerator<'a> {
    action: &'a TorusAction,
    slow: Vec<usize>,
    angles: &'a [f64],
    /// W, b and w.
    weights: &'a [f64],
    width: usize,
}

impl Hamiltonian for TurnedGenerator<'_> {
    fn dof(&self) -> usize {
        self.action.dof()
    }
    fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
        let (n, width, constant) = (self.dof(), self.width, S::from_f64);
        let half = constant(0.5);
        let mut u = Vec::new();
        for circle in self.action.circles() {
            let mut sum = S::zero();
            for (j, &m) in circle.weights().iter().enumerate() {
                sum += constant(f64::from(m)) * half * (z[j] * z[j] + z[n + j] * z[n + j]);
            }
            u.push(sum);
        }
        for (&j, &angle) in self.slow.iter().zip(self.angles) {
            u.push(z[j] * constant(angle.cos()) + z[n + j] * constant(angle.sin()));
        }
        let mut total = S::zero();
        for k in 0..width {
            let mut argument = constant(self.weights[u.len() * width + k]);
            for (i, &u) in u.iter().enumerate() {
                argument += constant(self.weights[i * width + k]) * u;
            }
            total += constant(self.weights[(u.len() + 1) * width + k]) * argument.tanh();
        }
        total
    }
}

/// By Gauss and Legendre's steps for the Hamiltonian of each of two turned twists.
#[test]
fn a_turned_twist_is_the_flow_of_a_function_of_turned_coordinates() {
    for action in actions() {
        let n = action.dof();
        let still = |j: &usize| action.circles().iter().all(|circle| circle.weights()[*j] == 0);
        let slow: Vec<usize> = (0..n).filter(still).collect();
        if slow.is_empty() {
            continue;
        }
        for scale in [0.7, -2.1] {
            let widths = [3, 2];
            let architecture = Architecture::new(n)
                .on_torus(&action)
                .at_epsilon(scale)
                .with(Block::new(Part::SlowMap, Layers::TurnedTwist(widths.to_vec())));
            let weights = InitialWeights::Normal { scale: 0.8 };
            let model = architecture.initialise(weights, 0.0, 5).expect("sound");
            let map = model.composition().near_identity_part();
            let mut stream = Stream::new(3, "turned twist");
            let z: Vec<f64> = (0..2 * n).map(|_| stream.uniform(-1.5, 1.5)).collect();
            let (mut image, mut flow) = (z.clone(), z.clone());
            map.forward(&mut image);
            for ((_, number, range), width) in architecture.layers().into_iter().zip(widths) {
                assert!(number < 2);
                let (angles, weights) = model.parameters()[range].split_at(slow.len());
                let (slow, action) = (slow.clone(), &action);
                let generator = TurnedGenerator { action, slow, angles, weights, width };
                GaussLegendre::new(8).integrate(&generator, &mut flow, scale, 40).expect("flows");
            }
            let difference = largest_difference(&image, &flow);
            assert!(difference < 1e-13, "{action:?}: {difference:e}");
            assert!(largest_difference(&image, &z) > 0.05, "{action:?} hardly moves");
        }
    }
}

/// By Runge and Kutta's steps for each of the three Hamiltonians, one after another.
#[test]
fn a_twist_is_the_flow_of_its_generators() {
    for case in cases() {
        for scale in [0.7, -3.1] {
            let steps = 8000;
            let h = scale / f64::from(steps);
            let mut z = case.z.clone();
            for layer in 0..3 {
                for _ in 0..steps {
                    let at = |k: &[f64], h: f64| -> Vec<f64> {
                        let moved: Vec<f64> = z.iter().zip(k).map(|(z, k)| z + h * k).collect();
                        case.field(layer, &moved)
                    };
                    let a = case.field(layer, &z);
                    let b = at(&a, 0.5 * h);
                    let c = at(&b, 0.5 * h);
                    let d = at(&c, h);
                    for i in 0..z.len() {
                        z[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
                    }
                }
            }
            let image = case.image(scale, &case.z, false);
            let difference = largest_difference(&image, &z);
            assert!(difference < 1e-10, "{:?}: {difference:e}", case.action);
            let moved = largest_difference(&image, &case.z);
            assert!(moved > 0.1, "{:?} hardly moves: {moved}", case.action);
        }
    }
}

#[test]
fn a_twist_commutes_with_the_action_and_keeps_the_actions() {
    for case in cases() {
        let angles: Vec<f64> = (1..=case.action.circles().len()).map(|k| 0.7 * k as f64).collect();
        let turn =
            case.action.turn_by(&angles.iter().map(|&a| Tracked::exact(a)).collect::<Vec<_>>());
        let lifted: Vec<Tracked> = case.z.iter().map(|&v| Tracked::exact(v)).collect();
        let (mut turned_first, mut turned_last) = (lifted.clone(), case.image(2.0, &lifted, false));
        turn.apply(&mut turned_first, false);
        let turned_first = case.image(2.0, &turned_first, false);
        turn.apply(&mut turned_last, false);
        for (a, b) in turned_first.iter().zip(&turned_last) {
            let bound = f64::unit_roundoff() * (a.bound + b.bound);
            assert!((a.value - b.value).abs() <= bound, "{a:?} {b:?}");
            assert!(bound < 1e-12, "{bound:e} says little");
        }
        for circle in case.action.circles() {
            let (before, after) =
                (circle.invariant(&case.z), circle.invariant(&case.image(2.0, &case.z, false)));
            assert!((before - after).abs() < 1e-14, "{before} {after}");
        }
    }
}

/// Half turns and more, forwards and back; and the identity to the bit at c = 0.
#[test]
fn a_twist_is_undone() {
    for case in cases() {
        for scale in [0.01, 1.0, 7.0, -40.0] {
            let image = case.image(scale, &case.z, false);
            let back = case.image(scale, &image, true);
            let difference = largest_difference(&back, &case.z);
            assert!(difference < 4e-15 * (1.0 + 4.0 * scale.abs()), "{scale}: {difference:e}");
            let lifted: Vec<_> = case.z.iter().map(|&v| DoubleDouble::from_f64(v)).collect();
            let precise = case.image(scale, &lifted, false);
            for (value, exact) in image.iter().zip(&precise) {
                let error = (*exact - DoubleDouble::from_f64(*value)).abs();
                assert!(error.value() < 4e-15 * (1.0 + 4.0 * scale.abs()), "{scale}: {error:?}");
            }
        }
        for inverse in [false, true] {
            let still = case.image(0.0, &case.z, inverse);
            assert!(still.iter().zip(&case.z).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
    }
}

#[test]
fn derivatives_of_a_twist_are_those_of_duals() {
    for case in cases() {
        for inverse in [false, true] {
            let (dim, count) = (case.z.len(), case.parameters.len());
            let twist = case.twist(1.3);
            let twist = if inverse { ElementaryMap::inverse(twist) } else { twist };
            let mut scratch = vec![0.0; 2 * dim + dim * dim];
            // Forward: along the unit vectors.
            let mut directions = vec![0.0; dim * dim];
            for i in 0..dim {
                directions[i * dim + i] = 1.0;
            }
            let mut along = case.z.clone();
            twist.jvp(&mut along, &mut directions, &mut scratch);
            let image = case.image(1.3, &case.z, inverse);
            assert!(largest_difference(&along, &image) == 0.0);
            // Backward: the pullback of a cotangent.
            let mut tape = vec![0.0; ElementaryMap::<f64>::tape_len(&twist)];
            let mut recorded = case.z.clone();
            twist.forward_recorded(&mut recorded, &mut tape, &mut scratch);
            assert!(largest_difference(&recorded, &image) == 0.0);
            let cotangent: Vec<f64> = (0..dim).map(|i| 1.0 + 0.3 * i as f64).collect();
            let (mut z_bar, mut parameters_bar) = (cotangent.clone(), vec![0.0; count]);
            twist.vjp(&tape, &mut z_bar, &mut parameters_bar, &mut scratch);
            for i in 0..dim {
                let lifted = |(k, &v): (usize, &f64)| D::variable(v, if k == i { 0 } else { 1 });
                let z: Vec<D> = case.z.iter().enumerate().map(lifted).collect();
                let image = case.image(1.3, &z, inverse);
                let mut pulled = 0.0;
                for k in 0..dim {
                    let found = directions[i * dim + k];
                    assert!((found - image[k].eps[0]).abs() < 1e-13, "∂{k}/∂{i}: {found}");
                    pulled += cotangent[k] * image[k].eps[0];
                }
                assert!((z_bar[i] - pulled).abs() < 1e-12, "{i}: {} {pulled}", z_bar[i]);
            }
            for index in 0..count {
                let lifted =
                    |(k, &v): (usize, &f64)| D::variable(v, if k == index { 0 } else { 1 });
                let parameters: Vec<D> = case.parameters.iter().enumerate().map(lifted).collect();
                let twist = case.with(D::constant(1.3), &parameters);
                let twist = if inverse { ElementaryMap::inverse(twist) } else { twist };
                let mut z: Vec<D> = case.z.iter().map(|&v| D::constant(v)).collect();
                twist.apply(&mut z, &mut vec![D::zero(); dim]);
                let pulled: f64 = z.iter().zip(&cotangent).map(|(z, c)| z.eps[0] * c).sum();
                let found = parameters_bar[index];
                assert!((found - pulled).abs() < 1e-12, "parameter {index}: {found} {pulled}");
            }
        }
    }
}

/// The action wanders as a sum of rounding errors does: some √N of them.
#[test]
fn actions_stay_over_a_million_steps() {
    let case = &cases()[1];
    let circle = &case.action.circles()[0];
    let mut z = case.z.clone();
    let (start, mut scratch) = (circle.invariant(&z), vec![0.0; z.len()]);
    let turn = case.action.turn_by(&[0.9]);
    let (twist, mut largest) = (case.twist(0.05), 0.0);
    for _ in 0..1_000_000 {
        twist.apply(&mut z, &mut scratch);
        turn.apply(&mut z, false);
        largest = max_or_nan(largest, (circle.invariant(&z) - start).abs());
    }
    assert!(largest > 0.0 && largest < 1e-12, "{largest:e}");
}

#[test]
fn twists_without_a_fast_plane_or_of_too_many_circles_are_refused() {
    let still = TorusAction::from(CircleAction::new([0, 0]));
    assert!(FastPlanes::new(&still).is_err());
    let twice = TorusAction::new(vec![CircleAction::new([1, 0]), CircleAction::new([2, 0])]);
    assert!(FastPlanes::new(&twice.expect("circles")).is_err());
    assert!(FastPlanes::new(&TorusAction::of_planes(5)).is_err());
    assert!(FastPlanes::new(&TorusAction::of_planes(4)).is_ok());
}

const KICK: usize = 4;

/// V(q cos φ + p sin φ) by its definition, φ, W, b and w being the parameters.
fn turned_potential(parameters: &[f64], z: &[D]) -> D {
    let n = z.len() / 2;
    let (angles, weights) = parameters.split_at(n);
    let mut total = D::zero();
    for k in 0..KICK {
        let mut argument = D::constant(weights[n * KICK + k]);
        for j in 0..n {
            let (s, c) = libm::sincos(angles[j]);
            let turned = D::constant(c) * z[j] + D::constant(s) * z[n + j];
            argument += D::constant(weights[j * KICK + k]) * turned;
        }
        total += D::constant(weights[(n + 1) * KICK + k]) * argument.tanh();
    }
    total
}

/// V stands still along the flow of −V, and with it its gradient: the flow is a
/// straight line.
#[test]
fn a_turned_kick_moves_along_the_gradient_in_turned_coordinates() {
    for n in 1..=3 {
        let mut stream = Stream::new(n as u64, "turned kick");
        let count = n + KICK * (n + 2);
        let parameters: Vec<f64> = (0..count).map(|_| stream.uniform(-2.0, 2.0)).collect();
        let z: Vec<f64> = (0..2 * n).map(|_| stream.uniform(-1.5, 1.5)).collect();
        let turn = gyroceptron::layer::Turn::by_angles(&parameters[..n]);
        let potential = NeuronPotential::<f64>::new(n, KICK, &parameters[n..]);
        let kick = TurnedKick::new(&turn, potential, 0.8);
        let (mut image, mut scratch) = (z.clone(), vec![0.0; 2 * n]);
        kick.apply(&mut image, &mut scratch);
        let slope = |index: usize| {
            let lifted = |(i, &v): (usize, &f64)| D::variable(v, if i == index { 0 } else { 1 });
            let z: Vec<D> = z.iter().enumerate().map(lifted).collect();
            turned_potential(&parameters, &z).eps[0]
        };
        for j in 0..n {
            // The Hamiltonian is −V.
            let expected = [z[j] - 0.8 * slope(n + j), z[n + j] + 0.8 * slope(j)];
            assert!((image[j] - expected[0]).abs() < 1e-14, "{n}: {image:?}");
            assert!((image[n + j] - expected[1]).abs() < 1e-14, "{n}: {image:?}");
            assert!((image[n + j] - z[n + j]).abs() > 1e-3);
        }
    }
}

/// What a normal form was made from.
fn shape_of(map: &Model) -> NormalFormShape {
    let of = map.architecture();
    NormalFormShape {
        action: of.action().expect("circles"),
        psi: of.widths(Part::Conjugation),
        kicks: of.widths(Part::Chart),
        twists: of.widths(Part::SlowMap),
        turned_twists: vec![],
        flow_time: of.flow_time,
        perturbation: of
            .part(Part::Perturbation)
            .next()
            .map(|block| block.layers.widths().to_vec()),
    }
}

fn normal_form<P: Real>(number: usize, epsilon: P, lift: impl Fn(usize, f64) -> P) -> Model<P> {
    let action = actions()[number].clone();
    let (psi, kicks) = (vec![3], vec![4, 2]);
    let shape = NormalFormShape {
        action,
        psi,
        kicks,
        twists: vec![3, 2, 0],
        turned_twists: vec![],
        flow_time: 5.0,
        perturbation: None,
    };
    let mut stream = Stream::new(number as u64, "normal form");
    let count = shape.architecture(0.0).parameter_count();
    let parameters = (0..count).map(|index| lift(index, stream.uniform(-0.7, 0.7))).collect();
    Model::at_epsilon(shape.architecture(0.0), epsilon, parameters).expect("valid")
}

/// A normal form, or one with a perturbation.
fn either<P: Real>(
    perturbed: bool,
    number: usize,
    epsilon: P,
    lift: impl Fn(usize, f64) -> P,
) -> Model<P> {
    match perturbed {
        true => nearly_integrable(number, epsilon, lift),
        false => normal_form(number, epsilon, lift),
    }
}

fn start(dim: usize) -> Vec<f64> {
    let mut stream = Stream::new(dim as u64, "start");
    (0..dim).map(|_| stream.uniform(-1.2, 1.2)).collect()
}

#[test]
fn the_pullback_of_a_normal_form_is_that_of_duals_for_every_parameter() {
    let all = (0..actions().len()).flat_map(|number| [(number, false), (number, true)]);
    for (number, perturbed) in all {
        let map = either(perturbed, number, 0.1, |_, v| v);
        let (dim, count) = (2 * map.architecture().dof, map.composition().parameters().len());
        let z = start(dim);
        let mut recording = map.composition().recording();
        map.composition().forward_recorded(&mut z.clone(), &mut recording);
        let cotangent: Vec<f64> = (0..dim).map(|i| 1.0 - 0.2 * i as f64).collect();
        let (mut z_bar, mut parameters_bar) = (cotangent.clone(), vec![0.0; count]);
        map.composition().vjp(&mut recording, &mut z_bar, &mut parameters_bar);
        for index in 0..count {
            let lift = |k: usize, v: f64| D::variable(v, if k == index { 0 } else { 1 });
            let map = either(perturbed, number, D::constant(0.1), lift);
            let mut z: Vec<D> = z.iter().map(|&v| D::constant(v)).collect();
            map.composition().forward(&mut z);
            let pulled: f64 = z.iter().zip(&cotangent).map(|(z, c)| z.eps[0] * c).sum();
            let found = parameters_bar[index];
            assert!((found - pulled).abs() < 1e-11, "{number}, {index}: {found} {pulled}");
        }
        let map = either(perturbed, number, 0.1, |_, v| v);
        for index in 0..dim {
            let lifted = |(k, &v): (usize, &f64)| D::variable(v, if k == index { 0 } else { 1 });
            let mut z: Vec<D> = z.iter().enumerate().map(lifted).collect();
            map.composition().forward(&mut z);
            let pulled: f64 = z.iter().zip(&cotangent).map(|(z, c)| z.eps[0] * c).sum();
            assert!((z_bar[index] - pulled).abs() < 1e-11, "{number}, z{index}: {pulled}");
        }
    }
}

/// Also where ε is large: by construction and not by smallness.
#[test]
fn a_normal_form_keeps_its_actions_and_its_inverse() {
    for number in 0..actions().len() {
        for epsilon in [0.0, 0.01, 1.0] {
            let map = normal_form(number, epsilon, |_, v| v);
            let [chart, inner] = map.chart_and_inner_map();
            let z = start(2 * map.architecture().dof);
            let actions_of = |z: &[f64]| -> Vec<f64> {
                let mut w = z.to_vec();
                chart.inverse(&mut w);
                map.architecture().circles.iter().map(|circle| circle.invariant(&w)).collect()
            };
            let (mut moved, mut within) = (z.clone(), z.clone());
            chart.inverse(&mut within);
            for _ in 0..100 {
                map.composition().forward(&mut moved);
                inner.forward(&mut within);
            }
            chart.forward(&mut within);
            let scale = z.iter().map(|v| v.abs()).fold(1.0, max_or_nan);
            assert!(largest_difference(&moved, &within) < 1e-9 * scale, "{number} {epsilon}");
            assert!(largest_difference(&moved, &z) > 1e-2, "{number} {epsilon} stands still");
            let change = largest_difference(&actions_of(&moved), &actions_of(&z));
            assert!(change < 1e-12 * scale, "{number} {epsilon}: {change:e}");
            for _ in 0..100 {
                map.composition().inverse(&mut moved);
            }
            assert!(largest_difference(&moved, &z) < 1e-9, "{number} {epsilon}");
        }
    }
}

/// Pᵐ is a normal form too, of m times the shears and the flow time.
#[test]
fn a_normal_form_is_iterated() {
    for number in 0..actions().len() {
        for epsilon in [0.0, 0.05, 1.0] {
            let map = normal_form(number, epsilon, |_, v| v);
            let shape = NormalFormShape { twists: vec![3, 2, 0, 4], ..shape_of(&map) };
            let mut stream = Stream::new(7, "iterated");
            let parameters = (0..shape.architecture(0.0).parameter_count())
                .map(|_| stream.uniform(-0.7, 0.7))
                .collect();
            let map =
                Model::at_epsilon(shape.architecture(0.0), epsilon, parameters).expect("valid");
            for m in [1, 2, 3, 8] {
                let iterated = map.iterated(m).expect("an even number of shears");
                assert_eq!(iterated.architecture().widths(Part::SlowMap), [3, 2, 0, 4].repeat(m));
                assert_eq!(iterated.architecture().flow_time, 5.0 * m as f64);
                let mut once = start(2 * map.architecture().dof);
                let mut stepwise = once.clone();
                iterated.forward(&mut once);
                (0..m).for_each(|_| map.forward(&mut stepwise));
                let scale = stepwise.iter().map(|v| v.abs()).fold(1.0, max_or_nan);
                let difference = largest_difference(&once, &stepwise);
                assert!(difference < 1e-12 * scale, "{number} {epsilon} {m}: {difference:e}");
            }
            assert!(map.iterated(0).is_err());
        }
    }
    // Shears of positions would follow one another, and of the wrong number of parameters.
    let odd = normal_form(0, 0.1, |_, v| v);
    assert!(odd.iterated(1).is_ok());
    let error = odd.iterated(2).expect_err("three shears").to_string();
    assert!(error.contains("expected an even number") && error.contains('3'), "{error}");
}

/// With other parameters each step keeps its own angles, also where some are left out.
#[test]
fn parts_of_a_normal_form_take_other_parameters() {
    let map = normal_form(1, 0.1, |_, v| v);
    let other = normal_form(1, 0.1, |_, v| 0.5 * v);
    let parameters = other.composition().parameters().to_vec();
    let expected = other.composition().near_identity_part();
    let part = map.composition().near_identity_part();
    let moved = part.with_parameters(parameters, 0.1).expect("as many");
    let (mut a, mut b) = (start(4), start(4));
    expected.forward(&mut a);
    moved.forward(&mut b);
    assert_eq!(a, b);
    assert!(largest_difference(&a, &start(4)) > 1e-3);
}

#[test]
fn a_normal_form_of_the_wrong_size_is_refused() {
    let map = normal_form(1, 0.1, |_, v| v);
    let parameters = map.composition().parameters();
    let fewer = parameters[1..].to_vec();
    assert!(Model::new(map.architecture().clone(), fewer).is_err());
    let shape = NormalFormShape { flow_time: f64::NAN, ..shape_of(&map) };
    assert!(Model::at_epsilon(shape.architecture(0.1), 0.1, parameters.to_vec()).is_err());
    let still = TorusAction::from(CircleAction::new([0, 0]));
    assert!(NormalFormShape { action: still, ..shape_of(&map) }.architecture(0.1).check().is_err());
}

/// Of a shear without neurons the quadratic form is all there is to it.
#[test]
fn shears_without_neurons_are_of_momenta_only_and_begin_somewhere() {
    let shape = |twists: &[usize]| NormalFormShape {
        action: CircleAction::new([1, 0]).into(),
        psi: vec![],
        kicks: vec![],
        twists: twists.to_vec(),
        turned_twists: vec![],
        flow_time: 1.0,
        perturbation: None,
    };
    assert!(shape(&[0, 3]).architecture(0.1).check().is_ok());
    assert!(shape(&[3, 0]).architecture(0.1).check().is_err());
    for weights in [InitialWeights::Glorot, InitialWeights::Normal { scale: 0.2 }] {
        let architecture = shape(&[0, 3]).architecture(0.1);
        let model = architecture.initialise(weights, 1.0, 3).expect("a model");
        let form = &model.composition().parameters()[..3];
        assert!(
            form.iter().all(|entry| entry.abs() > 1e-4 && entry.abs() < 3.0),
            "{weights:?} {form:?}"
        );
    }
}

/// χ∘K_ε∘Φ_θ∘T∘χ⁻¹, χ and T of order one.
fn nearly_integrable<P: Real>(
    number: usize,
    epsilon: P,
    lift: impl Fn(usize, f64) -> P,
) -> Model<P> {
    let shape = NormalFormShape {
        action: actions()[number].clone(),
        psi: vec![3],
        kicks: vec![4, 2],
        twists: vec![3, 2],
        turned_twists: vec![],
        flow_time: 0.7,
        perturbation: Some(vec![3, 5]),
    };
    let mut stream = Stream::new(number as u64, "nearly integrable");
    let count = shape.architecture(0.0).parameter_count();
    let parameters = (0..count).map(|index| lift(index, stream.uniform(-0.7, 0.7))).collect();
    Model::at_epsilon(shape.architecture(0.0), epsilon, parameters).expect("valid")
}

/// At ε = 0 the actions stay, whatever the weights; beside it they move by O(ε), and the map
/// without its perturbation is that at ε = 0.
#[test]
fn a_perturbation_moves_the_actions_by_epsilon() {
    for number in 0..actions().len() {
        let map = nearly_integrable(number, 0.0, |_, v| v);
        let z = start(2 * map.architecture().dof);
        let moved_by = |epsilon: f64| {
            let map = map.with_epsilon(epsilon);
            let [chart, inner] = map.chart_and_inner_map();
            assert_eq!([chart.epsilon(), inner.epsilon()], [epsilon; 2]);
            let mut w = z.clone();
            chart.inverse(&mut w);
            let actions = |w: &[f64]| -> Vec<f64> {
                map.architecture().circles.iter().map(|circle| circle.invariant(w)).collect()
            };
            let before = actions(&w);
            inner.forward(&mut w);
            let change = largest_difference(&actions(&w), &before);
            chart.forward(&mut w);
            let mut whole = z.clone();
            map.composition().forward(&mut whole);
            assert_eq!(w, whole);
            (change, w)
        };
        let (still, unperturbed) = moved_by(0.0);
        assert!(still < 1e-14, "{number}: {still:e}");
        let epsilons = [4e-4, 2e-4, 1e-4];
        let slope = log_slope(&epsilons, &epsilons.map(|epsilon| moved_by(epsilon).0));
        assert!((slope - 1.0).abs() < 0.01, "{number}: {slope}");
        let [chart, _] = map.chart_and_inner_map();
        let mut charted = z.clone();
        chart.forward(&mut charted);
        assert!(largest_difference(&charted, &z) > 0.02, "{number}: χ is of order one");

        let shape = NormalFormShape { perturbation: Some(Vec::new()), ..shape_of(&map) };
        assert!(shape.architecture(0.3).keeps_actions() && !map.architecture().keeps_actions());
        let mut parameters = map.composition().parameters().to_vec();
        let theta = |of: &Architecture| of.angles().start;
        parameters.drain(theta(&shape.architecture(0.3))..theta(map.architecture()));
        let plain = Model::at_epsilon(shape.architecture(0.3), 0.3, parameters).expect("valid");
        let mut by_plain = z.clone();
        plain.composition().forward(&mut by_plain);
        assert_eq!(by_plain, unperturbed);
        // The kicks of the perturbation alone are near the identity.
        let near = map.with_epsilon(0.1).composition().near_identity_part();
        assert_eq!(near.steps().len(), 2);
        let said = map.iterated(2).expect_err("other powers").to_string();
        assert!(said.contains("perturbation"), "{said}");
        assert!(plain.iterated(2).is_ok());
    }
}

#[test]
fn nearly_integrable_maps_hold_their_laws() {
    for number in 0..actions().len() {
        let map = nearly_integrable(number, 0.05, |_, v| v);
        let options = CertificateOptions { samples: 60, ..Default::default() };
        let certificate = certify(&map, options);
        certificate.assert_holds();
        let at_zero: Vec<_> =
            certificate.rows.iter().filter(|row| row.law.ends_with("ε = 0")).collect();
        assert_eq!(at_zero.len(), 4);
        // That it is what it is made of, at its own ε too.
        assert!(certificate.rows.iter().any(|row| row.equation.contains("K_ε")));
        // The mutant: taken for integrable at ε ≠ 0.
        assert!(!certify_normal_form(&map, options).holds(), "{number}");
    }
}

/// Of the architecture, in files and at other times.
#[test]
fn a_nearly_integrable_model_is_kept_whole() {
    let map = nearly_integrable(0, 0.05, |_, v| v);
    let model = map.clone();
    let text = serde_json::to_string(model.architecture()).expect("plain");
    assert!(text.contains("\"widths\":[3,5]"), "{text}");
    let back: Architecture = serde_json::from_str(&text).expect("the same");
    assert_eq!(&back, model.architecture());
    let names: Vec<String> = back
        .tensors()
        .into_iter()
        .map(|(name, _)| name)
        .filter(|n| n.starts_with("pert"))
        .collect();
    assert_eq!(names[0], "perturbation.0.angles");
    assert_eq!(names.len(), 8);
    let count: usize = back.tensors().iter().map(|(_, [r, c])| r * c).sum();
    assert_eq!(count, back.parameter_count());
    let random = back.initialise(InitialWeights::Glorot, 0.3, 1).expect("valid");
    assert_eq!(random.composition().parameters().len(), count);
    assert_eq!(random.angle(), Some(0.3));
    // ε of other signs and sizes; the angle and the twist grow with the time, the kicks do not.
    let other = model.with_epsilon_and_time(-0.1, 2.0).expect("a member");
    let by_hand = {
        let shape = NormalFormShape { flow_time: 1.4, ..shape_of(&map) };
        let mut parameters = map.composition().parameters().to_vec();
        let theta = map.architecture().angles().start;
        parameters[theta..].iter_mut().for_each(|angle| *angle *= 2.0);
        Model::at_epsilon(shape.architecture(-0.1), -0.1, parameters).expect("valid")
    };
    let (mut a, mut b) = (start(2 * map.architecture().dof), start(2 * map.architecture().dof));
    other.forward(&mut a);
    by_hand.composition().forward(&mut b);
    assert_eq!(a, b);
    // Roll-outs go to the coordinates of the normal form once.
    let states = model.rollout(&start(a.len()), Rollout { steps: 5, every: 1 }).expect("finite");
    let mut by_steps = start(a.len());
    for step in 1..=5 {
        model.forward(&mut by_steps);
        let found = &states[step * a.len()..(step + 1) * a.len()];
        assert!(largest_difference(found, &by_steps) < 1e-12);
    }
}
