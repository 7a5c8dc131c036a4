//! Fits of polynomials: the linear first step, degrees in stages, and twists that begin with the angles of rings.

use gyroceptron::Error;
use gyroceptron::flow::{Integrator, Pairs};
use gyroceptron::layer::{CircleAction, TorusAction};
use gyroceptron::network::{
    Architecture, Block, InitialWeights, LayerSizes, Layers, Model, NetworkSpec, Part, Scale,
};
use gyroceptron::phase::{AreaDensity, Map, Section};
use gyroceptron::random::Stream;
use gyroceptron::scalar::max_or_nan;
use gyroceptron::system::{FieldLines, System};
use gyroceptron::train::{
    Checkpoint, Control, Fit, FitNote, InitialModels, LevenbergMarquardtOptions, Optimiser,
    PolynomialFit, Progress, RampStage, Rings, Stop, TrainingObserver, TrainingOptions,
    TrainingStage, train,
};
use std::f64::consts::TAU;

fn marquardt(iterations: u64) -> TrainingOptions {
    let optimiser = Optimiser::LevenbergMarquardt(LevenbergMarquardtOptions::default());
    TrainingOptions { iterations, optimiser, ..TrainingOptions::default() }
}

fn points(count: usize, dim: usize, radius: f64) -> Vec<f64> {
    let mut stream = Stream::new(11, "points");
    (0..count * dim).map(|_| stream.uniform(-radius, radius)).collect()
}

fn pairs_of(map: &dyn Map<f64>, input: Vec<f64>) -> Pairs {
    let mut output = input.clone();
    output.chunks_exact_mut(2 * map.dof()).for_each(|z| map.forward(z));
    Pairs::new("pairs", map.dof(), input, output).expect("finite")
}

fn near_identity(degree: usize) -> Architecture {
    let jolts = Block::new(Part::NearIdentity, Layers::TurnedKick(vec![1; 5]));
    Architecture::new(1)
        .on_circle(CircleAction::new([1]))
        .at_epsilon(1.0)
        .with(jolts.of_polynomials(degree).in_box(1.4))
}

/// From coefficients of 0, the first step of Levenberg–Marquardt is a linear fit: small jolts are
/// found by it, but for their squares.
#[test]
fn the_first_step_of_a_fit_is_a_linear_one() {
    let drawn = near_identity(4).initialise(InitialWeights::Normal { scale: 1e-4 }, 0.3, 2);
    let wanted = drawn.expect("jolts");
    let pairs = pairs_of(&wanted, points(200, 2, 1.0));
    let mut parameters = wanted.parameters().to_vec();
    for (_, _, range) in wanted.architecture().layers() {
        // All but the angle.
        parameters[range.start + 1..range.end].fill(0.0);
    }
    let still = wanted.with_parameters(parameters).expect("as many");
    let mut options = marquardt(1);
    options.theta_fixed = true;
    if let Optimiser::LevenbergMarquardt(of) = &mut options.optimiser {
        of.damping = 1e-12;
    }
    let before = Model::composition(&still);
    let error = |map: &dyn Map<f64>| {
        let moved = pairs_of(map, pairs.input().to_vec());
        let errors = moved.output().iter().zip(pairs.output()).map(|(a, b)| (a - b).abs());
        errors.fold(0.0, max_or_nan)
    };
    let large = error(before);
    let fitted = train(&still, &pairs, None, &options, None, &mut |_| Ok(Control::Continue));
    let small = error(fitted.expect("trains").model.composition());
    // Quadratic in the coefficients.
    assert!(large > 1e-4 && small < 10.0 * large * large, "{large:e}, then {small:e}");
}

