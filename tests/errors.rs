//! Errors: what their messages name, and which end of a range is within.

use gyroceptron::Error;
use gyroceptron::flow::Pairs;
use gyroceptron::measure::{Coordinate, OneStep, Within};
use gyroceptron::network::{HenonShape, InitialWeights, Rollout, map_points};
use gyroceptron::phase::{Direction, Map};

#[test]
fn every_message_says_the_value_and_the_range() {
    let of = |low, high| {
        Error::OutOfRange { name: "x".to_owned(), value: f64::NAN, low, high }.to_string()
    };
    assert_eq!(of(f64::MIN, f64::MAX), "x: expected a finite number, found NaN");
    assert_eq!(of(0.0, f64::MAX), "x: expected a finite number ≥ 0, found NaN");
    assert_eq!(of(5e-324, f64::MAX), "x: expected a positive finite number, found NaN");
    assert_eq!(of(5e-324, 1e150), "x: expected a positive number of at most 1e150, found NaN");
    assert_eq!(of(f64::MIN, 2.5), "x: expected at most 2.5, found NaN");
    assert_eq!(of(2.5, f64::MAX), "x: expected at least 2.5, found NaN");
    assert_eq!(of(-1.0, 1.0), "x: expected -1.0 to 1.0, found NaN");
    let of = |least, most| {
        Error::CountOutOfRange { name: "n".to_owned(), found: 70, least, most }.to_string()
    };
    assert_eq!(of(71, usize::MAX), "n: expected at least 71, found 70");
    assert_eq!(of(0, 64), "n: expected at most 64, found 70");
    assert_eq!(of(1, 64), "n: expected 1 to 64, found 70");
    let wrong = Error::WrongCount { name: "n".to_owned(), expected: 7, found: 8 };
    assert_eq!(wrong.to_string(), "n: expected 7, found 8");
    let ragged = Error::Ragged { name: "z".to_owned(), columns: 4, found: 7 };
    assert_eq!(ragged.to_string(), "z: expected rows of 4 numbers, found 7 numbers");
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
    let domain = |first| Within::new(OneStep(Identity), vec![first, Coordinate::Any]).map(drop);
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
