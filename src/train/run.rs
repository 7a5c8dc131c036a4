//! Training by any optimiser: records, held-out pairs, stopping, checkpoints.

use super::Objective;
use super::adam::Adam;
use super::checkpoint::{Checkpoint, RunIdentity};
use super::lbfgs::Lbfgs;
use super::levenberg_marquardt::LevenbergMarquardt;
use super::minimise::{Minimise, Problem, Resumed, largest};
use super::options::{Optimiser, TrainingOptions};
use super::record::{Stop, TrainingRecord};
use crate::error::Error;
use crate::flow::Pairs;
use crate::network::Model;
use std::ops::ControlFlow;

/// What is reported to the caller after each iteration.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// The record of the newest iteration.
    pub record: TrainingRecord,
    /// The checkpoint to keep, when one is due.
    pub checkpoint: Option<&'a Checkpoint>,
}

/// What the caller answers to a report of progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Training goes on.
    Continue,
    /// Training stops here, after a last checkpoint has been passed on.
    Interrupt,
}

/// What a training has come to.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The model with the lowest held-out error (loss, without held-out
    /// pairs).
    pub model: Model,
    /// Its loss on all training pairs.
    pub loss: f64,
    /// The record of the iteration that it is of.
    pub best: TrainingRecord,
    /// The records of all iterations.
    pub history: Vec<TrainingRecord>,
    /// How often the curvature was evaluated: its diagonal by L-BFGS, the Gauss–Newton
    /// matrix by Levenberg–Marquardt.
    pub curvatures: u64,
    /// The reason why the training ended.
    pub stop: Stop,
}

/// The optimiser of the options, resumed from a state where one is given.
fn optimiser<'a>(
    problem: Problem<'a>,
    optimiser: &Optimiser,
    from: Option<Resumed>,
) -> Result<Box<dyn Minimise + 'a>, Error> {
    Ok(match (optimiser, from) {
        (Optimiser::Lbfgs(options), None) => Box::new(Lbfgs::new(problem, options)),
        (Optimiser::Lbfgs(options), Some(from)) => {
            Box::new(Lbfgs::resume(problem, options, &from)?)
        }
        (Optimiser::LevenbergMarquardt(options), None) => {
            Box::new(LevenbergMarquardt::new(problem, options)?)
        }
        (Optimiser::LevenbergMarquardt(options), Some(from)) => {
            Box::new(LevenbergMarquardt::resume(problem, options, &from)?)
        }
        (Optimiser::Adam(options), None) => Box::new(Adam::new(problem, options)),
        (Optimiser::Adam(options), Some(from)) => Box::new(Adam::resume(problem, options, &from)?),
    })
}

