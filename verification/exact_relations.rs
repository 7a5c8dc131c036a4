//! Symmetries of the parameters, bit for bit.

use crate::samples::wide;
use crate::suite;
use gyroceptron::measure::{certificate::Row, laws, ratios::Relation};
use std::sync::OnceLock;

pub const STATED: usize = 1000;

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| {
        suite::run("exact-relations", STATED / 2, wide(1, 40), |case| {
            let tallies = laws::exact_relations(&case.model(), &case.points(2));
            assert_eq!(tallies.len(), Relation::ALL.len(), "finite weights");
            tallies
        })
    })
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}
