//! Blocks: groups of layers of one kind, with the part of the map that they form and their scale.

use super::composition::Composition;
use super::init::{InitialWeights, Law, inner_bound, outer_bound};
use super::step::{Kind, Step};
use crate::error::{Error, block_called};
use crate::layer::{
    Activation, FastPlanes, KickForm, Neuron, RidgeFunction, Ridges, TwistShears, symmetric_len,
};
use crate::phase::Half;
use crate::random::Stream;
use crate::scalar::Real;
use serde::de::{Deserializer, Error as _, SeqAccess};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::Arc;

/// The part that a block plays in the map
///
/// P = R∘I_ε∘χ∘K_ε∘Φ_θ∘T_ε∘χ⁻¹, χ = ψ∘ψ_ε,
///
/// A part without a block is the identity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// ψ, which conjugates the circle action.
    Conjugation,
    /// ψ_ε, the near-identity part of the chart χ.
    Chart,
    /// T_ε, the slow map: it commutes with the circle action.
    SlowMap,
    /// K_ε, the perturbation, in the coordinates of the chart.
    Perturbation,
    /// I_ε, the near-identity map, in the coordinates of the data.
    NearIdentity,
    /// R, a map of no circle action.
    None,
}

impl Part {
    /// All parts, in the order of their parameters in the named architectures.
    pub const ALL: [Self; 6] = [
        Self::Conjugation,
        Self::Chart,
        Self::SlowMap,
        Self::Perturbation,
        Self::NearIdentity,
        Self::None,
    ];

    /// The symbol of the part in equations.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Conjugation => "ψ",
            Self::Chart => "ψ_ε",
            Self::SlowMap => "T_ε",
            Self::Perturbation => "K_ε",
            Self::NearIdentity => "I_ε",
            Self::None => "R",
        }
    }

    /// What scales a block of this part, unless it says so.
    fn usual_scale(self) -> Scale {
        match self {
            Self::Conjugation | Self::None => Scale::None,
            Self::Chart | Self::Perturbation | Self::NearIdentity => Scale::Epsilon,
            Self::SlowMap => Scale::EpsilonTime,
        }
    }

    /// The name of the part in files.
    fn name(self) -> &'static str {
        match self {
            Self::Conjugation => "conjugation",
            Self::Chart => "chart",
            Self::SlowMap => "slow-map",
            Self::Perturbation => "perturbation",
            Self::NearIdentity => "near-identity",
            Self::None => "none",
        }
    }
}

/// The factor of the increments of a block's layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// No scale: the factor is 1.
    None,
    /// ε: the block is the identity at ε = 0.
    Epsilon,
    /// The flow time h as the factor.
    Time,
    /// εh, the product of ε and the flow time.
    EpsilonTime,
}

impl Scale {
    /// Whether ε is a factor.
    pub fn has_epsilon(self) -> bool {
        matches!(self, Self::Epsilon | Self::EpsilonTime)
    }

    /// Whether the flow time is a factor.
    pub fn has_time(self) -> bool {
        matches!(self, Self::Time | Self::EpsilonTime)
    }

    /// The factor in words.
    fn name(self) -> &'static str {
        match self {
            Self::None => "1",
            Self::Epsilon => "ε",
            Self::Time => "h",
            Self::EpsilonTime => "εh",
        }
    }

    /// The factor beside ε, for this flow time.
    fn time(self, flow_time: f64) -> Option<f64> {
        self.has_time().then_some(flow_time)
    }
}

