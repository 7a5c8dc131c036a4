//! Maps that are reversible for all weights.

use gyroceptron::flow::Pairs;
use gyroceptron::io::{Provenance, StoredModel, model_text, parse_model};
use gyroceptron::layer::{CircleAction, Reversor, TorusAction};
use gyroceptron::measure::{
    OneStep,
    certificate::{CertificateOptions, Verdict, certify, certify_map, certify_reversible},
};
use gyroceptron::network::{
    Architecture, Block, InitialWeights, LayerSizes, Layers, Model, NetworkSpec, Part, Rollout,
    Scale, Structure,
};
use gyroceptron::phase::{InUnits, Map};
use gyroceptron::scalar::{Elementary, max_or_nan};
use gyroceptron::train::{Fit, FitNote, ReversalDefect};

fn options() -> CertificateOptions {
    CertificateOptions { samples: 30, ..Default::default() }
}

/// Of two planes, the first of which turns.
fn on_circle(reversor: Reversor) -> Architecture {
    Architecture::new(2)
        .on_circle(CircleAction::new([1, 0]))
        .at_epsilon(0.3)
        .of_time(0.7)
        .reversible(Some(reversor))
}

fn chart() -> Block {
    Block::new(Part::Chart, Layers::TurnedKick(vec![3, 2]))
}

/// One of each structure, by each reflection.
fn arrangements() -> Vec<(&'static str, Architecture, Structure)> {
    let twist = |widths: &[usize]| Block::new(Part::SlowMap, Layers::Twist(widths.to_vec()));
    let turned = || Block::new(Part::SlowMap, Layers::TurnedTwist(vec![2])).named("turned");
    let of = |reversor: Reversor| {
        let [plain, plane] =
            [2, 1].map(|dof| Architecture::new(dof).reversible(Some(reversor)).at_epsilon(0.3));
        vec![
            ("a chart", on_circle(reversor).with(chart()), Structure::Mixed),
            (
                "a slow map that is mirrored",
                on_circle(reversor).with(chart()).with(twist(&[2, 3])).with(turned()),
                Structure::Mixed,
            ),
            (
                "a twist of the action alone, and a perturbation",
                plane
                    .on_circle(CircleAction::new([1]))
                    .with(twist(&[3]).scaled(Scale::Time))
                    .with(Block::new(Part::Perturbation, Layers::TurnedKick(vec![3, 2]))),
                Structure::NearlyIntegrable,
            ),
            (
                "polynomials of two actions",
                on_circle(reversor)
                    .on_circle(CircleAction::new([0, 1]))
                    .with(chart().of_polynomials(5).in_box(4.0))
                    .with(twist(&[3]).of_polynomials(4).in_box(4.0).scaled(Scale::Time)),
                Structure::NearlyIntegrable,
            ),
            (
                "Hénon layers",
                plain.with(Block::new(Part::None, Layers::Henon(vec![3, 4]))),
                Structure::Plain,
            ),
        ]
    };
    Reversor::ALL.into_iter().flat_map(of).collect()
}

fn model(architecture: &Architecture) -> Model {
    let weights = InitialWeights::Normal { scale: 0.3 };
    architecture.initialise(weights, 1.1, 5).expect("a sound architecture")
}

fn start(dof: usize) -> Vec<f64> {
    [0.7, -0.4, 0.3, 0.9][..2 * dof].to_vec()
}

/// The largest component of S∘P∘S∘P(z) − z.
fn defect(map: &impl Map<f64>, reversor: Reversor, z: &[f64]) -> f64 {
    let mut w = z.to_vec();
    for _ in 0..2 {
        map.forward(&mut w);
        reversor.apply(&mut w);
    }
    w.iter().zip(z).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan)
}

