//! Trajectories, and what is measured along them.

use gyroceptron::flow::{
    Integrator, Pairs, Reference, ReferenceTrajectories, Region, Trajectories,
};
use gyroceptron::layer::{CircleAction, TorusAction};
use gyroceptron::measure::internals::unless_stopped;
use gyroceptron::measure::{
    adiabatic::{
        averaged_invariant, disturbing_resonance, invariant_drift, invariant_horizon,
        leading_invariant, level_set, log_line, nearest_resonance, settling_iterations,
    },
    trajectories::{
        Milestone, PlaneMotion, component_errors, departures, distances_along, distances_to_set,
        drift_exponent, drifts, limiting_flow_error, locked_interval, milestones, plane_motions,
        root_mean_square, rotation_error, rotation_errors, winding_numbers,
    },
};
use gyroceptron::network::{InitialWeights, NormalFormShape};
use gyroceptron::phase::Map;
use gyroceptron::random::Stream;
use gyroceptron::scalar::max_or_nan;
use gyroceptron::system::{
    AveragedOscillator, Counted, Hamiltonian, NearlyPeriodic, Oscillators, ParticleField, System,
};
use std::cell::Cell;
use std::f64::consts::TAU;
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Three states of two trajectories in a plane.
fn example(changed: Option<(usize, f64)>) -> Trajectories {
    let mut values: Vec<f64> = (0..12).map(f64::from).collect();
    if let Some((index, value)) = changed {
        values[index] = value;
    }
    Trajectories::new(values, 2, 2).expect("whole states")
}

#[test]
fn states_are_where_a_rollout_puts_them() {
    let trajectories = example(None);
    assert_eq!((trajectories.states(), trajectories.count(), trajectories.dim()), (3, 2, 2));
    assert_eq!(trajectories.state(1, 0), [4.0, 5.0]);
    let second: Vec<_> = trajectories.orbit(1).collect();
    assert_eq!(second, [[2.0, 3.0], [6.0, 7.0], [10.0, 11.0]]);
    for (numbers, dim, count) in [(11, 2, 2), (12, 0, 2), (12, 2, 0), (0, 2, 2)] {
        assert!(Trajectories::new(vec![0.0; numbers], dim, count).is_err(), "{numbers}");
    }
}

#[test]
fn departures_are_the_largest_and_the_last_distance() {
    let reference = example(None);
    // State 1 of trajectory 0 is off by 3 in q, the last of trajectory 1 by 2 in p.
    let mut values = reference.values().to_vec();
    values[4] += 3.0;
    values[11] -= 2.0;
    let moved = Trajectories::new(values, 2, 2).expect("whole states");
    assert_eq!(distances_along(&moved, &reference, 0).collect::<Vec<_>>(), [0.0, 3.0, 0.0]);
    let found = departures(&moved, &reference);
    assert_eq!((found[0].largest, found[0].last), (3.0, 0.0));
    assert_eq!((found[1].largest, found[1].last), (2.0, 2.0));
    // A NaN, however early, is reported; so is a missing state.
    let broken = departures(&example(Some((4, f64::NAN))), &reference);
    assert!(broken[0].largest.is_nan() && broken[0].last == 0.0);
    assert!(!broken[1].largest.is_nan());
    let short = Trajectories::new(reference.values()[..8].to_vec(), 2, 2).expect("whole states");
    assert!(departures(&short, &reference).iter().all(|d| d.largest.is_nan()));
}

#[test]
fn drifts_are_measured_from_the_start() {
    let sum = |z: &[f64]| z[0] + z[1];
    let found = drifts(&example(None), sum);
    assert_eq!((found[0].initial, found[0].largest), (1.0, 16.0));
    assert_eq!((found[1].initial, found[1].largest), (5.0, 16.0));
    assert!(drifts(&example(Some((4, f64::NAN))), sum)[0].largest.is_nan());
}

#[test]
fn milestones_are_passed_once() {
    let history = [(0, 4e-2), (10, 5e-3), (20, 2e-2), (30, 3e-6), (40, 1e-7)];
    let passed: Vec<_> =
        milestones(&history).iter().map(|m| (m.level.log10().round(), m.iteration)).collect();
    let expected = [(-2.0, 10), (-3.0, 30), (-4.0, 30), (-5.0, 30), (-6.0, 40), (-7.0, 40)];
    assert_eq!(passed, expected);
    assert_eq!(milestones(&[]), Vec::<Milestone>::new());
    assert_eq!(milestones(&[(0, f64::NAN), (10, f64::NAN)]), []);
    // An error of 0 passes a finite number of them.
    assert_eq!(milestones(&[(0, 1.0), (10, 0.0)]).len(), 32);
    for milestone in milestones(&history) {
        assert!((milestone.level.log10() - milestone.level.log10().round()).abs() < 1e-14);
    }
}

