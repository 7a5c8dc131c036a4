//! Invariant circles of maps of a plane, by Fourier series.

use super::golden_section::golden_section;
use crate::error::Error;
use crate::phase::AreaDensity;
use crate::scalar::{Elementary, max_or_nan};
use crate::stopping::{is_stopped, until_stopped};
use faer::Mat;
use faer::linalg::solvers::SolveLstsq;
use std::f64::consts::TAU;

/// A closed curve K(θ) = c₀ + Σ_k c_k cos kθ + s_k sin kθ on which a map of a plane turns: P(K(θ)) = K(θ + 2πν).
///
/// It is fitted to an orbit by least squares, so that where the orbit is on a smooth curve its error falls faster than
/// any power of the number of modes.
///
/// Source: Jorba, <https://doi.org/10.1088/0951-7715/14/5/303>, for invariant curves as Fourier series.
#[derive(Clone, Debug, PartialEq)]
pub struct InvariantCircle {
    /// ν, in turns per map.
    pub turns: f64,
    /// The largest distance of the states of the second half of the orbit, which the fit does not use, from their
    /// places on the curve. On an island chain or a chaotic orbit it is of the size of the islands or the chaotic sea.
    pub error: f64,
    /// c_k and s_k of both coordinates: c₀, and c₁, s₁, c₂, s₂, ….
    modes: Vec<[f64; 2]>,
}

/// The modes of a curve, at most.
const MOST_MODES: usize = 96;
/// So many states for each unknown.
const STATES_A_TERM: usize = 3;

impl InvariantCircle {
    /// Fits the curve to an orbit of states of two numbers with about `turns` turns per map. The number of modes is the
    /// one with the smallest [error](InvariantCircle::error) on the second half of the orbit.
    ///
    /// # Errors
    /// [`Error::CountOutOfRange`] of fewer than 64 states, [`Error::OutOfRange`] of numbers that are not finite.
    pub fn of_orbit(orbit: &[f64], turns: f64) -> Result<Self, Error> {
        const LEAST: usize = 64;
        const GROWTH: f64 = 1.5;
        Error::check_rows("states", orbit.len(), 2)?;
        let states = orbit.len() / 2;
        Error::check_count_range("states", states, LEAST, usize::MAX)?;
        Error::check_finite("turns", turns)?;
        orbit.iter().try_for_each(|v| Error::check_finite("states", *v))?;
        let seen = states / 2;
        let mut best: Option<Self> = None;
        let mut modes = 4;
        while modes <= MOST_MODES && STATES_A_TERM * (2 * modes + 1) <= seen {
            if best.is_some() && is_stopped() {
                break;
            }
            let found = Self::fit(orbit, seen, turns, modes);
            let better = best.as_ref().is_none_or(|best| found.error < best.error);
            let worse = best.as_ref().is_some_and(|best| found.error > 10.0 * best.error);
            if better {
                best = Some(found);
            }
            if worse {
                break;
            }
            modes = (modes as f64 * GROWTH) as usize;
        }
        Ok(best.expect("64 states are enough for four modes"))
    }

    /// Of so many modes, fitted to the first `seen` states, judged by the others.
    fn fit(orbit: &[f64], seen: usize, turns: f64, modes: usize) -> Self {
        const REFINEMENTS: usize = 4;
        // Counted from the middle, so that a little more turning does not shift the curve.
        let middle = (seen - 1) as f64 / 2.0;
        let right = Mat::from_fn(seen, 2, |n, axis| orbit[2 * n + axis]);
        let mut out = Self { turns, error: f64::NAN, modes: Vec::new() };
        for _ in until_stopped(0..REFINEMENTS) {
            let rows: Vec<Vec<f64>> =
                (0..seen).map(|n| terms((n as f64 - middle) * out.turns, modes)).collect();
            let matrix = Mat::from_fn(seen, 2 * modes + 1, |n, k| rows[n][k]);
            let solution = matrix.qr().solve_lstsq(&right);
            out.modes = (0..2 * modes + 1).map(|k| [solution[(k, 0)], solution[(k, 1)]]).collect();
            // The turning that leaves least: δν = ⟨r, n K′⟩/⟨n K′, n K′⟩.
            let (mut above, mut below) = (0.0, 0.0);
            for n in 0..seen {
                let count = n as f64 - middle;
                let (point, slope) = out.point_and_slope(count * out.turns);
                for axis in 0..2 {
                    let along = count * slope[axis];
                    above += (orbit[2 * n + axis] - point[axis]) * along;
                    below += along * along;
                }
            }
            let more = if below > 0.0 { above / below } else { 0.0 };
            out.turns += more;
            // Rounding of a turn over all states.
            if more.abs() * seen as f64 <= f64::EPSILON {
                break;
            }
        }
        let missed = (seen..orbit.len() / 2).map(|n| {
            let (point, _) = out.point_and_slope((n as f64 - middle) * out.turns);
            libm::hypot(point[0] - orbit[2 * n], point[1] - orbit[2 * n + 1])
        });
        out.error = missed.fold(0.0, max_or_nan);
        out
    }

    /// The number of Fourier modes of the circle.
    pub fn modes(&self) -> usize {
        self.modes.len() / 2
    }

