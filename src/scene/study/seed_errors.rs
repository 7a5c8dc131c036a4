//! What other initial weights change in a comparison of networks with their rivals.

use super::shared::finite;
use super::work_precision::Points;
use crate::error::Error;
use crate::flow::Trajectories;
use crate::measure::timing::{
    AtError, Comparison, Spread, WorkPrecision, root_mean_square_distance,
};
use crate::network::{Model, Rollout, map_points};
use crate::phase::Direction;
use crate::scene::context::{Context, RunError};
use crate::scene::findings::{Format, Table};
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
        Self { median: Spread::of(ranked).and_then(|spread| finite(spread.median)), worst }
    }
}

/// Errors of a network trained from several initial weights, one of each.
#[derive(Serialize)]
pub(super) struct SeedErrors {
    pub(super) network: String,
    /// Root mean square distances from the reference after one step; infinite or NaN where points are lost.
    pub(super) one_step: Vec<f64>,
    /// The same over trajectories.
    pub(super) trajectories: Vec<f64>,
}

impl SeedErrors {
    /// None of a network that was trained once. `states` are those of the reference, the initial ones first.
    pub(super) fn new(
        of: &BySeed,
        points: &Points,
        states: &[f64],
        (trajectories, request): (usize, Rollout),
    ) -> Result<Option<Self>, Error> {
        if of.seeds.len() < 2 {
            return Ok(None);
        }
        let one_step = |model: &Model| {
            let map = model.composition();
            let mut moved = points.input().to_vec();
            map_points(map, Direction::Forward, &mut moved)?;
            Ok(root_mean_square_distance(&moved, points.output(), 2 * map.dof()))
        };
        let long = |model: &Model| {
            let dim = 2 * model.composition().dof();
            let (initial, reference) = states.split_at(trajectories * dim);
            let found = model.rollout(initial, request)?;
            Ok(root_mean_square_distance(&found[initial.len()..], reference, dim))
        };
        let models = || of.seeds.iter().map(|seed| seed.model());
        Ok(Some(Self {
            network: of.network.clone(),
            one_step: models().map(one_step).collect::<Result<_, Error>>()?,
            trajectories: models().map(long).collect::<Result<_, Error>>()?,
        }))
    }

    /// Medians and the largest errors; `lost` are the errors from which on points are lost.
    pub(super) fn table(all: &[(&Self, [f64; 2])], what: [&str; 2]) -> Table {
        let [one, long] = what;
        let mut table = Table::new([
            ("network".to_owned(), Format::Exact),
            ("seeds".to_owned(), Format::Exact),
            (format!("{one}, rms: median"), Format::Exponent(2)),
            ("worst".to_owned(), Format::Exponent(2)),
            ("lost".to_owned(), Format::Exact),
            (format!("{long}, rms: median"), Format::Exponent(2)),
            ("worst".to_owned(), Format::Exponent(2)),
            ("lost".to_owned(), Format::Exact),
        ]);
        for (of, lost) in all {
            let mut row = vec![format!("`{}`", of.network).into(), of.one_step.len().into()];
            for (errors, lost) in [&of.one_step, &of.trajectories].into_iter().zip(lost) {
                let kept = |error: &f64| (*error <= *lost).then_some(*error);
                let MedianAndWorst { median, worst } = MedianAndWorst::of(errors.iter().map(kept));
                let lost = errors.iter().filter(|error| kept(error).is_none()).count();
                row.extend([median.into(), worst.into(), lost.into()]);
            }
            table.push(row);
        }
        table
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
        let all: Vec<String> = errors.iter().map(|error| format!("{error:.1e}")).collect();
        format!(
            "- `{network}` from {} initial weights, rms distance: {}; median {median}, worst {worst}.",
            errors.len(),
            all.join(", ")
        )
    };
    seeds.iter().map(of).collect::<Vec<_>>().join("\n")
}

/// How many times as long as the network its fastest rival takes, at the error from each initial weights.
pub(super) struct SeedGains {
    /// Ascending: 0 where the points are lost, infinite where no rival errs as little.
    gains: Vec<f64>,
}

impl SeedGains {
    /// None where the network was not timed.
    pub(super) fn new(errors: &[f64], network: &str, comparison: &Comparison) -> Option<Self> {
        let own = |method: &&WorkPrecision| method.setting.is_none() && method.name == network;
        let seconds = comparison.methods.iter().find(own)?.seconds?.median;
        let gain = |error: &f64| {
            if !(*error <= comparison.lost()) {
                return 0.0;
            }
            let rival = AtError::fastest(&comparison.methods, *error);
            rival.map_or(f64::INFINITY, |rival| rival.seconds / seconds)
        };
        let mut gains: Vec<f64> = errors.iter().map(gain).collect();
        gains.sort_by(f64::total_cmp);
        Some(Self { gains })
    }

    /// `in the median the fastest rival that errs no more takes 9.7 × as long as the map, in the worst case …`.
    pub(super) fn words(&self) -> String {
        let words = |gain: f64| match gain {
            0.0 => "the map has lost the points".to_owned(),
            gain if gain.is_infinite() => "no rival errs as little".to_owned(),
            gain => {
                let factor = Format::Factor.number(gain);
                format!("the fastest rival that errs no more takes {factor} as long as the map")
            }
        };
        let least = self.gains.first().copied().unwrap_or(f64::NAN);
        // The smaller of two in the middle.
        let middle = self.gains.get((self.gains.len() - 1) / 2).copied().unwrap_or(f64::NAN);
        format!("in the median {}, in the worst case {}", words(middle), words(least))
    }
}
