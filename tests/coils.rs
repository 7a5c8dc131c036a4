//! Coils, their field lines, and the sections that these go through.

use gyroceptron::Error;
use gyroceptron::flow::{LineMap, LineRequest, LineSection, TabulatedLines, turns_of_trace};
use gyroceptron::io::parse_coils;
use gyroceptron::measure::adiabatic::log_slope;
use gyroceptron::measure::orbits::aperture_of_ray;
use gyroceptron::network::Rollout;
use gyroceptron::scalar::{Dual, max_or_nan};
use gyroceptron::system::{Coil, CoilField, CoilSet, Tokamak, Torsatron};
use std::f64::consts::{PI, TAU};

/// A period of the torsatron.
const PERIOD: f64 = TAU / 10.0;

fn torsatron(points: usize) -> CoilField {
    let coils = Torsatron::default().coils().expect("sound").all().expect("coils");
    CoilField::new(&coils, points).expect("a field")
}

/// A circle of radius 1 in the plane z = 0 with the current 1.
fn ring() -> Coil {
    let points: Vec<[f64; 3]> =
        (0..8).map(|k| TAU * k as f64 / 8.0).map(|t| [t.cos(), t.sin(), 0.0]).collect();
    Coil::of_points(&points, 1.0).expect("a coil")
}

/// On the axis of a ring B_z = μ₀I/2 a²/(a² + z²)^{3/2}.
#[test]
fn a_ring_has_the_field_of_the_formula_on_its_axis() {
    let field = CoilField::new(&[ring()], 64).expect("a field");
    for z in [0.0f64, 0.3, -1.0, 4.0] {
        let expected = TAU * 1e-7 / (1.0 + z * z).powf(1.5);
        let [x, y, found] = field.magnetic_field([0.0, 0.0, z]);
        assert!((found / expected - 1.0).abs() < 1e-14, "{z}: {found} {expected}");
        assert!(x.abs() < 1e-21 && y.abs() < 1e-21, "{x} {y}");
    }
}

/// Outside of filaments div B = 0 and curl B = 0, by duals; a field of one component turned round has neither.
#[test]
fn fields_have_no_divergence_and_no_curl() {
    let field = torsatron(240);
    let derivatives = |place: [f64; 3], sign: f64| {
        let lifted: [Dual<f64, 3>; 3] = std::array::from_fn(|k| Dual::variable(place[k], k));
        let mut rows = field.magnetic_field(lifted).map(|v| v.eps);
        rows[2] = rows[2].map(|v| v * sign);
        let size = rows.iter().flatten().map(|v| v.abs()).fold(0.0, max_or_nan);
        let divergence = rows[0][0] + rows[1][1] + rows[2][2];
        let curl = [rows[2][1] - rows[1][2], rows[0][2] - rows[2][0], rows[1][0] - rows[0][1]];
        curl.iter().chain([&divergence]).map(|v| v.abs()).fold(0.0, max_or_nan) / size
    };
    for place in [[3.8, 0.3, 0.1], [2.0, -3.2, -0.2]] {
        assert!(derivatives(place, 1.0) < 1e-13, "{}", derivatives(place, 1.0));
        assert!(derivatives(place, -1.0) > 1e-2);
    }
}

/// By Ampère's law a circle about the z axis within the coils of a tokamak has ∮B·dx = μ₀NI exactly, ripple or not; a
/// circle about a current with a width has what is within it; and neither field has a divergence.
#[test]
fn a_tokamak_has_its_ripple_and_the_current_of_its_plasma() {
    let tokamak = Tokamak::default();
    let coils = tokamak.coils().expect("sound").all().expect("coils");
    assert_eq!(coils.len(), 19);
    let field = CoilField::new(&coils, 360).expect("a field");
    let samples = 18 * 40;
    let around = |radius: f64| -> Vec<f64> {
        let at = |k: usize| -> [f64; 3] {
            field.cylindrical(radius, TAU * k as f64 / samples as f64, 0.1)
        };
        (0..samples).map(|k| at(k)[1]).collect()
    };
    let expected = 4e-7 * PI * 18.0 * tokamak.current;
    let ripples = [2.4, 3.0, 3.8, 4.4].map(|radius| {
        let along = around(radius);
        let mean = along.iter().sum::<f64>() / samples as f64;
        assert!((TAU * radius * mean / expected - 1.0).abs() < 1e-9, "{radius}: {mean}");
        let [least, most] = [f64::min, f64::max].map(|of| along.iter().copied().fold(mean, of));
        (most - least) / (most + least)
    });
    // It grows outwards as R^N, and is a tenth at two thirds of the way to the coils.
    assert!(ripples[1] < 1e-3 && (1e-2..0.2).contains(&ripples[3]), "{ripples:?}");
    let order = (ripples[3] / ripples[2]).ln() / (4.4f64 / 3.8).ln();
    assert!((14.0..26.0).contains(&order), "{order} {ripples:?}");
    for place in [[3.0, 0.3, 0.1], [2.5, 1.2, -0.4]] {
        let lifted: [Dual<f64, 3>; 3] = std::array::from_fn(|k| Dual::variable(place[k], k));
        let rows = field.magnetic_field(lifted).map(|v| v.eps);
        let size = rows.iter().flatten().map(|v| v.abs()).fold(0.0, max_or_nan);
        let divergence = rows[0][0] + rows[1][1] + rows[2][2];
        assert!(divergence.abs() < 1e-13 * size, "{divergence} {size}");
        // Within the plasma there is a current.
        let curl = (rows[1][0] - rows[0][1]).abs() + (rows[0][2] - rows[2][0]).abs();
        assert!(curl > 1e-2 * size, "{curl} {size}");
    }
    // A straight current of width w: I s²/(s² + w²) within s.
    let wide = Coil { width: 0.3, ..ring() };
    let large = |coil: &Coil| Coil {
        cosines: coil.cosines.iter().map(|v| v.map(|x| 1000.0 * x)).collect(),
        sines: coil.sines.iter().map(|v| v.map(|x| 1000.0 * x)).collect(),
        ..coil.clone()
    };
    let field = CoilField::new(&[large(&wide)], 1 << 16).expect("a field");
    for distance in [0.15f64, 0.3, 1.0] {
        let count = 16;
        let tangential = |k: usize| -> f64 {
            let (s, c) = (TAU * k as f64 / f64::from(count)).sin_cos();
            let [by_radius, _, by_height]: [f64; 3] =
                field.cylindrical(distance.mul_add(c, 1000.0), 0.0, distance * s);
            by_height * c - by_radius * s
        };
        let sum: f64 = (0..count as usize).map(tangential).sum();
        let found = sum / f64::from(count) * distance / 2e-7;
        let share = distance.powi(2) / (distance.powi(2) + 0.09);
        assert!((found.abs() / share - 1.0).abs() < 2e-3, "{distance}: {found} {share}");
    }
}

