//! I₀ = Id, and how I_ε leaves it.

use crate::layer::Potential;
use crate::network::HenonNet;
use crate::phase::Map;
use crate::scalar::max_or_nan;

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
    for point in points.chunks_exact(dim) {
        let mut moved = point.to_vec();
        f(&mut moved);
        for (a, b) in moved.iter().zip(point) {
            largest = max_or_nan(largest, (a - b).abs());
        }
    }
    largest
}

/// `out` ← X_{G₁}(z) = Ω∇G₁, the derivative of I_ε in ε at 0, from the formula
/// G₁ = −Σ_layers [V(y) + V(−y−η) + V(−x) + V(x−η)] with (x, y) = (q, p).
pub fn near_identity_generator(network: &HenonNet<f64>, z: &[f64], out: &mut [f64]) {
    let n = network.shape().dof;
    let (x, y) = z.split_at(n);
    out.fill(0.0);
    let (mut argument, mut slope) = (vec![0.0; n], vec![0.0; n]);
    for layer in network.layers() {
        let eta = layer.eta;
        let mut add = |at: &dyn Fn(usize) -> f64, sign: f64, first: usize| {
            for i in 0..n {
                argument[i] = at(i);
            }
            layer.potential.gradient(&argument, &mut slope);
            for i in 0..n {
                out[first + i] += sign * slope[i];
            }
        };
        // ẋ = ∂G₁/∂y = −g(y) + g(−y−η), ẏ = −∂G₁/∂x = −g(−x) + g(x−η).
        add(&|i| y[i], -1.0, 0);
        add(&|i| -y[i] - eta[i], 1.0, 0);
        add(&|i| -x[i], -1.0, n);
        add(&|i| x[i] - eta[i], 1.0, n);
    }
}
