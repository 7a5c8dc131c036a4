//! Training from Python: what `gyroceptron train` does, to the same bits.

use super::Model;
use super::arrays::{Rows, rows_of};
use super::circles::Circles;
use super::trained::{Trained, note_of_units, warn_of_reading};
use crate::error::Error;
use crate::flow::Pairs;
use crate::io::{Provenance, StoredModel};
use crate::layer::TorusAction;
use crate::network::{self, Alternating, Block, LayerSizes, NetworkSpec};
use crate::scene::{Folder, ModelSpec, NextStep, OwnTraining, TrainingTimes};
use crate::train::{
    AdamOptions, Checkpoint, Control, LbfgsOptions, Leg, LevenbergMarquardtOptions, Loss,
    Optimiser, Place, Plateau, Preparation, Prepared, Progress, Starts, TrainingOptions, Watch,
    train_schedule,
};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Neurons of each shear, or two numbers by turns.
#[derive(FromPyObject)]
pub(super) enum Widths {
    Same(usize),
    Two([usize; 2]),
}

/// Weights of the planes in the loss.
#[derive(FromPyObject)]
pub(super) enum LossWeights {
    Named(String),
    Given(Vec<f64>),
}

impl LossWeights {
    fn loss(self) -> Result<Loss, Error> {
        match self {
            Self::Given(weights) => Ok(Loss::ByPlane { weights: Some(weights) }),
            Self::Named(name) => match name.as_str() {
                "auto" => Ok(Loss::ByPlane { weights: None }),
                "none" => Ok(Loss::MeanSquaredError),
                _ => Err(Error::invalid("loss_weights", name, "auto, none or positive numbers")),
            },
        }
    }
}

/// (layers, neurons).
type Shape = Option<(usize, usize)>;

fn layers((count, width): (usize, usize)) -> LayerSizes {
    LayerSizes::uniform(count, width)
}

/// Unless it is given.
const EPSILON: f64 = 0.01;

/// More starts are a slip of the pen.
const MOST_STARTS: usize = 1000;

/// Blocks of Python's dictionaries, as JSON has them.
fn blocks_of(py: Python<'_>, blocks: Bound<'_, PyAny>) -> PyResult<Vec<Block>> {
    let text: String = py.import("json")?.call_method1("dumps", (blocks,))?.extract()?;
    let blocks = serde_json::from_str(&text)
        .map_err(|reason| Error::invalid("blocks", reason, "a list of blocks"))?;
    Ok(blocks)
}

/// Calls back at each iteration.
struct Calling<'a> {
    callback: Option<&'a Py<PyAny>>,
    /// What the callback raised.
    raised: Option<PyErr>,
    /// It is not called again: training ends at the first iteration that does not end by itself.
    stopped: bool,
    times: TrainingTimes,
    start: Instant,
}

impl Watch for Calling<'_> {
    fn earlier(&mut self, _: Leg) -> Result<Option<Checkpoint>, Error> {
        Ok(None)
    }

    fn observe(&mut self, leg: Leg, progress: Progress<'_>) -> Result<Control, Error> {
        let record = progress.record;
        if leg == Leg::Last {
            self.times.points.push((record.iteration, self.start.elapsed().as_secs_f64()));
        }
        if self.stopped {
            return Ok(Control::Interrupt);
        }
        let name = if leg == Leg::Last { "training".to_owned() } else { leg.name() };
        let told = (name, record.iteration, record.loss, record.validation);
        let goes_on = Python::attach(|py| -> PyResult<bool> {
            py.check_signals()?;
            let Some(callback) = self.callback else { return Ok(true) };
            let answer = callback.bind(py).call1(told)?;
            Ok(answer.is_none() || answer.is_truthy()?)
        });
        match goes_on {
            Ok(true) => return Ok(Control::Continue),
            Ok(false) => {}
            Err(raised) => self.raised = Some(raised),
        }
        self.stopped = true;
        Ok(Control::Interrupt)
    }
}

