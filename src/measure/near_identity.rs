//! I₀ = Id, and how I_ε leaves it.

use crate::phase::Map;
use crate::scalar::max_or_nan;

/// The number of components of z that the map changes, bit for bit.
pub fn differing_components(map: &impl Map<f64>, z: &[f64]) -> usize {
    let mut moved = z.to_vec();
    map.forward(&mut moved);
    moved.iter().zip(z).filter(|(a, b)| a.to_bits() != b.to_bits()).count()
}

/// The largest |P(z) − z|, over all components and points (2n numbers each).
pub fn near_identity_size(map: &impl Map<f64>, points: &[f64]) -> f64 {
    largest_change(points, 2 * map.dof(), |z| map.forward(z))
}

/// The largest |Q(P(z)) − z|: with P = I_ε and Q = I_{−ε} of order ε², since
/// I_{−ε} undoes I_ε to first order only.
pub fn near_identity_undoing(map: &impl Map<f64>, other: &impl Map<f64>, points: &[f64]) -> f64 {
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

/// The slope of log y against log x by least squares; NaN when a value is not
/// positive or there are fewer than three.
pub fn log_slope(x: &[f64], y: &[f64]) -> f64 {
    let positive = |v: &[f64]| v.iter().all(|a| *a > 0.0 && a.is_finite());
    if x.len() != y.len() || x.len() < 3 || !positive(x) || !positive(y) {
        return f64::NAN;
    }
    let logs = |v: &[f64]| v.iter().map(|a| libm::log(*a)).collect::<Vec<_>>();
    let (x, y) = (logs(x), logs(y));
    let count = x.len() as f64;
    let (mean_x, mean_y) = (x.iter().sum::<f64>() / count, y.iter().sum::<f64>() / count);
    let (mut xy, mut xx) = (0.0, 0.0);
    for (a, b) in x.iter().zip(&y) {
        xy += (a - mean_x) * (b - mean_y);
        xx += (a - mean_x) * (a - mean_x);
    }
    xy / xx
}
