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
    let all = paths(text).into_iter().filter(|path| path.starts_with("crate::"));
    let names = all.filter_map(|path| path.split("::").nth(1).map(ToOwned::to_owned));
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
    for import in
        ["use crate::train::Fit;", "use crate::{train::Fit};", "fn f() { crate::train::g() }"]
    {
        assert_eq!(downward(&order, "layer", import), ["train"], "{import}");
    }
    assert!(downward(&order, "train", "use crate::layer::Kick;").is_empty());
}

/// The paths that a `use` declaration names, each whole: `a::{b, c::d}` is `a::b` and `a::c::d`.
fn expanded(tree: &str) -> Vec<String> {
    let Some((before, group)) = tree.split_once('{') else { return vec![tree.to_owned()] };
    let (mut depth, mut parts) = (0, vec![String::new()]);
    for c in group.trim_end().strip_suffix('}').unwrap_or(group).chars() {
        depth += i32::from(c == '{') - i32::from(c == '}');
        match (c, depth) {
            (',', 0) => parts.push(String::new()),
            _ => parts.last_mut().expect("one at least").push(c),
        }
    }
    let whole = |part: &String| expanded(&format!("{before}{part}"));
    parts.iter().filter(|part| !part.is_empty()).flat_map(whole).collect()
}

/// The `use` declarations of a text, without white space and each path whole, and the text without
/// them.
fn declared(text: &str) -> (Vec<String>, String) {
    let (mut paths, mut rest) = (Vec::new(), String::new());
    let mut pieces = text.split("use ");
    rest.push_str(pieces.next().unwrap_or(""));
    for piece in pieces {
        let starts = rest.chars().next_back().is_none_or(char::is_whitespace);
        let (tree, behind) = piece.split_once(';').unwrap_or((piece, ""));
        if !starts {
            rest.push_str(piece);
            continue;
        }
        let words: Vec<&str> = tree.split_whitespace().collect();
        let unnamed = words.split(|word| *word == "as").next().unwrap_or(&[]);
        let tree = if words.len() == unnamed.len() { words.concat() } else { unnamed.concat() };
        paths.extend(expanded(&tree));
        rest.push_str(behind);
    }
    (paths, rest)
}

/// The `super::` and `crate::` paths of a text.
fn paths(text: &str) -> Vec<String> {
    let (mut out, rest) = declared(text);
    out.retain(|path| path.starts_with("super::") || path.starts_with("crate::"));
    // What a visibility names is no import.
    let rest = rest.replace("(in crate::", "(");
    for start in ["super::", "crate::"] {
        for (at, _) in rest.match_indices(start) {
            if rest[..at].ends_with("::") {
                continue;
            }
            let path = &rest[at..];
            let end = path.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'));
            out.push(path[..end.unwrap_or(path.len())].to_owned());
        }
    }
    out
}

/// The files of a module, `study::training` for one in a folder of its own, and which others each
/// imports by `super::` or `crate::` paths, also where a name reaches it through the `pub use` of a
/// `mod.rs`.
fn imports(module: &str) -> BTreeMap<String, BTreeSet<String>> {
    let folder = source(module);
    let mut all = Vec::new();
    files(&folder, &mut all);
    let name = |path: &Path| {
        let inner = path.strip_prefix(&folder).expect("inside").with_extension("");
        let parts: Vec<_> = inner.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        let name = parts.join("::");
        name.strip_suffix("mod").map_or(&*name, |of| of.trim_end_matches("::")).to_owned()
    };
    let texts: BTreeMap<String, String> = all.iter().map(|path| (name(path), code(path))).collect();
    imports_of(module, &texts)
}

fn joined(folder: &str, name: &str) -> String {
    [folder, name].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("::")
}

/// The text of a `mod.rs` without its `pub use`: what it exports it does not need itself.
fn without_exports(text: &str) -> String {
    let mut out = String::new();
    let mut pieces = text.split("pub");
    out.push_str(pieces.next().unwrap_or(""));
    for piece in pieces {
        let visible = match piece.strip_prefix('(') {
            Some(rest) => rest.split_once(')').map_or("", |(_, rest)| rest),
            None => piece,
        };
        match visible.strip_prefix(" use ").and_then(|tree| tree.split_once(';')) {
            Some((_, behind)) => out.push_str(behind),
            None => out.push_str(&format!("pub{piece}")),
        }
    }
    out
}

