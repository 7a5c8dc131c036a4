//! Data sets as `.npz` and points as `.npy`.

use super::npy::{Array, read_array, read_text, write_array, write_text};
use super::{read_bytes, write_atomically};
use crate::error::Error;
use crate::flow::{Condition, Pairs, Trajectories, check_finite};
use crate::network::Controls;
use crate::phase::{AreaDensity, Section};
use crate::train::FamilyPairs;
use std::io::Cursor;
use std::path::Path;
use zip::read::ZipFile;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

/// An array is kept in an archive under its name and this ending.
const ENDING: &str = ".npy";

/// An `.npz` archive in memory.
pub(super) struct Archive {
    place: String,
    archive: ZipArchive<Cursor<Vec<u8>>>,
}

impl Archive {
    pub(super) fn open(place: &str, bytes: Vec<u8>) -> Result<Self, Error> {
        let archive = ZipArchive::new(Cursor::new(bytes))
            .map_err(|reason| Error::content(place, "an .npz archive", reason))?;
        Ok(Self { place: place.to_owned(), archive })
    }

    /// The names of the arrays.
    pub(super) fn names(&self) -> Vec<String> {
        let members = self.archive.file_names().filter_map(Result::ok);
        members.filter_map(|name| name.strip_suffix(ENDING).map(str::to_owned)).collect()
    }

    pub(super) fn array(&mut self, name: &str) -> Result<Array, Error> {
        self.member(name, |place, member, size| read_array(place, member, size))
    }

    /// A text that is kept under this name.
    pub(super) fn text(&mut self, name: &str) -> Result<String, Error> {
        self.member(name, |place, member, size| read_text(place, member, size))
    }

    fn member<T>(
        &mut self,
        name: &str,
        read: impl Fn(&str, &mut ZipFile<'_, Cursor<Vec<u8>>>, u64) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let place = format!("{}: {name}", self.place);
        let names = self.names();
        if !names.iter().any(|known| known == name) {
            let found = if names.is_empty() { "none".into() } else { names.join(", ") };
            return Err(Error::content(&place, "an array of that name", found));
        }
        let corrupt = |reason: &dyn std::fmt::Display| {
            Error::content(&place, "an array in the NPY format", reason)
        };
        let mut member =
            self.archive.by_name(&format!("{name}{ENDING}")).map_err(|reason| corrupt(&reason))?;
        let size = member.size();
        let out = read(&place, &mut member, size)?;
        // The checksum of a member is compared when it has been read to its end.
        std::io::copy(&mut member, &mut std::io::sink()).map_err(|reason| corrupt(&reason))?;
        Ok(out)
    }
}

/// Writes named arrays as an `.npz` archive.
pub(super) fn write_archive(path: &Path, arrays: &[(&str, &[u64], &[f64])]) -> Result<(), Error> {
    write_archive_of(path, arrays, &[])
}

/// Writes named arrays and texts as an `.npz` archive.
pub(super) fn write_archive_of(
    path: &Path,
    arrays: &[(&str, &[u64], &[f64])],
    texts: &[(&str, &str)],
) -> Result<(), Error> {
    let options = |bytes: usize| {
        SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            // The same numbers give the same file: no time of writing in it.
            .last_modified_time(DateTime::default())
            .large_file(bytes >= MOST_WITHOUT_ZIP64)
    };
    write_atomically(path, |out| {
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, shape, values) in arrays {
            archive.start_file(format!("{name}{ENDING}"), options(size_of_val(*values)))?;
            write_array(&mut archive, shape, values)?;
        }
        for (name, text) in texts {
            archive.start_file(format!("{name}{ENDING}"), options(4 * text.len()))?;
            write_text(&mut archive, text)?;
        }
        out.write_all(archive.finish()?.get_ref())
    })
}

/// Numbers of so many bytes may not fit, with their header, into a member whose size
/// is kept in 32 bits.
const MOST_WITHOUT_ZIP64: usize = u32::MAX as usize - (1 << 20);

/// The arrays of a file of pairs.
const ARRAYS: [&str; 5] = ["input", "output", "epsilon", "flow_time", "lambda"];

