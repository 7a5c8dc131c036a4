//! P₀ = ψ∘Φ_θ∘ψ⁻¹, bit for bit.

use crate::samples::wide;
use crate::suite;
use crate::watched::watched;
use gyroceptron::measure::{certificate::Row, laws};
use std::sync::OnceLock;

pub const STATED: usize = 1000;

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| {
        suite::run("near-periodicity", STATED / 2, wide(1, 40), |case| {
            vec![laws::near_periodicity(
                &watched("near_periodicity", &case.gyroceptron()),
                &case.points(2),
            )]
        })
    })
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}
