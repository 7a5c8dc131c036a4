//! What other initial weights change in a comparison of networks with their rivals.

use super::work_precision::Points;
use crate::error::Error;
use crate::measure::timing::{
    AtError, Comparison, Spread, WorkPrecision, root_mean_square_distance,
};
use crate::network::{Model, Rollout, map_points};
use crate::phase::Direction;
use crate::scalar::max_or_nan;
use crate::scene::findings::{Format, Table};
use crate::scene::learning::BySeed;
use serde::Serialize;

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

    /// Medians and the largest errors, as far as the points are not lost.
    pub(super) fn table(all: &[&Self], what: [&str; 2]) -> Table {
        let [one, long] = what;
        let mut table = Table::new([
            ("network".to_owned(), Format::Exact),
            ("seeds".to_owned(), Format::Exact),
            (format!("{one}, rms: median"), Format::Exponent(2)),
            ("worst".to_owned(), Format::Exponent(2)),
            (format!("{long}, rms: median"), Format::Exponent(2)),
            ("worst".to_owned(), Format::Exponent(2)),
        ]);
        for of in all {
            let median = |errors: &[f64]| Spread::of(errors.to_vec()).map(|spread| spread.median);
            let worst = |errors: &[f64]| errors.iter().copied().fold(0.0, max_or_nan);
            table.push([
                format!("`{}`", of.network).into(),
                of.one_step.len().into(),
                median(&of.one_step).into(),
                worst(&of.one_step).into(),
                median(&of.trajectories).into(),
                worst(&of.trajectories).into(),
            ]);
        }
        table
    }
}

/// How many times as long as the network its fastest rival takes, at the error from each initial weights.
pub(super) struct SeedGains {
    /// Ascending, of those that a rival reaches.
    gains: Vec<f64>,
    /// Weights with which the points are lost.
    lost: usize,
    /// Weights at whose error no rival was found that errs no more.
    unreached: usize,
}

impl SeedGains {
    /// None where the network itself was not timed.
    pub(super) fn new(errors: &[f64], network: &str, comparison: &Comparison) -> Option<Self> {
        let own = |method: &&WorkPrecision| method.setting.is_none() && method.name == network;
        let seconds = comparison.methods.iter().find(own)?.seconds?.median;
        let (mut gains, mut lost, mut unreached) = (Vec::new(), 0, 0);
        for &error in errors {
            if !(error <= comparison.lost()) {
                lost += 1;
                continue;
            }
            match AtError::fastest(&comparison.methods, error) {
                Some(rival) => gains.push(rival.seconds / seconds),
                None => unreached += 1,
            }
        }
        gains.sort_by(f64::total_cmp);
        Some(Self { gains, lost, unreached })
    }

    /// `median 2.9 ×, least 2.6 ×; lost with 1 of 5`.
    pub(super) fn words(&self) -> String {
        let count = self.gains.len() + self.lost + self.unreached;
        let factor = |gain: f64| Format::Factor.number(gain);
        let mut parts = Vec::new();
        if let Some(spread) = Spread::of(self.gains.clone()) {
            parts.push(format!(
                "median {}, least {}",
                factor(spread.median),
                factor(self.gains[0])
            ));
        }
        if self.unreached > 0 {
            parts.push(format!("no rival errs as little with {} of {count}", self.unreached));
        }
        if self.lost > 0 {
            parts.push(format!("lost with {} of {count}", self.lost));
        }
        parts.join("; ")
    }
}
