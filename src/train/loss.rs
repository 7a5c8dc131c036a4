//! The loss of a network on pairs, its gradient and its curvature diagonal.

use crate::error::Error;
use crate::flow::Pairs;
use crate::network::{Composition, with_dof};
use crate::scalar::{Lanes, Scalar, WIDTH};
use multiversion::multiversion;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// What is minimised: the mean over the pairs of Σ_c weight_c·(residual_c)².
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Loss {
    /// The mean squared error over all components: weight_c = 1/(2n).
    MeanSquaredError,
    /// A weight for each degree of freedom, on its q and its p. With [ε, 1]
    /// it is, but for the factor 512 of the batch, the sum that the paper's
    /// published code minimises.
    Weighted {
        /// One for each degree of freedom.
        weights: Vec<f64>,
    },
}

impl Loss {
    /// The weight of each of the 2n components.
    ///
    /// # Errors
    /// When there is not one finite, non-negative weight for each degree of
    /// freedom.
    pub fn component_weights(&self, dof: usize) -> Result<Vec<f64>, Error> {
        match self {
            Self::MeanSquaredError => Ok(vec![1.0 / (2 * dof) as f64; 2 * dof]),
            Self::Weighted { weights } => {
                Error::check_count("loss weights", dof, weights.len())?;
                if let Some(bad) = weights.iter().find(|w| !(w.is_finite() && **w >= 0.0)) {
                    return Err(Error::invalid("loss weight", bad, "a finite number ≥ 0"));
                }
                Ok(weights.iter().chain(weights).copied().collect())
            }
        }
    }
}

/// Pairs of one task: fixed, so that the order of all sums is.
const BLOCK: usize = 128 * WIDTH;

/// The loss of a composition on a set of pairs.
///
/// Sums are taken in a fixed order — lanes, then groups of eight pairs, then
/// blocks of 1024 — so that values and gradients are the same bits on every
/// processor and number of threads.
#[derive(Clone, Debug)]
pub struct Objective<'a> {
    pairs: &'a Pairs,
    weights: Vec<f64>,
}

impl<'a> Objective<'a> {
    /// The loss on these pairs.
    ///
    /// # Errors
    /// As [`Loss::component_weights`].
    pub fn new(loss: &Loss, pairs: &'a Pairs) -> Result<Self, Error> {
        Ok(Self { weights: loss.component_weights(pairs.dof())?, pairs })
    }

    fn block_results<T: Send>(&self, f: impl Fn(&[f64], &[f64]) -> T + Sync) -> Vec<T> {
        let size = BLOCK * 2 * self.pairs.dof();
        self.pairs
            .input()
            .par_chunks(size)
            .zip(self.pairs.output().par_chunks(size))
            .map(|(input, output)| f(input, output))
            .collect()
    }

    /// The loss.
    pub fn value(&self, map: &Composition<f64>) -> f64 {
        self.assert_dof(map);
        let mut total = 0.0;
        for part in self.block_results(|i, o| block_value(map, &self.weights, i, o)) {
            total += part;
        }
        total / self.pairs.len() as f64
    }

    /// The loss; `gradient` ← its gradient in the parameters. Costs about
    /// three times the loss.
    ///
    /// # Panics
    /// When `gradient` is not of the map's number of parameters.
    pub fn value_and_gradient(&self, map: &Composition<f64>, gradient: &mut [f64]) -> f64 {
        self.assert_dof(map);
        assert!(gradient.len() == map.parameters().len());
        gradient.fill(0.0);
        let mut total = 0.0;
        for (value, part) in self.block_results(|i, o| block_gradient(map, &self.weights, i, o)) {
            total += value;
            for (g, p) in gradient.iter_mut().zip(part) {
                *g += p;
            }
        }
        let count = self.pairs.len() as f64;
        for g in gradient {
            *g /= count;
        }
        total / count
    }

    /// The diagonal of the Gauss–Newton matrix of the loss,
    /// (2/N) Σ Σ_c weight_c (∂residual_c/∂parameter)². One Jacobian pass:
    /// 2n pullbacks a pair.
    pub fn curvature_diagonal(&self, map: &Composition<f64>) -> Vec<f64> {
        self.assert_dof(map);
        let mut diagonal = vec![0.0; map.parameters().len()];
        for part in self.block_results(|i, o| block_curvature(map, &self.weights, i, o)) {
            for (d, p) in diagonal.iter_mut().zip(part) {
                *d += p;
            }
        }
        for d in &mut diagonal {
            *d *= 2.0 / self.pairs.len() as f64;
        }
        diagonal
    }

