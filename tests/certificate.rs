//! The structure certificate, as its users read it. That the laws can fail is
//! shown in `verification/`.

use faer::mat;
use gyroceptron::layer::{CircleAction, HenonLayer};
use gyroceptron::measure::internals::{unless_stopped, until_stopped};
use gyroceptron::measure::{
    Measurable, OneStep,
    certificate::{Certificate, CertificateOptions, Verdict, certify, certify_all, certify_map},
    jacobian,
    ratios::{
        Conditioned, RoundingPropagation, inversion_ratio, symplecticity_defect,
        symplecticity_ratio,
    },
};
use gyroceptron::network::{GyroceptronShape, HenonShape, InitialWeights, Model, NormalFormShape};
use gyroceptron::phase::{Direction, Half, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Elementary, max_or_nan};
use std::time::Duration;

const LIMIT: f64 = 10.0;

fn gyroceptron(action: &[i32], weights: InitialWeights, seed: u64) -> Model {
    GyroceptronShape {
        circle_action: CircleAction::new(action),
        psi: vec![5; 4],
        near_identity: vec![4; 4],
    }
    .architecture(0.01)
    .initialise(weights, 2.0, seed)
    .expect("valid")
}

fn small(seed: u64) -> CertificateOptions {
    CertificateOptions { samples: 40, radius: 1.6, seed }
}

fn row<'a>(
    certificate: &'a Certificate,
    equation: &str,
) -> &'a gyroceptron::measure::certificate::Row {
    certificate.rows.iter().find(|row| row.equation.contains(equation)).expect("a row")
}

#[test]
fn random_networks_hold_with_headroom() {
    for action in [vec![1, 0], vec![1, 2, -3, 0]] {
        for weights in [InitialWeights::Glorot, InitialWeights::Normal { scale: 0.5 }] {
            let models: Vec<_> = (0..4).map(|seed| gyroceptron(&action, weights, seed)).collect();
            let certificate = certify_all(&models, small(1));
            for row in &certificate.rows {
                if row.verdict == Verdict::Reported {
                    continue;
                }
                assert_eq!(row.verdict, Verdict::Holds, "{action:?} {weights:?} {row:?}");
                let samples = match row.law.as_str() {
                    // ψ⁻¹, Φ_θ, ψ and I_ε: 4 + 1 + 4 + 4.
                    "inversion of layers" => 160 * 13,
                    "near identity" if row.limit < 0.5 => 4,
                    _ => 160,
                };
                assert_eq!(row.samples, samples, "{row:?}");
            }
            assert!(certificate.largest_ratio().expect("measured") < 5.0);
            let median = certificate.rows[0].median.expect("measured");
            assert!((0.05..=0.6).contains(&median), "median of ρ_S: {median}");
        }
    }
}

#[test]
fn the_parts_of_a_network_are_certified_alone() {
    let model = gyroceptron(&[1, 0], InitialWeights::Glorot, 2);
    let network = model;
    for map in [
        network.psi().clone(),
        network.near_identity().clone(),
        network.conjugated_circle_action(1.0),
    ] {
        let certificate = certify_map(&map, small(3));
        assert!(certificate.holds(), "{certificate:?}");
        assert_eq!(certificate.rows.len(), 5);
    }
}

#[test]
fn networks_that_hardly_respond_hold_too() {
    for scale in [0.1, 0.05, 0.02, 0.01] {
        let model = gyroceptron(&[1, 0], InitialWeights::Normal { scale }, 2);
        let certificate = certify(&model, small(4));
        assert!(certificate.holds(), "scale {scale}: {certificate:?}");
    }
}

/// Kicks that hardly depend on where they are taken have a first order in ε, and
/// a third that cannot be distinguished from rounding: nothing is claimed of that.
#[test]
fn an_order_that_hides_under_rounding_is_not_said_to_hold() {
    let model = gyroceptron(&[1, 0], InitialWeights::Normal { scale: 1e-5 }, 2);
    let certificate = certify(&model, small(4));
    assert_eq!(row(&certificate, "= O(ε)").verdict, Verdict::Holds);
    let generator = row(&certificate, "O(ε³)");
    assert_eq!(generator.verdict, Verdict::IllConditioned, "{generator:?}");
    assert_eq!((generator.largest, generator.ill_conditioned), (None, 1));
    assert!(!certificate.holds());
}

#[test]
fn henon_nets_have_a_certificate_too() {
    let architecture = HenonShape::uniform(2, 6, 5).architecture(1.0);
    let model =
        architecture.initialise(InitialWeights::Normal { scale: 0.4 }, 0.0, 1).expect("valid");
    let certificate = certify(&model, small(2));
    assert!(certificate.holds());
    assert_eq!(certificate.rows.len(), 10);
}

