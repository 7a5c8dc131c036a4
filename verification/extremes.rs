//! Stiff and extreme cases, each with its oracle.

use crate::samples::weights;
use crate::tolerances;
use astro_float::{BigFloat, Consts, RoundingMode};
use faer::MatRef;
use gyroceptron::layer::{CircleAction, HenonLayer, NeuronPotential, Potential};
use gyroceptron::measure::{
    Measurable,
    adiabatic::{disturbing_resonance, nearest_resonance, settling_iterations},
    certificate::{Tally, Verdict},
    laws,
    ratios::{
        Conditioned, ILL_CONDITIONED, RoundingPropagation, differing_components, inversion_ratio,
        symplecticity_defect, symplecticity_ratio,
    },
};
use gyroceptron::network::{
    Architecture, Block, GyroceptronShape, HenonShape, InitialWeights, Layers, Model, Part,
};
use gyroceptron::phase::{Direction, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{DoubleDouble, Dual, Real, Scalar, max_or_nan, tanh_sech2};
use gyroceptron::system::FieldProfile;
use std::f64::consts::{PI, TAU};

const BITS: usize = 256;
const TO_NEAREST: RoundingMode = RoundingMode::ToEven;

fn to_f64(value: &BigFloat) -> f64 {
    value.to_string().parse().expect("a decimal number")
}

fn exact_sech2(x: f64) -> f64 {
    let mut constants = Consts::new().expect("memory for constants");
    let cosh = BigFloat::from_f64(x, BITS).cosh(BITS, TO_NEAREST, &mut constants);
    let one = BigFloat::from_f64(1.0, BITS);
    to_f64(&one.div(&cosh.mul(&cosh, BITS, TO_NEAREST), BITS, TO_NEAREST))
}

/// 1 − tanh² has a relative error of 2.7e-10 at 8, 6e-4 at 16, 1 from 19.1 on.
#[test]
fn saturated_neurons_keep_their_slope() {
    for x in [8.0, 16.0, 19.1, 50.0, 100.0] {
        let exact = exact_sech2(x);
        let (t, s) = tanh_sech2(x);
        assert!((s / exact - 1.0).abs() <= tolerances::SECH2, "sech²({x}) = {s:e}");
        let naive = ((1.0 - t * t) / exact - 1.0).abs();
        assert!(naive > tolerances::NAIVE_SECH2, "the oracle sees nothing at {x}");
    }
}

/// W = w = 1e8 at a = 19: the gradient is 1.256 and not 0.
#[test]
fn huge_weights_times_a_tiny_slope() {
    let parameters = [1e8, 19.0, 1e8];
    let potential = NeuronPotential::<f64>::new(1, 1, &parameters);
    let mut gradient = [0.0];
    potential.gradient(&[0.0], &mut gradient);
    let exact = 1e16 * exact_sech2(19.0);
    assert!((exact - 1.256).abs() < tolerances::THREE_DECIMALS);
    let error = (gradient[0] / exact - 1.0).abs();
    assert!(error < tolerances::PRODUCT_WITH_SECH2, "{error:e}");
}

fn layer_weights() -> Vec<f64> {
    InitialWeights::Normal { scale: 0.6 }.layer(2, 5, &mut Stream::new(3, "extremes"))
}

/// ε = 0, −0, 1e-300, 5e-324: nothing moves by a bit.
#[test]
fn tiny_epsilon_is_the_identity_bit_for_bit() {
    let weights = layer_weights();
    let z = [0.3, -0.8, 1.1, -0.0];
    for epsilon in [0.0, -0.0] {
        assert_eq!(differing_components(&HenonLayer::new(2, 5, epsilon, &weights), &z), 0);
    }
    let w = [0.3, -0.8, 1.1, 1e-200];
    for epsilon in [1e-300, 5e-324, -1e-300] {
        let layer = HenonLayer::new(2, 5, epsilon, &weights);
        assert_eq!(differing_components(&layer, &w), 0, "{epsilon:e}");
        // Where z is smaller than ε, ε moves it.
        assert!(differing_components(&layer, &[0.0; 4]) > 0 || epsilon == 5e-324);
    }
    // The literal fourfold map moves by a rounding of η.
    let map = HenonLayer::new(2, 5, 0.0, &weights).map();
    let mut moved = z;
    for _ in 0..4 {
        map.forward(&mut moved);
    }
    assert!(moved.iter().zip(&z).any(|(a, b)| a.to_bits() != b.to_bits()));
}

/// I_{−ε} is not I_ε⁻¹: they differ by O(ε²), and the inverse is exact.
#[test]
fn negative_epsilon_is_not_the_inverse() {
    let weights = layer_weights();
    let z = [0.3, -0.8, 1.1, 0.4];
    let (there, back) =
        (HenonLayer::new(2, 5, 0.05, &weights), HenonLayer::new(2, 5, -0.05, &weights));
    let mut w = z;
    there.forward(&mut w);
    let moved = w;
    back.forward(&mut w);
    let undone = (0..4).map(|i| (w[i] - z[i]).abs()).fold(0.0, max_or_nan);
    let step = (0..4).map(|i| (moved[i] - z[i]).abs()).fold(0.0, max_or_nan);
    assert!(undone > tolerances::NO_ROUNDING && undone < step, "{undone} of {step}");
    let [ahead, back] = [Direction::Forward, Direction::Inverse].map(|d| there.measured_steps(d));
    let ratio = inversion_ratio(ahead, back, &z);
    assert!(matches!(ratio, Conditioned::Ratio(r) if r < tolerances::RATIO), "{ratio:?}");
}

/// The image of a point errs from that in double-double by no more than its rounding scales allow.
pub fn assert_digits(model: &Model, z: &[f64], case: &str) {
    let mut exact: Vec<_> = z.iter().map(|v| DoubleDouble::from_f64(*v)).collect();
    model.lift::<DoubleDouble>().forward(&mut exact);
    let mut image = z.to_vec();
    model.forward(&mut image);
    let steps = model.measured_steps(Direction::Forward);
    let (scales, _) = RoundingPropagation::new(&steps, z).value_scales();
    for i in 0..z.len() {
        let error = (image[i] - exact[i].value()).abs();
        let ratio = error / (f64::unit_roundoff() * scales[i]);
        assert!(ratio < tolerances::RATIO, "{case}, {i}: {ratio}");
    }
}

/// Angles of many turns, neurons that saturate, actions of 10¹². Oracle: the same network in double-double, whose
/// sines are its own.
#[test]
fn turned_twists_keep_their_digits() {
    let architecture = Architecture::new(2)
        .on_circle(CircleAction::new([1, 0]))
        .at_epsilon(0.3)
        .with(Block::new(Part::SlowMap, Layers::TurnedTwist(vec![5, 4])));
    let weights = InitialWeights::Normal { scale: 0.6 };
    let sound = architecture.initialise(weights, 0.4, 3).expect("sound");
    for (angle, weight, radius, is_swallowed) in [
        (1.0, 1.0, 1.0, false),
        (1e6, 1.0, 1.0, false),
        (1.0, 30.0, 1.0, false),
        (1.0, 1.0, 1e6, false),
        (1.0, 1.0, 1e-200, true),
    ] {
        let mut parameters = sound.parameters().to_vec();
        for (_, _, range) in architecture.layers() {
            parameters[range.start] *= angle;
            parameters[range.start + 1..range.end].iter_mut().for_each(|w| *w *= weight);
        }
        let model = Model::new(architecture.clone(), parameters).expect("finite");
        let z = [0.3, -0.8, 1.1, 0.4].map(|v| v * radius);
        assert_digits(&model, &z, &format!("{angle:e} {weight:e} {radius:e}"));
        let [ahead, back] =
            [Direction::Forward, Direction::Inverse].map(|d| model.measured_steps(d));
        let ratio = inversion_ratio(ahead, back, &z);
        // A point that increments of order one swallow has no digit that could come back.
        let as_it_is = match ratio {
            Conditioned::Ratio(r) => !is_swallowed && r < tolerances::RATIO,
            Conditioned::IllConditioned => is_swallowed,
        };
        assert!(as_it_is, "{angle:e} {weight:e} {radius:e}: {ratio:?}");
    }
    // What overflows is not multiplied by 0.
    let mut parameters = sound.parameters().to_vec();
    for (_, _, range) in architecture.layers() {
        parameters[range.start + 1..range.end].iter_mut().for_each(|w| *w *= 1e300);
    }
    let model = Model::new(architecture, parameters).expect("finite");
    let still = model.composition().near_identity_part().with_epsilon(0.0);
    assert_eq!(differing_components(&still, &[0.3, -0.8, 1.1, -0.0]), 0);
}

fn small_shape() -> GyroceptronShape {
    GyroceptronShape {
        circle_action: CircleAction::new([1, 0]),
        psi: vec![3],
        near_identity: vec![3],
    }
}

/// NaN and infinities are refused where they come in.
#[test]
fn numbers_that_are_none_are_refused_at_the_border() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let architecture = small_shape().architecture(bad);
        let reason = architecture.initialise(InitialWeights::Glorot, 1.0, 0).expect_err("refused");
        assert!(reason.to_string().contains("epsilon"), "{reason}");
        let architecture = small_shape().architecture(0.01);
        let mut parameters = vec![0.1; architecture.parameter_count()];
        parameters[7] = bad;
        let reason = Model::new(architecture.clone(), parameters).expect_err("refused");
        assert!(reason.to_string().contains("parameter 7"), "{reason}");
        let reason = architecture.initialise(InitialWeights::Glorot, bad, 0).expect_err("refused");
        assert!(reason.to_string().contains("finite"), "{reason}");
        // A NaN in the state comes out as one, without a panic.
        let model = architecture.initialise(InitialWeights::Glorot, 1.0, 0).expect("sound");
        let mut z = [0.1, bad, 0.2, 0.3];
        model.forward(&mut z);
        model.inverse(&mut z);
        assert!(z.iter().any(|v| !v.is_finite()));
        let row = laws::symplecticity(&model, &[0.1, bad, 0.2, 0.3]).row();
        assert_eq!(row.verdict, Verdict::Violated);
    }
}

