//! What a fit says of its pairs, and of what it chose.

use super::{ActionTrial, AreaDefect, MirrorDefect, Reading, ReversalDefect};
use crate::flow::{FormDefect, Pairs};
use crate::network::Controls;
use crate::phase::{Section, Units};
use std::fmt;

/// The largest relative error of a density of a section that is not warned of.
pub(super) const SURE_DENSITY: f64 = 1e-6;

/// A note on what a fit found or chose.
#[derive(Clone, Debug, PartialEq)]
pub enum FitNote {
    /// The circle action was found from the pairs.
    Action(ActionTrial),
    /// The pairs fit far better in another order of columns or with another circle action.
    Reading(Reading),
    /// The network has units of its own.
    Units(Units),
    /// The first number of pairs, out of the second, have ε below 0.
    NegativeEpsilons(usize, usize),
    /// The pairs are in the charts of a section.
    Section(Section),
    /// The density of the section of a polynomial has this relative error.
    Density(f64),
    /// The first number of held-out pairs, out of the second, have inputs that fitted pairs have too.
    Repeated(usize, usize),
    /// The pairs do not preserve the area form that the network preserves; true for pairs in the
    /// charts of a section.
    Form(FormDefect, bool),
    /// The pairs are reversible by a reflection that the network could have, or not by the one that
    /// it has.
    Reversal(ReversalDefect),
    /// The pairs commute with a reflection of planes that a polynomial could have, or not with the one that it has.
    Mirror(MirrorDefect),
    /// The network depends on these controls; all pairs at this number of their values are held
    /// out.
    Controls(Controls, usize),
    /// A recommended choice that was made where none was given.
    Recommended(String),
}

impl fmt::Display for FitNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Action(trial) => f.write_str(&trial.describe()),
            Self::Reading(reading) => f.write_str(&reading.describe()),
            Self::Units(units) => f.write_str(&units.describe()),
            Self::NegativeEpsilons(count, all) => write!(
                f,
                "{count} of {all} pairs have ε below 0. ε keeps its sign: it multiplies what the \
                 network adds to the rotation, and a prediction for these pairs needs the same sign"
            ),
            Self::Section(section) => {
                f.write_str(&section.describe())?;
                match self.is_warning() {
                    true => f.write_str(
                        ". Whether the pairs keep its area cannot be judged more finely: take a density on a \
                         finer grid, a smoother one, or one with more digits",
                    ),
                    false => Ok(()),
                }
            }
            Self::Density(error) => write!(
                f,
                "the density of the section errs by {error:.1e} of its largest value: in the columns of the data the \
                 map keeps areas to no more than that, and errs by as much. Take a density on a finer grid, a smoother \
                 one, or one with more digits"
            ),
            Self::Repeated(count, all) => write!(
                f,
                "{count} of {all} held-out pairs have inputs that fitted pairs have too: their error says nothing of \
                 points between"
            ),
            Self::Controls(controls, held_out) => {
                write!(f, "{}. ", controls.describe())?;
                match held_out {
                    0 => f.write_str(
                        "No values of them are held out, of fewer than five none can be: the held-out error says \
                         nothing of values between those of the pairs",
                    ),
                    1 => f.write_str("All pairs at one value between the others are held out"),
                    _ => write!(f, "All pairs at {held_out} values between the others are held out"),
                }
            }
            Self::Form(defect, charted) => write!(
                f,
                "These pairs do not keep {} by {:.1e} in the median, as a polynomial map of degree {} fitted to \
                 them has it; two such fits differ by {:.1e}. A symplectic map keeps it: {}?",
                if *charted { "the area of the section" } else { "dq∧dp" },
                defect.median,
                defect.degree,
                defect.resolution,
                match charted {
                    true =>
                        "is this the right density, at each value of the controls if there are any",
                    false =>
                        "are q and p canonical, and is there no friction (a coupling gyroceptron is for that)",
                }
            ),
            Self::Reversal(defect) => write!(f, "{defect}"),
            Self::Mirror(defect) => write!(f, "{defect}"),
            Self::Recommended(text) => f.write_str(text),
        }
    }
}

impl FitNote {
    /// Whether it is on pairs that the network may be wrong for, and not only on what was chosen.
    pub fn is_warning(&self) -> bool {
        match self {
            Self::Reading(_)
            | Self::NegativeEpsilons(..)
            | Self::Density(_)
            | Self::Repeated(..)
            | Self::Form(..)
            | Self::Reversal(_)
            | Self::Mirror(_) => true,
            Self::Section(section) => !(section.error() <= SURE_DENSITY),
            Self::Action(_) | Self::Units(_) | Self::Controls(..) | Self::Recommended(_) => false,
        }
    }

    /// What the pairs say on areas that a map keeps.
    pub fn area_defect(&self) -> Option<AreaDefect> {
        match self {
            Self::Form(defect, false) => Some(AreaDefect::Pairs(defect.median)),
            Self::Form(defect, true) => Some(AreaDefect::OfSection(defect.median)),
            Self::Section(section) => Some(AreaDefect::Density(section.error())),
            _ => None,
        }
    }

    /// The note on ε below 0, where there are some: of the pairs of a family, or the one of all pairs.
    pub fn of_negative_epsilons(pairs: &Pairs, epsilon: f64) -> Option<Self> {
        let below = pairs.conditions().iter().filter(|condition| condition.epsilon < 0.0);
        let count = match pairs.conditions() {
            [] if epsilon < 0.0 => pairs.len(),
            _ => below.map(|condition| condition.pairs).sum(),
        };
        (count > 0).then(|| Self::NegativeEpsilons(count, pairs.len()))
    }
}
