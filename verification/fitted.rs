//! Symplectic polynomials, whose coefficients are fitted: whatever the pairs, every law of a symplectic map, and the
//! symmetries that were asked for.

use crate::compositions::named;
use crate::mutants::Fault;
use crate::suite;
use crate::watched::watched;
use gyroceptron::Error;
use gyroceptron::flow::{Pairs, Symmetries, SymplecticPolynomial};
use gyroceptron::layer::Reversor;
use gyroceptron::measure::{
    Measurable,
    certificate::{PolynomialAndInverse, Row, Tally, merged, polynomial_laws},
    steps::{MeasuredSteps, TrackedStep},
};
use gyroceptron::network::Rollout;
use gyroceptron::phase::{Direction, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Elementary, Over, Scalar, max_or_nan};
use proptest::prelude::*;
use proptest::sample::select;
use std::sync::OnceLock;

pub const STATED: usize = 140;
/// Two thirds of them have a reversor, and two thirds a mirror; each has eight samples of a law.
const CASES: usize = 50;
const SAMPLES: usize = 8;
/// At most so many fits for a case.
const TURNS: u64 = 2;
const NAME: &str = " of symplectic polynomials";

#[derive(Clone, Debug)]
struct Case {
    dof: usize,
    degree: usize,
    reversor: Option<Reversor>,
    mirrored: Vec<usize>,
    /// The share of the kick in the map of the pairs, which has none of the symmetries.
    kick: f64,
    /// Noise on the images, which no symplectic map has.
    noise: f64,
    seed: u64,
}

impl Case {
    fn symmetries(&self) -> Symmetries {
        Symmetries { reversor: self.reversor, mirrored: self.mirrored.clone() }
    }

    /// Turns and kicks of the momenta by cubic polynomials of the positions, and noise; others with each `turn`.
    fn pairs(&self, turn: u64) -> Pairs {
        let (dof, count) = (self.dof, 40 * 3usize.pow(self.dof as u32 - 1) * self.degree);
        let mut stream = Stream::new(self.seed, &format!("pairs {turn}"));
        let angles: Vec<f64> = (0..dof).map(|_| stream.uniform(0.3, 1.4)).collect();
        let linear: Vec<f64> = (0..2 * dof).map(|_| stream.uniform(-1.0, 1.0)).collect();
        let input: Vec<f64> = (0..2 * dof * count).map(|_| stream.uniform(-1.0, 1.0)).collect();
        let mut output = input.clone();
        for z in output.chunks_exact_mut(2 * dof) {
            // V = kick/3 (a·q)³ + kick b·q: its gradient is a multiple of a, and b.
            let along: f64 = (0..dof).map(|j| linear[j] * z[j]).sum();
            for j in 0..dof {
                z[dof + j] -= self.kick * (along * along * linear[j] + linear[dof + j]);
                let (s, c) = Elementary::sin_cos(angles[j]);
                (z[j], z[dof + j]) = (c * z[j] + s * z[dof + j], c * z[dof + j] - s * z[j]);
            }
            z.iter_mut().for_each(|v| *v += self.noise * stream.uniform(-1.0, 1.0));
        }
        Pairs::new("pairs", dof, input, output).expect("pairs")
    }

    /// Pairs of maps that are far from all with the symmetries, and for which the equation has no solution, are refused
    /// by a fit, and drawn anew: never in [`TURNS`] turns.
    fn map(&self) -> SymplecticPolynomial {
        let fitted = |turn| {
            let pairs = self.pairs(turn);
            match SymplecticPolynomial::fit_symmetric(&pairs, self.degree, &self.symmetries()) {
                Ok(map) => Some(map),
                Err(Error::NoConvergence { .. }) => None,
                Err(other) => panic!("{other}"),
            }
        };
        (0..TURNS).find_map(fitted).expect("pairs that a polynomial fits")
    }

    /// Points of the box of the inputs of the pairs, and their images.
    fn points(&self, map: &SymplecticPolynomial) -> [Vec<f64>; 2] {
        let starts = map.sample(SAMPLES, &mut Stream::new(self.seed, "samples")).expect("points");
        let moved = map.rollout(&starts, Rollout { steps: 1, every: 1 }).expect("whole points");
        let ends = moved[starts.len()..].to_vec();
        [starts, ends]
    }
}

