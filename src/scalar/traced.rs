//! A number that records the operations on it, from which source code of a map is generated.

use super::lanewise::{Lanewise, zero_lanes_with};
use super::{
    Elementary, Over, Scalar, Series, assigning, chebyshev, lorentzian, over_itself, sin_cos, tanh,
};
use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number of a [`Trace`], identified by the place of the operation that yields it.
///
/// A map applied to such numbers records its operations in order. Repeating them on `f64` gives the same
/// bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Traced(u32);

impl Traced {
    /// The place of its operation in [`Trace::operations`].
    pub fn place(self) -> usize {
        self.0 as usize
    }

    /// The number that the operation at a place yields.
    pub fn from_place(place: usize) -> Self {
        Self(u32::try_from(place).expect("fewer than 2³² operations"))
    }

    fn of(operation: Operation) -> Self {
        RECORD.with_borrow_mut(|record| {
            record.operations.push(operation);
            Self::from_place(record.operations.len() - 1)
        })
    }
}

/// An operation that yields a number from others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Operation {
    /// The input of this number.
    Input(usize),
    /// A constant of the code.
    Constant(f64),
    /// A parameter of the map.
    Parameter(f64),
    /// The negative −x of a number x.
    Negative(Traced),
    /// The sum x + y of two numbers.
    Sum(Traced, Traced),
    /// The difference x − y of two numbers.
    Difference(Traced, Traced),
    /// The product x·y of two numbers.
    Product(Traced, Traced),
    /// The quotient x/y of two numbers.
    Quotient(Traced, Traced),
    /// x·y + z, rounded once.
    MulAdd([Traced; 3]),
    /// The magnitude |x| of a number x.
    Magnitude(Traced),
    /// The first or the second of the functions that a kernel computes together.
    Kernel(TracedKernel, usize, Traced),
    /// The square root √x of a number x.
    Sqrt(Traced),
    /// The smaller of x and a limit; NaN stays.
    AtMost(Traced, f64),
    /// The number whose exponent field stands in the lowest bits of x.
    PowerOfLowBits(Traced),
    /// The number whose bits are the difference of those of x and of y, as integers that wrap.
    MinusBits(Traced, Traced),
    /// A number that is negative where this bit of x is set.
    BitAsSign(Traced, u32),
    /// The second where the first is above the limit, else the third.
    SelectAbove([Traced; 3], f64),
    /// The second where the first has a minus sign, else the third.
    SelectNegative([Traced; 3]),
    /// The magnitude of x with the sign of y.
    WithSignOf(Traced, Traced),
    /// x, negated where y has a minus sign.
    NegatedWhere(Traced, Traced),
    /// A function that occurs in no step of a network.
    Other(&'static str),
}

impl Operation {
    /// The operands of the operation.
    pub fn operands(mut self) -> Vec<Traced> {
        self.operands_mut().into_iter().map(|operand| *operand).collect()
    }

    /// The same operation with its operands moved: each that has a new place in `places` gets it.
    pub fn with_places(mut self, places: &[Option<Traced>]) -> Self {
        for operand in self.operands_mut() {
            *operand = places[operand.place()].unwrap_or(*operand);
        }
        self
    }

    fn operands_mut(&mut self) -> Vec<&mut Traced> {
        match self {
            Self::Input(_) | Self::Constant(_) | Self::Parameter(_) | Self::Other(_) => Vec::new(),
            Self::Negative(x)
            | Self::Magnitude(x)
            | Self::Kernel(_, _, x)
            | Self::Sqrt(x)
            | Self::AtMost(x, _)
            | Self::PowerOfLowBits(x)
            | Self::BitAsSign(x, _) => vec![x],
            Self::Sum(x, y)
            | Self::Difference(x, y)
            | Self::Product(x, y)
            | Self::Quotient(x, y)
            | Self::MinusBits(x, y)
            | Self::WithSignOf(x, y)
            | Self::NegatedWhere(x, y) => vec![x, y],
            Self::MulAdd(all) | Self::SelectAbove(all, _) | Self::SelectNegative(all) => {
                all.iter_mut().collect()
            }
        }
    }
}

/// A pair of elementary functions that are computed together by a sequence of operations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum TracedKernel {
    /// tanh x and sech² x.
    TanhSech2,
    /// x/(1 + x²) and 1/(1 + x²).
    Lorentzian,
    /// sin x and cos x; NaN of both for |x| > 2³⁰.
    SinCos,
}