/// At ε = 0 the flow is known; at another ε, H is conserved; the states do not depend
/// on how many are kept.
#[test]
fn reference_trajectories_follow_the_flow() {
    let initial = [1.5, 0.3, 0.2, -0.4, 0.9, 1.2, 0.0, 0.1];
    let system = System::Oscillators(Oscillators { epsilon: 0.0 });
    let counted = Counted::new(&system);
    let found = ReferenceTrajectories::of_flow(&counted, &initial, 0.7, 11).expect("converges");
    assert!(found.error < 1e-13 && counted.vector_fields() > 0);
    for m in 0..2 {
        for (t, state) in found.trajectories.orbit(m).enumerate() {
            let mut exact = found.trajectories.state(0, m).to_vec();
            system.limiting_flow(&mut exact, 0.7 * t as f64);
            for (a, b) in state.iter().zip(&exact) {
                assert!((a - b).abs() < 1e-13, "{state:?} against {exact:?}");
            }
        }
    }
    let coupled = system.with_epsilon(0.1);
    assert_eq!(coupled.epsilon(), 0.1);
    let long = ReferenceTrajectories::of_flow(&coupled, &initial, 0.7, 21).expect("converges");
    for drift in drifts(&long.trajectories, |z| coupled.energy(z, 0.0)) {
        assert!(drift.largest < 1e-13, "{drift:?}");
    }
    let short = ReferenceTrajectories::of_flow(&coupled, &initial, 0.7, 11).expect("converges");
    assert_eq!(short.trajectories.values(), &long.trajectories.values()[..11 * 8]);
    assert_ne!(short.trajectories, found.trajectories);
}

/// An integrator in place of the reference tells how far it is from it.
#[test]
fn an_integrator_tells_its_distance_from_the_flow() {
    let largest =
        |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
    let points: Vec<f64> = (0..40).map(|k| 1.3 * (1.7 * f64::from(k)).sin()).collect();
    let system = System::Oscillators(Oscillators { epsilon: 0.05 });
    let (exact, _) = Pairs::of_flow(&system, points.clone(), 20.0).expect("converges");
    let mut last = f64::INFINITY;
    for steps in [40, 80] {
        let by = Integrator::Aba864;
        let (pairs, error) =
            Pairs::of_integrator(&system, points.clone(), 20.0, by, steps).expect("finite");
        assert_eq!(pairs.input(), exact.input());
        let truth = largest(pairs.output(), exact.output());
        assert!(truth < 1.1 * error && error < 1.1 * truth, "{error:e} {truth:e}");
        // Of fourth order at least.
        assert!(error < last / 14.0, "{error:e} after {last:e}");
        last = error;
    }
    let along = ReferenceTrajectories::of_flow(&system, &points, 5.0, 5).expect("converges");
    let by = Integrator::Strang;
    let found = ReferenceTrajectories::of_integrator(&system, &points, 5.0, 5, by, 50);
    let found = found.expect("finite");
    assert_eq!((found.trajectories.states(), found.trajectories.count()), (5, 10));
    assert_eq!(found.trajectories.state(0, 3), along.trajectories.state(0, 3));
    // The finer of the two is kept: a third of the distance between them, of second order.
    let mut distance = 0.0;
    for m in 0..10 {
        let [a, b] = [&found, &along].map(|of| of.trajectories.state(4, m));
        let squares: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
        distance = max_or_nan(distance, squares.sqrt());
    }
    let ratio = found.error / distance;
    assert!((2.7..3.3).contains(&ratio) && found.error > 1e-6, "{} {distance}", found.error);
    // Steps beyond the limit of stability: the fast plane leaves the numbers.
    let far = Integrator::RungeKutta4;
    let error = Pairs::of_integrator(&system, points.clone(), 1e5, far, 20_000).map(|_| ());
    assert!(error.expect_err("diverges").to_string().contains("RK4"));
    let error = ReferenceTrajectories::of_integrator(&system, &points, 2e4, 5, far, 4_000);
    assert!(error.map(|_| ()).expect_err("diverges").to_string().contains("80000"));
    let none = Pairs::of_integrator(&system, points.clone(), 20.0, by, 0);
    assert!(none.is_err() && Pairs::of_integrator(&system, vec![], 20.0, by, 5).is_err());
    assert!(ReferenceTrajectories::of_integrator(&system, &points[..6], 5.0, 5, by, 50).is_err());
}

