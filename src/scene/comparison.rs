//! What a scene compares by error and run time, and with what.

use super::declaration::{TanhSpec, WorkPrecisionSpec};
use super::results::ReferenceRollout;
use crate::error::Error;
use crate::flow::{Integrator, Pairs};
use crate::measure::{
    Contestant, WorkPrecision, jacobians_by_differences, precise_jacobians, relative_difference,
    root_mean_square_distance, tanh_errors, work_precision,
};
use crate::network::{
    Composition, Direction, Model, Rollout, Stream, map_jacobians, map_jacobians_by_duals,
    map_points, rollout,
};
use crate::scalar::tanh_sech2_of_all;
use crate::system::{Hamiltonian, System};
use serde::{Deserialize, Serialize};

/// Contests of a scene. In a report there are no times: those depend on the machine.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// One step.
    pub one_step: Option<Contest>,
    /// The roll-out.
    pub rollout: Option<Contest>,
    /// Jacobians of each network, seconds for one.
    pub jacobians: Vec<JacobianContest>,
}

/// Ways to the same trajectories.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contest {
    /// How many there are.
    pub trajectories: usize,
    /// How long they are.
    pub time: f64,
    /// The root mean square of |z| along them.
    pub size: f64,
    /// The error of the reference that they are judged by.
    pub reference_error: f64,
    /// Each way, seconds for a trajectory and unit time.
    pub ways: Vec<WorkPrecision>,
}

/// Ways to the Jacobians of one network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JacobianContest {
    /// The network.
    pub model: String,
    /// Each way, seconds for a Jacobian.
    pub ways: Vec<WorkPrecision>,
}

impl Comparison {
    /// What does not depend on the machine.
    pub fn without_times(&self) -> Self {
        Self {
            one_step: self.one_step.as_ref().map(Contest::without_times),
            rollout: self.rollout.as_ref().map(Contest::without_times),
            jacobians: self
                .jacobians
                .iter()
                .map(|own| JacobianContest {
                    model: own.model.clone(),
                    ways: without_times(&own.ways),
                })
                .collect(),
        }
    }
}

impl Contest {
    fn without_times(&self) -> Self {
        Self { ways: without_times(&self.ways), ..*self }
    }

    /// Judges the states that contestants give by those of the reference.
    fn hold(
        contestants: &[Contestant<'_>],
        reference: &[f64],
        dim: usize,
        (trajectories, time): (usize, f64),
        reference_error: f64,
        rounds: usize,
    ) -> Result<Self, Error> {
        let judge = |states: &[f64]| root_mean_square_distance(states, reference, dim);
        let ways = work_precision(contestants, &judge, trajectories as f64 * time, rounds)?;
        let origin = vec![0.0; reference.len()];
        let size = root_mean_square_distance(reference, &origin, dim);
        Ok(Self { trajectories, time, size, reference_error, ways })
    }
}

fn without_times(judged: &[WorkPrecision]) -> Vec<WorkPrecision> {
    judged.iter().map(|own| WorkPrecision { seconds: None, ..own.clone() }).collect()
}

/// How a network's trajectories are timed.
pub(super) const TOGETHER: &str = "all together";
pub(super) const ALONE: &str = "one alone";
/// Ways to Jacobians.
pub(super) const DUALS: &str = "duals";
pub(super) const BY_HAND: &str = "chain rule by hand";

/// What is compared in an experiment.
pub(super) struct Field<'a> {
    pub(super) spec: &'a WorkPrecisionSpec,
    pub(super) system: &'a System,
    pub(super) time: f64,
    /// The pairs that one step is judged on.
    pub(super) pairs: &'a Pairs,
    /// The error of their reference flow.
    pub(super) pairs_error: f64,
    pub(super) reference: Option<&'a ReferenceRollout<'a>>,
    pub(super) models: Vec<(&'a str, &'a Model)>,
}

