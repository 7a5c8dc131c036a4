//! One evaluation of the loss and of its gradient on 60,000 pairs, and of the normal
//! equations of Levenberg–Marquardt on 20,000, for the models of the paper, and its share of the fused multiply-adds
//! that a core does in the same process: `cargo bench --bench training`, with `-- --quick` in less than a minute.
//!
//! `RAYON_NUM_THREADS=1 cargo bench --bench training` is the same on one core.
//!
//! Wall time is noisy, instructions are not (those of AVX2, which valgrind knows):
//!
//! ```sh
//! cargo bench --bench training --no-run     # says where the executable is
//! for n in 1 2; do
//!     RAYON_NUM_THREADS=1 valgrind --tool=callgrind --callgrind-out-file=/dev/null \
//!         EXECUTABLE --count $n
//! done
//! ```
//!
//! The difference is one evaluation of loss and gradient, 681 parameters, 1024
//! pairs.

use criterion::{Criterion, Throughput, criterion_group};
use gyroceptron::flow::Pairs;
use gyroceptron::layer::CircleAction;
use gyroceptron::network::{GyroceptronShape, InitialWeights, Model, map_points};
use gyroceptron::phase::Direction;
use gyroceptron::random::Stream;
use gyroceptron::train::{
    Control, LevenbergMarquardtOptions, Loss, Objective, Optimiser, TrainingOptions, train,
};
use peak::{SECH2_PRODUCTS, TANH_PRODUCTS, peak, share};
use std::hint::black_box;
use std::time::{Duration, Instant};

mod peak;

const SAMPLES: usize = 60_000;
/// Pairs of the normal equations.
const FEW: usize = 20_000;

/// The models of the paper: circle action, layers of ψ and of I_ε.
const MODELS: [Shape; 3] =
    [(&[1, 0], [10, 8], [8, 6]), (&[1, 0], [10, 8], [10, 8]), (&[0, 1, 2], [12, 8], [12, 8])];

type Shape = (&'static [i32], [usize; 2], [usize; 2]);

fn model(of: Shape) -> Model {
    with_weights(of, 1)
}

fn with_weights((action, psi, near_identity): Shape, seed: u64) -> Model {
    let shape = GyroceptronShape {
        circle_action: CircleAction::new(action),
        psi: vec![psi[1]; psi[0]],
        near_identity: vec![near_identity[1]; near_identity[0]],
    };
    shape
        .architecture(0.01)
        .initialise(InitialWeights::Normal { scale: 0.15 }, 5.0, seed)
        .expect("a valid architecture")
}

fn pairs(dof: usize, count: usize) -> Pairs {
    let mut stream = Stream::new(1, "points");
    let mut points = || (0..count * 2 * dof).map(|_| stream.uniform(-1.6, 1.6)).collect::<Vec<_>>();
    Pairs::new("bench", dof, points(), points()).expect("finite numbers")
}

/// Products of a neuron with n inputs. Forward: sech², the preactivation, the
/// weight, the increments. Beside it for the gradient: tanh, and the cotangents of
/// sech², of the weight, of the preactivation, of W (two each) and of the inputs.
fn products(n: usize) -> (f64, f64) {
    let n = n as f64;
    (SECH2_PRODUCTS + 2.0 * n + 1.0, TANH_PRODUCTS - SECH2_PRODUCTS + 4.0 * n + 4.0)
}

/// So many iterations of Levenberg–Marquardt with all pairs, after the first.
fn iterations(model: &Model, pairs: &Pairs, count: u64) -> Duration {
    let all = LevenbergMarquardtOptions { residuals: 0.0, ..Default::default() };
    let optimiser = Optimiser::LevenbergMarquardt(all);
    let options = TrainingOptions { iterations: 1 + count, optimiser, ..Default::default() };
    let (mut first, mut last) = (None, None);
    let outcome = train(model, pairs, None, &options, None, &mut |_| {
        last = Some(Instant::now());
        first = first.or(last);
        Ok(Control::Continue)
    });
    assert_eq!(outcome.expect("trains").history.len() as u64, 2 + count, "none is missing");
    last.zip(first).map_or(Duration::ZERO, |(last, first)| last - first)
}

fn shares() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    one.install(|| {
        let peak = peak();
        for of in MODELS {
            let model = model(of);
            let map = model.composition();
            let pairs = pairs(map.dof(), 8192);
            let objective = Objective::new(&Loss::MeanSquaredError, &pairs).expect("weights");
            let mut gradient = vec![0.0; map.parameters().len()];
            let (forward, backward) = products(map.dof());
            let (neurons, count) = (map.activation_count() as f64, pairs.len());
            let name = format!("{} parameters", gradient.len());
            share(&format!("loss, {name}"), count, forward * neurons, peak, || {
                black_box(objective.value(map));
            });
            let products = (forward + backward) * neurons;
            share(&format!("loss and gradient, {name}"), count, products, peak, || {
                black_box(objective.value_and_gradient(map, &mut gradient));
            });
            // Half of the products of the Jacobian, with the residuals as a column more,
            // with itself; those of the Jacobian come for nothing.
            let columns = (gradient.len() + 1) as f64;
            let products = (2 * map.dof()) as f64 * columns * (columns + 1.0) / 2.0;
            share(&format!("normal equations, {name}"), count, products, peak, || {
                black_box(objective.normal_equations(map));
            });
        }
    });
}

fn training(criterion: &mut Criterion) {
    shares();
    for of in MODELS {
        let model = model(of);
        let map = model.composition();
        let pairs = pairs(map.dof(), SAMPLES);
        let objective = Objective::new(&Loss::MeanSquaredError, &pairs).expect("valid weights");
        let mut gradient = vec![0.0; map.parameters().len()];
        let name = format!("{} parameters, {SAMPLES} pairs", gradient.len());
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        group.throughput(Throughput::Elements(SAMPLES as u64));
        group.bench_function("loss", |b| b.iter(|| black_box(objective.value(map))));
        group.bench_function("loss and gradient", |b| {
            b.iter(|| black_box(objective.value_and_gradient(map, &mut gradient)));
        });
        group.finish();
        let few = self::pairs(map.dof(), FEW);
        let objective = Objective::new(&Loss::MeanSquaredError, &few).expect("valid weights");
        let name = format!("{} parameters, {FEW} pairs", gradient.len());
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        group.bench_function("normal equations", |b| {
            b.iter(|| black_box(objective.normal_equations(map)));
        });
        let mut output = few.input().to_vec();
        let teacher = with_weights(of, 2);
        map_points(teacher.composition(), Direction::Forward, &mut output).expect("whole points");
        let taught = Pairs::new("bench", map.dof(), few.input().to_vec(), output).expect("finite");
        group.bench_function("iteration of Levenberg–Marquardt", |b| {
            b.iter_custom(|count| iterations(&model, &taught, count));
        });
        group.finish();
    }
}

/// What valgrind counts.
fn evaluate(times: usize) {
    let model = model(MODELS[1]);
    let map = model.composition();
    let pairs = pairs(map.dof(), 1024);
    let objective = Objective::new(&Loss::MeanSquaredError, &pairs).expect("valid weights");
    let mut gradient = vec![0.0; map.parameters().len()];
    for _ in 0..times {
        black_box(objective.value_and_gradient(map, &mut gradient));
    }
}

criterion_group!(benches, training);

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(position) = arguments.iter().position(|argument| argument == "--count") {
        let times = arguments.get(position + 1).and_then(|times| times.parse().ok());
        evaluate(times.expect("--count takes a number"));
        return;
    }
    benches();
    Criterion::default().configure_from_args().final_summary();
}
