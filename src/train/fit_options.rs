//! What a caller asks of a fit, over what is recommended, the paper's recipe or a scene.

use super::{Fit, Loss, Optimiser, Plateau, RampStage, Starts};
use crate::error::Error;
use crate::layer::Reversor;
use crate::network::{Block, LayerSizes, NetworkSpec};

/// The network and the training that a fit has where its options say nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Recipe {
    /// The recommended network and training: [`Fit::default`].
    #[default]
    Recommended,
    /// The recipe of the paper: [`Fit::paper`].
    Paper,
    /// Those of a fit that a scene declares.
    Declared(Box<Fit>),
}

impl Recipe {
    /// The names of the recipes that no scene declares.
    pub const NAMES: [&str; 2] = ["recommended", "paper"];

    /// The recipe of this name.
    ///
    /// # Errors
    /// [`Error::Invalid`] for any other name.
    pub fn named(name: &str) -> Result<Self, Error> {
        match name {
            "recommended" => Ok(Self::Recommended),
            "paper" => Ok(Self::Paper),
            _ => Err(Error::invalid("recipe", name, Self::NAMES.join(" or "))),
        }
    }

    /// The fit, with its network and training, that the recipe stands for.
    pub fn fit(self) -> Fit {
        match self {
            Self::Recommended => Fit::default(),
            Self::Paper => Fit::paper(),
            Self::Declared(fit) => *fit,
        }
    }
}

/// Choices of a network and of its training, which come before those of a [`Recipe`]. What is None, empty or false
/// leaves the recipe's.
///
/// ```
/// use gyroceptron::train::{FitOptions, Optimiser, Recipe};
///
/// let options = FitOptions {
///     architecture: Some("henon-net".into()),
///     optimiser: Some(Optimiser::named("lm")?),
///     ..FitOptions::default()
/// };
/// let fit = options.apply_to(Recipe::Paper)?;
/// assert!(fit.training.plateau.is_some());
/// # Ok::<(), gyroceptron::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitOptions {
    /// The name of an architecture, with its default sizes.
    pub architecture: Option<String>,
    /// A network as a list of blocks, in place of an architecture with a name.
    pub blocks: Option<Vec<Block>>,
    /// Sizes of parts of the network, by their keys, such as `kicks`. Without an architecture they choose one that has
    /// all these parts.
    pub sizes: Vec<(&'static str, LayerSizes)>,
    /// ρ of the box of polynomials, in units of the network: coordinates are from −ρ to ρ.
    pub radius: Option<f64>,
    /// The reflection by which the network is reversible.
    pub reversor: Option<Reversor>,
    /// The optimiser of the training. Unless a scene says otherwise, Levenberg–Marquardt comes with its usual plateau
    /// and the others with none.
    pub optimiser: Option<Optimiser>,
    /// The largest number of iterations, at least 1. Each of several starts takes [`Starts::TRIAL`] of its own first,
    /// whatever this number is.
    pub iterations: Option<u64>,
    /// Sets of initial weights of which the best is trained further, at least 1.
    pub starts: Option<u64>,
    /// The window of the [`Plateau`], in iterations; 0 for none.
    pub plateau: Option<u64>,
    /// Stages before the training proper.
    pub ramp: Option<Vec<RampStage>>,
    /// The loss that the training minimises.
    pub loss: Option<Loss>,
    /// The factor of the near-identity penalty.
    pub near_identity_penalty: Option<f64>,
    /// Whether the angles of the circles stay at their initial values.
    pub theta_fixed: bool,
    /// The factor of the penalty on changes of the angles.
    pub theta_penalty: Option<f64>,
    /// Evaluations of the held-out error without improvement after which training ends; 0 for never.
    pub patience: Option<u64>,
    /// The held-out error at which training ends.
    pub target: Option<f64>,
}

impl FitOptions {
    /// A fit of the recipe with these options.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the key of the option.
    pub fn apply_to(self, recipe: Recipe) -> Result<Fit, Error> {
        let is_declared = matches!(recipe, Recipe::Declared(_));
        let base = recipe.fit();
        let network = self.network(base.network.clone())?;
        let mut training = base.training.clone();
        if let Some(optimiser) = self.optimiser {
            let at_rest = || optimiser.comes_to_rest().then(Plateau::default);
            // That of a scene stays; that of a recipe is one of its optimiser.
            training.plateau = match is_declared {
                true => training.plateau.or_else(at_rest),
                false => at_rest(),
            };
            training.optimiser = optimiser;
        }
        if let Some(window) = self.plateau {
            training.plateau = Plateau::of_windows(window);
        }
        for (key, count) in [("iterations", self.iterations), ("starts", self.starts)] {
            if count == Some(0) {
                return Err(Error::invalid(key, 0, "at least 1"));
            }
        }
        training.iterations = self.iterations.unwrap_or(training.iterations);
        if let Some(count) = self.starts {
            // Whatever the iterations are: more of them may be asked for later.
            training.starts = (count > 1).then_some(Starts { count, iterations: Starts::TRIAL });
        }
        training.ramp = self.ramp.unwrap_or(training.ramp);
        training.loss = self.loss.unwrap_or(training.loss);
        let penalty = self.near_identity_penalty;
        training.near_identity_penalty = penalty.unwrap_or(training.near_identity_penalty);
        training.theta_fixed |= self.theta_fixed;
        training.theta_penalty = self.theta_penalty.unwrap_or(training.theta_penalty);
        training.patience = self.patience.unwrap_or(training.patience);
        training.target = self.target.unwrap_or(training.target);
        Ok(Fit { network, training, ..base })
    }

    /// The network that is asked for, or that of the recipe; None where it is chosen by the pairs.
    fn network(&self, before: Option<NetworkSpec>) -> Result<Option<NetworkSpec>, Error> {
        let keys: Vec<&str> = self.sizes.iter().map(|(key, _)| *key).collect();
        let has_parts = self.radius.is_some() || self.reversor.is_some();
        let network = match (&self.blocks, &self.architecture, before) {
            (Some(_), Some(name), _) => {
                return Err(Error::invalid("architecture", name, "none beside blocks"));
            }
            (Some(blocks), ..) if blocks.is_empty() => {
                return Err(Error::invalid("blocks", "none", "at least one"));
            }
            (Some(blocks), ..) => NetworkSpec::of_blocks(blocks.clone()),
            (None, Some(name), _) => NetworkSpec::named(name)?,
            (None, None, Some(network)) => network,
            (None, None, None) if keys.is_empty() && !has_parts => return Ok(None),
            (None, None, None) if keys.is_empty() => NetworkSpec::named("normal-form")?,
            (None, None, None) => NetworkSpec::with_parts(&keys)?,
        };
        if network.is_of_file() {
            return Err(Error::invalid("network", "that of a file", "one to train"));
        }
        let with = |network: NetworkSpec, &(key, size): &(&str, _)| network.with_size(key, size);
        let network = self.sizes.iter().try_fold(network, with)?;
        let network = match self.reversor {
            Some(of) => network.reversible(of)?,
            None => network,
        };
        self.radius.map_or(Ok(network.clone()), |radius| network.with_radius(radius)).map(Some)
    }
}
