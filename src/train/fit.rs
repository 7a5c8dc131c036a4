//! From pairs to a model: the one way of the program, of Python and of library users.

use super::{
    ActionFit, ActionTrial, Control, ControlOptions, FitNote, Fitted, LevenbergMarquardtOptions,
    Loss, Optimiser, Plateau, Preparation, Prepared, Problem, Progress, Reading, ReversalDefect,
    StagePairs, Starts, TrainingObserver, TrainingOptions, TrainingStage,
};
use crate::error::Error;
use crate::flow::{Condition, FormDefect, Pairs, TwoFits};
use crate::layer::{CircleAction, FastPlanes, TorusAction};
use crate::measure::trajectories::{root_mean_square, rotation_error};
use crate::network::{Circles, Controls, InitialWeights, NetworkSpec};
use crate::phase::Section;

/// A fit of a network to pairs (z, P(z)): what is known of them, and how to train.
///
/// Options that are not given are found from the pairs or set to what is recommended, see [`Problem::notes`]: the
/// circle action, where the pairs determine it, a normal form, Levenberg–Marquardt from several initial weights until
/// it is at rest, a loss that weights each plane by its own motion, a tenth of the pairs held out.
///
/// ```
/// use gyroceptron::prelude::*;
///
/// let window = Window { low: vec![-1.0; 4], high: vec![1.0; 4], samples: 300 };
/// let pairs = Pairs::of_windows(&Oscillators { epsilon: 0.01 }, &[window], 0.5, 1)?;
/// let fit = Fit { epsilon: Some(0.01), flow_time: Some(0.5), ..Fit::default() };
/// let fitted = fit.with_iterations(20).run(pairs)?;
/// certify(fitted.model(), CertificateOptions { samples: 20, ..Default::default() }).assert_holds();
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// The name of the pairs in errors.
    pub place: String,
    /// The circle action of the limit ε = 0. None: it is found from the pairs, for two planes by
    /// short trainings ([`ActionTrial`]).
    pub action: Option<TorusAction>,
    /// The network that is trained. None: a normal form, with a ψ where the limit does not turn the planes.
    pub network: Option<NetworkSpec>,
    /// How the initial weights of the network are drawn.
    pub weights: InitialWeights,
    /// The ε that the network has as a parameter. None: the largest |ε| of the pairs, with its sign, or 0.01.
    pub epsilon: Option<f64>,
    /// The flow time of the network. None: the longest of the pairs, or how far the slow
    /// coordinates move over |ε|, or 1 where the twists are of order one.
    pub flow_time: Option<f64>,
    /// The initial angle of all circles, in radians. None: those of the rotation nearest to the
    /// pairs.
    pub theta: Option<f64>,
    /// The options of the training. A ramp takes its stages from pairs of several ε or flow times.
    /// To change one of what is recommended, write `TrainingOptions { iterations: 60, ..Fit::default().training }`:
    /// `TrainingOptions::default()` is the plain recipe of scenes.
    pub training: TrainingOptions,
    /// The names of the controls that the pairs depend on, and how the network depends on them.
    pub controls: ControlOptions,
    /// The charts of pairs whose columns are x₁ … xₙ, y₁ … yₙ with another area form than dq∧dp. None: the columns
    /// are q₁ … qₙ, p₁ … pₙ.
    pub section: Option<Section>,
    /// Whether to fit units in which the pairs are of order one and turn in circles.
    pub units: bool,
    /// The share of the pairs that is held out, at least 0 and less than 1.
    pub validation: f64,
    /// The seed of the weights and of the held-out choice.
    pub seed: u64,
}

impl Default for Fit {
    fn default() -> Self {
        let count = Self::STARTS;
        let training = TrainingOptions {
            loss: Loss::ByPlane { weights: None },
            optimiser: Optimiser::LevenbergMarquardt(LevenbergMarquardtOptions::default()),
            starts: Some(Starts { count, iterations: Starts::TRIAL }),
            plateau: Some(Plateau::default()),
            ..TrainingOptions::default()
        };
        Self {
            place: "pairs".into(),
            action: None,
            network: None,
            weights: Self::WEIGHTS,
            epsilon: None,
            flow_time: None,
            theta: None,
            training,
            controls: ControlOptions::default(),
            section: None,
            units: true,
            validation: Self::HELD_OUT,
            seed: 0,
        }
    }
}