#[test]
fn level_sets_keep_the_energy_and_close() {
    let z = [1.5, 0.4, 0.0, 0.1];
    let (averaged, start) = Oscillators::averaged(&z);
    assert_eq!(averaged, AveragedOscillator::new(1.5));
    assert_eq!(start, [0.4, 0.1]);
    let points = level_set(&averaged, start, 0.02, 600).expect("converges");
    assert_eq!((points.len(), points[0]), (601, (0.4, 0.1)));
    let energy = averaged.energy(&start, 0.0);
    let mut back = f64::INFINITY;
    for (t, (q, p)) in points.iter().enumerate() {
        let drift = (averaged.energy(&[*q, *p], 0.0) - energy).abs();
        assert!(drift < 1e-14, "{drift:e} at {t}");
        if t > 100 {
            // no NaN: the energy of the point is a number
            back = back.min((q - 0.4).hypot(p - 0.1));
        }
    }
    assert!(back < 0.02, "it does not come back: {back}");
    let of_three = ParticleField::two_modes(0.01);
    assert!(level_set(&of_three, start, 0.02, 600).is_err());
}

/// Of few states the first hundredth is none: the exponent is of those after the first.
#[test]
fn short_trajectories_have_an_exponent_too() {
    for last in [20_u32, 49, 200, 5000] {
        let values: Vec<f64> = (0..=last).map(|t| 3.0 + 0.1 * f64::from(t)).collect();
        let line = Trajectories::new(values, 1, 1).expect("whole");
        let exponent = drift_exponent(&line, |v| v[0]);
        assert!((exponent - 1.0).abs() < 1e-9, "{last}: {exponent}");
    }
}

/// By definition, and of each condition by its own map.
#[test]
fn errors_of_components_are_their_definition() {
    let shape = NormalFormShape {
        action: CircleAction::new([1, 0]).into(),
        psi: Vec::new(),
        kicks: vec![3],
        twists: vec![3, 3],
        turned_twists: vec![],
        flow_time: 1.0,
        perturbation: None,
    };
    let model = shape.architecture(0.1).initialise(InitialWeights::Glorot, 0.7, 1).expect("valid");
    let mut stream = Stream::new(1, "pairs");
    let mut uniform =
        |count: usize| -> Vec<f64> { (0..count).map(|_| stream.uniform(-1.0, 1.0)).collect() };
    let plain = Pairs::new("pairs", 2, uniform(4 * 30), uniform(4 * 30)).expect("whole");
    let family = plain.clone().with_epsilons_and_times(
        &[vec![0.1; 10], vec![0.2; 20]].concat(),
        &[vec![1.0; 10], vec![3.0; 20]].concat(),
    );
    for pairs in [plain, family.expect("a family")] {
        let mut squares = [0.0; 4];
        for (k, (z, target)) in
            pairs.input().chunks_exact(4).zip(pairs.output().chunks_exact(4)).enumerate()
        {
            let at = match pairs.conditions().is_empty() {
                true => model.clone(),
                false if k < 10 => model.with_epsilon_and_time(0.1, 1.0).expect("a member"),
                false => model.with_epsilon_and_time(0.2, 3.0).expect("a member"),
            };
            let mut w = z.to_vec();
            at.forward(&mut w);
            for c in 0..4 {
                squares[c] += (w[c] - target[c]).powi(2);
            }
        }
        let found = component_errors(model.composition(), &pairs).expect("finite");
        assert_eq!(found.len(), 4);
        for (found, square) in found.iter().zip(squares) {
            let expected = (square / 30.0).sqrt();
            assert!((found - expected).abs() < 1e-13 * expected, "{found} {expected}");
        }
    }
}

