//! Specifications of networks in scenes, options and keywords: by a name and sizes, or by blocks.

use super::architecture::Architecture;
use super::block::Block;
use super::block_table::{Alternating, MOST_LAYERS};
use super::named::{
    CouplingGyroceptronShape, GyroceptronShape, HenonShape, KickedGyroceptronShape, SympNetShape,
};
use super::normal_form::NormalFormShape;
use super::part::{Part, Scale};
use crate::error::Error;
use crate::layer::{Activation, CircleAction, Neuron, Reversor, RidgeFunction, TorusAction};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A number of layers, all of the same width or of two widths that alternate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LayerSizes {
    /// The number of layers of the part.
    pub count: usize,
    /// The number of neurons of each layer: one number, or two that alternate.
    pub width: Alternating,
    /// The degree of polynomials, if the layers have polynomials in place of neurons.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degree: Option<usize>,
    /// σ of the neurons, tanh unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub activation: Option<Neuron>,
}

impl LayerSizes {
    /// `count` layers of the same width.
    pub fn uniform(count: usize, width: usize) -> Self {
        Self { count, width: Alternating::Same(width), degree: None, activation: None }
    }

    /// The width of each layer.
    pub fn widths(self) -> Vec<usize> {
        self.width.widths(self.count)
    }

    /// Parses `10x8`, or `20x2,10` for two alternating widths; `10x8:arctan` for neurons of arctan, `10x1^16` for
    /// polynomials of degree 16.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the text.
    pub fn parse(name: &str, text: &str) -> Result<Self, Error> {
        let parse = || {
            let number = |text: &str| text.trim().parse().ok();
            let (text, activation) = match text.split_once(':') {
                None => (text, None),
                Some((text, name)) => (text, Some(Neuron::named(name.trim())?)),
            };
            let (sizes, degree) = match text.split_once('^') {
                None => (text, None),
                Some(_) if activation.is_some() => return None,
                Some((sizes, degree)) => (sizes, Some(number(degree)?)),
            };
            let (count, width) = sizes.split_once('x')?;
            let width = match width.split_once(',') {
                None => Alternating::Same(number(width)?),
                Some((first, second)) => Alternating::Two([number(first)?, number(second)?]),
            };
            Some(Self { count: number(count)?, width, degree, activation })
        };
        let expected = "layers and neurons, such as 10x8, 20x2,10 for two widths by turns, \
                        10x8:arctan for neurons of arctan, or 10x1^16 for polynomials of degree 16";
        parse().ok_or_else(|| Error::invalid(name, text, expected))
    }
}

impl std::fmt::Display for LayerSizes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.width {
            Alternating::Same(width) => write!(f, "{}x{width}", self.count)?,
            Alternating::Two([a, b]) => write!(f, "{}x{a},{b}", self.count)?,
        }
        self.degree.map_or(Ok(()), |degree| write!(f, "^{degree}"))?;
        self.activation.map_or(Ok(()), |neuron| write!(f, ":{}", neuron.name()))
    }
}

/// Which circles a network is built on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Circles {
    /// None: it has no ε and no angle.
    None,
    /// One circle, with an angle θ.
    One,
    /// One or several, an angle for each.
    Several,
}

/// An architecture that has a name.
///
/// A new one takes a constructor, an entry in [`NamedArchitecture::ALL`], and a test.
#[derive(Debug)]
pub struct NamedArchitecture {
    /// Its name in files, options and keywords.
    pub name: &'static str,
    /// Other names that are understood.
    pub aliases: &'static [&'static str],
    /// A description of the architecture, in a line.
    pub summary: &'static str,
    /// The keys of its sizes, with their defaults; parts without a default are left out unless
    /// their size is given.
    pub sizes: &'static [(&'static str, Option<(usize, usize)>)],
    /// The circles that the architecture is built on.
    pub circles: Circles,
    make: fn(&NetworkSpec, &Placed<'_>) -> Architecture,
}

/// The circles, ε and flow time of the set-up that a network is made for.
struct Placed<'a> {
    action: &'a TorusAction,
    epsilon: f64,
    flow_time: f64,
}

