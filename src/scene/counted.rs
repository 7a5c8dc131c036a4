//! A system that counts how often its equations of motion are evaluated.

use crate::layer::CircleAction;
use crate::scalar::Elementary;
use crate::system::{Hamiltonian, System};
use std::sync::atomic::{AtomicU64, Ordering};

/// On a cache line of its own.
#[derive(Default)]
#[repr(align(64))]
struct Slot(AtomicU64);

/// A system and a count for each thread: threads do not wait for one another.
pub(super) struct Counted<'a> {
    system: &'a System,
    slots: Vec<Slot>,
}

impl<'a> Counted<'a> {
    pub(super) fn new(system: &'a System) -> Self {
        let slots = (0..=rayon::current_num_threads()).map(|_| Slot::default()).collect();
        Self { system, slots }
    }

    /// Evaluations of the vector field since the last call.
    pub(super) fn take(&self) -> u64 {
        self.slots.iter().map(|slot| slot.0.swap(0, Ordering::Relaxed)).sum()
    }
}

impl Hamiltonian for Counted<'_> {
    fn dof(&self) -> usize {
        self.system.dof()
    }
    fn epsilon(&self) -> f64 {
        self.system.epsilon()
    }
    fn energy<S: Elementary>(&self, z: &[S]) -> S {
        self.system.energy(z)
    }
    #[inline(always)]
    fn vector_field<S: Elementary>(&self, z: &[S], out: &mut [S]) {
        let own = rayon::current_thread_index().map_or(0, |index| index + 1);
        self.slots[own].0.fetch_add(1, Ordering::Relaxed);
        self.system.vector_field(z, out);
    }
    fn circle_action(&self) -> CircleAction {
        self.system.circle_action()
    }
    fn limiting_frequency(&self) -> f64 {
        self.system.limiting_frequency()
    }
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S {
        self.system.adiabatic_invariant(z)
    }
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S) {
        self.system.limiting_flow(z, time);
    }
}
