//! Measures: pure functions from a map and points to numbers.
//!
//! Errors are given as *ratios*: an error over the rounding bound of the very
//! computation that made it, O(1) when all is well. A defect that does not come
//! from rounding shows as a ratio of many orders. Nothing here prints.

mod accuracy;
mod certificate;
mod circle_axioms;
mod inversion;
mod jacobian;
mod near_identity;
mod rounding;
mod symplecticity;

pub use accuracy::{Drift, component_errors, distance, drift, limiting_flow_error};
pub use certificate::{
    Certificate, CertificateOptions, Row, Verdict, certify, certify_all, certify_map,
};
pub use circle_axioms::{
    CircleAxiom, circle_axiom_ratio, conjugated_axiom_ratio, turning_axiom_ratio,
};
pub use inversion::{Conditioned, inversion_ratio};
pub use jacobian::{Differentiable, jacobian};
pub use near_identity::{
    differing_components, log_slope, near_identity_size, near_identity_undoing,
};
pub use rounding::{Walk, inverse_of_symplectic};
pub use symplecticity::{symplecticity_defect, symplecticity_ratio};
