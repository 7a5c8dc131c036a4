//! What a run found: as data, as Markdown, as JSON.

use super::declaration::Scene;
use crate::measure::{Certificate, Drift, Row, Verdict, disturbing_resonance};
use crate::network::Architecture;
use crate::system::Hamiltonian;
use crate::train::{Stop, TrainingRecord};
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// The results of a run. They depend on the scene, the seed and the version
/// alone, not on the machine, its threads or its clock.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Report {
    /// The version of this crate.
    pub crate_version: String,
    /// The scene, whole.
    pub scene: Scene,
    /// SHA-256 of the training pairs.
    pub data_digest: String,
    /// The number of training pairs.
    pub training_pairs: usize,
    /// The number of held-out pairs.
    pub held_out_pairs: usize,
    /// The largest difference of the reference flow between two resolutions.
    pub reference_error: f64,
    /// The held-out mean squared error of the exact limiting rotation alone.
    pub rotation_error: Option<f64>,
    /// The reference's own error at the end of the roll-out.
    pub rollout_reference_error: Option<f64>,
    /// The networks.
    pub models: Vec<ModelReport>,
}

/// The results for one network.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ModelReport {
    /// Its name in the scene.
    pub name: String,
    /// Which network.
    pub architecture: Architecture,
    /// The number of its parameters.
    pub parameters: usize,
    /// Why training ended.
    pub stop: Stop,
    /// Where training ended.
    pub last: TrainingRecord,
    /// The model that was kept.
    pub best: TrainingRecord,
    /// The records at which the held-out pairs were evaluated.
    pub history: Vec<TrainingRecord>,
    /// The root-mean-square error of each component on the held-out pairs.
    pub component_errors: Vec<f64>,
    /// θ before training.
    pub initial_theta: Option<f64>,
    /// θ after it.
    pub theta: Option<f64>,
    /// Its structure, certified.
    pub certificate: Option<Certificate>,
    /// Its trajectories.
    pub rollout: Option<RolloutReport>,
}

impl ModelReport {
    /// The powers of ten that the held-out error passed in training, with the
    /// iteration at which it was first seen at or below each.
    pub fn milestones(&self) -> Vec<(f64, u64)> {
        let errors: Vec<(u64, f64)> =
            self.history.iter().filter_map(|r| Some((r.iteration, r.validation?))).collect();
        let Some((_, first)) = errors.first() else {
            return Vec::new();
        };
        let mut exponent = libm::floor(libm::log10(*first)) as i32;
        let mut out = Vec::new();
        for (iteration, error) in &errors {
            while *error <= libm::exp10(f64::from(exponent)) && exponent > -32 {
                out.push((libm::exp10(f64::from(exponent)), *iteration));
                exponent -= 1;
            }
        }
        out
    }
}

/// The trajectories of a network beside the reference.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RolloutReport {
    /// The largest distance from the reference, over the kept states, of each
    /// trajectory.
    pub largest_errors: Vec<f64>,
    /// The distance at the end.
    pub final_errors: Vec<f64>,
    /// The network's own μ₀ = 𝔍₀∘ψ⁻¹ along its trajectories.
    pub adiabatic: Option<Vec<Drift>>,
    /// The system's μ₀ along the reference trajectories.
    pub reference_adiabatic: Vec<Drift>,
}

impl Report {
    /// No certificate of the run has failed.
    pub fn holds(&self) -> bool {
        self.models.iter().filter_map(|m| m.certificate.as_ref()).all(Certificate::holds)
    }

    /// How many times smaller than the rotation's a model's held-out error is.
    pub fn improvement(&self, model: &ModelReport) -> Option<f64> {
        Some(self.rotation_error? / model.best.validation?)
    }

