//! `prove` and `check-proof`.

use super::Status;
use super::arguments::{CheckProof, Prove, positive};
use super::guards::{check_ending, guard_output, use_threads};
use super::output::{json, out, status_of, width};
use super::progress::line;
use gyroceptron::Error;
use gyroceptron::io::{ProofFile, StoredModel, load_model};
use gyroceptron::measure::proof::{
    Circle, Constants, Failure, FixedPoint, PlaneMap, Ray, RotationNumber, Verdict, fixed_point_near,
    prove_circle, rotation_numbers,
};
use gyroceptron::scene::render::terminal;
use gyroceptron::scene::findings::{Cell, Format, Table};
use rayon::prelude::*;
use serde_json::json;
use std::path::PathBuf;
use std::sync::Mutex;

/// What it is about, said first.
const ABOUT: &str = "about the map of real numbers with these weights, its turns exact rotations, in the coordinates of its \
    normal form: not about the rounded map of doubles, nor about what the model was trained on";

fn pair(name: &str, numbers: &[f64]) -> Result<[f64; 2], Error> {
    match numbers {
        [q, p] if q.is_finite() && p.is_finite() => Ok([*q, *p]),
        _ => Err(Error::invalid(name, format!("{numbers:?}"), "two numbers, Q,P")),
    }
}

/// The parts between commas, but for those of continued fractions.
fn outside_brackets(text: &str) -> Vec<&str> {
    let (mut depth, mut first, mut out) = (0_i32, 0, Vec::new());
    for (place, letter) in text.char_indices() {
        depth += i32::from(letter == '[') - i32::from(letter == ']');
        if letter == ',' && depth == 0 {
            out.push(&text[first..place]);
            first = place + 1;
        }
    }
    out.push(&text[first..]);
    out
}

fn frequencies(arguments: &Prove) -> Result<Vec<RotationNumber>, Error> {
    let listed = arguments.frequencies.iter().flat_map(|text| outside_brackets(text));
    let listed = listed.chain(arguments.between.iter().map(String::as_str));
    let mut out: Vec<RotationNumber> = Vec::new();
    for text in listed.filter(|text| !text.trim().is_empty()) {
        let omega: RotationNumber = text.parse()?;
        if !out.contains(&omega) {
            out.push(omega);
        }
    }
    if !arguments.between.is_empty() && out.len() < 2 {
        let expected = "two rotation numbers that differ";
        return Err(Error::invalid("--between", arguments.between.join(" "), expected));
    }
    Ok(out)
}

/// Fails where a curve is outside the box of a polynomial.
fn check_box(stored: &StoredModel, circle: &Circle) -> Result<(), Error> {
    let [chart, _] = stored.model.chart_and_inner_map();
    let mut points = circle.points(256);
    for point in points.chunks_exact_mut(2) {
        gyroceptron::network::map_points(&chart, gyroceptron::phase::Direction::Forward, point)?;
    }
    let reach = stored.model.largest_reach(&points);
    if reach > 1.0 {
        let expected = "a curve within the box of the polynomials, where they were trained";
        let name = format!("circle of {}", circle.omega());
        return Err(Error::invalid(&name, format!("{reach:.3} of the box"), expected));
    }
    Ok(())
}

/// What has come of each rotation number.
fn verdicts(tried: &[(RotationNumber, Verdict)]) -> Table {
    let headings = ["rotation number", "turns", "γ", "ρ", "|E|", "κ", "16κ|E|", "distance", "verdict"];
    let mut table = Table::new(headings.map(|heading| (heading, Format::Exact)));
    for (omega, verdict) in tried {
        let (mut numbers, said) = (vec![None; 5], match verdict {
            Verdict::Proved(_) => "proved".to_owned(),
            Verdict::NotProved(failure) => format!("not proved {}", failure.number()),
            Verdict::NotFound(_) => "not proved (0)".to_owned(),
        });
        if let Verdict::Proved(circle) = verdict {
            let Constants { residual, kappa, margin, distance, .. } = circle.constants;
            numbers = [circle.candidate.rho, residual, kappa, margin, distance].map(Some).to_vec();
        }
        let mut row: Vec<Cell> = vec![
            omega.to_string().into(),
            format!("{:.6}", omega.value().centre()).into(),
            format!("{:.3}", omega.gamma()).into(),
        ];
        row.extend(numbers.iter().map(|x| x.map_or(String::new(), |x| format!("{x:.1e}")).into()));
        row.push(said.into());
        table.push(row);
    }
    table
}

