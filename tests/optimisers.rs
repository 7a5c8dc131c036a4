//! Optimisers and the normal equations that one of them solves.

use crate::training::{
    bits, by_definition, lbfgs, model, optimisers, options, pairs, quiet, with_checkpoints,
};
use gyroceptron::flow::Pairs;
use gyroceptron::layer::{Activation, CircleAction};
use gyroceptron::network::{GyroceptronShape, HenonShape, InitialWeights, Model, SympNetShape};
use gyroceptron::phase::Map;
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Dual, max_or_nan};
use gyroceptron::train::{
    AdamOptions, Checkpoint, Control, LevenbergMarquardtOptions, Loss, Objective, Optimiser,
    Outcome, Scaling, Stop, TrainingOptions, train,
};

#[test]
fn scaled_variables_get_further_than_plain_ones() {
    // A short time and a small ε: sensitivities differ by orders of magnitude.
    let pairs = pairs(500, 0.05, 5);
    let shape = GyroceptronShape {
        circle_action: CircleAction::new([1, 0]),
        psi: vec![6; 6],
        near_identity: vec![6; 6],
    };
    let model = shape
        .architecture(0.01)
        .initialise(InitialWeights::Normal { scale: 0.15 }, 0.05, 1)
        .expect("valid");
    let end = |scaling| {
        let options = TrainingOptions { optimiser: lbfgs(30, scaling), ..options(400) };
        let outcome = train(&model, &pairs, None, &options, None, &mut quiet).expect("runs");
        outcome.best.loss
    };
    let (plain, scaled) = (end(Scaling::None), end(Scaling::GaussNewton { renew: 100 }));
    assert!(scaled < 0.75 * plain, "scaled {scaled:e}, plain {plain:e}");
}

/// The matrix, the gradient and the loss of the normal equations from residuals and
/// their derivatives by duals, for a ragged tail, several blocks, and with the penalty.
#[test]
fn normal_equations_are_those_of_duals() {
    let model = model(2);
    let network = &model;
    let parameters = model.composition().parameters();
    let count = parameters.len();
    let (weights, penalty): ([f64; 4], f64) = ([0.3, 1.0, 0.3, 1.0], 0.7);
    type D = Dual<f64, 1>;
    for number in [5, 37, 300] {
        let pairs = pairs(number, 0.5, 4);
        let loss = Loss::Weighted { weights: vec![0.3, 1.0] };
        let objective = Objective::new(&loss, &pairs).expect("valid weights");
        let objective = objective.with_near_identity_penalty(penalty, &model).expect("valid");
        // Rows of both terms: the derivatives, then the residual, by its root weight.
        let mut rows = vec![vec![0.0; count + 1]; 8 * number];
        for index in 0..count {
            let variable = |(i, &p): (usize, &f64)| D::variable(p, usize::from(i != index));
            let lifted: Vec<D> = parameters.iter().enumerate().map(variable).collect();
            let dual = Model::at_epsilon(network.architecture().clone(), D::constant(0.01), lifted);
            let dual = dual.expect("same shape");
            for (k, (z, target)) in
                pairs.input().chunks_exact(4).zip(pairs.output().chunks_exact(4)).enumerate()
            {
                let mut w: Vec<D> = z.iter().map(|&v| D::constant(v)).collect();
                let mut near = w.clone();
                dual.forward(&mut w);
                dual.near_identity().forward(&mut near);
                for c in 0..4 {
                    let (map, beside) = (weights[c].sqrt(), (penalty / 4.0).sqrt());
                    rows[8 * k + c][index] = map * w[c].eps[0];
                    rows[8 * k + c][count] = map * (w[c].re - target[c]);
                    rows[8 * k + 4 + c][index] = beside * near[c].eps[0];
                    rows[8 * k + 4 + c][count] = beside * (near[c].re - z[c]);
                }
            }
        }
        let entry = |i: usize, j: usize| {
            rows.iter().map(|row| row[i] * row[j]).sum::<f64>() * 2.0 / number as f64
        };
        let found = objective.normal_equations(model.composition());
        let close = |found: f64, exact: f64, size: f64, what: &str| {
            assert!((found - exact).abs() <= 1e-12 * size, "{number}: {what}: {found} {exact}");
        };
        let loss = entry(count, count) / 2.0;
        close(found.loss, loss, loss, "loss");
        close(objective.value(model.composition()), loss, loss, "value");
        let mut gradient = vec![0.0; count];
        objective.value_and_gradient(model.composition(), &mut gradient);
        let diagonal = objective.curvature_diagonal(model.composition());
        for i in 0..count {
            let size = (entry(i, i) * 2.0 * loss).sqrt();
            close(found.gradient[i], entry(i, count), size, "gradient");
            close(gradient[i], entry(i, count), size, "gradient by pullback");
            close(diagonal[i], entry(i, i), entry(i, i), "diagonal");
            for j in 0..=i {
                let size = (entry(i, i) * entry(j, j)).sqrt();
                close(found.matrix[(i, j)], entry(i, j), size, "matrix");
            }
            for j in i + 1..count {
                assert_eq!(found.matrix[(i, j)], 0.0);
            }
        }
    }
}

