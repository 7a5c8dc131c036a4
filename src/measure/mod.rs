//! Measures: pure functions from a map and points to numbers.
//!
//! Errors are given as *ratios*: an error over the rounding scale of the very
//! computation that made it, O(1) when all is well. A defect that does not come
//! from rounding shows as a ratio of many orders. The scale is the root of a sum of squares of
//! what each operation may be off by: errors are of its size, but it does not bound them, so that
//! ratios have a limit of 10 and not of 1. Nothing here prints.

mod accuracy;
mod adiabatic;
mod adjoint;
mod averaging;
mod certificate;
mod circle_axioms;
mod coordinate;
mod defect;
mod determinant;
mod equivariance;
pub mod fuzz;
mod horizon;
mod implicit;
mod inversion;
mod jacobian;
pub mod laws;
mod level_set;
mod measurable;
mod measured_coupling;
mod measured_network;
mod measured_step;
mod measured_twist;
mod near_identity;
mod own_invariance;
mod plane_actions;
mod relations;
mod rounding;
mod sampled;
mod samples;
mod stopping;
mod surfaces;
mod symplecticity;
mod tally;
mod work_precision;

pub use accuracy::{
    Departure, Drift, Milestone, PlaneMotion, component_errors, departures, distance,
    distances_along, drift, drift_exponent, drifts, limiting_flow_error, milestones, plane_motions,
    predictions, root_mean_square, rotation_error, rotation_errors,
};
pub use adiabatic::{
    FittedLine, Resonance, disturbing_resonance, invariant_drift, invariant_horizon,
    leading_invariant, log_line, log_slope, nearest_resonance, settling_iterations,
};
pub use adjoint::{Adjoint, RESOLVED, adjoint_ratio};
pub use averaging::averaged_invariant;
pub use certificate::{
    Certificate, certify, certify_all, certify_family, certify_map, certify_nearly_periodic,
    certify_normal_form, certify_unless_stopped,
};
pub use circle_axioms::{
    CircleAxiom, circle_axiom_ratio, conjugated_axiom_ratio, turning_axiom_ratio,
};
pub use coordinate::Coordinate;
pub use defect::symplecticity_defect;
pub use determinant::determinant_ratio;
pub use equivariance::{NormalFormed, action_ratio, equivariance_ratio};
pub use horizon::AdiabaticOrbit;
pub use implicit::{Implicit, Solved};
pub use inversion::{Conditioned, ILL_CONDITIONED, ThereAndBack, inversion_ratio};
pub use jacobian::{Differentiable, jacobian, jacobians_by_differences};
pub use laws::Samples;
pub use level_set::level_set;
pub use measurable::{Layers, Measurable, NearlyPeriodic, OneStep, Steps, WithDomain};
pub use measured_step::{
    KickStep, Magnitudes, MeasuredPotential, MeasuredStep, MeasuredSteps, Numbers, TrackedStep,
    turn_steps,
};
pub use near_identity::{
    differing_components, near_identity_generator, near_identity_rms, near_identity_size,
    near_identity_undoing,
};
pub use own_invariance::OwnInvariance;
pub use plane_actions::PlaneSwing;
pub use relations::Relation;
pub use rounding::RoundingPropagation;
pub use sampled::{mean_period, simpson};
pub use samples::CertificateOptions;
pub use surfaces::{LockedInterval, distances_to_set, locked_interval, winding_numbers};
pub use symplecticity::{symplecticity_ratio, symplecticity_scale};
pub use tally::{
    COUNT_LIMIT, RATIO_LIMIT, RESOLUTION, Row, SLOPE_LIMIT, SOUND_DECILE, SOUND_DEVIATION,
    SOUND_MEDIAN, TESTABLE, Tally, Verdict, merged,
};
pub use work_precision::{
    Comparison, FastestWithin, Method, Spread, TrajectoryMethods, WorkPrecision, fastest,
    most_accurate, precise_jacobians, relative_difference, root_mean_square_distance, tanh_errors,
    work_precision, work_precision_by,
};

/// What the tests of this crate reach behind the public API: not a part of it.
#[doc(hidden)]
pub mod internals {
    pub use super::plane_actions::{monomials, power, powers};
    pub use super::stopping::{unless_stopped, until_stopped};
}
