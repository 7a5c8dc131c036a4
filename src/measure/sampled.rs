//! The integral and the period of quantities that are sampled at equal intervals of time.

use super::accuracy::root_mean_square;

/// The integral of a quantity over time by Simpson's rule, from its values at times `interval` apart.
///
/// It is exact for polynomials of degree three; the error of other smooth quantities is O(interval⁴).
///
/// Source: NIST Digital Library of Mathematical Functions, 3.5(ii), <https://dlmf.nist.gov/3.5#ii>.
///
/// # Panics
/// Unless there is an odd number of values, three at least.
pub fn simpson(values: &[f64], interval: f64) -> f64 {
    assert!(values.len() >= 3 && values.len() % 2 == 1, "an odd number of values");
    let last = values.len() - 1;
    let weight = |k: usize| match k {
        0 => 1.0,
        k if k == last => 1.0,
        k if k % 2 == 1 => 4.0,
        _ => 2.0,
    };
    let sum: f64 = values.iter().enumerate().map(|(k, value)| weight(k) * value).sum();
    sum * interval / 3.0
}

/// The mean time between two rises of a quantity through its mean, from its values at times `interval`
/// apart.
///
/// A rise is placed between two values by linear interpolation. None where there are fewer than two
/// rises, where a value is NaN, or where the root mean square of the deviations is no more than 5 % of
/// the mean.
pub fn mean_period(values: &[f64], interval: f64) -> Option<f64> {
    /// The least root mean square deviation, over the mean, that counts as an oscillation.
    const LEAST_SWING: f64 = 0.05;
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let deviations: Vec<f64> = values.iter().map(|value| value - mean).collect();
    if !(root_mean_square(&deviations) > LEAST_SWING * mean.abs()) {
        return None;
    }
    let mut rises = Vec::new();
    for (k, pair) in deviations.windows(2).enumerate() {
        let (before, after) = (pair[0], pair[1]);
        if before < 0.0 && after >= 0.0 {
            rises.push(k as f64 + before / (before - after));
        }
    }
    match rises[..] {
        [first, .., last] => Some((last - first) / (rises.len() - 1) as f64 * interval),
        _ => None,
    }
}
