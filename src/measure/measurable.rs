//! The traits that a map has to implement to be measured, and wrappers that implement them.

use super::coordinate::Coordinate;
use super::measured_network::AsMeasured;
use super::measured_step::{
    MeasuredPotential, MeasuredStep, MeasuredSteps, Numbers, TrackedStep, turn_steps,
};
use crate::error::Error;
use crate::layer::{HenonLayer, HenonMap, Kick, Turn};
use crate::network::{Block, Composition, Layers as BlockLayers, Model, Part, map_points};
use crate::phase::{Direction, Map};

/// A map on which the laws can be measured.
///
/// Every map, layer and network of the crate is one. A map of your own that is
/// written over the number type becomes one inside [`OneStep`].
pub trait Measurable: Map<f64> {
    /// The steps of P whose rounding errors are followed one by one; for
    /// [`Direction::Inverse`] those of P⁻¹.
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_>;

    /// Moves many points, 2n numbers each. It has to give the bits of
    /// [`Map::forward`] and [`Map::inverse`].
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        for point in points.chunks_exact_mut(2 * self.dof()) {
            self.run(direction, point);
        }
    }

    /// The layers in the order of application, each with the direction in which
    /// it is applied; none where the map has no parts.
    fn layers(&self) -> Layers<'_> {
        Vec::new()
    }

    /// The domain of each coordinate. Coordinates that are not listed (by default all of them)
    /// are in the box of the samples.
    fn domain(&self) -> Vec<Coordinate> {
        Vec::new()
    }

    /// Whether a point is so far outside the range of use of the map that its orbit is not tested further.
    /// It is false by default; networks of polynomials return true outside twice their box.
    fn is_beyond(&self, z: &[f64]) -> bool {
        let _ = z;
        false
    }

    /// The name of the type, by which a test suite identifies what it has measured.
    fn type_name(&self) -> &'static str {
        std::any::type_name::<Self>()
    }
}

/// Layers with their directions, each to be measured alone.
pub type Layers<'a> = Vec<(Direction, Box<dyn Measurable + 'a>)>;

/// Layers that are all applied forward, each to be measured alone.
fn forward_layers<'a, M: Measurable + 'a>(layers: impl Iterator<Item = M>) -> Layers<'a> {
    let boxed = |layer| Box::new(layer) as Box<dyn Measurable + 'a>;
    layers.map(|layer| (Direction::Forward, boxed(layer))).collect()
}

/// A family of nearly-periodic maps P_ε = I_ε∘ψ∘Φ_θ∘ψ⁻¹, given by its parts. A [`Model`] of that
/// structure implements it; so can any map that claims to be built this way.
pub trait NearlyPeriodic: Measurable {
    /// The same map P_ε at another ε.
    fn map_at(&self, epsilon: f64) -> Box<dyn Measurable + '_>;
    /// The near-identity map I_ε at another ε.
    fn near_identity_at(&self, epsilon: f64) -> Box<dyn Measurable + '_>;
    /// The map ψ that conjugates its circle action.
    fn conjugation(&self) -> Box<dyn Measurable + '_>;
    /// How often each plane (q_j, p_j) turns while θ goes round once.
    fn action_weights(&self) -> Vec<i32>;
    /// Applies the circle action in place, z ← Φ_θ(z).
    fn turn(&self, theta: f64, z: &mut [f64]);
    /// The conjugated circle action ψ∘Φ_θ∘ψ⁻¹ with an angle θ.
    fn conjugated_action_at(&self, theta: f64) -> Box<dyn Measurable + '_>;
    /// The angle θ of the map, in radians.
    fn angle(&self) -> f64;
    /// The value of ε that the map is taken at.
    fn epsilon(&self) -> f64;
}

impl Measurable for Composition<f64> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        self.visit_steps(direction, AsMeasured).into_iter().flatten().collect()
    }
    fn is_beyond(&self, z: &[f64]) -> bool {
        self.reach(z) > 2.0
    }
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        map_points(self, direction, points).expect("whole points");
    }
}

impl<V: MeasuredPotential> Measurable for HenonLayer<'_, f64, V> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        let mut kicks = self.kicks();
        if direction == Direction::Inverse {
            kicks = kicks.map(Kick::inverse);
            kicks.reverse();
        }
        kicks.into_iter().map(V::measured_kick).collect()
    }
}

