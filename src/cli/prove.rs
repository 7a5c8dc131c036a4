//! `prove` and `check-proof`.

use super::arguments::{CheckProof, Prove, positive};
use super::guards::{check_ending, guard_output, use_threads};
use super::output::{json, out, status_of, width};
use super::progress::line;
use super::status::Status;
use gyroceptron::Error;
use gyroceptron::io::{ABOUT_PROOFS, ProofFile, ProofRequest, Proofs, load_model};
use gyroceptron::measure::proof::{Circle, Constants, NobleNumber, PlaneMap, Verdict};
use gyroceptron::scene::findings::{Cell, Format, Table};
use gyroceptron::scene::render::terminal;
use serde_json::json;
use std::path::PathBuf;

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

fn frequencies(arguments: &Prove) -> Result<Vec<NobleNumber>, Error> {
    let listed = arguments.frequencies.iter().flat_map(|text| outside_brackets(text));
    let listed = listed.chain(arguments.between.iter().map(String::as_str));
    let mut out: Vec<NobleNumber> = Vec::new();
    for text in listed.filter(|text| !text.trim().is_empty()) {
        let omega: NobleNumber = text.parse()?;
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

/// What has come of each rotation number.
fn verdicts<'a>(
    tried: impl IntoIterator<Item = (&'a NobleNumber, Result<&'a Circle, String>)>,
) -> Table {
    let headings =
        ["rotation number", "turns", "γ", "ρ", "|E|", "κ", "16κ|E|", "distance", "verdict"];
    let mut table = Table::new(headings.map(|heading| (heading, Format::Exact)));
    for (omega, proved) in tried {
        let numbers = match proved {
            Ok(Circle { candidate, constants }) => {
                let Constants { residual, kappa, margin, distance, .. } = *constants;
                [candidate.rho, residual, kappa, margin, distance].map(Some)
            }
            Err(_) => [None; 5],
        };
        let mut row: Vec<Cell> = vec![
            omega.to_string().into(),
            format!("{:.6}", omega.value().centre()).into(),
            format!("{:.3}", omega.gamma()).into(),
        ];
        row.extend(numbers.iter().map(|x| x.map_or(String::new(), |x| format!("{x:.1e}")).into()));
        row.push(proved.map_or_else(|why| why, |_| "proved".to_owned()).into());
        table.push(row);
    }
    table
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
    let from = match &arguments.from[..] {
        [] => None,
        given => Some(pair("--from", given)?),
    };
    let request = ProofRequest { numbers: frequencies(arguments)?, circles: count, from, to };
    let stored = load_model(&arguments.model)?;
    guard_output("--output", &output, arguments.overwrite, &[&arguments.model])?;
    PlaneMap::of_model(&stored.model)
        .map_err(|error| error.with_place(arguments.model.display()))?;
    line(&format!("about {ABOUT_PROOFS}"));
    // What is proved is kept whenever the program is stopped.
    let found = |omega: &NobleNumber, verdict: &Verdict, file: &ProofFile| match verdict {
        Verdict::Proved(_) => {
            file.save(&output)?;
            line(&format!("{omega}: proved"));
            Ok(())
        }
        Verdict::NotProved(_) | Verdict::NotFound(_) => {
            line(&format!("{omega}: not proved"));
            Ok(())
        }
    };
    let proofs = Proofs::of_model(&stored, &request, found)
        .map_err(|error| error.with_place(arguments.model.display()))?;
    let any = !proofs.file.circles.is_empty();
    if any {
        // In one order, whichever was proved first.
        proofs.file.save(&output)?;
    }
    let said = proofs.file.statements();
    if arguments.common.json {
        let mut document = proofs.document();
        document["target"] = arguments.model.display().to_string().into();
        document["output"] = any.then(|| output.display().to_string()).into();
        json(&document)?;
    } else {
        let tried = &proofs.tried;
        if let Some(point) = proofs.fixed_point {
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
        let rows = tried.iter().map(|(omega, verdict)| {
            let proved = match verdict {
                Verdict::Proved(circle) => Ok(&**circle),
                Verdict::NotProved(failure) => Err(format!("not proved {}", failure.number())),
                Verdict::NotFound(_) => Err("not proved (0)".to_owned()),
            };
            (omega, proved)
        });
        out(&terminal::table(&verdicts(rows), width()))?;
        for (omega, verdict) in tried {
            match verdict {
                Verdict::NotProved(failure) => {
                    out(&format!("{omega}: {failure}; what may help: {}\n", failure.advice()))?
                }
                Verdict::NotFound(reason) => out(&format!("{omega}: (0) no curve: {reason}\n"))?,
                Verdict::Proved(_) => {}
            }
        }
        for text in &said {
            out(&format!("{text}\n"))?;
        }
        if any {
            out(&format!(
                "{}: {} circles; gyroceptron check-proof verifies them again\n",
                output.display(),
                proofs.file.circles.len()
            ))?;
        }
    }
    Ok(status_of(proofs.holds()))
}

pub fn check_proof(arguments: &CheckProof) -> Result<Status, Error> {
    use_threads(&arguments.common)?;
    let stored = load_model(&arguments.model)?;
    let proofs = ProofFile::load(&arguments.proof)?;
    proofs.check(&stored).map_err(|error| error.with_place(arguments.proof.display()))?;
    let said = proofs.statements();
    if arguments.common.json {
        json(&json!({
            "target": arguments.model.display().to_string(),
            "proof": arguments.proof.display().to_string(),
            "about": ABOUT_PROOFS,
            "holds": true,
            "circles": proofs.circles.len(),
            "statements": said,
        }))?;
    } else {
        let rows = proofs.circles.iter().map(|circle| (circle.omega(), Ok(circle)));
        out(&terminal::table(&verdicts(rows), width()))?;
        out(&format!("{}: {} circles hold\n", arguments.proof.display(), proofs.circles.len()))?;
        for text in &said {
            out(&format!("{text}\n"))?;
        }
    }
    Ok(Status::Done)
}
