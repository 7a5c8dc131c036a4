//! The folder of an earlier run: what is removed of it, and whether it is gone on with.

use super::figure::{data_file_of, file_of};
use super::folder::{AS_RUN, Folder, HTML};
use super::job_folders::TIMINGS;
use super::parse::parse;
use super::registry::{CHECKPOINTS, Scene};
use crate::error::Error;
use crate::io::TEMPORARY;
use crate::train::TrainingStage;
use std::path::Path;

/// The files that every report has.
const REPORT: [&str; 4] = ["report.json", "report.md", HTML, AS_RUN];
/// Files of a run that are of other use too.
const KEPT: [&str; 2] = ["checkpoint", "model.json"];

fn holds_report(path: &Path) -> bool {
    REPORT.iter().any(|mark| path.join(mark).exists())
}

fn holds_run(path: &Path) -> bool {
    holds_report(path) || KEPT.iter().any(|name| path.join(name).exists())
}

/// Fails where files that have the names of a run's are of none: nobody has asked to replace them.
fn check_replaced(path: &Path) -> Result<(), Error> {
    if holds_report(path) || !holds_run(path) {
        return Ok(());
    }
    let found = KEPT.iter().find(|name| path.join(name).exists()).unwrap_or(&"");
    let expected = "a run to replace, with its report";
    Err(Error::content(path.display(), expected, format!("{found} alone")))
}

