//! All ways of evaluating a map give the same bits.

use crate::samples::wide;
use crate::suite;
use crate::watched::watched;
use gyroceptron::measure::{certificate::Row, laws};
use std::sync::OnceLock;

pub const STATED: usize = 5000;

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| {
        // Eleven points: a full register and a ragged one.
        suite::run("evaluation", STATED.div_ceil(11), wide(1, 40), |case| {
            vec![laws::evaluation(&watched("evaluation", &case.model()), &case.points(11))]
        })
    })
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}

#[test]
fn threads_do_not_change_a_bit() {
    use gyroceptron::network::map_points;
    use gyroceptron::phase::Direction;
    use proptest::strategy::{Strategy, ValueTree};
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let case = wide(2, 8).new_tree(&mut runner).expect("a case").current();
    let model = case.model();
    let on = |threads: usize| {
        let mut points = case.points(3001);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| map_points(model.composition(), Direction::Forward, &mut points))
            .expect("whole points");
        points.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(on(1), on(2));
    assert_eq!(on(1), on(3));
}

/// What a map writes down of itself, done again, is the map.
#[test]
fn traces_do_what_the_map_does() {
    use gyroceptron::phase::Map;
    use gyroceptron::scalar::Trace;
    use proptest::strategy::{Strategy, ValueTree};
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    for _ in 0..40 {
        let case = wide(1, 8).new_tree(&mut runner).expect("a case").current();
        let model = case.model();
        let dim = 2 * Map::<f64>::dof(&model);
        for inverse in [false, true] {
            let trace = Trace::new(dim, |z| {
                if inverse {
                    model.inverse(z)
                } else {
                    model.forward(z)
                }
                z.to_vec()
            });
            for z in case.points(3).chunks_exact(dim) {
                let mut moved = z.to_vec();
                if inverse {
                    model.inverse(&mut moved)
                } else {
                    model.forward(&mut moved)
                }
                let bits = |of: &[f64]| of.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(&trace.evaluate(z)), bits(&moved));
            }
        }
    }
}
