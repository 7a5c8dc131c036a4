//! Fits of symplectic polynomials whose degree is found, and their certificates.

use gyroceptron::Error;
use gyroceptron::flow::{Pairs, Symmetries, SymplecticPolynomial};
use gyroceptron::layer::Reversor;
use gyroceptron::measure::certificate::{
    CertificateOptions, Verdict, certify_map, certify_polynomial,
};
use gyroceptron::measure::internals::unless_stopped;
use gyroceptron::measure::{Coordinate, OneStep, WithDomain};
use gyroceptron::network::Rollout;
use gyroceptron::phase::Map;
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Over, Scalar, max_or_nan};
use gyroceptron::train::{Control, FitNote, FittedPolynomial, PolynomialFit, PolynomialTrial};
use std::time::{Duration, Instant};

/// A turn of each plane before and after a kick by a function of all q that is even in q₂: reversible, and the same
/// after a reflection of the second plane.
fn kicked(z: &mut [f64]) {
    turned(z);
    let dof = z.len() / 2;
    let sum: f64 = 0.4 * z[0] + z[1..dof].iter().map(|q| 0.5 * q * q).sum::<f64>();
    z[dof] -= 0.16 * sum.sin() + 0.2 * z[0] * z[0];
    for k in 1..dof {
        z[dof + k] -= 0.4 * z[k] * sum.sin();
    }
    turned(z);
}

fn turned(z: &mut [f64]) {
    let dof = z.len() / 2;
    for k in 0..dof {
        let (s, c) = (0.4 + 0.2 * k as f64).sin_cos();
        (z[k], z[dof + k]) = (c * z[k] + s * z[dof + k], c * z[dof + k] - s * z[k]);
    }
}

fn pairs_of(dof: usize, count: usize, map: impl Fn(&mut [f64])) -> Pairs {
    let mut stream = Stream::new(8, "points");
    let input: Vec<f64> = (0..count * 2 * dof).map(|_| stream.uniform(-0.6, 0.6)).collect();
    let mut output = input.clone();
    output.chunks_mut(2 * dof).for_each(map);
    Pairs::new("pairs", dof, input, output).expect("pairs")
}

fn run(fit: &PolynomialFit, pairs: Pairs) -> FittedPolynomial {
    fit.run(pairs, &mut |_| Ok(Control::Continue)).expect("a map")
}

