//! Training from Python: what `gyroceptron train` does, to the same bits.

use super::arrays::{Rows, dof_of, numbers_of, rows_of};
use super::circles::Circles;
use super::controls::columns_of;
use super::interrupt::{abandonable, goes_on_after};
use super::model::Model;
use super::trained::{Trained, warn};
use crate::error::Error;
use crate::flow::Pairs;
use crate::io::{Checkpoints, StoredModel, read_section};
use crate::layer::{Neuron, Reversor};
use crate::network::{Alternating, Block, LayerSizes};
use crate::scene::{Folder, NextStep, OwnTraining, TrainingTimes, recipe_of};
use crate::train::{
    Checkpoint, Control, ControlOptions, FamilyPairs, Fit, FitNote, FitOptions, Loss, Optimiser,
    Progress, RampStage, TrainingObserver, TrainingStage,
};
use pyo3::conversion::FromPyObjectOwned;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::collections::BTreeMap;
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
pub(super) enum LossWeights<'py> {
    Named(String),
    Given(Rows<'py>),
}

impl LossWeights<'_> {
    fn loss(self) -> PyResult<Loss> {
        match self {
            Self::Given(weights) => {
                Ok(Loss::ByPlane { weights: Some(numbers_of("loss_weights", &weights)?) })
            }
            Self::Named(name) => Ok(Loss::named(&name).ok_or_else(|| {
                Error::invalid("loss_weights", name, "auto, none or positive numbers")
            })?),
        }
    }
}

/// The sizes of the layers of a part, if given: layers and neurons, or polynomials.
type Shape = Option<Sequence<Sizes>>;

/// What Python writes as a tuple, or as a list.
pub(super) struct Sequence<T>(T);

/// What stands in a tuple, in words.
pub(super) trait InWords {
    const WORDS: &'static str;
}

impl<'a, 'py, T: FromPyObjectOwned<'py> + InWords> FromPyObject<'a, 'py> for Sequence<T> {
    type Error = PyErr;

    fn extract(object: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        let object = object.to_owned();
        let tuple = match object.cast::<PyList>() {
            Ok(list) => list.to_tuple().into_any(),
            Err(_) => object,
        };
        match tuple.extract() {
            Ok(found) => Ok(Self(found)),
            Err(_) => {
                let found = tuple.repr()?;
                Err(PyTypeError::new_err(format!("expected {}, found {found}", T::WORDS)))
            }
        }
    }
}

/// A stage of a ramp: the flow time and the iterations, with the degree of polynomials between them; or by the names of
/// what it has.
#[derive(FromPyObject)]
pub(super) enum Stage {
    OfTime(f64, u64),
    OfDegree(Option<f64>, usize, u64),
    #[pyo3(transparent)]
    Named(BTreeMap<String, Option<f64>>),
}

impl InWords for Stage {
    const WORDS: &'static str = "(flow time, iterations), (flow time or None, degree, iterations) or a dictionary of \
                                 flow_time, epsilon, repeats, degree and iterations";
}

impl TryFrom<Stage> for RampStage {
    type Error = Error;

    fn try_from(stage: Stage) -> Result<Self, Error> {
        let (flow_time, degree, iterations) = match stage {
            Stage::OfTime(time, iterations) => (Some(time), None, iterations),
            Stage::OfDegree(time, degree, iterations) => (time, Some(degree), iterations),
            Stage::Named(named) => return of_names(named),
        };
        Ok(Self { flow_time, epsilon: None, repeats: None, degree, iterations })
    }
}

