//! The laws: each is a function of a map and points that returns a [`Tally`].
//!
//! Points are given one after the other, 2n numbers each.

use super::adjoint::{Adjoint, adjoint_ratio};
use super::circle_axioms::{CircleAxiom, conjugated_axiom_ratio, turning_axiom_ratio};
use super::coordinate::coordinate;
use super::determinant::determinant_ratio;
use super::drift::{invariant_drift, leading_invariant, log_slope};
use super::inversion::{Conditioned, ThereAndBack};
use super::near_identity::{
    differing_components, near_identity_generator, near_identity_inversion, near_identity_size,
};
use super::on_grid::{GridMap, inversion_on_grids, moves_on_grid};
use super::relations::Relation;
use super::symplecticity::symplecticity_resolution;
use super::tally::{RESOLUTION, Tally};
use super::{
    coordinate::Coordinate,
    equivariance::{NormalFormed, action_ratio, equivariance_ratio},
    measurable::{Measurable, NearlyPeriodic},
    measured_step::{MeasuredStep, StepMap, TrackedStep},
    rounding::RoundingPropagation,
    samples::CertificateOptions,
    symplecticity::symplecticity_ratio,
};
use crate::layer::{Reflection, Reversor};
use crate::network::Model;
use crate::phase::{Direction, Map};
use crate::random::Stream;
use crate::scalar::{Scalar, max_or_nan};
use crate::stopping::until_stopped;
use std::f64::consts::TAU;

/// Why a law is not tested.
pub(super) const NO_INVERSE: &str = "no inverse is given";

/// Points that are moved together.
const BATCH: usize = 1 << 12;

/// Slopes are taken from values so many times above rounding.
const ABOVE_ROUNDING: f64 = 1e3;

/// Seeded sample points, each with a pair of angles in (−2π, 2π).
#[derive(Clone, Debug)]
pub struct Samples {
    points: Vec<f64>,
    angles: Vec<[f64; 2]>,
}

impl Samples {
    /// The samples of map number `index` of a certificate.
    pub fn draw(dof: usize, index: usize, options: CertificateOptions) -> Self {
        Self::draw_within(&[], dof, index, options)
    }

    /// The samples of a map whose coordinates have a [domain](Measurable::domain).
    pub fn draw_within(
        domain: &[Coordinate],
        dof: usize,
        index: usize,
        options: CertificateOptions,
    ) -> Self {
        let mut stream = Stream::new(options.seed, &format!("certificate/points/{index}"));
        let points = (0..options.samples * 2 * dof)
            .map(|i| {
                let (low, high) = coordinate(domain, i % (2 * dof)).range(options.radius);
                stream.uniform(low, high)
            })
            .collect();
        let mut stream = Stream::new(options.seed, &format!("certificate/angles/{index}"));
        let angles = (0..options.samples)
            .map(|_| [stream.uniform(-TAU, TAU), stream.uniform(-TAU, TAU)])
            .collect();
        Self { points, angles }
    }

    /// Your own samples, as many pairs of angles as points.
    pub fn new(points: Vec<f64>, angles: Vec<[f64; 2]>) -> Self {
        Self { points, angles }
    }

    /// The points at which the laws are checked.
    pub fn points(&self) -> &[f64] {
        &self.points
    }

    fn with_angles(&self, dof: usize) -> impl Iterator<Item = (&[f64], &[f64; 2])> {
        each_point(&self.points, 2 * dof).zip(&self.angles)
    }
}

/// The points, 2n numbers each, until the measurement is to end.
pub(super) fn each_point(points: &[f64], dim: usize) -> impl Iterator<Item = &[f64]> {
    until_stopped(points.chunks_exact(dim))
}

/// The number of components that differ in their bits or are not finite.
fn differing(a: &[f64], b: &[f64]) -> usize {
    a.iter().zip(b).filter(|(a, b)| a.to_bits() != b.to_bits() || !a.is_finite()).count()
}

fn moved(map: &(impl Map<f64> + ?Sized), direction: Direction, z: &[f64]) -> Vec<f64> {
    let mut out = z.to_vec();
    match direction {
        Direction::Forward => map.forward(&mut out),
        Direction::Inverse => map.inverse(&mut out),
    }
    out
}

