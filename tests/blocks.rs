//! Networks as lists of blocks: arrangements without a name, lists that are refused, and files of
//! earlier formats.

use gyroceptron::Error;
use gyroceptron::flow::{Pairs, Window, sample};
use gyroceptron::io::{
    Provenance, StoredModel, assemble_architecture, export_weights, load_model, model_text,
    parse_model, read_architecture, read_tensors,
};
use gyroceptron::layer::{Activation, CircleAction};
use gyroceptron::measure::certificate::{CertificateOptions, certify};
use gyroceptron::network::{
    Architecture, Block, InitialWeights, Layers, Model, Modules, NamedArchitecture, NetworkSpec,
    Part, Rollout, Scale, Structure, map_jacobians, map_jacobians_by_duals, map_points,
};
use gyroceptron::phase::{Direction, Map, Units};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Dual, max_or_nan};
use gyroceptron::system::Oscillators;
use gyroceptron::train::{Control, Optimiser, TrainingOptions, train};
use serde_json::{Value, json};
use std::path::Path;

fn modules(modules: usize) -> Layers {
    let activation = Activation::Tanh;
    Layers::SympNet(Modules { modules, shears: 3, activation, plain: false })
}

/// Polynomials in the box of radius 2.
fn polynomials(part: Part, layers: Layers, degree: usize) -> Block {
    Block::new(part, layers).of_polynomials(degree).in_box(2.0)
}

/// On the first of two planes.
fn on_circle() -> Architecture {
    Architecture::new(2).on_circle(CircleAction::new([1, 0])).at_epsilon(0.02)
}

/// Arrangements that have no name, with what their lists make of them.
fn arrangements() -> Vec<(&'static str, Architecture, Structure)> {
    let henon = |widths: &[usize]| Layers::Henon(widths.to_vec());
    let kicks = |widths: &[usize]| Layers::TurnedKick(widths.to_vec());
    let twist = |widths: &[usize]| Layers::Twist(widths.to_vec());
    let couplings = |widths: &[usize]| Layers::TurnedCoupling(widths.to_vec());
    vec![
        (
            "ψ of SympNet modules in a gyroceptron",
            on_circle()
                .with(Block::new(Part::Conjugation, modules(3)))
                .with(Block::new(Part::NearIdentity, henon(&[3, 4]))),
            Structure::NearlyPeriodic,
        ),
        (
            "ψ and I_ε of turned kicks",
            on_circle()
                .with(Block::new(Part::Conjugation, kicks(&[3])))
                .with(Block::new(Part::NearIdentity, kicks(&[4, 2]))),
            Structure::NearlyPeriodic,
        ),
        (
            "I_ε of Hénon layers that the flow time scales too",
            on_circle()
                .of_time(3.0)
                .with(Block::new(Part::Conjugation, henon(&[2])))
                .with(Block::new(Part::NearIdentity, henon(&[3])).scaled(Scale::EpsilonTime)),
            Structure::NearlyPeriodic,
        ),
        (
            "a chart of Hénon layers and turned kicks, two slow maps",
            on_circle()
                .of_time(3.0)
                .with(Block::new(Part::Chart, henon(&[3, 2])))
                .with(Block::new(Part::Chart, kicks(&[4])).named("kicks"))
                .with(Block::new(Part::SlowMap, twist(&[2, 3])))
                .with(Block::new(Part::SlowMap, twist(&[1, 2])).named("second")),
            Structure::NormalForm,
        ),
        (
            "a slow map of turned twists",
            on_circle()
                .of_time(3.0)
                .with(Block::new(Part::Chart, kicks(&[3])))
                .with(Block::new(Part::SlowMap, Layers::TurnedTwist(vec![3, 2, 4]))),
            Structure::NormalForm,
        ),
        (
            "turned twists of two circles and two slow planes",
            Architecture::new(4)
                .on_circle(CircleAction::new([0, 1, 0, 0]))
                .on_circle(CircleAction::new([0, 0, 0, 2]))
                .at_epsilon(0.02)
                .with(Block::new(Part::SlowMap, Layers::TurnedTwist(vec![3, 2])))
                .with(Block::new(Part::Chart, kicks(&[3]))),
            Structure::NormalForm,
        ),
        (
            "a normal form in a chart that is not symplectic",
            on_circle()
                .with(Block::new(Part::Conjugation, couplings(&[3, 2])))
                .with(Block::new(Part::SlowMap, twist(&[2, 3]))),
            Structure::NormalForm,
        ),
        (
            "a perturbation of Hénon layers",
            on_circle()
                .of_time(0.7)
                .with(Block::new(Part::Chart, kicks(&[3])).scaled(Scale::None))
                .with(Block::new(Part::SlowMap, twist(&[2, 3])).scaled(Scale::Time))
                .with(Block::new(Part::Perturbation, henon(&[3, 2]))),
            Structure::NearlyIntegrable,
        ),
        (
            "a chart and a slow map beside I_ε",
            on_circle()
                .with(Block::new(Part::Conjugation, henon(&[3])))
                .with(Block::new(Part::Chart, kicks(&[3])))
                .with(Block::new(Part::SlowMap, twist(&[2, 2])))
                .with(Block::new(Part::NearIdentity, kicks(&[2]))),
            Structure::Mixed,
        ),
        (
            "Hénon layers, kicks and modules without a circle",
            Architecture::new(2)
                .with(Block::new(Part::None, henon(&[3])).named("a"))
                .with(Block::new(Part::None, kicks(&[3])).named("b"))
                .with(Block::new(Part::None, modules(2)).named("c")),
            Structure::Plain,
        ),
        (
            "jolts, a twist of 𝔍 alone, and jolts of a perturbation",
            Architecture::new(1)
                .on_circle(CircleAction::new([1]))
                .at_epsilon(0.02)
                .of_time(0.7)
                .with(polynomials(Part::Chart, kicks(&[1, 1]), 9).scaled(Scale::None))
                .with(polynomials(Part::SlowMap, twist(&[1]), 6).scaled(Scale::Time))
                .with(polynomials(Part::Perturbation, kicks(&[1, 1, 1]), 1)),
            Structure::NearlyIntegrable,
        ),
        (
            "a chart of polynomials and neurons, slow maps of polynomials in all ways",
            on_circle()
                .of_time(3.0)
                .with(polynomials(Part::Chart, kicks(&[3, 5]), 4))
                .with(Block::new(Part::Chart, kicks(&[2])).named("neurons"))
                .with(polynomials(Part::SlowMap, twist(&[2, 3, 1]), 5))
                .with(
                    polynomials(Part::SlowMap, Layers::TurnedTwist(vec![4, 1]), 6).named("turned"),
                ),
            Structure::NormalForm,
        ),
        (
            "Hénon layers of polynomials in a gyroceptron",
            on_circle().with(polynomials(Part::Conjugation, henon(&[4, 1]), 3)).with(polynomials(
                Part::NearIdentity,
                henon(&[3]),
                2,
            )),
            Structure::NearlyPeriodic,
        ),
        (
            "a twist of polynomials of two actions of both signs",
            Architecture::new(3)
                .on_circle(CircleAction::new([2, -1, 0]))
                .on_circle(CircleAction::new([0, 1, 0]))
                .at_epsilon(0.02)
                .with(polynomials(Part::SlowMap, twist(&[3, 2]), 4)),
            Structure::NormalForm,
        ),
        (
            "couplings without a circle",
            Architecture::new(2).with(Block::new(Part::None, couplings(&[3, 3]))),
            Structure::Plain,
        ),
    ]
}

