//! Numbers, Hamiltonian systems, their flows and their rivals, coils, sections and their maps, and what is measured
//! along trajectories.

mod averages;
mod chains;
mod coils;
mod frequencies;
mod integrators;
mod numbers;
mod orbits;
mod polynomial_maps;
mod rivals;
mod sections;
mod symplectic_polynomials;
mod systems;
mod trajectories;
mod work_precision;
