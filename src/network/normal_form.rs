//! The normal-form gyroceptron: a gyroceptron whose actions are exact invariants.
//!
//! # Why its ψ_ε is of turned kicks
//!
//! A near-identity HénonNet I_ε has ∂I_ε/∂ε = X_{G₁} at ε = 0 with
//! G₁ = A(x) + B(y), x the positions and y the momenta, however many layers it has.
//!
//! *Proof.* A layer is H⁴ with H(x, y) = (y + η, −x + ε∇V(y)). At ε = 0 the four maps send
//! (x, y) to (y + η, −x), (−x + η, −y − η), (−y, x − η) and (x, y): together they are the
//! identity, and so is each layer. The derivative in ε at 0 is then the sum of those of the four
//! kicks, each carried to the start by the maps before it, which are those just listed: the
//! generators −V(y), −V(−x), −V(−y − η) and −V(x − η), in some order, each of x alone or of
//! y alone. The derivative of a composition of layers, each the identity at ε = 0, is the
//! sum of theirs. ∎
//!
//! So a generator with ∂²G/∂x∂y ≠ 0, such as x·y or what averaging asks for, is out of reach to first
//! order: the error of a fit of exp(εX_G) is c·ε with c > 0, as large as the motion itself where ε
//! is small for the weights. At one ε the second order can make up for it,
//! ½ε²{A, B} ~ ε with weights ~ε^{−1/2}, but then I_ε is not near the identity in the
//! sense that its invariant needs, and no weights do so at several ε.
//!
//! A turned kick has the generator −V(x cos φ + y sin φ), plane by plane, V being a sum of
//! w tanh(a·(…) + b): w tanh(α·z + b) with any α in phase space, a_j and φ_j being the polar
//! coordinates of its part in plane j. Sums of these are dense in C¹ on compact sets
//! (Hornik, <https://doi.org/10.1016/0893-6080(91)90009-T>, theorem 3), so that the generators of turned
//! kicks come near any G with its vector field. One evaluation of tanh a neuron is
//! all they take, where a Hénon layer takes four.
//!
//! Measured, one set of weights fitted to exp(εX_G), G = q₁p₁ cos q₂, at
//! ε = 0.08, 0.04, 0.02 and 0.01 together: 4 Hénon layers of 8 err by 0.44, 0.27, 0.63 and
//! 0.81 of the motion, 8 of them by 0.22, 0.32, 0.24 and 0.57, and both by all of it below ε = 1e-3;
//! 12 turned kicks of 8 err by 0.002 at every ε
//! (`cargo test --release --test generators -- --nocapture`).

use super::HenonShape;
use super::composition::Composition;
use super::step::{Kind, Step};
use crate::error::Error;
use crate::layer::{FastPlanes, TorusAction, TwistShears, form_len, shear_len};
use crate::phase::{Direction, Map};
use crate::scalar::{Over, Real, Scalar};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The shape of a normal-form gyroceptron.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NormalFormShape {
    /// Φ, a circle or torus action.
    pub action: TorusAction,
    /// The widths of ψ's layers; none where the action is Φ itself to leading order.
    pub psi: Vec<usize>,
    /// The widths of the turned kicks of ψ_ε.
    pub kicks: Vec<usize>,
    /// The widths of the twist shears of T_ε. The first, the third and so on change the
    /// positions and have a quadratic form beside their neurons, of which they need few or none.
    pub twists: Vec<usize>,
    /// h, the flow time, a factor of T_ε beside ε: weights are of the same size at any.
    pub flow_time: f64,
    /// The widths of the turned kicks of K_ε, where the map is nearly integrable: χ and T are then
    /// of order one, and ε scales K_ε alone. With none of them it is integrable.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub perturbation: Option<Vec<usize>>,
}

/// More repetitions of a twist are a slip of the pen.
pub(crate) const MOST_REPEATS: usize = 100_000;

impl NormalFormShape {
    /// n.
    pub fn dof(&self) -> usize {
        self.action.dof()
    }

    /// The shape of ψ.
    pub fn psi_shape(&self) -> HenonShape {
        HenonShape { dof: self.dof(), widths: self.psi.clone() }
    }

    /// h(n + 2) + n: the angles and the potential of a turned kick of width h.
    fn kick_len(&self, width: usize) -> usize {
        width.saturating_mul(self.dof().saturating_add(2)).saturating_add(self.dof())
    }