    /// The report as Markdown; `timings` is the section that differs from
    /// machine to machine, `figures` are the files beside it.
    pub fn markdown(&self, timings: &str, figures: &[(String, String)]) -> String {
        let mut out = String::new();
        let text = &mut out;
        // Writing to a string cannot fail.
        let _ = self.write_head(text);
        for model in &self.models {
            let _ = self.write_model(text, model);
        }
        if !figures.is_empty() {
            let _ = writeln!(text, "\n## Figures\n");
            for (file, caption) in figures {
                let _ = writeln!(text, "![{caption}]({file})\n\n{caption}\n");
            }
        }
        let _ = writeln!(text, "\n## Timings on this machine\n\n{timings}");
        let _ = writeln!(
            text,
            "\n## To repeat it\n\n`gyroceptron run as-run.toml --out …` with the file of that name beside this report \
             and gyroceptron {}: every number above but the timings comes out the same, bit for bit.",
            self.crate_version
        );
        out
    }

    fn write_head(&self, out: &mut String) -> std::fmt::Result {
        let scene = &self.scene;
        writeln!(out, "# {}\n\n{}\n", scene.name, scene.title)?;
        writeln!(out, "| | |\n|---|---|")?;
        writeln!(out, "| scene | `{}`, seed {} |", scene.name, scene.seed)?;
        writeln!(out, "| gyroceptron | {} |", self.crate_version)?;
        if let (Some(system), Some(time)) = (&scene.system, scene.flow_time) {
            let json = serde_json::to_string(system).unwrap_or_default();
            writeln!(out, "| system | `{json}` |")?;
            writeln!(out, "| flow time | {time} |")?;
        }
        writeln!(
            out,
            "| pairs | {} for training, {} held out; SHA-256 `{}…` |",
            self.training_pairs,
            self.held_out_pairs,
            &self.data_digest[..16.min(self.data_digest.len())]
        )?;
        writeln!(
            out,
            "| reference flow | Gauss–Legendre, 12 stages; largest difference of two resolutions {:.1e} |",
            self.reference_error
        )?;
        if let Some(error) = self.rotation_error {
            writeln!(out, "| limiting rotation alone | held-out mean squared error {error:.3e} |")?;
        }
        for model in &self.models {
            if let Some(certificate) = &model.certificate {
                writeln!(
                    out,
                    "\n## Structure certificate of `{}`: {}\n",
                    model.name,
                    if certificate.holds() { "holds" } else { "DOES NOT HOLD" }
                )?;
                writeln!(
                    out,
                    "{} points, uniform in |zᵢ| ≤ {}, seed {}. A ratio is an error over the rounding \
                     bound of the computation that made it.\n",
                    certificate.options.samples,
                    certificate.options.radius,
                    certificate.options.seed
                )?;
                out.push_str(&certificate_markdown(certificate));
            }
        }
        Ok(())
    }

    fn write_model(&self, out: &mut String, model: &ModelReport) -> std::fmt::Result {
        writeln!(out, "\n## `{}`: {} parameters\n", model.name, model.parameters)?;
        writeln!(out, "| | |\n|---|---|")?;
        writeln!(
            out,
            "| training | {} iterations, {} evaluations of loss and gradient; ended: {} |",
            model.last.iteration,
            model.last.evaluations,
            stop_words(model.stop)
        )?;
        writeln!(
            out,
            "| kept | iteration {}, loss {:.3e} |",
            model.best.iteration, model.best.loss
        )?;
        if let Some(validation) = model.best.validation {
            write!(out, "| held-out mean squared error | {validation:.3e}")?;
            if let Some(improvement) = self.improvement(model) {
                write!(out, ", {improvement:.1} times below the limiting rotation's")?;
            }
            writeln!(out, " |")?;
        }
        if !model.component_errors.is_empty() {
            let errors: Vec<_> =
                model.component_errors.iter().map(|e| format!("{e:.2e}")).collect();
            writeln!(out, "| held-out RMS error of each component | {} |", errors.join(", "))?;
        }
        if let (Some(before), Some(after)) = (model.initial_theta, model.theta) {
            writeln!(out, "| θ | {before} before training, {after:.6} after |")?;
            if let (Some(system), Architecture::Gyroceptron { shape, .. }) =
                (&self.scene.system, &model.architecture)
                && let Some(near) =
                    disturbing_resonance(&shape.circle_action, after, system.epsilon())
            {
                writeln!(out, "| resonance | {near}: there is hardly an adiabatic invariant |")?;
            }
        }
        if let Some(rollout) = &model.rollout {
            self.write_rollout(out, rollout)?;
        }
        Ok(())
    }

