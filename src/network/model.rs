//! A network in double precision with its architecture: what files hold.

use super::batch::{Rollout, map_points, map_points_at_pace, rollout_at_pace};
use super::{
    Composition, CouplingGyroceptron, CouplingGyroceptronShape, Gyroceptron, GyroceptronShape,
    HenonNet, HenonShape, InitialWeights, NormalForm, NormalFormShape, Pace, SympNet, SympNetShape,
};
use crate::error::Error;
use crate::layer::CircleAction;
use crate::phase::{Direction, Map};
use crate::random::Stream;
use crate::scalar::Over;
use serde::{Deserialize, Serialize};

/// More is a mistake in a file: 8 GB of weights.
const MOST_PARAMETERS: usize = 1_000_000_000;
/// The largest |m| of a circle action: mθ keeps its digits.
const LARGEST_WEIGHT: u32 = 1_000_000;

/// Which network, without its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Architecture {
    /// A HénonNet; near the identity unless ε = 1.
    HenonNet {
        /// Degrees of freedom and widths.
        #[serde(flatten)]
        shape: HenonShape,
        /// ε.
        epsilon: f64,
    },
    /// A symplectic gyroceptron.
    Gyroceptron {
        /// Circle action and widths.
        #[serde(flatten)]
        shape: GyroceptronShape,
        /// ε.
        epsilon: f64,
    },
    /// A gyroceptron in normal form.
    NormalForm {
        /// Action, widths and flow time.
        #[serde(flatten)]
        shape: NormalFormShape,
        /// ε.
        epsilon: f64,
    },
    /// A gyroceptron of affine couplings: not symplectic.
    CouplingGyroceptron {
        /// Circle action and widths.
        #[serde(flatten)]
        shape: CouplingGyroceptronShape,
        /// ε.
        epsilon: f64,
    },
    /// An LA-SympNet.
    SympNet {
        /// Modules, shears and activation.
        #[serde(flatten)]
        shape: SympNetShape,
    },
}

impl Architecture {
    /// n.
    pub fn dof(&self) -> usize {
        match self {
            Self::HenonNet { shape, .. } => shape.dof,
            Self::Gyroceptron { shape, .. } => shape.dof(),
            Self::NormalForm { shape, .. } => shape.dof(),
            Self::CouplingGyroceptron { shape, .. } => shape.dof(),
            Self::SympNet { shape } => shape.dof,
        }
    }

    /// ε; 1 of networks without it.
    pub fn epsilon(&self) -> f64 {
        match self {
            Self::HenonNet { epsilon, .. }
            | Self::Gyroceptron { epsilon, .. }
            | Self::NormalForm { epsilon, .. }
            | Self::CouplingGyroceptron { epsilon, .. } => *epsilon,
            Self::SympNet { .. } => 1.0,
        }
    }

    /// The number of parameters.
    pub fn parameter_count(&self) -> usize {
        match self {
            Self::HenonNet { shape, .. } => shape.parameter_count(),
            Self::Gyroceptron { shape, .. } => shape.parameter_count(),
            Self::NormalForm { shape, .. } => shape.parameter_count(),
            Self::CouplingGyroceptron { shape, .. } => shape.parameter_count(),
            Self::SympNet { shape } => shape.parameter_count(),
        }
    }

    /// The HénonNets of the architecture with the tensor prefix of each.
    pub fn parts(&self) -> Vec<(&'static str, HenonShape)> {
        match self {
            Self::HenonNet { shape, .. } => vec![("henon", shape.clone())],
            Self::Gyroceptron { shape, .. } => {
                vec![("psi", shape.psi_shape()), ("near_identity", shape.near_identity_shape())]
            }
            Self::NormalForm { shape, .. } => vec![("psi", shape.psi_shape())],
            Self::SympNet { .. } | Self::CouplingGyroceptron { .. } => Vec::new(),
        }
    }

