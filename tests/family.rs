//! Pairs of a family of maps, the loss of a network on them, and invariants by averaging.

use gyroceptron::flow::{Pairs, Window, sample};
use gyroceptron::layer::{CircleAction, TorusAction};
use gyroceptron::network::{GyroceptronShape, HenonShape, InitialWeights, Model, NormalFormShape};
use gyroceptron::phase::Map;
use gyroceptron::random::Stream;
use gyroceptron::system::Oscillators;
use gyroceptron::train::{
    AdamOptions, Control, LbfgsOptions, LevenbergMarquardtOptions, Loss, Objective, Optimiser,
    TrainingOptions, fit_rotation, train,
};
use std::sync::OnceLock;

const TIME: f64 = 4.0;

fn set(count: usize, time: f64, epsilon: f64, seed: u64) -> Pairs {
    let window = Window { low: vec![-1.0; 4], high: vec![1.0; 4], samples: count };
    let points = sample(&[window], 2, &mut Stream::new(seed, "data")).expect("a valid window");
    Pairs::of_flow(&Oscillators { epsilon }, points, time).expect("converges").0
}

/// Sets of different sizes, so that none can be taken for another.
fn sets() -> Vec<(f64, f64, Pairs)> {
    static SETS: OnceLock<Vec<(f64, f64, Pairs)>> = OnceLock::new();
    let made = SETS.get_or_init(|| {
        let maps = [(0.05, 1.0, 30), (0.02, 1.0, 17), (0.05, 2.5, 40)];
        let of = |(seed, (epsilon, time, count)): (usize, (f64, f64, usize))| {
            (epsilon, time, set(count, TIME * time, epsilon, seed as u64))
        };
        maps.into_iter().enumerate().map(of).collect()
    });
    made.clone()
}

fn models() -> Vec<Model> {
    let circles = [CircleAction::new([1, 0]), CircleAction::new([0, 1])];
    let normal_form = |action: TorusAction| {
        NormalFormShape {
            action,
            psi: vec![2],
            kicks: vec![3, 2],
            twists: vec![3, 2, 0],
            turned_twists: vec![],
            flow_time: TIME,
            perturbation: None,
        }
        .architecture(0.05)
    };
    let gyroceptron = GyroceptronShape {
        circle_action: CircleAction::new([1, 0]),
        psi: vec![3; 2],
        near_identity: vec![3; 2],
    }
    .architecture(0.05);
    let all = [
        normal_form(CircleAction::new([1, 0]).into()),
        normal_form(TorusAction::new(circles).expect("two circles")),
        gyroceptron,
    ];
    let weights = InitialWeights::Normal { scale: 0.4 };
    all.iter().map(|a| a.initialise(weights, TIME, 3).expect("valid")).collect()
}

/// The mean over all pairs of the squared error of the map of their condition, in plain
/// loops.
fn by_definition(model: &Model) -> f64 {
    let (mut total, mut count) = (0.0, 0);
    for (epsilon, time, set) in sets() {
        let model = model.with_epsilon_and_time(epsilon, time).expect("finite");
        for (z, target) in set.input().chunks_exact(4).zip(set.output().chunks_exact(4)) {
            let mut w = z.to_vec();
            model.forward(&mut w);
            total += w.iter().zip(target).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
            count += 4;
        }
    }
    total / f64::from(count)
}

fn objective(pairs: &Pairs) -> Objective<'_> {
    Objective::new(&Loss::MeanSquaredError, pairs).expect("valid")
}

fn close(a: f64, b: f64, tolerance: f64, what: &str) {
    assert!((a - b).abs() <= tolerance * a.abs().max(b.abs()).max(1e-3), "{what}: {a:e} {b:e}");
}

#[test]
fn the_loss_of_a_family_is_its_definition() {
    let pairs = Pairs::of_family(sets()).expect("sets");
    assert_eq!((pairs.len(), pairs.conditions().len()), (87, 3));
    for model in models() {
        let loss = objective(&pairs).value(model.composition());
        close(loss, by_definition(&model), 1e-12, "loss");
    }
}

