//! What a report says of whether to trust a model.

use gyroceptron::flow::Region;
use gyroceptron::network::{Architecture, HenonShape, InitialWeights};
use gyroceptron::scene::internals::{Limit, STEPS, limit, orbits};
use gyroceptron::train::TrainingRecord;

#[test]
fn what_limits_is_told_from_the_losses() {
    let record = |iteration, loss| TrainingRecord {
        iteration,
        evaluations: 0,
        loss,
        pairs: 1,
        gradient: 0.0,
        validation: None,
    };
    let history = |last| [record(0, 1.0), record(90, 1e-3), record(100, last)];
    assert_eq!(limit(1e-3, Some(1e-3), &history(0.99e-3)), Limit::Network);
    assert_eq!(limit(1e-3, Some(1e-3), &history(0.8e-3)), Limit::Iterations);
    assert_eq!(limit(1e-3, Some(2.1e-3), &history(0.8e-3)), Limit::Data);
    assert_eq!(limit(1e-3, None, &[]), Limit::Network);
}

#[test]
fn orbits_that_go_astray_are_counted() {
    let region = Region { low: vec![-1.0; 2], high: vec![1.0; 2] };
    let shape = HenonShape::uniform(1, 2, 4);
    let network = |scale: f64| {
        Architecture::HenonNet { shape: shape.clone(), epsilon: 1.0 }
            .initialise(InitialWeights::Normal { scale }, 0.0, 1)
            .expect("valid")
    };
    let starts = [0.1, 0.2, -0.3, 0.4, 1.0, 1.0];
    let of = |scale| orbits(&network(scale), &starts, &region).expect("orbits");
    let (wild, still) = (of(1.5), of(1e-6));
    let first = wild.first.map(|(_, step)| step);
    assert!(wild.astray > 0 && first < Some(STEPS), "{} of 3, {first:?}", wild.astray);
    assert_eq!((still.count, still.astray, still.first), (3, 0, None));
    // Not a number is nowhere in the box.
    let lost = orbits(&network(1e-6), &[f64::NAN, 0.0], &region).expect("orbits");
    assert_eq!((lost.astray, lost.first), (1, Some((0, 0))));
}
