//! Gauss–Newton steps, damped after Levenberg and Marquardt.
//!
//! (A + λD)δ = −g with the Gauss–Newton matrix A of the loss, its gradient g and the diagonal D of
//! A, whose entries count as no smaller than the loss, as in [L-BFGS](super::LbfgsOptions): so a
//! parameter that hardly matters is not sent far away.
//!
//! In a narrow, curved valley straight steps must be short. The path that minimises the current
//! model is δ to first order and ½α to second,
//! (A + λD)α = −(2/N) Σ Σ_c weight_c r″_c ∇r_c with the second derivative r″ of the residuals
//! along δ: the geodesic acceleration of Transtrum and Sethna, arXiv:1201.5885. It reuses the
//! Cholesky factor of A + λD and needs no second derivatives by the parameters.
//!
//! A library's solver would need the Jacobian of all residuals, which takes gigabytes for the data
//! sets of this crate, and would keep a state that cannot be stored. This one sums the matrix in
//! pieces ([`Objective::normal_equations`](super::Objective::normal_equations)) and resumes from a
//! checkpoint with the same bits.

use super::minimise::{Minimise, OptimiserState, Problem, Resumed, Step, largest};
use super::record::Stop;
use super::{NormalEquations, Objective};
use crate::error::Error;
use crate::network::Architecture;
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// Options of Levenberg–Marquardt.
///
/// A step costs Np²n multiplications for N pairs and p parameters, and three matrices of p × p
/// numbers are held. Training begins with a subset of the pairs, evenly spaced, and takes another
/// subset every ten iterations. The subset doubles when the loss on all pairs is much larger than
/// that on the subset, when the loss on all pairs has not fallen for fifty iterations, or when no
/// step lowers the loss on the subset any more.
///
/// Source: Marquardt, <https://doi.org/10.1137/0111030>; Transtrum and Sethna,
/// <https://arxiv.org/abs/1201.5885>, for the geodesic acceleration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LevenbergMarquardtOptions {
    /// λ of the first step.
    pub damping: f64,
    /// The initial number of residuals for each parameter; more where twists have been
    /// [trained alone](super::FreshTwists) on more. 0 takes all pairs at once.
    pub residuals: f64,
    /// The ratio of the loss on all pairs to that on the subset above which the subset grows.
    pub gap: f64,
}

impl Default for LevenbergMarquardtOptions {
    fn default() -> Self {
        Self { damping: 1e-3, residuals: 10.0, gap: 1.5 }
    }
}

/// The matrices of as many parameters take 10 GB.
const MOST_PARAMETERS: usize = 20_000;

impl LevenbergMarquardtOptions {
    pub(super) fn check(&self) -> Result<(), Error> {
        let name = |option: &str| format!("training.optimiser.{option}");
        Error::check_range(&name("damping"), self.damping, LEAST_DAMPING, MOST_DAMPING)?;
        Error::check_range(&name("residuals"), self.residuals, 0.0, f64::MAX)?;
        Error::check_range(&name("gap"), self.gap, 1.0, f64::MAX)
    }

    /// Parameters for each residual of a pair.
    fn parameters_a_residual(architecture: &Architecture) -> f64 {
        architecture.parameter_count() as f64 / (2 * architecture.dof) as f64
    }

    /// The pairs to begin with, of so many.
    #[doc(hidden)]
    pub fn pairs(&self, architecture: &Architecture, all: usize) -> usize {
        let wanted = (self.residuals * Self::parameters_a_residual(architecture)).ceil();
        let part = self.residuals > 0.0 && wanted < all as f64;
        if part { wanted as usize } else { all }
    }

    /// Begins with at least so many pairs.
    #[doc(hidden)]
    pub fn begin_with(&mut self, pairs: usize, architecture: &Architecture) {
        if self.residuals > 0.0 {
            // Half a pair less, which rounding up gives back, and not one more.
            let residuals = (pairs as f64 - 0.5) / Self::parameters_a_residual(architecture);
            self.residuals = self.residuals.max(residuals);
        }
    }
}

