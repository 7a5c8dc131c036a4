//! I₀ = Id bit for bit, for any weights; the orders of what ε moves; the
//! generator of I_ε.

use crate::samples::{Case, mild, wide};
use crate::suite;
use gyroceptron::measure::{Row, Tally, laws, near_identity_generator};
use std::sync::OnceLock;

pub const STATED: usize = 1000;

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| {
        let bitwise = suite::run("near-identity-bitwise", STATED / 2, wide(1, 40), bitwise);
        let orders = suite::run("near-identity-orders", STATED / 50, mild(1, 12), orders);
        [bitwise, orders].concat()
    })
}

fn bitwise(case: &Case) -> Vec<Tally> {
    laws::near_identity(&case.gyroceptron(), &case.points(2)).into_iter().take(2).collect()
}

fn orders(case: &Case) -> Vec<Tally> {
    let network = case.gyroceptron();
    let own = network.near_identity();
    let points = case.points(50);
    let field = |z: &[f64], out: &mut [f64]| near_identity_generator(&own, z, out);
    let mut out = laws::near_identity(&network, &points).split_off(2);
    out.push(laws::generator(&network, &field, &points));
    out
}

pub fn largest_shortfall() -> f64 {
    rows()[2..].iter().filter_map(|row| row.largest).fold(0.0, f64::max)
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}

/// Weights whose products overflow give 0·∞ where ε = 0 is multiplied in.
#[test]
fn nothing_moves_at_zero_even_where_the_weights_overflow() {
    use gyroceptron::layer::HenonLayer;
    use gyroceptron::measure::differing_components;
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
