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
//! sense that its invariant needs. This is a statement on ε → 0 with fixed weights: it does not
//! say how well one set of weights may do at finitely many ε.
//!
//! A turned kick has the generator −V(x cos φ + y sin φ), plane by plane, V being a sum of
//! w tanh(a·(…) + b): w tanh(α·z + b) with any α in phase space, a_j and φ_j being the polar
//! coordinates of its part in plane j. Sums of these are dense in C¹ on compact sets
//! (Hornik, <https://doi.org/10.1016/0893-6080(91)90009-T>, theorem 3), so that the generators of turned
//! kicks come near any G with its vector field; of arctan too, which is bounded and not constant as
//! the theorem asks. One evaluation of tanh a neuron is
//! all they take, where a Hénon layer takes four.
//!
//! Measured, one set of weights fitted to exp(εX_G), G = q₁p₁ cos q₂, at
//! ε = 0.08, 0.04, 0.02 and 0.01 together, by 40 iterations on 200 pairs each: 4 Hénon layers of 8 err by
//! 0.55, 0.31, 0.59 and 0.80 of the motion, 8 of them by 0.27, 0.34, 0.31 and 0.63, and both by all of it
//! below ε = 1e-3; 12 turned kicks of 8 err by 0.006 to 0.007 at every ε
//! (`cargo test --release --test maps generators -- --nocapture`).

//! # What its T_ε reaches
//!
//! T_ε commutes with the circle action if its generator is a function of the actions 𝔍 and of the
//! slow coordinates (x, y). A twist shear has the generator G(𝔍, y) where it changes the slow
//! positions, and G(𝔍, x) where it changes the slow momenta. Its limit is that of I_ε above.
//!
//! *Twists reach, to first order in εh, the sums A(𝔍, x) + B(𝔍, y) and no more.* Each shear is the
//! time-εh flow of its G_l, and the identity at ε = 0. The derivative of their composition in εh at
//! 0 is the field of ΣG_l: a function of (𝔍, x) from the shears of momenta and one of (𝔍, y) from
//! those of positions. A generator with ∂²K/∂x∂y ≠ 0, such as that of a particle that drifts through
//! [cells](crate::system::CellularDrift), is missed by an error of order εh, as large as the motion. ∎
//!
//! *Turned twists come near any K(𝔍, x, y).* R(φ) turns the slow planes alone. It is symplectic and
//! keeps 𝔍, so that R(−φ)∘exp(εh X_G)∘R(φ) = exp(εh X_{G∘R(φ)}), exactly: a turned twist is the flow
//! of G(𝔍, x′), x′_j = x_j cos φ_j + y_j sin φ_j. With G = w tanh(a·𝔍 + b·x′ + c) its generator is
//! w tanh(a·𝔍 + α·(x, y) + c), and (b_j, φ_j) are the polar coordinates of the part of α in plane
//! j: every linear form occurs. Sums of such ridge functions are dense in C¹ on compact sets of
//! (𝔍, x, y) (Hornik, as above), and the derivative in εh at 0 of a composition of turned twists is
//! the sum of their fields. Functions that are near in C¹ have fields that are near on compact sets
//! of phase space, since 𝔍 is a polynomial there. ∎
//!
//! Turned twists have no quadratic part. A twist has ½uᵀQu beside its shears of positions, where
//! momenta change by bounded amounts and positions in proportion to momenta: slow motion grows as N²
//! in N steps at most. This holds for turned directions too, if all shears with a quadratic part
//! share one direction φ_j in each plane. Two directions in a plane do not keep it: shears of
//! Q and −Q along them can be hyperbolic, and slow motion grows exponentially. Without a quadratic part
//! each turned twist moves a slow point by a bounded amount, and slow motion grows as N at most.
//!
//! Measured, one set of weights fitted to exp(εX_K) at ε = 0.08, 0.04, 0.02 and 0.01 together, in the
//! box |z_i| ≤ 1, as above: of K = (1 + ½𝔍) cos q₂ cos p₂, 12 twists of 8 neurons (403 parameters) miss 0.06
//! to 0.13 of the motion at these ε and 0.16 below, 12 turned twists of 8 (397) 0.003 at every ε. Of the sum
//! ½p₂² + cos q₂ + 𝔍 sin p₂ twists miss 0.0007 and turned twists 0.0004
//! (`cargo test --release --test maps slow_generators -- --nocapture`).

use super::architecture::Architecture;
use super::block::Block;
use super::composition::Composition;
use super::layers::Layers;
use super::model::Model;
use super::part::{Part, Scale};
use crate::error::Error;
use crate::layer::TorusAction;
use serde::{Deserialize, Serialize};