/// A kind of layer, with its widths: the number of neurons of each layer, in the order of
/// application.
#[derive(Clone, Debug, PartialEq)]
pub enum Layers {
    /// [Hénon layers](crate::layer::HenonLayer) of four kicks each, with these widths.
    Henon(Vec<usize>),
    /// [Kicks in turned coordinates](crate::layer::TurnedKick), with these widths.
    TurnedKick(Vec<usize>),
    /// The shears of one [twist](crate::layer::Twist): the first, the third and so on change the
    /// positions and have a quadratic form in addition to neurons, of which they need few or none.
    Twist(Vec<usize>),
    /// [Twists in turned coordinates of the slow planes](crate::layer::TwistShears::turned).
    TurnedTwist(Vec<usize>),
    /// [Affine couplings in turned coordinates](crate::layer::TurnedCoupling), which are not
    /// symplectic.
    TurnedCoupling(Vec<usize>),
    /// The [modules](crate::layer::LinearModule) of a SympNet.
    SympNet(Modules),
}

/// Linear modules with an activation module between each two of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Modules {
    /// The number of linear modules.
    pub modules: usize,
    /// The number of linear shears in each linear module.
    pub shears: usize,
    /// σ of the activation modules.
    pub activation: Activation,
    /// Activation modules have no parameters, a = 1, and no translation follows the
    /// last linear module.
    pub plain: bool,
}

/// What layers have to know of the network that they are in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surroundings {
    /// The degrees of freedom n.
    pub(super) dof: usize,
    /// d, the numbers that the functions of twists are of: the actions and half the slow
    /// coordinates.
    pub(super) arguments: usize,
    /// The planes that no circle turns.
    pub(super) slow: usize,
}

/// A tensor of a layer, and the law of its numbers before training.
pub(super) struct Tensor {
    pub(super) name: &'static str,
    pub(super) shape: [usize; 2],
    pub(super) law: Law,
}

impl Tensor {
    fn new(name: &'static str, shape: [usize; 2], law: Law) -> Self {
        Self { name, shape, law }
    }

    /// How many numbers it has.
    pub(super) fn len(&self) -> usize {
        self.shape[0].saturating_mul(self.shape[1])
    }
}

/// The tensors of a potential of so many arguments: W, b and w of neurons, W and the coefficients
/// of polynomials.
fn potential(arguments: usize, ridges: Ridges) -> Vec<Tensor> {
    let width = ridges.width;
    match ridges.function {
        RidgeFunction::Neurons(_) => {
            let inner = Law::Uniform(inner_bound(arguments, width));
            vec![
                Tensor::new("w_in", [arguments, width], inner),
                Tensor::new("b_in", [1, width], inner),
                Tensor::new("w_out", [width, 1], Law::Uniform(outer_bound(width))),
            ]
        }
        RidgeFunction::Polynomial { degree, .. } => {
            let directions = Law::Direction { arguments };
            let w_in = Tensor::new("w_in", [arguments, width], directions);
            let law = Law::Coefficient { degree };
            let coefficients = Tensor::new("coefficients", [degree, width], law);
            let has_directions = arguments > 1;
            has_directions.then_some(w_in).into_iter().chain([coefficients]).collect()
        }
    }
}

impl Modules {
    /// Whether a translation ends the linear module of this number.
    fn translates(&self, module: usize) -> bool {
        !self.plain || module + 1 < self.modules
    }

    /// The numbers of one symmetric matrix.
    fn entries(dof: usize) -> usize {
        symmetric_len(dof)
    }

    fn parameter_count(&self, dof: usize) -> usize {
        let Some(last) = self.modules.checked_sub(1) else { return 0 };
        // Nothing is taken from what may be saturated.
        let matrices = self.shears.saturating_mul(Self::entries(dof));
        let linear = matrices.saturating_add(dof.saturating_mul(2));
        let activation = if self.plain { 0 } else { dof };
        let end = if self.plain { matrices } else { linear };
        last.saturating_mul(linear.saturating_add(activation)).saturating_add(end)
    }
}

impl Layers {
    /// The number of layers; for a SympNet, that of its linear and activation modules.
    pub fn count(&self) -> usize {
        match self {
            Self::Henon(widths)
            | Self::TurnedKick(widths)
            | Self::Twist(widths)
            | Self::TurnedTwist(widths)
            | Self::TurnedCoupling(widths) => widths.len(),
            Self::SympNet(modules) => modules.modules.saturating_mul(2).saturating_sub(1),
        }
    }

