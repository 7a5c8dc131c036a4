//! Trajectories of many points: the blocks that threads share, and the lanes of a block.

use crate::error::Error;
use crate::network::{Pace, load_groups};
use crate::scalar::{Kernel, Pack, WIDTH, on_independent_lanes};
use crate::stopping::{is_asked, is_stopped};
use crate::system::Hamiltonian;
use rayon::prelude::*;

/// Groups of points that make each step together: while the last results of one are awaited, the
/// processor has the others.
pub(super) const TOGETHER: usize = 4;

/// Trajectories of one task, at most.
const BLOCK: usize = 4 * WIDTH;

/// A method on lanes, with what it knows before the first step.
pub(super) trait Method<H>: Sync {
    /// What is known of a point from its entering on.
    type Known<V: Pack>;

    /// Moves several points, 2n lanes each, with what is known of them, over an interval.
    fn take<V: Pack>(
        &self,
        system: &H,
        z: &mut [V],
        known: &[Self::Known<V>],
        interval: f64,
        steps: usize,
    );

    /// Whether it moves points in other coordinates than canonical ones.
    const NATURAL: bool = false;

    /// Several points, from canonical coordinates to those of the method, and what is known of each.
    #[inline(always)]
    fn enter<V: Pack>(&self, system: &H, z: &mut [V]) -> Vec<Self::Known<V>> {
        let _ = (system, z);
        Vec::new()
    }

    /// Several points, from the coordinates of the method to canonical ones.
    #[inline(always)]
    fn leave<V: Pack>(&self, system: &H, z: &mut [V]) {
        let _ = (system, z);
    }
}

/// All states of some trajectories from their initial points.
pub(super) type Each<'a> = &'a (dyn Fn(&[f64], &mut [f64]) -> Result<(), Error> + Sync);
pub(super) type States = Result<Vec<f64>, Error>;

