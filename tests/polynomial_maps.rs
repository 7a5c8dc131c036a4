//! Maps by polynomials, symplectic and not.

use faer::MatRef;
use gyroceptron::Error;
use gyroceptron::flow::{
    Pairs, PolynomialMap, PolynomialOnSection, Symmetries, SymplecticPolynomial,
};
use gyroceptron::io::{
    Provenance, StoredPolynomial, load_polynomial, parse_polynomial, polynomial_text,
    save_polynomial,
};
use gyroceptron::layer::Reversor;
use gyroceptron::measure::orbits::periodic_orbit;
use gyroceptron::measure::ratios::symplecticity_defect;
use gyroceptron::network::{Pace, Rollout};
use gyroceptron::phase::{AreaDensity, Section};
use gyroceptron::random::Stream;
use gyroceptron::scalar::max_or_nan;

/// What is a polynomial is found to rounding, and at no lower degree.
#[test]
fn polynomial_maps_reproduce_polynomials() {
    // Hénon's map, of degree 2.
    let henon = |z: &[f64]| [0.3 * z[0] + z[1] - z[0] * z[0], -z[0]];
    let mut stream = Stream::new(5, "points");
    let input: Vec<f64> = (0..400).map(|_| stream.uniform(-1.0, 2.0)).collect();
    let output: Vec<f64> = input.chunks(2).flat_map(henon).collect();
    let pairs = Pairs::new("pairs", 1, input, output).expect("pairs");
    let fitted = PolynomialMap::fit(&pairs, 2).expect("a map");
    assert_eq!((fitted.parameters(), fitted.degree()), (12, 2));
    assert!(fitted.error_on(&pairs) < 1e-13, "{}", fitted.error_on(&pairs));
    let linear = PolynomialMap::fit(&pairs, 1).expect("a map");
    let both = pairs.input().chunks(2).zip(pairs.output().chunks(2));
    let squares = both.map(|(z, expected)| {
        let mut image = [z[0], z[1]];
        linear.step(&mut image);
        (image[0] - expected[0]).powi(2) + (image[1] - expected[1]).powi(2)
    });
    let rms = (squares.sum::<f64>() / 200.0).sqrt();
    assert!(rms > 1e-2 && (linear.error_on(&pairs) / rms - 1.0).abs() < 1e-12, "{rms}");
    let (best, error) = PolynomialMap::fit_best(&pairs, 7).expect("a map");
    assert!(best.degree() >= 2 && error < 1e-12, "{} {error}", best.degree());
    let jacobian = fitted.jacobian(&[0.5, -0.2]);
    for (found, expected) in jacobian.iter().zip([-0.7, 1.0, -1.0, 0.0]) {
        assert!((found - expected).abs() < 1e-12, "{jacobian:?}");
    }
    // Orbits in lanes are those of one step after another, however many go beside: of 2, 4 and 6 coordinates.
    for dof in 1..=3 {
        let dim = 2 * dof;
        let input: Vec<f64> = (0..400 * dim).map(|_| stream.uniform(-1.0, 1.0)).collect();
        let output = input.iter().map(|v| 0.4 * v - 0.2 * v * v).collect();
        let pairs = Pairs::new("pairs", dof, input, output).expect("pairs");
        let fitted = PolynomialMap::fit(&pairs, 3).expect("a map");
        for points in [1, 8, 13, 75] {
            let start: Vec<f64> = (0..points * dim).map(|_| stream.uniform(-0.5, 0.5)).collect();
            let states = fitted.rollout(&start, Rollout { steps: 6, every: 2 }).expect("orbits");
            assert_eq!(states.len(), 4 * start.len());
            for (m, z) in start.chunks(dim).enumerate() {
                let mut z = z.to_vec();
                for t in 0..4 {
                    assert_eq!(states[t * start.len() + dim * m..][..dim], z[..], "{m} {t}");
                    (0..2).for_each(|_| fitted.step(&mut z));
                }
            }
        }
    }
    // Too few pairs, and a coordinate that says nothing.
    assert!(PolynomialMap::fit(&pairs, 30).is_err());
    let flat = Pairs::new("flat", 1, vec![0.0, 1.0, 0.0, 2.0], vec![0.0; 4]).expect("pairs");
    assert!(PolynomialMap::fit(&flat, 0).is_err());
}

/// Points in a box of this half extent, and their images.
pub(crate) fn pairs_of(dof: usize, count: usize, half: f64, map: impl Fn(&mut [f64])) -> Pairs {
    let mut stream = Stream::new(6, "points");
    let input: Vec<f64> = (0..count * 2 * dof).map(|_| stream.uniform(-half, half)).collect();
    let mut output = input.clone();
    output.chunks_mut(2 * dof).for_each(map);
    Pairs::new("pairs", dof, input, output).expect("pairs")
}

/// Each plane is turned by its own angle after a kick by the gradient of a function of all q: symplectic, with a
/// generating function that is no polynomial.
fn kick_and_turn(z: &mut [f64]) {
    let dof = z.len() / 2;
    let sum: f64 = z[..dof].iter().sum();
    for k in 0..dof {
        z[dof + k] -= 0.3 * sum.sin() + 0.2 * z[k].powi(2);
        let (s, c) = (0.7 + 0.4 * k as f64).sin_cos();
        (z[k], z[dof + k]) = (c * z[k] + s * z[dof + k], c * z[dof + k] - s * z[k]);
    }
}

