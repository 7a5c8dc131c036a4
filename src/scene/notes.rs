//! Notes on pairs and models, beside the results. The program prints them; the module for Python warns, or keeps them
//! with the model.

use crate::flow::Region;
use crate::io::StoredModel;
use crate::measure::{adiabatic::OwnInvariance, certificate::CertificateOptions};
use crate::random::Stream;
use std::fmt;

/// A note on the numbers of a file. Its text names no place and no option: the caller adds them.
#[derive(Clone, Copy, Debug)]
pub enum Note<'a> {
    /// The numbers of the file are float32, in single precision.
    SinglePrecision,
    /// Arrays of these names are in the file and are not used.
    Unused(&'a [String]),
}

impl fmt::Display for Note<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SinglePrecision => f.write_str("float32 numbers, taken as they are"),
            Self::Unused(names) => write!(f, "not used: {}", names.join(", ")),
        }
    }
}

/// Initial points of orbits: of the box that a model was trained in, or else of that of the samples, halfway to
/// its ends at most, in the coordinates of the network.
fn starts_of_orbits(stored: &StoredModel, options: &CertificateOptions) -> Vec<f64> {
    let dim = 2 * stored.model.composition().dof();
    let box_of_samples =
        Region { low: vec![-options.radius; dim], high: vec![options.radius; dim] };
    let region = stored.provenance.region.as_ref().unwrap_or(&box_of_samples);
    let mut stream = Stream::new(options.seed, "verify/orbits");
    let corners = || region.low.iter().zip(&region.high);
    let mut points: Vec<f64> = (0..OwnInvariance::ORBITS)
        .flat_map(|_| corners())
        .map(|(low, high)| {
            let (centre, half) = (0.5 * (low + high), 0.25 * (high - low));
            stream.uniform(centre - half, centre + half)
        })
        .collect();
    if stored.provenance.region.is_some() {
        stored.to_network(&mut points);
    }
    points
}

/// What is wrong with the invariant that a network owns, along its own orbits: that it changes much, or drifts. None if
/// nothing is wrong, or if the network owns no invariant.
///
/// Orbits start from seeded points in the inner half of the box of the training points or, if the model knows none, in
/// |z_i| ≤ the radius of the options.
pub fn own_invariance_fault(stored: &StoredModel, options: &CertificateOptions) -> Option<String> {
    let starts = starts_of_orbits(stored, options);
    OwnInvariance::measure(&stored.model, &starts, OwnInvariance::ITERATIONS)
        .and_then(|own| own.fault())
}
