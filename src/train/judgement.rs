//! The judgement of a training: whether to trust the network, and what limits it.

use super::{Outcome, Stop, TrainingRecord};
use crate::error::Error;
use crate::flow::{Pairs, Region};
use crate::layer::TorusAction;
use crate::measure::{
    adiabatic::{OwnInvariance, PlaneSwing},
    trajectories::{
        PlaneMotion, component_errors, plane_motions, root_mean_square, rotation_errors,
    },
};
use crate::network::Rollout;
use crate::words::{factor, magnitude, percent, plane_name};
use std::collections::BTreeSet;
use std::fmt::{Display, Formatter};

/// The largest number of orbits that are followed, from held-out points.
const ORBITS: usize = OwnInvariance::ORBITS;
/// Applications of the network in each orbit.
pub const STEPS: usize = OwnInvariance::ITERATIONS;

/// What limits the error of a training.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// The held-out error is far above the loss.
    Data,
    /// The loss was still falling, or there were fewer than [`Limit::FEW_ITERATIONS`].
    Iterations,
    /// Neither pairs nor iterations: the network, or the point where its optimiser came to rest.
    Network,
    /// The loss is at rest, and without held-out pairs nothing says whether more pairs or another network would help.
    Unknown,
    /// The network keeps areas, and the pairs do not, by about as much as it errs.
    Areas,
}

/// The ratio of the final loss to that after nine tenths of the iterations above which the loss is
/// at rest.
const AT_REST: f64 = 0.9;
/// The ratio of the held-out error to the loss above which pairs are learnt by heart.
const BY_HEART: f64 = 2.0;

/// A plane whose error exceeds this share of what the rotation leaves of it is not learnt.
const LEARNT: f64 = 0.5;

/// What is so small a share needs no care: a held-out error of the motion, however far above the loss it is, and what
/// areas change by.
const LITTLE: f64 = 0.01;

/// What limits a training, from its losses on training and held-out pairs.
pub fn limit(loss: f64, validation: Option<f64>, history: &[TrainingRecord]) -> Limit {
    let Some(last) = history.last() else { return at_rest(validation) };
    let earlier = history.iter().rev().find(|r| r.iteration * 10 <= last.iteration * 9);
    if validation.is_some_and(|validation| validation > BY_HEART * loss) {
        return Limit::Data;
    }
    match earlier {
        Some(earlier) if last.loss < AT_REST * earlier.loss => Limit::Iterations,
        _ => at_rest(validation),
    }
}

/// How many held-out pairs have an input, bit for bit, that a training pair of the same map has.
pub(super) fn repeated_inputs(training: &Pairs, held_out: &Pairs) -> usize {
    let inputs = |pairs: &Pairs| -> Vec<Vec<u64>> {
        let rows = pairs.runs().into_iter().flat_map(|(condition, input, _)| {
            let of = condition.map(|c| [&[c.epsilon, c.time], &c.controls[..]].concat());
            let of = of.unwrap_or_default();
            let row =
                move |z: &[f64]| [z, &of[..]].concat().into_iter().map(f64::to_bits).collect();
            input.chunks_exact(2 * pairs.dof()).map(row).collect::<Vec<_>>()
        });
        rows.collect()
    };
    let known: BTreeSet<Vec<u64>> = inputs(training).into_iter().collect();
    inputs(held_out).iter().filter(|row| known.contains(*row)).count()
}

/// The share of the images of pairs that are outside the box of their inputs.
fn share_beyond_inputs(pairs: &Pairs) -> f64 {
    let dim = 2 * pairs.dof();
    let Some(inputs) = Region::around(dim, [pairs.input()]) else { return 0.0 };
    let around = inputs.with_margin();
    let rows = pairs.output().chunks_exact(dim);
    let outside = rows.filter(|z| around.first_outside(z).is_some()).count();
    outside as f64 / pairs.len() as f64
}

/// What limits a training that is at rest.
fn at_rest(validation: Option<f64>) -> Limit {
    if validation.is_some() { Limit::Network } else { Limit::Unknown }
}

impl Limit {
    /// Fewer iterations do not show whether a loss is at rest.
    pub const FEW_ITERATIONS: u64 = 50;

