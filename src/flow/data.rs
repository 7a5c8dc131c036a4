//! Data sets: seeded samples in windows, and pairs of a flow map.

use super::region::check_box;
use super::{Integrator, Reference, Region};
use crate::digest;
use crate::error::Error;
use crate::phase::Units;
use crate::random::Stream;
use crate::scalar::max_or_nan;
use crate::system::{Hamiltonian, System};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeSet;

/// A box in phase space and how many points to draw in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Window {
    /// The lower corner, 2n numbers.
    pub low: Vec<f64>,
    /// The upper corner, 2n numbers.
    pub high: Vec<f64>,
    /// The number of points that are drawn from the window.
    pub samples: usize,
}

impl Window {
    /// Fails unless both corners are of 2n finite numbers and low ≤ high.
    ///
    /// # Errors
    /// [`Error::WrongCount`] or [`Error::OutOfRange`], with the window's `name`.
    pub fn check(&self, name: &str, dof: usize) -> Result<(), Error> {
        check_box(name, dof, &self.low, &self.high)
    }
}

/// Points drawn uniformly in the windows, one window after the other: an array
/// (N, 2n).
///
/// # Errors
/// When a corner is not of 2n finite numbers, or low > high somewhere.
pub fn sample(windows: &[Window], dof: usize, stream: &mut Stream) -> Result<Vec<f64>, Error> {
    sample_where(windows, dof, stream, |_| Ok(()))
}

/// As [`sample`], but only points at which the system is defined are kept.
///
/// # Errors
/// Those of [`sample`]; the system's reason when it is defined at none of 10,000 successive draws in a window.
pub fn sample_of(
    system: &impl Hamiltonian,
    windows: &[Window],
    stream: &mut Stream,
) -> Result<Vec<f64>, Error> {
    sample_where(windows, system.dof(), stream, |z| system.check_point(z))
}

fn sample_where(
    windows: &[Window],
    dof: usize,
    stream: &mut Stream,
    check: impl Fn(&[f64]) -> Result<(), Error>,
) -> Result<Vec<f64>, Error> {
    /// Draws in a row without a point: a window that has so few is in the wrong place.
    const MOST: usize = 10_000;
    let mut points = Vec::new();
    for (index, window) in windows.iter().enumerate() {
        let place = format!("window {index}");
        window.check(&place, dof)?;
        for _ in 0..window.samples {
            let first = points.len();
            for draw in 1.. {
                for (low, high) in window.low.iter().zip(&window.high) {
                    points.push(stream.uniform(*low, *high));
                }
                match check(&points[first..]) {
                    Ok(()) => break,
                    Err(reason) if draw == MOST => return Err(reason.with_place(place)),
                    Err(_) => points.truncate(first),
                }
            }
        }
    }
    Ok(points)
}

/// At most 256 of the rows, evenly spaced: those that have their errors estimated.
fn judged(rows: &[f64], dim: usize) -> Vec<f64> {
    const MOST: usize = 256;
    let stride = (rows.len() / dim).div_ceil(MOST).max(1);
    rows.chunks_exact(dim).step_by(stride).flatten().copied().collect()
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan)
}

/// The member of a family of maps to which a run of pairs belongs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// The parameter ε of the system.
    pub epsilon: f64,
    /// Its flow time, in units of the flow time of the network that is trained on it.
    pub time: f64,
    /// The weight of the squared errors of its pairs in a loss.
    pub weight: f64,
    /// The number of pairs of this map.
    pub pairs: usize,
    /// The values of the controls λ; empty in a family without controls.
    pub controls: Vec<f64>,
}

impl Condition {
    /// Whether it is of the same ε and time, but for rounding, in single precision too.
    pub fn is_of(&self, epsilon: f64, time: f64) -> bool {
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b.abs();
        near(self.epsilon, epsilon) && near(self.time, time)
    }
}

/// Pairs (z, P(z)) of a map, or of a family of maps: two arrays (N, 2n), columns q₁…qₙ, p₁…pₙ.
/// In a family, each run of consecutive pairs belongs to one [`Condition`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pairs {
    dof: usize,
    input: Vec<f64>,
    output: Vec<f64>,
    /// Of consecutive runs; none where all pairs are of one map.
    conditions: Vec<Condition>,
}