/// A fit begins with coefficients of 0, and with the box of its pairs.
#[test]
fn fits_begin_at_rest_in_the_box_of_the_pairs() {
    let size = LayerSizes { degree: Some(3), ..LayerSizes::uniform(2, 2) };
    let spec = NetworkSpec::named("normal-form")
        .and_then(|spec| spec.with_size("kicks", size))
        .and_then(|spec| spec.with_size("twists", LayerSizes { count: 1, ..size }))
        .expect("polynomials");
    let input = points(100, 4, 0.5);
    let pairs = Pairs::new("pairs", 2, input.clone(), input).expect("finite");
    let fit = Fit {
        action: Some(CircleAction::new([1, 0]).into()),
        network: Some(spec.clone()),
        units: false,
        ..Fit::default()
    };
    let problem = fit.prepare(pairs.clone()).expect("a problem");
    let radius = |z: &[f64], j: usize| z[j].hypot(z[2 + j]);
    let largest = pairs
        .input()
        .chunks_exact(4)
        .flat_map(|z| [radius(z, 0), radius(z, 1)])
        .fold(0.0, max_or_nan);
    let architecture = problem.architecture.clone();
    assert!(!architecture.blocks.iter().any(|block| block.ridges.is_unbounded()));
    let text = serde_json::to_string(&architecture).expect("JSON");
    let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let kicks = value["blocks"].as_array().expect("blocks").iter().find(|b| b["name"] == "kick");
    let found = kicks.expect("kicks")["radius"].as_f64().expect("a radius");
    // Some pairs may be held out.
    assert!(found <= 1.1 * largest + 1e-12 && found > 0.9 * largest, "{found}, {largest}");
    let initial = InitialModels {
        architecture: &architecture,
        weights: Fit::WEIGHTS,
        angles: &[0.0],
        seed: 1,
        from: None,
        rings: None,
        theta_fixed: false,
    };
    let model = initial.model(0).expect("a start");
    let mut z: Vec<f64> = vec![0.1, 0.2, -0.3, 0.4];
    let before = z.clone();
    model.forward(&mut z);
    assert!(z.iter().zip(&before).all(|(a, b)| (a - b).abs() < 1e-15), "{z:?}");
    // One that is given stays.
    let given = spec.with_radius(2.5).expect("a box");
    let problem = Fit { network: Some(given), ..fit }.prepare(pairs).expect("a problem");
    assert!(format!("{:?}", problem.architecture).contains("radius: 2.5"));
}

/// Remembers how many parameters each stage has.
#[derive(Default)]
struct Sizes(Vec<(TrainingStage, usize, f64)>);

impl TrainingObserver for Sizes {
    fn earlier(&mut self, _: TrainingStage) -> Result<Option<Checkpoint>, Error> {
        Ok(None)
    }
    fn observe(&mut self, stage: TrainingStage, progress: Progress<'_>) -> Result<Control, Error> {
        if let Some(checkpoint) = progress.checkpoint {
            let text = serde_json::to_value(checkpoint).expect("JSON");
            let count = text["parameters"].as_array().expect("numbers").len();
            self.0.push((stage, count, progress.record.loss));
        }
        Ok(Control::Continue)
    }
}

/// Stages of lower degrees have fewer coefficients, and hand on what they have learnt.
#[test]
fn degrees_are_raised_in_stages() {
    let wanted =
        near_identity(6).initialise(InitialWeights::Normal { scale: 0.02 }, 0.3, 2).expect("jolts");
    let pairs = pairs_of(&wanted, points(200, 2, 1.0));
    let blocks = wanted.architecture().blocks.clone();
    let stage = |degree, iterations| RampStage {
        flow_time: None,
        epsilon: None,
        repeats: None,
        degree,
        iterations,
    };
    let ramp = vec![stage(Some(2), 5), stage(Some(4), 5)];
    let training = TrainingOptions { ramp, checkpoint_every: 1, ..marquardt(20) };
    let fit = Fit {
        action: Some(CircleAction::new([1]).into()),
        network: Some(NetworkSpec::of_blocks(blocks)),
        epsilon: Some(1.0),
        training: training.clone(),
        units: false,
        ..Fit::default()
    };
    let mut sizes = Sizes::default();
    let fitted = fit.run_observed(pairs.clone(), &mut sizes).expect("trains");
    let of = |stage: TrainingStage| {
        let mut own = sizes.0.iter().filter(move |(of, ..)| *of == stage);
        let (_, count, loss) = own.clone().next_back().expect("the stage");
        let first = own.next().expect("the stage").2;
        (*count, first, *loss)
    };
    let [two, four, six] =
        [TrainingStage::Ramp(0), TrainingStage::Ramp(1), TrainingStage::Last].map(of);
    assert_eq!([two.0, four.0, six.0], [2, 4, 6].map(|degree| 5 * (1 + degree) + 1));
    // Each begins no worse than the one before has ended, and ends far better.
    assert!(four.1 <= two.2 && six.1 <= four.2, "{two:?} {four:?} {six:?}");
    assert!(six.2 < 1e-3 * two.2, "{two:?} {four:?} {six:?}");
    assert_eq!(fitted.model().architecture().blocks, wanted.architecture().blocks);
    let refused = |ramp: Vec<RampStage>, words: &[&str]| {
        let training = TrainingOptions { ramp, ..training.clone() };
        let error = Fit { training, ..fit.clone() }.prepare(pairs.clone()).expect_err("refused");
        let text = error.to_string();
        assert!(words.iter().all(|word| text.contains(word)), "{text}");
    };
    refused(vec![stage(Some(0), 3)], &["degree", "0"]);
    refused(vec![stage(Some(65), 3)], &["degree", "65"]);
    refused(vec![stage(Some(4), 3), stage(Some(2), 3)], &["degree", "2"]);
}

