//! Stable and unstable manifolds of periodic orbits of maps of a plane.

use super::periodic::PeriodicOrbit;
use crate::error::Error;

/// A map of points of a plane: `z` ← its image.
pub type PlaneMap<'a> = &'a (dyn Fn(&mut [f64]) -> Result<(), Error> + 'a);

/// How a branch of a manifold is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Branch {
    /// Whether the branch begins along the eigenvector or against it.
    pub forward: bool,
    /// The distance from the orbit at which the branch begins; it is taken as straight there, with an error of
    /// second order in this distance.
    pub start: f64,
    /// The largest distance of neighbouring points.
    pub spacing: f64,
    /// The length of the branch, at most.
    pub length: f64,
}

/// Points at most: more are a mistake.
const MOST: usize = 1_000_000;
/// Parts of the segment along the eigenvector, before points are inserted.
const PARTS: usize = 8;
/// Applications of the map to one point, at most.
const MOST_MAPS: usize = 10_000;

/// The points, two numbers each, of one branch of the unstable manifold of a periodic orbit, from near the orbit
/// outwards. For the stable manifold, pass the inverse map and the orbit of the inverse map.
///
/// A segment along the eigenvector of M whose eigenvalue λ is larger in modulus, from `start` to |λ| times that, is
/// mapped forward repeatedly, with points inserted where neighbours are further apart than the spacing. For λ < 0,
/// where one period changes sides, two periods are taken as one and λ² replaces |λ|.
///
/// Source: Krauskopf, Osinga et al., <https://doi.org/10.1142/S0218127405012533>, for the ways of computing manifolds.
///
/// # Errors
/// Those of the map; when the orbit is not hyperbolic, |Tr M| ≤ 2, when a number of the branch is out of range, or
/// when there would be more than 10⁶ points.
pub fn manifold(
    map: PlaneMap<'_>,
    orbit: &PeriodicOrbit,
    branch: Branch,
) -> Result<Vec<f64>, Error> {
    let Branch { forward, start, spacing, length } = branch;
    for (name, value) in [("start", start), ("spacing", spacing), ("length", length)] {
        Error::check_range(name, value, Error::LEAST_POSITIVE, f64::MAX)?;
    }
    Error::check_count("coordinates of the orbit", 2, orbit.points[0].len())?;
    let (trace, residue) = (orbit.trace(), orbit.residue());
    if !(trace.abs() > 2.0) {
        let expected = "an orbit that points leave: |Tr M| > 2";
        return Err(Error::invalid("residue", residue, expected));
    }
    // det M = 1.
    let own = 0.5 * (trace + trace.signum() * libm::sqrt(trace * trace - 4.0));
    let [a, b, c, d] = [0, 1, 2, 3].map(|k| orbit.multiplier_matrix[k]);
    // Of the two rows of M − λ the larger gives the direction.
    let (one, other) = ([b, own - a], [own - d, c]);
    let size = |v: [f64; 2]| libm::hypot(v[0], v[1]);
    let vector = if size(one) >= size(other) { one } else { other };
    let sign = if forward { 1.0 } else { -1.0 };
    let unit = vector.map(|v| sign * v / size(vector));
    let (periods, factor) = if own < 0.0 { (2, own * own) } else { (1, own) };
    let maps = periods * orbit.period();
    // A point of the segment by its share of the way from the beginning to the end, in ln of the distance, after the
    // segment was mapped on so many times.
    let carried = |share: f64, rounds: usize| -> Result<[f64; 2], Error> {
        let distance = start * libm::pow(factor, share);
        let mut z = [0, 1].map(|k| distance.mul_add(unit[k], orbit.points[0][k]));
        for _ in 0..rounds * maps {
            map(&mut z)?;
        }
        Ok(z)
    };
    let parts = (0..=PARTS).map(|part| part as f64 / PARTS as f64);
    let segment: Result<Vec<_>, _> = parts.map(|share| Ok((share, carried(share, 0)?))).collect();
    let mut segment: Vec<(f64, [f64; 2])> = segment?;
    let first = segment[0].1;
    let (mut out, mut last, mut gone) = (first.to_vec(), first, 0.0);
    for rounds in 0..MOST_MAPS.div_ceil(maps) {
        let (mut coming, mut passed) = (std::mem::take(&mut segment), Vec::new());
        coming.reverse();
        passed.extend(coming.pop());
        while let (Some(&(from, here)), Some(&(to, next))) = (passed.last(), coming.last()) {
            let apart = distance(here, next);
            if !apart.is_finite() {
                return Ok(out);
            }
            if passed.len() + coming.len() > MOST || out.len() > 2 * MOST {
                let found = format!("more than {MOST} points");
                return Err(Error::invalid("branch", found, "a wider spacing or a shorter one"));
            }
            if apart > spacing && to - from > 8.0 * f64::EPSILON {
                let middle = 0.5 * (from + to);
                coming.push((middle, carried(middle, rounds)?));
                continue;
            }
            // Of points nearer to one another than they have to be some are left out.
            if distance(last, next) > spacing {
                gone += distance(last, here);
                last = here;
                out.extend(here);
            }
            if gone + distance(last, next) >= length {
                out.extend(next);
                return Ok(out);
            }
            passed.extend(coming.pop());
        }
        segment = passed;
        for (_, z) in &mut segment {
            for _ in 0..maps {
                map(z)?;
            }
        }
    }
    Ok(out)
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(b[0] - a[0], b[1] - a[1])
}

/// The smaller alignment index (SALI) after `maps` maps: the smaller of |v + w| and |v − w| for two unit vectors v and
/// w that are carried along an orbit by the tangent map.
///
/// On a chaotic orbit it falls exponentially, as e^{−(σ₁ − σ₂)N}. On a regular orbit it falls as 1/N² for maps of a
/// plane, and stays constant in more dimensions. The vectors begin along the first two coordinates.
///
/// Source: Skokos, <https://doi.org/10.1088/0305-4470/34/47/309>.
///
/// # Errors
/// Those of the map; [`Error::CountOutOfRange`] of no map and of fewer than two coordinates.
pub fn smaller_alignment_index(
    map: super::periodic::WithJacobian<'_>,
    z: &[f64],
    maps: usize,
) -> Result<f64, Error> {
    Error::check_count_range("maps", maps, 1, usize::MAX)?;
    let dim = z.len();
    Error::check_count_range("coordinates", dim, 2, usize::MAX)?;
    let unit = |axis: usize| (0..dim).map(|k| f64::from(u8::from(k == axis))).collect::<Vec<f64>>();
    let (mut now, mut vectors) = (z.to_vec(), [unit(0), unit(1)]);
    for _ in 0..maps {
        let (image, jacobian) = map(&now)?;
        for vector in &mut vectors {
            let next: Vec<f64> = jacobian
                .chunks_exact(dim)
                .map(|row| row.iter().zip(&*vector).map(|(a, b)| a * b).sum())
                .collect();
            let length = libm::sqrt(next.iter().map(|v| v * v).sum::<f64>());
            *vector = next.into_iter().map(|v| v / length).collect();
        }
        now = image;
    }
    let [v, w] = &vectors;
    let of = |sign: f64| {
        let squares = v.iter().zip(w).map(|(a, b)| (a + sign * b) * (a + sign * b));
        libm::sqrt(squares.sum::<f64>())
    };
    let (sum, difference) = (of(1.0), of(-1.0));
    // Both are NaN or none is.
    Ok(if sum < difference { sum } else { difference })
}
