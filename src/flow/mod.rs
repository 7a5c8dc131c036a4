//! Flows of the systems: splittings, Runge–Kutta, the reference, and data.

mod data;
mod gauss;
mod runge_kutta;
mod splitting;

#[cfg(feature = "files")]
pub(crate) use data::check_finite;
pub use data::{Pairs, Window, sample};
pub use gauss::{GaussLegendre, Reference, ReferenceValue};
pub use runge_kutta::runge_kutta_4;
pub use splitting::Splitting;
