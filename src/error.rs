//! The one error type: each variant carries the values that explain it.

use std::fmt::Display;
use std::path::{Path, PathBuf};

/// An error of the library. Bad input never panics and never loses a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read.
    #[error("{}: cannot be read: {reason}", path.display())]
    Read {
        /// The path of the file that could not be read.
        path: PathBuf,
        /// The reason that the system gave for the failure to read.
        reason: String,
    },
    /// A file or folder could not be written.
    #[error("{}: cannot be written: {reason}", path.display())]
    Write {
        /// The path of the file or folder that could not be written.
        path: PathBuf,
        /// The reason that the system gave for the failure to write.
        reason: String,
    },
    /// The content of a file is not what it should be.
    #[error("{place}: expected {expected}, found {found}")]
    Content {
        /// The file and the place in it.
        place: String,
        /// What was expected at this place of the file, in words.
        expected: String,
        /// What was found at this place of the file, in words.
        found: String,
    },
    /// A number that is NaN or infinite.
    #[error(
        "{place}: row {row}, column {column} (counted from 0): expected a finite number, found {value}"
    )]
    NotFinite {
        /// The file or array that holds the number.
        place: String,
        /// The row of the number in the array, counted from 0.
        row: usize,
        /// The column of the number in the array, counted from 0.
        column: usize,
        /// The number itself, which is NaN or infinite.
        value: f64,
    },
    /// A file whose content is not the one that its digest is of.
    #[error(
        "{place}: digest: expected that of {covers}, found another: the file is corrupt or was edited"
    )]
    Edited {
        /// The file that is corrupt or was edited.
        place: String,
        /// What its digest is of, in words.
        covers: &'static str,
    },
    /// Pairs that no circle action fits for sure.
    #[error("circle action: expected {}, found {found}", wanted(columns.as_deref()))]
    NoCircleAction {
        /// What was found of circle actions, in words.
        found: String,
        /// The order in which the columns of inputs and outputs would have one, counted from 0; None where no order is
        /// known.
        columns: Option<Vec<usize>>,
    },
    /// A file of a format newer than this version reads.
    #[error(
        "{}: format version {found}; this version reads up to {supported}: a newer gyroceptron wrote it", path.display()
    )]
    NewerFormat {
        /// The path of the file that has a newer format.
        path: PathBuf,
        /// The format version of the file.
        found: u64,
        /// The newest version that can be read.
        supported: u64,
    },
    /// A key that no scene has.
    #[error("{place}: unknown key `{key}`{}", instead(nearest.as_deref(), known))]
    UnknownKey {
        /// The file with the unknown key, and the line where the key stands if it is found.
        place: String,
        /// The key that no scene has.
        key: String,
        /// The known key with the nearest spelling, if there is one that is near.
        nearest: Option<String>,
        /// The keys that are known in its place.
        known: Vec<String>,
    },
    /// A number outside its range, which includes its bounds; NaN is outside any range.
    #[error("{name}: expected {}, found {value:?}", range(*low, *high))]
    OutOfRange {
        /// The name of the number that is out of range.
        name: String,
        /// The value of the number that is out of range.
        value: f64,
        /// The least that it may be.
        low: f64,
        /// The most that it may be.
        high: f64,
    },
    /// A count outside its range, which includes its bounds.
    #[error("{name}: expected {}, found {found}", count_range(*least, *most))]
    CountOutOfRange {
        /// The name of what is counted, for a count that is out of range.
        name: String,
        /// The count that is out of range.
        found: usize,
        /// The least that it may be.
        least: usize,
        /// The most that it may be.
        most: usize,
    },
    /// A count that differs from the one that is required.
    #[error("{name}: expected {expected}, found {found}")]
    WrongCount {
        /// The name of what is counted, for a count that is not the required one.
        name: String,
        /// The count that it should be.
        expected: usize,
        /// The count that was found in place of the required one.
        found: usize,
    },
    /// An array that does not consist of whole rows.
    #[error("{name}: expected rows of {columns} numbers, found {found} numbers")]
    Ragged {
        /// The name of the array that does not consist of whole rows.
        name: String,
        /// The number of columns that each row has to have.
        columns: usize,
        /// How many numbers the array has, which make no whole rows.
        found: usize,
    },
    /// An input that a computation needs and that is missing.
    #[error("{place}: `{key}` is missing; {needed_by} needs it")]
    Missing {
        /// The file, scene or block in which the input was looked for.
        place: String,
        /// The key of the input that is missing.
        key: &'static str,
        /// What needs the missing input, such as a study or a network.
        needed_by: String,
    },
    /// Another error, with the place where it occurred.
    #[error("{place}: {reason}")]
    At {
        /// The place where the error occurred.
        place: String,
        /// The error that occurred at this place.
        reason: Box<Error>,
    },
    /// An error in a block of a network.
    #[error("{}: {reason}", block_called(*number, name))]
    Block {
        /// The number of the block in its list, counted from 0.
        number: usize,
        /// The name of the block, which may be empty where it is the only one.
        name: String,
        /// The error that is in this block.
        reason: Box<Error>,
    },
    /// An invalid argument that no other variant describes.
    #[error("{name}: expected {expected}, found {value}")]
    Invalid {
        /// The name of the argument that is invalid.
        name: String,
        /// The invalid value of the argument, as text.
        value: String,
        /// What the argument should be, in words.
        expected: String,
    },
    /// An output folder that holds a run already.
    #[error(
        "{}: holds an earlier run, which is not replaced: give another folder", path.display()
    )]
    OutputExists {
        /// The path of the folder that holds an earlier run.
        path: PathBuf,
    },
    /// A file that is there already.
    #[error("{}: exists already, and is not replaced: give another name", path.display())]
    FileExists {
        /// The path of the file that exists already.
        path: PathBuf,
    },
    /// A computation that its caller stopped.
    #[error("{what}: stopped before its end")]
    Stopped {
        /// The name of the computation that was stopped.
        what: String,
    },
    /// A computation whose numbers are no longer finite.
    #[error("{what}: the numbers ran out of range at {place}")]
    Diverged {
        /// The name of the computation whose numbers are no longer finite.
        what: String,
        /// The place where the numbers ran out of range, such as a step.
        place: String,
    },
    /// An iteration that did not converge.
    #[error("{what}: no convergence after {iterations} iterations, last change {change:e}")]
    NoConvergence {
        /// The name of the iteration that did not converge.
        what: String,
        /// The number of iterations after which it was given up.
        iterations: usize,
        /// The size of the last change.
        change: f64,
    },
}