/// Trains `model` on `pairs`.
///
/// The optimiser never sees the pairs of `validation`; the best model on them is returned.
/// `observe` is called after each iteration, with a [`Checkpoint`] when one is due. Passing such a
/// checkpoint as `resume`, with the same model, pairs and options, continues with the same bits.
///
/// # Errors
/// When options or shapes do not fit, or ask for the stages of a
/// [schedule](super::train_schedule), when the checkpoint is of another run,
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
    options.check_single()?;
    let dof = model.composition().dof();
    for (name, set) in [("training", Some(pairs)), ("held-out", validation)] {
        if let Some(set) = set {
            Error::check_count(&format!("degrees of freedom of the {name} pairs"), dof, set.dof())?;
        }
    }
    options.check_for(model.architecture())?;
    let objective = Objective::new(&options.loss, pairs)?
        .with_near_identity_penalty(options.near_identity_penalty, model)?
        .with_fixed_angles(options.theta_fixed)
        .with_angle_penalty(options.theta_penalty, model.angles())?;
    let held_out =
        validation.map(|set| Objective::new(&options.loss.of_held_out(), set)).transpose()?;
    let run = RunIdentity::of(model, pairs, validation, options);
    let mut state = match resume {
        Some(checkpoint) => {
            checkpoint.check(&run, model)?;
            checkpoint
        }
        None => {
            let record = initial_record(model, &objective, held_out.as_ref())?;
            Checkpoint::start(run, model.composition().parameters().to_vec(), record)
        }
    };
    let problem = Problem { objective: &objective, model };
    let mut optimiser = optimiser(problem, &options.optimiser, state.take_optimiser())?;
    let stop = loop {
        if let Some(stop) = state.finished(options, pairs.len()) {
            break stop;
        }
        let loss = state.last().loss;
        let step = match optimiser.step(&mut state.parameters, loss)? {
            ControlFlow::Continue(step) => step,
            ControlFlow::Break(stop) => break stop,
        };
        let iteration = state.last().iteration + 1;
        let evaluate = iteration.is_multiple_of(options.validate_every);
        let at_present = |objective: &Objective<'_>| value_at(objective, model, &state.parameters);
        let validation = match &held_out {
            Some(held_out) if evaluate => Some(at_present(held_out)?),
            _ => None,
        };
        let score = match &held_out {
            Some(_) => validation,
            None if is_of_part(step.pairs, pairs, options) => {
                evaluate.then(|| at_present(&objective)).transpose()?
            }
            None => Some(step.loss),
        };
        let record = TrainingRecord {
            iteration,
            evaluations: 1 + optimiser.evaluations(),
            loss: step.loss,
            pairs: step.pairs,
            gradient: step.gradient,
            validation,
        };
        state.push(record, score);
        let over = state.finished(options, pairs.len()).is_some();
        let due = over || iteration.is_multiple_of(options.checkpoint_every);
        if due {
            // A run that is over keeps the optimiser too: it may be asked for more.
            state.optimiser = Some(optimiser.state());
        }
        let control = observe(Progress { record, checkpoint: due.then_some(&state) })?;
        if control == Control::Interrupt && !over {
            if !due {
                state.optimiser = Some(optimiser.state());
                observe(Progress { record, checkpoint: Some(&state) })?;
            }
            break Stop::Interrupted;
        }
        state.optimiser = None;
    };

    // The last iteration is a candidate too, but only in what is returned:
    // when training goes on, its path must not depend on where it paused.
    let last = state.last();
    let scored = last.iteration.is_multiple_of(options.validate_every);
    if let (Some(held_out), None) = (&held_out, last.validation) {
        let score = value_at(held_out, model, &state.parameters)?;
        state.history.pop();
        state.push(TrainingRecord { validation: Some(score), ..last }, Some(score));
    } else if held_out.is_none() && !scored && is_of_part(last.pairs, pairs, options) {
        let score = value_at(&objective, model, &state.parameters)?;
        state.history.pop();
        state.push(last, Some(score));
    }
    let model = model.with_parameters(state.best_parameters)?;
    let loss = match is_of_part(state.best.pairs, pairs, options) {
        true => objective.value(model.composition()),
        false => state.best.loss,
    };
    Ok(Outcome {
        loss,
        model,
        best: state.best,
        history: state.history,
        curvatures: optimiser.curvatures(),
        stop,
    })
}

fn value_at(objective: &Objective<'_>, model: &Model, parameters: &[f64]) -> Result<f64, Error> {
    let current = model.with_parameters(parameters.to_vec())?;
    Ok(objective.value(current.composition()))
}

/// A loss of fewer pairs, or of batches on the way, is no measure of the model.
fn is_of_part(pairs_of_loss: usize, pairs: &Pairs, options: &TrainingOptions) -> bool {
    pairs_of_loss < pairs.len() || options.optimiser.takes_batches()
}

/// # Errors
/// When the loss or the held-out error is not finite.
fn initial_record(
    model: &Model,
    objective: &Objective<'_>,
    held_out: Option<&Objective<'_>>,
) -> Result<TrainingRecord, Error> {
    let diverged =
        |what: &str| Error::Diverged { what: what.into(), place: "the initial parameters".into() };
    let mut gradient = vec![0.0; model.composition().parameters().len()];
    let loss = objective.value_and_gradient(model.composition(), &mut gradient);
    if !loss.is_finite() {
        return Err(diverged("loss"));
    }
    let validation = held_out.map(|o| o.value(model.composition()));
    if validation.is_some_and(|v| !v.is_finite()) {
        return Err(diverged("held-out error"));
    }
    Ok(TrainingRecord {
        iteration: 0,
        evaluations: 1,
        loss,
        pairs: objective.pairs().len(),
        gradient: largest(&gradient),
        validation,
    })
}
