//! Scenes in pieces: what jobs make is what a run makes.

use crate::helpers::{Quiet, run_in, temporary};
use crate::long_steps::few_rivals;
use crate::lost;
use crate::noise::NOISE;
use gyroceptron::scene::{
    Event, Folder, Job, JobEnd, JobKind, JobRequest, MergeEnd, Observer, Scene, find, merge, parse,
    run, run_job,
};
use std::path::Path;

/// The stages of a run.
#[derive(Default)]
struct Stages(Vec<String>);

impl Observer for Stages {
    fn event(&mut self, event: Event<'_>) {
        if let Event::Stage(name) = event {
            self.0.push(name.to_owned());
        }
    }
}

fn do_job(scene: &Scene, job: &Job, path: &Path, watch: &mut dyn Observer) -> JobEnd {
    let request = JobRequest { id: &job.id, digest: Some(&job.digest) };
    run_job(scene, request, path, false, watch)
        .unwrap_or_else(|error| panic!("{}: {error}", job.id))
}

/// Does all jobs, those of a wave last first, and makes their report; the stages of each job and of the report.
fn in_pieces(scene: &Scene, path: &Path) -> Vec<(String, Vec<String>)> {
    let mut jobs = scene.plan().expect("a plan");
    jobs.reverse();
    jobs.sort_by_key(|job| job.wave);
    let mut out = Vec::new();
    for job in jobs.iter().filter(|job| job.kind != JobKind::Merge) {
        let mut stages = Stages::default();
        assert_eq!(do_job(scene, job, path, &mut stages), JobEnd::Done, "{}", job.id);
        assert_eq!(do_job(scene, job, path, &mut Quiet), JobEnd::WasDone, "{}", job.id);
        out.push((job.id.clone(), stages.0));
    }
    let mut stages = Stages::default();
    let report = merge(scene, None, path, false, &mut stages).expect("merges");
    assert!(matches!(report, MergeEnd::Done(_)), "{report:?}");
    out.push(("merge".into(), stages.0));
    out
}

fn same_bytes(scene: &Scene) -> Vec<(String, Vec<String>)> {
    let (whole, pieces) = (temporary(), temporary());
    run_in(whole.path(), scene);
    let stages = in_pieces(scene, pieces.path());
    let read = |path: &Path| std::fs::read(path.join("report.json")).expect("a report");
    assert!(read(whole.path()) == read(pieces.path()), "the reports of {} differ", scene.name);
    // What was put together is a run like another.
    let folder = Folder::open(pieces.path(), true, false).expect("resumes");
    run(scene, &folder, &mut Quiet).expect("runs").expect("not interrupted");
    assert!(read(whole.path()) == read(pieces.path()), "{} when it is resumed", scene.name);
    stages
}

/// The stages of a job, by the beginning of its name.
fn of<'a>(stages: &'a [(String, Vec<String>)], id: &str) -> &'a [String] {
    let found = stages.iter().find(|(job, _)| job.starts_with(id));
    &found.unwrap_or_else(|| panic!("{id} is not among {stages:?}")).1
}

fn with(stages: &[String], words: &str) -> usize {
    stages.iter().filter(|stage| stage.starts_with(words)).count()
}

#[test]
fn maps_of_several_flow_times_in_pieces() {
    // Rivals and tables are of no training.
    let scene = parse("long", &few_rivals()).expect("a scene");
    let jobs = scene.plan().expect("a plan");
    // Pairs of three flow times, two networks at each, the report.
    assert_eq!(jobs.len(), 3 + 6 + 1);
    let job = |id: &str| jobs.iter().find(|job| job.id == id).unwrap_or_else(|| panic!("{id}"));
    let last = job("train-gyroceptron-at-20");
    assert_eq!(last.needs, ["data-at-0_01-20", "train-gyroceptron"]);
    assert_eq!((last.wave, job("train-gyroceptron").wave, job("merge").wave), (2, 1, 3));
    let stages = same_bytes(&scene);
    // The weights that a training begins with are those of a job, and no pairs are made twice.
    assert_eq!(with(of(&stages, "train-gyroceptron-at-20"), "training "), 2);
    for (id, stages) in stages.iter().filter(|(id, _)| !id.starts_with("data")) {
        assert_eq!(with(stages, "reference flow"), 0, "{id}: {stages:?}");
    }
}

