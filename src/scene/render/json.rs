//! A report as data.

use crate::scene::report::Report;
use serde_json::{Map, Value, json};

/// The results of a run. They depend on the scene, the seed and the version alone,
/// not on the machine, its threads or its clock.
pub fn report(report: &Report) -> Value {
    let mut out = json!({
        "crate_version": env!("CARGO_PKG_VERSION"),
        "scene": report.scene,
        "holds": report.holds(),
    });
    let results = report.studies.iter().map(|study| (study.name, &study.findings.results.data));
    insert(&mut out, "studies", data(results));
    insert(&mut out, "parts", report.parts.iter().map(self::report).collect());
    out
}

/// What depends on the machine: seconds, and the amount of work done in this very run. A run that
/// goes on from another's checkpoint does less.
pub fn timings(report: &Report) -> Value {
    let mut out = json!({
        "machine": report.machine,
        "models": report.training_times,
        "stages": report.stages,
    });
    let timed = report.studies.iter().map(|study| (study.name, &study.findings.timings.data));
    insert(&mut out, "studies", data(timed));
    insert(&mut out, "parts", report.parts.iter().map(timings).collect());
    out
}

fn data<'a>(studies: impl Iterator<Item = (&'a str, &'a Value)>) -> Value {
    let given = studies.filter(|(_, data)| !data.is_null());
    given.map(|(name, data)| (name.to_owned(), data.clone())).collect::<Map<_, _>>().into()
}

/// Leaves out what is empty.
fn insert(object: &mut Value, key: &str, value: Value) {
    let empty = match &value {
        Value::Array(entries) => entries.is_empty(),
        Value::Object(entries) => entries.is_empty(),
        _ => false,
    };
    if !empty {
        object[key] = value;
    }
}
