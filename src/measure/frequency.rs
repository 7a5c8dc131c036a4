//! Frequencies of quasi-periodic signals, and the tunes of orbits, by windowed frequency analysis.

use super::golden_section::golden_section;
use crate::flow::Trajectories;
use crate::scalar::{Elementary, max_or_nan};
use crate::stopping::is_stopped;
use faer::Mat;
use faer::linalg::solvers::Solve;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// A spectral line: a term (x + iy)·e^{2πiνt} of a signal at the times t = 0, 1, …
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpectralLine {
    /// ν, in turns per sample of the signal, between −½ and ½.
    pub frequency: f64,
    /// The real and the imaginary part x, y of the amplitude.
    pub amplitude: [f64; 2],
}

impl SpectralLine {
    /// The modulus |x + iy| of the amplitude.
    pub fn size(&self) -> f64 {
        libm::hypot(self.amplitude[0], self.amplitude[1])
    }
}

/// So many numbers are looked through for the highest peak.
const FIRST: usize = 512;
/// Numbers of a signal, at least.
const LEAST: usize = 16;
/// What is so much smaller than a signal is rounding of it.
const ROUNDING: f64 = 64.0 * f64::EPSILON;
/// Steps of a search between two neighbours of a peak.
const STEPS: usize = 60;

/// The strongest spectral lines of a signal f(t) = x + iy, found one after another. The frequency of a line is the
/// maximum of |Σ f w e^{−2πiνt}| with the Hann window w; the amplitudes of all lines found so far are a least-squares
/// fit in the inner product of the window.
///
/// The frequency of a single line is exact to rounding; the error from other lines is O(N⁻⁴) for N samples. Peaks are
/// searched in the first 512 samples and then refined in twice as many, up to all of them, so the work is that of a
/// few sums over the signal. A signal of fewer than 16 samples has no lines.
///
/// Source: Laskar, <https://doi.org/10.1016/0019-1035(90)90084-M>; its convergence:
/// <https://arxiv.org/abs/math/0305364>.
pub fn spectral_lines(signal: &[[f64; 2]], count: usize) -> Vec<SpectralLine> {
    let mut found: Vec<SpectralLine> = Vec::new();
    if signal.len() < LEAST || !signal.iter().flatten().all(|v| v.is_finite()) {
        return found;
    }
    let mut rest = signal.to_vec();
    for _ in 0..count {
        if !(largest(&rest) > ROUNDING * largest(signal)) {
            break;
        }
        let frequency = peak(&rest);
        if is_stopped() || found.iter().any(|line| line.frequency == frequency) {
            break;
        }
        found.push(SpectralLine { frequency, amplitude: [0.0; 2] });
        fit_amplitudes(signal, &mut found);
        rest.copy_from_slice(signal);
        for line in &found {
            for (t, value) in rest.iter_mut().enumerate() {
                let [x, y] = term(line, t);
                *value = [value[0] - x, value[1] - y];
            }
        }
    }
    found
}

/// The largest number of a signal.
fn largest(signal: &[[f64; 2]]) -> f64 {
    signal.iter().flatten().map(|v| v.abs()).fold(0.0, max_or_nan)
}

/// A line at a time.
fn term(line: &SpectralLine, time: usize) -> [f64; 2] {
    let (sin, cos) = turned(line.frequency, time as f64);
    let [x, y] = line.amplitude;
    [x * cos - y * sin, x * sin + y * cos]
}

/// Sine and cosine of ν t turns.
fn turned(frequency: f64, time: f64) -> (f64, f64) {
    let turns = frequency * time;
    Elementary::sin_cos(TAU * (turns - turns.round()))
}

/// The window of Hann at a time of so many.
fn window(time: usize, count: usize) -> f64 {
    let (_, cos) = Elementary::sin_cos(TAU * time as f64 / (count - 1) as f64);
    1.0 - cos
}

/// The window at each time of so many, over their number.
fn weights(count: usize) -> Vec<f64> {
    (0..count).map(|t| window(t, count) / count as f64).collect()
}

/// Σ f w e^{−2πiνt} over as many numbers as there are weights.
fn transform(signal: &[[f64; 2]], weights: &[f64], frequency: f64) -> [f64; 2] {
    let mut sum = [0.0; 2];
    for (t, ([x, y], w)) in signal.iter().zip(weights).enumerate() {
        let (sin, cos) = turned(frequency, t as f64);
        sum[0] += w * (x * cos + y * sin);
        sum[1] += w * (y * cos - x * sin);
    }
    sum
}

fn size(signal: &[[f64; 2]], weights: &[f64], frequency: f64) -> f64 {
    let [x, y] = transform(signal, weights, frequency);
    x * x + y * y
}

