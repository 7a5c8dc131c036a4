//! What symplectic polynomials have in common with their images under reflections.

use crate::error::Error;
use crate::layer::Reversor;
use serde::{Deserialize, Serialize};

/// What a map has in common with its images under reflections.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Symmetries {
    /// A reflection R that conjugates the map P to its inverse, RPR = P⁻¹.
    pub reversor: Option<Reversor>,
    /// The planes j, from 1 to n, whose reflection, (q_j, p_j) ↦ (−q_j, −p_j) of all of these together, commutes with
    /// the map; none where it is empty. Of a ring it is the vertical plane where no field is skew.
    pub mirrored: Vec<usize>,
}

impl Symmetries {
    /// Fails unless the planes are of so many degrees of freedom, each once.
    ///
    /// # Errors
    /// With the plane.
    pub fn check(&self, dof: usize) -> Result<(), Error> {
        for (k, plane) in self.mirrored.iter().enumerate() {
            Error::check_count_range("mirrored plane", *plane, 1, dof)?;
            if self.mirrored[..k].contains(plane) {
                return Err(Error::invalid("mirrored plane", plane, "each once"));
            }
        }
        Ok(())
    }

    /// Which of 2n coordinates the mirror turns around.
    pub(super) fn is_mirrored(&self, coordinate: usize, dof: usize) -> bool {
        self.mirrored.contains(&(coordinate % dof + 1))
    }

    /// Points and their mirror images, if there is a mirror.
    pub(super) fn with_images(&self, points: Vec<f64>, dof: usize) -> Vec<f64> {
        if self.mirrored.is_empty() {
            return points;
        }
        let turned =
            |(k, v): (usize, &f64)| if self.is_mirrored(k % (2 * dof), dof) { -v } else { *v };
        let images: Vec<f64> = points.iter().enumerate().map(turned).collect();
        [points, images].concat()
    }

    /// The lists of coordinates in which S is even, those that the reversor turns around being the first half.
    pub(super) fn even(&self, dof: usize) -> Vec<Vec<usize>> {
        let reversed = self.reversor.map(|_| (0..dof).collect());
        reversed.into_iter().chain(self.lists_mirrored(dof)).collect()
    }

    /// The coordinates that the mirror turns around, in a list of their own; no list where there are none.
    pub(super) fn lists_mirrored(&self, dof: usize) -> Vec<Vec<usize>> {
        let list: Vec<usize> = (0..2 * dof).filter(|k| self.is_mirrored(*k, dof)).collect();
        if list.is_empty() { Vec::new() } else { vec![list] }
    }

    /// Sets to 0 what a matrix that commutes with the mirror does not have.
    pub(super) fn clear(&self, matrix: &mut [f64], dof: usize) {
        let turned = |k: usize| self.is_mirrored(k, dof);
        for (row, entries) in matrix.chunks_exact_mut(2 * dof).enumerate() {
            for (column, entry) in entries.iter_mut().enumerate() {
                if turned(row) != turned(column) {
                    *entry = 0.0;
                }
            }
        }
    }
}