/// Pairs, and which parameters of their maps are known.
#[derive(Clone, Debug)]
pub struct FamilyPairs {
    /// The pairs; those of several maps have the ε and the flow time of each.
    pub pairs: Pairs,
    /// Whether their conditions give ε.
    pub has_epsilons: bool,
    /// Whether their conditions give flow times.
    pub has_times: bool,
}

impl FamilyPairs {
    /// Pairs with the ε, the flow time and the control values of each, where these are given: see
    /// [`Pairs::under_controls`].
    ///
    /// # Errors
    /// Those of [`Pairs::under_controls`].
    pub fn new(
        pairs: Pairs,
        epsilons: Option<&[f64]>,
        times: Option<&[f64]>,
        controls: Option<&[f64]>,
    ) -> Result<Self, Error> {
        let (has_epsilons, has_times) = (epsilons.is_some(), times.is_some());
        if !(has_epsilons || has_times || controls.is_some()) {
            return Ok(pairs.into());
        }
        let ones = vec![1.0; pairs.len()];
        let (epsilons, times) = (epsilons.unwrap_or(&ones), times.unwrap_or(&ones));
        let pairs = pairs.under_controls(epsilons, times, controls.unwrap_or_default())?;
        Ok(Self { pairs, has_epsilons, has_times })
    }
}

impl From<Pairs> for FamilyPairs {
    fn from(pairs: Pairs) -> Self {
        // Where controls alone distinguish maps, an ε and a flow time of 1 say nothing.
        let says = |c: &Condition| c.controls.is_empty() || c.epsilon != 1.0 || c.time != 1.0;
        let known = pairs.conditions().iter().any(says);
        Self { pairs, has_epsilons: known, has_times: known }
    }
}

/// By how much the first and the last map of a family with controls keep no area, where that is seen in one of them.
fn form_defect_of_ends(pairs: &Pairs, known: f64) -> Option<FormDefect> {
    let runs = pairs.runs();
    let ends = [runs.first()?, runs.last()?];
    ends.into_iter().find_map(|(condition, input, output)| {
        condition.filter(|condition| !condition.controls.is_empty())?;
        let alone = Pairs::new("pairs", pairs.dof(), input.to_vec(), output.to_vec()).ok()?;
        FormDefect::measure(&alone).filter(|defect| defect.is_seen(known))
    })
}

/// Whether some pairs are at these values of controls.
fn is_learnt(pairs: &Pairs, values: &[f64]) -> bool {
    pairs.conditions().iter().any(|condition| condition.controls == values)
}

impl Fit {
    /// The distribution of the initial weights of a network.
    pub const WEIGHTS: InitialWeights = InitialWeights::Normal { scale: 0.15 };
    /// The share of the pairs that is held out.
    pub const HELD_OUT: f64 = 0.1;
    /// How many sets of initial weights are tried.
    pub const STARTS: u64 = 3;
    /// ε unless it is given, by the fit or by the pairs.
    pub const EPSILON: f64 = 0.01;
    /// If the nearest rotation leaves more than this share of the data, the planes are not those
    /// that turn, and a normal form needs a ψ.
    pub const TURNS: f64 = 0.5;

    /// The paper's recipe: its gyroceptron of the time-5 map, L-BFGS from one set of weights, a
    /// plain mean squared error.
    pub fn paper() -> Self {
        let network = NetworkSpec::named("gyroceptron").ok();
        Self { network, training: TrainingOptions::default(), ..Self::default() }
    }

    /// The same fit with at most this many iterations, and those of the starts where these are more.
    pub fn with_iterations(mut self, iterations: u64) -> Self {
        self.training.iterations = iterations;
        self
    }

