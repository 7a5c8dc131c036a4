//! The steps of a network: elementary maps bound to their parameters.

use crate::scalar::{Over, Pack, Scalar, Series};

/// An elementary map bound to its parameters, whose inverse is of the same kind: a shear, a few
/// shears that belong together, a rotation of planes, a coupling. All but the
/// [affine coupling](super::AffineCoupling) are exactly symplectic.
///
/// A network is a sequence of such steps. A new kind of step takes one file that implements
/// this trait; everything done with steps goes through these methods:
/// maps and their inverses, batches on lanes, pullbacks, Jacobians.
///
/// Points are 2n numbers, `[q₁, …, qₙ, p₁, …, pₙ]`. `P` is the number type of the
/// parameters, `S` that of the state. All methods that are generic over `S` have to
/// be `#[inline(always)]`: the kernels compile them for vector registers.
///
/// Coordinates are changed only by [`Over::increment`] and exact operations (signs,
/// exchanges). This makes the inverse exact where increments are rounded to a grid,
/// except in a [`Twist`](super::Twist) and an [`AffineCoupling`](super::AffineCoupling), where
/// the factor of an increment depends on the coordinate that it changes.
pub trait ElementaryMap<P: Scalar>: Copy {
    /// The degrees of freedom n.
    fn dof(&self) -> usize;

    /// The inverse of the step, which is a step of the same kind.
    fn inverse(self) -> Self;

    /// How many numbers [`ElementaryMap::forward_recorded`] writes for a point.
    fn tape_len(&self) -> usize;

    /// How many times tanh or sech² is evaluated for a point.
    fn activation_count(&self) -> usize;

    /// The largest size of an argument of the polynomials in a step from z: more than 1 outside the
    /// box for which they are made, and 0 for a step without polynomials. `scratch` holds at least 2n
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

    /// [`ElementaryMap::apply`] to consecutive points of 2n numbers each, with the same bits.
    #[inline(always)]
    fn apply_each<S: Over<P>>(&self, points: &mut [S], scratch: &mut [S]) {
        for z in points.chunks_exact_mut(2 * self.dof()) {
            self.apply(z, scratch);
        }
    }

    /// [`ElementaryMap::apply`], keeping in `tape` (of [`ElementaryMap::tape_len`]) what
    /// [`ElementaryMap::vjp`] needs. `scratch` holds at least 2n numbers.
    fn forward_recorded<S: Over<P>>(&self, z: &mut [S], tape: &mut [S], scratch: &mut [S]);

    /// The vector–Jacobian product at the recorded point: it turns `z_bar` from the cotangent of the
    /// output into that of the input, and adds the cotangent of the step's parameters to
    /// `parameters_bar`. `scratch` holds at least 2n numbers.
    fn vjp<S: Over<P>>(
        &self,
        tape: &[S],
        z_bar: &mut [S],
        parameters_bar: &mut [S],
        scratch: &mut [S],
    );

    /// [`ElementaryMap::vjp`] at several recorded points with consecutive tapes and cotangents:
    /// the same bits as for each point in turn.
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

    /// Jacobian–vector products: z ← the step of z, and each of the consecutive `directions`, 2n
    /// numbers each, ← the derivative of the step along it. `scratch` holds at least 2n + n²
    /// numbers.
    fn jvp<S: Over<P>>(&self, z: &mut [S], directions: &mut [S], scratch: &mut [S]);

    /// [`ElementaryMap::apply`] to one point, with independent parts of the step, such as
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

/// A shear that changes only the momenta. Its tape for the pullback begins with the
/// positions.
pub trait OfMomenta<P: Scalar>: ElementaryMap<P> {
    /// Whether it is the identity at every point.
    fn is_identity(&self) -> bool;

    /// The kick, if it is a kick of one plane by one polynomial.
    fn of_a_plane(&self) -> Option<PlaneKick<'_, P>> {
        None
    }
}

/// p += c f(q/ρ), f a series of Chebyshev polynomials.
#[derive(Clone, Copy, Debug)]
pub struct PlaneKick<'a, P> {
    /// The Chebyshev series f of the kick.
    pub series: Series<'a, P>,
    /// The inverse 1/ρ of the radius ρ of the box.
    pub inverse_radius: f64,
    /// The factor c of the map.
    pub scale: P,
}
