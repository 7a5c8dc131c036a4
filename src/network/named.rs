//! The named architectures: the sizes from which each is made, and its list of blocks.

use super::architecture::Architecture;
use super::block::Block;
use super::layers::{Layers, Modules};
use super::part::{Part, Scale};
use crate::layer::{Activation, CircleAction};
use serde::{Deserialize, Serialize};

/// The shape of a HénonNet:
///
/// ℋ = L\[V_N, η_N\] ∘ … ∘ L\[V₁, η₁\], a composition of Hénon layers; with
/// ε ≠ 1 the near-identity network ℋ_ε, the identity at ε = 0.
///
/// Source: definitions of the HénonNet and of the near-identity HénonNet in
/// Duruisseaux, Burby and Tang, <https://doi.org/10.1038/s41598-023-34862-w>.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HenonShape {
    /// The degrees of freedom n.
    pub dof: usize,
    /// The number of neurons of each layer, in the order of application.
    pub widths: Vec<usize>,
}

impl HenonShape {
    /// `layers` layers of `width` neurons each.
    pub fn uniform(dof: usize, layers: usize, width: usize) -> Self {
        Self { dof, widths: vec![width; layers] }
    }

    /// The network of this shape, its kicks scaled by ε: one block, `henon`.
    pub fn architecture(&self, epsilon: f64) -> Architecture {
        let layers = Layers::Henon(self.widths.clone());
        let block = Block::new(Part::None, layers).named("henon").scaled(Scale::Epsilon);
        Architecture::new(self.dof).at_epsilon(epsilon).with(block)
    }

    /// The number of trainable parameters of this shape.
    pub fn parameter_count(&self) -> usize {
        self.architecture(1.0).parameter_count()
    }
}

/// The shape of a symplectic gyroceptron:
///
/// P_ε = I_ε ∘ ψ ∘ Φ_θ ∘ ψ⁻¹, ψ a HénonNet and I_ε a near-identity HénonNet.
///
/// For all weights it is symplectic, invertible in closed form, and nearly
/// periodic: P₀ = ψ∘Φ_θ∘ψ⁻¹ is a circle action. Where θ is not resonant it
/// has an adiabatic invariant, μ₀ = 𝔍₀∘ψ⁻¹ to leading order.
///
/// Source: definition of the symplectic gyroceptron in Duruisseaux, Burby and
/// Tang, <https://doi.org/10.1038/s41598-023-34862-w>.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GyroceptronShape {
    /// Φ_θ; its length is the number of degrees of freedom.
    pub circle_action: CircleAction,
    /// The widths of ψ's layers.
    pub psi: Vec<usize>,
    /// The widths of I_ε's layers.
    pub near_identity: Vec<usize>,
}

impl GyroceptronShape {
    /// The network of this shape at ε: blocks `psi` and `near_identity`.
    pub fn architecture(&self, epsilon: f64) -> Architecture {
        let psi = Block::new(Part::Conjugation, Layers::Henon(self.psi.clone()));
        let near = Block::new(Part::NearIdentity, Layers::Henon(self.near_identity.clone()));
        Architecture::new(self.circle_action.dof())
            .on_circle(self.circle_action.clone())
            .at_epsilon(epsilon)
            .with(psi.named("psi"))
            .with(near.named("near_identity"))
    }
}

/// The shape of a gyroceptron of turned kicks:
///
/// P_ε = I_ε ∘ ψ ∘ Φ_θ ∘ ψ⁻¹, ψ a HénonNet and I_ε of [turned kicks](crate::layer::TurnedKick).
///
/// It has all properties of a symplectic gyroceptron. To first order in ε its I_ε approximates every
/// near-identity map with weights of order one, whereas Hénon layers give only generators A(q) + B(p).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KickedGyroceptronShape {
    /// Φ_θ; its length is the number of degrees of freedom.
    pub circle_action: CircleAction,
    /// The widths of ψ's layers.
    pub psi: Vec<usize>,
    /// The widths of I_ε's turned kicks.
    pub kicks: Vec<usize>,
}

