//! SympNets: every law that is not of a circle action, on linear and activation
//! modules, whose rounding bounds nobody derived by hand.

use crate::mutants::Fault;
use crate::watched::watched;
use crate::{precision, suite, tolerances};
use gyroceptron::layer::Activation;
use gyroceptron::measure::{
    Adjoint, Measurable, MeasuredSteps, Row, Tally, TrackedStep, Verdict, laws, merged,
};
use gyroceptron::network::{SympNet, SympNetShape};
use gyroceptron::phase::{Direction, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Dual, Scalar, Tracked, max_or_nan};
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
        named(suite::run("symp_net", STATED / 2, cases(2, 8), |case| {
            let network = case.network();
            let (points, dof) = (case.points(11), case.shape.dof);
            let map = watched("symp_net", &network);
            measure(&map, network.composition(), &points, dof, case.seed)
        }))
    })
}

fn named(mut rows: Vec<Row>) -> Vec<Row> {
    rows.iter_mut().for_each(|row| row.law += " of SympNets");
    rows
}

/// The laws on the first two of the points; that of evaluation on all.
fn measure(
    map: &dyn Measurable,
    adjoint: &dyn Adjoint,
    points: &[f64],
    dof: usize,
    seed: u64,
) -> Vec<Tally> {
    let two = &points[..4 * dof];
    let inversion = |equation, first| laws::inversion("inversion", equation, map, first, two);
    vec![
        laws::symplecticity_of("symplecticity", map, two).must_show_errors(),
        inversion("P⁻¹∘P = Id", Direction::Forward),
        inversion("P∘P⁻¹ = Id", Direction::Inverse),
        laws::evaluation(map, points),
        laws::pullback(adjoint, two, dof, seed),
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

/// A SympNet of two degrees of freedom with a fault.
struct Broken {
    fault: Fault,
    network: SympNet<f64>,
    /// The same with all weights off by 1e-12.
    other: SympNet<f64>,
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

impl Map<f64> for Broken {
    fn dof(&self) -> usize {
        2
    }
    fn forward(&self, z: &mut [f64]) {
        self.measured_steps(Direction::Forward).iter().for_each(|step| step.apply(z));
    }
    fn inverse(&self, z: &mut [f64]) {
        self.measured_steps(Direction::Inverse).iter().for_each(|step| step.apply(z));
    }
}

impl Measurable for Broken {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        let inverse = direction == Direction::Inverse;
        let wrong = inverse && self.fault == Fault::ModuleInverse;
        let network = if wrong { &self.other } else { &self.network };
        let mut steps = network.measured_steps(direction);
        if self.fault == Fault::SkewModule {
            let skew = Box::new(TrackedStep { map: Skew, direction });
            if inverse { steps.insert(0, skew) } else { steps.push(skew) }
        }
        steps
    }
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        let count = points.len() / 4;
        let left = usize::from(self.fault == Fault::ModuleBatchTail);
        for point in points.chunks_exact_mut(4).take(count - left) {
            self.run(direction, point);
        }
    }
}

impl Adjoint for Broken {
    fn parameters(&self) -> Vec<f64> {
        self.network.composition().parameters().to_vec()
    }
    fn tangent(&self, parameters: &[Dual<Tracked, 1>], z: &mut [Dual<Tracked, 1>]) {
        self.network.composition().tangent(parameters, z);
    }
    fn cotangent(
        &self,
        parameters: &[Tracked],
        z: &[Tracked],
        z_bar: &mut [Tracked],
        parameters_bar: &mut [Tracked],
    ) {
        self.network.composition().cotangent(parameters, z, z_bar, parameters_bar);
        if self.fault == Fault::ModulePullback {
            parameters_bar[0] = -parameters_bar[0];
        }
    }
}

/// All laws of SympNets on one with this fault.
pub fn rows_of_mutant(fault: Fault) -> Vec<Row> {
    let tallies = Activation::ALL.into_iter().flat_map(|activation| {
        let shape = SympNetShape { dof: 2, modules: 4, shears: 3, activation };
        let case = Case { shape: shape.clone(), scale: 0.3, radius: 1.6, seed: 1 };
        let network = case.network();
        let weights = network.composition().parameters().iter().map(|w| w * (1.0 + 1e-12));
        let other = SympNet::new(shape, weights.collect()).expect("as many parameters");
        let broken = Broken { fault, network, other };
        measure(&broken, &broken, &case.points(11), 2, 1)
    });
    named(merged(tallies).iter().map(Tally::row).collect())
}

#[test]
fn a_sound_one_is_not_rejected() {
    // A fault that is none of a SympNet.
    for row in rows_of_mutant(Fault::Friction) {
        assert_eq!(row.verdict, Verdict::Holds, "{row:?}");
    }
}