/// The map over a period of a tokamak has its axis near the middle of the plasma, and turns about it as the current
/// says.
#[test]
fn lines_of_a_tokamak_turn_about_its_plasma() {
    let tokamak = Tokamak::default();
    let coils = tokamak.coils().expect("sound").all().expect("coils");
    let request = LineRequest {
        angle: TAU / 18.0,
        reach: 0.5,
        guess: Some([tokamak.plasma_radius, 0.0]),
        error: 1e-8,
        ..request()
    };
    let section = LineSection::new(&coils, request).expect("a section");
    let axis = section.axis();
    // Outwards of the middle of the current, whose own field is stronger inside.
    assert!((axis[0] - 3.125).abs() < 1e-3 && axis[1].abs() < 1e-9, "{axis:?}");
    let (_, [[a, _], [_, d]]) = section.map().with_jacobian(axis);
    // Tr M = 2 cos of the angle of a period.
    let turns = (0.5 * (a + d)).acos() / TAU * 18.0;
    let toroidal: [f64; 3] = section.field().cylindrical(axis[0], 0.0, 0.0);
    let spread = tokamak.plasma_width.powi(2) + (axis[0] - 3.0).powi(2);
    let expected = 2e-7 * tokamak.plasma_current * 3.0 / (toroidal[1] * spread);
    assert!((turns / expected - 1.0).abs() < 0.1, "{turns} {expected}");
    // Lines from between two coils, in many short maps, and their distances from the circles.
    let field = section.field();
    let steps = section.map().steps();
    let between = LineMap::new(field, PI / 18.0, TAU / 18.0, steps).expect("a map");
    let near = between.nearest_to_coils(&[4.9, 0.0, 4.4, 0.3], 1).expect("distances");
    let mut place = vec![4.9, 0.0, 4.4, 0.3];
    let mut expected = [f64::INFINITY; 2];
    for k in 0..steps {
        let step = TAU / 18.0 / steps as f64;
        let at = (k as f64).mul_add(step, PI / 18.0);
        let short = LineMap::new(field, at, step, 4).expect("a map");
        place = short.trajectories(&place, 1).expect("lines");
        for (expected, z) in expected.iter_mut().zip(place.chunks_exact(2)) {
            for coil in 0..3 {
                let (sin, cos) = (at + step - f64::from(coil) * TAU / 18.0).sin_cos();
                let across = (z[0] * cos - tokamak.major_radius).hypot(z[1]);
                let distance = (across - tokamak.minor_radius).hypot(z[0] * sin);
                *expected = if distance < *expected { distance } else { *expected };
            }
        }
    }
    for (near, expected) in near.iter().zip(expected) {
        // Its points are not all of the circle.
        assert!(*near >= expected && (near - expected) < 1e-2, "{near} {expected}");
    }
    assert!(near[0] < 0.5 && near[1] > near[0], "{near:?}");
    for bad in [
        Tokamak { coils: 0, ..tokamak },
        Tokamak { minor_radius: 4.0, ..tokamak },
        Tokamak { plasma_width: 0.0, ..tokamak },
        Tokamak { plasma_current: f64::NAN, ..tokamak },
    ] {
        assert!(bad.coils().is_err(), "{bad:?}");
    }
}

/// Doubling the points squares the error: it falls exponentially.
#[test]
fn points_along_coils_converge_exponentially() {
    let exact = torsatron(640).cylindrical(3.75, 0.1, 0.2);
    let error = |points: usize| {
        let found: [f64; 3] = torsatron(points).cylindrical(3.75, 0.1, 0.2);
        found.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan)
    };
    let [coarse, fine] = [error(60), error(120)];
    assert!(coarse < 1e-3 && fine < 1e-6 && error(240) < 1e-12, "{coarse} {fine} {}", error(240));
    assert!(fine.ln() / coarse.ln() > 1.7, "{coarse} {fine}");
}