/// The degree is raised until the error is one of rounding, or falls no more.
#[test]
fn degrees_are_raised_until_the_error_falls_no_more() {
    let mut seen = Vec::new();
    let fit = PolynomialFit::default();
    let fitted = fit.run(pairs_of(1, 1000, kicked), &mut |trial| {
        seen.push(trial.clone());
        Ok(Control::Continue)
    });
    let fitted = fitted.expect("a map");
    assert_eq!(seen, fitted.trials);
    // Each coefficient is one that the last degree did not have.
    assert!(seen.windows(2).all(|pair| pair[0].parameters < pair[1].parameters));
    let degrees: Vec<usize> = seen.iter().map(|trial| trial.degree).collect();
    assert_eq!(degrees, (2..2 + seen.len()).collect::<Vec<_>>());
    assert_eq!(fitted.chosen(), seen.last().expect("trials"));
    assert!(fitted.chosen().held_out.expect("held out") < 1e-15 && seen[0].error > 1e-4);
    assert_eq!((fitted.pairs, fitted.held_out), (900, 100));
    assert!(fitted.chosen().share < 2e-15 && seen[0].share > 1e-4, "{}", seen[0].share);
    // Of pairs with noise it stays at that of the noise, and says so for pairs that it has not seen.
    let noise = 1e-5;
    let mut stream = Stream::new(3, "noise");
    let of = pairs_of(1, 1000, kicked);
    let output = of.output().iter().map(|v| v + stream.uniform(-noise, noise)).collect();
    let noisy = Pairs::new("pairs", 1, of.input().to_vec(), output).expect("pairs");
    let fitted = run(&fit, noisy.clone());
    let (chosen, last) = (fitted.chosen(), fitted.trials.last().expect("trials"));
    assert!((4..8).contains(&chosen.degree), "{}", chosen.degree);
    assert_eq!(last.degree, chosen.degree + PolynomialFit::PATIENCE);
    // The root mean square of two uniform numbers.
    let expected = noise * (2.0_f64 / 3.0).sqrt();
    let ratio = chosen.held_out.expect("held out") / expected;
    assert!((0.8..1.25).contains(&ratio), "{ratio}");
    // Another choice of held-out pairs, and the same one.
    let other = run(&PolynomialFit { seed: 1, ..fit.clone() }, noisy.clone());
    assert!(other.chosen().held_out != chosen.held_out);
    assert_eq!(run(&fit, noisy).chosen(), chosen);
    // The plane that errs most, by its own spread, is what the search goes by, however small it is.
    let mut stream = Stream::new(8, "points");
    let size = [1.0, 1e-4];
    let input: Vec<f64> = (0..5600).map(|k| size[k % 2] * stream.uniform(-0.2, 0.2)).collect();
    let mut output = input.clone();
    for z in output.chunks_mut(4) {
        turned(z);
        z[2] -= 0.3 * z[0].sin();
        z[3] -= 0.1 * size[1] * (2.0 * z[1] / size[1]).sin();
    }
    let uneven = Pairs::new("pairs", 2, input, output).expect("pairs");
    let uneven = run(&PolynomialFit { validation: 0.2, ..fit.clone() }, uneven);
    assert!(uneven.chosen().share < 1e-12, "{:e}", uneven.chosen().share);
    // Few pairs end the search.
    let few = run(&fit, pairs_of(1, 40, kicked));
    let trial = few.trials.last().expect("trials");
    assert!(trial.parameters * 2 <= 72 && few.trials.len() < 8, "{}", few.trials.len());
}

#[test]
fn a_degree_is_taken_as_it_is_given() {
    let fit = PolynomialFit { degree: Some(4), validation: 0.0, ..PolynomialFit::default() };
    let pairs = pairs_of(2, 400, kicked);
    let fitted = run(&fit, pairs.clone());
    let plain = SymplecticPolynomial::fit(&pairs, 4).expect("a map");
    assert_eq!(fitted.map.map().coefficients(), plain.coefficients());
    assert_eq!((fitted.trials.len(), fitted.held_out), (1, 0));
    assert_eq!(fitted.chosen().error, plain.error_on(&pairs));
    assert_eq!(fitted.digest, pairs.digest());
    let symmetries = Symmetries { reversor: Some(Reversor::Momenta), mirrored: vec![2] };
    let even = run(&PolynomialFit { symmetries, ..fit }, pairs.clone());
    assert!(even.chosen().parameters < 25 && fitted.chosen().parameters == 69);
    assert!(even.chosen().error < 1.5 * fitted.chosen().error);
}

/// The linear part of a map of a large plane and a small one is found with what each does to the other: nothing of it
/// is left for the generating function.
#[test]
fn planes_of_different_sizes_are_coupled_as_they_are() {
    for size in [1.0, 1e-3] {
        let mut stream = Stream::new(2, "points");
        let own = [1.0, size, 1.0, size];
        let input: Vec<f64> = (0..4000).map(|k| own[k % 4] * stream.uniform(-1.0, 1.0)).collect();
        let mut output = input.clone();
        for z in output.chunks_mut(4) {
            turned(z);
            (z[2], z[3]) = (z[2] - 0.5 * size * z[1], z[3] - 0.5 * size * z[0]);
            turned(z);
        }
        let pairs = Pairs::new("pairs", 2, input, output).expect("pairs");
        let map = SymplecticPolynomial::fit(&pairs, 2).expect("a map");
        let largest =
            map.coefficients().iter().fold(0.0, |largest, c| max_or_nan(largest, c.abs()));
        assert!(largest < 1e-14, "{size} {largest:e}");
        assert!(map.error_on(&pairs) < 1e-14);
    }
}

