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

/// A box in phase space and how many points to draw in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Window {
    /// The lower corner, 2n numbers.
    pub low: Vec<f64>,
    /// The upper corner, 2n numbers.
    pub high: Vec<f64>,
    /// The number of points.
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

/// As [`sample`], of the points of the windows at which a system is defined.
///
/// # Errors
/// Those of [`sample`]; where it is defined at none of many points of a window, as it is told there.
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

/// The map that some pairs are of, in a family of maps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition {
    /// The parameter ε of the system.
    pub epsilon: f64,
    /// Its flow time, in units of that of the network which is trained on it.
    pub time: f64,
    /// What the squares of their errors count with in a loss.
    pub weight: f64,
    /// How many pairs are of it.
    pub pairs: usize,
}

/// Pairs (z, P(z)) of a map: two arrays (N, 2n), columns q₁…qₙ, p₁…pₙ. Or of a family
/// of maps: runs of them are under a [`Condition`] each.
#[derive(Clone, Debug, PartialEq)]
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

    /// These pairs, each under the ε and the flow time of its row; those of a condition
    /// come after one another, in the order in which the conditions come first.
    ///
    /// # Errors
    /// When there is not one finite number for each pair, or a time is not positive.
    pub fn under(self, epsilons: &[f64], times: &[f64]) -> Result<Self, Error> {
        let count = self.len();
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
        for (&epsilon, &time) in epsilons.iter().zip(times) {
            let same = |c: &Condition| c.epsilon == epsilon && c.time == time;
            let found = conditions.iter().position(same).unwrap_or_else(|| {
                conditions.push(Condition { epsilon, time, weight: 1.0, pairs: 0 });
                conditions.len() - 1
            });
            Error::check_count_range("maps of a family", conditions.len(), 1, MOST)?;
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
    /// [`Pairs::under`].
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
        all.under(&epsilons, &times)
    }

    /// These pairs with other values of ε and times for each of their conditions.
    #[must_use]
    pub fn with_conditions(mut self, of: impl Fn(Condition) -> (f64, f64)) -> Self {
        for condition in &mut self.conditions {
            (condition.epsilon, condition.time) = of(*condition);
        }
        self
    }

    /// These pairs with squares of errors that count (εt)⁻², times as much as makes the mean
    /// over all pairs 1: each map's error is measured by how far it is from its rotation,
    /// which is of order εt.
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

    /// What runs of the pairs are of, one run after another; none where all are of
    /// one map.
    pub fn conditions(&self) -> &[Condition] {
        &self.conditions
    }

    /// Inputs and outputs of each run, with its condition; None where all pairs are of one
    /// map.
    pub(crate) fn runs(&self) -> Vec<(Option<Condition>, &[f64], &[f64])> {
        if self.conditions.is_empty() {
            return vec![(None, &self.input, &self.output)];
        }
        let (mut first, mut out) = (0, Vec::new());
        for condition in &self.conditions {
            let numbers = first..first + condition.pairs * 2 * self.dof;
            first = numbers.end;
            out.push((Some(*condition), &self.input[numbers.clone()], &self.output[numbers]));
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
        map: impl Fn(Option<Condition>, &mut [f64]) -> Result<(), Error>,
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

    /// The map of `steps` steps of an integrator over `time` at these points, with the largest
    /// difference of a component from that of twice as many steps (of stroboscopic averaging, of a finer
    /// map of a period and one more difference too; of an averaged equation, from that of stroboscopic
    /// averaging of sixth order), at no more than 256 of them,
    /// evenly spaced: for fewer digits than those of [`Pairs::of_flow`] a splitting takes far less
    /// work.
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
        let twice = steps.saturating_mul(2);
        let finer = integrator.finer().checked_trajectories(system, &input, time, twice, 1)?;
        let error = largest_difference(&finer, &found);
        integrator.check_finite(error, time)?;
        Ok((Self::new(&integrator.name(), system.dof(), points, output)?, error))
    }

    /// The same pairs with other columns: number k is what `order[k]` was.
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

    /// The box around their points, of both ends; None of no pairs.
    pub fn region(&self) -> Option<Region> {
        Region::around(2 * self.dof, [&self.input[..], &self.output[..]])
    }

    /// The degrees of freedom n.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// The number N of pairs.
    pub fn len(&self) -> usize {
        self.input.len() / (2 * self.dof)
    }

    /// Never true: an empty set is refused at the border.
    pub fn is_empty(&self) -> bool {
        self.input.is_empty()
    }

    /// z, row by row.
    pub fn input(&self) -> &[f64] {
        &self.input
    }

    /// P(z), row by row.
    pub fn output(&self) -> &[f64] {
        &self.output
    }

    /// Both.
    pub fn points(&self) -> [&[f64]; 2] {
        [&self.input, &self.output]
    }

    /// Splits off `fraction` of the pairs, chosen by `stream`: (rest, split
    /// off). At least one pair stays; none is split off where the share rounds to
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

    /// The pairs of these rows; those of a condition together, where there are several.
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

    /// So many of the pairs, evenly spaced; all, where there are no more.
    pub fn thinned(&self, count: usize) -> Self {
        self.thinned_in_turn(count, 0)
    }

    /// Another part of as many, evenly spaced too, in each turn: no pair is in two of
    /// them until all parts have had theirs.
    pub(crate) fn thinned_in_turn(&self, count: usize, turn: u64) -> Self {
        let (all, count) = (self.len() as u128, count.min(self.len()) as u128);
        let shift = u128::from(turn) % (all / count.max(1)).max(1);
        self.rows((0..count).map(|k| (k * all / count + shift) as usize))
    }

    /// SHA-256 of the numbers, in hexadecimal: what a model's provenance names.
    pub fn digest(&self) -> String {
        let dof = self.dof as f64;
        let of = |c: &Condition| [c.epsilon, c.time, c.weight, c.pairs as f64];
        let conditions: Vec<f64> = self.conditions.iter().flat_map(of).collect();
        let numbers = std::iter::once(&dof).chain(&self.input).chain(&self.output);
        digest::of_numbers(numbers.chain(&conditions))
    }
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
