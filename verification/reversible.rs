//! Reversible maps P = A∘Φ_θ∘T_ε∘S∘A⁻¹∘S: every law of a composition, S∘P∘S = P⁻¹, and at ε = 0
//! what is left of them, whatever the weights.

use crate::compositions::{Broken, identity_at_zero, measure_any, named, points};
use crate::mutants::Fault;
use crate::watched::watched;
use crate::{normal_form, suite};
use gyroceptron::layer::{Activation, Reversor};
use gyroceptron::measure::{
    certificate::{Row, Tally, Verdict, merged},
    laws::{self, Samples},
};
use gyroceptron::network::{HenonShape, InitialWeights, Model, Part, Scale, SympNetShape};
use gyroceptron::scalar::max_or_nan;
use proptest::prelude::*;
use proptest::sample::select;
use std::sync::OnceLock;

pub const STATED: usize = 180;
/// Two thirds of them have circles, and so an ε; each has two samples of a law.
const CASES: usize = 150;
const NAME: &str = " of reversible maps";

/// What A is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// A chart over circles, near the identity beside twists that ε scales.
    NearlyPeriodic,
    /// A chart and a perturbation beside twists of order one.
    NearlyIntegrable,
    /// A HénonNet without circles.
    Henon,
    /// A SympNet without circles.
    SympNet,
}

#[derive(Clone, Debug)]
struct Case {
    kind: Kind,
    reversor: Reversor,
    of: normal_form::Case,
}

impl Case {
    fn network(&self) -> Model {
        let Self { kind, reversor, of } = self;
        let plain = InitialWeights::Normal { scale: of.scale };
        let (dof, shears) = (of.dof(), 2);
        let model = match kind {
            Kind::NearlyPeriodic => of.network_with(None),
            Kind::NearlyIntegrable => of.network_with(Some(vec![2])),
            Kind::Henon => {
                let architecture = HenonShape { dof, widths: vec![4, 3] }.architecture(1.0);
                architecture.initialise(plain, 0.0, of.seed).expect("a sound shape")
            }
            Kind::SympNet => {
                let (modules, activation, plain_modules) = (3, Activation::Tanh, false);
                let shape = SympNetShape { dof, modules, shears, activation, plain: plain_modules };
                shape.architecture().initialise(plain, 0.0, of.seed).expect("a sound shape")
            }
        };
        let mut architecture = model.architecture().clone().reversible(Some(*reversor));
        for block in architecture.blocks.iter_mut().filter(|block| block.part == Part::Chart) {
            block.scale = Scale::Epsilon;
        }
        Model::new(architecture, model.parameters().to_vec()).expect("a sound list")
    }

    fn points(&self, count: usize) -> Vec<f64> {
        points(self.of.seed, self.of.radius, self.of.dof(), count)
    }

    fn has_circles(&self) -> bool {
        matches!(self.kind, Kind::NearlyPeriodic | Kind::NearlyIntegrable)
    }
}

fn cases() -> impl Strategy<Value = Case> {
    let kinds = select(vec![
        Kind::NearlyPeriodic,
        Kind::NearlyPeriodic,
        Kind::NearlyIntegrable,
        Kind::NearlyIntegrable,
        Kind::Henon,
        Kind::SympNet,
    ]);
    (kinds, select(Reversor::ALL.to_vec()), normal_form::cases()).prop_map(
        |(kind, reversor, mut of)| {
            of.psi = false;
            Case { kind, reversor, of }
        },
    )
}

/// What is left at ε = 0.
fn at_zero(network: &Model, points: &[f64]) -> Vec<Tally> {
    let two = points[..4 * network.architecture().dof].to_vec();
    let samples = Samples::new(two, vec![[0.7, -1.9], [3.0, 5.1]]);
    laws::reversible_at_zero(network, &samples)
}

fn measure(case: &Case) -> Vec<Tally> {
    let network = case.network();
    let map = watched("reversible", &network);
    let (points, dof) = (case.points(11), case.of.dof());
    let two = &points[..4 * dof];
    let mut out = vec![
        laws::symplecticity_of("symplecticity", &map, two),
        laws::reversibility(&map, case.reversor, two),
    ];
    out.extend(measure_any(&map, network.composition(), &points, dof, case.of.seed));
    if case.has_circles() {
        let still = network.with_epsilon(0.0);
        out.push(identity_at_zero(&still, &points));
        out.extend(at_zero(&still, &points));
    }
    out
}

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| named(suite::run("reversible", CASES, cases(), measure), NAME))
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}

/// One in two degrees of freedom.
fn mild(kind: Kind, reversor: Reversor, seed: u64) -> Case {
    let (slow, circles, epsilon, scale) = (1, vec![vec![1]], 0.05, 0.3);
    let slow_map = normal_form::SlowMap::Twists;
    let of = normal_form::Case {
        slow,
        circles,
        epsilon,
        scale,
        psi: false,
        slow_map,
        radius: 1.6,
        seed,
    };
    Case { kind, reversor, of }
}

/// All laws of reversible maps on some with this fault.
pub fn rows_of_mutant(fault: Fault) -> Vec<Row> {
    let kinds = [Kind::NearlyPeriodic, Kind::NearlyIntegrable, Kind::Henon];
    let tallies = kinds.into_iter().zip(1..).flat_map(|(kind, seed)| {
        let reversor = Reversor::ALL[seed as usize % 2];
        let case = mild(kind, reversor, seed);
        let (network, points) = (case.network(), case.points(11));
        let broken = Broken::new(fault, network.composition());
        let claimed = match fault {
            Fault::OtherReversor => Reversor::ALL[(seed as usize + 1) % 2],
            _ => reversor,
        };
        let mut out = vec![
            laws::symplecticity_of("symplecticity", &broken, &points[..8]),
            laws::reversibility(&broken, claimed, &points[..8]),
        ];
        out.extend(measure_any(&broken, &broken, &points, 2, seed));
        if case.has_circles() {
            let epsilon = if fault == Fault::EpsilonIgnored { network.epsilon() } else { 0.0 };
            let still = network.with_epsilon(epsilon);
            out.push(identity_at_zero(&still, &points));
            out.extend(at_zero(&still, &points));
        }
        out
    });
    named(merged(tallies).iter().map(Tally::row).collect(), NAME)
}

#[test]
fn sound_ones_are_not_rejected() {
    // A fault that is none of these maps.
    let rows = rows_of_mutant(Fault::Friction);
    assert!(rows.len() > 8);
    for row in &rows {
        assert_eq!(row.verdict, Verdict::Holds, "{row:?}");
    }
    let ratios = rows.iter().filter_map(|row| row.largest).fold(0.0, max_or_nan);
    assert!(ratios > 0.0);
}

/// What moves points after a reversible map, however little and however symplectic, ends its
/// reversibility, and nothing else.
#[test]
fn a_shear_behind_a_reversible_map_is_seen_by_its_law_alone() {
    for row in rows_of_mutant(Fault::ShearBehind) {
        let violated = row.verdict == Verdict::Violated;
        assert_eq!(violated, row.law.starts_with("reversibility"), "{row:?}");
    }
}
