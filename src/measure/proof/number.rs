//! The number types on which a map of a plane is evaluated: numbers, enclosures, and their derivatives.

use super::rounded::up;

/// A real number that is not a double: it is within a radius of the sum of two doubles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constant {
    /// The first and larger of the two doubles whose sum is near the number.
    pub high: f64,
    /// The second and smaller of the two doubles whose sum is near the number.
    pub low: f64,
    /// An upper bound of the distance of the number from the sum of the two doubles.
    pub radius: f64,
    /// The same number with more digits: three doubles, and a radius around their sum.
    pub fine: ([f64; 3], f64),
}

impl Constant {
    /// An upper bound of its distance from the first double.
    pub fn off(self) -> f64 {
        up(self.low.abs() + self.radius)
    }
}

/// Numbers and enclosures of numbers.
///
/// The result of an operation on enclosures contains the results for all numbers in them.
pub trait Number: Copy {
    /// The number of this type that stands for a double.
    fn of(value: f64) -> Self;
    /// The sum of two numbers, or an enclosure of it.
    fn plus(self, other: Self) -> Self;
    /// The difference of two numbers, or an enclosure of it.
    fn minus(self, other: Self) -> Self {
        self.plus(other.scaled(-1.0))
    }
    /// The product of two numbers, or an enclosure of it.
    fn times(self, other: Self) -> Self;
    /// The product with a double.
    fn scaled(self, factor: f64) -> Self;
    /// The product with a constant that no double is.
    fn scaled_by(self, factor: Constant) -> Self;
    /// The hyperbolic tangent of the number, or an enclosure of it.
    fn tanh(self) -> Self;
    /// The sine and the cosine.
    fn sin_cos(self) -> (Self, Self);
    /// A function of this number and its first derivatives, K values in all.
    ///
    /// Where many terms nearly cancel, the enclosure should be narrower than the sum of those of the terms.
    fn through<const K: usize>(self, function: &impl Function) -> [Self; K] {
        function.derivatives(self)
    }
}

impl Number for f64 {
    fn of(value: f64) -> Self {
        value
    }
    fn plus(self, other: Self) -> Self {
        self + other
    }
    fn times(self, other: Self) -> Self {
        self * other
    }
    fn scaled(self, factor: f64) -> Self {
        self * factor
    }
    fn scaled_by(self, factor: Constant) -> Self {
        self * factor.high
    }
    fn tanh(self) -> Self {
        use crate::scalar::Scalar;
        self.tanh_sech2().0
    }
    fn sin_cos(self) -> (Self, Self) {
        crate::scalar::Elementary::sin_cos(self)
    }
}

/// A function of one number with its first derivatives.
pub trait Function {
    /// f, f′, … at x: K values, five at most.
    fn derivatives<N: Number, const K: usize>(&self, x: N) -> [N; K];
}

/// A coordinate during the evaluation of a map: a [`Number`], or one with derivatives by the starting point.
pub trait Coordinate: Copy {
    /// The sum of two coordinates, with its derivatives if they have some.
    fn plus(self, other: Self) -> Self;
    /// The product of two coordinates, with its derivatives if they have some.
    fn times(self, other: Self) -> Self;
    /// The product with a double.
    fn scaled(self, factor: f64) -> Self;
    /// The product with a constant that no double is.
    fn scaled_by(self, factor: Constant) -> Self;
    /// The sum with a constant.
    fn shifted(self, by: f64) -> Self;
    /// A function of the coordinate, with its derivatives if the coordinate has some.
    fn through(self, function: &impl Function) -> Self;
    /// The sine and the cosine.
    fn sin_cos(self) -> (Self, Self);
}

impl<N: Number> Coordinate for N {
    fn plus(self, other: Self) -> Self {
        Number::plus(self, other)
    }
    fn times(self, other: Self) -> Self {
        Number::times(self, other)
    }
    fn scaled(self, factor: f64) -> Self {
        Number::scaled(self, factor)
    }
    fn scaled_by(self, factor: Constant) -> Self {
        Number::scaled_by(self, factor)
    }
    fn shifted(self, by: f64) -> Self {
        Number::plus(self, N::of(by))
    }
    fn through(self, function: &impl Function) -> Self {
        let [value] = Number::through(self, function);
        value
    }
    fn sin_cos(self) -> (Self, Self) {
        Number::sin_cos(self)
    }
}

