//! Argument parsing and printing.

mod arguments;
mod cite;
mod commands;
mod output;
mod progress;
mod train;

use clap::Parser;
use clap::error::ErrorKind;
use gyroceptron::Error;
use std::io::Write;
use std::process::ExitCode;

/// What a command came to; the exit status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Status {
    Done,
    CheckFailed,
    Interrupted,
}

/// Bad usage or input.
const BAD_INPUT: u8 = 2;

pub fn main() -> ExitCode {
    let parsed = match arguments::Arguments::try_parse() {
        Ok(parsed) => parsed,
        Err(error) => return usage(&error),
    };
    match commands::dispatch(parsed) {
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
    let line = error.to_string().replace(['\n', '\r'], " ");
    let _ = writeln!(std::io::stderr(), "gyroceptron: {line}{}", options_for(error));
}

/// The options that an error of the library, which knows of none, asks for.
fn options_for(error: &Error) -> &'static str {
    match error {
        Error::At { reason, .. } => options_for(reason),
        Error::OutputExists { .. } => {
            " (--resume goes on with it, --overwrite replaces it, --out is another folder)"
        }
        Error::FileExists { .. } => " (--overwrite replaces it)",
        Error::Missing { key: "models.network.path", .. } => " (--weights FILE)",
        _ => "",
    }
}

fn usage(error: &clap::Error) -> ExitCode {
    if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
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
    let _ = writeln!(std::io::stderr(), "gyroceptron: {message} (see gyroceptron --help)");
    ExitCode::from(BAD_INPUT)
}