/// Degrees that add no terms are passed over: of an odd map those that are odd.
#[test]
fn degrees_that_add_nothing_are_passed_over() {
    let odd = |z: &mut [f64]| {
        turned(z);
        z[1] -= 0.4 * z[0].sin();
        turned(z);
    };
    let symmetries = Symmetries { reversor: None, mirrored: vec![1] };
    let fitted =
        run(&PolynomialFit { symmetries, ..PolynomialFit::default() }, pairs_of(1, 600, odd));
    let degrees: Vec<usize> = fitted.trials.iter().map(|trial| trial.degree).collect();
    assert!(
        degrees.starts_with(&[2, 4, 6, 8]) && degrees.iter().all(|d| d % 2 == 0),
        "{degrees:?}"
    );
    assert!(fitted.chosen().share < 1e-14, "{:e}", fitted.chosen().share);
}

/// A degree whose equations cannot be solved ends the search, and what was found before stays.
#[test]
fn what_is_found_is_kept() {
    let two = |z: &mut [f64]| {
        for k in 0..2 {
            let (s, c) = (0.4 + 0.3 * k as f64).sin_cos();
            (z[k], z[2 + k]) = (c * z[k] + s * z[2 + k], c * z[2 + k] - s * z[k]);
        }
    };
    let mut stream = Stream::new(1, "points");
    let size = |k: usize| if k.is_multiple_of(2) { 1.0 } else { 1e-12 };
    let input: Vec<f64> = (0..4000).map(|k| size(k) * stream.uniform(-1.0, 1.0)).collect();
    let mut output = input.clone();
    output.chunks_mut(4).for_each(two);
    let pairs = Pairs::new("pairs", 2, input, output).expect("pairs");
    let fitted = run(&PolynomialFit::default(), pairs);
    assert!(fitted.chosen().share < 1e-6, "{:e}", fitted.chosen().share);
}

