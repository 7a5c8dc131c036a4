//! What a step of a network is: an elementary map bound to its parameters.

use crate::scalar::{Over, Pack, Scalar, Series};

/// An elementary map bound to its parameters, whose inverse is of the same kind: a shear, a few
/// shears that belong together, a rotation of planes, a coupling. All but the
/// [affine coupling](super::AffineCoupling) are exactly symplectic.
///
/// A network is a sequence of them. Whoever implements this for a new kind of
/// step writes one file; all that is done with steps goes through these methods:
/// maps and their inverses, batches on lanes, pullbacks, Jacobians.
///
/// Points are 2n numbers, `[q₁, …, qₙ, p₁, …, pₙ]`. `P` is the number of the
/// parameters, `S` that of the state. All methods that are generic over `S` are to
/// be `#[inline(always)]`: the kernels compile them for vector registers.
///
/// Coordinates are changed by [`Over::increment`] and exact operations (signs,
/// exchanges) alone: this is what makes the inverse exact where increments are
/// rounded to a grid, unless, as in a [`Twist`](super::Twist) and an
/// [`AffineCoupling`](super::AffineCoupling), the factor of an increment depends on what it changes.
pub trait ElementaryMap<P: Scalar>: Copy {
    /// The degrees of freedom n.
    fn dof(&self) -> usize;

    /// The inverse step.
    fn inverse(self) -> Self;

    /// How many numbers [`ElementaryMap::forward_recorded`] writes for a point.
    fn tape_len(&self) -> usize;

    /// How often a point is put through tanh or sech².
    fn activation_count(&self) -> usize;

    /// How far the arguments of its polynomials are from 0, at most, of a step from z: more than 1
    /// outside the box that they are made for; 0 of a step without. `scratch` holds at least 2n
    /// numbers.
    fn reach(&self, z: &[f64], scratch: &mut [f64]) -> f64
    where
        f64: Over<P>,
    {
        let _ = (z, scratch);
        0.0
    }

    /// z ← the step of z. `scratch` holds at least 2n numbers.
    fn apply<S: Over<P>>(&self, z: &mut [S], scratch: &mut [S]);

    /// z ← the inverse step of z. `scratch` holds at least 2n numbers.
    #[inline(always)]
    fn apply_inverse<S: Over<P>>(&self, z: &mut [S], scratch: &mut [S]) {
        self.inverse().apply(z, scratch);
    }

    /// [`ElementaryMap::apply`] to points of 2n numbers that stand after one another: the same bits.
    #[inline(always)]
    fn apply_each<S: Over<P>>(&self, points: &mut [S], scratch: &mut [S]) {
        for z in points.chunks_exact_mut(2 * self.dof()) {
            self.apply(z, scratch);
        }
    }

    /// [`ElementaryMap::apply`], keeping in `tape` (of [`ElementaryMap::tape_len`]) what
    /// [`ElementaryMap::vjp`] needs. `scratch` holds at least 2n numbers.
    fn forward_recorded<S: Over<P>>(&self, z: &mut [S], tape: &mut [S], scratch: &mut [S]);

    /// The vector–Jacobian product at the recorded point: `z_bar` from the cotangent of the output
    /// to that of the input; `parameters_bar`, that of the step's parameters, +=
    /// theirs. `scratch` holds at least 2n numbers.
    fn vjp<S: Over<P>>(
        &self,
        tape: &[S],
        z_bar: &mut [S],
        parameters_bar: &mut [S],
        scratch: &mut [S],
    );

    /// [`ElementaryMap::vjp`] at several recorded points, whose tapes and cotangents stand
    /// after one another: the same bits as of each in turn.
    #[inline(always)]
    fn vjp_each<S: Over<P>>(
        &self,
        tapes: &[S],
        z_bars: &mut [S],
        parameters_bar: &mut [S],
        scratch: &mut [S],
    ) {
        let (dim, size) = (2 * self.dof(), self.tape_len());
        for k in 0..z_bars.len() / dim {
            let tape = &tapes[k * size..(k + 1) * size];
            self.vjp(tape, &mut z_bars[k * dim..(k + 1) * dim], parameters_bar, scratch);
        }
    }

    /// Jacobian–vector products: z ← the step of z, and each of `directions`, 2n numbers after one another,
    /// ← the derivative of the step along it. `scratch` holds at least 2n + n²
    /// numbers.
    fn jvp<S: Over<P>>(&self, z: &mut [S], directions: &mut [S], scratch: &mut [S]);

    /// [`ElementaryMap::apply`] to one point with what is independent within the step, as
    /// the neurons of a layer, in the lanes of `V`: the same bits. `scratch` holds
    /// at least 2n numbers.
    #[inline(always)]
    fn apply_across<V: Pack<P>>(&self, z: &mut [P], scratch: &mut [P])
    where
        P: Over<P>,
    {
        self.apply(z, scratch);
    }
}

/// A shear that moves the momenta alone. What it keeps for its pullback begins with the
/// positions.
pub trait OfMomenta<P: Scalar>: ElementaryMap<P> {
    /// Whether it moves nothing, whatever the point.
    fn is_identity(&self) -> bool;

    /// What it is, if it is a kick of one plane by one polynomial.
    fn of_a_plane(&self) -> Option<PlaneKick<'_, P>> {
        None
    }
}

/// p += c f(q/ρ), f a series of Chebyshev polynomials.
#[derive(Clone, Copy, Debug)]
pub struct PlaneKick<'a, P> {
    /// f.
    pub series: Series<'a, P>,
    /// 1/ρ.
    pub inverse_radius: f64,
    /// c.
    pub scale: P,
}