fn failure_of(failure: &Failure) -> serde_json::Value {
    json!({
        "inequality": failure.inequality,
        "found": failure.found.is_finite().then_some(failure.found),
        "needed": failure.needed,
        "advice": failure.advice(),
    })
}

fn verdict_of((omega, verdict): &(RotationNumber, Verdict)) -> serde_json::Value {
    let (name, circle, failure, reason) = match verdict {
        Verdict::Proved(circle) => ("proved", Some(circle), None, None),
        Verdict::NotProved(failure) => ("not proved", None, Some(failure_of(failure)), None),
        Verdict::NotFound(reason) => ("not proved", None, None, Some(reason)),
    };
    json!({
        "rotation_number": omega.to_string(),
        "turns": omega.value().centre(),
        "gamma": omega.gamma(),
        "verdict": name,
        "failure": failure,
        "reason": reason,
        "rho": circle.map(|c| c.candidate.rho),
        "modes": circle.map(|c| c.candidate.modes.len()),
        "area": circle.map(|c| c.area()),
        "constants": circle.map(|c| c.constants),
    })
}

pub fn prove(arguments: &Prove) -> Result<Status, Error> {
    use_threads(&arguments.common)?;
    let output = arguments.output.clone().unwrap_or_else(|| {
        let mut name = PathBuf::from(&arguments.model);
        name.set_extension("proof.json");
        name
    });
    check_ending("--output", &output, "json")?;
    let count = positive("--circles", arguments.circles)?;
    let to = pair("--to", &arguments.to)?;
    let mut wanted = frequencies(arguments)?;
    let stored = load_model(&arguments.model)?;
    let place = |error: Error| error.with_place(arguments.model.display());
    let map = PlaneMap::of_model(&stored.model).map_err(place)?;
    map.check_symplectic().map_err(place)?;
    guard_output("--output", &output, arguments.overwrite, &[&arguments.model])?;
    let fixed = fixed_point_near(&map, [0.0; 2]);
    let from = match (&arguments.from[..], fixed) {
        ([], Some(fixed)) => fixed,
        ([], None) => [0.0; 2],
        (given, _) => pair("--from", given)?,
    };
    let proved_point = fixed.and_then(|fixed| FixedPoint::prove(&map, fixed));
    let ray = Ray { from, to };
    line(ABOUT);
    if wanted.is_empty() {
        wanted = rotation_numbers(&map, ray, count);
        if wanted.is_empty() {
            let found = format!("from {from:?} to {to:?}");
            let expected = "a ray with orbits that turn around its beginning at different rates";
            return Err(Error::invalid("--from and --to", found, expected));
        }
    }
    // What is proved is kept whenever the program is stopped.
    let kept: Mutex<Vec<Circle>> = Mutex::new(Vec::new());
    let tried: Vec<Result<(RotationNumber, Verdict), Error>> = wanted
        .into_par_iter()
        .map(|omega| {
            let verdict = prove_circle(&map, ray, &omega)?;
            match &verdict {
                Verdict::Proved(circle) => {
                    check_box(&stored, circle)?;
                    let mut kept = kept.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                    kept.push((**circle).clone());
                    ProofFile::new(&stored, kept.clone())?.save(&output)?;
                    line(&format!("{omega}: proved"));
                }
                Verdict::NotProved(_) | Verdict::NotFound(_) => {
                    line(&format!("{omega}: not proved"));
                }
            }
            Ok((omega, verdict))
        })
        .collect();
    let tried: Vec<(RotationNumber, Verdict)> = tried.into_iter().collect::<Result<_, Error>>()?;
    let circles = kept.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    let all = circles.len() == tried.len();
    let proofs = ProofFile::new(&stored, circles)?;
    let said = statement(&proofs);
    if arguments.common.json {
        json(&json!({
            "target": arguments.model.display().to_string(),
            "about": ABOUT,
            "crate_version": env!("CARGO_PKG_VERSION"),
            "output": (!proofs.circles.is_empty()).then(|| output.display().to_string()),
            "circles": tried.iter().map(verdict_of).collect::<Vec<_>>(),
            "nested": proofs.nested,
            "statement": said,
            "fixed_point": proved_point.map(|point| json!({
                "middle": point.middle,
                "radius": point.radius,
                "trace": point.trace,
                "residue": point.trace.map(|trace| 0.25 * (2.0 - trace)),
                "elliptic": point.is_elliptic(),
            })),
        }))?;
    } else {
        if let Some(point) = proved_point {
            let kind = match point.is_elliptic() {
                Some(true) => "elliptic (an O-point)",
                Some(false) => "hyperbolic (an X-point)",
                None => "of a type that is open",
            };
            out(&format!(
                "proved: one fixed point within {:.0e} of ({:.12}, {:.12}), {kind}, Tr DF in [{:.9}, {:.9}]\n",
                point.radius, point.middle[0], point.middle[1], point.trace[0], point.trace[1]
            ))?;
        }
        out(&terminal::table(&verdicts(&tried), width()))?;
        for (omega, verdict) in &tried {
            match verdict {
                Verdict::NotProved(failure) => out(&format!(
                    "{omega}: {failure}; what may help: {}\n",
                    failure.advice()
                ))?,
                Verdict::NotFound(reason) => out(&format!("{omega}: (0) no curve: {reason}\n"))?,
                Verdict::Proved(_) => {}
            }
        }
        for text in &said {
            out(&format!("{text}\n"))?;
        }
        if !proofs.circles.is_empty() {
            out(&format!(
                "{}: {} circles; gyroceptron check-proof verifies them again\n",
                output.display(),
                proofs.circles.len()
            ))?;
        }
    }
    Ok(status_of(all && !proofs.circles.is_empty()))
}

