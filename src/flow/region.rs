//! Boxes in phase space.

use crate::error::Error;
use serde::{Deserialize, Serialize};

/// Fails unless both corners are of 2n finite numbers and low ≤ high.
pub(super) fn check_box(name: &str, dof: usize, low: &[f64], high: &[f64]) -> Result<(), Error> {
    for (corner, values) in [("low", low), ("high", high)] {
        let place = format!("{name}: {corner}");
        Error::check_count(&format!("{place}: numbers"), 2 * dof, values.len())?;
        values.iter().try_for_each(|v| Error::check_finite(&place, *v))?;
    }
    (0..2 * dof).try_for_each(|k| {
        Error::check_range(&format!("{name}: low[{k}]"), low[k], f64::MIN, high[k])
    })
}

/// A box in phase space that points lie in: where a network was trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// The lower corner, 2n numbers.
    pub low: Vec<f64>,
    /// The upper corner, 2n numbers.
    pub high: Vec<f64>,
}

impl Region {
    /// The smallest box around points of `dim` numbers each; None without points.
    pub fn around<'a>(dim: usize, points: impl IntoIterator<Item = &'a [f64]>) -> Option<Self> {
        let mut points = points.into_iter().flat_map(|points| points.chunks_exact(dim));
        let first = points.next()?;
        let mut out = Self { low: first.to_vec(), high: first.to_vec() };
        for z in points {
            for ((low, high), z) in out.low.iter_mut().zip(&mut out.high).zip(z) {
                *low = if *z < *low { *z } else { *low };
                *high = if *z > *high { *z } else { *high };
            }
        }
        Some(out)
    }

    /// Fails unless both corners are of 2n finite numbers and low ≤ high.
    ///
    /// # Errors
    /// [`Error::WrongCount`] or [`Error::OutOfRange`], with the region's `name`.
    pub fn check(&self, name: &str, dof: usize) -> Result<(), Error> {
        check_box(name, dof, &self.low, &self.high)
    }

    /// The index of the first coordinate of a point that is outside the box; NaN counts as outside.
    pub fn first_outside(&self, z: &[f64]) -> Option<usize> {
        let within = |(z, (low, high)): (&f64, (&f64, &f64))| (*low..=*high).contains(z);
        z.iter().zip(self.low.iter().zip(&self.high)).position(|one| !within(one))
    }

    /// The box widened on each side by `share` of its width.
    #[must_use]
    pub fn widened(&self, share: f64) -> Self {
        let mut out = self.clone();
        for (low, high) in out.low.iter_mut().zip(&mut out.high) {
            let more = share * (*high - *low);
            (*low, *high) = (*low - more, *high + more);
        }
        out
    }

    /// The box widened on each side by a hundredth of its width. Trajectories count as outside only beyond this
    /// margin, since a model with a small error steps over the border.
    #[must_use]
    pub fn with_margin(&self) -> Self {
        let mut around = self.widened(0.01);
        // A coordinate that never changes has no width.
        for (low, high) in around.low.iter_mut().zip(&mut around.high) {
            let rounding = 1e-9 * low.abs().max(high.abs());
            (*low, *high) = (*low - rounding, *high + rounding);
        }
        around
    }

    /// The states outside the box [with a margin](Region::with_margin), among those of M = `points`
    /// trajectories, (T, M, 2n), with one state in `every` kept. None when all are inside.
    pub fn left_by(&self, values: &[f64], points: usize, every: usize) -> Option<RegionExit> {
        let around = self.with_margin();
        let dim = self.low.len();
        let outside = |z: &[f64]| {
            let coordinate = around.first_outside(z)?;
            // What is no number has left before, and a section: see [`SectionExit`].
            let value = z[coordinate];
            (!value.is_nan()).then_some(OutsideRegion { coordinate, value })
        };
        let outside = values.chunks_exact(dim).map(outside);
        RegionExit::first_of(outside, points, every)
    }
}

/// The kept states of some trajectories that are outside a box, with details of the first one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Exit<T> {
    /// The rows of the initial points whose trajectories have a state outside.
    pub rows: Vec<usize>,
    /// The number of kept states outside.
    pub states: usize,
    /// The number of all kept states.
    #[serde(rename = "of")]
    pub kept: usize,
    /// The row, among the initial points, of the trajectory to which the first state outside belongs.
    pub row: usize,
    /// The number of steps after which that trajectory is outside for the first time.
    pub step: usize,
    /// How the first state outside is outside.
    #[serde(flatten)]
    pub first: T,
}

/// States outside the box of the training points.
pub type RegionExit = Exit<OutsideRegion>;

/// States outside the box of a network's polynomials.
pub type PolynomialExit = Exit<OutsidePolynomials>;

/// States outside the box of a section, or where polynomials have no finite image.
pub type SectionExit = Exit<OutsideSection>;

/// A state outside of the box of its section: nothing is known of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OutsideSection {}

