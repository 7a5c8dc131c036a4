//! A network: its architecture with parameters, and the map that they define.

use super::architecture::{Architecture, Structure};
use super::batch::{Course, Rollout, map_points, map_points_at_pace, rollout_at_pace};
use super::block::Block;
use super::composition::Composition;
use super::init::InitialWeights;
use super::layers::Layers;
use super::on_grid::{GridPoints, grid_rollout};
use super::pace::Pace;
use super::part::Part;
use crate::error::Error;
use crate::layer::{CircleAction, HenonLayer, RidgeFunction};
use crate::phase::{Direction, Map};
use crate::random::Stream;
use crate::scalar::{Over, Real, Scalar, max_or_nan};
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

/// A function on phase space that a network conserves exactly or approximately.
pub type Invariant<'a> = Box<dyn Fn(&[f64]) -> f64 + Send + Sync + 'a>;

/// A network: an [`Architecture`] and its parameters, in double precision unless another number
/// type is named.
///
/// It has a [`Composition`] of steps, which can be evaluated, inverted, differentiated and
/// measured.
#[derive(Clone, Debug)]
pub struct Model<P = f64> {
    architecture: Architecture,
    composition: Composition<P>,
}

impl Model {
    /// The network of this architecture with these parameters.
    ///
    /// # Errors
    /// When the count is wrong, a number is not finite, or the architecture
    /// does not pass [`Architecture::check`].
    pub fn new(architecture: Architecture, parameters: Vec<f64>) -> Result<Self, Error> {
        if let Some(index) = parameters.iter().position(|v| !v.is_finite()) {
            Error::check_finite(&format!("parameter {index}"), parameters[index])?;
        }
        let epsilon = architecture.epsilon;
        Self::at_epsilon(architecture, epsilon, parameters)
    }

    /// This network over another number type.
    pub fn lift<P: Real>(&self) -> Model<P> {
        let parameters = self.parameters().iter().map(|&v| P::from_f64(v)).collect();
        let (architecture, epsilon) = (self.architecture.clone(), P::from_f64(self.epsilon()));
        Model::at_epsilon(architecture, epsilon, parameters).expect("as it was")
    }

    /// A model of this architecture with other parameters.
    ///
    /// # Errors
    /// Those of [`Model::new`].
    pub fn with_parameters(&self, parameters: Vec<f64>) -> Result<Self, Error> {
        Self::new(self.architecture.clone(), parameters)
    }

    /// A model of this architecture with other angles of its circles.
    ///
    /// # Errors
    /// When it is built on circles and there are more or fewer angles; those of [`Model::new`].
    pub fn with_angles(&self, angles: &[f64]) -> Result<Self, Error> {
        let mut parameters = self.parameters().to_vec();
        let own = &mut parameters[self.architecture.angles()];
        if !own.is_empty() {
            Error::check_count("angles", own.len(), angles.len())?;
            own.copy_from_slice(angles);
        }
        self.with_parameters(parameters)
    }

    /// This network at another ε and at `time` times its flow time: the angles of its
    /// circles and the factor h of its blocks are multiplied by `time`. Networks without circles
    /// belong to no family of maps and are returned unchanged.
    ///
    /// # Errors
    /// Those of [`Model::new`].
    pub fn with_epsilon_and_time(&self, epsilon: f64, time: f64) -> Result<Self, Error> {
        if !self.architecture.has_circle() {
            return Ok(self.clone());
        }
        let mut architecture = self.architecture.clone().at_epsilon(epsilon);
        if architecture.has_flow_time() {
            architecture.flow_time *= time;
        }
        Self::new(architecture, self.composition.parameters_at(time))
    }

    /// This network with the weights of another one of the same architecture, whose angles are
    /// multiplied by `time`: a flow map of another time thus serves as a start for training.
    ///
    /// # Errors
    /// When it has more or fewer parameters; those of [`Model::new`].
    pub fn with_weights_of(&self, other: &Self, time: f64) -> Result<Self, Error> {
        self.with_parameters(other.composition.parameters_at(time))
    }