    /// The number of neurons of each layer; empty for a SympNet.
    pub fn widths(&self) -> &[usize] {
        match self {
            Self::Henon(widths)
            | Self::TurnedKick(widths)
            | Self::Twist(widths)
            | Self::TurnedTwist(widths)
            | Self::TurnedCoupling(widths) => widths,
            Self::SympNet(_) => &[],
        }
    }

    /// The same kind of layer with other widths; modules stay what they are.
    pub(super) fn with_widths(&self, widths: Vec<usize>) -> Self {
        match self {
            Self::Henon(_) => Self::Henon(widths),
            Self::TurnedKick(_) => Self::TurnedKick(widths),
            Self::Twist(_) => Self::Twist(widths),
            Self::TurnedTwist(_) => Self::TurnedTwist(widths),
            Self::TurnedCoupling(_) => Self::TurnedCoupling(widths),
            Self::SympNet(modules) => Self::SympNet(*modules),
        }
    }

    /// The name of the kind of layer in files.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Henon(_) => "henon",
            Self::TurnedKick(_) => "turned-kick",
            Self::Twist(_) => "twist",
            Self::TurnedTwist(_) => "turned-twist",
            Self::TurnedCoupling(_) => "turned-coupling",
            Self::SympNet(_) => "symp-net",
        }
    }

    /// The plural of the kind of layer in words.
    pub fn words(&self) -> &'static str {
        match self {
            Self::Henon(_) => "Hénon layers",
            Self::TurnedKick(_) => "turned kicks",
            Self::Twist(_) => "twist shears",
            Self::TurnedTwist(_) => "turned twists",
            Self::TurnedCoupling(_) => "couplings",
            Self::SympNet(_) => "SympNet modules",
        }
    }

    /// Whether they are symplectic for all weights.
    pub fn is_symplectic(&self) -> bool {
        !matches!(self, Self::TurnedCoupling(_))
    }

    /// Whether they commute with the circle action for all weights, and so can be a slow map.
    pub fn commutes_with_circles(&self) -> bool {
        matches!(self, Self::Twist(_) | Self::TurnedTwist(_))
    }

    /// Whether the layers rotate planes (q_j, p_j).
    pub(super) fn is_of_planes(&self) -> bool {
        !matches!(self, Self::Henon(_) | Self::SympNet(_))
    }

    /// Whether they are defined by the planes of the circle action.
    pub fn needs_circles(&self) -> bool {
        self.commutes_with_circles()
    }

    /// What stands before a layer's number in the names of its tensors, beside the block's name.
    fn tensor_prefix(&self, layer: usize) -> String {
        match self {
            Self::SympNet(_) if layer.is_multiple_of(2) => format!("linear.{}", layer / 2),
            Self::SympNet(_) => format!("activation.{}", layer / 2),
            _ => layer.to_string(),
        }
    }

    /// The tensors of the layer of this number.
    fn tensors_of(&self, layer: usize, function: RidgeFunction, of: Surroundings) -> Vec<Tensor> {
        let Surroundings { dof: n, arguments: d, slow } = of;
        let ridges = |widths: &[usize]| Ridges { width: widths[layer], function };
        match self {
            Self::Henon(widths) => {
                let eta = Law::Uniform(inner_bound(n, widths[layer]));
                let mut out = potential(n, ridges(widths));
                out.push(Tensor::new("eta", [1, n], eta));
                out
            }
            Self::TurnedKick(widths) => {
                let mut out = vec![Tensor::new("angles", [1, n], Law::Angle)];
                out.extend(potential(n, ridges(widths)));
                out
            }
            Self::Twist(widths) => {
                let mut out = potential(d, ridges(widths));
                let form = function.form_len(layer, d);
                if form > 0 {
                    let law = Law::Curvature { arguments: d, width: widths[layer] };
                    out.push(Tensor::new("quadratic", [1, form], law));
                }
                out
            }
            Self::TurnedTwist(widths) => {
                let mut out = vec![Tensor::new("angles", [1, slow], Law::Angle)];
                out.extend(potential(d, ridges(widths)));
                out
            }
            Self::TurnedCoupling(widths) => {
                let h = widths[layer];
                let inner = Law::Uniform(inner_bound(n, h));
                let outer = Law::Uniform(0.1 * (6.0 / (h as f64 + n as f64)).sqrt());
                vec![
                    Tensor::new("angles", [1, n], Law::Angle),
                    Tensor::new("w_in", [n, h], inner),
                    Tensor::new("b_in", [1, h], inner),
                    Tensor::new("w_scale", [n, h], outer),
                    Tensor::new("b_scale", [1, n], outer),
                    Tensor::new("w_shift", [n, h], outer),
                    Tensor::new("b_shift", [1, n], outer),
                ]
            }
            Self::SympNet(of) => {
                let law = Law::Uniform((3.0 / n as f64).sqrt());
                if !layer.is_multiple_of(2) {
                    let count = if of.plain { 0 } else { n };
                    return Vec::from_iter(
                        (count > 0).then(|| Tensor::new("factors", [1, count], law)),
                    );
                }
                let entries = Modules::entries(n);
                let mut out = vec![Tensor::new("matrices", [of.shears, entries], law)];
                if of.translates(layer / 2) {
                    out.push(Tensor::new("translation", [1, 2 * n], law));
                }
                out
            }
        }
    }

    /// Appends the steps of all layers, their parameters being those from `start` on.
    fn push<P: Real>(
        &self,
        out: &mut Composition<P>,
        planes: Option<&FastPlanes>,
        start: usize,
        ranges: &[Range<usize>],
        made: Made,
    ) {
        let Made { function, near_identity, time } = made;
        let step =
            |kind, parameters| Step { kind, parameters, inverse: false, near_identity, time };
        let widths = self.widths().iter().copied().zip(ranges.iter().cloned());
        match self {
            Self::Henon(_) => {
                for (width, range) in widths {
                    let ridges = Ridges { width, function };
                    for form in KickForm::LAYER {
                        out.push(step(Kind::Kick { ridges, form }, range.clone()));
                    }
                }
            }
            Self::TurnedKick(_) => {
                for (width, range) in widths {
                    let (ridges, prepared) = (Ridges { width, function }, out.prepare(&range));
                    out.push(step(Kind::TurnedKick { ridges, prepared }, range));
                }
            }
            Self::TurnedCoupling(_) => {
                for (width, range) in widths {
                    let prepared = out.prepare(&range);
                    out.push(step(Kind::TurnedCoupling { width, prepared }, range));
                }
            }
            Self::Twist(all) | Self::TurnedTwist(all) => {
                let planes = planes.expect("a twist without planes is refused").clone();
                let turned = matches!(self, Self::TurnedTwist(_));
                let shears = Arc::new(TwistShears::with_function(planes, all, function, turned));
                let prepared = turned.then(|| out.prepare_slow(&shears, start));
                let end = ranges.last().map_or(start, |last| last.end);
                out.push(step(Kind::Twist { shears, prepared }, start..end));
            }
            Self::SympNet(of) => {
                for (layer, range) in ranges.iter().cloned().enumerate() {
                    let module = layer / 2;
                    out.push(step(
                        match layer.is_multiple_of(2) {
                            true => Kind::Linear {
                                first: Half::Momentum,
                                translated: of.translates(module),
                            },
                            false => Kind::Activation {
                                activation: of.activation,
                                target: match module.is_multiple_of(2) {
                                    true => Half::Position,
                                    false => Half::Momentum,
                                },
                            },
                        },
                        range,
                    ));
                }
            }
        }
    }
}

