//! Maps on a grid: undone to the last bit.

use gyroceptron::layer::{
    Activation, CircleAction, HenonLayer, Reversor, TorusAction, TurnFraction,
};
use gyroceptron::measure::{
    GridMap, OneStep, certificate::Verdict, laws, ratios::differing_places,
};
use gyroceptron::network::{
    Composition, CouplingGyroceptronShape, Course, GridPoints, GyroceptronShape, HenonShape,
    InitialWeights, KickedGyroceptronShape, Model, NormalFormShape, Pace, Rollout, SympNetShape,
    grid_rollout,
};
use gyroceptron::phase::{Direction, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{
    FloatOnGrid, Grid, GridNumbers, IntegerOnGrid, Integers, OnGrid, Over, Scalar, Simd, max_or_nan,
};
use std::collections::HashSet;

const NORMAL: fn(f64) -> InitialWeights = |scale| InitialWeights::Normal { scale };

fn gyroceptron(scale: f64, epsilon: f64) -> Model {
    let circle_action = CircleAction::new(vec![1, 0]);
    let shape = GyroceptronShape { circle_action, psi: vec![6; 4], near_identity: vec![4; 2] };
    shape.architecture(epsilon).initialise(NORMAL(scale), 0.7, 3).expect("a sound shape")
}

/// A network of every kind of step that is a shear, with its name.
fn networks(dof: usize, scale: f64) -> Vec<(&'static str, Model)> {
    let circle = CircleAction::new((0..dof as i32).map(|j| 1 - j).collect::<Vec<_>>());
    let henon = HenonShape { dof, widths: vec![5, 3] }.architecture(1.0);
    let gyroceptron =
        GyroceptronShape { circle_action: circle.clone(), psi: vec![4, 3], near_identity: vec![3] };
    let kicked = KickedGyroceptronShape { circle_action: circle, psi: vec![3], kicks: vec![4, 2] };
    let plain = false;
    let modules = SympNetShape { dof, modules: 3, shears: 2, activation: Activation::Tanh, plain };
    let reversible = henon.clone().reversible(Some(Reversor::Momenta));
    [
        ("HénonNet", henon),
        ("gyroceptron", gyroceptron.architecture(0.3)),
        ("turned kicks", kicked.architecture(0.3)),
        ("SympNet", modules.architecture()),
        ("reversible", reversible),
    ]
    .map(|(name, architecture)| {
        (name, architecture.initialise(NORMAL(scale), 0.7, 3).expect("a sound shape"))
    })
    .into()
}

fn points(dof: usize, count: usize) -> Vec<f64> {
    let mut stream = Stream::new(5, "points");
    (0..2 * dof * count).map(|_| stream.uniform(-1.0, 1.0)).collect()
}

fn grid(bits: u32, numbers: GridNumbers) -> Grid {
    Grid::new(bits, numbers).expect("a grid")
}

fn moved(map: &Composition<f64>, direction: Direction, points: &mut GridPoints, steps: usize) {
    let (request, pace) = (Rollout { steps, every: steps }, &mut Pace::unbroken());
    grid_rollout(map, direction, points, request, pace).expect("in range");
}

fn assert_undone(model: &Model, start: &GridPoints, steps: usize) {
    let mut here = start.clone();
    moved(model.composition(), Direction::Forward, &mut here, steps);
    assert_ne!(&here, start);
    moved(model.composition(), Direction::Inverse, &mut here, steps);
    assert_eq!(&here, start);
}

#[test]
fn steps_there_and_back_end_where_they_began() {
    for dof in [1, 2, 3] {
        for (_, model) in networks(dof, 0.3) {
            for numbers in GridNumbers::ALL {
                let start = GridPoints::nearest(grid(40, numbers), &points(dof, 37));
                assert_undone(&model, &start.expect("small numbers"), 6);
            }
        }
    }
    // Plain numbers do not come back.
    let model = gyroceptron(0.3, 0.3);
    let start = points(2, 8);
    let there = |course: Course, from: &[f64]| {
        let (request, pace) = (Rollout { steps: 1000, every: 1000 }, &mut Pace::unbroken());
        let states = model.rollout_along(course, from, request, pace).expect("finite");
        states[from.len()..].to_vec()
    };
    let back = Course { direction: Direction::Inverse, grid: None };
    assert_ne!(there(back, &there(Course::default(), &start)), start);
}

/// Orbits of large weights wrap, and are undone all the same; of floats they have left the range.
#[test]
fn orbits_that_wrap_are_undone() {
    let model = gyroceptron(1.5, 0.3);
    // Coordinates from −4 to 4.
    let start = GridPoints::nearest(grid(61, GridNumbers::Integers), &points(2, 9));
    assert_undone(&model, &start.expect("small numbers"), 300);
    let mut stream = Stream::new(7, "places");
    let mut anywhere = || (stream.uniform(-1.0, 1.0) * 2_f64.powi(63)) as i64;
    let places: Vec<i64> = (0..4 * 9).map(|_| anywhere()).collect();
    let places = places.into_iter().chain([i64::MIN, i64::MAX, 0, -1]);
    let anywhere = GridPoints::new(grid(44, GridNumbers::Integers), places.collect());
    assert_undone(&model, &anywhere, 300);
    let mut floats = GridPoints::nearest(grid(50, GridNumbers::Floats), &points(2, 9)).unwrap();
    let before = floats.clone();
    let (request, pace) = (Rollout { steps: 300, every: 100 }, &mut Pace::unbroken());
    let left = grid_rollout(model.composition(), Direction::Forward, &mut floats, request, pace);
    let reason = left.expect_err("a range of 2").to_string();
    assert!(
        reason.contains("orbit on a grid of floats") && reason.contains("below 2e0"),
        "{reason}"
    );
    // Nothing is lost.
    assert_eq!(floats, before);
}

/// Where they have the same range, integers and floats are the same grid.
#[test]
fn both_grids_have_the_same_orbits() {
    for (name, model) in networks(2, 0.3) {
        let places = GridNumbers::ALL.map(|numbers| {
            let mut here = GridPoints::nearest(grid(40, numbers), &points(2, 11)).expect("small");
            moved(model.composition(), Direction::Forward, &mut here, 6);
            here.places().to_vec()
        });
        assert_eq!(places[0], places[1], "{name}");
    }
}

/// On lanes of any width, one point at a time, and on any number of threads.
#[test]
fn orbits_are_the_same_bits_everywhere() {
    for (name, model) in networks(2, 0.3) {
        for numbers in GridNumbers::ALL {
            let start = GridPoints::nearest(grid(44, numbers), &points(2, 600)).expect("small");
            let orbit = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
                pool.expect("threads").install(|| {
                    let mut here = start.clone();
                    moved(model.composition(), Direction::Forward, &mut here, 3);
                    here.places().to_vec()
                })
            };
            let one = orbit(1);
            assert_eq!(one, orbit(2), "{name}");
            for (index, z) in start.places().chunks_exact(4).enumerate().take(40) {
                let mut alone = z.to_vec();
                let step = |z: &mut Vec<i64>| match numbers {
                    GridNumbers::Integers => {
                        let mut on: Vec<_> =
                            z.iter().map(|&k| IntegerOnGrid::from_place(k, 44)).collect();
                        (0..3).for_each(|_| model.forward(&mut on));
                        *z = on.iter().map(|z| z.place().expect("on the grid")).collect();
                    }
                    GridNumbers::Floats => {
                        let mut on: Vec<_> =
                            z.iter().map(|&k| FloatOnGrid::from_place(k, 44)).collect();
                        (0..3).for_each(|_| model.forward(&mut on));
                        *z = on.iter().map(|z| z.place().expect("on the grid")).collect();
                    }
                };
                step(&mut alone);
                assert_eq!(alone, one[4 * index..4 * index + 4], "{name}, point {index}");
            }
            if Simd::Avx2.is_available() {
                Simd::Avx2.limit();
                let four = orbit(1);
                Simd::Portable.limit();
                let portable = orbit(1);
                Simd::Avx512.limit();
                assert!(one == four && one == portable, "{name}");
            }
        }
    }
}

