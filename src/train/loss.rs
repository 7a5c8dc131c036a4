//! The loss of a network on pairs, its gradient and its curvature.

use super::kernels::{AccelerationGradient, Blocks, Curvature, Gradient, Value};
use crate::error::Error;
use crate::flow::{Condition, Pairs};
use crate::layer::TorusAction;
use crate::measure::trajectories::plane_motions;
use crate::network::{Composition, Model};
use crate::scalar::{WIDTH, max_or_nan, on_lanes};
use crate::work;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::ops::Range;

/// The loss that is minimised: the mean over the pairs of Σ_c weight_c·(residual_c)².
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Loss {
    /// The mean squared error over all components: weight_c = 1/(2n).
    MeanSquaredError,
    /// A weight for each degree of freedom, on its q and its p. With [ε, 1] it equals, up to the
    /// factor 512 of the batch, the sum that the paper's published code minimises.
    Weighted {
        /// One for each degree of freedom.
        weights: Vec<f64>,
    },
    /// The mean squared error with weights of mean 1: weight_c = w_c / Σ w. Held-out pairs are
    /// measured in the same way, so that the model that is kept is the best in all planes.
    ByPlane {
        /// One for each plane or for each of the 2n components. None: those of [`Loss::for_pairs`].
        #[serde(default, skip_serializing_if = "Option::is_none")]
        weights: Option<Vec<f64>>,
    },
}

impl Loss {
    /// The loss of a name: `auto` weighs planes by what the rotation leaves of them, `none` is the plain mean square.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "auto" => Some(Self::ByPlane { weights: None }),
            "none" => Some(Self::MeanSquaredError),
            _ => None,
        }
    }

    /// This loss, with weights found from pairs where it has none: [`Loss::ByPlane`] gets, for each
    /// plane, the inverse mean square of what the rotation by these angles leaves of the pairs. For
    /// a plane of which it leaves nothing, see
    /// [`PlaneMotion`](crate::measure::trajectories::PlaneMotion).
    ///
    /// # Errors
    /// When no weight is a number: the pairs move too little or too much.
    ///
    /// # Panics
    /// When the action and the pairs differ in their degrees of freedom.
    pub fn for_pairs(
        &self,
        action: &TorusAction,
        angles: &[f64],
        pairs: &Pairs,
    ) -> Result<Self, Error> {
        let Self::ByPlane { weights: None } = self else { return Ok(self.clone()) };
        let motions: Vec<f64> =
            plane_motions(action, angles, pairs).iter().map(|motion| motion.scale).collect();
        // Over the least of them, which has the largest weight: no square of a small number.
        let least = motions.iter().copied().fold(f64::INFINITY, |a, b| if b < a { b } else { a });
        let relative: Vec<f64> = motions.iter().map(|motion| (least / motion).powi(2)).collect();
        let mean = relative.iter().sum::<f64>() / relative.len() as f64;
        let weights: Vec<f64> = relative.iter().map(|weight| weight / mean).collect();
        let this = Self::ByPlane { weights: Some(weights) };
        this.component_weights(pairs.dof())?;
        Ok(this)
    }

    /// The loss that held-out pairs are measured with.
    pub fn of_held_out(&self) -> Self {
        match self {
            Self::ByPlane { .. } => self.clone(),
            Self::MeanSquaredError | Self::Weighted { .. } => Self::MeanSquaredError,
        }
    }

    /// Whether held-out errors are mean squared errors without weights.
    pub fn is_plain_on_held_out(&self) -> bool {
        !matches!(self, Self::ByPlane { .. })
    }

    /// Fails unless the weights that are given fit a map of so many degrees of freedom.
    ///
    /// # Errors
    /// Those of [`Loss::component_weights`].
    pub fn check(&self, dof: usize) -> Result<(), Error> {
        match self {
            Self::ByPlane { weights: None } => Ok(()),
            _ => self.component_weights(dof).map(|_| ()),
        }
    }

    /// The weight of each of the 2n components.
    ///
    /// # Errors
    /// When there is not one finite, non-negative weight for each degree of freedom; for [`Loss::ByPlane`], one
    /// positive weight for each degree of freedom or each component.
    pub fn component_weights(&self, dof: usize) -> Result<Vec<f64>, Error> {
        match self {
            Self::MeanSquaredError => Ok(vec![1.0 / (2 * dof) as f64; 2 * dof]),
            Self::Weighted { weights } => {
                Error::check_count("loss weights", dof, weights.len())?;
                if let Some(bad) = weights.iter().find(|w| !(w.is_finite() && **w >= 0.0)) {
                    return Err(Error::invalid("loss weights", bad, "a finite number ≥ 0"));
                }
                Ok(weights.iter().chain(weights).copied().collect())
            }
            Self::ByPlane { weights: None } => {
                let expected = "weights, or pairs to find them from";
                Err(Error::invalid("loss weights", "none", expected))
            }
            Self::ByPlane { weights: Some(weights) } => {
                if weights.len() != 2 * dof {
                    Error::check_count("loss weights", dof, weights.len())?;
                }
                let largest = weights.iter().copied().fold(0.0, max_or_nan);
                let positive = |w: &&f64| w.is_finite() && **w > 0.0;
                if let Some(bad) = weights.iter().find(|w| !positive(w)) {
                    return Err(Error::invalid("loss weights", bad, "a finite number > 0"));
                }
                let times = 2 * dof / weights.len();
                let sum = times as f64 * weights.iter().map(|w| w / largest).sum::<f64>();
                let of_all = (0..times).flat_map(|_| weights);
                Ok(of_all.map(|w| w / largest / sum).collect())
            }
        }
    }
}