    /// K and dK/du at θ = 2πu.
    pub fn point_and_slope(&self, u: f64) -> ([f64; 2], [f64; 2]) {
        let (mut point, mut slope) = (self.modes[0], [0.0; 2]);
        for (k, pair) in self.modes[1..].chunks_exact(2).enumerate() {
            let turns = (k + 1) as f64;
            let (s, c) = Elementary::sin_cos(TAU * libm::remainder(turns * u, 1.0));
            for axis in 0..2 {
                let (cosine, sine) = (pair[0][axis], pair[1][axis]);
                point[axis] += cosine * c + sine * s;
                slope[axis] += TAU * turns * (sine * c - cosine * s);
            }
        }
        (point, slope)
    }

    /// `count` points of the curve at equal distances of θ, two numbers each.
    pub fn points(&self, count: usize) -> Vec<f64> {
        (0..count).flat_map(|k| self.point_and_slope(k as f64 / count as f64).0).collect()
    }

    /// The area within the curve, with the sign of its direction: ½∮(x dy − y dx) = π Σ k (c_k × s_k).
    pub fn area(&self) -> f64 {
        let of = |(k, pair): (usize, &[[f64; 2]])| {
            let [c, s] = [pair[0], pair[1]];
            (k + 1) as f64 * (c[0] * s[1] - c[1] * s[0])
        };
        0.5 * TAU * self.modes[1..].chunks_exact(2).enumerate().map(of).sum::<f64>()
    }

    /// ∫∫ρ dx dy within the curve, with the sign of its direction, by the trapezoidal rule for ∮(∫ρ dx) dy, whose error
    /// falls faster than any power of the number of points; NaN where the curve leaves the box of the density. With R,
    /// Z and ρ = B_φ in tesla it is the toroidal flux within a magnetic surface, in webers.
    pub fn flux(&self, density: &AreaDensity) -> f64 {
        let count = 8 * self.modes() + 8;
        let of = |k: usize| {
            let (point, slope) = self.point_and_slope(k as f64 / count as f64);
            let [_, p] = density.to_canonical(point);
            p * slope[1]
        };
        density.scale() * (0..count).map(of).sum::<f64>() / count as f64
    }

    /// The distance of each point, two numbers each, from the curve; NaN for a point that is not finite.
    pub fn distances(&self, points: &[f64]) -> Vec<f64> {
        let count = 8 * self.modes() + 8;
        let around = self.points(count);
        let sample = |k: usize| [around[2 * k], around[2 * k + 1]];
        let next = |k: usize| (k + 1) % count;
        let apart = |[a, b]: [f64; 2], [c, d]: [f64; 2]| libm::hypot(a - c, b - d);
        let spacing = (0..count).map(|k| apart(sample(k), sample(next(k))));
        let spacing = spacing.fold(0.0, max_or_nan);
        points
            .chunks_exact(2)
            .map(|place| {
                let off: Vec<f64> =
                    (0..count).map(|k| apart(sample(k), [place[0], place[1]])).collect();
                let nearest = (0..count).min_by(|a, b| off[*a].total_cmp(&off[*b]));
                let nearest = nearest.expect("points");
                let near = self.distance_near(place, nearest as f64 / count as f64);
                // Where no curvature matters and no other part of the curve may be nearer.
                let is_other = |k: &usize| {
                    let is_least =
                        off[*k] <= off[(k + count - 1) % count] && off[*k] <= off[next(*k)];
                    is_least && *k != nearest && off[*k] <= near + spacing
                };
                if near.is_nan() || near <= spacing && !(0..count).any(|k| is_other(&k)) {
                    return near;
                }
                let within = |k: usize| self.distance_within(place, k as f64, count as f64);
                let others = (0..count).filter(is_other).chain([nearest]);
                // no NaN: the place is finite, and so is the curve.
                others.map(within).fold(near, f64::min)
            })
            .collect()
    }

    /// The least distance from a place within a sample of `count` on either side of sample k, by golden section.
    fn distance_within(&self, place: &[f64], k: f64, count: f64) -> f64 {
        let apart = |u: f64| {
            let (point, _) = self.point_and_slope(u);
            libm::hypot(point[0] - place[0], point[1] - place[1])
        };
        // Distances about a minimum differ by the square of this.
        let enough = 1e-8 / count;
        let [low, high] = golden_section(apart, [(k - 1.0) / count, (k + 1.0) / count], enough);
        apart(0.5 * (low + high))
    }

    /// By Newton's method for (K − z)·K′ = 0 from a place near.
    fn distance_near(&self, place: &[f64], from: f64) -> f64 {
        const STEPS: usize = 8;
        let apart = |u: f64| {
            let (point, slope) = self.point_and_slope(u);
            ([point[0] - place[0], point[1] - place[1]], slope)
        };
        let mut u = from;
        let (first, _) = apart(u);
        let mut least = libm::hypot(first[0], first[1]);
        for _ in 0..STEPS {
            let (off, slope) = apart(u);
            // The curvature is left out: it does not matter near the curve.
            let step = (off[0] * slope[0] + off[1] * slope[1])
                / (slope[0] * slope[0] + slope[1] * slope[1]);
            u -= step;
            let (off, _) = apart(u);
            let found = libm::hypot(off[0], off[1]);
            // A NaN stays.
            least = if least.is_nan() || found >= least { least } else { found };
        }
        least
    }
}

/// 1, cos 2πu, sin 2πu, cos 4πu, ….
fn terms(u: f64, modes: usize) -> Vec<f64> {
    let mut out = Vec::with_capacity(2 * modes + 1);
    out.push(1.0);
    for k in 1..=modes {
        let (s, c) = Elementary::sin_cos(TAU * libm::remainder(k as f64 * u, 1.0));
        out.extend([c, s]);
    }
    out
}
