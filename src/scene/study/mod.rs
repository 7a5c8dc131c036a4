//! Studies: one file each, with its options, its check, its run, what it finds and
//! what it cites.
//!
//! A new study is such a file, its line in the registry below, and a scene of the
//! catalogue that names it.

pub mod actions;
pub mod adiabatic_horizon;
pub mod adiabatic_profiles;
pub mod certificate;
pub mod claims;
pub mod dissipation;
pub mod family;
pub mod long_steps;
pub mod overview;
mod pairs;
pub mod random_network;
pub mod rollout;
pub mod slow_manifold;
pub mod surfaces;
pub mod tanh;
pub mod training;
pub mod trajectories;
mod trust;
pub mod which_action;
pub mod work_precision;

/// The files that studies go on from.
pub(super) const CHECKPOINTS: [&str; 2] = [adiabatic_horizon::CHECKPOINT, which_action::CHECKPOINT];

use super::context::{Context, Halt};
use super::declaration::Scene;
use super::findings::Findings;
use super::setup::{Attempt, Data, MOST, ModelSpec, Need, Setup, check_points};
use crate::error::Error;
use crate::measure::CertificateOptions;
use crate::system::System;
use crate::train::TrainingOptions;
use serde::{Deserialize, Serialize};

/// Something that is measured in a scene. Its fields are its options.
pub(super) trait Study {
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
    fn check(&self, scene: &Scene) -> Result<(), Error> {
        let _ = scene;
        Ok(())
    }

    /// The figures that it can draw of this scene.
    fn figures(&self, scene: &Scene) -> Vec<&'static str> {
        let _ = scene;
        Vec::new()
    }

    /// BibTeX entries of the methods that it uses.
    fn cites(&self, scene: &Scene) -> Vec<&'static str> {
        let _ = scene;
        Vec::new()
    }

    /// Measures. What other studies may ask for too is asked of the context, which
    /// makes it once.
    fn run(&self, context: &mut Context<'_>) -> Result<Findings, Halt>;
}

/// Fails where a study of the parts has none.
fn check_parts(study: &str, scene: &Scene) -> Result<(), Error> {
    match scene.parts.is_empty() {
        true => Err(Error::invalid(study, "no parts", "a scene of parts")),
        false => Ok(()),
    }
}

