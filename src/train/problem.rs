//! A prepared training, and what comes out of it.

use super::{
    AreaDefect, FitNote, Judgement, Outcome, RampStage, Rings, Scheduled, StageData, Starts,
    TrainingObserver, TrainingOptions, train_schedule,
};
use crate::digest;
use crate::error::Error;
use crate::flow::{Condition, Pairs, Region};
use crate::layer::TorusAction;
use crate::network::{Architecture, InitialWeights, Model, NetworkSpec};
use crate::phase::{Section, Units};

/// A stage of a ramp with pairs of its own.
#[derive(Clone, Debug)]
pub struct StagePairs {
    /// The ε of its pairs.
    pub epsilon: f64,
    /// Their flow time divided by that of the network.
    pub time: f64,
    /// The pairs that the stage is trained on.
    pub training: Pairs,
    /// The pairs that the stage chooses its best model by.
    pub held_out: Option<Pairs>,
    /// The largest number of iterations of the stage.
    pub iterations: u64,
}

impl StagePairs {
    /// The pairs of a stage of a ramp among those of a training, which may be of several maps: those of its ε and of its
    /// flow time, of any where it names none. `own` are the ε and the flow time of the network.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the stage when no pair is of its ε and flow time.
    pub fn among(
        stage: &RampStage,
        own: (f64, f64),
        training: &Pairs,
        held_out: Option<&Pairs>,
    ) -> Result<Self, Error> {
        let (epsilon, time) = (stage.epsilon.unwrap_or(own.0), stage.flow_time.unwrap_or(own.1));
        let share = time / own.1;
        let is_of = |condition: &Condition| {
            let epsilon = stage.epsilon.unwrap_or(condition.epsilon);
            condition.is_of(epsilon, stage.flow_time.map_or(condition.time, |_| share))
        };
        let is_any = stage.epsilon.is_none() && stage.flow_time.is_none();
        let of = |pairs: &Pairs| -> Option<Pairs> {
            let is_one_map = pairs.conditions().is_empty();
            if is_one_map && !is_any { None } else { pairs.under_conditions(is_of) }
        };
        let training = of(training).ok_or_else(|| {
            let found = format!("a stage of ε = {epsilon} and flow time {time}");
            Error::invalid("training.ramp", found, "an ε and a flow time that some pairs have")
        })?;
        let held_out = held_out.and_then(of);
        Ok(Self { epsilon, time: share, training, held_out, iterations: stage.iterations })
    }
}

/// A model of an earlier flow time, whose weights a training takes over.
#[derive(Clone, Debug)]
pub struct Earlier {
    /// The model that the weights are taken from.
    pub model: Model,
    /// The flow time of the training divided by that of the model.
    pub time: f64,
}

/// Initial models of one architecture.
#[derive(Clone, Copy, Debug)]
pub struct InitialModels<'a> {
    /// The architecture that all initial models have.
    pub architecture: &'a Architecture,
    /// The distribution that weights are drawn from.
    pub weights: InitialWeights,
    /// The angles of the circles; empty for networks without circles.
    pub angles: &'a [f64],
    /// The seed of the training.
    pub seed: u64,
    /// A model whose weights the first start takes over.
    pub from: Option<&'a Earlier>,
    /// The initial rotation of the slow map, where it is known.
    pub rings: Option<&'a Rings>,
    /// Whether the angles stay fixed.
    pub theta_fixed: bool,
}

impl InitialModels<'_> {
    /// The initial model of the start with this number, from 0.
    ///
    /// # Errors
    /// Those of [`Architecture::initialise`] and [`Model::with_angles`].
    pub fn model(&self, number: u64) -> Result<Model, Error> {
        let seed = Starts::seed(self.seed, number);
        let model = self.architecture.initialise(self.weights, 0.0, seed)?;
        let model = model.with_polynomials_at_rest()?.with_angles(self.angles)?;
        match (self.from, self.rings) {
            (Some(from), _) if number == 0 => model.with_weights_of(&from.model, from.time),
            (_, Some(rings)) => rings.start(&model, self.theta_fixed),
            _ => Ok(model),
        }
    }
}

/// A prepared training: pairs in the coordinates of a network, the network, and its initial values.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The network, as it was asked for or chosen.
    pub network: NetworkSpec,
    /// The architecture of the network.
    pub architecture: Architecture,
    /// How the initial weights of the network are drawn.
    pub weights: InitialWeights,
    /// How it is trained, with the weights of the loss that were found from the pairs.
    pub training: TrainingOptions,
    /// The circles of the limit.
    pub action: TorusAction,
    /// The angles of the rotation nearest to the pairs, one for each circle.
    pub nearest: Vec<f64>,
    /// The initial angles of the circles.
    pub angles: Vec<f64>,
    /// The training pairs, in units of the network.
    pub pairs: Pairs,
    /// The pairs that choose the best model, in units of the network.
    pub held_out: Option<Pairs>,
    /// The units of the data, where they differ from those of `pairs`.
    pub units: Option<Units>,
    /// The charts of the data, where its columns are not canonical.
    pub section: Option<Section>,
    /// The box around all pairs, in units of the data.
    pub region: Option<Region>,
    /// The flow time of the pairs, where it is known.
    pub flow_time: Option<f64>,
    /// SHA-256 of the pairs, as they were given.
    pub digest: String,
    /// The seed of the weights, and of the held-out choice where the fit made it.
    pub seed: u64,
    /// What was found in the pairs or chosen for them: notes that reports and warnings give.
    pub notes: Vec<FitNote>,
    /// The ε of the pairs, which the records of stages give.
    pub epsilon: f64,
    /// The stages of the ramp that `training` has.
    pub stages: Vec<StagePairs>,
    /// The model that the first start takes its weights from.
    pub from: Option<Earlier>,
}

