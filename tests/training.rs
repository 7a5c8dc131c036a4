//! Losses, gradients, checkpoints, and how trainings end.

use gyroceptron::flow::{Pairs, Window, sample};
use gyroceptron::layer::{CircleAction, Reversor};
use gyroceptron::measure::trajectories::rotation_errors;
use gyroceptron::network::{
    Architecture, Block, GyroceptronShape, HenonShape, InitialWeights, Layers, Model,
    NormalFormShape, Part, Scale,
};
use gyroceptron::phase::Map;
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Dual, max_or_nan};
use gyroceptron::system::Oscillators;
use gyroceptron::train::{
    AdamOptions, Checkpoint, Control, LbfgsOptions, LevenbergMarquardtOptions, Loss, Objective,
    Optimiser, Outcome, Plateau, Progress, Scaling, Stop, TrainingOptions, TrainingRecord,
    fit_rotation, train,
};

pub(crate) fn pairs(count: usize, time: f64, seed: u64) -> Pairs {
    let window = Window { low: vec![-1.6; 4], high: vec![1.6; 4], samples: count };
    let points = sample(&[window], 2, &mut Stream::new(seed, "data")).expect("a valid window");
    Pairs::of_flow(&Oscillators { epsilon: 0.01 }, points, time).expect("converges").0
}

pub(crate) fn model(seed: u64) -> Model {
    GyroceptronShape {
        circle_action: CircleAction::new([1, 0]),
        psi: vec![4; 3],
        near_identity: vec![3; 3],
    }
    .architecture(0.01)
    .initialise(InitialWeights::Normal { scale: 0.2 }, 0.5, seed)
    .expect("valid")
}

pub(crate) fn quiet(_: Progress<'_>) -> Result<Control, gyroceptron::Error> {
    Ok(Control::Continue)
}

pub(crate) fn lbfgs(memory: usize, scaling: Scaling) -> Optimiser {
    Optimiser::Lbfgs(LbfgsOptions { memory, scaling })
}

/// Each optimiser, so that all it can do happens in 52 iterations on 300 pairs:
/// L-BFGS renews its scaling, Levenberg–Marquardt begins with a part of the pairs, a
/// batch of Adam is a part of them.
pub(crate) fn optimisers() -> [Optimiser; 3] {
    let marquardt = LevenbergMarquardtOptions { residuals: 2.0, gap: 1.05, ..Default::default() };
    [
        lbfgs(30, Scaling::GaussNewton { renew: 20 }),
        Optimiser::LevenbergMarquardt(marquardt),
        Optimiser::Adam(AdamOptions { rate: 0.01, batch: 64, plateau: 2, ..Default::default() }),
    ]
}

pub(crate) fn options(iterations: u64) -> TrainingOptions {
    TrainingOptions {
        iterations,
        optimiser: lbfgs(30, Scaling::GaussNewton { renew: 20 }),
        validate_every: 7,
        checkpoint_every: 5,
        ..TrainingOptions::default()
    }
}

pub(crate) fn bits(model: &Model) -> Vec<u64> {
    model.composition().parameters().iter().map(|v| v.to_bits()).collect()
}

