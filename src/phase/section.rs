//! Surfaces of section whose area form is not dq∧dp, and their canonical charts.

use crate::error::Error;
use crate::scalar::{Elementary, max_or_nan};
use faer::Mat;
use faer::linalg::solvers::SolveLstsq;
use serde::{Deserialize, Serialize};

/// A canonical chart of a plane (x, y) with the area form ρ dx∧dy over a box.
///
/// Its coordinates are q = y and p = ∫ρ dx′/scale from the middle of the box to x, so that dp∧dq = ρ dx∧dy/scale.
///
/// ρ is a sum Σ c_jk T_j(x) T_k(y) of Chebyshev polynomials over the box, and p is the exact integral of this sum.
/// Newton's method, safeguarded by bisection, finds x at (q, p).
///
/// A map that preserves ρ dx∧dy is symplectic in (q, p). An example is the return map of the field lines of a
/// magnetic field B to a half-plane φ = constant of cylindrical coordinates, with x = R, y = Z and ρ = B_φ (Cary and
/// Littlejohn, <https://doi.org/10.1016/0003-4916(83)90313-5>).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AreaDensity {
    low: [f64; 2],
    high: [f64; 2],
    scale: f64,
    /// The highest degrees in x and in y.
    degrees: [usize; 2],
    /// c_jk, with j varying fastest.
    coefficients: Vec<f64>,
    /// ∂c_jk/∂λ of each control that the density depends on.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    changes: Vec<Vec<f64>>,
    /// The largest difference of this ρ from the given one, where they were compared, over the largest |ρ|.
    error: f64,
}

/// The change of a density per unit of a control, and the largest offset of that control.
pub type Change<'a> = (&'a dyn Fn(f64, f64) -> f64, f64);

/// The highest degree along an axis.
const MOST_DEGREE: usize = 96;
/// The degrees that are tried, one after another.
const DEGREES: [usize; 7] = [6, 12, 18, 24, 36, 48, MOST_DEGREE];
/// An error over the largest density below which no higher degree is tried: what rounding leaves of sums of products.
const AS_GOOD: f64 = 2e-14;
/// How many higher degrees are tried after the best so far.
const PATIENCE: usize = 6;
/// The most controls that a density depends on.
const MOST_CONTROLS: usize = 64;
/// Newton steps for x, bisections among them.
pub(crate) const STEPS: usize = 80;

impl AreaDensity {
    /// The chart for a density that is given as a function. Among the degrees that are tried it has the first with an
    /// error at the level of rounding, or else the one with the smallest error.
    ///
    /// # Errors
    /// [`Error::Invalid`] when the box has no extent, the scale is not positive, or ρ is not positive and finite
    /// somewhere, with the place.
    pub fn of_function(
        density: impl Fn(f64, f64) -> f64,
        low: [f64; 2],
        high: [f64; 2],
        scale: f64,
    ) -> Result<Self, Error> {
        check_box(low, high, scale)?;
        let mut best: Option<Self> = None;
        for degree in DEGREES {
            let made = Self::interpolating(&density, low, high, scale, degree)?;
            let better = best.as_ref().is_none_or(|best| made.error < best.error);
            let done = made.error <= AS_GOOD;
            if better {
                best = Some(made);
            }
            if done {
                break;
            }
        }
        let best = best.expect("a degree was tried");
        best.check_positive()?;
        Ok(best)
    }

    /// The interpolation at Chebyshev points, judged between them.
    fn interpolating(
        density: &impl Fn(f64, f64) -> f64,
        low: [f64; 2],
        high: [f64; 2],
        scale: f64,
        degree: usize,
    ) -> Result<Self, Error> {
        let count = degree + 1;
        let angle = |k: usize| std::f64::consts::PI * (k as f64 + 0.5) / count as f64;
        let nodes: Vec<f64> = (0..count).map(|k| Elementary::sin_cos(angle(k)).1).collect();
        let at = |axis: usize, s: f64| {
            let middle = 0.5 * (low[axis] + high[axis]);
            middle + 0.5 * (high[axis] - low[axis]) * s
        };
        let mut values = Vec::with_capacity(count * count);
        for &t in &nodes {
            for &s in &nodes {
                values.push(density(at(0, s), at(1, t)));
            }
        }
        // The discrete cosine transform along both axes.
        let transform = |values: &[f64]| -> Vec<f64> {
            (0..count)
                .map(|j| {
                    let share = if j == 0 { 1.0 } else { 2.0 } / count as f64;
                    let term = |k: usize| values[k] * Elementary::sin_cos(j as f64 * angle(k)).1;
                    share * (0..count).map(term).sum::<f64>()
                })
                .collect()
        };
        let rows: Vec<f64> = values.chunks_exact(count).flat_map(transform).collect();
        let mut coefficients = vec![0.0; count * count];
        for j in 0..count {
            let column: Vec<f64> = (0..count).map(|k| rows[k * count + j]).collect();
            for (k, value) in transform(&column).into_iter().enumerate() {
                coefficients[k * count + j] = value;
            }
        }
        let (degrees, changes) = ([degree; 2], Vec::new());
        let mut out = Self { low, high, scale, degrees, coefficients, changes, error: f64::NAN };
        let (mut error, mut size) = (0.0, 0.0);
        for k in 0..=count {
            for j in 0..=count {
                let (s, t) =
                    (2.0 * j as f64 / count as f64 - 1.0, 2.0 * k as f64 / count as f64 - 1.0);
                let (x, y) = (at(0, s), at(1, t));
                let given = density(x, y);
                size = max_or_nan(size, given.abs());
                error = max_or_nan(error, (out.density(x, y) - given).abs());
            }
        }
        // The series of a change that is 0 everywhere is 0 too.
        out.error = if size == 0.0 { error } else { error / size };
        match out.error.is_finite() {
            true => Ok(out),
            false => Err(positive_expected(f64::NAN, [low[0], low[1]], "within the box")),
        }
    }

