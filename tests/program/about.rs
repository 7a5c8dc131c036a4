//! Version, completions, manual pages.

use crate::helpers::{call, folder, refuses, succeeds, text};
use gyroceptron::io::file_digest;
use std::path::Path;
use std::process::{Command, Stdio};

const COMMANDS: [&str; 12] = [
    "run",
    "scenes",
    "verify",
    "prove",
    "check-proof",
    "train",
    "fit",
    "predict",
    "import",
    "export",
    "manual",
    "cite",
];

#[test]
fn the_long_version_says_what_the_program_is_made_of() {
    let folder = folder();
    let short = text(&succeeds(folder.path(), &["-V"]).stdout);
    assert_eq!(short, format!("gyroceptron {}\n", env!("CARGO_PKG_VERSION")));
    let long = text(&succeeds(folder.path(), &["--version"]).stdout);
    assert!(
        long.starts_with(&short) && long.contains("features: cli, scenes, proofs, files\n"),
        "{long}"
    );
    let digest = file_digest(Path::new(env!("CARGO_BIN_EXE_gyroceptron"))).expect("the program");
    assert!(long.contains(&format!("SHA-256 {digest}")), "{long}");
}

#[test]
fn shells_complete_each_command_and_option() {
    let folder = folder();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let words = text(&succeeds(folder.path(), &["completions", shell]).stdout);
        for command in COMMANDS {
            assert!(words.contains(command), "{shell}: {command}");
        }
        assert!(words.contains("turned-twists"), "{shell}");
    }
    refuses(folder.path(), &["completions", "sh"], &["sh", "bash, elvish, fish"]);
    // Bash takes it.
    std::fs::write(
        folder.path().join("c.bash"),
        succeeds(folder.path(), &["completions", "bash"]).stdout,
    )
    .expect("written");
    let ask = "source c.bash; COMP_WORDS=(gyroceptron predict --inp); COMP_CWORD=2; \
               _gyroceptron gyroceptron --inp predict; echo ${COMPREPLY[@]}";
    let mut bash = Command::new("bash");
    bash.current_dir(folder.path()).args(["-c", ask]).stderr(Stdio::null());
    let Ok(done) = bash.output() else {
        println!("no bash is here: its completions are not tried");
        return;
    };
    assert_eq!(text(&done.stdout).trim(), "--input");
}

#[test]
fn each_command_has_a_manual_page() {
    let folder = folder();
    let path = folder.path();
    let said = text(&succeeds(path, &["manual", "man1"]).stdout);
    assert!(said.contains("14 manual pages"), "{said}");
    let read = |name: &str| std::fs::read_to_string(path.join("man1").join(name)).expect("a page");
    assert!(read("gyroceptron.1").contains("check\\-proof"));
    for command in COMMANDS {
        let page = read(&format!("gyroceptron-{command}.1"));
        assert!(page.contains(".TH") && page.contains(".SH SYNOPSIS"), "{command}: {page}");
    }
    assert!(read("gyroceptron-train.1").contains("turned\\-twists"));
    refuses(path, &["manual", "man1"], &["gyroceptron.1", "--overwrite"]);
    succeeds(path, &["manual", "man1", "--overwrite"]);
    std::fs::write(path.join("file"), "mine").expect("written");
    assert!(!call(path, &["manual", "file"]).status.success());
}
