//! A training in several legs: starts of which the best goes on, a ramp of other flow
//! times or ε before the one that is wanted, and twists that are trained alone.

use super::checkpoint::Checkpoint;
use super::legs::{FreshTwists, RampStage, not_a_normal_form};
use super::options::TrainingOptions;
use super::record::{Stop, TrainingRecord};
use super::run::{Control, Outcome, Progress, train};
use crate::error::Error;
use crate::flow::Pairs;
use crate::network::{Model, map_points};
use crate::phase::Direction;
use serde::Serialize;
use std::ops::ControlFlow;

/// A stage with its pairs; the last one of a schedule is what is wanted.
#[derive(Clone, Copy, Debug)]
pub struct StageData<'a> {
    /// Its ε.
    pub epsilon: f64,
    /// Its flow time over that of the last place.
    pub time: f64,
    /// Its training pairs.
    pub pairs: &'a Pairs,
    /// Its held-out pairs.
    pub held_out: Option<&'a Pairs>,
    /// Its iterations.
    pub iterations: u64,
}

/// Which leg of a schedule, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", content = "number", rename_all = "kebab-case")]
pub enum TrainingStage {
    /// A start.
    Start(u64),
    /// A stage of the ramp.
    #[serde(rename = "rung")]
    Ramp(usize),
    /// Twists alone: those of the ramp, 0, and fresh ones.
    Twists(u64),
    /// What is wanted.
    Last,
}

impl TrainingStage {
    /// What is appended to the name of its checkpoint.
    pub fn suffix(self) -> String {
        match self {
            Self::Start(number) => format!("-start-{}", number + 1),
            Self::Ramp(number) => format!("-rung-{}", number + 1),
            Self::Twists(0) => "-twists".to_owned(),
            Self::Twists(number) => format!("-fresh-twists-{number}"),
            Self::Last => String::new(),
        }
    }

    /// In words; nothing of the last.
    pub fn name(self) -> String {
        match self {
            Self::Start(number) => format!("start {}", number + 1),
            Self::Ramp(number) => format!("rung {}", number + 1),
            Self::Twists(0) => "twists of the ramp".to_owned(),
            Self::Twists(number) => format!("fresh twists {number}"),
            Self::Last => String::new(),
        }
    }

    /// All legs of a training with these options, in their order.
    pub fn all(options: &TrainingOptions) -> Vec<Self> {
        let starts = options.starts.map_or(0, |starts| starts.count);
        let rungs = (0..options.ramp.len()).map(Self::Ramp);
        let twists = options.fresh_twists.map_or(0, |fresh| fresh.count + 1);
        let twists = (0..twists).map(Self::Twists);
        (0..starts).map(Self::Start).chain(rungs).chain(twists).chain([Self::Last]).collect()
    }

    /// The most iterations of it; 0 where the options have no such leg.
    pub fn iterations(self, options: &TrainingOptions) -> u64 {
        match self {
            Self::Start(_) => options.starts.map_or(0, |starts| starts.iterations),
            Self::Ramp(number) => options.ramp.get(number).map_or(0, |rung| rung.iterations),
            Self::Twists(_) => options.fresh_twists.map_or(0, |fresh| fresh.iterations),
            Self::Last => options.iterations,
        }
    }
}

/// What became of a leg before the last.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StageResult {
    /// Which.
    pub leg: TrainingStage,
    /// ε of its pairs.
    pub epsilon: f64,
    /// The flow time of its pairs over the one that is wanted.
    pub time: f64,
    /// The record of the model that was kept; of twists alone, in the coordinates of the chart.
    pub best: TrainingRecord,
    /// It was gone on with: one of the starts, each rung, one of the twists.
    pub chosen: bool,
}

/// The result of a schedule.
#[derive(Clone, Debug)]
pub struct Scheduled {
    /// The chosen start, before any training, with all its twists.
    pub initial: Model,
    /// The legs before the last.
    pub legs: Vec<StageResult>,
    /// The last leg; or that which was interrupted, twists alone being without a chart.
    pub outcome: Outcome,
}

/// What a schedule tells, and what it asks for.
pub trait TrainingObserver {
    /// A checkpoint of this leg to go on from, if there is one.
    ///
    /// # Errors
    /// When it cannot be read.
    fn earlier(&mut self, leg: TrainingStage) -> Result<Option<Checkpoint>, Error>;