/// The kind of its state in a checkpoint.
const KIND: &str = "levenberg-marquardt";
/// Damping below the rounding of A has no effect.
const LEAST_DAMPING: f64 = 1e-16;
/// Steps of such a damping move no digit of a parameter of size one.
const MOST_DAMPING: f64 = 1e20;
/// Iterations with the same pairs, after which it looks at the loss on all.
const LOOK: u64 = 10;
/// After this many looks without a lower loss on all pairs, more of them are used.
const LOOKS: u64 = 5;
/// The fraction of a step on both sides of which the residuals are taken for their second
/// derivative. The third derivative cancels; the fourth leaves an error of a twelfth of its value
/// times the square of this fraction.
const BESIDE: f64 = 0.1;

/// The state of Levenberg–Marquardt between two iterations.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct LevenbergMarquardtState {
    /// The damping λ of the normal equations.
    damping: f64,
    /// What λ is multiplied with when a step fails.
    growth: f64,
    /// How many pairs it uses.
    pairs: usize,
    /// The lowest loss on all pairs that was seen with so many of them, and the looks
    /// since then.
    lowest: f64,
    looks: u64,
    iterations: u64,
    evaluations: u64,
    curvatures: u64,
}

impl LevenbergMarquardtState {
    /// Fails unless it is a state after so many iterations.
    fn check(&self, place: &str, iteration: u64) -> Result<(), Error> {
        let place = format!("{place}: optimiser");
        let name = |what: &str| format!("{place}: {what}");
        Error::check_range(&name("damping"), self.damping, LEAST_DAMPING, f64::MAX)?;
        Error::check_range(&name("growth"), self.growth, 2.0, f64::MAX)?;
        Error::check_count_range(&name("pairs"), self.pairs, 1, usize::MAX)?;
        Error::check_range(&name("lowest"), self.lowest, 0.0, f64::MAX)?;
        // Each iteration has one evaluation at least, and no more than a search of all
        // dampings has.
        let evaluations = iteration.saturating_mul(1000).saturating_add(1000);
        let sound = self.iterations == iteration
            && self.looks < LOOKS
            && self.evaluations <= evaluations
            && self.curvatures <= evaluations;
        if sound { Ok(()) } else { Err(Error::content(place, "counts of the history", "others")) }
    }
}

pub(super) struct LevenbergMarquardt<'a> {
    problem: Problem<'a>,
    options: LevenbergMarquardtOptions,
    state: LevenbergMarquardtState,
    /// The loss on some of the pairs; None for all.
    part: Option<Objective<'static>>,
    /// The model of the loss at the present parameters, and the loss itself.
    present: Option<(NormalEquations, f64)>,
    /// Whether the model was counted before, in the run that is resumed.
    counted: bool,
}

impl<'a> LevenbergMarquardt<'a> {
    pub(super) fn new(
        problem: Problem<'a>,
        options: &LevenbergMarquardtOptions,
    ) -> Result<Self, Error> {
        let pairs = options.pairs(problem.model.architecture(), problem.objective.pairs().len());
        let (damping, growth) = (options.damping, 2.0);
        let state = LevenbergMarquardtState {
            damping,
            growth,
            pairs,
            lowest: f64::MAX,
            looks: 0,
            iterations: 0,
            evaluations: 0,
            curvatures: 0,
        };
        Self::at(problem, options, state)
    }

    pub(super) fn resume(
        problem: Problem<'a>,
        options: &LevenbergMarquardtOptions,
        from: &Resumed,
    ) -> Result<Self, Error> {
        let state: LevenbergMarquardtState = from.read(KIND)?;
        state.check(&from.place, from.iteration)?;
        Self::at(problem, options, state)
    }

