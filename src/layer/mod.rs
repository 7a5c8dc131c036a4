//! Layers: shears and maps composed of them, generic over the number type.
//!
//! - [`ElementaryMap`]: a step of a network, with its forward map, inverse, pullback and
//!   derivative along directions. Each kind of step has one file:
//! - [`Kick`]: one half of the coordinates is moved by the gradient of a
//!   [`Potential`] of the other half; [`NeuronPotential`] is the one with a hidden
//!   layer of [neurons](Neuron) of tanh or arctan, [`PolynomialPotential`] one of polynomials over a
//!   box, [`RidgePotential`] either.
//! - [`Turn`], [`TurnStep`]: each plane rotated by its angle, as three shears per
//!   plane; [`CircleAction`] and [`TorusAction`] define which planes rotate together, by an angle in
//!   radians or by a [`TurnFraction`], whose sums are exact.
//! - [`AffineCoupling`]: the momenta scaled and shifted by functions of the positions; not
//!   symplectic.
//! - [`Turned`]: a kick or a coupling in coordinates that are rotated by learnt angles.
//! - [`Twist`]: the flow of functions of the actions and of half the slow coordinates,
//!   which commutes with the torus action.
//!   A turned twist ([`TwistShears::turned`]) acts in coordinates whose slow planes are rotated by
//!   learnt angles.
//! - [`Reversor`], [`Reflection`]: the reflection that maps a reversible map to its inverse.
//! - [`LinearModule`], [`ActivationModule`]: the modules of SympNets.
//!
//! [`HenonMap`], [`HenonLayer`] are the paper's H\[V, η\] and its fourth iterate,
//! the latter as four kicks.

mod activation_module;
mod coupling;
mod elementary_map;
mod henon;
mod kick;
mod linear_module;
mod polynomial;
mod potential;
mod quadratic_form;
mod reversor;
mod ridge;
mod turn;
mod turn_fraction;
mod turned;
mod twist;
mod unrolled;

pub use activation_module::{Activation, ActivationModule};
pub use coupling::{AffineCoupling, coupling_parameter_count};
pub use elementary_map::{ElementaryMap, OfMomenta, PlaneKick};
pub use henon::{HenonLayer, HenonMap, KickForm, layer_parameter_count};
pub use kick::Kick;
pub use linear_module::{LinearModule, linear_module_parameter_count};
pub use polynomial::{ActionInterval, PolynomialPotential};
pub use potential::{Neuron, NeuronPotential, Potential};
pub(crate) use quadratic_form::symmetric_len;
pub use reversor::{Reflection, Reversor};
pub use ridge::{MOST_DEGREES, RidgeFunction, RidgePotential, Ridges};
pub use turn::{CircleAction, PlaneTurn, TorusAction, Turn, TurnStep, quarter_turns};
pub use turn_fraction::TurnFraction;
pub use turned::{Turned, TurnedCoupling, TurnedKick};
#[cfg(feature = "proofs")]
pub(crate) use twist::OfAction;
pub use twist::{FastPlanes, Twist, TwistShears};