    /// The chart for densities on a grid, by least squares. Its degree is the one at which a fit to every other node
    /// has the smallest error on all nodes. `values` has x varying fastest.
    ///
    /// # Errors
    /// When coordinates do not increase, there are fewer than eight along an axis or not one value for each pair of
    /// them, the scale is not positive, or ρ is not positive and finite somewhere, with the place; when the values are
    /// off the fit by more than a tenth of the largest.
    pub fn of_grid(x: &[f64], y: &[f64], values: &[f64], scale: f64) -> Result<Self, Error> {
        check_axes(x, y)?;
        Error::check_count("section: density: numbers", x.len() * y.len(), values.len())?;
        let bad = values.iter().position(|v| !(*v > 0.0 && v.is_finite()));
        if let Some(index) = bad {
            let place = [x[index % x.len()], y[index / x.len()]];
            return Err(positive_expected(values[index], place, "of the grid"));
        }
        let (low, high) = ends_of(x, y);
        check_box(low, high, scale)?;
        let mut out = Self::of_best_degree(x, y, values, scale)?;
        let size = values.iter().copied().fold(0.0, max_or_nan);
        // That of the fit to a quarter of them bounds that of the fit to all.
        out.error = max_or_nan(out.error, out.largest_difference(x, y, values) / size);
        out.check_positive()?;
        out.check_error()?;
        Ok(out)
    }

    /// A fit to the first of some grids, one after another in `values`, at the degree for which fits of every other
    /// node have the smallest error on all nodes of the grid that is worst; with that error over the largest value.
    fn of_best_degree(x: &[f64], y: &[f64], values: &[f64], scale: f64) -> Result<Self, Error> {
        let (low, high) = ends_of(x, y);
        let size = values.iter().copied().fold(0.0, max_or_nan);
        let fitted = |values: &[f64], degree: usize, stride: usize| {
            let thin = |axis: &[f64]| axis.iter().step_by(stride).copied().collect::<Vec<f64>>();
            let (xs, ys) = (thin(x), thin(y));
            let rows = values.chunks_exact(x.len()).step_by(stride);
            let kept: Vec<f64> = rows.flat_map(|row| row.iter().step_by(stride)).copied().collect();
            let coefficients = grid_coefficients(&xs, &ys, &kept, low, high, degree);
            let (degrees, changes) = ([degree; 2], Vec::new());
            Self { low, high, scale, degrees, coefficients, changes, error: f64::NAN }
        };
        // Between nodes at equal distances a polynomial of too high a degree swings: the others show it.
        let most = x.len().min(y.len()).div_ceil(2) - 1;
        let grids = || values.chunks_exact(x.len() * y.len());
        let mut best: Option<(usize, f64)> = None;
        for degree in 2..=most.min(MOST_DEGREE) {
            let of = |grid: &[f64]| fitted(grid, degree, 2).largest_difference(x, y, grid);
            let error = grids().map(of).fold(0.0, max_or_nan) / size;
            match best {
                Some((found, least)) if !(error < least) => {
                    if degree > found + PATIENCE {
                        break;
                    }
                }
                _ => best = Some((degree, error)),
            }
        }
        let first = grids().next();
        let (Some((degree, error)), Some(first)) = (best, first) else {
            return Err(Error::invalid("section: density", "a grid", "one that a polynomial fits"));
        };
        Ok(Self { error, ..fitted(first, degree, 1) })
    }

