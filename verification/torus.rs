//! Torus actions: each plane turned by several angles through an integer matrix, before
//! a HénonNet, under every law that is not of one circle.

use crate::compositions::{Broken, measure, named, points};
use crate::mutants::Fault;
use crate::suite;
use crate::watched::watched;
use gyroceptron::layer::{CircleAction, TorusAction};
use gyroceptron::measure::certificate::{Row, Tally, Verdict, merged};
use gyroceptron::network::{Composition, HenonShape, InitialWeights, Model};
use gyroceptron::phase::Direction;
use gyroceptron::random::Stream;
use proptest::prelude::*;
use proptest::sample::select;
use std::sync::OnceLock;

pub const STATED: usize = 400;
const NAME: &str = " of torus turns";

/// A torus action with its angles, a HénonNet behind it, and where its points are.
#[derive(Clone, Debug)]
struct Case {
    dof: usize,
    circles: usize,
    /// Of the angles.
    scale: f64,
    radius: f64,
    seed: u64,
}

impl Case {
    fn action(&self) -> TorusAction {
        let mut stream = Stream::new(self.seed, "circles");
        let mut weight = || stream.uniform(-3.5, 3.5).round() as i32;
        let circles = (0..self.circles)
            .map(|_| CircleAction::new(Vec::from_iter((0..self.dof).map(|_| weight()))));
        TorusAction::new(circles.collect::<Vec<_>>()).expect("circles of one size")
    }

    fn map(&self) -> Composition<f64> {
        let mut stream = Stream::new(self.seed, "angles");
        let angles = (0..self.circles).map(|_| self.scale * stream.normal()).collect();
        let turn = Composition::of_turn(&self.action(), angles).expect("an angle a circle");
        let shape = HenonShape::uniform(self.dof, 2, 5);
        let weights = InitialWeights::Normal { scale: 0.4 };
        let layers = shape.widths.iter();
        let parameters = layers.flat_map(|&h| weights.layer(self.dof, h, &mut stream)).collect();
        let network = Model::at_epsilon(shape.architecture(1.0), 1.0, parameters)
            .expect("as many parameters");
        turn.followed_by(network.composition(), Direction::Forward).expect("of one size")
    }

    fn points(&self, count: usize) -> Vec<f64> {
        points(self.seed, self.radius, self.dof, count)
    }
}

fn cases() -> impl Strategy<Value = Case> {
    let scales = select(vec![0.0, 1e-6, 1.0, 1.0, 30.0]);
    let radii = select(vec![1.6, 1.6, 1e-8, 1e8]);
    (1..=4_usize, 1..=3_usize, scales, radii, any::<u64>())
        .prop_map(|(dof, circles, scale, radius, seed)| Case { dof, circles, scale, radius, seed })
}

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| {
        let rows = suite::run("torus", STATED / 2, cases(), |case| {
            let composition = case.map();
            let map = watched("torus", &composition);
            measure(&map, &composition, &case.points(11), case.dof, case.seed)
        });
        named(rows, NAME)
    })
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}

/// All laws of torus turns on one with this fault.
pub fn rows_of_mutant(fault: Fault) -> Vec<Row> {
    let tallies = (1..4).flat_map(|seed| {
        let case = Case { dof: 2, circles: 2, scale: 1.0, radius: 1.6, seed };
        let broken = Broken::new(fault, &case.map());
        measure(&broken, &broken, &case.points(11), 2, seed)
    });
    named(merged(tallies).iter().map(Tally::row).collect(), NAME)
}

#[test]
fn a_sound_one_is_not_rejected() {
    // A fault that is none of a composition.
    for row in rows_of_mutant(Fault::Friction) {
        assert_eq!(row.verdict, Verdict::Holds, "{row:?}");
    }
}