impl Pairs {
    /// Pairs from two arrays, row by row. `place` names them in errors.
    ///
    /// # Errors
    /// When the lengths differ, are zero or are no multiple of 2n, or a number
    /// is not finite.
    pub fn new(place: &str, dof: usize, input: Vec<f64>, output: Vec<f64>) -> Result<Self, Error> {
        let dim = 2 * dof;
        for (name, array) in [("input", &input), ("output", &output)] {
            let place = format!("{place}: {name}");
            Error::check_rows(&place, array.len(), dim)?;
            check_finite(&place, array, dim)?;
        }
        let rows = input.len() / dim;
        Error::check_count(&format!("{place}: rows of output"), rows, output.len() / dim)?;
        Error::check_count_range(&format!("{place}: rows of input"), rows, 1, usize::MAX)?;
        Ok(Self { dof, input, output, conditions: Vec::new() })
    }

    /// These pairs as pairs of a family: row k has ε `epsilons[k]` and the flow time `times[k]`. Pairs of
    /// one condition are made consecutive; conditions keep the order of their first appearance.
    ///
    /// # Errors
    /// When there is not one finite number for each pair, or a time is not positive.
    pub fn with_epsilons_and_times(self, epsilons: &[f64], times: &[f64]) -> Result<Self, Error> {
        self.under_controls(epsilons, times, &[])
    }

    /// The pairs of [`Pairs::with_epsilons_and_times`], with values of controls too: as many for each pair, row by row.
    ///
    /// # Errors
    /// Those of [`Pairs::with_epsilons_and_times`]; when there are not as many finite values for each pair.
    pub fn under_controls(
        self,
        epsilons: &[f64],
        times: &[f64],
        controls: &[f64],
    ) -> Result<Self, Error> {
        let count = self.len();
        let columns = controls.len() / count;
        Error::check_count("values of controls", columns * count, controls.len())?;
        check_finite("controls", controls, columns.max(1))?;
        Error::check_count("values of ε", count, epsilons.len())?;
        Error::check_count("flow times", count, times.len())?;
        epsilons.iter().try_for_each(|epsilon| Error::check_finite("epsilon", *epsilon))?;
        for time in times {
            Error::check_range("flow_time", *time, Error::LEAST_POSITIVE, f64::MAX)?;
        }
        /// A map for each pair is taken for a mistake.
        const MOST: usize = 1000;
        let mut conditions: Vec<Condition> = Vec::new();
        let mut of_row = Vec::with_capacity(count);
        for (row, (&epsilon, &time)) in epsilons.iter().zip(times).enumerate() {
            let controls = &controls[row * columns..(row + 1) * columns];
            let same =
                |c: &Condition| c.epsilon == epsilon && c.time == time && c.controls == controls;
            let found = conditions.iter().position(same).unwrap_or_else(|| {
                let (weight, pairs, controls) = (1.0, 0, controls.to_vec());
                conditions.push(Condition { epsilon, time, weight, pairs, controls });
                conditions.len() - 1
            });
            if conditions.len() > MOST {
                let found = format!("more than {MOST} different ones");
                let expected = format!("at most {MOST}, each for several pairs");
                return Err(Error::invalid("values of ε, flow time and controls", found, expected));
            }
            conditions[found].pairs += 1;
            of_row.push(found);
        }
        let mut rows: Vec<usize> = (0..count).collect();
        rows.sort_by_key(|row| of_row[*row]);
        let plain = Self { conditions: Vec::new(), ..self };
        Ok(Self { conditions, ..plain.rows(rows) })
    }

    /// The pairs of several sets, one set after another, each under its own ε and flow time.
    ///
    /// # Errors
    /// When there is no set, or they differ in their degrees of freedom; those of
    /// [`Pairs::with_epsilons_and_times`].
    pub fn of_family(sets: Vec<(f64, f64, Self)>) -> Result<Self, Error> {
        let Some((_, _, first)) = sets.first() else {
            return Err(Error::invalid("pairs", "no set", "at least one"));
        };
        let mut all = Self { conditions: Vec::new(), ..first.clone() };
        let (mut epsilons, mut times) = (Vec::new(), Vec::new());
        for (number, (epsilon, time, set)) in sets.iter().enumerate() {
            Error::check_count("degrees of freedom", all.dof, set.dof)?;
            epsilons.extend(std::iter::repeat_n(*epsilon, set.len()));
            times.extend(std::iter::repeat_n(*time, set.len()));
            if number > 0 {
                all.input.extend_from_slice(&set.input);
                all.output.extend_from_slice(&set.output);
            }
        }
        all.with_epsilons_and_times(&epsilons, &times)
    }

