//! Networks whose parameters are polynomials of controls: their maps, their fit, and their files.

use gyroceptron::Error;
use gyroceptron::flow::Pairs;
use gyroceptron::io::{StoredModel, read_pairs, write_pairs};
use gyroceptron::layer::CircleAction;
use gyroceptron::measure::certificate::{CertificateOptions, certify};
use gyroceptron::network::{
    Architecture, Block, ControlRange, Controls, GyroceptronShape, HenonShape, InitialWeights,
    Layers, Model, NetworkSpec, Part,
};
use gyroceptron::phase::Map;
use gyroceptron::random::Stream;
use gyroceptron::scalar::max_or_nan;
use gyroceptron::train::{
    ControlOptions, FamilyPairs, Fit, FreshTwists, LevenbergMarquardtOptions, Loss, Objective,
    Optimiser, RampStage, TrainingOptions,
};

fn range(name: &str, low: f64, high: f64) -> ControlRange {
    ControlRange { name: name.into(), low, high }
}

fn two() -> Controls {
    Controls { ranges: vec![range("a", -1.0, 3.0), range("b", 0.0, 1.0)], degree: 2 }
}

/// Random numbers for all parameters, those of the products of controls too.
fn drawn(architecture: &Architecture, seed: u64) -> Model {
    let model =
        architecture.initialise(InitialWeights::Glorot, 0.7, seed).expect("an architecture");
    let (nominal, mut stream) = (architecture.clone().with_controls(None), Stream::new(seed, "λ"));
    let mut parameters = model.parameters().to_vec();
    for parameter in &mut parameters[nominal.parameter_count()..] {
        *parameter = stream.uniform(-0.03, 0.03);
    }
    model.with_parameters(parameters).expect("as many")
}

fn models() -> Vec<Model> {
    let gyroceptron = GyroceptronShape {
        circle_action: CircleAction::new([1]),
        psi: vec![3; 2],
        near_identity: vec![3; 2],
    };
    let jolts = Architecture::new(1)
        .on_circle(CircleAction::new([1]))
        .with(Block::new(Part::Chart, Layers::TurnedKick(vec![1; 3])).of_polynomials(4).in_box(3.0))
        .with(Block::new(Part::SlowMap, Layers::Twist(vec![1])).of_polynomials(3).in_box(3.0));
    let all = [
        gyroceptron.architecture(0.1),
        jolts,
        HenonShape { dof: 1, widths: vec![3, 2] }.architecture(0.1),
    ];
    all.iter()
        .map(|architecture| drawn(&architecture.clone().with_controls(Some(two())), 3))
        .collect()
}

/// The products of two controls to the second degree, in their order; and the names of tensors.
#[test]
fn parameters_are_polynomials_of_the_controls() {
    let controls = two();
    assert_eq!((controls.terms(), controls.nominal()), (6, vec![1.0, 0.5]));
    let products = controls.products(&[2.0, 0.25]);
    assert_eq!(products, [1.0, 0.5, -0.5, 0.25, -0.25, 0.25]);
    for model in models() {
        let architecture = model.architecture();
        let names: Vec<String> = architecture.tensors().into_iter().map(|(name, _)| name).collect();
        let count = names.len() / 6;
        for (number, prefix) in ["", "a:", "b:", "a^2:", "a*b:", "b^2:"].iter().enumerate() {
            assert_eq!(names[number * count], format!("{prefix}{}", names[0]));
        }
        let size = architecture.clone().with_controls(None).parameter_count();
        assert_eq!(model.parameters().len(), 6 * size);
        let at = model.at_controls(&[2.0, 0.25]).expect("two values");
        assert_eq!(at.architecture().controls, None);
        for (k, found) in at.parameters().iter().enumerate() {
            let term =
                |(number, product): (usize, &f64)| product * model.parameters()[number * size + k];
            let wanted: f64 = products.iter().enumerate().map(term).sum();
            assert!((found - wanted).abs() <= 4.0 * f64::EPSILON, "{found} for {wanted}");
        }
        // At the middle of the ranges it is what it is without a word of controls.
        let (mut nominal, mut plain) = (vec![0.3, -0.2], vec![0.3, -0.2]);
        model.at_controls(&[1.0, 0.5]).expect("two values").forward(&mut nominal);
        model.forward(&mut plain);
        assert_eq!(nominal, plain);
        assert!(model.at_controls(&[1.0]).is_err());
    }
}

