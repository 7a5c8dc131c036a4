//! Studies of scenes, as a caller of the library runs them.

mod actions;
mod aperture;
mod claims;
mod dissipation;
mod family;
mod figures;
mod frequency_map;
mod helpers;
mod invariants;
mod jobs;
mod long_steps;
mod lost;
mod models;
mod noise;
mod slow_manifold;
mod surfaces;
mod trust;
