//! Which circle action some pairs have, where it is not known: that of the network that learns them best.

use super::shared::Study;
use crate::error::Error;
use crate::flow::Pairs;
use crate::layer::CircleAction;
use crate::measure::timing::Spread;
use crate::network::{Circles, InitialWeights, NetworkSpec};
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::event::Event;
use crate::scene::figure::{Axis, Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::setup::{Data, MOST, Need};
use crate::system::{Hamiltonian, NearlyPeriodic};
use crate::train::{
    ActionFit, Control, Loss, Stop, TrainingOptions, TrainingRecord, fit_rotation, train,
};
use serde::{Deserialize, Serialize};
use serde_json::json;

const FIGURE: &str = "which-action";
/// The tries that are over.
pub(in crate::scene) const CHECKPOINT: &str = "which-action.checkpoint";

/// An ensemble of circle actions. With each, a network is trained for a short while, several times with other pairs and
/// weights. The outcome is compared with what the linear map nearest to the same pairs says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WhichActionOptions {
    /// The actions, that of the system among them, and no two of them [conjugate](CircleAction::is_conjugate).
    pub actions: Vec<CircleAction>,
    /// How often all are tried.
    pub tries: usize,
    /// The pairs of each try: no two tries share one.
    pub pairs: usize,
    /// The network, which is given each of the actions in turn. Its angle begins at that of the rotation nearest to the
    /// pairs, since the frequency is not known either.
    pub network: Box<NetworkSpec>,
    /// How its weights are drawn.
    pub weights: InitialWeights,
    /// The training options of the network.
    pub training: Box<TrainingOptions>,
}

impl Study for WhichActionOptions {
    fn name(&self) -> &'static str {
        "which_action"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::System, Need::FlowTime, Need::Data]
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        Error::check_count_range("actions", self.actions.len(), 2, MOST)?;
        Error::check_count_range("tries", self.tries, 1, MOST)?;
        Error::check_count_range("pairs", self.pairs, 1, MOST)?;
        self.training.check()?;
        self.training.check_single()?;
        if self.network.circles() != Circles::One || self.network.own_action().is_some() {
            let expected = "a gyroceptron without a circle action of its own";
            return Err(Error::invalid("network", &self.network.kind, expected));
        }
        self.network.check_from(0).map_err(|e| e.with_place("network"))?;
        let family = scene.setup.data.as_ref().is_some_and(Data::is_family);
        if family {
            let expected = "pairs of one map: which action they have is asked of one";
            return Err(Error::invalid("data", "several ε or flow times", expected));
        }
        for (index, action) in self.actions.iter().enumerate() {
            let name = || format!("actions[{index}]");
            for weight in action.weights() {
                Error::check_range(&name(), f64::from(*weight), -MOST_WEIGHT, MOST_WEIGHT)?;
            }
            if action.common_factor() != 1 {
                let expected =
                    "weights, not all 0, without a common factor: it changes the angle alone";
                return Err(Error::invalid(&name(), action, expected));
            }
            let architecture = self.network.architecture(&action.clone().into(), 1.0, 1.0)?;
            architecture.check().map_err(|e| e.with_place("network"))?;
            self.training.check_for(&architecture)?;
            if let Some(system) = &scene.setup.system {
                Error::check_count(&name(), system.dof(), action.dof())?;
            }
            if let Some(same) =
                self.actions[..index].iter().find(|other| action.is_conjugate(other))
            {
                let expected = format!(
                    "others than {}: an exchange of planes, which is symplectic, makes one of the other",
                    same
                );
                return Err(Error::invalid(&name(), action, expected));
            }
        }
        if self.training.loss == (Loss::ByPlane { weights: None }) {
            let expected = "weights: those of the planes' motion are other ones for each action";
            return Err(Error::invalid("training.loss", "by-plane", expected));
        }
        if let Some(system) = &scene.setup.system {
            ActionFit::check_planes(system.dof())?;
            // The linear map nearest to the pairs has a column more than they.
            Error::check_count_range("pairs", self.pairs, 2 * system.dof() + 1, MOST)?;
        }
        match &scene.setup.system {
            Some(system) if system.torus().1.len() > 1 => {
                let expected = "a system whose limit turns along circles";
                Err(Error::invalid("system", system.kind(), expected))
            }
            Some(system) if self.right(&system.circle_action()).is_none() => {
                let expected = format!("{} among them", system.circle_action());
                Err(Error::invalid("actions", "others only", expected))
            }
            _ => Ok(()),
        }
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![FIGURE]
    }

    /// A study of fewer tries, of fewer pairs, in half of the iterations.
    fn shorten(&mut self) {
        self.tries = self.tries.min(2);
        // No fewer than the linear map of any system wants.
        self.pairs = (self.pairs / 4).max(self.pairs.min(11));
        let half = self.training.iterations.div_ceil(2);
        self.training.iterations = half.max(20).min(self.training.iterations);
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let action = context.system()?.circle_action();
        let data = context.data()?;
        let (all, held_out) = (&data.training, data.validation());
        let Some(held_out) = held_out else {
            let expected = "a share above 0: actions are judged by pairs that are held out";
            return Err(Error::invalid("data.validation", 0, expected).into());
        };
        let wanted = self.tries.saturating_mul(self.pairs);
        Error::check_count_range("pairs for all tries", all.len(), wanted, usize::MAX)?;
        let mut tries: Vec<WithAction> = context.folder.earlier(CHECKPOINT)?.unwrap_or_default();
        for number in tries.len()..self.tries {
            // From all windows alike.
            let at = |k: usize| {
                ((k * self.tries + number) as u128 * all.len() as u128 / wanted as u128) as usize
            };
            let pairs = all.rows((0..self.pairs).map(at));
            tries.push(self.learn_with(context, number, &pairs, held_out)?);
            context.folder.save(CHECKPOINT, &tries)?;
        }
        let right = self.right(&action).unwrap_or(0);
        let found = Results { options: self, right, tries };
        let figures = match context.draws(FIGURE) {
            true => vec![found.figure()],
            false => Vec::new(),
        };
        let text = format!(
            "Each of the {} actions is given to a network, {} iterations each, in {} tries of {} pairs and initial weights of \
             their own; the angle begins at the rotation nearest to the pairs. Chosen is the action whose \
             network errs least on {} held-out pairs; the margin is how many times as large the mean squared error of \
             the next is, and below {CLEAR} the try says that it is not sure. Without training: the planes' angles of the \
             linear map nearest to the same pairs, among all weights up to 3, and whether it is sure.",
            self.actions.len(),
            self.training.iterations,
            self.tries,
            self.pairs,
            held_out.len()
        );
        Ok(Findings {
            title: "Which circle action".into(),
            results: Section {
                summary: vec![
                    Block::Text(found.words()),
                    Block::Table(found.by_action()),
                    Block::Table(found.by_try()),
                ],
                details: vec![Block::Text(text)],
                data: found.data(),
            },
            figures,
            ..Findings::default()
        })
    }
}