/// Trains a network on pairs, the rows of `input` and `output`, (N, 2n) each, in any units, as the
/// program's `train` does, to the same bits. Returns a Model.
///
/// circle_action: the weight of each plane, whole numbers such as [1, 0], or those of several circles; a
/// number for one plane; "auto" finds the weights from the pairs.
/// architecture: "gyroceptron", "normal-form", "coupling-gyroceptron", "henon-net" or "sympnet".
/// psi, near_identity, kicks, twists, perturbation, layers: (layers, neurons) of the parts that it
/// has; a normal form with a perturbation is nearly integrable, of order one without it.
/// blocks: a network of your own in place of a named architecture: a list of dictionaries with layer
/// ("henon", "turned-kick", "twist", "turned-coupling", "symp-net"), widths, part ("conjugation",
/// "chart", "slow-map", "perturbation", "near-identity", "none"), and scale and name where they are
/// not the usual ones of the part.
/// optimiser: "l-bfgs", "lm" (Levenberg-Marquardt, which gets furthest) or "adam".
/// iterations: at most so many, 1000 unless given.
/// starts: so many sets of initial weights, 40 iterations each, of which the best goes on.
/// near_identity_penalty: the loss gets so many times the mean square of I_epsilon(z) - z.
/// patience, target: stop when the held-out error has not improved for so many evaluations, one
/// in ten iterations, or is at most the target; 0 never stops.
/// plateau: stop when the held-out error has fallen by less than a tenth in so many iterations, 50
/// with "lm" unless given; 0 never stops.
/// epsilon, flow_time: those of the pairs, 0.01 and what they tell unless given: epsilon of networks with a circle
/// action, the flow time of normal forms and of couplings, whose generators are told both.
/// loss_weights: "auto", by the motion of each plane beside the rotation, "none", or n or 2n positive
/// numbers: of the planes in the loss and in the held-out error that chooses the model.
/// theta, theta_fixed, theta_penalty: the angle to start from, the nearest rotation's unless given,
/// whether it stays, and what its squared distance from there adds to the loss.
/// units: "fitted", in which pairs are of order one and turn in circles, or those of the "data".
/// validation: the share that is held out. seed: of the weights and of that choice.
/// report: a folder for a report with plots, which says whether to trust the model.
/// callback: called with (leg, iteration, loss, held-out error or None) at each iteration; False
/// stops the training, and the best model of the leg that is stopped is returned.
///
/// Warns (UserWarning) when the pairs fit far better in another order of columns or with another
/// circle action. Raises Error when an argument is wrong, an array has a mask or numbers that are
/// complex, NaN or infinite, "auto" is not sure, or the report would replace another. Ctrl-C takes effect at
/// the end of an iteration.
#[pyfunction]
#[pyo3(signature = (
    input, output, circle_action, *, architecture="gyroceptron", psi=None, near_identity=None,
    kicks=None, twists=None, perturbation=None, layers=None, blocks=None, optimiser="l-bfgs", iterations=None, starts=1,
    near_identity_penalty=0.0, loss_weights=LossWeights::Named("auto".into()), patience=0, target=0.0, plateau=None, epsilon=None, flow_time=None, theta=None,
    theta_fixed=false, theta_penalty=0.0, units="fitted", validation=0.1, seed=0, report=None, callback=None
))]
#[allow(clippy::too_many_arguments)]
pub(super) fn train(
    py: Python<'_>,
    input: Rows<'_>,
    output: Rows<'_>,
    circle_action: Circles,
    architecture: &str,
    psi: Shape,
    near_identity: Shape,
    kicks: Shape,
    twists: Option<(usize, Widths)>,
    perturbation: Shape,
    layers: Shape,
    blocks: Option<Bound<'_, PyAny>>,
    optimiser: &str,
    iterations: Option<u64>,
    starts: u64,
    near_identity_penalty: f64,
    loss_weights: LossWeights,
    patience: u64,
    target: f64,
    plateau: Option<u64>,
    epsilon: Option<f64>,
    flow_time: Option<f64>,
    theta: Option<f64>,
    theta_fixed: bool,
    theta_penalty: f64,
    units: &str,
    validation: f64,
    seed: u64,
    report: Option<PathBuf>,
    callback: Option<Py<PyAny>>,
) -> PyResult<Model> {
    let (action, found) = circle_action.action(py, &input, &output)?;
    let dof = action.dof();
    let (input, output) = (rows_of("input", &input, dof)?, rows_of("output", &output, dof)?);
    let pairs = Pairs::new("pairs", dof, input, output)?;
    let shapes = Shapes { psi, near_identity, kicks, twists, perturbation, layers };
    let blocks = blocks.map(|blocks| blocks_of(py, blocks)).transpose()?.unwrap_or_default();
    let network = shapes.network(architecture, &action, blocks)?;
    // Of any flow time: before pairs are gone through for each harmonic of the circle action.
    let any = network.architecture(&action, epsilon.unwrap_or(EPSILON), 1.0)?;
    any.check()?;
    let of_gyroceptron = "none: only a gyroceptron has it";
    let of_generators = "none: only a normal form and couplings have it";
    for (name, value, fits, expected) in [
        ("theta", theta, any.has_circle(), of_gyroceptron),
        ("epsilon", epsilon, any.has_circle(), of_gyroceptron),
        ("flow_time", flow_time, any.has_flow_time(), of_generators),
    ] {
        if let (Some(value), false) = (value, fits) {
            return Err(Error::invalid(name, value, expected).into());
        }
    }
    let epsilon = epsilon.unwrap_or(EPSILON);
    if let Some(theta) = theta {
        Error::check_finite("theta", theta)?;
    }
    let of_order_one = any.is_of_order_one();
    let scaled = any.has_flow_time() && !of_order_one;
    if scaled && epsilon == 0.0 && flow_time.is_none() {
        return Err(Error::invalid("epsilon", 0, "another number, or a flow_time").into());
    }
    Error::check_count_range(
        "starts",
        usize::try_from(starts).unwrap_or(usize::MAX),
        1,
        MOST_STARTS,
    )?;
    let defaults = TrainingOptions::default();
    let options = TrainingOptions {
        optimiser: match optimiser {
            "l-bfgs" => Optimiser::Lbfgs(LbfgsOptions::default()),
            "lm" => Optimiser::LevenbergMarquardt(LevenbergMarquardtOptions::default()),
            "adam" => Optimiser::Adam(AdamOptions::default()),
            _ => return Err(Error::invalid("optimiser", optimiser, "l-bfgs, lm or adam").into()),
        },
        iterations: iterations.unwrap_or(defaults.iterations),
        starts: (starts > 1).then_some(Starts { count: starts, iterations: Starts::TRIAL }),
        loss: loss_weights.loss()?,
        near_identity_penalty,
        theta_fixed,
        theta_penalty,
        patience,
        target,
        plateau: match plateau {
            Some(iterations) => Plateau::over(iterations),
            None => (optimiser == "lm").then(Plateau::default),
        },
        ..defaults
    };
    options.check()?;
    options.loss.check(dof).map_err(|e| e.at("loss_weights"))?;
    options.check_for(&any)?;
    let preparation = Preparation {
        place: "pairs",
        action: &action,
        epsilon,
        flow_time,
        of_order_one,
        theta,
        units: match units {
            "fitted" => true,
            "data" => false,
            _ => return Err(Error::invalid("units", units, "fitted or data").into()),
        },
        validation,
        seed,
    };
    warn_of_reading(py, &pairs, &action)?;
    // Before anything is computed.
    let report = report.map(|path| Folder::open_report(&path, false)).transpose()?;
    let notes = found.into_iter().collect();
    let training = Training { preparation, network, options, pairs, report, notes };
    let start = Instant::now();
    let times = TrainingTimes { model: "train".into(), ..TrainingTimes::default() };
    let callback = callback.as_ref();
    let mut watch = Calling { callback, raised: None, stopped: false, times, start };
    let made = py.detach(|| training.run(&mut watch));
    match watch.raised {
        Some(raised) => Err(raised),
        None => made.map(|(stored, trained)| Model { stored, trained: Some(Arc::new(trained)) }),
    }
}

