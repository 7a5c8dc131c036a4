//! Reports as pages: all of the report is in them, and nothing outside of them is needed.

use crate::helpers::{
    SMALL, call, folder, refuses, succeeds, text, two_parts, with_model, with_scene, write_data,
};
use gyroceptron::scene::findings::{Block, Findings, Section};
use gyroceptron::scene::render::html;
use gyroceptron::scene::{Machine, Report, StudyFindings, find};
use std::path::Path;

/// The text of a page, without its tags, styles and scripts.
fn words(page: &str) -> String {
    let (mut out, mut rest) = (String::new(), page);
    while let Some(begin) = rest.find('<') {
        out += &rest[..begin];
        rest = &rest[begin..];
        for element in ["style", "script", "svg"] {
            if rest[1..].starts_with(element) {
                let end = format!("</{element}>");
                rest = &rest[rest.find(&end).expect("its end")..];
            }
        }
        rest = &rest[rest.find('>').expect("its end") + 1..];
        out.push(' ');
    }
    let entities = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&amp;", "&")];
    let out = entities.iter().fold(out + rest, |text, (name, sign)| text.replace(name, sign));
    out.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The cells of all tables of a report in Markdown.
fn cells(markdown: &str) -> Vec<String> {
    let rows = markdown.lines().filter(|line| line.starts_with("| ") && !line.contains("---|"));
    let cell =
        |cell: &str| cell.replace(['`', '*'], "").split_whitespace().collect::<Vec<_>>().join(" ");
    rows.flat_map(|row| row.trim_matches('|').split(" | ").map(cell)).collect()
}

/// That a page is alone, and has a heading, alternatives of its figures and headings of its tables.
fn assert_sound(page: &str) {
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains("<html lang=\"en\">"));
    for outside in ["<link", "<img", "src=", "@import", "url(", "<iframe"] {
        assert!(!page.contains(outside), "{outside}");
    }
    let ends = |name: &str| page.matches(&format!("</{name}>")).count();
    for name in
        ["table", "figure", "details", "section", "div", "ul", "p", "h2", "td", "svg", "pre"]
    {
        let begun =
            page.matches(&format!("<{name}>")).count() + page.matches(&format!("<{name} ")).count();
        assert_eq!(begun, ends(name), "{name}");
    }
    assert_eq!(page.matches("<h1>").count(), 1);
    let figures = ends("figure");
    assert_eq!(page.matches("role=\"group\" aria-label=\"").count(), figures);
    // Nothing of Markdown is left as it was.
    let text = words(page);
    for mark in ["**", "|---", "](", "####"] {
        assert!(!text.contains(mark), "{mark}: {text}");
    }
    assert!(!text.contains("NaN"), "{text}");
}

/// That a page has every cell of the report beside it, and every figure.
fn assert_complete(folder: &Path) -> String {
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).expect("a report");
    let (page, markdown) = (read("report.html"), read("report.md"));
    assert_sound(&page);
    let text = words(&page);
    let all = cells(&markdown);
    assert!(all.len() > 8, "{markdown}");
    // Tags stand between words.
    let close = |text: &str| text.replace("\\|", "|").split_whitespace().collect::<String>();
    let together = close(&text);
    for cell in all {
        assert!(together.contains(&close(&cell)), "{cell}: {text}");
    }
    // Rows stand whole, and so do paragraphs, items and headings.
    let marks = |line: &str| close(&line.replace(['`', '*'], ""));
    for line in markdown.lines().filter(|line| {
        !line.contains("](") && !line.contains("---|") && !line.contains("as-run.toml")
    }) {
        let line = line.trim_start_matches(['#', '-', ' ']).trim_matches('|');
        // A heading has its verdict beside it; a link is none here.
        let line = line.trim_end_matches(": holds").replace(" | ", " ");
        assert!(together.contains(&marks(&line)), "{line}: {text}");
    }
    for figure in markdown.lines().filter(|line| line.starts_with("![")) {
        let file = figure.rsplit('(').next().and_then(|rest| rest.split(')').next());
        assert!(page.contains(&format!("href=\"{}\"", file.expect("a file"))), "{figure}");
    }
    assert!(text.contains("To repeat it") && text.contains("@software{gyroceptron"));
    page
}

#[test]
fn a_training_has_a_page_that_begins_with_its_verdict() {
    let folder = folder();
    let path = folder.path();
    write_data(path);
    let files = ["train", "--data", "pairs.npz", "--circle-action", "1,0", "--output", "m.json"];
    succeeds(path, &[&files[..], &SMALL, &["--iterations", "20"]].concat());
    let page = assert_complete(&path.join("m-report"));
    let verdict = page.find("class=\"verdict ").expect("a verdict");
    assert!(verdict < page.find("<table").expect("a table"));
    assert!(words(&page[verdict..]).contains("Whether to trust it"), "its study comes after it");
    // Points of figures stand together, and panels say where they are.
    assert!(page.contains("stroke-linecap=\"round\" d=\"M") && page.contains("data-panels=\"[{"));
    // Numbers are what columns are sorted by.
    assert!(page.contains("data-value=\"") && page.contains("<th scope=\"col\">"));
}

#[test]
fn a_scene_of_parts_has_a_page_for_each() {
    let folder = with_scene("parts.toml", &two_parts());
    let path = folder.path();
    succeeds(path, &["run", "parts.toml", "--out", "o"]);
    for part in ["o", "o/first", "o/second"] {
        assert_complete(&path.join(part));
    }
    let page = std::fs::read_to_string(path.join("o/report.html")).expect("a page");
    for part in ["first", "second"] {
        assert!(page.contains(&format!("<a href=\"{part}/report.html\">{part}</a>")), "{page}");
    }
    assert!(page.contains("measures, and checks nothing"), "{page}");
    // Another run has another page.
    succeeds(path, &["run", "parts.toml", "--out", "o", "--overwrite", "--seed", "9"]);
    let again = std::fs::read_to_string(path.join("o/report.html")).expect("a page");
    assert_ne!(again, page);
}

