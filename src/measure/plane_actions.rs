//! How far the action of each plane moves along orbits of a map, compared with pairs of the flow.

use super::accuracy::root_mean_square;
use crate::flow::Pairs;
use crate::layer::TorusAction;
use crate::scalar::{max_or_nan, median_or_nan};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

/// The action I_j = (q_j² + p_j²)/2 of a plane, in pairs and along orbits.
///
/// A fast rotation moves an action back and forth, so one step changes it by about as much as
/// many steps do: away from low resonances by half of its swing, in the root mean square. One
/// step shows less of a slow motion: where most of the change does not depend on the fast
/// angles, the pairs do not determine the swing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneSwing {
    /// The root mean square of I_j(output) − I_j(input) over the pairs.
    pub step: f64,
    /// The largest minus the smallest I_j of inputs and outputs, or 1 % of the largest if that is more.
    pub range: f64,
    /// The largest minus the smallest I_j along an orbit: the median over orbits.
    pub swing: f64,
    /// The number of orbits whose swing exceeds the range.
    pub beyond: usize,
    /// The largest plausible swing in units of `step`; None where the pairs do not determine it.
    pub allowed: Option<f64>,
}

impl PlaneSwing {
    /// A swing below this share of the range does not matter.
    const MATTERS: f64 = 0.05;
    /// A range is at least this share of the largest action.
    const WIDE: f64 = 0.01;
    /// A fast rotation swings an action by about two steps' changes; more than this is too much.
    const STEPS: f64 = 6.0;
    /// The number of harmonics of the fast angles on which an action may depend.
    const HARMONICS: u32 = 3;
    /// The number of pairs that are looked at.
    const PAIRS: usize = 2000;

    /// Measures the swing of each plane. `states` holds the states, 2n numbers each, of all `count`
    /// orbits at the first time, then at the next, and so on; `action` at `angles` is the rotation
    /// nearest to the pairs.
    ///
    /// # Panics
    /// When the action and the pairs differ in their degrees of freedom.
    pub fn measure(
        pairs: &[&Pairs],
        action: &TorusAction,
        angles: &[f64],
        states: &[f64],
        count: usize,
    ) -> Vec<Self> {
        let dof = action.dof();
        let of_plane = |z: &[f64], j: usize| 0.5 * (z[j] * z[j] + z[dof + j] * z[dof + j]);
        let slow = slow_shares(pairs, action);
        // 0 where a harmonic of a fast angle comes round: then steps show nothing of it.
        let mut seen = 1.0_f64;
        for (circle, angle) in action.circles().iter().zip(angles) {
            for m in circle.weights().iter().filter(|m| **m != 0) {
                for k in 1..=Self::HARMONICS {
                    let sine = libm::sin(0.5 * f64::from(k) * f64::from(*m) * angle).abs();
                    seen = if sine < seen { sine } else { seen };
                }
            }
        }
        let plane = |j: usize| {
            let (mut least, mut largest) = (f64::INFINITY, 0.0);
            let mut changes = Vec::new();
            for pairs in pairs {
                let rows = |values: &'_ [f64]| -> Vec<f64> {
                    values.chunks_exact(2 * dof).map(|z| of_plane(z, j)).collect()
                };
                for (before, after) in rows(pairs.input()).into_iter().zip(rows(pairs.output())) {
                    changes.push(after - before);
                    least = before.min(after).min(least);
                    largest = max_or_nan(largest, max_or_nan(before, after));
                }
            }
            let range = max_or_nan(largest - least, Self::WIDE * largest);
            let swings: Vec<f64> = (0..count).map(|m| swing(states, dof, count, m, j)).collect();
            let beyond = swings.iter().filter(|swing| !(**swing <= range)).count();
            let shows = slow[j] < 0.5 && seen > 0.0;
            Self {
                step: root_mean_square(&changes),
                range,
                swing: median_or_nan(swings),
                beyond,
                allowed: shows.then(|| Self::STEPS / seen),
            }
        };
        (0..dof).map(plane).collect()
    }

    /// The swing in units of the change by one step.
    pub fn steps(&self) -> f64 {
        self.swing / self.step
    }

    /// Whether the action swings far more than the pairs suggest.
    pub fn is_too_wide(&self) -> bool {
        let matters = !(self.swing <= Self::MATTERS * self.range);
        matters && self.allowed.is_some_and(|allowed| !(self.swing <= allowed * self.step))
    }
}

/// The largest minus the smallest action of plane j along orbit m; NaN where a state is NaN.
fn swing(states: &[f64], dof: usize, count: usize, m: usize, j: usize) -> f64 {
    let (mut least, mut largest) = (f64::INFINITY, 0.0);
    for z in states.chunks_exact(2 * dof).skip(m).step_by(count) {
        let own = 0.5 * (z[j] * z[j] + z[dof + j] * z[dof + j]);
        least = own.min(least);
        largest = max_or_nan(largest, own);
    }
    largest - least
}

