//! The folders of jobs: their names, whether what one holds is whole, and who is at work in it.

use super::event::{Event, Observer};
use crate::error::Error;
use crate::io::{TEMPORARY, file_digest, write_atomically};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// The folder below that of a run in which each job has one.
pub(super) const JOBS: &str = "jobs";
/// What says which job a folder is of, and whether it is done.
const JOB: &str = "job.json";
/// The data that a job has made.
pub(super) const DATA: &str = "data.json";
/// The network of a training, and the state from which it goes on.
pub(super) const MODEL: &str = "model.json";
pub(super) const CHECKPOINT: &str = "checkpoint";
/// What depends on the machine.
pub(super) const TIMINGS: &str = "timings.json";
/// Held while a process is at work in a folder.
const LOCK: &str = "lock";

/// The folders of the jobs of a scene, or of one of its parts.
#[derive(Clone, Debug)]
pub(super) struct JobFolders {
    root: PathBuf,
    part: Option<String>,
    /// Of each job of the plan.
    digests: Arc<BTreeMap<String, String>>,
}

/// The name of the job that makes the pairs of a part: those of its set-up, or those at an ε and a flow time.
pub(super) fn data_id(part: Option<&str>, at: Option<(f64, f64)>) -> String {
    let own = match at {
        None => "data".to_owned(),
        Some((epsilon, time)) => format!("data-at-{epsilon}-{time}").replace('.', "_"),
    };
    in_part(part, &own)
}

/// The name of the job of a training, by the name of its files.
pub(super) fn training_id(part: Option<&str>, name: &str) -> String {
    in_part(part, &format!("train-{name}"))
}

// Names are without points.
fn in_part(part: Option<&str>, name: &str) -> String {
    part.map_or_else(|| name.to_owned(), |part| format!("{part}.{name}"))
}

impl JobFolders {
    /// Those of a run in this folder, of jobs with these names and digests.
    pub(super) fn of_run(path: &Path, digests: BTreeMap<String, String>) -> Self {
        Self { root: path.join(JOBS), part: None, digests: Arc::new(digests) }
    }

    pub(super) fn of_part(&self, part: &str) -> Self {
        Self { part: Some(part.to_owned()), ..self.clone() }
    }

    /// The path of the folder of a job, given by the job's name.
    pub(super) fn folder(&self, id: &str) -> PathBuf {
        self.root.join(id)
    }

    /// That of a training, by the name of its files.
    pub(super) fn training(&self, name: &str) -> PathBuf {
        self.folder(&training_id(self.part.as_deref(), name))
    }

    /// The file of the pairs of the set-up, or of those at an ε and a flow time, and the digest of the job that makes
    /// it; none where the plan has no such job.
    pub(super) fn data(&self, at: Option<(f64, f64)>) -> Option<(PathBuf, &str)> {
        let id = data_id(self.part.as_deref(), at);
        let digest = self.digests.get(&id)?;
        Some((self.folder(&id).join(DATA), digest))
    }

    /// What the folder of a job of the plan holds.
    pub(super) fn state(&self, id: &str) -> Result<JobState, Error> {
        JobState::of(&self.folder(id), self.digests.get(id).map_or("", String::as_str))
    }
}

/// What a folder says about its job.
#[derive(Serialize, Deserialize)]
struct JobFile {
    job: String,
    digest: String,
    crate_version: String,
    /// The files of a job that is done, with their digests.
    files: Option<BTreeMap<String, String>>,
}

/// What the folder of a job holds.
pub(super) enum JobState {
    /// Nothing: no job was begun in the folder.
    Absent,
    /// What it has come to so far.
    UnderWay,
    /// All files of the job, as the job wrote them.
    Done,
    /// Another job, of another scene, version or file; or files of no job.
    Foreign,
    /// Something that is not whole, and what.
    Corrupt(String),
}

impl JobState {
    /// Of the job with this digest.
    ///
    /// # Errors
    /// [`Error::Read`] where a file is there and cannot be read: nothing is known of the job then.
    fn of(folder: &Path, digest: &str) -> Result<Self, Error> {
        let file = folder.join(JOB);
        if !is_there(&file)? {
            return Ok(if files_of(folder).is_empty() { Self::Absent } else { Self::Foreign });
        }
        let bytes = std::fs::read(&file).map_err(|reason| Error::read(&file, reason))?;
        let unreadable = || Self::Corrupt(format!("a {JOB} that is none"));
        let Ok(value) = serde_json::from_slice::<Value>(&bytes) else { return Ok(unreadable()) };
        // That of another version may have other fields.
        if value.get("digest").and_then(Value::as_str).is_some_and(|found| found != digest) {
            return Ok(Self::Foreign);
        }
        let Ok(found) = serde_json::from_value::<JobFile>(value) else { return Ok(unreadable()) };
        let Some(files) = found.files else { return Ok(Self::UnderWay) };
        for (name, digest) in &files {
            let path = folder.join(name);
            if !is_there(&path)? || file_digest(&path)? != *digest {
                return Ok(Self::Corrupt(format!("a {name} that is not the job's")));
            }
        }
        Ok(Self::Done)
    }

