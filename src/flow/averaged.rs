//! Averaged equations: the slow motion without the fast angle, and the changes of coordinates to and from it.

use super::Splitting;
use super::numerical_method::NumericalMethod;
use super::request::{Method, Request};
use super::splitting::MicroSteps;
use super::stroboscopic::StroboscopicSettings;
use crate::error::Error;
use crate::layer::Turn;
use crate::scalar::{Elementary, Over, Pack, Task};
use crate::system::{
    AverageConstants, AveragePart, Hamiltonian, NearlyPeriodic, ParticleField, Splittable, System,
};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::iter;

/// The flow by the averaged equation, for a system whose limit ε = 0 rotates coordinate planes along one circle.
///
/// Let Φ be the circle action with angle φ, and ω₀ the frequency of the limit. Then w = Φ_{−ω₀t}z obeys
/// dw/dt = f(w, ω₀t), f(w, φ) = Φ_{−φ}X₁(Φ_φ w), where X₁, of size ε, is the vector field minus that of the limit.
/// The averaged point W is defined by w = W + u(W, φ) with
///
/// ω₀ ∂u/∂φ = f − ⟨f⟩, ⟨u⟩ = 0, and dW/dt = ⟨f(W, ·)⟩ at first order, ⟨f(W + u(W, ·), ·)⟩ at second order.
///
/// Averages are taken over equally spaced angles, and are exact except for harmonics that these do not
/// resolve. Classical Runge–Kutta steps advance W; the rotation by ω₀t is then applied at once. Over
/// times of 1/ε the errors are O(ε) and O(ε²). Each dW/dt takes (angles × order) evaluations of the
/// vector field; in [closed form](NearlyPeriodic::averaged_field) it takes one evaluation of the average, or, where
/// its Hamiltonian is a sum of parts with exact flows, steps of a splitting. At second order the closed form is that of
/// a Lie series, whose coordinates differ from W by O(ε²), no more than the errors.
/// Entering, W = z − u(z, 0), which is so to O(ε²), and leaving the averaged coordinates each take one evaluation for
/// each of the angles.
///
/// Source: Sanders, Verhulst and Murdock, <https://doi.org/10.1007/978-0-387-48918-6>, sections 2.8 and 2.9.
#[derive(Clone, Debug)]
pub struct Averaged {
    /// Φ at each of the angles.
    turns: Vec<Turn<f64>>,
    /// u(W, 0) = Σ of these times f at each of the angles.
    weights: Vec<f64>,
    /// Φ at the angle of the whole time.
    whole: Turn<f64>,
    /// ω₀ m_j of each plane.
    frequencies: Vec<f64>,
    time: f64,
    order: usize,
    closed: bool,
    /// The weights of the circle action.
    circle: Vec<i32>,
    split: Option<Split>,
}

/// Steps of a splitting of the closed average.
#[derive(Clone, Debug)]
struct Split {
    count: usize,
    /// The flows before the first step, in a step, between two steps, and after the last step.
    first: Vec<PartFlow>,
    within: Vec<PartFlow>,
    between: Vec<PartFlow>,
    last: Vec<PartFlow>,
}

/// The flow of a part of the closed average.
#[derive(Clone, Debug)]
struct PartFlow {
    part: AveragePart,
    time: f64,
    /// The turn of planes that part A has beside its flow.
    turn: Option<Turn<f64>>,
}

