//! The steps of networks as measures see them.

use super::measured_coupling::CouplingStep;
use super::measured_step::{MeasuredPotential, MeasuredSteps, StepMap, TrackedStep, turn_steps};
use super::measured_twist::TwistStep;
use crate::layer::{
    ElementaryMap, Kick, RidgePotential, TurnStep, TurnedCoupling, TurnedKick, Twist,
};
use crate::network::Visitor;
use crate::phase::Direction;

/// The steps of a composition, as measures see them.
#[derive(Clone, Copy, Debug)]
pub(super) struct AsMeasured;

impl<'a> Visitor<'a, f64> for AsMeasured {
    type Output = MeasuredSteps<'a>;

    fn visit(self, map: impl ElementaryMap<f64> + 'a) -> MeasuredSteps<'a> {
        vec![Box::new(TrackedStep { map: StepMap(map), direction: Direction::Forward })]
    }

    fn visit_kick<const D: usize>(
        self,
        kick: Kick<'a, f64, RidgePotential<'a, f64, D>>,
    ) -> MeasuredSteps<'a> {
        vec![RidgePotential::measured_kick(kick)]
    }

    /// Polynomials are steep: their steps are measured one by one, where neurons take one for all.
    fn visit_turned_kick<const D: usize>(
        self,
        turned: TurnedKick<'a, f64, D>,
    ) -> MeasuredSteps<'a> {
        let (turn, kick) = turned.turn_and_kick();
        match kick.potential {
            RidgePotential::Neurons(_) => self.visit(turned),
            RidgePotential::Polynomial(_) if kick.is_identity() => Vec::new(),
            RidgePotential::Polynomial(_) => {
                let mut steps = turn_steps(turn, Direction::Forward);
                steps.push(RidgePotential::measured_kick(kick));
                steps.extend(turn_steps(turn, Direction::Inverse));
                steps
            }
        }
    }

    fn visit_twist<const D: usize>(self, twist: Twist<'a, f64, D>) -> MeasuredSteps<'a> {
        vec![Box::new(TwistStep(twist))]
    }

    fn visit_coupling<const D: usize>(
        self,
        coupling: TurnedCoupling<'a, f64, D>,
    ) -> MeasuredSteps<'a> {
        vec![Box::new(CouplingStep::new(coupling))]
    }

    fn visit_turn(self, turn: TurnStep<'a, f64>) -> MeasuredSteps<'a> {
        let direction = if turn.inverse { Direction::Inverse } else { Direction::Forward };
        turn_steps(turn.turn, direction)
    }
}
