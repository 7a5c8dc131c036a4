//! What each plot of a report shows.

use super::declaration::Plot;
use super::plot::{Axis, Legend, Panel, Series, Style};
use super::report::Experiment;
use super::results::{ReferenceRollout, Timings, Trajectories, network_invariant};
use crate::flow::Reference;
use crate::measure::distance;
use crate::network::Model;
use crate::system::{AveragedOscillator, Hamiltonian, System};
use crate::train::TrainingRecord;

/// All that a figure may show.
pub(super) struct Results<'a> {
    pub(super) report: &'a Experiment,
    pub(super) system: &'a System,
    pub(super) time: f64,
    pub(super) timings: &'a Timings,
    pub(super) reference: Option<&'a ReferenceRollout<'a>>,
    pub(super) own: &'a [(String, &'a Model, Trajectories)],
}

/// The file, caption and panels of a plot; None where the scene has not
/// computed what it shows.
pub(super) fn figure(plot: Plot, results: &Results<'_>) -> Option<(String, String, Vec<Panel>)> {
    let Results { report, system, time, timings, reference, own } = *results;
    let comparison = timings.comparison.as_ref();
    let (caption, panels) = match plot {
        Plot::Loss => (
            "Training loss and held-out mean squared error, against iterations and against \
             seconds of training on this machine.",
            loss_panels(report, timings),
        ),
        Plot::Portrait => (
            "The slow plane: reference trajectories over the level sets of the averaged \
             Hamiltonian through their initial points (grey), and the trajectories of each network.",
            portrait_panels(system, reference?, own),
        ),
        Plot::AdiabaticInvariant => (
            "The change of the leading adiabatic invariant: of the system along the reference \
             trajectories, and of each network, μ₀ = 𝔍₀∘ψ⁻¹, along its own.",
            invariant_panels(system, time, reference?, own),
        ),
        Plot::RolloutError => {
            ("Distance of each trajectory from the reference.", error_panels(time, reference?, own))
        }
        Plot::ErrorAgainstTime => (comparison_caption(plot)?, comparison?.trajectory_panels()),
        Plot::Jacobians => (comparison_caption(plot)?, comparison?.jacobian_panels()),
        Plot::Tanh => return None,
    };
    (!panels.is_empty()).then(|| (plot.file().into(), caption.into(), panels))
}

/// The caption of a plot of error against run time.
pub(super) fn comparison_caption(plot: Plot) -> Option<&'static str> {
    match plot {
        Plot::ErrorAgainstTime => Some(
            "Error against run time on this machine, one thread: medians, and lines from quartile \
             to quartile. Lower and further left is better.",
        ),
        Plot::Jacobians => {
            Some("Jacobians of each network: error against run time on this machine, one thread.")
        }
        _ => None,
    }
}

/// The caption of [`Plot::Tanh`].
pub(super) fn tanh_caption() -> String {
    "tanh with sech²: the error of sech² against run time on this machine, one thread.".into()
}

fn loss_panels(report: &Experiment, timings: &Timings) -> Vec<Panel> {
    let mut against_iterations = Vec::new();
    let mut against_seconds = Vec::new();
    for (index, model) in report.models.iter().enumerate() {
        let timing = timings.models.iter().find(|t| t.model == model.name);
        let seconds = |iteration: u64| {
            let points = &timing?.points;
            points.iter().find(|(i, _)| *i == iteration).map(|(_, s)| *s)
        };
        for (kind, style, color) in
            [("loss", Style::Faint, 2 * index + 1), ("held out", Style::Line, 2 * index)]
        {
            let value = |r: &TrainingRecord| {
                if kind == "loss" { Some(r.loss) } else { r.validation }
            };
            let name = format!("{}, {kind}", model.name);
            let points: Vec<_> = model
                .history
                .iter()
                .filter_map(|r| Some((r.iteration as f64, value(r)?)))
                .collect();
            if points.is_empty() {
                continue;
            }
            let timed = model
                .history
                .iter()
                .filter_map(|r| Some((seconds(r.iteration)?, value(r)?)))
                .collect();
            against_iterations.push(Series { name: name.clone(), color, style, points });
            against_seconds.push(Series { name, color, style, points: timed });
        }
    }
    let panel = |x_label: &str, series| Panel {
        title: "Training".into(),
        x_label: x_label.into(),
        y_label: "mean squared error".into(),
        x: Axis::Linear,
        y: Axis::Log,
        square: false,
        legend: Legend::UpperRight,
        series,
    };
    vec![panel("iterations", against_iterations), panel("seconds", against_seconds)]
}

