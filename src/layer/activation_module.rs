//! The activation module of SympNets.

use super::ElementaryMap;
use crate::phase::Half;
use crate::scalar::{Over, Scalar};
use serde::{Deserialize, Serialize};

/// A scalar function between the modules of a SympNet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Activation {
    /// 1/(1 + e^{−x}) = ½(1 + tanh(x/2)).
    Sigmoid,
    /// The hyperbolic tangent, tanh x.
    Tanh,
    /// sech² x, the derivative of tanh.
    Sech2,
}

impl Activation {
    /// All activations of SympNets in this crate.
    pub const ALL: [Self; 3] = [Self::Sigmoid, Self::Tanh, Self::Sech2];

    /// The activation and its derivative, (σ(x), σ′(x)).
    #[inline(always)]
    pub fn value_and_slope<S: Scalar>(self, x: S) -> (S, S) {
        let (half, one) = (S::from_f64(0.5), S::from_f64(1.0));
        let (t, s) = if self == Self::Sigmoid { x * half } else { x }.tanh_sech2();
        match self {
            Self::Sigmoid => (half * (one + t), S::from_f64(0.25) * s),
            Self::Tanh => (t, s),
            Self::Sech2 => (s, S::from_f64(-2.0) * t * s),
        }
    }
}

/// target += c·a ⊙ σ(source), where target is one half of the coordinates and source
/// the other: the kick of the potential Σ aᵢ∫σ.
///
/// Its parameters are a (n); without parameters a = 1.
///
/// Source: activation modules of Jin, Zhang, Zhu, Tang and Karniadakis,
/// <https://doi.org/10.1016/j.neunet.2020.08.017>, section 3.1.
#[derive(Clone, Copy, Debug)]
pub struct ActivationModule<'a, P> {
    /// The degrees of freedom n.
    pub dof: usize,
    /// The activation σ of the module.
    pub activation: Activation,
    /// The factors a of the activation, one for each degree of freedom; empty where all are 1.
    pub factors: &'a [P],
    /// The factor c of the shear.
    pub scale: P,
    /// The half that the shear changes.
    pub target: Half,
}

impl<P: Scalar> ActivationModule<'_, P> {
    #[inline(always)]
    fn factor(&self, i: usize) -> P {
        if self.factors.is_empty() { P::from_f64(1.0) } else { self.factors[i] }
    }

    /// One coordinate after the other, calling `keep(i, σ, σ′)` for each.
    #[inline(always)]
    fn run<S: Over<P>>(&self, z: &mut [S], mut keep: impl FnMut(usize, S, S)) {
        // 0·∞ is not 0.
        if self.scale.is_zero() {
            return;
        }
        let (source, target) = self.target.split(self.dof, z);
        for i in 0..self.dof {
            let (value, slope) = self.activation.value_and_slope(source[i]);
            keep(i, value, slope);
            target[i] = target[i].increment(self.scale, value.times(self.factor(i)));
        }
    }
}

impl<P: Scalar> ElementaryMap<P> for ActivationModule<'_, P> {
    #[inline(always)]
    fn dof(&self) -> usize {
        self.dof
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        Self { scale: -self.scale, ..self }
    }

    #[inline(always)]
    fn tape_len(&self) -> usize {
        2 * self.dof
    }

    #[inline(always)]
    fn activation_count(&self) -> usize {
        self.dof
    }

    #[inline(always)]
    fn apply<S: Over<P>>(&self, z: &mut [S], _: &mut [S]) {
        self.run(z, |_, _, _| {});
    }

    #[inline(always)]
    fn forward_recorded<S: Over<P>>(&self, z: &mut [S], tape: &mut [S], _: &mut [S]) {
        self.run(z, |i, value, slope| (tape[2 * i], tape[2 * i + 1]) = (value, slope));
    }

    #[inline(always)]
    fn vjp<S: Over<P>>(&self, tape: &[S], z_bar: &mut [S], factors_bar: &mut [S], _: &mut [S]) {
        if self.scale.is_zero() {
            return;
        }
        let (source_bar, target_bar) = self.target.split_mut(self.dof, z_bar);
        for i in 0..self.dof {
            let (value, slope) = (tape[2 * i], tape[2 * i + 1]);
            let u = target_bar[i].times(self.scale);
            if let Some(factor_bar) = factors_bar.get_mut(i) {
                *factor_bar = u.mul_add(value, *factor_bar);
            }
            source_bar[i] = slope.times(self.factor(i)).mul_add(u, source_bar[i]);
        }
    }

    #[inline(always)]
    fn jvp<S: Over<P>>(&self, z: &mut [S], directions: &mut [S], scratch: &mut [S]) {
        let n = self.dof;
        let slopes = &mut scratch[..n];
        slopes.fill(S::zero());
        self.run(z, |i, _, slope| slopes[i] = slope.times(self.factor(i)).times(self.scale));
        for direction in directions.chunks_exact_mut(2 * n) {
            let (source, target) = self.target.split(n, direction);
            for i in 0..n {
                target[i] = slopes[i].mul_add(source[i], target[i]);
            }
        }
    }
}
