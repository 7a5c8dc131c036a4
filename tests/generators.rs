//! What shears of one half of the coordinates and of the other cannot reach to first order in ε, and
//! turned ones can: one set of weights, fitted to time-ε flows at several ε. Hénon layers and
//! turned kicks; twists and turned twists, of what commutes with the circle action.

use faer::Mat;
use faer::Side;
use faer::linalg::solvers::Solve;
use gyroceptron::flow::{Pairs, Window, sample};
use gyroceptron::layer::CircleAction;
use gyroceptron::measure::adiabatic::log_slope;
use gyroceptron::network::{
    Architecture, Block, Composition, GyroceptronShape, InitialWeights, Layers, NormalFormShape,
    Part,
};
use gyroceptron::random::Stream;
use gyroceptron::scalar::Elementary;
use gyroceptron::system::Hamiltonian;
use gyroceptron::train::{Loss, NormalEquations, Objective};

/// A mixed generator: ∂²G/∂q₁∂p₁ = cos q₂ is not 0.
struct Mixed;

impl Hamiltonian for Mixed {
    fn dof(&self) -> usize {
        2
    }
    fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
        z[0] * z[2] * z[1].cos()
    }
}

/// A generator that commutes with turns of the first plane, and is no sum of a function of the slow
/// position and one of the slow momentum: (1 + ½𝔍) cos q₂ cos p₂.
struct Cells;

impl Hamiltonian for Cells {
    fn dof(&self) -> usize {
        2
    }
    fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
        let quarter = S::from_f64(0.25);
        let action = z[0] * z[0] + z[2] * z[2];
        (S::from_f64(1.0) + quarter * action) * z[1].cos() * z[3].cos()
    }
}

/// Another one, which is such a sum, with a frequency that depends on 𝔍: ½p₂² + cos q₂ + 𝔍 sin p₂.
struct Separable;

impl Hamiltonian for Separable {
    fn dof(&self) -> usize {
        2
    }
    fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
        let half = S::from_f64(0.5);
        let action = half * (z[0] * z[0] + z[2] * z[2]);
        half * z[3] * z[3] + z[1].cos() + action * z[3].sin()
    }
}

/// ε of the fit.
const EPSILONS: [f64; 4] = [0.08, 0.04, 0.02, 0.01];

fn pairs(of: &(impl Hamiltonian + Sync), epsilon: f64, count: usize, seed: u64) -> Pairs {
    let window = Window { low: vec![-1.0; 4], high: vec![1.0; 4], samples: count };
    let points = sample(&[window], 2, &mut Stream::new(seed, "data")).expect("a valid window");
    Pairs::of_flow(of, points, epsilon).expect("converges").0
}