/// The orbit of a network on integers, the same in every build and on every processor.
#[test]
fn an_orbit_has_the_digest_that_it_has_everywhere() {
    let model = gyroceptron(0.3, 0.3);
    let mut here =
        GridPoints::nearest(grid(44, GridNumbers::Integers), &points(2, 16)).expect("small");
    moved(model.composition(), Direction::Forward, &mut here, 2000);
    let fold = |digest: u64, place: &i64| (digest ^ *place as u64).wrapping_mul(0x100_0000_01b3);
    assert_eq!(format!("{:016x}", here.places().iter().fold(0, fold)), "2e85f662ca05fa72");
}

/// At ε = 0 a gyroceptron is ψ∘Φ_θ∘ψ⁻¹, N steps of it are ψ∘Φ_θᴺ∘ψ⁻¹, and all of that to the last bit.
#[test]
fn without_its_perturbation_a_gyroceptron_is_a_conjugated_turn_exactly() {
    let model = gyroceptron(0.5, 0.0);
    for numbers in GridNumbers::ALL {
        let start = GridPoints::nearest(grid(44, numbers), &points(2, 7)).expect("small");
        let mut there = start.clone();
        moved(model.composition(), Direction::Forward, &mut there, 500);
        let psi = model.psi();
        let turn = Composition::of_turn(&TorusAction::from(CircleAction::new([1, 0])), vec![0.7]);
        let mut apart = start.clone();
        moved(&psi, Direction::Inverse, &mut apart, 1);
        moved(&turn.expect("an angle"), Direction::Forward, &mut apart, 500);
        moved(&psi, Direction::Forward, &mut apart, 1);
        assert_eq!(there, apart);
        // I₀ alone moves nothing.
        let mut still = start.clone();
        moved(&model.near_identity(), Direction::Forward, &mut still, 3);
        assert_eq!(still, start);
    }
}

