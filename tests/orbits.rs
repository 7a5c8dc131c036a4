//! What is measured of maps of a plane: periodic orbits, rotation, chaos, manifolds, invariant circles.

use gyroceptron::flow::Trajectories;
use gyroceptron::measure::orbits::{
    Branch, InvariantCircle, lyapunov_exponent, manifold, periodic_orbit, periodic_orbits,
    rotation_numbers, smaller_alignment_index,
};
use gyroceptron::phase::AreaDensity;
use gyroceptron::scalar::max_or_nan;
use std::f64::consts::{PI, TAU};

/// The standard map of strength k: p′ = p + k sin q, q′ = q + p′.
fn standard(k: f64, z: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let p = z[1] + k * z[0].sin();
    let slope = k * z[0].cos();
    (vec![z[0] + p, p], vec![1.0 + slope, 1.0, slope, 1.0])
}

/// Residues ∓k/4 of the fixed points, and about ¼ of the orbits of the golden sequence where its circle is about to
/// break.
#[test]
fn residues_are_those_of_the_standard_map() {
    let k = 0.971_635;
    for (q, expected) in [(0.0, -k / 4.0), (PI, k / 4.0)] {
        let found = periodic_orbit(&|z| Ok(standard(k, z)), &[q + 0.1, 0.05], 1).expect("found");
        assert!((found.points[0][0] - q).abs() < 1e-12 && found.points[0][1].abs() < 1e-12);
        assert!((found.residue() - expected).abs() < 1e-12, "{}", found.residue());
    }
    // 8/13 and 13/21 turns: a whole number of them is taken off at the end of a period.
    for (turns, period) in [(8.0, 13), (13.0, 21)] {
        let each = turns / period as f64;
        let guesses: Vec<Vec<f64>> =
            (0..80).map(|i| vec![PI, TAU * (each + 0.1 * (i as f64 / 80.0 - 0.5))]).collect();
        let around = |z: &[f64]| {
            let (mut now, mut all) = (z.to_vec(), [1.0, 0.0, 0.0, 1.0]);
            for _ in 0..period {
                let (image, j) = standard(k, &now);
                now = image;
                all = [
                    j[0] * all[0] + j[1] * all[2],
                    j[0] * all[1] + j[1] * all[3],
                    j[2] * all[0] + j[3] * all[2],
                    j[2] * all[1] + j[3] * all[3],
                ];
            }
            now[0] -= TAU * turns;
            Ok((now, all.to_vec()))
        };
        let found = periodic_orbits(&around, &guesses, 1, 1e-6).expect("searched");
        let residues: Vec<f64> = found.iter().map(|orbit| orbit.residue()).collect();
        let near = |r: &&f64| (**r - 0.25).abs() < 0.02;
        assert!(residues.iter().any(|r| near(&r)), "{period}: {residues:?}");
    }
}

#[test]
fn orbits_are_given_once_around() {
    // A fixed point comes back after two steps too.
    let found = periodic_orbit(&|z| Ok(standard(0.5, z)), &[PI + 0.05, 0.05], 2).expect("found");
    assert_eq!(found.period(), 1);
    assert!((found.residue() - 0.125).abs() < 1e-12 && found.missed < 1e-12, "{found:?}");
    // −1 times a shear: the origin alone, from all guesses.
    let half = |z: &[f64]| Ok((vec![-z[0], -z[1] - 0.1 * z[0]], vec![-1.0, 0.0, -0.1, -1.0]));
    let at_rest = periodic_orbits(&half, &[vec![0.3, 0.2], vec![-0.1, 0.4]], 1, 1e-6);
    let at_rest = at_rest.expect("searched");
    assert_eq!(at_rest.len(), 1, "{at_rest:?}");
    assert!((at_rest[0].trace() + 2.0).abs() < 1e-12);
    // And none of period 2, which every point on a line has.
    let shorter = periodic_orbits(&|z| Ok(standard(0.5, z)), &[vec![PI, 0.01]], 2, 1e-6);
    assert!(shorter.expect("searched").is_empty());
    // None to be found: p grows at every step.
    let never = |z: &[f64]| Ok((vec![z[0] + z[1], z[1] + 1.0], vec![1.0, 1.0, 0.0, 1.0]));
    assert!(periodic_orbit(&never, &[0.0, 0.0], 3).is_err());
    assert!(periodic_orbit(&half, &[0.0, 0.0], 0).is_err());
}

