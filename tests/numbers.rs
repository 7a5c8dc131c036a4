//! The number layer against independent arithmetic.

use astro_float::{BigFloat, Consts, RoundingMode};
use gyroceptron::flow::{
    GaussLegendre, GaussLegendreSettings, Integrator, Splitting, runge_kutta_4,
};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{
    DoubleDouble, Dual, Elementary, Lanes, Real, Scalar, Simd, Tracked, WIDTH, max_or_nan,
    tanh_sech2,
};
use gyroceptron::system::{
    CellularDrift, FieldLines, FullOrbit, Hamiltonian, Oscillators, ParticleField, System,
    ThreeOscillators, VanDerPol,
};
use std::f64::consts::TAU;

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
    assert!((s - exact).abs() <= 5e-16 * exact, "{s:e} for {exact:e}");
    assert!(tanh_sech2(354.37).1 > 0.0);
    assert_eq!(tanh_sech2(354.38), (1.0, 0.0));
}

/// What is exact by construction: the sign, tanh x = x for small x, and that tanh
/// never leaves [−1, 1] nor falls from the last digits on.
#[test]
fn tanh_is_odd_bounded_and_saturates_once() {
    let mut stream = Stream::new(7, "odd");
    for k in 0..4000 {
        let x = stream.uniform(0.0, [1e-3, 1.0, 20.0, 400.0][k % 4]);
        let (t, s) = tanh_sech2(x);
        assert_eq!(tanh_sech2(-x), (-t, s), "{x}");
        assert!((0.0..=1.0).contains(&t) && (0.0..=1.0).contains(&s), "{x}: {t} {s}");
    }
    for x in [5e-324, 1e-310, 2.3e-308, 1e-300, 1e-100, 1e-20, 1e-17] {
        assert_eq!(tanh_sech2(x), (x, 1.0));
    }
    // 1 − tanh is 2E: from 2⁻⁵⁴ on it is 0, and before it falls.
    let mut last = 0.0;
    for k in 0..20_000 {
        let t = tanh_sech2(17.0 + f64::from(k) * 2e-4).0;
        assert!(t >= last, "tanh falls at step {k}");
        last = t;
    }
    assert_eq!(last, 1.0);
}

/// |computed − exact| in units of the last place of the exact number.
fn ulps(computed: f64, exact: &BigFloat) -> f64 {
    let difference = BigFloat::from_f64(computed, BITS).sub(exact, BITS, TO_NEAREST);
    let size = to_f64(exact).abs();
    to_f64(&difference).abs() / (size.next_up() - size)
}

/// Arguments of all sizes, where quadrants and powers of two meet, and next to the
/// zeros of sine and cosine, where the reduction loses the most digits.
fn arguments() -> Vec<f64> {
    let mut stream = Stream::new(8, "arguments");
    let mut out = Vec::new();
    for k in 0..6000 {
        let scale = [1e-3, 1.0, 10.0, 700.0, 1e5, 1e9][k % 6];
        out.push(stream.uniform(-scale, scale));
    }
    for k in 0..600 {
        let multiple = if k < 300 { f64::from(k) } else { stream.uniform(0.0, 6e8).round() };
        let x = multiple * std::f64::consts::FRAC_PI_4;
        out.extend([x, x.next_up(), -x]);
        out.push((f64::from(k) - 0.5) * std::f64::consts::LN_2);
    }
    out.extend([5e-324, 1e-300, 1e-8, 1_073_741_824.0, 1e12, 1e300, -1e17]);
    out
}

