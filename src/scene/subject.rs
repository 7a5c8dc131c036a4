//! What the networks of a scene stand for: a system of the crate, or pairs of a file.

use crate::flow::Pairs;
use crate::layer::CircleAction;
use crate::network::Architecture;
use crate::system::{Hamiltonian, NearlyPeriodic, System};
use crate::train::fit_rotation;
use std::path::Path;

/// A flow map that is learnt.
#[derive(Clone, Copy, Debug)]
pub(super) enum Subject<'a> {
    /// Of a system.
    System(&'a System),
    /// Of which there are pairs only.
    File(FileData<'a>),
}

/// Pairs of one's own.
#[derive(Clone, Copy, Debug)]
pub(super) struct FileData<'a> {
    /// The `.npz` file of pairs.
    pub(super) pairs: &'a Path,
    /// The `.npy` file of trajectories that others are compared with.
    pub(super) trajectories: Option<&'a Path>,
    /// Φ of their limit.
    pub(super) circle_action: &'a CircleAction,
    /// Their ε.
    pub(super) epsilon: f64,
}

impl<'a> Subject<'a> {
    pub(super) fn circle_action(self) -> CircleAction {
        match self {
            Self::System(system) => system.circle_action(),
            Self::File(file) => file.circle_action.clone(),
        }
    }

    pub(super) fn dof(self) -> usize {
        match self {
            Self::System(system) => system.dof(),
            Self::File(file) => file.circle_action.dof(),
        }
    }

    pub(super) fn epsilon(self) -> f64 {
        match self {
            Self::System(system) => system.epsilon(),
            Self::File(file) => file.epsilon,
        }
    }

    /// The system, where it is one.
    pub(super) fn system(self) -> Option<&'a System> {
        match self {
            Self::System(system) => Some(system),
            Self::File(_) => None,
        }
    }

    /// The angle by which its limit turns in a time; of pairs, that of the rotation nearest to
    /// them.
    pub(super) fn angle(self, time: f64, pairs: &Pairs) -> f64 {
        match self {
            Self::System(system) => system.limiting_frequency() * time,
            Self::File(file) => fit_rotation(pairs, file.circle_action),
        }
    }

    /// Angles for the circles of a network to start from, where they are others than
    /// [`Subject::angle`] for its only one.
    pub(super) fn angles(self, of: &Architecture, theta: f64, pairs: &Pairs) -> Option<Vec<f64>> {
        let Architecture::NormalForm { shape, .. } = of else { return None };
        match self {
            Self::System(system) => {
                let mut angles = shape.action.multiples_of(&system.circle_action())?;
                angles.iter_mut().for_each(|angle| *angle *= theta);
                Some(angles)
            }
            Self::File(_) => {
                let circles = shape.action.circles().iter();
                Some(circles.map(|circle| fit_rotation(pairs, circle)).collect())
            }
        }
    }
}