impl Problem {
    /// SHA-256 of what decides the weights after each iteration of the training: the network with its initial weights,
    /// the pairs, and the options but for when training stops and how often it saves.
    pub fn training_digest(&self) -> String {
        let pairs_of = |stage: &StagePairs| {
            let place = (stage.epsilon.to_bits(), stage.time.to_bits(), stage.iterations);
            (place, stage.training.digest(), stage.held_out.as_ref().map(Pairs::digest))
        };
        let from = self.from.as_ref().map(|from| {
            let weights = digest::of_numbers(from.model.parameters());
            (from.model.architecture(), weights, from.time.to_bits())
        });
        let decides = (
            (&self.architecture, self.weights, digest::of_numbers(&self.angles), from, self.seed),
            (self.pairs.digest(), self.held_out.as_ref().map(Pairs::digest)),
            self.stages.iter().map(pairs_of).collect::<Vec<_>>(),
            self.training.clone().without_ends(),
        );
        digest::of_bytes(&serde_json::to_vec(&decides).expect("numbers, names and lists of them"))
    }

    /// What is known of how well its pairs keep areas; nothing where the network keeps none.
    pub fn area_defects(&self) -> Vec<AreaDefect> {
        let defects = self.notes.iter().filter_map(FitNote::area_defect);
        defects.filter(|_| self.architecture.is_symplectic()).collect()
    }

    pub(super) fn initial_models<'a>(&'a self, rings: Option<&'a Rings>) -> InitialModels<'a> {
        let has_circle = self.architecture.has_circle();
        InitialModels {
            architecture: &self.architecture,
            weights: self.weights,
            angles: if has_circle { &self.angles } else { &[] },
            seed: self.seed,
            from: self.from.as_ref(),
            rings,
            theta_fixed: self.training.theta_fixed,
        }
    }

    /// The network of the first start before any training, without the [rotation](Rings) that training may find for
    /// its slow map.
    ///
    /// # Errors
    /// Those of [`InitialModels::model`].
    pub fn initial_model(&self) -> Result<Model, Error> {
        self.initial_models(None).model(0)
    }

    /// Trains the network and reports to the observer.
    ///
    /// # Errors
    /// Those of [`train_schedule`].
    pub fn train(self, observer: &mut dyn TrainingObserver) -> Result<Fitted, Error> {
        let rings = Rings::for_start(&self.architecture, &self.training, &self.pairs);
        let initial = self.initial_models(rings.as_ref());
        let mut data: Vec<StageData<'_>> = self
            .stages
            .iter()
            .map(|stage| StageData {
                epsilon: stage.epsilon,
                time: stage.time,
                pairs: &stage.training,
                held_out: stage.held_out.as_ref(),
                iterations: stage.iterations,
            })
            .collect();
        data.push(StageData {
            epsilon: self.epsilon,
            time: 1.0,
            pairs: &self.pairs,
            held_out: self.held_out.as_ref(),
            iterations: self.training.iterations,
        });
        let start = &mut |number| initial.model(number);
        let training = train_schedule(start, &data, &self.training, observer)?;
        Ok(Fitted { problem: self, training })
    }
}

/// A trained network and what it was trained on.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The pairs and options that the network was trained with.
    pub problem: Problem,
    /// The result of the training.
    pub training: Scheduled,
}

impl Fitted {
    /// The network, in its own [units](Problem::units). Unless these are None, they differ from those of the data:
    /// `StoredModel::of_fit` is the map of the data.
    pub fn model(&self) -> &Model {
        &self.training.outcome.model
    }

    /// The last stage of its training.
    pub fn outcome(&self) -> &Outcome {
        &self.training.outcome
    }

    /// The action and the angles of the rotation nearest to the pairs, which is what the network
    /// has to improve upon.
    pub fn nearest(&self) -> (&TorusAction, &[f64]) {
        (&self.problem.action, &self.problem.nearest)
    }

    /// Whether to trust the network, why not, and what limits it: judged by the held-out pairs.
    ///
    /// # Errors
    /// Those of [`Judgement::new`].
    pub fn judgement(&self) -> Result<Judgement, Error> {
        let (pairs, held_out) = (&self.problem.pairs, self.problem.held_out.as_ref());
        let judgement = Judgement::new(self.outcome(), pairs, held_out, self.nearest())?;
        Ok(judgement.with_area_defects(self.problem.area_defects()))
    }
}