    /// The trajectories from each of the points in `initial`, as [`rollout`](super::rollout) gives
    /// them. A network with a chart and without I_ε transforms to the chart once, makes all steps there,
    /// and transforms back each state that is kept: the actions of a normal form then change only by
    /// the rounding of the steps in between.
    ///
    /// # Errors
    /// Those of [`rollout`](super::rollout).
    pub fn rollout(&self, initial: &[f64], request: Rollout) -> Result<Vec<f64>, Error> {
        self.rollout_at_pace(initial, request, &mut Pace::unbroken())
    }

    /// [`Model::rollout`] in parts, between which the pace decides whether to go on: the same bits.
    ///
    /// # Errors
    /// Those of [`Model::rollout`]; [`Error::Stopped`].
    pub fn rollout_at_pace(
        &self,
        initial: &[f64],
        request: Rollout,
        pace: &mut Pace<'_>,
    ) -> Result<Vec<f64>, Error> {
        self.rollout_along(Course::default(), initial, request, pace)
    }

    /// [`Model::rollout_at_pace`] by the map or its inverse, with plain numbers or on a grid of the
    /// network's coordinates; on a grid, the first state kept is the grid point nearest to the initial one.
    ///
    /// # Errors
    /// Those of [`Model::rollout`], or those of [`GridPoints::nearest`] and [`grid_rollout`];
    /// [`Error::Stopped`].
    pub fn rollout_along(
        &self,
        course: Course,
        initial: &[f64],
        request: Rollout,
        pace: &mut Pace<'_>,
    ) -> Result<Vec<f64>, Error> {
        if let Some(grid) = course.grid {
            self.composition.check_on_grid()?;
            let mut points = GridPoints::nearest(grid, initial)?;
            return grid_rollout(&self.composition, course.direction, &mut points, request, pace);
        }
        let along = |map: Cow<'_, Composition<f64>>, pace: &mut Pace<'_>, start: &[f64]| {
            let map = match course.direction {
                Direction::Forward => map,
                Direction::Inverse => Cow::Owned(map.inverted()),
            };
            rollout_at_pace(&map, start, request, pace)
        };
        if !self.rolls_out_in_chart() {
            return along(Cow::Borrowed(&self.composition), pace, initial);
        }
        let [chart, inner] = self.chart_and_inner_map();
        let mut start = initial.to_vec();
        map_points(&chart, Direction::Inverse, &mut start)?;
        let mut states = along(Cow::Owned(inner), pace, &start)?;
        states[..initial.len()].copy_from_slice(initial);
        let kept = &mut states[initial.len()..];
        map_points_at_pace(&chart, Direction::Forward, kept, pace)?;
        Ok(states)
    }

    /// Whether roll-outs make all their steps in the coordinates of the chart χ.
    pub(crate) fn rolls_out_in_chart(&self) -> bool {
        let structure = self.architecture.structure();
        matches!(structure, Structure::NormalForm | Structure::NearlyIntegrable)
    }

    /// The invariant of the network as a function of a point: the sum of 𝔍∘χ⁻¹ over its circles.
    /// It is exact in normal form, exact at ε = 0 only in a nearly integrable network, and adiabatic, with
    /// χ = ψ, in any other symplectic network that is nearly periodic.
    /// None for a network without invariants ([`Model::invariants`]).
    pub fn invariant(&self) -> Option<Invariant<'_>> {
        let mut all = self.invariants();
        match all.len() {
            0 => None,
            1 => all.pop().map(|(_, invariant)| invariant),
            _ => Some(Box::new(move |z| all.iter().map(|(_, invariant)| invariant(z)).sum())),
        }
    }

    /// The invariant 𝔍_a∘χ⁻¹ of each of its circles, with the circle; their sum is
    /// [`Model::invariant`].
    pub fn invariants(&self) -> Vec<(CircleAction, Invariant<'_>)> {
        let structure = self.architecture.structure();
        let exact = matches!(structure, Structure::NormalForm | Structure::NearlyIntegrable);
        if structure == Structure::Plain || !(exact || self.architecture.is_symplectic()) {
            return Vec::new();
        }
        let of = |circle: &CircleAction| -> (CircleAction, Invariant<'_>) {
            let [chart, _] = self.chart_and_inner_map();
            let own = circle.clone();
            (circle.clone(), Box::new(move |z| own.conjugated_invariant(&chart, z)))
        };
        self.architecture.circles.iter().map(of).collect()
    }

    /// θ, where the network is built on one circle.
    pub fn angle(&self) -> Option<f64> {
        match self.angles() {
            [theta] => Some(*theta),
            _ => None,
        }
    }
}

