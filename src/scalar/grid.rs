//! Grids: increments are rounded to grid points, so that a step can be inverted bit for bit.

use super::Task;
use super::lanewise::Lanewise;
use crate::error::Error;
use std::fmt::Debug;

/// The grid of coordinates k·2⁻ᴮ with integer k, on which compositions of shears are exact bijections.
///
/// Every shear x += g(y) becomes x += R(g(y)), where R rounds to the grid, halves to the even point.
/// Since R is odd, R(−v) = −R(v), and y does not change, x −= R(g(y)) inverts the shear exactly, for
/// any g and any rounding errors in it. Rounding the result instead of the increment would not work:
/// R(x + g(y)) maps several x to one.
///
/// Source: Levesque and Verlet, Journal of Statistical Physics 72 (1993), page 519; Earn and Tremaine, Physica D 56
/// (1992), page 1; Rein and Tamayo, <https://arxiv.org/abs/1704.07715>.
///
/// ```
/// use gyroceptron::scalar::{Grid, GridNumbers};
///
/// let grid = Grid::new(44, GridNumbers::Integers)?;
/// let places = grid.quantise(&[0.1, -3.0])?;
/// assert_eq!(places[1], -3 << 44);
/// // What is lost is half a step of the grid at most.
/// assert!((grid.value(places[0]) - 0.1).abs() <= grid.rounding());
/// # Ok::<(), gyroceptron::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    bits: u32,
    numbers: GridNumbers,
}

/// The number type that stores the places of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GridNumbers {
    /// 64-bit integers, which wrap: coordinates are on a circle of length 2⁶⁴⁻ᴮ, and no orbit leaves it.
    Integers,
    /// `f64` that stay on the grid, which is faster. An orbit that leaves |x| < 2⁵¹⁻ᴮ ends there,
    /// and this is reported.
    Floats,
}

impl GridNumbers {
    /// Both number types of a grid.
    pub const ALL: [Self; 2] = [Self::Integers, Self::Floats];

    /// The largest number B of fractional bits.
    pub const fn most_bits(self) -> u32 {
        match self {
            Self::Integers => 62,
            Self::Floats => 50,
        }
    }

    /// The bits of a place, one of them its sign.
    const fn width(self) -> u32 {
        match self {
            Self::Integers => 64,
            Self::Floats => 52,
        }
    }

    /// The name of the number type in options.
    pub fn name(self) -> &'static str {
        match self {
            Self::Integers => "integers",
            Self::Floats => "floats",
        }
    }
}

impl Grid {
    /// The grid with this many fractional bits.
    ///
    /// # Errors
    /// When there are more than [`GridNumbers::most_bits`].
    pub fn new(bits: u32, numbers: GridNumbers) -> Result<Self, Error> {
        let name = format!("bits behind the point of a grid of {}", numbers.name());
        Error::check_count_range(&name, bits as usize, 0, numbers.most_bits() as usize)?;
        Ok(Self { bits, numbers })
    }

    /// The number B of binary places of the grid.
    pub fn bits(self) -> u32 {
        self.bits
    }

    /// The number type that stores its places.
    pub fn numbers(self) -> GridNumbers {
        self.numbers
    }

    /// The distance 2⁻ᴮ between neighbouring points.
    pub fn spacing(self) -> f64 {
        power_of_two(-(self.bits as i32))
    }

    /// The largest rounding error of a component of a point: half the spacing.
    pub fn rounding(self) -> f64 {
        0.5 * self.spacing()
    }

    /// The largest coordinate that it can represent; integers wrap beyond it.
    pub fn limit(self) -> f64 {
        power_of_two(self.numbers.width() as i32 - 1 - self.bits as i32)
    }

    /// The places nearest to these coordinates, with halves rounded to even.
    ///
    /// # Errors
    /// When a coordinate is not below [`Grid::limit`] in size, or NaN.
    pub fn quantise(self, values: &[f64]) -> Result<Vec<i64>, Error> {
        let (limit, scale) = (self.limit(), power_of_two(self.bits as i32));
        let place = |&value: &f64| {
            let units = (value * scale).round_ties_even();
            if !(units.abs() < limit * scale) {
                let expected = format!(
                    "a coordinate below {limit} in magnitude, which is what a grid of {} with {} bits behind the \
                     point holds",
                    self.numbers.name(),
                    self.bits
                );
                return Err(Error::invalid("point on a grid", value, expected));
            }
            Ok(units as i64)
        };
        values.iter().map(place).collect()
    }

