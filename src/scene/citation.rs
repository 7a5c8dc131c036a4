//! What to cite.

use super::registry::Scene;

const CRATE: &str = concat!(
    "@software{gyroceptron,\n  title = {gyroceptron: symplectic gyroceptrons in Rust},\n  version = {",
    env!("CARGO_PKG_VERSION"),
    "},\n  year = {2026}\n}\n"
);

const PAPER: &str = "@article{DuruisseauxBurbyTang2023,
  author = {Duruisseaux, Valentin and Burby, Joshua W. and Tang, Qi},
  title = {Approximation of nearly-periodic symplectic maps via structure-preserving neural networks},
  journal = {Scientific Reports},
  volume = {13},
  pages = {8351},
  year = {2023},
  doi = {10.1038/s41598-023-34862-w}
}
";

/// The entries for the program and, with a scene, for the methods that its studies use, as BibTeX.
pub fn bibtex(scene: Option<&Scene>) -> String {
    let mut entries = vec![CRATE, PAPER];
    entries.extend(scene.map(Scene::citations).unwrap_or_default());
    entries.join("\n")
}
