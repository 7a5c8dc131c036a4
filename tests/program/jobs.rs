//! A run in pieces, as an engine that schedules does them: the plan, the jobs, the report; blocks of points.

use crate::helpers::{
    SCENE, call, command, folder, listing, refuses, succeeds, text, two_parts, with_model,
    with_scene, write_data,
};
use gyroceptron::io::read_trajectories;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// The lines of a plan.
fn plan(path: &Path, arguments: &[&str]) -> Vec<Value> {
    let output = succeeds(path, &[arguments, &["--plan"]].concat());
    let lines = text(&output.stdout);
    lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

fn word<'a>(job: &'a Value, key: &str) -> &'a str {
    job[key].as_str().unwrap_or_else(|| panic!("{key} of {job}"))
}

/// The command of a job as a plan has it, for this program and with an addition.
fn of_plan(path: &Path, job: &Value, added: &[&str]) -> Command {
    let words: Vec<&str> = word(job, "command").split(' ').collect();
    assert_eq!(words[0], "gyroceptron");
    let mut out = command(path, &words[1..]);
    out.args(added);
    out
}

fn does(path: &Path, job: &Value, added: &[&str]) -> String {
    let output = of_plan(path, job, added).output().expect("starts");
    assert!(output.status.success(), "{job}: {}", text(&output.stderr));
    text(&output.stdout)
}

fn read(path: &Path, name: &str) -> Vec<u8> {
    std::fs::read(path.join(name)).unwrap_or_else(|reason| panic!("{name}: {reason}"))
}

/// What was timed.
fn times(path: &Path, name: &str) -> Value {
    serde_json::from_slice(&read(path, name)).expect("JSON")
}

/// [`SCENE`] with two seeds.
fn two_seeds() -> String {
    let out = SCENE.replace("name = \"gyroceptron\"", "name = \"gyroceptron\"\nseeds = 2");
    assert_ne!(out, SCENE);
    out
}

#[test]
fn jobs_by_different_instructions_give_the_bytes_of_a_run() {
    let folder = with_scene("small.toml", &two_seeds());
    let path = folder.path();
    succeeds(path, &["small.toml", "--out", "whole"]);
    let before = listing(path);
    let jobs = plan(path, &["small.toml", "--out", "far"]);
    assert_eq!(listing(path), before, "a plan writes something");
    let names: Vec<&str> = jobs.iter().map(|job| word(job, "id")).collect();
    assert_eq!(names, ["data", "train-gyroceptron", "train-gyroceptron-seed-2", "merge"]);
    let kinds: Vec<&str> = jobs.iter().map(|job| word(job, "kind")).collect();
    assert_eq!(kinds, ["data", "training", "training", "merge"]);
    for (job, wave) in jobs.iter().zip([0, 1, 1, 2]) {
        assert_eq!(job["wave"], wave, "{job}");
        let seconds = job["seconds"].as_f64();
        assert_eq!(seconds.is_some_and(|seconds| seconds > 0.0), wave < 2, "{job}");
    }
    assert_eq!((&jobs[1]["seed"], &jobs[2]["seed"]), (&Value::from(3), &Value::from(4)));
    assert_eq!(jobs[2]["needs"], serde_json::json!(["data"]));
    does(path, &jobs[0], &[]);
    let mut other = of_plan(path, &jobs[2], &["--threads", "1"]);
    let output = other.env("GYROCEPTRON_SIMD", "portable").output().expect("starts");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let machine = times(path, "far/jobs/train-gyroceptron-seed-2/timings.json")["machine"].clone();
    assert_eq!(
        (&machine["instructions"], &machine["threads"]),
        (&"portable instructions".into(), &1.into())
    );
    assert!(does(path, &jobs[1], &[]).contains("train-gyroceptron: done"));
    assert!(does(path, &jobs[1], &[]).contains("train-gyroceptron: was done before"));
    assert!(does(path, &jobs[3], &[]).contains("report: far/report.md"));
    assert!(read(path, "whole/report.json") == read(path, "far/report.json"));
    for file in ["model-gyroceptron.json", "checkpoint-gyroceptron-seed-2", "portrait.svg"] {
        let [whole, far] = ["whole", "far"].map(|out| read(path, &format!("{out}/{file}")));
        assert!(whole == far, "{file}");
    }
    // The seconds of a training are those of its job.
    let of_job = &times(path, "far/jobs/train-gyroceptron/timings.json")["models"][0];
    assert_eq!(of_job["model"], "gyroceptron");
    assert_eq!(of_job, &times(path, "far/timings.json")["models"][0]);
    let before = listing(path);
    assert!(does(path, &jobs[3], &[]).contains("made before"));
    let again = does(path, &jobs[3], &["--json"]);
    assert!(again.as_bytes() == read(path, "far/report.json"));
    assert_eq!(listing(path), before, "a report that is there is made again");
}

