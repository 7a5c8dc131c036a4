//! Runge–Kutta methods of scenes in coordinates that are not canonical.

use super::numerical_method::NumericalMethod;
use super::request::{Method, Request};
use super::tableau::DORMAND_PRINCE;
use super::{Tableau, natural_runge_kutta_4};
use crate::error::Error;
use crate::scalar::Pack;
use crate::system::{NaturalCoordinates, System};

/// [`natural_runge_kutta_4`] of scenes.
pub(super) struct NaturalRungeKutta4;

impl NumericalMethod for NaturalRungeKutta4 {
    fn name(&self) -> String {
        "RK4 in natural coordinates".into()
    }

    fn check_for(&self, system: &System) -> Result<(), Error> {
        check_natural(self, system)
    }

    fn trajectories(
        &self,
        request: &Request,
        system: &System,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        match system {
            System::FieldLines(system) => {
                request.step(&InNaturalCoordinates { tableau: None }, system, initial)
            }
            _ => Err(no_natural_coordinates(self)),
        }
    }
}

/// Fails where a system has no natural coordinates.
fn check_natural(method: &impl NumericalMethod, system: &System) -> Result<(), Error> {
    match system {
        System::FieldLines(_) => Ok(()),
        _ => Err(no_natural_coordinates(method)),
    }
}

fn no_natural_coordinates(method: &impl NumericalMethod) -> Error {
    method.cannot_integrate("the system has no coordinates but canonical ones")
}

/// In natural coordinates, RK4 where there is no tableau.
struct InNaturalCoordinates {
    tableau: Option<Tableau<'static>>,
}

impl<H: NaturalCoordinates> Method<H> for InNaturalCoordinates {
    const NATURAL: bool = true;

    #[inline(always)]
    fn take<V: Pack>(&self, system: &H, z: &mut [V], interval: f64, steps: usize) {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            match self.tableau {
                Some(tableau) => tableau.take_natural(system, z, interval, steps),
                None => natural_runge_kutta_4(system, z, interval, steps),
            }
        }
    }
    #[inline(always)]
    fn enter<V: Pack>(&self, system: &H, z: &mut [V]) {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            system.to_natural(z);
        }
    }
    #[inline(always)]
    fn leave<V: Pack>(&self, system: &H, z: &mut [V]) {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            system.to_canonical(z);
        }
    }
}

/// [`Tableau::DORMAND_PRINCE_8`] of scenes, in natural coordinates.
pub(super) struct NaturalDormandPrince8;

impl NumericalMethod for NaturalDormandPrince8 {
    fn name(&self) -> String {
        "Dormand–Prince 8 in natural coordinates".into()
    }

    fn bibtex(&self) -> Option<&'static str> {
        Some(DORMAND_PRINCE)
    }

    fn check_for(&self, system: &System) -> Result<(), Error> {
        check_natural(self, system)
    }

    fn trajectories(
        &self,
        request: &Request,
        system: &System,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        match system {
            System::FieldLines(system) => {
                let tableau = Some(Tableau::DORMAND_PRINCE_8);
                request.step(&InNaturalCoordinates { tableau }, system, initial)
            }
            _ => Err(no_natural_coordinates(self)),
        }
    }
}
