//! HénonNets, plain and near the identity.

use super::composition::Composition;
use super::step::{Kind, Step};
use crate::error::Error;
use crate::layer::{HenonLayer, KickForm, layer_parameter_count};
use crate::phase::Map;
use crate::scalar::{Over, Real, Scalar};
use serde::{Deserialize, Serialize};

/// The shape of a HénonNet: degrees of freedom and the width of each layer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HenonShape {
    /// n.
    pub dof: usize,
    /// The number of neurons of each layer, in the order of application.
    pub widths: Vec<usize>,
}

impl HenonShape {
    /// `layers` layers of `width` neurons each.
    pub fn uniform(dof: usize, layers: usize, width: usize) -> Self {
        Self { dof, widths: vec![width; layers] }
    }

    /// The number of parameters.
    pub fn parameter_count(&self) -> usize {
        self.widths
            .iter()
            .fold(0, |n: usize, &h| n.saturating_add(layer_parameter_count(self.dof, h)))
    }

    /// The network of this shape as a composition; its kicks are scaled by ε when
    /// `near_identity`, else by 1.
    pub(super) fn composition<P: Scalar>(
        &self,
        parameters: Vec<P>,
        epsilon: P,
        near_identity: bool,
    ) -> Composition<P> {
        let mut out = Composition::new(self.dof, parameters, epsilon);
        let mut start = 0;
        for &width in &self.widths {
            let end = start + layer_parameter_count(self.dof, width);
            for form in KickForm::LAYER {
                let kind = Kind::Kick { width, form };
                let parameters = start..end;
                out.push(Step { kind, parameters, inverse: false, near_identity });
            }
            start = end;
        }
        out
    }

    /// The layers of this shape over the first of `parameters`.
    pub(super) fn layers<'a, P: Scalar>(
        &self,
        epsilon: P,
        parameters: &'a [P],
    ) -> impl DoubleEndedIterator<Item = HenonLayer<'a, P>> + use<'a, P> {
        let mut rest = parameters;
        let views: Vec<_> = self
            .widths
            .iter()
            .map(|&width| {
                let (layer, others) = rest.split_at(layer_parameter_count(self.dof, width));
                rest = others;
                HenonLayer::new(self.dof, width, epsilon, layer)
            })
            .collect();
        views.into_iter()
    }
}

/// ℋ = L\[V_N, η_N\] ∘ … ∘ L\[V₁, η₁\], a composition of Hénon layers; with
/// ε ≠ 1 the near-identity network ℋ_ε, the identity at ε = 0.
///
/// Source: definitions of the HénonNet and of the near-identity HénonNet in
/// Duruisseaux, Burby and Tang, <https://doi.org/10.1038/s41598-023-34862-w>.
#[derive(Clone, Debug)]
pub struct HenonNet<P> {
    shape: HenonShape,
    composition: Composition<P>,
}

impl<P: Scalar> HenonNet<P> {
    /// The plain network.
    ///
    /// # Errors
    /// When `parameters` is not of the length that `shape` asks for.
    pub fn new(shape: HenonShape, parameters: Vec<P>) -> Result<Self, Error> {
        Self::near_identity(shape, P::from_f64(1.0), parameters)
    }

    /// The near-identity network at ε.
    ///
    /// # Errors
    /// Those of [`HenonNet::new`].
    pub fn near_identity(shape: HenonShape, epsilon: P, parameters: Vec<P>) -> Result<Self, Error> {
        Error::check_count_range("degrees of freedom", shape.dof, 1, usize::MAX)?;
        Error::check_count("parameters", shape.parameter_count(), parameters.len())?;
        let composition = shape.composition(parameters, epsilon, true);
        Ok(Self { shape, composition })
    }

    /// Degrees of freedom and widths.
    pub fn shape(&self) -> &HenonShape {
        &self.shape
    }

    /// The steps and parameters.
    pub fn composition(&self) -> &Composition<P> {
        &self.composition
    }

    /// The layers, in the order of application.
    pub fn layers(&self) -> impl DoubleEndedIterator<Item = HenonLayer<'_, P>> {
        self.shape.layers(self.composition.epsilon(), self.composition.parameters())
    }
}

impl HenonNet<f64> {
    /// This network over another number type.
    pub fn lift<P: Real>(&self) -> HenonNet<P> {
        let parameters = self.composition.parameters().iter().map(|&v| P::from_f64(v)).collect();
        HenonNet::near_identity(
            self.shape.clone(),
            P::from_f64(self.composition.epsilon()),
            parameters,
        )
        .expect("the count is that of the shape")
    }
}

impl<P: Scalar, S: Over<P>> Map<S> for HenonNet<P> {
    map_of_composition!(S);
}
