//! Losses, gradients, L-BFGS, checkpoints.

use gyroceptron::flow::{Pairs, Window, sample};
use gyroceptron::layer::CircleAction;
use gyroceptron::network::{
    Architecture, Gyroceptron, GyroceptronShape, HenonShape, InitialWeights, Model,
};
use gyroceptron::phase::Map;
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Dual, max_or_nan};
use gyroceptron::system::Oscillators;
use gyroceptron::train::{
    Checkpoint, Control, Loss, Objective, Outcome, Progress, Scaling, Stop, TrainingOptions,
    fit_rotation, train,
};

fn pairs(count: usize, time: f64, seed: u64) -> Pairs {
    let window = Window { low: vec![-1.6; 4], high: vec![1.6; 4], samples: count };
    let points = sample(&[window], 2, &mut Stream::new(seed, "data")).expect("a valid window");
    Pairs::of_flow(&Oscillators { epsilon: 0.01 }, points, time).expect("converges").0
}

fn model(seed: u64) -> Model {
    Architecture::Gyroceptron {
        shape: GyroceptronShape {
            circle_action: CircleAction::new([1, 0]),
            psi: vec![4; 3],
            near_identity: vec![3; 3],
        },
        epsilon: 0.01,
    }
    .initialise(InitialWeights::Normal { scale: 0.2 }, 0.5, seed)
    .expect("valid")
}

fn quiet(_: Progress<'_>) -> Result<Control, gyroceptron::Error> {
    Ok(Control::Continue)
}

fn options(iterations: u64) -> TrainingOptions {
    TrainingOptions {
        iterations,
        scaling: Scaling::GaussNewton { renew: 20 },
        validate_every: 7,
        checkpoint_every: 5,
        ..TrainingOptions::default()
    }
}

fn bits(model: &Model) -> Vec<u64> {
    model.composition().parameters().iter().map(|v| v.to_bits()).collect()
}

/// Loss by its definition, in plain loops over points.
fn by_definition(model: &Model, pairs: &Pairs, weights: &[f64]) -> f64 {
    let mut total = 0.0;
    for (z, target) in pairs.input().chunks_exact(4).zip(pairs.output().chunks_exact(4)) {
        let mut w = z.to_vec();
        model.forward(&mut w);
        for c in 0..4 {
            total += weights[c] * (w[c] - target[c]).powi(2);
        }
    }
    total / pairs.len() as f64
}

#[test]
fn losses_are_their_definitions() {
    // A ragged tail in lanes and in blocks.
    for count in [1, 5, 8, 1030] {
        let pairs = pairs(count, 0.5, 3);
        let model = model(1);
        for (loss, weights) in [
            (Loss::MeanSquaredError, [0.25; 4]),
            (Loss::Weighted { weights: vec![0.01, 1.0] }, [0.01, 1.0, 0.01, 1.0]),
        ] {
            let objective = Objective::new(&loss, &pairs).expect("valid weights");
            let expected = by_definition(&model, &pairs, &weights);
            let value = objective.value(model.composition());
            assert!((value - expected).abs() <= 1e-13 * expected, "{value:e} for {expected:e}");
            let mut gradient = vec![0.0; model.composition().parameters().len()];
            let again = objective.value_and_gradient(model.composition(), &mut gradient);
            assert_eq!(value.to_bits(), again.to_bits());
        }
    }
}

#[test]
fn gradient_and_curvature_are_those_of_duals() {
    let pairs = pairs(37, 0.5, 4);
    let model = model(2);
    let loss = Loss::Weighted { weights: vec![0.3, 1.0] };
    let weights = [0.3, 1.0, 0.3, 1.0];
    let objective = Objective::new(&loss, &pairs).expect("valid weights");
    let count = model.composition().parameters().len();
    let mut gradient = vec![0.0; count];
    objective.value_and_gradient(model.composition(), &mut gradient);
    let curvature = objective.curvature_diagonal(model.composition());
    let network = model.gyroceptron().expect("a gyroceptron");
    type D = Dual<f64, 1>;
    for index in 0..count {
        let lifted = model
            .composition()
            .parameters()
            .iter()
            .enumerate()
            .map(|(i, &p)| D::variable(p, if i == index { 0 } else { 1 }))
            .collect();
        let epsilon = D::constant(0.01);
        let dual = Gyroceptron::new(network.shape().clone(), epsilon, lifted).expect("same shape");
        let (mut slope, mut square) = (0.0, 0.0);
        for (z, target) in pairs.input().chunks_exact(4).zip(pairs.output().chunks_exact(4)) {
            let mut w: Vec<D> = z.iter().map(|&v| D::constant(v)).collect();
            dual.forward(&mut w);
            for c in 0..4 {
                slope += 2.0 * weights[c] * (w[c].re - target[c]) * w[c].eps[0];
                square += 2.0 * weights[c] * w[c].eps[0] * w[c].eps[0];
            }
        }
        let (slope, square) = (slope / pairs.len() as f64, square / pairs.len() as f64);
        assert!((gradient[index] - slope).abs() <= 1e-13 * (1e-3 + slope.abs()), "{index}");
        assert!((curvature[index] - square).abs() <= 1e-12 * (1e-9 + square), "{index}");
    }
}

