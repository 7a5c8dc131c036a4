//! The pairs of the flow map: how many, how exact, and what the limiting rotation
//! alone makes of them.

use super::shared::Study;
use super::work_precision::citations;
use crate::flow::{Condition, Integrator, Pairs};
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::setup::{Data, FlowBy, Need};
use serde_json::json;

/// In every scene that names data.
pub(in crate::scene) struct PairsStudy;

impl Study for PairsStudy {
    fn name(&self) -> &'static str {
        "pairs"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::TargetFlow, Need::FlowTime, Need::Data]
    }

    fn cites(&self, scene: &Declared<'_>) -> Vec<&'static str> {
        if scene.setup.data.as_ref().is_some_and(|data| data.lines.is_some()) {
            return Vec::from_iter(Integrator::DormandPrince8.bibtex());
        }
        let of_data = |data: &Data| data.flow.map(|flow| flow.integrator);
        citations(scene.setup.data.as_ref().and_then(of_data).into_iter())
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        const DIGITS: usize = 16;
        let data = context.data()?;
        let (training, held_out) = (&data.training, data.held_out.as_ref().map_or(0, Pairs::len));
        let digest = training.digest();
        let declared = context.scene.setup.data.as_ref();
        let orbit = declared.map_or(1, |data| data.orbit);
        let of_orbits = match orbit {
            1 => String::new(),
            _ => format!(", {orbit} along each of {} orbits", training.len() / orbit),
        };
        let mut facts = Table::of_facts();
        facts.fact(
            "pairs",
            format!(
                "{} for training{of_orbits}, {held_out} held out; SHA-256 `{}…`",
                training.len(),
                &digest[..DIGITS.min(digest.len())]
            ),
        );
        if !training.conditions().is_empty() {
            let time = context.flow_time()?;
            let of = |c: &Condition| {
                let time = Format::Setting.number(c.time * time);
                format!("{} of ε = {}, time {time}", c.pairs, Format::Setting.number(c.epsilon))
            };
            let maps: Vec<String> = training.conditions().iter().map(of).collect();
            facts.fact("for training, of several maps", maps.join("; "));
        }
        let declared = context.scene.setup.data.as_ref().and_then(|data| data.flow);
        let error = data.reference_error;
        let file = context.scene.setup.data.as_ref().and_then(Data::file);
        let of_lines = context.scene.setup.data.as_ref().is_some_and(|data| data.lines.is_some());
        let flow = match declared {
            None if of_lines => format!(
                "lines in the field of coils, the method of order 8 of Dormand and Prince; largest \
                 error of a map {error:.1e} m"
            ),
            None if file.is_some() => "of a file: its error is not known".to_owned(),
            Some(FlowBy { integrator, step }) => {
                let (name, step) = (integrator.name(), Format::Setting.number(step));
                let halves = match integrator.is_judged_by_another() {
                    true => "largest difference from steps half as long of a finer method",
                    false => "largest difference from steps half as long",
                };
                format!("{name}, steps of {step} at most; {halves} {error:.1e}")
            }
            None => format!(
                "Gauss–Legendre, 12 stages; largest difference of two resolutions {error:.1e}"
            ),
        };
        facts.fact("reference flow", flow);
        if let Some(error) = data.rotation_error {
            let text = format!("held-out mean squared error {error:.3e}");
            let name = if file.is_some() || of_lines {
                "nearest rotation alone"
            } else {
                "limiting rotation alone"
            };
            facts.fact(name, text);
        }
        if let Some(units) = &data.units {
            facts.fact("units", format!("{}; errors of each component are in units of the data, mean squared errors and \
                 distances in these", units.describe()));
        }
        if let Some((section, _)) = &data.section {
            facts.fact("section", section.describe());
        }
        let mut results = Section {
            details: vec![Block::Table(facts)],
            data: json!({
                "digest": digest,
                "training": training.len(),
                "orbit": orbit,
                "held_out": held_out,
                "units": data.units,
                "reference_error": data.reference_error,
                "rotation_error": data.rotation_error,
            }),
            ..Section::default()
        };
        if let (Some(file), Some((action, _))) = (file, &data.nearest) {
            results.data["circle_action"] = json!(action);
            results.data["epsilon"] = json!(file.epsilon);
        }
        if !data.notes.is_empty() {
            let lines = data.notes.iter().map(|note| format!("- {note}\n")).collect();
            results.summary.push(Block::Text(lines));
            results.data["notes"] = json!(data.notes);
        }
        Ok(Findings { title: "Pairs of the flow map".into(), results, ..Findings::default() })
    }
}
