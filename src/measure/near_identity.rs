//! I₀ = Id, and how I_ε leaves it.

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