/// Errors in units of εt, on average as before.
#[test]
fn the_loss_of_a_family_may_be_relative() {
    let pairs = Pairs::of_family(sets()).expect("sets").relative().expect("not 0");
    let slow = |epsilon: f64, time: f64| (epsilon * time).powi(-2);
    let mean: f64 =
        sets().iter().map(|(e, t, set)| slow(*e, *t) * set.len() as f64).sum::<f64>() / 87.0;
    let weights: Vec<f64> = pairs.conditions().iter().map(|c| c.weight).collect();
    for model in models() {
        let mut expected = 0.0;
        for ((epsilon, time, set), weight) in sets().iter().zip(&weights) {
            let there = model.with_epsilon_and_time(*epsilon, *time).expect("finite");
            let error = objective(set).value(there.composition());
            close(*weight, slow(*epsilon, *time) / mean, 1e-14, "weight");
            expected += weight * error * set.len() as f64 / 87.0;
        }
        close(objective(&pairs).value(model.composition()), expected, 1e-12, "loss");
        let mut gradient = vec![0.0; model.composition().parameters().len()];
        objective(&pairs).value_and_gradient(model.composition(), &mut gradient);
        let equations = objective(&pairs).normal_equations(model.composition());
        for (a, b) in equations.gradient.iter().zip(&gradient) {
            close(*a, *b, 1e-11, "both gradients");
        }
    }
    assert_eq!(pairs.thinned(20).conditions()[0].weight, weights[0]);
    let still = Pairs::of_family(vec![(0.0, 1.0, sets().remove(0).2)]).expect("a set");
    assert!(still.relative().is_err());
}

/// Against central differences of the definition: angles count as often as their map's
/// flow time has the network's.
#[test]
fn gradient_and_curvature_of_a_family_are_those_of_differences() {
    let pairs = Pairs::of_family(sets()).expect("sets");
    for model in models() {
        let weights = model.composition().parameters().to_vec();
        let mut gradient = vec![0.0; weights.len()];
        objective(&pairs).value_and_gradient(model.composition(), &mut gradient);
        let equations = objective(&pairs).normal_equations(model.composition());
        let diagonal = objective(&pairs).curvature_diagonal(model.composition());
        let h = 1e-5;
        for index in 0..weights.len() {
            let at = |by: f64| {
                let mut weights = weights.clone();
                weights[index] += by;
                by_definition(&model.with_parameters(weights).expect("finite"))
            };
            let slope = (at(h) - at(-h)) / (2.0 * h);
            close(gradient[index], slope, 1e-6, &format!("gradient {index}"));
            close(equations.gradient[index], gradient[index], 1e-11, "both gradients");
            let entry = equations.matrix[(index, index)];
            close(entry, diagonal[index], 1e-11, &format!("diagonal {index}"));
        }
        // Entries of the matrix: 2/N Σ ∂r_i ∂r_j by differences of the maps.
        let last = weights.len() - 1;
        for (row, column) in [(last, last), (last, 0), (last, last / 2), (3, 1)] {
            let (mut sum, mut count) = (0.0, 0);
            for (epsilon, time, set) in sets() {
                let moved = |index: usize, by: f64, z: &[f64]| {
                    let mut weights = weights.clone();
                    weights[index] += by;
                    let model = model.with_parameters(weights).expect("finite");
                    let mut w = z.to_vec();
                    model.with_epsilon_and_time(epsilon, time).expect("finite").forward(&mut w);
                    w
                };
                for z in set.input().chunks_exact(4) {
                    let slope = |index| -> Vec<f64> {
                        let (a, b) = (moved(index, h, z), moved(index, -h, z));
                        a.iter().zip(b).map(|(a, b)| (a - b) / (2.0 * h)).collect()
                    };
                    let (a, b) = (slope(row), slope(column));
                    sum += a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
                    count += 4;
                }
            }
            let expected = 2.0 * sum / f64::from(count);
            close(equations.matrix[(row, column)], expected, 1e-6, &format!("{row}, {column}"));
        }
    }
}