#[test]
fn parts_in_pieces_and_a_report_that_was_interrupted() {
    let scene = two_parts().replace("iterations = 3000", "iterations = 120");
    let folder = with_scene("both.toml", &scene);
    let path = folder.path();
    succeeds(path, &["both.toml", "--out", "whole"]);
    let jobs = plan(path, &["run", "both.toml", "--out", "far", "--json"]);
    let names: Vec<&str> = jobs.iter().map(|job| word(job, "id")).collect();
    let all = [
        "first.data",
        "second.data",
        "first.train-gyroceptron",
        "second.train-gyroceptron",
        "merge",
    ];
    assert_eq!(names, all);
    jobs.iter().for_each(|job| drop(does(path, job, &[])));
    assert!(read(path, "whole/report.json") == read(path, "far/report.json"));
    assert!(read(path, "whole/second/model.json") == read(path, "far/second/model.json"));
    // As a machine leaves it that went down while the report was made.
    let mark = path.join("far/jobs/merge/job.json");
    let mut state: Value =
        serde_json::from_slice(&std::fs::read(&mark).expect("there")).expect("JSON");
    state["files"] = Value::Null;
    std::fs::write(&mark, state.to_string()).expect("written");
    for lost in ["report.json", "first/report.json", "second/model.json", "second/checkpoint"] {
        std::fs::remove_file(path.join("far").join(lost)).expect("removed");
    }
    does(path, &jobs[4], &[]);
    assert!(read(path, "whole/report.json") == read(path, "far/report.json"));
    // A report that somebody has changed is not replaced unasked.
    std::fs::write(path.join("far/report.json"), "my notes").expect("written");
    let merge = ["run", "both.toml", "--out", "far", "--merge"];
    refuses(path, &merge, &["far", "--overwrite"]);
    succeeds(path, &[&merge[..], &["--overwrite"]].concat());
    assert!(read(path, "whole/report.json") == read(path, "far/report.json"));
}