/// The pairs (i, j), i ≤ j, of the second derivatives that a [`Jet`] of two keeps.
const PAIRS: [(usize, usize); 3] = [(0, 0), (0, 1), (1, 1)];

/// A number with its two first derivatives and, if `SECOND` is true, the second ones ∂₀∂₀, ∂₀∂₁, ∂₁∂₁.
#[derive(Clone, Copy, Debug)]
pub struct Jet<N, const SECOND: bool> {
    /// The value of the number, without derivatives.
    pub value: N,
    /// The first derivatives ∂₀ and ∂₁ of the number.
    pub first: [N; 2],
    /// The second derivatives ∂₀∂₀, ∂₀∂₁ and ∂₁∂₁, which mean nothing unless `SECOND` is true.
    pub second: [N; 3],
}

impl<N: Number, const SECOND: bool> Jet<N, SECOND> {
    /// The coordinate number `axis` of the starting point.
    pub fn start(value: N, axis: usize) -> Self {
        let first = [0, 1].map(|k| N::of(if k == axis { 1.0 } else { 0.0 }));
        Self { value, first, second: [N::of(0.0); 3] }
    }

    fn each(self, f: impl Fn(N) -> N) -> Self {
        let second = if SECOND { self.second.map(&f) } else { self.second };
        Self { value: f(self.value), first: self.first.map(&f), second }
    }

    /// f(x) for the derivatives f, f′, f″ at the value.
    fn chain(self, [f, slope, curvature]: [N; 3]) -> Self {
        let first = self.first.map(|d| slope.times(d));
        let mut second = self.second;
        if SECOND {
            let bent = self.first.map(|d| curvature.times(d));
            for (k, (i, j)) in PAIRS.into_iter().enumerate() {
                second[k] = bent[i].times(self.first[j]).plus(slope.times(self.second[k]));
            }
        }
        Self { value: f, first, second }
    }
}

impl<N: Number, const SECOND: bool> Coordinate for Jet<N, SECOND> {
    fn plus(self, other: Self) -> Self {
        let mut out = self;
        out.value = self.value.plus(other.value);
        for k in 0..2 {
            out.first[k] = self.first[k].plus(other.first[k]);
        }
        for k in 0..if SECOND { 3 } else { 0 } {
            out.second[k] = self.second[k].plus(other.second[k]);
        }
        out
    }

    fn times(self, other: Self) -> Self {
        let mut out = self;
        out.value = self.value.times(other.value);
        for k in 0..2 {
            out.first[k] = self.first[k].times(other.value).plus(self.value.times(other.first[k]));
        }
        if SECOND {
            for (k, (i, j)) in PAIRS.into_iter().enumerate() {
                let outer =
                    self.second[k].times(other.value).plus(self.value.times(other.second[k]));
                let (a, b) =
                    (self.first[i].times(other.first[j]), self.first[j].times(other.first[i]));
                out.second[k] = outer.plus(a.plus(b));
            }
        }
        out
    }

    fn scaled(self, factor: f64) -> Self {
        self.each(|x| x.scaled(factor))
    }

    fn scaled_by(self, factor: Constant) -> Self {
        self.each(|x| x.scaled_by(factor))
    }

    fn shifted(self, by: f64) -> Self {
        Self { value: self.value.plus(N::of(by)), ..self }
    }

    fn through(self, function: &impl Function) -> Self {
        if SECOND {
            return self.chain(self.value.through(function));
        }
        let [f, slope] = self.value.through(function);
        self.chain([f, slope, slope])
    }

    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.value.sin_cos();
        let (minus_s, minus_c) = (s.scaled(-1.0), c.scaled(-1.0));
        (self.chain([s, c, minus_s]), self.chain([c, minus_s, minus_c]))
    }
}
