//! Error against run time, in the library.

use gyroceptron::Error;
use gyroceptron::flow::{Integrator, Pairs};
use gyroceptron::measure::{
    Contestant, Spread, jacobians_by_differences, precise_jacobians, relative_difference,
    root_mean_square_distance, tanh_errors, work_precision,
};
use gyroceptron::network::{Architecture, HenonShape, InitialWeights, map_jacobians_by_duals};
use gyroceptron::scalar::tanh_sech2_of_all;
use gyroceptron::system::{Oscillators, System};

fn contestant<'a>(
    name: &str,
    run: impl Fn() -> Result<Vec<f64>, Error> + Sync + 'a,
) -> Contestant<'a> {
    Contestant { name: name.into(), setting: None, run: Box::new(run) }
}

/// Some work that takes so many rounds.
fn busy(rounds: u64) -> Result<Vec<f64>, Error> {
    let mut x = 1.0_f64;
    for _ in 0..rounds {
        x = std::hint::black_box(x).sqrt();
    }
    Ok(vec![x])
}

#[test]
fn contestants_are_judged_and_timed() {
    let contestants = [
        contestant("short", || busy(2_000)),
        contestant("long", || busy(200_000)),
        contestant("fails", || Err(Error::invalid("x", 1, "another"))),
        contestant("leaves the numbers", || Ok(vec![f64::NAN])),
    ];
    let judged = work_precision(&contestants, &|v| (v[0] - 0.5).abs(), 4.0, 5).expect("a thread");
    let names: Vec<_> = judged.iter().map(|own| &own.name[..]).collect();
    assert_eq!(names, ["short", "long", "fails", "leaves the numbers"]);
    assert_eq!(judged[0].error, Some(0.5));
    for lost in &judged[2..] {
        assert!(lost.error.is_none() && lost.seconds.is_none(), "{lost:?}");
    }
    // A hundred times the work: the order is safe on any machine.
    let median = |k: usize| judged[k].seconds.expect("timed").median;
    assert!(median(1) > 3.0 * median(0), "{judged:?}");
    assert!(work_precision(&contestants, &|_| 0.0, 1.0, 0).is_err());
}

#[test]
fn quartiles_lie_between_neighbours() {
    let spread = Spread::of(vec![5.0, 1.0, 2.0, 4.0, 3.0]).expect("five values");
    assert_eq!(spread, Spread { lower: 2.0, median: 3.0, upper: 4.0 });
    let spread = Spread::of(vec![4.0, 1.0]).expect("two values");
    assert_eq!(spread, Spread { lower: 1.75, median: 2.5, upper: 3.25 });
    assert_eq!(spread.scaled(2.0).upper, 6.5);
    assert_eq!(Spread::of(Vec::new()), None);
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
    let contestants: Vec<Contestant<'_>> = [2, 4, 8]
        .into_iter()
        .map(|steps| Contestant {
            name: "Strang".into(),
            setting: Some(f64::from(steps)),
            run: Box::new({
                let (system, pairs) = (&system, &pairs);
                move || {
                    Integrator::Strang.trajectories(system, pairs.input(), 2.0, steps as usize, 1)
                }
            }),
        })
        .collect();
    let judge = |moved: &[f64]| root_mean_square_distance(moved, pairs.output(), 4);
    let judged = work_precision(&contestants, &judge, 20.0, 2).expect("a thread");
    let errors: Vec<f64> = judged.iter().map(|own| own.error.expect("a result")).collect();
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 2.0).abs() < 0.3, "{errors:?}");
    }
}

#[test]
fn precise_jacobians_tell_duals_from_differences() {
    let shape = HenonShape { dof: 2, widths: vec![6, 5, 4] };
    let net = Architecture::HenonNet { shape, epsilon: 1.0 }
        .initialise(InitialWeights::Glorot, 0.0, 3)
        .expect("valid");
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
    assert!(ulps > 0.3 && ulps < 1.0 && relative < 3e-16, "{ulps}, {relative:e}");
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
}
