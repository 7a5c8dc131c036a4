//! Systems and flows against the equations of motion.

use gyroceptron::Error;
use gyroceptron::flow::{
    Averaged, AveragedSettings, GaussLegendre, GaussLegendreSettings, Integrator, MicroSteps,
    Pairs, Reference, ReferenceTrajectories, Splitting, Stroboscopic, StroboscopicSettings,
    Tableau, Window, boris, natural_runge_kutta_4, runge_kutta_4, sample_of, velocity_splitting,
};
use gyroceptron::layer::CircleAction;
use gyroceptron::measure::{
    adiabatic::{FittedLine, averaged_invariant, log_line, log_slope, second_averaged_invariant},
    trajectories::drifts,
};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{DoubleDouble, Dual, Elementary, Real, Scalar, constant, max_or_nan};
use gyroceptron::system::{
    AverageConstants, AveragedOscillator, CellularDrift, Counted, FieldLines, FieldProfile,
    FullOrbit, Hamiltonian, NaturalCoordinates, NearlyPeriodic, Oscillators, ParticleField,
    Splittable, System, ThreeOscillators, VanDerPol, divergence, symplectic_gradient,
};
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::f64::consts::TAU;

fn particle(epsilon: f64, modes: usize) -> ParticleField {
    let mut system = ParticleField::two_modes(epsilon);
    system.profiles.resize(modes, FieldProfile::Sine { amplitude: 0.3, wavenumber: 1.5 });
    system
}

/// Does something with a system whose parts have exact flows.
macro_rules! split {
    ($system:expr, $s:ident => $body:expr) => {
        match &$system {
            System::Oscillators($s) => $body,
            System::ParticleField($s) => $body,
            System::FullOrbit($s) => $body,
            System::CellularDrift($s) => $body,
            System::ThreeOscillators($s) => $body,
            System::VanDerPol($s) => $body,
            System::FieldLines(_) => panic!("no parts"),
        }
    };
}

fn systems(epsilon: f64) -> Vec<System> {
    vec![
        System::Oscillators(Oscillators { epsilon }),
        System::ParticleField(particle(epsilon, 1)),
        System::ParticleField(particle(epsilon, 2)),
        System::ParticleField(particle(epsilon, 4)),
        System::FullOrbit(FullOrbit::new(epsilon)),
        System::CellularDrift(CellularDrift::new(epsilon)),
        System::CellularDrift(CellularDrift { epsilon, wavenumber: 1.7 }),
        System::ThreeOscillators(ThreeOscillators::new(epsilon)),
        System::VanDerPol(VanDerPol::new(epsilon)),
    ]
}

pub(super) fn point(dof: usize, seed: u64) -> Vec<f64> {
    let mut stream = Stream::new(seed, "point");
    (0..2 * dof).map(|_| stream.uniform(-1.2, 1.2)).collect()
}

pub(super) fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan)
}

/// Ω∇H by duals.
fn from_energy(system: &impl Hamiltonian, z: &[f64]) -> Vec<f64> {
    let n = system.dof();
    let slope = |direction: usize| {
        let w: Vec<_> = z
            .iter()
            .enumerate()
            .map(|(i, &v)| Dual::<f64, 1>::variable(v, if i == direction { 0 } else { 1 }))
            .collect();
        system.energy(&w, 0.0).eps[0]
    };
    (0..2 * n).map(|i| if i < n { slope(n + i) } else { -slope(i - n) }).collect()
}

#[test]
fn vector_fields_are_hamiltonian_but_for_dissipation() {
    for system in systems(0.3) {
        for seed in 0..20 {
            let z = point(system.dof(), seed);
            let mut field = vec![0.0; z.len()];
            system.vector_field(&z, 0.0, &mut field);
            let mut expected = from_energy(&system, &z);
            let by_energy = distance(&field, &expected);
            assert_eq!(by_energy > 1e-3, system.dissipates(), "{by_energy}");
            system.add_dissipation(&z, 0.0, &mut expected);
            assert!(distance(&field, &expected) < 1e-14);
        }
    }
    let averaged = AveragedOscillator::new(1.5);
    let mut field = [0.0; 2];
    averaged.vector_field(&[0.7, -0.4], 0.0, &mut field);
    assert!(distance(&field, &from_energy(&averaged, &[0.7, -0.4])) < 1e-15);
}

/// The equations as the paper displays them, written out once more.
#[test]
fn equations_of_motion_are_the_papers() {
    let (epsilon, z) = (0.07, [0.4, -0.9, 1.1, 0.3]);
    let [q1, q2, p1, p2]: [f64; 4] = z;
    let (s, c) = (2.0 * q1 + 2.0 * q2).sin_cos();
    let expected = [
        p1,
        epsilon * p2,
        -q1 - epsilon * (q2 * s + 2.0 * q1 * q2 * c),
        -epsilon * q2 - epsilon * (q1 * s + 2.0 * q1 * q2 * c),
    ];
    let mut field = [0.0; 4];
    Oscillators { epsilon }.vector_field(&z, 0.0, &mut field);
    assert!(distance(&field, &expected) < 1e-15);

    let w = [0.5, -0.3, 0.8, 0.9, 0.2, -0.6];
    let [q, a1, a2, p, b1, b2]: [f64; 6] = w;
    let v = p - q.sin() * a1 - (2.0 * q).sin() * a2;
    let v1 = 0.5 * (2.0 * a1).sin();
    let v2 = 0.5 * (-5.0 * a2 * a2).exp();
    let (d1, d2) = ((2.0 * a1).cos(), -5.0 * a2 * (-5.0 * a2 * a2).exp());
    let expected = [
        epsilon * v,
        b1 - v1,
        2.0 * (b2 - v2),
        epsilon * v * (q.cos() * a1 + 2.0 * (2.0 * q).cos() * a2),
        -a1 + (b1 - v1) * d1 + epsilon * v * q.sin(),
        -2.0 * a2 + 2.0 * (b2 - v2) * d2 + epsilon * v * (2.0 * q).sin(),
    ];
    let mut field = [0.0; 6];
    ParticleField::two_modes(epsilon).vector_field(&w, 0.0, &mut field);
    assert!(distance(&field, &expected) < 1e-15);
}

#[test]
fn the_limit_is_the_circle_action() {
    for system in systems(0.0) {
        let z = point(system.dof(), 3);
        let time = 2.3;
        let mut by_flow = z.clone();
        Reference::new(&system, &z).flow(&system, &mut by_flow, time).expect("converges");
        let mut by_limit = z.clone();
        system.limiting_flow(&mut by_limit, time);
        assert!(distance(&by_flow, &by_limit) < 1e-13);
        // In the simple coordinates it is Φ_{ω₀t}, and μ₀ is its invariant.
        let mut by_action = z.clone();
        split!(system, s => s.enter(&mut by_action));
        let invariant = system.circle_action().invariant(&by_action);
        assert!((invariant - system.adiabatic_invariant(&z)).abs() < 1e-14);
        let (torus, frequencies) = system.torus();
        let angles: Vec<f64> = frequencies.iter().map(|frequency| frequency * time).collect();
        torus.turn_by(&angles).apply(&mut by_action, false);
        split!(system, s => s.leave(&mut by_action));
        assert!(distance(&by_action, &by_limit) < 1e-14);
    }
}

#[test]
fn splittings_have_their_orders_for_the_papers_equations() {
    // Against the vector field of the paper, with V: the splitting drops V.
    for system in [
        System::Oscillators(Oscillators { epsilon: 0.2 }),
        System::ParticleField(particle(0.2, 2)),
        System::FullOrbit(FullOrbit::new(0.2)),
        System::CellularDrift(CellularDrift::new(0.2)),
        System::ThreeOscillators(ThreeOscillators::new(0.2)),
        System::VanDerPol(VanDerPol::new(0.2)),
    ] {
        let z = point(system.dof(), 7);
        let time = 4.0;
        let exact = Reference::calibrated(&system, &z, time)
            .and_then(|reference| reference.flow_with_error(&system, &z, time))
            .expect("converges");
        assert!(exact.error < 1e-13, "{:e}", exact.error);
        for scheme in Splitting::ALL {
            // In ABA(8,6,4) and ABA(10,6,4) small steps show the ε³h⁴ term.
            let steps: &[usize] = if scheme.order == 2 {
                &[64, 96, 128, 192, 256]
            } else if scheme.name == "Yoshida 4" {
                &[32, 48, 64, 96, 128]
            } else {
                &[6, 9, 12, 18]
            };
            let (mut sizes, mut errors) = (Vec::new(), Vec::new());
            for &count in steps {
                let mut w = z.clone();
                split!(system, s => scheme.integrate(s, &mut w, time, count));
                sizes.push(time / count as f64);
                errors.push(distance(&w, &exact.point));
            }
            assert!(errors[errors.len() - 1] > 1e-13, "{}: at the floor", scheme.name);
            let expected = scheme.order as f64;
            if scheme.name.starts_with("ABA") {
                let slope = log_slope(&sizes, &errors);
                assert!(slope > expected - 0.2, "{}: {slope}", scheme.name);
            } else {
                assert_order(scheme.name, expected, &sizes, &errors);
            }
        }
    }
}

/// Fails unless the 99 % confidence interval of the slope of log `errors` in
/// log `sizes` lies within ½ of `order`: no other whole number is then as near.
pub(super) fn assert_order(what: &str, order: f64, sizes: &[f64], errors: &[f64]) {
    let FittedLine { slope, slope_error, degrees_of_freedom } = log_line(sizes, errors);
    let student = StudentsT::new(0.0, 1.0, degrees_of_freedom as f64).expect("three points");
    let half = student.inverse_cdf(0.995) * slope_error;
    assert!((slope - order).abs() + half < 0.5, "{what}: {slope} ± {half} for {order}: {errors:?}");
}

/// Whether [`assert_order`] takes these errors.
fn has_order(order: f64, sizes: &[f64], errors: &[f64]) -> bool {
    std::panic::catch_unwind(|| assert_order("a mutant", order, sizes, errors)).is_ok()
}

/// Coefficients with one of them off by this factor.
fn with_one_off(of: &[f64], place: usize, factor: f64) -> Vec<f64> {
    let mut out = of.to_vec();
    out[place] *= factor;
    out
}

/// With any of its coefficients off by a thousandth, a splitting has not its order.
#[test]
fn splittings_with_a_wrong_coefficient_are_rejected() {
    let system = Oscillators { epsilon: 0.2 };
    let z = point(2, 7);
    let exact = Reference::calibrated(&system, &z, 4.0)
        .and_then(|reference| reference.flow_with_error(&system, &z, 4.0))
        .expect("converges");
    let mut mutants = 0;
    for scheme in Splitting::ALL {
        let steps = if scheme.order == 2 { [64, 96, 128, 192, 256] } else { [12, 16, 20, 24, 32] };
        let order = scheme.order as f64;
        let holds = |scheme: Splitting| {
            let errors = steps.map(|count| {
                let mut w = z.clone();
                scheme.integrate(&system, &mut w, 4.0, count);
                distance(&w, &exact.point)
            });
            has_order(order, &steps.map(|count| 4.0 / count as f64), &errors)
        };
        // Of the ABA the terms of higher powers of ε are hidden: a test of its own has them.
        assert!(holds(scheme) || scheme.name.starts_with("ABA"), "{}", scheme.name);
        for half in 0..2 {
            for place in 0..[scheme.a, scheme.b][half].len() {
                let off = with_one_off([scheme.a, scheme.b][half], place, 1.001).leak();
                let [a, b] = if half == 0 { [off, scheme.b] } else { [scheme.a, off] };
                assert!(!holds(Splitting { a, b, ..scheme }), "{}: {half}, {place}", scheme.name);
                mutants += 1;
            }
        }
    }
    assert_eq!(mutants, 23);
}