impl Placed<'_> {
    fn circle(&self) -> CircleAction {
        self.action.circles()[0].clone()
    }
}

impl NamedArchitecture {
    /// All architectures that have a name.
    pub const ALL: &[Self] = &[
        Self {
            name: "gyroceptron",
            aliases: &[],
            summary: "I_ε∘ψ∘Φ_θ∘ψ⁻¹ of Hénon layers, the paper's: an adiabatic invariant",
            sizes: &[("psi", Some((10, 8))), ("near_identity", Some((10, 8)))],
            circles: Circles::One,
            make: |spec, of| {
                let [psi, near_identity] = ["psi", "near_identity"].map(|key| spec.widths(key));
                GyroceptronShape { circle_action: of.circle(), psi, near_identity }
                    .architecture(of.epsilon)
            },
        },
        Self {
            name: "normal-form",
            aliases: &[],
            summary: "χ∘Φ_θ∘T_ε∘χ⁻¹: its actions are exact invariants, but for a perturbation",
            sizes: &[
                ("psi", None),
                ("kicks", Some((12, 8))),
                ("twists", Some((16, 8))),
                ("turned_twists", None),
                ("perturbation", None),
            ],
            circles: Circles::Several,
            make: |spec, of| {
                let [psi, kicks, twists, turned_twists] =
                    ["psi", "kicks", "twists", "turned_twists"].map(|key| spec.widths(key));
                let perturbation = spec.perturbation.map(LayerSizes::widths);
                let (action, flow_time) = (of.action.clone(), of.flow_time);
                NormalFormShape {
                    action,
                    psi,
                    kicks,
                    twists,
                    turned_twists,
                    flow_time,
                    perturbation,
                }
                .architecture(of.epsilon)
            },
        },
        Self {
            name: "coupling-gyroceptron",
            aliases: &[],
            summary: "I_ε∘ψ∘Φ_θ∘ψ⁻¹ of affine couplings: not symplectic, for flows with friction",
            sizes: &[("psi", Some((4, 8))), ("near_identity", Some((12, 8)))],
            circles: Circles::One,
            make: |spec, of| {
                let [psi, near_identity] = ["psi", "near_identity"].map(|key| spec.widths(key));
                let (circle_action, flow_time) = (of.circle(), of.flow_time);
                CouplingGyroceptronShape { circle_action, psi, near_identity, flow_time }
                    .architecture(of.epsilon)
            },
        },
        Self {
            name: "kicked-gyroceptron",
            aliases: &[],
            summary: "I_ε∘ψ∘Φ_θ∘ψ⁻¹ with an I_ε of turned kicks: an adiabatic invariant",
            sizes: &[("psi", Some((10, 8))), ("kicks", Some((24, 8)))],
            circles: Circles::One,
            make: |spec, of| {
                let [psi, kicks] = ["psi", "kicks"].map(|key| spec.widths(key));
                KickedGyroceptronShape { circle_action: of.circle(), psi, kicks }
                    .architecture(of.epsilon)
            },
        },
        Self {
            name: "henon-net",
            aliases: &[],
            summary: "Hénon layers: symplectic, without a circle",
            sizes: &[("layers", Some((16, 10)))],
            circles: Circles::None,
            make: |spec, of| {
                HenonShape { dof: of.action.dof(), widths: spec.widths("layers") }.architecture(1.0)
            },
        },
        Self {
            name: "symp-net",
            aliases: &["sympnet"],
            summary: "linear and activation modules in turn: symplectic, without a circle",
            sizes: &[("layers", Some((41, 4)))],
            circles: Circles::None,
            make: |spec, of| {
                let LayerSizes { count, width, .. } =
                    spec.size("layers").expect("it has a default");
                SympNetShape {
                    dof: of.action.dof(),
                    modules: count,
                    shears: width.two()[0],
                    activation: spec.activation.unwrap_or(Activation::Sigmoid),
                    plain: spec.plain.unwrap_or(false),
                }
                .architecture()
            },
        },
    ];