/// Its size at the frequencies k/grid − ½, for k from 0 to `grid`.
fn sizes_on_grid(signal: &[[f64; 2]], weights: &[f64], grid: usize) -> Vec<f64> {
    let roots: Vec<(f64, f64)> = (0..grid).map(|j| turned(1.0 / grid as f64, j as f64)).collect();
    // The half turn changes the sign from time to time.
    let alternating = |(t, ([x, y], w)): (usize, (&[f64; 2], &f64))| {
        let w = if t % 2 == 0 { *w } else { -w };
        [w * x, w * y]
    };
    let signal: Vec<[f64; 2]> = signal.iter().zip(weights).enumerate().map(alternating).collect();
    let at = |k: usize| {
        let (mut sum, mut place) = ([0.0; 2], 0);
        for [x, y] in &signal {
            let (sin, cos) = roots[place];
            sum = [sum[0] + (x * cos + y * sin), sum[1] + (y * cos - x * sin)];
            place += k;
            if place >= grid {
                place -= grid;
            }
        }
        sum[0] * sum[0] + sum[1] * sum[1]
    };
    (0..grid).map(at).collect()
}

/// The frequency of the highest peak.
fn peak(signal: &[[f64; 2]]) -> f64 {
    let mut count = FIRST.min(signal.len());
    let grid = 2 * count;
    let place = |k: usize| k as f64 / grid as f64 - 0.5;
    let of_first = weights(count);
    let sizes = sizes_on_grid(signal, &of_first, grid);
    let best = (0..grid).max_by(|a, b| sizes[*a].total_cmp(&sizes[*b])).unwrap_or(0);
    let mut frequency = highest(signal, &of_first, place(best), 1.0 / grid as f64);
    while count < signal.len() {
        let before = count;
        count = (2 * count).min(signal.len());
        // Half the width of the peak of as many as before, which is one of twice as many.
        frequency = highest(signal, &weights(count), frequency, 0.5 / before as f64);
    }
    frequency - frequency.round()
}

/// The maximum within so much of a place, by golden section.
fn highest(signal: &[[f64; 2]], weights: &[f64], place: f64, within: f64) -> f64 {
    // Nearer to the maximum squares differ by less than their rounding: there the derivative is asked.
    let coarse = 1e-3 / weights.len() as f64;
    let at = |frequency: f64| -size(signal, weights, frequency);
    let [low, high] = golden_section(at, [place - within, place + within], coarse);
    slope_root(signal, weights, 0.5 * (low + high), coarse)
}

/// Where the derivative of |Σ f w e^{−2πiνt}|² is 0, near a maximum, by the secant method: it is known to rounding
/// where the square itself is flat.
fn slope_root(signal: &[[f64; 2]], weights: &[f64], place: f64, step: f64) -> f64 {
    let slope = |frequency: f64| {
        let (mut sum, mut moment) = ([0.0; 2], [0.0; 2]);
        let middle = 0.5 * (weights.len() - 1) as f64;
        for (t, ([x, y], w)) in signal.iter().zip(weights).enumerate() {
            let (sin, cos) = turned(frequency, t as f64);
            let [re, im] = [w * (x * cos + y * sin), w * (y * cos - x * sin)];
            sum = [sum[0] + re, sum[1] + im];
            let t = (t as f64 - middle) / middle;
            moment = [moment[0] + t * im, moment[1] - t * re];
        }
        sum[0] * moment[0] + sum[1] * moment[1]
    };
    let (mut a, mut b) = (place - step, place + step);
    let (mut of_a, mut of_b) = (slope(a), slope(b));
    for _ in 0..STEPS {
        let next = b - of_b * (b - a) / (of_b - of_a);
        if is_stopped() || !next.is_finite() || (next - place).abs() > 4.0 * step {
            break;
        }
        (a, of_a) = (b, of_b);
        (b, of_b) = (next, slope(next));
        if (b - a).abs() <= f64::EPSILON {
            break;
        }
    }
    if (b - place).abs() <= 4.0 * step { b } else { place }
}