/// The largest entry of |JᵀΩJ − Ω|.
fn form_defect(jacobian: &[f64], dof: usize) -> f64 {
    let dim = 2 * dof;
    let defect = symplecticity_defect(MatRef::from_row_major_slice(jacobian, dim, dim));
    let entries = (0..dim * dim).map(|k| defect[(k / dim, k % dim)].abs());
    entries.fold(0.0, max_or_nan)
}

/// A polynomial generating function is found to rounding; others are approached, by maps that are symplectic at every
/// degree, and keep what such maps keep over long times.
#[test]
fn symplectic_polynomials_are_symplectic_at_every_degree() {
    // Hénon's map is a linear one after a kick by a cubic function of q.
    let henon = |z: &mut [f64]| (z[0], z[1]) = (0.3 * z[0] + z[1] - z[0] * z[0], -z[0]);
    let pairs = pairs_of(1, 300, 0.6, henon);
    let fitted = SymplecticPolynomial::fit(&pairs, 3).expect("a map");
    assert_eq!((fitted.parameters(), fitted.degree()), (9, 3));
    // Monomials of degree 0 to 3 in two numbers: one more than parameters, as a constant moves nothing.
    assert_eq!(SymplecticPolynomial::terms(1, 3, &Symmetries::default()), Some(10));
    assert!(fitted.error_on(&pairs) < 1e-14, "{}", fitted.error_on(&pairs));
    let coarse = SymplecticPolynomial::fit(&pairs, 2).expect("a map");
    assert!(coarse.error_on(&pairs) > 1e-2, "{}", coarse.error_on(&pairs));
    for (dof, degrees, errors) in
        [(1, [4, 8, 16], [1e-5, 1e-11, 1e-15]), (2, [3, 5, 8], [1e-2, 1e-4, 1e-8])]
    {
        let pairs = pairs_of(dof, 1500, 0.5, kick_and_turn);
        for (degree, most) in degrees.into_iter().zip(errors) {
            let fitted = SymplecticPolynomial::fit(&pairs, degree).expect("a map");
            let error = fitted.error_on(&pairs);
            assert!(error < most, "{dof} {degree} {error:e}");
            for z in pairs.input().chunks(2 * dof).take(50) {
                let defect = form_defect(&fitted.jacobian(z), dof);
                assert!(defect < 1e-13, "{dof} {degree} {defect:e}");
            }
        }
    }
    // Three degrees of freedom: a kick by a cubic function that couples all planes, between two turns, exactly.
    let turn = |z: &mut [f64]| {
        for k in 0..3 {
            let (s, c) = (0.5 + 0.3 * k as f64).sin_cos();
            (z[k], z[3 + k]) = (c * z[k] + s * z[3 + k], c * z[3 + k] - s * z[k]);
        }
    };
    let cubic = |z: &mut [f64]| {
        turn(z);
        let (a, b, c) = (z[0], z[1], z[2]);
        (z[3], z[4], z[5]) = (z[3] - 0.2 * b * c, z[4] - 0.2 * a * c, z[5] - 0.2 * a * b);
        turn(z);
    };
    let pairs = pairs_of(3, 2000, 0.4, cubic);
    let [low, high] =
        [2, 3].map(|degree| SymplecticPolynomial::fit(&pairs, degree).expect("a map"));
    let [low, high_error] = [&low, &high].map(|map| map.error_on(&pairs));
    assert!(high_error < 1e-14 && low > 1e-3, "{low:e} {high_error:e}");
    let least = pairs.input().chunks(6).take(20).map(|z| form_defect(&high.jacobian(z), 3));
    least.for_each(|defect| assert!(defect < 1e-13, "{defect:e}"));
}

/// On the curve of a chain that is thinner than what counts as closed, orbits are found all the same: Newton's steps
/// −tan θ may hardly shrink at first.
#[test]
fn orbits_of_a_thin_chain_are_found() {
    const EPSILON: f64 = 5e-10;
    let thin = |z: &[f64]| {
        let (s, c) = (EPSILON * z[0].sin(), EPSILON * z[0].cos());
        let p = z[1] + s;
        Ok((vec![z[0] + p, p], vec![1.0 + c, 1.0, c, 1.0]))
    };
    for start in [0.3, 1.0, 1.16, 1.3, 1.5] {
        let found = periodic_orbit(&thin, &[start, 0.0], 1).expect("an orbit");
        assert!(found.points[0][0].sin().abs() < 1e-4, "{start} {:?}", found.points);
    }
}

