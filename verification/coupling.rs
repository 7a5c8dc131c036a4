//! Gyroceptrons of affine couplings: every law of a nearly-periodic map but that of the canonical form,
//! which they break, and are seen to.

use crate::compositions::{Broken, measure_any, named, points};
use crate::mutants::Fault;
use crate::watched::watched;
use crate::{precision, suite, tolerances};
use gyroceptron::layer::CircleAction;
use gyroceptron::measure::{
    Layers, Measurable, NearlyPeriodic,
    certificate::{RATIO_LIMIT, Row, Tally, Verdict, merged},
    laws,
    steps::MeasuredSteps,
};
use gyroceptron::network::{Composition, CouplingGyroceptronShape, InitialWeights, Model};
use gyroceptron::phase::{Direction, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::max_or_nan;
use proptest::prelude::*;
use proptest::sample::select;
use std::f64::consts::TAU;
use std::sync::OnceLock;

pub const STATED: usize = 200;
const NAME: &str = " of couplings";

/// A network and where its points are.
#[derive(Clone, Debug)]
struct Case {
    action: Vec<i32>,
    psi: Vec<usize>,
    near_identity: Vec<usize>,
    epsilon: f64,
    scale: f64,
    radius: f64,
    seed: u64,
}

impl Case {
    fn network(&self) -> Model {
        let shape = CouplingGyroceptronShape {
            circle_action: CircleAction::new(self.action.clone()),
            psi: self.psi.clone(),
            near_identity: self.near_identity.clone(),
            flow_time: 2.0,
        };
        let architecture = shape.architecture(self.epsilon);
        let weights = InitialWeights::Normal { scale: self.scale };
        architecture.initialise(weights, 0.7 + self.scale, self.seed).expect("a sound architecture")
    }

    fn points(&self, count: usize) -> Vec<f64> {
        points(self.seed, self.radius, self.action.len(), count)
    }

    fn samples(&self) -> laws::Samples {
        let mut stream = Stream::new(self.seed, "angles");
        let mut angle = || stream.uniform(-TAU, TAU);
        laws::Samples::new(self.points(2), vec![[angle(), angle()], [angle(), angle()]])
    }
}

fn cases() -> impl Strategy<Value = Case> {
    let actions =
        select(vec![vec![1], vec![-2], vec![1, 0], vec![1, 1], vec![3, -1], vec![0, 1, 2]]);
    let widths = || proptest::collection::vec(1..=9_usize, 1..=4);
    let scales = select(vec![0.1, 0.5, 1.0]);
    let epsilons = select(vec![1e-6, 0.01, 0.3, -0.1]);
    let radii = select(vec![1.6, 1.6, 0.1, 10.0]);
    (actions, widths(), widths(), epsilons, scales, radii, any::<u64>()).prop_map(
        |(action, psi, near_identity, epsilon, scale, radius, seed)| Case {
            action,
            psi,
            near_identity,
            epsilon,
            scale,
            radius,
            seed,
        },
    )
}

/// The laws of any composition, and those of a family.
fn measure_family(
    family: &dyn NearlyPeriodic,
    composition: &Composition<f64>,
    case: &Case,
) -> Vec<Tally> {
    let samples = case.samples();
    let mut out = measure_any(family, composition, &case.points(11), case.action.len(), case.seed);
    out.extend(family_laws(family, &samples));
    out
}

fn family_laws(family: &dyn NearlyPeriodic, samples: &laws::Samples) -> Vec<Tally> {
    let mut out = laws::identity_at_zero(family, samples.points());
    out.extend(laws::near_identity_orders(family, samples.points()));
    out.push(laws::near_periodicity(family, samples.points()));
    out.extend(laws::conjugated_circle_action(family, samples));
    out
}

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| {
        let rows = suite::run("coupling", STATED, cases(), |case| {
            let network = case.network();
            let map = watched("coupling", &network);
            measure_family(&map, network.composition(), case)
        });
        named(rows, NAME)
    })
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}

/// JᵀΩJ = Ω is refused on every single network and at every point, and rightly: where couplings shift alone, in one
/// degree of freedom, in which every shift is by a gradient, it holds.
#[test]
fn symplecticity_is_refused_where_volumes_change_and_there_alone() {
    let mut stream = Stream::new(suite::seed(), "refused");
    for number in 0..40 * suite::times() as u64 {
        let mut case = Case {
            action: vec![1],
            psi: vec![3, 5],
            near_identity: vec![4],
            epsilon: 0.05,
            scale: stream.uniform(0.2, 1.0),
            radius: 1.6,
            seed: number,
        };
        let shifts_alone = number % 2 == 1;
        if !shifts_alone && number % 4 == 0 {
            case.action = vec![1, 0];
        }
        let network = case.network();
        let mut parameters = network.composition().parameters().to_vec();
        if shifts_alone {
            // After the angle, of a width h: W (h), b (h), A (h), a.
            for step in network.composition().steps() {
                let own = &mut parameters[step.parameters.clone()];
                let h = (own.len().max(3) - 3) / 4;
                if own.len() > 1 {
                    own[1 + 2 * h..2 + 3 * h].fill(0.0);
                }
            }
        }
        let map = network.composition().with_parameters(parameters, case.epsilon).expect("as many");
        let row = laws::symplecticity_of("symplecticity", &map, &case.points(5)).row();
        if shifts_alone {
            assert_eq!(row.verdict, Verdict::Holds, "{row:?}");
        } else {
            assert_eq!(row.verdict, Verdict::Violated, "{row:?}");
            let smallest = row.smallest.expect("finite");
            assert!(smallest > tolerances::REFUSED * RATIO_LIMIT, "{row:?}");
        }
    }
}