    fn at(
        problem: Problem<'a>,
        options: &LevenbergMarquardtOptions,
        state: LevenbergMarquardtState,
    ) -> Result<Self, Error> {
        let parameters = problem.model.composition().parameters().len();
        let name = "parameters for Levenberg–Marquardt";
        Error::check_count_range(name, parameters, 1, MOST_PARAMETERS)?;
        let counted = state.iterations > 0;
        let (options, part, present) = (options.clone(), None, None);
        let mut out = Self { problem, options, state, part, present, counted };
        out.use_pairs(out.state.pairs);
        Ok(out)
    }

    fn use_pairs(&mut self, pairs: usize) {
        if pairs > self.state.pairs {
            (self.state.lowest, self.state.looks) = (f64::MAX, 0);
        }
        let all = self.problem.objective;
        let count = all.pairs().len();
        // More than half of them would be no part worth a copy.
        let pairs = if pairs > count / 2 { count } else { pairs };
        self.state.pairs = pairs.clamp(1, count);
        self.part = None;
        let (pairs, turn) = (self.state.pairs, self.state.iterations / LOOK);
        self.part = (pairs < count).then(|| all.on(all.pairs().thinned_in_turn(pairs, turn)));
        self.present = None;
    }

    fn objective(&self) -> &Objective<'_> {
        self.part.as_ref().unwrap_or(self.problem.objective)
    }

    fn loss(&self, parameters: &[f64]) -> f64 {
        self.problem.loss(self.objective(), parameters)
    }

    /// Whether the loss on all pairs is finite. With neurons it always is; polynomials may map points of which the
    /// subset has few to values that are not finite.
    fn is_sound(&mut self, parameters: &[f64]) -> bool {
        if self.part.is_none() || !self.problem.model.architecture().has_polynomials() {
            return true;
        }
        self.state.evaluations += 1;
        self.problem.loss(self.problem.objective, parameters).is_finite()
    }

    fn equations(&self, parameters: &[f64]) -> Result<NormalEquations, Error> {
        let current = self.problem.model.with_parameters(parameters.to_vec())?;
        Ok(self.objective().normal_equations(current.composition()))
    }

    /// The step at the present damping, with its geodesic acceleration, and by how much the step
    /// without it lowers the quadratic model of the loss. None where the matrix has no Cholesky
    /// factor.
    fn solve(
        &mut self,
        parameters: &[f64],
        equations: &NormalEquations,
        floor: f64,
    ) -> Option<(Vec<f64>, f64)> {
        let NormalEquations { matrix, gradient, .. } = equations;
        let mut damped = matrix.clone();
        let damping: Vec<f64> =
            (0..gradient.len()).map(|i| self.state.damping * matrix[(i, i)].max(floor)).collect();
        for (i, more) in damping.iter().enumerate() {
            damped[(i, i)] += more;
        }
        let factor = damped.llt(Side::Lower).ok()?;
        let solution = |right: &[f64]| -> Vec<f64> {
            let solution = factor.solve(Mat::from_fn(right.len(), 1, |i, _| -right[i]));
            (0..right.len()).map(|i| solution[(i, 0)]).collect()
        };
        let mut step = solution(gradient);
        let mut lower = 0.0;
        for ((d, g), more) in step.iter().zip(gradient).zip(&damping) {
            lower += 0.5 * d * (more * d - g);
        }
        if !(lower > 0.0 && lower.is_finite()) {
            return None;
        }
        if let Some(gradient) = self.acceleration_gradient(parameters, &step) {
            for (d, acceleration) in step.iter_mut().zip(solution(&gradient)) {
                *d += 0.5 * acceleration;
            }
        }
        Some((step, lower))
    }

    /// (2/N) Σ Σ_c weight_c r″_c ∇r_c along the step. None where it is not finite.
    fn acceleration_gradient(&mut self, parameters: &[f64], step: &[f64]) -> Option<Vec<f64>> {
        let at = |part: f64| {
            let moved = parameters.iter().zip(step).map(|(p, d)| p + part * d).collect();
            self.problem.model.with_parameters(moved).ok()
        };
        let (here, ahead, behind) = (at(0.0)?, at(BESIDE)?, at(-BESIDE)?);
        let beside = [ahead.composition(), behind.composition()];
        let mut gradient = self.objective().acceleration_gradient(here.composition(), beside);
        self.state.evaluations += 3;
        for g in &mut gradient {
            *g /= BESIDE * BESIDE;
        }
        gradient.iter().all(|g| g.is_finite()).then_some(gradient)
    }

    /// The first step, with more and more damping, that lowers the loss: the new
    /// parameters and their loss.
    fn descend(
        &mut self,
        parameters: &[f64],
        equations: &NormalEquations,
        loss: f64,
    ) -> Option<(Vec<f64>, f64)> {
        while self.state.damping <= MOST_DAMPING {
            if let Some((step, predicted)) = self.solve(parameters, equations, loss) {
                let moved: Vec<f64> = parameters.iter().zip(&step).map(|(p, d)| p + d).collect();
                if moved == parameters {
                    return None;
                }
                let lower = self.loss(&moved);
                self.state.evaluations += 1;
                if lower < loss && self.is_sound(&moved) {
                    // Nielsen, IMM-REP-1999-05, equation (2.2).
                    let gain = (loss - lower) / predicted;
                    let shrink = (1.0 - (2.0 * gain - 1.0).powi(3)).max(1.0 / 3.0);
                    self.state.damping = (self.state.damping * shrink).max(LEAST_DAMPING);
                    self.state.growth = 2.0;
                    return Some((moved, lower));
                }
            }
            self.state.damping *= self.state.growth;
            self.state.growth *= 2.0;
        }
        None
    }

    /// Doubles the subset; false where it is all pairs already.
    fn take_more(&mut self) -> bool {
        let more = self.part.is_some();
        if more {
            self.use_pairs(2 * self.state.pairs);
            self.state.damping = self.options.damping;
            self.state.growth = 2.0;
        }
        more
    }
}