/// The first coordinate of a state that is outside of a region.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OutsideRegion {
    /// The number of the coordinate, from 0, that is outside.
    pub coordinate: usize,
    /// The value of that coordinate.
    pub value: f64,
}

/// How far outside of the box of a network's polynomials a state is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OutsidePolynomials {
    /// The largest argument of a polynomial in a step from there, which is at most 1 in the box.
    pub reach: f64,
}

impl<T> Exit<T> {
    /// Collects the states outside, for M = `points` trajectories, (T, M), with one state in `every`
    /// kept: `outside` says for each state how it is outside, if it is. None when no state is outside.
    pub fn first_of(
        outside: impl IntoIterator<Item = Option<T>>,
        points: usize,
        every: usize,
    ) -> Option<Self> {
        let mut leaving = vec![false; points];
        let (mut out, mut kept): (Option<Self>, usize) = (None, 0);
        for (index, first) in outside.into_iter().enumerate() {
            kept += 1;
            let Some(first) = first else { continue };
            let row = index % points;
            leaving[row] = true;
            let step = index / points * every;
            let begin = || Self { rows: vec![], states: 0, kept: 0, row, step, first };
            out.get_or_insert_with(begin).states += 1;
        }
        let rows = (0..points).filter(|row| leaving[*row]).collect();
        out.map(|out| Self { rows, kept, ..out })
    }

    /// That the states are outside of `what`, and of the first of them where it is.
    fn sentence(&self, what: &str, first: &str) -> String {
        /// The largest number of rows that the sentence names.
        const NAMED: usize = 20;
        let Self { rows, states, kept, row, step, .. } = self;
        let named: Vec<String> = rows.iter().take(NAMED).map(usize::to_string).collect();
        let more = if rows.len() > NAMED { ", …" } else { "" };
        let (trajectories, named) = (rows.len(), named.join(", "));
        let plural = if trajectories == 1 { "y" } else { "ies" };
        let verb = if *states == 1 { "is" } else { "are" };
        let when = match step {
            0 => "at the start".to_owned(),
            1 => "after 1 step".to_owned(),
            step => format!("after {step} steps"),
        };
        format!(
            "{states} of {kept} kept states, of {trajectories} trajector{plural}, {verb} outside the box \
             of {what}: of the input's rows {named}{more}, the first from row {row} {when}: {first}"
        )
    }
}

/// States (T, M, dim), `row` numbers for each time, become NaN from the first on that is not of finite numbers: what
/// has left a section once, or the numbers that polynomials have an image of, is lost, whatever a map makes of it.
pub(crate) fn lose_rest(states: &mut [f64], row: usize, dim: usize) {
    for k in (0..states.len()).step_by(dim) {
        let is_lost = |z: &[f64]| z.iter().any(|v| !v.is_finite());
        let before =
            k.checked_sub(row).is_some_and(|before| is_lost(&states[before..before + dim]));
        if before || is_lost(&states[k..k + dim]) {
            states[k..k + dim].fill(f64::NAN);
        }
    }
}

impl SectionExit {
    /// The states of `points` trajectories, (T, M, 2n), that are no numbers, since their orbits are lost: one state in
    /// `every` is kept. None if all are numbers.
    pub fn in_states(values: &[f64], dof: usize, points: usize, every: usize) -> Option<Self> {
        let lost = |z: &[f64]| z.iter().any(|v| v.is_nan()).then_some(OutsideSection {});
        Self::first_of(values.chunks_exact(2 * dof).map(lost), points, every)
    }

    /// Says in words which states are outside, and the first of them. Without a section they are those of a polynomial,
    /// which has no image so far out.
    pub fn describe(&self, has_section: bool) -> String {
        let what = if has_section {
            "the section"
        } else {
            "the pairs, where the map has no finite image"
        };
        self.sentence(what, "it and all later ones are NaN")
    }
}

impl RegionExit {
    /// Says in words which states are outside, and the first of them, whose coordinates are those of a section or q and
    /// p.
    pub fn describe(&self, region: &Region, has_section: bool) -> String {
        let OutsideRegion { coordinate, value } = self.first;
        let dof = region.low.len() / 2;
        let [first, second] = if has_section { ["x", "y"] } else { ["q", "p"] };
        let half = if coordinate < dof { first } else { second };
        let (low, high) = (region.low[coordinate], region.high[coordinate]);
        let first = format!(
            "{half}{} = {value:.3e}, not from {low:.3e} to {high:.3e}",
            coordinate % dof + 1
        );
        self.sentence("the training points, where nothing is known of the model", &first)
    }
}

impl PolynomialExit {
    /// Says in words which states are outside, and the first of them.
    pub fn describe(&self) -> String {
        let first = format!("{:.3} times half its width", self.first.reach);
        self.sentence("the model's polynomials, which grow without a bound beyond", &first)
    }
}
