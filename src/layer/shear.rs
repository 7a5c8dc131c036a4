//! The shear along a potential's gradient: the primitive of every network.

use super::{Potential, TanhPotential};
use crate::phase::Half;
use crate::scalar::{Over, Pack, Real, Scalar};

/// target += c·∇V(τ·source − η), where target is one half of the coordinates
/// and source the other; c = ±ε, τ = ±1.
///
/// It is symplectic because ∇V is a gradient, and its inverse is the same
/// shear with −c: exact in real arithmetic, one rounding away in floating
/// point, bit for bit where the increments are rounded to a grid.
#[derive(Clone, Copy, Debug)]
pub struct Kick<'a, P, V> {
    /// V.
    pub potential: V,
    /// c, the factor of the increment.
    pub scale: P,
    /// τ = −1 when true.
    pub reflect: bool,
    /// η, where the argument is shifted.
    pub shift: Option<&'a [P]>,
    /// The half that the shear changes.
    pub target: Half,
}

impl<P: Scalar, V> Kick<'_, P, V> {
    /// The inverse shear.
    #[inline(always)]
    pub fn inverse(self) -> Self {
        Self { scale: -self.scale, ..self }
    }

    /// A kick with c = 0 moves nothing, whatever its weights: it is skipped,
    /// because 0·∞ is not 0.
    #[inline(always)]
    fn is_identity(&self) -> bool {
        self.scale.is_zero()
    }

    #[inline(always)]
    fn argument<S: Over<P>>(&self, source: &[S], argument: &mut [S]) {
        for i in 0..source.len() {
            let value = if self.reflect { -source[i] } else { source[i] };
            argument[i] = match self.shift {
                Some(eta) => value - S::embed(eta[i]),
                None => value,
            };
        }
    }

    /// z ← the sheared z. `scratch` holds at least 2n numbers.
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

    /// target += c·∇V.
    #[inline(always)]
    fn add<S: Over<P>>(&self, gradient: &[S], target: &mut [S]) {
        for (target, gradient) in target.iter_mut().zip(gradient) {
            *target = gradient.mul_add_parameter(self.scale, *target);
        }
    }

    /// How many numbers [`Kick::apply_recording`] writes.
    #[inline(always)]
    pub fn tape_len<S: Over<P>>(&self) -> usize
    where
        V: Potential<S>,
    {
        self.potential.dof() + self.potential.tape_len()
    }

    /// As [`Kick::apply`], keeping in `tape` (of [`Kick::tape_len`]) what
    /// [`Kick::pullback`] needs.
    #[inline(always)]
    pub fn apply_recording<S: Over<P>>(&self, z: &mut [S], scratch: &mut [S], tape: &mut [S])
    where
        V: Potential<S>,
    {
        if self.is_identity() {
            return;
        }
        let n = self.potential.dof();
        let (argument, tape) = tape.split_at_mut(n);
        let (source, target) = self.target.split(n, z);
        self.argument(source, argument);
        let gradient = &mut scratch[..n];
        self.potential.gradient_recording(argument, gradient, tape);
        self.add(gradient, target);
    }

    /// The adjoint at the recorded point: `z_bar` from the cotangent of the
    /// output to that of the input, `parameters_bar` += the cotangent of the
    /// layer's parameters `[…potential…, η]`. `scratch` holds at least 2n
    /// numbers.
    #[inline(always)]
    pub fn pullback<S: Over<P>>(
        &self,
        tape: &[S],
        z_bar: &mut [S],
        parameters_bar: &mut [S],
        scratch: &mut [S],
    ) where
        V: Potential<S>,
    {
        if self.is_identity() {
            return;
        }
        let n = self.potential.dof();
        let (argument, tape) = tape.split_at(n);
        let (u, y_bar) = scratch.split_at_mut(n);
        let (source_bar, target_bar) = self.target.split_mut(n, z_bar);
        for i in 0..n {
            u[i] = target_bar[i].times(self.scale);
        }
        let (potential_bar, eta_bar) = parameters_bar.split_at_mut(parameters_bar.len() - n);
        self.potential.pullback(argument, tape, u, y_bar, potential_bar);
        for i in 0..n {
            source_bar[i] =
                if self.reflect { source_bar[i] - y_bar[i] } else { source_bar[i] + y_bar[i] };
            if self.shift.is_some() {
                eta_bar[i] = eta_bar[i] - y_bar[i];
            }
        }
    }
}

