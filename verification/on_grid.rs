//! Maps on a grid of integers and of floats, whose increments are rounded: exact bijections, whatever
//! the weights, near the map of plain numbers.

use crate::mutants::Fault;
use crate::{suite, tolerances};
use gyroceptron::layer::{Activation, CircleAction, Reversor, TorusAction, TurnFraction};
use gyroceptron::measure::{
    GridMap, GridMove,
    certificate::{Row, Tally, Verdict, merged},
    laws,
    ratios::Conditioned,
};
use gyroceptron::network::{
    Architecture, Composition, GyroceptronShape, HenonShape, InitialWeights,
    KickedGyroceptronShape, Model, SympNetShape,
};
use gyroceptron::phase::{Direction, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{
    Elementary, Grid, GridNumbers, GridPlace, Integers, OnGrid, Over, Real, Scalar, Tracked,
    max_or_nan,
};
use proptest::prelude::*;
use proptest::sample::select;
use std::collections::HashSet;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};
use std::sync::OnceLock;

pub const STATED: usize = 120;
/// Each has two points, and two in five have circles.
const CASES: usize = 200;
const BITS: u32 = 44;

/// Every kind of step that is a shear.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    HenonNet,
    Gyroceptron,
    TurnedKicks,
    SympNet,
    Reversible,
}

const KINDS: [Kind; 5] =
    [Kind::HenonNet, Kind::Gyroceptron, Kind::TurnedKicks, Kind::SympNet, Kind::Reversible];

#[derive(Clone, Debug)]
struct Case {
    kind: Kind,
    dof: usize,
    scale: f64,
    epsilon: f64,
    radius: f64,
    seed: u64,
}

impl Case {
    fn circle(&self) -> CircleAction {
        CircleAction::new((0..self.dof as i32).map(|j| 1 - 3 * j).collect::<Vec<_>>())
    }

    fn architecture(&self) -> Architecture {
        let Self { kind, dof, epsilon, .. } = *self;
        let (circle_action, psi) = (self.circle(), vec![3, 2]);
        let (modules, shears, activation, plain) = (2, 2, Activation::Sigmoid, false);
        match kind {
            Kind::HenonNet => HenonShape { dof, widths: psi }.architecture(epsilon),
            Kind::Gyroceptron => GyroceptronShape { circle_action, psi, near_identity: vec![3] }
                .architecture(epsilon),
            Kind::TurnedKicks => KickedGyroceptronShape { circle_action, psi, kicks: vec![3, 2] }
                .architecture(epsilon),
            Kind::SympNet => {
                SympNetShape { dof, modules, shears, activation, plain }.architecture()
            }
            Kind::Reversible => HenonShape { dof, widths: psi }
                .architecture(1.0)
                .reversible(Some(Reversor::Momenta)),
        }
    }

    fn network(&self) -> Model {
        let weights = InitialWeights::Normal { scale: self.scale };
        self.architecture().initialise(weights, 0.7, self.seed).expect("a sound shape")
    }

    fn points(&self, count: usize) -> Vec<f64> {
        let mut stream = Stream::new(self.seed, "points");
        (0..2 * self.dof * count).map(|_| stream.uniform(-self.radius, self.radius)).collect()
    }
}

fn cases() -> impl Strategy<Value = Case> {
    let (scales, epsilons) = (vec![0.1, 0.3, 1.0, 10.0], vec![1e-3, 0.1, 1.0]);
    let numbers = (select(scales), select(epsilons), select(vec![0.1, 1.6, 60.0]));
    (select(KINDS.to_vec()), 1..4_usize, numbers, any::<u64>()).prop_map(
        |(kind, dof, (scale, epsilon, radius), seed)| Case {
            kind,
            dof,
            scale,
            epsilon,
            radius,
            seed,
        },
    )
}

/// The places of the next points of a grid of integers; and how many of them a map changes.
fn quantised(points: &[f64]) -> (Grid, Vec<i64>) {
    let grid = Grid::new(BITS, GridNumbers::Integers).expect("a grid");
    (grid, grid.quantise(points).expect("small numbers"))
}

