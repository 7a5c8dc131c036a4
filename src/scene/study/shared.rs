//! What every study is, and checks that studies share.

use crate::error::Error;
use crate::flow::Region;
use crate::scene::context::{Context, RunError};
use crate::scene::data_sets::DataSets;
use crate::scene::declared::Declared;
use crate::scene::findings::Findings;
use crate::scene::setup::{MOST, Need, Setup, StudyTraining, check_points};
use crate::scene::target_flow::TargetFlow;
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

    /// Trains one of the study's own networks, which has not been trained yet.
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

/// Fails unless trajectories of so many steps, of which so many lead from one state that is kept to the next, are of
/// the system from these points.
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

/// The positions of two degrees of freedom.
pub(super) fn positions() -> [usize; 2] {
    [0, 1]
}

/// The name of a coordinate of two degrees of freedom.
pub(super) fn coordinate(index: usize) -> &'static str {
    ["q₁", "q₂", "p₁", "p₂"][index.min(3)]
}

/// Fails unless the maps of a scene are of two degrees of freedom, this is a point of theirs, and these are two of its
/// coordinates.
pub(super) fn check_slice(
    study: &str,
    scene: &Declared<'_>,
    centre: [f64; 4],
    along: [usize; 2],
) -> Result<(), Error> {
    if scene.setup.data.as_ref().is_some_and(|data| data.section.is_some()) {
        return Err(Error::invalid(study, "pairs of a section", "pairs in canonical coordinates"));
    }
    if let Some(dof) = scene.setup.target().map(TargetFlow::dof).filter(|dof| *dof != 2) {
        return Err(Error::invalid(study, format!("{dof} degrees of freedom"), "two"));
    }
    if let Some(bad) = centre.iter().find(|value| !value.is_finite()) {
        return Err(Error::invalid("centre", bad, "finite numbers"));
    }
    let [one, other] = along;
    if one == other || one > 3 || other > 3 {
        let expected = "two different ones of 0, 1, 2, 3";
        return Err(Error::invalid("along", format!("{along:?}"), expected));
    }
    Ok(())
}

/// An orbit is lost that leaves the box of the pairs, so many times as wide.
pub(super) const WIDER: f64 = 2.0;

/// Whether a point in the units of networks is beyond that box.
pub(super) fn beyond_pairs(data: &DataSets) -> impl Fn(&[f64]) -> bool + use<> {
    let network = |mut corner: Vec<f64>| {
        if let Some(units) = &data.units {
            units.to_network(&mut corner);
        }
        corner
    };
    let region = data.region().map(|Region { low, high }| [network(low), network(high)]);
    move |z| {
        let finite = z.iter().all(|value| value.is_finite());
        let within = region.as_ref().is_none_or(|[low, high]| {
            let mut all = z.iter().zip(low.iter().zip(high));
            all.all(|(value, (low, high))| {
                (value - 0.5 * (low + high)).abs() <= 0.5 * WIDER * (high - low)
            })
        });
        !(finite && within)
    }
}

/// A number for a table; none where it is not one.
pub(super) fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}
