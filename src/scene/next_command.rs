//! What to try after a training, as a command: the one that was typed, with other options.

use super::own_pairs::NextStep;
use crate::train::Fit;
use std::path::Path;

/// The command of a step, from the arguments of the program without its name.
pub fn next_command(typed: &[String], step: NextStep, model: &Path) -> String {
    let with = |removed: &[&str], added: &[&str]| {
        let flags = ["--resume", "--overwrite"];
        let mut kept = without(typed, removed, &flags);
        kept.extend(added.iter().map(|word| (*word).to_owned()));
        kept
    };
    let words = match step {
        NextStep::Predict => {
            let model = model.display().to_string();
            let words = ["predict", "--model", &model, "--input", "POINTS.npy", "--steps", "1000"];
            let words = [&words[..], &["--output", "TRAJECTORIES.npy"]].concat();
            words.into_iter().map(str::to_owned).collect()
        }
        NextStep::NormalForm => {
            let of_others =
                ["--architecture", "--psi", "--near-identity", "--layers", "--optimiser"];
            let penalty = ["--near-identity-penalty"];
            let added = ["--architecture", "normal-form", "--optimiser", "lm", "--overwrite"];
            with(&[&of_others[..], &penalty].concat(), &added)
        }
        NextStep::Couplings => {
            let of_others =
                ["--architecture", "--recipe", "--psi", "--near-identity", "--layers", "--kicks"];
            let more = [
                "--twists",
                "--turned-twists",
                "--perturbation",
                "--radius",
                "--reversor",
                "--ramp",
            ];
            let penalty = ["--near-identity-penalty"];
            let added = ["--architecture", "coupling-gyroceptron", "--overwrite"];
            with(&[&of_others[..], &more, &penalty].concat(), &added)
        }
        NextStep::Action => {
            with(&["--circle-action", "--theta"], &["--circle-action", "auto", "--overwrite"])
        }
        NextStep::Iterations(iterations) => {
            with(&["--iterations"], &["--iterations", &iterations.to_string(), "--resume"])
        }
        NextStep::HoldOut => {
            let share = Fit::HELD_OUT.to_string();
            with(&["--validation"], &["--validation", &share, "--overwrite"])
        }
        NextStep::Values(_) => with(&["--data"], &["--data", "MORE-VALUES.npz", "--overwrite"]),
        NextStep::Pairs(_) | NextStep::DistinctPairs => {
            with(&["--data"], &["--data", "MORE-PAIRS.npz", "--overwrite"])
        }
        NextStep::Marquardt => with(&["--optimiser"], &["--optimiser", "lm", "--overwrite"]),
        NextStep::Starts(starts) => {
            with(&["--starts"], &["--starts", &starts.to_string(), "--overwrite"])
        }
    };
    command_line(&words)
}

/// The program with these arguments, as a shell takes it.
pub fn command_line(words: &[String]) -> String {
    let words: Vec<String> = words.iter().map(|word| quoted(word)).collect();
    format!("gyroceptron {}", words.join(" "))
}

/// The command that does a job of a plan, made from the arguments of the program without its name and the folder of the
/// run. The job is given by its name (None for the one that makes the report) and its digest.
pub fn job_command(typed: &[String], folder: &Path, job: Option<&str>, digest: &str) -> String {
    let mut words = without(typed, &["--out"], &["--plan", "--no-estimate", "--json"]);
    let mut added = vec!["--out".to_owned(), folder.display().to_string()];
    match job {
        Some(id) => added.extend(["--job", id].map(str::to_owned)),
        None => added.push("--merge".into()),
    }
    added.extend(["--digest", digest].map(str::to_owned));
    // What follows two dashes is no option.
    let end = words.iter().position(|word| word == "--").unwrap_or(words.len());
    words.splice(end..end, added);
    command_line(&words)
}

/// The arguments without those that set where a page is written.
pub fn without_page(typed: &[String]) -> Vec<String> {
    without(typed, &["--report"], &["--overwrite"])
}

/// The arguments without these options and their values, and without these flags.
fn without(typed: &[String], options: &[&str], flags: &[&str]) -> Vec<String> {
    let mut kept = Vec::new();
    let mut words = typed.iter();
    while let Some(word) = words.next() {
        let name = word.split('=').next().unwrap_or_default();
        if options.contains(&name) {
            if !word.contains('=') {
                words.next();
            }
        } else if !flags.contains(&&word[..]) {
            kept.push(word.clone());
        }
    }
    kept
}

/// A word as a shell takes it for one.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_=./,:+%@".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', "'\\''")),
    }
}