fn model(architecture: &Architecture) -> Model {
    let weights = InitialWeights::Normal { scale: 0.3 };
    architecture.initialise(weights, 1.1, 5).expect("a sound architecture")
}

/// A point of these degrees of freedom.
fn start(dof: usize) -> Vec<f64> {
    [0.7, -0.4, 0.3, 0.9, -0.6, 0.2, 0.5, -0.8][..2 * dof].to_vec()
}

/// Files, messages and Rust call kinds of layers by the same names.
#[test]
fn kinds_of_layers_are_read_by_their_names() {
    let widths = || vec![2, 2];
    let all = [
        Layers::Henon(widths()),
        Layers::TurnedKick(widths()),
        Layers::Twist(widths()),
        Layers::TurnedTwist(widths()),
        Layers::TurnedCoupling(widths()),
        modules(2),
    ];
    for layers in all {
        let (kind, block) = (layers.kind(), Block::new(Part::None, layers));
        let table = serde_json::to_value(&block).expect("a table");
        assert_eq!(table["layer"], kind.name());
        assert_eq!(serde_json::from_value::<Block>(table).expect("the block"), block);
    }
}

/// All of them hold the laws that their lists say, and own the invariants.
#[test]
fn arrangements_are_certified() {
    for (name, architecture, structure) in arrangements() {
        assert_eq!(architecture.structure(), structure, "{name}");
        let model = model(&architecture);
        let options = CertificateOptions { samples: 30, ..Default::default() };
        let certificate = certify(&model, options);
        assert!(certificate.holds(), "{name}: {certificate}");
        let laws = |law: &str| certificate.rows.iter().any(|row| row.law.starts_with(law));
        let has_circle = structure != Structure::Plain;
        let exact = structure == Structure::NormalForm;
        assert_eq!(
            laws("equivariance"),
            exact || structure == Structure::NearlyIntegrable,
            "{name}"
        );
        let periodic = matches!(structure, Structure::NearlyPeriodic | Structure::Mixed);
        assert_eq!(laws("near periodicity"), periodic, "{name}");
        let owns = has_circle && (architecture.is_symplectic() || exact);
        assert_eq!(model.invariant().is_some(), owns, "{name}");
        if exact {
            let invariant = model.invariant().expect("it owns one");
            let mut z = start(architecture.dof);
            let before = invariant(&z);
            (0..200).for_each(|_| model.forward(&mut z));
            assert!((invariant(&z) - before).abs() < 1e-12, "{name}");
            // The slow planes are not the circles'.
            let slow = |j: &usize| architecture.circles.iter().all(|c| c.weights()[*j] == 0);
            let moved = (0..architecture.dof).filter(slow).map(|j| (z[j] - start(4)[j]).abs());
            assert!(
                architecture.dof == 4 || moved.fold(0.0, max_or_nan) > 1e-3,
                "{name} stands still"
            );
        }
    }
}