/// |η| ≫ |x|: the shears lose an ulp of the increment and nothing of x, the
/// literal map an ulp of η. Oracle: the same layer in double-double.
#[test]
fn a_large_shift_costs_nothing() {
    let mut weights = layer_weights();
    for eta in &mut weights[20..] {
        *eta = 1e12;
    }
    let layer = HenonLayer::new(2, 5, 1.0, &weights);
    let z = [0.3, -0.8, 1.1, 0.4];
    let mut exact = z.map(DoubleDouble::from_f64);
    layer.forward(&mut exact);
    let (mut shears, mut literal) = (z, z);
    layer.forward(&mut shears);
    for _ in 0..4 {
        layer.map().forward(&mut literal);
    }
    let steps = layer.measured_steps(Direction::Forward);
    let (scales, _) = RoundingPropagation::new(&steps, &z).value_scales();
    for i in 0..4 {
        let ratio = (shears[i] - exact[i].value()).abs() / (f64::unit_roundoff() * scales[i]);
        assert!(ratio < tolerances::RATIO, "{i}: {ratio}");
    }
    let error = (0..4).map(|i| (literal[i] - exact[i].value()).abs()).fold(0.0, max_or_nan);
    assert!(error > tolerances::NO_ROUNDING, "the case is not extreme: {error:e}");
}

