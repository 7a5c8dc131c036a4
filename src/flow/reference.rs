//! The reference flow: Gauss–Legendre collocation with an error estimate.

use super::GaussLegendre;
use super::request::Request;
use crate::error::Error;
use crate::scalar::max_or_nan;
use crate::stopping::is_stopped;
use crate::system::Hamiltonian;

/// The reference flow: Gauss–Legendre collocation, with the error estimated by halving the
/// step.
///
/// Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, II.4,
/// <https://doi.org/10.1007/978-3-540-78862-1>, for the estimate by half the step.
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
                if is_stopped() {
                    return Err(Error::Stopped { what: "flow".into() });
                }
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
        let request = Request { interval, steps: self.steps(interval), kept };
        self.method.trajectories(system, initial, request)
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