    /// d, the numbers that a twist shear's function is of: the actions and half the slow
    /// coordinates.
    pub fn arguments(&self) -> usize {
        let circles = self.action.circles();
        let is_slow = |j: &usize| circles.iter().all(|circle| circle.weights()[*j] == 0);
        circles.len() + (0..self.dof()).filter(is_slow).count()
    }

    fn twist_len(&self) -> usize {
        let of = |(number, &width)| shear_len(number, width, self.arguments());
        self.twists.iter().enumerate().map(of).fold(0, usize::saturating_add)
    }

    fn perturbation_len(&self) -> usize {
        let widths = self.perturbation.iter().flatten();
        widths.map(|&width| self.kick_len(width)).fold(0, usize::saturating_add)
    }

    /// Whether the actions are invariants at any ε: whether there is no K_ε.
    pub fn is_integrable(&self) -> bool {
        self.perturbation.iter().flatten().next().is_none()
    }

    /// The number of parameters of the chart, which come first.
    fn chart_len(&self) -> usize {
        let kicks = self.kicks.iter().map(|&width| self.kick_len(width));
        kicks.fold(self.psi_shape().parameter_count(), usize::saturating_add)
    }

    /// The shape with the identity for a chart.
    pub(super) fn without_chart(&self) -> Self {
        Self { psi: Vec::new(), kicks: Vec::new(), ..self.clone() }
    }

    /// The index of the first angle of the circles among the parameters.
    pub fn theta(&self) -> usize {
        self.chart_len().saturating_add(self.twist_len()).saturating_add(self.perturbation_len())
    }

    /// The number of parameters: those of ψ, of the turned kicks, of the twist shears, of K_ε,
    /// and an angle for each circle.
    pub fn parameter_count(&self) -> usize {
        self.theta().saturating_add(self.action.circles().len())
    }

    /// The tensors of turned kicks and twists by the names that files give them, with
    /// their shapes, in the order of the parameters.
    pub(super) fn tensors(&self) -> Vec<(String, [usize; 2])> {
        let (dof, arguments, mut out) = (self.dof(), self.arguments(), Vec::new());
        let potential = |name: &str, arguments: usize, width: usize| {
            [
                (format!("{name}.w_in"), [arguments, width]),
                (format!("{name}.b_in"), [1, width]),
                (format!("{name}.w_out"), [width, 1]),
            ]
        };
        let kick = |name: String, width: usize| {
            let angles = [(format!("{name}.angles"), [1, dof])];
            angles.into_iter().chain(potential(&name, dof, width))
        };
        for (number, &width) in self.kicks.iter().enumerate() {
            out.extend(kick(format!("kick.{number}"), width));
        }
        for (number, &width) in self.twists.iter().enumerate() {
            out.extend(potential(&format!("twist.{number}"), arguments, width));
            let form = form_len(number, arguments);
            if form > 0 {
                out.push((format!("twist.{number}.quadratic"), [1, form]));
            }
        }
        for (number, &width) in self.perturbation.iter().flatten().enumerate() {
            out.extend(kick(format!("perturbation.{number}"), width));
        }
        out.push(("theta".into(), [1, self.action.circles().len()]));
        out
    }

    /// Fails unless the action is one that [`FastPlanes`] are of, the flow time is
    /// finite, and no part is of width 0, but for twist shears with a quadratic form.
    ///
    /// # Errors
    /// With the value.
    pub fn check(&self) -> Result<(), Error> {
        // A table of all planes is kept for each kick.
        const MOST_PLANES: usize = 1000;
        FastPlanes::new(&self.action)?;
        Error::check_count_range("planes of a normal form", self.dof(), 1, MOST_PLANES)?;
        Error::check_finite("flow_time", self.flow_time)?;
        let of = |(number, &width)| shear_len(number, width, self.arguments());
        let mut kicks = self.kicks.iter().chain(self.perturbation.iter().flatten());
        if kicks.any(|width| *width == 0)
            || self.twists.iter().enumerate().map(of).any(|len| len == 0)
        {
            let expected = "at least one neuron";
            return Err(Error::invalid("normal form", "a layer of width 0", expected));
        }
        Ok(())
    }
}

