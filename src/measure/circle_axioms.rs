//! The axioms of a circle action, for Φ and for ψ∘Φ∘ψ⁻¹.

use super::inversion::ILL_CONDITIONED;
use super::{inversion::Conditioned, measurable::NearlyPeriodic, rounding::RoundingPropagation};
use crate::layer::CircleAction;
use crate::phase::Direction;
use crate::scalar::{Scalar, max_or_nan};
use std::f64::consts::TAU;

/// One of the axioms, with its angles in radians.
///
/// Source: Duruisseaux, Burby and Tang, <https://doi.org/10.1038/s41598-023-34862-w>, definition of
/// a circle action.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CircleAxiom {
    /// The action of the angle 0 is the identity, Φ₀ = Id.
    Identity,
    /// Φ_{θ + 2π} = Φ_θ.
    Periodicity(f64),
    /// Φ_{θ₁ + θ₂} = Φ_{θ₁}∘Φ_{θ₂}.
    Additivity(f64, f64),
    /// The action of −θ undoes that of θ, Φ_{−θ}∘Φ_θ = Id.
    Inverse(f64),
}

impl CircleAxiom {
    /// The two sides, each as angles applied one after the other.
    fn sides(self) -> [Vec<f64>; 2] {
        match self {
            Self::Identity => [vec![0.0], vec![]],
            Self::Periodicity(a) => [vec![a + TAU], vec![a]],
            Self::Additivity(a, b) => [vec![a + b], vec![b, a]],
            Self::Inverse(a) => [vec![a, -a], vec![]],
        }
    }

    /// The bound of |left − right| in a plane of weight m, in units of
    /// u·(the plane's radius).
    ///
    /// 4 for the shears themselves, |m·angle| for the rounding of the sum of
    /// angles, 2.2 because fl(2π) − 2π = −2.2u; nothing for the identity,
    /// which is bitwise.
    fn bound(self, weight: i32) -> f64 {
        let m = f64::from(weight).abs();
        match self {
            Self::Identity => 0.0,
            Self::Periodicity(a) => 4.0 + m * (2.2 + (a + TAU).abs()),
            Self::Additivity(a, b) => 4.0 + m * (a + b).abs(),
            Self::Inverse(_) => 4.0,
        }
    }
}

fn radii(z: &[f64]) -> Vec<f64> {
    let n = z.len() / 2;
    (0..n).map(|j| libm::hypot(z[j], z[n + j])).collect()
}

/// An error over its bound or its rounding scale, where 0 over 0 is 0.
fn over(error: f64, size: f64) -> f64 {
    if error == 0.0 { 0.0 } else { error / size }
}

/// The defect of the axiom for Φ at z divided by its bound: the largest such
/// ratio over the components.
pub fn circle_axiom_ratio(action: &CircleAction, axiom: CircleAxiom, z: &[f64]) -> f64 {
    let turn = |angle: f64, z: &mut [f64]| action.turn_by(angle).apply(z, false);
    turning_axiom_ratio(action.weights(), turn, axiom, z)
}

/// The defect of the axiom at z over its bound ([`circle_axiom_ratio`]), for any
/// map `turn(θ, z)` that claims to turn the plane (q_j, p_j) by `weights[j]`·θ.
pub fn turning_axiom_ratio(
    weights: &[i32],
    turn: impl Fn(f64, &mut [f64]),
    axiom: CircleAxiom,
    z: &[f64],
) -> f64 {
    let apply = |angles: &[f64]| {
        let mut out = z.to_vec();
        for &angle in angles {
            turn(angle, &mut out);
        }
        out
    };
    let [left, right] = axiom.sides();
    let (left, right) = (apply(&left), apply(&right));
    let n = weights.len();
    let radii = radii(z);
    let mut largest = 0.0;
    for i in 0..2 * n {
        let weight = weights[i % n];
        // Where it is not exact, underflow rounds to multiples of 2⁻¹⁰⁷⁴.
        let bound = match axiom.bound(weight) {
            0.0 => 0.0,
            units => f64::unit_roundoff() * (units * radii[i % n] + f64::MIN_POSITIVE),
        };
        let bound = if weight == 0 { 0.0 } else { bound };
        let error = (left[i] - right[i]).abs();
        let same_zero = axiom != CircleAxiom::Identity || left[i].to_bits() == right[i].to_bits();
        let error = if same_zero { error } else { f64::INFINITY };
        largest = max_or_nan(largest, over(error, bound));
    }
    largest
}

/// The defect of the axiom for the conjugated action ψ∘Φ_θ∘ψ⁻¹ at z divided by
/// its rounding scale: the bound of Φ, propagated through ψ by its Jacobian, plus
/// the rounding scale of ψ itself, a root of a sum of squares.
pub fn conjugated_axiom_ratio(
    family: &dyn NearlyPeriodic,
    axiom: CircleAxiom,
    z: &[f64],
) -> Conditioned {
    let u = f64::unit_roundoff();
    let dim = z.len();
    let mut squares: Vec<f64> = z.to_vec();
    let (mut reach, mut linear) = (0.0_f64, true);
    let mut ends = Vec::new();
    for side in axiom.sides() {
        let maps: Vec<_> = side.iter().map(|&angle| family.conjugated_action_at(angle)).collect();
        let steps: Vec<_> =
            maps.iter().flat_map(|map| map.measured_steps(Direction::Forward)).collect();
        let propagation = RoundingPropagation::new(&steps, z);
        let (scales, sums) = propagation.value_scales();
        for (square, scale) in squares.iter_mut().zip(scales) {
            *square = libm::hypot(*square, scale);
        }
        reach = sums.into_iter().fold(reach, max_or_nan);
        linear &= propagation.is_linear();
        ends.push(propagation.end().to_vec());
    }
    // |G|, the Jacobian of ψ where Φ leaves w = ψ⁻¹(z).
    let psi = family.conjugation();
    let weights = family.action_weights();
    let mut w = z.to_vec();
    psi.inverse(&mut w);
    for &angle in &axiom.sides()[0] {
        family.turn(angle, &mut w);
    }
    let steps = psi.measured_steps(Direction::Forward);
    let conjugation = RoundingPropagation::new(&steps, &w);
    let radii = radii(&w);
    if ends.iter().flatten().any(|v| !v.is_finite()) {
        return Conditioned::Ratio(f64::NAN);
    }
    let size = z.iter().map(|v| v.abs()).fold(0.0, max_or_nan);
    let mut largest = 0.0;
    let mut ill_conditioned = !linear;
    for row in 0..dim {
        let mut carried = 0.0;
        for column in 0..dim {
            let plane = column % (dim / 2);
            let weight = weights[plane];
            if weight != 0 {
                let entry = conjugation.jacobian()[(row, column)].abs();
                carried += entry * axiom.bound(weight) * radii[plane];
            }
        }
        ill_conditioned |= !(u * (reach + carried) <= ILL_CONDITIONED * size);
        let scale = u * (squares[row] + carried);
        let error = (ends[0][row] - ends[1][row]).abs();
        largest = max_or_nan(largest, over(error, scale));
    }
    if ill_conditioned { Conditioned::IllConditioned } else { Conditioned::Ratio(largest) }
}