#[test]
fn sine_cosine_and_exponential_agree_with_multiprecision() {
    // Enough to reduce 1e300.
    const WIDE: usize = 1500;
    let mut constants = Consts::new().expect("memory for constants");
    let mut worst = [0.0; 3];
    for x in arguments() {
        let (sin, cos) = Elementary::sin_cos(x);
        let wide = BigFloat::from_f64(x, WIDE);
        let mut found = [
            ulps(sin, &wide.sin(WIDE, TO_NEAREST, &mut constants)),
            ulps(cos, &wide.cos(WIDE, TO_NEAREST, &mut constants)),
            0.0,
        ];
        if x.abs() < 708.0 {
            let exact = BigFloat::from_f64(x, BITS).exp(BITS, TO_NEAREST, &mut constants);
            found[2] = ulps(Elementary::exp(x), &exact);
        }
        for (worst, found) in worst.iter_mut().zip(found) {
            *worst = max_or_nan(*worst, found);
        }
    }
    println!("largest errors in ulp: sin, cos, exp {worst:.3?}");
    assert!(worst.iter().all(|e| *e <= 2.0), "{worst:?}");
    // The oracle is not the kernel.
    assert!(worst.iter().all(|e| *e > 0.5), "{worst:?}");
}

/// atan2(y, x) in multiprecision.
fn big_atan2(y: &BigFloat, x: &BigFloat, constants: &mut Consts) -> BigFloat {
    let angle = y.div(x, BITS, TO_NEAREST).atan(BITS, TO_NEAREST, constants);
    let pi = constants.pi(BITS, TO_NEAREST);
    match (x.is_negative(), y.is_negative()) {
        (false, _) => angle,
        (true, false) => angle.add(&pi, BITS, TO_NEAREST),
        (true, true) => angle.sub(&pi, BITS, TO_NEAREST),
    }
}

#[test]
fn roots_logarithms_powers_and_angles_agree_with_multiprecision() {
    let mut constants = Consts::new().expect("memory for constants");
    let mut stream = Stream::new(9, "roots");
    let (mut worst, mut double) = ([0.0; 4], [0.0; 4]);
    for index in 0..3000 {
        let scale = [1e-3, 1.0, 2.0, 1e3, 1e5][index % 5];
        let (x, y) = (stream.uniform(-scale, scale), stream.uniform(-2.0, 2.0));
        let (size, exponent) = (x.abs(), stream.uniform(-3.0, 3.0));
        let (a, b, e) = (size, y, exponent);
        let [size, y, exponent] = [size, y, exponent].map(|v| BigFloat::from_f64(v, BITS));
        let signed = BigFloat::from_f64(x, BITS);
        let exact = [
            size.sqrt(BITS, TO_NEAREST),
            size.ln(BITS, TO_NEAREST, &mut constants),
            size.pow(&exponent, BITS, TO_NEAREST, &mut constants),
            big_atan2(&y, &signed, &mut constants),
        ];
        let found = [a.sqrt(), Elementary::ln(a), Elementary::powf(a, e), Elementary::atan2(b, x)];
        let wide = DoubleDouble::from_f64;
        let in_double = [wide(a).sqrt(), wide(a).ln(), wide(a).powf(e), wide(b).atan2(wide(x))];
        for k in 0..4 {
            worst[k] = max_or_nan(worst[k], ulps(found[k], &exact[k]));
            double[k] = max_or_nan(double[k], units(in_double[k], &exact[k], 0.0));
        }
    }
    println!("largest errors of √, ln, power, atan2 in ulp {worst:.3?}, in 2⁻¹⁰⁶ {double:.1?}");
    // What `Tracked` takes them for.
    let limits = [0.5 + 1e-6, 1.0, 1.0, 2.0];
    assert!(worst.iter().zip(limits).all(|(e, limit)| *e <= limit), "{worst:?}");
    assert!(worst.iter().all(|e| *e > 0.4), "the oracle is not the kernel: {worst:?}");
    // The logarithm of a power is as long as its exponent.
    let limits = [6.0, 20.0, 200.0, 20.0];
    assert!(double.iter().zip(limits).all(|(e, limit)| *e <= limit), "{double:?}");
}