/// Levenberg–Marquardt begins with few of the pairs. A step that throws others out of the finite numbers
/// is none, and does not end the training.
#[test]
fn steps_that_other_pairs_cannot_follow_are_not_taken() {
    let system = System::FieldLines(FieldLines::new(1e-3));
    let mut stream = Stream::new(5, "lines");
    let lines = FieldLines::new(1e-3);
    let input: Vec<f64> = (0..4500)
        .flat_map(|_| lines.point(stream.uniform(0.05, 0.95), stream.uniform(-3.0, 3.0)))
        .collect();
    let output = Integrator::NaturalRungeKutta4.trajectories(&system, &input, TAU, 64, 1);
    let pairs = Pairs::new("lines", 1, input, output.expect("integrates")).expect("finite");
    let size = |count, degree| LayerSizes { degree: Some(degree), ..LayerSizes::uniform(count, 1) };
    let spec = NetworkSpec {
        kind: "normal-form".into(),
        kicks: Some(size(10, 16)),
        twists: Some(size(1, 10)),
        perturbation: Some(size(10, 16)),
        ..NetworkSpec::default()
    };
    let architecture = spec.architecture(&TorusAction::of_planes(1), 1e-3, TAU).expect("jolts");
    let architecture = architecture.in_box_of(pairs.points());
    for seed in 1..=3 {
        // From a twist that does not turn, which is far from all pairs.
        let initial = InitialModels {
            architecture: &architecture,
            weights: InitialWeights::Normal { scale: 0.3 },
            angles: &[-0.6],
            seed,
            from: None,
            rings: None,
            theta_fixed: false,
        };
        let model = initial.model(0).expect("a start");
        let mut go_on = |_: Progress<'_>| Ok(Control::Continue);
        let outcome = train(&model, &pairs, None, &marquardt(25), None, &mut go_on);
        let outcome = outcome.expect("trains");
        assert!(outcome.stop != Stop::Diverged, "seed {seed}: {:?}", outcome.best);
        assert!(outcome.loss.is_finite() && outcome.best.iteration > 0, "{:?}", outcome.best);
    }
}

/// The angle of an action that turns by several turns across the pairs.
fn omega(action: f64) -> f64 {
    2.0 - 14.0 * action + 3.0 * action * action
}

fn turned_by(omegas: impl Fn(&[f64]) -> Vec<f64>, action: &TorusAction, z: &mut [f64]) {
    let actions: Vec<f64> = action.circles().iter().map(|circle| circle.invariant(z)).collect();
    action.turn_by(&omegas(&actions)).apply(z, false);
}

fn twisted(omegas: impl Fn(&[f64]) -> Vec<f64>, action: &TorusAction, count: usize) -> Pairs {
    let dof = action.dof();
    let input = points(count, 2 * dof, 0.8);
    let mut output = input.clone();
    output.chunks_exact_mut(2 * dof).for_each(|z| turned_by(&omegas, action, z));
    Pairs::new("pairs", dof, input, output).expect("finite")
}

/// Angles are followed through whole turns, of one circle and of two, of either sense.
#[test]
fn rings_turn_by_their_whole_angles() {
    let one = TorusAction::from(CircleAction::new([-2]));
    let pairs = twisted(|j| vec![omega(-j[0] / 2.0)], &one, 400);
    let rings = Rings::fit(&pairs, &one).expect("rings");
    assert!(rings.angles().len() > 20);
    let turns: Vec<f64> = rings
        .angles()
        .iter()
        .map(|(actions, angles)| (angles[0] - omega(-actions[0] / 2.0)) / (0.5 * TAU))
        .collect();
    let whole = turns[0].round();
    for turn in &turns {
        assert!((turn - whole).abs() < 0.03, "{turns:?}");
    }
    let two = TorusAction::of_planes(2);
    let both = |j: &[f64]| vec![omega(j[0]) + j[1], 0.5 - 9.0 * j[1] + 2.0 * j[0]];
    let rings = Rings::fit(&twisted(both, &two, 4000), &two).expect("rings");
    let mut whole = [None; 2];
    for (actions, angles) in rings.angles() {
        for (k, expected) in both(actions).into_iter().enumerate() {
            let turn = (angles[k] - expected) / TAU;
            let own = *whole[k].get_or_insert(turn.round());
            assert!((turn - own).abs() < 0.06, "{k}: {turn}");
        }
    }
    // A plane that does not turn, and pairs without rings.
    assert!(Rings::fit(&twisted(both, &two, 400), &CircleAction::new([1, 0]).into()).is_none());
    let chance = Pairs::new("pairs", 1, points(300, 2, 1.0), points(301, 2, 1.0)[2..].to_vec());
    assert!(Rings::fit(&chance.expect("finite"), &TorusAction::of_planes(1)).is_none());
}

