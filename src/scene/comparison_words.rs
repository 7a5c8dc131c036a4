//! Comparisons as tables, curves and sentences.

use super::comparison::{ALONE, BY_HAND, Comparison, Contest, DUALS, TOGETHER, TanhWay};
use super::plot::{Axis, Legend, Panel, Series, Style};
use crate::measure::{Spread, WorkPrecision};
use std::fmt::Write;

/// `1.23` of a number between a thousandth and a thousand, `1.23e-5` of others.
fn short(value: f64) -> String {
    if (1e-3..1e3).contains(&value) { format!("{value:.3}") } else { format!("{value:.2e}") }
}

fn error_cell(own: &WorkPrecision) -> String {
    match (own.error, &own.failure) {
        (Some(error), _) => format!("{error:.2e}"),
        (None, Some(reason)) => format!("no result: {}", reason.replace('|', "\\|")),
        (None, None) => "no result".into(),
    }
}

fn spread_cell(spread: Option<Spread>, factor: f64) -> String {
    spread.map_or("–".into(), |spread| {
        let Spread { lower, median, upper } = spread.scaled(factor);
        format!("{} ({} – {})", short(median), short(lower), short(upper))
    })
}

const MICRO: f64 = 1e6;
const NANO: f64 = 1e9;

/// A table of a contest; `setting` heads the column of what is varied.
fn table(own: &[WorkPrecision], setting: &str, time: &str) -> String {
    let mut out = format!("| method | {setting} | error | {time} |\n|---|---|---|---|\n");
    for entry in own {
        let varied = entry
            .setting
            .map_or("–".into(), |v| if v >= 1.0 { format!("{v}") } else { format!("{v:e}") });
        let _ = writeln!(
            out,
            "| {} | {varied} | {} | {} |",
            entry.name,
            error_cell(entry),
            spread_cell(entry.seconds, MICRO)
        );
    }
    out
}

