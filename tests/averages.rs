//! Stroboscopic averaging, averaged equations and invariants: their orders, and their definitions.

use crate::integrators::{assert_order, has_order, with_one_off};
use crate::rivals::Wrong;
use crate::systems::{distance, particle, point};
use gyroceptron::flow::{
    Averaged, AveragedSettings, Integrator, MicroSteps, Pairs, Reference, ReferenceTrajectories,
    Splitting, Stroboscopic, StroboscopicSettings,
};
use gyroceptron::layer::CircleAction;
use gyroceptron::measure::adiabatic::{averaged_invariant, log_slope, second_averaged_invariant};
use gyroceptron::measure::trajectories::drifts;
use gyroceptron::scalar::{Dual, Elementary, constant, max_or_nan};
use gyroceptron::system::{
    AverageConstants, AveragedOscillator, CellularDrift, FieldLines, FullOrbit, Hamiltonian,
    NearlyPeriodic, Oscillators, ParticleField, Splittable, System, ThreeOscillators, VanDerPol,
};
use std::f64::consts::TAU;

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

/// Also of cells, and of a system that is not Hamiltonian.
#[test]
fn stroboscopic_averaging_has_its_order_for_other_systems() {
    let systems = [
        System::CellularDrift(CellularDrift { epsilon: 1e-3, wavenumber: 1.3 }),
        System::VanDerPol(VanDerPol::new(1e-3)),
    ];
    for system in systems {
        let points: Vec<f64> = (0..10).flat_map(|seed| point(2, seed)).collect();
        let exact = Integrator::Aba1064.trajectories(&system, &points, 500.0, 4000, 1);
        let exact = exact.expect("integrates");
        let steps = [3, 4, 5, 6, 8];
        let errors = steps.map(|steps| {
            let by = averaging(24, 2).trajectories(&system, &points, 500.0, steps, 1);
            distance(&by.expect("integrates"), &exact)
        });
        assert_order(system.kind(), 4.0, &steps.map(|steps| 1.0 / steps as f64), &errors);
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
            // What joins both parts is of second order in ε, and taken as by Strang: it shows in small steps only,
            // which have a test of their own.
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

/// The closed average of second order by a splitting, whose third part joins the other two, against Runge–Kutta steps:
/// of second order in small steps, and of none with a hundredth more of that part.
fn what_joins_an_average_counts(name: &str, system: impl NearlyPeriodic + Copy + Sync) {
    let (time, z) = (100.0, (0..8).flat_map(|seed| point(2, seed)).collect::<Vec<f64>>());
    let mut exact = z.clone();
    Averaged::new(&system, time, 32, 2).in_closed_form().take(&system, &mut exact, 20_000);
    let counts = [200, 280, 400, 560, 800];
    let steps = counts.map(|count| time / count as f64);
    for (scheme, splitting) in [("strang", Splitting::STRANG), ("aba-1064", Splitting::ABA_1064)] {
        let errors = |factor: f64| {
            let weights = system.circle_action().weights().to_vec();
            let joined = Wrong { weights, average: 1.0, joined: factor, system };
            counts.map(|count| {
                let by = Averaged::new(&joined, time, 32, 2).split_by(&joined, splitting, count);
                let mut found = z.clone();
                by.expect("of three parts").take(&joined, &mut found, count);
                distance(&found, &exact)
            })
        };
        let right = errors(1.0);
        assert_order(&format!("{name}, {scheme}"), 2.0, &steps, &right);
        let wrong = errors(1.01);
        assert!(wrong.iter().all(|error| error.is_finite()), "{wrong:?}");
        assert!(!has_order(2.0, &steps, &wrong), "{name}, {scheme}: {right:?} {wrong:?}");
    }
}

#[test]
fn averages_that_are_split_need_what_joins_their_parts() {
    what_joins_an_average_counts("full-orbit", FullOrbit::new(0.02));
    what_joins_an_average_counts("cells", CellularDrift { epsilon: 0.02, wavenumber: 1.3 });
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
