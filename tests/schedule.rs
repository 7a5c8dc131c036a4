//! Trainings in stages: starts of which the best goes on, ramps, and twists alone.

use gyroceptron::Error;
use gyroceptron::flow::{Pairs, Window, sample};
use gyroceptron::layer::CircleAction;
use gyroceptron::network::{HenonShape, InitialWeights, Layers, Model, NormalFormShape, Part};
use gyroceptron::phase::Map;
use gyroceptron::random::Stream;
use gyroceptron::system::Oscillators;
use gyroceptron::train::{
    Checkpoint, Control, FreshTwists, LevenbergMarquardtOptions, Optimiser, Outcome, Progress,
    RampStage, Scheduled, StageData, Starts, Stop, TrainingObserver, TrainingOptions,
    TrainingStage, train, train_schedule,
};
use std::collections::BTreeMap;
use std::sync::Mutex;

const EPSILON: f64 = 0.02;
const TIME: f64 = 40.0;

/// Made once for all tests.
fn pairs(time: f64, epsilon: f64, seed: u64) -> Pairs {
    type Made = Vec<((f64, f64, u64), Pairs)>;
    static MADE: Mutex<Made> = Mutex::new(Vec::new());
    let mut made = MADE.lock().expect("no panic while it is held");
    let key = (time, epsilon, seed);
    if let Some((_, pairs)) = made.iter().find(|(other, _)| *other == key) {
        return pairs.clone();
    }
    let window = Window { low: vec![-1.0; 4], high: vec![1.0; 4], samples: 120 };
    let points = sample(&[window], 2, &mut Stream::new(seed, "data")).expect("a valid window");
    let (pairs, _) = Pairs::of_flow(&Oscillators { epsilon }, points, time).expect("converges");
    made.push((key, pairs.clone()));
    pairs
}

/// The parameters of two kicks of 3.
const CHART: usize = 2 * (3 * 4 + 2);

fn start(number: u64) -> Result<Model, Error> {
    start_of(&[3; 3], number)
}

fn start_of(twists: &[usize], number: u64) -> Result<Model, Error> {
    let shape = NormalFormShape {
        action: CircleAction::new([1, 0]).into(),
        psi: vec![],
        kicks: vec![3; 2],
        twists: twists.to_vec(),
        turned_twists: vec![],
        flow_time: TIME,
        perturbation: None,
    };
    let architecture = shape.architecture(EPSILON);
    architecture.initialise(InitialWeights::Normal { scale: 0.3 }, TIME, 7 + number)
}

fn options(starts: u64) -> TrainingOptions {
    TrainingOptions {
        optimiser: Optimiser::LevenbergMarquardt(LevenbergMarquardtOptions::default()),
        iterations: 14,
        validate_every: 3,
        checkpoint_every: 4,
        starts: (starts > 0).then_some(Starts { count: starts, iterations: 6 }),
        ..TrainingOptions::default()
    }
}

/// Keeps checkpoints as files would, and may stop after so many iterations of all stages.
#[derive(Default)]
struct Store {
    checkpoints: BTreeMap<String, Checkpoint>,
    iterations: usize,
    most: Option<usize>,
    stages: Vec<TrainingStage>,
}

impl TrainingObserver for Store {
    fn earlier(&mut self, stage: TrainingStage) -> Result<Option<Checkpoint>, Error> {
        self.stages.push(stage);
        Ok(self.checkpoints.get(&stage.suffix()).cloned())
    }
    fn observe(&mut self, stage: TrainingStage, progress: Progress<'_>) -> Result<Control, Error> {
        if let Some(checkpoint) = progress.checkpoint {
            // As a file has it.
            let text = serde_json::to_string(checkpoint).expect("finite");
            let read = serde_json::from_str(&text).expect("a checkpoint");
            self.checkpoints.insert(stage.suffix(), read);
        }
        self.iterations += 1;
        let over = self.most.is_some_and(|most| self.iterations >= most);
        Ok(if over { Control::Interrupt } else { Control::Continue })
    }
}

fn bits(model: &Model) -> Vec<u64> {
    model.composition().parameters().iter().map(|v| v.to_bits()).collect()
}

fn run(options: &TrainingOptions, store: &mut Store) -> Scheduled {
    run_from(&mut start, options, store)
}