/// A stage of a ramp by the names of what it has.
fn of_names(named: BTreeMap<String, Option<f64>>) -> Result<RampStage, Error> {
    let (mut stage, mut iterations) = (RampStage::default(), None);
    for (name, value) in named {
        let Some(value) = value else { continue };
        let count = || {
            let is_count = value >= 0.0 && value.fract() == 0.0 && value < 2f64.powi(53);
            let invalid =
                || Error::invalid(&format!("{name} of a stage of a ramp"), value, "a count");
            is_count.then_some(value as u64).ok_or_else(invalid)
        };
        match &name[..] {
            "flow_time" => stage.flow_time = Some(value),
            "epsilon" => stage.epsilon = Some(value),
            "repeats" => stage.repeats = Some(count()? as usize),
            "degree" => stage.degree = Some(count()? as usize),
            "iterations" => iterations = Some(count()?),
            _ => {
                let expected = "flow_time, epsilon, repeats, degree or iterations";
                return Err(Error::invalid(
                    "a stage of a ramp",
                    format!("the key `{name}`"),
                    expected,
                ));
            }
        }
    }
    let missing = || Error::Missing {
        place: "a stage of a ramp".into(),
        key: "iterations",
        needed_by: "its training".into(),
    };
    Ok(RampStage { iterations: iterations.ok_or_else(missing)?, ..stage })
}

impl InWords for Sizes {
    const WORDS: &'static str =
        "(layers, neurons), (layers, neurons, activation) or (layers, polynomials, degree)";
}

/// Layers and neurons, with their activation unless it is tanh, or layers, polynomials and their degree.
#[derive(FromPyObject)]
pub(super) enum Sizes {
    Neurons(usize, Widths),
    Polynomials(usize, Widths, usize),
    NeuronsOf(usize, Widths, String),
}

/// Blocks of Python's dictionaries, as JSON has them.
fn blocks_of(py: Python<'_>, blocks: Bound<'_, PyAny>) -> PyResult<Vec<Block>> {
    let dumps = py.import("json")?.getattr("dumps")?;
    let mut out = Vec::new();
    for (number, block) in blocks.try_iter()?.enumerate() {
        let block = block?;
        let text: String = dumps.call1((&block,))?.extract()?;
        out.push(serde_json::from_str(&text).map_err(|reason| {
            // The place is one of the text, which nobody has written.
            let said = reason.to_string();
            let said = said.rsplit_once(" at line ").map_or(&*said, |(said, _)| said);
            // Its name is that of its part, unless it has one.
            let of = |key| block.get_item(key).and_then(|value| value.extract::<String>());
            let name = of("name").or_else(|_| of("part")).unwrap_or_default();
            Error::invalid("blocks", said, "a block").in_block(number, &name)
        })?);
    }
    Ok(out)
}

/// Calls back at each iteration.
struct Calling<'a> {
    callback: Option<&'a Py<PyAny>>,
    /// The exception that the callback or Ctrl-C raised, if one did.
    raised: Option<PyErr>,
    /// It is not called again: training ends at the first iteration that does not end by itself.
    stopped: bool,
    times: TrainingTimes,
    start: Instant,
    /// The file where training keeps its checkpoints, if it keeps any.
    checkpoints: Option<Checkpoints>,
}

