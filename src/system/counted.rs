//! A system that counts how often its equations of motion are evaluated.

use super::{AverageConstants, AveragePart, Hamiltonian, NearlyPeriodic};
use crate::error::Error;
use crate::layer::{CircleAction, TorusAction};
use crate::scalar::Elementary;
use std::sync::atomic::{AtomicU64, Ordering};

/// On a cache line of its own.
#[derive(Debug, Default)]
#[repr(align(64))]
struct Slot(AtomicU64);

/// A system that counts the evaluations of its vector field: a count for each
/// thread, so that threads do not wait for one another.
#[derive(Debug)]
pub struct Counted<'a, H> {
    system: &'a H,
    slots: Vec<Slot>,
}

impl<'a, H: Hamiltonian> Counted<'a, H> {
    /// The system, with nothing counted.
    pub fn new(system: &'a H) -> Self {
        let slots = (0..=rayon::current_num_threads()).map(|_| Slot::default()).collect();
        Self { system, slots }
    }

    /// The system whose evaluations are counted.
    pub fn inner(&self) -> &'a H {
        self.system
    }

    /// The evaluations of the vector field since [`Counted::new`].
    pub fn vector_fields(&self) -> u64 {
        self.slots.iter().map(|slot| slot.0.load(Ordering::Relaxed)).sum()
    }
}

impl<H: Hamiltonian> Hamiltonian for Counted<'_, H> {
    fn dof(&self) -> usize {
        self.system.dof()
    }
    fn energy<S: Elementary>(&self, z: &[S], time: f64) -> S {
        self.system.energy(z, time)
    }
    #[inline(always)]
    fn add_dissipation<S: Elementary>(&self, z: &[S], time: f64, out: &mut [S]) {
        self.system.add_dissipation(z, time, out);
    }
    #[inline(always)]
    fn vector_field<S: Elementary>(&self, z: &[S], time: f64, out: &mut [S]) {
        // A thread of another pool than the one that made this shares a slot.
        let thread = rayon::current_thread_index().map_or(0, |index| index + 1);
        let slot = thread % self.slots.len();
        self.slots[slot].0.fetch_add(1, Ordering::Relaxed);
        self.system.vector_field(z, time, out);
    }
    fn period(&self) -> Option<f64> {
        self.system.period()
    }
    fn fastest_frequency(&self, z: &[f64]) -> f64 {
        self.system.fastest_frequency(z)
    }
    fn check_point(&self, z: &[f64]) -> Result<(), Error> {
        self.system.check_point(z)
    }
}

impl<H: NearlyPeriodic> NearlyPeriodic for Counted<'_, H> {
    fn epsilon(&self) -> f64 {
        self.system.epsilon()
    }
    fn circle_action(&self) -> CircleAction {
        self.system.circle_action()
    }
    fn limiting_frequency(&self) -> f64 {
        self.system.limiting_frequency()
    }
    fn torus(&self) -> (TorusAction, Vec<f64>) {
        self.system.torus()
    }
    fn customary_invariant<S: Elementary>(&self, z: &[S]) -> Option<(&'static str, S)> {
        self.system.customary_invariant(z)
    }
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S {
        self.system.adiabatic_invariant(z)
    }
    #[inline(always)]
    fn average_constants<S: Elementary>(
        &self,
        z: &[S],
        order: usize,
    ) -> Option<AverageConstants<S>> {
        self.system.average_constants(z, order)
    }
    #[inline(always)]
    fn averaged_field<S: Elementary>(
        &self,
        z: &[S],
        constants: &AverageConstants<S>,
        out: &mut [S],
    ) {
        self.system.averaged_field(z, constants, out);
    }
    fn average_split(&self) -> Option<Vec<f64>> {
        self.system.average_split()
    }
    fn average_has_cross(&self) -> bool {
        self.system.average_has_cross()
    }
    #[inline(always)]
    fn flow_of_average<S: Elementary>(
        &self,
        part: AveragePart,
        z: &mut [S],
        constants: &AverageConstants<S>,
        time: S,
    ) -> S {
        self.system.flow_of_average(part, z, constants, time)
    }
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S) {
        self.system.limiting_flow(z, time);
    }
}