#[test]
fn pairs_of_no_symplectic_map_are_said() {
    let said = |pairs: Pairs, symmetries: Symmetries| {
        let fit = PolynomialFit { degree: Some(4), symmetries, ..PolynomialFit::default() };
        run(&fit, pairs).notes.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let none = Symmetries::default();
    let of = |reversor| Symmetries { reversor: Some(reversor), ..none.clone() };
    let rubbed = |z: &mut [f64]| {
        kicked(z);
        z[1] *= 0.99;
    };
    let notes = said(pairs_of(1, 800, rubbed), none.clone());
    assert!(notes.len() == 1 && notes[0].contains("dq∧dp by 1.0e-2"), "{notes:?}");
    let notes = said(pairs_of(1, 800, kicked), none.clone());
    assert!(notes.len() == 1 && notes[0].contains("half the coefficients"), "{notes:?}");
    let fit = PolynomialFit { degree: Some(4), ..PolynomialFit::default() };
    let notes = run(&fit, pairs_of(1, 800, kicked)).notes;
    assert!(
        matches!(&notes[..], [FitNote::Reversal(defect)] if defect.reversor == Reversor::Momenta)
    );
    assert!(said(pairs_of(1, 800, kicked), of(Reversor::Momenta)).is_empty());
    let notes = said(pairs_of(1, 800, kicked), of(Reversor::Positions));
    assert!(notes.len() == 1 && notes[0].contains("right reflection"), "{notes:?}");
}

/// Few pairs of a map that is far from all with the reversor: those that count need an iteration less than points among
/// them, where the step would not be symplectic.
#[test]
fn points_among_the_pairs_need_iterations_too() {
    let mut stream = Stream::new(119, "pairs 0");
    let (sin, cos) = stream.uniform(0.3, 1.4).sin_cos();
    let [along, kick, _] = [0; 3].map(|_| stream.uniform(-1.0, 1.0));
    let input: Vec<f64> = (0..720).map(|_| stream.uniform(-1.0, 1.0)).collect();
    let mut output = input.clone();
    for z in output.chunks_exact_mut(2) {
        z[1] -= 0.3 * ((along * z[0]).powi(2) * along + kick);
        (z[0], z[1]) = (cos * z[0] + sin * z[1], cos * z[1] - sin * z[0]);
    }
    let pairs = Pairs::new("pairs", 1, input, output).expect("pairs");
    let symmetries = Symmetries { reversor: Some(Reversor::Momenta), mirrored: Vec::new() };
    let map = SymplecticPolynomial::fit_symmetric(&pairs, 9, &symmetries).expect("a map");
    let mut fewer = serde_json::to_value(&map).expect("JSON");
    fewer["forward"]["iterations"] = (map.iterations() - 1).into();
    let fewer: SymplecticPolynomial = serde_json::from_value(fewer).expect("a polynomial");
    let starts = map.sample(512, &mut Stream::new(7, "samples")).expect("points");
    let request = Rollout { steps: 1, every: 1 };
    let [whole, less] = [&map, &fewer].map(|map| map.rollout(&starts, request).expect("states"));
    let missed = whole.iter().zip(&less).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
    assert!(missed > 1e-12, "{missed:e}");
    let options = CertificateOptions { samples: 200, ..CertificateOptions::default() };
    let certificate = certify_polynomial(&map, options).expect("points");
    assert!(certificate.holds(), "{}", certificate.summary());
}

/// The mirror image of a point has the mirror image of its image, bit for bit, although a start is fitted.
#[test]
fn mirror_images_are_moved_alike_bit_for_bit() {
    let symmetries = Symmetries { reversor: None, mirrored: vec![2] };
    let map = SymplecticPolynomial::fit_symmetric(&pairs_of(2, 2000, kicked), 7, &symmetries);
    let map = map.expect("a map");
    let mut stream = Stream::new(4, "points");
    for _ in 0..200 {
        let mut point = [0; 4].map(|_| stream.uniform(-0.5, 0.5));
        let mut turned = [point[0], -point[1], point[2], -point[3]];
        map.step(&mut point);
        map.step(&mut turned);
        let back = [turned[0], -turned[1], turned[2], -turned[3]];
        assert_eq!(back.map(f64::to_bits), point.map(f64::to_bits));
    }
}

/// The last iterations may take the matrix of the one before: what they find is what Newton's method finds, to
/// rounding, and without them the images are others.
#[test]
fn frozen_iterations_find_what_newtons_method_finds() {
    let pairs = pairs_of(2, 4000, kicked);
    let symmetries = Symmetries { reversor: Some(Reversor::Momenta), mirrored: vec![2] };
    let starts: Vec<f64> = pairs.input()[..400].to_vec();
    let mut needed = Vec::new();
    for degree in 4..=10 {
        let map = SymplecticPolynomial::fit_symmetric(&pairs, degree, &symmetries).expect("a map");
        let text = serde_json::to_value(&map).expect("JSON");
        let Some(frozen) = text["forward"]["frozen"].as_u64() else { continue };
        let with = |iterations: u64, frozen: u64| {
            let mut other = text.clone();
            other["forward"]["iterations"] = iterations.into();
            other["forward"]["frozen"] = frozen.into();
            let other: SymplecticPolynomial = serde_json::from_value(other).expect("a polynomial");
            other.check().expect("a sound one");
            let request = Rollout { steps: 1, every: 1 };
            other.rollout(&starts, request).expect("states")[starts.len()..].to_vec()
        };
        let iterations = map.iterations() as u64;
        let apart = |a: Vec<f64>, b: Vec<f64>| -> f64 {
            a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan)
        };
        let own = with(iterations, frozen);
        let missed = apart(own.clone(), with(iterations + 2, 0));
        assert!(missed < 4e-16, "{degree}: {missed:e}");
        needed.push(apart(own, with(iterations - 1, frozen - 1)));
        // All of them cannot be frozen.
        let mut wrong = text.clone();
        wrong["forward"]["frozen"] = iterations.into();
        let wrong: SymplecticPolynomial = serde_json::from_value(wrong).expect("a polynomial");
        let error = wrong.check().expect_err("no matrix").to_string();
        assert!(error.contains("frozen iterations"), "{error}");
    }
    let found = needed.iter().filter(|apart| **apart > 1e-14).count();
    assert!(found >= 2, "{needed:?}");
}