fn moved(map: &dyn GridMap, grid: Grid, start: &[i64]) -> Vec<i64> {
    let mut places = start.to_vec();
    assert_eq!(map.move_places(Direction::Forward, grid, &mut places), GridMove::Moved);
    places
}

fn differing(a: &[i64], b: &[i64]) -> f64 {
    a.iter().zip(b).filter(|(a, b)| a != b).count() as f64
}

/// A rotation whose results are rounded, and not its increments.
struct RoundedRotation(TurnFraction);

impl Map<f64> for RoundedRotation {
    fn dof(&self) -> usize {
        1
    }
    fn forward(&self, z: &mut [f64]) {
        let (sin, cos) = Elementary::sin_cos(self.0.radians());
        (z[0], z[1]) = (cos * z[0] + sin * z[1], cos * z[1] - sin * z[0]);
    }
    fn inverse(&self, z: &mut [f64]) {
        Self(-self.0).forward(z);
    }
}

impl GridMap for RoundedRotation {
    fn move_places(&self, direction: Direction, grid: Grid, places: &mut [i64]) -> GridMove {
        let mut z: Vec<f64> = places.iter().map(|&place| grid.value(place)).collect();
        self.run(direction, &mut z);
        places.copy_from_slice(&grid.quantise(&z).expect("a rotation"));
        GridMove::Moved
    }
}

/// What a circle action is on a grid, by the turn that `turn` makes.
fn circle_action(
    turn: &dyn Fn(TurnFraction) -> Box<dyn GridMap>,
    points: &[f64],
    dim: usize,
    seed: u64,
) -> Tally {
    let mut stream = Stream::new(seed, "fractions");
    let quarter = TurnFraction::of_turn(1, 4);
    let count = |z: &[f64]| {
        let angle = TurnFraction::of_radians(stream.uniform(-4.0, 4.0));
        let (grid, start) = quantised(z);
        let words = [vec![TurnFraction::default()], vec![angle, -angle], vec![quarter; 4]];
        let end = |word: &Vec<TurnFraction>| {
            word.iter().fold(start.clone(), |here, &angle| moved(&*turn(angle), grid, &here))
        };
        Conditioned::Ratio(words.iter().map(|word| differing(&start, &end(word))).sum())
    };
    let counts: Vec<_> = points.chunks_exact(dim).map(count).collect();
    let equation = "Φ₀ = Φ_{−θ}∘Φ_θ = Φ_{π/2}⁴ = Id, bitwise";
    Tally::of_counts("circle action on a grid", equation).extend_at(points, dim, counts)
}

/// P₀³ = ψ∘Φ_θ³∘ψ⁻¹ of a gyroceptron at ε = 0.
fn conjugated(model: &Model, points: &[f64], dim: usize) -> Tally {
    let psi = model.psi();
    let (back, circles) = (psi.inverted(), model.architecture().action().expect("circles"));
    let turn = Composition::of_turn(&circles, model.angles().to_vec()).expect("an angle a circle");
    let count = |z: &[f64]| {
        let (grid, start) = quantised(z);
        let after = |maps: &[&dyn GridMap]| {
            maps.iter().fold(start.clone(), |here, map| moved(*map, grid, &here))
        };
        let once = after(&[&back, &turn, &turn, &turn, &psi]);
        Conditioned::Ratio(differing(&after(&[model, model, model]), &once))
    };
    let counts: Vec<_> = points.chunks_exact(dim).map(count).collect();
    let law = "near periodicity on a grid";
    Tally::of_counts(law, "P₀³ = ψ∘Φ_θ³∘ψ⁻¹, bitwise").extend_at(points, dim, counts)
}

/// A number whose increments are off by half the spacing of the grid beside their rounding.
#[derive(Clone, Copy, Debug)]
struct Coarse(Tracked);

macro_rules! coarse {
    ($($trait:ident, $method:ident, $assign:ident, $assigned:ident;)*) => {
        $(impl $trait for Coarse {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }
        impl $assign for Coarse {
            fn $assigned(&mut self, other: Self) {
                *self = self.$method(other);
            }
        })*
    };
}
coarse! {
    Add, add, AddAssign, add_assign; Sub, sub, SubAssign, sub_assign;
    Mul, mul, MulAssign, mul_assign; Div, div, DivAssign, div_assign;
}

