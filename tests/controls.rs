//! Networks whose parameters are polynomials of controls: their maps, their fit, and their files.

use gyroceptron::Error;
use gyroceptron::flow::{Pairs, PolynomialFamily, Trajectories};
use gyroceptron::io::{
    Provenance, StoredModel, assemble_architecture, export_weights, load_model, parse_model,
    read_architecture, read_pairs, read_tensors, save_model, write_pairs,
};
use gyroceptron::layer::CircleAction;
use gyroceptron::measure::certificate::{CertificateOptions, certify};
use gyroceptron::measure::orbits::{AtControls, PeriodicOrbit, rotation_numbers};
use gyroceptron::network::{
    Architecture, Block, ControlRange, Controls, GyroceptronShape, HenonShape, InitialWeights,
    Layers, Model, NetworkSpec, Part, Rollout,
};
use gyroceptron::phase::{AreaDensity, Change, Map, Section, Units};
use gyroceptron::random::Stream;
use gyroceptron::scalar::max_or_nan;
use gyroceptron::train::{
    ControlOptions, FamilyPairs, Fit, FreshTwists, LevenbergMarquardtOptions, Loss, Objective,
    Optimiser, RampStage, TrainingOptions,
};

fn range(name: &str, low: f64, high: f64) -> ControlRange {
    ControlRange { name: name.into(), low, high }
}

fn two() -> Controls {
    Controls { ranges: vec![range("a", -1.0, 3.0), range("b", 0.0, 1.0)], degree: 2 }
}

/// Random numbers for all parameters, those of the products of controls too.
fn drawn(architecture: &Architecture, seed: u64) -> Model {
    let model =
        architecture.initialise(InitialWeights::Glorot, 0.7, seed).expect("an architecture");
    let (nominal, mut stream) = (architecture.clone().with_controls(None), Stream::new(seed, "λ"));
    let mut parameters = model.parameters().to_vec();
    for parameter in &mut parameters[nominal.parameter_count()..] {
        *parameter = stream.uniform(-0.03, 0.03);
    }
    model.with_parameters(parameters).expect("as many")
}

fn models() -> Vec<Model> {
    let gyroceptron = GyroceptronShape {
        circle_action: CircleAction::new([1]),
        psi: vec![3; 2],
        near_identity: vec![3; 2],
    };
    let jolts = Architecture::new(1)
        .on_circle(CircleAction::new([1]))
        .with(Block::new(Part::Chart, Layers::TurnedKick(vec![1; 3])).of_polynomials(4).in_box(3.0))
        .with(Block::new(Part::SlowMap, Layers::Twist(vec![1])).of_polynomials(3).in_box(3.0));
    let all = [
        gyroceptron.architecture(0.1),
        jolts,
        HenonShape { dof: 1, widths: vec![3, 2] }.architecture(0.1),
    ];
    all.iter()
        .map(|architecture| drawn(&architecture.clone().with_controls(Some(two())), 3))
        .collect()
}

/// The products of two controls to the second degree, in their order; and the names of tensors.
#[test]
fn parameters_are_polynomials_of_the_controls() {
    let controls = two();
    assert_eq!((controls.terms(), controls.nominal()), (6, vec![1.0, 0.5]));
    let products = controls.products(&[2.0, 0.25]);
    assert_eq!(products, [1.0, 0.5, -0.5, 0.25, -0.25, 0.25]);
    for model in models() {
        let architecture = model.architecture();
        let names: Vec<String> = architecture.tensors().into_iter().map(|(name, _)| name).collect();
        let count = names.len() / 6;
        for (number, prefix) in ["", "a:", "b:", "a^2:", "a*b:", "b^2:"].iter().enumerate() {
            assert_eq!(names[number * count], format!("{prefix}{}", names[0]));
        }
        let size = architecture.clone().with_controls(None).parameter_count();
        assert_eq!(model.parameters().len(), 6 * size);
        let at = model.at_controls(&[2.0, 0.25]).expect("two values");
        assert_eq!(at.architecture().controls, None);
        for (k, found) in at.parameters().iter().enumerate() {
            let term =
                |(number, product): (usize, &f64)| product * model.parameters()[number * size + k];
            let wanted: f64 = products.iter().enumerate().map(term).sum();
            assert!((found - wanted).abs() <= 4.0 * f64::EPSILON, "{found} for {wanted}");
        }
        // At the middle of the ranges it is what it is without a word of controls.
        let (mut nominal, mut plain) = (vec![0.3, -0.2], vec![0.3, -0.2]);
        model.at_controls(&[1.0, 0.5]).expect("two values").forward(&mut nominal);
        model.forward(&mut plain);
        assert_eq!(nominal, plain);
        assert!(model.at_controls(&[1.0]).is_err());
    }
}

