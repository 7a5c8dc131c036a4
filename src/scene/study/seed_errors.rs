//! What other initial weights change in a comparison of networks with their rivals.

use super::over_seeds::MedianAndWorst;
use super::step_tables::named;
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

/// What rivals are grouped by: the strongest of one group says nothing of another.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum RivalKind {
    ClosedAverage,
    StepTable,
    Other,
}

impl RivalKind {
    const ALL: [Self; 3] = [Self::ClosedAverage, Self::StepTable, Self::Other];

    fn name(self) -> &'static str {
        match self {
            Self::ClosedAverage => "averages in closed form",
            Self::StepTable => "tables of the step",
            Self::Other => "all others",
        }
    }
}

/// How many times as long as a network from several initial weights its fastest rival of each kind takes, at the error
/// from the best, the median and the worst of them.
pub(super) struct SeedGains<'a> {
    pub(super) network: &'a str,
    /// What the errors are of.
    pub(super) what: String,
    /// From each initial weights.
    pub(super) errors: &'a [f64],
    pub(super) comparison: &'a Comparison,
    pub(super) kind: &'a dyn Fn(&WorkPrecision) -> RivalKind,
    /// How many steps, of so many seconds for unit time, pay for the network beside a rival that is slower.
    pub(super) pays_after: &'a dyn Fn(AtError<'_>, f64) -> Option<f64>,
}

impl SeedGains<'_> {
    pub(super) fn table() -> Table {
        Table::new([
            ("network", Format::Exact),
            ("of", Format::Exact),
            ("error, rms: best", Format::Exponent(1)),
            ("median", Format::Exponent(1)),
            ("worst", Format::Exponent(1)),
            ("µs for unit time", Format::Significant),
            ("one alone", Format::Significant),
            ("rivals", Format::Exact),
            ("times as long: at the best", Format::Factor),
            ("at the median", Format::Factor),
            ("at the worst", Format::Factor),
            ("one alone, of the rival that is then fastest", Format::Factor),
            ("the fastest at the median", Format::Exact),
            ("steps that pay, at the median", Format::Significant),
        ])
    }

    /// Adds a row for each kind that there are rivals of.
    pub(super) fn add_to(&self, table: &mut Table) {
        let methods = &self.comparison.methods;
        let own = |method: &&WorkPrecision| method.setting.is_none() && method.name == self.network;
        let Some(own) = methods.iter().find(own) else { return };
        let Some(seconds) = own.seconds else { return };
        let (seconds, alone) = (seconds.median, own.alone.map(|spread| spread.median));
        let lost = self.comparison.lost();
        let kept = |error: &f64| (*error <= lost).then_some(*error);
        let best = self.errors.iter().filter_map(kept).min_by(f64::total_cmp);
        let MedianAndWorst { median, worst } = MedianAndWorst::of(self.errors.iter().map(kept));
        for kind in RivalKind::ALL {
            let of_kind =
                |method: &&WorkPrecision| method.setting.is_some() && (self.kind)(method) == kind;
            let rivals: Vec<WorkPrecision> = methods.iter().filter(of_kind).cloned().collect();
            if rivals.is_empty() {
                continue;
            }
            let at = |error: Option<f64>| AtError::fastest(&rivals, error?);
            let gain = |error: Option<f64>| at(error).map(|rival| rival.seconds / seconds);
            let at_median = at(median);
            let name = match (median, at_median) {
                (None, _) => "it has lost the points".to_owned(),
                (Some(_), None) => "none errs as little".to_owned(),
                (Some(_), Some(rival)) => named(rival.method),
            };
            table.push([
                format!("`{}`", self.network).into(),
                self.what.clone().into(),
                best.into(),
                median.into(),
                worst.into(),
                (seconds * MICRO).into(),
                alone.map(|alone| alone * MICRO).into(),
                kind.name().into(),
                gain(best).into(),
                gain(median).into(),
                gain(worst).into(),
                fastest_alone(&rivals, median).zip(alone).map(|(rival, own)| rival / own).into(),
                name.into(),
                at_median.and_then(|rival| (self.pays_after)(rival, seconds)).into(),
            ]);
        }
    }
}

/// The seconds of one trajectory alone of the rival that then takes the shortest.
fn fastest_alone(rivals: &[WorkPrecision], error: Option<f64>) -> Option<f64> {
    let of = |rival: &WorkPrecision| AtError::of_curve(rivals, &rival.name, error?)?.alone;
    rivals.iter().filter_map(of).min_by(f64::total_cmp)
}

/// Microseconds in a second.
pub(super) const MICRO: f64 = 1e6;