/// Pairs read from a file, and what was noticed.
#[derive(Debug)]
pub struct PairsFile {
    /// The pairs, with the ε and flow times that the file gives, unchanged. If the file has only one of the two, the
    /// other is 1.
    pub pairs: Pairs,
    /// Whether the file has an ε for each pair.
    pub has_epsilons: bool,
    /// Whether the file has a flow time for each pair.
    pub has_times: bool,
    /// The number of values of controls (`lambda`) for each pair.
    pub controls: usize,
    /// The names of its other arrays, which are not used.
    pub unused: Vec<String>,
    /// Whether an array was in single precision.
    pub single_precision: bool,
}

impl From<PairsFile> for FamilyPairs {
    fn from(file: PairsFile) -> Self {
        let PairsFile { pairs, has_epsilons, has_times, .. } = file;
        Self { pairs, has_epsilons, has_times }
    }
}

/// Reads pairs from an `.npz` file: `input` and `output`, both (N, 2n). For a family of maps the file also has
/// `epsilon` and `flow_time`, N numbers each, and `lambda`, the values of the controls, (N,) or (N, controls).
///
/// # Errors
/// When the file is missing or corrupt, an array is missing, of another shape
/// or type, or holds NaN or infinity.
pub fn read_pairs(path: &Path) -> Result<PairsFile, Error> {
    parse_pairs(&path.display().to_string(), read_bytes(path)?)
}

/// Reads pairs, as [`read_pairs`] does, from the bytes of an `.npz` file; `place` names it
/// in errors.
///
/// # Errors
/// Those of [`read_pairs`].
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
    let mut single_precision = input.single || output.single;
    let mut pairs = Pairs::new(place, columns / 2, input.values, output.values)?;
    let names = archive.names();
    let known = |name: &&String| ARRAYS.contains(&name.as_str());
    let unused = names.iter().filter(|name| !known(name)).cloned().collect();
    let mut of_rows = |name: &str| -> Result<Option<Vec<f64>>, Error> {
        if !names.iter().any(|known| known == name) {
            return Ok(None);
        }
        let array = archive.array(name)?;
        single_precision |= array.single;
        let values = array.values;
        Error::check_count(&format!("{place}: {name}: numbers"), pairs.len(), values.len())?;
        check_finite(&format!("{place}: {name}"), &values, 1)?;
        Ok(Some(values))
    };
    let (epsilons, times) = (of_rows("epsilon")?, of_rows("flow_time")?);
    let (has_epsilons, has_times) = (epsilons.is_some(), times.is_some());
    let mut controls = Vec::new();
    if names.iter().any(|name| name == "lambda") {
        let place = format!("{place}: lambda");
        let array = archive.array("lambda")?;
        single_precision |= array.single;
        let (rows, columns) = match array.shape[..] {
            [rows] => (rows, 1),
            _ => array.matrix_shape(&place)?,
        };
        Error::check_count(&format!("{place}: rows"), pairs.len(), rows)?;
        Error::check_count_range(&format!("{place}: columns"), columns, 1, Controls::MOST)?;
        check_finite(&place, &array.values, columns)?;
        controls = array.values;
    }
    let count = controls.len() / pairs.len();
    if has_epsilons || has_times || count > 0 {
        let or_one = |values: Option<Vec<f64>>| values.unwrap_or_else(|| vec![1.0; pairs.len()]);
        let (epsilons, times) = (or_one(epsilons), or_one(times));
        let family = pairs.under_controls(&epsilons, &times, &controls);
        pairs = family.map_err(|e| e.with_place(place))?;
    }
    Ok(PairsFile { pairs, has_epsilons, has_times, controls: count, unused, single_precision })
}