/// Coils of one half-period give the machine: its field turns with it, and (B_R, B_φ, B_Z) at (R, −φ, −Z) is
/// (−B_R, B_φ, B_Z).
#[test]
fn symmetry_makes_the_machine_of_its_coils() {
    let points: Vec<[f64; 3]> = (0..32)
        .map(|k| TAU * k as f64 / 32.0)
        .map(|t| [3.0 + 0.8 * t.cos(), 0.4 + 0.1 * t.sin(), 0.9 * t.sin() + 0.2 * t.cos()])
        .collect();
    let coils = vec![Coil::of_points(&points, 1e5).expect("a coil")];
    let set = CoilSet { coils, periods: 5, stellarator_symmetric: true };
    let all = set.all().expect("coils");
    assert_eq!(all.len(), 10);
    let field = CoilField::new(&all, 80).expect("a field");
    let (r, phi, z) = (3.1, 0.2, 0.15);
    let here: [f64; 3] = field.cylindrical(r, phi, z);
    let turned = field.cylindrical(r, phi + TAU / 5.0, z);
    let mirrored = field.cylindrical(r, -phi, -z);
    for k in 0..3 {
        let sign = if k == 0 { -1.0 } else { 1.0 };
        assert!((here[k] - turned[k]).abs() < 1e-15, "{here:?} {turned:?}");
        assert!((here[k] - sign * mirrored[k]).abs() < 1e-15, "{here:?} {mirrored:?}");
    }
    // Without the symmetry it is another field.
    let half = CoilSet { stellarator_symmetric: false, ..set }.all().expect("coils");
    let field = CoilField::new(&half, 80).expect("a field");
    let [one, other]: [[f64; 3]; 2] =
        [field.cylindrical(r, phi, z), field.cylindrical(r, -phi, -z)];
    assert!((one[1] - other[1]).abs() > 1e-3, "{one:?} {other:?}");
}

#[test]
fn field_lines_are_of_order_eight() {
    let field = torsatron(60);
    let points = [3.96, 0.0, 4.0, 0.05, 3.92, -0.05];
    let map = LineMap::new(&field, 0.0, PERIOD, 64).expect("a map");
    let exact = map.trajectories(&points, 1).expect("lines");
    let steps = [4, 5, 6, 8];
    let errors = steps.map(|steps| {
        let found = map.with_steps(steps).trajectories(&points, 1).expect("lines");
        found.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan)
    });
    let sizes = steps.map(|steps| 1.0 / steps as f64);
    let slope = log_slope(&sizes, &errors);
    assert!((slope - 8.0).abs() < 0.8, "{slope} {errors:?}");
}

/// B_φ dR∧dZ is kept, and so det J of the map between canonical coordinates is 1; with the area dR∧dZ it is not.
#[test]
fn field_lines_keep_the_flux() {
    let field = torsatron(120);
    let phi = 0.1;
    let map = LineMap::new(&field, phi, PERIOD, 32).expect("a map");
    let axis = map.axis([3.9, 0.0]).expect("an axis");
    let (image, _) = map.with_jacobian(axis);
    assert!((image[0] - axis[0]).abs() + (image[1] - axis[1]).abs() < 1e-12);
    let toroidal = |r: f64, z: f64| field.cylindrical(r, phi, z)[1];
    for offset in [[0.0, 0.0], [0.06, 0.02], [-0.03, 0.08]] {
        let place = [axis[0] + offset[0], axis[1] + offset[1]];
        let (image, [[a, b], [c, d]]) = map.with_jacobian(place);
        let area = a * d - b * c;
        let flux = area * toroidal(image[0], image[1]) / toroidal(place[0], place[1]);
        assert!((flux - 1.0).abs() < 1e-10, "{flux}");
        assert!(offset == [0.0, 0.0] || (area - 1.0).abs() > 1e-4, "{area}");
        // By differences.
        let h = 1e-6;
        let moved =
            map.trajectories(&[place[0] + h, place[1], place[0] - h, place[1]], 1).expect("lines");
        assert!(((moved[0] - moved[2]) / (2.0 * h) - a).abs() < 1e-7);
    }
}

#[test]
fn lines_are_calibrated_and_lost_ones_are_nan() {
    let field = torsatron(60);
    let sound = [3.96, 0.0, 4.0, 0.05];
    let (map, error) = LineMap::calibrated(&field, 0.0, PERIOD, &sound, 1e-8).expect("a map");
    assert!(error <= 1e-8 / 256.0 && map.steps() >= 16, "{error} {}", map.steps());
    // The same bits together and alone.
    let together = map.trajectories(&sound, 3).expect("lines");
    for (m, start) in sound.chunks(2).enumerate() {
        let alone = map.trajectories(start, 3).expect("lines");
        for t in 0..3 {
            assert_eq!(alone[2 * t..2 * t + 2], together[4 * t + 2 * m..4 * t + 2 * m + 2]);
        }
    }
    // On a coil.
    let on_coil = [3.9 + 0.975, 0.0];
    let lost = map.trajectories(&on_coil, 2).expect("states");
    assert!(lost.iter().all(|v| v.is_nan()), "{lost:?}");
    let far = LineMap::calibrated(&field, 0.0, PERIOD, &on_coil, 1e-8);
    assert!(matches!(far, Err(Error::NoConvergence { .. })));
}

