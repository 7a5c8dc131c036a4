//! Figures as SVG.

use crate::error::Error;
use crate::io::write_atomically;
use crate::scene::figure::{Axis, Figure, Panel, SameAxes, Style};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use serde::Serialize;
use std::ops::Range;
use std::path::Path;

/// Okabe and Ito's colours, which everybody distinguishes, and two more.
const COLORS: [RGBColor; 10] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(120, 120, 120),
    RGBColor(60, 60, 60),
    RGBColor(148, 103, 189),
    RGBColor(140, 86, 75),
];

/// At most so many points of a series are drawn.
const MOST_POINTS: usize = 2000;
/// At most so many points of a line have marks.
const MOST_MARKS: usize = 32;
/// How many forms of marks there are.
const FORMS: usize = 8;

/// The width of a panel, in pixels.
const WIDTH: u32 = 560;
const HEIGHT: u32 = 460;
/// Pixels of the area in which the points of a panel are, about.
const PLOT: (f64, f64) = (462.0, 362.0);

/// Pixels of the names beside the panels: of a line, a letter, and of what is not text.
const LINE: i32 = 19;
const LETTER: usize = 7;
const BESIDE_TEXT: usize = 48;

/// What is further out, or no number, is not drawn: its range would be none.
const FAR: f64 = 1e300;

/// Where one panel of several with the same axes has points so many times further out
/// than the first, they are not drawn.
const FURTHEST: f64 = 1.5;

type Drawn = Result<(), Box<dyn std::error::Error>>;
type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Draws a figure into a file.
///
/// # Errors
/// [`Error::Write`].
pub fn draw(path: &Path, figure: &Figure) -> Result<(), Error> {
    let (svg, _) = drawing(figure).map_err(|e| Error::write(path, e))?;
    write_atomically(path, |out| out.write_all(svg.as_bytes()))
}

/// Where the coordinate system of a panel is in the drawing.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Placed {
    /// The title of the panel.
    title: String,
    /// What is along its axes.
    names: [String; 2],
    /// Pixels of its corners: left, right, top, bottom.
    #[serde(rename = "box")]
    corners: [i32; 4],
    /// The range of x, in powers of ten where it is logarithmic, and whether it is.
    x: (f64, f64, bool),
    /// The range of y, in powers of ten where it is logarithmic, and whether it is.
    y: (f64, f64, bool),
}

/// The text of a figure, and where its panels are.
pub(super) fn drawing(
    figure: &Figure,
) -> Result<(String, Vec<Placed>), Box<dyn std::error::Error>> {
    let (mut svg, mut placed) = (String::new(), Vec::new());
    {
        let columns = figure.columns.max(1);
        let rows = figure.panels.len().div_ceil(columns);
        let names = Name::all(figure);
        let letters = names.iter().map(|name| name.text.chars().count()).max();
        let beside = letters.map_or(0, |letters| (letters * LETTER + BESIDE_TEXT) as u32);
        let panels = (WIDTH * columns as u32, HEIGHT * rows as u32);
        let tall = (names.len() as i32 + 2) * LINE;
        let size = (panels.0 + beside, panels.1.max(tall as u32));
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE)?;
        let (area, strip) = root.split_horizontally(panels.0);
        let all = Frame::all(figure);
        for ((area, panel), frame) in
            area.split_evenly((rows, columns)).iter().zip(&figure.panels).zip(all)
        {
            let (across, along) = draw_panel(area, panel, &frame)?;
            let range = |scale: &Scale| {
                let logarithmic = scale.axis == Axis::Log;
                (scale.range.start, scale.range.end, logarithmic)
            };
            placed.push(Placed {
                title: panel.title.clone(),
                names: [panel.x_label.clone(), panel.y_label.clone()],
                corners: [across.start, across.end, along.start, along.end],
                x: range(&frame.x),
                y: range(&frame.y),
            });
        }
        draw_names(&strip, &names)?;
        root.present()?;
    }
    Ok((svg, placed))
}

/// A series in the list of names.
struct Name<'a> {
    text: &'a str,
    color: usize,
    style: Style,
}

