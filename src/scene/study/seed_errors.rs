//! What other initial weights change in a comparison of networks with their rivals.

use super::over_seeds::MedianAndWorst;
use super::work_precision::Points;
use crate::error::Error;
use crate::measure::timing::{AtError, Comparison, WorkPrecision, root_mean_square_distance};
use crate::network::{Model, Rollout, map_points};
use crate::phase::Direction;
use crate::scene::findings::{Format, Table};
use crate::scene::learning::BySeed;
use crate::scene::trained::Trained;
use serde::Serialize;
use std::rc::Rc;

/// Errors of a network trained from several initial weights, one of each.
#[derive(Serialize)]
pub(super) struct SeedErrors {
    pub(super) network: String,
    /// Root mean square distances from the reference after one step; infinite or NaN where points are lost.
    pub(super) one_step: Vec<f64>,
    /// Root mean square distances from the reference along trajectories; infinite or NaN where points are lost.
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
        let of_all = |error: &dyn Fn(&Model) -> Result<f64, Error>| {
            let error_of = |seed: &Rc<Trained>| match seed.lost {
                Some(_) => Ok(f64::INFINITY),
                None => error(seed.model()),
            };
            of.seeds.iter().map(error_of).collect::<Result<Vec<f64>, Error>>()
        };
        Ok(Some(Self {
            network: of.network.clone(),
            one_step: of_all(&one_step)?,
            trajectories: of_all(&long)?,
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
