//! Blocks: groups of layers of one kind, with the part of the map that they form and their scale.

use super::block_table::{BlockTable, Contents};
use super::composition::Composition;
use super::layers::{Arguments, Layers, Made, Surroundings, Tensor};
use super::part::{Part, Scale};
use crate::error::Error;
use crate::layer::{FastPlanes, Neuron, RidgeFunction};
use crate::scalar::Real;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Layers of one kind, the part of the map that they form, and their scale.
///
/// In TOML and JSON it is one table: `layer` (`henon`, `turned-kick`, `twist`, `turned-twist`,
/// `turned-coupling`, `symp-net`), `widths` (a list, or `{ count, width }`, where `width` is one number or two that
/// alternate) with `degree` and `radius` where its functions are polynomials, or `activation = "arctan"` where its
/// neurons are not of tanh, or for `symp-net` `modules`,
/// `shears`, `activation`, `plain`; `part` (`conjugation`,
/// `chart`, `slow-map`, `perturbation`, `near-identity` or `none`); `scale` (`none`, `epsilon`,
/// `time`, `epsilon-time`; by default the usual one of the part); `name`, the prefix of the names of
/// its tensors (by default that of the part).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "BlockTable", into = "BlockTable")]
pub struct Block {
    /// The prefix of the names of its tensors, followed by a dot. It may be empty if there is only
    /// one block, and there is then no prefix.
    pub name: String,
    /// The part that the block plays in the network.
    pub part: Part,
    /// The factor, of ε and the flow time, that multiplies the increments of its layers.
    pub scale: Scale,
    /// The layers of the block, with their widths.
    pub layers: Layers,
    /// The ridge functions in the potentials of its layers; couplings and modules have none.
    pub ridges: RidgeFunction,
}

impl Block {
    /// A block of these layers for a part, with the usual name and scale of the part.
    pub fn new(part: Part, layers: Layers) -> Self {
        let ridges = RidgeFunction::default();
        Self { name: part.name().into(), part, scale: part.usual_scale(), layers, ridges }
    }

    /// The block with potentials that are polynomials of this degree, 1 to 64: the widths then count
    /// [polynomials](crate::layer::PolynomialPotential), each along its own direction; there is only one
    /// in a kick of one degree of freedom. Their box is that of the pairs
    /// ([`Architecture::in_box_of`]), unless it is [given](Block::in_box).
    ///
    /// [`Architecture::in_box_of`]: crate::network::Architecture::in_box_of
    pub fn of_polynomials(self, degree: usize) -> Self {
        let radius = f64::INFINITY;
        Self { ridges: RidgeFunction::Polynomial { degree, radius }, ..self }
    }

    /// The block with potentials of neurons of this activation.
    pub fn of_neurons(self, neuron: Neuron) -> Self {
        Self { ridges: RidgeFunction::Neurons(neuron), ..self }
    }

    /// The block with this box for its polynomials if they have none: coordinates from −ρ to ρ,
    /// ρ = `radius`.
    pub fn in_box(self, radius: f64) -> Self {
        Self { ridges: self.ridges.in_box(radius), ..self }
    }

    /// The block with another name.
    pub fn named(self, name: impl Into<String>) -> Self {
        Self { name: name.into(), ..self }
    }

    /// The block with another scale.
    pub fn scaled(self, scale: Scale) -> Self {
        Self { scale, ..self }
    }

    /// The name of the stream that its initial weights come from. Blocks of one stream take their
    /// weights one after another.
    pub(super) fn stream(&self) -> String {
        let stream = self.layers.kind().facts().stream;
        if stream.ends_with('/') { format!("{stream}{}", self.name) } else { stream.into() }
    }

    /// The number of parameters of all layers of the block.
    pub(super) fn parameter_count(&self, of: Surroundings) -> usize {
        match &self.layers {
            // It may claim more modules than can be gone through.
            Layers::SympNet(modules) => modules.parameter_count(of.dof),
            layers => (0..layers.count())
                .map(|layer| self.layer_len(layer, of))
                .fold(0, usize::saturating_add),
        }
    }

    /// The number of parameters of the layer of this number.
    pub(super) fn layer_len(&self, layer: usize, of: Surroundings) -> usize {
        let tensors = self.layers.tensors_of(layer, self.ridges, of);
        tensors.iter().map(Tensor::len).fold(0, usize::saturating_add)
    }

    /// Where the parameters of each layer are, the first of the block's being `start`.
    pub(super) fn layer_ranges(&self, start: usize, of: Surroundings) -> Vec<Range<usize>> {
        let mut end = start;
        let range = |layer| {
            let begin = end;
            end += self.layer_len(layer, of);
            begin..end
        };
        (0..self.layers.count()).map(range).collect()
    }

