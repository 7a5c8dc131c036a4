//! Figures as SVG.

use crate::error::Error;
use crate::io::write_atomically;
use crate::scene::figure::{Axis, Figure, Legend, Panel, Series, Style};
use plotters::coord::Shift;
use plotters::prelude::*;
use std::path::Path;

/// The names of the series, where the figure wants them.
fn position(legend: Legend) -> SeriesLabelPosition {
    match legend {
        Legend::UpperRight => SeriesLabelPosition::UpperRight,
        Legend::LowerLeft => SeriesLabelPosition::LowerLeft,
        Legend::Middle => SeriesLabelPosition::MiddleMiddle,
    }
}

/// Okabe and Ito's colours, told apart by everybody, and two more.
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

/// Pixels of a panel.
const WIDTH: u32 = 560;
const HEIGHT: u32 = 460;

/// Draws a figure into a file.
///
/// # Errors
/// [`Error::Write`].
pub fn draw(path: &Path, figure: &Figure) -> Result<(), Error> {
    let mut svg = String::new();
    {
        let columns = figure.columns.max(1);
        let rows = figure.panels.len().div_ceil(columns);
        let size = (WIDTH * columns as u32, HEIGHT * rows as u32);
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE).map_err(|e| Error::write(path, e))?;
        for (area, panel) in root.split_evenly((rows, columns)).iter().zip(&figure.panels) {
            draw_panel(area, panel).map_err(|e| Error::write(path, e))?;
        }
        root.present().map_err(|e| Error::write(path, e))?;
    }
    write_atomically(path, |out| out.write_all(svg.as_bytes()))
}

type Drawn = Result<(), Box<dyn std::error::Error>>;
type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// The finite points of a series, thinned evenly.
fn thinned(series: &Series, panel: &Panel) -> Vec<(f64, f64)> {
    let drawable = |axis, v: f64| v.is_finite() && (axis == Axis::Linear || v > 0.0);
    let usable: Vec<_> = series
        .points
        .iter()
        .copied()
        .filter(|(x, y)| drawable(panel.x, *x) && drawable(panel.y, *y))
        .collect();
    let stride = usable.len().div_ceil(MOST_POINTS).max(1);
    usable.into_iter().step_by(stride).collect()
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) =
        // no NaN: only finite points are drawn
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if low > high {
        (0.0, 1.0)
    } else if low == high {
        let margin = if low == 0.0 { 1.0 } else { 0.05 * low.abs() };
        (low - margin, high + margin)
    } else {
        (low, high)
    }
}

fn widened((low, high): (f64, f64)) -> (f64, f64) {
    let margin = 0.04 * (high - low);
    (low - margin, high + margin)
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

/// Draws axes, series and names; a macro, because each kind of axis is a type.
macro_rules! draw_chart {
    ($area:expr, $panel:expr, $points:expr, $x:expr, $y:expr, $x_tick:expr, $y_tick:expr) => {{
        let panel: &Panel = $panel;
        let mut chart = ChartBuilder::on($area)
            .caption(&panel.title, ("sans-serif", 16))
            .margin(10)
            .x_label_area_size(42)
            .y_label_area_size(68)
            .build_cartesian_2d($x, $y)?;
        chart
            .configure_mesh()
            .x_desc(&panel.x_label)
            .y_desc(&panel.y_label)
            .x_labels(8)
            .y_labels(8)
            .x_label_formatter(&$x_tick)
            .y_label_formatter(&$y_tick)
            .light_line_style(WHITE)
            .bold_line_style(BLACK.mix(0.12))
            .axis_desc_style(("sans-serif", 14))
            .label_style(("sans-serif", 12))
            .draw()?;
        for (series, points) in panel.series.iter().zip($points) {
            let color = COLORS[series.color % COLORS.len()];
            let annotation = match series.style {
                Style::Line => chart.draw_series(LineSeries::new(points, color.stroke_width(2)))?,
                Style::Faint => {
                    chart.draw_series(LineSeries::new(points, color.mix(0.45).stroke_width(1)))?
                }
                Style::Marked => {
                    let marks = points.clone();
                    chart.draw_series(LineSeries::new(points, color.mix(0.7).stroke_width(1)))?;
                    chart.draw_series(
                        marks.into_iter().map(|point| Circle::new(point, 3, color.filled())),
                    )?
                }
                Style::Dots => chart.draw_series(
                    points.into_iter().map(|point| Circle::new(point, 1, color.filled())),
                )?,
            };
            if !series.name.is_empty() {
                annotation.label(&series.name).legend(move |(x, y)| {
                    Rectangle::new([(x, y - 2), (x + 14, y + 2)], color.filled())
                });
            }
        }
        if panel.series.iter().any(|s| !s.name.is_empty()) {
            chart
                .configure_series_labels()
                .position(position(panel.legend))
                .background_style(WHITE.mix(0.85))
                .border_style(BLACK.mix(0.3))
                .label_font(("sans-serif", 12))
                .draw()?;
        }
        Ok(())
    }};
}

fn draw_panel(area: &Area<'_>, panel: &Panel) -> Drawn {
    let points: Vec<_> = panel.series.iter().map(|s| thinned(s, panel)).collect();
    let x = range(points.iter().flatten().map(|p| p.0));
    let y = range(points.iter().flatten().map(|p| p.1));
    match (panel.x, panel.y) {
        (Axis::Linear, Axis::Linear) => {
            let (mut x, mut y) = (widened(x), widened(y));
            if panel.square {
                // The plotting area is about 470 × 370 pixels.
                let scale = f64::max((x.1 - x.0) / 470.0, (y.1 - y.0) / 370.0);
                let around = |(low, high): (f64, f64), pixels: f64| {
                    let (middle, half) = (0.5 * (low + high), 0.5 * scale * pixels);
                    (middle - half, middle + half)
                };
                (x, y) = (around(x, 470.0), around(y, 370.0));
            }
            let (x_span, y_span) = (x.1 - x.0, y.1 - y.0);
            let x_tick = |v: &f64| tick(*v, x_span);
            draw_chart!(area, panel, points, x.0..x.1, y.0..y.1, x_tick, |v| tick(*v, y_span))
        }
        (Axis::Linear, Axis::Log) => {
            let (x, y) = (widened(x), log_range(y));
            let x_tick = |v: &f64| tick(*v, x.1 - x.0);
            draw_chart!(area, panel, points, x.0..x.1, y.log_scale(), x_tick, |v| power(*v))
        }
        (Axis::Log, _) => {
            let mut x = log_range(x);
            if panel.legend == Legend::LowerLeft {
                // Room for the names.
                x.start /= 20.0;
            }
            let (x, y) = (x.log_scale(), log_range(y).log_scale());
            draw_chart!(area, panel, points, x, y, |v| power(*v), |v| power(*v))
        }
    }
}

/// A range on a logarithmic axis, and room at its ends.
fn log_range((low, high): (f64, f64)) -> std::ops::Range<f64> {
    if low > 0.0 { low / 2.0..high * 2.0 } else { 1e-3..1.0 }
}

/// A tick of a logarithmic axis: `0.01 … 1000` as they are.
fn power(value: f64) -> String {
    if (0.009..1100.0).contains(&value) {
        let text = format!("{value:.2}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{value:.0e}")
    }
}
