//! Twists as measures see them: the scales of the rounding errors of each of their shears.

use super::measured_step::StepMap;
use super::measured_step::{MeasuredStep, TrackedStep};
use super::rounding::{carry, hypot_or_nan, product};
use crate::layer::Twist;
use crate::phase::{Direction, Map};
use crate::scalar::{Dual, Over};

/// A part of a twist ([`Twist::apply_part`]) as a map of the point, the actions and the angles.
#[derive(Clone, Copy, Debug)]
struct TwistPart<'a, const D: usize> {
    twist: Twist<'a, f64, D>,
    part: usize,
}

impl<S: Over<f64>, const D: usize> Map<S> for TwistPart<'_, D> {
    fn dof(&self) -> usize {
        self.twist.shears.planes().extended_dof()
    }
    fn forward(&self, x: &mut [S]) {
        self.twist.apply_part(self.part, x);
    }
    fn inverse(&self, _: &mut [S]) {
        unreachable!("parts are followed one way only")
    }
}

/// Twists, whose many shears are one step. The errors of each are found by themselves, carried
/// to the end by the derivatives of those that come after it, and added in quadrature, as
/// those of other steps are: a bound run through all shears takes absolute values at each, and
/// loses that they cancel. No bound of the worst case, then.
#[derive(Clone, Copy, Debug)]
pub(super) struct TwistStep<'a, const D: usize>(pub(super) Twist<'a, f64, D>);

/// The parts of a twist at a point, of the extended dimension d each.
struct Parts<'a, const D: usize> {
    d: usize,
    steps: Vec<TrackedStep<TwistPart<'a, D>>>,
    /// The point that each part is applied to, of d numbers.
    points: Vec<Vec<f64>>,
    /// The derivatives of all parts before each, and of all after it: d × d, row by row.
    before: Vec<Vec<f64>>,
    after: Vec<Vec<f64>>,
}

impl<'a, const D: usize> Parts<'a, D> {
    fn new(twist: Twist<'a, f64, D>, z: &[f64]) -> Self {
        let d = 2 * twist.shears.planes().extended_dof();
        let part =
            |part| TrackedStep { map: TwistPart { twist, part }, direction: Direction::Forward };
        let steps: Vec<_> = (0..twist.parts()).map(part).collect();
        let mut unit = vec![0.0; d * d];
        unit.iter_mut().step_by(d + 1).for_each(|entry| *entry = 1.0);
        let mut point = z.to_vec();
        point.resize(d, 0.0);
        let (mut points, mut before, mut own) = (Vec::new(), Vec::new(), Vec::new());
        let mut running = unit.clone();
        for step in &steps {
            let mut jacobian = vec![0.0; d * d];
            let next = carry(step, &point, &unit, &mut jacobian);
            points.push(std::mem::replace(&mut point, next));
            let next = product(d, &jacobian, &running);
            before.push(std::mem::replace(&mut running, next));
            own.push(jacobian);
        }
        let mut after = vec![unit];
        for jacobian in own.iter().skip(1).rev() {
            after.push(product(d, &after[after.len() - 1], jacobian));
        }
        after.truncate(steps.len());
        after.reverse();
        Self { d, steps, points, before, after }
    }

    /// |the derivative of what comes after part k|·`error`, which has so many columns.
    fn at_the_end(&self, k: usize, error: &[f64], columns: usize) -> Vec<f64> {
        let mut out = vec![0.0; error.len()];
        let rows = self.after[k].chunks_exact(self.d);
        for (row, out) in rows.zip(out.chunks_exact_mut(columns)) {
            for (factor, error) in row.iter().zip(error.chunks_exact(columns)) {
                for (out, error) in out.iter_mut().zip(error) {
                    // What errs by nothing errs by nothing where a derivative overflows too.
                    if *error != 0.0 {
                        *out = factor.abs().mul_add(*error, *out);
                    }
                }
            }
        }
        out
    }
}

impl<const D: usize> MeasuredStep for TwistStep<'_, D> {
    fn apply(&self, z: &mut [f64]) {
        StepMap(self.0).forward(z);
    }

    fn apply_tangent(&self, z: &mut [Dual<f64, 8>]) {
        StepMap(self.0).forward(z);
    }

    fn jacobian_magnitude(&self, z: &[f64], before: &[f64], _: &[f64], e: &mut [f64]) {
        let (dim, parts) = (z.len(), Parts::new(self.0, z));
        let d = parts.d;
        let mut directions = vec![0.0; d * d];
        for (wide, row) in directions.chunks_exact_mut(d).zip(before.chunks_exact(dim)) {
            wide[..dim].copy_from_slice(row);
        }
        e.fill(0.0);
        for (k, step) in parts.steps.iter().enumerate() {
            let there = product(d, &parts.before[k], &directions);
            let mut error = vec![0.0; d * d];
            step.jacobian_magnitude(&parts.points[k], &there, &[], &mut error);
            let error = parts.at_the_end(k, &error, d);
            for (e, error) in e.chunks_exact_mut(dim).zip(error.chunks_exact(d)) {
                for (e, error) in e.iter_mut().zip(error) {
                    *e = hypot_or_nan(*e, *error);
                }
            }
        }
    }

    fn value_magnitude(&self, z: &[f64], _: &[f64], delta: &mut [f64]) {
        let parts = Parts::new(self.0, z);
        delta.fill(0.0);
        for (k, step) in parts.steps.iter().enumerate() {
            let mut error = vec![0.0; parts.d];
            step.value_magnitude(&parts.points[k], &[], &mut error);
            for (delta, error) in delta.iter_mut().zip(parts.at_the_end(k, &error, 1)) {
                *delta = hypot_or_nan(*delta, error);
            }
        }
    }

    fn curvature_magnitude(&self, z: &[f64], spread: &[f64], out: &mut [f64]) {
        let parts = Parts::new(self.0, z);
        out.fill(0.0);
        for (k, step) in parts.steps.iter().enumerate() {
            let reach = |row: &[f64]| -> f64 {
                row.iter().zip(spread).map(|(factor, spread)| factor.abs() * spread.abs()).sum()
            };
            let spread: Vec<f64> = parts.before[k].chunks_exact(parts.d).map(reach).collect();
            let mut bend = vec![0.0; parts.d];
            step.curvature_magnitude(&parts.points[k], &spread, &mut bend);
            for (out, bend) in out.iter_mut().zip(parts.at_the_end(k, &bend, 1)) {
                *out += bend;
            }
        }
    }
}
