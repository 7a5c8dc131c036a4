//! A number on a grid, over which the maps of the crate are exact bijections.

use super::grid::{Floats, GridPlace, Integers};
use super::lanewise::Lanewise;
use super::{Elementary, Over, Real, Scalar, Series, Task, assigning};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number on a grid, or an intermediate result: maps that change their coordinates only by
/// [`Over::increment`], signs and exchanges are exact bijections on it.
///
/// Increments are computed from the `f64` values of the coordinates as for plain numbers, off the
/// grid, and rounded when they are added. A coordinate that is set to anything but itself plus an
/// increment is off the grid from then on; [`OnGrid::place`] is then None.
///
/// ```
/// use gyroceptron::layer::HenonLayer;
/// use gyroceptron::phase::Map;
/// use gyroceptron::scalar::IntegerOnGrid;
///
/// let map = HenonLayer::new(1, 2, 1.0, &[0.7, -0.4, 0.1, 0.2, 1.3, -0.9, 0.25]).map();
/// let start = [5 << 40, -3 << 40].map(|place| IntegerOnGrid::from_place(place, 44));
/// let mut z = start;
/// for _ in 0..1000 {
///     map.forward(&mut z);
/// }
/// for _ in 0..1000 {
///     map.inverse(&mut z);
/// }
/// assert_eq!(z.map(|z| z.place()), start.map(|z| z.place()));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct OnGrid<V, G> {
    value: V,
    place: G,
}

/// A coordinate on a grid of [integers](super::GridNumbers::Integers).
pub type IntegerOnGrid = OnGrid<f64, Integers<f64>>;

/// A coordinate on a grid of [floats](super::GridNumbers::Floats).
pub type FloatOnGrid = OnGrid<f64, Floats<f64>>;

impl<G: GridPlace<f64>> OnGrid<f64, G> {
    /// The coordinate k·2⁻ᴮ with k = `place` and B = `bits`, at most
    /// [`GridNumbers::most_bits`](super::GridNumbers::most_bits).
    pub fn from_place(place: i64, bits: u32) -> Self {
        Self::from_lanes(f64::from_bits(place as u64), bits)
    }

    /// Whether it was set to something other than itself plus increments, and so is off the grid.
    pub fn is_of_no_increments(self) -> bool {
        self.place.is_on_grid().is_infinite()
    }

    /// k, if it is on the grid.
    pub fn place(self) -> Option<i64> {
        let on_grid = self.place.is_on_grid().is_finite();
        on_grid.then(|| self.place.places(self.value).to_bits() as i64)
    }
}

impl<V, G: GridPlace<V>> OnGrid<V, G> {
    /// An integer in the bits of each lane.
    #[inline(always)]
    pub(crate) fn from_lanes(places: V, bits: u32) -> Self {
        let (value, place) = G::at(places, bits);
        Self { value, place }
    }

    /// The integers in the bits of each lane, and a finite number where they are on the grid.
    #[inline(always)]
    pub(crate) fn lanes(self) -> (V, V)
    where
        V: Copy,
    {
        (self.place.places(self.value), self.place.is_on_grid())
    }

    /// A number between two increments.
    #[inline(always)]
    fn between(value: V) -> Self {
        Self { value, place: G::none() }
    }

    // Loops: `map` of an array is a function that is compiled for any processor.
    #[inline(always)]
    fn values<const K: usize>(x: [Self; K]) -> [V; K]
    where
        V: Scalar,
    {
        let mut values = [V::zero(); K];
        for k in 0..K {
            values[k] = x[k].value;
        }
        values
    }

    #[inline(always)]
    fn all_between<const K: usize>(values: [V; K]) -> [Self; K]
    where
        V: Scalar,
    {
        let mut out = [Self::between(V::zero()); K];
        for k in 0..K {
            out[k] = Self::between(values[k]);
        }
        out
    }
}