#[test]
fn turns_by_fractions_obey_the_axioms_to_the_last_bit() {
    let mut stream = Stream::new(11, "fractions");
    let torus = TorusAction::new([CircleAction::new([1, 3]), CircleAction::new([0, -2])]).unwrap();
    let quarter = TurnFraction::of_turn(1, 4);
    let eighths = (0..16).map(|k| TurnFraction::of_turn(k, 8));
    let any =
        (0..50).map(|_| TurnFraction::new((stream.uniform(-1.0, 1.0) * 2_f64.powi(63)) as i64));
    let angles: Vec<TurnFraction> =
        eighths.chain(any).chain([TurnFraction::new(i64::MIN)]).collect();
    let turn =
        |a: TurnFraction, b: TurnFraction| Composition::of_turn_fractions(&torus, &[a, b]).unwrap();
    for numbers in GridNumbers::ALL {
        let start = GridPoints::nearest(grid(44, numbers), &points(2, 9)).expect("small");
        let after = |maps: &[Composition<f64>]| {
            let mut here = start.clone();
            maps.iter().for_each(|map| moved(map, Direction::Forward, &mut here, 1));
            here
        };
        let none = TurnFraction::default();
        assert_eq!(after(&[turn(none, none)]), start);
        assert_eq!(after(&[0; 4].map(|_| turn(quarter, quarter))), start);
        for (&a, &b) in angles.iter().zip(angles.iter().rev()) {
            assert_ne!(after(&[turn(a, quarter + b)]), after(&[turn(a, b)]));
            // Φ_{−θ} undoes Φ_θ, and is its inverse.
            assert_eq!(after(&[turn(a, b), turn(-a, -b)]), start, "{a:?} {b:?}");
            let mut back = start.clone();
            moved(&turn(a, b), Direction::Inverse, &mut back, 1);
            assert_eq!(back, after(&[turn(-a, -b)]), "{a:?} {b:?}");
            // Φ_a∘Φ_b is Φ_{a+b} to what increments are rounded by.
            let (one, two) = (after(&[turn(a + b, none)]), after(&[turn(b, none), turn(a, none)]));
            let apart = one.places().iter().zip(two.places()).map(|(a, b)| a.abs_diff(*b));
            assert!(apart.max() <= Some(6), "{a:?} {b:?}");
        }
    }
    // Beside the turn by the same angle in radians.
    let (a, b) = (0.7, -2.9);
    let [ours, plain] = [
        torus.turn_by_fractions(&[TurnFraction::of_radians(a), TurnFraction::of_radians(b)]),
        torus.turn_by(&[a, b]),
    ];
    for (ours, plain) in ours.planes().iter().zip(plain.planes()) {
        assert_eq!((ours.plane, ours.quarter_turns), (plain.plane, plain.quarter_turns));
        assert!((ours.s - plain.s).abs() < 1e-14 && (ours.t - plain.t).abs() < 1e-14);
    }
    for theta in [0.0, 1e-19, -1e-17, 3.2, -3.2, 6.4, 100.0] {
        let error = TurnFraction::of_radians(theta).radians() - theta;
        let turns = (error / std::f64::consts::TAU).round();
        assert!((error - turns * std::f64::consts::TAU).abs() < 1e-13, "{theta}");
    }
}

