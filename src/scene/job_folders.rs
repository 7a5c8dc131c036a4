//! The folders of jobs: their names, whether what one holds is whole, and who is at work in it.

use super::event::{Event, Observer};
use crate::error::Error;
use crate::io::{file_digest, write_atomically};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The folder below that of a run in which each job has one.
pub(super) const JOBS: &str = "jobs";
/// What says which job a folder is of, and whether it is done.
const JOB: &str = "job.json";
/// The data that a job has made.
pub(super) const DATA: &str = "data.json";
/// What depends on the machine.
pub(super) const TIMINGS: &str = "timings.json";
/// Held while a process is at work in a folder.
const LOCK: &str = "lock";

/// The folders of the jobs of a scene, or of one of its parts.
#[derive(Clone, Debug)]
pub(super) struct JobFolders {
    root: PathBuf,
    part: Option<String>,
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
    /// Those of a run in this folder.
    pub(super) fn of_run(path: &Path) -> Self {
        Self { root: path.join(JOBS), part: None }
    }

    pub(super) fn of_part(&self, part: &str) -> Self {
        Self { part: Some(part.to_owned()), ..self.clone() }
    }

    /// That of a job.
    pub(super) fn folder(&self, id: &str) -> PathBuf {
        self.root.join(id)
    }

    /// That of a training, by the name of its files.
    pub(super) fn training(&self, name: &str) -> PathBuf {
        self.folder(&training_id(self.part.as_deref(), name))
    }

    /// The file of the pairs of the set-up, or of those at an ε and a flow time.
    pub(super) fn data(&self, at: Option<(f64, f64)>) -> PathBuf {
        self.folder(&data_id(self.part.as_deref(), at)).join(DATA)
    }
}

/// What a folder says about its job.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct JobFile {
    job: String,
    digest: String,
    crate_version: String,
    /// The files of a job that is done, with their digests.
    files: Option<BTreeMap<String, String>>,
}

/// What the folder of a job holds.
pub(super) enum JobState {
    /// Nothing.
    Absent,
    /// What it has come to so far.
    UnderWay,
    /// All of it.
    Done,
    /// Another job: of another scene, version or file.
    Foreign,
    /// Something that is not whole, and what.
    Corrupt(String),
}

impl JobState {
    /// Of the job with this digest.
    pub(super) fn of(folder: &Path, digest: &str) -> Self {
        let file = folder.join(JOB);
        if !file.exists() {
            let empty = files_of(folder).is_empty();
            return if empty { Self::Absent } else { Self::Corrupt(format!("no {JOB}")) };
        }
        let read = std::fs::read(&file).ok();
        let Some(found) = read.and_then(|bytes| serde_json::from_slice::<JobFile>(&bytes).ok())
        else {
            return Self::Corrupt(format!("a {JOB} that cannot be read"));
        };
        if found.digest != digest {
            return Self::Foreign;
        }
        let Some(files) = found.files else { return Self::UnderWay };
        let whole = |(name, digest): (&String, &String)| {
            file_digest(&folder.join(name)).is_ok_and(|found| found == *digest)
        };
        match files.iter().find(|entry| !whole(*entry)) {
            Some((name, _)) => Self::Corrupt(format!("a {name} that is not the job's")),
            None => Self::Done,
        }
    }

    /// In words, of a job that should be done.
    pub(super) fn words(&self) -> String {
        match self {
            Self::Absent => "not begun".into(),
            Self::UnderWay => "begun and not done".into(),
            Self::Done => "done".into(),
            Self::Foreign => "of another scene, version or file".into(),
            Self::Corrupt(what) => what.clone(),
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

/// The names of the files that a job has written, in their order.
pub(super) fn files_of(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let of_network = |name: &str| name.starts_with("model") || is_checkpoint(name);
    let of_job = |name: &String| of_network(name) || name == DATA || name == TIMINGS;
    let mut names: Vec<String> = names.filter(of_job).collect();
    names.sort();
    names
}

/// Whether a file of this name is a checkpoint.
pub(super) fn is_checkpoint(name: &str) -> bool {
    name.starts_with("checkpoint")
}

/// Removes what a job has written.
pub(super) fn clear(folder: &Path) -> Result<(), Error> {
    let mut names = files_of(folder);
    names.push(JOB.into());
    for path in names.iter().map(|name| folder.join(name)).filter(|path| path.exists()) {
        std::fs::remove_file(&path).map_err(|reason| Error::write(&path, reason))?;
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
        let write = |reason| Error::write(folder, reason);
        std::fs::create_dir_all(folder).map_err(write)?;
        let file =
            File::options().create(true).append(true).open(folder.join(LOCK)).map_err(write)?;
        let mut waits = false;
        loop {
            match file.try_lock() {
                Ok(()) => return Ok(Some(Self { _file: Some(file) })),
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