impl Split {
    fn new(
        frequencies: &[f64],
        splitting: Splitting,
        (count, step): (usize, f64),
        has_cross: bool,
    ) -> Self {
        let of_a = |time: f64| {
            let angles: Vec<f64> = frequencies.iter().map(|w| w * time).collect();
            PartFlow { part: AveragePart::A, time, turn: Some(Turn::by_angles(&angles)) }
        };
        let of = |part: AveragePart, time: f64| PartFlow { part, time, turn: None };
        let cross = |share: f64| has_cross.then(|| of(AveragePart::Cross, share * step));
        let end = || of_a(splitting.a(0) * step);
        let between = match cross(1.0) {
            Some(cross) => vec![end(), cross, end()],
            None => vec![of_a(2.0 * splitting.a(0) * step)],
        };
        let within = (0..splitting.stages).flat_map(|i| {
            let last = i + 1 == splitting.stages;
            let then = (!last).then(|| of_a(splitting.a(i + 1) * step));
            iter::once(of(AveragePart::B, splitting.b(i) * step)).chain(then)
        });
        Self {
            count,
            first: cross(0.5).into_iter().chain([end()]).collect(),
            within: within.collect(),
            between,
            last: iter::once(end()).chain(cross(0.5)).collect(),
        }
    }

    /// Moves several points, each with its constants, and adds the angles by which their circles turn.
    #[inline(always)]
    fn take<S: Over<f64> + Elementary>(
        &self,
        system: &impl NearlyPeriodic,
        z: &mut [S],
        (constants, angles): (&[AverageConstants<S>], &mut [S]),
    ) {
        let dim = 2 * system.dof();
        // One call in the source, since each is compiled for all parts.
        for k in 0..=2 * self.count {
            let flows = match k {
                0 => &self.first,
                _ if k == 2 * self.count => &self.last,
                _ if k.is_multiple_of(2) => &self.between,
                _ => &self.within,
            };
            for PartFlow { part, time, turn } in flows {
                let time = S::from_f64(*time);
                let points = z.chunks_exact_mut(dim).zip(constants).zip(&mut *angles);
                for ((z, constants), angle) in points {
                    if let Some(turn) = turn {
                        turn.apply(z, false);
                    }
                    *angle += system.flow_of_average(*part, z, constants, time);
                }
            }
        }
    }
}

impl Averaged {
    /// The largest number of degrees of freedom that is supported.
    pub const MOST_DOF: usize = MOST / 2;

    /// The method over `time`, with averages over `angles` angles, of first or second order.
    ///
    /// # Panics
    /// When `angles` is 0, the order is neither 1 nor 2, the limit has several circles, or there are
    /// more than four degrees of freedom.
    pub fn new(system: &impl NearlyPeriodic, time: f64, angles: usize, order: usize) -> Self {
        assert!(angles > 0 && (1..=2).contains(&order), "{angles} angles, order {order}");
        assert!(2 * system.dof() <= MOST, "{} degrees of freedom", system.dof());
        assert!(system.torus().1.len() == 1, "no single circle");
        let (action, frequency) = (system.circle_action(), system.limiting_frequency());
        let frequencies = action.weights().iter().map(|m| f64::from(*m) * frequency).collect();
        Self {
            turns: (0..angles).map(|k| action.turn_by(TAU * k as f64 / angles as f64)).collect(),
            weights: integral_weights(angles).into_iter().map(|w| w / frequency).collect(),
            whole: action.turn_by(frequency * time),
            frequencies,
            time,
            order,
            closed: false,
            circle: action.weights().to_vec(),
            split: None,
        }
    }

    /// The same method with the closed form of the average. The angles then only serve to enter and leave the averaged
    /// coordinates.
    pub fn in_closed_form(self) -> Self {
        Self { closed: true, ..self }
    }

    /// The closed form of the average in `count` steps of a splitting into its parts; None where the system gives
    /// [none](NearlyPeriodic::average_split).
    pub fn split_by(
        self,
        system: &impl NearlyPeriodic,
        splitting: Splitting,
        count: usize,
    ) -> Option<Self> {
        let step = self.time / count as f64;
        let cross = self.order == 2 && system.average_has_cross();
        let split = Split::new(&system.average_split()?, splitting, (count, step), cross);
        Some(Self { split: Some(split), ..self.in_closed_form() })
    }

    /// Whether the closed form of the average is used.
    pub fn is_in_closed_form(&self) -> bool {
        self.closed
    }