/// The nearest folder that is there already, tried by a file.
fn probe(path: &Path) -> Result<(), Error> {
    let mut there = path;
    while !there.as_os_str().is_empty() && std::fs::symlink_metadata(there).is_err() {
        there = there.parent().unwrap_or(Path::new(""));
    }
    let there = if there.as_os_str().is_empty() { Path::new(".") } else { there };
    let file = tempfile::Builder::new().prefix(TEMPORARY).tempfile_in(there);
    file.map(drop).map_err(|reason| Error::write(path, reason))
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
        if !resume {
            check_replaced(path)?;
        }
        let is_new = !path.exists();
        std::fs::create_dir_all(path).map_err(|reason| Error::write(path, reason))?;
        let path_of = path.to_owned();
        let folder = Self { path: path_of, resume, overwrite, is_new, jobs: None, job_of: None };
        probe(path)?;
        if holds_run && !resume {
            folder.clear()?;
        }
        Ok(folder)
    }

    /// Removes the scene of a run that failed before anything else was written, also of its parts, so that the run can
    /// be called again as it was; with the folder, if it was made for this run. A folder that cannot be read stays as
    /// it is: the failure is what is reported.
    pub(super) fn remove_bare_scenes(&self) {
        fn is_removed(path: &Path) -> bool {
            let Ok(entries) = std::fs::read_dir(path) else { return false };
            let paths: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
            let (folders, files): (Vec<_>, Vec<_>) = paths.into_iter().partition(|p| p.is_dir());
            // All are looked at, also after one that is not bare.
            let bare = folders.iter().filter(|folder| !is_removed(folder)).count() == 0;
            let own = path.join(AS_RUN);
            bare && files.iter().all(|file| *file == own)
                && (files.is_empty() || std::fs::remove_file(&own).is_ok())
        }
        if is_removed(&self.path) && self.is_new {
            // With those of its parts.
            let _ = std::fs::remove_dir_all(&self.path);
        }
    }

    /// Whether files of a run are in this folder.
    pub(super) fn holds_run(path: &Path) -> bool {
        holds_run(path)
    }

    /// Whether a run was begun in this folder.
    pub(super) fn holds_scene(path: &Path) -> bool {
        path.join(AS_RUN).exists()
    }

    /// Whether the run in a folder is of this scene, but for when it stops and how often it saves.
    ///
    /// # Errors
    /// When it cannot be read.
    pub(super) fn is_of(path: &Path, scene: &Scene) -> Result<bool, Error> {
        let path = path.join(AS_RUN);
        if !path.exists() {
            return Ok(false);
        }
        let text = std::fs::read_to_string(&path).map_err(|reason| Error::read(&path, reason))?;
        let earlier = parse(AS_RUN, &text)?;
        Ok(earlier.without_ends() == scene.clone().without_ends())
    }

    /// Makes the folder of a report without networks; its figures replace those of an earlier report.
    ///
    /// # Errors
    /// Those of [`Folder::check_report`].
    pub fn open_report(path: &Path, overwrite: bool) -> Result<Self, Error> {
        Self::check_report(path, overwrite)?;
        std::fs::create_dir_all(path).map_err(|reason| Error::write(path, reason))?;
        let path = path.to_owned();
        let is_new = false;
        let folder = Self { path, resume: false, overwrite, is_new, jobs: None, job_of: None };
        folder.remove(&folder.names_of_report(folder.earlier_scene().as_ref()))?;
        Ok(folder)
    }

    /// Fails unless a report can be written to this folder, which need not exist yet. Meant for a check in advance.
    ///
    /// # Errors
    /// [`Error::OutputExists`] when the folder holds a report that is not overwritten; [`Error::Content`] when it is of
    /// a run with networks; [`Error::Write`] when it cannot be written.
    pub fn check_report(path: &Path, overwrite: bool) -> Result<(), Error> {
        if holds_run(path) && !overwrite {
            return Err(Error::OutputExists { path: path.to_owned() });
        }
        let of_run = |name: &str| name.starts_with("model") || name.starts_with("checkpoint");
        let mut names = std::fs::read_dir(path).into_iter().flatten().flatten();
        let found = names.find(|entry| entry.file_name().to_str().is_some_and(of_run));
        if let (true, Some(found)) = (holds_report(path), found) {
            let expected = "a report without networks, or another folder";
            return Err(Error::content(path.display(), expected, found.file_name().display()));
        }
        probe(path)
    }

    /// Fails unless a run that is gone on with is of this scene: but for when it stops
    /// and how often it saves.
    pub(super) fn check_resumed(&self, scene: &Scene) -> Result<(), Error> {
        if !self.resume {
            return Ok(());
        }
        match Self::is_of(&self.path, scene)? {
            true => Ok(()),
            false => {
                let (expected, found) = ("the scene that is run", "another");
                Err(Error::content(self.file(AS_RUN).display(), expected, found))
            }
        }
    }

    /// Removes the files of the run that the folder holds, by their names, and
    /// nothing else.
    fn clear(&self) -> Result<(), Error> {
        let earlier = self.earlier_scene();
        let mut names = self.names_of_report(earlier.as_ref());
        names.extend(KEPT.iter().chain(&CHECKPOINTS).map(|name| (*name).to_owned()));
        if let Some(earlier) = earlier {
            for training in earlier.trainings() {
                for stage in TrainingStage::all(earlier.setup.training_of(&training.spec)) {
                    let suffix = stage.suffix();
                    names.push(format!("checkpoint{suffix}"));
                    names.push(format!("checkpoint-{}{suffix}", training.spec.name));
                }
                names.push(format!("model-{}.json", training.spec.name));
            }
            for part in &earlier.parts {
                let part = Self { path: self.file(&part.name), ..self.clone() };
                if part.path.is_dir() {
                    part.clear()?;
                }
            }
        }
        self.remove(&names)
    }

    /// The scene of the run or the report that the folder holds, if it can be read.
    fn earlier_scene(&self) -> Option<Scene> {
        let text = std::fs::read_to_string(self.file(AS_RUN)).ok()?;
        parse(AS_RUN, &text).ok()
    }

    /// The files of a report and its figures.
    fn names_of_report(&self, scene: Option<&Scene>) -> Vec<String> {
        let fixed = REPORT.iter().chain([&TIMINGS]).map(|name| (*name).to_owned());
        let plots = scene.into_iter().flat_map(|scene| &scene.plots);
        fixed.chain(plots.flat_map(|plot| [file_of(plot), data_file_of(plot)])).collect()
    }

    /// The folder of a part, which need not have been begun.
    pub(super) fn part(&self, name: &str) -> Result<Self, Error> {
        let path = self.file(name);
        let jobs = self.jobs.as_ref().map(|jobs| jobs.of_part(name));
        Ok(Self { jobs, ..Self::open(&path, self.resumes_part(name), self.overwrite)? })
    }

    fn resumes_part(&self, name: &str) -> bool {
        self.resume && self.file(name).join(AS_RUN).exists()
    }

    /// Fails when the folder of a part holds a run that is not to be touched.
    pub(super) fn check_parts(&self, scene: &Scene) -> Result<(), Error> {
        for part in &scene.parts {
            let path = self.file(&part.name);
            if self.resumes_part(&part.name) {
                continue;
            }
            if holds_run(&path) && !self.overwrite {
                return Err(Error::OutputExists { path });
            }
            check_replaced(&path)?;
        }
        Ok(())
    }

    /// The scene as it is run.
    pub(super) fn save_scene(&self, scene: &Scene) -> Result<(), Error> {
        self.save_text(AS_RUN, &scene.to_toml()?)
    }
}
