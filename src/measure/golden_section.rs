//! The search for a minimum of a function of one number.

use crate::stopping::is_stopped;

/// Steps of a search, at most.
const STEPS: usize = 60;

/// An interval at most `enough` wide around a minimum of a function with a single one between two ends; wider after 60
/// steps, or where the computation is to stop.
///
/// Source: Kiefer, <https://doi.org/10.1090/S0002-9939-1953-0055639-3>.
pub(super) fn golden_section(
    at: impl Fn(f64) -> f64,
    [mut low, mut high]: [f64; 2],
    enough: f64,
) -> [f64; 2] {
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut a, mut b) = (high - golden * (high - low), low + golden * (high - low));
    let (mut of_a, mut of_b) = (at(a), at(b));
    for _ in 0..STEPS {
        if high - low <= enough || is_stopped() {
            break;
        }
        if of_a < of_b {
            (high, b, of_b) = (b, a, of_a);
            a = high - golden * (high - low);
            of_a = at(a);
        } else {
            (low, a, of_a) = (a, b, of_b);
            b = low + golden * (high - low);
            of_b = at(b);
        }
    }
    [low, high]
}
