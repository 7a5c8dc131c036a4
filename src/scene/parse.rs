//! Reading a scene file.

use super::catalogue::find;
use super::declaration::Scene;
use crate::error::Error;

/// Reads a scene. `place` names the file in errors.
///
/// # Errors
/// When it is no TOML, a key is unknown (with the nearest known one), a value
/// is missing or out of range.
pub fn parse(place: &str, text: &str) -> Result<Scene, Error> {
    let expanded = expanded(place, text)?;
    let text = expanded.as_deref().unwrap_or(text);
    let scene: Scene = toml::from_str(text).map_err(|error| {
        let line = error.span().map(|span| text[..span.start].matches('\n').count() + 1);
        unknown_key(place, text, error.message()).unwrap_or_else(|| {
            let place = line.map_or(place.to_owned(), |line| format!("{place}:{line}"));
            Error::content(place, "a scene", error.message().replace('\n', " "))
        })
    })?;
    // Variants without fields let any key pass: what does not come back when
    // the scene is written again was not understood.
    let written = toml::Value::try_from(&scene).ok();
    let given = toml::from_str::<toml::Value>(text).ok();
    if let (Some(written), Some(given)) = (written, given)
        && let Some((key, known)) = stray_key(&given, &written)
    {
        return Err(unknown(place, text, &key, known.iter().map(String::as_str)));
    }
    scene.check(place)?;
    Ok(scene)
}

/// The text with the built-in scenes that its key `scenes` names in the place of that
/// key, as parts; None where it has no such key, or is no TOML.
fn expanded(place: &str, text: &str) -> Result<Option<String>, Error> {
    let Ok(mut table) = toml::from_str::<toml::Table>(text) else { return Ok(None) };
    let Some(scenes) = table.remove("scenes") else { return Ok(None) };
    let expected = "names of built-in scenes";
    let invalid = |found: &toml::Value| Error::invalid("scenes", found, expected).at(place);
    let mut parts = Vec::new();
    for name in scenes.as_array().ok_or_else(|| invalid(&scenes))? {
        let entry = find(name.as_str().ok_or_else(|| invalid(name))?).map_err(|e| e.at(place))?;
        let part = toml::from_str::<toml::Table>(entry.text);
        parts.push(toml::Value::Table(part.map_err(|_| invalid(name))?));
    }
    match table.entry("parts").or_insert_with(|| toml::Value::Array(Vec::new())) {
        toml::Value::Array(all) => all.extend(parts),
        other => return Err(invalid(other)),
    }
    let text = toml::to_string(&table);
    text.map(Some).map_err(|reason| Error::content(place, "a scene", reason))
}

/// The first key that `given` has and `written` lacks, with its known
/// neighbours.
fn stray_key(given: &toml::Value, written: &toml::Value) -> Option<(String, Vec<String>)> {
    match (given, written) {
        (toml::Value::Table(given), toml::Value::Table(written)) => {
            given.iter().find_map(|(key, value)| match written.get(key) {
                Some(other) => stray_key(value, other),
                None => Some((key.clone(), written.keys().cloned().collect())),
            })
        }
        (toml::Value::Array(given), toml::Value::Array(written)) => {
            given.iter().zip(written).find_map(|(a, b)| stray_key(a, b))
        }
        _ => None,
    }
}

/// [`Error::UnknownKey`] with the line where the key stands and the nearest of
/// the known ones, if one is near.
fn unknown<'a>(place: &str, text: &str, key: &str, known: impl Iterator<Item = &'a str>) -> Error {
    const NEAR: f64 = 0.7;
    let line = text.lines().position(|line| {
        line.match_indices(key).any(|(at, _)| {
            let before = line[..at].chars().next_back();
            let after = line[at + key.len()..].trim_start();
            before.is_none_or(|c| !(c.is_alphanumeric() || c == '_' || c == '-'))
                && (after.starts_with('=') || after.starts_with(']') || after.starts_with('.'))
        })
    });
    let nearest = known
        .map(|name| (strsim::jaro_winkler(key, name), name))
        .filter(|(likeness, _)| *likeness >= NEAR)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name.to_owned());
    let place = line.map_or(place.to_owned(), |line| format!("{place}:{}", line + 1));
    Error::UnknownKey { place, key: key.to_owned(), nearest }
}

/// Reads "unknown field `key`, expected one of `a`, `b`" back into an error
/// that names the nearest key.
fn unknown_key(place: &str, text: &str, message: &str) -> Option<Error> {
    let rest = message.strip_prefix("unknown field `")?;
    let (key, expected) = rest.split_once('`')?;
    Some(unknown(place, text, key, expected.split('`').skip(1).step_by(2)))
}
