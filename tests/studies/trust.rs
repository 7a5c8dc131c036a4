//! What a report says of whether to trust a model, and of what to try next.

use gyroceptron::Error;
use gyroceptron::flow::Region;
use gyroceptron::measure::trajectories::PlaneMotion;
use gyroceptron::network::{HenonShape, InitialWeights, Model, Rollout};
use gyroceptron::scene::{NextStep, next_command};
use gyroceptron::train::internals::{STEPS, limit, orbits, plane_errors, worst};
use gyroceptron::train::{Limit, TrainingRecord};
use std::path::Path;

#[test]
fn what_limits_is_read_from_the_losses() {
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
    assert_eq!(limit(1e-3, Some(1e-3), &[]), Limit::Network);
    // Held-out pairs would tell.
    assert_eq!(limit(1e-3, None, &[]), Limit::Unknown);
    assert_eq!(limit(1e-3, None, &history(0.99e-3)), Limit::Unknown);
    assert_eq!(limit(1e-3, None, &history(0.8e-3)), Limit::Iterations);
}

#[test]
fn orbits_that_go_astray_are_counted() {
    let region = Region { low: vec![-1.0; 2], high: vec![1.0; 2] };
    let shape = HenonShape::uniform(1, 2, 4);
    let network = |scale: f64| {
        shape
            .clone()
            .architecture(1.0)
            .initialise(InitialWeights::Normal { scale }, 0.0, 1)
            .expect("valid")
    };
    let orbits = |model: &Model, starts: &[f64], region: &Region| {
        let states = model.rollout(starts, Rollout { steps: STEPS, every: 1 })?;
        Ok::<_, Error>(orbits(&states, starts.len() / 2, region))
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

/// A wide plane that is learnt does not hide a narrow one that is not; a plane that the
/// rotation explains to rounding is compared with its size.
#[test]
fn the_worst_plane_decides() {
    let motion = |scale, explained| PlaneMotion { scale, explained };
    let motions = [motion(0.1, false), motion(1e-4, false), motion(1.0, true)];
    let planes = plane_errors(&[1e-5, 3e-5, 1e-9, 1e-5, 3e-5, 1e-9], &motions);
    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
    assert!(near(planes[0].share, 1e-4) && near(planes[1].share, 0.3), "{planes:?}");
    assert!(near(planes[2].share, 1e-9) && planes[2].explained, "{planes:?}");
    assert_eq!(worst(&planes), 1);
    // A NaN decides wherever it is.
    let nan = plane_errors(&[f64::NAN, 3e-5, 1e-9, 1e-5, 3e-5, 1e-9], &motions);
    assert_eq!(worst(&nan), 0);
    let nan = plane_errors(&[1e-5, 3e-5, f64::NAN, 1e-5, 3e-5, 1e-9], &motions);
    assert_eq!(worst(&nan), 2);
}

#[test]
fn options_are_replaced_and_words_quoted() {
    let typed = "train --data a.npz --psi=3x4 --iterations 60 --optimiser lm --resume --output";
    let mut typed: Vec<String> = typed.split(' ').map(str::to_owned).collect();
    typed.push("my model.json".into());
    let of = |step| next_command(&typed, step, Path::new("my model.json"));
    assert_eq!(
        of(NextStep::NormalForm),
        "gyroceptron train --data a.npz --iterations 60 --output 'my model.json' \
         --architecture normal-form --optimiser lm --overwrite"
    );
    assert_eq!(
        of(NextStep::Iterations(120)),
        "gyroceptron train --data a.npz --psi=3x4 --optimiser lm --output 'my model.json' \
         --iterations 120 --resume"
    );
    assert!(of(NextStep::Predict).starts_with("gyroceptron predict --model 'my model.json'"));
    assert!(of(NextStep::Starts(4)).ends_with("--starts 4 --overwrite"));
    assert!(!of(NextStep::Pairs(3)).contains("a.npz"));
    // The angle of an action is not that of another.
    let typed =
        ["train", "--circle-action", "3,1", "--theta=0.3", "--data", "a.npz"].map(str::to_owned);
    assert_eq!(
        next_command(&typed, NextStep::Action, Path::new("m.json")),
        "gyroceptron train --data a.npz --circle-action auto --overwrite"
    );
}