/// Several panels of columns, pairs of several buffers: the matrix that one product of
/// the whole Jacobian gives, and the same bits on any number of threads.
#[test]
fn normal_equations_are_summed_alike_on_any_number_of_threads() {
    let shape = HenonShape::uniform(3, 5, 8);
    let model = shape
        .architecture(1.0)
        .initialise(InitialWeights::Normal { scale: 0.2 }, 0.0, 1)
        .expect("valid");
    let map = model.composition();
    let mut stream = Stream::new(1, "points");
    let mut points = || (0..6 * 2711).map(|_| stream.uniform(-1.0, 1.0)).collect::<Vec<f64>>();
    let pairs = Pairs::new("points", 3, points(), points()).expect("finite");
    let objective = Objective::new(&Loss::MeanSquaredError, &pairs).expect("valid");
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("a thread pool").install(|| objective.normal_equations(map))
    };
    let one = with_threads(1);
    for threads in [2, 3, 5] {
        let found = with_threads(threads);
        assert!(one.matrix == found.matrix && one.gradient == found.gradient, "{threads} threads");
    }
    let count = map.parameters().len();
    let mut exact = vec![vec![0.0; count]; count];
    let mut recording = map.recording::<f64>();
    for z in pairs.input().chunks_exact(6) {
        for c in 0..6 {
            let mut state = z.to_vec();
            map.forward_recorded(&mut state, &mut recording);
            let (mut cotangent, mut row) = (vec![0.0; 6], vec![0.0; count]);
            cotangent[c] = 1.0;
            map.vjp(&mut recording, &mut cotangent, &mut row);
            for (i, sums) in exact.iter_mut().enumerate() {
                for (sum, r) in sums[..=i].iter_mut().zip(&row) {
                    *sum += row[i] * r / (3.0 * 2711.0);
                }
            }
        }
    }
    for i in 0..count {
        for j in 0..=i {
            let size = (exact[i][i] * exact[j][j]).sqrt();
            let difference = (one.matrix[(i, j)] - exact[i][j]).abs();
            assert!(difference <= 1e-12 * size, "{i} {j}: {difference:e}");
        }
    }
}

