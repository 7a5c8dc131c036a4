//! The structure measures: clean networks pass, mutants do not.

use gyroceptron::layer::{
    CircleAction, ElementaryStep, HenonLayer, KickForm, Potential, TanhPotential,
};
use gyroceptron::measure::{
    Certificate, CertificateOptions, CircleAxiom, Conditioned, Verdict, Walk, certify, certify_all,
    certify_map, circle_axiom_ratio, differing_components, inversion_ratio, jacobian, log_slope,
    near_identity_size, near_identity_undoing, symplecticity_defect, symplecticity_ratio,
    turning_axiom_ratio,
};
use gyroceptron::network::{
    Architecture, Gyroceptron, GyroceptronShape, HenonShape, InitialWeights, Model, Stream,
};
use gyroceptron::phase::{Half, Map};
use gyroceptron::scalar::{Over, Scalar};

const LIMIT: f64 = 10.0;

fn gyroceptron(action: &[i32], weights: InitialWeights, seed: u64) -> Model {
    Architecture::Gyroceptron {
        shape: GyroceptronShape {
            circle_action: CircleAction::new(action),
            psi: vec![5; 4],
            near_identity: vec![4; 4],
        },
        epsilon: 0.01,
    }
    .initialise(weights, 2.0, seed)
    .expect("valid")
}

fn small(seed: u64) -> CertificateOptions {
    CertificateOptions { samples: 40, radius: 1.6, seed }
}

fn row<'a>(certificate: &'a Certificate, equation: &str) -> &'a gyroceptron::measure::Row {
    certificate.rows.iter().find(|row| row.equation.contains(equation)).expect("a row")
}

