//! The commands that README and guide show.

use crate::controls;
use crate::helpers::{call, folder, last_numbers, succeeds, text, with_model, write_data};
use crate::proofs;
use gyroceptron::flow::Pairs;
use gyroceptron::io::{write_pairs, write_points};
use gyroceptron::random::Stream;
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

/// What stands in backquotes, without line breaks.
fn quoted(markdown: &str) -> Vec<String> {
    let blocks = markdown.split("```").step_by(2);
    blocks
        .flat_map(|text| text.split('`').skip(1).step_by(2))
        .map(|quoted| quoted.split_whitespace().collect::<Vec<_>>().join(" "))
        .collect()
}

/// The text of all tests of a target, or of any where none is said.
fn tests_of(target: Option<&str>) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders: Vec<_> = match target {
        Some("verification") => vec![root.join("verification")],
        Some(own @ ("program" | "studies")) => vec![root.join("tests").join(own)],
        // Its files are modules of several targets.
        Some(_) => vec![root.join("tests")],
        None => {
            ["tests", "tests/program", "tests/studies", "verification"].map(|f| root.join(f)).into()
        }
    };
    let mut out = String::new();
    for folder in folders {
        for entry in std::fs::read_dir(folder).expect("tests") {
            let path = entry.expect("an entry").path();
            if path.extension().is_some_and(|ending| ending == "rs") {
                let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
                out += &format!("mod {name};\n{}", std::fs::read_to_string(&path).expect("text"));
            }
        }
    }
    out
}

/// Names of tests and of scenes within sentences are those of tests and scenes.
#[test]
fn commands_in_sentences_name_what_there_is() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut all = chapters();
    for file in ["benches/README.md", "fuzz/README.md"] {
        if let Ok(text) = std::fs::read_to_string(root.join(file)) {
            all.push((file.into(), text));
        }
    }
    let (mut tests, mut scenes) = (0, 0);
    for (file, text) in &all {
        for command in quoted(text) {
            let words: Vec<&str> = command.split(' ').collect();
            match words[..] {
                ["cargo", "test", ..] => {
                    let own = words.iter().take_while(|word| **word != "--");
                    let own: Vec<&str> = own.copied().skip(2).collect();
                    let target = own.iter().position(|word| *word == "--test").map(|k| own[k + 1]);
                    let filter = |(k, word): (usize, &&str)| {
                        !word.starts_with('-') && (k == 0 || own[k - 1] != "--test")
                    };
                    let Some((_, filter)) = own.iter().enumerate().find(|&(k, w)| filter((k, w)))
                    else {
                        continue;
                    };
                    let found = tests_of(target);
                    let last = filter.rsplit("::").next().expect("a part");
                    let named = found.lines().map(str::trim_start).any(|line| {
                        (line.starts_with("fn ") || line.starts_with("mod ")) && line.contains(last)
                    });
                    assert!(named, "{file}: `{command}`: there is no test with {filter}");
                    tests += 1;
                }
                ["gyroceptron", "run", name, ..]
                    if name.starts_with(|c: char| c.is_lowercase()) =>
                {
                    let known = name.contains(['.', '/']) || find(name).is_ok();
                    assert!(known, "{file}: `{command}`: there is no scene {name}");
                    scenes += 1;
                }
                _ => {}
            }
        }
    }
    assert!(tests >= 5 && scenes >= 50, "{tests} {scenes}");
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

/// What a command needs more than a test has; what else runs it.
const LONG: [(&str, &str); 4] = [
    ("--merge", "all jobs of a long scene: tests of jobs"),
    ("m.json", "a scene of minutes, and proofs of minutes: tests of the target verification"),
    ("gyroceptron-out", "a scene of minutes"),
    ("--plan", "plans of long scenes sample all their data: tests of jobs"),
];

/// Runs the short commands of a chapter in their order in a folder, once `write` has made the files that they need;
/// their number.
fn run(chapter: &str, path: &Path, write: impl Fn(&Path)) -> usize {
    write(path);
    let mut count = 0;
    for command in commands(chapter) {
        let mut arguments: Vec<&str> = command.iter().map(String::as_str).collect();
        let is_job = arguments.contains(&"--job");
        let long = LONG.iter().any(|(word, _)| {
            arguments.iter().any(|argument| argument.split('/').next() == Some(word))
        });
        // A scene takes minutes: the tests of studies run it in parts.
        if long || (arguments[0] == "run" && !is_job) {
            continue;
        }
        if arguments[0] == "train" {
            arguments.extend(["--iterations", "2", "--starts", "1"]);
            if !arguments.contains(&"--circle-action") {
                arguments.extend(["--circle-action", "1,0"]);
            }
        }
        if arguments[0] == "verify" {
            arguments.extend(["--samples", "5"]);
        }
        // Rotation numbers are those of the guide's map: these are of the one here.
        let mut turns = proofs::TURNS.iter();
        for argument in &mut arguments {
            if ["0.6180", "0.6853"].contains(argument) {
                *argument = turns.next().expect("two numbers");
            }
        }
        if arguments.contains(&"--output") {
            arguments.push("--overwrite");
        }
        succeeds(path, &arguments);
        count += 1;
    }
    count
}

