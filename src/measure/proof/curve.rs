//! Closed curves of a plane by Fourier series, on real numbers and on strips around them.

use super::ball::{Ball, BallCentre, BallOf};
use super::number::Number;
use super::rounded::{Complex, SLACK, real_exp, real_sin_cos, up};
use super::taylor::{DEGREE, Taylor};
use crate::scalar::max_or_nan;
use std::f64::consts::TAU;

/// A complex number of two real ones of a kind.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wave<T> {
    pub re: T,
    pub im: T,
}

impl<T: Number> Wave<T> {
    pub fn new(re: T, im: T) -> Self {
        Self { re, im }
    }
    pub fn zero() -> Self {
        Self::new(T::of(0.0), T::of(0.0))
    }
    pub fn plus(self, o: Self) -> Self {
        Self::new(self.re.plus(o.re), self.im.plus(o.im))
    }
    pub fn minus(self, o: Self) -> Self {
        Self::new(self.re.minus(o.re), self.im.minus(o.im))
    }
    pub fn times(self, o: Self) -> Self {
        Self::new(
            self.re.times(o.re).minus(self.im.times(o.im)),
            self.re.times(o.im).plus(self.im.times(o.re)),
        )
    }
    pub fn scaled(self, f: f64) -> Self {
        Self::new(self.re.scaled(f), self.im.scaled(f))
    }
    pub fn conjugate(self) -> Self {
        Self::new(self.re, self.im.scaled(-1.0))
    }
    /// The product iz of the number z with the imaginary unit.
    pub fn times_i(self) -> Self {
        Self::new(self.im.scaled(-1.0), self.re)
    }
}

impl<C: BallCentre> Wave<BallOf<C>> {
    /// An upper bound of the modulus.
    pub fn above(self) -> f64 {
        let (a, b) = (self.re.magnitude(), self.im.magnitude());
        up(up(up(a * a) + up(b * b)).sqrt())
    }
}

/// e^{2πik/N} for k < N, a power of two.
pub(super) fn roots_of_unity<C: BallCentre>(count: usize) -> Vec<Wave<BallOf<C>>> {
    let root = |k: usize| {
        let (s, c) = BallOf::<C>::TAU.scaled(k as f64 / count as f64).sin_cos();
        Wave::new(c, s)
    };
    (0..count).map(root).collect()
}

/// Σ_j z_j e^{±2πijk/N} in place: the sign of the roots. N is a power of two.
pub(super) fn transform<T: Number>(z: &mut [Wave<T>], roots: &[Wave<T>], negative: bool) {
    let count = z.len();
    let bits = count.trailing_zeros();
    for k in 0..count {
        let other = k.reverse_bits() >> (usize::BITS - bits).min(usize::BITS - 1);
        if bits > 0 && k < other {
            z.swap(k, other);
        }
    }
    let mut size = 2;
    while size <= count {
        let stride = roots.len() / size;
        for block in z.chunks_exact_mut(size) {
            let (low, high) = block.split_at_mut(size / 2);
            for k in 0..size / 2 {
                let root = roots[k * stride];
                let other = high[k].times(if negative { root.conjugate() } else { root });
                (low[k], high[k]) = (low[k].plus(other), low[k].minus(other));
            }
        }
        size *= 2;
    }
}

/// A real-analytic closed curve K(φ) = Σ_{|k| ≤ M} c_k e^{2πikφ} in a plane, c_{−k} the conjugate of c_k, or one
/// around a cylinder, whose first component has φ added.
#[derive(Clone, Debug)]
pub(super) struct Curve<T> {
    /// c_k of both components, from k = 0 to M.
    pub modes: Vec<[Wave<T>; 2]>,
    pub cylinder: bool,
}

impl<T: Number> Curve<T> {
    /// Of the values of both components at equal distances, a power of two of them; so many modes.
    pub fn of_values(values: &[[T; 2]], roots: &[Wave<T>], most: usize, cylinder: bool) -> Self {
        let count = values.len();
        let mut z: Vec<Wave<T>> = values.iter().map(|[x, y]| Wave::new(*x, *y)).collect();
        transform(&mut z, roots, true);
        let mode = |k: usize| {
            let inverse = 0.5 / count as f64;
            let (a, b) = (z[k], z[(count - k) % count].conjugate());
            // x = (a + b)/2, y = (a − b)/2i.
            [a.plus(b).scaled(inverse), a.minus(b).scaled(inverse).times_i().scaled(-1.0)]
        };
        Self { modes: (0..=most).map(mode).collect(), cylinder }
    }