/// Does some work at the pace of the thread that asks for it: without a pause where nobody may stop it.
pub(super) fn at_pace<T>(work: impl FnOnce(&mut Pace<'_>) -> Result<T, Error>) -> Result<T, Error> {
    let mut go_on = || !is_stopped();
    let mut pace = if is_asked() { Pace::asking(&mut go_on) } else { Pace::unbroken() };
    work(&mut pace)
}

/// Equal intervals of time, each of equal steps, as many as there are states to keep.
#[derive(Clone, Copy)]
pub(super) struct Request {
    pub(super) interval: f64,
    pub(super) steps: usize,
    pub(super) kept: usize,
}

impl Request {
    /// By a method on lanes.
    pub(super) fn step<H: Hamiltonian + Sync, M: Method<H>>(
        &self,
        method: &M,
        system: &H,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        let dim = 2 * system.dof();
        // Between coordinates of its own and canonical ones a state is rounded, or moved by as much as the method errs.
        // So trajectories are not taken in parts, and a stop is heard between groups of points.
        if M::NATURAL {
            return self.run(system, initial, &self.in_lanes(method, system));
        }
        self.in_parts(dim, initial, &|request, initial, is_first| {
            request.run_part(system, initial, &request.in_lanes(method, system), is_first)
        })
    }

    /// [`Request::run`] of the first part of a request, or of a later one, whose points are states of the part before.
    pub(super) fn run_part(
        &self,
        system: &impl Hamiltonian,
        initial: &[f64],
        each: Each<'_>,
        is_first: bool,
    ) -> States {
        match is_first {
            true => self.run(system, initial, each),
            false => self.run_blocks(2 * system.dof(), initial, each),
        }
    }

    /// The states of a request, interval after interval where the thread may be stopped between them: `of` gives those
    /// of a part from its first points, of the first part or of a later one.
    pub(super) fn in_parts(
        self,
        dim: usize,
        initial: &[f64],
        of: &dyn Fn(Self, &[f64], bool) -> States,
    ) -> States {
        let evaluations = (initial.len() / dim).saturating_mul(self.steps);
        at_pace(|pace| {
            let first = pace.part(evaluations).min(self.kept);
            if first == self.kept {
                return of(self, initial, true);
            }
            let mut room = self.room(dim, initial)?;
            let (mut left, mut last) = (self.kept, first);
            while left > 0 {
                let part = Self { kept: last, ..self };
                let states = match room.len().checked_sub(initial.len()) {
                    None => of(part, initial, true)?,
                    Some(before) => of(part, &room[before..], false)?,
                };
                room.extend(states);
                left -= last;
                pace.pause("flow", evaluations.saturating_mul(last))?;
                last = pace.part(evaluations).min(left);
            }
            Ok(room)
        })
    }

    /// Room for all its states.
    fn room(&self, dim: usize, initial: &[f64]) -> States {
        let (kept, points) = (self.kept, initial.len() / dim);
        let too_many =
            || Error::invalid("states to keep", format!("{kept} of {points} points"), "fewer");
        let size = initial.len().checked_mul(kept).ok_or_else(too_many)?;
        let mut room = Vec::new();
        room.try_reserve_exact(size).map_err(|_| too_many())?;
        Ok(room)
    }

    fn in_lanes<H: Hamiltonian + Sync>(
        &self,
        method: &impl Method<H>,
        system: &H,
    ) -> impl Fn(&[f64], &mut [f64]) -> Result<(), Error> + Sync {
        |initial, states| {
            let request = *self;
            on_independent_lanes(Trajectories { method, system, request, initial, states });
            Ok(())
        }
    }

    /// `each` gives all states of one trajectory after another, of a block of points.
    pub(super) fn run(&self, system: &impl Hamiltonian, initial: &[f64], each: Each<'_>) -> States {
        let dim = 2 * system.dof();
        Error::check_count_range("steps", self.steps, 1, usize::MAX)?;
        Error::check_rows("initial points", initial.len(), dim)?;
        Error::check_finite("interval", self.interval)?;
        if initial.is_empty() || self.kept == 0 {
            return Ok(Vec::new());
        }
        initial.chunks_exact(dim).try_for_each(|z| system.check_point(z))?;
        self.run_blocks(dim, initial, each)
    }

    /// [`Request::run`] on points that were checked, 2n = `dim` numbers each: compiled once.
    pub(super) fn run_blocks(&self, dim: usize, initial: &[f64], each: Each<'_>) -> States {
        let kept = self.kept;
        let points = initial.len() / dim;
        let block = points.div_ceil(rayon::current_num_threads());
        let block = block.next_multiple_of(WIDTH).clamp(WIDTH, BLOCK) * dim;
        let (mut by_block, mut out) = (self.room(dim, initial)?, self.room(dim, initial)?);
        by_block.resize(initial.len() * kept, 0.0);
        at_pace(|pace| {
            let (mut initial, mut states) = (initial, &mut by_block[..]);
            while !initial.is_empty() {
                let points = pace.part(self.steps.saturating_mul(kept)).min(initial.len() / dim);
                // As many blocks as there are threads, or more, and the same as without a pause.
                let together = block * rayon::current_num_threads();
                let size = (points * dim).next_multiple_of(together).min(initial.len());
                let (here, rest) = initial.split_at(size);
                let (of_here, of_rest) = std::mem::take(&mut states).split_at_mut(size * kept);
                let tasks = here.par_chunks(block).zip(of_here.par_chunks_mut(block * kept));
                tasks.try_for_each(|(initial, states)| each(initial, states))?;
                pace.pause("flow", (size / dim).saturating_mul(self.steps).saturating_mul(kept))?;
                (initial, states) = (rest, of_rest);
            }
            Ok(())
        })?;
        for t in 0..kept {
            for states in by_block.chunks_exact(kept * dim) {
                out.extend_from_slice(&states[t * dim..(t + 1) * dim]);
            }
        }
        Ok(out)
    }
}

/// The trajectories of a block of points, on lanes.
struct Trajectories<'a, H, M> {
    method: &'a M,
    system: &'a H,
    request: Request,
    initial: &'a [f64],
    /// All states of one trajectory after another.
    states: &'a mut [f64],
}

impl<H: Hamiltonian, M: Method<H>> Kernel for Trajectories<'_, H, M> {
    type Output = ();

    #[inline(always)]
    fn run<V: Pack>(self) {
        let Self { method, system, request: Request { interval, steps, kept }, initial, states } =
            self;
        let dim = 2 * system.dof();
        let mut z = vec![V::zero(); TOGETHER * dim];
        let mut shown = vec![V::zero(); if M::NATURAL { TOGETHER * dim } else { 0 }];
        let together = TOGETHER * V::LANES * dim;
        for (initial, states) in initial.chunks(together).zip(states.chunks_mut(together * kept)) {
            let size = load_groups(initial, dim, &mut z);
            let z = &mut z[..size];
            let known = method.enter(system, z);
            for number in 0..kept {
                method.take(system, z, &known, interval, steps);
                let groups = states.chunks_mut(V::LANES * kept * dim);
                let canonical = if M::NATURAL {
                    let shown = &mut shown[..size];
                    shown.copy_from_slice(z);
                    method.leave(system, shown);
                    &*shown
                } else {
                    &*z
                };
                for (z, states) in canonical.chunks_exact(dim).zip(groups) {
                    store_states(z, states, number, kept);
                }
            }
        }
    }
}

/// State `number` of as many trajectories as there is room for ← the lanes.
#[inline(always)]
pub(super) fn store_states<V: Pack>(z: &[V], states: &mut [f64], number: usize, kept: usize) {
    let dim = z.len();
    let mut column = [0.0; WIDTH];
    for (component, lanes) in z.iter().enumerate() {
        lanes.store(&mut column[..V::LANES]);
        for (states, value) in states.chunks_exact_mut(kept * dim).zip(column) {
            states[number * dim + component] = value;
        }
    }
}