    /// These pairs with the ε and the flow time of each condition replaced by those that `of` returns.
    #[must_use]
    pub fn with_conditions(mut self, of: impl Fn(&Condition) -> (f64, f64)) -> Self {
        for condition in &mut self.conditions {
            (condition.epsilon, condition.time) = of(condition);
        }
        self
    }

    /// The pairs of those maps whose condition is one of these, in their order; all, where they have no conditions; None
    /// where none are left.
    pub fn under_conditions(&self, is_of: impl Fn(&Condition) -> bool) -> Option<Self> {
        if self.conditions.is_empty() {
            return Some(self.clone());
        }
        let mut first = 0;
        let mut rows = Vec::new();
        for condition in &self.conditions {
            let run = first..first + condition.pairs;
            first = run.end;
            if is_of(condition) {
                rows.extend(run);
            }
        }
        (!rows.is_empty()).then(|| self.rows(rows))
    }

    /// These pairs with squared errors weighted by (εt)⁻², normalised to mean 1 over all pairs:
    /// the error of each map is measured relative to its distance from its rotation, which is of
    /// order εt.
    ///
    /// # Errors
    /// When one of several ε is 0.
    pub fn relative(mut self) -> Result<Self, Error> {
        let count = self.len() as f64;
        let slow = |c: &Condition| c.epsilon * c.time;
        if let Some(condition) = self.conditions.iter().find(|c| slow(c) == 0.0) {
            let expected = "another number: errors are measured by ε times the flow time";
            return Err(Error::invalid("epsilon", condition.epsilon, expected));
        }
        let of = |c: &Condition| c.pairs as f64 / (slow(c) * slow(c));
        let mean: f64 = self.conditions.iter().map(of).sum::<f64>() / count;
        for condition in &mut self.conditions {
            condition.weight = 1.0 / (slow(condition) * slow(condition) * mean);
        }
        Ok(self)
    }

    /// The conditions of the runs of pairs, in order; empty when all pairs are of one map.
    pub fn conditions(&self) -> &[Condition] {
        &self.conditions
    }

