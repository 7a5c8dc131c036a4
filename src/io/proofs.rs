//! Files of proofs: curves, strips and constants, with the digest of the model that they are about.

use super::json::{parse_content, parse_header};
use super::{StoredModel, read_bytes, write_atomically};
use crate::digest;
use crate::error::Error;
use crate::measure::internals::unless_stopped;
use crate::measure::proof::{
    Candidate, Circle, Constants, FixedPoint, NobleNumber, PlaneMap, Ray, Verdict,
    fixed_point_near, noble_numbers, prove_circle,
};
use crate::network::map_points;
use crate::phase::Direction;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

const FORMAT: &str = "gyroceptron-proof";
const VERSION: u64 = 1;

/// Two nested circles of a [`ProofFile`], given by their indices in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Nested {
    /// The number of the inner circle, from 0.
    pub inner: usize,
    /// The number of the outer circle, from 0.
    pub outer: usize,
}

/// What is proved of a model: its circles, and which of them are nested.
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

/// What a proof is about.
pub const ABOUT: &str = "the map of real numbers with these weights, its turns exact rotations, in the \
    coordinates of its normal form: not the rounded map of doubles, not what the model was trained on";

fn hex(mode: &[[f64; 2]; 4]) -> String {
    mode.iter().flatten().map(|value| format!("{:016x}", value.to_bits())).collect()
}

fn of_hex(text: &str) -> Option<[[f64; 2]; 4]> {
    let mut out = [[0.0; 2]; 4];
    if text.len() != 128 || !text.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f')) {
        return None;
    }
    for (k, value) in out.iter_mut().flatten().enumerate() {
        *value = f64::from_bits(u64::from_str_radix(&text[16 * k..16 * (k + 1)], 16).ok()?);
    }
    Some(out)
}

impl ProofFile {
    /// A proof file for circles of a model: sorts them by area and proves the nesting of neighbours.
    ///
    /// # Errors
    /// Those of [`StoredModel::digest`].
    pub fn new(stored: &StoredModel, mut circles: Vec<Circle>) -> Result<Self, Error> {
        circles.sort_by(|a, b| a.area().total_cmp(&b.area()));
        let nested = (1..circles.len()).filter(|&k| circles[k].encloses(&circles[k - 1]).is_ok());
        let nested = nested.map(|k| Nested { inner: k - 1, outer: k }).collect();
        Ok(Self { model: stored.digest()?, circles, nested })
    }

    /// Whether all circles from `inner` to `outer` are nested, each in the next one.
    pub fn is_nested(&self, inner: usize, outer: usize) -> bool {
        (inner + 1..=outer).all(|k| self.nested.contains(&Nested { inner: k - 1, outer: k }))
    }

    /// What follows from the circles, in words.
    pub fn statements(&self) -> Vec<String> {
        let turns = |k: usize| format!("{:.4}", self.circles[k].omega().value().centre());
        let (mut out, mut first) = (Vec::new(), 0);
        for k in 1..=self.circles.len() {
            if k < self.circles.len() && self.is_nested(k - 1, k) {
                continue;
            }
            let last = turns(k - 1);
            let trapped = "turns leaves, in any number of maps";
            out.push(match k - first {
                1 => format!(
                    "proved: no orbit of this map that begins within the circle of {last} {trapped}"
                ),
                _ => format!(
                    "proved: no orbit of this map that begins between the circles of {} and {last} \
                     {trapped}; nor does one that begins within the latter",
                    turns(first)
                ),
            });
            first = k;
        }
        out
    }

