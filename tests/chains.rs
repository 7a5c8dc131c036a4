//! Chains of periodic orbits: from a line of symmetry, and how wide their islands are.

use gyroceptron::Error;
use gyroceptron::layer::Reversor;
use gyroceptron::measure::orbits::{
    IslandSearch, PeriodicOrbit, SymmetryLine, periodic_orbit, periodic_orbits,
    symmetric_periodic_orbits,
};
use gyroceptron::scalar::{Dual, Elementary, Scalar, max_or_nan};
use std::f64::consts::TAU;

/// Turns by shares of an angle before and after the kick p ← p + q²; with equal shares it is reversed by p → −p.
fn kicked<S: Elementary>(turns: f64, before: f64, z: [S; 2]) -> [S; 2] {
    let turn = |share: f64, [q, p]: [S; 2]| {
        let (sin, cos) = libm::sincos(TAU * turns * share);
        let (sin, cos) = (S::from_f64(sin), S::from_f64(cos));
        [cos * q + sin * p, cos * p - sin * q]
    };
    let [q, p] = turn(before, z);
    turn(1.0 - before, [q, p + q * q])
}

fn with_jacobian(
    map: impl Fn([Dual<f64, 2>; 2]) -> [Dual<f64, 2>; 2],
    z: &[f64],
) -> (Vec<f64>, Vec<f64>) {
    let image = map([Dual::variable(z[0], 0), Dual::variable(z[1], 1)]);
    (image.map(|of| of.re).to_vec(), image.map(|of| of.eps).concat())
}

