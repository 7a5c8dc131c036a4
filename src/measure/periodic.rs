//! Periodic orbits of maps, their multipliers, and Lyapunov exponents.

use crate::error::Error;
use crate::scalar::max_or_nan;
use faer::Mat;
use faer::linalg::solvers::Solve;

/// A map with its Jacobian: the image of z, and the Jacobian at z, 2n × 2n numbers row by row.
pub type WithJacobian<'a> = &'a (dyn Fn(&[f64]) -> Result<(Vec<f64>, Vec<f64>), Error> + 'a);

/// A periodic orbit of a map, with the Jacobian of a whole period.
#[derive(Clone, Debug, PartialEq)]
pub struct PeriodicOrbit {
    /// Its points, one after another: as many as its period.
    pub points: Vec<Vec<f64>>,
    /// M, the Jacobian of the map iterated over one period, at the first point: 2n × 2n numbers row by row.
    pub multiplier_matrix: Vec<f64>,
    /// The closing error of the orbit, the largest difference of a coordinate after one period.
    pub missed: f64,
}

impl PeriodicOrbit {
    /// The period, in iterations of the map.
    pub fn period(&self) -> usize {
        self.points.len()
    }

    /// The orbit itself, if it closes after `period` iterations and not sooner.
    ///
    /// # Errors
    /// [`Error::Invalid`] with its first point, if it closes sooner.
    pub fn of_period(self, period: usize) -> Result<Self, Error> {
        if self.period() == period {
            return Ok(self);
        }
        let numbers: Vec<String> = self.points[0].iter().map(|v| format!("{v:.6}")).collect();
        let found =
            format!("one near an orbit of period {}, at ({})", self.period(), numbers.join(", "));
        Err(Error::invalid("guess", found, format!("a point near an orbit of period {period}")))
    }

    /// The trace Tr M of the derivative over a period. For one degree of freedom an orbit with |Tr M| < 2 is elliptic
    /// (nearby points go round it), and one with |Tr M| > 2 hyperbolic (nearby points leave it).
    pub fn trace(&self) -> f64 {
        let dim = self.points[0].len();
        (0..dim).map(|k| self.multiplier_matrix[k * (dim + 1)]).sum()
    }

    /// Greene's residue (2 − Tr M)/4 of an orbit of one degree of freedom: between 0 and 1 for an elliptic orbit,
    /// negative or more than 1 for a hyperbolic one.
    ///
    /// Source: Greene, <https://doi.org/10.1063/1.524170>.
    pub fn residue(&self) -> f64 {
        0.25 * (2.0 - self.trace())
    }
}

/// The largest number of steps of Newton's method in the search for an orbit.
const STEPS: usize = 40;
/// A step is halved so often, at most, where the orbit is not nearer after it.
const HALVINGS: usize = 12;
/// Steps are at rest when they are so small, over 1 + |z|.
const AT_REST: f64 = 1e-13;
/// What does not come to rest at that has found an orbit where it misses by no more, over 1 + |z|: rounding along
/// an orbit that is far from stable.
const FOUND: f64 = 1e-9;
/// Where an orbit is found, several steps one after another that each shrink by less than this are of rounding:
/// Newton's method squares them, or halves them towards an orbit that is about to vanish.
const SHRINKS: f64 = 0.75;
/// So many: on the curve of a thin chain of islands, where all points nearly close, a few are large before it
/// converges.
const IDLE: usize = 6;

/// What rounding makes an orbit miss by, over u(1 + |z|), its period and the largest entry of the Jacobians along it.
const ROUNDING: f64 = 50.0;

/// What leads a point round: its image after `period` maps, the Jacobian there, and the points; and the largest entry
/// of the Jacobians on the way.
fn round(map: WithJacobian<'_>, z: &[f64], period: usize) -> Result<(PeriodicOrbit, f64), Error> {
    let dim = z.len();
    let (mut matrix, mut growth) = (Mat::<f64>::identity(dim, dim), 1.0);
    let (mut points, mut now) = (Vec::with_capacity(period.min(1 << 12)), z.to_vec());
    for _ in 0..period {
        let (image, jacobian) = map(&now)?;
        matrix = Mat::from_fn(dim, dim, |i, k| {
            (0..dim).map(|j| jacobian[i * dim + j] * matrix[(j, k)]).sum()
        });
        let largest = (0..dim * dim).map(|k| matrix[(k / dim, k % dim)].abs());
        growth = largest.fold(growth, max_or_nan);
        points.push(std::mem::replace(&mut now, image));
    }
    let missed = now.iter().zip(z).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
    let multiplier_matrix = (0..dim * dim).map(|k| matrix[(k / dim, k % dim)]).collect();
    // The end is kept behind the points until the caller takes it off.
    points.push(now);
    Ok((PeriodicOrbit { points, multiplier_matrix, missed }, growth))
}

/// Finds the periodic orbit near a guess by Newton's method for Pᵏ(z) − z = 0 with exact Jacobians. Steps that do
/// not reduce the error are halved.
///
/// The period found may be a divisor of the one asked for: an orbit that closes sooner is returned once around.
///
/// Source: Greene, <https://doi.org/10.1063/1.524170>, for orbits and their residues.
///
/// # Errors
/// Those of the map; [`Error::NoConvergence`] where none is found, and [`Error::CountOutOfRange`] of a period of 0.
pub fn periodic_orbit(
    map: WithJacobian<'_>,
    guess: &[f64],
    period: usize,
) -> Result<PeriodicOrbit, Error> {
    Error::check_count_range("period", period, 1, usize::MAX)?;
    let dim = guess.len();
    let mut place = guess.to_vec();
    let (mut here, mut growth) = round(map, &place, period)?;
    let (mut change, mut idle) = (f64::NAN, 0);
    for _ in 0..STEPS {
        let size = 1.0 + place.iter().map(|v| v.abs()).fold(0.0, max_or_nan);
        let end = &here.points[period];
        let right = Mat::from_fn(dim, 1, |i, _| place[i] - end[i]);
        let matrix = Mat::from_fn(dim, dim, |i, k| {
            here.multiplier_matrix[i * dim + k] - if i == k { 1.0 } else { 0.0 }
        });
        let step = matrix.partial_piv_lu().solve(&right);
        let before = change;
        change = (0..dim).map(|k| step[(k, 0)].abs()).fold(0.0, max_or_nan);
        idle = if here.missed <= FOUND * size && change > SHRINKS * before { idle + 1 } else { 0 };
        if !change.is_finite() || idle == IDLE {
            break;
        }
        let mut share = 1.0;
        let mut moved = None;
        for _ in 0..HALVINGS {
            let next: Vec<f64> = (0..dim).map(|k| place[k] + share * step[(k, 0)]).collect();
            // What leaves the domain of the map is no nearer.
            if let Ok(found) = round(map, &next, period)
                && (found.0.missed < here.missed || found.0.missed <= FOUND * size)
            {
                moved = Some((next, found));
                break;
            }
            share *= 0.5;
        }
        let Some((next, found)) = moved else { break };
        (place, (here, growth)) = (next, found);
        if change <= AT_REST * size {
            break;
        }
    }
    let size = 1.0 + place.iter().map(|v| v.abs()).fold(0.0, max_or_nan);
    // What did not come to rest misses by rounding alone, or nearly closes: on a curve of a thin chain all points do.
    let rounding = ROUNDING * f64::EPSILON * growth * period as f64;
    let least = if change <= AT_REST * size { FOUND } else { FOUND.min(rounding) };
    if !(here.missed <= least * size) {
        let what = format!("orbit of period {period} from {guess:?}");
        return Err(Error::NoConvergence { what, iterations: STEPS, change });
    }
    // Back after a part of the period?
    let close = |k: &usize| {
        let distance = here.points[*k].iter().zip(&place).map(|(a, b)| (a - b).abs());
        distance.fold(0.0, max_or_nan) <= 1e3 * FOUND * size
    };
    let least = (1..period).filter(|k| period.is_multiple_of(*k)).find(close).unwrap_or(period);
    let mut found = if least == period { here } else { round(map, &place, least)?.0 };
    found.points.truncate(least);
    Ok(found)
}

/// Finds the distinct orbits of exactly this period by Newton's method from each guess, in the order of the guesses.
/// Guesses that lead to no orbit or to one of a shorter period are skipped. Two orbits with points within `apart` of
/// each other count as the same.
///
/// # Errors
/// [`Error::CountOutOfRange`] of a period of 0, [`Error::OutOfRange`] of an `apart` that is not positive.
pub fn periodic_orbits(
    map: WithJacobian<'_>,
    guesses: &[Vec<f64>],
    period: usize,
    apart: f64,
) -> Result<Vec<PeriodicOrbit>, Error> {
    Error::check_count_range("period", period, 1, usize::MAX)?;
    Error::check_range("apart", apart, Error::LEAST_POSITIVE, f64::MAX)?;
    let mut found: Vec<PeriodicOrbit> = Vec::new();
    for guess in guesses {
        let Ok(orbit) = periodic_orbit(map, guess, period) else { continue };
        let near = |point: &Vec<f64>| {
            let distance = point.iter().zip(&orbit.points[0]).map(|(a, b)| (a - b).abs());
            distance.fold(0.0, max_or_nan) <= apart
        };
        let known = found.iter().any(|other| other.points.iter().any(near));
        if orbit.period() == period && !known {
            found.push(orbit);
        }
    }
    Ok(found)
}

/// The finite-time Lyapunov exponent ln |Mv|/N of an orbit of N = `maps` maps, where M is their Jacobian and v the unit
/// vector with equal components. It tends to the largest Lyapunov exponent as N → ∞.
///
/// Source: Benettin, Galgani, Giorgilli and Strelcyn, <https://doi.org/10.1007/BF02128236>.
///
/// # Errors
/// Those of the map; [`Error::CountOutOfRange`] of no map.
pub fn lyapunov_exponent(map: WithJacobian<'_>, z: &[f64], maps: usize) -> Result<f64, Error> {
    Error::check_count_range("maps", maps, 1, usize::MAX)?;
    let dim = z.len();
    let (mut now, mut sum) = (z.to_vec(), 0.0);
    let mut vector = vec![1.0 / libm::sqrt(dim as f64); dim];
    for _ in 0..maps {
        let (image, jacobian) = map(&now)?;
        let next: Vec<f64> = jacobian
            .chunks_exact(dim)
            .map(|row| row.iter().zip(&vector).map(|(a, b)| a * b).sum())
            .collect();
        let length = libm::sqrt(next.iter().map(|v| v * v).sum::<f64>());
        sum += libm::log(length);
        vector = next.into_iter().map(|v| v / length).collect();
        now = image;
    }
    Ok(sum / maps as f64)
}