/// p ← p + K sin q, q ← q + p; written with increments, or with sums that lose a grid, or whose
/// inverse is off by 1e-9 of an increment.
struct StandardMap<const WAY: u8>;

impl<S: Over<f64>, const WAY: u8> Map<S> for StandardMap<WAY> {
    fn dof(&self) -> usize {
        1
    }
    fn forward(&self, z: &mut [S]) {
        z[1] = z[1].increment(1.2, z[0].sin_cos().0);
        z[0] = if WAY == 1 { z[0] + z[1] } else { z[0].increment(1.0, z[1]) };
    }
    fn inverse(&self, z: &mut [S]) {
        z[0] = if WAY == 1 { z[0] - z[1] } else { z[0].increment(-1.0, z[1]) };
        let k = if WAY == 2 { -1.2 * (1.0 + 1e-9) } else { -1.2 };
        z[1] = z[1].increment(k, z[0].sin_cos().0);
    }
}

#[test]
fn maps_from_outside_are_measured_on_a_grid() {
    let points = points(1, 20);
    let row = |map: &dyn GridMap| laws::inversion_on_grid(map, &points).row();
    assert_eq!(row(&OneStep(StandardMap::<0>)).verdict, Verdict::Holds);
    assert_eq!(row(&OneStep(StandardMap::<1>)).verdict, Verdict::Violated);
    assert_eq!(row(&OneStep(StandardMap::<2>)).verdict, Verdict::Violated);
    // A layer and the single map of it, through the same hook.
    let mut stream = Stream::new(2, "weights");
    let weights: Vec<f64> = (0..4 * 3 + 1).map(|_| stream.normal()).collect();
    let layer = HenonLayer::new(1, 4, 0.7, &weights);
    assert_eq!(row(&OneStep(layer)).verdict, Verdict::Holds);
    assert_eq!(row(&OneStep(layer.map())).verdict, Verdict::Holds);
    // What moves nothing shows nothing.
    let still = HenonLayer::new(1, 4, 0.0, &weights);
    assert_eq!(row(&OneStep(still)).verdict, Verdict::Vacuous);
}