/// A small ring beside the lines, which carries next to no current: with the points that the error of lines asks for it
/// is none, and with more of them it is.
#[test]
fn coils_near_the_lines_have_more_points() {
    let coils = Torsatron::default().coils().expect("sound").all().expect("coils");
    let (guess, reach) = (Some([3.95, 0.0]), 0.05);
    let request = LineRequest { phi: 0.0, angle: PERIOD, reach, guess, error: 1e-4 };
    let without = LineSection::new(&coils, request).expect("a section");
    let needs = without.field().resolved_from();
    let beside = |distance: f64| -> Vec<Coil> {
        let at = without.axis()[0] + reach + distance + 0.005;
        let ring = Coil {
            cosines: vec![[at, 0.0, 0.0], [0.005, 0.0, 0.0]],
            sines: vec![[0.0; 3], [0.0, 0.0, 0.005]],
            current: 1e-3,
            width: 0.0,
        };
        coils.iter().cloned().chain([ring]).collect()
    };
    let with = LineSection::new(&beside(0.6 * needs), request).expect("a section");
    assert!(with.points() > without.points(), "{} and {}", with.points(), without.points());
    for start in with.starts(20).chunks(2) {
        let distance = with.field().distance([start[0], 0.0, start[1]]);
        assert!(distance >= with.field().resolved_from(), "{distance}");
    }
    // Across the lines no number of points is enough: the place is said, at once.
    let error = LineSection::new(&beside(-0.02), request).expect_err("a coil").to_string();
    assert!(error.contains("(R, Z) = (") && error.contains("distance from a coil"), "{error}");
    // Nor is there an axis in a coil.
    let [radius, height] = without.axis();
    let field = CoilField::new(&coils, without.points()).expect("a field");
    let map = LineMap::new(&field, 0.0, PERIOD, 32).expect("a map");
    let error = map.axis([4.875, 0.0]).expect_err("in a winding").to_string();
    assert!(error.contains("where the search ends") && error.contains("from a coil"), "{error}");
    assert!(map.axis([radius + 0.01, height]).is_ok());
}

/// The toroidal field of a section is that of its coils in the half-plane there.
#[test]
fn the_toroidal_field_of_a_section_is_that_of_its_coils() {
    let coils = Torsatron::default().coils().expect("sound").all().expect("coils");
    let phi = 0.3 * PERIOD;
    let guess = LineMap::new(&torsatron(400), phi, PERIOD, 32).expect("a map").axis([3.95, 0.0]);
    let guess = Some(guess.expect("an axis"));
    let request = LineRequest { phi, angle: PERIOD, reach: 0.02, guess, error: 1e-4 };
    let section = LineSection::new(&coils, request).expect("a section");
    for [radius, height] in [[3.95, 0.0], [4.0, 0.05], [3.9, -0.1]] {
        let place = [radius * phi.cos(), radius * phi.sin(), height];
        let [x, y, _]: [f64; 3] = section.field().magnetic_field(place);
        let expected = y * phi.cos() - x * phi.sin();
        let found = section.toroidal_field(radius, height);
        assert!((found / expected - 1.0).abs() < 1e-12 && found.abs() > 0.1, "{found}");
    }
}

/// Along a ray the aperture ends at the first point that is lost, however many behind it stay.
#[test]
fn an_aperture_ends_at_the_first_point_that_is_lost() {
    let radii = [0.1, 0.2, 0.4, 0.5];
    for (survived, maps, expected) in [
        ([None, None, None, None], 10, 0.5),
        ([None, None, Some(7), None], 10, 0.2),
        ([None, None, Some(7), None], 6, 0.5),
        ([None, None, Some(7), None], 7, 0.2),
        ([Some(1), None, None, None], 10, 0.0),
        ([None, Some(12), Some(3), None], 10, 0.2),
    ] {
        assert_eq!(aperture_of_ray(&survived, &radii, maps), expected, "{survived:?} {maps}");
    }
}

/// Lines are followed back to where they come from, to the error of the steps.
#[test]
fn lines_are_followed_backwards() {
    let field = torsatron(600);
    let starts = [3.99, 0.01, 3.92, -0.03];
    for (steps, error) in [(16, 1e-6), (64, 1e-11)] {
        let map = LineMap::new(&field, 0.3, PERIOD, steps).expect("a map");
        let there = map.trajectories(&starts, 1).expect("lines");
        let back = map.backwards().trajectories(&there, 1).expect("lines");
        let misses = starts.iter().zip(&back).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
        assert!(misses < error, "{steps} {misses:e}");
        let moved = starts.iter().zip(&there).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
        assert!(moved > 1e-3 && map.backwards().angle() == -PERIOD);
    }
    // Of a part of a period too: it begins where that ends.
    let part = LineMap::new(&field, 0.3, 0.4 * PERIOD, 64).expect("a map");
    let there = part.trajectories(&starts, 1).expect("lines");
    let back = part.backwards().trajectories(&there, 1).expect("lines");
    let misses = starts.iter().zip(&back).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
    assert!(misses < 1e-11, "{misses:e}");
}

