//! Rounding outward, and elementary functions of doubles and complex numbers with bounds of their errors.

/// An upper bound of the exact result of a single operation on non-negative numbers, from its rounded result.
#[inline(always)]
pub(super) fn up(rounded: f64) -> f64 {
    rounded + (rounded * (2.0 * f64::EPSILON) + f64::MIN_POSITIVE)
}

/// A lower bound of it.
#[inline(always)]
pub(super) fn down(rounded: f64) -> f64 {
    (rounded - (rounded * (2.0 * f64::EPSILON) + f64::MIN_POSITIVE)).max(0.0)
}

/// A complex number with a real and an imaginary part in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Complex {
    /// The real part of the complex number.
    pub re: f64,
    /// The imaginary part of the complex number.
    pub im: f64,
}

impl Complex {
    /// The complex number 0, both of whose parts are 0.
    pub const ZERO: Self = Self { re: 0.0, im: 0.0 };

    /// The complex number re + i·im.
    #[inline(always)]
    pub fn new(re: f64, im: f64) -> Self {
        Self { re, im }
    }
    pub(super) fn plus(self, o: Self) -> Self {
        Self::new(self.re + o.re, self.im + o.im)
    }
    #[inline(always)]
    pub(super) fn times(self, o: Self) -> Self {
        Self::new(self.re * o.re - self.im * o.im, self.re * o.im + self.im * o.re)
    }
    pub(super) fn scaled(self, f: f64) -> Self {
        Self::new(self.re * f, self.im * f)
    }
    /// An upper bound of the modulus.
    #[inline(always)]
    pub fn above(self) -> f64 {
        up(up(up(self.re * self.re) + up(self.im * self.im)).sqrt())
    }
    /// A lower bound of the modulus of the number.
    pub fn below(self) -> f64 {
        // Squares that underflow are of moduli below 10⁻¹⁵⁰.
        let modulus = (self.re * self.re + self.im * self.im).sqrt();
        down(down(modulus * (1.0 - 4.0 * f64::EPSILON)) - 1e-150)
    }
}

/// An upper bound of tan d for d ≥ 0; ∞ for d > 1. (tan d − d)/d³ grows, and tan 1 < 1.5575.
pub(super) fn tan_above(d: f64) -> f64 {
    if d <= 1.0 { up(d + up(0.5575 * up(d * up(d * d)))) } else { f64::INFINITY }
}

/// An upper bound of e^d − 1 for d ≥ 0: (e^d − 1 − d)/d² grows, and e < 2.7183.
pub(super) fn expm1_above(d: f64) -> f64 {
    if d <= 1.0 { up(d + up(0.7183 * up(d * d))) } else { exp_above(d) }
}

/// An upper bound of e^d for d ≥ 0.
pub(super) fn exp_above(d: f64) -> f64 {
    if d <= 600.0 { up(real_exp(d) * (1.0 + SLACK)) } else { f64::INFINITY }
}

/// 2⁻⁴³: more than the relative error of [`real_exp`] and the absolute one of [`real_sin_cos`].
pub(super) const SLACK: f64 = 1024.0 * f64::EPSILON / 2.0;

/// Σ_{k ≥ first} x^k/k! in steps of `step`.
fn real_series(x: f64, first: usize, step: usize, alternating: bool) -> f64 {
    const LAST: usize = 18;
    let power = if step == 2 { if alternating { -x * x } else { x * x } } else { x };
    let mut k = first + (LAST - first) / step * step;
    let mut sum = 1.0;
    while k > first {
        let divisor = if step == 2 { (k * (k - 1)) as f64 } else { k as f64 };
        sum = 1.0 + power * sum / divisor;
        k -= step;
    }
    if first == 1 { sum * x } else { sum }
}

/// e^x for |x| ≤ 600, to 2⁻⁴³ relative.
///
/// x − k ln 2 errs by 2⁻⁵⁰: the product of k with the first part of ln 2 (33 bits) and the difference are exact, the
/// rest is below 2⁻²³. For |r| ≤ 0.36 Horner's rule errs by (3·18)·2⁻⁵³e^0.36, the series by 0.36¹⁹/19! < 2⁻⁸⁰.
pub(super) fn real_exp(x: f64) -> f64 {
    const HIGH: f64 = 0.693_147_180_369_123_8;
    const LOW: f64 = 1.908_214_929_270_587_7e-10;
    let k = libm::round(x / std::f64::consts::LN_2);
    let rest = (x - k * HIGH) - k * LOW;
    libm::ldexp(real_series(rest, 0, 1, false), k as i32)
}