/// Where a structure is not what it is said to be, the certificate says so: the mutant is a model
/// whose list is read as that of another.
#[test]
fn an_arrangement_that_is_taken_for_another_is_rejected() {
    use gyroceptron::measure::certificate::{certify_family, certify_map, certify_normal_form};
    let options = CertificateOptions { samples: 30, ..Default::default() };
    for (name, architecture, structure) in arrangements() {
        let model = model(&architecture);
        if !architecture.is_symplectic() {
            assert!(!certify_map(&model, options).holds(), "{name} is not symplectic");
        }
        if matches!(structure, Structure::Mixed | Structure::NearlyIntegrable) {
            assert!(!certify_normal_form(&model, options).holds(), "{name} is no normal form");
        }
        if structure == Structure::Plain {
            assert!(!certify_family(&model, options).holds(), "{name} is not nearly periodic");
        }
    }
}

/// The map is its parts in their order, and the parameters are those of the blocks and θ.
#[test]
fn a_model_is_its_parts() {
    for (name, architecture, structure) in arrangements() {
        let model = model(&architecture);
        let count: usize = architecture.tensors().iter().map(|(_, [r, c])| r * c).sum();
        assert_eq!(model.parameters().len(), count, "{name}");
        let start = start(architecture.dof);
        let mut by_parts = start.clone();
        let [chart, inner] = model.chart_and_inner_map();
        chart.inverse(&mut by_parts);
        inner.forward(&mut by_parts);
        chart.forward(&mut by_parts);
        model.near_identity().forward(&mut by_parts);
        model.part(Part::None).forward(&mut by_parts);
        let mut whole = start.clone();
        model.forward(&mut whole);
        assert_eq!(whole, by_parts, "{name}");
        assert_ne!(whole, start, "{name}");
        model.inverse(&mut whole);
        let back = whole.iter().zip(&start).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
        assert!(back < 1e-12, "{name}: {back:e}");
        if structure != Structure::Plain {
            let angles = vec![1.1; architecture.circles.len()];
            assert_eq!(model.angles(), angles, "{name}");
            assert_eq!(model.parameters()[architecture.angles()], angles, "{name}");
        }
        // Streams of one name go on: no two blocks have the same weights.
        let ranges = architecture.block_ranges();
        for (k, range) in ranges.iter().enumerate() {
            for other in &ranges[..k] {
                let (own, of) =
                    (&model.parameters()[range.clone()], &model.parameters()[other.clone()]);
                assert_ne!(own[..3], of[..3], "{name}");
            }
        }
    }
}

#[test]
fn arrangements_are_kept_in_files() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, architecture, _) in arrangements() {
        let model = model(&architecture);
        let stored = StoredModel {
            model: model.clone(),
            units: None,
            section: None,
            provenance: Provenance::of_scene("test"),
        };
        let text = model_text(&stored).expect("finite");
        let back = parse_model("m.json", text.as_bytes()).expect("as written").model;
        assert_eq!(back.architecture(), &architecture, "{name}");
        assert_eq!(back.parameters(), model.parameters(), "{name}");
        // As weights for others too, with the list in the file.
        for ending in ["safetensors", "npz"] {
            let file = folder.path().join(format!("w.{ending}"));
            export_weights(&file, &model, None).expect("written");
            let own = read_architecture(&file).expect("read").expect("it has one");
            let tensors = read_tensors(&file).expect("read");
            let back = assemble_architecture("w", tensors, own).expect("all tensors");
            assert_eq!(back.architecture(), &architecture, "{name}");
            assert_eq!(back.parameters(), model.parameters(), "{name}");
        }
    }
}