/// What steps are made of and multiplied by: ridge functions; ε or 1, and a flow time.
#[derive(Clone, Copy)]
struct Made {
    function: RidgeFunction,
    near_identity: bool,
    time: Option<f64>,
}

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
        match &self.layers {
            Layers::Henon(_) => format!("weights/{}", self.name),
            Layers::TurnedKick(_) | Layers::Twist(_) | Layers::TurnedTwist(_) => {
                "weights/normal-form".into()
            }
            Layers::TurnedCoupling(_) => format!("weights/couplings/{}", self.name),
            Layers::SympNet(_) => "weights/symp-net".into(),
        }
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
        match &self.layers {
            Layers::SympNet(modules) => {
                let (count, shears) = (modules.modules, modules.shears);
                Error::check_count_range("linear modules", count, 1, usize::MAX)?;
                Error::check_count_range("shears of a linear module", shears, 1, usize::MAX)?;
            }
            layers => {
                self.ridges.check()?;
                let empty = |layer: &usize| match layers {
                    Layers::Twist(_) => self.layer_len(*layer, of) == 0,
                    _ => layers.widths()[*layer] == 0,
                };
                if let Some(layer) = (0..layers.count()).find(empty) {
                    let found = format!("a layer of width 0 (number {layer})");
                    return refused(&found, "at least one neuron");
                }
            }
        }
        let has_potentials = !matches!(self.layers, Layers::TurnedCoupling(_) | Layers::SympNet(_));
        if self.ridges != RidgeFunction::default() && !has_potentials {
            let ridges = match self.ridges {
                RidgeFunction::Neurons(neuron) => format!("neurons of {}", neuron.name()),
                RidgeFunction::Polynomial { .. } => "polynomials".into(),
            };
            let found = format!("{ridges} in {}", self.layers.words());
            return refused(&found, "kicks, Hénon layers or twists");
        }
        if self.ridges.is_polynomial() {
            let arguments = if self.layers.needs_circles() { of.arguments } else { of.dof };
            let wide = self.layers.widths().iter().find(|width| **width > 1);
            if let (Some(width), 1) = (wide, arguments) {
                let found = format!("{width} polynomials of one number in a layer");
                return refused(&found, "one: their sum is a polynomial too");
            }
        }
        if !has_circles && (self.layers.needs_circles() || self.needs_circles()) {
            let found =
                format!("{} as {}, without a circle action", self.layers.words(), self.part.name());
            return refused(&found, "a circle action");
        }
        let turns_slow = matches!(self.layers, Layers::TurnedTwist(_)) && self.layers.count() > 0;
        if turns_slow && of.slow == 0 {
            let found = "turned twists, where no plane is slow";
            return refused(found, "a plane that no circle turns, or twists");
        }
        let has_epsilon = self.scale.has_epsilon();
        match self.part {
            Part::Conjugation if self.scale != Scale::None => refused(
                &format!("scaled by {}", self.scale.name()),
                "no scale: a conjugation ψ of order one",
            ),
            Part::SlowMap if !self.layers.commutes_with_circles() => {
                refused(self.layers.words(), "twists: a slow map commutes with the circle action")
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
        self.part != Part::None || self.layers.needs_circles()
    }
}