/// P = χ∘Φ_θ∘T_ε∘χ⁻¹, χ = ψ∘ψ_ε, with a HénonNet ψ, [turned kicks](crate::layer::TurnedKick)
/// ψ_ε scaled by ε, and a [twist](crate::layer::Twist) T_ε scaled by εh.
///
/// Or, with a [perturbation](NormalFormShape::perturbation), P = χ∘K_ε∘Φ_θ∘T∘χ⁻¹ with χ and T
/// of order one and turned kicks K_ε: any map near an integrable one, whose surfaces
/// turn at frequencies of their own, with the resonances and islands that ε opens. 𝔍∘χ⁻¹ is then
/// an invariant at ε = 0.
///
/// Without a perturbation it is a gyroceptron: near the identity times ψ∘Φ_θ∘ψ⁻¹. T_ε commutes with Φ, so that
/// P commutes with the action conjugated by χ, and 𝔍∘χ⁻¹, the actions in the coordinates
/// of the normal form, are invariants of P, exactly, for all weights and all time.
///
/// With one fast plane, or a circle for each, nearly-periodic Hamiltonian flows are such
/// maps to all orders in ε (Kruskal, <https://doi.org/10.1063/1.1724285>). One circle over
/// several fast planes leaves more generators invariant than functions of 𝔍 and y, such as
/// q₁q₂ + p₁p₂ for weights (1, 1): these are left out, and the ratios of the planes'
/// frequencies are those of the weights.
#[derive(Clone, Debug)]
pub struct NormalForm<P> {
    shape: NormalFormShape,
    composition: Composition<P>,
}

/// The parts of a normal-form gyroceptron, over its parameters.
struct Parts<P> {
    /// χ.
    chart: Composition<P>,
    /// Φ_θ∘T_ε, and K_ε after it where there is one.
    inner: Composition<P>,
}

impl<P: Real> Parts<P> {
    fn new(shape: &NormalFormShape, epsilon: P, parameters: &[P]) -> Result<Self, Error> {
        let planes = FastPlanes::new(&shape.action)?;
        let empty = || Composition::new(shape.dof(), parameters.to_vec(), epsilon);
        let psi = shape.psi_shape();
        let mut end = psi.parameter_count();
        let psi = psi.composition(parameters[..end].to_vec(), epsilon, false);
        let near_periodic = shape.perturbation.is_none();
        let mut chart = empty();
        for &width in &shape.kicks {
            let start = end;
            end += shape.kick_len(width);
            chart.push_turned_kick(width, start..end, near_periodic);
        }
        chart.push_all(&psi, 0, Direction::Forward);
        let mut inner = empty();
        let start = end;
        end += shape.twist_len();
        let shears = Arc::new(TwistShears::new(planes, &shape.twists));
        let kind = Kind::Twist { shears, factor: shape.flow_time };
        let (parameters, near_identity) = (start..end, near_periodic);
        inner.push(Step { kind, parameters, inverse: false, near_identity });
        inner.push_turn(&shape.action, shape.theta()..shape.parameter_count());
        for &width in shape.perturbation.iter().flatten() {
            let start = end;
            end += shape.kick_len(width);
            inner.push_turned_kick(width, start..end, true);
        }
        Ok(Self { chart, inner })
    }
}

impl<P: Real> NormalForm<P> {
    /// The map of this shape at ε with these parameters.
    ///
    /// # Errors
    /// When `parameters` is not of the length that `shape` asks for, or its action is
    /// not one that [`FastPlanes`] are of.
    pub fn new(shape: NormalFormShape, epsilon: P, parameters: Vec<P>) -> Result<Self, Error> {
        shape.check()?;
        Error::check_count("parameters", shape.parameter_count(), parameters.len())?;
        let Parts { chart, inner } = Parts::new(&shape, epsilon, &parameters)?;
        let mut composition = Composition::new(shape.dof(), parameters, epsilon);
        composition.push_all(&chart, 0, Direction::Inverse);
        composition.push_all(&inner, 0, Direction::Forward);
        composition.push_all(&chart, 0, Direction::Forward);
        Ok(Self { shape, composition })
    }

    /// χ, from the coordinates of the normal form to those of the data, and Φ_θ∘T_ε, or K_ε∘Φ_θ∘T, the
    /// map in the former: N steps are χ∘(Φ_θT_ε)^N∘χ⁻¹.
    pub fn chart_and_inner_map(&self) -> [Composition<P>; 2] {
        let (epsilon, parameters) = (self.composition.epsilon(), self.composition.parameters());
        let Parts { chart, inner } =
            Parts::new(&self.shape, epsilon, parameters).expect("as when it was made");
        [chart, inner]
    }
}