/// A HénonNet has no ε and no flow time to be given.
#[test]
fn a_map_without_circles_is_of_no_family() {
    let shape = HenonShape { dof: 2, widths: vec![3, 2] };
    let net = shape.architecture(1.0);
    let net = net.initialise(InitialWeights::Glorot, 0.0, 1).expect("valid");
    let family = Pairs::of_family(sets()).expect("sets");
    let (input, output) = (family.input().to_vec(), family.output().to_vec());
    let plain = Pairs::new("all", 2, input, output).expect("pairs");
    let (a, b) = (objective(&family), objective(&plain));
    close(a.value(net.composition()), b.value(net.composition()), 1e-13, "loss");
    assert_ne!(family.digest(), plain.digest());
}

/// Whatever is chosen of the pairs is under the condition that it was under.
#[test]
fn rows_keep_their_conditions() {
    let pairs = Pairs::of_family(sets()).expect("sets");
    let of = |pairs: &Pairs| -> Vec<(Vec<u64>, u64, u64)> {
        let mut out = Vec::new();
        let mut rows = pairs.input().chunks_exact(4);
        for condition in pairs.conditions() {
            for z in rows.by_ref().take(condition.pairs) {
                let z = z.iter().map(|v| v.to_bits()).collect();
                out.push((z, condition.epsilon.to_bits(), condition.time.to_bits()));
            }
        }
        assert!(rows.next().is_none());
        out.sort();
        out
    };
    let all = of(&pairs);
    assert_eq!(all.len(), 87);
    let part = pairs.thinned(20);
    assert_eq!((part.len(), of(&part).len()), (20, 20));
    assert!(of(&part).iter().all(|row| all.contains(row)));
    let mixed = pairs.rows([80, 3, 40, 50, 2, 31]);
    assert!(of(&mixed).iter().all(|row| all.contains(row)));
    assert_eq!(mixed.conditions().len(), 3);
    assert_eq!(pairs.rows([1, 2]).conditions().len(), 1);
    let (rest, held_out) = pairs.clone().split(0.3, &mut Stream::new(1, "split"));
    let mut both = of(&rest);
    both.extend(of(&held_out.expect("a third")));
    both.sort();
    assert_eq!(both, all);
    // In any order of rows: by ε and time of each.
    let (epsilons, times): (Vec<f64>, Vec<f64>) =
        (0..set(6, TIME, 0.05, 9).len()).map(|k| ([0.1, 0.2][k % 2], 1.0)).unzip();
    let plain = set(6, TIME, 0.05, 9);
    let under = plain.clone().with_epsilons_and_times(&epsilons, &times).expect("as many");
    assert_eq!(&under.input()[4..8], &plain.input()[8..12]);
    assert_eq!(&under.output()[12..16], &plain.output()[4..8]);
    assert!(plain.clone().with_epsilons_and_times(&epsilons[1..], &times).is_err());
    assert!(plain.clone().with_epsilons_and_times(&epsilons, &[0.0; 6]).is_err());
    assert!(plain.with_epsilons_and_times(&[f64::NAN; 6], &times).is_err());
    assert!(Pairs::of_family(Vec::new()).is_err());
}

/// One set of weights for all maps of a family, and for one that was not among them.
#[test]
fn a_normal_form_learns_a_family() {
    let optimisers = [
        (Optimiser::LevenbergMarquardt(LevenbergMarquardtOptions::default()), 150, 5e-3),
        (Optimiser::Lbfgs(LbfgsOptions::default()), 60, 0.2),
        (Optimiser::Adam(AdamOptions { rate: 0.01, batch: 32, ..Default::default() }), 20, 0.5),
    ];
    let family = |seed: u64| {
        let sets = [(0.06, 1.0), (0.03, 1.0), (0.06, 0.5)];
        let sets = sets.map(|(e, t)| (e, t, set(150, TIME * t, e, seed)));
        Pairs::of_family(sets.to_vec()).expect("sets")
    };
    let shape = NormalFormShape {
        action: CircleAction::new([1, 0]).into(),
        psi: vec![],
        kicks: vec![4; 4],
        twists: vec![4; 6],
        turned_twists: vec![],
        flow_time: TIME,
        perturbation: None,
    };
    let architecture = shape.architecture(0.05);
    let weights = InitialWeights::Normal { scale: 0.15 };
    let model = architecture.initialise(weights, TIME, 3).expect("valid");
    for (optimiser, iterations, share) in optimisers {
        let options = TrainingOptions { optimiser, iterations, ..TrainingOptions::default() };
        let (pairs, held_out) = (family(1), family(2));
        let quiet = &mut |_: gyroceptron::train::Progress<'_>| Ok(Control::Continue);
        let outcome =
            train(&model, &pairs, Some(&held_out), &options, None, quiet).expect("trains");
        let first = outcome.history[0].validation.expect("held out");
        let best = outcome.best.validation.expect("held out");
        assert!(best < share * first, "{:?}: {best:e} of {first:e}", options.optimiser);
        if share < 0.01 {
            let unseen = set(100, TIME * 0.75, 0.045, 5);
            let there = outcome.model.with_epsilon_and_time(0.045, 0.75).expect("finite");
            let error = objective(&unseen).value(there.composition());
            assert!(error < 4.0 * best, "{error:e} {best:e}");
            let wrong = objective(&unseen).value(outcome.model.composition());
            assert!(wrong > 100.0 * best, "{wrong:e}");
        }
    }
}

