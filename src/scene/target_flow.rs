//! What the networks of a scene stand for: a system of the crate, or pairs of a file.

use super::line_data::LineData;
use crate::error::Error;
use crate::flow::{Pairs, Trajectories};
use crate::io::{read_pairs, read_section, read_trajectories};
use crate::layer::{CircleAction, TorusAction};
use crate::network::{Architecture, Structure};
use crate::phase::Section;
use crate::system::{Hamiltonian, NearlyPeriodic, System};
use crate::train::{fit_rotation, fit_rotations};
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
    /// The file of the section whose coordinates the pairs are in, where these are not canonical.
    pub(super) section: Option<&'a Path>,
    /// The circle action Φ of the limit ε = 0.
    pub(super) circle_action: &'a CircleAction,
    /// The circles that it consists of, where the pairs have shown several.
    pub(super) torus: Option<&'a TorusAction>,
    /// How they were found, in words.
    pub(super) found: Option<&'a str>,
    /// The ε of the pairs; of those of several, that of the networks.
    pub(super) epsilon: f64,
}

/// A circle action that was found from pairs.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FoundAction {
    /// The circles of networks that declare none.
    pub(super) torus: TorusAction,
    /// All of these circles together.
    pub(super) circle: CircleAction,
    /// How it was found, in words.
    pub(super) words: Option<String>,
}

impl FoundAction {
    pub(super) fn new(torus: TorusAction, words: Option<String>) -> Self {
        let sum = |plane: usize| torus.circles().iter().map(|circle| circle.weights()[plane]).sum();
        let circle = CircleAction::new((0..torus.dof()).map(sum).collect::<Vec<i32>>());
        Self { torus, circle, words }
    }
}

impl FileData<'_> {
    /// Whether the pairs can be read and are of the degrees of freedom of the action.
    pub(super) fn fits_pairs(&self) -> bool {
        read_pairs(self.pairs).is_ok_and(|file| file.pairs.dof() == self.circle_action.dof())
    }

    /// The section of the pairs, where they have one.
    ///
    /// # Errors
    /// Those of [`read_section`]; when it is of other planes, or of controls.
    pub(super) fn read_section(&self) -> Result<Option<Section>, Error> {
        self.section.map(|path| section_of(path, self.circle_action.dof())).transpose()
    }

    /// The first states of the trajectories of a file, in its units.
    ///
    /// # Errors
    /// Those of [`read_trajectories`] and [`FileData::read_section`]; when it has fewer states, or one is beyond the
    /// section.
    pub(super) fn read_trajectories(
        &self,
        path: &Path,
        states: usize,
    ) -> Result<Trajectories, Error> {
        let values = read_trajectories(path, self.circle_action.dof())?;
        let place = format!("{}: states of each trajectory", path.display());
        Error::check_count_range(&place, values.states(), states, usize::MAX)?;
        if let Some(section) = self.read_section()? {
            section.check_points(&path.display().to_string(), values.values())?;
        }
        Ok(values.first(states))
    }
}

/// The section of a file, for pairs of so many planes.
pub(super) fn section_of(path: &Path, dof: usize) -> Result<Section, Error> {
    let place = |error: Error| error.with_place(path.display());
    let section = read_section(path)?;
    section.check(dof).map_err(place)?;
    if section.depends_on_controls() {
        let expected = "one density: the pairs of a scene have no controls";
        return Err(place(Error::invalid("lambda", "a density of controls", expected)));
    }
    Ok(section)
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

    /// The circles of networks that declare none.
    pub(super) fn torus(self) -> TorusAction {
        match self {
            Self::File(FileData { torus: Some(torus), .. }) => torus.clone(),
            _ => self.circle_action().into(),
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
            Self::File(_) | Self::Lines(_) => Some(fit_rotations(pairs, &action)),
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
