//! A report as one page of HTML, with its figures in it.

use super::markdown::{facts_of, stages};
use super::svg;
use crate::error::Error;
use crate::measure::certificate::Certificate;
use crate::scene::figure::{Figure, data_file_of};
use crate::scene::findings::{Block, Findings, Section, Table};
use crate::scene::report::Report;
use crate::scene::study::certificate::certificate_table;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use pulldown_cmark::{Event, Parser, Tag, TagEnd};

const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");

/// The study that says whether to trust a training, which is the first thing that is said of one.
const TRUST: &str = "trust";

/// A report as a page: findings first, then figures, tables that can be sorted, how to repeat and to cite it.
/// `citation` is BibTeX.
///
/// # Errors
/// [`Error::Write`] of a figure that cannot be drawn.
pub fn report(report: &Report, citation: &str) -> Result<String, Error> {
    let scene = &report.scene;
    let mut body = html! {
        header {
            h1 { (scene.name) }
            p.subtitle { (scene.title) }
        }
        (verdict(report))
        (table(&facts_of(report)))
    };
    for study in &report.studies {
        // It is said above already.
        let first = study.findings.results.summary.first();
        let said = usize::from(study.name == TRUST && matches!(first, Some(Block::Text(_))));
        body = html! { (body) (of_study(&study.findings, said)?) };
    }
    if !report.parts.is_empty() {
        body = html! {
            (body)
            h2 { "Parts" }
            @for part in &report.parts {
                h3 {
                    a href={ (part.scene.name) "/report.html" } { (part.scene.name) } " "
                    // What checks nothing does not hold.
                    (badge(checks(part).then(|| part.holds())))
                }
                p.subtitle { (part.scene.title) }
                @for study in &part.studies { (blocks(&study.findings.results.summary)) }
            }
        };
    }
    body = html! { (body) (timings(report)?) };
    let folded = report.studies.iter().filter(|study| !study.findings.appendix.is_empty());
    body = html! {
        (body)
        @for study in folded {
            h2 { "Appendix: " (study.findings.title) }
            details {
                summary { "Show" }
                (blocks(&study.findings.appendix))
            }
        }
        (to_repeat(match &report.repeat {
            Some(what) => markdown(&format!(
                "{what} and gyroceptron {}: every number above but the timings comes out the same, bit for bit.",
                env!("CARGO_PKG_VERSION")
            )),
            None => html! {
                pre { "gyroceptron run as-run.toml --out …" }
                p {
                    "With the file " code { "as-run.toml" } " beside this report and gyroceptron "
                    (env!("CARGO_PKG_VERSION"))
                    ": every number above but the timings comes out the same, bit for bit. Seed " (scene.seed) "."
                }
            },
        }))
        (to_cite(citation))
    };
    Ok(page(&scene.name, &body))
}

/// A page of its own: `title` in its head, and no file beside it.
fn page(title: &str, body: &Markup) -> String {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="generator" content={ "gyroceptron " (env!("CARGO_PKG_VERSION")) };
                title { (title) " – gyroceptron" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                main { (body) }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    }
    .into_string()
}

/// A certificate as a page: its verdict first, a table of the laws, how to repeat it. `target` is what was certified.
pub fn certificate(
    target: &str,
    certificate: &Certificate,
    notes: &[String],
    command: &str,
    citation: &str,
) -> String {
    let options = &certificate.options;
    let body = html! {
        header {
            h1 { "Structure certificate: a test on samples" }
            p.subtitle { (target) }
        }
        (of_laws(certificate, notes))
        p.note {
            (options.samples) " points each, " (certificate.sampled_box()) ", seed " (options.seed)
            "; other points are not tested. A ratio is an error over the rounding scale of the computation that made it."
        }
        (to_repeat(html! {
            pre { (command) }
            p { "With gyroceptron " (env!("CARGO_PKG_VERSION")) ": every number above comes out the same, bit for bit." }
        }))
        (to_cite(citation))
    };
    page("Structure certificate", &body)
}