/// On data that a part of tells little about the rest, more pairs are taken, up to
/// all, and the loss that is recorded says of how many it is.
#[test]
fn levenberg_marquardt_begins_with_a_part_of_the_pairs() {
    let [_, marquardt, _] = optimisers();
    let (whole, _) = with_checkpoints(&marquardt, 52);
    let pairs: Vec<usize> = whole.history[1..].iter().map(|record| record.pairs).collect();
    let parameters = model(3).composition().parameters().len();
    assert_eq!(pairs[0], parameters.div_ceil(2));
    assert!(pairs.windows(2).all(|pair| pair[0] <= pair[1]));
    assert_eq!(pairs[51], 300);
    // Each loss of the same pairs is lower than the one before; they change every ten
    // iterations and when no step is found.
    for pair in whole.history[1..].windows(2) {
        let others = pair[1].iteration.is_multiple_of(10) || pair[1].pairs > pair[0].pairs;
        assert!(pair[1].loss < pair[0].loss || others, "{:?}", pair[1]);
    }
    let at_once = LevenbergMarquardtOptions { residuals: 0.0, ..Default::default() };
    let (all, _) = with_checkpoints(&Optimiser::LevenbergMarquardt(at_once), 52);
    assert!(all.history.iter().all(|record| record.pairs == 300));
    // Both end below what L-BFGS reaches in as many iterations.
    let (lbfgs, _) = with_checkpoints(&optimisers()[0], 52);
    let best = |outcome: &Outcome| outcome.best.validation.expect("evaluated");
    assert!(best(&all) < 0.6 * best(&lbfgs), "{:e} {:e}", best(&all), best(&lbfgs));
    assert!(best(&whole) < 0.6 * best(&lbfgs), "{:e} {:e}", best(&whole), best(&lbfgs));
}

/// After ten iterations the next part has its turn: no pair of the first is in it.
#[test]
fn levenberg_marquardt_changes_its_pairs() {
    let (data, held_out, model) = (pairs(300, 0.5, 5), pairs(50, 0.5, 6), model(3));
    let marquardt = LevenbergMarquardtOptions { residuals: 1.0, gap: 1e9, ..Default::default() };
    let optimiser = Optimiser::LevenbergMarquardt(marquardt);
    let options = TrainingOptions { optimiser, validate_every: 1, ..options(20) };
    let outcome = train(&model, &data, Some(&held_out), &options, None, &mut quiet);
    let outcome = outcome.expect("trains");
    let part = |shift: usize| {
        let count = outcome.history[1].pairs;
        let row = |set: &[f64], k: usize| {
            let row = k * 300 / count + shift;
            set[4 * row..4 * row + 4].to_vec()
        };
        let rows = |set: &[f64]| (0..count).flat_map(|k| row(set, k)).collect::<Vec<f64>>();
        Pairs::new("part", 2, rows(data.input()), rows(data.output())).expect("finite")
    };
    assert!(outcome.history[1].pairs < 100);
    for (iterations, shift) in [(9, 0), (10, 1), (19, 1), (20, 2)] {
        let options = TrainingOptions { iterations, validate_every: iterations, ..options.clone() };
        let so_far = train(&model, &data, None, &options, None, &mut quiet).expect("trains");
        let last = so_far.history.last().expect("a record");
        assert_eq!(so_far.best.iteration, iterations);
        let expected = by_definition(&so_far.model, &part(shift), &[0.25; 4]);
        assert!((last.loss - expected).abs() <= 1e-12 * expected, "{iterations}: {last:?}");
    }
}

