//! Figures: panels of series, before they are drawn.

use std::fmt::Write;

/// A figure of one or more panels.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Its name in a scene's `plots`, and the stem of its file.
    pub name: &'static str,
    /// The caption, which says what the figure shows.
    pub caption: String,
    /// How many panels stand side by side.
    pub columns: usize,
    /// Whether all panels have the same axes.
    pub same_axes: SameAxes,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
}

impl Figure {
    /// The name of its file in the folder of the run.
    pub fn file(&self) -> String {
        file_of(self.name)
    }

    /// A figure with all panels side by side.
    pub fn in_a_row(name: &'static str, caption: &str, panels: Vec<Panel>) -> Self {
        let (caption, columns) = (caption.to_owned(), panels.len());
        Self { name, caption, columns, same_axes: SameAxes::No, panels }
    }

    /// All points as text: a line for each, with the panel, the series, x and y.
    pub fn csv(&self) -> String {
        let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
        let mut out = String::from("panel,series,x,y\n");
        for panel in &self.panels {
            for (number, series) in panel.series.iter().enumerate() {
                let name = match &series.name[..] {
                    "" => format!("{}", number + 1),
                    name => quoted(name),
                };
                for (x, y) in &series.points {
                    // Writing to a string cannot fail.
                    let _ = writeln!(out, "{},{name},{x:e},{y:e}", quoted(&panel.title));
                }
            }
        }
        out
    }
}

/// The file of the figure of this name.
pub fn file_of(name: &str) -> String {
    format!("{name}.svg")
}

/// The file of the numbers in the figure of this name.
pub fn data_file_of(name: &str) -> String {
    format!("{name}.csv")
}

/// Which axes the panels of a figure have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SameAxes {
    /// Each panel has its own axes.
    #[default]
    No,
    /// All panels have the same axes, as wide as any panel needs them.
    Widest,
    /// All panels have the axes of the first one, widened by at most half if others need it; points
    /// beyond are not drawn.
    First,
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// A solid line through the points.
    Line,
    /// A thin, pale line through the points.
    Faint,
    /// A thin, dashed line through the points.
    Dashed,
    /// A dot at each point.
    Dots,
    /// A line with marks at its points, at most 32 of them; the number of its colour chooses their form and the dashes
    /// of the line.
    Marked,
}

/// How an axis is divided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Axis {
    /// A linear axis, divided evenly.
    #[default]
    Linear,
    /// A logarithmic axis, divided by powers of ten.
    Log,
}

/// A series of points with a name, drawn in one style and one colour.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its name in the legend; if empty, the legend does not list it.
    pub name: String,
    /// The number of its colour.
    pub color: usize,
    /// The style in which the points are drawn.
    pub style: Style,
    /// The points; those that are not finite, or not positive on a logarithmic
    /// axis, are left out.
    pub points: Vec<(f64, f64)>,
}

impl Series {
    /// A series without a name.
    pub fn unnamed(color: usize, style: Style, points: Vec<(f64, f64)>) -> Self {
        Self { name: String::new(), color, style, points }
    }
}

/// A panel of a figure: one coordinate system with its axes and series.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// The title of the panel.
    pub title: String,
    /// What is along the horizontal axis.
    pub x_label: String,
    /// What is along the vertical axis.
    pub y_label: String,
    /// The division of the horizontal axis, linear or logarithmic.
    pub x: Axis,
    /// The division of the vertical axis, linear or logarithmic.
    pub y: Axis,
    /// Whether a unit of x is drawn as long as a unit of y.
    pub square: bool,
    /// The series, the first at the bottom.
    pub series: Vec<Series>,
}