#[test]
fn a_killed_job_and_a_spoilt_one() {
    let scene = SCENE.replace("iterations = 60", "iterations = 600");
    let folder = with_scene("small.toml", &scene);
    let path = folder.path();
    succeeds(path, &["small.toml", "--out", "whole"]);
    let jobs = plan(path, &["small.toml", "--out", "far"]);
    does(path, &jobs[0], &[]);
    let mut child = of_plan(path, &jobs[1], &[])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("starts");
    let checkpoint = path.join("far/jobs/train-gyroceptron/checkpoint");
    let start = Instant::now();
    while !checkpoint.exists() {
        assert!(start.elapsed() < Duration::from_secs(60), "no checkpoint");
        std::thread::sleep(Duration::from_millis(1));
    }
    // SIGKILL.
    child.kill().expect("killed");
    assert!(!child.wait().expect("ends").success(), "the job ended before it was killed");
    let merge = ["run", "small.toml", "--out", "far", "--merge"];
    refuses(path, &merge, &["train-gyroceptron (begun and not done)"]);
    let state = |done: &str| {
        let output = of_plan(path, &jobs[1], &[]).output().expect("starts");
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert!(text(&output.stdout).contains(done), "{}", text(&output.stdout));
        text(&output.stderr)
    };
    state(": done");
    let whole = read(path, "whole/checkpoint");
    assert!(whole == std::fs::read(&checkpoint).expect("there"));
    // Spoilt after it was done, or while it was under way; each time the merge refuses it by its name.
    std::fs::write(&checkpoint, &whole[..whole.len() / 2]).expect("written");
    refuses(path, &merge, &["train-gyroceptron (with a checkpoint that is not the job's)"]);
    assert!(state(": done").contains("it is done again"));
    assert!(whole == std::fs::read(&checkpoint).expect("there"));
    let mark = checkpoint.with_file_name("job.json");
    let mut under_way: Value =
        serde_json::from_slice(&std::fs::read(&mark).expect("there")).expect("JSON");
    under_way["files"] = Value::Null;
    std::fs::write(&mark, under_way.to_string()).expect("written");
    std::fs::write(&checkpoint, "{").expect("written");
    assert!(state(": done").contains("not gone on with"));
    std::fs::write(&mark, "{").expect("written");
    refuses(path, &merge, &["train-gyroceptron (with a job.json that is none)"]);
    assert!(state(": done").contains("it is done again"));
    // Without it the files may be anybody's.
    std::fs::remove_file(&mark).expect("removed");
    refuses(path, &merge, &["train-gyroceptron (of another scene, version or file)"]);
    let again = ["run", "small.toml", "--out", "far", "--job", "train-gyroceptron"];
    refuses(path, &again, &["far/jobs/train-gyroceptron", "--overwrite"]);
    succeeds(path, &[&again[..], &["--overwrite"]].concat());
    assert!(whole == std::fs::read(&checkpoint).expect("there"));
    // Of a version to come, which may say more.
    let done = std::fs::read_to_string(&mark).expect("there");
    let digest = word(&jobs[1], "digest");
    let newer = done.replace(digest, "0123").replacen('{', "{\n  \"new\": 1,", 1);
    std::fs::write(&mark, newer).expect("written");
    refuses(path, &again, &["far/jobs/train-gyroceptron", "--overwrite"]);
    std::fs::write(&mark, done).expect("written");
    // What is left of a file that a process was killed over.
    let half = checkpoint.with_file_name(".gyroceptron-Ab12");
    std::fs::write(&half, "{").expect("written");
    std::fs::write(&checkpoint, "{").expect("written");
    state(": done");
    assert!(!half.exists());
    let data = path.join("far/jobs/data/data.json");
    std::fs::write(&data, "{}").expect("written");
    refuses(path, &merge, &["data (with a data.json that is not the job's)"]);
    does(path, &jobs[0], &[]);
    does(path, &jobs[2], &[]);
    assert!(read(path, "whole/report.json") == read(path, "far/report.json"));
}

#[test]
fn two_engines_on_one_folder() {
    let scene = SCENE.replace("iterations = 60", "iterations = 300");
    let folder = with_scene("small.toml", &scene);
    let path = folder.path();
    succeeds(path, &["small.toml", "--out", "whole"]);
    let jobs = plan(path, &["small.toml", "--out", "far"]);
    for job in &jobs {
        let spawn = || {
            let mut command = of_plan(path, job, &[]);
            command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts")
        };
        let both = [spawn(), spawn()].map(|child| child.wait_with_output().expect("ends"));
        for output in &both {
            assert!(output.status.success(), "{job}: {}", text(&output.stderr));
        }
        let texts = both.map(|output| text(&output.stdout));
        let before = texts.iter().filter(|words| words.contains("before")).count();
        assert_eq!(before, 1, "{job}: {texts:?}");
    }
    assert!(read(path, "whole/report.json") == read(path, "far/report.json"));
}

