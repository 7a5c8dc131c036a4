//! Potentials that are sums of ridge functions, which are functions of linear forms.

use super::polynomial::polynomial_parameter_count;
use super::{ActionInterval, Neuron, NeuronPotential, PolynomialPotential, Potential};
use crate::error::Error;
use crate::scalar::{Over, Pack, Scalar};

/// The kind of the ridge functions v_k in a potential V(y) = Σ_k v_k(a_k·y).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RidgeFunction {
    /// w σ(x + b): bounded, so that orbits may leave the box of the data.
    Neurons(Neuron),
    /// [Polynomials](PolynomialPotential) over a box, which take one multiplication per
    /// coefficient and no activation.
    Polynomial {
        /// The degree of V; that of its derivative is less by one.
        degree: usize,
        /// ρ: the coordinates of the box are from −ρ to ρ. Infinite until the box of the pairs is
        /// set ([`RidgeFunction::in_box`]).
        radius: f64,
    },
}

/// The largest degree of a polynomial.
pub const MOST_DEGREES: usize = 64;

impl RidgeFunction {
    /// Fails unless a degree is from 1 to 64 and the box has an extent.
    ///
    /// # Errors
    /// [`Error::CountOutOfRange`] and [`Error::Invalid`] with the value.
    pub fn check(self) -> Result<(), Error> {
        let Self::Polynomial { degree, radius } = self else { return Ok(()) };
        Error::check_count_range("degree of a polynomial", degree, 1, MOST_DEGREES)?;
        // Actions are of squares of it.
        let sizes = [radius, radius * radius, 1.0 / (radius * radius)];
        let has_extent = radius > 0.0 && sizes.iter().all(|size| size.is_normal());
        if has_extent || radius == f64::INFINITY {
            return Ok(());
        }
        let expected = "a positive number: a box with an extent";
        Err(Error::invalid("radius of the box of a polynomial", radius, expected))
    }

    /// The same function with a box of this radius, if it has no box yet.
    #[must_use]
    pub fn in_box(self, radius: f64) -> Self {
        match self {
            Self::Polynomial { degree, radius: own } if own == f64::INFINITY => {
                Self::Polynomial { degree, radius }
            }
            own => own,
        }
    }

    /// Whether it is a polynomial.
    #[inline(always)]
    pub fn is_polynomial(self) -> bool {
        matches!(self, Self::Polynomial { .. })
    }

    /// Whether it has no box yet.
    pub fn is_unbounded(self) -> bool {
        matches!(self, Self::Polynomial { radius: f64::INFINITY, .. })
    }
}

impl Default for RidgeFunction {
    /// Ridge functions of tanh: neurons.
    fn default() -> Self {
        Self::Neurons(Neuron::Tanh)
    }
}

/// A number of ridge functions of one kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ridges {
    /// h, the number of neurons or polynomials.
    pub width: usize,
    /// The kind of function that each ridge has.
    pub function: RidgeFunction,
}

impl Ridges {
    /// The number of parameters of a potential of `arguments` arguments. Saturates instead of overflowing.
    #[inline(always)]
    pub fn parameter_count(&self, arguments: usize) -> usize {
        match self.function {
            RidgeFunction::Neurons(_) => self.width.saturating_mul(arguments.saturating_add(2)),
            RidgeFunction::Polynomial { degree, .. } => {
                polynomial_parameter_count(arguments, self.width, degree)
            }
        }
    }

    /// How many of its numbers a point is put through an activation for.
    #[inline(always)]
    pub(super) fn activation_count(&self) -> usize {
        if self.function.is_polynomial() { 0 } else { self.width }
    }
}

