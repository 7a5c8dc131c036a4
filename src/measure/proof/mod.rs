//! Computer-assisted proofs about maps of a plane, by rigorous enclosures of numbers.

mod ball;
mod centre;
mod circles;
mod curve;
mod failure;
mod noble_number;
mod number;
mod plane_map;
mod rough;
mod rounded;
mod search;
mod taylor;
mod theorem;
mod winding;

#[doc(hidden)]
pub use ball::BallCentre;
pub use ball::{Ball, BallOf, FineBall};
pub use centre::{Centre, ThreeWords, TwoWords};
pub use circles::{
    Circle, FixedPoint, Verdict, fixed_point_near, noble_numbers, prove_circle, rounding_of_a_step,
};
pub use failure::Failure;
#[doc(hidden)]
pub use noble_number::Divisors;
pub use noble_number::NobleNumber;
pub use number::{Constant, Coordinate, Function, Jet, Number};
pub use plane_map::{PlaneMap, PlaneStep, Prepared, Slope};
#[doc(hidden)]
pub use rounded::Complex;
pub use search::{Ray, candidates, candidates_near, place_on_ray, turns_of_orbit};
#[doc(hidden)]
pub use taylor::Taylor;
pub use theorem::{Candidate, Constants};
