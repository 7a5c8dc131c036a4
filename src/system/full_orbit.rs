//! A charged particle in a strong magnetic field that varies within its gyroradius.

use super::average::{self, Jet, POINTS, QUARTER};
use super::{AverageConstants, AveragePart, Hamiltonian, NearlyPeriodic, Splittable, turn};
use crate::error::Error;
use crate::layer::CircleAction;
use crate::scalar::Elementary;
use serde::{Deserialize, Serialize};

/// H = ½|p − A(x, y)|² + εφ(x, y) in the plane, B = 1 + ε(cos kx + cos ky), φ = f(cos kx + sin ky). Lengths are in
/// gyroradii at unit speed, times in radians of the gyration in the uniform part of B.
///
/// With the kinetic momenta of the uniform part Π and the guiding centre (X, Y) = (x + Π_y, y − Π_x), z = [Π_x, Y,
/// Π_y, X] are canonical: {Π_x, Π_y} = {Y, X} = 1, a linear symplectic map of positions and momenta. Then
/// x = p₂ − p₁, y = q₁ + q₂ and H = ½|(q₁, p₁) − εa(x, y)|² + εφ, a = (−sin ky, sin kx)/k. At ε = 0 the velocity
/// turns and the guiding centre stands still.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FullOrbit {
    /// The size ε of the variation of B and of the potential.
    pub epsilon: f64,
    /// The wavenumber k of both, in inverse gyroradii.
    #[serde(default = "FullOrbit::wavenumber")]
    pub wavenumber: f64,
    /// The amplitude f of the potential.
    #[serde(default = "FullOrbit::potential")]
    pub potential: f64,
}

impl FullOrbit {
    /// The system at this ε, with the wavenumber k = 1 and the amplitude f = ½ of its potential.
    pub fn new(epsilon: f64) -> Self {
        Self { epsilon, wavenumber: Self::wavenumber(), potential: Self::potential() }
    }

    fn wavenumber() -> f64 {
        1.0
    }

    fn potential() -> f64 {
        0.5
    }

    /// The position (x, y) of the particle.
    #[inline(always)]
    fn position<S: Elementary>(z: &[S]) -> (S, S) {
        (z[3] - z[2], z[0] + z[1])
    }

    /// ε sin ku/k and its slope ε cos ku, for u = x or y: εa_y or −εa_x, and a part of B each.
    #[inline(always)]
    pub(crate) fn wave<S: Elementary>(&self, u: S) -> (S, S) {
        let (s, c) = (S::from_f64(self.wavenumber) * u).sin_cos();
        (S::from_f64(self.epsilon / self.wavenumber) * s, S::from_f64(self.epsilon) * c)
    }

    /// [`FullOrbit::wave`] of x and of y.
    #[inline(always)]
    fn waves<S: Elementary>(&self, x: S, y: S) -> [(S, S); 2] {
        [self.wave(x), self.wave(y)]
    }

    /// E = −ε∇φ, from the wave of x and the slope of that of y.
    #[inline(always)]
    pub(crate) fn electric<S: Elementary>(&self, of_x: S, slope_of_y: S) -> (S, S) {
        let strength = self.potential * self.wavenumber;
        let by_x = S::from_f64(strength * self.wavenumber) * of_x;
        (by_x, -(S::from_f64(strength) * slope_of_y))
    }

    /// [x, y, v_x, v_y] of a point.
    #[inline(always)]
    pub(crate) fn particle<S: Elementary>(&self, z: &[S]) -> [S; 4] {
        let (x, y) = Self::position(z);
        let (vx, vy) = self.velocity(z);
        [x, y, vx, vy]
    }

    /// The inverse of [`FullOrbit::particle`]: z ← the point of a particle.
    #[inline(always)]
    pub(crate) fn set_particle<S: Elementary>(&self, [x, y, vx, vy]: [S; 4], z: &mut [S]) {
        let [(sx, _), (sy, _)] = self.waves(x, y);
        (z[0], z[2]) = (vx - sy, vy + sx);
        (z[1], z[3]) = (y - z[0], x + z[2]);
    }