/// Loss by its definition, in plain loops over points.
pub(crate) fn by_definition(model: &Model, pairs: &Pairs, weights: &[f64]) -> f64 {
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
    let network = &model;
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
        let dual =
            Model::at_epsilon(network.architecture().clone(), epsilon, lifted).expect("same shape");
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

/// Trains to `iterations`, collecting all checkpoints.
pub(crate) fn with_checkpoints(
    optimiser: &Optimiser,
    iterations: u64,
) -> (Outcome, Vec<Checkpoint>) {
    let (pairs, held_out) = (pairs(300, 0.5, 5), pairs(100, 0.5, 6));
    let mut kept = Vec::new();
    let options = TrainingOptions { optimiser: optimiser.clone(), ..options(iterations) };
    let outcome = train(&model(3), &pairs, Some(&held_out), &options, None, &mut |p| {
        kept.extend(p.checkpoint.cloned());
        Ok(Control::Continue)
    })
    .expect("runs");
    (outcome, kept)
}

/// Goes on to 52 iterations from a checkpoint, through its text, as a file holds it.
fn resume(optimiser: &Optimiser, checkpoint: &Checkpoint) -> Outcome {
    let (pairs, held_out) = (pairs(300, 0.5, 5), pairs(100, 0.5, 6));
    let text = serde_json::to_string(checkpoint).expect("serialises");
    let read: Checkpoint = serde_json::from_str(&text).expect("reads back");
    let options = TrainingOptions { optimiser: optimiser.clone(), ..options(52) };
    train(&model(3), &pairs, Some(&held_out), &options, Some(read), &mut quiet).expect("resumes")
}

#[test]
fn a_run_resumes_to_the_same_bits_from_any_checkpoint() {
    for optimiser in &optimisers() {
        let (whole, checkpoints) = with_checkpoints(optimiser, 52);
        // In the middle of a segment, at its end (20, 40), and at the end of all.
        assert_eq!(checkpoints.len(), 11);
        // A run that was asked for fewer iterations goes on to more as if nothing had
        // been.
        let shorter = [33, 40].map(|fewer| {
            let last = with_checkpoints(optimiser, fewer).1.pop().expect("one at the end");
            assert_eq!(last.last().iteration, fewer);
            last
        });
        for checkpoint in checkpoints.iter().chain(&shorter) {
            let at = format!("{} from {}", optimiser.name(), checkpoint.last().iteration);
            let resumed = resume(optimiser, checkpoint);
            assert_eq!(bits(&resumed.model), bits(&whole.model), "{at}");
            assert_eq!(resumed.history, whole.history, "{at}");
            assert_eq!(resumed.curvatures, whole.curvatures, "{at}");
        }
    }
}

#[test]
fn an_interrupted_run_leaves_a_checkpoint_to_resume_from() {
    let (pairs, held_out) = (pairs(300, 0.5, 5), pairs(100, 0.5, 6));
    for optimiser in &optimisers() {
        let (whole, _) = with_checkpoints(optimiser, 52);
        for stop_at in [1, 20, 23, 25] {
            let mut last = None;
            let options = TrainingOptions { optimiser: optimiser.clone(), ..options(52) };
            let outcome = train(&model(3), &pairs, Some(&held_out), &options, None, &mut |p| {
                if let Some(checkpoint) = p.checkpoint {
                    last = Some(checkpoint.clone());
                }
                let stop = p.record.iteration == stop_at;
                Ok(if stop { Control::Interrupt } else { Control::Continue })
            })
            .expect("stops");
            assert_eq!(outcome.stop, Stop::Interrupted);
            let checkpoint = last.expect("a checkpoint");
            assert_eq!(checkpoint.last().iteration, stop_at);
            let resumed = resume(optimiser, &checkpoint);
            assert_eq!(bits(&resumed.model), bits(&whole.model), "stopped at {stop_at}");
        }
    }
}

#[test]
fn a_checkpoint_of_another_run_is_refused() {
    let (pairs_5, held_out) = (pairs(300, 0.5, 5), pairs(100, 0.5, 6));
    let (_, checkpoints) = with_checkpoints(&options(10).optimiser, 10);
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
    let scaling = Scaling::GaussNewton { renew: 20 };
    let other = TrainingOptions { optimiser: lbfgs(5, scaling), ..options(10) };
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
    for optimiser in &optimisers() {
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("a thread pool").install(|| {
                let pairs = pairs(3000, 0.5, 5);
                let options = TrainingOptions { optimiser: optimiser.clone(), ..options(25) };
                let outcome = train(&model(3), &pairs, None, &options, None, &mut quiet);
                bits(&outcome.expect("runs").model)
            })
        };
        let one = run(1);
        assert_eq!(one, run(2), "{}", optimiser.name());
        assert_eq!(one, run(3), "{}", optimiser.name());
    }
}