#[test]
fn pairs_with_noise_in_pieces() {
    let short = NOISE.replace("iterations = 100", "iterations = 15");
    let stages = same_bytes(&parse("noisy", &short).expect("a scene"));
    // Networks at three levels, with a gap and without a fault, of one set of pairs.
    assert_eq!(stages.len(), 1 + 2 * 5 + 1);
}

#[test]
fn field_lines_in_pieces() {
    let lines = r#"
        name = "lines"
        seed = 1
        flow_time = 1.0
        [data]
        validation = 0.25
        orbit = 24
        lines = { coils = COILS, lines = 8, reach = 0.05, error = 1e-5 }
        [training]
        iterations = 10
        ramp = [{ degree = 3, iterations = 5 }]
        optimiser = { kind = "levenberg-marquardt" }
        [[models]]
        name = "jolts"
        weights = { kind = "normal", scale = 0.15 }
        [models.network]
        kind = "normal-form"
        kicks = { count = 3, width = 1, degree = 6 }
        twists = { count = 1, width = 1, degree = 4 }
        perturbation = { count = 4, width = 1, degree = 6 }
    "#;
    let of_scene = find("coils").expect("built in").text;
    let start = of_scene.find("coils = {").expect("coils") + "coils = ".len();
    let end = start + of_scene[start..].find('}').expect("an end") + 1;
    let scene = parse("lines", &lines.replace("COILS", &of_scene[start..end])).expect("a scene");
    let stages = same_bytes(&scene);
    assert_eq!(with(of(&stages, "data"), "field lines"), 1);
    for id in ["train-jolts", "merge"] {
        assert_eq!(with(of(&stages, id), "field lines"), 0, "{id}");
    }
}

#[test]
fn a_plan_names_what_each_job_depends_on() {
    let scene = parse("noisy", NOISE).expect("a scene");
    let digests = |text: &str| {
        let jobs = parse("noisy", text).expect("a scene").plan().expect("a plan");
        jobs.into_iter().map(|job| (job.id, job.digest)).collect::<Vec<_>>()
    };
    let first = digests(NOISE);
    assert_eq!(first, digests(NOISE));
    assert_eq!(first.len(), scene.plan().expect("a plan").len());
    let changed = |from: &str, to: &str| {
        assert!(NOISE.contains(from));
        let other = digests(&NOISE.replace(from, to));
        let before: Vec<&str> =
            first.iter().filter(|job| !other.contains(job)).map(|(id, _)| &id[..]).collect();
        before.into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    // All of it.
    assert_eq!(changed("seed = 2", "seed = 3").len(), first.len());
    assert_eq!(changed("samples = 700", "samples = 600").len(), first.len());
    // All trainings, and the report.
    assert_eq!(changed("iterations = 100", "iterations = 151").len(), first.len() - 1);
    // One of two networks.
    assert_eq!(changed("layers = { count = 4", "layers = { count = 5").len(), 5 + 1);
    // The report alone.
    assert_eq!(changed("steps = 60", "steps = 62"), ["merge"]);
    // Both networks at one level.
    let level = changed("1e-2, 1.0", "2e-2, 1.0");
    assert_eq!(level, ["train-normal-form-noise-1e-2", "train-henon-net-noise-1e-2", "merge"]);
}

#[test]
fn built_in_scenes_have_plans() {
    for entry in gyroceptron::scene::catalogue() {
        let (scene, _) = entry.scene().expect("a scene").without_parts_that_lack_files();
        // A scene of one network that is of a file has nothing to run.
        if scene.complete().is_err() {
            continue;
        }
        let jobs = scene.plan().unwrap_or_else(|error| panic!("{}: {error}", entry.name));
        for (number, job) in jobs.iter().enumerate() {
            let before: Vec<&str> = jobs[..number].iter().map(|job| &job.id[..]).collect();
            assert!(!before.contains(&&job.id[..]), "{}: {} twice", entry.name, job.id);
            for need in &job.needs {
                assert!(before.contains(&&need[..]), "{}: {} before {need}", entry.name, job.id);
            }
        }
        let last = jobs.last().expect("the report");
        assert_eq!(
            (last.kind, last.needs.len()),
            (JobKind::Merge, jobs.len() - 1),
            "{}",
            entry.name
        );
    }
}

#[test]
fn trainings_that_are_lost_in_pieces() {
    let stages = same_bytes(&lost::scene(2));
    // Its pairs and those of its ramp, a network, and another from two initial weights, which are both lost.
    assert_eq!(stages.len(), 2 + 3 + 1);
}