/// A step by its definition: a straight term from the normal equations, a second-order
/// one from the second derivative of the residuals along it.
#[test]
fn a_step_of_levenberg_marquardt_is_bent_as_the_residuals_are() {
    let (pairs, model) = (pairs(300, 0.5, 5), model(3));
    for penalty in [0.0, 1e-3] {
        let (damping, residuals) = (0.1, 0.0);
        let marquardt = LevenbergMarquardtOptions { damping, residuals, ..Default::default() };
        let options = TrainingOptions {
            near_identity_penalty: penalty,
            optimiser: Optimiser::LevenbergMarquardt(marquardt),
            ..options(1)
        };
        let outcome = train(&model, &pairs, None, &options, None, &mut quiet).expect("trains");
        assert_eq!(outcome.best.iteration, 1, "the step lowers the loss");
        let objective = Objective::new(&Loss::MeanSquaredError, &pairs)
            .and_then(|objective| objective.with_near_identity_penalty(penalty, &model))
            .expect("valid");
        let start = model.composition().parameters();
        let count = start.len();
        let equations = objective.normal_equations(model.composition());
        let damped = faer::Mat::from_fn(count, count, |i, j| {
            let entry = equations.matrix[(i.max(j), i.min(j))];
            if i == j { entry + damping * entry.max(equations.loss) } else { entry }
        });
        let solution = |right: &[f64]| -> Vec<f64> {
            use faer::linalg::solvers::Solve;
            let solved =
                damped.partial_piv_lu().solve(faer::Mat::from_fn(count, 1, |i, _| -right[i]));
            (0..count).map(|i| solved[(i, 0)]).collect()
        };
        let straight = solution(&equations.gradient);
        // Both maps of the loss at a part of the straight step.
        let at = |part: f64, z: &[f64]| -> Vec<f64> {
            let moved = start.iter().zip(&straight).map(|(p, d)| p + part * d).collect();
            let moved = model.with_parameters(moved).expect("finite");
            let gyroceptron = &moved;
            let (mut all, mut near) = (z.to_vec(), z.to_vec());
            moved.forward(&mut all);
            gyroceptron.near_identity().forward(&mut near);
            all.extend(near);
            all
        };
        // The part of the step that the optimiser takes, which leaves 1e-3 of the fourth derivative.
        let (h, mut right) = (0.1, vec![0.0; count]);
        let loss_towards = |parameters: &[f64], towards: &[Vec<f64>]| -> f64 {
            let moved = model.with_parameters(parameters.to_vec()).expect("finite");
            let gyroceptron = &moved;
            let mut total = 0.0;
            for (z, bend) in pairs.input().chunks_exact(4).zip(towards) {
                let (mut all, mut near) = (z.to_vec(), z.to_vec());
                moved.forward(&mut all);
                gyroceptron.near_identity().forward(&mut near);
                for c in 0..4 {
                    total += 0.25 * (bend[c] * all[c] + penalty * bend[4 + c] * near[c]);
                }
            }
            2.0 * total / pairs.len() as f64
        };
        let bends: Vec<Vec<f64>> = pairs
            .input()
            .chunks_exact(4)
            .map(|z| {
                let (ahead, here, behind) = (at(h, z), at(0.0, z), at(-h, z));
                (0..8).map(|c| (ahead[c] - 2.0 * here[c] + behind[c]) / (h * h)).collect()
            })
            .collect();
        for (index, right) in right.iter_mut().enumerate() {
            let (mut ahead, mut behind) = (start.to_vec(), start.to_vec());
            ahead[index] += 1e-5;
            behind[index] -= 1e-5;
            *right = (loss_towards(&ahead, &bends) - loss_towards(&behind, &bends)) / 2e-5;
        }
        let bend = solution(&right);
        let largest = bend.iter().map(|b| b.abs()).fold(0.0, max_or_nan);
        assert!(largest > 1e-3, "{largest:e}: nothing bends");
        for (index, found) in outcome.model.composition().parameters().iter().enumerate() {
            let expected = start[index] + straight[index] + 0.5 * bend[index];
            let error = (found - expected).abs();
            assert!(error <= 1e-4 * largest, "{index}: {error:e} of {largest:e}");
        }
        let record = outcome.history[1];
        let after = objective.normal_equations(outcome.model.composition()).gradient;
        let after = after.iter().map(|g| g.abs()).fold(0.0, max_or_nan);
        assert!((record.gradient - after).abs() <= 1e-12 * after, "{record:?} {after}");
        // The start, twice; three for the bend, and the end.
        assert_eq!((record.evaluations, record.pairs), (6, 300));
        assert_eq!(outcome.curvatures, 2);
        // The damping falls with what is gained of what was predicted: Nielsen's rule.
        let mut predicted = 0.0;
        for ((k, d), g) in straight.iter().enumerate().zip(&equations.gradient) {
            let more = damping * equations.matrix[(k, k)].max(equations.loss);
            predicted += 0.5 * d * (more * d - g);
        }
        let gain = (outcome.history[0].loss - record.loss) / predicted;
        let shrink = (1.0 - (2.0 * gain - 1.0).powi(3)).max(1.0 / 3.0);
        let mut held = None;
        train(&model, &pairs, None, &options, None, &mut |progress| {
            held = progress.checkpoint.cloned();
            Ok(Control::Continue)
        })
        .expect("trains");
        let text = serde_json::to_value(held.expect("the last")).expect("JSON");
        let found = text["optimiser"]["damping"].as_f64().expect("a number");
        assert!((found / damping - shrink).abs() < 1e-6, "{found}, gain {gain}");
    }
}