#[test]
fn training_lowers_the_held_out_error_and_keeps_the_best() {
    let (pairs, held_out) = (pairs(512, 0.5, 5), pairs(256, 0.5, 6));
    let model = model(3);
    let outcome = train(&model, &pairs, Some(&held_out), &options(60), None, &mut quiet)
        .expect("training runs");
    assert_eq!(outcome.stop, Stop::Iterations);
    assert_eq!(outcome.history.len(), 61);
    let first = outcome.history[0].validation.expect("evaluated at the start");
    let best = outcome.best.validation.expect("evaluated");
    assert!(best < 0.5 * first, "{best:e} from {first:e}");
    for pair in outcome.history.windows(2) {
        assert!(pair[1].loss < pair[0].loss);
        assert!(pair[1].evaluations > pair[0].evaluations);
        assert_eq!(
            pair[1].validation.is_some(),
            pair[1].iteration % 7 == 0 || pair[1].iteration == 60
        );
    }
    let objective = Objective::new(&Loss::MeanSquaredError, &held_out).expect("valid");
    assert_eq!(objective.value(outcome.model.composition()), best);
    let validations = outcome.history.iter().filter_map(|r| r.validation);
    let lowest = -validations.map(|v| -v).fold(f64::NEG_INFINITY, max_or_nan);
    assert_eq!(best, lowest);
}

#[test]
fn scaled_variables_get_further_than_plain_ones() {
    // A short time and a small ε: sensitivities differ by orders of magnitude.
    let pairs = pairs(500, 0.05, 5);
    let shape = GyroceptronShape {
        circle_action: CircleAction::new([1, 0]),
        psi: vec![6; 6],
        near_identity: vec![6; 6],
    };
    let model = Architecture::Gyroceptron { shape, epsilon: 0.01 }
        .initialise(InitialWeights::Normal { scale: 0.15 }, 0.05, 1)
        .expect("valid");
    let end = |scaling| {
        let options = TrainingOptions { scaling, ..options(400) };
        let outcome = train(&model, &pairs, None, &options, None, &mut quiet).expect("runs");
        outcome.best.loss
    };
    let (plain, scaled) = (end(Scaling::None), end(Scaling::GaussNewton { renew: 100 }));
    assert!(scaled < 0.75 * plain, "scaled {scaled:e}, plain {plain:e}");
}

/// Trains to `iterations`, collecting all checkpoints.
fn with_checkpoints(iterations: u64) -> (Outcome, Vec<Checkpoint>) {
    let (pairs, held_out) = (pairs(300, 0.5, 5), pairs(100, 0.5, 6));
    let mut kept = Vec::new();
    let outcome = train(&model(3), &pairs, Some(&held_out), &options(iterations), None, &mut |p| {
        kept.extend(p.checkpoint.cloned());
        Ok(Control::Continue)
    })
    .expect("runs");
    (outcome, kept)
}