fn to_repeat(what: Markup) -> Markup {
    html! {
        h2 { "To repeat it" }
        (what)
    }
}

fn to_cite(citation: &str) -> Markup {
    html! {
        h2 { "To cite it" }
        details {
            summary { "BibTeX" }
            pre { (citation) }
        }
    }
}

/// The laws of a certificate and the notes beside them, as a part of a page.
pub fn laws(certificate: &Certificate, notes: &[String]) -> String {
    of_laws(certificate, notes).into_string()
}

fn of_laws(certificate: &Certificate, notes: &[String]) -> Markup {
    let class = if certificate.holds() { "verdict holds" } else { "verdict fails" };
    html! {
        div class=(class) { (certificate.summary()) }
        @let all: Vec<String> = notes.iter().cloned().chain(certificate.advice()).collect();
        @if !all.is_empty() {
            ul { @for text in &all { li { (markdown_line(text)) } } }
        }
        (table(&certificate_table(&certificate.rows)))
    }
}

/// Names and values as a table: a part of a page.
pub fn facts<'a>(title: &str, facts: impl IntoIterator<Item = (&'a str, String)>) -> String {
    let mut of = Table::of_facts();
    facts.into_iter().for_each(|(name, value)| of.fact(name, value));
    html! {
        strong { (title) }
        (table(&of))
    }
    .into_string()
}

/// What the whole run found, in a sentence.
fn verdict(report: &Report) -> Markup {
    let studies = |report: &Report| -> Vec<(String, bool)> {
        let of = report.studies.iter().map(|study| &study.findings);
        of.filter_map(|of| Some((of.title.clone(), of.verdict?))).collect()
    };
    let of_parts = report.parts.iter().flat_map(|part| {
        studies(part)
            .into_iter()
            .map(|(title, holds)| (format!("{}: {title}", part.scene.name), holds))
    });
    let all: Vec<_> = studies(report).into_iter().chain(of_parts).collect();
    let failing: Vec<&str> =
        all.iter().filter(|(_, holds)| !holds).map(|(title, _)| &title[..]).collect();
    let trust = judgements(report);
    html! {
        @if !trust.is_empty() {
            @let says = |word: &str, text: &str| text.starts_with(&format!("**{word}"));
            // With care, or for single steps alone, is neither.
            @let class = if trust.iter().any(|(_, text)| says("no", text)) {
                "verdict fails"
            } else if trust.iter().all(|(_, text)| says("yes", text)) {
                "verdict holds"
            } else {
                "verdict"
            };
            div class=(class) {
                @for (name, text) in &trust {
                    @if let Some(name) = name { h3 { (markdown_line(name)) } }
                    p { "Can it be trusted? " (markdown_line(text)) }
                }
            }
        } @else if !failing.is_empty() {
            div.verdict.fails {
                strong {
                    @if failing.len() == 1 { "A check does not hold: " }
                    @else { (failing.len()) " checks do not hold: " }
                }
                (failing.join("; ")) "."
            }
        } @else if all.is_empty() {
            div.verdict { "This scene measures, and checks nothing." }
        } @else {
            div.verdict.holds {
                strong { @if all.len() == 1 { "The check holds: " } @else { "All " (all.len()) " checks hold: " } }
                (all.iter().map(|(title, _)| &title[..]).collect::<Vec<_>>().join("; ")) "."
            }
        }
    }
}

/// Whether to trust each training, with the name of it where there are several.
fn judgements(report: &Report) -> Vec<(Option<&str>, &str)> {
    let summary = report.study(TRUST).map_or(&[][..], |of| &of.results.summary);
    if let Some(Block::Text(text)) = summary.first() {
        return vec![(None, text.trim_end())];
    }
    let (mut out, mut name) = (Vec::new(), None);
    for block in summary {
        match block {
            Block::Heading(heading) => name = Some(&heading[..]),
            Block::Text(text) => out.push((name.take(), text.trim_end())),
            Block::Table(_) => {}
        }
    }
    out
}

