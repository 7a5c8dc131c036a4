//! The built-in scenes: embedded files of the same format as a user's.

use super::nearest::nearest;
use crate::error::Error;

/// A scene that is built into the program, with the text of its file.
#[derive(Clone, Copy, Debug)]
pub struct CatalogueEntry {
    /// The name of the built-in scene.
    pub name: &'static str,
    /// The text of the scene's TOML file.
    pub text: &'static str,
}

macro_rules! entries {
    ($($name:literal),* $(,)?) => {
        &[$(CatalogueEntry {
            name: $name,
            text: include_str!(concat!("catalogue/", $name, ".toml")),
        }),*]
    };
}

/// All built-in scenes, the default one first.
pub fn catalogue() -> &'static [CatalogueEntry] {
    entries![
        "quickstart",
        "paper",
        "oscillators-short",
        "oscillators-long",
        "particle-field",
        "slow-manifold",
        "error-against-time",
        "long-steps",
        "family",
        "field-lines",
        "jolts",
        "coils",
        "edge",
        "tokamak",
        "controls",
        "full-orbit",
        "two-modes",
        "dissipative",
        "stiff",
        "which-action",
        "choosing",
        "noise",
        "trajectories",
        "adiabatic-profiles",
        "there-and-back",
        "confinement",
        "near-identity-penalty",
        "published-weights",
        "adiabatic-horizon",
    ]
}

/// The scene that a run without arguments runs.
pub fn default_scene() -> &'static CatalogueEntry {
    &catalogue()[0]
}

/// The built-in scene of this name.
///
/// # Errors
/// [`Error::Invalid`] with the names there are, and the one that is nearest.
pub fn find(name: &str) -> Result<&'static CatalogueEntry, Error> {
    catalogue().iter().find(|entry| entry.name == name).ok_or_else(|| {
        let names: Vec<_> = catalogue().iter().map(|entry| entry.name).collect();
        let expected = match nearest(name, names.iter().copied()) {
            Some(nearest) => {
                format!("the name of a built-in scene (did you mean `{nearest}`?) or a .toml file")
            }
            None => format!("one of {} or a .toml file", names.join(", ")),
        };
        Error::invalid("scene", format!("`{name}`"), expected)
    })
}