fn run_from(
    start: &mut dyn FnMut(u64) -> Result<Model, Error>,
    options: &TrainingOptions,
    store: &mut Store,
) -> Scheduled {
    let sets: Vec<(f64, f64, [Pairs; 2])> = options
        .ramp
        .iter()
        .map(|stage| (stage.epsilon.unwrap_or(EPSILON), stage.flow_time.unwrap_or(TIME)))
        .chain([(EPSILON, TIME)])
        .map(|(e, t)| (e, t, [pairs(t, e, 1), pairs(t, e, 2)]))
        .collect();
    let iterations = options.ramp.iter().map(|stage| stage.iterations).chain([options.iterations]);
    let places: Vec<StageData<'_>> = sets
        .iter()
        .zip(iterations)
        .map(|((epsilon, time, [pairs, held_out]), iterations)| StageData {
            epsilon: *epsilon,
            time: time / TIME,
            pairs,
            held_out: Some(held_out),
            iterations,
        })
        .collect();
    train_schedule(start, &places, options, store).expect("trains")
}

fn ramp() -> Vec<RampStage> {
    let stage = |time: f64, epsilon| RampStage {
        flow_time: Some(time),
        epsilon,
        repeats: None,
        degree: None,
        iterations: 8,
    };
    vec![stage(10.0, Some(0.025)), stage(20.0, None)]
}

/// The best start goes on as if it had been alone.
#[test]
fn the_best_of_several_starts_goes_on() {
    let options = options(4);
    let mut store = Store::default();
    let result = run(&options, &mut store);
    let trials: Vec<f64> =
        result.stages.iter().map(|stage| stage.best.validation.expect("held out")).collect();
    assert_eq!(trials.len(), 4);
    let lowest = (0..4).min_by(|a, b| trials[*a].total_cmp(&trials[*b])).expect("four");
    assert!(lowest > 0, "the first is the best: nothing is seen of the choice");
    let chosen: Vec<bool> = result.stages.iter().map(|stage| stage.chosen).collect();
    assert_eq!(chosen, (0..4).map(|k| k == lowest).collect::<Vec<_>>());
    let alone = TrainingOptions { starts: None, ..options.clone() };
    let initial = start(lowest as u64).expect("a start");
    let (pairs, held_out) = (pairs(TIME, EPSILON, 1), pairs(TIME, EPSILON, 2));
    let expected =
        train(&initial, &pairs, Some(&held_out), &alone, None, &mut |_| Ok(Control::Continue))
            .expect("trains");
    assert_eq!(bits(&result.outcome.model), bits(&expected.model));
    assert_eq!(result.outcome.history, expected.history);
    assert_eq!(bits(&result.initial), bits(&initial));
    // No stage is done twice.
    assert_eq!(store.iterations, 4 * 6 + 14 - 6);
}

/// A stage is a training of its own, whose weights start the next with other angles.
#[test]
fn a_ramp_is_its_rungs_one_after_another() {
    let options = TrainingOptions { ramp: ramp(), ..options(0) };
    let result = run(&options, &mut Store::default());
    let mut model =
        start(0).expect("a start").with_epsilon_and_time(0.025, 10.0 / TIME).expect("finite");
    let [angle] = model.angles() else { panic!("one circle") };
    assert!((angle - 10.0).abs() < 1e-12, "{angle}");
    let steps = [(0.025, 10.0, 8), (EPSILON, 20.0, 8), (EPSILON, TIME, 14)];
    for (number, (epsilon, time, iterations)) in steps.into_iter().enumerate() {
        let plain = TrainingOptions { iterations, ramp: Vec::new(), ..options.clone() };
        let (pairs, held_out) = (pairs(time, epsilon, 1), pairs(time, epsilon, 2));
        let outcome =
            train(&model, &pairs, Some(&held_out), &plain, None, &mut |_| Ok(Control::Continue))
                .expect("trains");
        match result.stages.get(number) {
            Some(stage) => {
                assert_eq!(stage.best, outcome.best);
                assert_eq!((stage.epsilon, stage.time), (epsilon, time / TIME));
            }
            None => assert_eq!(bits(&result.outcome.model), bits(&outcome.model)),
        }
        if let Some((epsilon, next, _)) = steps.get(number + 1) {
            let weights = outcome.model.composition().parameters();
            let mut weights = weights.to_vec();
            *weights.last_mut().expect("θ") *= (next / TIME) / (time / TIME);
            model = start(0)
                .expect("a start")
                .with_epsilon_and_time(*epsilon, next / TIME)
                .expect("finite");
            model = model.with_parameters(weights).expect("finite");
        }
    }
    assert_eq!(result.outcome.model.architecture().flow_time, TIME);
    // It begins far below where it would without.
    let without = run(&self::options(0), &mut Store::default());
    let first = |result: &Scheduled| result.outcome.history[0].validation.expect("held out");
    assert!(first(&result) < 0.5 * first(&without), "{} {}", first(&result), first(&without));
}

