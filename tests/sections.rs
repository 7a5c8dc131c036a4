//! Sections whose area form is not canonical.

use crate::polynomial_maps::pairs_of;
use gyroceptron::flow::{FormDefect, Pairs, PolynomialOnSection, Symmetries, Window, sample};
use gyroceptron::phase::{AreaDensity, Section};
use gyroceptron::random::Stream;
use gyroceptron::scalar::max_or_nan;
use gyroceptron::system::Oscillators;

/// A density whose integral is known: ρ = e^{x}(2 + sin y).
fn density(x: f64, y: f64) -> f64 {
    x.exp() * (2.0 + y.sin())
}

fn made() -> AreaDensity {
    AreaDensity::of_function(density, [-0.5, -1.0], [1.5, 2.0], 3.0).expect("a chart")
}

#[test]
fn charts_integrate_the_density_and_come_back() {
    let chart = made();
    assert!(chart.error() < 1e-13, "{}", chart.error());
    let mut stream = Stream::new(7, "places");
    for _ in 0..200 {
        let (x, y) = (stream.uniform(-0.5, 1.5), stream.uniform(-1.0, 2.0));
        let [q, p] = chart.to_canonical([x, y]);
        let expected = (x.exp() - 0.5f64.exp()) * (2.0 + y.sin()) / 3.0;
        assert_eq!(q, y);
        assert!((p - expected).abs() < 1e-13, "{p} {expected}");
        let [there, again] = chart.to_data([q, p]);
        assert!((there - x).abs() < 1e-13 && again == y, "{there} {x}");
        let [by_x, by_y] = chart.slopes([x, y]);
        assert!((by_x - density(x, y) / 3.0).abs() < 1e-12);
        assert!((by_y - (x.exp() - 0.5f64.exp()) * y.cos() / 3.0).abs() < 1e-11);
    }
    // The corners, and beyond.
    for corner in [[-0.5, -1.0], [1.5, 2.0], [-0.5, 2.0]] {
        let back = chart.to_data(chart.to_canonical(corner));
        assert!((back[0] - corner[0]).abs() < 1e-13, "{back:?} {corner:?}");
    }
    assert!(chart.to_canonical([1.6, 0.0])[1].is_nan());
    assert!(chart.to_data([0.0, 10.0])[0].is_nan() && chart.to_data([3.0, 0.0])[0].is_nan());
}

#[test]
fn charts_of_tables_say_their_error() {
    // Of noise, and of a step of a twentieth, which is as smooth as the note on it says.
    let nodes: Vec<f64> = (0..32).map(f64::from).collect();
    let mut stream = Stream::new(5, "rough");
    let rough: Vec<f64> = (0..32 * 32).map(|_| 1.0 + stream.uniform(-0.4, 0.4)).collect();
    let refused = AreaDensity::of_grid(&nodes, &nodes, &rough, 1.0).expect_err("rough").to_string();
    assert!(refused.contains("density") && refused.contains("smooth"), "{refused}");
    let step: Vec<f64> = (0..32 * 32).map(|k| if k % 32 < 16 { 1.0 } else { 1.05 }).collect();
    let chart = AreaDensity::of_grid(&nodes, &nodes, &step, 1.0).expect("a chart");
    assert!(chart.error() > 1e-3 && chart.error() < 0.1, "{}", chart.error());
    let grid = |count: usize, low: f64, high: f64| -> Vec<f64> {
        (0..count).map(|k| low + (high - low) * k as f64 / (count - 1) as f64).collect()
    };
    let (x, y) = (grid(81, -0.5, 1.5), grid(101, -1.0, 2.0));
    let values = |noise: f64| -> Vec<f64> {
        let mut stream = Stream::new(3, "noise");
        let at = |y: f64| x.iter().map(move |x| density(*x, y)).collect::<Vec<_>>();
        y.iter().flat_map(|y| at(*y)).map(|v| v + noise * stream.uniform(-1.0, 1.0)).collect()
    };
    let fitted = AreaDensity::of_grid(&x, &y, &values(0.0), 3.0).expect("a chart");
    assert!(fitted.error() < 1e-9, "{} {:?}", fitted.error(), fitted.degrees());
    let noisy = AreaDensity::of_grid(&x, &y, &values(1e-3), 3.0).expect("a chart");
    assert!(noisy.error() > 1e-5, "{}", noisy.error());
    let mut worst = 0.0;
    for place in [[0.1, 0.2], [1.4, -0.9], [0.7, 1.7]] {
        let [one, other] = [&fitted, &made()].map(|chart| chart.to_canonical(place)[1]);
        worst = max_or_nan(worst, (one - other).abs());
    }
    assert!(worst < 1e-8, "{worst}");
}

