//! I₀ = Id, and how I_ε leaves it.

use super::stopping::until_stopped;
use crate::network::{Layers, Model};
use crate::phase::Map;
use crate::scalar::{Dual, Scalar, max_or_nan};

/// The number of components of z that the map changes, bit for bit.
pub fn differing_components(map: &(impl Map<f64> + ?Sized), z: &[f64]) -> usize {
    let mut moved = z.to_vec();
    map.forward(&mut moved);
    moved.iter().zip(z).filter(|(a, b)| a.to_bits() != b.to_bits()).count()
}

/// The largest |P(z) − z|, over all components and points (2n numbers each).
pub fn near_identity_size(map: &(impl Map<f64> + ?Sized), points: &[f64]) -> f64 {
    largest_change(points, 2 * map.dof(), |z| map.forward(z))
}

/// The root mean square of P(z) − z over all components and points.
pub fn near_identity_rms(map: &(impl Map<f64> + ?Sized), points: &[f64]) -> f64 {
    let mut squares = 0.0;
    for z in points.chunks_exact(2 * map.dof()) {
        let mut moved = z.to_vec();
        map.forward(&mut moved);
        squares += moved.iter().zip(z).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
    }
    (squares / points.len() as f64).sqrt()
}

/// The largest |Q(P(z)) − z|: with P = I_ε and Q = I_{−ε} of order ε², since
/// I_{−ε} undoes I_ε to first order only.
pub fn near_identity_undoing(
    map: &(impl Map<f64> + ?Sized),
    other: &(impl Map<f64> + ?Sized),
    points: &[f64],
) -> f64 {
    largest_change(points, 2 * map.dof(), |z| {
        map.forward(z);
        other.forward(z);
    })
}

fn largest_change(points: &[f64], dim: usize, f: impl Fn(&mut [f64])) -> f64 {
    let mut largest = 0.0;
    for point in until_stopped(points.chunks_exact(dim)) {
        let mut moved = point.to_vec();
        f(&mut moved);
        for (a, b) in moved.iter().zip(point) {
            largest = max_or_nan(largest, (a - b).abs());
        }
    }
    largest
}

/// `out` ← X_{G₁}(z) = Ω∇G₁, the derivative of I_ε in ε at 0, from the formula
/// G₁ = −Σ_layers [V(y) + V(−y−η) + V(−x) + V(x−η)] with (x, y) = (q, p), of all Hénon layers
/// that ε scales.
///
/// G₁ is formed as a number, with V(y) = w·tanh(Wᵀy + b) read off the flat
/// parameters, and differentiated by duals: nothing of the kicks' own gradient
/// enters. Cost: 2n evaluations of G₁.
pub fn near_identity_generator(network: &Model, z: &[f64], out: &mut [f64]) {
    type Number = Dual<f64, 1>;
    let n = network.architecture().dof;
    let scaled =
        network.architecture().layers().into_iter().filter_map(|(block, number, range)| {
            let Layers::Henon(widths) = &block.layers else { return None };
            block.scale.has_epsilon().then(|| (widths[number], &network.parameters()[range]))
        });
    let layers: Vec<(usize, &[f64])> = scaled.collect();
    let slope = |direction: usize| {
        let w: Vec<Number> = z
            .iter()
            .enumerate()
            .map(|(i, &v)| if i == direction { Dual::variable(v, 0) } else { Dual::constant(v) })
            .collect();
        let mut total = Number::zero();
        for &(h, parameters) in &layers {
            let (w_in, rest) = parameters.split_at(n * h);
            let (b_in, rest) = rest.split_at(h);
            let (w_out, eta) = rest.split_at(h);
            let potential = |at: &dyn Fn(usize) -> Number| {
                let mut value = Number::zero();
                for j in 0..h {
                    let mut argument = Number::constant(b_in[j]);
                    for i in 0..n {
                        argument = Number::constant(w_in[i * h + j]).mul_add(at(i), argument);
                    }
                    value = Number::constant(w_out[j]).mul_add(argument.tanh(), value);
                }
                value
            };
            let eta = |i: usize| Number::constant(eta[i]);
            total = total
                - potential(&|i| w[n + i])
                - potential(&|i| -w[n + i] - eta(i))
                - potential(&|i| -w[i])
                - potential(&|i| w[i] - eta(i));
        }
        total.eps[0]
    };
    for i in 0..n {
        out[i] = slope(n + i);
        out[n + i] = -slope(i);
    }
}
