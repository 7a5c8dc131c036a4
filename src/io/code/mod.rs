//! Models as source code for other programs.
//!
//! Each step of a network is traced: it is applied to numbers that [record](crate::scalar::Traced) the operations.
//! Steps of the same kind and size share one function, which takes their numbers from a table.

mod about;
mod c;
mod fortran;
mod program;
mod python;

use super::{StoredModel, write_atomically};
use crate::error::Error;
use about::About;
use python::Arrays;
use std::path::{Path, PathBuf};

/// A language in which a model can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SourceLanguage {
    /// C99: `NAME.c` and `NAME.h`, and `NAME.f90` for Fortran.
    C,
    /// Python, of arrays of JAX.
    Jax,
    /// Python, of tensors of PyTorch.
    Torch,
}

impl SourceLanguage {
    /// All languages that a map is exported to.
    pub const ALL: [Self; 3] = [Self::C, Self::Jax, Self::Torch];

    /// The name of the language in options.
    pub fn name(self) -> &'static str {
        match self {
            Self::C => "c",
            Self::Jax => "jax",
            Self::Torch => "torch",
        }
    }

    /// The ending of the file that a user names.
    pub fn ending(self) -> &'static str {
        match self {
            Self::C => "c",
            Self::Jax | Self::Torch => "py",
        }
    }
}

/// A model as source code.
///
/// The functions are the map, its inverse, its iterates, its derivative along a direction, its invariant, and a test
/// whether a point is inside the boxes that the model is made for, all in the coordinates of the data. C code compiled
/// without contraction of products and sums gives the same bits as [`StoredModel::rollout_along`].
#[derive(Clone, Debug)]
pub struct SourceCode {
    /// The ending and the text of each file; the file that a user names comes first.
    pub files: Vec<(&'static str, String)>,
}

/// The longest name: Fortran has 63 letters for the name of a function.
const LONGEST: usize = 40;

impl SourceCode {
    /// The code of a model without controls. In C and Fortran, the names of its functions begin with `name`. If the
    /// model is a member of a family, `member` says what it was taken from.
    ///
    /// # Errors
    /// [`Error::Invalid`] of a name that is no identifier, or of a model that depends on controls.
    pub fn generate(
        stored: &StoredModel,
        language: SourceLanguage,
        name: &str,
        member: Option<&str>,
    ) -> Result<Self, Error> {
        check_name(language, name)?;
        if let Some(controls) = stored.model.composition().controls() {
            let names: Vec<&str> = controls.ranges.iter().map(|range| &*range.name).collect();
            let expected = "a model at values of its controls";
            return Err(Error::invalid("controls", names.join(", "), expected));
        }
        let program = program::Program::from_model(&stored.model)?;
        let about = About::of(stored, name, member)?;
        let files = match language {
            SourceLanguage::C => vec![
                ("c", c::source(stored, &program, &about)),
                ("h", c::header(&program, &about)),
                ("f90", fortran::source(&program, &about)),
            ],
            SourceLanguage::Jax | SourceLanguage::Torch if program.works_on_bits() => {
                let expected =
                    "steps of arithmetic and elementary functions: Python has no bits of numbers";
                return Err(Error::invalid("source code", "a step that works on bits", expected));
            }
            SourceLanguage::Jax => {
                vec![("py", python::source(stored, &program, &about, Arrays::Jax))]
            }
            SourceLanguage::Torch => {
                vec![("py", python::source(stored, &program, &about, Arrays::Torch))]
            }
        };
        Ok(Self { files })
    }

    /// The paths of the files that [`SourceCode::write`] writes: `path`, with its ending replaced by that of each file.
    pub fn paths(&self, path: &Path) -> Vec<PathBuf> {
        self.files.iter().map(|(ending, _)| path.with_extension(ending)).collect()
    }

    /// Writes each file, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        for (path, (_, text)) in self.paths(path).iter().zip(&self.files) {
            write_atomically(path, |file| file.write_all(text.as_bytes()))?;
        }
        Ok(())
    }
}

/// Names that hide a header of C or a module of Python, or are words of Python.
const TAKEN_IN_C: [&str; 25] = [
    "assert", "complex", "ctype", "errno", "fenv", "float", "inttypes", "iso646", "limits",
    "locale", "math", "setjmp", "signal", "stdarg", "stdbool", "stddef", "stdint", "stdio",
    "stdlib", "string", "tgmath", "time", "wchar", "wctype", "threads",
];
const TAKEN_IN_PYTHON: [&str; 42] = [
    "jax",
    "torch",
    "numpy",
    "functools",
    "random",
    "typing",
    "math",
    "False",
    "None",
    "True",
    "and",
    "as",
    "assert",
    "async",
    "await",
    "break",
    "class",
    "continue",
    "def",
    "del",
    "elif",
    "else",
    "except",
    "finally",
    "for",
    "from",
    "global",
    "if",
    "import",
    "in",
    "is",
    "lambda",
    "nonlocal",
    "not",
    "or",
    "pass",
    "raise",
    "return",
    "try",
    "while",
    "with",
    "yield",
];

/// Fails at a name that functions or a module cannot have.
fn check_name(language: SourceLanguage, name: &str) -> Result<(), Error> {
    let within = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let begins = name.starts_with(|c: char| c.is_ascii_alphabetic());
    let (taken, why) = match language {
        SourceLanguage::C => {
            (&TAKEN_IN_C[..], "functions begin with it, and it hides no header of C")
        }
        SourceLanguage::Jax | SourceLanguage::Torch => {
            (&TAKEN_IN_PYTHON[..], "Python imports the file by it, and it hides no other module")
        }
    };
    let is_free = !taken.contains(&name);
    if begins && name.chars().all(within) && name.len() <= LONGEST && is_free {
        return Ok(());
    }
    let expected = format!("a letter and up to {} letters, digits and _: {why}", LONGEST - 1);
    Err(Error::invalid("name of the code", name, expected))
}
