//! Files of proofs: curves, strips and constants, with the digest of the model that they are about.

use super::json::{parse_content, parse_header};
use super::{StoredModel, read_bytes, write_atomically};
use crate::digest;
use crate::error::Error;
use crate::measure::proof::{Candidate, Circle, Constants, PlaneMap, RotationNumber};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::Path;

const FORMAT: &str = "gyroceptron-proof";
const VERSION: u64 = 1;

/// Two nested circles of a [`ProofFile`], by their numbers in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Nested {
    /// The inner one.
    pub inner: usize,
    /// The outer one.
    pub outer: usize,
}

/// What is proved of a model: its circles, and which of them are within which.
#[derive(Clone, Debug, PartialEq)]
pub struct ProofFile {
    /// The digest of the model.
    pub model: String,
    /// The circles, the smaller areas first.
    pub circles: Vec<Circle>,
    /// Circles next to each other that are nested.
    pub nested: Vec<Nested>,
}

/// A circle in a file: numbers of curves by their bits, in hexadecimal.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CircleEntry {
    rotation_number: String,
    value: f64,
    rho: f64,
    rho_hat: f64,
    points: usize,
    constants: Constants,
    modes: Vec<String>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    format: String,
    version: u64,
    about: String,
    crate_version: String,
    model: String,
    nested: Vec<Nested>,
    circles: Vec<CircleEntry>,
    digest: String,
}

const ABOUT: &str = "the map of real numbers with these weights, its turns exact rotations, in the coordinates of its \
    normal form: not the rounded map of doubles, not what the model was trained on";

fn hex(mode: &[[f64; 2]; 4]) -> String {
    mode.iter().flatten().map(|value| format!("{:016x}", value.to_bits())).collect()
}

fn of_hex(text: &str) -> Option<[[f64; 2]; 4]> {
    let mut out = [[0.0; 2]; 4];
    if text.len() != 128 || !text.is_ascii() {
        return None;
    }
    for (k, value) in out.iter_mut().flatten().enumerate() {
        *value = f64::from_bits(u64::from_str_radix(&text[16 * k..16 * (k + 1)], 16).ok()?);
    }
    Some(out)
}

impl ProofFile {
    /// Of circles of a model, in order of their areas, with the nesting of neighbours proved.
    ///
    /// # Errors
    /// Those of [`StoredModel::digest`].
    pub fn new(stored: &StoredModel, mut circles: Vec<Circle>) -> Result<Self, Error> {
        circles.sort_by(|a, b| a.area().total_cmp(&b.area()));
        let nested = (1..circles.len()).filter(|&k| circles[k].encloses(&circles[k - 1]).is_ok());
        let nested = nested.map(|k| Nested { inner: k - 1, outer: k }).collect();
        Ok(Self { model: stored.digest()?, circles, nested })
    }

    /// Whether circles from one number to another are nested, each in the next.
    pub fn is_nested(&self, inner: usize, outer: usize) -> bool {
        (inner + 1..=outer).all(|k| self.nested.contains(&Nested { inner: k - 1, outer: k }))
    }

    fn text(&self) -> Result<Text, Error> {
        let entry = |circle: &Circle| CircleEntry {
            rotation_number: circle.omega().to_string(),
            value: circle.omega().value().centre(),
            rho: circle.candidate.rho,
            rho_hat: circle.candidate.rho_hat,
            points: circle.candidate.points,
            constants: circle.constants,
            modes: circle.candidate.modes.iter().map(hex).collect(),
        };
        let mut text = Text {
            format: FORMAT.into(),
            version: VERSION,
            about: ABOUT.into(),
            crate_version: env!("CARGO_PKG_VERSION").into(),
            model: self.model.clone(),
            nested: self.nested.clone(),
            circles: self.circles.iter().map(entry).collect(),
            digest: String::new(),
        };
        text.digest = text.own_digest()?;
        Ok(text)
    }