/// A model of one plane, as `name`, of which circles are proved.
fn write_plane(path: &Path, name: &str) {
    std::fs::copy(proofs::with_maps().path().join("m.json"), path.join(name)).expect("copied");
}

/// Pairs of one plane with values of the control `planar`, and a model of them in machine.json.
fn write_machine(path: &Path) {
    controls::write_files(path, &controls::VALUES);
    let mut train = controls::brief();
    for word in &mut train {
        *word = match *word {
            "coil" => "planar",
            "model.json" => "machine.json",
            word => word,
        };
    }
    succeeds(path, &train);
}

/// Pairs of a map that polynomials fit, and points.
fn write_polynomials(path: &Path) {
    let mut stream = Stream::new(2, "points");
    let input: Vec<f64> = (0..1600).map(|_| stream.uniform(-0.5, 0.5)).collect();
    let mut output = input.clone();
    for z in output.chunks_mut(4) {
        let kick = 0.2 * (z[0] + z[1]).sin();
        for (k, angle) in [0.7_f64, 1.1].into_iter().enumerate() {
            let ((s, c), q, p) = (angle.sin_cos(), z[k], z[2 + k] - kick);
            (z[k], z[2 + k]) = (c * q + s * p, c * p - s * q);
        }
    }
    let pairs = Pairs::new("pairs", 2, input.clone(), output).expect("pairs");
    write_pairs(&path.join("pairs.npz"), &pairs).expect("written");
    let start: Vec<f64> = input[..32].iter().map(|v| 0.02 * v).collect();
    write_points(&path.join("z.npy"), &[8, 4], &start).expect("written");
}

#[test]
fn the_short_commands_of_the_guide_run() {
    let guide = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/guide");
    let chapter =
        |name: &str| std::fs::read_to_string(guide.join(name).with_extension("md")).expect("text");
    // Chapters, what their commands need, and how many run.
    let model = with_model();
    let program = |path: &Path| {
        write_data(path);
        write_plane(path, "plane.json");
        let from = |name: &str| model.path().join(name);
        let mine = ["predict", "--model", "model.json", "--input", "z.npy", "--steps", "400"];
        succeeds(model.path(), &[&mine[..], &["--output", "mine.npy"]].concat());
        std::fs::copy(from("mine.npy"), path.join("mine.npy")).expect("copied");
    };
    let z = |path: &Path| {
        write_data(path);
        std::fs::copy(model.path().join("model.json"), path.join("model.json")).expect("copied");
        let start: Vec<f64> = (0..32).map(|k| 0.01 * f64::from(k)).collect();
        write_points(&path.join("z.npy"), &[8, 4], &start).expect("written");
    };
    let sources = |path: &Path| {
        // Made for the chapter before.
        let machine = path.with_file_name("coils").join("machine.json");
        std::fs::copy(machine, path.join("machine.json")).expect("copied");
        z(path);
    };
    let (ran, folders) = (
        [
            ("program", 15, &program as &dyn Fn(&Path)),
            ("polynomials", 4, &write_polynomials),
            ("coils", 2, &write_machine),
            ("many_machines", 2, &z),
            ("proofs", 2, &|path| write_plane(path, "model.json")),
            ("source_code", 4, &sources),
        ],
        folder(),
    );
    for (name, expected, write) in ran {
        let path = folders.path().join(name);
        std::fs::create_dir(&path).expect("a folder");
        assert_eq!(run(&chapter(name), &path, write), expected, "{name}");
    }
    // No other chapter shows a command of the program.
    let others = chapters().into_iter().filter(|(file, chapter)| {
        let name = Path::new(file).file_stem().expect("a name").to_string_lossy().into_owned();
        name != "README"
            && ran.iter().all(|(ran, ..)| *ran != name)
            && !commands(chapter).is_empty()
    });
    assert_eq!(others.map(|(file, _)| file).collect::<Vec<_>>(), Vec::<String>::new());
    // They did what they say.
    let of = |name: &str| folders.path().join("program").join(name);
    let exact = last_numbers(&of("back.npy"), 4);
    assert!(exact.iter().all(|v| v.is_finite()), "{exact:?}");
    assert!(std::fs::read_to_string(of("certificate.html")).expect("a page").contains("<table"));
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
