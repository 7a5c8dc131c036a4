//! Data in units that nobody chose for a network: fitted, undone, kept with the model.
#![cfg(feature = "files")]

use gyroceptron::flow::{Integrator, Pairs, Window, sample};
use gyroceptron::io::{
    Provenance, StoredModel, export_weights, model_text, parse_model, read_tensors, take_units,
};
use gyroceptron::layer::{CircleAction, TorusAction};
use gyroceptron::measure::{
    Coordinate, OneStep, WithDomain,
    certificate::{CertificateOptions, certify_map},
    trajectories::{distance, root_mean_square, rotation_error},
};
use gyroceptron::network::{
    GyroceptronShape, HenonShape, InitialWeights, Model, NetworkSpec, Rollout,
};
use gyroceptron::phase::{Direction, InUnits, Map, Units};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Scalar, constant};
use gyroceptron::system::{Hamiltonian, Oscillators, ParticleField, System};
use gyroceptron::train::{
    ActionFit, ActionTrial, Preparation, Reading, fit_rotation, fit_units, slow_time,
};

fn action() -> TorusAction {
    CircleAction::new([1, 0]).into()
}

/// Pairs of the oscillators, where the network would have them.
fn pairs(time: f64) -> Pairs {
    let window = Window { low: vec![-1.6; 4], high: vec![1.6; 4], samples: 600 };
    let points = sample(&[window], 2, &mut Stream::new(7, "points")).expect("points");
    Pairs::of_flow(&Oscillators { epsilon: 0.01 }, points, time).expect("a flow").0
}

/// z = c + S w of both ends.
fn in_units(pairs: &Pairs, units: &Units) -> Pairs {
    let of = |points: &[f64]| {
        let mut points = points.to_vec();
        units.to_data(&mut points);
        points
    };
    Pairs::new("pairs", pairs.dof(), of(pairs.input()), of(pairs.output())).expect("finite")
}

fn all_units(centre: [f64; 4], factors: [f64; 4]) -> Units {
    Units::new(centre.to_vec(), factors.to_vec()).expect("units")
}

fn model() -> Model {
    let shape = GyroceptronShape {
        circle_action: CircleAction::new([1, 0]),
        psi: vec![6; 3],
        near_identity: vec![6; 3],
    };
    shape.architecture(0.01).initialise(InitialWeights::Glorot, 0.7, 5).expect("valid")
}

#[test]
fn data_of_order_one_keeps_its_units() {
    for time in [0.05, 0.5, 5.0, std::f64::consts::TAU, 50.0] {
        assert_eq!(fit_units(&pairs(time), &action()), None, "{time}");
    }
    let system = ParticleField::two_modes(0.01);
    let window = Window {
        low: vec![-3.2, -0.6, -0.6, -1.2, -0.6, -0.1],
        high: vec![3.2, 0.6, 0.6, 1.2, 0.6, 1.1],
        samples: 300,
    };
    let points = sample(&[window], 3, &mut Stream::new(1, "points")).expect("points");
    let (pairs, _) = Pairs::of_flow(&system, points, 0.8).expect("a flow");
    assert_eq!(fit_units(&pairs, &CircleAction::new([0, 1, 2]).into()), None);
}

