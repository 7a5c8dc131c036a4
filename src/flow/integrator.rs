//! The integrators by name, on many points.

use super::{GaussLegendre, Splitting, SplittingSteps, runge_kutta_4};
use crate::error::Error;
use crate::network::{TOGETHER, load_groups};
use crate::scalar::{Kernel, Pack, WIDTH, on_lanes};
use crate::system::{Splittable, System};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// A numerical integrator, as scenes name it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Integrator {
    /// [`runge_kutta_4`].
    #[serde(rename = "runge-kutta-4")]
    RungeKutta4,
    /// [`Splitting::STRANG`].
    Strang,
    /// [`Splitting::YOSHIDA_4`].
    #[serde(rename = "yoshida-4")]
    Yoshida4,
    /// [`Splitting::ABA_864`].
    #[serde(rename = "aba-864")]
    Aba864,
    /// [`Splitting::ABA_1064`].
    #[serde(rename = "aba-1064")]
    Aba1064,
    /// [`GaussLegendre`].
    GaussLegendre {
        /// s, the number of stages.
        stages: usize,
    },
}

impl Integrator {
    /// The name used in tables.
    pub fn name(self) -> String {
        match self {
            Self::RungeKutta4 => "RK4".into(),
            Self::GaussLegendre { stages: 1 } => "Gauss–Legendre, 1 stage".into(),
            Self::GaussLegendre { stages } => format!("Gauss–Legendre, {stages} stages"),
            Self::Strang | Self::Yoshida4 | Self::Aba864 | Self::Aba1064 => {
                self.splitting().map_or_else(String::new, |splitting| splitting.name.into())
            }
        }
    }

    /// The splitting behind the name, if it is one.
    pub fn splitting(self) -> Option<Splitting> {
        match self {
            Self::Strang => Some(Splitting::STRANG),
            Self::Yoshida4 => Some(Splitting::YOSHIDA_4),
            Self::Aba864 => Some(Splitting::ABA_864),
            Self::Aba1064 => Some(Splitting::ABA_1064),
            Self::RungeKutta4 | Self::GaussLegendre { .. } => None,
        }
    }

    /// Fails unless it has 1 to 64 stages.
    ///
    /// # Errors
    /// [`Error::CountOutOfRange`] with the number.
    pub fn check(self) -> Result<(), Error> {
        const MOST: usize = 64;
        match self {
            Self::GaussLegendre { stages } => Error::check_count_range("stages", stages, 1, MOST),
            _ => Ok(()),
        }
    }

    /// Fails where a distance of two of its states is not finite.
    pub(super) fn check_finite(self, distance: f64, time: f64) -> Result<(), Error> {
        if distance.is_finite() {
            return Ok(());
        }
        let place = format!("a trajectory over time {time}");
        Err(Error::Diverged { what: self.name(), place })
    }

    /// The states of trajectories from each of the points in `initial`, 2n
    /// numbers each, at the times `interval`, 2·`interval`, … `kept`·`interval`,
    /// `steps` equal steps in each: an array (kept, M, 2n).
    ///
    /// Eight trajectories go together, one in each lane, several such groups a stage after
    /// another in splittings, and more on all threads: the same bits as of each alone, on
    /// any processor. Gauss–Legendre moves one after another, since each takes its own
    /// number of iterations.
    ///
    /// # Errors
    /// When there are no steps, points are not whole, the interval is not finite, the
    /// states do not fit into memory, or the stages of Gauss–Legendre do not converge.
    /// The other methods may leave the finite numbers: they say so by what they give.
    pub fn trajectories(
        self,
        system: &System,
        initial: &[f64],
        interval: f64,
        steps: usize,
        kept: usize,
    ) -> Result<Vec<f64>, Error> {
        let request = Request { integrator: self, interval, steps, kept };
        match system {
            System::Oscillators(system) => request.run(system, initial),
            System::ParticleField(system) => request.run(system, initial),
        }
    }
}

/// Trajectories of one task, at most.
const BLOCK: usize = 4 * WIDTH;

/// A method with what it knows before the first step.
enum Prepared {
    RungeKutta4,
    Splitting(SplittingSteps<f64>),
    GaussLegendre(GaussLegendre),
}

struct Request {
    integrator: Integrator,
    interval: f64,
    steps: usize,
    kept: usize,
}

