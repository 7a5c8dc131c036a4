//! Twists: flows of functions of the actions and of one half of the slow coordinates.

use super::quadratic_form::{QuadraticForm, symmetric_len};
use super::{
    ActionInterval, ElementaryMap, Potential, RidgeFunction, RidgePotential, Ridges, TorusAction,
    Turn,
};
use crate::error::Error;
use crate::phase::Half;
use crate::scalar::{Over, Pack, Real, Scalar, max_or_nan};
use std::ops::Range;

/// The planes that a torus action turns, the fast ones, and those that it leaves
/// alone, the slow ones.
#[derive(Clone, Debug)]
pub struct FastPlanes {
    action: TorusAction,
    dof: usize,
    fast: Vec<usize>,
    slow: Vec<usize>,
    circles: usize,
    /// m_{aj}: of each fast plane, in their order, as many as there are circles.
    weights: Vec<i32>,
}

/// The most circles that a twist keeps the actions of.
const CIRCLES: usize = 4;

impl FastPlanes {
    /// The most circles of an action that a twist can be of.
    pub(crate) const MOST_CIRCLES: usize = CIRCLES;

    /// The fast and slow planes of an action.
    ///
    /// # Errors
    /// When it has more circles than planes that turn, more than four, or no plane
    /// turns.
    pub fn new(action: &TorusAction) -> Result<Self, Error> {
        let (dof, circles) = (action.dof(), action.circles().len());
        let of_plane = |j: usize| action.circles().iter().map(move |circle| circle.weights()[j]);
        let (fast, slow): (Vec<_>, Vec<_>) = (0..dof).partition(|&j| of_plane(j).any(|m| m != 0));
        Error::check_count_range("planes that an action turns", fast.len(), 1, usize::MAX)?;
        let most = CIRCLES.min(fast.len());
        Error::check_count_range("circles of the actions of a twist", circles, 1, most)?;
        let weights = fast.iter().flat_map(|&j| of_plane(j)).collect();
        Ok(Self { action: action.clone(), dof, fast, slow, circles, weights })
    }

    /// Half the numbers of a point with the actions and angles of the circles.
    #[doc(hidden)]
    pub fn extended_dof(&self) -> usize {
        self.dof + self.circles
    }

    /// The rotation of each slow plane by a separate angle, with the fast planes fixed.
    pub fn slow_turn<P: Real>(&self, angles: &[P]) -> Turn<P> {
        let circle = |plane: &usize| Vec::from_iter((0..self.dof).map(|j| i32::from(j == *plane)));
        let circles: Vec<Vec<i32>> = self.slow.iter().map(circle).collect();
        let circles: Vec<&[i32]> = circles.iter().map(Vec::as_slice).collect();
        Turn::new(self.dof, &circles, angles)
    }

    /// The slow planes, which the action fixes.
    pub fn slow(&self) -> &[usize] {
        &self.slow
    }

    /// The numbers that G depends on: the actions, and one half of the slow coordinates.
    pub fn arguments(&self) -> usize {
        self.circles + self.slow.len()
    }

    /// Where the actions are in the box of this radius: |q_j|, |p_j| ≤ ρ within the circle.
    fn intervals(&self, radius: f64) -> Vec<ActionInterval> {
        let interval = |circle: usize| {
            let weights = (0..self.fast.len()).map(|number| self.weight::<f64>(number, circle));
            let (mut low, mut high) = (0.0, 0.0);
            for weight in weights {
                let side = if weight < 0.0 { &mut low } else { &mut high };
                *side += 0.5 * radius * radius * weight;
            }
            ActionInterval { centre: 0.5 * (low + high), inverse_half: 2.0 / (high - low) }
        };
        (0..self.circles).map(interval).collect()
    }

    /// m_{aj} of a fast plane and a circle.
    #[inline(always)]
    fn weight<S: Scalar>(&self, number: usize, circle: usize) -> S {
        S::from_f64(self.weights[number * self.circles + circle].into())
    }

    /// Computes the action of each circle at z, `actions` ← 𝔍_a.
    #[inline(always)]
    fn actions<S: Scalar>(&self, z: &[S], actions: &mut [S]) {
        for (circle, action) in actions.iter_mut().enumerate() {
            *action = self.action.circles()[circle].invariant(z);
        }
    }
}

