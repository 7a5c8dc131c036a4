//! Studies: one file each, with its options, its check, its run, what it finds and
//! what it cites.
//!
//! A new study is such a file, its line in the registry of scenes, and a scene of the
//! catalogue that names it.

pub mod actions;
pub mod adiabatic_horizon;
pub mod adiabatic_profiles;
pub mod aperture;
pub mod certificate;
pub mod claims;
pub mod confinement;
pub mod controls;
pub mod dissipation;
pub mod family;
pub mod frequency_map;
pub mod line_edge;
pub mod long_steps;
mod long_steps_results;
pub mod noise;
mod over_seeds;
pub mod overview;
pub mod own_invariant;
pub(super) mod pairs;
pub mod poincare;
mod poincare_figures;
pub mod random_network;
pub mod rollout;
mod section_maps;
mod section_orbits;
mod seed_errors;
pub(super) mod shared;
pub mod slow_manifold;
pub(super) mod step_tables;
pub mod surfaces;
pub mod tanh;
pub mod there_and_back;
pub mod training;
pub mod trajectories;
pub(super) mod trust;
pub mod which_action;
pub mod work_precision;