/// Of a hundred times the data, of ellipses in place of circles, of one that turns about another
/// point, of slow coordinates that are far away or much longer than wide: what is left is of
/// order one, and turns as the data did at first.
#[test]
fn units_are_found_again() {
    let plain = pairs(0.5);
    let left = |pairs: &Pairs| {
        let angle = fit_rotation(pairs, &action().circles()[0]);
        let size = root_mean_square(pairs.output());
        (rotation_error(&action(), &[angle], pairs).sqrt() / size, size)
    };
    let (share, size) = left(&plain);
    for (name, centre, factors) in [
        ("a hundred times", [0.0; 4], [100.0; 4]),
        ("a millionth", [0.0; 4], [1e-6; 4]),
        ("an ellipse", [0.0; 4], [30.0, 3.0, 0.3, 3.0]),
        ("another centre", [5.0, 0.0, -40.0, 0.0], [1.0; 4]),
        ("both", [2e4, 0.0, 3e-3, 0.0], [1e3, 1.0, 1e-3, 1.0]),
        ("far and long", [0.0, 700.0, 0.0, 0.0], [2.0, 400.0, 2.0, 0.01]),
    ] {
        let given = all_units(centre, factors);
        let data = in_units(&plain, &given);
        let found = fit_units(&data, &action()).expect(name);
        let back = data.to_network(name, &found).expect("finite");
        let (own_share, own_size) = left(&back);
        // A circle of the wrong centre or ratio leaves a share of order one.
        assert!(own_share < 2.5 * share, "{name}: {own_share} of {share}, {found:?}");
        assert!((0.4..2.5).contains(&(own_size / size)), "{name}: {own_size}, {found:?}");
        let products = [0, 1].map(|j| found.factors()[j] * found.factors()[2 + j]);
        assert!((products[0] / products[1] - 1.0).abs() < 1e-15, "{name}: {products:?}");
        // In the coordinates that it says.
        let mut z = data.input()[..4].to_vec();
        found.to_network(&mut z);
        assert!(distance(&z, &back.input()[..4]) == 0.0);
        found.to_data(&mut z);
        assert!(distance(&z, &data.input()[..4]) <= 1e-12 * root_mean_square(data.input()));
    }
    // Unless they are there, centres and ratios are not found.
    let doubled = fit_units(&in_units(&plain, &all_units([0.0; 4], [128.0; 4])), &action());
    assert_eq!(doubled, Some(all_units([0.0; 4], [128.0; 4])));
}

/// A centre is found from the rotation, however far it is and whatever the flow time; and none is
/// made up where pairs of one side hardly turn.
#[test]
fn centres_are_found_where_they_are() {
    for time in [0.5, 5.0] {
        let plain = pairs(time);
        for far in [40.0, 100.0, 300.0, 1e4] {
            let given = all_units([far, 0.0, -2.0 * far, 0.0], [1.0; 4]);
            let found = fit_units(&in_units(&plain, &given), &action()).expect("a centre");
            for k in [0, 2] {
                let off = (found.centre()[k] - given.centre()[k]).abs();
                assert!(off < 0.1, "{time}, {far}: {found:?}");
            }
            assert_eq!(found.factors(), [1.0; 4]);
        }
    }
    let window = Window { low: vec![0.2, -1.6, -1.6, -1.6], high: vec![1.6; 4], samples: 120 };
    for time in [12.55, std::f64::consts::TAU, 0.01] {
        for seed in 1..6 {
            let points = sample(std::slice::from_ref(&window), 2, &mut Stream::new(seed, "points"));
            let system = Oscillators { epsilon: 0.01 };
            let (pairs, _) =
                Pairs::of_flow(&system, points.expect("points"), time).expect("a flow");
            assert_eq!(fit_units(&pairs, &action()), None, "{time}, {seed}");
        }
    }
}

/// A column that never changes has no size.
#[test]
fn constant_columns_have_no_unit() {
    let plain = pairs(0.5);
    for constant in [vec![3], vec![1], vec![1, 3], vec![0, 2]] {
        let of = |points: &[f64]| -> Vec<f64> {
            let with = |(k, v): (usize, &f64)| if constant.contains(&(k % 4)) { 0.1 } else { *v };
            points.iter().enumerate().map(with).collect()
        };
        let pairs = Pairs::new("pairs", 2, of(plain.input()), of(plain.output())).expect("finite");
        if let Some(units) = fit_units(&pairs, &action()) {
            assert_eq!(units.factors(), [1.0; 4], "{constant:?}: {units:?}");
            assert!(units.centre().iter().all(|c| c.abs() < 0.2), "{constant:?}: {units:?}");
        }
    }
    let one = Pairs::new("one", 2, vec![1e9, 1.0, 2.0, 3.0], vec![1.0, 1.0, 2.0, -3.0]);
    let units = fit_units(&one.expect("finite"), &action());
    assert!(units.iter().all(|units| units.area().is_normal()), "{units:?}");
}

