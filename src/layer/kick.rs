//! The shear along a potential's gradient: the primitive of HénonNets.

use super::{ElementaryMap, Potential, RidgePotential};
use crate::phase::Half;
use crate::scalar::{Over, Pack, Scalar};

/// target += c·∇V(τ·source − η), where target is one half of the coordinates
/// and source the other; c = ±ε, τ = ±1.
///
/// It is symplectic because ∇V is a gradient, and its inverse is the same
/// shear with −c: exact in real arithmetic, one rounding away in floating
/// point, bit for bit where the increments are rounded to a grid.
///
/// Its parameters are `[…potential…, η]`, or those of the potential alone without a
/// shift.
#[derive(Clone, Copy, Debug)]
pub struct Kick<'a, P, V> {
    /// The potential V whose gradient moves the coordinates.
    pub potential: V,
    /// c, the factor of the increment.
    pub scale: P,
    /// Whether the sign τ of the kick is −1 in place of 1.
    pub reflect: bool,
    /// η, where the argument is shifted.
    pub shift: Option<&'a [P]>,
    /// The half that the shear changes.
    pub target: Half,
}

impl<'a, P: Scalar, V> Kick<'a, P, V> {
    /// The inverse shear: the same potential with the opposite sign.
    #[inline(always)]
    pub fn inverse(self) -> Self {
        Self { scale: -self.scale, ..self }
    }

    /// The kick by another potential.
    pub(crate) fn with_potential<V2>(self, potential: V2) -> Kick<'a, P, V2> {
        let Self { scale, reflect, shift, target, .. } = self;
        Kick { potential, scale, reflect, shift, target }
    }

    /// A kick with c = 0 moves nothing, whatever its weights: it is skipped,
    /// because 0·∞ is not 0.
    #[inline(always)]
    pub fn is_identity(&self) -> bool {
        self.scale.is_zero()
    }

    /// `argument` ← τ·source − η.
    #[inline(always)]
    pub fn argument<S: Over<P>>(&self, source: &[S], argument: &mut [S]) {
        for i in 0..source.len() {
            let value = if self.reflect { -source[i] } else { source[i] };
            argument[i] = match self.shift {
                Some(eta) => value - S::embed(eta[i]),
                None => value,
            };
        }
    }

    /// z ← the sheared z, for a potential of any kind. `scratch` holds at least 2n
    /// numbers.
    #[inline(always)]
    pub fn apply<S: Over<P>>(&self, z: &mut [S], scratch: &mut [S])
    where
        V: Potential<S>,
    {
        if self.is_identity() {
            return;
        }
        let n = self.potential.dof();
        let (argument, gradient) = scratch.split_at_mut(n);
        let (source, target) = self.target.split(n, z);
        self.argument(source, argument);
        self.potential.gradient(argument, gradient);
        self.add(gradient, target);
    }

    /// Adds the multiple c of the gradient to the target, target += c·∇V.
    #[inline(always)]
    fn add<S: Over<P>>(&self, gradient: &[S], target: &mut [S]) {
        for i in 0..target.len() {
            target[i] = target[i].increment(self.scale, gradient[i]);
        }
    }
}

/// Points whose cotangents go back through a kick together.
const TOGETHER: usize = 4;

impl<P: Scalar, const D: usize> Kick<'_, P, RidgePotential<'_, P, D>> {
    /// The adjoint at M recorded points.
    #[inline(always)]
    fn vjp_together<S: Over<P>, const M: usize>(
        &self,
        tapes: &[S],
        z_bars: &mut [S],
        parameters_bar: &mut [S],
    ) {
        let tape_len = ElementaryMap::tape_len(self);
        let mut neurons: [&[S]; M] = [&[]; M];
        let z_bars: &mut [S] = &mut z_bars[..M * 2 * D];
        let (source, target) = (self.target.other(), self.target);
        let mut y = [[S::zero(); D]; M];
        let (mut u, mut y_bar) = (y, y);
        for m in 0..M {
            let (argument, rest) = tapes[m * tape_len..(m + 1) * tape_len].split_at(D);
            neurons[m] = rest;
            for i in 0..D {
                y[m][i] = argument[i];
                u[m][i] = z_bars[m * 2 * D + target.index(D, i)].times(self.scale);
            }
        }
        let (potential_bar, eta_bar) =
            parameters_bar.split_at_mut(self.potential.parameter_count());
        self.potential.vjp_together(&y, neurons, &u, &mut y_bar, potential_bar);
        for m in 0..M {
            for i in 0..D {
                let source_bar = &mut z_bars[m * 2 * D + source.index(D, i)];
                let change = if self.reflect { -y_bar[m][i] } else { y_bar[m][i] };
                *source_bar += change;
                if self.shift.is_some() {
                    eta_bar[i] -= y_bar[m][i];
                }
            }
        }
    }
}

