//! The circle action of pairs by short trainings with some of them.

use super::ActionFit;
use crate::error::Error;
use crate::flow::Pairs;
use crate::layer::{CircleAction, TorusAction};
use crate::measure::trajectories::{component_errors, root_mean_square};
use crate::network::Composition;
use crate::scalar::max_or_nan;
use crate::words::percent;

/// Short trainings on the same pairs, each with a different circle action: the right action has the
/// smallest error.
///
/// Where the fast plane makes whole turns between input and output, its angle is known only up to these, and may by
/// chance be near a multiple of the angle of a slow plane: the nearest rotation, [`ActionFit`], then names a wrong
/// action. A normal form with the wrong action cannot learn in a few iterations what one with the right action
/// learns.
#[derive(Clone, Debug, PartialEq)]
pub struct ActionTrial {
    /// The estimate from the nearest rotation.
    pub by_rotation: ActionFit,
    /// The actions that were tried, each with the held-out error of the plane that is learnt worst, as a share of how
    /// far that plane moves (root mean squares); NaN for an action that could not be trained. Empty of one plane, which
    /// has one action, of fewer than [`ActionTrial::FEWEST`] pairs, and of more than [`ActionTrial::PLANES`] planes
    /// where the nearest rotation is not sure.
    pub errors: Vec<(TorusAction, f64)>,
}

impl ActionTrial {
    /// The iterations of each training.
    pub const ITERATIONS: u64 = 12;
    /// The largest number of pairs of each training, evenly spaced.
    pub const PAIRS: usize = 400;
    /// Errors that are a smaller share than this are rounding.
    const ROUNDING: f64 = 1e-6;
    /// The largest number of planes of which a trial chooses. With more, a few iterations do not decide: for two modes
    /// and a particle, whose action is `0,1,2`, networks with `0,0,1` have a smaller error. There a trial says no more
    /// than that the action of the nearest rotation is not sure.
    pub const PLANES: usize = 2;
    /// The smallest number of pairs that allows a choice.
    pub const FEWEST: usize = 100;
    /// The share of the pairs that is held out.
    pub(super) const HELD_OUT: f64 = 0.25;
    /// How many of the actions that the nearest rotation names are tried.
    const BY_ROTATION: usize = 2;
    /// An action whose error is this many times that of the best is clearly worse.
    const CLEAR: f64 = 2.0;
    /// The action that the nearest rotation is sure of is rejected where another has an error this many times
    /// smaller.
    const FAR: f64 = 3.0;
    /// Where the smallest error exceeds this share of a plane's motion, too little is learnt for a choice.
    const LITTLE: f64 = 0.5;

    /// The actions that are tried: each plane alone, those of the nearest rotation and, where a network may have
    /// several circles, the torus with one circle for each plane.
    pub fn candidates(by_rotation: &ActionFit, several: bool) -> Vec<TorusAction> {
        let dof = by_rotation.angles.len();
        let alone = |plane: usize| -> CircleAction {
            CircleAction::new((0..dof).map(|j| i32::from(j == plane)).collect::<Vec<_>>())
        };
        let planes: Vec<CircleAction> = (0..dof).map(alone).collect();
        let nearest = by_rotation.candidates.iter().map(|(action, _)| action);
        let more: Vec<CircleAction> = nearest
            .take(Self::BY_ROTATION)
            .filter(|action| !planes.contains(action))
            .cloned()
            .collect();
        let torus = (several && dof > 1).then(|| TorusAction::new(planes.clone()).ok()).flatten();
        planes.into_iter().chain(more).map(TorusAction::from).chain(torus).collect()
    }

    /// Tries each of these actions. `pairs` is the number of pairs; `error` trains once and returns
    /// [`ActionTrial::error`].
    ///
    /// # Errors
    /// Those of `error`.
    pub(super) fn run(
        by_rotation: ActionFit,
        actions: Vec<TorusAction>,
        pairs: usize,
        mut error: impl FnMut(&TorusAction) -> Result<f64, Error>,
    ) -> Result<Self, Error> {
        let mut errors = Vec::new();
        let planes = by_rotation.angles.len();
        let decides = planes <= Self::PLANES || by_rotation.is_sure();
        let wanted = actions.len() > 1 && pairs >= Self::FEWEST && decides;
        for action in actions.into_iter().filter(|_| wanted) {
            if planes > Self::PLANES && action.circles().len() > 1 {
                continue;
            }
            let error = error(&action)?;
            errors.push((action, error));
        }
        Ok(Self { by_rotation, errors })
    }