#[test]
fn a_run_resumes_to_the_same_bits_from_any_checkpoint() {
    let (pairs, held_out) = (pairs(300, 0.5, 5), pairs(100, 0.5, 6));
    let (whole, checkpoints) = with_checkpoints(52);
    // In the middle of a segment, at its end (20, 40), and at the end of all.
    assert_eq!(checkpoints.len(), 11);
    for checkpoint in checkpoints {
        // Through its text, as a file holds it.
        let text = serde_json::to_string(&checkpoint).expect("serialises");
        let read: Checkpoint = serde_json::from_str(&text).expect("reads back");
        let at = read.last().iteration;
        let resumed =
            train(&model(3), &pairs, Some(&held_out), &options(52), Some(read), &mut quiet)
                .expect("resumes");
        assert_eq!(bits(&resumed.model), bits(&whole.model), "from iteration {at}");
        assert_eq!(resumed.history, whole.history, "from iteration {at}");
    }
    // A run that was asked for fewer iterations goes on to more as if nothing
    // had been.
    for fewer in [33, 40] {
        let (_, shorter) = with_checkpoints(fewer);
        let last = shorter.into_iter().last().expect("one at the end");
        assert_eq!(last.last().iteration, fewer);
        let longer =
            train(&model(3), &pairs, Some(&held_out), &options(52), Some(last), &mut quiet)
                .expect("resumes");
        assert_eq!(bits(&longer.model), bits(&whole.model), "from {fewer}");
        assert_eq!(longer.history, whole.history, "from {fewer}");
    }
}

#[test]
fn an_interrupted_run_leaves_a_checkpoint_to_resume_from() {
    let (pairs, held_out) = (pairs(300, 0.5, 5), pairs(100, 0.5, 6));
    let (whole, _) = with_checkpoints(52);
    for stop_at in [1, 20, 23, 25] {
        let mut last = None;
        let outcome = train(&model(3), &pairs, Some(&held_out), &options(52), None, &mut |p| {
            if let Some(checkpoint) = p.checkpoint {
                last = Some(checkpoint.clone());
            }
            Ok(if p.record.iteration == stop_at { Control::Interrupt } else { Control::Continue })
        })
        .expect("stops");
        assert_eq!(outcome.stop, Stop::Interrupted);
        let checkpoint = last.expect("a checkpoint");
        assert_eq!(checkpoint.last().iteration, stop_at);
        let resumed =
            train(&model(3), &pairs, Some(&held_out), &options(52), Some(checkpoint), &mut quiet)
                .expect("resumes");
        assert_eq!(bits(&resumed.model), bits(&whole.model), "stopped at {stop_at}");
    }
}

#[test]
fn a_checkpoint_of_another_run_is_refused() {
    let (pairs_5, held_out) = (pairs(300, 0.5, 5), pairs(100, 0.5, 6));
    let (_, checkpoints) = with_checkpoints(10);
    let checkpoint = &checkpoints[0];
    let refuse = |model: &Model, pairs: &Pairs, options: &TrainingOptions, word: &str| {
        let resume = Some(checkpoint.clone());
        let error = train(model, pairs, Some(&held_out), options, resume, &mut quiet)
            .expect_err("another run")
            .to_string();
        assert!(error.contains(word), "{error}");
    };
    refuse(&model(4), &pairs_5, &options(10), "initial weights");
    refuse(&model(3), &pairs(300, 0.5, 7), &options(10), "training pairs");
    let other = TrainingOptions { memory: 5, ..options(10) };
    refuse(&model(3), &pairs_5, &other, "options");
}

/// The sums of loss, gradient and curvature are those of blocks of 1024 pairs, however
/// many blocks a task has, which is for the number of threads to say.
#[test]
fn blocks_are_summed_alike_in_tasks_of_any_size() {
    let model = model(3);
    let map = model.composition();
    let all = pairs(20_003, 0.5, 5);
    let evaluate = |pairs: &Pairs| {
        let objective = Objective::new(&Loss::MeanSquaredError, pairs).expect("weights");
        let mut sums = vec![0.0; map.parameters().len()];
        let value = objective.value_and_gradient(map, &mut sums);
        assert_eq!(value.to_bits(), objective.value(map).to_bits());
        sums.push(value);
        sums.extend(objective.curvature_diagonal(map));
        sums
    };
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("a thread pool").install(|| evaluate(&all))
    };
    let one = with_threads(1);
    for threads in [2, 3, 16] {
        assert!(one == with_threads(threads), "{threads} threads");
    }
    // The mean over blocks, each by itself, up to the rounding of the division.
    let mut means = vec![0.0; one.len()];
    let dim = 2 * map.dof();
    for (input, output) in all.input().chunks(1024 * dim).zip(all.output().chunks(1024 * dim)) {
        let block = Pairs::new("block", map.dof(), input.to_vec(), output.to_vec());
        let share = (input.len() / dim) as f64 / all.len() as f64;
        let of_block = evaluate(&block.expect("finite"));
        means.iter_mut().zip(of_block).for_each(|(mean, value)| *mean += share * value);
    }
    for (index, (mean, value)) in means.iter().zip(&one).enumerate() {
        let size = one[map.parameters().len()];
        assert!((mean - value).abs() <= 1e-12 * (value.abs() + size), "{index}: {mean} {value}");
    }
}

