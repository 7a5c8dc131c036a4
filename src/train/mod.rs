//! Training: a loss, its gradient and curvature, and L-BFGS on them.

mod checkpoint;
mod lbfgs;
mod loss;
mod options;
mod rotation_fit;

pub use checkpoint::Checkpoint;
pub use lbfgs::{Control, Outcome, Progress, train};
pub use loss::{Loss, Objective};
pub use options::{Scaling, Stop, TrainingOptions, TrainingRecord};
pub use rotation_fit::fit_rotation;