/// Units whose planes have different areas make no symplectic map: refused at the border.
#[test]
fn units_of_unequal_areas_are_refused() {
    for factors in [
        vec![1.0, 1.0, 1.0, 2.0],
        vec![1.0, 1.0, 1.0, 1.0 + 1e-13],
        vec![0.0; 4],
        vec![-1.0; 4],
        vec![f64::NAN; 4],
        vec![1e200; 4],
        vec![1.0; 3],
    ] {
        let said = Units::new(vec![0.0; factors.len()], factors.clone());
        assert!(said.is_err(), "{factors:?}");
    }
    assert!(Units::new(vec![0.0, f64::INFINITY], vec![1.0; 2]).is_err());
    assert!(Units::new(Vec::new(), Vec::new()).is_err());
    let said = Units::new(vec![0.0; 4], vec![2.0, 1.0, 3.0, 5.0]).expect_err("unequal");
    assert!(said.to_string().contains("factors of q2 and p2"), "{said}");
}

/// S∘P∘S⁻¹ with another area in the second plane than in the first.
struct Unequal<'a> {
    model: &'a Model,
    wrong: f64,
}

impl<S: Scalar> Map<S> for Unequal<'_>
where
    Model: Map<S>,
{
    fn dof(&self) -> usize {
        2
    }
    fn forward(&self, z: &mut [S]) {
        z[1] /= constant(1.0 + self.wrong);
        self.model.forward(z);
        z[1] *= constant(1.0 + self.wrong);
    }
    fn inverse(&self, z: &mut [S]) {
        z[1] /= constant(1.0 + self.wrong);
        self.model.inverse(z);
        z[1] *= constant(1.0 + self.wrong);
    }
}

#[test]
fn a_network_in_units_is_symplectic() {
    // A single layer: rounding scales of a whole network as one step hide what is to be seen.
    let shape = HenonShape::uniform(2, 1, 6);
    let model = shape.architecture(1.0).initialise(InitialWeights::Glorot, 0.0, 5).expect("valid");
    let options = CertificateOptions { samples: 40, ..Default::default() };
    let units = all_units([0.3, 700.0, 0.0, -2.0], [30.0, 400.0, 1.0 / 3.0, 0.025]);
    let map = InUnits { map: &model, units: &units };
    let between = |c: f64, s: f64| Coordinate::Between(c - s, c + s);
    let domain = (0..4).map(|k| between(units.centre()[k], units.factors()[k])).collect();
    let map = WithDomain::new(OneStep(map), domain).expect("a domain");
    let certificate = certify_map(&map, options);
    assert!(certificate.holds(), "{certificate}");
    for wrong in [1e-9, 1e-12] {
        let broken = certify_map(&OneStep(Unequal { model: &model, wrong }), options);
        assert!(!broken.holds(), "{wrong}: {broken}");
        let right = certify_map(&OneStep(Unequal { model: &model, wrong: 0.0 }), options);
        assert!(right.holds(), "{right}");
    }
}

fn stored(units: Option<Units>) -> StoredModel {
    StoredModel { model: model(), units, section: None, provenance: Provenance::of_scene("test") }
}