/// Reads the charts of a section from an `.npz` file: `x` (A) and `y` (B), in increasing order, and `density` (B, A),
/// the values of ρ on this grid. The optional `scale`, one number, is what ∫ρ dx is divided by; it is 1 by default.
///
/// For several degrees of freedom the arrays of plane j, counted from 1, are `xj`, `yj` and `densityj`. A plane without
/// them has canonical columns, and the scale is then 1. `planes` is the number of planes, needed where the last one has
/// no density.
///
/// A density that depends on controls, linearly, is given at several of their values: `lambda` (L) or (L, controls),
/// and `density` (L, B, A).
///
/// # Errors
/// When the file is missing or corrupt, an array is missing or of another shape; those of [`AreaDensity::of_grid`] and
/// [`AreaDensity::of_grids`].
pub fn read_section(path: &Path) -> Result<Section, Error> {
    let place = path.display().to_string();
    let mut archive = Archive::open(&place, read_bytes(path)?)?;
    let names = archive.names();
    let has = |name: &str| names.iter().any(|found| found == name);
    let scale = if has("scale") { one_number(&mut archive, &place, "scale")? } else { 1.0 };
    let controls = match has("lambda") {
        true => Some(SectionControls::read(&mut archive, &place)?),
        false => None,
    };
    let numbered = |j: &usize| has(&format!("density{j}"));
    // What is misspelt, or meant otherwise, makes no plane canonical.
    for name in &names {
        let kinds = ["density", "x", "y"].map(|kind| Some((kind, name.strip_prefix(kind)?)));
        let Some((_, suffix)) = kinds.into_iter().flatten().next() else { continue };
        let plane = suffix.parse().ok().filter(|j| (1..=MOST_PLANES).contains(j));
        if suffix.is_empty() || plane.is_some_and(|j| numbered(&j)) && !has("density") {
            continue;
        }
        let expected = format!("x, y and density, or x1, y1, density1 … up to {MOST_PLANES}");
        return Err(Error::content(format!("{place}: arrays"), expected, name));
    }
    if has("density") && has("planes") {
        let expected = "none beside density, which is of one plane";
        return Err(Error::content(&place, expected, "planes"));
    }
    let planes = match (1..=MOST_PLANES).rev().find(numbered).filter(|_| !has("density")) {
        None => vec![Some(read_plane(&mut archive, &place, "", scale, controls.as_ref())?)],
        Some(last) => {
            let mut count = last;
            if has("planes") {
                let given = one_number(&mut archive, &place, "planes")?;
                count = given as usize;
                if !(given == count as f64 && (last..=MOST_PLANES).contains(&count)) {
                    let expected = format!("a whole number from {last} to {MOST_PLANES}");
                    return Err(Error::content(format!("{place}: planes"), expected, given));
                }
            }
            let mut plane = |j: usize| {
                if !numbered(&j) {
                    return Ok(None);
                }
                let suffix = j.to_string();
                read_plane(&mut archive, &place, &suffix, scale, controls.as_ref()).map(Some)
            };
            (1..=count).map(&mut plane).collect::<Result<_, _>>()?
        }
    };
    let origin = controls.map_or_else(Vec::new, |controls| controls.origin);
    Section::of_controls(planes, &origin).map_err(|e| e.with_place(&place))
}

/// The largest number of planes that [`read_section`] looks for.
const MOST_PLANES: usize = 16;

/// The only number of an array.
fn one_number(archive: &mut Archive, place: &str, name: &str) -> Result<f64, Error> {
    let values = archive.array(name)?.values;
    Error::check_count(&format!("{place}: {name}: numbers"), 1, values.len())?;
    Ok(values[0])
}

/// The values of controls at which a file gives a density.
struct SectionControls {
    /// Row by row: (rows, controls).
    values: Vec<f64>,
    rows: usize,
    /// The mean over the rows of the value of each control.
    origin: Vec<f64>,
}

impl SectionControls {
    fn read(archive: &mut Archive, place: &str) -> Result<Self, Error> {
        let lambda = archive.array("lambda")?;
        let (rows, controls) = match lambda.shape[..] {
            [rows] => (rows, 1),
            [rows, controls] => (rows, controls),
            _ => {
                let expected = "shape (L) or (L, controls)";
                let found = format!("{:?}", lambda.shape);
                return Err(Error::content(format!("{place}: lambda"), expected, found));
            }
        };
        let most = Controls::MOST;
        Error::check_count_range(&format!("{place}: lambda: controls"), controls, 1, most)?;
        Error::check_count_range(&format!("{place}: lambda: rows"), rows, 1, usize::MAX)?;
        let values = lambda.values;
        // Where a density that is linear is positive if it is so at all rows.
        let mean = |of: usize| values.iter().skip(of).step_by(controls).sum::<f64>() / rows as f64;
        let origin = (0..controls).map(mean).collect();
        Ok(Self { values, rows, origin })
    }
}

