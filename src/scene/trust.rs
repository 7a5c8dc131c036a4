//! Whether to trust a network that was trained on pairs of one's own.

use super::findings::{Block, Findings, Format, Section};
use crate::error::Error;
use crate::flow::{Pairs, Region};
use crate::measure::OwnInvariance;
use crate::network::{Model, Rollout};
use crate::train::{Outcome, TrainingRecord};
use serde_json::json;

/// Orbits that are looked at, from held-out points, and their length.
const ORBITS: usize = OwnInvariance::ORBITS;
/// Applications of the network in each orbit.
pub const STEPS: usize = OwnInvariance::ITERATIONS;

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
                 a wider network, other weights to begin with (`--starts`), `--optimiser lm`"
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

/// Follows the orbits of a network and counts those that leave the box.
pub fn orbits(model: &Model, starts: &[f64], region: &Region) -> Result<Orbits, Error> {
    let dim = 2 * model.composition().dof();
    let count = starts.len() / dim;
    let around = region.widened(0.5);
    let values = model.rollout(starts, Rollout { steps: STEPS, every: 1 })?;
    let mut lost = vec![false; count];
    let mut first = None;
    for (index, z) in values.chunks_exact(dim).enumerate() {
        if around.first_outside(z).is_some() {
            lost[index % count] = true;
            first = first.or(Some((index % count, index / count)));
        }
    }
    Ok(Orbits { count, astray: lost.iter().filter(|lost| **lost).count(), first })
}

/// Whether to trust the outcome of a training, why not, and what limits it: judged by pairs
/// that are held out, or by those of the training where none are.
pub(super) fn trust(
    outcome: &Outcome,
    pairs: &Pairs,
    held_out: Option<&Pairs>,
    rotation_error: f64,
) -> Result<Findings, Error> {
    let judge = held_out.unwrap_or(pairs);
    let dim = 2 * pairs.dof();
    let error = outcome.best.validation.unwrap_or(outcome.loss);
    let share = (error / rotation_error).sqrt();
    let starts = &judge.input()[..dim * judge.len().min(ORBITS)];
    let both = [Some(pairs), held_out].into_iter().flatten();
    let ends = both.flat_map(|pairs| [pairs.input(), pairs.output()]);
    let region = Region::around(dim, ends);
    let orbits =
        region.as_ref().map(|region| orbits(&outcome.model, starts, region)).transpose()?;
    let own = OwnInvariance::of(&outcome.model, starts, STEPS);
    let limit = limit(outcome.loss, outcome.best.validation, &outcome.history);

    let (mut no, mut long, mut care) = (Vec::new(), Vec::new(), Vec::new());
    let percent = |value: f64| Format::Percent.number(value);
    let share_text = format!("it errs by {} of what the nearest rotation leaves", percent(share));
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
    if held_out.is_none() {
        care.push("nothing was held out: the error is that of the pairs it was trained on".into());
    } else if limit == Limit::Data {
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
    let mut text = format!("**{word}**: {share_text}");
    for reason in no.iter().chain(&long).chain(&care).filter(|reason| **reason != share_text) {
        text.push_str(&format!("; {reason}"));
    }
    text.push_str(".\n\n");
    let mut lines = format!("- What limits the error: {}.\n", limit.words());
    if let Some(own) = &own {
        lines.push_str(&format!(
            "- Its own invariant changes by {} over {STEPS} steps along its orbits (median), as the \
             power {:.2} of their number.\n",
            percent(own.drift),
            own.exponent
        ));
    }
    if let Some(Orbits { count, astray: 0, .. }) = orbits {
        lines.push_str(&format!(
            "- All {count} orbits of {STEPS} steps from held-out points stay near the box of the pairs.\n"
        ));
    }
    let data = json!({
        "trust": word,
        "no": no,
        "no_long_orbits": long,
        "care": care,
        "share_beyond_rotation": share,
        "limit": match limit {
            Limit::Data => "data",
            Limit::Iterations => "iterations",
            Limit::Network => "network",
        },
        "orbits": orbits.as_ref().map(|orbits| orbits.count),
        "astray": orbits.as_ref().map(|orbits| orbits.astray),
        "own_invariant_drift": own.as_ref().map(|own| own.drift),
        "own_invariant_exponent": own.as_ref().map(|own| own.exponent),
        "near_identity_over_epsilon": own.as_ref().and_then(|own| own.moved),
    });
    Ok(Findings {
        title: "Whether to trust it".into(),
        results: Section {
            summary: vec![Block::Text(text)],
            details: vec![Block::Text(lines)],
            data,
        },
        ..Findings::default()
    })
}