/// (cos, sin) of the turn by m·θ, by turning (1, 0).
fn turned(weight: i32, theta: f64) -> (f64, f64) {
    let mut z = [1.0, 0.0];
    CircleAction::new([weight]).turn_by(theta).forward(&mut z);
    (z[0], -z[1])
}

fn exact_turn(weight: i32, theta: f64) -> (f64, f64) {
    let mut constants = Consts::new().expect("memory for constants");
    let angle =
        BigFloat::from_f64(theta, 2048).mul(&BigFloat::from_i32(weight, 2048), 2048, TO_NEAREST);
    let cos = angle.cos(2048, TO_NEAREST, &mut constants);
    let sin = angle.sin(2048, TO_NEAREST, &mut constants);
    (to_f64(&cos), to_f64(&sin))
}

/// θ = π, 1e16, 1e300 and resonant angles: tan(θ/2) has poles, and θ has no
/// digit behind the point; each is turned by as it stands, to 4u.
#[test]
fn every_angle_is_turned_by_as_it_stands() {
    let mut angles = vec![PI, -PI, PI / 2.0, 3.0 * PI / 2.0, 1e16, -1e16, 1e300, 5e-324];
    angles.extend((1..=7).flat_map(|q| (0..q).map(move |p| TAU * f64::from(p) / f64::from(q))));
    for theta in angles {
        let ((c, s), (cos, sin)) = (turned(1, theta), exact_turn(1, theta));
        let error = max_or_nan((c - cos).abs(), (s - sin).abs());
        assert!(error <= tolerances::FOUR_ROUNDINGS, "{theta:e}: {error:e}");
    }
}