/// JᵀΩJ = Ω, by [`symplecticity_ratio`]. The law is vacuous unless rounding errors show.
pub fn symplecticity(map: &dyn Measurable, points: &[f64]) -> Tally {
    symplecticity_of("symplecticity of P", map, points).must_show_errors()
}

/// JᵀΩJ = Ω for a map or a part of one, under the name `law`, on any samples.
pub fn symplecticity_of(law: &str, map: &dyn Measurable, points: &[f64]) -> Tally {
    let steps = map.measured_steps(Direction::Forward);
    let dim = 2 * map.dof();
    let results = each_point(points, dim)
        .map(|z| Conditioned::Ratio(symplecticity_ratio(&RoundingPropagation::new(&steps, z))));
    Tally::of_ratios(law, "JᵀΩJ = Ω").extend_at(points, dim, results)
}

/// [`symplecticity`] for a map of unknown structure. Where no rounding errors show, because its
/// operations are few or exact, it is enough that the scales are small.
pub fn symplecticity_of_any(map: &dyn Measurable, points: &[f64]) -> Tally {
    let steps = map.measured_steps(Direction::Forward);
    let mut resolutions: Vec<f64> = each_point(points, 2 * map.dof())
        .map(|z| symplecticity_resolution(&RoundingPropagation::new(&steps, z)))
        .collect();
    resolutions.sort_by(f64::total_cmp);
    let median = resolutions.get(resolutions.len() / 2).copied().unwrap_or(f64::NAN);
    symplecticity(map, points).resolved_if(median <= RESOLUTION)
}

/// P⁻¹∘P = Id (`first` forward) or P∘P⁻¹ = Id (`first` inverse), by
/// [`ThereAndBack`].
pub fn inversion(
    law: &str,
    equation: &str,
    map: &dyn Measurable,
    first: Direction,
    points: &[f64],
) -> Tally {
    if !map.has_inverse() {
        return Tally::of_ratios(law, format!("{equation}: {NO_INVERSE}")).reported();
    }
    let both = ThereAndBack::new(map.measured_steps(first), map.measured_steps(other(first)))
        .within(map.domain());
    let dim = 2 * map.dof();
    let results = each_point(points, dim).map(|z| both.ratio(z));
    Tally::of_ratios(law, equation).extend_at(points, dim, results)
}

fn other(direction: Direction) -> Direction {
    match direction {
        Direction::Forward => Direction::Inverse,
        Direction::Inverse => Direction::Forward,
    }
}

/// L⁻¹∘L = Id for each layer alone, in the direction in which the map applies it
/// and at the points that reach it. This test remains where the composition is
/// too ill-conditioned to be tested. None for a map without layers.
pub fn layers(map: &dyn Measurable, points: &[f64]) -> Option<Tally> {
    let mut tally = Tally::of_ratios("inversion of layers", "L⁻¹∘L = Id, each");
    let layers = map.layers();
    let mut reached = points.to_vec();
    for (direction, layer) in layers.iter().filter(|(_, layer)| layer.has_inverse()) {
        let there = layer.measured_steps(*direction);
        let both = ThereAndBack::new(there, layer.measured_steps(other(*direction)))
            .within(layer.domain());
        for z in until_stopped(reached.chunks_exact_mut(2 * map.dof())) {
            tally.push_at(both.ratio(z), z);
            z.copy_from_slice(&moved(&**layer, *direction, z));
        }
    }
    (!layers.is_empty()).then_some(tally)
}

/// The steps that the other laws measure give the same bits as the map itself,
/// for one point and for many, forward and, where there is an inverse, back.
pub fn evaluation(map: &dyn Measurable, points: &[f64]) -> Tally {
    let tally = Tally::of_counts("evaluation", "shears = single = batch, bitwise");
    let dim = 2 * map.dof();
    let mut counts = vec![0; points.len() / dim];
    let ways = [Direction::Forward, Direction::Inverse];
    let ways = if map.has_inverse() { &ways[..] } else { &ways[..1] };
    for &direction in ways {
        let mut batch = points.to_vec();
        for batch in until_stopped(batch.chunks_mut(BATCH * dim)) {
            map.move_points(direction, batch);
        }
        let steps = map.measured_steps(direction);
        for (index, z) in each_point(points, dim).enumerate() {
            let mut walked = z.to_vec();
            for step in &steps {
                step.apply(&mut walked);
            }
            counts[index] += differing(&walked, &moved(map, direction, z))
                + differing(&walked, &batch[index * dim..(index + 1) * dim]);
        }
    }
    let results = until_stopped(counts).map(|count| Conditioned::Ratio(count as f64));
    tally.extend_at(points, dim, results)
}

