//! What is not asked for is not computed and not allocated.
//!
//! One test: it watches all memory and all dual numbers of its process.
#![cfg(feature = "scenes")]

use gyroceptron::flow::Pairs;
use gyroceptron::layer::CircleAction;
use gyroceptron::network::{
    Architecture, GyroceptronShape, InitialWeights, Rollout, Stream, map_jacobians_by_duals,
    rollout,
};
use gyroceptron::scalar::dual_variables_made;
use gyroceptron::scene::{Event, Folder, Observer, Report, parse, run};
use gyroceptron::train::{Loss, Objective};
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
    let model = Architecture::Gyroceptron { shape, epsilon: 0.01 }
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
scaling = { kind = "gauss-newton", renew = 10 }
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

struct Quiet;

impl Observer for Quiet {
    fn event(&mut self, _: Event<'_>) {}
}

/// The report of a scene, and the dual variables that it made.
fn report(scene: &str) -> (Report, Option<u64>) {
    let scene = parse("scene", scene).expect("a scene");
    let folder = tempfile::tempdir().expect("a folder");
    let folder = Folder::open(folder.path(), false, true).expect("a folder");
    let before = dual_variables_made();
    let report = run(&scene, &folder, &mut Quiet).expect("it runs").expect("to its end");
    (report, dual_variables_made().zip(before).map(|(after, before)| after - before))
}

fn scenes() {
    let (bare, duals) = report(BARE);
    let own = bare.experiment.expect("an experiment").evaluations;
    assert!(own.of_data > 0);
    assert_eq!(own.loss_and_gradient % 400, 0);
    assert!(own.loss_and_gradient >= 26 * 400);
    // At iterations 0, 10 and 20; held out at 0, 10, 20 and the last.
    assert_eq!((own.curvature, own.held_out), (3 * 400, 4 * 200));
    let rest = [own.of_reference_rollout, own.rollout, own.certificate, own.jacobians];
    assert_eq!(rest, [0; 4]);
    assert_eq!(bare.scene.plots, []);

    let (rolled, rolled_duals) = report(&[BARE, ROLLOUT].concat());
    let with_rollout = rolled.experiment.expect("an experiment").evaluations;
    assert_eq!(with_rollout.rollout, 200);
    assert!(with_rollout.of_reference_rollout > 0);
    assert_eq!(with_rollout.of_data, own.of_data);

    let (certified, certified_duals) = report(&[BARE, CERTIFICATE].concat());
    assert!(certified.experiment.expect("an experiment").evaluations.certificate > 20);

    let (compared, compared_duals) = report(&[BARE, COMPARISON].concat());
    assert_eq!(compared.experiment.expect("an experiment").evaluations.jacobians, 0);
    let differences = format!("{COMPARISON}differences = [1e-3]\n");
    let (_, jacobian_duals) = report(&[BARE, &differences].concat());

    // Counted in builds with debug assertions only.
    if cfg!(debug_assertions) {
        assert_eq!([duals, rolled_duals, compared_duals], [Some(0); 3]);
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
