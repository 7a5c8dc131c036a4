//! The values of controls that options give.

use gyroceptron::Error;
use gyroceptron::io::StoredModel;

/// What is said of the values of controls.
pub enum ControlsNote {
    /// None were given, and these are used.
    Nominal(String),
    /// One is outside of its range.
    Outside(String),
}

impl ControlsNote {
    pub fn is_outside(&self) -> bool {
        matches!(self, Self::Outside(_))
    }
}

impl std::fmt::Display for ControlsNote {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (Self::Nominal(text) | Self::Outside(text)) = self;
        f.write_str(text)
    }
}

/// A model at the values of its controls that an option has, and what is to be said of them.
pub fn at_controls(
    stored: StoredModel,
    given: &[String],
) -> Result<(StoredModel, Option<ControlsNote>), Error> {
    let Some(controls) = stored.model.architecture().controls.clone() else {
        return match given.first() {
            None => Ok((stored, None)),
            Some(found) => {
                let expected = "none: the model depends on no controls";
                Err(Error::invalid("--at", found, expected))
            }
        };
    };
    let pair = |text: &String| -> Result<(String, f64), Error> {
        let expected = "NAME=VALUE, such as planar=0.02";
        let wrong = || Error::invalid("--at", text, expected);
        let (name, value) = text.split_once('=').ok_or_else(wrong)?;
        Ok((name.trim().to_owned(), value.trim().parse().map_err(|_| wrong())?))
    };
    let pairs: Vec<(String, f64)> = given.iter().map(pair).collect::<Result<_, _>>()?;
    let values = controls.values(pairs.iter().map(|(name, value)| (&**name, *value)));
    let values = values.map_err(|e| e.with_place("--at"))?;
    let names = controls.ranges.iter().map(|range| &range.name);
    let words: Vec<String> =
        names.zip(&values).map(|(name, value)| format!("{name}={value}")).collect();
    let note = match controls.first_outside(&values) {
        Some((range, value)) => Some(ControlsNote::Outside(range.outside(value))),
        None if given.is_empty() => Some(ControlsNote::Nominal(format!(
            "at the middle of the controls, {}; --at takes others",
            words.join(", ")
        ))),
        None => None,
    };
    let at = stored.at_controls(&values)?;
    if let Some(section) = &at.section {
        section.check(section.dof()).map_err(|e| e.with_place("--at"))?;
    }
    Ok((at, note))
}
