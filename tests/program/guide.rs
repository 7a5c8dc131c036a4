//! The commands that README and guide show.

use crate::helpers::{call, folder, succeeds, text, write_data};
use gyroceptron::io::write_points;
use gyroceptron::scene::find;
use std::path::Path;

/// The lines of blocks of commands that call the program, as words, without their comments.
fn commands(markdown: &str) -> Vec<Vec<String>> {
    let mut out = Vec::new();
    let mut inside = false;
    for line in markdown.lines().map(str::trim) {
        if line.starts_with("```") {
            inside = line == "```sh";
        }
        let Some(command) = line.strip_prefix("gyroceptron ").filter(|_| inside) else { continue };
        let command = command.split('#').next().unwrap_or_default();
        out.push(command.split_whitespace().map(str::to_owned).collect());
    }
    out
}

fn chapters() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = vec![root.join("README.md"), root.join("verification/README.md")];
    for entry in std::fs::read_dir(root.join("src/guide")).expect("the guide") {
        files.push(entry.expect("an entry").path());
    }
    let read = |path: &std::path::PathBuf| {
        (path.display().to_string(), std::fs::read_to_string(path).expect("text"))
    };
    files.iter().filter(|path| path.extension().is_some_and(|e| e == "md")).map(read).collect()
}

/// The program of the README, line by line, but for the length of its training.
#[test]
fn the_readmes_commands_run() {
    let folder = folder();
    let path = folder.path();
    write_data(path);
    let readme = include_str!("../../README.md");
    let commands = commands(readme);
    assert!(commands.len() >= 4, "{commands:?}");
    for command in commands {
        let mut arguments: Vec<&str> = command.iter().map(String::as_str).collect();
        if arguments[0] == "train" {
            arguments.extend(["--iterations", "5", "--starts", "1", "--circle-action", "1,0"]);
        }
        succeeds(path, &arguments);
    }
    assert!(path.join("t.npy").exists());
}

/// All others are of options that there are, and of scenes that there are.
#[test]
fn the_guides_commands_are_of_options_that_there_are() {
    let folder = folder();
    let path = folder.path();
    write_points(&path.join("z.npy"), &[1, 2], &[0.0, 0.0]).expect("written");
    let mut count = 0;
    for (file, chapter) in chapters() {
        for command in commands(&chapter) {
            let mut arguments: Vec<&str> = command.iter().map(String::as_str).collect();
            if let ["run", scene, ..] = arguments[..]
                && !scene.starts_with('-')
                && !scene.ends_with(".toml")
            {
                assert!(find(scene).is_ok(), "{file}: {command:?}");
            }
            arguments.push("--help");
            let output = call(path, &arguments);
            assert!(output.status.success(), "{file}: {command:?}: {}", text(&output.stderr));
            count += 1;
        }
    }
    assert!(count > 25, "{count}");
    // An option that there is not is seen.
    assert!(!call(path, &["predict", "--grids", "4", "--help"]).status.success());
}

/// A link between chapters is one in the files and one in the documentation that is made of them.
#[test]
fn links_between_chapters_lead_to_chapters() {
    let guide = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/guide");
    let of_rustdoc = std::fs::read_to_string(guide.join("rustdoc-links.txt")).expect("links");
    let slug = |heading: &str| -> String {
        let kept = heading.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
        kept.collect::<String>().trim().to_lowercase().replace(' ', "-")
    };
    let mut count = 0;
    for (file, chapter) in chapters() {
        for definition in
            chapter.lines().filter(|line| line.starts_with('[') && line.contains("]: "))
        {
            let (label, target) = definition[1..].split_once("]: ").expect("a definition");
            assert!(chapter.contains(&format!("][{label}]")), "{file}: {label} is not used");
            assert!(of_rustdoc.contains(&format!("[{label}]: crate::guide::{label}\n")), "{label}");
            let (page, anchor) = target.split_once('#').unwrap_or((target, ""));
            let page = std::fs::read_to_string(guide.join(page)).expect("a chapter");
            let mut headings = page.lines().filter(|line| line.starts_with('#'));
            let found = headings.any(|line| slug(line.trim_start_matches('#')) == anchor);
            assert!(anchor.is_empty() || found, "{file}: {target}");
            count += 1;
        }
        // Those without a definition would be none in the files.
        assert!(!chapter.contains("](crate::"), "{file}");
    }
    assert!(count > 15, "{count}");
}

/// The article about the crate has the sections that its journal asks for, and cites what is in its list.
#[test]
fn the_article_is_complete_but_for_what_is_open() {
    let (paper, list) = (
        include_str!("../../src/guide/joss/paper.md"),
        include_str!("../../src/guide/joss/paper.bib"),
    );
    for section in [
        "Summary",
        "Statement of need",
        "State of the field",
        "Software design",
        "Research impact statement",
        "AI usage disclosure",
        "References",
    ] {
        assert!(paper.contains(&format!("\n# {section}\n")), "{section}");
    }
    let words = paper.split_whitespace().count();
    assert!((750..=1750).contains(&words), "{words} words");
    let cited: std::collections::BTreeSet<&str> = paper
        .split("[@")
        .skip(1)
        .flat_map(|rest| rest.split(']').next().unwrap_or_default().split("; @"))
        .collect();
    let listed = list.split('@').skip(1).filter_map(|entry| entry.split(['{', ',']).nth(1));
    assert_eq!(cited, listed.collect(), "citations, and the list");
    // Nobody else can say it.
    assert_eq!(paper.matches("OPEN").count(), 6);
}

/// A chapter of results says first what it shows, what it does not, and how to do it again.
#[test]
fn chapters_of_results_begin_in_short() {
    let guide = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/guide");
    let contents = std::fs::read_to_string(guide.join("mod.rs")).expect("the contents");
    let list = contents.split("What was measured").nth(1).expect("the results");
    let rows = list.lines().take_while(|line| line.starts_with("//!") || !line.contains("macro"));
    let named =
        rows.filter_map(|line| line.rsplit_once("[`")?.1.split_once("`]").map(|(name, _)| name));
    let mut count = 0;
    for name in named.filter(|name| *name != "figures") {
        let chapter = std::fs::read_to_string(guide.join(format!("{name}.md"))).expect("a chapter");
        let mut lines = chapter.lines().skip(1);
        assert_eq!(lines.next(), Some(""), "{name}");
        assert_eq!(lines.next(), Some("| in short | |"), "{name}");
        for row in ["shows", "does not show", "command"] {
            let start = format!("| {row} | ");
            let line = lines
                .find(|line| line.starts_with(&start))
                .unwrap_or_else(|| panic!("{name}: {row}"));
            assert!(line.len() > start.len() + 20, "{name}: {line}");
            assert!(row != "command" || line.contains("`gyroceptron run "), "{name}: {line}");
        }
        count += 1;
    }
    assert!(count >= 11, "{count}");
}
