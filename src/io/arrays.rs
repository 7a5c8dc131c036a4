//! Data sets as `.npz` and points as `.npy`.

use super::{read_bytes, write_atomically};
use crate::error::Error;
use crate::flow::{Pairs, check_finite};
use npyz::{NpyFile, WriterBuilder};
use std::io::{Cursor, Read};
use std::path::Path;

/// An array read from a file, row by row whatever its memory order.
pub(super) struct Array {
    pub(super) shape: Vec<usize>,
    pub(super) values: Vec<f64>,
    /// The file held single precision.
    pub(super) single: bool,
}

impl Array {
    /// Fails unless the array has two dimensions; returns (rows, columns).
    fn matrix_shape(&self, place: &str) -> Result<(usize, usize), Error> {
        match self.shape[..] {
            [rows, columns] => Ok((rows, columns)),
            _ => Err(Error::content(
                place,
                "a two-dimensional array",
                format!("one of {} dimensions", self.shape.len()),
            )),
        }
    }
}

/// Fails on a header that is not that of a plain array which the bytes can hold:
/// the parser behind takes a time exponential in the depth of nested brackets.
fn check_header(place: &str, bytes: &[u8]) -> Result<(), Error> {
    const LONGEST: usize = 4096;
    let fail = |found: &dyn std::fmt::Display| {
        Err(Error::content(place, "an array in the NPY format", found))
    };
    let (length, start) = match bytes {
        [0x93, b'N', b'U', b'M', b'P', b'Y', 1, _, a, b, ..] => {
            (usize::from(u16::from_le_bytes([*a, *b])), 10)
        }
        [0x93, b'N', b'U', b'M', b'P', b'Y', 2 | 3, _, a, b, c, d, ..] => {
            (u32::from_le_bytes([*a, *b, *c, *d]) as usize, 12)
        }
        _ => return fail(&"no header of one"),
    };
    if length > LONGEST {
        return fail(&format!("a header of {length} bytes"));
    }
    let Some(header) = bytes.get(start..start + length) else {
        return fail(&"half a header");
    };
    // The sizes, as the parser behind multiplies them: it checks for neither
    // overflow nor memory.
    let sizes = header
        .split(|b| *b == b'(')
        .nth(1)
        .and_then(|rest| rest.split(|b| *b == b')').next())
        .unwrap_or_default()
        .split(|b| !b.is_ascii_digit())
        .filter(|digits| !digits.is_empty());
    let (mut numbers, mut empty) = (1_usize, false);
    for digits in sizes {
        let size = std::str::from_utf8(digits).ok().and_then(|text| text.parse().ok());
        let product = match size {
            Some(0) => {
                empty = true;
                Some(numbers)
            }
            Some(size) => numbers.checked_mul(size),
            None => None,
        };
        match product {
            Some(product) if empty || product <= bytes.len() => numbers = product,
            _ => return fail(&"more numbers than the file holds"),
        }
    }
    let count = |bracket: u8| header.iter().filter(|b| **b == bracket).count();
    if count(b'{') > 1 || count(b'(') > 1 || count(b'[') > 0 {
        return Err(Error::content(
            place,
            "float64 (or float32) numbers",
            "records: a header with nested brackets",
        ));
    }
    Ok(())
}

/// Reads an array of float64 or float32 of at most two dimensions.
fn read_array(place: &str, bytes: &[u8]) -> Result<Array, Error> {
    let corrupt = |reason: &dyn std::fmt::Display| {
        Error::content(place, "an array in the NPY format", reason)
    };
    check_header(place, bytes)?;
    let file = NpyFile::new(Cursor::new(bytes)).map_err(|e| corrupt(&e))?;
    let shape: Vec<usize> = file.shape().iter().map(|&d| d as usize).collect();
    let Some(count) = shape.iter().try_fold(1_usize, |n, d| n.checked_mul(*d)) else {
        return Err(corrupt(&format!("shape {shape:?}")));
    };
    if shape.len() > 2 {
        return Err(Error::content(
            place,
            "an array of at most two dimensions",
            format!("one of {}", shape.len()),
        ));
    }
    let fortran = file.order() == npyz::Order::Fortran && shape.len() == 2;
    let descr = file.dtype().descr();
    let (values, single): (Vec<f64>, bool) = match descr.trim_matches('\'') {
        "<f8" | ">f8" => (file.into_vec::<f64>().map_err(|e| corrupt(&e))?, false),
        "<f4" | ">f4" => {
            let values = file.into_vec::<f32>().map_err(|e| corrupt(&e))?;
            (values.into_iter().map(f64::from).collect(), true)
        }
        other => return Err(Error::content(place, "float64 (or float32) numbers", other)),
    };
    if values.len() != count {
        return Err(Error::content(place, format!("{count} numbers"), values.len()));
    }
    let values = if fortran {
        let (rows, columns) = (shape[0], shape[1]);
        (0..count).map(|i| values[(i % columns) * rows + i / columns]).collect()
    } else {
        values
    };
    Ok(Array { shape, values, single })
}

/// An `.npz` archive in memory.
pub(super) struct Archive {
    place: String,
    archive: npyz::npz::NpzArchive<Cursor<Vec<u8>>>,
}

impl Archive {
    pub(super) fn open(place: &str, bytes: Vec<u8>) -> Result<Self, Error> {
        let archive = npyz::npz::NpzArchive::new(Cursor::new(bytes))
            .map_err(|reason| Error::content(place, "an .npz archive", reason))?;
        Ok(Self { place: place.to_owned(), archive })
    }

    pub(super) fn names(&self) -> Vec<String> {
        self.archive.array_names().map(str::to_owned).collect()
    }