    /// The digest of the file: of the model, the curves, the constants and the nesting.
    ///
    /// # Errors
    /// [`Error::Invalid`] of numbers that JSON does not hold.
    pub fn digest(&self) -> Result<String, Error> {
        Ok(self.text()?.digest)
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

    /// Reads a file, without verifying what it claims.
    ///
    /// # Errors
    /// [`Error::Content`] where it is no such file, or has been edited.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let place = path.display().to_string();
        let (_, value) = parse_header(&place, &read_bytes(path)?, FORMAT, VERSION)?;
        let text: Text = parse_content(&place, value, FORMAT)?;
        if text.own_digest()? != text.digest {
            return Err(Error::Edited { place, covers: "the proof" });
        }
        let circle = |(number, entry): (usize, CircleEntry)| {
            let wrong = |what: &str| {
                let place = format!("{place}: circles[{number}].modes");
                Error::content(place, "128 hexadecimal digits a mode", what)
            };
            let modes = entry.modes.iter().map(|text| of_hex(text).ok_or_else(|| wrong(text)));
            let omega: NobleNumber = entry.rotation_number.parse().map_err(|reason: Error| {
                reason.with_place(format!("{place}: circles[{number}]"))
            })?;
            if omega.value().centre() != entry.value {
                let expected = format!("the value of {omega}");
                let place = format!("{place}: circles[{number}].value");
                return Err(Error::content(place, expected, entry.value));
            }
            let candidate = Candidate {
                omega,
                modes: modes.collect::<Result<_, _>>()?,
                rho: entry.rho,
                rho_hat: entry.rho_hat,
                points: entry.points,
                cylinder: false,
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

    /// Verifies the whole file again, without any search: that it is about this model, that the theorem holds for each
    /// circle with exactly the stored constants, and that neighbours are nested as stated.
    ///
    /// # Errors
    /// [`Error::Invalid`] with what does not hold.
    pub fn check(&self, stored: &StoredModel) -> Result<(), Error> {
        self.check_unless_stopped(stored, || true)
    }

    /// [`ProofFile::check`] that can be stopped: it calls `go_on`, on several threads, several times a second.
    ///
    /// # Errors
    /// Those of [`ProofFile::check`]; [`Error::Stopped`] when the answer is false.
    pub fn check_unless_stopped(
        &self,
        stored: &StoredModel,
        go_on: impl Fn() -> bool + Clone + Send + Sync + 'static,
    ) -> Result<(), Error> {
        let own = stored.digest()?;
        if own != self.model {
            return Err(Error::invalid(
                "proof",
                format!("of the model {}", self.model),
                format!("one of this model, {own}"),
            ));
        }
        if self.circles.is_empty() {
            return Err(Error::invalid("proof", "no circle", "one at least"));
        }
        let map = PlaneMap::of_model(&stored.model)?;
        let checked: Vec<Result<(), Error>> = self
            .circles
            .par_iter()
            .map(|circle| {
                let omega = circle.omega();
                let wrong = |found: String| {
                    Err(Error::invalid(
                        &format!("proof of {omega}"),
                        found,
                        "a theorem that holds with these constants",
                    ))
                };
                match unless_stopped_here(&go_on, || circle.candidate.prove(&map))? {
                    Err(failure) => wrong(failure.to_string()),
                    Ok(constants) if constants != circle.constants => {
                        wrong(format!("other constants, κ = {:e}", constants.kappa))
                    }
                    Ok(_) => check_box(stored, circle),
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

/// What `prove` returns on this thread, unless it is stopped.
fn unless_stopped_here<T>(
    go_on: &(impl Fn() -> bool + Clone + 'static),
    prove: impl FnOnce() -> Result<T, Error>,
) -> Result<T, Error> {
    let stopped = || Err(Error::Stopped { what: "proof".into() });
    if !go_on() {
        return stopped();
    }
    unless_stopped(go_on.clone(), prove).unwrap_or_else(stopped)
}

/// What to prove of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct ProofRequest {
    /// The rotation numbers of the circles. If empty, `circles` numbers are chosen, spread over those that the model
    /// has.
    pub numbers: Vec<NobleNumber>,
    /// How many rotation numbers to choose if `numbers` is empty.
    pub circles: usize,
    /// The start of the ray on which circles are looked for, in the coordinates of the normal form. If None, the fixed
    /// point near 0 is taken, or 0 where none is found.
    pub from: Option<[f64; 2]>,
    /// The end (q, p) of the ray on which curves are looked for.
    pub to: [f64; 2],
}

impl Default for ProofRequest {
    fn default() -> Self {
        Self { numbers: Vec::new(), circles: 8, from: None, to: [1.0, 0.0] }
    }
}

/// The verdict on each curve that a [`ProofRequest`] tried.
#[derive(Clone, Debug, PartialEq)]
pub struct Proofs {
    /// Each rotation number with its verdict.
    pub tried: Vec<(NobleNumber, Verdict)>,
    /// What is proved, as its file holds it.
    pub file: ProofFile,
    /// The fixed point near 0, where it is proved.
    pub fixed_point: Option<FixedPoint>,
}

impl Proofs {
    /// Tries to prove circles of a model, several at a time. `found` is called with each verdict as it comes; if the
    /// circle is proved, also with a file of all that is proved so far, else with an empty file.
    ///
    /// # Errors
    /// [`Error::Invalid`] of a model that the theorem is not about, a ray without orbits that turn at different
    /// rates, or a circle that was asked for and is outside the box of polynomials; what `found` returns.
    pub fn of_model(
        stored: &StoredModel,
        request: &ProofRequest,
        found: impl Fn(&NobleNumber, &Verdict, &ProofFile) -> Result<(), Error> + Sync,
    ) -> Result<Self, Error> {
        Self::of_model_unless_stopped(stored, request, found, || true)
    }

    /// [`Proofs::of_model`] that can be stopped: it calls `go_on`, on several threads, several times a second.
    ///
    /// # Errors
    /// Those of [`Proofs::of_model`]; [`Error::Stopped`] when the answer is false.
    pub fn of_model_unless_stopped(
        stored: &StoredModel,
        request: &ProofRequest,
        found: impl Fn(&NobleNumber, &Verdict, &ProofFile) -> Result<(), Error> + Sync,
        go_on: impl Fn() -> bool + Clone + Send + Sync + 'static,
    ) -> Result<Self, Error> {
        let map = PlaneMap::of_model(&stored.model)?;
        map.check_symplectic()?;
        let fixed = fixed_point_near(&map, [0.0; 2]);
        let from = request.from.or(fixed).unwrap_or_default();
        let ray = Ray { from, to: request.to };
        for value in from.iter().chain(&request.to) {
            Error::check_finite("ends of the ray", *value)?;
        }
        let mut numbers = request.numbers.clone();
        if numbers.is_empty() {
            let chosen = || Ok(noble_numbers(&map, ray, request.circles));
            numbers = unless_stopped_here(&go_on, chosen)?;
        }
        if numbers.is_empty() {
            let ends = format!("from {from:?} to {:?}", request.to);
            let expected = "a ray with orbits that turn around its beginning at different rates";
            return Err(Error::invalid("ends of the ray", ends, expected));
        }
        let none = ProofFile { model: stored.digest()?, circles: Vec::new(), nested: Vec::new() };
        let kept: Mutex<Vec<Circle>> = Mutex::new(Vec::new());
        let prove = |omega: NobleNumber| {
            let mut verdict = unless_stopped_here(&go_on, || prove_circle(&map, ray, &omega))?;
            if let Verdict::Proved(circle) = &verdict
                && let Err(outside) = check_box(stored, circle)
            {
                if !request.numbers.is_empty() {
                    return Err(outside);
                }
                verdict = Verdict::NotFound(outside.to_string());
            }
            let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
            if let Verdict::Proved(circle) = &verdict {
                kept.push((**circle).clone());
                found(&omega, &verdict, &ProofFile::new(stored, kept.clone())?)?;
            } else {
                found(&omega, &verdict, &none)?;
            }
            Ok((omega, verdict))
        };
        let tried: Vec<Result<_, Error>> = numbers.into_par_iter().map(prove).collect();
        let tried = tried.into_iter().collect::<Result<_, Error>>()?;
        let circles = kept.into_inner().unwrap_or_else(PoisonError::into_inner);
        let file = ProofFile::new(stored, circles)?;
        let fixed_point = fixed.and_then(|fixed| FixedPoint::prove(&map, fixed));
        Ok(Self { tried, file, fixed_point })
    }

    /// Whether every circle that was tried is proved.
    pub fn holds(&self) -> bool {
        self.tried.iter().all(|(_, verdict)| matches!(verdict, Verdict::Proved(_)))
    }

    /// The outcome as a JSON document.
    pub fn document(&self) -> serde_json::Value {
        json!({
            "about": ABOUT,
            "crate_version": env!("CARGO_PKG_VERSION"),
            "model": self.file.model,
            "holds": self.holds(),
            "circles": self.tried.iter().map(verdict_of).collect::<Vec<_>>(),
            "nested": self.file.nested,
            "statements": self.file.statements(),
            "fixed_point": self.fixed_point.map(|point| json!({
                "middle": point.middle,
                "radius": point.radius,
                "trace": point.trace,
                "residue": [0.25 * (2.0 - point.trace[1]), 0.25 * (2.0 - point.trace[0])],
                "elliptic": point.is_elliptic(),
            })),
        })
    }
}

fn verdict_of((omega, verdict): &(NobleNumber, Verdict)) -> serde_json::Value {
    let (name, circle, failure, reason) = match verdict {
        Verdict::Proved(circle) => ("proved", Some(circle), None, None),
        Verdict::NotProved(failure) => ("not proved", None, Some(failure), None),
        Verdict::NotFound(reason) => ("not proved", None, None, Some(reason)),
    };
    json!({
        "rotation_number": omega.to_string(),
        "turns": omega.value().centre(),
        "gamma": omega.gamma(),
        "verdict": name,
        "failure": failure.map(|failure| json!({
            "inequality": failure.inequality,
            "found": failure.found.is_finite().then_some(failure.found),
            "needed": failure.needed,
            "rho": failure.strip,
            "advice": failure.advice(),
        })),
        "reason": reason,
        "rho": circle.map(|c| c.candidate.rho),
        "modes": circle.map(|c| c.candidate.modes.len()),
        "area": circle.map(|c| c.area()),
        "constants": circle.map(|c| c.constants),
    })
}

/// Fails where a curve is outside the box of polynomials.
fn check_box(stored: &StoredModel, circle: &Circle) -> Result<(), Error> {
    const POINTS: usize = 256;
    let [chart, _] = stored.model.chart_and_inner_map();
    let mut points = circle.points(POINTS);
    for point in points.chunks_exact_mut(2) {
        map_points(&chart, Direction::Forward, point)?;
    }
    let reach = stored.model.largest_reach(&points);
    if !(reach <= 1.0) {
        let expected = "a curve within the box of the polynomials, where they were trained";
        let name = format!("circle of {}", circle.omega());
        return Err(Error::invalid(&name, format!("{reach:.3} of the box"), expected));
    }
    Ok(())
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
        let text = serde_json::to_string(&(
            &self.about,
            &self.crate_version,
            &self.model,
            &self.nested,
            circles,
        ))
        .map_err(|reason| Error::invalid("proof", reason, "numbers that JSON can hold"))?;
        Ok(digest::of_bytes(text.as_bytes()))
    }
}
