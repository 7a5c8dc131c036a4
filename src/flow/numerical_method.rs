//! What an integrator of scenes says of itself.

use super::request::Request;
use crate::error::Error;
use crate::system::System;

/// An integrator as scenes name it, with its settings: what reports call it, what it needs of a system, and its
/// trajectories.
///
/// A new one is a file with its step for points of any scalar type and this trait, and a line in the list of
/// integrators.
pub(super) trait NumericalMethod {
    /// The name used in tables.
    fn name(&self) -> String;

    /// Whether somebody has worked out the average over the fast angle for it, system by system.
    fn is_closed_average(&self) -> bool {
        false
    }

    /// The BibTeX entry that a report cites.
    fn bibtex(&self) -> Option<&'static str> {
        None
    }

    /// Fails unless the settings are in range.
    fn check(&self) -> Result<(), Error> {
        Ok(())
    }

    /// Fails where a system lacks what the method needs.
    fn check_for(&self, system: &System) -> Result<(), Error> {
        let _ = system;
        Ok(())
    }

    /// The method that, with twice as many steps, estimates the error of this one, where it is another one: where more
    /// steps leave some of the error.
    fn finer(&self) -> Option<Box<dyn NumericalMethod>> {
        None
    }

    /// The states that a request asks for, of trajectories from the points in `initial`, 2n numbers each.
    fn trajectories(
        &self,
        request: &Request,
        system: &System,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error>;

    /// The error that a system lacks what the method needs.
    fn cannot_integrate(&self, lacks: &str) -> Error {
        Error::invalid("integrator", self.name(), format!("another integrator: {lacks}"))
    }
}
