//! What is not asked for is not computed and not allocated.
//!
//! One test: it watches all memory and all dual numbers of its process.
#![cfg(feature = "scenes")]

use gyroceptron::flow::Pairs;
use gyroceptron::layer::CircleAction;
use gyroceptron::network::{
    GyroceptronShape, InitialWeights, Rollout, map_jacobians_by_duals, rollout,
};
use gyroceptron::random::Stream;
use gyroceptron::scalar::dual_variables_made;
use gyroceptron::scene::{Event, Folder, Observer, Stage, parse, run};
use gyroceptron::train::{
    Control, LevenbergMarquardtOptions, Loss, Objective, Optimiser, Progress, TrainingOptions,
    train,
};
use gyroceptron::work::Work;
use peak_alloc::PeakAlloc;
use std::hint::black_box;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// The most bytes that `work` has allocated at a time, beyond what there was.
fn peak(work: impl FnOnce()) -> usize {
    MEMORY.reset_peak_usage();
    let before = MEMORY.current_usage();
    work();
    MEMORY.peak_usage().saturating_sub(before)
}

const MEBI: usize = 1 << 20;

fn points(count: usize) -> Vec<f64> {
    let mut stream = Stream::new(1, "points");
    (0..count).map(|_| stream.uniform(-1.6, 1.6)).collect()
}

fn memory() {
    let shape = GyroceptronShape {
        circle_action: CircleAction::new([1, 0]),
        psi: vec![8; 10],
        near_identity: vec![8; 10],
    };
    let model = shape
        .architecture(0.01)
        .initialise(InitialWeights::Normal { scale: 0.15 }, 5.0, 1)
        .expect("valid");
    let map = model.composition();

    // Training: the gradient of each block of a thousand pairs, tapes of those
    // that are under way, and nothing that grows with the pairs otherwise.
    let pairs = Pairs::new("pairs", 2, points(240_000), points(240_000)).expect("finite");
    let objective = Objective::new(&Loss::MeanSquaredError, &pairs).expect("weights");
    let mut gradient = vec![0.0; map.parameters().len()];
    let training = peak(|| {
        black_box(objective.value_and_gradient(map, &mut gradient));
        black_box(objective.value(map));
        black_box(objective.curvature_diagonal(map));
    });
    assert!(training < 4 * MEBI, "{training} bytes");

    // A step with the Gauss–Newton matrix: 8 MiB of rows of the Jacobian, which has 1.2
    // GiB, a few matrices of the parameters, 3.5 MiB each, and what products of
    // matrices keep for the next.
    let all_at_once = LevenbergMarquardtOptions { residuals: 0.0, ..Default::default() };
    let optimiser = Optimiser::LevenbergMarquardt(all_at_once);
    let options = TrainingOptions { iterations: 1, optimiser, ..Default::default() };
    let step = peak(|| {
        let quiet = &mut |_: Progress<'_>| Ok(Control::Continue);
        black_box(train(&model, &pairs, None, &options, None, quiet).expect("trains"));
    });
    assert!((16 * MEBI..40 * MEBI).contains(&step), "{step} bytes");

    // A roll-out: the states asked for, of 20,000 steps a hundred.
    let start = points(4 * 64);
    let request = Rollout { steps: 20_000, every: 200 };
    let mut result = 0;
    let all = peak(|| {
        let states = rollout(map, &start, request).expect("whole points");
        result = size_of_val(&states[..]);
        black_box(states);
    });
    assert_eq!(result, 101 * 64 * 4 * 8);
    assert!(all - result < MEBI, "{all} bytes for a result of {result}");

    // Jacobians: nothing for a point.
    let z = points(4 * 50_000);
    let mut out = vec![0.0; 4 * z.len()];
    let few =
        peak(|| map_jacobians_by_duals(map, &z[..4000], &mut out[..16_000]).expect("whole points"));
    let many = peak(|| map_jacobians_by_duals(map, &z, &mut out).expect("whole points"));
    assert!(many < MEBI, "{many} bytes for 50,000 Jacobians, {few} for 1000");
}

const BARE: &str = r#"
name = "bare"
seed = 3
flow_time = 0.5

[system]
kind = "oscillators"
epsilon = 0.01

[data]
validation = 0.5
windows = [{ low = [-1.6, -1.6, -1.6, -1.6], high = [1.6, 1.6, 1.6, 1.6], samples = 400 }]

[[models]]
name = "gyroceptron"
network = { kind = "gyroceptron", psi = { count = 3, width = 4 }, near_identity = { count = 3, width = 4 } }
weights = { kind = "normal", scale = 0.15 }

[training]
iterations = 25
optimiser = { kind = "l-bfgs", scaling = { kind = "gauss-newton", renew = 10 } }
"#;

const ROLLOUT: &str = "
[rollout]
steps = 100
every = 10
initial = [[1.5, 0.15, 0.0, 0.0], [1.5, 1.0, 0.0, 0.0]]
";

const CERTIFICATE: &str = "
[certificate]
samples = 5
radius = 1.6
";

