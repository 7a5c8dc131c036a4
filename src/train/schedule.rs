//! Training in several stages: starts of which the best is kept, a ramp through other flow times or
//! ε, and twists that are trained alone.

use super::checkpoint::Checkpoint;
use super::options::TrainingOptions;
use super::record::{Stop, TrainingRecord};
use super::run::{Control, Outcome, Progress, train};
use super::stages::{FreshTwists, RampStage, not_a_normal_form};
use crate::error::Error;
use crate::flow::Pairs;
use crate::layer::MOST_DEGREES;
use crate::network::{Model, map_points};
use crate::phase::Direction;
use serde::Serialize;
use std::ops::ControlFlow;

/// A stage with its pairs; the last one of a schedule is the training proper.
#[derive(Clone, Copy, Debug)]
pub struct StageData<'a> {
    /// The ε of its pairs.
    pub epsilon: f64,
    /// Its flow time divided by that of the last place.
    pub time: f64,
    /// The pairs that the stage is trained on.
    pub pairs: &'a Pairs,
    /// The pairs that the stage chooses its best model by.
    pub held_out: Option<&'a Pairs>,
    /// The largest number of iterations of the stage.
    pub iterations: u64,
}

/// A stage of a schedule; numbers count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", content = "number", rename_all = "kebab-case")]
pub enum TrainingStage {
    /// A start from one of several sets of initial weights.
    Start(u64),
    /// A stage of the ramp.
    Ramp(usize),
    /// Twists trained alone: number 0 are those of the ramp, the others fresh ones.
    Twists(u64),
    /// The training proper, which is the last stage of every schedule.
    Last,
}

impl TrainingStage {
    /// What is appended to the name of its checkpoint.
    pub fn suffix(self) -> String {
        match self {
            Self::Start(number) => format!("-start-{}", number + 1),
            Self::Ramp(number) => format!("-ramp-{}", number + 1),
            Self::Twists(0) => "-twists".to_owned(),
            Self::Twists(number) => format!("-fresh-twists-{number}"),
            Self::Last => String::new(),
        }
    }

    /// The stage in words; empty for the last.
    pub fn name(self) -> String {
        match self {
            Self::Start(number) => format!("start {}", number + 1),
            Self::Ramp(number) => format!("stage {} of the ramp", number + 1),
            Self::Twists(0) => "twists of the ramp".to_owned(),
            Self::Twists(number) => format!("fresh twists {number}"),
            Self::Last => String::new(),
        }
    }

    /// All stages of a training with these options, in their order.
    pub fn all(options: &TrainingOptions) -> Vec<Self> {
        let starts = options.several_starts().map_or(0, |starts| starts.count);
        let stages = (0..options.ramp.len()).map(Self::Ramp);
        let twists = options.fresh_twists.map_or(0, |fresh| fresh.count + 1);
        let twists = (0..twists).map(Self::Twists);
        (0..starts).map(Self::Start).chain(stages).chain(twists).chain([Self::Last]).collect()
    }

    /// Its largest number of iterations; 0 where the options have no such stage.
    pub fn iterations(self, options: &TrainingOptions) -> u64 {
        match self {
            Self::Start(_) => options.several_starts().map_or(0, |starts| starts.iterations),
            Self::Ramp(number) => options.ramp.get(number).map_or(0, |stage| stage.iterations),
            Self::Twists(_) => options.fresh_twists.map_or(0, |fresh| fresh.iterations),
            Self::Last => options.iterations,
        }
    }
}

/// The result of a stage before the last.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StageResult {
    /// The stage that it is the result of.
    pub stage: TrainingStage,
    /// The ε of the pairs of the stage.
    pub epsilon: f64,
    /// The flow time of its pairs divided by that of the last stage.
    pub time: f64,
    /// The record of the model that was kept; for twists alone, in the coordinates of the chart.
    pub best: TrainingRecord,
    /// Whether training continued from it: true for one of the starts, each stage of the ramp, and
    /// one of the twists.
    pub chosen: bool,
}

/// The result of a schedule.
#[derive(Clone, Debug)]
pub struct Scheduled {
    /// The chosen start, before any training, with all its twists.
    pub initial: Model,
    /// The stages before the last.
    pub stages: Vec<StageResult>,
    /// The outcome of the last stage, or of the one that was interrupted; a model of twists alone
    /// has no chart.
    pub outcome: Outcome,
}

/// An observer of a schedule: it is informed of the progress and supplies checkpoints.
pub trait TrainingObserver {
    /// A checkpoint of this stage to resume from, if there is one.
    ///
    /// # Errors
    /// When it cannot be read.
    fn earlier(&mut self, stage: TrainingStage) -> Result<Option<Checkpoint>, Error>;

