//! A composition of steps over one flat parameter vector.

use super::controls::Controls;
use super::step::{Kind, Step, Visitor};
use super::visits::{Across, Apply, ApplyShears, ForwardRecorded, Jvp, Vjp};
use crate::error::Error;
use crate::layer::{ElementaryMap, Reversor, TorusAction, Turn, TurnFraction, TwistShears};
use crate::phase::{Direction, Map};
use crate::scalar::{Kernel, Over, Pack, Real, Scalar, max_or_nan, on_lanes};
use std::any::Any;
use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;

/// A map given as a sequence of steps.
///
/// Its parameters are one flat vector (see the [module](super) for the order).
/// Every step refers to a part of it, and several steps may share a layer, as
/// those of ψ and ψ⁻¹ do in a gyroceptron.
#[derive(Clone, Debug)]
pub struct Composition<P> {
    dof: usize,
    steps: Vec<Step>,
    parameters: Vec<P>,
    epsilon: P,
    /// One for each turn of a step, prepared for the angles it points to.
    turns: Vec<Turn<P>>,
    /// What the parameters are polynomials of: those that steps point to are the constant terms.
    controls: Option<Arc<Controls>>,
}

/// Neurons of one point in the lanes: four rather than eight, whose division takes longer.
pub(crate) const NEURONS: usize = 4;

/// A map or its inverse on one point, a neuron in each of the lanes.
struct OnePoint<'a> {
    map: &'a Composition<f64>,
    direction: Direction,
    z: &'a mut [f64],
    scratch: &'a mut [f64],
}

impl Kernel for OnePoint<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Pack>(self) {
        self.map.apply_across::<V>(self.direction, self.z, self.scratch);
    }
}

/// A visitor that returns [`ElementaryMap::tape_len`] and [`ElementaryMap::activation_count`] of a step.
#[derive(Clone, Copy)]
struct Sizes;

impl<'a, P: Scalar> Visitor<'a, P> for Sizes {
    type Output = (usize, usize);
    #[inline(always)]
    fn visit(self, map: impl ElementaryMap<P> + 'a) -> (usize, usize) {
        (map.tape_len(), map.activation_count())
    }
}

/// A visitor that returns [`ElementaryMap::reach`] of a step from the point `z`.
struct Reach<'s> {
    z: &'s [f64],
    scratch: &'s mut [f64],
}

impl<'a, P: Scalar> Visitor<'a, P> for Reach<'_>
where
    f64: Over<P>,
{
    type Output = f64;
    #[inline(always)]
    fn visit(self, map: impl ElementaryMap<P> + 'a) -> f64 {
        map.reach(self.z, self.scratch)
    }
}

/// The tape that a forward pass records for the pullback, and working space for both.
#[derive(Clone, Debug)]
pub struct Recording<S> {
    tape: Vec<S>,
    scratch: Vec<S>,
}

/// Small maps keep their working space on the stack.
const STACK: usize = 16;

impl<P: Scalar> Composition<P> {
    /// A composition without steps: the identity in `dof` degrees of freedom.
    pub(super) fn new(dof: usize, parameters: Vec<P>, epsilon: P) -> Self {
        let (steps, turns, controls) = (Vec::new(), Vec::new(), None);
        Self { dof, steps, parameters, epsilon, turns, controls }
    }

    /// Appends a step, which is applied after all others.
    pub(super) fn push(&mut self, step: Step) {
        self.steps.push(step);
    }

    /// Appends the steps of another composition, or those of its inverse. Its
    /// parameters are those of this one from `offset` on.
    pub(super) fn push_all(&mut self, other: &Self, offset: usize, direction: Direction) {
        let turns = self.turns.len();
        self.turns.extend(other.turns.iter().cloned());
        let is_inverse = direction == Direction::Inverse;
        let moved = other.steps.iter().map(|step| {
            let mut kind = step.kind.clone();
            kind.prepared_mut().into_iter().for_each(|prepared| *prepared += turns);
            Step {
                kind,
                parameters: step.parameters.start + offset..step.parameters.end + offset,
                inverse: step.inverse != is_inverse,
                near_identity: step.near_identity,
                time: step.time,
            }
        });
        if is_inverse { self.steps.extend(moved.rev()) } else { self.steps.extend(moved) }
    }