impl<P: Real> Model<P> {
    /// The network of this architecture at ε over any numbers.
    ///
    /// # Errors
    /// When the count of parameters is wrong, or the architecture does not pass
    /// [`Architecture::check`].
    pub fn at_epsilon(
        architecture: Architecture,
        epsilon: P,
        parameters: Vec<P>,
    ) -> Result<Self, Error> {
        architecture.check()?;
        architecture.check_boxes()?;
        let count = architecture.parameter_count();
        if parameters.len() != count {
            let name = format!("parameters ({})", architecture.count_of_each());
            return Err(Error::WrongCount { name, expected: count, found: parameters.len() });
        }
        let composition = architecture.composition(epsilon, parameters);
        Ok(Self { architecture: architecture.at_epsilon(epsilon.value()), composition })
    }

    /// A part of the map, over all its parameters; the identity when there is no such part.
    pub fn part(&self, part: Part) -> Composition<P> {
        let composition = &self.composition;
        self.architecture.composition_of_part(part, composition.epsilon(), composition.parameters())
    }

    /// The conjugation ψ: the circle action of the map is ψ∘Φ_θ∘ψ⁻¹.
    pub fn psi(&self) -> Composition<P> {
        self.part(Part::Conjugation)
    }

    /// The near-identity map I_ε, the identity at ε = 0.
    pub fn near_identity(&self) -> Composition<P> {
        self.part(Part::NearIdentity)
    }

    /// The chart χ, from the coordinates of the normal form to those of the data, and the map
    /// K_ε∘Φ_θ∘T_ε in the former: without I_ε, N steps are χ∘(K_εΦ_θT_ε)^N∘χ⁻¹.
    pub fn chart_and_inner_map(&self) -> [Composition<P>; 2] {
        let composition = &self.composition;
        self.architecture.chart_and_inner_map(composition.epsilon(), composition.parameters())
    }

    /// The steps of a nearly-integrable map, T_ε and Φ_θ, without which it is χ∘K_ε∘χ⁻¹; None of other maps, and of
    /// reversible ones, in which K_ε stands on both sides.
    pub(crate) fn steps_before_perturbation(&self) -> Option<Range<usize>> {
        let architecture = &self.architecture;
        if architecture.structure() != Structure::NearlyIntegrable
            || architecture.reversor.is_some()
        {
            return None;
        }
        let [chart, inner] = self.chart_and_inner_map();
        let (first, own) = (chart.steps().len(), self.part(Part::Perturbation).steps().len());
        Some(first..first + inner.steps().len() - own)
    }

    /// The map in the coordinates w = χ⁻¹z, in which the invariants are simply 𝔍:
    /// χ⁻¹∘I_ε∘χ∘K_ε∘Φ_θ∘T_ε.
    pub fn in_conjugated_coordinates(&self) -> Composition<P> {
        let [chart, mut out] = self.chart_and_inner_map();
        let near_identity = self.near_identity();
        if !near_identity.steps().is_empty() {
            out.push_all(&chart, 0, Direction::Forward);
            out.push_all(&near_identity, 0, Direction::Forward);
            out.push_all(&chart, 0, Direction::Inverse);
        }
        out
    }

    /// The conjugated circle action ψ∘Φ_θ∘ψ⁻¹ with the angle `theta` for all circles.
    pub fn conjugated_circle_action(&self, theta: P) -> Composition<P> {
        let mut parameters = self.composition.parameters().to_vec();
        parameters[self.architecture.angles()].fill(theta);
        let psi = self.psi();
        let mut out = Composition::new(self.architecture.dof, parameters, self.epsilon());
        out.push_all(&psi, 0, Direction::Inverse);
        if let Some(action) = self.architecture.action() {
            out.push_turn(&action, self.architecture.angles());
        }
        out.push_all(&psi, 0, Direction::Forward);
        out
    }
}