/// Files whose starts are not what the symmetries ask for are refused, before a step would fail.
#[test]
fn starts_of_other_coordinates_are_refused() {
    let none = Symmetries::default();
    let second = Symmetries { reversor: None, mirrored: vec![2] };
    let all = Symmetries { reversor: None, mirrored: vec![1, 2] };
    let refused = |symmetries: &Symmetries, change: &dyn Fn(&mut serde_json::Value)| -> String {
        let map = SymplecticPolynomial::fit_symmetric(&pairs_of(2, 800, kicked), 4, symmetries);
        let mut text = serde_json::to_value(map.expect("a map")).expect("JSON");
        let sound: SymplecticPolynomial = serde_json::from_value(text.clone()).expect("sound");
        sound.check().expect("sound");
        change(&mut text["forward"]["start"]);
        let map: SymplecticPolynomial = serde_json::from_value(text).expect("a polynomial");
        map.check().expect_err("refused").to_string()
    };
    let empty = |start: &mut serde_json::Value| {
        let mut own = start.clone();
        own["coefficients"] = serde_json::json!([]);
        start["mirrored"] = own;
    };
    for symmetries in [&none, &all] {
        let error = refused(symmetries, &empty);
        assert!(error.contains("start: coordinates"), "{error}");
    }
    let nested = |start: &mut serde_json::Value| {
        let own = start["mirrored"].clone();
        start["mirrored"]["mirrored"] = own;
    };
    let error = refused(&second, &nested);
    assert!(error.contains("start: coordinates"), "{error}");
    let off = |start: &mut serde_json::Value| start["basis"]["centre"][1] = 0.1.into();
    let error = refused(&second, &off);
    assert!(error.contains("start: box"), "{error}");
}

/// A file of before coordinates had an order and starts a parity, and its images with the bits that they had.
#[test]
fn older_files_are_read_to_the_same_bits() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = path.join("tests/models/version-1-polynomial.json");
    let stored = gyroceptron::io::load_polynomial(&path).expect("a polynomial");
    let points = [
        [-0.41435083285637564, -0.2631894934039003, 0.3012744652063969, 0.08216203606436778],
        [-0.4058713577596008, -0.0668730597635262, -0.020948701859165975, -0.34026108536292143],
        [0.23457715140921453, -0.3863279800785966, -0.10877180950433796, 0.016740182621363675],
    ];
    let images: [[u64; 4]; 3] = [
        [0xbf9a4af39742481d, 0x3f93cef099fe1f0a, 0x3fe042f6be44d88f, 0x3fd1cd41ddca443d],
        [0xbfd19c6ccdc89456, 0xbfd5f9bb3ce2a6c7, 0x3fd34ebf92ad812a, 0xbf90eafb016a2da7],
        [0x3fb0706884f7a1c7, 0xbfb8960754e40a35, 0xbfcfc6061c347206, 0x3fd7e4c1b3ca5443],
    ];
    for (mut point, image) in points.into_iter().zip(images) {
        stored.map.map().step(&mut point);
        assert_eq!(point.map(f64::to_bits), image);
    }
}

