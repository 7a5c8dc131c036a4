//! I₀ = Id bit for bit, for any weights; the orders of what ε moves; the
//! generator of I_ε.

use crate::samples::{Case, mild, wide};
use crate::suite;
use crate::watched::watched;
use gyroceptron::measure::{
    certificate::{Row, Tally},
    laws,
};
use gyroceptron::scalar::max_or_nan;
use std::sync::OnceLock;

/// Networks of the orders in ε; the bitwise laws run fifty times as many points.
pub const STATED: usize = 40;

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| {
        let bitwise = suite::run("near-identity-bitwise", 25 * STATED, wide(1, 40), bitwise);
        let orders = suite::run("near-identity-orders", STATED, mild(1, 12), orders);
        [bitwise, orders].concat()
    })
}

fn bitwise(case: &Case) -> Vec<Tally> {
    laws::identity_at_zero(&watched("near_identity", &case.gyroceptron()), &case.points(2))
}

fn orders(case: &Case) -> Vec<Tally> {
    let network = case.gyroceptron();
    let points = case.points(50);
    let mut out = laws::near_identity_orders(&watched("near_identity", &network), &points);
    out.push(laws::formula_of_generator(&network, &points));
    out
}

pub fn largest_shortfall() -> f64 {
    rows()[2..].iter().map(|row| row.largest.unwrap_or(f64::NAN)).fold(0.0, max_or_nan)
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}

/// Weights whose products overflow give 0·∞ where ε = 0 is multiplied in.
#[test]
fn nothing_moves_at_zero_even_where_the_weights_overflow() {
    use gyroceptron::layer::HenonLayer;
    use gyroceptron::measure::ratios::differing_components;
    use gyroceptron::phase::Map;
    for size in [1.0, 1e155, 1e200, f64::MAX] {
        let weights = [size; 4].repeat(5);
        for zero in [0.0, -0.0] {
            let layer = HenonLayer::new(2, 4, zero, &weights[..18]);
            for z in [[1.0, -0.0, 5e-324, 1e308], [f64::MAX, -f64::MAX, 1e-300, -3.0]] {
                assert_eq!(differing_components(&layer, &z), 0, "{size:e} {z:?}");
                let mut back = z;
                layer.inverse(&mut back);
                assert!(back.iter().zip(&z).all(|(a, b)| a.to_bits() == b.to_bits()));
            }
        }
    }
}