    /// Called after each iteration of the stage: see [`train`].
    ///
    /// # Errors
    /// When a checkpoint cannot be written.
    fn observe(&mut self, stage: TrainingStage, progress: Progress<'_>) -> Result<Control, Error>;
}

/// A function that is called after each iteration, without checkpoints.
impl<F> TrainingObserver for F
where
    F: FnMut(TrainingStage, Progress<'_>) -> Result<Control, Error>,
{
    fn earlier(&mut self, _: TrainingStage) -> Result<Option<Checkpoint>, Error> {
        Ok(None)
    }
    fn observe(&mut self, stage: TrainingStage, progress: Progress<'_>) -> Result<Control, Error> {
        self(stage, progress)
    }
}

/// Trains from several starts and along a ramp, as the options ask.
///
/// `start` makes the initial model of a start, at the last place; `places` are those of the ramp and then that of the
/// training proper. From one place to the next the weights are kept, the angles of the circles change in proportion
/// to the flow time, and the twists of a normal form are repeated as often as the [repeats](RampStage::repeats) of
/// the next place divide those of the place before. At the last place twists may be [trained alone](FreshTwists)
/// before all weights are trained. Each stage has checkpoints of its own, and resumes from them with the same bits.
///
/// # Errors
/// Those of [`train`], and of `start` and `observer`; when the chart of the ramp maps a pair on which
/// twists are to be trained to a point that is not finite.
pub fn train_schedule(
    start: &mut dyn FnMut(u64) -> Result<Model, Error>,
    places: &[StageData<'_>],
    options: &TrainingOptions,
    observer: &mut dyn TrainingObserver,
) -> Result<Scheduled, Error> {
    let [ramp @ .., last] = places else {
        return Err(Error::invalid("places", "none", "at least the one that is wanted"));
    };
    Error::check_count("stages of the ramp", options.ramp.len(), ramp.len())?;
    options.check()?;
    let first = &places[0];
    let mut stages = Vec::new();
    let mut initial = start(0)?;
    options.check_for(initial.architecture())?;
    let repeats = |place: usize| options.ramp.get(place).map_or(1, RampStage::times);
    let degree =
        |place: usize| options.ramp.get(place).map_or(MOST_DEGREES, RampStage::most_degrees);
    let begin = |model: &Model, place: usize| -> Result<Model, Error> {
        let at = &places[place];
        let parts = model.with_part_of_twists(repeats(place))?.of_degree(degree(place))?;
        parts.with_epsilon_and_time(at.epsilon, at.time)
    };
    let mut trial: Option<Checkpoint> = None;
    if let Some(starts) = options.several_starts() {
        let mut best: Option<(f64, u64, Model, Option<Checkpoint>)> = None;
        for number in 0..starts.count {
            let begun = start(number)?;
            let model = begin(&begun, 0)?;
            let iterations = starts.iterations;
            let run =
                Run { stage: TrainingStage::Start(number), place: first, iterations, options };
            let Some((outcome, checkpoint)) = run.train_from(&model, observer, &mut stages)? else {
                continue;
            };
            if outcome.stop == Stop::Interrupted {
                return Ok(Scheduled { initial: begun, stages, outcome });
            }
            let score = score(&outcome);
            if best.as_ref().is_none_or(|(lowest, ..)| score < *lowest) {
                best = Some((score, number, begun, checkpoint));
            }
        }
        // Where none could be trained, the first one says why.
        if let Some((_, number, model, checkpoint)) = best {
            stages[number as usize].chosen = true;
            (initial, trial) = (model, checkpoint);
        }
    }
    let mut model = begin(&initial, 0)?;
    for (number, place) in ramp.iter().enumerate() {
        let (stage, iterations) = (TrainingStage::Ramp(number), place.iterations);
        let run = Run { stage, place, iterations, options };
        let (outcome, _) = run.go(&model, trial.take(), observer)?;
        if outcome.stop == Stop::Interrupted {
            return Ok(Scheduled { initial, stages, outcome });
        }
        let next = &places[number + 1];
        let there = begin(&initial, number + 1)?;
        let times = repeats(number) / repeats(number + 1);
        let time = next.time / (place.time * times as f64);
        let learnt = outcome.model.iterated(times)?.with_degrees_of(&there)?;
        model = there.with_weights_of(&learnt, time)?;
        stages.push(StageResult { chosen: true, ..StageResult::of(stage, place, &outcome) });
    }
    let mut options = options.clone();
    if let Some(fresh) = options.fresh_twists {
        let unused = options.several_starts().map_or(1, |starts| starts.count);
        let mut draw = |number: u64| match number {
            0 => Ok(model.clone()),
            _ => start(unused + number - 1)?.with_angles(model.angles()),
        };
        match train_twists(&model, &mut draw, fresh, last, &options, &mut stages, observer)? {
            ControlFlow::Continue(better) => model = better,
            ControlFlow::Break(outcome) => return Ok(Scheduled { initial, stages, outcome }),
        }
        // On fewer they would forget what they have learnt of the others.
        let learnt = |stage: &&StageResult| {
            stage.chosen
                && matches!(stage.stage, TrainingStage::Twists(_))
                && stage.best.iteration > 0
        };
        let pairs = stages.iter().find(learnt).map_or(0, |stage| stage.best.pairs);
        options.optimiser.begin_with(pairs, model.architecture());
    }
    let run = Run {
        stage: TrainingStage::Last,
        place: last,
        iterations: last.iterations,
        options: &options,
    };
    let (outcome, _) = run.go(&model, trial, observer)?;
    Ok(Scheduled { initial, stages, outcome })
}

/// What several stages are compared by.
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
    stages: &mut Vec<StageResult>,
    observer: &mut dyn TrainingObserver,
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
        let (stage, iterations) = (TrainingStage::Twists(number), fresh.iterations);
        let run = Run { stage, place, iterations, options };
        let Some((outcome, _)) = run.train_from(&twists, observer, stages)? else { continue };
        if outcome.stop == Stop::Interrupted {
            return Ok(ControlFlow::Break(outcome));
        }
        let score = score(&outcome);
        if best.as_ref().is_none_or(|(lowest, ..)| score < *lowest) {
            best = Some((score, stages.len() - 1, outcome.model));
        }
    }
    let Some((_, stage, twists)) = best else { return Ok(ControlFlow::Continue(model.clone())) };
    stages[stage].chosen = true;
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
    /// A stage without a loss.
    fn failed(stage: TrainingStage, place: &StageData<'_>) -> Self {
        let StageData { epsilon, time, .. } = *place;
        let (iteration, evaluations, pairs) = (0, 1, place.pairs.len());
        let (loss, gradient, validation) = (f64::INFINITY, f64::INFINITY, None);
        let best = TrainingRecord { iteration, evaluations, loss, pairs, gradient, validation };
        Self { stage, epsilon, time, best, chosen: false }
    }

    fn of(stage: TrainingStage, place: &StageData<'_>, outcome: &Outcome) -> Self {
        let StageData { epsilon, time, .. } = *place;
        Self { stage, epsilon, time, best: outcome.best, chosen: false }
    }
}

/// A stage about to be run.
struct Run<'a> {
    stage: TrainingStage,
    place: &'a StageData<'a>,
    iterations: u64,
    options: &'a TrainingOptions,
}