/// Loss and derivatives are those of any network: a few steps of two optimisers lower the error.
#[test]
fn arrangements_are_trained() {
    let window = Window { low: vec![-1.0; 4], high: vec![1.0; 4], samples: 120 };
    let points = sample(&[window], 2, &mut Stream::new(1, "points")).expect("points");
    let (pairs, _) = Pairs::of_flow(&Oscillators { epsilon: 0.02 }, points, 0.5).expect("a flow");
    for (name, architecture, _) in arrangements().into_iter().filter(|(_, of, _)| of.dof == 2) {
        let weights = InitialWeights::Normal { scale: 0.1 };
        let model = architecture.initialise(weights, 0.5, 3).expect("sound");
        for optimiser in [Optimiser::default(), Optimiser::LevenbergMarquardt(Default::default())] {
            let options = TrainingOptions { iterations: 8, optimiser, ..Default::default() };
            let goes_on = &mut |_: gyroceptron::train::Progress<'_>| Ok(Control::Continue);
            let outcome = train(&model, &pairs, None, &options, None, goes_on).expect("trains");
            let first = outcome.history[0].loss;
            assert!(outcome.loss < 0.95 * first, "{name}: {first:e} to {:e}", outcome.loss);
            assert_eq!(outcome.model.architecture(), &architecture);
        }
    }
}

#[test]
fn rollouts_of_arrangements_are_their_steps() {
    for (name, architecture, _) in arrangements() {
        let model = model(&architecture);
        let (mut z, dim) = (start(architecture.dof), 2 * architecture.dof);
        let states = model.rollout(&z, Rollout { steps: 6, every: 2 }).expect("finite");
        for step in 1..=6 {
            model.forward(&mut z);
            if step % 2 == 0 {
                let kept = &states[step / 2 * dim..][..dim];
                let apart = z.iter().zip(kept).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
                assert!(apart < 1e-12, "{name}: {apart:e}");
            }
        }
    }
}

/// The pullback of every arrangement is what duals give, for every parameter and coordinate; and so
/// are its derivatives along directions, on lanes.
#[test]
fn derivatives_of_arrangements_are_those_of_duals() {
    type D = Dual<f64, 1>;
    for (name, architecture, _) in arrangements() {
        let model = model(&architecture);
        let (z, map) = (start(architecture.dof), model.composition());
        let dim = z.len();
        let cotangent: Vec<f64> = (0..dim).map(|i| 1.0 - 0.2 * i as f64).collect();
        let mut recording = map.recording();
        map.forward_recorded(&mut z.clone(), &mut recording);
        let (mut z_bar, mut bar) = (cotangent.clone(), vec![0.0; model.parameters().len()]);
        map.vjp(&mut recording, &mut z_bar, &mut bar);
        let mut sizes = 0.0;
        for index in 0..bar.len() + dim {
            let lift = |k: usize, v: f64| D::variable(v, if k == index { 0 } else { 1 });
            let parameters = model.parameters().iter().enumerate();
            let parameters = parameters.map(|(k, &v)| lift(k, v)).collect();
            let epsilon = D::constant(architecture.epsilon);
            let lifted =
                Model::at_epsilon(architecture.clone(), epsilon, parameters).expect("as it was");
            let mut w: Vec<D> =
                z.iter().enumerate().map(|(k, &v)| lift(bar.len() + k, v)).collect();
            lifted.forward(&mut w);
            let expected: f64 = w.iter().zip(&cotangent).map(|(w, c)| w.eps[0] * c).sum();
            let found = if index < bar.len() { bar[index] } else { z_bar[index - bar.len()] };
            assert!((found - expected).abs() < 1e-11, "{name}, {index}: {found} {expected}");
            sizes += f64::from(u8::from(expected != 0.0));
        }
        assert!(sizes > 0.8 * bar.len() as f64, "{name}: most parameters matter");
        let mut by_rule = vec![0.0; dim * dim];
        let mut by_duals = by_rule.clone();
        map_jacobians(map, &z, &mut by_rule).expect("a point");
        map_jacobians_by_duals(map, &z, &mut by_duals).expect("a point");
        for (a, b) in by_rule.iter().zip(&by_duals) {
            assert!((a - b).abs() < 1e-12, "{name}: {a} {b}");
        }
        // One point alone, with neurons in the lanes, and many.
        let mut alone = z.clone();
        model.forward(&mut alone);
        let mut many = z.repeat(19);
        map_points(map, Direction::Forward, &mut many).expect("points");
        let bits = |z: &[f64]| z.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&many), bits(&alone).repeat(19), "{name}");
        let mut single = z.clone();
        map_points(map, Direction::Forward, &mut single).expect("a point");
        assert_eq!(bits(&single), bits(&alone), "{name}");
    }
}

