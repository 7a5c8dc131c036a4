//! What a study gives back: tables, figures, a verdict, data.
//!
//! Renderers know these and no study.

use super::figure::Figure;
use crate::measure::timing::Spread;
use crate::words::{factor, magnitude, percent};
use serde_json::Value;

/// The findings of a study.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    /// The heading of its section.
    pub title: String,
    /// Whether what it checks holds; None if it checks nothing.
    pub verdict: Option<bool>,
    /// The results, which do not depend on the machine, its threads or its clock.
    pub results: Section,
    /// The findings that depend on the machine, such as run times.
    pub timings: Section,
    /// The figures of the study.
    pub figures: Vec<Figure>,
    /// The blocks for the end of the report.
    pub appendix: Vec<Block>,
}

/// The findings of a study, with its name.
#[derive(Clone, Debug)]
pub struct StudyFindings {
    /// The key of the study in scene files.
    pub name: &'static str,
    /// The findings of the study: its tables, figures, verdict and data.
    pub findings: Findings,
}

/// A part of the findings.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// The blocks shown in every form of the report.
    pub summary: Vec<Block>,
    /// The further blocks shown in the written report.
    pub details: Vec<Block>,
    /// All of it as data; null where there is none.
    pub data: Value,
}

impl Section {
    /// Whether the section has no blocks, neither in the summary nor in the details.
    pub fn is_empty(&self) -> bool {
        self.summary.is_empty() && self.details.is_empty()
    }
}

/// A piece of a section.
#[derive(Clone, Debug)]
pub enum Block {
    /// A heading within the section.
    Heading(String),
    /// A paragraph, or a list with a line for each item.
    Text(String),
    /// A table of values, with a number format for each column.
    Table(Table),
}

/// A table: columns with a number format each, and rows of values.
#[derive(Clone, Debug, Default)]
pub struct Table {
    columns: Vec<(String, Format)>,
    rows: Vec<Vec<Cell>>,
}

/// How the numbers of a column are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Shortest digits that give the number back.
    Exact,
    /// So many digits behind the point.
    Fixed(usize),
    /// With an exponent, and so many digits behind the point.
    Exponent(usize),
    /// `1.234` between a thousandth and ten thousand, `1.23e-5` elsewhere.
    Magnitude,
    /// Three digits: `12.3`, `0.00123`, `1.23e-5`.
    Significant,
    /// Powers of ten and the like: `16` from 1 on, `1e-3` below.
    Setting,
    /// A limit from above: `< 10`, `< 3e-16`.
    Below,
    /// A factor: `7.6 ×`.
    Factor,
    /// A share, in two digits: `3.4 %`, `0.012 %`.
    Percent,
}

/// A value in a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// No value: the cell is written as a dash.
    Missing,
    /// A text, written as it is.
    Text(String),
    /// A number, written as the column says.
    Number(f64),
    /// A count, written whole.
    Count(u64),
    /// A median with its quartiles, each written as the column says.
    Spread(Spread),
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Cell {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<u64> for Cell {
    fn from(count: u64) -> Self {
        Self::Count(count)
    }
}

impl From<usize> for Cell {
    fn from(count: usize) -> Self {
        Self::Count(count as u64)
    }
}

impl From<Spread> for Cell {
    fn from(spread: Spread) -> Self {
        Self::Spread(spread)
    }
}

impl<T: Into<Self>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Missing, Into::into)
    }
}

/// Three digits: `12.3` or `0.00123` between a thousandth and ten thousand, `1.23e-5` elsewhere.
fn significant(value: f64) -> String {
    let places = 2.0 - libm::floor(libm::log10(value.abs()));
    match (1e-3..1e4).contains(&value.abs()) {
        true => format!("{value:.0$}", places.max(0.0) as usize),
        false => magnitude(value),
    }
}

impl Format {
    /// A number in this format.
    pub fn number(self, value: f64) -> String {
        match self {
            Self::Exact => value.to_string(),
            Self::Fixed(digits) => format!("{value:.digits$}"),
            Self::Exponent(digits) => format!("{value:.digits$e}"),
            Self::Magnitude => magnitude(value),
            Self::Significant => significant(value),
            Self::Setting if value >= 1.0 => value.to_string(),
            Self::Setting => format!("{value:e}"),
            Self::Below if value < 1e-3 => format!("< {value:e}"),
            Self::Below => format!("< {value}"),
            Self::Factor => factor(value),
            Self::Percent => percent(value),
        }
    }

    fn cell(self, cell: &Cell) -> String {
        match cell {
            Cell::Missing => "–".into(),
            Cell::Text(text) => text.clone(),
            Cell::Number(value) => self.number(*value),
            Cell::Count(count) => count.to_string(),
            Cell::Spread(Spread { lower, median, upper }) => {
                let [lower, median, upper] = [lower, median, upper].map(|v| self.number(*v));
                format!("{median} ({lower} – {upper})")
            }
        }
    }
}

impl Table {
    /// A table with these columns, which are headings with number formats, and no rows.
    pub fn new<H: Into<String>>(columns: impl IntoIterator<Item = (H, Format)>) -> Self {
        let columns = columns.into_iter().map(|(heading, format)| (heading.into(), format));
        Self { columns: columns.collect(), rows: Vec::new() }
    }

    /// A table of two columns without headings: names and values.
    pub fn of_facts() -> Self {
        Self::new([("", Format::Exact), ("", Format::Exact)])
    }

    /// Adds a row of a table of facts.
    pub fn fact(&mut self, name: &str, value: impl Into<Cell>) {
        self.push([name.into(), value.into()]);
    }

    /// Adds a row to the table.
    ///
    /// # Panics
    /// When it has not a cell for each column.
    pub fn push(&mut self, row: impl IntoIterator<Item = Cell>) {
        let row: Vec<Cell> = row.into_iter().collect();
        assert_eq!(row.len(), self.columns.len(), "cells of a row");
        self.rows.push(row);
    }

    /// Whether the table has no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The headings of the columns, from left to right.
    pub fn headings(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|(heading, _)| &heading[..])
    }

    /// The rows as text, with the numbers that they are sorted by.
    pub fn cells(&self) -> impl Iterator<Item = Vec<(String, Option<f64>)>> {
        self.rows.iter().zip(self.text_rows()).map(|(row, text)| {
            let numbers = row.iter().map(|cell| match cell {
                Cell::Missing | Cell::Text(_) => None,
                Cell::Number(value) => Some(*value),
                Cell::Count(count) => Some(*count as f64),
                Cell::Spread(spread) => Some(spread.median),
            });
            text.into_iter().zip(numbers).collect()
        })
    }

    /// The rows as text, each cell in the format of its column.
    pub fn text_rows(&self) -> impl Iterator<Item = Vec<String>> {
        self.rows.iter().map(|row| {
            row.iter().zip(&self.columns).map(|(cell, (_, format))| format.cell(cell)).collect()
        })
    }
}