    /// z ← its image under the flow, in `count` steps of the averaged equation; z is one point of 2n numbers, or
    /// several. Where the average has no closed form and one is asked for, it is NaN. Each call enters and leaves the
    /// averaged coordinates, which errs by O(ε²): a long trajectory is one call.
    ///
    /// # Panics
    /// When `count` is 0, or another number than that of a [splitting](Averaged::split_by); when z is not of whole
    /// points.
    #[inline(always)]
    pub fn take<S: Over<f64> + Elementary>(
        &self,
        system: &impl NearlyPeriodic,
        z: &mut [S],
        count: usize,
    ) {
        let known = self.enter(system, z);
        self.advance(system, z, &known, count);
        self.leave(system, z);
    }

    /// z ← the averaged points of z. Returns what their averages need in closed form: where there is none, points are
    /// NaN.
    #[inline(always)]
    fn enter<S: Over<f64> + Elementary>(
        &self,
        system: &impl NearlyPeriodic,
        z: &mut [S],
    ) -> Vec<AverageConstants<S>> {
        let dim = 2 * system.dof();
        let mut known = vec![AverageConstants::zero(); z.len() / dim];
        let mut space = vec![S::zero(); (self.turns.len() + 1) * dim];
        let (fields, slope) = space.split_at_mut(self.turns.len() * dim);
        for (z, known) in z.chunks_exact_mut(dim).zip(&mut known) {
            // What is left, u(z, 0) − u(W, 0), is of second order: no more than the error of the method.
            self.fields(system, z, fields);
            self.displacement(fields, 0, slope);
            for i in 0..dim {
                z[i] -= slope[i];
            }
            if self.closed {
                match system.average_constants(z, self.order) {
                    Some(found) => *known = found,
                    None => z.fill(S::from_f64(f64::NAN)),
                }
            }
        }
        known
    }

    /// z ← points from averaged points z.
    #[inline(always)]
    fn leave<S: Over<f64> + Elementary>(&self, system: &impl NearlyPeriodic, z: &mut [S]) {
        let dim = 2 * system.dof();
        let mut space = vec![S::zero(); (self.turns.len() + 1) * dim];
        let (fields, slope) = space.split_at_mut(self.turns.len() * dim);
        for z in z.chunks_exact_mut(dim) {
            self.fields(system, z, fields);
            self.displacement(fields, 0, slope);
            for i in 0..dim {
                z[i] += slope[i];
            }
        }
    }

    /// Moves averaged points, of which `known` was found on entering, in `count` steps.
    #[inline(always)]
    fn advance<S: Over<f64> + Elementary>(
        &self,
        system: &impl NearlyPeriodic,
        z: &mut [S],
        known: &[AverageConstants<S>],
        count: usize,
    ) {
        let dim = 2 * system.dof();
        assert!(count > 0 && z.len() == known.len() * dim);
        match &self.split {
            Some(split) => {
                assert!(count == split.count, "{count} steps");
                let mut angles = vec![S::zero(); known.len()];
                split.take(system, z, (known, &mut angles));
                for (z, &angle) in z.chunks_exact_mut(dim).zip(&angles) {
                    self.turn_circle(z, angle);
                }
            }
            None => {
                let mut space = vec![S::zero(); (2 * self.turns.len() + 3) * dim];
                for (z, known) in z.chunks_exact_mut(dim).zip(known) {
                    self.runge_kutta(system, z, count, known, &mut space);
                }
            }
        }
        for z in z.chunks_exact_mut(dim) {
            self.whole.apply(z, false);
        }
    }

    /// The circle action with this angle.
    #[inline(always)]
    fn turn_circle<S: Elementary>(&self, z: &mut [S], angle: S) {
        let (q, p) = z.split_at_mut(self.circle.len());
        for (j, &weight) in self.circle.iter().enumerate() {
            if weight != 0 {
                let (sin, cos) = (S::from_f64(f64::from(weight)) * angle).sin_cos();
                (q[j], p[j]) = (cos * q[j] + sin * p[j], cos * p[j] - sin * q[j]);
            }
        }
    }

