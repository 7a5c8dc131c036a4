//! Errors: what their messages name, and which end of a range is within.

use gyroceptron::Error;
use gyroceptron::flow::Pairs;
use gyroceptron::measure::{Coordinate, OneStep, WithDomain};
use gyroceptron::network::{HenonShape, InitialWeights, Rollout, map_points};
use gyroceptron::phase::{Direction, Map};

#[test]
fn every_message_says_the_value_and_the_range() {
    let range = |low, high| Error::OutOfRange { name: "x".to_owned(), value: f64::NAN, low, high };
    let count =
        |least, most| Error::CountOutOfRange { name: "n".to_owned(), found: 70, least, most };
    let all = [
        (range(f64::MIN, f64::MAX), &["x: ", "finite", "NaN"][..]),
        (range(0.0, f64::MAX), &["x: ", "finite", "≥ 0", "NaN"]),
        (range(5e-324, f64::MAX), &["x: ", "positive finite", "NaN"]),
        (range(5e-324, 1e150), &["x: ", "positive", "at most 1e150", "NaN"]),
        (range(f64::MIN, 2.5), &["x: ", "at most 2.5", "NaN"]),
        (range(2.5, f64::MAX), &["x: ", "at least 2.5", "NaN"]),
        (range(-1.0, 1.0), &["x: ", "-1.0 to 1.0", "NaN"]),
        (count(71, usize::MAX), &["n: ", "at least 71", "found 70"]),
        (count(0, 64), &["n: ", "at most 64", "found 70"]),
        (count(1, 64), &["n: ", "1 to 64", "found 70"]),
        (
            Error::WrongCount { name: "n".to_owned(), expected: 7, found: 8 },
            &["n: ", "expected 7", "found 8"],
        ),
        (
            Error::Ragged { name: "z".to_owned(), columns: 4, found: 7 },
            &["z: ", "rows of 4", "found 7"],
        ),
    ];
    for (error, words) in all {
        let message = error.to_string();
        for word in words {
            assert!(message.contains(word), "{message} does not name {word}");
        }
        // Ends of all numbers are no range.
        assert!(!message.contains("e308") && !message.contains("1844674407"), "{message}");
    }
}

/// The identity in one degree of freedom.
struct Identity;

impl<S> Map<S> for Identity {
    fn dof(&self) -> usize {
        1
    }
    fn forward(&self, _: &mut [S]) {}
    fn inverse(&self, _: &mut [S]) {}
}

#[test]
fn bounds_are_within() {
    let domain = |first| WithDomain::new(OneStep(Identity), vec![first, Coordinate::Any]).map(drop);
    assert!(domain(Coordinate::Between(1.0, 1.0f64.next_up())).is_ok());
    assert!(domain(Coordinate::Between(1.0, 1.0)).is_err());
    assert!(domain(Coordinate::Between(1.0, f64::INFINITY)).is_err());
    assert!(domain(Coordinate::Angle(5e-324)).is_ok());
    assert!(domain(Coordinate::Angle(0.0)).is_err());
    assert!(domain(Coordinate::Angle(f64::NAN)).is_err());
    let model = HenonShape::uniform(2, 1, 1)
        .architecture(1.0)
        .initialise(InitialWeights::Glorot, 0.0, 1)
        .expect("a model");
    let every = |every| model.rollout(&[0.0; 4], Rollout { steps: 1, every });
    assert!(every(1).is_ok() && every(0).is_err());
    let moved = |points: &mut [f64]| map_points(model.composition(), Direction::Forward, points);
    assert!(moved(&mut []).is_ok() && moved(&mut [0.0; 3]).is_err());
    assert!(Pairs::new("data", 0, Vec::new(), Vec::new()).is_err());
}