    /// (v_x, v_y) at a point.
    #[inline(always)]
    pub fn velocity<S: Elementary>(&self, z: &[S]) -> (S, S) {
        let (x, y) = Self::position(z);
        let [(sx, _), (sy, _)] = self.waves(x, y);
        (z[0] + sy, z[2] - sx)
    }

    /// v²/2B at a point, the magnetic moment to lowest order.
    pub fn magnetic_moment<S: Elementary>(&self, z: &[S]) -> S {
        let (x, y) = Self::position(z);
        let [(_, cx), (_, cy)] = self.waves(x, y);
        let (vx, vy) = self.velocity(z);
        S::from_f64(0.5) * (vx * vx + vy * vy) / (S::from_f64(1.0) + cx + cy)
    }

    /// Fails unless k is positive, f is finite and |ε| < ½: for larger |ε|, B vanishes somewhere and the particle
    /// does not gyrate there.
    ///
    /// # Errors
    /// With the value.
    pub fn check(&self) -> Result<(), Error> {
        if !(self.epsilon.abs() < 0.5) {
            let expected = "between -0.5 and 0.5: B = 1 + ε(cos kx + cos ky) vanishes nowhere then";
            return Err(Error::invalid("system.epsilon", self.epsilon, expected));
        }
        Error::check_range("system.wavenumber", self.wavenumber, Error::LEAST_POSITIVE, f64::MAX)?;
        Error::check_finite("system.potential", self.potential)
    }
}

impl Hamiltonian for FullOrbit {
    fn dof(&self) -> usize {
        2
    }
    #[inline(always)]
    fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
        let (x, y) = Self::position(z);
        let [(sx, cx), (sy, _)] = self.waves(x, y);
        let (vx, vy) = (z[0] + sy, z[2] - sx);
        let k = S::from_f64(self.wavenumber);
        S::from_f64(0.5) * (vx * vx + vy * vy) + S::from_f64(self.potential) * (cx + k * sy)
    }
    #[inline(always)]
    fn vector_field<S: Elementary>(&self, z: &[S], _: f64, out: &mut [S]) {
        let (x, y) = Self::position(z);
        let [(sx, cx), (sy, cy)] = self.waves(x, y);
        let (vx, vy) = (z[0] + sy, z[2] - sx);
        let (ex, ey) = self.electric(sx, cy);
        let (by_x, by_y) = (-(cx * vy) - ex, cy * vx - ey);
        out[0] = vy - by_x;
        out[1] = by_x;
        out[2] = -(vx + by_y);
        out[3] = -by_y;
    }
    fn fastest_frequency(&self, _: &[f64]) -> f64 {
        self.limiting_fastest_frequency()
    }
}

