//! The jobs of a scene: pieces of its run that can be done anywhere, in any order that respects their needs.

use super::event::Unobserved;
use super::job_folders::{data_id, training_id};
use super::line_data::{Coils, LineData};
use super::registry::{AnyStudy, Scene};
use super::setup::{Data, SeededTraining, StudyTraining};
use super::written::to_json;
use crate::digest;
use crate::error::Error;
use crate::io::file_digest;
use serde::Serialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A piece of the run of a scene, which can be done on its own.
#[derive(Clone, Debug, Serialize)]
pub struct Job {
    /// Its name, which is that of its folder.
    pub id: String,
    /// The kind of work that the job does.
    pub kind: JobKind,
    /// The part of the scene that it belongs to; None for a scene without parts.
    pub part: Option<String>,
    /// The network that it trains, by the name that the scene gives it.
    pub network: Option<String>,
    /// The seed of the weights that it trains.
    pub seed: Option<u64>,
    /// The ε of the pairs that the job makes or trains on; None for the report.
    pub epsilon: Option<f64>,
    /// The flow time of its pairs.
    pub flow_time: Option<f64>,
    /// The jobs that must be done before.
    pub needs: Vec<String>,
    /// The length of the longest chain of jobs that must be done before it. Jobs of one wave do not need each other.
    pub wave: usize,
    /// The first half of a SHA-256 of all that its result depends on: scene, seed, files, version.
    pub digest: String,
    #[serde(skip)]
    pub(super) task: Task,
}

/// The kinds of work that jobs do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum JobKind {
    /// The job makes the data that trainings learn from.
    Data,
    /// It trains a network from one of its initial weights.
    Training,
    /// It makes the report of the run out of all other jobs.
    Merge,
}

/// What a job does, for the part that it is of.
#[derive(Clone, Debug)]
pub(super) enum Task {
    /// Pairs of the set-up, or those at an ε and a flow time.
    Data(Option<(f64, f64)>),
    /// A training of the set-up.
    Own(SeededTraining),
    /// A training that a study has beside those of the set-up.
    OfStudy(StudyTraining),
    Merge,
}

/// The name of the job that makes the report.
pub(super) const MERGE: &str = "merge";

impl Scene {
    /// The jobs of the scene, each after those that it needs: data sets, trainings, and the report.
    ///
    /// Networks whose weights come from a file are not jobs, and neither are the other studies of a scene: they are
    /// done by the job that makes the report.
    ///
    /// # Errors
    /// Those of [`Scene::complete`]; when a file that the scene names cannot be read.
    pub fn plan(&self) -> Result<Vec<Job>, Error> {
        self.complete()?;
        let found = self.with_found_actions(&mut Unobserved)?;
        let scene = found.as_ref().unwrap_or(self);
        let mut planning = Planning { jobs: Vec::new() };
        match &scene.parts[..] {
            [] => planning.add_scene(scene, None)?,
            parts => {
                parts.iter().try_for_each(|part| planning.add_scene(part, Some(&part.name)))?
            }
        }
        planning.jobs.sort_by_key(|job| job.wave);
        let digests: Vec<&str> = planning.jobs.iter().map(|job| &job.digest[..]).collect();
        let scene = to_json(self)
            .map_err(|reason| Error::content(&self.name, "a scene that JSON can hold", reason))?;
        let scene = json!({ "scene": scene, "jobs": digests, "files": file_digests(self)? });
        let (needs, task) = (planning.jobs.iter().map(|job| job.id.clone()).collect(), Task::Merge);
        let (part, network, seed) = (None, None, None);
        planning.add(Job {
            id: MERGE.into(),
            kind: JobKind::Merge,
            part,
            network,
            seed,
            epsilon: None,
            flow_time: None,
            needs,
            wave: 0,
            digest: digest_of(&scene),
            task,
        });
        Ok(planning.jobs)
    }
}

struct Planning {
    jobs: Vec<Job>,
}

impl Planning {
    /// Adds a job, unless it is there; its wave follows from what it needs.
    fn add(&mut self, job: Job) -> String {
        let id = job.id.clone();
        if self.jobs.iter().all(|other| other.id != id) {
            let waves =
                job.needs.iter().filter_map(|need| self.job(need)).map(|need| need.wave + 1);
            let wave = waves.max().unwrap_or(0);
            self.jobs.push(Job { wave, ..job });
        }
        id
    }

    fn job(&self, id: &str) -> Option<&Job> {
        self.jobs.iter().find(|job| job.id == id)
    }

    fn add_scene(&mut self, scene: &Scene, part: Option<&str>) -> Result<(), Error> {
        let setup = &scene.setup;
        let (Some(target), Some(own_time), Some(data)) =
            (setup.target(), setup.flow_time, setup.data.as_ref())
        else {
            return Ok(());
        };
        let common = Common {
            scene,
            part,
            epsilon: target.epsilon(),
            own_time,
            data,
            files: file_digests(scene)?,
        };
        for training in setup.trainings().filter(|training| !training.spec.network.is_of_file()) {
            let (time, task) = (own_time, Task::Own(training.clone()));
            self.add_training(&common, &training, (time, None, ""), true, task);
        }
        for study in scene.studies.iter().map(AnyStudy::study) {
            for own in study.trainings(setup) {
                let (from, task) = (own.from.as_deref(), Task::OfStudy(own.clone()));
                // Pairs with a fault are made of those of the set-up.
                let of_setup = !own.fault.is_empty();
                let which = (own.flow_time, from, &own.fault[..]);
                self.add_training(&common, &own.training, which, of_setup, task);
            }
        }
        Ok(())
    }

