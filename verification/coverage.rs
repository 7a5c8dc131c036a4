//! Every public map is run by a law, every law runs the samples that it states,
//! and no file but `tolerances` decides what is small.

use crate::report::LAWS;
use crate::suite;
use crate::tolerances::ILL_CONDITIONED_SHARE as SHARE;
use crate::watched::laws_that_ran;
use gyroceptron::network::NamedArchitecture;
use std::path::{Path, PathBuf};

/// What makes a map of another, or of equations: `tests/own_maps.rs`.
const ADAPTORS: [&str; 10] = [
    "OneWay",
    "OneStep",
    "Steps",
    "WithDomain",
    "Solved",
    "InUnits",
    "StepMap",
    "KickMap",
    "TwistPart",
    "&M",
];
/// Of symplectic polynomials, which the law `fitted` runs with their inverses, as `PolynomialAndInverse`, and a mirror.
const FITTED: [&str; 2] = ["SymplecticPolynomial", "Mirror"];
/// The number types that a law runs on, or a test of `tests/` covers.
const NUMBERS: [(&str, &str); 11] = [
    ("f64", "symplecticity"),
    ("f32", "precision"),
    ("DoubleDouble", "precision"),
    ("Dual<S, N>", "gradients"),
    ("OnGrid<V, G>", "on_grid"),
    ("Lanes", "evaluation"),
    ("Ymm", "evaluation"),
    ("Zmm", "evaluation"),
    ("Pair", "evaluation"),
    ("Tracked", "gradients"),
    ("Traced", "evaluation"),
];

fn sources(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
}

/// The types that `text` implements `of` for.
fn implementors(text: &str, of: &str) -> Vec<String> {
    let needle = format!("{of} for ");
    text.lines()
        .filter(|line| line.trim_start().starts_with("impl"))
        .filter_map(|line| line.split_once(&needle))
        .map(|(_, name)| name.split(['<', ' ', '{']).next().unwrap_or("").to_owned())
        .collect()
}

fn all(of: &str) -> Vec<String> {
    let mut files = Vec::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut files);
    let mut out: Vec<String> = files
        .iter()
        .flat_map(|file| implementors(&std::fs::read_to_string(file).expect("a source"), of))
        .collect();
    out.sort();
    out.dedup();
    out
}

#[test]
fn every_map_is_run_by_a_law() {
    suite::at_once(&LAWS, |law| (law.rows)().len());
    let mut maps = all("Map<S>");
    maps.extend(all("Map<f64>"));
    assert!(maps.len() > ADAPTORS.len() + 4, "{maps:?}");
    // A model is run by the name of its architecture.
    maps.retain(|name| name != "Model");
    maps.extend(NamedArchitecture::ALL.iter().map(|named| named.name.to_owned()));
    for name in FITTED {
        assert!(maps.iter().any(|map| map == name), "{name}");
    }
    let laws = laws_that_ran("PolynomialAndInverse");
    assert!(laws.contains(&"fitted"), "{laws:?}");
    let mirrored = crate::fitted::rows().iter().find(|row| row.law.starts_with("mirror"));
    assert!(mirrored.is_some_and(|row| row.samples > row.ill_conditioned), "{mirrored:?}");
    maps.retain(|map| !FITTED.contains(&&**map));
    for name in maps.iter().filter(|name| !ADAPTORS.contains(&name.as_str())) {
        let laws = laws_that_ran(name);
        println!("{name}: {laws:?}");
        assert!(
            laws.iter().any(|law| LAWS.iter().any(|known| known.file == *law)),
            "{name}: {laws:?}"
        );
    }
}

#[test]
fn every_number_has_a_law() {
    for name in all("Scalar") {
        let known = NUMBERS.iter().any(|(number, _)| number.split('<').next() == Some(&name));
        assert!(known, "{name} has no law");
    }
    for (_, law) in NUMBERS {
        assert!(LAWS.iter().any(|known| known.file == law), "no law {law}");
    }
}

#[test]
fn the_scanner_sees_a_map_without_a_law() {
    let text = "impl<P: Scalar, S: Over<P>> Map<S> for Unrun<P> {\n  fn x() {}\n}";
    assert_eq!(implementors(text, "Map<S>"), ["Unrun"]);
    assert!(laws_that_ran("Unrun").is_empty());
    assert!(implementors("// impl Map<S> for Comment", "Map<S>").is_empty());
}