/// Widths as files have them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "widths that are neither a list nor { count, width }")]
enum Widths {
    List(Vec<usize>),
    Uniform(Uniform),
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Uniform {
    count: usize,
    width: Alternating,
}

/// One width for all layers, or two that alternate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged, expecting = "a width that is neither a number of neurons nor two by turns")]
pub enum Alternating {
    /// One width that all layers have.
    Same(usize),
    /// The width of the first, the third and so on, and that of the others.
    Two([usize; 2]),
}

impl Alternating {
    /// The widths of the first and of the second layer.
    pub fn two(self) -> [usize; 2] {
        match self {
            Self::Same(width) => [width; 2],
            Self::Two(widths) => widths,
        }
    }

    /// The widths of `count` layers.
    pub fn widths(self, count: usize) -> Vec<usize> {
        self.two().into_iter().cycle().take(count).collect()
    }
}

/// More layers are a mistake in a file.
pub(super) const MOST_LAYERS: usize = 100_000;

impl Widths {
    fn list(self) -> Result<Vec<usize>, Error> {
        match self {
            Self::List(widths) => Ok(widths),
            Self::Uniform(Uniform { count, width }) => {
                Error::check_count_range("layers", count, 0, MOST_LAYERS)?;
                Ok(width.widths(count))
            }
        }
    }
}

/// The name of a kind of layer.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum LayerName {
    Henon,
    TurnedKick,
    Twist,
    TurnedTwist,
    TurnedCoupling,
    SympNet,
}

