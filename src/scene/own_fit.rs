//! The training that a scene declares, for pairs from a file of the user.

use super::catalogue::find;
use super::parse::parse;
use super::registry::Scene;
use crate::error::Error;
use crate::network::NetworkSpec;
use crate::train::{Fit, Recipe};
use std::path::Path;

/// The name of a training and its recipe: those of a scene (its name, or its file), else those of the recipe of this
/// name, else the recommended ones.
///
/// # Errors
/// Those of [`Scene::read`], [`Scene::fit`] and [`Recipe::named`]; when both are given.
pub fn recipe_of(name: Option<&str>, scene: Option<&str>) -> Result<(String, Recipe), Error> {
    let Some(place) = scene else {
        return Ok(("train".into(), name.map(Recipe::named).transpose()?.unwrap_or_default()));
    };
    if let Some(name) = name {
        return Err(Error::invalid("recipe", name, "none beside a scene"));
    }
    let scene = Scene::read(place)?;
    let fit = scene.fit().map_err(|e| e.with_place(place))?;
    Ok((scene.name, Recipe::Declared(Box::new(fit))))
}

impl Scene {
    /// Reads a scene: a built-in one by its name, any other from its file, whose name ends in `.toml`.
    ///
    /// # Errors
    /// When there is no such scene, or its file cannot be read or is no scene.
    pub fn read(name: &str) -> Result<Self, Error> {
        let path = Path::new(name);
        if path.extension().is_some_and(|ending| ending == "toml") {
            let text = std::fs::read_to_string(path).map_err(|reason| Error::read(path, reason))?;
            parse(name, &text)?.with_files_from(path.parent().unwrap_or(Path::new("")))
        } else {
            find(name)?.scene()
        }
    }

    /// A [`Fit`] of the scene's only network to pairs from a file, with the scene's training options. Circles, ε and
    /// flow time are not taken from the scene. If the scene has no networks, the gyroceptron of the paper is fitted.
    ///
    /// # Errors
    /// [`Error::Content`] when the scene has several networks.
    pub fn fit(&self) -> Result<Fit, Error> {
        let setup = &self.setup;
        let (mut network, weights, training) = match &setup.models[..] {
            [] => (NetworkSpec::named("gyroceptron")?, Fit::WEIGHTS, &setup.training),
            [spec] => {
                let training = spec.training.as_ref().unwrap_or(&setup.training);
                (spec.network.clone(), spec.weights, training)
            }
            several => return Err(Error::content("models", "one network to train", several.len())),
        };
        (network.circle_action, network.action) = (None, None);
        Ok(Fit { network: Some(network), weights, training: training.clone(), ..Fit::default() })
    }
}
