//! Doing jobs of a scene, each in a folder of its own, and the report out of all of them.

use super::context::{Context, RunError};
use super::event::{Event, Observer};
use super::folder::Folder;
use super::job_folders::{
    CHECKPOINT, DATA, JobFolders, JobState, Lock, TIMINGS, clear, files_of, is_checkpoint, mark,
};
use super::log::TrainingTimes;
use super::machine::Machine;
use super::made_data::{Made, MadeData};
use super::nearest::nearest;
use super::plan::{Job, MERGE, Task};
use super::registry::{AnyStudy, Scene};
use super::report::Report;
use super::run::run;
use super::setup::StudyTraining;
use super::study::shared::Study;
use crate::error::Error;
use crate::io::{load_checkpoint, write_atomically};
use serde_json::{Value, json};
use std::path::Path;

/// How doing a job ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobEnd {
    /// The job was done by this call.
    Done,
    /// It was done before, and its files are there.
    WasDone,
    /// The observer interrupted it. When it is asked for again, it goes on where it stopped.
    Interrupted,
}

/// How making the report of jobs ended.
#[derive(Clone, Debug)]
pub enum MergeEnd {
    /// The report was made by this call.
    Done(Box<Report>),
    /// The report was made before, and is there; true if none of its verdicts says that something does not hold.
    WasDone(bool),
    /// The observer interrupted the making of the report.
    Interrupted,
}

/// A job, given by its name, and the digest of all that its result depends on.
#[derive(Clone, Copy, Debug)]
pub struct JobRequest<'a> {
    /// The name of the job in the plan of its scene.
    pub id: &'a str,
    /// The digest that the job must have, if any: that of the plan.
    pub digest: Option<&'a str>,
}

/// Does a job of a scene in a folder of its own, below that of the run.
///
/// A job that is done is not done again. A job that was begun goes on from its checkpoint, and one whose files are not
/// as it wrote them is done anew. If another process is doing the same job, this one waits for it. Files are written
/// whole, and the job is marked as done when all of them are there.
///
/// # Errors
/// When no job of the scene has the name, or it has another digest; when a job that it needs is not done; when the
/// folder holds a job of another scene and `overwrite` is false; when files of the scene change meanwhile; those of
/// [`run`].
pub fn run_job(
    scene: &Scene,
    request: JobRequest<'_>,
    path: &Path,
    overwrite: bool,
    observer: &mut dyn Observer,
) -> Result<JobEnd, Error> {
    let Some(scene) = &scene.with_found_actions(observer)? else { return Ok(JobEnd::Interrupted) };
    scene.check_networks(path)?;
    let planned = Planned::of(scene, path)?;
    let job = planned.find(request.id)?;
    check_digest(job, request.digest)?;
    let folder = planned.folders.folder(&job.id);
    // Of a job that is done, the folder need not be one that can be written.
    if matches!(planned.folders.state(&job.id)?, JobState::Done) {
        return Ok(JobEnd::WasDone);
    }
    planned.check_needs(job)?;
    let Some(_lock) = Lock::of(&folder, observer)? else { return Ok(JobEnd::Interrupted) };
    // All may have changed while another process held the lock.
    let (before, planned) = (job.digest.clone(), Planned::of(scene, path)?);
    let job = planned.find(request.id)?;
    check_digest(job, Some(&before))?;
    planned.check_needs(job)?;
    match planned.folders.state(&job.id)? {
        JobState::Done => return Ok(JobEnd::WasDone),
        JobState::Foreign if !overwrite => return Err(Error::OutputExists { path: folder }),
        JobState::UnderWay => drop_unreadable(&folder, observer)?,
        JobState::Absent => {}
        JobState::Foreign => clear(&folder)?,
        JobState::Corrupt(what) => {
            let words = format!("the folder of job {} holds {what}: it is done again", job.id);
            observer.event(Event::Stage(&words));
            clear(&folder)?;
        }
    }
    mark(&folder, &job.id, &job.digest, None)?;
    match do_job(scene, job, &planned.folders, observer) {
        Ok(()) => {
            check_digest(Planned::of(scene, path)?.find(request.id)?, Some(&before))?;
            mark(&folder, &job.id, &job.digest, Some(&files_of(&folder)))?;
            Ok(JobEnd::Done)
        }
        Err(RunError::Interrupted) => Ok(JobEnd::Interrupted),
        Err(RunError::Failed(error)) => Err(error),
    }
}