/// Those of the parts that were asked for.
struct Shapes {
    psi: Shape,
    near_identity: Shape,
    kicks: Shape,
    twists: Option<(usize, Widths)>,
    perturbation: Shape,
    layers: Shape,
}

impl Shapes {
    fn network(
        self,
        architecture: &str,
        action: &TorusAction,
        blocks: Vec<Block>,
    ) -> Result<NetworkSpec, Error> {
        let mut network = match blocks.is_empty() {
            true => NetworkSpec::named(architecture)?,
            false => NetworkSpec::of_blocks(blocks),
        };
        let sizes = [
            ("psi", self.psi.map(layers)),
            ("near_identity", self.near_identity.map(layers)),
            ("kicks", self.kicks.map(layers)),
            ("twists", self.twists.map(twists)),
            ("perturbation", self.perturbation.map(layers)),
            ("layers", self.layers.map(layers)),
        ];
        for (key, size) in sizes {
            if let Some(size) = size {
                network = network.with_size(key, size)?;
            }
        }
        if network.circles() == network::Circles::Several {
            network.action = Some(action.clone());
        }
        network.check()?;
        Ok(network)
    }
}

fn twists((count, width): (usize, Widths)) -> LayerSizes {
    let width = match width {
        Widths::Same(width) => Alternating::Same(width),
        Widths::Two(widths) => Alternating::Two(widths),
    };
    LayerSizes { count, width }
}

