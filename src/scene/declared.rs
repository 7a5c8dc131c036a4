//! What a scene declares, as its studies see it.

use super::setup::Setup;
use std::any::Any;

/// A scene without the types of its studies.
pub(super) struct Declared<'a> {
    pub(super) name: &'a str,
    /// The seed of all its random streams.
    pub(super) seed: u64,
    pub(super) setup: &'a Setup,
    /// The figures to draw, by name.
    pub(super) plots: &'a [String],
    /// Whether it consists of parts.
    pub(super) has_parts: bool,
    /// How many trainings it has.
    pub(super) trainings: usize,
    /// The options of its studies.
    pub(super) options: Vec<&'a dyn Any>,
}

impl<'a> Declared<'a> {
    /// The options of a study of this type, if the scene has it.
    pub(super) fn options_of<T: Any>(&self) -> Option<&'a T> {
        self.options.iter().find_map(|options| options.downcast_ref())
    }
}
