//! Running scenes in a folder.

use gyroceptron::layer::CircleAction;
use gyroceptron::network::{GyroceptronShape, InitialWeights, Model};
use gyroceptron::scene::{Event, Folder, Observer, Report, Scene, find, parse, run};
use std::path::Path;

pub struct Quiet;

impl Observer for Quiet {
    fn event(&mut self, _: Event<'_>) {}
}

pub fn run_in(folder: &Path, scene: &Scene) -> Report {
    let folder = Folder::open(folder, false, false).expect("a folder");
    run(scene, &folder, &mut Quiet).expect("runs").expect("not interrupted")
}

/// What a run says that fails.
pub fn failed_in(folder: &Path, scene: &Scene) -> String {
    let folder = Folder::open(folder, false, false).expect("a folder");
    match run(scene, &folder, &mut Quiet) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("it runs"),
    }
}

pub fn temporary() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

pub fn refused(text: &str, words: &[&str]) {
    let error = parse("scene", text).and_then(|scene| scene.complete()).expect_err("refused");
    let error = error.to_string();
    for word in words {
        assert!(error.contains(word), "`{error}` does not name `{word}`");
    }
}

pub fn network(epsilon: f64) -> Model {
    let circle_action = CircleAction::new([1]);
    let shape = GyroceptronShape { circle_action, psi: vec![4; 2], near_identity: vec![3; 2] };
    let weights = InitialWeights::Normal { scale: 0.8 };
    shape.architecture(epsilon).initialise(weights, 2.4, 5).expect("valid")
}

/// A part of a built-in scene.
pub fn part(scene: &str, name: &str) -> Scene {
    let scene = find(scene).expect("built in").scene().expect("a scene");
    scene.parts.into_iter().find(|part| part.name == name).expect("a part")
}