    /// The chart for densities on a grid at several values of controls, on which they depend linearly: the density at
    /// `origin` and its changes, by least squares at each node, with the degree that [`AreaDensity::of_grid`] finds for
    /// the worst of the grids. `values` has the grid of one row of `controls` after another. The error is the largest
    /// on any of them.
    ///
    /// # Errors
    /// Those of [`AreaDensity::of_grid`]; when the rows of `controls` are not as long as `origin`, or too few or too
    /// similar for the changes to be known.
    pub fn of_grids(
        x: &[f64],
        y: &[f64],
        values: &[f64],
        scale: f64,
        controls: &[f64],
        origin: &[f64],
    ) -> Result<Self, Error> {
        check_axes(x, y)?;
        let (low, high) = ends_of(x, y);
        check_box(low, high, scale)?;
        let (count, nodes) = (origin.len(), x.len() * y.len());
        Error::check_count_range("section: controls", count, 1, MOST_CONTROLS)?;
        Error::check_rows("section: lambda", controls.len(), count)?;
        let rows = controls.len() / count;
        Error::check_count("section: density: numbers", rows * nodes, values.len())?;
        controls.iter().try_for_each(|v| Error::check_finite("section: lambda", *v))?;
        let of_row = |row: usize| format!("of grid {row} (counted from 0)");
        let bad = values.iter().position(|v| !(*v > 0.0 && v.is_finite()));
        if let Some(index) = bad {
            let (row, node) = (index / nodes, index % nodes);
            let place = [x[node % x.len()], y[node / x.len()]];
            return Err(positive_expected(values[index], place, &of_row(row)));
        }
        let offset = |row: usize, of: usize| controls[row * count + of] - origin[of];
        // Columns of the size of one: controls may have units of any size.
        let sizes: Vec<f64> = (0..count)
            .map(|of| (0..rows).map(|row| offset(row, of).abs()).fold(0.0, max_or_nan))
            .collect();
        let matrix = Mat::from_fn(rows, count + 1, |row, of| match of {
            0 => 1.0,
            of => offset(row, of - 1) / sizes[of - 1],
        });
        /// Below this ratio to the largest singular value controls have not been varied independently.
        const DEPENDENT: f64 = 1e-8;
        let singular = matrix.singular_values().unwrap_or_default();
        let known =
            rows > count && matches!(singular[..], [first, .., last] if last > DEPENDENT * first);
        if !known {
            let found = format!("{rows} rows for {count} controls");
            let expected =
                "values of the controls from which a constant and a slope by each follow";
            return Err(Error::invalid("section: lambda", found, expected));
        }
        let right = Mat::from_fn(rows, nodes, |row, node| values[row * nodes + node]);
        let solution = matrix.qr().solve_lstsq(&right);
        let grid = |of: usize| (0..nodes).map(|node| solution[(of, node)]).collect::<Vec<f64>>();
        let mut out = Self::of_best_degree(x, y, values, scale)?;
        let [degree, _] = out.degrees;
        out.coefficients = grid_coefficients(x, y, &grid(0), out.low, out.high, degree);
        for (of, size) in sizes.iter().enumerate() {
            let change: Vec<f64> = grid(of + 1).iter().map(|value| value / size).collect();
            out.changes.push(grid_coefficients(x, y, &change, out.low, out.high, degree));
        }
        let size = values.iter().copied().fold(0.0, max_or_nan);
        for row in 0..rows {
            let offsets: Vec<f64> = (0..count).map(|of| offset(row, of)).collect();
            let there = out.at_offsets(&offsets)?;
            there.check_positive().map_err(|e| e.with_place(format!("density {}", of_row(row))))?;
            let given = &values[row * nodes..(row + 1) * nodes];
            out.error = max_or_nan(out.error, there.largest_difference(x, y, given) / size);
        }
        out.check_positive().map_err(|e| e.with_place("density at the origin of the controls"))?;
        out.check_error()?;
        Ok(out)
    }

    /// Fails if the values of a grid are those of no smooth density.
    fn check_error(&self) -> Result<(), Error> {
        /// The largest relative error of a chart that says anything.
        const MOST: f64 = 0.1;
        if self.error <= MOST {
            return Ok(());
        }
        let found = format!("values that a polynomial fits to {:.1e} of the largest", self.error);
        let expected = format!("a smooth density on so fine a grid that it fits to {MOST}");
        Err(Error::invalid("section: density", found, expected))
    }

    /// The largest difference from values on a grid, with x varying fastest.
    fn largest_difference(&self, x: &[f64], y: &[f64], values: &[f64]) -> f64 {
        let mut largest = 0.0;
        for (y, row) in y.iter().zip(values.chunks_exact(x.len())) {
            let (series, _) = self.along_x(*y);
            for (x, value) in x.iter().zip(row) {
                let found = chebyshev(&series, self.unit(0, *x));
                largest = max_or_nan(largest, (found - value).abs());
            }
        }
        largest
    }

