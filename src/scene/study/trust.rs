//! Whether to trust the networks that were trained on your own pairs.

use super::shared::Study;
use crate::scene::context::{Context, RunError};
use crate::scene::findings::{Block, Findings, Section};
use crate::scene::setup::Need;
use crate::scene::trust::trust;
use crate::train::Judgement;

/// In every scene of pairs of a file.
pub(in crate::scene) struct TrustStudy;

impl Study for TrustStudy {
    fn name(&self) -> &'static str {
        "trust"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::TargetFlow, Need::FlowTime, Need::Data]
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let (data, models) = (context.data()?, context.models()?);
        // Pairs of a file have one, and this study is of no others.
        let Some((action, angles)) = &data.nearest else { return Ok(Findings::default()) };
        let (mut summary, mut details, mut values) = (Vec::new(), Vec::new(), Vec::new());
        for trained in models.iter() {
            let name = &trained.spec.name;
            let held_out = data.held_out.as_ref();
            let judgement = context.stage(&format!("orbits of {name}"), |_| {
                Judgement::new(&trained.outcome, &data.training, held_out, (action, angles))
            })?;
            let keeps_areas = trained.model().architecture().is_symplectic();
            let defects = data.area_defects.iter().copied().filter(|_| keeps_areas);
            let judgement = judgement.with_area_defects(defects);
            let mut found = trust(&judgement);
            let heading = || Block::Heading(format!("`{name}`"));
            summary.push(heading());
            summary.append(&mut found.results.summary);
            details.push(heading());
            details.append(&mut found.results.details);
            found.results.data["name"] = name.clone().into();
            values.push(found.results.data);
        }
        Ok(Findings {
            title: "Whether to trust it".into(),
            results: Section { summary, details, data: values.into() },
            ..Findings::default()
        })
    }
}
