//! Networks that were trained elsewhere, from their files.

use super::target_flow::TargetFlow;
use crate::error::Error;
use crate::io::{Provenance, StoredModel, file_digest, import_weights, load_model};
use std::path::Path;

/// The network of a model's file, or of weights of a gyroceptron, which is to stand for a map of this
/// time of the target.
///
/// # Errors
/// Those of [`load_model`] and [`import_weights`]; when the model is of other degrees of freedom,
/// another ε, flow time or action, or of units of its own.
pub(super) fn read_network(
    path: &Path,
    target: TargetFlow<'_>,
    time: f64,
) -> Result<StoredModel, Error> {
    if path.extension().is_none_or(|ending| ending != "json") {
        let action = target.circle_action().into();
        let model = import_weights(path, &action, target.epsilon(), None)?;
        let (data, flow_time) = (Some(file_digest(path)?), Some(time));
        let provenance = Provenance { data, flow_time, ..Provenance::of("import") };
        return Ok(StoredModel { model, units: None, section: None, provenance });
    }
    let stored = load_model(path)?;
    let place = path.display().to_string();
    let of_another = |expected: String, found: String| Err(Error::content(&place, expected, found));
    let architecture = stored.model.architecture();
    if architecture.dof != target.dof() {
        let expected = format!("a model of {} degrees of freedom", target.dof());
        return of_another(expected, architecture.dof.to_string());
    }
    if let Some(action) = architecture.action()
        && architecture.keeps_its_planes()
        && !target.is_turned_by(&action)
    {
        let expected = "circles that turn the planes as those of the system do together";
        return of_another(expected.into(), format!("{:?}", action.circles()));
    }
    let own_time = architecture.has_flow_time().then_some(architecture.flow_time);
    if architecture.has_circle() && architecture.epsilon != target.epsilon() {
        let expected = format!("a model of ε = {}", target.epsilon());
        return of_another(expected, architecture.epsilon.to_string());
    }
    for own in own_time.into_iter().chain(stored.provenance.flow_time) {
        if own != time {
            return of_another(format!("a model of flow time {time}"), own.to_string());
        }
    }
    if stored.units.is_some() || stored.section.is_some() {
        let expected = "a model in the coordinates of the system";
        return of_another(expected.into(), "one with units of its own".into());
    }
    Ok(stored)
}