    /// Fails unless the chart is valid; for charts that are read from files.
    ///
    /// # Errors
    /// Those of [`AreaDensity::of_function`], and [`Error::WrongCount`] of coefficients.
    pub fn check(&self) -> Result<(), Error> {
        check_box(self.low, self.high, self.scale)?;
        for degree in self.degrees {
            Error::check_count_range("section: degree", degree, 0, MOST_DEGREE)?;
        }
        let count = (self.degrees[0] + 1) * (self.degrees[1] + 1);
        Error::check_count("section: coefficients", count, self.coefficients.len())?;
        for change in &self.changes {
            Error::check_count("section: coefficients of a control", count, change.len())?;
        }
        let all = self.coefficients.iter().chain(self.changes.iter().flatten());
        all.into_iter().try_for_each(|c| Error::check_finite("section", *c))?;
        self.check_positive()
    }

    /// The same chart with a density that is linear in controls, as B_φ is in the currents of coils: each change is
    /// multiplied by the offset of its control from the value that this density is for, and added. The changes are
    /// interpolated at the degrees of this density; their errors count at the largest offset, which stands beside
    /// each.
    ///
    /// # Errors
    /// [`Error::Invalid`] where one is not finite, with the place.
    pub fn with_changes(mut self, changes: &[Change<'_>]) -> Result<Self, Error> {
        let [degree, _] = self.degrees;
        // Its error counts as a share of what it is added to.
        let size = self.coefficients[0].abs();
        for (change, furthest) in changes {
            let made = Self::interpolating(change, self.low, self.high, self.scale, degree)?;
            let own = made.coefficients.iter().map(|c| c.abs()).fold(0.0, max_or_nan);
            self.error = max_or_nan(self.error, furthest.abs() * made.error * own / size);
            self.changes.push(made.coefficients);
        }
        Ok(self)
    }

    /// The chart at these offsets of the controls from the values that it is for; unchanged where its density depends
    /// on no controls.
    ///
    /// # Errors
    /// When there is not one number for each control. That ρ is positive there is checked by [`AreaDensity::check`]
    /// only.
    pub fn at_offsets(&self, offsets: &[f64]) -> Result<Self, Error> {
        if self.changes.is_empty() {
            return Ok(self.clone());
        }
        Error::check_count("controls of a section", self.changes.len(), offsets.len())?;
        let mut coefficients = self.coefficients.clone();
        for (offset, change) in offsets.iter().zip(&self.changes) {
            for (sum, c) in coefficients.iter_mut().zip(change) {
                *sum = offset.mul_add(*c, *sum);
            }
        }
        Ok(self.with_coefficients(coefficients))
    }

    /// The chart of the same box with another density, which depends on no controls.
    fn with_coefficients(&self, coefficients: Vec<f64>) -> Self {
        let Self { low, high, scale, degrees, error, .. } = *self;
        Self { low, high, scale, degrees, coefficients, changes: Vec::new(), error }
    }

    /// ∂p/∂λ at (x, y) for the control with this number, from 0; 0 for a density that does not
    /// depend on it.
    pub fn by_control(&self, number: usize, [x, y]: [f64; 2]) -> f64 {
        let Some(change) = self.changes.get(number) else { return 0.0 };
        let [_, p] = self.with_coefficients(change.clone()).to_canonical([x, y]);
        p
    }

    /// Fails unless ρ is positive on a grid finer than its degrees.
    fn check_positive(&self) -> Result<(), Error> {
        // |T_j| ≤ 1: a constant that outweighs all other coefficients needs no grid. The sum of these may be too small
        // by its rounding.
        let (constant, others) = (self.coefficients[0], &self.coefficients[1..]);
        let most: f64 = others.iter().map(|c| c.abs()).sum();
        if constant > (1.0 + 1e-10) * most && constant <= 0.25 * f64::MAX {
            return Ok(());
        }
        let [across, along] = self.degrees.map(|degree| 2 * degree + 2);
        for k in 0..=along {
            for j in 0..=across {
                let share = [j as f64 / across as f64, k as f64 / along as f64];
                let [x, y] = [0, 1].map(|a| self.low[a] + share[a] * (self.high[a] - self.low[a]));
                let found = self.density(x, y);
                if !(found > 0.0 && found.is_finite()) {
                    return Err(positive_expected(found, [x, y], "of the section"));
                }
            }
        }
        Ok(())
    }

    /// The lower corner of the box, (x, y).
    pub fn low(&self) -> [f64; 2] {
        self.low
    }

    /// The upper corner of the box of the section, x and y.
    pub fn high(&self) -> [f64; 2] {
        self.high
    }

    /// The scale, by which ∫ρ dx is divided.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// The largest difference from the given density, over its largest value: on a grid between the nodes of an
    /// interpolation, or at nodes that include those left out of a fit.
    pub fn error(&self) -> f64 {
        self.error
    }

    /// The degrees in x and y.
    pub fn degrees(&self) -> [usize; 2] {
        self.degrees
    }

    /// The coefficients c_jk of T_j(x) T_k(y) over the box, with j varying fastest.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Whether (x, y) is in the box.
    pub fn contains(&self, x: f64, y: f64) -> bool {
        let within = |v: f64, axis: usize| v >= self.low[axis] && v <= self.high[axis];
        within(x, 0) && within(y, 1)
    }

    fn unit(&self, axis: usize, value: f64) -> f64 {
        let (low, high) = (self.low[axis], self.high[axis]);
        (2.0 * value - (low + high)) / (high - low)
    }

    /// The coefficients of ρ(·, y) along x, and of its derivative by y.
    fn along_x(&self, y: f64) -> (Vec<f64>, Vec<f64>) {
        let t = self.unit(1, y);
        let slope = 2.0 / (self.high[1] - self.low[1]);
        let (count, rows) = (self.degrees[0] + 1, self.degrees[1] + 1);
        let (mut values, mut slopes) = (vec![0.0; count], vec![0.0; count]);
        let (mut terms, mut derivatives) = ([1.0, t], [0.0, 1.0]);
        for k in 0..rows {
            let row = &self.coefficients[k * count..(k + 1) * count];
            for (j, c) in row.iter().enumerate() {
                values[j] += c * terms[0];
                slopes[j] += c * derivatives[0] * slope;
            }
            let next = 2.0 * t * terms[1] - terms[0];
            let next_derivative = 2.0 * (terms[1] + t * derivatives[1]) - derivatives[0];
            (terms, derivatives) = ([terms[1], next], [derivatives[1], next_derivative]);
        }
        (values, slopes)
    }

    /// ρ(x, y), from the series.
    pub fn density(&self, x: f64, y: f64) -> f64 {
        chebyshev(&self.along_x(y).0, self.unit(0, x))
    }

    /// ∫ from the middle to x of a series along x, over the scale.
    pub(crate) fn integral(&self, series: &[f64]) -> Vec<f64> {
        let half = 0.5 * (self.high[0] - self.low[0]) / self.scale;
        let of = |j: usize| series.get(j).copied().unwrap_or(0.0);
        let mut out = vec![0.0; series.len() + 1];
        for (j, out) in out.iter_mut().enumerate().skip(1) {
            let before = if j == 1 { 2.0 * of(0) } else { of(j - 1) };
            *out = half * (before - of(j + 1)) / (2.0 * j as f64);
        }
        out[0] = -chebyshev(&out, 0.0);
        out
    }

    /// (q, p) at (x, y): NaN outside the box.
    pub fn to_canonical(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        if !self.contains(x, y) {
            return [f64::NAN; 2];
        }
        let integral = self.integral(&self.along_x(y).0);
        [y, chebyshev(&integral, self.unit(0, x))]
    }

    /// (x, y) at (q, p): NaN where there is none in the box. Points on its border are accepted up to rounding.
    pub fn to_data(&self, [q, p]: [f64; 2]) -> [f64; 2] {
        let y = q;
        if !(y >= self.low[1] && y <= self.high[1]) {
            return [f64::NAN; 2];
        }
        let density = self.along_x(y).0;
        let integral = self.integral(&density);
        let slope = 0.5 * (self.high[0] - self.low[0]) / self.scale;
        let (mut low, mut high) = (-1.0, 1.0);
        let border = [chebyshev(&integral, low) - p, chebyshev(&integral, high) - p];
        // Rounding of p is of the size of its range.
        let rounding = 4.0 * f64::EPSILON * (border[1] - border[0]);
        if !(border[0] <= rounding && border[1] >= -rounding) {
            return [f64::NAN; 2];
        }
        let mut s = -border[0] / (border[1] - border[0]) * 2.0 - 1.0;
        for _ in 0..STEPS {
            s = if s > low && s < high { s } else { 0.5 * (low + high) };
            let missed = chebyshev(&integral, s) - p;
            if missed > 0.0 {
                high = s;
            } else {
                low = s;
            }
            let step = missed / (slope * chebyshev(&density, s));
            s -= step;
            if step.abs() <= f64::EPSILON {
                break;
            }
        }
        let s = s.clamp(-1.0, 1.0);
        let middle = 0.5 * (self.low[0] + self.high[0]);
        [0.5f64.mul_add((self.high[0] - self.low[0]) * s, middle), y]
    }

    /// ∂p/∂x and ∂p/∂y at (x, y): q is y.
    pub fn slopes(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (density, change) = self.along_x(y);
        let s = self.unit(0, x);
        [chebyshev(&density, s) / self.scale, chebyshev(&self.integral(&change), s)]
    }
}

fn positive_expected(found: f64, [x, y]: [f64; 2], of: &str) -> Error {
    Error::invalid("section: density", found, "a positive number")
        .with_place(format!("(x, y) = ({x}, {y}) {of}"))
}

/// The box of a grid.
fn ends_of(x: &[f64], y: &[f64]) -> ([f64; 2], [f64; 2]) {
    ([x[0], y[0]], [x[x.len() - 1], y[y.len() - 1]])
}

/// Fails unless both axes of a grid have enough coordinates, in increasing order.
fn check_axes(x: &[f64], y: &[f64]) -> Result<(), Error> {
    for (name, axis) in [("section: x", x), ("section: y", y)] {
        Error::check_count_range(&format!("{name}: numbers"), axis.len(), 8, 1 << 10)?;
        axis.iter().try_for_each(|v| Error::check_finite(name, *v))?;
        if let Some(pair) = axis.windows(2).find(|pair| !(pair[0] < pair[1])) {
            let found = format!("{} after {}", pair[1], pair[0]);
            return Err(Error::invalid(name, found, "numbers that grow"));
        }
    }
    Ok(())
}

fn check_box(low: [f64; 2], high: [f64; 2], scale: f64) -> Result<(), Error> {
    Error::check_range("section: scale", scale, Error::LEAST_POSITIVE, f64::MAX)?;
    for (axis, name) in ["section: x", "section: y"].into_iter().enumerate() {
        let (low, high) = (low[axis], high[axis]);
        [low, high].iter().try_for_each(|v| Error::check_finite(name, *v))?;
        if !(low < high) {
            return Err(Error::invalid(name, format!("from {low} to {high}"), "an interval"));
        }
    }
    Ok(())
}

/// Σ c_j T_j(s) by Clenshaw's recurrence.
fn chebyshev(coefficients: &[f64], s: f64) -> f64 {
    let (mut b, mut before) = (0.0, 0.0);
    for c in coefficients.iter().skip(1).rev() {
        (b, before) = ((2.0 * s).mul_add(b, c - before), b);
    }
    coefficients.first().map_or(0.0, |c| s.mul_add(b, c - before))
}

/// Least squares along x, and then along y.
fn grid_coefficients(
    x: &[f64],
    y: &[f64],
    values: &[f64],
    low: [f64; 2],
    high: [f64; 2],
    degree: usize,
) -> Vec<f64> {
    let count = degree + 1;
    let basis = |axis: usize, at: &[f64]| {
        Mat::from_fn(at.len(), count, |k, j| {
            let s = (2.0 * at[k] - (low[axis] + high[axis])) / (high[axis] - low[axis]);
            let mut terms = [1.0, s];
            for _ in 0..j {
                terms = [terms[1], (2.0 * s).mul_add(terms[1], -terms[0])];
            }
            terms[0]
        })
    };
    let right = Mat::from_fn(x.len(), y.len(), |j, k| values[k * x.len() + j]);
    let by_x = basis(0, x).qr().solve_lstsq(&right);
    let right = Mat::from_fn(y.len(), count, |k, j| by_x[(j, k)]);
    let both = basis(1, y).qr().solve_lstsq(&right);
    (0..count).flat_map(|k| (0..count).map(move |j| (k, j))).map(|at| both[at]).collect()
}

/// Charts for the planes of data whose columns are not canonical, one for each degree of freedom.
///
/// The columns are x₁ … xₙ, y₁ … yₙ with the form Σ ρ_j dx_j∧dy_j, up to a scale, which has to be the same for all
/// planes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Section {
    /// The chart of each plane (x_j, y_j); none where its columns are q_j and p_j.
    planes: Vec<Option<AreaDensity>>,
    /// The values of the controls that the densities are for; empty where they depend on none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    origin: Vec<f64>,
}

