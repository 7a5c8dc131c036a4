//! Integrators: their orders, what they keep, and where they end.

use crate::systems::{distance, particle, point, split, systems};
use gyroceptron::Error;
use gyroceptron::flow::{
    GaussLegendre, GaussLegendreSettings, Integrator, Reference, ReferenceTrajectories, Splitting,
    Tableau, boris, runge_kutta_4, velocity_splitting,
};
use gyroceptron::measure::adiabatic::{FittedLine, log_line, log_slope};
use gyroceptron::scalar::{DoubleDouble, Dual, Elementary, Real, Scalar, max_or_nan};
use gyroceptron::system::{
    CellularDrift, FullOrbit, Hamiltonian, Oscillators, ParticleField, System, ThreeOscillators,
    VanDerPol,
};
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::f64::consts::TAU;

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
pub(crate) fn assert_order(what: &str, order: f64, sizes: &[f64], errors: &[f64]) {
    let FittedLine { slope, slope_error, degrees_of_freedom } = log_line(sizes, errors);
    let student = StudentsT::new(0.0, 1.0, degrees_of_freedom as f64).expect("three points");
    let half = student.inverse_cdf(0.995) * slope_error;
    assert!((slope - order).abs() + half < 0.5, "{what}: {slope} ± {half} for {order}: {errors:?}");
}

/// Whether [`assert_order`] takes these errors.
pub(crate) fn has_order(order: f64, sizes: &[f64], errors: &[f64]) -> bool {
    std::panic::catch_unwind(|| assert_order("a mutant", order, sizes, errors)).is_ok()
}

/// Coefficients with one of them off by this factor.
pub(crate) fn with_one_off(of: &[f64], place: usize, factor: f64) -> Vec<f64> {
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
pub(crate) fn omega_defect(columns: &[Vec<f64>]) -> f64 {
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