/// Weighted averages find the turning of a conjugated rotation to rounding; a chaotic orbit says that they do not.
#[test]
fn rotation_numbers_converge_on_curves_and_not_in_chaos() {
    let omega = (5f64.sqrt() - 1.0) / 2.0;
    let states: Vec<f64> = (0..4000)
        .flat_map(|t| {
            let angle: f64 = TAU * omega * f64::from(t);
            let angle = angle + 0.3 * angle.sin();
            [angle.cos(), angle.sin()]
        })
        .collect();
    let orbit = Trajectories::new(states.clone(), 2, 1).expect("an orbit");
    let found = rotation_numbers(&orbit, omega, |z| z[1].atan2(z[0]))[0];
    assert!((found.turns - omega).abs() < 1e-13, "{found:?}");
    assert!(found.error < 1e-11, "{found:?}");
    // The mean of as many growths is right to 1/N.
    let angle = |t: usize| states[2 * t + 1].atan2(states[2 * t]);
    let plain: f64 = (1..4000)
        .map(|t| (angle(t) - angle(t - 1) - omega * TAU).rem_euclid(TAU))
        .map(|d| if d > PI { d - TAU } else { d })
        .sum();
    assert!((plain / (TAU * 3999.0)).abs() > 1e-6, "{plain}");
    let mut z = vec![0.1, 0.05];
    let mut states = Vec::new();
    for _ in 0..4000 {
        z = standard(3.0, &z).0;
        states.extend(&z);
    }
    let orbit = Trajectories::new(states, 2, 1).expect("an orbit");
    let chaotic = rotation_numbers(&orbit, 0.0, |z| z[0])[0];
    assert!(chaotic.error > 1e-4, "{chaotic:?}");
    let alone = Trajectories::new(vec![1.0, 0.0], 2, 1).expect("a state");
    assert!(rotation_numbers(&alone, 0.0, |z| z[0])[0].error.is_nan());
}

/// ln(K/2) of the standard map for large K; 0 of a rotation.
#[test]
fn neighbours_part_as_fast_as_is_known() {
    let k = 20.0;
    let found = lyapunov_exponent(&|z| Ok(standard(k, z)), &[0.3, 0.4], 20_000).expect("an orbit");
    assert!((found - f64::ln(k / 2.0)).abs() < 0.05, "{found}");
    let regular = lyapunov_exponent(&|z| Ok(standard(0.1, z)), &[PI + 0.1, 0.0], 20_000);
    let regular = regular.expect("an orbit");
    assert!(regular.abs() < 1e-2, "{regular}");
}

/// The unstable manifold of the fixed point at 0 of the standard map: backwards its points come back to it, along the
/// other direction of a reversible map the stable one is its mirror image, and where they meet, on q = π by symmetry,
/// an orbit goes from the fixed point to it again.
#[test]
fn manifolds_leave_the_fixed_point_and_meet() {
    let k = 1.2;
    let map = |z: &mut [f64]| {
        let image = standard(k, z).0;
        z.copy_from_slice(&image);
        Ok(())
    };
    let fixed = periodic_orbit(&|z| Ok(standard(k, z)), &[0.01, 0.0], 1).expect("found");
    assert!((fixed.trace() - 2.0 - k).abs() < 1e-12);
    let branch = Branch { forward: true, start: 1e-6, spacing: 0.01, length: 9.0 };
    let points = manifold(&map, &fixed, branch).expect("a manifold");
    let rows: Vec<&[f64]> = points.chunks(2).collect();
    let apart = rows.windows(2).map(|p| (p[1][0] - p[0][0]).hypot(p[1][1] - p[0][1]));
    let apart: Vec<f64> = apart.collect();
    assert!(apart.iter().copied().fold(0.0, max_or_nan) <= 0.01);
    let length: f64 = apart.iter().sum();
    assert!((9.0..9.02).contains(&length), "{length}");
    // The other side is the image under z ↦ −z.
    let other = manifold(&map, &fixed, Branch { forward: false, ..branch }).expect("a manifold");
    assert!(points.iter().zip(&other).all(|(a, b)| (a + b).abs() < 1e-9));
    // Backwards: q = q′ − p′, p = p′ − K sin q.
    for z in rows.iter().step_by(20) {
        let (mut q, mut p) = (z[0], z[1]);
        for _ in 0..60 {
            q -= p;
            p -= k * q.sin();
            if q.hypot(p) < 1e-5 {
                break;
            }
        }
        assert!(q.hypot(p) < 1e-5, "{z:?} {q} {p}");
    }
    // Where it first crosses q = π, finer: forward the orbit comes to (2π, 0).
    let fine = Branch { spacing: 1e-4, length: 5.0, ..branch };
    let fine = manifold(&map, &fixed, fine).expect("a manifold");
    let side = if fine[2] > 0.0 { 1.0 } else { -1.0 };
    let rows: Vec<&[f64]> = fine.chunks(2).collect();
    let cross = rows.windows(2).find(|p| side * p[0][0] < PI && side * p[1][0] >= PI);
    let cross = cross.expect("a crossing");
    let share = (PI - side * cross[0][0]) / (side * cross[1][0] - side * cross[0][0]);
    let at = |axis: usize| cross[0][axis] + share * (cross[1][axis] - cross[0][axis]);
    let mut z = vec![side * at(0), side * at(1)];
    let mut comes = false;
    for _ in 0..30 {
        z = standard(k, &z).0;
        comes |= (z[0] - TAU).hypot(z[1]) < 2e-3;
    }
    assert!(comes, "{z:?}");
    let centre = periodic_orbit(&|z| Ok(standard(k, z)), &[PI + 0.01, 0.0], 1).expect("found");
    assert!(manifold(&map, &centre, branch).is_err());
    assert!(manifold(&map, &fixed, Branch { spacing: 0.0, ..branch }).is_err());
    assert!(manifold(&map, &fixed, Branch { spacing: 1e-9, ..branch }).is_err());
}