/// P⁻¹∘P = P∘P⁻¹ = Id, bit for bit, on grids of floats and of integers, wrapping included. The result is
/// the number of [differing coordinates](super::ratios::differing_places).
pub fn inversion_on_grid(map: &dyn GridMap, points: &[f64]) -> Tally {
    let dim = 2 * map.dof();
    let moves = points.chunks_exact(dim).any(|z| moves_on_grid(map, z));
    Tally::of_counts("inversion on a grid", "P⁻¹∘P = P∘P⁻¹ = Id, bitwise")
        .extend_at(points, dim, each_point(points, dim).map(|z| inversion_on_grids(map, z)))
        .vacuous_if(!moves)
}

/// P(z + L) = P(z), modulo the circumferences, for the circumference L of each
/// coordinate that is an [angle](Coordinate::Angle). None for a map without angles.
pub fn periodicity(map: &dyn Measurable, points: &[f64]) -> Option<Tally> {
    let (domain, dim, u) = (map.domain(), 2 * map.dof(), f64::unit_roundoff());
    let angles: Vec<(usize, f64)> = domain
        .iter()
        .enumerate()
        .filter_map(|(i, coordinate)| match coordinate {
            Coordinate::Angle(period) => Some((i, *period)),
            _ => None,
        })
        .collect();
    let steps = map.measured_steps(Direction::Forward);
    let ratio = |z: &[f64]| {
        let propagation = RoundingPropagation::new(&steps, z);
        let (scales, _) = propagation.value_scales();
        let mut largest = 0.0;
        for &(i, period) in &angles {
            let mut shifted = z.to_vec();
            shifted[i] += period;
            let end = moved(map, Direction::Forward, &shifted);
            for k in 0..dim {
                let error = coordinate(&domain, k).difference(end[k] - propagation.end()[k]).abs();
                // The shift is rounded, and so are both ends.
                let of_shift = propagation.jacobian()[(k, i)].abs() * (z[i].abs() + period);
                let scale = 2.0 * scales[k] + of_shift + end[k].abs() + period;
                largest = max_or_nan(largest, error / (u * scale));
            }
        }
        Conditioned::Ratio(largest)
    };
    (!angles.is_empty()).then(|| {
        let results = each_point(points, dim).map(ratio);
        Tally::of_ratios("periodicity", "P(z + L) = P(z), of angles")
            .of_worst_case()
            .extend_at(points, dim, results)
    })
}

/// det J = 1 by faer's LU decomposition, where rounding leaves a significant digit.
///
/// For information: it cannot see defects that conserve volume.
pub fn determinant(map: &dyn Measurable, points: &[f64]) -> Tally {
    let steps = map.measured_steps(Direction::Forward);
    let results = each_point(points, 2 * map.dof())
        .map(|z| determinant_ratio(&RoundingPropagation::new(&steps, z)));
    Tally::of_ratios("determinant", "det J = 1").reported().extend(results)
}

/// I₀ = I₋₀ = Id, bit for bit.
pub fn identity_at_zero(family: &dyn NearlyPeriodic, points: &[f64]) -> Vec<Tally> {
    let dim = 2 * family.dof();
    let bitwise = |equation: &str, epsilon: f64| {
        let map = family.near_identity_at(epsilon);
        let counts = each_point(points, dim)
            .map(|z| Conditioned::Ratio(differing_components(&*map, z) as f64));
        Tally::of_counts("near identity", equation).extend_at(points, dim, counts)
    };
    vec![bitwise("I₀ = Id, bitwise", 0.0), bitwise("I₋₀ = Id, bitwise", -0.0)]
}

