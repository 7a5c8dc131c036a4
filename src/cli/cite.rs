//! What to cite.

use gyroceptron::Error;
use gyroceptron::io::{ABOUT_PROOFS, ProofFile};
use gyroceptron::scene::{self, Scene, bibtex};
use std::path::Path;

/// The entries for what is named: a file of proofs, or a scene and the methods that its studies use.
pub fn entries(target: Option<&str>) -> Result<String, Error> {
    let Some(target) = target else { return Ok(bibtex(None)) };
    let path = Path::new(target);
    if path.extension().is_none_or(|ending| ending != "json") {
        return Ok(bibtex(Some(&Scene::read(target)?)));
    }
    let proofs = ProofFile::load(path)?;
    // What the study of proofs cites is what they rest on.
    let methods = scene::find("confinement")?.scene()?;
    Ok([bibtex(Some(&methods)), of_proofs(path, &proofs)?].join("\n"))
}

/// A file of proofs, by its digest: the statements, what they are of, and how to verify them.
fn of_proofs(path: &Path, proofs: &ProofFile) -> Result<String, Error> {
    let digest = proofs.digest()?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let omegas: Vec<String> = proofs.circles.iter().map(|c| c.omega().to_string()).collect();
    Ok(format!(
        "@misc{{gyroceptron-proof-{},\n  title = {{Proofs of {} invariant circles of a learnt map}},\n  \
         howpublished = {{File {name}, digest {digest}, of the model of digest {}}},\n  \
         note = {{Rotation numbers {}; {}; verified by gyroceptron check-proof, version {}}}\n}}\n",
        &digest[..digest.len().min(8)],
        omegas.len(),
        proofs.model,
        omegas.join(", "),
        ABOUT_PROOFS,
        env!("CARGO_PKG_VERSION"),
    ))
}
