//! The circle action of pairs of a file, found from them where a scene names none.

use super::event::{Event, Observer};
use super::registry::Scene;
use super::setup::{PairsAction, Setup};
use super::target_flow::{FoundAction, section_of};
use crate::error::Error;
use crate::io::PairsFile;
use crate::network::{Circles, NetworkSpec};
use crate::train::{Control, FamilyPairs, Fit};
use std::path::Path;

impl Scene {
    /// The scene with the circle actions of pairs of files, of its own and of its parts, found from the pairs where it
    /// names none; None where the observer interrupts. What is found is not written with the scene: it stays as it was
    /// given. [`run`](super::run()) and [`Scene::plan`] find actions by themselves; of a scene that has them they need
    /// not.
    ///
    /// # Errors
    /// Those of [`Fit::find_action`], [`Scene::complete`] and of reading files.
    pub fn with_found_actions(&self, observer: &mut dyn Observer) -> Result<Option<Self>, Error> {
        let mut scene = self.clone();
        if !scene.is_of_unknown_action() {
            return Ok(Some(scene));
        }
        match scene.find_actions(observer) {
            Ok(()) => {}
            Err(Error::Stopped { .. }) => return Ok(None),
            Err(error) => return Err(error),
        }
        // The checks of networks and studies that need the circle action come now.
        scene.complete()?;
        Ok(Some(scene))
    }

    /// Whether the circle action of some pairs, of its own or of a part, is neither given nor found so far.
    pub(super) fn is_of_unknown_action(&self) -> bool {
        let own = self.setup.of_unknown_action().is_some();
        own || self.parts.iter().any(Self::is_of_unknown_action)
    }

    fn find_actions(&mut self, observer: &mut dyn Observer) -> Result<(), Error> {
        if let Some(place) = self.setup.of_unknown_action().map(Path::to_owned) {
            let place = place.display().to_string();
            let mut own = None;
            if !self.setup.declares_circles() {
                own = Some(self.setup.read_pairs()?);
                observer.event(Event::Stage(&format!("looking for the circle action of {place}")));
            }
            let mut go_on = || {
                Ok(match observer.interrupted() {
                    true => Control::Interrupt,
                    false => Control::Continue,
                })
            };
            let found = self.setup.find_action(own, self.seed, &mut go_on)?;
            self.setup.data.iter_mut().for_each(|data| data.found = found.clone());
        }
        self.parts.iter_mut().try_for_each(|part| part.find_actions(observer))
    }
}

impl Setup {
    /// The file of pairs whose circle action is neither given nor found so far.
    fn of_unknown_action(&self) -> Option<&Path> {
        let data = self.data.as_ref()?;
        let is_given = matches!(data.circle_action, Some(PairsAction::Circle(_)));
        let is_known = is_given || data.found.is_some();
        data.pairs.as_deref().filter(|_| !is_known)
    }

    /// Whether several circles are given.
    fn declares_circles(&self) -> bool {
        let declared = self.data.as_ref().and_then(|data| data.circle_action.as_ref());
        matches!(declared, Some(PairsAction::Torus(_)))
    }

    fn find_action(
        &self,
        own: Option<PairsFile>,
        seed: u64,
        go_on: &mut dyn FnMut() -> Result<Control, Error>,
    ) -> Result<Option<FoundAction>, Error> {
        let Some(data) = &self.data else { return Ok(None) };
        let Some(path) = &data.pairs else { return Ok(None) };
        if let Some(PairsAction::Torus(torus)) = &data.circle_action {
            return Ok(Some(FoundAction::new(torus.clone(), None)));
        }
        let Some(pairs) = own.map(FamilyPairs::from) else { return Ok(None) };
        let section = data.section.as_deref().map(|path| section_of(path, pairs.pairs.dof()));
        let section = section.transpose()?;
        // Without networks, that of a normal form.
        let mut networks = self.models.iter().map(|model| &model.network);
        let of = |circles: Circles| move |network: &&NetworkSpec| network.circles() == circles;
        let fewest = { networks.clone() }
            .find(of(Circles::One))
            .or_else(|| networks.clone().find(of(Circles::Several)))
            .or_else(|| networks.next());
        let fit = Fit {
            place: path.display().to_string(),
            network: fewest.cloned(),
            epsilon: data.epsilon,
            flow_time: self.flow_time,
            section,
            seed,
            ..Fit::default()
        };
        let place = |error: Error| match error {
            Error::Stopped { .. } => error,
            _ => error.with_place(format!("data.circle_action of {}", path.display())),
        };
        let (torus, trial) = fit.find_action(pairs, go_on).map_err(place)?;
        Ok(Some(FoundAction::new(torus, trial.map(|trial| trial.describe()))))
    }
}