#[test]
fn bad_sections_are_refused() {
    let of = |f: fn(f64, f64) -> f64, high: f64, scale: f64| {
        AreaDensity::of_function(f, [0.0, 0.0], [high, 1.0], scale)
    };
    assert!(of(density, 1.0, 1.0).is_ok());
    assert!(of(density, 0.0, 1.0).is_err() && of(density, 1.0, 0.0).is_err());
    let text = of(|x, _| x - 0.5, 1.0, 1.0).expect_err("negative").to_string();
    assert!(text.contains("positive") && text.contains("(x, y)"), "{text}");
    assert!(of(|x, _| 1.0 / x, 1.0, f64::NAN).is_err());
    assert!(of(|_, _| f64::NAN, 1.0, 1.0).is_err());
    let axis: Vec<f64> = (0..10).map(f64::from).collect();
    assert!(AreaDensity::of_grid(&axis, &axis, &[1.0; 99], 1.0).is_err());
    let mut values = [1.0; 100];
    values[57] = -1.0;
    let text = AreaDensity::of_grid(&axis, &axis, &values, 1.0).expect_err("negative").to_string();
    assert!(text.contains("(7, 5)"), "{text}");
    let back: Vec<f64> = axis.iter().rev().copied().collect();
    assert!(AreaDensity::of_grid(&back, &axis, &[1.0; 100], 1.0).is_err());
    // A plane without a chart has the scale 1.
    assert!(Section::new(vec![Some(made()), None]).is_err());
    assert!(Section::new(vec![None]).is_err());
    let section = Section::of_plane(made());
    assert!(section.check(2).is_err());
    let text = section.check_points("pairs", &[0.0, 0.0, 5.0, 0.0]).expect_err("outside");
    assert!(text.to_string().contains("row 1"), "{text}");
}

