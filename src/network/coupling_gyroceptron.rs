//! The gyroceptron of affine couplings: nearly periodic, and not symplectic.

use super::composition::Composition;
use crate::error::Error;
use crate::layer::{CircleAction, coupling_parameter_count};
use crate::phase::{Direction, Map};
use crate::scalar::{Over, Real, Scalar};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The shape of a gyroceptron of couplings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CouplingGyroceptronShape {
    /// Φ_θ; its length is half the dimension of phase space.
    pub circle_action: CircleAction,
    /// The widths of ψ's couplings.
    pub psi: Vec<usize>,
    /// The widths of I_ε's couplings.
    pub near_identity: Vec<usize>,
    /// h, the time of the flow map that it stands for: the couplings of I_ε are scaled by εh, which is
    /// how far the slow motion gets, so that weights of order one do whatever ε is.
    pub flow_time: f64,
}

impl CouplingGyroceptronShape {
    /// n.
    pub fn dof(&self) -> usize {
        self.circle_action.dof()
    }

    /// The number of parameters of a coupling of this width, its angles included.
    fn coupling_len(&self, width: usize) -> usize {
        self.dof().saturating_add(coupling_parameter_count(self.dof(), width))
    }

    /// The parts, by the names that tensors have.
    pub(super) fn parts(&self) -> [(&'static str, &[usize]); 2] {
        [("psi", &self.psi), ("near_identity", &self.near_identity)]
    }

    /// Fails unless no coupling is without neurons, and h is finite and not 0.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the part or the time.
    pub(super) fn check(&self) -> Result<(), Error> {
        Error::check_finite("flow_time", self.flow_time)?;
        if self.flow_time == 0.0 {
            return Err(Error::invalid(
                "flow_time",
                0,
                "another number: I_ε would be the identity",
            ));
        }
        match self.parts().into_iter().find(|(_, widths)| widths.contains(&0)) {
            Some((part, _)) => {
                Err(Error::invalid(part, "a coupling of width 0", "at least one neuron"))
            }
            None => Ok(()),
        }
    }

    fn len_of(&self, widths: &[usize]) -> usize {
        widths.iter().fold(0, |n: usize, &h| n.saturating_add(self.coupling_len(h)))
    }

    /// The index of the first parameter of I_ε.
    fn near_identity_start(&self) -> usize {
        self.len_of(&self.psi)
    }

    /// The index of θ among the parameters.
    pub fn theta(&self) -> usize {
        self.near_identity_start().saturating_add(self.len_of(&self.near_identity))
    }

    /// The number of parameters, θ included.
    pub fn parameter_count(&self) -> usize {
        self.theta().saturating_add(1)
    }

    /// The tensors of the parameters, with their shapes, in the order of the parameters: of each
    /// coupling `psi.{i}.angles` (1, n), `psi.{i}.w_in` (n, h), `psi.{i}.b_in` (1, h),
    /// `psi.{i}.w_scale` (n, h), `psi.{i}.b_scale` (1, n), `psi.{i}.w_shift` (n, h),
    /// `psi.{i}.b_shift` (1, n), the same under `near_identity.{i}.`, and `theta`.
    pub fn tensors(&self) -> Vec<(String, [usize; 2])> {
        let n = self.dof();
        let mut out = Vec::new();
        for (part, widths) in self.parts() {
            for (layer, &h) in widths.iter().enumerate() {
                let name = |tensor: &str| format!("{part}.{layer}.{tensor}");
                out.extend([
                    (name("angles"), [1, n]),
                    (name("w_in"), [n, h]),
                    (name("b_in"), [1, h]),
                    (name("w_scale"), [n, h]),
                    (name("b_scale"), [1, n]),
                    (name("w_shift"), [n, h]),
                    (name("b_shift"), [1, n]),
                ]);
            }
        }
        out.push(("theta".into(), [1, 1]));
        out
    }
}

/// P_ε = I_ε ∘ ψ ∘ Φ_θ ∘ ψ⁻¹, ψ and I_ε compositions of [affine
/// couplings](crate::layer::AffineCoupling) in turned coordinates, those of I_ε scaled by εh.
///
/// For all weights it is invertible in closed form and nearly periodic: P₀ = ψ∘Φ_θ∘ψ⁻¹ is a circle
/// action, so that where θ is not resonant it has a formal circle symmetry to all orders in ε, its
/// roto-rate. It is not symplectic, and there is no adiabatic invariant that this symmetry would give it:
/// 𝔍₀∘ψ⁻¹ may change by O(ε) with each step, as under friction.
///
/// Source: gyroceptrons, before the symplectic ones, of Duruisseaux, Burby and Tang,
/// <https://doi.org/10.1038/s41598-023-34862-w>, section "Approximating Nearly-Periodic Maps via
/// Gyroceptrons"; the roto-rate of nearly-periodic maps is theirs after Burby, Hirvijoki and Leok,
/// <https://doi.org/10.1007/s00332-023-09891-4>.
#[derive(Clone, Debug)]
pub struct CouplingGyroceptron<P> {
    shape: CouplingGyroceptronShape,
    composition: Composition<P>,
}

/// Couplings of these widths over parameters from `start` on.
fn couplings<P: Real>(
    shape: &CouplingGyroceptronShape,
    widths: &[usize],
    start: usize,
    parameters: &[P],
    near_identity: Option<P>,
) -> Composition<P> {
    let epsilon = near_identity.unwrap_or(P::from_f64(1.0));
    let mut out = Composition::new(shape.dof(), parameters.to_vec(), epsilon);
    let mut end = start;
    for &width in widths {
        let first = end;
        end += shape.coupling_len(width);
        let factor = near_identity.map(|_| shape.flow_time);
        out.push_turned_coupling(width, first..end, factor);
    }
    out
}

impl<P: Real> CouplingGyroceptron<P> {
    /// The gyroceptron of this shape at ε with these parameters: ψ, I_ε, θ.
    ///
    /// # Errors
    /// When `parameters` is not of the length that `shape` asks for, there is no degree of freedom, a
    /// coupling has no neurons, or h is not finite or 0.
    pub fn new(
        shape: CouplingGyroceptronShape,
        epsilon: P,
        parameters: Vec<P>,
    ) -> Result<Self, Error> {
        shape.check()?;
        Error::check_count_range("degrees of freedom", shape.dof(), 1, usize::MAX)?;
        Error::check_count("parameters", shape.parameter_count(), parameters.len())?;
        let theta = shape.theta();
        let start = shape.near_identity_start();
        let near_identity =
            couplings(&shape, &shape.near_identity, start, &parameters, Some(epsilon));
        let mut composition = Composition::new(shape.dof(), parameters, epsilon);
        conjugate(&mut composition, &shape, theta..theta + 1);
        composition.push_all(&near_identity, 0, Direction::Forward);
        Ok(Self { shape, composition })
    }

