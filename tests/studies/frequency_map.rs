//! Frequency maps of networks that have learnt Hénon's map of two degrees of freedom, a sextupole in a ring.

use crate::helpers::{refused, run_in, temporary};
use gyroceptron::flow::{Pairs, Trajectories};
use gyroceptron::io::write_pairs;
use gyroceptron::measure::orbits::tunes;
use gyroceptron::random::Stream;
use gyroceptron::scalar::max_or_nan;
use gyroceptron::scene::{parse, render};
use serde_json::Value;
use std::f64::consts::TAU;
use std::path::Path;

pub const SCENE: &str = r#"
name = "ring"
seed = 1
flow_time = 1.0
plots = ["frequency-map"]

[data]
pairs = "PAIRS"
circle_action = [1, 1]
epsilon = 1.0
validation = 0.2

[[models]]
name = "jolts"
network = { kind = "normal-form", kicks = { count = 4, width = 2, degree = 4 }, twists = { count = 1, width = 4, degree = 3 }, perturbation = { count = 4, width = 2, degree = 4 }, action = [[1, 0], [0, 1]] }
weights = { kind = "normal", scale = 0.05 }

[training]
iterations = 60
loss = { kind = "mean-squared-error" }
optimiser = { kind = "levenberg-marquardt" }
starts = { count = 1, iterations = 40 }

[frequency_map]
low = [0.02, 0.03]
high = [0.5, 0.45]
points = [7, 6]
maps = 512
order = 5
"#;

/// A sextupole of this strength, and turns of both planes.
pub struct Ring {
    pub strength: f64,
    pub turns: [f64; 2],
}

impl Ring {
    pub fn forward(&self, z: &mut [f64]) {
        let (x, y) = (z[0], z[1]);
        z[2] += self.strength * (y * y - x * x);
        z[3] += 2.0 * self.strength * x * y;
        for (plane, turns) in self.turns.into_iter().enumerate() {
            let (sin, cos) = (TAU * turns).sin_cos();
            let (q, p) = (z[plane], z[2 + plane]);
            (z[plane], z[2 + plane]) = (cos * q + sin * p, cos * p - sin * q);
        }
    }

    pub fn write(&self, path: &Path) {
        let mut stream = Stream::new(1, "points");
        let input: Vec<f64> = (0..4 * 500).map(|_| stream.uniform(-0.5, 0.5)).collect();
        let mut output = input.clone();
        output.chunks_exact_mut(4).for_each(|z| self.forward(z));
        let pairs = Pairs::new("pairs", 2, input, output).expect("finite");
        write_pairs(path, &pairs).expect("written");
    }

    /// The tunes of an orbit.
    fn tunes(&self, start: [f64; 2], maps: usize) -> Vec<f64> {
        let mut z = vec![start[0], start[1], 0.0, 0.0];
        let mut states = z.clone();
        for _ in 0..maps {
            self.forward(&mut z);
            states.extend_from_slice(&z);
        }
        tunes(&Trajectories::new(states, 4, 1).expect("an orbit"))[0].turns.clone()
    }
}

fn orbits(report: &Value) -> &Vec<Value> {
    report["studies"]["frequency_map"][0]["orbits"].as_array().expect("orbits")
}

fn two(value: &Value) -> [f64; 2] {
    [0, 1].map(|k| value[k].as_f64().expect("a number"))
}