impl<P: Scalar, const D: usize> ElementaryMap<P> for Kick<'_, P, RidgePotential<'_, P, D>> {
    #[inline(always)]
    fn dof(&self) -> usize {
        self.potential.n()
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        Kick::inverse(self)
    }

    #[inline(always)]
    fn tape_len(&self) -> usize {
        self.potential.n() + self.potential.tape_len()
    }

    #[inline(always)]
    fn activation_count(&self) -> usize {
        self.potential.activation_count()
    }

    fn reach(&self, z: &[f64], argument: &mut [f64]) -> f64
    where
        f64: Over<P>,
    {
        if self.is_identity() {
            return 0.0;
        }
        let n = self.potential.n();
        let argument = &mut argument[..n];
        self.argument(&z[self.target.other().index(n, 0)..][..n], argument);
        self.potential.reach(argument)
    }

    #[inline(always)]
    fn apply<S: Over<P>>(&self, z: &mut [S], scratch: &mut [S]) {
        Kick::apply(self, z, scratch);
    }

    #[inline(always)]
    fn forward_recorded<S: Over<P>>(&self, z: &mut [S], tape: &mut [S], scratch: &mut [S]) {
        if self.is_identity() {
            return;
        }
        let n = self.potential.n();
        let (argument, tape) = tape.split_at_mut(n);
        let (source, target) = self.target.split(n, z);
        self.argument(source, argument);
        let gradient = &mut scratch[..n];
        self.potential.gradient_recording(argument, gradient, tape);
        self.add(gradient, target);
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
        let n = self.potential.n();
        let (argument, tape) = tape.split_at(n);
        let (u, y_bar) = scratch.split_at_mut(n);
        let (source_bar, target_bar) = self.target.split_mut(n, z_bar);
        for i in 0..n {
            u[i] = target_bar[i].times(self.scale);
        }
        let (potential_bar, eta_bar) =
            parameters_bar.split_at_mut(self.potential.parameter_count());
        self.potential.vjp(argument, tape, u, y_bar, potential_bar);
        for i in 0..n {
            source_bar[i] =
                if self.reflect { source_bar[i] - y_bar[i] } else { source_bar[i] + y_bar[i] };
            if self.shift.is_some() {
                eta_bar[i] -= y_bar[i];
            }
        }
    }

    #[inline(always)]
    fn vjp_each<S: Over<P>>(
        &self,
        tapes: &[S],
        z_bars: &mut [S],
        parameters_bar: &mut [S],
        scratch: &mut [S],
    ) {
        if self.is_identity() {
            return;
        }
        let (dim, tape_len) = (2 * self.potential.n(), ElementaryMap::tape_len(self));
        let points = z_bars.len() / dim;
        // How many go together; where n is not known at compile time, none do.
        let together = if D > 0 { points / TOGETHER * TOGETHER } else { 0 };
        if const { D > 0 } {
            for k in (0..together).step_by(TOGETHER) {
                let (tapes, z_bars) = (&tapes[k * tape_len..], &mut z_bars[k * dim..]);
                self.vjp_together::<S, TOGETHER>(tapes, z_bars, parameters_bar);
            }
        }
        for k in together..points {
            let tape = &tapes[k * tape_len..(k + 1) * tape_len];
            self.vjp(tape, &mut z_bars[k * dim..(k + 1) * dim], parameters_bar, scratch);
        }
    }

    /// The rows of the target get cτV″ times those of the source.
    #[inline(always)]
    fn jvp<S: Over<P>>(&self, z: &mut [S], directions: &mut [S], scratch: &mut [S]) {
        if self.is_identity() {
            return;
        }
        let n = self.potential.n();
        let (argument, rest) = scratch.split_at_mut(n);
        let (gradient, rest) = rest.split_at_mut(n);
        let hessian = &mut rest[..n * n];
        let (source, target) = self.target.split(n, z);
        self.argument(source, argument);
        self.potential.gradient_and_hessian(argument, gradient, hessian);
        self.add(gradient, target);
        let scale = if self.reflect { -self.scale } else { self.scale };
        for entry in hessian.iter_mut() {
            *entry = entry.times(scale);
        }
        for direction in directions.chunks_exact_mut(2 * n) {
            let (source, target) = self.target.split(n, direction);
            for i in 0..n {
                for k in 0..n {
                    target[i] = hessian[i * n + k].mul_add(source[k], target[i]);
                }
            }
        }
    }

    #[inline(always)]
    fn apply_across<W: Pack<P>>(&self, z: &mut [P], scratch: &mut [P])
    where
        P: Over<P>,
    {
        if self.is_identity() {
            return;
        }
        let n = self.potential.n();
        let (argument, gradient) = scratch.split_at_mut(n);
        let (source, target) = self.target.split(n, z);
        self.argument(source, argument);
        self.potential.gradient_across::<W>(argument, gradient);
        self.add(gradient, target);
    }
}
