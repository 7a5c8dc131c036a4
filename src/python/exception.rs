//! The exception of the package.

use pyo3::prelude::*;

pyo3::create_exception!(
    gyroceptron,
    Error,
    pyo3::exceptions::PyValueError,
    "What can go wrong: the message has the values that explain it."
);

impl From<crate::error::Error> for PyErr {
    fn from(error: crate::error::Error) -> Self {
        let text = error.to_string();
        // Arguments have no sections, as scenes do.
        let text = text.strip_prefix("training.").unwrap_or(&text);
        Error::new_err(format!("{text}{}", argument_for(&error)))
    }
}

/// The argument that an error of the library, which knows of none, asks for.
fn argument_for(error: &crate::error::Error) -> &'static str {
    match error {
        crate::error::Error::At { reason, .. } => argument_for(reason),
        crate::error::Error::FileExists { .. } => " (overwrite=True replaces it)",
        crate::error::Error::Missing { key: "models.network.path", .. } => "; give weights=FILE",
        _ => "",
    }
}