#[test]
fn stages_have_the_iterations_and_seeds_that_are_asked_for() {
    let stage =
        RampStage { flow_time: None, epsilon: None, repeats: None, degree: None, iterations: 4 };
    let options = TrainingOptions {
        iterations: 9,
        starts: Some(Starts { count: 2, iterations: 3 }),
        ramp: vec![stage],
        fresh_twists: fresh(1, 5),
        ..options(0)
    };
    let stages = TrainingStage::all(&options).into_iter();
    let iterations: Vec<u64> = stages.map(|stage| stage.iterations(&options)).collect();
    assert_eq!(iterations, [3, 3, 4, 5, 5, 9]);
    // 2³² apart.
    assert_eq!([0, 1, 3].map(|number| Starts::seed(5, number)), [5, 4294967301, 12884901893]);
}

/// Twists of a part of the time, so many times over, begin the whole.
#[test]
fn the_twists_of_a_part_of_the_time_are_repeated() {
    let four = |number: u64| start_of(&[2, 3, 2, 3], number);
    // A shear of 2 or 3 neurons in (J, p) or (J, q), the first of them with a form of 3 numbers:
    // what is behind their inner weights and biases is what G is linear in.
    const PAIR: usize = 2 * 4 + 3 + 3 * 4;
    let linear = |index: usize| (6..11).contains(&index) || (20..23).contains(&index);
    let [begun, rest]: [Model; 2] = [four(0).expect("a start"), four(0).expect("a start")];
    let weights = begun.composition().parameters();
    assert_eq!(weights.len(), CHART + 2 * PAIR + 1);
    let stage = |time: f64| RampStage {
        flow_time: Some(time),
        epsilon: None,
        repeats: Some(2),
        degree: None,
        iterations: 8,
    };
    let options = TrainingOptions { ramp: vec![stage(5.0), stage(20.0)], ..options(0) };
    let result = run_from(&mut { four }, &options, &mut Store::default());
    let part = |time: f64| {
        let mut architecture = rest.architecture().clone().of_time(time);
        let slow = architecture.blocks.iter_mut().find(|block| block.part == Part::SlowMap);
        slow.expect("twists").layers = Layers::Twist(vec![2, 3]);
        architecture
    };
    let mut first = weights[..CHART + PAIR].to_vec();
    first.push(5.0);
    let model = Model::new(part(5.0), first).expect("finite");
    let sets = |time| [pairs(time, EPSILON, 1), pairs(time, EPSILON, 2)];
    let five = plain(&model, sets(5.0).each_ref(), 8);
    assert_eq!(result.stages[0].best, five.best);
    let mut weights = five.model.composition().parameters().to_vec();
    *weights.last_mut().expect("θ") *= 4.0;
    let twenty = plain(&Model::new(part(20.0), weights).expect("finite"), sets(20.0).each_ref(), 8);
    assert_eq!(result.stages[1].best, twenty.best);
    let [chart @ .., theta] = twenty.model.composition().parameters() else { panic!("θ") };
    let (chart, twists) = chart.split_at(CHART);
    let half = twists.iter().enumerate();
    let half: Vec<f64> =
        half.map(|(index, weight)| if linear(index) { weight / 2.0 } else { *weight }).collect();
    let weights = [chart, &half, &half, &[2.0 * theta]].concat();
    let model = begun.with_parameters(weights).expect("finite");
    let expected = plain(&model, sets(TIME).each_ref(), 14);
    assert_eq!(bits(&result.outcome.model), bits(&expected.model));
    assert_eq!(result.outcome.history, expected.history);
    // It begins as twice the map of half the time.
    let point: [f64; 4] = [0.4, -0.3, 0.2, 0.5];
    let mut twice = point;
    (0..2).for_each(|_| twenty.model.forward(&mut twice));
    let mut once = point;
    model.forward(&mut once);
    for (a, b) in once.iter().zip(&twice) {
        assert!((a - b).abs() < 1e-13, "{once:?} {twice:?}");
    }
}