/// By the definition, of each of the structures; the certificate says so, and by which reflection.
#[test]
fn a_reversor_makes_a_map_reversible_for_all_weights() {
    for (name, architecture, structure) in arrangements() {
        let reversor = architecture.reversor.expect("one");
        assert_eq!(architecture.structure(), structure, "{name}");
        let reversible = model(&architecture);
        let z = start(architecture.dof);
        let found = defect(&reversible, reversor, &z);
        assert!(found < 1e-14, "{name}: {found:e}");
        // And at another flow time and another ε.
        let other = reversible.with_epsilon_and_time(0.1, 3.0).expect("a member of the family");
        let found = defect(&other, reversor, &z);
        assert!(found < 1e-14, "{name}: {found:e}");
        let certificate = certify(&reversible, options());
        assert!(certificate.holds(), "{name}: {certificate}");
        let row = certificate.rows.iter().find(|row| row.law == "reversibility");
        assert!(row.expect("a row").equation.ends_with(reversor.equation()), "{name}");

        // Not by the other reflection, and not without.
        let of_other = Reversor::ALL[usize::from(reversor == Reversor::Positions)];
        assert!(defect(&reversible, of_other, &z) > 1e-3, "{name}");
        let plain = architecture.clone().reversible(None);
        let plain = plain.check().map(|()| model(&plain)).expect("sound without one");
        assert!(defect(&plain, reversor, &z) > 1e-3, "{name}");
        assert_eq!(plain.parameters(), reversible.parameters(), "{name}");
    }
}

/// P = A∘Φ_θ∘T∘S∘A⁻¹∘S by its parts, and a point that S keeps goes where its way back goes,
/// mirrored.
#[test]
fn a_reversible_map_is_its_parts() {
    for (name, architecture, _) in arrangements() {
        let (reversor, dof) = (architecture.reversor.expect("one"), architecture.dof);
        let reversible = model(&architecture);
        let slow = architecture.circles.iter().all(|circle| circle.weights()[dof - 1] == 0);
        let mirrors_slow_map = architecture.has_circle() && slow && dof > 1;
        let halved = architecture.clone().of_time(architecture.flow_time / 2.0);
        let half = Model::new(halved, reversible.parameters().to_vec()).expect("as many");
        let slow_map = match mirrors_slow_map {
            true => half.part(Part::SlowMap),
            false => reversible.part(Part::SlowMap),
        };
        let parts = [Part::Perturbation, Part::Chart, Part::None].map(|part| reversible.part(part));
        let mut z = start(dof);
        reversor.apply(&mut z);
        parts.iter().rev().for_each(|part| part.inverse(&mut z));
        if mirrors_slow_map {
            slow_map.inverse(&mut z);
        }
        reversor.apply(&mut z);
        if !mirrors_slow_map {
            slow_map.forward(&mut z);
        }
        if let Some(action) = architecture.action() {
            action.turn_by(reversible.angles()).apply(&mut z, false);
        }
        if mirrors_slow_map {
            slow_map.forward(&mut z);
        }
        parts.iter().for_each(|part| part.forward(&mut z));
        let mut whole = start(dof);
        reversible.forward(&mut whole);
        assert_eq!(whole, z, "{name}");

        let mut kept = start(dof);
        for j in 0..dof {
            kept[reversor.half().index(dof, j)] = 0.0;
        }
        let (mut ahead, mut back) = (kept.clone(), kept);
        reversible.forward(&mut ahead);
        reversible.inverse(&mut back);
        reversor.apply(&mut back);
        let apart = ahead.iter().zip(&back).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
        assert!(apart < 1e-14, "{name}: {apart:e}");
        // Trajectories are those of the map.
        let request = Rollout { steps: 3, every: 3 };
        let rolled = reversible.rollout(&start(dof), request).expect("finite");
        let mut stepped = start(dof);
        (0..3).for_each(|_| reversible.forward(&mut stepped));
        assert_eq!(rolled[2 * dof..], stepped, "{name}");
    }
}

/// A drift between two kicks (`Some`), which is reversible by the momenta, or a kick and a drift.
struct Pendulum {
    step: f64,
    symmetric: bool,
}

impl Pendulum {
    fn kick<S: Elementary>(&self, z: &mut [S], times: f64) {
        let share = if self.symmetric { 0.5 } else { 1.0 };
        z[1] -= S::from_f64(times * share * self.step) * z[0].sin_cos().0;
    }
}