    fn assert_dof(&self, map: &Composition<f64>) {
        assert!(
            map.dof() == self.pairs.dof(),
            "a map of {} dof on pairs of {} dof",
            map.dof(),
            self.pairs.dof()
        );
    }
}

/// Loads a group of up to eight rows; lanes without a row repeat the last one
/// with weight 0. Returns the weight of each lane.
#[inline(always)]
fn load_group(
    input: &[f64],
    output: &[f64],
    dim: usize,
    state: &mut [Lanes],
    target: &mut [Lanes],
) -> Lanes {
    crate::network::load(input, dim, state);
    crate::network::load(output, dim, target);
    let rows = input.len() / dim;
    let mut present = Lanes::splat(0.0);
    for (k, lane) in present.0.iter_mut().enumerate() {
        *lane = if k < rows { 1.0 } else { 0.0 };
    }
    present
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+fma", "x86_64+avx2+fma"))]
fn block_value(map: &Composition<f64>, weights: &[f64], input: &[f64], output: &[f64]) -> f64 {
    let dim = weights.len();
    let mut state = vec![Lanes::splat(0.0); dim];
    let (mut target, mut scratch) = (state.clone(), state.clone());
    let mut total = Lanes::splat(0.0);
    for (i, o) in input.chunks(WIDTH * dim).zip(output.chunks(WIDTH * dim)) {
        let present = load_group(i, o, dim, &mut state, &mut target);
        with_dof!(map.dof(), D => map.apply::<Lanes, D>(
            crate::network::Direction::Forward, &mut state, &mut scratch));
        for c in 0..dim {
            let residual = state[c] - target[c];
            total = (residual * present * Lanes::splat(weights[c])).mul_add(residual, total);
        }
    }
    total.sum()
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+fma", "x86_64+avx2+fma"))]
fn block_gradient(
    map: &Composition<f64>,
    weights: &[f64],
    input: &[f64],
    output: &[f64],
) -> (f64, Vec<f64>) {
    let dim = weights.len();
    let mut state = vec![Lanes::splat(0.0); dim];
    let (mut target, mut cotangent) = (state.clone(), state.clone());
    let mut recording = map.recording::<Lanes>();
    let mut gradient = vec![Lanes::splat(0.0); map.parameters().len()];
    let mut total = Lanes::splat(0.0);
    for (i, o) in input.chunks(WIDTH * dim).zip(output.chunks(WIDTH * dim)) {
        let present = load_group(i, o, dim, &mut state, &mut target);
        with_dof!(map.dof(), D => map.record::<Lanes, D>(&mut state, &mut recording));
        for c in 0..dim {
            let residual = state[c] - target[c];
            let weighted = residual * present * Lanes::splat(weights[c]);
            total = weighted.mul_add(residual, total);
            cotangent[c] = weighted + weighted;
        }
        with_dof!(map.dof(), D => map.pull::<Lanes, D>(
            &mut recording, &mut cotangent, &mut gradient));
    }
    (total.sum(), gradient.into_iter().map(Lanes::sum).collect())
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+fma", "x86_64+avx2+fma"))]
fn block_curvature(
    map: &Composition<f64>,
    weights: &[f64],
    input: &[f64],
    output: &[f64],
) -> Vec<f64> {
    let dim = weights.len();
    let zero = Lanes::splat(0.0);
    let mut state = vec![zero; dim];
    let (mut target, mut cotangent) = (state.clone(), state.clone());
    let mut recording = map.recording::<Lanes>();
    let mut row = vec![zero; map.parameters().len()];
    let mut diagonal = row.clone();
    for (i, o) in input.chunks(WIDTH * dim).zip(output.chunks(WIDTH * dim)) {
        let present = load_group(i, o, dim, &mut state, &mut target);
        with_dof!(map.dof(), D => map.record::<Lanes, D>(&mut state, &mut recording));
        for c in 0..dim {
            cotangent.fill(zero);
            cotangent[c] = present;
            row.fill(zero);
            with_dof!(map.dof(), D => map.pull::<Lanes, D>(
                &mut recording, &mut cotangent, &mut row));
            let weight = Lanes::splat(weights[c]);
            for (d, r) in diagonal.iter_mut().zip(&row) {
                *d = (*r * weight).mul_add(*r, *d);
            }
        }
    }
    diagonal.into_iter().map(Lanes::sum).collect()
}