/// The turn of a plane by an angle, as a half turn or none and three shears.
#[derive(Clone, Copy)]
struct StateTurn<S> {
    /// tan ½α′ and sin α′ of the rest of the angle, |α′| ≤ ½π.
    t: S,
    s: S,
    /// −1 with a half turn.
    sign: S,
}

impl<S: Scalar> StateTurn<S> {
    #[inline(always)]
    fn by<P>(angle: S) -> Self
    where
        S: Over<P>,
    {
        let (sin, cos) = angle.sin_cos();
        let sign = cos.sign();
        let s = sin * sign;
        Self { t: s / (S::from_f64(1.0) + cos * sign), s, sign }
    }

    #[inline(always)]
    fn back(self) -> Self {
        Self { t: -self.t, s: -self.s, ..self }
    }

    #[inline(always)]
    fn apply<P: Scalar>(self, q: &mut S, p: &mut S)
    where
        S: Over<P>,
    {
        let one = P::from_f64(1.0);
        *q = q.increment(one, self.t * *p);
        *p = p.increment(one, -self.s * *q);
        *q = q.increment(one, self.t * *p);
        (*q, *p) = (*q * self.sign, *p * self.sign);
    }
}

/// The shears of a twist: the planes that it rotates, and the neurons of each shear. Odd shears (the
/// first, the third, …) change slow positions, even ones slow momenta; in a turned twist each shear
/// changes the momenta in rotated coordinates of the slow planes.
#[derive(Clone, Debug)]
pub struct TwistShears {
    planes: FastPlanes,
    /// Each shear is in turned coordinates, changes momenta, and has no quadratic form.
    turned: bool,
    /// What the functions are made of, and the intervals of the actions in the box of polynomials.
    function: RidgeFunction,
    intervals: Vec<ActionInterval>,
    /// The neurons and the parameters of all shears before each, and of all.
    neurons: Vec<usize>,
    begins: Vec<usize>,
}

/// The function of one action that a shear of a twist is made of.
#[cfg(feature = "proofs")]
pub(crate) struct OfAction<'a> {
    /// The ridge functions of its generator.
    pub ridges: Ridges,
    /// The interval of the action, where they are polynomials.
    pub interval: Option<ActionInterval>,
    /// The parameters of the ridge functions.
    pub functions: &'a [f64],
    /// The factor of half the square of the action.
    pub form: f64,
}

impl RidgeFunction {
    /// The parameters of the quadratic form beside a shear's ridge functions in so many
    /// arguments: only the first, the third and so on have one, and none of polynomials.
    pub(crate) fn form_len(self, number: usize, arguments: usize) -> usize {
        let has_form = !self.is_polynomial() && number.is_multiple_of(2);
        if has_form { symmetric_len(arguments) } else { 0 }
    }
}

impl TwistShears {
    /// Shears with these numbers of neurons.
    pub fn new(planes: FastPlanes, widths: &[usize]) -> Self {
        Self::with_function(planes, widths, RidgeFunction::default(), false)
    }

    /// Turned shears with these numbers of neurons.
    pub fn turned(planes: FastPlanes, widths: &[usize]) -> Self {
        Self::with_function(planes, widths, RidgeFunction::default(), true)
    }

    /// Shears with these numbers of ridge functions, turned or not. Polynomials come without a
    /// quadratic form, since that is a polynomial too.
    pub fn with_function(
        planes: FastPlanes,
        widths: &[usize],
        function: RidgeFunction,
        turned: bool,
    ) -> Self {
        let intervals = match function {
            RidgeFunction::Neurons(_) => Vec::new(),
            RidgeFunction::Polynomial { radius, .. } => planes.intervals(radius),
        };
        let (mut neurons, mut begins) = (vec![0_usize], vec![0_usize]);
        for (number, &width) in widths.iter().enumerate() {
            let own = Ridges { width, function }.parameter_count(planes.arguments());
            let rest = match turned {
                true => planes.slow.len(),
                false => function.form_len(number, planes.arguments()),
            };
            neurons.push(neurons[number].saturating_add(width));
            begins.push(begins[number].saturating_add(own).saturating_add(rest));
        }
        Self { planes, turned, function, intervals, neurons, begins }
    }