impl Field<'_> {
    pub(super) fn compare(&self) -> Result<Comparison, Error> {
        let jacobians = if self.spec.differences.is_empty() {
            Vec::new()
        } else {
            self.models
                .iter()
                .map(|(name, model)| self.jacobians(name, model))
                .collect::<Result<_, Error>>()?
        };
        let rollout = self.reference.map(|reference| self.rollout(reference)).transpose()?;
        Ok(Comparison { one_step: Some(self.one_step()?), rollout, jacobians })
    }

    /// Jacobians over dual numbers that one round takes, with those that all are
    /// judged by.
    pub(super) fn jacobian_count(&self) -> u64 {
        match self.spec.differences.is_empty() {
            true => 0,
            false => 2 * (self.models.len() * self.pairs.len().min(self.spec.points)) as u64,
        }
    }

    /// Rows of the pairs, evenly spaced.
    fn chosen(&self, rows: &[f64]) -> Vec<f64> {
        let (dim, len) = (2 * self.pairs.dof(), self.pairs.len());
        let count = len.min(self.spec.points);
        let row = |k: usize| &rows[k * len / count * dim..][..dim];
        (0..count).flat_map(row).copied().collect()
    }

    fn one_step(&self) -> Result<Contest, Error> {
        let dim = 2 * self.system.dof();
        let (input, target) = (self.chosen(self.pairs.input()), self.chosen(self.pairs.output()));
        let input = &input[..];
        let mut contestants = Vec::new();
        for (name, model) in &self.models {
            let map = model.composition();
            contestants.push(Contestant {
                name: format!("{name}, {TOGETHER}"),
                setting: None,
                run: Box::new(move || {
                    let mut moved = input.to_vec();
                    map_points(map, Direction::Forward, &mut moved)?;
                    Ok(moved)
                }),
            });
            contestants.push(Contestant {
                name: format!("{name}, {ALONE}"),
                setting: None,
                run: Box::new(move || {
                    let mut moved = input.to_vec();
                    for point in moved.chunks_exact_mut(dim) {
                        map_points(map, Direction::Forward, point)?;
                    }
                    Ok(moved)
                }),
            });
        }
        for entry in &self.spec.integrators {
            contestants.extend(
                entry
                    .one_step
                    .iter()
                    .map(|&steps| self.integrator(entry.integrator, steps, input, self.time, 1)),
            );
        }
        let count = input.len() / dim;
        let (of, error) = ((count, self.time), self.pairs_error);
        Contest::hold(&contestants, &target, dim, of, error, self.spec.rounds)
    }

    fn rollout(
        &self,
        (request, (reference, error)): &ReferenceRollout<'_>,
    ) -> Result<Contest, Error> {
        let dim = reference.dim;
        let initial = request.initial.concat();
        let initial = &initial[..];
        let asked = Rollout { steps: request.steps, every: request.every };
        let interval = self.time * request.every as f64;
        let kept = asked.kept() - 1;
        let mut contestants = Vec::new();
        for (name, model) in &self.models {
            let map = model.composition();
            contestants.push(Contestant {
                name: format!("{name}, {TOGETHER}"),
                setting: None,
                run: Box::new(move || Ok(rollout(map, initial, asked)?.split_off(initial.len()))),
            });
            contestants.push(Contestant {
                name: format!("{name}, {ALONE}"),
                setting: None,
                run: Box::new(move || {
                    let mut all = vec![0.0; kept * initial.len()];
                    for (m, start) in initial.chunks_exact(dim).enumerate() {
                        let own = rollout(map, start, asked)?;
                        for (t, state) in own.chunks_exact(dim).skip(1).enumerate() {
                            let first = t * initial.len() + m * dim;
                            all[first..first + dim].copy_from_slice(state);
                        }
                    }
                    Ok(all)
                }),
            });
        }
        for entry in &self.spec.integrators {
            contestants.extend(
                entry.rollout.iter().map(|&steps| {
                    self.integrator(entry.integrator, steps, initial, interval, kept)
                }),
            );
        }
        let target = &reference.values[initial.len()..];
        let (count, time) = (initial.len() / dim, interval * kept as f64);
        Contest::hold(&contestants, target, dim, (count, time), *error, self.spec.rounds)
    }

    fn integrator<'a>(
        &'a self,
        integrator: Integrator,
        steps: usize,
        initial: &'a [f64],
        interval: f64,
        kept: usize,
    ) -> Contestant<'a> {
        Contestant {
            name: integrator.name(),
            setting: Some(steps as f64),
            run: Box::new(move || {
                integrator.trajectories(self.system, initial, interval, steps, kept)
            }),
        }
    }

    fn jacobians(&self, name: &str, model: &Model) -> Result<JacobianContest, Error> {
        let map = model.composition();
        let points = self.chosen(self.pairs.input());
        let points = &points[..];
        let dim = 2 * map.dof();
        let mut contestants = vec![
            jacobian_way(DUALS, None, map, points, map_jacobians_by_duals),
            jacobian_way(BY_HAND, None, map, points, map_jacobians),
        ];
        contestants.extend(self.spec.differences.iter().map(|&step| {
            let differences = move |map: &Composition<f64>, points: &[f64], out: &mut [f64]| {
                jacobians_by_differences(map, step, points, out)
            };
            jacobian_way("central differences", Some(step), map, points, differences)
        }));
        let exact = precise_jacobians(map, points);
        let judge = |out: &[f64]| relative_difference(out, &exact);
        let units = (points.len() / dim) as f64;
        let ways = work_precision(&contestants, &judge, units, self.spec.rounds)?;
        Ok(JacobianContest { model: name.to_owned(), ways })
    }
}

