//! Every public map has a law, and every law runs the samples that it states.

use crate::report::LAWS;
use crate::suite;
use crate::tolerances::ILL_CONDITIONED_SHARE as SHARE;
use std::path::{Path, PathBuf};

/// The maps of the crate, and the law file that runs them.
const MAPS: [(&str, &str); 7] = [
    ("HenonMap", "inversion"),
    ("HenonLayer", "inversion"),
    ("Rotation", "inversion"),
    ("Composition", "evaluation"),
    ("HenonNet", "symplecticity"),
    ("Gyroceptron", "near_periodicity"),
    ("Model", "symplecticity"),
];
/// What makes a map of another.
const ADAPTORS: [&str; 1] = ["OneStep"];
/// The number types that a law runs on, or a test of `tests/` covers.
const NUMBERS: [(&str, &str); 9] = [
    ("f64", "symplecticity"),
    ("f32", "precision"),
    ("DoubleDouble", "precision"),
    ("Dual<S, N>", "gradients"),
    ("Lanes", "evaluation"),
    ("Ymm", "evaluation"),
    ("Zmm", "evaluation"),
    ("Pair", "evaluation"),
    ("Tracked", "gradients"),
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
fn every_map_has_a_law() {
    let known = |name: &str| MAPS.iter().any(|(map, _)| *map == name) || ADAPTORS.contains(&name);
    let maps = all("Map<S>");
    assert!(maps.len() >= MAPS.len(), "{maps:?}");
    for name in &maps {
        assert!(known(name), "{name} has no law");
    }
    for (map, law) in MAPS {
        assert!(maps.iter().any(|name| name == map), "{map} is no map any more");
        assert!(LAWS.iter().any(|own| own.file == law), "{map}: no law {law}");
        let file = format!("{}/verification/{law}.rs", env!("CARGO_MANIFEST_DIR"));
        assert!(Path::new(&file).exists(), "{file}");
    }
}

#[test]
fn every_number_has_a_law() {
    for name in all("Scalar") {
        let known = NUMBERS.iter().any(|(number, _)| number.split('<').next() == Some(&name));
        assert!(known, "{name} has no law");
    }
    for (_, law) in NUMBERS {
        assert!(LAWS.iter().any(|own| own.file == law), "no law {law}");
    }
}

#[test]
fn the_scanner_sees_a_map_without_a_law() {
    let text = "impl<P: Scalar, S: Over<P>> Map<S> for SympNet<P> {\n  fn x() {}\n}";
    assert_eq!(implementors(text, "Map<S>"), ["SympNet"]);
    assert!(!MAPS.iter().any(|(map, _)| *map == "SympNet"));
    assert!(implementors("// impl Map<S> for Comment", "Map<S>").is_empty());
}

#[test]
fn every_law_runs_the_samples_it_states() {
    for law in LAWS {
        let rows = (law.rows)();
        assert!(!rows.is_empty(), "{}", law.file);
        for row in rows {
            // One number for all networks.
            let single = row.equation.ends_with("median");
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
    let unnamed = ["determinant", "evaluation", "exact_relations", "precision"];
    for law in LAWS {
        let known = named.contains(&format!("{}.rs", law.file).as_str());
        // Laws of the computation, which the paper has no word of.
        assert!(known || unnamed.contains(&law.file), "{}", law.file);
    }
}
