//! Training from Python: what `gyroceptron train` does, to the same bits.

use super::{Model, Rows, rows_of};
use crate::error::Error;
use crate::flow::Pairs;
use crate::io::{Provenance, StoredModel};
use crate::layer::{CircleAction, TorusAction};
use crate::measure::rotation_errors;
use crate::scene::{
    ByTurns, Folder, Layers, ModelSpec, NetworkSpec, NextStep, OwnTraining, TrainingTimes,
    TwistLayers,
};
use crate::train::{
    AdamOptions, Checkpoint, Control, LbfgsOptions, Leg, LevenbergMarquardtOptions, Optimiser,
    Place, Plateau, Preparation, Prepared, Progress, Starts, TrainingOptions, Watch,
    train_schedule,
};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::time::Instant;

/// One circle, or several.
#[derive(FromPyObject)]
pub(super) enum Circles {
    One(Vec<i32>),
    Several(Vec<Vec<i32>>),
}

impl Circles {
    fn action(self) -> Result<TorusAction, Error> {
        let circles = match self {
            Self::One(weights) => vec![weights],
            Self::Several(circles) => circles,
        };
        let circles: Vec<_> = circles.into_iter().map(CircleAction::new).collect();
        TorusAction::new(circles).map_err(|e| e.at("circle_action"))
    }
}

/// Neurons of each shear, or two numbers by turns.
#[derive(FromPyObject)]
pub(super) enum Widths {
    Same(usize),
    Two([usize; 2]),
}

/// (layers, neurons).
type Shape = Option<(usize, usize)>;

fn layers(shape: (usize, usize)) -> Layers {
    Layers { count: shape.0, width: shape.1 }
}

/// Unless it is given.
const EPSILON: f64 = 0.01;

/// More starts are a slip of the pen.
const MOST_STARTS: usize = 1000;

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