impl<P: Scalar> Model<P> {
    /// The architecture of the network.
    pub fn architecture(&self) -> &Architecture {
        &self.architecture
    }

    /// The steps of the map and their parameters.
    pub fn composition(&self) -> &Composition<P> {
        &self.composition
    }

    /// All parameters of the network, in the order that [`Architecture`] states.
    pub fn parameters(&self) -> &[P] {
        self.composition.parameters()
    }

    /// The parameter ε that the network is bound to.
    pub fn epsilon(&self) -> P {
        self.composition.epsilon()
    }

    /// The angles of its circles, in radians.
    pub fn angles(&self) -> &[P] {
        &self.composition.parameters()[self.architecture.angles()]
    }

    /// The Hénon layers of neurons of tanh of a part, in the order of application.
    pub fn henon_layers(&self, part: Part) -> impl DoubleEndedIterator<Item = HenonLayer<'_, P>> {
        let of = |(block, number, range): (&Block, usize, std::ops::Range<usize>)| {
            let Layers::Henon(widths) = &block.layers else { return None };
            let scale = if block.scale.has_epsilon() { self.epsilon() } else { P::from_f64(1.0) };
            if block.part != part || block.ridges != RidgeFunction::default() {
                return None;
            }
            let layer = &self.composition.parameters()[range];
            Some(HenonLayer::new(self.architecture.dof, widths[number], scale, layer))
        };
        self.architecture.layers().into_iter().filter_map(of).collect::<Vec<_>>().into_iter()
    }
}

impl<P: Real> Model<P> {
    /// The network at these values of its controls: one without controls, whose parameters are θ(λ), of the number
    /// type of the values. Of [dual numbers](crate::scalar::Dual) they have derivatives with respect to λ.
    ///
    /// # Errors
    /// When there is not one value for each control.
    pub fn at_controls<Q: Real + Over<P>>(&self, values: &[Q]) -> Result<Model<Q>, Error> {
        let composition = self.composition.at_controls(values)?;
        let architecture = self.architecture.clone().with_controls(None);
        Ok(Model { architecture, composition })
    }

    /// This network at another ε.
    pub fn with_epsilon(&self, epsilon: P) -> Self {
        Self {
            architecture: self.architecture.clone().at_epsilon(epsilon.value()),
            composition: self.composition.with_epsilon(epsilon),
        }
    }

    /// 𝔍∘χ⁻¹ of its first circle at each of the points of `z` (2n numbers each): μ₀ of a
    /// gyroceptron.
    pub fn adiabatic_invariant<S: Over<P>>(&self, z: &[S]) -> Vec<S> {
        let [chart, _] = self.chart_and_inner_map();
        let Some(circle) = self.architecture.circles.first() else { return Vec::new() };
        let points = z.chunks_exact(2 * self.architecture.dof);
        points.map(|z| circle.conjugated_invariant(&chart, z)).collect()
    }
}

impl Model {
    /// This network with all coefficients of polynomials 0: their layers are the identity, and since the
    /// map depends linearly on small coefficients, the first step of a fit from there is a linear one.
    ///
    /// # Errors
    /// Those of [`Model::with_parameters`].
    pub(crate) fn with_polynomials_at_rest(&self) -> Result<Self, Error> {
        let mut parameters = self.parameters().to_vec();
        let mut begin = 0;
        for (name, shape) in self.architecture.tensors() {
            let end = begin + shape[0] * shape[1];
            if name.ends_with(".coefficients") {
                parameters[begin..end].fill(0.0);
            }
            begin = end;
        }
        self.with_parameters(parameters)
    }

