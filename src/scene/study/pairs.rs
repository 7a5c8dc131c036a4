//! The pairs of the flow map: how many, how exact, and what the limiting rotation
//! alone makes of them.

use super::Study;
use crate::error::Error;
use crate::flow::{Condition, Pairs};
use crate::scene::bibliography::GAUSS_LEGENDRE;
use crate::scene::context::{Context, Halt};
use crate::scene::declaration::Scene;
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::setup::Need;
use serde_json::json;

/// In every scene that names data.
pub(super) struct PairsStudy;

impl Study for PairsStudy {
    fn name(&self) -> &'static str {
        "pairs"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::System, Need::FlowTime, Need::Data]
    }

    fn check(&self, _: &Scene) -> Result<(), Error> {
        Ok(())
    }

    fn figures(&self, _: &Scene) -> Vec<&'static str> {
        Vec::new()
    }

    fn cites(&self, _: &Scene) -> Vec<&'static str> {
        vec![GAUSS_LEGENDRE]
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, Halt> {
        const DIGITS: usize = 16;
        let data = context.data()?;
        let (training, held_out) = (&data.training, data.held_out.as_ref().map_or(0, Pairs::len));
        let digest = training.digest();
        let mut facts = Table::of_facts();
        facts.fact(
            "pairs",
            format!(
                "{} for training, {held_out} held out; SHA-256 `{}…`",
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
        facts.fact(
            "reference flow",
            format!(
                "Gauss–Legendre, 12 stages; largest difference of two resolutions {:.1e}",
                data.reference_error
            ),
        );
        if let Some(error) = data.rotation_error {
            let text = format!("held-out mean squared error {error:.3e}");
            facts.fact("limiting rotation alone", text);
        }
        let results = Section {
            details: vec![Block::Table(facts)],
            data: json!({
                "digest": digest,
                "training": training.len(),
                "held_out": held_out,
                "reference_error": data.reference_error,
                "rotation_error": data.rotation_error,
            }),
            ..Section::default()
        };
        Ok(Findings { title: "Pairs of the flow map".into(), results, ..Findings::default() })
    }
}
