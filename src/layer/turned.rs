//! Shears in coordinates that are rotated by learnt angles.

use super::{
    AffineCoupling, ElementaryMap, Kick, OfMomenta, PlaneKick, PlaneTurn, RidgePotential, Turn,
};
use crate::phase::Half;
use crate::scalar::{Over, Pack, Scalar};

/// R(−φ)∘K∘R(φ): a rotation R of each plane clockwise by its angle φ_j, a shear K of the momenta,
/// and the rotation back.
///
/// Its parameters are `[φ (n), …those of K…]`.
#[derive(Clone, Copy, Debug)]
pub struct Turned<'a, P, T> {
    turn: &'a Turn<P>,
    shear: T,
}

/// R(−φ)∘K∘R(φ) with a kick K: p += c∇V(q).
///
/// It is the time-c flow of −V(q cos φ + p sin φ), with one φ per plane. Sums of such functions
/// over all φ approximate every function on phase space, whereas compositions of kicks of the
/// positions or the momenta alone have generators A(q) + B(p) to first order in c.
///
/// Its parameters are `[φ (n), …potential…]`.
pub type TurnedKick<'a, P, const D: usize = 0> =
    Turned<'a, P, Kick<'a, P, RidgePotential<'a, P, D>>>;

impl<'a, P: Scalar, const D: usize> TurnedKick<'a, P, D> {
    /// The kick with this potential and c = `scale`.
    #[inline(always)]
    pub fn new(
        turn: &'a Turn<P>,
        potential: impl Into<RidgePotential<'a, P, D>>,
        scale: P,
    ) -> Self {
        let (potential, target) = (potential.into(), Half::Momentum);
        Self { turn, shear: Kick { potential, scale, reflect: false, shift: None, target } }
    }
}

impl<'a, P: Scalar, const D: usize> TurnedKick<'a, P, D> {
    /// The rotation R(φ) of the planes, and the kick K in the rotated coordinates.
    pub(crate) fn turn_and_kick(self) -> (&'a Turn<P>, Kick<'a, P, RidgePotential<'a, P, D>>) {
        (self.turn, self.shear)
    }
}

/// Of a kick of the momenta whose argument is neither reflected nor shifted, as
/// [`TurnedKick::new`] makes it.
impl<P: Scalar, const D: usize> OfMomenta<P> for Kick<'_, P, RidgePotential<'_, P, D>> {
    #[inline(always)]
    fn is_identity(&self) -> bool {
        Kick::is_identity(self)
    }

    #[inline(always)]
    fn of_a_plane(&self) -> Option<PlaneKick<'_, P>> {
        match &self.potential {
            RidgePotential::Polynomial(of) => {
                let (series, inverse_radius) = of.of_one_coordinate()?;
                Some(PlaneKick { series, inverse_radius, scale: self.scale })
            }
            RidgePotential::Neurons(_) => None,
        }
    }
}

/// Points of a plane that are kicked together: what one of them waits for is computed while
/// another waits.
const TOGETHER: usize = 4;

impl<P: Scalar> PlaneKick<'_, P> {
    /// M points of a plane, each (q, p): turned, kicked and turned back.
    #[inline(always)]
    fn kick<S: Over<P>, const M: usize>(&self, turn: &PlaneTurn<P>, points: &mut [S]) {
        let points: &mut [S] = &mut points[..2 * M];
        let (mut q, mut p) = ([S::zero(); M], [S::zero(); M]);
        for m in 0..M {
            (q[m], p[m]) = (points[2 * m], points[2 * m + 1]);
        }
        turn.apply_together(&mut q, &mut p, false);
        let mut s = q;
        for s in &mut s {
            *s *= S::from_f64(self.inverse_radius);
        }
        let f = S::series_each::<M>(s, self.series.repeated());
        for m in 0..M {
            p[m] = p[m].increment(self.scale, S::zero() + f[m]);
        }
        turn.apply_together(&mut q, &mut p, true);
        for m in 0..M {
            (points[2 * m], points[2 * m + 1]) = (q[m], p[m]);
        }
    }
}

/// R(−φ)∘K∘R(φ) with an affine coupling K.
///
/// To first order in c, compositions over all φ approximate every vector field on phase space, whereas
/// couplings without φ give only fields x(q) ⊙ p + y(q) along p, and likewise along q.
pub type TurnedCoupling<'a, P, const D: usize = 0> = Turned<'a, P, AffineCoupling<'a, P, D>>;

impl<'a, P: Scalar, const D: usize> TurnedCoupling<'a, P, D> {
    /// The coupling in coordinates turned by R(φ).
    #[inline(always)]
    pub fn new(turn: &'a Turn<P>, shear: AffineCoupling<'a, P, D>) -> Self {
        Self { turn, shear }
    }

