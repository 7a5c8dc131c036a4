//! Gauss–Legendre on many points, one in each lane.

use super::GaussLegendre;
use super::gauss::MAXIMUM;
use super::numerical_method::NumericalMethod;
use super::request::{Request, at_pace, store_states};
use crate::error::Error;
use crate::network::load_groups;
use crate::scalar::{Kernel, Pack, WIDTH, on_independent_lanes};
use crate::system::{Hamiltonian, System, each_system};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

impl GaussLegendre {
    /// The states of trajectories from each of the points in `initial`, as a request asks for them.
    pub(super) fn trajectories(
        &self,
        system: &(impl Hamiltonian + Sync),
        initial: &[f64],
        request: Request,
    ) -> Result<Vec<f64>, Error> {
        let dim = 2 * system.dof();
        request.in_parts(dim, initial, &|request, initial, is_first| {
            request.run_part(system, initial, &self.by_blocks(system, request), is_first)
        })
    }

    fn by_blocks(
        &self,
        system: &(impl Hamiltonian + Sync),
        request: Request,
    ) -> impl Fn(&[f64], &mut [f64]) -> Result<(), Error> + Sync {
        move |initial, states| self.move_block(system, &mut initial.to_vec(), request, states)
    }

    /// `points`, 2n numbers each, ← where the flow takes them over the intervals of a request, on all threads: the
    /// bits of [`GaussLegendre::integrate`], interval by interval.
    pub(super) fn move_all(
        &self,
        system: &(impl Hamiltonian + Sync),
        points: &mut [f64],
        request: Request,
    ) -> Result<(), Error> {
        let dim = 2 * system.dof();
        at_pace(|pace| {
            let mut rest = points;
            while !rest.is_empty() {
                let together = WIDTH * rayon::current_num_threads();
                let count = pace.part(request.steps).min(rest.len() / dim);
                let size = (count.next_multiple_of(together) * dim).min(rest.len());
                let (here, after) = std::mem::take(&mut rest).split_at_mut(size);
                let evaluations = (size / dim).saturating_mul(request.steps);
                let mut left = request.kept;
                while left > 0 {
                    let kept = pace.part(evaluations).min(left);
                    let part = Request { kept, ..request };
                    here.par_chunks_mut(WIDTH * dim)
                        .try_for_each(|points| self.move_block(system, points, part, &mut []))?;
                    pace.pause("flow", evaluations.saturating_mul(kept))?;
                    left -= kept;
                }
                rest = after;
            }
            Ok(())
        })
    }

    /// As [`GaussLegendre::move_all`], on this thread; `states` ← the points at the end of each interval, all of a
    /// trajectory after another, or is empty.
    pub(super) fn move_block(
        &self,
        system: &impl Hamiltonian,
        points: &mut [f64],
        request: Request,
        states: &mut [f64],
    ) -> Result<(), Error> {
        on_independent_lanes(Collocation { method: self, system, request, points, states })
    }
}

struct Collocation<'a, H> {
    method: &'a GaussLegendre,
    system: &'a H,
    request: Request,
    points: &'a mut [f64],
    states: &'a mut [f64],
}

impl<H: Hamiltonian> Kernel for Collocation<'_, H> {
    type Output = Result<(), Error>;

    // Loops, no closures: those are compiled for any processor.
    #[inline(always)]
    fn run<V: Pack>(self) -> Result<(), Error> {
        let Self { method, system, request, points, mut states } = self;
        let Request { interval, steps, kept: count } = request;
        let dim = 2 * system.dof();
        let kept = if states.is_empty() { 0 } else { count * dim };
        let mut lanes = vec![V::zero(); dim];
        let mut space = Lanes::new(method, dim);
        for points in points.chunks_mut(V::LANES * dim) {
            let rows = points.len() / dim;
            let (here, rest) = std::mem::take(&mut states).split_at_mut(rows * kept);
            states = rest;
            load_groups(points, dim, &mut lanes);
            // One alone does not wait for a register.
            let mut converged = rows > 1;
            for number in 0..count {
                if !converged {
                    break;
                }
                converged = method.integrate_lanes(system, &mut lanes, interval, steps, &mut space);
                if kept > 0 {
                    store_states(&lanes, here, number, count);
                }
            }
            if converged {
                store_states(&lanes, points, 0, 1);
                continue;
            }
            // Or one of them fails, and says why.
            for (row, z) in points.chunks_exact_mut(dim).enumerate() {
                for number in 0..count {
                    method.integrate(system, z, interval, steps)?;
                    if kept > 0 {
                        let first = row * kept + number * dim;
                        here[first..first + dim].copy_from_slice(z);
                    }
                }
            }
        }
        Ok(())
    }
}

/// What goes through the steps of several points in lanes.
struct Lanes<V> {
    slopes: Vec<V>,
    updated: Vec<V>,
    stage: Vec<V>,
    carry: Vec<V>,
}

