//! Files of symplectic polynomials.

use super::json::{parse_content, parse_header};
use super::{read_bytes, write_atomically};
use crate::digest;
use crate::error::Error;
use crate::flow::PolynomialOnSection;
use serde::{Deserialize, Serialize};
use std::path::Path;

const FORMAT: &str = "gyroceptron-polynomial";
const VERSION: u64 = 1;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PolynomialFile {
    format: String,
    version: u64,
    /// SHA-256 of the text of `polynomial` without spaces.
    digest: String,
    polynomial: PolynomialOnSection,
}

fn digest_of(polynomial: &PolynomialOnSection) -> Result<String, Error> {
    let text = serde_json::to_string(polynomial)
        .map_err(|reason| Error::invalid("polynomial", reason, "numbers that JSON can hold"))?;
    Ok(digest::of_bytes(text.as_bytes()))
}

/// The text of the file of a symplectic polynomial. Numbers are the shortest decimals that read back as the same bits.
///
/// # Errors
/// Those of [`PolynomialOnSection::check`], as of a number that is not finite, which JSON cannot hold.
pub fn polynomial_text(polynomial: &PolynomialOnSection) -> Result<String, Error> {
    polynomial.check()?;
    let file = PolynomialFile {
        format: FORMAT.into(),
        version: VERSION,
        digest: digest_of(polynomial)?,
        polynomial: polynomial.clone(),
    };
    let text = serde_json::to_string_pretty(&file)
        .map_err(|reason| Error::invalid("polynomial", reason, "numbers that JSON can hold"))?;
    Ok(text + "\n")
}

/// Writes a file of a symplectic polynomial, [`polynomial_text`].
///
/// # Errors
/// [`Error::Write`], or as [`polynomial_text`].
pub fn save_polynomial(path: &Path, polynomial: &PolynomialOnSection) -> Result<(), Error> {
    let text = polynomial_text(polynomial)?;
    write_atomically(path, |out| out.write_all(text.as_bytes()))
}

/// Reads a file of a symplectic polynomial.
///
/// # Errors
/// When it is missing, corrupt, of a newer format, or does not hold a symplectic polynomial.
pub fn load_polynomial(path: &Path) -> Result<PolynomialOnSection, Error> {
    parse_polynomial(&path.display().to_string(), &read_bytes(path)?)
}

/// Reads the text of a file of a symplectic polynomial; `place` names it in errors.
///
/// # Errors
/// Those of [`load_polynomial`].
pub fn parse_polynomial(place: &str, bytes: &[u8]) -> Result<PolynomialOnSection, Error> {
    let (_, value) = parse_header(place, bytes, FORMAT, VERSION)?;
    let file: PolynomialFile = parse_content(place, value, FORMAT)?;
    file.polynomial.check().map_err(|e| e.with_place(place))?;
    if digest_of(&file.polynomial)? != file.digest {
        let expected = "that of the polynomial";
        let found = "another: the file is corrupt or was edited";
        return Err(Error::content(format!("{place}: digest"), expected, found));
    }
    Ok(file.polynomial)
}
