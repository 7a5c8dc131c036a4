//! LA-SympNets: linear and activation modules in turn.

use super::composition::Composition;
use super::step::{Kind, Step};
use crate::error::Error;
use crate::layer::{Activation, linear_module_parameter_count};
use crate::phase::{Half, Map};
use crate::scalar::{Over, Real, Scalar};
use serde::{Deserialize, Serialize};

/// The shape of an LA-SympNet: linear modules with an activation module between
/// each two of them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SympNetShape {
    /// n.
    pub dof: usize,
    /// The number of linear modules.
    pub modules: usize,
    /// The linear shears of each.
    pub shears: usize,
    /// σ of the activation modules.
    pub activation: Activation,
    /// Activation modules have no parameters, a = 1, and no translation follows the
    /// last linear module.
    #[serde(default)]
    pub plain: bool,
}

impl SympNetShape {
    /// Whether a translation ends the linear module of this number.
    fn translates(&self, module: usize) -> bool {
        !self.plain || module + 1 < self.modules
    }

    /// The number of parameters of the linear module of this number.
    fn linear_len(&self, module: usize) -> usize {
        let whole = linear_module_parameter_count(self.dof, self.shears);
        if self.translates(module) { whole } else { whole.saturating_sub(2 * self.dof) }
    }

    /// The number of parameters of an activation module.
    fn activation_len(&self) -> usize {
        if self.plain { 0 } else { self.dof }
    }

    /// The number of parameters: those of the linear modules and n for each
    /// activation module, in the order of application.
    pub fn parameter_count(&self) -> usize {
        let Some(last) = self.modules.checked_sub(1) else { return 0 };
        let whole = linear_module_parameter_count(self.dof, self.shears);
        let before = last.saturating_mul(whole.saturating_add(self.activation_len()));
        before.saturating_add(self.linear_len(last))
    }

    /// The tensors of the parameters, with their shapes, in the order of application:
    /// `linear.{i}.matrices` (shears, n(n + 1)/2), `linear.{i}.translation` (1, 2n),
    /// `activation.{i}.factors` (1, n).
    pub fn tensors(&self) -> Vec<(String, [usize; 2])> {
        let mut out = Vec::new();
        for module in 0..self.modules {
            if module > 0 && !self.plain {
                out.push((format!("activation.{}.factors", module - 1), [1, self.dof]));
            }
            let entries = linear_module_parameter_count(self.dof, 1) - 2 * self.dof;
            out.push((format!("linear.{module}.matrices"), [self.shears, entries]));
            if self.translates(module) {
                out.push((format!("linear.{module}.translation"), [1, 2 * self.dof]));
            }
        }
        out
    }
}

/// ℒ_m ∘ 𝒩_{m−1} ∘ ℒ_{m−1} ∘ … ∘ 𝒩₁ ∘ ℒ₁ with
/// [linear modules](crate::layer::LinearModule) ℒ, whose first shear changes p, and
/// [activation modules](crate::layer::ActivationModule) 𝒩, which change q and p in
/// turn.
///
/// Source: LA-SympNets of Jin, Zhang, Zhu, Tang and Karniadakis,
/// <https://doi.org/10.1016/j.neunet.2020.08.017>, section 3.1: one of the networks
/// that Duruisseaux, Burby and Tang, <https://doi.org/10.1038/s41598-023-34862-w>,
/// compare gyroceptrons with.
#[derive(Clone, Debug)]
pub struct SympNet<P> {
    shape: SympNetShape,
    composition: Composition<P>,
}

impl<P: Scalar> SympNet<P> {
    /// The network of this shape with these parameters.
    ///
    /// # Errors
    /// When `parameters` is not of the length that `shape` asks for, or there is no
    /// degree of freedom.
    pub fn new(shape: SympNetShape, parameters: Vec<P>) -> Result<Self, Error> {
        Error::check_count_range("degrees of freedom", shape.dof, 1, usize::MAX)?;
        Error::check_count("parameters", shape.parameter_count(), parameters.len())?;
        let mut composition = Composition::new(shape.dof, parameters, P::from_f64(1.0));
        let mut start = 0;
        let mut push = |kind, len| {
            let parameters = start..start + len;
            start = parameters.end;
            composition.push(Step { kind, parameters, inverse: false, near_identity: false });
        };
        for module in 0..shape.modules {
            if module > 0 {
                let target = if module % 2 == 1 { Half::Position } else { Half::Momentum };
                let activation = Kind::Activation { activation: shape.activation, target };
                push(activation, shape.activation_len());
            }
            let (first, translated) = (Half::Momentum, shape.translates(module));
            push(Kind::Linear { first, translated }, shape.linear_len(module));
        }
        Ok(Self { shape, composition })
    }

    /// Degrees of freedom, modules and activation.
    pub fn shape(&self) -> &SympNetShape {
        &self.shape
    }

    /// The steps and parameters.
    pub fn composition(&self) -> &Composition<P> {
        &self.composition
    }
}

impl SympNet<f64> {
    /// This network over another number type.
    pub fn lift<P: Real>(&self) -> SympNet<P> {
        let parameters = self.composition.parameters().iter().map(|&v| P::from_f64(v)).collect();
        SympNet::new(self.shape.clone(), parameters).expect("the count is that of the shape")
    }
}

impl<P: Scalar, S: Over<P>> Map<S> for SympNet<P> {
    map_of_composition!(S);
}