macro_rules! between {
    ($($trait:ident, $method:ident;)*) => {
        $(impl<V: Lanewise, G: GridPlace<V>> $trait for OnGrid<V, G> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self::between(self.value.$method(other.value))
            }
        })*
    };
}
between! { Add, add; Sub, sub; Mul, mul; Div, div; }

impl<V: Lanewise, G: GridPlace<V>> Neg for OnGrid<V, G> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let (value, place) = self.place.negated(self.value);
        Self { value, place }
    }
}

assigning!([V: Lanewise, G: GridPlace<V>] OnGrid<V, G>);

impl<V: Lanewise, G: GridPlace<V>> Scalar for OnGrid<V, G> {
    const SPECIALISED: bool = V::SPECIALISED;

    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self::between(V::from_f64(value))
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self::between(self.value.mul_add(a.value, b.value))
    }
    #[inline(always)]
    fn tanh_sech2(self) -> (Self, Self) {
        let (t, s) = self.value.tanh_sech2();
        (Self::between(t), Self::between(s))
    }
    #[inline(always)]
    fn tanh_sech2_each<const K: usize>(x: [Self; K]) -> ([Self; K], [Self; K]) {
        let (t, s) = V::tanh_sech2_each(Self::values(x));
        (Self::all_between(t), Self::all_between(s))
    }
    #[inline(always)]
    fn lorentzian(self) -> (Self, Self) {
        let (t, s) = self.value.lorentzian();
        (Self::between(t), Self::between(s))
    }
    #[inline(always)]
    fn lorentzian_each<const K: usize>(x: [Self; K]) -> ([Self; K], [Self; K]) {
        let (t, s) = V::lorentzian_each(Self::values(x));
        (Self::all_between(t), Self::all_between(s))
    }
    #[inline(always)]
    fn outlined(task: impl Task) {
        V::outlined(task);
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self::between(self.value.abs())
    }
    #[inline(always)]
    fn is_zero(self) -> bool {
        self.value.is_zero()
    }
    fn unit_roundoff() -> f64 {
        V::unit_roundoff()
    }
}

impl<V: Lanewise, G: GridPlace<V>> Elementary for OnGrid<V, G> {
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.value.sin_cos();
        (Self::between(s), Self::between(c))
    }
    #[inline(always)]
    fn exp(self) -> Self {
        Self::between(self.value.exp())
    }
    #[inline(always)]
    fn zero_with(self, factor: Self) -> Self {
        Self::between(self.value.zero_with(factor.value))
    }
    #[inline(always)]
    fn sign(self) -> Self {
        Self::between(self.value.sign())
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::between(self.value.sqrt())
    }
    #[inline(always)]
    fn ln(self) -> Self {
        Self::between(self.value.ln())
    }
    #[inline(always)]
    fn powf(self, exponent: f64) -> Self {
        Self::between(self.value.powf(exponent))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        Self::between(self.value.atan2(x.value))
    }
    #[inline(always)]
    fn rem_euclid(self, period: f64) -> Self {
        Self::between(self.value.rem_euclid(period))
    }
}

impl<V: Lanewise + Over<f64>, G: GridPlace<V>> Over<f64> for OnGrid<V, G> {
    #[inline(always)]
    fn embed(parameter: f64) -> Self {
        Self::between(V::embed(parameter))
    }
    #[inline(always)]
    fn mul_add_parameter(self, parameter: f64, addend: Self) -> Self {
        Self::between(self.value.mul_add_parameter(parameter, addend.value))
    }
    /// The product is rounded to an `f64`, and that to the grid.
    #[inline(always)]
    fn increment(self, factor: f64, direction: Self) -> Self {
        let (value, place) = self.place.moved(self.value, direction.value.times(factor));
        Self { value, place }
    }
    #[inline(always)]
    fn series_each<const K: usize>(s: [Self; K], series: Series<'_, f64>) -> [Self; K] {
        Self::all_between(V::series_each(Self::values(s), series))
    }
}

impl<G: GridPlace<f64>> Real for OnGrid<f64, G> {
    fn value(self) -> f64 {
        self.value
    }
}