/// Half a turn by an angle in each plane, a kick, a shear of the positions, the same kick, and the other half turn: a
/// palindrome, so that R∘P∘R = P⁻¹ for the reflection R of the momenta.
fn half_turns_and_kick(z: &mut [f64]) {
    let dof = z.len() / 2;
    let half_turns = |z: &mut [f64]| {
        for k in 0..dof {
            let (s, c) = (0.35 + 0.2 * k as f64).sin_cos();
            (z[k], z[dof + k]) = (c * z[k] + s * z[dof + k], c * z[dof + k] - s * z[k]);
        }
    };
    half_turns(z);
    let sum: f64 = z[..dof].iter().sum();
    for k in 0..dof {
        z[dof + k] -= 0.3 * sum.sin() + 0.2 * z[k].powi(2);
    }
    let moved: f64 = z[dof..].iter().sum();
    (0..dof).for_each(|k| z[k] += 0.1 * moved.sin());
    let sum: f64 = z[..dof].iter().sum();
    for k in 0..dof {
        z[dof + k] -= 0.3 * sum.sin() + 0.2 * z[k].powi(2);
    }
    half_turns(z);
}

/// An even generating function has half the terms, errs as little, and is of a reversible map for all coefficients;
/// pairs of another map are fitted badly.
#[test]
fn reversible_polynomials_are_reversible_at_every_degree() {
    for (dof, degrees) in [(1, [5, 10]), (2, [3, 6])] {
        let dim = 2 * dof;
        let of_momenta = pairs_of(dof, 1500, 0.4, half_turns_and_kick);
        // The same map in the coordinates (p, −q).
        let exchanged = |points: &[f64]| -> Vec<f64> {
            let exchange = |z: &[f64]| [z[dof..].to_vec(), z[..dof].iter().map(|v| -v).collect()];
            points.chunks(dim).flat_map(exchange).flatten().collect()
        };
        let [input, output] = [of_momenta.input(), of_momenta.output()].map(exchanged);
        let of_positions = Pairs::new("pairs", dof, input, output).expect("pairs");
        let both = [(&of_momenta, Reversor::Momenta), (&of_positions, Reversor::Positions)];
        for (pairs, reversor) in both {
            for degree in degrees {
                let whole = SymplecticPolynomial::fit(pairs, degree).expect("a map");
                let even =
                    SymplecticPolynomial::fit_reversible(pairs, degree, reversor).expect("a map");
                assert!(even.parameters() < whole.parameters() * 3 / 5, "{}", even.parameters());
                let [error, own] = [&whole, &even].map(|map| map.error_on(pairs));
                assert!(own < 2.0 * error && error < 1e-2, "{dof} {degree} {error:e} {own:e}");
                for z in pairs.input().chunks(dim).take(50) {
                    let defect = form_defect(&even.jacobian(z), dof);
                    assert!(defect < 1e-13, "{dof} {degree} {defect:e}");
                    let mut back = z.to_vec();
                    for _ in 0..2 {
                        even.step(&mut back);
                        reversor.half().split(dof, &mut back).1.iter_mut().for_each(|v| *v = -*v);
                    }
                    let off = back.iter().zip(z).map(|(a, b)| (a - b).abs());
                    let off = off.fold(0.0, max_or_nan);
                    assert!(off < 1e-13, "{dof} {degree} {off:e}");
                }
            }
            let other = match reversor {
                Reversor::Momenta => Reversor::Positions,
                Reversor::Positions => Reversor::Momenta,
            };
            let wrong = SymplecticPolynomial::fit_reversible(pairs, degrees[1], other);
            assert!(wrong.is_err() || wrong.is_ok_and(|map| !(map.error_on(pairs) < 1e-3)));
        }
    }
    // Pairs of one direction, whose mirrored images are far from them: it is reversible there too, to rounding.
    let [mut input, mut output] = [Vec::new(), Vec::new()];
    let pairs = pairs_of(1, 20_000, 0.8, half_turns_and_kick);
    for (from, to) in pairs.input().chunks(2).zip(pairs.output().chunks(2)) {
        if from[1] > 0.3 && from[0].abs() < 0.2 * from[1] {
            input.extend_from_slice(from);
            output.extend_from_slice(to);
        }
    }
    let part = Pairs::new("pairs", 1, input, output).expect("pairs");
    let even = SymplecticPolynomial::fit_reversible(&part, 10, Reversor::Momenta).expect("a map");
    for z in part.input().chunks(2) {
        let mut back = z.to_vec();
        for _ in 0..2 {
            even.step(&mut back);
            back[1] = -back[1];
        }
        let off = (back[0] - z[0]).abs().max((back[1] - z[1]).abs());
        assert!(off < 1e-13, "{off:e}");
    }
    for few in [3, 5] {
        let pairs = pairs_of(1, few, 0.5, half_turns_and_kick);
        let refused = SymplecticPolynomial::fit_reversible(&pairs, 2, Reversor::Momenta);
        let message = refused.expect_err("too few").to_string();
        assert!(message.contains("degree of a generating function"), "{message}");
    }
    // A turn by half a turn has no square root that is near the identity.
    let opposite = pairs_of(1, 200, 0.5, |z: &mut [f64]| (z[0], z[1]) = (-z[0], -z[1]));
    let refused = SymplecticPolynomial::fit_reversible(&opposite, 4, Reversor::Momenta);
    let message = refused.expect_err("no root").to_string();
    assert!(message.contains("half a turn"), "{message}");
}