/// Pairs in coordinates that are not canonical have no images by a generating function: what is wrong with them is
/// said, and not that Newton's method failed.
#[test]
fn pairs_that_keep_no_area_differ_from_a_failure() {
    let squeezed = |z: &mut [f64]| {
        kicked(z);
        for (k, v) in z.iter_mut().enumerate() {
            *v *= 1.0 + 0.9 * (3.0 * *v + k as f64).sin();
        }
    };
    let fit = PolynomialFit { degree: Some(9), ..PolynomialFit::default() };
    let error = fit.run(pairs_of(2, 1500, squeezed), &mut |_| Ok(Control::Continue));
    let text = error.expect_err("no symplectic map").to_string();
    assert!(text.contains("areas up to") && text.contains("canonical coordinates"), "{text}");
}

/// Points to sample fill the box of the pairs, 1/√2 as wide about its middle: the pairs of the identity have no other
/// frame than that of the axes.
#[test]
fn sampled_points_fill_their_box() {
    let mut stream = Stream::new(5, "box");
    let input: Vec<f64> = (0..800).map(|_| stream.uniform(1.0, 3.0)).collect();
    let largest = |values: &[f64]| values.iter().map(|v| (v - 2.0).abs()).fold(0.0, max_or_nan);
    let pairs = Pairs::new("pairs", 1, input.clone(), input.clone()).expect("pairs");
    let map = SymplecticPolynomial::fit(&pairs, 3).expect("a map");
    let points = map.sample(2000, &mut Stream::new(7, "samples")).expect("points");
    let share = largest(&points) / largest(&input) * 2.0_f64.sqrt();
    assert!((share - 1.0).abs() < 4e-3, "{share}");
}

/// A kick by x³/3 − xy² commutes with the reflection of the second plane, and not with that of the first.
#[test]
fn planes_of_mirrors_are_recommended_and_wrong_ones_said() {
    let sextupole = |z: &mut [f64]| {
        let (x, y) = (z[0], z[1]);
        z[2] -= 0.4 * (x * x - y * y);
        z[3] += 0.8 * x * y;
        for (j, angle) in [(0, 0.9_f64), (1, 1.3)] {
            let (s, c) = angle.sin_cos();
            (z[j], z[2 + j]) = (c * z[j] + s * z[2 + j], c * z[2 + j] - s * z[j]);
        }
    };
    let pairs = || pairs_of(2, 600, sextupole);
    let of = |mirrored: Vec<usize>| {
        let symmetries = Symmetries { reversor: None, mirrored };
        run(&PolynomialFit { degree: Some(4), symmetries, ..PolynomialFit::default() }, pairs())
    };
    let mirror = |notes: &[FitNote]| {
        notes.iter().find_map(|note| match note {
            FitNote::Mirror(defect) => Some((defect.clone(), note.to_string())),
            _ => None,
        })
    };
    let (defect, text) = mirror(&of(Vec::new()).notes).expect("a recommendation");
    assert!(defect.planes == [2] && !defect.is_seen() && defect.median < 1e-9, "{defect:?}");
    assert!(text.contains("(q2, p2)") && text.contains("half the coefficients"), "{text}");
    assert_eq!(mirror(&of(vec![2]).notes), None);
    let (defect, text) = mirror(&of(vec![1]).notes).expect("a warning");
    // By the literal definition, of the map itself: reflected, its kick has another sign.
    let pairs = pairs();
    let mut off: Vec<f64> = Vec::new();
    let mut motion = 0.0;
    for (z, w) in pairs.input().chunks(4).zip(pairs.output().chunks(4)) {
        let mut image = [-z[0], z[1], -z[2], z[3]];
        sextupole(&mut image);
        let expected = [-w[0], w[1], -w[2], w[3]];
        let apart =
            |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum() };
        off.push(apart(&image, &expected).sqrt());
        motion += apart(z, w);
    }
    off.sort_by(f64::total_cmp);
    let expected = off[off.len() / 2] / (motion / off.len() as f64).sqrt();
    assert!(defect.is_seen() && (defect.median / expected - 1.0).abs() < 0.1, "{defect:?}");
    assert!(text.contains("(q1, p1)") && text.contains("right planes"), "{text}");
}

