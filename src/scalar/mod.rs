//! The number layer: every map of the crate is written once over [`Scalar`].
//!
//! | number | question it answers |
//! |---|---|
//! | `f64` | where does the map go? |
//! | [`Lanes`] | where do eight points go at once? |
//! | `f32`, [`DoubleDouble`] | does the defect shrink with the unit roundoff? |
//! | [`Dual`] | what is the exact Jacobian? |
//! | [`Tracked`] | how large can the rounding error be? |
//! | [`OnGrid`] | is the inverse exact, bit for bit? |
//! | [`Traced`] | which operations is the map made of? |
//!
//! Weights have a number type of their own, so that a constant weight costs a
//! dual number nothing: `S: Over<P>` says that a state of type `S` can be moved
//! by a map whose parameters are of type `P`. With `P = Dual` the same code
//! differentiates in the parameters.

mod chebyshev;
mod double_double;
mod dual;
mod exp;
mod float;
mod grid;
mod lanes;
mod lanewise;
mod lorentzian;
mod on_grid;
mod on_lanes;
#[allow(unsafe_code)]
mod simd;
mod sin_cos;
mod tanh;
mod traced;
mod tracked;

pub use chebyshev::Series;
pub(crate) use chebyshev::scales;
pub use double_double::DoubleDouble;
pub use dual::{Dual, dual_variables_made};
pub use grid::{Floats, Grid, GridNumbers, GridPlace, Integers};
pub use lanes::Lanes;
pub use lanewise::WIDTH;
pub use on_grid::{FloatOnGrid, IntegerOnGrid, OnGrid};
pub use on_lanes::tanh_sech2_of_all;
pub(crate) use on_lanes::{on_independent_lanes, on_lanes};
use simd::Apart;
pub(crate) use simd::{Kernel, Pack};
pub use simd::{Simd, Task, tanh_sech2};
pub use traced::{Operation, Trace, Traced, TracedKernel};
pub use tracked::Tracked;

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// A number that a layer can be evaluated on.
///
/// All operations are by value. `mul_add` is fused (one rounding) on every
/// processor, so that results do not depend on the instruction set; only on
/// [`DoubleDouble`] it is a product and a sum.
pub trait Scalar:
    Copy
    + Debug
    + Send
    + Sync
    + 'static
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
{
    /// Whether kernels on such numbers are compiled separately for each small number of
    /// degrees of freedom. This is for types whose purpose is speed, since each costs
    /// seconds of compilation.
    const SPECIALISED: bool = false;

    /// The nearest number to `value`, without derivatives.
    fn from_f64(value: f64) -> Self;

    /// `self · a + b`, rounded once.
    fn mul_add(self, a: Self, b: Self) -> Self;

    /// `(tanh x, sech² x)`, sharing their exponential. Each is accurate on its
    /// own: sech² is never computed as 1 − tanh².
    fn tanh_sech2(self) -> (Self, Self);

    /// [`Scalar::tanh_sech2`] of K numbers: the same bits, and for lanes in less
    /// time than one after the other.
    #[inline(always)]
    fn tanh_sech2_each<const K: usize>(x: [Self; K]) -> ([Self; K], [Self; K]) {
        let (mut t, mut s) = (x, x);
        for i in 0..K {
            (t[i], s[i]) = x[i].tanh_sech2();
        }
        (t, s)
    }

    /// `(x/(1 + x²), 1/(1 + x²))`: of arctan, the slope s and t = xs, so that s′ = −2ts as of tanh.
    ///
    /// Unless a type has its own, with a division; `f64` and its lanes have one without.
    #[inline]
    fn lorentzian(self) -> (Self, Self) {
        let one = Self::from_f64(1.0);
        let slope = one / self.mul_add(self, one);
        (self * slope, slope)
    }

    /// [`Scalar::lorentzian`] of K numbers: the same bits, and for lanes in less time than one
    /// after the other.
    #[inline(always)]
    fn lorentzian_each<const K: usize>(x: [Self; K]) -> ([Self; K], [Self; K]) {
        let (mut t, mut s) = (x, x);
        for i in 0..K {
            (t[i], s[i]) = x[i].lorentzian();
        }
        (t, s)
    }

    /// Runs a task on such numbers as a separate function. On vector registers the task
    /// then has all of them, and a composition on dual numbers does not become a single
    /// function with all kinds of step, which takes minutes to compile.
    #[inline(always)]
    fn outlined(task: impl Task) {
        task.run_apart();
    }

    /// The numbers themselves where they are of type `f64`, for which there are kernels on vector registers;
    /// None of other types.
    #[inline(always)]
    fn as_plain(values: &mut [Self]) -> Option<&mut [f64]> {
        let _ = values;
        None
    }

    /// self as if it were exact: for numbers with an error bound, without it. This is sound where what follows forgets
    /// the error of self, as an iteration of Newton's method does to first order.
    #[inline(always)]
    fn without_bound(self) -> Self {
        self
    }

    /// The absolute value |x|.
    fn abs(self) -> Self;

    /// True when the number is zero in every lane and in every derivative.
    fn is_zero(self) -> bool;

    /// The unit roundoff u of the underlying arithmetic: 2⁻⁵³ for `f64`.
    fn unit_roundoff() -> f64;

    /// The number zero.
    #[inline(always)]
    fn zero() -> Self {
        Self::from_f64(0.0)
    }

    /// sech² x = 1/cosh² x.
    #[inline(always)]
    fn sech2(self) -> Self {
        self.tanh_sech2().1
    }

    /// The hyperbolic tangent, tanh x.
    #[inline(always)]
    fn tanh(self) -> Self {
        self.tanh_sech2().0
    }

    /// xⁿ by repeated squaring; x⁻ⁿ is the reciprocal of xⁿ.
    #[inline]
    fn powi(self, exponent: i32) -> Self {
        let (mut power, mut square, mut left) =
            (Self::from_f64(1.0), self, exponent.unsigned_abs());
        while left > 0 {
            if left % 2 == 1 {
                power *= square;
            }
            left /= 2;
            if left > 0 {
                square *= square;
            }
        }
        if exponent < 0 { Self::from_f64(1.0) / power } else { power }
    }
}