#[test]
fn angles_come_back_to_their_circle() {
    for (x, rest) in [(7.5, 0.5), (-0.25, 3.25), (0.0, 0.0), (3.5, 0.0), (-7.0, 0.0)] {
        assert_eq!(Elementary::rem_euclid(x, 3.5), rest);
        assert_eq!(DoubleDouble::from_f64(x).rem_euclid(3.5).value(), rest);
        assert_eq!(Lanes([x; WIDTH]).rem_euclid(3.5).0, [rest; WIDTH]);
        let dual = Dual::<f64, 1>::variable(x, 0).rem_euclid(3.5);
        assert_eq!((dual.re, dual.eps), (rest, [1.0]));
    }
    assert!(Elementary::rem_euclid(f64::NAN, 1.0).is_nan());
    for x in [1e33, -1e33, 1e17] {
        let (rest, wide) =
            (Elementary::rem_euclid(x, 3.5), DoubleDouble::from_f64(x).rem_euclid(3.5));
        assert_eq!(wide.value(), rest, "{x:e}");
    }
    // Integers of any size are products, also of negative numbers.
    let odd = DoubleDouble::from_f64(-1.5).powf(65.0);
    assert!(odd.value() < 0.0 && odd.parts().1 != 0.0);
    let zero = Tracked { value: 0.0, bound: 1.0 };
    assert_eq!((zero.powf(0.0).value, zero.powf(0.0).bound), (1.0, 2.0));
    let mut sum = DoubleDouble::from_f64(2.0);
    sum += DoubleDouble::from_f64(1.0);
    sum *= DoubleDouble::from_f64(4.0);
    sum -= DoubleDouble::from_f64(2.0);
    sum /= DoubleDouble::from_f64(5.0);
    assert_eq!(sum.value(), 2.0);
    assert_eq!(
        (Scalar::powi(3.0, 5), Scalar::powi(2.0, -2), Scalar::powi(0.0, 0)),
        (243.0, 0.25, 1.0)
    );
}

#[test]
fn elementary_functions_at_the_ends_of_the_range() {
    let exp = |x: f64| Elementary::exp(x);
    assert_eq!((exp(0.0), exp(-0.0), exp(f64::NEG_INFINITY)), (1.0, 1.0, 0.0));
    assert_eq!((exp(f64::INFINITY), exp(710.0), exp(-746.0)), (f64::INFINITY, f64::INFINITY, 0.0));
    assert!(exp(709.7).is_finite() && exp(f64::NAN).is_nan());
    // Subnormal results are rounded to their spacing.
    for x in [-709.0, -720.0, -740.0, -745.0] {
        let least = 5e-324;
        assert!((exp(x) - libm::exp(x)).abs() <= 2.0 * least, "e^{x}");
    }
    for x in [0.0_f64, -0.0] {
        let (s, c) = Elementary::sin_cos(x);
        assert_eq!((s.to_bits(), c), (x.to_bits(), 1.0));
    }
    for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let (s, c) = Elementary::sin_cos(x);
        assert!(s.is_nan() && c.is_nan());
    }
    for x in [0.5, 2.0, 4.0, 6.0, 1e4, 1e8] {
        let (s, c) = Elementary::sin_cos(x);
        assert_eq!(Elementary::sin_cos(-x), (-s, c));
    }
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
    for x in arguments().as_chunks::<WIDTH>().0 {
        let ((s, c), e) = (Lanes(*x).sin_cos(), Lanes(*x).exp());
        let product = e.zero_with(Lanes(*x));
        for k in 0..WIDTH {
            let (sk, ck) = Elementary::sin_cos(x[k]);
            assert_eq!((s.0[k].to_bits(), c.0[k].to_bits()), (sk.to_bits(), ck.to_bits()));
            assert_eq!(e.0[k].to_bits(), Elementary::exp(x[k]).to_bits());
            assert_eq!(product.0[k], if x[k] == 0.0 { 0.0 } else { e.0[k] });
        }
    }
}

/// A product in which 0·∞ is 0, with its derivatives: those of x·e^{−x²}.
#[test]
fn products_with_a_vanished_factor_vanish() {
    let bell = |x: Dual<f64, 1>| {
        let e = (-(x * x)).exp();
        (x * e).zero_with(e)
    };
    for x in [30.0, 1e200, f64::INFINITY, f64::NEG_INFINITY] {
        let out = bell(Dual::variable(x, 0));
        assert_eq!((out.re, out.eps[0]), (0.0, 0.0), "{x}");
    }
    let out = bell(Dual::variable(1.5, 0));
    assert!((out.eps[0] - (1.0 - 4.5) * libm::exp(-2.25)).abs() < 1e-15);
    assert!(bell(Dual::variable(f64::NAN, 0)).re.is_nan());
}

