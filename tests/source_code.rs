//! Models as source code: C that gives the bits of the crate.

use gyroceptron::flow::Region;
use gyroceptron::io::{Provenance, SourceCode, SourceLanguage, StoredModel};
use gyroceptron::layer::{CircleAction, Neuron, Reversor, TorusAction};
use gyroceptron::network::{
    Architecture, Course, InitialWeights, LayerSizes, NamedArchitecture, NetworkSpec, Pace, Rollout,
};
use gyroceptron::phase::{AreaDensity, Direction, Section, Units};
use gyroceptron::random::Stream;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

const POINTS: usize = 4;

/// How far a model is rolled out: one of them far.
fn steps_of(name: &str) -> usize {
    if name == "on_section" { 1_000_000 } else { 7 }
}

fn stored(architecture: Architecture) -> StoredModel {
    let made = architecture.in_box(1.5).initialise(InitialWeights::Normal { scale: 0.3 }, 0.7, 3);
    let (units, section, provenance) = (None, None, Provenance::of_scene("test"));
    StoredModel { model: made.expect("sound"), units, section, provenance }
}

/// An architecture of small parts, if it can be of them and of so many dimensions, and all but `without` of those that
/// it has only if they are given.
fn small(
    named: &NamedArchitecture,
    action: &TorusAction,
    degree: Option<usize>,
    without: &[&str],
) -> Option<Architecture> {
    let mut spec = NetworkSpec::named(named.name).expect("it has this name");
    let no_slow_plane =
        (0..action.dof()).all(|j| action.circles().iter().any(|of| of.weights()[j] != 0));
    for (key, _) in named.sizes.iter().filter(|(key, _)| !without.contains(key)) {
        if *key == "turned_twists" && no_slow_plane {
            continue;
        }
        // Of polynomials of one number there is one in a layer.
        let width = if degree.is_some() && action.dof() == 1 { 1 } else { 3 };
        let sizes = LayerSizes { degree, ..LayerSizes::uniform(2, width) };
        spec = spec.with_size(key, sizes).expect("it has this part");
    }
    let made = spec.architecture(action, 0.05, 2.0).ok()?;
    made.clone().in_box(2.0).check().ok()?;
    Some(made)
}

/// Each architecture in one and two degrees of freedom, some in three, with tanh and with polynomials where it takes
/// them.
fn architectures() -> Vec<(String, Architecture)> {
    let mut out = Vec::new();
    for named in NamedArchitecture::ALL {
        // Three are for each kind of step in one of them.
        let most = if named.name == "normal-form" || named.name == "symp-net" { 3 } else { 2 };
        for dof in 1..=most {
            let weights: Vec<i32> = (0..dof).map(|j| 1 - j).collect();
            let action = CircleAction::new(weights).into();
            for (degree, kind) in [(None, "tanh"), (Some(5), "polynomials")] {
                if let Some(made) = small(named, &action, degree, &[]) {
                    out.push((format!("{}_{dof}_{kind}", named.name.replace('-', "_")), made));
                }
            }
        }
    }
    out
}