/// A parameter without any effect makes the matrix singular; a loss that overflows a
/// step ahead is no progress. Neither ends in anything but finite numbers.
#[test]
fn singular_matrices_and_losses_that_overflow_are_survived() {
    let [_, marquardt, _] = optimisers();
    let options = TrainingOptions { optimiser: marquardt, ..options(20) };
    // The outer weights of the second layer are zero: no derivative in its others.
    let shape = HenonShape::uniform(2, 2, 3);
    let architecture = shape.architecture(1.0);
    let live = architecture.initialise(InitialWeights::Normal { scale: 0.2 }, 0.0, 1);
    let mut parameters = live.expect("valid").composition().parameters().to_vec();
    parameters[14 + 9..14 + 12].fill(0.0);
    let dead = Model::new(architecture, parameters).expect("finite");
    let data = pairs(50, 0.5, 5);
    let objective = Objective::new(&Loss::MeanSquaredError, &data).expect("valid");
    let matrix = objective.normal_equations(dead.composition()).matrix;
    assert_eq!(matrix[(14, 14)], 0.0);
    let outcome = train(&dead, &data, None, &options, None, &mut quiet).expect("runs");
    assert!(outcome.best.loss < 0.5 * outcome.history[0].loss);
    // Steps of the first, undamped kind go so far that the loss overflows: they are
    // rejected, more damped ones are not.
    let shape =
        SympNetShape { dof: 2, modules: 3, shears: 12, activation: Activation::Tanh, plain: false };
    let deep = shape
        .architecture()
        .initialise(InitialWeights::Normal { scale: 1e-6 }, 0.0, 1)
        .expect("valid");
    let input: Vec<f64> = data.input().iter().map(|v| 1e40 * v).collect();
    let output = input.iter().map(|v| -v).collect();
    let far = Pairs::new("far", 2, input, output).expect("finite");
    let start = LevenbergMarquardtOptions { damping: 1e-16, residuals: 0.0, gap: 2.0 };
    let options = TrainingOptions { optimiser: Optimiser::LevenbergMarquardt(start), ..options };
    let outcome = train(&deep, &far, None, &options, None, &mut quiet).expect("runs");
    let last = outcome.history.last().expect("a record");
    assert!(last.evaluations > 4 * last.iteration + 2, "no step was rejected: {last:?}");
    assert!(outcome.loss < outcome.history[0].loss && outcome.loss.is_finite());
    // A perfect start has no lower loss.
    let input = data.input().to_vec();
    let mut output = input.clone();
    output.chunks_exact_mut(4).for_each(|z| dead.forward(z));
    let own = Pairs::new("own", 2, input, output).expect("finite");
    let outcome = train(&dead, &own, None, &options, None, &mut quiet).expect("runs");
    assert!(matches!(outcome.stop, Stop::Stalled | Stop::Gradient), "{:?}", outcome.stop);
    assert_eq!(bits(&outcome.model), bits(&dead));
}