    /// This map followed by another one or its inverse. Its parameters are those of
    /// this map, then those of the other.
    ///
    /// # Errors
    /// When they differ in their degrees of freedom, or in ε with steps scaled by
    /// it in both.
    pub fn followed_by(&self, other: &Self, direction: Direction) -> Result<Self, Error> {
        Error::check_count("degrees of freedom", self.dof, other.dof)?;
        let scaled = |map: &Self| map.steps.iter().any(|step| step.near_identity);
        let same = (self.epsilon - other.epsilon).is_zero();
        if scaled(self) && scaled(other) && !same {
            let found = format!("{:?}", other.epsilon);
            return Err(Error::invalid("epsilon", found, format!("{:?}", self.epsilon)));
        }
        let epsilon = if scaled(self) { self.epsilon } else { other.epsilon };
        // It is a map of no controls: both are at the middle of their ranges.
        let mut out = Self { epsilon, controls: None, ..self.clone() };
        out.push_all(other, self.parameters.len(), direction);
        out.parameters.extend_from_slice(&other.parameters);
        Ok(out)
    }

    /// The number of degrees of freedom.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// The parameters of all steps, one after another.
    pub fn parameters(&self) -> &[P] {
        &self.parameters
    }

    /// ε of the near-identity steps.
    pub fn epsilon(&self) -> P {
        self.epsilon
    }

    /// The composition of only the steps that ε scales, over the same parameters: I_ε of a
    /// gyroceptron, or ψ_ε∘T_ε∘ψ_ε⁻¹ of a normal form, without the steps between. The reflections
    /// of a reversible map are kept.
    pub fn near_identity_part(&self) -> Self {
        let is_part = |step: &&Step| step.near_identity || matches!(step.kind, Kind::Reflection(_));
        let steps = self.steps.iter().filter(is_part).cloned().collect();
        Self { steps, ..self.clone() }
    }

    /// The composition without some of its steps, over the same parameters.
    pub(crate) fn without(&self, steps: Range<usize>) -> Self {
        let kept = self.steps.iter().enumerate().filter(|(index, _)| !steps.contains(index));
        Self { steps: kept.map(|(_, step)| step.clone()).collect(), ..self.clone() }
    }

