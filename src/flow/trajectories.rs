//! Several trajectories, and those of the reference flow.

use super::integrator::check_repeated;
use super::{Integrator, Reference};
use crate::error::Error;
use crate::scalar::max_or_nan;
use crate::system::{Hamiltonian, System};

/// The states of M trajectories at T equal intervals of time: an array (T, M, 2n),
/// the first entry being the initial points.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectories {
    values: Vec<f64>,
    dim: usize,
    count: usize,
}

impl Trajectories {
    /// An array (T, M, 2n), as [`rollout`](crate::network::rollout) gives it.
    ///
    /// # Errors
    /// [`Error::Invalid`] when there is no trajectory, no number a point, or the
    /// array is not a whole number of states of all trajectories.
    pub fn new(values: Vec<f64>, dim: usize, count: usize) -> Result<Self, Error> {
        let size = dim.saturating_mul(count);
        if size == 0 || values.is_empty() || !values.len().is_multiple_of(size) {
            let expected = format!("states of {count} trajectories of {dim} numbers");
            return Err(Error::invalid("trajectories", values.len(), expected));
        }
        Ok(Self { values, dim, count })
    }

    /// The number 2n of coordinates of a state.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// The number M of trajectories.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The number T of states of each trajectory.
    pub fn states(&self) -> usize {
        self.values.len() / (self.dim * self.count)
    }

    /// State number `t` of trajectory `m`.
    ///
    /// # Panics
    /// When there is no such state.
    pub fn state(&self, t: usize, m: usize) -> &[f64] {
        assert!(m < self.count);
        let start = (t * self.count + m) * self.dim;
        &self.values[start..start + self.dim]
    }

    /// The states of trajectory `m`, one after another.
    ///
    /// # Panics
    /// When there is no such trajectory.
    pub fn orbit(&self, m: usize) -> impl ExactSizeIterator<Item = &[f64]> {
        (0..self.states()).map(move |t| self.state(t, m))
    }

    /// A quantity of each state: trajectories of one number.
    pub fn quantity(&self, of: impl Fn(&[f64]) -> f64) -> Self {
        let values = self.values.chunks_exact(self.dim).map(of).collect();
        Self { values, dim: 1, count: self.count }
    }

    /// The first `states` states of each trajectory, at least one, or all when there are fewer.
    #[must_use]
    pub fn first(mut self, states: usize) -> Self {
        self.values.truncate(states.max(1).saturating_mul(self.dim * self.count));
        self
    }

    /// The same trajectories in other coordinates: `map` moves all states, in rows.
    #[must_use]
    pub fn moved(mut self, map: impl FnOnce(&mut [f64])) -> Self {
        map(&mut self.values);
        self
    }

    /// All states, (T, M, 2n): one row of trajectories for each time.
    pub fn values(&self) -> &[f64] {
        &self.values
    }
}

/// Trajectories that others are compared with.
#[derive(Clone, Debug)]
pub struct ReferenceTrajectories {
    /// The states, of the finer of two resolutions.
    pub trajectories: Trajectories,
    /// The largest distance of the two resolutions at the ends.
    pub error: f64,
}

impl ReferenceTrajectories {
    /// The trajectories of `system` from each of the points in `initial`, 2n numbers
    /// each: `states` states, the first included, `interval` apart.
    ///
    /// All threads share them, eight in the lanes of a register, with the bits of each alone.
    ///
    /// # Errors
    /// Those of [`Reference::calibrated`] and [`Trajectories::new`].
    pub fn of_flow(
        system: &(impl Hamiltonian + Sync),
        initial: &[f64],
        interval: f64,
        states: usize,
    ) -> Result<Self, Error> {
        if states > 2 {
            check_repeated(system, initial, interval)?;
        }
        let reference = Reference::calibrated(system, initial, interval)?;
        let dim = 2 * system.dof();
        let kept = states.saturating_sub(1);
        let fine = reference.finer().trajectories(system, initial, interval, kept)?;
        let mut coarse = initial.to_vec();
        reference.move_all(system, &mut coarse, interval, kept)?;
        let ends = if kept > 0 { &fine[fine.len() - initial.len()..] } else { initial };
        let pairs = ends.chunks_exact(dim).zip(coarse.chunks_exact(dim));
        let error = pairs.map(|(a, b)| distance(a, b)).fold(0.0, max_or_nan);
        let values = [initial, &fine].concat();
        Ok(Self { trajectories: Trajectories::new(values, dim, initial.len() / dim)?, error })
    }

    /// As [`ReferenceTrajectories::of_flow`], by an integrator, with `steps` steps in an interval at the coarser
    /// resolution. The trajectories are those of twice as many steps; in place of an averaged equation or a
    /// multi-revolution composition, they are those of stroboscopic averaging of sixth order.
    ///
    /// # Errors
    /// Those of [`Integrator::trajectories`] and [`Trajectories::new`]; when an end is not of finite
    /// numbers.
    pub fn of_integrator(
        system: &System,
        initial: &[f64],
        interval: f64,
        states: usize,
        integrator: Integrator,
        steps: usize,
    ) -> Result<Self, Error> {
        let (dim, kept) = (2 * system.dof(), states.saturating_sub(1));
        let coarse = integrator.trajectories(system, initial, interval, steps, kept)?;
        let fine = integrator.finer_trajectories(system, initial, interval, steps, kept)?;
        let distances =
            fine.chunks_exact(dim).zip(coarse.chunks_exact(dim)).rev().take(initial.len() / dim);
        let error = distances.map(|(a, b)| distance(a, b)).fold(0.0, max_or_nan);
        integrator.check_finite(error, interval * kept as f64)?;
        let values = [initial, &fine].concat();
        Ok(Self { trajectories: Trajectories::new(values, dim, initial.len() / dim)?, error })
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}
