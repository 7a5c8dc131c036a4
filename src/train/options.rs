//! Options of a training.

use super::record::at_least_one;
use super::stages::{FreshTwists, RampStage, Starts, not_a_normal_form};
use super::{AdamOptions, LbfgsOptions, LevenbergMarquardtOptions, Loss};
use crate::error::Error;
use crate::network::{Architecture, Part, Structure};
use serde::{Deserialize, Serialize};

/// The optimiser, with its options.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Optimiser {
    /// L-BFGS in variables scaled by the curvature.
    #[serde(rename = "l-bfgs")]
    Lbfgs(LbfgsOptions),
    /// Gauss–Newton steps, damped after Levenberg and Marquardt.
    LevenbergMarquardt(LevenbergMarquardtOptions),
    /// Adam, with a step for each batch of training pairs.
    Adam(AdamOptions),
}

impl Default for Optimiser {
    fn default() -> Self {
        Self::Lbfgs(LbfgsOptions::default())
    }
}

impl Optimiser {
    /// The optimiser of a name with its default options: `lm` or `levenberg-marquardt`, `l-bfgs` or `lbfgs`, `adam`.
    ///
    /// # Errors
    /// [`Error::Invalid`] for any other name.
    pub fn named(name: &str) -> Result<Self, Error> {
        match name {
            "lm" | "levenberg-marquardt" => {
                Ok(Self::LevenbergMarquardt(LevenbergMarquardtOptions::default()))
            }
            "l-bfgs" | "lbfgs" => Ok(Self::Lbfgs(LbfgsOptions::default())),
            "adam" => Ok(Self::Adam(AdamOptions::default())),
            _ => Err(Error::invalid("optimiser", name, "l-bfgs, lm or adam")),
        }
    }

    /// Whether a plateau of its error says that nothing is left to gain, so that training ends there by default.
    pub(super) fn comes_to_rest(&self) -> bool {
        matches!(self, Self::LevenbergMarquardt(_))
    }

    /// The usual name of the optimiser.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Lbfgs(_) => "L-BFGS",
            Self::LevenbergMarquardt(_) => "Levenberg–Marquardt",
            Self::Adam(_) => "Adam",
        }
    }

    /// Whether the loss of an iteration is taken over batches.
    pub(super) fn takes_batches(&self) -> bool {
        matches!(self, Self::Adam(_))
    }

    /// Makes an optimiser that begins with a part of the pairs begin with at least `pairs`.
    pub(super) fn begin_with(&mut self, pairs: usize, architecture: &Architecture) {
        if let Self::LevenbergMarquardt(options) = self {
            options.begin_with(pairs, architecture);
        }
    }

    /// Pairs that an iteration looks at, of so many: at the beginning of a training, and without pairs at which the
    /// loss alone is taken.
    #[doc(hidden)]
    pub fn pairs_of_iteration(&self, architecture: &Architecture, all: usize) -> usize {
        match self {
            Self::LevenbergMarquardt(options) => options.pairs(architecture, all),
            Self::Lbfgs(_) | Self::Adam(_) => all,
        }
    }

    fn check(&self) -> Result<(), Error> {
        match self {
            Self::Lbfgs(options) => options.check(),
            Self::LevenbergMarquardt(options) => options.check(),
            Self::Adam(options) => options.check(),
        }
    }
}

/// The criterion by which a training is at rest and ends.
///
/// After each full window of iterations the lowest held-out error so far (the lowest loss, without
/// held-out pairs) is compared with the lowest one before the window. Training ends if it has
/// fallen by less than `improvement`. While Levenberg–Marquardt uses a part of the pairs, the
/// comparison is over two windows, and there is none if that part grew within them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plateau {
    /// The number of iterations of a window.
    pub iterations: u64,
    /// The share by which the error has to fall in a window, 0 to 1.
    pub improvement: f64,
}

impl Plateau {
    /// The window of [`Plateau::default`], in iterations.
    pub const ITERATIONS: u64 = 50;

    /// Windows of this many iterations and an improvement of a tenth in each; None for 0.
    pub fn of_windows(iterations: u64) -> Option<Self> {
        (iterations > 0).then(|| Self { iterations, ..Self::default() })
    }