    /// Fails if an option is wrong whatever the pairs are; it can be called before they are read.
    ///
    /// # Errors
    /// [`Error::Invalid`] and the like with the option.
    pub fn check(&self) -> Result<(), Error> {
        if !(0.0..1.0).contains(&self.validation) {
            let expected = "a share of at least 0 and less than 1";
            return Err(Error::invalid("validation", self.validation, expected));
        }
        for (name, value) in [("epsilon", self.epsilon), ("theta", self.theta)] {
            value.map_or(Ok(()), |value| Error::check_finite(name, value))?;
        }
        if let Some(time) = self.flow_time.filter(|time| !(time.is_finite() && *time > 0.0)) {
            return Err(Error::invalid("flow_time", time, "a positive number"));
        }
        self.training.check()?;
        if let Some(network) = &self.network {
            network.check()?;
        }
        match (&self.action, &self.network) {
            (Some(action), Some(network)) => self.check_network(network, action),
            (Some(action), None) => self.check_network(&Self::recommended(true)?, action),
            _ => Ok(()),
        }
    }

    /// Fails unless a network of these circles can be trained so, at any ε and flow time.
    fn check_network(&self, network: &NetworkSpec, action: &TorusAction) -> Result<(), Error> {
        let any = network.architecture(action, self.epsilon.unwrap_or(Self::EPSILON), 1.0)?;
        let none = "none: only a gyroceptron, which is built on a circle action, has it";
        for (name, value) in [("epsilon", self.epsilon), ("theta", self.theta)] {
            if let (Some(value), false) = (value, any.has_circle()) {
                return Err(Error::invalid(name, value, none));
            }
        }
        any.check()?;
        self.training.check_for(&any)?;
        self.training.loss.check(action.dof())
    }

    /// Fails if the network is wrong whatever circle action is found among so many planes, before it is looked for.
    fn check_on_planes(&self, dof: usize) -> Result<(), Error> {
        let (Some(network), None) = (&self.network, &self.action) else { return Ok(()) };
        let several = network.circles() == Circles::Several;
        let most = if several { dof.min(FastPlanes::MOST_CIRCLES) } else { 1 };
        let actions = [most, 1].map(|circles| TorusAction::of_first_planes(circles, dof));
        // With slow planes or without.
        let [of_most, of_one] = actions.map(|action| self.check_network(network, &action));
        of_most.or(of_one)
    }

    /// The network that is recommended.
    fn recommended(turns: bool) -> Result<NetworkSpec, Error> {
        let network = NetworkSpec::named("normal-form")?;
        let psi = crate::network::LayerSizes::uniform(10, 8);
        if turns { Ok(network) } else { network.with_size("psi", psi) }
    }

    /// The circle action of the pairs, as a training finds it, and the short trainings that chose it, if there were
    /// any. Asks `go_on` like [`Fit::prepare_observed`].
    ///
    /// # Errors
    /// Those of [`Fit::prepare_observed`] that concern the circle action and the section.
    pub fn find_action(
        &self,
        data: impl Into<FamilyPairs>,
        go_on: &mut dyn FnMut() -> Result<Control, Error>,
    ) -> Result<(TorusAction, Option<ActionTrial>), Error> {
        let (mut data, mut notes) = (data.into(), Vec::new());
        data.pairs = self.charted(data.pairs)?;
        data.pairs.check_squares(&self.place)?;
        let action = self.circles(&data, &mut notes, go_on)?;
        let trial = notes.into_iter().find_map(|note| match note {
            FitNote::Action(trial) => Some(trial),
            _ => None,
        });
        Ok((action, trial))
    }

