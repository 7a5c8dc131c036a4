//! tanh, roll-outs and Jacobians, each beside the fused multiply-adds that this
//! processor does in the same process: `cargo bench --bench kernels`, with
//! `-- --quick` in a minute.
//!
//! Wall time is noisy: `training.rs` says how to count instructions.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use gyroceptron::layer::{CircleAction, Neuron};
use gyroceptron::network::{
    Alternating, GyroceptronShape, InitialWeights, LayerSizes, Model, NetworkSpec, Rollout,
    map_jacobians, map_jacobians_by_duals, map_points, rollout,
};
use gyroceptron::phase::Direction;
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Simd, tanh_sech2, tanh_sech2_of_all};
use peak::{SECH2_PRODUCTS, TANH_PRODUCTS, peak, share};
use std::hint::black_box;

mod peak;

fn model(action: &[i32], psi: Vec<usize>, near_identity: Vec<usize>) -> Model {
    let circle_action = CircleAction::new(action);
    let shape = GyroceptronShape { circle_action, psi, near_identity };
    shape
        .architecture(0.01)
        .initialise(InitialWeights::Normal { scale: 0.15 }, 0.7, 1)
        .expect("a valid architecture")
}

fn points(count: usize) -> Vec<f64> {
    let mut stream = Stream::new(1, "points");
    (0..count).map(|_| stream.uniform(-1.5, 1.5)).collect()
}

/// Products of a neuron with n inputs: preactivation, sech², weight, increments.
fn evaluation(n: f64) -> f64 {
    SECH2_PRODUCTS + 2.0 * n + 1.0
}

/// With 2n derivatives along: tanh, those of the preactivation, of sech²,
/// of the weight and of the increments.
fn derivatives(n: f64) -> f64 {
    TANH_PRODUCTS - SECH2_PRODUCTS + 2.0 + 2.0 * n * (n + 1.0 + 1.0 + n)
}

fn shares() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    one.install(|| {
        let peak = peak();
        let x = points(1 << 16);
        let (mut t, mut s) = (x.clone(), x.clone());
        share("tanh and sech²", x.len(), TANH_PRODUCTS, peak, || {
            tanh_sech2_of_all(black_box(&x), &mut t, &mut s);
        });
        for (name, action) in [("4-D", vec![1, 0]), ("6-D", vec![0, 1, 2])] {
            const POINTS: usize = 4096;
            let model = model(&action, vec![8; 10], vec![8; 10]);
            let (map, dim) = (model.composition(), 2 * action.len());
            let n = action.len() as f64;
            let neurons = map.activation_count() as f64;
            let mut z = points(POINTS * dim);
            share(&format!("evaluation, {name}"), POINTS, evaluation(n) * neurons, peak, || {
                map_points(map, Direction::Forward, black_box(&mut z)).expect("whole points");
            });
            let request = Rollout { steps: 8, every: 8 };
            let start = points(POINTS / 8 * dim);
            share(&format!("roll-out, {name}"), POINTS, evaluation(n) * neurons, peak, || {
                black_box(rollout(map, black_box(&start), request).expect("whole points"));
            });
            let request = Rollout { steps: 64, every: 64 };
            let name_alone = format!("roll-out of one trajectory, {name}");
            share(&name_alone, 64, evaluation(n) * neurons, peak, || {
                black_box(rollout(map, black_box(&start[..dim]), request).expect("a point"));
            });
            let mut jacobians = vec![0.0; POINTS * dim * dim];
            let products = (evaluation(n) + derivatives(n)) * neurons;
            share(&format!("Jacobian, {name}"), POINTS, products, peak, || {
                map_jacobians_by_duals(map, black_box(&z), &mut jacobians).expect("whole points");
            });
        }
    });
}

fn kernels(criterion: &mut Criterion) {
    shares();
    let x = points(4096);
    let (mut t, mut s) = (x.clone(), x.clone());
    let mut group = criterion.benchmark_group("tanh and sech²");
    group.throughput(Throughput::Elements(x.len() as u64));
    for set in Simd::ALL.into_iter().filter(|set| set.is_available()) {
        set.limit();
        group.bench_function(format!("{set:?}"), |b| {
            b.iter(|| tanh_sech2_of_all(black_box(&x), &mut t, &mut s));
        });
    }
    Simd::Avx512.limit();
    group.bench_function("one after another", |b| {
        b.iter(|| black_box(&x).iter().map(|&x| tanh_sech2(x)).fold(0.0, |a, v| a + v.0 + v.1));
    });
    group.bench_function("std's tanh alone", |b| {
        b.iter(|| black_box(&x).iter().map(|x| x.tanh()).sum::<f64>());
    });
    group.bench_function("libm's tanh alone", |b| {
        b.iter(|| black_box(&x).iter().map(|&x| libm::tanh(x)).sum::<f64>());
    });
    group.finish();

    let large = model(&[1, 0], vec![8; 10], vec![8; 10]);
    let small = model(&[1], vec![8; 3], vec![8; 3]);
    let mut group = criterion.benchmark_group("roll-out, a step and trajectory");
    for (name, model, dim, count, steps) in [
        ("one degree of freedom, one trajectory", &small, 2, 1, 1000),
        ("one degree of freedom, 64 trajectories", &small, 2, 64, 100),
        ("681 parameters, 7 trajectories", &large, 4, 7, 100),
        ("681 parameters, 1000 trajectories", &large, 4, 1000, 10),
    ] {
        let initial = points(dim * count);
        let request = Rollout { steps, every: steps };
        group.throughput(Throughput::Elements((steps * count) as u64));
        group.bench_function(name, |b| {
            b.iter(|| rollout(model.composition(), black_box(&initial), request));
        });
    }
    // The normal form of `run long-steps` at ε = 0.01.
    for neuron in [Neuron::Tanh, Neuron::Arctan] {
        let sizes = |count, width| LayerSizes {
            width,
            activation: Some(neuron),
            ..LayerSizes::uniform(count, 1)
        };
        let of = NetworkSpec::named("normal-form")
            .and_then(|of| of.with_size("kicks", sizes(8, Alternating::Same(8))))
            .and_then(|of| of.with_size("twists", sizes(24, Alternating::Two([2, 12]))))
            .and_then(|of| of.architecture(&CircleAction::new([1, 0]).into(), 0.01, 200.0))
            .and_then(|of| of.initialise(InitialWeights::Normal { scale: 0.15 }, 0.7, 1))
            .expect("a valid architecture");
        let (initial, request) = (points(4 * 64), Rollout { steps: 1000, every: 1000 });
        group.throughput(Throughput::Elements(64 * 1000));
        group.bench_function(format!("a normal form of {}, 64 trajectories", neuron.name()), |b| {
            b.iter(|| of.rollout(black_box(&initial), request));
        });
    }
    group.finish();

    let mut group = criterion.benchmark_group("Jacobians");
    let z = points(4 * 1000);
    let mut jacobians = vec![0.0; 4 * z.len()];
    group.throughput(Throughput::Elements(1000));
    group.bench_function("681 parameters, 4-D", |b| {
        b.iter(|| map_jacobians_by_duals(large.composition(), black_box(&z), &mut jacobians));
    });
    group.bench_function("the same by the chain rule", |b| {
        b.iter(|| map_jacobians(large.composition(), black_box(&z), &mut jacobians));
    });
    group.finish();
}

criterion_group!(benches, kernels);
criterion_main!(benches);