#[test]
fn fits_that_cannot_be_are_refused() {
    let pairs = || pairs_of(1, 100, kicked);
    let refused = |fit: &PolynomialFit, pairs: Pairs| {
        let mut go_on = |_: &PolynomialTrial| Ok(Control::Continue);
        fit.run(pairs, &mut go_on).expect_err("refused").to_string()
    };
    let fit = PolynomialFit::default;
    for validation in [-0.1, 1.0, f64::NAN] {
        let message = refused(&PolynomialFit { validation, ..fit() }, pairs());
        assert!(message.contains("validation"), "{message}");
    }
    let message = refused(&PolynomialFit { validation: 0.0, ..fit() }, pairs());
    assert!(message.contains("choose the degree"), "{message}");
    for degree in [1, 50, usize::MAX] {
        let message = refused(&PolynomialFit { degree: Some(degree), ..fit() }, pairs());
        assert!(message.contains("degree of a generating function"), "{message}");
    }
    assert!(refused(&fit(), pairs_of(1, 5, kicked)).contains("more pairs"));
    assert!(refused(&fit(), pairs_of(1, 1, kicked)).contains("0.1 of 1 pairs"));
    let mirrored = Symmetries { mirrored: vec![2], ..Symmetries::default() };
    let message = refused(&PolynomialFit { symmetries: mirrored, ..fit() }, pairs());
    assert!(message.contains("mirrored plane"), "{message}");
    let mut calls = 0;
    let stopped = fit().run(pairs(), &mut |_| {
        calls += 1;
        Ok(if calls < 3 { Control::Continue } else { Control::Interrupt })
    });
    assert!(matches!(stopped, Err(Error::Stopped { .. })) && calls == 3);
}

