//! SympNets: every law that is not of a circle action, on linear and activation
//! modules, whose rounding bounds nobody derived by hand.

use crate::{precision, suite, tolerances};
use gyroceptron::layer::Activation;
use gyroceptron::measure::{
    Conditioned, Measurable, RATIO_LIMIT, Row, Tally, TrackedStep, Walk, inversion_ratio, laws,
    symplecticity_ratio,
};
use gyroceptron::network::{Direction, Stream, SympNet, SympNetShape};
use gyroceptron::phase::Map;
use gyroceptron::scalar::{Scalar, max_or_nan};
use proptest::prelude::*;
use proptest::sample::select;
use std::sync::OnceLock;

pub const STATED: usize = 400;

/// A network and where its points are.
#[derive(Clone, Debug)]
pub struct Case {
    pub shape: SympNetShape,
    scale: f64,
    radius: f64,
    seed: u64,
}

impl Case {
    pub fn network(&self) -> SympNet<f64> {
        let mut stream = Stream::new(self.seed, "weights");
        let count = self.shape.parameter_count();
        let parameters = (0..count).map(|_| self.scale * stream.normal()).collect();
        SympNet::new(self.shape.clone(), parameters).expect("as many parameters")
    }

    fn points(&self, count: usize) -> Vec<f64> {
        let mut stream = Stream::new(self.seed, "points");
        let numbers = 0..count * 2 * self.shape.dof;
        numbers.map(|_| stream.uniform(-self.radius, self.radius)).collect()
    }
}

/// Networks of up to `modules` linear modules, of `least` degrees of freedom to 4.
fn cases(least: usize, modules: usize) -> impl Strategy<Value = Case> {
    let shape =
        (least..=4_usize, 1..=modules, 1..=4_usize, select(Activation::ALL.to_vec())).prop_map(
            |(dof, modules, shears, activation)| SympNetShape { dof, modules, shears, activation },
        );
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
        let mut rows = suite::run("symp_net", STATED / 2, cases(2, 8), measure);
        rows.iter_mut().for_each(|row| row.law += " of SympNets");
        rows
    })
}

fn measure(case: &Case) -> Vec<Tally> {
    let network = case.network();
    let map: &dyn Measurable = network.composition();
    let points = case.points(11);
    let two = &points[..4 * case.shape.dof];
    let inversion = |equation, first| laws::inversion("inversion", equation, map, first, two);
    vec![
        laws::symplecticity_of("symplecticity", map, two).must_be_sound(),
        inversion("P⁻¹∘P = Id", Direction::Forward),
        inversion("P∘P⁻¹ = Id", Direction::Inverse),
        laws::evaluation(map, &points),
        laws::pullback(network.composition(), two, case.shape.dof, case.seed),
    ]
}

/// The defects of SympNets are rounding and nothing else: the same weights at single,
/// double and double-double precision.
#[test]
fn the_ladder_is_that_of_rounding() {
    let mut worst = 0.0;
    for (index, activation) in Activation::ALL.into_iter().enumerate() {
        let shape = SympNetShape { dof: precision::DOF, modules: 4, shears: 3, activation };
        for seed in 0..4 * suite::times() as u64 {
            let seed = suite::seed() + 100 * index as u64 + seed;
            let mut stream = Stream::new(seed, "ladder weights");
            let count = shape.parameter_count();
            let weights = precision::single((0..count).map(|_| 0.4 * stream.normal()));
            let network = SympNet::new(shape.clone(), weights).expect("as many parameters");
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

/// p₁ += 1e-9·q₂ and nothing else: the matrix of a linear shear that is not symmetric.
struct Skew;

impl<S: Scalar> Map<S> for Skew {
    fn dof(&self) -> usize {
        2
    }
    fn forward(&self, z: &mut [S]) {
        z[2] = z[1].mul_add(S::from_f64(1e-9), z[2]);
    }
    fn inverse(&self, z: &mut [S]) {
        z[2] = z[1].mul_add(S::from_f64(-1e-9), z[2]);
    }
}

#[test]
fn broken_ones_are_rejected() {
    for activation in Activation::ALL {
        let shape = SympNetShape { dof: 2, modules: 4, shears: 3, activation };
        let case = Case { shape: shape.clone(), scale: 0.3, radius: 1.6, seed: 1 };
        let network = case.network();
        let map = network.composition();
        let z = &case.points(1)[..];

        let steps = || map.measured_steps(Direction::Forward);
        assert!(symplecticity_ratio(&Walk::new(&steps(), z)) < RATIO_LIMIT);
        let mut skewed = steps();
        skewed.push(Box::new(TrackedStep { map: Skew, direction: Direction::Forward }));
        assert!(symplecticity_ratio(&Walk::new(&skewed, z)) > 10.0 * RATIO_LIMIT);

        let weights = map.parameters().iter().map(|w| w * (1.0 + 1e-12)).collect();
        let other = SympNet::new(shape, weights).expect("as many parameters");
        let back = other.composition().measured_steps(Direction::Inverse);
        match inversion_ratio(steps(), back, z) {
            Conditioned::Ratio(ratio) => assert!(ratio > RATIO_LIMIT, "{activation:?}: {ratio}"),
            Conditioned::IllConditioned => panic!("{activation:?}: no digit left"),
        }
    }
}