    /// What limits the training in words.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Data => {
                "the data: the held-out error is far above the loss; more pairs (where there are controls, of more \
                 values), or a smaller network"
            }
            Self::Iterations => {
                "the iterations: the loss was still falling, or there were too few to say"
            }
            Self::Network => {
                "the network or its optimiser: the loss is at rest, and held-out pairs fit as well; \
                 a wider network, the best of several starts, Levenberg–Marquardt where the optimiser is another"
            }
            Self::Unknown => {
                "nothing says it: the loss is at rest, and no pairs were held out to tell the network from the data"
            }
            Self::Areas => {
                "the pairs: they change areas, by about as much as the network errs, which keeps areas whatever its \
                 weights; a coupling gyroceptron does not"
            }
        }
    }
}

/// Orbits of a network from some points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Orbits {
    /// The number of orbits that were followed.
    pub count: usize,
    /// The number of orbits that leave the box by more than half of its width, or whose points are
    /// no longer finite.
    pub astray: usize,
    /// The first orbit to do so: its row and the step.
    pub first: Option<(usize, usize)>,
}

impl Orbits {
    /// Whether so many orbits leave the box that a map is not for long orbits: one in four, or more.
    ///
    /// By `gyroceptron run noise` 3 to 8 of 16 do, where trajectories go to places without pairs and are lost, and 0 to
    /// 2 where all have pairs.
    pub fn leave_often(&self) -> bool {
        are_often(self.astray, self.count)
    }
}

/// Whether a quarter of all, or more, are among these.
fn are_often(part: usize, all: usize) -> bool {
    4 * part >= all
}

/// Counts the orbits that leave the box. `states` holds the first points of all `count` orbits, then the second ones,
/// and so on.
pub fn orbits(states: &[f64], count: usize, region: &Region) -> Orbits {
    let around = region.widened(0.5);
    let mut lost = vec![false; count];
    let mut first = None;
    for (index, z) in states.chunks_exact(states.len() / count / (STEPS + 1)).enumerate() {
        if around.first_outside(z).is_some() {
            lost[index % count] = true;
            first = first.or(Some((index % count, index / count)));
        }
    }
    Orbits { count, astray: lost.iter().filter(|lost| **lost).count(), first }
}

/// The error of a plane, and its ratio to the motion in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneError {
    /// Its root mean square over q and p.
    pub error: f64,
    /// The error over what the nearest rotation leaves of the plane, or over the size of the plane
    /// where the rotation explains it.
    pub share: f64,
    /// Whether the rotation explains the plane to rounding.
    pub explained: bool,
}

/// The errors of the planes of a model, from those of its components.
pub fn plane_errors(errors: &[f64], motions: &[PlaneMotion]) -> Vec<PlaneError> {
    let dof = motions.len();
    let of_plane = |(j, motion): (usize, &PlaneMotion)| {
        let error = root_mean_square(&[errors[j], errors[dof + j]]);
        PlaneError { error, share: error / motion.scale, explained: motion.explained }
    };
    motions.iter().enumerate().map(of_plane).collect()
}

/// The root mean square of the images of each plane about their mean, over q and p.
fn plane_sizes(pairs: &Pairs) -> Vec<f64> {
    let (dof, count) = (pairs.dof(), pairs.len() as f64);
    let size = |k: usize| {
        let column = || pairs.output().iter().skip(k).step_by(2 * dof);
        let mean = column().sum::<f64>() / count;
        libm::sqrt(column().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count)
    };
    (0..dof).map(|j| root_mean_square(&[size(j), size(dof + j)])).collect()
}

/// The plane that decides, from 0: the first with the largest share; a NaN counts as larger than
/// any number.
pub fn worst(planes: &[PlaneError]) -> usize {
    let share = |j: usize| planes[j].share;
    (1..planes.len()).fold(0, |worst, j| {
        let larger = !(share(j) <= share(worst));
        if larger && !share(worst).is_nan() { j } else { worst }
    })
}

/// How far pairs are from those of a map that keeps areas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AreaDefect {
    /// The share by which one step changes them.
    Pairs(f64),
    /// The share by which one step changes those of a section, whose density may be another one.
    OfSection(f64),
    /// The relative error of the density of their section.
    Density(f64),
}

/// The verdict that follows from reasons against a plain yes.
fn verdict(no: &[String], long: &[String], care: &[String]) -> &'static str {
    match (no.is_empty(), long.is_empty(), care.is_empty()) {
        (true, true, true) => "yes, among the inputs of the pairs",
        (true, true, false) => "with care, among the inputs of the pairs",
        (true, false, _) => "for single steps among the inputs of the pairs, not for long orbits",
        (false, ..) => "no",
    }
}