/// And what is none of an architecture alone: units, a box, a section, a reversor, several circles.
fn models() -> Vec<(String, StoredModel)> {
    let mut out: Vec<(String, StoredModel)> =
        architectures().into_iter().map(|(name, of)| (name, stored(of))).collect();
    let named = |name: &str| {
        NamedArchitecture::ALL.iter().find(|named| named.name == name).expect("it has this name")
    };
    let plane = CircleAction::new([1]).into();
    let normal_form = |action: &TorusAction, degree| {
        small(named("normal-form"), action, degree, &["psi", "perturbation"])
            .expect("it can be of this")
    };
    for reversor in [Reversor::Positions, Reversor::Momenta] {
        let made = normal_form(&plane, None).reversible(Some(reversor));
        out.push((format!("reversible_{reversor:?}"), stored(made)));
    }
    let mut of_arctan = normal_form(&CircleAction::new([1, 0]).into(), None);
    for block in &mut of_arctan.blocks {
        *block = block.clone().of_neurons(Neuron::Arctan);
    }
    out.push(("arctan".into(), stored(of_arctan)));
    let two = TorusAction::new(vec![CircleAction::new([1, 0, 0]), CircleAction::new([0, 0, -2])]);
    out.push(("two_circles".into(), stored(normal_form(&two.expect("circles"), None))));
    let units = Units::new(vec![0.1, 0.0, -0.3, 0.7], vec![1.5, 3.0, 0.8, 0.4]).expect("units");
    let mut in_units = stored(normal_form(&CircleAction::new([1, 0]).into(), Some(4)));
    in_units.units = Some(units);
    in_units.provenance.region =
        Some(Region { low: vec![-0.4; 4], high: vec![0.5, 1.0, 1.0, 1.0] });
    out.push(("in_units".into(), in_units));
    let density = |x: f64, y: f64| 2.0 + x * y + 0.3 * (x - y) * (x - y);
    let chart = AreaDensity::of_function(density, [-2.0, -2.5], [2.0, 2.5], 3.0).expect("a chart");
    let mut on_section = stored(normal_form(&plane, Some(4)));
    on_section.units = Some(Units::new(vec![0.05, -0.1], vec![1.2, 0.9]).expect("units"));
    on_section.section = Some(Section::of_plane(chart));
    out.push(("on_section".into(), on_section));
    out
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// What a program prints of a model, that the crate says too.
struct Answers {
    exact: Vec<u64>,
    tangent: Vec<f64>,
    /// Of a point, and of one four times as far out.
    inside: Vec<[bool; 2]>,
}

fn answers_of(name: &str, stored: &StoredModel, points: &[f64]) -> Answers {
    let dim = 2 * stored.model.composition().dof();
    let (mut exact, mut tangent, mut inside) = (Vec::new(), Vec::new(), Vec::new());
    let moved = |z: &[f64], direction, steps| {
        let (course, request) = (Course { direction, grid: None }, Rollout { steps, every: steps });
        let states = stored.rollout_along(course, z, request, &mut Pace::unbroken());
        states.expect("finite").states[z.len()..].to_vec()
    };
    for z in points.chunks_exact(dim) {
        for steps in [1, steps_of(name)] {
            exact.extend(bits(&moved(z, Direction::Forward, steps)));
            exact.extend(bits(&moved(z, Direction::Inverse, steps)));
        }
        exact.extend(stored.invariant().map(|of| of(z).to_bits()));
        let jacobian = stored.jacobians(z).expect("points");
        tangent.extend(jacobian.chunks_exact(dim).map(|row| {
            row.iter().enumerate().map(|(k, of)| (1.0 - 0.7 * k as f64) * of).sum::<f64>()
        }));
        let region = stored.provenance.region.as_ref();
        let is_inside = |z: &[f64]| {
            let mut image = z.to_vec();
            let moved = stored.map_points(Direction::Forward, &mut image).is_ok();
            let both = [z, &image];
            let in_region =
                region.is_none_or(|of| both.iter().all(|z| of.left_by(z, 1, 1).is_none()));
            moved
                && in_region
                && image.iter().all(|v| !v.is_nan())
                && stored.leaves_polynomials(z, 1, 1).is_none()
        };
        let far: Vec<f64> = z.iter().map(|v| 4.0 * v).collect();
        inside.push([is_inside(z), is_inside(&far)]);
    }
    Answers { exact, tangent, inside }
}

/// A program that moves points of each model and prints what becomes of them.
fn driver(all: &[(String, StoredModel, Vec<f64>)]) -> String {
    let mut out = String::from("#include <stdio.h>\n#include <string.h>\n#include <stdint.h>\n");
    let mut main = String::new();
    for (name, stored, points) in all {
        let dim = 2 * stored.model.composition().dof();
        let _ = writeln!(out, "#include \"{name}.h\"");
        let _ = writeln!(
            main,
            "    if (strcmp({name}_digest(), \"{}\")) return 1;",
            stored.digest().unwrap()
        );
        for z in points.chunks_exact(dim) {
            let list: Vec<String> = z.iter().map(|v| format!("{v:?}")).collect();
            let _ = writeln!(main, "    {{ const double at[{dim}] = {{{}}};", list.join(", "));
            let _ = writeln!(main, "    double z[{dim}], v[{dim}];");
            let then = |call: &str| {
                format!("    memcpy(z, at, sizeof z); {name}_{call}; print(z, {dim});\n")
            };
            main += &then("map(z)");
            main += &then("inverse(z)");
            main += &then(&format!("iterate(z, {})", steps_of(name)));
            main += &then(&format!("iterate(z, -{})", steps_of(name)));
            if stored.invariant().is_some() {
                let _ = writeln!(main, "    z[0] = {name}_invariant(at); print(z, 1);");
            }
            let _ = writeln!(
                main,
                "    for (int k = 0; k < {dim}; k++) {{ z[k] = at[k]; v[k] = 1.0 - 0.7 * k; }}\n    {name}_tangent(z, v); \
                 print(v, {dim});\n    print(z, {dim});\n    for (int k = 0; k < {dim}; k++) z[k] = 4 * at[k];\n    \
                 printf(\"%d\\n%d\\n\", {name}_is_inside(at), {name}_is_inside(z)); }}"
            );
        }
    }
    let _ = write!(
        out,
        "static void print(const double *z, int count) {{ for (int k = 0; k < count; k++) {{ uint64_t b; \
         memcpy(&b, z + k, 8); printf(\"%016llx\\n\", (unsigned long long)b); }} }}\n\
         int main(void) {{\n{main}    return 0;\n}}\n"
    );
    out
}

fn compiler() -> Option<&'static str> {
    let found = Command::new("cc").arg("--version").output().is_ok_and(|of| of.status.success());
    if !found {
        println!("no C compiler, cc, is here: the source code is not compiled");
    }
    found.then_some("cc")
}