    /// The circles of pairs in canonical coordinates.
    fn circles(
        &self,
        data: &FamilyPairs,
        notes: &mut Vec<FitNote>,
        go_on: &mut GoOn<'_>,
    ) -> Result<TorusAction, Error> {
        let pairs = &data.pairs;
        if let Some(action) = &self.action {
            super::prepare::check_planes(&self.place, action, pairs)?;
            return Ok(action.clone());
        }
        let by_rotation = ActionFit::fit(pairs)?;
        let circles = self.network.as_ref().map_or(Circles::Several, NetworkSpec::circles);
        let actions = match circles {
            // The map does not depend on the action, which serves for units and to compare errors
            // with.
            Circles::None => return Ok(by_rotation.action().clone().into()),
            of => ActionTrial::candidates(&by_rotation, of == Circles::Several),
        };
        let trial = self.tried(data, by_rotation, actions, go_on)?;
        if let Some(action) = trial.chosen() {
            notes.push(FitNote::Action(trial));
            return Ok(action);
        }
        let (reordered, order) = Reading::interleaved(pairs);
        if let Ok(by_rotation) = ActionFit::fit(&reordered) {
            let actions = ActionTrial::candidates(&by_rotation, circles == Circles::Several);
            let reordered = FamilyPairs { pairs: reordered, ..*data };
            let other = self.tried(&reordered, by_rotation, actions, go_on)?;
            let fits_better = !trial.errs_as_little_as(&other);
            if let Some(action) = other.chosen().filter(|_| fits_better) {
                let found = format!(
                    "columns that have circle action {action} as q1 p1 q2 p2 …, and none for sure as they \
                     are: take the columns {order:?} of input and output, counted from 0"
                );
                return Err(Error::NoCircleAction { found, columns: Some(order) });
            }
        }
        let few = if pairs.len() < ActionTrial::FEWEST {
            format!(" of fewer than {} pairs", ActionTrial::FEWEST)
        } else {
            String::new()
        };
        let found = format!("none for sure{few}: {}", trial.describe());
        Err(Error::NoCircleAction { found, columns: None })
    }