/// A block as files have it.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct BlockTable {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    #[serde(default = "no_part")]
    part: Part,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    scale: Option<Scale>,
    layer: LayerName,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    widths: Option<Widths>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    degree: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    radius: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    modules: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    shears: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    activation: Option<ActivationName>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    plain: Option<bool>,
}

/// The activation of neurons, or of the modules of a SympNet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "an activation other than sigmoid, tanh or sech2 of a SympNet, tanh or arctan of neurons"
)]
enum ActivationName {
    Module(Activation),
    Neurons(Neuron),
}

impl ActivationName {
    /// That of a SympNet, or what it is.
    fn of_module(self) -> Result<Activation, &'static str> {
        match self {
            Self::Module(activation) => Ok(activation),
            Self::Neurons(neuron) => Err(neuron.name()),
        }
    }

    /// That of neurons, or what it is.
    fn of_neurons(self) -> Result<Neuron, &'static str> {
        match self {
            Self::Module(Activation::Tanh) => Ok(Neuron::Tanh),
            Self::Module(Activation::Sigmoid) => Err("sigmoid"),
            Self::Module(Activation::Sech2) => Err("sech2"),
            Self::Neurons(neuron) => Ok(neuron),
        }
    }
}

fn no_part() -> Part {
    Part::None
}

/// Reads a list of blocks from a format whose errors name no line: that of a block that cannot be read has its number.
pub(super) fn read_blocks<'de, D: Deserializer<'de>>(tables: D) -> Result<Vec<Block>, D::Error> {
    struct List;

    impl<'de> serde::de::Visitor<'de> for List {
        type Value = Vec<Block>;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("a list of blocks")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut tables: A) -> Result<Vec<Block>, A::Error> {
            let mut blocks = Vec::new();
            loop {
                let reason = match tables.next_element() {
                    Ok(Some(block)) => {
                        blocks.push(block);
                        continue;
                    }
                    Ok(None) => return Ok(blocks),
                    Err(reason) => reason,
                };
                let place = block_called(blocks.len(), "");
                return Err(A::Error::custom(format_args!(
                    "{place}: {}",
                    reason.to_string().trim_end()
                )));
            }
        }
    }

    tables.deserialize_seq(List)
}

impl TryFrom<BlockTable> for Block {
    type Error = Error;