#[test]
fn repeats_that_do_not_divide_are_refused() {
    let refused = |repeats: &[usize], twists: usize| {
        let stage = |&repeats| RampStage {
            flow_time: Some(1.0),
            epsilon: None,
            repeats: Some(repeats),
            degree: None,
            iterations: 8,
        };
        let ramp = repeats.iter().map(stage).collect();
        let options = TrainingOptions { ramp, ..options(0) };
        let shape = NormalFormShape {
            action: CircleAction::new([1, 0]).into(),
            psi: vec![],
            kicks: vec![3],
            twists: vec![3; twists],
            turned_twists: vec![],
            flow_time: TIME,
            perturbation: None,
        };
        let architecture = shape.architecture(EPSILON);
        let found = options.check().and_then(|()| options.check_for(&architecture));
        found.map_err(|error| error.to_string())
    };
    assert_eq!(refused(&[4, 4, 2, 1], 8), Ok(()));
    assert_eq!(refused(&[1], 3), Ok(()));
    // A part of one shear, of none, and of a fraction; more than before; none; of no twists.
    for (repeats, twists) in
        [(&[4][..], 4), (&[8], 4), (&[2], 6), (&[2, 4], 8), (&[4, 3], 24), (&[0], 4), (&[2], 0)]
    {
        let error = refused(repeats, twists).expect_err("refused");
        assert!(error.contains("training.ramp.repeats"), "{error}");
    }
    let stage =
        RampStage { flow_time: None, epsilon: None, repeats: Some(2), degree: None, iterations: 8 };
    let options = TrainingOptions { ramp: vec![stage], ..options(0) };
    let shape = HenonShape { dof: 2, widths: vec![3; 4] };
    let error = options.check_for(&shape.architecture(EPSILON));
    assert!(error.expect_err("no twists").to_string().contains("repeats"));
}

fn fresh(count: u64, iterations: u64) -> Option<FreshTwists> {
    Some(FreshTwists { count, iterations })
}

/// A training of one stage.
fn plain(model: &Model, [pairs, held_out]: [&Pairs; 2], iterations: u64) -> Outcome {
    let options = TrainingOptions { iterations, ..options(0) };
    train(model, pairs, Some(held_out), &options, None, &mut |_| Ok(Control::Continue))
        .expect("trains")
}