/// ABA(8,6,4) errs by O(εh⁸ + ε²h⁶ + ε³h⁴), ABA(10,6,4) by O(εh¹⁰ + ε²h⁶ + ε³h⁴).
/// Each term is the lowest power of ε in a combination of the errors at 0, ±ε and
/// ±2ε, and stands out of rounding in double-double. (The coefficients are
/// double: their rounding is of the order ε⁰ and cancels.)
#[test]
fn generalised_orders_show_in_epsilon() {
    const TIME: f64 = 4.0;
    type Term = (i32, f64, &'static [(f64, f64)], [usize; 5]);
    let odd: &[(f64, f64)] = &[(1.0, 1.0), (-1.0, -1.0)];
    let even: &[(f64, f64)] = &[(1.0, 1.0), (-1.0, 1.0), (0.0, -2.0)];
    let third: &[(f64, f64)] = &[(2.0, 1.0), (-2.0, -1.0), (1.0, -2.0), (-1.0, 2.0)];
    let terms = |order: i32, steps: [usize; 5]| -> [Term; 3] {
        let small = [40, 48, 56, 68, 80];
        [(order, 1e-8, odd, steps), (6, 1e-6, even, small), (4, 1e-6, third, small)]
    };
    let points: Vec<f64> = (0..5).flat_map(|seed| point(2, seed)).collect();
    for (scheme, terms) in [
        (Splitting::ABA_864, terms(8, [26, 30, 34, 39, 44])),
        (Splitting::ABA_1064, terms(10, [14, 16, 18, 21, 24])),
    ] {
        for (order, epsilon, combination, steps) in terms {
            let ends = |epsilon: f64, count: usize| -> Vec<DoubleDouble> {
                let system = Oscillators { epsilon };
                let end = |z: &[f64]| {
                    let mut w: Vec<_> = z.iter().map(|&v| DoubleDouble::from_f64(v)).collect();
                    scheme.integrate(&system, &mut w, TIME, count);
                    w
                };
                points.chunks_exact(4).flat_map(end).collect()
            };
            let combined = |count: usize| {
                let mut sum = vec![DoubleDouble::zero(); points.len()];
                for (multiple, weight) in combination {
                    for (sum, end) in sum.iter_mut().zip(ends(multiple * epsilon, count)) {
                        *sum += DoubleDouble::from_f64(*weight) * end;
                    }
                }
                sum
            };
            let exact = combined(8 * steps[4]);
            let error = |count: usize| {
                let each = combined(count).into_iter().zip(&exact);
                let squares: f64 = each.map(|(a, b)| (a - *b).value().powi(2)).sum();
                squares.sqrt()
            };
            let sizes = steps.map(|count| TIME / count as f64);
            let name = format!("{}, order {order}", scheme.name);
            assert_order(&name, f64::from(order), &sizes, &steps.map(error));
        }
    }
}

/// A method of another order, or with noise on its errors, does not pass.
#[test]
fn the_order_of_another_method_is_rejected() {
    let sizes = [0.1, 0.08, 0.06, 0.05, 0.04];
    let judge = |f: &dyn Fn(usize) -> f64| has_order(8.0, &sizes, &[0, 1, 2, 3, 4].map(f));
    assert!(judge(&|k| 3.0 * sizes[k].powi(8) * (1.0 + sizes[k] * sizes[k])));
    assert!(!judge(&|k| sizes[k].powi(6)));
    assert!(!judge(&|k| sizes[k].powf(8.6)));
    assert!(!judge(&|k| sizes[k].powi(8) * [1.0, 1.1, 0.9, 1.1, 1.0][k]));
    assert!(!judge(&|k| if k == 2 { f64::NAN } else { sizes[k].powi(8) }));
}

#[test]
fn errors_of_splittings_scale_with_epsilon() {
    let z = [0.8, -0.5, 0.3, 0.9];
    let epsilons = [1e-1, 1e-2, 1e-3];
    let errors: Vec<f64> = epsilons
        .iter()
        .map(|&epsilon| {
            let system = Oscillators { epsilon };
            let mut w = z.to_vec();
            Splitting::STRANG.integrate(&system, &mut w, 2.0, 20);
            let exact = Reference::new(&system, &z).flow_with_error(&system, &z, 2.0).expect("ok");
            distance(&w, &exact.point)
        })
        .collect();
    let slope = log_slope(&epsilons, &errors);
    assert!((slope - 1.0).abs() < 0.1, "{slope}");
}

#[test]
fn gauss_and_runge_kutta_have_their_orders() {
    let system = System::ParticleField(particle(0.2, 2));
    let z = point(3, 9);
    let time = 2.0;
    let exact = Reference::calibrated(&system, &z, time)
        .and_then(|reference| reference.flow_with_error(&system, &z, time))
        .expect("converges");
    for (stages, steps) in [
        (1, [80, 100, 120, 160, 200, 240]),
        (2, [40, 50, 60, 80, 100, 120]),
        (3, [30, 36, 42, 48, 54, 60]),
        (4, [20, 22, 24, 26, 28, 32]),
    ] {
        let sizes = steps.map(|count| time / f64::from(count as u32));
        let errors = |method: &GaussLegendre| {
            steps.map(|count| {
                let mut w = z.clone();
                method.integrate(&system, &mut w, time, count).expect("converges");
                distance(&w, &exact.point)
            })
        };
        let (method, order) = (GaussLegendre::new(stages), 2.0 * stages as f64);
        assert_order(&format!("{stages} stages"), order, &sizes, &errors(&method));
        // A weight by a thousandth, an entry of the matrix by a tenth.
        for (entry, factor) in [(0, 1.001), (1, 1.1)] {
            let mut mutant = method.clone();
            let of = if entry == 0 { &mut mutant.weights } else { &mut mutant.matrix };
            *of.last_mut().expect("a stage") *= factor;
            assert!(!has_order(order, &sizes, &errors(&mutant)), "{stages} stages, {entry}");
        }
    }
    let steps = [100, 120, 150, 200, 250, 300];
    let sizes = steps.map(|count| time / f64::from(count as u32));
    let moved = |by: &dyn Fn(&mut [f64], usize)| {
        steps.map(|count| {
            let mut w = z.clone();
            by(&mut w, count);
            distance(&w, &exact.point)
        })
    };
    let own = moved(&|w, count| runge_kutta_4(&system, w, time, count));
    assert_order("RK4", 4.0, &sizes, &own);
    // Its tableau, and that with a weight or a stage off by a thousandth.
    let tableau = |middle: f64, last: f64| {
        moved(&|w, count| {
            let stages: [(f64, &[(usize, f64)]); 4] =
                [(0.0, &[]), (0.5, &[(0, 0.5)]), (0.5, &[(1, middle)]), (1.0, &[(2, 1.0)])];
            let weights = [(0, 1.0 / 6.0), (1, 1.0 / 3.0), (2, 1.0 / 3.0), (3, last)];
            Tableau { stages: &stages, weights: &weights }.take(&system, w, time, count);
        })
    };
    for (a, b) in tableau(0.5, 1.0 / 6.0).iter().zip(&own) {
        assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
    }
    assert!(!has_order(4.0, &sizes, &tableau(0.5005, 1.0 / 6.0)));
    assert!(!has_order(4.0, &sizes, &tableau(0.5, 1.001 / 6.0)));
}

#[test]
fn gauss_nodes_and_weights_are_the_known_ones() {
    let method = GaussLegendre::new(2);
    let offset = 3.0_f64.sqrt() / 6.0;
    assert!((method.nodes()[0] - (0.5 - offset)).abs() < 1e-16);
    assert!((method.nodes()[1] - (0.5 + offset)).abs() < 2e-16);
    assert_eq!(GaussLegendre::new(1).nodes(), &[0.5]);
}

#[test]
fn the_reference_keeps_energy_and_estimates_its_error() {
    for system in systems(0.01) {
        let z = point(system.dof(), 11);
        let result = Reference::calibrated(&system, &z, 5.0)
            .and_then(|reference| reference.flow_with_error(&system, &z, 5.0))
            .expect("converges");
        assert!(result.error < 1e-13, "{:e}", result.error);
        if system.dissipates() {
            let mut w = z.clone();
            split!(system, s => Splitting::ABA_1064.integrate(s, &mut w, 5.0, 100));
            assert!(distance(&w, &result.point) < 1e-13);
            continue;
        }
        let change = (system.energy(&result.point, 0.0) - system.energy(&z, 0.0)).abs();
        assert!(change < 1e-14 * (1.0 + system.energy(&z, 0.0).abs()), "{change:e}");
    }
}

#[test]
fn the_reference_says_when_it_cannot() {
    let system = Oscillators { epsilon: 0.01 };
    let method = GaussLegendre::new(12);
    // A step of 60 radians does not converge by fixed-point iteration.
    assert!(method.integrate(&system, &mut [1.0, 0.0, 0.0, 0.0], 60.0, 1).is_err());
    let mut bad = [f64::NAN, 0.0, 0.0, 0.0];
    assert!(Reference::new(&system, &bad).flow(&system, &mut bad, 1.0).is_err());
}

/// Points inside of the torus, away from the axis.
fn lines(count: usize) -> Vec<f64> {
    let mut stream = Stream::new(3, "lines");
    let system = FieldLines::new(0.0);
    (0..count)
        .flat_map(|_| system.point(stream.uniform(0.1, 0.9), stream.uniform(-3.0, 3.0)))
        .collect()
}

#[test]
fn field_lines_are_of_the_vector_potential() {
    let system = FieldLines::new(1e-2);
    for (k, z) in lines(20).chunks_exact(2).enumerate() {
        let time = 0.7 * k as f64;
        let (r, theta) = system.polar(z);
        // A_θ is half the squared distance, and H is −A_φ.
        let momentum = r * r / 2.0 - r.powi(3) * theta.cos() / (3.0 * system.aspect_ratio);
        assert!((momentum - 0.5 * (z[0] * z[0] + z[1] * z[1])).abs() < 1e-15);
        let phase: f64 = -3.0 * theta + 2.0 * time;
        let energy = system.iota * (r * r / 2.0 - r.powi(4) / 4.0) * (1.0 + 1e-2 * phase.cos());
        assert!((system.energy(z, time) - energy).abs() < 1e-15);
        assert!(distance(&system.point(r, theta), z) < 1e-15);
        let (mut field, mut by_duals) = ([0.0; 2], [0.0; 2]);
        system.vector_field(z, time, &mut field);
        symplectic_gradient(&system, z, time, &mut by_duals);
        assert!(distance(&field, &by_duals) < 2e-15, "{field:?} {by_duals:?}");
        assert!(system.fastest_frequency(z) > 0.5 && system.check_point(z).is_ok());
    }
}

/// r and θ from their definition by bisection and differences, and dθ/dφ = ∂H/∂p_θ: by hand, in the
/// coordinates of the paper.
#[test]
fn field_lines_move_as_in_their_angles() {
    let system = FieldLines::new(2e-2);
    let radius = |theta: f64, momentum: f64| {
        let (mut low, mut high): (f64, f64) = (0.0, 1.2);
        for _ in 0..200 {
            let r = 0.5 * (low + high);
            let found = r * r / 2.0 - r.powi(3) * theta.cos() / (3.0 * system.aspect_ratio);
            if found < momentum { low = r } else { high = r }
        }
        low
    };
    let energy = |theta: f64, momentum: f64, time: f64| {
        let r = radius(theta, momentum);
        let wave = 1.0 + 2e-2 * (-3.0 * theta + 2.0 * time).cos();
        system.iota * (r * r / 2.0 - r.powi(4) / 4.0) * wave
    };
    let field = |z: [f64; 2], time: f64| {
        let d = 1e-5;
        let by = |f: &dyn Fn(f64) -> f64| {
            (8.0 * (f(d) - f(-d)) - (f(2.0 * d) - f(-2.0 * d))) / (12.0 * d)
        };
        [by(&|x| energy(z[0], z[1] + x, time)), -by(&|x| energy(z[0] + x, z[1], time))]
    };
    let (theta, r): (f64, f64) = (0.8, 0.6);
    let mut w = [theta, r * r / 2.0 - r.powi(3) * theta.cos() / (3.0 * system.aspect_ratio)];
    let (steps, time) = (400, 4.0);
    let h = time / f64::from(steps);
    for step in 0..steps {
        let t = f64::from(step) * h;
        let at = |k: [f64; 2], s: f64| [w[0] + s * k[0], w[1] + s * k[1]];
        let k1 = field(w, t);
        let k2 = field(at(k1, h / 2.0), t + h / 2.0);
        let k3 = field(at(k2, h / 2.0), t + h / 2.0);
        let k4 = field(at(k3, h), t + h);
        w = [0, 1].map(|i| w[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
    }
    let z = system.point(r, theta);
    let found = Reference::calibrated(&system, &z, time)
        .and_then(|reference| reference.flow_with_error(&system, &z, time))
        .expect("converges");
    assert!(found.error < 1e-13);
    let expected = system.point(radius(w[0], w[1]), w[0]);
    let error = distance(&found.point, &expected);
    assert!(error < 1e-8, "{error:e}");
    assert!(distance(&expected, &z) > 0.1);
    let mut by_steps = z;
    runge_kutta_4(&system, &mut by_steps, time, 2000);
    assert!(distance(&by_steps, &found.point) < 1e-10);
}

/// How far dx/dt in natural coordinates is from what the canonical equations make of it.
fn natural_disagreement(system: &impl NaturalCoordinates) -> f64 {
    let mut largest = 0.0;
    for (seed, z) in lines(30).chunks_exact(2).enumerate() {
        let time = 0.3 * seed as f64;
        let mut slope = [0.0; 2];
        system.vector_field(z, time, &mut slope);
        let mut lifted = [0, 1].map(|k| Dual::<f64, 1> { re: z[k], eps: [slope[k]] });
        system.to_natural(&mut lifted);
        let x = lifted.map(|x| x.re);
        let mut found = [0.0; 2];
        system.natural_field(&x, time, &mut found);
        for k in 0..2 {
            largest = max_or_nan(largest, (found[k] - lifted[k].eps[0]).abs());
        }
        let mut back = x;
        system.to_canonical(&mut back);
        largest = max_or_nan(largest, distance(&back, z));
    }
    largest
}

/// With a third of p_θ's bend, a wrong coefficient.
struct Bent(FieldLines);

impl Hamiltonian for Bent {
    fn dof(&self) -> usize {
        1
    }
    fn energy<S: Elementary>(&self, z: &[S], time: f64) -> S {
        self.0.energy(z, time)
    }
    fn vector_field<S: Elementary>(&self, z: &[S], time: f64, out: &mut [S]) {
        self.0.vector_field(z, time, out);
    }
}

impl NaturalCoordinates for Bent {
    fn to_natural<S: Elementary>(&self, z: &mut [S]) {
        self.0.to_natural(z);
    }
    fn to_canonical<S: Elementary>(&self, x: &mut [S]) {
        self.0.to_canonical(x);
    }
    fn natural_field<S: Elementary>(&self, x: &[S], time: f64, out: &mut [S]) {
        let other = FieldLines { aspect_ratio: self.0.aspect_ratio * (1.0 + 1e-9), ..self.0 };
        other.natural_field(x, time, out);
    }
}

/// (r, θ): the same lines, of fourth order in the steps.
#[test]
fn field_lines_are_the_same_in_natural_coordinates() {
    for poloidal in [-3, 0, 2] {
        let system = FieldLines { poloidal, ..FieldLines::new(2e-2) };
        let disagreement = natural_disagreement(&system);
        assert!(disagreement < 1e-14, "{disagreement:e}");
        let broken = natural_disagreement(&Bent(system));
        assert!(broken > 1e-11, "{broken:e}");
    }
    assert!(natural_disagreement(&FieldLines::new(0.0)) < 1e-14);
    let system = FieldLines::new(1e-3);
    let any = System::FieldLines(system);
    let z = lines(11);
    let exact = Integrator::GaussLegendre(GaussLegendreSettings { stages: 5 });
    let exact = exact.trajectories(&any, &z, TAU, 60, 3).expect("converges");
    let steps = [12, 16, 24, 32, 48];
    let by = |steps: usize| Integrator::NaturalRungeKutta4.trajectories(&any, &z, TAU, steps, 3);
    let errors = steps.map(|steps| distance(&by(steps).expect("integrates"), &exact));
    let sizes = steps.map(|steps| 1.0 / steps as f64);
    assert_order("RK4 in (r, θ)", 4.0, &sizes, &errors);
    // Its tableau takes the same steps, and with a stage or a weight off by a thousandth has not the order.
    let moved = |off: [f64; 4], weight: f64, steps: usize| {
        let shares = [[(0, 0.5 * off[1])], [(1, 0.5 * off[2])], [(2, off[3])]];
        let stages = [(0.0, &[][..]), (0.5, &shares[0]), (0.5, &shares[1]), (1.0, &shares[2])];
        let weights = [(0, 1.0 / 6.0), (1, weight / 3.0), (2, 1.0 / 3.0), (3, 1.0 / 6.0)];
        let tableau = Tableau { stages: &stages, weights: &weights };
        let mut out = z.clone();
        for x in out.chunks_exact_mut(2) {
            system.to_natural(x);
            tableau.take_natural(&system, x, TAU, steps);
            system.to_canonical(x);
        }
        distance(&out, &exact[..z.len()])
    };
    let own = steps.map(|steps| moved([1.0; 4], 1.0, steps));
    let named = steps.map(|steps| {
        let found = Integrator::NaturalRungeKutta4.trajectories(&any, &z, TAU, steps, 1);
        distance(&found.expect("integrates"), &exact[..z.len()])
    });
    for (own, named) in own.iter().zip(named) {
        assert!((own / named - 1.0).abs() < 1e-6, "{own:e} {named:e}");
    }
    assert!(has_order(4.0, &sizes, &own));
    for place in 1..4 {
        let mut off = [1.0; 4];
        off[place] = 1.001;
        assert!(!has_order(4.0, &sizes, &steps.map(|steps| moved(off, 1.0, steps))), "{place}");
    }
    assert!(!has_order(4.0, &sizes, &steps.map(|steps| moved([1.0; 4], 1.001, steps))));
    // The bits of each line alone, which stays in (r, θ) from state to state.
    let together = by(16).expect("integrates");
    for (m, start) in z.chunks_exact(2).enumerate() {
        let mut x = start.to_vec();
        system.to_natural(&mut x);
        for t in 0..3 {
            natural_runge_kutta_4(&system, &mut x, TAU, 16);
            let mut shown = x.clone();
            system.to_canonical(&mut shown);
            assert_eq!(&together[(t * 11 + m) * 2..][..2], &shown[..]);
        }
    }
    let other = System::Oscillators(Oscillators { epsilon: 0.1 });
    let refused = Integrator::NaturalRungeKutta4.trajectories(&other, &[0.1; 4], 1.0, 3, 1);
    assert!(refused.expect_err("canonical ones alone").to_string().contains("coordinates"));
    assert!(exact.len() == 3 * z.len());
}

#[test]
fn unperturbed_field_lines_turn_on_their_surfaces() {
    let system = FieldLines::new(0.0);
    let points = lines(20);
    for z in points.chunks_exact(2) {
        let flow = Reference::calibrated(&system, z, 5.0).expect("converges");
        let (mut by_flow, mut by_limit) = (z.to_vec(), z.to_vec());
        flow.flow(&system, &mut by_flow, 5.0).expect("converges");
        system.limiting_flow(&mut by_limit, 5.0);
        let error = distance(&by_flow, &by_limit);
        assert!(error < 1e-13, "{error:e}");
        let change = system.adiabatic_invariant(&by_flow) - system.adiabatic_invariant(z);
        assert!(change.abs() < 1e-14);
    }
    // Away from resonances the flux stays to first order in ε.
    let z = system.point(0.3, 0.4);
    let change = |epsilon: f64| {
        let system = FieldLines::new(epsilon);
        let found = ReferenceTrajectories::of_flow(&system, &z, TAU, 200).expect("converges");
        assert!(found.error < 1e-11, "{:e}", found.error);
        let flux = found.trajectories.quantity(|z| system.adiabatic_invariant(z));
        flux.values().iter().map(|v| (v - flux.values()[0]).abs()).fold(0.0, max_or_nan)
    };
    let epsilons = [4e-4, 2e-4, 1e-4];
    let slope = log_slope(&epsilons, &epsilons.map(change));
    assert!((slope - 1.0).abs() < 0.05, "{slope}");
}

#[test]
fn field_lines_tell_where_they_are_not() {
    let system = FieldLines::new(1e-3);
    let said = |z: [f64; 2]| system.check_point(&z).expect_err("not there").to_string();
    assert!(said([1.02, 0.3]).contains("inside of the torus"), "{}", said([1.02, 0.3]));
    assert!(said([0.0, 0.0]).contains("singular on the axis"));
    assert!(said([0.1, 3.0]).contains("r(p_θ, θ) at the point [0.1, 3.0]"));
    assert!(said([f64::NAN, 0.1]).contains("NaN"));
    assert!(FieldLines::new(0.0).check_point(&[0.0, 0.0]).is_ok());
    // Without a poloidal wave it is defined there, and at rest.
    let plain = FieldLines { poloidal: 0, ..system };
    let mut field = [1.0; 2];
    plain.vector_field(&[0.0, 0.0], 0.4, &mut field);
    assert!(plain.check_point(&[0.0, 0.0]).is_ok() && field == [0.0, 0.0], "{field:?}");
    // Steps from one turn to the next are of whole periods.
    let z = system.point(0.5, 0.1);
    let quarter = ReferenceTrajectories::of_flow(&system, &z, 0.25 * TAU, 3).expect_err("no map");
    assert!(quarter.to_string().contains("a multiple of the period"), "{quarter}");
    assert!(ReferenceTrajectories::of_flow(&system, &z, 0.25 * TAU, 2).is_ok());
    let any = System::FieldLines(system);
    let by = |integrator: Integrator, interval, kept| {
        integrator.trajectories(&any, &z, interval, 50, kept)
    };
    assert!(by(Integrator::RungeKutta4, 0.25 * TAU, 2).is_err());
    assert!(by(Integrator::RungeKutta4, 0.5 * TAU, 2).is_ok());
    let refused = by(Integrator::Strang, TAU, 1).expect_err("nothing to split");
    assert!(refused.to_string().contains("no parts with exact flows"), "{refused}");
    let outside = Integrator::RungeKutta4.trajectories(&any, &[0.1, 0.2, 1.02, 0.3], TAU, 50, 1);
    assert!(outside.expect_err("one outside").to_string().contains("[1.02, 0.3]"));
    // Steps from one time to the next add up to that of all, at whole periods.
    let gauss = Integrator::GaussLegendre(GaussLegendreSettings { stages: 6 });
    let (once, twice) = (by(gauss, 2.0 * TAU, 1), by(gauss, TAU, 2));
    let (once, twice) = (once.expect("converges"), twice.expect("converges"));
    assert!(distance(&once, &twice[2..]) < 1e-11, "{:e}", distance(&once, &twice[2..]));
    let window =
        |low: f64, high: f64| Window { low: vec![low; 2], high: vec![high; 2], samples: 300 };
    let mut stream = Stream::new(1, "data");
    let inside = sample_of(&system, &[window(-1.2, 1.2)], &mut stream).expect("some are inside");
    assert_eq!(inside.len(), 600);
    assert!(inside.chunks_exact(2).all(|z| system.check_point(z).is_ok()));
    let away = sample_of(&system, &[window(2.0, 3.0)], &mut stream).expect_err("none inside");
    assert!(away.to_string().starts_with("window 0"), "{away}");
}

/// A Hamiltonian is all that a system needs.
struct Pendulum;

impl Hamiltonian for Pendulum {
    fn dof(&self) -> usize {
        1
    }
    fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
        S::from_f64(0.5) * z[1] * z[1] - z[0].sin_cos().1
    }
}

#[test]
fn a_hamiltonian_is_enough() {
    let mut field = [0.0; 2];
    Pendulum.vector_field(&[0.7, -0.3], 0.0, &mut field);
    assert!(distance(&field, &[-0.3, -0.7_f64.sin()]) < 1e-16);
    assert!((Pendulum.fastest_frequency(&[0.0, 0.0]) - 1.0).abs() < 1e-15);
    let point = [3.0, 0.1];
    let (pairs, error) = Pairs::of_flow(&Pendulum, point.to_vec(), 20.0).expect("converges");
    assert!(error < 1e-12);
    let change = Pendulum.energy(pairs.output(), 0.0) - Pendulum.energy(&point, 0.0);
    assert!(change.abs() < 1e-14 && distance(pairs.output(), &point) > 0.1);
    // More coordinates than fit on the stack.
    struct Many;
    impl Hamiltonian for Many {
        fn dof(&self) -> usize {
            10
        }
        fn energy<S: Elementary>(&self, z: &[S], time: f64) -> S {
            let square = |sum, k: usize| sum + S::from_f64(k as f64) * z[k] * z[k];
            (0..20).fold(S::from_f64(time) * z[0], square)
        }
    }
    let z: Vec<f64> = (0..20).map(|k| 0.1 * f64::from(k) - 1.0).collect();
    let mut field = vec![0.0; 20];
    Many.vector_field(&z, 2.0, &mut field);
    for k in 0..10 {
        let (up, down) = (2.0 * (k + 10) as f64 * z[k + 10], 2.0 * k as f64 * z[k]);
        let force = if k == 0 { down + 2.0 } else { down };
        assert!((field[k] - up).abs() < 1e-14 && (field[k + 10] + force).abs() < 1e-14);
    }
}

/// q̇ = p: no stage changes a slope, so that every step converges.
/// A spring whose stiffness changes with time.
struct Driven {
    period: Option<f64>,
}

impl Hamiltonian for Driven {
    fn dof(&self) -> usize {
        1
    }
    fn energy<S: Elementary>(&self, z: &[S], time: f64) -> S {
        let stiffness = S::from_f64(0.1f64.mul_add(time.sin(), 1.0));
        S::from_f64(0.5) * (z[1] * z[1] + stiffness * z[0] * z[0])
    }
    fn period(&self) -> Option<f64> {
        self.period
    }
}

/// Intervals that begin anew at time 0 are of whole periods, whether the system tells its period or not.
#[test]
fn a_flow_that_changes_with_time_is_repeated_by_whole_periods_only() {
    for period in [None, Some(TAU)] {
        let system = Driven { period };
        let along = |interval: f64, states: usize| {
            ReferenceTrajectories::of_flow(&system, &[0.0, 0.0, 1.0, 0.3], interval, states)
        };
        let said = along(0.5, 101).expect_err("refused").to_string();
        assert!(said.contains("interval") && said.contains("period"), "{said}");
        // Up to a billionth of one, where the period is given.
        if period.is_some() {
            for (share, whole) in [(0.995, true), (1.005, false)] {
                assert_eq!(along(TAU * (1.0 + 1e-9 * share), 3).is_ok(), whole, "{share}");
            }
        }
        // One interval is of any length.
        assert!(along(0.5, 2).is_ok());
        let whole = along(TAU, 3).expect("moves").trajectories;
        let once = along(2.0 * TAU, 2).expect("moves").trajectories;
        assert!(distance(whole.state(2, 1), once.state(1, 1)) < 1e-12);
    }
}

struct Free;

impl Hamiltonian for Free {
    fn dof(&self) -> usize {
        1
    }
    fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
        S::from_f64(0.5) * z[1] * z[1]
    }
}

/// ∞ − ∞ is NaN, which no error estimate may lose.
#[test]
fn a_flow_that_leaves_the_numbers_has_no_reference() {
    let fine = Reference::calibrated(&Free, &[0.0, 1.0], 5.0).expect("converges");
    assert!(fine.flow_with_error(&Free, &[0.0, 1.0], 5.0).expect("finite").error < 1e-14);
    let far = [0.0, 1e308];
    assert!(matches!(Reference::calibrated(&Free, &far, 5.0), Err(Error::Diverged { .. })));
    assert!(matches!(fine.flow_with_error(&Free, &far, 5.0), Err(Error::Diverged { .. })));
    assert!(matches!(fine.flow(&Free, &mut far.clone(), 5.0), Err(Error::Diverged { .. })));
}

#[test]
fn the_reference_starts_from_rest() {
    // |z| says nothing of the size of the motion: at 0 the profile drives it.
    let system = ParticleField::two_modes(0.01);
    for (z, time) in [(vec![0.0; 6], 0.5), (vec![1e-3; 6], 2.0)] {
        let mut moved = z.clone();
        Reference::new(&system, &z).flow(&system, &mut moved, time).expect("converges");
        assert!(distance(&moved, &z) > 1e-2);
    }
}

/// The largest entry of JᵀΩJ − Ω, of the columns of J.
pub(super) fn omega_defect(columns: &[Vec<f64>]) -> f64 {
    let n = columns.len() / 2;
    let mut largest = 0.0;
    for j in 0..2 * n {
        for k in 0..2 * n {
            let form: f64 = (0..n)
                .map(|i| columns[j][i] * columns[k][n + i] - columns[j][n + i] * columns[k][i])
                .sum();
            let omega = if k == j + n {
                1.0
            } else if j == k + n {
                -1.0
            } else {
                0.0
            };
            largest = max_or_nan(largest, (form - omega).abs());
        }
    }
    largest
}

#[test]
fn split_flows_are_symplectic() {
    for system in systems(0.3) {
        let n = system.dof();
        let z = point(n, 13);
        let mut columns = Vec::new();
        for direction in 0..2 * n {
            let mut w: Vec<_> = z
                .iter()
                .enumerate()
                .map(|(i, &v)| Dual::<f64, 1>::variable(v, if i == direction { 0 } else { 1 }))
                .collect();
            split!(system, s => Splitting::ABA_864.integrate(s, &mut w, 1.0, 2));
            columns.push(w.iter().map(|v| v.eps[0]).collect::<Vec<_>>());
        }
        let largest = omega_defect(&columns);
        if system.dissipates() {
            assert!(largest > 1e-3, "{largest}");
        } else if let System::FullOrbit(_) = system {
            // A splitting of the vector field keeps the volume alone.
            let volume = faer::Mat::from_fn(2 * n, 2 * n, |i, k| columns[k][i]).determinant();
            assert!(largest > 1e-8, "{largest}");
            assert!((volume - 1.0).abs() < 1e-13, "{volume}");
        } else {
            assert!(largest < 2e-14, "{largest}");
        }
    }
}

/// Boris' method and the splitting into ½v_x², ½v_y² and φ: their order, what they keep, and both there and back.
#[test]
fn methods_of_charged_particles_are_of_second_order() {
    type Method = fn(&FullOrbit, &mut [f64], f64, usize);
    type OfDuals = fn(&FullOrbit, &mut [Dual<f64, 4>], f64, usize);
    let methods: [(Integrator, Method, OfDuals); 2] = [
        (Integrator::Boris, boris, boris),
        (Integrator::VelocitySplitting, velocity_splitting, velocity_splitting),
    ];
    let system = FullOrbit { epsilon: 0.2, wavenumber: 1.3, potential: 0.7 };
    for (integrator, method, of_duals) in methods {
        let z = point(2, 7);
        let exact = Reference::calibrated(&system, &z, 4.0)
            .and_then(|reference| reference.flow_with_error(&system, &z, 4.0))
            .expect("converges");
        let counts = [64, 96, 128, 192, 256];
        let sizes = counts.map(|count| 4.0 / count as f64);
        let errors = |system: &FullOrbit| {
            counts.map(|count| {
                let mut w = z.clone();
                method(system, &mut w, 4.0, count);
                let error = distance(&w, &exact.point);
                method(system, &mut w, -4.0, count);
                assert!(distance(&w, &z) < 1e-13);
                error
            })
        };
        assert_order(&integrator.name(), 2.0, &sizes, &errors(&system));
        // What the method kicks by, off by a hundredth.
        let mutant = FullOrbit { potential: 0.707, ..system };
        assert!(!has_order(2.0, &sizes, &errors(&mutant)), "{}", integrator.name());
        let mut w: Vec<_> =
            z.iter().enumerate().map(|(k, &v)| Dual::<f64, 4>::variable(v, k)).collect();
        of_duals(&system, &mut w, 0.9, 3);
        let jacobian = faer::Mat::from_fn(4, 4, |i, k| w[i].eps[k]);
        let omega = faer::Mat::from_fn(4, 4, |i, k| match (i + 2 == k, k + 2 == i) {
            (true, _) => 1.0,
            (_, true) => -1.0,
            _ => 0.0,
        });
        let form = (jacobian.transpose() * &omega * &jacobian - &omega).norm_max();
        match integrator {
            Integrator::Boris => assert!(form > 1e-4, "{form}"),
            _ => assert!(form < 1e-14, "{form}"),
        }
        assert!((jacobian.determinant() - 1.0).abs() < 1e-13);
        // Of many points, each in a lane, and of no other system.
        let points: Vec<f64> = (0..11).flat_map(|seed| point(2, seed)).collect();
        let system = System::FullOrbit(system);
        let states = integrator.trajectories(&system, &points, 0.7, 5, 2).expect("moves");
        let System::FullOrbit(alone) = &system else { unreachable!() };
        for (m, start) in points.chunks_exact(4).enumerate() {
            let mut z = start.to_vec();
            for t in 0..2 {
                method(alone, &mut z, 0.7, 5);
                assert_eq!(&states[(t * 11 + m) * 4..][..4], &z[..]);
            }
        }
        let other = System::Oscillators(Oscillators { epsilon: 0.01 });
        for refused in [
            integrator.check_for(&other),
            integrator.trajectories(&other, &points, 0.7, 5, 2).map(|_| ()),
        ] {
            let message = refused.expect_err("another system").to_string();
            assert!(message.contains("full-orbit"), "{message}");
        }
        assert!(integrator.check_for(&system).is_ok());
    }
}

/// With a kick of its micro-steps off by a thousandth, stroboscopic averaging has no order.
#[test]
fn stroboscopic_averaging_with_a_wrong_coefficient_is_rejected() {
    let system = Oscillators { epsilon: 1e-3 };
    let points: Vec<f64> = (0..10).flat_map(|seed| point(2, seed)).collect();
    let any = System::Oscillators(system);
    let exact = ReferenceTrajectories::of_flow(&any, &points, 500.0, 2).expect("moves");
    let exact = &exact.trajectories.values()[points.len()..];
    let steps = [3, 4, 5, 6, 8];
    let holds = |scheme: Splitting| {
        let errors = steps.map(|steps| {
            let mut w = points.clone();
            Stroboscopic::new(&system, 500.0, (scheme, 24), 2).take(&system, &mut w, steps);
            distance(&w, exact)
        });
        has_order(4.0, &steps.map(|steps| 1.0 / steps as f64), &errors)
    };
    let own = Splitting::ABA_1064;
    assert!(holds(own));
    let off = with_one_off(own.b, 0, 1.001).leak();
    assert!(!holds(Splitting { b: off, ..own }));
}

fn averaging(micro: usize, differences: usize) -> Integrator {
    Integrator::Stroboscopic(StroboscopicSettings { micro, differences, by: MicroSteps::Aba1064 })
}

/// The averaged equation takes the flow over thousands of periods in a few steps: of fourth order in their size, with
/// an error of fourth order in ε beside, and no larger where ε is small.
#[test]
fn stroboscopic_averaging_follows_the_slow_motion() {
    let by = |system: &System, z: &[f64], time: f64, steps: usize| {
        averaging(24, 2).trajectories(system, z, time, steps, 1).expect("integrates")
    };
    let all: [&dyn Fn(f64) -> System; 3] = [
        &|epsilon| System::Oscillators(Oscillators { epsilon }),
        &|epsilon| System::ParticleField(particle(epsilon, 1)),
        &|epsilon| System::FullOrbit(FullOrbit::new(epsilon)),
    ];
    for of in all {
        let system = of(1e-3);
        let points: Vec<f64> = (0..10).flat_map(|seed| point(system.dof(), seed)).collect();
        let dim = 2 * system.dof();
        // Half of the slow time, 79 periods, and a part of one.
        let exact = ReferenceTrajectories::of_flow(&system, &points, 500.0, 2).expect("moves");
        assert!(exact.error < 1e-10, "{:e}", exact.error);
        let exact = &exact.trajectories.values()[points.len()..];
        let steps = [3, 4, 5, 6, 8];
        let sizes = steps.map(|steps| 1.0 / steps as f64);
        let errors = steps.map(|steps| distance(&by(&system, &points, 500.0, steps), exact));
        assert_order("stroboscopic averaging", 4.0, &sizes, &errors);
        let least = distance(&by(&system, &points, 500.0, 40), exact);
        // Some times (2πε)⁴.
        assert!(least < 3e-8, "{least:e}");
        // Of each alone, and back again.
        let together = by(&system, &points, 500.0, 3);
        for (z, there) in points.chunks_exact(dim).zip(together.chunks_exact(dim)) {
            assert_eq!(by(&system, z, 500.0, 3), there);
        }
        let back = by(&system, &by(&system, &points, 500.0, 40), -500.0, 40);
        assert!(distance(&back, &points) < 3e-8);
        // Less than a period is the splitting's alone.
        let short = Integrator::Aba1064.trajectories(&system, &points, 1.0, 4, 1).expect("moves");
        assert!(distance(&by(&system, &points, 1.0, 1), &short) < 1e-14);
    }
    // In half of the slow time, whatever ε is, but for ε⁴.
    let z = point(2, 3);
    let errors = [0.04, 0.02, 0.01].map(|epsilon| {
        let system = System::Oscillators(Oscillators { epsilon });
        let exact = Reference::calibrated(&system, &z, 0.5 / epsilon)
            .and_then(|reference| reference.flow_with_error(&system, &z, 0.5 / epsilon))
            .expect("converges");
        distance(&by(&system, &z, 0.5 / epsilon, 60), &exact.point)
    });
    let slope = log_slope(&[0.04, 0.02, 0.01], &errors);
    assert!((slope - 4.0).abs() < 0.6, "{slope}, {errors:?}");
    // Of fewer differences, and of the forward one.
    for (differences, order) in [(0, 1.0), (1, 2.0)] {
        let epsilons = [0.004, 0.0028, 0.002, 0.0014, 0.001];
        let errors = epsilons.map(|epsilon| {
            let (system, time) = (System::Oscillators(Oscillators { epsilon }), 0.5 / epsilon);
            let by = |differences, micro| {
                averaging(micro, differences)
                    .trajectories(&system, &z, time, 60, 1)
                    .expect("integrates")
            };
            distance(&by(differences, 24), &by(3, 24))
        });
        assert_order(&format!("of {differences} differences"), order, &epsilons, &errors);
    }
    let torus = System::ThreeOscillators(ThreeOscillators::new(0.01));
    let lines = System::FieldLines(FieldLines::new(1e-3));
    for (system, word) in [(torus, "no period"), (lines, "no parts with exact flows")] {
        let refused = averaging(8, 2).check_for(&system);
        assert!(refused.expect_err("refused").to_string().contains(word));
    }
    assert!(averaging(0, 2).check().is_err());
    assert!(averaging(8, 4).check().is_err());
    // What is stated as its error is no less than it is, of the highest order too, ...
    let coarse = System::Oscillators(Oscillators { epsilon: 0.05 });
    let highest = averaging(24, 3);
    let (found, said) =
        Pairs::of_integrator(&coarse, point(2, 5), 200.0, highest, 800).expect("moves");
    let exact = Pairs::of_flow(&coarse, point(2, 5), 200.0).expect("moves").0;
    let error = distance(found.output(), exact.output());
    assert!(error > 1e-6 && said > 0.5 * error, "{said:e} for {error:e}");
    // ... with the most steps of a period ...
    let finest = averaging(1000, 3);
    assert!(Pairs::of_integrator(&coarse, point(2, 5), 20.0, finest, 1).is_ok());
    // ... and of steps that are short.
    let system = System::FullOrbit(FullOrbit::new(0.01));
    for (time, steps) in [(400.0, 128), (5.0, 1)] {
        let method = averaging(8, 2);
        let (found, said) =
            Pairs::of_integrator(&system, point(2, 5), time, method, steps).expect("moves");
        let exact = Pairs::of_flow(&system, point(2, 5), time).expect("moves").0;
        let error = distance(found.output(), exact.output());
        assert!(error > 1e-12 && said > 0.8 * error, "{said:e} for {error:e}");
        let z = point(2, 5);
        let along = ReferenceTrajectories::of_integrator(&system, &z, time, 2, method, steps);
        let along = along.expect("moves");
        // It is the finer one that is kept.
        let kept = distance(&along.trajectories.values()[4..], exact.output());
        assert!(along.error > 0.8 * error && kept < 0.2 * error, "{:e} {kept:e}", along.error);
    }
}

/// Four differences, which tell the error of three, err by the steps through the slow motion alone.
#[test]
fn four_differences_follow_the_slow_motion_too() {
    let (system, z) = (Oscillators { epsilon: 0.005 }, point(2, 3));
    let exact = Reference::calibrated(&system, &z, 100.0)
        .and_then(|reference| reference.flow_with_error(&system, &z, 100.0))
        .expect("converges");
    let mut moved = z.clone();
    Stroboscopic::new(&system, 100.0, (Splitting::ABA_1064, 32), 4).take(&system, &mut moved, 40);
    let error = distance(&moved, &exact.point);
    assert!(error < 1e-7, "{error:e}");
}

/// v²/2B + ½v²(v×∇B)_z/B³, the textbooks' next order in the gyroradius: where B varies slowly it
/// changes less, by the wavenumber; within a gyroradius only the average does.
#[test]
fn the_gradient_corrects_the_magnetic_moment_where_it_is_small() {
    let changes = |wavenumber: f64| -> [f64; 3] {
        let epsilon = 1e-4;
        let system = FullOrbit { epsilon, wavenumber, potential: 0.0 };
        // Where the gradient is steepest.
        let z = [0.8, 0.5 / wavenumber, 0.3, 0.9 / wavenumber];
        let orbit = ReferenceTrajectories::of_flow(&system, &z, 0.1, 201).expect("moves");
        let of =
            |quantity: &dyn Fn(&[f64]) -> f64| drifts(&orbit.trajectories, quantity)[0].largest;
        let gradient = |z: &[f64]| {
            let (x, y) = (z[3] - z[2], z[0] + z[1]);
            let (vx, vy) = system.velocity(z);
            let (bx, by) = (
                -epsilon * wavenumber * (wavenumber * x).sin(),
                -epsilon * wavenumber * (wavenumber * y).sin(),
            );
            0.5 * (vx * vx + vy * vy) * (vx * by - vy * bx)
        };
        [
            of(&|z| system.magnetic_moment(z)),
            of(&|z| system.magnetic_moment(z) + gradient(z)),
            of(&|z| averaged_invariant(&system, z)),
        ]
    };
    let wavenumbers = [0.4, 0.2, 0.1];
    let found = wavenumbers.map(changes);
    let order = |which: usize| log_slope(&wavenumbers, &found.map(|changes| changes[which]));
    assert!((order(0) - 1.0).abs() < 0.2 && (order(1) - 2.0).abs() < 0.3, "{found:?}");
    let [first, second, averaged] = changes(1.0);
    assert!(second > 0.1 * first && averaged < 0.1 * first, "{first:e} {second:e} {averaged:e}");
}

/// ẋ = v, v̇ = Bv×e_z − ε∇φ, and the orders in ε of the magnetic moment.
#[test]
fn a_full_orbit_is_newtons_and_keeps_its_magnetic_moment() {
    let system = FullOrbit { epsilon: 0.3, wavenumber: 1.3, potential: 0.7 };
    for seed in 0..20 {
        let z = point(2, seed);
        let mut field = [0.0; 4];
        system.vector_field(&z, 0.0, &mut field);
        let along: Vec<_> =
            z.iter().zip(field).map(|(&re, rate)| Dual::<f64, 1> { re, eps: [rate] }).collect();
        let (vx, vy) = system.velocity(&along);
        let (x, y): (f64, f64) = (z[3] - z[2], z[0] + z[1]);
        assert!((field[3] - field[2] - vx.re).abs() < 1e-15);
        assert!((field[0] + field[1] - vy.re).abs() < 1e-15);
        let b = 1.0 + 0.3 * ((1.3 * x).cos() + (1.3 * y).cos());
        let force = 0.3 * 0.7 * 1.3;
        assert!((vx.eps[0] - (b * vy.re + force * (1.3 * x).sin())).abs() < 1e-14);
        assert!((vy.eps[0] - (-b * vx.re - force * (1.3 * y).cos())).abs() < 1e-14);
    }
    let epsilons = [0.04, 0.02, 0.01];
    let (mut first, mut second) = (Vec::new(), Vec::new());
    for epsilon in epsilons {
        let system = FullOrbit::new(epsilon);
        let z = [0.7, -0.4, 0.5, 0.6];
        let orbit =
            ReferenceTrajectories::of_flow(&system, &z, 0.05 / epsilon, 101).expect("moves");
        assert!(orbit.error < 1e-12, "{:e}", orbit.error);
        let of =
            |quantity: &dyn Fn(&[f64]) -> f64| drifts(&orbit.trajectories, quantity)[0].largest;
        first.push(of(&|z| system.magnetic_moment(z)));
        second.push(of(&|z| averaged_invariant(&system, z)));
    }
    let orders = [log_slope(&epsilons, &first), log_slope(&epsilons, &second)];
    assert!((orders[0] - 1.0).abs() < 0.2 && (orders[1] - 2.0).abs() < 0.3, "{orders:?}");
}

/// Both actions of a torus change by O(ε) where no harmonic of its frequencies is small; at 2ω₁ ≈ ω₂ they are
/// exchanged, and J₁ + 2J₂ alone stays.
#[test]
fn a_resonance_exchanges_the_actions_of_a_torus() {
    let changes = |epsilon: f64, frequency: f64| -> [f64; 3] {
        let system = ThreeOscillators { epsilon, frequency };
        let z = [0.9, 0.6, 0.5, 0.0, 0.3, 0.0];
        let orbit = ReferenceTrajectories::of_flow(&system, &z, 0.1 / epsilon, 301).expect("moves");
        assert!(orbit.error < 1e-11, "{:e}", orbit.error);
        let (torus, _) = system.torus();
        let of =
            |quantity: &dyn Fn(&[f64]) -> f64| drifts(&orbit.trajectories, quantity)[0].largest;
        let [first, second] = [0, 1].map(|k| of(&|z| torus.circles()[k].invariant(z)));
        [first, second, of(&|z| system.adiabatic_invariant(z))]
    };
    let epsilons = [0.02, 0.01, 0.005];
    let golden = ThreeOscillators::new(0.0).frequency;
    let free = epsilons.map(|epsilon| changes(epsilon, golden));
    for which in 0..2 {
        let slope = log_slope(&epsilons, &free.map(|changes| changes[which]));
        assert!((slope - 1.0).abs() < 0.2, "{which}: {slope}, {free:?}");
    }
    for epsilon in epsilons {
        let [first, second, both] = changes(epsilon, 2.0 + epsilon);
        // Beside the exchange each changes by O(ε).
        assert!((first - 2.0 * second).abs() < 3.0 * epsilon && both < 3.0 * epsilon);
        assert!(first > 0.05 && second > 0.025, "{first} {second} {both}");
    }
    let system = ThreeOscillators::new(0.1);
    assert_eq!(Counted::new(&system).torus(), system.torus());
    let (orbit, z) = (FullOrbit::new(0.1), point(2, 1));
    let known = Counted::new(&orbit).customary_invariant(&z);
    assert!(known.is_some() && known == orbit.customary_invariant(&z));
    let system = System::ThreeOscillators(ThreeOscillators { epsilon: 0.1, frequency: -1.0 });
    assert!(system.check().expect_err("no frequency").to_string().contains("system.frequency"));
}

/// A plane that turns at 1.7, twice as fast as its circle, and a slow one.
struct Quick {
    epsilon: f64,
}

impl Hamiltonian for Quick {
    fn dof(&self) -> usize {
        2
    }
    fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
        let constant = S::from_f64;
        let fast = constant(0.85) * (z[0] * z[0] + z[2] * z[2]);
        let slow = constant(0.5) * z[3] * z[3] + (z[0] + z[1]).sin_cos().1 * (constant(1.0) + z[2]);
        fast + constant(self.epsilon) * slow
    }
}

