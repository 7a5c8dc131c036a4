//! The axioms of a circle action, for Φ and for ψ∘Φ∘ψ⁻¹.

use crate::samples::{Case, wide};
use crate::suite;
use crate::watched::watched;
use gyroceptron::measure::{
    certificate::{Row, Tally},
    laws,
};
use std::sync::OnceLock;

pub const STATED: usize = 1000;

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| suite::run("circle-action", STATED / 2, wide(1, 40), measure))
}

fn measure(case: &Case) -> Vec<Tally> {
    let (network, samples) = (case.gyroceptron(), case.samples(2));
    let family = watched("circle_action", &network);
    let plain = laws::circle_action(&family, &samples);
    let conjugated = laws::conjugated_circle_action(&family, &samples);
    plain.into_iter().chain(conjugated).collect()
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}
