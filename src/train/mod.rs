//! Training: a loss, its gradient and curvature, and L-BFGS on them.

mod checkpoint;
mod lbfgs;
mod loss;
mod rotation_fit;

pub use checkpoint::Checkpoint;
pub use lbfgs::{
    Control, Outcome, Progress, Scaling, Stop, TrainingOptions, TrainingRecord, train,
};
pub use loss::{Loss, Objective};
pub use rotation_fit::fit_rotation;
