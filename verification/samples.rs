//! The random networks and points that the laws run on.

use gyroceptron::layer::CircleAction;
use gyroceptron::measure::laws::Samples;
use gyroceptron::network::{GyroceptronShape, HenonShape, InitialWeights, Model};
use gyroceptron::random::Stream;
use proptest::prelude::*;
use proptest::sample::select;
use std::f64::consts::TAU;

/// How weights are drawn.
pub const SCALES: [f64; 8] = [0.0, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0];

/// Glorot for 0.
pub fn weights(scale: f64) -> InitialWeights {
    if scale == 0.0 { InitialWeights::Glorot } else { InitialWeights::Normal { scale } }
}

/// The size of the points' components.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Input {
    Uniform(f64),
    /// Each component of a size of its own, 1e-8 … 1e8.
    Mixed,
}

/// A network and points.
#[derive(Clone, Debug)]
pub struct Case {
    pub dof: usize,
    pub layers: usize,
    pub width: usize,
    pub scale: f64,
    pub epsilon: f64,
    pub theta: f64,
    pub action: Vec<i32>,
    pub input: Input,
    pub seed: u64,
}

impl Case {
    /// A HénonNet of `layers` layers.
    pub fn henon_net(&self) -> Model {
        let shape = HenonShape::uniform(self.dof, self.layers, self.width);
        shape
            .architecture(1.0)
            .initialise(weights(self.scale), 0.0, self.seed)
            .expect("a sound architecture")
    }

    /// A gyroceptron whose ψ and I_ε have a quarter of the layers each.
    pub fn model(&self) -> Model {
        let part = vec![self.width; self.layers.div_ceil(4)];
        let shape = GyroceptronShape {
            circle_action: CircleAction::new(self.action.clone()),
            psi: part.clone(),
            near_identity: part,
        };
        shape
            .architecture(self.epsilon)
            .initialise(weights(self.scale), self.theta, self.seed)
            .expect("a sound architecture")
    }

    pub fn gyroceptron(&self) -> Model {
        self.model()
    }

    pub fn points(&self, count: usize) -> Vec<f64> {
        let mut stream = Stream::new(self.seed, "points");
        (0..count * 2 * self.dof)
            .map(|_| match self.input {
                Input::Uniform(size) => size * stream.uniform(-1.6, 1.6),
                Input::Mixed => {
                    let size = libm::pow(10.0, stream.uniform(-8.0, 8.0));
                    size * stream.uniform(-1.0, 1.0)
                }
            })
            .collect()
    }

    pub fn samples(&self, count: usize) -> Samples {
        let mut stream = Stream::new(self.seed, "angles");
        let mut angle = || stream.uniform(-TAU, TAU);
        Samples::new(self.points(count), (0..count).map(|_| [angle(), angle()]).collect())
    }
}

/// All of it: `least` degrees of freedom to 4, up to `layers` layers.
pub fn wide(least: usize, layers: usize) -> impl Strategy<Value = Case> {
    let inputs = [
        Input::Uniform(1.0),
        Input::Uniform(1.0),
        Input::Uniform(1.0),
        Input::Uniform(1e-8),
        Input::Uniform(1e8),
        Input::Mixed,
    ];
    cases(least, layers, SCALES.to_vec(), inputs.to_vec())
}

/// Where all laws are sharp: weights of Glorot to 1, points of size 1.
pub fn mild(least: usize, layers: usize) -> impl Strategy<Value = Case> {
    cases(least, layers, vec![0.0, 0.1, 0.3, 0.6], vec![Input::Uniform(1.0)])
}

fn cases(
    least: usize,
    layers: usize,
    scales: Vec<f64>,
    inputs: Vec<Input>,
) -> impl Strategy<Value = Case> {
    let shape = (least..=4_usize).prop_flat_map(move |dof| {
        let action = prop::collection::vec(-3..=3_i32, dof)
            .prop_filter("acts", |weights| weights.iter().any(|m| *m != 0));
        (Just(dof), 1..=layers, 1..=8_usize, action)
    });
    let epsilons = vec![0.01, 0.1, 1e-4, 1e-8, 0.5, -0.01];
    let rest = (select(scales), select(epsilons), -10.0..10.0_f64, select(inputs), any::<u64>());
    (shape, rest).prop_map(|((dof, layers, width, action), rest)| {
        let (scale, epsilon, theta, input, seed) = rest;
        Case { dof, layers, width, scale, epsilon, theta, action, input, seed }
    })
}

/// The 360 configurations: weight scale × depth × inputs × degrees of freedom.
pub fn grid() -> Vec<Case> {
    let mut out = Vec::new();
    for scale in [0.0, 0.1, 1.0, 10.0, 100.0] {
        for layers in [1, 2, 3, 5, 8, 12, 20, 40] {
            for input in [1e-8, 1.0, 1e8] {
                for dof in 1..=3 {
                    out.push(Case {
                        dof,
                        layers,
                        width: 8,
                        scale,
                        epsilon: 0.01,
                        theta: 2.0,
                        action: [vec![1], vec![0; dof - 1]].concat(),
                        input: Input::Uniform(input),
                        seed: out.len() as u64,
                    });
                }
            }
        }
    }
    out
}

#[test]
fn the_grid_is_what_it_is_said_to_be() {
    assert_eq!(grid().len(), 360);
}