    /// The conjugated circle action ψ∘Φ_θ∘ψ⁻¹ at another angle.
    pub fn conjugated_circle_action(&self, theta: P) -> Composition<P> {
        let index = self.shape.theta();
        let mut parameters = self.composition.parameters().to_vec();
        parameters[index] = theta;
        let mut out = Composition::new(self.shape.dof(), parameters, self.epsilon());
        conjugate(&mut out, &self.shape, index..index + 1);
        out
    }

    /// ψ.
    pub fn psi(&self) -> Composition<P> {
        couplings(&self.shape, &self.shape.psi, 0, self.composition.parameters(), None)
    }

    /// I_ε.
    pub fn near_identity(&self) -> Composition<P> {
        let start = self.shape.near_identity_start();
        let parameters = self.composition.parameters();
        couplings(&self.shape, &self.shape.near_identity, start, parameters, Some(self.epsilon()))
    }
}

/// Appends ψ∘Φ_θ∘ψ⁻¹, θ being of this index.
fn conjugate<P: Real>(
    out: &mut Composition<P>,
    shape: &CouplingGyroceptronShape,
    theta: Range<usize>,
) {
    let psi = couplings(shape, &shape.psi, 0, out.parameters(), None);
    out.push_all(&psi, 0, Direction::Inverse);
    out.push_turn(&shape.circle_action.clone().into(), theta);
    out.push_all(&psi, 0, Direction::Forward);
}

impl<P: Scalar> CouplingGyroceptron<P> {
    /// θ, in radians.
    pub fn theta(&self) -> P {
        self.composition.parameters()[self.shape.theta()]
    }

    /// Circle action and widths.
    pub fn shape(&self) -> &CouplingGyroceptronShape {
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
}

impl CouplingGyroceptron<f64> {
    /// This network over another number type.
    pub fn lift<P: Real>(&self) -> CouplingGyroceptron<P> {
        let parameters = self.composition.parameters().iter().map(|&v| P::from_f64(v)).collect();
        CouplingGyroceptron::new(self.shape.clone(), P::from_f64(self.epsilon()), parameters)
            .expect("the count is that of the shape")
    }
}

impl<P: Scalar, S: Over<P>> Map<S> for CouplingGyroceptron<P> {
    map_of_composition!(S);
}