/// The orders of I_ε − Id and I₋ε∘I_ε − Id in ε.
pub fn near_identity_orders(family: &dyn NearlyPeriodic, points: &[f64]) -> Vec<Tally> {
    let size = |e: f64| near_identity_size(&*family.near_identity_at(e), points);
    let undoing = |e: f64| {
        let (there, back) = (family.near_identity_at(e), family.near_identity_at(-e));
        near_identity_inversion(&*there, &*back, points)
    };
    vec![
        order("|I_ε − Id| = O(ε)", 1.0, family, points, &size),
        order("|I₋ε∘I_ε − Id| = O(ε²)", 2.0, family, points, &undoing),
    ]
}

/// ∂I_ε/∂ε at ε = 0 is the Hamiltonian vector field `field(z, out)`: the
/// central difference quotient differs from it by O(ε²).
pub fn generator(
    family: &dyn NearlyPeriodic,
    field: &dyn Fn(&[f64], &mut [f64]),
    points: &[f64],
) -> Tally {
    let dim = 2 * family.dof();
    let difference = |e: f64| {
        let (plus, minus) = (family.near_identity_at(e), family.near_identity_at(-e));
        let mut largest = 0.0;
        let mut expected = vec![0.0; dim];
        for z in each_point(points, dim) {
            field(z, &mut expected);
            let a = moved(&*plus, Direction::Forward, z);
            let b = moved(&*minus, Direction::Forward, z);
            for i in 0..dim {
                // Twice ε times the error, so that rounding is that of z.
                let error = (2.0 * e).mul_add(-expected[i], a[i] - b[i]);
                largest = max_or_nan(largest, error.abs());
            }
        }
        largest
    };
    order("I_ε − I₋ε = 2ε X_G₁ + O(ε³)", 3.0, family, points, &difference)
}

fn radius(points: &[f64]) -> f64 {
    points.iter().map(|v| v.abs()).fold(0.0, max_or_nan)
}

/// The largest ε of each range that an order is looked for in, the next where
/// rounding hides it in the one before: first from where I_ε moves points by
/// about a thousandth of their size, or from 0.03 where that takes more; then
/// from where one kick of it does, by more and more. (The kicks of a layer of
/// small weights all but cancel: it is they that have to stay small.)
fn largest_epsilons(family: &dyn NearlyPeriodic, points: &[f64]) -> Vec<f64> {
    let response = near_identity_size(&*family.near_identity_at(1e-6), points) / 1e-6;
    let first = f64::min(0.03, 1e-3 * radius(points) / response);
    let unit = family.near_identity_at(1.0);
    let kick = largest_step(&*unit, points);
    let further = [1e-3, 1e-2, 1e-1].map(|share| share * radius(points) / kick);
    let further = further.into_iter().filter(|e| *e > first && e.is_finite());
    std::iter::once(first).chain(further).collect()
}

/// The largest change of a component by one step of the map.
fn largest_step(map: &dyn Measurable, points: &[f64]) -> f64 {
    let steps = map.measured_steps(Direction::Forward);
    let mut largest = 0.0;
    for point in each_point(points, 2 * map.dof()) {
        let mut z = point.to_vec();
        for step in &steps {
            let before = z.clone();
            step.apply(&mut z);
            for (a, b) in z.iter().zip(&before) {
                largest = max_or_nan(largest, (a - b).abs());
            }
        }
    }
    largest
}

/// How much is missing to the order in ε of a quantity that vanishes with it,
/// over six values of ε, halved one after the other, of which three at least
/// have to stand out of rounding. Ill-conditioned where they do so in no range;
/// vacuous where I_ε itself does not move a point by more than rounding.
fn order(
    equation: &str,
    order: f64,
    family: &dyn NearlyPeriodic,
    points: &[f64],
    value: &dyn Fn(f64) -> f64,
) -> Tally {
    let floor = ABOVE_ROUNDING * f64::unit_roundoff() * radius(points);
    let largest = largest_epsilons(family, points);
    let shortfall = |largest: &f64| {
        let (epsilons, values): (Vec<f64>, Vec<f64>) = (0..6)
            .map(|k| largest * libm::exp2(-f64::from(k)))
            .map(|epsilon| (epsilon, value(epsilon)))
            .filter(|(_, size)| !(*size <= floor))
            .unzip();
        let nan = values.iter().any(|value| value.is_nan());
        let slope = log_slope(&epsilons, &values);
        let shortfall = if slope >= order { 0.0 } else { order - slope };
        (values.len() >= 3 || nan).then_some(Conditioned::Ratio(shortfall))
    };
    let result = largest.iter().find_map(shortfall).unwrap_or(Conditioned::IllConditioned);
    let responds = largest
        .iter()
        .any(|epsilon| !(near_identity_size(&*family.near_identity_at(*epsilon), points) <= floor));
    Tally::of_slopes("near identity", equation).vacuous_if(!responds).extend([result])
}

