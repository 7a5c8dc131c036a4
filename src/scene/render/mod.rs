//! Findings for readers: they know tables, figures and data, and no study.

pub(super) mod json;
mod markdown;
pub(super) mod svg;
#[cfg(feature = "cli")]
pub mod terminal;

pub use json::report as json;
pub use markdown::report as markdown;
