//! Symplectic polynomials of pairs of a file.

use super::arguments::{Fit, positive};
use super::guards::{check_ending, guard_output, use_threads};
use super::output::{json, out, typed_words};
use super::progress::line;
use super::status::Status;
use gyroceptron::Error;
use gyroceptron::flow::Symmetries;
use gyroceptron::io::{StoredPolynomial, read_pairs, read_section, save_polynomial};
use gyroceptron::layer::Reversor;
use gyroceptron::scene::{NextStep, Note, next_command};
use gyroceptron::train::{Control, FittedPolynomial, PolynomialFit, PolynomialTrial};
use serde_json::json;

pub fn fit(arguments: &Fit) -> Result<Status, Error> {
    use_threads(&arguments.common)?;
    check_ending("--output", &arguments.output, "json")?;
    guard_output("--output", &arguments.output, arguments.overwrite, &[&arguments.data])?;
    let reversor = arguments.reversor.as_deref().map(Reversor::find).transpose();
    let planes = { arguments.mirrored.iter() }.map(|plane| positive("--mirrored", *plane));
    let fit = PolynomialFit {
        degree: arguments.degree.map(degree).transpose()?,
        symmetries: Symmetries {
            reversor: reversor.map_err(|e| e.with_place("--reversor"))?,
            mirrored: planes.collect::<Result<_, _>>()?,
        },
        section: arguments.section.as_deref().map(read_section).transpose()?,
        validation: arguments.validation,
        seed: arguments.seed,
    };
    let (file, place) = (read_pairs(&arguments.data)?, arguments.data.display());
    if file.single_precision {
        line(&format!("{place}: {}", Note::SinglePrecision));
    }
    if !file.unused.is_empty() {
        line(&format!("{place}: {}", Note::Unused(&file.unused)));
    }
    fit.symmetries.check(file.pairs.dof()).map_err(|e| e.with_place("--mirrored"))?;
    let mut observe = |trial: &PolynomialTrial| {
        line(&said(trial));
        Ok(Control::Continue)
    };
    let fitted = fit.run(file.pairs, &mut observe).map_err(|e| e.with_place(place.to_string()))?;
    for note in &fitted.notes {
        line(&format!("{place}: {note}"));
    }
    save_polynomial(&arguments.output, &StoredPolynomial::of_fit(&fitted, arguments.seed))?;
    let chosen = fitted.chosen();
    if arguments.common.json {
        json(&json!({
            "model": arguments.output.display().to_string(),
            "degree": chosen.degree,
            "trials": fitted.trials,
            "pairs": fitted.pairs,
            "held_out": fitted.held_out,
            "share": chosen.share,
        }))?;
        return Ok(Status::Done);
    }
    let next = match chosen.share <= LARGE {
        true => {
            format!("next: {}", next_command(&typed_words(), NextStep::Predict, &arguments.output))
        }
        false => "With so large an error the map is not fit to follow orbits. More pairs, a smaller region or a \
                  network (`gyroceptron train`) may do better. A coordinate that jumps, such as an angle from 2π to 0, \
                  has to be made continuous first"
            .to_owned(),
    };
    out(&format!(
        "{}: a symplectic polynomial of degree {} with {} coefficients, {}\n{next}\n",
        arguments.output.display(),
        chosen.degree,
        chosen.parameters,
        error_of(&fitted),
    ))?;
    Ok(Status::Done)
}

/// A share of the spread of a coordinate above which an error is large.
const LARGE: f64 = 0.01;

/// A degree of a generating function: one of degree 1 moves all points alike.
fn degree(value: i64) -> Result<usize, Error> {
    let degree = usize::try_from(value).ok().filter(|degree| *degree >= 2);
    degree.ok_or_else(|| Error::invalid("--degree", value, "at least 2"))
}

/// A degree in a line.
fn said(trial: &PolynomialTrial) -> String {
    let PolynomialTrial { degree, parameters, error, held_out, .. } = trial;
    let held_out = held_out.map(|error| format!(", {error:.2e} on held-out pairs"));
    format!(
        "degree {degree}: {parameters} coefficients, a step errs by {error:.2e}{}",
        held_out.unwrap_or_default()
    )
}

/// What the error is, and of what.
fn error_of(fitted: &FittedPolynomial) -> String {
    let FittedPolynomial { pairs, held_out, .. } = fitted;
    let chosen = fitted.chosen();
    let (error, of) = match chosen.held_out {
        Some(error) => (error, format!("{held_out} held-out pairs")),
        None => (chosen.error, "the pairs it was fitted to: none were held out".to_owned()),
    };
    format!(
        "fitted to {pairs} pairs\nA step errs by {error:.2e} in units of the data (rms over {of}), the coordinate that \
         errs most by {:.2e} of its spread",
        chosen.share
    )
}