/// The error of a list that cannot be names the block, its number, and what is wrong.
#[test]
fn lists_that_cannot_be_are_refused() {
    let henon = |widths: &[usize]| Layers::Henon(widths.to_vec());
    let refuses = |architecture: Architecture, words: &[&str]| {
        let error = architecture.check().expect_err("a list that cannot be").to_string();
        for word in words {
            assert!(error.contains(word), "{error}: {word}");
        }
        assert!(architecture.initialise(InitialWeights::Glorot, 0.3, 1).is_err());
        let parameters = vec![0.1; architecture.parameter_count().min(1000)];
        assert!(Model::new(architecture, parameters).is_err());
    };
    let plain = || Architecture::new(2);
    let twist = || Layers::Twist(vec![2, 3]);
    let near = Block::new(Part::NearIdentity, henon(&[2]));
    let still = near.clone().scaled(Scale::EpsilonTime);
    refuses(
        on_circle().of_time(0.0).with(still),
        &["block 0 (`near-identity`)", "flow_time", "identity"],
    );
    let two = on_circle().on_circle(CircleAction::new([2, 0]));
    refuses(
        two.with(Block::new(Part::SlowMap, twist())),
        &["block 0 (`slow-map`)", "circles of the actions of a twist", "2"],
    );
    let kicks = Block::new(Part::Conjugation, Layers::TurnedKick(vec![2]));
    let many = CircleAction::new(vec![1; 1001]);
    refuses(
        Architecture::new(1001).on_circle(many).with(kicks),
        &["block 0 (`conjugation`)", "planes of turned kicks", "1001"],
    );
    let psi = || Block::new(Part::Conjugation, henon(&[2]));
    refuses(plain().with(Block::new(Part::None, twist())), &["twist", "circle action"]);
    refuses(
        plain().with(psi()).with(near.clone()),
        &["block 0", "conjugation", "without a circle action"],
    );
    let wide = Architecture::new(3).on_circle(CircleAction::new([1, 0])).with(psi());
    refuses(wide, &["circle action", "3", "2"]);
    refuses(
        on_circle().with(psi()).with(psi()),
        &["block 1 (`conjugation`)", "name", "that of block 0"],
    );
    refuses(on_circle().with(psi()).with(near.clone().named("")), &["block 1", "name"]);
    refuses(on_circle().with(psi().named("a/b")), &["a/b", "letters"]);
    refuses(
        on_circle().with(psi()).with(Block::new(Part::SlowMap, henon(&[2]))),
        &["block 1", "slow-map", "commutes"],
    );
    refuses(
        on_circle().with(psi()).with(near.clone().scaled(Scale::None)),
        &["block 1", "near-identity", "ε"],
    );
    refuses(on_circle().with(psi().scaled(Scale::Epsilon)), &["conjugation", "no scale"]);
    let perturbation = Block::new(Part::Perturbation, henon(&[2]));
    refuses(
        on_circle().with(near.clone()).with(perturbation),
        &["block 0 (`near-identity`)", "block 1 (`perturbation`)"],
    );
    let slow = Block::new(Part::SlowMap, twist()).scaled(Scale::Time);
    refuses(
        on_circle().with(slow).with(near),
        &["block 0 (`slow-map`)", "of order one", "block 1"],
    );
    refuses(
        on_circle().with(psi()).with(Block::new(Part::Chart, henon(&[2, 0]))),
        &["block 1", "chart", "width 0", "number 1"],
    );
    // A caller reads number, name and reason without the words.
    let empty = on_circle().with(psi()).with(Block::new(Part::Chart, henon(&[2, 0])));
    let Err(Error::Block { number: 1, name, reason }) = empty.check() else { panic!("no block") };
    assert_eq!(name, "chart");
    assert!(matches!(*reason, Error::Invalid { ref name, .. } if name == "layers"), "{reason}");
    for (name, number, word) in [("psi", 1, "block 0"), ("", 0, "none, of 2")] {
        let blocks = [psi().named(name), Block::new(Part::Chart, henon(&[2])).named(name)];
        let of = blocks.into_iter().fold(on_circle(), Architecture::with);
        let Err(Error::Block { number: found, reason, .. }) = of.check() else { panic!("{name}") };
        assert_eq!(found, number);
        let Error::Invalid { name, value, .. } = *reason else { panic!("{reason}") };
        assert!(name == "name" && value.contains(word), "{name}: {value}");
    }
    let boxless =
        on_circle().with(psi()).with(Block::new(Part::Chart, henon(&[2])).of_polynomials(3));
    let count = boxless.parameter_count();
    let Err(Error::Block { number: 1, reason, .. }) = Model::new(boxless, vec![0.1; count]) else {
        panic!("no box")
    };
    assert!(matches!(*reason, Error::Missing { key: "radius", .. }), "{reason}");
    let none_slow = Architecture::new(2).on_circle(CircleAction::new([1, 2]));
    refuses(
        none_slow.with(psi()).with(Block::new(Part::SlowMap, Layers::TurnedTwist(vec![2]))),
        &["block 1", "slow-map", "no plane is slow"],
    );
    refuses(
        plain().with(Block::new(Part::None, modules(0))).at_epsilon(1.0),
        &["linear modules", "none"],
    );
    refuses(plain().with(Block::new(Part::None, henon(&[usize::MAX]))), &["parameters"]);
    refuses(on_circle().with(psi()).at_epsilon(f64::NAN), &["epsilon"]);
    refuses(on_circle().with(psi()).of_time(f64::INFINITY), &["flow_time"]);
    let count = on_circle().with(psi());
    let error = Model::new(count.clone(), vec![0.1; count.parameter_count() + 1]).unwrap_err();
    assert!(matches!(error, Error::WrongCount { .. }), "{error}");
}

