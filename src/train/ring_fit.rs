//! Estimates how an integrable map turns from pairs near it, as a start for twists of order one.

use super::{LevenbergMarquardtOptions, Optimiser, TrainingOptions, train};
use crate::error::Error;
use crate::flow::Pairs;
use crate::layer::TorusAction;
use crate::network::{Architecture, Model};
use crate::scalar::max_or_nan;
use crate::train::Control;
use std::f64::consts::TAU;

/// The mean angles by which the circles turn rings of pairs; a ring is a set of pairs with nearly
/// the same actions.
///
/// The pairs determine angles up to whole turns. These are added from ring to ring along the
/// minimum spanning tree of all rings in the space of actions, so that a frequency that changes by
/// several turns across the pairs is recovered. Training from a twist that does not turn would keep
/// angles that are wrong by whole turns.
///
/// Source: Ching, Rosenfeld and Braun, <https://doi.org/10.1109/83.148608>, for unwrapping along a minimum spanning
/// tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Rings {
    action: TorusAction,
    /// The plane of each circle, with its weight.
    planes: Vec<(usize, f64)>,
    /// The actions and the angles of the circles for each ring.
    rings: Vec<(Vec<f64>, Vec<f64>)>,
}

/// The mean number of pairs of a ring, at least.
const PAIRS: usize = 6;
/// The largest number of rings along one action.
const RINGS: usize = 64;
/// The pairs of a ring turn by different angles where their mean phase is shorter than this.
const TOGETHER: f64 = 0.5;
/// Angles of rings up to this one, in radians, are not confused with others.
const SMALL: f64 = 0.5;
/// Points on each ring, and iterations, that a twist is fitted with.
const POINTS: usize = 8;
const ITERATIONS: u64 = 100;

impl Rings {
    /// The rings of pairs of one map. None where a circle turns several planes, a plane does not
    /// turn, or the pairs of a ring do not turn together in half of the rings or more.
    pub fn fit(pairs: &Pairs, action: &TorusAction) -> Option<Self> {
        let (dof, circles) = (pairs.dof(), action.circles());
        if !pairs.conditions().is_empty() || action.dof() != dof || circles.len() != dof {
            return None;
        }
        let plane = |circle: &crate::layer::CircleAction| {
            let mut own = circle.weights().iter().enumerate().filter(|(_, m)| **m != 0);
            let (j, m) = own.next()?;
            own.next().is_none().then_some((j, f64::from(*m)))
        };
        let planes: Vec<(usize, f64)> = circles.iter().map(plane).collect::<Option<_>>()?;
        let mut taken = vec![false; dof];
        if planes.iter().any(|(j, _)| std::mem::replace(&mut taken[*j], true)) {
            return None;
        }
        let mut rings = mean_phases(pairs, &planes)?;
        let periods: Vec<f64> = planes.iter().map(|(_, m)| TAU / m.abs()).collect();
        unwrap(&mut rings, &periods);
        Some(Self { action: action.clone(), planes, rings })
    }

    /// The rings from which the twists of a network of this architecture start. None unless the twists are of order
    /// one and no ramp of flow times leads up to their angles.
    pub fn for_start(
        architecture: &Architecture,
        options: &TrainingOptions,
        pairs: &Pairs,
    ) -> Option<Self> {
        let turns = architecture.is_of_order_one() && architecture.twist_shears() > 0;
        let leads_up = options.ramp.iter().any(|stage| stage.flow_time.is_some());
        let action = architecture.action().filter(|_| turns && !leads_up)?;
        Self::fit(&pairs.at_middle_of_controls(), &action)
    }

    /// The actions and the angles of all circles, ring by ring.
    pub fn angles(&self) -> &[(Vec<f64>, Vec<f64>)] {
        &self.rings
    }

    /// Returns the model with its slow map fitted to turn as the rings do, starting from its
    /// present slow map and angles; its other blocks are unchanged.
    ///
    /// The fit is done at a fraction of the flow time, where all angles are smaller by the same
    /// factor, so that whole turns do not matter. It trains the slow map alone, on pairs on the
    /// rings.
    ///
    /// # Errors
    /// Those of [`train`].
    pub fn start(&self, model: &Model, theta_fixed: bool) -> Result<Model, Error> {
        let largest = { self.rings.iter() }.flat_map(|(_, angles)| angles);
        let largest = largest.map(|angle| angle.abs()).fold(0.0, max_or_nan);
        let share = if largest > SMALL { SMALL / largest } else { 1.0 };
        let alone = model.slow_map_alone()?;
        let short = alone.with_epsilon_and_time(alone.epsilon(), share)?;
        let pairs = self.pairs(share)?;
        let options = TrainingOptions {
            theta_fixed,
            iterations: ITERATIONS,
            optimiser: Optimiser::LevenbergMarquardt(LevenbergMarquardtOptions::default()),
            ..TrainingOptions::default()
        };
        let fitted = train(&short, &pairs, None, &options, None, &mut |_| Ok(Control::Continue))?;
        model.with_slow_map_of(&fitted.model.with_epsilon_and_time(alone.epsilon(), 1.0 / share)?)
    }

    /// Points of each ring, turned by a share of its angles.
    fn pairs(&self, share: f64) -> Result<Pairs, Error> {
        let dof = self.action.dof();
        let (mut input, mut output) = (Vec::new(), Vec::new());
        for (actions, angles) in &self.rings {
            for point in 0..POINTS {
                let mut z = vec![0.0; 2 * dof];
                for (number, ((j, m), action)) in self.planes.iter().zip(actions).enumerate() {
                    // Planes at different phases.
                    let turns = (number + 1) * point;
                    let (sin, cos) = libm::sincos(TAU * turns as f64 / POINTS as f64);
                    let radius = (2.0 * action / m).sqrt();
                    (z[*j], z[dof + *j]) = (radius * cos, radius * sin);
                }
                let small: Vec<f64> = angles.iter().map(|angle| share * angle).collect();
                input.extend_from_slice(&z);
                self.action.turn_by(&small).apply(&mut z, false);
                output.extend_from_slice(&z);
            }
        }
        Pairs::new("rings", dof, input, output)
    }
}