    fn check(self) -> Result<(), Error> {
        at_least_one("training.plateau.iterations", self.iterations)?;
        Error::check_range("training.plateau.improvement", self.improvement, 0.0, 1.0)
    }
}

impl Default for Plateau {
    /// A tenth in 50 iterations.
    fn default() -> Self {
        Self { iterations: Self::ITERATIONS, improvement: 0.1 }
    }
}

/// How a network is trained on pairs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainingOptions {
    /// The loss that is minimised.
    pub loss: Loss,
    /// The factor of a penalty that is added to the loss: the mean square of I_ε(z) − z over all
    /// components of the training inputs; of a nearly-integrable map, of χ∘K_ε∘χ⁻¹(z) − z.
    pub near_identity_penalty: f64,
    /// Whether the angles θ of the circles stay at their initial values.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub theta_fixed: bool,
    /// The factor of a penalty that is added to the loss: Σ (θ − θ⁰)² over the circles, θ⁰ being
    /// the initial angle; in a schedule, that at the start of each stage.
    #[serde(skip_serializing_if = "is_zero")]
    pub theta_penalty: f64,
    /// The optimiser that minimises the loss.
    pub optimiser: Optimiser,
    /// The largest number of iterations; for Adam, of epochs.
    pub iterations: u64,
    /// Iterations between evaluations of the held-out pairs.
    pub validate_every: u64,
    /// Stop when the held-out error is at most this (the loss, without
    /// held-out pairs); 0 never stops.
    pub target: f64,
    /// Stop when the held-out error has not improved for this many evaluations of it; 0 never
    /// stops.
    pub patience: u64,
    /// Stop when the error is at rest. None: never. In a [schedule](super::train_schedule) it
    /// applies to the last stage only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plateau: Option<Plateau>,
    /// Stop when the largest entry of the gradient is at most this.
    pub gradient_tolerance: f64,
    /// The number of iterations between two checkpoints.
    pub checkpoint_every: u64,
    /// Several sets of initial weights, of which the best is trained further: see
    /// [`train_schedule`](super::train_schedule). None, and a count of 1: one set. A scene on pairs of a file that does
    /// not say has as many as [`Fit`](super::Fit).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub starts: Option<Starts>,
    /// Problems with other flow times or ε that are trained first, one after another. The weights
    /// of each start the next one, and those of the last start the training proper.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub ramp: Vec<RampStage>,
    /// For a normal form: after the ramp, its twists are trained alone, in the coordinates of the
    /// chart that the ramp has found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fresh_twists: Option<FreshTwists>,
}

/// The plain recipe: a mean squared error, L-BFGS, one set of initial weights, all iterations. Scenes have it, but for
/// loss and optimiser of those on pairs of a file. What is
/// recommended for your own pairs is `Fit::default().training`.
impl Default for TrainingOptions {
    fn default() -> Self {
        Self {
            loss: Loss::MeanSquaredError,
            near_identity_penalty: 0.0,
            theta_fixed: false,
            theta_penalty: 0.0,
            optimiser: Optimiser::default(),
            iterations: 1000,
            validate_every: 10,
            target: 0.0,
            patience: 0,
            plateau: None,
            gradient_tolerance: 0.0,
            checkpoint_every: 100,
            starts: None,
            ramp: Vec::new(),
            fresh_twists: None,
        }
    }
}

