//! The loss of a network on pairs, its gradient and its curvature diagonal.

use crate::error::Error;
use crate::flow::Pairs;
use crate::network::Composition;
use crate::phase::Direction;
use crate::scalar::{Kernel, Pack, WIDTH, on_lanes};
use crate::work;
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

/// Groups of eight pairs that go through the map together: fixed as the lanes
/// are, and with them the order of all sums.
const TOGETHER: usize = 4;

/// Pairs whose sums are taken together, fixed for the same reason.
const BLOCK: usize = 128 * WIDTH;

/// Tasks for each thread, so that all end at about the same time.
const TASKS: usize = 8;

/// The loss of a composition on a set of pairs.
///
/// Sums are taken in a fixed order — in each lane over the pairs of a block of
/// 1024, four groups of eight going through the map together; then over the eight
/// lanes; then over the blocks — so that values and gradients are the same bits on
/// every processor and number of threads.
#[derive(Clone, Debug)]
pub struct Objective<'a> {
    pairs: &'a Pairs,
    weights: Vec<f64>,
}

impl<'a> Objective<'a> {
    /// The loss on these pairs.
    ///
    /// # Errors
    /// Those of [`Loss::component_weights`].
    pub fn new(loss: &Loss, pairs: &'a Pairs) -> Result<Self, Error> {
        Ok(Self { weights: loss.component_weights(pairs.dof())?, pairs })
    }

    /// The kernels give a result for each block. A task is several blocks, if there
    /// are enough for all threads: working space is made once for a task.
    fn block_results<T: Send>(
        &self,
        map: &Composition<f64>,
        kind: work::Kind,
        f: impl Fn(Blocks<'_>) -> Vec<T> + Sync,
    ) -> Vec<T> {
        let dim = 2 * self.pairs.dof();
        let blocks = self.pairs.len().div_ceil(BLOCK);
        let task = (blocks / (TASKS * rayon::current_num_threads())).max(1) * BLOCK * dim;
        self.pairs
            .input()
            .par_chunks(task)
            .zip(self.pairs.output().par_chunks(task))
            .flat_map_iter(|(input, output)| {
                work::count(kind, input.len() / dim);
                f(Blocks { map, weights: &self.weights, input, output })
            })
            .collect()
    }

    /// The loss.
    pub fn value(&self, map: &Composition<f64>) -> f64 {
        self.assert_dof(map);
        let mut total = 0.0;
        let kind = work::Kind::Loss;
        for part in self.block_results(map, kind, |blocks| on_lanes::<WIDTH, _>(Value(blocks))) {
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
        let kind = work::Kind::Gradient;
        for (value, part) in
            self.block_results(map, kind, |blocks| on_lanes::<WIDTH, _>(Gradient(blocks)))
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
        let kind = work::Kind::Curvature;
        for part in self.block_results(map, kind, |blocks| on_lanes::<WIDTH, _>(Curvature(blocks)))
        {
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

/// Blocks of pairs, and what a kernel needs to take their parts of the loss.
#[derive(Clone, Copy)]
struct Blocks<'a> {
    map: &'a Composition<f64>,
    weights: &'a [f64],
    input: &'a [f64],
    output: &'a [f64],
}

/// The lanes of the pairs that go together.
struct Group<V> {
    /// One group of pairs after another, 2n numbers each.
    state: Vec<V>,
    target: Vec<V>,
    cotangent: Vec<V>,
    /// 1 in a lane that has a pair, for each group. The others repeat a pair.
    present: Vec<V>,
}

impl<'a> Blocks<'a> {
    #[inline(always)]
    fn space<V: Pack>(&self) -> Group<V> {
        let zero = vec![V::zero(); TOGETHER * self.weights.len()];
        let present = vec![V::zero(); TOGETHER];
        Group { state: zero.clone(), target: zero.clone(), cotangent: zero, present }
    }

    /// Inputs and outputs of each block.
    #[inline(always)]
    fn each(&self) -> impl Iterator<Item = (&'a [f64], &'a [f64])> + use<'a> {
        in_chunks(self.input, self.output, BLOCK * self.weights.len())
    }
}

/// Inputs and outputs, so many numbers of each at a time.
#[inline(always)]
fn in_chunks<'a>(
    input: &'a [f64],
    output: &'a [f64],
    size: usize,
) -> impl Iterator<Item = (&'a [f64], &'a [f64])> + use<'a> {
    input.chunks(size).zip(output.chunks(size))
}

impl<V: Pack> Group<V> {
    #[inline(always)]
    fn load(&mut self, input: &[f64], output: &[f64]) {
        let dim = self.state.len() / TOGETHER;
        let rows = input.len() / dim;
        for group in 0..TOGETHER {
            let first = (group * V::LANES).min(rows);
            let count = (rows - first).min(V::LANES);
            self.present[group] = present(count);
            // A group without a pair repeats the last one.
            let part = first.min(rows - 1) * dim..(first + count.max(1)).min(rows) * dim;
            let lanes = group * dim..(group + 1) * dim;
            crate::network::load(&input[part.clone()], dim, &mut self.state[lanes.clone()]);
            crate::network::load(&output[part], dim, &mut self.target[lanes]);
        }
    }