impl NearlyPeriodic for Quick {
    fn epsilon(&self) -> f64 {
        self.epsilon
    }
    fn circle_action(&self) -> CircleAction {
        CircleAction::new([2, 0])
    }
    fn limiting_frequency(&self) -> f64 {
        0.85
    }
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S {
        z[0] * z[0] + z[2] * z[2]
    }
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S) {
        let (s, c) = (S::from_f64(1.7) * time).sin_cos();
        (z[0], z[2]) = (c * z[0] + s * z[2], c * z[2] - s * z[0]);
    }
}

/// μ₀ + εμ₁ is within O(ε) of μ₀, and ε²μ₂ beside it of O(ε²), in size and not only in order.
#[test]
fn averaged_invariants_are_near_that_of_the_limit() {
    fn terms(system: &impl NearlyPeriodic, z: &[f64]) -> [f64; 3] {
        let leading = system.adiabatic_invariant(z);
        let (first, second) = (averaged_invariant(system, z), second_averaged_invariant(system, z));
        [leading, (first - leading).abs(), (second - first).abs()]
    }
    let epsilon = 1e-3;
    for [leading, first, second] in [
        terms(&Oscillators { epsilon }, &[0.9, 0.5, 0.0, 0.1]),
        terms(&FullOrbit::new(epsilon), &[0.7, -0.4, 0.5, 0.6]),
        terms(&CellularDrift::new(epsilon), &[0.6, 1.0, 0.3, 0.8]),
    ] {
        assert!(leading > 0.1, "{leading}");
        assert!(first > 1e-3 * epsilon && first < 2.0 * epsilon, "{first:e}");
        assert!(
            second > 1e-3 * epsilon * epsilon && second < 100.0 * epsilon * epsilon,
            "{second:e}"
        );
    }
}