#[test]
fn a_model_acts_in_the_units_of_its_data() {
    let (plain, scaled) = (stored(None), stored(Some(all_units([0.0; 4], [64.0; 4]))));
    let start = [0.3, -0.2, 0.9, 0.1, 1.0, 0.5, -0.5, 0.25];
    let times = |z: &[f64]| z.iter().map(|z| 64.0 * z).collect::<Vec<f64>>();
    let request = Rollout { steps: 30, every: 10 };
    let states = plain.rollout(&start, request).expect("finite");
    assert_eq!(scaled.rollout(&times(&start), request).expect("finite"), times(&states));
    let (own, of_data) = (plain.invariant().expect("one"), scaled.invariant().expect("one"));
    assert_eq!(of_data(&times(&start[..4])), 64.0 * 64.0 * own(&start[..4]));
    let member = scaled.with_epsilon_and_time(0.02, 2.0).expect("a member");
    assert_eq!(member.units, scaled.units);
    assert_eq!(member.model.architecture().epsilon, 0.02);
    // One step and back, and its derivatives against differences.
    let units = all_units([0.25, 3.0, 0.0, 0.0], [30.0, 400.0, 1.0 / 3.0, 0.025]);
    let long = stored(Some(units.clone()));
    let mut z = [10.0, 200.0, 0.1, -0.01];
    let jacobian = long.jacobians(&z).expect("finite");
    let moved = |k: usize, h: f64| {
        let mut z = z;
        z[k] += h;
        long.map_points(Direction::Forward, &mut z).expect("finite");
        z
    };
    for k in 0..4 {
        let h = 1e-5 * units.factors()[k];
        let (after, before) = (moved(k, h), moved(k, -h));
        for i in 0..4 {
            let slope = (after[i] - before[i]) / (2.0 * h);
            let scale = units.factors()[i] / units.factors()[k];
            assert!((slope - jacobian[4 * i + k]).abs() < 1e-8 * scale, "{i}, {k}");
        }
    }
    let start_of_z = z;
    long.map_points(Direction::Forward, &mut z).expect("finite");
    long.map_points(Direction::Inverse, &mut z).expect("finite");
    for k in 0..4 {
        assert!((z[k] - start_of_z[k]).abs() < 1e-12 * units.factors()[k]);
    }
    assert!(long.rollout(&[f64::NAN, 0.0, 0.0, 0.0], request).is_err());
    // Of units that round, the first states are the points that were given.
    let other = stored(Some(all_units([0.1, 0.2, 0.3, 0.4], [3.0, 7.0, 7.0, 3.0])));
    assert_eq!(other.rollout(&start, request).expect("finite")[..8], start);
}

#[test]
fn files_keep_units() {
    let units = all_units([0.25, 3.0, 0.0, 0.0], [30.0, 400.0, 1.0 / 3.0, 0.025]);
    let with = stored(Some(units.clone()));
    let text = model_text(&with).expect("text");
    let back = parse_model("m.json", text.as_bytes()).expect("a model");
    assert_eq!(back.units.as_ref(), Some(&units));
    assert!(text.contains("\"version\": 3"));
    let without = model_text(&stored(None)).expect("text");
    assert!(without.contains("\"version\": 3") && !without.contains("units"));
    for (from, to, word) in [
        ("30.0", "31.0", "digest"),
        ("0.25", "0.5", "digest"),
        ("\"centre\"", "\"center\"", "center"),
        ("\"version\": 3", "\"version\": 6", "newer"),
    ] {
        assert!(text.contains(from));
        let said = parse_model("m.json", text.replacen(from, to, 1).as_bytes()).expect_err(word);
        assert!(said.to_string().contains(word), "{said}");
    }

    let folder = tempfile::tempdir().expect("a folder");
    for name in ["w.npz", "w.safetensors"] {
        let file = folder.path().join(name);
        export_weights(&file, &with.model, with.units.as_ref()).expect("written");
        let mut tensors = read_tensors(&file).expect("tensors");
        let taken = take_units(name, &mut tensors, 2).expect("units");
        assert_eq!(taken.as_ref(), Some(&units));
        assert_eq!(take_units(name, &mut tensors, 2).expect("none"), None);
        let mut tensors = read_tensors(&file).expect("tensors");
        assert!(take_units(name, &mut tensors.clone(), 3).is_err());
        // Rounded to single precision, they are units again; of one that is wrong, none.
        let mut single = tensors.clone();
        let factors = single.get_mut("units.factors").expect("a tensor");
        factors.values.iter_mut().for_each(|v| *v = f64::from(*v as f32));
        let mut wrong = single.clone();
        assert!(take_units(name, &mut wrong, 2).is_err(), "products that are not equal");
        single.get_mut("units.factors").expect("a tensor").single_precision = true;
        let mut wrong = single.clone();
        let taken = take_units(name, &mut single, 2).expect("units").expect("units");
        for (a, b) in taken.factors().iter().zip(units.factors()) {
            assert!((a / b - 1.0).abs() < 3e-7);
        }
        wrong.get_mut("units.factors").expect("a tensor").values[3] *= 1.0 + 1e-5;
        assert!(take_units(name, &mut wrong, 2).is_err());
        tensors.remove("units.centre");
        let said = take_units(name, &mut tensors, 2).expect_err("one is missing").to_string();
        assert!(said.contains("units.centre"), "{said}");
    }
}

