//! Gauss–Legendre collocation: the reference flow, with an error estimate.

use super::integrator::Request;
use crate::error::Error;
use crate::scalar::max_or_nan;
use crate::system::Hamiltonian;

/// The s-stage Gauss–Legendre Runge–Kutta method: symplectic, of order 2s.
///
/// Source: Hairer, Lubich and Wanner, Geometric Numerical Integration, II.1.3,
/// <https://doi.org/10.1007/3-540-30666-8>.
#[derive(Clone, Debug)]
pub struct GaussLegendre {
    pub(super) nodes: Vec<f64>,
    pub(super) weights: Vec<f64>,
    /// a_ij, row by row.
    pub(super) matrix: Vec<f64>,
}

/// P_s(x) and P_s′(x).
fn legendre(stages: usize, x: f64) -> (f64, f64) {
    let (mut previous, mut current) = (1.0, x);
    for k in 2..=stages {
        let k = k as f64;
        (previous, current) = (current, ((2.0 * k - 1.0) * x * current - (k - 1.0) * previous) / k);
    }
    let slope = stages as f64 * (x * current - previous) / (x * x - 1.0);
    (current, slope)
}

/// Legendre polynomials P_0 … P_s at x.
fn legendre_values(stages: usize, x: f64) -> Vec<f64> {
    let mut values = vec![1.0, x];
    for k in 2..=stages {
        let n = k as f64;
        let next = ((2.0 * n - 1.0) * x * values[k - 1] - (n - 1.0) * values[k - 2]) / n;
        values.push(next);
    }
    values
}

/// Iterations for the stages of a step.
pub(super) const MAXIMUM: usize = 100;

fn out_of_range(step: usize) -> Error {
    Error::Diverged { what: "Gauss–Legendre".into(), place: format!("step {step}") }
}

impl GaussLegendre {
    /// The method of `stages` stages.
    ///
    /// Nodes by Newton's iteration on the Legendre polynomial. a_ij = ∫₀^{c_i}
    /// ℓ_j expanded in Legendre polynomials, whose integrals are known:
    /// no linear system is solved.
    ///
    /// # Panics
    /// When `stages` is 0.
    pub fn new(stages: usize) -> Self {
        assert!(stages > 0);
        let s = stages;
        let mut x = vec![0.0; s];
        let mut weights = vec![0.0; s];
        for i in 0..s {
            let mut root = -libm::cos(std::f64::consts::PI * (i as f64 + 0.75) / (s as f64 + 0.5));
            if s == 1 {
                root = 0.0;
            }
            for _ in 0..50 {
                let (value, slope) = legendre(s, root);
                let change = value / slope;
                root -= change;
                if change.abs() < 1e-16 {
                    break;
                }
            }
            let (_, slope) = legendre(s, root);
            x[i] = root;
            weights[i] = 1.0 / ((1.0 - root * root) * slope * slope);
        }
        // ℓ_j(x) = Σ_k (2k+1)·w_j·P_k(x_j)·P_k(x) with the weights of [0, 1], and
        // ∫_{-1}^x P_k = (P_{k+1}(x) − P_{k−1}(x))/(2k+1).
        let mut matrix = vec![0.0; s * s];
        for i in 0..s {
            let at_i = legendre_values(s, x[i]);
            for j in 0..s {
                let at_j = legendre_values(s, x[j]);
                let mut sum = x[i] + 1.0;
                for k in 1..s {
                    sum += at_j[k] * (at_i[k + 1] - at_i[k - 1]);
                }
                matrix[i * s + j] = 0.5 * weights[j] * sum;
            }
        }
        Self { nodes: x.iter().map(|v| 0.5 * (v + 1.0)).collect(), weights, matrix }
    }

    /// c_i.
    pub fn nodes(&self) -> &[f64] {
        &self.nodes
    }

    /// The number of stages s.
    pub fn stages(&self) -> usize {
        self.weights.len()
    }

