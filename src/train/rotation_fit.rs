//! Estimates of θ for data of unknown frequency.

use crate::flow::{Condition, Pairs};
use crate::layer::{CircleAction, TorusAction};
use crate::measure::trajectories::{root_mean_square, rotation_error};
use std::f64::consts::TAU;

/// The angle θ whose rotation Φ_θ is nearest to the pairs in the mean square; for pairs of one flow time it is in
/// (−π/g, π/g].
///
/// Here g is the greatest common divisor of the weights: the rotation has the period 2π/g. The angle is an initial
/// value of θ when ω₀t is unknown. For pairs with several flow times it is the angle for time 1: from the shortest
/// time to the longest, the frequency found so far determines the whole periods of the next one.
///
/// Σ|Φ_θz − z′|² = const − 2Σ_j(C_j cos m_jθ + S_j sin m_jθ) with
/// C_j = Σ(qq′ + pp′) and S_j = Σ(pq′ − qp′); its minimum is found by a scan
/// and golden-section search.
///
/// Source: the orthogonal Procrustes problem, Schönemann, <https://doi.org/10.1007/BF02289451>, among the rotations of
/// one circle action.
///
/// # Panics
/// When the action and the pairs differ in their degrees of freedom.
pub fn fit_rotation(pairs: &Pairs, action: &CircleAction) -> f64 {
    assert!(action.dof() == pairs.dof());
    let mut runs = pairs.runs();
    let time = |run: &Option<&Condition>| run.map_or(1.0, |condition| condition.time);
    runs.sort_by(|(a, ..), (b, ..)| time(a).total_cmp(&time(b)));
    let mut frequency: Option<f64> = None;
    for of_time in runs.chunk_by(|(a, ..), (b, ..)| time(a) == time(b)) {
        let (time, angle) = (time(&of_time[0].0), nearest(of_time, action));
        let period = TAU / divisor(action.weights());
        let turns = frequency.map_or(0.0, |f| ((f * time - angle) / period).round());
        frequency = Some(turns.mul_add(period, angle) / time);
    }
    frequency.unwrap_or(0.0)
}

/// The angle of [`fit_rotation`] for each circle of an action.
///
/// # Panics
/// When the action and the pairs differ in their degrees of freedom.
pub fn fit_rotations(pairs: &Pairs, action: &TorusAction) -> Vec<f64> {
    action.circles().iter().map(|circle| fit_rotation(pairs, circle)).collect()
}

/// The greatest common divisor of the weights; 1 where all are 0.
pub(super) fn divisor(weights: &[i32]) -> f64 {
    f64::from(CircleAction::new(weights).common_factor().max(1))
}

/// The nearest angle for runs of pairs of one flow time.
fn nearest(runs: &[(Option<&Condition>, &[f64], &[f64])], action: &CircleAction) -> f64 {
    let n = action.dof();
    let mut cosine = vec![0.0; n];
    let mut sine = vec![0.0; n];
    for (_, input, output) in runs {
        for (z, w) in input.chunks_exact(2 * n).zip(output.chunks_exact(2 * n)) {
            for j in 0..n {
                cosine[j] += z[j] * w[j] + z[n + j] * w[n + j];
                sine[j] += z[n + j] * w[j] - z[j] * w[n + j];
            }
        }
    }
    let misfit = |theta: f64| -> f64 {
        let terms = action.weights().iter().zip(cosine.iter().zip(&sine));
        -terms
            .map(|(&m, (c, s))| {
                let (sin, cos) = libm::sincos(f64::from(m) * theta);
                c * cos + s * sin
            })
            .sum::<f64>()
    };
    let harmonics = action.weights().iter().map(|w| w.unsigned_abs()).max().unwrap_or(1).max(1);
    let period = TAU / divisor(action.weights());
    let theta = least_angle(misfit, period, harmonics.saturating_mul(64));
    if theta > 0.5 * period { theta - period } else { theta }
}

/// The angle at which a function with this period is least, by a scan of `points` points and
/// golden-section search between the neighbours of the best.
pub(super) fn least_angle(misfit: impl Fn(f64) -> f64, period: f64, points: u32) -> f64 {
    let spacing = period / f64::from(points);
    let best = (0..points)
        .map(|k| 0.5 * period - spacing * f64::from(k))
        .min_by(|a, b| misfit(*a).total_cmp(&misfit(*b)))
        .unwrap_or(0.0);
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (best - spacing, best + spacing);
    while high - low > 1e-10 {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if misfit(a) <= misfit(b) {
            high = b;
        } else {
            low = a;
        }
    }
    0.5 * (low + high)
}

/// How far pairs move in addition to the rotation by these angles, over how large they are: an
/// estimate of the slow time εh between inputs and outputs, up to a factor of order one.
pub fn slow_time(pairs: &Pairs, action: &TorusAction, angles: &[f64]) -> f64 {
    let moved = rotation_error(action, angles, pairs).sqrt() / root_mean_square(pairs.output());
    // Pairs that are a rotation, or nothing at all, leave nothing to scale.
    if moved > 0.0 && moved.is_finite() { moved } else { 1.0 }
}