/// The judgement of a training by pairs that are held out, plane by plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// Yes or no, and within which limits.
    pub verdict: &'static str,
    /// The statement that too few pairs are held out for a verdict, or too few that do not repeat
    /// the training, where that is so; it is the first of [`Judgement::no`].
    pub too_few: Option<String>,
    /// The error of the plane that decides, in words.
    pub error: String,
    /// How many held-out pairs have the input of a training pair.
    pub repeated: usize,
    /// The reasons not to trust the network at all.
    pub no: Vec<String>,
    /// The reasons not to trust it along long orbits.
    pub no_long_orbits: Vec<String>,
    /// The reasons to use it with care.
    pub care: Vec<String>,
    /// How many of the reasons for care lie in the pairs, so that no other training helps.
    pub care_of_pairs: usize,
    /// The number of held-out pairs; None where the errors are those of the training pairs.
    pub held_out: Option<usize>,
    /// The error of each plane.
    pub planes: Vec<PlaneError>,
    /// The plane that decides, from 0.
    pub worst: usize,
    /// The root mean square error of all planes over that of the nearest rotation.
    pub share_beyond_rotation: f64,
    /// What limits the error of the model.
    pub limit: Limit,
    /// The orbits that leave the box of the pairs; None if there are no pairs.
    pub orbits: Option<Orbits>,
    /// How far the action of each plane swings; empty where the pairs are of several maps.
    pub swings: Vec<PlaneSwing>,
    /// How well the network conserves its own invariant along its orbits.
    pub own: Option<OwnInvariance>,
    /// The root mean square of the images of each plane about their mean, over q and p.
    pub sizes: Vec<f64>,
}

/// The verdict, the error, and a line for each reason.
impl Display for Judgement {
    fn fmt(&self, out: &mut Formatter<'_>) -> std::fmt::Result {
        write!(out, "{}: {}", self.verdict, self.error)?;
        self.reasons().try_for_each(|reason| write!(out, "\n- {reason}"))
    }
}

/// Whether to trust a network that was trained on pairs, and why not.
#[derive(Clone, Debug, PartialEq)]
pub struct Trust {
    /// The verdict in words, yes or no, and within which limits.
    pub verdict: String,
    /// The error of the plane that decides, in one step.
    pub error: String,
    /// The reasons against it; empty for a plain yes.
    pub reasons: Vec<String>,
}

impl Judgement {
    /// The fewest held-out pairs for a verdict. With a probability of 95 % the largest error of so many pairs exceeds
    /// that of nine tenths of all points: 0.9³⁰ = 4 % is less than a twentieth.
    ///
    /// Source: Wilks' tolerance limits, <https://doi.org/10.1214/aoms/1177731788>.
    pub const FEWEST: usize = 30;