    fn write_rollout(&self, out: &mut String, rollout: &RolloutReport) -> std::fmt::Result {
        let (Some(spec), Some(time)) = (&self.scene.rollout, self.scene.flow_time) else {
            return Ok(());
        };
        writeln!(
            out,
            "\nRoll-out of {} steps (time {}), one state in {} kept{}.\n",
            spec.steps,
            spec.steps as f64 * time,
            spec.every,
            self.rollout_reference_error
                .map(|e| format!("; the reference's own error at the end is {e:.1e}"))
                .unwrap_or_default()
        )?;
        writeln!(
            out,
            "| from | largest distance from the reference | at the end | μ₀ of the network at the start | its largest drift | μ₀ of the system at the start | its largest drift |\n|---|---|---|---|---|---|---|"
        )?;
        for (k, point) in spec.initial.iter().enumerate() {
            let (mu, drift) = match &rollout.adiabatic {
                Some(values) => {
                    (format!("{:.6}", values[k].initial), format!("{:.2e}", values[k].largest))
                }
                None => ("–".into(), "–".into()),
            };
            let reference = rollout.reference_adiabatic[k];
            writeln!(
                out,
                "| {point:?} | {:.2e} | {:.2e} | {mu} | {drift} | {:.6} | {:.2e} |",
                rollout.largest_errors[k],
                rollout.final_errors[k],
                reference.initial,
                reference.largest
            )?;
        }
        Ok(())
    }
}

/// Why training ended, in words.
pub fn stop_words(stop: Stop) -> &'static str {
    match stop {
        Stop::Iterations => "the iterations asked for were done",
        Stop::Target => "the target was reached",
        Stop::Patience => "the held-out error improved no more",
        Stop::Gradient => "the gradient reached its tolerance",
        Stop::Stalled => "no step lowered the loss any more",
        Stop::Interrupted => "interrupted",
    }
}

/// The cells of a certificate's row, under [`CERTIFICATE_HEADINGS`].
pub fn certificate_cells(row: &Row) -> [String; 8] {
    let number = |value: Option<f64>| match value {
        None => "–".to_owned(),
        Some(0.0) => "0".to_owned(),
        Some(v) if v.abs() < 1e4 && v.abs() >= 1e-3 => format!("{v:.3}"),
        Some(v) => format!("{v:.2e}"),
    };
    let samples = match row.ill_conditioned {
        0 => row.samples.to_string(),
        ill => format!("{} ({ill} ill-conditioned)", row.samples),
    };
    let largest = if row.largest.is_none() && row.verdict == Verdict::Violated {
        "NaN".to_owned()
    } else {
        number(row.largest)
    };
    let (limit, headroom) = match row.verdict {
        // Nothing is concluded from it.
        Verdict::Reported => ("–".to_owned(), None),
        _ if row.limit < 1e-3 => (format!("< {:e}", row.limit), row.headroom()),
        _ => (format!("< {}", row.limit), row.headroom()),
    };
    [
        row.law.clone(),
        row.equation.clone(),
        samples,
        largest,
        number(row.median),
        limit,
        headroom.map_or("–".to_owned(), |headroom| format!("{headroom:.1} ×")),
        row.verdict.word().to_owned(),
    ]
}

/// The headings of [`certificate_cells`].
pub const CERTIFICATE_HEADINGS: [&str; 8] =
    ["law", "measured", "samples", "largest", "median", "limit", "headroom", "verdict"];

fn certificate_markdown(certificate: &Certificate) -> String {
    let mut out = format!("| {} |\n|", CERTIFICATE_HEADINGS.join(" | "));
    out.push_str(&"---|".repeat(CERTIFICATE_HEADINGS.len()));
    out.push('\n');
    for row in &certificate.rows {
        // A bar inside a cell would end it.
        let cells = certificate_cells(row).map(|cell| cell.replace('|', "\\|"));
        out.push_str(&format!("| {} |\n", cells.join(" | ")));
    }
    out
}
