//! The figures of maps of a section: profiles of rotation, and distances from surfaces.

use super::section_maps::{Judge, Judged, SURE};
use crate::scene::figure::{Axis, Figure, Panel, Series, Style};
use crate::scene::line_data::TracedLines;

pub(super) const ROTATION: &str = "rotation";
pub(super) const SURFACES: &str = "off-surface";

/// The colour of a method, in all figures; the reference has number 0.
pub(super) fn color_of(method: usize) -> usize {
    method + 1
}

/// The radii and rotation of the reference and the others: the profile, and by how much it differs.
pub(super) fn rotation_figure(lines: &TracedLines, judge: &Judge<'_>, found: &[Judged]) -> Figure {
    let per_turn = lines.maps_a_turn();
    let radii = || judge.profile.chunks_exact(2).map(|z| z[0] - judge.axis[0]);
    let own = radii().zip(&judge.rotation).filter(|(_, found)| found.error <= SURE);
    let own = own.map(|(r, found)| (r, found.turns.abs() * per_turn)).collect();
    let mut profile =
        vec![Series { name: "reference".into(), color: 0, style: Style::Line, points: own }];
    let mut errors = Vec::new();
    for (number, one) in found.iter().enumerate().filter(|(_, one)| !one.rotation.is_empty()) {
        let color = color_of(number);
        if one.setting.is_none() {
            let points = radii().zip(&one.rotation).map(|(r, f)| (r, f.turns.abs() * per_turn));
            profile.push(Series {
                name: one.name.clone(),
                color,
                style: Style::Dots,
                points: points.collect(),
            });
        }
        let pairs = radii().zip(one.rotation.iter().zip(&judge.rotation));
        let points = pairs.filter(|(_, (_, own))| own.error <= SURE);
        let points = points.map(|(r, (a, b))| (r, (a.turns - b.turns).abs() * per_turn)).collect();
        errors.push(Series { name: one.name.clone(), color, style: Style::Marked, points });
    }
    let x_label = "distance from the axis at the start [m]";
    let sure = judge.rotation.iter().zip(&judge.flux_of_profile);
    let sure = sure.filter(|(found, _)| found.error <= SURE);
    let by_flux: Vec<_> =
        sure.filter_map(|(found, flux)| Some(((*flux)?, found.turns.abs() * per_turn))).collect();
    let by_flux =
        Series { name: "reference".into(), color: 0, style: Style::Marked, points: by_flux };
    let panels = vec![
        Panel {
            title: "ι".into(),
            x_label: x_label.into(),
            y_label: "|ι|".into(),
            series: profile,
            ..Panel::default()
        },
        Panel {
            title: "ι on surfaces".into(),
            x_label: "toroidal flux within [Wb]".into(),
            y_label: "|ι|".into(),
            series: vec![by_flux],
            ..Panel::default()
        },
        Panel {
            title: "Difference from the reference".into(),
            x_label: x_label.into(),
            y_label: "|Δι|".into(),
            y: Axis::Log,
            series: errors,
            ..Panel::default()
        },
    ];
    Figure::in_a_row(ROTATION, "Turns about the axis for one around the machine.", panels)
}

pub(super) fn surfaces_figure(found: &[Judged]) -> Figure {
    let followed = found.iter().enumerate().filter(|(_, one)| !one.off.is_empty());
    let series = followed.map(|(number, one)| {
        let points =
            one.off.iter().filter_map(|(count, _)| Some((*count as f64, one.off_at(*count)?)));
        let (name, color) = (one.name.clone(), color_of(number));
        Series { name, color, style: Style::Marked, points: points.collect() }
    });
    let panel = Panel {
        title: "Distance from the surfaces of the reference".into(),
        x_label: "maps".into(),
        y_label: "largest of all lines [m]".into(),
        x: Axis::Log,
        y: Axis::Log,
        series: series.collect(),
        ..Panel::default()
    };
    Figure::in_a_row(SURFACES, "How far lines drift off their surfaces.", vec![panel])
}