impl Run<'_> {
    /// [`Run::go`] of weights that need not be the best, with what became of them; None where
    /// nothing can be computed from them.
    fn train_from(
        self,
        model: &Model,
        observer: &mut dyn TrainingObserver,
        stages: &mut Vec<StageResult>,
    ) -> Result<Option<(Outcome, Option<Checkpoint>)>, Error> {
        let (stage, place) = (self.stage, self.place);
        match self.go(model, None, observer) {
            Ok((outcome, checkpoint)) => {
                if outcome.stop != Stop::Interrupted {
                    stages.push(StageResult::of(stage, place, &outcome));
                }
                Ok(Some((outcome, checkpoint)))
            }
            Err(Error::Diverged { .. }) => {
                stages.push(StageResult::failed(stage, place));
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
        observer: &mut dyn TrainingObserver,
    ) -> Result<(Outcome, Option<Checkpoint>), Error> {
        let Self { stage, place, iterations, options } = self;
        let mut options = options.of_stage(iterations);
        if stage != TrainingStage::Last {
            // What ends the training as a whole does not end what leads to it.
            (options.target, options.patience, options.plateau) = (0.0, 0, None);
        }
        let mut newest = observer.earlier(stage)?.or(trial);
        let resume = newest.clone();
        let mut observe = |progress: Progress<'_>| {
            if let (Some(checkpoint), TrainingStage::Start(_)) = (progress.checkpoint, stage) {
                newest = Some(checkpoint.clone());
            }
            observer.observe(stage, progress)
        };
        let outcome = train(model, place.pairs, place.held_out, &options, resume, &mut observe);
        let outcome = outcome.map_err(|error| match error {
            Error::Diverged { what, place } if stage != TrainingStage::Last => {
                Error::Diverged { what, place: format!("{place} of {}", stage.name()) }
            }
            other => other,
        })?;
        Ok((outcome, newest))
    }
}