/// (sin x, cos x) for |x| ≤ 10⁶, to 2⁻⁴³; NaN beyond.
///
/// For |r| ≤ 0.79 the series err by 0.79¹⁸/18! < 2⁻⁵⁸, Horner's rule by (3·9)·2⁻⁵³·cosh 0.79.
pub(super) fn real_sin_cos(x: f64) -> (f64, f64) {
    const HIGH: f64 = 1.570_796_326_734_125_6;
    const LOW: f64 = 6.077_100_506_506_192e-11;
    if !(x.abs() <= 1e6) {
        return (f64::NAN, f64::NAN);
    }
    let k = libm::round(x / std::f64::consts::FRAC_PI_2);
    let rest = (x - k * HIGH) - k * LOW;
    let (s, c) = (real_series(rest, 1, 2, true), real_series(rest, 0, 2, true));
    match (k as i64).rem_euclid(4) {
        0 => (s, c),
        1 => (c, -s),
        2 => (-s, -c),
        _ => (-c, s),
    }
}

/// tanh(x + iy) = (sinh 2x + i sin 2y)/(cosh 2x + cos 2y), and a bound of its error.
pub(super) fn complex_tanh(w: Complex) -> (Complex, f64) {
    if !(w.re.abs() <= 20.0) {
        // |tanh w ∓ 1| = 2e^{−2|x|}/|1 + e^{−2|w|}|.
        let side = if w.re > 20.0 { 1.0 } else { -1.0 };
        return (Complex::new(side, 0.0), if w.re.is_nan() { f64::NAN } else { 1e-16 });
    }
    let e = real_exp(2.0 * w.re);
    let (sinh, cosh) = (0.5 * (e - 1.0 / e), 0.5 * (e + 1.0 / e));
    let (sin, cos) = real_sin_cos(2.0 * w.im);
    let below = cosh + cos;
    let t = Complex::new(sinh / below, sin / below);
    // Numerators err by 2·SLACK·cosh, the denominator by as much.
    let off = up(4.0 * SLACK * up(1.0 + cosh));
    let margin = up(up(off * up(1.0 + t.above())) / down(below - off));
    (t, if below > off { margin } else { f64::INFINITY })
}

/// (sin, cos) of x + iy, and a bound of the error of either.
pub(super) fn complex_sin_cos(w: Complex) -> (Complex, Complex, f64) {
    if !(w.im.abs() <= 100.0) {
        let none = Complex::new(f64::NAN, f64::NAN);
        return (none, none, f64::INFINITY);
    }
    let e = real_exp(w.im);
    let (sinh, cosh) = (0.5 * (e - 1.0 / e), 0.5 * (e + 1.0 / e));
    let (sin, cos) = real_sin_cos(w.re);
    let (s, c) = (Complex::new(sin * cosh, cos * sinh), Complex::new(cos * cosh, -sin * sinh));
    (s, c, 8.0 * SLACK * cosh)
}

/// Whether tanh is analytic around all w with Re w and Im w no farther than a radius from those of a centre: where
/// none of them is on the slits Re w = 0, |Im w| ≥ ½π, on which its poles are.
///
/// The plane without the slits is simply connected. So a function whose values on the edge of a strip are off the
/// slits takes none of the poles within, by the argument principle.
pub(super) fn off_the_slits(centre: Complex, radius: f64) -> bool {
    up(centre.im.abs() + radius) < std::f64::consts::FRAC_PI_2
        || real_at_least(centre, radius) > 0.0
}

/// A lower bound of |Re w| around a centre; 0 where it may be 0.
pub(super) fn real_at_least(centre: Complex, radius: f64) -> f64 {
    down(centre.re.abs() - radius)
}

/// An upper bound of |tanh w − 1| for Re w ≥ x, and of |tanh w + 1| for Re w ≤ −x: 2e^{−2x}/(1 − e^{−2x}).
pub(super) fn saturation(x: f64) -> f64 {
    if !(x > 0.0) {
        return f64::INFINITY;
    }
    let e = if x <= 250.0 { up(real_exp(-2.0 * x) * (1.0 + SLACK)) } else { 1e-200 };
    let below = down(1.0 - e);
    if below > 0.0 { up(up(2.0 * e) / below) } else { f64::INFINITY }
}

/// A bound of |tanh(x + h) − t|, t = tanh x, for |h| ≤ d: tan d·|1 − t²|/(1 − |t| tan d); ∞ where a pole may be.
///
/// tanh(x + h) = (t + T)/(1 + tT) with T = tanh h, |T| ≤ tan |h|.
pub(super) fn tanh_moves(t: f64, slope: f64, d: f64) -> f64 {
    let tan = tan_above(d);
    let below = down(1.0 - up(t * tan));
    if below > 0.0 { up(up(tan * slope) / below) } else { f64::INFINITY }
}
