//! Frequencies of quasi-periodic signals, tunes of orbits, how long they stay, and how far out.

use gyroceptron::flow::Trajectories;
use gyroceptron::measure::orbits::{
    dynamic_aperture, maps_survived, rotation_numbers, spectral_lines, tunes,
};
use std::f64::consts::TAU;

fn signal(lines: &[(f64, [f64; 2])], count: usize) -> Vec<[f64; 2]> {
    let at = |t: usize| {
        let mut sum = [0.0; 2];
        for (frequency, [x, y]) in lines {
            let (sin, cos) = libm::sincos(TAU * frequency * t as f64);
            sum = [sum[0] + x * cos - y * sin, sum[1] + x * sin + y * cos];
        }
        sum
    };
    (0..count).map(at).collect()
}

/// Alone to rounding; beside others by the fourth power of their number, and their amplitudes with them.
#[test]
fn lines_of_a_spectrum_are_found() {
    let alone = [(0.283_185_307, [0.3, -0.4])];
    let found = spectral_lines(&signal(&alone, 700), 1)[0];
    assert!((found.frequency - alone[0].0).abs() < 2e-14, "{found:?}");
    assert!((found.size() - 0.5).abs() < 1e-12, "{found:?}");
    // In the order of their sizes, one of them near the border of ±½ turns.
    let lines = [
        (0.283_185_307, [1.0, 0.0]),
        (-0.141_421_356, [0.2, 0.1]),
        (0.499_3, [0.0, 0.05]),
        (0.271_828, [0.004, -0.003]),
    ];
    let errors = |count: usize| -> Vec<f64> {
        let found = spectral_lines(&signal(&lines, count), lines.len());
        assert_eq!(found.len(), lines.len());
        let both = found.iter().zip(&lines);
        both.map(|(found, (frequency, [x, y]))| {
            let apart = found.frequency - frequency;
            let amplitude = (found.amplitude[0] - x).hypot(found.amplitude[1] - y);
            assert!(amplitude < 1e-2 * x.hypot(*y), "{found:?} for {frequency}");
            (apart - apart.round()).abs()
        })
        .collect()
    };
    let (short, long) = (errors(1000), errors(8000));
    assert!(short[0] < 1e-8 && long.iter().all(|error| *error < 1e-8), "{short:?} {long:?}");
    // 8⁴ times less, where it is not yet rounding.
    assert!(long[0] < short[0] / 100.0, "{short:?} {long:?}");
    assert!(spectral_lines(&signal(&lines, 15), 2).is_empty());
    let mut broken = signal(&lines, 100);
    broken[50][1] = f64::NAN;
    assert!(spectral_lines(&broken, 1).is_empty());
}

/// A turn or two of the whole orbit beside a mean, which the window does not tell apart at once; less is not known.
#[test]
fn slow_tunes_are_exact_or_not_known() {
    let of = |turns: f64, mean: [f64; 2]| {
        let states = signal(&[(-turns / 1024.0, [0.7, 0.2]), (0.0, mean)], 1024);
        let orbit = Trajectories::new(states.concat(), 2, 1).expect("states");
        1024.0 * tunes(&orbit)[0].turns[0]
    };
    for mean in [[0.0; 2], [3.0, -1.0]] {
        for turns in [1.5, 2.0, 3.1, 4.0, 8.0, 15.0, 40.0] {
            let found = of(turns, mean);
            assert!((found - turns).abs() < 1e-7, "{turns} {mean:?}: {found}");
        }
        for turns in [0.2, 0.5, 0.8] {
            let found = of(turns, mean);
            assert!(found.is_nan() || (found - turns).abs() < 1e-4, "{turns} {mean:?}: {found}");
        }
    }
}

/// A pair of pendulum-like maps that do not know of each other, from [`rotation_numbers`] by another way; and chaos.
#[test]
fn tunes_are_rotation_numbers_and_tell_chaos() {
    let kicked = |strength: f64, angle: f64, z: &mut [f64; 2]| {
        let (sin, cos) = libm::sincos(TAU * angle);
        let p = z[1] - strength * z[0] * z[0];
        *z = [cos * z[0] + sin * p, -sin * z[0] + cos * p];
    };
    let follow = |strength: f64, start: f64, count: usize| -> Vec<f64> {
        let (mut a, mut b) = ([start, 0.0], [0.05, 0.02]);
        let mut out = Vec::new();
        for _ in 0..count {
            out.extend([a[0], b[0], a[1], b[1]]);
            kicked(strength, 0.29, &mut a);
            kicked(0.3, -0.2160, &mut b);
        }
        out
    };
    let orbit = Trajectories::new(follow(1.0, 0.1, 2000), 4, 1).expect("states");
    let found = &tunes(&orbit)[0];
    for (j, near) in [(0, 0.29), (1, -0.216)] {
        let plane: Vec<f64> = orbit.orbit(0).flat_map(|z| [z[j], z[2 + j]]).collect();
        let plane = Trajectories::new(plane, 2, 1).expect("states");
        // The angle of a circle action goes from p to q.
        let other = rotation_numbers(&plane, near, |z| z[0].atan2(z[1]))[0].turns;
        assert!((found.turns[j] - other).abs() < 1e-9, "{} {other}", found.turns[j]);
        assert!(found.changes[j] < 1e-8, "{found:?}");
        assert!((other - near).abs() > 1e-6, "it turns as without a kick");
    }
    // Near the border of what stays.
    let chaotic = Trajectories::new(follow(1.0, 0.5355, 2000), 4, 1).expect("states");
    let chaotic = &tunes(&chaotic)[0];
    assert!(!(chaotic.changes[0] < 1e-6) && chaotic.changes[1] < 1e-8, "{chaotic:?}");
    // Far from where it turns about, which is no line of its spectrum; and what does not turn.
    let mut shifted = follow(1.0, 0.1, 2000);
    shifted.chunks_exact_mut(4).for_each(|z| (z[0], z[1], z[3]) = (z[0] + 100.0, 7.0, 0.5));
    let shifted = &tunes(&Trajectories::new(shifted, 4, 1).expect("states"))[0];
    assert!((shifted.turns[0] - found.turns[0]).abs() < 1e-9, "{shifted:?}");
    assert!(shifted.turns[1].is_nan() && shifted.changes[1].is_nan(), "{shifted:?}");
    let still = Trajectories::new(vec![0.0; 400], 4, 1).expect("states");
    assert!(tunes(&still)[0].turns.iter().all(|turns| turns.is_nan()));
    let few = Trajectories::new(follow(1.0, 0.1, 10), 4, 1).expect("states");
    assert!(tunes(&few)[0].turns[0].is_nan());
}

