//! The rooms of the house: modules import upwards in the reading order of the crate's page, and the
//! files of a module do not import one another in circles.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

fn source(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src").join(path)
}

fn files(folder: &Path, out: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> =
        std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files(&path, out);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            out.push(path);
        }
    }
}

/// The text without comments.
fn code(path: &Path) -> String {
    let text = std::fs::read_to_string(path).expect("a source");
    text.lines().map(|line| line.split("//").next().unwrap_or("").to_owned() + "\n").collect()
}

/// The modules in the order of the list "Where things are" of the crate's page.
fn reading_order() -> Vec<String> {
    let page = std::fs::read_to_string(source("lib.rs")).expect("the page");
    let list = page.split("# Where things are").nth(1).expect("the list");
    let list = list.split("//! # ").next().expect("up to the next heading");
    let items = list.lines().filter_map(|line| line.strip_prefix("//! - "));
    let name = |item: &str| {
        let start = item.find('`')? + 1;
        let end = start + item[start..].find('`')?;
        Some(item[start..end].to_owned())
    };
    items.map_while(name).collect()
}

/// What each module imports of those that the list has behind it.
fn downward(order: &[String], module: &str, text: &str) -> Vec<String> {
    let place = |name: &str| order.iter().position(|own| own == name);
    let own = place(module).expect("a module of the list");
    let names = text.split("crate::").skip(1).map(|rest| {
        let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
        rest[..end].to_owned()
    });
    names.filter(|name| place(name).is_some_and(|other| other > own)).collect()
}

#[test]
fn modules_import_in_reading_order() {
    let order = reading_order();
    assert!(order.len() >= 11, "{order:?}");
    for module in &order {
        let folder = source(module);
        let mut all = Vec::new();
        match folder.is_dir() {
            true => files(&folder, &mut all),
            false => all.push(source(&format!("{module}.rs"))),
        }
        for file in all {
            let found = downward(&order, module, &code(&file));
            assert!(found.is_empty(), "{}: {found:?} come later", file.display());
        }
    }
}

#[test]
fn an_import_against_the_order_is_seen() {
    let order = reading_order();
    assert_eq!(downward(&order, "layer", "use crate::train::Fit;"), ["train"]);
    assert!(downward(&order, "train", "use crate::layer::Kick;").is_empty());
}

/// The files of a module, `study::training` for one in a folder of its own, and which others each
/// imports by `super::` paths.
fn imports(module: &str) -> BTreeMap<String, BTreeSet<String>> {
    let folder = source(module);
    let mut all = Vec::new();
    files(&folder, &mut all);
    let name = |path: &Path| {
        let inner = path.strip_prefix(&folder).expect("inside").with_extension("");
        let parts: Vec<_> = inner.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        parts.join("::").trim_end_matches("::mod").to_owned()
    };
    let names: BTreeSet<String> = all.iter().map(|path| name(path)).collect();
    let mut out = BTreeMap::new();
    for path in &all {
        let own = name(path);
        if own == "mod" {
            continue;
        }
        let parent: Vec<&str> = own.split("::").collect();
        let mut imported = BTreeSet::new();
        for used in code(path).split("use super::").skip(1) {
            let used = used.split(';').next().unwrap_or("").replace(char::is_whitespace, "");
            let ups = used.matches("super::").count();
            let used = used.trim_start_matches("super::");
            let Some(depth) = parent.len().checked_sub(ups + 1) else { continue };
            let first = used.trim_start_matches('{').split([':', ',', '{']).next().unwrap_or("");
            let full = [&parent[..depth], &[first]].concat().join("::");
            if names.contains(&full) && full != own {
                imported.insert(full);
            }
        }
        out.insert(own, imported);
    }
    out
}

/// The files from which one comes back to themselves along imports.
fn circles(imports: &BTreeMap<String, BTreeSet<String>>) -> BTreeSet<String> {
    let reached = |start: &String| {
        let mut seen = BTreeSet::new();
        let mut next: Vec<&String> = imports[start].iter().collect();
        while let Some(file) = next.pop() {
            if seen.insert(file.clone()) {
                next.extend(imports.get(file).into_iter().flatten());
            }
        }
        seen
    };
    imports.keys().filter(|file| reached(file).contains(*file)).cloned().collect()
}

/// Modules whose files import each other in circles still: none of the others may begin to, and those
/// here leave the list when the last circle is opened.
const WITH_CIRCLES: [&str; 3] = ["measure", "train", "scene"];

#[test]
fn files_import_in_no_circles() {
    for module in [
        "cli", "flow", "io", "layer", "measure", "network", "phase", "scalar", "scene", "system",
        "train",
    ] {
        let found = circles(&imports(module));
        let known = WITH_CIRCLES.contains(&module);
        assert_eq!(!found.is_empty(), known, "{module}: {found:?}");
    }
}

#[test]
fn a_circle_is_seen() {
    let graph = |edges: &[(&str, &str)]| {
        let mut out: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (from, to) in edges {
            out.entry((*from).into()).or_default().insert((*to).into());
            out.entry((*to).into()).or_default();
        }
        out
    };
    assert!(circles(&graph(&[("a", "b"), ("b", "c"), ("a", "c")])).is_empty());
    let found = circles(&graph(&[("a", "b"), ("b", "c"), ("c", "b")]));
    assert_eq!(found.into_iter().collect::<Vec<_>>(), ["b", "c"]);
}
