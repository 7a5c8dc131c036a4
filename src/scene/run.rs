//! Running a scene into a folder, and telling how it goes.

use super::comparison::compare_tanh;
use super::comparison_words::tanh_panels;
use super::declaration::{ModelSpec, Plot, Scene, parse};
use super::experiment::experiment;
use super::figures::tanh_caption;
use super::plot::draw;
use super::report::Report;
use super::results::Timings;
use super::timings_words::timings_markdown;
use crate::error::Error;
use crate::io::write_atomically;
use crate::train::{Stop, TrainingRecord};
use std::path::{Path, PathBuf};

/// What a run tells while it goes on.
#[derive(Debug)]
pub enum Event<'a> {
    /// A stage begins.
    Stage(&'a str),
    /// An iteration of training is done.
    Iteration {
        /// The network's name.
        model: &'a str,
        /// Its newest record.
        record: TrainingRecord,
        /// The most iterations there will be.
        iterations: u64,
    },
    /// A network is trained.
    Trained {
        /// The network's name.
        model: &'a str,
        /// Why training ended.
        stop: Stop,
        /// The record of the model that was kept.
        best: TrainingRecord,
    },
}

/// Listens to a run, and may stop it.
pub trait Observer {
    /// Something happened.
    fn event(&mut self, event: Event<'_>);

    /// True when the run should stop at the next iteration, with a checkpoint.
    fn interrupted(&self) -> bool {
        false
    }
}

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

    /// Removes the files of the run that the folder holds, by their names, and
    /// nothing else.
    fn clear(&self) -> Result<(), Error> {
        let mut names: Vec<String> = MARKS.iter().map(|mark| (*mark).to_owned()).collect();
        names.push(TIMINGS.into());
        names.extend(Plot::ALL.iter().map(|plot| plot.file().to_owned()));
        if let Ok(text) = std::fs::read_to_string(self.file(AS_RUN))
            && let Ok(earlier) = parse(AS_RUN, &text)
        {
            for spec in &earlier.models {
                names.push(format!("checkpoint-{}", spec.name));
                names.push(format!("model-{}.json", spec.name));
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
    fn part(&self, name: &str) -> Result<Self, Error> {
        let path = self.file(name);
        Self::open(&path, self.resumes_part(name), self.overwrite)
    }

    fn resumes_part(&self, name: &str) -> bool {
        self.resume && self.file(name).join(AS_RUN).exists()
    }

    /// Fails when the folder of a part holds a run that is not to be touched.
    fn check_parts(&self, scene: &Scene) -> Result<(), Error> {
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

    /// The timings of the run that is gone on with.
    pub(super) fn earlier_timings(&self) -> Timings {
        let bytes = if self.resume { std::fs::read(self.file(TIMINGS)).ok() } else { None };
        bytes.and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default()
    }

    pub(super) fn save_timings(&self, timings: &Timings) -> Result<(), Error> {
        write_atomically(&self.file(TIMINGS), |out| {
            serde_json::to_writer_pretty(out, timings)?;
            Ok(())
        })
    }

    /// `model.json`, or `model-NAME.json` where a scene has several.
    pub(super) fn own(&self, scene: &Scene, stem: &str, spec: &ModelSpec, ending: &str) -> PathBuf {
        if scene.models.len() == 1 {
            self.file(&format!("{stem}{ending}"))
        } else {
            self.file(&format!("{stem}-{}{ending}", spec.name))
        }
    }
}

/// Runs a scene into a folder; None when the observer interrupted it, in which
/// case a checkpoint is there to resume from. The parts of a scene run one after
/// another, each in a folder of its own below.
///
/// # Errors
/// When the scene is incomplete, a computation fails, a checkpoint does not
/// belong to the scene, or a file cannot be written.
pub fn run(
    scene: &Scene,
    folder: &Folder,
    observer: &mut dyn Observer,
) -> Result<Option<Report>, Error> {
    scene.complete()?;
    folder.check_parts(scene)?;
    Ok(run_timed(scene, folder, observer)?.map(|(report, _)| report))
}

fn run_timed(
    scene: &Scene,
    folder: &Folder,
    observer: &mut dyn Observer,
) -> Result<Option<(Report, Timings)>, Error> {
    let text = toml::to_string_pretty(scene)
        .map_err(|reason| Error::write(&folder.file(AS_RUN), reason))?;
    let save_scene =
        || write_atomically(&folder.file(AS_RUN), |out| out.write_all(text.as_bytes()));
    // A resumed run that turns out to be another one must not leave its name.
    if !folder.resume {
        save_scene()?;
    }

    let mut timings = Timings::default();
    let mut parts = Vec::new();
    for part in &scene.parts {
        observer.event(Event::Stage(&format!("part {}", part.name)));
        let Some((report, own)) = run_timed(part, &folder.part(&part.name)?, observer)? else {
            return Ok(None);
        };
        parts.push(report);
        timings.parts.push(own);
    }
    let mut figures = Vec::new();
    let own = if scene.is_experiment() {
        let Some((own, drawn)) = experiment(scene, folder, observer, &mut timings)? else {
            return Ok(None);
        };
        figures = drawn;
        Some(own)
    } else {
        None
    };
    if let Some(spec) = &scene.tanh {
        observer.event(Event::Stage("tanh and sech²"));
        timings.tanh = compare_tanh(spec, scene.seed)?;
        if scene.plots.contains(&Plot::Tanh) {
            draw(&folder.file(Plot::Tanh.file()), &tanh_panels(&timings.tanh))?;
            figures.push((Plot::Tanh.file().into(), tanh_caption()));
        }
    }
    let report = Report {
        crate_version: env!("CARGO_PKG_VERSION").into(),
        scene: scene.clone(),
        experiment: own,
        tanh: timings.tanh.iter().filter_map(|way| way.as_result()).collect(),
        parts,
    };
    observer.event(Event::Stage("report"));
    save_scene()?;
    folder.save_timings(&timings)?;
    let markdown = report.markdown(&timings_markdown(&timings, &report), &figures);
    write_atomically(&folder.file("report.md"), |out| out.write_all(markdown.as_bytes()))?;
    write_atomically(&folder.file("report.json"), |out| {
        serde_json::to_writer_pretty(&mut *out, &report)?;
        writeln!(out)
    })?;
    Ok(Some((report, timings)))
}