/// Twists alone are a training on the pairs as the chart of the ramp sees them; the best of
/// them goes on with that chart.
#[test]
fn twists_are_trained_alone_in_the_chart_of_the_ramp() {
    let ramp = vec![RampStage {
        flow_time: Some(1.0),
        epsilon: None,
        repeats: None,
        degree: None,
        iterations: 8,
    }];
    let options = TrainingOptions { ramp, fresh_twists: fresh(6, 12), ..options(0) };
    let result = run(&options, &mut Store::default());
    let model =
        start(0).expect("a start").with_epsilon_and_time(EPSILON, 1.0 / TIME).expect("finite");
    let outcome = plain(&model, [&pairs(1.0, EPSILON, 1), &pairs(1.0, EPSILON, 2)], 8);
    let there = start(0).expect("a start");
    let model = there.with_weights_of(&outcome.model, TIME).expect("of its shape");
    let network = &model;
    let [chart, _] = network.chart_and_inner_map();
    let sets = [pairs(TIME, EPSILON, 1), pairs(TIME, EPSILON, 2)];
    let seen = sets.each_ref().map(|pairs| {
        let [input, output] = [pairs.input(), pairs.output()].map(|points| {
            let mut points = points.to_vec();
            points.chunks_exact_mut(4).for_each(|point| chart.inverse(point));
            points
        });
        Pairs::new("seen", 2, input, output).expect("finite")
    });
    let carried = model.composition().parameters();
    let mut architecture = network.architecture().clone();
    for block in architecture.blocks.iter_mut().filter(|block| block.part == Part::Chart) {
        block.layers = Layers::TurnedKick(Vec::new());
    }
    let alone: Vec<Outcome> = (0..7)
        .map(|number| {
            let mut weights = carried[CHART..].to_vec();
            if number > 0 {
                let fresh = start(number).expect("a start");
                // θ stays that of the ramp.
                let (_, twists) = weights.split_last_mut().expect("θ");
                twists.copy_from_slice(&fresh.composition().parameters()[CHART..][..twists.len()]);
            }
            let twists = Model::new(architecture.clone(), weights).expect("finite");
            plain(&twists, seen.each_ref(), 12)
        })
        .collect();
    let stages = &result.stages[1..];
    assert_eq!(stages.len(), 7);
    for (number, (stage, outcome)) in stages.iter().zip(&alone).enumerate() {
        assert_eq!((stage.stage, stage.best), (TrainingStage::Twists(number as u64), outcome.best));
    }
    let error = |number: &usize| alone[*number].best.validation.expect("held out");
    let lowest = (0..7).min_by(|a, b| error(a).total_cmp(&error(b))).expect("seven");
    assert!(lowest > 0, "those of the ramp are the best: nothing is seen of the choice");
    let chosen: Vec<bool> = stages.iter().map(|stage| stage.chosen).collect();
    assert_eq!(chosen, (0..7).map(|k| k == lowest).collect::<Vec<_>>());
    let weights = [&carried[..CHART], alone[lowest].model.composition().parameters()].concat();
    let model = model.with_parameters(weights).expect("finite");
    let expected = plain(&model, sets.each_ref(), 14);
    assert_eq!(bits(&result.outcome.model), bits(&expected.model));
    assert_eq!(result.outcome.history, expected.history);
    // It begins where the twists alone have come, far below what the ramp gives.
    let first = |result: &Scheduled| result.outcome.history[0].validation.expect("held out");
    let without = run(&TrainingOptions { fresh_twists: None, ..options }, &mut Store::default());
    assert!(first(&result) < 0.5 * first(&without), "{} {}", first(&result), first(&without));
}

/// What twists have learnt of many pairs is not forgotten on a few of them.
#[test]
fn all_weights_go_on_with_the_pairs_of_the_twists() {
    let first = |result: &Scheduled| result.outcome.history[1].pairs;
    let mut seen = Vec::new();
    for iterations in [12, 40] {
        let options = TrainingOptions {
            ramp: ramp(),
            fresh_twists: fresh(1, iterations),
            ..with_few_pairs(0)
        };
        let result = run(&options, &mut Store::default());
        let twists = result.stages.iter().rfind(|stage| stage.chosen).expect("one of the twists");
        assert!(twists.best.iteration > 0);
        assert_eq!(first(&result), twists.best.pairs, "{iterations}");
        seen.push(twists.best.pairs);
        let without =
            run(&TrainingOptions { fresh_twists: None, ..options }, &mut Store::default());
        assert!(first(&without) < twists.best.pairs, "{} {seen:?}", first(&without));
    }
    assert!(seen[0] < 60 && seen[1] == 120, "{seen:?}");
}

/// One that begins with few of the pairs.
fn with_few_pairs(starts: u64) -> TrainingOptions {
    let few = LevenbergMarquardtOptions { residuals: 1.0, ..Default::default() };
    TrainingOptions { optimiser: Optimiser::LevenbergMarquardt(few), ..options(starts) }
}

/// Twists whose loss leaves the numbers are passed over.
#[test]
fn twists_without_a_loss_are_not_chosen() {
    let options = TrainingOptions { ramp: ramp(), fresh_twists: fresh(2, 7), ..options(0) };
    let mut broken = |number: u64| match number {
        0 => start(0),
        _ => {
            let model = start(number)?;
            let mut weights = model.composition().parameters().to_vec();
            // The outer weights of the first twist.
            weights[CHART + 9..CHART + 12].fill(1e300);
            model.with_parameters(weights)
        }
    };
    let result = run_from(&mut broken, &options, &mut Store::default());
    let chosen: Vec<bool> = result.stages[2..].iter().map(|stage| stage.chosen).collect();
    assert_eq!(chosen, [true, false, false]);
    assert!(result.stages[3..].iter().all(|stage| stage.best.loss.is_infinite()));
    // The weights of no start are drawn for twists too.
    let mut drawn = Vec::new();
    let mut said = |number: u64| {
        drawn.push(number);
        start(number)
    };
    let options = TrainingOptions { ramp: ramp(), fresh_twists: fresh(2, 5), ..self::options(3) };
    run_from(&mut said, &options, &mut Store::default());
    assert!(drawn.ends_with(&[3, 4]), "{drawn:?}");
    assert!(drawn[..drawn.len() - 2].iter().all(|number| *number < 3), "{drawn:?}");
}

