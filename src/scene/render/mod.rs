//! Findings for readers: they know tables, figures and data, and no study.

mod html;
pub(super) mod json;
mod markdown;
pub(super) mod svg;
#[cfg(feature = "cli")]
pub mod terminal;

pub use html::{
    certificate as html_certificate, facts as html_facts, laws as html_laws, report as html,
};
pub use json::report as json;
pub use markdown::report as markdown;