    #[inline(always)]
    fn runge_kutta<S: Over<f64> + Elementary>(
        &self,
        system: &impl NearlyPeriodic,
        z: &mut [S],
        count: usize,
        constants: &AverageConstants<S>,
        space: &mut [S],
    ) {
        let dim = z.len();
        let (fields, rest) = space.split_at_mut(self.turns.len() * dim);
        let (moved, rest) = rest.split_at_mut(self.turns.len() * dim);
        let (stage, rest) = rest.split_at_mut(dim);
        let (sum, slope) = rest.split_at_mut(dim);
        let h = self.time / count as f64;
        for _ in 0..count {
            sum.fill(S::zero());
            stage.copy_from_slice(z);
            for (advance, weight) in [(0.5, 1.0), (0.5, 2.0), (1.0, 2.0), (0.0, 1.0)] {
                match self.closed {
                    true => system.averaged_field(stage, constants, slope),
                    false => self.slope(system, stage, (&mut *fields, &mut *moved), slope),
                }
                for i in 0..dim {
                    sum[i] = S::from_f64(weight).mul_add(slope[i], sum[i]);
                    stage[i] = S::from_f64(advance * h).mul_add(slope[i], z[i]);
                }
            }
            for i in 0..dim {
                z[i] = S::from_f64(h / 6.0).mul_add(sum[i], z[i]);
            }
        }
    }

    /// `out` ← f(w, φ) at all the angles, with one point w or one for each angle.
    #[inline(always)]
    fn fields<S: Over<f64> + Elementary>(
        &self,
        system: &impl NearlyPeriodic,
        points: &[S],
        out: &mut [S],
    ) {
        S::outlined(Fields { method: self, system, points, out });
    }

    /// `out` ← u(W, φ) at the angle number k, from f at all of them.
    #[inline(always)]
    fn displacement<S: Elementary>(&self, fields: &[S], k: usize, out: &mut [S]) {
        out.fill(S::zero());
        let (before, after) = fields.split_at(k * out.len());
        let in_turn = after.chunks_exact(out.len()).chain(before.chunks_exact(out.len()));
        for (field, &weight) in in_turn.zip(&self.weights) {
            for (out, &f) in out.iter_mut().zip(field) {
                *out = S::from_f64(weight).mul_add(f, *out);
            }
        }
    }

    /// Computes the derivative of the averaged point W = `w` by averages over the angles, `slope` ← dW/dt.
    #[inline(always)]
    fn slope<S: Over<f64> + Elementary>(
        &self,
        system: &impl NearlyPeriodic,
        w: &[S],
        (fields, moved): (&mut [S], &mut [S]),
        slope: &mut [S],
    ) {
        let dim = w.len();
        let one = &mut moved[..dim];
        one.copy_from_slice(w);
        self.fields(system, one, fields);
        if self.order == 2 {
            for (k, moved) in moved.chunks_exact_mut(dim).enumerate() {
                self.displacement(fields, k, moved);
                for i in 0..dim {
                    moved[i] += w[i];
                }
            }
            self.fields(system, moved, fields);
        }
        slope.fill(S::zero());
        let share = S::from_f64(1.0 / self.turns.len() as f64);
        for field in fields.chunks_exact(dim) {
            for i in 0..dim {
                slope[i] = share.mul_add(field[i], slope[i]);
            }
        }
    }
}

/// The fields of [`Averaged::fields`]: a function of its own, since it is called from many places.
struct Fields<'a, H, S> {
    method: &'a Averaged,
    system: &'a H,
    points: &'a [S],
    out: &'a mut [S],
}