/// A twist through several turns is learnt from there, and not from a twist that does not turn.
#[test]
fn twists_begin_with_the_angles_of_rings() {
    let action = TorusAction::of_planes(1);
    let pairs = twisted(|j| vec![omega(j[0])], &action, 200);
    for degree in [Some(5), None] {
        let block =
            Block::new(Part::SlowMap, Layers::Twist(vec![if degree.is_some() { 1 } else { 6 }]));
        let block = match degree {
            Some(degree) => block.of_polynomials(degree).in_box(1.2),
            None => block,
        };
        let architecture =
            Architecture::new(1).on_torus(&action).of_time(1.3).with(block.scaled(Scale::Time));
        let options = marquardt(30);
        let rings = Rings::for_start(&architecture, &options, &pairs);
        assert!(rings.is_some());
        let loss = |rings: Option<&Rings>| {
            let initial = InitialModels {
                architecture: &architecture,
                weights: Fit::WEIGHTS,
                angles: &[1.0],
                seed: 3,
                from: None,
                rings,
                theta_fixed: false,
            };
            let model = initial.model(0).expect("a start");
            let mut go_on = |_: Progress<'_>| Ok(Control::Continue);
            train(&model, &pairs, None, &options, None, &mut go_on).expect("trains").loss
        };
        let (without, with) = (loss(None), loss(rings.as_ref()));
        assert!(without > 1e-3 && with < 1e-6, "{degree:?}: {without:e}, {with:e}");
    }
    // Where a ramp of flow times leads up, it is that which finds the angles.
    let stage = RampStage {
        flow_time: Some(0.4),
        epsilon: None,
        repeats: None,
        degree: None,
        iterations: 3,
    };
    let options = TrainingOptions { ramp: vec![stage], ..marquardt(3) };
    let twist = Block::new(Part::SlowMap, Layers::Twist(vec![3])).scaled(Scale::Time);
    let architecture = Architecture::new(1).on_torus(&action).with(twist);
    assert!(Rings::for_start(&architecture, &options, &pairs).is_none());
}

/// A density on a coarse grid limits what a polynomial on its section keeps, which is said.
#[test]
fn a_coarse_density_is_said() {
    let section = |count: usize| {
        let axis = |low: f64, high: f64| -> Vec<f64> {
            let share = |k: usize| k as f64 / (count - 1) as f64;
            (0..count).map(|k| low + (high - low) * share(k)).collect()
        };
        let (x, y) = (axis(0.9, 2.5), axis(-0.5, 0.5));
        let values: Vec<f64> = y.iter().flat_map(|_| x.iter().map(|x| 1.0 / x)).collect();
        Section::of_plane(AreaDensity::of_grid(&x, &y, &values, 1.0).expect("positive"))
    };
    // A turn about (x, y) = (1.5, 0) in ln x and y keeps dx∧dy/x.
    let (sin, cos) = 0.7_f64.sin_cos();
    let input: Vec<f64> = points(200, 2, 0.3);
    let of = |turned: bool| -> Vec<f64> {
        let at = |z: &[f64]| match turned {
            true => [1.5 * (cos * z[0] + sin * z[1]).exp(), cos * z[1] - sin * z[0]],
            false => [1.5 * z[0].exp(), z[1]],
        };
        input.chunks_exact(2).flat_map(at).collect()
    };
    let pairs = Pairs::new("pairs", 1, of(false), of(true)).expect("finite");
    let said = |count: usize| {
        let section = Some(section(count));
        let fit = PolynomialFit { degree: Some(3), section, ..PolynomialFit::default() };
        let fitted = fit.run(pairs.clone(), &mut |_| Ok(Control::Continue)).expect("fits");
        fitted.notes.into_iter().find(|note| matches!(note, FitNote::Density(_)))
    };
    let note = said(9).expect("a note").to_string();
    assert!(note.contains("the density of the section errs by"), "{note}");
    assert_eq!(said(40), None);
}