#[test]
fn distances_are_to_the_nearest() {
    let set = [0.0, 0.0, 3.0, 4.0];
    assert_eq!(distances_to_set(&[0.0, 1.0, 3.0, 4.5], &set, 2), [1.0, 0.5]);
    assert!(distances_to_set(&[f64::NAN, 1.0], &set, 2)[0].is_nan());
    let hole = [1.0, 1.0, f64::NAN, 0.0, 30.0, 40.0];
    assert!(distances_to_set(&[1.0, 1.0], &hole, 2)[0].is_nan());
    assert_eq!(distances_to_set(&[1.0, 1.0], &[], 2), [f64::INFINITY]);
}

#[test]
fn a_rotation_winds_as_it_turns() {
    let turns = [0.3, 0.71, -0.1, 1.02];
    let states: Vec<f64> = (0..101)
        .flat_map(|t| {
            turns.map(|turn| [t as f64 * turn * TAU].map(|a| [libm::sin(a), libm::cos(a)]))
        })
        .flatten()
        .flatten()
        .collect();
    let orbits = Trajectories::new(states, 2, turns.len()).expect("whole");
    for whole in [-1.0, 0.0, 3.0] {
        let found = winding_numbers(&orbits, 0.45 + whole, |z| libm::atan2(z[0], z[1]));
        for (found, turn) in found.iter().zip([0.3, 0.71, 0.9, 0.02]) {
            let expected = turn + whole;
            assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
        }
    }
}

#[test]
fn an_interval_is_found_by_its_ends() {
    let judge = |places: &[f64]| -> Result<Vec<bool>, ()> {
        assert!([1, 24].contains(&places.len()));
        Ok(places.iter().map(|x| (0.47..0.58).contains(x)).collect())
    };
    let found = locked_interval(0.5, 0.2, judge).expect("judged").expect("locked");
    assert!((found.low - 0.47).abs() < 1e-5 && (found.high - 0.58).abs() < 1e-5, "{found:?}");
    assert!((found.width() - 0.11).abs() < 2e-5);
    assert!(locked_interval(0.3, 0.2, judge).expect("judged").is_none());
    assert!(locked_interval(0.5, 0.05, judge).expect("judged").is_none(), "cut off");
}

#[test]
fn quantities_and_parts_of_trajectories_are_of_their_states() {
    let all = example(None);
    let sums = all.quantity(|z| z[0] + z[1]);
    assert_eq!((sums.dim(), sums.values()), (1, &[1.0, 5.0, 9.0, 13.0, 17.0, 21.0][..]));
    assert_eq!(all.clone().first(2).values(), &all.values()[..8]);
    let moved = all.clone().moved(|values| values.iter_mut().for_each(|v| *v += 1.0));
    assert_eq!(moved.values(), (1..13).map(f64::from).collect::<Vec<_>>());
}

/// The errors that flows tell of themselves are the distances of two resolutions.
#[test]
fn stated_errors_are_the_distances_of_two_resolutions() {
    let system = System::Oscillators(Oscillators { epsilon: 0.1 });
    let points: Vec<f64> = (0..40).map(|k| 1.3 * (1.7 * f64::from(k)).sin()).collect();
    let largest =
        |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
    let apart = |a: &[f64], b: &[f64]| -> f64 {
        let squares = |(a, b): (&[f64], &[f64])| -> f64 {
            a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
        };
        a.chunks_exact(4).zip(b.chunks_exact(4)).map(squares).fold(0.0, max_or_nan)
    };
    let plain = Reference::new(&system, &points[..4]);
    let value = plain.flow_with_error(&system, &points[..4], 9.0).expect("converges");
    let mut coarse = points[..4].to_vec();
    plain.flow(&system, &mut coarse, 9.0).expect("converges");
    assert!(value.error > 0.0 && value.error == largest(&coarse, &value.point));
    // A step for each radian of the fastest mode.
    let fastest = system.fastest_frequency(&points[..4]);
    assert_eq!(plain.steps(900.0), (fastest * 900.0).ceil() as usize);
    let (_, error) = Pairs::of_flow(&system, points.clone(), 9.0).expect("converges");
    let reference = Reference::calibrated(&system, &points, 9.0).expect("converges");
    let each = points
        .chunks_exact(4)
        .map(|z| reference.flow_with_error(&system, z, 9.0).expect("converges").error);
    assert_eq!(error, each.fold(0.0, max_or_nan));
    let along = ReferenceTrajectories::of_flow(&system, &points, 9.0, 3).expect("converges");
    let coarse = reference.trajectories(&system, &points, 9.0, 2).expect("converges");
    assert!(along.error > 0.0);
    assert_eq!(along.error, apart(&along.trajectories.values()[80..], &coarse[40..]));

    let by = Integrator::Strang;
    let states = |steps: usize| by.trajectories(&system, &points, 3.0, steps, 2).expect("moves");
    let (pairs, error) = Pairs::of_integrator(&system, points.clone(), 3.0, by, 10).expect("moves");
    assert_eq!(pairs.output(), &states(10)[..40]);
    assert_eq!(error, largest(&states(10)[..40], &states(20)[..40]));
    let along = ReferenceTrajectories::of_integrator(&system, &points, 3.0, 3, by, 10);
    let error = along.expect("moves").error;
    assert_eq!(error, apart(&states(10)[40..], &states(20)[40..]));
}

