//! The folder of a run.

use super::declared::Declared;
use super::job_folders::{JobFolders, TIMINGS};
use super::made_data::MadeData;
use super::setup::ModelSpec;
use crate::error::Error;
use crate::io::write_atomically;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::PathBuf;

/// The folder of a run.
#[derive(Clone, Debug)]
pub struct Folder {
    pub(super) path: PathBuf,
    pub(super) resume: bool,
    pub(super) overwrite: bool,
    /// It was made for this run.
    pub(super) is_new: bool,
    /// The jobs that have made data, and trained networks, for what is done here.
    pub(super) jobs: Option<JobFolders>,
    /// The training, by the name of its files, that is the job which is done here: others are gone on with from
    /// folders of their own.
    pub(super) job_of: Option<String>,
}

/// The scene as it was run: what a folder is resumed and repeated from.
pub(super) const AS_RUN: &str = "as-run.toml";
/// The report as a page.
pub(super) const HTML: &str = "report.html";

impl Folder {
    pub(super) fn remove(&self, names: &[String]) -> Result<(), Error> {
        for name in names {
            let path = self.file(name);
            if path.is_file() {
                std::fs::remove_file(&path).map_err(|reason| Error::write(&path, reason))?;
            }
        }
        Ok(())
    }

    /// A file in the folder.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Whether a run goes on with what is there.
    pub(super) fn resumes(&self) -> bool {
        self.resume
    }

    /// The timings of the run that is gone on with, if they can be read.
    pub(super) fn earlier_timings(&self) -> Option<Value> {
        let bytes =
            if self.resume { std::fs::read(self.file(TIMINGS)).ok()? } else { return None };
        serde_json::from_slice(&bytes).ok()
    }

    /// A file of the run that is gone on with; None where there is none, or where the run
    /// is a new one.
    pub(super) fn earlier<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>, Error> {
        let path = self.file(name);
        if !self.resume || !path.exists() {
            return Ok(None);
        }
        let bytes = std::fs::read(&path).map_err(|reason| Error::read(&path, reason))?;
        let read = serde_json::from_slice::<Value>(&bytes).and_then(serde_json::from_value);
        read.map(Some).map_err(|reason| Error::content(path.display(), "a checkpoint", reason))
    }

    /// Writes a value as JSON to a file that [`Folder::earlier`] reads.
    pub(super) fn save(&self, name: &str, value: &impl Serialize) -> Result<(), Error> {
        write_atomically(&self.file(name), |out| Ok(serde_json::to_writer(&mut *out, value)?))
    }

    pub(super) fn save_timings(&self, timings: &Value) -> Result<(), Error> {
        self.save_json(TIMINGS, timings)
    }

    pub(super) fn save_json(&self, name: &str, value: &Value) -> Result<(), Error> {
        write_atomically(&self.file(name), |out| {
            serde_json::to_writer_pretty(&mut *out, value)?;
            writeln!(out)
        })
    }

    pub(super) fn save_text(&self, name: &str, text: &str) -> Result<(), Error> {
        write_atomically(&self.file(name), |out| out.write_all(text.as_bytes()))
    }

    /// `model.json`, or `model-NAME.json` where a scene has several.
    pub(super) fn file_of_model(
        &self,
        scene: &Declared<'_>,
        stem: &str,
        spec: &ModelSpec,
        ending: &str,
    ) -> PathBuf {
        match (&self.jobs, &self.job_of) {
            // A job is of one training, however many others its scene has.
            (Some(jobs), Some(_)) => jobs.training(&spec.name).join(format!("{stem}{ending}")),
            _ if scene.trainings == 1 => self.file(&format!("{stem}{ending}")),
            _ => self.file(&format!("{stem}-{}{ending}", spec.name)),
        }
    }

    /// Whether the files of a training are written by what is done here: not where another job has.
    pub(super) fn writes(&self, training: &str) -> bool {
        self.job_of.as_ref().is_none_or(|own| own == training)
    }

    /// The pairs of the set-up, or those at an ε and a flow time, where a job has made them.
    pub(super) fn made_data(&self, at: Option<(f64, f64)>) -> Result<Option<MadeData>, Error> {
        let Some((path, digest)) = self.jobs.as_ref().and_then(|jobs| jobs.data(at)) else {
            return Ok(None);
        };
        if !path.exists() {
            return Ok(None);
        }
        let bytes = std::fs::read(&path).map_err(|reason| Error::read(&path, reason))?;
        let place = || path.display();
        let made: MadeData = serde_json::from_slice(&bytes)
            .map_err(|reason| Error::content(place(), "data of a job", reason))?;
        match made.digest == digest {
            true => Ok(Some(made)),
            false => Err(Error::content(place(), format!("data of the job {digest}"), made.digest)),
        }
    }
}
