//! Runge–Kutta methods of scenes in coordinates that are not canonical.

use super::numerical_method::NumericalMethod;
use super::request::{Method, Request};
use super::tableau::DORMAND_PRINCE;
use super::{Tableau, natural_runge_kutta_4};
use crate::error::Error;
use crate::scalar::Pack;
use crate::system::{FieldLines, NaturalCoordinates, System};

/// In natural coordinates, RK4 where there is no tableau.
pub(super) struct InNaturalCoordinates {
    tableau: Option<Tableau<'static>>,
}

impl InNaturalCoordinates {
    pub(super) const RUNGE_KUTTA_4: Self = Self { tableau: None };
    pub(super) const DORMAND_PRINCE_8: Self = Self { tableau: Some(Tableau::DORMAND_PRINCE_8) };

    /// The system with natural coordinates that a system is, or the error that it is none.
    fn system<'a>(&self, system: &'a System) -> Result<&'a FieldLines, Error> {
        match system {
            System::FieldLines(system) => Ok(system),
            _ => Err(self.cannot_integrate("the system has no coordinates but canonical ones")),
        }
    }
}

impl NumericalMethod for InNaturalCoordinates {
    fn name(&self) -> String {
        match self.tableau {
            None => "RK4 in natural coordinates".into(),
            Some(_) => "Dormand–Prince 8 in natural coordinates".into(),
        }
    }

    fn bibtex(&self) -> Option<&'static str> {
        self.tableau.map(|_| DORMAND_PRINCE)
    }

    fn check_for(&self, system: &System) -> Result<(), Error> {
        self.system(system).map(|_| ())
    }

    fn trajectories(
        &self,
        request: &Request,
        system: &System,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        request.step(self, self.system(system)?, initial)
    }
}

impl<H: NaturalCoordinates> Method<H> for InNaturalCoordinates {
    const NATURAL: bool = true;
    type Known<V: Pack> = ();

    #[inline(always)]
    fn take<V: Pack>(&self, system: &H, z: &mut [V], _: &[()], interval: f64, steps: usize) {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            match self.tableau {
                Some(tableau) => tableau.take_natural(system, z, interval, steps),
                None => natural_runge_kutta_4(system, z, interval, steps),
            }
        }
    }
    #[inline(always)]
    fn enter<V: Pack>(&self, system: &H, z: &mut [V]) -> Vec<()> {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            system.to_natural(z);
        }
        Vec::new()
    }
    #[inline(always)]
    fn leave<V: Pack>(&self, system: &H, z: &mut [V]) {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            system.to_canonical(z);
        }
    }
}
