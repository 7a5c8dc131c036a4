//! Twists in turned coordinates of the slow planes.

use super::{ElementaryMap, Turn, Twist};
use crate::scalar::{Over, Pack, Scalar};

/// R(−φ)∘exp(c X_G)∘R(φ): each slow plane turned clockwise by its angle φ_j, the time-c flow of a
/// function G(𝔍, y) of the actions and of the slow positions, turned back.
///
/// It commutes with the torus action, since R turns slow planes alone, and it is the flow of
/// G(𝔍, y cos φ + x sin φ), plane by plane, x being the slow momenta: with G a
/// sum of w tanh(a·𝔍 + b·y + β) and all φ these are all ridge functions of (𝔍, x, y). Twists in y and
/// in x alone reach, to first order in c, A(𝔍, x) + B(𝔍, y) only.
///
/// The twist is one shear of the momenta ([`TwistShears::of_momenta`](super::TwistShears::of_momenta)).
/// Its parameters are `[φ (one for each slow plane), W, b, w]`.
#[derive(Clone, Copy, Debug)]
pub struct TurnedTwist<'a, P, const D: usize = 0> {
    turn: &'a Turn<P>,
    twist: Twist<'a, P, D>,
}

impl<'a, P: Scalar, const D: usize> TurnedTwist<'a, P, D> {
    /// The twist in coordinates that R(φ) turns.
    #[inline(always)]
    pub fn new(turn: &'a Turn<P>, twist: Twist<'a, P, D>) -> Self {
        Self { turn, twist }
    }

    /// R(φ) and the twist.
    pub fn parts(&self) -> (&'a Turn<P>, Twist<'a, P, D>) {
        (self.turn, self.twist)
    }

    /// Whether it moves nothing, whatever the point.
    #[inline(always)]
    pub fn is_identity(&self) -> bool {
        self.twist.scale.is_zero()
    }

    /// The slow planes.
    #[inline(always)]
    fn slow(&self) -> &'a [usize] {
        self.twist.shears.planes().slow()
    }

    /// `kept` ← the slow positions and momenta.
    #[inline(always)]
    fn keep<S: Scalar>(&self, z: &[S], kept: &mut [S]) {
        let dof = self.dof();
        for (pair, &j) in kept.chunks_exact_mut(2).zip(self.slow()) {
            (pair[0], pair[1]) = (z[j], z[dof + j]);
        }
    }

    /// `angles_bar` += `sign` times what a cotangent says of the generator q̇ = p, ṗ = −q of
    /// each slow plane at a kept point.
    #[inline(always)]
    fn add_moments<S: Scalar>(&self, sign: S, kept: &[S], z_bar: &[S], angles_bar: &mut [S]) {
        let (dof, slow) = (self.dof(), self.slow());
        for (i, &j) in slow.iter().enumerate() {
            let (q, p) = (kept[2 * i], kept[2 * i + 1]);
            angles_bar[i] += sign * (z_bar[j] * p - z_bar[dof + j] * q);
        }
    }
}

impl<P: Scalar, const D: usize> ElementaryMap<P> for TurnedTwist<'_, P, D> {
    #[inline(always)]
    fn dof(&self) -> usize {
        self.twist.dof()
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        Self { twist: self.twist.inverse(), ..self }
    }

    #[inline(always)]
    fn tape_len(&self) -> usize {
        self.twist.tape_len() + 4 * self.slow().len()
    }

    #[inline(always)]
    fn activation_count(&self) -> usize {
        self.twist.activation_count()
    }

    #[inline(always)]
    fn apply<S: Over<P>>(&self, z: &mut [S], scratch: &mut [S]) {
        if self.is_identity() {
            return;
        }
        self.turn.apply(z, false);
        self.twist.apply(z, scratch);
        self.turn.apply(z, true);
    }

    /// The slow coordinates before and after the twist are kept before what the twist keeps.
    #[inline(always)]
    fn forward_recorded<S: Over<P>>(&self, z: &mut [S], tape: &mut [S], scratch: &mut [S]) {
        if self.is_identity() {
            return;
        }
        let (kept, of_twist) = tape.split_at_mut(4 * self.slow().len());
        let (before, after) = kept.split_at_mut(2 * self.slow().len());
        self.turn.apply(z, false);
        self.keep(z, before);
        self.twist.forward_recorded(z, of_twist, scratch);
        self.keep(z, after);
        self.turn.apply(z, true);
    }

    #[inline(always)]
    fn vjp<S: Over<P>>(
        &self,
        tape: &[S],
        z_bar: &mut [S],
        parameters_bar: &mut [S],
        scratch: &mut [S],
    ) {
        if self.is_identity() {
            return;
        }
        let (kept, of_twist) = tape.split_at(4 * self.slow().len());
        let (before, after) = kept.split_at(2 * self.slow().len());
        let (angles_bar, twist_bar) = parameters_bar.split_at_mut(self.slow().len());
        // A rotation is orthogonal: its adjoint is its inverse, and the moments of its
        // generator are the same before and after it.
        self.turn.apply(z_bar, false);
        let one = S::from_f64(1.0);
        self.add_moments(-one, after, z_bar, angles_bar);
        self.twist.vjp(of_twist, z_bar, twist_bar, scratch);
        self.add_moments(one, before, z_bar, angles_bar);
        self.turn.apply(z_bar, true);
    }

    #[inline(always)]
    fn jvp<S: Over<P>>(&self, z: &mut [S], directions: &mut [S], scratch: &mut [S]) {
        if self.is_identity() {
            return;
        }
        let dim = 2 * self.dof();
        self.turn.apply(z, false);
        directions.chunks_exact_mut(dim).for_each(|direction| self.turn.apply(direction, false));
        self.twist.jvp(z, directions, scratch);
        self.turn.apply(z, true);
        directions.chunks_exact_mut(dim).for_each(|direction| self.turn.apply(direction, true));
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
        self.twist.apply_across::<V>(z, scratch);
        self.turn.apply(z, true);
    }
}