/// Whatever the controls are, within their range and, of networks without a box, far beyond it.
#[test]
fn the_laws_hold_at_all_controls() {
    let options = CertificateOptions { samples: 20, ..Default::default() };
    for model in models() {
        let far = if model.architecture().has_polynomials() { [2.0, 0.25] } else { [9.0, -4.0] };
        for values in [[1.0, 0.5], [-1.0, 1.0], [3.0, 0.0], far] {
            certify(&model.at_controls(&values).expect("two values"), options).assert_holds();
        }
    }
}

fn family(seed: u64) -> Pairs {
    let mut stream = Stream::new(seed, "pairs");
    let (mut input, mut output, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for (a, b) in [(-1.0, 0.0), (3.0, 1.0), (0.0, 0.75)] {
        for _ in 0..13 {
            let z = [stream.uniform(-0.8, 0.8), stream.uniform(-0.8, 0.8)];
            input.extend(z);
            output.extend([z[0] + 0.3 * z[1] + 0.05 * a, z[1] - 0.2 * b * z[0]]);
            values.extend([a, b]);
        }
    }
    let ones = vec![1.0; input.len() / 2];
    let pairs = Pairs::new("pairs", 1, input, output).expect("finite");
    pairs.under_controls(&ones, &ones, &values).expect("values")
}

fn close(a: f64, b: f64, tolerance: f64, what: &str) {
    let error = (a - b).abs() / (1.0 + b.abs());
    assert!(error <= tolerance, "{what}: {a:e} for {b:e}");
}

/// The map of some pairs, whose ε is 1 where a network has an ε.
fn member(model: &Model, values: &[f64]) -> Model {
    let at = model.at_controls(values).expect("two values");
    if at.architecture().has_circle() { at.with_epsilon(1.0) } else { at }
}

/// Against central differences of the definition, Σ over the maps.
#[test]
fn derivatives_of_the_loss_are_those_of_differences() {
    let pairs = family(1);
    let objective = Objective::new(&Loss::MeanSquaredError, &pairs).expect("weights");
    let by_definition = |model: &Model| -> f64 {
        let (mut sum, mut row) = (0.0, 0);
        for condition in pairs.conditions() {
            let at = member(model, &condition.controls);
            for _ in 0..condition.pairs {
                let mut z = pairs.input()[2 * row..][..2].to_vec();
                at.forward(&mut z);
                for (found, wanted) in z.iter().zip(&pairs.output()[2 * row..]) {
                    sum += (found - wanted) * (found - wanted);
                }
                row += 1;
            }
        }
        sum / (2 * row) as f64
    };
    for model in models() {
        let weights = model.parameters().to_vec();
        let mut gradient = vec![0.0; weights.len()];
        let loss = objective.value_and_gradient(model.composition(), &mut gradient);
        close(loss, by_definition(&model), 1e-13, "loss");
        let equations = objective.normal_equations(model.composition());
        close(equations.loss, loss, 1e-13, "loss of the equations");
        let diagonal = objective.curvature_diagonal(model.composition());
        let h = 1e-5;
        let at = |index: usize, by: f64| {
            let mut weights = weights.clone();
            weights[index] += by;
            model.with_parameters(weights).expect("finite")
        };
        for index in 0..weights.len() {
            let slope = (by_definition(&at(index, h)) - by_definition(&at(index, -h))) / (2.0 * h);
            close(gradient[index], slope, 1e-8, &format!("gradient {index}"));
            close(equations.gradient[index], gradient[index], 1e-12, "both gradients");
            let entry = equations.matrix[(index, index)];
            close(entry, diagonal[index], 1e-12, &format!("diagonal {index}"));
        }
        // 2/N Σ ∂r_i ∂r_j of two parameters far apart, by differences of the maps.
        let moved = |index: usize, by: f64| -> Vec<f64> {
            let (model, mut out, mut row) = (at(index, by), Vec::new(), 0);
            for condition in pairs.conditions() {
                let at = member(&model, &condition.controls);
                for _ in 0..condition.pairs {
                    let mut z = pairs.input()[2 * row..][..2].to_vec();
                    at.forward(&mut z);
                    out.extend(z);
                    row += 1;
                }
            }
            out
        };
        let slopes = |index: usize| -> Vec<f64> {
            let both = moved(index, h).into_iter().zip(moved(index, -h));
            both.map(|(a, b)| (a - b) / (2.0 * h)).collect()
        };
        let last = weights.len() - 1;
        for (row, column) in [(last, 0), (last / 2, 2), (last, last / 3)] {
            let (a, b) = (slopes(row), slopes(column));
            let sum: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
            let wanted = 2.0 * sum / a.len() as f64;
            close(equations.matrix[(row, column)], wanted, 1e-8, &format!("{row}, {column}"));
        }
    }
}

/// Hénon's quadratic map, turned by an angle and kicked by a strength that depend on two controls: exact and
/// symplectic.
fn henon([a, b]: [f64; 2], z: &mut [f64]) {
    let (sin, cos) = (0.7 + 0.05 * a + 0.01 * a * a).sin_cos();
    let p = z[1] - (0.2 + 0.1 * b) * z[0] * z[0];
    (z[0], z[1]) = (cos * z[0] + sin * p, -sin * z[0] + cos * p);
}

fn pairs_of_henon(maps: &[[f64; 2]], count: usize, seed: u64) -> (Pairs, Vec<f64>) {
    let mut stream = Stream::new(seed, "points");
    let (mut input, mut output, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for map in maps {
        for _ in 0..count {
            let mut z = [stream.uniform(-0.4, 0.4), stream.uniform(-0.4, 0.4)];
            input.extend(z);
            henon(*map, &mut z);
            output.extend(z);
            values.extend(map);
        }
    }
    (Pairs::new("pairs", 1, input, output).expect("finite"), values)
}

/// Jolts of third degree and a turn, of which Hénon's map is one.
fn jolts() -> NetworkSpec {
    let block = Block::new(Part::NearIdentity, Layers::TurnedKick(vec![1; 2]));
    NetworkSpec::of_blocks(vec![block.of_polynomials(3)])
}

fn fit() -> Fit {
    let optimiser = Optimiser::LevenbergMarquardt(LevenbergMarquardtOptions::default());
    Fit {
        action: Some(CircleAction::new([1]).into()),
        network: Some(jolts()),
        epsilon: Some(1.0),
        training: TrainingOptions { iterations: 60, optimiser, ..TrainingOptions::default() },
        controls: ControlOptions { names: vec!["a".into(), "b".into()], degree: Some(2) },
        units: false,
        ..Fit::default()
    }
}

/// From a grid of controls to values between them, where the same network without controls knows one map only.
#[test]
fn a_fit_learns_what_the_controls_do() {
    let grid: Vec<[f64; 2]> =
        (0..9).map(|k| [f64::from(k % 3) - 1.0, f64::from(k / 3) - 1.0]).collect();
    let (pairs, values) = pairs_of_henon(&grid, 60, 5);
    let data = FamilyPairs::new(pairs, None, None, Some(&values)).expect("values");
    let fitted = fit().run(data).expect("trains");
    let model = fitted.model();
    let controls = model.architecture().controls.clone().expect("controls");
    assert_eq!(controls.ranges, [range("a", -1.0, 1.0), range("b", -1.0, 1.0)]);
    let error = |at: [f64; 2], of: &dyn Map<f64>| {
        let (pairs, _) = pairs_of_henon(&[at], 50, 6);
        let mut worst = 0.0;
        for (z, w) in pairs.input().chunks_exact(2).zip(pairs.output().chunks_exact(2)) {
            let mut z = z.to_vec();
            of.forward(&mut z);
            worst = max_or_nan(worst, (z[0] - w[0]).hypot(z[1] - w[1]));
        }
        worst
    };
    for at in [[0.5, -0.5], [-0.7, 0.3], [0.1, 0.9]] {
        let (found, nominal) =
            (error(at, &model.at_controls(&at).expect("two values")), error(at, model));
        assert!(found < 2e-4 && nominal > 30.0 * found, "{at:?}: {found:e}, without {nominal:e}");
    }
}

/// f′ from values at −2h, −h, h and 2h, to fourth order.
fn slope(values: impl Fn(f64) -> f64, h: f64) -> f64 {
    (8.0 * (values(h) - values(-h)) - (values(2.0 * h) - values(-2.0 * h))) / (12.0 * h)
}

/// A model of the data with units and a section whose density depends on both controls.
fn stored(model: &Model) -> StoredModel {
    let density =
        AreaDensity::of_function(|x, y| 1.0 + 0.2 * x + 0.1 * y * y, [-2.0; 2], [2.0; 2], 1.3);
    let changes: [Change<'_>; 2] = [(&|x, y| 0.05 * x * y, 2.0), (&|x, _| 0.03 + 0.02 * x, 0.5)];
    let density = density.and_then(|density| density.with_changes(&changes)).expect("positive");
    let nominal = model.composition().controls().expect("controls").nominal();
    let section = Section::of_controls(vec![Some(density)], &nominal).expect("two values");
    StoredModel {
        model: model.clone(),
        units: Some(Units::new(vec![0.1, -0.05], vec![0.5, 2.0]).expect("units")),
        section: Some(section),
        provenance: Provenance::of_scene("test"),
    }
}

/// Exact derivatives by duals against differences, of the network and in coordinates of the data, whose chart depends
/// on the controls too.
#[test]
fn derivatives_by_controls_are_those_of_differences() {
    let (values, h) = ([0.4, 0.7], 1e-3);
    for model in models() {
        let points = [0.3, -0.2, -0.1, 0.25];
        let exact = AtControls::new(&model, &values).and_then(|at| at.derivatives(&points));
        let exact = exact.expect("two values");
        let of_data = stored(&model).control_derivatives(&values, &points).expect("in the section");
        for control in 0..2 {
            let at = |by: f64| {
                let mut moved = values;
                moved[control] += by;
                moved
            };
            for k in 0..4 {
                let by_differences = |by: f64| {
                    let mut z = points[k / 2 * 2..][..2].to_vec();
                    model.at_controls(&at(by)).expect("two values").forward(&mut z);
                    z[k % 2]
                };
                let found = exact[2 * k + control];
                close(found, slope(by_differences, h), 1e-10, "of the network");
                let by_differences = |by: f64| {
                    let mut z = points[k / 2 * 2..][..2].to_vec();
                    let there = stored(&model).at_controls(&at(by)).expect("two values");
                    there
                        .map_points(gyroceptron::phase::Direction::Forward, &mut z)
                        .expect("finite");
                    z[k % 2]
                };
                let found = of_data[2 * k + control];
                close(found, slope(by_differences, h), 1e-9, "of the data");
                assert!(found != 0.0);
            }
        }
    }
}

/// Where fixed points are looked for.
fn guesses() -> impl Iterator<Item = [f64; 2]> {
    (0..49).map(|k| [f64::from(k % 7 - 3) / 4.0, f64::from(k / 7 - 3) / 4.0])
}

/// A fixed point and how fast an orbit turns about it, their derivatives against differences.
#[test]
fn orbits_respond_to_controls_as_differences_say() {
    let (values, h) = ([0.4, 0.7], 1e-3);
    const MAPS: usize = 3000;
    let (mut found, mut turned) = (0, 0);
    for model in models() {
        let stored = stored(&model);
        let at = |control: usize, by: f64| {
            let mut moved = values;
            moved[control] += by;
            stored.at_controls(&moved).expect("two values")
        };
        // A map of no circle need not have one.
        let near = |guess: [f64; 2]| at(0, 0.0).periodic_orbit(&guess, 1).ok();
        let turned_about = |orbit: &PeriodicOrbit| orbit.trace().abs() < 1.9;
        let mut orbits: Vec<PeriodicOrbit> = guesses().filter_map(near).collect();
        orbits.sort_by_key(|orbit| !turned_about(orbit));
        let Some(orbit) = orbits.into_iter().next() else { continue };
        let trace = orbit.trace();
        found += 1;
        let response = stored.orbit_response(&values, &orbit).expect("it moves");
        for control in 0..2 {
            let there =
                |by: f64| at(control, by).periodic_orbit(&orbit.points[0], 1).expect("near");
            for k in 0..2 {
                let by_differences = slope(|by| there(by).points[0][k], h);
                close(response.moved[2 * k + control], by_differences, 1e-8, "a point");
            }
            let by_differences = slope(|by| there(by).trace(), h);
            close(response.traces[control], by_differences, 1e-8, "Tr M");
        }
        if trace.abs() >= 1.9 {
            continue;
        }
        turned += 1;
        let centre = [orbit.points[0][0], orbit.points[0][1]];
        let start = [centre[0] + 0.05, centre[1]];
        let (turns, changes) =
            stored.rotation_response(&values, start, centre, MAPS).expect("an orbit");
        let turning = |control: usize, by: f64| {
            let states = at(control, by).rollout(&start, Rollout { steps: MAPS, every: 1 });
            let orbit = Trajectories::new(states.expect("finite"), 2, 1).expect("states");
            let angle = |z: &[f64]| (z[1] - centre[1]).atan2(z[0] - centre[0]);
            rotation_numbers(&orbit, turns, angle)[0].turns
        };
        close(turns, turning(0, 0.0), 1e-12, "turns");
        for (control, change) in changes.into_iter().enumerate() {
            close(change, slope(|by| turning(control, by), h), 1e-8, "their change");
        }
    }
    assert!(found >= 1 && turned >= 1, "{found} orbits, {turned} of which others turn about");
}

/// Of an orbit of several points M is the Jacobian of all its maps. A fixed point, gone round twice, stands for one.
#[test]
fn the_trace_of_several_maps_responds_to_controls_as_differences_say() {
    let (values, h) = ([0.4, 0.7], 1e-3);
    let mut found = 0;
    for model in models() {
        let plain = StoredModel { units: None, section: None, ..stored(&model) };
        let at = |control: usize, by: f64| {
            let mut moved = values;
            moved[control] += by;
            plain.at_controls(&moved).expect("two values")
        };
        let twice = |once: &PeriodicOrbit| {
            let m = &once.multiplier_matrix;
            let row = |i: usize, j: usize| m[2 * i] * m[j] + m[2 * i + 1] * m[2 + j];
            PeriodicOrbit {
                points: [once.points[0].clone(), once.points[0].clone()].into(),
                multiplier_matrix: [row(0, 0), row(0, 1), row(1, 0), row(1, 1)].into(),
                missed: once.missed,
            }
        };
        let mut orbits = guesses().filter_map(|guess| at(0, 0.0).periodic_orbit(&guess, 1).ok());
        let Some(orbit) = orbits.next() else { continue };
        found += 1;
        let of_network = AtControls::new(&model, &values).expect("two values");
        let response = of_network.orbit_response(&twice(&orbit)).expect("it moves");
        for control in 0..2 {
            let there =
                |by: f64| at(control, by).periodic_orbit(&orbit.points[0], 1).expect("near");
            for k in 0..2 {
                let by_differences = slope(|by| there(by).points[0][k], h);
                close(response.moved[2 * k + control], by_differences, 1e-8, "a point");
            }
            let by_differences = slope(|by| twice(&there(by)).trace(), h);
            close(response.traces[control], by_differences, 1e-8, "Tr M²");
        }
    }
    assert!(found >= 1, "no fixed point");
}

/// The chart is that of the density at the controls, which is linear in them.
#[test]
fn a_section_follows_its_controls() {
    let nominal = |x: f64, y: f64| 2.0 + 0.3 * x - 0.1 * x * y;
    let change = |x: f64, y: f64| 0.4 * y + 0.2 * x * x;
    let made = AreaDensity::of_function(nominal, [-1.0; 2], [1.0; 2], 2.0);
    let made = made.and_then(|made| made.with_changes(&[(&change, 0.7)])).expect("positive");
    let there = |x: f64, y: f64| nominal(x, y) + 0.7 * change(x, y);
    let wanted = AreaDensity::of_function(there, [-1.0; 2], [1.0; 2], 2.0).expect("positive");
    let at = made.at_offsets(&[0.7]).expect("one number");
    for place in [[0.3, -0.4], [-0.9, 0.8]] {
        let (found, own) = (at.to_canonical(place), wanted.to_canonical(place));
        close(found[1], own[1], 1e-14, "p");
        let by_differences =
            slope(|by| made.at_offsets(&[by]).expect("one").to_canonical(place)[1], 1e-2);
        close(made.by_control(0, place), by_differences, 1e-12, "∂p/∂λ");
    }
    assert!(made.at_offsets(&[1.0, 2.0]).is_err());
    // Far away there is no chart.
    assert!(made.at_offsets(&[9.0]).expect("one number").check().is_err());
}

/// What a file of a model has, and what it has not.
#[test]
fn models_and_pairs_with_controls_come_back_from_their_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("model.json");
    for model in models() {
        let stored = stored(&model);
        save_model(&path, &stored).expect("written");
        let text = std::fs::read_to_string(&path).expect("text");
        assert!(text.contains("\"version\": 5"), "{text}");
        let back = load_model(&path).expect("read");
        assert_eq!(back.model.architecture(), model.architecture());
        assert_eq!(back.model.parameters(), model.parameters());
        assert_eq!(back.section, stored.section);
        // At given controls it is a model of none, in the format of those.
        let plain = stored.at_controls(&[0.0, 1.0]).expect("two values");
        save_model(&path, &plain).expect("written");
        let text = std::fs::read_to_string(&path).expect("text");
        assert!(!text.contains("controls") && !text.contains("changes"), "{text}");
        let other = text.replacen("0.", "1.", 1);
        assert!(parse_model("other", other.as_bytes()).is_err(), "a digit was changed");
        std::fs::remove_file(&path).expect("there");
        // As weights for other programs, which name its controls.
        for ending in ["safetensors", "npz"] {
            let weights = folder.path().join(format!("weights.{ending}"));
            export_weights(&weights, &model, None).expect("written");
            let own = read_architecture(&weights).expect("read").expect("an architecture");
            let tensors = read_tensors(&weights).expect("read");
            let back = assemble_architecture(ending, tensors, own).expect("all tensors");
            assert_eq!(back.architecture(), model.architecture());
            assert_eq!(back.parameters(), model.parameters());
        }
    }
    let pairs = family(3);
    let path = folder.path().join("pairs.npz");
    write_pairs(&path, &pairs).expect("written");
    let file = read_pairs(&path).expect("read");
    assert_eq!((file.controls, file.has_epsilons, file.has_times), (2, false, false));
    assert_eq!(file.pairs, pairs);
}

/// Pairs of several machines at one ε, that of the network, are of no family of ε.
#[test]
fn controls_alone_say_nothing_of_epsilon() {
    let (pairs, values) = pairs_of_henon(&[[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]], 5, 1);
    let ones = vec![1.0; pairs.len()];
    let data = FamilyPairs::from(pairs.under_controls(&ones, &ones, &values).expect("values"));
    assert_eq!((data.has_epsilons, data.has_times), (false, false));
    // A change that is none has no error of its own.
    let density =
        AreaDensity::of_function(|x, _| 2.0 + x, [-1.0; 2], [1.0; 2], 1.0).expect("positive");
    let same = density.clone().with_changes(&[(&|_, _| 0.0, 1.0)]).expect("finite");
    assert_eq!(same.error(), density.error());
}

/// All pairs at some inner values judge the others; the ends and the middle stay.
#[test]
fn whole_values_are_held_out() {
    let grid: Vec<[f64; 2]> = (0..9).map(|k| [f64::from(k) - 4.0, f64::from(k) / 2.0]).collect();
    let (pairs, values) = pairs_of_henon(&grid, 10, 2);
    let ones = vec![1.0; pairs.len()];
    let pairs = pairs.under_controls(&ones, &ones, &values).expect("values");
    for seed in 0..20 {
        let split = pairs.split_by_controls(0.3, &mut Stream::new(seed, "held"));
        let (kept, held_out) = split.expect("nine values");
        let of = |pairs: &Pairs| -> Vec<f64> {
            pairs.conditions().iter().map(|condition| condition.controls[0]).collect()
        };
        assert_eq!((of(&kept).len(), of(&held_out).len(), held_out.len()), (6, 3, 30));
        assert!([-4.0, 0.0, 4.0].iter().all(|value| of(&kept).contains(value)), "{:?}", of(&kept));
    }
    let few = pairs.rows(0..40);
    assert!(few.split_by_controls(0.3, &mut Stream::new(0, "held")).is_none());
    assert!(pairs.split_by_controls(0.0, &mut Stream::new(0, "held")).is_none());
}

#[test]
fn what_controls_cannot_be_is_refused() {
    let says = |result: Result<Controls, Error>, words: &str| {
        let reason = result.expect_err(words).to_string();
        assert!(reason.contains(words), "{reason}");
    };
    let checked = |controls: Controls| controls.check().map(|()| controls);
    let of = |ranges: Vec<ControlRange>, degree| checked(Controls { ranges, degree });
    says(of(vec![range("a", 1.0, 1.0)], 1), "from 1 to 1");
    says(of(vec![range("a", f64::NAN, 1.0)], 1), "a");
    says(of(vec![range("a", 0.0, 1.0), range("a", 0.0, 1.0)], 1), "`a` twice");
    says(of(vec![range("a=1", 0.0, 1.0)], 1), "`a=1`");
    says(of(vec![range("a", 0.0, 1.0)], 0), "degree");
    says(of(Vec::new(), 1), "controls");
    let rows: Vec<[f64; 1]> = vec![[0.5], [0.5]];
    let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..]).collect();
    let options = |names: &[&str], degree| ControlOptions {
        names: names.iter().map(|name| (*name).into()).collect(),
        degree,
    };
    let made = |options: ControlOptions, rows: &[&[f64]]| {
        options.of_values(rows).map(|made| made.expect("controls"))
    };
    says(made(options(&[], None), &rows), "from 0.5 to 0.5");
    says(made(options(&["a", "b"], None), &[&[0.0], &[1.0]]), "names of controls");
    says(made(options(&["a"], None), &[]), "lambda");
    // The highest degree of which there are fewer terms than values, up to 4.
    for (values, degree) in [(2, 1), (3, 1), (4, 2), (5, 3), (6, 4), (40, 4)] {
        let rows: Vec<[f64; 1]> = (0..values).map(|k| [f64::from(k)]).collect();
        let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..]).collect();
        assert_eq!(made(options(&[], None), &rows).expect("values").degree, degree);
    }
    // Two values of one control do not tell its square, nor values on a line two controls apart.
    let grid: Vec<[f64; 2]> = (0..20).map(|k| [f64::from(k % 2), f64::from(k / 2)]).collect();
    let grid: Vec<&[f64]> = grid.iter().map(|row| &row[..]).collect();
    assert_eq!(made(options(&[], None), &grid).expect("values").degree, 1);
    says(made(options(&[], Some(2)), &grid), "do not determine these");
    let line: Vec<[f64; 2]> = (0..20).map(|k| [f64::from(k), 2.0 * f64::from(k)]).collect();
    let line: Vec<&[f64]> = line.iter().map(|row| &row[..]).collect();
    says(made(options(&[], None), &line), "do not determine these");
    says(of(vec![range("epsilon", 0.0, 1.0)], 1), "`epsilon`");
    // What has twists by parts has no controls.
    let (pairs, values) = pairs_of_henon(&[[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]], 30, 1);
    let data = || FamilyPairs::new(pairs.clone(), None, None, Some(&values)).expect("values");
    let mut fit = fit();
    fit.controls = options(&[], Some(1));
    fit.network = Some(NetworkSpec::named("normal-form").expect("a name"));
    fit.training.ramp = vec![RampStage {
        flow_time: None,
        epsilon: None,
        repeats: Some(2),
        degree: None,
        iterations: 1,
    }];
    fit.training.fresh_twists = Some(FreshTwists { count: 1, iterations: 1 });
    let reason = fit.prepare(data()).expect_err("twists alone").to_string();
    assert!(reason.contains("controls"), "{reason}");
    let model = &models()[0];
    assert!(model.iterated(2).expect_err("of another kind").to_string().contains("a, b"));
    assert!(AtControls::new(model, &[0.0]).is_err());
    let plain = model.at_controls(&[0.0, 0.0]).expect("two values");
    assert!(AtControls::new(&plain, &[]).is_err());
    let at = AtControls::new(model, &[0.0, 0.0]).expect("two values");
    // Of an orbit with the eigenvalue 1 nothing says where it moves, even where Tr M does not depend on it.
    let turn = Architecture::new(1).on_circle(CircleAction::new([1])).with_controls(Some(two()));
    let turn = drawn(&turn, 3);
    let still = PeriodicOrbit {
        points: vec![vec![0.1, 0.2]],
        multiplier_matrix: vec![1.0, 0.0, 0.0, 1.0],
        missed: 0.0,
    };
    let of_turn = AtControls::new(&turn, &[0.0, 0.0]).expect("two values");
    for at in [at, of_turn] {
        let reason = at.orbit_response(&still).expect_err("it has the eigenvalue 1").to_string();
        assert!(reason.contains("eigenvalue 1"), "{reason}");
    }
    // An orbit has no angle about where it begins.
    let at_centre = at.rotation_response([0.1, 0.2], &[0.0; 4], [0.1, 0.2], 100);
    assert!(at_centre.expect_err("no angle").to_string().contains("centre"));
    let values = two().values([("b", 0.25)]).expect("a name");
    assert_eq!(values, [1.0, 0.25]);
    assert!(two().values([("c", 0.25)]).expect_err("a name").to_string().contains("one of a, b"));
    assert!(two().values([("b", 0.25), ("b", 0.5)]).is_err());
    assert_eq!(
        two().first_outside(&[1.0, 1.5]).map(|(range, value)| (&*range.name, value)),
        Some(("b", 1.5))
    );
}

