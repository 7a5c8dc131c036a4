//! Names of coordinates and initial points.

use crate::words::subscript;

/// `q₂` or `p₁`: the coordinate of this number in a point of 2n.
pub(super) fn coordinate(index: usize, dim: usize) -> String {
    let dof = dim / 2;
    let letter = if index < dof { 'q' } else { 'p' };
    format!("{letter}{}", subscript(index % dof + 1))
}

/// A name for each initial point: the coordinates in which they differ.
pub(super) fn initial_names(points: &[Vec<f64>]) -> Vec<String> {
    let Some(first) = points.first() else { return Vec::new() };
    let dim = first.len();
    let differs = |k: &usize| points.iter().any(|point| point[*k] != first[*k]);
    let differing: Vec<usize> = (0..dim).filter(differs).collect();
    let shown = if differing.is_empty() { (0..dim).collect() } else { differing };
    let name = |point: &Vec<f64>| {
        let part = |k: &usize| format!("{} = {}", coordinate(*k, dim), point[*k]);
        shown.iter().map(part).collect::<Vec<_>>().join(", ")
    };
    points.iter().map(name).collect()
}

/// `one set of initial weights`, `5 sets of initial weights`.
pub(super) fn sets_of_weights(count: usize) -> String {
    match count {
        1 => "one set of initial weights".into(),
        count => format!("{count} sets of initial weights"),
    }
}
