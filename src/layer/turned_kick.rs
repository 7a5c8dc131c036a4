//! Kicks in coordinates turned by angles of their own.

use super::{Kick, Shear, TanhPotential, Turn};
use crate::phase::Half;
use crate::scalar::{Over, Pack, Scalar};

/// R(−φ)∘K∘R(φ): each plane turned clockwise by its angle φ_j, a
/// kick p += c∇V(q), turned back.
///
/// It is the time-c flow of −V(q cos φ + p sin φ), by planes: sums of such functions,
/// of all φ, come near every function of phase space, where kicks of positions
/// and of momenta alone have generators A(q) + B(p) to first order in c.
///
/// Its parameters are `[φ (n), …potential…]`.
#[derive(Clone, Copy, Debug)]
pub struct TurnedKick<'a, P, const D: usize = 0> {
    /// R(φ).
    pub turn: &'a Turn<P>,
    /// V.
    pub potential: TanhPotential<'a, P, D>,
    /// c.
    pub scale: P,
}

impl<'a, P: Scalar, const D: usize> TurnedKick<'a, P, D> {
    /// K.
    #[inline(always)]
    fn kick(&self) -> Kick<'a, P, TanhPotential<'a, P, D>> {
        let (potential, scale) = (self.potential, self.scale);
        Kick { potential, scale, reflect: false, shift: None, target: Half::Momentum }
    }

    /// A factor of zero moves nothing, not even by the rounding of two turns.
    #[inline(always)]
    fn is_identity(&self) -> bool {
        self.scale.is_zero()
    }

    /// What a cotangent says of a plane's generator, q̇ = p, ṗ = −q, at this point.
    #[inline(always)]
    fn moment<S: Scalar>(j: usize, q: &[S], p: &[S], z_bar: &[S]) -> S {
        z_bar[j] * p[j] - z_bar[q.len() + j] * q[j]
    }
}

impl<P: Scalar, const D: usize> Shear<P> for TurnedKick<'_, P, D> {
    #[inline(always)]
    fn dof(&self) -> usize {
        self.potential.n()
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        Self { scale: -self.scale, ..self }
    }

    #[inline(always)]
    fn tape_len(&self) -> usize {
        Shear::<P>::tape_len(&self.kick()) + 2 * self.potential.n()
    }

    #[inline(always)]
    fn activation_count(&self) -> usize {
        self.potential.width()
    }

    #[inline(always)]
    fn apply<S: Over<P>>(&self, z: &mut [S], scratch: &mut [S]) {
        if self.is_identity() {
            return;
        }
        self.turn.apply(z, false);
        self.kick().apply(z, scratch);
        self.turn.apply(z, true);
    }

    /// The momenta before and after the kick are kept behind what the kick keeps, whose
    /// first numbers are the positions.
    #[inline(always)]
    fn record<S: Over<P>>(&self, z: &mut [S], tape: &mut [S], scratch: &mut [S]) {
        if self.is_identity() {
            return;
        }
        let n = self.potential.n();
        let (of_kick, momenta) = tape.split_at_mut(tape.len() - 2 * n);
        self.turn.apply(z, false);
        momenta[..n].copy_from_slice(&z[n..]);
        Shear::record(&self.kick(), z, of_kick, scratch);
        momenta[n..].copy_from_slice(&z[n..]);
        self.turn.apply(z, true);
    }

    #[inline(always)]
    fn pull<S: Over<P>>(
        &self,
        tape: &[S],
        z_bar: &mut [S],
        parameters_bar: &mut [S],
        scratch: &mut [S],
    ) {
        if self.is_identity() {
            return;
        }
        let n = self.potential.n();
        let (of_kick, momenta) = tape.split_at(tape.len() - 2 * n);
        let (angles_bar, potential_bar) = parameters_bar.split_at_mut(n);
        let q = &of_kick[..n];
        // A rotation is orthogonal: its adjoint is its inverse, and the moments of its
        // generator are the same before and after it.
        self.turn.apply(z_bar, false);
        for j in 0..n {
            angles_bar[j] -= Self::moment(j, q, &momenta[n..], z_bar);
        }
        Shear::pull(&self.kick(), of_kick, z_bar, potential_bar, scratch);
        for j in 0..n {
            angles_bar[j] += Self::moment(j, q, &momenta[..n], z_bar);
        }
        self.turn.apply(z_bar, true);
    }

    #[inline(always)]
    fn apply_along<S: Over<P>>(&self, z: &mut [S], directions: &mut [S], scratch: &mut [S]) {
        if self.is_identity() {
            return;
        }
        let dim = 2 * self.potential.n();
        self.turn.apply(z, false);
        for direction in directions.chunks_exact_mut(dim) {
            self.turn.apply(direction, false);
        }
        self.kick().apply_along(z, directions, scratch);
        self.turn.apply(z, true);
        for direction in directions.chunks_exact_mut(dim) {
            self.turn.apply(direction, true);
        }
    }

    #[inline(always)]
    fn apply_across<V: Pack<P>>(&self, z: &mut [P], scratch: &mut [P])
    where
        P: Over<P>,
    {
        if self.is_identity() {
            return;
        }
        self.turn.apply(z, false);
        self.kick().apply_across::<V>(z, scratch);
        self.turn.apply(z, true);
    }
}