    /// Each step as a separate map, in the order of application.
    pub fn step_by_step(&self) -> impl Iterator<Item = Self> + '_ {
        let alone = |step: &Step| Self { steps: vec![step.clone()], ..self.clone() };
        self.steps.iter().map(alone)
    }

    /// This map at another ε.
    pub fn with_epsilon(&self, epsilon: P) -> Self {
        Self { epsilon, ..self.clone() }
    }

    /// The range of the angles of its circles among the parameters: those of its first turn; empty
    /// without a turn.
    pub fn angles(&self) -> Range<usize> {
        let is_turn = |step: &&Step| matches!(step.kind, Kind::Turn { .. });
        let turn = self.steps.iter().find(is_turn);
        turn.map_or(0..0, |step| step.parameters.clone())
    }

    /// These steps with other parameters and another ε, which may be of another
    /// number type.
    ///
    /// # Errors
    /// When there are more or fewer parameters.
    pub fn with_parameters<Q: Real>(
        &self,
        parameters: Vec<Q>,
        epsilon: Q,
    ) -> Result<Composition<Q>, Error> {
        Error::check_count("parameters", self.parameters.len(), parameters.len())?;
        Ok(self.over(parameters, epsilon, self.controls.clone()))
    }

    /// The same steps with these parameters, of any number type.
    fn over<Q: Real>(
        &self,
        parameters: Vec<Q>,
        epsilon: Q,
        controls: Option<Arc<Controls>>,
    ) -> Composition<Q> {
        let (mut steps, mut turns) = (self.steps.clone(), Vec::new());
        for step in &mut steps {
            let (own, begins) = (&parameters[step.parameters.clone()], step.kind.angles().to_vec());
            if let Some(prepared) = step.kind.prepared_mut() {
                let first = std::mem::replace(prepared, turns.len());
                for (turn, begin) in self.turns[first..].iter().zip(begins) {
                    turns.push(turn.with_angles(&own[begin..begin + turn.angle_count()]));
                }
            }
        }
        Composition { dof: self.dof, steps, parameters, epsilon, turns, controls }
    }

    /// The member of its family of maps at another ε and at `time` times its flow time: the angles of its circles and
    /// the times of its steps that the flow time scales are multiplied by `time`. A map without circles belongs to no
    /// family and is returned unchanged.
    ///
    /// In a map with several turns, as [`Composition::followed_by`] makes, only the first counts as its
    /// circles. In nested calls the factors `time` multiply, whereas the last ε replaces the others.
    pub fn with_epsilon_and_time(&self, epsilon: P, time: P) -> Self
    where
        P: Real,
    {
        if self.angles().is_empty() {
            return self.clone();
        }
        let parameters = self.parameters_at(time);
        let mut out = self.with_parameters(parameters, epsilon).expect("as many parameters");
        for of_step in out.steps.iter_mut().filter_map(|step| step.time.as_mut()) {
            *of_step *= time.value();
        }
        out
    }

    /// The member of its family of maps at this ε and time, as [`Composition::with_epsilon_and_time`], and at these values of its
    /// controls, or at the middle of their ranges when `controls` is empty.
    ///
    /// # Errors
    /// Those of [`Composition::at_controls`].
    pub fn member(&self, epsilon: P, time: P, controls: &[P]) -> Result<Self, Error>
    where
        P: Real + Over<P>,
    {
        match self.controls.is_none() || controls.is_empty() {
            true => Ok(self.with_epsilon_and_time(epsilon, time)),
            false => Ok(self.at_controls(controls)?.with_epsilon_and_time(epsilon, time)),
        }
    }

    /// The parameters with the angles of the circles `time` times.
    pub(super) fn parameters_at(&self, time: P) -> Vec<P> {
        let mut parameters = self.parameters.clone();
        let (angles, size) = (self.angles(), parameters.len() / self.terms());
        for of_term in parameters.chunks_exact_mut(size.max(1)) {
            for angle in &mut of_term[angles.clone()] {
                *angle *= time;
            }
        }
        parameters
    }

    /// The controls of which its parameters are polynomials, if any.
    pub fn controls(&self) -> Option<&Controls> {
        self.controls.as_deref()
    }

    /// How many products of controls its parameters are sums over.
    fn terms(&self) -> usize {
        self.controls().map_or(1, Controls::terms)
    }

    /// Its parameters are polynomials of these.
    pub(super) fn on_controls(self, controls: Option<&Controls>) -> Self {
        Self { controls: controls.cloned().map(Arc::new), ..self }
    }

    /// The parameters at these [products of controls](Controls::products).
    pub(super) fn parameters_of<Q: Over<P>>(&self, products: &[Q]) -> Vec<Q> {
        let size = self.parameters.len() / products.len();
        let (constant, rest) = self.parameters.split_at(size);
        let mut out: Vec<Q> = constant.iter().map(|parameter| Q::embed(*parameter)).collect();
        for (product, of_term) in products[1..].iter().zip(rest.chunks_exact(size.max(1))) {
            for (sum, parameter) in out.iter_mut().zip(of_term) {
                *sum = product.mul_add_parameter(*parameter, *sum);
            }
        }
        out
    }

    /// The map at these values of its controls, as a map without controls: its parameters are θ(λ), of the number
    /// type of the values. Of [dual numbers](crate::scalar::Dual) they have derivatives with respect to λ.
    ///
    /// # Errors
    /// When there is not one value for each control.
    pub fn at_controls<Q: Real + Over<P>>(&self, values: &[Q]) -> Result<Composition<Q>, Error> {
        let count = self.controls().map_or(0, |controls| controls.ranges.len());
        Error::check_count("values of controls", count, values.len())?;
        let products =
            self.controls().map_or_else(|| vec![Q::from_f64(1.0)], |of| of.products(values));
        Ok(self.over(self.parameters_of(&products), Q::embed(self.epsilon), None))
    }

    /// The steps, in the order of application.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    #[inline(always)]
    pub(super) fn turn(&self, prepared: usize) -> &Turn<P> {
        &self.turns[prepared]
    }

    /// So many prepared turns, from this one on.
    #[inline(always)]
    pub(super) fn turns(&self, first: usize, count: usize) -> &[Turn<P>] {
        &self.turns[first..first + count]
    }

    /// The inverse map, as a composition.
    pub fn inverted(&self) -> Self {
        let (steps, turns) = (Vec::new(), Vec::new());
        let mut out = Self { steps, turns, ..self.clone() };
        out.push_all(self, 0, Direction::Inverse);
        out
    }

    /// Passes each step of the map, or of its inverse, to a visitor, in the order of
    /// application.
    pub fn visit_steps<'a, T: Visitor<'a, P> + Copy>(
        &'a self,
        direction: Direction,
        visitor: T,
    ) -> Vec<T::Output> {
        let is_inverse = direction == Direction::Inverse;
        let mut out: Vec<_> =
            self.steps.iter().map(|step| self.bind(step, is_inverse, visitor)).collect();
        if is_inverse {
            out.reverse();
        }
        out
    }

    /// The largest size of an argument of its polynomials when z is mapped: more than 1 outside
    /// the box for which they are made, and 0 for a map without polynomials.
    pub(crate) fn reach(&self, z: &[f64]) -> f64
    where
        f64: Over<P>,
    {
        if !self.steps.iter().any(|step| step.kind.is_of_polynomials()) {
            return 0.0;
        }
        let (mut z, mut scratch) = (z.to_vec(), vec![0.0; z.len()]);
        let mut reach = 0.0;
        for step in &self.steps {
            reach =
                max_or_nan(reach, self.bind(step, false, Reach { z: &z, scratch: &mut scratch }));
            self.bind(step, false, Apply { z: &mut z[..], scratch: &mut scratch[..] });
        }
        reach
    }

    /// The number of evaluations of tanh (with its sech²) in one evaluation of the map.
    pub fn activation_count(&self) -> usize {
        self.visit_steps(Direction::Forward, Sizes).iter().map(|(_, count)| count).sum()
    }

    /// The map or its inverse on points of 2n numbers. Of several points each makes
    /// a step before the next one: while the last results of one are awaited, the
    /// processor has the others.
    #[inline(always)]
    pub(crate) fn apply<S: Over<P>>(&self, direction: Direction, z: &mut [S], scratch: &mut [S]) {
        let is_inverse = direction == Direction::Inverse;
        for number in 0..self.steps.len() {
            // One loop for both: the step is compiled into it once.
            let number = if is_inverse { self.steps.len() - 1 - number } else { number };
            self.bind(&self.steps[number], is_inverse, Apply { z, scratch });
        }
    }

    /// [`Composition::apply`] of a map that [`Composition::check_on_grid`] lets pass.
    #[inline(always)]
    pub(super) fn apply_shears<S: Over<P>>(
        &self,
        direction: Direction,
        z: &mut [S],
        scratch: &mut [S],
    ) {
        let is_inverse = direction == Direction::Inverse;
        for number in 0..self.steps.len() {
            let number = if is_inverse { self.steps.len() - 1 - number } else { number };
            self.bind(&self.steps[number], is_inverse, ApplyShears(Apply { z, scratch }));
        }
    }

    /// The map or its inverse on one point, a neuron in each lane: the same bits
    /// as [`Composition::apply`].
    #[inline(always)]
    pub(crate) fn apply_across<V: Pack<P>>(
        &self,
        direction: Direction,
        z: &mut [P],
        scratch: &mut [P],
    ) where
        P: Over<P>,
    {
        let is_inverse = direction == Direction::Inverse;
        for number in 0..self.steps.len() {
            let number = if is_inverse { self.steps.len() - 1 - number } else { number };
            let across = Across::<P, V> { z, scratch, lanes: PhantomData };
            self.bind(&self.steps[number], is_inverse, across);
        }
    }

    /// z ← P(z), and each of `directions`, 2n numbers after one another, ←
    /// ∂P/∂z times it: the chain rule over the steps. `scratch` holds at least
    /// 2n + n² numbers.
    #[inline(always)]
    pub(super) fn jvp<S: Over<P>>(&self, z: &mut [S], directions: &mut [S], scratch: &mut [S]) {
        for step in &self.steps {
            self.bind(step, false, Jvp { z, directions, scratch });
        }
    }

    /// One point; of `f64` with its neurons in the lanes of vector registers, to the same bits.
    pub(super) fn move_point<S: Over<P>>(&self, direction: Direction, z: &mut [S]) {
        assert!(z.len() == 2 * self.dof, "a point of {} numbers in {} dof", z.len(), self.dof);
        let mut stack = [S::zero(); STACK];
        let mut heap;
        let scratch = if z.len() <= STACK {
            &mut stack[..z.len()]
        } else {
            heap = vec![S::zero(); z.len()];
            &mut heap[..]
        };
        let plain = (self as &dyn Any).downcast_ref::<Composition<f64>>();
        if let (Some(map), Some(z), Some(scratch)) = (plain, S::as_plain(z), S::as_plain(scratch)) {
            return on_lanes::<NEURONS, _>(OnePoint { map, direction, z, scratch });
        }
        self.apply(direction, z, scratch);
    }

    /// Space for [`Composition::forward_recorded`] and
    /// [`Composition::vjp`]: n + 2h numbers for a kick, 3n + 2h for a turned one, 5n + 2h for a turned coupling,
    /// 2n for a turn, d + 2h for a twist shear of d arguments (and 4 for each slow plane if it is turned), and 7
    /// for each fast plane of a twist.
    pub fn recording<S: Over<P>>(&self) -> Recording<S> {
        self.recording_of(1)
    }

    /// Space for so many points at once.
    pub(crate) fn recording_of<S: Over<P>>(&self, points: usize) -> Recording<S> {
        let sizes = self.visit_steps(Direction::Forward, Sizes);
        let tape: usize = sizes.iter().map(|(tape, _)| tape).sum();
        let tape = vec![S::zero(); points * tape];
        Recording { tape, scratch: vec![S::zero(); 2 * self.dof] }
    }

    #[inline(always)]
    fn step_tape_len(&self, step: &Step) -> usize {
        self.bind(step, false, Sizes).0
    }

    /// z ← P(z) for each of the points in z, as many as the recording has space
    /// for, recording what the pullback needs.
    #[inline(always)]
    pub(crate) fn forward_recorded_each<S: Over<P>>(
        &self,
        z: &mut [S],
        recording: &mut Recording<S>,
    ) {
        let points = z.len() / (2 * self.dof);
        let mut tape = &mut recording.tape[..];
        let scratch = &mut recording.scratch[..];
        for step in &self.steps {
            let (step_tape, rest) = tape.split_at_mut(self.step_tape_len(step) * points);
            tape = rest;
            self.bind(step, false, ForwardRecorded { z, tape: step_tape, scratch });
        }
    }

    /// The adjoint at the recorded points.
    #[inline(always)]
    pub(crate) fn vjp_each<S: Over<P>>(
        &self,
        recording: &mut Recording<S>,
        z_bar: &mut [S],
        parameters_bar: &mut [S],
    ) {
        let points = z_bar.len() / (2 * self.dof);
        let mut tape = &recording.tape[..];
        let scratch = &mut recording.scratch[..];
        for step in self.steps.iter().rev() {
            let (rest, step_tape) = tape.split_at(tape.len() - self.step_tape_len(step) * points);
            tape = rest;
            let parameters_bar = &mut parameters_bar[step.parameters.clone()];
            let vjp = Vjp { tape: step_tape, z_bar, parameters_bar, scratch };
            self.bind(step, false, vjp);
        }
    }

    /// z ← P(z), filling `recording` (of [`Composition::recording`]).
    pub fn forward_recorded<S: Over<P>>(&self, z: &mut [S], recording: &mut Recording<S>) {
        assert!(z.len() == 2 * self.dof);
        self.forward_recorded_each(z, recording);
    }

    /// The pullback at the recorded point: it turns `z_bar` from the cotangent of
    /// P(z) into the cotangent of z, and adds the cotangent of the parameters to
    /// `parameters_bar`. It costs about two evaluations.
    ///
    /// Source: Griewank and Walther, Evaluating Derivatives,
    /// <https://doi.org/10.1137/1.9780898717761>, chapter 3, the reverse mode.
    pub fn vjp<S: Over<P>>(
        &self,
        recording: &mut Recording<S>,
        z_bar: &mut [S],
        parameters_bar: &mut [S],
    ) {
        assert!(z_bar.len() == 2 * self.dof && parameters_bar.len() == self.parameters.len());
        self.vjp_each(recording, z_bar, parameters_bar);
    }
}