/// A coupling of two planes whose potential is even in q₂, after and before turns of each: the map commutes with the
/// reflection of the second plane, and is its own inverse after one of the momenta.
fn coupled_evenly(z: &mut [f64]) {
    half_turn_of_each(z);
    let (a, b) = (z[0], z[1]);
    z[2] -= 0.4 * a.sin() + 0.3 * b * b * (1.0 + a);
    z[3] -= 0.2 * b.sin() + 0.6 * b * (a + 0.5 * a * a);
    half_turn_of_each(z);
}

fn half_turn_of_each(z: &mut [f64]) {
    for k in 0..2 {
        let (s, c) = (0.35 + 0.2 * k as f64).sin_cos();
        (z[k], z[2 + k]) = (c * z[k] + s * z[2 + k], c * z[2 + k] - s * z[k]);
    }
}

/// With a mirror there are about half of the coefficients, with a reversor too a quarter, the error stays, and the map
/// has these symmetries for all coefficients, also where all pairs are on one side.
#[test]
fn mirrored_polynomials_commute_with_the_mirror_at_every_degree() {
    let all = pairs_of(2, 1500, 0.4, coupled_evenly);
    let (mut input, mut output) = (Vec::new(), Vec::new());
    for (from, to) in all.input().chunks(4).zip(all.output().chunks(4)) {
        if from[1] > 0.0 {
            input.extend_from_slice(from);
            output.extend_from_slice(to);
        }
    }
    let one_sided = Pairs::new("pairs", 2, input, output).expect("pairs");
    let mirror = |z: &[f64]| vec![z[0], -z[1], z[2], -z[3]];
    let off =
        |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
    for degree in [3, 6] {
        let whole = SymplecticPolynomial::fit(&all, degree).expect("a map");
        let mut counts = vec![whole.parameters()];
        for (pairs, reversor) in [
            (&all, None),
            (&one_sided, None),
            (&all, Some(Reversor::Momenta)),
            (&one_sided, Some(Reversor::Momenta)),
        ] {
            let symmetries = Symmetries { reversor, mirrored: vec![2] };
            let even = SymplecticPolynomial::fit_symmetric(pairs, degree, &symmetries);
            let even = even.expect("a map");
            counts.push(even.parameters());
            let [error, own] = [&whole, &even].map(|map| map.error_on(&all));
            assert!(own < 2.0 * error && error < 1e-2, "{degree} {error:e} {own:e}");
            for z in all.input().chunks(4).take(100) {
                let image = |z: &[f64]| {
                    let mut image = z.to_vec();
                    even.step(&mut image);
                    image
                };
                let apart = off(&image(&mirror(z)), &mirror(&image(z)));
                assert!(apart < 1e-14, "{degree} {apart:e}");
                let defect = form_defect(&even.jacobian(z), 2);
                assert!(defect < 1e-13, "{degree} {defect:e}");
                if reversor.is_some() {
                    let reverse = |z: &[f64]| vec![z[0], z[1], -z[2], -z[3]];
                    let apart = off(&reverse(&image(&reverse(&image(z)))), z);
                    assert!(apart < 1e-13, "{degree} {apart:e}");
                }
            }
        }
        // S of two planes has terms of four coordinates; even are those whose degrees in two of them have an even sum.
        let count = |is_term: fn([usize; 4]) -> bool| {
            let digits = |n: usize| [n / 512, n / 64 % 8, n / 8 % 8, n % 8];
            let terms = (1..4096).map(digits).filter(|t| t.iter().sum::<usize>() <= degree);
            terms.filter(|t| is_term(*t)).count()
        };
        let mirrored = count(|[_, b, _, d]| (b + d) % 2 == 0);
        let both = count(|[a, b, _, d]| (b + d) % 2 == 0 && (a + b) % 2 == 0);
        assert_eq!(counts, [count(|_| true), mirrored, mirrored, both, both]);
    }
    // Of another map a fit with the mirror errs.
    let skew = pairs_of(2, 1000, 0.4, kick_and_turn);
    let mirrored = |planes: &[usize]| Symmetries { mirrored: planes.to_vec(), reversor: None };
    let wrong = SymplecticPolynomial::fit_symmetric(&skew, 4, &mirrored(&[2])).expect("a map");
    let right = SymplecticPolynomial::fit(&skew, 4).expect("a map");
    assert!(wrong.error_on(&skew) > 1e-2 && right.error_on(&skew) < 1e-3);
    // An odd map of one plane, which has the constant and the terms of even degrees.
    let odd = pairs_of(1, 500, 0.5, |z: &mut [f64]| {
        z[1] -= z[0].sin();
        (z[0], z[1]) = (0.6 * z[0] + 0.8 * z[1], 0.6 * z[1] - 0.8 * z[0]);
    });
    let fitted = SymplecticPolynomial::fit_symmetric(&odd, 10, &mirrored(&[1])).expect("a map");
    assert_eq!(fitted.parameters(), 3 + 5 + 7 + 9 + 11);
    assert!(fitted.error_on(&odd) < 1e-7, "{:e}", fitted.error_on(&odd));
    let mut centre = [0.0, 0.0];
    fitted.step(&mut centre);
    assert_eq!(centre, [0.0, 0.0]);
    for (planes, said) in
        [(vec![3], "mirrored plane"), (vec![0], "mirrored plane"), (vec![1, 1], "each once")]
    {
        let refused = SymplecticPolynomial::fit_symmetric(&skew, 4, &mirrored(&planes));
        let message = refused.expect_err("refused").to_string();
        assert!(message.contains(said), "{message}");
    }
}