/// High harmonics: m·θ is formed with its rounding error, so that the error is
/// that of the shears and not m·θ·u; also where θ itself is huge.
#[test]
fn high_harmonics_keep_the_accuracy_of_theta() {
    for (weight, theta) in
        [(1000, 0.1), (999_983, 1.7), (-77, 1e10 / 3.0), (41, 1e300), (3, 1e16 + 2.0)]
    {
        let ((c, s), (cos, sin)) = (turned(weight, theta), exact_turn(weight, theta));
        let error = max_or_nan((c - cos).abs(), (s - sin).abs());
        assert!(error <= tolerances::HARMONIC, "{weight}·{theta:e}: {error:e}");
        // Rounding m·θ first would not do.
        let (wrong_s, wrong_c) = libm::sincos(f64::from(weight) * theta);
        let wrong = max_or_nan((wrong_c - cos).abs(), (wrong_s - sin).abs());
        assert!(wrong > error, "{weight}·{theta:e}: {wrong:e}");
    }
}

/// There is no adiabatic invariant on a resonance: whoever asks is informed.
#[test]
fn resonances_are_found() {
    for (theta, q) in [(0.0, 1), (PI, 2), (TAU / 3.0, 3), (-TAU / 4.0, 4), (TAU * 2.0 / 7.0, 7)] {
        let found = nearest_resonance(theta, 7).expect("finite");
        assert_eq!(found.period, q, "{theta}");
        assert!(found.distance < tolerances::ON_RESONANCE, "{found:?}");
    }
    let golden = nearest_resonance(crate::adiabatic::GOLDEN, 7).expect("finite");
    assert!(golden.distance > tolerances::OFF_RESONANCE, "{golden:?}");
    assert_eq!(nearest_resonance(f64::NAN, 7), None);
    // The published weights: θ = 0.00564 at ε = 0.01.
    let action = CircleAction::new([1, 0]);
    let said = disturbing_resonance(&action, 0.00564, 0.01).expect("next to q = 1").to_string();
    assert_eq!(said, "2π·0/1, at a distance of 5.6e-3");
    assert_eq!(disturbing_resonance(&action, crate::adiabatic::GOLDEN, 1e-3), None);
    // What resonates is m·θ: a ninth of a turn, three times over.
    let third = disturbing_resonance(&CircleAction::new([3]), TAU / 9.0, 0.01).expect("q = 3");
    assert_eq!((third.turns, third.period), (1, 3));
    assert!(disturbing_resonance(&action, 1.0, f64::NAN).is_some());
}

