//! The one error type: each variant carries the values that explain it.

use std::fmt::Display;
use std::path::{Path, PathBuf};

/// What can go wrong. Bad input never panics and never loses a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read.
    #[error("{}: cannot be read: {reason}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// A file or folder could not be written.
    #[error("{}: cannot be written: {reason}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// The content of a file is not what it should be.
    #[error("{place}: expected {expected}, found {found}")]
    Content {
        /// The file and the place in it.
        place: String,
        /// What was expected.
        expected: String,
        /// What was found.
        found: String,
    },
    /// A number that is NaN or infinite.
    #[error(
        "{place}: row {row}, column {column} (counted from 0): expected a finite number, found {value}"
    )]
    NotFinite {
        /// The file or array.
        place: String,
        /// The row, from 0.
        row: usize,
        /// The column, from 0.
        column: usize,
        /// The number.
        value: f64,
    },
    /// A file of a format newer than this version reads.
    #[error(
        "{}: format version {found}; this version reads up to {supported}: a newer gyroceptron wrote it", path.display()
    )]
    NewerFormat {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u64,
        /// The newest version that can be read.
        supported: u64,
    },
    /// A key that no scene has.
    #[error("{place}: unknown key `{key}`{}", nearest.as_ref().map(|n| format!(", did you mean `{n}`?")).unwrap_or_default())]
    UnknownKey {
        /// The file.
        place: String,
        /// The key.
        key: String,
        /// The nearest known one.
        nearest: Option<String>,
    },
    /// What a computation needs and was not given.
    #[error("{place}: `{key}` is missing; {needed_by} needs it")]
    Missing {
        /// Where it was looked for.
        place: String,
        /// What is missing.
        key: &'static str,
        /// What it is for.
        needed_by: String,
    },
    /// Another error, with the place where it is.
    #[error("{place}: {reason}")]
    At {
        /// The place.
        place: String,
        /// The error.
        reason: Box<Error>,
    },
    /// An argument out of range.
    #[error("{name}: expected {expected}, found {value}")]
    Invalid {
        /// Which argument.
        name: String,
        /// Its value.
        value: String,
        /// What it should be.
        expected: String,
    },
    /// An output folder that holds a run already.
    #[error(
        "{}: holds an earlier run; give --resume to go on with it, --overwrite to replace it, or another --out", path.display()
    )]
    OutputExists {
        /// The folder.
        path: PathBuf,
    },
    /// A file that is there already.
    #[error("{}: exists already; give --overwrite to replace it, or another name", path.display())]
    FileExists {
        /// The file.
        path: PathBuf,
    },
    /// A computation that left the finite numbers.
    #[error("{what}: the numbers ran out of range at {place}")]
    Diverged {
        /// Which computation.
        what: String,
        /// Where.
        place: String,
    },
    /// An iteration that did not converge.
    #[error("{what}: no convergence after {iterations} iterations, last change {change:e}")]
    NoConvergence {
        /// Which iteration.
        what: String,
        /// How many steps were taken.
        iterations: usize,
        /// The size of the last change.
        change: f64,
    },
}

impl Error {
    /// [`Error::Invalid`].
    pub fn invalid(name: &str, value: impl Display, expected: impl Display) -> Self {
        Self::Invalid {
            name: name.to_owned(),
            value: value.to_string(),
            expected: expected.to_string(),
        }
    }

    /// [`Error::Content`].
    pub fn content(place: impl Display, expected: impl Display, found: impl Display) -> Self {
        Self::Content {
            place: place.to_string(),
            expected: expected.to_string(),
            found: found.to_string(),
        }
    }

    /// [`Error::At`]: the same error, with the place where it is.
    pub fn at(self, place: impl Display) -> Self {
        Self::At { place: place.to_string(), reason: Box::new(self) }
    }

    /// [`Error::Read`].
    pub fn read(path: &Path, reason: impl Display) -> Self {
        Self::Read { path: path.to_owned(), reason: reason.to_string() }
    }

    /// [`Error::Write`].
    pub fn write(path: &Path, reason: impl Display) -> Self {
        Self::Write { path: path.to_owned(), reason: reason.to_string() }
    }

    pub(crate) fn check_count(what: &str, expected: usize, found: usize) -> Result<(), Self> {
        if expected == found { Ok(()) } else { Err(Self::invalid(what, found, expected)) }
    }
}
