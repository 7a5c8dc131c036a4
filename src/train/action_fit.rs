//! Finds the circle action of pairs for which none is given.

use super::rotation_fit::{divisor, least_angle};
use crate::error::Error;
use crate::flow::Pairs;
use crate::layer::CircleAction;
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use std::f64::consts::TAU;

/// An estimate of the circle action of pairs, from the linear map that fits them best.
///
/// At ε = 0 plane j turns by m_jθ: its block of the linear map has the eigenvalues exp(±im_jθ) up to a common factor,
/// in any linear units of the plane. Among all weights |m_j| ≤ 3 without a common factor, those are chosen whose
/// angles m_jθ are nearest to the measured ones at the best θ; among weights that are about as near, the simplest.
/// The angles are known only up to whole turns, and a small angle may be that of a slow motion: then the action is
/// not determined, and [`ActionFit::is_sure`] is false.
#[derive(Clone, Debug, PartialEq)]
pub struct ActionFit {
    /// The angle by which each plane turns from an input to its output, in [−π, π]; 0 for planes
    /// that do not turn.
    pub angles: Vec<f64>,
    /// The chosen action, then the others, the nearest first, each with the root mean square over
    /// the planes of |exp(iα_j) − exp(im_jθ)|.
    pub candidates: Vec<(CircleAction, f64)>,
}

/// The chord 2 |sin ½α| of the angle α between two directions.
fn chord(angle: f64) -> f64 {
    2.0 * libm::sin(0.5 * angle).abs()
}

impl ActionFit {
    /// The largest absolute value of the weights m_j that are tried.
    const MOST: i32 = 3;
    /// The largest number of planes: more have too many candidates.
    const MOST_PLANES: usize = 5;
    /// The largest number of pairs that are used.
    const PAIRS: usize = 4000;
    /// What pairs of one flow time leave open. In 0.9 of that time a plane with k more whole turns
    /// turns by 0.2πk less, which gives different angles for ten successive values of k.
    pub(crate) const WHOLE_TURNS: &str = "pairs of one flow time do not show whole turns: those of \
         0.9 times this flow time, beside these, show up to four, and less than half a turn has none";
    /// An action may be the right one below this distance, as a share of how far the planes turn: ε
    /// moves them too.
    const NEAR: f64 = 0.15;
    /// A distance that ε alone may cause.
    const SLOW: f64 = 0.1;
    /// An action this many times as far as the chosen one is clearly not meant.
    const FACTOR: f64 = 3.0;

    /// Fails where there are too many planes.
    pub(crate) fn check_planes(dof: usize) -> Result<(), Error> {
        let name = "planes of an action that is to be found";
        Error::check_count_range(name, dof, 1, Self::MOST_PLANES)
    }

    /// Fits the action to these pairs; with several flow times, to those of the shortest.
    ///
    /// # Errors
    /// When there are more than five planes, or the pairs do not determine a linear map: there are
    /// no more of them than columns, or their inputs lie in a hyperplane.
    pub fn fit(pairs: &Pairs) -> Result<Self, Error> {
        let dof = pairs.dof();
        Self::check_planes(dof)?;
        let angles = plane_angles(&shortest(pairs).thinned(Self::PAIRS))?;
        let mut candidates: Vec<(CircleAction, f64)> = weights(dof)
            .into_iter()
            .map(|weights| {
                let distance = distance(&weights, &angles);
                (CircleAction::new(weights), distance)
            })
            .collect();
        candidates.sort_by(|(_, near), (_, far)| near.total_cmp(far));
        // Larger weights come near any angles: simpler ones that are about as good are meant.
        let best = candidates.first().map_or(0.0, |(_, distance)| *distance);
        let good = Self::SLOW.max(2.0 * best);
        let simplest = (0..candidates.len())
            .filter(|k| candidates[*k].1 <= good)
            .min_by_key(|k| complexity(&candidates[*k].0));
        if let Some(simplest) = simplest {
            let chosen = candidates.remove(simplest);
            candidates.insert(0, chosen);
        }
        Ok(Self { angles, candidates })
    }

    /// The chosen action: the simplest of those whose rotations are about as near to the pairs as the nearest.
    pub fn action(&self) -> &CircleAction {
        &self.candidates[0].0
    }