/// Steps with one and with several iterations of Newton's method are certified, and none of the laws is vacuous.
#[test]
fn polynomials_are_certified_and_their_mutants_rejected() {
    let options = CertificateOptions { samples: 8, ..CertificateOptions::default() };
    let both = Symmetries { reversor: Some(Reversor::Momenta), mirrored: vec![2] };
    let none = Symmetries::default();
    let mut iterations = Vec::new();
    for (dof, degree, symmetries) in [
        (1, 4, &none),
        (1, 12, &none),
        (2, 3, &none),
        (2, 5, &none),
        (2, 6, &both),
        (3, 3, &none),
        (4, 2, &none),
    ] {
        let pairs = pairs_of(dof, 800, kicked);
        let map = SymplecticPolynomial::fit_symmetric(&pairs, degree, symmetries).expect("a map");
        iterations.push(map.iterations());
        for map in [&map, &map.inverted()] {
            let certificate = certify_polynomial(map, options).expect("a box");
            assert!(certificate.holds(), "{dof} {degree} {}", certificate.summary());
            let laws: Vec<&str> = certificate.rows.iter().map(|row| &*row.law).collect();
            for (law, claimed) in [
                ("reversibility", symmetries.reversor.is_some()),
                ("mirror", !symmetries.mirrored.is_empty()),
            ] {
                assert_eq!(laws.contains(&law), claimed, "{laws:?}");
            }
            assert!(certificate.sampled_box().contains(" × "), "{}", certificate.sampled_box());
        }
    }
    iterations.sort_unstable();
    assert!(iterations[0] == 1 && iterations[iterations.len() - 1] >= 2, "{iterations:?}");
    // Images far from where the points are, and strong shears.
    for far in [
        pairs_of(1, 1500, |z| (z[0], z[1]) = (z[0] + 4.0, z[1] + 3.0 - z[0].sin())),
        pairs_of(1, 1500, |z| z[1] -= (3.0 * z[0]).sin()),
    ] {
        let fitted = run(&PolynomialFit::default(), far);
        let certificate = certify_polynomial(fitted.map.map(), options).expect("points");
        assert!(certificate.holds(), "{}", certificate.summary());
        assert!(fitted.chosen().share < 1e-12, "{:e}", fitted.chosen().share);
    }
    // Symmetries that the coefficients do not have.
    let skew = |z: &mut [f64]| {
        kicked(z);
        z[2] -= 0.3 * z[0] * z[1];
        z[3] -= 0.15 * z[0] * z[0];
    };
    let plain = SymplecticPolynomial::fit(&pairs_of(2, 1500, skew), 4).expect("a map");
    let mut claims = serde_json::to_value(&plain).expect("JSON");
    claims["symmetries"] = serde_json::json!({ "reversor": "momenta", "mirrored": [2] });
    let claims: SymplecticPolynomial = serde_json::from_value(claims).expect("a polynomial");
    assert!(claims.check().is_err());
    let certificate = certify_polynomial(&claims, options).expect("points");
    for law in ["reversibility", "mirror"] {
        let row = certificate.rows.iter().find(|row| row.law == law).expect("a row");
        assert_eq!(row.verdict, Verdict::Violated, "{law}");
    }
    let map = SymplecticPolynomial::fit(&pairs_of(2, 1500, kicked), 6).expect("a map");
    let domain = vec![Coordinate::Between(-0.2, 0.2); 4];
    let rejects = |mutant: Mutant<'_>, law: &str| {
        let map = WithDomain::new(OneStep(mutant), domain.clone()).expect("a domain");
        let certificate = certify_map(&map, options);
        let violated =
            |row: &&gyroceptron::measure::certificate::Row| row.verdict == Verdict::Violated;
        let laws: Vec<&str> =
            certificate.rows.iter().filter(violated).map(|row| &*row.law).collect();
        assert!(laws.iter().any(|found| found.contains(law)), "{law}: {laws:?}");
    };
    rejects(Mutant { map: &map, friction: 1e-12, has_wrong_inverse: false }, "symplecticity");
    rejects(Mutant { map: &map, friction: 0.0, has_wrong_inverse: true }, "inversion");
}

/// A polynomial with friction after each step, or with the map itself, of a reflected point, in place of its inverse.
struct Mutant<'a> {
    map: &'a SymplecticPolynomial,
    friction: f64,
    has_wrong_inverse: bool,
}

impl<S: Scalar + Over<f64>> Map<S> for Mutant<'_> {
    fn dof(&self) -> usize {
        Map::<S>::dof(self.map)
    }
    fn forward(&self, z: &mut [S]) {
        self.map.forward(z);
        z[3] = z[3].times(1.0 - self.friction);
    }
    fn inverse(&self, z: &mut [S]) {
        if self.has_wrong_inverse {
            // The momenta of a reversible map, but for a small part.
            z[2] = -z[2];
            z[3] = -z[3];
            self.map.forward(z);
            z[2] = -z[2];
            z[3] = z[3].times(-1.0 - 1e-12);
        } else {
            z[3] = z[3].times(1.0 / (1.0 - self.friction));
            self.map.inverse(z);
        }
    }
}

/// A certificate that is stopped in the middle of any of its laws ends.
#[test]
fn certificates_of_polynomials_can_be_stopped() {
    let map = SymplecticPolynomial::fit(&pairs_of(1, 800, kicked), 6).expect("a map");
    let options = CertificateOptions { samples: 200_000, ..CertificateOptions::default() };
    for milliseconds in [1, 60, 120, 180, 300] {
        let begin = Instant::now();
        let go_on = move || begin.elapsed() < Duration::from_millis(milliseconds);
        assert!(unless_stopped(go_on, || certify_polynomial(&map, options)).is_none());
        assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
    }
}