/// Tasks for each thread, so that all end at about the same time.
const TASKS: usize = 8;

/// The loss of a composition on a set of pairs.
///
/// Sums are taken in a fixed order — in each lane over the pairs of a block of
/// 1024, four groups of eight going through the map together; then over the eight
/// lanes; then over the blocks — so that values and gradients are the same bits on
/// every processor and number of threads.
#[derive(Clone, Debug)]
pub struct Objective<'a> {
    pairs: Cow<'a, Pairs>,
    weights: Vec<f64>,
    penalty: f64,
    /// The steps of the map without which it is what the penalty is on; None where that is of the steps that ε scales.
    left_out: Option<Range<usize>>,
    /// Whether the angles of the circles are constants, not parameters.
    angles_fixed: bool,
    /// The factor on Σ_j (θ_j − θ⁰_j)², and the θ⁰_j.
    angle_penalty: Option<(f64, Vec<f64>)>,
}

/// A term of the loss: the mean square of P(z) − z′, or of the penalty.
pub(super) struct Term<'a> {
    pub(super) map: Cow<'a, Composition<f64>>,
    pub(super) weights: Vec<f64>,
    pub(super) input: &'a [f64],
    pub(super) output: &'a [f64],
    /// The angles of `map`, among its parameters, and their ratio to those of the network, which is
    /// 0 for angles that are fixed.
    pub(super) angles: Range<usize>,
    pub(super) time: f64,
    /// The parameters of `map` are the sums of those of the network times these products of controls.
    pub(super) products: Vec<f64>,
}

impl<'a> Objective<'a> {
    /// The loss on these pairs.
    ///
    /// # Errors
    /// Those of [`Loss::component_weights`].
    pub fn new(loss: &Loss, pairs: &'a Pairs) -> Result<Self, Error> {
        let weights = loss.component_weights(pairs.dof())?;
        let (pairs, penalty, angles_fixed) = (Cow::Borrowed(pairs), 0.0, false);
        Ok(Self { pairs, weights, penalty, left_out: None, angles_fixed, angle_penalty: None })
    }

    /// Adds `penalty` times the mean square of I_ε(z) − z over all components of the pairs' inputs,
    /// I_ε being the steps of the map that ε scales. Among maps that fit the pairs equally well,
    /// this prefers those whose I_ε is near the identity, and whose circle action is that of the
    /// data.
    ///
    /// In place of I_ε a nearly-integrable `model` has χ∘K_ε∘χ⁻¹, by how much its perturbation moves points: of maps
    /// that share work of order one between χ and K_ε in different ways, this prefers those whose invariants of the
    /// integrable part are nearly those of the whole.
    ///
    /// # Errors
    /// When `penalty` is not a finite number ≥ 0.
    pub fn with_near_identity_penalty(self, penalty: f64, model: &Model) -> Result<Self, Error> {
        Error::check_range("near_identity_penalty", penalty, 0.0, f64::MAX)?;
        Ok(Self { penalty, left_out: model.steps_before_perturbation(), ..self })
    }

    /// The same loss with derivatives 0 in the angles of the circles, so that training leaves
    /// them as they are.
    pub fn with_fixed_angles(self, fixed: bool) -> Self {
        Self { angles_fixed: fixed, ..self }
    }

    /// Adds `penalty` times Σ_j (θ_j − θ⁰_j)² over the angles of the circles. It is for networks
    /// whose I_ε could take over a part of the rotation.
    ///
    /// # Errors
    /// When `penalty` is not a finite number ≥ 0, or θ⁰ is not finite.
    pub fn with_angle_penalty(self, penalty: f64, angles: &[f64]) -> Result<Self, Error> {
        Error::check_range("theta_penalty", penalty, 0.0, f64::MAX)?;
        for &angle in angles {
            Error::check_finite("theta", angle)?;
        }
        let angle_penalty = (penalty > 0.0).then(|| (penalty, angles.to_vec()));
        Ok(Self { angle_penalty, ..self })
    }