#[test]
fn random_networks_hold_with_headroom() {
    for action in [vec![1, 0], vec![0, 1, 2], vec![1, 2, -3, 0]] {
        for weights in [InitialWeights::Glorot, InitialWeights::Normal { scale: 0.5 }] {
            let models: Vec<_> = (0..4).map(|seed| gyroceptron(&action, weights, seed)).collect();
            let certificate = certify_all(&models, small(1));
            for row in &certificate.rows {
                assert_eq!(row.verdict, Verdict::Holds, "{action:?} {weights:?} {row:?}");
                assert_eq!(row.samples, 160, "{row:?}");
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
    let network = model.gyroceptron().expect("a gyroceptron");
    for map in [
        network.psi().composition().clone(),
        network.near_identity().composition().clone(),
        network.conjugated_circle_action(1.0),
    ] {
        let certificate = certify_map(&map, small(3));
        assert!(certificate.holds(), "{certificate:?}");
        assert_eq!(certificate.rows.len(), 4);
    }
}

#[test]
fn networks_that_hardly_respond_hold_too() {
    for scale in [0.1, 0.05, 0.02] {
        let model = gyroceptron(&[1, 0], InitialWeights::Normal { scale }, 2);
        for row in certify(&model, small(4)).rows {
            assert_eq!(row.verdict, Verdict::Holds, "scale {scale}: {row:?}");
        }
    }
}

#[test]
fn henon_nets_have_a_certificate_too() {
    let architecture = Architecture::HenonNet { shape: HenonShape::uniform(2, 6, 5), epsilon: 1.0 };
    let model =
        architecture.initialise(InitialWeights::Normal { scale: 0.4 }, 0.0, 1).expect("valid");
    let certificate = certify(&model, small(2));
    assert!(certificate.holds());
    assert_eq!(certificate.rows.len(), 4);
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
    let architecture = Architecture::HenonNet { shape: HenonShape::uniform(2, 2, 3), epsilon: 1.0 };
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
    let architecture =
        Architecture::HenonNet { shape: HenonShape::uniform(2, 24, 8), epsilon: 1.0 };
    let model =
        architecture.initialise(InitialWeights::Normal { scale: 1.5 }, 0.0, 1).expect("valid");
    let certificate = certify(&model, small(0));
    let inversion = row(&certificate, "P⁻¹∘P");
    assert!(inversion.ill_conditioned > 0, "{inversion:?}");
}

#[test]
fn numbers_out_of_range_violate() {
    let architecture = Architecture::HenonNet { shape: HenonShape::uniform(2, 2, 2), epsilon: 1.0 };
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
    let walk = Walk::new(&model.composition().elementary_steps(), &z);
    let exact = jacobian(&model, &z);
    for row in 0..4 {
        for column in 0..4 {
            // The rotation is walked shear by shear, as it is applied.
            assert_eq!(walk.jacobian()[row * 4 + column], exact[(row, column)]);
        }
    }
    let defect = symplecticity_defect(walk.jacobian(), 2);
    assert!(defect.iter().any(|d| *d != 0.0) && defect.iter().all(|d| d.abs() < 1e-13));
    // A matrix that is not symplectic has its own defect.
    let diagonal = [2.0, 0.0, 0.0, 3.0];
    assert_eq!(symplecticity_defect(&diagonal, 1), [0.0, 5.0, -5.0, 0.0]);
}

/// What is broken in a mutant's potential.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    None,
    /// Outer factor read with the transposed index.
    MissingTranspose,
    /// Outer W off by this factor: g is no gradient any more.
    OuterWeights(f64),
}

/// ∇V with a fault, over any number, so that duals see the fault as well.
#[derive(Clone, Copy, Debug)]
struct Faulty<'a> {
    clean: TanhPotential<'a, f64>,
    w_in: &'a [f64],
    b_in: &'a [f64],
    w_out: &'a [f64],
    fault: Fault,
}

impl<'a> Faulty<'a> {
    fn new(dof: usize, width: usize, parameters: &'a [f64], fault: Fault) -> Self {
        let (w_in, rest) = parameters.split_at(dof * width);
        let (b_in, w_out) = rest.split_at(width);
        Self { clean: TanhPotential::new(dof, width, parameters), w_in, b_in, w_out, fault }
    }
}

impl<S: Over<f64>> Potential<S> for Faulty<'_> {
    fn dof(&self) -> usize {
        Potential::<S>::dof(&self.clean)
    }
    fn tape_len(&self) -> usize {
        0
    }
    fn gradient(&self, y: &[S], out: &mut [S]) {
        let (n, h) = (y.len(), self.w_out.len());
        out[..n].fill(S::zero());
        for j in 0..h {
            let mut z = S::embed(self.b_in[j]);
            for i in 0..n {
                z = y[i].mul_add_parameter(self.w_in[i * h + j], z);
            }
            let c = z.sech2().times(self.w_out[j]);
            for i in 0..n {
                let outer = match self.fault {
                    Fault::None => self.w_in[i * h + j],
                    Fault::MissingTranspose => self.w_in[j * n + i],
                    Fault::OuterWeights(error) => {
                        self.w_in[i * h + j] * if i == 0 { 1.0 + error } else { 1.0 }
                    }
                };
                out[i] = c.mul_add_parameter(outer, out[i]);
            }
        }
    }
    fn gradient_recording(&self, y: &[S], out: &mut [S], _: &mut [S]) {
        self.gradient(y, out);
    }
    fn pullback(&self, _: &[S], _: &[S], _: &[S], _: &mut [S], _: &mut [S]) {
        unreachable!("no measure pulls back through a mutant");
    }
    fn hessian_magnitude(&self, y: &[S], out: &mut [S]) {
        self.clean.hessian_magnitude(y, out);
    }
    fn gradient_magnitude(&self, y: &[S], out: &mut [S]) {
        self.clean.gradient_magnitude(y, out);
    }
}

type Steps<'a> = Vec<ElementaryStep<'a, f64, Faulty<'a>>>;

/// The kicks of layers of width 5 in two degrees of freedom.
fn kicks(parameters: &[f64], fault: Fault, forms: [KickForm; 4]) -> Steps<'_> {
    parameters
        .chunks_exact(22)
        .flat_map(|own| {
            let (potential, eta) = own.split_at(20);
            let potential = Faulty::new(2, 5, potential, fault);
            forms.map(|form| ElementaryStep::Kick(form.kick(potential, eta, 1.0)))
        })
        .collect()
}

