//! Measures: pure functions from a map and points to numbers.
//!
//! Errors are given as *ratios*: an error divided by the rounding scale of the computation that
//! made it. A ratio is O(1) when the error is rounding alone; any other defect gives a ratio that
//! is larger by many orders of magnitude. The scale adds the rounding errors of the single
//! operations in quadrature. It estimates the error and does not bound it, so the limit of a
//! ratio is 10 and not 1. Nothing here prints.

mod accuracy;
mod adjoint;
mod averaging;
mod certify;
mod certify_polynomial;
mod circle_axioms;
mod control_response;
mod coordinate;
mod defect;
mod determinant;
mod drift;
mod equivariance;
mod frequency;
pub mod fuzz;
mod golden_section;
mod horizon;
mod implicit;
mod invariant_circle;
mod inversion;
mod island;
mod jacobian;
pub mod laws;
mod level_set;
mod manifold;
mod measurable;
mod measured_coupling;
mod measured_network;
mod measured_step;
mod measured_twist;
mod near_identity;
mod on_grid;
mod own_invariance;
mod periodic;
mod plane_actions;
#[cfg(feature = "proofs")]
pub mod proof;
mod relations;
mod rotation;
mod rounding;
mod sampled;
mod samples;
mod series_invariant;
mod surfaces;
mod survival;
mod symmetric_orbits;
mod symplecticity;
mod tally;
mod work_precision;

pub use coordinate::Coordinate;
pub use equivariance::NormalFormed;
pub use implicit::{Implicit, Solved};
pub use jacobian::{Differentiable, jacobian, jacobians_by_differences};
pub use measurable::{Layers, Measurable, NearlyPeriodic, OneStep, Steps, WithDomain};
pub use on_grid::{GridMap, GridMove};

/// Adiabatic invariants: their drift, averages, level sets, resonances, and the actions of planes.
pub mod adiabatic {
    pub use super::averaging::{averaged_invariant, second_averaged_invariant};
    pub use super::drift::{
        FittedLine, Resonance, disturbing_resonance, invariant_drift, invariant_horizon,
        leading_invariant, log_line, log_slope, nearest_resonance, settling_iterations,
    };
    pub use super::horizon::AdiabaticOrbit;
    pub use super::level_set::level_set;
    pub use super::own_invariance::OwnInvariance;
    pub use super::plane_actions::PlaneSwing;
    pub use super::series_invariant::SeriesInvariant;
}

/// Errors, motions and surfaces of trajectories.
pub mod trajectories {
    pub use super::accuracy::{
        Departure, Drift, Milestone, PlaneMotion, component_errors, departures, distance,
        distances_along, drift, drift_exponent, drifts, limiting_flow_error, milestones,
        plane_motions, predictions, root_mean_square, rotation_error, rotation_errors,
    };
    pub use super::sampled::{mean_period, simpson};
    pub use super::surfaces::{LockedInterval, distances_to_set, locked_interval, winding_numbers};
}

/// Periodic orbits, islands, invariant circles, frequencies, manifolds and survival of orbits of a map.
pub mod orbits {
    pub use super::control_response::{AtControls, OrbitResponse};
    pub use super::frequency::{SpectralLine, Tunes, spectral_lines, tunes};
    pub use super::invariant_circle::InvariantCircle;
    pub use super::island::{Island, IslandSearch};
    pub use super::manifold::{Branch, PlaneMap, manifold, smaller_alignment_index};
    pub use super::periodic::{
        PeriodicOrbit, WithJacobian, lyapunov_exponent, periodic_orbit, periodic_orbits,
    };
    pub use super::rotation::{RotationNumber, rotation_numbers};
    pub use super::survival::{Follow, aperture_of_ray, dynamic_aperture, maps_survived};
    pub use super::symmetric_orbits::{SymmetryLine, symmetric_periodic_orbits};
}

/// Work–precision comparisons: the error of each method against its run time.
pub mod timing {
    pub use super::work_precision::{
        AtError, Comparison, FastestWithin, Method, Run, Spread, TrajectoryMethods, WorkPrecision,
        break_even, fastest, most_accurate, precise_jacobians, relative_difference,
        root_mean_square_distance, tanh_errors, work_precision, work_precision_by,
    };
}

/// The structure certificate, a sampled test of the laws, and the tallies that it is made of.
pub mod certificate {
    pub use super::certify::{
        Certificate, certify, certify_all, certify_family, certify_map, certify_nearly_periodic,
        certify_normal_form, certify_reversible, certify_unless_stopped,
    };
    pub use super::certify_polynomial::{
        PolynomialAndInverse, certify_polynomial, polynomial_laws,
    };
    pub use super::samples::CertificateOptions;
    pub use super::tally::{
        COUNT_LIMIT, RATIO_LIMIT, RESOLUTION, Row, SLOPE_LIMIT, SOUND_DECILE, SOUND_DEVIATION,
        SOUND_MEDIAN, TESTABLE, Tally, Verdict, merged,
    };
}

/// Laws at a single point: an error divided by the rounding scale of its computation.
pub mod ratios {
    pub use super::adjoint::{Adjoint, RESOLVED, adjoint_ratio};
    pub use super::circle_axioms::{
        CircleAxiom, circle_axiom_ratio, conjugated_axiom_ratio, turning_axiom_ratio,
    };
    pub use super::defect::symplecticity_defect;
    pub use super::determinant::determinant_ratio;
    pub use super::equivariance::{action_ratio, equivariance_ratio};
    pub use super::inversion::{Conditioned, ILL_CONDITIONED, ThereAndBack, inversion_ratio};
    pub use super::near_identity::{
        differing_components, near_identity_generator, near_identity_inversion, near_identity_rms,
        near_identity_size,
    };
    pub use super::on_grid::differing_places;
    pub use super::relations::Relation;
    pub use super::rounding::RoundingPropagation;
    pub use super::symplecticity::{symplecticity_ratio, symplecticity_scale};
}

/// The steps of a map, each with the scale of its rounding errors, from which the ratios are made.
pub mod steps {
    pub use super::measured_step::{
        KickStep, Magnitudes, MeasuredPotential, MeasuredStep, MeasuredSteps, Numbers, TrackedStep,
        turn_steps,
    };
}

/// Internals for the tests of this crate, which are not part of the public API.
#[doc(hidden)]
pub mod internals {
    pub use super::plane_actions::{monomials, power, powers};
    pub use crate::stopping::{unless_stopped, until_stopped};
}
