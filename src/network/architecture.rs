//! The architecture of a network: its structure without its parameters.

use super::block::Block;
use super::block_table::read_blocks;
use super::composition::Composition;
use super::controls::Controls;
use super::layers::{Layers, Surroundings};
use super::part::Part;
use crate::error::{Error, block_called};
use crate::layer::{CircleAction, FastPlanes, Reversor, RidgeFunction, TorusAction};
use crate::phase::Direction;
use crate::scalar::{Real, max_or_nan};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// More is a mistake in a file: 8 GB of weights.
const MOST_PARAMETERS: usize = 1_000_000_000;
/// The largest |m| of a circle action: mθ keeps its digits.
const LARGEST_WEIGHT: u32 = 1_000_000;
/// A table of all planes is kept for each turned layer.
const MOST_PLANES: usize = 1000;

/// The architecture of a network, as data: its circles, ε, flow time and blocks.
///
/// The map is
///
/// P = R∘I_ε∘χ∘K_ε∘Φ_θ∘T_ε∘χ⁻¹, χ = ψ∘ψ_ε,
///
/// where each block belongs to one of these [parts](Part); several blocks of a part are applied in the
/// order of the list. Without circles it is R∘I_ε. With a [reversor](Architecture::reversor) S it is
///
/// P = A∘Φ_θ∘T_ε∘S∘A⁻¹∘S, A = ψ_ε∘K_ε,
///
/// or R∘S∘R⁻¹∘S without circles: S∘P∘S = P⁻¹ for all weights. (If some planes are rotated by no
/// circle, S∘T_ε∘S is not T_ε⁻¹; then T_ε moves into A = ψ_ε∘K_ε∘T_ε, with half the flow time.)
/// The list determines the [`Model`](super::Model), the number and the
/// order of the parameters (block by block, each layer by layer in the order of application, then
/// θ), the names of the tensors, the initial weights, the invariants, and the laws that
/// [`certify`](crate::measure::certificate::certify) checks.
///
/// [Named architectures](super::named) are made by constructors, and custom lists of blocks by
/// [`Architecture::new`] and [`Architecture::with`]:
///
/// ```
/// use gyroceptron::layer::{Activation, CircleAction};
/// use gyroceptron::network::{Architecture, Block, InitialWeights, Layers, Modules, Part};
///
/// // A gyroceptron whose ψ is of SympNet modules.
/// let modules = Modules { modules: 5, shears: 3, activation: Activation::Tanh, plain: false };
/// let architecture = Architecture::new(2)
///     .on_circle(CircleAction::new([1, 0]))
///     .at_epsilon(0.01)
///     .with(Block::new(Part::Conjugation, Layers::SympNet(modules)))
///     .with(Block::new(Part::NearIdentity, Layers::Henon(vec![8; 4])));
/// let model = architecture.initialise(InitialWeights::Glorot, 1.1, 7)?;
/// assert!(model.invariant().is_some());
/// # Ok::<(), gyroceptron::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Architecture {
    /// The degrees of freedom n.
    pub dof: usize,
    /// The circle actions Φ, each with an angle θ; empty for a network without circles.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub circles: Vec<CircleAction>,
    /// The parameter ε; 1 where no block is scaled by it.
    #[serde(default = "one")]
    pub epsilon: f64,
    /// The flow time h; 1 where no block is scaled by it.
    #[serde(default = "one")]
    pub flow_time: f64,
    /// The blocks of the network.
    #[serde(deserialize_with = "read_blocks")]
    pub blocks: Vec<Block>,
    /// The reversor S, if the map is reversible for all weights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reversor: Option<Reversor>,
    /// The controls of which its parameters are polynomials, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub controls: Option<Controls>,
}

fn one() -> f64 {
    1.0
}

/// The structure that a list of blocks gives a map: the laws that it obeys for all weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Structure {
    /// A map without a circle action: invertible, and symplectic if its layers are.
    Plain,
    /// P_ε = I_ε∘ψ∘Φ_θ∘ψ⁻¹: nearly periodic, with an adiabatic invariant if it is symplectic.
    NearlyPeriodic,
    /// P_ε = χ∘Φ_θ∘T_ε∘χ⁻¹: it commutes with the conjugated action, whose invariants it keeps
    /// exactly.
    NormalForm,
    /// P_ε = χ∘K_ε∘Φ_θ∘T∘χ⁻¹: in normal form at ε = 0.
    NearlyIntegrable,
    /// P_ε = I_ε∘χ∘Φ_θ∘T_ε∘χ⁻¹, whose χ is ψ and T the identity at ε = 0: nearly periodic. So is
    /// P_ε = A∘Φ_θ∘T_ε∘S∘A⁻¹∘S, whose A is the identity at ε = 0.
    Mixed,
}

