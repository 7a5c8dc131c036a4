//! Couplings as measures see them.

use super::measured_step::{MeasuredStep, ROOM, StepMap, TrackedStep, at_most};
use crate::layer::TurnedCoupling;
use crate::phase::Direction;
use crate::scalar::{Dual, Elementary, Scalar};

/// A turned coupling. The scales of its errors are found by running it; how far it is from linear is
/// derived by hand, since a neuron that saturates on both sides of a point is flat wherever it is looked at, and is a
/// step in between.
pub(super) struct CouplingStep<'a, const D: usize> {
    coupling: TurnedCoupling<'a, f64, D>,
    tracked: TrackedStep<StepMap<TurnedCoupling<'a, f64, D>>>,
}

impl<'a, const D: usize> CouplingStep<'a, D> {
    pub(super) fn new(coupling: TurnedCoupling<'a, f64, D>) -> Self {
        let tracked = TrackedStep { map: StepMap(coupling), direction: Direction::Forward };
        Self { coupling, tracked }
    }
}

/// Of tanh next to a, for errors up to a hundred times d: a bound of its slope, and of how far it is from linear over
/// d.
fn tanh_near(a: f64, d: f64) -> (f64, f64) {
    let slope = at_most(1.0, 4.0 * Elementary::exp(-2.0 * (a.abs() - ROOM * d)));
    // |tanh″| ≤ 2 sech².
    (slope, 2.0 * slope * at_most(1.0 + d, d * d))
}

impl<const D: usize> MeasuredStep for CouplingStep<'_, D> {
    fn apply(&self, z: &mut [f64]) {
        self.tracked.apply(z);
    }

    fn apply_tangent(&self, z: &mut [Dual<f64, 8>]) {
        self.tracked.apply_tangent(z);
    }

    fn jacobian_magnitude(&self, z: &[f64], before: &[f64], after: &[f64], e: &mut [f64]) {
        self.tracked.jacobian_magnitude(z, before, after, e);
    }

    fn value_magnitude(&self, z: &[f64], after: &[f64], delta: &mut [f64]) {
        self.tracked.value_magnitude(z, after, delta);
    }

    fn may_be_symplectic(&self) -> bool {
        false
    }

    /// In turned coordinates, of the momentum f(τ)p + cy: |p||f′| times the bend of τ, |c| times that of y, and the
    /// product of what p and f move by; f′ ≤ 4. Of a rotation all is at most the sum over the plane.
    fn curvature_magnitude(&self, z: &[f64], spread: &[f64], out: &mut [f64]) {
        const STEEPEST: f64 = 4.0;
        let (turn, shear) = self.coupling.parts();
        let [w_in, b_in, w_scale, b_scale, w_shift, b_shift] = shear.weights();
        let (n, h, c) = (z.len() / 2, b_in.len(), shear.scale());
        out.fill(0.0);
        if c == 0.0 {
            return;
        }
        let mut turned = z.to_vec();
        turn.apply(&mut turned, false);
        let reach: Vec<f64> = (0..n).map(|i| spread[i].abs() + spread[n + i].abs()).collect();
        // Of each neuron its value, how far it moves, and how far that is from linear.
        let mut neurons = Vec::with_capacity(h);
        for j in 0..h {
            let (mut a, mut d) = (b_in[j], 0.0);
            for i in 0..n {
                a = turned[i].mul_add(w_in[i * h + j], a);
                d = w_in[i * h + j].abs().mul_add(reach[i], d);
            }
            let (slope, bend) = tanh_near(a, d);
            neurons.push((a.tanh_sech2().0, slope * d, bend));
        }
        let output = |weights: &[f64], bias: f64, i: usize| {
            let mut sums = (bias, 0.0, 0.0);
            for (weight, (value, moved, bend)) in weights[i * h..].iter().zip(&neurons) {
                sums.0 = value.mul_add(*weight, sums.0);
                sums.1 = weight.abs().mul_add(*moved, sums.1);
                sums.2 = weight.abs().mul_add(*bend, sums.2);
            }
            (sums.0 * c, sums.1 * c.abs(), sums.2 * c.abs())
        };
        for i in 0..n {
            let (x, x_moved, x_bend) = output(w_scale, b_scale[i], i);
            let (y, y_moved, y_bend) = output(w_shift, b_shift[i], i);
            let (slope, bend) = tanh_near(x, x_moved + x_bend);
            let factor_bend = STEEPEST * slope.mul_add(x_bend, bend);
            let factor_moved = STEEPEST * slope * x_moved;
            let momentum = turned[n + i].abs() + y.abs();
            let bent = momentum * factor_bend + (reach[i] + y_moved) * factor_moved + y_bend;
            out[i] = bent;
            out[n + i] = bent;
        }
    }
}