/// Gauss–Legendre, whose lanes wait for one another, and a field with a cubic to solve.
#[test]
fn implicit_steps_in_lanes_are_those_of_one_alone() {
    let mut stream = Stream::new(4, "lines");
    let system = FieldLines::new(1e-2);
    let any = System::FieldLines(system);
    for count in [1, 8, 11, 19] {
        let points: Vec<f64> = (0..count)
            .flat_map(|_| system.point(stream.uniform(0.05, 0.95), stream.uniform(-3.0, 3.0)))
            .collect();
        for (stages, steps) in [(1, 5), (3, 2), (6, 1)] {
            let method = GaussLegendre::new(stages);
            let mut alone = Vec::new();
            let mut z = points.clone();
            for _ in 0..3 {
                for z in z.chunks_exact_mut(2) {
                    method.integrate(&system, z, TAU, 4 * steps).expect("converges");
                }
                alone.extend_from_slice(&z);
            }
            for set in Simd::ALL.into_iter().filter(|set| set.is_available()) {
                set.limit();
                let by = Integrator::GaussLegendre(GaussLegendreSettings { stages });
                let states = by.trajectories(&any, &points, TAU, 4 * steps, 3).expect("moved");
                assert_eq!(states, alone, "{stages} stages, {count} points, {set:?}");
            }
            Simd::Avx512.limit();
        }
    }
}

/// A lane that does not converge, among others that do, says so as it does alone.
#[test]
fn a_lane_that_fails_tells_why() {
    let system = Oscillators { epsilon: 0.5 };
    let any = System::Oscillators(system);
    let mut points = vec![0.1; 4 * 11];
    points[4 * 9 + 1] = 1e8;
    let (time, steps) = (4.0, 2);
    let method = GaussLegendre::new(2);
    let mut alone = points[4 * 9..4 * 10].to_vec();
    let expected = method.integrate(&system, &mut alone, time, steps).expect_err("too long a step");
    let by = Integrator::GaussLegendre(GaussLegendreSettings { stages: 2 });
    let found = by.trajectories(&any, &points, time, steps, 3).expect_err("one of them fails");
    assert_eq!(found.to_string(), expected.to_string());
    points[4 * 9 + 1] = 0.1;
    assert!(by.trajectories(&any, &points, time, steps, 3).is_ok());
}

/// Integrators move several trajectories in lanes: with the bits of each alone, on
/// each instruction set.
#[test]
fn trajectories_in_lanes_are_those_of_one_alone() {
    let mut stream = Stream::new(9, "trajectories");
    let field = System::ParticleField(ParticleField::two_modes(0.1));
    let orbit = System::FullOrbit(FullOrbit::new(0.1));
    let torus = System::ThreeOscillators(ThreeOscillators::new(0.1));
    let drift = System::CellularDrift(CellularDrift::new(0.1));
    let excited = System::VanDerPol(VanDerPol::new(0.1));
    let coupled = System::Oscillators(Oscillators { epsilon: 0.01 });
    for system in [coupled, field, orbit, drift, torus, excited] {
        let dim = 2 * system.dof();
        for count in [1, 7, 8, 19] {
            let mut points: Vec<f64> =
                (0..count * dim).map(|_| stream.uniform(-1.5, 1.5)).collect();
            // Far out sine has another reduction, and a Gaussian vanishes.
            points[0] = 3e9;
            points[2] = 1e5;
            let methods = [
                (Integrator::RungeKutta4, None),
                (Integrator::Strang, Some(Splitting::STRANG)),
                (Integrator::Yoshida4, Some(Splitting::YOSHIDA_4)),
                (Integrator::Aba1064, Some(Splitting::ABA_1064)),
            ];
            for (integrator, splitting) in methods {
                let mut alone = Vec::new();
                let mut z = points.clone();
                for _ in 0..3 {
                    for z in z.chunks_exact_mut(dim) {
                        match splitting {
                            Some(splitting) => match &system {
                                System::Oscillators(s) => splitting.integrate(s, z, 0.3, 2),
                                System::ParticleField(s) => splitting.integrate(s, z, 0.3, 2),
                                System::FullOrbit(s) => splitting.integrate(s, z, 0.3, 2),
                                System::ThreeOscillators(s) => splitting.integrate(s, z, 0.3, 2),
                                System::CellularDrift(s) => splitting.integrate(s, z, 0.3, 2),
                                System::VanDerPol(s) => splitting.integrate(s, z, 0.3, 2),
                                System::FieldLines(_) => panic!("no parts"),
                            },
                            None => runge_kutta_4(&system, z, 0.3, 2),
                        }
                    }
                    alone.extend_from_slice(&z);
                }
                for set in Simd::ALL.into_iter().filter(|set| set.is_available()) {
                    set.limit();
                    let states = integrator.trajectories(&system, &points, 0.3, 2, 3);
                    // The far one may leave the numbers, and a NaN has no sign.
                    let same = |(a, b): (&f64, &f64)| {
                        a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
                    };
                    let states = states.expect("moved");
                    assert!(
                        states.len() == alone.len() && states.iter().zip(&alone).all(same),
                        "{integrator:?}, {count} points, {set:?}"
                    );
                }
            }
        }
    }
    Simd::Avx512.limit();
}

