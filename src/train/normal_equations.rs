//! The Gauss–Newton matrix of a loss, in pieces: never the whole Jacobian.

use super::Objective;
use super::kernels::{Blocks, Rows};
use super::loss::Term;
use crate::network::Composition;
use crate::scalar::{WIDTH, on_lanes};
use crate::work;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;
use std::ops::Range;

/// The quadratic model of a loss in the parameters: loss + gᵀδ + ½δᵀAδ.
///
/// Source: Nocedal and Wright, Numerical Optimization, section 10.3,
/// <https://doi.org/10.1007/978-0-387-40065-5>.
#[derive(Clone, Debug)]
pub struct NormalEquations {
    /// A = (2/N) Σ Σ_c weight_c ∇residual_c ∇residual_cᵀ; the lower triangle, the
    /// rest is zero.
    pub matrix: Mat<f64>,
    /// g = (2/N) Σ Σ_c weight_c residual_c ∇residual_c.
    pub gradient: Vec<f64>,
    /// The loss, summed in another order than by [`Objective::value`].
    pub loss: f64,
}

/// Rows that are multiplied at once. Up to this number a product of matrices of two
/// columns and more sums in one pass, one row after another, whatever the caches and
/// registers of a processor are.
const ROWS: usize = 256;

/// Columns of a tile: panels of [`ROWS`] by as many fit into the second cache.
const TILE: usize = 128;

/// Numbers between two columns of rows: without them the columns of a full block would
/// begin 4096 bytes apart, in the same set of the first cache.
const GAP: usize = WIDTH;

/// Numbers in the rows that are held at once: 8 MiB, or those of one block.
const HELD: usize = 1 << 20;

/// A tile of the lower triangle, in rows and columns of the matrix.
struct Tile {
    rows: Range<usize>,
    columns: Range<usize>,
    sums: Mat<f64>,
}

impl Tile {
    /// Those of a matrix of this size, by columns.
    fn all(size: usize) -> Vec<Self> {
        // A single column is left to none, but to a matrix of one.
        let count = if size % TILE == 1 { (size / TILE).max(1) } else { size.div_ceil(TILE) };
        let panel = |k: usize| k * TILE..if k + 1 == count { size } else { (k + 1) * TILE };
        let tile = |rows: Range<usize>, columns: Range<usize>| {
            let sums = Mat::zeros(rows.len(), columns.len());
            Self { rows, columns, sums }
        };
        let of_column = |j: usize| (j..count).map(move |i| tile(panel(i), panel(j)));
        (0..count).flat_map(of_column).collect()
    }

    /// += the products of these rows' columns.
    fn add(&mut self, rows: MatRef<'_, f64>) {
        for first in (0..rows.nrows()).step_by(ROWS) {
            let count = ROWS.min(rows.nrows() - first);
            self.add_some(rows.subrows(first, count));
        }
    }

    /// [`Tile::add`] of no more than [`ROWS`].
    fn add_some(&mut self, rows: MatRef<'_, f64>) {
        let left = rows.get(.., self.rows.clone()).transpose();
        let right = rows.get(.., self.columns.clone());
        let structure = if self.rows == self.columns {
            BlockStructure::TriangularLower
        } else {
            BlockStructure::Rectangular
        };
        let whole = BlockStructure::Rectangular;
        let (sums, one) = (self.sums.as_mut(), 1.0);
        triangular::matmul(sums, structure, Accum::Add, left, whole, right, whole, one, Par::Seq);
    }
}

impl Objective<'_> {
    /// The quadratic model of the loss at the parameters of `map`, p of them: one
    /// Jacobian pass, and Np²n multiplications.
    ///
    /// Blocks of rows of the residuals' Jacobian J, with the residuals as its last column, are
    /// summed to JᵀJ. One thread sums each tile of the result, over the blocks in their order, so
    /// that the bits are the same on any number of threads.
    pub fn normal_equations(&self, map: &Composition<f64>) -> NormalEquations {
        let count = map.parameters().len();
        let factor = 2.0 / self.pairs().len() as f64;
        let terms = self.terms(map);
        let mut out = if map.controls().is_none() {
            let mut tiles = Tile::all(count + 1);
            terms.iter().for_each(|term| term.add_to(&mut tiles));
            NormalEquations::of_tiles(&tiles, count, factor)
        } else {
            let (matrix, gradient) = (Mat::zeros(count, count), vec![0.0; count]);
            let mut out = NormalEquations { matrix, gradient, loss: 0.0 };
            for term in &terms {
                let own = term.map.parameters().len();
                let mut tiles = Tile::all(own + 1);
                term.add_to(&mut tiles);
                out.add(&NormalEquations::of_tiles(&tiles, own, factor), &term.products);
            }
            out
        };
        for (k, pull) in self.angle_penalty_gradients(map) {
            out.matrix[(k, k)] += 2.0 * self.angle_stiffness();
            out.gradient[k] += 2.0 * pull;
        }
        out.loss += self.angle_cost(map);
        out
    }
}