#[test]
fn tunes_of_a_learnt_map_are_those_of_the_map() {
    let folder = temporary();
    let ring = Ring { strength: 0.15, turns: [0.2113, 0.3179] };
    let file = folder.path().join("pairs.npz");
    ring.write(&file);
    let scene = SCENE.replace("PAIRS", &file.display().to_string());
    let scene = parse("ring", &scene).expect("a scene");
    assert!(scene.citations().iter().any(|entry| entry.contains("Laskar1990")));
    let out = folder.path().join("out");
    let report = run_in(&out, &scene);
    let data = render::json(&report);
    let orbits = orbits(&data);
    assert_eq!(orbits.len(), 42);
    let (mut apart, mut by_twists, mut shift) = (Vec::new(), Vec::new(), 0.0_f64);
    for orbit in orbits.iter().filter(|orbit| orbit["lost_after"].is_null()) {
        let (found, start) = (two(&orbit["tunes"]), two(&orbit["start"]));
        let exact = ring.tunes(start, 512);
        apart.push(max_or_nan((found[0] - exact[0]).abs(), (found[1] - exact[1]).abs()));
        let twists = two(&orbit["by_twists"]);
        by_twists.push(max_or_nan((found[0] - twists[0]).abs(), (found[1] - twists[1]).abs()));
        shift = max_or_nan(shift, (found[0] - ring.turns[0]).abs());
        assert!(orbit["change"].as_f64().expect("a change") < 1e-3, "{orbit}");
    }
    let median = |mut all: Vec<f64>| {
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    assert!(apart.len() > 30, "{} are not lost", apart.len());
    let (apart, by_twists) = (median(apart), median(by_twists));
    // Tunes shift with the amplitude by far more than those of orbits err. The perturbation has its share of that.
    assert!(shift > 1e-4 && apart < 1e-3 * shift, "{shift} {apart}");
    assert!(by_twists > 0.0 && by_twists < shift, "{shift} {by_twists}");
    // The first starts near the fixed point, whose tunes are those of the turns.
    let near = two(&orbits[0]["tunes"]);
    assert!((near[0] - 0.2113).abs() < 1e-4 && (near[1] - 0.3179).abs() < 1e-4, "{near:?}");
    let text = std::fs::read_to_string(out.join("report.md")).expect("a report");
    for words in
        ["frequency-map", "tunes change by", "its twists alone", "7 × 6 orbits of 512 maps"]
    {
        assert!(text.contains(words), "{words}: {text}");
    }
}

/// Of a map that is linear, each orbit has the tunes of the turns, and a resonance of these holds all.
#[test]
fn a_resonance_holds_the_orbits_that_are_on_it() {
    let folder = temporary();
    let file = folder.path().join("pairs.npz");
    Ring { strength: 0.0, turns: [0.2, 0.3179] }.write(&file);
    let scene = SCENE.replace("PAIRS", &file.display().to_string());
    let report = run_in(&folder.path().join("out"), &parse("ring", &scene).expect("a scene"));
    let text = std::fs::read_to_string(folder.path().join("out/report.md")).expect("a report");
    // Of three on either side one plane moves by less than a tenth of the other.
    assert!(text.contains(": 5ν₁ (36 orbits)."), "{text}");
    for orbit in orbits(&render::json(&report)) {
        let (found, twists) = (two(&orbit["tunes"]), two(&orbit["by_twists"]));
        assert!((found[0] - twists[0]).abs() < 1e-12 && (found[1] - twists[1]).abs() < 1e-12);
        assert!((found[0] - 0.2).abs() < 1e-8 && (found[1] - 0.3179).abs() < 1e-8, "{orbit}");
        assert!(orbit["change"].as_f64().expect("a change") < 1e-8, "{orbit}");
    }
}

/// Of orbits that leave the box of the pairs it is said after how many maps, and they have no tunes.
#[test]
fn orbits_that_leave_the_pairs_are_lost() {
    let folder = temporary();
    let ring = Ring { strength: 0.9, turns: [0.2113, 0.3179] };
    let file = folder.path().join("pairs.npz");
    ring.write(&file);
    let scene = SCENE.replace("PAIRS", &file.display().to_string());
    let report = run_in(&folder.path().join("out"), &parse("ring", &scene).expect("a scene"));
    let data = render::json(&report);
    let ([mut lost, mut kept], mut largest) = ([0, 0], 0.0_f64);
    for orbit in orbits(&data) {
        let start = two(&orbit["start"]);
        let mut z = [start[0], start[1], 0.0, 0.0];
        // Whether the map itself loses it: far beyond the pairs.
        let leaves = (0..512).any(|_| {
            ring.forward(&mut z);
            !(z.iter().all(|value| value.abs() < 4.0))
        });
        match orbit["lost_after"].as_u64() {
            Some(maps) => {
                lost += 1;
                assert!(
                    maps > 0 && orbit["tunes"][0].is_null() && orbit["change"].is_null(),
                    "{orbit}"
                );
            }
            None => {
                kept += 1;
                largest = max_or_nan(largest, orbit["change"].as_f64().expect("a change"));
                assert!(!leaves && orbit["tunes"][0].is_number(), "{orbit}");
            }
        }
    }
    // Next to what is lost tunes change.
    assert!(lost > 3 && kept > 3 && largest > 1e-5, "{lost} {kept} {largest}");
}

#[test]
fn frequency_maps_that_cannot_be_are_refused() {
    let with = |from: &str, to: &str, words: &[&str]| {
        assert!(SCENE.contains(from), "{from}");
        refused(&SCENE.replace(from, to), &[&["frequency_map"], words].concat());
    };
    with("maps = 512", "maps = 100", &["maps", "512"]);
    with("maps = 512", "maps = 2000000", &["maps", "1048576"]);
    with("points = [7, 6]", "points = [7, 1]", &["points"]);
    with("low = [0.02, 0.03]", "low = [0.02, 0.5]", &["low and high", "0.5"]);
    with("order = 5", "order = 0", &["order"]);
    with("order = 5", "along = [1, 1]", &["along"]);
    with("order = 5", "along = [0, 4]", &["along"]);
    with("order = 5", "centre = [0.0, 0.0, inf, 0.0]", &["centre"]);
    let one = "[system]\nkind = \"field-lines\"\nepsilon = 1e-3\n[data]\nvalidation = 0.2\n\
               windows = [{ low = [-1.0, -1.0], high = [1.0, 1.0], samples = 20 }]\n";
    let (head, rest) = SCENE.split_once("[data]").expect("data");
    let (_, rest) = rest.split_once("[[models]]").expect("a model");
    let scene = format!("{}{one}[[models]]{rest}", head.replace("1.0", "6.283185307179586"))
        .replace(", action = [[1, 0], [0, 1]]", "")
        .replace("width = 2", "width = 1")
        .replace("width = 4", "width = 1");
    refused(&scene, &["frequency_map", "1 degrees of freedom", "two"]);
}