impl<S: Elementary> Map<S> for Pendulum {
    fn dof(&self) -> usize {
        1
    }
    fn forward(&self, z: &mut [S]) {
        self.kick(z, 1.0);
        z[0] += S::from_f64(self.step) * z[1];
        if self.symmetric {
            self.kick(z, 1.0);
        }
    }
    fn inverse(&self, z: &mut [S]) {
        if self.symmetric {
            self.kick(z, -1.0);
        }
        z[0] -= S::from_f64(self.step) * z[1];
        self.kick(z, -1.0);
    }
}

/// The law is one of any map: an integrator that is symmetric has it, and its first-order relative,
/// which is as symplectic, has not.
#[test]
fn reversibility_is_a_law_of_maps_of_your_own() {
    for symmetric in [true, false] {
        let map = OneStep(Pendulum { step: 0.4, symmetric });
        assert!(certify_map(&map, options()).holds());
        let certificate = certify_reversible(&map, Reversor::Momenta, options());
        assert_eq!(certificate.holds(), symmetric, "{certificate}");
        let row = certificate.rows.iter().find(|row| row.law == "reversibility").expect("a row");
        assert_eq!(row.verdict == Verdict::Holds, symmetric, "{row:?}");
        // It is even in q: −S is a reversor where S is.
        let other = certify_reversible(&map, Reversor::Positions, options());
        assert_eq!(other.holds(), symmetric, "{other}");
    }
}

/// Parts that would make a map that is not reversible are refused, by name.
#[test]
fn what_is_not_reversible_is_refused() {
    let of = on_circle(Reversor::Positions);
    let henon = || Layers::Henon(vec![3]);
    let plain = Architecture::new(1).reversible(Some(Reversor::Momenta));
    let cases = [
        (of.clone().with(Block::new(Part::Conjugation, henon())), "ψ∘S∘ψ⁻¹"),
        (of.clone().with(Block::new(Part::NearIdentity, henon())), "a chart ψ_ε in place of I_ε"),
        (of.clone().with(Block::new(Part::None, henon())), "no map R beside circles"),
        (of.clone().with(chart().scaled(Scale::None)), "a scale with ε"),
        (plain.with(Block::new(Part::Chart, henon())), "a circle action"),
    ];
    for (architecture, word) in cases {
        let text = architecture.check().expect_err("refused").to_string();
        assert!(text.contains(word), "{text}: {word}");
    }
    // Blocks without layers are no map.
    of.with(Block::new(Part::Conjugation, Layers::Henon(vec![]))).check().expect("sound");
}

#[test]
fn reversors_are_declared_by_name() {
    let action = TorusAction::from(CircleAction::new([1, 0]));
    let text = "kind = \"normal-form\"\nreversor = \"momenta\"\n";
    let spec: NetworkSpec = toml::from_str(text).expect("a network");
    let architecture = spec.architecture(&action, 0.1, 2.0).expect("sound");
    assert_eq!(architecture.reversor, Some(Reversor::Momenta));
    assert_eq!(architecture.name(), Some("normal-form"));
    architecture.check().expect("sound");
    // With a perturbation its twists are of order one, and its chart is not.
    let sizes = LayerSizes::uniform(0, 1);
    let nearly = spec.with_size("perturbation", sizes).expect("it has this part");
    let nearly = nearly.architecture(&action, 0.1, 2.0).expect("sound");
    nearly.check().expect("sound");
    assert_eq!(nearly.structure(), Structure::NearlyIntegrable);
    assert!(nearly.is_of_order_one());
    assert_eq!(nearly.blocks[1].scale, Scale::Epsilon);

    let gyroceptron = NetworkSpec::named("gyroceptron").expect("a name");
    let with = gyroceptron.reversible(Reversor::Positions).expect("a kind that has one");
    let refused = with.architecture(&action, 0.1, 2.0).and_then(|of| of.check()).expect_err("ψ");
    assert!(refused.to_string().contains("psi"), "{refused}");
    let file = NetworkSpec { kind: "file".into(), ..NetworkSpec::default() };
    let refused = file.reversible(Reversor::Positions).expect_err("that of the file").to_string();
    assert!(refused.contains("positions"), "{refused}");
    assert!(Reversor::find("mirror").expect_err("none").to_string().contains("momenta"));

    for (name, architecture, _) in arrangements() {
        let (units, section) = (None, None);
        let of = model(&architecture);
        let stored = StoredModel {
            model: of.clone(),
            units,
            section,
            provenance: Provenance::of_scene("test"),
        };
        let text = model_text(&stored).expect("finite");
        let back = parse_model("m.json", text.as_bytes()).expect("as written").model;
        assert_eq!(back.architecture(), &architecture, "{name}");
        assert_eq!(back.parameters(), of.parameters(), "{name}");
        let other = text.replace("\"reversor\": \"", "\"reversor\": \"other-");
        assert_ne!(text, other, "{name}");
        let refused = parse_model("m.json", other.as_bytes()).expect_err("no such reversor");
        assert!(refused.to_string().contains("positions"), "{refused}");
    }
}