/// All states of a torus of 256 × 256 points go to different ones.
#[test]
fn small_tori_are_mapped_onto_themselves() {
    type Small = OnGrid<f64, Integers<f64, 8>>;
    let images = |map: &dyn Fn(&mut [Small])| {
        let states = (-128..128).flat_map(|q| (-128..128).map(move |p| [q, p]));
        let image = |state: [i64; 2]| {
            let mut z = state.map(|place| Small::from_place(place, 5));
            map(&mut z);
            z.map(|z| z.place().expect("on the grid"))
        };
        states.map(image).collect::<HashSet<_>>().len()
    };
    let coordinates = [-4.0_f64, 3.97].map(|value| (value * 32.0).round() as i64);
    assert_eq!(coordinates, [-128, 127]);
    for (name, model) in networks(1, 0.7) {
        assert_eq!(images(&|z| model.forward(z)), 1 << 16, "{name}");
        assert_eq!(images(&|z| model.inverse(z)), 1 << 16, "{name}");
        // Rounding the result, not the increment, leaves holes.
        let rounded = |z: &mut [Small]| {
            let mut plain = [z[0], z[1]].map(|z| z.place().expect("on the grid") as f64 / 32.0);
            model.forward(&mut plain);
            for (z, value) in z.iter_mut().zip(plain) {
                let place = (value * 32.0).round_ties_even() as i64;
                *z = Small::from_place(place, 5);
            }
        };
        assert!(images(&rounded) < 1 << 16, "{name}");
    }
    let eighth = CircleAction::new([1]).turn_by_fraction(TurnFraction::of_turn(1, 7));
    assert_eq!(images(&|z| eighth.forward(z)), 1 << 16);
}

#[test]
fn what_is_no_bijection_of_a_grid_is_refused() {
    let circle_action = CircleAction::new([1, 0]);
    let (psi, near_identity, flow_time) = (vec![2], vec![2], 1.0);
    let action = TorusAction::from(circle_action.clone());
    let coupling = CouplingGyroceptronShape { circle_action, psi, near_identity, flow_time };
    let (psi, kicks, twists, turned_twists) = (vec![], vec![3], vec![2], vec![]);
    let perturbation = None;
    let twisted =
        NormalFormShape { action, psi, kicks, twists, turned_twists, flow_time, perturbation };
    for (architecture, word) in
        [(coupling.architecture(0.1), "coupling"), (twisted.architecture(0.1), "twist")]
    {
        let model = architecture.initialise(NORMAL(0.3), 0.7, 3).expect("a sound shape");
        let reason = model.composition().check_on_grid().expect_err("no shear").to_string();
        assert!(reason.contains(word) && reason.starts_with("map on a grid"), "{reason}");
        let course = Course { grid: Some(grid(40, GridNumbers::Integers)), ..Course::default() };
        let (request, pace) = (Rollout { steps: 1, every: 1 }, &mut Pace::unbroken());
        assert!(model.rollout_along(course, &points(2, 1), request, pace).is_err());
    }
    let points = points(2, 1);
    let small = Grid::new(50, GridNumbers::Floats).unwrap();
    let reason = GridPoints::nearest(small, &[2.5, 0.0]).expect_err("a range of 2").to_string();
    assert!(reason.contains("below 2 in magnitude") && reason.contains("2.5"), "{reason}");
    assert!(GridPoints::nearest(small, &[f64::NAN]).is_err());
    for (bits, numbers) in [(63, GridNumbers::Integers), (51, GridNumbers::Floats)] {
        let reason = Grid::new(bits, numbers).expect_err("too fine").to_string();
        assert!(reason.contains(&bits.to_string()), "{reason}");
    }
    // Three numbers are no point of a plane.
    let model = gyroceptron(0.3, 0.3);
    let mut ragged = GridPoints::nearest(small, &points[..3]).expect("small");
    let (request, pace) = (Rollout { steps: 1, every: 1 }, &mut Pace::unbroken());
    assert!(
        grid_rollout(model.composition(), Direction::Forward, &mut ragged, request, pace).is_err()
    );
}

