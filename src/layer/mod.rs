//! Layers: shears and what is made of them, written over the number type.
//!
//! - [`Kick`]: the primitive. One half of the coordinates is moved by the
//!   gradient of a potential of the other half. Forward, inverse, tangent
//!   (through dual numbers) and pullback.
//! - [`Potential`]: what a kick needs to know of its potential;
//!   [`TanhPotential`] is the one with a hidden layer.
//! - [`HenonMap`], [`HenonLayer`]: the paper's H\[V, η\] and its fourth iterate,
//!   the latter as four kicks.
//! - [`CircleAction`], [`Rotation`]: Φ_θ as three shears a plane.
//! - [`ElementaryStep`]: one shear of any of these, as the measures see it.

mod circle_action;
mod elementary_step;
mod henon;
mod potential;
mod shear;

pub use circle_action::{CircleAction, PlaneRotation, Rotation};
pub use elementary_step::ElementaryStep;
pub use henon::{HenonLayer, HenonMap, KickForm, layer_parameter_count};
pub use potential::{Potential, TanhPotential};
pub use shear::Kick;
