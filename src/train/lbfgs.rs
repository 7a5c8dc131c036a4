//! L-BFGS in variables scaled by the Gauss–Newton diagonal.
//!
//! The sensitivities of the parameters differ by many orders of magnitude:
//! those of I_ε carry the factor ε. In the variables u = D⁻¹p with
//! D_ii = (JᵀJ)_ii^(−1/2) the diagonal of the Gauss–Newton matrix is 1, and
//! L-BFGS gets further for the same work. D is renewed as training goes, at the
//! price of one Jacobian pass; each renewal starts a new memory.

use super::minimise::{Minimise, OptimiserState, Problem, Resumed, Step, finite_or_rejected};
use super::record::{Stop, at_least_one};
use crate::error::Error;
use crate::network::{Composition, Model};
use crate::scalar::max_or_nan;
use basin::solver::lbfgs::Unbounded;
use basin::{
    CostFunction, ExactCheckpoint, Executor, FirstOrderState, Gradient, MoreThuente, State,
    StepOutcome, Stepper,
};
use serde::{Deserialize, Serialize};
use std::convert::Infallible;
use std::ops::ControlFlow;

/// The variables that L-BFGS works in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Scaling {
    /// The parameters themselves, without scaling.
    None,
    /// Scaled by the Gauss–Newton diagonal.
    GaussNewton {
        /// Iterations between renewals of the diagonal.
        renew: u64,
    },
}

/// Options of L-BFGS.
///
/// Source: Liu and Nocedal, <https://doi.org/10.1007/BF01589116>, with the line search of Moré and
/// Thuente, <https://doi.org/10.1145/192115.192132>.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LbfgsOptions {
    /// m, the number of correction pairs in the memory.
    pub memory: usize,
    /// The variables that it works in.
    pub scaling: Scaling,
}

impl Default for LbfgsOptions {
    fn default() -> Self {
        Self { memory: 30, scaling: Scaling::GaussNewton { renew: 200 } }
    }
}

/// More pairs than this serve no purpose and cost their square.
const LARGEST_MEMORY: usize = 10_000;

impl LbfgsOptions {
    pub(super) fn check(&self) -> Result<(), Error> {
        let memory = "training.optimiser.memory";
        Error::check_count_range(memory, self.memory, 1, LARGEST_MEMORY)?;
        match self.scaling {
            Scaling::None => Ok(()),
            Scaling::GaussNewton { renew } => {
                at_least_one("training.optimiser.scaling.renew", renew)
            }
        }
    }
}

/// The kind of its state in a checkpoint.
const KIND: &str = "lbfgs";

type Solver = basin::Lbfgs<Vec<f64>, f64, Unbounded, MoreThuente<f64>>;
type SolverState = FirstOrderState<Vec<f64>>;

/// The loss in the scaled variables.
struct Scaled<'a> {
    problem: Problem<'a>,
    scale: Vec<f64>,
    /// A constant factor of the loss, a power of two. The first step of L-BFGS
    /// is −gradient: this makes it a step that the curvature allows.
    factor: f64,
}

impl Scaled<'_> {
    fn parameters(&self, u: &[f64]) -> Vec<f64> {
        u.iter().zip(&self.scale).map(|(u, d)| u * d).collect()
    }

    /// None where the parameters leave the finite numbers.
    fn map(&self, u: &[f64]) -> Option<Model> {
        self.problem.model.with_parameters(self.parameters(u)).ok()
    }
}

impl CostFunction for Scaled<'_> {
    type Param = Vec<f64>;
    type Output = f64;
    type Error = Infallible;

    fn cost(&self, u: &Vec<f64>) -> Result<f64, Infallible> {
        let loss = self.problem.loss(self.problem.objective, &self.parameters(u));
        Ok(finite_or_rejected(self.factor * loss))
    }
}

