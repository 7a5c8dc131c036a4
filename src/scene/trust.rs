//! Whether to trust a network that was trained on pairs of one's own.

use super::findings::{Block, Findings, Format, Section, Table};
use super::words::subscript;
use crate::error::Error;
use crate::flow::{Pairs, Region};
use crate::layer::TorusAction;
use crate::measure::{
    OwnInvariance, PlaneMotion, PlaneSwing, component_errors, plane_motions, root_mean_square,
    rotation_errors,
};
use crate::network::Rollout;
use crate::train::{Outcome, TrainingRecord};
use serde_json::json;

/// Orbits that are looked at, from held-out points, and their length.
const ORBITS: usize = OwnInvariance::ORBITS;
/// Applications of the network in each orbit.
pub const STEPS: usize = OwnInvariance::ITERATIONS;

/// The fewest held-out pairs that a verdict is given on. With a probability of 95 % the worst of
/// them errs by more than nine tenths of all points do: 0.9³⁰ = 4 % is less than a twentieth.
const FEWEST: usize = 30;

/// What limits the error of a training.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// The held-out error is far above the loss.
    Data,
    /// The loss was still falling.
    Iterations,
    /// Neither: the network or where its optimiser came to rest.
    Network,
}

/// The loss at the end over that of nine tenths of the iterations: above, it is at rest.
const AT_REST: f64 = 0.9;
/// The held-out error over the loss from which pairs are learnt by heart.
const BY_HEART: f64 = 2.0;

/// A held-out error that is so small a share of the motion needs no care, however far above the loss
/// it is.
const LITTLE: f64 = 0.01;

/// What limits a training, from its losses on training and held-out pairs.
pub fn limit(loss: f64, validation: Option<f64>, history: &[TrainingRecord]) -> Limit {
    let Some(last) = history.last() else { return Limit::Network };
    let earlier = history.iter().rev().find(|r| r.iteration * 10 <= last.iteration * 9);
    if validation.is_some_and(|validation| validation > BY_HEART * loss) {
        return Limit::Data;
    }
    match earlier {
        Some(earlier) if last.loss < AT_REST * earlier.loss => Limit::Iterations,
        _ => Limit::Network,
    }
}

impl Limit {
    fn words(self) -> &'static str {
        match self {
            Self::Data => {
                "the data: the held-out error is far above the loss; more pairs, or a smaller network"
            }
            Self::Iterations => "the iterations: the loss was still falling",
            Self::Network => {
                "the network or its optimiser: the loss is at rest, and held-out pairs fit as well; \
                 a wider network, the best of several starts, the optimiser Levenberg–Marquardt"
            }
        }
    }
}

/// Orbits of a network from some points.
pub struct Orbits {
    /// How many.
    pub count: usize,
    /// Those that went astray: out of the box by more than half of its width, or out of
    /// the finite numbers.
    pub astray: usize,
    /// The first of them, its row and step.
    pub first: Option<(usize, usize)>,
}

/// Counts the orbits that leave the box, of the states of so many in turn, from the first of each on.
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

/// What the error of a plane is compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneError {
    /// Its root mean square over q and p.
    pub error: f64,
    /// The same over what the nearest rotation leaves of the plane, or over the size of a plane
    /// that it explains.
    pub share: f64,
    /// The rotation explains the plane to rounding.
    pub explained: bool,
}

/// The errors of the planes of a model, of which those of its components are known.
pub fn plane_errors(errors: &[f64], motions: &[PlaneMotion]) -> Vec<PlaneError> {
    let dof = motions.len();
    let of_plane = |(j, motion): (usize, &PlaneMotion)| {
        let error = root_mean_square(&[errors[j], errors[dof + j]]);
        PlaneError { error, share: error / motion.scale, explained: motion.explained }
    };
    motions.iter().enumerate().map(of_plane).collect()
}

/// The plane that decides: the first of those with the largest share, a NaN before all.
pub fn worst(planes: &[PlaneError]) -> usize {
    let share = |j: usize| planes[j].share;
    (1..planes.len()).fold(0, |worst, j| {
        let larger = !(share(j) <= share(worst));
        if larger && !share(worst).is_nan() { j } else { worst }
    })
}

