//! Error against run time, in the library.

use gyroceptron::Error;
use gyroceptron::flow::{Integrator, Pairs};
use gyroceptron::measure::{
    jacobians_by_differences,
    timing::{
        AtError, Comparison, Method, Spread, TrajectoryMethods, WorkPrecision, break_even, fastest,
        most_accurate, precise_jacobians, relative_difference, root_mean_square_distance,
        tanh_errors, work_precision, work_precision_by,
    },
};
use gyroceptron::network::{HenonShape, InitialWeights, map_jacobians_by_duals};
use gyroceptron::scalar::tanh_sech2_of_all;
use gyroceptron::system::{Oscillators, System};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

fn method<'a>(name: &str, run: impl Fn() -> Result<Vec<f64>, Error> + Sync + 'a) -> Method<'a> {
    Method::new(name, None, run)
}

/// A clock that only the methods move, and the order in which they ran.
#[derive(Default)]
struct Clock {
    microseconds: AtomicU64,
    runs: Mutex<Vec<&'static str>>,
}

impl Clock {
    fn seconds(&self) -> f64 {
        self.microseconds.load(Ordering::SeqCst) as f64 * 1e-6
    }

    /// A method that takes so long, and results in 1.
    fn takes(&self, name: &'static str, microseconds: u64) -> Method<'_> {
        method(name, move || {
            self.microseconds.fetch_add(microseconds, Ordering::SeqCst);
            self.runs.lock().expect("one thread").push(name);
            Ok(vec![1.0])
        })
    }
}

#[test]
fn methods_are_judged_and_timed() {
    let clock = Clock::default();
    let methods = [
        clock.takes("short", 2000),
        clock.takes("long", 200_000),
        method("fails", || Err(Error::invalid("x", 1, "another"))),
        method("leaves the numbers", || Ok(vec![f64::NAN])),
    ];
    let error = |v: &[f64]| (v[0] - 0.5).abs();
    let judged =
        work_precision_by(&|| clock.seconds(), &methods, &error, 4.0, 5).expect("a thread");
    let names: Vec<_> = judged.iter().map(|one| &one.name[..]).collect();
    assert_eq!(names, ["short", "long", "fails", "leaves the numbers"]);
    assert_eq!(judged[0].error, Some(0.5));
    for lost in &judged[2..] {
        assert!(lost.error.is_none() && lost.seconds.is_none(), "{lost:?}");
        assert!(lost.failure.is_some());
    }
    // For a unit of work, of which there are four.
    for (one, seconds) in judged.iter().zip([0.002, 0.2]) {
        let Spread { lower, median, upper } = one.seconds.expect("timed");
        for found in [lower, median, upper] {
            assert!((found * 4.0 / seconds - 1.0).abs() < 1e-6, "{found} of {seconds}");
        }
    }
    assert!(work_precision(&methods, &error, 1.0, 0).is_err());
}

#[test]
fn methods_are_timed_in_turn() {
    let clock = Clock::default();
    let methods = [clock.takes("a", 2000), clock.takes("b", 3000)];
    work_precision_by(&|| clock.seconds(), &methods, &|_| 0.0, 1.0, 3).expect("a thread");
    let runs = clock.runs.lock().expect("one thread").clone();
    // Each once for its result and once to see how long it takes, then in turn, after a run that is not timed.
    let in_turn = ["a", "a", "b", "b"].repeat(3);
    assert_eq!(runs, [&["a", "a", "b", "b"], &in_turn[..]].concat());
}

/// A short one is run until a measurement is long enough; one that takes seconds is
/// not run more often than need be.
#[test]
fn the_runs_of_a_measurement_follow_from_how_long_one_takes() {
    for (microseconds, rounds, expected) in [
        // 1 + 2 + 4 + … + 512 + 1024 runs to find out, then one that is not timed and 1024 a round.
        (1, 2, 1 + 2047 + 2 * 1025),
        (300, 2, 1 + (1 + 2 + 4) + 2 * 5),
        (99_000, 9, 1 + 1 + 9 * 2),
        (3_000_000, 9, 1 + 1 + 3),
        (101_000, 9, 1 + 1 + 9),
    ] {
        let clock = Clock::default();
        let methods = [clock.takes("one", microseconds)];
        work_precision_by(&|| clock.seconds(), &methods, &|_| 0.0, 1.0, rounds).expect("a thread");
        assert_eq!(clock.runs.lock().expect("one thread").len(), expected, "{microseconds} µs");
    }
}

/// The clock on the wall: what it says is positive.
#[test]
fn run_times_are_positive() {
    let busy = || Ok(vec![(0..1000).fold(1.0, |x: f64, _| std::hint::black_box(x).sqrt())]);
    let judged = work_precision(&[method("busy", busy)], &|_| 0.0, 1.0, 3).expect("a thread");
    let Spread { lower, median, upper } = judged[0].seconds.expect("timed");
    assert!(lower > 0.0 && lower <= median && median <= upper);
}

fn judged(name: &str, error: Option<f64>, seconds: f64) -> WorkPrecision {
    let spread = Spread { lower: seconds, median: seconds, upper: seconds };
    let seconds = error.map(|_| spread);
    WorkPrecision { name: name.into(), setting: None, error, seconds, alone: None, failure: None }
}

#[test]
fn the_fastest_is_of_those_that_are_accurate_enough() {
    let methods = vec![
        judged("rough", Some(2e-1), 1.0),
        judged("fair", Some(3e-3), 2.0),
        judged("slow", Some(2e-3), 9.0),
        judged("fine", Some(5e-7), 4.0),
        judged("lost", None, 0.1),
    ];
    let name = |found: Option<(&WorkPrecision, f64)>| found.map(|(one, _)| one.name.clone());
    assert_eq!(name(fastest(&methods, 1.0)).as_deref(), Some("rough"));
    assert_eq!(name(fastest(&methods, 2.5e-3)).as_deref(), Some("fine"));
    assert_eq!(name(fastest(&methods, 1e-9)), None);
    assert_eq!(most_accurate(&methods).map(|one| &one.name[..]), Some("fine"));
    let comparison = Comparison {
        trajectories: 1,
        together: 64,
        time: 1.0,
        size: 0.3,
        reference_error: 2e-6,
        methods,
    };
    // `rough` errs by more than half the size of the points: it does not count. What
    // the reference does not distinguish is not reported.
    let ranges: Vec<_> = comparison
        .fastest_by_error()
        .iter()
        .map(|range| (range.name.to_owned(), range.from, range.to))
        .collect();
    assert_eq!(ranges, [("fair".into(), 0, -2), ("fine".into(), -3, -5)]);
    let seconds: Vec<[f64; 2]> =
        comparison.fastest_by_error().iter().map(|range| range.seconds).collect();
    assert_eq!(seconds, [[2.0; 2], [4.0; 2]]);
    assert_eq!(comparison.lost(), 0.15);
    // An error is met up to its last digit.
    assert_eq!(fastest(&comparison.methods, 2.99e-3).map(|(_, seconds)| seconds), Some(4.0));
    // Down to 1e-15 of a method that does not err, and no further than the reference tells.
    for (reference_error, to) in [(0.0, -15), (1.0, 0)] {
        let methods = vec![judged("exact", Some(0.0), 1.0)];
        let exact = Comparison { reference_error, methods, ..comparison };
        let ranges = exact.fastest_by_error();
        assert_eq!((ranges.len(), ranges[0].from, ranges[0].to), (1, 0, to));
    }
    let unknown = Comparison { reference_error: f64::NAN, ..comparison };
    assert!(unknown.fastest_by_error().is_empty());
}

/// A curve of errors and times, those of one alone ten times as long.
fn curve(name: &str, points: &[(f64, f64, f64)]) -> Vec<WorkPrecision> {
    let of = |&(setting, error, seconds): &(f64, f64, f64)| {
        let one = judged(name, Some(error), seconds);
        let alone = one.seconds.map(|spread| spread.scaled(10.0));
        WorkPrecision { setting: Some(setting), alone, ..one }
    };
    points.iter().map(of).collect()
}

/// Of second order, in time as 1/√error: between two settings it is what a setting there would take.
#[test]
fn curves_are_interpolated_between_their_settings() {
    let mut methods = curve("second", &[(1.0, 1e-2, 1.0), (10.0, 1e-4, 10.0)]);
    methods.push(judged("network", Some(1e-3), 0.5));
    methods.extend(curve("steep", &[(20.0, 1e-8, 6.0), (4.0, 3e-1, 5.0)]));
    let at = |name: &str, error: f64| AtError::of_curve(&methods, name, error);
    let second = at("second", 1e-3).expect("between");
    assert!((second.seconds - 10.0_f64.sqrt()).abs() < 1e-12, "{}", second.seconds);
    assert!((second.alone.expect("timed") - 1000.0_f64.sqrt()).abs() < 1e-11);
    assert_eq!(second.method.setting, Some(10.0));
    // At a setting, cheaper than the first, and beyond the last.
    assert_eq!(at("second", 1e-4).expect("the last").seconds, 10.0);
    assert_eq!(at("second", 1.0).expect("the first").seconds, 1.0);
    assert!(at("second", 0.99e-4).is_none() && at("network", 1.0).is_none());
    // The fastest of all curves changes with the error; networks are none.
    let fastest = |error: f64| AtError::fastest(&methods, error).map(|at| &at.method.name[..]);
    assert_eq!(fastest(1e-3), Some("second"));
    assert_eq!(fastest(1.2e-4), Some("steep"));
    assert_eq!(fastest(1e-9), None);
    // Settings in any order, of errors that do not fall evenly.
    let uneven = curve("uneven", &[(3.0, 2e-3, 3.0), (1.0, 1e-3, 1.0), (2.0, 1e-1, 2.0)]);
    assert_eq!(AtError::of_curve(&uneven, "uneven", 1e-2).expect("the first").seconds, 1.0);
    // A method without error, and one that is not timed.
    let exact = curve("exact", &[(1.0, 1e-2, 1.0), (2.0, 0.0, 4.0)]);
    assert_eq!(AtError::of_curve(&exact, "exact", 1e-3).expect("the last").seconds, 4.0);
    assert!(AtError::of_curve(&[judged("a", None, 1.0)], "a", 1.0).is_none());
    let comparison = Comparison {
        trajectories: 1,
        together: 64,
        time: 1.0,
        size: 9.0,
        reference_error: 1e-4,
        methods,
    };
    let ranges = comparison.fastest_by_error();
    let found: Vec<_> = ranges.iter().map(|range| (range.name, range.from, range.to)).collect();
    assert_eq!(found, [("network", 0, -3), ("steep", -4, -4)]);
}

/// A run that shares no lanes is timed as often as the other, for its own units, and not judged.
#[test]
fn one_alone_is_timed_beside() {
    let clock = Clock::default();
    let alone = || {
        clock.microseconds.fetch_add(7000, Ordering::SeqCst);
        clock.runs.lock().expect("one thread").push("alone");
        Ok(vec![f64::NAN])
    };
    let methods = [clock.takes("a", 2000).beside_alone(2.0, alone), clock.takes("b", 3000)];
    let judged = work_precision_by(&|| clock.seconds(), &methods, &|_| 0.0, 4.0, 3);
    let judged = judged.expect("a thread");
    let median = |spread: Option<Spread>| spread.map(|spread| spread.median);
    assert!((median(judged[0].seconds).expect("timed") - 0.0005).abs() < 1e-12);
    assert!((median(judged[0].alone).expect("timed") - 0.0035).abs() < 1e-12);
    assert_eq!(judged[1].alone, None);
    let runs = clock.runs.lock().expect("one thread").clone();
    let round = ["a", "a", "alone", "alone", "b", "b"];
    assert_eq!(runs, [&["a", "a", "alone", "b", "b"][..], &round, &round, &round].concat());
    assert!(judged[0].without_seconds().alone.is_none());
    // What fails is not timed in either way.
    let fails = method("fails", || Ok(vec![f64::NAN])).beside_alone(1.0, || Ok(vec![1.0]));
    let judged = work_precision(&[fails], &|v| v[0], 1.0, 1).expect("a thread");
    assert!(judged[0].seconds.is_none() && judged[0].alone.is_none());
}

/// 90 s of pairs and training, a step of 2 µs in place of 5 µs.
#[test]
fn steps_pay_for_what_came_before() {
    let steps = break_even(90.0, 2e-6, 5e-6).expect("it is faster");
    assert!((steps / 3e7 - 1.0).abs() < 1e-12, "{steps}");
    assert_eq!(break_even(0.0, 2e-6, 5e-6), Some(0.0));
    for (paid, own, rival) in
        [(90.0, 5e-6, 5e-6), (90.0, 6e-6, 5e-6), (90.0, f64::NAN, 5e-6), (f64::NAN, 2e-6, 5e-6)]
    {
        assert_eq!(break_even(paid, own, rival), None, "{paid} {own} {rival}");
    }
}

#[test]
fn quartiles_lie_between_neighbours() {
    let spread = Spread::from_values(vec![5.0, 1.0, 2.0, 4.0, 3.0]).expect("five values");
    assert_eq!(spread, Spread { lower: 2.0, median: 3.0, upper: 4.0 });
    let spread = Spread::from_values(vec![4.0, 1.0]).expect("two values");
    assert_eq!(spread, Spread { lower: 1.75, median: 2.5, upper: 3.25 });
    assert_eq!(spread.scaled(2.0).upper, 6.5);
    assert_eq!(Spread::from_values(Vec::new()), None);
}

#[test]
fn distances_fail_on_nan_and_on_missing_rows() {
    let rows = [3.0, 4.0, 0.0, 0.0];
    assert_eq!(root_mean_square_distance(&rows, &[0.0; 4], 2), 12.5_f64.sqrt());
    assert!(root_mean_square_distance(&[f64::NAN, 0.0], &[0.0; 2], 2).is_nan());
    assert!(root_mean_square_distance(&rows[..2], &rows, 2).is_nan());
    assert!(relative_difference(&[1.0, f64::NAN], &[1.0, 2.0]).is_nan());
    assert!(relative_difference(&[1.0], &[1.0, 2.0]).is_nan());
    assert_eq!(relative_difference(&[1.5, 2.0], &[1.0, 2.0]), 0.25);
}

/// The whole way of a user: integrators against pairs of a flow.
#[test]
fn more_steps_err_less() {
    let system = System::Oscillators(Oscillators { epsilon: 0.05 });
    let points: Vec<f64> = (0..40).map(|k| f64::from(k * 37 % 23) / 15.0 - 0.7).collect();
    let (pairs, _) = Pairs::of_flow(&system, points, 2.0).expect("converges");
    // As many as fill the lanes; each is judged once.
    let copies = TrajectoryMethods::copies_of(10);
    assert_eq!(copies, 7);
    let several = pairs.input().repeat(copies);
    let methods = [2, 4, 8]
        .into_iter()
        .map(|steps| {
            let (system, several) = (&system, &several);
            Method::new("Strang", Some(f64::from(steps)), move || {
                Integrator::Strang.trajectories(system, several, 2.0, steps as usize, 1)
            })
        })
        .collect();
    let all = TrajectoryMethods {
        methods,
        reference: pairs.output(),
        reference_error: 1e-15,
        dim: 4,
        trajectories: 10,
        copies,
        time: 2.0,
    };
    let comparison = all.compare(2).expect("a thread");
    assert_eq!((comparison.trajectories, comparison.together), (10, 70));
    assert_eq!(comparison.time, 2.0);
    let once = Integrator::Strang.trajectories(&system, pairs.input(), 2.0, 2, 1).expect("moves");
    let error = root_mean_square_distance(&once, pairs.output(), 4);
    assert_eq!(comparison.methods[0].error, Some(error));
    assert_eq!(comparison.reference_error, 1e-15);
    let settings: Vec<_> = comparison.methods.iter().map(|one| one.setting).collect();
    assert_eq!(settings, [Some(2.0), Some(4.0), Some(8.0)]);
    let squares: f64 = pairs.output().iter().map(|v| v * v).sum();
    assert!((comparison.size / (squares / 10.0).sqrt() - 1.0).abs() < 1e-15);
    assert!(comparison.without_seconds().methods.iter().all(|one| one.seconds.is_none()));
    let errors: Vec<f64> =
        comparison.methods.iter().map(|one| one.error.expect("a result")).collect();
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 2.0).abs() < 0.3, "{errors:?}");
    }
}

