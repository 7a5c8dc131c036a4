//! Initial weights.

use crate::random::Stream;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// How weights are drawn before training.
///
/// Source: Glorot and Bengio, <https://proceedings.mlr.press/v9/glorot10a.html>, for the uniform
/// law.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum InitialWeights {
    /// Glorot's uniform law, ±√(6/(fan-in + fan-out)), for W and w, with the bounds
    /// of W for b and η too. In SympNets, all parameters are in ±√(3/n). Quadratic forms of twists
    /// are normal, of about the size of their neurons' second derivatives. In couplings, A, B, a and
    /// β have a tenth of the bound, so that a random ψ is not far from a rotation.
    ///
    /// With b = η = 0 the potential would be odd and the layer's generator
    /// −[V(y) + V(−y−η) + V(−x) + V(x−η)] zero: I_ε would differ from the
    /// identity only at second order.
    Glorot,
    /// Normal with standard deviation `scale` for all of W, b, w and η, and for all
    /// parameters of SympNets; `scale`³√h for the quadratic forms of twists of h neurons. Directions of polynomials are
    /// uniform, and their coefficients have the deviation `scale`/√degree.
    Normal {
        /// The standard deviation of the normal law.
        scale: f64,
    },
}

/// What the numbers of a tensor are drawn from.
#[derive(Clone, Copy, Debug)]
pub(super) enum Law {
    /// An angle of a plane, uniform over the circle, so that all directions of phase space are
    /// seen.
    Angle,
    /// A weight: within this bound after Glorot.
    Uniform(f64),
    /// A direction of a polynomial of so many arguments, which takes the box into [−1, 1].
    Direction { arguments: usize },
    /// A coefficient of the derivative of a polynomial of this degree: 0 after Glorot, whose law is for
    /// training.
    Coefficient { degree: usize },
    /// A quadratic form beside so many neurons of so many arguments.
    Curvature { arguments: usize, width: usize },
}

impl InitialWeights {
    /// A number of this law.
    pub(super) fn draw(self, law: Law, stream: &mut Stream) -> f64 {
        match (law, self) {
            (Law::Angle, _) => stream.uniform(-PI, PI),
            (Law::Uniform(bound), Self::Glorot) => stream.uniform(-bound, bound),
            (Law::Uniform(_), Self::Normal { scale }) => scale * stream.normal(),
            (Law::Direction { arguments }, _) => {
                let bound = 1.0 / arguments as f64;
                stream.uniform(-bound, bound)
            }
            (Law::Coefficient { .. }, Self::Glorot) => 0.0,
            (Law::Coefficient { degree }, Self::Normal { scale }) => {
                scale / (degree as f64).sqrt() * stream.normal()
            }
            (Law::Curvature { arguments, width }, _) => {
                self.curvature(arguments, width) * stream.normal()
            }
        }
    }

    /// The standard deviation of the quadratic forms beside neurons, about the size of the second
    /// derivatives of the neurons: larger ones start a twist far from the identity, where training
    /// stays. That of one neuron where there is none.
    fn curvature(self, arguments: usize, width: usize) -> f64 {
        let width = if width == 0 { 1 } else { width };
        // A uniform law's standard deviation is its bound over √3.
        let [inner, outer] = match self {
            Self::Glorot => [inner_bound(arguments, width), outer_bound(width)]
                .map(|bound| bound / 3_f64.sqrt()),
            Self::Normal { scale } => [scale; 2],
        };
        (width as f64).sqrt() * inner * inner * outer
    }
}

/// Of Glorot's law for W.
pub(super) fn inner_bound(arguments: usize, width: usize) -> f64 {
    (6.0 / (arguments as f64 + width as f64)).sqrt()
}

/// Of Glorot's law for w.
pub(super) fn outer_bound(width: usize) -> f64 {
    (6.0 / (width as f64 + 1.0)).sqrt()
}