impl Section {
    /// The section of these charts.
    ///
    /// # Errors
    /// When there is no chart, one is not valid, or the scales differ, where a plane without a chart has scale 1: Ω
    /// would then not be the canonical form.
    pub fn new(planes: Vec<Option<AreaDensity>>) -> Result<Self, Error> {
        Self::of_controls(planes, &[])
    }

    /// The section of charts whose densities depend on controls, and are for these values of them.
    ///
    /// # Errors
    /// Those of [`Section::new`]; when there is not one finite value for each control.
    pub fn of_controls(planes: Vec<Option<AreaDensity>>, origin: &[f64]) -> Result<Self, Error> {
        let out = Self { planes, origin: origin.to_vec() };
        out.check(out.planes.len())?;
        Ok(out)
    }

    /// The section of one plane with this chart, whose density depends on no controls.
    pub fn of_plane(density: AreaDensity) -> Self {
        Self { planes: vec![Some(density)], origin: Vec::new() }
    }

    /// The same section, whose densities are given at these values of the controls, in place of those that it was made
    /// with; the same where they depend on none.
    ///
    /// # Errors
    /// Those of [`Section::at_controls`].
    pub fn with_origin(&self, values: &[f64]) -> Result<Self, Error> {
        if !self.depends_on_controls() {
            return Ok(self.clone());
        }
        let mut out = self.at_controls(values)?;
        for (plane, own) in out.planes.iter_mut().zip(&self.planes) {
            if let (Some(plane), Some(own)) = (plane, own) {
                plane.changes.clone_from(&own.changes);
            }
        }
        out.origin = values.to_vec();
        Ok(out)
    }

