//! Time and memory against samples, width, depth, degrees of freedom and threads,
//! with the exponents fitted to them: `cargo bench --bench scaling`, with
//! `-- --quick` in a minute.
//!
//! Memory is the largest that was allocated beyond what was there before: for the
//! loss beyond its pairs, for a roll-out beyond its result.

use gyroceptron::flow::Pairs;
use gyroceptron::layer::CircleAction;
use gyroceptron::measure::{adiabatic::log_line, timing::Spread};
use gyroceptron::network::{
    GyroceptronShape, InitialWeights, Model, Rollout, map_jacobians_by_duals, rollout,
};
use gyroceptron::random::Stream;
use gyroceptron::train::{Loss, Objective};
use peak_alloc::PeakAlloc;
use std::hint::black_box;
use std::time::Instant;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// A setting, as what it is fitted against, and what was measured at it.
struct Row {
    varied: f64,
    parameters: usize,
    measured: Vec<Measured>,
}

struct Measured {
    seconds: Spread,
    /// Bytes.
    peak: usize,
}

/// Median time of repeated runs, and the peak of one.
fn measure(rounds: usize, mut work: impl FnMut()) -> Measured {
    MEMORY.reset_peak_usage();
    let before = MEMORY.current_usage();
    work();
    let peak = MEMORY.peak_usage().saturating_sub(before);
    let seconds = (0..rounds)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64()
        })
        .collect();
    Measured { seconds: Spread::from_values(seconds).expect("at least one round"), peak }
}

/// `layers` of `width` neurons, half of them in ψ.
fn model(dof: usize, layers: usize, width: usize) -> Model {
    let action: Vec<i32> = (0..dof).map(|j| i32::from(j == 0)).collect();
    let shape = GyroceptronShape {
        circle_action: CircleAction::new(action),
        psi: vec![width; layers / 2],
        near_identity: vec![width; layers - layers / 2],
    };
    shape
        .architecture(0.01)
        .initialise(InitialWeights::Normal { scale: 0.15 }, 5.0, 1)
        .expect("a valid architecture")
}

fn points(count: usize) -> Vec<f64> {
    let mut stream = Stream::new(1, "points");
    (0..count).map(|_| stream.uniform(-1.6, 1.6)).collect()
}

/// Loss and gradient; a roll-out; Jacobians.
fn work(model: &Model, samples: usize, rounds: usize) -> Vec<Measured> {
    const STEPS: usize = 10;
    let map = model.composition();
    let dim = 2 * map.dof();
    let input = points(samples * dim);
    let pairs = Pairs::new("pairs", map.dof(), input.clone(), input).expect("finite numbers");
    let objective = Objective::new(&Loss::MeanSquaredError, &pairs).expect("valid weights");
    let mut gradient = vec![0.0; map.parameters().len()];
    let loss = measure(rounds, || {
        black_box(objective.value_and_gradient(map, &mut gradient));
    });
    // A tenth of the points: ten steps are as many evaluations.
    let start = &pairs.input()[..(samples / STEPS).max(1) * dim];
    let request = Rollout { steps: STEPS, every: STEPS };
    let mut rolled = measure(rounds, || {
        black_box(rollout(map, start, request).expect("whole points"));
    });
    rolled.peak = rolled.peak.saturating_sub(2 * size_of_val(start));
    let chosen = &pairs.input()[..(samples / STEPS).max(1) * dim];
    let mut out = vec![0.0; chosen.len() * dim];
    let jacobians = measure(rounds, || {
        map_jacobians_by_duals(map, chosen, &mut out).expect("whole points");
        black_box(&out);
    });
    vec![loss, rolled, jacobians]
}

const WORKS: [&str; 3] =
    ["loss and gradient", "roll-out, 10 steps of a tenth", "Jacobians at a tenth"];

/// A table, and below it the exponents with their standard errors.
fn report(title: &str, varied: &str, rows: &[Row]) {
    println!("\n## {title}\n");
    let by_parameters = varied == "parameters";
    print!("| {varied} |{}", if by_parameters { "" } else { " parameters |" });
    for name in WORKS {
        print!(" {name}, ms | MiB beside |");
    }
    println!("\n|{}", "---|".repeat(2 * WORKS.len() + if by_parameters { 1 } else { 2 }));
    for row in rows {
        print!("| {} |", row.varied);
        if !by_parameters {
            print!(" {} |", row.parameters);
        }
        for measured in &row.measured {
            let Spread { lower, median, upper } = measured.seconds.scaled(1e3);
            let mebibytes = measured.peak as f64 / f64::from(1 << 20);
            print!(" {median:.3} ({lower:.3} – {upper:.3}) | {mebibytes:.3} |");
        }
        println!();
    }
    if rows.len() < 3 {
        println!("\nToo few rows for an exponent: their ratio says it.");
        return;
    }
    let x: Vec<f64> = rows.iter().map(|row| row.varied).collect();
    println!();
    for (index, name) in WORKS.iter().enumerate() {
        let fit = |value: &dyn Fn(&Measured) -> f64| {
            let y: Vec<f64> = rows.iter().map(|row| value(&row.measured[index])).collect();
            let line = log_line(&x, &y);
            format!("{:.2} ± {:.2}", line.slope, line.slope_error)
        };
        println!(
            "- {name}: time ∝ {varied} to the power {}, memory beside {}",
            fit(&|measured| measured.seconds.median),
            fit(&|measured| measured.peak.max(1) as f64)
        );
    }
}

fn main() {
    let quick = std::env::args().any(|argument| argument == "--quick");
    let rounds = if quick { 3 } else { 9 };
    let few = if quick { 4_000 } else { 20_000 };
    let row = |varied: usize, model: &Model, samples: usize| Row {
        varied: varied as f64,
        parameters: model.composition().parameters().len(),
        measured: work(model, samples, rounds),
    };

    let paper = model(2, 20, 8);
    let most = if quick { 100_000 } else { 1_000_000 };
    let samples: Vec<usize> = [1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000]
        .into_iter()
        .filter(|n| *n <= most)
        .collect();
    let rows: Vec<Row> = samples.iter().map(|&n| row(n, &paper, n)).collect();
    report("Samples: 2 degrees of freedom, 20 layers of 8", "samples", &rows);

    let rows: Vec<Row> = [4, 8, 16, 32, 64, 128]
        .into_iter()
        .map(|width| {
            let model = model(2, 20, width);
            let parameters = model.composition().parameters().len();
            row(parameters, &model, few)
        })
        .collect();
    report("Parameters, by width: 2 degrees of freedom, 20 layers", "parameters", &rows);

    let rows: Vec<Row> = [2, 4, 8, 16, 32, 64, 128]
        .into_iter()
        .map(|layers| row(layers, &model(2, layers, 8), few))
        .collect();
    report("Depth: 2 degrees of freedom, layers of 8", "layers", &rows);

    let rows: Vec<Row> = (1..=8).map(|dof| row(dof, &model(dof, 20, 8), few)).collect();
    report("Degrees of freedom: 20 layers of 8", "degrees of freedom", &rows);

    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let rows: Vec<Row> = (1..=cores)
        .map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads").install(|| row(threads, &paper, 3 * few))
        })
        .collect();
    report("Threads: 2 degrees of freedom, 20 layers of 8", "threads", &rows);
}
