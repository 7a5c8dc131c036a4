//! Networks whose lists of blocks no other file measures: gyroceptrons with an I_ε of turned kicks,
//! and slow maps of twists in turned coordinates.

use crate::compositions::{Broken, identity_at_zero, measure_any, named, points};
use crate::mutants::Fault;
use crate::suite;
use crate::watched::watched;
use gyroceptron::layer::CircleAction;
use gyroceptron::measure::{
    certificate::{Row, Tally, Verdict, merged},
    laws,
};
use gyroceptron::network::{
    Architecture, Block, InitialWeights, KickedGyroceptronShape, Layers, Model, Part,
};
use proptest::prelude::*;
use proptest::sample::select;
use std::sync::OnceLock;

pub const STATED: usize = 300;
const NAME: &str = " of other blocks";

#[derive(Clone, Debug)]
struct Case {
    action: Vec<i32>,
    /// Of the turned twists; without any it is a gyroceptron of turned kicks.
    twists: Vec<usize>,
    conjugation: Vec<usize>,
    kicks: Vec<usize>,
    epsilon: f64,
    scale: f64,
    radius: f64,
    seed: u64,
}

impl Case {
    fn architecture(&self) -> Architecture {
        let (circle, kicks) = (CircleAction::new(self.action.clone()), self.kicks.clone());
        if self.twists.is_empty() {
            let psi = self.conjugation.clone();
            return KickedGyroceptronShape { circle_action: circle, psi, kicks }
                .architecture(self.epsilon);
        }
        Architecture::new(self.action.len())
            .on_circle(circle)
            .at_epsilon(self.epsilon)
            .of_time(2.5)
            .with(Block::new(Part::Chart, Layers::TurnedKick(kicks)))
            .with(Block::new(Part::SlowMap, Layers::TurnedTwist(self.twists.clone())))
    }

    fn network(&self) -> Model {
        let weights = InitialWeights::Normal { scale: self.scale };
        let theta = 0.7 + self.scale;
        self.architecture().initialise(weights, theta, self.seed).expect("a sound architecture")
    }

    fn points(&self, count: usize) -> Vec<f64> {
        points(self.seed, self.radius, self.action.len(), count)
    }
}

fn cases() -> impl Strategy<Value = Case> {
    let actions = vec![vec![1], vec![1, 0], vec![0, -2], vec![1, 2], vec![0, 0, 1], vec![1, 0, -1]];
    let widths = |least| proptest::collection::vec(1..=4_usize, least..=3);
    (
        (select(actions), widths(0), widths(1), widths(1)),
        select(vec![0.0, 1e-6, 0.01, 0.1, -0.1]),
        select(vec![0.1, 0.3, 1.0]),
        select(vec![1.6, 1.6, 1e-6, 30.0]),
        any::<u64>(),
    )
        .prop_map(
            |((action, mut twists, conjugation, kicks), epsilon, scale, radius, seed)| {
                // A slow map needs a slow plane.
                if action.iter().all(|&weight| weight != 0) {
                    twists.clear();
                }
                Case { action, twists, conjugation, kicks, epsilon, scale, radius, seed }
            },
        )
}

fn measure(case: &Case) -> Vec<Tally> {
    let network = case.network();
    let map = watched("blocks", &network);
    let (points, dof) = (case.points(11), case.action.len());
    let mut out = vec![laws::symplecticity_of("symplecticity", &map, &points[..4 * dof])];
    out.extend(measure_any(&map, network.composition(), &points, dof, case.seed));
    out.push(identity_at_zero(&network.with_epsilon(0.0), &points));
    out
}

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| named(suite::run("blocks", STATED / 2, cases(), measure), NAME))
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}

/// All laws of such lists on some with this fault.
pub fn rows_of_mutant(fault: Fault) -> Vec<Row> {
    let tallies = [vec![], vec![3, 2]].into_iter().flat_map(|twists| {
        let case = Case {
            action: vec![1, 0],
            twists,
            conjugation: vec![3],
            kicks: vec![3, 2],
            epsilon: 0.05,
            scale: 0.3,
            radius: 1.6,
            seed: 1,
        };
        let (network, points) = (case.network(), case.points(11));
        let broken = Broken::new(fault, network.composition());
        let mut out = vec![laws::symplecticity_of("symplecticity", &broken, &points[..8])];
        out.extend(measure_any(&broken, &broken, &points, 2, case.seed));
        let epsilon = if fault == Fault::EpsilonIgnored { network.epsilon() } else { 0.0 };
        out.push(identity_at_zero(&network.with_epsilon(epsilon), &points));
        out
    });
    named(merged(tallies).iter().map(Tally::row).collect(), NAME)
}

#[test]
fn sound_ones_are_not_rejected() {
    // A fault that is none of these maps.
    let rows = rows_of_mutant(Fault::Friction);
    assert!(rows.len() > 5);
    for row in &rows {
        assert_eq!(row.verdict, Verdict::Holds, "{row:?}");
    }
}
