//! Nearly-integrable maps P = χ∘K_ε∘Φ_θ∘T∘χ⁻¹, normal forms with a perturbation that ε alone
//! scales: every law of a composition, and at ε = 0 those of a normal form.

use crate::compositions::{Broken, measure_any, named, points};
use crate::mutants::Fault;
use crate::normal_form;
use crate::watched::watched;
use crate::{suite, tolerances};
use gyroceptron::layer::TorusAction;
use gyroceptron::measure::{
    Measurable, NormalFormed,
    adiabatic::log_slope,
    certificate::{Row, Tally, Verdict, merged},
    laws::{self, Samples},
    ratios::{Conditioned, differing_components, near_identity_size},
    steps::MeasuredSteps,
};
use gyroceptron::network::{Composition, Model};
use gyroceptron::phase::{Direction, Map};
use gyroceptron::scalar::max_or_nan;
use proptest::prelude::*;
use std::sync::OnceLock;

pub const STATED: usize = 300;
const NAME: &str = " of nearly-integrable maps";

/// A network without its perturbation, and the widths of that.
#[derive(Clone, Debug)]
struct Case {
    integrable: normal_form::Case,
    widths: Vec<usize>,
}

impl Case {
    fn network(&self) -> Model {
        self.integrable.network_with(Some(self.widths.clone()))
    }

    fn points(&self, count: usize) -> Vec<f64> {
        let Self { integrable, .. } = self;
        points(integrable.seed, integrable.radius, integrable.dof(), count)
    }
}

fn cases() -> impl Strategy<Value = Case> {
    let widths = proptest::collection::vec(1..=6_usize, 1..=3);
    (normal_form::cases(), widths).prop_map(|(integrable, widths)| Case { integrable, widths })
}

/// The map is what it is made of, and at ε = 0, as `at_zero` with these kicks, it is integrable.
fn integrable_at_zero(
    network: &dyn NormalFormed,
    at_zero: &dyn NormalFormed,
    kicks: &Composition<f64>,
    points: &[f64],
) -> Vec<Tally> {
    let dim = 2 * network.dof();
    let two = &points[..2 * dim];
    let samples = Samples::new(two.to_vec(), vec![[0.7, -1.9], [3.0, 5.1]]);
    let moved =
        points.chunks_exact(dim).map(|z| Conditioned::Ratio(differing_components(kicks, z) as f64));
    let mut out = laws::nearly_integrable(network, at_zero, &samples);
    out.push(Tally::of_counts("near identity", "K₀ = Id, bitwise").extend_at(points, dim, moved));
    out
}

fn measure(case: &Case) -> Vec<Tally> {
    let network = case.network();
    let map = watched("nearly_integrable", &network);
    let points = case.points(11);
    let dof = network.architecture().dof;
    let two = &points[..4 * dof];
    let mut out = vec![laws::symplecticity_of("symplecticity", &map, two)];
    let seed = case.integrable.seed;
    out.extend(measure_any(&map, network.composition(), &points, dof, seed));
    let at_zero = network.with_epsilon(0.0);
    let kicks = at_zero.composition().near_identity_part();
    out.extend(integrable_at_zero(&network, &at_zero, &kicks, &points));
    out
}

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| named(suite::run("nearly_integrable", STATED / 2, cases(), measure), NAME))
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}

/// ε opens what the map at ε = 0 has not: the kicks are of order ε, neither less nor more, and the
/// actions of every network move with them.
#[test]
fn the_perturbation_is_of_first_order_in_epsilon() {
    const EPSILONS: [f64; 3] = [1e-3, 1e-4, 1e-5];
    for number in 0..10 * suite::times() as u64 {
        let case = mild(suite::seed() + number);
        let (network, points) = (case.network(), case.points(20));
        let moved = |epsilon: f64| {
            near_identity_size(
                &network.with_epsilon(epsilon).composition().near_identity_part(),
                &points,
            )
        };
        let slope = log_slope(&EPSILONS, &EPSILONS.map(moved));
        let shortfall = (slope - 1.0).abs();
        assert!(shortfall <= tolerances::ORDER, "{number}: {slope}");
        let perturbed = laws::actions(&network.with_epsilon(EPSILONS[0]), &points);
        for row in perturbed.iter().map(Tally::row) {
            assert_eq!(row.verdict, Verdict::Violated, "{number}: {row:?}");
        }
    }
}

/// A moderate one in two degrees of freedom.
fn mild(seed: u64) -> Case {
    let (slow, circles, epsilon, scale) = (1, vec![vec![1]], 0.05, 0.3);
    let slow_map = normal_form::SlowMap::Twists;
    let integrable =
        normal_form::Case { slow, circles, epsilon, scale, psi: true, slow_map, radius: 1.6, seed };
    Case { integrable, widths: vec![3, 2] }
}

/// A network that says of itself that it has another chart.
struct OtherChart {
    network: Model,
    other: Model,
}

impl OtherChart {
    fn new(network: Model) -> Self {
        let weights = network.composition().parameters().iter().map(|w| w * (1.0 + 1e-9)).collect();
        let other = network.with_parameters(weights);
        Self { other: other.expect("as many"), network }
    }
}

impl Map<f64> for OtherChart {
    fn dof(&self) -> usize {
        Map::<f64>::dof(&self.network)
    }
    fn forward(&self, z: &mut [f64]) {
        self.network.forward(z);
    }
    fn inverse(&self, z: &mut [f64]) {
        self.network.inverse(z);
    }
}

impl Measurable for OtherChart {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        self.network.measured_steps(direction)
    }
}

impl NormalFormed for OtherChart {
    fn chart(&self) -> Box<dyn Measurable + '_> {
        self.other.chart()
    }
    fn inner_map(&self) -> Box<dyn Measurable + '_> {
        self.network.inner_map()
    }
    fn action(&self) -> TorusAction {
        self.network.action()
    }
}

/// All laws of nearly-integrable maps on some with this fault.
pub fn rows_of_mutant(fault: Fault) -> Vec<Row> {
    let tallies = (1..4).flat_map(|seed| {
        let case = mild(seed);
        let (network, points) = (case.network(), case.points(11));
        let broken = Broken::new(fault, network.composition());
        let mut out = vec![laws::symplecticity_of("symplecticity", &broken, &points[..8])];
        out.extend(measure_any(&broken, &broken, &points, 2, seed));
        let epsilon = if fault == Fault::EpsilonIgnored { network.epsilon() } else { 0.0 };
        let at_zero = network.with_epsilon(epsilon);
        let kicks = at_zero.composition().near_identity_part();
        let tallies = if fault == Fault::OtherChart {
            let [network, at_zero] = [network, at_zero].map(OtherChart::new);
            integrable_at_zero(&network, &at_zero, &kicks, &points)
        } else {
            integrable_at_zero(&network, &at_zero, &kicks, &points)
        };
        out.extend(tallies);
        out
    });
    named(merged(tallies).iter().map(Tally::row).collect(), NAME)
}

#[test]
fn sound_ones_are_not_rejected() {
    // A fault that is none of these maps.
    let rows = rows_of_mutant(Fault::Friction);
    assert!(rows.len() > 10);
    for row in &rows {
        assert_eq!(row.verdict, Verdict::Holds, "{row:?}");
    }
    let ratios = rows.iter().filter_map(|row| row.largest).fold(0.0, max_or_nan);
    assert!(ratios > 0.0);
}