impl NormalEquations {
    /// The normal equations that the tiles have summed, for `count` parameters.
    fn of_tiles(tiles: &[Tile], count: usize, factor: f64) -> Self {
        let (matrix, gradient) = (Mat::zeros(count, count), vec![0.0; count]);
        let mut out = Self { matrix, gradient, loss: 0.0 };
        for Tile { rows, columns, sums } in tiles {
            for (j, column) in columns.clone().enumerate() {
                for (i, row) in rows.clone().enumerate().filter(|(_, row)| *row >= column) {
                    let sum = factor * sums[(i, j)];
                    if row < count {
                        out.matrix[(row, column)] = sum;
                    } else if column < count {
                        out.gradient[column] = sum;
                    } else {
                        out.loss = 0.5 * sum;
                    }
                }
            }
        }
        out
    }

    /// Adds the equations of a map whose parameters are sums of the network's times products of controls: a row of
    /// the network's Jacobian repeats that of the map, once for each product and multiplied by it.
    fn add(&mut self, of: &Self, products: &[f64]) {
        let size = of.gradient.len();
        for (b, right) in products.iter().enumerate() {
            for (g, part) in self.gradient[b * size..][..size].iter_mut().zip(&of.gradient) {
                *g = right.mul_add(*part, *g);
            }
            for (a, left) in products.iter().enumerate().skip(b) {
                let both = left * right;
                for column in 0..size {
                    // Only the lower triangle of the map's matrix is there.
                    let first = if a == b { column } else { 0 };
                    for row in first..size {
                        let entry = of.matrix[(row.max(column), row.min(column))];
                        let sum = &mut self.matrix[(a * size + row, b * size + column)];
                        *sum = both.mul_add(entry, *sum);
                    }
                }
            }
        }
        self.loss += of.loss;
    }
}

impl Term<'_> {
    fn add_to(&self, tiles: &mut [Tile]) {
        let dim = self.weights.len();
        let columns = self.map.parameters().len() + 1;
        let groups = (ROWS / (WIDTH * dim)).max(1);
        let block = groups * WIDTH * dim;
        let blocks = (HELD / (block * columns)).max(1);
        // As many for each thread: no bit depends on how many are held.
        let threads = rayon::current_num_threads();
        let blocks = if blocks > threads { blocks - blocks % threads } else { blocks };
        let mut held: Vec<Vec<f64>> = Vec::new();
        for (input, output) in
            self.input.chunks(blocks * block).zip(self.output.chunks(blocks * block))
        {
            let heights: Vec<_> = input
                .chunks(block)
                .map(|part| part.len().div_ceil(WIDTH * dim) * WIDTH * dim)
                .collect();
            held.resize(heights.len(), Vec::new());
            held.par_iter_mut()
                .zip(&heights)
                .zip(input.par_chunks(block).zip(output.par_chunks(block)))
                .for_each(|((rows, height), (input, output))| {
                    work::count(work::Kind::Curvature, input.len() / dim);
                    rows.resize((height + GAP) * columns, 0.0);
                    let blocks = Blocks { map: &self.map, weights: &self.weights, input, output };
                    on_lanes::<WIDTH, _>(Rows { blocks, rows });
                    if self.time != 1.0 {
                        for angle in self.angles.clone() {
                            let column = &mut rows[angle * (height + GAP)..][..*height];
                            column.iter_mut().for_each(|entry| *entry *= self.time);
                        }
                    }
                });
            tiles.par_iter_mut().with_max_len(1).for_each(|tile| {
                for (rows, &height) in held.iter().zip(&heights) {
                    tile.add(MatRef::from_column_major_slice_with_stride(
                        rows,
                        height,
                        columns,
                        height + GAP,
                    ));
                }
            });
        }
    }
}
