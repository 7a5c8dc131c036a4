//! What a scene can be asked, and its other forms.

use super::declared::Declared;
use super::line_data::{Coils, LineData};
use super::network_file::read_network;
use super::registry::{AnyStudy, Scene};
use super::setup::{Data, ModelSpec, SeededTraining, Setup, check_name};
use super::study::pairs::PairsStudy;
use super::study::shared::Study;
use super::study::training::TrainingStudy;
use super::study::trust::TrustStudy;
use crate::error::Error;
use crate::layer::Reversor;
use crate::train::{Starts, TrainingOptions, TrainingStage};
use std::any::Any;
use std::collections::BTreeSet;
use std::path::Path;

/// What becomes of reversible maps of a section that has no mirror.
#[derive(Debug, Default)]
pub struct Mirrorless {
    /// The models and polynomials that are left out.
    pub left: Vec<String>,
    /// The models that have lost their reversor.
    pub plain: Vec<String>,
}

impl Scene {
    /// Fails unless what is named is in range and fits together. `place` names the
    /// scene in errors.
    pub(super) fn check(&self, place: &str) -> Result<(), Error> {
        self.check_own().map_err(|e| e.with_place(place))?;
        for part in &self.parts {
            part.check(&format!("{place}: parts.{}", part.name))?;
        }
        Ok(())
    }

    /// [`Scene::check`] but for what is inside the parts.
    fn check_own(&self) -> Result<(), Error> {
        check_name(&self.name)?;
        // TOML has no larger integers.
        if i64::try_from(self.seed).is_err() {
            return Err(Error::invalid("seed", self.seed, format!("at most {}", i64::MAX)));
        }
        self.setup.check()?;
        self.check_files()?;
        let declared = self.declared();
        for study in self.all_studies() {
            study.check(&declared).map_err(|e| e.with_place(study.name()))?;
            let dissipating = self.setup.system.as_ref().filter(|system| system.dissipates());
            if let (true, Some(system)) = (study.is_of_invariants(), dissipating) {
                let expected = "a system without dissipation: it is of what Hamiltonian flows keep";
                return Err(Error::invalid(study.name(), system.kind(), expected));
            }
        }
        let figures: Vec<_> =
            self.all_studies().iter().flat_map(|s| s.figures(&declared)).collect();
        if let Some(plot) = self.plots.iter().find(|plot| !figures.contains(&&plot[..])) {
            let expected = match &figures[..] {
                [] => "none: the scene computes nothing that is drawn".to_owned(),
                _ => format!("figures of what the scene computes: {}", figures.join(", ")),
            };
            return Err(Error::invalid("plots", format!("`{plot}`"), expected));
        }
        let needy = |study: &&dyn Study| !study.needs().is_empty();
        if !self.parts.is_empty()
            && (self.setup != Setup::default() || self.all_studies().iter().any(needy))
        {
            return Err(Error::invalid("parts", "both", "either parts or a set-up of its own"));
        }
        for (index, part) in self.parts.iter().enumerate() {
            if !part.parts.is_empty() {
                return Err(Error::invalid("parts", &part.name, "parts without parts"));
            }
            if self.parts[..index].iter().any(|other| other.name == part.name) {
                let found = format!("`{}` twice", part.name);
                return Err(Error::invalid("parts", found, "a name for each"));
            }
        }
        Ok(())
    }

    /// Fails unless each stage of each training has a checkpoint of its own.
    fn check_files(&self) -> Result<(), Error> {
        let mut names = BTreeSet::new();
        for SeededTraining { spec, .. } in self.trainings() {
            for stage in TrainingStage::all(self.setup.training_of(&spec)) {
                let name = format!("{}{}", spec.name, stage.suffix());
                if !names.insert(name.clone()) {
                    let expected = "a name for each, also with what is added for a start, a stage, \
                                    twists or a flow time";
                    return Err(Error::invalid("models", format!("`{name}` twice"), expected));
                }
            }
        }
        Ok(())
    }

    /// Fails unless the scene, and each of its parts, names all that a run needs.
    ///
    /// # Errors
    /// [`Error::Missing`] with the key and the study that needs it.
    pub fn complete(&self) -> Result<(), Error> {
        let place = format!("scene {}", self.name);
        // Options of a command may have changed it since it was read.
        self.check_own().map_err(|e| e.with_place(&place))?;
        for part in &self.parts {
            part.complete()?;
        }
        let studies = self.all_studies();
        for study in &studies {
            if let Some(need) = study.needs().iter().find(|need| !self.setup.has(**need)) {
                let needed_by = study.name().to_owned();
                return Err(Error::Missing { place, key: need.key(), needed_by });
            }
        }
        for model in &self.setup.models {
            if model.network.is_of_file() && model.network.path.is_none() {
                let needed_by =
                    format!("the network {}, which is of a file of weights", model.name);
                return Err(Error::Missing { place, key: "models.network.path", needed_by });
            }
        }
        if studies.is_empty() && self.parts.is_empty() {
            let expected = "data, a study or parts, for something to run";
            return Err(Error::invalid("studies", "none", expected).with_place(place));
        }
        Ok(())
    }