/// The density of a plane, whose arrays have this suffix.
fn read_plane(
    archive: &mut Archive,
    place: &str,
    suffix: &str,
    scale: f64,
    controls: Option<&SectionControls>,
) -> Result<AreaDensity, Error> {
    let [x, y, density] = ["x", "y", "density"].map(|name| format!("{name}{suffix}"));
    let (x, y, grids) =
        (archive.array(&x)?.values, archive.array(&y)?.values, archive.array(&density)?);
    let (rows, columns) = (y.len(), x.len());
    let (wanted, text) = match controls {
        None => (
            vec![rows, columns],
            format!(
                "shape ({rows}, {columns}), a row for each y, or an array `lambda` of controls"
            ),
        ),
        Some(SectionControls { rows: machines, .. }) => (
            vec![*machines, rows, columns],
            format!(
                "shape ({machines}, {rows}, {columns}), a grid for each value of `lambda`, with a row for each y"
            ),
        ),
    };
    if grids.shape != wanted {
        return Err(Error::content(
            format!("{place}: {density}"),
            text,
            format!("{:?}", grids.shape),
        ));
    }
    let place = if suffix.is_empty() { place.into() } else { format!("{place}: plane {suffix}") };
    let chart = match controls {
        None => AreaDensity::of_grid(&x, &y, &grids.values, scale),
        Some(SectionControls { values, origin, .. }) => {
            AreaDensity::of_grids(&x, &y, &grids.values, scale, values, origin)
        }
    };
    chart.map_err(|e| e.with_place(place))
}

/// Writes a section of one plane, as [`read_section`] reads it: a grid for each row of values of `controls`, one
/// after another, or one grid where there are no controls.
///
/// # Errors
/// [`Error::Write`]; [`Error::WrongCount`] unless there is one density for each pair of coordinates and each row, or
/// when rows are of different lengths.
pub fn write_section(
    path: &Path,
    x: &[f64],
    y: &[f64],
    density: &[f64],
    scale: f64,
    controls: &[&[f64]],
) -> Result<(), Error> {
    let grids = controls.len().max(1);
    Error::check_count("density: numbers", grids * x.len() * y.len(), density.len())?;
    let count = controls.first().map_or(0, |row| row.len());
    let least = usize::from(!controls.is_empty());
    Error::check_count_range("controls", count, least, Controls::MOST)?;
    controls.iter().try_for_each(|row| Error::check_count("controls", count, row.len()))?;
    let of_controls = [controls.len() as u64, count as u64];
    let sizes = [of_controls[0], y.len() as u64, x.len() as u64];
    let lambda = controls.concat();
    let mut arrays = vec![
        ("x", &sizes[2..], x),
        ("y", &sizes[1..2], y),
        ("density", if controls.is_empty() { &sizes[1..] } else { &sizes[..] }, density),
        ("scale", &[1][..], std::slice::from_ref(&scale)),
    ];
    if !controls.is_empty() {
        arrays.push(("lambda", &of_controls[..], &lambda));
    }
    write_archive(path, &arrays)
}