/// The fastest of those that err by no more than `error`.
fn fastest<'a>(
    entries: impl Iterator<Item = &'a WorkPrecision>,
    error: f64,
) -> Option<(&'a WorkPrecision, f64)> {
    entries
        .filter(|own| own.error.is_some_and(|e| e <= error))
        .filter_map(|own| Some((own, own.seconds?.median)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

/// `steps` are what the setting counts.
fn with_setting(own: &WorkPrecision, steps: &str) -> String {
    match own.setting {
        Some(1.0) => format!("{} with 1 {}", own.name, steps.replacen("steps", "step", 1)),
        Some(count) => format!("{} with {count} {steps}", own.name),
        None => own.name.clone(),
    }
}

/// Who is faster, and how many times.
fn ratio(own: f64, other: f64) -> String {
    if own <= other {
        format!("the network is {:.1} times faster", other / own)
    } else {
        format!("the network is {:.1} times slower", own / other)
    }
}

/// Who wins: each network against the fastest integrator that is at least as
/// accurate, then the fastest of all for each power of ten.
///
/// A network that errs by half the `size` of the points or more is compared with
/// nothing: any integrator, at any step, would do.
fn winners(contest: &Contest, steps: &str) -> String {
    let mut out = String::new();
    let Contest { size, reference_error, ways: own, .. } = contest;
    let lost = 0.5 * size;
    let integrators = || own.iter().filter(|entry| entry.setting.is_some());
    for entry in own {
        let Some(network) = entry.name.strip_suffix(TOGETHER) else { continue };
        let network = network.trim_end_matches([',', ' ']);
        let alone = own.iter().find(|other| other.name == format!("{network}, {ALONE}"));
        let (Some(error), Some(together), Some(alone)) =
            (entry.error, entry.seconds, alone.and_then(|other| other.seconds))
        else {
            let _ = writeln!(out, "- `{network}` left the finite numbers.");
            continue;
        };
        let (together, alone) = (together.median, alone.median);
        let _ = write!(
            out,
            "- `{network}` errs by {error:.1e} and takes {} µs, {} one alone: ",
            short(together * MICRO),
            short(alone * MICRO)
        );
        let sentence = match fastest(integrators(), error) {
            _ if error >= lost => format!(
                "it has lost the trajectories, whose points are of size {size:.1}, and there is \
                 nothing to compare."
            ),
            None => "no integrator tried is as accurate.".into(),
            Some((best, seconds)) => format!(
                "{} is at least as accurate in {} µs; {} with its trajectories together, \
                 {} with one alone.",
                with_setting(best, steps),
                short(seconds * MICRO),
                ratio(together, seconds),
                ratio(alone, seconds).trim_start_matches("the network is ")
            ),
        };
        let _ = writeln!(out, "{sentence}");
    }
    let mut last: Option<(String, i32, i32)> = None;
    let mut lines = Vec::new();
    for exponent in (-15..=0).rev() {
        let error = libm::exp10(exponent.into());
        if error < *reference_error {
            break;
        }
        let Some((best, seconds)) = fastest(own.iter(), error.min(lost)) else { break };
        let name = format!("{}, {} µs", with_setting(best, steps), short(seconds * MICRO));
        match &mut last {
            Some((same, _, to)) if *same == name => *to = exponent,
            _ => lines.extend(last.replace((name, exponent, exponent))),
        }
    }
    lines.extend(last);
    if !lines.is_empty() {
        let _ = writeln!(
            out,
            "- Fastest of all for an error of at most (the reference itself errs by \
             {reference_error:.0e}: what is below is not told apart)"
        );
        for (name, from, to) in lines {
            let range =
                if from == to { format!("1e{from}") } else { format!("1e{from} … 1e{to}") };
            let _ = writeln!(out, "  - {range}: {name}");
        }
    }
    out
}

pub(super) const HOW: &str = "One thread; medians of repeated runs, in turn, and in brackets their quartiles. \
                   Integrators move one trajectory after another, with the processor's fused \
                   multiply-adds but not its vectors; networks both several trajectories in the \
                   lanes of vectors, of which fewer than eight leave some empty, and each one \
                   alone. Data and training are not counted.";

impl Comparison {
    /// The sentences alone.
    pub(super) fn words(&self) -> String {
        let mut out = String::new();
        for (title, contest, steps) in [
            ("One step", &self.one_step, "steps"),
            ("Roll-out", &self.rollout, "steps between two states"),
        ] {
            let Some(contest) = contest else { continue };
            let Contest { trajectories, time, .. } = contest;
            let _ = writeln!(
                out,
                "{title} of time {time}, {trajectories} trajectories, µs for one and unit time:\n\n{}",
                winners(contest, steps)
            );
        }
        for contest in &self.jacobians {
            let _ = writeln!(out, "{}\n", jacobian_words(&contest.model, &contest.ways));
        }
        out
    }

    /// The section of the report.
    pub(super) fn markdown(&self) -> String {
        let time = "µs a trajectory and unit time";
        let mut out = format!("\n## Error against run time\n\n{HOW}\n\n{}", self.words());
        if let Some(contest) = &self.one_step {
            let table = table(&contest.ways, "steps", time);
            let _ = writeln!(
                out,
                "### One step of time {}\n\nThe error is the root mean square distance from the reference.\
                 \n\n{table}",
                contest.time
            );
        }
        if let Some(contest) = &self.rollout {
            let table = table(&contest.ways, "steps between two states", time);
            let _ = writeln!(
                out,
                "### Roll-out of time {}\n\nThe error is the root mean square distance from the reference, \
                 over all states kept.\n\n{table}",
                contest.time
            );
        }
        for contest in &self.jacobians {
            let table = table(&contest.ways, "step h", "µs a Jacobian");
            let _ = writeln!(
                out,
                "### Jacobians of `{}`\n\nThe error is the largest difference from double-double \
                 precision over the largest entry.\n\n{table}",
                contest.model
            );
        }
        out
    }

    pub(super) fn trajectory_panels(&self) -> Vec<Panel> {
        [("One step", &self.one_step), ("Roll-out", &self.rollout)]
            .into_iter()
            .filter_map(|(title, contest)| Some((title, contest.as_ref()?)))
            .map(|(title, contest)| {
                panel(
                    format!("{title} of time {}: error against run time", contest.time),
                    "µs a trajectory and unit time",
                    "rms distance from the reference",
                    Legend::LowerLeft,
                    curves(&contest.ways, MICRO),
                )
            })
            .collect()
    }

    pub(super) fn jacobian_panels(&self) -> Vec<Panel> {
        self.jacobians
            .iter()
            .map(|contest| {
                panel(
                    format!("Jacobians of {}", contest.model),
                    "µs a Jacobian",
                    "relative error",
                    Legend::Middle,
                    curves(&contest.ways, MICRO),
                )
            })
            .collect()
    }
}

fn jacobian_words(model: &str, ways: &[WorkPrecision]) -> String {
    let find = |name: &str| ways.iter().find(|own| own.name == name);
    let best = ways
        .iter()
        .filter(|own| own.setting.is_some() && own.error.is_some())
        .min_by(|a, b| a.error.unwrap_or(f64::NAN).total_cmp(&b.error.unwrap_or(f64::NAN)));
    let figures = |own: Option<&WorkPrecision>| {
        own.and_then(|own| Some((own.error?, own.seconds?.median, own.setting)))
    };
    let (Some(duals), Some(hand), Some(differences)) =
        (figures(find(DUALS)), figures(find(BY_HAND)), figures(best))
    else {
        return format!("Jacobians of `{model}`: not all ways gave a result.");
    };
    let micro = |seconds: f64| short(seconds * MICRO);
    format!(
        "Jacobians of `{model}`: duals err by {:.0e} in {} µs, the chain rule written out by hand \
         by {:.0e} in {} µs, {}; central differences at their best step, {:e}, err by {:.0e} in \
         {} µs, {:.1} times as long as duals.",
        duals.0,
        micro(duals.1),
        hand.0,
        micro(hand.1),
        if hand.1 < duals.1 {
            format!("{:.1} times faster", duals.1 / hand.1)
        } else {
            format!("{:.1} times slower", hand.1 / duals.1)
        },
        differences.2.unwrap_or(f64::NAN),
        differences.0,
        micro(differences.1),
        differences.1 / duals.1
    )
}

/// The section on tanh.
pub(super) fn tanh_markdown(ways: &[TanhWay]) -> String {
    let mut out = String::from(
        "\n## tanh and sech²\n\nOne thread; medians of repeated runs, in turn, and in brackets \
         their quartiles. Errors are the largest seen, against double-double precision.\n\n\
         | by | tanh, ulp | sech², relative | ns a value, both |\n|---|---|---|---|\n",
    );
    for way in ways {
        let _ = writeln!(
            out,
            "| {} | {:.2} | {} | {} |",
            way.sech2.name,
            way.tanh_ulps,
            error_cell(&way.sech2),
            spread_cell(way.sech2.seconds, NANO)
        );
    }
    let all = || ways.iter().map(|way| &way.sech2);
    if let Some((best, seconds)) = fastest(all(), f64::INFINITY) {
        let ns = short(seconds * NANO);
        let accurate = all()
            .filter(|own| own.error.is_some())
            .min_by(|a, b| a.error.unwrap_or(f64::NAN).total_cmp(&b.error.unwrap_or(f64::NAN)));
        let accurate = accurate.map_or("none", |own| &own.name);
        let _ =
            writeln!(out, "\nFastest: {}, {ns} ns; most accurate sech²: {accurate}.", best.name);
    }
    out
}

/// A point for each way.
pub(super) fn tanh_panels(ways: &[TanhWay]) -> Vec<Panel> {
    let own: Vec<WorkPrecision> = ways.iter().map(|way| way.sech2.clone()).collect();
    vec![panel(
        "tanh and sech²: error against run time".into(),
        "ns a value",
        "relative error of sech²",
        Legend::Middle,
        curves(&own, NANO),
    )]
}

fn panel(
    title: String,
    x_label: &str,
    y_label: &str,
    legend: Legend,
    series: Vec<Series>,
) -> Panel {
    Panel {
        legend,
        title,
        x_label: x_label.into(),
        y_label: y_label.into(),
        x: Axis::Log,
        y: Axis::Log,
        square: false,
        series,
    }
}

/// A curve for each name, with a line from quartile to quartile at each point.
fn curves(own: &[WorkPrecision], factor: f64) -> Vec<Series> {
    let mut names: Vec<&str> = Vec::new();
    let mut bars = Vec::new();
    let mut curves: Vec<Series> = Vec::new();
    for entry in own {
        let (Some(error), Some(spread)) = (entry.error, entry.seconds) else { continue };
        let Spread { lower, median, upper } = spread.scaled(factor);
        let color = names.iter().position(|name| *name == entry.name).unwrap_or_else(|| {
            names.push(&entry.name);
            curves.push(Series {
                name: entry.name.clone(),
                color: names.len() - 1,
                style: Style::Marked,
                points: Vec::new(),
            });
            names.len() - 1
        });
        curves[color].points.push((median, error));
        let points = vec![(lower, error), (upper, error)];
        bars.push(Series { name: String::new(), color, style: Style::Line, points });
    }
    bars.into_iter().chain(curves).collect()
}
