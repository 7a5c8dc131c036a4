//! The symplectic gyroceptron.

use super::composition::Composition;
use super::{HenonNet, HenonShape};
use crate::error::Error;
use crate::layer::{CircleAction, HenonLayer};
use crate::phase::{Direction, Map};
use crate::scalar::{Over, Real, Scalar};
use serde::{Deserialize, Serialize};

/// The shape of a symplectic gyroceptron.
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
    /// n.
    pub fn dof(&self) -> usize {
        self.circle_action.dof()
    }

    /// The shape of ψ.
    pub fn psi_shape(&self) -> HenonShape {
        HenonShape { dof: self.dof(), widths: self.psi.clone() }
    }

    /// The shape of I_ε.
    pub fn near_identity_shape(&self) -> HenonShape {
        HenonShape { dof: self.dof(), widths: self.near_identity.clone() }
    }

    /// The index of θ among the parameters.
    pub fn theta(&self) -> usize {
        self.psi_shape()
            .parameter_count()
            .saturating_add(self.near_identity_shape().parameter_count())
    }

    /// The number of parameters, θ included.
    pub fn parameter_count(&self) -> usize {
        self.theta().saturating_add(1)
    }
}

/// P_ε = I_ε ∘ ψ ∘ Φ_θ ∘ ψ⁻¹, ψ a HénonNet and I_ε a near-identity HénonNet.
///
/// For all weights it is symplectic, invertible in closed form, and nearly
/// periodic: P₀ = ψ∘Φ_θ∘ψ⁻¹ is a circle action. Where θ is not resonant it
/// owns an adiabatic invariant, μ₀ = 𝔍₀∘ψ⁻¹ to leading order
/// ([`Gyroceptron::adiabatic_invariant`]).
///
/// Source: definition of the symplectic gyroceptron in Duruisseaux, Burby and
/// Tang, <https://doi.org/10.1038/s41598-023-34862-w>.
#[derive(Clone, Debug)]
pub struct Gyroceptron<P> {
    shape: GyroceptronShape,
    composition: Composition<P>,
}

impl<P: Real> Gyroceptron<P> {
    /// The gyroceptron of this shape at ε with these parameters: ψ, I_ε, θ.
    ///
    /// # Errors
    /// When `parameters` is not of the length that `shape` asks for, or there is
    /// no degree of freedom.
    pub fn new(shape: GyroceptronShape, epsilon: P, parameters: Vec<P>) -> Result<Self, Error> {
        Error::check_count_range("degrees of freedom", shape.dof(), 1, usize::MAX)?;
        Error::check_count("parameters", shape.parameter_count(), parameters.len())?;
        let theta = shape.theta();
        let mut composition = Composition::new(shape.dof(), parameters, epsilon);
        conjugate(&mut composition, &shape, theta);
        let near_identity = shape.near_identity_shape();
        let offset = shape.psi_shape().parameter_count();
        let weights = composition.parameters()[offset..theta].to_vec();
        let near_identity = near_identity.composition(weights, epsilon, true);
        composition.push_all(&near_identity, offset, Direction::Forward);
        Ok(Self { shape, composition })
    }

    /// ψ⁻¹∘I_ε∘ψ∘Φ_θ, the map in the coordinates w = ψ⁻¹z, where its invariant 𝔍₀ costs
    /// nothing.
    pub fn in_conjugated_coordinates(&self) -> Composition<P> {
        let (shape, theta, epsilon) = (&self.shape, self.shape.theta(), self.epsilon());
        let parameters = self.composition.parameters();
        let mut out = Composition::new(shape.dof(), parameters.to_vec(), epsilon);
        let offset = shape.psi_shape().parameter_count();
        let psi = shape.psi_shape().composition(parameters[..offset].to_vec(), epsilon, false);
        let near_identity = shape.near_identity_shape();
        let near_identity =
            near_identity.composition(parameters[offset..theta].to_vec(), epsilon, true);
        out.push_turn(&shape.circle_action.clone().into(), theta..theta + 1);
        out.push_all(&psi, 0, Direction::Forward);
        out.push_all(&near_identity, offset, Direction::Forward);
        out.push_all(&psi, 0, Direction::Inverse);
        out
    }

