//! The command that runs a part alone, and what studies see of the part.

use super::catalogue::find;
use super::part::Part;
use super::registry::Scene;
use super::report::Report;
use super::study::claims::Row;

/// A part, with its command.
pub(super) fn as_part(report: &Report) -> Part<'_> {
    Part {
        name: &report.scene.name,
        title: &report.scene.title,
        epsilon: report.scene.setup.target().map(|target| target.epsilon()),
        studies: &report.studies,
        training_times: &report.training_times,
        command: command(&report.scene),
    }
}

/// The verdict of a part that is an experiment of the paper.
pub fn verdict(part: &Report) -> Option<String> {
    Row::of(&as_part(part)).map(|row| row.verdict)
}

/// The command that runs a part as it was run, where it is a built-in scene or its short
/// form.
pub fn command(part: &Scene) -> String {
    let changed = || "`as-run.toml` in its folder: not the built-in scene".to_owned();
    let Ok(built_in) = find(&part.name).and_then(|entry| entry.scene()) else {
        return changed();
    };
    let file = part.setup.models.iter().find_map(|model| model.network.path.clone());
    let mut words = format!("gyroceptron run {}", part.name);
    if part.seed != built_in.seed {
        words.push_str(&format!(" --seed {}", part.seed));
    }
    let same_seed = built_in.with_seed(part.seed);
    let with_file = match &file {
        Some(file) => same_seed.with_weights(file).0,
        None => same_seed,
    };
    if *part != with_file {
        if *part != with_file.quick() {
            return changed();
        }
        words.push_str(" --quick");
    }
    if file.is_some() {
        words.push_str(" --weights FILE");
    }
    format!("`{words}`")
}