    /// What turns a plane that there is nothing beside: its weight, and the functions of its action.
    #[cfg(feature = "proofs")]
    pub(crate) fn of_plane<'a>(&self, parameters: &'a [f64]) -> (i32, Vec<OfAction<'a>>) {
        debug_assert!(self.planes.dof == 1);
        let shear = |number: usize| {
            let (own, ridges) = (&parameters[self.parameters(number)], self.ridges(number));
            let (functions, form) = own.split_at(ridges.parameter_count(1));
            let interval = self.intervals.first().copied();
            OfAction { ridges, interval, functions, form: form.first().copied().unwrap_or(0.0) }
        };
        (self.planes.weights[0], (0..self.count()).map(shear).collect())
    }

    /// Where the angles of each turned shear begin among the parameters; none of others.
    pub(crate) fn angles(&self) -> &[usize] {
        if self.turned { &self.begins[..self.count()] } else { &[] }
    }

    /// The planes that are turned.
    pub fn planes(&self) -> &FastPlanes {
        &self.planes
    }

    /// The kind of their ridge functions.
    pub fn function(&self) -> RidgeFunction {
        self.function
    }

    /// The number of shears of the twist.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.neurons.len() - 1
    }

    /// How many parameters they have. Saturates instead of overflowing.
    pub fn parameter_count(&self) -> usize {
        self.begins[self.count()]
    }

    /// The half that a shear changes.
    #[inline(always)]
    fn target(&self, number: usize) -> Half {
        let of_positions = number.is_multiple_of(2) && !self.turned;
        if of_positions { Half::Position } else { Half::Momentum }
    }

    #[inline(always)]
    fn width(&self, number: usize) -> usize {
        self.neurons[number + 1] - self.neurons[number]
    }

    #[inline(always)]
    fn ridges(&self, number: usize) -> Ridges {
        Ridges { width: self.width(number), function: self.function }
    }

    /// Where the parameters of a shear are.
    #[inline(always)]
    fn parameters(&self, number: usize) -> Range<usize> {
        self.begins[number]..self.begins[number + 1]
    }

    /// The angles of each shear, before its other parameters.
    #[inline(always)]
    fn angles_len(&self) -> usize {
        if self.turned { self.planes.slow.len() } else { 0 }
    }

    /// Where a tape has what is recorded of a shear: u, (tanh, sech²) of each neuron, and the slow
    /// coordinates before and after a turned one.
    #[inline(always)]
    fn tape(&self, number: usize) -> Range<usize> {
        self.tape_begin(number)..self.tape_begin(number + 1)
    }

    #[inline(always)]
    fn tape_begin(&self, number: usize) -> usize {
        number * (self.planes.arguments() + 4 * self.angles_len()) + 2 * self.neurons[number]
    }
}

/// A composition of twist shears: the flows, for time c, of functions
/// G_l(𝔍, y) of the actions 𝔍 of the fast planes and of one half y of the slow
/// coordinates, alternately the momenta and the positions, momenta first.
///
/// The flow changes the other half of the slow coordinates by c∂G/∂p (positions) or −c∂G/∂q
/// (momenta), rotates the fast planes by c Σ_a m_{aj} ∂G/∂𝔍_a, and keeps 𝔍 and y
/// constant. It commutes with the torus action. Since no shear changes 𝔍, each plane
/// is rotated once, by the sum of the angles of all shears.
///
/// G_l is a [`RidgePotential`] of u = (𝔍, y), d numbers; `D` is d where it is known at
/// compile time. Where y are the momenta, ½uᵀQu is added to neurons: to leading order a kinetic
/// energy and a frequency that shifts with the action have this form. Where y are the positions there
/// is no such term: the increments of the momenta are bounded, and for no weights does a slow motion
/// grow faster than N² in N steps (with neurons; polynomials are bounded only in their box). The
/// parameters are those of G₁, G₂, …: W, b, w and, for momenta, the rows of the upper triangle of Q.
///
/// A turned twist has R(−φ)∘exp(cX_G)∘R(φ) for each shear: a rotation of each slow plane clockwise by
/// its angle φ_j, the flow of a function G(𝔍, q) of the actions and the slow positions q, and the rotation
/// back. It commutes with the torus action too, since R rotates only slow planes. It is the flow of
/// G(𝔍, q cos φ + p sin φ), with one φ per plane and p the slow momenta: with G a sum of
/// w tanh(a·𝔍 + b·q + β) and all φ these are all ridge functions of (𝔍, q, p). To first order in c, twists
/// that are not turned reach only A(𝔍, q) + B(𝔍, p). The parameters of a shear are
/// `[φ (one for each slow plane), W, b, w]`.
///
/// The inverse computes 𝔍 from the image point, which rounding has changed: where increments
/// are rounded to a grid, it is approximate, not exact.
#[derive(Clone, Copy, Debug)]
pub struct Twist<'a, P, const D: usize = 0> {
    /// The shears that the twist is composed of.
    pub shears: &'a TwistShears,
    /// The factor c of the generating functions.
    pub scale: P,
    /// The parameters, [`TwistShears::parameter_count`] of them.
    pub parameters: &'a [P],
    /// Whether this is the inverse map.
    pub inverse: bool,
    /// R(φ) of each shear of a turned twist, prepared for its angles; empty for other twists.
    pub turns: &'a [Turn<P>],
}