/// A next step as a call.
fn next_call(step: NextStep) -> String {
    let with = |more: &str| format!("gyroceptron.train(…, {more})");
    match step {
        NextStep::Predict => "model.predict(points, steps)".into(),
        NextStep::NormalForm => with("architecture=\"normal-form\", optimiser=\"lm\""),
        NextStep::Iterations(iterations) => with(&format!("iterations={iterations}")),
        NextStep::Pairs(_) => "gyroceptron.train(more_input, more_output, …)".into(),
        NextStep::Marquardt => with("optimiser=\"lm\""),
        NextStep::Starts(starts) => with(&format!("starts={starts}")),
    }
}

/// A training that has been checked.
struct Training<'a> {
    preparation: Preparation<'a>,
    network: NetworkSpec,
    options: TrainingOptions,
    pairs: Pairs,
    report: Option<Folder>,
    /// On the pairs.
    notes: Vec<String>,
}

impl Training<'_> {
    fn run(self, watch: &mut Calling<'_>) -> Result<(StoredModel, Trained), PyErr> {
        let Self { preparation, network, options, pairs, report, mut notes } = self;
        let Preparation { action, epsilon, seed, flow_time: known, .. } = preparation;
        let digest = pairs.digest();
        let Prepared { pairs, held_out, units, region, nearest, angles, flow_time } =
            preparation.prepare(pairs)?;
        let architecture = network.architecture(action, epsilon, flow_time)?;
        architecture.check()?;
        options.check_for(&architecture)?;
        let loss = options.loss.for_pairs(action, &nearest, &pairs)?;
        let options = TrainingOptions { loss, ..options };
        let mut start = |number: u64| {
            let seed = Starts::seed(seed, number);
            architecture.initialise(ModelSpec::OWN_WEIGHTS, 0.0, seed)?.with_angles(&angles)
        };
        let (iterations, held) = (options.iterations, held_out.as_ref());
        let place = Place { epsilon, time: 1.0, pairs: &pairs, held_out: held, iterations };
        let training = train_schedule(&mut start, &[place], &options, watch)?;
        if let Some(raised) = watch.raised.take() {
            return Err(raised);
        }
        let outcome = &training.outcome;
        let provenance = Provenance {
            seed: Some(seed),
            data: Some(digest),
            flow_time: known,
            validation: outcome.best.validation,
            region,
            ..Provenance::of("train")
        };
        let stored = StoredModel { model: outcome.model.clone(), units, provenance };
        notes.extend(note_of_units(stored.units.as_ref()));
        let trained = Trained::of(outcome, &pairs, held, (action, &nearest), notes)?;
        if let Some(folder) = report {
            let spec = ModelSpec {
                name: "train".into(),
                network,
                weights: ModelSpec::OWN_WEIGHTS,
                training: None,
                training_only: false,
                seeds: None,
            };
            let report = OwnTraining {
                spec,
                options: &options,
                seed,
                nearest: (action, &nearest),
                training,
                pairs: &pairs,
                held_out: held,
                units: stored.units.as_ref(),
                times: std::mem::take(&mut watch.times),
                command: "The same call of `gyroceptron.train` with the same pairs".into(),
                next: &next_call,
            };
            report.report(&folder)?;
        }
        Ok((stored, trained))
    }
}