#[test]
fn bad_coils_are_refused() {
    let said = |error: Error| error.to_string();
    assert!(Coil::of_points(&[[0.0; 3]; 2], 1.0).is_err());
    assert!(Coil::of_points(&[[0.0, f64::NAN, 0.0]; 5], 1.0).is_err());
    let text = said(CoilField::new(&[ring()], 8).expect_err("too few"));
    assert!(text.contains("more than 8"), "{text}");
    let none = Coil { current: 0.0, ..ring() };
    assert!(CoilField::new(std::slice::from_ref(&none), 64).is_err());
    let set = CoilSet { coils: vec![none], periods: 1, stellarator_symmetric: false };
    assert!(set.all().is_err());
    let set = CoilSet { coils: vec![ring()], periods: 0, stellarator_symmetric: false };
    assert!(set.all().is_err());
    let odd = Torsatron { periods: 5, ..Torsatron::default() };
    let text = said(odd.coils().expect_err("no multiple"));
    assert!(text.contains("multiple of 2"), "{text}");
    // A coil once more, a whole machine, and a current that the symmetry turns round.
    let refused = |coils: Vec<Coil>, periods: u32, stellarator_symmetric: bool| {
        let set = CoilSet { coils, periods, stellarator_symmetric };
        said(set.all().expect_err("no such machine"))
    };
    let text = refused(vec![ring(), ring()], 1, false);
    assert!(text.contains("coil 1 and coil 2 on one curve"), "{text}");
    let windings = Torsatron::default().coils().expect("sound").coils;
    let text = refused(windings.clone(), 10, false);
    assert!(text.contains("coil 1, an image of which is coil 2"), "{text}");
    let facing: Vec<[f64; 3]> =
        (0..8).map(|k| TAU * k as f64 / 8.0).map(|t| [3.0, t.cos(), t.sin()]).collect();
    let text = refused(vec![Coil::of_points(&facing, 1.0).expect("a coil")], 5, true);
    assert!(text.contains("coil 1, an image of which is itself against its current"), "{text}");
    // Of one winding a period makes the other; of the rings nothing more.
    let of_period = vec![windings[0].clone(), windings[2].clone(), windings[3].clone()];
    for stellarator_symmetric in [false, true] {
        let set = CoilSet { coils: of_period.clone(), periods: 10, stellarator_symmetric };
        match (stellarator_symmetric, set.all()) {
            (false, all) => {
                let all = CoilField::new(&all.expect("coils"), 120).expect("a field");
                let [one, two]: [[f64; 3]; 2] =
                    [&all, &torsatron(120)].map(|field| field.magnetic_field([3.8, 0.7, 0.1]));
                let apart = one.iter().zip(two).map(|(a, b)| (a - b).abs());
                assert!(apart.fold(0.0, max_or_nan) < 1e-12, "{one:?} {two:?}");
            }
            // Half a turn about the x axis takes a ring to the other.
            (true, all) => {
                let text = said(all.expect_err("rings twice"));
                assert!(text.contains("coil 2, an image of which is coil 3"), "{text}");
            }
        }
    }
    // Points that come back by themselves, and that go to and fro.
    let mut closed: Vec<[f64; 3]> =
        (0..40).map(|k| TAU * f64::from(k) / 39.0).map(|t| [3.0 + t.cos(), 0.0, t.sin()]).collect();
    // As it comes of equidistant angles, the last point is off the first by rounding.
    assert_ne!(closed[39], closed[0]);
    let text = said(Coil::of_points(&closed, 1.0).expect_err("closed twice"));
    assert!(text.contains("the first one again"), "{text}");
    closed.pop();
    assert!(Coil::of_points(&closed, 1.0).is_ok());
    let zigzag: Vec<[f64; 3]> = (0..40)
        .map(|k| (TAU * f64::from(k) / 40.0, if k % 2 == 0 { 1.02 } else { 0.98 }))
        .map(|(t, radius)| [3.0 + radius * t.cos(), 0.0, radius * t.sin()])
        .collect();
    let text = said(Coil::of_points(&zigzag, 1.0).expect_err("no curve"));
    assert!(text.contains("to and fro"), "{text}");
    // Near a coil, and where the field turns round.
    let field = CoilField::new(&[ring()], 64).expect("a field");
    let text = said(field.check_at([1.01, 0.0], 0.0, 1.0).expect_err("too near"));
    assert!(text.contains("distance from a coil") && text.contains("1.01"), "{text}");
    let toroidal = torsatron(120);
    let sign = f64::signum(toroidal.cylindrical(3.9, 0.0, 0.0)[1]);
    assert!(toroidal.check_at([3.9, 0.0], 0.0, sign).is_ok());
    assert!(toroidal.check_at([3.9, 0.0], 0.0, -sign).is_err());
}