impl TracedKernel {
    /// The trace of its operations, with one input and two outputs.
    pub fn trace(self) -> Trace {
        Trace::new(1, |z| match self {
            Self::TanhSech2 => {
                let ([t], [s]) = tanh::tanh_sech2_in_step([z[0]]);
                vec![t, s]
            }
            Self::Lorentzian => {
                let ([t], [s]) = lorentzian::lorentzian_in_step([z[0]]);
                vec![t, s]
            }
            Self::SinCos => {
                let (size, nan) = (Scalar::abs(z[0]), Traced::from_f64(f64::NAN));
                let (sin, cos) = sin_cos::sin_cos(z[0]);
                // Beyond it libm's reduction of angles takes over, which is no straight line.
                let near = |value| size.select_above(sin_cos::FAR, nan, value);
                vec![near(sin), near(cos)]
            }
        })
    }
}

/// The operations of a function, in their order.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// The operations, each with earlier ones as operands.
    pub operations: Vec<Operation>,
    /// The numbers that the function returns, in their order.
    pub outputs: Vec<Traced>,
    /// The arguments of its Chebyshev polynomials.
    pub arguments: Vec<Traced>,
}

thread_local! {
    static RECORD: RefCell<Trace> = const {
        RefCell::new(Trace { operations: Vec::new(), outputs: Vec::new(), arguments: Vec::new() })
    };
}

impl Trace {
    /// The trace of `function` on `inputs` numbers; `function` returns its results. It must not make
    /// another trace.
    pub fn new(inputs: usize, function: impl FnOnce(&mut [Traced]) -> Vec<Traced>) -> Self {
        RECORD.with_borrow_mut(|record| {
            record.operations.clear();
            record.arguments.clear();
        });
        let mut numbers: Vec<Traced> =
            (0..inputs).map(|k| Traced::of(Operation::Input(k))).collect();
        let outputs = function(&mut numbers);
        let recorded = RECORD.with_borrow_mut(|record| {
            let operations = std::mem::take(&mut record.operations);
            let arguments = std::mem::take(&mut record.arguments);
            (operations, arguments)
        });
        Self { operations: recorded.0, outputs, arguments: recorded.1 }
    }

    /// Whether the results are the inputs.
    pub fn is_identity(&self) -> bool {
        let input =
            |(k, output): (usize, &Traced)| self.operations[output.place()] == Operation::Input(k);
        self.outputs.iter().enumerate().all(input)
    }

    /// The outputs at these inputs, with each operation done on `f64` in order; NaN for functions not recorded.
    pub fn evaluate(&self, inputs: &[f64]) -> Vec<f64> {
        let mut values: Vec<f64> = Vec::with_capacity(self.operations.len());
        for operation in &self.operations {
            let of = |number: &Traced| values[number.place()];
            values.push(match operation {
                Operation::Input(k) => inputs[*k],
                Operation::Constant(value) | Operation::Parameter(value) => *value,
                Operation::Negative(x) => -of(x),
                Operation::Sum(x, y) => of(x) + of(y),
                Operation::Difference(x, y) => of(x) - of(y),
                Operation::Product(x, y) => of(x) * of(y),
                Operation::Quotient(x, y) => of(x) / of(y),
                Operation::MulAdd([x, y, z]) => of(x).mul_add(of(y), of(z)),
                Operation::Magnitude(x) => of(x).abs(),
                Operation::Kernel(kernel, part, x) => kernel.trace().evaluate(&[of(x)])[*part],
                Operation::Sqrt(x) => of(x).sqrt(),
                Operation::AtMost(x, most) => of(x).at_most(*most),
                Operation::PowerOfLowBits(x) => of(x).power_of_low_bits(),
                Operation::MinusBits(x, y) => of(x).minus_bits(of(y)),
                Operation::BitAsSign(x, bit) => f64::from_bits(of(x).to_bits() << (63 - bit)),
                Operation::SelectAbove([x, above, other], limit) => {
                    of(x).select_above(*limit, of(above), of(other))
                }
                Operation::SelectNegative([x, negative, other]) => {
                    of(x).select_negative(of(negative), of(other))
                }
                Operation::WithSignOf(x, sign) => of(x).with_sign_of(of(sign)),
                Operation::NegatedWhere(x, sign) => of(x).negated_where(of(sign)),
                Operation::Other(_) => f64::NAN,
            });
        }
        self.outputs.iter().map(|output| values[output.place()]).collect()
    }

    /// Which operations these numbers need.
    pub fn needed(&self, results: &[Traced]) -> Vec<bool> {
        let mut needed = vec![false; self.operations.len()];
        results.iter().for_each(|result| needed[result.place()] = true);
        for place in (0..needed.len()).rev() {
            if needed[place] {
                let operands = self.operations[place].operands();
                operands.iter().for_each(|operand| needed[operand.place()] = true);
            }
        }
        needed
    }
}

impl Neg for Traced {
    type Output = Self;
    fn neg(self) -> Self {
        Self::of(Operation::Negative(self))
    }
}