impl<'a> Name<'a> {
    /// Each once, as the panels have them.
    fn all(figure: &'a Figure) -> Vec<Self> {
        let mut out: Vec<Self> = Vec::new();
        for series in figure.panels.iter().flat_map(|panel| &panel.series) {
            let text = &series.name[..];
            let listed = out.iter_mut().find(|name| name.text == text);
            match listed {
                // A mark says more than a line or a dot.
                Some(name) if series.style == Style::Marked => name.style = Style::Marked,
                Some(_) => {}
                None if text.is_empty() => {}
                None => out.push(Self { text, color: series.color, style: series.style }),
            }
        }
        out
    }
}

fn draw_names(strip: &Area<'_>, names: &[Name<'_>]) -> Drawn {
    for (row, name) in names.iter().enumerate() {
        let y = (row as i32 + 2) * LINE;
        let color = color(name.color);
        let line = vec![(4, y), (26, y)];
        match name.style {
            Style::Line => strip.draw(&PathElement::new(line, color.stroke_width(2)))?,
            Style::Faint => strip.draw(&PathElement::new(line, color.mix(0.45).stroke_width(1)))?,
            Style::Dashed => {
                for (from, to) in [(4, 10), (12, 18), (20, 26)] {
                    let dash = vec![(from, y), (to, y)];
                    strip.draw(&PathElement::new(dash, color.stroke_width(1)))?;
                }
            }
            Style::Dots => strip.draw(&Circle::new((15, y), 3, color.filled()))?,
            Style::Marked => {
                let style = color.mix(0.7).stroke_width(1);
                match Dashes::of(name.color) {
                    Dashes::None => strip.draw(&PathElement::new(line, style))?,
                    Dashes::Of(drawn, between) => {
                        for from in (4..26).step_by((drawn + between) as usize) {
                            let dash = vec![(from, y), ((from + drawn).min(26), y)];
                            strip.draw(&PathElement::new(dash, style))?;
                        }
                    }
                }
                mark(strip, name.color, (15, y))?;
            }
        }
        let font =
            ("sans-serif", 13).into_text_style(strip).pos(Pos::new(HPos::Left, VPos::Center));
        strip.draw(&Text::new(name.text, (34, y), font))?;
    }
    Ok(())
}

fn color(number: usize) -> RGBColor {
    COLORS[number % COLORS.len()]
}

/// The mark of a number: its form, and the [dashes](Dashes) of the line through it, distinguish series in print without
/// colours.
fn mark(strip: &Area<'_>, number: usize, at: (i32, i32)) -> Drawn {
    let (paint, (x, y)) = (color(number), at);
    let [full, outline] = [paint.filled(), paint.stroke_width(1)];
    let square = |half: i32| [(x - half, y - half), (x + half, y + half)];
    match number % FORMS {
        0 => strip.draw(&Circle::new(at, 3, full))?,
        1 => strip.draw(&TriangleMarker::new(at, 5, full))?,
        2 => strip.draw(&Cross::new(at, 4, paint.stroke_width(2)))?,
        3 => strip.draw(&Circle::new(at, 4, outline))?,
        4 => strip.draw(&Rectangle::new(square(3), full))?,
        5 => {
            for ends in [[(x - 5, y), (x + 5, y)], [(x, y - 5), (x, y + 5)]] {
                strip.draw(&PathElement::new(ends, paint.stroke_width(2)))?;
            }
        }
        6 => strip.draw(&Rectangle::new(square(4), outline))?,
        _ => {
            let corners = [(x, y - 5), (x + 5, y), (x, y + 5), (x - 5, y), (x, y - 5)];
            strip.draw(&PathElement::new(corners, outline))?;
        }
    }
    Ok(())
}

/// The line through the marks of a series: one kind for all forms of marks, then the next.
#[derive(Clone, Copy)]
enum Dashes {
    None,
    /// Pixels that are drawn, and between them.
    Of(i32, i32),
}

impl Dashes {
    fn of(number: usize) -> Self {
        match number / FORMS % 3 {
            0 => Self::None,
            1 => Self::Of(7, 4),
            _ => Self::Of(2, 4),
        }
    }
}

/// The range of an axis, in powers of ten where it is logarithmic, and its ticks.
#[derive(Clone)]
struct Scale {
    axis: Axis,
    range: Range<f64>,
}

/// The axes of a panel.
#[derive(Clone)]
struct Frame {
    x: Scale,
    y: Scale,
}