/// The inverse of the inverse is the map; both lead back to rounding, at points of the box that no pair has, and both
/// are symplectic.
#[test]
fn symplectic_polynomials_are_undone_by_their_inverses() {
    let one = pairs_of(1, 800, 0.5, kick_and_turn);
    let two = pairs_of(2, 2000, 0.4, kick_and_turn);
    let reversible = pairs_of(2, 2000, 0.4, half_turns_and_kick);
    let mirrored = pairs_of(2, 2000, 0.4, coupled_evenly);
    // The same map in the coordinates (p, −q), and one of four planes.
    let exchanged = |points: &[f64]| -> Vec<f64> {
        points.chunks(4).flat_map(|z| [z[2], z[3], -z[0], -z[1]]).collect()
    };
    let [input, output] = [mirrored.input(), mirrored.output()].map(exchanged);
    let exchanged = Pairs::new("pairs", 2, input, output).expect("pairs");
    let four = pairs_of(4, 2000, 0.3, kick_and_turn);
    let of = |reversor, planes: &[usize]| Symmetries { reversor, mirrored: planes.to_vec() };
    let cases = [
        (&one, 12, of(None, &[])),
        (&two, 4, of(None, &[])),
        (&two, 7, of(None, &[])),
        (&reversible, 6, of(Some(Reversor::Momenta), &[])),
        (&mirrored, 6, of(None, &[2])),
        (&mirrored, 6, of(Some(Reversor::Momenta), &[2])),
        (&exchanged, 6, of(Some(Reversor::Positions), &[2])),
        (&four, 3, of(None, &[])),
    ];
    for (pairs, degree, symmetries) in cases {
        let dof = pairs.dof();
        let map = SymplecticPolynomial::fit_symmetric(pairs, degree, &symmetries).expect("a map");
        let back = map.inverted();
        let mut stream = Stream::new(9, "new points");
        let mut moved = 0.0;
        for _ in 0..200 {
            let start: Vec<f64> = (0..2 * dof).map(|_| stream.uniform(-0.3, 0.3)).collect();
            for (first, second) in [(&map, &back), (&back, &map)] {
                let mut z = start.clone();
                first.step(&mut z);
                moved += z.iter().zip(&start).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
                second.step(&mut z);
                let off = z.iter().zip(&start).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
                assert!(off < 2e-15, "{dof} {degree} {off:e}");
            }
            let defect = form_defect(&back.jacobian(&start), dof);
            assert!(defect < 1e-13, "{dof} {degree} {defect:e}");
            let (mut own, mut again) = (start.clone(), start);
            map.step(&mut own);
            back.inverted().step(&mut again);
            assert_eq!(own, again);
        }
        assert!(moved > 10.0, "{moved}");
        // A generating function that is not that of the inverse does not lead back.
        let mut wrong = serde_json::to_value(&back).expect("JSON");
        for c in wrong["coefficients"].as_array_mut().expect("numbers") {
            *c = (-c.as_f64().expect("a number")).into();
        }
        let wrong: SymplecticPolynomial = serde_json::from_value(wrong).expect("a polynomial");
        let start = &pairs.input()[..2 * dof];
        let mut z = start.to_vec();
        map.step(&mut z);
        wrong.step(&mut z);
        let off = z.iter().zip(start).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
        assert!(off > 1e-4, "{off:e}");
    }
}

/// The units of the pairs do not matter, however far those of q are from those of p.
#[test]
fn symplectic_polynomials_do_not_depend_on_units() {
    let pairs = pairs_of(2, 1500, 0.5, kick_and_turn);
    let scales = [1e3, 1e-2, 1e-3, 1e2];
    let scaled = |z: &[f64]| z.iter().enumerate().map(|(k, v)| v * scales[k % 4]).collect();
    let moved = Pairs::new("pairs", 2, scaled(pairs.input()), scaled(pairs.output()));
    let [plain, moved] = [pairs.clone(), moved.expect("pairs")]
        .map(|pairs| SymplecticPolynomial::fit(&pairs, 6).expect("a map"));
    for z in pairs.input().chunks(4).take(50) {
        let (mut image, mut other) = (z.to_vec(), scaled(z));
        plain.step(&mut image);
        moved.step(&mut other);
        for (k, (a, b)) in image.iter().zip(&other).enumerate() {
            assert!((a - b / scales[k]).abs() < 1e-11, "{image:?} {other:?}");
        }
    }
}