/// Points at which a period changes sides: the branch of λ < 0 is that of two periods.
#[test]
fn manifolds_of_orbits_that_change_sides_are_of_two_periods() {
    let turned = |z: &mut [f64]| {
        (z[0], z[1]) = (-2.0 * z[0], -0.5 * z[1] + 0.1 * z[0] * z[0]);
        Ok(())
    };
    let with = |z: &[f64]| {
        let mut image = z.to_vec();
        turned(&mut image)?;
        Ok((image, vec![-2.0, 0.0, 0.2 * z[0], -0.5]))
    };
    let fixed = periodic_orbit(&with, &[0.01, 0.02], 1).expect("found");
    let branch = Branch { forward: true, start: 1e-7, spacing: 0.05, length: 3.0 };
    let points = manifold(&turned, &fixed, branch).expect("a manifold");
    // y = c x² is invariant: c 4x² = −½ c x² + 0.1 x².
    for z in points.chunks(2) {
        assert!(z[0].signum() == points[0].signum());
        assert!((z[1] - 0.1 / 4.5 * z[0] * z[0]).abs() < 1e-6, "{z:?}");
    }
}

/// Exponentially on chaotic orbits, as the square of the number of maps on curves, not at all with more coordinates.
#[test]
fn alignment_tells_chaos_from_curves() {
    let of = |k: f64, z: [f64; 2], maps: usize| {
        smaller_alignment_index(&|z| Ok(standard(k, z)), &z, maps).expect("an orbit")
    };
    assert!(of(6.0, [0.3, 0.4], 30) < 1e-14);
    let [one, ten] = [of(0.1, [PI + 0.5, 0.0], 1000), of(0.1, [PI + 0.5, 0.0], 10_000)];
    assert!(one > 1e-9 && (one / ten).log10() > 1.0 && (one / ten).log10() < 3.0, "{one} {ten}");
    // Two rotations that do not know of one another.
    let turn = |z: &[f64]| {
        let (mut image, mut jacobian) = (vec![0.0; 4], vec![0.0; 16]);
        for (j, angle) in [0.3f64, 0.7].into_iter().enumerate() {
            let (s, c) = angle.sin_cos();
            (image[j], image[j + 2]) = (c * z[j] + s * z[j + 2], c * z[j + 2] - s * z[j]);
            jacobian[4 * j + j] = c;
            jacobian[4 * j + j + 2] = s;
            jacobian[4 * (j + 2) + j] = -s;
            jacobian[4 * (j + 2) + j + 2] = c;
        }
        Ok((image, jacobian))
    };
    let stays = smaller_alignment_index(&turn, &[0.1, 0.2, 0.3, 0.4], 500).expect("an orbit");
    assert!((stays - 2f64.sqrt()).abs() < 1e-9, "{stays}");
    assert!(smaller_alignment_index(&turn, &[0.1; 4], 0).is_err());
}