    /// Short trainings of the recommended network with each of some actions.
    fn tried(
        &self,
        data: &FamilyPairs,
        by_rotation: ActionFit,
        actions: Vec<TorusAction>,
        go_on: &mut GoOn<'_>,
    ) -> Result<ActionTrial, Error> {
        let recommended = Self::default();
        ActionTrial::run(by_rotation, actions, data.pairs.len(), |action| {
            let training = TrainingOptions {
                starts: None,
                plateau: None,
                iterations: ActionTrial::ITERATIONS,
                ..recommended.training.clone()
            };
            let fit = Self {
                place: self.place.clone(),
                // A normal form of ε = 0 has no flow time, and moves no slow plane.
                epsilon: self.epsilon.filter(|epsilon| *epsilon != 0.0),
                flow_time: self.flow_time,
                theta: self.theta,
                training,
                controls: self.controls.clone(),
                validation: ActionTrial::HELD_OUT,
                seed: self.seed,
                ..recommended.clone()
            };
            let pairs = FamilyPairs { pairs: data.pairs.thinned(ActionTrial::PAIRS), ..*data };
            let problem = fit.with_circles(pairs, action.clone(), None, Vec::new())?;
            // What it ended with, before its end.
            let mut ended = None;
            let mut trying = |_: TrainingStage, _: Progress<'_>| {
                if ended.is_none() {
                    ended = match go_on() {
                        Ok(Control::Continue) => return Ok(Control::Continue),
                        Ok(_) => {
                            Some(Error::Stopped { what: "the circle action of the pairs".into() })
                        }
                        Err(error) => Some(error),
                    };
                }
                Ok(Control::Interrupt)
            };
            let fitted = match (problem.train(&mut trying), ended) {
                (_, Some(ended)) => return Err(ended),
                // An action that nothing can be trained with is not that of the pairs.
                (Err(Error::Diverged { .. }), None) => return Ok(f64::NAN),
                (fitted, None) => fitted?,
            };
            let held_out = fitted.problem.held_out.as_ref();
            let error = |held_out| ActionTrial::error(fitted.model().composition(), held_out);
            match held_out.map_or(Ok(f64::NAN), error) {
                Err(Error::Diverged { .. }) => Ok(f64::NAN),
                error => error,
            }
        })
    }

    /// Another reading of the pairs than that of this action, where it is far better.
    fn better_reading(
        &self,
        data: &FamilyPairs,
        action: &TorusAction,
        go_on: &mut GoOn<'_>,
    ) -> Result<Option<Reading>, Error> {
        let Some(reading) = Reading::better(&data.pairs, action) else { return Ok(None) };
        if reading.reorders {
            return Ok(Some(reading));
        }
        if self.action.is_none() {
            return Ok(None);
        }
        // The nearest rotation does not see whole turns; a training does.
        let other: TorusAction = CircleAction::new(reading.weights.clone()).into();
        let both = vec![action.clone(), other.clone()];
        let Ok(by_rotation) = ActionFit::fit(&data.pairs) else { return Ok(None) };
        let trial = self.tried(data, by_rotation, both, go_on)?;
        Ok((trial.chosen() == Some(other)).then_some(reading))
    }

    /// Prepares a training: the pairs in the coordinates of the network, the network, and its
    /// initial values.
    ///
    /// # Errors
    /// Those of [`Fit::check`] and [`Preparation::prepare`]; when the circle action is to be found
    /// and the pairs do not determine it; when pairs of several maps are given for a network that
    /// is no gyroceptron, or a stage of the ramp has no pairs.
    pub fn prepare(&self, data: impl Into<FamilyPairs>) -> Result<Problem, Error> {
        self.prepare_observed(data, &mut || Ok(Control::Continue))
    }

    /// Like [`Fit::prepare`], but asks `go_on` at each iteration of the trainings that find a circle action whether
    /// to continue.
    ///
    /// # Errors
    /// Those of [`Fit::prepare`] and of `go_on`; [`Error::Stopped`] if `go_on` asks to stop.
    pub fn prepare_observed(
        &self,
        data: impl Into<FamilyPairs>,
        go_on: &mut dyn FnMut() -> Result<Control, Error>,
    ) -> Result<Problem, Error> {
        self.check()?;
        let mut data = data.into();
        let mut notes = Vec::new();
        let digest = data.pairs.digest();
        let given = data.pairs.region();
        data.pairs = self.charted(data.pairs)?;
        notes.extend(self.section.clone().map(FitNote::Section));
        self.check_on_planes(data.pairs.dof())?;
        let (action, fits) = self.examine(&data, &mut notes, go_on)?;
        let problem = self.with_circles(data, action, fits.as_ref(), notes)?;
        let region = if self.section.is_some() { given } else { problem.region };
        Ok(Problem { region, digest, ..problem })
    }

    /// What is to be said of pairs for each of these networks, all of which could be trained on them: of the section
    /// and the area form, of the order of columns and the circle action, of reversors. Asks `go_on` like
    /// [`Fit::prepare_observed`].
    ///
    /// # Errors
    /// Those of [`Fit::prepare_observed`] that concern the circle action and the section; those of
    /// [`NetworkSpec::architecture`].
    pub fn notes_on(
        &self,
        data: impl Into<FamilyPairs>,
        networks: &[&NetworkSpec],
        go_on: &mut dyn FnMut() -> Result<Control, Error>,
    ) -> Result<Vec<FitNote>, Error> {
        let (mut data, mut notes) = (data.into(), Vec::new());
        data.pairs = self.charted(data.pairs)?;
        notes.extend(self.section.clone().map(FitNote::Section));
        let pairs = &data.pairs;
        let (action, fits) = self.examine(&data, &mut notes, go_on)?;
        let epsilon = Family::new(self, &data).epsilon;
        let mut reversals: Vec<ReversalDefect> = Vec::new();
        let mut keep_areas = networks.is_empty();
        for network in networks {
            let any = network.architecture(&action, epsilon, 1.0)?;
            keep_areas |= any.is_symplectic();
            let of = |fits: &TwoFits| ReversalDefect::worth_saying(pairs, fits, &any);
            reversals.extend(fits.as_ref().and_then(of).filter(|one| !reversals.contains(one)));
        }
        notes.retain(|note| keep_areas || !matches!(note, FitNote::Form(..)));
        notes.extend(reversals.into_iter().map(FitNote::Reversal));
        Ok(notes)
    }

    /// The circles of pairs in canonical coordinates, and two polynomial fits to them where there are enough.
    fn examine(
        &self,
        data: &FamilyPairs,
        notes: &mut Vec<FitNote>,
        go_on: &mut GoOn<'_>,
    ) -> Result<(TorusAction, Option<TwoFits>), Error> {
        data.pairs.check_squares(&self.place)?;
        let known = self.section.as_ref().map_or(0.0, Section::error);
        let fits = TwoFits::fit(&data.pairs);
        let defect = match &fits {
            Some(fits) => {
                Some(fits.form_defect(&data.pairs)).filter(|defect| defect.is_seen(known))
            }
            None => form_defect_of_ends(&data.pairs, known),
        };
        notes.extend(defect.map(|defect| FitNote::Form(defect, self.section.is_some())));
        let action = self.circles(data, notes, go_on)?;
        notes.extend(self.better_reading(data, &action, go_on)?.map(FitNote::Reading));
        Ok((action, fits))
    }

    /// The problem of pairs in canonical coordinates whose circles are known; its region is that of these pairs, and
    /// it has no digest.
    fn with_circles(
        &self,
        data: FamilyPairs,
        action: TorusAction,
        fits: Option<&TwoFits>,
        mut notes: Vec<FitNote>,
    ) -> Result<Problem, Error> {
        let family = Family::new(self, &data);
        let epsilon = family.epsilon;
        let pairs = data.pairs.with_conditions(|condition| family.place(condition));
        notes.extend(FitNote::of_negative_epsilons(&pairs, epsilon));
        let network = match &self.network {
            Some(network) => network.clone(),
            None => self.choose(&pairs, &action, &mut notes)?,
        };
        self.check_network(&network, &action)?;
        let any = network.architecture(&action, epsilon, 1.0)?;
        // What keeps no area itself may follow pairs that keep none.
        notes.retain(|note| any.is_symplectic() || !matches!(note, FitNote::Form(..)));
        let reversal = fits.and_then(|fits| ReversalDefect::worth_saying(&pairs, fits, &any));
        notes.extend(reversal.map(FitNote::Reversal));
        if (data.has_epsilons || data.has_times) && !any.has_circle() {
            let found = format!("epsilon or flow_time in {}", self.place);
            return Err(Error::invalid("architecture", found, "a gyroceptron to learn a family"));
        }
        if let (Some(time), false) = (self.flow_time, any.has_flow_time() || data.has_times) {
            let expected = "none: the network has none, and neither have the pairs";
            // A gyroceptron keeps it as what its map stands for.
            if !any.has_circle() {
                return Err(Error::invalid("flow_time", time, expected));
            }
        }
        let of_order_one = any.is_of_order_one();
        if any.has_flow_time() && !of_order_one && epsilon == 0.0 && family.time.is_none() {
            return Err(Error::invalid("epsilon", 0, "another number, or a flow_time"));
        }
        let preparation = Preparation {
            place: &self.place,
            action: &action,
            epsilon,
            flow_time: family.time,
            of_order_one,
            theta: self.theta,
            units: self.units,
            reversors: any.reversor.as_slice(),
            validation: self.validation,
            seed: self.seed,
        };
        let prepared = preparation.prepare(pairs)?;
        notes.extend(prepared.units.clone().map(FitNote::Units));
        let pairs = &prepared.pairs;
        let controls = self.controls.of_pairs(pairs).map_err(|e| e.with_place(&self.place))?;
        if let Some(controls) = &controls {
            let of = prepared.held_out.as_ref().map_or(&[][..], Pairs::conditions);
            let mut held_out: Vec<&[f64]> = of.iter().map(|one| &*one.controls).collect();
            held_out.retain(|values| !is_learnt(pairs, values));
            held_out.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
            held_out.dedup();
            let held_out = held_out.len();
            notes.push(FitNote::Controls(controls.clone(), held_out));
        }
        // A model is asked in the middle of the ranges where no values are given.
        let section = match (&self.section, &controls) {
            (Some(section), Some(controls)) => Some(section.with_origin(&controls.nominal())?),
            _ => self.section.clone(),
        };
        let known = Self {
            epsilon: Some(epsilon),
            action: Some(action),
            network: Some(network),
            section,
            ..self.clone()
        };
        let (own, held_out) = ((epsilon, prepared.flow_time), prepared.held_out.as_ref());
        let ramp = self.training.ramp.iter();
        let stages = ramp
            .map(|stage| StagePairs::among(stage, own, &prepared.pairs, held_out))
            .collect::<Result<_, _>>()?;
        let problem = known.of_prepared(prepared, controls, stages)?;
        Ok(Problem { flow_time: family.time, notes, ..problem })
    }

    /// The training of pairs in the coordinates of the network, of which all that a fit may find is known: the circle
    /// action, the network and ε of the fit are given, `prepared` has the flow time, the initial angles, the units and
    /// the held-out pairs, `stages` has the pairs of each stage of the ramp, and `controls` what the parameters of the
    /// network depend on. What the fit itself says of these is not looked at. The problem has no digest and no notes.
    ///
    /// # Errors
    /// [`Error::Missing`] without a circle action, a network or an ε; those of [`NetworkSpec::architecture`],
    /// [`Architecture::check`](crate::network::Architecture::check) and [`TrainingOptions::check_for`]; when there
    /// are fewer or more `stages` than the ramp has.
    pub fn of_prepared(
        &self,
        prepared: Prepared,
        controls: Option<Controls>,
        stages: Vec<StagePairs>,
    ) -> Result<Problem, Error> {
        let missing = |key| {
            let place = format!("the fit of {}", self.place);
            Error::Missing { place, key, needed_by: "pairs that are prepared".into() }
        };
        let action = self.action.clone().ok_or_else(|| missing("action"))?;
        let network = self.network.clone().ok_or_else(|| missing("network"))?;
        let epsilon = self.epsilon.ok_or_else(|| missing("epsilon"))?;
        let Prepared { pairs, held_out, units, region, nearest, angles, flow_time: time } =
            prepared;
        let loss = self.training.loss.for_pairs(&action, &nearest, &pairs)?;
        let training = TrainingOptions { loss, ..self.training.clone() };
        let architecture = network
            .architecture(&action, epsilon, time)?
            .in_box_of(pairs.points())
            .with_controls(controls);
        architecture.check()?;
        training.check_for(&architecture)?;
        Error::check_count("stages of the ramp", training.ramp.len(), stages.len())?;
        Ok(Problem {
            network,
            architecture,
            weights: self.weights,
            training,
            action,
            nearest,
            angles,
            pairs,
            held_out,
            units,
            section: self.section.clone(),
            region,
            flow_time: Some(time),
            digest: String::new(),
            seed: self.seed,
            notes: Vec::new(),
            epsilon,
            stages,
            from: None,
        })
    }

    /// The pairs of one or several maps with the ε of each and its flow time over that of the network: the ε and the
    /// flow time of the fit are the network's, or the largest among the pairs where the fit has none.
    pub fn placed(&self, data: FamilyPairs) -> Pairs {
        let family = Family::new(self, &data);
        data.pairs.with_conditions(|condition| family.place(condition))
    }

    /// The pairs in the canonical coordinates of the section; as they are, where there is none.
    ///
    /// # Errors
    /// When the section is of other planes than the pairs, a point is not within its chart, or it has no density at the
    /// controls of some pairs.
    pub fn charted(&self, pairs: Pairs) -> Result<Pairs, Error> {
        let Some(section) = &self.section else { return Ok(pairs) };
        section.check(pairs.dof()).map_err(|e| e.with_place(&self.place))?;
        for (name, points) in ["input", "output"].into_iter().zip(pairs.points()) {
            section.check_points(&format!("{}: {name}", self.place), points)?;
        }
        let depends = section.depends_on_controls();
        pairs.transformed(&self.place, |condition, points| {
            if !depends {
                section.to_canonical(points);
                return Ok(());
            }
            let values = condition.map_or(&[][..], |condition| &condition.controls);
            let there = section.at_controls(values).and_then(|there| {
                there.check(pairs.dof())?;
                Ok(there)
            });
            there
                .map_err(|e| e.with_place(format!("section at controls {values:?}")))?
                .to_canonical(points);
            Ok(())
        })
    }

    /// The recommended network for these pairs, and why.
    fn choose(
        &self,
        pairs: &Pairs,
        action: &TorusAction,
        notes: &mut Vec<FitNote>,
    ) -> Result<NetworkSpec, Error> {
        let units = super::fit_units(pairs, action);
        let scaled = units.and_then(|units| pairs.to_network(&self.place, &units).ok());
        let pairs = scaled.as_ref().unwrap_or(pairs);
        let angles = super::fit_rotations(pairs, action);
        let left = rotation_error(action, &angles, pairs).sqrt() / root_mean_square(pairs.output());
        let turns = left < Self::TURNS;
        let psi = if turns { "without ψ" } else { "with a ψ" };
        let trials = match self.training.starts {
            Some(Starts { count, .. }) => format!("the best of {count} initial weights"),
            None => "one set of initial weights".into(),
        };
        notes.push(FitNote::Recommended(format!(
            "a normal form {psi}, since the rotation by {action} leaves {:.1} % of the data; {}, {trials}",
            100.0 * left,
            self.training.optimiser.name(),
        )));
        let mut network = Self::recommended(turns)?;
        network.action = Some(action.clone());
        Ok(network)
    }

    /// Fits the network to the pairs.
    ///
    /// # Errors
    /// Those of [`Fit::prepare`] and [`Problem::train`].
    pub fn run(&self, data: impl Into<FamilyPairs>) -> Result<Fitted, Error> {
        self.run_observed(data, &mut |_: TrainingStage, _: Progress<'_>| Ok(Control::Continue))
    }

    /// [`Fit::run`] with an observer, which may keep checkpoints, resume from one, or stop the
    /// training: a function of the stage and its progress, or `io::Checkpoints`, which keep it in files.
    ///
    /// # Errors
    /// Those of [`Fit::run`] and of the observer.
    pub fn run_observed(
        &self,
        data: impl Into<FamilyPairs>,
        observer: &mut dyn TrainingObserver,
    ) -> Result<Fitted, Error> {
        self.prepare(data)?.train(observer)
    }
}