/// Points read from a file, and whether they were in single precision.
#[derive(Debug)]
pub struct PointsFile {
    /// The points, row by row.
    pub points: Vec<f64>,
    /// Whether the array was in single precision.
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
/// Those of [`read_points`].
pub fn parse_points(place: &str, bytes: &[u8], dof: usize) -> Result<PointsFile, Error> {
    let array = read_array(place, &mut &bytes[..], bytes.len() as u64)?;
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

/// Reads M trajectories of T states each, an array (T, M, 2n), from an `.npy` file.
///
/// # Errors
/// When the file is missing or corrupt, or the array is not of T ≥ 1 states of M ≥ 1 points of
/// 2n finite numbers.
pub fn read_trajectories(path: &Path, dof: usize) -> Result<Trajectories, Error> {
    read_states(path, dof, false)
}

/// [`read_trajectories`] of trajectories that may be lost: of NaN from some state after the first on.
///
/// # Errors
/// Those of [`read_trajectories`], but for the states of lost trajectories.
pub fn read_trajectories_until_lost(path: &Path, dof: usize) -> Result<Trajectories, Error> {
    read_states(path, dof, true)
}

fn read_states(path: &Path, dof: usize, may_be_lost: bool) -> Result<Trajectories, Error> {
    let (place, bytes) = (path.display().to_string(), read_bytes(path)?);
    let array = read_array(&place, &mut &bytes[..], bytes.len() as u64)?;
    let [states, count, columns] = array.shape[..] else {
        let found = format!("shape {:?}", array.shape);
        return Err(Error::content(place, "an array (states, trajectories, 2n)", found));
    };
    if columns != 2 * dof || states == 0 || count == 0 {
        let expected = format!("states of trajectories of {} numbers", 2 * dof);
        return Err(Error::content(place, expected, format!("shape {:?}", array.shape)));
    }
    let row = count * columns;
    for (index, value) in array.values.iter().enumerate().filter(|(_, value)| !value.is_finite()) {
        let (state, trajectory) = (index / row, index % row / columns);
        if may_be_lost && state > 0 && value.is_nan() {
            continue;
        }
        let found = format!("{value} in state {state} of trajectory {trajectory} (counted from 0)");
        return Err(Error::content(place, "finite numbers", found));
    }
    for (index, pair) in array.values.windows(row + 1).enumerate() {
        if pair[0].is_nan() && !pair[row].is_nan() {
            let (state, trajectory) = (index / row + 1, index % row / columns);
            let found = format!("a number in state {state} of trajectory {trajectory} after NaN");
            return Err(Error::content(place, "NaN to the end of a trajectory", found));
        }
    }
    Trajectories::new(array.values, columns, count)
}

/// Writes points or trajectories as `.npy`; `shape` is the array's.
///
/// # Errors
/// [`Error::Write`].
pub fn write_points(path: &Path, shape: &[u64], values: &[f64]) -> Result<(), Error> {
    write_atomically(path, |out| write_array(out, shape, values))
}

/// Writes trajectories as `.npy`, (T, M, 2n), in the form that [`read_trajectories`] reads.
///
/// # Errors
/// [`Error::Write`] with the path.
pub fn write_trajectories(path: &Path, trajectories: &Trajectories) -> Result<(), Error> {
    let shape = [trajectories.states(), trajectories.count(), trajectories.dim()];
    write_points(path, &shape.map(|n| n as u64), trajectories.values())
}

/// Writes pairs as an `.npz` that [`read_pairs`] reads.
///
/// # Errors
/// [`Error::Write`].
pub fn write_pairs(path: &Path, pairs: &Pairs) -> Result<(), Error> {
    let shape = [pairs.len() as u64, 2 * pairs.dof() as u64];
    let of_rows = |of: fn(&Condition) -> f64| -> Vec<f64> {
        let runs = pairs.conditions().iter();
        runs.flat_map(|run| std::iter::repeat_n(of(run), run.pairs)).collect()
    };
    let (epsilons, times) = (of_rows(|run| run.epsilon), of_rows(|run| run.time));
    let rows = &shape[..1];
    let mut arrays = vec![("input", &shape[..], pairs.input()), ("output", &shape, pairs.output())];
    // Where controls alone distinguish maps, an ε and a flow time of 1 say nothing.
    let says = |run: &Condition| run.controls.is_empty() || run.epsilon != 1.0 || run.time != 1.0;
    if pairs.conditions().iter().any(says) {
        arrays.extend([("epsilon", rows, &epsilons[..]), ("flow_time", rows, &times)]);
    }
    let columns = pairs.conditions().first().map_or(0, |run| run.controls.len());
    let of_run = |run: &Condition| std::iter::repeat_n(run.controls.clone(), run.pairs);
    let controls: Vec<f64> = pairs.conditions().iter().flat_map(of_run).flatten().collect();
    let of_controls = [shape[0], columns as u64];
    if columns > 0 {
        arrays.push(("lambda", &of_controls, &controls));
    }
    write_archive(path, &arrays)
}
