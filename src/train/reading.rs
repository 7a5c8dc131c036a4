//! How to interpret pairs: which columns form a plane, and which planes turn.

use super::{ActionFit, fit_rotations, fit_units};
use crate::flow::Pairs;
use crate::layer::{CircleAction, TorusAction};
use crate::measure::trajectories::{root_mean_square, rotation_error};

/// Another order of columns or other weights of the circle action that fit the pairs far better:
/// the nearest rotation has at most a tenth of the mean squared error, in units fitted to each.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// The names of the columns in this reading.
    pub columns: String,
    /// Whether the order of the columns differs from the given one.
    pub reorders: bool,
    /// The weights of the circle action.
    pub weights: Vec<i32>,
    /// The mean squared error of the rotation nearest to the pairs in this reading, over the mean
    /// square of the outputs.
    pub error: f64,
    /// That error for the pairs with the columns in the order in which they were given.
    pub as_given: f64,
}

impl Reading {
    /// The smallest ratio of the error of the pairs as given to that of another reading.
    const FACTOR: f64 = 10.0;
    /// The largest number of pairs that are used.
    const PAIRS: usize = 1000;
    /// Of fewer pairs a rotation fits one order of columns much better by chance.
    const FEWEST: usize = 20;

    /// The pairs with columns q₁ p₁ q₂ p₂ … taken in the order q₁ … qₙ, p₁ … pₙ, and that order.
    pub(super) fn interleaved(pairs: &Pairs) -> (Pairs, Vec<usize>) {
        let order = Self::by_halves(pairs.dof());
        (pairs.with_columns(&order), order)
    }

    /// The positions of q₁ … qₙ, p₁ … pₙ among columns q₁ p₁ q₂ p₂ ….
    fn by_halves(dof: usize) -> Vec<usize> {
        (0..dof).map(|j| 2 * j).chain((0..dof).map(|j| 2 * j + 1)).collect()
    }

    /// A reading that fits far better than that of columns q₁ … qₙ, p₁ … pₙ and this action, if
    /// there is one. It tries interleaved columns, and weights 0 to 2 for up to four planes; of more
    /// planes it tries each one alone.
    ///
    /// Columns with momenta before positions are not found: they turn the other way and fit as
    /// well.
    ///
    /// Of fewer than 20 pairs there is none.
    ///
    /// Where the fast plane makes about whole turns from inputs to outputs, a rotation of the slow
    /// plane fits better too. Another action is therefore named only where [`ActionFit`] is sure of
    /// it.
    pub fn better(pairs: &Pairs, action: &TorusAction) -> Option<Self> {
        let dof = pairs.dof();
        if action.dof() != dof || pairs.len() < Self::FEWEST {
            return None;
        }
        let given = pairs.thinned(Self::PAIRS);
        let interleaved = Self::by_halves(dof);
        let name = |half: &str, j: usize| format!("{half}{}", j + 1);
        let planes = |j: usize| format!("{} {}", name("q", j), name("p", j));
        let by_planes: Vec<String> = (0..dof).map(planes).collect();
        let by_halves: Vec<String> =
            ["q", "p"].iter().flat_map(|half| (0..dof).map(|j| name(half, j))).collect();
        let mut readings = vec![(by_halves.join(" "), given.clone())];
        if dof > 1 {
            readings.push((by_planes.join(" "), given.with_columns(&interleaved)));
        }
        let error = |pairs: &Pairs, action: &TorusAction| {
            let units = fit_units(pairs, action);
            let scaled = units.and_then(|units| pairs.to_network("pairs", &units).ok());
            let pairs = scaled.as_ref().unwrap_or(pairs);
            let angles = fit_rotations(pairs, action);
            rotation_error(action, &angles, pairs) / root_mean_square(pairs.output()).powi(2)
        };
        let as_given = error(&given, action);
        let mut actions = vec![action.clone()];
        if action.circles().len() == 1 {
            actions.extend(candidates(dof).into_iter().map(TorusAction::from));
        }
        let mut best: Option<Self> = None;
        for (number, (columns, pairs)) in readings.iter().enumerate() {
            let fit = ActionFit::fit(pairs).ok().filter(ActionFit::is_sure);
            let may_be = |other: &TorusAction| {
                let sure = fit.as_ref().map(ActionFit::action);
                other == action || sure.is_some_and(|sure| other.circles() == [sure.clone()])
            };
            for action in actions.iter().filter(|action| may_be(action)) {
                let error = error(pairs, action);
                if error < best.as_ref().map_or(as_given / Self::FACTOR, |best| best.error) {
                    let weights = action.circles().iter().flat_map(CircleAction::weights);
                    let weights = weights.copied().collect();
                    let (columns, reorders) = (columns.clone(), number > 0);
                    best = Some(Self { columns, reorders, weights, error, as_given });
                }
            }
        }
        best
    }

    /// Describes the reading in words.
    pub fn describe(&self) -> String {
        let weights: Vec<String> = self.weights.iter().map(i32::to_string).collect();
        format!(
            "the pairs fit columns {} with circle action {} better: the nearest rotation errs by \
             {:.1} % (rms), by {:.1} % as they were said to be; {}",
            self.columns,
            weights.join(","),
            100.0 * self.error.sqrt(),
            100.0 * self.as_given.sqrt(),
            ActionFit::WHOLE_TURNS
        )
    }
}

/// Circle actions of weights 0, 1 and 2 without a common factor.
fn candidates(dof: usize) -> Vec<CircleAction> {
    const MOST: usize = 4;
    if dof > MOST {
        let one = |plane: usize| (0..dof).map(|j| i32::from(j == plane)).collect::<Vec<_>>();
        return (0..dof).map(|plane| CircleAction::new(one(plane))).collect();
    }
    let weights = |number: usize| -> Vec<i32> {
        (0..dof).map(|j| (number / 3_usize.pow(j as u32) % 3) as i32).collect()
    };
    (1..3_usize.pow(dof as u32))
        .map(weights)
        .filter(|weights| weights.contains(&1))
        .map(CircleAction::new)
        .collect()
}
