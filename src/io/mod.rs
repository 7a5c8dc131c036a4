//! Files: models, data sets, weights of others, checkpoints.
//!
//! Every file is written to a temporary name in its folder and renamed, so
//! that a reader, or a killed run, never sees half of one.

mod arrays;
mod checkpoints;
mod code;
mod coils;
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
    read_trajectories, write_pairs, write_points, write_section, write_trajectories,
};
pub use checkpoints::Checkpoints;
pub use code::{SourceCode, SourceLanguage};
pub use coils::{parse_coils, read_coils};
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

use crate::error::Error;
use std::io::Write;
use std::path::Path;

/// How the name of a file begins that is not yet whole.
pub(crate) const TEMPORARY: &str = ".gyroceptron-";

/// Writes a file whole or not at all.
///
/// # Errors
/// [`Error::Write`] with the path.
pub fn write_atomically(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), Error> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let attempt = || -> std::io::Result<()> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(TEMPORARY);
        // Temporary files are private by default; results follow the umask.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut file = builder.tempfile_in(folder)?;
        let mut buffered = std::io::BufWriter::new(file.as_file_mut());
        fill(&mut buffered)?;
        buffered.flush()?;
        drop(buffered);
        file.persist(path).map_err(|e| e.error)?;
        Ok(())
    };
    attempt().map_err(|reason| Error::write(path, reason))
}

/// SHA-256 of a file, in hexadecimal.
///
/// # Errors
/// [`Error::Read`].
pub fn file_digest(path: &Path) -> Result<String, Error> {
    Ok(crate::digest::of_bytes(&read_bytes(path)?))
}

/// The bytes of a file.
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>, Error> {
    std::fs::read(path).map_err(|reason| Error::read(path, reason))
}