/// The plan of a scene, and the folders of its jobs.
struct Planned {
    jobs: Vec<Job>,
    folders: JobFolders,
}

impl Planned {
    fn of(scene: &Scene, path: &Path) -> Result<Self, Error> {
        let jobs = scene.plan()?;
        let digests = jobs.iter().map(|job| (job.id.clone(), job.digest.clone())).collect();
        Ok(Self { jobs, folders: JobFolders::of_run(path, digests) })
    }

    /// A data set or a training.
    fn find(&self, id: &str) -> Result<&Job, Error> {
        let jobs = || self.jobs.iter().filter(|job| job.id != MERGE);
        jobs().find(|job| job.id == id).ok_or_else(|| {
            let near = nearest(id, jobs().map(|job| &job.id[..]));
            let near = near.map(|near| format!(", such as {near}")).unwrap_or_default();
            Error::invalid("job", id, format!("a data set or a training of the plan{near}"))
        })
    }

    /// That which makes the report.
    fn merge(&self) -> Result<&Job, Error> {
        let found = self.jobs.iter().find(|job| job.id == MERGE);
        found.ok_or_else(|| Error::invalid("job", MERGE, "a job of the plan"))
    }

    fn check_needs(&self, job: &Job) -> Result<(), Error> {
        let mut missing = Vec::new();
        for need in &job.needs {
            let state = self.folders.state(need)?;
            if !matches!(state, JobState::Done) {
                missing.push(format!("{need} ({})", state.words()));
            }
        }
        let place = format!("job {}", job.id);
        match &missing[..] {
            [] => Ok(()),
            _ => Err(Error::content(place, "jobs before it that are done", missing.join(", "))),
        }
    }
}

/// Fails where the job of a plan has another digest.
fn check_digest(job: &Job, expected: Option<&str>) -> Result<(), Error> {
    match expected.filter(|digest| *digest != job.digest) {
        None => Ok(()),
        Some(expected) => {
            let place = format!("job {}", job.id);
            let expected = format!("the digest of its plan, {expected}");
            let found = format!("{}: scene, version or a file is another", job.digest);
            Err(Error::content(place, expected, found))
        }
    }
}

/// Removes checkpoints that a crash of the machine has left unreadable.
fn drop_unreadable(folder: &Path, observer: &mut dyn Observer) -> Result<(), Error> {
    for name in files_of(folder).into_iter().filter(|name| is_checkpoint(name)) {
        let path = folder.join(&name);
        if let Err(reason) = load_checkpoint(&path) {
            observer.event(Event::Stage(&format!("{reason}: it is not gone on with")));
            std::fs::remove_file(&path).map_err(|reason| Error::write(&path, reason))?;
        }
    }
    Ok(())
}

/// The part of a scene that a job is of.
fn part_of<'a>(scene: &'a Scene, job: &Job) -> &'a Scene {
    let named = |name: &String| scene.parts.iter().find(|part| part.name == *name);
    job.part.as_ref().and_then(named).unwrap_or(scene)
}