    /// The periodic part at `count` equal distances.
    pub fn values(&self, count: usize, roots: &[Wave<T>]) -> Vec<[T; 2]> {
        let mut z = vec![Wave::zero(); count];
        for (k, [x, y]) in self.modes.iter().enumerate() {
            z[k] = x.plus(y.times_i());
            if k > 0 {
                z[count - k] = x.conjugate().plus(y.conjugate().times_i());
            }
        }
        transform(&mut z, roots, false);
        z.into_iter().map(|z| [z.re, z.im]).collect()
    }

    /// φ ↦ K(φ + ω) without the φ of a cylinder, from e^{2πikω}.
    pub fn rotated(&self, phases: &[Wave<T>]) -> Self {
        let modes = self.modes.iter().zip(phases);
        let modes = modes.map(|(mode, phase)| mode.map(|c| c.times(*phase))).collect();
        Self { modes, cylinder: self.cylinder }
    }

    /// The derivative of the periodic part.
    pub fn slope(&self, tau: T) -> Self {
        let modes = self.modes.iter().enumerate().map(|(k, mode)| {
            mode.map(|c| {
                let c = c.times_i().scaled(k as f64);
                Wave::new(c.re.times(tau), c.im.times(tau))
            })
        });
        Self { modes: modes.collect(), cylinder: self.cylinder }
    }
}

/// e^{2πikω} for k from 0 to `most`.
pub(super) fn phases<C: BallCentre>(omega: BallOf<C>, most: usize) -> Vec<Wave<BallOf<C>>> {
    let phase = |k: usize| {
        let turns = omega.scaled(k as f64);
        let rest = turns.minus(BallOf::of(libm::round(turns.centre())));
        let (s, c) = rest.times(BallOf::TAU).sin_cos();
        Wave::new(c, s)
    };
    (0..=most).map(phase).collect()
}

/// A curve on the line Im φ = ρ, as Taylor models of K, K′ and K′(φ + ω) on its parts.
pub(super) struct OnLine {
    /// c_k of K, and of K(φ + ω).
    modes: Vec<[[Complex; 2]; 2]>,
    /// How far they are off.
    off: Vec<f64>,
    /// The factors e^{2πkρ} and e^{−2πkρ} of the modes −k and k on the line.
    growth: Vec<[f64; 2]>,
    /// max |c_k|, over both components of both.
    largest: Vec<f64>,
    cylinder: bool,
    rho: f64,
}

/// What the parts of one length have in common.
pub(super) struct PartLength {
    half: f64,
    /// The series of e^x of each mode k, from k = 0 on.
    steps: Vec<ModeStep>,
}

/// x = 2πk·half of a mode k, and its series e^x.
struct ModeStep {
    /// The value e^x of the whole series.
    all: f64,
    /// A bound of the terms beyond degree D, x^{D+1} e^x/(D+1)!.
    beyond: f64,
    /// x/m for m from 1 to D + 1.
    ratios: [f64; DEGREE + 1],
}

impl PartLength {
    /// Parts of 2·half, for as many modes.
    pub fn new(half: f64, modes: usize) -> Self {
        let step_of = |k: usize| {
            let step = TAU * k as f64 * half;
            let all = if step < 50.0 { real_exp(step) } else { f64::INFINITY };
            let mut ratios = [0.0; DEGREE + 1];
            // Σ_{m > D} x^m/m! ≤ x^{D+1} e^x/(D+1)!.
            let mut beyond = all;
            for (m, ratio) in (1..).zip(&mut ratios) {
                *ratio = step / f64::from(m);
                beyond *= *ratio;
            }
            ModeStep { all, beyond, ratios }
        };
        Self { half, steps: (0..modes).map(step_of).collect() }
    }
}

/// K, K′ and K′(φ + ω) of both components.
pub(super) struct Part {
    pub point: [Taylor; 2],
    pub slope: [Taylor; 2],
    pub next_slope: [Taylor; 2],
    /// The argument φ of the curve on the part, in turns.
    turns: Taylor,
}

impl Part {
    /// The argument φ of the curve on the part, in turns.
    pub fn turns(&self) -> Taylor {
        self.turns
    }
}