#[test]
fn threads_do_not_change_the_bits() {
    let run = |threads| {
        let pool =
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool");
        pool.install(|| {
            let pairs = pairs(3000, 0.5, 5);
            let outcome = train(&model(3), &pairs, None, &options(25), None, &mut quiet);
            bits(&outcome.expect("runs").model)
        })
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(3));
}

#[test]
fn training_stops_for_the_reason_asked_for() {
    let (pairs, held_out) = (pairs(300, 0.5, 5), pairs(100, 0.5, 6));
    let run = |options: TrainingOptions| {
        train(&model(3), &pairs, Some(&held_out), &options, None, &mut quiet).expect("runs")
    };
    let target = run(TrainingOptions { target: 1e-4, ..options(500) });
    assert_eq!(target.stop, Stop::Target);
    assert!(target.best.validation.expect("evaluated") <= 1e-4);
    let gradient = run(TrainingOptions { gradient_tolerance: 1e-4, ..options(500) });
    assert_eq!(gradient.stop, Stop::Gradient);
    let last = gradient.history.last().expect("a record");
    assert!(last.gradient <= 1e-4 && last.iteration < 500);
    // A handful of pairs is overfitted: the held-out error turns.
    let few = pairs_of_three();
    let patience = TrainingOptions { patience: 3, validate_every: 1, ..options(3000) };
    let outcome = train(&model(3), &few, Some(&held_out), &patience, None, &mut quiet);
    let outcome = outcome.expect("runs");
    assert_eq!(outcome.stop, Stop::Patience);
    let best = outcome.best.iteration;
    assert_eq!(outcome.history.len() as u64, best + 3 + 1);
}

/// Basin would stop after 1000 iterations of one memory on its own.
#[test]
fn plain_lbfgs_is_not_restarted() {
    let pairs = pairs(8, 0.5, 5);
    let architecture = Architecture::HenonNet { shape: HenonShape::uniform(2, 1, 2), epsilon: 1.0 };
    let model =
        architecture.initialise(InitialWeights::Normal { scale: 0.2 }, 0.0, 1).expect("valid");
    let options = TrainingOptions {
        scaling: Scaling::None,
        memory: 1,
        checkpoint_every: 1001,
        ..options(1001)
    };
    let mut held = None;
    let outcome = train(&model, &pairs, None, &options, None, &mut |p| {
        held = p.checkpoint.cloned().or(held.take());
        Ok(Control::Continue)
    })
    .expect("runs");
    if outcome.stop == Stop::Iterations {
        let text = serde_json::to_string(&held.expect("one at the end")).expect("serialises");
        let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(json["segment_iterations"], 1001);
    } else {
        panic!("stopped at {} for {:?}", outcome.history.len(), outcome.stop);
    }
}

fn pairs_of_three() -> Pairs {
    pairs(3, 0.5, 8)
}

#[test]
fn a_perfect_start_stalls_at_once() {
    // Pairs of the model itself: loss 0, no step lowers it.
    let model = model(3);
    let input = pairs(50, 0.5, 5).input().to_vec();
    let mut output = input.clone();
    for z in output.chunks_exact_mut(4) {
        model.forward(z);
    }
    let of_the_user = Pairs::new("own", 2, input, output).expect("finite");
    let outcome = train(&model, &of_the_user, None, &options(50), None, &mut quiet).expect("runs");
    assert!(matches!(outcome.stop, Stop::Stalled | Stop::Gradient));
    assert_eq!(outcome.best.loss, 0.0);
    assert_eq!(bits(&outcome.model), bits(&model));
}

#[test]
fn henon_nets_train_too() {
    let architecture = Architecture::HenonNet { shape: HenonShape::uniform(2, 4, 4), epsilon: 1.0 };
    let model =
        architecture.initialise(InitialWeights::Normal { scale: 0.2 }, 0.0, 1).expect("valid");
    let pairs = pairs(300, 0.5, 5);
    let outcome = train(&model, &pairs, None, &options(100), None, &mut quiet).expect("runs");
    assert!(outcome.best.loss < 0.02 * outcome.history[0].loss);
}

