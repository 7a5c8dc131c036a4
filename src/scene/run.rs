//! Running a scene into a folder.

use super::citation::bibtex;
use super::command::as_part;
use super::context::{Context, RunError};
use super::event::{Event, Observer};
use super::figure::data_file_of;
use super::findings::StudyFindings;
use super::folder::{Folder, HTML};
use super::machine::Machine;
use super::registry::Scene;
use super::render::{html, json, markdown, svg};
use super::report::Report;
use crate::error::Error;

/// Runs a scene into a folder. Returns None when the observer interrupted it; a checkpoint is then
/// there to resume from. The parts of a scene run one after another, each in a folder of its own
/// below.
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
    scene.check_networks(&folder.file(""))?;
    folder.check_resumed(scene)?;
    folder.check_parts(scene)?;
    match run_checked(scene, folder, observer) {
        Ok(report) => Ok(Some(report)),
        Err(RunError::Interrupted) => Ok(None),
        Err(RunError::Failed(error)) => {
            if !folder.resumes() {
                folder.remove_bare_scenes();
            }
            Err(error)
        }
    }
}

fn run_checked(
    scene: &Scene,
    folder: &Folder,
    observer: &mut dyn Observer,
) -> Result<Report, RunError> {
    if !scene.is_of_unknown_action() {
        return run_complete(scene, folder, observer);
    }
    // A run that is interrupted while it looks for circle actions can be gone on with.
    if !folder.resumes() {
        folder.save_scene(scene)?;
    }
    let scene = scene.with_found_actions(observer)?.ok_or(RunError::Interrupted)?;
    scene.check_networks(&folder.file(""))?;
    run_complete(&scene, folder, observer)
}

fn run_complete(
    scene: &Scene,
    folder: &Folder,
    observer: &mut dyn Observer,
) -> Result<Report, RunError> {
    // A resumed run that turns out to be another one must not leave its name.
    if !folder.resumes() {
        folder.save_scene(scene)?;
    }
    let mut parts = Vec::new();
    for part in &scene.parts {
        observer.event(Event::Stage(&format!("part {}", part.name)));
        parts.push(run_complete(part, &folder.part(&part.name)?, observer)?);
    }
    let declared = scene.declared();
    let findings_of_parts: Vec<_> = parts.iter().map(as_part).collect();
    let mut context = Context::new(&declared, folder, &findings_of_parts, observer);
    let mut studies = Vec::new();
    for study in scene.all_studies() {
        let findings = study.run(&mut context)?;
        studies.push(StudyFindings { name: study.name(), findings });
    }
    let (training_times, stages) = context.into_times();
    observer.event(Event::Stage("report"));
    let (scene, machine) = (scene.clone(), Machine::this());
    let repeat = None;
    let report = Report { scene, studies, training_times, stages, machine, repeat, parts };
    write(folder, &report)?;
    Ok(report)
}

/// Writes the files of a report but for those of its parts.
pub(super) fn write(folder: &Folder, report: &Report) -> Result<(), Error> {
    folder.save_scene(&report.scene)?;
    for figure in report.studies.iter().flat_map(|study| &study.findings.figures) {
        svg::draw(&folder.file(&figure.file()), figure)?;
        folder.save_text(&data_file_of(figure.name), &figure.csv())?;
    }
    folder.save_timings(&json::timings(report))?;
    folder.save_text("report.md", &markdown(report))?;
    folder.save_text(HTML, &html(report, &bibtex(Some(&report.scene)))?)?;
    folder.save_json("report.json", &json::report(report))
}