/// A curve of a few modes is found from an orbit on it, with its turning, its area and distances from it; chaos is
/// reported.
#[test]
fn invariant_circles_are_fitted_to_orbits() {
    let turns = (5f64.sqrt() - 1.0) / 2.0;
    let curve = |u: f64| {
        let t = TAU * u;
        [3.0 + t.cos() + 0.1 * (2.0 * t).cos(), 0.5 * t.sin() - 0.05 * (3.0 * t).sin()]
    };
    let orbit: Vec<f64> = (0..600).flat_map(|n| curve(0.3 + turns * f64::from(n))).collect();
    // The turning is known to 1e-7 only.
    let circle = InvariantCircle::of_orbit(&orbit, turns + 1e-7).expect("a curve");
    assert!(circle.error < 1e-12, "{}", circle.error);
    assert!((circle.turns - turns).abs() < 1e-14, "{}", circle.turns - turns);
    // Green's theorem, by a polygon of many points.
    let polygon: Vec<[f64; 2]> = (0..20_000).map(|k| curve(f64::from(k) / 20_000.0)).collect();
    let area: f64 = (0..polygon.len())
        .map(|k| {
            let ([a, b], [c, d]) = (polygon[k], polygon[(k + 1) % polygon.len()]);
            0.5 * (a * d - c * b)
        })
        .sum();
    assert!((circle.area() / area - 1.0).abs() < 1e-6, "{} {area}", circle.area());
    // A density that is uniform, and the integral of one that is not by strips across the curve (Green's theorem).
    let low_high = ([1.5, -0.7], [4.5, 0.7]);
    let charted = |density: &dyn Fn(f64, f64) -> f64| {
        AreaDensity::of_function(density, low_high.0, low_high.1, 1.7).expect("positive")
    };
    let uniform = circle.flux(&charted(&|_, _| 2.0));
    assert!((uniform / circle.area() - 2.0).abs() < 1e-13, "{uniform}");
    let primitive = |x: f64, y: f64| x * (1.0 + 0.3 * y * y) + 0.1 * x * x;
    let flux: f64 = (0..polygon.len())
        .map(|k| {
            let ([a, b], [c, d]) = (polygon[k], polygon[(k + 1) % polygon.len()]);
            0.5 * (primitive(a, b) + primitive(c, d)) * (d - b)
        })
        .sum();
    let found = circle.flux(&charted(&|x, y| 1.0 + 0.2 * x + 0.3 * y * y));
    assert!((found / flux - 1.0).abs() < 1e-6, "{found} {flux}");
    let small = AreaDensity::of_function(|_, _| 1.0, [2.5, -0.7], [4.5, 0.7], 1.0);
    assert!(circle.flux(&small.expect("positive")).is_nan(), "outside of the box");
    // Off the curve along its normal.
    let h = 1e-6;
    let places: Vec<f64> = (0..40)
        .flat_map(|k| {
            let u = f64::from(k) / 40.0;
            let ([x, y], [a, b], [c, d]) = (curve(u), curve(u + h), curve(u - h));
            let (dx, dy) = (a - c, b - d);
            let length = dx.hypot(dy);
            [x + 1e-3 * dy / length, y - 1e-3 * dx / length]
        })
        .collect();
    for distance in circle.distances(&places) {
        assert!((distance - 1e-3).abs() < 1e-10, "{distance}");
    }
    assert!(circle.distances(&orbit).into_iter().fold(0.0, max_or_nan) < 1e-12);
    // Far from it too: about the middle of a flat ellipse, and beyond its centres of curvature.
    let flat = |u: f64| [3.0 * (TAU * u).cos(), (TAU * u).sin()];
    let orbit_of_flat: Vec<f64> = (0..400).flat_map(|n| flat(turns * f64::from(n))).collect();
    let ellipse = InvariantCircle::of_orbit(&orbit_of_flat, turns).expect("a curve");
    for [x, y] in [[0.0, 0.0], [1.0, 0.2], [2.7, 0.05], [-2.9, 0.0], [5.0, 4.0], [0.3, -7.0]] {
        let far = (0..200_000).map(|k| flat(f64::from(k) / 200_000.0));
        // no NaN: both are finite.
        let least = far.map(|[a, b]| (a - x).hypot(b - y)).fold(f64::INFINITY, f64::min);
        let found = ellipse.distances(&[x, y])[0];
        assert!((found - least).abs() < 1e-7, "{x} {y}: {found} {least}");
    }
    assert!(circle.distances(&[f64::NAN, 0.0])[0].is_nan());
    let (around, modes) = (circle.points(8), circle.modes());
    assert_eq!((around.len(), modes >= 3), (16, true));
    // 64 states are enough for four modes, and not for six.
    let few = InvariantCircle::of_orbit(&orbit[..128], turns).expect("a curve");
    assert_eq!(few.modes(), 4);
    let mut z = vec![0.1, 0.05];
    let mut chaos = Vec::new();
    for _ in 0..400 {
        z = standard(3.0, &z).0;
        chaos.extend([z[0].rem_euclid(TAU), z[1].rem_euclid(TAU)]);
    }
    let none = InvariantCircle::of_orbit(&chaos, 0.1).expect("a fit");
    assert!(none.error > 0.5, "{}", none.error);
    assert!(InvariantCircle::of_orbit(&orbit[..100], turns).is_err());
    assert!(InvariantCircle::of_orbit(&orbit, f64::NAN).is_err());
}