    /// The tensors of the parameters by the names that files give them, with their
    /// shapes, in the order of the parameters.
    pub fn tensors(&self) -> Vec<(String, [usize; 2])> {
        let mut out = Vec::new();
        for (part, HenonShape { dof, widths }) in self.parts() {
            for (layer, &width) in widths.iter().enumerate() {
                let name = |tensor: &str| format!("{part}.{layer}.{tensor}");
                out.extend([
                    (name("w_in"), [dof, width]),
                    (name("b_in"), [1, width]),
                    (name("w_out"), [width, 1]),
                    (name("eta"), [1, dof]),
                ]);
            }
        }
        match self {
            Self::HenonNet { .. } => {}
            Self::Gyroceptron { .. } => out.push(("theta".into(), [1, 1])),
            Self::NormalForm { shape, .. } => out.extend(shape.tensors()),
            Self::SympNet { shape } => out.extend(shape.tensors()),
            Self::CouplingGyroceptron { shape, .. } => out.extend(shape.tensors()),
        }
        out
    }

    /// The circle actions that the network is built on, one for each of its angles θ.
    pub fn circles(&self) -> &[CircleAction] {
        match self {
            Self::HenonNet { .. } | Self::SympNet { .. } => &[],
            Self::Gyroceptron { shape, .. } => std::slice::from_ref(&shape.circle_action),
            Self::NormalForm { shape, .. } => shape.action.circles(),
            Self::CouplingGyroceptron { shape, .. } => std::slice::from_ref(&shape.circle_action),
        }
    }

    /// Whether maps of the architecture are symplectic, whatever their weights.
    pub fn is_symplectic(&self) -> bool {
        !matches!(self, Self::CouplingGyroceptron { .. })
    }

    /// Fails unless ε is finite, there is a degree of freedom, and no layer is
    /// without parameters.
    ///
    /// # Errors
    /// [`Error::OutOfRange`], [`Error::CountOutOfRange`] and [`Error::Invalid`] with the
    /// value.
    pub fn check(&self) -> Result<(), Error> {
        Error::check_finite("epsilon", self.epsilon())?;
        Error::check_count_range("degrees of freedom", self.dof(), 1, usize::MAX)?;
        let count = self.parameter_count();
        Error::check_count_range("parameters of the architecture", count, 0, MOST_PARAMETERS)?;
        for (part, shape) in self.parts() {
            if shape.widths.contains(&0) {
                return Err(Error::invalid(part, "a layer of width 0", "at least one neuron"));
            }
        }
        if let Self::SympNet { shape } = self {
            Error::check_count_range("linear modules", shape.modules, 1, usize::MAX)?;
            Error::check_count_range("shears of a linear module", shape.shears, 1, usize::MAX)?;
        }
        match self {
            Self::NormalForm { shape, .. } => shape.check()?,
            Self::CouplingGyroceptron { shape, .. } => shape.check()?,
            Self::HenonNet { .. } | Self::Gyroceptron { .. } | Self::SympNet { .. } => {}
        }
        for circle in self.circles() {
            let too_large = |weight: &&i32| weight.unsigned_abs() > LARGEST_WEIGHT;
            if let Some(weight) = circle.weights().iter().find(too_large) {
                let expected = format!("weights of at most {LARGEST_WEIGHT}");
                return Err(Error::invalid("circle action", weight, expected));
            }
            if circle.weights().iter().all(|weight| *weight == 0) {
                let expected = "at least one weight other than 0";
                return Err(Error::invalid("circle action", "all weights 0", expected));
            }
        }
        Ok(())
    }

    /// A model with seeded random weights and all θ = `theta` (the frequency times
    /// the flow time, in training).
    ///
    /// # Errors
    /// Those of [`Architecture::check`].
    pub fn initialise(
        &self,
        weights: InitialWeights,
        theta: f64,
        seed: u64,
    ) -> Result<Model, Error> {
        self.check()?;
        let mut parameters = Vec::with_capacity(self.parameter_count());
        for (part, shape) in self.parts() {
            let mut stream = Stream::new(seed, &format!("weights/{part}"));
            for &width in &shape.widths {
                parameters.extend(weights.layer(shape.dof, width, &mut stream));
            }
        }
        match self {
            Self::HenonNet { .. } => {}
            Self::Gyroceptron { .. } => parameters.push(theta),
            Self::NormalForm { shape, .. } => {
                let mut stream = Stream::new(seed, "weights/normal-form");
                parameters.extend(weights.normal_form(shape, &mut stream));
                parameters.extend(shape.action.circles().iter().map(|_| theta));
            }
            Self::SympNet { shape } => {
                let mut stream = Stream::new(seed, "weights/symp-net");
                parameters.extend(weights.modules(shape, &mut stream));
            }
            Self::CouplingGyroceptron { shape, .. } => {
                for (part, widths) in shape.parts() {
                    let mut stream = Stream::new(seed, &format!("weights/couplings/{part}"));
                    for &width in widths {
                        parameters.extend(weights.turned_coupling(shape.dof(), width, &mut stream));
                    }
                }
                parameters.push(theta);
            }
        }
        Model::new(self.clone(), parameters)
    }
}