/// To first order in ε μ₀ changes, to second and third what averaging makes of it.
#[test]
fn averaging_gains_orders() {
    fn changes<H: NearlyPeriodic + Sync>(system: &H, z: &[f64]) -> [f64; 3] {
        let time = 2.0 / system.epsilon();
        let states = 200;
        let along = ReferenceTrajectories::of_flow(system, z, time / 199.0, states)
            .expect("converges")
            .trajectories;
        let change = |of: &dyn Fn(&[f64]) -> f64| drifts(&along, of)[0].largest;
        [
            change(&|z| system.adiabatic_invariant(z)),
            change(&|z| averaged_invariant(system, z)),
            change(&|z| second_averaged_invariant(system, z)),
        ]
    }
    let epsilons = [0.02, 0.01];
    let oscillators = |epsilon| changes(&Oscillators { epsilon }, &[0.9, 0.5, 0.0, 0.1]);
    let modes = |epsilon| {
        let z = [-1.0, 0.3, 0.2, 0.8, 0.3, 0.5];
        changes(&ParticleField::two_modes(epsilon), &z)
    };
    let particle = |epsilon| changes(&FullOrbit::new(epsilon), &[0.7, -0.4, 0.5, 0.6]);
    let cells = |epsilon| changes(&CellularDrift::new(epsilon), &[0.6, 1.0, 0.3, 0.8]);
    let quick = |epsilon| changes(&Quick { epsilon }, &[0.6, 0.4, 0.3, 0.5]);
    for (name, found) in [
        ("oscillators", epsilons.map(oscillators)),
        ("modes", epsilons.map(modes)),
        ("particle", epsilons.map(particle)),
        ("cells", epsilons.map(cells)),
        ("another frequency, a weight of 2", epsilons.map(quick)),
    ] {
        let orders = [0, 1, 2].map(|k| (found[0][k] / found[1][k]).log2());
        for (k, order) in orders.into_iter().enumerate() {
            assert!((order - (k + 1) as f64).abs() < 0.3, "{name}: {orders:?}, {found:?}");
        }
        assert!(found[1][1] < 0.1 * found[1][0], "{name}: {found:?}");
        assert!(found[1][2] < 0.1 * found[1][1] && found[1][2] > 1e-11, "{name}: {found:?}");
    }
}