impl NearlyPeriodic for FullOrbit {
    fn epsilon(&self) -> f64 {
        self.epsilon
    }
    fn circle_action(&self) -> CircleAction {
        CircleAction::new([1, 0])
    }
    fn limiting_frequency(&self) -> f64 {
        1.0
    }
    /// The adiabatic invariant to leading order, μ₀ = ½(Π_x² + Π_y²).
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S {
        S::from_f64(0.5) * (z[0] * z[0] + z[2] * z[2])
    }
    fn customary_invariant<S: Elementary>(&self, z: &[S]) -> Option<(&'static str, S)> {
        Some(("v²/2B", self.magnetic_moment(z)))
    }
    /// J₀(kρ), J₁(kρ)/ρ, J₀(2kρ) and J₁(2kρ)/ρ of the gyroradius ρ = |Π|, as means over the gyration; of second order
    /// the coefficients of 1, cos 2kX, cos 2kY, sin 2kY, cos kX cos kY and cos kX sin kY. NaN where kρ is above 5, and
    /// of second order above 4.
    #[inline(always)]
    fn average_constants<S: Elementary>(
        &self,
        z: &[S],
        order: usize,
    ) -> Option<AverageConstants<S>> {
        let (k, f) = (self.wavenumber, self.potential);
        let radius = average::radius(z[0], z[2]);
        let (one, two) = (S::from_f64(1.0), S::from_f64(2.0));
        let mut first = [S::zero(); 4];
        // Of H̃₁, as functions of Π_y, the coefficients of cos kX and sin kX, and of Π_x those of cos kY and sin kY,
        // even and odd each.
        let mut of_x = [[Jet::zero(); POINTS]; 2];
        let mut of_y = [[Jet::zero(); POINTS]; 4];
        for i in 0..POINTS {
            let v = Jet::linear(QUARTER[i], radius);
            let (sin, cos) = v.times(k).sin_cos_of_linear();
            let (v_sin, v_cos) = ((v * sin).times(1.0 / k), (v * cos).times(1.0 / k));
            let (f_sin, f_cos) = (sin.times(f), cos.times(f));
            of_x[0][i] = v_sin + f_cos;
            of_x[1][i] = f_sin - v_cos;
            (of_y[0][i], of_y[1][i], of_y[2][i], of_y[3][i]) = (v_sin, f_sin, f_cos, v_cos);
            let weight = S::from_f64(k * (1.0 - QUARTER[i] * QUARTER[i]));
            let (cos, sin) = (cos.value(), sin.value());
            let double = one - two * sin * sin;
            first[0] += cos;
            first[1] += weight * cos;
            first[2] += double;
            first[3] += two * weight * double;
        }
        let share = S::from_f64(1.0 / POINTS as f64);
        // The first has the double of the argument, the second products and integrals.
        let most = if order == 1 { 0.5 * average::RESOLVED } else { average::INTEGRALS_RESOLVED };
        let resolved = average::zero_within(most, S::from_f64(k) * radius);
        for value in &mut first {
            *value = share.mul_add(*value, resolved);
        }
        if order == 1 {
            return Some(AverageConstants { first, second: None });
        }
        let [even_x, odd_x] = &of_x;
        let [even_cos, odd_cos, even_sin, odd_sin] = &of_y;
        let product = average::mean_of_product::<S>;
        let (mean_x, mean_cos, mean_sin) =
            (average::mean(even_x), average::mean(even_cos), average::mean(even_sin));
        let xx = [product(even_x, even_x) - mean_x * mean_x, product(odd_x, odd_x)];
        let cc = product(even_cos, even_cos) - mean_cos * mean_cos + product(odd_cos, odd_cos);
        let ss = product(even_sin, even_sin) - mean_sin * mean_sin + product(odd_sin, odd_sin);
        let cs = product(even_cos, even_sin) - mean_cos * mean_sin + product(odd_cos, odd_sin);
        let x_cos = average::mean_across(even_x, even_cos) - mean_x * mean_cos;
        let x_sin = average::mean_across(even_x, even_sin) - mean_x * mean_sin;
        let by_cos = average::mean_with_integral(odd_x, odd_cos).times(k * k);
        let by_sin = average::mean_with_integral(odd_x, odd_sin).times(k * k);
        let both = |[a, a_slope]: [S; 2], [b, b_slope]: [S; 2]| [a + b, a_slope + b_slope];
        let second = [
            (xx[0] + xx[1] + cc + ss).times(-0.25).slopes(radius),
            (xx[0] - xx[1]).times(-0.25).slopes(radius),
            (cc - ss).times(-0.25).slopes(radius),
            cs.times(-0.5).slopes(radius),
            both(x_cos.times(-1.0).slopes(radius), by_sin.times(-1.0).with_slope(radius)),
            both(x_sin.times(-1.0).slopes(radius), by_cos.with_slope(radius)),
        ];
        Some(AverageConstants { first, second: Some(second) })
    }
    /// The vector field of the gyro-average without ½ρ², with J₀ and J₁ of kρ,
    ///
    /// ε(ρJ₁/k (cos kX + cos kY) + fJ₀(cos kX + sin kY)) + ε²(2 − J₀(2kρ)(cos 2kX + cos 2kY))/4k²,
    ///
    /// and of the second order of averaging.
    #[inline(always)]
    fn averaged_field<S: Elementary>(
        &self,
        z: &[S],
        constants: &AverageConstants<S>,
        out: &mut [S],
    ) {
        let [j0, j1, of_double, j1_of_double] = constants.first;
        let (k, strength) = (S::from_f64(self.wavenumber), S::from_f64(self.potential));
        let ((sx, cx), (sy, cy)) = ((k * z[3]).sin_cos(), (k * z[1]).sin_cos());
        let (one, two) = (S::from_f64(1.0), S::from_f64(2.0));
        let (epsilon, second) =
            (S::from_f64(self.epsilon), S::from_f64(0.5 * self.epsilon * self.epsilon) / k);
        let of_field = epsilon * j1 * (z[0] * z[0] + z[2] * z[2]);
        let of_potential = epsilon * strength * k * j0;
        let first = epsilon * (j0 * (cx + cy) - strength * k * j1 * (cx + sy));
        let mut shift = first + second * j1_of_double * two * (one - sx * sx - sy * sy);
        let of_square = second * of_double * two;
        out[1] = of_square * sx * cx - (of_field + of_potential) * sx;
        out[3] = of_field * sy - of_potential * cy - of_square * sy * cy;
        if let Some([[_, a0], [a1, b1], [a2, b2], [a3, b3], [a4, b4], [a5, b5]]) = constants.second
        {
            let square = S::from_f64(self.epsilon * self.epsilon);
            let (double_sx, double_cx) = (two * sx * cx, one - two * sx * sx);
            let (double_sy, double_cy) = (two * sy * cy, one - two * sy * sy);
            let of_x = two * a1 * double_sx + sx * (a4 * cy + a5 * sy);
            let of_y = two * (a2 * double_sy - a3 * double_cy) + cx * (a4 * sy - a5 * cy);
            out[1] -= square * k * of_x;
            out[3] += square * k * of_y;
            let waves = b1 * double_cx + b2 * double_cy + b3 * double_sy;
            shift += square * (a0 + waves + cx * (b4 * cy + b5 * sy));
        }
        (out[0], out[2]) = (shift * z[2], -(shift * z[0]));
    }
    /// A: the waves of X. B: those of Y.
    fn average_split(&self) -> Option<Vec<f64>> {
        Some(vec![0.0; 2])
    }
    fn average_has_cross(&self) -> bool {
        true
    }
    #[inline(always)]
    fn flow_of_average<S: Elementary>(
        &self,
        part: AveragePart,
        z: &mut [S],
        constants: &AverageConstants<S>,
        time: S,
    ) -> S {
        let [j0, j1, of_double, j1_of_double] = constants.first;
        let (k, strength) = (S::from_f64(self.wavenumber), S::from_f64(self.potential));
        let (one, two, half) = (S::from_f64(1.0), S::from_f64(2.0), S::from_f64(0.5));
        let square = S::from_f64(self.epsilon * self.epsilon) * time;
        let at = match part {
            AveragePart::A => z[3],
            AveragePart::B => z[1],
            AveragePart::Cross => {
                let Some([.., [a4, b4], [a5, b5]]) = constants.second else { return S::zero() };
                let (half_square, quarter_square) = (half * square, half * half * square);
                let mut angle = S::zero();
                // Symmetric: half of the waves of Y + X, those of Y − X, the other half.
                for first in [true, false] {
                    let (sin, cos) = (k * (z[3] + z[1])).sin_cos();
                    let moved = quarter_square * k * (a5 * cos - a4 * sin);
                    (z[1], z[3]) = (z[1] + moved, z[3] - moved);
                    angle += quarter_square * (b4 * cos + b5 * sin);
                    if first {
                        let (sin, cos) = (k * (z[3] - z[1])).sin_cos();
                        let moved = half_square * k * (a4 * sin + a5 * cos);
                        (z[1], z[3]) = (z[1] - moved, z[3] - moved);
                        angle += half_square * (b4 * cos - b5 * sin);
                    }
                }
                return angle;
            }
        };
        let epsilon = S::from_f64(self.epsilon) * time;
        let second = half * square / k;
        let of_field = epsilon * j1 * (z[0] * z[0] + z[2] * z[2]);
        let of_potential = epsilon * strength * k * j0;
        let of_square = second * of_double * two;
        let (sin, cos) = (k * at).sin_cos();
        let wave = match part {
            AveragePart::A => {
                z[1] += of_square * sin * cos - (of_field + of_potential) * sin;
                cos
            }
            _ => {
                z[3] += of_field * sin - of_potential * cos - of_square * sin * cos;
                sin
            }
        };
        let first = epsilon * (j0 * cos - strength * k * j1 * wave);
        let double = one - two * sin * sin;
        let mut angle = first + second * j1_of_double * double;
        if let Some([[_, a0], [a1, b1], [a2, b2], [a3, b3], ..]) = constants.second {
            let double_sin = two * sin * cos;
            angle += square
                * match part {
                    AveragePart::A => {
                        z[1] -= square * k * two * a1 * double_sin;
                        a0 + b1 * double
                    }
                    _ => {
                        z[3] += square * k * two * (a2 * double_sin - a3 * double);
                        b2 * double + b3 * double_sin
                    }
                };
        }
        angle
    }
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S) {
        turn(z, 0, 2, time);
    }
}

