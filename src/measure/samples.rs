//! How the samples of a certificate are drawn.

use crate::error::Error;
use serde::{Deserialize, Serialize};

/// The samples of a certificate: uniform in |z_i| ≤ `radius`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CertificateOptions {
    /// The number of points that are drawn.
    pub samples: usize,
    /// Half the side of the box, in the coordinates of the map: those of the network where a model has units.
    pub radius: f64,
    /// The seed of the stream that the points are drawn from.
    pub seed: u64,
}

impl Default for CertificateOptions {
    fn default() -> Self {
        Self { samples: 200, radius: 1.6, seed: 0 }
    }
}

impl CertificateOptions {
    /// Fails unless there are samples, in a box of finite size.
    ///
    /// # Errors
    /// [`Error::CountOutOfRange`] or [`Error::OutOfRange`] with the option.
    pub fn check(&self) -> Result<(), Error> {
        const MOST: usize = 10_000_000;
        const LARGEST: f64 = 1e150;
        Error::check_count_range("samples", self.samples, 1, MOST)?;
        Error::check_range("radius", self.radius, Error::LEAST_POSITIVE, LARGEST)
    }
}