/// Orbits in lanes are those of one step after another, however many go beside.
#[test]
fn symplectic_polynomials_have_the_same_bits_on_any_lanes() {
    for (dof, degree) in [(1, 7), (2, 5), (3, 3)] {
        let pairs = pairs_of(dof, 600, 0.4, kick_and_turn);
        let plain = SymplecticPolynomial::fit(&pairs, degree).expect("a map");
        let even = SymplecticPolynomial::fit_reversible(&pairs, degree, Reversor::Momenta);
        let mirrored = Symmetries { mirrored: (1..=dof).collect(), ..Symmetries::default() };
        let mirrored = SymplecticPolynomial::fit_symmetric(&pairs, degree, &mirrored);
        for fitted in [plain, even.expect("a map"), mirrored.expect("a map")] {
            has_the_same_bits_on_any_lanes(&fitted, &pairs);
        }
    }
}

fn has_the_same_bits_on_any_lanes(fitted: &SymplecticPolynomial, pairs: &Pairs) {
    let dim = 2 * pairs.dof();
    for points in [1, 8, 13, 75] {
        let start = &pairs.input()[..points * dim];
        let states = fitted.rollout(start, Rollout { steps: 6, every: 2 }).expect("orbits");
        for (m, z) in start.chunks(dim).enumerate() {
            let mut z = z.to_vec();
            for t in 0..4 {
                assert_eq!(states[t * start.len() + dim * m..][..dim], z[..], "{m} {t}");
                (0..2).for_each(|_| fitted.step(&mut z));
            }
        }
    }
}

/// Parts of any size lead to the same bits, with a section too, and a roll-out ends between two of them when it is
/// asked to.
#[test]
fn polynomials_on_a_section_can_be_stopped_and_do_not_depend_on_the_pace() {
    let density = |x: f64, y: f64| 1.0 + 0.3 * x + 0.1 * y * y;
    let density = AreaDensity::of_function(density, [-2.0, -2.0], [2.0, 2.0], 1.0);
    let section = Section::of_plane(density.expect("a density"));
    let canonical = pairs_of(1, 400, 0.5, kick_and_turn);
    let [mut input, mut output] = [canonical.input().to_vec(), canonical.output().to_vec()];
    section.to_data(&mut input);
    section.to_data(&mut output);
    let pairs = Pairs::new("pairs", 1, input, output).expect("pairs");
    let none = Symmetries::default();
    let of = |section| PolynomialOnSection::fit(&pairs, 14, &none, section).expect("a map");
    let (own, plain) = (of(Some(section.clone())), of(None));
    assert!(own.map().error_on(&canonical) < 1e-9 && plain.map().error_on(&pairs) > 1e-4);
    let start = &[0.1, 0.05, -0.15, 0.1, 0.0, -0.2];
    for (steps, every) in [(3000, 1), (9000, 9000), (9000, 4500)] {
        let request = Rollout { steps, every };
        for map in [&own, &plain] {
            let whole = map.rollout(start, request).expect("orbits");
            assert!(whole.iter().all(|v| v.is_finite()));
            let mut asked = 0;
            let mut go_on = || {
                asked += 1;
                true
            };
            let parts = map.rollout_at_pace(start, request, &mut Pace::asking(&mut go_on));
            assert_eq!(parts.expect("orbits"), whole);
            assert!(asked > 1, "{asked}");
        }
        let mut stop = || false;
        let stopped = own.rollout_at_pace(start, request, &mut Pace::asking(&mut stop));
        assert!(matches!(stopped, Err(Error::Stopped { .. })));
    }
    // The Jacobian is that of the map of data, by differences.
    let z = [0.2, 0.1];
    let (image, jacobian) = own.with_jacobian(&z);
    for column in 0..2 {
        let at = |step: f64| {
            let mut z = z;
            z[column] += step;
            own.with_jacobian(&z).0
        };
        let (up, down) = (at(1e-6), at(-1e-6));
        for row in 0..2 {
            let slope = (up[row] - down[row]) / 2e-6;
            assert!((slope - jacobian[2 * row + column]).abs() < 1e-8, "{slope} {jacobian:?}");
        }
    }
    let moved = own.rollout(&z, Rollout { steps: 1, every: 1 }).expect("an image");
    assert_eq!(moved[2..], image[..]);
    // An orbit that has left the section is lost, though the map, here a turn, brings it back to the box.
    let turned = pairs_of(1, 100, 0.3, |z: &mut [f64]| {
        let (s, c) = 0.7_f64.sin_cos();
        (z[0], z[1]) = (c * z[0] + s * z[1], c * z[1] - s * z[0]);
    });
    let [mut input, mut output] = [turned.input().to_vec(), turned.output().to_vec()];
    section.to_data(&mut input);
    section.to_data(&mut output);
    let turned = Pairs::new("pairs", 1, input, output).expect("pairs");
    let turn = PolynomialOnSection::fit(&turned, 2, &none, Some(section.clone())).expect("a map");
    let request = Rollout { steps: 60, every: 1 };
    let far = turn.rollout(&[1.9, 1.9], request).expect("an orbit");
    let first = far.chunks(2).position(|z| z[0].is_nan()).expect("it leaves");
    assert!(far[2 * first..].iter().all(|v| v.is_nan()), "{far:?}");
    let mut inner = [1.9, 1.9];
    section.to_canonical(&mut inner);
    let mut inside = turn.map().rollout(&inner, request).expect("an orbit");
    section.to_data(&mut inside);
    assert!(inside[2 * first..].iter().any(|v| v.is_finite()), "it stays away: {inside:?}");
    let outside = Pairs::new("pairs", 1, vec![3.0, 0.0], vec![0.0, 0.0]).expect("a pair");
    let message = PolynomialOnSection::fit(&outside, 2, &none, Some(section.clone()));
    assert!(message.expect_err("outside").to_string().contains("points of the section"));
    let density = section.planes()[0].clone().expect("a density");
    let changed = density.with_changes(&[(&|x, _| 0.1 * x, 1.0)]).expect("positive");
    let refused = PolynomialOnSection::fit(&pairs, 2, &none, Some(Section::of_plane(changed)));
    assert!(refused.expect_err("controls").to_string().contains("depends on controls"));
}