/// The shape of the normal-form gyroceptron and of the nearly integrable map.
///
/// P_ε = χ∘Φ_θ∘T_ε∘χ⁻¹, χ = ψ∘ψ_ε, with a HénonNet ψ, [turned kicks](crate::layer::TurnedKick)
/// ψ_ε scaled by ε, and a [twist](crate::layer::Twist) T_ε scaled by εh.
///
/// With a perturbation it is P = χ∘K_ε∘Φ_θ∘T∘χ⁻¹ with χ of order one, T scaled by h, and turned kicks
/// K_ε: a map near an integrable one, whose frequencies vary between invariant surfaces, with the
/// resonances and islands that ε opens. 𝔍∘χ⁻¹ is then an invariant at ε = 0.
///
/// Without a perturbation it is a gyroceptron: a near-identity map times ψ∘Φ_θ∘ψ⁻¹. T_ε commutes with Φ, so that
/// P commutes with the action conjugated by χ. The actions 𝔍∘χ⁻¹ in the coordinates of the normal form are
/// therefore exact invariants of P, for all weights and all time.
///
/// With one fast plane, or a circle for each, nearly-periodic Hamiltonian flows are χ∘Φ_θ∘T_ε∘χ⁻¹ to all orders in ε
/// (Kruskal, <https://doi.org/10.1063/1.1724285>) with some T_ε that commutes with Φ. That T_ε need not be a
/// composition of twists: what twists and [turned twists](crate::layer::TwistShears::turned) reach to first order is
/// proved in `normal_form.rs`. One circle over several fast planes leaves more generators invariant than functions of 𝔍
/// and y, such as q₁q₂ + p₁p₂ for weights (1, 1): these are left out, and the ratios of the planes' frequencies are
/// those of the weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NormalFormShape {
    /// Φ, a circle or torus action.
    pub action: TorusAction,
    /// The widths of ψ's Hénon layers; empty where the circle action is Φ itself to leading order.
    pub psi: Vec<usize>,
    /// The widths of the turned kicks of ψ_ε.
    pub kicks: Vec<usize>,
    /// The widths of the twist shears of T_ε. The first, the third and so on change the
    /// positions and have a quadratic form beside their neurons, of which they need few or none.
    pub twists: Vec<usize>,
    /// The widths of the [turned twists](crate::layer::TwistShears::turned) that T_ε has after its twist shears.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub turned_twists: Vec<usize>,
    /// h, the flow time, by which T_ε is scaled in addition to ε: weights have the same size at any h.
    pub flow_time: f64,
    /// The widths of the turned kicks of K_ε, if the map is nearly integrable: χ and T are then
    /// of order one, and ε scales only K_ε. With an empty list the map is integrable.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub perturbation: Option<Vec<usize>>,
}

impl NormalFormShape {
    /// The network of this shape at ε: blocks `psi`, `kick`, `twist`, `turned_twist` and
    /// `perturbation`. A block `twist` or `turned_twist` without shears is left out if the other has some.
    pub fn architecture(&self, epsilon: f64) -> Architecture {
        let of_order_one = self.perturbation.is_some();
        let [chart, slow] = match of_order_one {
            true => [Scale::None, Scale::Time],
            false => [Scale::Epsilon, Scale::EpsilonTime],
        };
        let block = |part, layers, name: &str| Block::new(part, layers).named(name);
        let kicks = block(Part::Chart, Layers::TurnedKick(self.kicks.clone()), "kick");
        let twists = block(Part::SlowMap, Layers::Twist(self.twists.clone()), "twist");
        let turned =
            block(Part::SlowMap, Layers::TurnedTwist(self.turned_twists.clone()), "turned_twist");
        let slow_map = match (self.twists.is_empty(), self.turned_twists.is_empty()) {
            (_, true) => vec![twists],
            (true, false) => vec![turned],
            (false, false) => vec![twists, turned],
        };
        let architecture = Architecture::new(self.action.dof())
            .on_torus(&self.action)
            .at_epsilon(epsilon)
            .of_time(self.flow_time)
            .with(block(Part::Conjugation, Layers::Henon(self.psi.clone()), "psi"))
            .with(kicks.scaled(chart));
        let with = |architecture: Architecture, block: Block| architecture.with(block.scaled(slow));
        let architecture = slow_map.into_iter().fold(architecture, with);
        match &self.perturbation {
            Some(widths) => architecture.with(block(
                Part::Perturbation,
                Layers::TurnedKick(widths.clone()),
                "perturbation",
            )),
            None => architecture,
        }
    }
}

/// More repetitions of a twist are a mistake.
pub(crate) const MOST_REPEATS: usize = 100_000;

/// What is done with the slow map of a network.
impl Model {
    /// The index of its slow map among the blocks, and where its parameters are.
    fn slow_map(&self) -> Option<(usize, std::ops::Range<usize>)> {
        let architecture = self.architecture();
        let mut all = (0..architecture.blocks.len())
            .filter(|&index| architecture.blocks[index].part == Part::SlowMap);
        match (all.next(), all.next()) {
            (Some(index), None) => Some((index, architecture.block_ranges()[index].clone())),
            _ => None,
        }
    }