    /// The conjugated circle action ψ∘Φ_θ∘ψ⁻¹ at another angle.
    pub fn conjugated_circle_action(&self, theta: P) -> Composition<P> {
        let psi = self.shape.psi_shape().parameter_count();
        let mut parameters = self.composition.parameters()[..psi].to_vec();
        parameters.push(theta);
        let mut out = Composition::new(self.shape.dof(), parameters, self.epsilon());
        conjugate(&mut out, &self.shape, psi);
        out
    }
}

/// Appends ψ∘Φ_θ∘ψ⁻¹, ψ being of the first parameters and θ of this index.
fn conjugate<P: Real>(out: &mut Composition<P>, shape: &GyroceptronShape, theta: usize) {
    let psi = shape.psi_shape();
    let weights = out.parameters()[..psi.parameter_count()].to_vec();
    let psi = psi.composition(weights, out.epsilon(), false);
    out.push_all(&psi, 0, Direction::Inverse);
    out.push_turn(&shape.circle_action.clone().into(), theta..theta + 1);
    out.push_all(&psi, 0, Direction::Forward);
}

impl<P: Scalar> Gyroceptron<P> {
    /// θ, in radians.
    pub fn theta(&self) -> P {
        self.composition.parameters()[self.shape.theta()]
    }

    /// Circle action and widths.
    pub fn shape(&self) -> &GyroceptronShape {
        &self.shape
    }

    /// The steps and parameters.
    pub fn composition(&self) -> &Composition<P> {
        &self.composition
    }

    /// ε.
    pub fn epsilon(&self) -> P {
        self.composition.epsilon()
    }

    /// This network at another ε.
    pub fn with_epsilon(&self, epsilon: P) -> Self {
        Self { composition: self.composition.with_epsilon(epsilon), shape: self.shape.clone() }
    }

    /// ψ.
    pub fn psi(&self) -> HenonNet<P> {
        let shape = self.shape.psi_shape();
        let parameters = self.composition.parameters()[..shape.parameter_count()].to_vec();
        HenonNet::new(shape, parameters).expect("the count is that of the shape")
    }

    /// I_ε.
    pub fn near_identity(&self) -> HenonNet<P> {
        let shape = self.shape.near_identity_shape();
        let start = self.shape.psi_shape().parameter_count();
        let parameters =
            self.composition.parameters()[start..start + shape.parameter_count()].to_vec();
        HenonNet::near_identity(shape, self.epsilon(), parameters)
            .expect("the count is that of the shape")
    }

    /// The layers of ψ, then those of I_ε, each in the order of application.
    pub fn layers(&self) -> impl DoubleEndedIterator<Item = HenonLayer<'_, P>> {
        let parameters = self.composition.parameters();
        let psi = self.shape.psi_shape();
        let near_identity = &parameters[psi.parameter_count()..];
        psi.layers(P::from_f64(1.0), parameters)
            .chain(self.shape.near_identity_shape().layers(self.epsilon(), near_identity))
    }

    /// μ₀ = 𝔍₀∘ψ⁻¹ at each of the points of `z` (2n numbers each).
    pub fn adiabatic_invariant<S: Over<P>>(&self, z: &[S]) -> Vec<S> {
        let psi = self.psi();
        let points = z.chunks_exact(2 * self.shape.dof());
        points.map(|z| self.shape.circle_action.conjugated_invariant(&psi, z)).collect()
    }
}

impl Gyroceptron<f64> {
    /// This network over another number type.
    pub fn lift<P: Real>(&self) -> Gyroceptron<P> {
        let parameters = self.composition.parameters().iter().map(|&v| P::from_f64(v)).collect();
        Gyroceptron::new(self.shape.clone(), P::from_f64(self.epsilon()), parameters)
            .expect("the count is that of the shape")
    }
}

impl<P: Scalar, S: Over<P>> Map<S> for Gyroceptron<P> {
    map_of_composition!(S);
}
