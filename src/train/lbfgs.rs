//! L-BFGS in variables scaled by the Gauss–Newton diagonal.
//!
//! The sensitivities of the parameters differ by many orders of magnitude:
//! those of I_ε carry the factor ε. In the variables u = D⁻¹p with
//! D_ii = (JᵀJ)_ii^(−1/2) the diagonal of the Gauss–Newton matrix is 1, and
//! L-BFGS gets further for the same work. D is renewed as training goes, at the
//! price of one Jacobian pass; each renewal starts a new memory.

use super::checkpoint::{Checkpoint, RunIdentity, SegmentSnapshot};
use super::options::{Scaling, Stop, TrainingOptions, TrainingRecord};
use super::{Loss, Objective};
use crate::error::Error;
use crate::flow::Pairs;
use crate::network::{Composition, Model};
use crate::scalar::max_or_nan;
use basin::solver::lbfgs::Unbounded;
use basin::{
    CostFunction, ExactCheckpoint, Executor, FirstOrderState, Gradient, Lbfgs, MoreThuente, State,
    StepOutcome, Stepper,
};
use std::convert::Infallible;

/// What the caller is told after each iteration.
#[derive(Debug)]
pub struct Progress<'a> {
    /// The newest record.
    pub record: TrainingRecord,
    /// A checkpoint, when one is due.
    pub checkpoint: Option<&'a Checkpoint>,
}

/// What the caller answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Go on.
    Continue,
    /// Stop here; a last checkpoint is passed on before.
    Interrupt,
}

/// The result of training.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The model with the lowest held-out error (loss, without held-out
    /// pairs).
    pub model: Model,
    /// Its record.
    pub best: TrainingRecord,
    /// The records of all iterations.
    pub history: Vec<TrainingRecord>,
    /// How often the curvature diagonal was evaluated.
    pub curvatures: u64,
    /// Why it ended.
    pub stop: Stop,
}

type Solver = Lbfgs<Vec<f64>, f64, Unbounded, MoreThuente<f64>>;
type SolverState = FirstOrderState<Vec<f64>>;

/// The loss in the scaled variables.
struct Scaled<'a> {
    objective: &'a Objective<'a>,
    model: &'a Model,
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
        self.model.with_parameters(self.parameters(u)).ok()
    }
}

impl CostFunction for Scaled<'_> {
    type Param = Vec<f64>;
    type Output = f64;
    type Error = Infallible;

    fn cost(&self, u: &Vec<f64>) -> Result<f64, Infallible> {
        Ok(match self.map(u) {
            Some(model) => {
                finite_or_rejected(self.factor * self.objective.value(model.composition()))
            }
            None => f64::INFINITY,
        })
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
        let value = self.objective.value_and_gradient(model.composition(), &mut gradient);
        for (g, d) in gradient.iter_mut().zip(&self.scale) {
            *g *= d * self.factor;
        }
        Ok((finite_or_rejected(self.factor * value), gradient))
    }
}

/// An infinite loss ends a line search without a step, and so the segment; a
/// NaN it might take for progress.
fn finite_or_rejected(value: f64) -> f64 {
    if value.is_finite() { value } else { f64::INFINITY }
}

/// D: the inverse square root of the curvature, which counts as no smaller than
/// the loss itself: a parameter that hardly matters, as that of a dead neuron,
/// would otherwise be asked to mend the whole loss and be sent far outside the
/// reach of the linearisation. With the floor it moves by 1 at most.
fn scale_of(
    scaling: Scaling,
    objective: &Objective<'_>,
    map: &Composition<f64>,
    loss: f64,
) -> Vec<f64> {
    let count = map.parameters().len();
    if scaling == Scaling::None {
        return vec![1.0; count];
    }
    let diagonal = objective.curvature_diagonal(map);
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

/// One scaling with its own L-BFGS memory, between two renewals.
struct Segment<'a> {
    stepper: Stepper<Scaled<'a>, SolverState, Solver>,
    scale: Vec<f64>,
    factor: f64,
}

