//! Findings for readers: they know tables, figures and data, and no study.

mod html;
pub(super) mod json;
mod markdown;
pub(super) mod svg;
#[cfg(feature = "cli")]
pub mod terminal;

pub use html::{blocks as html_blocks, page as html_page, report as html};
pub use json::report as json;
pub use markdown::report as markdown;
