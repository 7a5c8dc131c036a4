//! The reversor of a reversible map: a reflection that conjugates the map to its inverse.

use super::ElementaryMap;
use crate::error::Error;
use crate::phase::Half;
use crate::scalar::{Over, Scalar};
use serde::{Deserialize, Serialize};

/// The reversor of a reversible map P, a reflection S with S∘P∘S = P⁻¹.
///
/// S is its own inverse and anti-symplectic, SᵀΩS = −Ω. It reverses every rotation of planes,
/// SΦ_θS = Φ_{−θ}. The flow map of a Hamiltonian that is even in the momenta is reversible with
/// [`Reversor::Momenta`]; the section map of field lines in a stellarator is reversible with the
/// reflection of Z, where stellarator symmetry maps the section to itself.
///
/// Source: Lamb and Roberts, Time-reversal symmetry in dynamical systems,
/// <https://doi.org/10.1016/S0167-2789(97)00199-1>, section 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reversor {
    /// S(q, p) = (−q, p).
    Positions,
    /// S(q, p) = (q, −p).
    Momenta,
}

impl Reversor {
    /// Both reversors: the reflection of the positions and that of the momenta.
    pub const ALL: [Self; 2] = [Self::Positions, Self::Momenta];

    /// The half of the coordinates whose signs it changes.
    pub fn half(self) -> Half {
        match self {
            Self::Positions => Half::Position,
            Self::Momenta => Half::Momentum,
        }
    }

    /// Its name in files and options.
    pub fn name(self) -> &'static str {
        match self {
            Self::Positions => "positions",
            Self::Momenta => "momenta",
        }
    }

    /// The reversor of this name.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the name and both that there are.
    pub fn find(name: &str) -> Result<Self, Error> {
        let expected = || Self::ALL.map(Self::name).join(" or ");
        let found = Self::ALL.into_iter().find(|reversor| reversor.name() == name);
        found.ok_or_else(|| Error::invalid("reversor", name, expected()))
    }

    /// The reflection S as an equation in q and p.
    pub fn equation(self) -> &'static str {
        match self {
            Self::Positions => "S(q, p) = (−q, p)",
            Self::Momenta => "S(q, p) = (q, −p)",
        }
    }

    /// Reflects a point in place, z ← S(z).
    #[inline(always)]
    pub fn apply<S: Scalar>(self, z: &mut [S]) {
        let (_, changed) = self.half().split(z.len() / 2, z);
        for coordinate in changed {
            *coordinate = -*coordinate;
        }
    }
}

/// A [`Reversor`] as a step of a network, without parameters.
#[derive(Clone, Copy, Debug)]
pub struct Reflection {
    /// The degrees of freedom n.
    pub dof: usize,
    /// The reflection S that the step applies to a point.
    pub reversor: Reversor,
}

impl<P: Scalar> ElementaryMap<P> for Reflection {
    #[inline(always)]
    fn dof(&self) -> usize {
        self.dof
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        self
    }

    #[inline(always)]
    fn tape_len(&self) -> usize {
        0
    }

    #[inline(always)]
    fn activation_count(&self) -> usize {
        0
    }

    #[inline(always)]
    fn apply<S: Over<P>>(&self, z: &mut [S], _: &mut [S]) {
        self.reversor.apply(z);
    }

    #[inline(always)]
    fn forward_recorded<S: Over<P>>(&self, z: &mut [S], _: &mut [S], _: &mut [S]) {
        self.reversor.apply(z);
    }

    /// S is its own transpose.
    #[inline(always)]
    fn vjp<S: Over<P>>(&self, _: &[S], z_bar: &mut [S], _: &mut [S], _: &mut [S]) {
        self.reversor.apply(z_bar);
    }

    #[inline(always)]
    fn jvp<S: Over<P>>(&self, z: &mut [S], directions: &mut [S], _: &mut [S]) {
        self.reversor.apply(z);
        for direction in directions.chunks_exact_mut(2 * self.dof) {
            self.reversor.apply(direction);
        }
    }
}