    pub(super) fn array(&mut self, name: &str) -> Result<Array, Error> {
        let place = format!("{}: {name}", self.place);
        let names = self.names();
        if !names.iter().any(|known| known == name) {
            let found = if names.is_empty() { "none".into() } else { names.join(", ") };
            return Err(Error::content(&place, "an array of that name", found));
        }
        let corrupt = |reason: &dyn std::fmt::Display| {
            Error::content(&place, "an array in the NPY format", reason)
        };
        // The checksum of an entry is compared when it has been read to its end.
        let mut bytes = Vec::new();
        self.archive
            .zip_archive()
            .by_name(&npyz::npz::file_name_from_array_name(name))
            .map_err(|e| corrupt(&e))?
            .read_to_end(&mut bytes)
            .map_err(|e| corrupt(&e))?;
        read_array(&place, &bytes)
    }
}

/// The same numbers give the same file: no time of writing in it.
fn undated() -> npyz::zip::write::FileOptions {
    npyz::zip::write::FileOptions::default().last_modified_time(npyz::zip::DateTime::default())
}

/// Writes named arrays as an `.npz` archive.
pub(super) fn write_archive(path: &Path, arrays: &[(&str, &[u64], &[f64])]) -> Result<(), Error> {
    write_atomically(path, |out| {
        let mut buffer = Cursor::new(Vec::new());
        let mut archive = npyz::npz::NpzWriter::new(&mut buffer);
        for (name, shape, values) in arrays {
            let mut writer =
                archive.array(name, undated())?.default_dtype().shape(shape).begin_nd()?;
            writer.extend(values.iter().copied())?;
            writer.finish()?;
        }
        drop(archive);
        out.write_all(buffer.get_ref())
    })
}

/// Pairs read from a file, and what was noticed.
#[derive(Debug)]
pub struct PairsFile {
    /// The pairs.
    pub pairs: Pairs,
    /// An array held single precision.
    pub single_precision: bool,
}

/// Reads `input` and `output`, both (N, 2n), from an `.npz` file.
///
/// # Errors
/// When the file is missing or corrupt, an array is missing, of another shape
/// or type, or holds NaN or infinity.
pub fn read_pairs(path: &Path) -> Result<PairsFile, Error> {
    parse_pairs(&path.display().to_string(), read_bytes(path)?)
}

/// Reads `input` and `output` from the bytes of an `.npz` file; `place` names it
/// in errors.
///
/// # Errors
/// As [`read_pairs`].
pub fn parse_pairs(place: &str, bytes: Vec<u8>) -> Result<PairsFile, Error> {
    let mut archive = Archive::open(place, bytes)?;
    let input = archive.array("input")?;
    let output = archive.array("output")?;
    let (_, columns) = input.matrix_shape(&format!("{place}: input"))?;
    let (_, found) = output.matrix_shape(&format!("{place}: output"))?;
    if columns == 0 || !columns.is_multiple_of(2) {
        return Err(Error::content(
            format!("{place}: input"),
            "an even number of columns, q₁ … qₙ, p₁ … pₙ",
            format!("{columns} columns"),
        ));
    }
    if found != columns {
        return Err(Error::content(
            format!("{place}: output"),
            format!("{columns} columns"),
            format!("{found} columns"),
        ));
    }
    let single_precision = input.single || output.single;
    let pairs = Pairs::new(place, columns / 2, input.values, output.values)?;
    Ok(PairsFile { pairs, single_precision })
}

/// Points read from a file, and what was noticed.
#[derive(Debug)]
pub struct PointsFile {
    /// The points, row by row.
    pub points: Vec<f64>,
    /// The array held single precision.
    pub single_precision: bool,
}

/// Reads points (M, 2n) from an `.npy` file.
///
/// # Errors
/// When the file is missing or corrupt, or the array is not of M ≥ 1 rows of
/// 2n finite numbers.
pub fn read_points(path: &Path, dof: usize) -> Result<PointsFile, Error> {
    parse_points(&path.display().to_string(), &read_bytes(path)?, dof)
}

/// Reads points (M, 2n) from the bytes of an `.npy` file; `place` names it in
/// errors.
///
/// # Errors
/// As [`read_points`].
pub fn parse_points(place: &str, bytes: &[u8], dof: usize) -> Result<PointsFile, Error> {
    let array = read_array(place, bytes)?;
    let (rows, columns) = array.matrix_shape(place)?;
    if columns != 2 * dof {
        return Err(Error::content(
            place,
            format!("{} columns", 2 * dof),
            format!("{columns} columns"),
        ));
    }
    if rows == 0 {
        return Err(Error::content(place, "at least one row", "zero rows"));
    }
    check_finite(place, &array.values, columns)?;
    Ok(PointsFile { points: array.values, single_precision: array.single })
}

/// Writes points or trajectories as `.npy`; `shape` is the array's.
///
/// # Errors
/// [`Error::Write`].
pub fn write_points(path: &Path, shape: &[u64], values: &[f64]) -> Result<(), Error> {
    write_atomically(path, |out| {
        let mut writer =
            npyz::WriteOptions::new().default_dtype().shape(shape).writer(out).begin_nd()?;
        writer.extend(values.iter().copied())?;
        writer.finish()
    })
}

/// Writes pairs as an `.npz` of `input` and `output`.
///
/// # Errors
/// [`Error::Write`].
pub fn write_pairs(path: &Path, pairs: &Pairs) -> Result<(), Error> {
    let shape = [pairs.len() as u64, 2 * pairs.dof() as u64];
    write_archive(path, &[("input", &shape, pairs.input()), ("output", &shape, pairs.output())])
}