/// P₀ = ψ∘Φ_θ∘ψ⁻¹ bit for bit, in both directions. Forward, it also has to give
/// the same bits as ψ⁻¹, Φ_θ and ψ applied one after the other.
pub fn near_periodicity(family: &dyn NearlyPeriodic, points: &[f64]) -> Tally {
    let limit = family.map_at(0.0);
    let rotation = family.conjugated_action_at(family.angle());
    let psi = family.conjugation();
    let dim = 2 * family.dof();
    let counts = each_point(points, dim).map(|z| {
        let mut parts = moved(&*psi, Direction::Inverse, z);
        family.turn(family.angle(), &mut parts);
        psi.forward(&mut parts);
        let ahead = moved(&*limit, Direction::Forward, z);
        let count = differing(&ahead, &moved(&*rotation, Direction::Forward, z))
            + differing(&ahead, &parts)
            + differing(
                &moved(&*limit, Direction::Inverse, z),
                &moved(&*rotation, Direction::Inverse, z),
            );
        Conditioned::Ratio(count as f64)
    });
    Tally::of_counts("near periodicity", "P₀ = ψ∘Φ_θ∘ψ⁻¹, bitwise").extend_at(points, dim, counts)
}

/// P = χ∘R∘χ⁻¹ bit for bit, in both directions.
pub fn normal_form(map: &dyn NormalFormed, points: &[f64]) -> Tally {
    let (chart, inner) = (map.chart(), map.inner_map());
    let dim = 2 * map.dof();
    let counts = each_point(points, dim).map(|z| {
        let mut count = 0;
        for direction in [Direction::Forward, Direction::Inverse] {
            let mut parts = moved(&*chart, Direction::Inverse, z);
            inner.run(direction, &mut parts);
            chart.forward(&mut parts);
            count += differing(&parts, &moved(map, direction, z));
        }
        Conditioned::Ratio(count as f64)
    });
    Tally::of_counts("composition", "P = χ∘Φ_θT_ε∘χ⁻¹, bitwise").extend_at(points, dim, counts)
}

/// S∘P∘S∘P = Id for a reversible map, by [`ThereAndBack`]: P between two reflections S has to be
/// the inverse of P.
pub fn reversibility(map: &dyn Measurable, reversor: Reversor, points: &[f64]) -> Tally {
    let (dof, forward) = (map.dof(), Direction::Forward);
    let reflection = || -> Box<dyn MeasuredStep> {
        let map = StepMap(Reflection { dof, reversor });
        Box::new(TrackedStep { map, direction: forward })
    };
    let mut back = vec![reflection()];
    back.extend(map.measured_steps(forward));
    back.push(reflection());
    let both = ThereAndBack::new(map.measured_steps(forward), back).within(map.domain());
    let results = each_point(points, 2 * dof).map(|z| both.ratio(z));
    Tally::of_ratios("reversibility", "S∘P∘S∘P = Id").extend_at(points, 2 * dof, results)
}

/// The laws of a map in normal form: [`normal_form`], [`equivariance`] and [`actions`].
pub fn integrable(map: &dyn NormalFormed, samples: &Samples) -> Vec<Tally> {
    let mut out = vec![normal_form(map, samples.points()), equivariance(map, samples)];
    out.extend(actions(map, samples.points()));
    out
}

/// The laws of a [perturbed](crate::network::Part::Perturbation) map in normal form: that it is
/// its composition, and for the map at ε = 0, `at_zero`, all laws of [`integrable`].
pub fn nearly_integrable(
    map: &dyn NormalFormed,
    at_zero: &dyn NormalFormed,
    samples: &Samples,
) -> Vec<Tally> {
    let whole = normal_form(map, samples.points()).stating("P = χ∘K_εΦ_θT∘χ⁻¹, bitwise");
    let at_zero = integrable(at_zero, samples).into_iter().map(of_order_one_at_zero);
    std::iter::once(whole).chain(at_zero).collect()
}

