//! The survival of orbits: the number of maps after which they are lost, and the dynamic aperture.

use crate::error::Error;

/// A function that follows orbits: from points in rows and a number of maps N it returns the states after 1, …, N maps,
/// those of all points after one map first. States of a lost orbit are NaN or anything else outside.
pub type Follow<'a> = &'a (dyn Fn(&[f64], usize) -> Result<Vec<f64>, Error> + 'a);

/// The number of maps after which each orbit is outside for the first time, 0 where it begins outside; None for orbits
/// that stay inside for all `maps` maps. A point has `dim` numbers, and `stays` returns whether it is inside; it has to
/// be false for NaN.
///
/// # Errors
/// Those of `follow`; when there are no whole points.
pub fn maps_survived(
    follow: Follow<'_>,
    starts: &[f64],
    dim: usize,
    maps: usize,
    stays: &dyn Fn(&[f64]) -> bool,
) -> Result<Vec<Option<usize>>, Error> {
    /// States that are held at once.
    const PART: usize = 64;
    Error::check_rows("points", starts.len(), dim)?;
    let begins = |z: &[f64]| if stays(z) { None } else { Some(0) };
    let mut out: Vec<Option<usize>> = starts.chunks_exact(dim).map(begins).collect();
    let mut kept: Vec<usize> = (0..out.len()).filter(|orbit| out[*orbit].is_none()).collect();
    let mut here: Vec<f64> =
        kept.iter().flat_map(|orbit| &starts[orbit * dim..][..dim]).copied().collect();
    let mut done = 0;
    while done < maps && !kept.is_empty() {
        let part = PART.min(maps - done);
        let states = follow(&here, part)?;
        Error::check_count("numbers of states", part * here.len(), states.len())?;
        for (k, orbit) in kept.iter().enumerate() {
            let leaves = |t: &usize| !stays(&states[t * here.len() + k * dim..][..dim]);
            out[*orbit] = (0..part).find(leaves).map(|t| done + t + 1);
        }
        let last = &states[(part - 1) * here.len()..];
        let stay = kept.iter().enumerate().filter(|(_, orbit)| out[**orbit].is_none());
        let (rows, still): (Vec<&[f64]>, Vec<usize>) =
            stay.map(|(k, orbit)| (&last[k * dim..][..dim], *orbit)).unzip();
        (here, kept, done) = (rows.concat(), still, done + part);
    }
    Ok(out)
}

/// The dynamic aperture along rays from the closed orbit: for each direction, the largest of the radii up to which all
/// points centre + radius·direction stay for `maps` maps; 0 where the first one is lost.
///
/// Source: Todesco and Giovannozzi, <https://doi.org/10.1103/PhysRevE.53.4067>.
///
/// # Errors
/// Those of [`maps_survived`]; when radii do not grow from above 0, or a direction is 0 or of other than `dim` numbers.
pub fn dynamic_aperture(
    follow: Follow<'_>,
    centre: &[f64],
    directions: &[Vec<f64>],
    radii: &[f64],
    maps: usize,
    stays: &dyn Fn(&[f64]) -> bool,
) -> Result<Vec<f64>, Error> {
    let dim = centre.len();
    let mut before = 0.0;
    for radius in radii {
        if !(*radius > before && radius.is_finite()) {
            let found = format!("{radius} after {before}");
            return Err(Error::invalid("radii", found, "numbers that grow from above 0"));
        }
        before = *radius;
    }
    let mut starts = Vec::with_capacity(directions.len() * radii.len() * dim);
    for direction in directions {
        Error::check_count("numbers of a direction", dim, direction.len())?;
        if direction.iter().all(|d| *d == 0.0) {
            return Err(Error::invalid("directions", format!("{direction:?}"), "a direction"));
        }
        for radius in radii {
            starts.extend(centre.iter().zip(direction).map(|(c, d)| radius.mul_add(*d, *c)));
        }
    }
    if radii.is_empty() {
        return Ok(vec![0.0; directions.len()]);
    }
    let survived = maps_survived(follow, &starts, dim, maps, stays)?;
    Ok(survived.chunks(radii.len()).map(|of_ray| aperture_of_ray(of_ray, radii, maps)).collect())
}

/// The dynamic aperture along one ray by the survival of its points at these radii, as [`maps_survived`] returns it for
/// as many maps or more: the largest radius up to which all stay for `maps` maps; 0 where the first one is lost.
pub fn aperture_of_ray(survived: &[Option<usize>], radii: &[f64], maps: usize) -> f64 {
    let stays = |lost: &&Option<usize>| lost.is_none_or(|after| after > maps);
    let stay = survived.iter().take_while(stays).count();
    stay.checked_sub(1).and_then(|last| radii.get(last)).copied().unwrap_or(0.0)
}
