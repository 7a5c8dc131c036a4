//! A point of phase space, its order in arrays, and the sign of Ω: stated once.
//!
//! A point z of n degrees of freedom is a slice of 2n numbers,
//! `[q₁, …, qₙ, p₁, …, pₙ]`. The canonical form is
//!
//! Ω = ( 0  I ; −I  0 ),
//!
//! so that Hamilton's equations read ż = Ω∇H, and a map with Jacobian J is
//! symplectic when JᵀΩJ = Ω.

mod section;
mod units;

#[cfg(feature = "files")]
pub(crate) use section::STEPS as CHART_STEPS;
pub use section::{AreaDensity, Change, Section};
pub use units::{InUnits, Units};

use serde::{Deserialize, Serialize};

/// One half of the coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Half {
    /// q₁ … qₙ, the paper's x.
    Position,
    /// p₁ … pₙ, the paper's y.
    Momentum,
}

impl Half {
    /// Splits z into `(the other half, this half)`: the source and the target
    /// of a shear that changes this half.
    #[inline(always)]
    pub fn split<S>(self, dof: usize, z: &mut [S]) -> (&[S], &mut [S]) {
        let (q, p) = z.split_at_mut(dof);
        match self {
            Half::Position => (&p[..dof], q),
            Half::Momentum => (&q[..dof], &mut p[..dof]),
        }
    }

    /// The half that is not this one, and this one, both mutable.
    #[inline(always)]
    pub fn split_mut<S>(self, dof: usize, z: &mut [S]) -> (&mut [S], &mut [S]) {
        let (q, p) = z.split_at_mut(dof);
        match self {
            Half::Position => (&mut p[..dof], q),
            Half::Momentum => (q, &mut p[..dof]),
        }
    }

    /// The index in z of coordinate `j` of this half.
    #[inline(always)]
    pub fn index(self, dof: usize, j: usize) -> usize {
        match self {
            Half::Position => j,
            Half::Momentum => dof + j,
        }
    }

    /// The other half of the coordinates.
    #[inline(always)]
    pub fn other(self) -> Self {
        match self {
            Half::Position => Half::Momentum,
            Half::Momentum => Half::Position,
        }
    }
}

/// A map, or its inverse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// The map itself, z ← P(z).
    Forward,
    /// The inverse of the map, z ← P⁻¹(z).
    Inverse,
}

impl Direction {
    /// The opposite direction: the inverse of the map, or the map of its inverse.
    pub fn reversed(self) -> Self {
        match self {
            Self::Forward => Self::Inverse,
            Self::Inverse => Self::Forward,
        }
    }
}

/// A map of phase space to itself, usually invertible in closed form.
///
/// `S` is the type of number that it is evaluated on; a map that needs no elementary function
/// implements the trait for every [`Scalar`](crate::scalar::Scalar).
pub trait Map<S> {
    /// The number of degrees of freedom n; points have 2n components.
    fn dof(&self) -> usize;

    /// z ← P(z). `z` holds 2n numbers.
    fn forward(&self, z: &mut [S]);

    /// z ← P⁻¹(z). `z` holds 2n numbers.
    ///
    /// # Panics
    /// If the map has no inverse, in which case [`Map::has_inverse`] has to return false.
    fn inverse(&self, z: &mut [S]) {
        let _ = z;
        panic!(
            "{} was asked for its inverse: implement `inverse`, or let `has_inverse` be false",
            std::any::type_name::<Self>()
        );
    }

    /// Whether the map has an inverse. Laws that need one are skipped, and reported as skipped, for
    /// maps that have none.
    fn has_inverse(&self) -> bool {
        true
    }

    /// z ← P(z) or P⁻¹(z).
    fn run(&self, direction: Direction, z: &mut [S]) {
        match direction {
            Direction::Forward => self.forward(z),
            Direction::Inverse => self.inverse(z),
        }
    }
}

impl<S, M: Map<S> + ?Sized> Map<S> for &M {
    fn dof(&self) -> usize {
        (**self).dof()
    }
    fn forward(&self, z: &mut [S]) {
        (**self).forward(z);
    }
    fn inverse(&self, z: &mut [S]) {
        (**self).inverse(z);
    }
    fn has_inverse(&self) -> bool {
        (**self).has_inverse()
    }
}

/// J⁻¹ = −ΩJᵀΩ for a symplectic J, row by row: no linear system is solved.
pub(crate) fn inverse_of_symplectic(jacobian: &[f64], dof: usize) -> Vec<f64> {
    let dim = 2 * dof;
    let mut out = vec![0.0; dim * dim];
    // (Ωv)_i = v_{n+i}, (Ωv)_{n+i} = −v_i.
    let partner = |i: usize| if i < dof { (i + dof, 1.0) } else { (i - dof, -1.0) };
    for i in 0..dim {
        for k in 0..dim {
            let (pi, si) = partner(i);
            let (pk, sk) = partner(k);
            out[i * dim + k] = si * sk * jacobian[pk * dim + pi];
        }
    }
    out
}