/// A function of a point that a network keeps or nearly keeps.
pub type Invariant<'a> = Box<dyn Fn(&[f64]) -> f64 + Send + Sync + 'a>;

/// A network in double precision.
#[derive(Clone, Debug)]
pub enum Model {
    /// A HénonNet.
    HenonNet(HenonNet<f64>),
    /// A symplectic gyroceptron.
    Gyroceptron(Gyroceptron<f64>),
    /// A gyroceptron in normal form.
    NormalForm(NormalForm<f64>),
    /// A gyroceptron of affine couplings.
    CouplingGyroceptron(CouplingGyroceptron<f64>),
    /// An LA-SympNet.
    SympNet(SympNet<f64>),
}

impl Model {
    /// The network of this architecture with these parameters.
    ///
    /// # Errors
    /// When the count is wrong, a number is not finite, or the architecture
    /// does not pass [`Architecture::check`].
    pub fn new(architecture: Architecture, parameters: Vec<f64>) -> Result<Self, Error> {
        architecture.check()?;
        if let Some(index) = parameters.iter().position(|v| !v.is_finite()) {
            Error::check_finite(&format!("parameter {index}"), parameters[index])?;
        }
        Ok(match architecture {
            Architecture::HenonNet { shape, epsilon } => {
                Self::HenonNet(HenonNet::near_identity(shape, epsilon, parameters)?)
            }
            Architecture::Gyroceptron { shape, epsilon } => {
                Self::Gyroceptron(Gyroceptron::new(shape, epsilon, parameters)?)
            }
            Architecture::NormalForm { shape, epsilon } => {
                Self::NormalForm(NormalForm::new(shape, epsilon, parameters)?)
            }
            Architecture::CouplingGyroceptron { shape, epsilon } => {
                Self::CouplingGyroceptron(CouplingGyroceptron::new(shape, epsilon, parameters)?)
            }
            Architecture::SympNet { shape } => Self::SympNet(SympNet::new(shape, parameters)?),
        })
    }

    /// Its architecture.
    pub fn architecture(&self) -> Architecture {
        match self {
            Self::HenonNet(net) => Architecture::HenonNet {
                shape: net.shape().clone(),
                epsilon: net.composition().epsilon(),
            },
            Self::Gyroceptron(net) => {
                Architecture::Gyroceptron { shape: net.shape().clone(), epsilon: net.epsilon() }
            }
            Self::NormalForm(net) => {
                Architecture::NormalForm { shape: net.shape().clone(), epsilon: net.epsilon() }
            }
            Self::CouplingGyroceptron(net) => Architecture::CouplingGyroceptron {
                shape: net.shape().clone(),
                epsilon: net.epsilon(),
            },
            Self::SympNet(net) => Architecture::SympNet { shape: net.shape().clone() },
        }
    }

    /// Its steps and parameters.
    pub fn composition(&self) -> &Composition<f64> {
        match self {
            Self::HenonNet(net) => net.composition(),
            Self::Gyroceptron(net) => net.composition(),
            Self::NormalForm(net) => net.composition(),
            Self::CouplingGyroceptron(net) => net.composition(),
            Self::SympNet(net) => net.composition(),
        }
    }

    /// A model of this architecture with other parameters.
    ///
    /// # Errors
    /// Those of [`Model::new`].
    pub fn with_parameters(&self, parameters: Vec<f64>) -> Result<Self, Error> {
        Self::new(self.architecture(), parameters)
    }