    /// Writes the file.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn save(&self, path: &Path) -> Result<(), Error> {
        let text = serde_json::to_string_pretty(&self.text()?)
            .map_err(|reason| Error::invalid("proof", reason, "numbers that JSON can hold"))?;
        write_atomically(path, |out| out.write_all((text + "\n").as_bytes()))
    }

    /// Reads a file: what it says is not yet checked.
    ///
    /// # Errors
    /// [`Error::Content`] where it is no such file, or has been edited.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let place = path.display().to_string();
        let (_, value) = parse_header(&place, &read_bytes(path)?, FORMAT, VERSION)?;
        let text: Text = parse_content(&place, value, FORMAT)?;
        if text.own_digest()? != text.digest {
            let expected = "a proof as it was written, with its digest";
            return Err(Error::content(format!("{place}: digest"), expected, &text.digest));
        }
        let circle = |(number, entry): (usize, CircleEntry)| {
            let wrong = |what: &str| {
                let place = format!("{place}: circles[{number}].modes");
                Error::content(place, "128 hexadecimal digits a mode", what)
            };
            let modes = entry.modes.iter().map(|text| of_hex(text).ok_or_else(|| wrong(text)));
            let omega: RotationNumber = entry
                .rotation_number
                .parse()
                .map_err(|reason: Error| reason.with_place(format!("{place}: circles[{number}]")))?;
            let candidate = Candidate {
                omega,
                modes: modes.collect::<Result<_, _>>()?,
                rho: entry.rho,
                rho_hat: entry.rho_hat,
                points: entry.points,
            };
            Ok(Circle { candidate, constants: entry.constants })
        };
        let circles = text.circles.into_iter().enumerate().map(circle);
        let circles: Vec<Circle> = circles.collect::<Result<_, Error>>()?;
        let count = circles.len();
        if let Some(nested) = text.nested.iter().find(|n| n.inner >= count || n.outer >= count) {
            let place = format!("{place}: nested");
            let found = format!("{} and {}", nested.inner, nested.outer);
            return Err(Error::content(place, format!("numbers below {count}"), found));
        }
        Ok(Self { model: text.model, circles, nested: text.nested })
    }

    /// Verifies all of it again, without any search: that the model is the one, that each circle's theorem holds with the
    /// very constants, and that neighbours are nested as it says.
    ///
    /// # Errors
    /// [`Error::Invalid`] with what does not hold.
    pub fn check(&self, stored: &StoredModel) -> Result<(), Error> {
        let own = stored.digest()?;
        if own != self.model {
            return Err(Error::invalid("proof", format!("of the model {}", self.model), format!("one of this model, {own}")));
        }
        let map = PlaneMap::of_model(&stored.model)?;
        let checked: Vec<Result<(), Error>> = self
            .circles
            .par_iter()
            .map(|circle| {
                let omega = circle.omega();
                let wrong = |found: String| {
                    Err(Error::invalid(&format!("proof of {omega}"), found, "a theorem that holds with these constants"))
                };
                match circle.candidate.prove(&map)? {
                    Err(failure) => wrong(failure.to_string()),
                    Ok(constants) if constants != circle.constants => {
                        wrong(format!("other constants, κ = {:e}", constants.kappa))
                    }
                    Ok(_) => Ok(()),
                }
            })
            .collect();
        checked.into_iter().collect::<Result<(), Error>>()?;
        for Nested { inner, outer } in &self.nested {
            let (inner, outer) = (&self.circles[*inner], &self.circles[*outer]);
            outer.encloses(inner).map_err(|failure| {
                let name = format!("nesting of {} in {}", inner.omega(), outer.omega());
                Error::invalid(&name, failure, "circles within one another")
            })?;
        }
        Ok(())
    }
}

impl Text {
    fn own_digest(&self) -> Result<String, Error> {
        let circles: Vec<_> = self
            .circles
            .iter()
            .map(|c| {
                (&c.rotation_number, c.value, c.rho, c.rho_hat, c.points, &c.constants, &c.modes)
            })
            .collect();
        let text = serde_json::to_string(&(&self.about, &self.crate_version, &self.model, &self.nested, circles))
            .map_err(|reason| Error::invalid("proof", reason, "numbers that JSON can hold"))?;
        Ok(digest::of_bytes(text.as_bytes()))
    }
}
