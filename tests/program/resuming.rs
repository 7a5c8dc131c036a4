//! Killed and interrupted runs, and folders that already hold one.

use crate::helpers::{
    SCENE, call, command, folder, listing, refuses, succeeds, text, two_parts, with_scene,
    write_data,
};
use serde_json::Value;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Duration;

#[test]
fn a_killed_run_resumes_to_the_same_bits() {
    let scene = SCENE.replace("iterations = 60", "iterations = 400");
    let report = resumes_after_a_kill(&scene, "checkpoint");
    assert!(!report.contains("start 1"), "{report}");
}

#[test]
fn a_run_killed_on_a_ramp_resumes_to_the_same_bits() {
    let scene = SCENE.replace(
        "iterations = 60",
        "iterations = 40\nstarts = { count = 2, iterations = 30 }\n\
         ramp = [{ flow_time = 0.25, epsilon = 0.02, iterations = 400 }]",
    );
    let report = resumes_after_a_kill(&scene, "checkpoint-ramp-1");
    for words in ["start 1", "ε = 0.02", "0.500"] {
        assert!(report.contains(words), "{words}: {report}");
    }
}

#[test]
fn a_run_killed_among_its_twists_resumes_to_the_same_bits() {
    let gyroceptron = r#"kind = "gyroceptron", psi = { count = 3, width = 4 }, near_identity = { count = 3, width = 4 }"#;
    let normal_form = r#"kind = "normal-form", kicks = { count = 3, width = 4 }, twists = { count = 4, width = [2, 4] }"#;
    assert!(SCENE.contains(gyroceptron));
    let scene = SCENE.replace(gyroceptron, normal_form).replace(
        "iterations = 60",
        "iterations = 40\nramp = [{ flow_time = 0.25, iterations = 30 }]\n\
         fresh_twists = { count = 1, iterations = 400 }",
    );
    let report = resumes_after_a_kill(&scene, "checkpoint-fresh-twists-1");
    for words in ["twists of the ramp", "fresh twists 1", "chart"] {
        assert!(report.contains(words), "{words}: {report}");
    }
    let folder = with_scene("small.toml", &scene.replace(normal_form, gyroceptron));
    refuses(folder.path(), &["small.toml"], &["fresh_twists", "normal form"]);
    for (width, words) in [("[2]", "two by turns"), ("[2, 0]", "width 0"), ("0", "width 0")] {
        let folder = with_scene("small.toml", &scene.replace("[2, 4]", width));
        refuses(folder.path(), &["small.toml"], &[words]);
    }
}