    /// A model of this architecture with other angles of its circles.
    ///
    /// # Errors
    /// When it is built on circles and there are more or fewer angles; those of [`Model::new`].
    pub fn with_angles(&self, angles: &[f64]) -> Result<Self, Error> {
        let mut parameters = self.composition().parameters().to_vec();
        let own = &mut parameters[self.composition().angles()];
        if !own.is_empty() {
            Error::check_count("angles", own.len(), angles.len())?;
            own.copy_from_slice(angles);
        }
        self.with_parameters(parameters)
    }

    /// This network at another ε and at `time` times its flow time: the angles of its
    /// circles and the factor h of a normal form or of couplings grow with it. HénonNets and SympNets are
    /// of no family, and stay what they are.
    ///
    /// # Errors
    /// Those of [`Model::new`].
    pub fn at(&self, epsilon: f64, time: f64) -> Result<Self, Error> {
        let mut architecture = self.architecture();
        match &mut architecture {
            Architecture::HenonNet { .. } | Architecture::SympNet { .. } => {}
            Architecture::Gyroceptron { epsilon: own, .. } => *own = epsilon,
            Architecture::CouplingGyroceptron { epsilon: own, shape } => {
                *own = epsilon;
                shape.flow_time *= time;
            }
            Architecture::NormalForm { epsilon: own, shape } => {
                *own = epsilon;
                shape.flow_time *= time;
            }
        }
        Self::new(architecture, self.composition().parameters_at(time))
    }

    /// This network with the weights of another one of its shape, whose angles are taken
    /// `time` times: those of a flow map of another time as a start for this one's.
    ///
    /// # Errors
    /// When it has more or fewer parameters; those of [`Model::new`].
    pub fn with_weights_of(&self, other: &Self, time: f64) -> Result<Self, Error> {
        self.with_parameters(other.composition().parameters_at(time))
    }

    /// Φ_θ∘T_ε of a normal form, as one whose chart is the identity; of any other network,
    /// itself.
    ///
    /// # Errors
    /// Those of [`Model::new`].
    pub(crate) fn without_chart(&self) -> Result<Self, Error> {
        let Some(network) = self.normal_form() else { return Ok(self.clone()) };
        let parameters = network.inner_parameters().to_vec();
        let shape = network.shape().without_chart();
        Self::new(Architecture::NormalForm { shape, epsilon: network.epsilon() }, parameters)
    }

    /// This normal form with T_ε and the angles of another one, whose chart may differ; any
    /// other network stays what it is.
    ///
    /// # Errors
    /// When they have more or fewer parameters; those of [`Model::new`].
    pub(crate) fn with_twists_of(&self, other: &Self) -> Result<Self, Error> {
        let (Some(own), Some(other)) = (self.normal_form(), other.normal_form()) else {
            return Ok(self.clone());
        };
        let mut parameters = self.composition().parameters().to_vec();
        let (inner, others) = (own.inner_parameters().len(), other.inner_parameters());
        Error::check_count("parameters of twists and angles", inner, others.len())?;
        let chart = parameters.len() - inner;
        parameters[chart..].copy_from_slice(others);
        self.with_parameters(parameters)
    }

    /// Pᵐ of a normal form ([`NormalForm::iterated`]).
    ///
    /// # Errors
    /// Those of [`NormalForm::iterated`]; when it is another network and m is not 1.
    pub(crate) fn iterated(&self, m: usize) -> Result<Self, Error> {
        match (self, m) {
            (_, 1) => Ok(self.clone()),
            (Self::NormalForm(net), _) => net.iterated(m).map(Self::NormalForm),
            _ => Err(Error::invalid("repeats of a map", m, "1 of a network without twists")),
        }
    }

    /// A normal form with one in `parts` of its twist shears, the first ones.
    ///
    /// # Errors
    /// When they are no multiple of `parts`; when it is another network and `parts` is not 1.
    pub(crate) fn with_part_of_twists(&self, parts: usize) -> Result<Self, Error> {
        Error::check_count_range("parts", parts, 1, usize::MAX)?;
        match (self, parts) {
            (_, 1) => Ok(self.clone()),
            (Self::NormalForm(net), _) if net.shape().twists.len().is_multiple_of(parts) => {
                let count = net.shape().twists.len() / parts;
                net.with_first_twists(count).map(Self::NormalForm)
            }
            _ => Err(Error::invalid("parts", parts, "a divisor of the number of twist shears")),
        }
    }

