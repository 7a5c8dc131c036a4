//! Findings on a terminal.

use crate::scene::findings::{Block, Table};
use crate::scene::report::Report;
use comfy_table::{ContentArrangement, LineStyle, Table as Drawing, TableStyle};

/// The summaries of all studies, those of the parts first.
pub fn summary(report: &Report) -> String {
    let mut out = String::new();
    for part in &report.parts {
        out.push_str(&format!("{}: {}\n{}", part.scene.name, part.scene.title, summary(part)));
    }
    for study in &report.studies {
        let findings = &study.findings;
        let blocks = [&findings.results.summary, &findings.timings.summary];
        if blocks.iter().any(|blocks| !blocks.is_empty()) {
            out.push_str(&format!("{}\n", findings.title));
        }
        for block in blocks.into_iter().flatten() {
            match block {
                Block::Heading(heading) => out.push_str(&format!("{heading}\n")),
                Block::Text(text) => out.push_str(&format!("{}\n", text.trim_end())),
                Block::Table(entries) => out.push_str(&table(entries)),
            }
        }
        if findings.verdict == Some(false) {
            out.push_str("DOES NOT HOLD\n");
        }
    }
    out
}

/// A rule above, below and under the headings.
const RULES: TableStyle = TableStyle::new()
    .top_border(LineStyle::none().fill('─').junction('─'))
    .header_separator(LineStyle::none().fill('─').junction('─'))
    .bottom_border(LineStyle::none().fill('─').junction('─'));

/// A table.
pub fn table(table: &Table) -> String {
    let mut drawing = Drawing::new();
    drawing
        .load_style(RULES)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(table.headings().map(str::to_owned).collect::<Vec<_>>());
    for row in table.text_rows() {
        drawing.add_row(row);
    }
    format!("{drawing}\n")
}