    /// In words, of a job that should be done.
    pub(super) fn words(&self) -> String {
        match self {
            Self::Absent => "not begun".into(),
            Self::UnderWay => "begun and not done".into(),
            Self::Done => "done".into(),
            Self::Foreign => "of another scene, version or file".into(),
            Self::Corrupt(what) => format!("with {what}"),
        }
    }
}

/// Says that a job has begun; or, with its files, that it is done.
pub(super) fn mark(
    folder: &Path,
    id: &str,
    digest: &str,
    files: Option<&[String]>,
) -> Result<(), Error> {
    let with_digest = |name: &String| Ok((name.clone(), file_digest(&folder.join(name))?));
    let files = files.map(|names| names.iter().map(with_digest).collect::<Result<_, Error>>());
    let (job, digest) = (id.to_owned(), digest.to_owned());
    let crate_version = env!("CARGO_PKG_VERSION").to_owned();
    let file = JobFile { job, digest, crate_version, files: files.transpose()? };
    write_atomically(&folder.join(JOB), |out| {
        serde_json::to_writer_pretty(&mut *out, &file)?;
        writeln!(out)
    })
}

fn is_there(path: &Path) -> Result<bool, Error> {
    path.try_exists().map_err(|reason| Error::read(path, reason))
}

/// The names of the files that a job has written, in their order.
pub(super) fn files_of(folder: &Path) -> Vec<String> {
    let of_job = |name: &str| is_checkpoint(name) || [DATA, TIMINGS, MODEL].contains(&name);
    regular_files(folder, of_job)
}

fn regular_files(folder: &Path, wanted: impl Fn(&str) -> bool) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let files = entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_file()));
    let names = files.filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|name| wanted(name)).collect();
    names.sort();
    names
}

/// Whether a file of the folder of a job is a checkpoint: of the last stage of a training, or with an addition.
pub(super) fn is_checkpoint(name: &str) -> bool {
    name.strip_prefix(CHECKPOINT).is_some_and(|rest| rest.is_empty() || rest.starts_with('-'))
}

/// Removes what a job has written.
pub(super) fn clear(folder: &Path) -> Result<(), Error> {
    // What says whose files they are goes last.
    let mut names = files_of(folder);
    names.push(JOB.into());
    remove(folder, &names)
}

fn remove(folder: &Path, names: &[String]) -> Result<(), Error> {
    for path in names.iter().map(|name| folder.join(name)) {
        if is_there(&path)? {
            std::fs::remove_file(&path).map_err(|reason| Error::write(&path, reason))?;
        }
    }
    Ok(())
}

/// A folder in which no other process is at work; until it is dropped, or the process ends in any way.
pub(super) struct Lock {
    /// None where the file system has no locks: files are whole in any case, and all who do a job write the same.
    _file: Option<File>,
}

impl Lock {
    /// Makes the folder, and waits for others; None when the observer stops it.
    pub(super) fn of(folder: &Path, observer: &mut dyn Observer) -> Result<Option<Self>, Error> {
        std::fs::create_dir_all(folder).map_err(|reason| Error::write(folder, reason))?;
        let path = folder.join(LOCK);
        let file = File::options().create(true).append(true).open(&path);
        let file = file.map_err(|reason| Error::write(&path, reason))?;
        let mut waits = false;
        loop {
            match file.try_lock() {
                Ok(()) => {
                    // Of a process that was killed while it wrote: no other one is writing here.
                    remove(folder, &regular_files(folder, |name| name.starts_with(TEMPORARY)))?;
                    return Ok(Some(Self { _file: Some(file) }));
                }
                Err(TryLockError::WouldBlock) if observer.interrupted() => return Ok(None),
                Err(TryLockError::WouldBlock) => {
                    if !waits {
                        observer.event(Event::Stage("another process is at work on this: waiting"));
                    }
                    waits = true;
                    std::thread::sleep(Duration::from_millis(100));
                }
                Err(TryLockError::Error(_)) => return Ok(Some(Self { _file: None })),
            }
        }
    }
}
