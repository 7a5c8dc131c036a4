//! Units in which data is of order one: a shift and a factor for each column.

use super::{Half, Map};
use crate::error::Error;
use crate::scalar::{Scalar, constant};
use serde::{Deserialize, Serialize};

/// Units z = c + S w of data z, where w are the coordinates of a network.
///
/// S is diagonal, and the factors of q and p have the same product s in all planes. So SᵀΩS = sΩ,
/// and S∘P∘S⁻¹ is symplectic where P is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Units {
    centre: Vec<f64>,
    factors: Vec<f64>,
}

impl Units {
    /// The relative difference of products of factors that rounding may cause.
    const PRODUCTS: f64 = 4.0 * f64::EPSILON;

    /// The units with this centre c and these factors, the diagonal of S: 2n numbers each.
    ///
    /// # Errors
    /// [`Error::WrongCount`] and [`Error::OutOfRange`] unless they are of 2n finite numbers, the
    /// factors positive; [`Error::Invalid`] unless the products of two planes are the same to
    /// within their rounding.
    pub fn new(centre: Vec<f64>, factors: Vec<f64>) -> Result<Self, Error> {
        let out = Self { centre, factors };
        out.check("units", out.centre.len() / 2)?;
        Ok(out)
    }

    /// The units in words, for a reader of a report.
    pub fn describe(&self) -> String {
        let numbers = |values: &[f64]| {
            let texts: Vec<String> = values.iter().map(|value| format!("{value:.4e}")).collect();
            texts.join(", ")
        };
        let centre = match self.centre.iter().any(|c| *c != 0.0) {
            true => format!(" about {}", numbers(&self.centre)),
            false => String::new(),
        };
        format!(
            "The network is trained in units of {}{centre} (q1 … qn, p1 … pn), in which the \
             widest plane of the pairs is of order one",
            numbers(&self.factors)
        )
    }

    /// Fails like [`Units::new`], with `name` in the error, or if the degrees of freedom are not
    /// `dof`.
    ///
    /// # Errors
    /// Those of [`Units::new`].
    pub fn check(&self, name: &str, dof: usize) -> Result<(), Error> {
        for (part, values) in [("centre", &self.centre), ("factors", &self.factors)] {
            let place = format!("{name}: {part}");
            Error::check_count(&format!("{place}: numbers"), 2 * dof, values.len())?;
            values.iter().try_for_each(|v| Error::check_finite(&place, *v))?;
        }
        Error::check_count_range(&format!("{name}: planes"), dof, 1, usize::MAX)?;
        let product = |j: usize| self.factors[j] * self.factors[dof + j];
        for (k, factor) in self.factors.iter().enumerate() {
            let place = format!("{name}: factors[{k}]");
            Error::check_range(&place, *factor, Error::LEAST_POSITIVE, f64::MAX)?;
        }
        for j in 0..dof {
            let (found, expected) = (product(j), product(0));
            // Zero and ∞ are no area.
            if !((found / expected - 1.0).abs() <= Self::PRODUCTS) {
                let name = format!("{name}: factors of q{} and p{}", j + 1, j + 1);
                let expected = format!("the product of the first plane, {expected:e}");
                return Err(Error::invalid(&name, format!("{found:e}"), expected));
            }
        }
        Ok(())
    }

    /// The degrees of freedom n.
    pub fn dof(&self) -> usize {
        self.centre.len() / 2
    }

    /// The centre c, in units of the data: 2n numbers.
    pub fn centre(&self) -> &[f64] {
        &self.centre
    }

    /// The factors of the coordinates, the diagonal of S.
    pub fn factors(&self) -> &[f64] {
        &self.factors
    }

    /// The same units, with the centre of a half of the coordinates at 0.
    pub fn about_zero(mut self, half: Half) -> Self {
        let dof = self.dof();
        for j in 0..dof {
            self.centre[half.index(dof, j)] = 0.0;
        }
        self
    }

    /// The factor s: an area dq∧dp of the data over that of the network, which is also the unit of
    /// actions.
    pub fn area(&self) -> f64 {
        self.factors[0] * self.factors[self.dof()]
    }

    /// w = S⁻¹(z − c) of points in rows of 2n numbers.
    pub fn to_network<S: Scalar>(&self, points: &mut [S]) {
        for z in points.chunks_exact_mut(2 * self.dof()) {
            for ((z, c), s) in z.iter_mut().zip(&self.centre).zip(&self.factors) {
                *z = (*z - constant(*c)) / constant(*s);
            }
        }
    }

    /// z = c + S w of points in rows of 2n numbers.
    pub fn to_data<S: Scalar>(&self, points: &mut [S]) {
        for w in points.chunks_exact_mut(2 * self.dof()) {
            for ((w, c), s) in w.iter_mut().zip(&self.centre).zip(&self.factors) {
                *w = w.mul_add(constant(*s), constant(*c));
            }
        }
    }
}

/// A map in the coordinates of the data: S∘P∘S⁻¹.
pub struct InUnits<'a, M> {
    /// P, in the coordinates of the network.
    pub map: M,
    /// The units that relate the data to these coordinates.
    pub units: &'a Units,
}

impl<S: Scalar, M: Map<S>> Map<S> for InUnits<'_, M> {
    fn dof(&self) -> usize {
        self.map.dof()
    }
    fn forward(&self, z: &mut [S]) {
        self.units.to_network(z);
        self.map.forward(z);
        self.units.to_data(z);
    }
    fn inverse(&self, z: &mut [S]) {
        self.units.to_network(z);
        self.map.inverse(z);
        self.units.to_data(z);
    }
    fn has_inverse(&self) -> bool {
        self.map.has_inverse()
    }
}