impl<P: Real> Composition<P> {
    /// A single turn, whose angles are the parameters: a circle or torus action, to be
    /// composed with other maps by [`Composition::followed_by`].
    ///
    /// # Errors
    /// When there is not one angle for each circle.
    pub fn of_turn(action: &TorusAction, angles: Vec<P>) -> Result<Self, Error> {
        Error::check_count("angles", action.circles().len(), angles.len())?;
        let count = angles.len();
        let mut out = Self::new(action.dof(), angles, P::from_f64(1.0));
        out.push_turn(action, 0..count);
        Ok(out)
    }

    /// Appends the reflection of a reversible map.
    pub(super) fn push_reflection(&mut self, reversor: Reversor) {
        let (kind, parameters) = (Kind::Reflection(reversor), 0..0);
        let (inverse, near_identity, time) = (false, false, None);
        self.steps.push(Step { kind, parameters, inverse, near_identity, time });
    }

    /// Prepares the turns of the slow planes of each shear of a turned twist, whose parameters begin
    /// here; the first of them.
    pub(super) fn prepare_slow(&mut self, shears: &TwistShears, start: usize) -> usize {
        let (planes, first) = (shears.planes(), self.turns.len());
        for begin in shears.angles() {
            let angles = &self.parameters[start + begin..][..planes.slow().len()];
            self.turns.push(planes.slow_turn(angles));
        }
        first
    }

