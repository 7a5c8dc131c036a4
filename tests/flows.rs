//! Numbers, Hamiltonian systems, their flows and their rivals, and what is measured along trajectories.

mod chains;
mod frequencies;
mod numbers;
mod rivals;
mod sections;
mod symplectic_polynomials;
mod systems;
mod trajectories;
mod work_precision;
