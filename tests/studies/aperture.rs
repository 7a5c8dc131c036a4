//! Dynamic apertures of maps that have learnt Hénon's map of two degrees of freedom, a sextupole in a ring.

use crate::frequency_map::{Ring, SCENE};
use crate::helpers::{refused, run_in, temporary};
use gyroceptron::flow::Pairs;
use gyroceptron::io::{read_pairs, write_pairs};
use gyroceptron::scene::{parse, render};
use serde_json::Value;
use std::f64::consts::PI;
use std::path::Path;

const APERTURE: &str = "[aperture]
reach = [0.6, 0.6]
rays = 9
points = 30
counts = [20, 500]
symplectic_polynomials = [2, 5]
";
const POINTS: usize = 30;
const RING: Ring = Ring { strength: 1.5, turns: [0.2113, 0.3179] };

/// The scene with this study in place of the frequency map.
fn scene(aperture: &str, pairs: &Path) -> String {
    let (head, _) = SCENE.split_once("[frequency_map]").expect("a frequency map");
    let head = head.replace("plots = [\"frequency-map\"]", "plots = [\"aperture\"]");
    format!("{}{aperture}", head.replace("PAIRS", &pairs.display().to_string()))
}

/// The share of each ray up to which all points stay for so many maps by Hénon's map itself, within twice the box of
/// its pairs.
fn of_the_map(pairs: &Pairs, maps: usize) -> Vec<f64> {
    let all = || pairs.input().chunks_exact(4).chain(pairs.output().chunks_exact(4));
    let box_of: Vec<[f64; 2]> = (0..4)
        .map(|k| {
            let of = || all().map(|z| z[k]);
            // no NaN: pairs are finite
            let (low, high) = (of().fold(f64::MAX, f64::min), of().fold(f64::MIN, f64::max));
            [0.5 * (low + high), high - low]
        })
        .collect();
    let stays =
        |z: &[f64]| z.iter().zip(&box_of).all(|(v, [middle, reach])| (v - middle).abs() <= *reach);
    let of_ray = |ray: usize| {
        let (sin, cos) = (PI * ray as f64 / 8.0).sin_cos();
        let survives = |point: &usize| {
            let share = 0.6 * (point + 1) as f64 / POINTS as f64;
            let mut z = [share * cos, share * sin, 0.0, 0.0];
            (0..maps).all(|_| {
                RING.forward(&mut z);
                stays(&z)
            })
        };
        (0..POINTS).take_while(survives).count() as f64 / POINTS as f64
    };
    (0..9).map(of_ray).collect()
}

fn shares(of: &Value, count: usize) -> Vec<f64> {
    let all = of["apertures"][count].as_array().expect("rays");
    all.iter().map(|share| share.as_f64().expect("a share")).collect()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum()
}

