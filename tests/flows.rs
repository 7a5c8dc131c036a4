//! Numbers, Hamiltonian systems, their flows, and what is measured along trajectories.

mod numbers;
mod systems;
mod trajectories;
mod work_precision;