fn inverted(steps: &Steps<'_>) -> Vec<ElementaryStep<'static, f64, Faulty<'static>>> {
    // Lifetimes are those of the parameters, which the tests leak.
    let steps: Steps<'static> = owned(steps);
    steps.into_iter().rev().map(ElementaryStep::inverse).collect()
}

fn owned(steps: &Steps<'_>) -> Steps<'static> {
    steps
        .iter()
        .map(|step| match step {
            ElementaryStep::Kick(kick) => {
                let potential = &kick.potential;
                let parameters: Vec<f64> =
                    [potential.w_in, potential.b_in, potential.w_out].concat();
                let parameters: &'static [f64] = parameters.leak();
                let shift: Option<&'static [f64]> = kick.shift.map(|eta| &*eta.to_vec().leak());
                ElementaryStep::Kick(gyroceptron::layer::Kick {
                    potential: Faulty::new(2, 5, parameters, potential.fault),
                    scale: kick.scale,
                    reflect: kick.reflect,
                    shift,
                    target: kick.target,
                })
            }
            _ => unreachable!("kicks only"),
        })
        .collect()
}

fn weights(seed: u64) -> Vec<f64> {
    let mut stream = Stream::new(seed, "weights");
    (0..4).flat_map(|_| InitialWeights::Normal { scale: 0.6 }.layer(2, 5, &mut stream)).collect()
}

fn points() -> Vec<Vec<f64>> {
    let mut stream = Stream::new(9, "points");
    (0..100).map(|_| (0..4).map(|_| stream.uniform(-1.6, 1.6)).collect()).collect()
}

fn symplecticity_ratios(steps: &Steps<'_>) -> (f64, f64) {
    let ratios: Vec<f64> =
        points().iter().map(|z| symplecticity_ratio(&Walk::new(steps, z))).collect();
    extremes(&ratios)
}

fn inversion_ratios(steps: &Steps<'_>) -> (f64, f64) {
    let ratios: Vec<f64> = points()
        .iter()
        .map(|z| match inversion_ratio(steps, z) {
            Conditioned::Ratio(ratio) => ratio,
            Conditioned::IllConditioned => panic!("well-conditioned samples"),
        })
        .collect();
    extremes(&ratios)
}

fn extremes(ratios: &[f64]) -> (f64, f64) {
    (
        ratios.iter().copied().fold(f64::INFINITY, f64::min),
        ratios.iter().copied().fold(0.0, f64::max),
    )
}

#[test]
fn symplecticity_rejects_broken_gradients_and_nothing_else() {
    let weights = weights(1);
    let (_, clean) = symplecticity_ratios(&kicks(&weights, Fault::None, KickForm::LAYER));
    assert!(clean < 3.0, "{clean}");
    for fault in [Fault::MissingTranspose, Fault::OuterWeights(1e-9)] {
        let (smallest, _) = symplecticity_ratios(&kicks(&weights, fault, KickForm::LAYER));
        assert!(smallest > LIMIT, "{fault:?}: {smallest}");
    }
    // Any sequence of true kicks is symplectic: a wrong order is not its matter.
    let mut wrong_order = KickForm::LAYER;
    wrong_order.swap(0, 3);
    let (_, largest) = symplecticity_ratios(&kicks(&weights, Fault::None, wrong_order));
    assert!(largest < 3.0, "{largest}");
}

#[test]
fn inversion_rejects_an_inverse_of_something_else() {
    let weights = weights(2);
    let forward = kicks(&weights, Fault::None, KickForm::LAYER);
    let chain = |inverse: Vec<_>| {
        let mut steps = owned(&forward);
        steps.extend(inverse);
        steps
    };
    let (_, clean) = inversion_ratios(&chain(inverted(&forward)));
    assert!(clean < 5.0, "{clean}");
    for factor in [1e-9, 1e-12] {
        let mut other = weights.clone();
        for w in &mut other {
            *w *= 1.0 + factor;
        }
        let wrong = inverted(&kicks(&other, Fault::None, KickForm::LAYER));
        let (smallest, _) = inversion_ratios(&chain(wrong));
        assert!(smallest > LIMIT, "weights off by {factor}: {smallest}");
    }
    // Layers in the wrong order, η with the wrong sign, a layer left out.
    let mut reversed = weights.clone();
    reversed.rotate_left(22);
    let mut flipped = weights.clone();
    for layer in flipped.chunks_exact_mut(22) {
        layer[20..].iter_mut().for_each(|eta| *eta = -*eta);
    }
    for wrong in [&reversed[..], &flipped, &weights[22..]] {
        let wrong = inverted(&kicks(wrong, Fault::None, KickForm::LAYER));
        let (smallest, _) = inversion_ratios(&chain(wrong));
        assert!(smallest > 1e6, "{smallest:e}");
    }
}

#[test]
fn symplecticity_rejects_a_rotation_that_is_none() {
    // A shear with another coefficient is still symplectic; scaling a plane is
    // not, and no kick or shear can do it: the matrix form is measured.
    let (s, c) = libm::sincos(0.7);
    let single =
        [f64::from(c as f32), f64::from(s as f32), -f64::from(s as f32), f64::from(c as f32)];
    let defect = symplecticity_defect(&single, 1);
    assert!(defect[1].abs() > 10.0 * f64::unit_roundoff() * 2.0, "{defect:?}");
    let wrong_sign = [c, s, s, c];
    assert!(symplecticity_defect(&wrong_sign, 1)[1].abs() > 0.1);
}

#[test]
fn circle_axioms_reject_what_is_no_action() {
    let action = CircleAction::new([1, 3]);
    let z = [0.4, -0.9, 1.2, 0.1];
    for axiom in [
        CircleAxiom::Identity,
        CircleAxiom::Periodicity(2.0),
        CircleAxiom::Additivity(1.0, -2.5),
        CircleAxiom::Inverse(0.3),
    ] {
        assert!(circle_axiom_ratio(&action, axiom, &z) < LIMIT);
    }
    // Mutants: the matrix in single precision, a half-turned sign, an angle off
    // by 1e-12 in the second turn of a circle, an angle that is no angle.
    let plane = |z: &mut [f64], c: f64, s: f64| {
        (z[0], z[1]) = (c * z[0] + s * z[1], c * z[1] - s * z[0]);
    };
    let single = |angle: f64, z: &mut [f64]| {
        let (s, c) = libm::sincos(angle);
        plane(z, f64::from(c as f32), f64::from(s as f32));
    };
    let even = |angle: f64, z: &mut [f64]| plane(z, libm::cos(angle), libm::sin(angle).abs());
    let slipping = |angle: f64, z: &mut [f64]| {
        let angle = if angle > std::f64::consts::TAU { angle + 1e-12 } else { angle };
        plane(z, libm::cos(angle), libm::sin(angle));
    };
    let squared =
        |angle: f64, z: &mut [f64]| plane(z, libm::cos(angle * angle), libm::sin(angle * angle));
    let offset = |angle: f64, z: &mut [f64]| plane(z, libm::cos(angle + 0.1), libm::sin(angle));
    let w = [0.4, -0.9];
    let ratio = |turn: &dyn Fn(f64, &mut [f64]), axiom| turning_axiom_ratio(&[1], turn, axiom, &w);
    let additivity = CircleAxiom::Additivity(1.0, -2.5);
    assert!(ratio(&single, additivity) > LIMIT);
    assert!(ratio(&even, CircleAxiom::Inverse(-1.0)) > LIMIT);
    assert!(ratio(&slipping, CircleAxiom::Periodicity(2.0)) > LIMIT);
    assert!(ratio(&squared, additivity) > LIMIT);
    assert!(ratio(&offset, CircleAxiom::Identity) > LIMIT);
    // NaN fails.
    let nan = [f64::NAN, 0.0, 0.0, 0.0];
    assert!(!(circle_axiom_ratio(&action, CircleAxiom::Inverse(0.3), &nan) < LIMIT));
}

/// The literal four-fold Hénon map, and I_ε that forgets its ε: each as the
/// mutant that a near-identity check must reject.
struct Literal<'a>(HenonLayer<'a, f64>);