impl<V: Pack> Lanes<V> {
    /// For points of `dim` numbers.
    fn new(method: &GaussLegendre, dim: usize) -> Self {
        let of = |count: usize| vec![V::zero(); count];
        let stages = method.stages() * dim;
        Self { slopes: of(stages), updated: of(stages), stage: of(dim), carry: of(dim) }
    }
}

/// The larger in each lane; a NaN may be lost.
#[inline(always)]
fn larger<V: Pack>(a: V, b: V) -> V {
    (b - a).select_above(0.0, b, a)
}

impl GaussLegendre {
    /// [`GaussLegendre::integrate`] of a point in each lane, with the bits of each alone: a lane
    /// whose stages have converged waits for the others. False, and z of no use, where one of them fails:
    /// alone it says why.
    #[inline(always)]
    fn integrate_lanes<V: Pack>(
        &self,
        system: &impl Hamiltonian,
        z: &mut [V],
        time: f64,
        steps: usize,
        space: &mut Lanes<V>,
    ) -> bool {
        let (s, dim) = (self.stages(), z.len());
        let step_size = time / steps as f64;
        let (h, zero) = (V::from_f64(step_size), V::zero());
        let Lanes { slopes, updated, stage, carry } = space;
        carry.fill(zero);
        for step in 0..steps {
            if step == 0 {
                system.vector_field(z, 0.0, stage);
                for block in slopes.chunks_exact_mut(dim) {
                    block.copy_from_slice(stage);
                }
            }
            let mut size = zero;
            for &v in z.iter() {
                size = larger(size, v.abs());
            }
            let mut last = [f64::INFINITY; WIDTH];
            // 1 in lanes that still change; those without a point go with the last that has one.
            let (mut active, mut waiting) = ([1.0; WIDTH], false);
            for iteration in 1.. {
                for i in 0..s {
                    for d in 0..dim {
                        let mut sum = zero;
                        for j in 0..s {
                            let weight = V::from_f64(self.matrix[i * s + j]);
                            sum = weight.mul_add(slopes[j * dim + d], sum);
                        }
                        stage[d] = h.mul_add(sum, z[d]);
                    }
                    let now = (step as f64 + self.nodes[i]) * step_size;
                    system.vector_field(stage, now, &mut updated[i * dim..(i + 1) * dim]);
                }
                let (mut change, mut scale, mut lost) = (zero, size, zero);
                for (&old, &new) in slopes.iter().zip(updated.iter()) {
                    let difference = (h * (new - old)).abs();
                    scale = larger(scale, (h * new).abs());
                    change = larger(change, difference);
                    // NaN from then on, where a number is none or infinite.
                    lost = difference.mul_add(zero, lost);
                }
                if waiting {
                    let active = V::load(&active[..V::LANES]);
                    for (old, &new) in slopes.iter_mut().zip(updated.iter()) {
                        *old = active.select_above(0.5, new, *old);
                    }
                } else {
                    std::mem::swap(slopes, updated);
                }
                let (mut changes, mut scales) = ([0.0; WIDTH], [0.0; WIDTH]);
                (change + lost).store(&mut changes[..V::LANES]);
                scale.store(&mut scales[..V::LANES]);
                let mut left = 0;
                for lane in 0..V::LANES {
                    if active[lane] == 0.0 {
                        continue;
                    }
                    let change = changes[lane];
                    if !change.is_finite() {
                        return false;
                    }
                    let small = change <= 8.0 * f64::EPSILON * scales[lane];
                    if change == 0.0 || (small && change >= last[lane]) {
                        (active[lane], waiting) = (0.0, true);
                    } else {
                        (last[lane], left) = (change, left + 1);
                    }
                }
                if left == 0 {
                    break;
                }
                if iteration == MAXIMUM {
                    return false;
                }
            }
            for d in 0..dim {
                let mut sum = zero;
                for j in 0..s {
                    sum = V::from_f64(self.weights[j]).mul_add(slopes[j * dim + d], sum);
                }
                let increment = h.mul_add(sum, carry[d]);
                let next = z[d] + increment;
                carry[d] = increment - (next - z[d]);
                z[d] = next;
            }
            let mut lost = zero;
            for &v in z.iter() {
                lost = v.mul_add(zero, lost);
            }
            let mut sums = [0.0; WIDTH];
            lost.store(&mut sums[..V::LANES]);
            if sums[..V::LANES].iter().any(|v| v.is_nan()) {
                return false;
            }
        }
        true
    }
}

/// [`GaussLegendre`] as scenes declare it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GaussLegendreSettings {
    /// s, the number of stages.
    pub stages: usize,
}

impl NumericalMethod for GaussLegendreSettings {
    fn name(&self) -> String {
        match self.stages {
            1 => "Gauss–Legendre, 1 stage".into(),
            stages => format!("Gauss–Legendre, {stages} stages"),
        }
    }

    fn check(&self) -> Result<(), Error> {
        const MOST: usize = 64;
        Error::check_count_range("stages", self.stages, 1, MOST)
    }

    fn trajectories(
        &self,
        request: &Request,
        system: &System,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        let method = GaussLegendre::new(self.stages);
        each_system!(system, system => method.trajectories(system, initial, *request))
    }
}
