//! Architectures as model files of format 1 and 2 have them.

use crate::network::{
    Architecture, CouplingGyroceptronShape, GyroceptronShape, HenonShape, NormalFormShape,
    SympNetShape,
};
use serde::Deserialize;

/// A named architecture as model files of format 1 and 2 have it.
#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub(super) enum Named {
    /// A HénonNet; near the identity unless ε = 1.
    HenonNet {
        /// Degrees of freedom and widths.
        #[serde(flatten)]
        shape: HenonShape,
        /// The parameter ε of the file.
        epsilon: f64,
    },
    /// A symplectic gyroceptron of Hénon layers.
    Gyroceptron {
        /// The circle action, and the widths of the layers of ψ and I_ε.
        #[serde(flatten)]
        shape: GyroceptronShape,
        /// The parameter ε of the file.
        epsilon: f64,
    },
    /// A gyroceptron in normal form.
    NormalForm {
        /// Action, widths and flow time.
        #[serde(flatten)]
        shape: NormalFormShape,
        /// The parameter ε of the file.
        epsilon: f64,
    },
    /// A gyroceptron of affine couplings: not symplectic.
    CouplingGyroceptron {
        /// The circle action, the widths of the couplings of ψ and I_ε, and the flow time.
        #[serde(flatten)]
        shape: CouplingGyroceptronShape,
        /// The parameter ε of the file.
        epsilon: f64,
    },
    /// An LA-SympNet: linear modules with an activation module between each two of them.
    SympNet {
        /// The degrees of freedom, the numbers of modules and shears, and the activation.
        #[serde(flatten)]
        shape: SympNetShape,
    },
}

impl From<Named> for Architecture {
    fn from(named: Named) -> Self {
        match named {
            Named::HenonNet { shape, epsilon } => shape.architecture(epsilon),
            Named::Gyroceptron { shape, epsilon } => shape.architecture(epsilon),
            Named::NormalForm { shape, epsilon } => shape.architecture(epsilon),
            Named::CouplingGyroceptron { shape, epsilon } => shape.architecture(epsilon),
            Named::SympNet { shape } => shape.architecture(),
        }
    }
}