impl<H: NearlyPeriodic, S: Over<f64> + Elementary> Task for Fields<'_, H, S> {
    #[inline(always)]
    fn run(self) {
        let Self { method: Averaged { turns, frequencies, .. }, system, points, out } = self;
        let dim = 2 * system.dof();
        let stride = if points.len() == dim { 0 } else { dim };
        let mut turned = [S::zero(); MOST];
        let turned = &mut turned[..dim];
        for (k, (turn, out)) in turns.iter().zip(out.chunks_exact_mut(dim)).enumerate() {
            turned.copy_from_slice(&points[k * stride..][..dim]);
            turn.apply(turned, false);
            system.vector_field(turned, 0.0, out);
            let (q, p) = turned.split_at(frequencies.len());
            for (j, &frequency) in frequencies.iter().enumerate() {
                let frequency = S::from_f64(frequency);
                out[j] -= frequency * p[j];
                out[q.len() + j] += frequency * q[j];
            }
            turn.apply(out, true);
        }
    }
}

/// The weights by which values of a function at equally spaced angles, from 0 on, add up to the value at 0 of the
/// antiderivative, with average 0, of the function without its average: exact for the harmonics that the angles
/// resolve.
pub(crate) fn integral_weights(angles: usize) -> Vec<f64> {
    let share = |k: usize| TAU * k as f64 / angles as f64;
    let weight = |k: usize| {
        let harmonics = 1..=(angles - 1) / 2;
        let of = |m: usize| libm::sin(share((m * k) % angles)) / m as f64;
        -2.0 * harmonics.map(of).sum::<f64>() / angles as f64
    };
    (0..angles).map(weight).collect()
}

/// The numbers of a point, of the systems that this is for.
const MOST: usize = 8;

/// The BibTeX entry of the book of Sanders, Verhulst and Murdock on averaged equations.
const BIBTEX: &str = "@book{SandersVerhulstMurdock2007,
  author = {Sanders, Jan A. and Verhulst, Ferdinand and Murdock, James},
  title = {Averaging Methods in Nonlinear Dynamical Systems},
  edition = {2},
  publisher = {Springer},
  year = {2007},
  doi = {10.1007/978-0-387-48918-6}
}
";

/// [`Averaged`] as scenes declare it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AveragedSettings {
    /// The order of the averaged equation, 1 or 2: over times of 1/ε errors are O(ε) and O(ε²).
    pub order: usize,
    /// The angles of an average.
    #[serde(default = "sixteen")]
    pub angles: usize,
    /// Whether the closed form of the average is used: the angles then only serve to enter and leave the averaged
    /// coordinates. Oscillators, particles, cells and the self-excited oscillator have it, of first and second order;
    /// particles in their own field of first order.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub closed: bool,
    /// The splitting of the closed form, in place of Runge–Kutta steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<MicroSteps>,
}

/// The angles that scenes do not name.
fn sixteen() -> usize {
    16
}

impl AveragedSettings {
    fn on(&self, system: &impl NearlyPeriodic, request: &Request) -> Averaged {
        let method = Averaged::new(system, request.interval, self.angles, self.order);
        match self.by {
            Some(by) => method
                .split_by(system, by.splitting(), request.steps)
                .expect("the system gives both parts: it was checked"),
            None if self.closed => method.in_closed_form(),
            None => method,
        }
    }

    fn no_circle_of_planes(&self) -> Error {
        self.cannot_integrate("the limit of the system turns no coordinate planes along one circle")
    }
}

impl NumericalMethod for AveragedSettings {
    fn name(&self) -> String {
        let Self { order, angles, closed, by } = self;
        let form = match by {
            Some(by) => format!(", closed form by {}", by.splitting().name),
            None => if *closed { ", closed form" } else { "" }.to_owned(),
        };
        format!("averaged equation of order {order}{form}, {angles} angles")
    }

    fn is_closed_average(&self) -> bool {
        self.closed
    }