/// A number without derivatives, its type taken from what it is combined with:
/// `x * constant(0.5)`.
#[inline(always)]
pub fn constant<S: Scalar>(value: f64) -> S {
    S::from_f64(value)
}

/// Elementary functions that Hamiltonian systems and twists need, and kicks do not.
pub trait Elementary: Scalar {
    /// The sine and the cosine together, `(sin x, cos x)`.
    fn sin_cos(self) -> (Self, Self);
    /// sin x: where both are needed, [`Elementary::sin_cos`] shares their work.
    #[inline(always)]
    fn sin(self) -> Self {
        self.sin_cos().0
    }
    /// The cosine of an angle in radians.
    #[inline(always)]
    fn cos(self) -> Self {
        self.sin_cos().1
    }
    /// The exponential function, eˣ.
    fn exp(self) -> Self;
    /// self, or zero wherever `factor` is zero: for products in which 0·∞ is to be 0.
    fn zero_with(self, factor: Self) -> Self;
    /// 1 or −1, with the sign of the real part: exact, and a constant.
    fn sign(self) -> Self;
    /// The square root √x; NaN below 0.
    fn sqrt(self) -> Self;
    /// ln x; NaN below 0.
    fn ln(self) -> Self;
    /// x to a constant power; NaN for x < 0 unless the exponent is an integer.
    fn powf(self, exponent: f64) -> Self;
    /// The angle of the point (`x`, self) in [−π, π], with −π only for self = −0.
    fn atan2(self, x: Self) -> Self;
    /// x minus a multiple of the period, in [0, `period`] (the end only by rounding), as for
    /// an angle. Derivatives are those of x.
    fn rem_euclid(self, period: f64) -> Self;
}

/// A number with one real part, on which code may branch.
///
/// A branch uses only the real part, so that it does not depend on the number type.
pub trait Real: Elementary {
    /// The real part, rounded to `f64`.
    fn value(self) -> f64;

    /// self; for numbers with an error bound, the bound is reduced by that of `known`:
    /// `x.inherits(x)` is x as if it were exact.
    #[inline(always)]
    fn inherits(self, known: Self) -> Self {
        let _ = known;
        self
    }
}

/// A number of a state on which parameters of type `P` can act.
pub trait Over<P>: Elementary {
    /// The parameter as a state number.
    fn embed(parameter: P) -> Self;

