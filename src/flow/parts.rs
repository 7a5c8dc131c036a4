//! Methods that need a system of parts with exact flows.

use super::numerical_method::NumericalMethod;
use crate::error::Error;
use crate::system::{NearlyPeriodic, System};

/// Runs `$body` on the system behind the enum, or gives the error of a method that it has no parts with exact flows.
macro_rules! each_splittable {
    ($method:expr, $self:expr, $system:ident => $body:expr) => {
        match $self {
            $crate::system::System::Oscillators($system) => $body,
            $crate::system::System::ParticleField($system) => $body,
            $crate::system::System::FullOrbit($system) => $body,
            $crate::system::System::CellularDrift($system) => $body,
            $crate::system::System::ThreeOscillators($system) => $body,
            $crate::system::System::VanDerPol($system) => $body,
            $crate::system::System::FieldLines(_) => Err($crate::flow::parts::no_parts($method)),
        }
    };
}
pub(super) use each_splittable;

/// Fails where a system has no parts with exact flows.
pub(super) fn check_parts(method: &impl NumericalMethod, system: &System) -> Result<(), Error> {
    match system {
        System::FieldLines(_) => Err(no_parts(method)),
        _ => Ok(()),
    }
}

/// Fails where the limit of a system has no period, or the system no parts with exact flows.
pub(super) fn check_periodic_parts(
    method: &impl NumericalMethod,
    system: &System,
) -> Result<(), Error> {
    check_parts(method, system)?;
    match system.torus().1.len() > 1 {
        true => Err(method.cannot_integrate("the limit of the system has no period")),
        false => Ok(()),
    }
}

pub(super) fn no_parts(method: &impl NumericalMethod) -> Error {
    method.cannot_integrate("the system has no parts with exact flows")
}
