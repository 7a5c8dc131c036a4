//! The section of a report that differs from machine to machine.

use super::comparison_words::{HOW, tanh_markdown};
use super::figures::comparison_caption;
use super::report::{ModelReport, Report};
use super::results::Timings;

pub(super) fn timings_markdown(timings: &Timings, report: &Report) -> String {
    let mut out = String::new();
    if let Some(seconds) = timings.data_seconds {
        out.push_str(&format!("- reference flow of the pairs: {seconds:.1} s\n"));
    }
    for timing in &timings.models {
        if let Some((iterations, seconds)) = timing.points.last() {
            out.push_str(&format!(
                "- training of `{}`: {seconds:.1} s, {:.1} iterations a second\n",
                timing.model,
                *iterations as f64 / seconds
            ));
            let model = report.models().iter().find(|m| m.name == timing.model);
            for (level, iteration) in model.map(ModelReport::milestones).unwrap_or_default() {
                if let Some((_, seconds)) = timing.points.iter().find(|(i, _)| *i == iteration) {
                    out.push_str(&format!(
                        "  - held-out error ≤ {level:.0e} after {iteration} iterations, \
                         {seconds:.1} s\n"
                    ));
                }
            }
        }
        if let (Some(seconds), Some(rollout)) = (timing.rollout_seconds, &report.scene.rollout) {
            out.push_str(&format!(
                "- roll-out of `{}`: {seconds:.2} s for {} trajectories of {} steps\n",
                timing.model,
                rollout.initial.len(),
                rollout.steps
            ));
        }
    }
    if let Some(seconds) = timings.reference_rollout_seconds {
        out.push_str(&format!(
            "- the same trajectories by the reference flow, at two resolutions: {seconds:.2} s\n"
        ));
    }
    if let Some(comparison) = &timings.comparison {
        out.push_str(&comparison.markdown());
    }
    if timings.parts.iter().any(|own| own.comparison.is_some()) {
        out.push_str(&format!("\n{HOW}\n"));
    }
    for (part, own) in report.parts.iter().zip(&timings.parts) {
        if let Some(comparison) = &own.comparison {
            let scene = &part.scene;
            let name = &scene.name;
            out.push_str(&format!("\n### {name}: {}\n\n{}", scene.title, comparison.words()));
            for plot in &scene.plots {
                if let Some(caption) = comparison_caption(*plot) {
                    out.push_str(&format!("![{caption}]({name}/{})\n\n", plot.file()));
                }
            }
        }
    }
    if !timings.tanh.is_empty() {
        out.push_str(&tanh_markdown(&timings.tanh));
    }
    out
}