/// The amplitudes of all lines, by least squares in the product of the window.
fn fit_amplitudes(signal: &[[f64; 2]], lines: &mut [SpectralLine]) {
    let (count, size) = (signal.len(), lines.len());
    // Of e^{2πiν_k t} with one another: real and imaginary parts of a Hermitian matrix, as a real one of twice the
    // size.
    let (ones, weights) = (vec![[1.0, 0.0]; count], weights(count));
    let products: Vec<[f64; 2]> = (0..size * size)
        .map(|index| {
            let (i, k) = (index / size, index % size);
            transform(&ones, &weights, lines[i].frequency - lines[k].frequency)
        })
        .collect();
    let matrix = Mat::from_fn(2 * size, 2 * size, |row, column| {
        let [re, im] = products[row / 2 * size + column / 2];
        match (row % 2, column % 2) {
            (0, 0) | (1, 1) => re,
            (0, 1) => -im,
            _ => im,
        }
    });
    let right: Vec<[f64; 2]> =
        lines.iter().map(|line| transform(signal, &weights, line.frequency)).collect();
    let right = Mat::from_fn(2 * size, 1, |row, _| right[row / 2][row % 2]);
    let solution = matrix.partial_piv_lu().solve(&right);
    for (k, line) in lines.iter_mut().enumerate() {
        line.amplitude = [solution[(2 * k, 0)], solution[(2 * k + 1, 0)]];
    }
}

/// The tunes of an orbit: its rotation frequency in each plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Tunes {
    /// The turns per map in each plane, between −½ and ½, positive from p towards q as for a circle action. NaN for a
    /// plane that does not turn, or so little that its turn and its mean cannot be told apart (about one turn of the
    /// whole orbit), and for an orbit that leaves the finite numbers.
    pub turns: Vec<f64>,
    /// The difference of the tunes of the two halves of the orbit, for each plane: small on an invariant torus, and a
    /// sign of chaos where it is not small. NaN where a half turns too little to have a tune.
    pub changes: Vec<f64>,
}

/// The window's part of a line of so many turns reaches to frequency 0 by less than rounding of tunes.
const SLOW: f64 = 16.0;

/// The frequency of the strongest line of a signal that has a mean too, where both are so near that the window mixes
/// them: the mean beside the line and the line beside the mean, in turn. NaN where this comes to no end.
fn slow_frequency(signal: &[[f64; 2]], first: f64) -> f64 {
    const ROUNDS: usize = 60;
    let close = 1e-12 / signal.len() as f64;
    let (mut frequency, mut last) = (first, f64::INFINITY);
    for _ in 0..ROUNDS {
        let line = |frequency| SpectralLine { frequency, amplitude: [0.0; 2] };
        let mut lines = [line(0.0), line(frequency)];
        fit_amplitudes(signal, &mut lines);
        let [x, y] = lines[0].amplitude;
        let rest: Vec<[f64; 2]> = signal.iter().map(|z| [z[0] - x, z[1] - y]).collect();
        let before = std::mem::replace(&mut frequency, peak(&rest));
        if !frequency.is_finite() || is_stopped() {
            break;
        }
        let change = (frequency - before).abs();
        if change <= close {
            return frequency;
        }
        // Of so slow a line one follows from the other no better than before.
        if !(change < 0.95 * last) {
            break;
        }
        last = change;
    }
    f64::NAN
}

/// The tunes of each trajectory with states q₁ … qₙ, p₁ … pₙ: in each plane the frequency of the strongest line of
/// q_j + i p_j minus its mean.
///
/// Source: as [`spectral_lines`]; Papaphilippou, <https://doi.org/10.1063/1.4884495>, for their use in storage rings.
pub fn tunes(orbits: &Trajectories) -> Vec<Tunes> {
    let dof = orbits.dim() / 2;
    let of = |m: usize| {
        let states: Vec<&[f64]> = orbits.orbit(m).collect();
        let half = states.len() / 2;
        let in_plane = |j: usize, of: &[&[f64]]| -> f64 {
            let mut signal: Vec<[f64; 2]> = of.iter().map(|z| [z[j], z[dof + j]]).collect();
            let count = signal.len();
            if count < LEAST {
                return f64::NAN;
            }
            let (size, given) = (largest(&signal), signal.clone());
            // What the window makes of a mean is a line of frequency 0; its weights add up to this sum.
            let sum = (count - 1) as f64 / count as f64;
            let [x, y] = transform(&signal, &weights(count), 0.0).map(|v| v / sum);
            signal.iter_mut().for_each(|z| *z = [z[0] - x, z[1] - y]);
            let turns = largest(&signal) > ROUNDING * size;
            let line = spectral_lines(&signal, usize::from(turns));
            let Some(SpectralLine { frequency, .. }) = line.first().copied() else {
                return f64::NAN;
            };
            let is_slow = frequency.abs() * (count as f64) < SLOW;
            -if is_slow { slow_frequency(&given, frequency) } else { frequency }
        };
        let turns = (0..dof).map(|j| in_plane(j, &states)).collect();
        let changes = (0..dof).map(|j| {
            let apart = in_plane(j, &states[half..]) - in_plane(j, &states[..half]);
            (apart - apart.round()).abs()
        });
        Tunes { turns, changes: changes.collect() }
    };
    (0..orbits.count()).into_par_iter().map(of).collect()
}
