//! Seeded random streams and initial weights.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// A seeded stream of random numbers with a name.
///
/// Every use of randomness has its own stream, so that drawing more for one
/// purpose changes nothing for another. The generator is PCG-64 seeded with
/// SHA-256(seed, name); the mapping to [0, 1) is ours, so that the numbers
/// change with neither platform nor dependency.
#[derive(Clone, Debug)]
pub struct Stream {
    generator: Pcg64,
}

impl Stream {
    /// The stream `name` of this seed.
    pub fn new(seed: u64, name: &str) -> Self {
        let mut hash = Sha256::new();
        hash.update(seed.to_le_bytes());
        hash.update(name.as_bytes());
        let digest: [u8; 32] = hash.finalize().into();
        Self { generator: Pcg64::from_seed(digest) }
    }

    /// Uniform in [0, 1), 53 bits.
    pub fn unit(&mut self) -> f64 {
        (self.generator.next_u64() >> 11) as f64 * (f64::EPSILON / 2.0)
    }

    /// Uniform in [low, high).
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        (high - low).mul_add(self.unit(), low)
    }

    /// Normal with mean 0 and variance 1 (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.unit())).sqrt();
        radius * libm::cos(std::f64::consts::TAU * self.unit())
    }
}

/// How weights are drawn before training.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum InitialWeights {
    /// Glorot's uniform law, ±√(6/(fan-in + fan-out)), for W and w; the bounds
    /// of W for b and η too.
    ///
    /// With b = η = 0 the potential would be odd and the layer's generator
    /// −[V(y) + V(−y−η) + V(−x) + V(x−η)] zero: I_ε would differ from the
    /// identity in second order only.
    Glorot,
    /// Normal with standard deviation `scale` for all of W, b, w and η.
    Normal {
        /// The standard deviation.
        scale: f64,
    },
}

impl InitialWeights {
    /// The parameters of one layer, in the layout of the
    /// [network module](super).
    pub fn layer(self, dof: usize, width: usize, stream: &mut Stream) -> Vec<f64> {
        match self {
            Self::Glorot => {
                let inner = (6.0 / (dof + width) as f64).sqrt();
                let outer = (6.0 / (width + 1) as f64).sqrt();
                let mut out: Vec<f64> =
                    (0..dof * width).map(|_| stream.uniform(-inner, inner)).collect();
                out.extend((0..width).map(|_| stream.uniform(-inner, inner)));
                out.extend((0..width).map(|_| stream.uniform(-outer, outer)));
                out.extend((0..dof).map(|_| stream.uniform(-inner, inner)));
                out
            }
            Self::Normal { scale } => (0..crate::layer::layer_parameter_count(dof, width))
                .map(|_| scale * stream.normal())
                .collect(),
        }
    }
}