impl Scale {
    /// Of the points between these.
    fn of(axis: Axis, low: f64, high: f64) -> Self {
        let (low, high) = if low > high { (0.0, 1.0) } else { (low, high) };
        let margin = match axis {
            Axis::Linear if low == high && low != 0.0 => 0.05 * low.abs(),
            Axis::Linear | Axis::Log if low == high => 1.0,
            Axis::Linear | Axis::Log => 0.04 * (high - low),
        };
        Self { axis, range: low - margin..high + margin }
    }

    /// At least three, but where the range is of a single value.
    fn ticks(&self) -> Vec<f64> {
        match self.axis {
            Axis::Linear => RangedCoordf64::from(self.range.clone()).key_points(8_usize),
            Axis::Log => {
                let first = self.range.start.floor() as i64;
                let decades: Vec<i64> = (first..=self.range.end as i64 + 1).collect();
                let inside = |tick: &f64| self.range.contains(tick);
                let within = |parts: &[f64]| -> Vec<f64> {
                    let of = |decade: &i64| {
                        parts.iter().map(|p| *decade as f64 + libm::log10(*p)).collect::<Vec<_>>()
                    };
                    decades.iter().flat_map(of).filter(inside).collect()
                };
                let whole = within(&[1.0]);
                if whole.len() >= 3 {
                    let stride = whole.len().div_ceil(8);
                    return whole.into_iter().step_by(stride).collect();
                }
                let thirds = within(&[1.0, 2.0, 5.0]);
                if thirds.len() >= 3 {
                    return thirds;
                }
                within(&[1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0])
            }
        }
    }

    /// Where a number is on the axis, if it can be.
    fn place(&self, value: f64) -> Option<f64> {
        let place = match self.axis {
            Axis::Linear => value,
            Axis::Log if value > 0.0 => libm::log10(value),
            Axis::Log => return None,
        };
        (place.abs() <= FAR).then_some(place)
    }
}

impl Ranged for Scale {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }

    fn map(&self, place: &f64, pixels: (i32, i32)) -> i32 {
        RangedCoordf64::from(self.range.clone()).map(place, pixels)
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks()
    }
}

impl ValueFormatter<f64> for Scale {
    fn format(place: &f64) -> String {
        place.to_string()
    }

    fn format_ext(&self, place: &f64) -> String {
        match self.axis {
            Axis::Linear => tick(*place, self.range.end - self.range.start),
            Axis::Log => power(libm::exp10(*place)),
        }
    }
}

impl Frame {
    /// The axes of all panels of a figure, with equal ranges where the figure asks for them.
    fn all(figure: &Figure) -> Vec<Self> {
        let each: Vec<_> = figure.panels.iter().map(|panel| (panel, extent(panel))).collect();
        if figure.same_axes == SameAxes::No {
            return each.into_iter().map(|(panel, extent)| Self::of(panel, extent)).collect();
        }
        let Some((first, mut shared)) = each.first().cloned() else { return Vec::new() };
        let furthest = shared.map(|(low, high)| {
            let more = match figure.same_axes {
                SameAxes::First => (FURTHEST - 1.0) / 2.0 * (high - low),
                SameAxes::No | SameAxes::Widest => f64::INFINITY,
            };
            (low - more, high + more)
        });
        for (_, extent) in &each {
            for ((shared, extent), furthest) in shared.iter_mut().zip(extent).zip(&furthest) {
                // no NaN: only finite points have an extent
                shared.0 = shared.0.min(extent.0.max(furthest.0));
                shared.1 = shared.1.max(extent.1.min(furthest.1));
            }
        }
        vec![Self::of(first, shared); each.len()]
    }

    fn of(panel: &Panel, [x, y]: [(f64, f64); 2]) -> Self {
        let (mut x, mut y) = (Scale::of(panel.x, x.0, x.1), Scale::of(panel.y, y.0, y.1));
        if panel.square {
            let unit = |range: &Range<f64>, pixels: f64| (range.end - range.start) / pixels;
            // no NaN: ranges are finite
            let unit = f64::max(unit(&x.range, PLOT.0), unit(&y.range, PLOT.1));
            for (scale, pixels) in [(&mut x, PLOT.0), (&mut y, PLOT.1)] {
                let middle = 0.5 * (scale.range.start + scale.range.end);
                scale.range = middle - 0.5 * unit * pixels..middle + 0.5 * unit * pixels;
            }
        }
        Self { x, y }
    }
}

