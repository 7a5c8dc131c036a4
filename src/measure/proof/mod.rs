//! Theorems about a map of a plane, by numbers that enclose.

mod ball;
mod circles;
mod curve;
mod failure;
mod number;
mod plane_map;
mod rotation_number;
mod rough;
mod rounded;
mod search;
mod taylor;
mod theorem;
mod winding;

pub use ball::Ball;
pub use circles::{
    Circle, FixedPoint, Verdict, fixed_point_near, prove_circle, rotation_numbers,
    rounding_of_a_step,
};
pub use failure::Failure;
pub use number::{Constant, Coordinate, Function, Jet, Number};
pub use plane_map::{PlaneMap, PlaneStep, Prepared, Slope};
#[doc(hidden)]
pub use rotation_number::Divisors;
pub use rotation_number::RotationNumber;
#[doc(hidden)]
pub use rounded::Complex;
pub use search::{Ray, candidates, candidates_near, place_on_ray, turns_of_orbit};
#[doc(hidden)]
pub use taylor::Taylor;
pub use theorem::{Candidate, Constants};
