//! Figures: panels of series, before they are drawn.

/// A figure of one or more panels.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Its name in a scene's `plots`, and the stem of its file.
    pub name: &'static str,
    /// What it shows.
    pub caption: String,
    /// So many panels stand side by side.
    pub columns: usize,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
}

impl Figure {
    /// Its file.
    pub fn file(&self) -> String {
        file_of(self.name)
    }

    /// A figure with all panels side by side.
    pub fn in_a_row(name: &'static str, caption: &str, panels: Vec<Panel>) -> Self {
        Self { name, caption: caption.to_owned(), columns: panels.len(), panels }
    }
}

/// The file of the figure of this name.
pub fn file_of(name: &str) -> String {
    format!("{name}.svg")
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// A line.
    Line,
    /// A thin, pale line.
    Faint,
    /// A dot at each point.
    Dots,
    /// A line with a mark at each point.
    Marked,
}

/// Where the names of the series are: where the series are not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Legend {
    /// In the upper right corner.
    #[default]
    UpperRight,
    /// In the lower left corner.
    LowerLeft,
    /// In the middle.
    Middle,
}

/// How an axis is divided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Axis {
    /// Evenly.
    #[default]
    Linear,
    /// By powers of ten.
    Log,
}

/// Points with a name.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its name in the legend; not there, if empty.
    pub name: String,
    /// The number of its colour.
    pub color: usize,
    /// How it is drawn.
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

/// One coordinate system.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// Its title.
    pub title: String,
    /// What is along the horizontal axis.
    pub x_label: String,
    /// What is along the vertical axis.
    pub y_label: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// A unit of x is drawn as long as one of y.
    pub square: bool,
    /// Where the names are.
    pub legend: Legend,
    /// The series, the first at the bottom.
    pub series: Vec<Series>,
}
