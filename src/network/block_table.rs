//! Blocks as files have them.

use super::layers::{LayerKind, Layers, Modules};
use super::part::{Part, Scale};
use crate::error::{Error, block_called};
use crate::layer::{Activation, Neuron, RidgeFunction};
use serde::de::{Deserializer, Error as _, SeqAccess};
use serde::{Deserialize, Serialize};
use std::marker::PhantomData;

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

/// What a block is made of.
pub(super) struct Contents {
    pub(super) name: String,
    pub(super) part: Part,
    pub(super) scale: Scale,
    pub(super) layers: Layers,
    pub(super) ridges: RidgeFunction,
}

/// A block as files have it.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BlockTable {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    #[serde(default = "no_part")]
    part: Part,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    scale: Option<Scale>,
    layer: LayerKind,
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
pub(super) fn read_blocks<'de, B: Deserialize<'de>, D: Deserializer<'de>>(
    tables: D,
) -> Result<Vec<B>, D::Error> {
    struct List<B>(PhantomData<B>);

    impl<'de, B: Deserialize<'de>> serde::de::Visitor<'de> for List<B> {
        type Value = Vec<B>;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("a list of blocks")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut tables: A) -> Result<Vec<B>, A::Error> {
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

    tables.deserialize_seq(List(PhantomData))
}

impl BlockTable {
    /// What the table says.
    ///
    /// # Errors
    /// [`Error::Missing`] and [`Error::Invalid`] of keys that its layers need or do not have.
    pub(super) fn contents(self) -> Result<Contents, Error> {
        let BlockTable { name, part, scale, layer, widths, degree, radius, .. } = self;
        let BlockTable { modules, shears, activation, plain, .. } = self;
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
        let layers = if layer == LayerKind::SympNet {
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
            layer.with_widths(widths).expect("all kinds but modules have widths")
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
        Ok(Contents { name, part, scale: scale.unwrap_or(part.usual_scale()), layers, ridges })
    }

    /// The table of these contents.
    pub(super) fn new(contents: Contents) -> Self {
        let Contents { name, part, scale, layers, ridges } = contents;
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
        let table = Self {
            name: Some(name),
            part,
            scale: Some(scale),
            layer: layers.kind(),
            widths: None,
            degree,
            radius,
            modules: None,
            shears: None,
            activation,
            plain: None,
        };
        match layers {
            Layers::SympNet(Modules { modules, shears, activation, plain }) => Self {
                modules: Some(modules),
                shears: Some(shears),
                activation: Some(ActivationName::Module(activation)),
                plain: Some(plain),
                ..table
            },
            layers => Self { widths: Some(Widths::List(layers.widths().to_vec())), ..table },
        }
    }
}