/// Kills a run half-way, as soon as this file is there. The run must not have ended by itself:
/// its resumption would show nothing.
fn kill_when_there(mut child: Child, file: &Path) {
    for _ in 0..30_000 {
        if file.exists() || child.try_wait().expect("a child").is_some() {
            break;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(child.try_wait().expect("a child").is_none(), "the run ended before it was killed");
    child.kill().expect("killed");
    let status = child.wait().expect("ended");
    assert!(!status.success(), "the run ended before it was killed");
    assert!(file.exists(), "killed before {}", file.display());
}

/// The report of a run that was killed when this file was there.
fn resumes_after_a_kill(scene: &str, file: &str) -> String {
    let folder = with_scene("small.toml", scene);
    succeeds(folder.path(), &["small.toml", "--out", "whole"]);
    let child = command(folder.path(), &["small.toml", "--out", "killed"])
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .expect("starts");
    let checkpoint = folder.path().join("killed").join(file);
    kill_when_there(child, &checkpoint);
    assert!(!folder.path().join("killed/report.json").exists(), "killed too late");
    refuses(folder.path(), &["small.toml", "--out", "killed"], &["killed", "--resume"]);
    succeeds(folder.path(), &["small.toml", "--out", "killed", "--resume"]);
    for file in ["report.json", "model.json"] {
        let read = |out: &str| std::fs::read(folder.path().join(out).join(file)).expect("there");
        assert!(read("whole") == read("killed"), "{file}");
    }
    std::fs::read_to_string(folder.path().join("killed/report.md")).expect("a report")
}

#[test]
fn parts_run_one_after_another_and_resume() {
    let folder = with_scene("both.toml", &two_parts());
    let path = folder.path();
    let output = succeeds(path, &["both.toml", "--out", "whole"]);
    assert!(text(&output.stdout).contains("second"));
    let report = std::fs::read_to_string(path.join("whole/report.md")).expect("a report");
    // With what the studies of each part sum up.
    for words in ["[second](second/report.md)", "| network | parameters |"] {
        assert!(report.contains(words), "the report lacks {words}");
    }
    let json: Value =
        serde_json::from_slice(&std::fs::read(path.join("whole/report.json")).expect("a report"))
            .expect("JSON");
    let second = &json["parts"][1];
    assert_eq!(second["scene"]["name"], "second");
    assert!(second["studies"]["training"]["models"][0]["best"]["loss"].is_number());
    for file in ["first/model.json", "second/report.md", "second/checkpoint"] {
        assert!(path.join("whole").join(file).exists(), "{file}");
    }
    // Killed in its second part, it goes on there.
    let child = command(path, &["both.toml", "--out", "killed"])
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .expect("starts");
    kill_when_there(child, &path.join("killed/second/checkpoint"));
    assert!(!path.join("killed/report.json").exists(), "killed too late");
    succeeds(path, &["both.toml", "--out", "killed", "--resume"]);
    let read = |name: &str| std::fs::read(path.join(name)).expect("there");
    assert!(read("whole/report.json") == read("killed/report.json"));
    refuses(path, &["both.toml", "--out", "killed"], &["killed", "--resume"]);
    // A part does not take the place of a run that is in its folder.
    std::fs::create_dir_all(path.join("other/second")).expect("made");
    std::fs::write(path.join("other/second/model.json"), "mine").expect("written");
    refuses(path, &["both.toml", "--out", "other"], &["other/second", "--overwrite"]);
    let over = ["both.toml", "--out", "other", "--overwrite"];
    refuses(path, &over, &["other/second", "model.json alone"]);
    assert!(!path.join("other/first").exists());
    // Another seed is another run of both; what is replaced is replaced whole.
    succeeds(path, &["both.toml", "--out", "killed", "--overwrite", "--seed", "8"]);
    for part in ["first", "second"] {
        let model = format!("{part}/model.json");
        assert!(read(&format!("whole/{model}")) != read(&format!("killed/{model}")), "{part}");
    }
}

#[test]
fn training_is_reproducible_and_resumes() {
    let folder = folder();
    write_data(folder.path());
    let train = |output: &str, iterations: &str, more: &[&str]| {
        let mut arguments = vec![
            "train",
            "--data",
            "pairs.npz",
            "--circle-action",
            "1,0",
            "--recipe",
            "paper",
            "--output",
            output,
            "--iterations",
            iterations,
        ];
        arguments.extend(more);
        succeeds(folder.path(), &arguments);
    };
    train("a.json", "150", &["--threads", "1"]);
    train("b.json", "100", &["--threads", "2"]);
    train("b.json", "150", &["--resume"]);
    let read = |file: &str| std::fs::read(folder.path().join(file)).expect("a model");
    assert!(read("a.json") == read("b.json"));
    train("c.json", "60", &["--starts", "3"]);
    assert!(read("c.json") != read("a.json"));
    train("d.json", "30", &["--starts", "3"]);
    let kept = folder.path().join("d.json.checkpoint-start-3");
    assert!(kept.exists(), "a checkpoint for each start");
    // All starts are as they were: the best of them goes on.
    train("d.json", "60", &["--starts", "3", "--resume"]);
    assert!(read("c.json") == read("d.json"));
    // Another training touches it only where it is asked to, and does not go on with it.
    std::fs::copy(&kept, folder.path().join("e.json.checkpoint-start-1")).expect("copied");
    train("e.json", "30", &[]);
    assert!(folder.path().join("e.json.checkpoint-start-1").exists());
    train("d.json", "60", &["--overwrite"]);
    assert!(!kept.exists());
    let again = ["train", "--data", "pairs.npz", "--circle-action", "1,0", "--output", "c.json"];
    refuses(folder.path(), &again, &["c.json"]);
    let far = [&again[..], &["--overwrite", "--seed", "10000000000000000000"]].concat();
    refuses(folder.path(), &far, &["seed", "at most"]);
}

/// Ctrl-C in training writes a checkpoint, from which it goes on, whoever chose the circle action.
#[cfg(unix)]
#[test]
fn ctrl_c_leaves_a_checkpoint() {
    use std::io::{BufRead, BufReader};
    for action in ["1,0", "auto"] {
        let folder = folder();
        let path = folder.path();
        write_data(path);
        let train =
            ["train", "--data", "pairs.npz", "--circle-action", action, "--output", "m.json"];
        let sizes = ["--starts", "1", "--kicks", "2x2", "--twists", "2x2", "--plateau", "0"];
        let train = [&train[..], &sizes].concat();
        let endless = [&train[..], &["--iterations", "1000000000"]].concat();
        let mut child = command(path, &endless)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("starts");
        let checkpoint = path.join("m.json.checkpoint");
        while !checkpoint.exists() {
            assert!(child.try_wait().expect("a child").is_none(), "it goes on");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        let signal = std::process::Command::new("kill")
            .args(["-INT", &child.id().to_string()])
            .status()
            .expect("sent");
        assert!(signal.success());
        let said = BufReader::new(child.stderr.take().expect("piped"))
            .lines()
            .map_while(Result::ok)
            .last()
            .unwrap_or_default();
        assert_eq!(child.wait().expect("ends").code(), Some(130), "{action}: {said}");
        let named = said.contains("--resume") && said.contains("m.json.checkpoint");
        assert!(named, "{action}: {said}");
        let load = || gyroceptron::io::load_checkpoint(&checkpoint).expect("a checkpoint");
        let reached = load().last().iteration;
        let more = (reached + 3).to_string();
        succeeds(path, &[&train[..], &["--iterations", &more, "--resume"]].concat());
        assert_eq!(load().last().iteration, reached + 3);
    }
}

/// What an earlier training left is no checkpoint of a new one, even where the new one ends before it writes
/// its own.
#[test]
fn checkpoints_of_replaced_trainings_are_removed() {
    let folder = folder();
    let path = folder.path();
    write_data(path);
    let train = [
        "train",
        "--data",
        "pairs.npz",
        "--circle-action",
        "1,0",
        "--recipe=paper",
        "--output=m.json",
    ];
    succeeds(path, &[&train[..], &["--iterations", "5"]].concat());
    let checkpoint = path.join("m.json.checkpoint");
    let load = gyroceptron::io::earlier_checkpoint;
    assert_eq!(load(&checkpoint, true).expect("read").expect("there").last().iteration, 5);
    assert!(checkpoint.exists());
    assert!(load(&checkpoint, false).expect("removed").is_none() && !checkpoint.exists());
    assert!(load(&checkpoint, true).expect("none").is_none());
    std::fs::write(&checkpoint, "{").expect("written");
    assert!(load(&checkpoint, true).is_err() && checkpoint.exists());
}

/// Names of networks with what is added for a stage or a flow time are names of files.
#[test]
fn no_two_stages_share_a_checkpoint() {
    let second = r#"
[[models]]
name = "gyroceptron-start-1"
network = { kind = "henon-net", layers = { count = 4, width = 4 } }
weights = { kind = "glorot" }

[training]
starts = { count = 2, iterations = 3 }
"#;
    let folder = with_scene("two.toml", &SCENE.replacen("[training]\n", second, 1));
    refuses(folder.path(), &["two.toml", "--out", "o"], &["models", "`gyroceptron-start-1` twice"]);
}

#[test]
fn output_folders_are_only_overwritten_on_request() {
    let folder = with_scene("small.toml", SCENE);
    let path = folder.path();
    succeeds(path, &["small.toml", "--out", "o"]);
    std::fs::write(path.join("o/mine.txt"), "mine").expect("written");
    refuses(path, &["small.toml", "--out", "o"], &["o", "--resume", "--overwrite"]);
    succeeds(path, &["small.toml", "--out", "o", "--overwrite"]);
    assert!(path.join("o/mine.txt").exists());
    std::fs::write(path.join("file"), "a file").expect("written");
    refuses(path, &["small.toml", "--out", "file"], &["file"]);
    refuses(path, &["small.toml", "--out", "new", "--resume"], &["new", "resume"]);
    // A scene that cannot run costs nothing of an earlier run.
    std::fs::write(path.join("bad.toml"), SCENE.replace("low = [-1.6,", "low = ["))
        .expect("written");
    refuses(path, &["bad.toml", "--out", "o", "--overwrite"], &["bad.toml", "low"]);
    // Nor does a file of somebody else's.
    std::fs::write(path.join("o/notes.svg"), "mine").expect("written");
    std::fs::write(path.join("o/model-mine.json"), "mine").expect("written");
    succeeds(path, &["small.toml", "--out", "o", "--overwrite"]);
    assert!(path.join("o/notes.svg").exists() && path.join("o/model-mine.json").exists());
    refuses(path, &["small.toml", "--out", "/proc/nowhere"], &["/proc/nowhere"]);
    // A model that is of no run is not in the way of one.
    std::fs::create_dir(path.join("theirs")).expect("made");
    std::fs::write(path.join("theirs/model.json"), "theirs").expect("written");
    refuses(path, &["small.toml", "--out", "theirs", "--overwrite"], &["theirs", "model.json"]);
    assert_eq!(std::fs::read(path.join("theirs/model.json")).expect("kept"), b"theirs");
}

#[test]
fn a_resumed_run_must_be_the_same_run() {
    const TRAJECTORIES_SCENE: &str = "name = \"small\"\nflow_time = 1.0\n[system]\nkind = \"oscillators\"\nepsilon = 0.1\n[trajectories]\nepsilons = [0.1]\nsteps = 3\ninitial = [[1.0, 0.0, 0.0, 0.0]]\n";
    let folder = with_scene("small.toml", SCENE);
    let path = folder.path();
    succeeds(path, &["small.toml", "--out", "o"]);
    refuses(path, &["small.toml", "--out", "o", "--resume", "--seed", "8"], &["as-run.toml"]);
    // Nor one of another scene, which has no checkpoint to tell it by.
    let plain = TRAJECTORIES_SCENE;
    std::fs::write(path.join("other.toml"), plain).expect("written");
    refuses(path, &["other.toml", "--out", "o", "--resume"], &["as-run.toml", "another"]);
    let checkpoint = path.join("o/checkpoint");
    let whole = std::fs::read(&checkpoint).expect("a checkpoint");
    std::fs::write(&checkpoint, &whole[..whole.len() / 2]).expect("written");
    refuses(path, &["small.toml", "--out", "o", "--resume"], &["checkpoint", "corrupt"]);
    let flipped = text(&whole).replacen("0.", "1.", 1);
    std::fs::write(&checkpoint, flipped).expect("written");
    refuses(path, &["small.toml", "--out", "o", "--resume"], &["checkpoint"]);
}

/// Levenberg–Marquardt ends where its error is at rest, goes on over a pause to the same bits, and
/// leaves no checkpoint then; what it made is not made again.
#[test]
fn a_training_at_rest_ends_and_leaves_no_checkpoint() {
    let folder = folder();
    let path = folder.path();
    write_data(path);
    let of = |output: &'static str, more: &[&'static str]| {
        let base = ["train", "--data", "pairs.npz", "--circle-action", "1,0", "--output", output];
        let small = ["--psi", "1x2", "--near-identity", "1x2", "--optimiser", "lm", "--json"];
        [&base[..], &["--recipe", "paper"], &small, more].concat()
    };
    let stop = |arguments: &[&str]| -> Value {
        serde_json::from_slice(&succeeds(path, arguments).stdout).expect("one JSON document")
    };
    assert_eq!(stop(&of("a.json", &[]))["stop"], "plateau");
    let read = |file: &str| std::fs::read(path.join(file)).expect("a file");
    let report = String::from_utf8(read("a-report/report.md")).expect("text");
    assert!(report.contains("at rest: a plateau"), "{report}");
    let report: Value = serde_json::from_slice(&read("a-report/report.json")).expect("JSON");
    let last = report["studies"]["training"]["models"][0]["last"]["iteration"].as_u64();
    assert!(last >= Some(50) && last < Some(1000), "{last:?}");
    assert!(!path.join("a.json.checkpoint").exists());
    // Again: nothing is trained, nothing changes.
    let before = listing(path);
    let again = stop(&of("a.json", &["--resume"]));
    assert_eq!(again["finished"], true);
    assert_eq!(listing(path), before);
    let longer = stop(&of("a.json", &["--resume", "--iterations", "2000", "--plateau", "0"]));
    assert_eq!((longer["finished"].clone(), listing(path)), (true.into(), before.clone()));
    // Of another training there is none to go on with.
    let others: [&[&str]; 5] = [
        &["--seed", "1"],
        &["--theta-penalty", "3"],
        &["--loss-weights", "1,2"],
        &["--validation", "0.2"],
        &["--starts", "2"],
    ];
    for other in others {
        let refused = call(path, &of("a.json", &[&["--resume"], other].concat()));
        assert_eq!(refused.status.code(), Some(2), "{other:?}");
        let said = text(&refused.stderr);
        assert!(said.contains("a.json.checkpoint: cannot be read: there is none"), "{said}");
        assert_eq!(listing(path), before);
    }
    // In two parts.
    assert_eq!(stop(&of("b.json", &["--iterations", "30"]))["stop"], "iterations");
    assert!(path.join("b.json.checkpoint").exists());
    assert_eq!(stop(&of("b.json", &["--resume"]))["stop"], "plateau");
    assert!(!path.join("b.json.checkpoint").exists());
    assert!(read("a.json") == read("b.json"));
    // One that could go on has not ended, also where its checkpoint is lost.
    assert_eq!(stop(&of("d.json", &["--iterations", "30"]))["stop"], "iterations");
    std::fs::remove_file(path.join("d.json.checkpoint")).expect("removed");
    let lost = call(path, &of("d.json", &["--resume"]));
    assert_eq!(lost.status.code(), Some(2));
    assert!(text(&lost.stderr).contains("d.json.checkpoint: cannot be read: there is none"));
    // It is an option.
    let more = ["--iterations", "220", "--plateau", "0"];
    assert_eq!(stop(&of("c.json", &more))["stop"], "iterations");
    let scene = |name: &str| String::from_utf8(read(name)).expect("text");
    assert!(scene("a-report/as-run.toml").contains("[training.plateau]"));
    assert!(!scene("c-report/as-run.toml").contains("plateau"));
}
