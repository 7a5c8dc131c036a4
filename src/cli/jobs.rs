//! The jobs of a scene, for an engine that schedules: their plan, one of them, their report.

use super::arguments::Run;
use super::output::{json, out, status_of, typed_words, width};
use super::progress::{Progress, line};
use super::status::Status;
use gyroceptron::Error;
use gyroceptron::scene::render::{self, terminal};
use gyroceptron::scene::{
    Job, JobEnd, JobKind, JobRequest, MergeEnd, Report, Scene, job_command, merge, run_job,
};
use serde::Serialize;
use serde_json::json;
use std::path::Path;

/// A job as a line of a plan.
#[derive(Serialize)]
struct Line<'a> {
    #[serde(flatten)]
    job: &'a Job,
    /// What a shell takes to do it, in the folder where the plan was made.
    command: String,
    /// An estimate for this machine.
    seconds: Option<f64>,
}

/// A line for each job.
pub fn plan(scene: &Scene, arguments: &Run, path: &Path) -> Result<Status, Error> {
    scene.check_networks(path)?;
    let typed = typed_words();
    let mut progress = Progress::new();
    let found = scene.with_found_actions(&mut progress);
    progress.finish();
    let Some(scene) = found? else {
        line("interrupted");
        return Ok(Status::Interrupted);
    };
    let jobs = scene.plan()?;
    let seconds = match arguments.no_estimate {
        true => vec![None; jobs.len()],
        false => scene.estimate(&jobs, &progress),
    };
    for (job, seconds) in jobs.iter().zip(seconds) {
        let id = (job.kind != JobKind::Merge).then_some(&job.id[..]);
        let command = job_command(&typed, path, id, &job.digest);
        let text = serde_json::to_string(&Line { job, command, seconds });
        let text =
            text.map_err(|reason| Error::invalid("--plan", reason, "numbers that JSON can hold"))?;
        out(&format!("{text}\n"))?;
    }
    Ok(Status::Done)
}

/// Does one job of a scene and prints how it ended.
pub fn one(scene: &Scene, arguments: &Run, id: &str, path: &Path) -> Result<Status, Error> {
    let request = JobRequest { id, digest: arguments.digest.as_deref() };
    let mut progress = Progress::new();
    let end = run_job(scene, request, path, arguments.overwrite, &mut progress);
    progress.finish();
    let (words, status) = match end? {
        JobEnd::Done => ("done", Status::Done),
        JobEnd::WasDone => ("was done before", Status::Done),
        JobEnd::Interrupted => {
            line(&format!("job {id}: interrupted; the same command goes on from its checkpoint"));
            return Ok(Status::Interrupted);
        }
    };
    if arguments.common.json {
        json(&json!({ "job": id, "state": words }))?;
    } else {
        out(&format!("job {id}: {words}\n"))?;
    }
    Ok(status)
}

/// Makes the report of all jobs.
pub fn merge_all(scene: &Scene, arguments: &Run, path: &Path) -> Result<Status, Error> {
    let mut progress = Progress::new();
    let end = merge(scene, arguments.digest.as_deref(), path, arguments.overwrite, &mut progress);
    progress.finish();
    match end? {
        MergeEnd::Done(report) => show(&report, path, arguments.common.json),
        MergeEnd::WasDone(holds) => {
            if arguments.common.json {
                let file = path.join("report.json");
                let text = std::fs::read_to_string(&file);
                out(&text.map_err(|reason| Error::read(&file, reason))?)?;
            } else {
                out(&format!(
                    "report: {}, which was made before\n",
                    path.join("report.md").display()
                ))?;
            }
            Ok(status_of(holds))
        }
        MergeEnd::Interrupted => {
            line("interrupted; the same command goes on");
            Ok(Status::Interrupted)
        }
    }
}

/// Prints the report of a run, as JSON or as a summary, and returns the exit status.
pub fn show(report: &Report, path: &Path, as_json: bool) -> Result<Status, Error> {
    if as_json {
        json(&render::json(report))?;
    } else {
        out(&terminal::summary(report, width()))?;
        out(&format!("report: {} and report.html\n", path.join("report.md").display()))?;
    }
    if !report.holds() {
        line("A CHECK DOES NOT HOLD: see the table above or the report");
    }
    Ok(status_of(report.holds()))
}
