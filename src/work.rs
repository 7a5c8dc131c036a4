//! How much was computed, counted where it is done.

use serde::{Deserialize, Serialize};
use std::ops::{AddAssign, Sub};
use std::sync::atomic::{AtomicU64, Ordering};

/// The kinds of computations that are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// One application of a network to one point.
    Evaluation,
    /// The loss of one pair, without its gradient.
    Loss,
    /// The loss of one pair with its gradient.
    Gradient,
    /// The curvature diagonal of one pair.
    Curvature,
    /// The Jacobian at one point.
    Jacobian,
}

static COUNTS: [AtomicU64; 5] = [const { AtomicU64::new(0) }; 5];

/// Adds to a count: once for a block of points, not for each of them.
#[inline]
pub(crate) fn count(kind: Kind, number: usize) {
    COUNTS[kind as usize].fetch_add(number as u64, Ordering::Relaxed);
}

/// How much a process has computed so far, on all its threads together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Work {
    /// Applications of a network to a point, by
    /// [`map_points`](crate::network::map_points) and
    /// [`rollout`](crate::network::rollout).
    pub evaluations: u64,
    /// Losses of a pair, without the gradient.
    pub losses: u64,
    /// Losses of a pair with the gradient.
    pub gradients: u64,
    /// Curvature diagonals of a pair.
    pub curvatures: u64,
    /// Jacobians at a point, by [`map_jacobians`](crate::network::map_jacobians) or
    /// another way to them in [`network`](crate::network).
    pub jacobians: u64,
    /// Evaluations of the equations of motion, of systems that are
    /// [`Counted`](crate::system::Counted).
    pub vector_fields: u64,
}

impl Work {
    /// All that this process has done so far, but for the equations of motion, which
    /// each [`Counted`](crate::system::Counted) system counts for itself.
    pub fn of_process() -> Self {
        let of = |kind: Kind| COUNTS[kind as usize].load(Ordering::Relaxed);
        Self {
            evaluations: of(Kind::Evaluation),
            losses: of(Kind::Loss),
            gradients: of(Kind::Gradient),
            curvatures: of(Kind::Curvature),
            jacobians: of(Kind::Jacobian),
            vector_fields: 0,
        }
    }
}

impl Sub for Work {
    type Output = Self;

    fn sub(self, earlier: Self) -> Self {
        Self {
            evaluations: self.evaluations - earlier.evaluations,
            losses: self.losses - earlier.losses,
            gradients: self.gradients - earlier.gradients,
            curvatures: self.curvatures - earlier.curvatures,
            jacobians: self.jacobians - earlier.jacobians,
            vector_fields: self.vector_fields - earlier.vector_fields,
        }
    }
}

impl AddAssign for Work {
    fn add_assign(&mut self, more: Self) {
        self.evaluations += more.evaluations;
        self.losses += more.losses;
        self.gradients += more.gradients;
        self.curvatures += more.curvatures;
        self.jacobians += more.jacobians;
        self.vector_fields += more.vector_fields;
    }
}