impl Request {
    fn run(self, system: &(impl Splittable + Sync), initial: &[f64]) -> Result<Vec<f64>, Error> {
        self.integrator.check()?;
        let Self { integrator, interval, steps, kept } = self;
        let dim = 2 * system.dof();
        Error::check_count_range("steps", steps, 1, usize::MAX)?;
        Error::check_rows("initial points", initial.len(), dim)?;
        Error::check_finite("interval", interval)?;
        if initial.is_empty() || kept == 0 {
            return Ok(Vec::new());
        }
        let prepared = match (integrator, integrator.splitting()) {
            (_, Some(splitting)) => {
                Prepared::Splitting(splitting.steps(system, interval / steps as f64))
            }
            (Integrator::GaussLegendre { stages }, _) => {
                Prepared::GaussLegendre(GaussLegendre::new(stages))
            }
            _ => Prepared::RungeKutta4,
        };
        let points = initial.len() / dim;
        let block = points.div_ceil(rayon::current_num_threads());
        let block = block.next_multiple_of(WIDTH).clamp(WIDTH, BLOCK) * dim;
        let too_many =
            || Error::invalid("states to keep", format!("{kept} of {points} points"), "fewer");
        let size = initial.len().checked_mul(kept).ok_or_else(too_many)?;
        let (mut by_block, mut out) = (Vec::new(), Vec::new());
        for space in [&mut by_block, &mut out] {
            Vec::try_reserve_exact(space, size).map_err(|_| too_many())?;
        }
        by_block.resize(size, 0.0);
        let tasks = initial.par_chunks(block).zip(by_block.par_chunks_mut(block * kept));
        tasks.try_for_each(|(initial, states)| {
            let prepared = &prepared;
            let task = Trajectories { prepared, system, interval, steps, kept, initial, states };
            on_lanes::<WIDTH, _>(task)
        })?;
        for t in 0..kept {
            for states in by_block.chunks_exact(kept * dim) {
                out.extend_from_slice(&states[t * dim..(t + 1) * dim]);
            }
        }
        Ok(out)
    }
}

/// The trajectories of a block of points.
struct Trajectories<'a, H> {
    prepared: &'a Prepared,
    system: &'a H,
    interval: f64,
    steps: usize,
    kept: usize,
    initial: &'a [f64],
    /// All states of one trajectory after another.
    states: &'a mut [f64],
}

impl<H: Splittable> Kernel for Trajectories<'_, H> {
    type Output = Result<(), Error>;

    #[inline(always)]
    fn run<V: Pack>(self) -> Result<(), Error> {
        let Self { prepared, system, interval, steps, kept, initial, states } = self;
        let dim = 2 * system.dof();
        if let Prepared::GaussLegendre(method) = prepared {
            let mut z = vec![0.0; dim];
            let trajectories = states.chunks_exact_mut(kept * dim);
            for (initial, states) in initial.chunks_exact(dim).zip(trajectories) {
                z.copy_from_slice(initial);
                for state in states.chunks_exact_mut(dim) {
                    method.integrate(system, &mut z, interval, steps)?;
                    state.copy_from_slice(&z);
                }
            }
            return Ok(());
        }
        let mut z = vec![V::zero(); TOGETHER * dim];
        let together = TOGETHER * V::LANES * dim;
        for (initial, states) in initial.chunks(together).zip(states.chunks_mut(together * kept)) {
            let size = load_groups(initial, dim, &mut z);
            let z = &mut z[..size];
            for number in 0..kept {
                match prepared {
                    Prepared::Splitting(method) => method.take(system, z, steps),
                    _ => {
                        for z in z.chunks_exact_mut(dim) {
                            runge_kutta_4(system, z, interval, steps);
                        }
                    }
                }
                let groups = states.chunks_mut(V::LANES * kept * dim);
                for (z, states) in z.chunks_exact(dim).zip(groups) {
                    let mut column = [0.0; WIDTH];
                    for (component, lanes) in z.iter().enumerate() {
                        lanes.store(&mut column[..V::LANES]);
                        for (states, value) in states.chunks_exact_mut(kept * dim).zip(column) {
                            states[number * dim + component] = value;
                        }
                    }
                }
            }
        }
        Ok(())
    }
}
