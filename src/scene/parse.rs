//! Reading a scene file.

use super::catalogue::{CatalogueEntry, find};
use super::nearest::nearest;
use super::registry::Scene;
use super::written::to_json;
use crate::error::Error;
use crate::train::{Fit, TrainingOptions};
use serde_json::Value;
use std::borrow::Cow;
use toml::de::DeTable;

/// Reads a scene. `place` names the file in errors.
///
/// # Errors
/// When it is no TOML, a key is unknown (with the nearest known one), a value
/// is missing or out of range.
pub fn parse(place: &str, text: &str) -> Result<Scene, Error> {
    let (text, named) = without_named_scenes(place, text)?;
    let text = text.as_ref();
    let mut scene: Scene = toml::from_str(text).map_err(|error| {
        let line = error.span().map(|span| text[..span.start].matches('\n').count() + 1);
        unknown_key(place, text, error.message()).unwrap_or_else(|| {
            let place = line.map_or(place.to_owned(), |line| format!("{place}:{line}"));
            Error::content(place, "a scene", error.message().replace('\n', " "))
        })
    })?;
    // Variants without fields let any key pass: what does not come back beside a
    // kind when the scene is written again was not understood.
    let written = to_json(&scene).ok();
    let given = toml::from_str::<toml::Value>(text).ok();
    if let (Some(written), Some(given)) = (written, given)
        && let Some((key, known)) = stray_key(&given, &written)
    {
        return Err(unknown(place, text, &key, known.iter().map(String::as_str)));
    }
    if let Ok(given) = toml::from_str::<toml::Value>(text) {
        recommend(&mut scene, &given);
    }
    scene.parts.extend(named);
    scene.check(place)?;
    Ok(scene)
}

/// Fills in what a scene leaves open of trainings on pairs of a file, in its parts too: the flow time 1, a loss by
/// plane, Levenberg–Marquardt until it is at rest, and several initial weights, of which `starts = { count = 1, … }` asks for
/// one.
fn recommend(scene: &mut Scene, given: &toml::Value) {
    let items = |of: &toml::Value, key: &str| -> Vec<toml::Value> {
        of.get(key).and_then(toml::Value::as_array).cloned().unwrap_or_default()
    };
    for (part, given) in scene.parts.iter_mut().zip(items(given, "parts")) {
        recommend(part, &given);
    }
    if !scene.setup.is_of_file() {
        return;
    }
    // As of pairs in the training of one network: their map is that of a unit of time.
    let is_given = scene.setup.flow_time.is_some();
    scene.setup.flow_time.get_or_insert(1.0);
    scene.setup.data.iter_mut().for_each(|data| data.is_time_given = is_given);
    let recommended = Fit::default().training;
    let fill = |training: &mut TrainingOptions, given: Option<&toml::Value>| {
        let has = |key: &str| given.is_some_and(|given| given.get(key).is_some());
        if !has("loss") {
            training.loss = recommended.loss.clone();
        }
        if !has("optimiser") {
            training.optimiser = recommended.optimiser.clone();
            if !has("plateau") {
                training.plateau = recommended.plateau;
            }
        }
        if !has("starts") {
            training.starts = recommended.starts;
        }
    };
    fill(&mut scene.setup.training, given.get("training"));
    for (model, given) in scene.setup.models.iter_mut().zip(items(given, "models")) {
        if let Some(training) = &mut model.training {
            fill(training, given.get("training"));
        }
    }
}

/// The text with its key `scenes` blanked, so that lines stay where they are, and the
/// built-in scenes that it names, which are parts more.
fn without_named_scenes<'a>(
    place: &str,
    text: &'a str,
) -> Result<(Cow<'a, str>, Vec<Scene>), Error> {
    // Whoever reads the scene says what is no TOML.
    let Ok(table) = DeTable::parse(text) else { return Ok((text.into(), Vec::new())) };
    let Some((key, value)) = table.get_ref().get_key_value("scenes") else {
        return Ok((text.into(), Vec::new()));
    };
    let line = text[..value.span().start].matches('\n').count() + 1;
    let place = format!("{place}:{line}");
    let written = &text[value.span()];
    let invalid =
        || Error::invalid("scenes", written, "names of built-in scenes").with_place(&place);
    let mut scenes = Vec::new();
    for name in value.get_ref().as_array().ok_or_else(invalid)?.iter() {
        let entry =
            find(name.get_ref().as_str().ok_or_else(invalid)?).map_err(|e| e.with_place(&place))?;
        scenes.push(entry.scene()?);
    }
    let assignment = key.span().start..value.span().end;
    let blank = text[assignment.clone()].replace(|c| c != '\n', " ");
    let text = [&text[..assignment.start], &blank, &text[assignment.end..]].concat();
    Ok((text.into(), scenes))
}

/// The first key of a kind that `given` has and `written` lacks, with its known
/// neighbours. Elsewhere a key may be left out for its default value.
fn stray_key(given: &toml::Value, written: &Value) -> Option<(String, Vec<String>)> {
    match (given, written) {
        (toml::Value::Table(given), Value::Object(written)) => {
            let of_kind = given.contains_key("kind");
            given.iter().find_map(|(key, value)| match written.get(key) {
                Some(other) => stray_key(value, other),
                None if of_kind => Some((key.clone(), written.keys().cloned().collect())),
                None => None,
            })
        }
        (toml::Value::Array(given), Value::Array(written)) => {
            given.iter().zip(written).find_map(|(a, b)| stray_key(a, b))
        }
        _ => None,
    }
}

/// [`Error::UnknownKey`] with the line where the key stands and the nearest of
/// the known ones, if one is near.
fn unknown<'a>(place: &str, text: &str, key: &str, known: impl Iterator<Item = &'a str>) -> Error {
    let line = text.lines().position(|line| {
        line.match_indices(key).any(|(at, _)| {
            let before = line[..at].chars().next_back();
            let after = line[at + key.len()..].trim_start();
            before.is_none_or(|c| !(c.is_alphanumeric() || c == '_' || c == '-'))
                && (after.starts_with('=') || after.starts_with(']') || after.starts_with('.'))
        })
    });
    let known: Vec<&str> = known.collect();
    let nearest = nearest(key, known.iter().copied()).map(str::to_owned);
    let known = known.into_iter().map(str::to_owned).collect();
    let place = line.map_or(place.to_owned(), |line| format!("{place}:{}", line + 1));
    Error::UnknownKey { place, key: key.to_owned(), nearest, known }
}

/// Reads "unknown field `key`, expected one of `a`, `b`" back into an error
/// that names the nearest key.
fn unknown_key(place: &str, text: &str, message: &str) -> Option<Error> {
    let rest = message.strip_prefix("unknown field `")?;
    let (key, expected) = rest.split_once('`')?;
    Some(unknown(place, text, key, expected.split('`').skip(1).step_by(2)))
}

impl CatalogueEntry {
    /// Reads the built-in scene.
    ///
    /// # Errors
    /// Those of [`parse`]; a test reads them all.
    pub fn scene(&self) -> Result<Scene, Error> {
        parse(&format!("built-in scene {}", self.name), self.text)
    }
}
