//! Coils and their field lines, sections whose area form is not canonical, maps by polynomials, and what is asked of
//! maps of a plane.

use faer::MatRef;
use gyroceptron::Error;
use gyroceptron::flow::{
    FormDefect, LineMap, LineRequest, LineSection, Pairs, PolynomialMap, PolynomialOnSection,
    Symmetries, SymplecticPolynomial, TabulatedLines, Trajectories, Window, sample, turns_of_trace,
};
use gyroceptron::io::{
    Provenance, StoredPolynomial, load_polynomial, parse_coils, parse_polynomial, polynomial_text,
    save_polynomial,
};
use gyroceptron::layer::Reversor;
use gyroceptron::measure::adiabatic::log_slope;
use gyroceptron::measure::orbits::{
    Branch, InvariantCircle, aperture_of_ray, lyapunov_exponent, manifold, periodic_orbit,
    periodic_orbits, rotation_numbers, smaller_alignment_index,
};
use gyroceptron::measure::ratios::symplecticity_defect;
use gyroceptron::network::{Pace, Rollout};
use gyroceptron::phase::{AreaDensity, Section};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Dual, max_or_nan};
use gyroceptron::system::{Coil, CoilField, CoilSet, Oscillators, Tokamak, Torsatron};
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
fn pairs_of(dof: usize, count: usize, half: f64, map: impl Fn(&mut [f64])) -> Pairs {
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
