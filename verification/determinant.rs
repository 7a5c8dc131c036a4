//! det J = 1, where it can be known. For information: what keeps volumes need
//! not be symplectic, and the LU decomposition of a large Jacobian has no digit.

use crate::samples::wide;
use crate::suite;
use crate::watched::watched;
use gyroceptron::measure::{
    certificate::{Row, Verdict},
    laws,
};
use std::sync::OnceLock;

pub const STATED: usize = 1000;

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| {
        suite::run("determinant", STATED / 2, wide(2, 40), |case| {
            vec![laws::determinant(&watched("determinant", &case.henon_net()), &case.points(2))]
        })
    })
}

#[test]
fn is_reported_and_no_more() {
    suite::assert_holds(rows(), STATED);
    assert_eq!(rows()[0].verdict, Verdict::Reported);
    // The gate closes on some and leaves others.
    assert!(rows()[0].ill_conditioned > 0);
    assert!(rows()[0].largest.expect("measured") > 0.0);
}