/// The laws of a reversible map P = A∘Φ_θT∘S∘A⁻¹∘S at ε = 0, where A is the identity: it commutes with
/// the torus action and conserves the actions.
pub fn reversible_at_zero(at_zero: &dyn NormalFormed, samples: &Samples) -> Vec<Tally> {
    let mut out = vec![equivariance(at_zero, samples)];
    out.extend(actions(at_zero, samples.points()));
    out.into_iter().map(of_order_one_at_zero).collect()
}

/// ε does not scale T.
fn of_order_one_at_zero(tally: Tally) -> Tally {
    tally.where_("ε = 0").restating("T_ε", "T")
}

/// P∘(χΦ_αχ⁻¹) = (χΦ_αχ⁻¹)∘P for angles α of all circles, by [`equivariance_ratio`].
pub fn equivariance(map: &dyn NormalFormed, samples: &Samples) -> Tally {
    let circles = map.action().circles().len();
    let results = samples.with_angles(map.dof()).map(|(z, angles)| {
        let angles: Vec<f64> = angles.iter().copied().cycle().take(circles).collect();
        equivariance_ratio(map, &angles, z)
    });
    let equation = "P∘(χΦ_αχ⁻¹) = (χΦ_αχ⁻¹)∘P";
    Tally::of_ratios("equivariance", equation).of_worst_case().extend_at(
        samples.points(),
        2 * map.dof(),
        results,
    )
}

/// The actions are conserved over one step and over up to 1024 steps, in the coordinates of the
/// normal form, by [`action_ratio`].
pub fn actions(map: &dyn NormalFormed, points: &[f64]) -> Vec<Tally> {
    const ITERATIONS: usize = 1024;
    let (chart, inner, action) = (map.chart(), map.inner_map(), map.action());
    let circles = action.circles();
    let each = [("𝔍∘Φ_θT_ε = 𝔍", 1), ("𝔍∘(Φ_θT_ε)ᴺ = 𝔍, N ≤ 1024", ITERATIONS)];
    let dim = 2 * map.dof();
    let of = |(equation, iterations): (&'static str, usize)| {
        let results = each_point(points, dim).map(|z| {
            let w = moved(&*chart, Direction::Inverse, z);
            Conditioned::Ratio(action_ratio(&*inner, circles, iterations, &w))
        });
        Tally::of_ratios("actions", equation).of_worst_case().extend_at(points, dim, results)
    };
    each.into_iter().map(of).collect()
}

type Form = fn(&[f64; 2]) -> CircleAxiom;
const AXIOMS: [(&str, &str, Form); 4] = [
    ("identity", "Φ₀ = Id", |_| CircleAxiom::Identity),
    ("periodicity", "Φ_{θ+2π} = Φ_θ", |a| CircleAxiom::Periodicity(a[0])),
    ("additivity", "Φ_{θ₁+θ₂} = Φ_θ₁∘Φ_θ₂", |a| {
        CircleAxiom::Additivity(a[0], a[1])
    }),
    ("inverse", "Φ₋θ∘Φ_θ = Id", |a| CircleAxiom::Inverse(a[0])),
];

/// The axioms of the circle action Φ.
pub fn circle_action(family: &dyn NearlyPeriodic, samples: &Samples) -> Vec<Tally> {
    let weights = family.action_weights();
    let each = AXIOMS.iter().map(|(name, equation, form)| {
        let ratios = samples.with_angles(weights.len()).map(|(z, a)| {
            let turn = |angle: f64, z: &mut [f64]| family.turn(angle, z);
            Conditioned::Ratio(turning_axiom_ratio(&weights, turn, form(a), z))
        });
        Tally::of_ratios(format!("circle action: {name}"), *equation).extend(ratios)
    });
    each.collect()
}