impl Gradient for Scaled<'_> {
    type Gradient = Vec<f64>;

    fn gradient(&self, u: &Vec<f64>) -> Result<Vec<f64>, Infallible> {
        Ok(self.cost_and_gradient(u)?.1)
    }

    fn cost_and_gradient(&self, u: &Vec<f64>) -> Result<(f64, Vec<f64>), Infallible> {
        let mut gradient = vec![0.0; u.len()];
        let Some(model) = self.map(u) else {
            return Ok((f64::INFINITY, gradient));
        };
        let objective = self.problem.objective;
        let value = objective.value_and_gradient(model.composition(), &mut gradient);
        for (g, d) in gradient.iter_mut().zip(&self.scale) {
            *g *= d * self.factor;
        }
        Ok((finite_or_rejected(self.factor * value), gradient))
    }
}

/// D: the inverse square root of the curvature, which counts as no smaller than
/// the loss itself: a parameter that hardly matters, as that of a dead neuron,
/// would otherwise be asked to mend the whole loss and be sent far outside the
/// reach of the linearisation. With the floor it moves by 1 at most.
fn scale_of(scaling: Scaling, problem: Problem<'_>, map: &Composition<f64>, loss: f64) -> Vec<f64> {
    let count = map.parameters().len();
    if scaling == Scaling::None {
        return vec![1.0; count];
    }
    let diagonal = problem.objective.curvature_diagonal(map);
    let floor = loss;
    diagonal
        .into_iter()
        .map(|d| if d.is_finite() { d.max(floor).sqrt().recip() } else { 1.0 })
        .collect()
}

/// The factor of the loss. In scaled variables the trace of the Gauss–Newton
/// matrix is the number of parameters, a bound of its largest eigenvalue: the
/// step −gradient/count does not overshoot. It is rounded to a power of two, so
/// that it costs no accuracy.
fn first_step(scaling: Scaling, count: usize) -> f64 {
    match scaling {
        Scaling::None => 1.0,
        Scaling::GaussNewton { .. } => libm::exp2(-libm::round(libm::log2(count as f64))),
    }
}

/// One scaling with its own memory, between two renewals.
struct Segment<'a> {
    stepper: Stepper<Scaled<'a>, SolverState, Solver>,
    scale: Vec<f64>,
    factor: f64,
}

impl<'a> Segment<'a> {
    fn of(
        problem: Problem<'a>,
        scale: Vec<f64>,
        factor: f64,
        executor: impl FnOnce(Scaled<'a>) -> Executor<Scaled<'a>, SolverState, Solver>,
    ) -> Self {
        let scaled = Scaled { problem, scale: scale.clone(), factor };
        // Basin stops after 1000 iterations unless set otherwise.
        let executor = executor(scaled).max_iter(u64::MAX);
        let stepper = executor.into_stepper().expect("an infallible problem");
        Self { stepper, scale, factor }
    }

    fn evaluations(&self) -> u64 {
        self.stepper.counts().cost_evals
    }

    fn snapshot(&self) -> SegmentState {
        let optimiser = serde_json::json!({
            "solver": self.stepper.solver(),
            "state": self.stepper.state(),
            "counts": self.stepper.counts(),
        });
        SegmentState { scale: self.scale.clone(), optimiser }
    }

    /// One iteration: the new loss and the largest entry of its gradient, or
    /// None when no step was found.
    fn step(&mut self, previous: f64) -> Option<(f64, f64)> {
        let outcome = self.stepper.step().expect("an infallible problem");
        if matches!(outcome, StepOutcome::Stopped(_)) {
            return None;
        }
        let (_, value, gradient) = self.stepper.state().current()?;
        let loss = value / self.factor;
        // A failed line search leaves the point where it was.
        if !(loss < previous) {
            return None;
        }
        let largest =
            gradient.iter().zip(&self.scale).map(|(g, d)| (g / d).abs()).fold(0.0, max_or_nan);
        Some((loss, largest / self.factor))
    }
}

/// The memory inside a segment, between two iterations.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct SegmentState {
    scale: Vec<f64>,
    optimiser: serde_json::Value,
}

/// Where L-BFGS is, between two iterations.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct LbfgsState {
    /// Evaluations in the segments that are closed.
    earlier_evaluations: u64,
    segment_iterations: u64,
    /// Evaluations of the curvature diagonal.
    curvatures: u64,
    segment: Option<SegmentState>,
}