/// Pairs of several ε are seen through the chart at each.
#[test]
fn twists_of_a_family_are_trained_in_its_charts() {
    let sets = |seed| {
        let of = |epsilon| (epsilon, 1.0, pairs(TIME, epsilon, seed));
        Pairs::of_family(vec![of(EPSILON), of(0.03)]).expect("a family")
    };
    let (family, held_out) = (sets(1), sets(2));
    let near = [pairs(1.0, EPSILON, 1), pairs(1.0, EPSILON, 2)];
    let ramp = vec![RampStage {
        flow_time: Some(1.0),
        epsilon: None,
        repeats: None,
        degree: None,
        iterations: 8,
    }];
    let options = TrainingOptions { ramp, fresh_twists: fresh(1, 7), ..options(0) };
    let epsilon = EPSILON;
    let places = [
        StageData {
            epsilon,
            time: 1.0 / TIME,
            pairs: &near[0],
            held_out: Some(&near[1]),
            iterations: 8,
        },
        StageData { epsilon, time: 1.0, pairs: &family, held_out: Some(&held_out), iterations: 0 },
    ];
    let result = train_schedule(&mut start, &places, &options, &mut Store::default());
    let result = result.expect("trains");
    let model = &result.outcome.model;
    // What the twists' own error was, from its definition.
    let mut sum = 0.0;
    let mut rows = held_out.input().chunks_exact(4).zip(held_out.output().chunks_exact(4));
    for condition in held_out.conditions() {
        let at = model.with_epsilon_and_time(condition.epsilon, condition.time).expect("finite");
        let [chart, inner] = at.chart_and_inner_map();
        for (input, output) in rows.by_ref().take(condition.pairs) {
            let (mut there, mut expected) = (input.to_vec(), output.to_vec());
            chart.inverse(&mut there);
            inner.forward(&mut there);
            chart.inverse(&mut expected);
            sum += there.iter().zip(&expected).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 4.0;
        }
    }
    let expected = sum / held_out.len() as f64;
    let chosen = result.stages.iter().rfind(|stage| stage.chosen).expect("one of the twists");
    let found = chosen.best.validation.expect("held out");
    assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
}

#[test]
fn a_killed_schedule_goes_on_to_the_same_bits() {
    let stops = [1, 5, 6, 7, 13, 19, 21, 27, 28, 29, 33, 37, 41, 43, 44, 48, 56];
    let alone = TrainingOptions { ramp: ramp(), ..options(3) };
    stopped_and_gone_on_with(&mut start, alone, &stops);
    // The last stage begins with the pairs of the twists.
    let few = TrainingOptions { ramp: ramp(), ..with_few_pairs(3) };
    stopped_and_gone_on_with(&mut start, few, &[30, 44, 48, 56]);
    // A quarter of the twists, then half of them.
    let mut parts = ramp();
    (parts[0].repeats, parts[1].repeats) = (Some(4), Some(2));
    let parts = TrainingOptions { ramp: parts, ..options(3) };
    let mut eight = |number| start_of(&[1, 2, 1, 2, 1, 2, 1, 2], number);
    stopped_and_gone_on_with(&mut eight, parts, &[6, 13, 19, 21, 27, 28, 33, 44, 56]);
}

fn stopped_and_gone_on_with(
    start: &mut dyn FnMut(u64) -> Result<Model, Error>,
    options: TrainingOptions,
    stops: &[usize],
) {
    let options = TrainingOptions { fresh_twists: fresh(2, 5), ..options };
    let mut run = |options: &TrainingOptions, store: &mut Store| run_from(start, options, store);
    let whole = run(&options, &mut Store::default());
    let all = 3 * 6 + (8 - 6) + 8 + 3 * 5 + 14;
    for &most in stops {
        let mut store = Store { most: Some(most), ..Store::default() };
        let stopped = run(&options, &mut store);
        assert_eq!(stopped.outcome.stop, Stop::Interrupted, "{most} of {all}");
        assert!(most < all);
        (store.most, store.iterations) = (None, 0);
        let result = run(&options, &mut store);
        assert_eq!(bits(&result.outcome.model), bits(&whole.outcome.model), "{most}");
        assert_eq!(result.outcome.history, whole.outcome.history, "{most}");
        assert_eq!(result.stages, whole.stages, "{most}");
        // What is done is not done again.
        assert!(store.iterations + most <= all + 1, "{most}: {}", store.iterations);
    }
}