/// Planes that turn by angles of their own, in units of their own, about points of their own, with some
/// slow motion beside.
fn turning(angles: &[f64], beside: f64, seed: u64) -> Pairs {
    let dof = angles.len();
    let mut stream = Stream::new(seed, "turning");
    let (mut input, mut output) = (Vec::new(), Vec::new());
    let factors: Vec<f64> = (0..2 * dof).map(|k| 10.0_f64.powi((k as i32 * 5) % 7 - 3)).collect();
    for _ in 0..300 {
        let w: Vec<f64> = (0..2 * dof).map(|_| stream.normal()).collect();
        let mut turned = w.clone();
        for (j, angle) in angles.iter().enumerate() {
            let (s, c) = angle.sin_cos();
            turned[j] = c * w[j] + s * w[dof + j] + beside * w[(j + 1) % dof].powi(2);
            turned[dof + j] = c * w[dof + j] - s * w[j] + beside * w[j].sin();
        }
        let data = |w: &[f64]| -> Vec<f64> {
            w.iter().zip(&factors).map(|(v, factor)| factor * (v + 2.0)).collect()
        };
        input.extend(data(&w));
        output.extend(data(&turned));
    }
    Pairs::new("turning", dof, input, output).expect("whole")
}

#[test]
fn a_circle_action_is_found() {
    for (weights, theta) in [
        (vec![1, 0], 0.7),
        (vec![0, 1], 2.5),
        (vec![1, -2], 0.9),
        (vec![1, 2], 0.8),
        (vec![0, 1, 2], 0.6),
        (vec![1, 0, -1], 0.4),
        (vec![1, 1], 0.6),
        (vec![0, 0, 1, 2], 0.5),
        (vec![1], 0.3),
    ] {
        let angles: Vec<f64> = weights.iter().map(|m| f64::from(*m) * theta).collect();
        for (seed, beside) in [(1, 0.0), (2, 0.02)] {
            let fit = ActionFit::fit(&turning(&angles, beside, seed)).expect("a linear map");
            let found = fit.action().weights();
            let turned: Vec<i32> = weights.iter().map(|m| -m).collect();
            assert!(found == weights || found == turned, "{weights:?}: {}", fit.describe());
            assert!(fit.is_sure(), "{weights:?}: {}", fit.describe());
            for (found, angle) in fit.angles.iter().zip(&angles) {
                let chord = 2.0 * (0.5 * (found - angle)).sin().abs();
                assert!(chord < if beside > 0.0 { 0.05 } else { 1e-6 }, "{}", fit.describe());
            }
        }
    }
    // A plane that turns by 0.3 where the action rests: the chord of that angle, over two planes.
    let fit = ActionFit::fit(&turning(&[0.7, 0.3], 0.0, 1)).expect("a linear map");
    let of_first = fit.candidates.iter().find(|(action, _)| action.weights() == [1, 0]);
    let (_, distance) = of_first.expect("tried");
    assert!((distance - 2.0 * 0.15_f64.sin() / 2.0_f64.sqrt()).abs() < 1e-6, "{distance}");
    // Several turn these planes about alike, and nobody can tell which is meant.
    let third = std::f64::consts::TAU / 3.0;
    for angles in [vec![third, -third], vec![0.8, 1.294], vec![1.1, 1.65], vec![0.0, 0.0]] {
        let fit = ActionFit::fit(&turning(&angles, 0.0, 3)).expect("a linear map");
        assert!(!fit.is_sure(), "{angles:?}: {}", fit.describe());
    }
    // Far from the origin, where the columns differ by little.
    let near = turning(&[0.9, 1.8], 0.0, 1);
    let moved = |values: &[f64]| values.iter().map(|v| v + 1e9).collect::<Vec<_>>();
    let far = Pairs::new("far", 2, moved(near.input()), moved(near.output())).expect("whole");
    let [near, far] = [&near, &far].map(|pairs| ActionFit::fit(pairs).expect("a linear map"));
    assert!(far.angles.iter().zip(&near.angles).all(|(a, b)| (a - b).abs() < 1e-2), "{far:?}");
    let few = turning(&[0.3, 0.0], 0.0, 1).thinned(4);
    assert!(ActionFit::fit(&few).expect_err("too few").to_string().contains("4 pairs"));
    let flat = Pairs::new("flat", 1, vec![1.0, 0.0, 2.0, 0.0, 3.0, 0.0, 4.0, 0.0], vec![1.0; 8]);
    assert!(ActionFit::fit(&flat.expect("whole")).is_err());
    assert!(ActionFit::fit(&turning(&[0.1; 6], 0.0, 1)).is_err());
}