#[test]
fn quantising_moves_a_point_by_half_the_spacing_at_most() {
    for bits in [0, 1, 20, 44] {
        let grid = grid(bits, GridNumbers::Integers);
        let mut largest = 0.0_f64;
        for value in points(2, 50) {
            let place = grid.quantise(&[value]).expect("small")[0];
            largest = max_or_nan(largest, (grid.value(place) - value).abs());
        }
        assert!(largest <= grid.rounding() && largest > 0.5 * grid.rounding(), "{bits} {largest}");
    }
    // Halves go to even places, with either sign.
    let grid = grid(0, GridNumbers::Integers);
    assert_eq!(grid.quantise(&[0.5, 1.5, -0.5, -1.5, 2.5]).expect("small"), [0, 2, 0, -2, 2]);
    let on = |place| IntegerOnGrid::from_place(place, 0);
    let half = |times: f64| on(0).increment(times, IntegerOnGrid::from_f64(0.5)).place();
    assert_eq!([1.0, 3.0, -1.0, -3.0, 5.0].map(half), [0, 2, 0, -2, 2].map(Some));
    // Far beyond 64 bits the last ones are what counts.
    let far = |by: f64| on(7).increment(1.0, IntegerOnGrid::from_f64(by)).place();
    assert_eq!(far(2_f64.powi(63)), Some((7_i64).wrapping_add(i64::MIN)));
    assert_eq!(far(2_f64.powi(64)), Some(7));
    assert_eq!(far(-1e300), Some(7));
    assert_eq!(far(2_f64.powi(64) + 2_f64.powi(12)), Some(7 + 4096));
    assert_eq!(far(f64::INFINITY), None);
    assert_eq!(far(f64::NAN), None);
    let lost = on(7).increment(1.0, IntegerOnGrid::from_f64(f64::NAN));
    assert_eq!(lost.increment(1.0, IntegerOnGrid::from_f64(1.0)).place(), None);
    assert_eq!((-on(i64::MIN)).place(), Some(i64::MIN));
    assert_eq!(Scalar::abs(on(-3)).place(), None);
}

/// z ← z with q += p, on one point.
struct Drift;

impl<S: Over<f64>> Map<S> for Drift {
    fn dof(&self) -> usize {
        1
    }
    fn forward(&self, z: &mut [S]) {
        z[0] = z[0].increment(1.0, z[1]);
    }
    fn inverse(&self, z: &mut [S]) {
        z[0] = z[0].increment(-1.0, z[1]);
    }
}

/// What is in range there is so on the way back, up to the very end of the range.
#[test]
fn floats_that_stay_in_range_do_so_on_the_way_back() {
    let grid = grid(50, GridNumbers::Floats);
    let end = (1_i64 << 51) - 1;
    let unit = 1_i64 << 50;
    for (places, stays) in [
        ([9 * unit / 10, 7 * unit / 10], true),
        ([end, 0], true),
        ([-end, 0], true),
        ([end - 5, 5], true),
        ([end - 5, 6], false),
        ([-unit, 2 * unit - 1], true),
        ([0, -end], true),
        ([-1, -end], false),
    ] {
        let found = differing_places(&OneStep(Drift), Direction::Forward, grid, &places);
        assert_eq!(found, stays.then_some(0), "{places:?}");
    }
    // Places that floats do not hold are none of theirs.
    for place in [1_i64 << 51, i64::MIN, -(1 << 51)] {
        assert_eq!(FloatOnGrid::from_place(place, 50).place(), None);
    }
    let mut beyond = GridPoints::new(grid, vec![0; 3].into_iter().chain([1 << 51]).collect());
    let (request, pace) = (Rollout { steps: 1, every: 1 }, &mut Pace::unbroken());
    let moved = grid_rollout(
        gyroceptron(0.3, 0.3).composition(),
        Direction::Forward,
        &mut beyond,
        request,
        pace,
    );
    assert!(moved.is_err());
}

