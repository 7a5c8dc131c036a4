//! Coils by their Fourier modes, as text, or by points, as arrays.

use super::arrays::Archive;
use super::npy::Array;
use super::read_bytes;
use crate::error::Error;
use crate::system::{Coil, CoilSet};
use std::path::Path;

/// Columns of a coil: sine and cosine of x, of y and of z.
const COLUMNS: usize = 6;

/// Reads coils from a text file in the format of simsopt, or from an array of points. The text has a line for each
/// Fourier mode, from 0 on. The line holds, for one coil after another, the coefficients of sine and cosine of x, of y
/// and of z, in metres, separated by commas or spaces. Empty lines and lines that begin with # are skipped. A file
/// whose name ends in `.npz` has an array `points`, (C, N, 3): for each of C closed coils N points (x, y, z) at equal
/// distances of a parameter, which a trigonometric polynomial interpolates ([`Coil::of_points`]). `currents` are the
/// currents of these coils, in amperes; the symmetry of the machine adds the other coils: the file holds those of one
/// field period, or of half of one with stellarator symmetry ([`CoilSet::all`]).
///
/// # Errors
/// When the file cannot be read, has no such array, a line has another number of numbers than the first, one that is no
/// finite number, or no whole coils; when there are other than one current for each coil.
pub fn read_coils(
    path: &Path,
    currents: &[f64],
    periods: u32,
    stellarator_symmetric: bool,
) -> Result<CoilSet, Error> {
    let place = path.display().to_string();
    let bytes = read_bytes(path)?;
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("npz")) {
        let coils = coils_of_points(&place, bytes, currents)?;
        return Ok(CoilSet { coils, periods, stellarator_symmetric });
    }
    parse_coils(&place, &bytes, currents, periods, stellarator_symmetric)
}

fn coils_of_points(place: &str, bytes: Vec<u8>, currents: &[f64]) -> Result<Vec<Coil>, Error> {
    let Array { shape, values, .. } = Archive::open(place, bytes)?.array("points")?;
    let [count, points, 3] = shape[..] else {
        let expected = "an array (C, N, 3), N points of each of C coils";
        return Err(Error::content(format!("{place}: points"), expected, format!("{shape:?}")));
    };
    Error::check_count(&format!("{place}: currents"), count, currents.len())?;
    let place = |number: usize| format!("{place}: coil {}", number + 1);
    let of = |(number, current): (usize, &f64)| {
        let row = 3 * points;
        let rows = values[number * row..(number + 1) * row].chunks_exact(3);
        let rows: Vec<[f64; 3]> = rows.map(|z| [z[0], z[1], z[2]]).collect();
        Coil::of_points(&rows, *current).map_err(|e| e.with_place(place(number)))
    };
    currents.iter().enumerate().map(of).collect()
}

/// [`read_coils`] of bytes; `place` names them in errors.
///
/// # Errors
/// Those of [`read_coils`].
pub fn parse_coils(
    place: &str,
    bytes: &[u8],
    currents: &[f64],
    periods: u32,
    stellarator_symmetric: bool,
) -> Result<CoilSet, Error> {
    let text = std::str::from_utf8(bytes).map_err(|_| {
        Error::content(place, "lines of numbers, or a name that ends in .npz", "no text")
    })?;
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let place = || format!("{place}:{}", number + 1);
        let separators = |c: char| c == ',' || c.is_whitespace();
        let words = line.split(separators).filter(|word| !word.is_empty());
        let parse = |word: &str| match word.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => {
                let start: String = word.chars().take(40).collect();
                let more = if start.len() < word.len() { "…" } else { "" };
                Err(Error::content(place(), "finite numbers", format!("`{start}{more}`")))
            }
        };
        let row: Vec<f64> = words.map(parse).collect::<Result<_, _>>()?;
        let expected = rows.first().map_or(row.len().next_multiple_of(COLUMNS), Vec::len);
        if row.len() != expected {
            let expected = match rows.is_empty() {
                true => format!("a multiple of {COLUMNS} numbers, {COLUMNS} for each coil"),
                false => format!("{expected} numbers, as in the first line"),
            };
            return Err(Error::content(place(), expected, row.len()));
        }
        rows.push(row);
    }
    let Some(first) = rows.first() else {
        return Err(Error::content(place, "a line for each mode", "none"));
    };
    let count = first.len() / COLUMNS;
    Error::check_count(&format!("{place}: currents"), count, currents.len())?;
    let coils = currents.iter().enumerate().map(|(k, &current)| {
        let modes = |part: usize| -> Vec<[f64; 3]> {
            let of =
                |row: &Vec<f64>| std::array::from_fn(|axis| row[COLUMNS * k + 2 * axis + part]);
            rows.iter().map(of).collect()
        };
        let (mut sines, cosines) = (modes(0), modes(1));
        // That of mode 0 is none.
        sines[0] = [0.0; 3];
        Coil { cosines, sines, current, width: 0.0 }
    });
    Ok(CoilSet { coils: coils.collect(), periods, stellarator_symmetric })
}
