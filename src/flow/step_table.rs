//! Flow maps of a fixed time by tables of splines, which replace integration without any learning.

use super::Region;
use crate::error::Error;
use crate::scalar::{Kernel, Pack, max_or_nan, on_independent_lanes};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// The function of the map that a table stores.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TableKind {
    /// The image z′ of z, each coordinate a cubic spline of all coordinates, over a box. It is for one or two degrees
    /// of freedom, and is not symplectic.
    Splines,
    /// θ′ − θ and ρ′ as cubic splines of (θ, ρ), q = ρ sin θ and p = ρ cos θ, over a ring. It is for one degree of
    /// freedom, and is not symplectic.
    PolarSplines,
    /// A cubic spline of the function S(θ, ρ′) that generates the map, with ψ = ½ρ²: ψ = ψ′ + ∂S/∂θ and
    /// θ′ = θ + ∂S/∂ψ′. It is symplectic, and a step solves the first equation for ρ′ by Newton's method. It is for
    /// one degree of freedom.
    ///
    /// Source: Abdullaev, <https://doi.org/10.1088/0305-4470/32/15/004>, for such maps of field lines.
    GeneratingFunction,
}

impl TableKind {
    /// The name used in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Splines => "table of the step, cubic splines",
            Self::PolarSplines => "table of the step in (θ, ρ), cubic splines",
            Self::GeneratingFunction => "table of a generating function, cubic splines",
        }
    }

    /// Whether a name is that of a table.
    pub fn is_named(name: &str) -> bool {
        [Self::Splines, Self::PolarSplines, Self::GeneratingFunction]
            .iter()
            .any(|k| k.name() == name)
    }

    /// How many numbers a node has.
    fn outputs(self, dim: usize) -> usize {
        match self {
            Self::Splines => dim,
            Self::PolarSplines => 2,
            Self::GeneratingFunction => 1,
        }
    }

    /// Fails unless `nodes` nodes along each axis are enough for a spline and few enough for memory, and this kind of
    /// table supports `dof` degrees of freedom.
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::OutOfRange`] with the nodes.
    pub fn check(self, nodes: usize, dof: usize) -> Result<(), Error> {
        let (most, expected) = match self {
            Self::Splines => (2, "a system of one or two degrees of freedom"),
            _ => (1, "a system of one degree of freedom"),
        };
        if dof == 0 || dof > most {
            return Err(Error::invalid(self.name(), format!("{dof} degrees of freedom"), expected));
        }
        Error::check_count_range("nodes", nodes, LEAST_NODES, usize::MAX)?;
        let dim = 2 * dof;
        let numbers = nodes.saturating_add(3).checked_pow(dim as u32);
        let numbers = numbers.and_then(|numbers| numbers.checked_mul(self.outputs(dim)));
        if numbers.is_none_or(|numbers| numbers > MOST_NUMBERS) {
            let found = format!("{nodes} nodes along each of {dim} axes");
            return Err(Error::invalid(self.name(), found, "fewer than 2²⁷ numbers, 1 GiB"));
        }
        Ok(())
    }
}

/// A cubic spline has no fewer.
const LEAST_NODES: usize = 4;
/// The coefficients of a table, at most: 1 GiB.
const MOST_NUMBERS: usize = 1 << 27;

/// A tabulated flow map of a fixed time.
///
/// It interpolates values on an equidistant grid by cubic splines, periodic in angles and otherwise with a continuous
/// third derivative at the second node from each end. The error falls as the fourth power of the grid spacing, and
/// that of derivatives as the third. Outside the grid the image is NaN.
///
/// Source: de Boor, A Practical Guide to Splines, revised edition, Springer (2001), chapters IV and XVII.
#[derive(Clone, Debug)]
pub struct StepTable {
    kind: TableKind,
    dim: usize,
    axes: Vec<GridAxis>,
    /// The coefficients of the splines, row by row: along the last axis first, the outputs innermost.
    coefficients: Vec<f64>,
}

/// Equal distances along a coordinate.
#[derive(Clone, Copy, Debug)]
struct GridAxis {
    low: f64,
    step: f64,
    nodes: usize,
    periodic: bool,
}

impl GridAxis {
    /// Fails unless `low` < `high`.
    fn new(name: &str, low: f64, high: f64, nodes: usize) -> Result<Self, Error> {
        if !(low < high) {
            let found = format!("from {low} to {high}");
            return Err(Error::invalid(&format!("{name} of a table"), found, "an interval"));
        }
        Ok(Self { low, step: (high - low) / (nodes - 1) as f64, nodes, periodic: false })
    }

    fn angle(nodes: usize) -> Self {
        Self { low: 0.0, step: TAU / nodes as f64, nodes, periodic: true }
    }

    fn node(&self, k: usize) -> f64 {
        self.step.mul_add(k as f64, self.low)
    }

    fn cells(&self) -> usize {
        if self.periodic { self.nodes } else { self.nodes - 1 }
    }

    /// Three more than there are cells.
    fn coefficients(&self) -> usize {
        self.cells() + 3
    }

    /// The cell of a coordinate and how far through it that is; NaN outside.
    #[inline(always)]
    fn cell(&self, x: f64) -> (usize, f64) {
        let cells = self.cells();
        let mut at = (x - self.low) / self.step;
        if self.periodic {
            at -= (at / cells as f64).floor() * cells as f64;
        }
        let cell = (at as usize).min(cells - 1);
        let t = at - cell as f64;
        // A node on the border is within, but for rounding.
        let within = (-1e-9..=1.0 + 1e-9).contains(&t);
        (cell, if within { t } else { f64::NAN })
    }
}

/// `values` at the nodes, of shape (outer, nodes, inner), to coefficients (outer, cells + 3, inner).
fn along(axis: &GridAxis, values: &[f64], inner: usize) -> Vec<f64> {
    let count = axis.coefficients();
    let outer = values.len() / (axis.nodes * inner);
    let mut out = vec![0.0; outer * count * inner];
    let blocks = values.chunks_exact(axis.nodes * inner).zip(out.chunks_exact_mut(count * inner));
    for (values, out) in blocks {
        if axis.periodic {
            periodic_coefficients(values, inner, out);
        } else {
            coefficients(values, inner, out);
        }
    }
    out
}

/// `out` ← c_0 … c_{N+1} of splines with f_i = (c_i + 4c_{i+1} + c_{i+2})/6 at the nodes i = 0 … N − 1, `inner` of
/// them together, whose third derivative is continuous at the nodes 1 and N − 2: this makes c_2 =
/// (8f_1 − f_0 − f_2)/6 and c_{N−1} likewise, and leaves a tridiagonal system of those between.
fn coefficients(values: &[f64], inner: usize, out: &mut [f64]) {
    let nodes = values.len() / inner;
    let f = |node: usize, column: usize| values[node * inner + column];
    let last = nodes - 1;
    // 1/(4 − the factor before) of the elimination from c_3 on.
    let mut factors = vec![0.0; nodes];
    for k in 3..last {
        factors[k] = 1.0 / (4.0 - factors[k - 1]);
    }
    for column in 0..inner {
        let at = |k: usize| k * inner + column;
        out[at(2)] = (8.0 * f(1, column) - f(0, column) - f(2, column)) / 6.0;
        out[at(last)] = (8.0 * f(last - 1, column) - f(last, column) - f(last - 2, column)) / 6.0;
        for k in 3..last {
            out[at(k)] = (6.0 * f(k - 1, column) - out[at(k - 1)]) * factors[k];
        }
        for k in (3..last).rev() {
            out[at(k)] -= factors[k] * out[at(k + 1)];
        }
        out[at(1)] = 6.0 * f(1, column) - 4.0 * out[at(2)] - out[at(3)];
        out[at(0)] = 6.0 * f(0, column) - 4.0 * out[at(1)] - out[at(2)];
        let end = at(last + 1);
        out[end] = 6.0 * f(last - 1, column) - 4.0 * out[at(last)] - out[at(last - 1)];
        out[at(last + 2)] = 6.0 * f(last, column) - 4.0 * out[end] - out[at(last)];
    }
}

/// The same of periodic splines, by two recursions with the root z = √3 − 2 of z² + 4z + 1; the first three are
/// there once more at the end.
fn periodic_coefficients(values: &[f64], inner: usize, out: &mut [f64]) {
    let nodes = values.len() / inner;
    let root = libm::sqrt(3.0) - 2.0;
    let whole = 1.0 / (1.0 - libm::pow(root, nodes as f64));
    let mut forward = vec![0.0; nodes];
    for column in 0..inner {
        let f = |node: usize| values[(node % nodes) * inner + column];
        let mut sum = 0.0;
        // Σ_k z^k f_{−k}, from its last term on.
        for k in (0..nodes).rev() {
            sum = sum * root + f(nodes - k);
        }
        forward[0] = sum * whole;
        for k in 1..nodes {
            forward[k] = forward[k - 1] * root + f(k);
        }
        sum = 0.0;
        for k in (0..nodes).rev() {
            sum = sum * root + forward[(nodes - 1 + k) % nodes];
        }
        let mut c = -root * sum * whole;
        for k in (0..nodes).rev() {
            if k + 1 < nodes {
                c = root * (c - forward[k]);
            }
            // Coefficient k + 1 belongs to node k.
            for place in [k + 1, k + 1 + nodes] {
                if place < nodes + 3 {
                    out[place * inner + column] = 6.0 * c;
                }
            }
            if k + 1 == nodes {
                out[column] = 6.0 * c;
            }
        }
    }
}

/// The four basis functions of a cell.
#[inline(always)]
fn weights(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    let sixth = 1.0 / 6.0;
    [
        sixth * s * s * s,
        sixth * ((3.0 * t - 6.0) * t * t + 4.0),
        sixth * ((3.0 * s - 6.0) * s * s + 4.0),
        sixth * t * t * t,
    ]
}

/// The derivatives of the four basis functions of a cell by t.
#[inline(always)]
fn slopes(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-0.5 * s * s, (1.5 * t - 2.0) * t, (2.0 - 1.5 * s) * s, 0.5 * t * t]
}

/// A flow map of many points, 2n numbers each, which returns their images in the same layout.
pub type FlowOfPoints<'a> = &'a (dyn Fn(&[f64]) -> Result<Vec<f64>, Error> + 'a);

impl StepTable {
    /// The table of a flow with `nodes` nodes along each axis, over the box around these points, or over the ring
    /// around 0 that holds them, widened by a twentieth on each side.
    ///
    /// # Errors
    /// Those of [`TableKind::check`] and of the flow; [`Error::Invalid`] without points, of points along which a
    /// coordinate does not change, of images that are not finite, of a ring that reaches 0, of a map without a
    /// generating function S(θ, ρ′) or one that keeps no area; [`Error::NoConvergence`] where no start of a step of
    /// one is found.
    pub fn of_flow(
        kind: TableKind,
        nodes: usize,
        dof: usize,
        points: &[f64],
        flow: FlowOfPoints<'_>,
    ) -> Result<Self, Error> {
        kind.check(nodes, dof)?;
        let dim = 2 * dof;
        Error::check_rows("points of a table", points.len(), dim)?;
        points.iter().try_for_each(|v| Error::check_finite("points of a table", *v))?;
        if points.is_empty() {
            return Err(Error::invalid("points of a table", "none", "some"));
        }
        let checked = |nodes: &[f64]| -> Result<Vec<f64>, Error> {
            let images = flow(nodes)?;
            Error::check_count("images of the nodes of a table", nodes.len(), images.len())?;
            // One image that is not finite would spread over all of the table.
            let lost = images.chunks_exact(dim).filter(|z| z.iter().any(|v| !v.is_finite()));
            match lost.count() {
                0 => Ok(images),
                lost => {
                    let found = format!("none of {lost} of {} nodes", nodes.len() / dim);
                    Err(Error::invalid("images of the nodes of a table", found, "finite numbers"))
                }
            }
        };
        let (axes, values) = match kind {
            TableKind::Splines => box_of(dim, nodes, points, &checked)?,
            TableKind::PolarSplines => ring_of(nodes, points, &checked)?,
            TableKind::GeneratingFunction => generator_of(nodes, points, &checked)?,
        };
        let outputs = kind.outputs(dim);
        let mut coefficients = values;
        let mut inner = outputs;
        for axis in axes.iter().rev() {
            coefficients = along(axis, &coefficients, inner);
            inner *= axis.coefficients();
        }
        Ok(Self { kind, dim, axes, coefficients })
    }

    /// The kind of the table.
    pub fn kind(&self) -> TableKind {
        self.kind
    }

    /// The size of the table in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.coefficients[..])
    }

    /// The states of trajectories from each of the points in `initial`, 2n numbers each, after `every`, 2·`every`, …
    /// `kept`·`every` steps of the table: an array (kept, M, 2n).
    pub fn trajectories(&self, initial: &[f64], every: usize, kept: usize) -> Vec<f64> {
        let mut out = vec![0.0; initial.len() * kept];
        if !initial.is_empty() {
            on_independent_lanes(Steps { table: self, initial, every, out: &mut out });
        }
        out
    }

    /// z ← its image, in the coordinates of the table.
    #[inline(always)]
    fn step(&self, z: &mut [f64]) {
        match self.kind {
            TableKind::Splines if self.dim == 2 => {
                let [first, second] = [z[0], z[1]];
                z.copy_from_slice(&self.image::<2, 8>(&[first, second]));
            }
            TableKind::Splines => {
                let point: [f64; 4] = [z[0], z[1], z[2], z[3]];
                z.copy_from_slice(&self.image::<4, 16>(&point));
            }
            TableKind::PolarSplines => {
                let [turned, radius] = self.image::<2, 8>(&[z[0], z[1]]);
                (z[0], z[1]) = (z[0] + turned, radius);
            }
            TableKind::GeneratingFunction => self.generate(z),
        }
        if self.kind != TableKind::Splines {
            // Of an angle of many turns the last digits would be lost.
            z[0] -= TAU * (z[0] / TAU).floor();
        }
    }

    /// All D splines at a point. The last axis has its four weights after the sum over the others: ROW is 4D.
    #[inline(always)]
    fn image<const D: usize, const ROW: usize>(&self, point: &[f64; D]) -> [f64; D] {
        let (mut first, mut weight) = (0, [[0.0; 4]; D]);
        let mut strides = [D; D];
        for axis in (0..D).rev() {
            if axis + 1 < D {
                strides[axis] = strides[axis + 1] * self.axes[axis + 1].coefficients();
            }
            let (cell, t) = self.axes[axis].cell(point[axis]);
            first += cell * strides[axis];
            weight[axis] = weights(t);
        }
        let mut sums = [0.0; ROW];
        let combinations = 1 << (2 * (D - 1));
        for number in 0..combinations {
            let (mut offset, mut share) = (first, 1.0);
            for axis in 0..D - 1 {
                let k = (number >> (2 * (D - 2 - axis))) & 3;
                offset += k * strides[axis];
                share *= weight[axis][k];
            }
            let row: &[f64; ROW] =
                self.coefficients[offset..offset + ROW].first_chunk().expect("a row");
            for i in 0..ROW {
                sums[i] = row[i].mul_add(share, sums[i]);
            }
        }
        let mut out = [0.0; D];
        for k in 0..4 {
            for i in 0..D {
                out[i] = sums[k * D + i].mul_add(weight[D - 1][k], out[i]);
            }
        }
        out
    }

    /// (θ, ρ) ← its image under the map that S generates.
    #[inline(always)]
    fn generate(&self, z: &mut [f64]) {
        let [angles, radii] = [self.axes[0], self.axes[1]];
        let (cell, t) = angles.cell(z[0]);
        let (along, across) = (weights(t), slopes(t));
        let row = radii.coefficients();
        let psi = 0.5 * z[1] * z[1];
        let (mut radius, mut by_radius, mut found) = (z[1], 0.0, false);
        for _ in 0..NEWTON_STEPS {
            let (within, u) = radii.cell(radius);
            let (value, slope) = (weights(u), slopes(u));
            // ∂S/∂θ, ∂²S/∂θ∂ρ and ∂S/∂ρ, in steps of the grid.
            let (mut by_angle, mut mixed) = (0.0, 0.0);
            by_radius = 0.0;
            for i in 0..4 {
                let begin = (cell + i) * row + within;
                let of: &[f64; 4] =
                    self.coefficients[begin..begin + 4].first_chunk().expect("four");
                let (mut sum, mut sloped) = (0.0, 0.0);
                for k in 0..4 {
                    sum = of[k].mul_add(value[k], sum);
                    sloped = of[k].mul_add(slope[k], sloped);
                }
                by_angle = sum.mul_add(across[i], by_angle);
                mixed = sloped.mul_add(across[i], mixed);
                by_radius = sloped.mul_add(along[i], by_radius);
            }
            let left = 0.5 * radius * radius + by_angle / angles.step - psi;
            let change = left / (radius + mixed / (angles.step * radii.step));
            radius -= change;
            if change.abs() <= 1e-12 * radius {
                found = true;
                break;
            }
        }
        // What is not found is no image.
        z[1] = if found { radius } else { f64::NAN };
        z[0] += by_radius / (radii.step * z[1]);
    }
}

/// Newton's method for ρ′ begins with ρ, from which it is a little way.
const NEWTON_STEPS: usize = 8;

/// The image of the nodes of a box.
fn box_of(
    dim: usize,
    nodes: usize,
    points: &[f64],
    flow: FlowOfPoints<'_>,
) -> Result<(Vec<GridAxis>, Vec<f64>), Error> {
    let region = Region::around(dim, [points]).expect("points").widened(0.05);
    let ends = region.low.iter().zip(&region.high).enumerate();
    let axes: Vec<GridAxis> = ends
        .map(|(k, (&low, &high))| GridAxis::new(&format!("coordinate {k}"), low, high, nodes))
        .collect::<Result<_, _>>()?;
    let count = nodes.pow(dim as u32);
    let mut grid = Vec::with_capacity(count * dim);
    for number in 0..count {
        for (axis, of) in axes.iter().enumerate() {
            grid.push(of.node(number / nodes.pow((dim - 1 - axis) as u32) % nodes));
        }
    }
    Ok((axes, flow(&grid)?))
}

/// The axes of θ and ρ of a ring that holds these points.
fn ring(nodes: usize, points: &[f64]) -> Result<[GridAxis; 2], Error> {
    let radii: Vec<f64> = points.chunks_exact(2).map(|z| libm::hypot(z[0], z[1])).collect();
    let region = Region::around(1, [&radii[..]]).expect("points").widened(0.05);
    let (low, high) = (region.low[0], region.high[0]);
    if !(low > 0.0) {
        return Err(Error::invalid("ρ of a table", low, "a ring that does not reach 0"));
    }
    Ok([GridAxis::angle(nodes), GridAxis::new("ρ", low, high, nodes)?])
}

/// Points at (θ_i, ρ), ρ of each node one after another.
fn at_angles(angles: &GridAxis, radii: &[f64]) -> Vec<f64> {
    let nodes = radii.len() / angles.nodes;
    let of = |(number, &radius): (usize, &f64)| {
        let (s, c) = libm::sincos(angles.node(number / nodes));
        [radius * s, radius * c]
    };
    radii.iter().enumerate().flat_map(of).collect()
}

/// θ′ − θ of each node, without jumps from one to the next.
fn turns_of(angles: &GridAxis, images: &[f64]) -> Vec<f64> {
    let nodes = images.len() / 2 / angles.nodes;
    let mut out: Vec<f64> = Vec::with_capacity(images.len() / 2);
    for (number, z) in images.chunks_exact(2).enumerate() {
        let turned = libm::atan2(z[0], z[1]) - angles.node(number / nodes);
        let near = match number {
            0 => 0.0,
            _ if number % nodes == 0 => out[number - nodes],
            _ => out[number - 1],
        };
        out.push(near + libm::remainder(turned - near, TAU));
    }
    out
}

/// θ′ − θ and ρ′ of the nodes of a ring.
fn ring_of(
    nodes: usize,
    points: &[f64],
    flow: FlowOfPoints<'_>,
) -> Result<(Vec<GridAxis>, Vec<f64>), Error> {
    let [angles, radii] = ring(nodes, points)?;
    let each: Vec<f64> = (0..nodes * nodes).map(|number| radii.node(number % nodes)).collect();
    let images = flow(&at_angles(&angles, &each))?;
    let turned = turns_of(&angles, &images);
    let of = |(turned, z): (f64, &[f64])| [turned, libm::hypot(z[0], z[1])];
    let values = turned.into_iter().zip(images.chunks_exact(2)).flat_map(of).collect();
    Ok((vec![angles, radii], values))
}

/// S at the nodes (θ, ρ′): at each ρ′ its harmonics in θ from those of ψ − ψ′, and its mean from that of θ′ − θ.
fn generator_of(
    nodes: usize,
    points: &[f64],
    flow: FlowOfPoints<'_>,
) -> Result<(Vec<GridAxis>, Vec<f64>), Error> {
    const ITERATIONS: usize = 50;
    let [angles, radii] = ring(nodes, points)?;
    let wanted: Vec<f64> = (0..nodes * nodes).map(|number| radii.node(number % nodes)).collect();
    // The secant method finds the ρ that the map takes to each ρ′. It begins with slopes of 1: surfaces are near
    // circles.
    let mut start = wanted.clone();
    let mut images = flow(&at_angles(&angles, &start))?;
    for (number, pair) in images.chunks_exact(2).zip(images.chunks_exact(2).skip(1)).enumerate() {
        let [below, above] = [pair.0, pair.1].map(|z| libm::hypot(z[0], z[1]));
        if (number + 1) % nodes != 0 && !(below < above) {
            let (angle, radius) = (angles.node(number / nodes), wanted[number]);
            let found = format!("ρ′ = {below} and then {above} at θ = {angle:.3}, ρ = {radius:.3}");
            let expected = "a map whose ρ′ grows with ρ at every θ";
            return Err(Error::invalid("generating function", found, expected));
        }
    }
    let mut slopes = vec![1.0_f64; wanted.len()];
    let mut misses = vec![0.0; wanted.len()];
    let mut left = f64::INFINITY;
    for iteration in 0.. {
        let (before, mut worst) = (left, 0.0);
        for (number, z) in images.chunks_exact(2).enumerate() {
            let miss = wanted[number] - libm::hypot(z[0], z[1]);
            worst = max_or_nan(worst, miss.abs());
            // Of what the last change was meant to gain, so much is left.
            let missed = if iteration > 0 { misses[number] } else { 0.0 };
            if missed != 0.0 {
                slopes[number] *= (1.0 - miss / missed).clamp(0.25, 4.0);
            }
            misses[number] = miss;
        }
        left = worst;
        // Until rounding.
        let outer = radii.node(nodes - 1);
        if left < 1e-14 * outer || (left < 1e-11 * outer && left >= 0.5 * before) {
            break;
        }
        if iteration == ITERATIONS || !left.is_finite() {
            let what = "the start of a step of a generating function".to_owned();
            return Err(Error::NoConvergence { what, iterations: iteration, change: left });
        }
        for ((start, miss), slope) in start.iter_mut().zip(&misses).zip(&slopes) {
            *start += miss / slope;
        }
        images = flow(&at_angles(&angles, &start))?;
    }
    let turned = turns_of(&angles, &images);
    let mut values = vec![0.0; nodes * nodes];
    let mut means = vec![0.0; nodes];
    for j in 0..nodes {
        let of = |i: usize| {
            let number = i * nodes + j;
            0.5 * (start[number] * start[number] - wanted[number] * wanted[number])
        };
        let derivative: Vec<f64> = (0..nodes).map(of).collect();
        let flux = derivative.iter().sum::<f64>() / nodes as f64;
        if !(flux.abs() <= MOST_FLUX * wanted[j] * wanted[j]) {
            let found = format!("a mean of {flux:.1e} of ψ − ψ′ at ρ′ = {:.3}", wanted[j]);
            let expected = "0, as of a map that keeps area";
            return Err(Error::invalid("generating function", found, expected));
        }
        for (i, value) in antiderivative(&derivative).into_iter().enumerate() {
            values[i * nodes + j] = value;
        }
        let all = (0..nodes).map(|i| turned[i * nodes + j]);
        means[j] = radii.node(j) * all.sum::<f64>() / nodes as f64;
    }
    // Over a cell of a spline, the integral of its four basis functions.
    let slope = along(&radii, &means, 1);
    let mut mean = 0.0;
    for j in 0..nodes {
        for i in 0..nodes {
            values[i * nodes + j] += mean;
        }
        if j + 1 < nodes {
            let cell = [1.0, 11.0, 11.0, 1.0].iter().zip(&slope[j..]);
            mean += radii.step / 24.0 * cell.map(|(share, c)| share * c).sum::<f64>();
        }
    }
    Ok((vec![angles, radii], values))
}

/// Of ρ′², a mean of ψ − ψ′ that few nodes make of none, at most.
const MOST_FLUX: f64 = 2e-4;

/// A periodic function of mean 0 from its derivative at equal distances, by its harmonics below the highest.
fn antiderivative(derivative: &[f64]) -> Vec<f64> {
    let count = derivative.len();
    let angle = |k: usize| TAU * (k % count) as f64 / count as f64;
    let table: Vec<(f64, f64)> = (0..count).map(|k| libm::sincos(angle(k))).collect();
    let mut out = vec![0.0; count];
    for m in 1..count.div_ceil(2) {
        let (mut sine, mut cosine) = (0.0, 0.0);
        for (i, value) in derivative.iter().enumerate() {
            let (s, c) = table[m * i % count];
            sine += value * s;
            cosine += value * c;
        }
        let share = 2.0 / (count as f64 * m as f64);
        for (i, out) in out.iter_mut().enumerate() {
            let (s, c) = table[m * i % count];
            *out += share * (cosine * s - sine * c);
        }
    }
    out
}

/// All trajectories, one after another at each time: they share no lanes, since each looks elsewhere.
struct Steps<'a> {
    table: &'a StepTable,
    initial: &'a [f64],
    every: usize,
    out: &'a mut [f64],
}

impl Kernel for Steps<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Pack>(self) {
        let Self { table, initial, every, out } = self;
        let polar = table.kind != TableKind::Splines;
        let mut states = initial.to_vec();
        if polar {
            for z in states.chunks_exact_mut(2) {
                let angle = libm::atan2(z[0], z[1]);
                z[1] = libm::hypot(z[0], z[1]);
                z[0] = if angle < 0.0 { angle + TAU } else { angle };
            }
        }
        for kept in out.chunks_exact_mut(states.len()) {
            for z in states.chunks_exact_mut(table.dim) {
                for _ in 0..every {
                    table.step(z);
                }
            }
            kept.copy_from_slice(&states);
            if polar {
                for z in kept.chunks_exact_mut(2) {
                    let (s, c) = libm::sincos(z[0]);
                    (z[0], z[1]) = (z[1] * s, z[1] * c);
                }
            }
        }
    }
}