#[test]
fn every_law_runs_the_samples_it_states() {
    for law in LAWS {
        let rows = (law.rows)();
        assert!(!rows.is_empty(), "{}", law.file);
        for row in rows {
            // One number for all networks, or for a million steps.
            let drift = row.law.starts_with("drift of the actions");
            let single = row.equation.ends_with("median") || drift;
            let stated = if single { 1 } else { law.stated * suite::times() };
            let testable = row.samples - row.ill_conditioned;
            let enough = row.samples >= stated && testable as f64 >= (1.0 - SHARE) * stated as f64;
            assert!(enough, "{}: {testable} for {stated}: {row:?}", law.file);
        }
    }
}

/// Every file of this folder is part of the suite.
#[test]
fn no_file_is_left_out() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("verification");
    let main = std::fs::read_to_string(folder.join("main.rs")).expect("main.rs");
    let mut files = Vec::new();
    sources(&folder, &mut files);
    for file in files {
        let stem = file.file_stem().expect("a name").to_string_lossy().into_owned();
        assert!(stem == "main" || main.contains(&format!("mod {stem};")), "{stem}");
    }
}

/// The conformance page names laws and tests that there are, and all laws.
#[test]
fn the_conformance_page_names_what_there_is() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("src/conformance.md")).expect("the page");
    let named: Vec<&str> = page.split('`').filter(|word| word.ends_with(".rs")).collect();
    assert!(named.len() > 30, "{}", named.len());
    for name in &named {
        let path =
            if name.contains('/') { name.to_string() } else { format!("verification/{name}") };
        assert!(root.join(&path).exists(), "{path}");
    }
    let unnamed = [
        "blocks",
        "determinant",
        "evaluation",
        "exact_relations",
        "fitted",
        "nearly_integrable",
        "normal_form",
        "on_grid",
        "polynomials",
        "precision",
        "reversible",
        "symp_net",
        "torus",
    ];
    for law in LAWS {
        let known = named.contains(&format!("{}.rs", law.file).as_str());
        // Laws of the computation, which the paper has no word of.
        assert!(known || unnamed.contains(&law.file), "{}", law.file);
    }
}

/// The lines of `text` on which something is compared with a number that is no
/// whole one and not zero.
fn thresholds(text: &str) -> Vec<&str> {
    let decimal = |word: &str| {
        let word = word.trim_start_matches('-').replace('_', "");
        let number = word.parse::<f64>().is_ok_and(|value| value != 0.0);
        number && (word.contains('.') || word.contains('e'))
    };
    let compares = |line: &&str| {
        let code = line.split("//").next().unwrap_or("").replace("\\\"", "");
        let code = code.split('"').step_by(2).collect::<Vec<_>>().join(" ");
        let mut after =
            [" < ", " > ", " <= ", " >= "].iter().flat_map(|sign| code.split(sign).skip(1));
        let first = |rest: &str| {
            let end = |c: char| !(c.is_ascii_alphanumeric() || "._-".contains(c));
            decimal(rest.split(end).next().unwrap_or(""))
        };
        after.any(first)
    };
    text.lines().filter(compares).collect()
}

#[test]
fn no_other_file_holds_a_threshold() {
    let mut files = Vec::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("verification"), &mut files);
    for file in files.iter().filter(|file| !file.ends_with("tolerances.rs")) {
        let text = std::fs::read_to_string(file).expect("a source");
        assert_eq!(thresholds(&text), Vec::<&str>::new(), "{}", file.display());
    }
}

#[test]
fn the_scanner_sees_a_threshold() {
    for line in [
        "assert!(error < 1e-15, \"{error}\");",
        "let fine = a > -0.5 && b;",
        "error <= 4.0 * f64::unit_roundoff()",
        "if x >= 1_000.5 {",
    ] {
        assert_eq!(thresholds(line), [line]);
    }
    for line in [
        "assert!(error < tolerances::RATIO, \"{error} < 1e-3\");",
        "assert!(largest > 0.0 && count >= 5);",
        "// an error < 1e-15",
        "fn f() -> f64 { 1e-3 }",
    ] {
        assert!(thresholds(line).is_empty(), "{line}");
    }
}