    /// The held-out error of the plane that a network learns worst, as a share of how far this plane moves.
    ///
    /// # Errors
    /// Those of [`component_errors`].
    pub fn error(network: &Composition<f64>, held_out: &Pairs) -> Result<f64, Error> {
        let errors = component_errors(network, held_out)?;
        let dim = errors.len();
        let moved = |c: usize| -> Vec<f64> {
            let of = |values: &[f64]| values[c..].iter().step_by(dim).copied().collect::<Vec<_>>();
            of(held_out.output()).iter().zip(of(held_out.input())).map(|(w, z)| w - z).collect()
        };
        let moves: Vec<f64> = (0..dim).map(|c| root_mean_square(&moved(c))).collect();
        // A coordinate that stands still up to rounding is compared with the others.
        let still = Self::ROUNDING * root_mean_square(&moves);
        let share = |c: usize| errors[c] / if moves[c] > still { moves[c] } else { still };
        let planes = (0..dim / 2).map(|j| root_mean_square(&[share(j), share(dim / 2 + j)]));
        Ok(planes.fold(0.0, max_or_nan))
    }

    /// The smallest error of an action that was tried; None if no error is finite.
    fn least(&self) -> Option<f64> {
        let known = self.errors.iter().map(|(_, error)| *error).filter(|error| error.is_finite());
        known.min_by(f64::total_cmp)
    }

    /// Whether the smallest error is at most three times that of another trial.
    pub(super) fn errs_as_little_as(&self, other: &Self) -> bool {
        matches!((self.least(), other.least()), (Some(own), Some(other)) if own <= Self::FAR * other)
    }

    /// Whether the best action learns enough to be chosen.
    fn is_learnt(&self) -> bool {
        self.least().is_some_and(|least| least < Self::LITTLE)
    }

    /// Whether the error of an action is at most `factor` times the smallest.
    fn is_within(&self, factor: f64, action: &TorusAction) -> bool {
        let bound = self.least().map_or(f64::NAN, |least| factor * (least + Self::ROUNDING));
        self.errors.iter().any(|(own, error)| own == action && *error <= bound)
    }

    /// The action, if the pairs determine it. It is that of the nearest rotation, if this is sure and no other action
    /// has an error three times smaller; otherwise, of two planes, the one whose error is smallest by a factor of two.
    /// Several circles can do whatever one of them can, so that an action with more circles has to be better by these
    /// factors. Of two planes or more whose actions were not tried there is none: the nearest rotation does not see
    /// whole turns.
    pub fn chosen(&self) -> Option<TorusAction> {
        let sure = self.by_rotation.is_sure().then(|| self.by_rotation.action().clone().into());
        let planes = self.by_rotation.angles.len();
        if planes > 1 && self.errors.is_empty() {
            return None;
        }
        if !self.is_learnt() || sure.as_ref().is_some_and(|sure| self.is_within(Self::FAR, sure)) {
            return sure;
        }
        if planes > Self::PLANES {
            return None;
        }
        let good = || {
            let all = self.errors.iter().map(|(action, _)| action);
            all.filter(|action| self.is_within(Self::CLEAR, action))
        };
        let fewest = good().map(|action| action.circles().len()).min();
        let mut simple = good().filter(|action| Some(action.circles().len()) == fewest);
        match (simple.next(), simple.next()) {
            (Some(only), None) => Some(only.clone()),
            _ => None,
        }
    }

    /// The circle action that was found, and the errors of those that were tried, in words.
    pub fn describe(&self) -> String {
        let finite = self.errors.iter().filter(|(_, error)| error.is_finite());
        let mut known: Vec<&(TorusAction, f64)> = finite.collect();
        known.sort_by(|a, b| a.1.total_cmp(&b.1));
        let of =
            |(action, error): &(TorusAction, f64)| format!("{} with {action}", percent(*error));
        let texts: Vec<String> = known.into_iter().map(of).collect();
        let tried = format!(
            "after {} iterations the network errs by {} of the motion of the plane that it learns worst",
            Self::ITERATIONS,
            texts.join(", ")
        );
        match (self.chosen(), texts.is_empty()) {
            (Some(action), false) if self.is_learnt() => format!("circle action {action}: {tried}"),
            (Some(_), false) => {
                format!(
                    "{}; too little is learnt for a choice: {tried}",
                    self.by_rotation.describe()
                )
            }
            (None, false) => format!("{tried}; {}", self.by_rotation.describe()),
            (None, true)
                if self.errors.is_empty()
                    && (self.by_rotation.is_sure()
                        || self.by_rotation.angles.len() == Self::PLANES) =>
            {
                format!(
                    "it takes {} pairs to try actions by short trainings; {}",
                    Self::FEWEST,
                    self.by_rotation.describe()
                )
            }
            (_, true) => self.by_rotation.describe(),
        }
    }
}