    /// With a slow map of other widths, and its parameters.
    fn with_slow_map(
        &self,
        flow_time: f64,
        widths: Vec<usize>,
        own: &[f64],
        angles: &[f64],
    ) -> Result<Self, Error> {
        let (index, range) = self.slow_map().ok_or_else(|| {
            Error::invalid("slow map", "none, or several blocks of it", "one block")
        })?;
        let mut architecture = self.architecture().clone();
        architecture.flow_time = flow_time;
        let layers = architecture.blocks[index].layers.with_widths(widths);
        architecture.blocks[index].layers = layers;
        let all = self.parameters();
        let end = self.architecture().angles().start;
        let parameters = [&all[..range.start], own, &all[range.end..end], angles].concat();
        Self::new(architecture, parameters)
    }

    /// Pᵐ as one map of m times the flow time: χ∘Φ_{mθ}∘T_εᵐ∘χ⁻¹, with m times as many twist
    /// shears, of functions G/m in place of G, since h is m times as large. It is exact up to the
    /// rounding of G/m and of the sum of the angles.
    ///
    /// In other words, it is a splitting of m steps whose stages can then be trained independently.
    ///
    /// One step takes as long as m steps of the original map without the charts between them.
    ///
    /// # Errors
    /// When m is not 1 and the network has controls, is not in normal form, its slow map is not one
    /// block, or its number of twist shears is odd: those of positions and of momenta come by turns.
    /// When m is 0, the shears are too many, or the flow time is not finite.
    pub fn iterated(&self, m: usize) -> Result<Self, Error> {
        Error::check_count_range("repeats of a map", m, 1, MOST_REPEATS)?;
        if m == 1 {
            return Ok(self.clone());
        }
        let architecture = self.architecture();
        if let Some(controls) = &architecture.controls {
            let names: Vec<&str> = controls.ranges.iter().map(|range| &*range.name).collect();
            let expected = "none: a network at given values of its controls has no other powers";
            return Err(Error::invalid("controls", names.join(", "), expected));
        }
        let shears = architecture.twist_shears();
        let all = m.saturating_mul(shears);
        Error::check_count_range("twist shears", all, 0, MOST_REPEATS)?;
        if !architecture.keeps_actions() {
            let expected = "1 of a map that is not in normal form, such as one with a perturbation: its powers are \
                 of another kind";
            return Err(Error::invalid("repeats of a map", m, expected));
        }
        let Some((index, range)) = self.slow_map() else {
            let expected = "1 of a network whose slow map is not one block";
            return Err(Error::invalid("repeats of a map", m, expected));
        };
        if architecture.twists_alternate() && !shears.is_multiple_of(2) {
            let expected = "an even number, to be repeated";
            return Err(Error::invalid("twist shears", shears, expected));
        }
        let (block, times) = (&architecture.blocks[index], m as f64);
        let mut repeated = self.parameters()[range].to_vec();
        let mut rest = &mut repeated[..];
        // G is linear in w, in the quadratic form and in coefficients.
        for (tensor, len) in architecture.tensors_of_block(index) {
            let (values, others) = rest.split_at_mut(len);
            if matches!(tensor, "w_out" | "quadratic" | "coefficients") {
                values.iter_mut().for_each(|weight| *weight /= times);
            }
            rest = others;
        }
        let widths = block.layers.widths().repeat(m);
        let angles: Vec<f64> = self.angles().iter().map(|angle| angle * times).collect();
        let flow_time = architecture.flow_time * times;
        self.with_slow_map(flow_time, widths, &repeated.repeat(m), &angles)
    }

    /// A network with one in `parts` of its twist shears, the first ones.
    ///
    /// # Errors
    /// When they are no multiple of `parts`; when it has no slow map and `parts` is not 1.
    pub(crate) fn with_part_of_twists(&self, parts: usize) -> Result<Self, Error> {
        Error::check_count_range("parts", parts, 1, usize::MAX)?;
        let shears = self.architecture().twist_shears();
        match self.slow_map() {
            _ if parts == 1 => Ok(self.clone()),
            Some((index, range)) if shears.is_multiple_of(parts) => {
                let architecture = self.architecture();
                let widths = architecture.blocks[index].layers.widths()[..shears / parts].to_vec();
                let mut fewer = architecture.clone();
                fewer.blocks[index].layers = fewer.blocks[index].layers.with_widths(widths.clone());
                let own = &self.parameters()[range][..fewer.block_ranges()[index].len()];
                self.with_slow_map(architecture.flow_time, widths, own, self.angles())
            }
            None if shears > 0 => {
                let expected = "1 of a network whose slow map is not one block";
                Err(Error::invalid("parts", parts, expected))
            }
            _ => Err(Error::invalid("parts", parts, "a divisor of the number of twist shears")),
        }
    }

