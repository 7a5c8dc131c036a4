//! Files of symplectic polynomials.

use super::json::{Provenance, format_of, parse_content, parse_header, refuse_divergence};
use super::{StoredModel, parse_model, read_bytes, write_atomically};
use crate::digest;
use crate::error::Error;
use crate::flow::{PolynomialOnSection, Region};
use crate::network::{Pace, Rollout};
use crate::phase::Direction;
use crate::train::FittedPolynomial;
use serde::{Deserialize, Serialize};
use std::path::Path;

const FORMAT: &str = "gyroceptron-polynomial";
const VERSION: u64 = 1;

/// A symplectic polynomial with its provenance, as a file holds it.
#[derive(Clone, Debug)]
pub struct StoredPolynomial {
    /// The polynomial, with the section and the box of its pairs.
    pub map: PolynomialOnSection,
    /// Where it comes from; the held-out error is in units of the data. The box of the pairs is kept by the map.
    pub provenance: Provenance,
}

impl StoredPolynomial {
    /// The polynomial that a fit has made; `seed` is that of the held-out choice.
    pub fn of_fit(fitted: &FittedPolynomial, seed: u64) -> Self {
        let held_out = fitted.chosen().held_out;
        let each = 2 * fitted.map.map().dof();
        let provenance = Provenance {
            seed: Some(seed),
            data: Some(fitted.digest.clone()),
            validation: held_out.map(|error| error * error / each as f64),
            ..Provenance::of_scene("fit")
        };
        Self { map: fitted.map.clone(), provenance }
    }

    /// The box of its pairs.
    pub fn region(&self) -> &Region {
        self.map.region()
    }

    /// The states of the orbits of the map, or of its inverse.
    ///
    /// # Errors
    /// Those of [`PolynomialOnSection::rollout_at_pace`]; when a point is not on the section; [`Error::Diverged`] when
    /// a state is not of finite numbers.
    pub fn rollout_along(
        &self,
        direction: Direction,
        initial: &[f64],
        request: Rollout,
        pace: &mut Pace<'_>,
    ) -> Result<Vec<f64>, Error> {
        let states = self.rolled_out(direction, initial, request, pace)?;
        let (dim, has_section) = (2 * self.map.map().dof(), self.map.has_section());
        refuse_divergence(&states, initial.len(), dim, request.every, has_section)?;
        Ok(states)
    }

    /// [`StoredPolynomial::rollout_along`] of orbits that may leave the box of a section, or come to where the
    /// polynomial has no image: the first state that is kept after that and all later ones are NaN.
    ///
    /// # Errors
    /// Those of [`StoredPolynomial::rollout_along`], but for orbits that are lost.
    pub fn rollout_until_lost(
        &self,
        direction: Direction,
        initial: &[f64],
        request: Rollout,
        pace: &mut Pace<'_>,
    ) -> Result<Vec<f64>, Error> {
        self.rolled_out(direction, initial, request, pace)
    }