impl OnLine {
    pub fn new(curve: &Curve<Ball>, phases: &[Wave<Ball>], rho: f64) -> Self {
        let rotated = curve.rotated(phases);
        let narrow = |c: Wave<Ball>| Complex::new(c.re.centre(), c.im.centre());
        let (mut modes, mut off, mut growth) = (Vec::new(), Vec::new(), Vec::new());
        let mut largest = Vec::new();
        for (k, (a, b)) in curve.modes.iter().zip(&rotated.modes).enumerate() {
            let [own, next] = [a.map(narrow), b.map(narrow)];
            let moduli = own.iter().chain(&next).map(|c| c.above());
            largest.push(moduli.fold(0.0, max_or_nan));
            modes.push([own, next]);
            let rounded = |c: &Wave<Ball>| {
                up(up(c.above() * f64::EPSILON) + up(c.re.radius() + c.im.radius()))
            };
            let all = a.iter().chain(b).map(rounded);
            off.push(all.fold(0.0, |sum, x| up(sum + x)));
            let turns = TAU * k as f64 * rho;
            let up_there = if turns <= 600.0 { real_exp(turns) } else { f64::INFINITY };
            growth.push([up_there, if k == 0 { 1.0 } else { 1.0 / up_there }]);
        }
        Self { modes, off, growth, largest, cylinder: curve.cylinder, rho }
    }

    /// How many modes K has.
    pub fn modes(&self) -> usize {
        self.modes.len()
    }

    /// On φ = centre + half·s + iρ, |s| ≤ 1.
    ///
    /// The terms of a mode are c_k e^{2πikφ₀}(2πik·half·s)^m/m!. Rounding errs by less than 16·[`SLACK`] of the sum of
    /// the moduli of all terms: by 4 of them for the factors of each term, and 2⁻⁵³ times the number of terms of a
    /// sum, at most 2¹³ + 1.
    pub fn part(&self, centre: f64, length: &PartLength) -> Part {
        // A mode left out would be a bound that does not hold.
        assert_eq!(self.modes.len(), length.steps.len(), "modes of a part");
        let half = length.half;
        let mut sums = [[[Complex::ZERO; DEGREE + 1]; 2]; 3];
        let mut remainders = [0.0; 3];
        for (k, ([own, next], step)) in self.modes.iter().zip(&length.steps).enumerate() {
            let rate = TAU * k as f64;
            let turns = k as f64 * centre;
            let (s, c) = real_sin_cos(TAU * (turns - libm::round(turns)));
            for (sign, growth) in [(1.0, self.growth[k][1]), (-1.0, self.growth[k][0])] {
                if k == 0 && sign < 0.0 {
                    continue;
                }
                let series = self.largest[k] * (16.0 * SLACK * step.all + step.beyond);
                let off = growth * (series + self.off[k] * step.all);
                for (which, factor) in [1.0, rate, rate].into_iter().enumerate() {
                    remainders[which] += off * factor;
                }
                let wave = Complex::new(c * growth, sign * s * growth);
                for axis in 0..2 {
                    let of = |c: Complex| Complex::new(c.re, sign * c.im).times(wave);
                    let turn = |z: Complex| Complex::new(-sign * rate * z.im, sign * rate * z.re);
                    let (point, after) = (of(own[axis]), of(next[axis]));
                    for (which, mut term) in
                        [point, turn(point), turn(after)].into_iter().enumerate()
                    {
                        for (sum, ratio) in sums[which][axis].iter_mut().zip(&step.ratios) {
                            *sum = Complex::new(sum.re + term.re, sum.im + term.im);
                            let more = sign * ratio;
                            term = Complex::new(-more * term.im, more * term.re);
                        }
                    }
                }
            }
        }
        if self.cylinder {
            sums[0][0][0].re += centre;
            sums[0][0][0].im += self.rho;
            sums[0][0][1].re += half;
            sums[1][0][0].re += 1.0;
            sums[2][0][0].re += 1.0;
            // The rounding of these sums.
            for remainder in &mut remainders {
                *remainder += 4.0 * SLACK;
            }
        }
        let models = |which: usize| {
            // The sums of 2¹³ + 1 positive numbers.
            let remainder = up(remainders[which] * (1.0 + 1e-9));
            sums[which].map(|c| Taylor::new(c, remainder))
        };
        let mut turns = [Complex::ZERO; DEGREE + 1];
        (turns[0], turns[1]) = (Complex::new(centre, self.rho), Complex::new(half, 0.0));
        let turns = Taylor::new(turns, 0.0);
        Part { turns, point: models(0), slope: models(1), next_slope: models(2) }
    }
}
