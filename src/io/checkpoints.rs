//! The checkpoints of a training in a file, one for each of its stages.

use super::{earlier_checkpoint, save_checkpoint};
use crate::error::Error;
use crate::train::{
    Checkpoint, Control, Progress, Stop, TrainingObserver, TrainingOptions, TrainingStage,
};
use std::path::{Path, PathBuf};

/// The checkpoint files of a training, and whether the training goes on from them.
///
/// Each stage before the last has a file of its own, whose name is that of the last stage's file
/// with a suffix. As the observer of a training they keep it in these files:
///
/// ```no_run
/// use gyroceptron::io::{Checkpoints, read_pairs};
/// use gyroceptron::train::Fit;
///
/// let mut checkpoints = Checkpoints::new("model.checkpoint", true);
/// let fitted = Fit::default().run_observed(read_pairs("pairs.npz".as_ref())?, &mut checkpoints)?;
/// checkpoints.remove_after(fitted.outcome().stop)?;
/// # Ok::<(), gyroceptron::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Checkpoints {
    file: PathBuf,
    resume: bool,
    newest: Option<PathBuf>,
}

impl Checkpoints {
    /// Keeps the checkpoints of a training in this file. With `resume`, the training goes on from what is there.
    pub fn new(file: impl Into<PathBuf>, resume: bool) -> Self {
        Self { file: file.into(), resume, newest: None }
    }

    /// The file of the last stage.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// The file of the newest checkpoint written in this run; before the first one, the file of the
    /// last stage.
    pub fn newest(&self) -> &Path {
        self.newest.as_deref().unwrap_or(&self.file)
    }

    fn of(&self, stage: TrainingStage) -> PathBuf {
        let mut name = self.file.as_os_str().to_owned();
        name.push(stage.suffix());
        name.into()
    }

    /// The files that a training with these options may write.
    pub fn files(&self, options: &TrainingOptions) -> Vec<PathBuf> {
        TrainingStage::all(options).into_iter().map(|stage| self.of(stage)).collect()
    }

    /// Whether there is a checkpoint file of a training with these options.
    pub fn exist(&self, options: &TrainingOptions) -> bool {
        self.files(options).iter().any(|file| file.exists())
    }

    /// Fails if the training is to go on and no checkpoint is found.
    ///
    /// # Errors
    /// [`Error::Read`] of the file of the last stage.
    pub fn check(&self, options: &TrainingOptions) -> Result<(), Error> {
        let reason =
            "there is none of this training to go on from (one that ends by itself leaves none)";
        match self.resume && !self.exist(options) {
            true => Err(Error::read(&self.file, reason)),
            false => Ok(()),
        }
    }

    /// Removes the checkpoint files of a training that has ended by itself. One that was interrupted, or has done all
    /// its iterations, of which more may be asked for, can go on from them.
    ///
    /// # Errors
    /// Those of [`Checkpoints::remove`].
    pub fn remove_after(&self, stop: Stop) -> Result<(), Error> {
        if stop.is_final() { self.remove() } else { Ok(()) }
    }

    /// Removes the checkpoint files of all stages, however many the training had.
    ///
    /// # Errors
    /// [`Error::Write`] with the file.
    pub fn remove(&self) -> Result<(), Error> {
        let remove =
            |path: &Path| std::fs::remove_file(path).map_err(|reason| Error::write(path, reason));
        if self.file.exists() {
            remove(&self.file)?;
        }
        let numbered: [fn(u64) -> TrainingStage; 3] = [
            TrainingStage::Start,
            |number| TrainingStage::Ramp(usize::try_from(number).unwrap_or(usize::MAX)),
            TrainingStage::Twists,
        ];
        for stage in numbered {
            let files = (0..).map(|number| self.of(stage(number)));
            files.take_while(|path| path.exists()).try_for_each(|path| remove(&path))?;
        }
        Ok(())
    }
}

impl TrainingObserver for Checkpoints {
    fn earlier(&mut self, stage: TrainingStage) -> Result<Option<Checkpoint>, Error> {
        earlier_checkpoint(&self.of(stage), self.resume)
    }

    fn observe(&mut self, stage: TrainingStage, progress: Progress<'_>) -> Result<Control, Error> {
        if let Some(checkpoint) = progress.checkpoint {
            let file = self.of(stage);
            save_checkpoint(&file, checkpoint)?;
            self.newest = Some(file);
        }
        Ok(Control::Continue)
    }
}
