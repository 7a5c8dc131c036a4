//! What every study is, and checks that studies share.

use crate::error::Error;
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::findings::Findings;
use crate::scene::setup::{MOST, Need, Setup, StudyTraining, check_points};
use crate::scene::trained::Trained;
use std::any::Any;
use std::rc::Rc;

/// Something that is measured in a scene. Its fields are its options.
pub(in crate::scene) trait Study: Any {
    /// Its key in a scene file, and in reports as data.
    fn name(&self) -> &'static str;

    /// What it cannot do without.
    fn needs(&self) -> &'static [Need];

    /// Whether it is of what a Hamiltonian flow keeps, so that a system with dissipation is refused.
    fn is_of_invariants(&self) -> bool {
        false
    }

    /// Fails unless its options are in range and fit the set-up, as far as that is
    /// given.
    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        let _ = scene;
        Ok(())
    }

    /// Fails where a file that it compares with is not what it needs: before anything is trained.
    fn check_files(&self, setup: &Setup) -> Result<(), Error> {
        let _ = setup;
        Ok(())
    }

    /// The trainings of networks of its own, beside those of the set-up; each after that which it begins with.
    fn trainings(&self, setup: &Setup) -> Vec<StudyTraining> {
        let _ = setup;
        Vec::new()
    }

    /// Does one of them, unless it is done; with that which it begins with.
    fn train(
        &self,
        context: &mut Context<'_>,
        training: &StudyTraining,
    ) -> Result<Rc<Trained>, RunError> {
        match context.learnt(&training.training.spec.name) {
            Some(made) => Ok(made),
            None => self.train_new(context, training),
        }
    }

    /// Does one of them.
    fn train_new(
        &self,
        context: &mut Context<'_>,
        training: &StudyTraining,
    ) -> Result<Rc<Trained>, RunError> {
        let _ = context;
        let name = &training.training.spec.name;
        Err(Error::invalid(self.name(), name, "one of the trainings of this study").into())
    }

    /// Makes a study that takes long a short one.
    fn shorten(&mut self) {}

    /// Leaves out rivals that are reversible by the reflection of Z, for a section that is not mirrored; their names.
    fn without_mirror(&mut self) -> Vec<String> {
        Vec::new()
    }

    /// The figures that it can draw of this scene.
    fn figures(&self, scene: &Declared<'_>) -> Vec<&'static str> {
        let _ = scene;
        Vec::new()
    }

    /// BibTeX entries of the methods that it uses.
    fn cites(&self, scene: &Declared<'_>) -> Vec<&'static str> {
        let _ = scene;
        Vec::new()
    }

    /// Measures. What other studies may ask for too is asked of the context, which
    /// makes it once.
    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError>;
}

/// Fails where a study of the parts has none.
pub(super) fn check_parts(study: &str, scene: &Declared<'_>) -> Result<(), Error> {
    match scene.has_parts {
        true => Ok(()),
        false => Err(Error::invalid(study, "no parts", "a scene of parts")),
    }
}

/// Fails unless trajectories of so many steps, of which so many lead from one state that is kept to the next, are of the
/// system from these points.
pub(super) fn check_along(
    scene: &Declared<'_>,
    steps: usize,
    every: usize,
    initial: &[Vec<f64>],
) -> Result<(), Error> {
    Error::check_count_range("steps", steps, 1, MOST)?;
    Error::check_count_range("every", every, 1, steps)?;
    if !steps.is_multiple_of(every) {
        return Err(Error::invalid("every", every, format!("a divisor of steps, {steps}")));
    }
    let Some(system) = &scene.setup.system else { return Ok(()) };
    if let Some(time) = scene.setup.flow_time {
        scene.setup.check_repeated(time)?;
    }
    check_points("initial", initial, system)
}

/// A number for a table; none where it is not one.
pub(super) fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}
