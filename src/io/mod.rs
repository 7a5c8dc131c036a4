//! Files: models, data sets, weights of others, checkpoints.
//!
//! Every file is written to a temporary name in its folder and renamed, so
//! that a reader, or a killed run, never sees half of one.

mod arrays;
mod checkpoints;
mod code;
mod coils;
mod files;
mod json;
mod legacy;
mod npy;
mod polynomials;
#[cfg(feature = "proofs")]
mod proofs;
mod stored_controls;
mod tensor;
mod tensor_bundle;
mod weights;

pub use arrays::{
    PairsFile, PointsFile, parse_pairs, parse_points, read_pairs, read_points, read_section,
    read_trajectories, read_trajectories_until_lost, write_pairs, write_points, write_section,
    write_trajectories,
};
pub use checkpoints::Checkpoints;
pub use code::{SourceCode, SourceLanguage};
pub use coils::{parse_coils, read_coils};
pub(crate) use files::{TEMPORARY, read_bytes};
pub use files::{file_digest, write_atomically};
pub use json::{
    MODEL_VERSION, Provenance, RolledOut, StoredModel, earlier_checkpoint, load_checkpoint,
    load_model, model_text, parse_model, save_checkpoint, save_model,
};
pub use polynomials::{
    StoredMap, StoredPolynomial, load_map, load_polynomial, parse_polynomial, polynomial_text,
    save_polynomial,
};
#[cfg(feature = "proofs")]
pub use proofs::{ABOUT as ABOUT_PROOFS, Nested, ProofFile, ProofRequest, Proofs};
pub use tensor::Tensor;
pub use weights::{
    WeightsFormat, assemble_architecture, assemble_weights, export_weights, import_weights,
    parse_tensors, read_architecture, read_tensors, take_units,
};

/// Items for the tests of this crate; they are not part of the public API.
#[doc(hidden)]
pub mod internals {
    pub use super::npy::{Array, read_array, write_array};
    pub use super::tensor_bundle::{crc32c, parse};
}
