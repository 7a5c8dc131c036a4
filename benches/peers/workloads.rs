//! The work that `compare.py` times beside JAX. Run that.
//!
//! `prepare FOLDER` writes parameters, points and results as raw numbers, so that
//! the other side does the same work and is checked; `serve` then runs a workload
//! for each name that is read, and prints its seconds.

use gyroceptron::flow::Pairs;
use gyroceptron::layer::CircleAction;
use gyroceptron::network::{
    Composition, GyroceptronShape, InitialWeights, Model, Part, Rollout, map_jacobians,
    map_jacobians_by_duals, rollout,
};
use gyroceptron::random::Stream;
use gyroceptron::train::{Loss, Objective};
use std::error::Error;
use std::hint::black_box;
use std::io::{BufRead, Write};
use std::path::Path;
use std::time::Instant;

/// A way to the Jacobians at all points.
type Way = fn(&Composition<f64>, &[f64], &mut [f64]) -> Result<(), gyroceptron::Error>;

/// What is done with the model.
enum Kind {
    /// Loss and gradient on the pairs.
    Loss(Pairs),
    /// All states of so many steps.
    Rollout(usize),
    /// The Jacobian at every point, by duals or by the chain rule.
    Jacobians(Way),
}

struct Workload {
    name: &'static str,
    model: Model,
    points: Vec<f64>,
    kind: Kind,
    threads: usize,
}

/// Steps whose states are compared: rounding grows behind.
const COMPARED: usize = 3;

fn workload(
    name: &'static str,
    layers: (&[i32], usize, usize, usize, usize),
    points: usize,
    threads: usize,
    kind: impl Fn(&mut dyn FnMut() -> Vec<f64>, Vec<f64>) -> Kind,
) -> Workload {
    let (action, psi, psi_width, near, near_width) = layers;
    let shape = GyroceptronShape {
        circle_action: CircleAction::new(action),
        psi: vec![psi_width; psi],
        near_identity: vec![near_width; near],
    };
    let dim = 2 * action.len();
    let model = shape
        .architecture(0.01)
        .initialise(InitialWeights::Normal { scale: 0.15 }, 0.7, 1)
        .expect("a valid architecture");
    let mut stream = Stream::new(1, name);
    let mut draw = || (0..points * dim).map(|_| stream.uniform(-1.5, 1.5)).collect::<Vec<f64>>();
    let input = draw();
    let kind = kind(&mut draw, input.clone());
    Workload { name, model, points: input, kind, threads }
}

fn workloads() -> Vec<Workload> {
    let all = std::thread::available_parallelism().map_or(1, |n| n.get());
    let pairs = |dof: usize| {
        move |draw: &mut dyn FnMut() -> Vec<f64>, input| {
            Kind::Loss(Pairs::new("peers", dof, input, draw()).expect("finite numbers"))
        }
    };
    let steps = |n| move |_: &mut dyn FnMut() -> Vec<f64>, _| Kind::Rollout(n);
    vec![
        workload("loss-681", (&[1, 0], 10, 8, 10, 8), 60_000, all, pairs(2)),
        workload("loss-1033", (&[0, 1, 2], 12, 8, 12, 8), 60_000, all, pairs(3)),
        workload("rollout-549", (&[1, 0], 10, 8, 8, 6), 7, all, steps(40_000)),
        workload("jacobians-681", (&[1, 0], 10, 8, 10, 8), 10_000, all, |_, _| {
            Kind::Jacobians(map_jacobians_by_duals)
        }),
        workload("jacobians-681-by-chain-rule", (&[1, 0], 10, 8, 10, 8), 10_000, all, |_, _| {
            Kind::Jacobians(map_jacobians)
        }),
        workload("one-trajectory", (&[1], 3, 8, 3, 8), 1, 1, steps(20_000)),
        workload("64-trajectories", (&[1], 3, 8, 3, 8), 64, 1, steps(5_000)),
    ]
}

impl Workload {
    fn run(&self) -> Vec<f64> {
        let map = self.model.composition();
        match &self.kind {
            Kind::Loss(pairs) => {
                let objective = Objective::new(&Loss::MeanSquaredError, pairs).expect("weights");
                let mut gradient = vec![0.0; map.parameters().len()];
                let loss = objective.value_and_gradient(map, &mut gradient);
                gradient.insert(0, loss);
                gradient
            }
            Kind::Rollout(steps) => {
                let request = Rollout { steps: *steps, every: 1 };
                rollout(map, &self.points, request).expect("memory for the states")
            }
            Kind::Jacobians(f) => {
                let mut out = vec![0.0; self.points.len() * 2 * map.dof()];
                f(map, &self.points, &mut out).expect("whole points");
                out
            }
        }
    }

    fn write(&self, folder: &Path) -> Result<(), Box<dyn Error>> {
        let folder = folder.join(self.name);
        std::fs::create_dir_all(&folder)?;
        let write = |part: &str, values: &[f64]| {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            std::fs::write(folder.join(format!("{part}.f64")), bytes)
        };
        let architecture = self.model.architecture();
        let [circle] = &architecture.circles[..] else { return Err("not a gyroceptron".into()) };
        let mut meta = serde_json::json!({
            "circle_action": circle.weights(),
            "psi": architecture.widths(Part::Conjugation),
            "near_identity": architecture.widths(Part::NearIdentity),
            "epsilon": architecture.epsilon,
            "threads": self.threads,
        });
        let mut result = self.run();
        match &self.kind {
            Kind::Loss(pairs) => {
                meta["kind"] = "loss".into();
                write("output", pairs.output())?;
            }
            Kind::Rollout(steps) => {
                meta["kind"] = "rollout".into();
                meta["steps"] = (*steps).into();
                meta["compared"] = COMPARED.into();
                // The first state kept is the input.
                result = result[self.points.len()..][..COMPARED * self.points.len()].to_vec();
            }
            Kind::Jacobians(_) => meta["kind"] = "jacobians".into(),
        }
        write("parameters", self.model.composition().parameters())?;
        write("input", &self.points)?;
        write("result", &result)?;
        std::fs::write(folder.join("meta.json"), serde_json::to_string_pretty(&meta)?)?;
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let workloads = workloads();
    match arguments[..] {
        ["prepare", folder] => {
            for workload in &workloads {
                workload.write(Path::new(folder))?;
            }
        }
        ["serve"] => {
            for line in std::io::stdin().lock().lines() {
                let line = line?;
                let workload = workloads.iter().find(|w| w.name == line.trim());
                let workload = workload.ok_or_else(|| format!("no workload {line}"))?;
                let threads = rayon::ThreadPoolBuilder::new().num_threads(workload.threads);
                let seconds = threads.build()?.install(|| {
                    let start = Instant::now();
                    black_box(workload.run());
                    start.elapsed().as_secs_f64()
                });
                println!("{seconds:e}");
                std::io::stdout().flush()?;
            }
        }
        _ => println!("run benches/peers/compare.py, which runs this beside JAX"),
    }
    Ok(())
}