    /// Calls `f(cotangent, residual, weight_c·residual)` for the components c of
    /// each group; the last is zero in lanes without a pair.
    #[inline(always)]
    fn residuals(&mut self, weights: &[f64], mut f: impl FnMut(&mut V, V, V)) {
        let dim = weights.len();
        for group in 0..TOGETHER {
            for (c, &weight) in weights.iter().enumerate() {
                let k = group * dim + c;
                let residual = self.state[k] - self.target[k];
                let weighted = residual * self.present[group] * V::from_f64(weight);
                f(&mut self.cotangent[k], residual, weighted);
            }
        }
    }
}

/// 1 in so many lanes, 0 in the others.
#[inline(always)]
fn present<V: Pack>(count: usize) -> V {
    let mut present = [0.0; WIDTH];
    present[..count].fill(1.0);
    V::load(&present[..V::LANES])
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

/// The sum of the lanes of each.
#[inline(always)]
fn sums<V: Pack>(each: &[V]) -> Vec<f64> {
    let mut out = vec![0.0; each.len()];
    for (out, &lanes) in out.iter_mut().zip(each) {
        *out = sum(lanes);
    }
    out
}

struct Value<'a>(Blocks<'a>);

impl Kernel for Value<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<V: Pack>(self) -> Vec<f64> {
        let Blocks { map, weights, .. } = self.0;
        let mut group = self.0.space::<V>();
        let mut scratch = vec![V::zero(); weights.len()];
        let mut results = Vec::new();
        for (input, output) in self.0.each() {
            let mut total = V::zero();
            for (input, output) in in_chunks(input, output, TOGETHER * V::LANES * weights.len()) {
                group.load(input, output);
                map.apply(Direction::Forward, &mut group.state, &mut scratch);
                group.residuals(weights, |_, residual, weighted| {
                    total = weighted.mul_add(residual, total);
                });
            }
            results.push(sum(total));
        }
        results
    }
}

struct Gradient<'a>(Blocks<'a>);

impl Kernel for Gradient<'_> {
    type Output = Vec<(f64, Vec<f64>)>;

    #[inline(always)]
    fn run<V: Pack>(self) -> Self::Output {
        let Blocks { map, weights, .. } = self.0;
        let mut group = self.0.space::<V>();
        let mut recording = map.recording_of::<V>(TOGETHER);
        let mut gradient = vec![V::zero(); map.parameters().len()];
        let mut results = Vec::new();
        for (input, output) in self.0.each() {
            let mut total = V::zero();
            gradient.fill(V::zero());
            for (input, output) in in_chunks(input, output, TOGETHER * V::LANES * weights.len()) {
                group.load(input, output);
                map.record(&mut group.state, &mut recording);
                group.residuals(weights, |cotangent, residual, weighted| {
                    total = weighted.mul_add(residual, total);
                    *cotangent = weighted + weighted;
                });
                map.pull(&mut recording, &mut group.cotangent, &mut gradient);
            }
            results.push((sum(total), sums(&gradient)));
        }
        results
    }
}

struct Curvature<'a>(Blocks<'a>);

impl Kernel for Curvature<'_> {
    type Output = Vec<Vec<f64>>;

    #[inline(always)]
    fn run<V: Pack>(self) -> Self::Output {
        let Blocks { map, weights, .. } = self.0;
        let dim = weights.len();
        let zero = V::zero();
        let mut recording = map.recording::<V>();
        let (mut state, mut cotangent) = (vec![zero; dim], vec![zero; dim]);
        let mut row = vec![zero; map.parameters().len()];
        let mut diagonal = row.clone();
        let mut results = Vec::new();
        for (input, _) in self.0.each() {
            diagonal.fill(zero);
            for input in input.chunks(V::LANES * dim) {
                crate::network::load(input, dim, &mut state);
                let present = present::<V>(input.len() / dim);
                map.record(&mut state, &mut recording);
                for (c, &weight) in weights.iter().enumerate() {
                    // The squares of a single pair's row: one group at a time.
                    cotangent.fill(zero);
                    cotangent[c] = present;
                    row.fill(zero);
                    map.pull(&mut recording, &mut cotangent, &mut row);
                    for (d, r) in diagonal.iter_mut().zip(&row) {
                        *d = (*r * V::from_f64(weight)).mul_add(*r, *d);
                    }
                }
            }
            results.push(sums(&diagonal));
        }
        results
    }
}
