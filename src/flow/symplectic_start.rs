//! Where the Newton iterations of a symplectic polynomial begin.

use super::product_basis::{Parity, ProductBasis, least_squares};
use super::symmetries::Symmetries;
use super::symplectic_frame::NAME;
use crate::error::Error;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Where Newton's method begins: w as polynomials of u.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Start {
    pub(super) basis: ProductBasis,
    pub(super) coefficients: Vec<f64>,
    /// The polynomials, odd in these, of the coordinates that a mirror turns around, where those above, even in them,
    /// are of the others alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) mirrored: Option<Box<Start>>,
}

impl Start {
    pub(super) fn fit(
        before: &[f64],
        middles: &[f64],
        symmetries: &Symmetries,
        dof: usize,
        degree: usize,
    ) -> Result<Self, Error> {
        let fitted = |parity: Parity, outputs: &[usize]| -> Result<Self, Error> {
            let basis = ProductBasis::around(before, 2 * dof, degree)?.with_parity(parity);
            let rows: Vec<Vec<f64>> =
                before.par_chunks_exact(2 * dof).map(|u| basis.products(u, None)).collect();
            let coefficients = least_squares(
                NAME,
                [rows.len(), rows[0].len(), outputs.len()],
                |i, k| rows[i][k],
                |i, k| middles[i * 2 * dof + outputs[k]],
            )?;
            Ok(Self { basis, coefficients, mirrored: None })
        };
        let [(even, of_even), (odd, of_odd)] = Self::parities(symmetries, dof);
        if of_even.is_empty() {
            return fitted(odd, &of_odd);
        }
        let mirrored = match &of_odd[..] {
            [] => None,
            outputs => Some(Box::new(fitted(odd, outputs)?)),
        };
        Ok(Self { mirrored, ..fitted(even, &of_even)? })
    }

    /// The parity of the polynomials of coordinates that the mirror leaves, and these; and of those that it turns.
    pub(super) fn parities(symmetries: &Symmetries, dof: usize) -> [(Parity, Vec<usize>); 2] {
        let lists = symmetries.lists_mirrored(dof);
        let (turned, own) = (0..2 * dof).partition(|k| symmetries.is_mirrored(*k, dof));
        let even = Parity { even: lists.clone(), odd: Vec::new() };
        [(even, own), (Parity { even: Vec::new(), odd: lists }, turned)]
    }

    /// Its polynomials, their parities and the coordinates that they are of. Polynomials of mirrored coordinates have
    /// none of their own, which [`SymplecticPolynomial::check`] sees as a part of none.
    pub(super) fn parts(
        &self,
        symmetries: &Symmetries,
        dof: usize,
    ) -> Vec<(&Self, Parity, Vec<usize>)> {
        let [(even, of_even), (odd, of_odd)] = Self::parities(symmetries, dof);
        match &self.mirrored {
            Some(mirrored) => {
                let mut parts = vec![(self, even, of_even), (&**mirrored, odd, of_odd)];
                parts.extend(mirrored.mirrored.as_deref().map(|n| (n, Parity::default(), vec![])));
                parts
            }
            // Older files have all terms.
            None if of_even.is_empty() && *self.basis.parity() != Parity::default() => {
                vec![(self, odd, of_odd)]
            }
            None => vec![(self, Parity::default(), (0..2 * dof).collect())],
        }
    }

    /// The products of its values at a point.
    pub(super) fn products(&self) -> usize {
        self.coefficients.len() + self.mirrored.as_ref().map_or(0, |odd| odd.products())
    }
}