/// Over half of the slow time, whatever ε is, at ten phases of the fast angle. Three angles do not see
/// the averages.
#[test]
fn averaged_equations_have_their_orders() {
    // At whole periods what the second order leaves out of the coordinates would cancel.
    let intervals = [2.3, 4.3, 8.3, 16.3, 32.3].map(|periods| periods * TAU);
    let epsilons = intervals.map(|interval| 0.05 / interval);
    let interval = |epsilon: f64| 0.05 / epsilon;
    type Of = fn(f64) -> System;
    let of: [Of; 4] = [
        |epsilon| System::Oscillators(Oscillators { epsilon }),
        |epsilon| System::FullOrbit(FullOrbit::new(epsilon)),
        |epsilon| System::CellularDrift(CellularDrift { epsilon, wavenumber: 1.3 }),
        |epsilon| System::VanDerPol(VanDerPol::new(epsilon)),
    ];
    for system in of {
        let z: Vec<f64> = (0..8).flat_map(|seed| point(2, seed)).collect();
        splittings_of_the_average_have_their_orders(&system(0.02), &z);
        let exact = epsilons.map(|epsilon| {
            let (system, time) = (system(epsilon), interval(epsilon));
            Integrator::Aba1064.trajectories(&system, &z, time, (8.0 * time) as usize, 10)
        });
        let errors = |order: usize, angles: usize, closed: bool| -> Vec<f64> {
            let found = |(epsilon, exact): (f64, &Vec<f64>)| {
                let by = Integrator::Averaged(AveragedSettings { order, angles, closed, by: None });
                let found = by.trajectories(&system(epsilon), &z, interval(epsilon), 16, 10);
                let squares = found.expect("integrates").into_iter().zip(exact);
                squares.map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
            };
            let exact = exact.iter().map(|exact| exact.as_ref().expect("integrates"));
            epsilons.into_iter().zip(exact).map(found).collect()
        };
        let name = system(0.0).kind();
        for order in [1, 2] {
            let of = format!("{name}, order {order}");
            assert_order(&of, order as f64, &epsilons, &errors(order, 32, false));
            // The self-excited oscillator has few harmonics.
            let seen =
                system(0.1).dissipates() || log_slope(&epsilons, &errors(order, 3, false)) < 0.5;
            assert!(seen, "{of}: nothing is seen");
        }
        assert_order(&format!("{name}, closed"), 2.0, &epsilons, &errors(2, 32, true));
        // States that are kept on the way do not change where it goes.
        let (system, by) = (
            system(0.002),
            Integrator::Averaged(AveragedSettings {
                order: 2,
                angles: 32,
                closed: false,
                by: None,
            }),
        );
        let at_once = by.trajectories(&system, &z, 100.0, 40, 1).expect("integrates");
        let in_turn = by.trajectories(&system, &z, 2.5, 1, 40).expect("integrates");
        let apart = distance(&in_turn[39 * z.len()..], &at_once);
        assert!(apart < 1e-9, "{name}: {apart:e}");
        // A closed form is what the angles average; that keeps the action, they do to the order of the steps.
        let closed =
            Integrator::Averaged(AveragedSettings { order: 1, angles: 32, closed: true, by: None });
        closed.check_for(&system).expect("has a closed form");
        let by_angles = AveragedSettings { order: 1, angles: 32, closed: false, by: None };
        let by_angles = Integrator::Averaged(by_angles);
        let unlike = FullOrbit { epsilon: 0.002, wavenumber: 1.3, potential: 0.7 };
        let full_orbit = matches!(system, System::FullOrbit(_));
        let unlike = full_orbit.then_some(System::FullOrbit(unlike));
        for system in [system].into_iter().chain(unlike) {
            let [closed, by_angles] = [&closed, &by_angles]
                .map(|by| by.trajectories(&system, &z, 300.0, 400, 1).expect("integrates"));
            let apart = distance(&closed, &by_angles);
            assert!(apart < 1e-12, "{name}: {apart:e}");
        }
    }
    // Another frequency, and a weight of 2.
    let intervals = intervals.map(|interval| interval / 1.7);
    for order in [1, 2] {
        let errors = intervals.map(|interval| {
            let system = Quick { epsilon: 0.05 / interval };
            let by = Averaged::new(&system, interval, 32, order);
            let (mut found, mut sum) = (point(2, 3), 0.0);
            let mut exact = found.clone();
            let reference = Reference::calibrated(&system, &exact, interval).expect("converges");
            for _ in 0..10 {
                by.take(&system, &mut found, 16);
                reference.flow(&system, &mut exact, interval).expect("converges");
                sum += found.iter().zip(&exact).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
            }
            sum.sqrt()
        });
        let epsilons = intervals.map(|interval| 0.05 / interval);
        assert_order(&format!("quick, order {order}"), order as f64, &epsilons, &errors);
    }
    let averaged =
        Integrator::Averaged(AveragedSettings { order: 1, angles: 8, closed: false, by: None });
    let refused = |system: System| averaged.check_for(&system).expect_err("refused").to_string();
    let modes = refused(System::ThreeOscillators(ThreeOscillators::new(0.01)));
    assert!(modes.contains("averaged equation of order 1"), "{modes}");
    let many = refused(System::ParticleField(particle(0.01, 4)));
    assert!(many.contains("found 5") && many.contains("4 degrees of freedom or fewer"), "{many}");
    assert!(
        Integrator::Averaged(AveragedSettings { order: 3, angles: 8, closed: false, by: None })
            .check()
            .is_err()
    );
    assert!(
        Integrator::Averaged(AveragedSettings { order: 1, angles: 2, closed: false, by: None })
            .check()
            .is_err()
    );
    let closed =
        Integrator::Averaged(AveragedSettings { order: 2, angles: 8, closed: true, by: None });
    closed.check().expect("of some systems");
    let said = closed.check_for(&System::ParticleField(particle(0.01, 2)));
    let said = said.expect_err("no closed form").to_string();
    assert!(said.contains("closed form"), "{said}");
}