/// Whether a text has this word, with what stands before and behind it.
fn has_word(text: &str, word: &str, fits: impl Fn(&str, &str) -> bool) -> bool {
    let part = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices(word).any(|(at, _)| {
        let (before, behind) = (&text[..at], &text[at + word.len()..]);
        !before.ends_with(part) && !behind.starts_with(part) && fits(before, behind)
    })
}

/// [`imports`] of these texts; that of the module's own `mod.rs` has no name.
fn imports_of(
    module: &str,
    texts: &BTreeMap<String, String>,
) -> BTreeMap<String, BTreeSet<String>> {
    // (The folder, the name) → the file that a `mod.rs` exports it from.
    let mut exports = BTreeMap::new();
    for (folder, text) in texts {
        for path in declared(text).0 {
            let path = path.trim_start_matches("self::");
            if let Some((from, item)) = path.rsplit_once("::")
                && texts.contains_key(&joined(folder, from))
            {
                exports.insert((folder.clone(), item.to_owned()), joined(folder, from));
            }
        }
    }
    let file_of = |mut at: String, parts: &[&str]| {
        for part in parts {
            let inner = joined(&at, part);
            if !texts.contains_key(&inner) {
                return exports.get(&(at.clone(), (*part).to_owned())).cloned().unwrap_or(at);
            }
            at = inner;
        }
        at
    };
    let mut out = BTreeMap::new();
    for (own, text) in texts {
        let mut imported = BTreeSet::new();
        // Of a `mod.rs`: by paths of its own files, or by names that it exports.
        let needed = without_exports(text);
        for inner in texts.keys() {
            let child = match &**own {
                "" => inner,
                own => {
                    inner.strip_prefix(own).and_then(|rest| rest.strip_prefix("::")).unwrap_or("")
                }
            };
            let by_path = |before: &str, behind: &str| {
                behind.starts_with("::") && (!before.ends_with("::") || before.ends_with("self::"))
            };
            if !child.is_empty() && !child.contains("::") && has_word(&needed, child, by_path) {
                imported.insert(inner.clone());
            }
        }
        for ((_, item), file) in exports.iter().filter(|((folder, _), _)| folder == own) {
            if has_word(&needed, item, |before, _| !before.ends_with("::")) {
                imported.insert(file.clone());
            }
        }
        for path in paths(text) {
            let parts: Vec<&str> = path.split("::").collect();
            let ups = parts.iter().take_while(|part| **part == "super").count();
            let levels: Vec<&str> = own.split("::").collect();
            let file = match (parts[0], levels.len().checked_sub(ups)) {
                ("crate", _) if parts[1] == module => file_of(String::new(), &parts[2..]),
                ("super", Some(depth)) => file_of(levels[..depth].join("::"), &parts[ups..]),
                _ => continue,
            };
            if file != *own {
                imported.insert(file);
            }
        }
        out.insert(own.clone(), imported);
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

#[test]
fn files_import_in_no_circles() {
    for module in [
        "cli", "flow", "io", "layer", "measure", "network", "phase", "python", "scalar", "scene",
        "system", "train",
    ] {
        let mut imports = imports(module);
        if module == "scalar" {
            // The traits of numbers, with defaults by functions that are generic over them.
            imports.remove("");
        }
        let found = circles(&imports);
        assert!(found.is_empty(), "{module}: {found:?}");
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

#[test]
fn imports_of_every_form_are_seen() {
    let of = |a: &str| {
        let module = "pub use b::Beta;\nmod a;\nmod b;\nmod c;\nmod folder;\n";
        let folder = "mod inner;\npub use inner::Inner;\n";
        let texts = [("", module), ("a", a), ("b", ""), ("c", ""), ("folder", folder)];
        let texts = texts.into_iter().chain([("folder::inner", "use super::super::c;")]);
        let texts = texts.map(|(name, text)| (name.to_owned(), text.to_owned())).collect();
        let found = imports_of("room", &texts);
        assert_eq!(found["folder::inner"].iter().collect::<Vec<_>>(), ["c"]);
        found["a"].iter().cloned().collect::<Vec<_>>().join(" ")
    };
    assert_eq!(of("use super::b::Thing;"), "b");
    assert_eq!(of("use super::Beta;"), "b");
    assert_eq!(of("use super::{\n    Beta,\n    c::{D, E},\n};"), "b c");
    assert_eq!(of("use crate::room::c::Thing;"), "c");
    assert_eq!(of("fn f() -> crate::room::Beta {}"), "b");
    assert_eq!(of("fn f() { super::c::g() }"), "c");
    assert_eq!(of("use super::folder::Inner as Other;"), "folder::inner");
    assert_eq!(of("pub(in crate::room) use crate::other::c::Thing;"), "");
}