/// If the next best error is less than this many times the best one, the best is not distinguished from it.
const CLEAR: f64 = 3.0;

/// Larger weights are taken for a mistake.
const MOST_WEIGHT: f64 = 100.0;

/// One try of all actions.
#[derive(Serialize, Deserialize)]
struct WithAction {
    /// The held-out error of the network of each action; None where it could not be trained.
    errors: Vec<Option<f64>>,
    /// The same on the way: iterations and errors.
    history: Vec<Vec<(u64, f64)>>,
    /// What the linear map says, and whether it is sure.
    linear: CircleAction,
    sure: bool,
}

impl WithAction {
    /// The best action, and how many times as far the next is; 1 where there is no other.
    fn chosen(&self) -> Option<(usize, f64)> {
        let mut known: Vec<(usize, f64)> =
            self.errors.iter().enumerate().filter_map(|(k, e)| Some((k, (*e)?))).collect();
        known.sort_by(|a, b| a.1.total_cmp(&b.1));
        let (first, least) = *known.first()?;
        Some((first, known.get(1).map_or(1.0, |(_, next)| next / least)))
    }
}

impl WhichActionOptions {
    /// The number of an action.
    fn right(&self, action: &CircleAction) -> Option<usize> {
        self.actions.iter().position(|own| own == action)
    }

    fn learn_with(
        &self,
        context: &mut Context<'_>,
        number: usize,
        pairs: &Pairs,
        held_out: &Pairs,
    ) -> Result<WithAction, RunError> {
        let fit = ActionFit::fit(pairs)?;
        let (mut errors, mut history) = (Vec::new(), Vec::new());
        for action in &self.actions {
            let name = format!("try {}, action {}", number + 1, action);
            let on_the_way = context.stage(&name, |context| {
                self.trained(context, &name, action, number, pairs, held_out)
            });
            let on_the_way = match on_the_way {
                Err(RunError::Failed(Error::Diverged { .. })) => Vec::new(),
                other => other?,
            };
            errors.push(on_the_way.iter().map(|(_, error)| *error).min_by(f64::total_cmp));
            history.push(on_the_way);
        }
        Ok(WithAction { errors, history, linear: fit.action().clone(), sure: fit.is_sure() })
    }

