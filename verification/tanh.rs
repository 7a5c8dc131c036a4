//! tanh and sech², and the slope of arctan, against multiprecision: the one thing that no structural law
//! can see, since any diagonal will do for them.

use crate::tolerances;
use astro_float::{BigFloat, Consts, RoundingMode};
use gyroceptron::measure::{
    certificate::{Row, Tally},
    ratios::Conditioned,
};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Scalar, max_or_nan, tanh_sech2};
use std::sync::OnceLock;

pub const STATED: usize = 2500;
const BITS: usize = 320;
const TO_NEAREST: RoundingMode = RoundingMode::ToEven;

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| {
        rows_of(tanh_sech2).into_iter().chain(rows_of_arctan(f64::lorentzian)).collect()
    })
}

/// x/(1 + x²) and 1/(1 + x²), relative.
pub fn rows_of_arctan(kernel: fn(f64) -> (f64, f64)) -> Vec<Row> {
    let limit = |law, limit| Tally::with_limit("elementary functions", law, limit);
    let mut odd = limit("x/(1 + x²), relative", tolerances::ODD_LORENTZIAN);
    let mut even = limit("1/(1 + x²), relative", tolerances::LORENTZIAN);
    for (t, s) in errors_of_arctan(kernel) {
        odd.push(Conditioned::Ratio(t));
        even.push(Conditioned::Ratio(s));
    }
    vec![odd.row(), even.row()]
}

pub fn errors_of_arctan(kernel: fn(f64) -> (f64, f64)) -> Vec<(f64, f64)> {
    let one = BigFloat::from_f64(1.0, BITS);
    let each = points().into_iter().map(|x| {
        let big = BigFloat::from_f64(x, BITS);
        let square = big.mul(&big, BITS, TO_NEAREST);
        let slope = one.div(&square.add(&one, BITS, TO_NEAREST), BITS, TO_NEAREST);
        let odd = big.mul(&slope, BITS, TO_NEAREST);
        let (t, s) = kernel(x);
        let off = |computed: f64, exact: &BigFloat| {
            let error = BigFloat::from_f64(computed, BITS).sub(exact, BITS, TO_NEAREST);
            (to_f64(&error) / to_f64(exact)).abs()
        };
        (off(t, &odd), off(s, &slope))
    });
    each.collect()
}

/// 1/(1 + x²) with a last step that leaves e³ of its error in place of e⁴: right to 2.7e-16, where the guess is worst.
pub fn by_cubic_step(x: f64) -> (f64, f64) {
    let d = x.mul_add(x, 1.0);
    let guess = f64::from_bits(0x7FDE_6238_DA3C_2118 - d.to_bits());
    let e = (-d).mul_add(guess, 1.0);
    let nearer = guess.mul_add(e, guess);
    let r = nearer.mul_add(e * e, nearer);
    let e = (-d).mul_add(r, 1.0);
    let s = r.mul_add(e.mul_add(e, e), r);
    (x * s, s)
}

/// tanh in units in the last place, sech² relative.
pub fn rows_of(kernel: fn(f64) -> (f64, f64)) -> Vec<Row> {
    let limit = |law, limit| Tally::with_limit("elementary functions", law, limit);
    let mut tanh = limit("tanh, in ulp", tolerances::TANH_ULPS);
    let mut sech2 = limit("sech², relative", tolerances::SECH2);
    for (t, s) in errors(kernel) {
        tanh.push(Conditioned::Ratio(t));
        sech2.push(Conditioned::Ratio(s));
    }
    vec![tanh.row(), sech2.row()]
}

pub fn worst(kernel: fn(f64) -> (f64, f64)) -> (f64, f64) {
    errors(kernel)
        .into_iter()
        .fold((0.0, 0.0), |(a, b), (t, s)| (max_or_nan(a, t), max_or_nan(b, s)))
}

/// 1 − tanh² for sech²: no digit is left where tanh is 1.
pub fn by_difference(x: f64) -> (f64, f64) {
    let t = libm::tanh(x);
    (t, 1.0 - t * t)
}

/// Below, tanh is taken from the library: the formula would cancel.
const SMALL: f64 = 0.1;

/// (1 − E)/(1 + E) without the rest of the exponential's argument.
pub fn by_exponentials(x: f64) -> (f64, f64) {
    let e = libm::exp(-2.0 * x.abs());
    let t = if x.abs() < SMALL { libm::tanh(x) } else { ((1.0 - e) / (1.0 + e)).copysign(x) };
    (t, 4.0 * e / ((1.0 + e) * (1.0 + e)))
}

fn to_f64(value: &BigFloat) -> f64 {
    if value.is_zero() { 0.0 } else { value.to_string().parse().expect("a decimal number") }
}

fn points() -> Vec<f64> {
    let mut stream = Stream::new(crate::suite::SEED, "tanh");
    let times = crate::suite::times();
    let mut out: Vec<f64> = (0..1200 * times).map(|_| stream.uniform(-4.0, 4.0)).collect();
    out.extend((0..800 * times).map(|_| stream.uniform(-354.0, 354.0)));
    out.extend((0..500 * times).map(|_| stream.uniform(17.5, 20.0)));
    // Where the largest errors are: of tanh where it is just above a power of two
    // and of cancelled digits, of sech² where 1 + E is rounded most.
    out.extend((0..1000).map(|k| 0.18 + f64::from(k) * 1e-4));
    out.extend((0..1000).map(|k| 8.2 + f64::from(k) * 5e-4));
    // Every binade, and the edges of the argument reduction.
    out.extend((-40..7).map(|e| libm::exp2(f64::from(e)) * stream.uniform(1.0, 2.0)));
    for k in 1..60 {
        let edge = (f64::from(k) - 0.5) * std::f64::consts::LN_2 / 2.0;
        out.extend([edge - 1e-15, edge, edge + 1e-15]);
    }
    // Where a search by double-double found the largest errors.
    out.extend([0.125_484_579_156_592_6, 0.203_873_823_297_979_76]);
    out.extend([5.877_118_771_964_012, 8.313_871_866_852_022]);
    out.extend([8.0, 16.0, 19.0, 19.1, 100.0, 354.0, 1e-300, 5e-324, 1e-8]);
    out
}

fn errors(kernel: fn(f64) -> (f64, f64)) -> Vec<(f64, f64)> {
    let mut constants = Consts::new().expect("memory for constants");
    let one = BigFloat::from_f64(1.0, BITS);
    let each = points().into_iter().map(|x| {
        let big = BigFloat::from_f64(x, BITS);
        let tanh = big.tanh(BITS, TO_NEAREST, &mut constants);
        let cosh = big.cosh(BITS, TO_NEAREST, &mut constants);
        let sech2 = one.div(&cosh.mul(&cosh, BITS, TO_NEAREST), BITS, TO_NEAREST);
        let (t, s) = kernel(x);
        let error = |computed: f64, exact: &BigFloat| {
            to_f64(&BigFloat::from_f64(computed, BITS).sub(exact, BITS, TO_NEAREST)).abs()
        };
        let exact = to_f64(&tanh).abs();
        // The spacing below, which at a power of two is the smaller one.
        let ulp = exact - f64::from_bits(exact.to_bits().saturating_sub(1));
        (error(t, &tanh) / ulp, error(s, &sech2) / to_f64(&sech2))
    });
    each.collect()
}

#[test]
fn holds() {
    crate::suite::assert_holds(rows(), STATED);
}
