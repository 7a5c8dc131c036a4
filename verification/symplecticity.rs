//! JᵀΩJ = Ω, for networks of all depths, widths, weights and inputs.

use crate::samples::{Case, Input, grid, wide};
use crate::watched::watched;
use crate::{suite, tolerances};
use gyroceptron::measure::{
    certificate::{Row, Verdict},
    laws,
};
use std::sync::OnceLock;

/// Half of them HénonNets, half gyroceptrons. One degree of freedom would
/// hide a wrong outer factor.
pub const STATED: usize = 4000;

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| suite::run("symplecticity", STATED / 4, wide(2, 40), measure))
}

fn measure(case: &Case) -> Vec<gyroceptron::measure::certificate::Tally> {
    let points = case.points(2);
    vec![
        laws::symplecticity(&watched("symplecticity", &case.henon_net()), &points),
        laws::symplecticity(&watched("symplecticity", &case.model()), &points),
    ]
}

pub fn clean_median() -> f64 {
    rows()[0].median.expect("measured")
}

/// The median where all inputs are of size 1e8.
pub fn saturated_median() -> f64 {
    let all = grid()
        .into_iter()
        .filter(|case| case.input == Input::Uniform(1e8) && case.scale == 1.0)
        .map(|case| laws::symplecticity(&case.henon_net(), &case.points(2)));
    let mut all: Vec<_> = gyroceptron::measure::certificate::merged(all);
    let row = all.remove(0).row();
    assert_eq!(row.verdict, Verdict::Vacuous, "{row:?}");
    row.median.expect("measured")
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}

#[test]
fn the_samples_show_something() {
    let [low, high] = tolerances::CLEAN_MEDIAN;
    let median = clean_median();
    assert!(low <= median && median <= high, "the suite is vacuous: median of ρ_S {median}");
}

/// All 360 configurations in an extensive run, each fifth otherwise.
#[test]
fn holds_on_the_grid_of_configurations() {
    let each = if suite::extensive() { 1 } else { 5 };
    let cases = grid();
    let tallies = cases.iter().step_by(each).map(|case| {
        let tally = laws::symplecticity(&case.henon_net(), &case.points(8));
        let row = tally.row();
        assert!(row.largest.is_some_and(|r| r < tolerances::RATIO), "{case:?}: {row:?}");
        tally
    });
    let all = gyroceptron::measure::certificate::merged(tallies);
    let row = all[0].row();
    println!("{} samples: largest {:?}, median {:?}", row.samples, row.largest, row.median);
    assert_eq!(row.samples, 8 * cases.len().div_ceil(each));
}