    /// All tensors, each with the name that files give it, in the order of the parameters.
    pub(super) fn tensors(&self, of: Surroundings) -> Vec<(String, Tensor)> {
        let block = if self.name.is_empty() { String::new() } else { format!("{}.", self.name) };
        let of_layer = |layer| {
            let prefix = format!("{block}{}", self.layers.tensor_prefix(layer));
            let tensors = self.layers.tensors_of(layer, self.ridges, of).into_iter();
            tensors.map(move |tensor| (format!("{prefix}.{}", tensor.name), tensor))
        };
        (0..self.layers.count()).flat_map(of_layer).collect()
    }

    /// Appends its steps to a composition, whose parameters from `start` on are its own.
    pub(super) fn push<P: Real>(
        &self,
        out: &mut Composition<P>,
        planes: Option<&FastPlanes>,
        start: usize,
        of: Surroundings,
        flow_time: f64,
    ) {
        let made = Made {
            function: self.ridges,
            near_identity: self.scale.has_epsilon(),
            time: self.scale.time(flow_time),
        };
        self.layers.push(out, planes, start, &self.layer_ranges(start, of), made);
    }

    /// Fails unless its layers can play its part, in a network with circles or without.
    pub(super) fn check(&self, of: Surroundings, has_circles: bool) -> Result<(), Error> {
        let refused = |found: &str, expected: &str| Err(Error::invalid("layers", found, expected));
        let sane = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if !self.name.chars().all(sane) {
            let expected = "letters, digits, - and _";
            return Err(Error::invalid("name of a block", format!("`{}`", self.name), expected));
        }
        let (kind, facts) = (self.layers.kind(), self.layers.kind().facts());
        match &self.layers {
            Layers::SympNet(modules) => {
                let (count, shears) = (modules.modules, modules.shears);
                Error::check_count_range("linear modules", count, 1, usize::MAX)?;
                Error::check_count_range("shears of a linear module", shears, 1, usize::MAX)?;
            }
            layers => {
                self.ridges.check()?;
                let empty = |layer: &usize| {
                    let len = || self.layer_len(*layer, of);
                    layers.widths()[*layer] == 0 && !(facts.forms_alone && len() > 0)
                };
                if let Some(layer) = (0..layers.count()).find(empty) {
                    let found = format!("a layer of width 0 (number {layer})");
                    return refused(&found, "at least one neuron");
                }
            }
        }
        if self.ridges != RidgeFunction::default() && facts.arguments.is_none() {
            let ridges = match self.ridges {
                RidgeFunction::Neurons(neuron) => format!("neurons of {}", neuron.name()),
                RidgeFunction::Polynomial { .. } => "polynomials".into(),
            };
            let found = format!("{ridges} in {}", kind.plural());
            return refused(&found, "kicks, Hénon layers or twists");
        }
        if self.ridges.is_polynomial() {
            let arguments = match facts.arguments {
                Some(Arguments::ActionsAndSlow) => of.arguments,
                Some(Arguments::Coordinates) | None => of.dof,
            };
            let wide = self.layers.widths().iter().find(|width| **width > 1);
            if let (Some(width), 1) = (wide, arguments) {
                let found = format!("{width} polynomials of one number in a layer");
                return refused(&found, "one: their sum is a polynomial too");
            }
        }
        if !has_circles && (kind.commutes_with_circles() || self.needs_circles()) {
            let found =
                format!("{} as {}, without a circle action", kind.plural(), self.part.name());
            return refused(&found, "a circle action");
        }
        if facts.turns_slow_planes && self.layers.count() > 0 && of.slow == 0 {
            let found = "turned twists, where no plane is slow";
            return refused(found, "a plane that no circle turns, or twists");
        }
        let has_epsilon = self.scale.has_epsilon();
        match self.part {
            Part::Conjugation if self.scale != Scale::None => refused(
                &format!("scaled by {}", self.scale.name()),
                "no scale: a conjugation ψ of order one",
            ),
            Part::SlowMap if !kind.commutes_with_circles() => {
                refused(kind.plural(), "twists: a slow map commutes with the circle action")
            }
            Part::Perturbation | Part::NearIdentity if !has_epsilon => refused(
                &format!("scaled by {}", self.scale.name()),
                "a scale with ε: the identity at ε = 0",
            ),
            _ => Ok(()),
        }
    }

    /// Whether its part is one of a map that is built on a circle action.
    fn needs_circles(&self) -> bool {
        matches!(self.part, Part::Conjugation | Part::Chart | Part::SlowMap | Part::Perturbation)
    }

    /// Whether a network with it is built on a circle action where one is at hand.
    pub(super) fn is_of_circles(&self) -> bool {
        self.part != Part::None || self.layers.kind().commutes_with_circles()
    }
}

impl TryFrom<BlockTable> for Block {
    type Error = Error;

    fn try_from(table: BlockTable) -> Result<Self, Error> {
        let Contents { name, part, scale, layers, ridges } = table.contents()?;
        Ok(Self { name, part, scale, layers, ridges })
    }
}

impl From<Block> for BlockTable {
    fn from(block: Block) -> Self {
        let Block { name, part, scale, layers, ridges } = block;
        Self::new(Contents { name, part, scale, layers, ridges })
    }
}
