//! The Hénon map, and the Hénon layer as four kicks.

use super::{Kick, NeuronPotential, Potential};
use crate::phase::{Half, Map};
use crate::scalar::{Over, Scalar};

/// The parameters of a layer of `width` neurons in `dof` degrees of freedom:
/// h(n + 2) + n.
///
/// Saturates instead of overflowing: no architecture of that size passes its
/// check.
pub const fn layer_parameter_count(dof: usize, width: usize) -> usize {
    width.saturating_mul(dof.saturating_add(2)).saturating_add(dof)
}

/// The Hénon map H\[V, η\](x, y) = (y + η, −x + ε∇V(y)), in its literal form.
///
/// With ε = 1 it is the paper's H\[V, η\], otherwise its near-identity
/// H_ε\[V, η\]. Four of them make a [`HenonLayer`], which computes the same map
/// with smaller rounding errors; use this one for the map itself.
///
/// Source: Burby, Tang and Maulik, <https://doi.org/10.1088/1361-6587/abcbaa>, after Hénon,
/// <https://doi.org/10.1007/BF01608556>.
#[derive(Clone, Copy, Debug)]
pub struct HenonMap<'a, P, V = NeuronPotential<'a, P>> {
    /// The potential V of y.
    pub potential: V,
    /// The translation η of x, n numbers.
    pub eta: &'a [P],
    /// The factor ε of the potential.
    pub epsilon: P,
}

impl<P: Scalar, S: Over<P>, V: Potential<S>> Map<S> for HenonMap<'_, P, V> {
    fn dof(&self) -> usize {
        self.potential.dof()
    }

    fn forward(&self, z: &mut [S]) {
        let n = self.potential.dof();
        let mut gradient = vec![S::zero(); n];
        if !self.epsilon.is_zero() {
            self.potential.gradient(&z[n..], &mut gradient);
        }
        for i in 0..n {
            let (x, y) = (z[i], z[n + i]);
            z[i] = y.increment(P::from_f64(1.0), S::embed(self.eta[i]));
            z[n + i] = (-x).increment(self.epsilon, gradient[i]);
        }
    }

    /// H⁻¹(x, y) = (ε∇V(x − η) − y, x − η).
    fn inverse(&self, z: &mut [S]) {
        let n = self.potential.dof();
        let mut gradient = vec![S::zero(); n];
        let minus_one = P::from_f64(-1.0);
        let shifted: Vec<S> =
            (0..n).map(|i| z[i].increment(minus_one, S::embed(self.eta[i]))).collect();
        if !self.epsilon.is_zero() {
            self.potential.gradient(&shifted, &mut gradient);
        }
        for i in 0..n {
            z[i] = (-z[n + i]).increment(self.epsilon, gradient[i]);
            z[n + i] = shifted[i];
        }
    }
}

/// How one of the four kicks of a layer reads its source and what it changes.
#[derive(Clone, Copy, Debug)]
pub struct KickForm {
    /// The half of the coordinates that the shear changes.
    pub target: Half,
    /// Whether the increment is subtracted.
    pub negative: bool,
    /// Whether the potential is taken at the negated source.
    pub reflect: bool,
    /// η is subtracted from the source.
    pub shifted: bool,
}

impl KickForm {
    /// The layer H\[V, η\]⁴ written out and regrouped, with g = ε∇V:
    ///
    /// a = x − g(y), b = y − g(−a), x′ = a + g(−b − η), y′ = b + g(x′ − η).
    ///
    /// η occurs only inside arguments, so that a large η costs no digits of the
    /// coordinates, and for g = 0 the layer is the identity.
    pub const LAYER: [KickForm; 4] = [
        KickForm { target: Half::Position, negative: true, reflect: false, shifted: false },
        KickForm { target: Half::Momentum, negative: true, reflect: true, shifted: false },
        KickForm { target: Half::Position, negative: false, reflect: true, shifted: true },
        KickForm { target: Half::Momentum, negative: false, reflect: false, shifted: true },
    ];

    /// The kick of this form on a layer's potential and shift.
    #[inline(always)]
    pub fn kick<'a, P: Scalar, V>(self, potential: V, eta: &'a [P], epsilon: P) -> Kick<'a, P, V> {
        Kick {
            potential,
            scale: if self.negative { -epsilon } else { epsilon },
            reflect: self.reflect,
            shift: self.shifted.then_some(eta),
            target: self.target,
        }
    }
}

/// A Hénon layer L\[V, η\] = H\[V, η\]⁴, or near the identity H_ε\[V, η\]⁴.
///
/// It is symplectic and invertible for all weights, and bitwise the identity
/// for ε = 0 and ε = −0.
///
/// Source: Burby, Tang and Maulik, <https://doi.org/10.1088/1361-6587/abcbaa>; for the approximation
/// of every symplectic map by such layers, Turaev, <https://doi.org/10.1088/0951-7715/16/1/308>.
#[derive(Clone, Copy, Debug)]
pub struct HenonLayer<'a, P, V = NeuronPotential<'a, P>> {
    /// The potential V of y.
    pub potential: V,
    /// The translation η of x, n numbers.
    pub eta: &'a [P],
    /// The factor ε of the shears; 1 for the plain layer.
    pub epsilon: P,
}

impl<'a, P: Scalar> HenonLayer<'a, P> {
    /// A view of the flat parameters
    /// `[W (n × h, row by row), b (h), w (h), η (n)]`.
    ///
    /// # Panics
    /// When `parameters` does not hold `layer_parameter_count(dof, width)`
    /// numbers.
    pub fn new(dof: usize, width: usize, epsilon: P, parameters: &'a [P]) -> Self {
        let (potential, eta) = parameters.split_at(width * (dof + 2));
        assert!(eta.len() == dof);
        Self { potential: NeuronPotential::new(dof, width, potential), eta, epsilon }
    }
}

impl<'a, P: Scalar, V: Copy> HenonLayer<'a, P, V> {
    /// The four kicks, in the order of application.
    pub fn kicks(&self) -> [Kick<'a, P, V>; 4] {
        KickForm::LAYER.map(|form| form.kick(self.potential, self.eta, self.epsilon))
    }

    /// The single map whose fourth iterate this layer is.
    pub fn map(&self) -> HenonMap<'a, P, V> {
        HenonMap { potential: self.potential, eta: self.eta, epsilon: self.epsilon }
    }
}

impl<P: Scalar, S: Over<P>, V: Potential<S> + Copy> Map<S> for HenonLayer<'_, P, V> {
    fn dof(&self) -> usize {
        self.potential.dof()
    }

    fn forward(&self, z: &mut [S]) {
        let mut scratch = vec![S::zero(); z.len()];
        for kick in self.kicks() {
            kick.apply(z, &mut scratch);
        }
    }

    fn inverse(&self, z: &mut [S]) {
        let mut scratch = vec![S::zero(); z.len()];
        for kick in self.kicks().into_iter().rev() {
            kick.inverse().apply(z, &mut scratch);
        }
    }
}
