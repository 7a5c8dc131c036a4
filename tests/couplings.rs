//! Gyroceptrons of affine couplings: nearly periodic, invertible, and not symplectic.

use gyroceptron::layer::{AffineCoupling, CircleAction, ElementaryMap, coupling_parameter_count};
use gyroceptron::measure::{
    OneStep,
    certificate::{CertificateOptions, Verdict, certify, certify_map, certify_nearly_periodic},
    fuzz, jacobian,
    ratios::RoundingPropagation,
    steps::{MeasuredSteps, TrackedStep},
};
use gyroceptron::network::{Architecture, CouplingGyroceptronShape, InitialWeights, Model};
use gyroceptron::phase::{Direction, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Dual, max_or_nan};

fn architecture(action: &[i32], epsilon: f64) -> Architecture {
    CouplingGyroceptronShape {
        circle_action: CircleAction::new(action),
        psi: vec![5, 3],
        near_identity: vec![4, 6, 1],
        flow_time: 2.0,
    }
    .architecture(epsilon)
}

fn network(action: &[i32], epsilon: f64, weights: InitialWeights, seed: u64) -> Model {
    architecture(action, epsilon).initialise(weights, 2.4, seed).expect("valid")
}

const OPTIONS: CertificateOptions = CertificateOptions { samples: 25, radius: 1.6, seed: 4 };

/// All laws of a nearly-periodic map but those of the canonical form, which is measured, and refused
/// where it is claimed.
#[test]
fn they_are_invertible_and_nearly_periodic_and_symplecticity_is_refused() {
    for (index, action) in [&[1][..], &[1, 0], &[2, -1], &[1, 0, 3]].into_iter().enumerate() {
        for scale in [0.1, 0.5, 1.0] {
            let weights = InitialWeights::Normal { scale };
            let model = network(action, 0.05, weights, index as u64);
            let certificate = certify(&model, OPTIONS);
            assert!(certificate.holds(), "{action:?} {scale}: {certificate}");
            let row = &certificate.rows[0];
            assert!(row.law.contains("symplecticity"), "{row:?}");
            assert_eq!(row.verdict, Verdict::Reported);
            assert!(row.median.expect("finite") > 1e6, "{row:?}");
            assert!(certificate.rows.len() >= 18, "{certificate}");
            let claimed = certify_map(&model, OPTIONS);
            let refused: Vec<_> =
                claimed.rows.iter().filter(|row| row.verdict == Verdict::Violated).collect();
            assert_eq!(refused.len(), 1, "{claimed}");
            assert!(refused[0].law.contains("symplecticity"), "{claimed}");
        }
    }
}

#[test]
fn one_certificate_is_the_other() {
    let model = network(&[1, 0], 0.05, InitialWeights::Glorot, 3);
    let text = |c: gyroceptron::measure::certificate::Certificate| format!("{c}");
    let own = certify_nearly_periodic(&model, OPTIONS);
    assert_eq!(text(certify(&model, OPTIONS)), text(own));
}

fn weights(count: usize, size: f64, name: &str) -> Vec<f64> {
    let mut stream = Stream::new(7, name);
    (0..count).map(|_| stream.uniform(-size, size)).collect()
}

/// The definition, read off its parameters one by one.
#[test]
fn a_coupling_is_its_definition() {
    for (n, h) in [(1, 3), (2, 6), (3, 1), (5, 9)] {
        let parameters = weights(coupling_parameter_count(n, h), 1.5, "coupling");
        let z = weights(2 * n, 2.0, "point");
        let at = |start: usize, i: usize, j: usize| parameters[start + i * h + j];
        let (bias, to_scale, to_shift) = (n * h, (n + 1) * h, (2 * n + 1) * h + n);
        let hidden: Vec<f64> = (0..h)
            .map(|j| {
                let sum: f64 = (0..n).map(|i| at(0, i, j) * z[i]).sum();
                (sum + parameters[bias + j]).tanh()
            })
            .collect();
        let output = |start: usize, i: usize| {
            let sum: f64 = (0..h).map(|j| at(start, i, j) * hidden[j]).sum();
            sum + parameters[start + n * h + i]
        };
        let c = 0.7;
        let mut expected = z.clone();
        let mut volume = 1.0;
        for i in 0..n {
            let tau = (c * output(to_scale, i)).tanh();
            let factor = (2.0 + tau) / (2.0 - tau);
            assert!((1.0 / 3.0..3.0).contains(&factor));
            volume *= factor;
            expected[n + i] = factor * z[n + i] + c * output(to_shift, i);
        }
        let coupling: AffineCoupling<'_, f64> = AffineCoupling::new(n, h, c, &parameters);
        let (mut image, mut scratch) = (z.clone(), vec![0.0; 2 * n]);
        coupling.apply(&mut image, &mut scratch);
        let error = |a: &[f64], b: &[f64]| {
            a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan)
        };
        assert!(error(&image, &expected) < 1e-14, "{image:?} {expected:?}");
        coupling.apply_inverse(&mut image, &mut scratch);
        assert!(error(&image, &z) < 1e-14, "{image:?} {z:?}");

        struct One<'a>(AffineCoupling<'a, f64>);
        impl<S: gyroceptron::scalar::Over<f64>> Map<S> for One<'_> {
            fn dof(&self) -> usize {
                self.0.dof()
            }
            fn forward(&self, z: &mut [S]) {
                self.0.apply(z, &mut vec![S::zero(); z.len()]);
            }
            fn inverse(&self, z: &mut [S]) {
                self.0.apply_inverse(z, &mut vec![S::zero(); z.len()]);
            }
        }
        let jacobian = jacobian(&One(coupling), &z);
        assert!((jacobian.determinant() - volume).abs() < 1e-13 * volume);
        assert!((volume - 1.0).abs() > 1e-3);
    }
}