/// Why a segment ended.
enum SegmentEnd {
    /// The diagonal is due for renewal, or training is over.
    Complete,
    /// No step lowers the loss.
    NoProgress,
    /// The caller asked for it.
    Interrupted,
}

impl<'a> Segment<'a> {
    /// Continues the checkpoint's segment, or starts a new one.
    fn open(
        objective: &'a Objective<'a>,
        model: &'a Model,
        options: &TrainingOptions,
        state: &mut Checkpoint,
    ) -> Result<Self, Error> {
        let factor = first_step(options.scaling, state.parameters.len());
        let problem = |scale: &[f64]| Scaled { objective, model, scale: scale.to_vec(), factor };
        let (executor, scale) = match state.segment.take() {
            Some(snapshot) => {
                let restored: ExactCheckpoint<Solver, SolverState> =
                    serde_json::from_value(snapshot.optimiser).map_err(|reason| {
                        Error::content("checkpoint: optimiser", "its state", reason)
                    })?;
                let problem = problem(&snapshot.scale);
                (Executor::resume_from_checkpoint(problem, restored), snapshot.scale)
            }
            None => {
                let current = model.with_parameters(state.parameters.clone())?;
                state.curvatures += u64::from(options.scaling != Scaling::None);
                let scale =
                    scale_of(options.scaling, objective, current.composition(), state.last().loss);
                let u = state.parameters.iter().zip(&scale).map(|(p, d)| p / d).collect();
                let solver = Lbfgs::new().unbounded().with_m_capacity(options.memory);
                (Executor::new(problem(&scale), solver, FirstOrderState::new(u)), scale)
            }
        };
        // Basin stops after 1000 iterations unless told otherwise.
        let stepper = executor.max_iter(u64::MAX).into_stepper().expect("an infallible problem");
        Ok(Self { stepper, scale, factor })
    }

    fn evaluations(&self) -> u64 {
        self.stepper.counts().cost_evals
    }