/// A twist of many shears, whose weights cancel: its bounds are those of its errors all the
/// same, so that a defect has nowhere to hide.
#[test]
fn long_twists_are_judged_by_bounds_of_their_size() {
    let shape = NormalFormShape {
        action: CircleAction::new([1, 0]).into(),
        psi: vec![],
        kicks: vec![8; 12],
        twists: vec![8; 16],
        turned_twists: vec![],
        flow_time: 50.0,
        perturbation: None,
    };
    let architecture = shape.architecture(0.01);
    let weights = InitialWeights::Normal { scale: 1.0 };
    let model = architecture.initialise(weights, 50.0, 1).expect("valid");
    let certificate = certify(&model, small(3));
    assert!(certificate.holds(), "{:#?}", certificate.rows);
    for equation in ["JᵀΩJ = Ω", "P⁻¹∘P = Id", "P∘P⁻¹ = Id"] {
        let row = row(&certificate, equation);
        let deviation = row.deviation.expect("errors of rounding");
        // 0.0004 to 0.006 where each shear's error is bounded by those of all before it.
        assert!(deviation > 0.03, "{row:?}");
    }
    // A way back whose first twist has one weight that is wrong by 1e-11.
    let mut weights = model.composition().parameters().to_vec();
    weights[12 * (8 * 4 + 2)] *= 1.0 + 1e-11;
    let wrong = model.with_parameters(weights).expect("finite");
    let mut stream = Stream::new(3, "points");
    let ratios = (0..20).map(|_| {
        let z: Vec<f64> = (0..4).map(|_| stream.uniform(-1.6, 1.6)).collect();
        let there = model.composition().measured_steps(Direction::Forward);
        let back = wrong.composition().measured_steps(Direction::Inverse);
        match inversion_ratio(there, back, &z) {
            Conditioned::Ratio(ratio) => ratio,
            Conditioned::IllConditioned => f64::NAN,
        }
    });
    let largest = ratios.fold(0.0, max_or_nan);
    assert!(largest > LIMIT, "{largest}");
}

#[test]
fn the_certificate_is_the_same_bits_again() {
    let model = gyroceptron(&[1, 0], InitialWeights::Glorot, 3);
    let text = |seed| serde_json::to_string(&certify(&model, small(seed))).expect("serialises");
    assert_eq!(text(5), text(5));
    assert_ne!(text(5), text(6));
}

/// A network without any nonlinearity is exactly the identity: nothing is
/// rounded, and the test of symplecticity cannot fail.
#[test]
fn a_check_that_cannot_fail_says_so() {
    let architecture = HenonShape::uniform(2, 2, 3).architecture(1.0);
    let count = architecture.parameter_count();
    let model = Model::new(architecture, vec![0.0; count]).expect("finite");
    let certificate = certify(&model, small(0));
    assert_eq!(certificate.rows[0].verdict, Verdict::Vacuous);
    assert!(!certificate.holds());

    // I_ε that does not respond to ε.
    let mut parameters =
        gyroceptron(&[1, 0], InitialWeights::Glorot, 1).composition().parameters().to_vec();
    let start = 4 * (5 * 4 + 2);
    let end = parameters.len() - 1;
    parameters[start..end].fill(0.0);
    let model = gyroceptron(&[1, 0], InitialWeights::Glorot, 1)
        .with_parameters(parameters)
        .expect("finite");
    assert_eq!(row(&certify(&model, small(0)), "= O(ε)").verdict, Verdict::Vacuous);
}

#[test]
fn where_no_digit_is_left_the_certificate_says_so() {
    let architecture = HenonShape::uniform(2, 24, 8).architecture(1.0);
    let model =
        architecture.initialise(InitialWeights::Normal { scale: 1.5 }, 0.0, 1).expect("valid");
    let certificate = certify(&model, small(0));
    let inversion = row(&certificate, "P⁻¹∘P");
    assert!(inversion.ill_conditioned > 0, "{inversion:?}");
}

#[test]
fn numbers_out_of_range_violate() {
    let architecture = HenonShape::uniform(2, 2, 2).architecture(1.0);
    let parameters = [[0.1; 6].as_slice(), &[1e307; 2], &[0.0; 2]].concat().repeat(2);
    let model = Model::new(architecture, parameters).expect("finite");
    let certificate = certify(&model, small(0));
    assert_eq!(certificate.rows[0].verdict, Verdict::Violated, "{:?}", certificate.rows[0]);
    assert_eq!(certificate.rows[0].largest, None);
}