/// Two epochs of one batch each, by the formulas of the paper.
#[test]
fn adam_is_its_definition() {
    let (pairs, model) = (pairs(40, 0.5, 5), model(3));
    let (rate, clip) = (0.003, 0.05);
    let adam = AdamOptions { rate, clip, batch: 64, ..AdamOptions::default() };
    let options = TrainingOptions { optimiser: Optimiser::Adam(adam), ..options(2) };
    let outcome = train(&model, &pairs, None, &options, None, &mut quiet).expect("runs");
    let objective = Objective::new(&Loss::MeanSquaredError, &pairs).expect("valid");
    let mut at = model.composition().parameters().to_vec();
    let (mut mean, mut squares) = (vec![0.0; at.len()], vec![0.0; at.len()]);
    let mut clipped = 0;
    for step in 1..=2 {
        let mut gradient = vec![0.0; at.len()];
        let current = model.with_parameters(at.clone()).expect("finite");
        let loss = objective.value_and_gradient(current.composition(), &mut gradient);
        let recorded = outcome.history[step].loss;
        assert!((recorded - loss).abs() <= 1e-12 * loss);
        let largest = gradient.iter().map(|g| g.abs()).fold(0.0, max_or_nan);
        let record = outcome.history[step];
        assert!((record.gradient - largest).abs() <= 1e-12 * largest, "{record:?} {largest}");
        assert_eq!((record.pairs, record.evaluations), (40, 1 + step as u64));
        // Of the sum over the batch and its components, clipped in each tensor: W, b, w
        // and η of three layers of four and of three, and θ.
        gradient.iter_mut().for_each(|g| *g *= 160.0);
        let layer = |h: usize| [2 * h, h, h, 2];
        let sizes = [layer(4), layer(4), layer(4), layer(3), layer(3), layer(3)].concat();
        let mut rest = &mut gradient[..];
        for size in sizes.into_iter().chain([1]) {
            let (tensor, after) = rest.split_at_mut(size);
            rest = after;
            let norm = tensor.iter().map(|g| g * g).sum::<f64>().sqrt();
            if norm > clip {
                clipped += 1;
                tensor.iter_mut().for_each(|g| *g *= clip / norm);
            }
        }
        assert!(rest.is_empty());
        for k in 0..at.len() {
            let g = gradient[k];
            mean[k] = 0.9 * mean[k] + 0.1 * g;
            squares[k] = 0.999 * squares[k] + 0.001 * g * g;
            let (one, two) = (1.0 - 0.9_f64.powi(step as i32), 1.0 - 0.999_f64.powi(step as i32));
            at[k] -= rate * two.sqrt() / one * mean[k] / (squares[k].sqrt() + 1e-7);
        }
    }
    assert!(clipped > 0 && clipped < 2 * 25, "{clipped}");
    let last = objective.value(model.with_parameters(at).expect("finite").composition());
    let best = objective.value(outcome.model.composition());
    assert!((best - last).abs() <= 1e-10 * last, "{best} {last}");
}

/// The rate falls after so many epochs whose loss, as a sum over a batch, is not lower by
/// 1e-4 than the lowest before: by the states that checkpoints hold.
#[test]
fn the_rate_of_adam_falls_where_the_loss_does_not() {
    let pairs = pairs(64, 0.5, 5);
    for (loss, unit) in
        [(Loss::MeanSquaredError, 4.0), (Loss::Weighted { weights: vec![0.25, 0.5] }, 2.0)]
    {
        let adam = AdamOptions { rate: 0.02, plateau: 2, batch: 64, ..AdamOptions::default() };
        let optimiser = Optimiser::Adam(adam);
        let options = TrainingOptions { optimiser, loss, checkpoint_every: 1, ..options(60) };
        let (mut rates, mut losses) = (Vec::new(), Vec::new());
        train(&model(3), &pairs, None, &options, None, &mut |p| {
            let text = serde_json::to_value(p.checkpoint.expect("each time")).expect("JSON");
            rates.push(text["optimiser"]["rate"].as_f64().expect("a number"));
            losses.push(p.record.loss * 64.0 * unit);
            Ok(Control::Continue)
        })
        .expect("runs");
        let (mut rate, mut lowest, mut waited) = (0.02, f64::INFINITY, 0);
        for (epoch, loss) in losses.iter().enumerate() {
            if *loss < lowest - 1e-4 {
                (lowest, waited) = (*loss, 0);
            } else {
                waited += 1;
            }
            if waited == 2 {
                (rate, waited) = (rate * 0.8, 0);
            }
            assert_eq!(rates[epoch], rate, "epoch {epoch}");
        }
        assert!(rate < 0.02 && rates[0] == 0.02, "{rate}");
    }
}