#[test]
fn jobs_that_are_not_of_the_plan() {
    let folder = with_scene("small.toml", &two_seeds());
    let path = folder.path();
    let of =
        |added: &[&str]| [&["run", "small.toml", "--out", "far"][..], added].concat().join(" ");
    let refuses = |added: &[&str], words: &[&str]| {
        let line = of(added);
        refuses(path, &line.split(' ').collect::<Vec<_>>(), words);
    };
    refuses(&["--job", "train-gyroceptrom"], &["train-gyroceptrom", "such as train-gyroceptron"]);
    refuses(&["--job", "merge"], &["job: expected a data set or a training of the plan"]);
    refuses(
        &["--job", "data", "--digest", "0123"],
        &["job data", "0123", "scene, version or a file is another"],
    );
    refuses(&["--job", "train-gyroceptron"], &["job train-gyroceptron", "data (not begun)"]);
    refuses(
        &["--merge"],
        &["data (not begun), train-gyroceptron (not begun), train-gyroceptron-seed-2 (not begun)"],
    );
    refuses(&["--plan", "--merge"], &["--plan", "--merge"]);
    refuses(&["--digest", "0123"], &["--job"]);
    refuses(&["--job", "data", "--resume"], &["--resume"]);
    succeeds(path, &of(&["--job", "data"]).split(' ').collect::<Vec<_>>());
    // Of another seed all is another job, and what is there is kept.
    refuses(&["--job", "data", "--seed", "9"], &["far/jobs/data", "--overwrite"]);
    refuses(&["--merge", "--seed", "9"], &["data (of another scene, version or file)"]);
    refuses(&["--job", "train-gyroceptron", "--seed", "9"], &["data (of another scene"]);
    let before = read(path, "far/jobs/data/data.json");
    let other = of(&["--job", "data", "--seed", "9", "--overwrite"]);
    succeeds(path, &other.split(' ').collect::<Vec<_>>());
    assert!(before != read(path, "far/jobs/data/data.json"));
    refuses(&["--job", "train-gyroceptron"], &["data (of another scene, version or file)"]);
    let mut other = command(path, &["run", "small.toml", "--plan"]);
    let output = other.env("GYROCEPTRON_SIMD", "sse").output().expect("starts");
    assert_eq!(output.status.code(), Some(2));
    assert!(
        text(&output.stderr)
            .contains("GYROCEPTRON_SIMD: expected portable, avx2 or avx512, found sse")
    );
    // A folder that cannot be written.
    let file = folder.path().join("file");
    std::fs::write(&file, "mine").expect("written");
    let there = ["run", "small.toml", "--out", "file", "--job", "data"];
    crate::helpers::refuses(path, &there, &["file/jobs/data"]);
}

#[test]
fn a_report_does_not_take_the_place_of_another_run() {
    let folder =
        with_scene("both.toml", &two_parts().replace("iterations = 3000", "iterations = 120"));
    let path = folder.path();
    std::fs::write(path.join("small.toml"), SCENE).expect("written");
    let jobs = plan(path, &["both.toml", "--out", "far", "--no-estimate"]);
    assert!(jobs.iter().all(|job| job["seconds"].is_null()));
    let merge = ["run", "both.toml", "--out", "far", "--merge"];
    succeeds(path, &["small.toml", "--out", "far/second", "--seed", "7"]);
    jobs[..4].iter().for_each(|job| drop(does(path, job, &[])));
    // However often it is asked for.
    for _ in 0..2 {
        refuses(path, &merge, &["far/second", "--overwrite"]);
    }
    std::fs::rename(path.join("far/second"), path.join("kept")).expect("moved");
    succeeds(path, &merge);
    let report = read(path, "far/report.json");
    // Interrupted, and meanwhile another run has taken its place.
    let mark = path.join("far/jobs/merge/job.json");
    let mut state: Value =
        serde_json::from_slice(&std::fs::read(&mark).expect("there")).expect("JSON");
    state["files"] = Value::Null;
    std::fs::write(&mark, state.to_string()).expect("written");
    succeeds(path, &["both.toml", "--out", "far", "--seed", "9", "--overwrite"]);
    refuses(path, &merge, &["far", "--overwrite"]);
    succeeds(path, &[&merge[..], &["--overwrite"]].concat());
    assert!(report == read(path, "far/report.json"));
    // Gone on with, which changes seconds alone, it is the same report.
    succeeds(path, &["both.toml", "--out", "far", "--resume"]);
    assert!(text(&succeeds(path, &merge).stdout).contains("made before"));
    // The digest of a plan is that of the report too.
    refuses(path, &[&merge[..], &["--digest", "0123"]].concat(), &["job merge", "0123"]);
    assert!(does(path, &jobs[4], &[]).contains("made before"));
}