#[test]
fn symplecticity_of_the_walk_is_that_of_the_map() {
    let model = gyroceptron(&[1, 2], InitialWeights::Glorot, 3);
    let z = [0.3, -0.8, 1.1, 0.4];
    let steps = model.measured_steps(Direction::Forward);
    let propagation = RoundingPropagation::new(&steps, &z);
    let exact = jacobian(&model, &z);
    for row in 0..4 {
        for column in 0..4 {
            // The rotation is walked shear by shear, as it is applied.
            assert_eq!(propagation.jacobian()[(row, column)], exact[(row, column)]);
        }
    }
    let defect = symplecticity_defect(propagation.jacobian());
    assert!(defect.is_all_finite() && defect.norm_max() > 0.0 && defect.norm_max() < 1e-13);
    // A matrix that is not symplectic has its own defect.
    let diagonal = mat![[2.0, 0.0], [0.0, 3.0]];
    assert_eq!(symplecticity_defect(diagonal.as_ref()), mat![[0.0, 5.0], [-5.0, 0.0]]);
}

#[test]
fn nan_fails_every_ratio() {
    let weights = InitialWeights::Glorot.layer(2, 5, &mut Stream::new(1, "weights"));
    let layer = HenonLayer::new(2, 5, 1.0, &weights);
    let steps = layer.measured_steps(Direction::Forward);
    for bad in [f64::NAN, f64::INFINITY] {
        let z = [0.1, bad, 0.2, 0.3];
        assert!(!(symplecticity_ratio(&RoundingPropagation::new(&steps, &z)) < LIMIT));
        let back = layer.measured_steps(Direction::Inverse);
        let ratio = inversion_ratio(layer.measured_steps(Direction::Forward), back, &z);
        let holds = matches!(ratio, Conditioned::Ratio(r) if r < LIMIT);
        assert!(!holds);
    }
}

#[test]
fn the_halves_of_phase_space_are_where_the_docs_say() {
    let mut z = [1.0, 2.0, 3.0, 4.0];
    let (source, target) = Half::Momentum.split(2, &mut z);
    assert_eq!((source, &*target), (&[1.0, 2.0][..], &[3.0, 4.0][..]));
    assert_eq!(Half::Position.index(2, 1), 1);
    assert_eq!(Half::Momentum.index(2, 1), 3);
    assert_eq!(Half::Momentum.other(), Half::Position);
}

/// p ← p + K sin q, q ← q + p: a map that the crate knows nothing of.
struct StandardMap {
    k: f64,
    /// Damping: 1 for the symplectic map.
    keep: f64,
    /// Added to what the inverse subtracts.
    slip: f64,
}

impl<S: Elementary> Map<S> for StandardMap {
    fn dof(&self) -> usize {
        1
    }
    fn forward(&self, z: &mut [S]) {
        z[1] = S::from_f64(self.keep) * z[1] + S::from_f64(self.k) * z[0].sin();
        z[0] += z[1];
    }
    fn inverse(&self, z: &mut [S]) {
        z[0] -= z[1];
        let kick = S::from_f64(self.k + self.slip) * z[0].sin();
        z[1] = (z[1] - kick) / S::from_f64(self.keep);
    }
}

#[test]
fn a_map_of_ones_own_is_certified_in_a_few_lines() {
    let verdicts = |keep: f64, slip: f64| {
        let map = OneStep(StandardMap { k: 1.2, keep, slip });
        let options = CertificateOptions { samples: 200, radius: 3.0, seed: 1 };
        let certificate = certify_map(&map, options);
        certificate.rows.iter().map(|row| row.verdict).collect::<Vec<_>>()
    };
    use Verdict::{Holds, Reported, Violated};
    assert_eq!(verdicts(1.0, 0.0), [Holds, Holds, Holds, Holds, Reported]);
    // Damped by 1e-12: no longer symplectic, still inverted.
    assert_eq!(verdicts(1.0 - 1e-12, 0.0), [Violated, Holds, Holds, Holds, Reported]);
    // Undone with another K.
    assert_eq!(verdicts(1.0, 1e-12), [Holds, Violated, Violated, Holds, Reported]);
}

fn slow_count() -> usize {
    let wait = |_| std::thread::sleep(Duration::from_millis(2));
    until_stopped(0..100).map(wait).count()
}

#[test]
fn a_stopped_measurement_ends_and_others_go_on() {
    assert_eq!(unless_stopped(|| true, slow_count), Some(100));
    let counted = unless_stopped(
        || false,
        || {
            // One inside has an answer of its own.
            assert_eq!(unless_stopped(|| true, slow_count), Some(100));
            let count = slow_count();
            assert!(count < 100, "{count}");
        },
    );
    assert_eq!(counted, None);
    assert_eq!(slow_count(), 100);
}