    /// Judges the outcome of a training on these pairs; `action` and `angles` are the rotation
    /// nearest to the pairs.
    ///
    /// It follows 16 orbits of 1000 steps, from held-out points.
    ///
    /// # Errors
    /// Those of [`Model::rollout`](crate::network::Model::rollout) along these orbits.
    pub fn new(
        outcome: &Outcome,
        pairs: &Pairs,
        held_out: Option<&Pairs>,
        (action, angles): (&TorusAction, &[f64]),
    ) -> Result<Self, Error> {
        let judge = held_out.unwrap_or(pairs);
        let (dof, dim) = (pairs.dof(), 2 * pairs.dof());
        let errors = component_errors(outcome.model.composition(), judge)?;
        let planes = plane_errors(&errors, &plane_motions(action, angles, judge));
        let worst = worst(&planes);
        let share = planes[worst].share;
        let left = rotation_errors(action, angles, judge);
        let pooled = root_mean_square(&errors) / (left.iter().sum::<f64>() / dim as f64).sqrt();
        // Orbits are of one machine: the first that judges.
        let first = judge.conditions().first().filter(|first| !first.controls.is_empty());
        let at_first = first.map(|first| outcome.model.at_controls(&first.controls)).transpose()?;
        let model = at_first.as_ref().unwrap_or(&outcome.model);
        let most = first.map_or(judge.len(), |first| first.pairs).min(ORBITS);
        let starts = &judge.input()[..dim * most];
        let both: Vec<&Pairs> = [Some(pairs), held_out].into_iter().flatten().collect();
        let region =
            Region::around(dim, both.iter().flat_map(|pairs| [pairs.input(), pairs.output()]));
        let count = starts.len() / dim;
        let states = model.rollout(starts, Rollout { steps: STEPS, every: 1 })?;
        let orbits = region.as_ref().map(|region| orbits(&states, count, region));
        // Pairs of several maps do not show what one of them does to an action.
        let swings = match pairs.conditions() {
            [] => PlaneSwing::measure(&both, action, angles, &states, count),
            _ => Vec::new(),
        };
        let own = OwnInvariance::measure(model, starts, STEPS);
        let validation = outcome.best.validation;
        let few = outcome.history.last().is_some_and(|last| last.iteration < Limit::FEW_ITERATIONS);
        let limit = match limit(outcome.loss, validation, &outcome.history) {
            // It was ended because it was at rest.
            Limit::Iterations if outcome.stop == Stop::Plateau => at_rest(validation),
            Limit::Network | Limit::Unknown if few && outcome.stop == Stop::Iterations => {
                Limit::Iterations
            }
            limit => limit,
        };

        let (mut no, mut long, mut care) = (Vec::new(), Vec::new(), Vec::new());
        let mut of_pairs = Vec::new();
        let mut first = None;
        let repeated = held_out.map_or(0, |held_out| repeated_inputs(pairs, held_out));
        match held_out.map(Pairs::len) {
            None => {
                first = Some(
                    "nothing was held out: the errors are those of the pairs it was trained on"
                        .into(),
                );
            }
            Some(held) if held < Self::FEWEST => {
                let pairs = if held == 1 { "pair was" } else { "pairs were" };
                first = Some(format!(
                    "only {held} {pairs} held out: a verdict takes {}, of which the worst bounds nine tenths \
                     of all errors (at 95 %)",
                    Self::FEWEST
                ));
            }
            Some(held) if held - repeated < Self::FEWEST => {
                first = Some(format!(
                    "only {} of {held} held-out pairs have inputs that no training pair has: a verdict takes {}",
                    held - repeated,
                    Self::FEWEST
                ));
            }
            Some(held) if 2 * repeated >= held => of_pairs.push(format!(
                "{repeated} of {held} held-out pairs have the input of a training pair: their errors say little"
            )),
            _ => {}
        }
        no.extend(first.clone());
        let of = match planes[worst].explained {
            true => "of its size, the rotation explains it to rounding",
            false => "of what the nearest rotation leaves of it",
        };
        let share_text = match dof {
            1 => format!("it errs by {} {of}", percent(share)),
            _ => format!("{} decides: it errs by {} {of}", plane_name(worst), percent(share)),
        };
        if !(share < LEARNT) {
            no.push("little is learnt".to_owned());
        } else if share > 0.05 {
            care.push(share_text.clone());
        }
        if let Some(left @ Orbits { count, astray, first: Some((row, step)) }) = orbits {
            // They may follow the true flow, which is not known outside the box; single steps
            // inside are not affected.
            let of = if left.leave_often() { &mut long } else { &mut care };
            let whose = if held_out.is_some() { "held-out" } else { "training" };
            of.push(format!(
                "{astray} of {count} orbits of {STEPS} steps leave the box of the pairs by more \
                 than half its width, the first, from {whose} point {row}, after {step} steps"
            ));
        }
        for (j, swing) in swings.iter().enumerate() {
            let name = plane_name(j);
            if swing.beyond > 0 {
                let of = if are_often(swing.beyond, count) { &mut long } else { &mut care };
                of.push(format!(
                    "the action of {name} swings further than in all pairs along {} of {count} \
                     orbits of {STEPS} steps",
                    swing.beyond
                ));
            } else if swing.is_too_wide() {
                care.push(format!(
                    "the action of {name} swings by {} along its orbits (median), {} what a step \
                     of the pairs changes it by",
                    magnitude(swing.swing),
                    factor(swing.steps())
                ));
            }
        }
        if held_out.is_some() && limit == Limit::Data && !(share <= LITTLE) {
            let validation = outcome.best.validation.unwrap_or(f64::NAN);
            let ratio = factor(validation / outcome.loss);
            care.push(format!("the held-out error is {ratio} the loss"));
        }
        let beyond = share_beyond_inputs(pairs);
        if beyond >= 0.5 {
            of_pairs.push(format!(
                "{} of the images are outside the box of the inputs, where no pair says what the map does: \
                 orbits that go there are guessed",
                percent(beyond)
            ));
        }
        let fault = own.as_ref().and_then(OwnInvariance::fault);
        care.extend(fault);
        let care_of_pairs = of_pairs.len();
        care.extend(of_pairs);
        Ok(Self {
            verdict: verdict(&no, &long, &care),
            too_few: first,
            repeated,
            care_of_pairs,
            error: share_text,
            no,
            no_long_orbits: long,
            care,
            held_out: held_out.map(Pairs::len),
            planes,
            worst,
            share_beyond_rotation: pooled,
            limit,
            orbits,
            swings,
            own,
            sizes: plane_sizes(judge),
        })
    }