    fn add_training(
        &mut self,
        common: &Common<'_>,
        training: &SeededTraining,
        (time, from, fault): (f64, Option<&str>, &str),
        of_setup: bool,
        task: Task,
    ) {
        let Common { scene, part, epsilon, .. } = *common;
        let SeededTraining { spec, network, number } = training;
        let options = scene.setup.training_of(spec);
        let mut needs: Vec<String> = Vec::new();
        let mut sets = vec![if of_setup { None } else { Some((epsilon, time)) }];
        for stage in scene.setup.leading_up(options, epsilon, time, from.is_some()) {
            sets.push(Some((stage.epsilon.unwrap_or(epsilon), stage.flow_time.unwrap_or(time))));
        }
        for at in sets {
            let id = self.add_data(common, at);
            needs.extend(id.filter(|id| !needs.contains(id)));
        }
        needs.extend(from.map(|name| training_id(part, name)));
        let digests: Vec<&str> =
            needs.iter().filter_map(|id| self.job(id)).map(|job| &job.digest[..]).collect();
        let id = training_id(part, &spec.name);
        let of = json!({
            "id": id,
            "setup": common.identity(),
            "training": options,
            "network": spec.network,
            "weights": spec.weights,
            "number": number,
            "flow_time": time,
            "fault": fault,
            "needs": digests,
        });
        self.add(Job {
            id,
            kind: JobKind::Training,
            part: part.map(str::to_owned),
            network: Some(network.clone()),
            seed: Some(scene.seed.wrapping_add(*number)),
            epsilon: Some(epsilon),
            flow_time: Some(time),
            needs,
            wave: 0,
            digest: digest_of(&of),
            task,
        });
    }

    /// The job that makes these pairs; none where they are of a file.
    fn add_data(&mut self, common: &Common<'_>, at: Option<(f64, f64)>) -> Option<String> {
        let Common { part, epsilon, own_time, data, .. } = *common;
        if data.pairs.is_some() {
            return None;
        }
        let at = at.filter(|at| data.is_family() || *at != (epsilon, own_time));
        let id = data_id(part, at);
        let (epsilon, time) = at.unwrap_or((epsilon, own_time));
        let of =
            json!({ "id": id, "setup": common.identity(), "epsilon": epsilon, "flow_time": time });
        Some(self.add(Job {
            id,
            kind: JobKind::Data,
            part: part.map(str::to_owned),
            network: None,
            seed: None,
            epsilon: Some(epsilon),
            flow_time: Some(time),
            needs: Vec::new(),
            wave: 0,
            digest: digest_of(&of),
            task: Task::Data(at),
        }))
    }
}

/// What the jobs of a part share.
struct Common<'a> {
    scene: &'a Scene,
    part: Option<&'a str>,
    epsilon: f64,
    own_time: f64,
    data: &'a Data,
    files: Vec<String>,
}

impl Common<'_> {
    /// What the pairs, and what is learnt of them, depend on; files by what they hold, wherever they are.
    fn identity(&self) -> Value {
        let mut data = self.data.clone();
        data.pairs = data.pairs.map(|_| PathBuf::new());
        data.trajectories = None;
        data.section = data.section.map(|_| PathBuf::new());
        if let Some(LineData { coils: Coils::File(file), .. }) = &mut data.lines {
            file.path = PathBuf::new();
        }
        let setup = &self.scene.setup;
        let reversors: Vec<_> =
            setup.models.iter().filter_map(|model| model.network.reversor).collect();
        json!({
            "name": self.scene.name,
            "seed": self.scene.seed,
            "system": setup.system,
            "flow_time": setup.flow_time,
            "data": data,
            "reversors": reversors,
            "files": self.files,
            // It depends on the other networks too.
            "circles": self.data.found.as_ref().map(|found| &found.torus),
        })
    }
}

/// The digests of all files that a scene, and its parts, take data and networks from.
fn file_digests(scene: &Scene) -> Result<Vec<String>, Error> {
    let data = scene.setup.data.as_ref();
    let coils = data.and_then(|data| data.lines.as_ref()).and_then(|lines| match &lines.coils {
        Coils::File(file) => Some(&file.path),
        Coils::Torsatron(_) | Coils::Tokamak(_) => None,
    });
    let of_data = data
        .into_iter()
        .flat_map(|data| [&data.pairs, &data.trajectories, &data.section])
        .flatten();
    let networks = scene.setup.models.iter().filter_map(|model| model.network.path.as_ref());
    let paths: Vec<&Path> = of_data.chain(coils).chain(networks).map(PathBuf::as_path).collect();
    let mut digests = paths.into_iter().map(file_digest).collect::<Result<Vec<_>, _>>()?;
    for part in &scene.parts {
        digests.extend(file_digests(part)?);
    }
    Ok(digests)
}

fn digest_of(value: &Value) -> String {
    let version = env!("CARGO_PKG_VERSION");
    let mut digest = digest::of_bytes(format!("gyroceptron {version}\n{value}").as_bytes());
    digest.truncate(32);
    digest
}
