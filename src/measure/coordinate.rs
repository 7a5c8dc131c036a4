//! The domains of coordinates.

use crate::error::Error;
use serde::{Deserialize, Serialize};

/// The domain of a coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Coordinate {
    /// A real number; samples are drawn from their box |z_i| ≤ `radius`.
    Any,
    /// An interval between two numbers.
    Between(f64, f64),
    /// A circle of this circumference: numbers that differ by it are the same point.
    Angle(f64),
}

impl Coordinate {
    /// The range that samples are drawn from.
    pub fn range(self, radius: f64) -> (f64, f64) {
        match self {
            Self::Any => (-radius, radius),
            Self::Between(low, high) => (low, high),
            Self::Angle(period) => (0.0, period),
        }
    }

    pub(super) fn check(self, name: &str) -> Result<(), Error> {
        match self {
            Self::Any => Ok(()),
            Self::Between(low, high) => {
                Error::check_finite(name, low)?;
                Error::check_finite(name, high)?;
                Error::check_range(name, low, f64::MIN, high.next_down())
            }
            Self::Angle(period) => {
                Error::check_range(name, period, Error::LEAST_POSITIVE, f64::MAX)
            }
        }
    }

    /// Reduces a difference of two such coordinates: on a circle to the shortest way.
    pub fn difference(self, difference: f64) -> f64 {
        match self {
            Self::Angle(period) => (-libm::round(difference / period)).mul_add(period, difference),
            _ => difference,
        }
    }
}

/// The coordinate `i` of a [domain](super::Measurable::domain).
pub(super) fn coordinate(domain: &[Coordinate], i: usize) -> Coordinate {
    domain.get(i).copied().unwrap_or(Coordinate::Any)
}