    /// The scene with the relative paths of its data and networks taken from a folder, in all its parts, and
    /// absolute, so that it can be run from anywhere.
    ///
    /// # Errors
    /// [`Error::Read`] when the current folder is not known.
    pub fn with_files_from(mut self, folder: &Path) -> Result<Self, Error> {
        let Setup { data, models, .. } = &mut self.setup;
        let mut paths = Vec::new();
        if let Some(Data { pairs, trajectories, section, lines, .. }) = data {
            paths.extend([pairs, trajectories, section].into_iter().flatten());
            if let Some(LineData { coils: Coils::File(file), .. }) = lines {
                paths.push(&mut file.path);
            }
        }
        paths.extend(models.iter_mut().filter_map(|model| model.network.path.as_mut()));
        for path in paths {
            let joined = folder.join(&*path);
            *path = std::path::absolute(&joined).map_err(|reason| Error::read(&joined, reason))?;
        }
        let parts = self.parts.into_iter().map(|part| part.with_files_from(folder));
        self.parts = parts.collect::<Result<_, _>>()?;
        Ok(self)
    }

    /// Fails, before anything is computed, where trajectories of a file are not what a roll-out needs, or
    /// where a file of a network, of the scene or of a part, cannot be read, is not of the scene's target
    /// and flow time, or is in the folder that the run writes to and may clear.
    ///
    /// # Errors
    /// With the network's name and the file.
    pub fn check_networks(&self, folder: &Path) -> Result<(), Error> {
        self.studies.iter().try_for_each(|any| any.study().check_files(&self.setup))?;
        if let Some(lines) = self.setup.data.as_ref().and_then(|data| data.lines.as_ref()) {
            lines.check_files()?;
        }
        let true_path = |path: &Path| path.canonicalize().or_else(|_| std::path::absolute(path));
        for model in &self.setup.models {
            let Some(path) = &model.network.path else { continue };
            let place = |error: Error| error.with_place(format!("models.{}", model.name));
            if let (Some(target), Some(time)) = (self.setup.target(), self.setup.flow_time) {
                read_network(path, target, time).map_err(place)?;
            }
            if let (Ok(file), Ok(folder)) = (true_path(path), true_path(folder))
                && file.starts_with(&folder)
            {
                let expected = format!("a file outside of {}, which is written", folder.display());
                return Err(place(Error::invalid("network.path", path.display(), expected)));
            }
        }
        self.parts.iter().try_for_each(|part| part.check_networks(folder))
    }