    /// The same loss on other pairs.
    pub(super) fn on(&self, pairs: Pairs) -> Objective<'static> {
        Objective {
            pairs: Cow::Owned(pairs),
            weights: self.weights.clone(),
            penalty: self.penalty,
            left_out: self.left_out.clone(),
            angles_fixed: self.angles_fixed,
            angle_penalty: self.angle_penalty.clone(),
        }
    }

    /// Half the derivative of the penalty by each angle, with the index of the angle among the
    /// parameters; empty for angles that are fixed.
    pub(super) fn angle_penalty_gradients(&self, map: &Composition<f64>) -> Vec<(usize, f64)> {
        let Some((penalty, goals)) = self.angle_penalty.as_ref().filter(|_| !self.angles_fixed)
        else {
            return Vec::new();
        };
        let angles = map.angles();
        assert!(goals.len() == angles.len(), "{} angles for {}", goals.len(), angles.len());
        let pull = |(k, goal): (usize, &f64)| (k, penalty * (map.parameters()[k] - goal));
        angles.zip(goals).map(pull).collect()
    }

    /// The second derivative of half the penalty by each angle.
    pub(super) fn angle_stiffness(&self) -> f64 {
        self.angle_penalty.as_ref().map_or(0.0, |(penalty, _)| *penalty)
    }

    /// The penalty of the angles.
    pub(super) fn angle_cost(&self, map: &Composition<f64>) -> f64 {
        let stiffness = self.angle_stiffness();
        self.angle_penalty_gradients(map).iter().map(|(_, pull)| pull * (pull / stiffness)).sum()
    }

    /// The largest weight of a component; 1 where all are 0.
    pub(super) fn largest_weight(&self) -> f64 {
        let largest = self.weights.iter().copied().fold(0.0, max_or_nan);
        if largest > 0.0 { largest } else { 1.0 }
    }

    pub(super) fn pairs(&self) -> &Pairs {
        &self.pairs
    }

    /// The terms of the loss at the parameters of `map`.
    pub(super) fn terms<'s>(&'s self, map: &'s Composition<f64>) -> Vec<Term<'s>> {
        let map_of = map;
        assert!(
            map.dof() == self.pairs.dof(),
            "a map of {} dof on pairs of {} dof",
            map.dof(),
            self.pairs.dof()
        );
        let angles = map.angles();
        let mut terms = Vec::new();
        for (condition, input, output) in self.pairs.runs() {
            let (map, time, factor) = match condition {
                None => (Cow::Borrowed(map), 1.0, 1.0),
                Some(Condition { epsilon, time, weight, controls, .. }) => {
                    let member = map.member(*epsilon, *time, controls);
                    (Cow::Owned(member.expect("values of its controls")), *time, *weight)
                }
            };
            let products = match (condition, map_of.controls()) {
                (Some(Condition { controls, .. }), Some(of)) if !controls.is_empty() => {
                    of.products(controls)
                }
                _ => vec![1.0],
            };
            let weights = self.weights.iter().map(|weight| factor * weight).collect();
            let time = if self.angles_fixed { 0.0 } else { time };
            let angles = angles.clone();
            let near_identity = (self.penalty > 0.0).then(|| match &self.left_out {
                None => map.near_identity_part(),
                Some(steps) => map.without(steps.clone()),
            });
            let of_pairs =
                Term { map, weights, input, output, angles: angles.clone(), time, products };
            let products = of_pairs.products.clone();
            terms.push(of_pairs);
            if let Some(map) = near_identity {
                let dim = self.weights.len();
                let weights = vec![self.penalty / dim as f64; dim];
                let (map, output) = (Cow::Owned(map), input);
                terms.push(Term { map, weights, input, output, angles, time, products });
            }
        }
        terms
    }

    /// The loss of a network on the pairs.
    pub fn value(&self, map: &Composition<f64>) -> f64 {
        let mut total = 0.0;
        for term in self.terms(map) {
            for part in term.block_results(work::Kind::Loss, |b| on_lanes::<WIDTH, _>(Value(b))) {
                total += part;
            }
        }
        total / self.pairs.len() as f64 + self.angle_cost(map)
    }

    /// Returns the loss and sets `gradient` to its gradient in the parameters. Costs about three
    /// times the loss.
    ///
    /// Source: Griewank and Walther, Evaluating Derivatives,
    /// <https://doi.org/10.1137/1.9780898717761>, chapter 3, for the reverse mode.
    ///
    /// # Panics
    /// When the length of `gradient` is not the map's number of parameters.
    pub fn value_and_gradient(&self, map: &Composition<f64>, gradient: &mut [f64]) -> f64 {
        assert!(gradient.len() == map.parameters().len());
        gradient.fill(0.0);
        let mut total = 0.0;
        for term in self.terms(map) {
            let kind = work::Kind::Gradient;
            for (value, part) in term.block_results(kind, |b| on_lanes::<WIDTH, _>(Gradient(b))) {
                total += value;
                term.add(part, gradient);
            }
        }
        let count = self.pairs.len() as f64;
        for g in &mut *gradient {
            *g /= count;
        }
        for (k, pull) in self.angle_penalty_gradients(map) {
            gradient[k] += 2.0 * pull;
        }
        total / count + self.angle_cost(map)
    }

    /// (2/N) Σ Σ_c weight_c b_c ∇P_c at the parameters of `map`, b being the second difference
    /// P₊ + P₋ − 2P at a pair for the maps `beside` it. Costs two losses and a gradient.
    pub(super) fn acceleration_gradient(
        &self,
        map: &Composition<f64>,
        beside: [&Composition<f64>; 2],
    ) -> Vec<f64> {
        let mut gradient = vec![0.0; map.parameters().len()];
        let [ahead, behind] = beside.map(|map| self.terms(map));
        for (term, (ahead, behind)) in self.terms(map).iter().zip(ahead.iter().zip(&behind)) {
            let parts = term.block_results(work::Kind::Gradient, |blocks| {
                // Each pair goes through the maps beside it too.
                work::count(work::Kind::Loss, 2 * blocks.pairs());
                let beside = [&*ahead.map, &*behind.map];
                on_lanes::<WIDTH, _>(AccelerationGradient { blocks, beside })
            });
            for part in parts {
                term.add(part, &mut gradient);
            }
        }
        for g in &mut gradient {
            *g /= self.pairs.len() as f64;
        }
        gradient
    }

    /// The diagonal of the Gauss–Newton matrix of the loss,
    /// (2/N) Σ Σ_c weight_c (∂residual_c/∂parameter)². One Jacobian pass:
    /// 2n pullbacks a pair.
    pub fn curvature_diagonal(&self, map: &Composition<f64>) -> Vec<f64> {
        let mut diagonal = vec![0.0; map.parameters().len()];
        for term in self.terms(map) {
            let kind = work::Kind::Curvature;
            for part in term.block_results(kind, |b| on_lanes::<WIDTH, _>(Curvature(b))) {
                term.add_squares(part, &mut diagonal);
            }
        }
        for d in &mut diagonal {
            *d *= 2.0 / self.pairs.len() as f64;
        }
        for (k, _) in self.angle_penalty_gradients(map) {
            diagonal[k] += 2.0 * self.angle_stiffness();
        }
        diagonal
    }
}

