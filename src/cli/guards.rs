//! What commands share: threads, files that may be written.

use super::arguments::Common;
use gyroceptron::Error;
use std::path::Path;

pub fn use_threads(common: &Common) -> Result<(), Error> {
    if let Some(threads) = common.threads {
        const MOST: usize = 1024;
        if threads == 0 || threads > MOST {
            let name = "--threads".to_owned();
            return Err(Error::CountOutOfRange { name, found: threads, least: 1, most: MOST });
        }
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global()
            .map_err(|reason| Error::invalid("--threads", threads, reason))?;
    }
    Ok(())
}

/// Refuses an output that would replace an input, an existing file unless asked
/// so, or anything that is no ordinary file; and one that cannot be written.
pub fn guard_output(
    option: &str,
    output: &Path,
    overwrite: bool,
    inputs: &[&Path],
) -> Result<(), Error> {
    let real = |path: &Path| std::fs::canonicalize(path).ok();
    if let Some(input) = inputs.iter().find(|i| real(i).is_some() && real(i) == real(output)) {
        let expected = "another file than the inputs and outputs beside it";
        return Err(Error::invalid(option, input.display(), expected));
    }
    if let Ok(metadata) = std::fs::symlink_metadata(output) {
        if !metadata.is_file() {
            return Err(Error::write(output, "it is no ordinary file"));
        }
        if !overwrite {
            return Err(Error::FileExists { path: output.to_owned() });
        }
    }
    probe_writable(output)
}

/// Refuses a name that says another format than what is written to it.
pub fn check_ending(option: &str, path: &Path, ending: &str) -> Result<(), Error> {
    if path.extension().is_some_and(|found| found == ending) {
        return Ok(());
    }
    Err(Error::invalid(option, path.display(), format!("a name that ends in .{ending}")))
}

pub fn probe_writable(path: &Path) -> Result<(), Error> {
    let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
        let reason = format!("there is no folder {}", folder.display());
        return Err(Error::write(path, reason));
    }
    let probe = tempfile::Builder::new()
        .prefix(".gyroceptron-")
        .tempfile_in(folder.unwrap_or(Path::new(".")));
    probe.map(drop).map_err(|reason| Error::write(path, reason))
}