/// Two pairs of two planes, and a rotation of the first.
#[test]
fn errors_of_a_rotation_are_their_definition() {
    let angle: f64 = 0.7;
    let action: TorusAction = CircleAction::new([1, 0]).into();
    let input = vec![0.3, 1.0, -0.8, 0.5, -1.1, 0.2, 0.4, -0.6];
    let output = vec![0.1, 1.1, 0.9, 0.3, 0.7, 0.2, -1.0, -0.5];
    let pairs = Pairs::new("pairs", 2, input.clone(), output.clone()).expect("whole");
    let mut squares = [0.0; 4];
    for (z, w) in input.chunks_exact(4).zip(output.chunks_exact(4)) {
        let (sine, cosine) = angle.sin_cos();
        let turned = [cosine * z[0] + sine * z[2], z[1], cosine * z[2] - sine * z[0], z[3]];
        for c in 0..4 {
            squares[c] += (turned[c] - w[c]).powi(2);
        }
    }
    let close = |found: f64, expected: f64| {
        assert!((found - expected).abs() < 1e-13 * expected, "{found} for {expected}");
    };
    for (found, square) in rotation_errors(&action, &[angle], &pairs).iter().zip(squares) {
        close(*found, square / 2.0);
    }
    let mean = squares.iter().sum::<f64>() / 8.0;
    close(rotation_error(&action, &[angle], &pairs), mean);
    close(limiting_flow_error(&Oscillators { epsilon: 0.01 }, &pairs, angle), mean);
    close(root_mean_square(&[3.0, 4.0]), 12.5_f64.sqrt());
    let motions = plane_motions(&action, &[angle], &pairs);
    for (j, motion) in motions.iter().enumerate() {
        assert!(!motion.explained);
        close(motion.scale, ((squares[j] + squares[2 + j]) / 4.0).sqrt());
    }
    // What moves by less than 1e-8 of its size does not: its size is given in its place.
    for (share, explained) in [(0.995, true), (1.005, false)] {
        let by = share * PlaneMotion::ROUNDING * 2.0_f64.sqrt();
        let still = |moved: f64| vec![0.0, 1.0, 0.0, 1.0 + moved];
        let pairs = Pairs::new("pairs", 2, still(0.0), still(by)).expect("whole");
        let motions = plane_motions(&action, &[angle], &pairs);
        assert_eq!(motions[1].explained, explained, "{motions:?}");
        if explained {
            assert!((motions[1].scale - 1.0).abs() < 1e-7);
            // Of a plane without a size that of all: √(2/4).
            assert!((motions[0].scale - 0.5_f64.sqrt()).abs() < 1e-7);
        }
    }
    let nothing = Pairs::new("pairs", 2, vec![0.0; 4], vec![0.0; 4]).expect("whole");
    assert_eq!(plane_motions(&action, &[angle], &nothing)[0].scale, 1.0);
}