/// The first order of I_ε − Id: each coupling's x(q) ⊙ p + y(q) in its own turned coordinates.
#[test]
fn the_generator_of_the_near_identity_part_is_the_sum_of_its_couplings() {
    let model = network(&[1, 0], 0.0, InitialWeights::Normal { scale: 0.8 }, 5);
    let network = &model;
    let (n, widths) = (2, [4, 6, 1]);
    let all = network.near_identity();
    let steps = all.steps();
    assert_eq!(steps.len(), widths.len());
    let z = [0.4, -0.9, 1.1, 0.3];
    let mut expected = [0.0; 4];
    for (step, h) in steps.iter().zip(widths) {
        let own = &all.parameters()[step.parameters.clone()];
        assert_eq!(own.len(), n + coupling_parameter_count(n, h));
        let (angles, own) = own.split_at(n);
        let turned = |i: usize| {
            let (s, c) = angles[i].sin_cos();
            [c * z[i] + s * z[n + i], c * z[n + i] - s * z[i]]
        };
        let hidden: Vec<f64> = (0..h)
            .map(|j| {
                let sum: f64 = (0..n).map(|i| own[i * h + j] * turned(i)[0]).sum();
                (sum + own[n * h + j]).tanh()
            })
            .collect();
        for i in 0..n {
            let output = |start: usize| {
                let sum: f64 = (0..h).map(|j| own[start + i * h + j] * hidden[j]).sum();
                sum + own[start + n * h + i]
            };
            let (x, y) = (output((n + 1) * h), output((2 * n + 1) * h + n));
            // In the flow time too.
            let change = 2.0 * (x * turned(i)[1] + y);
            let (s, c) = angles[i].sin_cos();
            expected[i] -= s * change;
            expected[n + i] += c * change;
        }
    }
    let moved = |epsilon: f64| {
        let mut out = z;
        all.with_epsilon(epsilon).forward(&mut out);
        out
    };
    for (i, expected) in expected.into_iter().enumerate() {
        let slope = |e: f64| (moved(e)[i] - moved(-e)[i]) / (2.0 * e);
        // The error of the first is a quarter of that of half of it: the extrapolation is of fourth order.
        let found = (4.0 * slope(5e-4) - slope(1e-3)) / 3.0;
        assert!((found - expected).abs() < 1e-10, "{i}: {found} {expected}");
        assert!(expected.abs() > 0.05);
    }
}

/// The rounding scales of a way there and back are those of the map's own inverse, not of a symplectic one: an error
/// behind a contraction by ten comes back ten times as large.
#[test]
fn bounds_of_the_way_back_are_those_of_a_contraction() {
    struct Shrink;
    impl<S: gyroceptron::scalar::Scalar> Map<S> for Shrink {
        fn dof(&self) -> usize {
            1
        }
        fn forward(&self, z: &mut [S]) {
            z[1] *= S::from_f64(0.1);
        }
        fn inverse(&self, z: &mut [S]) {
            z[1] /= S::from_f64(0.1);
        }
    }
    let there = TrackedStep { map: Shrink, direction: Direction::Forward };
    let steps: MeasuredSteps<'_> = vec![Box::new(there)];
    let propagation = RoundingPropagation::new(&steps, &[2.0, 3.0]);
    let (scales, sums) = propagation.return_scales(1);
    let mut delta = [0.0; 2];
    steps[0].value_magnitude(&[2.0, 3.0], propagation.end(), &mut delta);
    assert!(delta[1] > 0.25, "{delta:?}");
    let expected = 10.0 * delta[1];
    assert!((scales[1] / (2_f64.sqrt() * expected) - 1.0).abs() < 1e-12, "{scales:?}");
    assert!((sums[1] / (2.0 * expected) - 1.0).abs() < 1e-12, "{sums:?}");
    let certificate = certify_map(&OneStep(Shrink), OPTIONS);
    let of = |law: &str| certificate.rows.iter().find(|row| row.law.contains(law)).expect("a row");
    assert_eq!(of("symplecticity").verdict, Verdict::Violated);
    assert_eq!(of("inversion").verdict, Verdict::Holds, "{certificate}");
}