/// The smallest and largest place of a panel's points on each axis.
fn extent(panel: &Panel) -> [(f64, f64); 2] {
    let none = (f64::INFINITY, f64::NEG_INFINITY);
    let mut out = [none; 2];
    let scales = [panel.x, panel.y].map(|axis| Scale { axis, range: 0.0..0.0 });
    for point in panel.series.iter().flat_map(|series| &series.points) {
        let (Some(x), Some(y)) = (scales[0].place(point.0), scales[1].place(point.1)) else {
            continue;
        };
        for (extent, place) in out.iter_mut().zip([x, y]) {
            // no NaN: a place is a number
            *extent = (extent.0.min(place), extent.1.max(place));
        }
    }
    out
}

/// Numbers on axes: short, and different where the ticks are.
fn tick(value: f64, span: f64) -> String {
    if value.abs() <= 1e-9 * span.abs() {
        return "0".into();
    }
    if !(1e-3..1e5).contains(&value.abs()) {
        return format!("{value:.0e}");
    }
    let digits = (1.0 - span.abs().max(1e-12).log10().floor()).clamp(0.0, 8.0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// A tick of a logarithmic axis: `0.01 … 1000` as they are.
fn power(value: f64) -> String {
    if (0.009..1100.0).contains(&value) {
        let text = format!("{value:.3}");
        return text.trim_end_matches('0').trim_end_matches('.').to_owned();
    }
    let short = format!("{value:.0e}");
    let close = short.parse().is_ok_and(|v: f64| (v - value).abs() <= 1e-9 * value);
    if close { short } else { format!("{value:.1e}") }
}

/// Draws a panel; the pixels of its coordinate system, along both axes.
fn draw_panel(
    area: &Area<'_>,
    panel: &Panel,
    frame: &Frame,
) -> Result<(Range<i32>, Range<i32>), Box<dyn std::error::Error>> {
    let mut chart = ChartBuilder::on(area)
        .caption(&panel.title, ("sans-serif", 16))
        .margin(10)
        .margin_right(18)
        .x_label_area_size(42)
        .y_label_area_size(68)
        .build_cartesian_2d(frame.x.clone(), frame.y.clone())?;
    chart
        .configure_mesh()
        .x_desc(&panel.x_label)
        .y_desc(&panel.y_label)
        .light_line_style(WHITE)
        .bold_line_style(BLACK.mix(0.12))
        .axis_desc_style(("sans-serif", 15))
        .label_style(("sans-serif", 13))
        .draw()?;
    let inside = |scale: &Scale, place: f64| scale.range.start <= place && place <= scale.range.end;
    for series in &panel.series {
        let place = |&(x, y): &(f64, f64)| Some((frame.x.place(x)?, frame.y.place(y)?));
        let points: Vec<_> = series
            .points
            .iter()
            .filter_map(place)
            .filter(|point| inside(&frame.x, point.0) && inside(&frame.y, point.1))
            .collect();
        let stride = points.len().div_ceil(MOST_POINTS).max(1);
        let points = points.into_iter().step_by(stride);
        let paint = color(series.color);
        match series.style {
            Style::Line => {
                chart.draw_series(LineSeries::new(points, paint.stroke_width(2)))?;
            }
            Style::Faint => {
                chart.draw_series(LineSeries::new(points, paint.mix(0.45).stroke_width(1)))?;
            }
            Style::Dashed => {
                let style = paint.stroke_width(1);
                chart.draw_series(DashedLineSeries::new(points, 6, 3, style))?;
            }
            Style::Dots => {
                chart.draw_series(points.map(|point| Circle::new(point, 1, paint.filled())))?;
            }
            Style::Marked => {
                let style = paint.mix(0.7).stroke_width(1);
                match Dashes::of(series.color) {
                    Dashes::None => chart.draw_series(LineSeries::new(points.clone(), style))?,
                    Dashes::Of(drawn, between) => {
                        let line = DashedLineSeries::new(points.clone(), drawn, between, style);
                        chart.draw_series(line)?
                    }
                };
                let apart = points.len().div_ceil(MOST_MARKS).max(1);
                for point in points.step_by(apart) {
                    let at = chart.as_coord_spec().translate(&point);
                    let origin = area.get_pixel_range();
                    mark(area, series.color, (at.0 - origin.0.start, at.1 - origin.1.start))?;
                }
            }
        }
    }
    Ok(chart.plotting_area().get_pixel_range())
}