/// Blocks as TOML has them, with the usual scale and name of their part.
#[test]
fn blocks_are_read_from_toml() {
    let text = r#"
kind = "blocks"
[[blocks]]
part = "conjugation"
layer = "symp-net"
modules = 3
shears = 2
activation = "tanh"
[[blocks]]
part = "chart"
layer = "turned-kick"
widths = { count = 2, width = 3 }
[[blocks]]
part = "slow-map"
layer = "twist"
widths = { count = 4, width = [1, 3] }
scale = "epsilon-time"
name = "slow"
"#;
    let spec: NetworkSpec = toml::from_str(text).expect("a network");
    spec.check().expect("sound");
    let circle = CircleAction::new([1, 0]).into();
    let architecture = spec.architecture(&circle, 0.1, 2.0).expect("sound");
    assert_eq!(architecture.structure(), Structure::NormalForm);
    assert_eq!((architecture.epsilon, architecture.flow_time), (0.1, 2.0));
    assert_eq!(architecture.widths(Part::SlowMap), [1, 3, 1, 3]);
    assert_eq!(architecture.widths(Part::Chart), [3, 3]);
    let names: Vec<String> = architecture.tensors().into_iter().map(|(name, _)| name).collect();
    for name in ["conjugation.linear.2.matrices", "chart.1.angles", "slow.0.quadratic", "theta"] {
        assert!(names.iter().any(|own| own == name), "{name}: {names:?}");
    }
    assert_eq!(architecture.blocks[1].scale, Scale::Epsilon);
    // And back.
    let written = toml::to_string(&spec).expect("TOML");
    assert_eq!(toml::from_str::<NetworkSpec>(&written).expect("as written"), spec);
    for (wrong, word) in [
        (text.replace("layer = \"twist\"", "layer = \"twists\""), "twist"),
        (text.replace("part = \"chart\"", "part = \"charts\""), "chart"),
        (text.replace("modules = 3\n", ""), "modules"),
        (text.replace("modules = 3", "widths = [3]"), "widths"),
        (text.replace("scale = ", "scaled = "), "scaled"),
        (text.replace("{ count = 2, width = 3 }", "3"), "widths"),
        (text.replace("count = 2", "count = 1000000000"), "layers"),
    ] {
        let error = toml::from_str::<NetworkSpec>(&wrong).expect_err("wrong").to_string();
        assert!(error.contains(word), "{error}: {word}");
    }
}

/// Each named architecture is a list of blocks that knows its name.
#[test]
fn named_architectures_know_their_names() {
    let circle = CircleAction::new([1, 0]).into();
    for named in NamedArchitecture::ALL {
        let spec = NetworkSpec::named(named.name).expect("it has this name");
        let architecture = spec.architecture(&circle, 0.01, 5.0).expect("sound");
        architecture.check().expect("sound");
        assert_eq!(architecture.name(), Some(named.name));
        // What it is made of small, it holds its laws.
        let small = named.sizes.iter().try_fold(spec.clone(), |spec, (key, _)| {
            spec.with_size(key, gyroceptron::network::LayerSizes::uniform(2, 3))
        });
        let small = small.and_then(|spec| spec.architecture(&circle, 0.01, 5.0));
        let model = model(&small.expect("it has these parts"));
        let options = CertificateOptions { samples: 20, ..Default::default() };
        assert!(certify(&model, options).holds(), "{}", named.name);
        // Of other widths too.
        for (key, _) in named.sizes {
            let size = gyroceptron::network::LayerSizes::uniform(2, 3);
            let other = spec.clone().with_size(key, size).expect("it has this part");
            let other = other.architecture(&circle, 0.01, 5.0).expect("sound");
            assert_eq!(other.name(), Some(named.name), "{key}");
            assert!(other.parameter_count() != architecture.parameter_count());
        }
        for key in NetworkSpec::SIZES.iter().filter(|key| named.sizes.iter().all(|s| s.0 != **key))
        {
            let size = gyroceptron::network::LayerSizes::uniform(2, 3);
            let error = spec.clone().with_size(key, size).expect_err("no such part").to_string();
            assert!(error.contains(key) && error.contains(named.name), "{error}");
        }
    }
    for (_, architecture, _) in arrangements() {
        assert_eq!(architecture.name(), None);
    }
}