    /// The architecture of this name.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the name and all that there are.
    pub fn find(name: &str) -> Result<&'static Self, Error> {
        let is_it = |of: &&Self| of.name == name || of.aliases.contains(&name);
        Self::ALL.iter().find(is_it).ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|of| of.name).collect();
            Error::invalid("architecture", name, names.join(", "))
        })
    }

    /// The key of the sizes of a block.
    fn key_of(&self, block: &Block) -> Option<&'static str> {
        let keys: &[&str] = match &block.name[..] {
            "kick" => &["kicks"],
            "twist" => &["twists"],
            "turned_twist" => &["turned_twists"],
            "near_identity" => &["near_identity", "kicks"],
            "henon" | "" => &["layers"],
            name => &[name],
        };
        { self.sizes.iter() }.map(|(key, _)| *key).find(|key| keys.contains(key))
    }

    fn keys(&self) -> String {
        let keys: Vec<&str> = self.sizes.iter().map(|(key, _)| *key).collect();
        keys.join(", ")
    }
}

/// The specification of a network in scene files, options of the program and keywords of Python: a
/// [named architecture](NamedArchitecture) with the sizes of its parts, or a list of blocks, or the
/// file of a trained model. Its degrees of freedom, circles, ε and flow time are those of the system
/// or map that it approximates.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkSpec {
    /// The name of an architecture; `blocks`; or `file`: any network of a file `.json`, as `train`
    /// and scenes write them, for the same ε and flow time, or a gyroceptron with the weights of a
    /// `.safetensors`, `.npz` or `.index`, as [`import_weights`](crate::io::import_weights) takes
    /// them, which is not trained.
    pub kind: String,
    /// The layers of the conjugation ψ.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psi: Option<LayerSizes>,
    /// The layers of the near-identity map I_ε.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub near_identity: Option<LayerSizes>,
    /// The turned kicks of ψ_ε.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kicks: Option<LayerSizes>,
    /// The twist shears of T_ε. Of two alternating widths, the first is that of the shears that change
    /// the positions, which also have a quadratic form.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub twists: Option<LayerSizes>,
    /// The turned twists of T_ε. If only these are given, T_ε has no other twists.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turned_twists: Option<LayerSizes>,
    /// The turned kicks of K_ε, which make the map nearly integrable, or integrable with 0 layers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub perturbation: Option<LayerSizes>,
    /// ρ of the box of polynomials in units of the network: coordinates are from −ρ to ρ. The default
    /// is the box of the pairs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// The Hénon layers of a HénonNet; the linear modules of a SympNet and their shears.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layers: Option<LayerSizes>,
    /// The linear modules of a SympNet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub modules: Option<usize>,
    /// The shears of each of its linear modules.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shears: Option<usize>,
    /// The activation σ of a SympNet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub activation: Option<Activation>,
    /// Whether the activation modules of a SympNet have no parameters, and no translation follows its last linear
    /// module: see [`SympNetShape::plain`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plain: Option<bool>,
    /// S of a map that is reversible for all weights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reversor: Option<Reversor>,
    /// Φ; by default that of the system.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub circle_action: Option<CircleAction>,
    /// Φ with several circles; by default the one circle of the system.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub action: Option<TorusAction>,
    /// The blocks, of kind `blocks`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub blocks: Vec<Block>,
    /// The file, of kind `file`. A relative path is from the folder of the scene's file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path: Option<PathBuf>,
}

impl NetworkSpec {
    /// The kind whose network is that of a file.
    pub const FILE: &str = "file";
    /// The kind whose network is a list of blocks.
    pub const BLOCKS: &str = "blocks";

    /// A named architecture with its default sizes.
    ///
    /// # Errors
    /// Those of [`NamedArchitecture::find`].
    pub fn named(name: &str) -> Result<Self, Error> {
        let named = NamedArchitecture::find(name)?;
        Ok(Self { kind: named.name.into(), ..Self::default() })
    }