/// Fails unless trajectories of so many steps, of which so many lead from one state that is kept to the next, are of the
/// system from these points.
fn check_along(
    scene: &Scene,
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
fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

macro_rules! studies {
    ($($(#[$doc:meta])* $key:ident: $variant:ident($options:ty)),* $(,)?) => {
        /// A study that a scene names, with its options.
        #[derive(Clone, Debug, PartialEq)]
        pub enum AnyStudy {
            $($(#[$doc])* $variant($options)),*
        }

        impl AnyStudy {
            fn study(&self) -> &dyn Study {
                match self {
                    $(Self::$variant(options) => options),*
                }
            }
        }

        /// A scene as its file holds it: a key for each field of the set-up, a table
        /// for each study.
        #[derive(Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub(super) struct SceneFile {
            name: String,
            #[serde(default)]
            title: String,
            #[serde(default)]
            seed: u64,
            #[serde(skip_serializing_if = "Option::is_none")]
            system: Option<System>,
            #[serde(skip_serializing_if = "Option::is_none")]
            flow_time: Option<f64>,
            #[serde(skip_serializing_if = "Option::is_none")]
            data: Option<Data>,
            #[serde(default)]
            models: Vec<ModelSpec>,
            #[serde(default)]
            training: TrainingOptions,
            $(
                #[serde(skip_serializing_if = "Option::is_none")]
                $key: Option<$options>,
            )*
            #[serde(default)]
            plots: Vec<String>,
            #[serde(default, skip_serializing_if = "Vec::is_empty")]
            parts: Vec<Scene>,
        }

        impl From<SceneFile> for Scene {
            fn from(file: SceneFile) -> Self {
                let SceneFile { system, flow_time, data, models, training, .. } = file;
                let mut studies = Vec::new();
                $(studies.extend(file.$key.map(AnyStudy::$variant));)*
                Self {
                    name: file.name,
                    title: file.title,
                    seed: file.seed,
                    setup: Setup { system, flow_time, data, models, training },
                    studies,
                    plots: file.plots,
                    parts: file.parts,
                }
            }
        }

        impl From<Scene> for SceneFile {
            fn from(scene: Scene) -> Self {
                let Setup { system, flow_time, data, models, training } = scene.setup;
                $(let mut $key = None;)*
                for study in scene.studies {
                    match study {
                        $(AnyStudy::$variant(options) => $key = Some(options)),*
                    }
                }
                Self {
                    name: scene.name,
                    title: scene.title,
                    seed: scene.seed,
                    system,
                    flow_time,
                    data,
                    models,
                    training,
                    $($key,)*
                    plots: scene.plots,
                    parts: scene.parts,
                }
            }
        }
    };
}

// The registry. Studies run in this order.
studies! {
    /// What the parts make of the paper's claims.
    claims: Claims(claims::ClaimsOptions),
    /// The networks of all parts in one table.
    overview: Overview(overview::OverviewOptions),
    /// The trajectories of each network beside the reference.
    rollout: Rollout(rollout::RolloutOptions),
    /// The slow manifold of the charged particle, and the learnt invariant off it.
    slow_manifold: SlowManifold(slow_manifold::SlowManifoldOptions),
    /// The actions of a torus, and those that networks have learnt.
    actions: Actions(actions::ActionsOptions),
    /// Volumes and attractors of a flow that is not Hamiltonian.
    dissipation: Dissipation(dissipation::DissipationOptions),
    /// Surfaces of field lines over many turns.
    surfaces: Surfaces(surfaces::SurfacesOptions),
    /// Which circle action the pairs have.
    which_action: WhichAction(which_action::WhichActionOptions),
    /// The structure certificate of each network.
    certificate: Certificate(CertificateOptions),
    /// Error against run time, of the networks and of integrators.
    work_precision: WorkPrecision(work_precision::WorkPrecisionOptions),
    /// Networks at ε and flow times they have seen and have not.
    family: Family(family::FamilyOptions),
    /// Maps of several flow times beside integrators.
    long_steps: LongSteps(long_steps::LongStepsOptions),
    /// Error against run time of tanh and sech².
    tanh: Tanh(tanh::TanhOptions),
    /// The adiabatic invariant of a random network along its orbit.
    adiabatic_profiles: AdiabaticProfiles(adiabatic_profiles::AdiabaticProfilesOptions),
    /// How long the adiabatic invariant of random networks stays.
    adiabatic_horizon: AdiabaticHorizon(adiabatic_horizon::AdiabaticHorizonOptions),
    /// Trajectories of the system for several ε.
    trajectories: Trajectories(trajectories::TrajectoriesOptions),
}

impl AnyStudy {
    /// Makes a study that takes long a short one.
    pub(super) fn shorten(&mut self) {
        match self {
            Self::AdiabaticHorizon(options) => options.shorten(),
            Self::LongSteps(options) => options.shorten(),
            Self::Surfaces(options) => options.shorten(),
            Self::WhichAction(options) => options.shorten(),
            Self::WorkPrecision(options) => options.rounds = options.rounds.min(5),
            _ => {}
        }
    }
}

impl Scene {
    /// All trainings: of the set-up, and of studies that train networks of their own.
    pub(super) fn attempts(&self) -> Vec<Attempt> {
        let mut out: Vec<Attempt> = self.setup.attempts().collect();
        for study in &self.studies {
            if let AnyStudy::LongSteps(options) = study {
                out.extend(options.trainings(self));
            }
        }
        out
    }

    /// The studies in the order in which they run: of the pairs and of the training
    /// where the set-up names them, then those that the scene names.
    pub(super) fn all_studies(&self) -> Vec<&dyn Study> {
        let mut out: Vec<&dyn Study> = Vec::new();
        let of_file = self.setup.data.as_ref().is_some_and(|data| data.pairs.is_some());
        if of_file && !self.setup.models.is_empty() {
            out.push(&trust::TrustStudy);
        }
        if self.setup.data.is_some() {
            out.push(&pairs::PairsStudy);
        }
        if !self.setup.models.is_empty() {
            out.push(&training::TrainingStudy);
        }
        out.extend(self.studies.iter().map(AnyStudy::study));
        out
    }
}