/// A potential of ridge functions whose kind is chosen at run time: a layer branches once, not for
/// each neuron or polynomial. Where the number of arguments is known at compile time (`D` > 0) they
/// are always neurons: for polynomials the gain is not worth the compile time.
#[derive(Clone, Copy, Debug)]
pub enum RidgePotential<'a, P, const D: usize = 0> {
    /// A potential that is a sum of neurons.
    Neurons(NeuronPotential<'a, P, D>),
    /// A potential that is a sum of polynomials of linear forms.
    Polynomial(PolynomialPotential<'a, P>),
}

impl<'a, P: Copy, const D: usize> RidgePotential<'a, P, D> {
    /// A view of the parameters of a potential in n = `arguments` numbers. For polynomials, the first
    /// arguments are actions in the intervals `actions`.
    ///
    /// # Panics
    /// When there are not [as many parameters](Ridges::parameter_count), or the kind is polynomials and
    /// `D` is not 0.
    #[inline(always)]
    pub fn new(
        arguments: usize,
        ridges: Ridges,
        actions: &'a [ActionInterval],
        parameters: &'a [P],
    ) -> Self {
        let Ridges { width, function } = ridges;
        match function {
            RidgeFunction::Neurons(neuron) => Self::Neurons(
                NeuronPotential::new(arguments, width, parameters).with_neurons(neuron),
            ),
            RidgeFunction::Polynomial { .. } if const { D > 0 } => never(),
            RidgeFunction::Polynomial { degree, radius } => Self::Polynomial(
                PolynomialPotential::new(arguments, [width, degree], radius, actions, parameters),
            ),
        }
    }

    #[inline(always)]
    pub(super) fn n(&self) -> usize {
        match self {
            _ if D > 0 => D,
            Self::Neurons(neurons) => neurons.n(),
            Self::Polynomial(of) => of.n(),
        }
    }

    /// How many parameters it has.
    #[inline(always)]
    pub(super) fn parameter_count(&self) -> usize {
        match self {
            Self::Neurons(neurons) => neurons.width() * (neurons.n() + 2),
            Self::Polynomial(of) => of.weights()[0].len() + of.weights()[1].len(),
        }
    }

    /// How many numbers [`RidgePotential::gradient_recording`] leaves for
    /// [`RidgePotential::vjp`]: two for each neuron or polynomial.
    #[inline(always)]
    pub(super) fn tape_len(&self) -> usize {
        match self {
            Self::Neurons(neurons) => neurons.tape_len(),
            Self::Polynomial(of) => 2 * of.width(),
        }
    }

    #[inline(always)]
    pub(super) fn activation_count(&self) -> usize {
        match self {
            Self::Neurons(neurons) => neurons.width(),
            Self::Polynomial(_) => 0,
        }
    }

    /// How far a polynomial's arguments are from 0: more than 1 outside its box; 0 of neurons.
    pub(super) fn reach(&self, y: &[f64]) -> f64
    where
        f64: Over<P>,
    {
        match self {
            Self::Neurons(_) => 0.0,
            Self::Polynomial(of) => of.reach(y),
        }
    }

    /// `out` ← ∇V(y), filling `tape` for the pullback.
    #[inline(always)]
    pub(super) fn gradient_recording<S: Over<P>>(&self, y: &[S], out: &mut [S], tape: &mut [S]) {
        match self {
            Self::Neurons(neurons) => neurons.gradient_recording(y, out, tape),
            Self::Polynomial(of) if const { D == 0 } => of.gradient_recording(y, out, tape),
            Self::Polynomial(_) => never(),
        }
    }

    /// `out` ← ∇V(y), `hessian` ← V″(y), n × n row by row.
    #[inline(always)]
    pub(super) fn gradient_and_hessian<S: Over<P>>(
        &self,
        y: &[S],
        out: &mut [S],
        hessian: &mut [S],
    ) {
        match self {
            Self::Neurons(neurons) => neurons.gradient_and_hessian(y, out, hessian),
            Self::Polynomial(of) if const { D == 0 } => of.gradient_and_hessian(y, out, hessian),
            Self::Polynomial(_) => never(),
        }
    }
}

impl<P: Scalar, const D: usize> RidgePotential<'_, P, D> {
    /// ∇V at one point, with what is independent in the lanes of `V`: the same bits as
    /// [`Potential::gradient`].
    #[inline(always)]
    pub(super) fn gradient_across<V: Pack<P>>(&self, y: &[P], out: &mut [P])
    where
        P: Over<P>,
    {
        match self {
            Self::Neurons(neurons) => neurons.gradient_across::<V>(y, out),
            Self::Polynomial(of) if const { D == 0 } => of.gradient(y, out),
            Self::Polynomial(_) => never(),
        }
    }

    /// The adjoint of (y, parameters) ↦ ∇V(y): for the cotangent `u` of the gradient,
    /// `y_bar` ← V″(y)u and `parameters_bar` += ∂(u·∇V)/∂parameters.
    #[inline(always)]
    pub(super) fn vjp<S: Over<P>>(
        &self,
        y: &[S],
        tape: &[S],
        u: &[S],
        y_bar: &mut [S],
        parameters_bar: &mut [S],
    ) {
        match self {
            Self::Neurons(neurons) => neurons.vjp(y, tape, u, y_bar, parameters_bar),
            Self::Polynomial(of) if const { D == 0 } => of.vjp(y, tape, u, y_bar, parameters_bar),
            Self::Polynomial(_) => never(),
        }
    }

    /// [`RidgePotential::vjp`] at M points, for n known at compile time: the same bits as of one
    /// after another.
    #[inline(always)]
    pub(super) fn vjp_together<S: Over<P>, const M: usize>(
        &self,
        y: &[[S; D]; M],
        tapes: [&[S]; M],
        u: &[[S; D]; M],
        y_bar: &mut [[S; D]; M],
        parameters_bar: &mut [S],
    ) {
        match self {
            Self::Neurons(neurons) => neurons.vjp_together(y, tapes, u, y_bar, parameters_bar),
            Self::Polynomial(_) => never(),
        }
    }
}

impl<'a, P, const D: usize> From<NeuronPotential<'a, P, D>> for RidgePotential<'a, P, D> {
    fn from(neurons: NeuronPotential<'a, P, D>) -> Self {
        Self::Neurons(neurons)
    }
}

impl<'a, P, const D: usize> From<PolynomialPotential<'a, P>> for RidgePotential<'a, P, D> {
    fn from(polynomials: PolynomialPotential<'a, P>) -> Self {
        Self::Polynomial(polynomials)
    }
}

impl<P: Copy, S: Over<P>, const D: usize> Potential<S> for RidgePotential<'_, P, D> {
    #[inline(always)]
    fn dof(&self) -> usize {
        self.n()
    }

    #[inline(always)]
    fn gradient(&self, y: &[S], out: &mut [S]) {
        match self {
            Self::Neurons(neurons) => neurons.gradient(y, out),
            Self::Polynomial(of) if const { D == 0 } => of.gradient(y, out),
            Self::Polynomial(_) => never(),
        }
    }
}

/// Polynomials of a number of arguments that is known at compile time, which there are none of.
#[cold]
#[inline(never)]
fn never() -> ! {
    unreachable!("polynomials of a number of arguments that is known at compile time")
}