impl Minimise for LevenbergMarquardt<'_> {
    fn step(
        &mut self,
        parameters: &mut Vec<f64>,
        _: f64,
    ) -> Result<ControlFlow<Stop, Step>, Error> {
        let (moved, mut loss) = loop {
            let (equations, loss) = match self.present.take() {
                Some(present) => present,
                None => {
                    let new = u64::from(!std::mem::take(&mut self.counted));
                    self.state.curvatures += new;
                    self.state.evaluations += new;
                    (self.equations(parameters)?, self.loss(parameters))
                }
            };
            if let Some(found) = self.descend(parameters, &equations, loss) {
                break found;
            }
            if !self.take_more() {
                return Ok(ControlFlow::Break(Stop::Stalled));
            }
        };
        self.state.iterations += 1;
        if self.part.is_some() && self.state.iterations.is_multiple_of(LOOK) {
            self.state.evaluations += 1;
            let all = self.problem.loss(self.problem.objective, &moved);
            if all < self.state.lowest {
                (self.state.lowest, self.state.looks) = (all, 0);
            } else {
                self.state.looks += 1;
            }
            let enough = all <= self.options.gap * loss && self.state.looks < LOOKS;
            self.use_pairs(if enough { 1 } else { 2 } * self.state.pairs);
            loss = self.loss(&moved);
            self.state.evaluations += 1;
            if !loss.is_finite() {
                // What is not finite can be neither compared nor stored.
                return Ok(ControlFlow::Break(Stop::Diverged));
            }
        }
        *parameters = moved;
        self.state.curvatures += 1;
        let equations = self.equations(parameters)?;
        let gradient = largest(&equations.gradient);
        self.present = Some((equations, loss));
        Ok(ControlFlow::Continue(Step { loss, gradient, pairs: self.state.pairs }))
    }

    fn evaluations(&self) -> u64 {
        self.state.evaluations
    }

    fn curvatures(&self) -> u64 {
        self.state.curvatures
    }

    fn state(&self) -> OptimiserState {
        OptimiserState::of(KIND, &self.state)
    }
}