    /// T_ε with the angles of its circles, as a network of its own; of one with controls, at the middle of their
    /// ranges.
    ///
    /// # Errors
    /// Those of [`Model::new`].
    pub(crate) fn slow_map_alone(&self) -> Result<Self, Error> {
        let mut architecture = self.architecture().clone().with_controls(None);
        architecture.blocks.retain(|block| block.part == Part::SlowMap);
        let mut parameters = Vec::new();
        for (block, range) in
            self.architecture().blocks.iter().zip(self.architecture().block_ranges())
        {
            if block.part == Part::SlowMap {
                parameters.extend_from_slice(&self.parameters()[range]);
            }
        }
        parameters.extend_from_slice(self.angles());
        Self::new(architecture, parameters)
    }

    /// This network with the slow map and the angles of [another](Model::slow_map_alone).
    ///
    /// # Errors
    /// When that has more or fewer parameters.
    pub(crate) fn with_slow_map_of(&self, alone: &Self) -> Result<Self, Error> {
        let mut parameters = self.parameters().to_vec();
        let mut rest = alone.parameters();
        for (block, range) in
            self.architecture().blocks.iter().zip(self.architecture().block_ranges())
        {
            if block.part != Part::SlowMap {
                continue;
            }
            let (own, others) = rest.split_at_checked(range.len()).ok_or_else(|| {
                Error::invalid("parameters of a slow map", rest.len(), "as many as here")
            })?;
            parameters[range].copy_from_slice(own);
            rest = others;
        }
        self.with_parameters(parameters)?.with_angles(rest)
    }

    /// The blocks of its chart, if it is built on a circle and has a slow map.
    fn is_of_chart(&self, index: usize) -> bool {
        let part = self.architecture().blocks[index].part;
        self.architecture().reversor.is_none() && matches!(part, Part::Conjugation | Part::Chart)
    }

    /// K_ε∘Φ_θ∘T_ε of a network with a slow map, as one whose chart is the identity; of any other
    /// network, itself.
    ///
    /// # Errors
    /// Those of [`Model::new`].
    pub(crate) fn without_chart(&self) -> Result<Self, Error> {
        if self.architecture().twist_shears() == 0 {
            return Ok(self.clone());
        }
        let mut architecture = self.architecture().clone();
        let mut parameters = Vec::new();
        for (index, range) in self.architecture().block_ranges().into_iter().enumerate() {
            match self.is_of_chart(index) {
                true => {
                    let layers = architecture.blocks[index].layers.with_widths(Vec::new());
                    architecture.blocks[index].layers = layers;
                }
                false => parameters.extend_from_slice(&self.parameters()[range]),
            }
        }
        architecture.blocks.retain(|block| !matches!(block.layers, Layers::SympNet(_)));
        parameters.extend_from_slice(self.angles());
        Self::new(architecture, parameters)
    }

    /// This network with all but the chart of another one, whose chart may differ; a network
    /// without a slow map stays what it is.
    ///
    /// # Errors
    /// When they have more or fewer parameters; those of [`Model::new`].
    pub(crate) fn with_twists_of(&self, other: &Self) -> Result<Self, Error> {
        if self.architecture().twist_shears() == 0 || other.architecture().twist_shears() == 0 {
            return Ok(self.clone());
        }
        let mut rest = Vec::new();
        for (index, range) in other.architecture().block_ranges().into_iter().enumerate() {
            if !other.is_of_chart(index) {
                rest.extend_from_slice(&other.parameters()[range]);
            }
        }
        rest.extend_from_slice(other.angles());
        let mut parameters = Vec::new();
        let mut others = &rest[..];
        let mut take = |len: usize| -> Result<&[f64], Error> {
            let (own, after) = others.split_at_checked(len).ok_or_else(|| {
                Error::invalid("parameters of twists and angles", rest.len(), "as many as here")
            })?;
            others = after;
            Ok(own)
        };
        for (index, range) in self.architecture().block_ranges().into_iter().enumerate() {
            match self.is_of_chart(index) {
                true => parameters.extend_from_slice(&self.parameters()[range]),
                false => parameters.extend_from_slice(take(range.len())?),
            }
        }
        parameters.extend_from_slice(take(self.angles().len())?);
        Error::check_count(
            "parameters of twists and angles",
            rest.len() - others.len(),
            rest.len(),
        )?;
        self.with_parameters(parameters)
    }

    /// χ of a network with a slow map.
    pub(crate) fn chart(&self) -> Composition<f64> {
        let [chart, _] = self.chart_and_inner_map();
        chart
    }
}