#[test]
fn boxes_are_around_points_and_left_where_they_end() {
    let points = [1.0, 3.0, -1.0, 3.0, 0.5, 3.0];
    let region = Region::around(2, [&points[..]]).expect("points");
    assert_eq!(region, Region { low: vec![-1.0, 3.0], high: vec![1.0, 3.0] });
    let wide = region.widened(0.25);
    assert_eq!(wide, Region { low: vec![-1.5, 3.0], high: vec![1.5, 3.0] });
    assert_eq!(region.first_outside(&[1.0, 3.0]), None);
    assert_eq!(region.first_outside(&[0.0, 3.5]), Some(1));
    assert_eq!(region.first_outside(&[f64::NAN, 3.0]), Some(0));
    // A hundredth of the width of 2 on each side; a billionth of 3 of what has no width.
    for (share, left) in [(0.995, false), (1.005, true)] {
        for z in [[1.0 + 0.02 * share, 3.0], [-1.0 - 0.02 * share, 3.0], [0.0, 3.0 + 3e-9 * share]]
        {
            assert_eq!(region.left_by(&z, 1, 1).is_some(), left, "{z:?}");
        }
    }
    // Three states of two points, one state in ten: the second point leaves twice, p first.
    let values = [0.0, 3.0, 0.0, 3.0, 0.0, 3.0, 0.5, 4.0, 0.0, 3.0, 7.0, 5.0];
    let left = region.left_by(&values, 2, 10).expect("left");
    assert_eq!((left.rows, left.states, left.kept), (vec![1], 2, 6));
    assert_eq!((left.row, left.step, left.first.coordinate, left.first.value), (1, 10, 1, 4.0));
}

/// By least squares, over the states of twelve times, two powers of ten, spaced evenly in the logarithm.
#[test]
fn a_drift_that_is_no_power_has_a_mean_exponent() {
    let grown = |t: f64| t + 0.01 * t * t;
    let values: Vec<f64> = (0..=1000).map(|t| grown(f64::from(t))).collect();
    let found = drift_exponent(&Trajectories::new(values, 1, 1).expect("whole"), |v| v[0]);
    let times: Vec<f64> =
        (0..12).map(|k| (1000.0 * 10_f64.powf(-2.0 * f64::from(11 - k) / 11.0)).round()).collect();
    let mean = |of: &dyn Fn(f64) -> f64| times.iter().map(|t| of(*t)).sum::<f64>() / 12.0;
    let (x, y) = (mean(&f64::ln), mean(&|t| grown(t).ln()));
    let product = mean(&|t| (t.ln() - x) * (grown(t).ln() - y));
    let expected = product / mean(&|t| (t.ln() - x).powi(2));
    assert!((found - expected).abs() < 1e-12 && expected > 1.3, "{found} for {expected}");
}

#[test]
fn a_line_has_the_error_of_its_slope() {
    // Logarithms 0, 1, 2 and 0, 1, 5: residuals ½, −1, ½ of the slope 5/2.
    let exp = |values: [f64; 3]| values.map(f64::exp);
    let line = log_line(&exp([0.0, 1.0, 2.0]), &exp([0.0, 1.0, 5.0]));
    assert!((line.slope - 2.5).abs() < 1e-14, "{line:?}");
    assert!((line.slope_error - 0.75_f64.sqrt()).abs() < 1e-14, "{line:?}");
    assert_eq!(line.degrees_of_freedom, 1);
}

#[test]
fn resonances_are_where_they_are_put() {
    let near = nearest_resonance(TAU * 2.0 / 5.0 + 1e-3, 7).expect("finite");
    assert_eq!((near.turns, near.period), (2, 5));
    assert!((near.distance - 1e-3).abs() < 1e-15);
    let action = CircleAction::new([1, 0]);
    for (share, disturbs) in [(0.995, true), (1.005, false)] {
        let theta = TAU / 5.0 + 10.0 * 1e-3 * share;
        assert_eq!(disturbing_resonance(&action, theta, 1e-3).is_some(), disturbs, "{share}");
    }
    // Of a period of up to 7.
    for (turn, disturbs) in [(3.0 / 7.0, true), (3.0 / 8.0, false)] {
        assert_eq!(disturbing_resonance(&action, TAU * turn, 1e-3).is_some(), disturbs, "{turn}");
    }
}

/// q ← q + 1, with an invariant that it changes by 1.
struct Walker;

impl Map<f64> for Walker {
    fn dof(&self) -> usize {
        1
    }
    fn forward(&self, z: &mut [f64]) {
        z[0] += 1.0;
    }
}