/// The error of a trial is that of the worst plane, each component as a share of how far it moves.
#[test]
fn a_trial_judges_by_the_worst_plane() {
    let pairs = pairs(0.5);
    let network = NetworkSpec::named("normal-form").expect("a name");
    let architecture = network.architecture(&action(), 0.01, 0.5).expect("an architecture");
    let weights = InitialWeights::Normal { scale: 0.15 };
    let model = architecture.initialise(weights, 0.3, 1).expect("weights");
    let (mut errors, mut moves) = ([0.0; 4], [0.0; 4]);
    for (z, w) in pairs.input().chunks_exact(4).zip(pairs.output().chunks_exact(4)) {
        let moved = model.rollout(z, Rollout { steps: 1, every: 1 }).expect("finite");
        for c in 0..4 {
            errors[c] += (moved[4 + c] - w[c]).powi(2);
            moves[c] += (w[c] - z[c]).powi(2);
        }
    }
    let plane = |j: usize| (0.5 * (errors[j] / moves[j] + errors[j + 2] / moves[j + 2])).sqrt();
    let [first, second] = [plane(0), plane(1)];
    assert!((first - second).abs() > 0.1 * first, "the planes have to differ");
    let expected = if first > second { first } else { second };
    let found = ActionTrial::error(model.composition(), &pairs).expect("finite");
    assert!((found / expected - 1.0).abs() < 1e-12, "{found} for {expected}");
}

/// Which action short trainings choose, by their errors and by what the nearest rotation says.
#[test]
fn a_trial_chooses_what_errs_least() {
    let torus = |text: &str| -> TorusAction {
        let circle = |text: &str| {
            CircleAction::new(
                text.split(',').map(|m| m.parse().expect("a weight")).collect::<Vec<_>>(),
            )
        };
        TorusAction::new(text.split('/').map(circle).collect::<Vec<_>>()).expect("circles")
    };
    let fit = |angles: &[f64]| ActionFit::fit(&turning(angles, 0.0, 3)).expect("a linear map");
    let (sure, unsure) = (fit(&[0.4, 0.8]), fit(&[0.8, 1.294]));
    assert!(sure.is_sure() && sure.action().weights() == [1, 2] && !unsure.is_sure());
    let all = [torus("1,0"), torus("0,1"), torus("1,2")];
    let found = ActionTrial::candidates(&sure, true);
    assert!(all.iter().all(|action| found.contains(action)), "{found:?}");
    assert_eq!(found.last(), Some(&torus("1,0/0,1")));
    assert!(!ActionTrial::candidates(&sure, false).contains(&torus("1,0/0,1")));
    assert_eq!(ActionTrial::candidates(&fit(&[0.4]), true), [torus("1")]);
    let chosen = |by_rotation: &ActionFit, errors: &[(&str, f64)]| {
        let errors = errors.iter().map(|(action, error)| (torus(action), *error)).collect();
        let trial = ActionTrial { by_rotation: by_rotation.clone(), errors };
        let chosen = trial.chosen().map(|action| action.to_string());
        let said = trial.describe();
        if let Some(chosen) = &chosen {
            assert!(said.starts_with(&format!("circle action {chosen}")), "{said}");
        }
        assert!(!said.contains("NaN") && !said.contains("inf"), "{said}");
        chosen
    };
    // What is sure and about as good is kept; what errs by far less is taken.
    let of = |third: f64| [("1,0", 0.010), ("0,1", 0.3), ("1,2", third)];
    assert_eq!(chosen(&sure, &of(0.029)).as_deref(), Some("1,2"));
    assert_eq!(chosen(&sure, &of(0.031)).as_deref(), Some("1,0"));
    // Without a sure one nothing is taken of two that are about as good.
    assert_eq!(chosen(&unsure, &of(0.019)), None);
    assert_eq!(chosen(&unsure, &of(0.021)).as_deref(), Some("1,0"));
    // What errs by half of a motion is not left out beside what errs by less.
    assert_eq!(chosen(&unsure, &[("1,0", 0.45), ("0,1", 0.55)]), None);
    // Errors of rounding say nothing.
    assert_eq!(chosen(&sure, &[("1,0", 1e-14), ("1,2", 1e-12)]).as_deref(), Some("1,2"));
    // More circles can do what one of them can.
    assert_eq!(chosen(&unsure, &[("1,0", 0.019), ("1,0/0,1", 0.010)]).as_deref(), Some("1,0"));
    assert_eq!(chosen(&unsure, &[("1,0", 0.021), ("1,0/0,1", 0.010)]).as_deref(), Some("1,0/0,1"));
    // Nothing that is learnt leaves what the rotation says, and so does what is not finite.
    for error in [0.6, f64::NAN, f64::INFINITY] {
        let little = [("1,0", error), ("0,1", error)];
        assert_eq!(chosen(&sure, &little).as_deref(), Some("1,2"));
        assert_eq!(chosen(&unsure, &little), None);
    }
    assert_eq!(chosen(&sure, &[("1,0", f64::NAN), ("0,1", 0.3)]).as_deref(), Some("0,1"));
    // The nearest rotation alone does not see whole turns.
    assert_eq!(chosen(&sure, &[]), None);
    assert_eq!(chosen(&unsure, &[]), None);
}