impl Neg for Coarse {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Scalar for Coarse {
    fn from_f64(value: f64) -> Self {
        Self(Tracked::exact(value))
    }
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self(self.0.mul_add(a.0, b.0))
    }
    fn tanh_sech2(self) -> (Self, Self) {
        let (t, s) = self.0.tanh_sech2();
        (Self(t), Self(s))
    }
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    fn is_zero(self) -> bool {
        self.0.is_zero()
    }
    fn unit_roundoff() -> f64 {
        f64::unit_roundoff()
    }
}

impl Elementary for Coarse {
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.0.sin_cos();
        (Self(s), Self(c))
    }
    fn exp(self) -> Self {
        Self(self.0.exp())
    }
    fn zero_with(self, factor: Self) -> Self {
        Self(self.0.zero_with(factor.0))
    }
    fn sign(self) -> Self {
        Self(self.0.sign())
    }
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    fn ln(self) -> Self {
        Self(self.0.ln())
    }
    fn powf(self, exponent: f64) -> Self {
        Self(self.0.powf(exponent))
    }
    fn atan2(self, x: Self) -> Self {
        Self(self.0.atan2(x.0))
    }
    fn rem_euclid(self, period: f64) -> Self {
        Self(self.0.rem_euclid(period))
    }
}

impl Over<f64> for Coarse {
    fn embed(parameter: f64) -> Self {
        Self::from_f64(parameter)
    }
    fn mul_add_parameter(self, parameter: f64, addend: Self) -> Self {
        Self(self.0.mul_add_parameter(parameter, addend.0))
    }
    fn increment(self, factor: f64, direction: Self) -> Self {
        let product = direction.0 * Tracked::exact(factor);
        let grid = Grid::new(BITS, GridNumbers::Integers).expect("a grid");
        let sum = (self.0 + product).value;
        // Where it wraps no bound is left.
        let wraps = sum.abs() > grid.limit();
        let own = if wraps { f64::INFINITY } else { grid.rounding() / f64::unit_roundoff() };
        Self(Tracked { value: sum, bound: self.0.bound + product.bound + own })
    }
}

/// |P on the grid − P| over the sum of what both may be off by to first order: every increment by its
/// rounding errors, and on the grid by half its spacing.
fn distance(map: &dyn GridMap, model: &Model, points: &[f64]) -> Tally {
    let dim = 2 * model.architecture().dof;
    let ratio = |z: &[f64]| {
        let (grid, start) = quantised(z);
        let from: Vec<f64> = start.iter().map(|&place| grid.value(place)).collect();
        let mut plain: Vec<Tracked> = from.iter().map(|&value| Tracked::exact(value)).collect();
        model.forward(&mut plain);
        let mut coarse: Vec<Coarse> = from.iter().map(|&value| Coarse::from_f64(value)).collect();
        model.forward(&mut coarse);
        let end = moved(map, grid, &start);
        let ratios = end.iter().zip(plain.iter().zip(&coarse)).map(|(&place, (plain, coarse))| {
            let bound = plain.error() + coarse.0.error();
            // Far beyond small numbers a bound to first order is none.
            let linear = bound < tolerances::GRID_LINEAR;
            linear.then(|| (grid.value(place) - plain.value()).abs() / bound)
        });
        let all: Option<Vec<f64>> = ratios.collect();
        all.map_or(Conditioned::IllConditioned, |all| {
            Conditioned::Ratio(all.into_iter().fold(0.0, max_or_nan))
        })
    };
    let results: Vec<_> = points.chunks_exact(dim).map(ratio).collect();
    let equation = "|P_grid − P| ≤ Σ|∂P/∂δ||δ|";
    Tally::with_limit("distance on a grid", equation, tolerances::GRID_DISTANCE)
        .extend_at(points, dim, results)
}

/// A torus of 256 × 256 points.
const SMALL: u32 = 8;
const SMALL_BITS: u32 = 5;

