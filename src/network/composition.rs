//! A composition of kicks and rotations over one flat parameter vector.

use super::HenonShape;
use crate::layer::{
    ElementaryStep, Kick, KickForm, Potential, Rotation, TanhPotential, layer_parameter_count,
};
use crate::phase::Map;
use crate::scalar::{Over, Pack, Part, Scalar};
use std::ops::Range;

/// Forward or inverse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// The map.
    Forward,
    /// Its inverse.
    Inverse,
}

/// One step of a composition, pointing into its parameters.
#[derive(Clone, Debug)]
pub enum Step {
    /// A kick of a Hénon layer.
    Kick {
        /// Where the layer's parameters are.
        parameters: Range<usize>,
        /// Its number of neurons.
        width: usize,
        /// Which of the four kicks.
        form: KickForm,
        /// The inverse of the kick.
        inverse: bool,
        /// Scaled by the composition's ε; else by 1.
        near_identity: bool,
    },
    /// The rotation Φ_θ; its inverse when true.
    Rotation {
        /// Φ_θ⁻¹ in place of Φ_θ.
        inverse: bool,
    },
}

/// Runs `$body` with `$D` bound to n where kernels on the number `$S` are specialised
/// for it, and to 0 (n read at run time) elsewhere.
macro_rules! with_dof {
    ($S:ty, $n:expr, $D:ident => $body:expr) => {
        if !<$S as $crate::scalar::Scalar>::SPECIALISED {
            const $D: usize = 0;
            $body
        } else {
            match $n {
                1 => {
                    const $D: usize = 1;
                    $body
                }
                2 => {
                    const $D: usize = 2;
                    $body
                }
                3 => {
                    const $D: usize = 3;
                    $body
                }
                _ => {
                    const $D: usize = 0;
                    $body
                }
            }
        }
    };
}
pub(crate) use with_dof;

/// A map given as a sequence of kicks and rotations.
///
/// Its parameters are one flat vector (see the [module](super) for the order);
/// every step points into it, and several steps may share a layer, as ψ and
/// ψ⁻¹ do in a gyroceptron.
#[derive(Clone, Debug)]
pub struct Composition<P> {
    dof: usize,
    steps: Vec<Step>,
    parameters: Vec<P>,
    epsilon: P,
    rotation: Option<Rotation<P>>,
    theta: Option<usize>,
}

/// One kick of all points, 2n numbers each.
struct Apply<'a, P, S, const D: usize> {
    kick: Kick<'a, P, TanhPotential<'a, P, D>>,
    z: &'a mut [S],
    scratch: &'a mut [S],
}

impl<P: Scalar, S: Over<P>, const D: usize> Part for Apply<'_, P, S, D> {
    #[inline(always)]
    fn run(self) {
        let dim = 2 * Potential::<S>::dof(&self.kick.potential);
        for z in self.z.chunks_exact_mut(dim) {
            self.kick.apply(z, self.scratch);
        }
    }
}

/// The same, filling the tape of each.
struct Record<'a, P, S, const D: usize> {
    kick: Kick<'a, P, TanhPotential<'a, P, D>>,
    z: &'a mut [S],
    tape: &'a mut [S],
    scratch: &'a mut [S],
}

impl<P: Scalar, S: Over<P>, const D: usize> Part for Record<'_, P, S, D> {
    #[inline(always)]
    fn run(self) {
        let dim = 2 * Potential::<S>::dof(&self.kick.potential);
        let tapes = self.tape.chunks_exact_mut(self.kick.tape_len::<S>());
        for (z, tape) in self.z.chunks_exact_mut(dim).zip(tapes) {
            self.kick.apply_recording(z, self.scratch, tape);
        }
    }
}

/// The adjoint of one kick at all points recorded.
struct Pull<'a, P, S, const D: usize> {
    kick: Kick<'a, P, TanhPotential<'a, P, D>>,
    tape: &'a [S],
    z_bar: &'a mut [S],
    parameters_bar: &'a mut [S],
    scratch: &'a mut [S],
}