    /// The scene with another seed, in all its parts.
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self.parts = self.parts.into_iter().map(|part| part.with_seed(seed)).collect();
        self
    }

    /// The scene without what says when training stops and how often it is saved, which may differ when a run is gone
    /// on with, and without what was found from its pairs.
    pub(super) fn without_ends(mut self) -> Self {
        let reset = |training: &mut TrainingOptions| *training = training.clone().without_ends();
        reset(&mut self.setup.training);
        self.setup.data.iter_mut().for_each(|data| {
            (data.found, data.is_time_given) = (None, false);
        });
        for model in &mut self.setup.models {
            model.training.as_mut().map(reset);
        }
        self.parts = self.parts.into_iter().map(Self::without_ends).collect();
        self
    }

    /// A short form of the scene, to see all of it: a quarter of the iterations of
    /// training and of the pairs, or of the length of orbits (of field lines half as many, half as long), one start,
    /// one draw of twists and one seed for each network, orbits of random networks of a tenth of the length and the
    /// longest of a thousandth.
    pub fn quick(mut self) -> Self {
        // A scene on pairs of a file that says nothing of starts has several.
        let one = Starts { count: 1, iterations: Starts::TRIAL };
        let starts = self.setup.is_of_file().then_some(one);
        let fewer = |training: &mut TrainingOptions| {
            let shorter = |iterations: u64| (iterations / 4).max(20).min(iterations);
            training.iterations = shorter(training.iterations);
            training.starts = starts;
            for stage in &mut training.ramp {
                stage.iterations = shorter(stage.iterations);
            }
            if let Some(fresh) = &mut training.fresh_twists {
                (fresh.count, fresh.iterations) = (1, shorter(fresh.iterations));
            }
        };
        if !self.setup.models.is_empty() {
            fewer(&mut self.setup.training);
        }
        for model in &mut self.setup.models {
            model.training.as_mut().map(fewer);
            model.seeds = None;
        }
        if let Some(data) = &mut self.setup.data {
            if let Some(lines) = &mut data.lines {
                (lines.lines, data.orbit) = (lines.lines.div_ceil(2), data.orbit.div_ceil(2));
            } else {
                match data.orbit {
                    1 => data.windows.iter_mut().for_each(|w| w.samples = w.samples.div_ceil(4)),
                    _ => data.orbit = data.orbit.div_ceil(4).max(2),
                }
            }
        }
        self.studies.iter_mut().for_each(|any| any.study_mut().shorten());
        self.parts = self.parts.into_iter().map(Self::quick).collect();
        self
    }

    /// The scene without the parts that lack a file of weights, and their names.
    pub fn without_parts_that_lack_files(mut self) -> (Self, Vec<String>) {
        let lacks = |part: &Self| {
            let mut models = part.setup.models.iter();
            models.any(|model| model.network.is_of_file() && model.network.path.is_none())
        };
        let (lacking, parts) = self.parts.into_iter().partition::<Vec<_>, _>(lacks);
        self.parts = parts;
        (self, lacking.into_iter().map(|part| part.name).collect())
    }

    /// The scene with this file of weights for the networks that take theirs from a file and name
    /// none; whether there is one, in the scene or a part.
    pub fn with_weights(mut self, file: &Path) -> (Self, bool) {
        let mut any = false;
        for model in &mut self.setup.models {
            if model.network.is_of_file() && model.network.path.is_none() {
                model.network.path = Some(file.to_owned());
                any = true;
            }
        }
        let with = |part: Self| {
            let (part, of_part) = part.with_weights(file);
            any |= of_part;
            part
        };
        self.parts = self.parts.into_iter().map(with).collect();
        (self, any)
    }

    /// The scene with the field lines of its data, and of that of its parts, changed; whether there are any.
    pub fn with_lines(mut self, change: &dyn Fn(LineData) -> LineData) -> (Self, bool) {
        let mut any = false;
        if let Some(data) = &mut self.setup.data {
            any = data.lines.is_some();
            data.lines = data.lines.take().map(change);
        }
        let with = |part: Self| {
            let (part, of_part) = part.with_lines(change);
            any |= of_part;
            part
        };
        self.parts = self.parts.into_iter().map(with).collect();
        (self, any)
    }

    /// The scene without the reversible networks whose maps of a section are not reversible. Where there are no others,
    /// they stay without their reversor.
    pub fn without_models_that_need_a_mirror(mut self) -> (Self, Mirrorless) {
        let lines = self.setup.data.as_ref().and_then(|data| data.lines.as_ref());
        let fits = |model: &ModelSpec| match (lines, model.network.reversor) {
            (Some(lines), Some(reversor)) => lines.check_reversor(reversor).is_ok(),
            _ => true,
        };
        let no_mirror =
            lines.is_some_and(|lines| lines.check_reversor(Reversor::Positions).is_err());
        let (kept, left): (Vec<_>, Vec<_>) = self.setup.models.iter().cloned().partition(fits);
        let mut found = Mirrorless::default();
        if kept.is_empty() {
            for model in &mut self.setup.models {
                model.network.reversor = None;
                found.plain.push(model.name.clone());
            }
        } else {
            found.left.extend(left.into_iter().map(|model| format!("model {}", model.name)));
            self.setup.models = kept;
        }
        if no_mirror {
            let of_studies =
                self.studies.iter_mut().flat_map(|any| any.study_mut().without_mirror());
            found.left.extend(of_studies);
        }
        let with = |part: Self| {
            let (part, of_part) = part.without_models_that_need_a_mirror();
            found.left.extend(of_part.left);
            found.plain.extend(of_part.plain);
            part
        };
        self.parts = self.parts.into_iter().map(with).collect();
        (self, found)
    }

    /// BibTeX entries of what the studies use, each once.
    pub fn citations(&self) -> Vec<&'static str> {
        let (mut out, declared) = (Vec::new(), self.declared());
        let studies = self.all_studies().into_iter().flat_map(|study| study.cites(&declared));
        for entry in studies.chain(self.parts.iter().flat_map(Self::citations)) {
            if !out.contains(&entry) {
                out.push(entry);
            }
        }
        out
    }

    /// All trainings: of the set-up, and of studies that train networks of their own.
    pub(super) fn trainings(&self) -> Vec<SeededTraining> {
        let mut out: Vec<SeededTraining> = self.setup.trainings().collect();
        let studies = self.studies.iter().map(AnyStudy::study);
        let own = studies.flat_map(|study| study.trainings(&self.setup));
        out.extend(own.map(|own| own.training));
        out
    }

    /// The studies in the order in which they run: of the pairs and of the training
    /// where the set-up names them, then those that the scene names.
    pub(super) fn all_studies(&self) -> Vec<&dyn Study> {
        let mut out: Vec<&dyn Study> = Vec::new();
        if self.setup.is_of_file() && !self.setup.models.is_empty() {
            out.push(&TrustStudy);
        }
        if self.setup.data.is_some() {
            out.push(&PairsStudy);
        }
        if !self.setup.models.is_empty() {
            out.push(&TrainingStudy);
        }
        out.extend(self.studies.iter().map(AnyStudy::study));
        out
    }

    /// The scene as its studies see it.
    pub(super) fn declared(&self) -> Declared<'_> {
        Declared {
            name: &self.name,
            seed: self.seed,
            setup: &self.setup,
            plots: &self.plots,
            has_parts: !self.parts.is_empty(),
            trainings: self.trainings().len(),
            options: self.studies.iter().map(|any| any.study() as &dyn Any).collect(),
        }
    }
}