impl<P: Scalar, const D: usize> Kick<'_, P, TanhPotential<'_, P, D>> {
    /// As [`Kick::apply`]; the rows of the target in `columns`, each a column of
    /// the running Jacobian, get cτV″ times those of the source. `scratch` holds
    /// at least 2n + n² numbers.
    #[inline(always)]
    pub(crate) fn apply_with_jacobian<S: Over<P>>(
        &self,
        z: &mut [S],
        columns: &mut [S],
        scratch: &mut [S],
    ) {
        if self.is_identity() {
            return;
        }
        let n = Potential::<S>::dof(&self.potential);
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
        for column in columns.chunks_exact_mut(2 * n) {
            let (source, target) = self.target.split(n, column);
            for i in 0..n {
                for k in 0..n {
                    target[i] = hessian[i * n + k].mul_add(source[k], target[i]);
                }
            }
        }
    }
}

impl<P: Over<P>, const D: usize> Kick<'_, P, TanhPotential<'_, P, D>> {
    /// As [`Kick::apply`] to one point, with a neuron in each lane.
    #[inline(always)]
    pub(crate) fn apply_across<V: Pack<P>>(&self, z: &mut [P], scratch: &mut [P]) {
        if self.is_identity() {
            return;
        }
        let n = Potential::<P>::dof(&self.potential);
        let (argument, gradient) = scratch.split_at_mut(n);
        let (source, target) = self.target.split(n, z);
        self.argument(source, argument);
        self.potential.gradient_across::<V>(argument, gradient);
        self.add(gradient, target);
    }
}

impl<P: Over<P>, V: Potential<P>> Kick<'_, P, V> {
    /// `e` ← |c||V″||J_source| + |J_out| on the target's rows: u·e is the scale
    /// of the rounding error of the Jacobian after this shear. `z` is the point
    /// before it, `before` and `after` the running Jacobians, 2n × 2n row by
    /// row.
    pub fn jacobian_magnitude(&self, z: &[P], before: &[P], after: &[P], e: &mut [P]) {
        e.fill(P::zero());
        if self.is_identity() {
            return;
        }
        let n = self.potential.dof();
        let hessian = self.hessian_magnitude(z);
        for i in 0..n {
            let row = self.target.index(n, i);
            for column in 0..2 * n {
                let mut sum = P::zero();
                for k in 0..n {
                    let source = self.target.other().index(n, k);
                    sum = hessian[i * n + k].mul_add(before[source * 2 * n + column].abs(), sum);
                }
                e[row * 2 * n + column] =
                    self.scale.abs().mul_add(sum, after[row * 2 * n + column].abs());
            }
        }
    }

    /// `delta` ← |c|·(the magnitude of ∇V) + |z_out| on the target: u·δ is the
    /// scale of the rounding error of the point after this shear.
    pub fn value_magnitude(&self, z: &[P], after: &[P], delta: &mut [P]) {
        delta.fill(P::zero());
        if self.is_identity() {
            return;
        }
        let n = self.potential.dof();
        let mut argument = vec![P::zero(); n];
        let mut magnitude = vec![P::zero(); n];
        self.argument(self.source_of(z), &mut argument);
        self.potential.gradient_magnitude(&argument, &mut magnitude);
        for i in 0..n {
            let row = self.target.index(n, i);
            delta[row] = self.scale.abs().mul_add(magnitude[i], after[row].abs());
        }
    }

    /// `out` ← a bound of how far the shear is from linear over errors `spread`
    /// of the point z.
    pub fn curvature_magnitude(&self, z: &[P], spread: &[P], out: &mut [P])
    where
        P: Real,
    {
        out.fill(P::zero());
        if self.is_identity() {
            return;
        }
        let n = self.potential.dof();
        let mut argument = vec![P::zero(); n];
        let mut own = vec![P::zero(); n];
        self.argument(self.source_of(z), &mut argument);
        self.potential.curvature_magnitude(&argument, self.source_of(spread), &mut own);
        for i in 0..n {
            out[self.target.index(n, i)] = self.scale.abs() * own[i];
        }
    }

    fn hessian_magnitude(&self, z: &[P]) -> Vec<P> {
        let n = self.potential.dof();
        let mut argument = vec![P::zero(); n];
        let mut hessian = vec![P::zero(); n * n];
        self.argument(self.source_of(z), &mut argument);
        self.potential.hessian_magnitude(&argument, &mut hessian);
        hessian
    }

    fn source_of<'z>(&self, z: &'z [P]) -> &'z [P] {
        let n = self.potential.dof();
        match self.target {
            Half::Position => &z[n..],
            Half::Momentum => &z[..n],
        }
    }
}