/// The axioms of the conjugated action ψ∘Φ∘ψ⁻¹.
pub fn conjugated_circle_action(family: &dyn NearlyPeriodic, samples: &Samples) -> Vec<Tally> {
    let dof = family.dof();
    let each = AXIOMS.iter().map(|(name, equation, form)| {
        let ratios =
            samples.with_angles(dof).map(|(z, a)| conjugated_axiom_ratio(family, form(a), z));
        Tally::of_ratios(format!("conjugated by ψ: {name}"), *equation).extend(ratios)
    });
    each.collect()
}

/// ⟨c, DP·d⟩ = ⟨DPᵀ·c, d⟩: the pullback, in the point and in all parameters, is the
/// transpose of the derivative by dual numbers. By [`adjoint_ratio`] with seeded
/// directions.
pub fn pullback(map: &dyn Adjoint, points: &[f64], dof: usize, seed: u64) -> Tally {
    let mut stream = Stream::new(seed, "certificate/directions");
    let count = 2 * dof + map.parameters().len();
    let mut draw = |count| (0..count).map(|_| stream.uniform(-1.0, 1.0)).collect::<Vec<_>>();
    let results = each_point(points, 2 * dof)
        .map(|z| adjoint_ratio(map, z, &draw(count), &draw(2 * dof)))
        .collect::<Vec<_>>();
    Tally::of_ratios("gradient", "⟨c, DP·d⟩ = ⟨DPᵀ·c, d⟩").of_worst_case().extend(results)
}

/// The exact relations of a network of tanh potentials.
pub fn exact_relations(model: &Model, points: &[f64]) -> Vec<Tally> {
    let each = Relation::ALL.iter().filter_map(|relation| {
        // Scaled parameters that leave the finite numbers relate to nothing.
        let other = relation.transform_model(model).ok()?;
        let transform = |z: &mut [f64]| relation.transform_point(z);
        Some(exact_relation(relation.equation(), model, &other, &transform, points))
    });
    each.collect()
}

/// [`generator`] for the near-identity part of a gyroceptron, with its formula as the field.
pub fn formula_of_generator(network: &Model, points: &[f64]) -> Tally {
    let field = |z: &[f64], out: &mut [f64]| near_identity_generator(network, z, out);
    generator(network, &field, points)
}

/// The exponent of the drift D(N) of μ₀ in N along the orbit of the first
/// point, N = 256 … 4096: near 0 for an adiabatic invariant, 1 for a quantity
/// that drifts slowly but steadily.
///
/// For information: on a resonance there is no invariant, and near one the
/// orbit takes longer to reach its full range.
pub fn adiabatic_invariance(family: &dyn NearlyPeriodic, points: &[f64]) -> Tally {
    const EXPONENT: f64 = 0.2;
    const HORIZONS: [usize; 5] = [256, 512, 1024, 2048, 4096];
    let tally = Tally::with_limit("adiabatic invariant", "|μ₀ − μ₀(0)| ∝ N⁰", EXPONENT).reported();
    let Some(start) = each_point(points, 2 * family.dof()).next() else { return tally };
    let psi = family.conjugation();
    let invariant = leading_invariant(&*psi, &family.action_weights());
    let drifts = invariant_drift(family, &invariant, start, &HORIZONS);
    let exponent = log_slope(&HORIZONS.map(|n| n as f64), &drifts);
    tally.extend([Conditioned::Ratio(exponent.abs())])
}

/// Q∘T = T∘P, bit for bit, for Q = `other` and the change of variables T =
/// `transform`: an exact symmetry of the parameters takes P to Q.
///
/// The transformation has to be exact in floating point: powers of two, signs,
/// permutations.
pub fn exact_relation(
    equation: &str,
    map: &(impl Map<f64> + ?Sized),
    other: &(impl Map<f64> + ?Sized),
    transform: &dyn Fn(&mut [f64]),
    points: &[f64],
) -> Tally {
    let mut tally = Tally::of_counts("exact relation", equation);
    for z in each_point(points, 2 * map.dof()) {
        let mut count = 0;
        for direction in [Direction::Forward, Direction::Inverse] {
            let mut left = moved(map, direction, z);
            transform(&mut left);
            let mut right = z.to_vec();
            transform(&mut right);
            count += differing(&left, &moved(other, direction, &right));
        }
        tally.push_at(Conditioned::Ratio(count as f64), z);
    }
    tally
}
