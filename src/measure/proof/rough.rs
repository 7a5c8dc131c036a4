//! Discs around doubles, for bounds that need few digits.

use super::number::{Constant, Number};
use super::rounded::{
    Complex, complex_sin_cos, complex_tanh, expm1_above, off_the_slits, real_at_least, saturation,
    tanh_moves, up,
};

/// All complex numbers no further from a centre than a radius.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rough {
    centre: Complex,
    radius: f64,
}

impl Rough {
    pub fn new(centre: Complex, radius: f64) -> Self {
        Self { centre, radius }
    }

    /// An upper bound of the moduli in it.
    pub fn magnitude(self) -> f64 {
        up(self.centre.above() + self.radius)
    }

    /// With what rounding adds to an operation.
    fn rounded(centre: Complex, radius: f64) -> Self {
        let size = up(centre.re.abs() + centre.im.abs());
        Self { centre, radius: up(radius + up(size * (4.0 * f64::EPSILON))) }
    }
}

impl Number for Rough {
    fn of(value: f64) -> Self {
        Self::new(Complex::new(value, 0.0), 0.0)
    }

    fn plus(self, other: Self) -> Self {
        Self::rounded(self.centre.plus(other.centre), up(self.radius + other.radius))
    }

    /// Rounding errs by √5·2⁻⁵³ of the product of the moduli.
    fn times(self, other: Self) -> Self {
        let (a, b) = (self.centre.above(), other.centre.above());
        let spread = up(up(a * other.radius) + up(self.radius * up(b + other.radius)));
        let rounding = up(up(a * b) * (4.0 * f64::EPSILON));
        Self::new(self.centre.times(other.centre), up(spread + rounding))
    }

    fn scaled(self, factor: f64) -> Self {
        Self::rounded(self.centre.scaled(factor), up(self.radius * factor.abs()))
    }

    fn scaled_by(self, factor: Constant) -> Self {
        self.times(Self::new(Complex::new(factor.high, 0.0), factor.off()))
    }

    fn tanh(self) -> Self {
        let (t, margin) = complex_tanh(self.centre);
        let modulus = up(t.above() + margin);
        let slope = up(1.0 + up(modulus * modulus));
        if !off_the_slits(self.centre, self.radius) {
            return Self::new(t, f64::INFINITY);
        }
        let moved = up(margin + tanh_moves(modulus, slope, self.radius));
        // Where tanh is nearly ±1 all over the disc this is less.
        let saturated = saturation(real_at_least(self.centre, self.radius));
        let side = if self.centre.re > 0.0 { 1.0 } else { -1.0 };
        if saturated < moved {
            Self::new(Complex::new(side, 0.0), saturated)
        } else {
            Self::new(t, moved)
        }
    }

    fn sin_cos(self) -> (Self, Self) {
        let (s, c, margin) = complex_sin_cos(self.centre);
        let size = up(up(s.above() + c.above()) + margin);
        let radius = up(margin + up(size * expm1_above(self.radius)));
        (Self::new(s, radius), Self::new(c, radius))
    }
}

/// Without bounds, for searches: tanh is NaN on the slits.
impl Number for Complex {
    fn of(value: f64) -> Self {
        Self::new(value, 0.0)
    }
    fn plus(self, other: Self) -> Self {
        Complex::plus(self, other)
    }
    fn times(self, other: Self) -> Self {
        Complex::times(self, other)
    }
    fn scaled(self, factor: f64) -> Self {
        Complex::scaled(self, factor)
    }
    fn scaled_by(self, factor: Constant) -> Self {
        Complex::scaled(self, factor.high)
    }
    fn tanh(self) -> Self {
        if off_the_slits(self, 0.0) { complex_tanh(self).0 } else { Self::new(f64::NAN, f64::NAN) }
    }
    fn sin_cos(self) -> (Self, Self) {
        let (s, c, _) = complex_sin_cos(self);
        (s, c)
    }
}