impl<P: Scalar> NormalForm<P> {
    /// An angle for each circle, in radians.
    pub fn theta(&self) -> &[P] {
        &self.composition.parameters()[self.shape.theta()..]
    }

    /// The parameters of χ, of T_ε, of K_ε, and the angles.
    fn blocks(&self) -> [&[P]; 4] {
        let (chart, rest) = self.composition.parameters().split_at(self.shape.chart_len());
        let (twists, rest) = rest.split_at(self.shape.twist_len());
        let (perturbation, angles) = rest.split_at(self.shape.perturbation_len());
        [chart, twists, perturbation, angles]
    }

    /// The parameters of the map in the coordinates of the normal form.
    pub(super) fn inner_parameters(&self) -> &[P] {
        &self.composition.parameters()[self.shape.chart_len()..]
    }

    /// ε.
    pub fn epsilon(&self) -> P {
        self.composition.epsilon()
    }

    /// Action and widths.
    pub fn shape(&self) -> &NormalFormShape {
        &self.shape
    }

    /// The steps and parameters: the map.
    pub fn composition(&self) -> &Composition<P> {
        &self.composition
    }
}

impl NormalForm<f64> {
    /// Pᵐ as one map of m times the flow time: χ∘Φ_{mθ}∘T_εᵐ∘χ⁻¹, with m times as many twist
    /// shears, of functions G/m in place of G, the factor h being m times as large. Exact, but for the
    /// rounding of G/m and of the sum of the angles.
    ///
    /// A splitting of m steps, in other words, whose stages can then be trained each by itself.
    ///
    /// Its step takes as long as m of the map, but for the charts between them.
    ///
    /// # Errors
    /// When the number of twist shears is odd and m is not 1: those of positions and of momenta come
    /// by turns. When m is 0, the shears are too many, or the flow time is not finite.
    pub fn iterated(&self, m: usize) -> Result<Self, Error> {
        Error::check_count_range("repeats of a map", m, 1, MOST_REPEATS)?;
        let shears = m.saturating_mul(self.shape.twists.len());
        Error::check_count_range("twist shears", shears, 0, MOST_REPEATS)?;
        if m > 1 && !self.shape.twists.len().is_multiple_of(2) {
            let expected = "an even number, to be repeated";
            return Err(Error::invalid("twist shears", self.shape.twists.len(), expected));
        }
        if m > 1 && !self.shape.is_integrable() {
            let expected = "1 of a map with a perturbation, whose powers have other ones";
            return Err(Error::invalid("repeats of a map", m, expected));
        }
        let ([chart, twists, perturbation, angles], times) = (self.blocks(), m as f64);
        let mut repeated = twists.to_vec();
        let mut begin = 0;
        for (number, &width) in self.shape.twists.iter().enumerate() {
            let end = begin + shear_len(number, width, self.shape.arguments());
            let inner = width * (self.shape.arguments() + 1);
            repeated[begin + inner..end].iter_mut().for_each(|weight| *weight /= times);
            begin = end;
        }
        let mut parameters = chart.to_vec();
        parameters.extend(repeated.repeat(m));
        parameters.extend(perturbation);
        parameters.extend(angles.iter().map(|angle| angle * times));
        let shape = NormalFormShape {
            twists: self.shape.twists.repeat(m),
            flow_time: self.shape.flow_time * times,
            ..self.shape.clone()
        };
        Self::new(shape, self.epsilon(), parameters)
    }

    /// The map at another ε.
    pub fn at_epsilon(&self, epsilon: f64) -> Self {
        let composition = self.composition.with_epsilon(epsilon);
        Self { composition, shape: self.shape.clone() }
    }

    /// With the first so many of its twist shears alone.
    ///
    /// # Errors
    /// When there are fewer.
    pub(super) fn with_first_twists(&self, count: usize) -> Result<Self, Error> {
        Error::check_count_range("twist shears", count, 0, self.shape.twists.len())?;
        let shape =
            NormalFormShape { twists: self.shape.twists[..count].to_vec(), ..self.shape.clone() };
        let [chart, twists, perturbation, angles] = self.blocks();
        let parameters = [chart, &twists[..shape.twist_len()], perturbation, angles].concat();
        Self::new(shape, self.epsilon(), parameters)
    }
}

impl<P: Scalar, S: Over<P>> Map<S> for NormalForm<P> {
    map_of_composition!(S);
}
