//! Networks: compositions of layers over one flat parameter vector.
//!
//! [`HenonNet`] (plain and near the identity), [`Gyroceptron`], [`NormalForm`],
//! [`SympNet`] and [`CouplingGyroceptron`], which alone is not symplectic, are each
//! a [`Composition`], which is what is evaluated, inverted, differentiated and
//! measured. [`Model`] is any of them in double precision, as files hold it.
//!
//! # Parameter layout
//!
//! A layer of width h in n degrees of freedom owns h(n + 2) + n consecutive
//! numbers: `W` (n × h, row by row), `b` (h), `w` (h), `η` (n). A HénonNet is
//! its layers in the order of application. A gyroceptron is the layers of ψ,
//! then those of I_ε, then θ. A linear module is its symmetric matrices, each by the
//! rows of its upper triangle, and 2n numbers of its translation; an activation
//! module has n. A normal-form gyroceptron is the layers of ψ, the turned kicks, each its n
//! angles and W, b, w, the twist shears, each W (d × h, the rows of the actions first), b, w and,
//! the first, third and so on, the rows of the upper triangle of Q (d × d), and an angle for each
//! circle. A SympNet is its modules in the order of application. A gyroceptron of couplings is the
//! couplings of ψ, those of I_ε, each its n angles and W (n × h), b, A (n × h), a, B (n × h), β, and θ.

/// What a network that is its composition has of [`Map`](crate::phase::Map).
macro_rules! map_of_composition {
    ($number:ty) => {
        fn dof(&self) -> usize {
            self.composition().dof()
        }
        fn forward(&self, z: &mut [$number]) {
            self.composition().forward(z);
        }
        fn inverse(&self, z: &mut [$number]) {
            self.composition().inverse(z);
        }
    };
}

mod batch;
mod composition;
mod coupling_gyroceptron;
mod gyroceptron;
mod henon_net;
mod init;
mod jacobians;
mod model;
mod normal_form;
mod pace;
mod step;
mod symp_net;

pub use batch::{Rollout, map_points, map_points_at_pace, rollout, rollout_at_pace};
pub use composition::{Composition, Recording};
pub use coupling_gyroceptron::{CouplingGyroceptron, CouplingGyroceptronShape};
pub use gyroceptron::{Gyroceptron, GyroceptronShape};
pub use henon_net::{HenonNet, HenonShape};
pub use init::InitialWeights;
pub use jacobians::{map_jacobians, map_jacobians_by_duals};
pub use model::{Architecture, Invariant, Model};
pub use normal_form::{NormalForm, NormalFormShape};
pub use pace::Pace;
pub use step::{Kind, Step, Visitor};
pub use symp_net::{SympNet, SympNetShape};

pub(crate) use batch::{NEURONS, TOGETHER, load, load_groups};
pub(crate) use normal_form::MOST_REPEATS;