    /// The pairs at the control values nearest to the middle of their ranges, as pairs of one map, when the conditions
    /// differ only in their controls; otherwise all pairs, unchanged.
    pub(crate) fn at_middle_of_controls(&self) -> Cow<'_, Self> {
        let Some(first) = self.conditions.first() else { return Cow::Borrowed(self) };
        let same = |c: &Condition| c.epsilon == first.epsilon && c.time == first.time;
        if first.controls.is_empty() || !self.conditions.iter().all(same) {
            return Cow::Borrowed(self);
        }
        let values: Vec<&[f64]> = self.conditions.iter().map(|c| &*c.controls).collect();
        let ends = ends_of(&values);
        let far = |condition: &Condition| off_middle(&condition.controls, &ends);
        let (mut first, mut nearest) = (0, (f64::INFINITY, 0..0));
        for condition in &self.conditions {
            let run = first..first + condition.pairs;
            first = run.end;
            if far(condition) < nearest.0 {
                nearest = (far(condition), run);
            }
        }
        Cow::Owned(Self { conditions: Vec::new(), ..self.rows(nearest.1) })
    }

    /// Inputs and outputs of each run, with its condition; None where all pairs are of one
    /// map.
    pub(crate) fn runs(&self) -> Vec<(Option<&Condition>, &[f64], &[f64])> {
        if self.conditions.is_empty() {
            return vec![(None, &self.input, &self.output)];
        }
        let (mut first, mut out) = (0, Vec::new());
        for condition in &self.conditions {
            let numbers = first..first + condition.pairs * 2 * self.dof;
            first = numbers.end;
            out.push((Some(condition), &self.input[numbers.clone()], &self.output[numbers]));
        }
        out
    }

    /// These pairs in other coordinates: `map` moves the inputs of each run of them, then its
    /// outputs, under its condition.
    ///
    /// # Errors
    /// Those of `map`; when a number is not finite after it, which `place` names.
    pub(crate) fn transformed(
        &self,
        place: &str,
        map: impl Fn(Option<&Condition>, &mut [f64]) -> Result<(), Error>,
    ) -> Result<Self, Error> {
        let (mut input, mut output) = (Vec::new(), Vec::new());
        for (condition, inputs, outputs) in self.runs() {
            for (points, all) in [(inputs, &mut input), (outputs, &mut output)] {
                let first = all.len();
                all.extend_from_slice(points);
                map(condition, &mut all[first..])?;
            }
        }
        let plain = Self::new(place, self.dof, input, output)?;
        Ok(Self { conditions: self.conditions.clone(), ..plain })
    }

    /// These pairs in the coordinates of a network with such units.
    ///
    /// # Errors
    /// [`Error::NotFinite`] when a number is not finite in them, which `place` names.
    pub fn to_network(&self, place: &str, units: &Units) -> Result<Self, Error> {
        self.transformed(place, |_, points| {
            units.to_network(points);
            Ok(())
        })
    }

    /// The time-`time` flow map of `system` at these points, with the largest
    /// error estimate of the reference over 256 of them, evenly spaced.
    ///
    /// # Errors
    /// When the flow fails at a point ([`Reference::flow`]), or the points are
    /// none or no whole rows ([`Pairs::new`]).
    pub fn of_flow(
        system: &(impl Hamiltonian + Sync),
        points: Vec<f64>,
        time: f64,
    ) -> Result<(Self, f64), Error> {
        let dim = 2 * system.dof();
        let reference = Reference::calibrated(system, &points, time)?;
        let mut output = points.clone();
        reference.move_all(system, &mut output, time, 1)?;
        let judged = |rows: &[f64]| judged(rows, dim);
        let (mut finer, found) = (judged(&points), judged(&output));
        reference.finer().move_all(system, &mut finer, time, 1)?;
        let error = largest_difference(&finer, &found);
        Ok((Self::new("flow map", system.dof(), points, output)?, error))
    }

    /// The time-`time` flow map of `system` at points drawn in windows with this seed.
    ///
    /// # Errors
    /// Those of [`sample_of`] and [`Pairs::of_flow`].
    pub fn of_windows(
        system: &(impl Hamiltonian + Sync),
        windows: &[Window],
        time: f64,
        seed: u64,
    ) -> Result<Self, Error> {
        let points = sample_of(system, windows, &mut Stream::new(seed, "data/training"))?;
        Ok(Self::of_flow(system, points, time)?.0)
    }

    /// The map of `steps` steps of an integrator over `time` at these points, and its error estimate:
    /// the largest difference of a component from a finer result, at no more than 256 of them, evenly
    /// spaced. The finer result takes twice as many steps; for stroboscopic averaging also a finer map
    /// of a period and one more difference; for an averaged equation or a multi-revolution composition
    /// it is by stroboscopic averaging of sixth order. A splitting takes far less work than
    /// [`Pairs::of_flow`] when fewer digits are needed.
    ///
    /// # Errors
    /// Those of [`Integrator::trajectories`] and [`Pairs::new`]; when either map leaves the finite
    /// numbers.
    pub fn of_integrator(
        system: &System,
        points: Vec<f64>,
        time: f64,
        integrator: Integrator,
        steps: usize,
    ) -> Result<(Self, f64), Error> {
        let output = integrator.trajectories(system, &points, time, steps, 1)?;
        let dim = 2 * system.dof();
        let judged = |rows: &[f64]| judged(rows, dim);
        let (input, found) = (judged(&points), judged(&output));
        let finer = integrator.finer_trajectories(system, &input, time, steps, 1)?;
        let error = largest_difference(&finer, &found);
        integrator.check_finite(error, time)?;
        Ok((Self::new(&integrator.name(), system.dof(), points, output)?, error))
    }

    /// The same pairs with reordered columns: column k is the former column `order[k]`.
    ///
    /// # Panics
    /// When an index is not below 2n.
    pub fn with_columns(&self, order: &[usize]) -> Self {
        let dim = 2 * self.dof;
        let of = |values: &[f64]| -> Vec<f64> {
            values.chunks_exact(dim).flat_map(|z| order.iter().map(|&k| z[k])).collect()
        };
        Self { input: of(&self.input), output: of(&self.output), ..self.clone() }
    }

    /// The smallest box around all inputs and outputs; None without pairs.
    pub fn region(&self) -> Option<Region> {
        Region::around(2 * self.dof, [&self.input[..], &self.output[..]])
    }

    /// The number of inputs that differ in some bit.
    pub(crate) fn different_inputs(&self) -> usize {
        let rows = self.input.chunks_exact(2 * self.dof);
        let bits = |z: &[f64]| z.iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
        rows.map(bits).collect::<BTreeSet<_>>().len()
    }

    /// Fails if the largest of these numbers is so large or so small that sums of their squares, of which fits are
    /// made, overflow or lose digits.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] with the largest absolute value, unless all are 0.
    pub(crate) fn check_squares(&self, place: &str) -> Result<(), Error> {
        /// Squares of these are finite and of full precision, and so are their sums.
        const RANGE: [f64; 2] = [1e-150, 1e150];
        let all = self.input.iter().chain(&self.output);
        let largest = all.map(|v| v.abs()).fold(0.0, max_or_nan);
        if largest == 0.0 {
            return Ok(());
        }
        let name = format!("{place}: largest absolute value");
        Error::check_range(&name, largest, RANGE[0], RANGE[1])
    }

    /// The degrees of freedom n.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// The number N of pairs.
    pub fn len(&self) -> usize {
        self.input.len() / (2 * self.dof)
    }

    /// Whether there are no pairs, which [`Pairs::new`] refuses.
    pub fn is_empty(&self) -> bool {
        self.input.is_empty()
    }

    /// The inputs z of the map, row by row: (N, 2n).
    pub fn input(&self) -> &[f64] {
        &self.input
    }

    /// The outputs P(z) of the map, row by row: (N, 2n).
    pub fn output(&self) -> &[f64] {
        &self.output
    }

    /// The inputs and the outputs, (N, 2n) each.
    pub fn points(&self) -> [&[f64]; 2] {
        [&self.input, &self.output]
    }

    /// Splits off `fraction` of the pairs, chosen by `stream`: (rest, split
    /// off). At least one pair stays; the second is None when `fraction` of the pairs rounds to
    /// none.
    pub fn split(self, fraction: f64, stream: &mut Stream) -> (Self, Option<Self>) {
        let count = self.len();
        let held = ((count as f64 * fraction).round() as usize).min(count.saturating_sub(1));
        if held == 0 {
            return (self, None);
        }
        let mut order: Vec<usize> = (0..count).collect();
        stream.shuffle(&mut order);
        let (held_rows, kept_rows) = order.split_at(held);
        let take = |rows: &[usize]| {
            let mut rows = rows.to_vec();
            rows.sort_unstable();
            self.rows(rows)
        };
        (take(kept_rows), Some(take(held_rows)))
    }

    /// Splits off all pairs of a `fraction` of the distinct control values, at least one, chosen by `stream`: (rest,
    /// split off). Values at an end of the range of a control stay, as do those nearest to the middle of all ranges.
    /// None when there are fewer than five distinct values, or when none can be split off.
    pub fn split_by_controls(&self, fraction: f64, stream: &mut Stream) -> Option<(Self, Self)> {
        const FEWEST: usize = 5;
        let mut values: Vec<&[f64]> = self.conditions.iter().map(|c| &*c.controls).collect();
        values.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        values.dedup();
        if values.len() < FEWEST || values[0].is_empty() || !(fraction > 0.0) {
            return None;
        }
        let ends = ends_of(&values);
        let middle =
            values.iter().min_by(|a, b| off_middle(a, &ends).total_cmp(&off_middle(b, &ends)));
        let inner = |row: &&[f64]| {
            let within = |(value, [low, high]): (&f64, &[f64; 2])| value > low && value < high;
            row.iter().zip(&ends).all(within) && Some(row) != middle
        };
        let mut inner: Vec<&[f64]> = values.iter().copied().filter(inner).collect();
        stream.shuffle(&mut inner);
        let wanted = ((values.len() as f64 * fraction).round() as usize).max(1);
        inner.truncate(wanted);
        let (mut first, mut rows) = (0, [Vec::new(), Vec::new()]);
        for condition in &self.conditions {
            let held_out = inner.contains(&&*condition.controls);
            rows[usize::from(held_out)].extend(first..first + condition.pairs);
            first += condition.pairs;
        }
        let [kept, held_out] = rows;
        (!held_out.is_empty()).then(|| (self.rows(kept), self.rows(held_out)))
    }

    /// The pairs of these rows; in a family they are grouped by condition.
    ///
    /// # Panics
    /// When there is no such row.
    pub fn rows(&self, rows: impl IntoIterator<Item = usize>) -> Self {
        if self.conditions.is_empty() {
            return self.plain_rows(rows.into_iter());
        }
        let ends: Vec<usize> = self
            .conditions
            .iter()
            .scan(0, |end, condition| {
                *end += condition.pairs;
                Some(*end)
            })
            .collect();
        let run = |row: &usize| ends.partition_point(|end| end <= row);
        let mut rows: Vec<usize> = rows.into_iter().collect();
        rows.sort_by_key(run);
        let mut conditions = self.conditions.clone();
        conditions.iter_mut().for_each(|condition| condition.pairs = 0);
        rows.iter().for_each(|row| conditions[run(row)].pairs += 1);
        conditions.retain(|condition| condition.pairs > 0);
        Self { conditions, ..self.plain_rows(rows.into_iter()) }
    }

    fn plain_rows(&self, rows: impl Iterator<Item = usize>) -> Self {
        let dim = 2 * self.dof;
        let space = || Vec::with_capacity(rows.size_hint().0 * dim);
        let (input, output) = (space(), space());
        let mut out = Self { dof: self.dof, input, output, conditions: Vec::new() };
        for row in rows {
            out.input.extend_from_slice(&self.input[row * dim..(row + 1) * dim]);
            out.output.extend_from_slice(&self.output[row * dim..(row + 1) * dim]);
        }
        out
    }

    /// `count` of the pairs, evenly spaced, or all of them when there are fewer.
    pub fn thinned(&self, count: usize) -> Self {
        self.thinned_in_turn(count, 0)
    }

    /// As [`Pairs::thinned`], shifted by `turn`: successive turns give disjoint subsets until the
    /// shifts repeat.
    pub(crate) fn thinned_in_turn(&self, count: usize, turn: u64) -> Self {
        let (all, count) = (self.len() as u128, count.min(self.len()) as u128);
        let shift = u128::from(turn) % (all / count.max(1)).max(1);
        self.rows((0..count).map(|k| (k * all / count + shift) as usize))
    }

    /// SHA-256 of the numbers, in hexadecimal, as it stands in a model's provenance.
    pub fn digest(&self) -> String {
        let dof = self.dof as f64;
        let of = |c: &Condition| [c.epsilon, c.time, c.weight, c.pairs as f64];
        let conditions: Vec<f64> = self
            .conditions
            .iter()
            .flat_map(|c| of(c).into_iter().chain(c.controls.clone()))
            .collect();
        let numbers = std::iter::once(&dof).chain(&self.input).chain(&self.output);
        digest::of_numbers(numbers.chain(&conditions))
    }
}