/// Options that are not in use are not written, so that what was trained without them stays what
/// it was.
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl TrainingOptions {
    /// The options that decide the weights after each iteration: all but when training stops and how often it saves,
    /// which may change when a training goes on.
    pub(crate) fn without_ends(self) -> Self {
        Self { iterations: 0, checkpoint_every: 1, target: 0.0, patience: 0, plateau: None, ..self }
    }

    /// Fails unless the options fit a network of this architecture.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the option and its value.
    pub fn check_for(&self, architecture: &Architecture) -> Result<(), Error> {
        let has = |part: Part| architecture.part(part).next().is_some();
        let has_near_identity = architecture.has_circle() && has(Part::NearIdentity);
        let is_perturbed = architecture.structure() == Structure::NearlyIntegrable
            && architecture.reversor.is_none();
        if self.near_identity_penalty > 0.0 && !has_near_identity && !is_perturbed {
            let (name, found) = ("training.near_identity_penalty", self.near_identity_penalty);
            let expected = match architecture.reversor {
                None => "0: only a gyroceptron has I_ε, and only a nearly-integrable map K_ε",
                Some(_) => "0 of a map with a reversor, in which K_ε stands on both sides",
            };
            return Err(Error::invalid(name, found, expected));
        }
        if !architecture.has_circle() {
            let expected = ": only a gyroceptron has an angle θ";
            if self.theta_fixed {
                let expected = format!("false{expected}");
                return Err(Error::invalid("training.theta_fixed", true, &expected));
            }
            if self.theta_penalty > 0.0 {
                let (name, expected) = ("training.theta_penalty", format!("0{expected}"));
                return Err(Error::invalid(name, self.theta_penalty, &expected));
            }
        }
        if let Some(stage) = self.ramp.iter().find(|stage| stage.repeats.unwrap_or(1) > 1)
            && has(Part::SlowMap)
            && !architecture.keeps_actions()
        {
            let (name, found) = ("training.ramp.repeats", stage.repeats.unwrap_or(1));
            return Err(Error::invalid(name, found, "none: powers of a perturbed map are others"));
        }
        if let Some(fresh) = self.fresh_twists.filter(|_| !has(Part::SlowMap)) {
            return Err(not_a_normal_form(fresh.count));
        }
        if architecture.controls.is_some() {
            let expected = "none with controls, which twists alone do not have";
            let repeats = self.ramp.iter().map(RampStage::times).find(|times| *times > 1);
            if let Some(repeats) = repeats {
                return Err(Error::invalid("training.ramp.repeats", repeats, expected));
            }
            if let Some(fresh) = self.fresh_twists {
                return Err(Error::invalid("training.fresh_twists", fresh.count, expected));
            }
        }
        RampStage::check_degrees(&self.ramp, architecture)?;
        RampStage::check_repeats(&self.ramp, architecture)
    }

    /// Fails unless every option is in its range.
    ///
    /// # Errors
    /// [`Error::CountOutOfRange`], [`Error::OutOfRange`] and [`Error::Invalid`] with the option
    /// and its value.
    pub fn check(&self) -> Result<(), Error> {
        at_least_one("training.validate_every", self.validate_every)?;
        at_least_one("training.checkpoint_every", self.checkpoint_every)?;
        for (name, value) in [
            ("training.near_identity_penalty", self.near_identity_penalty),
            ("training.theta_penalty", self.theta_penalty),
            ("training.target", self.target),
            ("training.gradient_tolerance", self.gradient_tolerance),
        ] {
            Error::check_range(name, value, 0.0, f64::MAX)?;
        }
        if self.theta_fixed && self.theta_penalty > 0.0 {
            let expected = "0 where theta is fixed, and so cannot move";
            return Err(Error::invalid("training.theta_penalty", self.theta_penalty, expected));
        }
        self.plateau.map_or(Ok(()), Plateau::check)?;
        self.starts.map_or(Ok(()), Starts::check)?;
        self.ramp.iter().try_for_each(|stage| stage.check())?;
        self.fresh_twists.map_or(Ok(()), FreshTwists::check)?;
        if let Some(fresh) = self.fresh_twists.filter(|_| self.ramp.is_empty()) {
            let expected = "none without a ramp, whose chart they are trained in";
            return Err(Error::invalid("training.fresh_twists", fresh.count, expected));
        }
        self.optimiser.check()
    }

    /// The sets of initial weights that are tried, if there are several.
    pub(super) fn several_starts(&self) -> Option<Starts> {
        self.starts.filter(|starts| starts.count > 1)
    }

    /// Fails if the options ask for several stages.
    pub(crate) fn check_single(&self) -> Result<(), Error> {
        let expected = "none: several stages are trained by `train_schedule`";
        if let Some(starts) = self.several_starts() {
            return Err(Error::invalid("training.starts", starts.count, expected));
        }
        match self.ramp.len() {
            0 => Ok(()),
            stages => Err(Error::invalid("training.ramp", stages, expected)),
        }
    }

    /// The options of a single stage.
    pub(super) fn of_stage(&self, iterations: u64) -> Self {
        Self { iterations, starts: None, ramp: Vec::new(), fresh_twists: None, ..self.clone() }
    }
}
