//! How often a random network violates a law: exact binomial confidence
//! bounds over ten thousand of them.

use crate::{suite, tolerances};
use gyroceptron::layer::CircleAction;
use gyroceptron::measure::{
    Measurable,
    certificate::Tally,
    laws::{self, Samples},
};
use gyroceptron::network::{GyroceptronShape, InitialWeights, Model};
use gyroceptron::phase::Direction;
use gyroceptron::random::Stream;
use rayon::prelude::*;
use statrs::distribution::{Beta, ContinuousCDF};
use std::f64::consts::TAU;
use std::fmt::Write;

/// The upper end of the Clopper–Pearson interval for a probability of which
/// `violations` of `count` trials were seen: the Beta(k + 1, n − k) quantile.
pub fn upper_bound(violations: usize, count: usize) -> f64 {
    if violations >= count {
        return 1.0;
    }
    let (k, n) = (violations as f64, count as f64);
    let beta = Beta::new(k + 1.0, n - k).expect("positive");
    beta.inverse_cdf(0.5 + 0.5 * tolerances::CONFIDENCE)
}

fn network(index: usize) -> (Model, Samples) {
    let mut stream = Stream::new(suite::seed(), &format!("statistics/{index}"));
    let mut pick = |count: usize| (stream.unit() * count as f64) as usize;
    let dof = 2 + pick(2);
    let part = |layers: usize, width: usize| vec![width + 1; layers + 1];
    let shape = GyroceptronShape {
        circle_action: CircleAction::new([vec![1], vec![pick(4) as i32 - 1; dof - 1]].concat()),
        psi: part(pick(3), pick(6)),
        near_identity: part(pick(3), pick(6)),
    };
    let weights = match pick(4) {
        0 => InitialWeights::Glorot,
        k => InitialWeights::Normal { scale: [0.3, 1.0, 3.0][k - 1] },
    };
    let epsilon = [0.01, 0.1, 1e-4][pick(3)];
    let theta = stream.uniform(-TAU, TAU);
    let model = shape
        .architecture(epsilon)
        .initialise(weights, theta, suite::seed().wrapping_add(index as u64))
        .expect("a sound architecture");
    let points = (0..2 * dof).map(|_| stream.uniform(-1.6, 1.6)).collect();
    let angles = vec![[stream.uniform(-TAU, TAU), stream.uniform(-TAU, TAU)]];
    (model, Samples::new(points, angles))
}

/// The laws that hold at every point. Orders in ε and drifts are slopes over
/// many points and have no one sample.
fn laws_on(index: usize) -> Vec<Tally> {
    let (model, samples) = network(index);
    let network = &model;
    let points = samples.points();
    let (psi, near_identity) = (network.psi(), network.near_identity());
    let inversion = |law: &str, equation: &str, map: &dyn Measurable, first: Direction| {
        laws::inversion(law, equation, map, first, points)
    };
    let (forward, inverse) = (Direction::Forward, Direction::Inverse);
    let mut out = vec![
        laws::symplecticity(&model, points),
        inversion("inversion of P", "P⁻¹∘P = Id", &model, forward),
        inversion("inversion of P", "P∘P⁻¹ = Id", &model, inverse),
        inversion("inversion of ψ", "ψ⁻¹∘ψ = Id", &psi, forward),
        inversion("inversion of I_ε", "I_ε⁻¹∘I_ε = Id", &near_identity, forward),
        laws::evaluation(&model, points),
        laws::near_periodicity(network, points),
    ];
    out.extend(laws::identity_at_zero(network, points));
    out.extend(laws::circle_action(network, &samples));
    out.extend(laws::conjugated_circle_action(network, &samples));
    out.extend(laws::exact_relations(&model, points));
    out
}

#[derive(Clone, Default)]
struct Count {
    name: String,
    trials: usize,
    violations: usize,
    ill_conditioned: usize,
}

fn counts() -> Vec<Count> {
    let networks = suite::NETWORKS * suite::times();
    let each: Vec<Vec<Count>> = (0..networks)
        .into_par_iter()
        .map(|index| {
            laws_on(index)
                .iter()
                .map(|tally| {
                    let row = tally.row();
                    let ill_conditioned = row.ill_conditioned;
                    let fine = row.largest.is_some_and(|largest| largest < row.limit);
                    Count {
                        name: format!("{}: {}", row.law, row.equation),
                        trials: 1 - ill_conditioned,
                        violations: usize::from(ill_conditioned == 0 && !fine),
                        ill_conditioned,
                    }
                })
                .collect()
        })
        .collect();
    let mut all = vec![Count::default(); each[0].len()];
    for counts in each {
        for (sum, count) in all.iter_mut().zip(counts) {
            sum.name = count.name;
            sum.trials += count.trials;
            sum.violations += count.violations;
            sum.ill_conditioned += count.ill_conditioned;
        }
    }
    all
}

#[test]
fn random_networks_do_not_violate_the_laws() {
    let counts = counts();
    let mut text = format!(
        "{} random gyroceptrons, seed {}, one point each; upper end of the {} % Clopper–Pearson \
         interval of the share that violates a law\n\n",
        suite::NETWORKS * suite::times(),
        suite::seed(),
        100.0 * tolerances::CONFIDENCE,
    );
    for count in &counts {
        let bound = upper_bound(count.violations, count.trials);
        writeln!(
            text,
            "{:<50} violations {} of {}, ill-conditioned {}, at most {bound:.3e}",
            count.name, count.violations, count.trials, count.ill_conditioned,
        )
        .expect("memory");
        assert_eq!(count.violations, 0, "{}", count.name);
        assert!(bound < tolerances::VIOLATION_RATE, "{}: {bound:e}", count.name);
    }
    if suite::seed() == suite::SEED && !suite::extensive() {
        insta::assert_snapshot!("statistics", text);
    }
}

/// 0 of n: 1 − (α/2)^(1/n); 1 of 10 against a table.
#[test]
fn the_bound_is_that_of_clopper_and_pearson() {
    let alpha = 1.0 - tolerances::CONFIDENCE;
    for n in [10, 1000, 10_000] {
        let exact = 1.0 - libm::pow(alpha / 2.0, 1.0 / n as f64);
        assert!((upper_bound(0, n) / exact - 1.0).abs() < tolerances::QUANTILE, "{n}");
    }
    let of_the_table = (upper_bound(1, 10) - 0.544_2).abs();
    assert!(of_the_table < tolerances::FOUR_DECIMALS, "{}", upper_bound(1, 10));
    assert_eq!(upper_bound(10, 10), 1.0);
}