/// Trains a network on pairs, the rows of `input` and `output`, (N, 2n) each, as the program's
/// `train` does, to the same bits.
///
/// circle_action: the weight of each plane, such as [1, 0], or those of several circles.
/// architecture: "gyroceptron", "normal-form", "coupling-gyroceptron", "henon-net" or "sympnet".
/// psi, near_identity, kicks, twists, perturbation, layers: (layers, neurons) of the parts that it
/// has; a normal form with a perturbation is nearly integrable, of order one without it.
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
/// theta, theta_fixed, theta_penalty: the angle to start from, the nearest rotation's unless given,
/// whether it stays, and what its squared distance from there adds to the loss.
/// units: "fitted", in which pairs are of order one and turn in circles, or those of the "data".
/// validation: the share that is held out. seed: of the weights and of that choice.
/// report: a folder for a report with plots, which says whether to trust the model.
/// callback: called with (leg, iteration, loss, held-out error or None) at each iteration; False
/// stops the training, and the best model of the leg that is stopped is returned.
#[pyfunction]
#[pyo3(signature = (
    input, output, circle_action, *, architecture="gyroceptron", psi=None, near_identity=None,
    kicks=None, twists=None, perturbation=None, layers=None, optimiser="l-bfgs", iterations=None, starts=1,
    near_identity_penalty=0.0, patience=0, target=0.0, plateau=None, epsilon=None, flow_time=None, theta=None,
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
    optimiser: &str,
    iterations: Option<u64>,
    starts: u64,
    near_identity_penalty: f64,
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
    let action = circle_action.action()?;
    let dof = action.dof();
    let (input, output) = (rows_of("input", &input, dof)?, rows_of("output", &output, dof)?);
    let pairs = Pairs::new("pairs", dof, input, output)?;
    let shapes = Shapes { psi, near_identity, kicks, twists, perturbation, layers };
    let network = shapes.network(architecture, &action)?;
    let of_gyroceptron = "none: only a gyroceptron has it";
    let of_generators = "none: only a normal form and couplings have it";
    for (name, value, fits, expected) in [
        ("theta", theta, network.has_circle(), of_gyroceptron),
        ("epsilon", epsilon, network.has_circle(), of_gyroceptron),
        ("flow_time", flow_time, network.has_flow_time(), of_generators),
    ] {
        if let (Some(value), false) = (value, fits) {
            return Err(Error::invalid(name, value, expected).into());
        }
    }
    let epsilon = epsilon.unwrap_or(EPSILON);
    if let Some(theta) = theta {
        Error::check_finite("theta", theta)?;
    }
    let of_order_one = network.is_nearly_integrable();
    let scaled = network.has_flow_time() && !of_order_one;
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
    // Of any flow time: before pairs are gone through for each harmonic of the circle action.
    let any = network.architecture(&action.circles()[0], epsilon, 1.0);
    any.map_or(Ok(()), |any| any.check().and_then(|()| options.check_for(&any)))?;
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
    // Before anything is computed.
    let report = report.map(|path| Folder::open_report(&path, false)).transpose()?;
    let training = Training { preparation, network, options, pairs, report };
    let start = Instant::now();
    let times = TrainingTimes { model: "train".into(), ..TrainingTimes::default() };
    let callback = callback.as_ref();
    let mut watch = Calling { callback, raised: None, stopped: false, times, start };
    let stored = py.detach(|| training.run(&mut watch));
    match watch.raised {
        Some(raised) => Err(raised),
        None => Ok(Model { stored: stored? }),
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
    fn network(self, architecture: &str, action: &TorusAction) -> Result<NetworkSpec, Error> {
        let mut network = match architecture {
            "gyroceptron" => NetworkSpec::default_gyroceptron(),
            "normal-form" => NetworkSpec::default_normal_form(),
            "coupling-gyroceptron" => NetworkSpec::default_coupling_gyroceptron(),
            "henon-net" => NetworkSpec::default_henon_net(),
            "sympnet" => NetworkSpec::default_symp_net(),
            _ => {
                let expected =
                    "gyroceptron, normal-form, coupling-gyroceptron, henon-net or sympnet";
                return Err(Error::invalid("architecture", architecture, expected));
            }
        };
        let Self {
            mut psi,
            mut near_identity,
            mut kicks,
            mut twists,
            mut perturbation,
            layers: mut plain,
        } = self;
        match &mut network {
            NetworkSpec::Gyroceptron { psi: own, near_identity: near, .. }
            | NetworkSpec::CouplingGyroceptron { psi: own, near_identity: near, .. } => {
                *own = psi.take().map_or(*own, layers);
                *near = near_identity.take().map_or(*near, layers);
            }
            NetworkSpec::NormalForm {
                psi: own,
                kicks: of,
                twists: shears,
                action: circles,
                perturbation: beside,
            } => {
                *beside = perturbation.take().map(layers).or(*beside);
                *own = psi.take().map(layers);
                *of = kicks.take().map_or(*of, layers);
                if let Some((count, widths)) = twists.take() {
                    let width = match widths {
                        Widths::Same(width) => ByTurns::Same(width),
                        Widths::Two(widths) => ByTurns::Two(widths),
                    };
                    *shears = TwistLayers { count, width };
                }
                *circles = Some(action.clone());
            }
            NetworkSpec::HenonNet { layers: own } => *own = plain.take().map_or(*own, layers),
            NetworkSpec::SympNet { modules, shears, .. } => {
                (*modules, *shears) = plain.take().unwrap_or((*modules, *shears));
            }
            NetworkSpec::File { .. } => {}
        }
        // What no part has taken.
        for (name, left) in [
            ("psi", psi.is_some()),
            ("near_identity", near_identity.is_some()),
            ("kicks", kicks.is_some()),
            ("twists", twists.is_some()),
            ("perturbation", perturbation.is_some()),
            ("layers", plain.is_some()),
        ] {
            if left {
                return Err(Error::invalid(name, architecture, "an architecture that has it"));
            }
        }
        if !matches!(network, NetworkSpec::NormalForm { .. }) && action.circles().len() > 1 {
            let found = format!("{} circles", action.circles().len());
            let expected = "one circle, but for a gyroceptron in normal form";
            return Err(Error::invalid("circle_action", found, expected));
        }
        network.check_counts()?;
        Ok(network)
    }
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
}

impl Training<'_> {
    fn run(self, watch: &mut Calling<'_>) -> Result<StoredModel, PyErr> {
        let Self { preparation, network, options, pairs, report } = self;
        let Preparation { action, epsilon, seed, flow_time: known, .. } = preparation;
        let digest = pairs.digest();
        let Prepared { pairs, held_out, units, region, nearest, angles, flow_time } =
            preparation.prepare(pairs)?;
        let Some(architecture) = network.architecture(&action.circles()[0], epsilon, flow_time)
        else {
            return Err(Error::invalid("architecture", "file", "a network to train").into());
        };
        architecture.check()?;
        options.check_for(&architecture)?;
        let mut start = |number: u64| {
            let seed = Starts::seed(seed, number);
            architecture.initialise(ModelSpec::OWN_WEIGHTS, 0.0, seed)?.with_angles(&angles)
        };
        let (iterations, held) = (options.iterations, held_out.as_ref());
        let place = Place { epsilon, time: 1.0, pairs: &pairs, held_out: held, iterations };
        let training = train_schedule(&mut start, &[place], &options, watch)?;
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
        if let (Some(folder), None) = (report, &watch.raised) {
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
                rotation_errors: rotation_errors(action, &nearest, held.unwrap_or(&pairs)),
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
        Ok(stored)
    }
}
