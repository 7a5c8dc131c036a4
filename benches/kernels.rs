//! tanh, roll-outs and Jacobians, each beside the fused multiply-adds that this
//! processor does in the same process: `cargo bench --bench kernels`, with
//! `-- --quick` in a minute.
//!
//! Wall time is noisy; `valgrind --tool=callgrind` on the same program with
//! `--profile-time 1` counts instructions (on what valgrind knows: AVX2).

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use gyroceptron::layer::CircleAction;
use gyroceptron::network::Direction;
use gyroceptron::network::{
    Architecture, GyroceptronShape, InitialWeights, Model, Rollout, Stream, map_jacobians,
    map_jacobians_by_chain_rule, map_points, rollout,
};
use gyroceptron::scalar::{Simd, tanh_sech2, tanh_sech2_of_all};
use std::hint::black_box;
use std::time::Instant;

/// Multiplications, fused or not, of one tanh with its sech². Additions go
/// beside; the one division does not.
const TANH_PRODUCTS: f64 = 23.0;

#[inline(always)]
fn products(lanes: &mut [[f64; 8]; 12], times: usize) {
    // The compiler keeps a copy of its own in registers.
    let mut own = *lanes;
    let (factor, addend) = (black_box([0.999_999; 8]), black_box([1e-9; 8]));
    for _ in 0..times {
        for chain in &mut own {
            for i in 0..8 {
                chain[i] = chain[i].mul_add(factor[i], addend[i]);
            }
        }
    }
    *lanes = own;
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
fn products_avx512(lanes: &mut [[f64; 8]; 12], times: usize) {
    products(lanes, times);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn products_avx2(lanes: &mut [[f64; 8]; 12], times: usize) {
    products(lanes, times);
}

/// Fused multiply-adds a second of one core, in independent chains.
fn peak() -> f64 {
    const TIMES: usize = 1_000_000;
    let mut lanes = [[1.0; 8]; 12];
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        let start = Instant::now();
        match Simd::current() {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `current` gives what the processor has.
            Simd::Avx512 => unsafe { products_avx512(&mut lanes, TIMES) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Simd::Avx2 => unsafe { products_avx2(&mut lanes, TIMES) },
            _ => products(&mut lanes, TIMES),
        }
        black_box(&lanes);
        best = best.min(start.elapsed().as_secs_f64());
    }
    (TIMES * 96) as f64 / best
}

fn model(action: &[i32], psi: Vec<usize>, near_identity: Vec<usize>) -> Model {
    let circle_action = CircleAction::new(action);
    let shape = GyroceptronShape { circle_action, psi, near_identity };
    Architecture::Gyroceptron { shape, epsilon: 0.01 }
        .initialise(InitialWeights::Normal { scale: 0.15 }, 0.7, 1)
        .expect("a valid architecture")
}

fn points(count: usize) -> Vec<f64> {
    let mut stream = Stream::new(1, "points");
    (0..count).map(|_| stream.uniform(-1.5, 1.5)).collect()
}

/// The share of the peak on one thread: `counted` products take so long.
fn share(name: &str, counted: f64, peak: f64, mut work: impl FnMut()) {
    let mut times: Vec<f64> = (0..15)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    let rate = counted / times[times.len() / 2];
    println!(
        "{name}: {:.1} of {:.1} G products/s, {:.0} % of the peak",
        rate / 1e9,
        peak / 1e9,
        100.0 * rate / peak
    );
}

fn shares() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    one.install(|| {
        let peak = peak();
        let x = points(1 << 16);
        let (mut t, mut s) = (x.clone(), x.clone());
        share("tanh and sech²", TANH_PRODUCTS * x.len() as f64, peak, || {
            tanh_sech2_of_all(black_box(&x), &mut t, &mut s);
        });
        for (name, action) in [("4-D", vec![1, 0]), ("6-D", vec![0, 1, 2])] {
            let model = model(&action, vec![8; 10], vec![8; 10]);
            let (map, dim) = (model.composition(), 2 * action.len());
            let mut z = points(4096 * dim);
            // Preactivation, weight and increment of each neuron.
            let neuron = TANH_PRODUCTS + (dim + 1) as f64;
            let counted = neuron * (map.activation_count() * 4096) as f64;
            share(&format!("evaluation, {name}"), counted, peak, || {
                map_points(map, Direction::Forward, black_box(&mut z)).expect("whole points");
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
    group.finish();

    let mut group = criterion.benchmark_group("Jacobians");
    let z = points(4 * 1000);
    let mut jacobians = vec![0.0; 4 * z.len()];
    group.throughput(Throughput::Elements(1000));
    group.bench_function("681 parameters, 4-D", |b| {
        b.iter(|| map_jacobians(large.composition(), black_box(&z), &mut jacobians));
    });
    group.bench_function("the same by the chain rule", |b| {
        b.iter(|| map_jacobians_by_chain_rule(large.composition(), black_box(&z), &mut jacobians));
    });
    group.finish();
}

criterion_group!(benches, kernels);
criterion_main!(benches);