fn compiled(folder: &Path, names: &[String], compiler: &str) {
    let sources = names.iter().map(|name| format!("{name}.c"));
    let done = Command::new(compiler)
        .current_dir(folder)
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-ffp-contract=off"])
        .args(sources)
        .args(["main.c", "-o", "program", "-lm"])
        .output();
    let done = done.expect("it runs");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
}

#[test]
fn c_gives_the_bits_of_the_crate() {
    let Some(compiler) = compiler() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let mut stream = Stream::new(5, "points");
    let all: Vec<(String, StoredModel, Vec<f64>)> = models()
        .into_iter()
        .map(|(name, stored)| {
            let dim = 2 * stored.model.composition().dof();
            let count = if steps_of(&name) > 1000 { 1 } else { POINTS };
            let points = (0..dim * count).map(|_| stream.uniform(-0.6, 0.6)).collect();
            (name, stored, points)
        })
        .collect();
    assert!(all.len() > 20, "{} models", all.len());
    for (name, stored, _) in &all {
        let code = SourceCode::generate(stored, SourceLanguage::C, name, None).expect("a map");
        code.write(&folder.path().join(format!("{name}.c"))).expect("files");
    }
    std::fs::write(folder.path().join("main.c"), driver(&all)).expect("a file");
    let names: Vec<String> = all.iter().map(|(name, ..)| name.clone()).collect();
    compiled(folder.path(), &names, compiler);
    let run = Command::new(folder.path().join("program")).output().expect("it runs");
    assert!(run.status.success());
    let text = String::from_utf8(run.stdout).expect("text");
    let mut lines = text.lines();
    let mut next = || u64::from_str_radix(lines.next().expect("a line"), 16).expect("bits");
    let (mut outside, mut within) = (0, 0);
    for (name, stored, points) in &all {
        let dim = 2 * stored.model.composition().dof();
        let answers = answers_of(name, stored, points);
        let (mut exact, mut tangent) = (answers.exact.iter(), answers.tangent.iter());
        let invariants = usize::from(stored.invariant().is_some());
        for inside in answers.inside {
            let image: Vec<u64> = (0..dim).map(|_| next()).collect();
            assert_eq!(exact.by_ref().take(dim).copied().collect::<Vec<_>>(), image, "{name}");
            for place in 0..3 * dim + invariants {
                assert_eq!(exact.next(), Some(&next()), "{name}: number {place}");
            }
            for _ in 0..dim {
                let (found, expected) = (f64::from_bits(next()), tangent.next().expect("as many"));
                let error = (found - expected).abs() / (1.0 + expected.abs());
                assert!(error < 1e-13, "{name}: {found} for {expected}");
            }
            for bits in image {
                assert_eq!(bits, next(), "{name}: the image of the tangent map");
            }
            for inside in inside {
                assert_eq!(next() == 1, inside, "{name}: is inside");
                if inside { within += 1 } else { outside += 1 }
            }
        }
    }
    assert_eq!(lines.next(), None);
    // Both answers are there.
    assert!(outside > 20 && within > 100, "{outside} points outside, {within} inside");
}