impl KickedGyroceptronShape {
    /// The network of this shape at ε: blocks `psi` and `near_identity`.
    pub fn architecture(&self, epsilon: f64) -> Architecture {
        let psi = Block::new(Part::Conjugation, Layers::Henon(self.psi.clone()));
        let near = Block::new(Part::NearIdentity, Layers::TurnedKick(self.kicks.clone()));
        Architecture::new(self.circle_action.dof())
            .on_circle(self.circle_action.clone())
            .at_epsilon(epsilon)
            .with(psi.named("psi"))
            .with(near.named("near_identity"))
    }
}

/// The shape of a gyroceptron of couplings:
///
/// P_ε = I_ε ∘ ψ ∘ Φ_θ ∘ ψ⁻¹, ψ and I_ε compositions of [affine
/// couplings](crate::layer::AffineCoupling) in turned coordinates, those of I_ε scaled by εh.
///
/// For all weights it is invertible in closed form and nearly periodic: P₀ = ψ∘Φ_θ∘ψ⁻¹ is a circle
/// action, so that where θ is not resonant it has a formal circle symmetry to all orders in ε, its
/// roto-rate. Since it is not symplectic, this symmetry yields no adiabatic invariant:
/// 𝔍₀∘ψ⁻¹ may change by O(ε) with each step, as under friction.
///
/// Source: gyroceptrons, before the symplectic ones, of Duruisseaux, Burby and Tang,
/// <https://doi.org/10.1038/s41598-023-34862-w>, section "Approximating Nearly-Periodic Maps via
/// Gyroceptrons"; the roto-rate of nearly-periodic maps is theirs after Burby, Hirvijoki and Leok,
/// <https://doi.org/10.1007/s00332-023-09891-4>.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CouplingGyroceptronShape {
    /// Φ_θ; its length is half the dimension of phase space.
    pub circle_action: CircleAction,
    /// The widths of ψ's couplings.
    pub psi: Vec<usize>,
    /// The widths of I_ε's couplings.
    pub near_identity: Vec<usize>,
    /// h, the time of the flow map that it approximates: the couplings of I_ε are scaled by εh, the size
    /// of the slow motion in a step, so that weights of order one suffice for any ε.
    pub flow_time: f64,
}

impl CouplingGyroceptronShape {
    /// The network of this shape at ε: blocks `psi` and `near_identity`.
    pub fn architecture(&self, epsilon: f64) -> Architecture {
        let psi = Block::new(Part::Conjugation, Layers::TurnedCoupling(self.psi.clone()));
        let layers = Layers::TurnedCoupling(self.near_identity.clone());
        let near = Block::new(Part::NearIdentity, layers).scaled(Scale::EpsilonTime);
        Architecture::new(self.circle_action.dof())
            .on_circle(self.circle_action.clone())
            .at_epsilon(epsilon)
            .of_time(self.flow_time)
            .with(psi.named("psi"))
            .with(near.named("near_identity"))
    }
}

/// The shape of an LA-SympNet:
///
/// ℒ_m ∘ 𝒩_{m−1} ∘ ℒ_{m−1} ∘ … ∘ 𝒩₁ ∘ ℒ₁ with
/// [linear modules](crate::layer::LinearModule) ℒ, whose first shear changes p, and
/// [activation modules](crate::layer::ActivationModule) 𝒩, which change q and p in
/// turn.
///
/// Source: LA-SympNets of Jin, Zhang, Zhu, Tang and Karniadakis,
/// <https://doi.org/10.1016/j.neunet.2020.08.017>, section 3.1: one of the networks
/// that Duruisseaux, Burby and Tang, <https://doi.org/10.1038/s41598-023-34862-w>,
/// compare gyroceptrons with.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SympNetShape {
    /// The degrees of freedom n.
    pub dof: usize,
    /// The number of linear modules.
    pub modules: usize,
    /// The number of linear shears in each linear module.
    pub shears: usize,
    /// σ of the activation modules.
    pub activation: Activation,
    /// Activation modules have no parameters, a = 1, and no translation follows the
    /// last linear module.
    #[serde(default)]
    pub plain: bool,
}

impl SympNetShape {
    /// The network of this shape: one block.
    pub fn architecture(&self) -> Architecture {
        let Self { dof, modules, shears, activation, plain } = *self;
        let layers = Layers::SympNet(Modules { modules, shears, activation, plain });
        Architecture::new(dof).with(Block::new(Part::None, layers).named(""))
    }

    /// The number of trainable parameters of this shape.
    pub fn parameter_count(&self) -> usize {
        self.architecture().parameter_count()
    }
}
