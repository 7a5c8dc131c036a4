//! What the networks of a scene stand for: a system of the crate, or pairs of a file.

use super::line_data::LineData;
use crate::error::Error;
use crate::flow::{Pairs, Trajectories};
use crate::io::{read_pairs, read_trajectories};
use crate::layer::{CircleAction, TorusAction};
use crate::network::{Architecture, Structure};
use crate::system::{Hamiltonian, NearlyPeriodic, System};
use crate::train::fit_rotation;
use std::path::Path;

/// A flow map that is learnt.
#[derive(Clone, Copy, Debug)]
pub(super) enum TargetFlow<'a> {
    /// The flow map of a system of the crate.
    System(&'a System),
    /// Of which there are pairs only.
    File(FileData<'a>),
    /// The map of field lines of coils through a section.
    Lines(&'a LineData),
}

/// The pairs of a file, with the circle action and the ε that a scene declares.
#[derive(Clone, Copy, Debug)]
pub(super) struct FileData<'a> {
    /// The `.npz` file of pairs.
    pub(super) pairs: &'a Path,
    /// The `.npy` file of trajectories that others are compared with.
    pub(super) trajectories: Option<&'a Path>,
    /// The circle action Φ of the limit ε = 0.
    pub(super) circle_action: &'a CircleAction,
    /// The ε of the pairs.
    pub(super) epsilon: f64,
}

impl FileData<'_> {
    /// Whether the pairs can be read and are of the degrees of freedom of the action.
    pub(super) fn fits_pairs(&self) -> bool {
        read_pairs(self.pairs).is_ok_and(|file| file.pairs.dof() == self.circle_action.dof())
    }

    /// The first states of the trajectories of a file, in its units.
    ///
    /// # Errors
    /// Those of [`read_trajectories`]; when it has fewer states.
    pub(super) fn read_trajectories(
        &self,
        path: &Path,
        states: usize,
    ) -> Result<Trajectories, Error> {
        let values = read_trajectories(path, self.circle_action.dof())?;
        let place = format!("{}: states of each trajectory", path.display());
        Error::check_count_range(&place, values.states(), states, usize::MAX)?;
        Ok(values.first(states))
    }
}

impl<'a> TargetFlow<'a> {
    pub(super) fn circle_action(self) -> CircleAction {
        match self {
            Self::System(system) => system.circle_action(),
            Self::File(file) => file.circle_action.clone(),
            // Lines go round the axis.
            Self::Lines(_) => CircleAction::new([1]),
        }
    }

    pub(super) fn dof(self) -> usize {
        match self {
            Self::System(system) => system.dof(),
            Self::File(file) => file.circle_action.dof(),
            Self::Lines(_) => 1,
        }
    }

    pub(super) fn epsilon(self) -> f64 {
        match self {
            Self::System(system) => system.epsilon(),
            Self::File(file) => file.epsilon,
            Self::Lines(lines) => lines.epsilon,
        }
    }

    /// The system, where it is one.
    pub(super) fn system(self) -> Option<&'a System> {
        match self {
            Self::System(system) => Some(system),
            Self::File(_) | Self::Lines(_) => None,
        }
    }

    /// The angle by which its limit turns in a time; of pairs, that of the rotation nearest to
    /// them.
    pub(super) fn angle(self, time: f64, pairs: &Pairs) -> f64 {
        match self {
            Self::System(system) => system.limiting_frequency() * time,
            Self::File(_) | Self::Lines(_) => fit_rotation(pairs, &self.circle_action()),
        }
    }

    /// Whether these circles turn the planes that its limit turns, in proportion.
    pub(super) fn is_turned_by(self, action: &TorusAction) -> bool {
        match self {
            Self::System(system) => multiples(system, action).is_some(),
            Self::File(_) | Self::Lines(_) => {
                action.multiples_of::<f64>(&self.circle_action()).is_some()
            }
        }
    }

    /// Angles for the circles of a network to start from, where they are others than
    /// [`TargetFlow::angle`] for its only one.
    pub(super) fn angles(self, of: &Architecture, theta: f64, pairs: &Pairs) -> Option<Vec<f64>> {
        // A gyroceptron starts from the frequency of the limit itself.
        let adiabatic = of.structure() == Structure::NearlyPeriodic && of.circles.len() == 1;
        let action = of.action().filter(|_| !adiabatic)?;
        match self {
            Self::System(system) => {
                let mut angles = multiples(system, &action)?;
                angles.iter_mut().for_each(|angle| *angle *= theta);
                Some(angles)
            }
            Self::File(_) | Self::Lines(_) => {
                let circles = action.circles().iter();
                Some(circles.map(|circle| fit_rotation(pairs, circle)).collect())
            }
        }
    }
}

/// How often each circle goes round while the limit of a system turns by one radian of ω₀: those of its own torus with
/// their frequencies, or parts of its circle action.
fn multiples(system: &System, action: &TorusAction) -> Option<Vec<f64>> {
    let (torus, frequencies) = system.torus();
    let frequency = |circle: &CircleAction| {
        let own = torus.circles().iter().position(|own| own == circle)?;
        Some(frequencies[own] / system.limiting_frequency())
    };
    let all = action.circles().len() == frequencies.len();
    let of_torus = action.circles().iter().map(frequency).collect::<Option<Vec<f64>>>();
    of_torus.filter(|_| all).or_else(|| action.multiples_of(&system.circle_action()))
}
