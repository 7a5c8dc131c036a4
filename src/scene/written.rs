//! A scene as TOML text.

use super::registry::Scene;
use crate::error::Error;
use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde::ser::{Serialize, Serializer};
use std::fmt;

impl Scene {
    /// The scene as the text of a TOML file: [`parse`](super::parse()) reads it back.
    ///
    /// # Errors
    /// [`Error::Content`] when TOML has no form for a value.
    pub fn to_toml(&self) -> Result<String, Error> {
        as_toml(self).map_err(|reason| {
            Error::content(&self.name, "a scene that TOML can hold", reason.to_string())
        })
    }
}

/// Scenes go to TOML by way of their JSON, and to values of JSON too: for each serialiser the
/// compiler would build the code of all their types once more.
fn as_toml(scene: &Scene) -> Result<String, Box<dyn std::error::Error>> {
    let tree: Tree = serde_json::from_str(&serde_json::to_string(scene)?)?;
    Ok(toml::to_string_pretty(&tree)?)
}

/// The scene as a value of JSON.
pub(super) fn to_json(scene: &Scene) -> serde_json::Result<serde_json::Value> {
    serde_json::from_str(&serde_json::to_string(scene)?)
}

/// A value of JSON with the order of its keys.
enum Tree {
    Absent,
    Switch(bool),
    Whole(i64),
    /// A whole number above the largest [`Tree::Whole`].
    Large(u64),
    Number(f64),
    Text(String),
    List(Vec<Tree>),
    Table(Vec<(String, Tree)>),
}

impl Serialize for Tree {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Absent => to.serialize_none(),
            Self::Switch(value) => to.serialize_bool(*value),
            Self::Whole(value) => to.serialize_i64(*value),
            Self::Large(value) => to.serialize_u64(*value),
            Self::Number(value) => to.serialize_f64(*value),
            Self::Text(value) => to.serialize_str(value),
            Self::List(values) => to.collect_seq(values),
            Self::Table(values) => to.collect_map(values.iter().map(|(key, value)| (key, value))),
        }
    }
}

impl<'de> Deserialize<'de> for Tree {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(OfTree)
    }
}

struct OfTree;

impl<'de> Visitor<'de> for OfTree {
    type Value = Tree;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("a value of JSON")
    }

    fn visit_unit<E>(self) -> Result<Tree, E> {
        Ok(Tree::Absent)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Tree, E> {
        Ok(Tree::Switch(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Tree, E> {
        Ok(Tree::Whole(value))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Tree, E> {
        Ok(i64::try_from(value).map_or(Tree::Large(value), Tree::Whole))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Tree, E> {
        Ok(Tree::Number(value))
    }

    fn visit_str<E>(self, value: &str) -> Result<Tree, E> {
        Ok(Tree::Text(value.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut from: A) -> Result<Tree, A::Error> {
        let mut values = Vec::new();
        while let Some(value) = from.next_element()? {
            values.push(value);
        }
        Ok(Tree::List(values))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut from: A) -> Result<Tree, A::Error> {
        let mut values = Vec::new();
        while let Some(entry) = from.next_entry()? {
            values.push(entry);
        }
        Ok(Tree::Table(values))
    }
}