/// A way to the Jacobians at all points.
fn jacobian_way<'a>(
    name: &str,
    setting: Option<f64>,
    map: &'a Composition<f64>,
    points: &'a [f64],
    f: impl Fn(&Composition<f64>, &[f64], &mut [f64]) -> Result<(), Error> + Sync + 'a,
) -> Contestant<'a> {
    Contestant {
        name: name.into(),
        setting,
        run: Box::new(move || {
            let mut out = vec![0.0; points.len() * 2 * map.dof()];
            f(map, points, &mut out)?;
            Ok(out)
        }),
    }
}

/// A way to tanh and sech².
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TanhWay {
    /// The largest error of tanh, in units in the last place.
    pub tanh_ulps: f64,
    /// sech²: its largest relative error and seconds a value, with tanh.
    pub sech2: WorkPrecision,
}

impl TanhWay {
    /// What does not depend on the machine: no times, and nothing of the functions
    /// of the system.
    pub(super) fn as_result(&self) -> Option<Self> {
        if self.sech2.name.starts_with(OF_THE_SYSTEM) {
            return None;
        }
        let sech2 = WorkPrecision { seconds: None, ..self.sech2.clone() };
        Some(Self { tanh_ulps: self.tanh_ulps, sech2 })
    }
}

/// std takes tanh and cosh from the C library.
const OF_THE_SYSTEM: &str = "std";

/// tanh and sech² of each value, one array after the other, by this crate and as
/// one would write it with the functions at hand.
pub(super) fn compare_tanh(spec: &TanhSpec, seed: u64) -> Result<Vec<TanhWay>, Error> {
    let mut stream = Stream::new(seed, "tanh");
    let x: Vec<f64> =
        (0..spec.values).map(|_| stream.uniform(-spec.largest, spec.largest)).collect();
    let x = &x[..];
    let way = |name: &str, f: fn(f64) -> (f64, f64)| Contestant {
        name: name.into(),
        setting: None,
        run: Box::new(move || {
            let mut out = vec![0.0; 2 * x.len()];
            let (t, s) = out.split_at_mut(x.len());
            for ((&x, t), s) in x.iter().zip(t).zip(s) {
                (*t, *s) = f(x);
            }
            Ok(out)
        }),
    };
    let contestants = [
        Contestant {
            name: "gyroceptron".into(),
            setting: None,
            run: Box::new(move || {
                let mut out = vec![0.0; 2 * x.len()];
                let (t, s) = out.split_at_mut(x.len());
                tanh_sech2_of_all(x, t, s);
                Ok(out)
            }),
        },
        way("std, sech² = 1 − tanh²", |x| {
            let t = x.tanh();
            (t, (-t).mul_add(t, 1.0))
        }),
        way("std, sech² = 1/cosh²", |x| {
            let c = x.cosh();
            (x.tanh(), 1.0 / (c * c))
        }),
        way("libm, sech² = 1 − tanh²", |x| {
            let t = libm::tanh(x);
            (t, (-t).mul_add(t, 1.0))
        }),
        way("libm, sech² = 1/cosh²", |x| {
            let c = libm::cosh(x);
            (libm::tanh(x), 1.0 / (c * c))
        }),
    ];
    let errors = |out: &[f64]| {
        let (t, s) = out.split_at(x.len());
        tanh_errors(x, t, s)
    };
    let judged = work_precision(&contestants, &|out| errors(out).1, x.len() as f64, spec.rounds)?;
    let mut out = Vec::new();
    for (contestant, sech2) in contestants.iter().zip(judged) {
        let (tanh_ulps, _) = errors(&(contestant.run)()?);
        out.push(TanhWay { tanh_ulps, sech2 });
    }
    Ok(out)
}