#[test]
fn horizons_are_where_a_drift_passes_them() {
    // ⌊10 + ε^{−1/4}⌋ of ε = 2⁻³².
    let epsilon = 2.0_f64.powi(-32);
    assert_eq!(settling_iterations(epsilon).expect("positive"), 266);
    let invariant = |z: &[f64]| z[0];
    // More than 1.1 times 266 is 293 at first.
    let of = |most| invariant_horizon(&Walker, &invariant, &[0.5, 0.0], epsilon, 1.1, most);
    assert_eq!(of(1000).expect("positive"), Some(293));
    assert_eq!(of(292).expect("positive"), None);
    assert_eq!(invariant_drift(&Walker, &invariant, &[0.5, 0.0], &[1, 4, 9]), [1.0, 4.0, 9.0]);
    // ψ⁻¹ of (3, 4) is (3, 4) less 1 in q.
    let own = leading_invariant(&Shifted, &[3]);
    assert!((own(&[3.0, 4.0]) - 0.5 * 3.0 * (4.0 + 16.0)).abs() < 1e-14);
}

struct Shifted;

impl Map<f64> for Shifted {
    fn dof(&self) -> usize {
        1
    }
    fn forward(&self, z: &mut [f64]) {
        z[0] += 1.0;
    }
    fn inverse(&self, z: &mut [f64]) {
        z[0] -= 1.0;
    }
}

/// In closed form: q₁q₂ sin(2q₁ + 2q₂) is q₂ cos(2q₂) R J₁(2R) on average over the circle of radius R.
#[test]
fn the_averaged_invariant_has_a_closed_form() {
    let system = Oscillators { epsilon: 0.3 };
    for z in [[0.9_f64, 0.5, 0.2, 0.1], [-0.4, 1.3, 0.7, -0.6]] {
        let radius = z[0].hypot(z[2]);
        let average = z[1] * (2.0 * z[1]).cos() * radius * libm::j1(2.0 * radius);
        let own = z[0] * z[1] * (2.0 * z[0] + 2.0 * z[1]).sin();
        let expected = 0.5 * radius * radius + 0.3 * (own - average);
        let found = averaged_invariant(&system, &z);
        assert!((found - expected).abs() < 1e-14, "{found} for {expected}");
    }
}

/// A flow that may be stopped is made in parts, and has the bits of one that may not.
#[test]
fn flows_can_be_stopped() {
    let system = Oscillators { epsilon: 0.01 };
    let points: Vec<f64> =
        (0..4 * 3001_u32).map(|k| (f64::from(k) * 0.754_877_666).fract() - 0.5).collect();
    let few = &points[..12];
    let splitting = Integrator::Strang;
    let all = || {
        let by_splitting =
            splitting.trajectories(&System::Oscillators(system), few, 40.0, 4000, 31)?;
        let pairs = Pairs::of_flow(&system, points.clone(), 5.0)?;
        let along = ReferenceTrajectories::of_flow(&system, few, 10.0, 301)?;
        Ok::<_, gyroceptron::Error>((by_splitting, pairs, along.trajectories))
    };
    let asked = Rc::new(Cell::new(0));
    let counted = Rc::clone(&asked);
    let go_on = move || {
        counted.set(counted.get() + 1);
        true
    };
    let with_pauses = unless_stopped(go_on, all).expect("never stopped").expect("flows");
    assert!(asked.get() >= 3, "{}", asked.get());
    assert_eq!(with_pauses, all().expect("flows"));
    // Far longer than the test: each would take minutes.
    let (begin, far) = (Instant::now(), 1e6);
    let stops = move || begin.elapsed() < Duration::from_millis(60);
    let many = points.repeat(100);
    let of = |made: Result<(), gyroceptron::Error>| made.expect_err("it was stopped").to_string();
    let endless: [&dyn Fn() -> String; 5] = [
        &|| {
            of(splitting
                .trajectories(&System::Oscillators(system), &many, far, 1 << 16, 1)
                .map(drop))
        },
        &|| of(ReferenceTrajectories::of_flow(&system, few, 10.0, 1 << 20).map(drop)),
        &|| of(Pairs::of_flow(&system, many.clone(), 500.0).map(drop)),
        // Of few points, interval after interval.
        &|| {
            of(splitting
                .trajectories(&System::Oscillators(system), few, 1.0, 1 << 12, 1 << 20)
                .map(drop))
        },
        &|| of(Pairs::of_flow(&system, few.to_vec(), 4e3).map(drop)),
    ];
    for (number, flow) in endless.iter().enumerate() {
        let start = Instant::now();
        let mut reason = String::new();
        assert_eq!(unless_stopped(stops, || reason = flow()), None, "{number}");
        assert_eq!(reason, "flow: stopped before its end", "{number}");
        assert!(start.elapsed() < Duration::from_secs(5), "{number}: {:?}", start.elapsed());
    }
}