    fn snapshot(&self) -> SegmentSnapshot {
        let optimiser = serde_json::json!({
            "solver": self.stepper.solver(),
            "state": self.stepper.state(),
            "counts": self.stepper.counts(),
        });
        SegmentSnapshot { scale: self.scale.clone(), optimiser }
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

    fn run(
        &mut self,
        model: &Model,
        held_out: Option<&Objective<'_>>,
        options: &TrainingOptions,
        state: &mut Checkpoint,
        observe: &mut dyn FnMut(Progress<'_>) -> Result<Control, Error>,
    ) -> Result<SegmentEnd, Error> {
        loop {
            let Some((loss, gradient)) = self.step(state.last().loss) else {
                state.close_segment(self.evaluations());
                return Ok(SegmentEnd::NoProgress);
            };
            let iteration = state.last().iteration + 1;
            let u = self.stepper.state().param();
            state.parameters = u.iter().zip(&self.scale).map(|(u, d)| u * d).collect();
            let evaluate = iteration.is_multiple_of(options.validate_every);
            let validation = match held_out {
                Some(held_out) if evaluate => {
                    let current = model.with_parameters(state.parameters.clone())?;
                    Some(held_out.value(current.composition()))
                }
                _ => None,
            };
            let record = TrainingRecord {
                iteration,
                evaluations: state.earlier_evaluations + self.evaluations(),
                loss,
                gradient,
                validation,
            };
            state.push(record, if held_out.is_some() { validation } else { Some(loss) });

            let renew = match options.scaling {
                Scaling::None => false,
                Scaling::GaussNewton { renew } => state.segment_iterations >= renew,
            };
            let over = state.finished(options).is_some();
            let due = over || iteration.is_multiple_of(options.checkpoint_every);
            // A run that is over keeps the optimiser too: it may be asked for more.
            if renew {
                state.close_segment(self.evaluations());
            } else if due {
                state.segment = Some(self.snapshot());
            }
            let checkpoint = due.then_some(&*state);
            let control = observe(Progress { record, checkpoint })?;
            if control == Control::Interrupt && !over {
                if !due {
                    state.segment = (!renew).then(|| self.snapshot());
                    observe(Progress { record, checkpoint: Some(state) })?;
                }
                return Ok(SegmentEnd::Interrupted);
            }
            state.segment = None;
            if renew || over {
                return Ok(SegmentEnd::Complete);
            }
        }
    }
}

/// Trains `model` on `pairs`.
///
/// `validation` are pairs that the optimiser never sees; the best model on
/// them is returned. `observe` is called after each iteration, with a
/// [`Checkpoint`] when one is due; passing such a checkpoint as `resume`, with
/// the same model, pairs and options, continues to the same bits.
///
/// # Errors
/// When options or shapes do not fit, when the checkpoint is of another run,
/// when the loss is not finite at the start, or what `observe` returns.
pub fn train(
    model: &Model,
    pairs: &Pairs,
    validation: Option<&Pairs>,
    options: &TrainingOptions,
    resume: Option<Checkpoint>,
    observe: &mut dyn FnMut(Progress<'_>) -> Result<Control, Error>,
) -> Result<Outcome, Error> {
    options.check()?;
    let dof = model.composition().dof();
    for (name, set) in [("training", Some(pairs)), ("held-out", validation)] {
        if let Some(set) = set {
            Error::check_count(&format!("degrees of freedom of the {name} pairs"), dof, set.dof())?;
        }
    }
    let objective = Objective::new(&options.loss, pairs)?;
    let held_out =
        validation.map(|set| Objective::new(&Loss::MeanSquaredError, set)).transpose()?;
    let run = RunIdentity::of(model, pairs, validation, options);
    let mut state = match resume {
        Some(checkpoint) => {
            checkpoint.check(&run, model)?;
            checkpoint
        }
        None => {
            let parameters = model.composition().parameters().to_vec();
            let mut gradient = vec![0.0; parameters.len()];
            let loss = objective.value_and_gradient(model.composition(), &mut gradient);
            if !loss.is_finite() {
                return Err(Error::Diverged {
                    what: "loss".into(),
                    place: "the initial parameters".into(),
                });
            }
            let validation = held_out.as_ref().map(|o| o.value(model.composition()));
            if validation.is_some_and(|v| !v.is_finite()) {
                return Err(Error::Diverged {
                    what: "held-out error".into(),
                    place: "the initial parameters".into(),
                });
            }
            let record = TrainingRecord {
                iteration: 0,
                evaluations: 1,
                loss,
                gradient: gradient.iter().map(|g| g.abs()).fold(0.0, max_or_nan),
                validation,
            };
            Checkpoint::start(run, parameters, record)
        }
    };

    let stop = loop {
        if let Some(stop) = state.finished(options) {
            break stop;
        }
        let before = state.last().loss;
        let fresh = state.segment.is_none();
        let mut segment = Segment::open(&objective, model, options, &mut state)?;
        match segment.run(model, held_out.as_ref(), options, &mut state, observe)? {
            SegmentEnd::Interrupted => break Stop::Interrupted,
            // A fresh scaling did not help either.
            SegmentEnd::NoProgress if fresh && !(state.last().loss < before) => {
                break Stop::Stalled;
            }
            SegmentEnd::Complete | SegmentEnd::NoProgress => {}
        }
    };

    // The last iteration is a candidate too, but only in what is returned:
    // when training goes on, its path must not depend on where it paused.
    if let (Some(held_out), None) = (&held_out, state.last().validation) {
        let current = model.with_parameters(state.parameters.clone())?;
        let score = held_out.value(current.composition());
        let record = TrainingRecord { validation: Some(score), ..state.last() };
        state.history.pop();
        state.push(record, Some(score));
    }
    Ok(Outcome {
        model: model.with_parameters(state.best_parameters)?,
        best: state.best,
        history: state.history,
        curvatures: state.curvatures,
        stop,
    })
}
