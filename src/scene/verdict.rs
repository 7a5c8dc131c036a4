//! The verdict on a trained network, in words.

use super::trust::trust;
use crate::error::Error;
use crate::train::Fitted;

/// Whether to trust a network that was trained on pairs, and why not.
#[derive(Clone, Debug, PartialEq)]
pub struct Trust {
    /// The verdict: yes or no, and within which limits.
    pub verdict: String,
    /// What speaks against it; nothing where it is a plain yes.
    pub reasons: Vec<String>,
}

impl Trust {
    /// The verdict of a report, without one.
    ///
    /// # Errors
    /// Those of [`Model::rollout`](crate::network::Model::rollout) along orbits from held-out points.
    pub fn of(fitted: &Fitted) -> Result<Self, Error> {
        let problem = &fitted.problem;
        let (pairs, held_out) = (&problem.pairs, problem.held_out.as_ref());
        let data = trust(fitted.outcome(), pairs, held_out, fitted.nearest())?.results.data;
        let texts = |key: &str| -> Vec<String> {
            let list = data[key].as_array().into_iter().flatten();
            list.filter_map(|text| text.as_str().map(ToOwned::to_owned)).collect()
        };
        Ok(Self {
            verdict: data["trust"].as_str().unwrap_or_default().to_owned(),
            reasons: ["no", "no_long_orbits", "care"].into_iter().flat_map(texts).collect(),
        })
    }
}