#[test]
fn what_is_no_name_is_refused() {
    let model = stored(architectures().swap_remove(0).1);
    for name in ["", "3d", "a-b", "é", "_a", "math", &"a".repeat(41)] {
        let error =
            SourceCode::generate(&model, SourceLanguage::C, name, None).expect_err("no name");
        assert!(error.to_string().contains("a letter"), "{error}");
    }
    assert!(SourceCode::generate(&model, SourceLanguage::C, "int", None).is_ok());
    for name in ["jax", "class", "my-map"] {
        let error =
            SourceCode::generate(&model, SourceLanguage::Jax, name, None).expect_err("no name");
        assert!(error.to_string().contains("Python imports"), "{error}");
    }
}

#[test]
fn fortran_calls_the_same_map() {
    let Some(compiler) = compiler() else { return };
    if !Command::new("gfortran").arg("--version").output().is_ok_and(|of| of.status.success()) {
        println!("no Fortran compiler, gfortran, is here: the interface is not compiled");
        return;
    }
    let (_, stored) = models().into_iter().find(|(name, _)| name == "in_units").expect("it");
    // As long as a name can be.
    let name = "in_units_".to_owned() + &"x".repeat(31);
    let folder = tempfile::tempdir().expect("a folder");
    let code = SourceCode::generate(&stored, SourceLanguage::C, &name, None).expect("a map");
    code.write(&folder.path().join(format!("{name}.c"))).expect("files");
    let program = "program main\n  use in_units_module\n  use, intrinsic :: iso_c_binding\n  implicit none\n  \
                   real(c_double) :: z(in_units_dim), v(in_units_dim), invariant\n  integer(c_int) :: inside\n  \
                   z = [0.1d0, 0.2d0, -0.3d0, 0.4d0]\n  invariant = in_units_invariant(z)\n  \
                   inside = in_units_is_inside(z)\n  call in_units_iterate(z, 5_c_long_long)\n  \
                   print '(z16.16)', z\n  call in_units_iterate(z, -4_c_long_long)\n  \
                   call in_units_inverse(z)\n  v = 1d0\n  call in_units_map(z)\n  \
                   call in_units_tangent(z, v)\n  print '(z16.16)', invariant\n  print '(i0)', inside\nend program\n";
    let program = program.replace("in_units", &name);
    std::fs::write(folder.path().join("main.f90"), program).expect("a file");
    let file = |ending: &str| format!("{name}.{ending}");
    let run = |command: &str, arguments: &[&str]| {
        let done = Command::new(command).current_dir(folder.path()).args(arguments).output();
        let done = done.expect("it runs");
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        String::from_utf8(done.stdout).expect("text")
    };
    run(compiler, &["-std=c99", "-O1", "-ffp-contract=off", "-c", &file("c")]);
    run(
        "gfortran",
        &["-Wall", "-Werror", &file("f90"), "main.f90", &file("o"), "-o", "program", "-lm"],
    );
    let text = run(&folder.path().join("program").display().to_string(), &[]);
    let z = [0.1, 0.2, -0.3, 0.4];
    let (course, request) = (Course::default(), Rollout { steps: 5, every: 5 });
    let states = stored.rollout_along(course, &z, request, &mut Pace::unbroken());
    let mut numbers = states.expect("finite").states[4..].to_vec();
    numbers.push(stored.invariant().expect("it has one")(&z));
    let mut expected: Vec<String> =
        bits(&numbers).iter().map(|bits| format!("{bits:016X}")).collect();
    expected.push("1".into());
    assert_eq!(text.split_whitespace().collect::<Vec<_>>(), expected);
}