#[test]
fn precise_jacobians_tell_duals_from_differences() {
    let shape = HenonShape { dof: 2, widths: vec![6, 5, 4] };
    let net = shape.architecture(1.0).initialise(InitialWeights::Glorot, 0.0, 3).expect("valid");
    let map = net.composition();
    let points: Vec<f64> = (0..24).map(|k| f64::from(k * 31 % 17) / 9.0 - 0.9).collect();
    let exact = precise_jacobians(map, &points);
    let mut out = vec![0.0; exact.len()];
    map_jacobians_by_duals(map, &points, &mut out).expect("whole points");
    assert!(relative_difference(&out, &exact) < 3e-15);
    jacobians_by_differences(map, 1e-4, &points, &mut out).expect("whole points");
    let error = relative_difference(&out, &exact);
    assert!(error > 1e-11 && error < 1e-6, "{error:e}");
}

#[test]
fn tanh_errors_see_what_is_wrong() {
    let x: Vec<f64> = (-199..200).map(|k| f64::from(k) * 0.05).collect();
    assert!(x.contains(&0.0));
    let (mut t, mut s) = (x.clone(), x.clone());
    tanh_sech2_of_all(&x, &mut t, &mut s);
    let (ulps, relative) = tanh_errors(&x, &t, &s);
    assert!(ulps > 0.3 && ulps < 3.0 && relative < 5e-16, "{ulps}, {relative:e}");
    // 1 − tanh² loses all its digits.
    for (s, t) in s.iter_mut().zip(&t) {
        *s = 1.0 - t * t;
    }
    assert!(tanh_errors(&x, &t, &s).1 > 1e-9);
    // Two units in the last place of one value.
    t[7] = f64::from_bits(t[7].to_bits() + 2);
    assert!(tanh_errors(&x, &t, &s).0 > 1.0);
    t[7] = f64::NAN;
    assert!(tanh_errors(&x, &t, &s).0.is_nan());
    // tanh x = x and sech² x = 1 for x this small, of which these are off by eight units and by 1e-3.
    let x = [1e-30];
    let t = [f64::from_bits(1e-30_f64.to_bits() + 8)];
    let (ulps, relative) = tanh_errors(&x, &t, &[1.001]);
    assert!((ulps - 8.0).abs() < 1e-9 && (relative - 1e-3).abs() < 1e-12, "{ulps}, {relative}");
}