/// The states of a small torus whose image is that of an earlier one.
fn bijection(map: &dyn Fn(&mut [i64; 2])) -> Tally {
    let mut seen = HashSet::new();
    let half = 1 << (SMALL - 1);
    let states = (-half..half).flat_map(|q| (-half..half).map(move |p| [q, p]));
    let taken = |state: [i64; 2]| {
        let mut image = state;
        map(&mut image);
        Conditioned::Ratio(f64::from(u8::from(!seen.insert(image))))
    };
    let results: Vec<_> = states.map(taken).collect();
    Tally::of_counts("bijection of a torus", "2¹⁶ states, images taken twice").extend(results)
}

fn on_small_torus<G: GridPlace<f64>>(model: &Model, state: &mut [i64; 2]) {
    let mut z = state.map(|place| OnGrid::<f64, G>::from_place(place, SMALL_BITS));
    model.forward(&mut z);
    *state = z.map(|z| z.place().expect("on the grid"));
}

fn measure(case: &Case) -> Vec<Tally> {
    let (network, points, dim) = (case.network(), case.points(2), 2 * case.dof);
    let mut out = vec![distance(&network, &network, &points)];
    // Shears that are below the distances of a grid at both points say nothing of its inverse.
    let inversion = laws::inversion_on_grid(&network, &points);
    if inversion.row().verdict != Verdict::Vacuous {
        out.insert(0, inversion);
    }
    if network.architecture().has_circle() {
        let torus = TorusAction::from(case.circle());
        let turn = |angle| -> Box<dyn GridMap> {
            Box::new(Composition::of_turn_fractions(&torus, &[angle]).expect("an angle"))
        };
        out.push(circle_action(&turn, &points, dim, case.seed));
        out.push(conjugated(&network.with_epsilon(0.0), &points, dim));
    }
    out
}

/// One in one degree of freedom.
fn mild(kind: Kind) -> Case {
    Case { kind, dof: 1, scale: 0.7, epsilon: 0.3, radius: 1.6, seed: 4 }
}

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| {
        let mut rows = suite::run("on_grid", CASES, cases(), measure);
        let tori = KINDS.map(|kind| {
            let network = mild(kind).network();
            bijection(&|state| on_small_torus::<Integers<f64, SMALL>>(&network, state))
        });
        rows.extend(merged(tori).iter().map(Tally::row));
        rows
    })
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
    assert!(rows().iter().any(|row| row.law.starts_with("inversion on a grid")));
    // The bound is one, and no more than a few times what is seen.
    let distance = rows().iter().find(|row| row.law.starts_with("distance")).expect("a row");
    let largest = distance.largest.expect("measured");
    assert!(largest > tolerances::GRID_DISTANCE_SEEN, "{distance:?}");
}

/// A place on a grid that is wrong in one way.
#[derive(Clone, Copy, Debug)]
struct Faulty<const FAULT: u8> {
    sound: Integers<f64>,
}

/// The result is rounded, to a coarser grid than its own: as sums of floats are.
const RESULT: u8 = 0;
/// Increments are rounded down: R(−v) is not −R(v).
const DOWN: u8 = 1;
/// Increments are rounded to every 64th point.
const FAR: u8 = 2;

impl<const FAULT: u8> GridPlace<f64> for Faulty<FAULT> {
    fn none() -> Self {
        Self { sound: Integers::none() }
    }
    fn at(places: f64, bits: u32) -> (f64, Self) {
        let (value, sound) = Integers::at(places, bits);
        (value, Self { sound })
    }
    fn places(self, value: f64) -> f64 {
        self.sound.places(value)
    }
    fn is_on_grid(self) -> f64 {
        self.sound.is_on_grid()
    }
    fn moved(self, value: f64, by: f64) -> (f64, Self) {
        let spacing = Grid::new(BITS, GridNumbers::Integers).expect("a grid").spacing();
        let units = by / spacing;
        let by = match FAULT {
            RESULT => 4.0 * spacing * ((value + by) / (4.0 * spacing)).round_ties_even() - value,
            DOWN => spacing * units.floor(),
            _ => 64.0 * spacing * (units / 64.0).round_ties_even(),
        };
        let (value, sound) = self.sound.moved(value, by);
        (value, Self { sound })
    }
    fn negated(self, value: f64) -> (f64, Self) {
        let (value, sound) = self.sound.negated(value);
        (value, Self { sound })
    }
}

