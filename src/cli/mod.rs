//! Argument parsing and printing.

mod about;
mod arguments;
mod cite;
mod commands;
mod controls;
mod fit;
mod guards;
mod jobs;
mod output;
mod predict;
mod progress;
mod prove;
mod status;
mod train;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};
use gyroceptron::Error;
use gyroceptron::scalar::Simd;
use gyroceptron::scene::catalogue;
use status::Status;
use std::io::Write;
use std::process::ExitCode;

/// The exit status of the program for bad usage or input.
const BAD_INPUT: u8 = 2;

pub fn main() -> ExitCode {
    let parsed = match arguments::Arguments::try_parse() {
        Ok(parsed) => parsed,
        Err(error) => return misspelt().map_or_else(|| usage(&error), |word| refused(&word)),
    };
    if let Some(word) = misspelt() {
        return refused(&word);
    }
    match Simd::limit_by_environment().and_then(|()| commands::dispatch(parsed)) {
        Ok(Status::Done) => ExitCode::SUCCESS,
        Ok(Status::CheckFailed) => ExitCode::from(1),
        // The shell's convention for a run stopped by Ctrl-C.
        Ok(Status::Interrupted) => ExitCode::from(130),
        Err(error) => {
            report(&error);
            ExitCode::from(BAD_INPUT)
        }
    }
}

/// One line on standard error.
fn report(error: &Error) {
    let line = describe(error).replace(['\n', '\r'], " ");
    let _ = writeln!(std::io::stderr(), "gyroceptron: {line}");
}

/// An error with the options that answer it.
fn describe(error: &Error) -> String {
    match error {
        Error::OutputExists { path } => format!(
            "{}: holds an earlier run; give --resume to go on with it, --overwrite to replace it, \
             or another --out",
            path.display()
        ),
        Error::FileExists { path } => format!(
            "{}: exists already; give --overwrite to replace it, or another name",
            path.display()
        ),
        Error::Missing { key: "models.network.path", .. } => {
            format!("{error}; give --weights FILE")
        }
        Error::At { place, reason } => format!("{place}: {}", describe(reason)),
        // Its keys are those of a list of blocks, and no options.
        Error::Block { .. } => error.to_string(),
        other => match option_named(other) {
            // Options have no sections, as scenes do.
            Some(option) => {
                let text = other.to_string();
                format!("{} ({option})", text.strip_prefix("training.").unwrap_or(&text))
            }
            None => other.to_string(),
        },
    }
}

/// The option of the command that an error of the library is about: `--flow-time` of `flow_time`.
fn option_named(error: &Error) -> Option<String> {
    let name = match error {
        Error::Invalid { name, .. }
        | Error::OutOfRange { name, .. }
        | Error::CountOutOfRange { name, .. }
        | Error::WrongCount { name, .. } => name.as_str(),
        Error::Missing { key, .. } => key,
        Error::NoCircleAction { .. } => "circle_action",
        _ => return None,
    };
    let name = name.trim_start_matches("training.").split([':', '.']).next()?;
    let option = name.replace(['_', ' '], "-");
    let command = std::env::args_os().nth(1)?;
    let program = arguments::Arguments::command();
    let own = program.find_subcommand(command)?;
    let is_there = own.get_arguments().any(|argument| argument.get_long() == Some(&option));
    is_there.then(|| format!("--{option}"))
}

/// A first word that is neither a command nor a scene, where it is like one: without a command,
/// the program takes any word for a scene.
fn misspelt() -> Option<String> {
    const NEAR: f64 = 0.8;
    let word = std::env::args_os().nth(1)?.into_string().ok()?;
    if word.starts_with('-') || word.ends_with(".toml") {
        return None;
    }
    let program = arguments::Arguments::command();
    let commands = program.get_subcommands().map(clap::Command::get_name).chain(["help"]);
    let known: Vec<&str> = commands.chain(catalogue().iter().map(|entry| entry.name)).collect();
    if known.contains(&&word[..]) {
        return None;
    }
    let likeness = known.iter().map(|name| (strsim::jaro_winkler(&word, name), name));
    let (_, nearest) =
        likeness.filter(|(near, _)| *near >= NEAR).max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(format!("`{word}` is neither a command nor a scene: did you mean `{nearest}`?"))
}

/// Bad usage, in a line.
fn refused(message: &str) -> ExitCode {
    let _ = writeln!(std::io::stderr(), "gyroceptron: {message} (see gyroceptron --help)");
    ExitCode::from(BAD_INPUT)
}

fn usage(error: &clap::Error) -> ExitCode {
    if error.kind() == ErrorKind::DisplayVersion {
        let is_long = std::env::args_os().any(|word| word == "--version");
        let text = if is_long { about::long_version() } else { about::version() };
        return output::out(&text).map_or(ExitCode::from(BAD_INPUT), |()| ExitCode::SUCCESS);
    }
    if error.kind() == ErrorKind::DisplayHelp {
        let _ = error.print();
        return ExitCode::SUCCESS;
    }
    let text = error.to_string();
    let message = text
        .lines()
        .take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more"))
        .map(|line| line.trim().trim_start_matches("error: "))
        .filter(|line| !line.is_empty())
        .collect::<Vec<_>>()
        .join("; ");
    refused(&message)
}