    fn rolled_out(
        &self,
        direction: Direction,
        initial: &[f64],
        request: Rollout,
        pace: &mut Pace<'_>,
    ) -> Result<Vec<f64>, Error> {
        self.map.check_points("initial points", initial)?;
        match direction {
            Direction::Forward => self.map.rollout_at_pace(initial, request, pace),
            Direction::Inverse => self.map.inverted().rollout_at_pace(initial, request, pace),
        }
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PolynomialFile {
    format: String,
    version: u64,
    /// SHA-256 of the text of `polynomial` and `provenance` without spaces.
    digest: String,
    polynomial: PolynomialOnSection,
    provenance: Provenance,
}

fn digest_of(polynomial: &PolynomialOnSection, provenance: &Provenance) -> Result<String, Error> {
    let text = serde_json::to_string(&(polynomial, provenance))
        .map_err(|reason| Error::invalid("polynomial", reason, "numbers that JSON can hold"))?;
    Ok(digest::of_bytes(text.as_bytes()))
}

/// The text of the file of a symplectic polynomial. Numbers are the shortest decimals that read back as the same bits.
///
/// # Errors
/// Those of [`PolynomialOnSection::check`], as of a number that is not finite, which JSON cannot hold.
pub fn polynomial_text(stored: &StoredPolynomial) -> Result<String, Error> {
    let StoredPolynomial { map: polynomial, provenance } = stored;
    polynomial.check()?;
    let file = PolynomialFile {
        format: FORMAT.into(),
        version: VERSION,
        digest: digest_of(polynomial, provenance)?,
        polynomial: polynomial.clone(),
        provenance: provenance.clone(),
    };
    let text = serde_json::to_string_pretty(&file)
        .map_err(|reason| Error::invalid("polynomial", reason, "numbers that JSON can hold"))?;
    Ok(text + "\n")
}

/// Writes a file of a symplectic polynomial, [`polynomial_text`].
///
/// # Errors
/// [`Error::Write`], or as [`polynomial_text`].
pub fn save_polynomial(path: &Path, stored: &StoredPolynomial) -> Result<(), Error> {
    let text = polynomial_text(stored)?;
    write_atomically(path, |out| out.write_all(text.as_bytes()))
}

/// Reads a file of a symplectic polynomial.
///
/// # Errors
/// When it is missing, corrupt, of a newer format, or does not hold a symplectic polynomial.
pub fn load_polynomial(path: &Path) -> Result<StoredPolynomial, Error> {
    parse_polynomial(&path.display().to_string(), &read_bytes(path)?)
}

/// Reads the text of a file of a symplectic polynomial; `place` names it in errors.
///
/// # Errors
/// Those of [`load_polynomial`].
pub fn parse_polynomial(place: &str, bytes: &[u8]) -> Result<StoredPolynomial, Error> {
    let (_, value) = parse_header(place, bytes, FORMAT, VERSION)?;
    let file: PolynomialFile = parse_content(place, value, FORMAT)?;
    file.polynomial.check().map_err(|e| e.with_place(place))?;
    if digest_of(&file.polynomial, &file.provenance)? != file.digest {
        let covers = "the polynomial and its provenance";
        return Err(Error::Edited { place: place.into(), covers });
    }
    Ok(StoredPolynomial { map: file.polynomial, provenance: file.provenance })
}

/// A map that was read from a file: a network or a polynomial.
#[derive(Clone, Debug)]
pub enum StoredMap {
    /// A network, with its units, section and provenance.
    Network(Box<StoredModel>),
    /// A symplectic polynomial, with its section and provenance.
    Polynomial(Box<StoredPolynomial>),
}

impl StoredMap {
    /// n, its degrees of freedom.
    pub fn dof(&self) -> usize {
        match self {
            Self::Network(stored) => stored.model.composition().dof(),
            Self::Polynomial(stored) => stored.map.map().dof(),
        }
    }

    /// Whether its points are those of a section.
    pub fn has_section(&self) -> bool {
        match self {
            Self::Network(stored) => stored.section.is_some(),
            Self::Polynomial(stored) => stored.map.has_section(),
        }
    }

    /// The box around its pairs, where it is known.
    pub fn region(&self) -> Option<&Region> {
        match self {
            Self::Network(stored) => stored.provenance.region.as_ref(),
            Self::Polynomial(stored) => Some(stored.region()),
        }
    }
}

/// Reads a file of a model or of a symplectic polynomial.
///
/// # Errors
/// Those of [`load_model`](super::load_model), or of [`load_polynomial`] where the file says that it holds one.
pub fn load_map(path: &Path) -> Result<StoredMap, Error> {
    let (place, bytes) = (path.display().to_string(), read_bytes(path)?);
    match format_of(&bytes).as_deref() {
        Some(FORMAT) => Ok(StoredMap::Polynomial(Box::new(parse_polynomial(&place, &bytes)?))),
        _ => Ok(StoredMap::Network(Box::new(parse_model(&place, &bytes)?))),
    }
}