/// What is said of pairs and a reversor.
fn reversals(fit: &Fit, pairs: &Pairs) -> Vec<ReversalDefect> {
    let problem = fit.prepare(pairs.clone()).expect("pairs that it can be fitted to");
    let of = |note: &FitNote| match note {
        FitNote::Reversal(defect) => {
            assert!(note.to_string().contains(defect.reversor.equation()), "{note}");
            Some(*defect)
        }
        _ => None,
    };
    problem.notes.iter().filter_map(of).collect()
}

/// What both fits have in common, such as errors of the pairs, is no sign of another map.
#[test]
fn little_of_the_motion_is_no_other_map() {
    let of = |median: f64, resolution: f64| {
        ReversalDefect { reversor: Reversor::Positions, median, resolution }.is_seen()
    };
    assert!(!of(0.9e-9, 1e-13) && of(1.1e-9, 1e-13));
    assert!(!of(4.9e-6, 1e-6) && of(5.1e-6, 1e-6));
    assert!(of(f64::NAN, 1e-6));
}

/// Pairs that are reversible are recognised where a network could be so without giving up an
/// invariant, and those that are not where it is so.
#[test]
fn pairs_are_asked_whether_they_are_reversible() {
    let pairs_of = |map: &Pendulum, bias: f64| {
        let [mut input, mut output] = [Vec::new(), Vec::new()];
        for i in 0..24 {
            for j in 0..24 {
                let mut z = [0.04 * f64::from(i) - 0.46, 0.04 * f64::from(j) - 0.46];
                input.extend(z);
                (0..8).for_each(|_| map.forward(&mut z));
                output.extend([z[0], z[1] + bias * z[0] * z[0]]);
            }
        }
        Pairs::new("pendulum", 1, input, output).expect("whole")
    };
    let network = |kind: &str, reversor: Option<Reversor>| {
        let network = NetworkSpec::named(kind).expect("a name");
        let network = match reversor {
            Some(reversor) => network.reversible(reversor).expect("a kind that has one"),
            None => network,
        };
        let action = Some(TorusAction::from(CircleAction::new([1])));
        Fit { network: Some(network), action, ..Fit::default() }
    };
    let sound = pairs_of(&Pendulum { step: 0.1, symmetric: true }, 0.0);
    // Euler's method is not reversible by S, and neither is a kick behind a map that is.
    let euler = pairs_of(&Pendulum { step: 0.1, symmetric: false }, 0.0);
    let biased = pairs_of(&Pendulum { step: 0.1, symmetric: true }, 1e-3);
    let henon = network("henon-net", None);
    let [defect] = reversals(&henon, &sound)[..] else { panic!("a reversor is found") };
    assert!(!defect.is_seen() && defect.median < 1e-6, "{defect:?}");
    let text = defect.to_string();
    assert!(
        text.contains("\"positions\"") && text.contains("uses each of its kicks twice"),
        "{text}"
    );
    assert_eq!(reversals(&henon, &euler), []);
    assert_eq!(reversals(&henon, &biased), []);
    // A normal form has exact invariants, which it is not asked to give up.
    assert_eq!(reversals(&network("normal-form", None), &sound), []);
    for reversor in Reversor::ALL {
        let reversible = network("normal-form", Some(reversor));
        assert_eq!(reversals(&reversible, &sound), []);
        for pairs in [&euler, &biased] {
            let [defect] = reversals(&reversible, pairs)[..] else { panic!("it is seen") };
            assert!(defect.is_seen() && defect.reversor == reversor, "{defect:?}");
            assert!(defect.median > 1e-5 && defect.median < 1.0, "{defect:?}");
            let text = defect.to_string();
            assert!(text.contains("is S the right reflection?"), "{text}");
        }
    }
    // Where the mirrored points are not among those of the pairs, nothing is known.
    let above = sound.input().chunks_exact(2).zip(sound.output().chunks_exact(2)).enumerate();
    let is = |z: &[f64]| z[0] > 0.05 && z[1] > 0.05;
    let rows = above.filter(|(_, (z, w))| is(z) && is(w)).map(|(row, _)| row);
    assert_eq!(reversals(&henon, &sound.rows(rows.collect::<Vec<_>>())), []);
}