/// Hénon's quadratic map, followed for a block of maps at once.
fn henon(points: &[f64], maps: usize) -> Vec<f64> {
    let (sin, cos) = libm::sincos(TAU * 0.2114);
    let (mut here, mut out) = (points.to_vec(), Vec::new());
    for _ in 0..maps {
        for z in here.chunks_exact_mut(2) {
            let p = z[1] - z[0] * z[0];
            (z[0], z[1]) = (cos * z[0] + sin * p, -sin * z[0] + cos * p);
        }
        out.extend_from_slice(&here);
    }
    out
}

/// Orbit by orbit and map by map, across the blocks that are followed at once.
#[test]
fn orbits_survive_until_they_leave() {
    let stays = |z: &[f64]| z.iter().all(|v| v.abs() <= 2.0);
    let starts: Vec<f64> = (0..60).flat_map(|k| [0.02 * f64::from(k), 0.1]).collect();
    let maps = 150;
    let follow = |points: &[f64], maps: usize| Ok(henon(points, maps));
    let found = maps_survived(&follow, &starts, 2, maps, &stays).expect("points");
    for (start, found) in starts.chunks_exact(2).zip(&found) {
        let orbit = henon(start, maps);
        let own = orbit.chunks_exact(2).position(|z| !stays(z)).map(|t| t + 1);
        assert_eq!(*found, own, "{start:?}");
    }
    // Who begins outside is lost before the first map, wherever it leads.
    let turned = |points: &[f64], maps: usize| Ok(vec![0.0; maps * points.len()]);
    let lost = maps_survived(&turned, &[2.5, 0.0, 0.5, 0.5], 2, 5, &stays).expect("points");
    assert_eq!(lost, [Some(0), None]);
    let aperture = |direction: [f64; 2]| {
        let radii = [1.0, 1.9, 2.1];
        dynamic_aperture(&turned, &[0.0; 2], &[direction.to_vec()], &radii, 5, &stays)
    };
    assert_eq!(aperture([1.0, 0.0]).expect("an aperture"), [1.9]);
    let error = aperture([0.0, 0.0]).expect_err("no direction").to_string();
    assert!(error.contains("directions") && error.contains("[0.0, 0.0]"), "{error}");
    let lost = found.iter().flatten();
    assert!(lost.clone().any(|t| *t < 10) && lost.clone().any(|t| *t > 64), "{found:?}");
    assert!(found.iter().filter(|lost| lost.is_none()).count() > 10);
    // What is lost has no number: it does not stay.
    let follow = |points: &[f64], maps: usize| Ok(vec![f64::NAN; maps * points.len()]);
    assert_eq!(maps_survived(&follow, &starts[..4], 2, 5, &stays).expect("points"), [Some(1); 2]);
    assert!(maps_survived(&follow, &starts[..3], 2, 5, &stays).is_err());
}

/// The aperture is where the first of the points along a ray is lost.
#[test]
fn the_aperture_is_as_far_as_all_stay() {
    let stays = |z: &[f64]| z.iter().all(|v| v.abs() <= 2.0);
    let follow = |points: &[f64], maps: usize| Ok(henon(points, maps));
    let radii: Vec<f64> = (1..=100).map(|k| 0.01 * f64::from(k)).collect();
    let directions: Vec<Vec<f64>> = (0..8)
        .map(|k| {
            let (sin, cos) = libm::sincos(TAU * f64::from(k) / 8.0);
            vec![cos, sin]
        })
        .collect();
    let aperture = |maps: usize| {
        dynamic_aperture(&follow, &[0.0, 0.0], &directions, &radii, maps, &stays).expect("rays")
    };
    let (short, long) = (aperture(20), aperture(2000));
    for ((direction, of_short), of_long) in directions.iter().zip(&short).zip(&long) {
        let survives = |radius: f64| {
            let start = [radius * direction[0], radius * direction[1]];
            henon(&start, 2000).chunks_exact(2).all(stays)
        };
        assert!(*of_long > 0.2 && of_long <= of_short, "{of_long} {of_short}");
        assert!(survives(*of_long) && !survives(of_long + 0.01), "{of_long}");
    }
    let first = dynamic_aperture(&follow, &[0.0, 0.0], &[vec![1.0, 0.0]], &[5.0], 9, &stays);
    assert_eq!(first.expect("a ray"), [0.0]);
    let none = dynamic_aperture(&follow, &[0.0, 0.0], &directions, &[], 9, &stays);
    assert_eq!(none.expect("rays"), [0.0; 8]);
    assert!(dynamic_aperture(&follow, &[0.0, 0.0], &directions, &[0.2, 0.1], 9, &stays).is_err());
    assert!(dynamic_aperture(&follow, &[0.0, 0.0], &[vec![1.0]], &[0.1], 9, &stays).is_err());
}
