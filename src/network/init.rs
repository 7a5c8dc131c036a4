//! Initial weights.

use super::{NormalFormShape, SympNetShape};
use crate::layer::{coupling_parameter_count, form_len};
use crate::random::Stream;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// How weights are drawn before training.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum InitialWeights {
    /// Glorot's uniform law, ±√(6/(fan-in + fan-out)), for W and w; the bounds
    /// of W for b and η too. Of SympNets, ±√(3/n) for all. Quadratic forms of twists are
    /// normal, of about the size of their neurons' second derivatives. Of couplings, a tenth
    /// of the law for A, B, a and β, so that a random ψ is not far from a rotation.
    ///
    /// With b = η = 0 the potential would be odd and the layer's generator
    /// −[V(y) + V(−y−η) + V(−x) + V(x−η)] zero: I_ε would differ from the
    /// identity in second order only.
    Glorot,
    /// Normal with standard deviation `scale` for all of W, b, w and η, and for all
    /// parameters of SympNets; `scale`³√h for the quadratic forms of twists of h neurons.
    Normal {
        /// The standard deviation.
        scale: f64,
    },
}

impl InitialWeights {
    /// The parameters of a SympNet.
    pub(super) fn modules(self, shape: &SympNetShape, stream: &mut Stream) -> Vec<f64> {
        let bound = (3.0 / shape.dof as f64).sqrt();
        let draw = |_| match self {
            Self::Glorot => stream.uniform(-bound, bound),
            Self::Normal { scale } => scale * stream.normal(),
        };
        (0..shape.parameter_count()).map(draw).collect()
    }

    /// The parameters of one layer, in the layout of the
    /// [network module](super).
    pub fn layer(self, dof: usize, width: usize, stream: &mut Stream) -> Vec<f64> {
        let mut out = self.potential(dof, width, stream);
        let bound = inner_bound(dof, width);
        out.extend((0..dof).map(|_| match self {
            Self::Glorot => stream.uniform(-bound, bound),
            Self::Normal { scale } => scale * stream.normal(),
        }));
        out
    }

    /// W, b and w of a potential of so many arguments.
    fn potential(self, arguments: usize, width: usize, stream: &mut Stream) -> Vec<f64> {
        let inner = inner_bound(arguments, width);
        let outer = outer_bound(width);
        let draw = |index| match self {
            Self::Glorot if index < (arguments + 1) * width => stream.uniform(-inner, inner),
            Self::Glorot => stream.uniform(-outer, outer),
            Self::Normal { scale } => scale * stream.normal(),
        };
        (0..(arguments + 2) * width).map(draw).collect()
    }

    /// The parameters of turned kicks and twists, without those of ψ before and the
    /// angles of the circles behind. The planes of a kick are turned by uniform angles, so that
    /// it sees all directions of phase space.
    pub(super) fn normal_form(self, shape: &NormalFormShape, stream: &mut Stream) -> Vec<f64> {
        let mut out = Vec::new();
        for &width in &shape.kicks {
            out.extend(self.turned_kick(shape.dof(), width, stream));
        }
        let d = shape.arguments();
        for (number, &width) in shape.twists.iter().enumerate() {
            out.extend(self.potential(d, width, stream));
            let curvature = self.curvature(d, width);
            out.extend((0..form_len(number, d)).map(|_| curvature * stream.normal()));
        }
        for &width in shape.perturbation.iter().flatten() {
            out.extend(self.turned_kick(shape.dof(), width, stream));
        }
        out
    }

    /// A coupling in turned coordinates, its angles uniform, so that all directions of phase space are
    /// seen.
    pub(super) fn turned_coupling(self, dof: usize, width: usize, stream: &mut Stream) -> Vec<f64> {
        let mut out: Vec<f64> = (0..dof).map(|_| stream.uniform(-PI, PI)).collect();
        let inner = inner_bound(dof, width);
        let outer = 0.1 * (6.0 / (width + dof) as f64).sqrt();
        let neurons = (dof + 1) * width;
        let draw = |index| match self {
            Self::Glorot if index < neurons => stream.uniform(-inner, inner),
            Self::Glorot => stream.uniform(-outer, outer),
            Self::Normal { scale } => scale * stream.normal(),
        };
        out.extend((0..coupling_parameter_count(dof, width)).map(draw));
        out
    }

    fn turned_kick(self, dof: usize, width: usize, stream: &mut Stream) -> Vec<f64> {
        let mut out: Vec<f64> = (0..dof).map(|_| stream.uniform(-PI, PI)).collect();
        out.extend(self.potential(dof, width, stream));
        out
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
fn inner_bound(arguments: usize, width: usize) -> f64 {
    (6.0 / (arguments + width) as f64).sqrt()
}

/// Of Glorot's law for w.
fn outer_bound(width: usize) -> f64 {
    (6.0 / (width + 1) as f64).sqrt()
}
