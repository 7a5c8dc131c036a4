//! Kinds of layers: what each is for all weights and widths, its tensors and its steps.
//!
//! A new kind is a variant of [`LayerKind`] and of [`Layers`] with its [`Facts`], its tensors and its steps. All else,
//! from files and messages to the checks of a block, goes by these.

use super::composition::Composition;
use super::init::{InitialWeights, Law, inner_bound, outer_bound};
use super::step::{Kind, Step};
use crate::layer::{
    Activation, FastPlanes, KickForm, RidgeFunction, Ridges, TwistShears, symmetric_len,
};
use crate::phase::Half;
use crate::random::Stream;
use crate::scalar::Real;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::Arc;

/// The kinds of layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LayerKind {
    /// [Hénon layers](crate::layer::HenonLayer) of four kicks each.
    Henon,
    /// [Kicks in turned coordinates](crate::layer::TurnedKick).
    TurnedKick,
    /// The shears of one [twist](crate::layer::Twist).
    Twist,
    /// [Twists in turned coordinates of the slow planes](crate::layer::TwistShears::turned).
    TurnedTwist,
    /// [Affine couplings in turned coordinates](crate::layer::TurnedCoupling).
    TurnedCoupling,
    /// The [modules](crate::layer::LinearModule) of a SympNet.
    SympNet,
}

/// What the potentials of layers are functions of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arguments {
    /// n coordinates: positions, momenta, or positions in turned coordinates.
    Coordinates,
    /// The actions and half of the slow coordinates.
    ActionsAndSlow,
}

/// What a kind of layer is for all weights and widths.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facts {
    /// The name in files.
    name: &'static str,
    /// The plural in words.
    words: &'static str,
    /// Whether layers are symplectic.
    symplectic: bool,
    /// Whether layers commute with the circle action, by whose planes they are defined.
    commutes_with_circles: bool,
    /// Whether layers rotate planes (q_j, p_j).
    of_planes: bool,
    /// Whether layers turn the slow planes.
    pub(super) turns_slow_planes: bool,
    /// What their potentials are functions of; without potentials none.
    pub(super) arguments: Option<Arguments>,
    /// Whether a layer of width 0 may have parameters, those of a quadratic form.
    pub(super) forms_alone: bool,
    /// The stream of initial weights. A name that ends in / is followed by the block's name; otherwise all blocks
    /// share the stream.
    pub(super) stream: &'static str,
}

impl LayerKind {
    pub(super) fn facts(self) -> Facts {
        match self {
            Self::Henon => Facts {
                name: "henon",
                words: "Hénon layers",
                symplectic: true,
                commutes_with_circles: false,
                of_planes: false,
                turns_slow_planes: false,
                arguments: Some(Arguments::Coordinates),
                forms_alone: false,
                stream: "weights/",
            },
            Self::TurnedKick => Facts {
                name: "turned-kick",
                words: "turned kicks",
                symplectic: true,
                commutes_with_circles: false,
                of_planes: true,
                turns_slow_planes: false,
                arguments: Some(Arguments::Coordinates),
                forms_alone: false,
                stream: "weights/normal-form",
            },
            Self::Twist => Facts {
                name: "twist",
                words: "twist shears",
                symplectic: true,
                commutes_with_circles: true,
                of_planes: true,
                turns_slow_planes: false,
                arguments: Some(Arguments::ActionsAndSlow),
                forms_alone: true,
                stream: "weights/normal-form",
            },
            Self::TurnedTwist => Facts {
                name: "turned-twist",
                words: "turned twists",
                symplectic: true,
                commutes_with_circles: true,
                of_planes: true,
                turns_slow_planes: true,
                arguments: Some(Arguments::ActionsAndSlow),
                forms_alone: false,
                stream: "weights/normal-form",
            },
            Self::TurnedCoupling => Facts {
                name: "turned-coupling",
                words: "couplings",
                symplectic: false,
                commutes_with_circles: false,
                of_planes: true,
                turns_slow_planes: false,
                arguments: None,
                forms_alone: false,
                stream: "weights/couplings/",
            },
            Self::SympNet => Facts {
                name: "symp-net",
                words: "SympNet modules",
                symplectic: true,
                commutes_with_circles: false,
                of_planes: false,
                turns_slow_planes: false,
                arguments: None,
                forms_alone: false,
                stream: "weights/symp-net",
            },
        }
    }