#[test]
fn a_job_that_is_done_stays_so_beside_others() {
    let folder = with_scene("small.toml", SCENE);
    let path = folder.path();
    for job in &plan(path, &["small.toml", "--out", "far"])[..2] {
        does(path, job, &[]);
    }
    std::fs::write(path.join("small.toml"), two_seeds()).expect("written");
    let jobs = plan(path, &["small.toml", "--out", "far"]);
    assert!(does(path, &jobs[1], &[]).contains("was done before"));
    does(path, &jobs[2], &[]);
    does(path, &jobs[3], &[]);
    succeeds(path, &["small.toml", "--out", "whole"]);
    assert!(read(path, "whole/report.json") == read(path, "far/report.json"));
    // It was not trained again for the report.
    let of_job = times(path, "far/jobs/train-gyroceptron/timings.json");
    assert_eq!(
        of_job["models"][0]["points"],
        times(path, "far/timings.json")["models"][0]["points"]
    );
    assert!(!path.join("far/checkpoint").exists());
    // Pairs of another job are not taken for those of this one.
    let data = path.join("far/jobs/data/data.json");
    let made = std::fs::read_to_string(&data).expect("there");
    let other = made.replacen(word(&jobs[0], "digest"), "0123", 1);
    assert_ne!(made, other);
    std::fs::write(&data, &other).expect("written");
    let mark = data.with_file_name("job.json");
    let state = std::fs::read_to_string(&mark).expect("there");
    let [before, after] = [&made, &other].map(|text| {
        std::fs::write(path.join("of"), text).expect("written");
        gyroceptron::io::file_digest(&path.join("of")).expect("a digest")
    });
    std::fs::write(&mark, state.replace(&before, &after)).expect("written");
    std::fs::remove_dir_all(path.join("far/jobs/train-gyroceptron")).expect("removed");
    let again = ["run", "small.toml", "--out", "far", "--job", "train-gyroceptron"];
    let output = call(path, &again);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("expected data of the job"), "{}", text(&output.stderr));
}

#[test]
fn plans_of_odd_names_and_places() {
    let folder = with_scene("-odd name.toml", SCENE);
    let path = folder.path();
    let output = succeeds(path, &["run", "--out", "o ut", "--plan", "--", "-odd name.toml"]);
    let first: Value =
        serde_json::from_str(text(&output.stdout).lines().next().expect("a job")).expect("JSON");
    let words = word(&first, "command");
    assert!(words.starts_with("gyroceptron run --out 'o ut' --job data --digest "), "{words}");
    assert!(words.ends_with(" -- '-odd name.toml'"), "{words}");
    refuses(path, &["run", "--plan", "--digest", "0123", "quickstart"], &["--plan", "--digest"]);
    refuses(path, &["run", "--no-estimate", "quickstart"], &["--plan"]);
    // Without a place for a trial there are no seconds.
    let mut lost = command(path, &["run", "quickstart", "--plan"]);
    let output = lost.env("TMPDIR", "/nonexistent").output().expect("starts");
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(text(&output.stdout).matches("\"seconds\":null").count(), 4);
    // Of as many maps as pairs.
    let family = SCENE
        .replace("[data]", "[data]\nepsilons = EPSILONS")
        .replace("samples = 400", "samples = 4000");
    let epsilons: Vec<f64> = (1..=200).map(|k| 1e-4 * f64::from(k)).collect();
    let family = family.replace("EPSILONS", &format!("{epsilons:?}"));
    std::fs::write(path.join("family.toml"), family).expect("written");
    let seconds: Vec<Value> =
        plan(path, &["family.toml"]).into_iter().map(|job| job["seconds"].clone()).collect();
    assert!(seconds[0].is_number() && seconds[1].is_number(), "{seconds:?}");
}

