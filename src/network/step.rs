//! The kinds of step, and the one place where a step is bound to its parameters.

use crate::layer::{
    Activation, ElementaryMap, Kick, KickForm, Reversor, RidgePotential, Ridges, TurnStep,
    TurnedCoupling, TurnedKick, Twist, TwistShears,
};
use crate::phase::Half;
use crate::scalar::Scalar;
use std::ops::Range;
use std::sync::Arc;

/// One step of a composition, pointing into its parameters.
#[derive(Clone, Debug)]
pub struct Step {
    /// The kind of step, with what it is made of.
    pub kind: Kind,
    /// The range of its parameters. Several steps may share them.
    pub parameters: Range<usize>,
    /// Whether the inverse of the step is applied.
    pub inverse: bool,
    /// Whether the step is scaled by the composition's ε, or else by 1.
    pub near_identity: bool,
    /// A further factor: the flow time, where it scales the step.
    pub time: Option<f64>,
}

/// The kinds of step.
///
/// A new kind takes an [`ElementaryMap`] in a file of `layer/`, a variant and its answers here, an arm of
/// `Composition::bind` and, for proofs of maps of one degree of freedom, an arm of `PlaneMap::of_composition`.
#[derive(Clone, Debug)]
pub enum Kind {
    /// A kick of a Hénon layer.
    Kick {
        /// The ridge functions of its potential.
        ridges: Ridges,
        /// Which of the four kicks of a Hénon layer this is.
        form: KickForm,
    },
    /// A turn by the angles that are its parameters.
    Turn {
        /// Which of the composition's prepared turns.
        prepared: usize,
    },
    /// A kick in turned coordinates; its first n parameters are the angles.
    TurnedKick {
        /// The ridge functions of its potential.
        ridges: Ridges,
        /// Which of the composition's prepared turns.
        prepared: usize,
    },
    /// An affine coupling in turned coordinates; its first n parameters are the angles.
    TurnedCoupling {
        /// The number h of neurons of the coupling.
        width: usize,
        /// Which of the composition's prepared turns.
        prepared: usize,
    },
    /// The flow of functions of the actions and of half the slow coordinates.
    Twist {
        /// The shears that the twist is composed of.
        shears: Arc<TwistShears>,
        /// If the shears are turned, the index of the composition's prepared turn for the first
        /// shear; those of the others follow.
        prepared: Option<usize>,
    },
    /// A linear module of a SympNet.
    Linear {
        /// The half that its first shear changes.
        first: Half,
        /// Whether a translation follows its shears.
        translated: bool,
    },
    /// An activation module of a SympNet.
    Activation {
        /// The activation σ of the module.
        activation: Activation,
        /// The half of the coordinates that the module changes.
        target: Half,
    },
    /// The reflection of a reversible map. It is not symplectic by itself, and occurs twice.
    Reflection(Reversor),
}

impl Kind {
    /// The name of the kind in generated source code.
    #[cfg(feature = "files")]
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Self::Kick { .. } => "kick",
            Self::Turn { .. } => "turn",
            Self::TurnedKick { .. } => "turned_kick",
            Self::TurnedCoupling { .. } => "turned_coupling",
            Self::Twist { .. } => "twist",
            Self::Linear { .. } => "linear",
            Self::Activation { .. } => "activation",
            Self::Reflection(_) => "reflection",
        }
    }

    /// Why it is no exact bijection of a grid; nothing where it is one.
    pub(super) fn why_off_grid(&self) -> Option<&'static str> {
        match self {
            Self::Twist { .. } => Some(
                "a twist, which turns planes by angles that depend on the actions, and rounding moves these",
            ),
            Self::TurnedCoupling { .. } => {
                Some("an affine coupling, which scales coordinates and so maps no grid onto itself")
            }
            Self::Kick { .. }
            | Self::Turn { .. }
            | Self::TurnedKick { .. }
            | Self::Linear { .. }
            | Self::Activation { .. }
            | Self::Reflection(_) => None,
        }
    }

    /// Where the angles of each of its prepared turns begin among its parameters.
    pub(super) fn angles(&self) -> &[usize] {
        match self {
            Self::Twist { shears, .. } => shears.angles(),
            Self::Turn { .. } | Self::TurnedKick { .. } | Self::TurnedCoupling { .. } => &[0],
            Self::Kick { .. }
            | Self::Linear { .. }
            | Self::Activation { .. }
            | Self::Reflection(_) => &[],
        }
    }

    /// Whether its potentials are of polynomials.
    pub(super) fn is_of_polynomials(&self) -> bool {
        let function = match self {
            Self::Kick { ridges, .. } | Self::TurnedKick { ridges, .. } => ridges.function,
            Self::Twist { shears, .. } => shears.function(),
            _ => return false,
        };
        function.is_polynomial()
    }

    /// Which of the composition's prepared turns it has, if any: the first of them.
    pub(super) fn prepared_mut(&mut self) -> Option<&mut usize> {
        match self {
            Self::Turn { prepared }
            | Self::TurnedKick { prepared, .. }
            | Self::TurnedCoupling { prepared, .. } => Some(prepared),
            Self::Twist { prepared, .. } => prepared.as_mut(),
            Self::Kick { .. }
            | Self::Linear { .. }
            | Self::Activation { .. }
            | Self::Reflection(_) => None,
        }
    }
}

/// An operation on a step after it is bound to its parameters.
///
/// Kinds of step that a visitor may treat specially have a separate method, which defaults to
/// [`Visitor::visit`].
pub trait Visitor<'a, P: Scalar>: Sized {
    /// The result of a visit.
    type Output;

    /// Whether kicks in 1, 2 and 3 degrees of freedom are compiled separately from those
    /// in any number: they are faster, and take longer to build.
    const SPECIALISED: bool = false;

    /// Takes a step of any kind that has no method of its own here.
    fn visit(self, map: impl ElementaryMap<P> + 'a) -> Self::Output;

    /// Takes a kick of a Hénon layer.
    #[inline(always)]
    fn visit_kick<const D: usize>(
        self,
        kick: Kick<'a, P, RidgePotential<'a, P, D>>,
    ) -> Self::Output {
        self.visit(kick)
    }

    /// Takes a kick in turned coordinates.
    #[inline(always)]
    fn visit_turned_kick<const D: usize>(self, kick: TurnedKick<'a, P, D>) -> Self::Output {
        self.visit(kick)
    }

    /// Takes a twist, by default as a step of any kind.
    #[inline(always)]
    fn visit_twist<const D: usize>(self, twist: Twist<'a, P, D>) -> Self::Output {
        self.visit(twist)
    }

    /// Takes a coupling in turned coordinates.
    #[inline(always)]
    fn visit_coupling<const D: usize>(self, coupling: TurnedCoupling<'a, P, D>) -> Self::Output {
        self.visit(coupling)
    }

    /// Takes a turn by angles that are parameters, by default as a step of any kind.
    #[inline(always)]
    fn visit_turn(self, turn: TurnStep<'a, P>) -> Self::Output {
        self.visit(turn)
    }
}
