//! Findings on a terminal.

use crate::scene::findings::{Block, Table};
use crate::scene::report::Report;
use comfy_table::{ContentArrangement, LineStyle, Table as Drawing, TableStyle};

/// The summaries of all studies, those of the parts first. Tables are at most `width` characters
/// wide.
pub fn summary(report: &Report, width: usize) -> String {
    let mut out = String::new();
    for part in &report.parts {
        let of_part = summary(part, width);
        out.push_str(&format!("{}: {}\n{of_part}", part.scene.name, part.scene.title));
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
                Block::Table(entries) => out.push_str(&table(entries, width)),
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

/// Cells of so many letters and more are text, which may be broken between words.
const TEXT: usize = 30;

/// A table at most `width` characters wide. Headings and texts are broken between words; if that is
/// not enough, a row becomes a column, or a table of its own.
pub fn table(table: &Table, width: usize) -> String {
    let grid = Grid {
        headings: table.headings().map(str::to_owned).collect(),
        rows: table.text_rows().collect(),
    };
    if let Some(fitting) = grid.fitted(width).or_else(|| grid.turned().fitted(width)) {
        return fitting;
    }
    let single = grid.rows.iter().map(|row| {
        let one = Grid { headings: grid.headings.clone(), rows: vec![row.clone()] }.turned();
        one.fitted(width).unwrap_or_else(|| one.drawn())
    });
    single.collect()
}

/// The text of a table.
struct Grid {
    headings: Vec<String>,
    rows: Vec<Vec<String>>,
}

/// The letters of the longest line.
fn breadth(text: &str) -> usize {
    text.lines().map(|line| line.chars().count()).max().unwrap_or(0)
}

/// The words of a text in lines of so many letters at most, where no word is longer.
fn broken(text: &str, width: usize) -> String {
    let mut out = String::new();
    let mut column = 0;
    for word in text.split(' ') {
        let letters = word.chars().count();
        if column > 0 && column + 1 + letters > width {
            out.push('\n');
            column = 0;
        } else if column > 0 {
            out.push(' ');
            column += 1;
        }
        out.push_str(word);
        column += letters;
    }
    out
}

impl Grid {
    fn drawn(&self) -> String {
        let mut drawing = Drawing::new();
        drawing
            .load_style(RULES)
            .set_content_arrangement(ContentArrangement::Disabled)
            .set_header(self.headings.clone());
        for row in &self.rows {
            drawing.add_row(row.clone());
        }
        format!("{drawing}\n")
    }

    /// Each column of the table as a row, its heading first.
    fn turned(&self) -> Self {
        let mut columns = self.headings.iter().enumerate().map(|(k, heading)| {
            let cells = self.rows.iter().map(|row| row[k].clone());
            std::iter::once(heading.clone()).chain(cells).collect::<Vec<_>>()
        });
        Self { headings: columns.next().unwrap_or_default(), rows: columns.collect() }
    }

    /// Drawn with lines of so many letters at most; None where words are too long.
    fn fitted(&self, width: usize) -> Option<String> {
        let drawn = self.drawn();
        let natural = breadth(&drawn);
        if natural <= width {
            return Some(drawn);
        }
        let column = |k: usize| self.rows.iter().map(move |row| &row[k]);
        let longest_word = |text: &str| text.split(' ').map(|w| w.chars().count()).max();
        let (mut widths, mut least) = (Vec::new(), Vec::new());
        for (k, heading) in self.headings.iter().enumerate() {
            let cells = column(k).map(|cell| cell.chars().count()).max().unwrap_or(0);
            widths.push(cells.max(heading.chars().count()));
            let unbroken = column(k)
                .map(|cell| match cell.chars().count() {
                    letters if letters < TEXT => letters,
                    _ => longest_word(cell).unwrap_or(0),
                })
                .max();
            least.push(unbroken.unwrap_or(0).max(longest_word(heading).unwrap_or(0)));
        }
        let frame = natural - widths.iter().sum::<usize>().min(natural);
        while frame + widths.iter().sum::<usize>() > width {
            let wide = (0..widths.len()).filter(|k| widths[*k] > least[*k]);
            let widest = wide.max_by_key(|k| widths[*k])?;
            widths[widest] -= 1;
        }
        let lines = |row: &[String]| -> Vec<String> {
            row.iter().zip(&widths).map(|(cell, width)| broken(cell, *width)).collect()
        };
        let fitting = Self {
            headings: lines(&self.headings),
            rows: self.rows.iter().map(|row| lines(row)).collect(),
        };
        Some(fitting.drawn())
    }
}