    /// The coordinate of a place: k·2⁻ᴮ, rounded to `f64` where k has more than 53 bits.
    pub fn value(self, place: i64) -> f64 {
        place as f64 * self.spacing()
    }
}

/// 2ᵏ of a normal number.
const fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

/// 1.5·2⁵²⁻ᴮ: added to a number below 2⁵¹⁻ᴮ it rounds it to the grid, and its lowest bits are the
/// place.
const fn magic(bits: u32) -> f64 {
    1.5 * power_of_two(52 - bits as i32)
}

/// Of the magic number, a little less than 2⁵¹⁻ᴮ.
const NEAR: f64 = 0.333;

/// The magic number of what is on no grid. That of [`Integers`] has the other sign, so that it is near nothing.
const NONE: f64 = f64::INFINITY;

/// The place of a number on its grid.
///
/// It accompanies the number itself, `value`: computations use the value, and changes of a coordinate
/// are made to the place.
pub trait GridPlace<V>: Copy + Debug + Send + Sync + 'static {
    /// The place of a number that is on no grid: an intermediate result between two increments.
    fn none() -> Self;

    /// The values and places of integers, one in the bits of each lane, on the grid of so many bits
    /// behind the point.
    fn at(places: V, bits: u32) -> (V, Self);

    /// The integers, in the bits of each lane. They mean nothing where the number is on no grid.
    fn places(self, value: V) -> V;

    /// A finite number in each lane that is on the grid, NaN in a lane that has left the range of the grid or is
    /// not finite, and ±∞ in a lane that was changed by something other than increments.
    fn is_on_grid(self) -> V;

    /// The number plus the grid point nearest to `by`, which is an odd function of `by`.
    fn moved(self, value: V, by: V) -> (V, Self);

    /// The number with the other sign.
    fn negated(self, value: V) -> (V, Self);
}

/// Arithmetic on places of a grid that are integers, [`GridNumbers::Integers`]. With `W` < 64 bits they wrap at 2ᵂ:
/// such grids are small enough to test all points.
#[derive(Clone, Copy, Debug)]
pub struct Integers<V, const W: u32 = 64> {
    places: V,
    magic: V,
}

/// Reduces an integer to so many bits, one of them its sign.
#[inline(always)]
fn wrapped<const W: u32>(place: i64) -> i64 {
    const { assert!(W > 0 && W <= 64) };
    (place << (64 - W)) >> (64 - W)
}

/// R(v)·2ᴮ modulo 2⁶⁴ of a finite v, the magic number saying what B is.
fn whole_steps(by: f64, magic: f64) -> i64 {
    let bits = 1075 - (magic.to_bits() >> 52 & 0x7ff) as i32;
    let fraction = (by.to_bits() & ((1 << 52) - 1)) as i64;
    let exponent = (by.to_bits() >> 52 & 0x7ff) as i32;
    // by = ±mantissa·2^exponent.
    let (mantissa, exponent) = match exponent {
        0 => (fraction, -1074),
        _ => (fraction | 1 << 52, exponent - 1075),
    };
    let magnitude = match exponent + bits {
        64.. => 0,
        shift @ 0..64 => mantissa.wrapping_shl(shift as u32),
        _ => (by.abs() * power_of_two(bits)).round_ties_even() as i64,
    };
    if by.is_sign_negative() { magnitude.wrapping_neg() } else { magnitude }
}

/// The coordinate of a place, the magic number saying what B is.
#[inline(always)]
fn value_of(place: i64, magic: f64) -> f64 {
    // An exact quotient.
    place as f64 * (magic / 1.5 * power_of_two(-52))
}

impl<V: Lanewise, const W: u32> Integers<V, W> {
    /// Whether each lane is on the grid, and a magnitude in it far from 2⁵¹⁻ᴮ.
    #[inline(always)]
    fn is_near(self, magnitude: V) -> bool {
        self.magic.mul_add(V::from_f64(-NEAR), magnitude).all_negative()
    }

    /// From places that are not known to be small.
    #[inline(always)]
    fn any(places: V, magic: V) -> (V, Self) {
        let wrap = |place: f64, _| f64::from_bits(wrapped::<W>(place.to_bits() as i64) as u64);
        let places = if const { W < 64 } { places.pair_by_pair(places, wrap) } else { places };
        let value = |place: f64, magic| value_of(place.to_bits() as i64, magic);
        (places.pair_by_pair(magic, value), Self { places, magic })
    }
}

/// An increment, or a change of sign, that may wrap, or of a number on no grid: rare, and not to be compiled
/// into each step.
struct Far<'a, V, const W: u32> {
    value: V,
    from: Integers<V, W>,
    by: Option<V>,
    out: &'a mut (V, Integers<V, W>),
}