macro_rules! records {
    ($trait:ident, $method:ident, $operation:ident) => {
        impl $trait for Traced {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self::of(Operation::$operation(self, other))
            }
        }
    };
}
records!(Add, add, Sum);
records!(Sub, sub, Difference);
records!(Mul, mul, Product);
records!(Div, div, Quotient);

impl Scalar for Traced {
    fn from_f64(value: f64) -> Self {
        Self::of(Operation::Constant(value))
    }
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self::of(Operation::MulAdd([self, a, b]))
    }
    fn tanh_sech2(self) -> (Self, Self) {
        let of = |part| Self::of(Operation::Kernel(TracedKernel::TanhSech2, part, self));
        (of(0), of(1))
    }
    fn lorentzian(self) -> (Self, Self) {
        let of = |part| Self::of(Operation::Kernel(TracedKernel::Lorentzian, part, self));
        (of(0), of(1))
    }
    fn abs(self) -> Self {
        Self::of(Operation::Magnitude(self))
    }
    /// No: what is traced holds for all values.
    fn is_zero(self) -> bool {
        false
    }
    fn unit_roundoff() -> f64 {
        f64::unit_roundoff()
    }
}

impl Elementary for Traced {
    fn sin_cos(self) -> (Self, Self) {
        let of = |part| Self::of(Operation::Kernel(TracedKernel::SinCos, part, self));
        (of(0), of(1))
    }
    fn exp(self) -> Self {
        Self::of(Operation::Other("exp"))
    }
    fn zero_with(self, factor: Self) -> Self {
        zero_lanes_with(self, factor)
    }
    fn sign(self) -> Self {
        Self::from_f64(1.0).with_sign_of(self)
    }
    fn sqrt(self) -> Self {
        Self::of(Operation::Sqrt(self))
    }
    fn ln(self) -> Self {
        Self::of(Operation::Other("ln"))
    }
    fn powf(self, _: f64) -> Self {
        Self::of(Operation::Other("powf"))
    }
    fn atan2(self, _: Self) -> Self {
        Self::of(Operation::Other("atan2"))
    }
    fn rem_euclid(self, _: f64) -> Self {
        Self::of(Operation::Other("rem_euclid"))
    }
}

impl Lanewise for Traced {
    fn negative_mul_add(self, a: Self, b: Self) -> Self {
        (-self).mul_add(a, b)
    }
    fn at_most(self, most: f64) -> Self {
        Self::of(Operation::AtMost(self, most))
    }
    fn power_of_low_bits(self) -> Self {
        Self::of(Operation::PowerOfLowBits(self))
    }
    fn bit_as_sign<const BIT: u32>(self) -> Self {
        Self::of(Operation::BitAsSign(self, BIT))
    }
    fn select_above(self, limit: f64, above: Self, otherwise: Self) -> Self {
        Self::of(Operation::SelectAbove([self, above, otherwise], limit))
    }
    fn select_negative(self, negative: Self, otherwise: Self) -> Self {
        Self::of(Operation::SelectNegative([self, negative, otherwise]))
    }
    /// No: of a branch the usual side is recorded.
    fn any_above(self, _: f64) -> bool {
        false
    }
    /// No: of a branch the usual side is recorded.
    fn all_negative(self) -> bool {
        false
    }
    fn one_by_one(self, _: impl Fn(f64) -> (f64, f64)) -> (Self, Self) {
        let other = Self::of(Operation::Other("a function of f64"));
        (other, other)
    }
    fn pair_by_pair(self, _: Self, _: impl Fn(f64, f64) -> f64) -> Self {
        Self::of(Operation::Other("a function of f64"))
    }
    fn with_sign_of(self, sign: Self) -> Self {
        Self::of(Operation::WithSignOf(self, sign))
    }
    fn negated_where(self, sign: Self) -> Self {
        Self::of(Operation::NegatedWhere(self, sign))
    }
    fn plus_bits(self, _: Self) -> Self {
        Self::of(Operation::Other("a sum of bits"))
    }
    fn minus_bits(self, other: Self) -> Self {
        Self::of(Operation::MinusBits(self, other))
    }
}

assigning!([] Traced);
over_itself!([] Traced);

impl Over<f64> for Traced {
    fn embed(parameter: f64) -> Self {
        Self::of(Operation::Parameter(parameter))
    }
    fn mul_add_parameter(self, parameter: f64, addend: Self) -> Self {
        self.mul_add(Self::embed(parameter), addend)
    }
    fn series_each<const K: usize>(s: [Self; K], series: Series<'_, f64>) -> [Self; K] {
        RECORD.with_borrow_mut(|record| record.arguments.extend(s));
        chebyshev::values(s, series)
    }
    fn series_with_slopes<const K: usize>(s: [Self; K], series: Series<'_, f64>) -> [[Self; K]; 2] {
        RECORD.with_borrow_mut(|record| record.arguments.extend(s));
        chebyshev::with_slopes(s, series)
    }
}