    fn bibtex(&self) -> Option<&'static str> {
        Some(BIBTEX)
    }

    fn check(&self) -> Result<(), Error> {
        Error::check_count_range("order", self.order, 1, 2)?;
        if self.by.is_some() && !self.closed {
            return Err(Error::invalid(
                "integrator",
                "by and not closed",
                "closed = true beside it",
            ));
        }
        Error::check_count_range("angles", self.angles, 3, 1000)
    }

    fn check_for(&self, system: &System) -> Result<(), Error> {
        match system {
            System::FieldLines(_) | System::ThreeOscillators(_) => Err(self.no_circle_of_planes()),
            System::ParticleField(system) if system.dof() > Averaged::MOST_DOF => {
                let expected = format!("{} degrees of freedom or fewer", Averaged::MOST_DOF);
                Err(Error::invalid(&self.name(), system.dof(), expected))
            }
            _ if self.closed && !system.has_closed_average(self.order) => Err(self
                .cannot_integrate("the average over the circle has no closed form of this order")),
            _ if self.by.is_some() && system.average_split().is_none() => Err(self
                .cannot_integrate("its average is not given as a sum of parts with exact flows")),
            _ => Ok(()),
        }
    }

    fn finer(&self) -> Option<Box<dyn NumericalMethod>> {
        // More steps or angles do not reduce the error of averaging itself.
        Some(Box::new(StroboscopicSettings::REFERENCE))
    }

    fn trajectories(
        &self,
        request: &Request,
        system: &System,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        match system {
            System::Oscillators(system) => request.step(&self.on(system, request), system, initial),
            System::FullOrbit(system) => request.step(&self.on(system, request), system, initial),
            System::CellularDrift(system) => {
                request.step(&self.on(system, request), system, initial)
            }
            System::VanDerPol(system) => request.step(&self.on(system, request), system, initial),
            System::ParticleField(system) => {
                let without = system.without_profiles();
                let method = self.on(&without, request);
                request.step(&InPlanes { without, method }, system, initial)
            }
            System::FieldLines(_) | System::ThreeOscillators(_) => Err(self.no_circle_of_planes()),
        }
    }
}

impl<H: NearlyPeriodic> Method<H> for Averaged {
    const NATURAL: bool = true;
    type Known<V: Pack> = AverageConstants<V>;

    #[inline(always)]
    fn enter<V: Pack>(&self, system: &H, z: &mut [V]) -> Vec<AverageConstants<V>> {
        Averaged::enter(self, system, z)
    }
    #[inline(always)]
    fn take<V: Pack>(
        &self,
        system: &H,
        z: &mut [V],
        known: &[AverageConstants<V>],
        _: f64,
        steps: usize,
    ) {
        self.advance(system, z, known, steps);
    }
    #[inline(always)]
    fn leave<V: Pack>(&self, system: &H, z: &mut [V]) {
        Averaged::leave(self, system, z);
    }
}

/// The averaged equation of a particle in its field, in the coordinates whose planes the limit turns.
struct InPlanes {
    without: ParticleField,
    method: Averaged,
}

impl Method<ParticleField> for InPlanes {
    const NATURAL: bool = true;
    type Known<V: Pack> = AverageConstants<V>;

    #[inline(always)]
    fn enter<V: Pack>(&self, system: &ParticleField, z: &mut [V]) -> Vec<AverageConstants<V>> {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            Splittable::enter(system, z);
        }
        self.method.enter(&self.without, z)
    }
    #[inline(always)]
    fn take<V: Pack>(
        &self,
        _: &ParticleField,
        z: &mut [V],
        known: &[AverageConstants<V>],
        _: f64,
        steps: usize,
    ) {
        self.method.advance(&self.without, z, known, steps);
    }
    #[inline(always)]
    fn leave<V: Pack>(&self, system: &ParticleField, z: &mut [V]) {
        self.method.leave(&self.without, z);
        for z in z.chunks_exact_mut(2 * system.dof()) {
            Splittable::leave(system, z);
        }
    }
}