impl<V: MeasuredPotential> Measurable for HenonMap<'_, f64, V> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        vec![V::measured_map(*self, direction)]
    }
}

impl Measurable for Turn<f64> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        turn_steps(self, direction)
    }
}

impl Measurable for Model {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        self.composition().measured_steps(direction)
    }
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        self.composition().move_points(direction, points);
    }

    /// The name of its architecture, if it has one.
    fn type_name(&self) -> &'static str {
        self.architecture().name().unwrap_or("blocks")
    }

    /// The layers of a network of Hénon layers alone; the steps of a network of couplings alone
    /// or of a reversible network of Hénon layers. Twists and modules are not measured separately.
    fn layers(&self) -> Layers<'_> {
        let architecture = self.architecture();
        let of_couplings = |block: &Block| matches!(block.layers, BlockLayers::TurnedCoupling(_));
        let apart = architecture.is_of_henon_layers();
        if architecture.blocks.iter().all(of_couplings)
            || (apart && architecture.reversor.is_some())
        {
            return forward_layers(self.composition().step_by_step());
        }
        if !apart {
            return Vec::new();
        }
        let forward = |part| forward_layers(self.henon_layers(part));
        let mut out = forward(Part::Chart);
        out.extend(forward(Part::Conjugation));
        out.reverse();
        for (direction, _) in &mut out {
            *direction = Direction::Inverse;
        }
        if let Some(action) = architecture.action() {
            out.push((Direction::Forward, Box::new(action.turn_by(self.angles()))));
        }
        let rest = [Part::Perturbation, Part::Chart, Part::Conjugation];
        for part in rest.into_iter().chain([Part::NearIdentity, Part::None]) {
            out.extend(forward(part));
        }
        out
    }
}

/// Seen as I_ε∘ψ∘Φ_θ∘ψ⁻¹ with the parts of a network: its near-identity blocks and its conjugation.
/// The laws find out whether it is one.
impl NearlyPeriodic for Model {
    fn map_at(&self, epsilon: f64) -> Box<dyn Measurable + '_> {
        Box::new(self.with_epsilon(epsilon))
    }
    fn near_identity_at(&self, epsilon: f64) -> Box<dyn Measurable + '_> {
        Box::new(self.near_identity().with_epsilon(epsilon))
    }
    fn conjugation(&self) -> Box<dyn Measurable + '_> {
        Box::new(self.psi())
    }
    fn action_weights(&self) -> Vec<i32> {
        let still = || vec![0; self.architecture().dof];
        self.architecture().circles.first().map_or_else(still, |circle| circle.weights().to_vec())
    }
    fn turn(&self, theta: f64, z: &mut [f64]) {
        if let Some(circle) = self.architecture().circles.first() {
            circle.turn_by(theta).apply(z, false);
        }
    }
    fn conjugated_action_at(&self, theta: f64) -> Box<dyn Measurable + '_> {
        Box::new(self.conjugated_circle_action(theta))
    }
    fn angle(&self) -> f64 {
        self.angles().first().copied().unwrap_or(0.0)
    }
    fn epsilon(&self) -> f64 {
        self.composition().epsilon()
    }
}

/// Any map that is generic over the number type, measured as one step.
///
/// The scale of its rounding errors is found by running it on
/// [`Tracked`](crate::scalar::Tracked) numbers, so nothing has to be derived by hand. The bound is a
/// worst-case bound; give a long computation as a sequence of steps, each a `OneStep`, in your own
/// [`Measurable`].
#[derive(Clone, Copy, Debug)]
pub struct OneStep<M>(pub M);

impl<S, M: Map<S>> Map<S> for OneStep<M> {
    fn dof(&self) -> usize {
        self.0.dof()
    }
    fn forward(&self, z: &mut [S]) {
        self.0.forward(z);
    }
    fn inverse(&self, z: &mut [S]) {
        self.0.inverse(z);
    }
    fn has_inverse(&self) -> bool {
        self.0.has_inverse()
    }
}

impl<M: Numbers> Measurable for OneStep<M> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        vec![Box::new(TrackedStep { map: &self.0, direction })]
    }
}

