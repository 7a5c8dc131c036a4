//! The drift of an adiabatic invariant, and the exponents by which it is judged.

use crate::error::Error;
use crate::layer::CircleAction;
use crate::phase::Map;
use crate::scalar::max_or_nan;
use std::f64::consts::TAU;

/// μ₀ = 𝔍₀∘ψ⁻¹ as a function of a point, [`CircleAction::conjugated_invariant`].
///
/// Source: Duruisseaux, Burby and Tang, <https://doi.org/10.1038/s41598-023-34862-w>; Kruskal,
/// <https://doi.org/10.1063/1.1724285>.
pub fn leading_invariant<'a, M: Map<f64> + ?Sized>(
    psi: &'a M,
    weights: &[i32],
) -> impl Fn(&[f64]) -> f64 + use<'a, M> {
    let action = CircleAction::new(weights);
    move |z| action.conjugated_invariant(psi, z)
}

/// D(N) = max over k ≤ N of |μ(P^k z) − μ(z)| for each N of `horizons`, which
/// have to ascend. It is NaN once a value of μ is NaN.
///
/// Cost: as many evaluations of the map and of μ as the last horizon.
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

/// The resonance θ = 2πp/q that is nearest to an angle, among those of a bounded period q.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resonance {
    /// The whole turns p of its fraction p/q.
    pub turns: u32,
    /// The period q of its fraction p/q, in steps.
    pub period: u32,
    /// |θ − 2πp/q| modulo 2π, in radians.
    pub distance: f64,
}

/// The resonance nearest to the angle with a period of at most `largest`; None for
/// an angle that is not finite.
///
/// At a distance δ ≫ ε the drift of μ₀ is about ε/δ. On the resonance it tends to
/// the width of an island, which does not shrink with ε.
pub fn nearest_resonance(theta: f64, largest: u32) -> Option<Resonance> {
    let turn = theta.rem_euclid(TAU) / TAU;
    (1..=largest)
        .map(|q| {
            let p = (turn * f64::from(q)).round();
            let distance = (turn - p / f64::from(q)).abs() * TAU;
            Resonance { turns: p as u32 % q, period: q, distance }
        })
        .filter(|resonance| resonance.distance.is_finite())
        .min_by(|a, b| a.distance.total_cmp(&b.distance))
}

/// The nearest resonance of a plane, m_jθ close to 2πp/q with q ≤ 7, if it is
/// within 10|ε|: so near that μ₀ drifts by about a tenth of its size or more. None
/// where no resonance disturbs the adiabatic invariant.
pub fn disturbing_resonance(action: &CircleAction, theta: f64, epsilon: f64) -> Option<Resonance> {
    const PERIODS: u32 = 7;
    const NEAR: f64 = 10.0;
    action
        .weights()
        .iter()
        .filter(|weight| **weight != 0)
        .filter_map(|&weight| nearest_resonance(f64::from(weight) * theta, PERIODS))
        .filter(|r| !(r.distance >= NEAR * epsilon.abs()))
        .min_by(|a, b| a.distance.total_cmp(&b.distance))
}

impl std::fmt::Display for Resonance {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { turns, period, distance } = self;
        write!(out, "2π·{turns}/{period}, at a distance of {distance:.1e}")
    }
}

/// The number of first iterations whose drift sets the threshold of [`invariant_horizon`]: K(ε) = ⌊10 + ε^{−1/4}⌋.
///
/// # Errors
/// Unless 0 < ε < ∞.
pub fn settling_iterations(epsilon: f64) -> Result<usize, Error> {
    Error::check_range("epsilon", epsilon, Error::LEAST_POSITIVE, f64::MAX)?;
    Ok((10.0 + libm::pow(epsilon, -0.25)).floor() as usize)
}

/// The first iteration N(ε) at which |μ − μ(z)| exceeds `factor` times its
/// largest value over the first K(ε) iterations; None where it does not up to `most`.
///
/// Source: section "Numerical Confirmation of the Existence of Adiabatic
/// Invariants" of <https://doi.org/10.1038/s41598-023-34862-w>, which takes
/// 1.1 for the factor.
///
/// # Errors
/// Unless 0 < ε < ∞.
pub fn invariant_horizon(
    map: &(impl Map<f64> + ?Sized),
    invariant: &dyn Fn(&[f64]) -> f64,
    start: &[f64],
    epsilon: f64,
    factor: f64,
    most: usize,
) -> Result<Option<usize>, Error> {
    let settling = settling_iterations(epsilon)?;
    let mut z = start.to_vec();
    let initial = invariant(&z);
    let mut largest = 0.0;
    for step in 1..=most {
        map.forward(&mut z);
        let drift = (invariant(&z) - initial).abs();
        if step <= settling {
            largest = max_or_nan(largest, drift);
        } else if !(drift <= factor * largest) {
            return Ok(Some(step));
        }
    }
    Ok(None)
}

/// A straight line through points, by least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedLine {
    /// The slope of the line.
    pub slope: f64,
    /// The standard error of the slope.
    pub slope_error: f64,
    /// The number of points less 2.
    pub degrees_of_freedom: usize,
}

/// Fits a line to log y against log x. It is NaN when a value is not positive and
/// finite, when there are fewer than three points, or when the lengths differ.
pub fn log_line(x: &[f64], y: &[f64]) -> FittedLine {
    let nan = FittedLine { slope: f64::NAN, slope_error: f64::NAN, degrees_of_freedom: 0 };
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
    FittedLine { slope, slope_error, degrees_of_freedom }
}

/// The slope of the line that [`log_line`] fits to logarithms.
pub fn log_slope(x: &[f64], y: &[f64]) -> f64 {
    log_line(x, y).slope
}