/// Whole periods of a circle are found from shorter times: of weight 2, a period is π.
#[test]
fn the_frequency_of_a_family_is_found() {
    for (weight, frequency) in [(1, 0.9), (2, 0.4), (2, 1.9), (-3, 0.7)] {
        let action = CircleAction::new([0, weight]);
        let turned = |time: f64| {
            let mut stream = Stream::new(8, "points");
            let points: Vec<f64> = (0..80).map(|_| stream.uniform(-1.0, 1.0)).collect();
            let mut moved = points.clone();
            let turn = action.turn_by(frequency * time);
            moved.chunks_exact_mut(4).for_each(|z| turn.apply(z, false));
            Pairs::new("turned", 2, points, moved).expect("pairs")
        };
        let times = [0.5, 1.0, 2.5, 7.3];
        let sets = times.map(|time| (0.01, time, turned(time))).to_vec();
        let found = fit_rotation(&Pairs::of_family(sets).expect("sets"), &action);
        assert!((found - frequency).abs() < 1e-7, "{weight}: {found} for {frequency}");
        let alone = fit_rotation(&turned(1.0), &action);
        let period = std::f64::consts::TAU / f64::from(weight).abs();
        assert!(alone.abs() <= 0.5 * period + 1e-9, "{alone}");
        let rest = ((alone - frequency) / period).rem_euclid(1.0);
        assert!(rest.min(1.0 - rest) < 1e-7, "{weight}: {alone} for {frequency}");
    }
}

#[test]
fn the_angles_of_circles_are_those_of_the_action_that_they_make() {
    let torus = |circles: &[&[i32]]| {
        let circles: Vec<_> = circles.iter().map(|m| CircleAction::new(*m)).collect();
        TorusAction::new(circles).expect("circles of one size")
    };
    let action = CircleAction::new([0, 1, 2]);
    let multiples = |circles: &[&[i32]]| torus(circles).multiples_of::<f64>(&action);
    for (circles, expected) in [
        (&[&[0, 1, 2][..]][..], vec![1.0]),
        (&[&[0, 1, 0], &[0, 0, 2]], vec![1.0, 1.0]),
        (&[&[0, 1, 0], &[0, 0, 1]], vec![1.0, 2.0]),
        (&[&[0, -2, -4]], vec![-0.5]),
    ] {
        // To the bit: the angles that training starts from are no matter of rounding.
        assert_eq!(multiples(circles), Some(expected), "{circles:?}");
    }
    // A plane too few, one too many, another ratio, and a plane of two circles.
    let unfit: [&[&[i32]]; 5] = [
        &[&[0, 1, 0]],
        &[&[0, 1, 0], &[1, 0, 2]],
        &[&[0, 1, 1]],
        &[&[0, 1, 1], &[0, 0, 1]],
        &[&[0, 1, 2], &[0, 0, 0]],
    ];
    for circles in unfit {
        assert_eq!(multiples(circles), None, "{circles:?}");
    }
    assert_eq!(torus(&[&[0, 1, 1], &[0, 0, 1]]).shared_plane(), Some(2));
    assert_eq!(torus(&[&[0, 1, 0], &[0, 0, 1]]).shared_plane(), None);
}