    /// The named architecture that has parts of all these keys, the recommended one first.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the keys, where none has.
    pub fn with_parts(keys: &[&str]) -> Result<Self, Error> {
        let recommended = NamedArchitecture::find("normal-form")?;
        let has = |of: &&NamedArchitecture| {
            keys.iter().all(|key| of.sizes.iter().any(|(own, _)| own == key))
        };
        let all = std::iter::once(recommended).chain(NamedArchitecture::ALL);
        match { all }.find(has) {
            Some(named) => Self::named(named.name),
            None => {
                let expected = "sizes of parts that one architecture has";
                let first = keys.first().copied().unwrap_or("sizes");
                Err(Error::invalid(first, keys.join(", "), expected))
            }
        }
    }

    /// The specification of a network that is a list of blocks.
    pub fn of_blocks(blocks: impl Into<Vec<Block>>) -> Self {
        Self { kind: Self::BLOCKS.into(), blocks: blocks.into(), ..Self::default() }
    }

    /// Whether its network is that of a file.
    pub fn is_of_file(&self) -> bool {
        self.kind == Self::FILE
    }

    /// The keys of sizes of all architectures.
    pub const SIZES: [&str; 7] =
        ["psi", "near_identity", "kicks", "twists", "turned_twists", "perturbation", "layers"];

    fn given(&self, key: &str) -> Option<LayerSizes> {
        match key {
            "psi" => self.psi,
            "near_identity" => self.near_identity,
            "kicks" => self.kicks,
            "twists" => self.twists,
            "turned_twists" => self.turned_twists,
            "perturbation" => self.perturbation,
            "layers" => match (self.modules, self.shears) {
                (None, None) => self.layers,
                (modules, shears) => {
                    let default = LayerSizes::uniform(41, 4);
                    let of = self.layers.unwrap_or(default);
                    let shears = shears.unwrap_or(of.width.two()[0]);
                    Some(LayerSizes::uniform(modules.unwrap_or(of.count), shears))
                }
            },
            _ => None,
        }
    }

    /// The specification with a size of one of its parts.
    ///
    /// # Errors
    /// [`Error::Invalid`] when its architecture has no such part.
    pub fn with_size(mut self, key: &str, size: LayerSizes) -> Result<Self, Error> {
        let own = match key {
            "psi" => &mut self.psi,
            "near_identity" => &mut self.near_identity,
            "kicks" => &mut self.kicks,
            "twists" => &mut self.twists,
            "turned_twists" => &mut self.turned_twists,
            "perturbation" => &mut self.perturbation,
            "layers" => &mut self.layers,
            _ => return Err(Error::invalid("size", key, Self::SIZES.join(", "))),
        };
        *own = Some(size);
        if key == "layers" {
            (self.modules, self.shears) = (None, None);
        }
        self.check()?;
        Ok(self)
    }

    /// The specification with this box for its polynomials.
    ///
    /// # Errors
    /// [`Error::Invalid`] when it has none, or the box has no extent.
    pub fn with_radius(mut self, radius: f64) -> Result<Self, Error> {
        self.radius = Some(radius);
        self.check()?;
        Ok(self)
    }

    /// The specification with this reversor.
    ///
    /// # Errors
    /// [`Error::Invalid`] when it is of a file.
    pub fn reversible(mut self, reversor: Reversor) -> Result<Self, Error> {
        self.reversor = Some(reversor);
        self.check()?;
        Ok(self)
    }

    /// The size of a part: the given one, or the default.
    pub fn size(&self, key: &str) -> Option<LayerSizes> {
        self.given(key).or_else(|| {
            if key == "twists" && self.turned_twists.is_some() {
                return None;
            }
            let named = NamedArchitecture::find(&self.kind).ok()?;
            let (_, default) = named.sizes.iter().find(|(own, _)| *own == key)?;
            default.map(|(count, width)| LayerSizes::uniform(count, width))
        })
    }

    fn widths(&self, key: &str) -> Vec<usize> {
        self.size(key).map_or_else(Vec::new, LayerSizes::widths)
    }

    /// Fails unless its kind exists, and what is given belongs to it.
    ///
    /// # Errors
    /// [`Error::Invalid`] and [`Error::CountOutOfRange`] with the key and the value.
    pub fn check(&self) -> Result<(), Error> {
        self.check_from(1)
    }