    /// z ← the flow over `time` in `steps` equal steps.
    ///
    /// The stages are found by fixed-point iteration, until they change by
    /// rounding only; a step must therefore resolve the fastest oscillation.
    ///
    /// # Errors
    /// When a step does not converge or the numbers leave their range.
    #[inline(always)]
    pub fn integrate(
        &self,
        system: &impl Hamiltonian,
        z: &mut [f64],
        time: f64,
        steps: usize,
    ) -> Result<(), Error> {
        Error::check_count_range("steps", steps, 1, usize::MAX)?;
        let (s, dim) = (self.stages(), z.len());
        let h = time / steps as f64;
        let mut slopes = vec![0.0; s * dim];
        let mut updated = vec![0.0; s * dim];
        let mut stage = vec![0.0; dim];
        // Compensated: the increments are small against z.
        let mut carry = vec![0.0; dim];
        for step in 0..steps {
            if step == 0 {
                system.vector_field(z, 0.0, &mut stage);
                for block in slopes.chunks_exact_mut(dim) {
                    block.copy_from_slice(&stage);
                }
            }
            let mut last = f64::INFINITY;
            let mut iteration = 0;
            loop {
                for i in 0..s {
                    for d in 0..dim {
                        let mut sum = 0.0;
                        for j in 0..s {
                            sum = self.matrix[i * s + j].mul_add(slopes[j * dim + d], sum);
                        }
                        stage[d] = h.mul_add(sum, z[d]);
                    }
                    let now = (step as f64 + self.nodes[i]) * h;
                    system.vector_field(&stage, now, &mut updated[i * dim..(i + 1) * dim]);
                }
                let mut change = 0.0_f64;
                // What a stage is rounded by: its own size or its increment's.
                let mut scale = z.iter().map(|v| v.abs()).fold(0.0, max_or_nan);
                for (old, new) in slopes.iter().zip(&updated) {
                    scale = max_or_nan(scale, (h * new).abs());
                    let difference = (h * (new - old)).abs();
                    change = max_or_nan(change, difference);
                }
                std::mem::swap(&mut slopes, &mut updated);
                iteration += 1;
                if !change.is_finite() {
                    return Err(out_of_range(step));
                }
                // At the rounding level the changes stop shrinking.
                if change == 0.0 || (change <= 8.0 * f64::EPSILON * scale && change >= last) {
                    break;
                }
                if iteration == MAXIMUM {
                    return Err(Error::NoConvergence {
                        what: format!("Gauss–Legendre, step {step} of {h}"),
                        iterations: MAXIMUM,
                        change,
                    });
                }
                last = change;
            }
            for d in 0..dim {
                let mut sum = 0.0;
                for j in 0..s {
                    sum = self.weights[j].mul_add(slopes[j * dim + d], sum);
                }
                let increment = h.mul_add(sum, carry[d]);
                let next = z[d] + increment;
                carry[d] = increment - (next - z[d]);
                z[d] = next;
            }
            if z.iter().any(|v| !v.is_finite()) {
                return Err(out_of_range(step));
            }
        }
        Ok(())
    }
}

/// The reference flow: Gauss–Legendre, with the error estimated by half the
/// step.
#[derive(Clone, Debug)]
pub struct Reference {
    method: GaussLegendre,
    steps_per_time: f64,
    /// Of the steps so counted.
    halvings: u32,
}

/// A point of the reference flow.
#[derive(Clone, Debug)]
pub struct ReferenceValue {
    /// The point after the given time, from the finer resolution.
    pub point: Vec<f64>,
    /// The largest difference of a component between the two resolutions.
    pub error: f64,
}

impl Reference {
    /// The reference for `system` near z: 12 stages, one step for each radian of its
    /// fastest mode.
    pub fn new(system: &impl Hamiltonian, z: &[f64]) -> Self {
        Self {
            method: GaussLegendre::new(12),
            steps_per_time: system.fastest_frequency(z),
            halvings: 0,
        }
    }