/// An iteration of Levenberg–Marquardt looks at a part of the pairs, however many there are, one of L-BFGS at all.
#[test]
fn what_a_training_takes_is_of_the_pairs_that_it_looks_at() {
    let folder = folder();
    let path = folder.path();
    let seconds = |optimiser: &str, samples: &str| {
        let scene = SCENE.replace("samples = 400 ", &format!("samples = {samples} ")).replace(
            "[training]",
            &format!("[training]\noptimiser = {{ kind = \"{optimiser}\" }}"),
        );
        std::fs::write(path.join("of.toml"), scene).expect("written");
        plan(path, &["of.toml"])[1]["seconds"].as_f64().expect("seconds")
    };
    let more = |optimiser: &str| seconds(optimiser, "4000000") / seconds(optimiser, "400");
    let (of_part, of_all) = (more("levenberg-marquardt"), more("l-bfgs"));
    // Of ten thousand times as many pairs.
    assert!(of_part < 100.0 && of_all > 100.0, "{of_part} {of_all}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_whose_name_is_no_text() {
    use std::os::unix::ffi::OsStrExt;
    let folder = folder();
    let path = folder.path().join(std::ffi::OsStr::from_bytes(b"nu\xff"));
    std::fs::create_dir(&path).expect("made");
    write_data(&path);
    let scene = SCENE.replace("[system]\nkind = \"oscillators\"\nepsilon = 0.01\n", "");
    let windows = scene.find("windows = ").expect("in the scene");
    let end = windows + scene[windows..].find('\n').expect("a line");
    let of_file = "pairs = \"pairs.npz\"\ncircle_action = [1, 0]\nepsilon = 0.01";
    let scene = format!("{}{of_file}{}", &scene[..windows], &scene[end..]);
    std::fs::write(path.join("file.toml"), scene).expect("written");
    for added in [&["--plan"][..], &["--job", "train-gyroceptron"], &["--merge"], &[]] {
        let output = call(&path, &[&["run", "file.toml", "--out", "o"], added].concat());
        assert_eq!(output.status.code(), Some(2), "{added:?}");
        assert_eq!(text(&output.stderr).lines().count(), 1, "{added:?}: {}", text(&output.stderr));
    }
}

#[test]
fn blocks_of_points_are_parts_of_a_call_for_all() {
    let folder = with_model();
    let path = folder.path();
    let predict = |output: &str, added: &[&str]| {
        let words = [
            "predict",
            "--model",
            "model.json",
            "--input",
            "z.npy",
            "--steps",
            "40",
            "--every",
            "10",
        ];
        [&words[..], &["--output", output], added].concat().join(" ")
    };
    let words = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let go = |line: &str| {
        let words = words(line);
        succeeds(path, &words.iter().map(String::as_str).collect::<Vec<_>>())
    };
    go(&predict("all.npy", &[]));
    let all = read_trajectories(&path.join("all.npy"), 2).expect("trajectories");
    assert_eq!(all.count(), 3);
    let mut parts: Vec<Vec<f64>> = Vec::new();
    for (block, count) in [("1/2", 1), ("2/2", 2)] {
        let output = go(&predict("part.npy", &["--block", block, "--overwrite", "--json"]));
        let said: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert_eq!((&said["block"], &said["shape"][1]), (&block.into(), &count.into()));
        let part = read_trajectories(&path.join("part.npy"), 2).expect("trajectories");
        let row = part.values().len() / part.states();
        parts.push(part.values().to_vec());
        assert_eq!(row, 4 * count);
    }
    for (state, row) in all.values().chunks_exact(12).enumerate() {
        assert_eq!(row[..4], parts[0][4 * state..4 * (state + 1)], "state {state}");
        assert_eq!(row[4..], parts[1][8 * state..8 * (state + 1)], "state {state}");
    }
    for (block, expected) in [
        ("0/2", "K from 1 to N"),
        ("3/2", "K from 1 to N"),
        ("1/4", "at most 3 blocks"),
        ("2", "K/N"),
        ("-1/2", "K/N"),
        ("1/99999999999999999999", "K/N"),
    ] {
        let line = words(&predict("other.npy", &[&format!("--block={block}")]));
        refuses(path, &line.iter().map(String::as_str).collect::<Vec<_>>(), &["--block", expected]);
    }
}
