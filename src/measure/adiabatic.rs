//! The drift of an adiabatic invariant, and the exponents it is judged by.

use crate::phase::Map;
use crate::scalar::max_or_nan;

/// D(N) = max over k ≤ N of |μ(P^k z) − μ(z)| for each N of `horizons`, which
/// have to ascend. NaN from where a value is.
///
/// Cost: as many evaluations of the map and of μ as the last horizon says.
pub fn invariant_drift(
    map: &(impl Map<f64> + ?Sized),
    invariant: &dyn Fn(&[f64]) -> f64,
    start: &[f64],
    horizons: &[usize],
) -> Vec<f64> {
    let mut z = start.to_vec();
    let initial = invariant(&z);
    let (mut largest, mut steps) = (0.0, 0);
    let to_horizon = |&horizon: &usize| {
        while steps < horizon {
            map.forward(&mut z);
            largest = max_or_nan(largest, (invariant(&z) - initial).abs());
            steps += 1;
        }
        largest
    };
    horizons.iter().map(to_horizon).collect()
}

/// A straight line through points, by least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Its slope.
    pub slope: f64,
    /// The standard error of the slope; NaN for two points.
    pub slope_error: f64,
    /// The number of points less 2.
    pub degrees_of_freedom: usize,
}

/// The line of log y against log x; NaN when a value is not positive and
/// finite or there are fewer than three.
pub fn log_line(x: &[f64], y: &[f64]) -> Line {
    let nan = Line { slope: f64::NAN, slope_error: f64::NAN, degrees_of_freedom: 0 };
    let positive = |v: &[f64]| v.iter().all(|a| *a > 0.0 && a.is_finite());
    if x.len() != y.len() || x.len() < 3 || !positive(x) || !positive(y) {
        return nan;
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
    let slope = xy / xx;
    let residual = |(a, b): (&f64, &f64)| (b - mean_y) - slope * (a - mean_x);
    let squares: f64 = x.iter().zip(&y).map(residual).map(|r| r * r).sum();
    let degrees_of_freedom = x.len() - 2;
    let slope_error = (squares / degrees_of_freedom as f64 / xx).sqrt();
    Line { slope, slope_error, degrees_of_freedom }
}

/// The slope of [`log_line`].
pub fn log_slope(x: &[f64], y: &[f64]) -> f64 {
    log_line(x, y).slope
}
