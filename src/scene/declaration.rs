//! A scene: a set-up, studies of it, or parts.

use super::setup::{Setup, check_name};
use super::study::{AnyStudy, SceneFile, Study};
use crate::error::Error;
use serde::{Deserialize, Serialize};

/// A declared experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "SceneFile", into = "SceneFile")]
pub struct Scene {
    /// Its name: the default folder of a run.
    pub name: String,
    /// One line that says what it shows.
    pub title: String,
    /// The seed of all its random streams.
    pub seed: u64,
    /// What its studies share.
    pub setup: Setup,
    /// What is measured, beside the pairs and the training that the set-up names.
    pub studies: Vec<AnyStudy>,
    /// The figures to draw, by name.
    pub plots: Vec<String>,
    /// Scenes that this one consists of, in place of a set-up of its own: each is
    /// run in a folder of its name, and one report sums them up.
    pub parts: Vec<Scene>,
}

impl Scene {
    /// Fails unless what is named is in range and fits together. `place` names the
    /// scene in errors.
    pub(super) fn check(&self, place: &str) -> Result<(), Error> {
        self.check_own().map_err(|e| e.at(place))?;
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
        for study in self.all_studies() {
            study.check(self).map_err(|e| e.at(study.name()))?;
        }
        let figures: Vec<_> = self.all_studies().iter().flat_map(|s| s.figures(self)).collect();
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

    /// Fails unless the scene, and each of its parts, names all that a run needs.
    ///
    /// # Errors
    /// [`Error::Missing`] with the key and the study that needs it.
    pub fn complete(&self) -> Result<(), Error> {
        let place = format!("scene {}", self.name);
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
        if studies.is_empty() && self.parts.is_empty() {
            let expected = "data, a study or parts, for something to run";
            return Err(Error::invalid("studies", "none", expected).at(place));
        }
        Ok(())
    }

    /// The scene with another seed, in all its parts.
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self.parts = self.parts.into_iter().map(|part| part.with_seed(seed)).collect();
        self
    }

    /// BibTeX entries of what the studies use, each once.
    pub fn citations(&self) -> Vec<&'static str> {
        let mut out = Vec::new();
        let studies = self.all_studies().into_iter().flat_map(|study| study.cites());
        for entry in studies.chain(self.parts.iter().flat_map(Self::citations)) {
            if !out.contains(&entry) {
                out.push(entry);
            }
        }
        out
    }
}