/// Pairs of half a plane, in units that are none of a network: the reflection is that of the data,
/// and a map that is fitted has it everywhere.
#[test]
fn a_fit_is_reversible_in_the_coordinates_of_the_data() {
    let map = Pendulum { step: 0.1, symmetric: true };
    let scale = [20.0, 30.0];
    let [mut input, mut output] = [Vec::new(), Vec::new()];
    for i in 0..24 {
        for j in 1..=12 {
            let mut z = [0.04 * f64::from(i) - 0.46, 0.04 * f64::from(j)];
            input.extend([scale[0] * z[0], scale[1] * z[1]]);
            (0..8).for_each(|_| map.forward(&mut z));
            output.extend([scale[0] * z[0], scale[1] * z[1]]);
        }
    }
    let pairs = Pairs::new("pendulum", 1, input, output).expect("whole");
    let degree =
        |count, degree| LayerSizes { degree: Some(degree), ..LayerSizes::uniform(count, 1) };
    let network = NetworkSpec::named("normal-form").expect("a name");
    let sizes = [
        ("kicks", degree(3, 6)),
        ("twists", degree(1, 4)),
        ("perturbation", LayerSizes::uniform(0, 1)),
    ];
    let network = sizes
        .into_iter()
        .try_fold(network, |network, (key, size)| network.with_size(key, size))
        .and_then(|network| network.reversible(Reversor::Momenta))
        .expect("it has these parts");
    let mut fit = Fit { network: Some(network), epsilon: Some(1.0), ..Fit::default() };
    fit.action = Some(TorusAction::from(CircleAction::new([1])));
    fit.training.iterations = 60;
    assert_eq!(reversals(&fit, &pairs), []);
    let fitted = fit.run(pairs.clone()).expect("it trains");
    let (model, units) = (fitted.model(), fitted.problem.units.as_ref());
    let units = units.expect("the data is large");
    assert_eq!(units.centre()[1], 0.0);
    let mut error = 0.0;
    for (z, w) in pairs.input().chunks_exact(2).zip(pairs.output().chunks_exact(2)) {
        let in_data = InUnits { map: model, units };
        let mut image = z.to_vec();
        in_data.forward(&mut image);
        let apart = |k: usize| (image[k] - w[k]).abs() / scale[k];
        error = max_or_nan(error, max_or_nan(apart(0), apart(1)));
        assert!(defect(&in_data, Reversor::Momenta, z) < 1e-11);
    }
    assert!(error < 1e-6, "{error:e}");
    // The half that was not seen is that which was, backwards.
    let in_data = InUnits { map: model, units };
    let (mut unseen, mut truth) = ([4.0, -9.0], [0.2, -0.3]);
    in_data.forward(&mut unseen);
    (0..8).for_each(|_| map.forward(&mut truth));
    for k in 0..2 {
        assert!((unseen[k] / scale[k] - truth[k]).abs() < 1e-5, "{unseen:?}, {truth:?}");
    }
}