/// Σ_ε loss/ε², of a map that ε scales, by damped Gauss–Newton steps.
fn fitted(
    of: &(impl Hamiltonian + Sync),
    map: &Composition<f64>,
    iterations: usize,
) -> Composition<f64> {
    let sets: Vec<(f64, Pairs)> =
        EPSILONS.map(|epsilon| (epsilon, pairs(of, epsilon, 200, 1))).into();
    let objectives: Vec<(f64, Objective<'_>)> = sets
        .iter()
        .map(|(e, set)| (*e, Objective::new(&Loss::MeanSquaredError, set).expect("valid")))
        .collect();
    let value = |weights: &[f64]| -> f64 {
        let at = |epsilon| map.with_parameters(weights.to_vec(), epsilon).expect("as many");
        objectives.iter().map(|(e, of)| of.value(&at(*e)) / (e * e)).sum()
    };
    let mut weights = map.parameters().to_vec();
    let (mut present, mut damping) = (value(&weights), 1e-2);
    for _ in 0..iterations {
        let (n, mut right) = (weights.len(), vec![0.0; weights.len()]);
        let mut matrix = Mat::<f64>::zeros(n, n);
        for (e, of) in &objectives {
            let at = map.with_parameters(weights.clone(), *e).expect("as many");
            let NormalEquations { matrix: own, gradient, .. } = of.normal_equations(&at);
            matrix += (1.0 / (e * e)) * own;
            right.iter_mut().zip(gradient).for_each(|(r, g)| *r += g / (e * e));
        }
        for _ in 0..30 {
            let mut damped = matrix.clone();
            for i in 0..n {
                damped[(i, i)] += damping * matrix[(i, i)].max(present);
            }
            let factor = damped.llt(Side::Lower).expect("positive");
            let step = factor.solve(Mat::from_fn(n, 1, |i, _| -right[i]));
            let moved: Vec<f64> = (0..n).map(|i| weights[i] + step[(i, 0)]).collect();
            let lower = value(&moved);
            if lower < present {
                (weights, present, damping) = (moved, lower, damping / 3.0);
                break;
            }
            damping *= 4.0;
        }
    }
    map.with_parameters(weights, 1.0).expect("as many")
}

/// ε of the fit, and further down.
const FURTHER: [f64; 10] =
    [0.08, 0.04, 0.02, 0.01, 5e-3, 2.5e-3, 1.25e-3, 6.25e-4, 3.125e-4, 1.5625e-4];

/// The root-mean-square error on other points at each ε, over how far these points move.
fn shares(of: &(impl Hamiltonian + Sync), map: &Composition<f64>) -> Vec<f64> {
    let of = |&epsilon: &f64| {
        let set = pairs(of, epsilon, 1000, 2);
        let objective = Objective::new(&Loss::MeanSquaredError, &set).expect("valid");
        let moved = set.input().iter().zip(set.output()).map(|(a, b)| (a - b) * (a - b));
        let motion = moved.sum::<f64>() / set.input().len() as f64;
        (objective.value(&map.with_epsilon(epsilon)) / motion).sqrt()
    };
    FURTHER.iter().map(of).collect()
}

/// The order in ε of the error itself: of what moves with ε, one more than that of its
/// share.
fn order(shares: &[f64], of: std::ops::Range<usize>) -> f64 {
    1.0 + log_slope(&FURTHER[of.clone()], &shares[of])
}

fn henon_layers(layers: usize) -> Composition<f64> {
    let shape = GyroceptronShape {
        circle_action: CircleAction::new([1, 0]),
        psi: vec![],
        near_identity: vec![8; layers],
    };
    let architecture = shape.architecture(1.0);
    let weights = InitialWeights::Normal { scale: 0.4 };
    architecture.initialise(weights, 0.0, 1).expect("valid").near_identity()
}

fn turned_kicks(kicks: usize) -> Composition<f64> {
    let shape = NormalFormShape {
        action: CircleAction::new([1, 0]).into(),
        psi: vec![],
        kicks: vec![8; kicks],
        twists: vec![],
        turned_twists: vec![],
        flow_time: 1.0,
        perturbation: None,
    };
    let architecture = shape.architecture(1.0);
    let weights = InitialWeights::Normal { scale: 0.4 };
    let model = architecture.initialise(weights, 0.0, 1).expect("valid");
    let [chart, _] = model.chart_and_inner_map();
    chart
}

/// `cargo test --release --test maps generators -- --nocapture` prints the errors.
#[test]
fn mixed_generators_are_out_of_reach_of_henon_layers_and_not_of_turned_kicks() {
    println!("error over motion at ε = {FURTHER:?}");
    let said = |name: &str, map: &Composition<f64>| {
        let shares = shares(&Mixed, map);
        let (fitted, below) = (order(&shares, 0..4), order(&shares, 7..10));
        let parameters = map.parameters().len();
        println!("{name}, {parameters} parameters: {shares:.4?}");
        println!("    order of the error {fitted:.2}, below the ε of the fit {below:.2}");
        (shares, fitted, below)
    };
    for layers in [4, 8] {
        let map = fitted(&Mixed, &henon_layers(layers), 40);
        let (shares, _, below) = said(&format!("{layers} Hénon layers"), &map);
        // As large as the motion and of first order, where ε is small for the weights.
        assert!((below - 1.0).abs() < 0.05, "{below}");
        assert!(shares[9] > 0.9, "{shares:?}");
    }
    let map = fitted(&Mixed, &turned_kicks(12), 40);
    let (shares, ..) = said("12 turned kicks", &map);
    assert!(shares.iter().all(|share| *share < 0.01), "{shares:?}");
}

/// T_ε of these layers alone, with the flow time 1.
fn slow_map(layers: Layers) -> Composition<f64> {
    let architecture = Architecture::new(2)
        .on_circle(CircleAction::new([1, 0]))
        .at_epsilon(1.0)
        .with(Block::new(Part::SlowMap, layers));
    let weights = InitialWeights::Normal { scale: 0.4 };
    let model = architecture.initialise(weights, 0.0, 1).expect("valid");
    model.composition().near_identity_part()
}

/// The shares of [`shares`] of these layers, fitted, and the order of the error below the ε of the fit.
fn slow_shares(name: &str, of: &(impl Hamiltonian + Sync), layers: Layers) -> (Vec<f64>, f64) {
    let map = fitted(of, &slow_map(layers), 40);
    let shares = shares(of, &map);
    let below = order(&shares, 7..10);
    println!(
        "{name}, {} parameters, error over motion at ε = {FURTHER:?}: {shares:.5?}",
        map.parameters().len()
    );
    println!("    order of the error below the ε of the fit {below:.2}");
    (shares, below)
}

/// `cargo test --release --test maps slow_generators -- --nocapture` prints the errors.
#[test]
fn slow_generators_that_are_no_sums_are_out_of_reach_of_twists_and_not_of_turned_ones() {
    let (plain, below) = slow_shares("12 twists, no sum", &Cells, Layers::Twist(vec![8; 12]));
    let (turned, _) =
        slow_shares("12 turned twists, no sum", &Cells, Layers::TurnedTwist(vec![8; 12]));
    assert!((below - 1.0).abs() < 0.05 && plain[9] > 0.1, "{below}: {plain:?}");
    for (plain, turned) in plain.iter().zip(&turned) {
        assert!(10.0 * turned < *plain, "{turned} and {plain}");
    }
}

/// On sums both are as good.
#[test]
fn slow_generators_that_are_sums_are_in_reach_of_both() {
    let (plain, _) = slow_shares("12 twists, a sum", &Separable, Layers::Twist(vec![8; 12]));
    let (turned, _) =
        slow_shares("12 turned twists, a sum", &Separable, Layers::TurnedTwist(vec![8; 12]));
    for shares in [plain, turned] {
        assert!(shares.iter().all(|share| *share < 0.01), "{shares:?}");
    }
}
