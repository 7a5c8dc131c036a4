//! Angles as 64-bit fractions of a full turn, whose sums are exact.

use super::{CircleAction, PlaneTurn, TorusAction, Turn};
use crate::scalar::Elementary;
use std::f64::consts::TAU;
use std::ops::{Add, Mul, Neg, Sub};

/// The angle 2π·k/2⁶⁴ with a whole k from −2⁶³ to 2⁶³ − 1.
///
/// Sums, differences and multiples wrap at a full turn and are exact, so that the axioms of a circle
/// action hold exactly in the angle: θ + 2π equals θ, and four quarter turns are 0. An angle in
/// radians is represented only up to rounding, and an f64 cannot hold ½π exactly.
///
/// ```
/// use gyroceptron::layer::TurnFraction;
///
/// let quarter = TurnFraction::of_turn(1, 4);
/// assert_eq!(quarter + quarter + quarter + quarter, TurnFraction::default());
/// assert_eq!(quarter * 5, quarter);
/// assert!((quarter.radians() - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TurnFraction(i64);

impl TurnFraction {
    /// The angle 2π·k/2⁶⁴ of k steps, of which 2⁶⁴ make a full turn.
    pub const fn new(k: i64) -> Self {
        Self(k)
    }

    /// The nearest angle to numerator/denominator of a full turn.
    ///
    /// # Panics
    /// When the denominator is 0.
    pub fn of_turn(numerator: i64, denominator: u32) -> Self {
        let denominator = i128::from(denominator);
        let numerator = i128::from(numerator).rem_euclid(denominator);
        let k = ((numerator << 65) + denominator).div_euclid(2 * denominator);
        // Of whole turns nothing is left.
        Self(k as i64)
    }

    /// The nearest angle to `theta` radians; 0 for a number that is not finite.
    pub fn of_radians(theta: f64) -> Self {
        let turns = theta % TAU / TAU;
        // A full turn, which rounding may make of an angle next to it, is none.
        Self((turns * 18_446_744_073_709_551_616.0).round_ties_even() as i128 as i64)
    }

    /// The number k of 2⁻⁶⁴ turns.
    pub const fn k(self) -> i64 {
        self.0
    }

    /// The angle of the turn in radians, from −π to π.
    pub fn radians(self) -> f64 {
        self.0 as f64 * (TAU / 18_446_744_073_709_551_616.0)
    }

    /// The turn of a plane by it: of −θ the inverse of that by θ, step by step.
    fn of_plane(self, plane: usize) -> PlaneTurn<f64> {
        // What is nearer to another quarter belongs to that.
        let magnitude = self.0.unsigned_abs();
        let quarters = (magnitude + (1 << 61)) >> 62;
        let rest = Self(magnitude.wrapping_sub(quarters << 62) as i64);
        // That of `f64` itself depends on the platform.
        let (s, c) = Elementary::sin_cos(rest.radians());
        let t = s / (1.0 + c);
        match self.0 < 0 {
            false => PlaneTurn { plane, quarter_turns: (quarters % 4) as u8, t, s },
            true => {
                let quarter_turns = [0, 3, 6, 1][(quarters % 4) as usize];
                PlaneTurn { plane, quarter_turns, t: -t, s: -s }
            }
        }
    }
}

impl Add for TurnFraction {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0.wrapping_add(other.0))
    }
}

impl Sub for TurnFraction {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0.wrapping_sub(other.0))
    }
}

impl Neg for TurnFraction {
    type Output = Self;
    fn neg(self) -> Self {
        Self(self.0.wrapping_neg())
    }
}

impl Mul<i32> for TurnFraction {
    type Output = Self;
    fn mul(self, times: i32) -> Self {
        Self(self.0.wrapping_mul(times.into()))
    }
}

impl CircleAction {
    /// The rotation Φ_θ by an exact fraction of a full turn: on a grid Φ₀ and Φ_{2π} are the identity,
    /// Φ_{−θ} is the inverse of Φ_θ, and Φ_{π/2}⁴ is the identity, bit for bit. Φ_θ∘Φ_φ = Φ_{θ+φ} holds
    /// up to the rounding of increments, since each rotation is three rounded shears.
    pub fn turn_by_fraction(&self, theta: TurnFraction) -> Turn<f64> {
        TorusAction::from(self.clone()).turn_by_fractions(&[theta])
    }
}

impl TorusAction {
    /// The rotation by these fractions of a full turn, one for each circle.
    ///
    /// # Panics
    /// When there are more or fewer of them.
    pub fn turn_by_fractions(&self, angles: &[TurnFraction]) -> Turn<f64> {
        let radians: Vec<f64> = angles.iter().map(|angle| angle.radians()).collect();
        let mut turn = self.turn_by(&radians);
        for plane in turn.planes_mut() {
            let circles = self.circles().iter().zip(angles);
            let angle = circles.map(|(circle, &angle)| angle * circle.weights()[plane.plane]);
            *plane = angle.fold(TurnFraction::default(), Add::add).of_plane(plane.plane);
        }
        turn
    }
}
