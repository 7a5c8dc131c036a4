//! A gyroceptron of one degree of freedom with random weights.

use crate::error::Error;
use crate::layer::CircleAction;
use crate::network::{Architecture, GyroceptronShape, InitialWeights, LayerSizes, Model};
use serde::{Deserialize, Serialize};

/// A gyroceptron of one degree of freedom with random weights, and where its orbits
/// start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RandomNetwork {
    /// The number and the widths of the layers of ψ.
    pub psi: LayerSizes,
    /// The number and the widths of the layers of the near-identity map I_ε.
    pub near_identity: LayerSizes,
    /// The angle θ, in radians.
    pub theta: f64,
    /// How its weights are drawn.
    pub weights: InitialWeights,
    /// The initial point (q, p).
    pub initial: [f64; 2],
}

impl RandomNetwork {
    pub(super) fn check(&self) -> Result<(), Error> {
        Error::check_finite("network.theta", self.theta)?;
        for (key, layers) in [("psi", self.psi), ("near_identity", self.near_identity)] {
            Error::check_count_range(&format!("network.{key}.count"), layers.count, 1, 1000)?;
        }
        self.initial.iter().try_for_each(|v| Error::check_finite("network.initial", *v))?;
        self.architecture(0.0).check().map_err(|e| e.with_place("network"))
    }

    fn architecture(&self, epsilon: f64) -> Architecture {
        let shape = GyroceptronShape {
            circle_action: CircleAction::new([1]),
            psi: self.psi.widths(),
            near_identity: self.near_identity.widths(),
        };
        shape.architecture(epsilon)
    }

    /// With the weights of this seed.
    pub(super) fn draw(&self, epsilon: f64, seed: u64) -> Result<Model, Error> {
        self.architecture(epsilon).initialise(self.weights, self.theta, seed)
    }

    /// A description of the network in words, for reports.
    pub(super) fn words(&self) -> String {
        format!(
            "ψ: {} layers of {}; I_ε: {} layers of {}; θ = {}; from (q, p) = {:?}; weights {}",
            self.psi.count,
            self.psi.width.two()[0],
            self.near_identity.count,
            self.near_identity.width.two()[0],
            self.theta,
            self.initial,
            serde_json::to_string(&self.weights).unwrap_or_default()
        )
    }
}
