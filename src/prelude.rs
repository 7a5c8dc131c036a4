//! The items that most programs with the library use: `use gyroceptron::prelude::*;`.

pub use crate::error::Error;
pub use crate::flow::{Pairs, Window};
#[cfg(feature = "files")]
pub use crate::io::{StoredModel, load_model, read_pairs, save_model};
pub use crate::layer::{CircleAction, TorusAction};
pub use crate::measure::certificate::{CertificateOptions, certify};
pub use crate::network::{
    Architecture, Block, InitialWeights, Layers, Model, NetworkSpec, Part, Rollout,
};
pub use crate::phase::{Direction, Map};
pub use crate::system::{Hamiltonian, Oscillators};
pub use crate::train::{Fit, Fitted, Judgement};
