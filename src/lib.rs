//! Symplectic gyroceptrons.
#![warn(missing_docs)]

pub mod error;
pub mod flow;
#[cfg(feature = "files")]
pub mod io;
pub mod layer;
pub mod measure;
pub mod network;
pub mod phase;
pub mod scalar;
#[cfg(feature = "scenes")]
pub mod scene;
pub mod system;
pub mod train;

pub use error::Error;