/// A polynomial comes back from its file with the same bits, and from no other bytes than it wrote.
#[test]
fn polynomials_come_back_from_their_files() {
    let density = |x: f64, y: f64| 1.0 + 0.3 * x + 0.1 * y * y;
    let density = AreaDensity::of_function(density, [-2.0, -2.0], [2.0, 2.0], 1.0);
    let section = Section::of_plane(density.expect("a density"));
    let plane = pairs_of(1, 200, 0.5, kick_and_turn);
    let folder = tempfile::tempdir().expect("a folder");
    let mut texts = Vec::new();
    for (reversor, section) in
        [(None, None), (Some(Reversor::Positions), None), (Some(Reversor::Momenta), Some(section))]
    {
        let symmetries = Symmetries { reversor, ..Symmetries::default() };
        let map = PolynomialOnSection::fit(&plane, 6, &symmetries, section).expect("a map");
        let path = folder.path().join("map.json");
        let provenance = Provenance { data: Some("digest".into()), ..Provenance::of_scene("fit") };
        let stored = StoredPolynomial { map: map.clone(), provenance };
        save_polynomial(&path, &stored).expect("written");
        let stored_back = load_polynomial(&path).expect("read");
        assert_eq!(stored_back.provenance, stored.provenance);
        let back = stored_back.map.clone();
        let (start, request) = ([0.2, 0.1, -0.1, 0.3], Rollout { steps: 50, every: 10 });
        let states = |map: &PolynomialOnSection| map.rollout(&start, request).expect("orbits");
        assert_eq!(states(&back), states(&map));
        assert_eq!(back.with_jacobian(&start[..2]), map.with_jacobian(&start[..2]));
        assert_eq!(states(&back.inverted()), states(&map.inverted()));
        assert_eq!(back.region(), map.region());
        let text = polynomial_text(&stored).expect("text");
        assert_eq!(text, polynomial_text(&stored_back).expect("text"));
        texts.push(text);
    }
    let refused = |text: &str| match parse_polynomial("map.json", text.as_bytes()) {
        Ok(_) => panic!("it was read"),
        Err(reason) => reason.to_string(),
    };
    let text = &texts[1];
    for at in (0..text.len()).step_by(37) {
        let mut bytes = text.clone().into_bytes();
        bytes[at] = if bytes[at] == b'7' { b'1' } else { b'7' };
        let Ok(read) = parse_polynomial("map.json", &bytes) else { continue };
        // What has not changed is a number beyond its last digit that counts.
        assert_eq!(&polynomial_text(&read).expect("text"), text, "byte {at}");
    }
    type Change = fn(&mut serde_json::Value);
    let changes: [(&str, Change); 26] = [
        ("digest", |of| of["map"]["coefficients"][3] = 0.5.into()),
        ("dof", |of| of["map"]["dof"] = 0.into()),
        ("dof", |of| of["map"]["dof"] = 5.into()),
        ("from", |of| of["map"]["dof"] = 2.into()),
        ("from", |of| of["map"]["frame"]["from"] = serde_json::json!([0.0])),
        ("iterations", |of| of["map"]["forward"]["iterations"] = 0.into()),
        ("iterations", |of| of["map"]["backward"]["iterations"] = 10_000_000.into()),
        ("symplectic matrix", |of| of["map"]["frame"]["exit"][1] = 0.7.into()),
        ("symplectic matrix", |of| of["map"]["frame"]["entry"][2] = 1e300.into()),
        ("symplectic matrix", |of| {
            of["map"]["frame"]["exit"] = serde_json::json!([1e200, 0.0, 0.0, 1e200]);
        }),
        ("symplectic matrix", |of| {
            of["map"]["frame"]["exit"] = serde_json::json!([1e8, 1e8, 1e8, 1e8]);
        }),
        ("start: degree", |of| {
            of["map"]["backward"]["start"]["basis"]["degree"] = 9.into();
            of["map"]["backward"]["start"]["coefficients"] = vec![0.0; 110].into();
        }),
        ("coefficients", |of| of["map"]["coefficients"] = serde_json::json!([0.0, 1.0])),
        ("start: coefficients", |of| of["map"]["forward"]["start"]["basis"]["degree"] = 0.into()),
        ("degree", |of| of["map"]["basis"]["degree"] = u64::MAX.into()),
        ("even", |of| of["map"]["basis"]["even"] = serde_json::json!([[0, 2]])),
        ("coordinates that are even", |of| of["map"]["basis"]["even"] = serde_json::json!([[]])),
        ("box that is not about 0", |of| of["map"]["basis"]["centre"][0] = 0.1.into()),
        ("off the reflection", |of| of["map"]["frame"]["from"][0] = 0.1.into()),
        ("off the reflection", |of| of["map"]["frame"]["to"][1] = 0.1.into()),
        ("reflection does not exchange", |of| {
            of["map"]["frame"]["exit"] = serde_json::json!([1.0, 0.0, 0.0, 1.0]);
        }),
        ("of these symmetries", |of| of["map"]["basis"]["even"] = serde_json::json!([])),
        ("of these symmetries", |of| of["map"]["symmetries"]["mirrored"] = serde_json::json!([1])),
        ("mirrored plane", |of| of["map"]["symmetries"]["mirrored"] = serde_json::json!([2])),
        ("factor", |of| of["map"]["basis"]["factors"][0] = 0.0.into()),
        ("region", |of| of["region"]["low"][0] = 9.0.into()),
    ];
    for (part, change) in changes {
        let mut value: serde_json::Value = serde_json::from_str(text).expect("JSON");
        change(&mut value["polynomial"]);
        let reason = refused(&value.to_string());
        assert!(reason.contains("map.json") && reason.contains(part), "{part}: {reason}");
    }
    assert!(refused(&text.replace("\"version\": 1", "\"version\": 2")).contains("version"));
    assert!(refused("{\"format\": \"gyroceptron-model\"}").contains("gyroceptron-polynomial"));
}