/// What follows of the circles, in words.
fn statement(proofs: &ProofFile) -> Vec<String> {
    let turns = |k: usize| format!("{:.4}", proofs.circles[k].omega().value().centre());
    let mut out = Vec::new();
    let mut first = 0;
    for k in 1..=proofs.circles.len() {
        if k < proofs.circles.len() && proofs.is_nested(k - 1, k) {
            continue;
        }
        if k - first > 1 {
            out.push(format!(
                "proved: no orbit of this map that begins between the circles of {} and {} turns leaves, in any number of maps; \
                 nor does one that begins within the latter",
                turns(first),
                turns(k - 1)
            ));
        } else {
            out.push(format!(
                "proved: no orbit of this map that begins within the circle of {} turns leaves, in any number of maps",
                turns(first)
            ));
        }
        first = k;
    }
    out
}

pub fn check_proof(arguments: &CheckProof) -> Result<Status, Error> {
    use_threads(&arguments.common)?;
    let stored = load_model(&arguments.model)?;
    let proofs = ProofFile::load(&arguments.proof)?;
    proofs.check(&stored).map_err(|error| error.with_place(arguments.proof.display()))?;
    let said = statement(&proofs);
    if arguments.common.json {
        json(&json!({
            "target": arguments.model.display().to_string(),
            "proof": arguments.proof.display().to_string(),
            "about": ABOUT,
            "holds": true,
            "circles": proofs.circles.len(),
            "statement": said,
        }))?;
    } else {
        out(&format!("{}: {} circles hold\n", arguments.proof.display(), proofs.circles.len()))?;
        for text in &said {
            out(&format!("{text}\n"))?;
        }
    }
    Ok(Status::Done)
}