/// The penalty draws I_ε to the identity and is refused where there is none.
#[test]
fn the_penalty_keeps_the_map_near_the_identity() {
    let pairs = pairs(300, 0.5, 5);
    for optimiser in optimisers() {
        let moved = |penalty| {
            let near_identity_penalty = penalty;
            let optimiser = optimiser.clone();
            let options = TrainingOptions { optimiser, near_identity_penalty, ..options(60) };
            let outcome = train(&model(3), &pairs, None, &options, None, &mut quiet);
            let network = outcome.expect("runs").model;
            let mut square = 0.0;
            for z in pairs.input().chunks_exact(4) {
                let mut near = z.to_vec();
                network.near_identity().forward(&mut near);
                square += near.iter().zip(z).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
            }
            square
        };
        let (free, penalised) = (moved(0.0), moved(1e3));
        assert!(penalised < 0.05 * free, "{}: {penalised:e} {free:e}", optimiser.name());
    }
    let shape = HenonShape::uniform(2, 1, 2);
    let net = shape
        .architecture(1.0)
        .initialise(InitialWeights::Normal { scale: 0.2 }, 0.0, 1)
        .expect("valid");
    let options = TrainingOptions { near_identity_penalty: 1.0, ..options(5) };
    let refused = train(&net, &pairs, None, &options, None, &mut quiet);
    assert!(refused.expect_err("no I_ε").to_string().contains("near_identity_penalty"));
}

