//! A report as Markdown.

use crate::layer::CircleAction;
use crate::scene::figure::{Figure, data_file_of};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::log::Stage;
use crate::scene::report::Report;
use std::fmt::{Result, Write};

/// The report of a run; its figures are files beside it.
pub fn report(report: &Report) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = write_report(&mut out, report);
    out
}

fn write_report(out: &mut String, report: &Report) -> Result {
    let scene = &report.scene;
    let version = env!("CARGO_PKG_VERSION");
    writeln!(out, "# {}\n\n{}", scene.name, scene.title)?;
    let facts = facts_of(report);
    // A report that says itself how to repeat it begins with what it found.
    if report.repeat.is_none() {
        writeln!(out)?;
        write_table(out, &facts)?;
    }
    for study in &report.studies {
        let Findings { title, verdict, results, figures, .. } = &study.findings;
        let verdict = match verdict {
            None => "",
            Some(true) => ": holds",
            Some(false) => ": DOES NOT HOLD",
        };
        if results.is_empty() && figures.is_empty() {
            continue;
        }
        writeln!(out, "\n## {title}{verdict}")?;
        write_section(out, results)?;
        write_figures(out, figures, "")?;
    }
    if !report.parts.is_empty() {
        writeln!(out, "\n## Parts")?;
    }
    for part in &report.parts {
        let name = &part.scene.name;
        writeln!(out, "\n### [{name}]({name}/report.md)\n\n{}", part.scene.title)?;
        for study in &part.studies {
            write_blocks(out, &study.findings.results.summary)?;
        }
    }
    write_timings(out, report)?;
    for study in &report.studies {
        let Findings { title, appendix, .. } = &study.findings;
        if !appendix.is_empty() {
            writeln!(out, "\n## Appendix: {title}")?;
            write_blocks(out, appendix)?;
        }
    }
    if let Some(what) = &report.repeat {
        writeln!(out, "\n## To repeat it\n")?;
        write_table(out, &facts)?;
        return writeln!(
            out,
            "\n{what} and gyroceptron {version}: every number above but the timings \
             comes out the same, bit for bit."
        );
    }
    writeln!(
        out,
        "\n## To repeat it\n\n`gyroceptron run as-run.toml --out …` with the file of that name beside \
         this report and gyroceptron {version}: every number above but the timings comes out the \
         same, bit for bit."
    )
}

/// What was run, and by what.
pub(super) fn facts_of(report: &Report) -> Table {
    let scene = &report.scene;
    let mut facts = Table::of_facts();
    facts.fact("scene", format!("`{}`, seed {}", scene.name, scene.seed));
    facts.fact("gyroceptron", env!("CARGO_PKG_VERSION"));
    if let Some(system) = &scene.setup.system {
        let json = serde_json::to_string(system).unwrap_or_default();
        facts.fact("system", format!("`{json}`"));
    }
    if let Some(file) = scene.setup.data.as_ref().and_then(|data| data.file()) {
        facts.fact("pairs of", format!("`{}`", file.pairs.display()));
        let weights: Vec<_> = match file.torus {
            Some(torus) => torus.circles().iter().map(CircleAction::weights).collect(),
            None => vec![file.circle_action.weights()],
        };
        let weights = match weights[..] {
            [one] => format!("{one:?}"),
            _ => format!("{weights:?}"),
        };
        facts.fact("circle action, ε", format!("{weights}, {}", file.epsilon));
    }
    if let Some(time) = scene.setup.flow_time {
        facts.fact("flow time", time.to_string());
    }
    facts
}

/// The part of the report that differs from machine to machine.
fn write_timings(out: &mut String, report: &Report) -> Result {
    writeln!(out, "\n## Timings on this machine\n\n{}", report.machine)?;
    for study in &report.studies {
        if !study.findings.timings.is_empty() {
            writeln!(out, "\n### {}", study.findings.title)?;
            write_section(out, &study.findings.timings)?;
        }
    }
    for part in &report.parts {
        let name = &part.scene.name;
        for study in &part.studies {
            let Findings { title, timings, figures, .. } = &study.findings;
            if !timings.summary.is_empty() {
                writeln!(out, "\n### {name}: {title}\n\n{}", part.scene.title)?;
                write_blocks(out, &timings.summary)?;
                write_figures(out, figures, &format!("{name}/"))?;
            }
        }
    }
    if !report.stages.is_empty() {
        writeln!(out, "\n### What was computed")?;
        writeln!(out)?;
        write_table(out, &stages(&report.stages))?;
    }
    Ok(())
}

/// A row for each stage, a column for all that any of them computed.
pub(super) fn stages(stages: &[Stage]) -> Table {
    type Count = fn(&Stage) -> u64;
    let counts: [(&str, Count); 6] = [
        ("equations of motion", |s| s.work.vector_fields),
        ("network at a point", |s| s.work.evaluations),
        ("loss of a pair", |s| s.work.losses),
        ("loss and gradient of a pair", |s| s.work.gradients),
        ("curvature diagonal of a pair", |s| s.work.curvatures),
        ("Jacobian at a point", |s| s.work.jacobians),
    ];
    let any = |(_, count): &(&str, Count)| stages.iter().any(|stage| count(stage) > 0);
    let counts: Vec<_> = counts.into_iter().filter(any).collect();
    let headings = ["stage", "seconds"].into_iter().chain(counts.iter().map(|(name, _)| *name));
    let mut table = Table::new(headings.map(|heading| (heading, Format::Fixed(2))));
    for stage in stages {
        let counted = counts.iter().map(|(_, count)| Some(count(stage)).filter(|n| *n > 0).into());
        table.push([stage.stage.clone().into(), stage.seconds.into()].into_iter().chain(counted));
    }
    table
}

fn write_section(out: &mut String, section: &Section) -> Result {
    write_blocks(out, &section.summary)?;
    write_blocks(out, &section.details)
}

fn write_blocks(out: &mut String, blocks: &[Block]) -> Result {
    for block in blocks {
        writeln!(out)?;
        match block {
            Block::Heading(heading) => writeln!(out, "#### {heading}")?,
            Block::Text(text) => writeln!(out, "{}", text.trim_end())?,
            Block::Table(table) => write_table(out, table)?,
        }
    }
    Ok(())
}

fn write_figures(out: &mut String, figures: &[Figure], folder: &str) -> Result {
    for figure in figures {
        let caption = &figure.caption;
        let (file, data) = (figure.file(), data_file_of(figure.name));
        writeln!(out, "\n![{caption}]({folder}{file})\n\n{caption} ([data]({folder}{data}))")?;
    }
    Ok(())
}

fn write_table(out: &mut String, table: &Table) -> Result {
    // A bar inside a cell would end it.
    let line = |cells: Vec<String>| format!("| {} |", cells.join(" | "));
    let escaped = |cell: &str| cell.replace('|', "\\|");
    let headings: Vec<_> = table.headings().map(escaped).collect();
    let columns = headings.len();
    writeln!(out, "{}\n|{}", line(headings), "---|".repeat(columns))?;
    for row in table.text_rows() {
        writeln!(out, "{}", line(row.iter().map(|cell| escaped(cell)).collect()))?;
    }
    Ok(())
}
