//! The registry of studies, and the scene that names them.

use super::setup::{Data, ModelSpec, Setup};
use super::study::shared::Study;
use super::study::{
    actions, adiabatic_horizon, adiabatic_profiles, aperture, claims, confinement, controls,
    dissipation, family, frequency_map, long_steps, noise, overview, own_invariant, poincare,
    rollout, slow_manifold, surfaces, tanh, there_and_back, trajectories, which_action,
    work_precision,
};
use crate::measure::certificate::CertificateOptions;
use crate::system::System;
use crate::train::TrainingOptions;
use serde::{Deserialize, Serialize};

/// A declared experiment: a set-up with studies of it, or several scenes as parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "SceneFile", into = "SceneFile")]
pub struct Scene {
    /// Its name, which is the default folder of a run.
    pub name: String,
    /// One line that says what it shows.
    pub title: String,
    /// The seed of all its random streams.
    pub seed: u64,
    /// What the studies share: system, flow time, data, networks and training.
    pub setup: Setup,
    /// The studies, beside those of the pairs and of the training that the set-up names.
    pub studies: Vec<AnyStudy>,
    /// The figures to draw, by name.
    pub plots: Vec<String>,
    /// Scenes that this one consists of, in place of a set-up of its own: each is
    /// run in a folder of its name, and one report sums them up.
    pub parts: Vec<Scene>,
}

/// The files that studies go on from.
pub(super) const CHECKPOINTS: [&str; 2] = [adiabatic_horizon::CHECKPOINT, which_action::CHECKPOINT];

macro_rules! studies {
    ($($(#[$doc:meta])* $key:ident: $variant:ident($options:ty)),* $(,)?) => {
        /// A study that a scene names, with its options.
        #[derive(Clone, Debug, PartialEq)]
        pub enum AnyStudy {
            $($(#[$doc])* $variant($options)),*
        }

        impl AnyStudy {
            pub(super) fn study(&self) -> &dyn Study {
                match self {
                    $(Self::$variant(options) => options),*
                }
            }

            pub(super) fn study_mut(&mut self) -> &mut dyn Study {
                match self {
                    $(Self::$variant(options) => options),*
                }
            }
        }

        /// A scene as its file holds it: a key for each field of the set-up, a table
        /// for each study.
        #[derive(Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        struct SceneFile {
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
    /// The order in ε of the invariant that each network owns.
    own_invariant: OwnInvariant(own_invariant::OwnInvariantOptions),
    /// The slow manifold of the charged particle, and the learnt invariant off it.
    slow_manifold: SlowManifold(slow_manifold::SlowManifoldOptions),
    /// The actions of a torus, and those that networks have learnt.
    actions: Actions(actions::ActionsOptions),
    /// Volumes and attractors of a flow that is not Hamiltonian.
    dissipation: Dissipation(dissipation::DissipationOptions),
    /// Surfaces of field lines over many turns.
    surfaces: Surfaces(surfaces::SurfacesOptions),
    /// Maps of a section of the field of coils.
    poincare: Poincare(poincare::PoincareOptions),
    /// Tunes over a grid of points, and how much they change.
    frequency_map: FrequencyMap(frequency_map::FrequencyMapOptions),
    /// How far from the closed orbit orbits stay, by angle.
    aperture: Aperture(aperture::ApertureOptions),
    /// Maps of a machine at values of its controls that were never traced.
    controls: Controls(controls::ControlsOptions),
    /// Curves of maps of a plane that no orbit crosses, with proofs.
    confinement: Confinement(confinement::ConfinementOptions),
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
    /// Networks of pairs with noise, and of pairs with gaps.
    noise: Noise(noise::NoiseOptions),
    /// Error against run time of tanh and sech².
    tanh: Tanh(tanh::TanhOptions),
    /// Steps forward and as many back, on grids and with plain numbers.
    there_and_back: ThereAndBack(there_and_back::ThereAndBackOptions),
    /// The adiabatic invariant of a random network along its orbit.
    adiabatic_profiles: AdiabaticProfiles(adiabatic_profiles::AdiabaticProfilesOptions),
    /// How long the adiabatic invariant of random networks stays.
    adiabatic_horizon: AdiabaticHorizon(adiabatic_horizon::AdiabaticHorizonOptions),
    /// Trajectories of the system for several ε.
    trajectories: Trajectories(trajectories::TrajectoriesOptions),
}