    /// [`NetworkSpec::check`] with at least so many layers of each part, which may be none.
    ///
    /// # Errors
    /// Those of [`NetworkSpec::check`], and of a part with fewer layers.
    pub fn check_from(&self, least: usize) -> Result<(), Error> {
        let named = match &self.kind[..] {
            Self::FILE | Self::BLOCKS => None,
            name => Some(NamedArchitecture::find(name)?),
        };
        for key in Self::SIZES {
            let Some(size) = self.given(key) else { continue };
            let fits = named.is_some_and(|of| of.sizes.iter().any(|(own, _)| *own == key));
            if !fits {
                let of = named.map_or("it has none".into(), NamedArchitecture::keys);
                let expected = format!("a size of {}: {of}", self.kind);
                return Err(Error::invalid(key, size, expected));
            }
            if let (Some(degree), Some(neuron)) = (size.degree, size.activation) {
                let found = format!("the degree {degree} and the activation {}", neuron.name());
                return Err(Error::invalid(key, found, "one of them: polynomials have no neurons"));
            }
            // Of a perturbation there may be none.
            let least = if key == "perturbation" { 0 } else { least };
            Error::check_count_range(&format!("{key}: layers"), size.count, least, MOST_LAYERS)?;
            // A twist shear that changes positions may have its quadratic form alone.
            let may_be_empty = |layer: usize| key == "twists" && layer.is_multiple_of(2);
            let mut widths = size.widths().into_iter().enumerate();
            if widths.any(|(layer, width)| width == 0 && !may_be_empty(layer)) {
                let found = format!("{size}: a layer of width 0");
                return Err(Error::invalid(key, found, "at least one neuron"));
            }
        }
        let is_symp_net = named.is_some_and(|of| of.name == "symp-net");
        let of_modules = self.activation.is_some() || self.plain.is_some();
        if !is_symp_net && (of_modules || self.modules.is_some() || self.shears.is_some()) {
            let found = "modules, shears, activation or plain";
            return Err(Error::invalid("network", found, format!("none of them of {}", self.kind)));
        }
        if let Some(radius) = self.radius {
            RidgeFunction::Polynomial { degree: 1, radius }.check()?;
            let given = Self::SIZES.iter().filter_map(|key| self.given(key));
            let of_sizes = { given }.any(|size| size.degree.is_some());
            let of_blocks = self.blocks.iter().any(|block| block.ridges.is_polynomial());
            if !(of_sizes || of_blocks) {
                return Err(Error::invalid("radius", radius, "a degree of polynomials with it"));
            }
        }
        let needs_blocks = self.kind == Self::BLOCKS;
        if needs_blocks == self.blocks.is_empty() {
            let found = format!("{} blocks of kind {}", self.blocks.len(), self.kind);
            return Err(Error::invalid("network", found, "blocks of kind `blocks`, and no others"));
        }
        if let (Some(reversor), true) = (self.reversor, self.is_of_file()) {
            let expected = "none beside a file: it is that of its network";
            return Err(Error::invalid("reversor", reversor.name(), expected));
        }
        if self.path.is_some() && !self.is_of_file() {
            let found = format!("a path of kind {}", self.kind);
            return Err(Error::invalid("network", found, "a path of kind `file` only"));
        }
        if self.circle_action.is_some() && self.action.is_some() {
            let expected = "one of them";
            return Err(Error::invalid("network", "circle_action and action", expected));
        }
        Ok(())
    }

    /// The circles on which its network is built; for a list of blocks, those that the blocks need.
    pub fn circles(&self) -> Circles {
        match NamedArchitecture::find(&self.kind) {
            Ok(named) => named.circles,
            Err(_) if self.blocks.iter().any(Block::is_of_circles) => Circles::Several,
            Err(_) => Circles::None,
        }
    }

    /// Whether it is built on a circle action: it has an ε and angles, and is of a family of maps.
    pub fn has_circle(&self) -> bool {
        self.circles() != Circles::None
    }

    /// The circle action that the network names for itself; None where it leaves that to the scene.
    pub fn own_action(&self) -> Option<TorusAction> {
        let circle = || self.circle_action.clone().map(TorusAction::from);
        self.action.clone().or_else(circle)
    }