/// The ends of the range of each control.
fn ends_of(values: &[&[f64]]) -> Vec<[f64; 2]> {
    let end = |k: usize, of: fn(f64, f64) -> f64| values.iter().map(|row| row[k]).reduce(of);
    let count = values.first().map_or(0, |row| row.len());
    // no NaN: values of conditions are finite
    let both = |k: usize| [end(k, f64::min), end(k, f64::max)].map(Option::unwrap_or_default);
    (0..count).map(both).collect()
}

/// The square of how far values are from the middle of their ranges, each over its range.
fn off_middle(values: &[f64], ends: &[[f64; 2]]) -> f64 {
    let from_middle = |(value, [low, high]): (&f64, &[f64; 2])| {
        if low < high { (value - 0.5 * (low + high)) / (high - low) } else { 0.0 }
    };
    values.iter().zip(ends).map(from_middle).map(|u| u * u).sum()
}

/// Fails at the first number of an array of `columns` columns that is NaN or
/// infinite, naming its row and column.
///
/// # Errors
/// [`Error::NotFinite`].
pub(crate) fn check_finite(place: &str, array: &[f64], columns: usize) -> Result<(), Error> {
    match array.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(index) => Err(Error::NotFinite {
            place: place.to_owned(),
            row: index / columns,
            column: index % columns,
            value: array[index],
        }),
    }
}