/// A coil of many turns is its own image under a turn by a period, wound forth or back. Both together are two coils,
/// and so are rings a little apart.
#[test]
fn coils_of_many_turns_are_their_own_images() {
    let wound = |turns: f64, radius: f64| {
        let samples = 24 * turns.abs() as usize;
        let points: Vec<[f64; 3]> = (0..samples)
            .map(|k| TAU * k as f64 / samples as f64)
            .map(|phi| {
                let distance = 3.9 + radius * (turns * phi).cos();
                [distance * phi.cos(), distance * phi.sin(), radius * (turns * phi).sin()]
            })
            .collect();
        Coil::of_points(&points, 1e5).expect("a coil")
    };
    let all = |coils: Vec<Coil>, periods: u32| {
        CoilSet { coils, periods, stellarator_symmetric: false }.all().map(|all| all.len())
    };
    for turns in [20.0, 40.0, -20.0] {
        assert_eq!(all(vec![wound(turns, 1.3)], 10).expect("one"), 1, "{turns}");
    }
    // Under a turn that is no part of one of its own it is another coil.
    assert_eq!(all(vec![wound(20.0, 1.3)], 7).expect("seven"), 7);
    assert_eq!(all(vec![wound(16.0, 1.3), wound(-16.0, 1.3)], 1).expect("two"), 2);
    let ring = |radius: f64| Coil {
        cosines: vec![[0.0; 3], [radius, 0.0, 0.0]],
        sines: vec![[0.0; 3], [0.0, radius, 0.0]],
        current: 1.0,
        width: 0.0,
    };
    assert_eq!(all(vec![ring(5.0), ring(5.009)], 5).expect("two"), 2);
    let wide = Coil { width: 0.1, ..ring(5.0) };
    assert_eq!(all(vec![ring(5.0), wide], 5).expect("of two widths"), 2);
}

/// Modes of simsopt's text format: the ring, and one that is turned a quarter about x.
#[test]
fn coils_are_read_from_text() {
    let text = "# sin x, cos x, sin y, cos y, sin z, cos z of each coil\n\
                0, 0, 0, 0, 0, 0,  9, 3, 0, 0, 0, 0\n\n\
                0 1 1 0 0 0  0 1 0 0 1 0\n";
    let set = parse_coils("coils.dat", text.as_bytes(), &[1.0, 0.0], 2, false).expect("coils");
    assert_eq!(set.coils.len(), 2);
    assert_eq!(
        set.coils[1].point_and_tangent(0.25).0.map(|v| (v * 1e15).round() / 1e15),
        [3.0, 0.0, 1.0]
    );
    let field = CoilField::new(&set.all().expect("coils"), 64).expect("a field");
    let ring = CoilField::new(&[ring()], 64).expect("a field");
    // The ring is its own image; the other carries nothing.
    let [one, two]: [[f64; 3]; 2] =
        [&ring, &field].map(|field| field.magnetic_field([0.2, 0.1, 0.3]));
    assert!(one.iter().zip(two).all(|(a, b)| (a - b).abs() < 1e-21), "{one:?} {two:?}");
    let said = |text: &str, currents: &[f64]| {
        parse_coils("coils.dat", text.as_bytes(), currents, 1, false).expect_err("bad").to_string()
    };
    for (text, currents, words) in [
        ("0 0 0 0 0 0\n0 1 1 0 0\n", &[1.0][..], "coils.dat:2: expected 6 numbers"),
        ("0 0 0 0 0\n", &[1.0], "coils.dat:1: expected a multiple of 6"),
        ("0 0 0 0 0 x\n", &[1.0], "`x`"),
        ("0 0 0 0 0 inf\n", &[1.0], "`inf`"),
        ("# nothing\n", &[1.0], "none"),
        ("0 0 0 0 0 0\n0 1 1 0 0 0\n", &[1.0, 2.0], "currents: expected 1, found 2"),
    ] {
        let found = said(text, currents);
        assert!(found.contains(words), "{found}");
    }
}

fn request() -> LineRequest {
    LineRequest { phi: 0.0, angle: PERIOD, reach: 0.1, guess: None, error: 1e-9 }
}