const COMPARISON: &str = r#"
[work_precision]
points = 16
rounds = 1
integrators = [{ integrator = { kind = "strang" }, one_step = [4] }]
"#;

const PLOTS: &str = r#"
plots = ["loss", "portrait", "adiabatic-invariant", "rollout-error"]
"#;

const TRAJECTORIES: &str = r#"
name = "trajectories"
flow_time = 0.5

[system]
kind = "oscillators"
epsilon = 0.0

[trajectories]
epsilons = [0.0, 0.1]
steps = 20
initial = [[1.5, 0.15, 0.0, 0.0]]
"#;

struct Quiet;

impl Observer for Quiet {
    fn event(&mut self, _: Event<'_>) {}
}

/// The stages of a scene's run, and the dual variables that it made.
fn stages(scene: &str) -> (Vec<Stage>, Option<u64>) {
    let scene = parse("scene", scene).expect("a scene");
    let folder = tempfile::tempdir().expect("a folder");
    let folder = Folder::open(folder.path(), false, true).expect("a folder");
    let before = dual_variables_made();
    let report = run(&scene, &folder, &mut Quiet).expect("it runs").expect("to its end");
    let duals = dual_variables_made().zip(before).map(|(after, before)| after - before);
    (report.stages, duals)
}

/// What was done in all stages whose names begin so.
fn work(stages: &[Stage], name: &str) -> Work {
    let mut total = Work::default();
    for stage in stages.iter().filter(|stage| stage.stage.starts_with(name)) {
        total += stage.work;
    }
    total
}

fn scenes() {
    let (bare, duals) = stages(BARE);
    let pairs = work(&bare, "reference flow");
    assert!(pairs.vector_fields > 0);
    assert_eq!(Work { vector_fields: 0, ..pairs }, Work::default());
    let training = work(&bare, "training");
    assert_eq!(training.gradients % 400, 0);
    assert!(training.gradients >= 26 * 400);
    // At iterations 0, 10 and 20; held out at 0, 10, 20 and the last.
    assert_eq!((training.curvatures, training.losses), (3 * 400, 4 * 200));
    // Their components, once.
    let whole = work(&bare, "");
    assert_eq!(whole.evaluations, 200);
    assert_eq!(whole.vector_fields, pairs.vector_fields);
    assert_eq!(whole.jacobians, 0);

    // All that is asked of the trajectories costs one roll-out and one reference.
    let (rolled, rolled_duals) = stages(&[PLOTS, BARE, ROLLOUT].concat());
    assert_eq!(work(&rolled, "roll-out").evaluations, 200);
    assert_eq!(work(&rolled, "").evaluations, whole.evaluations + 200);
    assert!(work(&rolled, "reference trajectories").vector_fields > 0);
    assert_eq!(work(&rolled, "reference flow").vector_fields, pairs.vector_fields);
    let shared = |stages: &[Stage], name: &str| {
        stages.iter().filter(|stage| stage.stage.starts_with(name)).count()
    };
    assert_eq!(work(&rolled, "training").gradients, work(&rolled, "").gradients);

    let (certified, certified_duals) = stages(&[BARE, CERTIFICATE].concat());
    assert_eq!(work(&certified, "training"), training);

    // The comparison asks for the same pairs, networks and reference trajectories.
    let (compared, compared_duals) = stages(&[BARE, ROLLOUT, COMPARISON].concat());
    for stage in ["reference flow", "training", "reference trajectories", "roll-out"] {
        assert_eq!(shared(&compared, stage), 1, "{stage}");
        assert_eq!(work(&compared, stage), work(&rolled, stage), "{stage}");
    }
    assert_eq!(work(&compared, "").jacobians, 0);
    assert!(work(&compared, "error against run time").evaluations > 0);
    let differences = format!("{COMPARISON}differences = [1e-3]\n");
    let (with_jacobians, jacobian_duals) = stages(&[BARE, &differences].concat());
    let jacobians = work(&with_jacobians, "error against run time: Jacobians").jacobians;
    // Of 16 points, as often as its time asks for.
    assert!(jacobians >= 2 * 16 && jacobians.is_multiple_of(16), "{jacobians}");

    // The reference alone.
    let (sampled, sampled_duals) = stages(TRAJECTORIES);
    assert_eq!(sampled.len(), 2);
    let of_trajectories = work(&sampled, "reference trajectories");
    assert!(of_trajectories.vector_fields > 0);
    assert_eq!(Work { vector_fields: 0, ..of_trajectories }, Work::default());

    // Counted in builds with debug assertions only.
    if cfg!(debug_assertions) {
        assert_eq!([duals, rolled_duals, compared_duals, sampled_duals], [Some(0); 4]);
        assert!(certified_duals > Some(0) && jacobian_duals > Some(0));
    }
}

#[test]
fn a_scene_takes_what_it_names_and_no_more() {
    // Each thread has a tape of its own.
    let two = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
    two.install(memory);
    scenes();
}