/// Whatever the controls are, within their range and, of networks without a box, far beyond it.
#[test]
fn the_laws_hold_at_all_controls() {
    let options = CertificateOptions { samples: 20, ..Default::default() };
    for model in models() {
        let far = if model.architecture().has_polynomials() { [2.0, 0.25] } else { [9.0, -4.0] };
        for values in [[1.0, 0.5], [-1.0, 1.0], [3.0, 0.0], far] {
            certify(&model.at_controls(&values).expect("two values"), options).assert_holds();
        }
    }
}

fn family(seed: u64) -> Pairs {
    let mut stream = Stream::new(seed, "pairs");
    let (mut input, mut output, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for (a, b) in [(-1.0, 0.0), (3.0, 1.0), (0.0, 0.75)] {
        for _ in 0..13 {
            let z = [stream.uniform(-0.8, 0.8), stream.uniform(-0.8, 0.8)];
            input.extend(z);
            output.extend([z[0] + 0.3 * z[1] + 0.05 * a, z[1] - 0.2 * b * z[0]]);
            values.extend([a, b]);
        }
    }
    let ones = vec![1.0; input.len() / 2];
    let pairs = Pairs::new("pairs", 1, input, output).expect("finite");
    pairs.under_controls(&ones, &ones, &values).expect("values")
}

fn close(a: f64, b: f64, tolerance: f64, what: &str) {
    let error = (a - b).abs() / (1.0 + b.abs());
    assert!(error <= tolerance, "{what}: {a:e} for {b:e}");
}

/// The map of some pairs, whose ε is 1 where a network has an ε.
fn member(model: &Model, values: &[f64]) -> Model {
    let at = model.at_controls(values).expect("two values");
    if at.architecture().has_circle() { at.with_epsilon(1.0) } else { at }
}

/// Against central differences of the definition, Σ over the maps.
#[test]
fn derivatives_of_the_loss_are_those_of_differences() {
    let pairs = family(1);
    let objective = Objective::new(&Loss::MeanSquaredError, &pairs).expect("weights");
    let by_definition = |model: &Model| -> f64 {
        let (mut sum, mut row) = (0.0, 0);
        for condition in pairs.conditions() {
            let at = member(model, &condition.controls);
            for _ in 0..condition.pairs {
                let mut z = pairs.input()[2 * row..][..2].to_vec();
                at.forward(&mut z);
                for (found, wanted) in z.iter().zip(&pairs.output()[2 * row..]) {
                    sum += (found - wanted) * (found - wanted);
                }
                row += 1;
            }
        }
        sum / (2 * row) as f64
    };
    for model in models() {
        let weights = model.parameters().to_vec();
        let mut gradient = vec![0.0; weights.len()];
        let loss = objective.value_and_gradient(model.composition(), &mut gradient);
        close(loss, by_definition(&model), 1e-13, "loss");
        let equations = objective.normal_equations(model.composition());
        close(equations.loss, loss, 1e-13, "loss of the equations");
        let diagonal = objective.curvature_diagonal(model.composition());
        let h = 1e-5;
        let at = |index: usize, by: f64| {
            let mut weights = weights.clone();
            weights[index] += by;
            model.with_parameters(weights).expect("finite")
        };
        for index in 0..weights.len() {
            let slope = (by_definition(&at(index, h)) - by_definition(&at(index, -h))) / (2.0 * h);
            close(gradient[index], slope, 1e-8, &format!("gradient {index}"));
            close(equations.gradient[index], gradient[index], 1e-12, "both gradients");
            let entry = equations.matrix[(index, index)];
            close(entry, diagonal[index], 1e-12, &format!("diagonal {index}"));
        }
        // 2/N Σ ∂r_i ∂r_j of two parameters far apart, by differences of the maps.
        let moved = |index: usize, by: f64| -> Vec<f64> {
            let (model, mut out, mut row) = (at(index, by), Vec::new(), 0);
            for condition in pairs.conditions() {
                let at = member(&model, &condition.controls);
                for _ in 0..condition.pairs {
                    let mut z = pairs.input()[2 * row..][..2].to_vec();
                    at.forward(&mut z);
                    out.extend(z);
                    row += 1;
                }
            }
            out
        };
        let slopes = |index: usize| -> Vec<f64> {
            let both = moved(index, h).into_iter().zip(moved(index, -h));
            both.map(|(a, b)| (a - b) / (2.0 * h)).collect()
        };
        let last = weights.len() - 1;
        for (row, column) in [(last, 0), (last / 2, 2), (last, last / 3)] {
            let (a, b) = (slopes(row), slopes(column));
            let sum: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
            let wanted = 2.0 * sum / a.len() as f64;
            close(equations.matrix[(row, column)], wanted, 1e-8, &format!("{row}, {column}"));
        }
    }
}

/// Hénon's quadratic map, turned by an angle and kicked by a strength that depend on two controls: exact and symplectic.
fn henon([a, b]: [f64; 2], z: &mut [f64]) {
    let (sin, cos) = (0.7 + 0.05 * a + 0.01 * a * a).sin_cos();
    let p = z[1] - (0.2 + 0.1 * b) * z[0] * z[0];
    (z[0], z[1]) = (cos * z[0] + sin * p, -sin * z[0] + cos * p);
}

fn pairs_of_henon(maps: &[[f64; 2]], count: usize, seed: u64) -> (Pairs, Vec<f64>) {
    let mut stream = Stream::new(seed, "points");
    let (mut input, mut output, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for map in maps {
        for _ in 0..count {
            let mut z = [stream.uniform(-0.4, 0.4), stream.uniform(-0.4, 0.4)];
            input.extend(z);
            henon(*map, &mut z);
            output.extend(z);
            values.extend(map);
        }
    }
    (Pairs::new("pairs", 1, input, output).expect("finite"), values)
}

/// Jolts of third degree and a turn, of which Hénon's map is one.
fn jolts() -> NetworkSpec {
    let block = Block::new(Part::NearIdentity, Layers::TurnedKick(vec![1; 2]));
    NetworkSpec::of_blocks(vec![block.of_polynomials(3)])
}

fn fit() -> Fit {
    let optimiser = Optimiser::LevenbergMarquardt(LevenbergMarquardtOptions::default());
    Fit {
        action: Some(CircleAction::new([1]).into()),
        network: Some(jolts()),
        epsilon: Some(1.0),
        training: TrainingOptions { iterations: 60, optimiser, ..TrainingOptions::default() },
        controls: ControlOptions { names: vec!["a".into(), "b".into()], degree: Some(2) },
        units: false,
        ..Fit::default()
    }
}

/// From a grid of controls to values between them, where the same network without controls knows one map only.
#[test]
fn a_fit_learns_what_the_controls_do() {
    let grid: Vec<[f64; 2]> =
        (0..9).map(|k| [f64::from(k % 3) - 1.0, f64::from(k / 3) - 1.0]).collect();
    let (pairs, values) = pairs_of_henon(&grid, 60, 5);
    let data = FamilyPairs::under(pairs, None, None, Some(&values)).expect("values");
    let fitted = fit().run(data).expect("trains");
    let model = fitted.model();
    let controls = model.architecture().controls.clone().expect("controls");
    assert_eq!(controls.ranges, [range("a", -1.0, 1.0), range("b", -1.0, 1.0)]);
    let error = |at: [f64; 2], of: &dyn Map<f64>| {
        let (pairs, _) = pairs_of_henon(&[at], 50, 6);
        let mut worst = 0.0;
        for (z, w) in pairs.input().chunks_exact(2).zip(pairs.output().chunks_exact(2)) {
            let mut z = z.to_vec();
            of.forward(&mut z);
            worst = max_or_nan(worst, (z[0] - w[0]).hypot(z[1] - w[1]));
        }
        worst
    };
    for at in [[0.5, -0.5], [-0.7, 0.3], [0.1, 0.9]] {
        let (found, nominal) =
            (error(at, &model.at_controls(&at).expect("two values")), error(at, model));
        assert!(found < 2e-4 && nominal > 30.0 * found, "{at:?}: {found:e}, without {nominal:e}");
    }
}