/// Weights whose loss leaves the numbers are passed over, unless all are such.
#[test]
fn a_start_without_a_loss_is_not_chosen() {
    let (pairs, held_out) = (pairs(TIME, EPSILON, 1), pairs(TIME, EPSILON, 2));
    let iterations = 14;
    let place = StageData {
        epsilon: EPSILON,
        time: 1.0,
        pairs: &pairs,
        held_out: Some(&held_out),
        iterations,
    };
    let broken = |number: u64| {
        let model = start(number)?;
        let mut weights = model.composition().parameters().to_vec();
        // The outer weights of the first kick: its squares overflow.
        weights[11..14].fill(1e300);
        model.with_parameters(weights)
    };
    let mut some = |number: u64| if number == 1 { start(1) } else { broken(number) };
    let result = train_schedule(&mut some, &[place], &options(3), &mut Store::default());
    let result = result.expect("one can be trained");
    let chosen: Vec<bool> = result.stages.iter().map(|stage| stage.chosen).collect();
    assert_eq!(chosen, [false, true, false]);
    assert_eq!(bits(&result.initial), bits(&start(1).expect("a start")));
    let mut none = |number: u64| broken(number);
    let error = train_schedule(&mut none, &[place], &options(2), &mut Store::default());
    let error = error.map(|_| "a result").expect_err("none can").to_string();
    assert!(error.contains("initial parameters"), "{error}");
}

#[test]
fn bad_schedules_are_refused() {
    let refused = |options: TrainingOptions, word: &str| {
        let error = options.check().expect_err(word).to_string();
        assert!(error.contains(word), "{error}");
    };
    let starts = |count, iterations| TrainingOptions {
        starts: Some(Starts { count, iterations }),
        ..options(0)
    };
    refused(starts(0, 5), "starts.count");
    refused(starts(2, 0), "starts.iterations");
    let stage = |flow_time, epsilon, iterations| TrainingOptions {
        ramp: vec![RampStage { flow_time, epsilon, repeats: None, degree: None, iterations }],
        ..options(0)
    };
    refused(stage(Some(0.0), None, 5), "ramp.flow_time");
    refused(stage(Some(f64::NAN), None, 5), "ramp.flow_time");
    refused(stage(None, Some(f64::INFINITY), 5), "ramp.epsilon");
    refused(stage(None, None, 0), "ramp.iterations");
    let twists = |count, iterations| TrainingOptions {
        fresh_twists: fresh(count, iterations),
        ..stage(None, None, 5)
    };
    refused(twists(0, 5), "fresh_twists.count");
    refused(twists(2, 0), "fresh_twists.iterations");
    refused(TrainingOptions { ramp: vec![], ..twists(2, 5) }, "without a ramp");
    let shape = HenonShape { dof: 2, widths: vec![3] };
    let error = twists(2, 5).check_for(&shape.architecture(EPSILON));
    assert!(error.expect_err("no twists").to_string().contains("fresh_twists"));
    // One stage alone does not pass over what it was asked for.
    for options in [starts(2, 5), stage(None, None, 5)] {
        let (model, set) = (start(0).expect("a start"), pairs(TIME, EPSILON, 1));
        let quiet = &mut |_: Progress<'_>| Ok(Control::Continue);
        let error = train(&model, &set, None, &options, None, quiet).map(|_| "a result");
        assert!(error.expect_err("refused").to_string().contains("train_schedule"));
    }
    // Pairs for each stage.
    let set = pairs(TIME, EPSILON, 1);
    let (epsilon, time, iterations, held_out) = (EPSILON, 1.0, 3, None);
    let place = StageData { epsilon, time, pairs: &set, held_out, iterations };
    let options = stage(None, None, 5);
    assert!(train_schedule(&mut start, &[place], &options, &mut Store::default()).is_err());
    assert!(train_schedule(&mut start, &[], &options, &mut Store::default()).is_err());
}
