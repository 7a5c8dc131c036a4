//! One evaluation of the loss and of its gradient on 60,000 pairs, for the
//! models of the paper: `cargo bench --bench training`.
//!
//! `RAYON_NUM_THREADS=1 cargo bench --bench training` is the same on one core.

use criterion::{Criterion, criterion_group, criterion_main};
use gyroceptron::flow::Pairs;
use gyroceptron::layer::CircleAction;
use gyroceptron::network::{Architecture, GyroceptronShape, InitialWeights, Stream};
use gyroceptron::train::{Loss, Objective};
use std::hint::black_box;

const SAMPLES: usize = 60_000;

fn training(criterion: &mut Criterion) {
    for (action, psi, near_identity) in [
        (vec![1, 0], vec![8; 10], vec![6; 8]),
        (vec![1, 0], vec![8; 10], vec![8; 10]),
        (vec![0, 1, 2], vec![8; 12], vec![8; 12]),
    ] {
        let shape =
            GyroceptronShape { circle_action: CircleAction::new(action), psi, near_identity };
        let dim = 2 * shape.dof();
        let architecture = Architecture::Gyroceptron { shape, epsilon: 0.01 };
        let model = architecture
            .initialise(InitialWeights::Normal { scale: 0.15 }, 5.0, 1)
            .expect("a valid architecture");
        let mut stream = Stream::new(1, "points");
        let mut points =
            || (0..SAMPLES * dim).map(|_| stream.uniform(-1.6, 1.6)).collect::<Vec<_>>();
        let pairs = Pairs::new("bench", dim / 2, points(), points()).expect("finite numbers");
        let objective = Objective::new(&Loss::MeanSquaredError, &pairs).expect("valid weights");
        let map = model.composition();
        let mut gradient = vec![0.0; map.parameters().len()];
        let name = format!("{} parameters, {SAMPLES} pairs", gradient.len());
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        group.bench_function("loss", |b| b.iter(|| black_box(objective.value(map))));
        group.bench_function("loss and gradient", |b| {
            b.iter(|| black_box(objective.value_and_gradient(map, &mut gradient)));
        });
        group.finish();
    }
}

criterion_group!(benches, training);
criterion_main!(benches);