    /// The architecture for this circle action, ε and flow time.
    ///
    /// # Errors
    /// [`Error::Invalid`] when it is that of a file, its kind does not exist, or it is of one circle
    /// and the action of several.
    pub fn architecture(
        &self,
        action: &TorusAction,
        epsilon: f64,
        flow_time: f64,
    ) -> Result<Architecture, Error> {
        let own = self.own_action();
        let placed = Placed { action: own.as_ref().unwrap_or(action), epsilon, flow_time };
        if self.is_of_file() {
            return Err(Error::invalid("network", "one of a file", "one to train"));
        }
        if self.kind == Self::BLOCKS {
            let mut out = Architecture::new(placed.action.dof());
            if self.has_circle() {
                out = out.on_torus(placed.action).at_epsilon(epsilon);
            }
            out.reversor = self.reversor;
            out.blocks = self.blocks.clone();
            out = self.boxed(out);
            out.flow_time = if out.has_flow_time() { flow_time } else { 1.0 };
            return Ok(out);
        }
        let named = NamedArchitecture::find(&self.kind)?;
        let circles = placed.action.circles().len();
        if named.circles == Circles::One && circles > 1 {
            let (found, expected) =
                (format!("{circles} circles"), format!("one of a {}", named.name));
            return Err(Error::invalid("circle action", found, expected));
        }
        let mut out = (named.make)(self, &placed).reversible(self.reversor);
        if self.reversor.is_some() {
            // A of a reversible map is near the identity, whatever its slow map is.
            for block in out.blocks.iter_mut().filter(|block| block.part == Part::Chart) {
                block.scale = Scale::Epsilon;
            }
        }
        for block in &mut out.blocks {
            let size = named.key_of(block).and_then(|key| self.size(key));
            let Some(LayerSizes { degree, activation, .. }) = size else { continue };
            if let Some(degree) = degree {
                *block = block.clone().of_polynomials(degree);
            } else if let Some(neuron) = activation {
                *block = block.clone().of_neurons(neuron);
            }
        }
        Ok(self.boxed(out))
    }

    /// With the box that it names.
    fn boxed(&self, architecture: Architecture) -> Architecture {
        match self.radius {
            Some(radius) => architecture.in_box(radius),
            None => architecture,
        }
    }
}

impl Architecture {
    /// The name of the named architecture with the same blocks up to their widths, if any.
    pub fn name(&self) -> Option<&'static str> {
        let action = self.action().unwrap_or_else(|| TorusAction::of_planes(self.dof.max(1)));
        let is_it = |named: &&NamedArchitecture| {
            // With any of its parts given, which decides what it has.
            (0..1_usize << named.sizes.len()).any(|given| {
                let mut spec = NetworkSpec {
                    kind: named.name.into(),
                    reversor: self.reversor,
                    ..NetworkSpec::default()
                };
                let sizes = named.sizes.iter().enumerate();
                for (_, (key, default)) in sizes.filter(|(number, _)| given >> number & 1 == 1) {
                    let (count, width) = default.unwrap_or((1, 1));
                    match spec.clone().with_size(key, LayerSizes::uniform(count, width)) {
                        Ok(with) => spec = with,
                        Err(_) => return false,
                    }
                }
                spec.architecture(&action, self.epsilon, self.flow_time)
                    .is_ok_and(|of| of.is_of_the_kind_of(self))
            })
        };
        NamedArchitecture::ALL.iter().find(is_it).map(|named| named.name)
    }

    /// Whether the blocks are the same but for their widths.
    fn is_of_the_kind_of(&self, other: &Self) -> bool {
        let alike = |(a, b): (&Block, &Block)| {
            (&a.name, a.part, a.scale) == (&b.name, b.part, b.scale)
                && a.layers.kind() == b.layers.kind()
        };
        (&self.circles, self.reversor) == (&other.circles, other.reversor)
            && self.blocks.len() == other.blocks.len()
            && self.blocks.iter().zip(&other.blocks).all(alike)
    }
}