/// How near an action is: the root mean square of the chords between measured angles and those of its weights, at the
/// best angle, by trying all of them.
#[test]
fn the_distance_of_an_action_is_that_of_its_angles() {
    let angles = [0.4, 0.9];
    let fit = ActionFit::fit(&turning(&angles, 0.0, 5)).expect("a linear map");
    for weights in [[1, 2], [1, 1], [1, 0], [2, 3]] {
        let square = |theta: f64| -> f64 {
            let chord = |k: usize| 2.0 * (0.5 * (f64::from(weights[k]) * theta - angles[k])).sin();
            0.5 * (chord(0).powi(2) + chord(1).powi(2))
        };
        let least = (0..200_000)
            .map(|k| square(f64::from(k) * 1e-5 * std::f64::consts::PI))
            .fold(f64::INFINITY, |least, one| if one < least { one } else { least });
        let action = CircleAction::new(weights);
        let (_, found) = fit.candidates.iter().find(|(one, _)| *one == action).expect("one of all");
        assert!((found / least.sqrt() - 1.0).abs() < 1e-4, "{weights:?}: {found} {}", least.sqrt());
    }
}

/// Of the flow maps of two systems, at ten flow times, ε and seeds each.
#[test]
fn circle_actions_of_flow_maps_are_found() {
    let (mut right, mut sure_and_wrong) = ([0; 2], 0);
    for seed in 0..10 {
        let mut stream = Stream::new(seed, "tries");
        let epsilon = 10.0_f64.powf(stream.uniform(-3.0, -1.3));
        let time = stream.uniform(0.3, 8.0);
        let window = |dof: usize| Window {
            low: vec![-1.0; 2 * dof],
            high: vec![1.0; 2 * dof],
            samples: 200,
        };
        let points = |dof: usize, stream: &mut Stream| {
            sample(&[window(dof)], dof, stream).expect("a window")
        };
        let systems = [
            System::Oscillators(Oscillators { epsilon }),
            System::ParticleField(ParticleField::two_modes(epsilon)),
        ];
        let pairs = systems.map(|system| {
            let points = points(system.dof(), &mut stream);
            Pairs::of_integrator(&system, points, time, Integrator::Aba864, 100)
        });
        for (k, (pairs, weights)) in pairs.into_iter().zip([&[1, 0][..], &[0, 1, 2]]).enumerate() {
            let fit = ActionFit::fit(&pairs.expect("finite").0).expect("a linear map");
            let is_right = fit.action().weights() == weights;
            right[k] += usize::from(is_right);
            sure_and_wrong += usize::from(fit.is_sure() && !is_right);
        }
    }
    assert!(right.iter().all(|right| *right >= 9), "{right:?}");
    assert_eq!(sure_and_wrong, 0);
}

