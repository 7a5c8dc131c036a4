//! The number layer against independent arithmetic.

use astro_float::{BigFloat, Consts, RoundingMode};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{
    DoubleDouble, Dual, Elementary, Lanes, Real, Scalar, Tracked, WIDTH, max_or_nan, tanh_sech2,
};

const BITS: usize = 320;
const TO_NEAREST: RoundingMode = RoundingMode::ToEven;

fn to_f64(value: &BigFloat) -> f64 {
    if value.is_zero() { 0.0 } else { value.to_string().parse().expect("a decimal number") }
}

#[test]
fn tanh_at_the_ends_of_the_range() {
    for x in [0.0, -0.0] {
        let (t, s) = tanh_sech2(x);
        assert_eq!((t.to_bits(), s), (x.to_bits(), 1.0));
    }
    for x in [400.0, 1e300, f64::INFINITY] {
        assert_eq!(tanh_sech2(x), (1.0, 0.0));
        assert_eq!(tanh_sech2(-x), (-1.0, 0.0));
    }
    let (t, s) = tanh_sech2(f64::NAN);
    assert!(t.is_nan() && s.is_nan());
    // The last value that is not taken for zero.
    let (_, s) = tanh_sech2(354.0);
    let exact = 4.0 * libm::exp(-708.0);
    assert!((s - exact).abs() <= 4e-16 * exact, "{s:e} for {exact:e}");
    assert_eq!(tanh_sech2(354.0_f64.next_up()), (1.0, 0.0));
}

#[test]
fn lanes_are_the_scalar_bit_for_bit() {
    let mut stream = Stream::new(1, "lanes");
    for _ in 0..200 {
        let a: [f64; WIDTH] = std::array::from_fn(|_| stream.uniform(-20.0, 20.0));
        let b: [f64; WIDTH] = std::array::from_fn(|_| stream.uniform(-1e3, 1e3));
        let (t, s) = Lanes(a).tanh_sech2();
        let fused = Lanes(a).mul_add(Lanes(b), Lanes(b));
        for k in 0..WIDTH {
            let (tk, sk) = tanh_sech2(a[k]);
            assert_eq!(t.0[k].to_bits(), tk.to_bits());
            assert_eq!(s.0[k].to_bits(), sk.to_bits());
            assert_eq!(fused.0[k].to_bits(), a[k].mul_add(b[k], b[k]).to_bits());
        }
    }
}

/// A function that uses every operation of the number layer.
fn everything<S: Elementary>(x: S, y: S) -> S {
    let (s, c) = (x * y).sin_cos();
    let (t, h) = (x + y).tanh_sech2();
    let quotient = (x - y) / (S::from_f64(2.0) + c * c);
    (t.mul_add(s, h) * (-quotient).exp()).mul_add(x, y)
}

#[test]
fn duals_agree_with_two_other_implementations() {
    let mut stream = Stream::new(2, "duals");
    for _ in 0..200 {
        let (x, y) = (stream.uniform(-1.5, 1.5), stream.uniform(-1.5, 1.5));
        let ours = everything(Dual::<f64, 2>::variable(x, 0), Dual::variable(y, 1));
        let with_num_dual = {
            use num_dual::{Dual64, DualNum};
            let f = |x: Dual64, y: Dual64| {
                let (s, c) = (x * y).sin_cos();
                let t = (x + y).tanh();
                let h = (x + y).cosh().powi(-2);
                let quotient = (x - y) / (c * c + 2.0);
                (t * s + h) * (-quotient).exp() * x + y
            };
            let constant = |v: f64| Dual64::from_re(v);
            let variable = |v: f64| Dual64::from_re(v).derivative();
            let dx = f(variable(x), constant(y));
            let dy = f(constant(x), variable(y));
            [dx.re, dx.eps, dy.eps]
        };
        let with_dual_num = {
            use dual_num::{Dual, Float};
            let f = |x: Dual<f64>, y: Dual<f64>| {
                let (s, c) = ((x * y).sin(), (x * y).cos());
                let t = (x + y).tanh();
                let h = (x + y).cosh().powi(-2);
                let quotient = (x - y) / (c * c + 2.0);
                (t * s + h) * (-quotient).exp() * x + y
            };
            let dx = f(Dual::new(x, 1.0), Dual::from_real(y));
            let dy = f(Dual::from_real(x), Dual::new(y, 1.0));
            [dx.real(), dx.dual(), dy.dual()]
        };
        let bound = everything(
            Dual::<Tracked, 2>::variable(Tracked::exact(x), 0),
            Dual::variable(Tracked::exact(y), 1),
        );
        let ours = [ours.re, ours.eps[0], ours.eps[1]];
        let bounds = [bound.re, bound.eps[0], bound.eps[1]];
        for k in 0..3 {
            for other in [with_num_dual[k], with_dual_num[k]] {
                let ratio = (ours[k] - other).abs() / bounds[k].error();
                // The other evaluation is as long as ours: twice the bound.
                assert!(ratio <= 2.0, "component {k} at ({x}, {y}): {ratio}");
            }
        }
    }
}

