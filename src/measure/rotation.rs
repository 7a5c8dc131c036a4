//! Rotation numbers of orbits of maps of a plane, by weighted Birkhoff averages.

use crate::flow::Trajectories;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// The rotation number of an orbit, with an estimate of its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotationNumber {
    /// The mean growth of the angle from one state to the next, in turns.
    pub turns: f64,
    /// The difference of the averages over the two halves of the orbit. On an invariant curve it falls
    /// faster than any power of the length; on a chaotic orbit it falls like length^{−1/2}.
    pub error: f64,
}

/// The rotation number of each trajectory, Σ w(k/N) Δθ_k/Σ w(k/N) with w(t) = exp(−1/t(1 − t)). The growth Δθ_k of the
/// angle from one state to the next is taken within half a turn of `near`, in turns.
///
/// `angle` gives the angle of a state about a centre, in radians. A trajectory of fewer than three states has the
/// error NaN.
///
/// Source: Das, Saiki, Sander and Yorke, <https://doi.org/10.1088/1361-6544/aa84c2>.
pub fn rotation_numbers(
    orbits: &Trajectories,
    near: f64,
    angle: impl Fn(&[f64]) -> f64 + Sync,
) -> Vec<RotationNumber> {
    let of = |m: usize| {
        let angles: Vec<f64> = orbits.orbit(m).map(&angle).collect();
        let growths: Vec<f64> = angles
            .windows(2)
            .map(|pair| libm::remainder(pair[1] - pair[0] - near * TAU, TAU))
            .collect();
        let half = growths.len() / 2;
        let error = (birkhoff_average(&growths[..half]) - birkhoff_average(&growths[half..])).abs();
        RotationNumber { turns: near + birkhoff_average(&growths) / TAU, error: error / TAU }
    };
    (0..orbits.count()).into_par_iter().map(of).collect()
}

/// exp(−1/t(1 − t)) for so many values along an orbit, t between 0 and 1.
pub(super) fn birkhoff_weights(count: usize) -> impl Iterator<Item = f64> {
    (1..=count).map(move |k| {
        let t = k as f64 / (count as f64 + 1.0);
        libm::exp(-1.0 / (t * (1.0 - t)))
    })
}

/// The weighted average of values along an orbit; NaN of none.
pub(super) fn birkhoff_average(values: &[f64]) -> f64 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for (value, weight) in values.iter().zip(birkhoff_weights(values.len())) {
        sum += weight * value;
        weights += weight;
    }
    sum / weights
}