#[test]
fn a_certificate_has_a_page() {
    let folder = with_model();
    let path = folder.path();
    let verify = ["verify", "--model", "model.json", "--samples", "30", "--report"];
    let shown = text(&succeeds(path, &[&verify[..], &["c.html"]].concat()).stdout);
    let page = std::fs::read_to_string(path.join("c.html")).expect("a page");
    assert_sound(&page);
    assert!(page.contains("class=\"verdict holds\""));
    let said = words(&page);
    let summary = shown.lines().next().and_then(|line| line.split_once(": ")).expect("a summary").1;
    for text in [summary, "model.json", "gyroceptron verify --model model.json --samples 30"] {
        assert!(said.contains(text), "{text}: {said}");
    }
    refuses(path, &[&verify[..], &["c.html"]].concat(), &["c.html"]);
    refuses(path, &[&verify[..], &["c.md"]].concat(), &["--report", ".html"]);
    succeeds(path, &[&verify[..], &["c.html", "--overwrite"]].concat());
    // Where laws are vacuous it says so.
    let random = ["verify", "--random", "2", "--samples", "20", "--radius", "1e140", "--report"];
    let output = call(path, &[&random[..], &["bad.html"]].concat());
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    let page = std::fs::read_to_string(path.join("bad.html")).expect("a page");
    assert!(page.contains("class=\"verdict fails\"") && page.contains("VACUOUS"), "{page}");
}

/// Two trainings on pairs of a file, neither of which is to be trusted; names and titles that are no tags.
#[test]
fn a_scene_on_a_file_says_of_each_network_whether_to_trust_it() {
    let folder = folder();
    let path = folder.path();
    write_data(path);
    let model = |name: &str| {
        format!(
            "[[models]]\nname = \"{name}\"\nnetwork = {{ kind = \"gyroceptron\", psi = {{ count = 1, width = 2 }}, \
             near_identity = {{ count = 1, width = 2 }} }}\n"
        )
    };
    let scene = format!(
        "name = \"own\"\ntitle = \"<script>alert(1)</script> & [x](javascript:alert(1))\"\nseed = 1\nflow_time = 0.5\n[data]\npairs = \
         \"pairs.npz\"\ncircle_action = [1, 0]\nepsilon = 0.05\nvalidation = 0.2\n[training]\niterations = 2\n\
         {}{}",
        model("first"),
        model("second")
    );
    std::fs::write(path.join("own.toml"), scene).expect("written");
    succeeds(path, &["run", "own.toml", "--out", "o"]);
    let page = std::fs::read_to_string(path.join("o/report.html")).expect("a page");
    assert!(!page.contains("<script>alert") && !page.contains("href=\"javascript"), "{page}");
    assert!(words(&page).contains("<script>alert(1)</script> &"), "{page}");
    let (_, verdict) = page.split_once("class=\"verdict fails\"").expect("a verdict");
    let verdict = words(&format!("<p{}", verdict.split("<h2>").next().expect("a part")));
    for text in ["first", "second", "Can it be trusted? no"] {
        assert!(verdict.contains(text), "{verdict}");
    }
}

/// A verdict that is neither yes nor no has no colour, and a part that checks nothing has none.
#[test]
fn a_page_is_as_sure_as_its_verdict() {
    let page = |name: &'static str, verdict: Option<bool>, summary: &[&str], parts: Vec<Report>| {
        let text = |text: &&str| Block::Text(format!("{text}."));
        let summary = summary.iter().map(text).collect();
        let results = Section { summary, ..Section::default() };
        let findings =
            Findings { title: "A study".into(), verdict, results, ..Findings::default() };
        Report {
            scene: find("quickstart").and_then(|entry| entry.scene()).expect("a scene"),
            studies: vec![StudyFindings { name, findings }],
            training_times: Vec::new(),
            stages: Vec::new(),
            machine: Machine::this(),
            repeat: None,
            parts,
        }
    };
    let class = |report: &Report| {
        let page = html(report, "").expect("a page");
        page.split("<div class=\"verdict")
            .nth(1)
            .and_then(|rest| rest.split('"').next())
            .map(str::to_owned)
    };
    for (text, expected) in [
        ("**yes, among the inputs of the pairs**: a", " holds"),
        ("**with care, among the inputs of the pairs**: a", ""),
        ("**for single steps among the inputs of the pairs, not for long orbits**: a", ""),
        ("**no**: a", " fails"),
    ] {
        assert_eq!(
            class(&page("trust", None, &[text], Vec::new())).as_deref(),
            Some(expected),
            "{text}"
        );
    }
    for (verdict, expected) in [(None, ""), (Some(true), " holds"), (Some(false), " fails")] {
        let part = page("certificate", verdict, &["a"], Vec::new());
        assert_eq!(class(&part).as_deref(), Some(expected));
        let whole = html(&page("portrait", None, &["a"], vec![part]), "").expect("a page");
        let (_, parts) = whole.split_once("<h2>Parts</h2>").expect("parts");
        let shown = parts.split("</h3>").next().expect("a heading");
        let badge = match verdict {
            None => None,
            Some(true) => Some(">holds<"),
            Some(false) => Some(">does not hold<"),
        };
        assert_eq!(shown.contains("badge"), badge.is_some(), "{shown}");
        assert!(badge.is_none_or(|words| shown.contains(words)), "{shown}");
    }
}