impl Structure {
    /// The name of the structure in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::NearlyPeriodic => "nearly-periodic",
            Self::NormalForm => "normal-form",
            Self::NearlyIntegrable => "nearly-integrable",
            Self::Mixed => "mixed",
        }
    }
}

impl Architecture {
    /// A network of n degrees of freedom without blocks, the identity.
    pub fn new(dof: usize) -> Self {
        let (circles, blocks, reversor, controls) = (Vec::new(), Vec::new(), None, None);
        Self { dof, circles, epsilon: 1.0, flow_time: 1.0, blocks, reversor, controls }
    }

    /// The architecture with this circle action in addition to its other circles.
    pub fn on_circle(mut self, circle: CircleAction) -> Self {
        self.circles.push(circle);
        self
    }

    /// The architecture made reversible with this reversor S.
    pub fn reversible(self, reversor: Option<Reversor>) -> Self {
        Self { reversor, ..self }
    }

    /// The architecture with the circles of this torus action.
    pub fn on_torus(self, action: &TorusAction) -> Self {
        Self { circles: action.circles().to_vec(), ..self }
    }

    /// The architecture at another ε.
    pub fn at_epsilon(self, epsilon: f64) -> Self {
        Self { epsilon, ..self }
    }

    /// The architecture with another flow time.
    pub fn of_time(self, flow_time: f64) -> Self {
        Self { flow_time, ..self }
    }

    /// The architecture with this block appended.
    pub fn with(mut self, block: Block) -> Self {
        self.blocks.push(block);
        self
    }

    /// The architecture with parameters that are polynomials of these controls.
    pub fn with_controls(self, controls: Option<Controls>) -> Self {
        Self { controls, ..self }
    }

    /// The structure that the blocks give the map.
    pub fn structure(&self) -> Structure {
        let has = |part: Part| self.part(part).next().is_some();
        if self.circles.is_empty() || has(Part::None) {
            return Structure::Plain;
        }
        if self.reversor.is_some() {
            let mut slow = self.part(Part::SlowMap).filter(|block| block.layers.count() > 0);
            let of_order_one = slow.any(|block| !block.scale.has_epsilon());
            return if of_order_one { Structure::NearlyIntegrable } else { Structure::Mixed };
        }
        match (has(Part::NearIdentity), has(Part::Chart) || has(Part::SlowMap)) {
            (true, false) => Structure::NearlyPeriodic,
            (true, true) => Structure::Mixed,
            (false, _) if self.is_perturbed() => Structure::NearlyIntegrable,
            (false, _) => Structure::NormalForm,
        }
    }

    /// The blocks of a part, in the order of application.
    pub fn part(&self, part: Part) -> impl DoubleEndedIterator<Item = &Block> {
        self.blocks.iter().filter(move |block| block.part == part)
    }

    /// The widths of all layers of a part, in the order of application.
    pub fn widths(&self, part: Part) -> Vec<usize> {
        self.part(part).flat_map(|block| block.layers.widths()).copied().collect()
    }

    /// Whether its perturbation K_ε has layers.
    fn is_perturbed(&self) -> bool {
        self.part(Part::Perturbation).any(|block| block.layers.count() > 0)
    }

    /// Whether it keeps the actions of its circles, in its chart, exactly.
    pub fn keeps_actions(&self) -> bool {
        self.structure() == Structure::NormalForm
    }

    /// Whether maps of the architecture are symplectic, whatever their weights.
    pub fn is_symplectic(&self) -> bool {
        self.blocks.iter().all(|block| block.layers.kind().is_symplectic())
    }

    /// Whether all of its layers are Hénon layers of neurons of tanh, those of the paper.
    pub fn is_of_henon_layers(&self) -> bool {
        let is = |block: &Block| {
            matches!(block.layers, Layers::Henon(_)) && block.ridges == RidgeFunction::default()
        };
        self.blocks.iter().all(is)
    }

    /// Whether some of its layers are of polynomials, which have a box.
    pub fn has_polynomials(&self) -> bool {
        self.blocks.iter().any(|block| block.ridges.is_polynomial())
    }