/// A function that uses every operation of the number layer.
fn everything<S: Elementary>(x: S, y: S) -> S {
    let (s, c) = (x * y).sin_cos();
    let (t, h) = (x + y).tanh_sech2();
    let quotient = (x - y) / (S::from_f64(2.0) + c * c);
    (t.mul_add(s, h) * (-quotient).exp()).mul_add(x, y)
}

/// A function of the roots, powers, logarithms and angles that potentials are made of.
fn rooted<S: Elementary>(x: S, y: S) -> S {
    let radius = (x * x + y * y + S::from_f64(0.25)).sqrt();
    let power = radius.powf(1.5) * radius.powi(-3) + x.powi(3);
    (radius.ln() * y.atan2(x) + power) / (y.rem_euclid(0.7) + S::from_f64(1.0))
}

#[test]
fn roots_and_angles_have_the_derivatives_of_another_implementation() {
    use num_dual::{Dual64, DualNum};
    let mut stream = Stream::new(12, "rooted");
    for _ in 0..500 {
        let (x, y) = (stream.uniform(-1.5, 1.5), stream.uniform(-1.5, 1.5));
        let ours = rooted(Dual::<f64, 2>::variable(x, 0), Dual::variable(y, 1));
        let bound = rooted(
            Dual::<Tracked, 2>::variable(Tracked::exact(x), 0),
            Dual::variable(Tracked::exact(y), 1),
        );
        let f = |x: Dual64, y: Dual64| {
            let radius = (x * x + y * y + 0.25).sqrt();
            let power = radius.powf(1.5) * radius.powi(-3) + x.powi(3);
            let mut rest = y;
            rest.re = y.re.rem_euclid(0.7);
            (radius.ln() * y.atan2(x) + power) / (rest + 1.0)
        };
        let constant = |v: f64| Dual64::from_re(v);
        let variable = |v: f64| Dual64::from_re(v).derivative();
        let (dx, dy) = (f(variable(x), constant(y)), f(constant(x), variable(y)));
        let ours = [ours.re, ours.eps[0], ours.eps[1]];
        let bounds = [bound.re, bound.eps[0], bound.eps[1]];
        for (k, other) in [dx.re, dx.eps, dy.eps].into_iter().enumerate() {
            assert_eq!(ours[k], bounds[k].value);
            let ratio = (ours[k] - other).abs() / bounds[k].error();
            assert!(ratio <= 2.0, "component {k} at ({x}, {y}): {ratio}");
        }
        // The same bits in lanes, and in the real part of numbers with a bound.
        let lanes = rooted(Lanes([x; WIDTH]), Lanes([y; WIDTH]));
        assert_eq!(lanes.0.map(f64::to_bits), [rooted(x, y).to_bits(); WIDTH]);
    }
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
            tracked += Tracked::exact(a) * Tracked::exact(b);
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