/// Each plane has a chart of its own: the maps of data keep Σ ρ_j dx_j∧dy_j.
#[test]
fn several_planes_have_charts_of_their_own() {
    let rho = [|x: f64, _: f64| 1.0 + 0.3 * x, |_: f64, y: f64| 1.0 - 0.2 * y];
    let chart = |j: usize| {
        AreaDensity::of_function(rho[j], [-2.0, -2.0], [2.0, 2.0], 1.0).expect("a density")
    };
    let section = Section::new(vec![Some(chart(0)), Some(chart(1))]).expect("two planes");
    // Turns by angles that depend on both radii; the sums are of one Hamiltonian.
    let twist = |z: &mut [f64]| {
        let squares = [z[0] * z[0] + z[2] * z[2], z[1] * z[1] + z[3] * z[3]];
        let angles =
            [0.7 - 0.2 * squares[0] - 0.1 * squares[1], 0.4 - 0.1 * squares[0] - 0.15 * squares[1]];
        for j in 0..2 {
            let (s, c) = angles[j].sin_cos();
            (z[j], z[2 + j]) = (c * z[j] + s * z[2 + j], c * z[2 + j] - s * z[j]);
        }
    };
    let canonical = pairs_of(2, 500, 0.5, twist);
    let [mut input, mut output] = [canonical.input().to_vec(), canonical.output().to_vec()];
    section.to_data(&mut input);
    section.to_data(&mut output);
    let mut back = input.clone();
    section.to_canonical(&mut back);
    let errors = back.iter().zip(canonical.input()).map(|(a, b)| (a - b).abs());
    assert!(errors.fold(0.0, max_or_nan) < 1e-13);
    let pairs = Pairs::new("pairs", 2, input, output).expect("pairs");
    let fit = |section| {
        PolynomialOnSection::fit(&pairs, 7, &Symmetries::default(), section).expect("a map")
    };
    let form = |z: &[f64], a: usize, b: usize| match (a, b) {
        (0, 2) | (1, 3) => rho[a](z[a], z[b]),
        (2, 0) | (3, 1) => -rho[b](z[b], z[a]),
        _ => 0.0,
    };
    let defect = |map: &PolynomialOnSection| {
        let defects = pairs.input().chunks_exact(4).take(40).map(|z| {
            let (image, jacobian) = map.with_jacobian(z);
            let mut worst: f64 = 0.0;
            for a in 0..4 {
                for b in 0..4 {
                    let mut sum = -form(z, a, b);
                    for i in 0..4 {
                        for k in 0..4 {
                            sum += jacobian[4 * i + a] * form(&image, i, k) * jacobian[4 * k + b];
                        }
                    }
                    worst = max_or_nan(worst, sum.abs());
                }
            }
            worst
        });
        defects.fold(0.0, max_or_nan)
    };
    let both = fit(Some(section));
    assert!(both.map().error_on(&canonical) < 1e-3);
    assert!(defect(&both) < 1e-12, "{:e}", defect(&both));
    let one = fit(Some(Section::new(vec![Some(chart(0)), None]).expect("a plane")));
    assert!(defect(&one) > 1e-3 && defect(&fit(None)) > 1e-3);
}

/// Pairs of a symplectic map keep the form; those of the same map in other coordinates do not, nor with friction.
#[test]
fn a_form_that_is_not_kept_is_seen() {
    let window = Window { low: vec![-0.8; 4], high: vec![0.8; 4], samples: 3000 };
    let points = sample(&[window], 2, &mut Stream::new(1, "points")).expect("points");
    let (pairs, _) = Pairs::of_flow(&Oscillators { epsilon: 0.05 }, points, 2.0).expect("pairs");
    let kept = FormDefect::measure(&pairs).expect("enough");
    assert!(!kept.is_seen(0.0), "{kept:?}");
    let moved = |points: &[f64], change: fn(&[f64]) -> [f64; 4]| -> Vec<f64> {
        points.chunks(4).flat_map(change).collect()
    };
    // Another coordinate: p₁ ↦ p₁ + ⅕p₁³.
    let bent = |z: &[f64]| [z[0], z[1], z[2] + 0.2 * z[2].powi(3), z[3]];
    let other = Pairs::new("bent", 2, moved(pairs.input(), bent), moved(pairs.output(), bent));
    let seen = FormDefect::measure(&other.expect("pairs")).expect("enough");
    assert!(seen.is_seen(0.0) && seen.median > 1e-3, "{seen:?}");
    let damped = |z: &[f64]| [z[0], z[1] * 0.98, z[2], z[3] * 0.98];
    let other = Pairs::new("damped", 2, pairs.input().to_vec(), moved(pairs.output(), damped));
    let seen = FormDefect::measure(&other.expect("pairs")).expect("enough");
    let exact = 1.0 - 0.98_f64.powi(2);
    assert!(seen.is_seen(0.0) && (seen.median - exact).abs() < 1e-4, "{seen:?}");
    // Nothing is seen that is below what is known of the form.
    assert!(!seen.is_seen(0.02), "{seen:?}");
    // Of a handful nothing is said.
    assert!(FormDefect::measure(&pairs.rows(0..4)).is_none());
}