    fn check_origin(&self) -> Result<(), Error> {
        for plane in self.planes.iter().flatten().filter(|plane| !plane.changes.is_empty()) {
            let what = "values of the controls that the densities of a section are for";
            Error::check_count(what, plane.changes.len(), self.origin.len())?;
        }
        self.origin.iter().try_for_each(|value| Error::check_finite("control", *value))
    }

    /// Fails like [`Section::new`], or if the degrees of freedom are not `dof`.
    ///
    /// # Errors
    /// Those of [`Section::new`].
    pub fn check(&self, dof: usize) -> Result<(), Error> {
        Error::check_count("section: planes", dof, self.planes.len())?;
        if self.planes.iter().all(Option::is_none) {
            return Err(Error::invalid("section", "no density", "that of a plane at least"));
        }
        self.planes.iter().flatten().try_for_each(AreaDensity::check)?;
        self.check_origin()?;
        let scale = |plane: &Option<AreaDensity>| plane.as_ref().map_or(1.0, AreaDensity::scale);
        let first = scale(&self.planes[0]);
        match self.planes.iter().map(scale).find(|other| *other != first) {
            None => Ok(()),
            Some(other) => {
                let expected = format!("{first:e}, that of the first plane");
                Err(Error::invalid("section: scale", other, expected))
            }
        }
    }