/// A gradient that is small on a part of the pairs ends nothing; what a file may hold and
/// no run leaves is refused.
#[test]
fn levenberg_marquardt_takes_all_pairs_before_it_ends() {
    let (pairs, model) = (pairs(300, 0.5, 5), model(3));
    let start = LevenbergMarquardtOptions { residuals: 1.0, ..Default::default() };
    let optimiser = Optimiser::LevenbergMarquardt(start);
    let options = TrainingOptions { optimiser, ..options(30) };
    let outcome = train(&model, &pairs, None, &options, None, &mut quiet).expect("runs");
    let of_part = outcome.history[1..].iter().filter(|record| record.pairs < 300);
    let smallest = of_part.min_by(|a, b| a.gradient.total_cmp(&b.gradient)).expect("one at least");
    let options = TrainingOptions { gradient_tolerance: smallest.gradient, ..options };
    let outcome = train(&model, &pairs, None, &options, None, &mut quiet).expect("runs");
    let last = outcome.history.last().expect("a record");
    assert!(last.iteration > smallest.iteration, "{last:?}");
    assert!(last.pairs == 300 || outcome.stop == Stop::Iterations, "{:?}", outcome.stop);
    // The loss that is reported is that of all pairs.
    let objective = Objective::new(&Loss::MeanSquaredError, &pairs).expect("valid");
    assert_eq!(outcome.loss, objective.value(outcome.model.composition()));
    for optimiser in optimisers() {
        let (_, checkpoints) = with_checkpoints(&optimiser, 10);
        let whole = serde_json::to_value(&checkpoints[0]).expect("JSON");
        let changes: &[(&str, serde_json::Value)] = match optimiser {
            Optimiser::Lbfgs(_) => &[],
            Optimiser::LevenbergMarquardt(_) => &[
                ("damping", (-1.0).into()),
                ("growth", 0.0.into()),
                ("pairs", 0.into()),
                ("lowest", (-1.0).into()),
                ("looks", u64::MAX.into()),
                ("iterations", u64::MAX.into()),
                ("evaluations", u64::MAX.into()),
            ],
            Optimiser::Adam(_) => &[("rate", (-1.0).into()), ("epochs", u64::MAX.into())],
        };
        let mut broken: Vec<serde_json::Value> = Vec::new();
        for (key, value) in changes {
            let mut text = whole.clone();
            text["optimiser"][key] = value.clone();
            broken.push(text);
        }
        let mut without = whole.clone();
        without["optimiser"] = serde_json::Value::Null;
        broken.push(without);
        for text in broken {
            let read: Checkpoint = serde_json::from_value(text.clone()).expect("reads");
            let (data, held_out) = (self::pairs(300, 0.5, 5), self::pairs(100, 0.5, 6));
            let options = TrainingOptions { optimiser: optimiser.clone(), ..self::options(52) };
            let resumed = train(&model, &data, Some(&held_out), &options, Some(read), &mut quiet);
            assert!(resumed.is_err(), "{}", text["optimiser"]);
        }
    }
}

#[test]
fn adam_ends_where_the_loss_leaves_the_numbers() {
    let adam = AdamOptions { rate: f64::MAX, ..AdamOptions::default() };
    let options = TrainingOptions { optimiser: Optimiser::Adam(adam), ..options(50) };
    let outcome = train(&model(3), &pairs(3000, 0.5, 5), None, &options, None, &mut quiet);
    let outcome = outcome.expect("ends");
    assert_eq!(outcome.stop, Stop::Diverged);
    assert_eq!(bits(&outcome.model), bits(&model(3)));
}

/// Basin would stop after 1000 iterations of one memory on its own.
#[test]
fn plain_lbfgs_is_not_restarted() {
    let pairs = pairs(8, 0.5, 5);
    let architecture = HenonShape::uniform(2, 1, 2).architecture(1.0);
    let model =
        architecture.initialise(InitialWeights::Normal { scale: 0.2 }, 0.0, 1).expect("valid");
    let options = TrainingOptions {
        optimiser: lbfgs(1, Scaling::None),
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
        assert_eq!(json["optimiser"]["segment_iterations"], 1001);
    } else {
        panic!("stopped at {} for {:?}", outcome.history.len(), outcome.stop);
    }
}