/// The defects of couplings are rounding and nothing else: the same weights at single,
/// double and double-double precision.
#[test]
fn the_ladder_is_that_of_rounding() {
    let mut worst = 0.0;
    for seed in 0..4 * suite::times() as u64 {
        let case = Case {
            action: vec![1; precision::DOF],
            psi: vec![4, 3],
            near_identity: vec![5, 2],
            epsilon: 0.5,
            scale: 0.4,
            radius: 1.0,
            seed: suite::seed() + seed,
        };
        let network = case.network();
        let weights = precision::single(network.composition().parameters().iter().copied());
        let map = network.composition().with_parameters(weights, case.epsilon).expect("as many");
        worst = max_or_nan(worst, precision::inversion_defect(&map, case.seed));
    }
    assert!(worst <= tolerances::LADDER_THREE_RUNGS, "{worst}");
}

/// A gyroceptron of couplings with a fault in one of its parts.
struct BrokenFamily {
    fault: Fault,
    clean: Model,
}

impl Map<f64> for BrokenFamily {
    fn dof(&self) -> usize {
        self.clean.composition().dof()
    }
    fn forward(&self, z: &mut [f64]) {
        self.clean.forward(z);
    }
    fn inverse(&self, z: &mut [f64]) {
        self.clean.inverse(z);
    }
}

impl Measurable for BrokenFamily {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        self.clean.measured_steps(direction)
    }
    fn layers(&self) -> Layers<'_> {
        Measurable::layers(&self.clean)
    }
}

impl NearlyPeriodic for BrokenFamily {
    fn map_at(&self, epsilon: f64) -> Box<dyn Measurable + '_> {
        self.clean.map_at(epsilon)
    }
    fn near_identity_at(&self, epsilon: f64) -> Box<dyn Measurable + '_> {
        let ignored = self.fault == Fault::EpsilonIgnored;
        let epsilon = if ignored { self.clean.epsilon() } else { epsilon };
        self.clean.near_identity_at(epsilon)
    }
    fn conjugation(&self) -> Box<dyn Measurable + '_> {
        self.clean.conjugation()
    }
    fn action_weights(&self) -> Vec<i32> {
        self.clean.action_weights()
    }
    fn turn(&self, theta: f64, z: &mut [f64]) {
        self.clean.turn(theta, z);
    }
    fn conjugated_action_at(&self, theta: f64) -> Box<dyn Measurable + '_> {
        let slips = self.fault == Fault::AngleSlips && theta.abs() > TAU;
        let theta = if slips { theta + 1e-12 } else { theta };
        if self.fault != Fault::ConjugatedOnce {
            return self.clean.conjugated_action_at(theta);
        }
        let action = self.clean.architecture().circles[0].clone();
        let turn = Composition::of_turn(&action.into(), vec![theta]).expect("an angle");
        Box::new(turn.followed_by(&self.clean.psi(), Direction::Forward).expect("of one size"))
    }
    fn angle(&self) -> f64 {
        self.clean.angles()[0]
    }
    fn epsilon(&self) -> f64 {
        self.clean.epsilon()
    }
}

/// All laws of couplings on some with this fault.
pub fn rows_of_mutant(fault: Fault) -> Vec<Row> {
    let tallies = (1..6).flat_map(|seed| {
        let case = Case {
            action: vec![1, 0],
            psi: vec![3, 4],
            near_identity: vec![5, 2],
            epsilon: 0.05,
            scale: 0.5,
            radius: 1.6,
            seed,
        };
        let clean = case.network();
        let broken = Broken::new(fault, clean.composition());
        let mut out = measure_any(&broken, &broken, &case.points(11), 2, seed);
        out.extend(family_laws(&BrokenFamily { fault, clean }, &case.samples()));
        out
    });
    named(merged(tallies).iter().map(Tally::row).collect(), NAME)
}

#[test]
fn a_sound_one_is_not_rejected() {
    // A fault that is none of couplings.
    for row in rows_of_mutant(Fault::Friction) {
        assert_eq!(row.verdict, Verdict::Holds, "{row:?}");
    }
}