fn do_job(
    scene: &Scene,
    job: &Job,
    folders: &JobFolders,
    observer: &mut dyn Observer,
) -> Result<(), RunError> {
    let of_part = part_of(scene, job);
    let jobs = job.part.as_ref().map_or_else(|| folders.clone(), |part| folders.of_part(part));
    let path = folders.folder(&job.id);
    let name = match &job.task {
        Task::Own(training) => &training.spec.name,
        Task::OfStudy(training) => &training.training.spec.name,
        Task::Data(_) | Task::Merge => "",
    };
    let job_of = Some(name.to_owned());
    let (is_new, jobs) = (false, Some(jobs));
    let folder = Folder { path, resume: true, overwrite: false, is_new, jobs, job_of };
    let declared = of_part.declared();
    let mut context = Context::new(&declared, &folder, &[], observer);
    let mut made = None;
    match &job.task {
        Task::Data(None)
            if declared.setup.data.as_ref().is_some_and(|data| data.lines.is_some()) =>
        {
            made = Some(Made::Lines(Box::new(context.lines()?.made())));
        }
        Task::Data(None) => made = Some(Made::Pairs(Box::new((&*context.data()?).into()))),
        Task::Data(Some((epsilon, time))) => {
            made = Some(Made::Pairs(Box::new((&*context.data_at(*epsilon, *time)?).into())));
        }
        Task::Own(training) => drop(context.of_setup(&training.spec.name)?),
        Task::OfStudy(training) => train_of_study(of_part, training, &mut context)?,
        Task::Merge => {}
    }
    let (mut times, stages) = context.into_times();
    if let Some(data) = made {
        let digest = job.digest.clone();
        folder.save(DATA, &MadeData { digest, data, stages: stages.clone() })?;
    }
    times.retain(|of| of.model == name);
    let timings = json!({ "machine": Machine::this(), "models": times, "stages": stages });
    folder.save_timings(&timings)?;
    Ok(())
}

fn train_of_study(
    scene: &Scene,
    training: &StudyTraining,
    context: &mut Context<'_>,
) -> Result<(), RunError> {
    let name = &training.training.spec.name;
    let has = |study: &&dyn Study| {
        study.trainings(&scene.setup).iter().any(|own| own.training.spec.name == *name)
    };
    match scene.studies.iter().map(AnyStudy::study).find(has) {
        Some(study) => study.train(context, training).map(drop),
        None => Err(Error::invalid("training", name, "one of a study").into()),
    }
}

/// Fails if the report of the jobs of a scene would replace another run. Meant for a check before the jobs are done.
///
/// # Errors
/// [`Error::OutputExists`] with the folder; those of [`Scene::plan`] and [`Scene::check_networks`].
pub fn check_merge(scene: &Scene, path: &Path, overwrite: bool) -> Result<(), Error> {
    scene.check_networks(path)?;
    let folders = Planned::of(scene, path)?.folders;
    let check = || match folders.state(MERGE)? {
        _ if overwrite => Ok(()),
        JobState::Done => Ok(()),
        state => check_places(scene, path, matches!(state, JobState::UnderWay)),
    };
    // Another process may have begun with this report between two looks.
    check().or_else(|_| check())
}

/// Fails where a run is in the folder of a scene, or of one of its parts; but for this one where it was `begun`.
fn check_places(scene: &Scene, path: &Path, begun: bool) -> Result<(), Error> {
    let parts = scene.parts.iter().map(|part| (part, path.join(&part.name)));
    for (scene, path) in parts.chain([(scene, path.to_owned())]) {
        if Folder::holds_run(&path) && !(begun && Folder::is_of(&path, scene)?) {
            return Err(Error::OutputExists { path });
        }
    }
    Ok(())
}