#[test]
fn apertures_of_learnt_maps_are_those_of_the_map() {
    let folder = temporary();
    let file = folder.path().join("pairs.npz");
    RING.write(&file);
    let pairs = read_pairs(&file).expect("pairs").pairs;
    let (early, late) = (of_the_map(&pairs, 20), of_the_map(&pairs, 500));
    // Part of each ray, and less of some with more maps.
    assert!(late.iter().all(|share| *share > 0.0 && *share < 1.0), "{late:?}");
    assert!(distance(&early, &late) > 10.0 / POINTS as f64, "{early:?} {late:?}");

    let scene = parse("ring", &scene(APERTURE, &file)).expect("a scene");
    assert!(scene.citations().iter().any(|entry| entry.contains("TodescoGiovannozzi1996")));
    let out = folder.path().join("out");
    let data = render::json(&run_in(&out, &scene));
    let found = data["studies"]["aperture"].as_array().expect("maps");
    let names: Vec<&str> = found.iter().filter_map(|of| of["name"].as_str()).collect();
    let polynomials = ["symplectic polynomial of degree 2", "symplectic polynomial of degree 5"];
    assert_eq!(names, ["jolts", polynomials[0], polynomials[1]]);
    // A point more or less on each ray, of the better maps.
    for of in [&found[0], &found[2]] {
        for (count, own) in [(0, &early), (1, &late)] {
            let apart = distance(&shares(of, count), own);
            assert!(
                apart <= 9.0 / POINTS as f64,
                "{}: {:?} {own:?}",
                of["name"],
                shares(of, count)
            );
        }
    }
    let [coarse, fine] = [1, 2].map(|number| distance(&shares(&found[number], 1), &late));
    assert!(coarse > fine, "{coarse} {fine}");
    // The apertures are those of the survival of the points.
    for of in found {
        for (count, maps) in [(0, 20), (1, 500)] {
            for (ray, share) in shares(of, count).into_iter().enumerate() {
                let lost = of["lost_after"][ray].as_array().expect("points");
                let stays = |lost: &&Value| lost.as_u64().is_none_or(|after| after > maps);
                let stay = lost.iter().take_while(stays).count();
                assert_eq!(share, stay as f64 / POINTS as f64);
            }
        }
    }
    let text = std::fs::read_to_string(out.join("report.md")).expect("a report");
    for words in
        ["Dynamic aperture", "after 500 maps: mean share of a ray", "9 rays from", "| 22.5° |"]
    {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert!(out.join("aperture.svg").exists());
}

/// Pairs in other units, about another point, have the same apertures there; and a ray that begins outside is lost at
/// once.
#[test]
fn apertures_are_in_the_units_of_the_data() {
    let folder = temporary();
    let file = folder.path().join("pairs.npz");
    RING.write(&file);
    let pairs = read_pairs(&file).expect("pairs").pairs;
    let moved = |points: &[f64]| -> Vec<f64> {
        let shift = [0.02, -0.01, 0.03, 0.0];
        points.iter().zip(shift.iter().cycle()).map(|(v, c)| 1e-3 * v + c).collect()
    };
    let (input, output) = (moved(pairs.input()), moved(pairs.output()));
    let small = Pairs::new("pairs", 2, input, output).expect("finite");
    write_pairs(&folder.path().join("small.npz"), &small).expect("written");
    let aperture = APERTURE.replace("[2, 5]", "[5]");
    let of_small =
        aperture.replace("[0.6, 0.6]", "[0.6e-3, 0.6e-3]\ncentre = [0.02, -0.01, 0.03, 0.0]");
    let run = |name: &str, aperture: &str, pairs: &Path| {
        let scene = parse("ring", &scene(aperture, pairs)).expect("a scene");
        render::json(&run_in(&folder.path().join(name), &scene))["studies"]["aperture"].clone()
    };
    let own = run("out", &aperture, &file);
    let of_small = run("out-small", &of_small, &folder.path().join("small.npz"));
    // A network of other units is another network.
    let [a, b] = [&own, &of_small].map(|of| shares(&of[0], 1));
    assert!(b.iter().all(|share| *share > 0.2 && *share < 1.0), "{a:?} {b:?}");
    let [a, b] = [&own, &of_small].map(|of| shares(&of[1], 1));
    assert!(distance(&a, &b) <= 1.01 / POINTS as f64, "{a:?} {b:?}");
    let outside = aperture.replace("rays = 9", "rays = 9\ncentre = [3.0, 0.0, 0.0, 0.0]");
    let outside = run("out-outside", &outside, &file);
    assert_eq!(outside[0]["lost_after"][0][0], 0);
    assert_eq!(shares(&outside[0], 0), [0.0; 9]);
}

/// The sextupole has the mirror symmetry of plane 2. With that of plane 1, which it does not have, the polynomial finds
/// no images, and the report says so.
#[test]
fn the_mirror_of_the_midplane_is_one_of_the_ring() {
    let folder = temporary();
    let file = folder.path().join("pairs.npz");
    RING.write(&file);
    let late = of_the_map(&read_pairs(&file).expect("pairs").pairs, 500);
    let mirrored = |plane: usize| {
        let mirrored = APERTURE.replace("[2, 5]", &format!("[5]\nmirrored = [{plane}]"));
        let scene = scene(&mirrored, &file).replace("iterations = 60", "iterations = 1");
        let out = folder.path().join(format!("out-{plane}"));
        let data = render::json(&run_in(&out, &parse("ring", &scene).expect("a scene")));
        let text = std::fs::read_to_string(out.join("report.md")).expect("a report");
        (data["studies"]["aperture"].clone(), text)
    };
    let (found, text) = mirrored(2);
    assert!(distance(&shares(&found[1], 1), &late) <= 9.0 / POINTS as f64, "{found}");
    assert!(!text.contains("left out"), "{text}");
    let (found, text) = mirrored(1);
    assert!(found.as_array().is_some_and(|all| all.len() == 1), "{found}");
    assert!(text.contains("symplectic polynomial of degree 5 is left out"), "{text}");
}

#[test]
fn apertures_that_cannot_be_are_refused() {
    let with = |from: &str, to: &str, words: &[&str]| {
        assert!(APERTURE.contains(from), "{from}");
        let scene = scene(&APERTURE.replace(from, to), Path::new("pairs.npz"));
        refused(&scene, &[&["aperture"], words].concat());
    };
    with("reach = [0.6, 0.6]", "reach = [0.6, 0.0]", &["reach", "above 0"]);
    with("reach = [0.6, 0.6]", "reach = [0.6, nan]", &["reach"]);
    with("rays = 9", "rays = 1", &["rays", "2"]);
    with("points = 30", "points = 0", &["points"]);
    with("points = 30", "points = 20000", &["rays × points", "180000"]);
    with("counts = [20, 500]", "counts = []", &["counts"]);
    with("counts = [20, 500]", "counts = [20, 20]", &["counts", "20 after 20", "grow"]);
    with("counts = [20, 500]", "counts = [0]", &["counts"]);
    with("[2, 5]", "[1]", &["symplectic_polynomials", "1"]);
    with("[2, 5]", "[3]\nmirrored = [3]", &["mirrored plane", "3"]);
    with("rays = 9", "rays = 9\nalong = [1, 1]", &["along"]);
    with("rays = 9", "rays = 9\ncentre = [0.0, inf, 0.0, 0.0]", &["centre"]);
}