/// A composition of one or more maps of one type that is generic over the number type; the first
/// map is applied first.
///
/// The rounding errors of each map are followed separately, so the scales of a long composition
/// are of the size of its errors. For a hundred steps of an integrator as one [`OneStep`] they
/// are far larger.
#[derive(Clone, Debug)]
pub struct Steps<M>(pub Vec<M>);

impl<M: Clone> Steps<M> {
    /// The same map, `count` times.
    pub fn repeated(map: M, count: usize) -> Self {
        Self(vec![map; count])
    }
}

impl<S, M: Map<S>> Map<S> for Steps<M> {
    fn dof(&self) -> usize {
        self.0.first().map_or(0, Map::dof)
    }
    fn forward(&self, z: &mut [S]) {
        for map in &self.0 {
            map.forward(z);
        }
    }
    fn inverse(&self, z: &mut [S]) {
        for map in self.0.iter().rev() {
            map.inverse(z);
        }
    }
    fn has_inverse(&self) -> bool {
        self.0.iter().all(Map::has_inverse)
    }
}

impl<M: Numbers> Measurable for Steps<M> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        let step = |map| Box::new(TrackedStep { map, direction }) as Box<dyn MeasuredStep>;
        match direction {
            Direction::Forward => self.0.iter().map(step).collect(),
            Direction::Inverse => self.0.iter().rev().map(step).collect(),
        }
    }
}

/// A map with a [domain](Measurable::domain) for its coordinates: intervals and angles.
///
/// ```
/// use gyroceptron::measure::{Coordinate, OneStep, WithDomain, certificate::{CertificateOptions, certify_map}};
/// use gyroceptron::phase::Map;
/// use gyroceptron::scalar::{Elementary, constant};
/// use std::f64::consts::TAU;
///
/// /// p ← p + K sin q, q ← q + p mod 2π.
/// struct StandardMap(f64);
///
/// impl<S: Elementary> Map<S> for StandardMap {
///     fn dof(&self) -> usize {
///         1
///     }
///     fn forward(&self, z: &mut [S]) {
///         z[1] = z[1] + constant::<S>(self.0) * z[0].sin_cos().0;
///         z[0] = (z[0] + z[1]).rem_euclid(TAU);
///     }
///     fn inverse(&self, z: &mut [S]) {
///         z[0] = (z[0] - z[1]).rem_euclid(TAU);
///         z[1] = z[1] - constant::<S>(self.0) * z[0].sin_cos().0;
///     }
/// }
///
/// let domain = vec![Coordinate::Angle(TAU), Coordinate::Between(-3.0, 3.0)];
/// let map = WithDomain::new(OneStep(StandardMap(1.2)), domain)?;
/// certify_map(&map, CertificateOptions::default()).assert_holds();
/// # Ok::<(), gyroceptron::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct WithDomain<M> {
    map: M,
    domain: Vec<Coordinate>,
}

impl<M: Map<f64>> WithDomain<M> {
    /// A map and the domain of each of its coordinates, in the order q₁ … qₙ, p₁ … pₙ.
    ///
    /// # Errors
    /// Unless there are 2n coordinates, boxes of two finite numbers in order, and circles of
    /// positive circumference.
    pub fn new(map: M, domain: Vec<Coordinate>) -> Result<Self, Error> {
        Error::check_count("coordinates of the domain", 2 * map.dof(), domain.len())?;
        let name = |i: usize| format!("domain[{i}]");
        domain.iter().enumerate().try_for_each(|(i, coordinate)| coordinate.check(&name(i)))?;
        Ok(Self { map, domain })
    }
}

impl<S, M: Map<S>> Map<S> for WithDomain<M> {
    fn dof(&self) -> usize {
        self.map.dof()
    }
    fn forward(&self, z: &mut [S]) {
        self.map.forward(z);
    }
    fn inverse(&self, z: &mut [S]) {
        self.map.inverse(z);
    }
    fn has_inverse(&self) -> bool {
        self.map.has_inverse()
    }
}

impl<M: Measurable> Measurable for WithDomain<M> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        self.map.measured_steps(direction)
    }
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        self.map.move_points(direction, points);
    }
    fn layers(&self) -> Layers<'_> {
        self.map.layers()
    }
    fn domain(&self) -> Vec<Coordinate> {
        self.domain.clone()
    }
}