impl<V: Lanewise, const W: u32> Task for Far<'_, V, W> {
    #[inline(always)]
    fn run(self) {
        let Integers { places, magic } = self.from;
        let (plain, places, magic) = match self.by {
            None => (V::zero() - self.value, V::zero().minus_bits(places), magic),
            Some(by) => {
                let steps = by.pair_by_pair(magic, |by, magic| {
                    let on_grid = by.is_finite() && magic.is_finite();
                    f64::from_bits(if on_grid { whole_steps(by, magic) } else { 0 } as u64)
                });
                // What is not finite has left the grid. What was never on one is still on none.
                let magic = by.pair_by_pair(magic, |by, magic| {
                    let stays = by.is_finite() || magic == -NONE;
                    if stays { magic } else { f64::NAN }
                });
                (self.value + by, places.plus_bits(steps), magic)
            }
        };
        let (value, place) = Integers::any(places, magic);
        *self.out = ((-magic).select_above(f64::MAX, plain, value), place);
    }
}

impl<V: Lanewise, const W: u32> GridPlace<V> for Integers<V, W> {
    #[inline(always)]
    fn none() -> Self {
        Self { places: V::zero(), magic: V::from_f64(-NONE) }
    }

    #[inline(always)]
    fn at(places: V, bits: u32) -> (V, Self) {
        Self::any(places, V::from_f64(magic(bits)))
    }

    #[inline(always)]
    fn places(self, _: V) -> V {
        self.places
    }

    #[inline(always)]
    fn is_on_grid(self) -> V {
        self.magic
    }

    #[inline(always)]
    fn moved(self, value: V, by: V) -> (V, Self) {
        // A NaN is not known to be near, and what is on no grid is not either.
        if W < 64 || !self.is_near(by.abs() + value.abs()) {
            let mut out = (value, self);
            V::outlined(Far { value, from: self, by: Some(by), out: &mut out });
            return out;
        }
        let steps = (by + self.magic).minus_bits(self.magic);
        let places = self.places.plus_bits(steps);
        (places.plus_bits(self.magic) - self.magic, Self { places, ..self })
    }

    #[inline(always)]
    fn negated(self, value: V) -> (V, Self) {
        if W < 64 || !self.is_near(value.abs()) {
            let mut out = (value, self);
            V::outlined(Far { value, from: self, by: None, out: &mut out });
            return out;
        }
        // 0 has one sign: the number is a function of the place.
        (V::zero() - value, Self { places: V::zero().minus_bits(self.places), ..self })
    }
}

/// The place of a number on a grid for [`GridNumbers::Floats`], where the value itself is the place.
#[derive(Clone, Copy, Debug)]
pub struct Floats<V> {
    magic: V,
}

impl<V: Lanewise> Floats<V> {
    /// The magic number, NaN where this is not below 2⁵¹⁻ᴮ, a third of it: the sign is exact.
    #[inline(always)]
    fn within(self, number: V) -> V {
        let room = number.abs().mul_add(V::from_f64(-3.0), self.magic);
        room.select_above(0.0, self.magic, V::from_f64(f64::NAN))
    }
}

impl<V: Lanewise> GridPlace<V> for Floats<V> {
    #[inline(always)]
    fn none() -> Self {
        Self { magic: V::from_f64(NONE) }
    }

    #[inline(always)]
    fn at(places: V, bits: u32) -> (V, Self) {
        let magic = V::from_f64(magic(bits));
        let within = places.pair_by_pair(magic, |place, magic| {
            let is_held = (place.to_bits() as i64).unsigned_abs() < 1 << 51;
            if is_held { magic } else { f64::NAN }
        });
        (places.plus_bits(magic) - magic, Self { magic: within })
    }

    #[inline(always)]
    fn places(self, value: V) -> V {
        (value + self.magic).minus_bits(self.magic)
    }

    #[inline(always)]
    fn is_on_grid(self) -> V {
        self.magic
    }

    /// Of the increment and of the result, so that what was in range there is so on the way back.
    #[inline(always)]
    fn moved(self, value: V, by: V) -> (V, Self) {
        let rounded = (by + self.magic) - self.magic;
        let out = value + self.magic.select_above(f64::MAX, by, rounded);
        let magic = Self { magic: self.within(by) }.within(out);
        (out, Self { magic })
    }

    #[inline(always)]
    fn negated(self, value: V) -> (V, Self) {
        (V::zero() - value, self)
    }
}