/// The closed averages over a time of 100 by splittings, beside Runge–Kutta steps, and by one with a wrong coefficient.
fn splittings_of_the_average_have_their_orders(system: &System, z: &[f64]) {
    let settings = AveragedSettings { order: 1, angles: 32, closed: true, by: None };
    if system.average_split().is_none() {
        let by = AveragedSettings { by: Some(MicroSteps::Strang), ..settings };
        assert!(Integrator::Averaged(by).check_for(system).is_err(), "{}", system.kind());
        return;
    }
    let of = |by: AveragedSettings, count: usize| {
        let by = Integrator::Averaged(by);
        by.check_for(system).expect("is split");
        by.trajectories(system, z, 100.0, count, 1).expect("integrates")
    };
    let counts = [12, 16, 20, 24, 32];
    let steps = counts.map(|count| 100.0 / count as f64);
    for settings in [settings, AveragedSettings { order: 2, ..settings }] {
        let exact = of(settings, 20_000);
        for (by, order) in [(MicroSteps::Strang, 2.0), (MicroSteps::Aba1064, 4.0)] {
            let by = AveragedSettings { by: Some(by), ..settings };
            let errors = counts.map(|count| distance(&of(by, count), &exact));
            let name = format!("{}, {}", system.kind(), Integrator::Averaged(by).name());
            // What joins both parts is of second order in ε, and taken as by Strang: it shows in small steps only.
            if settings.order == 2 && system.average_has_cross() {
                let slope = log_slope(&steps, &errors);
                assert!(slope > 1.8, "{name}: {slope} of {errors:?}");
            } else {
                assert_order(&name, order, &steps, &errors);
            }
            assert!(errors[4] < 0.02, "{name}: {errors:?}");
        }
    }
    let exact = of(settings, 20_000);
    let System::Oscillators(own) = system else { return };
    let wrong = Splitting { b: &[0.99], ..Splitting::STRANG };
    let errors = counts.map(|count| {
        let by =
            Averaged::new(own, 100.0, 32, 1).split_by(own, wrong, count).expect("of two parts");
        let mut found = z.to_vec();
        by.take(own, &mut found, count);
        distance(&found, &exact)
    });
    assert!(!has_order(2.0, &steps, &errors), "a wrong kick: {errors:?}");
}

/// The limit of a particle in its field turns planes in coordinates of the momenta Π: of the paper's profiles. The
/// closed form is what the angles average there; where planes of P are taken for those of Π there is no order.
#[test]
fn averaged_equations_of_a_particle_in_its_field_have_their_orders() {
    let intervals = [2.3, 4.3, 8.3, 16.3, 32.3].map(|periods| periods * TAU);
    let epsilons = intervals.map(|interval| 0.05 / interval);
    let z: Vec<f64> = (0..8).flat_map(|seed| point(3, seed)).collect();
    let two_modes =
        |interval: f64| System::ParticleField(ParticleField::two_modes(0.05 / interval));
    let exact = intervals.map(|interval| {
        let steps = (8.0 * interval) as usize;
        Integrator::Aba1064
            .trajectories(&two_modes(interval), &z, interval, steps, 10)
            .expect("integrates")
    });
    let slope_of = |by: Integrator| {
        let of = |(interval, exact): (f64, &Vec<f64>)| {
            let found = by.trajectories(&two_modes(interval), &z, interval, 16, 10);
            distance(&found.expect("integrates"), exact)
        };
        intervals.into_iter().zip(&exact).map(of).collect::<Vec<f64>>()
    };
    for (order, closed) in [(1, false), (1, true), (2, false)] {
        let errors = slope_of(Integrator::Averaged(AveragedSettings {
            order,
            angles: 32,
            closed,
            by: None,
        }));
        assert_order(&format!("order {order}, closed: {closed}"), order as f64, &epsilons, &errors);
    }
    // In coordinates whose planes the limit does not turn there is nothing to average.
    let wrong = intervals.into_iter().zip(&exact).map(|(interval, exact)| {
        let system = ParticleField::two_modes(0.05 / interval);
        let by = Averaged::new(&system, interval, 32, 1);
        let mut found = z.clone();
        for z in found.chunks_exact_mut(6) {
            by.take(&system, z, 16);
        }
        distance(&found, &exact[..z.len()])
    });
    let wrong: Vec<f64> = wrong.collect();
    let slope = log_slope(&epsilons, &wrong);
    assert!(wrong.iter().all(|error| error.is_finite()) && slope < 0.5, "{slope} {wrong:?}");
    // Of the profiles the closed form is carried along by what enters those coordinates.
    let system = ParticleField::two_modes(0.02);
    let z = point(3, 5);
    let mut field = vec![0.0; 6];
    system.averaged_field(&z, &AverageConstants::zero(), &mut field);
    let entered = |step: f64| {
        let mut moved: Vec<f64> = z.iter().zip(&field).map(|(z, v)| z + step * v).collect();
        Splittable::enter(&system, &mut moved);
        moved
    };
    let mut own = vec![0.0; 6];
    system.without_profiles().averaged_field(&entered(0.0), &AverageConstants::zero(), &mut own);
    let (behind, ahead) = (entered(-1e-3), entered(1e-3));
    let carried: Vec<f64> = ahead.iter().zip(&behind).map(|(a, b)| (a - b) / 2e-3).collect();
    assert!(distance(&carried, &own) < 1e-9, "{carried:?} {own:?}");
    let [closed, by_angles] = [true, false].map(|closed| {
        let by = Integrator::Averaged(AveragedSettings { order: 1, angles: 32, closed, by: None });
        by.trajectories(&two_modes(25.0), &z, 300.0, 400, 1).expect("integrates")
    });
    let apart = distance(&closed, &by_angles);
    assert!(apart < 1e-12, "{apart:e}");
}