    /// The nearest other action whose largest weight is at most that of the chosen one, or 2.
    fn next(&self) -> Option<&(CircleAction, f64)> {
        let largest = |action: &CircleAction| action.weights().iter().map(|m| m.abs()).max();
        let own = largest(self.action()).max(Some(2));
        let others = self.candidates[1..].iter().filter(|(action, _)| largest(action) <= own);
        others.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Whether the choice is clear: it is near, other actions with weights no larger are three times as far and not
    /// near, and simpler actions are further away than a slow motion may turn a plane in one step.
    pub fn is_sure(&self) -> bool {
        let turned = turned(&self.angles);
        let near = self.candidates[0].1;
        let clear = (Self::FACTOR * near).max(Self::NEAR * turned);
        let own = complexity(self.action());
        let mut simpler =
            self.candidates[1..].iter().filter(|(action, _)| complexity(action) < own);
        near < Self::NEAR * turned
            && self.next().is_none_or(|(_, distance)| *distance > clear)
            && simpler.all(|(_, distance)| *distance > Self::NEAR)
    }

    /// Describes the fit in words.
    pub fn describe(&self) -> String {
        let angles: Vec<String> = self.angles.iter().map(|angle| format!("{angle:.3}")).collect();
        let next = self
            .next()
            .map_or_else(String::new, |(action, distance)| format!(", {action} as {distance:.2}"));
        format!(
            "circle action {} is as near as {:.2} (0 is exact){next}; the planes turn by {} from \
             inputs to outputs; {}",
            self.action(),
            self.candidates[0].1,
            angles.join(", "),
            Self::WHOLE_TURNS
        )
    }
}

/// The sum of |m_j| and the number of negative weights: smaller is simpler.
fn complexity(action: &CircleAction) -> (i32, usize) {
    let negative = action.weights().iter().filter(|m| **m < 0).count();
    (action.weights().iter().map(|m| m.abs()).sum(), negative)
}

/// The root mean square over the planes of |exp(iα_j) − 1|.
fn turned(angles: &[f64]) -> f64 {
    let squares: f64 = angles.iter().map(|angle| chord(*angle) * chord(*angle)).sum();
    libm::sqrt(squares / angles.len() as f64)
}

/// The pairs of the shortest flow time.
fn shortest(pairs: &Pairs) -> Pairs {
    let times = pairs.conditions().iter().map(|condition| condition.time.abs());
    let Some(least) = times.min_by(f64::total_cmp) else { return pairs.clone() };
    let mut first = 0;
    let mut rows = Vec::new();
    for condition in pairs.conditions() {
        if condition.time.abs() == least {
            rows.extend(first..first + condition.pairs);
        }
        first += condition.pairs;
    }
    pairs.rows(rows)
}

/// All candidate weights, up to a common sign.
fn weights(dof: usize) -> Vec<Vec<i32>> {
    let base = 2 * ActionFit::MOST + 1;
    let of = |number: i32| -> Vec<i32> {
        (0..dof).map(|j| number / base.pow(j as u32) % base - ActionFit::MOST).collect()
    };
    let is_wanted = |weights: &Vec<i32>| {
        let first = weights.iter().find(|m| **m != 0);
        first.is_some_and(|m| *m > 0) && divisor(weights) == 1.0
    };
    (0..base.pow(dof as u32)).map(of).filter(is_wanted).collect()
}

/// The distance of the measured angles from those of these weights at the best θ.
fn distance(weights: &[i32], angles: &[f64]) -> f64 {
    let misfit = |theta: f64| -> f64 {
        let of = |(m, angle): (&i32, &f64)| {
            let chord = chord(f64::from(*m) * theta - angle);
            chord * chord
        };
        weights.iter().zip(angles).map(of).sum()
    };
    // Three turns of the fastest plane at most: 32 points in each.
    let theta = least_angle(misfit, TAU, 96);
    libm::sqrt(misfit(theta) / weights.len() as f64)
}

/// The angle by which each plane turns under the affine map nearest to the pairs in the mean
/// square.
fn plane_angles(pairs: &Pairs) -> Result<Vec<f64>, Error> {
    let dof = pairs.dof();
    let dim = 2 * dof;
    let unfit = || {
        let (found, expected) = (format!("{} pairs", pairs.len()), "more, in all directions");
        Error::invalid("pairs for their circle action", found, expected)
    };
    // About their means and of size one, so that no column is lost in the equations.
    let count = pairs.len() as f64;
    let moments = |values: &[f64]| -> Vec<(f64, f64)> {
        let of = |c: usize| {
            let column = || values[c..].iter().step_by(dim);
            let mean = column().sum::<f64>() / count;
            let square = column().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count;
            (mean, libm::sqrt(square))
        };
        (0..dim).map(of).collect()
    };
    let (of_input, of_output) = (moments(pairs.input()), moments(pairs.output()));
    if let Some(column) = of_input.iter().position(|(_, size)| *size == 0.0) {
        let name = format!("input: column {column} (counted from 0)");
        let found = format!("{} in all pairs", of_input[column].0);
        return Err(Error::invalid(&name, found, "one that varies"));
    }
    if pairs.len() <= dim {
        return Err(unfit());
    }
    let mut normal = Mat::<f64>::zeros(dim, dim);
    let mut right = Mat::<f64>::zeros(dim, dim);
    for (z, w) in pairs.input().chunks_exact(dim).zip(pairs.output().chunks_exact(dim)) {
        let input = |i: usize| (z[i] - of_input[i].0) / of_input[i].1;
        for i in 0..dim {
            for j in 0..dim {
                normal[(i, j)] += input(i) * input(j);
                right[(i, j)] += input(i) * (w[j] - of_output[j].0);
            }
        }
    }
    let factor = normal.llt(Side::Lower).map_err(|_| unfit())?;
    let solution = factor.solve(&right);
    let entry = |row: usize, column: usize| solution[(column, row)] / of_input[column].1;
    let angle = |j: usize| {
        let (q, p) = (j, dof + j);
        let determinant = entry(q, q) * entry(p, p) - entry(q, p) * entry(p, q);
        let cosine = 0.5 * (entry(q, q) + entry(p, p)) / libm::sqrt(determinant);
        // A plane that does not turn, such as one that is sheared, has no angle; for half a turn
        // the cosine is −1 up to rounding.
        let angle = libm::acos(cosine.clamp(-1.0, 1.0));
        let turns = determinant > 0.0 && angle > 0.0 && cosine > -1.0 - 1e-6;
        if turns { angle.copysign(entry(q, p) - entry(p, q)) } else { 0.0 }
    };
    Ok((0..dof).map(angle).collect())
}