/// What a rotation leaves of pairs, over their size: the slow time. Over ε it is the flow time of a
/// network, where none is known.
#[test]
fn a_preparation_tells_the_angle_and_the_slow_time() {
    let (pairs, action) = (pairs(0.5), action());
    let angle = fit_rotation(&pairs, &action.circles()[0]);
    let (sine, cosine) = libm::sincos(angle);
    let mut squares = [0.0; 2];
    for (z, w) in pairs.input().chunks_exact(4).zip(pairs.output().chunks_exact(4)) {
        let turned = [cosine * z[0] + sine * z[2], z[1], cosine * z[2] - sine * z[0], z[3]];
        for c in 0..4 {
            squares[0] += (turned[c] - w[c]).powi(2);
            squares[1] += w[c] * w[c];
        }
    }
    let slow = (squares[0] / squares[1]).sqrt();
    let close = |found: f64, expected: f64| {
        assert!((found - expected).abs() < 1e-11 * expected, "{found} for {expected}");
    };
    close(slow_time(&pairs, &action, &[angle]), slow);
    let rest = Pairs::new("rest", 2, vec![0.0; 8], vec![0.0; 8]).expect("whole");
    assert_eq!(slow_time(&rest, &action, &[0.0]), 1.0);
    let preparation = Preparation {
        place: "pairs",
        action: &action,
        epsilon: -0.02,
        flow_time: None,
        of_order_one: false,
        theta: None,
        units: false,
        reversors: &[],
        validation: 0.1,
        seed: 3,
    };
    let found = preparation.prepare(pairs.clone()).expect("pairs");
    close(found.flow_time, slow / 0.02);
    assert_eq!((found.nearest, found.angles), (vec![angle], vec![angle]));
    assert_eq!(found.held_out.map(|pairs| pairs.len()), Some(60));
    let given = Preparation { theta: Some(0.3), flow_time: Some(0.5), ..preparation };
    let found = given.prepare(pairs.clone()).expect("pairs");
    assert_eq!((found.nearest, found.angles), (vec![angle], vec![0.3]));
    assert_eq!(found.flow_time, 0.5);
    let of_order_one = Preparation { of_order_one: true, ..preparation };
    assert_eq!(of_order_one.prepare(pairs.clone()).expect("pairs").flow_time, 1.0);

    // Columns q₁ p₁ q₂ p₂ are recognised by what rotations leave of both readings.
    let share = |pairs: &Pairs| {
        let pairs = match fit_units(pairs, &action) {
            Some(units) => pairs.to_network("pairs", &units).expect("finite"),
            None => pairs.clone(),
        };
        let angle = fit_rotation(&pairs, &action.circles()[0]);
        let size: f64 = pairs.output().iter().map(|v| v * v).sum();
        rotation_error(&action, &[angle], &pairs) * pairs.output().len() as f64 / size
    };
    let interleaved = pairs.with_columns(&[0, 2, 1, 3]);
    let found = Reading::better(&interleaved, &action).expect("another order");
    assert_eq!((&found.columns[..], &found.weights[..]), ("q1 p1 q2 p2", &[1, 0][..]));
    close(found.error, share(&pairs));
    close(found.as_given, share(&interleaved));
    // Of a few pairs it would be chance.
    assert!(Reading::better(&interleaved.thinned(20), &action).is_some());
    assert!(Reading::better(&interleaved.thinned(19), &action).is_none());
    let said = found.describe();
    for error in [found.error, found.as_given] {
        assert!(said.contains(&format!("{:.1} %", 100.0 * error.sqrt())), "{said}");
    }
}