    /// This section of a file, about the middle `nominal` of the ranges of the controls of its network. Older files do
    /// not say what values of the controls densities are for: these.
    ///
    /// # Errors
    /// Those of [`Section::check`]; when the densities depend on other controls than the network.
    #[cfg(feature = "files")]
    pub(crate) fn of_network(mut self, dof: usize, nominal: &[f64]) -> Result<Self, Error> {
        if self.depends_on_controls() {
            if self.origin.is_empty() {
                self.origin = nominal.to_vec();
            }
            self.check(dof)?;
            self = self.with_origin(nominal)?;
        }
        self.check(dof)?;
        Ok(self)
    }

    /// The section in words, for a reader of a report.
    pub fn describe(&self) -> String {
        let planes =
            self.planes.iter().enumerate().filter_map(|(j, plane)| Some((j + 1, plane.as_ref()?)));
        let words = planes.map(|(j, plane)| {
            let ([a, b], [c, d]) = (plane.low, plane.high);
            let controls = match plane.changes.len() {
                0 => "",
                1 => ", linear in the control,",
                _ => ", linear in the controls,",
            };
            format!(
                "plane {j}: x from {a:.6} to {c:.6}, y from {b:.6} to {d:.6}, a density of degrees {} and {}{controls} \
                 that errs by {:.1e}",
                plane.degrees[0], plane.degrees[1], plane.error
            )
        });
        format!(
            "The columns of the data are x1 … xn, y1 … yn of a section; the network is trained in q = y and \
             p = ∫ρ dx/scale ({}). q1 … qn, p1 … pn of a report are these",
            words.collect::<Vec<_>>().join("; ")
        )
    }

    /// What laws that are tested in canonical coordinates say of the data, in words.
    pub fn note_on_laws(&self) -> String {
        format!(
            "the laws are tested in the canonical coordinates of the section: in the columns of the data areas are \
             kept as well as its density is known, which errs by {:.1e} of its largest value",
            self.error()
        )
    }

    /// The charts at these values of the controls; the same where the densities depend on none.
    ///
    /// # Errors
    /// When there is not one value for each control. Whether the densities are positive there [`Section::check`] says.
    pub fn at_controls(&self, values: &[f64]) -> Result<Self, Error> {
        if !self.depends_on_controls() {
            return Ok(self.clone());
        }
        Error::check_count("controls of a section", self.origin.len(), values.len())?;
        let offsets: Vec<f64> = values.iter().zip(&self.origin).map(|(a, b)| a - b).collect();
        let of = |plane: &Option<AreaDensity>| {
            plane.as_ref().map(|plane| plane.at_offsets(&offsets)).transpose()
        };
        let planes = self.planes.iter().map(of).collect::<Result<_, _>>()?;
        Ok(Self { planes, origin: Vec::new() })
    }