/// Says whether to go on.
type GoOn<'a> = dyn FnMut() -> Result<Control, Error> + 'a;

/// The ε and the flow time of the network, among those of the maps that the pairs are of.
struct Family {
    epsilon: f64,
    /// Its flow time, where that is known.
    time: Option<f64>,
    has_epsilons: bool,
    has_times: bool,
}

impl Family {
    fn new(fit: &Fit, data: &FamilyPairs) -> Self {
        let &FamilyPairs { has_epsilons, has_times, ref pairs } = data;
        // Of both signs, the positive one.
        let order = |a: &f64, b: &f64| a.abs().total_cmp(&b.abs()).then(a.total_cmp(b));
        let largest = |of: fn(&Condition) -> f64| pairs.conditions().iter().map(of).max_by(order);
        let epsilon = largest(|condition| condition.epsilon).filter(|_| has_epsilons);
        let time = largest(|condition| condition.time).filter(|_| has_times);
        Self {
            epsilon: fit.epsilon.or(epsilon).unwrap_or(Fit::EPSILON),
            time: fit.flow_time.or(time),
            has_epsilons,
            has_times,
        }
    }

    /// ε of a condition and its time over the network's.
    fn place(&self, condition: &Condition) -> (f64, f64) {
        let epsilon = if self.has_epsilons { condition.epsilon } else { self.epsilon };
        let time = match self.time {
            Some(own) if self.has_times => condition.time / own,
            _ => 1.0,
        };
        (epsilon, time)
    }
}