impl Map<f64> for Literal<'_> {
    fn dof(&self) -> usize {
        2
    }
    fn forward(&self, z: &mut [f64]) {
        for _ in 0..4 {
            self.0.map().forward(z);
        }
    }
    fn inverse(&self, z: &mut [f64]) {
        for _ in 0..4 {
            self.0.map().inverse(z);
        }
    }
}

#[test]
fn near_identity_checks_reject_what_is_not_near() {
    let weights = weights(3);
    let layer = |epsilon| HenonLayer::new(2, 5, epsilon, &weights[..22]);
    let z = [0.3, -0.8, 1.1, 0.4];
    assert_eq!(differing_components(&layer(0.0), &z), 0);
    assert!(differing_components(&Literal(layer(0.0)), &z) > 0);
    let forgetful = layer(1.0);
    assert!(differing_components(&forgetful, &z) > 0);

    let epsilons = [4e-3, 2e-3, 1e-3];
    let slope = |f: &dyn Fn(f64) -> f64| log_slope(&epsilons, &epsilons.map(f));
    let size = slope(&|e| near_identity_size(&layer(e), &z));
    assert!((size - 1.0).abs() < 0.1, "{size}");
    assert!(slope(&|_| near_identity_size(&forgetful, &z)) < 0.5);
    let undoing = slope(&|e| near_identity_undoing(&layer(e), &layer(-e), &z));
    assert!((undoing - 2.0).abs() < 0.1, "{undoing}");
    // I_ε again in place of I_{−ε}: order 1 only.
    assert!(slope(&|e| near_identity_undoing(&layer(e), &layer(e), &z)) < 1.5);
    let nan = [f64::NAN, 0.0, 0.0, 0.0];
    assert!(near_identity_size(&layer(0.1), &nan).is_nan());
    assert!(!(log_slope(&epsilons, &[1.0, f64::NAN, 1.0]) >= 1.0));
}

