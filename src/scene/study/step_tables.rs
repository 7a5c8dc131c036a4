//! Tables of a step, as rivals: made, with what they cost.

use crate::error::Error;
use crate::flow::{FlowOfPoints, StepTable, TableKind};
use crate::measure::timing::{Method, WorkPrecision};
use crate::scene::bibliography::{GENERATING_FUNCTIONS, SPLINES};
use crate::scene::context::{Context, RunError};
use crate::scene::findings::{Block, Format};
use crate::system::Hamiltonian;
use serde::{Deserialize, Serialize};

/// A table with the numbers of nodes that it is tried with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableSizes {
    /// The kind of the table: the function of the map that it stores.
    pub kind: TableKind,
    /// Its nodes along each axis.
    pub nodes: Vec<usize>,
}

impl TableSizes {
    /// Fails unless tables of all sizes can be made of a map of so many degrees of freedom.
    pub(super) fn check(&self, dof: Option<usize>) -> Result<(), Error> {
        Error::check_count_range("tables.nodes", self.nodes.len(), 1, 1000)?;
        let Some(dof) = dof else { return Ok(()) };
        if let Some(pair) = self.nodes.windows(2).find(|pair| pair[0] >= pair[1]) {
            let found = format!("{} after {}", pair[1], pair[0]);
            return Err(Error::invalid("tables.nodes", found, "ascending ones"));
        }
        self.nodes.iter().try_for_each(|&nodes| self.kind.check(nodes, dof))
    }

    /// Of a study cut short: its smallest alone, since larger ones take longer to make.
    pub(super) fn shorten(&mut self) {
        self.nodes.truncate(1);
    }
}

/// The BibTeX entries of tables.
pub(super) fn citations_of(sizes: &[TableSizes]) -> impl Iterator<Item = &'static str> {
    sizes.iter().map(|entry| match entry.kind {
        TableKind::Splines | TableKind::PolarSplines => SPLINES,
        TableKind::GeneratingFunction => GENERATING_FUNCTIONS,
    })
}

/// A table, or why there is none.
pub(super) struct MadeTable {
    kind: TableKind,
    nodes: usize,
    dim: usize,
    table: Result<StepTable, String>,
    /// The time that the making of the table took, in seconds.
    seconds: f64,
}

/// The cost of a table: its nodes, its memory and the time of making it.
#[derive(Clone, Debug, Serialize)]
pub(super) struct TableCost {
    pub(super) name: String,
    pub(super) nodes: usize,
    pub(super) bytes: usize,
    pub(super) seconds: f64,
    /// The reason why the table could not be made, if it could not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) failure: Option<String>,
}

/// All tables of a flow map, around these points.
pub(super) fn make(
    context: &mut Context<'_>,
    sizes: &[TableSizes],
    time: f64,
    points: &[f64],
    flow: FlowOfPoints<'_>,
) -> Result<Vec<MadeTable>, RunError> {
    let dof = context.system()?.dof();
    let mut out = Vec::new();
    for entry in sizes {
        for &nodes in &entry.nodes {
            let kind = entry.kind;
            let stage = format!("{}, {nodes} nodes, time {time}", kind.name());
            let table =
                context.stage(&stage, |_| StepTable::of_flow(kind, nodes, dof, points, flow));
            let seconds = context.seconds_of(&stage);
            let table = table.map_err(|reason| reason.to_string());
            out.push(MadeTable { kind, nodes, dim: 2 * dof, table, seconds });
            if context.interrupted() {
                return Err(RunError::Interrupted);
            }
        }
    }
    Ok(out)
}

impl MadeTable {
    pub(super) fn kind(&self) -> TableKind {
        self.kind
    }

    pub(super) fn nodes(&self) -> usize {
        self.nodes
    }

    /// [`StepTable::trajectories`], or why there is no table.
    pub(super) fn trajectories(
        &self,
        initial: &[f64],
        every: usize,
        kept: usize,
    ) -> Result<Vec<f64>, Error> {
        match &self.table {
            Ok(table) => Ok(table.trajectories(initial, every, kept)),
            Err(reason) => {
                Err(Error::invalid(self.kind.name(), format!("{} nodes", self.nodes), reason))
            }
        }
    }

    /// A method by its trajectories together and, one call each, alone, the latter of so many units.
    pub(super) fn method<'a>(
        &'a self,
        (together, alone): (&'a [f64], &'a [f64]),
        (every, kept): (usize, usize),
        units: f64,
    ) -> Method<'a> {
        let from = move |initial: &[f64]| self.trajectories(initial, every, kept);
        let each = move || {
            let mut out = Vec::with_capacity(alone.len() * kept);
            for point in alone.chunks_exact(self.dim) {
                out.extend(from(point)?);
            }
            Ok(out)
        };
        Method::new(self.kind.name(), Some(self.nodes as f64), move || from(together))
            .beside_alone(units, each)
    }

    pub(super) fn cost(&self) -> TableCost {
        let bytes = self.table.as_ref().map_or(0, StepTable::bytes);
        let (name, nodes) = (self.kind.name().to_owned(), self.nodes);
        let failure = self.table.as_ref().err().cloned();
        TableCost { name, nodes, bytes, seconds: self.seconds, failure }
    }
}

impl TableCost {
    /// What was paid before the first step of a rival, if it is a table.
    pub(super) fn seconds_of(all: &[Self], rival: &WorkPrecision) -> f64 {
        let same =
            |cost: &&Self| cost.name == rival.name && Some(cost.nodes as f64) == rival.setting;
        all.iter().find(same).map_or(0.0, |cost| cost.seconds)
    }

    /// What tables cost, in words.
    pub(super) fn words(all: &[Self]) -> Option<Block> {
        const MEGABYTE: f64 = 1e6;
        let of = |cost: &Self| {
            let Self { name, nodes, .. } = cost;
            let size = Format::Significant.number(cost.bytes as f64 / MEGABYTE);
            let seconds = Format::Fixed(1).number(cost.seconds);
            match &cost.failure {
                None => format!(
                    "- {name}, {nodes} nodes along each axis: {size} MB, made in {seconds} s.\n"
                ),
                Some(reason) => {
                    format!("- {name}, {nodes} nodes along each axis: none, {reason}.\n")
                }
            }
        };
        let words: String = all.iter().map(of).collect();
        const HOW: &str = "Tables move one point after another, on no lanes; between two numbers of nodes times are \
                           interpolated. Where points are taken several times over their nodes stay in the cache, \
                           which favours tables.\n\n";
        (!words.is_empty()).then(|| Block::Text(format!("{HOW}{words}")))
    }
}

/// A curve of a rival, with the setting that errs no more than something.
pub(super) fn named(rival: &WorkPrecision) -> String {
    let unit = if TableKind::is_named(&rival.name) { "nodes along each axis" } else { "steps" };
    format!("{}, {} {unit} or fewer", rival.name, rival.setting.unwrap_or(f64::NAN))
}
