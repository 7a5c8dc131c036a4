//! Maps in normal form: equivariance under a torus action, and conservation of its actions.

use super::inversion::ILL_CONDITIONED;
use super::{
    inversion::Conditioned,
    measurable::Measurable,
    measured_step::{MeasuredSteps, turn_steps},
    rounding::RoundingPropagation,
};
use crate::layer::{CircleAction, TorusAction, Turn};
use crate::network::Model;
use crate::phase::Direction;
use crate::scalar::{Scalar, max_or_nan};

/// A map P = χ∘R∘χ⁻¹ whose inner map R claims to commute with a torus action.
/// A [`Model`] of that structure implements it; so can any map built this way.
pub trait NormalFormed: Measurable {
    /// χ, the map from the coordinates of the normal form to those of P.
    fn chart(&self) -> Box<dyn Measurable + '_>;
    /// R, the map in the coordinates of the normal form.
    fn inner_map(&self) -> Box<dyn Measurable + '_>;
    /// The action that R commutes with.
    fn action(&self) -> TorusAction;
}

/// Seen as χ∘(K_ε∘Φ_θ∘T_ε)∘χ⁻¹ with the parts of a network. The laws find out whether it is one.
impl NormalFormed for Model {
    fn chart(&self) -> Box<dyn Measurable + '_> {
        Box::new(Model::chart(self))
    }
    fn inner_map(&self) -> Box<dyn Measurable + '_> {
        let [_, inner] = self.chart_and_inner_map();
        Box::new(inner)
    }
    fn action(&self) -> TorusAction {
        self.architecture()
            .action()
            .unwrap_or_else(|| TorusAction::of_planes(self.architecture().dof))
    }
}

/// A turn of a plane is three shears with two rounded coefficients: it leaves the circle by
/// at most so many u times its radius, as in the axioms of the circle action.
const OF_TURN: f64 = 4.0;

/// The defect of P∘(χΦ_αχ⁻¹) = (χΦ_αχ⁻¹)∘P at z divided by its rounding scale, the largest over
/// the components. The scale is a root of a sum of squares of the rounding of both sides, step by step, and has that of
/// the coefficients of the turns, propagated to the end by the Jacobians of the later steps.
pub fn equivariance_ratio(map: &dyn NormalFormed, angles: &[f64], z: &[f64]) -> Conditioned {
    let u = f64::unit_roundoff();
    let (dim, turn) = (z.len(), map.action().turn_by(angles));
    let (chart, inner) = (map.chart(), map.inner_map());
    let turned = || -> MeasuredSteps<'_> {
        let mut steps = chart.measured_steps(Direction::Inverse);
        steps.extend(turn_steps(&turn, Direction::Forward));
        steps.extend(chart.measured_steps(Direction::Forward));
        steps
    };
    let mut first = turned();
    first.extend(map.measured_steps(Direction::Forward));
    let mut second = map.measured_steps(Direction::Forward);
    second.extend(turned());
    let propagations = [RoundingPropagation::new(&first, z), RoundingPropagation::new(&second, z)];
    let mut squares: Vec<f64> = z.to_vec();
    let (mut reach, mut linear) = (0.0_f64, true);
    for propagation in &propagations {
        let (scales, sums) = propagation.value_scales();
        for (square, scale) in squares.iter_mut().zip(scales) {
            *square = libm::hypot(*square, scale);
        }
        reach = sums.into_iter().fold(reach, max_or_nan);
        linear &= propagation.is_linear();
    }
    // Where Φ_α leaves the point, and where R then does.
    let mut after_turn = z.to_vec();
    chart.inverse(&mut after_turn);
    turn.apply(&mut after_turn, false);
    let mut after_step = after_turn.clone();
    inner.forward(&mut after_step);
    let mut rest = inner.measured_steps(Direction::Forward);
    rest.extend(chart.measured_steps(Direction::Forward));
    let outer = chart.measured_steps(Direction::Forward);
    // Once Φ_α with all behind it; Φ_θ, the turn of R, and Φ_α again at the end.
    let carried = [(&rest, &after_turn, 1.0), (&outer, &after_step, 3.0)];
    let mut of_turns = vec![0.0; dim];
    for (steps, w, times) in carried {
        let propagation = RoundingPropagation::new(steps, w);
        let radii = radii(&turn, w);
        for row in 0..dim {
            for column in 0..dim {
                let entry = propagation.jacobian()[(row, column)].abs();
                of_turns[row] += times * OF_TURN * entry * radii[column % (dim / 2)];
            }
        }
    }
    let [a, b] = [propagations[0].end(), propagations[1].end()];
    if a.iter().chain(b).any(|v| !v.is_finite()) {
        return Conditioned::Ratio(f64::NAN);
    }
    let size = z.iter().map(|v| v.abs()).fold(0.0, max_or_nan);
    let mut largest = 0.0;
    for row in 0..dim {
        reach = max_or_nan(reach, of_turns[row]);
        let error = (a[row] - b[row]).abs();
        let scale = u * (squares[row] + of_turns[row]);
        largest = max_or_nan(largest, if error == 0.0 { 0.0 } else { error / scale });
    }
    if !(u * reach <= ILL_CONDITIONED * size) || !linear {
        return Conditioned::IllConditioned;
    }
    Conditioned::Ratio(largest)
}

/// Of the planes that turn; 0 of the others.
fn radii(turn: &Turn<f64>, w: &[f64]) -> Vec<f64> {
    let dof = turn.dof();
    let mut out = vec![0.0; dof];
    for plane in turn.planes() {
        out[plane.plane] = libm::hypot(w[plane.plane], w[dof + plane.plane]);
    }
    out
}

/// Each of the two turns of a step has three shears, of which each rounds one coordinate by
/// u times its size and leaves the rounding of its coefficient: an action changes by at
/// most so many u times Σ|m_j|(q_j² + p_j²).
const OF_STEP: f64 = 12.0;

/// The largest change of an action 𝔍_a over `iterations` iterations of the inner map from w, divided
/// by its rounding scale: the bound of a step times √iterations, as for independent errors. A drift
/// outgrows it. An orbit ends where the map is [beyond](Measurable::is_beyond) its range of use.
pub fn action_ratio(
    inner: &dyn Measurable,
    circles: &[CircleAction],
    iterations: usize,
    w: &[f64],
) -> f64 {
    let mut moved = w.to_vec();
    let before: Vec<f64> = circles.iter().map(|circle| circle.invariant(w)).collect();
    let n = w.len() / 2;
    let scales: Vec<f64> = circles
        .iter()
        .map(|circle| {
            let of_plane = |(j, m): (usize, &i32)| {
                f64::from(m.abs()) * w[j].mul_add(w[j], w[n + j] * w[n + j])
            };
            let size: f64 = circle.weights().iter().enumerate().map(of_plane).sum();
            let steps = (iterations as f64).sqrt();
            f64::unit_roundoff() * OF_STEP * (steps * size + f64::MIN_POSITIVE)
        })
        .collect();
    let mut largest = 0.0;
    for step in 0..iterations {
        if step > 0 && inner.is_beyond(&moved) {
            break;
        }
        inner.forward(&mut moved);
        for ((circle, before), scale) in circles.iter().zip(&before).zip(&scales) {
            let error = (circle.invariant(&moved) - before).abs();
            largest = max_or_nan(largest, if error == 0.0 { 0.0 } else { error / scale });
        }
    }
    largest
}