fn cases() -> impl Strategy<Value = Case> {
    let [one, other] = Reversor::ALL.map(Some);
    let reversors = vec![None, one, other];
    let mirrors = prop_oneof![Just(Vec::new()), Just(vec![0_usize]), Just(vec![1])];
    let noise = select(vec![0.0, 1e-6, 1e-2]);
    let sizes = select(vec![(1, 3), (1, 6), (1, 9), (2, 3), (2, 5), (3, 3)]);
    (sizes, select(reversors), mirrors, 0.0..0.03, noise, any::<u32>()).prop_map(
        |((dof, degree), reversor, mirrored, kick, noise, seed)| Case {
            dof,
            degree,
            reversor,
            mirrored: mirrored.into_iter().map(|plane| plane.min(dof - 1) + 1).collect(),
            kick,
            noise,
            seed: u64::from(seed),
        },
    )
}

fn measure(case: &Case) -> Vec<Tally> {
    let map = case.map();
    let [starts, ends] = case.points(&map);
    let both = PolynomialAndInverse::new(map);
    let back = both.clone().exchanged();
    let there = watched("fitted", &both);
    polynomial_laws(&there, &back, &case.symmetries(), [&starts, &ends])
}

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| named(suite::run("fitted", CASES, cases(), measure), NAME))
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}

/// A polynomial and its inverse with a fault.
struct Broken {
    fault: Fault,
    sound: PolynomialAndInverse,
}

impl Broken {
    /// What is left of the last momentum after a step.
    fn share(&self) -> f64 {
        if self.fault == Fault::FittedFriction { 1.0 - 1e-11 } else { 1.0 }
    }
}

impl<S: Scalar + Over<f64>> Map<S> for Broken {
    fn dof(&self) -> usize {
        Map::<S>::dof(&self.sound)
    }
    fn forward(&self, z: &mut [S]) {
        self.sound.forward(z);
        let last = z.len() - 1;
        z[last] = z[last].times(self.share());
    }
    fn inverse(&self, z: &mut [S]) {
        self.sound.inverse(z);
    }
}

impl Measurable for Broken {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        vec![Box::new(TrackedStep { map: self, direction })]
    }
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        self.sound.move_points(direction, points);
        let dim = 2 * Map::<f64>::dof(self);
        for z in points.chunks_exact_mut(dim) {
            z[dim - 1] *= self.share();
            if self.fault == Fault::FittedBatch {
                z[0] = z[0].next_up();
            }
        }
    }
}

/// All laws of fitted polynomials on some with this fault.
pub fn rows_of_mutant(fault: Fault) -> Vec<Row> {
    let (reversor, mirrored) = (Some(Reversor::Momenta), vec![1]);
    let tallies = [(1, 8), (2, 4)].into_iter().zip(1..).flat_map(|((dof, degree), seed)| {
        let (kick, noise) = (0.03, 1e-6);
        let sound = Case { dof, degree, reversor, mirrored: mirrored.clone(), kick, noise, seed };
        // Fitted without the symmetries that are claimed.
        let plain = Case { reversor: None, mirrored: Vec::new(), ..sound.clone() };
        let map = if fault == Fault::FittedClaims { plain.map() } else { sound.map() };
        let inverse = match fault {
            Fault::FittedInverse => Case { noise: 2e-6, ..sound.clone() }.map().inverted(),
            _ => map.inverted(),
        };
        let [starts, ends] = sound.points(&map);
        let both = PolynomialAndInverse::claimed(map, inverse);
        let back = Broken { fault, sound: both.clone().exchanged() };
        let there = Broken { fault, sound: both };
        polynomial_laws(&there, &back, &sound.symmetries(), [&starts, &ends])
    });
    named(merged(tallies).iter().map(Tally::row).collect(), NAME)
}

/// What is not wrong is not rejected, by the same machinery.
#[test]
fn sound_ones_are_not_rejected() {
    let rows = rows_of_mutant(Fault::GridRotation);
    assert!(rows.len() >= 7, "{}", rows.len());
    for row in &rows {
        assert!(row.largest.is_some_and(|largest| largest < row.limit), "{row:?}");
    }
    let ratios = rows.iter().filter_map(|row| row.largest).fold(0.0, max_or_nan);
    assert!(ratios > 0.0);
}