/// Makes the report of a run from its jobs, all of which are done; it is the report that a run in one process makes.
/// `digest` is that of the report in a plan, if it must be the same.
///
/// A report that was made before is not made again; one that was interrupted goes on.
///
/// # Errors
/// When a job is not done, or is of another scene, by their names; [`Error::OutputExists`] when the folder holds a run
/// that is of other jobs, and is not overwritten; those of [`run`].
pub fn merge(
    scene: &Scene,
    digest: Option<&str>,
    path: &Path,
    overwrite: bool,
    observer: &mut dyn Observer,
) -> Result<MergeEnd, Error> {
    let found = scene.with_found_actions(observer)?;
    let Some(scene) = &found else { return Ok(MergeEnd::Interrupted) };
    scene.check_networks(path)?;
    let planned = Planned::of(scene, path)?;
    check_digest(planned.merge()?, digest)?;
    planned.check_needs(planned.merge()?)?;
    check_merge(scene, path, overwrite)?;
    let own = planned.folders.folder(MERGE);
    let Some(_lock) = Lock::of(&own, observer)? else { return Ok(MergeEnd::Interrupted) };
    // All may have changed while another process held the lock.
    let (before, planned) = (planned.merge()?.digest.clone(), Planned::of(scene, path)?);
    let (job, folders) = (planned.merge()?, &planned.folders);
    check_digest(job, Some(&before))?;
    planned.check_needs(job)?;
    let begun = match folders.state(MERGE)? {
        JobState::Done if !overwrite => return holds(path).map(MergeEnd::WasDone),
        JobState::UnderWay => !overwrite,
        _ => false,
    };
    if !overwrite {
        check_places(scene, path, begun)?;
    }
    let resume = begun && Folder::holds_scene(path);
    let mut folder = Folder::open(path, resume, overwrite)?;
    folder.check_parts(scene)?;
    mark(&own, MERGE, &job.digest, None)?;
    folder.jobs = Some(folders.clone());
    folder.save_scene(scene)?;
    match &scene.parts[..] {
        [] => gather(&planned, scene, None, &folder)?,
        parts => {
            for part in parts {
                let of_part = folder.part(&part.name)?;
                of_part.save_scene(part)?;
                gather(&planned, part, Some(&part.name), &of_part)?;
            }
        }
    }
    folder.resume = true;
    let Some(report) = run(scene, &folder, observer)? else { return Ok(MergeEnd::Interrupted) };
    check_digest(Planned::of(scene, path)?.merge()?, Some(&before))?;
    // What is beside it has seconds, which a run that goes on with this one has others of.
    mark(&own, MERGE, &job.digest, Some(&["../../report.json".into()]))?;
    Ok(MergeEnd::Done(Box::new(report)))
}

/// Whether the report in a folder says that all holds.
fn holds(path: &Path) -> Result<bool, Error> {
    let file = path.join("report.json");
    let bytes = std::fs::read(&file).map_err(|reason| Error::read(&file, reason))?;
    let value: Option<Value> = serde_json::from_slice(&bytes).ok();
    let holds = value.and_then(|value| value.get("holds")?.as_bool());
    holds.ok_or_else(|| Error::content(file.display(), "a report", "none"))
}

/// Copies the checkpoints of the trainings of a part into its folder, under the names of a run, and reports their
/// times.
fn gather(
    planned: &Planned,
    scene: &Scene,
    part: Option<&str>,
    folder: &Folder,
) -> Result<(), Error> {
    let mut times: Vec<TrainingTimes> = Vec::new();
    let declared = scene.declared();
    for job in planned.jobs.iter().filter(|job| job.part.as_deref() == part) {
        let spec = match &job.task {
            Task::Own(training) => &training.spec,
            Task::OfStudy(training) => &training.training.spec,
            Task::Data(_) | Task::Merge => continue,
        };
        let from = planned.folders.folder(&job.id);
        for name in files_of(&from) {
            let Some(stage) = name.strip_prefix(CHECKPOINT) else { continue };
            let (source, target) =
                (from.join(&name), folder.file_of_model(&declared, CHECKPOINT, spec, stage));
            let mut file =
                std::fs::File::open(&source).map_err(|reason| Error::read(&source, reason))?;
            write_atomically(&target, |out| std::io::copy(&mut file, out).map(drop))?;
        }
        let timings = std::fs::read(from.join(TIMINGS)).ok();
        let timings = timings.and_then(|bytes| serde_json::from_slice::<Value>(&bytes).ok());
        let of_job: Option<Vec<_>> =
            timings.and_then(|timings| serde_json::from_value(timings.get("models")?.clone()).ok());
        times.extend(of_job.unwrap_or_default());
    }
    folder.save_timings(&json!({ "models": times }))
}