    /// The held-out error of a network in the course of its training.
    fn trained(
        &self,
        context: &mut Context<'_>,
        name: &str,
        action: &CircleAction,
        number: usize,
        pairs: &Pairs,
        held_out: &Pairs,
    ) -> Result<Vec<(u64, f64)>, RunError> {
        let (epsilon, time) = (context.system()?.epsilon(), context.flow_time()?);
        let seed = context.scene.seed.wrapping_add(number as u64);
        let Ok(architecture) = self.network.architecture(&action.clone().into(), epsilon, time)
        else {
            return Err(Error::invalid("network", "a file", "one to train").into());
        };
        let architecture = architecture.in_box_of(pairs.points());
        let model = architecture.initialise(self.weights, fit_rotation(pairs, action), seed)?;
        let outcome =
            train(&model, pairs, Some(held_out), &self.training, None, &mut |progress| {
                let (record, iterations) = (progress.record, self.training.iterations);
                context.report(Event::Iteration { model: name, record, iterations });
                Ok(if context.interrupted() { Control::Interrupt } else { Control::Continue })
            })?;
        if outcome.stop == Stop::Interrupted {
            return Err(RunError::Interrupted);
        }
        let of = |record: &TrainingRecord| {
            let error = record.validation.filter(|error| error.is_finite())?;
            Some((record.iteration, error))
        };
        Ok(outcome.history.iter().filter_map(of).collect())
    }
}

struct Results<'a> {
    options: &'a WhichActionOptions,
    /// The number of the system's own action.
    right: usize,
    tries: Vec<WithAction>,
}

impl Results<'_> {
    /// How often the right one is chosen, surely, and how often surely another.
    fn counted(&self, chosen: impl Fn(&WithAction) -> Option<(bool, bool)>) -> String {
        let all: Vec<(bool, bool)> = self.tries.iter().filter_map(chosen).collect();
        let count = |wanted: (bool, bool)| all.iter().filter(|found| **found == wanted).count();
        format!(
            "right in {} of {} tries and sure in {}, wrong in {} and sure of it in {}",
            count((true, true)) + count((true, false)),
            self.tries.len(),
            count((true, true)),
            self.tries.len() - count((true, true)) - count((true, false)),
            count((false, true)),
        )
    }

    fn words(&self) -> String {
        let by_training = self.counted(|one| {
            let (chosen, margin) = one.chosen()?;
            Some((chosen == self.right, margin >= CLEAR))
        });
        let right = &self.options.actions[self.right];
        let by_map = self.counted(|one| Some((one.linear == *right, one.sure)));
        format!(
            "The action is {}. By training it is {by_training}; by the linear map, without training, {by_map}.",
            right
        )
    }

    fn by_action(&self) -> Table {
        let mut table = Table::new([
            ("action", Format::Exact),
            ("held-out MSE over the tries", Format::Exponent(1)),
            ("over that of the right one", Format::Magnitude),
            ("the best in", Format::Exact),
        ]);
        let median = |action: usize| {
            let errors: Option<Vec<f64>> =
                self.tries.iter().map(|one| one.errors[action]).collect();
            Spread::from_values(errors?)
        };
        let least = median(self.right).map(|spread| spread.median);
        for (number, action) in self.options.actions.iter().enumerate() {
            let errors = median(number);
            let best = |one: &&WithAction| one.chosen().is_some_and(|(best, _)| best == number);
            let name = match number == self.right {
                true => format!("**{action}**"),
                false => action.to_string(),
            };
            table.push([
                name.into(),
                errors.into(),
                errors.and_then(|errors| Some(errors.median / least?)).into(),
                self.tries.iter().filter(best).count().into(),
            ]);
        }
        table
    }

    fn by_try(&self) -> Table {
        let mut table = Table::new([
            ("try", Format::Exact),
            ("by training", Format::Exact),
            ("margin", Format::Factor),
            ("sure", Format::Exact),
            ("by the linear map", Format::Exact),
            ("sure", Format::Exact),
        ]);
        let words = |sure: bool| if sure { "yes" } else { "not sure" };
        for (number, one) in self.tries.iter().enumerate() {
            let chosen = one.chosen();
            table.push([
                (number + 1).into(),
                chosen.map(|(best, _)| self.options.actions[best].to_string()).into(),
                chosen.map(|(_, margin)| margin).into(),
                chosen.map(|(_, margin)| words(margin >= CLEAR)).into(),
                one.linear.to_string().into(),
                words(one.sure).into(),
            ]);
        }
        table
    }

    fn data(&self) -> serde_json::Value {
        let actions: Vec<String> =
            self.options.actions.iter().map(CircleAction::to_string).collect();
        json!({ "actions": actions, "right": self.right, "tries": self.tries })
    }

    /// The error of each action against the iterations, one line a try.
    fn figure(&self) -> Figure {
        let mut series = Vec::new();
        for (number, action) in self.options.actions.iter().enumerate() {
            let style = if number == self.right { Style::Marked } else { Style::Line };
            for (index, one) in self.tries.iter().enumerate() {
                let points =
                    one.history[number].iter().map(|(at, error)| (*at as f64, *error)).collect();
                series.push(match index {
                    0 => Series { name: action.to_string(), color: number, style, points },
                    _ => Series::unnamed(number, style, points),
                });
            }
        }
        let panel = Panel {
            x_label: "iterations".into(),
            y_label: "held-out mean squared error".into(),
            y: Axis::Log,
            series,
            ..Panel::default()
        };
        let caption = "The held-out error of networks of each circle action in the course of their training, a \
                       line for each try; marked, that of the system.";
        Figure::in_a_row(FIGURE, caption, vec![panel])
    }
}