/// By the trapezoidal rule on the circle, which [`averaged_invariant`] has it from.
#[test]
fn the_average_of_a_cellular_potential_is_a_product() {
    for wavenumber in [0.5, 1.0, 1.7] {
        let system = CellularDrift { epsilon: 0.3, wavenumber };
        for seed in 0..20 {
            let z: [f64; 4] = point(2, seed).try_into().expect("four numbers");
            let average = system.energy(&z, 0.0) - averaged_invariant(&system, &z);
            assert!((system.averaged(&z) - average).abs() < 1e-14, "{average} at {z:?}");
            // A product f(Y)g(X) has 2 × 2 minors of 0.
            let [px, y, py, x] = z;
            let at = |y: f64, x: f64| system.averaged(&[px, y, py, x]);
            let product = at(y, x) * at(y + 1.0, x + 1.0) - at(y, x + 1.0) * at(y + 1.0, x);
            assert!(product.abs() < 1e-15, "{product:e}");
        }
    }
    let none = System::CellularDrift(CellularDrift { epsilon: 0.1, wavenumber: 0.0 });
    assert!(none.check().expect_err("no waves").to_string().contains("system.wavenumber"));
}

#[test]
fn the_averaged_energy_is_the_average() {
    // ⟨U⟩ over the fast phase by the trapezoidal rule, exact for smooth
    // periodic integrands.
    for (radius, q2) in [(1.5, 0.7), (0.4, -1.2), (2.0, 1.55)] {
        let count = 200;
        let mean = (0..count)
            .map(|k| {
                let phase = std::f64::consts::TAU * f64::from(k) / f64::from(count);
                Oscillators::coupling(radius * phase.cos(), q2)
            })
            .sum::<f64>()
            / f64::from(count);
        let p2 = 0.3;
        let expected = 0.5 * (q2 * q2 + p2 * p2) + mean;
        let averaged = AveragedOscillator::new(radius).energy(&[q2, p2], 0.0);
        assert!((averaged - expected).abs() < 2e-15, "{averaged} for {expected}");
    }
}

#[test]
fn the_slow_plane_follows_the_averaged_energy() {
    let energies: Vec<f64> = [4e-3, 2e-3, 1e-3]
        .iter()
        .map(|&epsilon| {
            let system = Oscillators { epsilon };
            let averaged = AveragedOscillator::new(1.5);
            let mut z = vec![1.5, 0.3, 0.0, 0.0];
            let reference = Reference::new(&system, &z);
            let start = averaged.energy(&[z[1], z[3]], 0.0);
            let mut largest = 0.0_f64;
            for _ in 0..100 {
                reference.flow(&system, &mut z, 0.01 / epsilon).expect("converges");
                let drift = (averaged.energy(&[z[1], z[3]], 0.0) - start).abs();
                largest = max_or_nan(largest, drift);
            }
            largest
        })
        .collect();
    let slope = log_slope(&[4e-3, 2e-3, 1e-3], &energies);
    assert!((slope - 1.0).abs() < 0.3, "{slope}, {energies:?}");
}

#[test]
fn far_out_the_gaussian_profile_is_zero() {
    let profile = FieldProfile::Gaussian { amplitude: 0.5, rate: 5.0 };
    for x in [12.3, -40.0, 1e200, f64::INFINITY] {
        assert_eq!(profile.value_and_slope::<f64>(x), (0.0, 0.0));
    }
    let (value, slope) = profile.value_and_slope::<f64>(0.3);
    assert!((value - 0.5 * (-0.45_f64).exp()).abs() < 1e-16);
    assert!((slope + 3.0 * value).abs() < 1e-15);
}

/// Many trajectories, in the order (T, M, 2n), against each method called alone.
#[test]
fn trajectories_are_those_of_the_methods_bit_for_bit() {
    for system in systems(0.1) {
        let dim = 2 * system.dof();
        // One group of lanes, some with the last one not full, some that are.
        for count in [1, 7, 29, 40] {
            let initial: Vec<f64> = (0..count).flat_map(|k| point(system.dof(), k)).collect();
            for (integrator, splitting, steps) in [
                (Integrator::RungeKutta4, None, 9),
                (Integrator::Strang, Some(Splitting::STRANG), 5),
                (Integrator::Yoshida4, Some(Splitting::YOSHIDA_4), 4),
                (Integrator::Aba864, Some(Splitting::ABA_864), 1),
                (Integrator::Aba1064, Some(Splitting::ABA_1064), 2),
                (Integrator::GaussLegendre(GaussLegendreSettings { stages: 5 }), None, 3),
            ] {
                let states =
                    integrator.trajectories(&system, &initial, 0.7, steps, 3).expect("converges");
                assert_eq!(states.len(), 3 * initial.len());
                for (m, start) in initial.chunks_exact(dim).enumerate() {
                    let mut z = start.to_vec();
                    for t in 0..3 {
                        match (integrator, splitting) {
                            (_, Some(method)) => {
                                split!(system, s => method.integrate(s, &mut z, 0.7, steps))
                            }
                            (Integrator::GaussLegendre(GaussLegendreSettings { stages }), _) => {
                                GaussLegendre::new(stages)
                                    .integrate(&system, &mut z, 0.7, steps)
                                    .expect("converges")
                            }
                            _ => runge_kutta_4(&system, &mut z, 0.7, steps),
                        }
                        let first = t * initial.len() + m * dim;
                        assert_eq!(&states[first..first + dim], &z[..], "{}", integrator.name());
                    }
                }
            }
        }
        let gauss = Integrator::GaussLegendre(GaussLegendreSettings { stages: 2 });
        assert!(gauss.trajectories(&system, &point(system.dof(), 1), 1e6, 1, 1).is_err());
        assert!(Integrator::Strang.trajectories(&system, &[0.0; 3], 1.0, 1, 1).is_err());
        assert!(Integrator::Strang.trajectories(&system, &[], 1.0, 1, 1).expect("none").is_empty());
    }
}

/// The equations of motion, written out once more, and what they say of volumes: the flow's Jacobian has
/// the determinant e^∫div.
#[test]
fn the_self_excited_oscillator_is_its_equations() {
    let (epsilon, damping) = (0.07, 0.2);
    let system = VanDerPol { epsilon, damping };
    let [q1, q2, p1, p2]: [f64; 4] = [0.9, -0.4, 1.3, 0.6];
    let mut field = [0.0; 4];
    system.vector_field(&[q1, q2, p1, p2], 0.0, &mut field);
    let expected = [
        p1,
        epsilon * p2,
        -q1 + epsilon * (1.0 - q1 * q1 - q2) * p1,
        epsilon * (0.5 * q1 * q1 - q2 - damping * p2),
    ];
    assert!(distance(&field, &expected) < 1e-15);

    type D = Dual<f64, 4>;
    let (steps, interval) = (400, 0.05);
    let lifted = [q1, q2, p1, p2].into_iter().enumerate().map(|(i, v)| D::variable(v, i));
    let mut z: Vec<D> = lifted.collect();
    let split = Splitting::ABA_1064.steps::<f64>(&system, interval);
    // Simpson's rule, on steps in pairs.
    let rate = |z: &[D]| {
        let point: Vec<f64> = z.iter().map(|v| v.re).collect();
        let found = divergence(&system, &point, 0.0);
        let expected = epsilon * (1.0 - point[0] * point[0] - point[1] - damping);
        assert!((found - expected).abs() < 1e-16, "{found} {expected}");
        found
    };
    let mut growth = rate(&z);
    for step in 1..=steps {
        split.take(&system, &mut z, 1);
        let weight = if step == steps { 1.0 } else { 2.0 + 2.0 * f64::from(step % 2) };
        growth += weight * rate(&z);
    }
    growth *= interval / 3.0;
    let volume = faer::Mat::from_fn(4, 4, |i, k| z[i].eps[k]).determinant();
    assert!((volume.ln() - growth).abs() < 1e-7, "{} {growth}", volume.ln());
    assert!(growth.abs() > 0.1);

    // The formula of the exact flow without damping is the limit of that with damping.
    let of = |damping: f64| {
        let mut z = [q1, q2, p1, p2];
        VanDerPol { epsilon, damping }.flow_b(&mut z, 0.8);
        z
    };
    assert!(distance(&of(0.0), &of(1e-12)) < 1e-13);
    assert!(System::VanDerPol(VanDerPol { epsilon, damping: -1.0 }).check().is_err());
    assert!(System::VanDerPol(VanDerPol { epsilon, damping: f64::NAN }).check().is_err());
}

