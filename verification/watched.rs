//! Maps that note by which law they were run, so that `coverage` knows of it
//! from the run and not from a list.

use gyroceptron::measure::{Layers, Measurable, NearlyPeriodic, steps::MeasuredSteps};
use gyroceptron::phase::{Direction, Map};
use std::collections::BTreeSet;
use std::ops::Deref;
use std::sync::Mutex;

static RUNS: Mutex<BTreeSet<(&'static str, &'static str)>> = Mutex::new(BTreeSet::new());

/// The laws that moved a point by a map of the type of this name.
pub fn laws_that_ran(map: &str) -> Vec<&'static str> {
    let runs = RUNS.lock().expect("no panic while it is held");
    runs.iter().filter(|(_, seen)| *seen == map).map(|(law, _)| *law).collect()
}

/// `gyroceptron::network::Composition<f64>` → `Composition`.
fn short(path: &'static str) -> &'static str {
    let path = path.split('<').next().unwrap_or(path);
    path.rsplit("::").next().unwrap_or(path)
}

/// A map as it is, whose runs are put down to `law`.
pub struct Watched<T> {
    law: &'static str,
    map: T,
}

/// Watches the map behind a reference or a box.
pub fn watched<T>(law: &'static str, map: T) -> Watched<T> {
    Watched { law, map }
}

impl<T: Deref<Target: Measurable>> Watched<T> {
    fn running(&self) -> &T::Target {
        let run = (self.law, short(self.map.type_name()));
        RUNS.lock().expect("no panic while it is held").insert(run);
        &self.map
    }
}

impl<T: Deref<Target: Measurable>> Map<f64> for Watched<T> {
    fn dof(&self) -> usize {
        self.map.dof()
    }
    fn forward(&self, z: &mut [f64]) {
        self.running().forward(z);
    }
    fn inverse(&self, z: &mut [f64]) {
        self.running().inverse(z);
    }
}

impl<T: Deref<Target: Measurable>> Measurable for Watched<T> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        self.running().measured_steps(direction)
    }
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        self.running().move_points(direction, points);
    }
    fn layers(&self) -> Layers<'_> {
        let watch = |layer| Box::new(watched(self.law, layer)) as Box<dyn Measurable>;
        self.map.layers().into_iter().map(|(direction, layer)| (direction, watch(layer))).collect()
    }
}

impl<T: Deref<Target: NearlyPeriodic>> NearlyPeriodic for Watched<T> {
    fn map_at(&self, epsilon: f64) -> Box<dyn Measurable + '_> {
        Box::new(watched(self.law, self.map.map_at(epsilon)))
    }
    fn near_identity_at(&self, epsilon: f64) -> Box<dyn Measurable + '_> {
        Box::new(watched(self.law, self.map.near_identity_at(epsilon)))
    }
    fn conjugation(&self) -> Box<dyn Measurable + '_> {
        Box::new(watched(self.law, self.map.conjugation()))
    }
    fn action_weights(&self) -> Vec<i32> {
        self.map.action_weights()
    }
    fn turn(&self, theta: f64, z: &mut [f64]) {
        self.map.turn(theta, z);
    }
    fn conjugated_action_at(&self, theta: f64) -> Box<dyn Measurable + '_> {
        Box::new(watched(self.law, self.map.conjugated_action_at(theta)))
    }
    fn angle(&self) -> f64 {
        self.map.angle()
    }
    fn epsilon(&self) -> f64 {
        self.map.epsilon()
    }
}

/// To have a map, or to ask for its size, is not to run it.
#[test]
fn a_map_counts_when_it_moves_a_point() {
    let (model, law) = (crate::mutants::clean(), "self-test");
    let map = watched(law, &model);
    let ran = |name: &str| laws_that_ran(name).contains(&law);
    assert_eq!((map.dof(), map.layers().len() > 3), (2, true));
    assert!(!ran("gyroceptron") && !ran("HenonLayer"));
    map.forward(&mut [0.1, 0.2, 0.3, 0.4]);
    assert!(ran("gyroceptron") && !ran("HenonLayer"));
    let layers = map.layers();
    let steps = layers[0].1.measured_steps(Direction::Forward);
    steps[0].apply(&mut [0.1, 0.2, 0.3, 0.4]);
    assert!(ran("HenonLayer") && !ran("Turn"));
}