    /// With polynomials of at most this degree outside its slow map: coefficients of higher degrees
    /// are left out.
    ///
    /// # Errors
    /// Those of [`Model::new`].
    pub(crate) fn of_degree(&self, most: usize) -> Result<Self, Error> {
        let mut architecture = self.architecture.clone();
        for block in architecture.blocks.iter_mut().filter(|block| block.part != Part::SlowMap) {
            if let RidgeFunction::Polynomial { degree, .. } = &mut block.ridges {
                *degree = most.min(*degree);
            }
        }
        self.reshaped(architecture)
    }

    /// With polynomials of the degrees of another network, whose blocks are the same otherwise:
    /// coefficients that it has more are 0.
    ///
    /// # Errors
    /// Those of [`Model::new`].
    pub(crate) fn with_degrees_of(&self, other: &Self) -> Result<Self, Error> {
        let mut architecture = self.architecture.clone();
        for (block, of) in architecture.blocks.iter_mut().zip(&other.architecture.blocks) {
            block.ridges = of.ridges;
        }
        self.reshaped(architecture)
    }

    /// Its weights in an architecture that differs in the degrees of polynomials alone. Their
    /// coefficients are row by row, those of the lowest degree first.
    fn reshaped(&self, architecture: Architecture) -> Result<Self, Error> {
        if architecture == self.architecture {
            return Ok(self.clone());
        }
        let mut parameters = Vec::with_capacity(architecture.parameter_count());
        let mut begin = 0;
        let shapes = architecture.tensors().into_iter().zip(self.architecture.tensors());
        for ((_, shape), (_, own)) in shapes {
            let [count, wanted] = [own, shape].map(|shape| shape[0] * shape[1]);
            let values = &self.parameters()[begin..begin + count];
            parameters.extend_from_slice(&values[..count.min(wanted)]);
            parameters.extend((count..wanted).map(|_| 0.0));
            begin += count;
        }
        Self::new(architecture, parameters)
    }

    /// The largest size of an argument of its polynomials in a step from z: more than 1 outside
    /// their box, and 0 for a network without polynomials.
    pub fn reach(&self, z: &[f64]) -> f64 {
        self.composition.reach(z)
    }

    /// What rounding may add to the reach of a point on the border of its polynomials' box.
    pub(crate) const ROUNDING_OF_REACH: f64 = 1e-12;

    /// Whether a step from z stays in the box of its polynomials, up to rounding, since an action of 0
    /// is on the border.
    pub fn is_in_box(&self, z: &[f64]) -> bool {
        self.reach(z) <= 1.0 + Self::ROUNDING_OF_REACH
    }

    /// The largest [reach](Model::reach) of points, 2n numbers each.
    pub fn largest_reach(&self, points: &[f64]) -> f64 {
        let reaches = points.par_chunks(2 * self.architecture.dof).map(|z| self.reach(z));
        reaches.reduce(|| 0.0, max_or_nan)
    }
}

impl<P: Scalar, S: Over<P>> Map<S> for Model<P> {
    fn dof(&self) -> usize {
        self.composition.dof()
    }
    fn forward(&self, z: &mut [S]) {
        self.composition.forward(z);
    }
    fn inverse(&self, z: &mut [S]) {
        self.composition.inverse(z);
    }
}

impl Architecture {
    /// A model with seeded random weights and all θ = `theta` (the frequency times
    /// the flow time, in training).
    ///
    /// # Errors
    /// Those of [`Architecture::check`].
    pub fn initialise(
        &self,
        weights: InitialWeights,
        theta: f64,
        seed: u64,
    ) -> Result<Model, Error> {
        self.check()?;
        self.check_boxes()?;
        let mut parameters = Vec::with_capacity(self.parameter_count());
        let mut streams = BTreeMap::new();
        for block in &self.blocks {
            let name = block.stream();
            let stream = streams.entry(name.clone()).or_insert_with(|| Stream::new(seed, &name));
            for (_, tensor) in block.tensors(self.surroundings()) {
                parameters.extend((0..tensor.len()).map(|_| weights.draw(tensor.law, stream)));
            }
        }
        parameters.extend(self.circles.iter().map(|_| theta));
        // Controls change nothing to begin with.
        parameters.resize(self.parameter_count(), 0.0);
        Model::new(self.clone(), parameters)
    }
}
