//! Exact symmetries of the parameters: changes under which the map changes by a
//! power of two, by a sign, or not at all, bit for bit.

use crate::error::Error;
use crate::network::Model;

/// A symmetry of networks of tanh potentials.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relation {
    /// (W, w, η, z) → (W/2ᵏ, w·4ᵏ, 2ᵏη, 2ᵏz): the map in other units.
    Scaling(i32),
    /// (W, w, b) → −(W, w, b): the inner and outer signs of every neuron, the same map.
    NeuronFlip,
    /// (w, b, η, z) → −(w, b, η, z): the map seen from −z.
    PointFlip,
}

impl Relation {
    /// All relations, with k = 3 for the scaling.
    pub const ALL: [Self; 3] = [Self::Scaling(3), Self::NeuronFlip, Self::PointFlip];

    /// The relation in words for tables.
    pub fn equation(self) -> &'static str {
        match self {
            Self::Scaling(_) => "(W,w,η,z) → (W/2ᵏ,4ᵏw,2ᵏη,2ᵏz), bitwise",
            Self::NeuronFlip => "(W,w,b) → −(W,w,b), bitwise",
            Self::PointFlip => "(w,b,η,z) → −(w,b,η,z), bitwise",
        }
    }

    /// z ← the transformed point.
    pub fn transform_point(self, z: &mut [f64]) {
        let factor = match self {
            Self::Scaling(k) => libm::exp2(k.into()),
            Self::NeuronFlip => 1.0,
            Self::PointFlip => -1.0,
        };
        z.iter_mut().for_each(|v| *v *= factor);
    }

    /// The relation that undoes the changes of this one.
    fn undone(self) -> Self {
        match self {
            Self::Scaling(k) => Self::Scaling(-k),
            other => other,
        }
    }

    /// The factors of W, b, w and η.
    fn factors(self) -> [f64; 4] {
        match self {
            Self::Scaling(k) => {
                let unit = libm::exp2(k.into());
                [1.0 / unit, 1.0, unit * unit, unit]
            }
            Self::NeuronFlip => [-1.0, -1.0, -1.0, 1.0],
            Self::PointFlip => [1.0, -1.0, -1.0, -1.0],
        }
    }

    /// Transforms the parameters of a layer, `[W, b, w, η]`, in place.
    pub fn transform_layer(self, dof: usize, width: usize, parameters: &mut [f64]) {
        let [inner, bias, outer, shift] = self.factors();
        let (w_in, rest) = parameters.split_at_mut(dof * width);
        let (b_in, rest) = rest.split_at_mut(width);
        let (w_out, eta) = rest.split_at_mut(width);
        for (part, factor) in [(w_in, inner), (b_in, bias), (w_out, outer), (eta, shift)] {
            part.iter_mut().for_each(|v| *v *= factor);
        }
    }

    /// The model with transformed parameters.
    ///
    /// # Errors
    /// When a scaled parameter overflows or loses digits among the subnormal numbers,
    /// so that the relation is not exact; when the model is not of Hénon layers alone.
    pub fn transform_model(self, model: &Model) -> Result<Model, Error> {
        if !model.architecture().is_of_henon_layers() {
            let found = "a network of other layers";
            return Err(Error::invalid("model", found, "a network of Hénon layers"));
        }
        let dof = model.architecture().dof;
        let mut parameters = model.parameters().to_vec();
        for (block, number, range) in model.architecture().layers() {
            let width = block.layers.widths()[number];
            let layer = &mut parameters[range];
            let before = layer.to_vec();
            self.transform_layer(dof, width, layer);
            let mut back = layer.to_vec();
            self.undone().transform_layer(dof, width, &mut back);
            let changed = |k: &usize| back[*k].to_bits() != before[*k].to_bits();
            if let Some(k) = (0..before.len()).find(changed) {
                return Err(Error::invalid(
                    "scaled parameter",
                    before[k],
                    "a normal number, also when scaled",
                ));
            }
        }
        model.with_parameters(parameters)
    }
}