/// Whether any study of a run has a verdict.
fn checks(report: &Report) -> bool {
    let own = report.studies.iter().any(|study| study.findings.verdict.is_some());
    own || report.parts.iter().any(checks)
}

fn badge(verdict: Option<bool>) -> Markup {
    html! {
        @match verdict {
            None => {},
            Some(true) => span.badge.holds { "holds" },
            Some(false) => span.badge.fails { "does not hold" },
        }
    }
}

/// A study, but for so many of its first blocks.
fn of_study(findings: &Findings, said: usize) -> Result<Markup, Error> {
    let Findings { title, verdict, results, figures, .. } = findings;
    if results.is_empty() && figures.is_empty() {
        return Ok(html! {});
    }
    Ok(html! {
        section {
            h2 { (title) " " (badge(*verdict)) }
            (blocks(&results.summary[said.min(results.summary.len())..]))
            (of_figures(figures, "")?)
            (blocks(&results.details))
        }
    })
}

/// The part of the report that differs from machine to machine.
fn timings(report: &Report) -> Result<Markup, Error> {
    let mut out = html! {
        h2 { "Timings on this machine" }
        p { (report.machine.to_string()) }
    };
    let section = |title: &str, section: &Section| {
        html! {
            h3 { (title) }
            (blocks(&section.summary))
            (blocks(&section.details))
        }
    };
    for study in report.studies.iter().filter(|study| !study.findings.timings.is_empty()) {
        out = html! { (out) (section(&study.findings.title, &study.findings.timings)) };
    }
    for part in &report.parts {
        let timed = part.studies.iter().map(|study| &study.findings);
        for Findings { title, timings, figures, .. } in
            timed.filter(|of| !of.timings.summary.is_empty())
        {
            let folder = format!("{}/", part.scene.name);
            out = html! {
                (out)
                h3 { (part.scene.name) ": " (title) }
                (blocks(&timings.summary))
                (of_figures(figures, &folder)?)
            };
        }
    }
    if !report.stages.is_empty() {
        let stages = stages(&report.stages);
        out = html! {
            (out)
            h3 { "What was computed" }
            details {
                summary { "Show" }
                (table(&stages))
            }
        };
    }
    Ok(out)
}

/// The HTML of a list of headings, texts and tables.
fn blocks(blocks: &[Block]) -> Markup {
    html! {
        @for block in blocks {
            @match block {
                Block::Heading(heading) => h3 { (markdown_line(heading)) },
                Block::Text(text) => (markdown(text)),
                Block::Table(of) => (table(of)),
            }
        }
    }
}

