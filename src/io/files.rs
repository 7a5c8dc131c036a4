//! Files as a whole.

use crate::error::Error;
use std::io::Write;
use std::path::Path;

/// How the name of a file begins that is not yet whole.
pub(crate) const TEMPORARY: &str = ".gyroceptron-";

/// Writes a file whole or not at all.
///
/// # Errors
/// [`Error::Write`] with the path.
pub fn write_atomically(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), Error> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let write = || -> std::io::Result<()> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(TEMPORARY);
        // Temporary files are private by default; results follow the umask.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut file = builder.tempfile_in(folder)?;
        let mut buffered = std::io::BufWriter::new(file.as_file_mut());
        fill(&mut buffered)?;
        buffered.flush()?;
        drop(buffered);
        file.persist(path).map_err(|e| e.error)?;
        Ok(())
    };
    write().map_err(|reason| Error::write(path, reason))
}

/// SHA-256 of a file, in hexadecimal.
///
/// # Errors
/// [`Error::Read`].
pub fn file_digest(path: &Path) -> Result<String, Error> {
    Ok(crate::digest::of_bytes(&read_bytes(path)?))
}

/// The bytes of a file.
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>, Error> {
    std::fs::read(path).map_err(|reason| Error::read(path, reason))
}
