//! Networks: lists of blocks, and the maps that they define together with parameters.
//!
//! An [`Architecture`] is data: degrees of freedom, circles, ε, flow time and a list of
//! [`Block`]s, each a kind of layer with its widths and the [`Part`] of the map that it forms. Together
//! with parameters it is a [`Model`]: a [`Composition`] of steps, which can be evaluated, inverted,
//! differentiated and measured. [`HenonShape`], [`GyroceptronShape`], [`NormalFormShape`],
//! [`CouplingGyroceptronShape`] and [`SympNetShape`] make the named architectures.
//!
//! # Parameter layout
//!
//! The parameters are one flat vector: those of each block, in the order of the list, each with its
//! layers in the order of application, and an angle θ for each circle at the end.
//! [`Architecture::tensors`] names them all. In a network with [`Controls`] the same number of
//! parameters follows for each further product of the controls. A Hénon layer of width h in n
//! degrees of freedom has h(n + 2) + n consecutive numbers: `W` (n × h, row by row), `b` (h), `w` (h),
//! `η` (n). A turned kick has its n angles and `W`, `b`, `w`; a twist shear has `W` (d × h, the rows of
//! the actions first), `b`, `w` and, if it is the first, third and so on, the rows of the upper triangle
//! of `Q` (d × d). A coupling has its n angles and `W` (n × h), `b`, `A` (n × h), `a`, `B` (n × h), `β`.
//! A linear module has its symmetric matrices, each by the rows of its upper triangle, and the 2n
//! numbers of its translation; an activation module has n numbers.

mod architecture;
mod batch;
mod bind;
mod block;
mod block_table;
mod composition;
mod controls;
mod init;
mod jacobians;
mod layers;
mod model;
pub mod named;
mod normal_form;
mod on_grid;
mod pace;
mod part;
mod spec;
mod step;
mod visits;

pub use architecture::{Architecture, Structure};
pub use batch::{Course, Rollout, map_points, map_points_at_pace, rollout, rollout_at_pace};
pub use block::Block;
pub use block_table::Alternating;
pub(crate) use composition::NEURONS;
pub use composition::{Composition, Recording};
pub use controls::{ControlRange, Controls};
pub use init::InitialWeights;
pub use jacobians::{map_jacobians, map_jacobians_by_duals};
pub use layers::{LayerKind, Layers, Modules};
pub use model::{Invariant, Model};
pub use named::{
    CouplingGyroceptronShape, GyroceptronShape, HenonShape, KickedGyroceptronShape, SympNetShape,
};
pub use normal_form::NormalFormShape;
pub use on_grid::{GridPoints, grid_rollout};
pub use pace::Pace;
pub use part::{Part, Scale};
pub use spec::{Circles, LayerSizes, NamedArchitecture, NetworkSpec};
pub use step::{Kind, Step, Visitor};

pub(crate) use batch::{load, load_groups, store_groups};
pub(crate) use normal_form::MOST_REPEATS;
