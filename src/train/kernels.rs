//! Loss, gradient and curvature of blocks of pairs, eight pairs in the lanes.

use crate::network::Composition;
use crate::phase::Direction;
use crate::scalar::{Kernel, Pack, WIDTH};

/// Groups of eight pairs that go through the map together: fixed as the lanes
/// are, and with them the order of all sums.
const TOGETHER: usize = 4;

/// Blocks of pairs, and what a kernel needs to take their parts of the loss.
#[derive(Clone, Copy)]
pub(super) struct Blocks<'a> {
    pub(super) map: &'a Composition<f64>,
    /// The weights of the squared residuals, one for each of the 2n components.
    pub(super) weights: &'a [f64],
    pub(super) input: &'a [f64],
    pub(super) output: &'a [f64],
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
    /// Pairs whose sums are taken together: fixed as the lanes are, for the same
    /// reason.
    pub(super) const PAIRS: usize = 128 * WIDTH;

    /// The number of pairs in all blocks.
    pub(super) fn pairs(&self) -> usize {
        self.input.len() / self.weights.len()
    }

    #[inline(always)]
    fn space<V: Pack>(&self) -> Group<V> {
        let zero = vec![V::zero(); TOGETHER * self.weights.len()];
        let present = vec![V::zero(); TOGETHER];
        Group { state: zero.clone(), target: zero.clone(), cotangent: zero, present }
    }

    /// Inputs and outputs of each block.
    #[inline(always)]
    fn each(&self) -> impl Iterator<Item = (&'a [f64], &'a [f64])> + use<'a> {
        in_chunks(self.input, self.output, Self::PAIRS * self.weights.len())
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

pub(super) struct Value<'a>(pub(super) Blocks<'a>);

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

pub(super) struct Gradient<'a>(pub(super) Blocks<'a>);

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
                map.forward_recorded_each(&mut group.state, &mut recording);
                group.residuals(weights, |cotangent, residual, weighted| {
                    total = weighted.mul_add(residual, total);
                    *cotangent = weighted + weighted;
                });
                map.vjp_each(&mut recording, &mut group.cotangent, &mut gradient);
            }
            results.push((sum(total), sums(&gradient)));
        }
        results
    }
}

/// The gradient of the mean of Σ_c weight_c·2b_c·P_c(z) in the parameters, with the second
/// difference b = (P₊ + P₋ − 2P)(z) held fixed.
pub(super) struct AccelerationGradient<'a> {
    pub(super) blocks: Blocks<'a>,
    /// The maps P₊ and P₋ whose parameters are ahead of and behind those of P.
    pub(super) beside: [&'a Composition<f64>; 2],
}

impl Kernel for AccelerationGradient<'_> {
    type Output = Vec<Vec<f64>>;

    #[inline(always)]
    fn run<V: Pack>(self) -> Self::Output {
        let Self { blocks, beside: [ahead, behind] } = self;
        let Blocks { map, weights, .. } = blocks;
        let mut group = blocks.space::<V>();
        let mut scratch = vec![V::zero(); weights.len()];
        let mut state_behind = group.state.clone();
        let mut recording = map.recording_of::<V>(TOGETHER);
        let mut gradient = vec![V::zero(); map.parameters().len()];
        let mut results = Vec::new();
        for (input, output) in blocks.each() {
            gradient.fill(V::zero());
            for (input, output) in in_chunks(input, output, TOGETHER * V::LANES * weights.len()) {
                group.load(input, output);
                group.target.copy_from_slice(&group.state);
                state_behind.copy_from_slice(&group.state);
                ahead.apply(Direction::Forward, &mut group.target, &mut scratch);
                behind.apply(Direction::Forward, &mut state_behind, &mut scratch);
                map.forward_recorded_each(&mut group.state, &mut recording);
                for k in 0..group.state.len() {
                    // The residual from here is the second difference.
                    let middle = group.state[k];
                    group.state[k] = (group.target[k] - middle) + (state_behind[k] - middle);
                    group.target[k] = V::zero();
                }
                group.residuals(weights, |cotangent, _, weighted| {
                    *cotangent = weighted + weighted;
                });
                map.vjp_each(&mut recording, &mut group.cotangent, &mut gradient);
            }
            results.push(sums(&gradient));
        }
        results
    }
}

pub(super) struct Curvature<'a>(pub(super) Blocks<'a>);

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
                map.forward_recorded_each(&mut state, &mut recording);
                for (c, &weight) in weights.iter().enumerate() {
                    // The squares of a single pair's row: one group at a time.
                    cotangent.fill(zero);
                    cotangent[c] = present;
                    row.fill(zero);
                    map.vjp_each(&mut recording, &mut cotangent, &mut row);
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

/// The rows of the residuals' Jacobian, a column-major matrix with the residuals as
/// its last column: each row times the root of its weight, and zero where a lane has no
/// pair. There is a row for each lane, component and group of eight pairs, in this
/// order.
pub(super) struct Rows<'a> {
    pub(super) blocks: Blocks<'a>,
    pub(super) rows: &'a mut [f64],
}

impl Kernel for Rows<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Pack>(self) {
        let Self { blocks: Blocks { map, weights, input, output }, rows } = self;
        let dim = weights.len();
        let zero = V::zero();
        let mut recording = map.recording::<V>();
        let (mut state, mut target) = (vec![zero; dim], vec![zero; dim]);
        let mut cotangent = vec![zero; dim];
        // One row for each component, the residual behind it.
        let columns = map.parameters().len() + 1;
        let mut group = vec![zero; dim * columns];
        let stride = rows.len() / columns;
        let mut first = 0;
        for (input, output) in in_chunks(input, output, V::LANES * dim) {
            crate::network::load(input, dim, &mut state);
            crate::network::load(output, dim, &mut target);
            let present = present::<V>(input.len() / dim);
            map.forward_recorded_each(&mut state, &mut recording);
            group.fill(zero);
            for (c, row) in group.chunks_exact_mut(columns).enumerate() {
                let root = present * V::from_f64(libm::sqrt(weights[c]));
                cotangent.fill(zero);
                cotangent[c] = root;
                let (row, residual) = row.split_at_mut(columns - 1);
                map.vjp_each(&mut recording, &mut cotangent, row);
                residual[0] = (state[c] - target[c]) * root;
            }
            // All rows of a column at once: columns are far from one another.
            for (column, rows) in rows.chunks_exact_mut(stride).enumerate() {
                let rows = &mut rows[first..first + dim * V::LANES];
                for (c, lanes) in rows.chunks_exact_mut(V::LANES).enumerate() {
                    group[c * columns + column].store(lanes);
                }
            }
            first += dim * V::LANES;
        }
    }
}
