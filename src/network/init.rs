//! Initial weights.

use super::SympNetShape;
use crate::random::Stream;
use serde::{Deserialize, Serialize};

/// How weights are drawn before training.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum InitialWeights {
    /// Glorot's uniform law, ±√(6/(fan-in + fan-out)), for W and w; the bounds
    /// of W for b and η too. Of SympNets, ±√(3/n) for all.
    ///
    /// With b = η = 0 the potential would be odd and the layer's generator
    /// −[V(y) + V(−y−η) + V(−x) + V(x−η)] zero: I_ε would differ from the
    /// identity in second order only.
    Glorot,
    /// Normal with standard deviation `scale` for all of W, b, w and η, and for all
    /// parameters of SympNets.
    Normal {
        /// The standard deviation.
        scale: f64,
    },
}

impl InitialWeights {
    /// The parameters of a SympNet.
    pub(super) fn modules(self, shape: &SympNetShape, stream: &mut Stream) -> Vec<f64> {
        let bound = (3.0 / shape.dof as f64).sqrt();
        let draw = |_| match self {
            Self::Glorot => stream.uniform(-bound, bound),
            Self::Normal { scale } => scale * stream.normal(),
        };
        (0..shape.parameter_count()).map(draw).collect()
    }

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