/// `plane 2 (q₂, p₂)`.
fn plane_name(j: usize) -> String {
    format!("plane {} (q{}, p{})", j + 1, subscript(j + 1), subscript(j + 1))
}

/// Whether to trust the outcome of a training, why not, and what limits it: judged by pairs
/// that are held out, plane by plane. `nearest` is the action whose rotation by these angles is
/// nearest to the pairs.
pub(super) fn trust(
    outcome: &Outcome,
    pairs: &Pairs,
    held_out: Option<&Pairs>,
    (action, angles): (&TorusAction, &[f64]),
) -> Result<Findings, Error> {
    let judge = held_out.unwrap_or(pairs);
    let (dof, dim) = (pairs.dof(), 2 * pairs.dof());
    let errors = component_errors(outcome.model.composition(), judge)?;
    let planes = plane_errors(&errors, &plane_motions(action, angles, judge));
    let worst = worst(&planes);
    let share = planes[worst].share;
    let left = rotation_errors(action, angles, judge);
    let pooled = root_mean_square(&errors) / (left.iter().sum::<f64>() / dim as f64).sqrt();
    let starts = &judge.input()[..dim * judge.len().min(ORBITS)];
    let both: Vec<&Pairs> = [Some(pairs), held_out].into_iter().flatten().collect();
    let region = Region::around(dim, both.iter().flat_map(|pairs| [pairs.input(), pairs.output()]));
    let count = starts.len() / dim;
    let states = outcome.model.rollout(starts, Rollout { steps: STEPS, every: 1 })?;
    let orbits = region.as_ref().map(|region| orbits(&states, count, region));
    // Pairs of several maps do not tell what one of them does to an action.
    let swings = match pairs.conditions() {
        [] => PlaneSwing::of(&both, action, angles, &states, count),
        _ => Vec::new(),
    };
    let own = OwnInvariance::of(&outcome.model, starts, STEPS);
    let limit = limit(outcome.loss, outcome.best.validation, &outcome.history);

    let (mut no, mut long, mut care) = (Vec::new(), Vec::new(), Vec::new());
    let mut first = None;
    let percent = |value: f64| Format::Percent.number(value);
    match held_out.map(Pairs::len) {
        None => {
            first = Some(
                "nothing was held out: the errors are those of the pairs it was trained on".into(),
            );
        }
        Some(held) if held < FEWEST => {
            let pairs = if held == 1 { "pair was" } else { "pairs were" };
            first = Some(format!(
                "only {held} {pairs} held out: a verdict takes {FEWEST}, of which the worst bounds \
                 nine tenths of all errors (at 95 %)"
            ));
        }
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
    if !(share < 0.5) {
        no.push("little is learnt".to_owned());
    } else if share > 0.05 {
        care.push(share_text.clone());
    }
    if let Some(Orbits { count, astray, first: Some((row, step)) }) = orbits {
        // They may follow the flow itself, of which nothing is known there: of the single steps
        // inside this says nothing.
        let of = if 4 * astray > count { &mut long } else { &mut care };
        of.push(format!(
            "{astray} of {count} orbits of {STEPS} steps leave the box of the pairs by more than half \
             its width, the first, from held-out point {row}, after {step} steps"
        ));
    }
    for (j, swing) in swings.iter().enumerate() {
        let name = plane_name(j);
        if swing.beyond > 0 {
            let of = if 4 * swing.beyond > count { &mut long } else { &mut care };
            of.push(format!(
                "the action of {name} swings further than in all pairs along {} of {count} orbits of \
                 {STEPS} steps",
                swing.beyond
            ));
        } else if swing.is_too_wide() {
            care.push(format!(
                "the action of {name} swings by {} along its orbits (median), {} what a step of \
                 the pairs changes it by",
                Format::Magnitude.number(swing.swing),
                Format::Factor.number(swing.steps())
            ));
        }
    }
    if held_out.is_some() && limit == Limit::Data && !(share <= LITTLE) {
        let validation = outcome.best.validation.unwrap_or(f64::NAN);
        let ratio = Format::Factor.number(validation / outcome.loss);
        care.push(format!("the held-out error is {ratio} the loss"));
    }
    let fault = own.as_ref().and_then(OwnInvariance::fault);
    care.extend(fault);
    let word = match (no.is_empty(), long.is_empty(), care.is_empty()) {
        (true, true, true) => "yes, within the box of the pairs",
        (true, true, false) => "with care, within the box of the pairs",
        (true, false, _) => "for single steps within the box of the pairs, not for long orbits",
        (false, ..) => "no",
    };
    let mut text = format!("**{word}**: ");
    first.iter().for_each(|first| text.push_str(&format!("{first}; ")));
    text.push_str(&share_text);
    let told = |reason: &&String| **reason != share_text && Some(*reason) != first.as_ref();
    for reason in no.iter().chain(&long).chain(&care).filter(told) {
        text.push_str(&format!("; {reason}"));
    }
    text.push_str(".\n\n");
    let mut lines = format!("- What limits the error: {}.\n", limit.words());
    if let Some(own) = &own {
        let change = format!(
            "changes by {} over {STEPS} steps along its orbits (median), as the power {:.2} of \
             their number",
            percent(own.drift),
            own.exponent
        );
        lines.push_str(&match own.unperturbed {
            true => format!(
                "- The action that it owns is an invariant at ε = 0 only; it {change}. This is no \
                 fault.\n"
            ),
            false => format!("- Its own invariant {change}.\n"),
        });
    }
    if let Some(Orbits { count, astray: 0, .. }) = orbits {
        lines.push_str(&format!(
            "- All {count} orbits of {STEPS} steps from held-out points stay near the box of the pairs.\n"
        ));
    }
    if planes.iter().any(|plane| plane.explained) {
        lines.push_str(
            "- A plane that the rotation explains to rounding has no other motion: its error is \
             compared with its size.\n",
        );
    }
    let mut table = Table::new([
        ("plane", Format::Exact),
        ("error (rms)", Format::Exponent(2)),
        ("of what the nearest rotation leaves of it", Format::Percent),
        ("action: change in a step of the pairs (rms)", Format::Exponent(2)),
        ("swing along orbits (median)", Format::Exponent(2)),
        ("range in the pairs", Format::Exponent(2)),
    ]);
    for (j, plane) in planes.iter().enumerate() {
        let swing = swings.get(j);
        table.push([
            plane_name(j).into(),
            plane.error.into(),
            plane.share.into(),
            swing.map(|swing| swing.step).into(),
            swing.map(|swing| swing.swing).into(),
            swing.map(|swing| swing.range).into(),
        ]);
    }
    let of_planes: Vec<_> = planes
        .iter()
        .enumerate()
        .map(|(j, plane)| {
            let swing = swings.get(j);
            json!({
                "error": plane.error,
                "share": plane.share,
                "explained_by_rotation": plane.explained,
                "action_step": swing.map(|swing| swing.step),
                "action_swing": swing.map(|swing| swing.swing),
                "action_range": swing.map(|swing| swing.range),
                "action_swings_allowed": swing.and_then(|swing| swing.allowed),
                "orbits_beyond_range": swing.map(|swing| swing.beyond),
            })
        })
        .collect();
    let data = json!({
        "trust": word,
        "no": no,
        "no_long_orbits": long,
        "care": care,
        "held_out": held_out.map(Pairs::len),
        "planes": of_planes,
        "plane": worst + 1,
        "share": share,
        "share_beyond_rotation": pooled,
        "limit": match limit {
            Limit::Data => "data",
            Limit::Iterations => "iterations",
            Limit::Network => "network",
        },
        "orbits": orbits.as_ref().map(|orbits| orbits.count),
        "astray": orbits.as_ref().map(|orbits| orbits.astray),
        "own_invariant_drift": own.as_ref().map(|own| own.drift),
        "own_invariant_exponent": own.as_ref().map(|own| own.exponent),
        "own_invariant_unperturbed": own.as_ref().map(|own| own.unperturbed),
        "near_identity_over_epsilon": own.as_ref().and_then(|own| own.moved),
    });
    Ok(Findings {
        title: "Whether to trust it".into(),
        results: Section {
            summary: vec![Block::Text(text)],
            details: vec![Block::Text(lines), Block::Table(table)],
            data,
        },
        ..Findings::default()
    })
}