/// A part of a section finds its axis, and as many points of coils and steps as it needs, and keeps the flux to
/// rounding: with points that a turn by a period does not take to points, the area form at its end is another one.
#[test]
fn sections_find_their_axis_and_keep_the_flux() {
    let coils = Torsatron::default().coils().expect("sound").all().expect("coils");
    let section = LineSection::new(&coils, request()).expect("a section");
    let axis = section.axis();
    assert!((axis[0] - 3.957_531_97).abs() < 1e-7 && axis[1].abs() < 1e-9, "{axis:?}");
    assert!(section.error() < 1e-11, "{}", section.error());
    // What half as many steps change is 2⁸ times the error of a method of order 8.
    let judges = section.starts(8);
    let images = |steps: usize| section.map().with_steps(steps).trajectories(&judges, 1);
    let [fine, coarse] = [1, 2].map(|fewer| images(section.map().steps() / fewer).expect("kept"));
    let apart = fine.iter().zip(&coarse).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
    let error = apart / 256.0;
    assert!((section.error() / error - 1.0).abs() < 1e-3, "{} {error}", section.error());
    assert_eq!(section.field().points() % (10 * coils.len()), 0);
    assert_eq!(section.points() * coils.len(), section.field().points());
    let starts = section.starts(4);
    assert!(
        (starts[6] - axis[0] - 0.1).abs() < 1e-15 && (starts[0] - axis[0] - 0.05).abs() < 1e-15
    );
    let defect = |field: &CoilField| {
        let map = LineMap::new(field, 0.0, PERIOD, 48).expect("a map");
        let of = |place: [f64; 2]| {
            let (image, [[a, b], [c, d]]) = map.with_jacobian(place);
            let toroidal = |[r, z]: [f64; 2]| -> f64 { field.cylindrical(r, 0.0, z)[1] };
            ((a * d - b * c) * toroidal(image) / toroidal(place) - 1.0).abs()
        };
        let places = starts.chunks(2).map(|z| of([z[0], z[1]]));
        places.fold(0.0, max_or_nan)
    };
    let [even, odd] = [60, 63].map(|points| CoilField::new(&coils, points).expect("a field"));
    let [even, odd] = [&even, &odd].map(defect);
    assert!(even < 1e-12 && odd > 1e-6, "{even} {odd}");
    // Beside the axis a line goes by the powers of a matrix M: z₂ + z₀ = (Tr M) z₁, of points from the axis.
    let beside = [axis[0] + 1e-5, axis[1]];
    let images = section.map().trajectories(&beside, 2).expect("a line");
    let line = [&beside[..], &images].concat();
    let from_axis = |k: usize| [line[2 * k] - axis[0], line[2 * k + 1] - axis[1]];
    let [[x, _], [y, z], [u, _]] = [from_axis(0), from_axis(1), from_axis(2)];
    let turns = section.turns();
    assert!(((x + u) / y - 2.0 * (TAU * turns).cos()).abs() < 1e-4, "{turns}");
    // It goes from R towards Z where a point of positive R − R₀ comes to positive Z.
    assert!(turns.abs() < 0.5 && turns * z > 0.0, "{turns} {z}");
    // The chart is of the section: the box is around points of it.
    let chart = section.chart(&starts).expect_err("no extent along Z");
    assert!(chart.to_string().contains("interval"), "{chart}");
    let lines = section.map().trajectories(&starts, 20).expect("lines");
    let chart = section.chart(&lines).expect("a chart");
    assert!(
        chart.error() < 1e-12 && chart.planes()[0].as_ref().expect("one").contains(axis[0], 0.0)
    );
}

/// Whole turns about the axis are counted: a map of a turn has ten times those of a map of a period, more than the half
/// that its Jacobian knows, and as many as the angle of a line grows by from period to period.
#[test]
fn turns_of_long_maps_are_whole_turns_and_a_part() {
    let coils = Torsatron::default().coils().expect("sound").all().expect("coils");
    let guess = Some([3.957_531_97, 0.0]);
    let [period, turn] = [1.0, 10.0].map(|periods| {
        let request = LineRequest { angle: PERIOD * periods, error: 1e-6, guess, ..request() };
        LineSection::new(&coils, request).expect("a section")
    });
    let axis = period.axis();
    assert!(period.turns().abs() < 0.5 && turn.turns().abs() > 0.5, "{}", turn.turns());
    let apart = (turn.turns() - 10.0 * period.turns()).abs();
    assert!(apart < 1e-6, "{apart:e}");
    // In the mean over many turns: of one the angle depends on where the line is.
    let periods = 250;
    let line = period.map().trajectories(&[axis[0] + 1e-4, axis[1]], periods).expect("a line");
    let angles: Vec<f64> =
        { line.chunks_exact(2) }.map(|z| libm::atan2(z[1] - axis[1], z[0] - axis[0])).collect();
    let growth: f64 = angles.windows(2).map(|pair| libm::remainder(pair[1] - pair[0], TAU)).sum();
    let mean = growth / TAU / (periods as f64 - 1.0);
    assert!((mean - period.turns()).abs() < 2e-3, "{mean} and {}", period.turns());
}

/// Of a turn by any angle the trace leads back to its turns, given about how many they are, and to their derivative.
#[test]
fn turns_follow_from_a_trace_and_what_they_are_near() {
    let trace = |turns: f64| 2.0 * (TAU * turns).cos();
    for turns in [0.2, -0.2, 0.45, 0.607, 0.9, -0.607, 1.3, -2.7] {
        for off in [-0.04, 0.0, 0.04] {
            let (found, sign) = turns_of_trace(trace(turns), turns + off);
            assert!((found - turns).abs() < 1e-12, "{turns} {off}: {found}");
            // dTr/dt = −4π sin 2πt, of the part α by which t = k ± α.
            let h = 1e-6;
            let slope = 2.0 * h / (trace(turns + h) - trace(turns - h));
            let by_part = -0.5 / (TAU * (1.0 - 0.25 * trace(turns).powi(2)).sqrt());
            assert!((sign * by_part / slope - 1.0).abs() < 1e-6, "{turns}: {sign}");
        }
    }
    assert!(turns_of_trace(2.1, 0.3).0.is_nan());
}