    /// The same judgement of a symplectic network for pairs that change areas, or whose areas are not known well. What
    /// comes to more than one per cent in 1000 steps is a reason not to trust long orbits; a density that errs by more
    /// than one per cent, which does not grow with steps, is one for care.
    #[must_use]
    pub fn with_area_defects(mut self, defects: impl IntoIterator<Item = AreaDefect>) -> Self {
        for defect in defects {
            match defect {
                AreaDefect::Pairs(share) | AreaDefect::OfSection(share)
                    if !(STEPS as f64 * share <= LITTLE) =>
                {
                    let comes_to = match STEPS as f64 * share {
                        all if all < 1.0 => format!("in {STEPS} steps this may come to {}", percent(all)),
                        _ if share < 1.0 => {
                            let steps = (1.0 / share).ceil();
                            format!("after {steps} steps they have changed by about their own size")
                        }
                        _ => "after one step nothing is left of them".to_owned(),
                    };
                    self.no_long_orbits.push(format!(
                        "the pairs change areas by {share:.1e} a step, which the network keeps exactly: {comes_to}"
                    ));
                    // What shrinks areas by a share moves points by half of it: no weights err by less, and twice as
                    // much is near it.
                    let least = share * self.sizes[self.worst];
                    let of_pairs = matches!(defect, AreaDefect::Pairs(_));
                    if of_pairs && self.planes[self.worst].error <= least {
                        self.limit = Limit::Areas;
                    }
                }
                AreaDefect::Density(share) if !(share <= LITTLE) => self.care.push(format!(
                    "the density of the section errs by {share:.1e}: the areas that the network keeps are known to no \
                     more than that"
                )),
                AreaDefect::Pairs(_) | AreaDefect::OfSection(_) | AreaDefect::Density(_) => {}
            }
        }
        self.verdict = verdict(&self.no, &self.no_long_orbits, &self.care);
        self
    }

    /// Whether the verdict is a plain yes.
    pub fn is_yes(&self) -> bool {
        self.reasons().next().is_none()
    }

    /// Whether there are reasons for care alone, all of which are in the pairs: no other training helps.
    pub fn is_limited_by_its_pairs(&self) -> bool {
        let no_other = self.no.is_empty() && self.no_long_orbits.is_empty();
        no_other && !self.care.is_empty() && self.care.len() == self.care_of_pairs
    }

    /// Whether the plane that decides is hardly learnt.
    pub fn is_little_learnt(&self) -> bool {
        !(self.planes[self.worst].share < LEARNT)
    }

    /// What the verdict covers, in words: the error of one step, and orbits whose true course is
    /// not known.
    pub fn orbits_in_words(&self) -> String {
        let kept = match self.orbits {
            Some(Orbits { count, astray: 0, .. }) => {
                format!(
                    "; all {count} orbits of {STEPS} steps from points of the pairs stay near the box of the pairs"
                )
            }
            Some(Orbits { count, astray, .. }) => {
                format!(
                    "; {} of {count} orbits of {STEPS} steps stay near the box of the pairs",
                    count - astray
                )
            }
            None => String::new(),
        };
        format!(
            "The error is that of one step{kept}. Pairs do not show how far an orbit is from the true one after many \
             steps: that takes a trajectory to compare with."
        )
    }

    /// The reasons against a plain yes.
    pub fn reasons(&self) -> impl Iterator<Item = &str> {
        let reasons = self.no.iter().chain(&self.no_long_orbits).chain(&self.care);
        reasons.map(String::as_str)
    }

    /// The verdict with its reasons.
    pub fn trust(&self) -> Trust {
        let reasons = self.reasons().map(ToOwned::to_owned).collect();
        Trust { verdict: self.verdict.to_owned(), error: self.error.clone(), reasons }
    }
}