    fn try_from(table: BlockTable) -> Result<Self, Error> {
        let BlockTable { name, part, scale, layer, widths, degree, radius, .. } = table;
        let BlockTable { modules, shears, activation, plain, .. } = table;
        let name = name.unwrap_or_else(|| part.name().into());
        let missing = |key: &'static str| Error::Missing {
            place: format!("block `{name}`"),
            key,
            needed_by: "its layers".into(),
        };
        let superfluous = |key: &str, expected: &str| {
            let name = format!("block `{name}`");
            Err(Error::invalid(&name, format!("the key `{key}`"), expected))
        };
        let layers = if let LayerName::SympNet = layer {
            if widths.is_some() {
                return superfluous("widths", "modules and shears of a SympNet");
            }
            Layers::SympNet(Modules {
                modules: modules.ok_or_else(|| missing("modules"))?,
                shears: shears.ok_or_else(|| missing("shears"))?,
                activation: { activation.ok_or_else(|| missing("activation"))?.of_module() }
                    .map_err(|found| {
                        Error::invalid("activation", found, "sigmoid, tanh or sech2")
                    })?,
                plain: plain.unwrap_or(false),
            })
        } else {
            let given = [
                ("modules", modules.is_some()),
                ("shears", shears.is_some()),
                ("plain", plain.is_some()),
            ];
            if let Some((key, _)) = given.into_iter().find(|(_, given)| *given) {
                return superfluous(key, "widths, of layers that are no SympNet");
            }
            let widths = widths.ok_or_else(|| missing("widths"))?.list()?;
            match layer {
                LayerName::Henon => Layers::Henon(widths),
                LayerName::TurnedKick => Layers::TurnedKick(widths),
                LayerName::Twist => Layers::Twist(widths),
                LayerName::TurnedTwist => Layers::TurnedTwist(widths),
                LayerName::TurnedCoupling | LayerName::SympNet => Layers::TurnedCoupling(widths),
            }
        };
        let of_neurons = match activation {
            Some(activation) if !matches!(layers, Layers::SympNet(_)) => {
                let invalid =
                    |found| Error::invalid("activation", found, "tanh or arctan of neurons");
                Some(activation.of_neurons().map_err(invalid)?)
            }
            _ => None,
        };
        let ridges = match (degree, radius) {
            (Some(_), _) if of_neurons.is_some() => {
                return superfluous(
                    "activation",
                    "a degree of polynomials, or an activation of neurons",
                );
            }
            (Some(degree), radius) => {
                RidgeFunction::Polynomial { degree, radius: radius.unwrap_or(f64::INFINITY) }
            }
            (None, None) => RidgeFunction::Neurons(of_neurons.unwrap_or_default()),
            (None, Some(_)) => {
                return superfluous("radius", "a degree with it: the box is that of polynomials");
            }
        };
        Ok(Self { name, part, scale: scale.unwrap_or(part.usual_scale()), layers, ridges })
    }
}

impl From<Block> for BlockTable {
    fn from(block: Block) -> Self {
        let Block { name, part, scale, layers, ridges } = block;
        let (degree, radius) = match ridges {
            RidgeFunction::Neurons(_) => (None, None),
            RidgeFunction::Polynomial { degree, radius } => {
                (Some(degree), Some(radius).filter(|radius| radius.is_finite()))
            }
        };
        // Files without it are of tanh.
        let activation = match ridges {
            RidgeFunction::Neurons(neuron) if neuron != Neuron::default() => {
                Some(ActivationName::Neurons(neuron))
            }
            _ => None,
        };
        let mut table = Self {
            name: Some(name),
            part,
            scale: Some(scale),
            layer: LayerName::SympNet,
            widths: None,
            degree,
            radius,
            modules: None,
            shears: None,
            activation,
            plain: None,
        };
        let (layer, widths) = match layers {
            Layers::Henon(widths) => (LayerName::Henon, widths),
            Layers::TurnedKick(widths) => (LayerName::TurnedKick, widths),
            Layers::Twist(widths) => (LayerName::Twist, widths),
            Layers::TurnedTwist(widths) => (LayerName::TurnedTwist, widths),
            Layers::TurnedCoupling(widths) => (LayerName::TurnedCoupling, widths),
            Layers::SympNet(Modules { modules, shears, activation, plain }) => {
                table.modules = Some(modules);
                table.shears = Some(shears);
                table.activation = Some(ActivationName::Module(activation));
                table.plain = Some(plain);
                return table;
            }
        };
        Self { layer, widths: Some(Widths::List(widths)), ..table }
    }
}

impl InitialWeights {
    /// The parameters of one Hénon layer, `[W (n × h, row by row), b (h), w (h), η (n)]`.
    pub fn layer(self, dof: usize, width: usize, stream: &mut Stream) -> Vec<f64> {
        let tensors = Layers::Henon(vec![width]).tensors_of(
            0,
            RidgeFunction::default(),
            Surroundings { dof, arguments: 0, slow: 0 },
        );
        let of = |tensor: Tensor| vec![tensor.law; tensor.len()];
        let laws: Vec<Law> = tensors.into_iter().flat_map(of).collect();
        laws.into_iter().map(|law| self.draw(law, stream)).collect()
    }
}