/// The penalty of a nearly-integrable map is on χ∘K_ε∘χ⁻¹, by its definition and to first order by differences; it
/// draws K_ε to the identity, whatever the part of χ; a reversible map has none.
#[test]
fn the_penalty_of_a_nearly_integrable_map_is_on_its_perturbation() {
    let action = CircleAction::new([1, 2]);
    let shape = NormalFormShape {
        action: action.into(),
        psi: vec![3],
        kicks: vec![3, 2],
        twists: vec![3, 2],
        turned_twists: vec![],
        flow_time: 0.5,
        perturbation: Some(vec![3, 3]),
    };
    let start = shape
        .architecture(0.5)
        .initialise(InitialWeights::Normal { scale: 0.3 }, 0.5, 3)
        .expect("valid");
    let (pairs, penalty) = (pairs(200, 0.5, 5), 0.7);
    let moved = |model: &Model| {
        let [chart, _] = model.chart_and_inner_map();
        let perturbation = model.part(Part::Perturbation);
        let mut square = 0.0;
        for z in pairs.input().chunks_exact(4) {
            let mut w = z.to_vec();
            chart.inverse(&mut w);
            perturbation.forward(&mut w);
            chart.forward(&mut w);
            square += w.iter().zip(z).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        }
        square / pairs.input().len() as f64
    };
    let plain = Objective::new(&Loss::MeanSquaredError, &pairs).expect("valid");
    let penalised = plain.clone().with_near_identity_penalty(penalty, &start).expect("valid");
    let expected = plain.value(start.composition()) + penalty * moved(&start);
    let value = penalised.value(start.composition());
    assert!((value - expected).abs() < 1e-13 * expected, "{value:e} {expected:e}");
    assert!(moved(&start) > 1e-3, "a penalty of {:e} shows nothing", moved(&start));

    let mut gradient = vec![0.0; start.parameters().len()];
    penalised.value_and_gradient(start.composition(), &mut gradient);
    let along: Vec<f64> = (0..gradient.len()).map(|k| ((3 * k) % 7) as f64 - 3.0).collect();
    let at = |step: f64| {
        let beside = start.parameters().iter().zip(&along).map(|(p, d)| p + step * d).collect();
        penalised.value(&start.composition().with_parameters(beside, 0.5).expect("as many"))
    };
    let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
    let slope: f64 = gradient.iter().zip(&along).map(|(g, d)| g * d).sum();
    assert!((slope - difference).abs() < 1e-7 * slope.abs(), "{slope:e} {difference:e}");

    for optimiser in optimisers() {
        let after = |near_identity_penalty| {
            let optimiser = optimiser.clone();
            let options = TrainingOptions { optimiser, near_identity_penalty, ..options(60) };
            let outcome = train(&start, &pairs, None, &options, None, &mut quiet);
            moved(&outcome.expect("runs").model)
        };
        let (free, held) = (after(0.0), after(1e3));
        assert!(held < 0.05 * free, "{}: {held:e} {free:e}", optimiser.name());
    }

    let reversible = Architecture::new(2)
        .on_circle(CircleAction::new([1, 2]))
        .at_epsilon(0.5)
        .reversible(Some(Reversor::Positions))
        .with(Block::new(Part::SlowMap, Layers::Twist(vec![3])).scaled(Scale::Time))
        .with(Block::new(Part::Perturbation, Layers::TurnedKick(vec![3])));
    let reversible = reversible.initialise(InitialWeights::Glorot, 0.5, 3).expect("valid");
    let options = TrainingOptions { near_identity_penalty: 1.0, ..options(5) };
    let refused = train(&reversible, &pairs, None, &options, None, &mut quiet);
    let words = refused.expect_err("K_ε on both sides").to_string();
    assert!(words.contains("near_identity_penalty") && words.contains("reversor"), "{words}");
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
    // The error at rest: a tenth a window, with held-out pairs and without, whoever lowers it, and
    // after a pause.
    for optimiser in optimisers() {
        for held_out in [Some(&held_out), None] {
            let plateau = Plateau { iterations: 14, improvement: 0.1 };
            let plain = TrainingOptions { optimiser: optimiser.clone(), ..options(600) };
            let at_rest = TrainingOptions { plateau: Some(plateau), ..plain.clone() };
            let mut kept = None;
            let mut watch = |progress: Progress<'_>| {
                kept = progress.checkpoint.cloned().or(kept.take());
                let pause = progress.record.iteration == 9;
                Ok(if pause { Control::Interrupt } else { Control::Continue })
            };
            let run = |resume, watch: &mut dyn FnMut(Progress<'_>) -> _| {
                train(&model(3), &pairs, held_out, &at_rest, resume, watch).expect("runs")
            };
            let outcome = run(None, &mut quiet);
            assert_eq!(outcome.stop, Stop::Plateau, "{}", optimiser.name());
            let last = outcome.history.last().expect("a record");
            assert!(last.iteration.is_multiple_of(14) && last.iteration < 600);
            let windows = if last.pairs < pairs.len() { 2 } else { 1 };
            let score = |until: u64| {
                let records = outcome.history.iter().filter(|r| r.iteration <= until);
                let of = |r: &TrainingRecord| match held_out {
                    Some(_) => r.validation,
                    None => (r.pairs == last.pairs).then_some(r.loss),
                };
                // no NaN: a score that is no number is not the lowest
                records.filter_map(of).fold(f64::INFINITY, f64::min)
            };
            let (now, before) = (score(last.iteration), score(last.iteration - 14 * windows));
            assert!(now >= 0.9 * before, "{now:e} {before:e}");
            // Its path is that of a training that goes on.
            let on = train(&model(3), &pairs, held_out, &plain, None, &mut quiet).expect("runs");
            assert_eq!(on.history[..9], outcome.history[..9]);
            assert!(on.history.len() > outcome.history.len() || on.stop == Stop::Stalled);
            let paused = run(None, &mut watch);
            assert!(paused.stop == Stop::Interrupted || paused.stop == Stop::Plateau);
            let resumed = run(kept, &mut quiet);
            assert_eq!(resumed.stop, Stop::Plateau);
            assert_eq!(resumed.history, outcome.history);
            assert_eq!(
                resumed.model.composition().parameters(),
                outcome.model.composition().parameters()
            );
        }
    }
    // A handful of pairs is overfitted: the held-out error turns.
    let few = pairs_of_three();
    let patience = TrainingOptions { patience: 3, validate_every: 1, ..options(3000) };
    let outcome = train(&model(3), &few, Some(&held_out), &patience, None, &mut quiet);
    let outcome = outcome.expect("runs");
    assert_eq!(outcome.stop, Stop::Patience);
    let best = outcome.best.iteration;
    assert_eq!(outcome.history.len() as u64, best + 3 + 1);
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
    let architecture = HenonShape::uniform(2, 4, 4).architecture(1.0);
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
    let of = |optimiser| TrainingOptions { optimiser, ..options(5) };
    fails(of(lbfgs(0, Scaling::None)));
    fails(TrainingOptions { validate_every: 0, ..options(5) });
    fails(TrainingOptions { checkpoint_every: 0, ..options(5) });
    fails(TrainingOptions { target: f64::NAN, ..options(5) });
    fails(TrainingOptions { gradient_tolerance: -1.0, ..options(5) });
    for (iterations, improvement) in [(0, 0.1), (5, -0.1), (5, 1.1), (5, f64::NAN)] {
        let plateau = Some(Plateau { iterations, improvement });
        fails(TrainingOptions { plateau, ..options(5) });
    }
    fails(of(lbfgs(30, Scaling::GaussNewton { renew: 0 })));
    let marquardt = LevenbergMarquardtOptions::default();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let damping = LevenbergMarquardtOptions { damping: bad, ..marquardt.clone() };
        fails(of(Optimiser::LevenbergMarquardt(damping)));
        let rate = AdamOptions { rate: bad, ..AdamOptions::default() };
        fails(of(Optimiser::Adam(rate)));
    }
    for bad in [-1.0, f64::NAN] {
        let residuals = LevenbergMarquardtOptions { residuals: bad, ..marquardt.clone() };
        fails(of(Optimiser::LevenbergMarquardt(residuals)));
        let gap = LevenbergMarquardtOptions { gap: bad, ..marquardt.clone() };
        fails(of(Optimiser::LevenbergMarquardt(gap)));
        fails(of(Optimiser::Adam(AdamOptions { clip: bad, ..AdamOptions::default() })));
        fails(TrainingOptions { near_identity_penalty: bad, ..options(5) });
    }
    fails(of(Optimiser::Adam(AdamOptions { batch: 0, ..AdamOptions::default() })));
    fails(of(Optimiser::Adam(AdamOptions { factor: 1.5, ..AdamOptions::default() })));
    fails(of(Optimiser::Adam(AdamOptions { plateau: 0, ..AdamOptions::default() })));
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
    let architecture = HenonShape::uniform(2, 1, 2).architecture(1.0);
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
    let rotation = action.turn_by(-1.234);
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