/// For each plane, the share of the mean square change of its action that is explained by a
/// polynomial in functions invariant under the circles: coordinates of planes that they do not
/// turn, actions, and products of turned planes in low resonance.
fn slow_shares(pairs: &[&Pairs], action: &TorusAction) -> Vec<f64> {
    let dof = action.dof();
    let total: usize = pairs.iter().map(|pairs| pairs.len()).sum();
    let share = |pairs: &&Pairs| pairs.thinned((pairs.len() * PlaneSwing::PAIRS).div_ceil(total));
    let pairs: Vec<Pairs> = pairs.iter().map(share).collect();
    let rows: Vec<(&[f64], &[f64])> = pairs
        .iter()
        .flat_map(|p| p.input().chunks_exact(2 * dof).zip(p.output().chunks_exact(2 * dof)))
        .collect();
    let mut functions: Vec<Vec<f64>> =
        rows.iter().map(|(z, _)| slow_functions(z, action)).collect();
    // Of size one each.
    for k in 0..functions.first().map_or(0, Vec::len) {
        let column: Vec<f64> = functions.iter().map(|row| row[k]).collect();
        let size = root_mean_square(&column);
        functions.iter_mut().for_each(|row| row[k] /= if size > 0.0 { size } else { 1.0 });
    }
    let terms: Vec<Vec<f64>> = {
        const MOST: usize = 120;
        let (own, most) = (functions.first().map_or(0, Vec::len), MOST.min(rows.len() / 8));
        let degree = (1..=4).take_while(|degree| monomials(own, *degree) <= most).last();
        functions.iter().map(|row| powers(row, degree.unwrap_or(0))).collect()
    };
    let size = terms.first().map_or(0, Vec::len);
    let mut normal = Mat::<f64>::zeros(size, size);
    let mut right = Mat::<f64>::zeros(size, dof);
    let mut squares = vec![0.0; dof];
    for (terms, (z, w)) in terms.iter().zip(&rows) {
        let change = |j: usize| {
            0.5 * ((w[j] - z[j]) * (w[j] + z[j])
                + (w[dof + j] - z[dof + j]) * (w[dof + j] + z[dof + j]))
        };
        for a in 0..size {
            for b in 0..size {
                normal[(a, b)] += terms[a] * terms[b];
            }
            for j in 0..dof {
                right[(a, j)] += terms[a] * change(j);
            }
        }
        (0..dof).for_each(|j| squares[j] += change(j) * change(j));
    }
    // Functions that are the same but for a factor are no obstacle.
    let ridge = 1e-10 * (0..size).map(|a| normal[(a, a)]).fold(0.0, max_or_nan);
    (0..size).for_each(|a| normal[(a, a)] += ridge);
    let Ok(factor) = normal.llt(Side::Lower) else { return vec![1.0; dof] };
    let solution = factor.solve(&right);
    let explained = |j: usize| -> f64 {
        let sum: f64 = (0..size).map(|a| solution[(a, j)] * right[(a, j)]).sum();
        if squares[j] > 0.0 { sum / squares[j] } else { 0.0 }
    };
    (0..dof).map(explained).collect()
}

/// Functions of a point that are invariant under the circles.
fn slow_functions(z: &[f64], action: &TorusAction) -> Vec<f64> {
    let dof = action.dof();
    let weights =
        |j: usize| -> Vec<i32> { action.circles().iter().map(|c| c.weights()[j]).collect() };
    let turns = |j: usize| weights(j).iter().any(|m| *m != 0);
    let mut out = Vec::new();
    for j in 0..dof {
        match turns(j) {
            true => out.push(0.5 * (z[j] * z[j] + z[dof + j] * z[dof + j])),
            false => out.extend([z[j], z[dof + j]]),
        }
    }
    for a in (0..dof).filter(|a| turns(*a)) {
        for b in (a + 1..dof).filter(|b| turns(*b)) {
            // z_a^k and z_b^l turn together, or one against the other.
            let resonant = |k: i32, l: i32, sign: i32| {
                weights(a).iter().zip(&weights(b)).all(|(m, n)| k * m == sign * l * n)
            };
            let found = [(1, 1), (1, 2), (2, 1), (1, 3), (3, 1), (2, 3), (3, 2)]
                .into_iter()
                .flat_map(|(k, l)| [(k, l, 1), (k, l, -1)])
                .find(|(k, l, sign)| resonant(*k, *l, *sign));
            if let Some((k, l, sign)) = found {
                let (x, y) = power(z[a], z[dof + a], k);
                let (u, v) = power(z[b], f64::from(-sign) * z[dof + b], l);
                out.extend([x * u - y * v, x * v + y * u]);
            }
        }
    }
    out
}

/// (x + iy)^k for k ≥ 1.
pub fn power(x: f64, y: f64, k: i32) -> (f64, f64) {
    (1..k).fold((x, y), |(u, v), _| (u * x - v * y, u * y + v * x))
}

/// The number of monomials up to a degree in this number of variables.
pub fn monomials(variables: usize, degree: usize) -> usize {
    (1..=degree).fold(1, |count, k| count * (variables + k) / k)
}

/// The values of all monomials in the variables up to a degree; the first is 1.
pub fn powers(variables: &[f64], degree: usize) -> Vec<f64> {
    let mut out = vec![1.0];
    // Of each of the last degree, the first variable that may follow.
    let mut last = vec![(1.0, 0)];
    for _ in 0..degree {
        let next = |&(value, first): &(f64, usize)| {
            (first..variables.len()).map(move |k| (value * variables[k], k)).collect::<Vec<_>>()
        };
        last = last.iter().flat_map(next).collect();
        out.extend(last.iter().map(|(value, _)| *value));
    }
    out
}