    /// The degrees of freedom n.
    pub fn dof(&self) -> usize {
        self.planes.len()
    }

    /// Whether some density depends on controls.
    pub fn depends_on_controls(&self) -> bool {
        self.planes.iter().flatten().any(|plane| !plane.changes.is_empty())
    }

    /// The chart of each plane.
    pub fn planes(&self) -> &[Option<AreaDensity>] {
        &self.planes
    }

    /// The largest error of a density.
    pub fn error(&self) -> f64 {
        self.planes.iter().flatten().map(AreaDensity::error).fold(0.0, max_or_nan)
    }

    /// Converts points in rows of 2n numbers from data to canonical coordinates: NaN in a plane where a point is
    /// outside its box.
    pub fn to_canonical(&self, points: &mut [f64]) {
        self.each(points, AreaDensity::to_canonical);
    }

    /// Converts points in rows of 2n numbers from canonical coordinates to data: NaN in a plane
    /// where a point is outside its box.
    pub fn to_data(&self, points: &mut [f64]) {
        self.each(points, AreaDensity::to_data);
    }

    fn each(&self, points: &mut [f64], chart: impl Fn(&AreaDensity, [f64; 2]) -> [f64; 2]) {
        let dof = self.dof();
        for z in points.chunks_exact_mut(2 * dof) {
            for (j, plane) in self.planes.iter().enumerate() {
                let Some(plane) = plane else { continue };
                [z[j], z[dof + j]] = chart(plane, [z[j], z[dof + j]]);
            }
        }
    }

    /// Fails at the first of these points of data that is outside the box of a plane.
    ///
    /// # Errors
    /// With the row and the point.
    pub fn check_points(&self, place: &str, points: &[f64]) -> Result<(), Error> {
        let dof = self.dof();
        for (row, z) in points.chunks_exact(2 * dof).enumerate() {
            for (j, plane) in self.planes.iter().enumerate() {
                let Some(plane) = plane else { continue };
                let (x, y) = (z[j], z[dof + j]);
                if !plane.contains(x, y) {
                    let ([a, b], [c, d]) = (plane.low, plane.high);
                    let found = format!("({x}, {y}) in row {row} (counted from 0)");
                    let expected = format!("points of the section, from ({a}, {b}) to ({c}, {d})");
                    return Err(Error::content(place, expected, found));
                }
            }
        }
        Ok(())
    }

    /// The derivative of (q, p) by the control with this number, from 0, at a fixed point of data: 2n numbers.
    pub fn by_control(&self, number: usize, point: &[f64]) -> Vec<f64> {
        let dof = self.dof();
        let mut out = vec![0.0; 2 * dof];
        for (j, plane) in self.planes.iter().enumerate() {
            let at = [point[j], point[dof + j]];
            out[dof + j] = plane.as_ref().map_or(0.0, |plane| plane.by_control(number, at));
        }
        out
    }

    /// Converts a tangent vector of 2n numbers, at a point of data, from canonical coordinates to those of the data.
    pub fn direction_to_data(&self, direction: &mut [f64], at: &[f64]) {
        let dof = self.dof();
        for (j, plane) in self.planes.iter().enumerate() {
            let Some(plane) = plane else { continue };
            // δy = δq, δx = (δp − ∂p/∂y δq)/∂p/∂x.
            let [by_x, by_y] = plane.slopes([at[j], at[dof + j]]);
            let (q, p) = (direction[j], direction[dof + j]);
            (direction[j], direction[dof + j]) = ((-by_y).mul_add(q, p) / by_x, q);
        }
    }

    /// Converts the Jacobian of a map, 2n × 2n numbers row by row, from canonical coordinates to those of the data;
    /// `from` and `to` are a point and its image, both in the data.
    pub fn jacobian_of_data(&self, jacobian: &mut [f64], from: &[f64], to: &[f64]) {
        let dof = self.dof();
        let dim = 2 * dof;
        for (j, plane) in self.planes.iter().enumerate() {
            let Some(plane) = plane else { continue };
            // Columns: ∂/∂x = ∂p/∂x ∂/∂p, ∂/∂y = ∂/∂q + ∂p/∂y ∂/∂p.
            let [by_x, by_y] = plane.slopes([from[j], from[dof + j]]);
            for row in jacobian.chunks_exact_mut(dim) {
                let (q, p) = (row[j], row[dof + j]);
                (row[j], row[dof + j]) = (by_x * p, by_y.mul_add(p, q));
            }
        }
        for column in 0..dim {
            let mut direction: Vec<f64> = (0..dim).map(|i| jacobian[i * dim + column]).collect();
            self.direction_to_data(&mut direction, to);
            (0..dim).for_each(|i| jacobian[i * dim + column] = direction[i]);
        }
    }
}
