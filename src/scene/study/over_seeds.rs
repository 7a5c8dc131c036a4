//! Medians and worst cases over the initial weights of networks.

use super::shared::finite;
use crate::error::Error;
use crate::flow::Trajectories;
use crate::measure::timing::{Spread, root_mean_square_distance};
use crate::network::Rollout;
use crate::scene::context::{Context, RunError};
use crate::scene::learning::BySeed;
use crate::scene::trained::Trained;
use serde::Serialize;
use serde_json::{Value, json};
use std::rc::Rc;

/// The median and the largest of the numbers that the initial weights of a network led to.
#[derive(Clone, Copy, Serialize)]
pub(super) struct MedianAndWorst {
    /// None where half of them are lost.
    pub(super) median: Option<f64>,
    /// None where one of them is lost.
    pub(super) worst: Option<f64>,
}

impl MedianAndWorst {
    /// Of numbers that are none, infinite or NaN where a map is lost: such a number is the largest.
    pub(super) fn of(numbers: impl IntoIterator<Item = Option<f64>>) -> Self {
        let or_lost = |number: Option<f64>| number.and_then(finite).unwrap_or(f64::INFINITY);
        let mut ranked: Vec<f64> = numbers.into_iter().map(or_lost).collect();
        ranked.sort_by(f64::total_cmp);
        let worst = ranked.last().copied().and_then(finite);
        Self { median: Spread::from_values(ranked).and_then(|spread| finite(spread.median)), worst }
    }
}

/// Of each network with several initial weights, the root mean square distance from the reference of the map from each
/// of them.
pub(super) fn rollouts_of_seeds(
    context: &mut Context<'_>,
    initial: &[Vec<f64>],
    request: Rollout,
    reference: &Trajectories,
) -> Result<Vec<(String, Vec<f64>)>, RunError> {
    let mut out = Vec::new();
    for BySeed { network, seeds } in context.by_network()? {
        if seeds.len() < 2 {
            continue;
        }
        let stage = format!("roll-outs of all weights of {network}");
        let errors = context.stage(&stage, |_| {
            let of = |trained: &Rc<Trained>| {
                if trained.lost.is_some() {
                    return Ok(f64::INFINITY);
                }
                let states = trained.model().rollout(&initial.concat(), request)?;
                Ok(root_mean_square_distance(&states, reference.values(), reference.dim()))
            };
            seeds.iter().map(of).collect::<Result<Vec<f64>, Error>>()
        })?;
        out.push((network, errors));
    }
    Ok(out)
}

/// [`rollouts_of_seeds`], as a report has them as data.
pub(super) fn data_of_rollouts(seeds: &[(String, Vec<f64>)]) -> Value {
    let of = |(network, rms): &(String, Vec<f64>)| json!({ "network": network, "rms_errors": rms });
    seeds.iter().map(of).collect()
}

/// A line for each network of [`rollouts_of_seeds`].
pub(super) fn words_of_rollouts(seeds: &[(String, Vec<f64>)]) -> String {
    let of = |(network, errors): &(String, Vec<f64>)| {
        let found = MedianAndWorst::of(errors.iter().copied().map(Some));
        let or_lost = |error: Option<f64>| error.map_or("lost".to_owned(), |e| format!("{e:.1e}"));
        let (median, worst) = (or_lost(found.median), or_lost(found.worst));
        let all: Vec<String> = errors.iter().map(|error| or_lost(finite(*error))).collect();
        format!(
            "- `{network}` from {} initial weights, rms distance: {}; median {median}, worst {worst}.",
            errors.len(),
            all.join(", ")
        )
    };
    seeds.iter().map(of).collect::<Vec<_>>().join("\n")
}
