//! Symmetries of the parameters, bit for bit.

use crate::samples::wide;
use crate::suite;
use gyroceptron::measure::{Relation, Row, laws};
use std::sync::OnceLock;

pub const STATED: usize = 1000;

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| {
        suite::run("exact-relations", STATED / 2, wide(1, 40), |case| {
            let (model, points) = (case.model(), case.points(2));
            Relation::ALL
                .map(|relation| {
                    let other = relation.transform_model(&model).expect("finite");
                    let transform = |z: &mut [f64]| relation.transform_point(z);
                    laws::exact_relation(relation.equation(), &model, &other, &transform, &points)
                })
                .into()
        })
    })
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}
