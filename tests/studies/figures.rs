//! How series are drawn.

use crate::helpers::temporary;
use gyroceptron::scene::figure::{Figure, Panel, Series, Style};
use gyroceptron::scene::internals::draw;
use std::collections::BTreeSet;

/// A figure of one series with a mark at each of some points.
fn drawn(color: usize, points: usize) -> String {
    let points = (0..points).map(|k| (k as f64, (k % 7) as f64)).collect();
    let series = Series { name: "a method".into(), color, style: Style::Marked, points };
    let panel = Panel { series: vec![series], ..Panel::default() };
    let folder = temporary();
    let path = folder.path().join("figure.svg");
    draw(&path, &Figure::in_a_row("figure", "", vec![panel])).expect("drawn");
    std::fs::read_to_string(path).expect("a figure")
}

/// The text with the same colour everywhere.
fn without_colors(svg: &str) -> String {
    let mut parts = svg.split("=\"#");
    let first = parts.next().expect("a text").to_owned();
    let rest = parts.map(|part| part.split_once('"').expect("the end of a colour").1);
    rest.fold(first, |text, part| text + "=\"" + part)
}

/// Two dozen methods in one panel differ without colours: each has another mark or other dashes.
#[test]
fn series_differ_without_their_colors() {
    const SERIES: usize = 24;
    let figures: BTreeSet<String> =
        (0..SERIES).map(|color| without_colors(&drawn(color, 5))).collect();
    assert_eq!(figures.len(), SERIES);
    // So are they in the list of names alone.
    let names: BTreeSet<String> =
        (0..SERIES).map(|color| without_colors(&drawn(color, 0))).collect();
    assert_eq!(names.len(), SERIES);
}

/// A line of many points is not hidden by its marks.
#[test]
fn marks_stand_apart() {
    let circles = |points: usize| drawn(0, points).matches("<circle").count();
    // One is in the list of names.
    assert_eq!(circles(5), 6);
    assert!((20..=33).contains(&circles(1000)), "{}", circles(1000));
}