impl TrainingObserver for Calling<'_> {
    fn earlier(&mut self, stage: TrainingStage) -> Result<Option<Checkpoint>, Error> {
        self.checkpoints.as_mut().map_or(Ok(None), |checkpoints| checkpoints.earlier(stage))
    }

    fn observe(&mut self, stage: TrainingStage, progress: Progress<'_>) -> Result<Control, Error> {
        let record = progress.record;
        if stage == TrainingStage::Last {
            self.times.points.push((record.iteration, self.start.elapsed().as_secs_f64()));
        }
        if let Some(checkpoints) = &mut self.checkpoints {
            checkpoints.observe(stage, progress)?;
        }
        if self.stopped {
            return Ok(Control::Interrupt);
        }
        let name = if stage == TrainingStage::Last { "training".to_owned() } else { stage.name() };
        let arguments = (name, record.iteration, record.loss, record.validation);
        let goes_on = Python::attach(|py| -> PyResult<bool> {
            py.check_signals()?;
            let Some(callback) = self.callback else { return Ok(true) };
            let answer = callback.bind(py).call1(arguments)?;
            Ok(goes_on_after(&answer))
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

/// A number for all pairs, one for each of them, or that of the network and one for each of them.
#[derive(FromPyObject)]
pub(super) enum Condition<'py> {
    All(f64),
    Family((f64, Rows<'py>)),
    Each(Rows<'py>),
}

/// The number of the network, and those of each pair.
type OfNetworkAndPairs = (Option<f64>, Option<Vec<f64>>);

fn condition(name: &str, of: Option<Condition<'_>>) -> PyResult<OfNetworkAndPairs> {
    Ok(match of {
        None => (None, None),
        Some(Condition::All(number)) => (Some(number), None),
        Some(Condition::Family((number, numbers))) => {
            (Some(number), Some(numbers_of(name, &numbers)?))
        }
        Some(Condition::Each(numbers)) => (None, Some(numbers_of(name, &numbers)?)),
    })
}

/// Trains a network on pairs, the rows of `input` and `output`, (N, 2n) each, in any units, as the
/// program's `train` does, to the same bits. Returns a Model, whose `notes` say what was found and
/// chosen, and whose `trust` says whether to trust it.
///
/// The network
///
/// circle_action: the weight of each plane, whole numbers such as [1, 0], or those of several circles; a number for
/// one plane. "auto" finds the weights from the pairs, of several planes by short trainings with some of them.
/// architecture: "gyroceptron", "normal-form", "coupling-gyroceptron", "kicked-gyroceptron", "henon-net" or
/// "symp-net".
/// psi, near_identity, kicks, twists, turned_twists, perturbation, layers: the sizes of the parts that it has:
/// (layers, neurons), or (layers, (neurons, neurons)) of two widths by turns; (layers, neurons, "arctan") of neurons
/// of arctan in place of tanh; (layers, polynomials, degree) of polynomials in place of neurons. A normal form with a
/// perturbation is nearly integrable, of order one without it.
/// radius: the half width of the box of polynomials, in units of the network: coordinates from -radius to radius.
/// Unless given it is 1.1 times the largest coordinate of the pairs.
/// reversor: makes the map reversible for all weights, S P S = P^-1, where S changes the signs of the "positions" or
/// of the "momenta". Then P = A Phi T S A^-1 S, where A is the kicks and the perturbation, or the network.
/// blocks: a network of your own in place of a named architecture: a list of dictionaries with layer ("henon",
/// "turned-kick", "twist", "turned-twist", "turned-coupling", "symp-net"), widths, part ("conjugation", "chart",
/// "slow-map", "perturbation", "near-identity", "none"), and scale and name where they are not the usual ones of the
/// part; activation "arctan" of neurons that are not of tanh; degree of polynomials, and radius where it is not that
/// of the pairs.
///
/// The pairs
///
/// epsilon, flow_time: the values of the pairs: a number, an array (N,) with one for each pair, or (own, array) with
/// the network's own value. Unless given they are 0.01 and what the pairs determine; of an array the network's own
/// value is that with the largest magnitude.
/// controls: what else the pairs depend on, such as currents: a dictionary of arrays (N,), with a value for each pair.
/// The parameters are polynomials of the controls, and Model.at takes values between.
/// control_degree: the total degree of these polynomials; unless given, the highest up to 4 with fewer terms than
/// values to learn.
/// section: for pairs (x, y) with the area form rho dx dy, an .npz file of rho on a grid: arrays x, y and density,
/// (len(y), len(x)), and optionally scale, one number, 1 by default. For pairs (x1, ..., y1, ...) of several planes
/// these are x1, y1, density1, x2 and so on; a plane without them is canonical, and planes is their number, needed
/// where the last one is. A density that depends on controls, linearly, has an array lambda, (L,) or (L, controls),
/// with their values in the order of `controls`, and is (L, len(y), len(x)). The model then takes and gives x, y.
/// units: "fitted", in which pairs are of order one and turn in circles, or those of the "data".
/// validation: the share of the pairs that is held out.
///
/// The training
///
/// recipe: network and training where no other argument sets them: "recommended", a normal form by Levenberg-Marquardt
/// from three initial weights until it is at rest, or "paper", its gyroceptron by L-BFGS.
/// scene: a built-in scene or a .toml file from which network and training options are taken; other arguments take
/// precedence over it.
/// optimiser: "lm" (Levenberg-Marquardt, which gets furthest), "l-bfgs" or "adam".
/// iterations: the largest number of iterations, 1000 unless given; each of several starts takes 40 of its own first.
/// starts: the number of sets of initial weights. Each is trained for 40 iterations, and the best goes on.
/// ramp: stages before the training, on pairs with flow times of their own: a list of (flow time, iterations), or
/// (flow time or None, degree, iterations) for polynomials of at most that degree, or dictionaries of flow_time,
/// epsilon, repeats, degree and iterations; with repeats m only the first 1/m of the twists are trained, and repeated m
/// times after the ramp.
/// loss_weights: the weights of the planes in the loss and in the held-out error that chooses the model: "auto", by
/// the motion of each plane beside the rotation, "none", or n or 2n positive numbers.
/// near_identity_penalty: the factor with which the mean square of I_epsilon(z) - z is added to the loss; of a map
/// with a perturbation that of chi(K_epsilon(chi^-1(z))) - z.
/// theta, theta_fixed, theta_penalty: the initial angle (unless given, that of the nearest rotation), whether it stays
/// fixed, and the factor with which its squared distance from there is added to the loss.
/// patience, target: stop when the held-out error has not improved for so many evaluations, one in ten iterations, or
/// is at most the target; 0 never stops.
/// plateau: stop when the held-out error has fallen by less than a tenth in so many iterations, 50 with "lm" unless
/// given; 0 never stops.
/// seed: the seed of the weights and of the choice of held-out pairs.
///
/// The run
///
/// report: a folder for a report with plots, which says whether to trust the model.
/// checkpoint, resume: a file that the training keeps its state in, and whether it goes on from there, to the same
/// bits.
/// callback: called with (stage, iteration, loss, held-out error or None) at each iteration; False stops the training,
/// and the best model of the stage that is stopped is returned.
///
/// Warns (UserWarning) when the pairs fit far better in another order of columns or with another circle action, when
/// they do not keep areas, have a symmetry that the network has not or not the one that it has, or have epsilon below
/// 0. Raises Error when an argument is wrong, an array has a mask or numbers that are complex, NaN or infinite, "auto"
/// is not sure, or the report would replace another. Ctrl-C ends it, in most trainings within a second.
#[pyfunction]
#[pyo3(signature = (
    input, output, circle_action=Circles::Auto, *, recipe=None, scene=None, architecture=None, psi=None,
    near_identity=None, kicks=None, twists=None, turned_twists=None, perturbation=None, layers=None, radius=None, reversor=None, blocks=None, optimiser=None,
    iterations=None, starts=None, ramp=None, near_identity_penalty=None, loss_weights=None, patience=None,
    target=None, plateau=None, epsilon=None, flow_time=None, theta=None, theta_fixed=false,
    theta_penalty=None, controls=None, control_degree=None, section=None, units="fitted", validation=0.1, seed=0, report=None, checkpoint=None,
    resume=false, callback=None
))]
#[allow(clippy::too_many_arguments)]
pub(super) fn train(
    py: Python<'_>,
    input: Rows<'_>,
    output: Rows<'_>,
    circle_action: Circles,
    recipe: Option<&str>,
    scene: Option<PathBuf>,
    architecture: Option<&str>,
    psi: Shape,
    near_identity: Shape,
    kicks: Shape,
    twists: Shape,
    turned_twists: Shape,
    perturbation: Shape,
    layers: Shape,
    radius: Option<f64>,
    reversor: Option<&str>,
    blocks: Option<Bound<'_, PyAny>>,
    optimiser: Option<&str>,
    iterations: Option<u64>,
    starts: Option<u64>,
    ramp: Option<Vec<Sequence<Stage>>>,
    near_identity_penalty: Option<f64>,
    loss_weights: Option<LossWeights<'_>>,
    patience: Option<u64>,
    target: Option<f64>,
    plateau: Option<u64>,
    epsilon: Option<Condition<'_>>,
    flow_time: Option<Condition<'_>>,
    theta: Option<f64>,
    theta_fixed: bool,
    theta_penalty: Option<f64>,
    controls: Option<Bound<'_, PyDict>>,
    control_degree: Option<usize>,
    section: Option<PathBuf>,
    units: &str,
    validation: f64,
    seed: u64,
    report: Option<PathBuf>,
    checkpoint: Option<PathBuf>,
    resume: bool,
    callback: Option<Py<PyAny>>,
) -> PyResult<Model> {
    if resume && checkpoint.is_none() {
        return Err(Error::invalid("resume", "True", "a checkpoint beside it").into());
    }
    let scene = scene.map(|path| path.display().to_string());
    let (name, recipe) = recipe_of(recipe, scene.as_deref())?;
    let action = circle_action.given()?;
    let dof = match (&action, dof_of("input", &input)) {
        (None, dof) => dof?,
        (Some(action), Ok(dof)) => {
            Error::check_count("circle_action: weights", dof, action.dof())?;
            dof
        }
        (Some(action), Err(_)) => action.dof(),
    };
    let (input, output) = (rows_of("input", &input, dof)?, rows_of("output", &output, dof)?);
    let pairs = Pairs::new("pairs", dof, input, output)?;
    let ((epsilon, epsilons), (flow_time, times)) =
        (condition("epsilon", epsilon)?, condition("flow_time", flow_time)?);
    let (names, values) = controls.map(|of| columns_of(&of, pairs.len())).transpose()?.unzip();
    let data = FamilyPairs::new(pairs, epsilons.as_deref(), times.as_deref(), values.as_deref())?;
    let sizes = [
        ("psi", psi),
        ("near_identity", near_identity),
        ("kicks", kicks),
        ("twists", twists),
        ("turned_twists", turned_twists),
        ("perturbation", perturbation),
        ("layers", layers),
    ];
    let given = sizes.into_iter().filter_map(|(key, size)| Some((key, size?)));
    let stages = |stages: Vec<Sequence<Stage>>| -> Result<Vec<RampStage>, Error> {
        stages.into_iter().map(|Sequence(stage)| stage.try_into()).collect()
    };
    let options = FitOptions {
        architecture: architecture.map(str::to_owned),
        blocks: blocks.map(|blocks| blocks_of(py, blocks)).transpose()?,
        sizes: given.map(|(key, size)| Ok((key, sizes_of(size)?))).collect::<Result<_, Error>>()?,
        radius,
        reversor: reversor.map(Reversor::find).transpose()?,
        optimiser: optimiser.map(Optimiser::named).transpose()?,
        iterations,
        starts,
        plateau,
        ramp: ramp.map(stages).transpose()?,
        loss: loss_weights.map(LossWeights::loss).transpose()?,
        near_identity_penalty,
        theta_fixed,
        theta_penalty,
        patience,
        target,
    };
    let base = options.apply_to(recipe)?;
    let fit = Fit {
        action,
        epsilon,
        flow_time,
        theta,
        controls: ControlOptions { names: names.unwrap_or_default(), degree: control_degree },
        section: section.as_deref().map(read_section).transpose()?,
        units: match units {
            "fitted" => true,
            "data" => false,
            _ => return Err(Error::invalid("units", units, "fitted or data").into()),
        },
        validation,
        seed,
        ..base
    };
    fit.check()?;
    // Before anything is computed.
    report.as_deref().map_or(Ok(()), |folder| Folder::check_report(folder, false))?;
    // Some of what is looked for in many pairs takes more than a second.
    let problem = abandonable(py, move |stop| {
        fit.prepare_observed(data, &mut || {
            Ok(if stop.go_on() { Control::Continue } else { Control::Interrupt })
        })
    })?;
    let notes = problem.notes.iter().map(FitNote::to_string).collect();
    for note in problem.notes.iter().filter(|note| note.is_warning()) {
        warn(py, &note.to_string())?;
    }
    let checkpoints = checkpoint.map(|path| Checkpoints::new(path, resume));
    if let Some(checkpoints) = &checkpoints {
        checkpoints.check(&problem.training)?;
    }
    let report = report.map(|path| Folder::open_report(&path, false)).transpose()?;
    let start = Instant::now();
    let times = TrainingTimes { model: name.clone(), ..TrainingTimes::default() };
    let callback = callback.as_ref();
    let mut observer =
        Calling { callback, raised: None, stopped: false, times, start, checkpoints };
    let fitted = py.detach(|| problem.train(&mut observer));
    let Calling { raised, times, checkpoints, .. } = observer;
    if let Some(raised) = raised {
        return Err(raised);
    }
    let fitted = fitted?;
    if let Some(checkpoints) = &checkpoints {
        checkpoints.remove_after(fitted.outcome().stop)?;
    }
    let stored = StoredModel::of_fit(&fitted, &name);
    let controls = fitted.problem.architecture.controls.as_ref();
    let example = controls.map(|controls| controls.example().replace(',', ", "));
    let next = &|step: NextStep| match (&example, step) {
        (Some(values), NextStep::Predict) => format!("model.at({values}).predict(points, steps)"),
        _ => next_call(step),
    };
    let trained = py.detach(|| Trained::of(&fitted, notes, next))?;
    if let Some(folder) = report {
        let command = "The same call of `gyroceptron.train` with the same pairs".into();
        py.detach(|| OwnTraining { name, fitted, times, command, next }.report(&folder))?;
    }
    Ok(Model { stored, trained: Some(Arc::new(trained)) })
}

/// The sizes of a part.
fn sizes_of(Sequence(sizes): Sequence<Sizes>) -> Result<LayerSizes, Error> {
    let (count, width, degree, activation) = match sizes {
        Sizes::Neurons(count, width) => (count, width, None, None),
        Sizes::Polynomials(count, width, degree) => (count, width, Some(degree), None),
        Sizes::NeuronsOf(count, width, name) => {
            let unknown = || Error::invalid("activation of neurons", &name, "tanh or arctan");
            (count, width, None, Some(Neuron::named(&name).ok_or_else(unknown)?))
        }
    };
    let width = match width {
        Widths::Same(width) => Alternating::Same(width),
        Widths::Two(widths) => Alternating::Two(widths),
    };
    Ok(LayerSizes { count, width, degree, activation })
}

/// A next step as a call.
fn next_call(step: NextStep) -> String {
    let with = |more: &str| format!("gyroceptron.train(…, {more})");
    match step {
        NextStep::Predict => "model.predict(points, steps)".into(),
        NextStep::NormalForm => with("architecture=\"normal-form\", optimiser=\"lm\""),
        NextStep::Couplings => with("architecture=\"coupling-gyroceptron\""),
        NextStep::Action => with("circle_action=\"auto\""),
        NextStep::Iterations(iterations) => with(&format!("iterations={iterations}")),
        NextStep::HoldOut => with(&format!("validation={}", Fit::HELD_OUT)),
        NextStep::Pairs(_) | NextStep::DistinctPairs => {
            "gyroceptron.train(more_input, more_output, …)".into()
        }
        NextStep::Values(_) => "gyroceptron.train(…, controls=more_values)".into(),
        NextStep::Marquardt => with("optimiser=\"lm\""),
        NextStep::Starts(starts) => with(&format!("starts={starts}")),
    }
}