/// A network whose grid, or whose inverse, has a fault.
struct Broken {
    fault: Fault,
    sound: Model,
    /// With all parameters off by 1e-12.
    other: Model,
}

impl Broken {
    fn new(fault: Fault, sound: &Model) -> Self {
        let parameters = sound.parameters().iter().map(|w| w * (1.0 + 1e-12)).collect();
        let other = sound.with_parameters(parameters).expect("as many");
        Self { fault, sound: sound.clone(), other }
    }
}

impl Map<f64> for Broken {
    fn dof(&self) -> usize {
        self.sound.architecture().dof
    }
    fn forward(&self, z: &mut [f64]) {
        self.sound.forward(z);
    }
    fn inverse(&self, z: &mut [f64]) {
        self.sound.inverse(z);
    }
}

impl GridMap for Broken {
    fn move_places(&self, direction: Direction, grid: Grid, places: &mut [i64]) -> GridMove {
        fn run<const FAULT: u8>(model: &Model, direction: Direction, grid: Grid, z: &mut [i64]) {
            let at = |&place: &i64| OnGrid::<f64, Faulty<FAULT>>::from_place(place, grid.bits());
            let mut on: Vec<_> = z.iter().map(at).collect();
            model.run(direction, &mut on);
            z.iter_mut().zip(on).for_each(|(z, on)| *z = on.place().expect("on the grid"));
        }
        match self.fault {
            Fault::GridRoundsResult => run::<RESULT>(&self.sound, direction, grid, places),
            Fault::GridRoundsDown => run::<DOWN>(&self.sound, direction, grid, places),
            Fault::GridTooCoarse => run::<FAR>(&self.sound, direction, grid, places),
            Fault::ModuleInverse if direction == Direction::Inverse => {
                return self.other.move_places(direction, grid, places);
            }
            _ => return self.sound.move_places(direction, grid, places),
        }
        GridMove::Moved
    }
}

/// All laws on some with this fault.
pub fn rows_of_mutant(fault: Fault) -> Vec<Row> {
    let tallies =
        [Kind::Gyroceptron, Kind::SympNet, Kind::TurnedKicks].into_iter().flat_map(|kind| {
            let case = mild(kind);
            let (network, points) = (case.network(), case.points(20));
            let broken = Broken::new(fault, &network);
            let mut out = vec![
                laws::inversion_on_grid(&broken, &points),
                distance(&broken, &network, &points),
            ];
            out.push(bijection(&|state| match fault {
                // What is rounded to the small grid.
                Fault::GridRoundsResult => {
                    let scale = f64::from(1 << SMALL_BITS);
                    let mut z = state.map(|place| place as f64 / scale);
                    network.forward(&mut z);
                    *state = z.map(|z| (z * scale).round_ties_even() as i64);
                }
                _ => on_small_torus::<Integers<f64, SMALL>>(&network, state),
            }));
            if network.architecture().has_circle() {
                let torus = TorusAction::from(case.circle());
                let turn = |angle| -> Box<dyn GridMap> {
                    match fault {
                        Fault::GridRotation => Box::new(RoundedRotation(angle)),
                        _ => {
                            Box::new(Composition::of_turn_fractions(&torus, &[angle]).expect("one"))
                        }
                    }
                };
                out.push(circle_action(&turn, &points, 2, case.seed));
                let epsilon = if fault == Fault::EpsilonIgnored { case.epsilon } else { 0.0 };
                out.push(conjugated(&network.with_epsilon(epsilon), &points, 2));
            }
            out
        });
    merged(tallies).iter().map(Tally::row).collect()
}

#[test]
fn sound_ones_are_not_rejected() {
    // A fault that is none of these maps.
    let rows = rows_of_mutant(Fault::Friction);
    assert_eq!(rows.len(), 5);
    for row in &rows {
        assert_eq!(row.verdict, Verdict::Holds, "{row:?}");
    }
}