/// Over a long time a polynomial map drifts away from the curve of an orbit, a symplectic one does not.
#[test]
fn symplectic_polynomials_stay_on_curves() {
    let pairs = pairs_of(1, 800, 0.5, kick_and_turn);
    let start = [0.3, 0.1];
    let request = Rollout { steps: 40_000, every: 1 };
    // By how much the mean square distance from 0 differs between both halves.
    let size = |states: &[f64]| {
        let mean = |part: &[f64]| part.chunks(2).map(|z| z[0] * z[0] + z[1] * z[1]).sum::<f64>();
        let rows = states.len() / 4 * 2;
        mean(&states[states.len() - rows..]) / mean(&states[..rows]) - 1.0
    };
    let plain = PolynomialMap::fit(&pairs, 3).expect("a map");
    let drift = size(&plain.rollout(&start, request).expect("an orbit")).abs();
    let kept = SymplecticPolynomial::fit(&pairs, 4).expect("a map");
    let own = size(&kept.rollout(&start, request).expect("an orbit")).abs();
    assert!(own < 1e-4 && !(drift < 1e-2), "{drift:e} {own:e}");
    // Both err alike in one map.
    let [one, other] = [plain.error_on(&pairs), kept.error_on(&pairs)];
    assert!(one < 4e-6 && other < 4e-6, "{one:e} {other:e}");
}

/// Pairs that no such map has are fitted badly or refused, never to a map that says otherwise.
#[test]
fn symplectic_polynomials_refuse_what_keeps_no_area() {
    let shrunk = |z: &mut [f64]| {
        kick_and_turn(z);
        z.iter_mut().for_each(|v| *v *= 0.99);
    };
    let pairs = pairs_of(1, 400, 0.5, shrunk);
    let fitted = SymplecticPolynomial::fit(&pairs, 12).expect("a map");
    assert!(fitted.error_on(&pairs) > 1e-3, "{}", fitted.error_on(&pairs));
    assert!(PolynomialMap::fit(&pairs, 11).expect("a map").error_on(&pairs) < 1e-4);
    let mirrored = pairs_of(1, 400, 0.5, |z: &mut [f64]| z[1] = -z[1]);
    let message = SymplecticPolynomial::fit(&mirrored, 4).expect_err("no such map").to_string();
    assert!(message.contains("symplectic"), "{message}");
    let pairs = pairs_of(1, 40, 0.5, kick_and_turn);
    for degree in [0, 1, 9, usize::MAX] {
        let message = SymplecticPolynomial::fit(&pairs, degree).expect_err("refused").to_string();
        assert!(message.contains("degree of a generating function"), "{message}");
    }
    let pairs = pairs_of(5, 400, 0.5, |z: &mut [f64]| z[5] -= z[0]);
    let message = SymplecticPolynomial::fit(&pairs, 2).expect_err("too many").to_string();
    assert!(message.contains("degrees of freedom: expected 1 to 4, found 5"), "{message}");
    // Points of the pairs share their midpoint: there is no function of it.
    let folded = |z: &mut [f64]| {
        z[1] += (4.0 * z[0]).sin();
        z[0] -= (4.0 * z[1]).sin();
    };
    let pairs = pairs_of(1, 400, 1.0, folded);
    for degree in [5, 12] {
        match SymplecticPolynomial::fit(&pairs, degree) {
            Ok(fitted) => assert!(!(fitted.error_on(&pairs) < 0.05), "{degree}"),
            Err(error) => assert!(error.to_string().contains("no convergence"), "{error}"),
        }
    }
}
