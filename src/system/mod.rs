//! Nearly-periodic systems: Hamiltonian ones, and one that is not.

mod any_system;
mod average;
mod cellular_drift;
mod coils;
mod counted;
mod field_lines;
mod full_orbit;
mod hamiltonian;
mod nearly_periodic;
mod oscillators;
mod particle_field;
mod three_oscillators;
mod van_der_pol;

pub use any_system::System;
pub(crate) use any_system::each_system;
pub use cellular_drift::CellularDrift;
pub use coils::{Coil, CoilField, CoilSet, Tokamak, Torsatron};
pub use counted::Counted;
pub use field_lines::FieldLines;
pub use full_orbit::FullOrbit;
use hamiltonian::turn;
pub use hamiltonian::{Hamiltonian, divergence, symplectic_gradient};
pub use nearly_periodic::{
    AverageConstants, AveragePart, NaturalCoordinates, NearlyPeriodic, Splittable,
};
pub use oscillators::{AveragedOscillator, Oscillators};
pub use particle_field::{FieldProfile, ParticleField};
pub use three_oscillators::ThreeOscillators;
pub use van_der_pol::VanDerPol;