/// Files of format 1 and 2, one for each architecture, as version 0.1.0 wrote them, with where they
/// move two points: by the bits.
#[test]
fn files_of_earlier_formats_are_read_to_the_same_bits() {
    let files: [(&str, &str, [u64; 8]); 7] = [
        (
            "format-1-coupling-gyroceptron",
            "coupling-gyroceptron",
            [
                0x3fe0751be800b082,
                0xbfc952297570f065,
                0x3fc72d0b6460a725,
                0x3fe67c7b73515ed9,
                0xbfe3b3b9f0d80c0e,
                0x3fd9b0c0e936d990,
                0x3fe4d379dc1e109e,
                0xbfd334144f5fe181,
            ],
        ),
        (
            "format-1-gyroceptron",
            "gyroceptron",
            [
                0x3fe1d7ddb7a28658,
                0xbfc5b61f3b02ec85,
                0x3fc63b26956f9bca,
                0x3fe6a9f9e0cdb64c,
                0xbfe38ec65ac88ec0,
                0x3fd8ab9255c5bc9e,
                0x3fe59191bfceed07,
                0xbfd3aadb65342eaa,
            ],
        ),
        (
            "format-1-henon-net",
            "henon-net",
            [
                0x3fdceb7f4b13ba66,
                0xbfc87a8fc0868994,
                0x3fd2ece510b772a7,
                0x3fe746e790f5bfe6,
                0xbfe8f7652a0a7ee3,
                0x3fd846e38d092985,
                0x3fe263de7992aec0,
                0xbfd76b6e33d0f27f,
            ],
        ),
        (
            "format-1-nearly-integrable",
            "normal-form",
            [
                0x3fe1eb8b907feb4c,
                0xbfc77b40c7111047,
                0x3fc76ca7607dba5a,
                0x3fe60be9bfadcbe9,
                0xbfe3693f2fb2807a,
                0x3fd9194b1e4f5b39,
                0x3fe54161c23a0860,
                0xbfd3f919df9c9be0,
            ],
        ),
        (
            "format-1-normal-form",
            "normal-form",
            [
                0x3fe1af0aa8f8246d,
                0xbfc5080470ed7a9b,
                0x3fc7e7c70536071b,
                0x3fe63923da6625a9,
                0xbfe3e085237327a0,
                0x3fd894b7626e680c,
                0x3fe51359544c5c24,
                0xbfd39531494e3480,
            ],
        ),
        (
            "format-1-symp-net",
            "symp-net",
            [
                0x3fdf658527a7dae9,
                0xbfc5624fd816fcc6,
                0x3fcda01161286d94,
                0x3fe7d52bf89a233e,
                0xbfe2b4e862f6eeb5,
                0x3fd78b162e8c2fa3,
                0x3fe5236f11a2130a,
                0xbfd2e16931bc5749,
            ],
        ),
        (
            "format-2-gyroceptron",
            "gyroceptron",
            [
                0x3fc2748d6ed09ca0,
                0xbfc9f54d34057e2c,
                0x3ff11d19c2873c04,
                0x3fe65fe783b758c8,
                0xbff07c328d4fb75b,
                0x3fd9161e54a2f9cd,
                0x3ff8b94cbab81880,
                0xbfd33db110200f80,
            ],
        ),
    ];
    let points = [0.3, -0.2, 0.5, 0.7, -0.9, 0.4, 0.1, -0.3];
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/models");
    for (name, architecture, bits) in files {
        let stored = load_model(&folder.join(format!("{name}.json"))).expect("an earlier format");
        assert_eq!(stored.model.architecture().name(), Some(architecture), "{name}");
        let moved = stored.rollout(&points, Rollout { steps: 1, every: 1 }).expect("finite");
        let found: Vec<u64> = moved[8..].iter().map(|v| v.to_bits()).collect();
        assert_eq!(found, bits, "{name}");
        // Written again it is of the newest format, and the same.
        let text = model_text(&stored).expect("finite");
        assert!(text.contains("\"version\": 3") && text.contains("\"blocks\""), "{name}");
        let back = parse_model("again", text.as_bytes()).expect("as written");
        assert_eq!(back.model.parameters(), stored.model.parameters());
        assert_eq!(back.model.architecture(), stored.model.architecture());
        assert_eq!(back.units, stored.units);
    }
}

