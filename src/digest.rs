//! SHA-256 digests, by which files and records name data.

use sha2::{Digest, Sha256};

fn finish(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The digest of bytes, in hexadecimal.
pub(crate) fn of_bytes(bytes: &[u8]) -> String {
    finish(Sha256::new_with_prefix(bytes))
}

/// The digest of the bits of numbers, in hexadecimal.
pub(crate) fn of_numbers<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> String {
    let mut hash = Sha256::new();
    for number in numbers {
        hash.update(number.to_le_bytes());
    }
    finish(hash)
}