/// The last plane: (q₂, p₂) for the oscillators.
fn slow_plane(dim: usize) -> (usize, usize) {
    (dim / 2 - 1, dim - 1)
}

fn portrait_panels(
    system: &System,
    (request, (reference, _)): &ReferenceRollout<'_>,
    own: &[(String, &Model, Trajectories)],
) -> Vec<Panel> {
    let System::Oscillators(_) = system else {
        return Vec::new();
    };
    let (i, k) = slow_plane(reference.dim);
    let panel = |title: &str, trajectories: &Trajectories, levels: Vec<Series>| {
        let mut series = levels;
        for m in 0..trajectories.count {
            let points = (0..trajectories.len())
                .map(|t| (trajectories.state(t, m)[i], trajectories.state(t, m)[k]))
                .collect();
            series.push(Series { name: String::new(), color: m, style: Style::Dots, points });
        }
        Panel {
            title: title.into(),
            x_label: "q₂".into(),
            y_label: "p₂".into(),
            x: Axis::Linear,
            y: Axis::Linear,
            square: true,
            legend: Legend::UpperRight,
            series,
        }
    };
    let levels = || request.initial.iter().filter_map(|z| level_set(z)).collect::<Vec<_>>();
    let mut panels = vec![panel("Reference", reference, levels())];
    for (name, _, trajectories) in own {
        panels.push(panel(name, trajectories, levels()));
    }
    panels
}

/// The level set of the averaged Hamiltonian through an initial point, traced
/// by its own flow once around.
fn level_set(z: &[f64]) -> Option<Series> {
    const STEPS: usize = 600;
    let system = AveragedOscillator::new(libm::hypot(z[0], z[2]));
    let reference = Reference::new(&system);
    let mut w = vec![z[1], z[3]];
    let mut points = vec![(w[0], w[1])];
    for _ in 0..STEPS {
        reference.flow(&system, &mut w, 0.02).ok()?;
        points.push((w[0], w[1]));
    }
    Some(Series { name: String::new(), color: 6, style: Style::Faint, points })
}

fn invariant_panels(
    system: &System,
    time: f64,
    (request, (reference, _)): &ReferenceRollout<'_>,
    own: &[(String, &Model, Trajectories)],
) -> Vec<Panel> {
    let interval = request.every as f64 * time;
    let panel = |title: String, of: &Trajectories, value: &dyn Fn(usize) -> f64| Panel {
        title,
        x_label: "time".into(),
        y_label: "μ₀ − μ₀(0)".into(),
        x: Axis::Linear,
        y: Axis::Linear,
        square: false,
        legend: Legend::UpperRight,
        series: (0..of.count)
            .map(|m| Series {
                name: String::new(),
                color: m,
                style: Style::Faint,
                points: change(of, m, interval, value),
            })
            .collect(),
    };
    let along_reference = |index: usize| {
        let start = index * reference.dim;
        system.adiabatic_invariant(&reference.values[start..start + reference.dim])
    };
    let mut panels = vec![panel("μ₀ of the system, reference".into(), reference, &along_reference)];
    for (name, model, trajectories) in own {
        if let Some(mu) = network_invariant(model, trajectories) {
            panels.push(panel(format!("μ₀ of {name}, its own"), trajectories, &|i| mu[i]));
        }
    }
    panels
}

/// The change of a quantity along trajectory `m`, against time.
fn change(
    trajectories: &Trajectories,
    m: usize,
    interval: f64,
    value: impl Fn(usize) -> f64,
) -> Vec<(f64, f64)> {
    let initial = value(m);
    (0..trajectories.len())
        .map(|t| (t as f64 * interval, value(t * trajectories.count + m) - initial))
        .collect()
}

fn error_panels(
    time: f64,
    (request, (reference, _)): &ReferenceRollout<'_>,
    own: &[(String, &Model, Trajectories)],
) -> Vec<Panel> {
    own.iter()
        .map(|(name, _, trajectories)| Panel {
            title: format!("Distance from the reference: {name}"),
            x_label: "time".into(),
            y_label: "|z − reference|".into(),
            x: Axis::Linear,
            y: Axis::Log,
            square: false,
            legend: Legend::UpperRight,
            series: (0..trajectories.count)
                .map(|m| Series {
                    name: String::new(),
                    color: m,
                    style: Style::Line,
                    points: (1..trajectories.len())
                        .map(|t| {
                            let error = distance(trajectories.state(t, m), reference.state(t, m));
                            ((t * request.every) as f64 * time, error)
                        })
                        .collect(),
                })
                .collect(),
        })
        .collect()
}