/// Sums over a cell of actions: of actions, of cosines and sines, and the number of pairs.
#[derive(Clone)]
struct Cell {
    actions: Vec<f64>,
    phases: Vec<[f64; 2]>,
    pairs: usize,
}

/// The mean actions and the angles of the mean phases in cells of equal extent in the actions.
fn mean_phases(pairs: &Pairs, planes: &[(usize, f64)]) -> Option<Vec<(Vec<f64>, Vec<f64>)>> {
    let (dof, circles) = (pairs.dof(), planes.len());
    let action =
        |z: &[f64], (j, m): &(usize, f64)| 0.5 * m * (z[*j] * z[*j] + z[dof + *j] * z[dof + *j]);
    let rows = || pairs.input().chunks_exact(2 * dof).zip(pairs.output().chunks_exact(2 * dof));
    let (mut low, mut high) = (vec![f64::INFINITY; circles], vec![f64::NEG_INFINITY; circles]);
    for (z, _) in rows() {
        for (a, plane) in planes.iter().enumerate() {
            let own = action(z, plane);
            low[a] = own.min(low[a]);
            high[a] = own.max(high[a]);
        }
    }
    let most = (pairs.len() / PAIRS) as f64;
    let across = (libm::pow(most, 1.0 / circles as f64) as usize).clamp(1, RINGS);
    let count = across.checked_pow(u32::try_from(circles).ok()?)?;
    let empty = Cell { actions: vec![0.0; circles], phases: vec![[0.0; 2]; circles], pairs: 0 };
    let mut cells = vec![empty; count];
    for (z, w) in rows() {
        let mut index = 0;
        for (a, plane) in planes.iter().enumerate() {
            let share = (action(z, plane) - low[a]) / (high[a] - low[a]);
            index = index * across + ((share * across as f64) as usize).min(across - 1);
        }
        let cell = &mut cells[index];
        cell.pairs += 1;
        for (a, plane) in planes.iter().enumerate() {
            let (j, m) = *plane;
            cell.actions[a] += action(z, plane);
            let cosine = z[j] * w[j] + z[dof + j] * w[dof + j];
            let sine = z[dof + j] * w[j] - z[j] * w[dof + j];
            let size = libm::hypot(cosine, sine);
            if size > 0.0 {
                cell.phases[a][0] += cosine / size;
                cell.phases[a][1] += m.signum() * sine / size;
            }
        }
    }
    let filled: Vec<Cell> = cells.into_iter().filter(|cell| cell.pairs > 0).collect();
    let together = |cell: &Cell| {
        let length = |[cosine, sine]: &[f64; 2]| libm::hypot(*cosine, *sine);
        cell.phases.iter().all(|phase| length(phase) >= TOGETHER * cell.pairs as f64)
    };
    let all = filled.len();
    let rings: Vec<(Vec<f64>, Vec<f64>)> = filled
        .iter()
        .filter(|cell| together(cell))
        .map(|cell| {
            let actions = cell.actions.iter().map(|sum| sum / cell.pairs as f64).collect();
            let angle = |([cosine, sine], (_, m)): (&[f64; 2], &(usize, f64))| {
                libm::atan2(*sine, *cosine) / m.abs()
            };
            (actions, cell.phases.iter().zip(planes).map(angle).collect())
        })
        .collect();
    // Where many rings are no rings, the rest is chance.
    (rings.len() > 1 && 2 * rings.len() > all).then_some(rings)
}

/// Adds whole turns of a plane, along the shortest tree over all rings, until neighbours turn by nearly the
/// same angles.
fn unwrap(rings: &mut [(Vec<f64>, Vec<f64>)], periods: &[f64]) {
    let circles = rings[0].0.len();
    let widths: Vec<f64> = (0..circles)
        .map(|a| {
            let own = rings.iter().map(|(actions, _)| actions[a]);
            // Actions of pairs, which are finite.
            let (low, high) = own.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), own| {
                (if own < low { own } else { low }, if own > high { own } else { high })
            });
            high - low
        })
        .collect();
    let distance = |a: &[f64], b: &[f64]| -> f64 {
        let along = |k: usize| if widths[k] > 0.0 { (a[k] - b[k]) / widths[k] } else { 0.0 };
        (0..circles).map(|k| along(k) * along(k)).sum()
    };
    let mut nearest: Vec<(f64, usize)> =
        rings.iter().map(|(actions, _)| (distance(actions, &rings[0].0), 0)).collect();
    let mut left: Vec<usize> = (1..rings.len()).collect();
    while !left.is_empty() {
        let by_distance = |a: &usize, b: &usize| nearest[*a].0.total_cmp(&nearest[*b].0);
        let (place, next) = match left.iter().enumerate().min_by(|a, b| by_distance(a.1, b.1)) {
            Some((place, next)) => (place, *next),
            None => break,
        };
        left.swap_remove(place);
        let known = rings[nearest[next].1].1.clone();
        for ((angle, known), period) in rings[next].1.iter_mut().zip(known).zip(periods) {
            *angle += period * ((known - *angle) / period).round();
        }
        for other in &left {
            let far = distance(&rings[*other].0, &rings[next].0);
            if far < nearest[*other].0 {
                nearest[*other] = (far, next);
            }
        }
    }
}
