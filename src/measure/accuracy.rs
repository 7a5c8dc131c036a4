//! Errors against data and reference, and drifts.

use crate::error::Error;
use crate::flow::Pairs;
use crate::network::{Composition, Direction, map_points};
use crate::scalar::max_or_nan;
use crate::system::Hamiltonian;
use serde::{Deserialize, Serialize};

/// The Euclidean distance of two points.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// What a quantity did along a trajectory.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Drift {
    /// Its value at the start.
    pub initial: f64,
    /// The largest |value − initial| afterwards.
    pub largest: f64,
}

/// The drift of a sequence of values; NaN when one of them is.
pub fn drift(values: impl IntoIterator<Item = f64>) -> Drift {
    let mut values = values.into_iter();
    let initial = values.next().unwrap_or(f64::NAN);
    let largest = values.map(|v| (v - initial).abs()).fold(0.0, max_or_nan);
    Drift { initial, largest }
}

/// The mean squared error, over all components, of the exact limiting flow of
/// `system` over `time`: what a surrogate has to improve upon.
pub fn limiting_flow_error(system: &impl Hamiltonian, pairs: &Pairs, time: f64) -> f64 {
    let dim = 2 * pairs.dof();
    let mut total = 0.0;
    for (input, output) in pairs.input().chunks_exact(dim).zip(pairs.output().chunks_exact(dim)) {
        let mut moved = input.to_vec();
        system.limiting_flow(&mut moved, time);
        for (a, b) in moved.iter().zip(output) {
            total += (a - b) * (a - b);
        }
    }
    total / pairs.output().len() as f64
}

/// The root-mean-square error of each of the 2n components.
///
/// # Errors
/// As [`map_points`].
pub fn component_errors(map: &Composition<f64>, pairs: &Pairs) -> Result<Vec<f64>, Error> {
    let dim = 2 * pairs.dof();
    let mut moved = pairs.input().to_vec();
    map_points(map, Direction::Forward, &mut moved)?;
    let mut squares = vec![0.0; dim];
    for (own, target) in moved.chunks_exact(dim).zip(pairs.output().chunks_exact(dim)) {
        for c in 0..dim {
            squares[c] += (own[c] - target[c]) * (own[c] - target[c]);
        }
    }
    Ok(squares.into_iter().map(|s| (s / pairs.len() as f64).sqrt()).collect())
}