/// e^{−5Q²} beyond |Q| = 12.2 and at infinity: 0, and not ∞·0.
#[test]
fn the_field_profile_vanishes_far_out() {
    let profile = FieldProfile::Gaussian { amplitude: 1.0, rate: 5.0 };
    for q in [12.3, 100.0, 1e200, f64::INFINITY, f64::NEG_INFINITY] {
        let (value, slope) = profile.value_and_slope(q);
        assert_eq!((value, slope.abs()), (0.0, 0.0), "{q}");
        let dual = profile.value_and_slope(Dual::<f64, 1>::variable(q, 0));
        assert_eq!((dual.0.re, dual.0.eps[0].abs(), dual.1.re.abs()), (0.0, 0.0, 0.0), "{q}");
    }
    assert!(profile.value_and_slope(12.0).0 > 0.0);
}

fn deep(layers: usize, scale: f64) -> (Model, Vec<f64>) {
    let shape = HenonShape::uniform(2, layers, 8);
    let model = shape.architecture(1.0).initialise(weights(scale), 0.0, 1).expect("sound");
    let mut stream = Stream::new(5, "deep");
    (model, (0..400).map(|_| stream.uniform(-1.6, 1.6)).collect())
}

/// ψ of depth 20 with weights of size 1: |J| is some 1e8, so that JᵀΩJ − Ω is as
/// large as Ω and the determinant has no digit. ρ_S is as small as ever, and
/// the determinant says that there is nothing to test.
#[test]
fn where_the_jacobian_has_no_digit_the_report_says_so() {
    let (model, points) = deep(20, 1.0);
    let steps = model.measured_steps(Direction::Forward);
    let propagations: Vec<RoundingPropagation<'_>> =
        points.chunks_exact(4).map(|z| RoundingPropagation::new(&steps, z)).collect();
    let size = |matrix: MatRef<'_, f64>| {
        let columns = matrix.col_iter();
        columns.flat_map(|c| c.iter()).fold(0.0_f64, |m, x| max_or_nan(m, x.abs()))
    };
    let norm =
        propagations.iter().map(|propagation| size(propagation.jacobian())).fold(0.0, max_or_nan);
    let defect = propagations
        .iter()
        .map(|propagation| size(symplecticity_defect(propagation.jacobian()).as_ref()))
        .fold(0.0, max_or_nan);
    // 2n products of entries of J make one of the defect.
    let rounding = 4.0 * f64::unit_roundoff() * norm * norm;
    assert!(rounding > ILL_CONDITIONED && defect > ILL_CONDITIONED, "{norm:e} {defect:e}");
    let symplecticity = laws::symplecticity(&model, &points).row();
    assert_eq!(symplecticity.verdict, Verdict::Holds, "{symplecticity:?}");
    let determinant = laws::determinant(&model, &points).row();
    assert!(determinant.ill_conditioned > 10, "{determinant:?}");
}

/// Twice as deep with weights of size 2, and the composition with the inverse
/// has no digit either: the certificate says so, layer by layer it holds, and in double-double there
/// are digits left and they are right.
#[test]
fn where_the_composition_has_no_digit_the_report_says_so() {
    let (model, points) = deep(40, 2.0);
    let inversion =
        laws::inversion("inversion", "P⁻¹∘P = Id", &model, Direction::Forward, &points).row();
    assert_eq!(inversion.verdict, Verdict::IllConditioned, "{inversion:?}");
    let layers = laws::layers(&model, &points).expect("layers").row();
    assert_eq!(layers.verdict, Verdict::Holds, "{layers:?}");
    let (mut single, mut double) = (0.0_f64, 0.0_f64);
    for z in points.chunks_exact(4).take(20) {
        let mut v = z.to_vec();
        let mut w: Vec<DoubleDouble> = z.iter().map(|&v| DoubleDouble::from_f64(v)).collect();
        model.forward(&mut v);
        model.inverse(&mut v);
        model.forward(&mut w);
        model.inverse(&mut w);
        for i in 0..4 {
            single = max_or_nan(single, (v[i] - z[i]).abs());
            double = max_or_nan(double, (w[i] - DoubleDouble::from_f64(z[i])).value().abs());
        }
    }
    let more = double < tolerances::MORE_DIGITS * single;
    assert!(single > ILL_CONDITIONED && more, "{single:e} {double:e}");
}