    /// The name in files.
    pub fn name(self) -> &'static str {
        self.facts().name
    }

    /// The plural in words.
    pub fn plural(self) -> &'static str {
        self.facts().words
    }

    /// Whether layers of this kind are symplectic for all weights.
    pub fn is_symplectic(self) -> bool {
        self.facts().symplectic
    }

    /// Whether they commute with the circle action for all weights, and so can be a slow map.
    ///
    /// The planes of the circle action define such layers, so that there are none without it.
    pub fn commutes_with_circles(self) -> bool {
        self.facts().commutes_with_circles
    }

    /// Whether the layers rotate planes (q_j, p_j).
    pub(super) fn is_of_planes(self) -> bool {
        self.facts().of_planes
    }

    /// Layers of these widths; of modules, which have none, nothing.
    pub(super) fn with_widths(self, widths: Vec<usize>) -> Option<Layers> {
        Some(match self {
            Self::Henon => Layers::Henon(widths),
            Self::TurnedKick => Layers::TurnedKick(widths),
            Self::Twist => Layers::Twist(widths),
            Self::TurnedTwist => Layers::TurnedTwist(widths),
            Self::TurnedCoupling => Layers::TurnedCoupling(widths),
            Self::SympNet => return None,
        })
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

    pub(super) fn parameter_count(&self, dof: usize) -> usize {
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
    /// The kind of layer, with its widths or its modules.
    fn parts(&self) -> (LayerKind, Result<&[usize], &Modules>) {
        match self {
            Self::Henon(widths) => (LayerKind::Henon, Ok(widths)),
            Self::TurnedKick(widths) => (LayerKind::TurnedKick, Ok(widths)),
            Self::Twist(widths) => (LayerKind::Twist, Ok(widths)),
            Self::TurnedTwist(widths) => (LayerKind::TurnedTwist, Ok(widths)),
            Self::TurnedCoupling(widths) => (LayerKind::TurnedCoupling, Ok(widths)),
            Self::SympNet(modules) => (LayerKind::SympNet, Err(modules)),
        }
    }

    /// The kind of layer.
    pub fn kind(&self) -> LayerKind {
        self.parts().0
    }

    /// The number of layers; for a SympNet, that of its linear and activation modules.
    pub fn count(&self) -> usize {
        let of_modules = |of: &Modules| of.modules.saturating_mul(2).saturating_sub(1);
        self.parts().1.map_or_else(of_modules, <[usize]>::len)
    }

    /// The number of neurons of each layer; empty for a SympNet.
    pub fn widths(&self) -> &[usize] {
        self.parts().1.unwrap_or(&[])
    }

    /// The same kind of layer with other widths; modules stay what they are.
    pub(super) fn with_widths(&self, widths: Vec<usize>) -> Self {
        self.kind().with_widths(widths).unwrap_or_else(|| self.clone())
    }

    /// What stands before a layer's number in the names of its tensors, beside the block's name.
    pub(super) fn tensor_prefix(&self, layer: usize) -> String {
        match self {
            Self::SympNet(_) if layer.is_multiple_of(2) => format!("linear.{}", layer / 2),
            Self::SympNet(_) => format!("activation.{}", layer / 2),
            _ => layer.to_string(),
        }
    }

    /// The tensors of the layer of this number.
    pub(super) fn tensors_of(
        &self,
        layer: usize,
        function: RidgeFunction,
        of: Surroundings,
    ) -> Vec<Tensor> {
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
    pub(super) fn push<P: Real>(
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
pub(super) struct Made {
    pub(super) function: RidgeFunction,
    pub(super) near_identity: bool,
    pub(super) time: Option<f64>,
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
