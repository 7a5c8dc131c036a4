//! The folder of a run.

use super::declaration::Scene;
use super::figure::{data_file_of, file_of};
use super::parse::parse;
use super::setup::ModelSpec;
use super::study::CHECKPOINTS;
use crate::error::Error;
use crate::io::write_atomically;
use crate::train::Leg;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The folder of a run.
#[derive(Clone, Debug)]
pub struct Folder {
    path: PathBuf,
    resume: bool,
    overwrite: bool,
}

/// The scene as it was run: what a folder is resumed and repeated from.
const AS_RUN: &str = "as-run.toml";
/// What depends on the machine.
const TIMINGS: &str = "timings.json";
/// The files that mark a folder as one of a run.
const MARKS: [&str; 5] = ["report.json", "report.md", AS_RUN, "checkpoint", "model.json"];

fn holds_run(path: &Path) -> bool {
    MARKS.iter().any(|mark| path.join(mark).exists())
}

impl Folder {
    /// Makes the folder and tests that it can be written.
    ///
    /// # Errors
    /// [`Error::OutputExists`] when it holds a run that is neither resumed nor
    /// overwritten; [`Error::Write`] when it cannot be written.
    pub fn open(path: &Path, resume: bool, overwrite: bool) -> Result<Self, Error> {
        let holds_run = holds_run(path);
        if holds_run && !resume && !overwrite {
            return Err(Error::OutputExists { path: path.to_owned() });
        }
        if resume && !path.join(AS_RUN).exists() {
            return Err(Error::content(
                path.display(),
                format!("an earlier run to resume, with its {AS_RUN}"),
                "none",
            ));
        }
        std::fs::create_dir_all(path).map_err(|reason| Error::write(path, reason))?;
        let folder = Self { path: path.to_owned(), resume, overwrite };
        tempfile::Builder::new()
            .prefix(".gyroceptron-")
            .tempfile_in(path)
            .map_err(|reason| Error::write(path, reason))?;
        if holds_run && !resume {
            folder.clear()?;
        }
        Ok(folder)
    }

    /// Fails when the folder holds a run.
    ///
    /// # Errors
    /// [`Error::OutputExists`].
    pub fn refuse_run(path: &Path) -> Result<(), Error> {
        match holds_run(path) {
            true => Err(Error::OutputExists { path: path.to_owned() }),
            false => Ok(()),
        }
    }

    /// Fails unless a run that is gone on with is of this scene: but for when it stops
    /// and how often it saves.
    pub(super) fn check_resumed(&self, scene: &Scene) -> Result<(), Error> {
        if !self.resume {
            return Ok(());
        }
        let path = self.file(AS_RUN);
        let text = std::fs::read_to_string(&path).map_err(|reason| Error::read(&path, reason))?;
        let earlier = parse(AS_RUN, &text)?;
        if earlier.without_ends() == scene.clone().without_ends() {
            return Ok(());
        }
        let (expected, found) = ("the scene that is run", "another");
        Err(Error::content(path.display(), expected, found))
    }

    /// Removes the files of the run that the folder holds, by their names, and
    /// nothing else.
    fn clear(&self) -> Result<(), Error> {
        let mut names: Vec<String> = MARKS.iter().map(|mark| (*mark).to_owned()).collect();
        names.extend(CHECKPOINTS.iter().chain([&TIMINGS]).map(|name| (*name).to_owned()));
        if let Ok(text) = std::fs::read_to_string(self.file(AS_RUN))
            && let Ok(earlier) = parse(AS_RUN, &text)
        {
            names.extend(earlier.plots.iter().map(|plot| file_of(plot)));
            names.extend(earlier.plots.iter().map(|plot| data_file_of(plot)));
            for attempt in earlier.attempts() {
                for leg in Leg::all(earlier.setup.training_of(&attempt.spec)) {
                    let suffix = leg.suffix();
                    names.push(format!("checkpoint{suffix}"));
                    names.push(format!("checkpoint-{}{suffix}", attempt.spec.name));
                }
                names.push(format!("model-{}.json", attempt.spec.name));
            }
            for part in &earlier.parts {
                let part = Self { path: self.file(&part.name), ..self.clone() };
                if part.path.is_dir() {
                    part.clear()?;
                }
            }
        }
        for name in names {
            let path = self.file(&name);
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

    /// The folder of a part, which need not have been begun.
    pub(super) fn part(&self, name: &str) -> Result<Self, Error> {
        let path = self.file(name);
        Self::open(&path, self.resumes_part(name), self.overwrite)
    }

    fn resumes_part(&self, name: &str) -> bool {
        self.resume && self.file(name).join(AS_RUN).exists()
    }

    /// Fails when the folder of a part holds a run that is not to be touched.
    pub(super) fn check_parts(&self, scene: &Scene) -> Result<(), Error> {
        for part in &scene.parts {
            let path = self.file(&part.name);
            if holds_run(&path) && !self.resumes_part(&part.name) && !self.overwrite {
                return Err(Error::OutputExists { path });
            }
        }
        Ok(())
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
        let read = serde_json::from_slice(&bytes);
        read.map(Some).map_err(|reason| Error::content(path.display(), "a checkpoint", reason))
    }

    /// Writes what [`Folder::earlier`] reads.
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

    /// The scene as it is run.
    pub(super) fn save_scene(&self, scene: &Scene) -> Result<(), Error> {
        let text = toml::to_string_pretty(scene)
            .map_err(|reason| Error::write(&self.file(AS_RUN), reason))?;
        self.save_text(AS_RUN, &text)
    }

    /// `model.json`, or `model-NAME.json` where a scene has several.
    pub(super) fn file_of_model(
        &self,
        scene: &Scene,
        stem: &str,
        spec: &ModelSpec,
        ending: &str,
    ) -> PathBuf {
        if scene.attempts().len() == 1 {
            self.file(&format!("{stem}{ending}"))
        } else {
            self.file(&format!("{stem}-{}{ending}", spec.name))
        }
    }
}
