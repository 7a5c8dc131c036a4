//! SympNets: every law that is not of a circle action, on linear and activation
//! modules, whose rounding scales nobody derived by hand.

use crate::compositions::{Broken, measure, named, points};
use crate::mutants::Fault;
use crate::watched::watched;
use crate::{precision, suite, tolerances};
use gyroceptron::layer::Activation;
use gyroceptron::measure::certificate::{Row, Tally, Verdict, merged};
use gyroceptron::network::{Model, SympNetShape};
use gyroceptron::random::Stream;
use gyroceptron::scalar::max_or_nan;
use proptest::prelude::*;
use proptest::sample::select;
use std::sync::OnceLock;

pub const STATED: usize = 400;
const NAME: &str = " of SympNets";

/// A network and where its points are.
#[derive(Clone, Debug)]
pub struct Case {
    pub shape: SympNetShape,
    scale: f64,
    radius: f64,
    seed: u64,
}

impl Case {
    pub fn network(&self) -> Model {
        let mut stream = Stream::new(self.seed, "weights");
        let count = self.shape.parameter_count();
        let parameters = (0..count).map(|_| self.scale * stream.normal()).collect();
        Model::new(self.shape.architecture(), parameters).expect("as many parameters")
    }

    fn points(&self, count: usize) -> Vec<f64> {
        points(self.seed, self.radius, self.shape.dof, count)
    }
}

/// Networks of up to `modules` linear modules, of `least` degrees of freedom to 4.
fn cases(least: usize, modules: usize) -> impl Strategy<Value = Case> {
    let shape = (
        least..=4_usize,
        1..=modules,
        1..=4_usize,
        select(Activation::ALL.to_vec()),
        any::<bool>(),
    )
        .prop_map(|(dof, modules, shears, activation, plain)| SympNetShape {
            dof,
            modules,
            shears,
            activation,
            plain,
        });
    let scales = select(vec![0.1, 0.3, 1.0]);
    let radii = select(vec![1.6, 1.6, 1e-8, 1e8]);
    (shape, scales, radii, any::<u64>()).prop_map(|(shape, scale, radius, seed)| Case {
        shape,
        scale,
        radius,
        seed,
    })
}

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| {
        let rows = suite::run("symp_net", STATED / 2, cases(2, 8), |case| {
            let network = case.network();
            let (points, dof) = (case.points(11), case.shape.dof);
            let map = watched("symp_net", &network);
            measure(&map, network.composition(), &points, dof, case.seed)
        });
        named(rows, NAME)
    })
}

/// The defects of SympNets are rounding and nothing else: the same weights at single,
/// double and double-double precision.
#[test]
fn the_ladder_is_that_of_rounding() {
    let mut worst = 0.0;
    for (index, activation) in Activation::ALL.into_iter().enumerate() {
        let shape =
            SympNetShape { dof: precision::DOF, modules: 4, shears: 3, activation, plain: false };
        for seed in 0..4 * suite::times() as u64 {
            let seed = suite::seed() + 100 * index as u64 + seed;
            let mut stream = Stream::new(seed, "ladder weights");
            let count = shape.parameter_count();
            let weights = precision::single((0..count).map(|_| 0.4 * stream.normal()));
            let network = Model::new(shape.architecture(), weights).expect("as many parameters");
            for defect in precision::defects(network.composition(), seed) {
                worst = max_or_nan(worst, defect);
            }
        }
    }
    assert!(worst <= tolerances::LADDER_THREE_RUNGS, "{worst}");
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}

/// All laws of SympNets on one with this fault.
pub fn rows_of_mutant(fault: Fault) -> Vec<Row> {
    let tallies = Activation::ALL.into_iter().flat_map(|activation| {
        let shape = SympNetShape { dof: 2, modules: 4, shears: 3, activation, plain: false };
        let case = Case { shape, scale: 0.3, radius: 1.6, seed: 1 };
        let broken = Broken::new(fault, case.network().composition());
        measure(&broken, &broken, &case.points(11), 2, 1)
    });
    named(merged(tallies).iter().map(Tally::row).collect(), NAME)
}

#[test]
fn a_sound_one_is_not_rejected() {
    // A fault that is none of a SympNet.
    for row in rows_of_mutant(Fault::Friction) {
        assert_eq!(row.verdict, Verdict::Holds, "{row:?}");
    }
}