/// Files of format 3 to 5, of each kind of what came with these: neurons of arctan and turned twists, polynomials, a
/// reversor; a section; controls. They are read to the same bits, and written again byte for byte.
#[test]
fn files_of_formats_3_to_5_are_read_to_the_same_bits() {
    let files: [(&str, &str, &[u64]); 5] = [
        (
            "format-3-normal-form",
            "\"version\": 3",
            &[
                0x3fe280353d1e9c92,
                0xbfc99805ad01e014,
                0x3fb3688d69a135b0,
                0x3fe66681267c2c7e,
                0xbfc5ccd035ee0e2a,
                0x3fd99a634c7c981f,
                0x3fd808006afd26ea,
                0xbfd333022d334444,
            ],
        ),
        (
            "format-3-polynomials",
            "\"version\": 3",
            &[0x3fd375751da67798, 0xbfb8999921e50322, 0xbf98780757eb24da, 0x3fd46d79fd5c2090],
        ),
        (
            "format-3-reversible",
            "\"version\": 3",
            &[
                0x3fe27fbcd23d1889,
                0xbfc9a01af8c4a6be,
                0x3fb35f79ac00d80c,
                0x3fe6639e0aca39ba,
                0xbfc5ceaa3defae66,
                0x3fd99afe7d004a10,
                0x3fd8061176a11994,
                0xbfd338f64221b8e0,
            ],
        ),
        (
            "format-4-section",
            "\"version\": 4",
            &[0x3fd359b95a1ae6a9, 0xbfb7897164566ed5, 0xbf9524b216835c58, 0x3fd449ca6d0ad87c],
        ),
        (
            "format-5-controls",
            "\"version\": 5",
            &[0x3fd35e96322a1133, 0xbfba5e1f41837050, 0xbf9266a52cdcf20e, 0x3fd43009bb7f2a84],
        ),
    ];
    let planes = [0.3, 0.1, -0.2, 0.25];
    let four = [0.3, -0.2, 0.5, 0.7, -0.4, 0.4, 0.1, -0.3];
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/models");
    for (name, version, bits) in files {
        let path = folder.join(format!("{name}.json"));
        let stored = load_model(&path).expect("of this format");
        let points = if bits.len() == 4 { &planes[..] } else { &four };
        let moved = stored.rollout(points, Rollout { steps: 1, every: 1 }).expect("finite");
        let found: Vec<u64> = moved[points.len()..].iter().map(|v| v.to_bits()).collect();
        assert_eq!(found, bits, "{name}");
        let text = std::fs::read_to_string(&path).expect("text");
        assert!(text.contains(version), "{name}");
        assert_eq!(model_text(&stored).expect("finite"), text, "{name}");
    }
}

/// The digest of a model file covers all that it computes with.
#[test]
fn an_architecture_that_was_edited_is_refused() {
    let architecture = on_circle()
        .of_time(3.0)
        .with(Block::new(Part::Chart, Layers::TurnedKick(vec![2])))
        .with(Block::new(Part::SlowMap, Layers::Twist(vec![2, 3])));
    let stored = StoredModel {
        model: model(&architecture),
        units: None,
        section: None,
        provenance: Provenance::of_scene("x"),
    };
    let text = model_text(&stored).expect("finite").replace("\n        ", " ");
    assert!(parse_model("m.json", text.as_bytes()).is_ok());
    for (from, to) in [
        ("\"epsilon\": 0.02", "\"epsilon\": 0.03"),
        ("\"flow_time\": 3.0", "\"flow_time\": 4.0"),
        ("\"epsilon-time\"", "\"epsilon\""),
        ("\"name\": \"chart\"", "\"name\": \"chart-2\""),
    ] {
        let edited = text.replacen(from, to, 1);
        assert_ne!(edited, text, "{from}");
        let error = parse_model("m.json", edited.as_bytes()).expect_err("edited").to_string();
        assert!(error.contains("digest") && error.contains("edited"), "{error}");
    }
    // The circle action and the units, number by number.
    let units = Units::new(vec![0.5, 0.0, 0.0, 0.25], vec![2.0; 4]).expect("units");
    let text = model_text(&StoredModel { units: Some(units), ..stored }).expect("finite");
    for (place, value) in [
        ("/architecture/circles/0/0", json!(2)),
        ("/architecture/circles/0/1", json!(3)),
        ("/units/centre/0", json!(0.75)),
        ("/units/factors/1", json!(4.0)),
    ] {
        let mut edited: Value = serde_json::from_str(&text).expect("JSON");
        let number = edited.pointer_mut(place).unwrap_or_else(|| panic!("{place} in {text}"));
        assert_ne!(*number, value, "{place}");
        *number = value;
        let edited = edited.to_string();
        assert!(parse_model("m.json", edited.as_bytes()).is_err(), "{place}");
    }
}