    /// `self · parameter + addend`, rounded once.
    fn mul_add_parameter(self, parameter: P, addend: Self) -> Self;

    /// The product `self · parameter`.
    #[inline(always)]
    fn times(self, parameter: P) -> Self {
        self * Self::embed(parameter)
    }

    /// `self + factor · direction`, rounded once: the only way in which a step
    /// changes a coordinate, apart from signs and exchanges.
    ///
    /// A number on a grid rounds the increment `factor · direction` to the grid here,
    /// so that steps can be inverted bit for bit.
    #[inline(always)]
    fn increment(self, factor: P, direction: Self) -> Self {
        direction.mul_add_parameter(factor, self)
    }

    /// f_k(s_k) of K series f_k = Σ_m c_{mk} T_m of Chebyshev polynomials.
    #[inline(always)]
    fn series_each<const K: usize>(s: [Self; K], series: Series<'_, P>) -> [Self; K]
    where
        P: Copy,
    {
        chebyshev::values(s, series)
    }

    /// [`Over::series_each`], the same bits, and the derivatives f_k′(s_k).
    #[inline(always)]
    fn series_with_slopes<const K: usize>(s: [Self; K], series: Series<'_, P>) -> [[Self; K]; 2]
    where
        P: Copy,
    {
        chebyshev::with_slopes(s, series)
    }

    /// [`Over::series_with_slopes`], the same bits, and the second derivatives f_k″(s_k).
    #[inline(always)]
    fn series_with_curvatures<const K: usize>(s: [Self; K], series: Series<'_, P>) -> [[Self; K]; 3]
    where
        P: Copy,
    {
        chebyshev::with_curvatures(s, series)
    }
}

/// The larger of two numbers, NaN if either is: `f64::max` would lose the NaN
/// that a check has to fail on.
#[inline(always)]
pub fn max_or_nan(a: f64, b: f64) -> f64 {
    if a.is_nan() || b <= a { a } else { b }
}

/// The upper median of one number at least; NaN if any is.
pub(crate) fn median_or_nan(mut values: Vec<f64>) -> f64 {
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, max_or_nan);
    values.sort_by(f64::total_cmp);
    if largest.is_nan() { largest } else { values[values.len() / 2] }
}

/// Implements `+=` and the like.
macro_rules! assigning {
    ([$($generics:tt)*] $number:ty) => {
        assigning!(@ [$($generics)*] $number, AddAssign, add_assign, +);
        assigning!(@ [$($generics)*] $number, SubAssign, sub_assign, -);
        assigning!(@ [$($generics)*] $number, MulAssign, mul_assign, *);
        assigning!(@ [$($generics)*] $number, DivAssign, div_assign, /);
    };
    (@ [$($generics:tt)*] $number:ty, $trait:ident, $method:ident, $operator:tt) => {
        impl<$($generics)*> std::ops::$trait for $number {
            #[inline(always)]
            fn $method(&mut self, other: Self) {
                *self = *self $operator other;
            }
        }
    };
}
pub(crate) use assigning;

/// Implements `Over<Self>`: a parameter is already a state number.
macro_rules! over_itself {
    ([$($generics:tt)*] $number:ty) => {
        impl<$($generics)*> crate::scalar::Over<$number> for $number {
            #[inline(always)]
            fn embed(parameter: $number) -> Self {
                parameter
            }
            #[inline(always)]
            fn mul_add_parameter(self, parameter: $number, addend: Self) -> Self {
                crate::scalar::Scalar::mul_add(self, parameter, addend)
            }
        }
    };
}
pub(crate) use over_itself;

/// Implements `Over<f64>` for lanes: a parameter is the same in each of them.
macro_rules! over_parameters {
    ([$($generics:tt)*] $number:ty) => {
        impl<$($generics)*> crate::scalar::Over<f64> for $number {
            #[inline(always)]
            fn embed(parameter: f64) -> Self {
                crate::scalar::Scalar::from_f64(parameter)
            }
            #[inline(always)]
            fn mul_add_parameter(self, parameter: f64, addend: Self) -> Self {
                let parameter = crate::scalar::Scalar::from_f64(parameter);
                crate::scalar::Scalar::mul_add(self, parameter, addend)
            }
        }
    };
}
pub(crate) use over_parameters;