/// A shear of a twist.
struct Layer<'a, P, const D: usize> {
    number: usize,
    potential: RidgePotential<'a, P, D>,
    form: Option<QuadraticForm<'a, P, D>>,
    /// The half that it changes.
    target: Half,
    /// The factor of ∂G/∂y in its increment, and of ∂G/∂𝔍 in the angle.
    factor: P,
    turn: P,
}

impl<P: Scalar, const D: usize> Layer<'_, P, D> {
    /// `gradient` += that of the quadratic form.
    #[inline(always)]
    fn add_form<S: Over<P>>(&self, argument: &[S], gradient: &mut [S]) {
        if let Some(form) = self.form {
            form.add_gradient(argument, gradient);
        }
    }
}

impl<'a, P: Scalar, const D: usize> Twist<'a, P, D> {
    /// The number d of arguments of a shear.
    #[inline(always)]
    fn arguments(&self) -> usize {
        if D > 0 { D } else { self.planes().arguments() }
    }

    #[inline(always)]
    fn planes(&self) -> &'a FastPlanes {
        &self.shears.planes
    }

    /// How many neurons' parameters a shear has, before those of its quadratic form.
    #[inline(always)]
    fn neurons_len(&self, number: usize) -> usize {
        self.shears.ridges(number).parameter_count(self.arguments())
    }

    /// The one that is applied after `turn` others.
    #[inline(always)]
    fn layer(&self, turn: usize) -> Layer<'a, P, D> {
        let number = if self.inverse { self.shears.count() - 1 - turn } else { turn };
        let (d, place) = (self.arguments(), self.shears.parameters(number));
        let own = &self.parameters[place][self.shears.angles_len()..];
        let (neurons, form) = own.split_at(self.neurons_len(number));
        let (ridges, intervals) = (self.shears.ridges(number), &self.shears.intervals);
        let potential = RidgePotential::new(d, ridges, intervals, neurons);
        let form = if form.is_empty() { None } else { Some(QuadraticForm::new(d, form)) };
        let target = self.shears.target(number);
        let turn = if self.inverse { -self.scale } else { self.scale };
        let factor = if target == Half::Position { turn } else { -turn };
        Layer { number, potential, form, target, factor, turn }
    }

    /// The slow planes of a point, or of directions, to or from the coordinates of a shear.
    #[inline(always)]
    fn turn_slow<S: Over<P>>(&self, number: usize, back: bool, points: &mut [S]) {
        if let Some(turn) = self.turns.get(number) {
            for z in points.chunks_exact_mut(2 * self.planes().dof) {
                turn.apply(z, back);
            }
        }
    }

    /// `kept` ← the slow positions and momenta, of a turned twist.
    #[inline(always)]
    fn keep<S: Scalar>(&self, z: &[S], kept: &mut [S]) {
        for (pair, &j) in kept.chunks_exact_mut(2).zip(&self.planes().slow) {
            (pair[0], pair[1]) = (z[j], z[self.planes().dof + j]);
        }
    }

    /// `angles_bar` += `sign` times what a cotangent says of the generator q̇ = p, ṗ = −q of each
    /// slow plane at a kept point.
    #[inline(always)]
    fn add_moments<S: Scalar>(&self, sign: S, kept: &[S], z_bar: &[S], angles_bar: &mut [S]) {
        for (i, angle_bar) in angles_bar.iter_mut().enumerate() {
            let (j, q, p) = (self.planes().slow[i], kept[2 * i], kept[2 * i + 1]);
            *angle_bar += sign * (z_bar[j] * p - z_bar[self.planes().dof + j] * q);
        }
    }

    /// A factor of zero moves nothing, whatever the weights: 0·∞ is not 0.
    #[inline(always)]
    fn is_identity(&self) -> bool {
        self.scale.is_zero()
    }

    /// Copies the slow coordinates y that the shear leaves alone behind the actions, `argument` ← `[…, y]`.
    #[inline(always)]
    fn source<S: Scalar>(&self, layer: &Layer<'a, P, D>, z: &[S], argument: &mut [S]) {
        for (i, &j) in self.planes().slow.iter().enumerate() {
            argument[self.planes().circles + i] =
                z[layer.target.other().index(self.planes().dof, j)];
        }
    }

    /// The slow coordinates and `angles` += what the gradient says.
    #[inline(always)]
    fn add<S: Over<P>>(
        &self,
        layer: &Layer<'a, P, D>,
        gradient: &[S],
        z: &mut [S],
        angles: &mut [S; CIRCLES],
    ) {
        for (i, &j) in self.planes().slow.iter().enumerate() {
            let k = layer.target.index(self.planes().dof, j);
            z[k] = z[k].increment(layer.factor, gradient[self.planes().circles + i]);
        }
        for circle in 0..self.planes().circles {
            angles[circle] = gradient[circle].mul_add_parameter(layer.turn, angles[circle]);
        }
    }

    /// The derivative of [`Twist::add`] along a direction. That of the angles moves a
    /// point along its circle: it is added before the turn, which commutes with it.
    #[inline(always)]
    fn add_along<S: Over<P>>(
        &self,
        layer: &Layer<'a, P, D>,
        hessian: &[S],
        z: &[S],
        direction: &mut [S],
    ) {
        let FastPlanes { dof, circles, .. } = *self.planes();
        let d = self.arguments();
        let mut actions = [S::zero(); CIRCLES];
        for (number, &j) in self.planes().fast.iter().enumerate() {
            let along = z[dof + j].mul_add(direction[dof + j], z[j] * direction[j]);
            for circle in 0..circles {
                let weight = self.planes().weight(number, circle);
                actions[circle] = along.mul_add(weight, actions[circle]);
            }
        }
        for row in 0..d {
            let mut more = S::zero();
            for circle in 0..circles {
                more = hessian[row * d + circle].mul_add(actions[circle], more);
            }
            for (i, &j) in self.planes().slow.iter().enumerate() {
                let along = direction[layer.target.other().index(dof, j)];
                more = hessian[row * d + circles + i].mul_add(along, more);
            }
            if row >= circles {
                let k = layer.target.index(dof, self.planes().slow[row - circles]);
                direction[k] = more.mul_add_parameter(layer.factor, direction[k]);
                continue;
            }
            let angle = more.times(layer.turn);
            for (number, &j) in self.planes().fast.iter().enumerate() {
                let angle = angle * self.planes().weight(number, row);
                direction[j] = angle.mul_add(z[dof + j], direction[j]);
                direction[dof + j] = (-angle).mul_add(z[j], direction[dof + j]);
            }
        }
    }

    /// How many parts [`Twist::apply_part`] has.
    #[doc(hidden)]
    pub fn parts(&self) -> usize {
        let of_shear = if self.shears.turned { 3 } else { 1 };
        if self.is_identity() { 0 } else { of_shear * self.shears.count() + 2 }
    }

    /// One part of the map on `x`, the point and behind it the actions and the angles of the
    /// circles, 2·[`FastPlanes::extended_dof`] numbers, the last of them 0 in the beginning: the
    /// actions, then a shear after another (of a turned twist a turn, a shear, a turn back), then the
    /// turn. All of them, one after another, leave
    /// the image of the point: the same operations, for those who want to look between them.
    #[doc(hidden)]
    pub fn apply_part<S: Over<P>>(&self, part: usize, x: &mut [S]) {
        let circles = self.planes().circles;
        let (z, rest) = x.split_at_mut(2 * self.planes().dof);
        let (actions, angles) = rest.split_at_mut(circles);
        if part == 0 {
            return self.planes().actions(z, actions);
        }
        let mut all = [S::zero(); CIRCLES];
        all[..circles].copy_from_slice(angles);
        if part + 1 == self.parts() {
            return self.turn_all(&all, z, &mut []);
        }
        let layer = match self.shears.turned {
            true => {
                let layer = self.layer((part - 1) / 3);
                let stage = (part - 1) % 3;
                if stage != 1 {
                    return self.turn_slow(layer.number, stage == 2, z);
                }
                layer
            }
            false => self.layer(part - 1),
        };
        let mut argument = vec![S::zero(); self.arguments()];
        argument[..circles].copy_from_slice(actions);
        self.source(&layer, z, &mut argument);
        let mut gradient = vec![S::zero(); self.arguments()];
        layer.potential.gradient(&argument, &mut gradient);
        layer.add_form(&argument, &mut gradient);
        self.add(&layer, &gradient, z, &mut all);
        angles.copy_from_slice(&all[..circles]);
    }

    /// The turn of a fast plane by the sum of its angles.
    #[inline(always)]
    fn turn<S: Over<P>>(&self, number: usize, angles: &[S; CIRCLES]) -> StateTurn<S> {
        let mut angle = S::zero();
        for circle in 0..self.planes().circles {
            angle = angles[circle].mul_add(self.planes().weight(number, circle), angle);
        }
        StateTurn::by(angle)
    }

    /// Turns the fast planes of a point, and of directions.
    #[inline(always)]
    fn turn_all<S: Over<P>>(&self, angles: &[S; CIRCLES], z: &mut [S], directions: &mut [S]) {
        let dof = self.planes().dof;
        for (number, &j) in self.planes().fast.iter().enumerate() {
            let turn = self.turn(number, angles);
            let (q, p) = z.split_at_mut(dof);
            turn.apply::<P>(&mut q[j], &mut p[j]);
            for direction in directions.chunks_exact_mut(2 * dof) {
                let (q, p) = direction.split_at_mut(dof);
                turn.apply::<P>(&mut q[j], &mut p[j]);
            }
        }
    }
}