#[test]
fn nan_fails_every_ratio() {
    let weights = weights(1);
    let steps = kicks(&weights, Fault::None, KickForm::LAYER);
    for bad in [f64::NAN, f64::INFINITY] {
        let z = [0.1, bad, 0.2, 0.3];
        assert!(!(symplecticity_ratio(&Walk::new(&steps, &z)) < LIMIT));
        let holds = matches!(inversion_ratio(&steps, &z), Conditioned::Ratio(r) if r < LIMIT);
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

#[test]
fn the_adiabatic_invariant_is_kept_to_order_epsilon_where_it_exists() {
    // The golden-mean angle is far from resonances: the drift of μ₀ is O(ε).
    let golden = std::f64::consts::TAU * 0.5 * (5.0_f64.sqrt() - 1.0);
    let architecture = |epsilon| Architecture::Gyroceptron {
        shape: GyroceptronShape {
            circle_action: CircleAction::new([1]),
            psi: vec![8; 3],
            near_identity: vec![8; 3],
        },
        epsilon,
    };
    let drift = |epsilon: f64| {
        let model =
            architecture(epsilon).initialise(InitialWeights::Glorot, golden, 1).expect("valid");
        let network: &Gyroceptron<f64> = model.gyroceptron().expect("a gyroceptron");
        let mut z = vec![0.6, 0.2];
        let start = network.adiabatic_invariant(&z)[0];
        let mut largest = 0.0_f64;
        for _ in 0..5000 {
            gyroceptron::phase::Map::forward(network, &mut z);
            largest = largest.max((network.adiabatic_invariant(&z)[0] - start).abs());
        }
        largest
    };
    let epsilons = [1e-3, 3e-4, 1e-4, 3e-5];
    let drifts: Vec<f64> = epsilons.iter().map(|&e| drift(e)).collect();
    let slope = gyroceptron::measure::log_slope(&epsilons, &drifts);
    assert!((slope - 1.0).abs() < 0.1, "{slope}: {drifts:?}");
    let floor = drift(0.0);
    assert!(floor < 1e-12 && drifts[3] > 100.0 * floor, "{floor:e}");
}