/// Φ_{−θ}∘Φ_θ = Id on a small torus at every state, also at those that are their own negatives.
#[test]
fn turns_are_undone_where_integers_wrap() {
    type Small = OnGrid<f64, Integers<f64, 8>>;
    let circle = CircleAction::new([1]);
    for k in -64_i64..64 {
        let theta = TurnFraction::new(k << 57);
        let [there, back] = [theta, -theta].map(|theta| circle.turn_by_fraction(theta));
        for q in (-128..128).step_by(5).chain([127]) {
            for p in [-128, -127, -1, 0, 3, 64, 127] {
                let mut z = [q, p].map(|place| Small::from_place(place, 5));
                there.forward(&mut z);
                back.forward(&mut z);
                assert_eq!(z.map(|z| z.place()), [Some(q), Some(p)], "{theta:?}");
            }
        }
    }
    assert_eq!(TurnFraction::of_turn(1 << 62, 3), TurnFraction::of_turn(1, 3));
    assert_eq!(TurnFraction::of_turn(-1, 3), -TurnFraction::of_turn(1, 3));
    assert_eq!(TurnFraction::of_turn(i64::MIN, 4), TurnFraction::default());
}

/// 0 has one sign on a grid, and numbers on none are plain.
#[test]
fn the_number_is_a_function_of_the_place() {
    let zero = |z: f64| z.to_bits() == 0;
    let (integer, float) = (IntegerOnGrid::from_place(0, 44), FloatOnGrid::from_place(0, 44));
    assert!(zero(gyroceptron::scalar::Real::value(-integer)));
    assert!(zero(gyroceptron::scalar::Real::value(-float)));
    let plain = IntegerOnGrid::from_f64(0.75);
    let moved = plain.increment(0.5, IntegerOnGrid::from_f64(0.1));
    assert_eq!(gyroceptron::scalar::Real::value(moved), 0.8);
    assert_eq!(gyroceptron::scalar::Real::value(-plain), -0.75);
    assert!(moved.is_of_no_increments() && (-plain).is_of_no_increments());
    let moved = FloatOnGrid::from_f64(0.75).increment(0.5, FloatOnGrid::from_f64(0.1));
    assert_eq!(gyroceptron::scalar::Real::value(moved), 0.8);
    assert!(moved.is_of_no_increments());
}

/// Points near the ends of 64 bits beside points far from them, in one register, and parts of a
/// roll-out that end between the states that are kept.
#[test]
fn far_points_and_pauses_change_nothing() {
    let model = gyroceptron(0.7, 0.3);
    let mut stream = Stream::new(3, "far");
    let near = GridPoints::nearest(grid(44, GridNumbers::Integers), &points(2, 50)).expect("small");
    let mut places = near.places().to_vec();
    for place in places.iter_mut().step_by(7) {
        *place = (stream.uniform(-1.0, 1.0) * 2_f64.powi(63)) as i64;
    }
    let start = GridPoints::new(grid(44, GridNumbers::Integers), places);
    let request = Rollout { steps: 300, every: 100 };
    let mut whole = start.clone();
    let map = model.composition();
    let states = grid_rollout(map, Direction::Forward, &mut whole, request, &mut Pace::unbroken());
    let mut go_on = || true;
    let mut parts = start.clone();
    let by_parts =
        grid_rollout(map, Direction::Forward, &mut parts, request, &mut Pace::asking(&mut go_on));
    assert_eq!(states.expect("integers"), by_parts.expect("integers"));
    assert_eq!(whole, parts);
    for (z, end) in start.places().chunks_exact(4).zip(whole.places().chunks_exact(4)) {
        let mut alone: Vec<_> = z.iter().map(|&k| IntegerOnGrid::from_place(k, 44)).collect();
        (0..300).for_each(|_| model.forward(&mut alone));
        let alone: Vec<_> = alone.iter().map(|z| z.place().expect("on the grid")).collect();
        assert_eq!(alone, end);
    }
    // A point that leaves a small range between two parts has left it.
    let floats = GridPoints::nearest(grid(50, GridNumbers::Floats), &points(2, 50)).expect("small");
    let left = |pace: &mut Pace<'_>| {
        let mut here = floats.clone();
        let moved = grid_rollout(map, Direction::Forward, &mut here, request, pace);
        moved.expect_err("a range of 2").to_string()
    };
    assert_eq!(left(&mut Pace::unbroken()), left(&mut Pace::asking(&mut || true)));
}