impl Term<'_> {
    /// Adds to `sums` the derivatives by the parameters of the network, from those by the parameters of the term's
    /// map.
    fn add(&self, part: Vec<f64>, sums: &mut [f64]) {
        self.add_with(part, |factor| factor, sums);
    }

    /// [`Term::add`] of sums of squares of derivatives.
    fn add_squares(&self, part: Vec<f64>, sums: &mut [f64]) {
        self.add_with(part, |factor| factor * factor, sums);
    }

    fn add_with(&self, mut part: Vec<f64>, of: impl Fn(f64) -> f64, sums: &mut [f64]) {
        for angle in &mut part[self.angles.clone()] {
            *angle *= of(self.time);
        }
        for (product, sums) in self.products.iter().zip(sums.chunks_mut(part.len().max(1))) {
            for (sum, more) in sums.iter_mut().zip(&part) {
                *sum = of(*product).mul_add(*more, *sum);
            }
        }
    }

    /// The kernels give a result for each block. A task is several blocks, if there
    /// are enough for all threads: working space is made once for a task.
    fn block_results<T: Send>(
        &self,
        kind: work::Kind,
        f: impl Fn(Blocks<'_>) -> Vec<T> + Sync,
    ) -> Vec<T> {
        let dim = self.weights.len();
        let blocks = self.input.len().div_ceil(Blocks::PAIRS * dim);
        let task = (blocks / (TASKS * rayon::current_num_threads())).max(1) * Blocks::PAIRS * dim;
        self.input
            .par_chunks(task)
            .zip(self.output.par_chunks(task))
            .flat_map_iter(|(input, output)| {
                work::count(kind, input.len() / dim);
                f(Blocks { map: &self.map, weights: &self.weights, input, output })
            })
            .collect()
    }
}