/// Polynomials in the coordinates and in the controls are found again; at given controls they are those of one map.
#[test]
fn polynomials_follow_their_controls() {
    let grid: Vec<[f64; 2]> =
        (0..9).map(|k| [f64::from(k % 3) - 1.0, f64::from(k / 3) - 1.0]).collect();
    let (plain, values) = pairs_of_henon(&grid, 30, 8);
    let ones = vec![1.0; plain.len()];
    let pairs = plain.clone().under_controls(&ones, &ones, &values).expect("values");
    let ranges = vec![range("a", -1.0, 1.0), range("b", -1.0, 1.0)];
    let controls = Controls { ranges, degree: 2 };
    let family = PolynomialFamily::fit(&pairs, 2, &controls).expect("enough pairs");
    // Six products of q and p, six of the controls, for q and for p.
    assert_eq!(family.parameters(), 6 * 6 * 2);
    // The sine and the cosine of a quadratic angle are no polynomials of second degree, nor their product with a
    // strength.
    let error = |at: [f64; 2]| {
        family.at_controls(&at).expect("two values").error_on(&pairs_of_henon(&[at], 50, 6).0)
    };
    assert!(error([0.5, -0.5]) < 3e-4, "{:e}", error([0.5, -0.5]));
    // At one value of the first control, and linear in the other, it is exact.
    let line: Vec<[f64; 2]> = (0..4).map(|k| [0.0, f64::from(k) / 3.0]).collect();
    let (plain, values) = pairs_of_henon(&line, 30, 9);
    let values: Vec<f64> = values.chunks_exact(2).map(|row| row[1]).collect();
    let ones = vec![1.0; plain.len()];
    let pairs = plain.under_controls(&ones, &ones, &values).expect("values");
    let controls = Controls { ranges: vec![range("b", 0.0, 1.0)], degree: 1 };
    let family = PolynomialFamily::fit(&pairs, 2, &controls).expect("enough pairs");
    let error = family
        .at_controls(&[0.45])
        .expect("a value")
        .error_on(&pairs_of_henon(&[[0.0, 0.45]], 50, 6).0);
    assert!(error < 1e-14, "{error:e}");
    assert!(family.at_controls(&[0.45, 1.0]).is_err());
    let reason = PolynomialFamily::fit(&pairs, 30, &controls).expect_err("too many").to_string();
    assert!(reason.contains("two pairs for each term"), "{reason}");
    assert!(PolynomialFamily::fit(&family_of_none(), 2, &controls).is_err());
}

fn family_of_none() -> Pairs {
    pairs_of_henon(&[[0.0, 0.0]], 30, 9).0
}