    /// Prepares the turn of each plane by its angle, the first of these parameters.
    pub(super) fn prepare(&mut self, parameters: &Range<usize>) -> usize {
        let angles = &self.parameters[parameters.clone()][..self.dof];
        self.turns.push(Turn::by_angles(angles));
        self.turns.len() - 1
    }

    /// Appends a turn whose angles are these of the parameters, one for each circle
    /// of the action.
    pub(super) fn push_turn(&mut self, action: &TorusAction, angles: Range<usize>) {
        let prepared = self.turns.len();
        self.turns.push(action.turn_by(&self.parameters[angles.clone()]));
        let kind = Kind::Turn { prepared };
        let (parameters, inverse, near_identity, time) = (angles, false, false, None);
        self.steps.push(Step { kind, parameters, inverse, near_identity, time });
    }
}

impl Composition<f64> {
    /// [`Composition::of_turn`] by exact fractions of a full turn; its parameters are the angles in
    /// radians.
    ///
    /// # Errors
    /// Those of [`Composition::of_turn`].
    pub fn of_turn_fractions(action: &TorusAction, angles: &[TurnFraction]) -> Result<Self, Error> {
        let radians = angles.iter().map(|angle| angle.radians()).collect();
        let mut out = Self::of_turn(action, radians)?;
        out.turns = vec![action.turn_by_fractions(angles)];
        Ok(out)
    }
}

impl<P: Scalar, S: Over<P>> Map<S> for Composition<P> {
    fn dof(&self) -> usize {
        self.dof
    }

    fn forward(&self, z: &mut [S]) {
        self.move_point(Direction::Forward, z);
    }

    fn inverse(&self, z: &mut [S]) {
        self.move_point(Direction::Inverse, z);
    }
}
