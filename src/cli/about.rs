//! What the program is: its version, its completions for shells, its manual pages.

use super::arguments::{Arguments, Completions, Manual};
use super::guards::guard_output;
use super::output::out;
use super::status::Status;
use clap::CommandFactory;
use clap_complete::generate;
use clap_mangen::Man;
use gyroceptron::Error;
use gyroceptron::io::{MODEL_VERSION, file_digest, write_atomically};
use gyroceptron::scene::Machine;
use std::path::Path;

const NAME: &str = "gyroceptron";

/// The version in a line.
pub fn version() -> String {
    format!("{NAME} {}\n", env!("CARGO_PKG_VERSION"))
}

/// The version and what results may depend on: they do not, but whoever reports a fault is asked for it.
pub fn long_version() -> String {
    let features = [
        ("cli", cfg!(feature = "cli")),
        ("scenes", cfg!(feature = "scenes")),
        ("proofs", cfg!(feature = "proofs")),
        ("files", cfg!(feature = "files")),
        ("python", cfg!(feature = "python")),
    ];
    let features: Vec<_> =
        features.into_iter().filter(|(_, has)| *has).map(|(name, _)| name).collect();
    let digest = std::env::current_exe().ok().and_then(|program| file_digest(&program).ok());
    format!(
        "{}features: {}\nmodel files: format {MODEL_VERSION} and earlier\nmachine: {}\nprogram: SHA-256 {}\n",
        version(),
        features.join(", "),
        Machine::this(),
        digest.as_deref().unwrap_or("of a file that cannot be read")
    )
}

pub fn completions(arguments: &Completions) -> Result<Status, Error> {
    let mut text = Vec::new();
    generate(arguments.shell, &mut Arguments::command(), NAME, &mut text);
    out(&String::from_utf8_lossy(&text))?;
    Ok(Status::Done)
}

/// A page for the program and one for each command.
pub fn manual(arguments: &Manual) -> Result<Status, Error> {
    std::fs::create_dir_all(&arguments.folder)
        .map_err(|reason| Error::write(&arguments.folder, reason))?;
    let mut program = Arguments::command();
    program.build();
    let mut pages =
        vec![(format!("{NAME}.1"), page(&arguments.folder, Man::new(program.clone()))?)];
    for command in program.get_subcommands().filter(|command| command.get_name() != "help") {
        let name = format!("{NAME}-{}", command.get_name());
        pages.push((format!("{name}.1"), page(&arguments.folder, Man::new(command.clone()))?));
    }
    for (name, _) in &pages {
        guard_output("FOLDER", &arguments.folder.join(name), arguments.overwrite, &[])?;
    }
    for (name, text) in &pages {
        write_atomically(&arguments.folder.join(name), |file| file.write_all(text))?;
    }
    out(&format!("{}: {} manual pages\n", arguments.folder.display(), pages.len()))?;
    Ok(Status::Done)
}

fn page(folder: &Path, of: Man) -> Result<Vec<u8>, Error> {
    let mut text = Vec::new();
    of.render(&mut text).map_err(|reason| Error::write(folder, reason))?;
    Ok(text)
}