    /// An iteration of the leg is done: see [`train`].
    ///
    /// # Errors
    /// When a checkpoint cannot be written.
    fn observe(&mut self, leg: TrainingStage, progress: Progress<'_>) -> Result<Control, Error>;
}

/// Trains from several starts and along a ramp, as the options have them.
///
/// `start` makes a start, of the last place; `places` are the ramp's and then the one
/// that is wanted. Weights go from a place to the next as they are, the angles of the
/// circles in proportion to the flow time, and the twists of a normal form as many times over as
/// the [repeats](RampStage::repeats) of the next place go into those of the one before; at the last place
/// twists may be [trained alone](FreshTwists) before all weights are. Each leg has checkpoints of its own, and
/// goes on from them to the same bits.
///
/// # Errors
/// Those of [`train`], and of `start` and `watch`; when the chart of the ramp takes a pair out of
/// the finite numbers in which twists are to be trained.
pub fn train_schedule(
    start: &mut dyn FnMut(u64) -> Result<Model, Error>,
    places: &[StageData<'_>],
    options: &TrainingOptions,
    watch: &mut dyn TrainingObserver,
) -> Result<Scheduled, Error> {
    let [ramp @ .., last] = places else {
        return Err(Error::invalid("places", "none", "at least the one that is wanted"));
    };
    Error::check_count("rungs of the ramp", options.ramp.len(), ramp.len())?;
    options.check()?;
    let first = &places[0];
    let mut legs = Vec::new();
    let mut initial = start(0)?;
    options.check_for(initial.architecture())?;
    let repeats = |place: usize| options.ramp.get(place).map_or(1, RampStage::times);
    let mut trial: Option<Checkpoint> = None;
    if let Some(starts) = options.starts {
        let mut best: Option<(f64, u64, Model, Option<Checkpoint>)> = None;
        for number in 0..starts.count {
            let begun = start(number)?;
            let model = begun.with_part_of_twists(repeats(0))?.at(first.epsilon, first.time)?;
            let iterations = starts.iterations;
            let run = Run { leg: TrainingStage::Start(number), place: first, iterations, options };
            let Some((outcome, checkpoint)) = run.attempt(&model, watch, &mut legs)? else {
                continue;
            };
            if outcome.stop == Stop::Interrupted {
                return Ok(Scheduled { initial: begun, legs, outcome });
            }
            let score = score(&outcome);
            if best.as_ref().is_none_or(|(lowest, ..)| score < *lowest) {
                best = Some((score, number, begun, checkpoint));
            }
        }
        // Where none could be trained, the first one says why.
        if let Some((_, number, model, checkpoint)) = best {
            legs[number as usize].chosen = true;
            (initial, trial) = (model, checkpoint);
        }
    }
    let mut model = initial.with_part_of_twists(repeats(0))?.at(first.epsilon, first.time)?;
    for (number, place) in ramp.iter().enumerate() {
        let (leg, iterations) = (TrainingStage::Ramp(number), place.iterations);
        let run = Run { leg, place, iterations, options };
        let (outcome, _) = run.go(&model, trial.take(), watch)?;
        if outcome.stop == Stop::Interrupted {
            return Ok(Scheduled { initial, legs, outcome });
        }
        let next = &places[number + 1];
        let parts = initial.with_part_of_twists(repeats(number + 1))?;
        let there = parts.at(next.epsilon, next.time)?;
        let times = repeats(number) / repeats(number + 1);
        let time = next.time / (place.time * times as f64);
        model = there.with_weights_of(&outcome.model.iterated(times)?, time)?;
        legs.push(StageResult { chosen: true, ..StageResult::of(leg, place, &outcome) });
    }
    let mut options = options.clone();
    if let Some(fresh) = options.fresh_twists {
        let unused = options.starts.map_or(1, |starts| starts.count);
        let mut draw = |number: u64| match number {
            0 => Ok(model.clone()),
            _ => start(unused + number - 1)?.with_angles(model.angles()),
        };
        match train_twists(&model, &mut draw, fresh, last, &options, &mut legs, watch)? {
            ControlFlow::Continue(better) => model = better,
            ControlFlow::Break(outcome) => return Ok(Scheduled { initial, legs, outcome }),
        }
        // On fewer they would forget what they have learnt of the others.
        let learnt = |leg: &&StageResult| {
            leg.chosen && matches!(leg.leg, TrainingStage::Twists(_)) && leg.best.iteration > 0
        };
        let pairs = legs.iter().find(learnt).map_or(0, |leg| leg.best.pairs);
        options.optimiser.begin_with(pairs, &model);
    }
    let run = Run {
        leg: TrainingStage::Last,
        place: last,
        iterations: last.iterations,
        options: &options,
    };
    let (outcome, _) = run.go(&model, trial, watch)?;
    Ok(Scheduled { initial, legs, outcome })
}

/// What several legs are compared by.
fn score(outcome: &Outcome) -> f64 {
    outcome.best.validation.unwrap_or(outcome.loss)
}

/// `model` with the best of several twists, each trained alone, or as it is where none has a
/// loss; the outcome that was interrupted.
fn train_twists(
    model: &Model,
    draw: &mut dyn FnMut(u64) -> Result<Model, Error>,
    fresh: FreshTwists,
    place: &StageData<'_>,
    options: &TrainingOptions,
    legs: &mut Vec<StageResult>,
    watch: &mut dyn TrainingObserver,
) -> Result<ControlFlow<Outcome, Model>, Error> {
    if model.architecture().twist_shears() == 0 {
        return Err(not_a_normal_form(fresh.count));
    }
    let pairs = in_chart(model, place.pairs)?;
    let held_out = place.held_out.map(|pairs| in_chart(model, pairs)).transpose()?;
    let place = &StageData { pairs: &pairs, held_out: held_out.as_ref(), ..*place };
    let mut best: Option<(f64, usize, Model)> = None;
    for number in 0..=fresh.count {
        let twists = draw(number)?.without_chart()?;
        let (leg, iterations) = (TrainingStage::Twists(number), fresh.iterations);
        let run = Run { leg, place, iterations, options };
        let Some((outcome, _)) = run.attempt(&twists, watch, legs)? else { continue };
        if outcome.stop == Stop::Interrupted {
            return Ok(ControlFlow::Break(outcome));
        }
        let score = score(&outcome);
        if best.as_ref().is_none_or(|(lowest, ..)| score < *lowest) {
            best = Some((score, legs.len() - 1, outcome.model));
        }
    }
    let Some((_, leg, twists)) = best else { return Ok(ControlFlow::Continue(model.clone())) };
    legs[leg].chosen = true;
    model.with_twists_of(&twists).map(ControlFlow::Continue)
}

/// Pairs in the coordinates of a network's chart.
fn in_chart(network: &Model, pairs: &Pairs) -> Result<Pairs, Error> {
    let chart = network.chart();
    pairs.transformed("pairs in the chart of the ramp", |condition, points| {
        let epsilon = condition.map_or(network.epsilon(), |condition| condition.epsilon);
        map_points(&chart.with_epsilon(epsilon), Direction::Inverse, points)
    })
}

impl StageResult {
    /// A leg without a loss.
    fn failed(leg: TrainingStage, place: &StageData<'_>) -> Self {
        let StageData { epsilon, time, .. } = *place;
        let (iteration, evaluations, pairs) = (0, 1, place.pairs.len());
        let (loss, gradient, validation) = (f64::INFINITY, f64::INFINITY, None);
        let best = TrainingRecord { iteration, evaluations, loss, pairs, gradient, validation };
        Self { leg, epsilon, time, best, chosen: false }
    }

    fn of(leg: TrainingStage, place: &StageData<'_>, outcome: &Outcome) -> Self {
        let StageData { epsilon, time, .. } = *place;
        Self { leg, epsilon, time, best: outcome.best, chosen: false }
    }
}

/// A leg about to be run.
struct Run<'a> {
    leg: TrainingStage,
    place: &'a StageData<'a>,
    iterations: u64,
    options: &'a TrainingOptions,
}

impl Run<'_> {
    /// [`Run::go`] of weights that need not be the best, with what became of them; None where
    /// nothing can be computed from them.
    fn attempt(
        self,
        model: &Model,
        watch: &mut dyn TrainingObserver,
        legs: &mut Vec<StageResult>,
    ) -> Result<Option<(Outcome, Option<Checkpoint>)>, Error> {
        let (leg, place) = (self.leg, self.place);
        match self.go(model, None, watch) {
            Ok((outcome, checkpoint)) => {
                if outcome.stop != Stop::Interrupted {
                    legs.push(StageResult::of(leg, place, &outcome));
                }
                Ok(Some((outcome, checkpoint)))
            }
            Err(Error::Diverged { .. }) => {
                legs.push(StageResult::failed(leg, place));
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// Its outcome, and its last checkpoint. It goes on from one of its own or, without, from
    /// that of the start that it continues.
    fn go(
        self,
        model: &Model,
        trial: Option<Checkpoint>,
        watch: &mut dyn TrainingObserver,
    ) -> Result<(Outcome, Option<Checkpoint>), Error> {
        let Self { leg, place, iterations, options } = self;
        let mut options = options.of_leg(iterations);
        if leg != TrainingStage::Last {
            // What ends the training as a whole does not end what leads to it.
            (options.target, options.patience, options.plateau) = (0.0, 0, None);
        }
        let mut newest = watch.earlier(leg)?.or(trial);
        let resume = newest.clone();
        let mut observe = |progress: Progress<'_>| {
            if let (Some(checkpoint), TrainingStage::Start(_)) = (progress.checkpoint, leg) {
                newest = Some(checkpoint.clone());
            }
            watch.observe(leg, progress)
        };
        let outcome = train(model, place.pairs, place.held_out, &options, resume, &mut observe)?;
        Ok((outcome, newest))
    }
}