    /// The architecture with this box for all polynomials without one: coordinates from −ρ to ρ, ρ = `radius`.
    pub fn in_box(mut self, radius: f64) -> Self {
        for block in &mut self.blocks {
            block.ridges = block.ridges.in_box(radius);
        }
        self
    }

    /// As [`Architecture::in_box`], with the box of these points, 2n numbers each: ρ is a tenth larger
    /// than the largest radius of a point in a plane, since charts move points slightly.
    pub fn in_box_of<'a>(self, points: impl IntoIterator<Item = &'a [f64]>) -> Self {
        let dof = self.dof;
        let points = points.into_iter().flat_map(|points| points.chunks_exact(2 * dof));
        let radii = points.flat_map(|z| (0..dof).map(|j| libm::hypot(z[j], z[dof + j])));
        let largest = radii.fold(0.0, max_or_nan);
        self.in_box(1.1 * largest)
    }

    /// Whether it has circles, and so an ε and angles: it then stands for a family of maps.
    pub fn has_circle(&self) -> bool {
        !self.circles.is_empty()
    }

    /// Whether the flow time scales one of its blocks.
    pub fn has_flow_time(&self) -> bool {
        self.blocks.iter().any(|block| block.scale.has_time())
    }

    /// Whether its chart and slow map are of order one, not scaled by ε, as in a nearly integrable map.
    pub fn is_of_order_one(&self) -> bool {
        // The chart of a reversible map is near the identity, as its perturbation is.
        let chart = self.part(Part::Chart).filter(|_| self.reversor.is_none());
        let mut own = chart.chain(self.part(Part::SlowMap)).peekable();
        own.peek().is_some() && own.all(|block| !block.scale.has_epsilon())
    }

    /// Whether its circles rotate the coordinate planes of the data to leading order: it has twists, which
    /// act on these planes.
    pub fn keeps_its_planes(&self) -> bool {
        self.blocks.iter().any(|block| block.layers.kind().commutes_with_circles())
    }

    /// The number of shears of its slow map.
    pub fn twist_shears(&self) -> usize {
        self.part(Part::SlowMap).map(|block| block.layers.count()).sum()
    }

    /// Whether shears of its slow map change positions and momenta by turns.
    pub(crate) fn twists_alternate(&self) -> bool {
        self.part(Part::SlowMap).any(|block| matches!(block.layers, Layers::Twist(_)))
    }

    /// The circles as one torus action; None for a network without circles.
    pub fn action(&self) -> Option<TorusAction> {
        TorusAction::new(self.circles.clone()).ok()
    }

    /// What the layers have to know. Slow planes are those that no circle turns.
    pub(super) fn surroundings(&self) -> Surroundings {
        let still = |j: &usize| self.circles.iter().all(|c| c.weights().get(*j) == Some(&0));
        let slow = (0..self.dof.min(MOST_PLANES)).filter(still).count();
        Surroundings { dof: self.dof, arguments: self.circles.len() + slow, slow }
    }

    /// The number of parameters: those of the blocks and an angle for each circle, times the number of
    /// products of controls.
    pub fn parameter_count(&self) -> usize {
        self.nominal_count().saturating_mul(self.terms())
    }

    /// How many products its parameters are sums over.
    fn terms(&self) -> usize {
        self.controls.as_ref().map_or(1, Controls::terms)
    }

    /// The number of parameters of its map at given controls.
    pub(crate) fn nominal_count(&self) -> usize {
        let of = self.surroundings();
        let blocks = self.blocks.iter().map(|block| block.parameter_count(of));
        blocks.fold(self.circles.len(), usize::saturating_add)
    }

    /// The range of the angles of the circles among the parameters: after those of the blocks, before those of
    /// products of controls.
    pub fn angles(&self) -> Range<usize> {
        let end = self.nominal_count();
        end - self.circles.len()..end
    }

    /// The range of the parameters of each block.
    pub fn block_ranges(&self) -> Vec<Range<usize>> {
        let (of, mut end) = (self.surroundings(), 0);
        let range = |block: &Block| {
            let start = end;
            end += block.parameter_count(of);
            start..end
        };
        self.blocks.iter().map(range).collect()
    }

    /// Each layer: its block, its number in it, and where its parameters are.
    pub fn layers(&self) -> Vec<(&Block, usize, Range<usize>)> {
        let of = self.surroundings();
        let ranges = self.block_ranges();
        let all = self.blocks.iter().zip(&ranges).flat_map(|(block, range)| {
            let layers = block.layer_ranges(range.start, of).into_iter().enumerate();
            layers.map(move |(number, range)| (block, number, range))
        });
        all.collect()
    }

    /// The tensors of the parameters by the names that files give them, with their
    /// shapes, in the order of the parameters.
    pub fn tensors(&self) -> Vec<(String, [usize; 2])> {
        let of = self.surroundings();
        let blocks = self.blocks.iter().flat_map(|block| block.tensors(of));
        let mut out: Vec<_> = blocks.map(|(name, tensor)| (name, tensor.shape)).collect();
        if self.has_circle() {
            out.push((Self::THETA.into(), [1, self.circles.len()]));
        }
        let Some(controls) = &self.controls else { return out };
        let of = |prefix: String| {
            out.iter().map(move |(name, shape)| (format!("{prefix}{name}"), *shape))
        };
        controls.prefixes().into_iter().flat_map(of).collect()
    }

    /// The kinds of tensor of a block, with their sizes, in the order of the parameters.
    pub(super) fn tensors_of_block(&self, index: usize) -> Vec<(&'static str, usize)> {
        let tensors = self.blocks[index].tensors(self.surroundings());
        tensors.into_iter().map(|(_, tensor)| (tensor.name, tensor.len())).collect()
    }

    /// The name of the tensor of the angles.
    pub(crate) const THETA: &str = "theta";

    /// Fails unless the architecture is valid: ε and the flow time are finite, there is a degree of freedom,
    /// circles have as many, names differ, and each block can play its part. All blocks act on the n degrees of
    /// freedom of the architecture, and every kind of layer has an inverse, so that neither can be wrong in a block.
    ///
    /// # Errors
    /// [`Error::Block`] with the number and the name of the block that is wrong; [`Error::OutOfRange`],
    /// [`Error::CountOutOfRange`], [`Error::WrongCount`] and [`Error::Invalid`] of the list as a whole.
    pub fn check(&self) -> Result<(), Error> {
        Error::check_finite("epsilon", self.epsilon)?;
        Error::check_finite("flow_time", self.flow_time)?;
        Error::check_count_range("degrees of freedom", self.dof, 1, usize::MAX)?;
        for circle in &self.circles {
            Error::check_count("weights of a circle action", self.dof, circle.dof())?;
            let too_large = |weight: &&i32| weight.unsigned_abs() > LARGEST_WEIGHT;
            if let Some(weight) = circle.weights().iter().find(too_large) {
                let expected = format!("weights of at most {LARGEST_WEIGHT}");
                return Err(Error::invalid("circle action", weight, expected));
            }
            if circle.weights().iter().all(|weight| *weight == 0) {
                let expected = "at least one weight other than 0";
                return Err(Error::invalid("circle action", "all weights 0", expected));
            }
        }
        for (number, block) in self.blocks.iter().enumerate() {
            let (kind, place) = (block.layers.kind(), |e: Error| e.in_block(number, &block.name));
            if kind.is_of_planes() {
                let name = format!("planes of {}", kind.plural());
                Error::check_count_range(&name, self.dof, 1, MOST_PLANES).map_err(place)?;
            }
            if let (Some(action), true) = (self.action(), kind.commutes_with_circles()) {
                FastPlanes::new(&action).map_err(place)?;
            }
        }
        self.controls.as_ref().map_or(Ok(()), Controls::check)?;
        let of = self.surroundings();
        for (number, block) in self.blocks.iter().enumerate() {
            let count = block.parameter_count(of);
            Error::check_count_range("parameters", count, 0, MOST_PARAMETERS)
                .map_err(|e| e.in_block(number, &block.name))?;
        }
        let count = self.parameter_count();
        Error::check_count_range("parameters of the architecture", count, 0, MOST_PARAMETERS)?;
        for (number, block) in self.blocks.iter().enumerate() {
            let place = |e: Error| e.in_block(number, &block.name);
            block.check(of, self.has_circle()).map_err(place)?;
            let unnamed = |found: String| place(Error::invalid("name", found, "a name of its own"));
            if let Some(other) = self.blocks[..number].iter().position(|of| of.name == block.name) {
                return Err(unnamed(format!("that of block {other}")));
            }
            if block.name.is_empty() && self.blocks.len() > 1 {
                return Err(unnamed(format!("none, of {} blocks", self.blocks.len())));
            }
        }
        let timed = |block: &&Block| block.scale.has_time();
        if let (0.0, Some(block)) = (self.flow_time, self.part(Part::NearIdentity).find(timed)) {
            let expected = "another number: I_ε would be the identity";
            return Err(self.error_in(block, Error::invalid("flow_time", 0, expected)));
        }
        self.check_parts()
    }

    /// The number of a block of this architecture.
    fn number_of(&self, block: &Block) -> usize {
        let number = self.blocks.iter().position(|other| other.name == block.name);
        number.unwrap_or(self.blocks.len())
    }

    /// A block of this architecture as errors name it.
    fn called(&self, block: &Block) -> String {
        block_called(self.number_of(block), &block.name)
    }

    /// An error in a block of this architecture.
    fn error_in(&self, block: &Block, reason: Error) -> Error {
        reason.in_block(self.number_of(block), &block.name)
    }

    /// What its parameters are of, with the number of each.
    pub(crate) fn count_of_each(&self) -> String {
        let ranges = self.block_ranges();
        let of = |(block, range): (&Block, Range<usize>)| {
            format!("{} of {}", range.len(), self.called(block))
        };
        let mut all: Vec<String> = self.blocks.iter().zip(ranges).map(of).collect();
        if self.has_circle() {
            all.push(format!("{} of {}", self.circles.len(), Self::THETA));
        }
        let once: usize = self.block_ranges().last().map_or(0, |range| range.end)
            + if self.has_circle() { self.circles.len() } else { 0 };
        let times = self.parameter_count() / once.max(1);
        let times =
            if times > 1 { format!(", each {times} times, for controls") } else { String::new() };
        all.join(", ") + &times
    }

    /// Fails where polynomials have no box yet.
    pub(super) fn check_boxes(&self) -> Result<(), Error> {
        match self.blocks.iter().find(|block| block.ridges.is_unbounded()) {
            Some(block) => {
                let reason = Error::Missing {
                    place: "layers".into(),
                    key: "radius",
                    needed_by: "the box of its polynomials".into(),
                };
                Err(self.error_in(block, reason))
            }
            None => Ok(()),
        }
    }

    /// Fails where a block cannot be one of a reversible map.
    fn check_reversible(&self) -> Result<(), Error> {
        let mut own = self.blocks.iter().filter(|block| block.layers.count() > 0);
        let refused = |block: &Block, expected: &str| {
            let reason = Error::invalid("part of a reversible map", block.part.symbol(), expected);
            Err(self.error_in(block, reason))
        };
        let plain = !self.has_circle();
        own.try_for_each(|block| match block.part {
            Part::None if plain => Ok(()),
            Part::None => refused(block, "no map R beside circles, which is not reversible by S"),
            Part::Conjugation => {
                let expected = "no conjugation of order one: ψ∘Φ_θ∘ψ⁻¹ is reversible by ψ∘S∘ψ⁻¹, \
                                which is not S";
                refused(block, expected)
            }
            Part::NearIdentity => refused(block, "a chart ψ_ε in place of I_ε"),
            Part::Chart | Part::Perturbation if !block.scale.has_epsilon() => {
                refused(block, "a scale with ε, to be nearly periodic or nearly integrable")
            }
            _ => Ok(()),
        })
    }

    /// Fails where parts do not go together.
    fn check_parts(&self) -> Result<(), Error> {
        self.reversor.map_or(Ok(()), |_| self.check_reversible())?;
        let first = |part: Part| self.part(part).next();
        let (Some(near_identity), perturbation) =
            (first(Part::NearIdentity), first(Part::Perturbation))
        else {
            return Ok(());
        };
        if let Some(perturbation) = perturbation {
            let found =
                format!("{} beside {}", self.called(near_identity), self.called(perturbation));
            let expected = "one of both: I_ε of a nearly-periodic map, or K_ε in its chart";
            return Err(Error::invalid("blocks", found, expected));
        }
        let mut own = self.part(Part::Chart).chain(self.part(Part::SlowMap));
        match own.find(|block| !block.scale.has_epsilon()) {
            Some(block) => {
                let found = format!(
                    "{}, of order one, beside {}",
                    self.called(block),
                    self.called(near_identity)
                );
                let expected = "chart and slow map scaled by ε beside I_ε";
                Err(Error::invalid("blocks", found, expected))
            }
            None => Ok(()),
        }
    }

    /// The identity over all parameters of the network.
    fn without_steps<P: Real>(&self, epsilon: P, parameters: Vec<P>) -> Composition<P> {
        Composition::new(self.dof, parameters, epsilon).on_controls(self.controls.as_ref())
    }

    /// The steps of these blocks of a part, over all parameters of the network.
    fn steps_of<P: Real>(&self, part: Part, of: &Composition<P>) -> Composition<P> {
        let planes = self.action().and_then(|action| FastPlanes::new(&action).ok());
        let mut out = self.without_steps(of.epsilon(), of.parameters().to_vec());
        for (block, range) in self.blocks.iter().zip(self.block_ranges()) {
            if block.part == part {
                let (start, of) = (range.start, self.surroundings());
                block.push(&mut out, planes.as_ref(), start, of, self.flow_time);
            }
        }
        out
    }

    /// A part alone, over all parameters.
    pub(super) fn composition_of_part<P: Real>(
        &self,
        part: Part,
        epsilon: P,
        parameters: &[P],
    ) -> Composition<P> {
        let over = self.without_steps(epsilon, parameters.to_vec());
        self.steps_of(part, &over)
    }

    /// χ = ψ∘ψ_ε, and K_ε∘Φ_θ∘T_ε. Of a reversible map the chart is the identity.
    pub(super) fn chart_and_inner_map<P: Real>(
        &self,
        epsilon: P,
        parameters: &[P],
    ) -> [Composition<P>; 2] {
        let over = self.without_steps(epsilon, parameters.to_vec());
        let of = |part| self.steps_of(part, &over);
        let (mut chart, mut inner) = (over.clone(), over.clone());
        if let Some(reversor) = self.reversor {
            return [chart, self.reversible_composition(reversor, over)];
        }
        chart.push_all(&of(Part::Chart), 0, Direction::Forward);
        chart.push_all(&of(Part::Conjugation), 0, Direction::Forward);
        inner.push_all(&of(Part::SlowMap), 0, Direction::Forward);
        if let Some(action) = self.action() {
            inner.push_turn(&action, self.angles());
        }
        inner.push_all(&of(Part::Perturbation), 0, Direction::Forward);
        [chart, inner]
    }

    /// The reversible map A∘Φ_θ∘T_ε∘S∘A⁻¹∘S, A = R∘ψ_ε∘K_ε; with slow coordinates, T_ε over half the time begins A
    /// instead.
    fn reversible_composition<P: Real>(
        &self,
        reversor: Reversor,
        over: Composition<P>,
    ) -> Composition<P> {
        let mut half = over.clone();
        // S∘T∘S = T⁻¹ of functions of the actions alone; of slow coordinates it is T_{h/2} that is mirrored.
        let is_mirrored = self.surroundings().slow > 0;
        if is_mirrored {
            let of_half_the_time = Self { flow_time: self.flow_time / 2.0, ..self.clone() };
            half.push_all(&of_half_the_time.steps_of(Part::SlowMap, &over), 0, Direction::Forward);
        }
        for part in [Part::Perturbation, Part::Chart, Part::None] {
            half.push_all(&self.steps_of(part, &over), 0, Direction::Forward);
        }
        let mut out = over.clone();
        out.push_reflection(reversor);
        out.push_all(&half, 0, Direction::Inverse);
        out.push_reflection(reversor);
        if !is_mirrored {
            out.push_all(&self.steps_of(Part::SlowMap, &over), 0, Direction::Forward);
        }
        if let Some(action) = self.action() {
            out.push_turn(&action, self.angles());
        }
        out.push_all(&half, 0, Direction::Forward);
        out
    }

    /// The whole map of the network, R∘I_ε∘χ∘K_ε∘Φ_θ∘T_ε∘χ⁻¹, or its reversible form.
    pub(super) fn composition<P: Real>(&self, epsilon: P, parameters: Vec<P>) -> Composition<P> {
        let [chart, inner] = self.chart_and_inner_map(epsilon, &parameters);
        let mut out = self.without_steps(epsilon, parameters);
        out.push_all(&chart, 0, Direction::Inverse);
        out.push_all(&inner, 0, Direction::Forward);
        out.push_all(&chart, 0, Direction::Forward);
        let rest: &[Part] = match self.reversor {
            Some(_) => &[],
            None => &[Part::NearIdentity, Part::None],
        };
        for &part in rest {
            let steps = self.steps_of(part, &out);
            out.push_all(&steps, 0, Direction::Forward);
        }
        out
    }
}
