//! Networks that were trained elsewhere, from their files.

use super::target_flow::TargetFlow;
use crate::error::Error;
use crate::io::{
    Provenance, StoredModel, assemble_architecture, file_digest, import_weights, load_model,
    read_architecture, read_tensors, take_units,
};
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
    let place = path.display().to_string();
    let stored = if path.extension().is_some_and(|ending| ending == "json") {
        load_model(path)?
    } else {
        let (data, flow_time) = (Some(file_digest(path)?), Some(time));
        let provenance = Provenance { data, flow_time, ..Provenance::of_scene("import") };
        let (model, units) = match read_architecture(path)? {
            Some(own) => {
                let mut tensors = read_tensors(path)?;
                let units = take_units(&place, &mut tensors, own.dof)?;
                (assemble_architecture(&place, tensors, own)?, units)
            }
            None => {
                let action = target.torus();
                (import_weights(path, &action, target.epsilon(), None)?, None)
            }
        };
        StoredModel { model, units, section: None, provenance }
    };
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