    /// The gyroceptron, if it is one.
    pub fn gyroceptron(&self) -> Option<&Gyroceptron<f64>> {
        match self {
            Self::Gyroceptron(net) => Some(net),
            _ => None,
        }
    }

    /// The gyroceptron in normal form, if it is one.
    pub fn normal_form(&self) -> Option<&NormalForm<f64>> {
        match self {
            Self::NormalForm(net) => Some(net),
            _ => None,
        }
    }

    /// The trajectories from each of the points in `initial`, as [`rollout`](super::rollout) gives them. A
    /// gyroceptron in normal form goes to its coordinates once, makes all steps there, and comes
    /// back for each state that is kept: its actions do not move by more than the
    /// rounding of the steps between.
    ///
    /// # Errors
    /// Those of [`rollout`](super::rollout).
    pub fn rollout(&self, initial: &[f64], request: Rollout) -> Result<Vec<f64>, Error> {
        self.rollout_at_pace(initial, request, &mut Pace::unbroken())
    }

    /// [`Model::rollout`] in parts, which ask the pace whether to go on: the same bits.
    ///
    /// # Errors
    /// Those of [`Model::rollout`]; [`Error::Stopped`].
    pub fn rollout_at_pace(
        &self,
        initial: &[f64],
        request: Rollout,
        pace: &mut Pace<'_>,
    ) -> Result<Vec<f64>, Error> {
        let Self::NormalForm(net) = self else {
            return rollout_at_pace(self.composition(), initial, request, pace);
        };
        let [chart, inner] = net.chart_and_inner_map();
        let mut start = initial.to_vec();
        map_points(&chart, Direction::Inverse, &mut start)?;
        let mut states = rollout_at_pace(&inner, &start, request, pace)?;
        states[..initial.len()].copy_from_slice(initial);
        let kept = &mut states[initial.len()..];
        map_points_at_pace(&chart, Direction::Forward, kept, pace)?;
        Ok(states)
    }

    /// The invariant of the network as a function of a point: μ₀ = 𝔍₀∘ψ⁻¹ of a gyroceptron,
    /// which is adiabatic; the sum of the actions 𝔍∘χ⁻¹ of one in normal form, which is
    /// exact, but for a perturbation. None of networks that are built on no circle, or are not
    /// symplectic.
    pub fn invariant(&self) -> Option<Invariant<'_>> {
        Some(match self {
            Self::HenonNet(_) | Self::SympNet(_) | Self::CouplingGyroceptron(_) => return None,
            Self::Gyroceptron(net) => {
                let psi = net.psi();
                Box::new(move |z| net.shape().circle_action.conjugated_invariant(&psi, z))
            }
            Self::NormalForm(_) => {
                let all = self.invariants();
                Box::new(move |z| all.iter().map(|(_, invariant)| invariant(z)).sum())
            }
        })
    }

    /// The invariant of each of its circles, with the circle: of one in normal form the
    /// actions 𝔍_a∘χ⁻¹, whose sum is [`Model::invariant`].
    pub fn invariants(&self) -> Vec<(CircleAction, Invariant<'_>)> {
        match self {
            Self::HenonNet(_) | Self::SympNet(_) | Self::CouplingGyroceptron(_) => Vec::new(),
            Self::Gyroceptron(net) => {
                let circle = net.shape().circle_action.clone();
                self.invariant().map(|invariant| (circle, invariant)).into_iter().collect()
            }
            Self::NormalForm(net) => {
                let of = |circle: &CircleAction| -> (CircleAction, Invariant<'_>) {
                    let [chart, _] = net.chart_and_inner_map();
                    let own = circle.clone();
                    (circle.clone(), Box::new(move |z| own.conjugated_invariant(&chart, z)))
                };
                net.shape().action.circles().iter().map(of).collect()
            }
        }
    }

    /// The angles of its circles, in radians.
    pub fn angles(&self) -> &[f64] {
        &self.composition().parameters()[self.composition().angles()]
    }

    /// θ, where the network is built on one circle.
    pub fn angle(&self) -> Option<f64> {
        match self.angles() {
            [theta] => Some(*theta),
            _ => None,
        }
    }
}

impl<S: Over<f64>> Map<S> for Model {
    map_of_composition!(S);
}
