//! One shear of a composition, with the size of its rounding errors.

use super::circle_action::quarter_turns;
use super::{Kick, Potential, Rotation};
use crate::phase::Half;
use crate::scalar::{Over, Scalar};

/// The smallest steps that a map of this crate consists of.
///
/// A measure that follows rounding errors through a map walks over these; each
/// knows how to apply itself to any number and how large its own errors are.
#[derive(Clone, Copy, Debug)]
pub enum ElementaryStep<'a, P, V> {
    /// A kick of a network.
    Kick(Kick<'a, P, V>),
    /// A linear shear inside one plane: target += coefficient·source.
    PlaneShear {
        /// The number of degrees of freedom.
        dof: usize,
        /// The plane.
        plane: usize,
        /// The half that changes.
        target: Half,
        /// The coefficient.
        coefficient: P,
    },
    /// Quarter turns of one plane; they make no error.
    QuarterTurns {
        /// The number of degrees of freedom.
        dof: usize,
        /// The plane.
        plane: usize,
        /// How many, 0 … 3.
        count: u8,
    },
}

impl<'a, P: Scalar, V> ElementaryStep<'a, P, V> {
    /// The steps of a rotation, or of its inverse, in the order of application.
    pub fn rotation(rotation: &Rotation<P>, inverse: bool) -> Vec<Self> {
        let dof = rotation.dof();
        let mut steps = Vec::new();
        for plane in rotation.planes() {
            let shear = |target, coefficient| Self::PlaneShear {
                dof,
                plane: plane.plane,
                target,
                coefficient,
            };
            let mut own = vec![
                shear(Half::Position, plane.t),
                shear(Half::Momentum, -plane.s),
                shear(Half::Position, plane.t),
            ];
            let turns = Self::QuarterTurns { dof, plane: plane.plane, count: plane.quarter_turns };
            own.insert(if plane.quarter_turns == 3 { 3 } else { 0 }, turns);
            if inverse {
                own.reverse();
                own = own.into_iter().map(Self::inverse).collect();
            }
            steps.extend(own);
        }
        steps
    }

    /// The inverse step.
    pub fn inverse(self) -> Self {
        match self {
            Self::Kick(kick) => Self::Kick(kick.inverse()),
            Self::PlaneShear { dof, plane, target, coefficient } => {
                Self::PlaneShear { dof, plane, target, coefficient: -coefficient }
            }
            Self::QuarterTurns { dof, plane, count } => {
                Self::QuarterTurns { dof, plane, count: (4 - count) % 4 }
            }
        }
    }

    /// z ← the step of z. `scratch` holds at least 2n numbers.
    pub fn apply<S: Over<P>>(&self, z: &mut [S], scratch: &mut [S])
    where
        V: Potential<S>,
    {
        match self {
            Self::Kick(kick) => kick.apply(z, scratch),
            Self::PlaneShear { dof, plane, target, coefficient } => {
                if !coefficient.is_zero() {
                    let to = target.index(*dof, *plane);
                    let from = target.other().index(*dof, *plane);
                    z[to] = z[from].mul_add_parameter(*coefficient, z[to]);
                }
            }
            Self::QuarterTurns { dof, plane, count } => {
                let (q, p) = z.split_at_mut(*dof);
                quarter_turns(*count, &mut q[*plane], &mut p[*plane]);
            }
        }
    }
}

impl<P: Over<P>, V: Potential<P>> ElementaryStep<'_, P, V> {
    /// `e` ← the scale, in units of u, of the rounding error that this step
    /// leaves in the running Jacobian (2n × 2n, row by row).
    pub fn jacobian_magnitude(&self, z: &[P], before: &[P], after: &[P], e: &mut [P]) {
        match self {
            Self::Kick(kick) => kick.jacobian_magnitude(z, before, after, e),
            Self::PlaneShear { dof, plane, target, coefficient } => {
                e.fill(P::zero());
                if coefficient.is_zero() {
                    return;
                }
                let row = target.index(*dof, *plane);
                let from = target.other().index(*dof, *plane);
                for column in 0..2 * dof {
                    e[row * 2 * dof + column] = coefficient.abs().mul_add(
                        before[from * 2 * dof + column].abs(),
                        after[row * 2 * dof + column].abs(),
                    );
                }
            }
            Self::QuarterTurns { .. } => e.fill(P::zero()),
        }
    }

    /// `delta` ← the scale, in units of u, of the rounding error that this step
    /// leaves in the point.
    pub fn value_magnitude(&self, z: &[P], after: &[P], delta: &mut [P]) {
        match self {
            Self::Kick(kick) => kick.value_magnitude(z, after, delta),
            Self::PlaneShear { dof, plane, target, coefficient } => {
                delta.fill(P::zero());
                if coefficient.is_zero() {
                    return;
                }
                let row = target.index(*dof, *plane);
                let from = target.other().index(*dof, *plane);
                delta[row] = coefficient.abs().mul_add(z[from].abs(), after[row].abs());
            }
            Self::QuarterTurns { .. } => delta.fill(P::zero()),
        }
    }
}