/// What is recorded of a fast plane: q and p before and after, t, s, the sign.
const OF_PLANE: usize = 7;

impl<P: Scalar, const D: usize> ElementaryMap<P> for Twist<'_, P, D> {
    #[inline(always)]
    fn dof(&self) -> usize {
        self.planes().dof
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        Self { inverse: !self.inverse, ..self }
    }

    #[inline(always)]
    fn tape_len(&self) -> usize {
        self.shears.tape_begin(self.shears.count()) + OF_PLANE * self.planes().fast.len()
    }

    #[inline(always)]
    fn activation_count(&self) -> usize {
        (0..self.shears.count()).map(|number| self.shears.ridges(number).activation_count()).sum()
    }

    fn reach(&self, z: &[f64], _: &mut [f64]) -> f64
    where
        f64: Over<P>,
    {
        if self.is_identity() || !self.shears.function.is_polynomial() {
            return 0.0;
        }
        let (d, mut z) = (self.arguments(), z.to_vec());
        let (mut argument, mut gradient) = (vec![0.0; d], vec![0.0; d]);
        self.planes().actions(&z, &mut argument[..self.planes().circles]);
        let (mut angles, mut reach) = ([0.0; CIRCLES], 0.0);
        for turn in 0..self.shears.count() {
            let layer = self.layer(turn);
            self.turn_slow(layer.number, false, &mut z);
            self.source(&layer, &z, &mut argument);
            reach = max_or_nan(reach, layer.potential.reach(&argument));
            layer.potential.gradient(&argument, &mut gradient);
            self.add(&layer, &gradient, &mut z, &mut angles);
            self.turn_slow(layer.number, true, &mut z);
        }
        reach
    }

    #[inline(always)]
    fn apply<S: Over<P>>(&self, z: &mut [S], scratch: &mut [S]) {
        if self.is_identity() {
            return;
        }
        let (argument, gradient) = scratch.split_at_mut(self.arguments());
        self.planes().actions(z, &mut argument[..self.planes().circles]);
        let mut angles = [S::zero(); CIRCLES];
        for turn in 0..self.shears.count() {
            let layer = self.layer(turn);
            self.turn_slow(layer.number, false, z);
            self.source(&layer, z, argument);
            layer.potential.gradient(argument, gradient);
            layer.add_form(argument, gradient);
            self.add(&layer, gradient, z, &mut angles);
            self.turn_slow(layer.number, true, z);
        }
        self.turn_all(&angles, z, &mut []);
    }

    #[inline(always)]
    fn forward_recorded<S: Over<P>>(&self, z: &mut [S], tape: &mut [S], scratch: &mut [S]) {
        if self.is_identity() {
            return;
        }
        let (d, dof) = (self.arguments(), self.planes().dof);
        let (actions, gradient) = scratch.split_at_mut(d);
        self.planes().actions(z, &mut actions[..self.planes().circles]);
        let mut angles = [S::zero(); CIRCLES];
        let (layers, planes) = tape.split_at_mut(self.shears.tape_begin(self.shears.count()));
        for turn in 0..self.shears.count() {
            let layer = self.layer(turn);
            let (argument, tape) = layers[self.shears.tape(layer.number)].split_at_mut(d);
            let (tape, kept) = tape.split_at_mut(2 * self.shears.width(layer.number));
            let (before, after) = kept.split_at_mut(kept.len() / 2);
            argument.copy_from_slice(actions);
            self.turn_slow(layer.number, false, z);
            self.keep(z, before);
            self.source(&layer, z, argument);
            layer.potential.gradient_recording(argument, gradient, tape);
            layer.add_form(argument, gradient);
            self.add(&layer, gradient, z, &mut angles);
            self.keep(z, after);
            self.turn_slow(layer.number, true, z);
        }
        let (q, p) = z.split_at_mut(dof);
        for (number, tape) in planes.chunks_exact_mut(OF_PLANE).enumerate() {
            let j = self.planes().fast[number];
            let turn = self.turn(number, &angles);
            (tape[0], tape[1]) = (q[j], p[j]);
            turn.apply::<P>(&mut q[j], &mut p[j]);
            (tape[2], tape[3]) = (q[j], p[j]);
            (tape[4], tape[5], tape[6]) = (turn.t, turn.s, turn.sign);
        }
    }

    #[inline(always)]
    fn vjp<S: Over<P>>(
        &self,
        tape: &[S],
        z_bar: &mut [S],
        parameters_bar: &mut [S],
        scratch: &mut [S],
    ) {
        if self.is_identity() {
            return;
        }
        let (d, dof, circles) = (self.arguments(), self.planes().dof, self.planes().circles);
        let (layers, planes) = tape.split_at(self.shears.tape_begin(self.shears.count()));
        // Of the angles of the circles, and of the actions.
        let mut angles_bar = [S::zero(); CIRCLES];
        let mut actions_bar = [S::zero(); CIRCLES];
        for (number, tape) in planes.chunks_exact(OF_PLANE).enumerate() {
            let j = self.planes().fast[number];
            let (q_bar, p_bar) = z_bar.split_at_mut(dof);
            // The derivative by the angle is the infinitesimal generator at the output.
            let angle_bar = q_bar[j] * tape[3] - p_bar[j] * tape[2];
            for circle in 0..circles {
                let weight = self.planes().weight(number, circle);
                angles_bar[circle] = angle_bar.mul_add(weight, angles_bar[circle]);
            }
            // A rotation is orthogonal: its adjoint is its inverse.
            let turn = StateTurn { t: tape[4], s: tape[5], sign: tape[6] };
            turn.back().apply::<P>(&mut q_bar[j], &mut p_bar[j]);
        }
        let (u, argument_bar) = scratch.split_at_mut(d);
        for turn in (0..self.shears.count()).rev() {
            let layer = self.layer(turn);
            let (argument, tape) = layers[self.shears.tape(layer.number)].split_at(d);
            let (tape, kept) = tape.split_at(2 * self.shears.width(layer.number));
            let (before, after) = kept.split_at(kept.len() / 2);
            let of_layer = &mut parameters_bar[self.shears.parameters(layer.number)];
            let (of_angles, of_layer) = of_layer.split_at_mut(self.shears.angles_len());
            // A rotation is orthogonal: its adjoint is its inverse, and the moments of its
            // generator are the same before and after it.
            self.turn_slow(layer.number, false, z_bar);
            self.add_moments(S::from_f64(-1.0), after, z_bar, of_angles);
            for circle in 0..circles {
                u[circle] = angles_bar[circle].times(layer.turn);
            }
            for (i, &j) in self.planes().slow.iter().enumerate() {
                u[circles + i] = z_bar[layer.target.index(dof, j)].times(layer.factor);
            }
            let (of_neurons, of_form) = of_layer.split_at_mut(self.neurons_len(layer.number));
            layer.potential.vjp(argument, tape, u, argument_bar, of_neurons);
            if let Some(form) = layer.form {
                form.vjp(argument, u, argument_bar, of_form);
            }
            for circle in 0..circles {
                actions_bar[circle] += argument_bar[circle];
            }
            for (i, &j) in self.planes().slow.iter().enumerate() {
                let k = layer.target.other().index(dof, j);
                z_bar[k] += argument_bar[circles + i];
            }
            self.add_moments(S::from_f64(1.0), before, z_bar, of_angles);
            self.turn_slow(layer.number, true, z_bar);
        }
        for (number, &j) in self.planes().fast.iter().enumerate() {
            let tape = &planes[number * OF_PLANE..];
            for circle in 0..circles {
                let factor = actions_bar[circle] * self.planes().weight(number, circle);
                z_bar[j] = factor.mul_add(tape[0], z_bar[j]);
                z_bar[dof + j] = factor.mul_add(tape[1], z_bar[dof + j]);
            }
        }
    }

    #[inline(always)]
    fn jvp<S: Over<P>>(&self, z: &mut [S], directions: &mut [S], scratch: &mut [S]) {
        if self.is_identity() {
            return;
        }
        let (d, dof, circles) = (self.arguments(), self.planes().dof, self.planes().circles);
        let (argument, rest) = scratch.split_at_mut(d);
        let (gradient, rest) = rest.split_at_mut(d);
        let hessian = &mut rest[..d * d];
        self.planes().actions(z, &mut argument[..circles]);
        let mut angles = [S::zero(); CIRCLES];
        for turn in 0..self.shears.count() {
            let layer = self.layer(turn);
            self.turn_slow(layer.number, false, z);
            self.turn_slow(layer.number, false, directions);
            self.source(&layer, z, argument);
            layer.potential.gradient_and_hessian(argument, gradient, hessian);
            layer.add_form(argument, gradient);
            if let Some(form) = layer.form {
                form.add_hessian(hessian);
            }
            for direction in directions.chunks_exact_mut(2 * dof) {
                self.add_along(&layer, hessian, z, direction);
            }
            self.add(&layer, gradient, z, &mut angles);
            self.turn_slow(layer.number, true, z);
            self.turn_slow(layer.number, true, directions);
        }
        self.turn_all(&angles, z, directions);
    }

    #[inline(always)]
    fn apply_across<V: Pack<P>>(&self, z: &mut [P], scratch: &mut [P])
    where
        P: Over<P>,
    {
        if self.is_identity() {
            return;
        }
        let (argument, gradient) = scratch.split_at_mut(self.arguments());
        self.planes().actions(z, &mut argument[..self.planes().circles]);
        let mut angles = [P::zero(); CIRCLES];
        for turn in 0..self.shears.count() {
            let layer = self.layer(turn);
            self.turn_slow(layer.number, false, z);
            self.source(&layer, z, argument);
            layer.potential.gradient_across::<V>(argument, gradient);
            layer.add_form(argument, gradient);
            self.add(&layer, gradient, z, &mut angles);
            self.turn_slow(layer.number, true, z);
        }
        self.turn_all(&angles, z, &mut []);
    }
}
