//! Maps by polynomials that depend on controls.

use super::{Pairs, PolynomialMap};
use crate::error::Error;
use crate::network::Controls;

/// Least-squares polynomial maps whose coefficients are polynomials of controls, like the parameters of a network
/// ([`Controls`]). They are quickly fitted to pairs of several machines, and preserve no structure.
#[derive(Clone, Debug)]
pub struct PolynomialFamily {
    controls: Controls,
    /// One for each product of the controls.
    maps: Vec<PolynomialMap>,
}

impl PolynomialFamily {
    /// The fit, of this total degree in the coordinates, to pairs with values of these controls.
    ///
    /// # Errors
    /// Those of [`PolynomialMap::fit`], counting one term for each of its terms and each product of the controls; when
    /// pairs have values of more or fewer controls.
    pub fn fit(pairs: &Pairs, degree: usize, controls: &Controls) -> Result<Self, Error> {
        controls.check()?;
        let count = controls.ranges.len();
        let found = pairs.conditions().iter().map(|run| run.controls.len());
        for found in found.chain(pairs.conditions().is_empty().then_some(0)) {
            Error::check_count("values of controls", count, found)?;
        }
        let maps = PolynomialMap::nearest(pairs, degree, Some(controls))?;
        Ok(Self { controls: controls.clone(), maps })
    }

    /// The map at these values of the controls.
    ///
    /// # Errors
    /// When there is not one value for each.
    pub fn at_controls(&self, values: &[f64]) -> Result<PolynomialMap, Error> {
        Error::check_count("values of controls", self.controls.ranges.len(), values.len())?;
        Ok(PolynomialMap::total(&self.maps, &self.controls.products(values)))
    }

    /// The number of coefficients of all its maps together.
    pub fn parameters(&self) -> usize {
        self.maps.iter().map(PolynomialMap::parameters).sum()
    }
}