/// Over times of 1/ε the fast action follows the averaged equations, whose torus of γ = 0.3 all trajectories
/// come to, with errors of order ε.
#[test]
fn the_self_excited_oscillator_follows_its_averaged_equations() {
    /// J′ = J(1 − ½J − x), x′ = y, y′ = −x − γy + ½J in slow time.
    struct Averaged(f64);
    impl Averaged {
        fn slope(&self, [j, x, y]: [f64; 3]) -> [f64; 3] {
            [j * (1.0 - 0.5 * j - x), y, 0.5 * j - x - self.0 * y]
        }
        fn flow(&self, mut s: [f64; 3], time: f64, steps: usize) -> [f64; 3] {
            let h = time / steps as f64;
            let beside =
                |s: [f64; 3], by: f64, k: [f64; 3]| std::array::from_fn(|i| k[i].mul_add(by, s[i]));
            for _ in 0..steps {
                let a = self.slope(s);
                let b = self.slope(beside(s, 0.5 * h, a));
                let c = self.slope(beside(s, 0.5 * h, b));
                let d = self.slope(beside(s, h, c));
                for i in 0..3 {
                    s[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
                }
            }
            s
        }
    }
    let z: [f64; 4] = [1.2, 0.3, -0.4, 0.5];
    let slow_time = 8.0;
    let start = [0.5 * (z[0] * z[0] + z[2] * z[2]), z[1], z[3]];
    let averaged = Averaged(0.3).flow(start, slow_time, 4000);
    // Of whole turns, so that the fast angle of the error is the same in all.
    let epsilons = [32.0, 64.0, 128.0, 256.0].map(|turns| slow_time / (TAU * turns));
    let errors = epsilons.map(|epsilon| {
        let system = VanDerPol::new(epsilon);
        let mut w = z;
        let time = slow_time / epsilon;
        Splitting::ABA_1064.integrate(&system, &mut w, time, (time / 0.2) as usize);
        distance(&[system.adiabatic_invariant(&w), w[1], w[3]], &averaged)
    });
    assert_order("averaging", 1.0, &epsilons, &errors);
    let swing = |damping: f64| {
        let (mut low, mut high) = (f64::INFINITY, 0.0);
        let mut s = Averaged(damping).flow(start, 6000.0, 300_000);
        for _ in 0..400 {
            s = Averaged(damping).flow(s, 0.05, 10);
            (low, high) = (f64::min(low, s[0]), f64::max(high, s[0]));
        }
        (low, high)
    };
    let (low, high) = swing(0.3);
    assert!((low - 0.131).abs() < 1e-3 && (high - 2.72).abs() < 1e-2, "{low} {high}");
    // The circle loses its stability at ¼(√41 − 5) = 0.3508.
    let (low, high) = swing(0.345);
    assert!(high - low > 0.2, "{low} {high}");
    let (low, high) = swing(0.357);
    assert!(high - low < 1e-3 && (high - 1.0).abs() < 1e-3, "{low} {high}");
}

/// The system over ε, without its limit, turned by an angle, and its gradient.
fn turned_perturbation(system: &impl NearlyPeriodic, z: &[f64; 4], angle: f64) -> (f64, [f64; 4]) {
    let dual: Vec<Dual<f64, 4>> =
        z.iter().enumerate().map(|(k, z)| Dual::variable(*z, k)).collect();
    let (sin, cos) = libm::sincos(angle);
    let (sin, cos) = (constant::<Dual<f64, 4>>(sin), constant::<Dual<f64, 4>>(cos));
    let mut at = dual.clone();
    (at[0], at[2]) = (cos * dual[0] + sin * dual[2], cos * dual[2] - sin * dual[0]);
    let limit = system.adiabatic_invariant(&at) * constant(system.limiting_frequency());
    let value = (system.energy(&at, 0.0) - limit) * constant(1.0 / system.epsilon());
    (value.re, value.eps)
}

/// −½⟨{S, H̃₁}⟩/ε² at a point, by definition: S is the integral of H̃₁ by the angle, from its values at 64 angles.
fn second_order_by_quadrature(system: &impl NearlyPeriodic, z: &[f64; 4]) -> f64 {
    const ANGLES: usize = 64;
    let share = |k: usize| TAU * k as f64 / ANGLES as f64;
    let gradients: Vec<[f64; 4]> =
        (0..ANGLES).map(|k| turned_perturbation(system, z, share(k)).1).collect();
    let mean: [f64; 4] = std::array::from_fn(|i| {
        gradients.iter().map(|gradient| gradient[i]).sum::<f64>() / ANGLES as f64
    });
    let mut total = 0.0;
    for k in 0..ANGLES {
        // Of sin mφ the integral is −cos mφ/m, of cos mφ it is sin mφ/m.
        let mut integral = [0.0; 4];
        for (l, gradient) in gradients.iter().enumerate() {
            let weight = (1..ANGLES / 2)
                .map(|m| libm::sin(share((m * (k + ANGLES - l)) % ANGLES)) / m as f64);
            let weight = 2.0 * weight.sum::<f64>() / ANGLES as f64;
            for i in 0..4 {
                integral[i] += weight * gradient[i] / system.limiting_frequency();
            }
        }
        for j in 0..2 {
            let own = [gradients[k][j] - mean[j], gradients[k][2 + j] - mean[2 + j]];
            total += integral[j] * own[1] - integral[2 + j] * own[0];
        }
    }
    -0.5 * total / ANGLES as f64
}

fn closed_average_is_its_definition(system: &impl NearlyPeriodic, name: &str) {
    let epsilon = system.epsilon();
    for (number, radius) in [0.0, 1e-7, 0.3, 1.1, 1.9].into_iter().enumerate() {
        let (sin, cos) = libm::sincos(0.7 + number as f64);
        let z = [radius * cos, 0.4 - 0.3 * number as f64, radius * sin, 0.9 - 0.2 * number as f64];
        let field = |order: usize| {
            let constants = system.average_constants(&z, order).expect("closed");
            let mut out = [0.0; 4];
            system.averaged_field(&z, &constants, &mut out);
            out
        };
        let (first, second) = (field(1), field(2));
        let step = 1e-4;
        for k in [0, 1, 2, 3] {
            let at = |step: f64| {
                let mut moved = z;
                moved[k] += step;
                second_order_by_quadrature(system, &moved)
            };
            let slope = (at(step) - at(-step)) / (2.0 * step);
            // dq/dt = ∂K/∂p and dp/dt = −∂K/∂q.
            let (component, sign) = if k < 2 { (k + 2, -1.0) } else { (k - 2, 1.0) };
            let found = (second[component] - first[component]) / (epsilon * epsilon);
            let apart = (found - sign * slope).abs();
            assert!(apart < 2e-5, "{name}, radius {radius}, component {component}: {apart:e}");
        }
    }
}

/// Of wavenumbers and amplitudes other than 1 too.
#[test]
fn closed_averages_of_second_order_are_their_definition() {
    let epsilon = 1e-6;
    closed_average_is_its_definition(&Oscillators { epsilon }, "oscillators");
    let particle = FullOrbit { epsilon, wavenumber: 1.3, potential: 0.7 };
    closed_average_is_its_definition(&particle, "particle");
    closed_average_is_its_definition(&CellularDrift { epsilon, wavenumber: 1.4 }, "cells");
    // A mutant: the potential of another amplitude in the closed form alone.
    let wrong = std::panic::catch_unwind(|| {
        closed_average_is_its_definition(&OtherAverage(particle), "a mutant");
    });
    let said = wrong.expect_err("rejected");
    let said = said.downcast_ref::<String>().expect("a message");
    assert!(said.contains("a mutant, radius"), "{said}");
}

/// ⟨f⟩ and ⟨Df·u⟩ by 64 angles, where f is the field minus that of the limit in coordinates that turn with it, and u
/// the integral of f − ⟨f⟩ by the angle, with average 0: of a system at ε = 1 with frequency 1, whose f is linear in ε.
fn averages_of_field(system: &impl NearlyPeriodic, z: &[f64]) -> [Vec<f64>; 2] {
    const ANGLES: usize = 64;
    let angle = |k: usize| TAU * k as f64 / ANGLES as f64;
    let field = |w: &[f64], k: usize| {
        let mut at: Vec<Dual<f64, 1>> = w.iter().map(|v| Dual::constant(*v)).collect();
        system.limiting_flow(&mut at, Dual::variable(angle(k), 0));
        let turned: Vec<f64> = at.iter().map(|v| v.re).collect();
        let mut out = vec![0.0; w.len()];
        system.vector_field(&turned, 0.0, &mut out);
        out.iter_mut().zip(&at).for_each(|(out, at)| *out -= at.eps[0]);
        // Turns are linear.
        system.limiting_flow(&mut out, -angle(k));
        out
    };
    let fields: Vec<Vec<f64>> = (0..ANGLES).map(|k| field(z, k)).collect();
    let (mut mean, mut total) = (vec![0.0; z.len()], vec![0.0; z.len()]);
    for k in 0..ANGLES {
        mean.iter_mut().zip(&fields[k]).for_each(|(mean, f)| *mean += f / ANGLES as f64);
        // u = Σ_m (sin mφ ∗ f)/m: its harmonics one by one.
        let u: Vec<f64> = (0..z.len())
            .map(|i| {
                let of = |m: usize| {
                    let part =
                        |j: usize| libm::sin(m as f64 * (angle(k) - angle(j))) * fields[j][i];
                    2.0 / (ANGLES * m) as f64 * (0..ANGLES).map(part).sum::<f64>()
                };
                (1..ANGLES / 2).map(of).sum()
            })
            .collect();
        let moved = |step: f64| {
            let w: Vec<f64> = z.iter().zip(&u).map(|(z, u)| z + step * u).collect();
            field(&w, k)
        };
        let (ahead, behind) = (moved(1e-4), moved(-1e-4));
        for i in 0..z.len() {
            total[i] += (ahead[i] - behind[i]) / 2e-4 / ANGLES as f64;
        }
    }
    [mean, total]
}

/// Of a system that is not Hamiltonian, by the definition for vector fields; and van der Pol's frequency.
#[test]
fn the_closed_average_of_a_self_excited_oscillator_is_its_definition() {
    let system = VanDerPol { epsilon: 1.0, damping: 0.7 };
    let closed = |z: &[f64], order: usize| {
        let constants = system.average_constants(z, order).expect("closed");
        let mut out = vec![0.0; 4];
        system.averaged_field(z, &constants, &mut out);
        out
    };
    let mut largest = [0.0; 2];
    for seed in 0..6 {
        let z = point(2, seed);
        let first = closed(&z, 1);
        let second = closed(&z, 2).iter().zip(&first).map(|(both, first)| both - first).collect();
        let expected = averages_of_field(&system, &z);
        // Quadrature of the first is exact, differences of the second are not.
        let closeness = [1e-13, 1e-6];
        for (order, closed) in [first, second].into_iter().enumerate() {
            let (expected, close) = (&expected[order], closeness[order]);
            assert!(distance(&closed, expected) < close, "{order}: {closed:?} for {expected:?}");
            let size = distance(expected, &[0.0; 4]);
            largest[order] = max_or_nan(largest[order], size);
            // A mutant: its coefficients are off by a hundredth.
            let wrong: Vec<f64> = closed.iter().map(|v| 1.01 * v).collect();
            assert!(size < 1e-3 || !(distance(&wrong, expected) < close), "{wrong:?}");
        }
    }
    assert!(largest.iter().all(|size| *size > 0.01), "an order is nearly 0: {largest:?}");
    // On the cycle of radius 2 the frequency is 1 − ε²/16.
    let turn = closed(&[2.0, 0.0, 0.0, 0.0], 2)[2];
    assert!((turn - 2.0 / 16.0).abs() < 1e-15, "{turn}");
}

/// A particle whose closed average is that of a potential a hundredth stronger.
struct OtherAverage(FullOrbit);

impl Hamiltonian for OtherAverage {
    fn dof(&self) -> usize {
        2
    }
    fn energy<S: Elementary>(&self, z: &[S], time: f64) -> S {
        self.0.energy(z, time)
    }
}

impl NearlyPeriodic for OtherAverage {
    fn epsilon(&self) -> f64 {
        self.0.epsilon
    }
    fn circle_action(&self) -> CircleAction {
        self.0.circle_action()
    }
    fn limiting_frequency(&self) -> f64 {
        1.0
    }
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S {
        self.0.adiabatic_invariant(z)
    }
    fn average_constants<S: Elementary>(
        &self,
        z: &[S],
        order: usize,
    ) -> Option<AverageConstants<S>> {
        FullOrbit { potential: 1.01 * self.0.potential, ..self.0 }.average_constants(z, order)
    }
    fn averaged_field<S: Elementary>(
        &self,
        z: &[S],
        constants: &AverageConstants<S>,
        out: &mut [S],
    ) {
        self.0.averaged_field(z, constants, out);
    }
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S) {
        self.0.limiting_flow(z, time);
    }
}

/// Constants of first order are Bessel functions of the radius; beyond what the points of a circle resolve they are
/// NaN.
#[test]
fn closed_averages_are_of_bessel_functions() {
    let first = |system: &dyn Fn(&[f64], usize) -> Option<AverageConstants>, radius: f64| {
        system(&[0.6 * radius, 0.2, 0.8 * radius, 0.3], 1).expect("closed").first
    };
    let near = |found: f64, expected: f64| (found - expected).abs() < 2e-12;
    for radius in [0.0, 0.01, 0.7, 2.2, 4.9] {
        let own = |z: &[f64], order| Oscillators { epsilon: 0.1 }.average_constants(z, order);
        let [c, slope, ..] = first(&own, radius);
        assert!(near(c, radius * libm::j1(2.0 * radius)), "{radius}: {c}");
        assert!(near(slope, 2.0 * libm::j0(2.0 * radius)), "{radius}: {slope}");
        let own = |z: &[f64], order| FullOrbit::new(0.1).average_constants(z, order);
        let [j0, j1, of_double, _] = first(&own, radius);
        assert!(near(j0, libm::j0(radius)) && near(radius * j1, libm::j1(radius)), "{radius}");
        assert!(near(of_double, libm::j0(2.0 * radius)), "{radius}");
        let own = |z: &[f64], order| CellularDrift::new(0.1).average_constants(z, order);
        let [bessel, ..] = first(&own, radius);
        assert!(near(bessel, libm::j0(std::f64::consts::SQRT_2 * radius)), "{radius}: {bessel}");
    }
    let far = |order: usize, radius: f64| {
        let z = [radius, 0.0, 0.0, 0.0];
        let oscillators = Oscillators { epsilon: 0.1 }.average_constants(&z, order);
        let particle = FullOrbit::new(0.1).average_constants(&z, order);
        let cells = CellularDrift::new(0.1).average_constants(&z, order);
        [oscillators, particle, cells].map(|of| of.expect("closed").first[0])
    };
    assert!(far(1, 4.9).into_iter().chain(far(2, 2.8)).all(f64::is_finite));
    assert!(far(1, 7.2).into_iter().chain(far(2, 4.1)).all(f64::is_nan));
    // And where there is none, the flow is not a number, by the library too.
    let field = ParticleField::two_modes(0.01).without_profiles();
    let mut z: [f64; 6] = [0.1, 0.5, 0.2, 0.3, 0.4, 0.6];
    Averaged::new(&field, 10.0, 8, 2).in_closed_form().take(&field, &mut z, 4);
    assert!(z.iter().all(|value| value.is_nan()), "{z:?}");
}