/// A fixed θ has no derivative, and no optimiser moves it, while all else is learnt.
#[test]
fn a_fixed_angle_stays() {
    let (pairs, start) = (pairs(300, 0.5, 1), model(3));
    let angle = start.angle().expect("a gyroceptron").to_bits();
    let free = Objective::new(&Loss::MeanSquaredError, &pairs).expect("a loss");
    let fixed = free.clone().with_fixed_angles(true);
    let count = start.composition().parameters().len();
    let at = start.composition().angles();
    assert_eq!(at, count - 1..count);
    let (mut of_free, mut of_fixed) = (vec![0.0; count], vec![0.0; count]);
    let map = start.composition();
    let values =
        [free.value_and_gradient(map, &mut of_free), fixed.value_and_gradient(map, &mut of_fixed)];
    assert_eq!(values[0].to_bits(), values[1].to_bits());
    assert!(of_free[count - 1] != 0.0 && of_fixed[count - 1] == 0.0);
    assert_eq!(of_free[..count - 1], of_fixed[..count - 1]);
    let (whole, without) = (free.normal_equations(map), fixed.normal_equations(map));
    assert!(whole.matrix[(count - 1, count - 1)] > 0.0 && whole.matrix[(count - 1, 0)] != 0.0);
    assert!((0..count).all(|k| without.matrix[(count - 1, k)] == 0.0));
    assert_eq!(fixed.curvature_diagonal(map)[count - 1], 0.0);
    for optimiser in optimisers() {
        let name = optimiser.name();
        let free = TrainingOptions { optimiser, ..options(30) };
        let fixed = TrainingOptions { theta_fixed: true, ..free.clone() };
        let trained = |options: &TrainingOptions| {
            train(&start, &pairs, None, options, None, &mut quiet).expect("trains")
        };
        let (with, without) = (trained(&fixed), trained(&free));
        let own = |outcome: &Outcome| outcome.model.angle().expect("a gyroceptron").to_bits();
        assert!(own(&with) == angle && own(&without) != angle, "{name}");
        let moved = bits(&with.model).iter().zip(bits(&start)).filter(|(a, b)| **a != *b).count();
        assert!(moved > count / 2 && with.loss < values[0], "{name}: {moved} of {count}");
    }
    let shape = HenonShape::uniform(2, 2, 3);
    let net = shape.architecture(1.0).initialise(InitialWeights::Glorot, 0.0, 1).expect("valid");
    let options = TrainingOptions { theta_fixed: true, ..options(2) };
    let said = train(&net, &pairs, None, &options, None, &mut quiet).expect_err("no θ");
    assert!(said.to_string().contains("theta_fixed"), "{said}");
}

