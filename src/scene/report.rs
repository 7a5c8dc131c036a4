//! What a run found: as data, as Markdown, as JSON.

use super::comparison::{Comparison, TanhWay};
use super::declaration::Scene;
use crate::flow::Pairs;
use crate::measure::{Certificate, Drift, Row, Verdict, disturbing_resonance};
use crate::network::Architecture;
use crate::system::Hamiltonian;
use crate::train::{Outcome, Stop, TrainingRecord};
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
    /// What it found, where it has a system of its own.
    #[serde(flatten)]
    pub experiment: Option<Experiment>,
    /// Error against run time of tanh and sech²; the times are not here.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tanh: Vec<TanhWay>,
    /// The reports of its parts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<Report>,
}

/// The results of learning a flow map.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Experiment {
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
    /// Error against run time; the times are not here.
    pub error_against_time: Option<Comparison>,
    /// What was computed, and how often.
    pub evaluations: Evaluations,
}

/// How often what was evaluated: a scene computes what it names and nothing else.
/// Runs that only take times are not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Evaluations {
    /// The equations of motion, for the pairs.
    pub of_data: u64,
    /// Loss and gradient, a pair each.
    pub loss_and_gradient: u64,
    /// The curvature diagonal, a pair each.
    pub curvature: u64,
    /// The held-out error in training, a pair each.
    pub held_out: u64,
    /// The equations of motion, for the reference trajectories.
    pub of_reference_rollout: u64,
    /// The networks, for their trajectories.
    pub rollout: u64,
    /// Measurements of a law at a point: with the Jacobians, the only work over
    /// dual numbers.
    pub certificate: u64,
    /// Jacobians over dual numbers.
    pub jacobians: u64,
}

impl Evaluations {
    pub(super) fn of_training(
        &mut self,
        outcome: &Outcome,
        pairs: &Pairs,
        held_out: Option<&Pairs>,
    ) {
        let count = pairs.len() as u64;
        let last = outcome.history[outcome.history.len() - 1];
        let validated = outcome.history.iter().filter(|r| r.validation.is_some()).count();
        self.loss_and_gradient += last.evaluations * count;
        self.curvature += outcome.curvatures * count;
        self.held_out += (validated * held_out.map_or(0, Pairs::len)) as u64;
    }

    /// What there is to count, the name first.
    pub fn rows(&self) -> Vec<(&'static str, u64)> {
        [
            ("equations of motion, for the pairs", self.of_data),
            ("loss and gradient of a pair", self.loss_and_gradient),
            ("curvature diagonal of a pair", self.curvature),
            ("held-out error of a pair", self.held_out),
            ("equations of motion, for the reference trajectories", self.of_reference_rollout),
            ("network, for its trajectories", self.rollout),
            ("law at a point, for the certificate", self.certificate),
            ("Jacobian over dual numbers", self.jacobians),
        ]
        .into_iter()
        .filter(|(_, count)| *count > 0)
        .collect()
    }
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
        let mut own = self.models().iter().filter_map(|m| m.certificate.as_ref());
        own.all(Certificate::holds) && self.parts.iter().all(Report::holds)
    }

    /// The networks; none where the scene has no system of its own.
    pub fn models(&self) -> &[ModelReport] {
        self.experiment.as_ref().map_or(&[], |own| &own.models)
    }

    /// How many times smaller than the rotation's a model's held-out error is.
    pub fn improvement(&self, model: &ModelReport) -> Option<f64> {
        Some(self.experiment.as_ref()?.rotation_error? / model.best.validation?)
    }

    /// The report as Markdown; `timings` is the section that differs from
    /// machine to machine, `figures` are the files beside it.
    pub fn markdown(&self, timings: &str, figures: &[(String, String)]) -> String {
        let mut out = String::new();
        let text = &mut out;
        // Writing to a string cannot fail.
        let _ = self.write_head(text);
        for model in self.models() {
            let _ = self.write_model(text, model);
        }
        let _ = self.write_parts(text);
        let _ = self.write_evaluations(text);
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
        if let Some(own) = &self.experiment {
            writeln!(
                out,
                "| pairs | {} for training, {} held out; SHA-256 `{}…` |",
                own.training_pairs,
                own.held_out_pairs,
                &own.data_digest[..16.min(own.data_digest.len())]
            )?;
            writeln!(
                out,
                "| reference flow | Gauss–Legendre, 12 stages; largest difference of two resolutions {:.1e} |",
                own.reference_error
            )?;
            if let Some(error) = own.rotation_error {
                writeln!(
                    out,
                    "| limiting rotation alone | held-out mean squared error {error:.3e} |"
                )?;
            }
        }
        for model in self.models() {
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

    fn write_parts(&self, out: &mut String) -> std::fmt::Result {
        if self.parts.is_empty() {
            return Ok(());
        }
        writeln!(out, "\n## Parts\n")?;
        writeln!(
            out,
            "| part | network | parameters | held-out mean squared error | the limiting rotation's / its |\n\
             |---|---|---|---|---|"
        )?;
        for part in &self.parts {
            let name = &part.scene.name;
            for model in part.models() {
                let number = |v: Option<f64>| v.map_or("–".into(), |v| format!("{v:.3e}"));
                writeln!(
                    out,
                    "| [{name}]({name}/report.md) | `{}` | {} | {} | {} |",
                    model.name,
                    model.parameters,
                    number(model.best.validation),
                    part.improvement(model).map_or("–".into(), |v| format!("{v:.2}"))
                )?;
            }
        }
        Ok(())
    }

    fn write_evaluations(&self, out: &mut String) -> std::fmt::Result {
        let Some(own) = &self.experiment else {
            return Ok(());
        };
        writeln!(out, "\n## What was computed\n\n| what | how often |\n|---|---|")?;
        for (what, count) in own.evaluations.rows() {
            writeln!(out, "| {what} | {count} |")?;
        }
        if own.error_against_time.is_some() {
            writeln!(
                out,
                "\nError against run time runs its contestants besides, as often as their times ask \
                 for."
            )?;
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
            self.experiment
                .as_ref()
                .and_then(|own| own.rollout_reference_error)
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