#[test]
fn the_tracked_bound_holds_against_multiprecision() {
    // Σ of products with cancellation, exact in 320 bits.
    let mut stream = Stream::new(3, "tracked");
    let mut largest = 0.0_f64;
    for _ in 0..200 {
        let terms: Vec<(f64, f64)> =
            (0..20).map(|_| (stream.uniform(-1.0, 1.0), stream.uniform(-1e3, 1e3))).collect();
        let mut tracked = Tracked::exact(0.0);
        let mut exact = BigFloat::from_f64(0.0, BITS);
        for &(a, b) in &terms {
            tracked = tracked + Tracked::exact(a) * Tracked::exact(b);
            let product =
                BigFloat::from_f64(a, BITS).mul(&BigFloat::from_f64(b, BITS), BITS, TO_NEAREST);
            exact = exact.add(&product, BITS, TO_NEAREST);
        }
        let difference = BigFloat::from_f64(tracked.value, BITS).sub(&exact, BITS, TO_NEAREST);
        let ratio = to_f64(&difference).abs() / tracked.error();
        assert!(ratio <= 1.0, "{ratio}");
        largest = max_or_nan(largest, ratio);
    }
    assert!(largest > 0.02, "the bound is vacuous: {largest}");
}

fn big(value: DoubleDouble) -> BigFloat {
    let (high, low) = value.parts();
    BigFloat::from_f64(high, BITS).add(&BigFloat::from_f64(low, BITS), BITS, TO_NEAREST)
}

/// |computed − exact| in units of 2⁻¹⁰⁶·(the larger of |exact| and `scale`).
fn units(computed: DoubleDouble, exact: &BigFloat, scale: f64) -> f64 {
    let difference = to_f64(&big(computed).sub(exact, BITS, TO_NEAREST));
    difference.abs() / (to_f64(exact).abs().max(scale) * DoubleDouble::unit_roundoff())
}

#[test]
fn double_doubles_agree_with_multiprecision() {
    let mut constants = Consts::new().expect("memory for constants");
    let mut stream = Stream::new(0, "double-double");
    let mut draw = |scale: f64| {
        let high = stream.uniform(-scale, scale);
        DoubleDouble::new(high, high * stream.uniform(-1e-16, 1e-16))
    };
    let mut worst = [0.0; 9];
    let one = BigFloat::from_f64(1.0, BITS);
    for index in 0..400 {
        let scale = [1e-12, 1e-3, 0.5, 1.0, 10.0, 60.0][index % 6];
        let (x, y) = (draw(scale), draw(2.0));
        let (a, b) = (big(x), big(y));
        let (t, s) = x.tanh_sech2();
        let cosh = a.cosh(BITS, TO_NEAREST, &mut constants);
        let sech2 = one.div(&cosh.mul(&cosh, BITS, TO_NEAREST), BITS, TO_NEAREST);
        let (sin, cos) = x.sin_cos();
        let product = a.mul(&b, BITS, TO_NEAREST);
        // Angles carry the rounding of their reduction.
        let angle = x.value().abs();
        let found = [
            units(t, &a.tanh(BITS, TO_NEAREST, &mut constants), 0.0),
            units(s, &sech2, 0.0),
            units(x.exp(), &a.exp(BITS, TO_NEAREST, &mut constants), 0.0),
            units(sin, &a.sin(BITS, TO_NEAREST, &mut constants), angle),
            units(cos, &a.cos(BITS, TO_NEAREST, &mut constants), angle),
            units(x + y, &a.add(&b, BITS, TO_NEAREST), 0.0),
            units(x * y, &product, 0.0),
            units(x / y, &a.div(&b, BITS, TO_NEAREST), 0.0),
            units(x.mul_add(y, x), &product.add(&a, BITS, TO_NEAREST), scale),
        ];
        for (worst, found) in worst.iter_mut().zip(found) {
            *worst = max_or_nan(*worst, found);
        }
    }
    println!("largest errors in 2⁻¹⁰⁶: tanh, sech², exp, sin, cos, +, ·, /, fma {worst:.2?}");
    assert!(worst.iter().all(|e| *e < 6.0), "{worst:?}");
    // Rounding shows: a single double would err by 2⁵³ of these units.
    assert!(worst.iter().all(|e| *e > 0.1), "{worst:?}");
    let zero = DoubleDouble::from_f64(-0.0);
    assert!(zero.tanh().value().is_sign_negative() && zero.sech2().value() == 1.0);
    let nan = DoubleDouble::from_f64(f64::NAN);
    assert!(nan.tanh().value().is_nan() && nan.sech2().value().is_nan());
    for x in [40.0, 300.0, 800.0, f64::INFINITY] {
        assert_eq!(DoubleDouble::from_f64(-x).tanh().value(), -1.0);
        assert!((0.0..1e-15).contains(&DoubleDouble::from_f64(x).sech2().value()));
    }
}