/// Σ(θ − θ⁰)² joins the loss and its derivatives to second order; under every optimiser a larger
/// weight leaves θ closer to where it was, and none at all is the training without it.
#[test]
fn a_penalised_angle_stays_near() {
    let (pairs, start) = (pairs(300, 0.5, 1), model(3));
    let map = start.composition();
    let last = map.parameters().len() - 1;
    assert_eq!(map.angles(), last..last + 1);
    let (away, weight) = (0.25, 0.7);
    let goal = start.angle().expect("a gyroceptron") - away;
    let plain = Objective::new(&Loss::MeanSquaredError, &pairs).expect("a loss");
    let penalised = plain.clone().with_angle_penalty(weight, &[goal]).expect("valid");
    let close = |found: f64, expected: f64| (found - expected).abs() <= 1e-14 * expected.abs();
    assert!(close(penalised.value(map), plain.value(map) + weight * away * away));
    let (mut of_plain, mut of_penalised) = (vec![0.0; last + 1], vec![0.0; last + 1]);
    plain.value_and_gradient(map, &mut of_plain);
    let value = penalised.value_and_gradient(map, &mut of_penalised);
    assert!(close(value, penalised.value(map)));
    assert_eq!(of_penalised[..last], of_plain[..last]);
    assert!(close(of_penalised[last], of_plain[last] + 2.0 * weight * away));
    let diagonals = [&plain, &penalised].map(|objective| objective.curvature_diagonal(map)[last]);
    assert!(close(diagonals[1], diagonals[0] + 2.0 * weight));
    let [without, with] = [&plain, &penalised].map(|objective| objective.normal_equations(map));
    assert!(close(with.matrix[(last, last)], without.matrix[(last, last)] + 2.0 * weight));
    assert_eq!(with.matrix[(last, 0)], without.matrix[(last, 0)]);
    assert!(close(with.gradient[last], without.gradient[last] + 2.0 * weight * away));
    assert!(close(with.loss, without.loss + weight * away * away));
    let fixed = penalised.with_fixed_angles(true);
    assert_eq!(fixed.value(map).to_bits(), plain.value(map).to_bits());

    for optimiser in optimisers() {
        let name = optimiser.name();
        let left = |penalty: f64| {
            let options = TrainingOptions {
                optimiser: optimiser.clone(),
                theta_penalty: penalty,
                ..options(30)
            };
            let outcome = train(&start, &pairs, None, &options, None, &mut quiet).expect("trains");
            assert!(outcome.loss < plain.value(map), "{name} at {penalty}");
            (outcome.model.angle().expect("a gyroceptron") - goal - away).abs()
        };
        let moved = [0.0, 1.0, 100.0].map(left);
        assert!(moved[2] < moved[1] && moved[1] < 0.3 * moved[0], "{name}: {moved:?}");
    }
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        let options = TrainingOptions { theta_penalty: bad, ..options(5) };
        let said = train(&start, &pairs, None, &options, None, &mut quiet).expect_err("no weight");
        assert!(said.to_string().contains("theta_penalty"), "{said}");
    }
    let shape = HenonShape::uniform(2, 2, 3);
    let net = shape.architecture(1.0).initialise(InitialWeights::Glorot, 0.0, 1).expect("valid");
    let options = TrainingOptions { theta_penalty: 1.0, ..options(2) };
    let said = train(&net, &pairs, None, &options, None, &mut quiet).expect_err("no θ");
    assert!(said.to_string().contains("theta_penalty"), "{said}");
}