fn symmetric(turns: f64, z: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Error> {
    Ok(with_jacobian(|z| kicked(turns, 0.5, z), z))
}

fn line(from: f64, to: f64, samples: usize) -> SymmetryLine {
    SymmetryLine { reversor: Reversor::Momenta, from, to, samples }
}

/// Whether p → −p takes the points of an orbit to points of it.
fn is_mirrored(orbit: &PeriodicOrbit) -> bool {
    orbit.points.iter().all(|point| {
        let near = |other: &Vec<f64>| {
            (other[0] - point[0]).abs() < 1e-9 && (other[1] + point[1]).abs() < 1e-9
        };
        orbit.points.iter().any(near)
    })
}

/// Three turns about an elliptic orbit, in maps: of an orbit of 7 points, about whose points a turn takes 1/0.13 periods,
/// these are 3·7/0.13 = 161.5.
#[test]
fn an_island_is_known_after_three_turns_about_its_orbit() {
    let residue = libm::sin(std::f64::consts::PI * 0.13).powi(2);
    assert_eq!(IslandSearch::maps_for(7, residue), Some(162));
    assert_eq!(IslandSearch::maps_for(14, residue), Some(324));
    for none in [0.0, 1.0, -0.1, 1.1, f64::NAN, 1e-300] {
        assert_eq!(IslandSearch::maps_for(7, none), None, "{none}");
    }
}

/// Both orbits of a chain, of an odd and of an even period, are found without a guess, and are those that a scan of
/// the plane finds.
#[test]
fn chains_are_found_on_the_line_of_symmetry() {
    for (turns, period) in [(0.205, 5), (0.172, 6)] {
        let map = |z: &[f64]| symmetric(turns, z);
        let found = symmetric_periodic_orbits(&map, &line(-0.6, 0.6, 400), period).expect("found");
        let side: Vec<f64> = (0..25).map(|k| -0.6 + 0.05 * f64::from(k)).collect();
        let grid = side.iter().flat_map(|q| side.iter().map(|p| vec![*q, *p]));
        let scan = periodic_orbits(&map, &grid.collect::<Vec<_>>(), period, 1e-6).expect("scan");
        let within = |orbit: &&PeriodicOrbit| orbit.points.iter().all(|z| z[0].hypot(z[1]) < 0.6);
        let scan: Vec<&PeriodicOrbit> = scan.iter().filter(within).collect();
        // An odd chain has a point of each of its two orbits on the line; an even one has both of an orbit there.
        let both = scan.iter().filter(|orbit| orbit.points.iter().any(|z| z[1].abs() < 1e-9));
        let both: Vec<_> = both.collect();
        assert_eq!(scan.len(), 2, "{period}");
        assert_eq!(found.len(), both.len(), "{period}");
        assert!(found.len() == if period == 5 { 2 } else { 1 }, "{period}: {}", found.len());
        for orbit in &found {
            assert!(orbit.missed < 1e-12 && orbit.period() == period && is_mirrored(orbit));
            assert!(orbit.points[0][1].abs() < 1e-12, "{:?}", orbit.points[0]);
            let same = |other: &&&&PeriodicOrbit| (other.residue() - orbit.residue()).abs() < 1e-9;
            assert!(both.iter().any(|other| same(&other)), "{period}: {}", orbit.residue());
        }
        if let [first, second] = &found[..] {
            assert!(first.points[0][0] < second.points[0][0]);
            assert!(first.residue() * second.residue() < 0.0);
        }
    }
    // What is not reversed by p → −p has no such orbits.
    let map = |z: &[f64]| Ok(with_jacobian(|z| kicked(0.205, 0.0, z), z));
    let none = symmetric_periodic_orbits(&map, &line(-0.6, 0.6, 400), 5).expect("looked for");
    assert!(none.is_empty(), "{none:?}");
    // Exchanged coordinates have the other reversor.
    let map = |z: &[f64]| {
        let (image, j) = symmetric(0.205, &[z[1], z[0]])?;
        Ok((vec![image[1], image[0]], vec![j[3], j[2], j[1], j[0]]))
    };
    let other = line(-0.6, 0.6, 1 << 40);
    let message = symmetric_periodic_orbits(&map, &other, 1).expect_err("refused").to_string();
    assert!(message.contains("line: samples"), "{message}");
    let other = SymmetryLine { reversor: Reversor::Positions, ..line(-0.6, 0.6, 400) };
    assert_eq!(symmetric_periodic_orbits(&map, &other, 5).expect("found").len(), 2);
}

/// The fixed point in the middle of the line is a sample, and orbits of a shorter period are not of this one.
#[test]
fn samples_on_orbits_and_shorter_periods() {
    let map = |z: &[f64]| symmetric(0.205, z);
    for samples in [3, 4] {
        let found = symmetric_periodic_orbits(&map, &line(-0.2, 0.2, samples), 1).expect("found");
        assert_eq!(found.len(), 1, "{samples}");
        assert!(found[0].points[0].iter().all(|v| v.abs() < 1e-12), "{found:?}");
    }
    let ends = symmetric_periodic_orbits(&map, &line(0.0, 0.2, 3), 1).expect("found");
    assert_eq!(ends.len(), 1);
    assert!(symmetric_periodic_orbits(&map, &line(-0.2, 0.2, 50), 2).expect("none").is_empty());
    let bad = [line(0.2, -0.2, 10), line(f64::NAN, 0.2, 10), line(-0.2, 0.2, 1)];
    for of in bad {
        assert!(symmetric_periodic_orbits(&map, &of, 1).is_err(), "{of:?}");
    }
    let wide = |z: &[f64]| Ok((z.repeat(2), vec![0.0; 16]));
    let error = symmetric_periodic_orbits(&wide, &line(-0.2, 0.2, 10), 1).expect_err("no plane");
    assert!(error.to_string().contains("coordinates of a plane"), "{error}");
    let nowhere = |_: &[f64]| Err(Error::invalid("map", "a point", "none"));
    let error = symmetric_periodic_orbits(&nowhere, &line(-0.2, 0.2, 10), 1).expect_err("none");
    assert!(error.to_string().contains("a point"), "{error}");
    let error = symmetric_periodic_orbits(&map, &line(-0.2, 0.2, 10), 0).expect_err("no period");
    assert!(error.to_string().contains("period"), "{error}");
}

/// J′ = J − ε sin kθ, θ′ = θ + J′ around the point (1, 2): k islands at J = 2πj/k.
fn islands<S: Elementary>(count: u32, epsilon: f64, z: [S; 2]) -> [S; 2] {
    let [x, y] = [z[0] - S::from_f64(1.0), z[1] - S::from_f64(2.0)];
    let action = S::from_f64(0.5) * (x * x + y * y);
    let (mut sin, mut cos) = (S::from_f64(0.0), S::from_f64(1.0));
    let length = (x * x + y * y).sqrt();
    let (unit_x, unit_y) = (x / length, y / length);
    for _ in 0..count {
        (cos, sin) = (cos * unit_x - sin * unit_y, sin * unit_x + cos * unit_y);
    }
    let moved = action - S::from_f64(epsilon) * sin;
    let (sin, cos) = moved.sin_cos();
    let radius = (moved + moved).sqrt();
    let turned = [cos * unit_x - sin * unit_y, sin * unit_x + cos * unit_y];
    [S::from_f64(1.0) + radius * turned[0], S::from_f64(2.0) + radius * turned[1]]
}

/// A pendulum: ½(J − J₀)² − (ε/k) cos kθ, 4√(ε/k) wide in J where θ = 0. Two islands exchange opposite points; about a
/// centre beside that of the circles one step of the orbit gains more than half a turn, and fifteen islands gain more
/// than one of theirs unevenly.
#[test]
fn islands_are_as_wide_as_a_pendulum() {
    let middle = [1.0, 2.0];
    for (count, turns, epsilon, shift) in [
        (5, 2.0, 1e-4, 0.0),
        (5, 2.0, 1e-3, 0.0),
        (2, 1.0, 1e-3, 0.0),
        (7, 3.0, 1e-4, 0.8),
        (15, 1.0, 1e-4, -0.5),
    ] {
        let place = || format!("{turns}/{count} at {epsilon}");
        let centre = turns * TAU / f64::from(count);
        let map = |z: &[f64]| Ok(with_jacobian(|z| islands(count, epsilon, z), z));
        let follow = |points: &[f64], maps: usize| {
            let mut now = points.to_vec();
            let mut out = Vec::new();
            for _ in 0..maps {
                for z in now.chunks_exact_mut(2) {
                    let moved = islands(count, epsilon, [z[0], z[1]]);
                    z.copy_from_slice(&moved);
                }
                out.extend_from_slice(&now);
            }
            Ok(out)
        };
        let radius = (2.0 * centre).sqrt();
        let guess = [1.0 + radius, 2.0];
        let orbit = periodic_orbit(&map, &guess, count as usize).expect("the elliptic orbit");
        assert!((0.0..1.0).contains(&orbit.residue()), "{}", orbit.residue());
        let around = [middle[0] + shift, middle[1]];
        let of = |reach: f64| IslandSearch::of_orbit(&orbit, (around, reach), &follow);
        let found = of(0.3).expect("a search").unwrap_or_else(|| panic!("{}", place()));
        let half = 2.0 * (epsilon / f64::from(count)).sqrt();
        let [low, high] =
            [centre - half, centre + half].map(|action| (2.0 * action).sqrt() - shift);
        let width = found.interval.width() / (high - low);
        assert!((width - 1.0).abs() < 0.03, "{width}: {}", place());
        assert!((found.interval.low - low).abs() < 0.03 * (high - low), "{found:?} for {low}");
        assert!(found.angle.abs() < 1e-9, "{found:?}");
        // Within a period the angle about a point beside the centre does not advance evenly.
        let maps = IslandSearch::maps_for(count as usize, orbit.residue()).expect("elliptic");
        for more in 0..count as usize {
            let search = IslandSearch { around, reach: 0.3, maps: maps + more };
            let again = search.find(&orbit.points, &follow).expect("a search");
            let again = again.unwrap_or_else(|| panic!("{} maps: {}", maps + more, place()));
            let apart = again.interval.width() / found.interval.width() - 1.0;
            assert!(apart.abs() < 0.02, "{apart}: {} maps: {}", maps + more, place());
        }
        if count == 15 {
            // On ellipses that are four times as long as wide a step gains from a quarter to four times as much: two
            // fifteenths of a turn are nearer to all steps than one, and on the flat side islands are four times as
            // wide by the angle. The first point is at the tip and on that side.
            for root in [2.0, 0.5] {
                let scaled = |points: &[f64], by: f64| -> Vec<f64> {
                    let of = |z: &[f64]| {
                        let off = [z[0] - middle[0], z[1] - middle[1]];
                        [by.mul_add(off[0], middle[0]), off[1] / by + middle[1]]
                    };
                    points.chunks_exact(2).flat_map(of).collect()
                };
                let stretched = |points: &[f64], maps: usize| {
                    follow(&scaled(points, 1.0 / root), maps).map(|states| scaled(&states, root))
                };
                let points: Vec<Vec<f64>> = orbit.points.iter().map(|z| scaled(z, root)).collect();
                let search = IslandSearch { around: middle, reach: 0.3, maps };
                let again = search.find(&points, &stretched).expect("a search");
                let again = again.unwrap_or_else(|| panic!("stretched by {root}: {}", place()));
                let apart = again.interval.width() / (root * found.interval.width()) - 1.0;
                assert!(apart.abs() < 0.02, "{apart}: stretched by {root}: {}", place());
            }
        }
        // Beyond the reach there is no end.
        assert_eq!(of(0.3 * half / centre).expect("a search"), None);
        let own = orbit.points[0].clone();
        let error = IslandSearch::of_orbit(&orbit, ([own[0], own[1]], 0.15), &follow);
        assert!(error.expect_err("no ray").to_string().contains("away from its centre"));
        assert!(of(0.0).is_err() && of(f64::NAN).is_err());
        // Half an island on there is a corner, which has none.
        let (sin, cos) = (0.5 * TAU / f64::from(count)).sin_cos();
        let guess = [radius.mul_add(cos, 1.0), radius.mul_add(sin, 2.0)];
        let corner = periodic_orbit(&map, &guess, count as usize).expect("the hyperbolic orbit");
        let error = IslandSearch::of_orbit(&corner, (around, 0.15), &follow).expect_err("none");
        assert!(error.to_string().contains("residue"), "{error}");
        if shift == 0.0 {
            // The next point of the orbit.
            let mut next = orbit.clone();
            next.points.rotate_left(1);
            let next = IslandSearch::of_orbit(&next, (around, 0.15), &follow);
            let next = next.expect("a search").expect("an island");
            let turned = next.angle / TAU - turns / f64::from(count);
            assert!((turned - turned.round()).abs() < 1e-6, "{next:?}");
            assert!((next.interval.width() / found.interval.width() - 1.0).abs() < 1e-2);
        }
    }
}

/// In a chain of islands that is thinner than rounding points nearly close all around it: they are orbits only where
/// they miss by rounding.
#[test]
fn what_nearly_closes_is_no_orbit() {
    // The standard map by K = 0.5, the chain of 1/9: residues of some 1e-11.
    let map = |z: &[f64]| {
        let standard = |[q, p]: [Dual<f64, 2>; 2]| {
            let p = p + q.sin_cos().0 * Dual::from_f64(0.5);
            [q + p, p]
        };
        Ok(with_jacobian(standard, z))
    };
    let side: Vec<f64> = (0..15).map(|k| -0.9 + 1.8 / 14.0 * f64::from(k)).collect();
    let grid = side.iter().flat_map(|q| side.iter().map(|p| vec![*q, *p]));
    let found = periodic_orbits(&map, &grid.collect::<Vec<_>>(), 9, 1e-6).expect("a scan");
    let most = found.iter().map(|orbit| orbit.missed).fold(0.0, max_or_nan);
    // All around it they were 164.
    assert!((1..10).contains(&found.len()) && most < 1e-11, "{} {most:e}", found.len());
    // What is wide enough is found all the same, stable or not.
    for (guess, period, trace) in [([0.1, 0.1], 1, 2.5), ([3.0, 0.1], 1, 1.5)] {
        let orbit = periodic_orbit(&map, &guess, period).expect("an orbit");
        let found = orbit.multiplier_matrix[0] + orbit.multiplier_matrix[3];
        assert!((found - trace).abs() < 1e-9 && orbit.period() == period, "{guess:?}: {found}");
    }
}
