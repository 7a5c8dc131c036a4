//! Results on standard output.

use super::status::Status;
use gyroceptron::Error;
use serde::Serialize;
use std::io::{IsTerminal, Write};
use std::path::Path;

/// Writes to standard output. A reader that closed the pipe is no error.
pub fn out(text: &str) -> Result<(), Error> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(reason) if reason.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::write(Path::new("standard output"), reason))
        }
        _ => Ok(()),
    }
}

/// The letters of a line: of the terminal, or as `COLUMNS` says, or 100.
pub fn width() -> usize {
    const USUAL: usize = 100;
    width_of_terminal().unwrap_or(USUAL)
}

/// The letters of a line of the terminal, or as `COLUMNS` says; None where neither is known.
pub fn width_of_terminal() -> Option<usize> {
    let of_terminal = || {
        let terminal = std::io::stdout().is_terminal();
        let size = terminal.then(|| console::Term::stdout().size_checked()).flatten();
        size.map(|(_, columns)| usize::from(columns)).filter(|columns| *columns > 0)
    };
    let of_environment = || std::env::var("COLUMNS").ok()?.trim().parse().ok().filter(|n| *n > 0);
    of_terminal().or_else(of_environment)
}

/// Prints a value as one JSON document on standard output.
pub fn json(value: &impl Serialize) -> Result<(), Error> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|reason| Error::invalid("--json", reason, "numbers that JSON can hold"))?;
    out(&format!("{text}\n"))
}

pub fn status_of(holds: bool) -> Status {
    if holds { Status::Done } else { Status::CheckFailed }
}

/// The arguments that were typed, without the name of the program.
pub fn typed_words() -> Vec<String> {
    std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned()).collect()
}