/// Depth 3000 with weights of size 0.1 passes.
#[test]
fn three_thousand_layers_come_back() {
    let shape = HenonShape::uniform(2, 3000, 4);
    let model = shape.architecture(1.0).initialise(weights(0.1), 0.0, 2).expect("sound");
    let z = [0.3, -0.8, 1.1, 0.4];
    let mut w = z;
    model.forward(&mut w);
    let moved = (0..4).map(|i| (w[i] - z[i]).abs()).fold(0.0, max_or_nan);
    assert!(moved > tolerances::NO_ROUNDING, "{moved}");
    model.inverse(&mut w);
    let error = (0..4).map(|i| (w[i] - z[i]).abs()).fold(0.0, max_or_nan);
    assert!(error > 0.0, "nothing was rounded");
    let there = model.measured_steps(Direction::Forward);
    assert!(symplecticity_ratio(&RoundingPropagation::new(&there, &z)) < tolerances::RATIO);
    let back = model.measured_steps(Direction::Inverse);
    assert_eq!(there.len(), back.len());
    let ratio = inversion_ratio(there, back, &z);
    assert!(matches!(ratio, Conditioned::Ratio(r) if r < tolerances::RATIO), "{ratio:?}");
}

/// K(ε) = ⌊10 + ε^{−1/4}⌋ is undefined for ε ≤ 0.
#[test]
fn the_settling_time_needs_a_positive_epsilon() {
    for (epsilon, iterations) in [(1.0, 11), (1e-4, 20), (1e-8, 110), (0.01, 13)] {
        assert_eq!(settling_iterations(epsilon).expect("positive"), iterations);
    }
    for bad in [0.0, -0.0, -1.0, f64::NAN, f64::INFINITY] {
        let reason = settling_iterations(bad).expect_err("refused");
        assert!(reason.to_string().contains("epsilon"), "{reason}");
    }
}

/// The horizon of the paper, with a map whose drift is known: μ = k at
/// iteration k exceeds 1.1·K first at ⌊1.1·K⌋ + 1.
#[test]
fn the_horizon_is_that_of_its_definition() {
    struct Count;
    impl Map<f64> for Count {
        fn dof(&self) -> usize {
            1
        }
        fn forward(&self, z: &mut [f64]) {
            z[0] += 1.0;
        }
        fn inverse(&self, z: &mut [f64]) {
            z[0] -= 1.0;
        }
    }
    let horizon = |most: usize, invariant: &dyn Fn(&[f64]) -> f64| {
        gyroceptron::measure::adiabatic::invariant_horizon(
            &Count, invariant, &[0.0; 2], 1e-4, 1.1, most,
        )
        .expect("positive")
    };
    assert_eq!(horizon(1000, &|z| z[0]), Some(23));
    assert_eq!(horizon(22, &|z| z[0]), None);
    assert_eq!(horizon(1000, &|_| 1.0), None);
    assert_eq!(horizon(1000, &|z| if z[0] == 51.0 { f64::NAN } else { 1.0 }), Some(51));
}

/// A tally of nothing is no proof.
#[test]
fn no_sample_is_vacuous() {
    assert_eq!(Tally::of_ratios("law", "1 = 1").row().verdict, Verdict::Vacuous);
}