#[test]
fn bad_options_and_shapes_are_refused() {
    let pairs = pairs(10, 0.5, 5);
    let fails = |options: TrainingOptions| {
        assert!(train(&model(3), &pairs, None, &options, None, &mut quiet).is_err());
    };
    fails(TrainingOptions { memory: 0, ..options(5) });
    fails(TrainingOptions { validate_every: 0, ..options(5) });
    fails(TrainingOptions { checkpoint_every: 0, ..options(5) });
    fails(TrainingOptions { target: f64::NAN, ..options(5) });
    fails(TrainingOptions { gradient_tolerance: -1.0, ..options(5) });
    fails(TrainingOptions { scaling: Scaling::GaussNewton { renew: 0 }, ..options(5) });
    fails(TrainingOptions { loss: Loss::Weighted { weights: vec![1.0] }, ..options(5) });
    fails(TrainingOptions { loss: Loss::Weighted { weights: vec![1.0, f64::NAN] }, ..options(5) });
    let one_dof = Pairs::new("one", 1, vec![0.0, 1.0], vec![1.0, 0.0]).expect("finite");
    assert!(train(&model(3), &one_dof, None, &options(5), None, &mut quiet).is_err());
    for (input, output) in [
        (vec![], vec![]),
        (vec![0.0; 3], vec![0.0; 3]),
        (vec![0.0; 4], vec![0.0; 8]),
        (vec![0.0, f64::NAN, 0.0, 0.0], vec![0.0; 4]),
        (vec![0.0; 4], vec![0.0, f64::INFINITY, 0.0, 0.0]),
    ] {
        assert!(Pairs::new("bad", 2, input, output).is_err());
    }
}

#[test]
fn a_diverging_start_is_an_error() {
    let architecture = Architecture::HenonNet { shape: HenonShape::uniform(2, 1, 2), epsilon: 1.0 };
    // [W (2 × 2), b, w, η]: increments whose squares overflow.
    let parameters = [[0.1; 6].as_slice(), &[1e300; 2], &[0.0; 2]].concat();
    let model = Model::new(architecture, parameters).expect("finite");
    assert!(train(&model, &pairs(10, 0.5, 5), None, &options(5), None, &mut quiet).is_err());
}

#[test]
fn the_rotation_of_the_data_is_found() {
    for (time, weights) in [(0.05, vec![1, 0]), (2.5, vec![1, 0]), (5.0, vec![1, 0])] {
        let action = CircleAction::new(weights);
        let theta = fit_rotation(&pairs(500, time, 9), &action);
        let turns = (theta - time) / std::f64::consts::TAU;
        assert!((turns - turns.round()).abs() < 0.01, "{theta} for {time}");
    }
    // Several harmonics, exactly rotated.
    let action = CircleAction::new([1, 3, -2]);
    let mut stream = Stream::new(1, "points");
    let input: Vec<f64> = (0..600).map(|_| stream.uniform(-1.0, 1.0)).collect();
    let mut output = input.clone();
    let rotation = action.at(-1.234);
    for z in output.chunks_exact_mut(6) {
        rotation.apply(z, false);
    }
    let rotated = Pairs::new("rotated", 3, input, output).expect("finite");
    assert!((fit_rotation(&rotated, &action) + 1.234).abs() < 1e-7);
}

#[test]
fn splitting_pairs_keeps_every_row_once() {
    let all = pairs(101, 0.5, 5);
    let (kept, held) = all.clone().split(0.2, &mut Stream::new(1, "split"));
    let held = held.expect("some are held out");
    assert_eq!((kept.len(), held.len()), (81, 20));
    let mut rows: Vec<Vec<u64>> = kept
        .input()
        .chunks_exact(4)
        .chain(held.input().chunks_exact(4))
        .map(|row| row.iter().map(|v| v.to_bits()).collect())
        .collect();
    let mut expected: Vec<Vec<u64>> =
        all.input().chunks_exact(4).map(|row| row.iter().map(|v| v.to_bits()).collect()).collect();
    rows.sort();
    expected.sort();
    assert_eq!(rows, expected);
    assert!(pairs(1, 0.5, 5).split(0.9, &mut Stream::new(1, "split")).1.is_none());
}