/// A line that is lost some maps later than the points where fields of more and fewer points are compared.
#[test]
fn a_reach_beyond_the_surfaces_is_said_with_its_place() {
    let coils = Torsatron::default().coils().expect("sound").all().expect("coils");
    let of = |reach| LineRequest { reach, guess: Some([3.95, 0.0]), error: 1e-4, ..request() };
    for reach in [0.28, 0.32] {
        let text = LineSection::new(&coils, of(reach)).expect_err("lost lines").to_string();
        assert!(text.contains("reach") && text.contains("(R, Z) = ("), "{reach}: {text}");
    }
    let section = LineSection::new(&coils, of(0.2)).expect("surfaces");
    assert!(section.error() < 1e-4);
    let far = LineRequest { phi: 1e300, ..request() };
    let text = LineSection::new(&coils, far).expect_err("no angle").to_string();
    assert!(text.contains("phi"), "{text}");
}

/// A map over some of the periods, which are no whole part of a turn: its coils too have points that the map takes to
/// points.
#[test]
fn maps_over_some_of_the_periods_keep_the_flux() {
    let coils = Torsatron { periods: 14, ..Torsatron::default() };
    let coils = coils.coils().expect("sound").all().expect("coils");
    let of = LineRequest { angle: 3.0 * TAU / 14.0, ..request() };
    let section = LineSection::new(&coils, of).expect("a section");
    assert_eq!(section.field().points() % (14 * coils.len()), 0);
    let axis = section.axis();
    let (image, [[a, b], [c, d]]) = section.map().with_jacobian([axis[0] + 0.05, axis[1]]);
    let toroidal = |[r, z]: [f64; 2]| -> f64 { section.field().cylindrical(r, 0.0, z)[1] };
    let defect = (a * d - b * c) * toroidal(image) / toroidal([axis[0] + 0.05, axis[1]]) - 1.0;
    assert!(defect.abs() < 1e-9, "{defect:e}");
}

#[test]
fn sections_without_an_axis_or_within_coils_are_refused() {
    let coils = Torsatron::default().coils().expect("sound").all().expect("coils");
    let said =
        |request: LineRequest| LineSection::new(&coils, request).expect_err("refused").to_string();
    let far = said(LineRequest { reach: 0.9, ..request() });
    assert!(far.contains("reach") || far.contains("distance from a coil"), "{far}");
    let nowhere = said(LineRequest { guess: Some([0.01, 9.0]), ..request() });
    assert!(nowhere.contains("axis"), "{nowhere}");
    for bad in [
        LineRequest { reach: 0.0, ..request() },
        LineRequest { angle: f64::NAN, ..request() },
        LineRequest { angle: 1.0, ..request() },
        LineRequest { phi: f64::INFINITY, ..request() },
        LineRequest { error: 0.0, ..request() },
        LineRequest { guess: Some([f64::NAN, 0.0]), ..request() },
    ] {
        said(bad);
    }
    // A ring alone has no lines that go round it in φ.
    let none = LineSection::new(&[ring()], request()).expect_err("no axis").to_string();
    assert!(none.contains("magnetic axis"), "{none}");
}

/// Through planes lines go where they go in the field of the coils, the nearer the higher the degree; what leaves
/// the part that planes were fitted to is lost.
#[test]
fn planes_stand_for_the_field() {
    let field = torsatron(60);
    let map = LineMap::new(&field, 0.0, PERIOD, 8).expect("a map");
    let axis = map.axis([3.95, 0.0]).expect("an axis");
    let start: Vec<f64> = (1..=16).flat_map(|k| [axis[0] + 0.1 * k as f64 / 16.0, 0.0]).collect();
    let lines = [start.clone(), map.trajectories(&start, 24).expect("lines")].concat();
    let exact = map.trajectories(&start[..8], 40).expect("lines");
    let errors = [6, 10, 14].map(|degree| {
        let planes = TabulatedLines::new(&map, &lines, degree).expect("planes");
        assert_eq!((planes.steps(), planes.planes()), (8, 89));
        let found = planes.trajectories(&start[..8], 40).expect("lines");
        found.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan)
    });
    assert!(errors[0] > 20.0 * errors[1] && errors[1] > 20.0 * errors[2], "{errors:?}");
    assert!(errors[2] < 1e-9, "{errors:?}");
    let planes = TabulatedLines::new(&map, &lines, 14).expect("planes");
    assert_eq!(planes.bytes(), 89 * 2 * 120 * 8);
    let place = [axis[0] + 0.06, 0.02];
    let ((one, a), (other, b)) = (map.with_jacobian(place), planes.with_jacobian(place));
    let pairs = one.iter().chain(a.as_flattened()).zip(other.iter().chain(b.as_flattened()));
    let apart = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
    assert!(apart < 1e-8, "{apart}");
    let all = planes.rollout(&start, Rollout { steps: 6, every: 3 }).expect("orbits");
    assert_eq!(all[..32], start[..]);
    let last = planes.trajectories(&start, 6).expect("lines");
    assert_eq!(all[64..], last[5 * 32..]);
    let beyond = planes.trajectories(&[axis[0] + 0.3, 0.0, place[0], place[1]], 2).expect("states");
    assert!(beyond[0].is_nan() && beyond[4].is_nan() && beyond[2].is_finite(), "{beyond:?}");
    assert!(TabulatedLines::new(&map, &start, 14).is_err(), "too few points");
    assert!(TabulatedLines::new(&map, &[axis[0] + 2.0, 0.0], 1).is_err(), "a lost line");
    assert!(planes.rollout(&start, Rollout { steps: 6, every: 0 }).is_err());
}