impl<P: Scalar, S: Over<P>, const D: usize> Part for Pull<'_, P, S, D> {
    #[inline(always)]
    fn run(self) {
        let dim = 2 * Potential::<S>::dof(&self.kick.potential);
        let tapes = self.tape.chunks_exact(self.kick.tape_len::<S>());
        for (z_bar, tape) in self.z_bar.chunks_exact_mut(dim).zip(tapes) {
            self.kick.pullback(tape, z_bar, self.parameters_bar, self.scratch);
        }
    }
}

/// What a forward pass keeps for the pullback, and working space for both.
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
        Self { dof, steps: Vec::new(), parameters, epsilon, rotation: None, theta: None }
    }

    /// Appends the layers of `shape`, whose parameters start at `offset`.
    pub(super) fn push_henon(
        &mut self,
        shape: &HenonShape,
        offset: usize,
        direction: Direction,
        near_identity: bool,
    ) {
        let mut start = offset;
        let mut kicks = Vec::with_capacity(4 * shape.widths.len());
        for &width in &shape.widths {
            let end = start + layer_parameter_count(self.dof, width);
            for form in KickForm::LAYER {
                let inverse = direction == Direction::Inverse;
                let parameters = start..end;
                kicks.push(Step::Kick { parameters, width, form, inverse, near_identity });
            }
            start = end;
        }
        if direction == Direction::Inverse {
            kicks.reverse();
        }
        self.steps.extend(kicks);
    }

    /// Appends a rotation whose angle is the parameter number `theta`.
    pub(super) fn push_rotation(&mut self, rotation: Rotation<P>, theta: usize) {
        self.rotation = Some(rotation);
        self.theta = Some(theta);
        self.steps.push(Step::Rotation { inverse: false });
    }

    /// The number of degrees of freedom.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// The flat parameters.
    pub fn parameters(&self) -> &[P] {
        &self.parameters
    }

    /// ε of the near-identity steps.
    pub fn epsilon(&self) -> P {
        self.epsilon
    }

    /// The same map at another ε.
    pub fn with_epsilon(&self, epsilon: P) -> Self {
        Self { epsilon, ..self.clone() }
    }

    /// The steps, in the order of application.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// The inverse map, as a composition of its own.
    pub fn inverted(&self) -> Self {
        let steps = self
            .steps
            .iter()
            .rev()
            .map(|step| match step.clone() {
                Step::Kick { parameters, width, form, inverse, near_identity } => {
                    Step::Kick { parameters, width, form, inverse: !inverse, near_identity }
                }
                Step::Rotation { inverse } => Step::Rotation { inverse: !inverse },
            })
            .collect();
        Self { steps, ..self.clone() }
    }

    /// The numbers of tanh (with its sech²) that one evaluation takes.
    pub fn activation_count(&self) -> usize {
        self.steps
            .iter()
            .map(|step| match step {
                Step::Kick { width, .. } => *width,
                Step::Rotation { .. } => 0,
            })
            .sum()
    }

    #[inline(always)]
    fn kick<const D: usize>(
        &self,
        parameters: &Range<usize>,
        width: usize,
        form: KickForm,
        inverse: bool,
        near_identity: bool,
    ) -> Kick<'_, P, TanhPotential<'_, P, D>> {
        let own = &self.parameters[parameters.clone()];
        let (potential, eta) = own.split_at(width * (self.dof + 2));
        let epsilon = if near_identity { self.epsilon } else { P::from_f64(1.0) };
        let potential = TanhPotential::<P, D>::new(self.dof, width, potential);
        let kick = form.kick(potential, eta, epsilon);
        if inverse { kick.inverse() } else { kick }
    }

    #[inline(always)]
    fn rotation(&self) -> &Rotation<P> {
        self.rotation.as_ref().expect("a rotation step comes with its rotation")
    }

    /// One step of each of the points in z, 2n numbers a point.
    #[inline(always)]
    fn apply_step<S: Over<P>, const D: usize>(
        &self,
        step: &Step,
        direction: Direction,
        z: &mut [S],
        scratch: &mut [S],
    ) {
        let undo = direction == Direction::Inverse;
        match step {
            Step::Kick { parameters, width, form, inverse, near_identity } => {
                let inverse = *inverse != undo;
                let kick = self.kick::<D>(parameters, *width, *form, inverse, *near_identity);
                S::apart(Apply { kick, z, scratch });
            }
            Step::Rotation { inverse } => {
                for z in z.chunks_exact_mut(2 * self.dof) {
                    self.rotation().apply(z, *inverse != undo);
                }
            }
        }
    }

    /// The map or its inverse on points of 2n numbers, n fixed at compile time
    /// unless 0. Of several points each makes a step before the next one: while
    /// the last results of one are awaited, the processor has the others.
    #[inline(always)]
    pub(crate) fn apply<S: Over<P>, const D: usize>(
        &self,
        direction: Direction,
        z: &mut [S],
        scratch: &mut [S],
    ) {
        for number in 0..self.steps.len() {
            // One loop for both: the step is compiled into it once.
            let number = match direction {
                Direction::Forward => number,
                Direction::Inverse => self.steps.len() - 1 - number,
            };
            self.apply_step::<S, D>(&self.steps[number], direction, z, scratch);
        }
    }

    /// The map or its inverse on one point, a neuron in each lane: the same bits
    /// as [`Composition::apply`].
    #[inline(always)]
    pub(crate) fn apply_across<V: Pack<P>, const D: usize>(
        &self,
        direction: Direction,
        z: &mut [P],
        scratch: &mut [P],
    ) where
        P: Over<P>,
    {
        let undo = direction == Direction::Inverse;
        for number in 0..self.steps.len() {
            let number = if undo { self.steps.len() - 1 - number } else { number };
            match &self.steps[number] {
                Step::Kick { parameters, width, form, inverse, near_identity } => {
                    let inverse = *inverse != undo;
                    self.kick::<D>(parameters, *width, *form, inverse, *near_identity)
                        .apply_across::<V>(z, scratch);
                }
                Step::Rotation { inverse } => self.rotation().apply(z, *inverse != undo),
            }
        }
    }

    /// z ← P(z), and `columns`, those of a 2n × 2n matrix, ← ∂P/∂z times each:
    /// the chain rule over the steps. `scratch` holds at least 2n + n² numbers.
    #[inline(always)]
    pub(super) fn apply_with_jacobian<S: Over<P>, const D: usize>(
        &self,
        z: &mut [S],
        columns: &mut [S],
        scratch: &mut [S],
    ) {
        for step in &self.steps {
            match step {
                Step::Kick { parameters, width, form, inverse, near_identity } => {
                    self.kick::<D>(parameters, *width, *form, *inverse, *near_identity)
                        .apply_with_jacobian(z, columns, scratch);
                }
                Step::Rotation { inverse } => {
                    self.rotation().apply(z, *inverse);
                    for column in columns.chunks_exact_mut(2 * self.dof) {
                        self.rotation().apply(column, *inverse);
                    }
                }
            }
        }
    }

    fn run<S: Over<P>>(&self, direction: Direction, z: &mut [S]) {
        assert!(z.len() == 2 * self.dof, "a point of {} numbers in {} dof", z.len(), self.dof);
        let mut stack = [S::zero(); STACK];
        let mut heap;
        let scratch = if z.len() <= STACK {
            &mut stack[..z.len()]
        } else {
            heap = vec![S::zero(); z.len()];
            &mut heap[..]
        };
        with_dof!(S, self.dof, D => self.apply::<S, D>(direction, z, scratch));
    }

    /// Space for [`Composition::forward_recording`] and
    /// [`Composition::pullback`]: n + 2h numbers a kick, 2n a rotation.
    pub fn recording<S: Over<P>>(&self) -> Recording<S> {
        self.recording_of(1)
    }

    /// The same for so many points.
    pub(crate) fn recording_of<S: Over<P>>(&self, points: usize) -> Recording<S> {
        let tape: usize = self.steps.iter().map(|step| self.step_tape_len(step)).sum();
        let tape = vec![S::zero(); points * tape];
        Recording { tape, scratch: vec![S::zero(); 2 * self.dof] }
    }

    #[inline(always)]
    fn step_tape_len(&self, step: &Step) -> usize {
        match step {
            Step::Kick { width, .. } => self.dof + 2 * width,
            Step::Rotation { .. } => 2 * self.dof,
        }
    }

    /// z ← P(z) for each of the points in z, as many as the recording has space
    /// for, recording what the pullback needs.
    #[inline(always)]
    pub(crate) fn record<S: Over<P>, const D: usize>(
        &self,
        z: &mut [S],
        recording: &mut Recording<S>,
    ) {
        let dim = 2 * self.dof;
        let mut tape = &mut recording.tape[..];
        for step in &self.steps {
            let size = self.step_tape_len(step);
            let (own, rest) = tape.split_at_mut(size * (z.len() / dim));
            tape = rest;
            match step {
                Step::Kick { parameters, width, form, inverse, near_identity } => {
                    let kick = self.kick::<D>(parameters, *width, *form, *inverse, *near_identity);
                    S::apart(Record { kick, z, tape: own, scratch: &mut recording.scratch });
                }
                Step::Rotation { inverse } => {
                    for (z, own) in z.chunks_exact_mut(dim).zip(own.chunks_exact_mut(size)) {
                        self.rotation().apply(z, *inverse);
                        own.copy_from_slice(z);
                    }
                }
            }
        }
    }

    /// The adjoint at the recorded points.
    #[inline(always)]
    pub(crate) fn pull<S: Over<P>, const D: usize>(
        &self,
        recording: &mut Recording<S>,
        z_bar: &mut [S],
        parameters_bar: &mut [S],
    ) {
        let dim = 2 * self.dof;
        let mut tape = &recording.tape[..];
        for step in self.steps.iter().rev() {
            let size = self.step_tape_len(step);
            let (rest, own) = tape.split_at(tape.len() - size * (z_bar.len() / dim));
            tape = rest;
            match step {
                Step::Kick { parameters, width, form, inverse, near_identity } => {
                    let kick = self.kick::<D>(parameters, *width, *form, *inverse, *near_identity);
                    let parameters_bar = &mut parameters_bar[parameters.clone()];
                    let scratch = &mut recording.scratch;
                    S::apart(Pull { kick, tape: own, z_bar, parameters_bar, scratch });
                }
                Step::Rotation { inverse } => {
                    let theta = self.theta.expect("a rotation step comes with its angle");
                    for (z_bar, own) in z_bar.chunks_exact_mut(dim).zip(own.chunks_exact(size)) {
                        let theta_bar = self.rotation().pullback(own, z_bar, *inverse);
                        parameters_bar[theta] = parameters_bar[theta] + theta_bar;
                    }
                }
            }
        }
    }

    /// z ← P(z), filling `recording` (of [`Composition::recording`]).
    pub fn forward_recording<S: Over<P>>(&self, z: &mut [S], recording: &mut Recording<S>) {
        assert!(z.len() == 2 * self.dof);
        with_dof!(S, self.dof, D => self.record::<S, D>(z, recording));
    }

    /// The pullback at the recorded point: `z_bar` from the cotangent of P(z)
    /// to the cotangent of z; the cotangent of the parameters is added to
    /// `parameters_bar`. Costs about twice an evaluation.
    pub fn pullback<S: Over<P>>(
        &self,
        recording: &mut Recording<S>,
        z_bar: &mut [S],
        parameters_bar: &mut [S],
    ) {
        assert!(z_bar.len() == 2 * self.dof && parameters_bar.len() == self.parameters.len());
        with_dof!(S, self.dof, D => self.pull::<S, D>(recording, z_bar, parameters_bar));
    }

    /// The shears that the map consists of, in the order of application.
    pub fn elementary_steps(&self) -> Vec<ElementaryStep<'_, P, TanhPotential<'_, P>>> {
        let mut out = Vec::new();
        for step in &self.steps {
            match step {
                Step::Kick { parameters, width, form, inverse, near_identity } => {
                    out.push(ElementaryStep::Kick(self.kick::<0>(
                        parameters,
                        *width,
                        *form,
                        *inverse,
                        *near_identity,
                    )));
                }
                Step::Rotation { inverse } => {
                    out.extend(ElementaryStep::rotation(self.rotation(), *inverse));
                }
            }
        }
        out
    }
}

impl<P: Scalar, S: Over<P>> Map<S> for Composition<P> {
    fn dof(&self) -> usize {
        self.dof
    }

    fn forward(&self, z: &mut [S]) {
        self.run(Direction::Forward, z);
    }

    fn inverse(&self, z: &mut [S]) {
        self.run(Direction::Inverse, z);
    }
}
