//! Networks whose lists of blocks no other file measures: gyroceptrons with an I_ε of turned kicks,
//! and slow maps of twists in turned coordinates; neurons of arctan in all of them and in plain twists.

use crate::compositions::{Broken, identity_at_zero, measure_any, named, points};
use crate::mutants::Fault;
use crate::suite;
use crate::watched::watched;
use gyroceptron::layer::{CircleAction, Neuron};
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
    /// Of the slow map; without any it is a gyroceptron of turned kicks.
    twists: Vec<usize>,
    /// Twists in turned coordinates, or not.
    turned: bool,
    neuron: Neuron,
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
            let out = KickedGyroceptronShape { circle_action: circle, psi, kicks };
            return self.of_neurons(out.architecture(self.epsilon));
        }
        let twists = self.twists.clone();
        let twists = if self.turned { Layers::TurnedTwist(twists) } else { Layers::Twist(twists) };
        let out = Architecture::new(self.action.len())
            .on_circle(circle)
            .at_epsilon(self.epsilon)
            .of_time(2.5)
            .with(Block::new(Part::Chart, Layers::TurnedKick(kicks)))
            .with(Block::new(Part::SlowMap, twists));
        self.of_neurons(out)
    }

    fn of_neurons(&self, mut architecture: Architecture) -> Architecture {
        for block in &mut architecture.blocks {
            *block = block.clone().of_neurons(self.neuron);
        }
        architecture
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
        // Plain twists of tanh have a file of their own.
        (
            any::<u64>(),
            select(vec![(Neuron::Tanh, true), (Neuron::Arctan, true), (Neuron::Arctan, false)]),
        ),
    )
        .prop_map(
            |(
                (action, mut twists, conjugation, kicks),
                epsilon,
                scale,
                radius,
                (seed, (neuron, turned)),
            )| {
                // A slow map needs a slow plane.
                if action.iter().all(|&weight| weight != 0) {
                    twists.clear();
                }
                Case {
                    action,
                    twists,
                    turned,
                    neuron,
                    conjugation,
                    kicks,
                    epsilon,
                    scale,
                    radius,
                    seed,
                }
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
    let lists = [vec![], vec![3, 2]].into_iter();
    let kinds =
        lists.flat_map(|twists| [Neuron::Tanh, Neuron::Arctan].map(|of| (twists.clone(), of)));
    let tallies = kinds.flat_map(|(twists, neuron)| {
        let case = Case {
            action: vec![1, 0],
            twists,
            turned: true,
            neuron,
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