    /// The turn R(φ) and the coupling between it and its inverse.
    pub fn parts(&self) -> (&'a Turn<P>, &AffineCoupling<'a, P, D>) {
        (self.turn, &self.shear)
    }
}

impl<P: Scalar, T> Turned<'_, P, T> {
    /// What a cotangent says of a plane's generator, q̇ = p, ṗ = −q, at this point.
    #[inline(always)]
    fn moment<S: Scalar>(j: usize, q: &[S], p: &[S], z_bar: &[S]) -> S {
        z_bar[j] * p[j] - z_bar[q.len() + j] * q[j]
    }
}

impl<P: Scalar, T: OfMomenta<P>> ElementaryMap<P> for Turned<'_, P, T> {
    #[inline(always)]
    fn dof(&self) -> usize {
        self.shear.dof()
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        Self { shear: self.shear.inverse(), ..self }
    }

    #[inline(always)]
    fn tape_len(&self) -> usize {
        self.shear.tape_len() + 2 * self.shear.dof()
    }

    #[inline(always)]
    fn activation_count(&self) -> usize {
        self.shear.activation_count()
    }

    fn reach(&self, z: &[f64], scratch: &mut [f64]) -> f64
    where
        f64: Over<P>,
    {
        let mut turned = z.to_vec();
        self.turn.apply(&mut turned, false);
        self.shear.reach(&turned, scratch)
    }

    #[inline(always)]
    fn apply<S: Over<P>>(&self, z: &mut [S], scratch: &mut [S]) {
        if self.shear.is_identity() {
            return;
        }
        self.turn.apply(z, false);
        self.shear.apply(z, scratch);
        self.turn.apply(z, true);
    }

    #[inline(always)]
    fn apply_each<S: Over<P>>(&self, points: &mut [S], scratch: &mut [S]) {
        if self.shear.is_identity() {
            return;
        }
        // For numbers that are no vector registers it takes compilation, and is no faster.
        if S::SPECIALISED
            && let (Some(kick), [turn]) = (self.shear.of_a_plane(), self.turn.planes())
        {
            let mut groups = points.chunks_exact_mut(2 * TOGETHER);
            for group in &mut groups {
                kick.kick::<S, TOGETHER>(turn, group);
            }
            for point in groups.into_remainder().chunks_exact_mut(2) {
                kick.kick::<S, 1>(turn, point);
            }
            return;
        }
        for z in points.chunks_exact_mut(2 * self.shear.dof()) {
            self.apply(z, scratch);
        }
    }

    /// The momenta before and after the shear are kept behind what the shear keeps, whose
    /// first numbers are the positions.
    #[inline(always)]
    fn forward_recorded<S: Over<P>>(&self, z: &mut [S], tape: &mut [S], scratch: &mut [S]) {
        if self.shear.is_identity() {
            return;
        }
        let n = self.shear.dof();
        let (of_shear, momenta) = tape.split_at_mut(tape.len() - 2 * n);
        self.turn.apply(z, false);
        momenta[..n].copy_from_slice(&z[n..]);
        self.shear.forward_recorded(z, of_shear, scratch);
        momenta[n..].copy_from_slice(&z[n..]);
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
        if self.shear.is_identity() {
            return;
        }
        let n = self.shear.dof();
        let (of_shear, momenta) = tape.split_at(tape.len() - 2 * n);
        let (angles_bar, shear_bar) = parameters_bar.split_at_mut(n);
        let q = &of_shear[..n];
        // A rotation is orthogonal: its adjoint is its inverse, and the moments of its
        // generator are the same before and after it.
        self.turn.apply(z_bar, false);
        for j in 0..n {
            angles_bar[j] -= Self::moment(j, q, &momenta[n..], z_bar);
        }
        self.shear.vjp(of_shear, z_bar, shear_bar, scratch);
        for j in 0..n {
            angles_bar[j] += Self::moment(j, q, &momenta[..n], z_bar);
        }
        self.turn.apply(z_bar, true);
    }

    #[inline(always)]
    fn jvp<S: Over<P>>(&self, z: &mut [S], directions: &mut [S], scratch: &mut [S]) {
        if self.shear.is_identity() {
            return;
        }
        let dim = 2 * self.shear.dof();
        self.turn.apply(z, false);
        for direction in directions.chunks_exact_mut(dim) {
            self.turn.apply(direction, false);
        }
        self.shear.jvp(z, directions, scratch);
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
        if self.shear.is_identity() {
            return;
        }
        self.turn.apply(z, false);
        self.shear.apply_across::<V>(z, scratch);
        self.turn.apply(z, true);
    }
}