    /// The reference for `system` whose steps ([`Reference::new`]) are halved until
    /// the error estimate over `time`, at 64 of these points (2n numbers each), is at the level of
    /// rounding or falls no more.
    ///
    /// # Errors
    /// When the system is not defined at a point, the flow leaves the finite numbers, or converges
    /// at none of the steps tried.
    pub fn calibrated(system: &impl Hamiltonian, points: &[f64], time: f64) -> Result<Self, Error> {
        const HALVINGS: usize = 8;
        let dim = 2 * system.dof();
        let stride = (points.len() / dim).div_ceil(64).max(1);
        points.chunks_exact(dim).try_for_each(|z| system.check_point(z))?;
        let judged = || points.chunks_exact(dim).step_by(stride);
        let fastest = judged().map(|z| system.fastest_frequency(z)).fold(0.0, max_or_nan);
        let steps_per_time = if fastest > 0.0 { fastest } else { 1.0 };
        let mut reference = Self { method: GaussLegendre::new(12), steps_per_time, halvings: 0 };
        let mut last = f64::INFINITY;
        let mut last_failure = None;
        for _ in 0..HALVINGS {
            let mut error = 0.0_f64;
            let mut scale = 1.0_f64;
            let mut failed = None;
            for point in judged() {
                match reference.flow_with_error(system, point, time) {
                    Ok(value) => {
                        error = max_or_nan(error, value.error);
                        scale = value.point.iter().map(|v| v.abs()).fold(scale, max_or_nan);
                    }
                    // Too long a step does not converge; half of it may.
                    Err(reason) => {
                        error = f64::INFINITY;
                        failed = Some(reason);
                    }
                }
            }
            if error <= Self::AT_ROUNDING * scale || (error.is_finite() && error > 0.5 * last) {
                return Ok(reference);
            }
            last = error;
            last_failure = failed;
            reference.steps_per_time = 2.0 * reference.steps(time) as f64 / time.abs();
        }
        match last_failure {
            Some(reason) => Err(reason),
            None if last.is_finite() => Ok(reference),
            None => Err(Error::Diverged {
                what: "Gauss–Legendre".into(),
                place: format!("the error estimate over time {time}"),
            }),
        }
    }

    /// An error estimate of this size, relative to the largest component, is
    /// rounding.
    const AT_ROUNDING: f64 = 1e-14;

    /// The number of steps over `time`.
    pub fn steps(&self, time: f64) -> usize {
        let steps = (self.steps_per_time * time.abs()).ceil().max(1.0) as usize;
        steps << self.halvings
    }

    /// z ← the flow over `time`.
    ///
    /// # Errors
    /// Those of [`GaussLegendre::integrate`].
    #[inline(always)]
    pub fn flow(&self, system: &impl Hamiltonian, z: &mut [f64], time: f64) -> Result<(), Error> {
        self.method.integrate(system, z, time, self.steps(time))
    }

    /// The same, of steps half as long.
    pub(super) fn finer(&self) -> Self {
        Self { halvings: self.halvings + 1, ..self.clone() }
    }

    /// Points ← the flow over `count` intervals of time, with the bits of each alone.
    pub(super) fn move_all(
        &self,
        system: &(impl Hamiltonian + Sync),
        points: &mut [f64],
        interval: f64,
        count: usize,
    ) -> Result<(), Error> {
        let steps = self.steps(interval);
        self.method.move_all(system, points, Request { interval, steps, kept: count })
    }

    /// The states of trajectories from each of the points in `initial`, 2n numbers each, at the times
    /// `interval`, 2·`interval`, … `kept`·`interval`: an array (kept, M, 2n). All threads share them,
    /// eight in the lanes of a register, each with the bits of [`Reference::flow`].
    ///
    /// # Errors
    /// As of [`Integrator::trajectories`](super::Integrator::trajectories).
    pub fn trajectories(
        &self,
        system: &(impl Hamiltonian + Sync),
        initial: &[f64],
        interval: f64,
        kept: usize,
    ) -> Result<Vec<f64>, Error> {
        Request { interval, steps: self.steps(interval), kept }.collocate(
            &self.method,
            system,
            initial,
        )
    }

    /// The flow at two resolutions, and their difference.
    ///
    /// # Errors
    /// Those of [`GaussLegendre::integrate`].
    pub fn flow_with_error(
        &self,
        system: &impl Hamiltonian,
        z: &[f64],
        time: f64,
    ) -> Result<ReferenceValue, Error> {
        let mut coarse = z.to_vec();
        let mut point = z.to_vec();
        self.flow(system, &mut coarse, time)?;
        self.finer().flow(system, &mut point, time)?;
        let error = coarse.iter().zip(&point).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
        Ok(ReferenceValue { point, error })
    }
}