/// A table whose headings sort it.
fn table(of: &Table) -> Markup {
    let headings: Vec<&str> = of.headings().collect();
    let has_headings = headings.iter().any(|heading| !heading.is_empty());
    html! {
        div.scroll {
            table {
                @if has_headings {
                    thead { tr {
                        @for heading in &headings { th scope="col" { (markdown_line(heading)) } }
                    } }
                }
                tbody {
                    @for row in of.cells() {
                        tr {
                            @for (column, (text, number)) in row.iter().enumerate() {
                                @match (column, number) {
                                    (0, None) => th scope="row" { (markdown_line(text)) },
                                    (_, None) => td { (markdown_line(text)) },
                                    (_, Some(number)) if number.is_nan() => td.number { (text) },
                                    // JavaScript reads the word.
                                    (_, Some(number)) if number.is_infinite() => {
                                        @let word = if *number > 0.0 { "Infinity" } else { "-Infinity" };
                                        td.number data-value=(word) { (text) }
                                    },
                                    (_, Some(number)) => td.number data-value=(number) { (text) },
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn of_figures(figures: &[Figure], folder: &str) -> Result<Markup, Error> {
    let mut out = html! {};
    for figure in figures {
        let file = std::path::PathBuf::from(figure.file());
        let (drawing, panels) = svg::drawing(figure).map_err(|e| Error::write(&file, e))?;
        let panels = serde_json::to_string(&panels).map_err(|e| Error::write(&file, e))?;
        // What stands before the element is no part of a page.
        let begin = drawing.find("<svg").unwrap_or(0);
        let drawing = dots_together(&drawing[begin..]);
        let width: f64 =
            value_of(&drawing, " width").and_then(|text| text.parse().ok()).unwrap_or(0.0);
        // Letters stay legible: what is wider than the window scrolls.
        let own = format!("<svg aria-hidden=\"true\" style=\"min-width:{:.0}px\" ", 0.7 * width);
        let drawing = drawing.replacen("<svg ", &own, 1);
        let data = format!("{folder}{}", data_file_of(figure.name));
        out = html! {
            (out)
            figure {
                div.plot tabindex="0" role="group" aria-label=(figure.caption) data-panels=(panels) {
                    (PreEscaped(drawing))
                }
                div.readout aria-hidden="true" {}
                figcaption {
                    (markdown_line(&figure.caption)) " (" a href=(data) { "numbers as CSV" } "; "
                    a href={ (folder) (figure.file()) } { "figure as SVG" } ")"
                    span.help {
                        ". A double click or + enlarges it, − makes it smaller, 0 shows all of it, the arrows move it."
                    }
                }
            }
        };
    }
    Ok(out)
}

/// Markdown as HTML: tags in it are text, and links are their words, since names of files are no addresses.
fn markdown(text: &str) -> Markup {
    let is_link = |event: &Event<'_>| {
        let start = matches!(event, Event::Start(Tag::Link { .. } | Tag::Image { .. }));
        start || matches!(event, Event::End(TagEnd::Link | TagEnd::Image))
    };
    let events = Parser::new(text).filter(|event| !is_link(event)).map(|event| match event {
        Event::Html(tag) | Event::InlineHtml(tag) => Event::Text(tag),
        other => other,
    });
    let mut out = String::new();
    pulldown_cmark::html::push_html(&mut out, events);
    PreEscaped(out)
}

/// A line of Markdown, which is no paragraph of its own.
fn markdown_line(text: &str) -> Markup {
    let PreEscaped(made) = markdown(text);
    let line = made.trim().strip_prefix("<p>").and_then(|text| text.strip_suffix("</p>"));
    match line {
        Some(line) if !line.contains("<p>") => PreEscaped(line.to_owned()),
        // What would be a list, or a heading, is a cell as it stands.
        _ => html! { (text) },
    }
}

/// The drawing with all dots of a colour that follow one another as one path: a tenth of the length.
fn dots_together(svg: &str) -> String {
    let (mut out, mut last) = (String::with_capacity(svg.len() / 4), "");
    for line in svg.lines() {
        let dot = dot(line);
        match dot {
            Some((_, color)) if color == last => {}
            _ => {
                if !last.is_empty() {
                    out += "\"/>\n";
                }
                last = dot.map_or("", |(_, color)| color);
                match dot {
                    Some((_, color)) => {
                        out += &format!(
                            "<path fill=\"none\" stroke=\"{color}\" stroke-width=\"2\" stroke-linecap=\"round\" d=\""
                        );
                    }
                    None => out = out + line + "\n",
                }
            }
        }
        if let Some(([x, y], _)) = dot {
            out += &format!("M{x} {y}h0");
        }
    }
    out
}

/// The place and the colour of a line that is a dot.
fn dot(line: &str) -> Option<([&str; 2], &str)> {
    let line = line.trim().strip_prefix("<circle ")?;
    let value = |name: &str| value_of(line, name);
    if value(" r")? != "1" || value("opacity")? != "1" {
        return None;
    }
    Some(([value("cx")?, value("cy")?], value("fill")?))
}

/// The value of the first attribute of this name.
fn value_of<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    let (_, rest) = text.split_once(&format!("{name}=\""))?;
    rest.split('"').next()
}
