//! The one place where a step is bound to its parameters.

use super::composition::Composition;
use super::step::{Kind, Step, Visitor};
use crate::layer::{
    ActivationModule, AffineCoupling, ElementaryMap, LinearModule, Reflection, RidgePotential,
    TurnStep, TurnedCoupling, TurnedKick, Twist,
};
use crate::scalar::Scalar;

impl<P: Scalar> Composition<P> {
    /// Hands the elementary map that a step is, or its inverse when `is_inverse`, to the visitor.
    #[inline(always)]
    pub(super) fn bind<'a, T: Visitor<'a, P>>(
        &'a self,
        step: &'a Step,
        is_inverse: bool,
        visitor: T,
    ) -> T::Output {
        let inverse = step.inverse != is_inverse;
        let parameters = &self.parameters()[step.parameters.clone()];
        let scale = if step.near_identity { self.epsilon() } else { P::from_f64(1.0) };
        let scale = step.time.map_or(scale, |time| scale * P::from_f64(time));
        match step.kind {
            Kind::Kick { ridges, form } => {
                let (potential, eta) = parameters.split_at(ridges.parameter_count(self.dof()));
                macro_rules! visit {
                    ($D:literal) => {{
                        let potential =
                            RidgePotential::<P, $D>::new(self.dof(), ridges, &[], potential);
                        let kick = form.kick(potential, eta, scale);
                        visitor.visit_kick(if inverse { kick.inverse() } else { kick })
                    }};
                }
                match self.dof() {
                    _ if ridges.function.is_polynomial() => visit!(0),
                    1 if T::SPECIALISED => visit!(1),
                    2 if T::SPECIALISED => visit!(2),
                    3 if T::SPECIALISED => visit!(3),
                    _ => visit!(0),
                }
            }
            Kind::Turn { prepared } => {
                visitor.visit_turn(TurnStep { turn: self.turn(prepared), inverse })
            }
            Kind::TurnedKick { ridges, prepared } => {
                let (turn, potential) = (self.turn(prepared), &parameters[self.dof()..]);
                macro_rules! visit {
                    ($D:literal) => {{
                        let potential =
                            RidgePotential::<P, $D>::new(self.dof(), ridges, &[], potential);
                        let kick = TurnedKick::new(turn, potential, scale);
                        visitor.visit_turned_kick(if inverse { kick.inverse() } else { kick })
                    }};
                }
                match self.dof() {
                    _ if ridges.function.is_polynomial() => visit!(0),
                    2 if T::SPECIALISED => visit!(2),
                    3 if T::SPECIALISED => visit!(3),
                    _ => visit!(0),
                }
            }
            Kind::TurnedCoupling { width, prepared } => {
                let (turn, parameters) = (self.turn(prepared), &parameters[self.dof()..]);
                macro_rules! visit {
                    ($D:literal) => {{
                        let shear =
                            AffineCoupling::<P, $D>::new(self.dof(), width, scale, parameters);
                        let coupling = TurnedCoupling::new(turn, shear);
                        visitor.visit_coupling(if inverse { coupling.inverse() } else { coupling })
                    }};
                }
                match self.dof() {
                    2 if T::SPECIALISED => visit!(2),
                    _ => visit!(0),
                }
            }
            Kind::Twist { ref shears, prepared } => {
                let turns = prepared.map_or(&[][..], |first| self.turns(first, shears.count()));
                macro_rules! visit {
                    ($D:literal) => {{
                        let twist = Twist::<P, $D> { shears, scale, parameters, inverse, turns };
                        visitor.visit_twist(twist)
                    }};
                }
                match shears.planes().arguments() {
                    _ if shears.function().is_polynomial() => visit!(0),
                    2 if T::SPECIALISED => visit!(2),
                    _ => visit!(0),
                }
            }
            Kind::Linear { first, translated } => {
                let (dof, plain) = (self.dof(), LinearModule::without_translation);
                let module = if translated { LinearModule::new } else { plain };
                let module = module(dof, first, scale, parameters);
                visitor.visit(if inverse { module.inverse() } else { module })
            }
            Kind::Activation { activation, target } => {
                let (dof, factors) = (self.dof(), parameters);
                let module = ActivationModule { dof, activation, factors, scale, target };
                visitor.visit(if inverse { module.inverse() } else { module })
            }
            Kind::Reflection(reversor) => visitor.visit(Reflection { dof: self.dof(), reversor }),
        }
    }
}