/// A splitting of the vector field, in the velocities v = Π − εa: A is the gyration in the uniform
/// part, B turns and accelerates the velocity where the particle is. Its compositions keep the
/// volume and the reversal of time, not the symplectic form.
///
/// Source: Knapp, Kendl, Koskela and Ostermann, <https://doi.org/10.1103/PhysRevE.92.063310>.
impl Splittable for FullOrbit {
    #[inline(always)]
    fn enter<S: Elementary>(&self, z: &mut [S]) {
        let [x, y, vx, vy] = self.particle(z);
        z.copy_from_slice(&[vx, y - vx, vy, x + vy]);
    }
    #[inline(always)]
    fn leave<S: Elementary>(&self, z: &mut [S]) {
        let (x, y) = Self::position(z);
        self.set_particle([x, y, z[0], z[2]], z);
    }
    fn frequencies(&self) -> Vec<f64> {
        vec![1.0, 0.0]
    }
    /// v ← R(βh)v + h sinc(½βh)R(½βh)E, β = ε(cos kx + cos ky), E = −ε∇φ.
    #[inline(always)]
    fn flow_b<S: Elementary>(&self, z: &mut [S], time: S) {
        let (x, y) = Self::position(z);
        let [(sx, cx), (_, cy)] = self.waves(x, y);
        let half = S::from_f64(0.5) * (cx + cy) * time;
        let (s, c) = half.sin_cos();
        let kick = time * sinc(half);
        let (ex, ey) = self.electric(sx, cy);
        let (ex, ey) = (kick * ex, kick * ey);
        // R(½βh)(R(½βh)v + …), each turn clockwise.
        let (vx, vy) = (c * z[0] + s * z[2] + ex, c * z[2] - s * z[0] + ey);
        (z[0], z[2]) = (c * vx + s * vy, c * vy - s * vx);
        (z[1], z[3]) = (y - z[0], x + z[2]);
    }
}

/// sin u/u, for |u| ≤ 2 to rounding: for larger arguments steps are too long to be of use.
#[inline(always)]
fn sinc<S: Elementary>(u: S) -> S {
    const TERMS: u32 = 12;
    let square = u * u;
    let mut sum = S::from_f64(1.0);
    for k in (1..TERMS).rev() {
        let denominator = f64::from(2 * k * (2 * k + 1));
        sum = S::from_f64(1.0) - square * S::from_f64(1.0 / denominator) * sum;
    }
    sum
}