/// Pairs are asked for as residuals a parameter, and come back as they were.
#[test]
fn as_many_pairs_as_before_are_begun_with() {
    for (dof, width) in [(1, 1), (2, 7), (3, 11)] {
        let shape = HenonShape { dof, widths: vec![width; 5] };
        let model =
            shape.architecture(1.0).initialise(InitialWeights::Glorot, 0.0, 1).expect("a model");
        for pairs in 1..5000 {
            let mut options = LevenbergMarquardtOptions { residuals: 1e-9, ..Default::default() };
            options.begin_with(pairs, model.architecture());
            assert_eq!(options.pairs(model.architecture(), 5000), pairs);
            assert_eq!(options.pairs(model.architecture(), pairs), pairs);
        }
        let mut options = LevenbergMarquardtOptions::default();
        options.begin_with(1, model.architecture());
        assert_eq!(options, LevenbergMarquardtOptions::default());
        // Ten residuals for each parameter, 2n of them a pair; other optimisers look at all pairs.
        let pairs = (10 * model.architecture().parameter_count()).div_ceil(2 * dof);
        for (optimiser, expected) in [
            (Optimiser::LevenbergMarquardt(options), pairs),
            (Optimiser::Lbfgs(LbfgsOptions::default()), 5000),
        ] {
            assert_eq!(optimiser.pairs_of_iteration(model.architecture(), 5000), expected);
        }
    }
}

/// What is in the documentation, and what the published code has.
#[test]
fn options_are_what_they_are_said_to_be() {
    let AdamOptions { rate, clip, batch, factor, plateau, seed } = AdamOptions::default();
    assert_eq!((rate, clip, batch, factor, plateau, seed), (0.1, 0.1, 512, 0.8, 8, 0));
    let marquardt = LevenbergMarquardtOptions { damping: 1e-3, residuals: 10.0, gap: 1.5 };
    assert_eq!(LevenbergMarquardtOptions::default(), marquardt);
    let scaling = Scaling::GaussNewton { renew: 200 };
    assert_eq!(LbfgsOptions::default(), LbfgsOptions { memory: 30, scaling });
    assert_eq!(Plateau::default(), Plateau { iterations: 50, improvement: 0.1 });
    assert_eq!(Plateau::of_windows(7), Some(Plateau { iterations: 7, improvement: 0.1 }));
    let all = TrainingOptions::default();
    assert_eq!((all.iterations, all.validate_every, all.checkpoint_every), (1000, 10, 100));
}

