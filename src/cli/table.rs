//! Results on standard output.

use super::Status;
use comfy_table::presets::UTF8_HORIZONTAL_ONLY;
use comfy_table::{ContentArrangement, Table};
use gyroceptron::Error;
use gyroceptron::measure::Certificate;
use gyroceptron::scene::{CERTIFICATE_HEADINGS, certificate_cells};
use serde::Serialize;
use std::io::Write;
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

/// One JSON document.
pub fn json(value: &impl Serialize) -> Result<(), Error> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|reason| Error::invalid("--json", reason, "numbers that JSON can hold"))?;
    out(&format!("{text}\n"))
}

pub fn table<R>(headings: &[&str], rows: impl IntoIterator<Item = R>) -> String
where
    R: IntoIterator<Item = String>,
{
    let mut table = Table::new();
    table
        .load_style(UTF8_HORIZONTAL_ONLY)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(headings.iter().map(|h| (*h).to_owned()).collect::<Vec<_>>());
    for row in rows {
        table.add_row(row.into_iter().collect::<Vec<_>>());
    }
    format!("{table}\n")
}

pub fn certificate(certificate: &Certificate) -> String {
    table(&CERTIFICATE_HEADINGS, certificate.rows.iter().map(certificate_cells))
}

pub fn status_of(holds: bool) -> Status {
    if holds { Status::Done } else { Status::CheckFailed }
}