/// A map that flattens points has no inverse, whatever is given for one: that is no matter of rounding.
#[test]
fn what_has_no_inverse_is_violated_and_not_ill_conditioned() {
    struct Flatten;
    impl<S: gyroceptron::scalar::Scalar> Map<S> for Flatten {
        fn dof(&self) -> usize {
            1
        }
        fn forward(&self, z: &mut [S]) {
            z[1] = z[0] * S::from_f64(0.1);
        }
        fn inverse(&self, _: &mut [S]) {}
    }
    let certificate = certify_map(&OneStep(Flatten), OPTIONS);
    let there = |row: &&gyroceptron::measure::certificate::Row| row.equation == "P⁻¹∘P = Id";
    let row = certificate.rows.iter().find(there).expect("a row");
    assert_eq!(row.verdict, Verdict::Violated, "{certificate}");
    assert!(fuzz::inverted(&OneStep(Flatten), &[0.3, 0.7], true).is_err());
}

/// The derivatives by each parameter and coordinate, against duals one by one: to a few units of rounding, where the
/// bounds of the suite are those of the worst case.
#[test]
fn the_pullback_is_the_derivative_to_rounding() {
    type D = Dual<f64, 1>;
    let model = network(&[1, 0], 0.2, InitialWeights::Normal { scale: 0.4 }, 9);
    let map = model.composition();
    let (z, c) = ([0.4, -0.9, 1.1, 0.3], [0.7, -0.2, 0.5, 1.3]);
    let mut recording = map.recording();
    let (mut moved, mut z_bar) = (z, c);
    let mut bars = vec![0.0; map.parameters().len()];
    map.forward_recorded(&mut moved, &mut recording);
    map.vjp(&mut recording, &mut z_bar, &mut bars);
    let along = |which: usize| {
        let lift = |(k, v): (usize, &f64)| D::variable(*v, usize::from(k != which));
        let parameters = map.parameters().iter().enumerate().map(lift).collect();
        let first = map.parameters().len();
        let lifted = z.iter().enumerate().map(|(i, v)| (first + i, v)).map(lift);
        let mut image: Vec<D> = lifted.collect();
        let over = map.with_parameters::<D>(parameters, D::constant(0.2)).expect("as many");
        over.forward(&mut image);
        image.iter().zip(c).map(|(w, c)| c * w.eps[0]).sum::<f64>()
    };
    for (which, found) in bars.iter().chain(&z_bar).enumerate() {
        let expected = along(which);
        let error = (found - expected).abs();
        assert!(error < 1e-13 * (1.0 + expected.abs()), "{which}: {found} {expected}");
    }
    assert!(bars.iter().filter(|bar| bar.abs() > 1e-3).count() > bars.len() / 2);
}

/// Each factor is bounded whatever its weights: there is no point that is moved to infinity or onto
/// another one.
#[test]
fn large_weights_are_undone_too() {
    let (n, h) = (2, 5);
    for size in [1e3, 1e100, 1e300] {
        let mut parameters = weights(coupling_parameter_count(n, h), size, "large");
        // Shifts of order one: what is lost beside a large number does not come back.
        let shift = (2 * n + 1) * h + n;
        for weight in &mut parameters[shift..] {
            *weight /= size;
        }
        let coupling: AffineCoupling<'_, f64> = AffineCoupling::new(n, h, 1.0, &parameters);
        let z: [f64; 4] = [0.3, -0.2, 1.5, -0.7];
        let (mut image, mut scratch) = (z, [0.0; 4]);
        coupling.apply(&mut image, &mut scratch);
        assert!(image[2].abs() < 3.0 * 1.5 + 10.0, "{image:?}");
        assert!((image[2] - z[2]).abs() > 0.1);
        coupling.apply_inverse(&mut image, &mut scratch);
        for (a, b) in image.iter().zip(z) {
            assert!((a - b).abs() < 1e-13, "{size}: {image:?}");
        }
    }
}

#[test]
fn shapes_without_neurons_are_refused() {
    let bad = |shape: CouplingGyroceptronShape| {
        let found = shape.architecture(0.1).check();
        found.expect_err("accepted").to_string()
    };
    let shape = |action: &[i32], psi: &[usize]| CouplingGyroceptronShape {
        circle_action: CircleAction::new(action),
        psi: psi.to_vec(),
        near_identity: vec![3],
        flow_time: 2.0,
    };
    assert!(bad(shape(&[1, 0], &[3, 0])).contains("width 0"));
    assert!(bad(shape(&[0, 0], &[3])).contains("all weights 0"));
    assert!(bad(shape(&[], &[3])).contains("degrees of freedom"));
    assert!(bad(shape(&[1, 0], &[usize::MAX])).contains("parameters"));
    let model = network(&[1, 0], 0.1, InitialWeights::Glorot, 1);
    let count = model.composition().parameters().len();
    assert!(model.with_parameters(vec![0.1; count - 1]).is_err());
    assert!(model.invariant().is_none() && model.invariants().is_empty());
    assert!(!model.architecture().is_symplectic());
    assert_eq!(model.angle(), Some(2.4));
}