impl LbfgsState {
    /// Fails unless it is of so many parameters.
    fn check(&self, place: &str, count: usize) -> Result<(), Error> {
        match &self.segment {
            Some(segment) if segment.scale.len() != count => {
                Err(Error::content(format!("{place}: scale"), count, segment.scale.len()))
            }
            _ => Ok(()),
        }
    }
}

pub(super) struct Lbfgs<'a> {
    problem: Problem<'a>,
    options: LbfgsOptions,
    /// The counters of the optimiser, without the state of the segment, which `segment` holds.
    state: LbfgsState,
    segment: Option<Segment<'a>>,
}

impl<'a> Lbfgs<'a> {
    pub(super) fn new(problem: Problem<'a>, options: &LbfgsOptions) -> Self {
        let state = LbfgsState::default();
        Self { problem, options: options.clone(), state, segment: None }
    }

    pub(super) fn resume(
        problem: Problem<'a>,
        options: &LbfgsOptions,
        from: &Resumed,
    ) -> Result<Self, Error> {
        let mut state: LbfgsState = from.read(KIND)?;
        state.check(&from.place, problem.model.composition().parameters().len())?;
        let mut segment = None;
        if let Some(SegmentState { scale, optimiser }) = state.segment.take() {
            let restored: ExactCheckpoint<Solver, SolverState> = serde_json::from_value(optimiser)
                .map_err(|reason| Error::content("checkpoint: optimiser", "its state", reason))?;
            let factor = first_step(options.scaling, scale.len());
            segment = Some(Segment::of(problem, scale, factor, |scaled| {
                Executor::resume_from_checkpoint(scaled, restored)
            }));
        }
        Ok(Self { problem, options: options.clone(), state, segment })
    }

    fn open(&mut self, parameters: &[f64], loss: f64) -> Result<Segment<'a>, Error> {
        let (problem, scaling) = (self.problem, self.options.scaling);
        let current = problem.model.with_parameters(parameters.to_vec())?;
        self.state.curvatures += u64::from(scaling != Scaling::None);
        let scale = scale_of(scaling, problem, current.composition(), loss);
        let u = parameters.iter().zip(&scale).map(|(p, d)| p / d).collect();
        let solver = basin::Lbfgs::new().unbounded().with_m_capacity(self.options.memory);
        let factor = first_step(scaling, scale.len());
        Ok(Segment::of(problem, scale, factor, |scaled| {
            Executor::new(scaled, solver, FirstOrderState::new(u))
        }))
    }

    fn close(&mut self, segment: &Segment<'_>) {
        self.state.earlier_evaluations += segment.evaluations();
        self.state.segment_iterations = 0;
    }
}

impl Minimise for Lbfgs<'_> {
    fn step(
        &mut self,
        parameters: &mut Vec<f64>,
        loss: f64,
    ) -> Result<ControlFlow<Stop, Step>, Error> {
        loop {
            let mut segment = match self.segment.take() {
                Some(segment) => segment,
                None => self.open(parameters, loss)?,
            };
            let Some((loss, gradient)) = segment.step(loss) else {
                let fresh = self.state.segment_iterations == 0;
                self.close(&segment);
                if fresh {
                    return Ok(ControlFlow::Break(Stop::Stalled));
                }
                continue;
            };
            self.state.segment_iterations += 1;
            let u = segment.stepper.state().param();
            *parameters = u.iter().zip(&segment.scale).map(|(u, d)| u * d).collect();
            match self.options.scaling {
                Scaling::GaussNewton { renew } if self.state.segment_iterations >= renew => {
                    self.close(&segment);
                }
                _ => self.segment = Some(segment),
            }
            let pairs = self.problem.objective.pairs().len();
            return Ok(ControlFlow::Continue(Step { loss, gradient, pairs }));
        }
    }

    fn evaluations(&self) -> u64 {
        let of_segment = self.segment.as_ref().map_or(0, Segment::evaluations);
        self.state.earlier_evaluations + of_segment
    }

    fn curvatures(&self) -> u64 {
        self.state.curvatures
    }

    fn state(&self) -> OptimiserState {
        let segment = self.segment.as_ref().map(Segment::snapshot);
        OptimiserState::of(KIND, &LbfgsState { segment, ..self.state.clone() })
    }
}