/// A block as errors name it.
pub(crate) fn block_called(number: usize, name: &str) -> String {
    match name {
        "" => format!("block {number}"),
        name => format!("block {number} (`{name}`)"),
    }
}

/// What is asked for where pairs have no circle action for sure.
fn wanted(columns: Option<&[usize]>) -> &'static str {
    match columns {
        Some(_) => "columns q1 q2 … p1 p2 …",
        None => "weights, or pairs of another flow time",
    }
}

/// What to write instead of an unknown key.
fn instead(nearest: Option<&str>, known: &[String]) -> String {
    match (nearest, known) {
        (Some(nearest), _) => format!(", did you mean `{nearest}`?"),
        (None, []) => String::new(),
        (None, known) => format!("; known here: {}", known.join(", ")),
    }
}

/// The bounds of [`Error::OutOfRange`] in words.
fn range(low: f64, high: f64) -> String {
    match (low, high) {
        (f64::MIN, f64::MAX) => "a finite number".into(),
        (0.0, f64::MAX) => "a finite number ≥ 0".into(),
        (Error::LEAST_POSITIVE, f64::MAX) => "a positive finite number".into(),
        (f64::MIN, _) => format!("at most {high:?}"),
        (_, f64::MAX) => format!("at least {low:?}"),
        (Error::LEAST_POSITIVE, _) => format!("a positive number of at most {high:?}"),
        _ => format!("{low:?} to {high:?}"),
    }
}

