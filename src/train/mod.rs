//! Training: a loss, its gradient and curvature, and the optimisers that minimise it.
//!
//! - `loss`, `kernels`, `normal_equations`: the loss of a network on pairs, its
//!   gradient, the Gauss–Newton matrix.
//! - `record`, `minimise`: records of a training, the reasons why it ends, and what optimisers
//!   share.
//! - `lbfgs`, `levenberg_marquardt`, `adam`: the optimisers, each with its options and its state.
//! - `stages`, `options`, `checkpoint`, `run`: the options of a training, and the run of one stage:
//!   validation, stopping, resuming.
//! - `schedule`: several starts, a ramp through other flow times or ε, twists trained alone.
//! - `judgement`: whether to trust a trained network, and what limits its error.
//! - `prepare`, `reading`, `action_fit`, `action_trial`, `rotation_fit`, `units_fit`: the circle action, θ and the
//!   units of data for which they are not known.
//! - `fit`, `fit_options`: from pairs to a model, and what callers may ask for.
//! - `polynomial_fit`: from pairs to a symplectic polynomial, without training.

mod action_fit;
mod action_trial;
mod adam;
mod checkpoint;
mod control_options;
mod fit;
mod fit_note;
mod fit_options;
mod judgement;
mod kernels;
mod lbfgs;
mod levenberg_marquardt;
mod loss;
mod minimise;
mod normal_equations;
mod options;
mod polynomial_fit;
mod prepare;
mod problem;
mod reading;
mod record;
mod reversal;
mod ring_fit;
mod rotation_fit;
mod run;
mod schedule;
mod stages;
mod units_fit;

pub use action_fit::ActionFit;
pub use action_trial::ActionTrial;
pub use adam::AdamOptions;
pub use checkpoint::Checkpoint;
pub use control_options::ControlOptions;
pub use fit::{FamilyPairs, Fit};
pub use fit_note::FitNote;
pub use fit_options::{FitOptions, Recipe};
pub use judgement::{AreaDefect, Judgement, Limit, Orbits, PlaneError, Trust};
pub use lbfgs::{LbfgsOptions, Scaling};
pub use levenberg_marquardt::LevenbergMarquardtOptions;
pub use loss::{Loss, Objective};
pub use normal_equations::NormalEquations;
pub use options::{Optimiser, Plateau, TrainingOptions};
pub use polynomial_fit::{FittedPolynomial, PolynomialFit, PolynomialTrial};
pub use prepare::{Preparation, Prepared};
pub use problem::{Earlier, Fitted, InitialModels, Problem, StagePairs};
pub use reading::Reading;
pub use record::{Stop, TrainingRecord};
pub use reversal::{MirrorDefect, ReversalDefect};
pub use ring_fit::Rings;
pub use rotation_fit::{fit_rotation, fit_rotations, slow_time};
pub use run::{Control, Outcome, Progress, train};
pub use schedule::{
    Scheduled, StageData, StageResult, TrainingObserver, TrainingStage, train_schedule,
};
pub use stages::{FreshTwists, RampStage, Starts};
pub use units_fit::fit_units;

/// Internals for the tests of this crate; not part of the public API.
#[doc(hidden)]
pub mod internals {
    pub use super::judgement::{STEPS, limit, orbits, plane_errors, worst};
}