/// The first record is of the start, the last has the held-out error of the model, and the scaling
/// is renewed after so many iterations.
#[test]
fn records_are_of_the_models_that_they_tell_of() {
    let (pairs, held_out, model) = (pairs(300, 0.5, 5), pairs(100, 0.5, 6), model(3));
    let options = options(3);
    let run = |options: &TrainingOptions| {
        train(&model, &pairs, Some(&held_out), options, None, &mut quiet).expect("runs")
    };
    let outcome = run(&options);
    let [of_pairs, of_held_out] = [&pairs, &held_out]
        .map(|pairs| Objective::new(&Loss::MeanSquaredError, pairs).expect("valid"));
    let close = |found: f64, expected: f64| {
        assert!((found - expected).abs() <= 1e-12 * expected, "{found} for {expected}");
    };
    let check = |record: TrainingRecord, model: &Model| {
        let mut gradient = vec![0.0; model.composition().parameters().len()];
        let loss = of_pairs.value_and_gradient(model.composition(), &mut gradient);
        close(record.loss, loss);
        let largest = gradient.iter().map(|g| g.abs()).fold(0.0, max_or_nan);
        close(record.gradient, largest);
        assert_eq!(record.validation, Some(of_held_out.value(model.composition())));
    };
    let first = outcome.history[0];
    assert_eq!((first.iteration, first.evaluations, first.pairs), (0, 1, 300));
    check(first, &model);
    assert_eq!(outcome.best.iteration, 3);
    check(outcome.best, &outcome.model);
    close(outcome.loss, of_pairs.value(outcome.model.composition()));
    let to_evaluation = run(&TrainingOptions { iterations: 7, ..options.clone() });
    assert_eq!(to_evaluation.best.iteration, 7);
    check(to_evaluation.best, &to_evaluation.model);
    let longer = run(&TrainingOptions { iterations: 41, ..options });
    assert_eq!((longer.curvatures, longer.stop), (3, Stop::Iterations));
}

/// Just short of them nothing ends, just beyond it does.
#[test]
fn training_stops_at_the_numbers_asked_for() {
    let (pairs, held_out) = (pairs(300, 0.5, 5), pairs(100, 0.5, 6));
    let run = |options: TrainingOptions| {
        train(&model(3), &pairs, Some(&held_out), &options, None, &mut quiet).expect("runs")
    };
    let plain = run(options(14)).history;
    let score = |k: usize| plain[k].validation.expect("evaluated");
    assert!(score(14) < score(7) && score(7) < score(0));
    for (share, reached) in [(0.995, false), (1.005, true)] {
        let target = run(TrainingOptions { target: share * score(7), ..options(7) });
        assert_eq!(target.stop == Stop::Target, reached, "{share}");
        let lowest = -plain[..8].iter().map(|r| -r.gradient).fold(f64::NEG_INFINITY, max_or_nan);
        let gradient_tolerance = share * lowest;
        let gradient = run(TrainingOptions { gradient_tolerance, ..options(7) });
        assert_eq!(gradient.stop == Stop::Gradient, reached, "{share}");
        let improvement = share * (1.0 - score(14) / score(7));
        let plateau = Some(Plateau { iterations: 7, improvement });
        let stop = run(TrainingOptions { plateau, ..options(14) }).stop;
        assert_eq!(stop == Stop::Plateau, reached, "{share}");
    }
}

#[test]
fn weights_of_planes_are_of_mean_one() {
    let weights = |weights: &[f64]| {
        let loss = Loss::ByPlane { weights: Some(weights.to_vec()) };
        loss.component_weights(2).expect("positive")
    };
    assert_eq!(weights(&[1.0, 3.0]), [0.125, 0.375, 0.125, 0.375]);
    assert_eq!(weights(&[1.0, 3.0, 2.0, 2.0]), [0.125, 0.375, 0.25, 0.25]);
    // The inverse mean square of what a rotation leaves of each plane.
    let (pairs, action) = (pairs(300, 0.5, 5), CircleAction::new([1, 0]));
    let left = rotation_errors(&action.clone().into(), &[0.5], &pairs);
    let inverse = [0, 1].map(|j| 1.0 / (left[j] + left[2 + j]));
    let found = Loss::ByPlane { weights: None }.for_pairs(&action.into(), &[0.5], &pairs);
    let Loss::ByPlane { weights: Some(found) } = found.expect("moves") else {
        panic!("no weights")
    };
    for (found, inverse_of) in found.iter().zip(inverse) {
        let expected = 2.0 * inverse_of / (inverse[0] + inverse[1]);
        assert!((found - expected).abs() < 1e-12 * expected, "{found} for {expected}");
    }
}