/// The bounds of [`Error::CountOutOfRange`] in words.
fn count_range(least: usize, most: usize) -> String {
    match (least, most) {
        (_, usize::MAX) => format!("at least {least}"),
        (0, _) => format!("at most {most}"),
        _ => format!("{least} to {most}"),
    }
}

impl Error {
    /// The lower end of a range that starts above 0.
    pub(crate) const LEAST_POSITIVE: f64 = 5e-324;

    /// Fails with [`Error::OutOfRange`] unless low ≤ value ≤ high.
    pub(crate) fn check_range(name: &str, value: f64, low: f64, high: f64) -> Result<(), Self> {
        if value >= low && value <= high {
            return Ok(());
        }
        Err(Self::OutOfRange { name: name.to_owned(), value, low, high })
    }

    /// Fails with [`Error::OutOfRange`] unless the value is finite.
    pub(crate) fn check_finite(name: &str, value: f64) -> Result<(), Self> {
        Self::check_range(name, value, f64::MIN, f64::MAX)
    }

    /// Fails with [`Error::CountOutOfRange`] unless least ≤ found ≤ most.
    pub(crate) fn check_count_range(
        name: &str,
        found: usize,
        least: usize,
        most: usize,
    ) -> Result<(), Self> {
        if (least..=most).contains(&found) {
            return Ok(());
        }
        Err(Self::CountOutOfRange { name: name.to_owned(), found, least, most })
    }

    /// Fails with [`Error::Ragged`] unless `found` numbers are rows of `columns`.
    pub(crate) fn check_rows(name: &str, found: usize, columns: usize) -> Result<(), Self> {
        if columns > 0 && found.is_multiple_of(columns) {
            return Ok(());
        }
        Err(Self::Ragged { name: name.to_owned(), columns, found })
    }

    /// Fails with [`Error::WrongCount`] unless the counts are the same.
    pub(crate) fn check_count(name: &str, expected: usize, found: usize) -> Result<(), Self> {
        if expected == found {
            return Ok(());
        }
        Err(Self::WrongCount { name: name.to_owned(), expected, found })
    }

    /// Makes an [`Error::Invalid`]: the value of the argument `name` is not what is expected.
    pub fn invalid(name: &str, value: impl Display, expected: impl Display) -> Self {
        Self::Invalid {
            name: name.to_owned(),
            value: value.to_string(),
            expected: expected.to_string(),
        }
    }

    /// Makes an [`Error::Content`]: what was found at a place in a file or text is not what is expected there.
    pub fn content(place: impl Display, expected: impl Display, found: impl Display) -> Self {
        Self::Content {
            place: place.to_string(),
            expected: expected.to_string(),
            found: found.to_string(),
        }
    }

    /// Wraps the error in an [`Error::At`], with the place where it occurred.
    pub fn with_place(self, place: impl Display) -> Self {
        Self::At { place: place.to_string(), reason: Box::new(self) }
    }

    /// Wraps the error in an [`Error::Block`], with the number and the name of the block that it is in.
    pub(crate) fn in_block(self, number: usize, name: &str) -> Self {
        Self::Block { number, name: name.to_owned(), reason: Box::new(self) }
    }

    /// Makes an [`Error::Read`] of a file, with the reason why it cannot be read.
    pub fn read(path: &Path, reason: impl Display) -> Self {
        Self::Read { path: path.to_owned(), reason: reason.to_string() }
    }

    /// Makes an [`Error::Write`] of a file, with the reason why it cannot be written.
    pub fn write(path: &Path, reason: impl Display) -> Self {
        Self::Write { path: path.to_owned(), reason: reason.to_string() }
    }
}
