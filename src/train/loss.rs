//! The loss of a network on pairs, its gradient and its curvature diagonal.

use crate::error::Error;
use crate::flow::Pairs;
use crate::network::{Composition, Direction, with_dof};
use crate::scalar::{Kernel, Pack, WIDTH, on_lanes};
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

    fn block_results<T: Send>(
        &self,
        map: &Composition<f64>,
        f: impl Fn(Block<'_>) -> T + Sync,
    ) -> Vec<T> {
        let size = BLOCK * 2 * self.pairs.dof();
        self.pairs
            .input()
            .par_chunks(size)
            .zip(self.pairs.output().par_chunks(size))
            .map(|(input, output)| f(Block { map, weights: &self.weights, input, output }))
            .collect()
    }

    /// The loss.
    pub fn value(&self, map: &Composition<f64>) -> f64 {
        self.assert_dof(map);
        let mut total = 0.0;
        for part in self.block_results(map, |block| on_lanes::<WIDTH, _>(Value(block))) {
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
        for (value, part) in self.block_results(map, |block| on_lanes::<WIDTH, _>(Gradient(block)))
        {
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
        for part in self.block_results(map, |block| on_lanes::<WIDTH, _>(Curvature(block))) {
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

/// A block of pairs, and what a kernel needs to take its part of the loss.
#[derive(Clone, Copy)]
struct Block<'a> {
    map: &'a Composition<f64>,
    weights: &'a [f64],
    input: &'a [f64],
    output: &'a [f64],
}

/// The lanes of a group of pairs.
struct Group<V> {
    state: Vec<V>,
    target: Vec<V>,
    cotangent: Vec<V>,
    /// 1 in a lane that has a pair. The others repeat the last pair.
    present: V,
}

impl<'a> Block<'a> {
    #[inline(always)]
    fn space<V: Pack>(&self) -> Group<V> {
        let zero = vec![V::zero(); self.weights.len()];
        Group { state: zero.clone(), target: zero.clone(), cotangent: zero, present: V::zero() }
    }

    /// Inputs and outputs of as many pairs as there are lanes at a time.
    #[inline(always)]
    fn groups<V: Pack>(&self) -> impl Iterator<Item = (&'a [f64], &'a [f64])> + use<'a, V> {
        let size = V::LANES * self.weights.len();
        self.input.chunks(size).zip(self.output.chunks(size))
    }
}

impl<V: Pack> Group<V> {
    #[inline(always)]
    fn load(&mut self, input: &[f64], output: &[f64]) {
        let dim = self.state.len();
        crate::network::load(input, dim, &mut self.state);
        crate::network::load(output, dim, &mut self.target);
        let rows = input.len() / dim;
        let mut present = [0.0; WIDTH];
        present[..rows].fill(1.0);
        self.present = V::load(&present[..V::LANES]);
    }

    /// (residual_c, weight_c·residual_c), zero in lanes without a pair.
    #[inline(always)]
    fn residual(&self, c: usize, weight: f64) -> (V, V) {
        let residual = self.state[c] - self.target[c];
        (residual, residual * self.present * V::from_f64(weight))
    }
}

/// The sum of the lanes, from the first to the last.
#[inline(always)]
fn sum<V: Pack>(lanes: V) -> f64 {
    let mut values = [0.0; WIDTH];
    lanes.store(&mut values[..V::LANES]);
    let mut total = 0.0;
    for value in values {
        total += value;
    }
    total
}

struct Value<'a>(Block<'a>);

impl Kernel for Value<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<V: Pack>(self) -> f64 {
        let Block { map, weights, .. } = self.0;
        let mut group = self.0.space::<V>();
        let mut scratch = group.state.clone();
        let mut total = V::zero();
        for (input, output) in self.0.groups::<V>() {
            group.load(input, output);
            with_dof!(map.dof(), D => map.apply::<V, D>(
                Direction::Forward, &mut group.state, &mut scratch));
            for (c, &weight) in weights.iter().enumerate() {
                let (residual, weighted) = group.residual(c, weight);
                total = weighted.mul_add(residual, total);
            }
        }
        sum(total)
    }
}

struct Gradient<'a>(Block<'a>);

impl Kernel for Gradient<'_> {
    type Output = (f64, Vec<f64>);

    #[inline(always)]
    fn run<V: Pack>(self) -> (f64, Vec<f64>) {
        let Block { map, weights, .. } = self.0;
        let mut group = self.0.space::<V>();
        let mut recording = map.recording::<V>();
        let mut gradient = vec![V::zero(); map.parameters().len()];
        let mut total = V::zero();
        for (input, output) in self.0.groups::<V>() {
            group.load(input, output);
            with_dof!(map.dof(), D => map.record::<V, D>(&mut group.state, &mut recording));
            for (c, &weight) in weights.iter().enumerate() {
                let (residual, weighted) = group.residual(c, weight);
                total = weighted.mul_add(residual, total);
                group.cotangent[c] = weighted + weighted;
            }
            with_dof!(map.dof(), D => map.pull::<V, D>(
                &mut recording, &mut group.cotangent, &mut gradient));
        }
        (sum(total), gradient.into_iter().map(sum).collect())
    }
}

struct Curvature<'a>(Block<'a>);

impl Kernel for Curvature<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<V: Pack>(self) -> Vec<f64> {
        let Block { map, weights, .. } = self.0;
        let mut group = self.0.space::<V>();
        let mut recording = map.recording::<V>();
        let mut row = vec![V::zero(); map.parameters().len()];
        let mut diagonal = row.clone();
        for (input, output) in self.0.groups::<V>() {
            group.load(input, output);
            with_dof!(map.dof(), D => map.record::<V, D>(&mut group.state, &mut recording));
            for (c, &weight) in weights.iter().enumerate() {
                group.cotangent.fill(V::zero());
                group.cotangent[c] = group.present;
                row.fill(V::zero());
                with_dof!(map.dof(), D => map.pull::<V, D>(
                    &mut recording, &mut group.cotangent, &mut row));
                for (d, r) in diagonal.iter_mut().zip(&row) {
                    *d = (*r * V::from_f64(weight)).mul_add(*r, *d);
                }
            }
        }
        diagonal.into_iter().map(sum).collect()
    }
}
